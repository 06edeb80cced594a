//! Six moments: what must hold of the bounds, whatever computes them.

#[allow(dead_code, reason = "each test needs some of it")]
mod common;
mod programme;

use common::{Distribution, distribution};
use hankel_moments::{
    Moments4, Moments6, bound, degenerate_6, hamburger_4, hamburger_6, variance_2,
};
use proptest::prelude::*;
use proptest::strategy::ValueTree;
use proptest::test_runner::TestRunner;

/// What f64 leaves of six moments near a singularity.
const TOLERANCE: f64 = 1e-6;

fn six(d: &Distribution) -> Moments6<f64> {
    let m = |n| d.moment(n);
    Moments6 {
        b1: m(1),
        b2: m(2),
        b3: m(3),
        b4: m(4),
        b5: m(5),
        b6: m(6),
    }
}

fn four(m: Moments6<f64>) -> Moments4<f64> {
    Moments4 {
        b1: m.b1,
        b2: m.b2,
        b3: m.b3,
        b4: m.b4,
    }
}

fn symmetric(d: &Distribution) -> Distribution {
    d.map(|z| 2.0 * z - 1.0)
}

/// The moments of the uniform distribution on [-1, 1].
const UNIFORM: Moments6<f64> = Moments6 {
    b1: 0.0,
    b2: 1.0 / 3.0,
    b3: 0.0,
    b4: 1.0 / 5.0,
    b5: 0.0,
    b6: 1.0 / 7.0,
};

fn single(m: Moments6<f64>) -> Moments6<f32> {
    Moments6 {
        b1: m.b1 as f32,
        b2: m.b2 as f32,
        b3: m.b3 as f32,
        b4: m.b4 as f32,
        b5: m.b5 as f32,
        b6: m.b6 as f32,
    }
}

fn double(m: Moments6<f32>) -> Moments6<f64> {
    Moments6 {
        b1: m.b1.into(),
        b2: m.b2.into(),
        b3: m.b3.into(),
        b4: m.b4.into(),
        b5: m.b5.into(),
        b6: m.b6.into(),
    }
}

