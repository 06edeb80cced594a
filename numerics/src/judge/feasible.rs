//! Weights and places that have given moments, as far as `f64` tells, from those that a solver found.
//!
//! What a distribution with the moments has on one side is an upper bound of the least that any has there. With P, which
//! gives a lower bound, that encloses the optimum: no derivative at an inexact solution is trusted.

use super::system::{Instance, System};
use crate::numbers::DoubleDouble;

/// Steps of Newton's method. It converges in a few, or not at all.
const STEPS: usize = 40;

/// What evaluating the basis functions may leave of a moment.
const EVALUATION: f64 = 2e-15;

/// For the differences that stand for derivatives, as a part of the range.
const DIFFERENCE: f64 = 1e-6;

/// A weight of a distribution, and where it is.
#[derive(Clone, Copy, Debug)]
pub struct Weight {
    /// The coordinate.
    pub t: f64,
    /// The weight, more than 0.
    pub weight: f64,
    /// Whether it stays where it is.
    pub is_fixed: bool,
}

/// How exactly each moment is met: to the rounding of the given ones.
pub fn allowed<'a>(instance: &'a Instance<'_>) -> impl Iterator<Item = f64> + 'a {
    instance
        .rounding
        .iter()
        .map(|rounding| rounding + EVALUATION)
}

/// Moves weights until they have the instance's moments; `None` if they do not get there.
///
/// The step is the least one in proportion: of the weights relative to themselves, and of the places relative to the
/// range.
pub fn feasible(instance: &Instance<'_>, mut weights: Vec<Weight>) -> Option<Vec<Weight>> {
    let system = instance.system();
    let (first, last) = system.ends();
    let range = last - first;
    for _ in 0..STEPS {
        let missing = missing(instance, &weights);
        let mut both = missing.iter().zip(allowed(instance));
        if both.all(|(missing, allowed)| missing.abs() <= allowed) {
            return Some(weights);
        }
        let mut columns = Vec::new();
        for it in &weights {
            columns.push(scaled(&system.column(it.t), it.weight));
            if !it.is_fixed {
                columns.push(scaled(&derivative(system, it.t, range), it.weight * range));
            }
        }
        let step = least_step(&columns, &missing)?;
        // Not so far that a weight would vanish.
        let mut step = step.into_iter();
        let mut moves = Vec::new();
        for it in &weights {
            let of_weight = step.next()?;
            let of_place = if it.is_fixed { 0.0 } else { step.next()? };
            moves.push((of_weight, of_place));
        }
        let shrinks = moves.iter().map(|it| -it.0).fold(0.0_f64, f64::max);
        let part = if shrinks > 0.5 { 0.5 / shrinks } else { 1.0 };
        for (it, (of_weight, of_place)) in weights.iter_mut().zip(moves) {
            it.weight *= 1.0 + part * of_weight;
            it.t = (it.t + part * of_place * range).clamp(first, last);
            // It would leave the range again.
            it.is_fixed |= it.t == first || it.t == last;
        }
    }
    None
}

/// The instance's moments less those of the weights.
fn missing(instance: &Instance<'_>, weights: &[Weight]) -> Vec<f64> {
    let mut missing: Vec<DoubleDouble> = instance.targets.iter().map(|&it| it.into()).collect();
    for it in weights {
        for (m, v) in missing.iter_mut().zip(instance.system().column(it.t)) {
            *m -= DoubleDouble::from(it.weight) * DoubleDouble::from(v);
        }
    }
    missing.into_iter().map(DoubleDouble::high).collect()
}

fn scaled(column: &[f64], by: f64) -> Vec<f64> {
    column.iter().map(|it| it * by).collect()
}

/// Of the basis functions, by a difference within the range.
fn derivative(system: &System, t: f64, range: f64) -> Vec<f64> {
    let (first, last) = system.ends();
    let (low, high) = (
        (t - DIFFERENCE * range).max(first),
        (t + DIFFERENCE * range).min(last),
    );
    let (before, after) = (system.column(low), system.column(high));
    let both = after.iter().zip(&before);
    both.map(|(a, b)| (a - b) / (high - low)).collect()
}

/// The least vector, in the sum of squares, whose combination of the columns is `wanted`.
fn least_step(columns: &[Vec<f64>], wanted: &[f64]) -> Option<Vec<f64>> {
    let size = wanted.len();
    let zero = DoubleDouble::from(0.0);
    // The columns' products with each other lose half of the digits: in twice as many, none that counts.
    let mut a = vec![vec![zero; size + 1]; size];
    for (i, row) in a.iter_mut().enumerate() {
        for (j, cell) in row.iter_mut().enumerate().take(size) {
            for column in columns {
                *cell += DoubleDouble::from(column[i]) * DoubleDouble::from(column[j]);
            }
        }
        row[size] = wanted[i].into();
    }
    let trace: f64 = (0..size).map(|i| a[i][i].high()).sum();
    for (i, row) in a.iter_mut().enumerate() {
        // With fewer unknowns than moments, or nearly so, the nearest.
        row[i] += DoubleDouble::from(trace * 1e-28);
    }
    for k in 0..size {
        let best =
            (k..size).max_by(|&i, &j| a[i][k].high().abs().total_cmp(&a[j][k].high().abs()))?;
        a.swap(k, best);
        let pivot = a[k].clone();
        if pivot[k].high() == 0.0 {
            return None;
        }
        for row in a.iter_mut().skip(k + 1) {
            let factor = row[k] / pivot[k];
            for (cell, of_pivot) in row.iter_mut().zip(&pivot).skip(k) {
                *cell -= factor * *of_pivot;
            }
        }
    }
    let mut x = vec![zero; size];
    for k in (0..size).rev() {
        let known = (k + 1..size).fold(a[k][size], |sum, j| sum - a[k][j] * x[j]);
        x[k] = known / a[k][k];
    }
    let step: Vec<f64> = columns
        .iter()
        .map(|column| {
            let terms = column.iter().zip(&x);
            terms
                .fold(zero, |sum, (&c, &x)| sum + DoubleDouble::from(c) * x)
                .high()
        })
        .collect();
    step.iter().all(|it| it.is_finite()).then_some(step)
}
