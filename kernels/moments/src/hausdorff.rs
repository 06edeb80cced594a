//! The Hausdorff problem with four moments: depths known to be in [0, 1], or in [-1, 1].

use hankel_dsl::{Real, lit};

use crate::Moments4;
use crate::bound::{Arithmetic, MAX_MOMENTS, Twofold, bound_compensated};
use crate::hamburger::Query;
use crate::moments::within;

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
/// give a number in [0, 1].
#[inline(always)]
pub fn hausdorff_4<R: Real>(m: Moments4<R>, z: R) -> R {
    bound::<R, false>(m, z)
}

/// [`hausdorff_4`] for depths in [-1, 1]; `z` and the moments are clamped there.
///
/// It computes in [-1, 1]. Moments that are moved to [0, 1] first
/// ([`Moments4::symmetric_to_unit`]) lose in `f32` what a small bias protects.
#[inline(always)]
pub fn hausdorff_4_symmetric<R: Real>(m: Moments4<R>, z: R) -> R {
    bound::<R, true>(m, z)
}

/// [`hausdorff_4`] in about twice the digits wherever digits are lost: what
/// [`bound_compensated`](crate::bound_compensated) says of its errors holds here, too.
#[inline(always)]
pub fn hausdorff_4_compensated<R: Real>(m: Moments4<R>, z: R) -> R {
    compensated::<R, false>(m, z)
}

/// [`hausdorff_4_symmetric`] as [`hausdorff_4_compensated`] has it.
#[inline(always)]
pub fn hausdorff_4_symmetric_compensated<R: Real>(m: Moments4<R>, z: R) -> R {
    compensated::<R, true>(m, z)
}

/// The bound on [0, 1], or on [-1, 1] if it is symmetric.
#[inline(always)]
fn bound<R: Real, const SYMMETRIC: bool>(m: Moments4<R>, z: R) -> R {
    let zero: R = lit!(0.0);
    let one: R = lit!(1.0);
    let (m, z) = clamped::<R, SYMMETRIC>(m, z);
    let query = Query::new(m, z);
    let outside = R::select(query.k1.gt(zero), one - query.own, zero);
    let three = R::select(query.k2.lt(zero), query.between().lower, outside);
    let four = FourPoints::new::<SYMMETRIC>(m, z);
    query.within_two_moments(R::select(four.is_possible, four.bound, three))
}

#[inline(always)]
fn clamped<R: Real, const SYMMETRIC: bool>(m: Moments4<R>, z: R) -> (Moments4<R>, R) {
    let zero: R = lit!(0.0);
    let one: R = lit!(1.0);
    let low = if SYMMETRIC { -one } else { zero };
    let m = Moments4 {
        b1: m.b1.clamp(low, one),
        b2: m.b2.clamp(zero, one),
        b3: m.b3.clamp(low, one),
        b4: m.b4.clamp(zero, one),
    };
    (m, z.clamp(low + R::epsilon(), one - R::epsilon()))
}

/// Both ends of the interval, `z` and one more point with the given moments.
struct FourPoints<R: Real> {
    /// Their share below `z`.
    bound: R,
    /// Whether no weight is negative: either these four points are all in the interval, with weights
    /// that are not negative, or the three of the Hamburger problem are. Where the weight of an end is
    /// 0 both distributions are the same, so that what rounding does to a weight's sign changes the
    /// bound by no more than that weight.
    is_possible: R::Mask,
}

