//! Every family through every kernel, and faults that are planted to be found.

use hankel_dsl::native::describe::Kernel;
use hankel_moments::{Bounds, MAX_MOMENTS, Moments6, hamburger_6, hamburger_6_compensated};
use hankel_numerics::accuracy::{singularities, table_1};
use hankel_numerics::families::{FAMILIES, Family, ORDERS, Precision, Row, scaled, validity};
use hankel_numerics::numbers::DoubleDouble;
use hankel_numerics::stress::shadows::{self, Form};
use hankel_numerics::stress::{
    Backend, BackendError, Cell, Native, Options, Solver, Stress, StressError,
    gradient_by_differences, gradient_of, judgement, run,
};

fn options(families: &[&str], samples: u64) -> Options {
    let names: Vec<String> = families.iter().map(|f| (*f).to_owned()).collect();
    Options {
        families: Options::families_named(&names).unwrap(),
        samples,
        derivative_rows: 0,
        wide_checks: 2,
        programme_checks: 1,
        ..Options::default()
    }
}

fn native(options: &Options) -> Stress {
    run(
        options,
        &mut [&mut Native::scalar(), &mut Native::lanes()],
        &mut |_| (),
    )
    .unwrap()
}

#[test]
fn no_family_makes_a_kernel_fail() {
    let stress = native(&options(&[], 200));
    let mut seen = 0;
    for c in stress.cells.iter().filter(|c| c.solver.is_kernel()) {
        let key = (&c.family, c.n, c.precision, c.solver, &c.backend);
        assert_eq!(
            (c.non_finite, c.out_of_range, c.other_bits.unwrap_or(0)),
            (0, 0, 0),
            "{key:?}"
        );
        assert_eq!(c.undecided, 0, "{key:?}");
        seen += usize::from(c.backend == "native" && c.solver == Solver::Plain);
    }
    assert!(stress.passed());
    let expected: usize = FAMILIES
        .iter()
        .map(|f| 2 * ORDERS.filter(|n| f.has(*n)).count())
        .sum();
    assert_eq!(seen, expected);
    for (family, agreement) in &stress.agreement {
        // The reference itself is confirmed.
        assert_eq!(agreement.wide_beyond, 0, "{family}");
        if !matches!(family.as_str(), "not-finite" | "all-equal" | "one-texel") {
            assert!(agreement.wide_rows > 0, "{family}");
        }
    }
    let report = stress.report("hankel stress").to_string();
    assert!(report.contains("silhouettes"), "{report}");
}

#[test]
fn errors_of_easy_rows_are_rounding_errors() {
    let stress = native(&options(&["paper", "generic-symmetric"], 500));
    let kernels = stress.cells.iter().filter(|c| c.solver.is_kernel());
    for c in kernels.filter(|c| c.n <= 2) {
        let epsilon = match c.precision {
            Precision::F32 => f64::from(f32::EPSILON),
            Precision::F64 => f64::EPSILON,
        };
        let error = c.error.unwrap();
        assert!(error.median < epsilon, "{c:?}");
        assert!(error.median <= error.ninety && error.ninety <= error.ninety_nine);
        assert!(error.ninety_nine <= error.greatest);
    }
}

#[test]
fn compensated_bounds_are_as_exact_as_their_inputs() {
    let stress = native(&options(&[], 1000));
    let mut cells = 0;
    let mut beyond = Vec::new();
    for c in &stress.cells {
        let Some(over) = c.over.filter(|_| c.solver == Solver::Compensated) else {
            continue;
        };
        let key = (&c.family, c.n, c.precision, &c.backend, c.worst);
        // Not promised: totals of this family are subnormal.
        if c.family == "denormal" {
            continue;
        }
        if over.greatest > 4.0 {
            beyond.push(format!("{key:?}: {over:?}"));
        }
        cells += 1;
    }
    assert!(beyond.is_empty(), "{}", beyond.join("\n"));
    // By family, n, format and backend.
    assert!(cells > 300, "{cells}");
}

