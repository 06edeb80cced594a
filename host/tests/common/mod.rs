//! Small kernels written by hand, each described, native and in WGSL, so that the tests need
//! neither a compiler nor the built-in kernels.
#![allow(dead_code, reason = "each test file uses some of them")]

use hankel_dsl::Texture3d;
use hankel_dsl::glam::Vec3;
use hankel_dsl::native::describe::*;
use hankel_dsl::native::{Arg, Call, CallError};
use hankel_host::crates::KernelEntry;
use hankel_host::device::{Program, Shader, VulkanDevice};

/// A kernel and its code.
pub struct Sample {
    pub kernel: Kernel,
    pub native: fn(&mut Call<'_>) -> Result<(), CallError>,
    pub wgsl: String,
    pub spirv: Vec<u32>,
}

/// Which way the code takes.
#[derive(Clone, Copy, Debug)]
pub enum Way {
    Passthrough,
    Naga,
    Wgsl,
}

pub const WAYS: [Way; 3] = [Way::Passthrough, Way::Naga, Way::Wgsl];

impl Sample {
    pub fn program(&self, way: Way) -> Program<'_> {
        Program {
            kernel: &self.kernel,
            constants: &[],
            native: Some(&self.native),
            shader: Some(match way {
                Way::Passthrough => Shader::SpirvPassthrough(&self.spirv),
                Way::Naga => Shader::SpirvThroughNaga(&self.spirv),
                Way::Wgsl => Shader::Wgsl {
                    text: &self.wgsl,
                    entry_point: &self.kernel.name,
                },
            }),
        }
    }
}

pub fn vulkan() -> VulkanDevice {
    VulkanDevice::new().unwrap_or_else(|e| panic!("{e}"))
}

pub const BIT_FOR_BIT: (u32, f64) = (0, 0.0);

pub fn kernel(name: &str, stage: Stage, params: Vec<Param>, outputs: Vec<Output>) -> Kernel {
    Kernel {
        name: name.into(),
        function: name.into(),
        summary: format!("Test kernel `{name}`."),
        file: file!().into(),
        line: 1,
        licence: String::new(),
        stage,
        precision: None,
        params,
        outputs,
        tolerance: Tolerance {
            ulp: 0,
            absolute: 0.0,
            non_finite: false,
            why: "no rounding differs".into(),
        },
        rounding: Rounding::Free,
        subgroups: Subgroups::Unused,
        compensated: None,
        image_pass: None,
        invariant: false,
    }
}

pub fn compute(threads: [u32; 3], dimensions: u32) -> Stage {
    Stage::Compute {
        threads,
        dimensions,
        cooperative: false,
        workgroup_bytes: 0,
        range: Range::Outputs,
    }
}

pub fn param(name: &str, role: Role) -> Param {
    Param {
        name: name.into(),
        role,
        inputs: Inputs::default(),
    }
}

pub fn scalar(scalar: Scalar) -> Type {
    Type::Scalar { scalar }
}

pub fn vector(scalar: Scalar, size: u32) -> Type {
    Type::Vector { scalar, size }
}

pub fn plain(name: &str, ty: Scalar) -> Layout {
    let size = if ty == Scalar::F64 { 8 } else { 4 };
    let field = Field {
        name: String::new(),
        summary: String::new(),
        ty: scalar(ty),
        offset: 0,
        size,
        inputs: Inputs::default(),
    };
    Layout {
        name: name.into(),
        size,
        align: size,
        fields: vec![field],
    }
}

pub fn structure(name: &str, fields: &[(&str, Scalar)]) -> Layout {
    let size = |s| if s == Scalar::F64 { 8 } else { 4 };
    let mut offset = 0;
    let fields: Vec<Field> = fields
        .iter()
        .map(|&(name, ty)| {
            let field = Field {
                name: name.into(),
                summary: String::new(),
                ty: scalar(ty),
                offset,
                size: size(ty),
                inputs: Inputs::default(),
            };
            offset += size(ty);
            field
        })
        .collect();
    let align = fields.iter().map(|f| f.size).max().unwrap_or(4);
    Layout {
        name: name.into(),
        size: offset.next_multiple_of(align),
        align,
        fields,
    }
}

