//! Kernels made by hand, with the SPIR-V that belongs to them.

#![allow(dead_code, reason = "each test binary uses a part of it")]

use hankel_dsl::native::describe::*;
use spirv_tools::TargetEnv;
use spirv_tools::assembler::Assembler;

/// Assembles SPIR-V text.
pub fn assemble(text: &str) -> Vec<u8> {
    let assembler = spirv_tools::assembler::create(Some(TargetEnv::Vulkan_1_2));
    let options = spirv_tools::assembler::AssemblerOptions {
        preserve_numeric_ids: false,
    };
    assembler
        .assemble(text, options)
        .expect("the fixture assembles")
        .as_bytes()
        .to_vec()
}

/// SPIR-V of a fixture.
pub fn spirv(name: &str) -> Vec<u8> {
    assemble(match name {
        "bound" => include_str!("../fixtures/bound.spvasm"),
        "resample" => include_str!("../fixtures/resample.spvasm"),
        "exchange" => include_str!("../fixtures/exchange.spvasm"),
        "fullscreen" => include_str!("../fixtures/fullscreen.spvasm"),
        "tint" => include_str!("../fixtures/tint.spvasm"),
        "total" => include_str!("../fixtures/total.spvasm"),
        "rounding" => include_str!("../fixtures/rounding.spvasm"),
        "wide_f64" => include_str!("../fixtures/wide.spvasm"),
        other => panic!("no fixture `{other}`"),
    })
}

/// All hand-made kernels.
pub fn all() -> Vec<Kernel> {
    vec![
        bound(),
        resample(),
        exchange(),
        total(),
        fullscreen(),
        tint(),
        rounding(),
        wide(),
    ]
}

fn kernel(name: &str, stage: Stage, params: Vec<Param>, outputs: Vec<Output>) -> Kernel {
    Kernel {
        name: name.into(),
        function: name.into(),
        summary: "Does what a test\nneeds.".into(),
        file: "/elsewhere/kernels/src/lib.rs".into(),
        line: 7,
        licence: String::new(),
        stage,
        precision: None,
        params,
        outputs,
        tolerance: Tolerance {
            ulp: 0,
            absolute: 0.0,
            non_finite: false,
            why: "only + - * / and sqrt".into(),
        },
        rounding: Rounding::Free,
        subgroups: Subgroups::Unused,
        compensated: None,
        image_pass: None,
        invariant: false,
    }
}

fn compute(threads: [u32; 3], dimensions: u32) -> Stage {
    Stage::Compute {
        threads,
        dimensions,
        cooperative: false,
        workgroup_bytes: 0,
        range: Range::Outputs,
    }
}

fn param(name: &str, role: Role) -> Param {
    Param {
        name: name.into(),
        role,
        inputs: Inputs::default(),
    }
}

/// A structure of `f32`.
pub fn floats(name: &str, fields: &[&str]) -> Layout {
    Layout {
        name: name.into(),
        size: 4 * fields.len() as u32,
        align: 4,
        fields: fields
            .iter()
            .zip(0..)
            .map(|(field, index)| Field {
                name: (*field).into(),
                summary: format!("The {field}."),
                ty: Type::Scalar {
                    scalar: Scalar::F32,
                },
                offset: 4 * index,
                size: 4,
                inputs: Inputs::default(),
            })
            .collect(),
    }
}

fn plain(scalar: Scalar, name: &str, size: u32) -> Layout {
    let ty = Type::Scalar { scalar };
    let fields = vec![Field {
        name: String::new(),
        summary: String::new(),
        ty,
        offset: 0,
        size,
        inputs: Inputs::default(),
    }];
    Layout {
        name: name.into(),
        size,
        align: size,
        fields,
    }
}

fn vector(size: u32) -> Type {
    Type::Vector {
        scalar: Scalar::F32,
        size,
    }
}

pub fn bound() -> Kernel {
    let settings = floats("Settings", &["bias", "depth_bias", "pad0", "pad1"]);
    let moments = floats("Moments", &["b1", "b2", "b3", "b4", "z"]);
    let shadow = floats("Shadow", &["visibility", "error"]);
    let mut bound = kernel(
        "bound",
        compute([64, 1, 1], 1),
        vec![
            param(
                "settings",
                Role::Uniform {
                    binding: 0,
                    layout: settings,
                    push: false,
                },
            ),
            param(
                "input",
                Role::Element {
                    binding: 1,
                    layout: moments,
                },
            ),
        ],
        vec![Output::Buffer {
            binding: 2,
            layout: shadow,
        }],
    );
    bound.precision = Some(Precision::F32);
    bound
}

