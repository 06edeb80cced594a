//! MSL.

use std::borrow::Cow;
use std::collections::BTreeMap;

use hankel_dsl::native::describe::Rounding;
use naga::back::msl::{
    self, BindSamplerTarget, BindTarget, EntryPointResources, Error, Options, PipelineOptions,
};
use naga::{Expression, Module, ResourceBinding, SampleLevel};

use super::{Job, Kind, Place, Text, Written, text};
use crate::error::{Failure, Step};
use crate::placement::Slots;

/// Metal's last slots.
const BUFFERS: u8 = 30;
const TEXTURES: u8 = 127;
const SAMPLERS: u8 = 15;

pub(super) fn write(job: &Job<'_>) -> Result<Written, Failure> {
    let (module, info) = job.settled()?;
    let module = with_marked_comparisons(module);
    let bound = job.bound();
    let base = job.options.placement.msl_slot_base;
    let (mut buffers, mut textures, mut samplers) = (base, base, base);
    let mut resources = EntryPointResources::default();
    let mut given = Slots::new(&job.options.placement, job.kernel, job.language);
    let mut slots = BTreeMap::new();
    let mut take = |next: &mut u8, class: &'static str, most: u8, binding: u32| {
        let moved = given.places(binding).and_then(|it| it.msl);
        let slot = moved.map_or(*next, |it| it.slot);
        *next = next.saturating_add(1);
        given.take(binding, class, 0, slot.into(), most.into())?;
        slots.insert(binding, (class, slot));
        Ok::<_, Failure>(slot)
    };
    for it in &bound {
        let mut target = BindTarget::default();
        match it.kind {
            Kind::Uniform | Kind::Buffer { .. } => {
                target.buffer = Some(take(&mut buffers, "buffer", BUFFERS, it.binding)?);
                target.mutable = it.kind == (Kind::Buffer { written: true });
            }
            Kind::Texture | Kind::Image => {
                target.texture = Some(take(&mut textures, "texture", TEXTURES, it.binding)?);
                target.mutable = it.kind == Kind::Image;
            }
            Kind::Sampler => {
                let slot = take(&mut samplers, "sampler", SAMPLERS, it.binding)?;
                target.sampler = Some(BindSamplerTarget::Resource(slot));
            }
        }
        resources.resources.insert(
            ResourceBinding {
                group: it.group,
                binding: it.binding,
            },
            target,
        );
    }
    // The sizes come after the other buffers; in the order of the globals, as naga lists them.
    let last = slots.values().filter(|(class, _)| *class == "buffer");
    let sizes = last.map(|(_, slot)| slot.saturating_add(1)).max();
    let sizes = sizes.unwrap_or(base);
    resources.sizes_buffer = Some(sizes);
    let mut sized: Vec<_> = bound.iter().filter(|it| it.unsized_).collect();
    sized.sort_by_key(|it| it.handle);
    let sized: Vec<u32> = sized.into_iter().map(|it| it.binding).collect();
    let version = job.options.msl_version;
    let options = Options {
        lang_version: (version.major, version.minor),
        per_entry_point_map: [(job.kernel.name.clone(), resources)].into(),
        fake_missing_bindings: false,
        bounds_check_policies: job.options.policies(),
        zero_initialize_workgroup_memory: false,
        force_loop_bounding: false,
        emit_int_div_checks: false,
        ..Options::default()
    };
    let (source, written) =
        match msl::write_string(&module, &info, &options, &PipelineOptions::default()) {
            Ok(written) => written,
            Err(
                error @ (Error::UnsupportedAttribute(_)
                | Error::UnsupportedFunction(_)
                | Error::UnsupportedWritableStorageBuffer
                | Error::UnsupportedWritableStorageTexture(_)
                | Error::UnsupportedRWStorageTexture
                | Error::UnsupportedArrayOf(_)
                | Error::UnsupportedBuiltIn(_)
                | Error::CapabilityNotSupported(_)),
            ) => {
                return Ok(Written::Unsupported(format!("MSL {version}: {error}")));
            }
            Err(error) => return Err(job.failure(&error)),
        };
    let entry_point = match written.entry_point_names.into_iter().next() {
        Some(Ok(name)) => name,
        Some(Err(error)) => return Err(job.failure(&error)),
        None => job.kernel.name.clone(),
    };
    // naga leaves an empty structure for inputs, and the offset of what is no longer in a block.
    let source = source
        .replace(&format!("struct {entry_point}Input {{\n}};\n"), "")
        .replace(" - 0 - ", " - ");
    let source = compared_at_level_zero(&fenced(&source));
    let source = with_gradients(&source);
    // As the Metal Shading Language specification writes it.
    let source = source.replace(") index(", "), index(");
    let source = job.open_constants(source)?;
    let source = if job.kernel.rounding == Rounding::Exact {
        exact(&source).ok_or_else(|| Failure {
            construct: Some("`#include`".into()),
            message: "the text has none, after which `#pragma` is expected".into(),
            ..job.failure(&std::fmt::Error)
        })?
    } else {
        source
    };
    let sizes_slot = source
        .contains("_mslBufferSizes& ")
        .then_some(u32::from(sizes));
    if sizes_slot.is_some() && sizes > BUFFERS {
        return Err(Failure {
            step: Step::Place,
            message: format!(
                "the buffer of sizes, which comes after all others in MSL, would be at slot {sizes}, \
                 and there is none above {BUFFERS}"
            ),
            ..job.failure(&std::fmt::Error)
        });
    }
    let places = bound
        .iter()
        .map(|it| {
            let (class, slot) = slots[&it.binding];
            let place = Place {
                name: text::name_before(&source, &format!(" [[{class}({slot})]]")),
                class: class.into(),
                index: Some(slot.into()),
                space: None,
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
        sizes_slot,
        sized: if sizes_slot.is_some() {
            sized
        } else {
            Vec::new()
        },
        requires: Vec::new(),
    }))
}

