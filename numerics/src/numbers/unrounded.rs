use std::marker::PhantomData;
use std::ops::{Add, Div, Mul, Neg};

use hankel_dsl::Real;

/// A kernel for `P` with its operations carried out in `R`: literals and epsilon are those of `P`,
/// rounded as they are there, so what differs from the kernel in `P` is the rounding of operations
/// and nothing else.
///
/// `Unrounded<f32, DoubleDouble>` is the reference for an `f32` kernel's rounding errors, and
/// `Unrounded<f32, Interval>` encloses what that kernel computes in exact arithmetic. `R` must hold
/// all numbers of `P`, as every type of [this module](super) does for `f32` and `f64`.
#[derive(Clone, Copy, Debug, Default, PartialEq, PartialOrd)]
pub struct Unrounded<P, R> {
    /// The value.
    pub value: R,
    precision: PhantomData<P>,
}

impl<P, R> Unrounded<P, R> {
    /// `value` as the argument of a kernel for `P`.
    #[inline(always)]
    #[must_use]
    pub fn new(value: R) -> Self {
        Self {
            value,
            precision: PhantomData,
        }
    }
}

impl<P, R: From<f64>> From<f64> for Unrounded<P, R> {
    #[inline(always)]
    fn from(x: f64) -> Self {
        Self::new(x.into())
    }
}

impl<P, R: From<f32>> From<f32> for Unrounded<P, R> {
    #[inline(always)]
    fn from(x: f32) -> Self {
        Self::new(x.into())
    }
}

impl<P, R: Into<f64>> From<Unrounded<P, R>> for f64 {
    #[inline(always)]
    fn from(x: Unrounded<P, R>) -> Self {
        x.value.into()
    }
}

impl<P, R: Neg<Output = R>> Neg for Unrounded<P, R> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self::new(-self.value)
    }
}

macro_rules! forward {
    ($($operator:ident $function:ident),*) => {$(
        impl<P, R: $operator<Output = R>> $operator for Unrounded<P, R> {
            type Output = Self;
            #[inline(always)]
            fn $function(self, other: Self) -> Self {
                Self::new(self.value.$function(other.value))
            }
        }
    )*};
}

forward!(Add add, Mul mul, Div div);
remaining_operators!([P: Copy, R: Real] Unrounded<P, R>);

impl<P: Real + Into<f64>, R: Real + From<f64>> Real for Unrounded<P, R> {
    type Mask = R::Mask;
    const IS_WIDE: bool = P::IS_WIDE;

    #[inline(always)]
    fn literal<const BITS: u64>() -> Self {
        P::literal::<BITS>().into().into()
    }
    #[inline(always)]
    fn epsilon() -> Self {
        P::epsilon().into().into()
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        Self::new(self.value.sqrt())
    }
    #[inline(always)]
    fn abs(self) -> Self {
        Self::new(self.value.abs())
    }
    #[inline(always)]
    fn floor(self) -> Self {
        Self::new(self.value.floor())
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        Self::new(self.value.min(other.value))
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        Self::new(self.value.max(other.value))
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
    #[inline(always)]
    fn select(mask: R::Mask, a: Self, b: Self) -> Self {
        Self::new(R::select(mask, a.value, b.value))
    }
}