/// The rows that rounding leaves least of: their sensitivities need derivatives above 1e25.
#[test]
fn compensated_bounds_within_a_tight_surface_are_as_exact_as_their_inputs() {
    let mut options = options(&["self"], 10_000);
    options.orders = vec![6];
    options.precisions = vec![Precision::F64];
    let stress = run(&options, &mut [&mut Native::scalar()], &mut |_| ()).unwrap();
    let compensated = |c: &&Cell| c.solver == Solver::Compensated;
    let cell = stress.cells.iter().find(compensated).unwrap();
    assert!(cell.valid > 400, "{cell:?}");
    assert!(cell.over.unwrap().greatest <= 4.0, "{cell:?}");
}

#[test]
fn derivatives_are_measured_by_what_rounding_does_to_them() {
    let stress = native(&Options {
        derivative_rows: 100,
        orders: vec![1, 2, 3],
        ..options(&["paper", "generic-unit", "silhouettes-biased"], 100)
    });
    let plain: Vec<_> = stress
        .derivatives
        .iter()
        .filter(|d| d.solver == Solver::Plain)
        .collect();
    // By family, n from 1 to 3, and format.
    assert_eq!(plain.len(), 18);
    for d in &plain {
        let over = d.over.unwrap();
        assert_eq!((d.non_finite, d.valid), (0, 100), "{d:?}");
        // Half of the rows have no derivative that is worse than a few roundings.
        assert!(over.median < 4.0, "{d:?}");
    }
    // What digits are lost without compensation is seen.
    assert!(stress.report("x").table("derivatives-over-plain").is_some());
    let greatest = |n: usize| {
        let of_order = plain.iter().filter(|d| d.n == n);
        of_order
            .filter_map(|d| d.over)
            .map(|o| o.greatest)
            .fold(0.0, f64::max)
    };
    assert!(greatest(3) > 1000.0, "{}", greatest(3));
}

#[test]
fn derivatives_that_are_no_number_are_found() {
    let options = Options {
        derivative_rows: 50,
        orders: vec![2],
        precisions: vec![Precision::F32],
        ..options(&["paper"], 50)
    };
    let mut faulty = Faulty {
        inner: Native::scalar(),
        fault: |kernel: &Kernel, x: &mut [f32]| {
            if kernel.function == "moment_bound_adjoint_n2" {
                x[7] = f32::NAN;
            }
        },
    };
    let stress = run(&options, &mut [&mut faulty], &mut |_| ()).unwrap();
    let [found, compensated] = &stress.derivatives[..] else {
        panic!("one order, two solvers")
    };
    assert_eq!((found.non_finite, compensated.non_finite), (1, 0));
    assert_eq!(found.over.unwrap().greatest, f64::INFINITY);
    assert!(!stress.passed());
}

#[test]
fn compensated_derivatives_are_as_exact_as_their_inputs() {
    let stress = native(&Options {
        derivative_rows: 100,
        ..options(&[], 100)
    });
    let mut cells = 0;
    let mut beyond = Vec::new();
    let mut plain = 0.0_f64;
    // Not promised: totals of this family are subnormal.
    for d in stress.derivatives.iter().filter(|d| d.family != "denormal") {
        let Some(over) = d.over else {
            continue;
        };
        assert_eq!(d.non_finite, 0, "{d:?}");
        if d.solver == Solver::Plain {
            plain = plain.max(over.ninety);
            continue;
        }
        cells += 1;
        if over.greatest > 4.0 {
            beyond.push(format!("{d:?}"));
        }
    }
    assert!(beyond.is_empty(), "{}", beyond.join("\n"));
    // By family, n and format; without compensation, one in ten rows of some family is far beyond that.
    assert!(cells > 200 && plain > 100.0, "{cells} {plain}");
}

