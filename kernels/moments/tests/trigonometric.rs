//! Trigonometric moments: what must hold of the bounds, whatever computes them.

#[allow(dead_code, reason = "each test needs some of it")]
mod common;
mod programme;

use std::f64::consts::{PI, TAU};

use common::{Distribution, distribution};
use hankel_moments::{
    Bounds, HalfAngle, TrigonometricMoments, trigonometric_4, trigonometric_4_compensated,
};
use proptest::prelude::*;
use proptest::strategy::ValueTree;
use proptest::test_runner::TestRunner;

/// What f64 leaves of a bound near a singularity.
const TOLERANCE: f64 = 1e-6;

fn mean(d: &Distribution, f: impl Fn(f64) -> f64) -> f64 {
    d.0.iter().map(|(z, w)| w * f(*z)).sum()
}

/// By the library's sine, which the kernel does not have.
fn moments(d: &Distribution) -> TrigonometricMoments<f64> {
    TrigonometricMoments {
        c1: mean(d, |z| (TAU * z).cos()),
        s1: mean(d, |z| (TAU * z).sin()),
        c2: mean(d, |z| (2.0 * TAU * z).cos()),
        s2: mean(d, |z| (2.0 * TAU * z).sin()),
    }
}

fn bounds(m: TrigonometricMoments<f64>, z: f64) -> Bounds<f64> {
    trigonometric_4(m, HalfAngle::of_depth(z))
}

fn single(m: TrigonometricMoments<f64>) -> TrigonometricMoments<f32> {
    TrigonometricMoments {
        c1: m.c1 as f32,
        s1: m.s1 as f32,
        c2: m.c2 as f32,
        s2: m.s2 as f32,
    }
}

fn double(m: TrigonometricMoments<f32>) -> TrigonometricMoments<f64> {
    TrigonometricMoments {
        c1: m.c1.into(),
        s1: m.s1.into(),
        c2: m.c2.into(),
        s2: m.s2.into(),
    }
}

