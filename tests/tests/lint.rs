//! Kernels that map rows to rows have neither loops that a compiler cannot unroll nor dynamic
//! indices into arrays of their own, in the form from which every text is written. Bounds and derivatives in twice the
//! digits, from eight moments on, have arrays: in a row, their operations are too many (`is_long` in `bound/mod.rs`).

use std::collections::BTreeMap;

use hankel_codegen::lint::{Construct, Finding};
use hankel_codegen::translate::Ir;
use hankel_dsl::native::describe::{Kernel, Output, Role, Stage};
use hankel_tests::Crate;

/// Whether it looks nothing up in a texture or a buffer, writes to its own place alone, and its invocations do not work
/// together.
fn maps_rows(kernel: &Kernel) -> bool {
    if matches!(
        kernel.stage,
        Stage::Compute {
            cooperative: true,
            ..
        }
    ) {
        return false;
    }
    let reads = |role: &Role| {
        matches!(
            role,
            Role::Texture { .. } | Role::Storage { .. } | Role::StorageMut { .. }
        )
    };
    let writes = |output: &Output| matches!(output, Output::Texture { .. });
    !kernel.params.iter().any(|param| reads(&param.role)) && !kernel.outputs.iter().any(writes)
}

fn findings(one: &Crate) -> BTreeMap<String, (bool, Vec<Finding>)> {
    one.entries
        .iter()
        .map(|entry| {
            let kernel = &entry.kernel;
            let ir = Ir::read(&one.bundle.modules[&kernel.name], kernel)
                .unwrap_or_else(|e| panic!("{e}"));
            assert!(ir.is_clean(), "{}", kernel.name);
            (kernel.name.clone(), (maps_rows(kernel), ir.findings()))
        })
        .collect()
}

#[test]
fn maps_over_rows_are_clean() {
    let all = findings(&Crate::shadows());
    let maps: Vec<_> = all.iter().filter(|(_, (maps, _))| *maps).collect();
    let long: Vec<String> = [4, 5, 6]
        .into_iter()
        .flat_map(|n| ["compensated_n", "adjoint_compensated_n"].map(|kind| format!("{kind}{n}")))
        .flat_map(|what| ["", "_f64"].map(|bits| format!("moment_bound_{what}{bits}")))
        .collect();
    for (name, (_, found)) in &maps {
        // Their loops are as long for every input, too.
        let is_array = |it: &Finding| it.construct == Construct::DynamicIndex;
        let is_long = long.contains(name);
        assert_eq!(is_long, found.iter().any(is_array), "{name}: {found:?}");
        assert!(found.iter().all(is_array), "{name}: {found:?}");
    }
    let names: Vec<&str> = maps.iter().map(|(name, _)| name.as_str()).collect();
    let bounds = (1..=6).flat_map(|n| {
        let kinds = [
            "moment_bound",
            "moment_bound_adjoint",
            "moment_bound_compensated",
            "moment_bound_adjoint_compensated",
        ];
        kinds.map(|kind| format!("{kind}_n{n}"))
    });
    let points =
        (1..=6).flat_map(|n| ["canonical", "canonical_adjoint"].map(|kind| format!("{kind}_n{n}")));
    let others = [
        "hamburger_6msm_compensated",
        "hamburger_4msm",
        "hausdorff_4msm",
        "hausdorff_4msm_compensated",
        "hamburger_6msm",
        "trigonometric_4msm",
        "trigonometric_4msm_compensated",
        "vsm",
        "quantize_4_unit",
    ];
    for map in bounds.chain(points).chain(others.map(String::from)) {
        assert!(
            names.contains(&map.as_str()),
            "{map} is not a map: {names:?}"
        );
    }
}

/// Filters have loops as long as their inputs say; and the lint sees those.
#[test]
fn filters_loop_over_their_samples() {
    let all = findings(&Crate::shadows());
    for (kernel, loops) in [
        ("blur_rgba16unorm", 1),
        // How many samples is a specialisation constant.
        ("resolve_unit", 0),
        // Rows and columns.
        ("shade_pcf", 2),
        // Levels of the pyramid for the searches' regions and for the shadow's; searches until two have found no
        // blockers. A region's rows are four.
        ("shade_soft", 3),
    ] {
        let found = &all[kernel].1;
        assert_eq!(found.len(), loops, "{kernel}: {found:?}");
        assert!(
            found.iter().all(|it| it.construct == Construct::Loop),
            "{kernel}: {found:?}"
        );
    }
}
