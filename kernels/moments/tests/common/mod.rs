//! Distributions of depths, and what is true of them by definition.

use hankel_moments::Moments4;
use proptest::prelude::*;

/// Depths with weights that add up to 1.
#[derive(Clone, Debug)]
pub struct Distribution(pub Vec<(f64, f64)>);

impl Distribution {
    /// The share strictly below `z`.
    pub fn below(&self, z: f64) -> f64 {
        self.0
            .iter()
            .filter(|(depth, _)| *depth < z)
            .map(|(_, w)| w)
            .sum()
    }

    /// From `z` to the nearest depth.
    pub fn distance(&self, z: f64) -> f64 {
        self.0
            .iter()
            .map(|(depth, _)| (depth - z).abs())
            .fold(f64::INFINITY, f64::min)
    }

    /// By how much rounding of 2n moments may move a bound at `z`: what was rounded off over the
    /// square of the polynomial with the n nearest depths as roots (`degenerate.rs`).
    pub fn rounding(&self, z: f64, n: usize) -> f64 {
        let mut squares: Vec<f64> = self
            .0
            .iter()
            .map(|(depth, _)| (depth - z).powi(2))
            .collect();
        squares.sort_by(f64::total_cmp);
        1e-15 / squares.iter().take(n).product::<f64>()
    }

    /// The mean of the `n`-th power.
    pub fn moment(&self, n: i32) -> f64 {
        self.0.iter().map(|(z, w)| w * z.powi(n)).sum()
    }

    pub fn moments(&self) -> Moments4<f64> {
        let m = |n| self.moment(n);
        Moments4 {
            b1: m(1),
            b2: m(2),
            b3: m(3),
            b4: m(4),
        }
    }

    /// Depths through `f`.
    pub fn map(&self, f: impl Fn(f64) -> f64) -> Self {
        Self(self.0.iter().map(|(z, w)| (f(*z), *w)).collect())
    }
}

/// One to `most` depths in [0, 1].
pub fn distribution(most: usize) -> impl Strategy<Value = Distribution> {
    prop::collection::vec((0.0..=1.0_f64, 0.05..=1.0_f64), 1..=most).prop_map(|points| {
        let total: f64 = points.iter().map(|(_, w)| w).sum();
        Distribution(points.into_iter().map(|(z, w)| (z, w / total)).collect())
    })
}

/// Numbers that are out of range, at its ends, or no numbers at all, among ordinary ones.
pub fn awkward() -> impl Strategy<Value = f64> {
    prop_oneof![
        -2.0..2.0_f64,
        prop::sample::select(vec![
            0.0,
            -0.0,
            1.0,
            -1.0,
            0.5,
            1e-30,
            1e30,
            1e-42,
            1e37,
            3e38,
            -3e38,
            1e-7,
            f64::NAN,
            f64::INFINITY,
            f64::NEG_INFINITY,
        ]),
    ]
}