/// Distances on the circle.
fn apart(a: f64, b: f64) -> f64 {
    let d = (a - b).abs();
    d.min(1.0 - d)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 4000, max_global_rejects: 100_000, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn the_distribution_lies_between_the_bounds(d in distribution(8), z in 0.0..=1.0_f64) {
        let below = d.below(z);
        for bounds in [bounds(moments(&d), z), trigonometric_4_compensated(moments(&d), z)] {
            prop_assert!(bounds.lower <= below + TOLERANCE, "{bounds:?} {below}");
            prop_assert!(below <= bounds.upper + TOLERANCE, "{bounds:?} {below}");
        }
    }

    /// Away from singularities plain arithmetic is exact enough to compare with.
    #[test]
    fn both_forms_are_the_same_bounds(d in distribution(8), z in 0.0..=1.0_f64) {
        let m = moments(&d).biased(1e-3);
        let (a, b) = (bounds(m, z), trigonometric_4_compensated(m, z));
        prop_assert!((a.lower - b.lower).abs() < 1e-9, "{a:?} {b:?}");
        prop_assert!((a.upper - b.upper).abs() < 1e-9, "{a:?} {b:?}");
    }

    /// Both bounds of one or two surfaces are their share, and a bias moves them in proportion.
    #[test]
    fn two_surfaces_are_exact(
        near in 0.0..=1.0_f64,
        far in 0.0..=1.0_f64,
        weight in prop_oneof![Just(0.0), 0.05..=0.95_f64],
        z in 0.05..=0.95_f64,
    ) {
        let points = [near, far, z, 0.0];
        let are_apart = (0..4).all(|i| (0..i).all(|k| apart(points[i], points[k]) > 0.05));
        prop_assume!(are_apart);
        let d = Distribution(vec![(near, weight), (far, 1.0 - weight)]);
        let below = d.below(z);
        let at = |bias| {
            let bounds = bounds(moments(&d).biased(bias), z);
            (bounds.lower - below).abs().max((bounds.upper - below).abs())
        };
        prop_assert!(at(0.0) < 1e-9, "{}", at(0.0));
        let slope = at(1e-6) / 1e-6;
        prop_assert!(slope < 1e5, "{slope}");
        for bias in [1e-7, 1e-8] {
            prop_assert!(at(bias) < 1.5 * slope * bias + 1e-9, "{bias}: {}, {slope}", at(bias));
        }
    }

    #[test]
    fn bounds_grow_with_depth(d in distribution(8), z in 0.0..=1.0_f64, step in 0.0..=0.2_f64) {
        let m = moments(&d);
        let (near, far) = (bounds(m, z), bounds(m, (z + step).min(1.0)));
        prop_assert!(near.lower <= far.lower + TOLERANCE, "{near:?} {far:?}");
        prop_assert!(near.upper <= far.upper + TOLERANCE, "{near:?} {far:?}");
    }

    /// Depths counted from the other end: what was below is above, to the bit. Where the bounds
    /// meet, rounding may have them the wrong way round; the upper one then follows the lower.
    #[test]
    fn mirrored_depths_mirror_the_bounds(d in distribution(8), z in 0.0..=1.0_f64) {
        let m = moments(&d);
        let before = bounds(m, z);
        let after = trigonometric_4(m.mirrored(), HalfAngle::of_depth(z).mirrored());
        prop_assert_eq!(before.upper, (1.0 - after.lower).max(before.lower));
        prop_assert_eq!(after.upper, (1.0 - before.lower).max(after.lower));
        let crossed = before.lower + after.lower - 1.0;
        prop_assert!(crossed < 1e-9, "{before:?} {after:?}");
    }

    /// Below 0 lies nothing for sure; below 1, all but what one direction may weigh.
    #[test]
    fn ends_of_the_range(d in distribution(8)) {
        let m = moments(&d).biased(1e-3);
        prop_assert_eq!(bounds(m, 0.0).lower, 0.0);
        prop_assert_eq!(bounds(m, 1.0).upper, 1.0);
        let at_end = bounds(m, 0.0).upper;
        prop_assert!((bounds(m, 1.0).lower - (1.0 - at_end)).abs() < 1e-12);
        prop_assert!(at_end > 0.0 && at_end < 1.0);
    }

    /// The canonical representation with a point at 0 is where one formula gives way to another.
    /// The bound at its points is known, and continuous there.
    #[test]
    fn formulas_meet(first in 0.1..0.45_f64, second in 0.55..0.9_f64, w in prop::array::uniform3(0.1..=1.0_f64)) {
        let total: f64 = w.iter().sum();
        let d = Distribution(vec![(0.0, w[0] / total), (first, w[1] / total), (second, w[2] / total)]);
        let m = moments(&d);
        for (z, share) in [(first, 0.0), (second, w[1] / total)] {
            for step in [-1e-9, -1e-12, -1e-15, 0.0, 1e-15, 1e-12, 1e-9] {
                let lower = bounds(m, z + step).lower;
                prop_assert!((lower - share).abs() < 1e-6, "{step}: {lower} {share}");
            }
        }
    }

    /// Every bit pattern, NaN and infinity among them, gives shares in order.
    #[test]
    fn every_input_gives_shares(
        bits in prop::array::uniform6(any::<u32>()),
        plausible in prop::array::uniform6(prop::num::f32::NORMAL | prop::num::f32::SUBNORMAL | prop::num::f32::ZERO),
        small in prop::array::uniform6(-1.1..=1.1_f32),
        wide in prop::array::uniform6(any::<u64>()),
    ) {
        for [c1, s1, c2, s2, z, other] in [bits.map(f32::from_bits), plausible, small] {
            let m = TrigonometricMoments { c1, s1, c2, s2 };
            let by_vector = HalfAngle::of_vector(z, other);
            for bounds in [
                trigonometric_4(m, HalfAngle::of_depth(z)),
                trigonometric_4(m, by_vector),
                trigonometric_4_compensated(m, z),
            ] {
                prop_assert!(0.0 <= bounds.lower && bounds.lower <= bounds.upper, "{bounds:?}");
                prop_assert!(bounds.upper <= 1.0, "{bounds:?}");
            }
        }
        let [c1, s1, c2, s2, z, other] = wide.map(f64::from_bits);
        let m = TrigonometricMoments { c1, s1, c2, s2 };
        let by_vector = HalfAngle::of_vector(z, other);
        for bounds in [
            trigonometric_4(m, HalfAngle::of_depth(z)),
            trigonometric_4(m, by_vector),
            trigonometric_4_compensated(m, z),
        ] {
            prop_assert!(0.0 <= bounds.lower && bounds.lower <= bounds.upper, "{bounds:?}");
            prop_assert!(bounds.upper <= 1.0, "{bounds:?}");
        }
    }

    /// The same at the edge of what distributions can have.
    #[test]
    fn degenerate_moments_give_shares(
        d in distribution(2),
        noise in prop::array::uniform4(-1e-6..=1e-6_f32),
        on_a_surface in any::<bool>(),
        z in 0.0..=1.0_f32,
    ) {
        let z = if on_a_surface { d.0[0].0 as f32 } else { z };
        let m = single(moments(&d));
        for amount in [0.0, 0.01, 1.0] {
            let m = TrigonometricMoments {
                c1: m.c1 + amount * noise[0],
                s1: m.s1 + amount * noise[1],
                c2: m.c2 + amount * noise[2],
                s2: m.s2 + amount * noise[3],
            };
            let query = HalfAngle::of_depth(z);
            for bounds in [trigonometric_4(m, query), trigonometric_4_compensated(m, z)] {
                prop_assert!(0.0 <= bounds.lower && bounds.lower <= bounds.upper);
                prop_assert!(bounds.upper <= 1.0);
            }
        }
    }

    /// A direction given as a vector is the one given as a depth.
    #[test]
    fn vectors_and_depths_agree(z in 0.0..=1.0_f64, length in 1e-3..=1e3_f64, turned in any::<bool>()) {
        let length = if turned { -length } else { length };
        let by_depth = HalfAngle::of_depth(z);
        let by_vector = HalfAngle::of_vector(length * (PI * z).cos(), length * (PI * z).sin());
        // At both ends of the range the vectors are opposite.
        prop_assume!(z > 1e-9 && z < 1.0 - 1e-9);
        prop_assert!((by_depth.cos() - by_vector.cos()).abs() < 1e-15);
        prop_assert!((by_depth.sin() - by_vector.sin()).abs() < 1e-15);
    }
}

