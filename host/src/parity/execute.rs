//! Runs a case of any stage on a device, and gives back what was written.

use hankel_dsl::native::describe::{
    Inputs, Interpolation, Kernel, Output, Param, Role, Rounding, Scalar, Stage, Subgroups,
    TexelFormat, Tolerance, Type,
};

use super::capture;
use crate::device::slots::{self, Slot, Use};
use crate::device::{
    Arithmetic, Bind, Blend, BufferId, Colour, Cull, Depth, DepthTest, Device, DeviceError, Draw,
    Floats, Pass, Program, Shader, TextureId, TextureShape, Topology,
};
use crate::inputs::{Case, Input};

/// What was written, one for each slot that is written, in order: the bytes of its buffer or
/// texture.
pub type Written = Vec<Vec<u8>>;

/// Why a case did not run.
#[derive(Debug, thiserror::Error)]
pub enum ExecuteError {
    /// The device's words.
    #[error(transparent)]
    Device(#[from] DeviceError),
    /// A stage that cannot be read back.
    #[error("kernel `{kernel}`: {problem}")]
    Stage {
        /// The kernel.
        kernel: String,
        /// Why not.
        problem: String,
    },
}

/// Width of the targets that vertices and fragments are read back through.
const WIDTH: u32 = hankel_dsl::native::fragment::COLUMNS;

/// What a case holds on a device, freed at the end.
#[derive(Default)]
struct Held {
    buffers: Vec<BufferId>,
    textures: Vec<TextureId>,
}

impl Held {
    fn free(self, device: &mut dyn Device) -> Result<(), DeviceError> {
        for b in self.buffers {
            device.free_buffer(b)?;
        }
        for t in self.textures {
            device.free_texture(t)?;
        }
        Ok(())
    }
}

/// Runs a case as a map: compute kernels anywhere, vertex and fragment kernels natively.
///
/// # Errors
/// The device's.
pub fn dispatch(
    device: &mut dyn Device,
    program: &Program<'_>,
    case: &Case,
) -> Result<Written, DeviceError> {
    let slots = slots::slots(program.kernel);
    let mut held = Held::default();
    let result = dispatch_with(device, program, &slots, case, &mut held);
    let freed = held.free(device);
    let written = result?;
    freed?;
    Ok(written)
}

fn dispatch_with(
    device: &mut dyn Device,
    program: &Program<'_>,
    slots: &[Slot<'_>],
    case: &Case,
    held: &mut Held,
) -> Result<Written, DeviceError> {
    let binds = upload(device, slots, &case.args, held)?;
    device.dispatch(program, &binds)?;
    read_back(device, program.kernel, slots.iter().zip(&binds))
}

/// What a kernel has written to its arguments.
fn read_back<'a>(
    device: &mut dyn Device,
    kernel: &Kernel,
    args: impl Iterator<Item = (&'a Slot<'a>, &'a Bind<'a>)>,
) -> Result<Written, DeviceError> {
    args.filter(|(slot, _)| slot.role.is_written())
        .map(|(slot, bind)| match bind {
            Bind::Buffer(id) => device.read_buffer(*id),
            Bind::Texture(id) => device.read_texture(*id),
            Bind::Bytes(_) | Bind::Sampler(_) => {
                Err(slots::refuse(kernel, slot, "it cannot be written".into()))
            }
        })
        .collect()
}

/// Makes a device's buffers and textures from inputs.
fn upload<'a>(
    device: &mut dyn Device,
    slots: &[Slot<'_>],
    inputs: &'a [Input],
    held: &mut Held,
) -> Result<Vec<Bind<'a>>, DeviceError> {
    let mut binds = Vec::with_capacity(inputs.len());
    for (slot, input) in slots.iter().zip(inputs) {
        binds.push(match (input, slot.role) {
            (Input::Bytes(bytes), Use::Uniform(_)) => Bind::Bytes(bytes),
            (Input::Bytes(bytes), _) => {
                let id = device.buffer_from(&slot.name, bytes)?;
                held.buffers.push(id);
                Bind::Buffer(id)
            }
            (Input::Texture { shape, bytes }, _) => {
                let id = device.texture_from(&slot.name, shape, bytes)?;
                held.textures.push(id);
                Bind::Texture(id)
            }
            (Input::Sampler(s), _) => Bind::Sampler(*s),
        });
    }
    Ok(binds)
}

