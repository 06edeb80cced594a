//! Two registers of lanes as one number. The operations of a kernel depend on each other, and a processor waits some
//! cycles for the result of each; those of a second register fill the time.

use core::ops::{Add, AddAssign, BitAnd, BitOr, Div, Mul, MulAssign, Neg, Not, Sub, SubAssign};

use super::layout::Lane;
use crate::math::Elementary;
use crate::{Mask, Real};

/// Lanes of two registers, or two masks of such lanes: those of the first come first.
#[derive(Clone, Copy)]
pub struct Pair<T>(T, T);

// No closures, nor functions as arguments: what is not inlined into the code of an instruction set is compiled for the
// baseline processor.

macro_rules! operators {
    ($($operator:ident $method:ident $assign:ident $assign_method:ident,)*) => {$(
        impl<L: Real> $operator for Pair<L> {
            type Output = Self;
            #[inline(always)]
            fn $method(self, o: Self) -> Self {
                Self($operator::$method(self.0, o.0), $operator::$method(self.1, o.1))
            }
        }
        impl<L: Real> $assign for Pair<L> {
            #[inline(always)]
            fn $assign_method(&mut self, o: Self) {
                *self = $operator::$method(*self, o);
            }
        }
    )*};
}

operators! {
    Add add AddAssign add_assign,
    Sub sub SubAssign sub_assign,
    Mul mul MulAssign mul_assign,
}

impl<L: Real> Div for Pair<L> {
    type Output = Self;
    #[inline(always)]
    fn div(self, o: Self) -> Self {
        Self(self.0 / o.0, self.1 / o.1)
    }
}

impl<L: Real> Neg for Pair<L> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self(-self.0, -self.1)
    }
}

impl<M: Mask> BitAnd for Pair<M> {
    type Output = Self;
    #[inline(always)]
    fn bitand(self, o: Self) -> Self {
        Self(self.0 & o.0, self.1 & o.1)
    }
}

impl<M: Mask> BitOr for Pair<M> {
    type Output = Self;
    #[inline(always)]
    fn bitor(self, o: Self) -> Self {
        Self(self.0 | o.0, self.1 | o.1)
    }
}

impl<M: Mask> Not for Pair<M> {
    type Output = Self;
    #[inline(always)]
    fn not(self) -> Self {
        Self(!self.0, !self.1)
    }
}

impl<M: Mask> Mask for Pair<M> {
    #[inline(always)]
    fn any(self) -> bool {
        (self.0 | self.1).any()
    }
    #[inline(always)]
    fn all(self) -> bool {
        (self.0 & self.1).all()
    }
}

/// Functions that are those of both halves.
macro_rules! halves {
    ($($method:ident($($other:ident),*) -> $Result:ident;)*) => {$(
        #[inline(always)]
        fn $method(self $(, $other: Self)*) -> halves!(@result $Result) {
            Pair(self.0.$method($($other.0),*), self.1.$method($($other.1),*))
        }
    )*};
    (@result Number) => { Self };
    (@result Mask) => { Self::Mask };
}

impl<L: Real> Real for Pair<L> {
    type Mask = Pair<L::Mask>;
    const IS_WIDE: bool = L::IS_WIDE;

    #[inline(always)]
    fn literal<const BITS: u64>() -> Self {
        Self(L::literal::<BITS>(), L::literal::<BITS>())
    }
    #[inline(always)]
    fn epsilon() -> Self {
        Self(L::epsilon(), L::epsilon())
    }
    halves! {
        sqrt() -> Number;
        abs() -> Number;
        floor() -> Number;
        min(o) -> Number;
        max(o) -> Number;
        lt(o) -> Mask;
        le(o) -> Mask;
        eq(o) -> Mask;
    }
    #[inline(always)]
    fn select(mask: Self::Mask, a: Self, b: Self) -> Self {
        Self(L::select(mask.0, a.0, b.0), L::select(mask.1, a.1, b.1))
    }
    #[inline(always)]
    fn two_sum(self, o: Self) -> (Self, Self) {
        let ((a, a_error), (b, b_error)) = (self.0.two_sum(o.0), self.1.two_sum(o.1));
        (Self(a, b), Self(a_error, b_error))
    }
    #[inline(always)]
    fn two_product(self, o: Self) -> (Self, Self) {
        let ((a, a_error), (b, b_error)) = (self.0.two_product(o.0), self.1.two_product(o.1));
        (Self(a, b), Self(a_error, b_error))
    }
}

impl<L: Lane> Lane for Pair<L> {
    type Scalar = L::Scalar;
    const LANES: usize = 2 * L::LANES;

    #[inline(always)]
    fn splat(value: L::Scalar) -> Self {
        Self(L::splat(value), L::splat(value))
    }
    #[inline(always)]
    fn column(table: &[L::Scalar], width: usize, at: usize) -> Self {
        let (first, second) = table.split_at(L::LANES * width);
        Self(L::column(first, width, at), L::column(second, width, at))
    }
    #[inline(always)]
    fn put_column(table: &mut [L::Scalar], width: usize, at: usize, last: &[Self; 4]) {
        let (first, second) = table.split_at_mut(L::LANES * width);
        let [a, b, c, d] = *last;
        L::put_column(first, width, at, &[a.0, b.0, c.0, d.0]);
        L::put_column(second, width, at, &[a.1, b.1, c.1, d.1]);
    }
}

impl<L: Elementary> Elementary for Pair<L> {
    #[inline(always)]
    fn largest() -> Self {
        Self(L::largest(), L::largest())
    }
    halves! {
        guard() -> Number;
        upper() -> Number;
        power_of_two() -> Number;
        copy_sign(sign) -> Number;
        flip_sign(sign) -> Number;
        reciprocal_seed() -> Number;
        inverse_root_seed() -> Number;
        odd_sum(o) -> Number;
        not_a_number() -> Number;
        unbounded() -> Number;
    }
    #[inline(always)]
    fn decompose(self) -> (Self, Self) {
        let ((e, m), (e_second, m_second)) = (self.0.decompose(), self.1.decompose());
        (Self(e, e_second), Self(m, m_second))
    }
    #[inline(always)]
    fn reduce_large(self) -> (Self, Self, Self) {
        let (q, high, low) = self.0.reduce_large();
        let (q_second, high_second, low_second) = self.1.reduce_large();
        (
            Self(q, q_second),
            Self(high, high_second),
            Self(low, low_second),
        )
    }
}
