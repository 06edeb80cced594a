//! HLSL. naga reads every sampler from a heap; here a sampler is a `SamplerState` in a register
//! of its own, as hand-written shaders and root signatures have it. naga drops the formats of storage
//! textures; here they are said in the attribute that DXC reads. It calls functions with 64-bit floats
//! that HLSL has for 32-bit ones only; here they are our own.

use std::collections::BTreeMap;
use std::fmt;

use hankel_dsl::native::describe::{Kernel, Output, Type};
use naga::back::hlsl::{BindTarget, Options, PipelineOptions, ShaderModel, Writer};
use naga::valid::ModuleInfo;
use naga::{
    Expression, ImageClass, MathFunction, Module, ResourceBinding, Scalar, StorageFormat, TypeInner,
};

use super::{BoundsChecks, Job, Kind, Place, Text, Written, text};
use crate::error::Failure;
use crate::placement::Slots;

pub(super) fn write(job: &Job<'_>) -> Result<Written, Failure> {
    let (module, info) = job.settled()?;
    let doubles = match Doubles::of(&module, &info) {
        Ok(doubles) => doubles,
        Err(function) => {
            return Ok(Written::Unsupported(format!(
                "HLSL has no {function} of 64-bit floating-point numbers"
            )));
        }
    };
    let bound = job.bound();
    let placement = &job.options.placement;
    let mut slots = Slots::new(placement, job.kernel, job.language);
    let mut registers: BTreeMap<u32, Register> = BTreeMap::new();
    let mut samplers = Vec::new();
    let mut next: BTreeMap<&str, u32> = BTreeMap::new();
    let restrict = job.options.bounds_checks != BoundsChecks::Unchecked;
    let mut options = Options {
        shader_model: job.options.shader_model.0,
        fake_missing_bindings: true,
        zero_initialize_workgroup_memory: false,
        restrict_indexing: restrict,
        force_loop_bounding: false,
        ..Options::default()
    };
    for it in &bound {
        let class = match it.kind {
            Kind::Uniform => "b",
            Kind::Buffer { written: false } | Kind::Texture => "t",
            Kind::Buffer { written: true } | Kind::Image => "u",
            Kind::Sampler => "s",
        };
        let next = next.entry(class).or_insert(placement.register_base.into());
        let moved = slots.places(it.binding).and_then(|it| it.hlsl);
        let number = moved.and_then(|it| it.register);
        let space = moved.and_then(|it| it.space);
        let register = Register {
            class,
            number: number.map_or(*next, u32::from),
            space: space.unwrap_or(placement.hlsl_space),
        };
        *next += 1;
        slots.take(
            it.binding,
            class,
            register.space.into(),
            register.number,
            u32::MAX,
        )?;
        let target = BindTarget {
            space: register.space,
            // A sampler's is its index in naga's heap, which is replaced below.
            register: match it.kind {
                Kind::Sampler => samplers.len() as u32,
                _ => register.number,
            },
            restrict_indexing: restrict,
            ..BindTarget::default()
        };
        options.binding_map.insert(
            ResourceBinding {
                group: it.group,
                binding: it.binding,
            },
            target,
        );
        if it.kind == Kind::Sampler {
            samplers.push(register);
        }
        registers.insert(it.binding, register);
    }
    let pipeline = PipelineOptions::default();
    let mut source = String::new();
    let written = Writer::new(&mut source, &options, &pipeline)
        .write(&module, &info, None)
        .map_err(|error| job.failure(&error))?;
    let entry_point = match written.entry_point_names.into_iter().next() {
        Some(Ok(name)) => name,
        Some(Err(error)) => return Err(job.failure(&error)),
        None => job.kernel.name.clone(),
    };
    let source = plain_samplers(&source, &samplers).ok_or_else(|| Failure {
        construct: Some("a sampler".into()),
        message: "its declaration is not of the shape that is expected".into(),
        ..job.failure(&fmt::Error)
    })?;
    // Of a selection between two literals without suffix DXC 1.7 rounds both towards zero
    // (`tests/upstream/dxc-literal-selection`).
    let source = text::suffixed(&source);
    let source = without_zero_arrays(&source);
    let source = without_repetitions(&source);
    let source = with_clip_distances(&source, job.kernel);
    let source = with_offsets_in_space(&source);
    let source = job.open_constants(source)?;
    let mut source = doubles.apply(job.precise(source, &["float", "double"])?);
    // fxc, which has models up to 5.1, does not know attributes of Vulkan.
    if job.options.shader_model.0 > ShaderModel::V5_1 {
        for it in bound.iter().filter(|it| it.kind == Kind::Image) {
            if let TypeInner::Image {
                class: ImageClass::Storage { format, .. },
                ..
            } = module.types[module.global_variables[it.handle].ty].inner
                && let Some(format) = vulkan_format(format)
            {
                source = with_format(&source, registers[&it.binding], format);
            }
        }
    }
    let places = bound
        .iter()
        .map(|it| {
            let register = registers[&it.binding];
            let place = Place {
                name: text::name_before(&source, &format!(" : {register}")),
                class: register.class.into(),
                index: Some(register.number),
                space: Some(register.space.into()),
                block: None,
                combined_with: Vec::new(),
            };
            (it.binding, place)
        })
        .collect();
    Ok(Written::Text(Text {
        source,
        entry_point,
        places,
        sizes_slot: None,
        sized: Vec::new(),
        requires: Vec::new(),
    }))
}

