//! What must hold of every bound, whatever computes it.

#[allow(dead_code, reason = "each test needs some of it")]
mod common;

use common::{Distribution, distribution};
use hankel_moments::{
    Moments4, hamburger_4, hamburger_4_bounds, hausdorff_4, hausdorff_4_symmetric, variance_2,
};
use microlp::{ComparisonOp, OptimizationDirection, Problem};
use proptest::prelude::*;
use proptest::strategy::ValueTree;

/// What f64 leaves of a bound: the regularisation mixes in 1.8e-15, which a nearly singular Hankel
/// matrix turns into at most its square root, 4e-8, over the distance of the depths.
const TOLERANCE: f64 = 1e-6;

fn single(m: Moments4<f64>) -> Moments4<f32> {
    Moments4 {
        b1: m.b1 as f32,
        b2: m.b2 as f32,
        b3: m.b3 as f32,
        b4: m.b4 as f32,
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 2000, failure_persistence: None, ..ProptestConfig::default() })]

    /// Chebyshev-Markov: the bound lies below every distribution with the moments.
    #[test]
    fn bounds_lie_below_the_distribution(d in distribution(6), z in 0.0..=1.0_f64) {
        let m = d.moments();
        let most = d.below(z) + TOLERANCE + d.rounding(z, 2);
        prop_assert!(hamburger_4(m, z) <= most);
        prop_assert!(hausdorff_4(m, z) <= most);
        prop_assert!(variance_2(m.b1, m.b2, z, 0.0) <= most);
    }

    /// The upper bound is the lower one of what is mirrored at 0, taken from 1; between the two lies every
    /// distribution with the moments.
    #[test]
    fn an_upper_bound_is_a_mirrored_lower_one(d in distribution(6), z in 0.0..=1.0_f64) {
        let m = d.moments();
        let bounds = hamburger_4_bounds(m, z);
        prop_assert_eq!(bounds.lower, hamburger_4(m, z));
        let allowed = TOLERANCE + d.rounding(z, 2);
        prop_assert!(bounds.upper + allowed >= d.below(z) && bounds.upper <= 1.0);
        let mirrored = Moments4 { b1: -m.b1, b3: -m.b3, ..m };
        prop_assert!((bounds.upper + hamburger_4(mirrored, -z) - 1.0).abs() <= 2.0 * allowed);
    }

    /// Two surfaces are reconstructed exactly: the case that most filter regions are.
    #[test]
    fn two_surfaces_are_exact(
        near in 0.0..0.4_f64,
        far in 0.6..=1.0_f64,
        weight in 0.05..0.95_f64,
        z in 0.45..0.55_f64,
    ) {
        let d = Distribution(vec![(near, weight), (far, 1.0 - weight)]);
        prop_assert!((hamburger_4(d.moments(), z) - weight).abs() < TOLERANCE);
        prop_assert!((hausdorff_4(d.moments(), z) - weight).abs() < TOLERANCE);
    }

    /// More knowledge, tighter bounds: two moments, four, and four with a known range.
    #[test]
    fn bounds_tighten(d in distribution(6), z in 0.0..=1.0_f64) {
        let m = d.moments();
        let four = hamburger_4(m, z);
        let allowed = TOLERANCE + d.rounding(z, 2);
        prop_assert!(variance_2(m.b1, m.b2, z, 0.0) <= four + allowed);
        prop_assert!(four <= hausdorff_4(m, z) + allowed);
    }

    /// The least share below a depth cannot fall as the depth grows.
    #[test]
    fn bounds_grow_with_depth(d in distribution(6), z in 0.0..=1.0_f64, step in 0.0..=0.2_f64) {
        let m = d.moments();
        let farther = (z + step).min(1.0);
        let allowed = TOLERANCE + d.rounding(z, 2) + d.rounding(farther, 2);
        prop_assert!(hamburger_4(m, z) <= hamburger_4(m, farther) + allowed);
        prop_assert!(hausdorff_4(m, z) <= hausdorff_4(m, farther) + allowed);
    }

    /// Proposition 20: the Hamburger bound does not depend on where near and far plane are.
    #[test]
    fn affine_changes_of_depth_do_not_matter(d in distribution(6), z in 0.0..=1.0_f64) {
        let moved = d.map(|z| 2.0 * z - 1.0);
        let a = hamburger_4(d.moments(), z);
        let b = hamburger_4(moved.moments(), 2.0 * z - 1.0);
        // Where the bound jumps, the rounding of the moved moments may fall on either side.
        let jump = d.distance(z) < 1e-3;
        prop_assert!(jump || (a - b).abs() < 1e-4, "{a} {b}");
        let back = moved.moments().symmetric_to_unit();
        let m = d.moments();
        for (x, y) in [(back.b1, m.b1), (back.b2, m.b2), (back.b3, m.b3), (back.b4, m.b4)] {
            prop_assert!((x - y).abs() < 1e-14);
        }
    }

    /// Any finite input, valid or not, gives a number from 0 to 1.
    #[test]
    fn every_finite_input_gives_a_share(
        b in prop::array::uniform4(any::<f32>().prop_filter("finite", |x| x.is_finite())),
        z in any::<f32>().prop_filter("finite", |x| x.is_finite()),
        least in any::<f32>().prop_filter("finite", |x| x.is_finite()),
    ) {
        let m = Moments4 { b1: b[0], b2: b[1], b3: b[2], b4: b[3] };
        for share in [hamburger_4(m, z), hausdorff_4(m, z), variance_2(m.b1, m.b2, z, least)] {
            prop_assert!((0.0..=1.0).contains(&share), "{share}");
        }
    }

    /// The same near the edge of what distributions can have: quantised, truncated, duplicated.
    #[test]
    fn degenerate_moments_give_a_share(
        d in distribution(2),
        noise in prop::array::uniform4(-1e-6..=1e-6_f32),
        on_a_surface in any::<bool>(),
        z in 0.0..=1.0_f32,
    ) {
        let m = single(d.moments());
        let z = if on_a_surface { d.0[0].0 as f32 } else { z };
        for noise in [[0.0; 4], noise] {
            let m = Moments4 {
                b1: m.b1 + noise[0],
                b2: m.b2 + noise[1],
                b3: m.b3 + noise[2],
                b4: m.b4 + noise[3],
            };
            for share in [hamburger_4(m, z), hausdorff_4(m, z)] {
                prop_assert!((0.0..=1.0).contains(&share), "{share}");
            }
        }
    }
}

