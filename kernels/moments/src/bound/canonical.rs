//! The distribution that attains the bounds, whole.

use hankel_dsl::{Real, lit, unroll};

use super::kernel::{Kernel, small_weight_of};
use super::recurrence::{Recurrence, finite};
use super::roots::all;
use super::twofold::{Arithmetic, Plain, Twofold};
use super::{MAX, MAX_MOMENTS};

/// The canonical representation of moments `m_0` to `m_2N` that contains the query point: N + 1
/// points with the same moments (\[MBD\], Theorem 2).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Canonical<R> {
    /// For each of the N other points the reciprocal of its distance from the query point, in
    /// ascending order; the rest is 0. Point `i` is at `eta + 1 / reciprocals[i]`; a reciprocal of 0
    /// is a point at infinity.
    pub reciprocals: [R; MAX],
    /// Their weights, in the same order; 0 at infinity.
    pub weights: [R; MAX],
    /// The query point's weight.
    pub own: R,
}

impl<R: Real> Canonical<R> {
    /// No points and no weight: all numbers are 0.
    #[inline(always)]
    pub fn none() -> Self {
        Self {
            reciprocals: [lit!(0.0); MAX],
            weights: [lit!(0.0); MAX],
            own: lit!(0.0),
        }
    }
}

/// The canonical representation. Takes anything that [`bound`](super::bound) takes; weights are
/// from 0 to the total.
///
/// All roots are found, while [`bound`](super::bound) needs at most three. Rounding errors of points
/// and weights are then corrected together by what they leave of all moments, so that these are
/// reproduced to a few units in their last place where that is possible.
#[inline(always)]
pub fn canonical<R: Real, const N: usize>(m: [R; MAX_MOMENTS], eta: R) -> Canonical<R> {
    let floor = R::epsilon() * lit!(0.25);
    represent::<R, Plain<R>, N>(m, eta, floor)
}

/// [`canonical`] as [`bound_compensated`](super::bound_compensated) sees it.
#[inline(always)]
pub fn canonical_compensated<R: Real, const N: usize>(m: [R; MAX_MOMENTS], eta: R) -> Canonical<R> {
    let floor = R::epsilon() * R::epsilon();
    represent::<R, Twofold<R>, N>(m, eta, floor)
}

#[inline(always)]
fn represent<R: Real, A: Arithmetic<R>, const N: usize>(
    m: [R; MAX_MOMENTS],
    eta: R,
    floor: R,
) -> Canonical<R> {
    let zero: R = lit!(0.0);
    let recurrence = Recurrence::<R, A>::new::<N>(m, eta, floor);
    let kernel = Kernel::<R, A>::new::<N>(&recurrence);
    let roots = all::<R, N>(&kernel.e);
    let mut found = Canonical {
        reciprocals: [zero; MAX],
        weights: [zero; MAX],
        own: kernel.own * recurrence.total,
    };
    let per_length = kernel.reach * recurrence.per_unit;
    unroll!(i in 0..N, max 7, {
        let weight = small_weight_of::<R, A, N>(&kernel, roots[i]).clamp(zero, kernel.others);
        found.weights[i] = weight * recurrence.total;
        found.reciprocals[i] = roots[i] * per_length;
    });
    // A turned axis turns their order.
    let as_is = found;
    unroll!(i in 0..N, max 7, {
        found.weights[i] = R::select(
            kernel.turned,
            as_is.weights[N - 1 - i],
            as_is.weights[i],
        );
        found.reciprocals[i] = R::select(
            kernel.turned,
            -as_is.reciprocals[N - 1 - i],
            as_is.reciprocals[i],
        );
    });
    let once = corrected::<R, N>(&m, eta, recurrence.total, found);
    if const { N < 6 } {
        once
    } else {
        corrected::<R, N>(&m, eta, recurrence.total, once)
    }
}

