//! The columns of the linear programme: the given functions in a coordinate and a basis that a
//! solver in `f64` can bear.
//!
//! A column holds the basis functions at a coordinate, of which the zeroth is 1 everywhere. The
//! moments are brought to the same basis, divided by the zeroth. Powers go to it in twice the
//! precision, since monomials of depths that are all positive differ in their last digits only.

use std::f64::consts::PI;

use super::functions::DepthFunction;
use super::{JudgeError, Range};
use crate::numbers::DoubleDouble;

/// The samples that the paper begins with.
pub const SAMPLES: u32 = 251;

/// How functions and range are brought to a basis.
#[derive(Clone, Debug)]
pub enum System {
    /// Successive powers on an interval: Chebyshev polynomials.
    Polynomial { count: usize, low: f64, high: f64 },
    /// Powers up to an even one on the line. With x = mean + deviation tan(t/2) the real line
    /// becomes a circle and a polynomial of degree 2n, divided by (1 + tan²)ⁿ, a trigonometric one
    /// of degree n: the point at infinity is like any other.
    Line { degree: usize },
    /// Any functions on an interval: orthonormal on the samples.
    General(Orthonormal),
}

/// Combinations of 1 and the functions that are orthonormal on the samples.
#[derive(Clone, Debug)]
pub struct Orthonormal {
    functions: Vec<DepthFunction>,
    low: f64,
    high: f64,
    /// Row k: the coefficients of the k-th combination.
    coefficients: Vec<Vec<f64>>,
}

/// A system with the moments of one distribution.
#[derive(Clone, Debug)]
pub struct Instance<'a> {
    system: &'a System,
    /// The moments in the basis; the zeroth is 1.
    pub targets: Vec<f64>,
    /// What rounding of the given moments to `f64` leaves uncertain of each.
    pub rounding: Vec<f64>,
    /// What weights that add up to 1 are to be multiplied by.
    pub total: f64,
    mean: f64,
    deviation: f64,
}

/// (a + b x)^i for x = 0..: coefficients of the expanded power.
fn expanded(a: DoubleDouble, b: DoubleDouble, power: usize) -> Vec<DoubleDouble> {
    let mut terms = vec![DoubleDouble::from(1.0)];
    for _ in 0..power {
        terms = times(&terms, a, b);
    }
    terms
}

/// A polynomial times (a + b x).
fn times(terms: &[DoubleDouble], a: DoubleDouble, b: DoubleDouble) -> Vec<DoubleDouble> {
    let mut product = vec![DoubleDouble::from(0.0); terms.len() + 1];
    for (k, &term) in terms.iter().enumerate() {
        product[k] += term * a;
        product[k + 1] += term * b;
    }
    product
}

fn dot(a: &[DoubleDouble], b: &[DoubleDouble]) -> DoubleDouble {
    a.iter()
        .zip(b)
        .fold(0.0.into(), |sum, (&a, &b)| sum + a * b)
}

/// Moments of (x - origin) / unit from those of x.
fn moved(moments: &[DoubleDouble], origin: DoubleDouble, unit: DoubleDouble) -> Vec<DoubleDouble> {
    let one = DoubleDouble::from(1.0);
    let mut scale = one;
    (0..moments.len())
        .map(|k| {
            let sum = dot(&expanded(-origin, one, k), moments);
            let moment = sum / scale;
            scale *= unit;
            moment
        })
        .collect()
}

/// Bounds of the errors of moments that [`moved`] gives from bounds of its arguments' errors.
fn moved_errors(errors: &[f64], origin: f64, unit: f64) -> Vec<f64> {
    let (one, distance) = (DoubleDouble::from(1.0), DoubleDouble::from(origin.abs()));
    (0..errors.len())
        .map(|k| {
            let sum: f64 = expanded(distance, one, k)
                .iter()
                .zip(errors)
                .map(|(c, e)| c.high() * e)
                .sum();
            sum / unit.abs().powi(k as i32)
        })
        .collect()
}

