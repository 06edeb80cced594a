//! Optimised quantisation, by what it must do.

#[allow(dead_code, reason = "shared with the other tests")]
mod common;

use common::distribution;
use hankel_moments::{
    Moments4, Quantized4, dequantize_symmetric_4, dequantize_unit_4, quantize_symmetric_4, quantize_unit_4,
};
use proptest::prelude::*;

type Basis = (
    fn(Moments4<f64>) -> Quantized4<f64>,
    fn(Quantized4<f64>) -> Moments4<f64>,
);

const UNIT: Basis = (quantize_unit_4, dequantize_unit_4);
const SYMMETRIC: Basis = (quantize_symmetric_4, dequantize_symmetric_4);

fn channels(q: Quantized4<f64>) -> [f64; 4] {
    [q.r, q.g, q.b, q.a]
}

fn powers(m: Moments4<f64>) -> [f64; 4] {
    [m.b1, m.b2, m.b3, m.b4]
}

/// log2 of the volume that the transform makes of a unit cube.
fn bits(quantize: fn(Moments4<f64>) -> Quantized4<f64>) -> f64 {
    let at = |b: [f64; 4]| {
        channels(quantize(Moments4 {
            b1: b[0],
            b2: b[1],
            b3: b[2],
            b4: b[3],
        }))
    };
    let origin = at([0.0; 4]);
    let mut rows: Vec<[f64; 4]> = (0..4)
        .map(|i| {
            let mut b = [0.0; 4];
            b[i] = 1.0;
            let v = at(b);
            core::array::from_fn(|j| v[j] - origin[j])
        })
        .collect();
    let mut determinant = 1.0;
    for i in 0..4 {
        let pivot = (i..4)
            .max_by(|a, b| rows[*a][i].abs().total_cmp(&rows[*b][i].abs()))
            .unwrap();
        rows.swap(i, pivot);
        determinant *= rows[i][i];
        for k in i + 1..4 {
            let factor = rows[k][i] / rows[i][i];
            let upper = rows[i];
            for (x, u) in rows[k].iter_mut().zip(upper) {
                *x -= factor * u;
            }
        }
    }
    f64::abs(determinant).log2()
}

#[test]
fn the_curve_of_depths_fills_the_cube_and_stays_in_it() {
    for ((quantize, _), low) in [(UNIT, 0.0), (SYMMETRIC, -1.0)] {
        let (mut least, mut most) = ([9.0_f64; 4], [-9.0_f64; 4]);
        for i in 0..=100_000 {
            let z = low + (1.0 - low) * f64::from(i) / 100_000.0;
            for (c, x) in channels(quantize(Moments4::of_depth(z)))
                .into_iter()
                .enumerate()
            {
                least[c] = least[c].min(x);
                most[c] = most[c].max(x);
            }
        }
        for c in 0..4 {
            // The published digits reach 7e-8; a 16-bit step is 1.5e-5.
            assert!(least[c] > -5e-7 && least[c] < 1e-3, "{least:?}");
            assert!(most[c] < 1.0 + 5e-7 && most[c] > 0.999, "{most:?}");
        }
    }
}

#[test]
fn the_gain_is_the_published_one() {
    assert!(
        (bits(quantize_unit_4) - 12.28).abs() < 0.005,
        "{}",
        bits(quantize_unit_4)
    );
    // Moving the range to [-1, 1] stretches the four powers by 2, 4, 8 and 16: 10 bits.
    let symmetric = bits(quantize_symmetric_4) + 10.0;
    assert!((symmetric - 12.28).abs() < 0.3, "{symmetric}");
}

proptest! {
    #[test]
    fn back_and_forth_is_the_identity(d in distribution(5)) {
        let unit = d.moments();
        let symmetric = d.map(|z| 2.0 * z - 1.0).moments();
        for ((quantize, dequantize), m, digits) in
            [(UNIT, unit, 1e-9), (SYMMETRIC, symmetric, 1e-14)]
        {
            for (a, b) in powers(dequantize(quantize(m))).into_iter().zip(powers(m)) {
                prop_assert!((a - b).abs() < digits, "{a} {b}");
            }
        }
    }
}