/// Runs a case on Vulkan, whatever its stage: vertices and fragments are drawn as points, each in
/// a pixel of its own.
///
/// What naga wrote of a kernel that is not free in its rounding is pinned behind naga
/// ([`super::translate`]). A device that by its `floats` does not compute as IEEE 754 says is made to, as far as it
/// can ([`Floats::as_ieee_754`]), whatever the kernel says of rounding: what differs is then what the translation
/// did, not what the device does by itself.
///
/// # Errors
/// The device's, and [`ExecuteError::Stage`] for an interface that targets cannot hold.
pub fn on_vulkan(
    device: &mut dyn Device,
    program: &Program<'_>,
    case: &Case,
    floats: &Floats,
) -> Result<Written, ExecuteError> {
    let kernel = program.kernel;
    let arithmetic = match floats.are_ieee_754() {
        true => Arithmetic::of([kernel]),
        false => Arithmetic::Pinned,
    };
    // A vertex stage is rewritten as SPIR-V to be read back.
    let as_it_is = arithmetic == Arithmetic::Free && kernel.stage != Stage::Vertex;
    let translated = match program.shader {
        Some(Shader::SpirvThroughNaga(words)) if !as_it_is => {
            let values = slots::constants(kernel, program.constants)?;
            let ids = kernel.params.iter().filter_map(|p| match p.role {
                Role::Constant { id, .. } => Some(id),
                _ => None,
            });
            let constants: Vec<(u32, u32)> = ids.zip(values).collect();
            Some(super::translate::spirv_to_spirv(
                words, &constants, arithmetic,
            ))
        }
        Some(Shader::Wgsl { text, entry_point }) if !as_it_is => Some(
            super::translate::wgsl_to_spirv(text, entry_point, &kernel.name, arithmetic),
        ),
        _ => None,
    };
    let translated = translated.transpose().map_err(|e| bad(kernel, e))?;
    let shader = translated
        .as_deref()
        .map(Shader::SpirvPassthrough)
        .or(program.shader);
    let strict = match shader {
        Some(Shader::SpirvPassthrough(code)) => floats.as_ieee_754(code),
        _ => None,
    };
    let strict = strict.transpose().map_err(|e| bad(kernel, e))?;
    let given = Program {
        shader: strict.as_deref().map(Shader::SpirvPassthrough).or(shader),
        ..*program
    };
    let program = &given;
    match kernel.stage {
        Stage::Compute { .. } => Ok(dispatch(device, program, case)?),
        Stage::Fragment | Stage::Vertex => {
            let mut held = Held::default();
            let result = if program.kernel.stage == Stage::Vertex {
                vertex(device, program, case, &mut held)
            } else {
                fragment(device, program, case, &mut held)
            };
            let freed = held.free(device);
            let written = result?;
            freed?;
            Ok(written)
        }
    }
}

fn bad(kernel: &Kernel, problem: impl Into<String>) -> ExecuteError {
    ExecuteError::Stage {
        kernel: kernel.name.clone(),
        problem: problem.into(),
    }
}

/// A helper stage's description.
fn helper(name: &str, stage: Stage, params: Vec<Param>, outputs: Vec<Output>) -> Kernel {
    Kernel {
        name: name.into(),
        function: name.into(),
        summary: String::new(),
        file: file!().into(),
        line: line!(),
        licence: String::new(),
        stage,
        precision: None,
        params,
        outputs,
        tolerance: Tolerance {
            ulp: 0,
            absolute: 0.0,
            non_finite: false,
            why: String::new(),
        },
        rounding: Rounding::Free,
        subgroups: Subgroups::Unused,
        compensated: None,
        image_pass: None,
        invariant: false,
    }
}

/// A scalar or vector type: its scalar, its components, its name in WGSL.
fn interface(kernel: &Kernel, ty: &Type) -> Result<(Scalar, u32, String), ExecuteError> {
    let (scalar, size) = ty
        .components()
        .ok_or_else(|| bad(kernel, "only scalars and vectors pass between stages"))?;
    let name = match scalar {
        Scalar::F32 => "f32",
        Scalar::U32 => "u32",
        Scalar::I32 => "i32",
        Scalar::F64 | Scalar::U64 | Scalar::I64 => {
            return Err(bad(kernel, "64-bit values do not pass between stages"));
        }
        Scalar::Bool => return Err(bad(kernel, "truth values do not pass between stages")),
        Scalar::F16 => return Err(bad(kernel, "halves in memory do not pass between stages")),
    };
    let text = if size == 1 {
        name.to_string()
    } else {
        format!("vec{size}<{name}>")
    };
    Ok((scalar, size, text))
}

