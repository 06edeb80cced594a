//! Comparison of devices: kernels that agree pass, and one that was tampered with is caught, on the
//! right way to the driver.

mod common;

use common::*;
use hankel_dsl::native::describe::{Domain, Kernel, Length, Role, Rounding, Scalar};
use hankel_dsl::native::inputs::{Given, Request};
use hankel_dsl::native::{Arg, CallError, Mode};
use hankel_host::crates::KernelEntry;
use hankel_host::device::{NativeDevice, Shader};
use hankel_host::inputs::{self, Class};
use hankel_host::parity::execute;
use hankel_host::parity::numbers::{Found, Numbers, Rules};
use hankel_host::parity::panics;

/// How a sample is run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Path {
    Lanes,
    Spirv,
    SpirvNaga,
    Wgsl,
}

const PATHS: [Path; 4] = [Path::Lanes, Path::Spirv, Path::SpirvNaga, Path::Wgsl];

/// What a comparison with the native scalar run finds.
fn found(sample: &Sample, path: Path, seed: u64) -> Result<Found, String> {
    let entry = sample.entry();
    let kernel = &entry.kernel;
    let shader = match path {
        Path::Lanes => None,
        Path::Spirv => Some(Shader::SpirvPassthrough(&sample.spirv)),
        Path::SpirvNaga => Some(Shader::SpirvThroughNaga(&sample.spirv)),
        Path::Wgsl => Some(Shader::Wgsl {
            text: &sample.wgsl,
            entry_point: &kernel.name,
        }),
    };
    let program = entry.program(shader, &[]);
    let mut scalar = NativeDevice::with_mode(Mode::REFERENCE);
    let mut lanes = NativeDevice::new();
    let mut gpu = vulkan();
    let floats = gpu.floats().map_err(|e| e.to_string())?;
    let numbers = Numbers::of(kernel);
    let rules = Rules::of(kernel, kernel.tolerance.clone());
    let mut found = Found::default();
    for case in inputs::cases(kernel, seed).unwrap() {
        let reference =
            execute::dispatch(&mut scalar, &program, &case).map_err(|e| e.to_string())?;
        let written = if path == Path::Lanes {
            execute::dispatch(&mut lanes, &program, &case).map_err(|e| e.to_string())?
        } else {
            execute::on_vulkan(&mut gpu, &program, &case, &floats).map_err(|e| e.to_string())?
        };
        numbers.compare(&case, &rules, None, &reference, &written, &mut found);
    }
    Ok(found)
}

/// Whether a way passes.
fn passes(sample: &Sample, path: Path) -> bool {
    found(sample, path, inputs::SEED)
        .unwrap_or_else(|e| panic!("{path:?}: {e}"))
        .beyond
        == 0
}

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

#[test]
fn every_stage_agrees_on_every_path() {
    for sample in all_samples() {
        let name = &sample.kernel.name;
        for path in PATHS {
            let found =
                found(&sample, path, inputs::SEED).unwrap_or_else(|e| panic!("{name}: {e}"));
            assert_eq!(
                (found.beyond, found.largest_ulp),
                (0, 0),
                "{name}: {found:?}"
            );
            let few = ["histogram", "sums"].contains(&name.as_str());
            assert!(found.values >= 1000 || few, "{name}: {found:?}");
        }
    }
}

#[test]
fn the_same_seed_makes_the_same_inputs_and_another_others() {
    let kernel = &affine().kernel;
    assert_eq!(
        inputs::cases(kernel, 5).unwrap(),
        inputs::cases(kernel, 5).unwrap()
    );
    assert_ne!(
        inputs::cases(kernel, 5).unwrap(),
        inputs::cases(kernel, 6).unwrap()
    );
}

