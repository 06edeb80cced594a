//! WGSL, which is read back and validated.

use std::borrow::Cow;
use std::collections::BTreeMap;

use naga::back::pipeline_constants::process_overrides;
use naga::back::{PipelineConstants, wgsl};
use naga::valid::ModuleInfo;
use naga::{ImageClass, Module, StorageAccess, StorageFormat, TypeInner};

use super::{Job, Place, Text, Written, pushed, text, validate};
use crate::Language;
use crate::error::{Failure, Step};

/// WebGPU's feature for storage textures of more formats.
const MORE_FORMATS: &str = "texture-formats-tier1";

/// WGSL's language feature for storage textures that are read.
const READ_STORAGE: &str = "readonly_and_readwrite_storage_textures";

/// WebGPU's feature for operations of subgroups, and WGSL's extension.
const SUBGROUPS: &str = "subgroups";

/// Extensions of WGSL that naga enables, each with WebGPU's feature.
const EXTENSIONS: [(&str, &str); 4] = [
    ("f16", "shader-f16"),
    ("primitive_index", "primitive-index"),
    ("clip_distances", "clip-distances"),
    ("dual_source_blending", "dual-source-blending"),
];

/// WGSL's language feature for push constants.
const IMMEDIATES: &str = "immediate_address_space";

/// How they are declared.
const IMMEDIATE: &str = "var<immediate> ";

/// What begins a text with operations of subgroups, as WGSL demands. naga 30 has the operations, and
/// refuses this line: whoever hands the text to wgpu 30 takes it out.
pub(crate) const ENABLE_SUBGROUPS: &str = "enable subgroups;\n";

/// The largest f32, as naga writes it.
const LARGEST_AS_WRITTEN: &str = "340282350000000000000000000000000000000";

/// Its digits.
const LARGEST: &str = "340282346638528859811704183484516925440";

pub(super) fn write(job: &Job<'_>) -> Result<Written, Failure> {
    let ir = job.ir;
    let in_wgsl = job.options.placement.in_wgsl(job.kernel)?;
    let place = |binding: u32| in_wgsl.get(&binding).copied().unwrap_or((0, binding));
    let mut module = Cow::Borrowed(&ir.module);
    if in_wgsl.iter().any(|(binding, at)| *at != (0, *binding)) {
        for (_, global) in module.to_mut().global_variables.iter_mut() {
            if let Some(at) = &mut global.binding {
                (at.group, at.binding) = place(at.binding);
            }
        }
    }
    let source = wgsl::write_string(&module, &ir.info, wgsl::WriterFlags::empty())
        .map_err(|error| job.failure(&error))?;
    // naga writes the shortest digits that round to the largest f32. They are above it, which Tint
    // refuses; these are all of its digits.
    let source = source.replace(LARGEST_AS_WRITTEN, LARGEST);
    let read = read_back(&source, &job.kernel.name)?;
    if !can_be_set(&read) {
        return Ok(Written::Unsettable);
    }
    let mut places = job
        .bound()
        .iter()
        .map(|bound| {
            let (group, number) = place(bound.binding);
            let place = Place {
                name: declared(&source, group, number),
                class: "binding".into(),
                index: Some(number),
                space: Some(group),
                block: None,
                combined_with: Vec::new(),
            };
            (bound.binding, place)
        })
        .collect::<BTreeMap<_, _>>();
    let mut requires = Vec::new();
    if let (Some(binding), Some((_, after))) = (pushed(job.kernel), source.split_once(IMMEDIATE)) {
        let place = Place {
            name: text::name_before(after, ":"),
            class: "immediate".into(),
            index: None,
            space: None,
            block: None,
            combined_with: Vec::new(),
        };
        places.insert(binding, place);
        requires.push(IMMEDIATES.to_owned());
    }
    if ir.globals().any(|(_, inner)| needs_more_formats(inner)) {
        requires.push(MORE_FORMATS.to_owned());
    }
    if ir.globals().any(|(_, inner)| reads_storage(inner)) {
        requires.push(READ_STORAGE.to_owned());
    }
    for (extension, feature) in EXTENSIONS {
        if source.contains(&format!("enable {extension};")) {
            requires.push(feature.to_owned());
        }
    }
    let entry_point = text::name_before(&source_after_stage(&source), "(")
        .unwrap_or_else(|| job.kernel.name.clone());
    let source = if job.kernel.subgroups.is_unused() {
        source
    } else {
        requires.push(SUBGROUPS.to_owned());
        format!("{ENABLE_SUBGROUPS}\n{source}")
    };
    Ok(Written::Text(Text {
        source,
        entry_point,
        places,
        sizes_slot: None,
        sized: Vec::new(),
        requires,
    }))
}

