//! The identical kernel on every backend that this machine has: scalar and lanes natively, SPIR-V
//! untouched and through naga, and WGSL, on a Vulkan device. Without a driver these tests fail and
//! say how to get one.

use hankel_codegen::Language;
use hankel_host::crates::KernelEntry;
use hankel_host::device::VulkanDevice;
use hankel_host::parity::{Outcome, Path, Report, Subject, Wgsl, run};
use hankel_tests::Crate;

fn parity(one: &Crate, seed: u64) -> Report {
    let mut vulkan = VulkanDevice::new().unwrap_or_else(|e| panic!("{e}"));
    let generated = one.generate();
    let words = one.words();
    let entries: Vec<KernelEntry> = one.entries.iter().cloned().map(KernelEntry::from).collect();
    let subjects: Vec<Subject<'_>> = entries
        .iter()
        .map(|entry| {
            let manifest = &generated.manifest.kernels[&entry.kernel.name];
            let wgsl = manifest.languages.get(&Language::Wgsl).map_or_else(
                || Err(manifest.unsupported[&Language::Wgsl].clone()),
                |there| {
                    let text = std::str::from_utf8(&generated.files[&there.file]).expect("UTF-8");
                    Ok(Wgsl {
                        text,
                        entry_point: &there.entry_point,
                    })
                },
            );
            Subject {
                entry,
                spirv: Ok(&words[&entry.kernel.name]),
                wgsl,
            }
        })
        .collect();
    run(&mut vulkan, &subjects, seed, &mut |_| {})
}

#[test]
fn built_in_kernels_agree_everywhere() {
    let shadows = Crate::shadows();
    let report = parity(&shadows, 1);
    println!("{report}");
    assert!(report.passed, "{report}");
    let kernels = shadows.entries.iter().map(|entry| &entry.kernel);
    let exact: Vec<&String> = kernels.filter(|it| it.exact).map(|it| &it.name).collect();
    for kernel in &report.kernels {
        for path in &kernel.paths {
            // WGSL has no f64, and cannot ask for arithmetic as it is written.
            let beyond_wgsl = kernel.kernel.ends_with("_f64") || exact.contains(&&kernel.kernel);
            assert_eq!(
                matches!(path.outcome, Outcome::Unavailable { .. }),
                path.path == Path::Wgsl && beyond_wgsl,
                "{} {}: {:?}",
                kernel.kernel,
                path.path,
                path.outcome
            );
        }
    }
}

#[test]
fn another_seed_makes_no_difference() {
    let report = parity(&Crate::shadows(), 20_261_121);
    assert!(report.passed, "{report}");
}

#[test]
fn everything_that_a_kernel_can_do_agrees_everywhere() {
    let report = parity(&Crate::conformance(), 1);
    println!("{report}");
    assert!(report.passed, "{report}");
}

/// Bounds are shares for every finite input, whatever the backend.
#[test]
fn bounds_are_never_other_than_finite() {
    let report = parity(&Crate::shadows(), 3);
    for kernel in report.kernels.iter().filter(|k| {
        ["4msm", "vsm", "quantize", "resolve"]
            .iter()
            .any(|part| k.kernel.contains(part))
    }) {
        assert_eq!(kernel.non_finite, 0, "{}", kernel.kernel);
    }
}
