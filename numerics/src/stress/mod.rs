//! Bounds under stress: every [family](crate::families) of rows, every order and precision, on
//! every backend, against more precise arithmetic.
//!
//! All rows count when it is asked whether a result is a number from 0 to m_0. Errors are taken over
//! *valid* rows only, those whose own numbers, rounded as they are, make a positive definite Hankel
//! matrix; others have no right answer. An error is a share of m_0, the larger one of the lower and
//! the upper bound's. The main figure is the error over the *sensitivity*, which is what rounding each
//! of a row's numbers and the result once does to the answer: a hard row is no bad algorithm. The reference is the same source in double-double, or with 300 bits where that
//! is not enough; samples of it are compared with 300 bits and with the linear programme.

mod backend;
mod circle;
mod derivatives;
mod gradient;
mod reference;
pub mod shadows;
mod tables;

pub use backend::{Backend, BackendError, LANES, Map, Native};
pub use derivatives::Derivatives;
pub use reference::{
    Agreement, Judgement, Truth, bounds_of, canonical_of, gradient_by_differences, gradient_of,
    judgement,
};

use std::path::PathBuf;

use hankel_dsl::native::lanes::level_name;
use hankel_moments::MAX;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::families::{FAMILIES, Family, Format, ORDERS, Precision, Row, Validity};
use crate::peer::{Peer, PeerError, Quantity};
use crate::published::{self, Float};
use crate::speed::Quantiles;

/// Why bounds could not be put under stress.
#[derive(Debug, thiserror::Error)]
pub enum StressError {
    /// No family of that name.
    #[error("there is no family `{given}` of rows; there are: {}", known())]
    Family {
        /// What was asked for.
        given: String,
    },
    /// An order that there are no bounds for.
    #[error("there is no bound of order {0}: give n from 1 to {most}", most = MAX)]
    Order(usize),
    /// Too few rows.
    #[error("{0} rows are too few: give at least {LEAST_SAMPLES}")]
    Samples(u64),
    /// A kernel that is not what is expected of it.
    #[error("kernel `{kernel}`: {problem}")]
    Kernel {
        /// Which.
        kernel: String,
        /// What is wrong.
        problem: String,
    },
    /// A kernel that did not run.
    #[error("kernel `{kernel}` on {backend}: {error}")]
    Backend {
        /// Which.
        kernel: String,
        /// Where.
        backend: String,
        /// Why not.
        error: BackendError,
    },
    /// The process for the other implementation.
    #[error(transparent)]
    Peer(#[from] PeerError),
}

fn known() -> String {
    let names: Vec<&str> = FAMILIES.iter().map(|f| f.name).collect();
    names.join(", ")
}

/// The fewest rows of a family.
pub const LEAST_SAMPLES: u64 = 16;

/// What to measure.
#[derive(Clone, Debug)]
pub struct Options {
    /// Families, in the order of the report.
    pub families: Vec<&'static Family>,
    /// Orders n, from 1 to 6.
    pub orders: Vec<usize>,
    /// Number formats.
    pub precisions: Vec<Precision>,
    /// Rows of each family, order and precision.
    pub samples: u64,
    /// How many of them derivatives are measured on: what these are sensitive to is found in 300 bits.
    pub derivative_rows: u64,
    /// How many of them the reference is compared with 300 bits on.
    pub wide_checks: u64,
    /// And with the linear programme.
    pub programme_checks: u64,
    /// Seed of the rows.
    pub seed: u64,
    /// The interpreter that has `diffmoments`; `None` leaves it out.
    pub python: Option<PathBuf>,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            families: FAMILIES.iter().collect(),
            orders: ORDERS.collect(),
            precisions: vec![Precision::F32, Precision::F64],
            samples: 10_000,
            derivative_rows: 100,
            wide_checks: 8,
            programme_checks: 2,
            seed: 1,
            python: None,
        }
    }
}