pub fn resample() -> Kernel {
    let texture = |binding, texture| Role::Texture { binding, texture };
    let mut resample = kernel(
        "resample",
        compute([8, 8, 1], 2),
        vec![
            param("index", Role::Index),
            param(
                "taps",
                Role::Constant {
                    id: 7,
                    scalar: Scalar::U32,
                    default: 3,
                },
            ),
            param("source", texture(0, TextureKind::Texture2d)),
            param(
                "linear",
                Role::Sampler {
                    binding: 1,
                    sampler: SamplerKind::Filtering,
                },
            ),
            param("depth", texture(2, TextureKind::Texture2dMultisampled)),
        ],
        vec![Output::Texture {
            binding: 3,
            format: TexelFormat::Rgba16Unorm,
            dimensions: 2,
        }],
    );
    resample.tolerance = Tolerance {
        ulp: 0,
        absolute: 1.5e-5,
        non_finite: false,
        why: "one step of 16-bit unorm".into(),
    };
    resample
}

pub fn exchange() -> Kernel {
    let number = || plain(Scalar::U32, "u32", 4);
    let shared = || Role::Shared {
        layout: number(),
        length: 64,
        atomic: false,
    };
    let stage = Stage::Compute {
        threads: [64, 1, 1],
        dimensions: 1,
        cooperative: true,
        workgroup_bytes: 512,
        range: Range::Outputs,
    };
    kernel(
        "exchange",
        stage,
        vec![
            param(
                "input",
                Role::Storage {
                    binding: 0,
                    layout: number(),
                },
            ),
            param("front", shared()),
            param("back", shared()),
        ],
        vec![Output::Buffer {
            binding: 1,
            layout: number(),
        }],
    )
}

pub fn total() -> Kernel {
    let number = || plain(Scalar::F32, "f32", 4);
    kernel(
        "total",
        compute([64, 1, 1], 1),
        vec![param(
            "terms",
            Role::Storage {
                binding: 0,
                layout: number(),
            },
        )],
        vec![Output::Buffer {
            binding: 1,
            layout: number(),
        }],
    )
}

pub fn fullscreen() -> Kernel {
    let attribute = Role::Attribute {
        location: 0,
        ty: vector(2),
    };
    kernel(
        "fullscreen",
        Stage::Vertex,
        vec![param("at", attribute)],
        vec![
            Output::Position,
            Output::Varying {
                location: 0,
                ty: vector(2),
                interpolation: Interpolation::Perspective,
            },
        ],
    )
}

pub fn tint() -> Kernel {
    let map = Role::Texture {
        binding: 0,
        texture: TextureKind::Texture2d,
    };
    kernel(
        "tint",
        Stage::Fragment,
        vec![
            param("map", map),
            param(
                "linear",
                Role::Sampler {
                    binding: 1,
                    sampler: SamplerKind::Filtering,
                },
            ),
            param(
                "uv",
                Role::Varying {
                    location: 0,
                    ty: vector(2),
                    interpolation: Interpolation::Perspective,
                },
            ),
        ],
        vec![Output::Target {
            location: 0,
            ty: vector(4),
        }],
    )
}

/// Exact: right only if it is computed as it is written.
pub fn rounding() -> Kernel {
    let mut rounding = kernel(
        "rounding",
        compute([64, 1, 1], 1),
        vec![param(
            "input",
            Role::Element {
                binding: 0,
                layout: floats("Pair", &["x", "w"]),
            },
        )],
        vec![Output::Buffer {
            binding: 1,
            layout: floats("Pair", &["x", "w"]),
        }],
    );
    rounding.rounding = Rounding::Exact;
    rounding
}

pub fn wide() -> Kernel {
    let number = || plain(Scalar::F64, "f64", 8);
    let mut wide = kernel(
        "wide_f64",
        compute([64, 1, 1], 1),
        vec![param(
            "input",
            Role::Element {
                binding: 0,
                layout: number(),
            },
        )],
        vec![Output::Buffer {
            binding: 1,
            layout: number(),
        }],
    );
    wide.function = "wide".into();
    wide.precision = Some(Precision::F64);
    wide
}

/// Raw modules of all hand-made kernels.
pub fn modules() -> hankel_codegen::build::Modules {
    hankel_codegen::build::Modules::Raw(
        all()
            .iter()
            .map(|kernel| (kernel.name.clone(), spirv(&kernel.name)))
            .collect(),
    )
}

/// A request for all of them in every language.
pub fn request() -> hankel_codegen::build::Request {
    hankel_codegen::build::Request {
        crate_name: "by-hand".into(),
        kernels: all(),
        filter: Vec::new(),
        targets: Vec::new(),
        options: hankel_codegen::translate::Options {
            shader_model: "6.2".parse().unwrap(),
            ..Default::default()
        },
        rust_gpu: "0.10.0".into(),
    }
}