/// Depth to angle is as exact as the number type, in both.
#[test]
fn angles_are_exact_to_rounding() {
    let mut worst: [f64; 4] = [0.0; 4];
    for i in 0..=200_000 {
        let z = f64::from(i) / 200_000.0;
        let angle = HalfAngle::of_depth(z);
        let error = (angle.cos() - (PI * z).cos()).abs();
        worst[0] = worst[0]
            .max(error)
            .max((angle.sin() - (PI * z).sin()).abs());
        let z = z as f32;
        let angle = HalfAngle::of_depth(z);
        let (cos, sin) = ((PI * f64::from(z)).cos(), (PI * f64::from(z)).sin());
        let error = (f64::from(angle.cos()) - cos).abs();
        worst[1] = worst[1]
            .max(error)
            .max((f64::from(angle.sin()) - sin).abs());

        let exact = moments(&Distribution(vec![(z.into(), 1.0)]));
        let m = TrigonometricMoments::of_depth(f64::from(z));
        let n = double(TrigonometricMoments::of_depth(z));
        for (k, m) in [m, n].into_iter().enumerate() {
            for (a, b) in [
                (m.c1, exact.c1),
                (m.s1, exact.s1),
                (m.c2, exact.c2),
                (m.s2, exact.s2),
            ] {
                worst[2 + k] = worst[2 + k].max((a - b).abs());
            }
        }
    }
    println!(
        "half angle {:.1e} {:.1e}, moments {:.1e} {:.1e}",
        worst[0], worst[1], worst[2], worst[3]
    );
    let (double, single) = (f64::EPSILON, f64::from(f32::EPSILON));
    assert!(worst[0] < 2.0 * double, "{}", worst[0]);
    assert!(worst[1] < 2.0 * single, "{}", worst[1]);
    // Half of this is the rounding of the reference's angle, up to 4π.
    assert!(worst[2] < 16.0 * double, "{}", worst[2]);
    assert!(worst[3] < 5.0 * single, "{}", worst[3]);
    let at = |z: f64| HalfAngle::of_depth(z);
    assert_eq!((at(0.0).cos(), at(0.0).sin()), (1.0, 0.0));
    assert_eq!((at(0.5).cos(), at(0.5).sin()), (0.0, 1.0));
    assert_eq!((at(1.0).cos(), at(1.0).sin()), (-1.0, 0.0));
}