impl Options {
    /// The families of these names; of none, all.
    ///
    /// # Errors
    /// [`StressError::Family`], with the names that there are.
    pub fn families_named(names: &[String]) -> Result<Vec<&'static Family>, StressError> {
        if names.is_empty() {
            return Ok(FAMILIES.iter().collect());
        }
        names
            .iter()
            .map(|name| {
                Family::named(name).ok_or_else(|| StressError::Family {
                    given: name.clone(),
                })
            })
            .collect()
    }

    pub(crate) fn check(&self) -> Result<(), StressError> {
        if let Some(&n) = self.orders.iter().find(|n| !ORDERS.contains(n)) {
            return Err(StressError::Order(n));
        }
        if self.samples < LEAST_SAMPLES {
            return Err(StressError::Samples(self.samples));
        }
        Ok(())
    }
}

/// How a bound is computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Solver {
    /// `moment_bound_nN`.
    Plain,
    /// `moment_bound_compensated_nN`.
    Compensated,
    /// Algorithm 1 of the 2025 paper, as [`published::moment_bound`] has it.
    Published,
    /// `diffmoments`.
    Peer,
}

impl Solver {
    /// The name in tables.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Plain => "plain",
            Self::Compensated => "compensated",
            Self::Published => "published",
            Self::Peer => "diffmoments",
        }
    }

    /// Whether it is a kernel.
    #[must_use]
    pub const fn is_kernel(self) -> bool {
        matches!(self, Self::Plain | Self::Compensated)
    }

    /// The kernel function of an order; `None` for what is no kernel.
    fn function(self, n: usize) -> Option<String> {
        match self {
            Self::Plain => Some(format!("moment_bound_n{n}")),
            Self::Compensated => Some(format!("moment_bound_compensated_n{n}")),
            Self::Published | Self::Peer => None,
        }
    }

    /// The kernel function of an order's derivatives, if there is one; `None` for what is no kernel.
    fn adjoint(self, n: usize) -> Option<String> {
        match self {
            Self::Plain => Some(format!("moment_bound_adjoint_n{n}")),
            Self::Compensated => Some(format!("moment_bound_adjoint_compensated_n{n}")),
            Self::Published | Self::Peer => None,
        }
    }
}

/// What came out for the rows of one family, order and precision, by one solver on one backend.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Cell {
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
    /// All rows.
    pub rows: u64,
    /// Those that are valid.
    pub valid: u64,
    /// Those whose validity 300 bits did not settle.
    pub undecided: u64,
    /// Rows with a bound that is not a number or infinite.
    pub non_finite: u64,
    /// Rows with a bound below 0 or above m_0 (above 0 where m_0 is not positive or no number), or
    /// an upper bound below the lower one.
    pub out_of_range: u64,
    /// Rows whose bits are not those of the first backend; `None` for that itself and for
    /// `diffmoments`.
    pub other_bits: Option<u64>,
    /// Errors over the valid rows, as shares of m_0; `None` without valid rows.
    pub error: Option<Quantiles>,
    /// Their errors over their sensitivities.
    pub over: Option<Quantiles>,
    /// The number of the valid row with the greatest quotient.
    pub worst: Option<u64>,
}

/// Everything that was measured.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Stress {
    /// Instruction set of the lanes.
    pub level: String,
    /// Rows of each family, order and precision.
    pub samples: u64,
    /// Seed of the rows.
    pub seed: u64,
    /// Name and version of `diffmoments`, if it was measured.
    pub peer: Option<String>,
    /// The figures.
    pub cells: Vec<Cell>,
    /// The figures of derivatives.
    pub derivatives: Vec<Derivatives>,
    /// How well the reference was confirmed, by family.
    pub agreement: Vec<(String, Agreement)>,
    /// What was left out, and why.
    pub notes: Vec<String>,
}

impl Stress {
    /// Whether every kernel gave a number from 0 to m_0 for every row, finite derivatives, and lanes the scalar bits.
    /// What is no kernel is not asked.
    #[must_use]
    pub fn passed(&self) -> bool {
        self.derivatives.iter().all(|d| d.non_finite == 0)
            && self.cells.iter().filter(|c| c.solver.is_kernel()).all(|c| {
                let same = c.backend != LANES || c.other_bits.unwrap_or(0) == 0;
                c.non_finite == 0 && c.out_of_range == 0 && same
            })
    }
}

