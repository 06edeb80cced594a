//! Moments as a few depths.

#[allow(dead_code, reason = "each test needs some of it")]
mod common;

use common::{Distribution, distribution};
use hankel_moments::{
    Moments4, Moments6, degenerate_4, degenerate_6, hamburger_4, hamburger_6, sparse_2,
};
use proptest::prelude::*;

fn symmetric(d: &Distribution) -> Distribution {
    d.map(|z| 2.0 * z - 1.0)
}

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

/// Half of everything at both ends, half spread evenly: the bias of the 2016 supplement, on [-1, 1].
const INNER_4: Moments4<f64> = Moments4 {
    b1: 0.0,
    b2: 2.0 / 3.0,
    b3: 0.0,
    b4: 3.0 / 5.0,
};
const INNER_6: Moments6<f64> = Moments6 {
    b1: 0.0,
    b2: 2.0 / 3.0,
    b3: 0.0,
    b4: 3.0 / 5.0,
    b5: 0.0,
    b6: 4.0 / 7.0,
};

/// Depths at least 0.2 apart on [-1, 1], with shares of at least 1/30.
fn surfaces(count: usize) -> impl Strategy<Value = Distribution> {
    let spacing = 1.0 / count as f64;
    let one = (0.0..=spacing - 0.1, 0.1..=1.0_f64);
    prop::collection::vec(one, count).prop_map(move |points| {
        let total: f64 = points.iter().map(|(_, w)| w).sum();
        symmetric(&Distribution(
            points
                .iter()
                .enumerate()
                .map(|(i, (z, w))| (z + i as f64 * spacing, w / total))
                .collect(),
        ))
    })
}

