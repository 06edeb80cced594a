//! The 2025 solver.

use hankel_moments::{Bounds, MAX_MOMENTS};

use super::roots::real_roots;
use super::{Float, cholesky_solve};

/// Points of a canonical representation at most.
const POINTS: usize = MAX_MOMENTS / 2 + 1;

/// Algorithm 1 for both ends of its overestimation weight, for n from 1 to 6. No bias: see [`mixed`].
#[must_use]
pub fn moment_bound<T: Float>(n: usize, m: [T; MAX_MOMENTS], eta: T) -> Bounds<T> {
    let zero = T::default();
    let mut hankel = [[zero; POINTS]; POINTS];
    let mut powers = [zero; POINTS];
    let mut power = T::round(1.0);
    for (i, row) in hankel.iter_mut().enumerate().take(n + 1) {
        for (j, cell) in row.iter_mut().enumerate().take(n + 1) {
            *cell = m[i + j];
        }
        powers[i] = power;
        power *= eta;
    }
    let kernel = cholesky_solve(n + 1, &hankel, &powers);
    let mut points = real_roots(&kernel[..=n]);
    points.push(eta);
    // Ascending by magnitude, infinity last.
    points.sort_by(|a, b| a.abs().widen().total_cmp(&b.abs().widen()));
    let weights = vandermonde_solve(&points, &m[..=n]);
    let mut lower = zero;
    let mut own = zero;
    for (&point, &weight) in points.iter().zip(&weights) {
        if point == eta {
            own = weight;
        } else if point < eta {
            lower += weight;
        }
    }
    Bounds {
        lower,
        upper: lower + own,
    }
}

/// Algorithm 1's bias: all moments alike, the total too.
#[must_use]
pub fn mixed<T: Float>(
    m: [T; MAX_MOMENTS],
    target: [T; MAX_MOMENTS],
    strength: T,
) -> [T; MAX_MOMENTS] {
    let rest = T::round(1.0) - strength;
    let mut mixed = m;
    for (m, target) in mixed.iter_mut().zip(target) {
        *m = rest * *m + strength * target;
    }
    mixed
}

/// Weights of points with the given moments (Björck and Pereyra, *Solution of Vandermonde systems of
/// equations*, 1970, primal).
#[allow(
    clippy::needless_range_loop,
    reason = "indices are those of the published form"
)]
fn vandermonde_solve<T: Float>(x: &[T], moments: &[T]) -> Vec<T> {
    let n = x.len() - 1;
    let mut b = moments.to_vec();
    for k in 0..n {
        for i in (k + 1..=n).rev() {
            let taken = x[k] * b[i - 1];
            b[i] -= taken;
        }
    }
    for k in (0..n).rev() {
        for i in k + 1..=n {
            b[i] = b[i] / (x[i] - x[i - k - 1]);
        }
        for i in k..n {
            let taken = b[i + 1];
            b[i] -= taken;
        }
    }
    b
}
