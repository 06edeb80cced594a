//! Numbers of 16 bits (IEEE 754 binary16), on every target.
//!
//! A half is computed with as [`F16`], and lies in memory in pairs: [`F16x2`], and [`F16x4`], which is
//! two of them. No target needs an extension for it. [`Half`] is computed with by the device's own instructions.
//!
//! Each operation is one of `f32` and a rounding. For `+ - * /` and `sqrt` that is the rounded result
//! itself, since `f32` has more than twice the digits (Figueroa, When is double rounding innocuous?,
//! 1995), so that native code and every language give the same bits.

mod own;

pub use own::{Half, Half2, Half3, Half4};

use core::ops::{Add, AddAssign, Div, DivAssign, Mul, MulAssign, Neg, Sub, SubAssign};

use glam::{Vec2, Vec4};

use crate::{Element, Real};

#[inline(always)]
const fn choose(holds: bool, a: u32, b: u32) -> u32 {
    if holds { a } else { b }
}

/// The bits of the nearest half; of two that are as near, the even one. What is 65520 or more is
/// infinite. Every NaN is `0x7e00`.
#[inline(always)]
fn rounded(x: f32) -> u32 {
    let bits = x.to_bits();
    let sign = (bits >> 16) & 0x8000;
    let size = bits & 0x7fff_ffff;
    // From 2^-14 on: ten digits are left, and a carry goes on into the exponent.
    let normal = size
        .wrapping_sub(0x3800_0000)
        .wrapping_add(0xfff + ((size >> 13) & 1))
        >> 13;
    // Below: whole numbers of 2^-24. Nothing is left of what is less than half of one.
    let exponent = size >> 23;
    let shift = choose(exponent < 101, 25, 126_u32.wrapping_sub(exponent)) & 31;
    let whole = (size & 0x007f_ffff) | 0x0080_0000;
    let half = (1 << shift) >> 1;
    let small = whole
        .wrapping_add(half)
        .wrapping_sub(1)
        .wrapping_add((whole >> shift) & 1)
        >> shift;
    let finite = choose(size < 0x3880_0000, small, normal);
    let number = choose(size < 0x477f_f000, finite, 0x7c00) | sign;
    choose(size > 0x7f80_0000, 0x7e00, number)
}

/// The number that has these 16 bits; those above them do not matter.
#[inline(always)]
fn widened(bits: u32) -> f32 {
    let sign = (bits & 0x8000) << 16;
    let size = bits & 0x7fff;
    // Exact, and no denormal of `f32`.
    let small = (size as f32 * 5.960_464_5e-8).to_bits();
    let normal = (size << 13).wrapping_add(0x3800_0000);
    let special = (size << 13) | 0x7f80_0000;
    let number = choose(size < 0x7c00, normal, special);
    f32::from_bits(choose(size < 0x400, small, number) | sign)
}

/// A number of 16 bits that is computed with: 11 digits, magnitudes from 2^-24 to 65504, infinities and
/// NaN. In memory it is half of a [`F16x2`].
///
/// ```
/// use hankel_dsl::F16;
/// let third = F16::new(1.0) / F16::new(3.0);
/// assert_eq!(third.get(), 0.333_251_95);
/// assert_eq!(third.to_bits(), 0x3555);
/// ```
#[derive(Clone, Copy, Debug, Default)]
#[repr(transparent)]
pub struct F16(f32);

impl F16 {
    /// The nearest one; of two that are as near, the even one. From 65520 on it is infinite.
    #[inline(always)]
    #[must_use]
    pub fn new(x: f32) -> Self {
        Self(widened(rounded(x)))
    }

    /// As an `f32`, exactly.
    #[inline(always)]
    #[must_use]
    pub const fn get(self) -> f32 {
        self.0
    }

    /// That of these bits, which are the lowest 16.
    #[inline(always)]
    #[must_use]
    pub fn from_bits(bits: u32) -> Self {
        Self(widened(bits))
    }

    /// Its bits, in the lowest 16. Of a NaN `0x7e00`.
    #[inline(always)]
    #[must_use]
    pub fn to_bits(self) -> u32 {
        rounded(self.0)
    }

    /// Square root, rounded; the number must not be negative.
    #[inline(always)]
    #[must_use]
    pub fn sqrt(self) -> Self {
        Self::new(Real::sqrt(self.0))
    }

    /// Magnitude.
    #[inline(always)]
    #[must_use]
    pub fn abs(self) -> Self {
        Self(Real::abs(self.0))
    }
}