/// A register, as a declaration names it.
#[derive(Clone, Copy)]
struct Register {
    class: &'static str,
    number: u32,
    space: u8,
}

impl fmt::Display for Register {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            class,
            number,
            space,
        } = self;
        match space {
            0 => write!(f, "register({class}{number})"),
            _ => write!(f, "register({class}{number}, space{space})"),
        }
    }
}

/// The functions of `double` that HLSL lacks: given one, it silently converts to `float`.
#[derive(Default)]
struct Doubles {
    sqrt: Precisions,
    floor: Precisions,
}

/// Which floats a function is called with.
#[derive(Default)]
struct Precisions {
    /// 32 bits.
    single: bool,
    /// 64 bits.
    double: bool,
}

impl Doubles {
    /// Those that a module calls; an error names one that is not to be had.
    fn of(module: &Module, info: &ModuleInfo) -> Result<Self, String> {
        let mut found = Self::default();
        let functions = module
            .functions
            .iter()
            .map(|(handle, function)| (function, &info[handle]));
        let entries = module
            .entry_points
            .iter()
            .enumerate()
            .map(|(i, entry)| (&entry.function, info.get_entry_point(i)));
        for (function, types) in functions.chain(entries) {
            for (_, expression) in function.expressions.iter() {
                let Expression::Math { fun, arg, .. } = *expression else {
                    continue;
                };
                let ty = types[arg].ty.inner_with(&module.types);
                let is_double = ty.scalar() == Some(Scalar::F64);
                let precisions = match fun {
                    MathFunction::Sqrt => &mut found.sqrt,
                    MathFunction::Floor => &mut found.floor,
                    MathFunction::Abs | MathFunction::Min | MathFunction::Max => continue,
                    _ if is_double => return Err(format!("function `{fun:?}`")),
                    _ => continue,
                };
                match ty {
                    TypeInner::Scalar(_) if is_double => precisions.double = true,
                    _ if is_double => return Err(format!("function `{fun:?}` of vectors")),
                    _ => precisions.single = true,
                }
            }
        }
        Ok(found)
    }

    /// Puts the lacking functions on top and calls them.
    fn apply(&self, mut source: String) -> String {
        let own = [
            (
                &self.sqrt,
                "sqrt",
                "HankelSqrt",
                include_str!("sqrt64.hlsl"),
            ),
            (
                &self.floor,
                "floor",
                "HankelFloor",
                include_str!("floor64.hlsl"),
            ),
        ];
        let mut above = String::new();
        for (precisions, theirs, ours, text) in own {
            if !precisions.double {
                continue;
            }
            source = text::rename(&source, theirs, ours);
            above.push_str(text);
            if precisions.single {
                for ty in ["float", "float2", "float3", "float4"] {
                    above.push_str(&format!("{ty} {ours}({ty} x) {{ return {theirs}(x); }}\n"));
                }
                above.push('\n');
            }
        }
        above + &source
    }
}

