//! The device's own arithmetic of 16 bits: WGSL's `f16`, HLSL's and Metal's `half`.
//!
//! Natively each result is rounded to the nearest half, as IEEE 754 has it. A device may round to either neighbour, take
//! numbers below 2^-14 for zero, and be less exact where an operation is more than one: a kernel states what it allows
//! as its tolerance.
//!
//! | | WGSL and Vulkan | Metal |
//! | --- | --- | --- |
//! | `+ - *` | correctly rounded | correctly rounded |
//! | `/` | 2.5 ulp | correctly rounded |
//! | `sqrt` | of `1 / inverse_sqrt(x)`, 2 ulp | correctly rounded |
//! | `mul_add` | of `a * b + c` | correctly rounded |
//! | `dot` | of products and sums, in any order | likewise |
//!
//! Sources: WGSL, 15.7.4 "Floating Point Accuracy"; Vulkan, appendix A "Precision and Operation of SPIR-V Instructions";
//! Metal Shading Language Specification, 8.4 "ULPs and Relative Error".

use core::ops::{Add, AddAssign, Div, DivAssign, Mul, MulAssign, Neg, Sub, SubAssign};

use glam::{Vec2, Vec3, Vec4};

use super::{F16x2, F16x4, compared};
#[cfg(not(target_arch = "spirv"))]
use crate::Real;

/// One instruction on the device, whose operands are these values; natively an expression in which they have these
/// names.
#[cfg(target_arch = "spirv")]
macro_rules! instruction {
    ($result:ty, $op:literal, [$($name:ident = $value:expr),+], $native:expr) => {{
        $(let $name = $value;)+
        let mut result = <$result>::default();
        // SAFETY: the values are loaded, and what the instruction makes of them is stored where a value of its type is.
        unsafe {
            core::arch::asm!(
                "%glsl = OpExtInstImport \"GLSL.std.450\"",
                $(concat!("%", stringify!($name), " = OpLoad _ {", stringify!($name), "}"),)+
                concat!("%r = ", $op $(, " %", stringify!($name))+),
                "OpStore {r} %r",
                $($name = in(reg) &$name,)+
                r = in(reg) &mut result,
            );
        }
        result
    }};
}

#[cfg(not(target_arch = "spirv"))]
macro_rules! instruction {
    ($result:ty, $op:literal, [$($name:ident = $value:expr),+], $native:expr) => {{
        $(let $name = $value;)+
        $native
    }};
}

