//! The Hamburger problem with six moments, by a cubic.

use hankel_dsl::{Real, lit};

use crate::bound::{Bounds, MAX_MOMENTS, bound_compensated};
use crate::moments::within;
use crate::orthogonal::{Recurrence, positive_root};
use crate::{Blockers, Moments6};

/// The least and the greatest share below `z`, over all distributions of depths with moments `m`
/// (\[BHS\], section 3 of the supplement; \[MSM\], Algorithm 2); both in [0, 1].
///
/// Moments are clamped to [-1, 1] and `z` to [-2, 2], which costs nothing for depths in [0, 1] or
/// [-1, 1]. Moments that no distribution on [-1, 1] has give the bound of a nearby vector.
///
/// The steps are the published ones: Cholesky factors of the 4x4 Hankel matrix, the cubic whose
/// roots are the other three points, the share from an interpolation polynomial. What is different:
///
/// - The cubic is solved for reciprocals of distances from `z`. Its leading coefficient is the
///   point's own weight turned over, a sum of squares, and a root at infinity is a 0.
/// - The roots' signs follow from the coefficients' (all roots are real), so only the root that is
///   alone on its side of `z` is needed, by a few steps of Laguerre's method instead of a cosine.
/// - The interpolation polynomial, 1 at that root and 0 at the other three points, is written in
///   the reciprocals, too. Its denominator is a sum of positive terms, as the root is alone.
#[inline(always)]
pub fn hamburger_6<R: Real>(m: Moments6<R>, z: R) -> Bounds<R> {
    let found = query(m, z);
    Bounds {
        lower: found.blockers.share,
        upper: (found.blockers.share + found.own).min(lit!(1.0)),
    }
}

/// [`hamburger_6`] in about twice the digits wherever digits are lost: what
/// [`bound_compensated`](crate::bound_compensated) says of its errors holds here, too.
///
/// Moments and `z` are clamped as there.
#[inline(always)]
pub fn hamburger_6_compensated<R: Real>(m: Moments6<R>, z: R) -> Bounds<R> {
    let two: R = lit!(2.0);
    let Moments6 {
        b1,
        b2,
        b3,
        b4,
        b5,
        b6,
    } = m.clamped();
    let mut all = [lit!(0.0); MAX_MOMENTS];
    all[0] = lit!(1.0);
    all[1] = b1;
    all[2] = b2;
    all[3] = b3;
    all[4] = b4;
    all[5] = b5;
    all[6] = b6;
    bound_compensated::<R, 3>(all, within(z, -two, two))
}

/// As [`blockers_4`](crate::blockers_4), by six moments: of the three points beside the query point, the one
/// that is alone on its side has a distance that is known, and the mean of all is known.
#[inline(always)]
pub fn blockers_6<R: Real>(m: Moments6<R>, z: R) -> Blockers<R> {
    query(m, z).blockers
}

/// The distribution that attains the bounds.
struct Query<R> {
    blockers: Blockers<R>,
    /// The query point's weight.
    own: R,
}

#[inline(always)]
fn query<R: Real>(m: Moments6<R>, z: R) -> Query<R> {
    let zero: R = lit!(0.0);
    let one: R = lit!(1.0);
    let two: R = lit!(2.0);
    let epsilon = R::epsilon();
    let Recurrence {
        a0,
        a1,
        a2,
        c1,
        c2,
        c3,
    } = Recurrence::new(m);
    let z = within(z, -two, two);

    // The orthogonal polynomials at z, their slopes and half the cubic one's second derivative.
    let p1 = z - a0;
    let from1 = z - a1;
    let from2 = z - a2;
    let p2 = from1 * p1 - c1;
    let p3 = from2 * p2 - c2 * p1;
    let slope2 = from1 + p1;
    let slope3 = from2 * slope2 + p2 - c2;
    let bend3 = from2 + slope2;

    // The cubic about z whose roots are the other points, times the determinant's last pivot:
    // k3 u³ + k2 u² + k1 u + k0.
    let k0 = ((p1 * p1 + c1) * c2 + p2 * p2) * c3 + p3 * p3;
    let own = c1 * c2 * c3 / k0;
    let k1 = (p1 * c2 + p2 * slope2) * c3 + p3 * slope3;
    let k2 = p2 * c3 + p3 * bend3;
    let k3 = p3;
    // No root is nearer than epsilon.
    let k0 = k0.max((k1.abs() + (k2.abs() + k3.abs() * epsilon) * epsilon) * epsilon);

    // For reciprocals r, with the sides of z exchanged if k3 < 0: r³ - a r² + b r + c, c >= 0. So
    // one root is negative and two are not, or all three are negative.
    let is_turned = k3.lt(zero);
    let toward = |x: R| R::select(is_turned, -x, x);
    let a = -toward(k1) / k0;
    let b = k2 / k0;
    let c = k3.abs() / k0;
    let are_all_below = a.lt(zero) & b.gt(zero);
    let s = positive_root(a, b, c);

    // Moments about z, from the recurrence, and the weight of the root at -s.
    let u1 = toward(-p1);
    let u2 = p1 * p1 + c1;
    let u3 = toward((a1 - a0 - p1 * lit!(3.0)) * c1 - p1 * p1 * p1);
    let others = (s + a).max(zero);
    let square = s * s;
    let scale = (square * (others + s) + c).max(epsilon * epsilon * epsilon);
    let factor = s * (others * u2 - u1) - c * u3;
    let alone = square * s / scale * factor;
    let rest = one - own;
    let below = R::select(are_all_below, rest, alone.clamp(zero, rest));
    let share = R::select(is_turned, rest - below, below);

    // What mean and variance alone give (Cantelli). More moments never leave that, rounding does.
    let near = c1 / u2;
    let is_above = p1.gt(zero);
    let least = R::select(is_above, one - near, zero);
    let most = R::select(is_above, one, near);
    let share = share.clamp(least, most);
    // The lone root's weight times its distance, which is 1 / s.
    let lever = square / scale * factor;
    let one_sided = R::select(is_turned, zero, p1);
    let two_sided = R::select(is_turned, lever + p1, lever);
    let moment = R::select(are_all_below, one_sided, two_sided);
    Query {
        blockers: Blockers {
            share,
            // No depth is nearer than -1.
            moment: moment.clamp(zero, share * (z + one).max(zero)),
        },
        own,
    }
}
