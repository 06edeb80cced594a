//! Derivatives of points and weights, against what must always hold.

#[allow(dead_code, reason = "other tests use the rest of it")]
mod common;

use common::{Distribution, awkward};
use hankel_dsl::Real;
use hankel_moments::{
    Canonical, Gradient, MAX, MAX_MOMENTS, bound_adjoint, canonical, canonical_adjoint,
};
use proptest::prelude::*;

/// Calls a function for the N that is known when the test runs.
macro_rules! of_order {
    ($n:expr, $f:ident::<$r:ty>($($arg:expr),*)) => {
        match $n {
            1 => $f::<$r, 1>($($arg),*),
            2 => $f::<$r, 2>($($arg),*),
            3 => $f::<$r, 3>($($arg),*),
            4 => $f::<$r, 4>($($arg),*),
            _ => $f::<$r, 5>($($arg),*),
        }
    };
}

fn representation(n: usize, m: [f64; MAX_MOMENTS], eta: f64) -> Canonical<f64> {
    of_order!(n, canonical::<f64>(m, eta))
}

fn gradient(n: usize, m: [f64; MAX_MOMENTS], eta: f64, d: Canonical<f64>) -> Gradient<f64> {
    of_order!(n, canonical_adjoint::<f64>(m, eta, d))
}

fn moments(d: &Distribution, total: f64) -> [f64; MAX_MOMENTS] {
    core::array::from_fn(|k| total * d.moment(k as i32))
}

/// More points than the moments can tell apart.
fn many() -> Distribution {
    let points = [-0.8, -0.5, -0.3, 0.05, 0.35, 0.6, 0.9];
    let weights = [0.15, 0.1, 0.2, 0.1, 0.25, 0.1, 0.1];
    Distribution(points.into_iter().zip(weights).collect())
}

/// The largest derivative, or 1 if that is more.
fn size(g: &Gradient<f64>) -> f64 {
    let all = g.m.iter().chain([&g.eta]);
    all.fold(1.0, |most, g| most.max(g.abs()))
}

/// The points' and weights' own moments, as functions of the given ones, are the identity: their gradient is 1 for
/// that moment, and 0 for all others. With the distances held, all points move with the query point; what points and
/// weights do about it undoes that.
#[test]
fn moments_of_points_and_weights_depend_on_that_moment_alone() {
    for total in [1e-20, 1.0, 3.0, 1e20] {
        let m = moments(&many(), total);
        for n in 1..=6 {
            for eta in [-1.3, -0.77, -0.2, 0.0, 0.41, 0.65, 1.1] {
                let c = representation(n, m, eta);
                for k in 0..=2 * n {
                    let mut d = Canonical::none();
                    d.own = eta.powi(k as i32);
                    for i in 0..n {
                        let x = eta + 1.0 / c.reciprocals[i];
                        d.weights[i] = x.powi(k as i32);
                        let slope = if k == 0 {
                            0.0
                        } else {
                            k as f64 * x.powi(k as i32 - 1)
                        };
                        d.reciprocals[i] = -c.weights[i] * slope / c.reciprocals[i].powi(2);
                    }
                    let g = gradient(n, m, eta, d);
                    let worth = d
                        .weights
                        .iter()
                        .chain(&d.reciprocals)
                        .fold(1.0, |most: f64, d| most.max(d.abs() / total.min(1.0)));
                    for j in 0..=10 {
                        let exact = f64::from(u8::from(j == k));
                        assert!(
                            (g.m[j] - exact).abs() <= 1e-9 * worth,
                            "{total} {n} {eta} {k}: {j} {g:?}"
                        );
                    }
                    let moved = if k == 0 { 0.0 } else { k as f64 * m[k - 1] };
                    assert!(
                        (g.eta + moved).abs() <= 1e-9 * worth * total.max(1.0),
                        "{total} {n} {eta} {k}: {g:?}"
                    );
                }
            }
        }
    }
}

/// The lower bound is the weight of the points below, and the upper one has the query point's besides.
#[test]
fn derivatives_of_bounds_follow() {
    let m = moments(&many(), 1.0);
    for n in 1..=6 {
        for i in 0..200 {
            let eta = -1.2 + 0.0121 * f64::from(i);
            let c = representation(n, m, eta);
            for own in [0.0, 1.0] {
                let mut d = Canonical::none();
                d.own = own;
                for i in 0..n {
                    d.weights[i] = f64::from(u8::from(c.reciprocals[i] < 0.0));
                }
                let here = gradient(n, m, eta, d);
                let there = of_order!(n, bound_adjoint::<f64>(m, eta, own, 1.0));
                let most = 1e-9 * size(&there);
                for k in 0..=2 * n {
                    assert!(
                        (here.m[k] - there.m[k]).abs() <= most,
                        "{n} {eta}: {here:?} {there:?}"
                    );
                }
                assert!(
                    (here.eta - there.eta).abs() <= most,
                    "{n} {eta}: {here:?} {there:?}"
                );
            }
        }
    }
}

