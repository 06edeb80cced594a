use std::ops::{Add, Div, Mul, Neg};

use hankel_dsl::{Real, lit};

/// A value and its derivative in one direction (forward-mode differentiation).
///
/// Seed the directional derivative with [`Dual::variable`] or by hand, call the kernel, and read
/// `derivative`. Comparisons are of values, so a kernel takes the branch that it takes without
/// derivatives, and the derivative is that branch's: at a kink that of one side. `floor` and
/// literals have derivative 0, and so has the square root at 0, where it has none.
///
/// `Dual<Dual<R>>` has second derivatives, `Dual<Interval>` encloses the derivative.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Dual<R> {
    /// The value.
    pub value: R,
    /// Its derivative.
    pub derivative: R,
}

impl<R: Real> Dual<R> {
    /// A value that does not change.
    #[inline(always)]
    #[must_use]
    pub fn constant(value: R) -> Self {
        Self {
            value,
            derivative: lit!(0.0),
        }
    }

    /// A value that changes at the rate 1.
    #[inline(always)]
    #[must_use]
    pub fn variable(value: R) -> Self {
        Self {
            value,
            derivative: lit!(1.0),
        }
    }
}

impl<R: Real + From<f64>> From<f64> for Dual<R> {
    #[inline(always)]
    fn from(x: f64) -> Self {
        Self::constant(x.into())
    }
}

impl<R: Real + From<f32>> From<f32> for Dual<R> {
    #[inline(always)]
    fn from(x: f32) -> Self {
        Self::constant(x.into())
    }
}

impl<R: Real> Neg for Dual<R> {
    type Output = Self;
    #[inline(never)]
    fn neg(self) -> Self {
        Self {
            value: -self.value,
            derivative: -self.derivative,
        }
    }
}

impl<R: Real> Add for Dual<R> {
    type Output = Self;
    #[inline(never)]
    fn add(self, other: Self) -> Self {
        Self {
            value: self.value + other.value,
            derivative: self.derivative + other.derivative,
        }
    }
}

impl<R: Real> Mul for Dual<R> {
    type Output = Self;
    #[inline(never)]
    fn mul(self, other: Self) -> Self {
        Self {
            value: self.value * other.value,
            derivative: self.derivative * other.value + self.value * other.derivative,
        }
    }
}

impl<R: Real> Div for Dual<R> {
    type Output = Self;
    #[inline(never)]
    fn div(self, other: Self) -> Self {
        let value = self.value / other.value;
        Self {
            value,
            derivative: (self.derivative - value * other.derivative) / other.value,
        }
    }
}

remaining_operators!([R: Real] Dual<R>);

impl<R: Real> Real for Dual<R> {
    type Mask = R::Mask;
    const IS_WIDE: bool = R::IS_WIDE;

    #[inline(always)]
    fn literal<const BITS: u64>() -> Self {
        Self::constant(R::literal::<BITS>())
    }
    #[inline(always)]
    fn epsilon() -> Self {
        Self::constant(R::epsilon())
    }
    #[inline(never)]
    fn sqrt(self) -> Self {
        let value = self.value.sqrt();
        let is_positive = value.gt(lit!(0.0));
        let divisor = R::select(is_positive, value + value, lit!(1.0));
        Self {
            value,
            derivative: R::select(is_positive, self.derivative / divisor, lit!(0.0)),
        }
    }
    #[inline(never)]
    fn abs(self) -> Self {
        let is_negative = self.value.lt(lit!(0.0));
        Self {
            value: self.value.abs(),
            derivative: R::select(is_negative, -self.derivative, self.derivative),
        }
    }
    #[inline(always)]
    fn floor(self) -> Self {
        Self::constant(self.value.floor())
    }
    #[inline(never)]
    fn min(self, other: Self) -> Self {
        let is_less = self.value.lt(other.value);
        Self {
            value: self.value.min(other.value),
            derivative: R::select(is_less, self.derivative, other.derivative),
        }
    }
    #[inline(never)]
    fn max(self, other: Self) -> Self {
        let is_greater = self.value.gt(other.value);
        Self {
            value: self.value.max(other.value),
            derivative: R::select(is_greater, self.derivative, other.derivative),
        }
    }
    #[inline(always)]
    fn lt(self, other: Self) -> R::Mask {
        self.value.lt(other.value)
    }
    #[inline(always)]
    fn le(self, other: Self) -> R::Mask {
        self.value.le(other.value)
    }
    #[inline(always)]
    fn eq(self, other: Self) -> R::Mask {
        self.value.eq(other.value)
    }
    #[inline(never)]
    fn select(mask: R::Mask, a: Self, b: Self) -> Self {
        Self {
            value: R::select(mask, a.value, b.value),
            derivative: R::select(mask, a.derivative, b.derivative),
        }
    }
}