#[test]
fn compensated_six_moment_shadows_are_as_exact_as_their_inputs() {
    let mut rows = 0;
    let mut plain = 0.0_f64;
    for family in FAMILIES.iter().filter(|f| f.has(3)) {
        for index in 0..400 {
            let row = family.row::<f32>(3, 2, index);
            let in_range = row.m.iter().all(|m| m.abs() <= 1.0) && row.eta.abs() <= 2.0;
            let Some(truth) = judgement(3, &row)
                .truth
                .filter(|_| in_range && row.m[0] == 1.0)
            else {
                continue;
            };
            let [_, b1, b2, b3, b4, b5, b6, ..] = row.m;
            let moments = Moments6 {
                b1,
                b2,
                b3,
                b4,
                b5,
                b6,
            };
            let over = |b: Bounds<f32>| truth.over_sensitivity([b.lower, b.upper].map(f64::from));
            let compensated = over(hamburger_6_compensated(moments, row.eta));
            assert!(compensated <= 4.0, "{family}, row {index}: {compensated}");
            plain = plain.max(over(hamburger_6(moments, row.eta)));
            rows += 1;
        }
    }
    assert!(rows > 1000 && plain > 10.0, "{rows} {plain}");
}

/// Trigonometric moments, and the Hausdorff problem.
#[test]
fn compensated_shadows_of_four_numbers_are_as_exact_as_their_inputs() {
    let options = shadows::Options {
        samples: 200,
        ..shadows::Options::default()
    };
    let found = shadows::measure(&options, &mut |_| ()).unwrap();
    assert!(found.passed());
    let mut valid = 0;
    for line in &found.lines {
        let Some(over) = line.over.filter(|_| line.form == Form::Compensated) else {
            continue;
        };
        assert!(over.greatest <= 4.0, "{line:?}");
        valid += line.valid;
    }
    assert!(valid > 10_000, "{valid}");
    // Without compensation, some rows are far beyond that.
    for bound in shadows::BOUNDS {
        let plain = found.greatest(bound, Form::Plain);
        assert!(plain > 100.0, "{bound:?}: {plain}");
    }
}

#[test]
fn compensation_gains_ten_times_where_digits_cancel() {
    let mut options = options(&["silhouettes", "self"], 1000);
    options.orders = vec![2, 3];
    options.precisions = vec![Precision::F32];
    let stress = native(&options);
    for plain in &stress.cells {
        if (plain.solver, plain.backend.as_str()) != (Solver::Plain, "native") {
            continue;
        }
        let same = |c: &&Cell| {
            c.solver == Solver::Compensated && (&c.family, c.n) == (&plain.family, plain.n)
        };
        let compensated = stress.cells.iter().find(same).unwrap();
        let (a, b) = (plain.error.unwrap(), compensated.error.unwrap());
        assert!(b.ninety * 10.0 <= a.ninety, "{plain:?} {compensated:?}");
    }
}

/// What is done to the results of a backend.
struct Faulty<F> {
    inner: Native,
    fault: F,
}

impl<F: FnMut(&Kernel, &mut [f32])> Backend for Faulty<F> {
    fn name(&self) -> String {
        self.inner.name()
    }

    fn run(
        &mut self,
        kernel: &Kernel,
        uniform: &[u8],
        elements: &[u8],
        output: usize,
    ) -> Result<Vec<u8>, BackendError> {
        let written = self.inner.run(kernel, uniform, elements, output)?;
        let mut numbers: Vec<f32> = written
            .as_chunks()
            .0
            .iter()
            .map(|b| f32::from_ne_bytes(*b))
            .collect();
        (self.fault)(kernel, &mut numbers);
        Ok(numbers.iter().flat_map(|x| x.to_ne_bytes()).collect())
    }
}

/// The plain solver's cell in `f32` for n = 2 with a fault.
fn with(fault: impl FnMut(&Kernel, &mut [f32])) -> (Cell, bool) {
    let mut options = options(&["generic-symmetric"], 100);
    options.orders = vec![2];
    options.precisions = vec![Precision::F32];
    let mut faulty = Faulty {
        inner: Native::scalar(),
        fault,
    };
    let stress = run(&options, &mut [&mut faulty], &mut |_| ()).unwrap();
    let plain = |c: &&Cell| c.solver == Solver::Plain;
    let cell = stress.cells.iter().find(plain).unwrap().clone();
    (cell, stress.passed())
}

