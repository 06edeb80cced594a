//! Published biases, by what they must do.

mod validity;

use hankel_moments::bias::{
    Basis, Bias, CLAMPED_4_16, CLAMPED_6_10, HAUSDORFF_SYMMETRIC_4_16, HAUSDORFF_SYMMETRIC_4_32,
    HAUSDORFF_UNIT_4_16, PUBLISHED, SYMMETRIC_4_16, SYMMETRIC_4_16_LECTURE, SYMMETRIC_4_32,
    SYMMETRIC_6_16, SYMMETRIC_6_32, SYMMETRIC_8_32, SYMMETRIC_10_32, UNIT_4_16,
};
use hankel_moments::{
    Moments4, Moments6, bias_target, dequantize_symmetric_4, dequantize_symmetric_6,
    dequantize_unit_4, dequantize_unit_6, quantize_symmetric_4, quantize_symmetric_6,
    quantize_unit_4, quantize_unit_6,
};
use proptest::prelude::*;
use proptest::test_runner::{RngAlgorithm, TestRng};
use validity::{hankel_pivots, is_moments, is_positive};

fn low(bias: &Bias) -> f64 {
    match bias.basis {
        Basis::Unit => 0.0,
        Basis::Symmetric | Basis::Trigonometric => -1.0,
    }
}

fn power_biases() -> impl Iterator<Item = (&'static str, Bias)> {
    let power = |(_, b): &(&str, Bias)| b.basis != Basis::Trigonometric;
    PUBLISHED.into_iter().filter(power)
}

#[test]
fn the_table_is_in_order() {
    for (name, bias) in PUBLISHED {
        let begins = match bias.basis {
            Basis::Unit => ["UNIT_", "CLAMPED_"].iter().any(|w| name.starts_with(w)),
            Basis::Symmetric => name.starts_with("SYMMETRIC_"),
            Basis::Trigonometric => name.starts_with("TRIGONOMETRIC_"),
        };
        let count = match bias.basis {
            Basis::Trigonometric => bias.count / 2,
            _ => bias.count,
        };
        assert!(
            begins && name.contains(&format!("_{count}_{}", bias.bits)),
            "{name}"
        );
        assert_eq!(bias.target[0], 1.0, "{name}");
        assert!(
            bias.target[bias.count + 1..].iter().all(|x| *x == 0.0),
            "{name}"
        );
        assert!(bias.strength > 0.0 && bias.strength < 0.01, "{name}");
        let twins = PUBLISHED.iter().filter(|(n, b)| *n == name || *b == bias);
        assert_eq!(twins.count(), 1, "{name}");
    }
}

/// The bounds for any number of moments have the targets of the biases for 32-bit floats.
#[test]
fn the_bounds_mix_in_the_same_targets() {
    assert_eq!(bias_target::<f64, 2>(), SYMMETRIC_4_32.target);
    assert_eq!(bias_target::<f64, 3>(), SYMMETRIC_6_32.target);
    assert_eq!(bias_target::<f64, 4>(), SYMMETRIC_8_32.target);
    assert_eq!(bias_target::<f64, 5>(), SYMMETRIC_10_32.target);
}

/// Fewer bits and more moments need a stronger bias.
#[test]
fn strengths_grow_with_the_moments_and_as_bits_shrink() {
    for (name, a) in PUBLISHED {
        for (other, b) in PUBLISHED {
            let same = a.basis == b.basis;
            if same && a.count == b.count && a.bits < b.bits {
                assert!(a.strength > 10.0 * b.strength, "{name} {other}");
            }
            if same && a.count > b.count && a.bits <= b.bits {
                assert!(a.strength > b.strength, "{name} {other}");
            }
        }
    }
}

/// All but one target are inside the valid moments; that one is on the boundary, of two surfaces.
#[test]
fn targets_are_moments_of_distributions() {
    for (name, bias) in power_biases() {
        let m = &bias.target[..=bias.count];
        if bias == UNIT_4_16 {
            let pivots = hankel_pivots(m);
            assert!(
                pivots[0] > 0.0 && pivots[1] > 0.0 && pivots[2] == 0.0,
                "{pivots:?}"
            );
        } else {
            assert!(is_positive(m), "{name}: {:?}", hankel_pivots(m));
        }
    }
    for bias in [CLAMPED_4_16, CLAMPED_6_10] {
        assert!(is_moments(&bias.target[1..=bias.count], 0.0));
    }
}

/// Half a surface at each end and a uniform share, by summing them up.
#[test]
fn targets_for_clamped_depths_are_the_mixtures_they_are_said_to_be() {
    for (bias, uniform) in [(CLAMPED_4_16, 0.2), (CLAMPED_6_10, 0.5)] {
        let steps = 10_000;
        for i in 0..=bias.count {
            let power = |z: f64| z.powi(i as i32);
            let mean = (0..steps)
                .map(|k| power((f64::from(k) + 0.5) / f64::from(steps)))
                .sum::<f64>()
                / f64::from(steps);
            let ends = 0.5 * (power(0.0) + power(1.0));
            let mixed = (1.0 - uniform) * ends + uniform * mean;
            assert!((bias.target[i] - mixed).abs() < 1e-7, "{i}");
        }
    }
}

