//! Three moments as two depths.

use super::{Float, root};

/// Two depths and their weights, as Theorem 1 names them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sparse<T> {
    /// Depths.
    pub z: [T; 2],
    /// Weights.
    pub w: [T; 2],
}

/// Theorem 1, with the constant coefficient from the other two, as its last note has it.
#[must_use]
pub fn two_points<T: Float>(b1: T, b2: T, b3: T) -> Sparse<T> {
    let one = T::round(1.0);
    let c2 = b2 - b1 * b1;
    let c1 = b1 * b2 - b3;
    // Cholesky's factors: c is orthogonal to (1, b1, b2).
    let c0 = -(c1 * b1 + c2 * b2);
    let (p, q) = (c1 / c2, c0 / c2);
    let half = p * T::round(-0.5);
    let r = root(half * half - q);
    let z = [half - r, half + r];
    let w = (b1 - z[0]) / (z[1] - z[0]);
    Sparse { z, w: [one - w, w] }
}