/// Runs every kernel on every family. The bits of all `backends` are compared with the first's.
///
/// # Errors
/// Options out of range, a kernel that does not run, or `diffmoments` missing where it was asked for.
pub fn run(
    options: &Options,
    backends: &mut [&mut dyn Backend],
    progress: &mut dyn FnMut(&str),
) -> Result<Stress, StressError> {
    options.check()?;
    let mut peer = options.python.as_ref().map(Peer::start).transpose()?;
    let mut stress = Stress {
        level: level_name().into(),
        samples: options.samples,
        seed: options.seed,
        peer: peer.as_ref().map(Peer::name),
        ..Stress::default()
    };
    for family in &options.families {
        let mut agreement = Agreement::default();
        for &n in options.orders.iter().filter(|n| family.has(**n)) {
            for &precision in &options.precisions {
                progress(&format!("{family}, n = {n}, {precision}"));
                let mut case = Case {
                    family,
                    n,
                    options,
                    stress: &mut stress,
                };
                agreement.add(match precision {
                    Precision::F32 => case.run::<f32>(backends, peer.as_mut())?,
                    Precision::F64 => case.run::<f64>(backends, peer.as_mut())?,
                });
            }
        }
        stress.agreement.push((family.name.into(), agreement));
    }
    Ok(stress)
}

/// One family, order and precision.
struct Case<'a> {
    family: &'a Family,
    n: usize,
    options: &'a Options,
    stress: &'a mut Stress,
}

