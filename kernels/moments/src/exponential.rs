//! Depths warped by an exponential: exponential (variance) shadow mapping.

use hankel_dsl::{Real, lit};

use crate::moments::within;

/// A warped depth, or a mean of some, is kept from 5e-19 to 2e18, which is `exp(-42)` to `exp(42)`: the
/// squares of all between are normal numbers in `f32`.
#[inline(always)]
fn warped<R: Real>(x: R) -> R {
    within(x, lit!(5e-19), lit!(2e18))
}

/// The least share of a distribution of positive numbers with mean `mean` that lies below `w`, by
/// Markov's inequality; in [0, 1]. With numbers `exp(c z)` for depths z this is exponential shadow
/// mapping (\[ESM\]). `mean` and `w` are in [0, 1e36]; `w` below 1e-30 counts as that.
#[inline(always)]
pub fn markov_1<R: Real>(mean: R, w: R) -> R {
    let (mean, w) = (
        within(mean, lit!(0.0), lit!(1e36)),
        within(w, lit!(1e-30), lit!(1e36)),
    );
    let most = mean / mean.max(w);
    -most + lit!(1.0)
}

/// The least shares below and above `w` of a distribution of positive numbers with mean `mean` and mean
/// square `square`, by Chebyshev's inequality; both in [0, 1], at least one of them 0. With numbers
/// `exp(c z)` for depths z this is exponential variance shadow mapping (\[LVSM\]).
///
/// The variance is taken for `least` w² where it is less: both are relative, as rounding is. `mean` and
/// `w` are clamped to [5e-19, 2e18], so that exponents from -42 to 42 are served.
#[inline(always)]
pub fn warped_2<R: Real>(mean: R, square: R, w: R, least: R) -> (R, R) {
    let zero: R = lit!(0.0);
    let (mean, w) = (warped(mean), warped(w));
    // No number is above 2e18, which bounds the square by the mean.
    let square = within(square, zero, mean * lit!(2e18));
    let least = within(least, R::epsilon() * R::epsilon(), lit!(1.0));
    let scale = mean.max(w);
    let (a, b) = (mean / scale, w / scale);
    let variance = (square / scale / scale - a * a).max(least * b * b);
    let d = b - a;
    let d2 = d * d;
    // Never 0 / 0: one of a and b is 1, so that d or b is at least a half.
    let share = d2 / (d2 + variance);
    (
        R::select(d.gt(zero), share, zero),
        R::select(d.lt(zero), share, zero),
    )
}
