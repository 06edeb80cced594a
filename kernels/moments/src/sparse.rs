//! Three moments as two depths: the sparse representation that moments are resampled by.

use hankel_dsl::{Element, Real, lit};

use crate::Moments4;
use crate::moments::within_one;

/// A distribution of two depths.
#[derive(Clone, Copy, Debug, PartialEq, Element)]
#[repr(C)]
pub struct TwoPoints<R> {
    /// The nearer depth, in [-1, 1].
    pub z1: R,
    /// The farther depth, in [-1, 1]; never less than `z1`.
    pub z2: R,
    /// Share at the nearer depth, in [0, 1].
    pub w1: R,
    /// Share at the farther depth, in [0, 1]; with `w1` it adds up to 1.
    pub w2: R,
}

impl<R: Real> TwoPoints<R> {
    /// The share strictly below `z`.
    #[inline(always)]
    pub fn below(self, z: R) -> R {
        let zero: R = lit!(0.0);
        let first = R::select(self.z1.lt(z), self.w1, zero);
        first + R::select(self.z2.lt(z), self.w2, zero)
    }

    /// Its first four moments; the first three are those that it was made from.
    #[inline(always)]
    pub fn moments(self) -> Moments4<R> {
        Moments4::of_depth(self.z1).lerp(Moments4::of_depth(self.z2), self.w2)
    }
}

/// The distribution of two depths with mean `b1`, mean square `b2` and mean cube `b3`
/// (\[BHS\], Theorem 1 of the supplement).
///
/// Of all distributions with these three moments it has the least fourth one. The arguments are
/// clamped to [-1, 1]; moments that no distribution on [-1, 1] has give the points of a nearby
/// vector. Without variance, one point is at the mean and the other either close to it, at most the
/// root of epsilon away, or without weight.
///
/// Theorem 1 takes roots of the quadratic σ² z² + (b1 b2 - b3) z + c0; c0 follows from the other
/// two by the Hankel matrix' Cholesky factors, that is, from the quadratic about the mean being
/// x² - κ x - σ², κ the third central moment over the variance. Here these roots are taken: of
/// opposite signs, their product -σ², so neither they nor the weights σ² / (x² + σ²) cancel. Any
/// pair with that product has the mean and the variance. So where rounding of κ has pushed a root
/// out of [-1, 1], the pair is moved back together, which changes the third moment alone, by no
/// more than that rounding did.
#[inline(always)]
pub fn sparse_2<R: Real>(b1: R, b2: R, b3: R) -> TwoPoints<R> {
    let one: R = lit!(1.0);
    let two: R = lit!(2.0);
    let (b1, b2, b3) = (within_one(b1), within_one(b2), within_one(b3));
    let variance = (b2 - b1 * b1).max(R::epsilon() * R::epsilon());
    // Depths are within 2 of each other, so the third central moment is within 2 variances of 0.
    let skew = ((b3 - b1 * b2) / variance - b1 * two).clamp(-two, two);
    let half = skew * lit!(0.5);
    // The farther root from the mean, the nearer one and their weights, as magnitudes.
    let far_is_above = half.ge(lit!(0.0));
    let room_below = (one + b1).max(R::epsilon());
    let room_above = (one - b1).max(R::epsilon());
    let least_far = variance / R::select(far_is_above, room_below, room_above);
    let far = half.abs() + (half * half + variance).sqrt();
    let far = far
        .max(least_far)
        .min(R::select(far_is_above, room_above, room_below));
    let near = variance / far;
    let far_weight = variance / (far * far + variance);
    let near_weight = one - far_weight;
    let below = R::select(far_is_above, near, far);
    let above = R::select(far_is_above, far, near);
    TwoPoints {
        z1: (b1 - below).max(-one),
        z2: (b1 + above).min(one),
        w1: R::select(far_is_above, near_weight, far_weight),
        w2: R::select(far_is_above, far_weight, near_weight),
    }
}
