//! GLSL, desktop and ES. Names of buffers begin with `b_`, those of uniforms, textures and images
//! with `u_`: no keyword does.

use std::collections::BTreeMap;

use hankel_dsl::native::describe::Rounding;
use naga::back::glsl::{Error, Options, PipelineOptions, Version, Writer, WriterFlags};
use naga::{ResourceBinding, ShaderStage};

use super::{Bound, Job, Kind, Place, Text, Written, text};
use crate::Language;
use crate::error::Failure;
use crate::placement::Slots;
use crate::spirv::names::camel_case;

/// What brings `precise` to GLSL ES before 3.20.
const ES_PRECISE: &str = "GL_EXT_gpu_shader5";

pub(super) fn write(job: &Job<'_>) -> Result<Written, Failure> {
    let (module, info) = job.settled()?;
    let bound = job.bound();
    let entry = &module.entry_points[0];
    let version = match job.language {
        Language::Essl310 => Version::new_gles(310),
        Language::Essl300 => Version::new_gles(300),
        _ => Version::Desktop(450),
    };
    let mut options = Options {
        version,
        writer_flags: WriterFlags::empty(),
        binding_map: Default::default(),
        zero_initialize_workgroup_memory: false,
    };
    let placement = &job.options.placement;
    let mut slots = Slots::new(placement, job.kernel, job.language);
    let mut next = BTreeMap::new();
    let mut numbers = BTreeMap::new();
    for it in bound.iter().filter(|it| it.kind != Kind::Sampler) {
        let counter = next.entry(class(it.kind)).or_insert(0u32);
        let own = match job.language {
            Language::Glsl => it.binding,
            _ => *counter,
        };
        *counter += 1;
        let moved = slots.places(it.binding).and_then(|it| match job.language {
            Language::Glsl => it.glsl,
            Language::Essl310 => it.essl310,
            _ => None,
        });
        let base = match job.language {
            // It has no numbers in the text.
            Language::Essl300 => 0,
            _ => u32::from(placement.glsl_binding_base),
        };
        let number = moved.map_or(base + own, |it| it.binding.into());
        slots.take(it.binding, class(it.kind), 0, number, u8::MAX.into())?;
        options.binding_map.insert(
            ResourceBinding {
                group: it.group,
                binding: it.binding,
            },
            // naga's map has no larger ones.
            number as u8,
        );
        numbers.insert(it.binding, number);
    }
    let pipeline = PipelineOptions {
        shader_stage: entry.stage,
        entry_point: entry.name.clone(),
        multiview: None,
    };
    let mut source = String::new();
    let written = Writer::new(
        &mut source,
        &module,
        &info,
        &options,
        &pipeline,
        job.options.policies(),
    )
    .and_then(|mut writer| writer.write());
    let reflection = match written {
        Ok(reflection) => reflection,
        Err(
            error @ (Error::MissingFeatures(_)
            | Error::ImageMultipleSamplers
            | Error::UnsupportedScalar(_)),
        ) => {
            return Ok(Written::Unsupported(format!("{}: {error}", job.language)));
        }
        Err(error) => return Err(job.failure(&error)),
    };
    // Instances are counted from 0, whichever is the first one: OpenGL knows no more before 4.60.
    let source = source
        .replace("uniform uint naga_vs_first_instance;\n", "")
        .replace(
            "(uint(gl_InstanceID) + naga_vs_first_instance)",
            "uint(gl_InstanceID)",
        );
    let source = if source.contains("gl_SampleMask") {
        with_mask_arrays(&source)
    } else {
        source
    };
    let source = if source.contains("imageSize(") {
        plain_queries(&source)
    } else {
        source
    };
    let source = job.open_constants(source)?;
    let types = ["float", "double", "vec", "dvec", "mat", "dmat"];
    let mut source = if job.language == Language::Essl300 {
        source
    } else {
        job.precise(source, &types)?
    };
    if !job.kernel.subgroups.is_unused() {
        let lines: String = subgroup_extensions(&source)
            .iter()
            .map(|name| format!("#extension {name} : require\n"))
            .collect();
        // naga asks for all of them if there is an operation, and for none if there is not.
        source = source
            .split_inclusive('\n')
            .filter(|line| !line.starts_with("#extension GL_KHR_shader_subgroup"))
            .collect();
        // After the first line, the version.
        source = source.replacen('\n', &format!("\n{lines}"), 1);
    }
    if job.language == Language::Essl310 && job.kernel.rounding != Rounding::Free {
        let lines = if job.kernel.rounding == Rounding::Exact {
            format!("\n#extension {ES_PRECISE} : require\n")
        } else {
            format!(
                "\n#extension {ES_PRECISE} : enable\n#ifndef {ES_PRECISE}\n#define precise\n#endif\n"
            )
        };
        // After the first line, the version.
        source = source.replacen('\n', &lines, 1);
    }
    // Which samplers each texture is combined with; a map, so that the order is the bindings'.
    let of_handle = |handle| bound.iter().find(|it| it.handle == handle);
    let mut combined: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
    for mapping in reflection.texture_mapping.values() {
        if let (Some(texture), Some(sampler)) = (
            of_handle(mapping.texture),
            mapping.sampler.and_then(of_handle),
        ) {
            combined
                .entry(sampler.binding)
                .or_default()
                .push(texture.binding);
        }
    }
    combined
        .values_mut()
        .for_each(|textures| textures.sort_unstable());
    let mut places = BTreeMap::new();
    for it in &bound {
        let mut place = Place {
            name: None,
            class: class(it.kind).into(),
            index: None,
            space: None,
            block: None,
            combined_with: Vec::new(),
        };
        if it.kind == Kind::Sampler {
            place.combined_with = combined.remove(&it.binding).unwrap_or_default();
        } else {
            place.index = numbers
                .get(&it.binding)
                .copied()
                .filter(|_| job.language != Language::Essl300);
            place.name = Some(rename_variable(&mut source, it, entry.stage));
            place.block = reflection
                .uniforms
                .get(&it.handle)
                .filter(|_| matches!(it.kind, Kind::Uniform | Kind::Buffer { .. }))
                .map(|block| rename_block(&mut source, block, it));
        }
        places.insert(it.binding, place);
    }
    let requires = required_extensions(&source);
    Ok(Written::Text(Text {
        source,
        entry_point: "main".into(),
        places,
        sizes_slot: None,
        sized: Vec::new(),
        requires,
    }))
}

