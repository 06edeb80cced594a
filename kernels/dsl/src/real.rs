//! Arithmetic that a kernel may use: [`Real`], [`Mask`] and the [`lit!`](crate::lit) macro.
//!
//! What is here rounds the same way on every backend or says that it does not. There is no `%`: its
//! result differs between implementations. Sines, powers and the like are in
//! [`math`](crate::math). `min`, `max` and `select` are single instructions, without the NaN tests
//! that `core`'s carry; a kernel is built never to make a NaN, so none is needed.
//!
//! Shader compilers may still reorder a sum unless they are told not to, which not every language
//! can. They move constant summands to the front and take common factors out, so a kernel that
//! must agree to the bit is written that way: `x * a + c + y * b`, and `s * (x + y)`.

use core::ops::{Add, AddAssign, BitAnd, BitOr, Div, Mul, MulAssign, Neg, Not, Sub, SubAssign};

/// The result of comparing [`Real`]s: a `bool` for a scalar, one truth value for each lane
/// otherwise. It has no `if`: use [`Real::select`], or [`Mask::any`] to skip work.
pub trait Mask: Copy + BitAnd<Output = Self> + BitOr<Output = Self> + Not<Output = Self> {
    /// Whether any lane is true.
    fn any(self) -> bool;
    /// Whether every lane is true.
    fn all(self) -> bool;
}

impl Mask for bool {
    #[inline(always)]
    fn any(self) -> bool {
        self
    }
    #[inline(always)]
    fn all(self) -> bool {
        self
    }
}

/// A floating-point number, or several in SIMD lanes.
///
/// Implemented by `f32` and `f64` on every backend and by SIMD lanes of both natively. Anything
/// else that has arithmetic, comparisons and a square root can implement it: intervals, dual
/// numbers, double-double.
///
/// `+ - * /` and `sqrt` are correctly rounded natively and on any device that follows IEEE 754;
/// GPUs may contract a product and a sum, and may flush denormals.
pub trait Real:
    Copy
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
    + AddAssign
    + SubAssign
    + MulAssign
{
    /// The result of a comparison.
    type Mask: Mask;

    /// Whether exponents reach as far as those of `f64`, to 1e±300 and beyond; else as far as those
    /// of `f32`, to 1e±37. Literals must stay within.
    const IS_WIDE: bool;

    /// The number whose `f64` has the bits `BITS`, rounded to this type. Write [`lit!`](crate::lit).
    fn literal<const BITS: u64>() -> Self;
    /// The distance from 1 to the next larger number.
    fn epsilon() -> Self;
    /// Square root; the argument must not be negative.
    fn sqrt(self) -> Self;
    /// Magnitude.
    fn abs(self) -> Self;
    /// The largest integer that is not larger.
    fn floor(self) -> Self;
    /// The smaller one. Of a NaN and a number: unspecified. Of zeros of both signs: either.
    fn min(self, other: Self) -> Self;
    /// The larger one; see [`Real::min`].
    fn max(self, other: Self) -> Self;
    /// `self < other`
    fn lt(self, other: Self) -> Self::Mask;
    /// `self <= other`
    fn le(self, other: Self) -> Self::Mask;
    /// `self == other`
    fn eq(self, other: Self) -> Self::Mask;
    /// `a` where `mask` holds, else `b`; both are evaluated.
    fn select(mask: Self::Mask, a: Self, b: Self) -> Self;

    /// `self > other`
    #[inline(always)]
    fn gt(self, other: Self) -> Self::Mask {
        other.lt(self)
    }
    /// `self >= other`
    #[inline(always)]
    fn ge(self, other: Self) -> Self::Mask {
        other.le(self)
    }
    /// `self * a + b` as a product and a sum, each rounded; a GPU may contract it.
    #[inline(always)]
    fn mul_add(self, a: Self, b: Self) -> Self {
        self * a + b
    }
    /// Between `low` and `high`, which must be in order.
    #[inline(always)]
    fn clamp(self, low: Self, high: Self) -> Self {
        self.max(low).min(high)
    }
    /// Between 0 and 1.
    #[inline(always)]
    fn saturate(self) -> Self {
        self.clamp(crate::lit!(0.0), crate::lit!(1.0))
    }
    /// `self + t * (other - self)`: exact at `t` = 0, within a rounding of `other` at 1.
    #[inline(always)]
    fn lerp(self, other: Self, t: Self) -> Self {
        t.mul_add(other - self, self)
    }
    /// The sum as it is rounded, and what the rounding took off: together exactly `self + other`.
    ///
    /// For `f32`, `f64` and their lanes, on every backend and with the same bits, as long as the
    /// sum and both terms lie within 2^126 (`f64`: 2^1022); where denormals are flushed, what is
    /// taken off must not be one. An error of zero is +0. Natively TwoSum, six operations (Knuth,
    /// The Art of Computer Programming 2, section 4.2.2, theorem B). A shader orders the two terms
    /// by magnitude instead (Dekker, A floating-point technique for extending the available
    /// precision, 1971, section 4) and hides intermediate results from its compiler, which may
    /// neither contract nor cancel what it cannot see.
    ///
    /// Any other type gives its sum and zero: what it rounds off, if anything, is its own affair.
    #[inline(always)]
    fn two_sum(self, other: Self) -> (Self, Self) {
        (self + other, crate::lit!(0.0))
    }
    /// The product as it is rounded, and what the rounding took off: together exactly
    /// `self * other`.
    ///
    /// For `f32`, `f64` and their lanes, on every backend and with the same bits, where a factor is
    /// zero, and where the product is from 2^-78 to 2^126 and neither factor is above 2^126 (`f64`:
    /// from 2^-900 to 2^990, factors up to 2^990); factors that are denormal only where those are
    /// not flushed. An error of zero is +0. Below that the error is rounded itself; beyond, it may
    /// be no number.
    ///
    /// Natively by what is fastest and exact: through `f64`, by a fused operation where lanes have
    /// one, or else from the factors' halves (Dekker 1971, section 5; Ogita, Rump, Oishi, Accurate
    /// sum and dot product, 2005, algorithms 3.2 and 3.3). A shader takes the halves as well, and no
    /// fused operation, since not every device that offers one rounds once. It hides intermediate
    /// results from its compiler as [`Real::two_sum`] does, at five to six `max`.
    ///
    /// Any other type gives its product and zero: what it rounds off, if anything, is its own
    /// affair.
    #[inline(always)]
    fn two_product(self, other: Self) -> (Self, Self) {
        (self * other, crate::lit!(0.0))
    }

    /// What `work` gives, from a function of its own that is compiled for the type's instruction set: see
    /// [`#[apart]`](macro@crate::apart). By default, and in shaders, it is part of the caller.
    #[inline(always)]
    fn apart<T>(work: impl FnOnce() -> T) -> T {
        work()
    }
}

