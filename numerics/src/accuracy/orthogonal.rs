//! Roots of the orthogonal polynomial P_n: the queries at which the canonical representation loses
//! a point to infinity (\[MBD\], section 4.2).

use hankel_dsl::{Real, lit};
use hankel_moments::{MAX, MAX_MOMENTS};

use crate::numbers::DoubleDouble;

/// Coefficients of the three-term recurrence `p_(k+1) = (x - a_k) p_k - b_k p_(k-1)`.
struct Recurrence {
    a: [DoubleDouble; MAX],
    b: [DoubleDouble; MAX],
}

impl Recurrence {
    /// Of moments with a positive definite Hankel matrix, by elimination; `None` for others.
    fn new(n: usize, m: &[DoubleDouble; MAX_MOMENTS]) -> Option<Self> {
        let zero: DoubleDouble = lit!(0.0);
        let mut h = [[zero; MAX + 1]; MAX + 1];
        for (i, row) in h.iter_mut().enumerate().take(n + 1) {
            for (j, cell) in row.iter_mut().enumerate().take(n + 1) {
                *cell = m[i + j];
            }
        }
        let (mut a, mut b) = ([zero; MAX], [zero; MAX]);
        let mut before = zero;
        let mut pivot_before = zero;
        for k in 0..n {
            let pivot = h[k][k];
            if !pivot.gt(zero) {
                return None;
            }
            let next = h[k + 1][k] / pivot;
            a[k] = next - before;
            if k > 0 {
                b[k] = pivot / pivot_before;
            }
            before = next;
            pivot_before = pivot;
            let pivot_row = h[k];
            for row in h.iter_mut().take(n + 1).skip(k + 1) {
                let factor = row[k] / pivot;
                for (cell, above) in row.iter_mut().zip(pivot_row) {
                    *cell -= factor * above;
                }
            }
        }
        Some(Self { a, b })
    }

    /// P_k and its derivative.
    fn eval<R: Real + From<f64>>(a: &[R; MAX], b: &[R; MAX], k: usize, x: R) -> (R, R) {
        let (zero, one) = (R::from(0.0), R::from(1.0));
        let (mut p, mut before) = (one, zero);
        let (mut d, mut d_before) = (zero, zero);
        for i in 0..k {
            let (next, d_next) = (
                (x - a[i]) * p - b[i] * before,
                (x - a[i]) * d + p - b[i] * d_before,
            );
            (before, p) = (p, next);
            (d_before, d) = (d, d_next);
        }
        (p, d)
    }
}

/// The roots of P_n in ascending order; the rest is 0. `None` unless the Hankel matrix of order
/// n - 1 is positive definite.
#[must_use]
pub fn orthogonal_roots(n: usize, m: &[DoubleDouble; MAX_MOMENTS]) -> Option<[DoubleDouble; MAX]> {
    let Recurrence { a, b } = Recurrence::new(n, m)?;
    let (fa, fb) = (a.map(f64::from), b.map(f64::from));
    // All eigenvalues of the Jacobi matrix (Gershgorin).
    let side = |i: usize| if i < n { fb[i].sqrt() } else { 0.0 };
    let ends = (0..n).fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), i| {
        let radius = side(i) + if i + 1 < n { side(i + 1) } else { 0.0 };
        (low.min(fa[i] - radius), high.max(fa[i] + radius))
    });
    if !(ends.0.is_finite() && ends.1.is_finite()) {
        return None;
    }
    // Roots of P_k lie between those of P_(k-1).
    let mut roots: Vec<f64> = Vec::new();
    for k in 1..=n {
        let mut brackets = vec![ends.0];
        brackets.extend(&roots);
        brackets.push(ends.1);
        roots = brackets
            .windows(2)
            .enumerate()
            .map(|(i, bracket)| {
                let (mut low, mut high) = (bracket[0], bracket[1]);
                // Left of all its roots, P_k has the sign of (-1)^k; it changes at each.
                let below = if (k + i) % 2 == 0 { 1.0 } else { -1.0 };
                for _ in 0..60 {
                    let middle = 0.5 * (low + high);
                    if Recurrence::eval(&fa, &fb, k, middle).0 * below > 0.0 {
                        low = middle;
                    } else {
                        high = middle;
                    }
                }
                0.5 * (low + high)
            })
            .collect();
    }
    let mut precise = [lit!(0.0); MAX];
    for (precise, root) in precise.iter_mut().zip(roots) {
        let mut x = DoubleDouble::from(root);
        for _ in 0..3 {
            let (p, d) = Recurrence::eval(&a, &b, n, x);
            x -= p / d;
        }
        *precise = x;
    }
    Some(precise)
}
