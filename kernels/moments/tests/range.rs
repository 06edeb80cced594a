//! Bounds over the whole range of totals, lengths and tails that `bound` promises. Expected values are from 600 bits.

use hankel_moments::{
    MAX_MOMENTS, Moments4, bound, bound_adjoint_compensated, bound_compensated,
    hausdorff_4_compensated,
};

/// `total` times the moments of depths that are spread evenly over `[0, length]`.
fn even(total: f64, length: f64) -> [f64; MAX_MOMENTS] {
    std::array::from_fn(|k| total * length.powi(k as i32) / (k as f64 + 1.0))
}

/// Moments of points with weights.
fn of_points(points: &[(f64, f64)]) -> [f64; MAX_MOMENTS] {
    std::array::from_fn(|k| points.iter().map(|(x, w)| w * x.powi(k as i32)).sum())
}

fn f32s(m: [f64; MAX_MOMENTS]) -> [f32; MAX_MOMENTS] {
    m.map(|m| m as f32)
}

fn close(found: f64, expected: f64, tolerance: f64) {
    assert!(
        (found - expected).abs() <= tolerance,
        "{found} is not {expected}"
    );
}

/// The unit of weight changes nothing.
#[test]
fn shares_do_not_depend_on_the_total() {
    for power in [-30, -9, -2, 0, 3, 6, 9, 10, 20, 28] {
        let total = 10_f64.powi(power);
        let wide = bound_compensated::<f64, 6>(even(total, 100.0), 50.5);
        close(wide.lower / total, 0.400301, 1e-6);
        close(wide.upper / total, 0.609406, 1e-6);
        let plain = bound::<f64, 6>(even(total, 100.0), 50.5);
        close(plain.lower / total, 0.400301, 1e-6);
    }
    for total in [1e-20, 1e-3, 1.0, 1e3, 1e8] {
        let found = bound_compensated::<f32, 3>(f32s(even(total, 1000.0)), 500.0);
        close(f64::from(found.lower) / total, 0.27778, 1e-5);
        close(f64::from(found.upper) / total, 0.72222, 1e-5);
    }
    for total in [1e3, 1e9, 2e9, 1e20, 1e28] {
        let found = bound_compensated::<f32, 4>(f32s(even(total, 1e-5)), 5e-6);
        // Less than what rounding the moments does.
        close(f64::from(found.lower) / total, 0.35778, 2e-4);
        close(f64::from(found.upper) / total, 0.64222, 2e-4);
    }
}

/// A few far surfaces beside many near ones.
#[test]
fn far_outliers_count() {
    let points = [
        (0.0, 1.0),
        (1e-3, 0.5),
        (-1e-3, 0.5),
        (1e-2, 5e-4),
        (-1e-2, 5e-4),
        (0.1, 5e-7),
        (-0.1, 5e-7),
        (1.0, 5e-10),
        (-1.0, 5e-10),
    ];
    let m = of_points(&points);
    let found = bound_compensated::<f64, 6>(m, 5e-4);
    close(found.lower / m[0], 0.3211733526, 1e-9);
    close(found.upper / m[0], 0.9999304686, 1e-9);
    let adjoint = bound_adjoint_compensated::<f64, 6>(m, 5e-4, 0.0, 1.0);
    close(adjoint.m[0], 0.5095, 1e-4);
    close(adjoint.eta, 1574.7, 0.1);

    let pair = [
        (0.0, 0.3),
        (1e4, 0.34),
        (-1e4, 0.34),
        (1e5, 0.01),
        (-1e5, 0.01),
    ];
    let found = bound::<f64, 2>(of_points(&pair), 5000.0);
    close(found.lower, 0.1089475, 1e-7);
    close(found.upper, 0.9987853, 1e-7);
    let found = bound_compensated::<f32, 2>(f32s(of_points(&pair)), 5000.0);
    close(found.lower.into(), 0.1089475, 1e-6);

    let tail = [(-1.0, 0.3), (0.0, 0.4), (1.0, 0.3), (3e5, 1e-11)];
    let found = bound_compensated::<f64, 2>(of_points(&tail), 0.5);
    close(found.lower, 0.2941186, 1e-7);
    let found = bound_compensated::<f32, 2>(f32s(of_points(&tail)), 0.5);
    close(found.lower.into(), 0.2941186, 1e-6);

    let m = [1.0, 32.7812, 1_154_782.0, 4.37144e13, 1.77828e24];
    let m = std::array::from_fn(|k| m.get(k).copied().unwrap_or(0.0));
    close(bound_compensated::<f64, 2>(m, 1000.0).lower, 0.44801, 1e-5);
    close(
        bound_compensated::<f32, 2>(f32s(m), 1000.0).lower.into(),
        0.44801,
        1e-5,
    );
}