/// Conjecture 17 and everything that follows from it, against a linear programme.
#[test]
fn a_linear_programme_gives_the_same_bounds() {
    // 0 and 1 are the same direction: the grid has 0 once, and it counts as neither below nor above.
    let count = 360;
    let grid: Vec<f64> = (0..count)
        .map(|i| f64::from(i) / f64::from(count))
        .collect();
    let functions: [&dyn Fn(f64) -> f64; 4] = [
        &|z: f64| (TAU * z).cos(),
        &|z: f64| (TAU * z).sin(),
        &|z: f64| (2.0 * TAU * z).cos(),
        &|z: f64| (2.0 * TAU * z).sin(),
    ];
    let mut worst: f64 = 0.0;
    let mut compared = 0;
    let mut undecided = 0;
    for case in 0..100_u32 {
        // Three to six depths, spread over all of the range or over a part.
        let points = 3 + case % 4;
        let spread = if case % 3 == 0 { 0.3 } else { 1.0 };
        let d = Distribution(
            (0..points)
                .map(|i| {
                    let at = (f64::from(case * 7 + i + 1) * 0.618_033_988_749_895).fract();
                    let from = (f64::from(case) * 0.414_213_562_373_095).fract() * (1.0 - spread);
                    (
                        grid[((from + at * spread) * f64::from(count)) as usize],
                        1.0 / f64::from(points),
                    )
                })
                .collect(),
        );
        let means: Vec<_> = functions.iter().map(|f| (*f, mean(&d, f))).collect();
        for query in [17, 90, 149, 215, 271, 340] {
            let z = grid[query];
            let bounds = bounds(moments(&d), z);
            let Some((least, greatest)) =
                programme::bounds(&means, &grid, |x| x > 0.0 && x < z, |x| x <= z)
            else {
                continue;
            };
            assert!(least > bounds.lower - 1e-6, "{d:?} {z}: {least} {bounds:?}");
            assert!(
                greatest < bounds.upper + 1e-6,
                "{d:?} {z}: {greatest} {bounds:?}"
            );
            worst = worst.max(least - bounds.lower).max(bounds.upper - greatest);
            compared += 1;
            undecided += u32::from(bounds.lower > 0.01 && bounds.upper < 0.99);
        }
    }
    println!("{compared} compared, {undecided} not at an end, worst {worst:.1e}");
    assert!(compared >= 590, "{compared}");
    // Both neighbours on the arc and on its complement: the case that needs Newton's method.
    assert!(undecided >= 100, "{undecided}");
    assert!(worst < 2e-3, "{worst}");
}

/// f32 against f64 on the same rounded moments, with a bias as for four power moments.
#[test]
fn single_precision_is_close_to_double() {
    let mut runner = TestRunner::deterministic();
    let rows = distribution(6);
    let mut errors: Vec<f64> = (0..50_000)
        .map(|_| {
            let d = rows.new_tree(&mut runner).unwrap().current();
            let z = (0.0..=1.0_f32).new_tree(&mut runner).unwrap().current();
            let m = single(moments(&d).biased(3e-5));
            let exact = bounds(double(m), z.into());
            let bounds = trigonometric_4(m, HalfAngle::of_depth(z));
            (f64::from(bounds.lower) - exact.lower)
                .abs()
                .max((f64::from(bounds.upper) - exact.upper).abs())
        })
        .collect();
    errors.sort_by(f64::total_cmp);
    let quantile = |q: f64| errors[(q * (errors.len() - 1) as f64) as usize];
    println!(
        "50 % {:.1e}, 90 % {:.1e}, 99 % {:.1e}, all {:.1e}",
        quantile(0.5),
        quantile(0.9),
        quantile(0.99),
        quantile(1.0)
    );
    assert!(quantile(0.5) < 2e-7, "{}", quantile(0.5));
    assert!(quantile(0.99) < 2e-5, "{}", quantile(0.99));
    assert!(quantile(1.0) < 2e-3, "{}", quantile(1.0));
}
