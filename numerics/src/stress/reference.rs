//! What the bounds should be.

use hankel_dsl::Real;
use hankel_moments::{Bounds, Canonical, Gradient, MAX_MOMENTS, bound, bound_adjoint, canonical};
use serde::{Deserialize, Serialize};

use super::gradient::{Gradients, gradients};
use crate::families::{Format, Row, Validity, scaled, validity};
use crate::judge::{DepthFunction, Judge, Range};
use crate::numbers::{DoubleDouble, Wide};

/// Below this share of digits that elimination leaves, double-double has too few of its own.
const NEEDS_WIDE: f64 = 1e-24;

/// The margin up to which the linear programme's judgement counts, as a share of the total.
const RESOLVED: f64 = 1e-3;

/// The share of digits that elimination must leave for that.
const RESOLVED_PIVOT: f64 = 1e-9;

/// Picks the instance for an order.
macro_rules! by_order {
    ($n:expr, $function:ident::<$R:ty>($($argument:expr),*)) => {
        match $n {
            1 => $function::<$R, 1>($($argument),*),
            2 => $function::<$R, 2>($($argument),*),
            3 => $function::<$R, 3>($($argument),*),
            4 => $function::<$R, 4>($($argument),*),
            5 => $function::<$R, 5>($($argument),*),
            _ => $function::<$R, 6>($($argument),*),
        }
    };
}

/// [`bound`] of an order.
#[inline(never)]
pub fn bounds_of<R: Real>(n: usize, m: [R; MAX_MOMENTS], eta: R) -> Bounds<R> {
    by_order!(n, bound::<R>(m, eta))
}

/// [`canonical`] of an order.
#[inline(never)]
pub fn canonical_of<R: Real>(n: usize, m: [R; MAX_MOMENTS], eta: R) -> Canonical<R> {
    by_order!(n, canonical::<R>(m, eta))
}

/// [`bound_adjoint`] of an order.
#[inline(never)]
pub fn gradient_of<R: Real>(
    n: usize,
    m: [R; MAX_MOMENTS],
    eta: R,
    overestimation: R,
) -> Gradient<R> {
    let one = R::literal::<{ 1.0_f64.to_bits() }>();
    by_order!(n, bound_adjoint::<R>(m, eta, overestimation, one))
}

/// The step of differences in 300 bits, for moments with a total near 1. What it leaves out is less than 1e-30 of a
/// derivative, unless pivots of the Hankel matrix are below 1e-33; what rounding does to a difference is 1e-42 of the
/// total.
pub(super) const STEP: f64 = 1.0 / (1_u128 << 80) as f64 / (1_u128 << 80) as f64;

/// A function of a row a step further in one direction, a step back, and twice the step: moments in their
/// order, then the query point.
pub(super) fn difference<F>(
    n: usize,
    m: [Wide; MAX_MOMENTS],
    eta: Wide,
    direction: usize,
    function: impl Fn([Wide; MAX_MOMENTS], Wide) -> F,
) -> (F, F, Wide) {
    let step = Wide::from(STEP);
    let at = |step: Wide| {
        let (mut m, mut eta) = (m, eta);
        match m.get_mut(direction) {
            Some(moment) if direction <= 2 * n => *moment += step,
            _ => eta += step,
        }
        function(m, eta)
    };
    (at(step), at(-step), step + step)
}

/// The derivatives of the lower bound in 300 bits, by central differences: one argument after the other, through
/// the bound's source alone.
#[must_use]
pub fn gradient_by_differences(
    n: usize,
    m: [DoubleDouble; MAX_MOMENTS],
    eta: DoubleDouble,
) -> Gradient<f64> {
    let (m, eta) = (m.map(Wide::from), Wide::from(eta));
    let directional = |direction: usize| {
        let lower = |m, eta| bounds_of(n, m, eta).lower;
        let (there, back, twice) = difference(n, m, eta, direction, lower);
        f64::from((there - back) / twice)
    };
    let mut gradient = Gradient {
        m: [0.0; MAX_MOMENTS],
        eta: directional(MAX_MOMENTS),
    };
    for k in 0..=2 * n {
        gradient.m[k] = directional(k);
    }
    gradient
}

/// A row's exact bounds, as shares of the total.
#[derive(Clone, Copy, Debug)]
pub struct Truth {
    /// Lower and upper.
    pub shares: [DoubleDouble; 2],
    /// What rounding each of the row's numbers and the result once does to them at most, to first
    /// order; 1 where that is more.
    pub sensitivities: [f64; 2],
    /// Binary exponent of the power of two that the moments were multiplied by.
    exponent: i32,
    mass: f64,
}

impl Truth {
    /// How far a computed bound is from it, as a share of the total: the larger error of the two.
    /// What is not a number is wrong by 1.
    #[must_use]
    pub fn error(&self, bounds: [f64; 2]) -> f64 {
        let [lower, upper] = self.errors(bounds);
        lower.max(upper)
    }

