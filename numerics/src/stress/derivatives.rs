//! How exact derivatives are: those of both bounds to a row's numbers, over what rounding each number of the row
//! once does to them.

use std::ops::RangeInclusive;

use hankel_moments::MAX_MOMENTS;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::reference::{Rounding, difference, gradient_of, is_in_range};
use super::{Backend, BackendError, Map, Solver, StressError};
use crate::families::{Family, Format, Precision, Row, scaled, validity};
use crate::numbers::Wide;
use crate::speed::Quantiles;

/// Derivatives above this are left out: kernels limit factors of derivatives to ten times that.
const MOST: f64 = 1e24;

/// Orders that are measured: beyond, second derivatives in 300 bits take minutes for a few rows.
const ORDERS: RangeInclusive<usize> = 1..=3;

/// What came out for the derivatives of one family, order and precision, by one solver.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Derivatives {
    /// The family's name.
    pub family: String,
    /// The order.
    pub n: usize,
    /// The number format.
    pub precision: Precision,
    /// The solver.
    pub solver: Solver,
    /// Where it ran.
    pub backend: String,
    /// Rows with derivatives to compare with.
    pub valid: u64,
    /// Those with a derivative that is not a number or infinite.
    pub non_finite: u64,
    /// The greatest quotient of a row: error over sensitivity.
    pub over: Option<Quantiles>,
    /// The number of the row with the greatest one.
    pub worst: Option<u64>,
}

/// A row's exact derivatives.
struct Truth {
    index: u64,
    /// Of the lower and of the upper bound: to m_0 to m_2n, and then to the query point, of moments with a
    /// total from 1 to 2.
    exact: [Vec<Wide>; 2],
    /// What rounding does to them.
    sensitivities: [Vec<f64>; 2],
    /// Binary exponent of the power of two that the moments were multiplied by.
    exponent: i32,
}

impl Truth {
    fn of<T: Format>(n: usize, index: u64, row: &Row<T>) -> Option<Self> {
        let given = row.map(T::widen);
        let (row, exponent) = scaled(&given)?;
        if !is_in_range(n, &given) || !validity(n, &row).is_definite() {
            return None;
        }
        let rounding = Rounding::new::<T>(exponent);
        let both = [0.0, 1.0].map(|overestimation| of_bound(n, &row, overestimation, &rounding));
        let [lower, upper] = both;
        Some(Self {
            index,
            exact: [lower.0, upper.0],
            sensitivities: [lower.1, upper.1],
            exponent,
        })
    }

    /// The greatest error over sensitivity of all derivatives; infinite for what is not a number.
    fn over_sensitivity<T: Format>(&self, computed: [&[T]; 2]) -> f64 {
        let mut greatest = 0.0_f64;
        for ((exact, sensitivities), computed) in
            self.exact.iter().zip(&self.sensitivities).zip(computed)
        {
            let last = exact.len() - 1;
            for (k, ((exact, sensitivity), computed)) in
                exact.iter().zip(sensitivities).zip(computed).enumerate()
            {
                // Only the derivative to the query point has the unit of the moments.
                let e = if k == last { self.exponent } else { 0 };
                let unscaled = f64::from(*exact) * 2.0_f64.powi(e / 2) * 2.0_f64.powi(e - e / 2);
                if unscaled.abs() > MOST {
                    continue;
                }
                let computed = computed.widen() * 2.0_f64.powi(-e / 2) * 2.0_f64.powi(-e + e / 2);
                let error = f64::from(*exact - Wide::from(computed)).abs();
                // Where a bound is 0 throughout, so is all of this.
                let over = if error == 0.0 {
                    0.0
                } else {
                    error / sensitivity
                };
                greatest = greatest.max(if over.is_finite() {
                    over
                } else {
                    f64::INFINITY
                });
            }
        }
        greatest
    }
}

