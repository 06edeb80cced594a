//! The distribution that attains the bounds, whole.

use hankel_dsl::{Real, lit, unroll};

use super::kernel::Kernel;
use super::recurrence::Recurrence;
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

/// The canonical representation. Takes anything that [`bound`](super::bound) takes; weights are
/// from 0 to the total.
///
/// All roots are found, while [`bound`](super::bound) needs at most two.
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
    let recurrence = Recurrence::new::<A, N>(m, eta, floor);
    let kernel = Kernel::new::<N>(&recurrence);
    let roots = all::<R, N>(&kernel.e);
    let mut found = Canonical {
        reciprocals: [zero; MAX],
        weights: [zero; MAX],
        own: kernel.own * recurrence.total,
    };
    let per_length = kernel.reach / recurrence.unit;
    unroll!(i in 0..N, max 6, {
        let weight = kernel.weight_of::<N>(roots[i]).clamp(zero, kernel.others);
        found.weights[i] = weight * recurrence.total;
        found.reciprocals[i] = roots[i] * per_length;
    });
    // A turned axis turns their order.
    let as_is = found;
    unroll!(i in 0..N, max 6, {
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
    found
}