    /// The error over the sensitivity: the larger quotient of both bounds.
    #[must_use]
    pub fn over_sensitivity(&self, bounds: [f64; 2]) -> f64 {
        let errors = self.errors(bounds);
        (errors[0] / self.sensitivities[0]).max(errors[1] / self.sensitivities[1])
    }

    fn errors(&self, bounds: [f64; 2]) -> [f64; 2] {
        let mut errors = [1.0; 2];
        for ((error, bound), share) in errors.iter_mut().zip(bounds).zip(self.shares) {
            let e = self.exponent;
            let scaled = bound * 2.0_f64.powi(-e / 2) * 2.0_f64.powi(-e + e / 2);
            let distance = DoubleDouble::from(scaled) / DoubleDouble::from(self.mass) - share;
            let distance = f64::from(distance).abs();
            if distance.is_finite() {
                *error = distance;
            }
        }
        errors
    }
}

/// What is known of a row.
#[derive(Clone, Copy, Debug)]
pub struct Judgement {
    /// Whether its moments are those of a distribution that is not degenerate.
    pub validity: Validity,
    /// Its bounds, if they are, and within the range that [`bound`] is documented for.
    pub truth: Option<Truth>,
}

/// Judges a row by its own numbers.
#[must_use]
pub fn judgement<T: Format>(n: usize, row: &Row<T>) -> Judgement {
    let nothing = Judgement {
        validity: Validity::Not,
        truth: None,
    };
    let given = row.map(T::widen);
    let Some((row, exponent)) = scaled(&given) else {
        return nothing;
    };
    let validity = validity(n, &row);
    let Validity::Definite(left) = validity else {
        return Judgement {
            validity,
            ..nothing
        };
    };
    if !is_in_range(n, &given) {
        return Judgement {
            validity,
            truth: None,
        };
    }
    let rounding = Rounding::new::<T>(exponent);
    let mass = row.m[0];
    let (shares, sensitivities) = if left < NEEDS_WIDE {
        let m = wide_moments(n, &row);
        let (exact, _) = gradients(&m, Wide::from(row.eta), None);
        let in_f64 = exact
            .each_ref()
            .map(|gradient| gradient.iter().copied().map(f64::from).collect());
        (shares_of(&exact, &m), rounding.sensitivities(&row, &in_f64))
    } else {
        let mass = DoubleDouble::from(mass);
        let m = row.m.map(DoubleDouble::from);
        let bounds = bounds_of(n, m, DoubleDouble::from(row.eta));
        (
            [bounds.lower / mass, bounds.upper / mass],
            rounding.sensitivities(&row, &gradients_by_library(n, &row)),
        )
    };
    Judgement {
        validity,
        truth: Some(Truth {
            shares,
            sensitivities,
            exponent,
            mass,
        }),
    }
}

/// Whether a valid row is within the range that [`bound`] is documented for.
pub(super) fn is_in_range(n: usize, row: &Row<f64>) -> bool {
    let mass = row.m[0];
    let moments_are = row.m[..=2 * n]
        .iter()
        .all(|m| m.abs() <= (1e25 * mass).min(1e37));
    let square_is = (1e-25 * mass..=1e9 * mass).contains(&row.m[2]);
    moments_are && square_is && row.eta.abs() <= 1e9
}

/// What rounding once does to a number, of which the moments were multiplied by a power of two.
pub(super) struct Rounding {
    /// Half a unit in the last place of 1.
    half: f64,
    /// Half of the smallest number.
    least: f64,
    exponent: i32,
}

impl Rounding {
    /// That of a format.
    pub fn new<T: Format>(exponent: i32) -> Self {
        Self {
            half: 0.5 * T::epsilon().widen(),
            least: 0.5 * T::LEAST_NORMAL * T::epsilon().widen(),
            exponent,
        }
    }

    /// From 1 to the next number.
    pub fn epsilon(&self) -> f64 {
        2.0 * self.half
    }

    /// The largest rounding error of a scaled moment, and of whatever else has its unit.
    pub fn of_moment(&self, m: f64) -> f64 {
        self.of(m, -self.exponent)
    }

    /// The largest rounding error of a number near `x` that was multiplied by 2 to that power.
    pub fn of(&self, x: f64, exponent: i32) -> f64 {
        let least = self.least * 2.0_f64.powi(exponent / 2) * 2.0_f64.powi(exponent - exponent / 2);
        let of_nothing = if x == 0.0 { 0.0 } else { least };
        (self.half * x.abs()).max(of_nothing)
    }

    /// Of both bounds, as shares of the total: a rounding of the result, which is the total at most,
    /// and what a rounding of each number is worth by the bounds' gradients.
    fn sensitivities(&self, row: &Row<f64>, gradients: &[Vec<f64>; 2]) -> [f64; 2] {
        gradients.each_ref().map(|gradient| {
            let last = gradient.len() - 1;
            let of_query = gradient[last].abs() * self.of(row.eta, 0);
            let of_moments = (0..last).map(|k| gradient[k].abs() * self.of_moment(row.m[k]));
            let sum: f64 = of_moments.chain([of_query]).sum();
            ((self.of_moment(row.m[0]) + sum) / row.m[0]).min(1.0)
        })
    }
}

