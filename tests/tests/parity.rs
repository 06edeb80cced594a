//! The identical kernel on every backend that a Vulkan driver alone is enough for: scalar and lanes
//! natively, SPIR-V untouched and through naga, and WGSL. Without a driver these tests fail and say
//! how to get one.

use std::path::PathBuf;
use std::time::Duration;

use hankel_host::crates::KernelEntry;
use hankel_matrix::column::Column;
use hankel_matrix::known::Known;
use hankel_matrix::report::{Outcome, Report};
use hankel_matrix::run::{self, Request};
use hankel_matrix::subject::Subject;
use hankel_matrix::tools::Tools;
use hankel_tests::Crate;

fn run_all(subjects: &[Subject], seed: u64) -> Report {
    let request = Request {
        columns: Column::PLAIN.into(),
        seed,
        limit: Duration::from_secs(120),
        tools: Tools::of_cache(None),
        runner: vec![PathBuf::from(env!("CARGO_BIN_EXE_hankel-tests-runner")).into()],
        cache: None,
        known: Known::default(),
        absent: None,
        whole: false,
        required: Column::PLAIN.into(),
    };
    run::run(&request, subjects, &|_| ()).unwrap_or_else(|e| panic!("{e}"))
}

fn subjects(one: &Crate) -> Vec<Subject> {
    let entries: Vec<KernelEntry> = one.entries.iter().cloned().map(KernelEntry::from).collect();
    Subject::all(&one.generate(), &entries)
}

#[test]
fn built_in_kernels_agree_everywhere() {
    let shadows = Crate::shadows();
    let report = run_all(&subjects(&shadows), 1);
    println!("{report}");
    assert!(report.passed, "{report}");
    let exact = |name: &str| {
        let kernel = shadows.entries.iter().find(|e| e.kernel.name == name);
        kernel.is_some_and(|e| e.kernel.exact)
    };
    for row in &report.kernels {
        for (column, cell) in &row.cells {
            // WGSL has no f64, and cannot ask for arithmetic as it is written.
            let beyond_wgsl = row.kernel.ends_with("_f64") || exact(&row.kernel);
            assert_eq!(
                matches!(cell.outcome, Outcome::Inexpressible { .. }),
                *column == Column::Wgsl && beyond_wgsl,
                "{} {column}: {:?}",
                row.kernel,
                cell.outcome
            );
        }
    }
}

#[test]
fn another_seed_makes_no_difference() {
    let report = run_all(&subjects(&Crate::shadows()), 20_261_121);
    assert!(report.passed, "{report}");
}

#[test]
fn everything_that_a_kernel_can_do_agrees_everywhere() {
    let report = run_all(&subjects(&Crate::conformance()), 1);
    println!("{report}");
    assert!(report.passed, "{report}");
}

/// Bounds are shares for every finite input, whatever the backend.
#[test]
fn bounds_are_never_other_than_finite() {
    let report = run_all(&subjects(&Crate::shadows()), 3);
    for row in report.kernels.iter().filter(|row| {
        ["4msm", "vsm", "quantize", "resolve"]
            .iter()
            .any(|part| row.kernel.contains(part))
    }) {
        assert_eq!(row.non_finite, 0, "{}", row.kernel);
    }
}