/// Methods of one instruction each, whose operands are the number itself, by the first name, and others like it.
macro_rules! functions {
    ($($(#[$doc:meta])* $name:ident($own:ident $(, $other:ident)*) = $instruction:literal, $native:expr;)+) => { $(
        $(#[$doc])*
        #[inline(always)]
        #[must_use]
        pub fn $name(self $(, $other: Self)*) -> Self {
            instruction!(Self, $instruction, [$own = self $(, $other = $other)*], $native)
        }
    )+ };
}

/// What a half is held in.
#[cfg(target_arch = "spirv")]
type Held = f16;
#[cfg(not(target_arch = "spirv"))]
type Held = f32;

/// A number of 16 bits that is computed with by the device's own instructions.
///
/// [`F16`](super::F16) has the same bits everywhere, and costs some 20 operations for each rounding. This type costs one
/// instruction, and needs a device that has it: WebGPU's `shader-f16`, Direct3D's shader model 6.2 with
/// `-enable-16bit-types`, Vulkan's `shaderFloat16`. HLSL without that option, and GLSL, compute with `f32`; GLSL rounds
/// each result to a half.
///
/// In memory halves lie in pairs, [`F16x2`] and [`F16x4`], which are made from [`Half2`] and [`Half4`] and back.
///
/// ```
/// use hankel_dsl::Half;
/// let third = Half::new(1.0) / Half::new(3.0);
/// assert_eq!(third.get(), 0.333_251_95);
/// ```
#[derive(Clone, Copy, Default)]
#[cfg_attr(not(target_arch = "spirv"), derive(Debug))]
#[repr(transparent)]
pub struct Half(Held);

/// The nearest half of the result of an operation.
#[cfg(not(target_arch = "spirv"))]
#[inline(always)]
fn rounded(x: f32) -> Half {
    Half::new(x)
}

impl Half {
    /// The nearest one. From 65520 on it is infinite.
    #[inline(always)]
    #[must_use]
    pub fn new(x: f32) -> Self {
        #[cfg(target_arch = "spirv")]
        return Self(x as f16);
        #[cfg(not(target_arch = "spirv"))]
        return Self(super::F16::new(x).get());
    }

    /// As an `f32`, exactly.
    #[inline(always)]
    #[must_use]
    pub fn get(self) -> f32 {
        #[cfg(target_arch = "spirv")]
        return self.0 as f32;
        #[cfg(not(target_arch = "spirv"))]
        return self.0;
    }

    functions! {
        /// Square root; the number must not be negative.
        sqrt(a) = "OpExtInst typeof*{r} %glsl 31", rounded(Real::sqrt(a.0));
        /// Magnitude.
        abs(a) = "OpExtInst typeof*{r} %glsl 4", Self(Real::abs(a.0));
        /// The largest whole number that is not above it.
        floor(a) = "OpExtInst typeof*{r} %glsl 8", Self(Real::floor(a.0));
        /// The smaller of two numbers.
        min(a, other) = "OpExtInst typeof*{r} %glsl 37", Self(Real::min(a.0, other.0));
        /// The larger of two numbers.
        max(a, other) = "OpExtInst typeof*{r} %glsl 40", Self(Real::max(a.0, other.0));
        /// `self * factor + summand`, rounded once or twice.
        mul_add(a, factor, summand) = "OpExtInst typeof*{r} %glsl 50",
            rounded(rounded(a.0 * factor.0).0 + summand.0);
    }

    /// The number itself from `least` to `most`, which must not be below `least`.
    #[inline(always)]
    #[must_use]
    pub fn clamp(self, least: Self, most: Self) -> Self {
        self.max(least).min(most)
    }
}

compared!(Half);

/// Exact.
impl From<Half> for f32 {
    #[inline(always)]
    fn from(x: Half) -> Self {
        x.get()
    }
}

impl Neg for Half {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        instruction!(Self, "OpFNegate typeof*{r}", [a = self], Self(-a.0))
    }
}

macro_rules! operators {
    ($($name:ident, $method:ident, $assign:ident, $assign_method:ident, $instruction:literal, $op:tt;)*) => { $(
        impl $name for Half {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                instruction!(Self, $instruction, [a = self, b = other], rounded(a.0 $op b.0))
            }
        }
        operators!(@of $name $method $assign $assign_method $instruction $op; Half2 { x, y });
        operators!(@of $name $method $assign $assign_method $instruction $op; Half3 { x, y, z });
        operators!(@of $name $method $assign $assign_method $instruction $op; Half4 { x, y, z, w });
        operators!(@assign $name $method $assign $assign_method Half Half2 Half3 Half4);
    )* };
    (@of $name:ident $method:ident $assign:ident $assign_method:ident $instruction:literal $op:tt;
        $vector:ident { $($part:ident),+ }) => {
        /// Part by part.
        impl $name for $vector {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                instruction!(Self, $instruction, [a = self, b = other], Self { $($part: a.$part $op b.$part),+ })
            }
        }
    };
    (@assign $name:ident $method:ident $assign:ident $assign_method:ident $($number:ident)+) => { $(
        impl $assign for $number {
            #[inline(always)]
            fn $assign_method(&mut self, other: Self) {
                *self = $name::$method(*self, other);
            }
        }
    )+ };
}

operators! {
    Add, add, AddAssign, add_assign, "OpFAdd typeof*{r}", +;
    Sub, sub, SubAssign, sub_assign, "OpFSub typeof*{r}", -;
    Mul, mul, MulAssign, mul_assign, "OpFMul typeof*{r}", *;
    Div, div, DivAssign, div_assign, "OpFDiv typeof*{r}", /;
}

