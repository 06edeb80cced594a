//! The measures of Table 1 of the 2025 paper.

use std::path::PathBuf;

use hankel_dsl::lit;
use hankel_moments::MAX_MOMENTS;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::orthogonal::orthogonal_roots;
use super::{AccuracyError, LEAST_SAMPLES};
use crate::families::{Family, Format, ORDERS, Precision, Row, scaled, validity};
use crate::numbers::DoubleDouble;
use crate::peer::{Peer, Quantity};
use crate::stress::{
    Backend, Map, Native, Solver, canonical_of, gradient_by_differences, gradient_of,
};

/// The rows: 2n + 1 normal points.
const FAMILY: &str = "paper";

/// Queries nearer than this to a singularity are left out, as in the paper, which does not say how
/// near. With this and 2n + 1 points, `diffmoments` gives the paper's figures to within a third.
pub const NEAR: f64 = 1e-2;

/// Rows that are worked on at once.
const BLOCK: u64 = 1 << 16;

/// Step of the finite differences, relative to what is varied if that is above 1: the square root of
/// the rounding error of `f64`.
const STEP: f64 = 1.0 / (1 << 26) as f64;

/// What to measure.
#[derive(Clone, Debug)]
pub struct Options {
    /// Orders n, from 1 to 6.
    pub orders: Vec<usize>,
    /// Rows of each order and precision.
    pub samples: u64,
    /// Rows of each order on which the reference derivative is compared with
    /// differences in 300 bits.
    pub difference_checks: u64,
    /// Seed of the rows.
    pub seed: u64,
    /// The interpreter that has `diffmoments`; `None` leaves it out.
    pub python: Option<PathBuf>,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            orders: ORDERS.collect(),
            samples: 20_000,
            difference_checks: 64,
            seed: 1,
            python: None,
        }
    }
}

/// Figures of one order, precision and implementation. Means are over rows and, for derivatives to
/// the moments, over those.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Line {
    /// The order.
    pub n: usize,
    /// The number format.
    pub precision: Precision,
    /// `Plain` or `Peer`.
    pub solver: Solver,
    /// Rows that count.
    pub rows: u64,
    /// Rows left out: the Hankel matrix is not positive definite.
    pub singular: u64,
    /// Rows left out: the query is near a singularity.
    pub near: u64,
    /// Rows with points, weights or derivatives that are not finite; in none of the means.
    pub non_finite: u64,
    /// Mean Euclidean distance of the moments from those of the points and weights.
    pub reproduction: f64,
    /// Mean error of the derivatives to the moments.
    pub d_moments: f64,
    /// Mean error of the derivative to the query point.
    pub d_eta: f64,
    /// Mean distance of the derivatives to the moments from forward differences of the bound in
    /// `f64`; only there.
    pub d_moments_differences: Option<f64>,
    /// The same for the query point.
    pub d_eta_differences: Option<f64>,
}

/// Everything that was measured.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Table1 {
    /// Rows of each order and precision.
    pub samples: u64,
    /// Seed of the rows.
    pub seed: u64,
    /// Name and version of `diffmoments`, if it was measured.
    pub peer: Option<String>,
    /// The figures.
    pub lines: Vec<Line>,
    /// For each order, rows on which the reference derivative was compared with differences of the
    /// bound in 300 bits, and the largest difference relative to the larger of 1 and the derivative.
    pub reference: Vec<(usize, u64, f64)>,
}

/// What the paper's Table 1 has for its C++ code.
#[derive(Clone, Copy, Debug)]
pub struct Published {
    /// Reproduction of moments in `f32`; for n = 5 there is none.
    pub reproduction_f32: Option<f64>,
    /// Reproduction of moments in `f64`.
    pub reproduction_f64: f64,
    /// Derivatives to moments in `f64`, against finite differences.
    pub d_moments: f64,
    /// Derivative to the query point in `f64`, against finite differences.
    pub d_eta: f64,
}