#[test]
fn hostile_inputs_are_absurd_but_finite() {
    for sample in all_samples() {
        for case in inputs::cases(&sample.kernel, 11).unwrap() {
            assert!(
                inputs::is_finite(&sample.kernel, &case),
                "{}",
                sample.kernel.name
            );
        }
    }
    let largest = |class: Class| {
        inputs::cases(&affine().kernel, 11)
            .unwrap()
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
    let caught = PATHS.map(|path| !passes(&sample, path));
    assert_eq!(caught, [false, true, true, false]);
    let found = found(&sample, Path::Spirv, inputs::SEED).unwrap();
    assert!(found.beyond > 100, "{found:?}");
    let first = found.first.unwrap();
    assert!(first.value.starts_with("output[1]."), "{first:?}");
    assert!((1..=2).contains(&first.ulp), "{first:?}");
    for name in ["colour.x", "shift"] {
        assert!(
            first.inputs.iter().any(|(n, _)| n.starts_with(name)),
            "{first:?}"
        );
    }
}

#[test]
fn a_changed_expression_in_the_wgsl_is_caught_there() {
    let mut sample = affine();
    sample.wgsl = sample
        .wgsl
        .replace("settings.offset)", "settings.offset * 1.0000002)");
    assert!(passes(&sample, Path::Spirv));
    assert!(!passes(&sample, Path::Wgsl));
}

#[test]
fn a_tolerance_allows_what_it_says_and_no_more() {
    let with = |ulp, absolute| {
        let mut sample = place();
        let two = 2.0f32;
        sample.spirv = tampered(&sample.spirv, two.to_bits(), two.next_up().to_bits());
        sample.kernel.tolerance.ulp = ulp;
        sample.kernel.tolerance.absolute = absolute;
        PATHS.iter().all(|path| passes(&sample, *path))
    };
    assert!(with(2, 0.0));
    assert!(with(0, 1e-6));
    assert!(!with(1, 0.0));
    assert!(!with(0, 1e-12));
}

#[test]
fn what_does_not_run_says_why() {
    let mut sample = affine();
    sample.wgsl = sample.wgsl.replace("let p", "lett p");
    let error = found(&sample, Path::Wgsl, 1).unwrap_err();
    assert!(error.contains("affine"), "{error}");
}

/// A kernel that panics, as one that divides by an integer does, is caught with the input.
#[test]
fn a_panic_names_its_input() {
    let mut sample = mixed();
    sample.native = |call| {
        let Arg::Bytes(rows) = &call.args[1] else {
            return Err(CallError::Count {
                expected: 3,
                got: call.args.len(),
            });
        };
        let zero = rows.chunks(16).any(|r| r[12..16] == [0; 4]);
        if zero {
            let message = "attempt to divide by zero".into();
            return Err(CallError::Panic { message });
        }
        Ok(())
    };
    let entry = sample.entry();
    let program = entry.program(None, &[]);
    let mut native = NativeDevice::with_mode(Mode::REFERENCE);
    let mut fails = |case: &inputs::Case| execute::dispatch(&mut native, &program, case).is_err();
    let cases = inputs::cases(&sample.kernel, 1).unwrap();
    let case = cases.iter().find(|case| fails(case));
    let case = case.expect("an i32 takes the value 0 somewhere in the inputs");
    let words = panics::culprit(&sample.kernel, case, fails).unwrap();
    assert!(words.contains("row.m = 0"), "{words}");
}

#[test]
fn absurd_inputs_of_a_kernel_with_a_tolerance_must_still_give_finite_results() {
    let run = |wgsl: &str| {
        let mut sample = affine();
        sample.kernel.tolerance.absolute = 1.0;
        sample.wgsl = sample.wgsl.replace("/ p.y;", wgsl);
        passes(&sample, Path::Wgsl)
    };
    assert!(run("/ p.y;"));
    // Overflows where the reference does not, for absurd numbers alone.
    assert!(!run("/ p.y * (1.0 + p.x * 0.0) + p.x * p.x * 1e-30;"));
}

#[test]
fn the_driver_does_not_reorder_what_naga_wrote_of_a_pinned_kernel() {
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
    assert!(!passes(&sample, Path::Wgsl), "the driver reorders");
    sample.kernel.rounding = Rounding::Pinned;
    assert!(passes(&sample, Path::SpirvNaga));
    assert!(passes(&sample, Path::Wgsl));
}

fn said(sample: &mut Sample, name: &str, domain: Domain) {
    let param = sample.kernel.params.iter_mut().find(|p| p.name == name);
    param.unwrap().inputs.domain = Some(domain);
}

#[test]
fn attributes_decide_inputs_and_names_do_not() {
    let mut sample = affine();
    let range = Domain::Range {
        least: 40.0,
        most: 41.0,
    };
    said(&mut sample, "pair", range);
    for case in inputs::cases(&sample.kernel, 1).unwrap() {
        let inputs::Input::Bytes(bytes) = &case.args[1] else {
            panic!("a buffer is bytes");
        };
        let all: Vec<f32> = bytemuck::pod_collect_to_vec(bytes);
        let inside = all.iter().all(|x| (40.0..=41.0).contains(x));
        assert_eq!(inside, case.class != Class::Hostile, "{}", case.class);
    }
}

#[test]
fn the_authors_own_inputs_are_the_ordinary_ones() {
    let kernel: Kernel = affine().kernel;
    let name = kernel.params[1].name.clone();
    let own = |given: Vec<Given>| {
        let entry = KernelEntry::new(kernel.clone(), affine().native);
        let entry = entry.with_inputs(move |_: &Request| Ok(Some(given.clone())));
        inputs::of_entry(&entry, 1)
    };
    let pairs = [1.0f32, 2.0, 3.0, 4.0, 5.0, 6.0];
    let cases = own(vec![Given::new("three pairs").buffer(&name, &pairs)]).unwrap();
    let ordinary: Vec<_> = cases
        .iter()
        .filter(|c| c.class == Class::Ordinary)
        .collect();
    assert_eq!(ordinary.len(), 1);
    assert_eq!(ordinary[0].invocations, 3);
    assert_eq!(ordinary[0].called(), "ordinary inputs (three pairs)");
    let bytes = bytemuck::cast_slice(&pairs).to_vec();
    assert_eq!(ordinary[0].args[1], inputs::Input::Bytes(bytes));
    // The others are as without.
    assert!(
        cases
            .iter()
            .any(|c| c.class == Class::Hostile && c.invocations > 1000)
    );
    for (given, words) in [
        (
            Given::new("x").buffer("nosuch", &pairs),
            "no such parameter",
        ),
        (Given::new("x").buffer(&name, &[1.0f32]), "whole number"),
    ] {
        let error = own(vec![given]).unwrap_err().to_string();
        assert!(error.contains(words), "{error}");
    }
    assert!(own(Vec::new()).is_err());
}

#[test]
fn lengths_and_constants_are_what_their_attributes_say() {
    let mut kernel = affine().kernel;
    let pairs = kernel.params[1].name.clone();
    let Role::Element { layout, .. } = kernel.params[1].role.clone() else {
        panic!("the second parameter is read row by row");
    };
    kernel.params[1].inputs.length = Some(Length::Between { least: 5, most: 9 });
    let mut table = param("table", Role::Storage { binding: 7, layout });
    table.inputs.length = Some(Length::Of {
        param: pairs,
        times: 3,
        plus: 1,
    });
    kernel.params.push(table);
    let way = Role::Constant {
        id: 0,
        scalar: Scalar::U32,
        default: 2,
    };
    let mut way = param("way", way);
    way.inputs.domain = Some(Domain::Values {
        values: vec![0.0, 1.0, 2.0],
    });
    kernel.params.push(way);
    for case in inputs::cases(&kernel, 1).unwrap() {
        assert!((5..=9).contains(&case.invocations));
        let count = |i: usize| match &case.args[i] {
            inputs::Input::Bytes(bytes) => bytes.len() / 8,
            _ => 0,
        };
        assert_eq!(count(1), case.invocations);
        assert_eq!(count(2), 3 * case.invocations + 1);
    }
    // The default comes first.
    assert_eq!(inputs::constants(&kernel), [[2], [0], [1]]);
    kernel.params[3].inputs.length = Some(Length::Of {
        param: "tabel".into(),
        times: 1,
        plus: 0,
    });
    let error = inputs::cases(&kernel, 1).unwrap_err().to_string();
    assert!(error.contains("`tabel`"), "{error}");
}