#[test]
fn planted_faults_are_found() {
    let (sound, passed) = with(|_, _| ());
    assert!(passed);
    assert_eq!((sound.non_finite, sound.out_of_range), (0, 0));

    let (cell, passed) = with(|_, x| x[3] = f32::NAN);
    assert_eq!((cell.non_finite, cell.out_of_range), (1, 0));
    assert!(!passed);
    assert_eq!(cell.error.unwrap().greatest, 1.0);
    assert_eq!(cell.worst, Some(3));

    let (cell, passed) = with(|_, x| x[5] = f32::INFINITY);
    assert_eq!((cell.non_finite, passed), (1, false));

    // The smallest step outside of the range.
    let (cell, passed) = with(|_, x| x[7] = 1.0_f32.next_up());
    assert_eq!((cell.non_finite, cell.out_of_range), (0, 1));
    assert!(!passed);
    let (cell, passed) = with(|_, x| x[7] = -f32::from_bits(1));
    assert_eq!((cell.out_of_range, passed), (1, false));

    // Both bounds off by a thousandth: in range mostly, but wrong.
    let (cell, _) = with(|_, x| x.iter_mut().for_each(|x| *x = (*x + 1e-3).min(1.0)));
    let error = cell.error.unwrap();
    assert!((error.median - 1e-3).abs() < 1e-5, "{error:?}");
}

#[test]
fn other_bits_on_lanes_are_found() {
    let mut options = options(&["generic-symmetric"], 100);
    options.orders = vec![1];
    options.precisions = vec![Precision::F32];
    let mut lanes = Faulty {
        inner: Native::lanes(),
        fault: |_: &Kernel, x: &mut [f32]| x[9] = x[9].next_up().min(1.0),
    };
    let mut scalar = Native::scalar();
    let stress = run(&options, &mut [&mut scalar, &mut lanes], &mut |_| ()).unwrap();
    let cell = stress.cells.iter().find(|c| c.backend == "lanes").unwrap();
    assert_eq!(cell.other_bits, Some(1));
    assert!(!stress.passed());
}

/// Runs nothing.
struct Unable(BackendError);

impl Backend for Unable {
    fn name(&self) -> String {
        "nowhere".into()
    }

    fn run(&mut self, _: &Kernel, _: &[u8], _: &[u8], _: usize) -> Result<Vec<u8>, BackendError> {
        Err(self.0.clone())
    }
}

#[test]
fn what_a_backend_lacks_is_noted_and_what_fails_is_an_error() {
    let mut options = options(&["one-texel"], 16);
    options.orders = vec![1];
    let mut lacks = Unable(BackendError::Lacks("no such numbers".into()));
    let mut scalar = Native::scalar();
    let stress = run(&options, &mut [&mut scalar, &mut lacks], &mut |_| ()).unwrap();
    assert!(stress.notes.iter().any(|n| n.contains("no such numbers")));
    let mut kernels = stress.cells.iter().filter(|c| c.solver.is_kernel());
    assert!(kernels.all(|c| c.backend == "native"));

    let mut fails = Unable(BackendError::Failed("gone".into()));
    let error = run(&options, &mut [&mut fails], &mut |_| ()).unwrap_err();
    assert!(error.to_string().contains("on nowhere: gone"), "{error}");
}

#[test]
fn options_out_of_range_are_refused() {
    let error = Options::families_named(&["nosuch".into()]).unwrap_err();
    assert!(error.to_string().contains("silhouettes-biased"), "{error}");
    let refuse = |options: &Options| run(options, &mut [], &mut |_| ()).unwrap_err();
    let mut wrong = options(&["paper"], 100);
    wrong.orders = vec![7];
    assert!(matches!(refuse(&wrong), StressError::Order(7)));
    let few = options(&["paper"], 3);
    assert!(matches!(refuse(&few), StressError::Samples(3)));
}

