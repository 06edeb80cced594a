//! Logarithms, powers and the cube root.

use super::exponential::binary;
use super::polynomials::{inverse_cube_root, logarithm, ratio_logarithm};
use super::{Elementary, bounded, ordered_sum, quotient, reciprocal, scaled};
use crate::{Real, lit};

/// ln(2) in two parts, of which the first's products with exponents are exact.
#[inline(always)]
pub fn ln_2<R: Real>() -> (R, R) {
    if R::IS_WIDE {
        (
            lit!(0.693_147_180_559_663),
            lit!(2.823_529_056_303_157_7e-13),
        )
    } else {
        (
            lit!(0.693_145_751_953_125),
            lit!(1.428_606_820_309_417_3e-6),
        )
    }
}

/// `e` and `m` from sqrt(1/2) to sqrt(2) with `x = m * 2^e`; `x` above zero and finite.
#[inline(always)]
fn split<R: Elementary>(x: R) -> (R, R) {
    let (least, up, by): (R, R, R) = if R::IS_WIDE {
        (
            lit!(f64::MIN_POSITIVE),
            lit!(18_014_398_509_481_984.0),
            lit!(54.0),
        )
    } else {
        (
            lit!(f32::MIN_POSITIVE as f64),
            lit!(16_777_216.0),
            lit!(24.0),
        )
    };
    let denormal = x.lt(least);
    let (e, m) = R::select(denormal, x * up, x).decompose();
    (R::select(denormal, e - by, e), m)
}

/// The result of a logarithm of `x` where that is above zero and finite, else what IEEE 754 says.
#[inline(always)]
fn in_domain<R: Elementary>(x: R, result: R) -> R {
    let outside = R::select(
        x.gt(lit!(0.0)),
        x,
        R::select(x.eq(lit!(0.0)), -x.abs().unbounded(), x.not_a_number()),
    );
    let inside = x.gt(lit!(0.0)) & x.le(R::largest());
    R::select(inside, result, outside)
}

/// `e ln(2) + ln(1 + f) + rest`, the last far below the others.
#[inline(always)]
fn natural<R: Elementary>(e: R, f: R, rest: R) -> R {
    let (upper, lower): (R, R) = ln_2();
    let half = f * f * lit!(0.5);
    let tail = f * f * f * logarithm(f);
    let (high, low) = ordered_sum(e * upper, f);
    // Without whole powers the first summand is the smaller one.
    let none = e.eq(lit!(0.0));
    let (high, low) = (R::select(none, f, high), R::select(none, lit!(0.0), low));
    high + (low - (half - (tail + (e * lower + rest))))
}

/// Natural logarithm.
#[inline(always)]
#[must_use]
pub fn ln<R: Elementary>(x: R) -> R {
    let (e, m) = split(x);
    in_domain(x, natural(e, m - lit!(1.0), lit!(0.0)))
}

/// `ln(1 + x)`, as exact near zero as elsewhere.
#[inline(always)]
#[must_use]
pub fn ln_1p<R: Elementary>(x: R) -> R {
    let (sum, error) = x.two_sum(lit!(1.0));
    let near = x.gt(lit!(-0.292)) & x.lt(lit!(0.414));
    let (e, m) = sum.decompose();
    let e = R::select(near, lit!(0.0), e);
    let f = R::select(near, x, m - lit!(1.0));
    // What the sum lost, by its size; nothing of a large one.
    let power = (-e.min(lit!(100.0))).power_of_two();
    let rest = R::select(near, lit!(0.0), error * power * reciprocal(m));
    let result = natural(e, f, rest).copy_sign(x);
    in_domain(sum, result)
}

/// Logarithm to base 2.
#[inline(always)]
#[must_use]
pub fn log2<R: Elementary>(x: R) -> R {
    let (e, m) = split(x);
    let f = m - lit!(1.0);
    let half = f * f * lit!(0.5);
    let tail = f * f * f * logarithm(f);
    // The product with 1 / ln(2) by halves, of which the first is exact.
    let (upper, lower): (R, R) = if R::IS_WIDE {
        (
            lit!(1.442_695_021_629_333_5),
            lit!(1.925_962_991_126_617_5e-8),
        )
    } else {
        (lit!(1.442_382_812_5), lit!(0.000_312_228_388_963_407_33))
    };
    let high = (f - half).upper();
    let low = (f - high) - half + tail;
    let product = (high * upper).guard();
    let rest = low * upper + (low + high) * lower;
    let (sum, error) = ordered_sum(e, product);
    let none = e.eq(lit!(0.0));
    let result = R::select(none, product + rest, sum + (error + rest));
    in_domain(x, result)
}

