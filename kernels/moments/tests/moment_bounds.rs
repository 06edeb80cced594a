//! The bounds for one to six pairs of power moments and a free total, against what must always
//! hold.

#[allow(dead_code, reason = "other tests use the rest of it")]
mod common;

use common::{Distribution, awkward};
use hankel_dsl::Real;
use hankel_moments::{
    Bounds, Canonical, Gradient, MAX_MOMENTS, bias_target, bound, bound_adjoint,
    bound_adjoint_compensated, bound_compensated, canonical, mix_bias,
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
            5 => $f::<$r, 5>($($arg),*),
            _ => $f::<$r, 6>($($arg),*),
        }
    };
}

fn bounds(n: usize, m: [f64; MAX_MOMENTS], eta: f64) -> Bounds<f64> {
    of_order!(n, bound::<f64>(m, eta))
}

fn bounds_32(n: usize, m: [f32; MAX_MOMENTS], eta: f32) -> Bounds<f32> {
    of_order!(n, bound::<f32>(m, eta))
}

fn compensated_32(n: usize, m: [f32; MAX_MOMENTS], eta: f32) -> Bounds<f32> {
    of_order!(n, bound_compensated::<f32>(m, eta))
}

fn compensated(n: usize, m: [f64; MAX_MOMENTS], eta: f64) -> Bounds<f64> {
    of_order!(n, bound_compensated::<f64>(m, eta))
}

fn representation(n: usize, m: [f64; MAX_MOMENTS], eta: f64) -> Canonical<f64> {
    of_order!(n, canonical::<f64>(m, eta))
}

fn gradient(n: usize, m: [f64; MAX_MOMENTS], eta: f64, overestimation: f64) -> Gradient<f64> {
    of_order!(n, bound_adjoint::<f64>(m, eta, overestimation, 1.0))
}

fn biased(n: usize, m: [f64; MAX_MOMENTS], strength: f64) -> [f64; MAX_MOMENTS] {
    fn mix<R: Real, const N: usize>(m: [R; MAX_MOMENTS], strength: R) -> [R; MAX_MOMENTS] {
        mix_bias::<R, N>(m, bias_target::<R, N>(), strength)
    }
    of_order!(n, mix::<f64>(m, strength))
}

fn moments(d: &Distribution, total: f64) -> [f64; MAX_MOMENTS] {
    core::array::from_fn(|k| total * d.moment(k as i32))
}

