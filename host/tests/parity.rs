//! Kernels that agree pass, and one that was tampered with is caught, on the right path.

mod common;

use common::*;
use hankel_dsl::native::describe::Kernel;
use hankel_dsl::native::{Arg, CallError};
use hankel_host::crates::KernelEntry;
use hankel_host::inputs::{self, Class};
use hankel_host::parity::{self, KernelReport, Outcome, Path, Report, Subject, Wgsl};

fn all_samples() -> Vec<Sample> {
    vec![
        affine(),
        double(),
        histogram(),
        sums(),
        image(),
        place(),
        tint(),
        mixed(),
    ]
}

fn compare(samples: &[Sample], seed: u64) -> Report {
    let entries: Vec<KernelEntry> = samples.iter().map(Sample::entry).collect();
    let subjects: Vec<Subject<'_>> = samples
        .iter()
        .zip(&entries)
        .map(|(s, entry)| Subject {
            entry,
            spirv: Ok(&s.spirv),
            wgsl: Ok(Wgsl {
                text: &s.wgsl,
                entry_point: &s.kernel.name,
            }),
        })
        .collect();
    parity::run(&mut vulkan(), &subjects, seed, &mut |_| {})
}

fn outcome(kernel: &KernelReport, path: Path) -> &Outcome {
    &kernel
        .paths
        .iter()
        .find(|p| p.path == path)
        .unwrap()
        .outcome
}

#[test]
fn every_stage_agrees_on_every_path() {
    let samples = all_samples();
    let report = compare(&samples, inputs::SEED);
    let text = report.to_string();
    assert!(report.passed, "{text}");
    assert!(text.contains("all 8 kernels agree"), "{text}");
    for kernel in &report.kernels {
        assert_eq!(kernel.paths.len(), 4);
        for path in &kernel.paths {
            assert_eq!(path.outcome, Outcome::Passed, "{text}");
            assert_eq!(
                (path.found.beyond, path.found.largest_ulp),
                (0, 0),
                "{text}"
            );
            assert!(
                path.found.values >= 1000
                    || kernel.kernel == "histogram"
                    || kernel.kernel == "sums",
                "{text}"
            );
        }
        assert!(kernel.cases.iter().all(|(_, n)| *n > 1000), "{text}");
    }
    let json = serde_json::to_string(&report).unwrap();
    assert_eq!(serde_json::from_str::<Report>(&json).unwrap(), report);
}

#[test]
fn the_same_seed_makes_the_same_report_and_another_other_inputs() {
    let samples = [affine()];
    assert_eq!(compare(&samples, 5), compare(&samples, 5));
    let kernel = &samples[0].kernel;
    assert_eq!(inputs::cases(kernel, 5), inputs::cases(kernel, 5));
    assert_ne!(inputs::cases(kernel, 5), inputs::cases(kernel, 6));
}

#[test]
fn hostile_inputs_are_absurd_but_finite() {
    for sample in all_samples() {
        for case in inputs::cases(&sample.kernel, 11) {
            assert!(
                parity::is_finite(&sample.kernel, &case),
                "{}",
                sample.kernel.name
            );
        }
    }
    let largest = |class: Class| {
        inputs::cases(&affine().kernel, 11)
            .iter()
            .filter(|c| c.class == class)
            .flat_map(|c| match &c.args[1] {
                inputs::Input::Bytes(b) => bytemuck::pod_collect_to_vec::<u8, f32>(b),
                _ => Vec::new(),
            })
            .fold(0.0f32, |m, x| m.max(x.abs()))
    };
    assert_eq!(largest(Class::Hostile), f32::MAX);
    assert!(largest(Class::Ordinary) <= 1.0);
}

/// The first word `from` in the module, replaced.
fn tampered(words: &[u32], from: u32, to: u32) -> Vec<u32> {
    let mut words = words.to_vec();
    let at = words
        .iter()
        .position(|&w| w == from)
        .expect("the constant is in the module");
    words[at] = to;
    words
}

#[test]
fn a_changed_constant_in_the_spirv_is_caught_there_and_not_in_the_wgsl() {
    let mut sample = place();
    let two = 2.0f32;
    sample.spirv = tampered(&sample.spirv, two.to_bits(), two.next_up().to_bits());
    let report = compare(&[sample], inputs::SEED);
    let kernel = &report.kernels[0];
    assert!(!report.passed && !kernel.passed);
    assert_eq!(*outcome(kernel, Path::NativeLanes), Outcome::Passed);
    assert_eq!(*outcome(kernel, Path::SpirvPassthrough), Outcome::Failed);
    assert_eq!(*outcome(kernel, Path::SpirvThroughNaga), Outcome::Failed);
    assert_eq!(*outcome(kernel, Path::Wgsl), Outcome::Passed);
    let found = &kernel.paths[1];
    assert!(found.found.beyond > 100, "{report}");
    let first = found.found.first.as_ref().unwrap();
    assert!(first.value.starts_with("output[1]."), "{first:?}");
    assert!((1..=2).contains(&first.ulp), "{first:?}");
    assert!(
        first.inputs.iter().any(|(name, _)| name == "colour.x"),
        "{first:?}"
    );
    let text = report.to_string();
    assert!(
        text.contains("1 of 1 kernels do not agree") && text.contains("shift = "),
        "{text}"
    );
}

