//! Two moments: variance shadow mapping.

use hankel_dsl::{Real, lit};

use crate::Blockers;

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

/// What blocks the light from `z`, if the share that [`variance_2`] gives is nearer and all others are as
/// far as the receiver (\[VSSM\], Equation 5). Arguments as there.
#[inline(always)]
pub fn blockers_2<R: Real>(b1: R, b2: R, z: R, least_variance: R) -> Blockers<R> {
    let zero: R = lit!(0.0);
    let share = variance_2(b1, b2, z, least_variance);
    let z = z.clamp(lit!(-2.0), lit!(2.0));
    let mean = b1.clamp(lit!(-1.0), lit!(1.0));
    // No depth is nearer than -1.
    let most = share * (z + lit!(1.0)).max(zero);
    Blockers {
        share,
        moment: (z - mean).clamp(zero, most),
    }
}
