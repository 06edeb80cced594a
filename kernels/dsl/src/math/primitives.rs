//! What the elementary functions are made of beside sums and products: the bits of a number.

use super::reduce;
use crate::Real;

/// A [`Real`] that has the functions of [`math`](crate::math): `f32`, `f64` and SIMD lanes of both.
///
/// What it asks for is not for kernels: they call the functions.
pub trait Elementary: Real {
    /// The largest finite number.
    #[doc(hidden)]
    fn largest() -> Self;
    /// The number, hidden from a shader's compiler, which then can neither contract nor reorder
    /// what it was computed by. At least -2^126, or for `f64` -2^1022.
    #[doc(hidden)]
    fn guard(self) -> Self;
    /// The upper 12 bits of the significand, of `f64` 26: the rest is exact.
    #[doc(hidden)]
    fn upper(self) -> Self;
    /// `e` and `m` from sqrt(1/2) to sqrt(2) with `m * 2^e` being this normal number above zero.
    #[doc(hidden)]
    fn decompose(self) -> (Self, Self);
    /// Two to the power of this whole number, which has a normal result.
    #[doc(hidden)]
    fn power_of_two(self) -> Self;
    /// The magnitude of this number with the other's sign.
    #[doc(hidden)]
    fn copy_sign(self, sign: Self) -> Self;
    /// This number, with its sign changed where the other's is negative.
    #[doc(hidden)]
    fn flip_sign(self, sign: Self) -> Self;
    /// About its reciprocal: within 13 %, from 2^-100 to 2^100.
    #[doc(hidden)]
    fn reciprocal_seed(self) -> Self;
    /// About the reciprocal of its root: within 4 %, from 2^-100 to 2^100.
    #[doc(hidden)]
    fn inverse_root_seed(self) -> Self;
    /// A number above those that [`reduce`] takes, by quarter turns: their count modulo 4, and what
    /// is left in two parts.
    #[doc(hidden)]
    fn reduce_large(self) -> (Self, Self, Self);
    /// The sum rounded to the neighbour whose last bit is 1, where it is not exact.
    #[doc(hidden)]
    fn odd_sum(self, other: Self) -> Self;
    /// NaN.
    #[doc(hidden)]
    fn not_a_number(self) -> Self;
    /// Infinity with the sign of this number, which is zero.
    #[doc(hidden)]
    fn unbounded(self) -> Self;
}

/// [`Elementary::odd_sum`] of a type with bits.
macro_rules! odd_sum {
    () => {
        #[inline(always)]
        fn odd_sum(self, other: Self) -> Self {
            let (sum, error) = self.two_sum(other);
            let bits = sum.to_bits();
            // To the neighbour on the error's side.
            let odd = if (error < 0.0) == (sum < 0.0) {
                bits | 1
            } else {
                bits.wrapping_sub(1) | 1
            };
            if error == 0.0 {
                sum
            } else {
                Self::from_bits(odd)
            }
        }
    };
}

impl Elementary for f32 {
    #[inline(always)]
    fn largest() -> Self {
        Self::MAX
    }
    #[inline(always)]
    fn guard(self) -> Self {
        // Not `core`'s `max`, which asks whether its argument is a NaN and branches.
        #[cfg(target_arch = "spirv")]
        return Real::max(self, -85_070_591_730_234_615_865_843_651_857_942_052_864.0);
        #[cfg(not(target_arch = "spirv"))]
        return self;
    }
    #[inline(always)]
    fn upper(self) -> Self {
        Self::from_bits(self.to_bits() & 0xffff_f000)
    }
    #[inline(always)]
    fn decompose(self) -> (Self, Self) {
        // The bits of sqrt(1/2).
        let from_root = self.to_bits().wrapping_sub(0x3f35_04f3);
        let exponent = (from_root as i32) >> 23;
        let m = (from_root & 0x007f_ffff).wrapping_add(0x3f35_04f3);
        (exponent as Self, Self::from_bits(m))
    }
    #[inline(always)]
    fn power_of_two(self) -> Self {
        Self::from_bits(((crate::to_i32(self).wrapping_add(127)) as u32) << 23)
    }
    #[inline(always)]
    fn copy_sign(self, sign: Self) -> Self {
        Self::from_bits((self.to_bits() & 0x7fff_ffff) | (sign.to_bits() & 0x8000_0000))
    }
    #[inline(always)]
    fn flip_sign(self, sign: Self) -> Self {
        Self::from_bits(self.to_bits() ^ (sign.to_bits() & 0x8000_0000))
    }
    #[inline(always)]
    fn reciprocal_seed(self) -> Self {
        Self::from_bits(0x7ef3_11c7_u32.wrapping_sub(self.to_bits()))
    }
    #[inline(always)]
    fn inverse_root_seed(self) -> Self {
        Self::from_bits(0x5f37_5a86_u32.wrapping_sub(self.to_bits() >> 1))
    }
    #[inline(always)]
    fn reduce_large(self) -> (Self, Self, Self) {
        reduce::single(self)
    }
    odd_sum!();
    #[inline(always)]
    fn not_a_number(self) -> Self {
        Self::from_bits(self.to_bits() | 0x7fc0_0000)
    }
    #[inline(always)]
    fn unbounded(self) -> Self {
        Self::from_bits(self.to_bits() | 0x7f80_0000)
    }
}

