//! HLSL. naga reads every sampler from a heap; here a sampler is a `SamplerState` in a register
//! of its own, as hand-written shaders and root signatures have it.

use std::collections::BTreeMap;

use naga::ResourceBinding;
use naga::back::hlsl::{BindTarget, Options, PipelineOptions, Writer};

use super::{BoundsChecks, Job, Kind, Place, Text, Written, text};
use crate::error::Failure;

pub(super) fn write(job: &Job<'_>) -> Result<Written, Failure> {
    let (module, info) = job.frozen()?;
    let bound = job.bound();
    let mut registers = BTreeMap::new();
    let mut next: BTreeMap<char, u32> = BTreeMap::new();
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
            Kind::Uniform => 'b',
            Kind::Buffer { written: false } | Kind::Texture => 't',
            Kind::Buffer { written: true } | Kind::Image => 'u',
            Kind::Sampler => 's',
        };
        let register = next.entry(class).or_default();
        registers.insert(it.binding, (class, *register));
        let target = BindTarget {
            register: *register,
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
        *register += 1;
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
    let source = plain_samplers(&source).ok_or_else(|| Failure {
        construct: Some("a sampler".into()),
        message: "its declaration is not of the shape that is expected".into(),
        ..job.failure(&std::fmt::Error)
    })?;
    let source = job.precise(source, &["float", "double"])?;
    let places = bound
        .iter()
        .map(|it| {
            let (class, register) = registers[&it.binding];
            let place = Place {
                name: text::name_before(&source, &format!(" : register({class}{register}")),
                class: class.into(),
                index: Some(register),
                space: Some(0),
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

/// Replaces the heap and the indices into it by registers.
fn plain_samplers(source: &str) -> Option<String> {
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
                // `State name = nagaSamplerHeap[nagaGroup0SamplerIndexArray[register]];`
                let (declared, value) = rest.split_once(" = ")?;
                let register = value.strip_suffix("]];")?.rsplit_once('[')?.1;
                register.parse::<u32>().ok()?;
                plain.push_str(&format!("Sampler{declared} : register(s{register});"));
            }
            None => plain.push_str(line),
        }
        plain.push('\n');
    }
    (!plain.contains("SamplerHeap[")).then_some(plain)
}

#[cfg(test)]
mod tests {
    use super::plain_samplers;

    #[test]
    fn samplers_get_registers() {
        let source = "\
SamplerState nagaSamplerHeap[2048]: register(s0, space0);
SamplerComparisonState nagaComparisonSamplerHeap[2048]: register(s0, space1);
StructuredBuffer<uint> nagaGroup0SamplerIndexArray : register(t0, space255);
static const SamplerState smp = nagaSamplerHeap[nagaGroup0SamplerIndexArray[1]];
float x;
";
        assert_eq!(
            plain_samplers(source).unwrap(),
            "SamplerState smp : register(s1);\nfloat x;\n"
        );
        assert_eq!(
            plain_samplers("static const SamplerState smp = nagaSamplerHeap[other];\n"),
            None
        );
    }
}