/// WGSL to SPIR-V, as a compiler would hand it over: no bounds checks.
pub fn spirv(wgsl: &str) -> Vec<u32> {
    let module = naga::front::wgsl::parse_str(wgsl).unwrap_or_else(|e| panic!("{wgsl}\n{e}"));
    let info = naga::valid::Validator::new(
        naga::valid::ValidationFlags::all(),
        naga::valid::Capabilities::all(),
    )
    .validate(&module)
    .unwrap_or_else(|e| panic!("{wgsl}\n{e:?}"));
    let options = naga::back::spv::Options {
        lang_version: (1, 3),
        flags: naga::back::spv::WriterFlags::empty(),
        ..Default::default()
    };
    naga::back::spv::write_vec(&module, &info, &options, None).unwrap_or_else(|e| panic!("{e:?}"))
}

fn sample(
    kernel: Kernel,
    native: fn(&mut Call<'_>) -> Result<(), CallError>,
    wgsl: &str,
) -> Sample {
    Sample {
        kernel,
        native,
        wgsl: wgsl.into(),
        spirv: spirv(wgsl),
    }
}

fn f32s(bytes: &[u8]) -> &[f32] {
    bytemuck::cast_slice(bytes)
}

/// `out = (x * scale + offset) / y`, `x` and `y` of one element.
pub fn affine() -> Sample {
    let settings = structure(
        "Settings",
        &[("scale", Scalar::F32), ("offset", Scalar::F32)],
    );
    let pair = structure("Pair", &[("x", Scalar::F32), ("y", Scalar::F32)]);
    let kernel = kernel(
        "affine",
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
                "pair",
                Role::Element {
                    binding: 1,
                    layout: pair,
                },
            ),
            param("index", Role::Index),
        ],
        vec![Output::Buffer {
            binding: 2,
            layout: plain("f32", Scalar::F32),
        }],
    );
    fn run(call: &mut Call<'_>) -> Result<(), CallError> {
        let [Arg::Bytes(settings), Arg::Bytes(pairs), Arg::BytesMut(out)] = &mut call.args[..]
        else {
            return Err(CallError::Count {
                expected: 3,
                got: call.args.len(),
            });
        };
        let (s, pairs) = (f32s(settings), f32s(pairs));
        for (o, p) in bytemuck::cast_slice_mut::<u8, f32>(out)
            .iter_mut()
            .zip(pairs.chunks(2))
        {
            *o = (p[0] * s[0] + s[1]) / p[1];
        }
        Ok(())
    }
    sample(
        kernel,
        run,
        "struct Settings { scale: f32, offset: f32 }
         struct Pair { x: f32, y: f32 }
         @group(0) @binding(0) var<uniform> settings: Settings;
         @group(0) @binding(1) var<storage, read> pair: array<Pair>;
         @group(0) @binding(2) var<storage, read_write> out: array<f32>;
         @compute @workgroup_size(64) fn affine(@builtin(global_invocation_id) id: vec3<u32>) {
             if (id.x < arrayLength(&out)) {
                 let p = pair[id.x];
                 out[id.x] = (p.x * settings.scale + settings.offset) / p.y;
             }
         }",
    )
}