/// Formats of WGSL's core.
fn needs_more_formats(inner: &TypeInner) -> bool {
    use StorageFormat::*;
    match inner {
        TypeInner::Image {
            class: ImageClass::Storage { format, .. },
            ..
        } => !matches!(
            format,
            Rgba8Unorm
                | Rgba8Snorm
                | Rgba8Uint
                | Rgba8Sint
                | Rgba16Uint
                | Rgba16Sint
                | Rgba16Float
                | R32Uint
                | R32Sint
                | R32Float
                | Rg32Uint
                | Rg32Sint
                | Rg32Float
                | Rgba32Uint
                | Rgba32Sint
                | Rgba32Float
                | Bgra8Unorm
        ),
        _ => false,
    }
}

/// Whether it is a storage texture that is read.
fn reads_storage(inner: &TypeInner) -> bool {
    matches!(
        inner,
        TypeInner::Image {
            class: ImageClass::Storage { access, .. },
            ..
        } if access.contains(StorageAccess::LOAD)
    )
}

/// The name that the declaration after `@group(g) @binding(b)` gives.
fn declared(source: &str, group: u32, binding: u32) -> Option<String> {
    let mark = format!("@group({group}) @binding({binding})");
    let after = &source[source.find(&mark)? + mark.len()..];
    text::name_before(&after[..after.find(';')?], ":")
}

/// The text from the entry point's `fn` on.
fn source_after_stage(source: &str) -> String {
    let stage = ["\n@compute", "\n@vertex", "\n@fragment"]
        .iter()
        .find_map(|mark| source.find(mark));
    let rest = &source[stage.unwrap_or(0)..];
    rest.find("fn ")
        .map_or_else(String::new, |place| rest[place..].to_owned())
}

/// Whether wgpu can set the constants. naga 30.0.1 folds every function when it does, and may
/// come to a module that its own validator refuses.
fn can_be_set((module, info): &(Module, ModuleInfo)) -> bool {
    module.overrides.is_empty()
        || process_overrides(module, info, None, &PipelineConstants::default()).is_ok()
}

fn read_back(source: &str, name: &str) -> Result<(Module, ModuleInfo), Failure> {
    let step = Step::Reread(Language::Wgsl);
    let module = naga::front::wgsl::parse_str(source).map_err(|error| Failure {
        kernel: name.into(),
        step,
        construct: error
            .location(source)
            .and_then(|place| source.lines().nth(place.line_number as usize - 1))
            .map(|line| format!("`{}`", line.trim())),
        message: error.message().to_owned(),
        panicked: false,
    })?;
    let info = validate(&module, name).map_err(|failure| Failure { step, ..failure })?;
    Ok((module, info))
}

#[cfg(test)]
mod tests {
    use super::{LARGEST, LARGEST_AS_WRITTEN};

    #[test]
    fn the_largest_number_is_written_whole() {
        assert_eq!(f32::MAX.to_string(), LARGEST_AS_WRITTEN);
        assert_eq!(
            f64::from(f32::MAX).to_string(),
            "340282346638528860000000000000000000000"
        );
        // Both round to it; only one of them is not above it.
        assert_eq!(LARGEST.parse(), Ok(f32::MAX));
        assert_eq!(
            LARGEST.parse(),
            Ok((2.0_f64 - 2.0_f64.powi(-23)) * 2.0_f64.powi(127))
        );
    }
}
