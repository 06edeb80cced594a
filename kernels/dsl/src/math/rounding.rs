//! Whole numbers, steps and mixtures. All are exact or say how they round.

use super::Elementary;
use crate::{Real, lit};

/// The largest whole number that is not larger than `x`.
#[inline(always)]
#[must_use]
pub fn floor<R: Real>(x: R) -> R {
    x.floor()
}

/// The smallest whole number that is not smaller than `x`.
#[inline(always)]
#[must_use]
pub fn ceil<R: Real>(x: R) -> R {
    -(-x).floor()
}

/// `x` without its fraction.
#[inline(always)]
#[must_use]
pub fn trunc<R: Elementary>(x: R) -> R {
    x.abs().floor().copy_sign(x)
}

/// The nearest whole number; halves go away from zero, as in Rust. (WGSL's `round` goes to the even
/// one, GLSL's wherever the device likes.)
#[inline(always)]
#[must_use]
pub fn round<R: Elementary>(x: R) -> R {
    let size = x.abs();
    let whole = size.floor();
    let up = (size - whole).ge(lit!(0.5));
    R::select(up, whole + lit!(1.0), whole).copy_sign(x)
}

/// `x - floor(x)`, as shading languages have it: not below zero. Rust's own is `x - trunc(x)`. Of a
/// small negative number it is 1.
#[inline(always)]
#[must_use]
pub fn fract<R: Real>(x: R) -> R {
    x - x.floor()
}

/// -1, 0 or 1. Rust's `signum` is never 0.
#[inline(always)]
#[must_use]
pub fn sign<R: Real>(x: R) -> R {
    let positive = R::select(x.gt(lit!(0.0)), lit!(1.0), lit!(0.0));
    R::select(x.lt(lit!(0.0)), lit!(-1.0), positive)
}

/// 0 where `x` is below `edge`, else 1.
#[inline(always)]
#[must_use]
pub fn step<R: Real>(edge: R, x: R) -> R {
    R::select(x.lt(edge), lit!(0.0), lit!(1.0))
}

/// 0 up to `low`, 1 from `high` on, between them `t^2 (3 - 2 t)` with `t = (x - low) / (high - low)`;
/// `low` must be less than `high`.
#[inline(always)]
#[must_use]
pub fn smoothstep<R: Real>(low: R, high: R, x: R) -> R {
    let t = ((x - low) / (high - low)).saturate();
    t * t * (t * lit!(-2.0) + lit!(3.0))
}

/// From `a` at `t` = 0 to `b` at 1: [`Real::lerp`] by the name that shading languages give it.
#[inline(always)]
#[must_use]
pub fn mix<R: Real>(a: R, b: R, t: R) -> R {
    a.lerp(b, t)
}

/// `a * b + c`, rounded once, on every device: Rust's `mul_add` where `a * b` is from 2^-78 to 2^126
/// (`f64`: from 2^-900 to 2^990) or zero and the sum has no denormal.
///
/// It needs no instruction for it, of which languages promise nothing (Boldo, Melquiond, Emulation
/// of FMA and correctly rounded sums, 2008): the error is rounded to odd before it is added. Where
/// one rounding more does no harm, [`Real::mul_add`] costs two operations in place of thirty.
#[inline(always)]
#[must_use]
pub fn fma<R: Elementary>(a: R, b: R, c: R) -> R {
    let (product, low) = a.two_product(b);
    let (sum, sum_low) = c.two_sum(low);
    let (high, middle) = product.two_sum(sum);
    high + middle.odd_sum(sum_low)
}