/// Gradients of the lower and of the upper bound, to the moments and then to the query point, in twice the digits of
/// `f64`; derivatives above 1e100 are limited.
fn gradients_by_library(n: usize, row: &Row<f64>) -> [Vec<f64>; 2] {
    let m = row.m.map(DoubleDouble::from);
    [0.0, 1.0].map(|overestimation| {
        let eta = DoubleDouble::from(row.eta);
        let gradient = gradient_of(n, m, eta, DoubleDouble::from(overestimation));
        let of_moments = gradient.m[..=2 * n].iter().copied().map(f64::from);
        of_moments.chain([f64::from(gradient.eta)]).collect()
    })
}

/// Both bounds as shares of the total, in 300 bits and by another way than the library's.
fn shares_wide(n: usize, row: &Row<f64>) -> [DoubleDouble; 2] {
    let m = wide_moments(n, row);
    let (exact, _) = gradients(&m, Wide::from(row.eta), None);
    shares_of(&exact, &m)
}

/// Both bounds as shares of the total: they are the integrals of the polynomials whose coefficients their gradients are.
fn shares_of(gradients: &Gradients, m: &[Wide]) -> [DoubleDouble; 2] {
    gradients.each_ref().map(|gradient| {
        let products = gradient.iter().zip(m).map(|(d, m)| *d * *m);
        let bound = products.fold(Wide::from(0.0), |sum, product| sum + product);
        DoubleDouble::from(bound / m[0])
    })
}

/// Moments up to the highest of an order, in 300 bits.
pub(super) fn wide_moments(n: usize, row: &Row<f64>) -> Vec<Wide> {
    row.m[..=2 * n].iter().copied().map(Wide::from).collect()
}

/// How well the reference agrees with another algorithm in 300 bits, and with the linear programme.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Agreement {
    /// Rows compared with 300 bits.
    pub wide_rows: u64,
    /// The largest difference, as a share of the total.
    pub wide_difference: f64,
    /// Rows that differ by more than a sixteenth of the measured precision's rounding error.
    pub wide_beyond: u64,
    /// Rows compared with the linear programme.
    pub programme_rows: u64,
    /// The largest difference.
    pub programme_difference: f64,
    /// Rows that differ by more than the programme's own margin.
    pub programme_beyond: u64,
    /// Rows that the programme cannot judge: its arithmetic is `f64`, too little for a nearly singular
    /// matrix, or its margin is above 1e-3 of the total.
    pub programme_unresolved: u64,
}

impl Agreement {
    /// Both together.
    pub fn add(&mut self, other: Self) {
        self.wide_rows += other.wide_rows;
        self.wide_difference = self.wide_difference.max(other.wide_difference);
        self.wide_beyond += other.wide_beyond;
        self.programme_rows += other.programme_rows;
        self.programme_difference = self.programme_difference.max(other.programme_difference);
        self.programme_beyond += other.programme_beyond;
        self.programme_unresolved += other.programme_unresolved;
    }

    /// Compares a row's reference with 300 bits.
    pub fn check_wide<T: Format>(&mut self, n: usize, row: &Row<T>, truth: &Truth) {
        let Some((row, _)) = scaled(&row.map(T::widen)) else {
            return;
        };
        let difference = shares_wide(n, &row)
            .iter()
            .zip(truth.shares)
            .map(|(&a, b)| f64::from(a - b).abs())
            .fold(0.0, f64::max);
        self.wide_rows += 1;
        self.wide_difference = self.wide_difference.max(difference);
        // The first comparison fails for what is no number.
        let within = difference <= T::epsilon().widen() / 16.0;
        self.wide_beyond += u64::from(!within);
    }

    /// Compares a row's reference with the linear programme.
    pub fn check_programme<T: Format>(&mut self, n: usize, row: &Row<T>, truth: &Truth) {
        let Some((row, _)) = scaled(&row.map(T::widen)) else {
            return;
        };
        // Where rounding decides about the moments, the programme has others.
        if !matches!(validity(n, &row), Validity::Definite(left) if left >= RESOLVED_PIVOT) {
            self.programme_unresolved += 1;
            return;
        }
        let judge = DepthFunction::powers(2 * n).and_then(|f| Judge::new(&f, Range::Line));
        let judged = judge.and_then(|judge| judge.bounds(&row.m[..=2 * n], row.eta));
        let judged = match judged {
            Ok(judged) if judged.margin <= RESOLVED * row.m[0] => judged,
            _ => {
                self.programme_unresolved += 1;
                return;
            }
        };
        let difference = [judged.lower, judged.upper]
            .iter()
            .zip(truth.shares)
            .map(|(&a, b)| (a / row.m[0] - f64::from(b)).abs())
            .fold(0.0, f64::max);
        self.programme_rows += 1;
        self.programme_difference = self.programme_difference.max(difference);
        let within = difference <= judged.margin / row.m[0];
        self.programme_beyond += u64::from(!within);
    }
}