/// `x` without its fraction. It must be within the range of `i32`: clamp first. Unlike `as`, this is
/// one instruction in a shader, without tests for what is out of range.
#[inline(always)]
#[must_use]
pub fn to_i32(x: f32) -> i32 {
    #[cfg(target_arch = "spirv")]
    // SAFETY: the caller clamps; out of range, SPIR-V's conversion gives some number.
    return unsafe { x.to_int_unchecked() };
    #[cfg(not(target_arch = "spirv"))]
    return x as i32;
}

/// A number of the [`Real`] type that the context asks for, rounded from the `f64` given:
/// `x * lit!(0.1)`.
///
/// It stands on the right of an operator: on the left, Rust does not infer its type. The rounding
/// happens when the kernel is compiled, so a shader in `f32` never mentions `f64`.
///
/// ```
/// use hankel_dsl::{Real, lit};
/// fn third<R: Real>(x: R) -> R {
///     x * lit!(1.0 / 3.0)
/// }
/// assert_eq!(third(1.0_f32), 1.0 / 3.0);
/// assert_eq!(third(1.0_f64), 1.0 / 3.0);
/// ```
#[macro_export]
macro_rules! lit {
    ($value:expr) => {
        $crate::Real::literal::<{ f64::to_bits($value) }>()
    };
}

/// `min`, `max` and `select` as the single SPIR-V instructions that they are.
#[cfg(target_arch = "spirv")]
mod instruction {
    use core::arch::asm;

