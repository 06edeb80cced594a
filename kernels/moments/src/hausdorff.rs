//! The Hausdorff problem with four moments: depths known to be in [0, 1].

use hankel_dsl::{Real, lit};

use crate::Moments4;
use crate::hamburger::Query;

/// The greatest lower bound, over all distributions on [0, 1] with moments `m`, of the share that
/// lies below `z` (\[MSM\], Algorithm 4); in [0, 1], and never less than
/// [`hamburger_4`](crate::hamburger_4).
///
/// If the Hamburger problem's solution leaves [0, 1], the bound is attained by points at 0, 1, `z`
/// and one more (Proposition 11). Multiplied by x (1 - x) that distribution has two points, and its
/// moments are differences of the given ones: a two-moment problem, whose weights are quotients of
/// sums of squares.
///
/// `z` is clamped into [0, 1], the moments to [0, 1]; moments that no distribution on [0, 1] has
/// give the bound of a nearby vector.
#[inline(always)]
pub fn hausdorff_4<R: Real>(m: Moments4<R>, z: R) -> R {
    let zero: R = lit!(0.0);
    let one: R = lit!(1.0);
    let unit = |b: R| b.clamp(zero, one);
    let m = Moments4 {
        b1: unit(m.b1),
        b2: unit(m.b2),
        b3: unit(m.b3),
        b4: unit(m.b4),
    };
    let z = z.clamp(R::epsilon(), one - R::epsilon());
    let query = Query::new(m, z);
    let Query {
        own, k0, k1, k2, ..
    } = query;

    // The roots lie in [0, 1] if the polynomial has the right signs and slopes at its ends.
    let at_zero = k0 - z * (k1 - z * k2);
    let rest = one - z;
    let at_one = k0 + rest * (k1 + rest * k2);
    let slope_at_zero = k1 - z * k2 * lit!(2.0);
    let slope_at_one = k1 + rest * k2 * lit!(2.0);
    let straddles = k2.lt(zero);
    let above = k1.gt(zero);
    let inside_between = at_zero.le(zero) & at_one.le(zero);
    let inside_below = at_zero.ge(zero) & slope_at_zero.le(zero);
    let inside_above = at_one.ge(zero) & slope_at_one.ge(zero);
    let inside = (straddles & inside_between)
        | (!straddles & ((above & inside_below) | (!above & inside_above)));

    let outside = R::select(above, one - own, zero);
    let three = R::select(straddles, query.between(), outside);
    query.within_two_moments(R::select(inside, three, four_points(m, z)))
}

/// The bound when 0 and 1 carry weight.
#[inline(always)]
fn four_points<R: Real>(m: Moments4<R>, z: R) -> R {
    let zero: R = lit!(0.0);
    let one: R = lit!(1.0);
    let floor = R::epsilon() * R::epsilon();
    // Moments of x (1 - x) times the distribution.
    let n0 = (m.b1 - m.b2).max(floor);
    let n1 = m.b2 - m.b3;
    let n2 = m.b3 - m.b4;
    let spread = (n0 * n2 - n1 * n1).max(zero);
    let offset = n0 * z - n1;
    // Its weight at z, n0 / (1 + …²); the rest is at the free point n1/n0 - spread/(n0 offset).
    let own = n0 * spread / (spread + offset * offset).max(floor * floor);
    let other = n0 - own;
    let is_positive = offset.gt(zero);
    let safe = R::select(is_positive, offset.max(floor), offset.min(-floor));
    let free = (n1 - spread / safe) / n0;
    let least = R::epsilon();
    let below = other / (one - free).max(least);
    let above = other / free.max(least);
    one - m.b1 - own / z + R::select(is_positive, below, -above)
}
