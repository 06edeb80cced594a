//! The identical kernel on every backend that a Vulkan driver alone is enough for: scalar and lanes
//! natively, SPIR-V untouched and through naga, and WGSL. Without a driver these tests fail and say
//! how to get one.
//!
//! The matrix has these columns, too: `hankel parity --matrix` for the built-in kernels, the test `matrix` for
//! the kernels of conformance. Here both run with another seed, which must make no difference.

use std::path::PathBuf;
use std::time::Duration;

use hankel_codegen::Language;
use hankel_dsl::native::describe::{Output, Rounding, TexelFormat, Tolerance};
use hankel_dsl::native::texel::FORMATS;
use hankel_dsl::native::{Call, Mode};
use hankel_host::crates::KernelEntry;
use hankel_host::device::{Floats, NativeDevice, Shader, VulkanDevice};
use hankel_host::inputs;
use hankel_host::parity::execute;
use hankel_host::parity::numbers::{Found, Numbers, Rules};
use hankel_matrix::column::Column;
use hankel_matrix::known::Known;
use hankel_matrix::report::{Outcome, Report};
use hankel_matrix::run::{self, Request};
use hankel_matrix::subject::Subject;
use hankel_matrix::tools::Tools;
use hankel_tests::Crate;

/// Not the matrix's, which is 1.
const SEED: u64 = 20_261_121;

fn run_all(known: Known, subjects: &[Subject]) -> Report {
    let request = Request {
        columns: Column::PLAIN.into(),
        seed: SEED,
        limit: Duration::from_secs(120),
        tools: Tools::of_cache(None),
        runner: vec![PathBuf::from(env!("CARGO_BIN_EXE_hankel-tests-runner")).into()],
        cache: None,
        known,
        absent: None,
        whole: false,
        required: Column::PLAIN.into(),
    };
    run::run(&request, subjects, &|_| ()).unwrap_or_else(|e| panic!("{e}"))
}

fn subjects(one: &Crate) -> Vec<Subject> {
    let entries: Vec<KernelEntry> = one.entries.iter().cloned().map(KernelEntry::from).collect();
    Subject::with_constants(&one.generate(), &one.request(), &one.modules(), &entries)
        .unwrap_or_else(|e| panic!("{e}"))
}