    macro_rules! instructions {
        ($($float:ident),*) => {$(
            pub mod $float {
                use super::asm;

                #[inline(always)]
                pub fn min(a: $float, b: $float) -> $float {
                    let mut result: $float = 0.0;
                    // SAFETY: loads two values and stores one of the same type; FMin is 37.
                    unsafe {
                        asm!(
                            "%glsl = OpExtInstImport \"GLSL.std.450\"",
                            "%a = OpLoad _ {a}",
                            "%b = OpLoad _ {b}",
                            "%r = OpExtInst typeof*{r} %glsl 37 %a %b",
                            "OpStore {r} %r",
                            a = in(reg) &a, b = in(reg) &b, r = in(reg) &mut result,
                        );
                    }
                    result
                }

                #[inline(always)]
                pub fn max(a: $float, b: $float) -> $float {
                    let mut result: $float = 0.0;
                    // SAFETY: loads two values and stores one of the same type; FMax is 40.
                    unsafe {
                        asm!(
                            "%glsl = OpExtInstImport \"GLSL.std.450\"",
                            "%a = OpLoad _ {a}",
                            "%b = OpLoad _ {b}",
                            "%r = OpExtInst typeof*{r} %glsl 40 %a %b",
                            "OpStore {r} %r",
                            a = in(reg) &a, b = in(reg) &b, r = in(reg) &mut result,
                        );
                    }
                    result
                }

                #[inline(always)]
                pub fn select(mask: bool, a: $float, b: $float) -> $float {
                    let mut result: $float = 0.0;
                    // SAFETY: loads a bool and two values and stores one of the same type.
                    unsafe {
                        asm!(
                            "%m = OpLoad _ {m}",
                            "%a = OpLoad _ {a}",
                            "%b = OpLoad _ {b}",
                            "%r = OpSelect typeof*{r} %m %a %b",
                            "OpStore {r} %r",
                            m = in(reg) &mask, a = in(reg) &a, b = in(reg) &b,
                            r = in(reg) &mut result,
                        );
                    }
                    result
                }
            }
        )*};
    }

    instructions!(f32, f64);
}

#[cfg(not(target_arch = "spirv"))]
mod instruction {
    macro_rules! instructions {
        ($($float:ident),*) => {$(
            pub mod $float {
                #[inline(always)]
                pub fn min(a: $float, b: $float) -> $float {
                    if a < b { a } else { b }
                }
                #[inline(always)]
                pub fn max(a: $float, b: $float) -> $float {
                    if a > b { a } else { b }
                }
                #[inline(always)]
                pub fn select(mask: bool, a: $float, b: $float) -> $float {
                    if mask { a } else { b }
                }
            }
        )*};
    }

    instructions!(f32, f64);
}

/// Sums and products with their errors, in a shader.
///
/// The `max` with a number that nothing is below keeps a value as it is. But no compiler knows
/// that: it cannot contract the product behind it, nor cancel the sum behind it against another,
/// whatever liberties its language gives it.
#[cfg(any(target_arch = "spirv", test))]
mod guarded {
    macro_rules! sum {
        ($float:ident) => {
            #[inline(always)]
            pub fn sum(a: $float, b: $float) -> ($float, $float) {
                let ordered = Real::abs(b) <= Real::abs(a);
                let large = instruction::$float::select(ordered, a, b);
                let small = instruction::$float::select(ordered, b, a);
                let sum = hide(large + small);
                // In this order a zero is +0, as Knuth's is.
                (sum, hide(large - sum) + small)
            }
        };
    }
    /// Given halves of the factors whose products are exact. What is hidden here, a compiler could
    /// add in another order, or factor out.
    macro_rules! product {
        ($float:ident) => {
            #[inline(always)]
            pub fn product(a: $float, b: $float) -> ($float, $float) {
                // A factor that is itself a product must not be contracted into the subtraction
                // that splits it.
                let (a, b) = (hide(a), hide(b));
                let product = hide(a * b);
                let ((a_high, a_low), (b_high, b_low)) = (split(a), split(b));
                let error = hide(a_high * b_high - product);
                let error = hide(error + a_high * b_low);
                let error = hide(error + a_low * b_high);
                (product, error + a_low * b_low)
            }
        };
    }

    pub mod f32 {
        use super::super::instruction;
        use crate::Real;

        #[inline(always)]
        fn hide(x: f32) -> f32 {
            instruction::f32::max(x, -85_070_591_730_234_615_865_843_651_857_942_052_864.0)
        }

        /// Twelve bits each: the low half is cut off, which no rounding can undo.
        #[inline(always)]
        fn split(x: f32) -> (f32, f32) {
            let high = f32::from_bits(x.to_bits() & 0xffff_f000);
            (high, x - high)
        }

        sum!(f32);
        product!(f32);
    }

    pub mod f64 {
        use super::super::instruction;
        use crate::Real;

        /// -2^1022.
        #[inline(always)]
        fn hide(x: f64) -> f64 {
            instruction::f64::max(x, const { f64::from_bits(0xffd0_0000_0000_0000) })
        }

        /// Twenty-six bits and a sign each (Veltkamp): no device needs 64-bit integers for it.
        #[inline(always)]
        fn split(x: f64) -> (f64, f64) {
            let scaled = hide(x * 134_217_729.0);
            let high = hide(scaled - hide(scaled - x));
            (high, x - high)
        }

