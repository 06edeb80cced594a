//! What is generated is as lean as what an expert writes: the published form of four moment
//! shadow mapping, as kernels, against the same steps written in HLSL and compiled by glslang, both
//! through the same optimiser.

use hankel_tests::Crate;
use hankel_tests::lean::{compare, of};

#[test]
fn the_same_algorithm_costs_what_it_costs_by_hand() {
    for name in ["hamburger", "hausdorff"] {
        let lean = compare(name);
        let (hand, kernel) = (lean.by_hand, lean.kernel);
        // 5 %, rounded up.
        assert!(
            kernel.operations * 20 <= hand.operations * 21 + 19,
            "{kernel:?} {hand:?}"
        );
        // One guard, and nothing else.
        assert_eq!(kernel.branches, 1);
        assert!(kernel.branches <= hand.branches);
        assert_eq!(lean.robust.branches, 1);
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
        // Whether the face sees the light; which encoding the map has, a specialisation constant: two tests for
        // four moments, one for two, and one for depth.
        ("shade_hamburger", 4),
        ("shade_variance", 3),
    ] {
        assert_eq!(of(&shadows, kernel).branches, branches, "{kernel}");
    }
}

/// A `for` loop over a range costs what the same loop by `while` does.
#[test]
fn for_costs_what_while_costs() {
    let iteration = Crate::iteration();
    for name in ["counted", "window"] {
        let cost = |by: &str| of(&iteration, &format!("{name}_by_{by}"));
        let (by_for, by_while) = (cost("for"), cost("while"));
        println!("{name}: for {by_for:?}, while {by_while:?}");
        assert!(
            by_for.operations <= by_while.operations && by_for.branches <= by_while.branches,
            "{name}: for {by_for:?}, while {by_while:?}"
        );
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