/// Nearly everything is at the ends, so that differences of values of the polynomial there cancel; by
/// their signs the bound was 0. The exact value is a linear programme's in 60 digits.
#[test]
#[allow(
    clippy::excessive_precision,
    reason = "the digits of the row as it was found"
)]
fn which_points_carry_weight_is_decided_by_the_weights() {
    let m = Moments4 {
        b1: 0.506_677_93_f32,
        b2: 0.506_673_93,
        b3: 0.506_671_91,
        b4: 0.506_670_71,
    };
    let found = hausdorff_4(m, 1.416_604_5e-6);
    assert!((found - 0.106_22).abs() < 1e-5, "{found}");
}

/// Algorithm 1: the least share below `z` over distributions on a grid, by linear programming.
fn linear_programme(m: Moments4<f64>, z: f64, grid: &[f64]) -> f64 {
    let mut problem = Problem::new(OptimizationDirection::Minimize);
    let weights: Vec<_> = grid
        .iter()
        .map(|depth| (problem.add_var(f64::from(*depth < z), (0.0, 1.0)), *depth))
        .collect();
    for (n, b) in [(0, 1.0), (1, m.b1), (2, m.b2), (3, m.b3), (4, m.b4)] {
        let row: Vec<_> = weights
            .iter()
            .map(|(w, depth)| (*w, depth.powi(n)))
            .collect();
        problem.add_constraint(row, ComparisonOp::Eq, b);
    }
    problem
        .solve()
        .expect("the distribution itself is feasible")
        .objective()
}

/// The closed forms against a linear programme, which knows nothing of moments' theory.
#[test]
fn a_linear_programme_gives_the_same_bound() {
    let grid: Vec<f64> = (0..=250).map(|i| f64::from(i) / 250.0).collect();
    let mut worst: f64 = 0.0;
    let mut compared = 0;
    for case in 0..60_u32 {
        // Five depths on the grid, from a low-discrepancy sequence.
        let points = (0..5_u32)
            .map(|i| {
                let at = (f64::from(case * 5 + i + 1) * 0.618_033_988_749_895).fract();
                (grid[(at * 250.0) as usize], 0.2)
            })
            .collect();
        let m = Distribution(points).moments();
        for query in [23, 77, 125, 180, 231] {
            let z = grid[query];
            let exact = hausdorff_4(m, z);
            let programme = linear_programme(m, z, &grid);
            // Fewer distributions live on the grid, so its least share is larger.
            assert!(programme > exact - 1e-6, "{programme} {exact}");
            worst = worst.max(programme - exact);
            compared += 1;
        }
    }
    assert_eq!(compared, 300);
    // A grid point off by half a step (1/500) moves a weight by about as much over the distance of
    // two support points, of which the closest here are a few steps apart.
    assert!(worst < 0.02, "{worst}");
}

/// Errors of an f32 bound against the same in f64, sorted, over regions of up to four surfaces
/// with the recommended bias.
fn errors(
    bound: impl Fn(Moments4<f32>, f32) -> f32,
    exact: impl Fn(Moments4<f64>, f64) -> f64,
) -> Vec<f64> {
    let mut runner = proptest::test_runner::TestRunner::deterministic();
    let half = Moments4 {
        b1: 0.5,
        b2: 0.5,
        b3: 0.5,
        b4: 0.5,
    };
    let mut errors: Vec<f64> = (0..50_000)
        .map(|_| {
            let d = distribution(4).new_tree(&mut runner).unwrap().current();
            let z = (0.0..=1.0_f64).new_tree(&mut runner).unwrap().current() as f32;
            let m = single(d.moments().lerp(half, 3e-5));
            let double = Moments4 {
                b1: f64::from(m.b1),
                b2: f64::from(m.b2),
                b3: f64::from(m.b3),
                b4: f64::from(m.b4),
            };
            let error = (f64::from(bound(m, z)) - exact(double, f64::from(z))).abs();
            // The published form may give NaN: as wrong as can be.
            if error.is_finite() { error } else { 1.0 }
        })
        .collect();
    errors.sort_by(f64::total_cmp);
    errors
}