/// naga's functions for the sizes of storage textures once each: it writes one for each format, and
/// several formats have one type in HLSL (`tests/upstream/naga-hlsl-size-queries`).
fn without_repetitions(source: &str) -> String {
    const NAME: &str = " NagaRWDimensions";
    let mut seen: Vec<&str> = Vec::new();
    let mut plain = String::with_capacity(source.len());
    let mut dropping = false;
    for line in source.split_inclusive('\n') {
        let is_header = line.starts_with("uint") && line.contains(NAME);
        dropping |= is_header && seen.contains(&line);
        if is_header {
            seen.push(line);
        }
        if !dropping {
            plain.push_str(line);
        }
        dropping &= line.trim_end() != "}";
    }
    plain
}

/// Clip distances as HLSL has them: vectors, of which there are two. naga 30.0.1 declares one number, whatever their array
/// holds (`tests/upstream/naga-hlsl-clip-distances`).
fn with_clip_distances(source: &str, kernel: &Kernel) -> String {
    let count = kernel.outputs.iter().find_map(|output| match output {
        Output::ClipDistances {
            ty: Type::Array { length, .. },
        } => Some(*length),
        _ => None,
    });
    let Some(count) = count else {
        return source.to_owned();
    };
    let vector = |size: u32| match size {
        1 => "float".to_owned(),
        _ => format!("float{size}"),
    };
    let mut member = "";
    let mut text = String::with_capacity(source.len());
    for line in source.split_inclusive('\n') {
        let declared = line
            .trim()
            .strip_prefix("float ")
            .and_then(|rest| rest.strip_suffix(" : SV_ClipDistance;"));
        match declared {
            // The structure of the kernel's own outputs, with an array.
            Some(array) if array.ends_with(']') => {
                member = array.split('[').next().unwrap_or_default();
                text.push_str(line);
            }
            Some(name) => {
                let first = vector(count.min(4));
                text.push_str(&format!("    {first} {name} : SV_ClipDistance0;\n"));
                if count > 4 {
                    let second = vector(count - 4);
                    text.push_str(&format!("    {second} {name}_more : SV_ClipDistance1;\n"));
                }
            }
            None if line.trim().starts_with("const VertexOutput_") => {
                text.push_str(&with_vectors(line, member, count));
            }
            None => text.push_str(line),
        }
    }
    text
}

/// The initialiser of what a vertex returns, with the distances one by one.
fn with_vectors(line: &str, member: &str, count: u32) -> String {
    let part = line
        .split(['{', '}', ',', ';'])
        .map(str::trim)
        .find(|part| part.ends_with(&format!(".{member}")));
    let Some(part) = part else {
        return line.to_owned();
    };
    let of = |from: u32, to: u32| {
        let all: Vec<String> = (from..to).map(|i| format!("{part}[{i}]")).collect();
        match all.len() {
            1 => all.concat(),
            size => format!("float{size}({})", all.join(", ")),
        }
    };
    let mut vectors = of(0, count.min(4));
    if count > 4 {
        vectors += &format!(", {}", of(4, count));
    }
    line.replace(part, &vectors)
}

/// Offsets in textures of three dimensions, which naga 30.0.1 puts into two (`tests/upstream/naga-hlsl-volume-offset`).
fn with_offsets_in_space(source: &str) -> String {
    const CUT: &str = ", int2(";
    let mut text = String::with_capacity(source.len());
    let mut rest = source;
    while let Some(at) = rest.find(", int2(int3(") {
        let call = &rest[at + CUT.len()..];
        let Some(end) = text::closing(call) else {
            break;
        };
        text.push_str(&rest[..at]);
        text.push_str(", ");
        text.push_str(&call[..end]);
        rest = &call[end + 1..];
    }
    text + rest
}