/// More points than the moments can tell apart.
fn rich() -> impl Strategy<Value = Distribution> {
    prop::collection::vec(0.1..=1.0_f64, 9).prop_flat_map(|weights| {
        prop::collection::vec(0.0..=0.08_f64, 9).prop_map(move |offsets| {
            let total: f64 = weights.iter().sum();
            let depth = |i: usize| -0.95 + 0.22 * i as f64 + offsets[i];
            Distribution((0..9).map(|i| (depth(i), weights[i] / total)).collect())
        })
    })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 2000, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn hold_for_every_distribution(
        d in rich(), total in 0.01..100.0_f64, eta in -1.5..1.5_f64, n in 1..=6_usize,
    ) {
        let m = moments(&d, total);
        let total = m[0];
        let b = bounds(n, m, eta);
        let below = total * d.below(eta);
        let up_to = total - total * d.map(|z| -z).below(-eta);
        prop_assert!(0.0 <= b.lower && b.lower <= b.upper && b.upper <= total, "{b:?}");
        prop_assert!(b.lower <= below + 1e-8 * total, "{b:?} below: {below}");
        prop_assert!(b.upper >= up_to - 1e-8 * total, "{b:?} up to: {up_to}");
    }

    #[test]
    fn tighten_with_more_moments(d in rich(), eta in -1.2..1.2_f64) {
        let m = moments(&d, 1.0);
        for n in 1..6 {
            let (few, more) = (bounds(n, m, eta), bounds(n + 1, m, eta));
            prop_assert!(more.lower >= few.lower - 1e-9, "{n}: {few:?} {more:?}");
            prop_assert!(more.upper <= few.upper + 1e-9, "{n}: {few:?} {more:?}");
        }
    }

    #[test]
    fn do_not_depend_on_unit_and_origin_of_depth(
        d in rich(), eta in -1.2..1.2_f64, scale in 0.25..4.0_f64, shift in -1.0..1.0_f64,
        n in 1..=6_usize,
    ) {
        let here = bounds(n, moments(&d, 1.0), eta);
        let moved = (d.map(|z| z * scale + shift), eta * scale + shift);
        if n <= 5 {
            let there = bounds(n, moments(&moved.0, 1.0), moved.1);
            prop_assert!((here.lower - there.lower).abs() < 1e-5, "{here:?} {there:?}");
            prop_assert!((here.upper - there.upper).abs() < 1e-5, "{here:?} {there:?}");
        }
        let there = compensated(n, moments(&moved.0, 1.0), moved.1);
        for (overestimation, here, there) in [(0.0, here.lower, there.lower), (1.0, here.upper, there.upper)] {
            // Of a narrow distribution far from 0, high moments say little: what rounding each number 32 times
            // does to the bound is allowed, since a moment is a sum of nine terms, each a product of up to 13
            // factors.
            let g = gradient(n, moments(&moved.0, 1.0), moved.1, overestimation);
            let sizes = moments(&moved.0.map(f64::abs), 1.0);
            let of_moments: f64 = g.m.iter().zip(&sizes).map(|(g, m)| g.abs() * m).sum();
            let allowed = 32.0 * f64::EPSILON * (of_moments + (g.eta * moved.1).abs());
            prop_assert!((here - there).abs() < 1e-9 + allowed, "{here} {there} {allowed}");
        }
        // Mirrored, the lower bound becomes the rest of the upper one.
        let mirrored = bounds(n, moments(&d.map(|z| -z), 1.0), -eta);
        prop_assert!((here.lower - (1.0 - mirrored.upper)).abs() < 1e-9);
    }

    #[test]
    fn no_more_points_than_n_are_told_exactly(
        d in rich(), n in 1..=4_usize, gap in 0..=4_usize,
    ) {
        // Every second point of that many, and a query between.
        let points: Vec<_> = d.0.iter().step_by(2).take(n).copied().collect();
        let total: f64 = points.iter().map(|p| p.1).sum();
        let d = Distribution(points.into_iter().map(|(z, w)| (z, w / total)).collect());
        let eta = -0.95 - 0.18 + 0.44 * gap.min(n) as f64;
        // The bound is exact when there is no bias, and departs from that with its square root.
        for (strength, tolerance) in [(1e-13, 2e-3), (1e-11, 2e-2)] {
            let b = compensated(n, biased(n, moments(&d, 1.0), strength), eta);
            let below = d.below(eta);
            prop_assert!((b.lower - below).abs() < tolerance, "{b:?} {below}");
            prop_assert!((b.upper - below).abs() < tolerance, "{b:?} {below}");
        }
    }

    #[test]
    fn points_and_weights_reproduce_the_moments(
        d in rich(), total in 0.1..10.0_f64, eta in -1.2..1.2_f64, n in 1..=4_usize,
    ) {
        let m = moments(&d, total);
        let c = representation(n, m, eta);
        // Not where a point is so far away that its high powers drown the rest.
        prop_assume!(c.reciprocals[..n].iter().all(|v| v.abs() > 0.2));
        for (k, expected) in m.iter().enumerate().take(2 * n + 1) {
            let power = |z: f64| z.powi(k as i32);
            let sum: f64 = c.own * power(eta)
                + (0..n).map(|i| c.weights[i] * power(eta + 1.0 / c.reciprocals[i])).sum::<f64>();
            prop_assert!((sum - expected).abs() < 1e-6 * total, "{k}: {sum} {expected}");
        }
        prop_assert!(c.reciprocals[..n].is_sorted());
    }

    #[test]
    fn the_gradient_is_that_of_a_homogeneous_function(
        d in rich(), eta in -1.2..1.2_f64, n in 1..=6_usize, overestimation in 0.0..=1.0_f64,
    ) {
        // Twice the moments, twice the bound: Euler's relation. And a shift of all depths and of
        // the query point changes nothing.
        let m = moments(&d, 1.0);
        let g = gradient(n, m, eta, overestimation);
        let b = bounds(n, m, eta).blend(overestimation);
        let along: f64 = g.m.iter().zip(&m).map(|(g, m)| g * m).sum();
        let scale: f64 = g.m.iter().map(|g| g.abs()).sum::<f64>() + 1.0;
        prop_assert!((along - b).abs() < 1e-9 * scale, "{along} {b}");
        let shift: f64 = g.eta + (1..=2 * n).map(|k| g.m[k] * k as f64 * m[k - 1]).sum::<f64>();
        prop_assert!(shift.abs() < 1e-8 * scale, "{shift}");
    }
}

/// A row, any bits.
fn any_row_32() -> impl Strategy<Value = ([f32; MAX_MOMENTS], f32)> {
    (prop::array::uniform13(any::<u32>()), any::<u32>())
        .prop_map(|(m, eta)| (m.map(f32::from_bits), f32::from_bits(eta)))
}

fn any_row_64() -> impl Strategy<Value = ([f64; MAX_MOMENTS], f64)> {
    (prop::array::uniform13(any::<u64>()), any::<u64>())
        .prop_map(|(m, eta)| (m.map(f64::from_bits), f64::from_bits(eta)))
}

