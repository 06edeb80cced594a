//! The 2025 paper's study of stability (section 6, Figure 6): bounds and derivatives at every root of
//! P_n and within 8e-6 of it, where a point of the canonical representation goes to infinity.

use std::path::PathBuf;

use hankel_moments::MAX_MOMENTS;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::orthogonal::orthogonal_roots;
use super::table_1::{exact_gradient, kernel};
use super::{AccuracyError, LEAST_SAMPLES};
use crate::families::{Family, Format, ORDERS, Precision, Row, scaled, validity};
use crate::numbers::DoubleDouble;
use crate::peer::{Peer, Quantity};
use crate::speed::Quantiles;
use crate::stress::{Native, Solver, bounds_of};

/// Half the width of the neighbourhood.
pub const NEIGHBOURHOOD: f64 = 8e-6;

/// Queries around a singularity, the one at it included.
const QUERIES: u64 = 17;

/// What to measure.
#[derive(Clone, Debug)]
pub struct Options {
    /// Orders n, from 1 to 6.
    pub orders: Vec<usize>,
    /// Number formats.
    pub precisions: Vec<Precision>,
    /// Moment vectors of each order and precision.
    pub samples: u64,
    /// Seed of the rows.
    pub seed: u64,
    /// The interpreter that has `diffmoments`; `None` leaves it out.
    pub python: Option<PathBuf>,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            orders: ORDERS.collect(),
            precisions: vec![Precision::F32, Precision::F64],
            samples: 400,
            seed: 1,
            python: None,
        }
    }
}

/// Distances from the exact values at the singularity (*limit*), and errors: distances from the exact
/// values at the query.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Deviation {
    /// From the limit.
    pub limit: Quantiles,
    /// From the exact value there.
    pub error: Quantiles,
    /// How far the exact value itself is from the limit at most.
    pub exact: f64,
}

/// Figures of one order, precision and implementation.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Line {
    /// The order.
    pub n: usize,
    /// The number format.
    pub precision: Precision,
    /// `Plain` or `Peer`.
    pub solver: Solver,
    /// Moment vectors.
    pub vectors: u64,
    /// Queries.
    pub queries: u64,
    /// Queries with a bound that is not finite.
    pub non_finite_bounds: u64,
    /// Queries with a derivative that is not finite.
    pub non_finite_gradients: u64,
    /// The lower bound.
    pub bound: Deviation,
    /// The largest component of the derivatives to the moments.
    pub d_moments: Deviation,
    /// The derivative to the query point.
    pub d_eta: Deviation,
}

/// Everything that was measured.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Singularities {
    /// Moment vectors of each order and precision.
    pub samples: u64,
    /// Seed.
    pub seed: u64,
    /// Name and version of `diffmoments`, if it was measured.
    pub peer: Option<String>,
    /// The figures.
    pub lines: Vec<Line>,
}

impl Singularities {
    /// Whether nothing of ours was infinite or no number.
    #[must_use]
    pub fn passed(&self) -> bool {
        self.lines
            .iter()
            .filter(|l| l.solver != Solver::Peer)
            .all(|l| l.non_finite_bounds == 0 && l.non_finite_gradients == 0)
    }
}

/// Measures.
///
/// # Errors
/// Options out of range, a kernel that does not run, or `diffmoments` missing where it was asked
/// for.
pub fn measure(
    options: &Options,
    progress: &mut dyn FnMut(&str),
) -> Result<Singularities, AccuracyError> {
    if let Some(&n) = options.orders.iter().find(|n| !ORDERS.contains(n)) {
        return Err(AccuracyError::Order(n));
    }
    if options.samples < LEAST_SAMPLES {
        return Err(AccuracyError::Samples(options.samples));
    }
    let mut peer = options.python.as_ref().map(Peer::start).transpose()?;
    let mut found = Singularities {
        samples: options.samples,
        seed: options.seed,
        peer: peer.as_ref().map(Peer::name),
        lines: Vec::new(),
    };
    for &n in &options.orders {
        for &precision in &options.precisions {
            progress(&format!("singularities, n = {n}, {precision}"));
            found.lines.extend(match precision {
                Precision::F32 => of_order::<f32>(n, options, peer.as_mut())?,
                Precision::F64 => of_order::<f64>(n, options, peer.as_mut())?,
            });
        }
    }
    Ok(found)
}

/// A bound and its derivatives: the bound, those to moments and query.
#[derive(Clone, Debug)]
struct Values {
    bound: f64,
    gradient: Vec<f64>,
}

impl Values {
    fn exact(n: usize, m: [DoubleDouble; MAX_MOMENTS], eta: DoubleDouble) -> Self {
        Self {
            bound: f64::from(bounds_of(n, m, eta).lower),
            gradient: exact_gradient(n, m, eta),
        }
    }