/// Comparisons of a number that is held in a field, each by itself: a shader has no `Ordering`.
macro_rules! compared {
    ($number:ident) => {
        impl PartialEq for $number {
            #[inline(always)]
            fn eq(&self, other: &Self) -> bool {
                self.0 == other.0
            }
        }

        impl PartialOrd for $number {
            #[inline(always)]
            fn partial_cmp(&self, other: &Self) -> Option<core::cmp::Ordering> {
                self.0.partial_cmp(&other.0)
            }
            #[inline(always)]
            fn lt(&self, other: &Self) -> bool {
                self.0 < other.0
            }
            #[inline(always)]
            fn le(&self, other: &Self) -> bool {
                self.0 <= other.0
            }
            #[inline(always)]
            fn gt(&self, other: &Self) -> bool {
                self.0 > other.0
            }
            #[inline(always)]
            fn ge(&self, other: &Self) -> bool {
                self.0 >= other.0
            }
        }
    };
}
use compared;

compared!(F16);

impl Neg for F16 {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self(-self.0)
    }
}

macro_rules! operators {
    ($($name:ident, $method:ident, $assign:ident, $assign_method:ident, $op:tt;)*) => { $(
        impl $name for F16 {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                Self::new(self.0 $op other.0)
            }
        }
        impl $assign for F16 {
            #[inline(always)]
            fn $assign_method(&mut self, other: Self) {
                *self = *self $op other;
            }
        }
    )* };
}

operators! {
    Add, add, AddAssign, add_assign, +;
    Sub, sub, SubAssign, sub_assign, -;
    Mul, mul, MulAssign, mul_assign, *;
    Div, div, DivAssign, div_assign, /;
}

/// Two numbers of 16 bits in a buffer or a uniform: a `u32`, the first in the lower half, as WGSL's
/// `pack2x16float` and GLSL's `packHalf2x16` lay them out.
///
/// Parity gives and compares its two numbers as halves: `#[range]` and its kin are those of both.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(transparent)]
pub struct F16x2(u32);

impl F16x2 {
    /// Of two numbers.
    #[inline(always)]
    #[must_use]
    pub fn new(x: F16, y: F16) -> Self {
        Self(x.to_bits() | (y.to_bits() << 16))
    }

    /// The first.
    #[inline(always)]
    #[must_use]
    pub fn x(self) -> F16 {
        F16::from_bits(self.0)
    }

    /// The second.
    #[inline(always)]
    #[must_use]
    pub fn y(self) -> F16 {
        F16::from_bits(self.0 >> 16)
    }

    /// That of these bits.
    #[inline(always)]
    #[must_use]
    pub const fn from_bits(bits: u32) -> Self {
        Self(bits)
    }

    /// Its bits.
    #[inline(always)]
    #[must_use]
    pub const fn to_bits(self) -> u32 {
        self.0
    }
}

/// Each rounded to the nearest half.
impl From<Vec2> for F16x2 {
    #[inline(always)]
    fn from(v: Vec2) -> Self {
        Self(rounded(v.x) | (rounded(v.y) << 16))
    }
}

impl From<F16x2> for Vec2 {
    #[inline(always)]
    fn from(v: F16x2) -> Self {
        Self::new(widened(v.0), widened(v.0 >> 16))
    }
}

/// Four numbers of 16 bits in a buffer: 8 bytes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Element)]
#[repr(C)]
pub struct F16x4 {
    /// The first two.
    pub xy: F16x2,
    /// The last two.
    pub zw: F16x2,
}

/// Each rounded to the nearest half.
impl From<Vec4> for F16x4 {
    #[inline(always)]
    fn from(v: Vec4) -> Self {
        Self {
            xy: Vec2::new(v.x, v.y).into(),
            zw: Vec2::new(v.z, v.w).into(),
        }
    }
}

impl From<F16x4> for Vec4 {
    #[inline(always)]
    fn from(v: F16x4) -> Self {
        let (xy, zw) = (Vec2::from(v.xy), Vec2::from(v.zw));
        Self::new(xy.x, xy.y, zw.x, zw.y)
    }
}

#[cfg(test)]
mod tests {
    use core::cmp::Ordering;
    use std::vec::Vec;

    use super::*;
    use crate::native::layout::Element as _;

    /// The number of some bits as IEEE 754 defines it; infinity as the next power of two.
    fn defined(bits: u32) -> f64 {
        let (exponent, digits) = ((bits >> 10) & 31, f64::from(bits & 0x3ff));
        let size = match exponent {
            0 => digits * 2_f64.powi(-24),
            e => (1024.0 + digits) * 2_f64.powi(e as i32 - 25),
        };
        if bits & 0x8000 == 0 { size } else { -size }
    }

    /// The bits of the half that is nearest to a number, found among all of them.
    struct Nearest(Vec<f64>);

    impl Nearest {
        fn new() -> Self {
            Self((0..=0x7c00).map(defined).collect())
        }