/// Masks of samples are arrays in GLSL, of which naga knows no elements (`tests/upstream/naga-glsl-sample-mask`).
fn with_mask_arrays(source: &str) -> String {
    let source = text::rename(source, "gl_SampleMaskIn", "uint(gl_SampleMaskIn[0])");
    let mut written = String::with_capacity(source.len());
    for line in source.split_inclusive('\n') {
        let value = line
            .split_once("gl_SampleMask = ")
            .and_then(|(indent, rest)| Some((indent, rest.split_once(';')?)));
        match value {
            Some((indent, (value, rest))) => {
                written += &format!("{indent}gl_SampleMask[0] = int({value});{rest}");
            }
            None => written += line,
        }
    }
    written
}

/// The size of a storage texture is asked for without a level, which naga gives where it wants the layers
/// (`tests/upstream/naga-glsl-storage-layers`).
fn plain_queries(source: &str) -> String {
    let mut parts = source.split("imageSize(");
    let mut text = parts.next().unwrap_or_default().to_owned();
    for part in parts {
        text += "imageSize(";
        text += &match part.split_once(')') {
            Some((image, rest)) => {
                format!("{}){rest}", image.strip_suffix(", 0").unwrap_or(image))
            }
            None => part.to_owned(),
        };
    }
    text
}

/// The extensions that a text asks for. naga asks for two that 4.50 has by itself.
fn required_extensions(source: &str) -> Vec<String> {
    const OF_450: [&str; 2] = [
        "GL_ARB_compute_shader",
        "GL_ARB_shader_storage_buffer_object",
    ];
    source
        .lines()
        .filter_map(|line| line.strip_prefix("#extension ")?.strip_suffix(" : require"))
        .filter(|name| !OF_450.contains(name))
        .map(str::to_owned)
        .collect()
}

