//! What the published form of four moment shadow mapping costs: written in HLSL by hand, as a kernel,
//! and in its robust form, all through the same optimiser.

use std::process::Command;

use hankel_codegen::cost::{Cost, of_spirv};
use hankel_codegen::finish::cost_after_optimisation;

use crate::{Crate, root};

/// The costs of one bound.
#[derive(Clone, Copy, Debug)]
pub struct Lean {
    /// The published steps in HLSL, compiled by glslang.
    pub by_hand: Cost,
    /// The same steps as a kernel.
    pub kernel: Cost,
    /// The built-in kernel.
    pub robust: Cost,
}

/// The costs of `hamburger` or `hausdorff`.
///
/// # Panics
///
/// If glslang is not installed.
#[must_use]
pub fn compare(name: &str) -> Lean {
    Lean {
        by_hand: by_hand(name),
        kernel: of(&Crate::listing(), &format!("{name}_listing")),
        robust: of(&Crate::shadows(), &format!("{name}_4msm")),
    }
}

/// What an entry point costs.
///
/// # Panics
///
/// If its SPIR-V cannot be read.
#[must_use]
pub fn of(one: &Crate, kernel: &str) -> Cost {
    of_spirv(&one.bundle.modules[kernel], kernel).unwrap_or_else(|e| panic!("{e}"))
}

/// HLSL through glslang, optimised.
fn by_hand(name: &str) -> Cost {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let module = folder.path().join("out.spv");
    let output = Command::new("glslangValidator")
        .args([
            "-D",
            "-V",
            "-e",
            "main",
            "-S",
            "comp",
            "--target-env",
            "vulkan1.1",
            "-o",
        ])
        .arg(&module)
        .arg(root().join("numerics/listing").join(format!("{name}.hlsl")))
        .output()
        .expect("glslangValidator must be installed: `apt-get install glslang-tools`");
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stdout)
    );
    let bytes = std::fs::read(&module).expect("glslang wrote it");
    cost_after_optimisation(&bytes, name).unwrap_or_else(|e| panic!("{e}"))
}