/// The same for a linear combination.
fn dot_error<'a>(coefficients: impl Iterator<Item = &'a f64>, errors: &[f64]) -> f64 {
    coefficients.zip(errors).map(|(c, e)| c.abs() * e).sum()
}

/// Whether the functions are z, z², and so on.
fn successive(functions: &[DepthFunction]) -> bool {
    functions
        .iter()
        .zip(1..)
        .all(|(&f, k)| f == DepthFunction::Power(k))
}

impl System {
    pub fn new(functions: &[DepthFunction], range: Range) -> Result<Self, JudgeError> {
        let count = functions.len();
        if !(1..=usize::from(DepthFunction::MAX_POWER)).contains(&count) {
            return Err(JudgeError::FunctionCount { count });
        }
        let Range::Interval { low, high } = range else {
            return if successive(functions) && count.is_multiple_of(2) {
                Ok(Self::Line { degree: count / 2 })
            } else {
                Err(JudgeError::Line)
            };
        };
        let width = high - low;
        if !(low.is_finite() && high.is_finite() && width.is_finite() && low < high) {
            return Err(JudgeError::Range { low, high });
        }
        if successive(functions) {
            return Ok(Self::Polynomial { count, low, high });
        }
        for &function in functions {
            // Where functions are defined is an interval, for each of them.
            for z in [low, high] {
                if !(function.is_defined(z) && function.eval(z).is_finite()) {
                    return Err(JudgeError::Domain { function, z });
                }
            }
        }
        Orthonormal::new(functions, low, high).map(Self::General)
    }

    /// The first and the last coordinate.
    pub fn ends(&self) -> (f64, f64) {
        match self {
            Self::Polynomial { .. } => (-1.0, 1.0),
            Self::Line { .. } => (-PI, PI),
            Self::General(g) => (g.low, g.high),
        }
    }

    /// The paper's uniform samples.
    pub fn samples(&self) -> Vec<f64> {
        let (first, last) = self.ends();
        let step = (last - first) / f64::from(SAMPLES - 1);
        (0..SAMPLES)
            .map(|i| {
                if i + 1 == SAMPLES {
                    last
                } else {
                    step.mul_add(f64::from(i), first)
                }
            })
            .collect()
    }

    /// The basis functions at a coordinate.
    pub fn column(&self, t: f64) -> Vec<f64> {
        match self {
            Self::Polynomial { count, .. } => {
                let mut column = vec![1.0, t];
                while column.len() <= *count {
                    let [.., a, b] = column[..] else { break };
                    column.push((2.0 * t).mul_add(b, -a));
                }
                column
            }
            Self::Line { degree } => {
                let mut column = vec![1.0];
                for j in 1..=*degree {
                    let (sin, cos) = (j as f64 * t).sin_cos();
                    column.extend([cos, sin]);
                }
                column
            }
            Self::General(g) => g.column(t),
        }
    }

    /// What weight in the programme is worth as a share of the distribution.
    pub fn worth(&self, t: f64) -> f64 {
        match self {
            Self::Line { degree } => (0.5 * t).cos().powi(2 * *degree as i32),
            _ => 1.0,
        }
    }