/// Prints and compares the quantiles of two sorted lists of errors.
fn no_worse(name: &str, robust: &[f64], published: &[f64]) {
    for q in [0.5, 0.9, 0.99, 0.999, 0.9999] {
        let at = (q * (robust.len() - 1) as f64) as usize;
        println!(
            "{name} {q}: robust {:.1e}, published {:.1e}",
            robust[at], published[at]
        );
        assert!(
            robust[at] <= published[at],
            "{name}, quantile {q}: {} > {}",
            robust[at],
            published[at]
        );
    }
}

const NO_BIAS: hankel_listing::Biases<f32> = hankel_listing::Biases {
    moment_bias: 0.0,
    depth_bias: 0.0,
};

/// In single precision the robust forms are at least as accurate as the published ones.
#[test]
fn single_precision_is_no_worse_than_published() {
    let hamburger = |moments, depth| {
        let receiver = hankel_listing::Receiver { moments, depth };
        hankel_listing::hamburger_listing(&NO_BIAS, receiver).shadow
    };
    let hausdorff = |moments, depth| {
        let receiver = hankel_listing::Receiver { moments, depth };
        hankel_listing::hausdorff_listing(&NO_BIAS, receiver).shadow
    };
    no_worse(
        "Hamburger",
        &errors(hamburger_4, hamburger_4),
        &errors(hamburger, hamburger_4),
    );
    no_worse(
        "Hausdorff",
        &errors(hausdorff_4, hausdorff_4),
        &errors(hausdorff, hausdorff_4),
    );
}

/// Moments of depths in [-1, 1] with the bias for 32-bit floats, of one or two thin surfaces, and a depth
/// on one of them.
fn thin_surfaces(case: u32) -> (Moments4<f64>, f64) {
    let at = |i: u32| (f64::from(case * 8 + i + 1) * 0.618_033_988_749_895).fract();
    let thickness = 10.0_f64.powf(-3.5 + 2.0 * at(0));
    let (near, far) = (1.4 * at(1) - 0.6, 1.4 * at(2) - 0.6);
    let share = if case.is_multiple_of(2) { 1.0 } else { at(3) };
    let mut m = [0.0; 4];
    for i in 0..12 {
        let spread = thickness * (f64::from(i) / 5.5 - 1.0);
        for (weight, depth) in [(share, near), (1.0 - share, far)] {
            let x = depth + spread;
            for (k, moment) in m.iter_mut().enumerate() {
                *moment += weight / 12.0 * x.powi(k as i32 + 1);
            }
        }
    }
    let target = [0.0, 0.375, 0.0, 0.375];
    let [b1, b2, b3, b4] = core::array::from_fn(|k| m[k] + 5e-7 * (target[k] - m[k]));
    let depth = near + thickness * (2.0 * at(4) - 1.0) - 0.002;
    (Moments4 { b1, b2, b3, b4 }, depth)
}

/// On [-1, 1] the bound is that of [0, 1], and needs no moments that were moved there: in `f32` these
/// lose what a small bias protects.
#[test]
fn symmetric_depths_need_not_be_moved() {
    let (mut direct, mut moved) = (Vec::new(), Vec::new());
    for case in 0..20_000 {
        let (m, z) = thin_surfaces(case);
        let exact = hausdorff_4_symmetric(m, z);
        let same = hausdorff_4(m.symmetric_to_unit(), 0.5 * z + 0.5);
        assert!((exact - same).abs() < 1e-4, "{case}: {exact} {same}");
        let single = Moments4 {
            b1: m.b1 as f32,
            b2: m.b2 as f32,
            b3: m.b3 as f32,
            b4: m.b4 as f32,
        };
        let error = |found: f32| (f64::from(found) - exact).abs();
        direct.push(error(hausdorff_4_symmetric(single, z as f32)));
        let there = hausdorff_4(single.symmetric_to_unit(), 0.5 * z as f32 + 0.5);
        moved.push(error(there));
    }
    let at = |errors: &mut Vec<f64>, q: f64| {
        errors.sort_by(f64::total_cmp);
        errors[(q * (errors.len() - 1) as f64) as usize]
    };
    for q in [0.99, 0.999] {
        let (direct, moved) = (at(&mut direct, q), at(&mut moved, q));
        println!("{q}: {direct:.1e}, moved to [0, 1] {moved:.1e}");
        assert!(direct < 0.5 * moved, "{q}: {direct:e} {moved:e}");
    }
}