/// Up to `most` depths on [-1, 1], all over it or close to each other, and often one at an end: the
/// background, which the others are in front of.
fn crowded(most: usize) -> impl Strategy<Value = Distribution> {
    let log_spread = -5.0..=0.0_f64;
    (distribution(most), log_spread, 0.0..=1.0_f64, 0..3_u8).prop_map(
        |(d, log_spread, place, end)| {
            let spread = 10.0_f64.powf(log_spread);
            let mut d = d.map(|z| (1.0 - spread) * place + spread * z);
            if end > 0 {
                let last = d.0.iter().fold(0.0_f64, |a, (z, _)| a.max(*z));
                d = d.map(|z| 1.0 - (last - z));
            }
            if end > 1 {
                d = d.map(|z| 1.0 - z);
            }
            symmetric(&d)
        },
    )
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 4000, max_global_rejects: 100_000, failure_persistence: None, ..ProptestConfig::default() })]

    /// Theorem 1: the two points have the three moments, and no distribution has a lesser fourth.
    #[test]
    fn two_points_have_three_moments(d in crowded(6)) {
        let m = d.moments();
        let points = sparse_2(m.b1, m.b2, m.b3);
        let back = points.moments();
        for (a, b) in [(m.b1, back.b1), (m.b2, back.b2), (m.b3, back.b3)] {
            prop_assert!((a - b).abs() < 1e-14, "{m:?} {points:?} {back:?}");
        }
        prop_assert!(back.b4 <= m.b4 + 1e-14, "{} {}", back.b4, m.b4);
        let excess = degenerate_4(m).excess;
        prop_assert!((m.b4 - back.b4 - excess).abs() < 1e-14);

        let (b1, b2, b3) = (m.b1 as f32, m.b2 as f32, m.b3 as f32);
        let back = sparse_2(b1, b2, b3).moments();
        for (a, b) in [(b1, back.b1), (b2, back.b2), (b3, back.b3)] {
            prop_assert!((a - b).abs() < 6.0 * f32::EPSILON, "{a} {b}");
        }
    }

    /// Theorem 1 as it is written, where it is well-conditioned.
    #[test]
    fn two_points_are_the_published_ones(d in surfaces(2), third in -1.0..=1.0_f64) {
        let d = Distribution(d.0.iter().map(|(z, w)| (*z, 0.8 * w)).chain([(third, 0.2)]).collect());
        let Moments4 { b1, b2, b3, .. } = d.moments();
        let (c2, c1, c0) = (b2 - b1 * b1, b1 * b2 - b3, b1 * b3 - b2 * b2);
        let root = (c1 * c1 - 4.0 * c2 * c0).sqrt();
        let (z2, z3) = ((-c1 - root) / (2.0 * c2), (-c1 + root) / (2.0 * c2));
        let w3 = (b1 - z2) / (z3 - z2);
        let points = sparse_2(b1, b2, b3);
        for (a, b) in [(points.z1, z2), (points.z2, z3), (points.w2, w3), (points.w1, 1.0 - w3)] {
            prop_assert!((a - b).abs() < 1e-11, "{a} {b}");
        }
    }

    /// Moved depths have moved points.
    #[test]
    fn two_points_move_with_depth(d in surfaces(3), scale in 0.2..=0.5_f64, shift in -0.5..=0.5_f64) {
        let at = |z: f64| -scale * z + shift;
        let points = |d: &Distribution| {
            let m = d.moments();
            sparse_2(m.b1, m.b2, m.b3)
        };
        let (before, after) = (points(&d), points(&d.map(at)));
        for (a, b) in [
            (after.z1, at(before.z2)),
            (after.z2, at(before.z1)),
            (after.w1, before.w2),
            (after.w2, before.w1),
        ] {
            prop_assert!((a - b).abs() < 1e-11, "{a} {b}");
        }
    }

    /// One and two surfaces are their own representation.
    #[test]
    fn degenerate_moments_give_back_two_surfaces(d in surfaces(2), z in -1.0..=1.0_f64) {
        let found = degenerate_4(d.moments());
        prop_assert!(found.excess < 1e-15, "{}", found.excess);
        let points = [(found.points.z1, found.points.w1), (found.points.z2, found.points.w2)];
        for ((z, w), (depth, share)) in points.iter().zip(&d.0) {
            prop_assert!((z - depth).abs() < 1e-13 && (w - share).abs() < 1e-13, "{found:?}");
        }
        prop_assert!(
            (found.points.below(z) - d.below(z)).abs() < 1e-13
                || d.0.iter().any(|(depth, _)| (depth - z).abs() < 1e-13)
        );
        let one = degenerate_4(Moments4::of_depth(z));
        // A point elsewhere has no weight.
        let p = one.points;
        let off = p.w1 * (p.z1 - z).abs() + p.w2 * (p.z2 - z).abs();
        prop_assert!(off < 3e-8, "{p:?}");
        prop_assert!(one.excess < 1e-15);
    }

    /// Gauss quadrature: the three points have the five moments, and no distribution has a lesser
    /// sixth.
    #[test]
    fn three_points_have_five_moments(d in crowded(6)) {
        let m = six(&d);
        let found = degenerate_6(m);
        let back = found.points.moments();
        for (a, b) in [(m.b1, back.b1), (m.b2, back.b2), (m.b3, back.b3), (m.b4, back.b4), (m.b5, back.b5)] {
            prop_assert!((a - b).abs() < 3e-14, "{m:?} {found:?} {back:?}");
        }
        prop_assert!((m.b6 - back.b6 - found.excess).abs() < 3e-14, "{m:?} {found:?}");
        prop_assert!(back.b6 <= m.b6 + 3e-14);

        let m = Moments6 {
            b1: m.b1 as f32, b2: m.b2 as f32, b3: m.b3 as f32, b4: m.b4 as f32, b5: m.b5 as f32, b6: m.b6 as f32,
        };
        let back = degenerate_6(m).points.moments();
        for (a, b) in [(m.b1, back.b1), (m.b2, back.b2), (m.b3, back.b3), (m.b4, back.b4), (m.b5, back.b5)] {
            prop_assert!((a - b).abs() < 30.0 * f32::EPSILON, "{m:?} {back:?}");
        }
    }

    /// One, two and three surfaces are their own representation. Points that are not needed have no
    /// weight, or are so near a surface that the weight there makes no difference to the moments:
    /// by rounding, weight times squared distance is at most of the size of epsilon, and so weight
    /// times distance, of its root.
    #[test]
    fn degenerate_moments_give_back_three_surfaces(d in (1..=3_usize).prop_flat_map(surfaces)) {
        let found = degenerate_6(six(&d));
        prop_assert!(found.excess < 1e-14, "{}", found.excess);
        let p = found.points;
        let mut shares = vec![0.0; d.0.len()];
        let mut moved = 0.0;
        for (z, w) in [(p.z1, p.w1), (p.z2, p.w2), (p.z3, p.w3)] {
            let nearest = (0..shares.len())
                .min_by(|&i, &j| (d.0[i].0 - z).abs().total_cmp(&(d.0[j].0 - z).abs()))
                .unwrap();
            shares[nearest] += w;
            moved += w * (d.0[nearest].0 - z).abs();
        }
        prop_assert!(moved < 3e-8, "{found:?}");
        for ((_, share), found) in d.0.iter().zip(shares) {
            prop_assert!((found - share).abs() < 1e-8, "{found:?}");
        }
    }

    /// The robust bounds run into the degenerate one: they are no farther apart than the excess
    /// over the square of the points' polynomial, and tend to the points' share at that rate.
    #[test]
    fn bounds_run_into_the_degenerate_case(d in surfaces(2), e in surfaces(3), z in -1.0..=1.0_f64) {
        prop_assume!(d.distance(z) > 0.05 && e.distance(z) > 0.05);
        for bias in [1e-5, 1e-7, 1e-9] {
            let m = d.moments().lerp(INNER_4, bias);
            let found = degenerate_4(m);
            let p = (z - found.points.z1) * (z - found.points.z2);
            let gap = found.excess / (p * p);
            let lower = hamburger_4(m, z);
            let below = found.points.below(z);
            prop_assert!((lower - below).abs() < 20.0 * gap + 1e-8, "{bias}: {lower} {below} {gap}");
            prop_assert!((below - d.below(z)).abs() < 100.0 * bias + 1e-12);

            let m = six(&e).lerp(INNER_6, bias);
            let found = degenerate_6(m);
            let points = found.points;
            let p = (z - points.z1) * (z - points.z2) * (z - points.z3);
            let gap = found.excess / (p * p);
            let bounds = hamburger_6(m, z);
            prop_assert!(bounds.upper - bounds.lower <= 1.001 * gap + 1e-8, "{bounds:?} {gap}");
            let below = points.below(z);
            prop_assert!((bounds.lower - below).abs() < 20.0 * gap + 1e-8, "{bounds:?} {below}");
        }
    }

    /// Every bit pattern, NaN and infinity among them, gives points in order and in range, and
    /// shares that add up.
    #[test]
    fn every_input_gives_points(
        bits in prop::array::uniform6(any::<u32>()),
        small in prop::array::uniform6(-1.1..=1.1_f32),
        wide in prop::array::uniform6(any::<u64>()),
        d in distribution(3),
    ) {
        let near = six(&symmetric(&d));
        let near = [near.b1, near.b2, near.b3, near.b4, near.b5, near.b6];
        let rows = [bits.map(f32::from_bits).map(f64::from), small.map(f64::from), wide.map(f64::from_bits), near];
        for row in rows {
            let [b1, b2, b3, b4, b5, b6] = row.map(|b| b as f32);
            let two = degenerate_4(Moments4 { b1, b2, b3, b4 });
            let p = two.points;
            prop_assert!(-1.0 <= p.z1 && p.z1 <= p.z2 && p.z2 <= 1.0, "{p:?}");
            prop_assert!(p.w1 >= 0.0 && p.w2 >= 0.0 && (p.w1 + p.w2 - 1.0).abs() < 1e-6, "{p:?}");
            prop_assert!(two.excess >= 0.0 && two.excess.is_finite());
            let three = degenerate_6(Moments6 { b1, b2, b3, b4, b5, b6 });
            let p = three.points;
            prop_assert!(-1.0 <= p.z1 && p.z1 <= p.z2 && p.z2 <= p.z3 && p.z3 <= 1.0, "{p:?}");
            prop_assert!(p.w1 >= 0.0 && p.w2 >= 0.0 && p.w3 >= 0.0, "{p:?}");
            prop_assert!((p.w1 + p.w2 + p.w3 - 1.0).abs() < 1e-6, "{p:?}");
            prop_assert!(three.excess >= 0.0 && three.excess.is_finite());
            let [b1, b2, b3, b4, b5, b6] = row;
            let p = degenerate_6(Moments6 { b1, b2, b3, b4, b5, b6 }).points;
            prop_assert!(-1.0 <= p.z1 && p.z1 <= p.z2 && p.z2 <= p.z3 && p.z3 <= 1.0, "{p:?}");
            prop_assert!(p.w1 >= 0.0 && p.w2 >= 0.0 && p.w3 >= 0.0, "{p:?}");
        }
    }
}
