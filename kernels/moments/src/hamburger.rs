//! The Hamburger problem with four moments, of depths in [-1, 1] and total 1.

use hankel_dsl::{Real, lit};

use crate::{Blockers, Bounds, Moments4};

/// What a query point makes of four moments: the polynomial whose roots are the other two points
/// of the distribution that attains the bound (\[MSM\], Algorithm 2 and Proposition 10), up to a
/// positive factor, about the query point: `k2 u² + k1 u + k0` for depth `z + u`.
///
/// The factor is the determinant D of the Hankel matrix, so nothing is divided by it: the
/// coefficients are those of D·B⁻¹·(1, z, z²)ᵀ. `k0` is positive. A root at infinity is `k2` = 0.
#[derive(Clone, Copy)]
pub(crate) struct Query<R> {
    /// Mean depth relative to the query point.
    pub mean: R,
    /// Mean square of the depth relative to the query point.
    pub square: R,
    /// Variance of the depth.
    pub variance: R,
    /// Weight of the query point itself, in [0, 1].
    pub own: R,
    pub k0: R,
    pub k1: R,
    pub k2: R,
}

impl<R: Real> Query<R> {
    #[inline(always)]
    pub fn new(m: Moments4<R>, z: R) -> Self {
        let Moments4 { b1, b2, b3, b4 } = m;
        // Minors of the Hankel matrix. The two that are positive for valid moments are lifted to
        // the size of their own rounding errors.
        let variance = (b2 - b1 * b1).max(R::epsilon() * lit!(0.25));
        let covariance = b3 - b1 * b2;
        let spread = b4 - b2 * b2;
        let determinant =
            (spread * variance - covariance * covariance).max(R::epsilon() * R::epsilon());
        // From here on about the mean, which halves the error: d is the query point, skew the
        // third central moment. The quadratic orthogonal polynomial times the variance is k2.
        let d = z - b1;
        let d_squared = d * d;
        let skew = covariance - b1 * variance * lit!(2.0);
        let k2 = variance * (d_squared - variance) - skew * d;
        let k1 = (determinant * d - skew * k2) / variance + d * k2 * lit!(2.0);
        // 1 / own = 1 + d²/D22 + k2²/(D22 D): a sum of squares, so no cancellation, and never 0.
        let square = variance + d_squared;
        let total = square * determinant + k2 * k2;
        Self {
            mean: -d,
            square,
            variance,
            own: variance * determinant / total,
            k0: total / variance,
            k1,
            k2,
        }
    }
}

/// The greatest lower bound, over all distributions of depths with moments `m`, of the share that
/// lies below `z` (\[MSM\], Algorithms 2 and 3); in [0, 1].
///
/// Depths are in [-1, 1]: moments are clamped to that range and `z` to [-2, 2], which keeps every
/// intermediate value finite. For depths elsewhere, and for any total, there is
/// [`bound`](crate::bound). Moments that no distribution has give the bound of others, see
/// [`bound`](crate::bound).
///
/// The published form divides the polynomial by its leading coefficient, which is 0 when a root
/// is at infinity. Here the query point's own weight is a quotient of sums of squares, whether
/// both roots lie on one side follows from a sign, and otherwise the two roots enter as a distance
/// and as the reciprocal of one, both finite; of the two weights the one without cancellation is
/// computed.
#[inline(always)]
pub fn hamburger_4<R: Real>(m: Moments4<R>, z: R) -> R {
    let query = Query::new(m.clamped(), z.clamp(lit!(-2.0), lit!(2.0)));
    query.below(&query.between())
}

/// As [`hamburger_4`], with the least upper bound of the share that lies at `z` or below: the lower one and the
/// point's own weight.
#[inline(always)]
pub fn hamburger_4_bounds<R: Real>(m: Moments4<R>, z: R) -> Bounds<R> {
    let query = Query::new(m.clamped(), z.clamp(lit!(-2.0), lit!(2.0)));
    let lower = query.below(&query.between());
    Bounds {
        lower,
        upper: (lower + query.own).min(lit!(1.0)),
    }
}