#[test]
fn structures_hold_the_same_numbers() {
    let four = SYMMETRIC_4_16_LECTURE.four();
    assert_eq!([four.b1, four.b2, four.b3, four.b4], [0.0, 0.63, 0.0, 0.63]);
    let six = SYMMETRIC_6_32.six();
    assert_eq!(
        [six.b1, six.b2, six.b3, six.b4, six.b5, six.b6],
        [0.0, 0.48, 0.0, 0.451, 0.0, 0.45]
    );
}

/// Depths in [low, 1]: some at the ends, most between.
fn depth(rng: &mut TestRng, low: f64, clamped: bool) -> f64 {
    match rng.random_range(0..4) {
        0 if clamped => low,
        1 if clamped => 1.0,
        _ => low + (1.0 - low) * rng.random::<f64>(),
    }
}

/// Moments 0 to `count` of one to `surfaces` depths.
fn moments(rng: &mut TestRng, bias: &Bias, surfaces: usize, clamped: bool) -> Vec<f64> {
    let depths: Vec<(f64, f64)> = (0..rng.random_range(1..=surfaces))
        .map(|_| (depth(rng, low(bias), clamped), 0.01 + rng.random::<f64>()))
        .collect();
    let total: f64 = depths.iter().map(|(_, w)| w).sum();
    (0..=bias.count as i32)
        .map(|i| depths.iter().map(|(z, w)| w / total * z.powi(i)).sum())
        .collect()
}

/// What storage in the bias's format leaves of moments.
fn stored(bias: &Bias, m: &[f64]) -> Vec<f64> {
    let four = |m: Moments4<f64>| vec![1.0, m.b1, m.b2, m.b3, m.b4];
    let six = |m: Moments6<f64>| vec![1.0, m.b1, m.b2, m.b3, m.b4, m.b5, m.b6];
    let of_four = || Moments4 {
        b1: m[1],
        b2: m[2],
        b3: m[3],
        b4: m[4],
    };
    let of_six = || Moments6 {
        b1: m[1],
        b2: m[2],
        b3: m[3],
        b4: m[4],
        b5: m[5],
        b6: m[6],
    };
    match (bias.basis, bias.count, bias.bits) {
        (Basis::Unit, 4, 16) => four(dequantize_unit_4(quantize_unit_4(of_four()).stored::<16>())),
        (Basis::Symmetric, 4, 16) => four(dequantize_symmetric_4(
            quantize_symmetric_4(of_four()).stored::<16>(),
        )),
        (Basis::Unit, 6, 10) => six(dequantize_unit_6(quantize_unit_6(of_six()).stored::<10>())),
        (Basis::Symmetric, 6, 16) => six(dequantize_symmetric_6(
            quantize_symmetric_6(of_six()).stored::<16>(),
        )),
        (Basis::Symmetric, _, 32) => m.iter().map(|x| f64::from(*x as f32)).collect(),
        other => panic!("no format for {other:?}"),
    }
}

/// The shares of moments that are invalid as stored, and with the bias.
fn invalid(bias: &Bias, surfaces: usize, clamped: bool) -> (f64, f64) {
    let mut rng = TestRng::deterministic_rng(RngAlgorithm::ChaCha);
    let draws = 50_000;
    let (mut before, mut after) = (0, 0);
    for _ in 0..draws {
        let exact = moments(&mut rng, bias, surfaces, clamped);
        let m = stored(bias, &exact);
        let biased: Vec<f64> = m
            .iter()
            .zip(bias.target)
            .map(|(m, t)| m + bias.strength * (t - m))
            .collect();
        before += usize::from(!is_positive(&m));
        after += usize::from(!is_positive(&biased));
    }
    (
        before as f64 / f64::from(draws),
        after as f64 / f64::from(draws),
    )
}

/// Moments of few surfaces lie on the boundary, and rounding puts more than half of them outside. The
/// symmetric biases bring all of those back; the others the shares that they were chosen for.
#[test]
fn a_bias_repairs_what_rounding_breaks() {
    for (bias, surfaces, limit) in [
        (UNIT_4_16, 2, 0.05),
        (CLAMPED_4_16, 2, 0.025),
        (CLAMPED_6_10, 3, 2e-4),
        (SYMMETRIC_4_16_LECTURE, 2, 0.0),
        (SYMMETRIC_4_16, 2, 0.0),
        (SYMMETRIC_4_32, 2, 0.0),
        (SYMMETRIC_6_16, 3, 0.0),
        (SYMMETRIC_6_32, 3, 0.0),
        (SYMMETRIC_8_32, 4, 0.0),
    ] {
        for clamped in [false, true] {
            let (before, after) = invalid(&bias, surfaces, clamped);
            println!("{bias:?}, clamped: {clamped}: invalid {before}, with the bias {after}");
            assert!(before > 0.5, "{bias:?}");
            if bias == UNIT_4_16 && clamped {
                // What the targets for clamped depths are for.
                let (_, better) = invalid(&CLAMPED_4_16, surfaces, clamped);
                assert!(after > 5.0 * better, "{after} {better}");
            } else {
                assert!(after <= limit, "{bias:?}, clamped: {clamped}: {after}");
            }
        }
    }
}

