//! Arithmetic that a kernel may use: [`Real`], [`Mask`] and the [`lit!`](crate::lit) macro.
//!
//! What is here rounds the same way on every backend or says that it does not. There is no `%`,
//! no `mix`, no `smoothstep` and no library transcendental: their results differ between
//! implementations. `min`, `max` and `select` are single instructions, without the NaN tests that
//! `core`'s carry; a kernel is built never to make a NaN, so none is needed.
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

macro_rules! scalar {
    ($($float:ident),*) => {$(
        impl Real for $float {
            type Mask = bool;

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
        }
    )*};
}

scalar!(f32, f64);