/// Reads a distribution off four moments and a query point, and tells what of it blocks the light from
/// the point: the share of [`hamburger_4`], and how far before the point it lies (\[BHS\], lecture,
/// "Moment-based blocker search"). Arguments as there.
///
/// The distribution is that of the bound: the query point and two others. Where both others are nearer,
/// their mean follows from the mean of all; where one is, from its distance, if it is the nearer root, and
/// else from the mean and the other's distance, so that a root at infinity does no harm.
#[inline(always)]
pub fn blockers_4<R: Real>(m: Moments4<R>, z: R) -> Blockers<R> {
    let zero: R = lit!(0.0);
    let z = z.clamp(lit!(-2.0), lit!(2.0));
    let query = Query::new(m.clamped(), z);
    let between = query.between();
    let share = query.below(&between);
    let farther = (R::select(query.k2.lt(zero), lit!(1.0), zero) - query.own - share).max(zero);
    let one_sided = R::select(query.k1.gt(zero), -query.mean, zero);
    let two_sided = R::select(
        between.near_is_below,
        share * between.near,
        farther * between.near - query.mean,
    );
    let moment = R::select(query.k2.lt(zero), two_sided, one_sided);
    Blockers {
        share,
        // No depth is nearer than -1.
        moment: moment.clamp(zero, share * (z + lit!(1.0)).max(zero)),
    }
}

/// The two points beside the query point where it lies between them.
#[derive(Clone, Copy)]
pub(crate) struct Between<R: Real> {
    /// The weight of the lower one.
    pub lower: R,
    /// How far the nearer one is.
    pub near: R,
    /// Whether the nearer one is the lower one.
    pub near_is_below: R::Mask,
}

impl<R: Real> Query<R> {
    /// The share below the query point.
    #[inline(always)]
    fn below(&self, between: &Between<R>) -> R {
        // Both roots below: all but the point's own weight. Both above: nothing.
        let zero: R = lit!(0.0);
        let one: R = lit!(1.0);
        let outside = R::select(self.k1.gt(zero), one - self.own, zero);
        self.within_two_moments(R::select(self.k2.lt(zero), between.lower, outside))
    }

    /// `share` moved into the bounds that mean and variance alone give (Cantelli's inequality).
    /// Four moments never leave them; rounding does, when there is only one depth.
    #[inline(always)]
    pub fn within_two_moments(&self, share: R) -> R {
        let zero: R = lit!(0.0);
        let one: R = lit!(1.0);
        let near = self.variance / self.square;
        let is_above = self.mean.lt(zero);
        let least = R::select(is_above, one - near, zero);
        let most = R::select(is_above, one, near);
        share.clamp(least, most)
    }

    /// The roots when the query point lies between them (`k2` <= 0).
    #[inline(always)]
    pub fn between(&self) -> Between<R> {
        let zero: R = lit!(0.0);
        let one: R = lit!(1.0);
        let k2 = self.k2.abs();
        // The nearer root is at distance `near`, the farther one at 1 / `far` on the other side.
        let root = (self.k1 * self.k1 + k2 * self.k0 * lit!(4.0)).sqrt();
        let s = ((self.k1.abs() + root) * lit!(0.5)).max(R::epsilon() * self.k0);
        let near = self.k0 / s;
        let far = k2 / s;
        let near_is_below = self.k1.gt(zero);
        // How far the mean lies to the nearer root's side.
        let toward = R::select(near_is_below, -self.mean, self.mean);
        let shared = one + near * far;
        let mean_is_near = toward.ge(zero);
        let first = R::select(
            mean_is_near,
            (self.square * far + toward) / (near * shared),
            far * far * (self.square - toward * near) / shared,
        );
        let second = one - self.own - first;
        // `first` is the nearer root's weight if the mean is on its side; wanted is the lower's.
        let first_is_below = (mean_is_near & near_is_below) | !(mean_is_near | near_is_below);
        Between {
            lower: R::select(first_is_below, first, second),
            near,
            near_is_below,
        }
    }
}