/// The extensions of GLSL for the operations of subgroups that a text has.
fn subgroup_extensions(source: &str) -> Vec<String> {
    let has = |name: &&str| source.contains(&format!("{name}("));
    let groups: [(&str, &[&str]); 6] = [
        ("vote", &["subgroupAny", "subgroupAll"]),
        (
            "arithmetic",
            &[
                "subgroupAdd",
                "subgroupMul",
                "subgroupMin",
                "subgroupMax",
                "subgroupAnd",
                "subgroupOr",
                "subgroupXor",
                "subgroupInclusiveAdd",
                "subgroupInclusiveMul",
                "subgroupExclusiveAdd",
                "subgroupExclusiveMul",
            ],
        ),
        (
            "ballot",
            &[
                "subgroupBallot",
                "subgroupBroadcast",
                "subgroupBroadcastFirst",
            ],
        ),
        ("shuffle", &["subgroupShuffle", "subgroupShuffleXor"]),
        (
            "shuffle_relative",
            &["subgroupShuffleUp", "subgroupShuffleDown"],
        ),
        (
            "quad",
            &[
                "subgroupQuadBroadcast",
                "subgroupQuadSwapHorizontal",
                "subgroupQuadSwapVertical",
                "subgroupQuadSwapDiagonal",
            ],
        ),
    ];
    let used = groups.iter().filter(|(_, names)| names.iter().any(&has));
    std::iter::once("basic")
        .chain(used.map(|(name, _)| *name))
        .map(|name| format!("GL_KHR_shader_subgroup_{name}"))
        .collect()
}

fn class(kind: Kind) -> &'static str {
    match kind {
        Kind::Uniform => "uniform",
        Kind::Buffer { .. } => "buffer",
        Kind::Texture => "texture",
        Kind::Image => "image",
        Kind::Sampler => "sampler",
    }
}

/// naga's name of a bound global says where it is bound; the kernel's says what it is.
fn rename_variable(source: &mut String, it: &Bound, stage: ShaderStage) -> String {
    let stage = match stage {
        ShaderStage::Vertex => "vs",
        ShaderStage::Fragment => "fs",
        _ => "cs",
    };
    let given = format!("_group_{}_binding_{}_{stage}", it.group, it.binding);
    let prefix = if matches!(it.kind, Kind::Buffer { .. }) {
        "b"
    } else {
        "u"
    };
    // Two underscores in a row are reserved.
    let wanted = format!("{prefix}_{}", it.name.trim_matches('_').replace("__", "_"));
    replace(source, given, wanted)
}

fn rename_block(source: &mut String, given: &str, it: &Bound) -> String {
    let suffix = if it.kind == Kind::Uniform {
        "Uniform"
    } else {
        "Buffer"
    };
    replace(
        source,
        given.to_owned(),
        format!("{}{suffix}", camel_case(&it.name)),
    )
}

/// Renames where the new name is free; gives the name that stands.
fn replace(source: &mut String, given: String, wanted: String) -> String {
    if text::has_name(source, &wanted) {
        return given;
    }
    *source = text::rename(source, &given, &wanted);
    wanted
}

#[cfg(test)]
mod tests {
    use super::subgroup_extensions;

    #[test]
    fn a_text_asks_for_the_extensions_that_it_needs() {
        let of = |text: &str| subgroup_extensions(text).join(" ");
        assert_eq!(
            of("uint a = gl_SubgroupSize;"),
            "GL_KHR_shader_subgroup_basic"
        );
        assert_eq!(
            of("uint a = subgroupAdd(b); uint c = subgroupShuffleUp(a, 1u);"),
            "GL_KHR_shader_subgroup_basic GL_KHR_shader_subgroup_arithmetic \
             GL_KHR_shader_subgroup_shuffle_relative"
        );
        assert_eq!(
            of("uint a = subgroupBroadcastFirst(b);"),
            "GL_KHR_shader_subgroup_basic GL_KHR_shader_subgroup_ballot"
        );
    }
}