impl Case<'_> {
    fn run<T: Float>(
        &mut self,
        backends: &mut [&mut dyn Backend],
        peer: Option<&mut Peer>,
    ) -> Result<Agreement, StressError> {
        let (n, seed) = (self.n, self.options.seed);
        let judged: Vec<(Row<T>, Judgement)> = (0..self.options.samples)
            .into_par_iter()
            .map(|index| {
                let row = self.family.row::<T>(n, seed, index);
                (row, judgement(n, &row))
            })
            .collect();
        let (rows, judgements): (Vec<Row<T>>, Vec<Judgement>) = judged.into_iter().unzip();
        for solver in [Solver::Plain, Solver::Compensated] {
            let Some(function) = solver.function(n) else {
                continue;
            };
            let Some(map) = Map::find(&function, T::PRECISION)? else {
                continue;
            };
            let mut reference: Option<Vec<[T; 2]>> = None;
            for backend in &mut *backends {
                let name = backend.name();
                let mut run = |overestimation| map.run(&mut **backend, n, &rows, overestimation);
                let both = run(0.0).and_then(|lower| Ok((lower, run(1.0)?)));
                let (lower, upper) = match both {
                    Err(StressError::Backend {
                        kernel,
                        backend,
                        error: BackendError::Lacks(why),
                    }) => {
                        self.note(format!("`{kernel}` was not run on {backend}: {why}"));
                        continue;
                    }
                    both => both?,
                };
                let bounds: Vec<[T; 2]> = lower.into_iter().zip(upper).map(Into::into).collect();
                let mut cell = self.cell(solver, name, &rows, &judgements, &bounds);
                match &reference {
                    None => reference = Some(bounds),
                    Some(reference) => {
                        let same = |(a, b): &(&[T; 2], &[T; 2])| {
                            bytemuck::bytes_of(*a) == bytemuck::bytes_of(*b)
                        };
                        let all = bounds.iter().zip(reference);
                        cell.other_bits = Some(all.filter(|pair| !same(pair)).count() as u64);
                    }
                }
                self.stress.cells.push(cell);
            }
        }
        let bounds: Vec<[T; 2]> = rows
            .par_iter()
            .map(|row| published::moment_bound(n, row.m, row.eta))
            .map(|b| [b.lower, b.upper])
            .collect();
        let cell = self.cell(
            Solver::Published,
            "library".into(),
            &rows,
            &judgements,
            &bounds,
        );
        self.stress.cells.push(cell);
        if let Some(peer) = peer {
            peer.load(n, &rows)?;
            let mut both = [Vec::new(), Vec::new()];
            for (overestimation, bounds) in [0.0, 1.0].into_iter().zip(&mut both) {
                peer.overestimate(overestimation)?;
                peer.time(Quantity::Bound, false)?;
                *bounds = peer.bounds()?;
            }
            let [lower, upper] = both;
            let bounds: Vec<[T; 2]> = lower
                .into_iter()
                .zip(upper)
                .map(|(l, u)| [T::round(l), T::round(u)])
                .collect();
            let cell = self.cell(Solver::Peer, "library".into(), &rows, &judgements, &bounds);
            self.stress.cells.push(cell);
        }
        if let Some(first) = backends.first_mut() {
            let count = self.options.derivative_rows.min(self.options.samples);
            let measured = derivatives::measure::<T>(self.family, n, count, seed, &mut **first)?;
            self.stress.derivatives.extend(measured);
        }
        Ok(self.agreement(&rows, &judgements))
    }

    fn note(&mut self, note: String) {
        if !self.stress.notes.contains(&note) {
            self.stress.notes.push(note);
        }
    }

    fn cell<T: Format>(
        &self,
        solver: Solver,
        backend: String,
        rows: &[Row<T>],
        judgements: &[Judgement],
        bounds: &[[T; 2]],
    ) -> Cell {
        let is_finite = |b: &[T; 2]| b.iter().all(|x| x.widen().is_finite());
        let non_finite = bounds.iter().filter(|b| !is_finite(b)).count();
        let out_of_range = rows
            .iter()
            .zip(bounds)
            .filter(|(row, b)| is_finite(b) && !in_range(row, b))
            .count();
        let errors: Vec<(u64, f64, f64)> = judgements
            .par_iter()
            .zip(bounds)
            .enumerate()
            .filter_map(|(index, (judgement, b))| {
                let (truth, b) = (judgement.truth?, b.map(T::widen));
                Some((index as u64, truth.error(b), truth.over_sensitivity(b)))
            })
            .collect();
        let worst = errors.iter().max_by(|a, b| a.2.total_cmp(&b.2));
        let undecided = |j: &&Judgement| j.validity == Validity::Undecided;
        Cell {
            family: self.family.name.into(),
            n: self.n,
            precision: T::PRECISION,
            solver,
            backend,
            rows: rows.len() as u64,
            valid: errors.len() as u64,
            undecided: judgements.iter().filter(undecided).count() as u64,
            non_finite: non_finite as u64,
            out_of_range: out_of_range as u64,
            other_bits: None,
            worst: worst.map(|w| w.0),
            error: (!errors.is_empty())
                .then(|| Quantiles::of(errors.iter().map(|e| e.1).collect())),
            over: (!errors.is_empty()).then(|| Quantiles::of(errors.iter().map(|e| e.2).collect())),
        }
    }

    /// Compares some rows' references with 300 bits and with the linear programme.
    fn agreement<T: Format>(&self, rows: &[Row<T>], judgements: &[Judgement]) -> Agreement {
        let valid: Vec<(&Row<T>, Truth)> = rows
            .iter()
            .zip(judgements)
            .filter_map(|(row, j)| Some((row, j.truth?)))
            .collect();
        let n = self.n;
        let sample = |count: u64| {
            let step = valid.len().div_ceil((count as usize).max(1)).max(1);
            valid.par_iter().step_by(step).take(count as usize)
        };
        let both = |mut a: Agreement, b: Agreement| {
            a.add(b);
            a
        };
        let mut total = sample(self.options.wide_checks)
            .map(|(row, truth)| {
                let mut agreement = Agreement::default();
                agreement.check_wide(n, row, truth);
                agreement
            })
            .reduce(Agreement::default, both);
        total.add(
            sample(self.options.programme_checks)
                .map(|(row, truth)| {
                    let mut agreement = Agreement::default();
                    agreement.check_programme(n, row, truth);
                    agreement
                })
                .reduce(Agreement::default, both),
        );
        total
    }
}

/// Whether both bounds are from 0 to m_0 and in order.
fn in_range<T: Format>(row: &Row<T>, [lower, upper]: &[T; 2]) -> bool {
    let zero = T::round(0.0);
    let mass = row.m[0];
    let mass = if mass > zero && mass.widen().is_finite() {
        mass
    } else {
        zero
    };
    let within = |x: T| x >= zero && x <= mass;
    within(*lower) && within(*upper) && lower <= upper
}
