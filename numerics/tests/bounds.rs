//! The bounds against what shares nothing with them: linear programmes, dual numbers, intervals.

use hankel_dsl::Real;
use hankel_moments::{
    MAX_MOMENTS, bias_target, bound, bound_adjoint, canonical, mix_bias, mix_bias_adjoint,
};
use hankel_numerics::families::{Family, Row, scaled, validity};
use hankel_numerics::judge::{DepthFunction, Judge, Range};
use hankel_numerics::numbers::{DoubleDouble, Dual, Interval, Unrounded, Wide};
use hankel_numerics::stress::bounds_of;

/// Rows of a family that some distribution has, moments and query.
fn rows(family: &str, n: usize, count: u64) -> Vec<Row<f64>> {
    let family = Family::named(family).unwrap();
    let rows: Vec<Row<f64>> = (0..count)
        .map(|index| family.row::<f64>(n, 5, index))
        .filter(|row| scaled(row).is_some_and(|(row, _)| validity(n, &row).is_definite()))
        .collect();
    assert!(2 * rows.len() as u64 > count, "{family}");
    rows
}

/// Calls a function of the order for each.
macro_rules! for_all_orders {
    ($function:ident) => {
        $function::<1>();
        $function::<2>();
        $function::<3>();
        $function::<4>();
        $function::<5>();
        $function::<6>();
    };
}

fn agrees_with_the_programme<const N: usize>() {
    let judge = Judge::new(&DepthFunction::powers(2 * N).unwrap(), Range::Line).unwrap();
    let (mut resolved, mut all) = (0, 0);
    for family in [
        "paper",
        "paper-fewest",
        "generic-symmetric",
        "generic-unit",
        "ends",
    ] {
        for row in rows(family, N, 12) {
            let exact = bounds_of(N, row.m.map(DoubleDouble::from), row.eta.into());
            let judged = judge.bounds(&row.m[..=2 * N], row.eta).unwrap();
            for (judged_bound, exact) in [(judged.lower, exact.lower), (judged.upper, exact.upper)]
            {
                let difference = (judged_bound - f64::from(exact)).abs();
                assert!(
                    difference <= judged.margin,
                    "{family} {row:?} {judged:?} {difference:e}"
                );
            }
            all += 1;
            resolved += usize::from(judged.margin <= 1e-4 * row.m[0]);
        }
    }
    // A margin as wide as the total agrees with anything.
    assert!(2 * resolved > all, "n = {N}: {resolved} of {all}");
}

#[test]
fn bounds_are_the_optimum_of_the_linear_programme() {
    for_all_orders!(agrees_with_the_programme);
}

/// What the kernels do with their settings.
fn blended<R: Real, const N: usize>(m: [R; MAX_MOMENTS], eta: R, settings: [R; 2]) -> R {
    let [overestimation, bias] = settings;
    let m = mix_bias::<R, N>(m, bias_target::<R, N>(), bias);
    bound::<R, N>(m, eta).blend(overestimation)
}

fn adjoint_is_the_derivative<const N: usize>() {
    type Number = Unrounded<f64, DoubleDouble>;
    for settings in [[0.0, 0.0], [1.0, 1e-3], [0.3, 0.05]] {
        for row in rows("paper", N, 12)
            .iter()
            .chain(&rows("generic-unit", N, 12))
        {
            let m = row.m.map(Number::from);
            let eta = Number::from(row.eta);
            let [overestimation, bias] = settings.map(Number::from);
            let target = bias_target::<Number, N>();
            let mixed = mix_bias::<Number, N>(m, target, bias);
            let d = bound_adjoint::<Number, N>(mixed, eta, overestimation, 1.0.into());
            let d_m = mix_bias_adjoint::<Number, N>(d.m, target, bias);
            for direction in 0..=2 * N + 1 {
                let mut duals = m.map(Dual::constant);
                let mut query = Dual::constant(eta);
                let adjoint = if direction <= 2 * N {
                    duals[direction] = Dual::variable(m[direction]);
                    d_m[direction]
                } else {
                    query = Dual::variable(eta);
                    d.eta
                };
                let settings = settings.map(|s| Dual::constant(Number::from(s)));
                let dual = blended::<_, N>(duals, query, settings).derivative;
                let (adjoint, dual) = (f64::from(adjoint), f64::from(dual));
                assert!(
                    (adjoint - dual).abs() <= 1e-9 * dual.abs().max(1.0),
                    "n = {N} {row:?} {settings:?} {direction}: {adjoint:e} {dual:e}"
                );
            }
        }
    }
}

#[test]
fn the_adjoint_agrees_with_dual_numbers() {
    for_all_orders!(adjoint_is_the_derivative);
}

fn encloses<const N: usize>() {
    type Enclosure = Unrounded<f64, Interval>;
    let mut widths = Vec::new();
    for row in rows("generic-symmetric", N, 100) {
        let exact = bound::<Unrounded<f64, Wide>, N>(row.m.map(Into::into), row.eta.into());
        let enclosed = bound::<Enclosure, N>(row.m.map(Into::into), row.eta.into());
        for (exact, enclosed) in [(exact.lower, enclosed.lower), (exact.upper, enclosed.upper)] {
            let exact = f64::from(exact);
            let interval = enclosed.value;
            assert!(
                interval.lower() <= exact && exact <= interval.upper(),
                "{row:?} {interval:?} {exact}"
            );
            widths.push(interval.upper() - interval.lower());
        }
    }
    widths.sort_by(f64::total_cmp);
    // An interval as wide as the total encloses anything.
    let median = widths[widths.len() / 2];
    assert!(median < 1e-5, "n = {N}: {median:e}");
}

#[test]
fn intervals_enclose_the_bounds() {
    // Not for n = 6: there, what encloses the third root in f64 is nearly as wide as all depths.
    encloses::<1>();
    encloses::<2>();
    encloses::<3>();
    encloses::<4>();
    encloses::<5>();
}

fn reproduces<const N: usize>() {
    for row in rows("generic-symmetric", N, 200) {
        let found = canonical::<f64, N>(row.m, row.eta);
        // Moments that N points without the depth nearly have are nearly those of no distribution: rounding of the
        // moments alone moves the points.
        let limit = if found.own < 1e-10 { 5e-13 } else { 1e-14 };
        for k in 0..=2 * N {
            let mut sum = DoubleDouble::from(found.own) * power(row.eta, k);
            let mut terms = f64::from(sum).abs();
            for (v, w) in found.reciprocals.iter().zip(found.weights).take(N) {
                if *v != 0.0 {
                    let term = DoubleDouble::from(w) * power(row.eta + 1.0 / v, k);
                    terms += f64::from(term).abs();
                    sum += term;
                }
            }
            let rest = f64::from(sum - row.m[k].into()).abs();
            assert!(
                rest <= limit * terms,
                "n = {N} {row:?} {k}: {rest:e} of {terms:e}"
            );
        }
    }
}

fn power(x: f64, k: usize) -> DoubleDouble {
    (0..k).fold(DoubleDouble::from(1.0), |p, _| p * x.into())
}

#[test]
fn the_canonical_representation_has_the_moments() {
    for_all_orders!(reproduces);
}
