//! The device's own functions of `f32`: one instruction each, or a few.
//!
//! Natively they are the standard library's. A device may differ by what its language allows, and
//! results of two devices differ by that much: a kernel that uses one states it as its tolerance.
//!
//! | | WGSL | GLSL and Vulkan | Metal |
//! | --- | --- | --- | --- |
//! | `sin`, `cos` | 2^-11 absolute within pi | 2^-11 absolute within pi | 4 ulp |
//! | `tan` | of `sin / cos` | of `sin / cos` | 6 ulp |
//! | `asin`, `acos` | 6.77e-5 absolute | of `atan2(x, sqrt(1 - x^2))` | 4 ulp |
//! | `atan`, `atan2` | 4096 ulp | 4096 ulp | 5 and 6 ulp |
//! | `sinh`, `cosh` | of `exp` | of `exp` | 4 ulp |
//! | `tanh` | 1e-5 absolute | of `sinh / cosh` | 5 ulp |
//! | `exp`, `exp2` | 3 + 2 abs(x) ulp | 3 + 2 abs(x) ulp | 4 ulp |
//! | `ln`, `log2` | 3 ulp; 2^-21 absolute from 1/2 to 2 | likewise | 4 ulp |
//! | `pow` | of `exp2(y * log2(x))`; nothing for `x` below 0 | likewise | 16 ulp |
//! | `fma` | of `a * b + c` | of `a * b + c` | correctly rounded |
//!
//! Sources: WGSL, 15.7.4 "Floating Point Accuracy"; Vulkan, appendix A "Precision and Operation of
//! SPIR-V Instructions"; Metal Shading Language Specification, 8.4 "ULPs and Relative Error".

macro_rules! functions {
    ($($(#[$doc:meta])* $name:ident($($argument:ident),+) = $method:ident;)*) => {$(
        $(#[$doc])*
        #[inline(always)]
        #[must_use]
        pub fn $name($($argument: f32),+) -> f32 {
            #[cfg(target_arch = "spirv")]
            return spirv_std::num_traits::Float::$method($($argument),+);
            #[cfg(not(target_arch = "spirv"))]
            return f32::$method($($argument),+);
        }
    )*};
}

functions! {
    /// Sine of an angle in radians.
    sin(x) = sin;
    /// Cosine of an angle in radians.
    cos(x) = cos;
    /// Tangent of an angle in radians.
    tan(x) = tan;
    /// The angle from -pi/2 to pi/2 whose sine is `x`.
    asin(x) = asin;
    /// The angle from 0 to pi whose cosine is `x`.
    acos(x) = acos;
    /// The angle from -pi/2 to pi/2 whose tangent is `x`.
    atan(x) = atan;
    /// The angle of the point with ordinate `y` and abscissa `x`.
    atan2(y, x) = atan2;
    /// Hyperbolic sine.
    sinh(x) = sinh;
    /// Hyperbolic cosine.
    cosh(x) = cosh;
    /// Hyperbolic tangent.
    tanh(x) = tanh;
    /// `e` to the power of `x`.
    exp(x) = exp;
    /// 2 to the power of `x`.
    exp2(x) = exp2;
    /// Natural logarithm.
    ln(x) = ln;
    /// Logarithm to base 2.
    log2(x) = log2;
    /// `x` to the power of `y`, for `x` above 0.
    pow(x, y) = powf;
    /// `a * b + c`, rounded once where the device can.
    fma(a, b, c) = mul_add;
}