/// Three depths at least 0.2 apart, with shares of at least 1/21.
fn three_surfaces() -> impl Strategy<Value = Distribution> {
    let weights = prop::array::uniform3(0.1..=1.0_f64);
    (prop::array::uniform3(0.0..=0.2_f64), weights).prop_map(|(at, w)| {
        let total = w[0] + w[1] + w[2];
        Distribution(vec![
            (at[0], w[0] / total),
            (at[1] + 0.4, w[1] / total),
            (at[2] + 0.8, w[2] / total),
        ])
    })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 4000, failure_persistence: None, ..ProptestConfig::default() })]

    /// Chebyshev-Markov, on [0, 1] and on [-1, 1].
    #[test]
    fn the_distribution_lies_between_the_bounds(d in distribution(8), z in 0.0..=1.0_f64) {
        for (d, z) in [(d.clone(), z), (symmetric(&d), 2.0 * z - 1.0)] {
            let below = d.below(z);
            let bounds = hamburger_6(six(&d), z);
            let allowed = TOLERANCE + d.rounding(z, 3);
            prop_assert!(bounds.lower <= below + allowed, "{bounds:?} {below}");
            prop_assert!(below <= bounds.upper + allowed, "{bounds:?} {below}");
        }
    }

    /// Both bounds of up to three surfaces are their share, and a bias moves them in proportion.
    #[test]
    fn three_surfaces_are_exact(
        d in three_surfaces(),
        z in prop_oneof![-0.5..=-0.05_f64, 0.25..=0.35_f64, 0.65..=0.75_f64, 1.05..=1.5_f64],
    ) {
        let (d, z) = (symmetric(&d), 2.0 * z - 1.0);
        let below = d.below(z);
        let at = |bias| {
            let bounds = hamburger_6(six(&d).lerp(UNIFORM, bias), z);
            (bounds.lower - below).abs().max((bounds.upper - below).abs())
        };
        prop_assert!(at(0.0) < 1e-7, "{}", at(0.0));
        let slope = at(1e-6) / 1e-6;
        prop_assert!(slope < 1e5, "{slope}");
        for bias in [1e-7, 1e-8] {
            let error = at(bias);
            prop_assert!(error < 1.5 * slope * bias + 1e-7, "{bias}: {error}, {slope}");
        }
    }

    /// More moments, tighter bounds.
    #[test]
    fn bounds_tighten(d in distribution(8), z in 0.0..=1.0_f64) {
        let m = six(&d);
        let from_two = variance_2(m.b1, m.b2, z, 0.0);
        let from_four = hamburger_4(four(m), z);
        let from_six = hamburger_6(m, z).lower;
        let allowed = TOLERANCE + d.rounding(z, 3);
        prop_assert!(from_two <= from_four + allowed, "{from_two} {from_four}");
        prop_assert!(from_four <= from_six + allowed, "{from_four} {from_six}");
    }

    #[test]
    fn bounds_grow_with_depth(d in distribution(8), z in 0.0..=1.0_f64, step in 0.0..=0.2_f64) {
        let (near, far) = (hamburger_6(six(&d), z), hamburger_6(six(&d), z + step));
        let allowed = TOLERANCE + d.rounding(z, 3) + d.rounding(z + step, 3);
        prop_assert!(near.lower <= far.lower + allowed);
        prop_assert!(near.upper <= far.upper + allowed);
    }

    /// Proposition 20: the planes that depth is measured between do not matter. With enough
    /// surfaces, or the rounding of the moved moments is not negligible.
    #[test]
    fn affine_changes_of_depth_do_not_matter(
        d in distribution(8),
        z in 0.0..=1.0_f64,
        scale in 0.5..=1.0_f64,
        shift in -1.0..=0.0_f64,
        mirrored in any::<bool>(),
    ) {
        let d = Distribution(
            d.0.iter().map(|(z, w)| (*z, 0.9 * w))
                .chain((0..5).map(|i| (f64::from(i) / 4.0, 0.02)))
                .collect(),
        );
        let before = hamburger_6(six(&d), z);
        let sign = if mirrored { -1.0 } else { 1.0 };
        let at = |z: f64| sign * (scale * z + shift);
        let after = hamburger_6(six(&d.map(at)), at(z));
        let (lower, upper) = if mirrored {
            (1.0 - after.upper, 1.0 - after.lower)
        } else {
            (after.lower, after.upper)
        };
        prop_assert!((before.lower - lower).abs() < 1e-5, "{before:?} {lower}");
        prop_assert!((before.upper - upper).abs() < 1e-5, "{before:?} {upper}");
    }

    /// The general solver, by other roots and other weights.
    #[test]
    fn the_general_solver_agrees(d in distribution(8), z in 0.0..=1.0_f64) {
        let d = symmetric(&d);
        let z = 2.0 * z - 1.0;
        let m = six(&d).lerp(UNIFORM, 1e-4);
        let general = bound::<f64, 3>(
            [
                1.0, m.b1, m.b2, m.b3, m.b4, m.b5, m.b6, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0,
            ],
            z,
        );
        let special = hamburger_6(m, z);
        prop_assert!((general.lower - special.lower).abs() < TOLERANCE);
        prop_assert!((general.upper - special.upper).abs() < TOLERANCE);
    }

    /// Where a root is at infinity, z is a root of the third orthogonal polynomial: one of the
    /// degenerate points. There and around, bounds are finite, continuous and smooth.
    #[test]
    fn roots_at_infinity_are_nothing_special(d in distribution(8), which in 0..3_usize) {
        let m = six(&symmetric(&d)).lerp(UNIFORM, 1e-3);
        let points = degenerate_6(m).points;
        let z = [points.z1, points.z2, points.z3][which];
        let step = 1e-7;
        let lower: Vec<f64> = (-3..=3)
            .map(|i| hamburger_6(m, z + f64::from(i) * step).lower)
            .collect();
        let slopes: Vec<f64> = lower.windows(2).map(|pair| (pair[1] - pair[0]) / step).collect();
        for pair in slopes.windows(2) {
            prop_assert!(pair[0] >= -1e-3, "{slopes:?}");
            prop_assert!((pair[0] - pair[1]).abs() < 0.05 * (1.0 + pair[0].abs()), "{slopes:?}");
        }
    }

    /// Every bit pattern, NaN and infinity among them, gives shares in order.
    #[test]
    fn every_input_gives_shares(
        bits in prop::array::uniform7(any::<u32>()),
        plausible in prop::array::uniform7(prop::num::f32::NORMAL | prop::num::f32::SUBNORMAL | prop::num::f32::ZERO),
        small in prop::array::uniform7(-1.1..=1.1_f32),
        wide in prop::array::uniform7(any::<u64>()),
    ) {
        for [b1, b2, b3, b4, b5, b6, z] in [bits.map(f32::from_bits), plausible, small] {
            let bounds = hamburger_6(Moments6 { b1, b2, b3, b4, b5, b6 }, z);
            prop_assert!(0.0 <= bounds.lower && bounds.lower <= bounds.upper, "{bounds:?}");
            prop_assert!(bounds.upper <= 1.0, "{bounds:?}");
        }
        let [b1, b2, b3, b4, b5, b6, z] = wide.map(f64::from_bits);
        let bounds = hamburger_6(Moments6 { b1, b2, b3, b4, b5, b6 }, z);
        prop_assert!(0.0 <= bounds.lower && bounds.lower <= bounds.upper, "{bounds:?}");
        prop_assert!(bounds.upper <= 1.0, "{bounds:?}");
    }

    /// The same at the edge of what distributions can have: few surfaces, rounded, and a query on
    /// one of them.
    #[test]
    fn degenerate_moments_give_shares(
        d in distribution(3),
        noise in prop::array::uniform6(-1e-6..=1e-6_f32),
        on_a_surface in any::<bool>(),
        z in 0.0..=1.0_f32,
    ) {
        let z = if on_a_surface { d.0[0].0 as f32 } else { z };
        let m = single(six(&d));
        for amount in [0.0, 0.01, 1.0] {
            let m = Moments6 {
                b1: m.b1 + amount * noise[0],
                b2: m.b2 + amount * noise[1],
                b3: m.b3 + amount * noise[2],
                b4: m.b4 + amount * noise[3],
                b5: m.b5 + amount * noise[4],
                b6: m.b6 + amount * noise[5],
            };
            let bounds = hamburger_6(m, z);
            prop_assert!(0.0 <= bounds.lower && bounds.lower <= bounds.upper && bounds.upper <= 1.0);
        }
    }
}

