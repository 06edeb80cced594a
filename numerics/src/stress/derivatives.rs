//! How exact derivatives are: those of both bounds to a row's numbers, over what rounding each number of the row
//! once does to them.

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::gradient::gradients;
use super::reference::{Rounding, STEP, is_in_range, wide_moments};
use super::{Backend, BackendError, Map, Solver, StressError};
use crate::families::{Family, Format, Precision, Row, scaled, validity};
use crate::numbers::Wide;
use crate::speed::Quantiles;

/// Derivatives above this are left out: the library limits them to ten times that.
const MOST_F32: f64 = 1e24;
const MOST_F64: f64 = 1e99;

/// For twelve moments, derivatives below this count as that: factors of theirs may underflow.
const LEAST_OF_TWELVE: f64 = 1e-12;

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
        let m = wide_moments(n, &row);
        let eta = Wide::from(row.eta);
        let (exact, roots) = gradients(&m, eta, None);
        let mut sensitivities = [0, 1].map(|bound: usize| rounding.of_gradient(n, &exact[bound]));
        for direction in 0..=2 * n + 1 {
            let (mut m, mut eta) = (m.clone(), eta);
            let rounded = if let Some(moment) = m.get_mut(direction) {
                *moment += Wide::from(STEP);
                rounding.of_moment(row.m[direction])
            } else {
                eta += Wide::from(STEP);
                rounding.of(row.eta, 0)
            };
            let (there, _) = gradients(&m, eta, Some(&roots));
            for ((sensitivities, there), here) in sensitivities.iter_mut().zip(there).zip(&exact) {
                for ((sensitivity, there), here) in sensitivities.iter_mut().zip(there).zip(here) {
                    let by_step = f64::from((there - *here) / Wide::from(STEP));
                    *sensitivity += by_step.abs() * rounded;
                }
            }
        }
        Some(Self {
            index,
            exact,
            sensitivities,
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
                // To the query point, the limit of both formats is that of the product with the total.
                let most = match T::PRECISION {
                    Precision::F64 if k < last => MOST_F64,
                    _ => MOST_F32,
                };
                if unscaled.abs() > most {
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

impl Rounding {
    /// What rounding each derivative once does to it. One that is less than epsilon times the greatest of its row, or
    /// than [`LEAST_OF_TWELVE`], counts as that.
    fn of_gradient(&self, n: usize, gradient: &[Wide]) -> Vec<f64> {
        let sizes = || gradient.iter().map(|d| f64::from(*d).abs());
        let moments = gradient.len() - 1;
        let least = if n == 6 { LEAST_OF_TWELVE } else { 0.0 };
        let of_greatest = self.epsilon() * sizes().take(moments).fold(0.0, f64::max);
        let of_moments = sizes()
            .take(moments)
            .map(|d| self.of(d.max(of_greatest).max(least), 0));
        let of_query = sizes().skip(moments).map(|d| self.of_moment(d.max(least)));
        of_moments.chain(of_query).collect()
    }
}

/// Measures the adjoints of an order on the first `count` rows of a family.
pub(super) fn measure<T: Format>(
    family: &Family,
    n: usize,
    count: u64,
    seed: u64,
    backend: &mut dyn Backend,
) -> Result<Vec<Derivatives>, StressError> {
    let mut all = Vec::new();
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