/// Arrays of functions without the zeros that naga gives every variable, which glslang's HLSL refuses
/// for arrays (`tests/upstream/glslang-zero-array`). Nothing reads them: a Rust array has values
/// before anybody can. Where an array of zeros is a value, its zeros are listed.
fn without_zero_arrays(source: &str) -> String {
    let mut plain = String::with_capacity(source.len());
    for line in source.split_inclusive('\n') {
        let value = line.trim().strip_prefix("return (");
        if let Some(array) = value.and_then(|rest| rest.strip_suffix(")0;"))
            && let Some((element, lengths)) = array.split_once('[')
            && let Some(zeros) = lengths
                .split(['[', ']'])
                .filter(|length| !length.is_empty())
                .map(|length| length.parse::<usize>().ok())
                .product::<Option<usize>>()
        {
            let zeros = vec![format!("({element})0"); zeros].join(", ");
            plain.push_str(&format!(
                "    {element} ret[{lengths} = {{ {zeros} }};\n    return ret;\n"
            ));
            continue;
        }
        let declared = line.trim_end().strip_suffix(")0;").and_then(|rest| {
            let (declared, ty) = rest.split_once(" = (")?;
            let is_array = declared.ends_with(']') && ty.ends_with(']');
            (line.starts_with(' ') && is_array).then_some(declared)
        });
        match declared {
            Some(declared) => {
                plain.push_str(declared);
                plain.push_str(";\n");
            }
            None => plain.push_str(line),
        }
    }
    plain
}

/// Replaces the heap and the indices into it by registers.
fn plain_samplers(source: &str, registers: &[Register]) -> Option<String> {
    let mut plain = String::with_capacity(source.len());
    for line in source.lines() {
        let heap = line.starts_with("SamplerState nagaSamplerHeap[")
            || line.starts_with("SamplerComparisonState nagaComparisonSamplerHeap[")
            || (line.starts_with("StructuredBuffer<uint> nagaGroup")
                && line.contains("SamplerIndexArray"));
        if heap {
            continue;
        }
        let declaration = line
            .strip_prefix("static const Sampler")
            .filter(|rest| rest.contains("SamplerHeap["));
        match declaration {
            Some(rest) => {
                // `State name = nagaSamplerHeap[nagaGroup0SamplerIndexArray[index]];`
                let (declared, value) = rest.split_once(" = ")?;
                let index = value.strip_suffix("]];")?.rsplit_once('[')?.1;
                let register = registers.get(index.parse::<usize>().ok()?)?;
                plain.push_str(&format!("Sampler{declared} : {register};"));
            }
            None => plain.push_str(line),
        }
        plain.push('\n');
    }
    (!plain.contains("SamplerHeap[")).then_some(plain)
}

/// Says the format of the storage texture in `register`, which a Direct3D texture type only says
/// in part. Without it DXC takes 32-bit floats when it makes SPIR-V; for Direct3D it ignores it.
fn with_format(source: &str, register: Register, format: &str) -> String {
    let end = format!(" : {register};");
    source
        .lines()
        .map(|line| {
            if line.ends_with(&end) {
                format!("[[vk::image_format(\"{format}\")]] {line}\n")
            } else {
                format!("{line}\n")
            }
        })
        .collect()
}

