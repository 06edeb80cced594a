//! Numbers that round less than `f32` and `f64`, that carry a derivative, or that enclose the exact
//! result: each is a [`Real`](hankel_dsl::Real), so that a kernel runs in it unchanged.
//!
//! | type | what it is | relative rounding error |
//! | --- | --- | --- |
//! | [`DoubleDouble`] | the unevaluated sum of two `f64` | 2⁻¹⁰² at most |
//! | [`Wide`] | 300 bits, correctly rounded, any exponent | 2⁻³⁰⁰ at most |
//! | [`Dual<R>`](Dual) | a value and its derivative in one direction | that of `R` |
//! | [`Interval`] | two `f64` with the exact result between them | none that goes unseen |
//! | [`Unrounded<P, R>`](Unrounded) | a kernel for `P` with its operations carried out in `R` | that of `R` |
//!
//! All convert from `f32` and `f64` exactly, the plain numbers also to `f64`, rounded to nearest.
//! A literal is the `f64` that the kernel names, not the decimal fraction that its author meant.
//!
//! A kernel's result depends on [`Real::epsilon`](hankel_dsl::Real::epsilon), and the same kernel
//! in a wider type is another function wherever a floor or a clamp is made of it. To see rounding
//! errors and nothing else, evaluate in [`Unrounded`].
//!
//! Operations that are more than a few instructions are functions that are called: a kernel is one long
//! stretch of them, and takes minutes to compile where each is written out.
//!
//! Kernels divide by nothing that can be zero and take no root of what can be negative. Where one
//! does nevertheless, [`Wide`] is undefined from there on, as a NaN is; [`DoubleDouble`] is a NaN or
//! infinite; and [`Interval`] is the whole line.

/// What follows from `+`, `*` and negation.
macro_rules! remaining_operators {
    ([$($generics:tt)*] $number:ty) => {
        impl<$($generics)*> std::ops::Sub for $number {
            type Output = Self;
            #[inline(never)]
            fn sub(self, other: Self) -> Self {
                std::ops::Add::add(self, -other)
            }
        }
        impl<$($generics)*> std::ops::AddAssign for $number {
            #[inline(never)]
            fn add_assign(&mut self, other: Self) {
                *self = *self + other;
            }
        }
        impl<$($generics)*> std::ops::SubAssign for $number {
            #[inline(never)]
            fn sub_assign(&mut self, other: Self) {
                *self = *self - other;
            }
        }
        impl<$($generics)*> std::ops::MulAssign for $number {
            #[inline(never)]
            fn mul_assign(&mut self, other: Self) {
                *self = *self * other;
            }
        }
    };
}

/// Comparisons and what selects by them, of a type whose order is `PartialOrd`.
macro_rules! ordered {
    () => {
        type Mask = bool;
        const IS_WIDE: bool = true;

        #[inline(never)]
        fn min(self, other: Self) -> Self {
            if self < other { self } else { other }
        }
        #[inline(never)]
        fn max(self, other: Self) -> Self {
            if self > other { self } else { other }
        }
        #[inline(never)]
        fn lt(self, other: Self) -> bool {
            self < other
        }
        #[inline(never)]
        fn le(self, other: Self) -> bool {
            self <= other
        }
        #[inline(never)]
        fn eq(self, other: Self) -> bool {
            self == other
        }
        #[inline(never)]
        fn select(mask: bool, a: Self, b: Self) -> Self {
            if mask { a } else { b }
        }
    };
}

mod double_double;
mod dual;
mod error_free;
mod interval;
mod unrounded;
mod wide;

pub use double_double::DoubleDouble;
pub use dual::Dual;
pub use interval::{Interval, Undecided};
pub use unrounded::Unrounded;
pub use wide::Wide;
