//! The degenerate case: moments that only one distribution has.
//!
//! 2n moments whose Hankel matrix is singular belong to exactly one distribution, and it has at
//! most n points: the roots of the polynomial in the matrix' kernel (\[MSM\], Proposition 4 and its
//! proof). Every bound is then that distribution's own share, [`TwoPoints::below`] or
//! [`ThreePoints::below`].
//!
//! The polynomial needs all moments but the last, and with any last moment these points are still
//! the distribution with the least one. So the functions here give, for any moments, these points
//! and by how much the last moment exceeds theirs: the last pivot of the Hankel matrix, 0 if and
//! only if the case is degenerate. [`hamburger_4`](crate::hamburger_4) and
//! [`hamburger_6`](crate::hamburger_6) run into it continuously: their bounds at `z` are at most
//! `excess / p(z)²` apart, where p is the polynomial with the points as roots, and between points
//! they tend to their share at that rate. On a point itself the lower bound tends to the share
//! below it, the upper one to that and the point's own weight.

use hankel_dsl::{Element, Real, lit};

use crate::moments::within_one;
use crate::orthogonal::{Recurrence, positive_root};
use crate::sparse::{TwoPoints, sparse_2};
use crate::{Moments4, Moments6};

/// The two points for four moments.
#[derive(Clone, Copy, Debug, PartialEq, Element)]
#[repr(C)]
pub struct Degenerate4<R> {
    /// The distribution with the same first three moments and the least fourth one.
    pub points: TwoPoints<R>,
    /// By how much the fourth moment exceeds theirs, at least 0.
    pub excess: R,
}

/// A distribution of three depths.
#[derive(Clone, Copy, Debug, PartialEq, Element)]
#[repr(C)]
pub struct ThreePoints<R> {
    /// The nearest depth, in [-1, 1].
    pub z1: R,
    /// The middle depth; never less than `z1`.
    pub z2: R,
    /// The farthest depth, in [-1, 1]; never less than `z2`.
    pub z3: R,
    /// Share at the nearest depth, in [0, 1].
    pub w1: R,
    /// Share at the middle depth, in [0, 1].
    pub w2: R,
    /// Share at the farthest depth, in [0, 1]; the three add up to 1.
    pub w3: R,
}

/// The three points for six moments.
#[derive(Clone, Copy, Debug, PartialEq, Element)]
#[repr(C)]
pub struct Degenerate6<R> {
    /// The distribution with the same first five moments and the least sixth one.
    pub points: ThreePoints<R>,
    /// By how much the sixth moment exceeds theirs, at least 0.
    pub excess: R,
}

/// The two points that explain four moments if any two do.
///
/// The arguments are clamped to [-1, 1]; see [`sparse_2`].
#[inline(always)]
pub fn degenerate_4<R: Real>(m: Moments4<R>) -> Degenerate4<R> {
    let zero: R = lit!(0.0);
    let Moments4 { b1, b2, b3, b4 } = m.clamped();
    let variance = (b2 - b1 * b1).max(R::epsilon() * R::epsilon());
    let covariance = b3 - b1 * b2;
    // |covariance| is at most twice the variance for depths in [-1, 1].
    let slope = (covariance / variance).clamp(lit!(-2.0), lit!(2.0));
    Degenerate4 {
        points: sparse_2(b1, b2, b3),
        excess: (b4 - b2 * b2 - slope * covariance).max(zero),
    }
}

/// The three points that explain six moments if any three do.
///
/// The arguments are clamped to [-1, 1]. Moments of fewer points give these points, and others
/// with no weight; moments that no distribution on [-1, 1] has, the points of a nearby vector.
///
/// The points of the two lower moments lie between the three, so the outer ones are each the only
/// root beyond one of them, and the weights are those of Gauss quadrature: quotients of sums of
/// squares.
#[inline(always)]
pub fn degenerate_6<R: Real>(m: Moments6<R>) -> Degenerate6<R> {
    let zero: R = lit!(0.0);
    let one: R = lit!(1.0);
    let two: R = lit!(2.0);
    let Recurrence {
        a0,
        a1,
        a2,
        c1,
        c2,
        c3,
    } = Recurrence::new(m).within_range();
    // Roots of the quadratic, and the cubic about the upper one and about the lower one.
    let middle = (a0 + a1) * lit!(0.5);
    let half = (a0 - a1) * lit!(0.5);
    let radius = (half * half + c1).sqrt();
    let (low, high) = (middle - radius, middle + radius);
    let far = half.abs() + radius;
    let near = c1 / far;
    // Distances of the mean from both, without cancellation.
    let is_low = half.lt(zero);
    let from_low = R::select(is_low, near, far);
    let from_high = R::select(is_low, far, near);
    let reach = radius * two;
    let up = positive_root(high - a2 + reach, (high - a2) * reach - c2, from_high * c2);
    let down = positive_root(a2 - low + reach, (a2 - low) * reach - c2, from_low * c2);
    let z1 = low - down;
    let z3 = high + up;
    let z2 = (a0 - z1 + a1 - z3 + a2).clamp(low, high);

    let w1 = weight(c1, c2, from_low + down, (reach + down) * down);
    let w3 = weight(c1, c2, from_high + up, (reach + up) * up).min(one - w1);
    let z1 = within_one(z1);
    let z2 = within_one(z2).max(z1);
    Degenerate6 {
        points: ThreePoints {
            z1,
            z2,
            z3: within_one(z3).max(z2),
            w1,
            w2: one - w1 - w3,
            w3,
        },
        excess: c1 * c2 * c3,
    }
}

/// The weight of a point where the orthogonal polynomials of degree 1 and 2 are `p1` and `p2`.
#[inline(always)]
fn weight<R: Real>(c1: R, c2: R, p1: R, p2: R) -> R {
    let scale = (p1 * p1 + c1) * c2;
    c1 * c2 / (scale + p2 * p2)
}

impl<R: Real> ThreePoints<R> {
    /// The share strictly below `z`.
    #[inline(always)]
    pub fn below(self, z: R) -> R {
        let zero: R = lit!(0.0);
        let first = R::select(self.z1.lt(z), self.w1, zero);
        let second = R::select(self.z2.lt(z), self.w2, zero);
        first + second + R::select(self.z3.lt(z), self.w3, zero)
    }

    /// Its first six moments; the first five are those that it was made from.
    #[inline(always)]
    pub fn moments(self) -> Moments6<R> {
        let [x, y, z] = [self.z1, self.z2, self.z3].map(Moments6::of_depth);
        let mean = |x: R, y: R, z: R| x * self.w1 + y * self.w2 + z * self.w3;
        Moments6 {
            b1: mean(x.b1, y.b1, z.b1),
            b2: mean(x.b2, y.b2, z.b2),
            b3: mean(x.b3, y.b3, z.b3),
            b4: mean(x.b4, y.b4, z.b4),
            b5: mean(x.b5, y.b5, z.b5),
            b6: mean(x.b6, y.b6, z.b6),
        }
    }
}