/// Without integers of 64 bits, which few shaders have: exponents by comparisons with powers of two,
/// first guesses from `f32`.
#[cfg(any(target_arch = "spirv", test))]
mod stepwise {
    use super::Elementary;
    use crate::{Real, lit};

    macro_rules! steps {
        ($each:ident) => {
            $each!(
                512.0,
                1.340_780_792_994_259_7e154,
                7.458_340_731_200_207e-155
            );
            $each!(256.0, 1.157_920_892_373_162e77, 8.636_168_555_094_445e-78);
            $each!(128.0, 3.402_823_669_209_385e38, 2.938_735_877_055_719e-39);
            $each!(
                64.0,
                18_446_744_073_709_551_616.0,
                5.421_010_862_427_522e-20
            );
            $each!(32.0, 4_294_967_296.0, 2.328_306_436_538_696_3e-10);
            $each!(16.0, 65_536.0, 1.525_878_906_25e-5);
            $each!(8.0, 256.0, 0.003_906_25);
            $each!(4.0, 16.0, 0.062_5);
            $each!(2.0, 4.0, 0.25);
            $each!(1.0, 2.0, 0.5);
        };
    }

    #[inline(always)]
    pub fn decompose(x: f64) -> (f64, f64) {
        let (mut e, mut m) = (0.0, x);
        macro_rules! step {
            ($by:literal, $power:literal, $inverse:literal) => {
                let large = m >= $power;
                m = f64::select(large, m * $inverse, m);
                e = f64::select(large, e + $by, e);
                let small = m < 2.0 * $inverse;
                m = f64::select(small, m * $power, m);
                e = f64::select(small, e - $by, e);
            };
        }
        steps!(step);
        // From 1 to 2 now.
        let upper = m > core::f64::consts::SQRT_2;
        (
            f64::select(upper, e + 1.0, e),
            f64::select(upper, m * 0.5, m),
        )
    }

    #[inline(always)]
    pub fn power_of_two(n: f64) -> f64 {
        let (mut left, mut power) = (Real::abs(n), 1.0);
        let negative = n < 0.0;
        macro_rules! step {
            ($by:literal, $power:literal, $inverse:literal) => {
                let has = left >= $by;
                let factor = f64::select(negative, $inverse, $power);
                power = f64::select(has, power * factor, power);
                left = f64::select(has, left - $by, left);
            };
        }
        steps!(step);
        // The last step has nothing after it that reads what is left.
        let _ = left;
        power
    }

    #[inline(always)]
    pub fn reciprocal_seed(x: f64) -> f64 {
        f64::from((x as f32).reciprocal_seed())
    }

    #[inline(always)]
    pub fn inverse_root_seed(x: f64) -> f64 {
        f64::from((x as f32).inverse_root_seed())
    }

    #[inline(always)]
    pub fn flip_sign(x: f64, sign: f64) -> f64 {
        f64::select(sign < 0.0, -x, x)
    }

    #[inline(always)]
    pub fn copy_sign(x: f64, sign: f64) -> f64 {
        flip_sign(Real::abs(x), sign)
    }

    #[inline(always)]
    pub fn infinity(sign: f64) -> f64 {
        // Nothing that a compiler sees through: the argument is not known.
        let large = Real::max(Real::abs(sign), lit!(1.0e300));
        flip_sign(large * large, sign)
    }
}