/// `out = sqrt(x) + table[i % 4]` in `f64`.
pub fn double() -> Sample {
    let mut kernel = kernel(
        "double_f64",
        compute([64, 1, 1], 1),
        vec![
            param(
                "x",
                Role::Element {
                    binding: 0,
                    layout: plain("f64", Scalar::F64),
                },
            ),
            param(
                "table",
                Role::Storage {
                    binding: 1,
                    layout: plain("f64", Scalar::F64),
                },
            ),
            param("index", Role::Index),
        ],
        vec![Output::Buffer {
            binding: 2,
            layout: plain("f64", Scalar::F64),
        }],
    );
    kernel.precision = Some(Precision::F64);
    fn run(call: &mut Call<'_>) -> Result<(), CallError> {
        let [Arg::Bytes(x), Arg::Bytes(table), Arg::BytesMut(out)] = &mut call.args[..] else {
            return Err(CallError::Count {
                expected: 3,
                got: call.args.len(),
            });
        };
        let (x, table): (&[f64], &[f64]) = (bytemuck::cast_slice(x), bytemuck::cast_slice(table));
        for (i, o) in bytemuck::cast_slice_mut::<u8, f64>(out)
            .iter_mut()
            .enumerate()
        {
            *o = x[i].sqrt() + table[i % table.len()];
        }
        Ok(())
    }
    sample(
        kernel,
        run,
        "@group(0) @binding(0) var<storage, read> x: array<f64>;
         @group(0) @binding(1) var<storage, read> table: array<f64>;
         @group(0) @binding(2) var<storage, read_write> out: array<f64>;
         @compute @workgroup_size(64) fn double_f64(@builtin(global_invocation_id) id: vec3<u32>) {
             if (id.x < arrayLength(&out)) {
                 out[id.x] = sqrt(x[id.x]) + table[id.x % arrayLength(&table)];
             }
         }",
    )
}

/// Counts the elements below 16 into bins.
pub fn histogram() -> Sample {
    let kernel = kernel(
        "histogram",
        compute([64, 1, 1], 1),
        vec![
            param(
                "value",
                Role::Element {
                    binding: 0,
                    layout: plain("u32", Scalar::U32),
                },
            ),
            param(
                "bins",
                Role::Atomic {
                    binding: 1,
                    scalar: Scalar::U32,
                    unordered: false,
                },
            ),
        ],
        vec![],
    );
    fn run(call: &mut Call<'_>) -> Result<(), CallError> {
        let [Arg::Bytes(values), Arg::BytesMut(bins)] = &mut call.args[..] else {
            return Err(CallError::Count {
                expected: 2,
                got: call.args.len(),
            });
        };
        let bins = bytemuck::cast_slice_mut::<u8, u32>(bins);
        for &v in bytemuck::cast_slice::<u8, u32>(values) {
            let i = v as usize % bins.len();
            bins[i] = bins[i].wrapping_add(1);
        }
        Ok(())
    }
    sample(
        kernel,
        run,
        "@group(0) @binding(0) var<storage, read> value: array<u32>;
         @group(0) @binding(1) var<storage, read_write> bins: array<atomic<u32>>;
         @compute @workgroup_size(64) fn histogram(@builtin(global_invocation_id) id: vec3<u32>) {
             if (id.x < arrayLength(&value)) {
                 atomicAdd(&bins[value[id.x] % arrayLength(&bins)], 1u);
             }
         }",
    )
}