/// The derivatives of a blend of the bounds, and their sensitivities.
fn of_bound(
    n: usize,
    row: &Row<f64>,
    overestimation: f64,
    rounding: &Rounding,
) -> (Vec<Wide>, Vec<f64>) {
    let (m, eta) = (row.m.map(Wide::from), Wide::from(row.eta));
    let at = |m: [Wide; MAX_MOMENTS], eta: Wide| {
        let gradient = gradient_of(n, m, eta, Wide::from(overestimation));
        let mut all = gradient.m[..=2 * n].to_vec();
        all.push(gradient.eta);
        all
    };
    let exact = at(m, eta);
    let greatest = exact[..=2 * n]
        .iter()
        .map(|d| f64::from(*d).abs())
        .fold(0.0, f64::max);
    let mut sensitivities: Vec<f64> = exact
        .iter()
        .enumerate()
        .map(|(k, d)| {
            let d = f64::from(*d);
            if k <= 2 * n {
                rounding.of(d.abs().max(rounding.epsilon() * greatest), 0)
            } else {
                rounding.of_moment(d)
            }
        })
        .collect();
    for direction in 0..=2 * n + 1 {
        let (there, back, twice) = difference(n, m, eta, direction, at);
        let rounded = if direction <= 2 * n {
            rounding.of_moment(row.m[direction])
        } else {
            rounding.of(row.eta, 0)
        };
        for ((sensitivity, there), back) in sensitivities.iter_mut().zip(there).zip(back) {
            *sensitivity += f64::from((there - back) / twice).abs() * rounded;
        }
    }
    (exact, sensitivities)
}

/// Measures the adjoints of an order on the first `count` rows of a family; nothing for an order that is not
/// measured.
pub(super) fn measure<T: Format>(
    family: &Family,
    n: usize,
    count: u64,
    seed: u64,
    backend: &mut dyn Backend,
) -> Result<Vec<Derivatives>, StressError> {
    let mut all = Vec::new();
    if !ORDERS.contains(&n) {
        return Ok(all);
    }
    let judged: Vec<(Row<T>, Truth)> = (0..count)
        .into_par_iter()
        .filter_map(|index| {
            let row = family.row::<T>(n, seed, index);
            let truth = Truth::of(n, index, &row)?;
            Some((row, truth))
        })
        .collect();
    let (rows, truths): (Vec<Row<T>>, Vec<Truth>) = judged.into_iter().unzip();
    if rows.is_empty() {
        return Ok(all);
    }
    for solver in [Solver::Plain, Solver::Compensated] {
        let Some(function) = solver.adjoint(n) else {
            continue;
        };
        let Some(map) = Map::find(&function, T::PRECISION)? else {
            continue;
        };
        let mut run = |overestimation| map.run(backend, n, &rows, overestimation);
        let (lower, upper) = match run(0.0).and_then(|lower| Ok((lower, run(1.0)?))) {
            Err(StressError::Backend {
                error: BackendError::Lacks(_),
                ..
            }) => continue,
            both => both?,
        };
        let length = 2 * n + 2;
        let results = lower.chunks_exact(length).zip(upper.chunks_exact(length));
        let is_finite = |d: &[T]| d.iter().all(|x| x.widen().is_finite());
        let non_finite = results
            .clone()
            .filter(|(l, u)| !is_finite(l) || !is_finite(u))
            .count();
        let over: Vec<(u64, f64)> = truths
            .iter()
            .zip(results)
            .map(|(truth, (lower, upper))| (truth.index, truth.over_sensitivity([lower, upper])))
            .collect();
        all.push(Derivatives {
            family: family.name.into(),
            n,
            precision: T::PRECISION,
            solver,
            backend: backend.name(),
            valid: rows.len() as u64,
            non_finite: non_finite as u64,
            worst: over
                .iter()
                .max_by(|a, b| a.1.total_cmp(&b.1))
                .map(|worst| worst.0),
            over: (!over.is_empty()).then(|| Quantiles::of(over.iter().map(|o| o.1).collect())),
        });
    }
    Ok(all)
}
