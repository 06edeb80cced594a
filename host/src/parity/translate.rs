//! Through naga to SPIR-V, the way wgpu does it, but where it is asked for with the driver
//! forbidden to fuse, factor or reorder float arithmetic. What naga writes never forbids that, and lavapipe does all
//! three; left to it, parity would measure the driver's liberties, not what naga made of the code.

use std::panic::{AssertUnwindSafe, catch_unwind};

use hankel_dsl::native::describe::{ConstantValue, Scalar};
use naga::back::PipelineConstants;
use naga::back::pipeline_constants::process_overrides;
use naga::back::spv;
use naga::valid::{Capabilities, ValidationFlags, Validator};

use crate::device::vulkan::words;
use crate::device::{Arithmetic, route};

/// SPIR-V read and written anew by naga, with the specialisation constants of `constants`, by their
/// numbers, set to these values of 32 bits, and the others to their defaults.
///
/// # Errors
/// naga's words.
pub fn spirv_to_spirv(
    code: &[u32],
    constants: &[(u32, u32)],
    arithmetic: Arithmetic,
) -> Result<Vec<u32>, String> {
    guarded(|| {
        let options = naga::front::spv::Options {
            adjust_coordinate_space: false,
            strict_capabilities: false,
            block_ctx_dump_prefix: None,
        };
        let module = naga::front::spv::Frontend::new(code.iter().copied(), &options)
            .parse()
            .map_err(|e| format!("naga cannot read its SPIR-V: {e}"))?;
        let scalar_of = |id: u32| {
            let mut all = module.overrides.iter();
            let found = all.find(|(_, it)| it.id.map(u32::from) == Some(id));
            match found.map(|(_, it)| &module.types[it.ty].inner) {
                Some(naga::TypeInner::Scalar(scalar)) => match scalar.kind {
                    naga::ScalarKind::Float => Scalar::F32,
                    naga::ScalarKind::Sint => Scalar::I32,
                    naga::ScalarKind::Bool => Scalar::Bool,
                    _ => Scalar::U32,
                },
                _ => Scalar::U32,
            }
        };
        let constants = constants
            .iter()
            .map(|&(id, word)| {
                let value = ConstantValue::of_word(scalar_of(id), word);
                (id.to_string(), value.number())
            })
            .collect();
        write(&module, &constants, arithmetic)
    })
}

/// WGSL to SPIR-V, with the entry point `entry_point` under the name `name`, and its overrides at their
/// defaults.
///
/// # Errors
/// naga's words.
pub fn wgsl_to_spirv(
    text: &str,
    entry_point: &str,
    name: &str,
    arithmetic: Arithmetic,
) -> Result<Vec<u32>, String> {
    guarded(|| {
        let text = route::for_naga(text);
        let mut module = naga::front::wgsl::parse_str(&text)
            .map_err(|e| format!("naga cannot read its WGSL: {}", e.emit_to_string(&text)))?;
        for entry in &mut module.entry_points {
            if entry.name == entry_point {
                entry.name = name.into();
            }
        }
        write(&module, &PipelineConstants::default(), arithmetic)
    })
}

fn write(
    module: &naga::Module,
    constants: &PipelineConstants,
    arithmetic: Arithmetic,
) -> Result<Vec<u32>, String> {
    let info = Validator::new(ValidationFlags::all(), Capabilities::all())
        .subgroup_stages(naga::valid::ShaderStages::all())
        .subgroup_operations(naga::valid::SubgroupOperationSet::all())
        .validate(module)
        .map_err(|e| format!("naga finds it invalid: {}", e.into_inner()))?;
    let (module, info) = process_overrides(module, &info, None, constants)
        .map_err(|e| format!("naga cannot set its constants: {e}"))?;
    let options = spv::Options {
        lang_version: (1, 3),
        flags: spv::WriterFlags::empty(),
        ..Default::default()
    };
    let written = spv::write_vec(&module, &info, &options, None)
        .map_err(|e| format!("naga cannot write it: {e}"))?;
    match arithmetic {
        Arithmetic::Pinned => words::forbid_reordering(&written),
        Arithmetic::Free => Ok(written),
    }
}

fn guarded(work: impl FnOnce() -> Result<Vec<u32>, String>) -> Result<Vec<u32>, String> {
    catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(|_| Err("naga panicked".into()))
}