/// The logarithm to base 2 of a positive finite number, in two parts: 2^-38 of it, of `f64` 2^-66.
#[inline(always)]
fn precise_log2<R: Elementary>(x: R) -> (R, R) {
    let (e, m) = split(x);
    // ln(m) = 2 (s + s^3 / 3 + ...)
    let under = m.two_sum(lit!(1.0));
    let (s, s_low) = quotient((m - lit!(1.0), lit!(0.0)), under);
    let (square, error) = s.two_product(s);
    let square_low = error + (s + s) * s_low;
    let (cube, error) = square.two_product(s);
    let cube_low = error + (square_low * s + square * s_low);
    let (third, third_low): (R, R) = if R::IS_WIDE {
        (
            lit!(0.666_666_666_666_666_6),
            lit!(3.700_743_415_417_188e-17),
        )
    } else {
        (
            lit!(0.666_666_686_534_881_6),
            lit!(-1.986_821_552_174_915_5e-8),
        )
    };
    let (second, error) = cube.two_product(third);
    let second_low = error + (cube_low * third + cube * third_low);
    let tail = cube * square * ratio_logarithm(square);
    let (high, error) = ordered_sum(s + s, second);
    let low = error + ((s_low + s_low) + (second_low + tail));
    let (base, base_low): (R, R) = if R::IS_WIDE {
        (
            lit!(core::f64::consts::LOG2_E),
            lit!(2.035_527_374_093_103_3e-17),
        )
    } else {
        (
            lit!(1.442_695_021_629_333_5),
            lit!(1.925_963_033_500_011e-8),
        )
    };
    let (product, error) = high.two_product(base);
    let rest = error + (high * base_low + low * base);
    let (sum, error) = e.two_sum(product);
    ordered_sum(sum, error + rest)
}

/// `x` to the power of `y`, with IEEE 754's answers for zeros, infinities, whole `y` of a negative
/// `x`, and NaN for other `y` of it.
#[inline(always)]
#[must_use]
pub fn pow<R: Elementary>(x: R, y: R) -> R {
    let (zero, one): (R, R) = (lit!(0.0), lit!(1.0));
    let size = x.abs();
    let (high, low) = precise_log2(size);
    // Beyond the limit any power but that of 1 is zero or infinite.
    let limit: R = if R::IS_WIDE {
        lit!(1.0e24)
    } else {
        lit!(1.0e12)
    };
    let exponent = bounded(y, -limit, limit);
    let (product, error) = high.two_product(exponent);
    let least: R = if R::IS_WIDE {
        lit!(1100.0)
    } else {
        lit!(160.0)
    };
    let within = product.abs().le(least);
    let product = bounded(product, -least, least);
    let rest = R::select(within, error + low * exponent, zero);
    let n = (product + lit!(0.5)).floor();
    let (r, r_low) = ordered_sum(product - n, rest);
    let finite = scaled(binary(r, r_low), n);
    let grows = y.gt(zero);
    // Of what is not known, or a compiler meets an infinite constant.
    let infinity = zero.copy_sign(x).unbounded().abs();
    let at_zero = R::select(grows, zero, infinity);
    let at_infinity = R::select(grows, infinity, zero);
    let result = R::select(size.eq(zero), at_zero, finite);
    let result = R::select(size.gt(R::largest()), at_infinity, result);
    // Whole and odd exponents keep the sign; the rest of negative bases have no power.
    let whole = y.floor().eq(y);
    let half = y * lit!(0.5);
    let odd = whole & !half.floor().eq(half);
    let result = R::select(odd, result.flip_sign(x), result);
    let negative = x.lt(zero) & !whole & size.le(R::largest());
    let result = R::select(negative, x.not_a_number(), result);
    // NaN of either, but for the powers that are 1 whatever the other is.
    let number = size.ge(zero) & y.abs().ge(zero);
    let result = R::select(number, result, (x + y).not_a_number());
    R::select(x.eq(one) | y.eq(zero), one, result)
}

/// Cube root, of negative numbers too.
#[inline(always)]
#[must_use]
pub fn cbrt<R: Elementary>(x: R) -> R {
    let size = x.abs();
    let (e, m) = split(size);
    let third = lit!(1.0 / 3.0);
    // e = 3 k + j
    let k = ((e + lit!(0.5)) * third).floor();
    let m = m * (e - k * lit!(3.0)).power_of_two();
    let mut inverse = inverse_cube_root(m);
    let mut newton = || {
        let error = R::literal::<{ super::ONE }>() - m * inverse * inverse * inverse;
        inverse = inverse + inverse * error * third;
    };
    newton();
    newton();
    newton();
    if R::IS_WIDE {
        newton();
    }
    let root = m * inverse * inverse;
    // What is missing to m, exactly.
    let (square, square_low) = root.two_product(root);
    let (cube, cube_low) = square.two_product(root);
    let missing = ((m - cube) - cube_low) - square_low * root;
    let root = root + missing * inverse * inverse * third;
    let inside = size.gt(lit!(0.0)) & size.le(R::largest());
    // The sign last: LLVM 22 makes another function of a choice behind it, for AVX-512.
    R::select(inside, root * k.power_of_two(), size).copy_sign(x)
}