        sum!(f64);
        product!(f64);
    }
}

/// Sums and products with their errors, natively: nothing here contracts or reorders.
#[cfg(not(target_arch = "spirv"))]
mod plain {
    macro_rules! sum {
        ($float:ident) => {
            #[inline(always)]
            pub fn sum(a: $float, b: $float) -> ($float, $float) {
                let sum = a + b;
                let from_b = sum - a;
                (sum, (a - (sum - from_b)) + (b - from_b))
            }
        };
    }

    pub mod f32 {
        sum!(f32);

        /// The product of two `f32` is exact in `f64`.
        #[inline(always)]
        #[allow(clippy::cast_possible_truncation, reason = "the error is an f32")]
        pub fn product(a: f32, b: f32) -> (f32, f32) {
            let product = a * b;
            let error = f64::from(a) * f64::from(b) - f64::from(product);
            (product, error as f32)
        }
    }

    pub mod f64 {
        sum!(f64);

        /// Twenty-six bits and a sign each (Veltkamp).
        #[inline(always)]
        fn split(x: f64) -> (f64, f64) {
            let scaled = x * 134_217_729.0;
            let high = scaled - (scaled - x);
            (high, x - high)
        }

        #[inline(always)]
        pub fn product(a: f64, b: f64) -> (f64, f64) {
            let product = a * b;
            let ((a_high, a_low), (b_high, b_low)) = (split(a), split(b));
            let error = (a_high * b_high - product) + a_high * b_low + a_low * b_high;
            (product, error + a_low * b_low)
        }
    }
}

#[cfg(target_arch = "spirv")]
use guarded as exact;
#[cfg(not(target_arch = "spirv"))]
use plain as exact;

macro_rules! scalar {
    ($($float:ident),*) => {$(
        impl Real for $float {
            type Mask = bool;
            const IS_WIDE: bool = $float::MAX_EXP > f32::MAX_EXP;

            #[inline(always)]
            #[allow(clippy::cast_possible_truncation, reason = "rounding is what a literal does")]
            fn literal<const BITS: u64>() -> Self {
                const { f64::from_bits(BITS) as $float }
            }
            #[inline(always)]
            fn epsilon() -> Self {
                $float::EPSILON
            }
            #[inline(always)]
            fn sqrt(self) -> Self {
                #[cfg(target_arch = "spirv")]
                return spirv_std::num_traits::Float::sqrt(self);
                #[cfg(not(target_arch = "spirv"))]
                return $float::sqrt(self);
            }
            #[inline(always)]
            fn abs(self) -> Self {
                #[cfg(target_arch = "spirv")]
                return spirv_std::num_traits::Float::abs(self);
                #[cfg(not(target_arch = "spirv"))]
                return $float::abs(self);
            }
            #[inline(always)]
            fn floor(self) -> Self {
                #[cfg(target_arch = "spirv")]
                return spirv_std::num_traits::Float::floor(self);
                #[cfg(not(target_arch = "spirv"))]
                return $float::floor(self);
            }
            #[inline(always)]
            fn min(self, other: Self) -> Self {
                instruction::$float::min(self, other)
            }
            #[inline(always)]
            fn max(self, other: Self) -> Self {
                instruction::$float::max(self, other)
            }
            #[inline(always)]
            fn lt(self, other: Self) -> bool {
                self < other
            }
            #[inline(always)]
            fn le(self, other: Self) -> bool {
                self <= other
            }
            #[inline(always)]
            fn eq(self, other: Self) -> bool {
                self == other
            }
            #[inline(always)]
            fn select(mask: bool, a: Self, b: Self) -> Self {
                instruction::$float::select(mask, a, b)
            }
            #[inline(always)]
            fn two_sum(self, other: Self) -> (Self, Self) {
                exact::$float::sum(self, other)
            }
            #[inline(always)]
            fn two_product(self, other: Self) -> (Self, Self) {
                exact::$float::product(self, other)
            }
            #[cfg(not(target_arch = "spirv"))]
            #[inline(never)]
            fn apart<T>(work: impl FnOnce() -> T) -> T {
                work()
            }
        }
    )*};
}

scalar!(f32, f64);

#[cfg(test)]
mod tests {
    use std::vec::Vec;

    use super::*;
    use crate::native::lanes::tests::{magnitudes, pairs};