impl Elementary for f64 {
    #[inline(always)]
    fn largest() -> Self {
        Self::MAX
    }
    #[inline(always)]
    fn guard(self) -> Self {
        #[cfg(target_arch = "spirv")]
        return Real::max(self, const { Self::from_bits(0xffd0_0000_0000_0000) });
        #[cfg(not(target_arch = "spirv"))]
        return self;
    }
    #[inline(always)]
    fn upper(self) -> Self {
        let scaled = (self * 134_217_729.0).guard();
        (scaled - (scaled - self).guard()).guard()
    }
    #[inline(always)]
    fn decompose(self) -> (Self, Self) {
        #[cfg(target_arch = "spirv")]
        return stepwise::decompose(self);
        #[cfg(not(target_arch = "spirv"))]
        {
            const ROOT: u64 = 0x3fe6_a09e_667f_3bcd;
            let from_root = self.to_bits().wrapping_sub(ROOT);
            let exponent = (from_root as i64) >> 52;
            let m = (from_root & 0x000f_ffff_ffff_ffff).wrapping_add(ROOT);
            (exponent as Self, Self::from_bits(m))
        }
    }
    #[inline(always)]
    fn power_of_two(self) -> Self {
        #[cfg(target_arch = "spirv")]
        return stepwise::power_of_two(self);
        #[cfg(not(target_arch = "spirv"))]
        return Self::from_bits(((self as i64).wrapping_add(1023) as u64) << 52);
    }
    #[inline(always)]
    fn copy_sign(self, sign: Self) -> Self {
        #[cfg(target_arch = "spirv")]
        return stepwise::copy_sign(self, sign);
        #[cfg(not(target_arch = "spirv"))]
        return self.copysign(sign);
    }
    #[inline(always)]
    fn flip_sign(self, sign: Self) -> Self {
        #[cfg(target_arch = "spirv")]
        return stepwise::flip_sign(self, sign);
        #[cfg(not(target_arch = "spirv"))]
        return Self::from_bits(self.to_bits() ^ (sign.to_bits() & (1 << 63)));
    }
    #[inline(always)]
    fn reciprocal_seed(self) -> Self {
        #[cfg(target_arch = "spirv")]
        return stepwise::reciprocal_seed(self);
        #[cfg(not(target_arch = "spirv"))]
        return f64::from((self as f32).reciprocal_seed());
    }
    #[inline(always)]
    fn inverse_root_seed(self) -> Self {
        #[cfg(target_arch = "spirv")]
        return stepwise::inverse_root_seed(self);
        #[cfg(not(target_arch = "spirv"))]
        return f64::from((self as f32).inverse_root_seed());
    }
    #[inline(always)]
    fn reduce_large(self) -> (Self, Self, Self) {
        reduce::double(self)
    }
    odd_sum!();
    #[inline(always)]
    fn not_a_number(self) -> Self {
        #[cfg(target_arch = "spirv")]
        {
            let infinity = stepwise::infinity(self);
            return infinity - infinity;
        }
        #[cfg(not(target_arch = "spirv"))]
        return Self::from_bits(self.to_bits() | 0x7ff8_0000_0000_0000);
    }
    #[inline(always)]
    fn unbounded(self) -> Self {
        #[cfg(target_arch = "spirv")]
        return stepwise::infinity(self);
        #[cfg(not(target_arch = "spirv"))]
        return Self::from_bits(self.to_bits() | 0x7ff0_0000_0000_0000);
    }
}

#[cfg(test)]
mod tests {
    use super::stepwise;

    fn numbers() -> impl Iterator<Item = f64> {
        (-1020..1020).map(|n| 2.0_f64.powi(n) * (1.0 + 0.37 * f64::from(n.rem_euclid(7)) / 3.0))
    }

    /// What shaders do without 64-bit integers, against what it stands for.
    #[test]
    fn exponents_without_integers_are_exact() {
        for x in numbers() {
            let (e, m) = stepwise::decompose(x);
            assert!((0.7..1.42).contains(&m), "{x:e}: {m}");
            // In two steps, since 2^e alone may overflow.
            let half = (e * 0.5).floor();
            assert_eq!(m * half.exp2() * (e - half).exp2(), x);
        }
        for n in -1022..=1023 {
            let power = stepwise::power_of_two(f64::from(n));
            assert_eq!(power, f64::from_bits(((1023 + n) as u64) << 52), "{n}");
        }
    }

    #[test]
    fn first_guesses_are_near() {
        for x in numbers().filter(|x| (1.0e-30..1.0e30).contains(x)) {
            let relative = |guess: f64, exact: f64| ((guess - exact) / exact).abs();
            assert!(
                relative(stepwise::reciprocal_seed(x), 1.0 / x) < 0.15,
                "{x:e}"
            );
            assert!(
                relative(stepwise::inverse_root_seed(x), 1.0 / x.sqrt()) < 0.05,
                "{x:e}"
            );
        }
    }

    #[test]
    fn signs_are_moved() {
        for x in [-2.5, 2.5] {
            assert_eq!(stepwise::flip_sign(x, -1.0), -x);
            assert_eq!(stepwise::flip_sign(x, 1.0), x);
            assert_eq!(stepwise::copy_sign(x, -1.0), -2.5);
            assert_eq!(stepwise::copy_sign(x, 1.0), 2.5);
        }
        assert_eq!(stepwise::infinity(1.0), f64::INFINITY);
        assert_eq!(stepwise::infinity(-1.0), f64::NEG_INFINITY);
    }
}