    /// Differences of bound, derivatives to moments (the largest) and derivative to the query.
    fn distance(&self, other: &Self) -> [f64; 3] {
        let last = self.gradient.len() - 1;
        let pairs = self.gradient.iter().zip(&other.gradient);
        let mut moments = 0.0_f64;
        for (a, b) in pairs.take(last) {
            let difference = (a - b).abs();
            // A NaN must not get lost in a maximum.
            if difference.is_nan() {
                moments = f64::NAN;
                break;
            }
            moments = moments.max(difference);
        }
        [
            (self.bound - other.bound).abs(),
            moments,
            (self.gradient[last] - other.gradient[last]).abs(),
        ]
    }
}

struct Query<T> {
    row: Row<T>,
    exact: Values,
    limit: Values,
}

fn queries<T: Format>(family: &Family, n: usize, seed: u64, index: u64) -> Vec<Query<T>> {
    let row: Row<T> = family.row(n, seed, index);
    let wide = row.map(T::widen);
    let m = wide.m.map(DoubleDouble::from);
    let definite = scaled(&wide).is_some_and(|(s, _)| validity(n, &s).is_definite());
    let roots = orthogonal_roots(n, &m).filter(|_| definite);
    let Some(roots) = roots else {
        return Vec::new();
    };
    let mut random = fastrand::Rng::with_seed(seed ^ (index << 20));
    let mut all = Vec::new();
    for &y in &roots[..n] {
        let limit = Values::exact(n, m, y);
        for k in 0..QUERIES {
            let offset = match k {
                0 => 0.0,
                _ => NEIGHBOURHOOD * (2.0 * random.f64() - 1.0),
            };
            let eta = T::round_exact(y + DoubleDouble::from(offset));
            all.push(Query {
                row: Row { eta, ..row },
                exact: Values::exact(n, m, DoubleDouble::from(eta.widen())),
                limit: limit.clone(),
            });
        }
    }
    all
}

fn of_order<T: Format>(
    n: usize,
    options: &Options,
    peer: Option<&mut Peer>,
) -> Result<Vec<Line>, AccuracyError> {
    let family = Family::named("paper").ok_or(AccuracyError::Family("paper"))?;
    let bound = kernel(&format!("moment_bound_n{n}"), T::PRECISION)?;
    let adjoint = kernel(&format!("moment_bound_adjoint_n{n}"), T::PRECISION)?;
    let of_vectors: Vec<Vec<Query<T>>> = (0..options.samples)
        .into_par_iter()
        .map(|index| queries(family, n, options.seed, index))
        .collect();
    let vectors = of_vectors.iter().filter(|v| !v.is_empty()).count() as u64;
    let queries: Vec<Query<T>> = of_vectors.into_iter().flatten().collect();
    let rows: Vec<Row<T>> = queries.iter().map(|q| q.row).collect();
    let mut lanes = Native::lanes();
    let bounds = bound.run(&mut lanes, n, &rows, 0.0)?;
    let gradients = adjoint.run(&mut lanes, n, &rows, 0.0)?;
    let own: Vec<Values> = bounds
        .iter()
        .zip(gradients.chunks_exact(2 * n + 2))
        .map(|(bound, gradient)| Values {
            bound: bound.widen(),
            gradient: gradient.iter().map(|x| x.widen()).collect(),
        })
        .collect();
    let mut lines = vec![line::<T>(n, Solver::Plain, vectors, &queries, &own)];
    if let Some(peer) = peer {
        peer.load(n, &rows)?;
        peer.time(Quantity::Gradient, false)?;
        let its: Vec<Values> = peer
            .bounds()?
            .into_iter()
            .zip(peer.gradients()?)
            .map(|(bound, gradient)| Values { bound, gradient })
            .collect();
        lines.push(line::<T>(n, Solver::Peer, vectors, &queries, &its));
    }
    Ok(lines)
}

fn line<T: Format>(
    n: usize,
    solver: Solver,
    vectors: u64,
    queries: &[Query<T>],
    values: &[Values],
) -> Line {
    let finite_gradient = |v: &Values| v.gradient.iter().all(|x| x.is_finite());
    let of = |i: usize| {
        let distances = |to: fn(&Query<T>) -> &Values| -> Vec<f64> {
            queries
                .iter()
                .zip(values)
                .map(|(q, v)| v.distance(to(q))[i])
                .filter(|d| d.is_finite())
                .collect()
        };
        Deviation {
            limit: Quantiles::of(distances(|q| &q.limit)),
            error: Quantiles::of(distances(|q| &q.exact)),
            exact: queries
                .iter()
                .map(|q| q.exact.distance(&q.limit)[i])
                .fold(0.0, f64::max),
        }
    };
    Line {
        n,
        precision: T::PRECISION,
        solver,
        vectors,
        queries: queries.len() as u64,
        non_finite_bounds: values.iter().filter(|v| !v.bound.is_finite()).count() as u64,
        non_finite_gradients: values.iter().filter(|v| !finite_gradient(v)).count() as u64,
        bound: of(0),
        d_moments: of(1),
        d_eta: of(2),
    }
}