/// The sum of each 64 elements.
pub fn sums() -> Sample {
    let u = || plain("u32", Scalar::U32);
    let kernel = kernel(
        "sums",
        Stage::Compute {
            threads: [64, 1, 1],
            dimensions: 1,
            cooperative: true,
            workgroup_bytes: 256,
            range: Range::Elements {
                param: "value".into(),
            },
        },
        vec![
            param(
                "value",
                Role::Storage {
                    binding: 0,
                    layout: u(),
                },
            ),
            param("index", Role::Index),
            param(
                "part",
                Role::Shared {
                    layout: u(),
                    length: 64,
                    atomic: false,
                },
            ),
            param(
                "out",
                Role::StorageMut {
                    binding: 1,
                    layout: u(),
                    unordered: false,
                },
            ),
        ],
        vec![],
    );
    fn run(call: &mut Call<'_>) -> Result<(), CallError> {
        let [Arg::Bytes(values), Arg::BytesMut(out)] = &mut call.args[..] else {
            return Err(CallError::Count {
                expected: 2,
                got: call.args.len(),
            });
        };
        let values: &[u32] = bytemuck::cast_slice(values);
        for (o, g) in bytemuck::cast_slice_mut::<u8, u32>(out)
            .iter_mut()
            .zip(values.chunks(64))
        {
            *o = g.iter().fold(0, |a, &b| a.wrapping_add(b));
        }
        Ok(())
    }
    sample(
        kernel,
        run,
        "@group(0) @binding(0) var<storage, read> value: array<u32>;
         @group(0) @binding(1) var<storage, read_write> out: array<u32>;
         var<workgroup> part: array<u32, 64>;
         @compute @workgroup_size(64) fn sums(
             @builtin(local_invocation_index) me: u32,
             @builtin(workgroup_id) group: vec3<u32>,
         ) {
             let i = group.x * 64u + me;
             var v = 0u;
             if (i < arrayLength(&value)) { v = value[i]; }
             part[me] = v;
             workgroupBarrier();
             if (me == 0u) {
                 var sum = 0u;
                 for (var k = 0u; k < 64u; k++) { sum += part[k]; }
                 if (group.x < arrayLength(&out)) { out[group.x] = sum; }
             }
         }",
    )
}

/// The mean of four samples plus a filtered look-up, as 16-bit texels.
pub fn image() -> Sample {
    let kernel = kernel(
        "image",
        compute([8, 8, 1], 2),
        vec![
            param(
                "samples",
                Role::Texture {
                    binding: 0,
                    texture: TextureKind::Texture2dMultisampled,
                },
            ),
            param(
                "volume",
                Role::Texture {
                    binding: 1,
                    texture: TextureKind::Texture3d,
                },
            ),
            param(
                "nearest",
                Role::Sampler {
                    binding: 2,
                    sampler: SamplerKind::Filtering,
                },
            ),
            param("index", Role::Index),
        ],
        vec![Output::Texture {
            binding: 3,
            format: TexelFormat::Rgba16Unorm,
            dimensions: 2,
        }],
    );
    fn run(call: &mut Call<'_>) -> Result<(), CallError> {
        let [
            Arg::Texture(ms),
            Arg::Texture(volume),
            Arg::Sampler(sampler),
            Arg::TextureMut(out),
        ] = &mut call.args[..]
        else {
            return Err(CallError::Count {
                expected: 4,
                got: call.args.len(),
            });
        };
        let samples = f32s(ms.bytes);
        let (volume, sampler) = (Texture3d::new(*volume), hankel_dsl::Sampler::new(*sampler));
        let filtered = volume.sample_level(sampler, Vec3::splat(0.25), 0.0);
        for (i, texel) in out.bytes.chunks_exact_mut(8).enumerate() {
            let s = &samples[i * 4..i * 4 + 4];
            let mut v = filtered;
            v.x = (s[0] + s[1] + s[2] + s[3]) * 0.25;
            out.format.store(texel, v);
        }
        Ok(())
    }
    sample(
        kernel,
        run,
        "@group(0) @binding(0) var samples: texture_multisampled_2d<f32>;
         @group(0) @binding(1) var volume: texture_3d<f32>;
         @group(0) @binding(2) var nearest: sampler;
         @group(0) @binding(3) var out: texture_storage_2d<rgba16unorm, write>;
         @compute @workgroup_size(8, 8) fn image(@builtin(global_invocation_id) id: vec3<u32>) {
             let size = textureDimensions(out);
             if (id.x < size.x && id.y < size.y) {
                 let at = vec2<i32>(id.xy);
                 let sum = textureLoad(samples, at, 0).x + textureLoad(samples, at, 1).x
                     + textureLoad(samples, at, 2).x + textureLoad(samples, at, 3).x;
                 let v = textureSampleLevel(volume, nearest, vec3<f32>(0.25), 0.0);
                 textureStore(out, at, vec4<f32>(sum * 0.25, v.yzw));
             }
         }",
    )
}

