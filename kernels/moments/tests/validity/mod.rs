//! Whether numbers are moments of a distribution: the conditions on their Hankel matrices.

/// The pivots of the Cholesky factorisation of the Hankel matrix of m_0, m_1, …; those after one
/// that is not positive mean nothing.
pub fn hankel_pivots(m: &[f64]) -> Vec<f64> {
    let n = m.len().div_ceil(2);
    let mut a: Vec<Vec<f64>> = (0..n).map(|i| m[i..i + n].to_vec()).collect();
    for k in 0..n {
        let (upper, lower) = a.split_at_mut(k + 1);
        let upper = &upper[k];
        for row in lower {
            let factor = row[k] / upper[k];
            for (x, u) in row.iter_mut().zip(upper) {
                *x -= factor * u;
            }
        }
    }
    (0..n).map(|i| a[i][i]).collect()
}

/// Whether the Hankel matrix of m_0, m_1, … is positive definite: some distribution on the real
/// line, of more than a few depths, has these moments.
pub fn is_positive(m: &[f64]) -> bool {
    hankel_pivots(m).into_iter().all(|p| p > 0.0)
}

/// Whether depths in the interior of [low, 1] can have the moments m_1, m_2, … of an even
/// number (m_0 is 1): the Hankel matrices of the distribution and of it times (z - low) (1 - z)
/// are positive definite.
pub fn is_moments(b: &[f64], low: f64) -> bool {
    let m: Vec<f64> = std::iter::once(1.0).chain(b.iter().copied()).collect();
    let within: Vec<f64> = m
        .windows(3)
        .map(|m| (1.0 + low) * m[1] - m[2] - low * m[0])
        .collect();
    is_positive(&m) && is_positive(&within)
}
