//! Published algorithms give what the kernels give where both are well conditioned, and are what the
//! kernels are held against where they are not.

use hankel_moments::{
    Bounds, HalfAngle, Moments6, TrigonometricMoments, bias_target, bound, hamburger_6, mix_bias,
    sparse_2, trigonometric_4,
};
use hankel_numerics::families::{Family, Format, Row};
use hankel_numerics::published::{
    Float, mixed, moment_bound, six_moments, trigonometric, two_points,
};
use hankel_numerics::stress::bounds_of;

fn rows<T: Format>(family: &str, n: usize, count: u64) -> impl Iterator<Item = Row<T>> {
    let family = Family::named(family).unwrap();
    (0..count).map(move |index| family.row(n, 3, index))
}

/// The share of pairs that are nearer than a tolerance.
fn near(pairs: impl Iterator<Item = (f64, f64)>, tolerance: f64) -> f64 {
    let all: Vec<bool> = pairs.map(|(a, b)| (a - b).abs() <= tolerance).collect();
    all.iter().filter(|is_near| **is_near).count() as f64 / all.len() as f64
}

#[test]
fn the_2025_solver_agrees_in_f64() {
    for n in 1..=5 {
        let pairs = rows::<f64>("generic-symmetric", n, 400).flat_map(|row| {
            let (a, b) = (
                moment_bound(n, row.m, row.eta),
                bounds_of(n, row.m, row.eta),
            );
            [(a.lower, b.lower), (a.upper, b.upper)]
        });
        let share = near(pairs, 1e-6);
        assert!(share > 0.99, "n = {n}: {share}");
    }
}

fn six<T: Format>(row: &Row<T>) -> Moments6<T> {
    let [_, b1, b2, b3, b4, b5, b6, ..] = row.m;
    Moments6 {
        b1,
        b2,
        b3,
        b4,
        b5,
        b6,
    }
}

#[test]
fn six_moments_agree_in_f64() {
    let pairs = rows::<f64>("silhouettes-biased", 3, 1000).flat_map(|row| {
        let a = six_moments(six(&row), row.eta);
        let b = hamburger_6(six(&row), row.eta);
        [(a.lower, b.lower), (a.upper, b.upper)]
    });
    let share = near(pairs, 1e-4);
    assert!(share > 0.98, "{share}");
}

fn trigonometric_rows<T: Float>(count: u64) -> impl Iterator<Item = (TrigonometricMoments<T>, T)> {
    rows::<f64>("generic-unit", 2, count)
        .enumerate()
        .map(|(i, row)| {
            // Depths from the row's own numbers: as good as random.
            let depth = |k: usize| (row.m[k] * (7.0 + k as f64) + 0.1 * i as f64).fract();
            let mut m = TrigonometricMoments::of_depth(depth(1));
            for (k, share) in [(2, 0.4), (3, 0.3), (4, 0.5)] {
                let other = TrigonometricMoments::of_depth(depth(k));
                let mix = |a: f64, b: f64| a + share * (b - a);
                m = TrigonometricMoments {
                    c1: mix(m.c1, other.c1),
                    s1: mix(m.s1, other.s1),
                    c2: mix(m.c2, other.c2),
                    s2: mix(m.s2, other.s2),
                };
            }
            let m = m.biased(1e-3);
            let m = TrigonometricMoments {
                c1: T::round(m.c1),
                s1: T::round(m.s1),
                c2: T::round(m.c2),
                s2: T::round(m.s2),
            };
            (m, T::round(row.eta.rem_euclid(1.0)))
        })
}

#[test]
fn trigonometric_moments_agree_in_f64() {
    let pairs = trigonometric_rows::<f64>(1000).map(|(m, z)| {
        let own = trigonometric_4(m, HalfAngle::of_depth(z)).lower;
        (trigonometric(m, z), own)
    });
    let share = near(pairs, 1e-6);
    assert!(share > 0.95, "{share}");
}

#[test]
fn two_points_agree_in_f64() {
    for row in rows::<f64>("generic-symmetric", 2, 200) {
        let [_, b1, b2, b3, ..] = row.m;
        let (a, b) = (two_points(b1, b2, b3), sparse_2(b1, b2, b3));
        for (x, y) in [
            (a.z[0], b.z1),
            (a.z[1], b.z2),
            (a.w[0], b.w1),
            (a.w[1], b.w2),
        ] {
            assert!((x - y).abs() < 1e-8, "{a:?} {b:?}");
        }
    }
}

fn quantile(mut errors: Vec<f64>, q: f64) -> f64 {
    errors.sort_by(f64::total_cmp);
    errors[(q * (errors.len() - 1) as f64) as usize]
}

/// Errors of a bound in f32, NaN as 1.
fn error(found: f32, exact: f64) -> f64 {
    let error = (f64::from(found) - exact).abs();
    if error.is_finite() { error } else { 1.0 }
}

#[test]
fn kernels_in_f32_are_no_worse() {
    for family in ["silhouettes-biased", "self-biased", "generic-symmetric"] {
        let (mut own, mut its) = (Vec::new(), Vec::new());
        for row in rows::<f32>(family, 3, 4000) {
            let wide = row.map(f64::from);
            let exact: Bounds<f64> = hankel_moments::bound_compensated::<f64, 3>(wide.m, wide.eta);
            own.push(error(hamburger_6(six(&row), row.eta).lower, exact.lower));
            its.push(error(six_moments(six(&row), row.eta).lower, exact.lower));
        }
        for q in [0.5, 0.9, 0.99] {
            let (own, its) = (quantile(own.clone(), q), quantile(its.clone(), q));
            assert!(own <= its * 1.1, "{family} {q}: {own} {its}");
        }
    }
}

/// The paper's bias mixes the total in as well, the kernels' keeps it. With a total of 1 they are the
/// same; of a small total the paper's bias is most.
#[test]
fn the_papers_bias_is_another_one_but_for_a_total_of_one() {
    let target = bias_target::<f64, 2>();
    let mut apart = 0.0_f64;
    for (family, is_one) in [("generic-mass", false), ("generic-symmetric", true)] {
        for row in rows::<f64>(family, 2, 200) {
            let published = mixed(row.m, target, 1e-3);
            let kept = mix_bias::<f64, 2>(row.m, target, 1e-3);
            assert_eq!(kept[0], row.m[0]);
            if is_one {
                for k in 0..=4 {
                    assert!((kept[k] - published[k]).abs() <= 4.0 * f64::EPSILON);
                }
            }
            let its = moment_bound(2, published, row.eta).lower / published[0];
            let of_its = bound::<f64, 2>(published, row.eta).lower / published[0];
            assert!((its - of_its).abs() < 1e-6, "{its} {of_its}");
            let own = bound::<f64, 2>(kept, row.eta).lower / kept[0];
            apart = apart.max((own - its).abs());
        }
    }
    assert!(apart > 1e-2, "{apart}");
}