/// Makes what a thread writes to a texture visible to its own reads, which naga leaves out
/// (`tests/upstream/naga-msl-fence`).
fn fenced(source: &str) -> String {
    const ACCESS: &str = "metal::access::read_write> ";
    let textures: Vec<&str> = source
        .split(ACCESS)
        .skip(1)
        .filter_map(|rest| {
            rest.split(|c: char| !c.is_alphanumeric() && c != '_')
                .next()
        })
        .collect();
    if textures.is_empty() {
        return source.to_owned();
    }
    let mut text = String::new();
    for line in source.split_inclusive('\n') {
        text += line;
        let statement = line.trim_start();
        let indent = &line[..line.len() - statement.len()];
        let written = textures.iter().find(|name| {
            statement
                .strip_prefix(**name)
                .is_some_and(|rest| rest.starts_with(".write("))
        });
        if let Some(name) = written {
            text += &format!("{indent}{name}.fence();\n");
        }
    }
    text
}

/// naga leaves level 0 out of a comparison, and a fragment would compare at its own level. So its writer gets a level
/// that only these have, the reference, for which [`compared_at_level_zero`] puts the right one. (A number of its own would
/// have to come before what uses it, and all of the function with it.)
fn with_marked_comparisons(module: Cow<'_, Module>) -> Cow<'_, Module> {
    let at_zero = |expression: &Expression| match expression {
        Expression::ImageSample {
            gather: None,
            depth_ref,
            level: SampleLevel::Zero,
            ..
        } => *depth_ref,
        _ => None,
    };
    let has_any = {
        let entries = module.entry_points.iter().map(|it| &it.function);
        let mut all = entries.chain(module.functions.iter().map(|(_, it)| it));
        all.any(|it| it.expressions.iter().any(|(_, it)| at_zero(it).is_some()))
    };
    if !has_any {
        return module;
    }
    let mut module = module.into_owned();
    let entries = module.entry_points.iter_mut().map(|it| &mut it.function);
    for function in entries.chain(module.functions.iter_mut().map(|(_, it)| it)) {
        for (_, expression) in function.expressions.iter_mut() {
            if let Some(reference) = at_zero(expression)
                && let Expression::ImageSample { level, .. } = expression
            {
                *level = SampleLevel::Exact(reference);
            }
        }
    }
    Cow::Owned(module)
}

/// Gradients in three dimensions and of cubes by their own names: naga 30.0.1 writes those of two dimensions for all
/// (`tests/upstream/naga-msl-gradients`).
fn with_gradients(source: &str) -> String {
    const GRADIENT: &str = "metal::gradient2d(";
    if !source.contains(GRADIENT) {
        return source.to_owned();
    }
    let mut text = String::with_capacity(source.len());
    let mut rest = source;
    while let Some(at) = rest.find(".sample(") {
        let (before, call) = rest.split_at(at + ".sample(".len());
        let end = text::closing(call).unwrap_or(call.len());
        let texture = text::name_at_end(&before[..at]);
        let gradient = ["texture3d", "texturecube", "texturecube_array"]
            .into_iter()
            .find(|kind| is_declared(source, kind, texture))
            .map(|kind| match kind {
                "texture3d" => "metal::gradient3d(",
                _ => "metal::gradientcube(",
            });
        text.push_str(before);
        match gradient {
            Some(gradient) => text.push_str(&call[..end].replace(GRADIENT, gradient)),
            None => text.push_str(&call[..end]),
        }
        rest = &call[end..];
    }
    text + rest
}

/// Whether a parameter of this name is a texture of this kind.
fn is_declared(source: &str, kind: &str, name: &str) -> bool {
    source
        .match_indices(&format!("metal::{kind}<"))
        .any(|(at, _)| {
            let declared = source[at..].split_once("> ").map(|(_, rest)| rest);
            declared.is_some_and(|rest| {
                rest.strip_prefix(name).is_some_and(|after| {
                    !after.starts_with(|c: char| c.is_alphanumeric() || c == '_')
                })
            })
        })
}

/// Level 0 for the level of each comparison: those of a fragment's own level have none.
fn compared_at_level_zero(source: &str) -> String {
    const COMPARE: &str = ".sample_compare(";
    let mut text = String::new();
    let mut rest = source;
    while let Some(at) = rest.find(COMPARE) {
        let (before, call) = rest.split_at(at + COMPARE.len());
        let (last, end) = last_argument(call);
        text += before;
        if call[last..end].starts_with("metal::level(") {
            text += &compared_at_level_zero(&call[..last]);
            text += "metal::level(0)";
        } else {
            text += &compared_at_level_zero(&call[..end]);
        }
        rest = &call[end..];
    }
    text + rest
}

/// Where the last argument of a call begins and ends, in the text behind the bracket that opens it.
fn last_argument(call: &str) -> (usize, usize) {
    let (mut depth, mut last) = (0_u32, 0);
    for (at, c) in call.char_indices() {
        match c {
            '(' | '[' | '{' => depth += 1,
            ')' if depth == 0 => return (last, at),
            ')' | ']' | '}' => depth = depth.saturating_sub(1),
            ',' if depth == 0 => last = at + 2,
            _ => {}
        }
    }
    (call.len(), call.len())
}

/// Forbids contraction and reordering in all that follows the last header. `safe` by itself still
/// lets a statement's product and sum become one operation.
fn exact(source: &str) -> Option<String> {
    const PRAGMAS: &str = "\n#pragma METAL fp math_mode(safe)\n#pragma METAL fp contract(off)\n";
    let include = source.rfind("#include ")?;
    let end = include + source[include..].find('\n')? + 1;
    Some([&source[..end], PRAGMAS, &source[end..]].concat())
}

#[cfg(test)]
mod tests {
    use super::{compared_at_level_zero, fenced};

    #[test]
    fn what_is_written_is_fenced_where_it_is_read_too() {
        let text = "  metal::texture2d<int, metal::access::read_write> a [[texture(0)]]\n\
                    , metal::texture2d<int, metal::access::write> b [[texture(1)]]\n\
                    {\n    a.write(x, y);\n    b.write(x, y);\n}\n";
        let wanted = text.replace("a.write(x, y);\n", "a.write(x, y);\n    a.fence();\n");
        assert_eq!(fenced(text), wanted);
        let plain = text.replace("read_write", "read");
        assert_eq!(fenced(&plain), plain);
    }

    #[test]
    fn comparisons_at_level_zero_say_so() {
        let text = "float x = a.sample_compare(s, metal::float2(u, v), i, b.sample_compare(s, w, r), \
                    metal::level(b.sample_compare(s, w, r))) + c.sample_compare(s, w, r, metal::level(r));\n";
        let wanted = "float x = a.sample_compare(s, metal::float2(u, v), i, b.sample_compare(s, w, r), \
                      metal::level(0)) + c.sample_compare(s, w, r, metal::level(0));\n";
        assert_eq!(compared_at_level_zero(text), wanted);
        let at_own_level = "x = a.sample_compare(s, metal::float2(u, v), metal::max(p, q));\n";
        assert_eq!(compared_at_level_zero(at_own_level), at_own_level);
    }
}