/// The table, n = 1 to 5; the paper has no n = 6.
pub const PUBLISHED: [Published; 5] = [
    published(Some(1.68e-7), 3.20e-16, 3.54e-7, 2.20e-7),
    published(Some(3.14e-6), 5.93e-15, 2.27e-6, 8.37e-7),
    published(Some(2.51e-4), 4.80e-13, 1.90e-5, 3.12e-6),
    published(Some(3.96e-2), 1.00e-10, 3.46e-4, 9.08e-6),
    published(None, 2.86e-9, 5.79e-3, 2.82e-5),
];

const fn published(
    reproduction_f32: Option<f64>,
    reproduction_f64: f64,
    d_moments: f64,
    d_eta: f64,
) -> Published {
    Published {
        reproduction_f32,
        reproduction_f64,
        d_moments,
        d_eta,
    }
}

/// Measures the table.
///
/// # Errors
/// Options out of range, a kernel that does not run, or `diffmoments` missing where it was asked
/// for.
pub fn measure(options: &Options, progress: &mut dyn FnMut(&str)) -> Result<Table1, AccuracyError> {
    if let Some(&n) = options.orders.iter().find(|n| !ORDERS.contains(n)) {
        return Err(AccuracyError::Order(n));
    }
    if options.samples < LEAST_SAMPLES {
        return Err(AccuracyError::Samples(options.samples));
    }
    let mut peer = options.python.as_ref().map(Peer::start).transpose()?;
    let mut table = Table1 {
        samples: options.samples,
        seed: options.seed,
        peer: peer.as_ref().map(Peer::name),
        ..Table1::default()
    };
    for &n in &options.orders {
        for precision in [Precision::F32, Precision::F64] {
            progress(&format!("Table 1, n = {n}, {precision}"));
            let lines = match precision {
                Precision::F32 => of_order::<f32>(n, options, peer.as_mut())?,
                Precision::F64 => of_order::<f64>(n, options, peer.as_mut())?,
            };
            table.lines.extend(lines);
        }
        table.reference.push(reference(n, options)?);
    }
    Ok(table)
}

/// A row that counts, with the exact derivatives of its lower bound.
struct Sample<T> {
    row: Row<T>,
    gradient: Vec<f64>,
}

enum Drawn<T> {
    Counts(Box<Sample<T>>),
    Singular,
    Near,
}

fn family() -> Result<&'static Family, AccuracyError> {
    Family::named(FAMILY).ok_or(AccuracyError::Family(FAMILY))
}

fn draw<T: Format>(family: &Family, n: usize, seed: u64, index: u64) -> Drawn<T> {
    let row: Row<T> = family.row(n, seed, index);
    let wide = row.map(T::widen);
    let Some((scaled, _)) = scaled(&wide) else {
        return Drawn::Singular;
    };
    let m = wide.m.map(DoubleDouble::from);
    let (true, Some(roots)) = (validity(n, &scaled).is_definite(), orthogonal_roots(n, &m)) else {
        return Drawn::Singular;
    };
    let eta = wide.eta;
    if roots[..n]
        .iter()
        .any(|&y| (f64::from(y) - eta).abs() < NEAR)
    {
        return Drawn::Near;
    }
    Drawn::Counts(Box::new(Sample {
        row,
        gradient: exact_gradient(n, m, DoubleDouble::from(eta)),
    }))
}

/// Derivatives of the lower bound to m_0 to m_2n and then to the query point.
pub(super) fn exact_gradient(
    n: usize,
    m: [DoubleDouble; MAX_MOMENTS],
    eta: DoubleDouble,
) -> Vec<f64> {
    let gradient = gradient_of(n, m, eta, lit!(0.0));
    let all = gradient.m[..=2 * n].iter().chain([&gradient.eta]);
    all.map(|&d| f64::from(d)).collect()
}

/// Sums over rows.
#[derive(Default)]
struct Sums {
    rows: u64,
    non_finite: u64,
    reproduction: f64,
    d_moments: f64,
    d_eta: f64,
    d_moments_differences: f64,
    d_eta_differences: f64,
}