#[test]
fn a_changed_expression_in_the_wgsl_is_caught_there() {
    let mut sample = affine();
    sample.wgsl = sample
        .wgsl
        .replace("settings.offset)", "settings.offset * 1.0000002)");
    let report = compare(&[sample], inputs::SEED);
    let kernel = &report.kernels[0];
    assert_eq!(*outcome(kernel, Path::SpirvPassthrough), Outcome::Passed);
    assert_eq!(*outcome(kernel, Path::Wgsl), Outcome::Failed);
}

#[test]
fn a_tolerance_allows_what_it_says_and_no_more() {
    let with = |ulp, absolute| {
        let mut sample = place();
        let two = 2.0f32;
        sample.spirv = tampered(&sample.spirv, two.to_bits(), two.next_up().to_bits());
        sample.kernel.tolerance.ulp = ulp;
        sample.kernel.tolerance.absolute = absolute;
        compare(&[sample], inputs::SEED).passed
    };
    assert!(with(2, 0.0));
    assert!(with(0, 1e-6));
    assert!(!with(1, 0.0));
    assert!(!with(0, 1e-12));
}

#[test]
fn what_does_not_run_is_an_error_and_what_is_not_there_is_said() {
    let sample = affine();
    let panics = KernelEntry::new(
        Kernel {
            name: "panics".into(),
            ..sample.kernel.clone()
        },
        |_| {
            Err(CallError::Panic {
                message: "index 7 of 3".into(),
            })
        },
    );
    let entry = sample.entry();
    let broken = sample.wgsl.replace("let p", "lett p");
    let subject = |entry, text| Subject {
        entry,
        spirv: Err("there is no snapshot".into()),
        wgsl: Ok(Wgsl {
            text,
            entry_point: "affine",
        }),
    };
    let subjects = [subject(&panics, &sample.wgsl), subject(&entry, &broken)];
    let report = parity::run(&mut vulkan(), &subjects, 1, &mut |_| {});
    assert!(!report.passed);
    let text = report.to_string();
    assert!(
        report.kernels[0]
            .error
            .as_ref()
            .unwrap()
            .contains("index 7 of 3"),
        "{text}"
    );
    let affine = &report.kernels[1];
    assert!(
        matches!(outcome(affine, Path::Wgsl), Outcome::Error { message } if message.contains("affine"))
    );
    assert!(matches!(
        outcome(affine, Path::SpirvPassthrough),
        Outcome::Unavailable { .. }
    ));
    assert!(text.contains("there is no snapshot"), "{text}");
}

#[test]
fn absurd_inputs_of_a_kernel_with_a_tolerance_must_still_give_finite_results() {
    let run = |wgsl: &str| {
        let mut sample = affine();
        sample.kernel.tolerance.absolute = 1.0;
        sample.wgsl = sample.wgsl.replace("/ p.y;", wgsl);
        let report = compare(&[sample], inputs::SEED);
        outcome(&report.kernels[0], Path::Wgsl).clone()
    };
    assert_eq!(run("/ p.y;"), Outcome::Passed);
    // Overflows where the reference does not, for absurd numbers alone.
    assert_eq!(
        run("/ p.y * (1.0 + p.x * 0.0) + p.x * p.x * 1e-30;"),
        Outcome::Failed
    );
}

#[test]
fn the_driver_does_not_reorder_what_naga_wrote() {
    let mut sample = affine();
    // lavapipe would factor the sum out of these products.
    let sums = "p.x * settings.scale + p.y * settings.scale + p.x * 0.3";
    sample.wgsl = sample
        .wgsl
        .replace("(p.x * settings.scale + settings.offset) / p.y", sums);
    sample.spirv = spirv(&sample.wgsl);
    sample.native = |call| {
        let [Arg::Bytes(s), Arg::Bytes(pairs), Arg::BytesMut(out)] = &mut call.args[..] else {
            return Err(CallError::Count {
                expected: 3,
                got: call.args.len(),
            });
        };
        let (s, pairs): (&[f32], &[f32]) = (bytemuck::cast_slice(s), bytemuck::cast_slice(pairs));
        for (o, p) in bytemuck::cast_slice_mut::<u8, f32>(out)
            .iter_mut()
            .zip(pairs.chunks(2))
        {
            *o = p[0] * s[0] + p[1] * s[0] + p[0] * 0.3;
        }
        Ok(())
    };
    let report = compare(&[sample], inputs::SEED);
    assert_eq!(
        *outcome(&report.kernels[0], Path::SpirvThroughNaga),
        Outcome::Passed,
        "{report}"
    );
    assert_eq!(
        *outcome(&report.kernels[0], Path::Wgsl),
        Outcome::Passed,
        "{report}"
    );
}