/// DXC's name of a format; none for those that its SPIR-V cannot have.
const fn vulkan_format(format: StorageFormat) -> Option<&'static str> {
    use StorageFormat::*;
    Some(match format {
        R8Unorm => "r8",
        R8Snorm => "r8snorm",
        R8Uint => "r8ui",
        R8Sint => "r8i",
        R16Uint => "r16ui",
        R16Sint => "r16i",
        R16Float => "r16f",
        R16Unorm => "r16",
        R16Snorm => "r16snorm",
        Rg8Unorm => "rg8",
        Rg8Snorm => "rg8snorm",
        Rg8Uint => "rg8ui",
        Rg8Sint => "rg8i",
        R32Uint => "r32ui",
        R32Sint => "r32i",
        R32Float => "r32f",
        Rg16Uint => "rg16ui",
        Rg16Sint => "rg16i",
        Rg16Float => "rg16f",
        Rg16Unorm => "rg16",
        Rg16Snorm => "rg16snorm",
        Rgba8Unorm => "rgba8",
        Rgba8Snorm => "rgba8snorm",
        Rgba8Uint => "rgba8ui",
        Rgba8Sint => "rgba8i",
        Rgb10a2Uint => "rgb10a2ui",
        Rgb10a2Unorm => "rgb10a2",
        Rg11b10Ufloat => "r11g11b10f",
        R64Uint => "r64ui",
        Rg32Uint => "rg32ui",
        Rg32Sint => "rg32i",
        Rg32Float => "rg32f",
        Rgba16Uint => "rgba16ui",
        Rgba16Sint => "rgba16i",
        Rgba16Float => "rgba16f",
        Rgba16Unorm => "rgba16",
        Rgba16Snorm => "rgba16snorm",
        Rgba32Uint => "rgba32ui",
        Rgba32Sint => "rgba32i",
        Rgba32Float => "rgba32f",
        Bgra8Unorm => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::{
        Doubles, Register, plain_samplers, with_format, without_repetitions, without_zero_arrays,
    };

    const fn register(class: &'static str, number: u32, space: u8) -> Register {
        Register {
            class,
            number,
            space,
        }
    }

    #[test]
    fn sizes_are_asked_by_one_function_of_each_type() {
        let one = "uint2 NagaRWDimensions2D(RWTexture2D<float4> tex)\n{\n    return ret.xy;\n}\n\n";
        let other = one.replace("float4", "int4");
        let text = format!("{one}{one}{other}void main()\n{{\n}}\n");
        assert_eq!(
            without_repetitions(&text),
            format!("{one}\n{other}void main()\n{{\n}}\n")
        );
    }

    #[test]
    fn arrays_begin_without_zeros() {
        assert_eq!(
            without_zero_arrays(
                "static int all[2] = (int[2])0;\n    float4 a[3][2] = (float4[3][2])0;\n    uint n = (uint)0;\n"
            ),
            "static int all[2] = (int[2])0;\n    float4 a[3][2];\n    uint n = (uint)0;\n"
        );
        assert_eq!(
            without_zero_arrays("zeros() {\n    return (uint[2][1])0;\n}\n    return (uint)0;\n"),
            "zeros() {\n    uint ret[2][1] = { (uint)0, (uint)0 };\n    return ret;\n}\n    return (uint)0;\n"
        );
    }

    #[test]
    fn functions_of_doubles_are_our_own() {
        let mut doubles = Doubles::default();
        assert_eq!(doubles.apply("sqrt(x)".into()), "sqrt(x)");
        doubles.sqrt.double = true;
        let text = doubles.apply("y = sqrt(x);".into());
        assert!(text.ends_with("y = HankelSqrt(x);"), "{text}");
        assert!(text.contains("double HankelSqrt(double x)"), "{text}");
        assert!(!text.contains("float2 HankelSqrt"), "{text}");
        doubles.sqrt.single = true;
        let text = doubles.apply("y = sqrt(x);".into());
        assert!(
            text.contains("float2 HankelSqrt(float2 x) { return sqrt(x); }"),
            "{text}"
        );
    }

    #[test]
    fn storage_textures_say_their_format() {
        let source =
            "RWTexture2D<float4> a : register(u0);\nRWTexture2D<float4> b : register(u1);\n";
        assert_eq!(
            with_format(source, register("u", 1, 0), "rgba16f"),
            "RWTexture2D<float4> a : register(u0);\n\
             [[vk::image_format(\"rgba16f\")]] RWTexture2D<float4> b : register(u1);\n"
        );
    }

    #[test]
    fn samplers_get_registers() {
        let source = "\
SamplerState nagaSamplerHeap[2048]: register(s0, space0);
SamplerComparisonState nagaComparisonSamplerHeap[2048]: register(s0, space1);
StructuredBuffer<uint> nagaGroup0SamplerIndexArray : register(t0, space255);
static const SamplerState smp = nagaSamplerHeap[nagaGroup0SamplerIndexArray[1]];
float x;
";
        let registers = [register("s", 0, 0), register("s", 1, 0)];
        assert_eq!(
            plain_samplers(source, &registers).unwrap(),
            "SamplerState smp : register(s1);\nfloat x;\n"
        );
        let registers = [register("s", 0, 0), register("s", 5, 2)];
        assert_eq!(
            plain_samplers(source, &registers).unwrap(),
            "SamplerState smp : register(s5, space2);\nfloat x;\n"
        );
        assert_eq!(
            plain_samplers(
                "static const SamplerState smp = nagaSamplerHeap[other];\n",
                &registers
            ),
            None
        );
    }
}
