//! Two moments: variance shadow mapping.

use hankel_dsl::{Real, lit};

/// The least share of a distribution with mean `b1` and mean square `b2` that lies below `z`, by
/// Chebyshev's inequality (\[VSM\], Equation 5); in [0, 1]. `least_variance` > 0 keeps a single
/// surface from shadowing itself.
#[inline(always)]
pub fn variance_2<R: Real>(b1: R, b2: R, z: R, least_variance: R) -> R {
    let (b1, b2) = (
        b1.clamp(lit!(-1.0), lit!(1.0)),
        b2.clamp(lit!(-1.0), lit!(1.0)),
    );
    let z = z.clamp(lit!(-2.0), lit!(2.0));
    let variance = (b2 - b1 * b1).max(least_variance.max(R::epsilon() * R::epsilon()));
    let d = z - b1;
    let d2 = d * d;
    R::select(d.gt(lit!(0.0)), d2 / (d2 + variance), lit!(0.0))
}
