//! Two registers of lanes as one number. The operations of a kernel depend on each other, and a processor waits some
//! cycles for the result of each; those of a second register fill the time.

use core::ops::{Add, AddAssign, BitAnd, BitOr, Div, Mul, MulAssign, Neg, Not, Sub, SubAssign};

use super::layout::Lane;
use crate::math::Elementary;
use crate::{Mask, Real};

/// Lanes of two registers, or two masks of such lanes: those of the first come first.
#[derive(Clone, Copy)]
pub struct Pair<T>(T, T);

impl<T: Copy> Pair<T> {
    #[inline(always)]
    fn both(value: T) -> Self {
        Self(value, value)
    }
    #[inline(always)]
    fn each<U>(self, f: impl Fn(T) -> U) -> Pair<U> {
        Pair(f(self.0), f(self.1))
    }
    #[inline(always)]
    fn with<O, U>(self, other: Pair<O>, f: impl Fn(T, O) -> U) -> Pair<U> {
        Pair(f(self.0, other.0), f(self.1, other.1))
    }
}

macro_rules! operators {
    ($($operator:ident $method:ident $assign:ident $assign_method:ident,)*) => {$(
        impl<L: Real> $operator for Pair<L> {
            type Output = Self;
            #[inline(always)]
            fn $method(self, o: Self) -> Self {
                self.with(o, $operator::$method)
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
        self.with(o, Div::div)
    }
}

impl<L: Real> Neg for Pair<L> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        self.each(Neg::neg)
    }
}

impl<M: Mask> BitAnd for Pair<M> {
    type Output = Self;
    #[inline(always)]
    fn bitand(self, o: Self) -> Self {
        self.with(o, BitAnd::bitand)
    }
}

impl<M: Mask> BitOr for Pair<M> {
    type Output = Self;
    #[inline(always)]
    fn bitor(self, o: Self) -> Self {
        self.with(o, BitOr::bitor)
    }
}

impl<M: Mask> Not for Pair<M> {
    type Output = Self;
    #[inline(always)]
    fn not(self) -> Self {
        self.each(Not::not)
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

/// Methods of a trait that are those of both halves.
macro_rules! halves {
    ($($method:ident($($other:ident),*) -> $result:ty;)*) => {$(
        #[inline(always)]
        fn $method(self $(, $other: Self)*) -> $result {
            halves!(@call self, $method $(, $other)*)
        }
    )*};
    (@call $self:ident, $method:ident) => { $self.each(|x| x.$method()) };
    (@call $self:ident, $method:ident, $other:ident) => { $self.with($other, |x, y| x.$method(y)) };
}

/// The first results of both halves, and the second ones.
#[inline(always)]
fn turned<L>(halves: Pair<(L, L)>) -> (Pair<L>, Pair<L>) {
    let Pair((a, b), (c, d)) = halves;
    (Pair(a, c), Pair(b, d))
}

impl<L: Real> Real for Pair<L> {
    type Mask = Pair<L::Mask>;
    const IS_WIDE: bool = L::IS_WIDE;

    #[inline(always)]
    fn literal<const BITS: u64>() -> Self {
        Self::both(L::literal::<BITS>())
    }
    #[inline(always)]
    fn epsilon() -> Self {
        Self::both(L::epsilon())
    }
    halves! {
        sqrt() -> Self;
        abs() -> Self;
        floor() -> Self;
        min(o) -> Self;
        max(o) -> Self;
        lt(o) -> Self::Mask;
        le(o) -> Self::Mask;
        eq(o) -> Self::Mask;
    }
    #[inline(always)]
    fn select(mask: Self::Mask, a: Self, b: Self) -> Self {
        Self(L::select(mask.0, a.0, b.0), L::select(mask.1, a.1, b.1))
    }
    #[inline(always)]
    fn two_sum(self, o: Self) -> (Self, Self) {
        turned(self.with(o, L::two_sum))
    }
    #[inline(always)]
    fn two_product(self, o: Self) -> (Self, Self) {
        turned(self.with(o, L::two_product))
    }
}

impl<L: Lane> Lane for Pair<L> {
    type Scalar = L::Scalar;
    const LANES: usize = 2 * L::LANES;

    #[inline(always)]
    fn splat(value: L::Scalar) -> Self {
        Self::both(L::splat(value))
    }
    #[inline(always)]
    fn column(table: &[L::Scalar], width: usize, at: usize) -> Self {
        let (first, second) = table.split_at(L::LANES * width);
        Self(L::column(first, width, at), L::column(second, width, at))
    }
    #[inline(always)]
    fn put_column(table: &mut [L::Scalar], width: usize, at: usize, last: &[Self; 4]) {
        let (first, second) = table.split_at_mut(L::LANES * width);
        L::put_column(first, width, at, &last.map(|pair| pair.0));
        L::put_column(second, width, at, &last.map(|pair| pair.1));
    }
}

impl<L: Elementary> Elementary for Pair<L> {
    #[inline(always)]
    fn largest() -> Self {
        Self::both(L::largest())
    }
    halves! {
        guard() -> Self;
        upper() -> Self;
        power_of_two() -> Self;
        copy_sign(sign) -> Self;
        flip_sign(sign) -> Self;
        reciprocal_seed() -> Self;
        inverse_root_seed() -> Self;
        odd_sum(o) -> Self;
        not_a_number() -> Self;
        unbounded() -> Self;
    }
    #[inline(always)]
    fn decompose(self) -> (Self, Self) {
        turned(self.each(L::decompose))
    }
    #[inline(always)]
    fn reduce_large(self) -> (Self, Self, Self) {
        let Pair((q, high, low), (q2, high2, low2)) = self.each(L::reduce_large);
        (Pair(q, q2), Pair(high, high2), Pair(low, low2))
    }
}