macro_rules! vectors {
    ($($(#[$doc:meta])* $vector:ident of $wide:ident { $x:ident $(, $part:ident)+ })+) => { $(
        $(#[$doc])*
        #[derive(Clone, Copy, Default, PartialEq)]
        #[cfg_attr(not(target_arch = "spirv"), derive(Debug))]
        #[cfg_attr(target_arch = "spirv", rust_gpu::vector::v1)]
        #[repr(C)]
        pub struct $vector {
            /// The first.
            pub $x: Half,
            $(
                #[doc = concat!("The part `", stringify!($part), "`.")]
                pub $part: Half,
            )+
        }

        impl $vector {
            /// Of its parts.
            #[inline(always)]
            #[must_use]
            pub fn new($x: Half $(, $part: Half)+) -> Self {
                Self { $x $(, $part)+ }
            }

            /// The same number in each part.
            #[inline(always)]
            #[must_use]
            pub fn splat(x: Half) -> Self {
                Self { $x: x $(, $part: x)+ }
            }

            functions! {
                /// Magnitudes.
                abs(a) = "OpExtInst typeof*{r} %glsl 4", Self { $x: a.$x.abs() $(, $part: a.$part.abs())+ };
                /// The smaller parts.
                min(a, other) = "OpExtInst typeof*{r} %glsl 37",
                    Self { $x: a.$x.min(other.$x) $(, $part: a.$part.min(other.$part))+ };
                /// The larger parts.
                max(a, other) = "OpExtInst typeof*{r} %glsl 40",
                    Self { $x: a.$x.max(other.$x) $(, $part: a.$part.max(other.$part))+ };
                /// `self * factor + summand`, part by part, rounded once or twice.
                mul_add(a, factor, summand) = "OpExtInst typeof*{r} %glsl 50",
                    Self {
                        $x: a.$x.mul_add(factor.$x, summand.$x)
                        $(, $part: a.$part.mul_add(factor.$part, summand.$part))+
                    };
            }

            /// Each part from `least`'s to `most`'s, which must not be below it.
            #[inline(always)]
            #[must_use]
            pub fn clamp(self, least: Self, most: Self) -> Self {
                self.max(least).min(most)
            }

            /// From `self`, where `share` is 0, to `other`, where it is 1.
            #[inline(always)]
            #[must_use]
            pub fn lerp(self, other: Self, share: Half) -> Self {
                self + (other - self) * share
            }

            /// Length: the root of the sum of the squares, which is infinite from 65520 on.
            #[inline(always)]
            #[must_use]
            pub fn length(self) -> Half {
                self.dot(self).sqrt()
            }

            /// The vector by its length, which must not be 0.
            #[inline(always)]
            #[must_use]
            pub fn normalize(self) -> Self {
                self / self.length()
            }

            /// The dot product.
            #[inline(always)]
            #[must_use]
            pub fn dot(self, other: Self) -> Half {
                instruction!(
                    Half,
                    "OpDot typeof*{r}",
                    [a = self, b = other],
                    a.$x * b.$x $(+ a.$part * b.$part)+
                )
            }
        }

        impl Neg for $vector {
            type Output = Self;
            #[inline(always)]
            fn neg(self) -> Self {
                instruction!(
                    Self,
                    "OpFNegate typeof*{r}",
                    [a = self],
                    Self { $x: -a.$x $(, $part: -a.$part)+ }
                )
            }
        }

        impl Mul<Half> for $vector {
            type Output = Self;
            #[inline(always)]
            fn mul(self, factor: Half) -> Self {
                instruction!(
                    Self,
                    "OpVectorTimesScalar typeof*{r}",
                    [a = self, b = factor],
                    Self { $x: a.$x * b $(, $part: a.$part * b)+ }
                )
            }
        }

        impl Mul<$vector> for Half {
            type Output = $vector;
            #[inline(always)]
            fn mul(self, v: $vector) -> $vector {
                v * self
            }
        }

        impl Div<Half> for $vector {
            type Output = Self;
            #[inline(always)]
            fn div(self, divisor: Half) -> Self {
                self / Self::splat(divisor)
            }
        }

        /// Each part rounded to the nearest half.
        impl From<$wide> for $vector {
            #[inline(always)]
            fn from(v: $wide) -> Self {
                instruction!(
                    Self,
                    "OpFConvert typeof*{r}",
                    [a = v],
                    Self { $x: Half::new(a.$x) $(, $part: Half::new(a.$part))+ }
                )
            }
        }

        impl From<$vector> for $wide {
            #[inline(always)]
            fn from(v: $vector) -> Self {
                instruction!(
                    Self,
                    "OpFConvert typeof*{r}",
                    [a = v],
                    Self::new(a.$x.get() $(, a.$part.get())+)
                )
            }
        }
    )+ };
}

vectors! {
    /// Two numbers of 16 bits, computed with by the device's own instructions: [`Half`].
    Half2 of Vec2 { x, y }
    /// Three of them.
    Half3 of Vec3 { x, y, z }
    /// Four of them.
    Half4 of Vec4 { x, y, z, w }
}

impl From<F16x2> for Half2 {
    #[inline(always)]
    fn from(v: F16x2) -> Self {
        let wide: Vec2 = instruction!(
            Vec2,
            "OpExtInst typeof*{r} %glsl 62",
            [a = v.to_bits()],
            F16x2::from_bits(a).into()
        );
        wide.into()
    }
}

impl From<Half2> for F16x2 {
    #[inline(always)]
    fn from(v: Half2) -> Self {
        let bits: u32 = instruction!(
            u32,
            "OpExtInst typeof*{r} %glsl 58",
            [a = Vec2::from(v)],
            Self::from(a).to_bits()
        );
        Self::from_bits(bits)
    }
}

impl From<F16x4> for Half4 {
    #[inline(always)]
    fn from(v: F16x4) -> Self {
        let (xy, zw) = (Half2::from(v.xy), Half2::from(v.zw));
        Self::new(xy.x, xy.y, zw.x, zw.y)
    }
}

impl From<Half4> for F16x4 {
    #[inline(always)]
    fn from(v: Half4) -> Self {
        Self {
            xy: Half2::new(v.x, v.y).into(),
            zw: Half2::new(v.z, v.w).into(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::F16;
    use super::*;

    /// Numbers with all digits, near the ends, and below 2^-14.
    const NUMBERS: [f32; 8] = [0.0, 1.0, -2.5, 0.333_251_95, 1e-3, 6e-6, -65504.0, 300.0];

    #[test]
    fn results_are_those_of_exact_halves() {
        for (a, b) in NUMBERS.into_iter().flat_map(|a| NUMBERS.map(|b| (a, b))) {
            let (x, y) = (Half::new(a), Half::new(b));
            let (p, q) = (F16::new(a), F16::new(b));
            let same = |half: Half, exact: F16| {
                assert_eq!(half.get().to_bits(), exact.get().to_bits(), "{a}, {b}");
            };
            same(x + y, p + q);
            same(x - y, p - q);
            same(x * y, p * q);
            same(-x, -p);
            same(x.abs().sqrt(), p.abs().sqrt());
            if b != 0.0 {
                same(x / y, p / q);
            }
            assert_eq!(x < y, p < q);
            assert!(x.min(y) <= x.max(y));
        }
    }

    #[test]
    fn vectors_are_their_parts() {
        let parts = |v: Half4| [v.x, v.y, v.z, v.w];
        let a = Half4::from(Vec4::new(1.0, -2.0, 0.1, 300.0));
        let b = Half4::from(Vec4::new(3.0, 0.25, 7.0, -0.01));
        let both = || parts(a).into_iter().zip(parts(b));
        assert!(both().map(|(a, b)| a + b).eq(parts(a + b)));
        assert!(both().map(|(a, b)| a * b).eq(parts(a * b)));
        assert!(both().map(|(a, b)| a.max(b)).eq(parts(a.max(b))));
        assert_eq!(a.dot(b), a.x * b.x + a.y * b.y + a.z * b.z + a.w * b.w);
        assert_eq!(a * b.x, a * Half4::splat(b.x));
        let mut sum = Half3::new(a.x, a.y, a.z);
        sum += Half3::splat(b.x);
        assert_eq!(sum.z, a.z + b.x);
        assert_eq!(Half4::from(F16x4::from(a)), a);
        assert_eq!(Vec4::from(-a), -Vec4::from(a));
    }
}