#[test]
fn built_in_kernels_agree_everywhere() {
    let shadows = Crate::shadows();
    let report = run_all(Known::default(), &subjects(&shadows));
    println!("{report}");
    assert!(report.passed, "{report}");
    // All values of the constants are run.
    for how in ["", "[encoding=0]", "[encoding=1]"] {
        let name = format!("shade_hamburger{how}");
        let found = report.kernels.iter().any(|row| row.kernel == name);
        assert!(found, "{name}");
    }
    let exact = |name: &str| {
        let kernel = shadows.entries.iter().find(|e| e.kernel.name == name);
        kernel.is_some_and(|e| e.kernel.rounding == Rounding::Exact)
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
fn everything_that_a_kernel_can_do_agrees_everywhere() {
    let known = hankel_tests::root().join("snapshots/known-conformance-differences.toml");
    let known = Known::read(&known).unwrap_or_else(|e| panic!("{e}"));
    let report = run_all(known, &subjects(&Crate::conformance()));
    println!("{report}");
    assert!(report.passed, "{report}");
}

/// Kernels with quotients and roots, as maps, vertices, fragments and image passes.
const REWRITTEN: [&str; 8] = [
    "hamburger_4msm",
    "moment_bound_n3",
    "moment_bound_compensated_n2",
    "canonical_n4",
    "surface",
    "tint",
    "blur_r32float",
    "resolve_single_symmetric_6",
];

#[test]
fn what_is_rewritten_for_devices_of_other_arithmetic_gives_the_same_bits() {
    let mut device = VulkanDevice::new().unwrap_or_else(|e| panic!("{e}"));
    let own = device.floats().unwrap_or_else(|e| panic!("{e}"));
    // As a GPU's are that was measured.
    let floats = Floats {
        quotient: 2,
        root: 1,
        flushes: true,
        ..own
    };
    assert!(floats.has_f64, "{own}");
    for subject in subjects(&Crate::shadows()) {
        if !REWRITTEN.contains(&subject.name.as_str()) {
            continue;
        }
        let (name, kernel) = (&subject.name, &subject.entry.kernel);
        let code = subject.codes[&Language::Spirv].as_ref().unwrap();
        let (words, _) = code.bytes.as_chunks();
        let words: Vec<u32> = words.iter().map(|w| u32::from_le_bytes(*w)).collect();
        let rewritten = floats.as_ieee_754(&words).unwrap().unwrap();
        assert!(rewritten.len() > words.len(), "{name}");
        let program = subject
            .entry
            .program(Some(Shader::SpirvPassthrough(&words)), &[]);
        let numbers = Numbers::of(kernel);
        let rules = Rules::of(
            kernel,
            Tolerance {
                ulp: 0,
                absolute: 0.0,
                ..kernel.tolerance.clone()
            },
        );
        let mut found = Found::default();
        for case in inputs::of_entry(&subject.entry, SEED).unwrap() {
            let mut native = NativeDevice::with_mode(Mode::REFERENCE);
            let reference = execute::dispatch(&mut native, &program, &case).unwrap();
            let written = execute::on_vulkan(&mut device, &program, &case, &floats).unwrap();
            numbers.compare(&case, &rules, None, &reference, &written, &mut found);
        }
        assert!(found.values > 1000, "{name}: {found:?}");
        assert_eq!(found.beyond, 0, "{name}: {found:?}");
    }
}

/// Whether a fault that is put into the WGSL of a subject is found, and in no other column.
fn found_in_wgsl(mut subject: Subject, from: &str, to: &str) -> bool {
    let wgsl = subject.codes.get_mut(&Language::Wgsl);
    let code = wgsl.and_then(|c| c.as_mut().ok()).expect("it has WGSL");
    let text = String::from_utf8(std::mem::take(&mut code.bytes)).expect("a text is UTF-8");
    assert!(text.contains(from), "no `{from}` in\n{text}");
    code.bytes = text.replacen(from, to, 1).into_bytes();
    let report = run_all(Known::default(), &[subject]);
    for (column, cell) in &report.kernels[0].cells {
        assert!(
            !cell.outcome.fails() || (*column == Column::Wgsl && cell.outcome == Outcome::Differs),
            "{column}\n{report}"
        );
    }
    !report.passed
}

fn subject_of_shadows(name: &str) -> Subject {
    let all = subjects(&Crate::shadows());
    all.into_iter()
        .find(|s| s.name == name)
        .unwrap_or_else(|| panic!("there is no `{name}`"))
}

/// The same with inputs from attributes alone, as before kernels named functions that make them.
fn without_own_inputs(subject: &Subject) -> Subject {
    let own = subject.entry.clone();
    let run = move |call: &mut Call<'_>| own.run(call);
    Subject {
        entry: KernelEntry::new(subject.entry.kernel.clone(), run),
        ..subject.clone()
    }
}

/// A bound that is wrong for two tight surfaces: their moments are valid, and nearly degenerate.
/// Numbers at random do not come there.
#[test]
fn a_fault_in_a_bound_for_nearly_degenerate_moments_is_found() {
    let subject = subject_of_shadows("hamburger_4msm");
    let square = "let product = (difference_1 * difference_1);";
    let fault = "let product = (difference_1 * difference_1) * select(1f, 1.01f, 1.5e-14f < most_1 && most_1 < 1e-8f && 1e-3f < most);";
    assert!(!found_in_wgsl(without_own_inputs(&subject), square, fault));
    assert!(found_in_wgsl(subject, square, fault));
}

/// The same in a shading kernel: a map that a scene makes is full of such moments.
#[test]
fn a_fault_in_a_shading_kernel_for_the_moments_of_real_maps_is_found() {
    let subject = subject_of_shadows("shade_hamburger");
    let square = "let product_2 = (difference_6 * difference_6);";
    let fault = "let product_2 = (difference_6 * difference_6) * select(1f, 4f, 1.5e-14f < most_3 && most_3 < 1e-6f && 1e-3f < most_2);";
    assert!(!found_in_wgsl(without_own_inputs(&subject), square, fault));
    assert!(found_in_wgsl(subject, square, fault));
}

/// A fault in what only another value of a specialisation constant runs.
#[test]
fn a_fault_behind_a_specialisation_constant_is_found() {
    let fault = |name: &str| found_in_wgsl(subject_of_shadows(name), "0.7926987f", "0.7826987f");
    assert!(!fault("shade_hamburger"));
    assert!(fault("shade_hamburger[encoding=1]"));
}

/// Finite inputs that give infinities fail, where the kernel does not declare them.
#[test]
fn infinities_of_finite_inputs_fail_unless_they_are_declared() {
    let mut subject = subject_of_shadows("light_depth");
    assert!(subject.entry.kernel.tolerance.non_finite);
    let passed = |subject: &Subject| {
        let report = run_all(Known::default(), std::slice::from_ref(subject));
        let outcome = report.kernels[0].cells[&Column::Native].outcome.clone();
        (
            report.passed,
            matches!(outcome, Outcome::NotFinite { .. }),
            report.to_string(),
        )
    };
    assert!(passed(&subject).0);
    subject.entry.kernel.tolerance.non_finite = false;
    let (passed, not_finite, text) = passed(&subject);
    assert!(!passed && not_finite, "{text}");
    assert!(
        text.contains("INFINITE") && text.contains("position.x = "),
        "{text}"
    );
}

#[test]
fn every_texel_format_is_written_by_a_kernel() {
    let conformance = Crate::conformance();
    let has = |format: &TexelFormat| {
        conformance.entries.iter().any(|entry| {
            let outputs = &entry.kernel.outputs;
            outputs.iter().any(|output| match output {
                Output::Texture { format: of, .. } => of == format,
                _ => false,
            })
        })
    };
    let missing: Vec<_> = FORMATS.iter().filter(|format| !has(format)).collect();
    assert!(missing.is_empty(), "{missing:?}");
}