/// Toeplitz matrices of trigonometric moments: the bias adds its strength to every eigenvalue of a
/// single surface's singular matrix, so that the quadratic form is at least that.
#[test]
fn a_trigonometric_bias_makes_a_single_surface_positive_definite() {
    let mut rng = TestRng::deterministic_rng(RngAlgorithm::ChaCha);
    for (name, bias) in PUBLISHED {
        if bias.basis != Basis::Trigonometric {
            continue;
        }
        let m = bias.count / 2;
        let angle = 0.7_f64;
        // Cosine and sine of the j-th multiple, with the bias mixed in.
        let mixed: Vec<(f64, f64)> = (0..=m)
            .map(|j| {
                let at = |target: f64, x: f64| x + bias.strength * (target - x);
                let (sin, cos) = (angle * j as f64).sin_cos();
                let targets = match j {
                    0 => (bias.target[0], 0.0),
                    j => (bias.target[2 * j - 1], bias.target[2 * j]),
                };
                (at(targets.0, cos), at(targets.1, sin))
            })
            .collect();
        for _ in 0..1000 {
            let v: Vec<(f64, f64)> = (0..=m)
                .map(|_| (rng.random::<f64>() - 0.5, rng.random::<f64>() - 0.5))
                .collect();
            let norm: f64 = v.iter().map(|(re, im)| re * re + im * im).sum();
            let mut form = 0.0;
            for (j, (a, b)) in v.iter().enumerate() {
                for (k, (c, d)) in v.iter().enumerate() {
                    // conj(v_j) v_k times the moment of order j - k.
                    let (re, im) = (a * c + b * d, a * d - b * c);
                    let (cos, sin) = mixed[j.abs_diff(k)];
                    form += re * cos - if j >= k { im * sin } else { -im * sin };
                }
            }
            assert!(form > bias.strength * norm * (1.0 - 1e-6), "{name}: {form}");
        }
    }
}

/// The lesser of the two determinants that are positive for moments inside those of depths in the range, and of which one
/// is 0 on the boundary: of the moments' Hankel matrix, and of that of the distribution times x (1 - x) or 1 - x².
fn determinant_in_range(bias: &Bias) -> f64 {
    let [m0, m1, m2, m3, m4] = [0, 1, 2, 3, 4].map(|k| bias.target[k]);
    let (n0, n1, n2) = match bias.basis {
        Basis::Unit => (m1 - m2, m2 - m3, m3 - m4),
        _ => (m0 - m2, m1 - m3, m2 - m4),
    };
    let below = m0 * (m2 * m4 - m3 * m3) - m1 * (m1 * m4 - m2 * m3) + m2 * (m1 * m3 - m2 * m2);
    let above = n0 * n2 - n1 * n1;
    below.min(above)
}

#[test]
fn targets_for_depths_in_a_range_are_inside_it() {
    for published in [
        UNIT_4_16,
        SYMMETRIC_4_16,
        SYMMETRIC_4_16_LECTURE,
        SYMMETRIC_4_32,
    ] {
        assert!(
            determinant_in_range(&published).abs() < 1e-12,
            "{published:?}"
        );
    }
    for own in [
        HAUSDORFF_UNIT_4_16,
        HAUSDORFF_SYMMETRIC_4_16,
        HAUSDORFF_SYMMETRIC_4_32,
    ] {
        assert!(determinant_in_range(&own) > 1e-4, "{own:?}");
    }
}

/// Of the interval that moments 0 to 3 leave, the fourth is the middle.
#[test]
fn targets_for_depths_in_a_range_are_in_the_middle() {
    let [m0, m1, m2, m3, m4] = [0, 1, 2, 3, 4].map(|k| HAUSDORFF_UNIT_4_16.target[k]);
    assert_eq!(m1, 0.5);
    assert_eq!(m2, f64::midpoint(m1 * m1, m1));
    let least = m2 * m2 / m1;
    let most = m2 - (m1 - m2).powi(2) / (m0 - m1);
    assert!((m3 - f64::midpoint(least, most)).abs() < 1e-15);
    let least = (m2.powi(3) + m0 * m3 * m3 - 2.0 * m1 * m2 * m3) / (m0 * m2 - m1 * m1);
    let most = m3 - (m2 - m3).powi(2) / (m1 - m2);
    assert!((m4 - f64::midpoint(least, most)).abs() < 1e-15);
}