/// How the varying at a location is interpolated.
fn interpolation(kernel: &Kernel, at: u32) -> Interpolation {
    let found = kernel.params.iter().find_map(|p| match p.role {
        Role::Varying {
            location,
            interpolation,
            ..
        } if location == at => Some(interpolation),
        _ => None,
    });
    found.unwrap_or_default()
}

/// The bytes of `count` values of `size` components out of texels of four.
fn narrowed(texels: &[u8], size: u32, count: usize) -> Vec<u8> {
    texels
        .chunks_exact(16)
        .take(count)
        .flat_map(|t| &t[..4 * size as usize])
        .copied()
        .collect()
}

fn pass<'a>(colours: &'a [Colour], depth: Option<Depth>, draws: &'a [Draw<'a>]) -> Pass<'a> {
    Pass {
        label: "parity",
        colours,
        depth,
        draws,
    }
}

/// Draws each fragment as a point whose varyings are the case's, all of them constant over it.
fn fragment(
    device: &mut dyn Device,
    program: &Program<'_>,
    case: &Case,
    held: &mut Held,
) -> Result<Written, ExecuteError> {
    let kernel = program.kernel;
    let slots = slots::slots(kernel);
    let height = (case.invocations as u32).div_ceil(WIDTH);
    let mut members = String::from("@builtin(position) position: vec4<f32>,\n");
    let mut inputs = String::from("@builtin(vertex_index) i: u32,\n");
    let mut copies = String::new();
    let (mut params, mut outputs) = (Vec::new(), vec![Output::Position]);
    let (mut vertex_args, mut fragment_args) = (Vec::new(), Vec::new());
    let all = upload(device, &slots, &case.args, held)?;
    for (slot, bind) in slots.iter().zip(&all) {
        match slot.role {
            Use::Varying(location, ty) => {
                let (_, _, text) = interface(kernel, ty)?;
                let interpolation = interpolation(kernel, location);
                let how = interpolation
                    .words()
                    .map_or_else(String::new, |words| format!("@interpolate({words}) "));
                members.push_str(&format!(
                    "@location({location}) {how}v{location}: {text},\n"
                ));
                inputs.push_str(&format!("@location({location}) v{location}: {text},\n"));
                copies.push_str(&format!("o.v{location} = v{location};\n"));
                params.push(Param {
                    name: slot.name.clone(),
                    role: Role::Attribute {
                        location,
                        ty: ty.clone(),
                    },
                    inputs: Inputs::default(),
                });
                outputs.push(Output::Varying {
                    location,
                    ty: ty.clone(),
                    interpolation,
                });
                vertex_args.push(*bind);
            }
            Use::Interface(_) => {}
            _ => fragment_args.push(*bind),
        }
    }
    let text = format!(
        "struct Point {{\n{members}}}\n\
         @vertex fn hankel_points({inputs}) -> Point {{\n\
         var o: Point;\n\
         let at = vec2<f32>(f32(i % {WIDTH}u), f32(i / {WIDTH}u)) + 0.5;\n\
         let size = vec2<f32>({WIDTH}.0, -{height}.0);\n\
         o.position = vec4<f32>(at * 2.0 / size + vec2<f32>(-1.0, 1.0), 0.0, 1.0);\n\
         {copies}return o;\n}}\n"
    );
    let points = helper("hankel_points", Stage::Vertex, params, outputs);
    let mut targets = Vec::new();
    let (mut colours, mut depth, mut second) = (Vec::new(), None, None);
    for output in &kernel.outputs {
        let ty = match output {
            Output::Target { ty, .. } | Output::SecondSource { ty } => ty,
            Output::Depth => {
                let id = device.texture("depth", &TextureShape::depth(WIDTH, height))?;
                held.textures.push(id);
                targets.push((id, TexelFormat::R32Float));
                depth = Some(Depth {
                    texture: id,
                    clear: Some(0.0),
                    test: DepthTest::Always,
                    write: true,
                });
                continue;
            }
            _ => continue,
        };
        let (scalar, size, _) = interface(kernel, ty)?;
        let format = match (scalar, size) {
            (Scalar::F32, 1) => TexelFormat::R32Float,
            (Scalar::F32, 2) => TexelFormat::Rg32Float,
            (Scalar::F32, 4) => TexelFormat::Rgba32Float,
            (Scalar::U32, 1) => TexelFormat::R32Uint,
            (Scalar::U32, 2) => TexelFormat::Rg32Uint,
            (Scalar::U32, 4) => TexelFormat::Rgba32Uint,
            (Scalar::I32, 1) => TexelFormat::R32Sint,
            (Scalar::I32, 2) => TexelFormat::Rg32Sint,
            (Scalar::I32, 4) => TexelFormat::Rgba32Sint,
            _ => {
                return Err(bad(
                    kernel,
                    "no target format holds its output; return f32, u32, i32, Vec2, UVec2, IVec2, Vec4, UVec4 or IVec4",
                ));
            }
        };
        let id = device.texture("target", &TextureShape::d2(WIDTH, height, format))?;
        held.textures.push(id);
        targets.push((id, format));
        if matches!(output, Output::SecondSource { .. }) {
            // It is seen by blending alone.
            second = Some([Colour {
                texture: id,
                resolve: None,
                clear: Some([1.0; 4]),
                blend: Blend::Second,
            }]);
            continue;
        }
        colours.push(Colour {
            texture: id,
            resolve: None,
            clear: Some([0.0; 4]),
            blend: Blend::Off,
        });
    }
    if second.is_some()
        && slots
            .iter()
            .any(|it| it.binding.is_some() && it.role.is_written())
    {
        return Err(bad(
            kernel,
            "a second source is drawn once more to be read, and the kernel writes memory",
        ));
    }
    let draw = Draw {
        vertex: Program {
            kernel: &points,
            constants: &[],
            native: None,
            shader: Some(Shader::Wgsl {
                text: &text,
                entry_point: "hankel_points",
            }),
        },
        vertex_args: &vertex_args,
        fragment: Some(*program),
        fragment_args: &fragment_args,
        indices: None,
        count: case.invocations as u32,
        topology: Topology::Points,
        cull: Cull::None,
    };
    if let Some(second) = second {
        device.draw(&pass(&second, depth, std::slice::from_ref(&draw)))?;
    }
    device.draw(&pass(&colours, depth, &[draw]))?;
    // Parameters come before what is returned, which has no binding.
    let bound = slots.iter().zip(&all).filter(|(s, _)| s.binding.is_some());
    let mut written = read_back(device, kernel, bound)?;
    for (id, format) in targets {
        let mut texels = device.read_texture(id)?;
        texels.truncate(case.invocations * format.bytes());
        written.push(texels);
    }
    Ok(written)
}

