//! The built-in kernels on the inputs that they are for, natively: these fit, lanes give the same
//! bits as the scalar run, and what is not finite is declared.

use hankel_dsl::native::Mode;
use hankel_host::crates::KernelEntry;
use hankel_host::device::NativeDevice;
use hankel_host::inputs::{self, Class, Input};
use hankel_host::parity::execute;
use hankel_host::parity::numbers::{Found, Numbers, Rules};

fn entries() -> Vec<KernelEntry> {
    let entries = hankel_shadows::entries().into_iter();
    entries.map(KernelEntry::from).collect()
}

#[test]
fn built_in_kernels_run_natively_on_their_own_inputs() {
    let mut problems = Vec::new();
    for entry in entries() {
        let kernel = &entry.kernel;
        let name = &kernel.name;
        let cases = inputs::of_entry(&entry, 1).unwrap_or_else(|e| panic!("{name}: {e}"));
        let program = entry.program(None, &[]);
        let numbers = Numbers::of(kernel);
        let mut exact = kernel.tolerance.clone();
        (exact.ulp, exact.absolute) = (0, 0.0);
        let rules = Rules::of(kernel, exact);
        let mut found = Found::default();
        for case in &cases {
            assert!(inputs::is_finite(kernel, case), "{name}: {}", case.called());
            let run = |mode| {
                execute::dispatch(&mut NativeDevice::with_mode(mode), &program, case)
                    .unwrap_or_else(|e| panic!("{name}, {}: {e}", case.called()))
            };
            let reference = run(Mode::REFERENCE);
            numbers.compare(
                case,
                &rules,
                None,
                &reference,
                &run(Mode::default()),
                &mut found,
            );
            let (count, first) = numbers.non_finite(case, &reference);
            if count > 0 && !kernel.tolerance.non_finite {
                problems.push(format!("{name}, {}: {count}, {first:?}", case.called()));
            }
        }
        assert_eq!(found.beyond, 0, "{name}: {found:?}");
    }
    assert!(problems.is_empty(), "not finite:\n{}", problems.join("\n"));
}

/// The smallest pivot of the Hankel matrix of moments 0 to 2 n, for a total of 1.
fn least_pivot(m: &[f64], n: usize) -> f64 {
    let mut a: Vec<Vec<f64>> = (0..=n)
        .map(|i| (0..=n).map(|j| m[i + j] / m[0]).collect())
        .collect();
    let mut least = f64::INFINITY;
    for k in 0..=n {
        least = least.min(a[k][k]);
        if a[k][k] < 1e-11 {
            return least;
        }
        let (pivots, below) = a.split_at_mut(k + 1);
        for row in below {
            let factor = row[k] / pivots[k][k];
            for (x, pivot) in row[k..].iter_mut().zip(&pivots[k][k..]) {
                *x -= factor * pivot;
            }
        }
    }
    least
}

/// Bounds of every order run on moments that distributions have: none of them is out of the cone,
/// and near its boundary are many. Numbers at random are hardly ever inside.
#[test]
fn bounds_run_on_moments_of_distributions() {
    for (n, name) in (1..=6).map(|n| (n, format!("moment_bound_n{n}_f64"))) {
        let all = entries();
        let entry = all.iter().find(|e| e.kernel.name == name);
        let entry = entry.unwrap_or_else(|| panic!("there is no `{name}`"));
        let pivots = |cases: &[inputs::Case]| -> Vec<f64> {
            let ordinary = cases.iter().filter(|c| c.class == Class::Ordinary);
            ordinary
                .flat_map(|case| {
                    let Input::Bytes(bytes) = &case.args[1] else {
                        panic!("rows are bytes");
                    };
                    let numbers: Vec<f64> = bytemuck::pod_collect_to_vec(bytes);
                    let rows = numbers.chunks(2 * n + 2);
                    rows.map(|row| least_pivot(row, n)).collect::<Vec<_>>()
                })
                .collect()
        };
        let own = pivots(&inputs::of_entry(entry, 1).unwrap());
        let share = |all: &[f64], f: &dyn Fn(f64) -> bool| {
            all.iter().filter(|p| f(**p)).count() as f64 / all.len() as f64
        };
        assert!(own.len() > 4000, "{name}");
        assert_eq!(share(&own, &|p| p < -1e-9), 0.0, "{name}");
        // The higher the order, the smaller the pivots of any distribution are.
        let (inside, degenerate) = (share(&own, &|p| p > 1e-9), share(&own, &|p| p < 1e-6));
        assert!(
            inside > 0.2 && degenerate > 0.1,
            "{name}: {inside}, {degenerate}"
        );
        let random = pivots(&inputs::cases(&entry.kernel, 1).unwrap());
        let random = share(&random, &|p| p > 1e-9);
        assert!(random < 0.5 * inside, "{name}: {random}");
    }
}

/// Shading reads maps of a scene, in the encoding that its specialisation constant says.
#[test]
fn shading_runs_on_maps_of_a_scene_in_every_encoding() {
    let mut maps = Vec::new();
    for mut entry in entries() {
        if entry.kernel.name != "shade_hamburger" {
            continue;
        }
        for values in inputs::constants(&entry.kernel) {
            inputs::set_constants(&mut entry.kernel, &values);
            let cases = inputs::of_entry(&entry, 1).unwrap();
            let called = cases[0].called();
            assert!(called.contains("bias"), "{called}");
            let texture = cases[0].args.iter().find_map(|a| match a {
                Input::Texture { bytes, .. } => Some(bytes.clone()),
                _ => None,
            });
            maps.push(texture.unwrap());
        }
    }
    assert_eq!(maps.len(), 3);
    assert!(maps[0] != maps[1] && maps[1] != maps[2] && maps[0] != maps[2]);
}