/// A mirrored distribution about the query point: for odd N a point is at infinity.
#[test]
fn a_point_at_infinity_has_a_derivative() {
    let halves = many().0.into_iter().map(|(z, w)| (z, 0.5 * w));
    let d = Distribution(halves.flat_map(|(z, w)| [(z, w), (-z, w)]).collect());
    let m = moments(&d, 1.0);
    for n in [1, 3, 5] {
        let middle = n / 2;
        let c = representation(n, m, 0.0);
        assert!(
            c.reciprocals[middle].abs() < 1e-12 && c.weights[middle] < 1e-12,
            "{n} {c:?}"
        );
        // Its weight stays 0.
        let mut d = Canonical::none();
        d.weights[middle] = 1.0;
        let g = gradient(n, m, 0.0, d);
        assert!(
            g.eta.abs() < 1e-9 && g.m.iter().all(|g| g.abs() < 1e-9),
            "{n} {g:?}"
        );
        // The reciprocal goes through 0 like any other number.
        let mut d = Canonical::none();
        d.reciprocals[middle] = 1.0;
        let g = gradient(n, m, 0.0, d);
        for k in 0..=2 * n + 1 {
            let step = 1e-6;
            let at = |step: f64| {
                let (mut m, mut eta) = (m, 0.0);
                if k <= 2 * n {
                    m[k] += step
                } else {
                    eta += step
                }
                representation(n, m, eta).reciprocals[middle]
            };
            let difference = (at(step) - at(-step)) / (2.0 * step);
            let derivative = if k <= 2 * n { g.m[k] } else { g.eta };
            assert!(
                (derivative - difference).abs() < 1e-5 * size(&g),
                "{n} {k}: {derivative} {difference}"
            );
        }
        assert!(size(&g) > 1.5, "{n} {g:?}");
    }
}

/// Derivatives to moments of a small total are in proportion to its inverse, where they are those of points.
#[test]
fn derivatives_of_any_total() {
    let m = moments(&many(), 1.0).map(|m| m as f32);
    let eta = 0.21;
    for n in 1..=6 {
        let of = |scale: f32, reciprocal: f32, weight: f32| {
            let d = Canonical {
                reciprocals: [0.3, -1.0, 0.7, 0.1, -0.4, 0.6].map(|d: f32| d * reciprocal),
                weights: [-0.2, 0.5, 1.0, -0.7, 0.9, -0.3].map(|d: f32| d * weight),
                own: 0.6 * weight,
            };
            of_order!(n, canonical_adjoint::<f32>(m.map(|m| m * scale), eta, d))
        };
        let (points, weights) = (of(1.0, 1.0, 0.0), of(1.0, 0.0, 1.0));
        assert!(points.eta.abs() > 1e-3 && weights.eta.abs() > 1e-3, "{n}");
        for exponent in [-80, -40, 40, 80] {
            let scale = 2.0_f32.powi(exponent);
            let g = of(scale, 1.0, 0.0);
            assert_eq!(g.m.map(|g| g * scale), points.m, "{n} {exponent}");
            assert_eq!(g.eta, points.eta, "{n} {exponent}");
            let g = of(scale, 0.0, 1.0);
            assert_eq!(g.m, weights.m, "{n} {exponent}");
            assert_eq!(g.eta, weights.eta * scale, "{n} {exponent}");
        }
        assert_eq!(of(0.0, 1.0, 1.0), of(-1.0, 1.0, 1.0), "{n}");
        assert_eq!(of(0.0, 1.0, 1.0).m, [0.0; MAX_MOMENTS], "{n}");
    }
}

/// Degenerate moments have no derivatives of single points; what comes out are numbers.
fn check<R: Real>(n: usize, m: [R; MAX_MOMENTS], eta: R, upstream: [R; MAX_MOMENTS]) -> bool
where
    f64: From<R>,
{
    let mut d = Canonical::none();
    let (reciprocals, rest) = upstream.split_at(MAX);
    let (weights, own) = rest.split_at(MAX);
    d.reciprocals.copy_from_slice(reciprocals);
    d.weights.copy_from_slice(weights);
    d.own = own[0];
    let g = of_order!(n, canonical_adjoint::<R>(m, eta, d));
    g.m.iter()
        .chain([&g.eta])
        .all(|&g| f64::from(g).abs() <= 2e37)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 20_000, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn any_bits_give_finite_derivatives(
        m in prop::array::uniform13(any::<u32>()), eta in any::<u32>(),
        upstream in prop::array::uniform13(any::<u32>()), n in 1..=6_usize,
    ) {
        prop_assert!(check(n, m.map(f32::from_bits), f32::from_bits(eta), upstream.map(f32::from_bits)));
    }

    #[test]
    fn any_bits_give_finite_derivatives_64(
        m in prop::array::uniform13(any::<u64>()), eta in any::<u64>(),
        upstream in prop::array::uniform13(any::<u64>()), n in 1..=6_usize,
    ) {
        prop_assert!(check(n, m.map(f64::from_bits), f64::from_bits(eta), upstream.map(f64::from_bits)));
    }

    #[test]
    fn awkward_numbers_give_finite_derivatives(
        m in prop::array::uniform13(awkward()), eta in awkward(),
        upstream in prop::array::uniform13(awkward()), n in 1..=6_usize,
    ) {
        prop_assert!(check(n, m, eta, upstream));
        prop_assert!(check(n, m.map(|m| m as f32), eta as f32, upstream.map(|d| d as f32)));
    }

    /// Fewer depths than points: weights of 0, and points that coincide; the query point is one of them or near.
    #[test]
    fn degenerate_moments_give_finite_derivatives(
        depths in prop::collection::vec((-1.0..1.0_f64, 0.1..1.0_f64), 1..=4), offset in prop::sample::select(
            vec![0.0, 0.0, 1e-12, -1e-7, 1e-3, 0.5]
        ), total in prop::sample::select(vec![1e-30, 1.0, 1e30]),
        upstream in prop::array::uniform13(-1.0..1.0_f64), n in 1..=6_usize,
    ) {
        let d = Distribution(depths);
        let (m, eta) = (moments(&d, total), d.0[0].0 + offset);
        prop_assert!(check(n, m, eta, upstream));
        prop_assert!(check(n, m.map(|m| m as f32), eta as f32, upstream.map(|d| d as f32)));
    }
}
