//! Angles of given sines, cosines and tangents.

use super::polynomials::{arc_sine, arc_tangent};
use super::{Elementary, bounded, ordered_sum, quotient};
use crate::{Real, lit};

/// pi/4 in two parts, of which a few times the first is exact.
#[inline(always)]
fn eighth<R: Real>() -> (R, R) {
    if R::IS_WIDE {
        (
            lit!(0.785_398_163_367_062_8),
            lit!(3.038_550_253_253_096e-11),
        )
    } else {
        (
            lit!(0.785_278_320_312_5),
            lit!(0.000_119_843_084_948_309_61),
        )
    }
}

/// `count` times pi/4, plus `first` and `second`, which are two parts of at most pi/4 or, for a
/// count of 2, pi/2.
#[inline(always)]
fn eighths<R: Elementary>(count: R, first: R, second: R) -> R {
    let (high, low): (R, R) = eighth();
    let none = count.eq(lit!(0.0));
    let (sum, error) = ordered_sum(count * high, first);
    let sum = R::select(none, first, sum);
    let error = R::select(none, lit!(0.0), error);
    sum + (error + (count * low + second))
}

/// For `x` from 1/2 to 1: two parts of `2 asin(sqrt((1 - x) / 2))`, which is `acos(x)`.
#[inline(always)]
fn by_root<R: Elementary>(x: R) -> (R, R) {
    // Exact.
    let z = (R::literal::<{ super::ONE }>() - x) * lit!(0.5);
    let mut inverse = z.inverse_root_seed();
    let half = z * lit!(0.5);
    let mut newton = || inverse = inverse * (R::literal::<HALVES>() - half * inverse * inverse);
    newton();
    newton();
    newton();
    if R::IS_WIDE {
        newton();
    }
    let root = z * inverse;
    let (square, error) = root.two_product(root);
    let missing = ((z - square) - error) * inverse * lit!(0.5);
    let (first, second) = ordered_sum(root, missing + root * (z * arc_sine(z)));
    (first + first, second + second)
}

const HALVES: u64 = 1.5_f64.to_bits();

/// The result where there is an angle, else NaN.
#[inline(always)]
fn in_domain<R: Elementary>(x: R, result: R) -> R {
    R::select(x.abs().le(lit!(1.0)), result, x.not_a_number())
}

/// The angle from -pi/2 to pi/2 whose sine is `x`.
#[inline(always)]
#[must_use]
pub fn asin<R: Elementary>(x: R) -> R {
    let size = x.abs();
    let square = size * size;
    let near = size + size * square * arc_sine(square);
    let (first, second) = by_root(bounded(size, lit!(0.5), lit!(1.0)));
    let far = eighths(lit!(2.0), -first, -second);
    let result = R::select(size.lt(lit!(0.5)), near, far);
    in_domain(x, result.copy_sign(x))
}

/// The angle from 0 to pi whose cosine is `x`.
#[inline(always)]
#[must_use]
pub fn acos<R: Elementary>(x: R) -> R {
    let size = x.abs();
    let square = x * x;
    let (first, second) = by_root(bounded(size, lit!(0.5), lit!(1.0)));
    let near = size.lt(lit!(0.5));
    let negative = x.lt(lit!(0.0));
    // pi/2 - asin(x), 2 asin(...), or pi - 2 asin(...).
    let count = R::select(near, lit!(2.0), R::select(negative, lit!(4.0), lit!(0.0)));
    let first = R::select(near, -x, R::select(negative, -first, first));
    let inner = -(x * square * arc_sine(square));
    let second = R::select(near, inner, R::select(negative, -second, second));
    in_domain(x, eighths(count, first, second))
}