        fn of(&self, x: f64) -> u32 {
            let sign = u32::from(x.is_sign_negative()) << 15;
            let size = x.abs();
            let above = self.0.partition_point(|half| *half < size);
            let bits = match above {
                0 => 0,
                // Infinity is as far as the next number would be.
                n if n > 0x7c00 => 0x7c00,
                n => {
                    let (low, high) = (size - self.0[n - 1], self.0[n] - size);
                    match low.total_cmp(&high) {
                        Ordering::Less => n - 1,
                        Ordering::Greater => n,
                        Ordering::Equal => n - 1 + ((n - 1) & 1),
                    }
                }
            };
            bits as u32 | sign
        }
    }

    #[test]
    fn all_halves_are_their_numbers() {
        for bits in 0..=0xffff_u32 {
            let half = F16::from_bits(bits | 0xabcd_0000);
            let size = bits & 0x7fff;
            if size > 0x7c00 {
                assert!(half.get().is_nan());
                assert_eq!(half.to_bits(), 0x7e00);
                continue;
            }
            if size == 0x7c00 {
                assert!(half.get().is_infinite());
                assert_eq!(half.get() < 0.0, bits & 0x8000 != 0);
            } else {
                assert_eq!(f64::from(half.get()).to_bits(), defined(bits).to_bits());
            }
            assert_eq!(half.to_bits(), bits, "{bits:04x}");
            assert_eq!(F16::new(half.get()).get().to_bits(), half.get().to_bits());
        }
    }

    /// Between two halves the result changes in the middle and nowhere else.
    #[test]
    fn every_boundary_rounds_to_even() {
        let bits_of = |x: f32| F16::new(x).to_bits();
        for low in 0..0x7c00_u32 {
            let (a, b) = (defined(low), defined(low + 1));
            let middle = ((a + b) / 2.0) as f32;
            assert_eq!(f64::from(middle), (a + b) / 2.0);
            let even = low + (low & 1);
            for (sign, x) in [(0, middle), (0x8000, -middle)] {
                let near = |steps: u32| f32::from_bits(x.to_bits().wrapping_add(steps));
                assert_eq!(bits_of(x), even | sign, "{x:e}");
                assert_eq!(bits_of(near(u32::MAX)), low | sign, "below {x:e}");
                assert_eq!(bits_of(near(1)), (low + 1) | sign, "above {x:e}");
            }
        }
        assert_eq!(bits_of(f32::MAX), 0x7c00);
        assert_eq!(bits_of(f32::NEG_INFINITY), 0xfc00);
        assert_eq!(bits_of(-f32::NAN), 0x7e00);
        assert_eq!(bits_of(f32::from_bits(0x7f80_0001)), 0x7e00);
        assert_eq!(bits_of(f32::from_bits(1)), 0);
        assert_eq!(bits_of(-0.0), 0x8000);
        // And in between it never falls.
        let mut before = 0;
        for bits in (0..=0x7f80_0000_u32).step_by(97) {
            let now = bits_of(f32::from_bits(bits));
            assert!(now >= before, "{bits:08x}");
            before = now;
        }
    }

    #[test]
    fn operations_round_once() {
        let nearest = Nearest::new();
        let mut state = 1_u64;
        let mut half = || loop {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            let bits = (state >> 48) as u32;
            if bits & 0x7c00 != 0x7c00 {
                return bits;
            }
        };
        for _ in 0..300_000 {
            let (i, j) = (half(), half());
            let (a, b) = (F16::from_bits(i), F16::from_bits(j));
            let (x, y) = (defined(i), defined(j));
            // Sums and products are exact in `f64`. Quotients and roots are no nearer to a middle
            // than 2^-30 of themselves, unless they are it.
            assert_eq!((a + b).to_bits(), nearest.of(x + y), "{x:e} + {y:e}");
            assert_eq!((a - b).to_bits(), nearest.of(x - y), "{x:e} - {y:e}");
            assert_eq!((a * b).to_bits(), nearest.of(x * y), "{x:e} * {y:e}");
            if y != 0.0 {
                assert_eq!((a / b).to_bits(), nearest.of(x / y), "{x:e} / {y:e}");
            }
            assert_eq!(a.abs().sqrt().to_bits(), nearest.of(x.abs().sqrt()));
            assert_eq!((a < b, a <= b, a == b), (x < y, x <= y, x == y));
            assert_eq!((-a).to_bits(), i ^ 0x8000);
        }
    }

    #[test]
    fn memory_has_them_in_pairs() {
        let pair = F16x2::from(Vec2::new(1.0, -2.0));
        assert_eq!(pair.to_bits(), 0xc000_3c00);
        assert_eq!(F16x2::new(pair.x(), pair.y()), pair);
        assert_eq!((F16x4::layout().size, F16x4::ALIGN), (8, 4));
        let v = Vec4::new(0.5, -0.25, 65504.0, 6.103_515_6e-5);
        assert_eq!(Vec4::from(F16x4::from(v)), v);
    }
}