    /// The moments, of which the zeroth comes first and is positive, brought to the basis.
    pub fn instance(&self, moments: &[f64]) -> Result<Instance<'_>, JudgeError> {
        let mass = DoubleDouble::from(moments[0]);
        let shares: Vec<DoubleDouble> = moments
            .iter()
            .map(|&m| DoubleDouble::from(m) / mass)
            .collect();
        // Of each moment half a unit in the last place, and as much for the zeroth.
        let errors: Vec<f64> = shares
            .iter()
            .enumerate()
            .map(|(k, s)| {
                if k == 0 {
                    0.0
                } else {
                    f64::EPSILON * s.high().abs()
                }
            })
            .collect();
        let mut instance = Instance {
            system: self,
            targets: Vec::new(),
            rounding: Vec::new(),
            total: moments[0],
            mean: 0.0,
            deviation: 1.0,
        };
        match self {
            Self::Polynomial { count, low, high } => {
                let half = DoubleDouble::from(0.5);
                let middle = (DoubleDouble::from(*low) + DoubleDouble::from(*high)) * half;
                let reach = (DoubleDouble::from(*high) + DoubleDouble::from(-*low)) * half;
                let powers = moved(&shares, middle, reach);
                let zero = DoubleDouble::from(0.0);
                let two = DoubleDouble::from(2.0);
                let mut chebyshev = vec![vec![1.0.into()], vec![zero, 1.0.into()]];
                while chebyshev.len() <= *count {
                    let [.., a, b] = &chebyshev[..] else { break };
                    let mut next = times(b, zero, two);
                    for (x, &y) in next.iter_mut().zip(a) {
                        *x += -y;
                    }
                    chebyshev.push(next);
                }
                let errors = moved_errors(&errors, middle.high(), reach.high());
                for c in &chebyshev {
                    instance.targets.push(dot(c, &powers).high());
                    let c: Vec<f64> = c.iter().map(|c| c.high()).collect();
                    instance.rounding.push(dot_error(c.iter(), &errors));
                }
            }
            Self::Line { degree } => {
                let mean = shares[1].high();
                let central = moved(&shares, mean.into(), 1.0.into());
                let variance = central[2].high();
                // No unit in which rounding of a moment exceeds the distribution's own.
                let central_errors = moved_errors(&errors, mean, 1.0);
                let rounded = (2..).zip(&central_errors[2..]);
                let deviation = rounded
                    .map(|(k, e)| 2.0 * e.powf(1.0 / f64::from(k)))
                    .fold(variance.max(0.0).sqrt(), f64::max);
                // A single depth at 0 has none, and moments of no distribution have any.
                let is_possible = deviation > 0.0 && variance >= -central_errors[2];
                let deviation = if is_possible { deviation } else { 1.0 };
                let powers = moved(&shares, mean.into(), deviation.into());
                let errors = moved_errors(&errors, mean, deviation);
                // (1 + tan²)ⁿ exp(i j t) = (1 + i tan)ⁿ⁺ʲ (1 - i tan)ⁿ⁻ʲ
                let mut means: Vec<(DoubleDouble, f64)> = Vec::new();
                for j in 0..=*degree {
                    // Coefficients of the product without the powers of i, which are put back below.
                    let mut polynomial = vec![1.0_f64];
                    for factor in 0..2 * degree {
                        let sign = if factor < degree + j { 1.0 } else { -1.0 };
                        let mut next = polynomial.clone();
                        next.push(0.0);
                        for (k, c) in polynomial.iter().enumerate() {
                            next[k + 1] += sign * c;
                        }
                        polynomial = next;
                    }
                    // Every other coefficient is real, the rest imaginary; their signs alternate.
                    let part = |first: usize| {
                        let mut sum = DoubleDouble::from(0.0);
                        let mut error = 0.0;
                        for k in (first..polynomial.len()).step_by(2) {
                            let c = if (k / 2) % 2 == 0 {
                                polynomial[k]
                            } else {
                                -polynomial[k]
                            };
                            sum += powers[k] * DoubleDouble::from(c);
                            error += c.abs() * errors[k];
                        }
                        (sum, error)
                    };
                    means.push(part(0));
                    if j > 0 {
                        means.push(part(1));
                    }
                }
                let (total, total_error) = means[0];
                if total.high().is_nan() || total.high() <= 0.0 {
                    return Err(JudgeError::EvenMoment);
                }
                for (mean, error) in means {
                    let target = (mean / total).high();
                    instance.targets.push(target);
                    let error = error + target.abs() * total_error;
                    instance.rounding.push(error / total.high());
                }
                instance.total = total.high() * moments[0];
                instance.mean = mean;
                instance.deviation = deviation;
            }
            Self::General(g) => {
                for row in &g.coefficients {
                    let sum = row
                        .iter()
                        .zip(&shares)
                        .fold(DoubleDouble::from(0.0), |sum, (&c, &s)| sum + s * c.into());
                    instance.targets.push(sum.high());
                    instance.rounding.push(dot_error(row.iter(), &errors));
                }
            }
        }
        // The zeroth is 1 by definition.
        instance.rounding[0] = 0.0;
        for (rounding, target) in instance.rounding.iter_mut().zip(&instance.targets).skip(1) {
            *rounding += f64::EPSILON * target.abs();
        }
        if instance.targets.iter().all(|t| t.is_finite()) && instance.total.is_finite() {
            Ok(instance)
        } else {
            Err(JudgeError::Overflow)
        }
    }
}

