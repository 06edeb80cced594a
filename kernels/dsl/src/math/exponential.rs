//! Powers of e and of 2, and what is made of them.

use super::polynomials::{binary_power, exponential, hyperbolic_sine, hyperbolic_tangent};
use super::{Elementary, bounded, ordered_sum, reciprocal, scaled};
use crate::lit;

/// `n` and two parts of `r` with `x = n ln(2) + r`. `x` must be within the exponents' range.
#[inline(always)]
fn reduced<R: Elementary>(x: R) -> (R, R, R) {
    let n = (x * lit!(core::f64::consts::LOG2_E) + lit!(0.5)).floor();
    let (upper, lower): (R, R) = super::power::ln_2();
    // The first product is exact, and so is the difference.
    let high = (x - n * upper).guard();
    let low = n * lower;
    let r = high - low;
    let error = (high - r) - low;
    (n, r, error)
}

/// `n` and two parts of `e^x / 2^n`.
#[inline(always)]
fn parts<R: Elementary>(x: R) -> (R, R, R) {
    let (n, r, error) = reduced(x);
    let (first, second) = ordered_sum(r, r * r * exponential(r) + error);
    let (high, low) = ordered_sum(lit!(1.0), first);
    (n, high, low + second)
}

/// Arguments beyond which `e^x` is zero or infinite.
#[inline(always)]
fn in_range<R: Elementary>(x: R) -> R {
    if R::IS_WIDE {
        bounded(x, lit!(-746.0), lit!(710.0))
    } else {
        bounded(x, lit!(-104.0), lit!(89.0))
    }
}

/// `e` to the power of `x`.
#[inline(always)]
#[must_use]
pub fn exp<R: Elementary>(x: R) -> R {
    let (n, r, error) = reduced(in_range(x));
    // What `r + …` rounds off is a quarter of the result's last place at most: it need not be kept.
    let power = R::literal::<{ super::ONE }>() + (r + (r * r * exponential(r) + error));
    scaled(power, n)
}

/// 2 to the power of `x`.
#[inline(always)]
#[must_use]
pub fn exp2<R: Elementary>(x: R) -> R {
    let x = if R::IS_WIDE {
        bounded(x, lit!(-1076.0), lit!(1025.0))
    } else {
        bounded(x, lit!(-151.0), lit!(129.0))
    };
    let n = (x + lit!(0.5)).floor();
    scaled(binary(x - n, lit!(0.0)), n)
}

/// 2 to the power of `r + low`, the first from -1/2 to 1/2, the second below its last bit.
#[inline(always)]
pub fn binary<R: Elementary>(r: R, low: R) -> R {
    let (upper, lower): (R, R) = if R::IS_WIDE {
        (
            lit!(0.693_147_167_563_438_4),
            lit!(1.299_650_689_388_988_9e-8),
        )
    } else {
        (lit!(0.693_115_234_375), lit!(3.194_618_494_530_941_5e-5))
    };
    // r ln(2): the product of halves is exact.
    let high = r.upper();
    let rest = (r - high + low) * upper + r * (r * binary_power(r) + lower);
    let (sum, error) = ordered_sum(lit!(1.0), (high * upper).guard());
    sum + (error + rest)
}

/// `e^x - 1`, as exact near zero as elsewhere.
#[inline(always)]
#[must_use]
pub fn exp_m1<R: Elementary>(x: R) -> R {
    let (low, tiny): (R, R) = if R::IS_WIDE {
        (lit!(-40.0), lit!(1.0e-17))
    } else {
        (lit!(-20.0), lit!(2.0e-8))
    };
    let (n, r, error) = reduced(bounded(in_range(x), low, R::largest()));
    // Half the square exactly: it is what a power that nearly cancels 1 leaves over.
    let (square, square_low) = r.two_product(r);
    let rest = square * (exponential(r) - lit!(0.5)) + (square_low * lit!(0.5) + error);
    let (first, second) = ordered_sum(r, square * lit!(0.5));
    let second = second + rest;
    // A half of it, which has an exponent where it has one.
    let half = (n - lit!(1.0)).power_of_two();
    let (power, one) = half.two_sum(lit!(-0.5));
    let (sum, error) = (half * first).two_sum(power);
    let result = (sum + (error + (half * second + one))) * lit!(2.0);
    R::select(x.abs().lt(tiny), x, result.copy_sign(x))
}

/// Two parts of `e^x` and `e^-x` each, halved, for `x` not below zero; infinities where there is no
/// number.
#[inline(always)]
fn both_halves<R: Elementary>(x: R) -> ((R, R), (R, R)) {
    // Powers that have an exponent: beyond, the smaller one does not matter.
    let limit: R = if R::IS_WIDE { lit!(711.0) } else { lit!(90.0) };
    let x = bounded(x, lit!(0.0), limit);
    let (n, high, low) = parts(x);
    let (m, small_high, small_low) = parts(-x);
    let large = |x: R| scaled(x, n - lit!(1.0));
    let lowest: R = if R::IS_WIDE {
        lit!(-1020.0)
    } else {
        lit!(-124.0)
    };
    let power = (m.max(lowest) - lit!(1.0)).power_of_two();
    (
        (large(high), large(low)),
        (small_high * power, small_low * power),
    )
}

/// Hyperbolic sine.
#[inline(always)]
#[must_use]
pub fn sinh<R: Elementary>(x: R) -> R {
    let size = x.abs();
    let square = size * size;
    let near = size + size * square * hyperbolic_sine(square);
    let (large, small) = both_halves(size);
    let far = large.0 - (small.0 - (large.1 - small.1));
    R::select(size.lt(lit!(1.0)), near, far).copy_sign(x)
}

/// Hyperbolic cosine.
#[inline(always)]
#[must_use]
pub fn cosh<R: Elementary>(x: R) -> R {
    let (large, small) = both_halves(x.abs());
    large.0 + (small.0 + (large.1 + small.1))
}

/// Hyperbolic tangent.
#[inline(always)]
#[must_use]
pub fn tanh<R: Elementary>(x: R) -> R {
    let size = x.abs();
    let square = size * size;
    let near = size + size * square * hyperbolic_tangent(square);
    // 1 - 2 / (e^2x + 1)
    let end: R = if R::IS_WIDE { lit!(20.0) } else { lit!(10.0) };
    let (n, high, low) = parts(bounded(size, lit!(0.5), end) * lit!(2.0));
    let power = n.power_of_two();
    let (under, rest) = (high * power).two_sum(lit!(1.0));
    let rest = rest + low * power;
    let inverse = reciprocal(under);
    let first = inverse + inverse;
    let (product, error) = first.two_product(under);
    let second = (((R::literal::<{ super::TWO }>() - product) - error) - first * rest) * inverse;
    let (sum, error) = ordered_sum(lit!(1.0), -first);
    let far = sum + (error - second);
    let far = R::select(size.ge(end), lit!(1.0), far);
    R::select(size.gt(lit!(0.55)), far, near).copy_sign(x)
}