    /// A finite number as an odd integer (or 0) times a power of two.
    fn parts(x: f64) -> (i128, i32) {
        let exponent = ((x.to_bits() >> 52) & 0x7ff) as i32;
        let fraction = x.to_bits() & ((1 << 52) - 1);
        let (whole, place) = match exponent {
            0 => (fraction, -1074),
            e => (fraction | 1 << 52, e - 1075),
        };
        if whole == 0 {
            return (0, 0);
        }
        let zeros = whole.trailing_zeros();
        let odd = i128::from(whole >> zeros);
        (if x < 0.0 { -odd } else { odd }, place + zeros as i32)
    }

    /// A finite number as an integer of units of 2^`unit`.
    fn integer(x: f64, unit: i32) -> i128 {
        match parts(x) {
            (0, _) => 0,
            (odd, place) => {
                let bits = odd.unsigned_abs().ilog2() as i32 + place - unit;
                assert!(place >= unit && bits < 126, "{x:e} in units of 2^{unit}");
                odd << (place - unit)
            }
        }
    }

    #[test]
    fn a_product_and_its_error_are_the_exact_product() {
        for (a, b) in pairs(-39, 62, 24) {
            let (a, b) = (a as f32, b as f32);
            let ((m, i), (n, j)) = (parts(a.into()), parts(b.into()));
            let (p, e) = a.two_product(b);
            assert_eq!(p.to_bits(), (a * b).to_bits());
            assert_eq!(
                integer(p.into(), i + j) + integer(e.into(), i + j),
                m * n,
                "{a:e} {b:e}"
            );
            let shader = guarded::f32::product(a, b);
            assert_eq!(
                (shader.0.to_bits(), shader.1.to_bits()),
                (p.to_bits(), e.to_bits()),
                "{a:e} {b:e}"
            );
        }
        for (a, b) in pairs(-450, 494, 53) {
            let ((m, i), (n, j)) = (parts(a), parts(b));
            let (p, e) = a.two_product(b);
            assert_eq!(p.to_bits(), (a * b).to_bits());
            assert_eq!(integer(p, i + j) + integer(e, i + j), m * n, "{a:e} {b:e}");
            let shader = guarded::f64::product(a, b);
            assert_eq!(
                (shader.0.to_bits(), shader.1.to_bits()),
                (p.to_bits(), e.to_bits()),
                "{a:e} {b:e}"
            );
        }
    }

    #[test]
    fn a_sum_and_its_error_are_the_exact_sum() {
        let far = |a: f64, b: f64| a != 0.0 && b != 0.0 && (a / b).abs().log2().abs() > 60.0;
        let lowest = |a: f64, b: f64| match (parts(a), parts(b)) {
            ((0, _), (_, place)) | ((_, place), (0, _)) => place,
            ((_, i), (_, j)) => i.min(j),
        };
        for (a, b) in pairs(-149, 124, 24) {
            let (a, b) = (a as f32, b as f32);
            let (s, e) = a.two_sum(b);
            assert_eq!(s.to_bits(), (a + b).to_bits());
            if far(a.into(), b.into()) {
                assert_eq!((s, e), if a.abs() > b.abs() { (a, b) } else { (b, a) });
            } else {
                let unit = lowest(a.into(), b.into());
                let [a, b, s, e] = [a, b, s, e].map(|x| integer(x.into(), unit));
                assert_eq!(a + b, s + e);
            }
            let shader = guarded::f32::sum(a, b);
            assert_eq!(
                (shader.0.to_bits(), shader.1.to_bits()),
                (s.to_bits(), e.to_bits()),
                "{a:e} {b:e}"
            );
        }
        for (a, b) in pairs(-1074, 1020, 53) {
            let (s, e) = a.two_sum(b);
            assert_eq!(s.to_bits(), (a + b).to_bits());
            if far(a, b) {
                assert_eq!((s, e), if a.abs() > b.abs() { (a, b) } else { (b, a) });
            } else {
                let unit = lowest(a, b);
                let [x, y, s, e] = [a, b, s, e].map(|x| integer(x, unit));
                assert_eq!(x + y, s + e);
            }
            let shader = guarded::f64::sum(a, b);
            assert_eq!(
                (shader.0.to_bits(), shader.1.to_bits()),
                (s.to_bits(), e.to_bits()),
                "{a:e} {b:e}"
            );
        }
    }

    #[test]
    fn what_lies_within_the_limit_is_hidden_but_kept() {
        let all: Vec<f64> = magnitudes(-149, 125, 24).collect();
        for &x in &all {
            let x = x as f32;
            let (product, error) = guarded::f32::product(x, 1.0);
            assert_eq!((product.to_bits(), error.to_bits()), (x.to_bits(), 0));
        }
    }
}
