//! Sine, cosine and tangent.

use super::polynomials::{cosine, sine};
use super::reduce::quarters;
use super::{Elementary, ordered_sum, quotient};
use crate::lit;

/// Sine and cosine of an angle of at most pi/4 in two parts.
#[inline(always)]
fn near_zero<R: Elementary>(x: R, low: R) -> (R, R) {
    let square = x * x;
    let (c, error) = ordered_sum(lit!(1.0), -(square * lit!(0.5)));
    let s = x + (x * square * sine(square) + low * c);
    (
        s,
        c + (error + (square * square * cosine(square) - x * low)),
    )
}

/// The same, in two parts each, for a quotient.
#[inline(always)]
fn pairs_near_zero<R: Elementary>(x: R, low: R) -> ((R, R), (R, R)) {
    let (square, square_low) = x.two_product(x);
    let (cube, cube_low) = square.two_product(x);
    let cube_low = cube_low + x * square_low;
    let factor: R = sine(square);
    let (c, error) = ordered_sum(lit!(1.0), -(square * lit!(0.5)));
    let s = ordered_sum(x, cube * factor + (cube_low * factor + low * c));
    let rest = square * square * cosine(square) - (x * low + square_low * lit!(0.5));
    (s, ordered_sum(c, error + rest))
}

/// The result for a finite argument, else NaN.
#[inline(always)]
fn in_domain<R: Elementary>(x: R, result: R) -> R {
    R::select(x.abs().le(R::largest()), result, x.not_a_number())
}

/// Sine and cosine of an angle in radians, at the cost of one and a little. Any angle is as exact
/// as a small one.
#[inline(always)]
#[must_use]
pub fn sin_cos<R: Elementary>(x: R) -> (R, R) {
    let (quarter, high, low) = quarters(x.abs());
    let (s, c) = near_zero(high, low);
    let one: R = lit!(1.0);
    let two: R = lit!(2.0);
    let three: R = lit!(3.0);
    let turned = quarter.eq(one) | quarter.eq(three);
    let (first, second) = (R::select(turned, c, s), R::select(turned, s, c));
    let first = R::select(quarter.ge(two), -first, first).flip_sign(x);
    let second = R::select(quarter.eq(one) | quarter.eq(two), -second, second);
    (in_domain(x, first), in_domain(x, second))
}

/// Sine of an angle in radians.
#[inline(always)]
#[must_use]
pub fn sin<R: Elementary>(x: R) -> R {
    sin_cos(x).0
}

/// Cosine of an angle in radians.
#[inline(always)]
#[must_use]
pub fn cos<R: Elementary>(x: R) -> R {
    sin_cos(x).1
}

/// Tangent of an angle in radians.
#[inline(always)]
#[must_use]
pub fn tan<R: Elementary>(x: R) -> R {
    let size = x.abs();
    let (quarter, high, low) = quarters(size);
    let (s, c) = pairs_near_zero(high, low);
    let turned = quarter.eq(lit!(1.0)) | quarter.eq(lit!(3.0));
    let over = (R::select(turned, -c.0, s.0), R::select(turned, -c.1, s.1));
    let under = (R::select(turned, s.0, c.0), R::select(turned, s.1, c.1));
    // The divisor may be negative; its reciprocal is of its magnitude.
    let sign = under.0;
    let under = (under.0.flip_sign(sign), under.1.flip_sign(sign));
    let (first, second) = quotient(over, under);
    let result = (first + second).flip_sign(sign);
    let tiny: R = if R::IS_WIDE {
        lit!(1.0e-8)
    } else {
        lit!(0.000_2)
    };
    let near = size + size * size * size * lit!(1.0 / 3.0);
    let result = R::select(size.lt(tiny), near, result).flip_sign(x);
    in_domain(x, result)
}