/// Draws each vertex into a pixel of its own, and reads one output after the other.
fn vertex(
    device: &mut dyn Device,
    program: &Program<'_>,
    case: &Case,
    held: &mut Held,
) -> Result<Written, ExecuteError> {
    let kernel = program.kernel;
    let height = (case.invocations as u32).div_ceil(WIDTH);
    let Some(Shader::SpirvPassthrough(words)) = program.shader else {
        return Err(bad(kernel, "it has no shader"));
    };
    let clips = kernel.outputs.iter().find_map(|it| match it {
        Output::ClipDistances { ty } => Some(slots::type_bytes(ty) as u32 / 4),
        _ => None,
    });
    let captured = capture::capture(words, &kernel.name, [WIDTH, height], clips.unwrap_or(0))
        .map_err(|problem| bad(kernel, problem))?;
    let slots = slots::slots(kernel);
    let binds = upload(device, &slots, &case.args, held)?;
    let vertex_args: Vec<Bind<'_>> = slots
        .iter()
        .zip(&binds)
        .filter(|(s, _)| !matches!(s.role, Use::Interface(_)))
        .map(|(_, b)| *b)
        .collect();
    // Each fragment is a point, over which nothing is interpolated.
    let varying = |location: u32, ty: &Type| Output::Varying {
        location,
        ty: ty.clone(),
        interpolation: Interpolation::Flat,
    };
    // What is read of each output.
    let read: Vec<Vec<Output>> = kernel
        .outputs
        .iter()
        .map(|output| match output {
            Output::Position => vec![varying(captured.location, &slots::POSITION)],
            Output::Varying { location, ty, .. } => vec![varying(*location, ty)],
            Output::ClipDistances { .. } => {
                let distance = Type::Scalar {
                    scalar: Scalar::F32,
                };
                let places = (captured.location + 1..).take(clips.unwrap_or(0) as usize);
                places.map(|at| varying(at, &distance)).collect()
            }
            other => vec![other.clone()],
        })
        .collect();
    let mut captured_kernel = kernel.clone();
    captured_kernel.outputs = read.concat();
    let target = device.texture(
        "f32",
        &TextureShape::d2(WIDTH, height, TexelFormat::Rgba32Float),
    )?;
    held.textures.push(target);
    let integers = device.texture(
        "u32",
        &TextureShape::d2(WIDTH, height, TexelFormat::Rgba32Uint),
    )?;
    held.textures.push(integers);
    let mut written = Vec::new();
    for output in &captured_kernel.outputs {
        let Output::Varying { location, ty, .. } = output else {
            return Err(bad(
                kernel,
                "a vertex stage writes a position and varyings only",
            ));
        };
        let (scalar, size, text) = interface(kernel, ty)?;
        let is_float = scalar == Scalar::F32;
        let wide = if is_float { "f32" } else { "u32" };
        let value = |i: usize| {
            let part = if size == 1 {
                "v".into()
            } else {
                format!("v.{}", &"xyzw"[i..=i])
            };
            match (i < size as usize, scalar) {
                (false, _) => format!("{wide}()"),
                (true, Scalar::I32) => format!("bitcast<u32>({part})"),
                (true, _) => part,
            }
        };
        let [x, y, z, w] = [0, 1, 2, 3].map(value);
        let text = format!(
            "@fragment fn hankel_take(@location({location}) @interpolate(flat) v: {text}) \
             -> @location(0) vec4<{wide}> {{ return vec4<{wide}>({x}, {y}, {z}, {w}); }}"
        );
        let result = Type::Vector {
            scalar: if is_float { scalar } else { Scalar::U32 },
            size: 4,
        };
        // wgpu matches the stages of a pipeline only if it has read both, or neither.
        let reader = super::translate::wgsl_to_spirv(
            &text,
            "hankel_take",
            "hankel_take",
            Arithmetic::Pinned,
        )
        .map_err(|e| bad(kernel, e))?;
        let take = helper(
            "hankel_take",
            Stage::Fragment,
            vec![Param {
                name: "v".into(),
                role: Role::Varying {
                    location: *location,
                    ty: ty.clone(),
                    interpolation: Interpolation::Flat,
                },
                inputs: Inputs::default(),
            }],
            vec![Output::Target {
                location: 0,
                ty: result,
            }],
        );
        let texture = if is_float { target } else { integers };
        let draw = Draw {
            vertex: Program {
                kernel: &captured_kernel,
                shader: Some(Shader::SpirvPassthrough(&captured.words)),
                ..*program
            },
            vertex_args: &vertex_args,
            fragment: Some(Program {
                kernel: &take,
                constants: &[],
                native: None,
                shader: Some(Shader::SpirvPassthrough(&reader)),
            }),
            fragment_args: &[],
            indices: None,
            count: case.invocations as u32,
            topology: Topology::Points,
            cull: Cull::None,
        };
        let colours = [Colour {
            texture,
            resolve: None,
            clear: Some([0.0; 4]),
            blend: Blend::Off,
        }];
        device.draw(&pass(&colours, None, &[draw]))?;
        written.push(narrowed(
            &device.read_texture(texture)?,
            size,
            case.invocations,
        ));
    }
    let mut written = written.into_iter();
    Ok(read
        .iter()
        .map(|parts| {
            joined(
                written.by_ref().take(parts.len()).collect(),
                case.invocations,
            )
        })
        .collect())
}

/// The bytes of so many values of each part, value after value.
fn joined(parts: Vec<Vec<u8>>, count: usize) -> Vec<u8> {
    let of = |part: &Vec<u8>, i: usize| {
        let bytes = part.len() / count.max(1);
        part[i * bytes..(i + 1) * bytes].to_vec()
    };
    (0..count)
        .flat_map(|i| parts.iter().flat_map(move |part| of(part, i)))
        .collect()
}
