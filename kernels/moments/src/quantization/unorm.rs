//! Normalised integers: numbers in [0, 1] in a few bits.

use hankel_dsl::{Real, lit, unroll};

/// The whole number nearest to `x` >= 0; of two, the larger.
///
/// The usual floor(x + 1/2) rounds the sum first: wrong just below a half, and from 2^23 on.
#[inline(always)]
pub(super) fn nearest<R: Real>(x: R) -> R {
    let below = x.floor();
    R::select((x - below).ge(lit!(0.5)), below + lit!(1.0), below)
}

/// The largest integer of `BITS` bits.
#[inline(always)]
fn largest<R: Real, const BITS: usize>() -> R {
    let one: R = lit!(1.0);
    let mut power = one;
    unroll!(_i in 0..BITS, {
        power += power;
    });
    power - one
}

/// The integer, as a `Real`, that a normalised format of `BITS` bits (1 to 16) stores for `x`: the
/// one nearest to x (2^BITS - 1), halves upwards. Below 0 and NaN are stored as 0, above 1 as 1.
#[inline(always)]
pub fn to_unorm<R: Real, const BITS: usize>(x: R) -> R {
    nearest(crate::moments::within(x, lit!(0.0), lit!(1.0)) * largest::<R, BITS>())
}

/// The number in [0, 1] that the integer `n` of [`to_unorm`] stands for, n / (2^BITS - 1): exact at
/// the ends, within two roundings between.
#[inline(always)]
pub fn from_unorm<R: Real, const BITS: usize>(n: R) -> R {
    let one: R = lit!(1.0);
    let most = largest::<R, BITS>();
    // A shader's optimiser takes a quotient by a constant for this product.
    R::select(n.lt(most), n * (one / most), one)
}