/// A vertex stage that moves positions and hands on a colour and a number.
pub fn place() -> Sample {
    let f = Scalar::F32;
    let kernel = kernel(
        "place",
        Stage::Vertex,
        vec![
            param(
                "shift",
                Role::Uniform {
                    binding: 0,
                    layout: plain("f32", f),
                    push: false,
                },
            ),
            param(
                "position",
                Role::Attribute {
                    location: 0,
                    ty: vector(f, 3),
                },
            ),
            param(
                "colour",
                Role::Attribute {
                    location: 1,
                    ty: vector(f, 4),
                },
            ),
        ],
        vec![
            Output::Position,
            Output::Varying {
                location: 0,
                ty: vector(f, 4),
                interpolation: Interpolation::Perspective,
            },
        ],
    );
    fn run(call: &mut Call<'_>) -> Result<(), CallError> {
        let [
            Arg::Bytes(shift),
            Arg::Bytes(p),
            Arg::Bytes(c),
            Arg::BytesMut(at),
            Arg::BytesMut(v),
        ] = &mut call.args[..]
        else {
            return Err(CallError::Count {
                expected: 5,
                got: call.args.len(),
            });
        };
        let shift = f32s(shift)[0];
        for (at, p) in bytemuck::cast_slice_mut::<u8, f32>(at)
            .chunks_mut(4)
            .zip(f32s(p).chunks(3))
        {
            at.copy_from_slice(&[p[0] + shift, p[1], p[2], 1.0]);
        }
        for (v, c) in bytemuck::cast_slice_mut::<u8, f32>(v)
            .iter_mut()
            .zip(f32s(c))
        {
            *v = c * 2.0;
        }
        Ok(())
    }
    sample(
        kernel,
        run,
        "struct Out { @builtin(position) position: vec4<f32>, @location(0) colour: vec4<f32> }
         @group(0) @binding(0) var<uniform> shift: f32;
         @vertex fn place(@location(0) position: vec3<f32>, @location(1) colour: vec4<f32>) -> Out {
             return Out(
                 vec4<f32>(position.x + shift, position.y, position.z, 1.0),
                 colour * 2.0,
             );
         }",
    )
}

/// A fragment stage that multiplies a varying by a uniform.
pub fn tint() -> Sample {
    let f = Scalar::F32;
    let kernel = kernel(
        "tint",
        Stage::Fragment,
        vec![
            param(
                "factor",
                Role::Uniform {
                    binding: 0,
                    layout: plain("f32", f),
                    push: false,
                },
            ),
            param(
                "colour",
                Role::Varying {
                    location: 0,
                    ty: vector(f, 4),
                    interpolation: Interpolation::Perspective,
                },
            ),
        ],
        vec![Output::Target {
            location: 0,
            ty: vector(f, 4),
        }],
    );
    fn run(call: &mut Call<'_>) -> Result<(), CallError> {
        let [Arg::Bytes(factor), Arg::Bytes(c), Arg::BytesMut(out)] = &mut call.args[..] else {
            return Err(CallError::Count {
                expected: 3,
                got: call.args.len(),
            });
        };
        let factor = f32s(factor)[0];
        for (o, c) in bytemuck::cast_slice_mut::<u8, f32>(out)
            .iter_mut()
            .zip(f32s(c))
        {
            *o = c * factor;
        }
        Ok(())
    }
    sample(
        kernel,
        run,
        "@group(0) @binding(0) var<uniform> factor: f32;
         @fragment fn tint(@location(0) colour: vec4<f32>) -> @location(0) vec4<f32> {
             return colour * factor;
         }",
    )
}

impl Sample {
    /// As an entry point of a crate.
    pub fn entry(&self) -> KernelEntry {
        KernelEntry::new(self.kernel.clone(), self.native)
    }
}

