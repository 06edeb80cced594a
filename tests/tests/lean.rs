//! What is generated is as lean as what an expert writes: the published form of four moment
//! shadow mapping, as kernels, against the same steps written in HLSL and compiled by glslang, both
//! through the same optimiser.

use std::process::Command;

use hankel_codegen::cost::{Cost, of_spirv};
use hankel_codegen::finish::cost_after_optimisation;
use hankel_tests::{Crate, root};

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
        .arg(root().join("tests/listing").join(format!("{name}.hlsl")))
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

fn of(one: &Crate, kernel: &str) -> Cost {
    of_spirv(&one.bundle.modules[kernel], kernel).unwrap_or_else(|e| panic!("{e}"))
}

#[test]
fn the_same_algorithm_costs_what_it_costs_by_hand() {
    let (listing, shadows) = (Crate::listing(), Crate::shadows());
    for name in ["hamburger", "hausdorff"] {
        let hand = by_hand(name);
        let kernel = of(&listing, &format!("{name}_listing"));
        let robust = of(&shadows, &format!("{name}_4msm"));
        println!(
            "{name}: by hand {} operations and {} branches, the same as a kernel {} and {}, robust {} and {}",
            hand.operations,
            hand.branches,
            kernel.operations,
            kernel.branches,
            robust.operations,
            robust.branches
        );
        // 5 %, rounded up.
        assert!(
            kernel.operations * 20 <= hand.operations * 21 + 19,
            "{kernel:?} {hand:?}"
        );
        // One guard, and nothing else.
        assert_eq!(kernel.branches, 1);
        assert!(kernel.branches <= hand.branches);
        assert_eq!(robust.branches, 1);
    }
}

/// One guard for each invocation, and no other test that the source does not ask for.
#[test]
fn kernels_have_the_branches_of_their_source() {
    let shadows = Crate::shadows();
    for (kernel, branches) in [
        ("light_depth", 0),
        ("surface", 0),
        // The guard.
        ("hamburger_4msm", 1),
        ("hausdorff_4msm", 1),
        ("vsm", 1),
        ("quantize_4_unit", 1),
        ("dequantize_4_symmetric", 1),
        // Which encoding the map has, a specialisation constant: for moments and for depth.
        ("shade_hamburger", 3),
        ("shade_variance", 3),
    ] {
        assert_eq!(of(&shadows, kernel).branches, branches, "{kernel}");
    }
}

/// NaN tests and bounds checks would show in the text.
#[test]
fn generated_texts_test_nothing_but_the_guard() {
    for (path, bytes) in &Crate::shadows().generate().files {
        let Ok(text) = std::str::from_utf8(bytes) else {
            continue;
        };
        if path.ends_with(".json") || path.starts_with("include") {
            continue;
        }
        for word in ["isnan", "isinf", "nagaTextureSampleLevel", "switch"] {
            assert!(!text.contains(word), "{path} contains {word}");
        }
    }
}
