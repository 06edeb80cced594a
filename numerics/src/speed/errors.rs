//! How wrong the bounds are that were timed: a rough look, on a few thousand rows of two families.

use hankel_dsl::native::Mode;
use hankel_moments::MAX_MOMENTS;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::native::Native;
use super::{Solver, SpeedError, rows_of};
use crate::families::{Format, Precision, Row, validity};
use crate::numbers::DoubleDouble;
use crate::peer::{Peer, Quantity};
use crate::stress::bounds_of;

/// Families that errors are taken on: easy and hard rows.
pub const ERROR_FAMILIES: [&str; 2] = ["paper", "silhouettes-biased"];

/// Quantiles of errors.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Quantiles {
    /// Half of the rows are not worse.
    pub median: f64,
    /// Nine of ten.
    pub ninety: f64,
    /// Ninety-nine of a hundred.
    pub ninety_nine: f64,
    /// None is worse.
    pub greatest: f64,
}

impl Quantiles {
    /// Of these errors; of none, zero.
    #[must_use]
    pub fn of(mut errors: Vec<f64>) -> Self {
        errors.sort_by(f64::total_cmp);
        let at = |share: f64| {
            let last = errors.len().saturating_sub(1);
            errors
                .get((share * last as f64).ceil() as usize)
                .copied()
                .unwrap_or(0.0)
        };
        Self {
            median: at(0.5),
            ninety: at(0.9),
            ninety_nine: at(0.99),
            greatest: at(1.0),
        }
    }
}

/// Errors of bounds, as shares of the total m_0.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ErrorOf {
    /// What computed them.
    pub solver: Solver,
    /// Of which order.
    pub n: usize,
    /// In which precision.
    pub precision: Precision,
    /// Of which family.
    pub family: String,
    /// Rows: those whose moments, as rounded, are some distribution's.
    pub rows: usize,
    /// Rows without a finite result. They count as an error of 1, all of the total.
    pub not_finite: usize,
    /// The errors.
    pub quantiles: Quantiles,
}

/// Errors of the bounds of all solvers, against the same source in double-double.
pub(super) fn measure<T: Format>(
    n: usize,
    own: &[(Solver, String)],
    count: usize,
    seed: u64,
    mut peer: Option<&mut Peer>,
) -> Result<Vec<ErrorOf>, SpeedError> {
    let mut all = Vec::new();
    for family in ERROR_FAMILIES {
        let rows: Vec<Row<T>> = rows_of::<T>(family, n, seed, count)
            .into_par_iter()
            .filter(|row| validity(n, &row.map(T::widen)).is_definite())
            .collect();
        let exact: Vec<f64> = rows.par_iter().map(|row| reference(n, row)).collect();
        let mut add = |solver: Solver, results: &[f64]| {
            let mut not_finite = 0;
            let errors = rows
                .iter()
                .zip(&exact)
                .zip(results)
                .map(|((row, exact), got)| {
                    if got.is_finite() {
                        (got - exact).abs() / row.m[0].widen()
                    } else {
                        not_finite += 1;
                        1.0
                    }
                })
                .collect();
            all.push(ErrorOf {
                solver,
                n,
                precision: T::PRECISION,
                family: family.into(),
                rows: rows.len(),
                not_finite,
                quantiles: Quantiles::of(errors),
            });
        };
        for (solver, function) in own.iter().filter(|(s, _)| !s.is_adjoint()) {
            let mut kernel = Native::new(function, &rows)?;
            kernel.time(Mode::default())?;
            let bounds: Vec<f64> = kernel.outputs().iter().map(|o| o[0]).collect();
            add(*solver, &bounds);
        }
        if let Some(peer) = &mut peer {
            peer.load(n, &rows)?;
            peer.time(Quantity::Bound, false)?;
            add(Solver::Peer, &peer.bounds()?);
        }
    }
    Ok(all)
}

/// The lower bound of a row's own numbers.
fn reference<T: Format>(n: usize, row: &Row<T>) -> f64 {
    let m: [DoubleDouble; MAX_MOMENTS] = row.m.map(|m| DoubleDouble::from(m.widen()));
    let eta = DoubleDouble::from(row.eta.widen());
    bounds_of(n, m, eta).lower.into()
}