/// Chebyshev polynomials span the same space as powers; a linear programme in powers is beyond its
/// solver's tolerances.
#[test]
fn a_linear_programme_gives_the_same_bounds() {
    // The Hamburger problem's distributions may be anywhere; farther out than this none is needed
    // for these moments.
    let grid: Vec<f64> = (0..=600).map(|i| f64::from(i) / 200.0 - 1.5).collect();
    let chebyshev = |n: i32| {
        move |z: f64| {
            let z = z / 1.5;
            match n {
                1 => z,
                2 => 2.0 * z * z - 1.0,
                3 => (4.0 * z * z - 3.0) * z,
                4 => (8.0 * z * z - 8.0) * z * z + 1.0,
                5 => ((16.0 * z * z - 20.0) * z * z + 5.0) * z,
                _ => ((32.0 * z * z - 48.0) * z * z + 18.0) * z * z - 1.0,
            }
        }
    };
    let functions: Vec<_> = (1..=6).map(chebyshev).collect();
    let mut compared = 0;
    let mut worst: f64 = 0.0;
    for case in 0..40_u32 {
        // Six depths on the grid, from a low-discrepancy sequence.
        let d = Distribution(
            (0..6_u32)
                .map(|i| {
                    let at = (f64::from(case * 6 + i + 1) * 0.618_033_988_749_895).fract();
                    (grid[100 + (at * 400.0) as usize], 1.0 / 6.0)
                })
                .collect(),
        );
        let means: Vec<(&dyn Fn(f64) -> f64, f64)> = functions
            .iter()
            .map(|f| {
                let mean = d.0.iter().map(|(z, w)| w * f(*z)).sum();
                (f as &dyn Fn(f64) -> f64, mean)
            })
            .collect();
        for query in [140, 220, 300, 391, 460] {
            let z = grid[query];
            let bounds = hamburger_6(six(&d), z);
            let Some((least, greatest)) = programme::bounds(&means, &grid, |x| x < z, |x| x <= z)
            else {
                continue;
            };
            // Fewer distributions live on the grid, so its bounds are tighter, or as tight.
            assert!(least > bounds.lower - 1e-5, "{least} {bounds:?}");
            assert!(greatest < bounds.upper + 1e-5, "{greatest} {bounds:?}");
            worst = worst.max(least - bounds.lower).max(bounds.upper - greatest);
            compared += 1;
        }
    }
    println!("{compared} compared, worst {worst:.1e}");
    assert!(compared >= 190, "{compared}");
    assert!(worst < 0.03, "{worst}");
}

/// f32 against f64 on the same rounded moments, with the uniform part that the supplement's bias
/// for six moments has.
#[test]
fn single_precision_is_close_to_double() {
    let mut runner = TestRunner::deterministic();
    let rows = distribution(6);
    let mut errors: Vec<f64> = (0..50_000)
        .map(|_| {
            let d = symmetric(&rows.new_tree(&mut runner).unwrap().current());
            let z = (-1.0..=1.0_f32).new_tree(&mut runner).unwrap().current();
            let m = single(six(&d).lerp(UNIFORM, 4e-3));
            let exact = hamburger_6(double(m), z.into());
            let bounds = hamburger_6(m, z);
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
    assert!(quantile(1.0) < 1e-3, "{}", quantile(1.0));
}
