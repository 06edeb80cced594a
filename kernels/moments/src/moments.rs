//! Power moments, four and six.

use hankel_dsl::{Element, Real, lit};

/// `x` between `low` and `high`; a NaN becomes `low`.
#[inline(always)]
pub(crate) fn within<R: Real>(x: R, low: R, high: R) -> R {
    R::select(x.ge(low), x, low).min(high)
}

/// `x` between -1 and 1; a NaN becomes -1. A function, since a closure over lanes may be compiled without their
/// instruction set.
#[inline(always)]
pub(crate) fn within_one<R: Real>(x: R) -> R {
    within(x, lit!(-1.0), lit!(1.0))
}

/// The first four power moments of a distribution of depths.
#[derive(Clone, Copy, Debug, PartialEq, Element)]
#[repr(C)]
pub struct Moments4<R> {
    /// Mean depth.
    pub b1: R,
    /// Mean square of the depth.
    pub b2: R,
    /// Mean cube of the depth.
    pub b3: R,
    /// Mean fourth power of the depth.
    pub b4: R,
}

impl<R: Real> Moments4<R> {
    /// The moments of a single depth.
    #[inline(always)]
    pub fn of_depth(z: R) -> Self {
        let z2 = z * z;
        Self {
            b1: z,
            b2: z2,
            b3: z2 * z,
            b4: z2 * z2,
        }
    }

    /// Each moment in [-1, 1], where those of depths in [-1, 1] lie anyway; a NaN becomes -1.
    #[inline(always)]
    pub fn clamped(self) -> Self {
        Self {
            b1: within_one(self.b1),
            b2: within_one(self.b2),
            b3: within_one(self.b3),
            b4: within_one(self.b4),
        }
    }

    /// `self + t (other - self)`: the moments of the mixed distributions.
    #[inline(always)]
    pub fn lerp(self, other: Self, t: R) -> Self {
        Self {
            b1: self.b1.lerp(other.b1, t),
            b2: self.b2.lerp(other.b2, t),
            b3: self.b3.lerp(other.b3, t),
            b4: self.b4.lerp(other.b4, t),
        }
    }

    /// Moments of depths in [-1, 1] to those of the same depths moved to [0, 1], by expanding
    /// the powers of (z + 1) / 2.
    #[inline(always)]
    pub fn symmetric_to_unit(self) -> Self {
        let Self { b1, b2, b3, b4 } = self;
        let one: R = lit!(1.0);
        Self {
            b1: (b1 + one) * lit!(0.5),
            b2: (b2 + b1 * lit!(2.0) + one) * lit!(0.25),
            b3: (b3 + (b2 + b1) * lit!(3.0) + one) * lit!(0.125),
            b4: (b4 + (b3 + b1) * lit!(4.0) + b2 * lit!(6.0) + one) * lit!(0.0625),
        }
    }
}

/// The first six power moments of a distribution of depths.
#[derive(Clone, Copy, Debug, PartialEq, Element)]
#[repr(C)]
pub struct Moments6<R> {
    /// Mean depth.
    pub b1: R,
    /// Mean square of the depth.
    pub b2: R,
    /// Mean cube of the depth.
    pub b3: R,
    /// Mean fourth power of the depth.
    pub b4: R,
    /// Mean fifth power of the depth.
    pub b5: R,
    /// Mean sixth power of the depth.
    pub b6: R,
}

impl<R: Real> Moments6<R> {
    /// The moments of a single depth.
    #[inline(always)]
    pub fn of_depth(z: R) -> Self {
        let z2 = z * z;
        let z3 = z2 * z;
        Self {
            b1: z,
            b2: z2,
            b3: z3,
            b4: z2 * z2,
            b5: z2 * z3,
            b6: z3 * z3,
        }
    }

    /// Each moment in [-1, 1], where those of depths in [-1, 1] lie anyway; a NaN becomes -1.
    #[inline(always)]
    pub fn clamped(self) -> Self {
        Self {
            b1: within_one(self.b1),
            b2: within_one(self.b2),
            b3: within_one(self.b3),
            b4: within_one(self.b4),
            b5: within_one(self.b5),
            b6: within_one(self.b6),
        }
    }

    /// `self + t (other - self)`: the moments of the mixed distributions.
    #[inline(always)]
    pub fn lerp(self, other: Self, t: R) -> Self {
        Self {
            b1: self.b1.lerp(other.b1, t),
            b2: self.b2.lerp(other.b2, t),
            b3: self.b3.lerp(other.b3, t),
            b4: self.b4.lerp(other.b4, t),
            b5: self.b5.lerp(other.b5, t),
            b6: self.b6.lerp(other.b6, t),
        }
    }
}
