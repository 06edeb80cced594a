//! Whether a row's moments are those of a distribution that is not degenerate.

use hankel_dsl::Real;
use hankel_moments::{MAX, MAX_MOMENTS};

use super::Row;
use crate::numbers::{DoubleDouble, Wide};

/// What is known of a row's Hankel matrix, with the row's numbers taken as they are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Validity {
    /// Positive definite. The product of the pivots, each over its diagonal element: the share of
    /// the digits that elimination leaves.
    Definite(f64),
    /// Not positive definite, or no number.
    Not,
    /// Too close to call with 300 bits.
    Undecided,
}

impl Validity {
    /// Whether the matrix is positive definite.
    #[must_use]
    pub const fn is_definite(self) -> bool {
        matches!(self, Self::Definite(_))
    }
}

/// Pivots of the Hankel matrix without exchange of rows (m_0 first), and its diagonal. From the
/// first pivot on that is not positive, pivots mean nothing.
#[must_use]
pub fn pivots<R: Real>(n: usize, m: &[R; MAX_MOMENTS]) -> ([R; MAX + 1], [R; MAX + 1]) {
    let zero: R = hankel_dsl::lit!(0.0);
    let size = n + 1;
    let mut a = [[zero; MAX + 1]; MAX + 1];
    for (i, row) in a.iter_mut().enumerate().take(size) {
        for (j, cell) in row.iter_mut().enumerate().take(size) {
            *cell = m[i + j];
        }
    }
    let mut diagonal = [zero; MAX + 1];
    let mut pivots = [zero; MAX + 1];
    for k in 0..size {
        diagonal[k] = m[2 * k];
    }
    for k in 0..size {
        pivots[k] = a[k][k];
        for i in k + 1..size {
            let factor = a[i][k] / a[k][k];
            let pivot_row = a[k];
            for (x, pivot) in a[i].iter_mut().zip(pivot_row).take(size).skip(i) {
                *x -= factor * pivot;
            }
            // The lower triangle is not kept up.
            let row = a[i];
            for (below, x) in a.iter_mut().zip(row).take(size).skip(i) {
                below[i] = x;
            }
        }
    }
    (pivots, diagonal)
}

/// A row with the moments multiplied by a power of two that takes m_0 to [1, 2), and that power's
/// exponent; `None` unless all is finite and m_0 is positive. Bounds scale with the moments.
#[must_use]
pub fn scaled(row: &Row<f64>) -> Option<(Row<f64>, i32)> {
    let finite = row.m.iter().all(|m| m.is_finite()) && row.eta.is_finite();
    if !finite || row.m[0] <= 0.0 {
        return None;
    }
    // Twice, since neither 2^1074 nor 2^-1074 is a normal number.
    let exponent = row.m[0].log2().floor() as i32;
    let times = |x: f64, e: i32| x * 2.0_f64.powi(e / 2) * 2.0_f64.powi(e - e / 2);
    let m = row.m.map(|m| times(m, -exponent));
    m.iter()
        .all(|m| m.is_finite())
        .then_some((Row { m, eta: row.eta }, exponent))
}

/// A sign that is sure if the pivot's share of its diagonal element, times what earlier pivots
/// left, is well above rounding errors.
fn decide(n: usize, shares: [f64; MAX + 1], epsilon: f64) -> Validity {
    let mut left = 1.0;
    for share in shares.into_iter().take(n + 1) {
        let sure = 64.0 * epsilon / left;
        if share.is_nan() || share.abs() <= sure {
            return Validity::Undecided;
        }
        if share < 0.0 {
            return Validity::Not;
        }
        left *= share;
    }
    Validity::Definite(left)
}

/// Whether the Hankel matrix of m_0 to m_2n is positive definite: in double-double, and with 300
/// bits where that does not tell. `row` must be [`scaled`].
#[must_use]
pub fn validity(n: usize, row: &Row<f64>) -> Validity {
    if (0..=n).any(|k| row.m[2 * k] <= 0.0) {
        return Validity::Not;
    }
    let (pivots_dd, diagonal) = pivots(n, &row.m.map(DoubleDouble::from));
    let mut shares = [0.0; MAX + 1];
    for k in 0..=n {
        shares[k] = f64::from(pivots_dd[k]) / f64::from(diagonal[k]);
    }
    match decide(n, shares, 2.0_f64.powi(-102)) {
        Validity::Undecided => {}
        known => return known,
    }
    let (pivots_wide, diagonal) = pivots(n, &row.m.map(Wide::from));
    for k in 0..=n {
        shares[k] = f64::from(pivots_wide[k]) / f64::from(diagonal[k]);
    }
    // An exact zero on the way makes all that follows undefined: singular, so not definite.
    if shares[..=n].contains(&0.0) || is_singular(n, row, &pivots_wide) {
        return Validity::Not;
    }
    decide(n, shares, 2.0_f64.powi(-300))
}

/// Whether a leading minor is so small that it must be 0: all moments are whole multiples of one
/// power of two, so that a minor is one of that power's.
fn is_singular(n: usize, row: &Row<f64>, pivots: &[Wide; MAX + 1]) -> bool {
    let nonzero = row.m[..=2 * n].iter().filter(|m| **m != 0.0);
    let Some(unit) = nonzero.map(|m| last_place(*m)).reduce(f64::min) else {
        return true;
    };
    let (unit, half) = (Wide::from(unit), Wide::from(0.5));
    let mut minor = Wide::from(1.0);
    let mut least = Wide::from(1.0);
    pivots[..=n].iter().any(|pivot| {
        minor *= *pivot;
        least *= unit;
        minor.abs().lt(least * half)
    })
}

/// The power of two that the last set bit of a number stands for.
#[must_use]
pub fn last_place(x: f64) -> f64 {
    let (bits, exponent) = (x.to_bits(), (x.to_bits() >> 52) & 0x7ff);
    let fraction = bits & ((1 << 52) - 1);
    let whole = if exponent == 0 {
        fraction
    } else {
        fraction | 1 << 52
    };
    let place = exponent.max(1) as i32 - 1075 + whole.trailing_zeros() as i32;
    2.0_f64.powi(place / 2) * 2.0_f64.powi(place - place / 2)
}