/// The angle from 0 to pi/2 (from pi/2 to pi where `left`) of a point whose coordinates have these
/// magnitudes.
#[inline(always)]
fn angle<R: Elementary>(y: R, x: R, left: R::Mask) -> R {
    let steep = y.gt(x);
    let (small, large) = (R::select(steep, x, y), R::select(steep, y, x));
    let (small, large) = if R::IS_WIDE {
        // To a size that has a first guess of its reciprocal.
        let faint = large.lt(lit!(1.0e-270));
        let up = R::select(faint, lit!(1.340_780_792_994_259_7e154), lit!(1.0));
        let (e, _) = (large * up).decompose();
        let power = (-bounded(e, lit!(-1000.0), lit!(1000.0))).power_of_two();
        (small * up * power, large * up * power)
    } else {
        (small, large)
    };
    let diagonal = small.gt(large * lit!(0.414_213_562_373_095_1));
    // Away from what has no exponent: both, or one of them and then the quotient.
    let (below, above, up, down): (R, R, R, R) = if R::IS_WIDE {
        (
            lit!(1.0e-20),
            lit!(1.0e20),
            lit!(1.340_780_792_994_259_7e154),
            lit!(7.458_340_731_200_207e-155),
        )
    } else {
        (
            lit!(1.0e-12),
            lit!(1.0e12),
            lit!(18_446_744_073_709_551_616.0),
            lit!(5.421_010_862_427_522e-20),
        )
    };
    let huge = large.gt(above);
    let faint = large.lt(below);
    let scale = R::select(huge, down, R::select(faint, up, lit!(1.0)));
    let (a, b) = (small * scale, large * scale);
    let late_up = small.lt(below) & !faint & !huge;
    let late = (huge | late_up) & !diagonal;
    let early = R::select(late_up, small * up, R::select(late, small, a));
    let difference = a.two_sum(-b);
    let sum = b.two_sum(a);
    let over = (
        R::select(diagonal, difference.0, early),
        R::select(diagonal, difference.1, lit!(0.0)),
    );
    let nothing = b.eq(lit!(0.0));
    let under = (
        R::select(diagonal, sum.0, R::select(nothing, lit!(1.0), b)),
        R::select(diagonal, sum.1, lit!(0.0)),
    );
    let (t, t_low) = quotient(over, under);
    let after = R::select(late, down, lit!(1.0));
    let (t, t_low) = (t * after, t_low * after);
    let square = t * t;
    let t_low = t_low + t * square * arc_tangent(square);
    // pi/4 + atan(t) between the diagonals, from the other axis where it is steep, from the other
    // side on the left.
    let one: R = lit!(1.0);
    let two: R = lit!(2.0);
    let four: R = lit!(4.0);
    let count = R::select(diagonal, one, lit!(0.0));
    let count = R::select(steep, two - count, count);
    let count = R::select(left, four - count, count);
    let backwards = (steep & !left) | (left & !steep);
    let (t, t_low) = (
        R::select(backwards, -t, t),
        R::select(backwards, -t_low, t_low),
    );
    eighths(count, t, t_low)
}

/// The angle from -pi/2 to pi/2 whose tangent is `x`.
#[inline(always)]
#[must_use]
pub fn atan<R: Elementary>(x: R) -> R {
    let size = x.abs();
    let limit: R = if R::IS_WIDE {
        lit!(1.0e60)
    } else {
        lit!(1.0e30)
    };
    let one: R = lit!(1.0);
    let never = one.lt(lit!(0.0));
    let result = angle(bounded(size, lit!(0.0), limit), one, never);
    let tiny: R = if R::IS_WIDE {
        lit!(1.0e-8)
    } else {
        lit!(0.000_2)
    };
    let near = size - size * size * size * lit!(1.0 / 3.0);
    R::select(size.lt(tiny), near, result).flip_sign(x)
}

/// The angle from -pi to pi of the point whose ordinate is `y` and whose abscissa is `x`, with
/// IEEE 754's answers for zeros (of which signs count) and infinities.
#[inline(always)]
#[must_use]
pub fn atan2<R: Elementary>(y: R, x: R) -> R {
    let (zero, one): (R, R) = (lit!(0.0), lit!(1.0));
    let (height, width) = (y.abs(), x.abs());
    let far = height.gt(R::largest()) | width.gt(R::largest());
    let at_most_one = |x: R| R::select(x.gt(R::largest()), one, zero);
    let result = angle(
        R::select(far, at_most_one(height), height),
        R::select(far, at_most_one(width), width),
        one.flip_sign(x).lt(zero),
    );
    let number = height.ge(zero) & width.ge(zero);
    R::select(number, result.flip_sign(y), (x + y).not_a_number())
}