/// Numbers of every type: `q = a / n`, `s = -m`, `v = 3 a` for a `bias` added to `a`.
pub fn mixed() -> Sample {
    let mut settings = structure("Settings", &[("bias", Scalar::F64), ("gain", Scalar::F64)]);
    settings.fields[1].inputs.default = Some(3.0);
    let row = structure(
        "Row",
        &[("a", Scalar::F64), ("n", Scalar::U32), ("m", Scalar::I32)],
    );
    let result = structure(
        "Out",
        &[("q", Scalar::F64), ("v", Scalar::F64), ("s", Scalar::I32)],
    );
    let mut kernel = kernel(
        "mixed_f64",
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
                "row",
                Role::Element {
                    binding: 1,
                    layout: row,
                },
            ),
            param(
                "shift",
                Role::Constant {
                    id: 0,
                    scalar: Scalar::U32,
                    default: 0,
                },
            ),
        ],
        vec![Output::Buffer {
            binding: 2,
            layout: result,
        }],
    );
    kernel.function = "mixed".into();
    kernel.precision = Some(Precision::F64);
    fn run(call: &mut Call<'_>) -> Result<(), CallError> {
        let shift = call.constants[0];
        let [Arg::Bytes(settings), Arg::Bytes(rows), Arg::BytesMut(out)] = &mut call.args[..]
        else {
            return Err(CallError::Count {
                expected: 3,
                got: call.args.len(),
            });
        };
        let s: &[f64] = bytemuck::cast_slice(settings);
        for (o, r) in out.chunks_mut(24).zip(rows.chunks(16)) {
            let a = f64::from_le_bytes(r[..8].try_into().unwrap_or_default()) + s[0];
            let n = u32::from_le_bytes(r[8..12].try_into().unwrap_or_default()) + shift;
            let m = i32::from_le_bytes(r[12..].try_into().unwrap_or_default());
            o[..8].copy_from_slice(&(a / f64::from(n)).to_le_bytes());
            o[8..16].copy_from_slice(&(a * s[1]).to_le_bytes());
            o[16..20].copy_from_slice(&m.wrapping_neg().to_le_bytes());
        }
        Ok(())
    }
    let mut sample = sample(
        kernel,
        run,
        "struct Settings { bias: f64, gain: f64 }
         struct Row { a: f64, n: u32, m: i32 }
         struct Out { q: f64, v: f64, s: i32 }
         @group(0) @binding(0) var<uniform> settings: Settings;
         @group(0) @binding(1) var<storage, read> row: array<Row>;
         @group(0) @binding(2) var<storage, read_write> out: array<Out>;
         const shift: u32 = 0u;
         @compute @workgroup_size(64) fn mixed_f64(@builtin(global_invocation_id) id: vec3<u32>) {
             if (id.x < arrayLength(&out)) {
                 let a = row[id.x].a + settings.bias;
                 out[id.x].q = a / f64(row[id.x].n + shift);
                 out[id.x].v = a * settings.gain;
                 out[id.x].s = -row[id.x].m;
             }
         }",
    );
    let stand_in = sample.wgsl.replace("shift: u32 = 0u", "shift: u32 = 7777u");
    sample.spirv = with_constant(&spirv(&stand_in), 7777);
    sample
}

/// The module with its constant `value` turned into the specialisation constant 0, which is 0
/// unless given.
fn with_constant(words: &[u32], value: u32) -> Vec<u32> {
    let mut all = words.to_vec();
    // OpConstant with one word: type, result, value.
    let at = (5..words.len() - 3)
        .find(|&i| words[i] == 4 << 16 | 43 && words[i + 3] == value)
        .expect("the constant is in the module");
    all[at] = 4 << 16 | 50;
    all[at + 3] = 0;
    // Decorations stand before the types; the first one is OpTypeVoid or a scalar's.
    let first = (5..words.len())
        .find(|&i| words[i] & 0xffff == 71)
        .expect("it has decorations");
    all.splice(first..first, [4 << 16 | 71, words[at + 2], 1, 0]);
    all
}

pub const F32: Scalar = Scalar::F32;

/// A role that is an element of a buffer.
pub fn element(binding: u32, layout: Layout) -> Role {
    Role::Element { binding, layout }
}