/// Nothing is below a query point that is far in front, and small changes change nothing.
#[test]
fn far_query_points_have_small_derivatives() {
    let points = [-1.5, -1.0, -0.6, -0.1, 0.3, 0.7, 1.1, 1.6].map(|x| (x, 0.125));
    let m = of_points(&points);
    fn check<const N: usize>(m: [f64; MAX_MOMENTS]) {
        for eta in [-1e2, -1e3, -1e4, -1e5, -1e6, -1e8, -1e9] {
            let narrow = bound_adjoint_compensated::<f32, N>(f32s(m), eta as f32, 1.0, 1.0);
            let wide = bound_adjoint_compensated::<f64, N>(m, eta, 1.0, 1.0);
            // By Chebyshev's inequality the bound is below (1.6 / eta)² for N = 1, and its powers.
            let most = 16.0 * (1.6_f64 / eta).powi(2).powi(N as i32).max(1e-20);
            for k in 0..=2 * N {
                let size = eta.abs().powi(k as i32).min(1.0).recip();
                assert!(
                    f64::from(narrow.m[k]).abs() <= most.max(1e-12) * size,
                    "{N} {eta} m{k}: {}",
                    narrow.m[k]
                );
                assert!(
                    wide.m[k].abs() <= most.max(1e-20) * size,
                    "{N} {eta} m{k}: {}",
                    wide.m[k]
                );
            }
        }
    }
    check::<1>(m);
    check::<2>(m);
    check::<3>(m);
    check::<4>(m);
    check::<5>(m);
    check::<6>(m);
}

/// Depths of 1e-9 to 1e-8 beside an interval of length 1.
#[test]
fn hausdorff_bounds_of_small_depths() {
    let m = of_points(&[1e-9, 3e-9, 6e-9, 1e-8].map(|x| (x, 0.25)));
    let moments = Moments4 {
        b1: m[1],
        b2: m[2],
        b3: m[3],
        b4: m[4],
    };
    for (depth, expected) in [(2e-9, 0.0), (5e-9, 0.36018)] {
        let wide = hausdorff_4_compensated(moments, depth);
        close(wide, expected, 1e-5);
        let narrow = Moments4 {
            b1: m[1] as f32,
            b2: m[2] as f32,
            b3: m[3] as f32,
            b4: m[4] as f32,
        };
        close(
            hausdorff_4_compensated(narrow, depth as f32).into(),
            expected,
            1e-5,
        );
    }
}

/// The unit of length changes nothing, not even a rounding: other units are powers of two.
#[test]
fn plain_bounds_do_not_depend_on_the_unit_of_length() {
    fn check<const N: usize>(powers: &[i32]) {
        let rows = [
            (even(1.0, 1.0), 0.4),
            (of_points(&[(-0.5, 0.25), (0.75, 0.5), (0.25, 1.0)]), 0.5),
            (
                of_points(&[(-0.9, 0.2), (-0.3, 0.2), (0.1, 0.2), (0.6, 0.2), (0.8, 0.2)]),
                0.0,
            ),
        ];
        for (m, eta) in rows {
            let here = bound::<f32, N>(f32s(m), eta);
            assert!(here.lower > 0.0 || here.upper < m[0] as f32, "{here:?}");
            for &power in powers {
                let length = 2_f64.powi(power);
                let m = std::array::from_fn(|k| m[k] * length.powi(k as i32));
                let there = bound::<f32, N>(f32s(m), eta * length as f32);
                assert_eq!(here, there, "N = {N}, depths times 2^{power}");
            }
        }
    }
    check::<1>(&[-40, -26, -10, -3, 2, 5, 26]);
    check::<2>(&[-25, -12, -4, 3, 9, 13]);
    check::<3>(&[-17, -9, -5, 2, 8, 12]);
    check::<4>(&[-12, -8, -3, 4, 10]);
    check::<5>(&[-9, -5, -3, 2, 8]);
    check::<6>(&[-8, -5, -3, 2, 7]);
}