impl Instance<'_> {
    /// The coordinate of a depth; one beyond the ends for depths outside of the range.
    pub fn coordinate(&self, z: f64) -> f64 {
        match self.system {
            System::Polynomial { low, high, .. } => {
                // The ends exactly, so that what lies at them is not below or above.
                if z == *high {
                    1.0
                } else if z == *low {
                    -1.0
                } else {
                    ((z - low) - (high - z)) / (high - low)
                }
            }
            System::Line { .. } => 2.0 * ((z - self.mean) / self.deviation).atan(),
            System::General(_) => z,
        }
    }

    /// The depth at a coordinate.
    pub fn depth(&self, t: f64) -> f64 {
        match self.system {
            System::Polynomial { low, high, .. } => 0.5 * ((1.0 - t) * low + (1.0 + t) * high),
            System::Line { .. } => self.deviation.mul_add((0.5 * t).tan(), self.mean),
            System::General(_) => t,
        }
    }

    pub const fn system(&self) -> &System {
        self.system
    }
}

impl Orthonormal {
    /// Gram-Schmidt, each function twice.
    fn new(functions: &[DepthFunction], low: f64, high: f64) -> Result<Self, JudgeError> {
        let mut new = Self {
            functions: functions.to_vec(),
            low,
            high,
            coefficients: Vec::new(),
        };
        let step = (high - low) / f64::from(SAMPLES - 1);
        let samples: Vec<f64> = (0..SAMPLES)
            .map(|i| step.mul_add(f64::from(i), low).min(high))
            .collect();
        let mean = |a: &[f64], b: &[f64]| -> f64 {
            let sum: f64 = a.iter().zip(b).map(|(a, b)| a * b).sum();
            sum / f64::from(SAMPLES)
        };
        let size = functions.len() + 1;
        let mut basis: Vec<Vec<f64>> = Vec::new();
        for k in 0..size {
            let mut values: Vec<f64> = samples.iter().map(|&z| new.raw(k, z)).collect();
            let mut row = vec![0.0; size];
            row[k] = 1.0;
            let before = mean(&values, &values).sqrt();
            for _ in 0..2 {
                for (other, coefficients) in basis.iter().zip(&new.coefficients) {
                    let share = mean(&values, other);
                    for (v, o) in values.iter_mut().zip(other) {
                        *v -= share * o;
                    }
                    for (r, c) in row.iter_mut().zip(coefficients) {
                        *r -= share * c;
                    }
                }
            }
            let after = mean(&values, &values).sqrt();
            if after.is_nan() || after <= DEPENDENT * before {
                return Err(JudgeError::Dependent {
                    function: functions[k - 1],
                });
            }
            for v in &mut values {
                *v /= after;
            }
            for r in &mut row {
                *r /= after;
            }
            basis.push(values);
            new.coefficients.push(row);
        }
        Ok(new)
    }

    fn raw(&self, k: usize, z: f64) -> f64 {
        match k.checked_sub(1) {
            None => 1.0,
            Some(k) => self.functions[k].eval(z),
        }
    }

    fn column(&self, z: f64) -> Vec<f64> {
        let raw: Vec<f64> = (0..self.coefficients.len())
            .map(|k| self.raw(k, z))
            .collect();
        self.coefficients
            .iter()
            .map(|row| row.iter().zip(&raw).map(|(c, v)| c * v).sum())
            .collect()
    }
}

/// A function that the ones before it give but for this relative rest is no new knowledge: its
/// moment's rounding would exceed what it adds.
const DEPENDENT: f64 = 1e-10;