/// A row of ordinary and awkward numbers.
fn total_32(m0: f32) -> f32 {
    if m0.is_finite() && m0 <= 1e37 {
        m0.max(0.0)
    } else {
        0.0
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 20_000, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn any_bits_give_numbers_in_range((m, eta) in any_row_32(), n in 1..=6_usize) {
        check_32(n, m, eta)?;
    }

    #[test]
    fn any_bits_give_numbers_in_range_64((m, eta) in any_row_64(), n in 1..=6_usize) {
        let total = if m[0].is_finite() && m[0] <= 1e290 { m[0].max(0.0) } else { 0.0 };
        for b in [bounds(n, m, eta), compensated(n, m, eta)] {
            prop_assert!(0.0 <= b.lower && b.lower <= b.upper && b.upper <= total, "{b:?}");
        }
        let compensated = of_order!(n, bound_adjoint_compensated::<f64>(m, eta, 0.3, 1.0));
        for g in [gradient(n, m, eta, 0.3), compensated] {
            prop_assert!(g.eta.is_finite() && g.m.iter().all(|g| g.is_finite()), "{g:?}");
        }
    }

    #[test]
    fn awkward_numbers_give_numbers_in_range(
        m in prop::array::uniform13(awkward()), eta in awkward(), n in 1..=6_usize,
    ) {
        check_32(n, m.map(|m| m as f32), eta as f32)?;
    }
}

fn check_32(n: usize, m: [f32; MAX_MOMENTS], eta: f32) -> Result<(), TestCaseError> {
    for b in [bounds_32(n, m, eta), compensated_32(n, m, eta)] {
        prop_assert!(
            0.0 <= b.lower && b.lower <= b.upper && b.upper <= total_32(m[0]),
            "{b:?} for {m:?} at {eta}"
        );
    }
    for g in [
        of_order!(n, bound_adjoint::<f32>(m, eta, 0.3, 1.0)),
        of_order!(n, bound_adjoint_compensated::<f32>(m, eta, 0.3, 1.0)),
    ] {
        prop_assert!(
            g.eta.is_finite() && g.m.iter().all(|g| g.is_finite()),
            "{g:?} for {m:?} at {eta}"
        );
    }
    let c = of_order!(n, canonical::<f32>(m, eta));
    prop_assert!(
        c.own.is_finite()
            && c.weights
                .iter()
                .chain(&c.reciprocals)
                .all(|x| x.is_finite())
            && c.weights.iter().all(|w| (0.0..=total_32(m[0])).contains(w)),
        "{c:?} for {m:?} at {eta}"
    );
    Ok(())
}

/// Every depth the same, at the ends of the range and between, for any total: the bounds step from
/// nothing to everything.
#[test]
fn a_single_depth_is_a_step() {
    for n in 1..=6 {
        for depth in [0.0, 1.0, -1.0, 0.37] {
            for total in [1e-30_f32, 1.0, 1e30] {
                let m = core::array::from_fn(|k| (f64::from(depth).powi(k as i32)) as f32 * total);
                let below = bounds_32(n, m, depth - 0.05);
                let above = bounds_32(n, m, depth + 0.05);
                assert!(
                    below.upper <= 1e-3 * total,
                    "{n} {depth} {total}: {below:?}"
                );
                assert!(
                    above.lower >= 0.999 * total,
                    "{n} {depth} {total}: {above:?}"
                );
                let at = bounds_32(n, m, depth);
                assert!(
                    at.lower <= 0.01 * total && at.upper >= 0.99 * total,
                    "{n} {depth}: {at:?}"
                );
            }
        }
    }
}

/// At and about the roots of the orthogonal polynomial, where a point of the distribution is at
/// infinity, bounds and gradients are continuous (\[MBD\], Theorem 14).
#[test]
fn singularities_are_removable() {
    let d = Distribution(vec![
        (-0.9, 0.05),
        (-0.8, 0.1),
        (-0.5, 0.1),
        (-0.3, 0.2),
        (0.05, 0.1),
        (0.2, 0.05),
        (0.35, 0.2),
        (0.6, 0.1),
        (0.9, 0.1),
    ]);
    let m = moments(&d, 1.0);
    for n in 1..=6 {
        // A reciprocal changes its sign there, and neither bound does anything.
        let mut crossings = 0;
        let sign = |eta: f64| {
            let c = representation(n, m, eta);
            c.reciprocals[..n].iter().filter(|v| **v < 0.0).count()
        };
        let mut before = sign(-1.5);
        for i in 1..=3000 {
            let eta = -1.5 + f64::from(i) * 1e-3;
            let now = sign(eta);
            if now == before {
                continue;
            }
            crossings += 1;
            before = now;
            let (mut low, mut high) = (eta - 1e-3, eta);
            for _ in 0..60 {
                let mid = 0.5 * (low + high);
                if sign(mid) == now {
                    high = mid
                } else {
                    low = mid
                }
            }
            let at = bounds(n, m, low);
            let g = gradient(n, m, low, 0.0);
            for offset in [-8e-6, -1e-7, -1e-12, 0.0, 1e-12, 1e-7, 8e-6] {
                let near = bounds(n, m, low + offset);
                let slope = g.eta.abs() + 1.0;
                assert!((near.lower - at.lower).abs() <= 2.0 * offset.abs() * slope + 1e-9);
                let h = gradient(n, m, low + offset, 0.0);
                for k in 0..=2 * n {
                    let size = g.m.iter().fold(1.0_f64, |a, g| a.max(g.abs()));
                    assert!(
                        (h.m[k] - g.m[k]).abs() <= 1e-2 * size,
                        "{n} {k} at {low} + {offset}: {} {}",
                        h.m[k],
                        g.m[k]
                    );
                }
            }
        }
        assert_eq!(
            crossings, n,
            "the orthogonal polynomial of degree {n} has as many roots"
        );
    }
}

/// What compensation is for: surfaces of little thickness, in `f32`.
#[test]
fn compensation_keeps_the_digits_of_tight_surfaces() {
    let mut random = 1_u32;
    let mut next = move || {
        random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        f64::from(random >> 8) / f64::from(1 << 24)
    };
    for n in [2, 3] {
        let mut errors = [Vec::new(), Vec::new()];
        while errors[0].len() < 2000 {
            let spread = 10.0_f64.powf(-4.0 + 2.0 * next());
            let (near, far) = (next() * 2.0 - 1.0, next() * 2.0 - 1.0);
            let points = (0..8)
                .map(|i| {
                    (
                        if i < 4 { near } else { far } + spread * (next() * 4.0 - 2.0),
                        0.125,
                    )
                })
                .collect();
            let d = Distribution(points);
            let m = moments(&d, 1.0).map(|m| m as f32);
            let eta = (near + (far - near) * next()) as f32;
            let exact = compensated(n, m.map(f64::from), f64::from(eta));
            // Not every vector of rounded moments is valid.
            if !is_valid(n, m) {
                continue;
            }
            errors[0].push((f64::from(bounds_32(n, m, eta).lower) - exact.lower).abs());
            errors[1].push((f64::from(compensated_32(n, m, eta).lower) - exact.lower).abs());
        }
        let [plain, compensated] = errors.map(|mut e| {
            e.sort_by(f64::total_cmp);
            e[e.len() * 9 / 10]
        });
        assert!(compensated * 10.0 < plain, "{n}: {plain} {compensated}");
    }
}

/// Whether the Hankel matrix is positive definite, by elimination in `f64`, which is exact enough
/// for moments in `f32`.
fn is_valid(n: usize, m: [f32; MAX_MOMENTS]) -> bool {
    let mut h: Vec<Vec<f64>> = (0..=n)
        .map(|i| (0..=n).map(|j| f64::from(m[i + j])).collect())
        .collect();
    for k in 0..=n {
        if h[k][k] <= 1e-13 {
            return false;
        }
        let (above, below) = h.split_at_mut(k + 1);
        for row in below {
            let factor = row[k] / above[k][k];
            for (x, pivot) in row.iter_mut().zip(&above[k]).skip(k + 1) {
                *x -= factor * pivot;
            }
        }
    }
    true
}

/// Powers of two change no digit: the derivative to the query point is in proportion to the total.
#[test]
fn the_derivative_to_the_query_point_is_in_proportion_to_the_total() {
    let d = Distribution(
        (0..7)
            .map(|i| (0.3 * f64::from(i) - 0.95, 1.0 / 7.0))
            .collect(),
    );
    let row = (moments(&d, 1.0).map(|m| m as f32), 0.21);
    for n in 1..=6 {
        let at_one = of_order!(n, bound_adjoint::<f32>(row.0, row.1, 0.3, 1.0));
        assert!(at_one.eta.abs() > 1e-3, "{n} {at_one:?}");
        for exponent in [-80, -40, 40, 84, 100, 110] {
            let scale = 2.0_f32.powi(exponent);
            let m = row.0.map(|m| m * scale);
            let g = of_order!(n, bound_adjoint::<f32>(m, row.1, 0.3, 1.0));
            assert_eq!(g.m, at_one.m, "{n} {exponent}");
            assert_eq!(g.eta, at_one.eta * scale, "{n} {exponent}");
        }
        // Never infinite.
        let m = row.0.map(|m| m * 2.0_f32.powi(110));
        let g = of_order!(n, bound_adjoint::<f32>(m, row.1, 0.3, 1e12));
        assert!(g.eta.abs() > 9e36 && g.eta.abs() < 1.1e37, "{n} {g:?}");
    }
}
