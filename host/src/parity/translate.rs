//! Through naga to SPIR-V, the way wgpu does it, for the one thing that wgpu cannot be asked for:
//! the words themselves.

use std::panic::{AssertUnwindSafe, catch_unwind};

use naga::back::spv;
use naga::valid::{Capabilities, ValidationFlags, Validator};

/// SPIR-V read and written anew by naga.
///
/// # Errors
/// naga's words.
pub fn spirv_to_spirv(words: &[u32]) -> Result<Vec<u32>, String> {
    guarded(|| {
        let options = naga::front::spv::Options {
            adjust_coordinate_space: false,
            strict_capabilities: false,
            block_ctx_dump_prefix: None,
        };
        let module = naga::front::spv::Frontend::new(words.iter().copied(), &options)
            .parse()
            .map_err(|e| format!("naga cannot read its SPIR-V: {e}"))?;
        write(&module)
    })
}

/// WGSL to SPIR-V, with the entry point `entry_point` under the name `name`.
///
/// # Errors
/// naga's words.
pub fn wgsl_to_spirv(text: &str, entry_point: &str, name: &str) -> Result<Vec<u32>, String> {
    guarded(|| {
        let mut module = naga::front::wgsl::parse_str(text)
            .map_err(|e| format!("naga cannot read its WGSL: {}", e.emit_to_string(text)))?;
        for entry in &mut module.entry_points {
            if entry.name == entry_point {
                entry.name = name.into();
            }
        }
        write(&module)
    })
}

fn write(module: &naga::Module) -> Result<Vec<u32>, String> {
    let info = Validator::new(ValidationFlags::all(), Capabilities::all())
        .validate(module)
        .map_err(|e| format!("naga finds it invalid: {}", e.into_inner()))?;
    let options = spv::Options {
        lang_version: (1, 3),
        flags: spv::WriterFlags::empty(),
        ..Default::default()
    };
    spv::write_vec(module, &info, &options, None).map_err(|e| format!("naga cannot write it: {e}"))
}

fn guarded(work: impl FnOnce() -> Result<Vec<u32>, String>) -> Result<Vec<u32>, String> {
    catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(|_| Err("naga panicked".into()))
}