/// One step of Newton's method for the 2N + 1 equations that the moments are in terms of weights
/// and points.
///
/// Its matrix is a confluent Vandermonde matrix, and its inverse is made of Hermite's basis
/// polynomials, by which each unknown has a formula of its own. What is left of the moments is as
/// inexact as their last digits, so that one step is enough; roots for twelve moments are so inexact that it
/// takes two. Where a step would go far, moments are degenerate and their digits say nothing: there all stays
/// as it is.
#[inline(always)]
fn corrected<R: Real, const N: usize>(
    m: &[R; MAX_MOMENTS],
    eta: R,
    total: R,
    found: Canonical<R>,
) -> Canonical<R> {
    let zero: R = lit!(0.0);
    let one: R = lit!(1.0);
    let eta = finite(eta, lit!(1e12));
    // The query point is the last.
    let mut u = [zero; MAX + 1];
    let mut weight = [found.own; MAX + 1];
    unroll!(i in 0..N, max 7, {
        let v = found.reciprocals[i];
        u[i] = R::select(v.eq(zero), zero, one / R::select(v.eq(zero), one, v));
        weight[i] = found.weights[i];
    });

    let mut rest = *m;
    rest[0] = total;
    let mut terms = weight;
    unroll!(k in 0..(2 * N + 1), max 13, {
        unroll!(i in 0..(N + 1), max 7, {
            rest[k] -= terms[i];
            terms[i] *= eta + u[if const { i < N } { i } else { MAX }];
        });
    });

    let quarter: R = lit!(0.25);
    let mut next = found;
    let mut is_near = zero.le(found.own);
    unroll!(i in 0..(N + 1), max 7, {
        let at = u[if const { i < N } { i } else { MAX }];
        let x = eta + at;
        let (q, slope) = basis::<R, N, i>(&found, at, x);
        let mut value = zero;
        let mut moved = zero;
        unroll!(k in 0..(2 * N), max 13, {
            value += q[k] * rest[k];
            moved += q[k] * rest[k + 1];
        });
        if const { i == N } {
            next.own = found.own + value + q[2 * N] * rest[2 * N];
            is_near = is_near & zero.le(next.own) & next.own.le(total);
        } else {
            let v = found.reciprocals[i];
            let present = zero.lt(found.weights[i]) & !v.eq(zero);
            let shift = moved - x * value;
            let by = shift / R::select(present, found.weights[i], one);
            // How far it goes in terms of the distance to the query point.
            let part = by * v;
            next.weights[i] = R::select(present, found.weights[i] + (value - slope * shift), zero);
            next.reciprocals[i] = R::select(present, v / (one + part), v);
            let is_small = part.abs().lt(quarter) & zero.le(next.weights[i]) & next.weights[i].le(total);
            is_near = is_near & (is_small | !present);
        }
    });
    unroll!(i in 0..N, max 7, {
        next.weights[i] = R::select(is_near, next.weights[i], found.weights[i]);
        next.reciprocals[i] = R::select(is_near, next.reciprocals[i], found.reciprocals[i]);
    });
    next.own = R::select(is_near, next.own, found.own);
    next
}

/// Hermite's basis polynomial of point I, at `x`, which is `at` from the query point: 1 and stationary there, 0 and
/// stationary at other points, 0 at the query point. The slope that it has there comes beside it, to be taken off.
#[inline(always)]
fn basis<R: Real, const N: usize, const I: usize>(
    found: &Canonical<R>,
    at: R,
    x: R,
) -> ([R; MAX_MOMENTS], R) {
    let zero: R = lit!(0.0);
    let one: R = lit!(1.0);
    let mut q = [zero; MAX_MOMENTS];
    q[0] = one;
    let mut slope = zero;
    unroll!(j in 0..(2 * N), max 13, {
        // Two factors for each other point, one for the query point in this one's place.
        if const { j / 2 != I || j % 2 != 1 } {
            // 1 + s (t - x); at infinity s is 0.
            let v = found.reciprocals[const { j / 2 }];
            let s = if const { j / 2 == I } {
                v
            } else {
                -v / (one - v * at)
            };
            slope += s;
            multiply::<R, j>(&mut q, one - s * x, s);
        }
    });
    (q, slope)
}

/// Multiplies a polynomial of degree DEGREE by `constant + s t`.
#[inline(always)]
fn multiply<R: Real, const DEGREE: usize>(q: &mut [R; MAX_MOMENTS], constant: R, s: R) {
    unroll!(l in 0..(DEGREE + 1), max 13, {
        q[DEGREE + 1 - l] = constant * q[DEGREE + 1 - l] + s * q[DEGREE - l];
    });
    q[0] = constant * q[0];
}