impl Sums {
    fn add<T: Format>(
        &mut self,
        n: usize,
        sample: &Sample<T>,
        points: &[(f64, f64)],
        gradient: &[f64],
        differences: Option<&[f64]>,
    ) {
        let reproduction = reproduction_error(n, &sample.row.map(T::widen), points);
        let mean_error = |reference: &[f64]| {
            let of_moments = gradient[..=2 * n].iter().zip(reference);
            let sum: f64 = of_moments.map(|(a, b)| (a - b).abs()).sum();
            (
                sum / (2 * n + 1) as f64,
                (gradient[2 * n + 1] - reference[2 * n + 1]).abs(),
            )
        };
        let (d_moments, d_eta) = mean_error(&sample.gradient);
        if ![reproduction, d_moments, d_eta]
            .iter()
            .all(|x| x.is_finite())
        {
            self.non_finite += 1;
            return;
        }
        self.rows += 1;
        self.reproduction += reproduction;
        self.d_moments += d_moments;
        self.d_eta += d_eta;
        if let Some(differences) = differences {
            let (d_moments, d_eta) = mean_error(differences);
            self.d_moments_differences += d_moments;
            self.d_eta_differences += d_eta;
        }
    }

    fn line<T: Format>(&self, n: usize, solver: Solver, left_out: [u64; 2]) -> Line {
        let mean = |sum: f64| sum / self.rows.max(1) as f64;
        let differences = |sum: f64| (T::PRECISION == Precision::F64).then(|| mean(sum));
        Line {
            n,
            precision: T::PRECISION,
            solver,
            rows: self.rows,
            singular: left_out[0],
            near: left_out[1],
            non_finite: self.non_finite,
            reproduction: mean(self.reproduction),
            d_moments: mean(self.d_moments),
            d_eta: mean(self.d_eta),
            d_moments_differences: differences(self.d_moments_differences),
            d_eta_differences: differences(self.d_eta_differences),
        }
    }
}

/// The Euclidean distance of the moments from those of points with weights, without rounding on the
/// way. A point at infinity with weight 0 contributes nothing.
fn reproduction_error(n: usize, row: &Row<f64>, points: &[(f64, f64)]) -> f64 {
    let mut square = 0.0;
    let mut powers: Vec<DoubleDouble> = points.iter().map(|p| DoubleDouble::from(p.1)).collect();
    for m in &row.m[..=2 * n] {
        let mut rest = DoubleDouble::from(*m);
        for (power, &(x, w)) in powers.iter_mut().zip(points) {
            if w == 0.0 {
                continue;
            }
            rest -= *power;
            *power *= DoubleDouble::from(x);
        }
        let rest = f64::from(rest);
        square += rest * rest;
    }
    square.sqrt()
}

fn of_order<T: Format>(
    n: usize,
    options: &Options,
    mut peer: Option<&mut Peer>,
) -> Result<Vec<Line>, AccuracyError> {
    let family = family()?;
    let adjoint = kernel(&format!("moment_bound_adjoint_n{n}"), T::PRECISION)?;
    let bound = kernel(&format!("moment_bound_n{n}"), T::PRECISION)?;
    let mut lanes = Native::lanes();
    let (mut own, mut its) = (Sums::default(), Sums::default());
    let mut left_out = [0; 2];
    let mut start = 0;
    while start < options.samples {
        let end = (start + BLOCK).min(options.samples);
        let drawn: Vec<Drawn<T>> = (start..end)
            .into_par_iter()
            .map(|index| draw(family, n, options.seed, index))
            .collect();
        start = end;
        let mut samples = Vec::new();
        for drawn in drawn {
            match drawn {
                Drawn::Counts(sample) => samples.push(*sample),
                Drawn::Singular => left_out[0] += 1,
                Drawn::Near => left_out[1] += 1,
            }
        }
        let rows: Vec<Row<T>> = samples.iter().map(|s| s.row).collect();
        let gradients = adjoint.run(&mut lanes, n, &rows, 0.0)?;
        let gradients: Vec<Vec<f64>> = gradients
            .chunks_exact(2 * n + 2)
            .map(|g| g.iter().map(|x| x.widen()).collect())
            .collect();
        let differences = if T::PRECISION == Precision::F64 {
            Some(differences(&bound, &mut lanes, n, &rows)?)
        } else {
            None
        };
        let of = |i: usize| differences.as_ref().map(|d| d[i].as_slice());
        for (i, (sample, gradient)) in samples.iter().zip(&gradients).enumerate() {
            let points = points_of(n, &sample.row);
            own.add(n, sample, &points, gradient, of(i));
        }
        if let Some(peer) = peer.as_deref_mut() {
            peer.load(n, &rows)?;
            let canonical = peer.canonical()?;
            peer.time(Quantity::Gradient, false)?;
            let gradients = peer.gradients()?;
            for (i, sample) in samples.iter().enumerate() {
                let (points, weights) = canonical[i].split_at(n + 1);
                let points: Vec<(f64, f64)> = points
                    .iter()
                    .copied()
                    .zip(weights.iter().copied())
                    .collect();
                its.add(n, sample, &points, &gradients[i], of(i));
            }
        }
    }
    let mut lines = vec![own.line::<T>(n, Solver::Plain, left_out)];
    if peer.is_some() {
        lines.push(its.line::<T>(n, Solver::Peer, left_out));
    }
    Ok(lines)
}