impl<R: Real> FourPoints<R> {
    #[inline(always)]
    fn new<const SYMMETRIC: bool>(m: Moments4<R>, z: R) -> Self {
        let zero: R = lit!(0.0);
        let one: R = lit!(1.0);
        let half: R = lit!(0.5);
        let least = R::epsilon();
        let floor = least * least;
        // Moments of x (1 - x) times the distribution; on [-1, 1] of (1 + x) (1 - x).
        let (n0, n1, n2) = if SYMMETRIC {
            (one - m.b2, m.b1 - m.b3, m.b2 - m.b4)
        } else {
            (m.b1 - m.b2, m.b2 - m.b3, m.b3 - m.b4)
        };
        let total = n0.max(floor);
        let spread = (total * n2 - n1 * n1).max(zero);
        let offset = total * z - n1;
        let shift = n1 * z - n2;
        // Its weights, at z and at the free point.
        let squares = (offset * offset + spread).max(floor * floor);
        let own = total * (spread / squares);
        let other = total * (offset * offset / squares);
        // The free point is at shift / offset. Its weight over the distances to both ends.
        let is_below = offset.gt(zero);
        let length = offset.abs().max(floor);
        let toward = |x: R| R::select(is_below, x, -x) / length;
        let from_start = toward(if SYMMETRIC { shift + offset } else { shift });
        let from_end = toward(offset - shift);
        let by_start = other / from_start.max(least);
        let by_end = other / from_end.max(least);
        let (at_start, at_end) = if SYMMETRIC {
            (one - m.b1 - own / (one + z), one + m.b1 - own / (one - z))
        } else {
            (one - m.b1 - own / z, m.b1 - own / (one - z))
        };
        let is_inside = from_start.ge(-least) & from_end.ge(-least);
        let share = at_start + R::select(is_below, by_end, -by_start);
        Self {
            // On [-1, 1] all of these are twice the weights.
            bound: if SYMMETRIC { half * share } else { share },
            is_possible: is_inside & at_start.ge(by_start) & at_end.ge(by_end),
        }
    }
}

/// [`bound`] in twice the digits: with weights instead of quotients of weights and distances, so that only 0 must not
/// be divided by.
#[inline(always)]
fn compensated<R: Real, const SYMMETRIC: bool>(m: Moments4<R>, z: R) -> R {
    let zero: R = lit!(0.0);
    let one: R = lit!(1.0);
    let low = if SYMMETRIC { -one } else { zero };
    let fine_one = Twofold::of(one);
    let z = within(z, low, one);
    let b1 = within(m.b1, low, one);
    let b2 = within(m.b2, zero, one);
    let b3 = within(m.b3, low, one);
    let b4 = within(m.b4, zero, one);
    let mut all = [zero; MAX_MOMENTS];
    all[0] = one;
    all[1] = b1;
    all[2] = b2;
    all[3] = b3;
    all[4] = b4;
    let three = bound_compensated::<R, 2>(all, z).lower;

    // As `FourPoints` has it. Products of four depths are not lost in this.
    let least: R = if const { R::IS_WIDE } {
        lit!(1e-290)
    } else {
        lit!(1e-37)
    };
    let less = |a: R, b: R| Twofold::of(a).minus(Twofold::of(b));
    let (n0, n1, n2) = if SYMMETRIC {
        (less(one, b2), less(b1, b3), less(b2, b4))
    } else {
        (less(b1, b2), less(b2, b3), less(b3, b4))
    };
    let spread = n0.cross(n2, n1, n1).at_least(zero);
    let offset = n0.times_plain(z).minus(n1);
    let shift = n1.times_plain(z).minus(n2);
    let square = offset.times(offset);
    let squares = square.plus(spread).at_least(least);
    let own = n0.times(spread).over(squares);
    let other = n0.times(square).over(squares);
    let is_below = offset.rounded().gt(zero);
    let side = R::select(is_below, one, -one);
    let length = offset.scaled(side);
    // The free point's distances from both ends, times `length`.
    let shift = shift.scaled(side);
    let from_start = if SYMMETRIC { shift.plus(length) } else { shift };
    let from_end = length.minus(shift);
    let is_inside = from_start.rounded().ge(zero) & from_end.rounded().ge(zero);
    let moment = other.times(length);
    let by_start = moment.over(from_start.at_least(least));
    let by_end = moment.over(from_end.at_least(least));
    let to_start = less(z, low).at_least(least);
    let to_end = less(one, z).at_least(least);
    let own_by_end = own.over(to_end);
    let (at_start, at_end) = if SYMMETRIC {
        (
            less(one, b1).minus(own.over(to_start)),
            fine_one.plus(Twofold::of(b1)).minus(own_by_end),
        )
    } else {
        (
            less(one, b1).minus(own.over(to_start)),
            Twofold::of(b1).minus(own_by_end),
        )
    };
    let is_possible = is_inside
        & at_start.minus(by_start).rounded().ge(zero)
        & at_end.minus(by_end).rounded().ge(zero);
    let below = Twofold::select(is_below, by_end, by_start.scaled(-one));
    let share = at_start.plus(below).rounded();
    // On [-1, 1] all of these are twice the weights.
    let half: R = lit!(0.5);
    let four = if SYMMETRIC { half * share } else { share };
    R::select(is_possible, four.max(three), three).saturate()
}