#[test]
fn rows_are_the_same_every_time_and_in_both_precisions() {
    for family in FAMILIES {
        for n in ORDERS.filter(|n| family.has(*n)) {
            for index in 0..20 {
                let row: Row<f64> = family.row(n, 1, index);
                let again: Row<f64> = family.row(n, 1, index);
                let bits = |r: &Row<f64>| r.columns(n).map(f64::to_bits).collect::<Vec<_>>();
                assert_eq!(bits(&row), bits(&again), "{family}");
                assert_ne!(bits(&row), bits(&family.row(n, 2, index)), "{family}");
                assert!(row.m[2 * n + 1..].iter().all(|m| *m == 0.0), "{family}");
            }
        }
    }
    for name in ["paper", "silhouettes", "self-biased", "generic-mass"] {
        let family = Family::named(name).unwrap();
        for index in 0..100 {
            let double: Row<f64> = family.row(3, 1, index);
            let single: Row<f32> = family.row(3, 1, index);
            assert_eq!(double.map(|x| x as f32), single, "{name}");
        }
    }
}

#[test]
fn families_are_what_they_say() {
    let share = |name: &str, n: usize| {
        let family = Family::named(name).unwrap();
        let valid = (0..500).filter(|&index| {
            let row: Row<f64> = family.row(n, 1, index);
            scaled(&row).is_some_and(|(row, _)| validity(n, &row).is_definite())
        });
        valid.count()
    };
    for n in ORDERS {
        assert_eq!(share("paper", n), 500);
        assert_eq!(share("not-finite", n), 0);
        assert_eq!(share("silhouettes-biased", n), 500);
        assert_eq!(share("degenerate-biased", n), 500);
        // Rounding alone decides about degenerate rows.
        assert!(share("degenerate", n) < 400);
        assert!(share("impossible", n) < 200);
    }
    let mass =
        |name: &str, index: u64| -> Row<f32> { Family::named(name).unwrap().row(2, 1, index) };
    for index in 0..100 {
        assert_eq!(mass("mass-1e30", index).m[0], 1e30);
        assert_eq!(mass("mass-1e-30", index).m[0], 1e-30);
        assert!(mass("denormal", index).m[0] < f32::MIN_POSITIVE);
        let row = mass("not-finite", index);
        assert!(row.columns(2).any(|x| !x.is_finite()));
        let spread = mass("self", index);
        let variance = spread.m[2] - spread.m[1] * spread.m[1];
        assert!(variance < 3e-2 * 3e-2, "{spread:?}");
        assert!(f64::from(spread.eta - spread.m[1]).abs() <= 3e-2);
        // One texel: each moment is the one before times the depth.
        let one = Family::named("one-texel").unwrap().row::<f64>(2, 1, index);
        let z = one.m[1];
        assert!((one.m[4] - z.powi(4)).abs() <= 4.0 * f64::EPSILON);
    }
}

#[test]
fn nothing_is_undefined_at_singularities() {
    let options = singularities::Options {
        samples: 40,
        ..singularities::Options::default()
    };
    let found = singularities::measure(&options, &mut |_| ()).unwrap();
    assert!(found.passed());
    assert_eq!(found.lines.len(), 12);
    for line in &found.lines {
        assert!(line.queries >= line.n as u64 * 17 * 30, "{line:?}");
        // The bound is continuous there, and as exact as anywhere.
        if line.precision == Precision::F64 {
            assert!(line.bound.error.ninety_nine < 1e-9, "{line:?}");
            assert!(line.bound.limit.ninety < 1e-4, "{line:?}");
        }
    }
    let mut broken = found;
    broken.lines[0].non_finite_gradients = 1;
    assert!(!broken.passed());
}