pub(super) fn kernel(function: &str, precision: Precision) -> Result<Map, AccuracyError> {
    Map::find(function, precision)?.ok_or_else(|| AccuracyError::NoKernel {
        function: function.into(),
        precision,
    })
}

/// Points and weights as numbers of the precision.
fn points_of<T: Format>(n: usize, row: &Row<T>) -> Vec<(f64, f64)> {
    let canonical = canonical_of(n, row.m, row.eta);
    let mut points = vec![(row.eta.widen(), canonical.own.widen())];
    for i in 0..n {
        let reciprocal = canonical.reciprocals[i];
        if reciprocal.eq(T::round(0.0)) {
            continue;
        }
        let x = row.eta + T::round(1.0) / reciprocal;
        points.push((x.widen(), canonical.weights[i].widen()));
    }
    points
}

/// Forward differences of the lower bound, for each row in the order of its gradient.
fn differences<T: Format>(
    bound: &Map,
    backend: &mut dyn Backend,
    n: usize,
    rows: &[Row<T>],
) -> Result<Vec<Vec<f64>>, AccuracyError> {
    let at = bound.run(backend, n, rows, 0.0)?;
    let mut all = vec![Vec::with_capacity(2 * n + 2); rows.len()];
    for direction in 0..=2 * n + 1 {
        let mut steps = Vec::with_capacity(rows.len());
        let moved: Vec<Row<T>> = rows
            .iter()
            .map(|row| {
                let mut row = *row;
                let x = if direction <= 2 * n {
                    &mut row.m[direction]
                } else {
                    &mut row.eta
                };
                let before = *x;
                *x = T::round(before.widen() + STEP * before.widen().abs().max(1.0));
                steps.push((*x - before).widen());
                row
            })
            .collect();
        let there = bound.run(backend, n, &moved, 0.0)?;
        for (i, gradient) in all.iter_mut().enumerate() {
            gradient.push((there[i].widen() - at[i].widen()) / steps[i]);
        }
    }
    Ok(all)
}

/// Compares the reference derivative with differences in 300 bits.
fn reference(n: usize, options: &Options) -> Result<(usize, u64, f64), AccuracyError> {
    let family = family()?;
    let differences: Vec<f64> = (0..options.difference_checks)
        .into_par_iter()
        .filter_map(|index| match draw::<f64>(family, n, options.seed, index) {
            Drawn::Counts(sample) => Some(sample),
            Drawn::Singular | Drawn::Near => None,
        })
        .map(|sample| {
            let m = sample.row.m.map(DoubleDouble::from);
            let differences = gradient_by_differences(n, m, DoubleDouble::from(sample.row.eta));
            let all = differences.m[..=2 * n].iter().chain([&differences.eta]);
            all.zip(&sample.gradient)
                .map(|(a, b)| (a - b).abs() / a.abs().max(1.0))
                .fold(0.0, f64::max)
        })
        .collect();
    let largest = differences.iter().copied().fold(0.0, f64::max);
    Ok((n, differences.len() as u64, largest))
}
