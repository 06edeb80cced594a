//! Fourier series of a depth comparison: convolution shadow mapping (\[CSM\]).
//!
//! A square wave of period 2 is 1/2 + Σ 2/c_k sin(c_k t) with c_k = (2k - 1)π. At t = d - z it is the comparison of
//! a depth d with a receiver's z, both in [0, 1]: 1 if d is beyond z, 0 if it is before. By the sine's addition
//! theorem d and z come apart: means of sin(c_k d) and cos(c_k d) over a filter region give the mean of all
//! comparisons, for any z.
//!
//! Few terms rise slowly: they are 1/2 at t = 0, and again at t = -1 and 1, where the wave falls back.

use hankel_dsl::{Real, lit};

use crate::moments::{within, within_one};
use crate::trigonometric::HalfAngle;

/// Cosine and sine of c_k z for four k in sequence.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OddHarmonics<R> {
    /// cos(c_k z).
    pub cos: [R; 4],
    /// sin(c_k z).
    pub sin: [R; 4],
}

/// The angles' sum.
#[inline(always)]
fn turned<R: Real>((cos, sin): (R, R), (by_cos, by_sin): (R, R)) -> (R, R) {
    (cos * by_cos - sin * by_sin, sin * by_cos + cos * by_sin)
}

impl<R: Real> OddHarmonics<R> {
    /// Terms 1 to 4 and 5 to 8 of a depth, which is clamped to [0, 1].
    #[inline(always)]
    pub fn of_depth(z: R) -> [Self; 2] {
        let half = HalfAngle::of_depth(z);
        let step = half.direction();
        let first = (half.cos(), half.sin());
        let second = turned(first, step);
        let third = turned(second, step);
        let fourth = turned(third, step);
        // Four steps at once: 8πz.
        let two = turned(step, step);
        let four = turned(two, two);
        let beyond = |x| turned(x, four);
        let of = |a: (R, R), b: (R, R), c: (R, R), d: (R, R)| Self {
            cos: [a.0, b.0, c.0, d.0],
            sin: [a.1, b.1, c.1, d.1],
        };
        [
            of(first, second, third, fourth),
            of(beyond(first), beyond(second), beyond(third), beyond(fourth)),
        ]
    }

    /// Σ w_k (mean sin(c_k d) cos(c_k z) - mean cos(c_k d) sin(c_k z)): what these terms add to 1/2, for `mean` over
    /// depths d, this being of the receiver's depth z. Means are clamped to [-1, 1], and weights to [0, 1].
    #[inline(always)]
    pub fn sum(self, mean: Self, weights: [R; 4]) -> R {
        let one: R = lit!(1.0);
        let [c0, c1, c2, c3] = self.cos;
        let [s0, s1, s2, s3] = self.sin;
        let [mc0, mc1, mc2, mc3] = mean.cos;
        let [ms0, ms1, ms2, ms3] = mean.sin;
        let [w0, w1, w2, w3] = weights;
        let term = |w: R, sin: R, c: R, cos: R, s: R| {
            within(w, lit!(0.0), one) * (within_one(sin) * c - within_one(cos) * s)
        };
        let low = term(w0, ms0, c0, mc0, s0) + term(w1, ms1, c1, mc1, s1);
        let high = term(w2, ms2, c2, mc2, s2) + term(w3, ms3, c3, mc3, s3);
        low + high
    }
}

/// The share of light that arrives, in [0, 1], from what the terms add up to. A surface has 1/2 of its own comparison:
/// twice the series, cut at 1, has it lit (\[CSM\], scaling).
#[inline(always)]
pub fn fourier_light<R: Real>(sum: R) -> R {
    (sum * lit!(2.0) + lit!(1.0)).saturate()
}