#[test]
fn reproduction_and_derivatives_are_as_the_paper_has_them() {
    let options = table_1::Options {
        samples: 4000,
        ..table_1::Options::default()
    };
    let table = table_1::measure(&options, &mut |_| ()).unwrap();
    assert_eq!(table.lines.len(), 12);
    for line in &table.lines {
        assert_eq!(line.non_finite, 0);
        assert!(line.rows + line.near + line.singular == 4000);
        assert!(line.rows > 3000, "{line:?}");
        // Nothing is published for n = 6.
        let Some(published) = table_1::PUBLISHED.get(line.n - 1) else {
            continue;
        };
        let reproduction = match line.precision {
            Precision::F32 => published.reproduction_f32,
            Precision::F64 => Some(published.reproduction_f64),
        };
        if let Some(published) = reproduction {
            assert!(line.reproduction <= published, "{line:?}");
        }
        if line.precision == Precision::F64 {
            assert!(line.d_moments <= published.d_moments, "{line:?}");
            assert!(line.d_eta <= published.d_eta, "{line:?}");
        }
    }
    for (n, rows, difference) in table.reference {
        assert!(rows > 0 && difference < 1e-9, "n = {n}: {difference:e}");
    }
    let report = table_1::measure(&options, &mut |_| ()).unwrap().report("x");
    assert!(report.table("table-1").is_some());
}

#[test]
fn the_reference_is_what_it_is_called() {
    // A bound in double-double is far more exact than f64: both ends of a known distribution.
    let third = DoubleDouble::from(1.0) / DoubleDouble::from(3.0);
    let mut m = [DoubleDouble::from(0.0); MAX_MOMENTS];
    for (j, m) in m.iter_mut().enumerate().take(5) {
        // Equal weights at -1, 0 and 1.
        *m = match j {
            0 => DoubleDouble::from(1.0),
            j if j % 2 == 0 => third + third,
            _ => DoubleDouble::from(0.0),
        };
    }
    let bounds = hankel_numerics::stress::bounds_of(2, m, DoubleDouble::from(0.0));
    let lower = f64::from(bounds.lower - third).abs();
    let upper = f64::from(bounds.upper - third - third).abs();
    assert!(lower < 1e-28 && upper < 1e-28, "{lower:e} {upper:e}");
}

#[test]
fn derivatives_agree_by_two_roads() {
    let family = Family::named("paper").unwrap();
    for n in ORDERS {
        for index in 0..20 {
            let row: Row<f64> = family.row(n, 7, index);
            let m = row.m.map(DoubleDouble::from);
            let eta = DoubleDouble::from(row.eta);
            let adjoint = gradient_of(n, m, eta, DoubleDouble::from(0.0));
            let differences = gradient_by_differences(n, m, eta);
            for k in 0..=2 * n {
                let (a, b) = (f64::from(adjoint.m[k]), differences.m[k]);
                assert!(
                    (a - b).abs() <= 1e-12 * b.abs().max(1.0),
                    "n = {n}: {a} {b}"
                );
            }
            let (a, b) = (f64::from(adjoint.eta), differences.eta);
            assert!(
                (a - b).abs() <= 1e-12 * b.abs().max(1.0),
                "n = {n}: {a} {b}"
            );
        }
    }
}

#[test]
fn errors_are_shares_of_the_total_at_any_scale() {
    // One point at 0 and one at 1, a little blurred: at 1/2, half is below.
    for mass in [1.0, 1e-30, 1e30, 2.0_f64.powi(-1060)] {
        let mut row = Row {
            eta: 0.5,
            ..Row::<f64>::default()
        };
        row.m[..3].copy_from_slice(&[mass, 0.5 * mass, 0.75 * mass]);
        let judged = judgement(1, &row);
        let truth = judged.truth.unwrap();
        let exact = truth.shares.map(f64::from);
        assert!((truth.error([exact[0] * mass, exact[1] * mass])) < 1e-3);
        let off = truth.error([(exact[0] + 0.25) * mass, exact[1] * mass]);
        assert!((off - 0.25).abs() < 1e-3, "{mass}: {off}");
        assert_eq!(truth.error([f64::NAN, 0.0]), 1.0);
        let over = truth.over_sensitivity([f64::NAN, exact[1] * mass]);
        assert_eq!(over, 1.0 / truth.sensitivities[0]);
    }
}
