//! Shadows of four numbers under stress: bounds by two complex trigonometric moments, and by four power moments with
//! depths known to be in a range. The measure is that of the bounds: error over sensitivity.

use std::fmt;

use bytemuck::cast_slice;
use hankel_dsl::Real;
use hankel_dsl::native::Mode;
use hankel_moments::bias::{Basis, MEASURED};
use hankel_moments::{
    HalfAngle, MAX_MOMENTS, Moments4, TrigonometricMoments, hausdorff_4, hausdorff_4_compensated,
    hausdorff_4_symmetric, hausdorff_4_symmetric_compensated, trigonometric_4,
    trigonometric_4_compensated,
};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::circle;
use super::reference::{Rounding, STEP};
use super::{LEAST_SAMPLES, StressError};
use crate::families::draw::{Point, Source};
use crate::families::{Depths, Format, Precision};
use crate::numbers::{DoubleDouble, Wide};
use crate::report::{Column, Report, Table};
use crate::speed::{Quantiles, native};

/// A function of four moments and a depth that gives a lower and an upper bound of the share below that depth. Where
/// it has no upper one, that is 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Bound {
    /// `trigonometric_4`.
    Trigonometric,
    /// `hausdorff_4`: depths in \[0, 1\].
    HausdorffUnit,
    /// `hausdorff_4_symmetric`: depths in \[-1, 1\].
    HausdorffSymmetric,
}

/// Every bound.
pub const BOUNDS: [Bound; 3] = [
    Bound::Trigonometric,
    Bound::HausdorffUnit,
    Bound::HausdorffSymmetric,
];

impl Bound {
    /// The name in tables.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Trigonometric => "trigonometric",
            Self::HausdorffUnit => "hausdorff",
            Self::HausdorffSymmetric => "hausdorff-symmetric",
        }
    }

    /// The kernel function of the plain form, if there is one; that of the other one ends in `_compensated`.
    const fn kernel(self) -> Option<&'static str> {
        match self {
            Self::Trigonometric => Some("trigonometric_4msm"),
            Self::HausdorffUnit => Some("hausdorff_4msm"),
            Self::HausdorffSymmetric => None,
        }
    }

    const fn basis(self) -> Basis {
        match self {
            Self::Trigonometric => Basis::Trigonometric,
            Self::HausdorffUnit => Basis::Unit,
            Self::HausdorffSymmetric => Basis::Symmetric,
        }
    }

    /// Four moments of a depth from 0 to 1, and the depth in the moments' range.
    fn of_depth(self, z: DoubleDouble) -> ([DoubleDouble; 4], DoubleDouble) {
        let (one, two) = (DoubleDouble::from(1.0), DoubleDouble::from(2.0));
        let powers = |z: DoubleDouble| [z, z * z, z * z * z, z * z * z * z];
        match self {
            Self::Trigonometric => {
                let half = circle::half_angle(z, DoubleDouble::from(circle::pi()));
                let double = |(x, y)| ((x - y) * (x + y), two * x * y);
                let (x, y) = double(half);
                let (x2, y2) = double((x, y));
                ([x, y, x2, y2], z)
            }
            Self::HausdorffUnit => (powers(z), z),
            Self::HausdorffSymmetric => (powers(two * z - one), two * z - one),
        }
    }

    /// Whether a distribution that is not degenerate has these moments, and the depth is in range.
    fn is_valid(self, [a, b, c, d, z]: [f64; 5]) -> bool {
        let [a, b, c, d] = [a, b, c, d].map(Wide::from);
        let (zero, one, half) = (Wide::from(0.0), Wide::from(1.0), Wide::from(0.5));
        let is_definite = |x: Wide, mixed: Wide, y: Wide| x > zero && x * y > mixed * mixed;
        match self {
            Self::Trigonometric => is_definite(
                (one + c) * half - a * a,
                d * half - a * b,
                (one - c) * half - b * b,
            ),
            Self::HausdorffUnit => {
                (0.0..=1.0).contains(&z)
                    && is_definite(b - a * a, c - a * b, d - b * b)
                    && is_definite(a - b, b - c, c - d)
            }
            Self::HausdorffSymmetric => {
                (-1.0..=1.0).contains(&z)
                    && is_definite(b - a * a, c - a * b, d - b * b)
                    && is_definite(one - b, a - c, b - d)
            }
        }
    }

    fn exact(self, row: [Wide; 5]) -> [Wide; 2] {
        let [a, b, c, d, z] = row;
        let one = Wide::from(1.0);
        match self {
            Self::Trigonometric => circle::bounds([a, b, c, d], z),
            Self::HausdorffUnit => [hausdorff_4(powers(row), z), one],
            Self::HausdorffSymmetric => [hausdorff_4_symmetric(powers(row), z), one],
        }
    }

    fn computed<T: Format>(self, solver: Form, row: [T; 5]) -> [T; 2] {
        let [c1, s1, c2, s2, z] = row;
        let one = T::round(1.0);
        match (self, solver) {
            (Self::Trigonometric, form) => {
                let m = TrigonometricMoments { c1, s1, c2, s2 };
                let bounds = match form {
                    Form::Plain => trigonometric_4(m, HalfAngle::of_depth(z)),
                    Form::Compensated => trigonometric_4_compensated(m, z),
                };
                [bounds.lower, bounds.upper]
            }
            (Self::HausdorffUnit, Form::Plain) => [hausdorff_4(powers(row), z), one],
            (Self::HausdorffUnit, Form::Compensated) => {
                [hausdorff_4_compensated(powers(row), z), one]
            }
            (Self::HausdorffSymmetric, Form::Plain) => [hausdorff_4_symmetric(powers(row), z), one],
            (Self::HausdorffSymmetric, Form::Compensated) => {
                [hausdorff_4_symmetric_compensated(powers(row), z), one]
            }
        }
    }
}

fn powers<R: Real>([b1, b2, b3, b4, _]: [R; 5]) -> Moments4<R> {
    Moments4 { b1, b2, b3, b4 }
}

/// In which arithmetic.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Form {
    /// In the number format.
    Plain,
    /// In about twice its digits where that counts.
    Compensated,
}

impl fmt::Display for Form {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Plain => "plain",
            Self::Compensated => "compensated",
        })
    }
}

/// What the distributions of a family are.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Kind {
    Generic,
    Silhouettes,
    Own,
    Degenerate,
    OneTexel,
    Ends,
    Any,
}

/// A kind of rows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Distributions {
    /// Its name in tables.
    pub name: &'static str,
    /// What its rows are.
    pub summary: &'static str,
    kind: Kind,
    /// Bits of a stored moment whose least measured bias is mixed in; `None` for no bias.
    bits: Option<u32>,
}

const fn family(
    name: &'static str,
    summary: &'static str,
    kind: Kind,
    bits: Option<u32>,
) -> Distributions {
    Distributions {
        name,
        summary,
        kind,
        bits,
    }
}

/// Every family.
pub const DISTRIBUTIONS: [Distributions; 13] = [
    family("generic", "3 to 12 depths anywhere", Kind::Generic, None),
    family(
        "silhouettes",
        "two surfaces, each 5e-5 to 5e-3 of the range thick, query near, in or between",
        Kind::Silhouettes,
        None,
    ),
    family(
        "silhouettes-biased",
        "the same with the least bias for 32-bit floats",
        Kind::Silhouettes,
        Some(32),
    ),
    family(
        "self",
        "a query within its own surface, 5e-4 to 1.5e-2 of the range thick",
        Kind::Own,
        None,
    ),
    family(
        "self-biased",
        "the same with the least bias for 32-bit floats",
        Kind::Own,
        Some(32),
    ),
    family(
        "degenerate",
        "one or two depths, query at one, near it or anywhere",
        Kind::Degenerate,
        None,
    ),
    family(
        "degenerate-biased",
        "the same with the least bias for 32-bit floats",
        Kind::Degenerate,
        Some(32),
    ),
    family(
        "one-texel",
        "one depth, query at it, near it or anywhere",
        Kind::OneTexel,
        None,
    ),
    family(
        "one-texel-biased",
        "the same with the least bias for 32-bit floats",
        Kind::OneTexel,
        Some(32),
    ),
    family(
        "ends",
        "depths at both ends of the range and between, query at an end, next to one or anywhere",
        Kind::Ends,
        None,
    ),
    family(
        "ends-biased",
        "the same with the least bias for 32-bit floats",
        Kind::Ends,
        Some(32),
    ),
    family(
        "quantised-16",
        "generic, silhouettes or self, stored in 16 bits as they are, with the least bias for that",
        Kind::Any,
        Some(16),
    ),
    family("quantised-10", "the same in 10 bits", Kind::Any, Some(10)),
];

impl Distributions {
    /// Moments of row number `index` and the query depth.
    #[must_use]
    pub fn row<T: Format>(&self, bound: Bound, seed: u64, index: u64) -> [T; 5] {
        let s = &mut Source::new(self.name, 2, seed, index);
        let (points, query) = self.distribution(s);
        let inside = |z: f64| DoubleDouble::from(z.clamp(0.0, 1.0));
        let mut total = DoubleDouble::from(0.0);
        let mut exact = [total; 4];
        for p in points {
            let weight = DoubleDouble::from(p.weight);
            total += weight;
            let (moments, _) = bound.of_depth(inside(p.depth));
            for (sum, moment) in exact.iter_mut().zip(moments) {
                *sum += weight * moment;
            }
        }
        let z = T::round_exact(bound.of_depth(inside(query)).1);
        let exact = exact.map(|m| m / total);
        let bias = |bits: u32| {
            let fits = |b: &&hankel_moments::bias::Measured| {
                (b.bias.basis, b.bias.count, b.bias.bits) == (bound.basis(), 4, bits)
                    && b.in_range == (bound != Bound::Trigonometric)
            };
            MEASURED.iter().find(fits).map(|b| b.bias)
        };
        let [a, b, c, d] = match self.bits.map(|bits| (bits, bias(bits))) {
            Some((32, Some(bias))) => mix(exact, bias.target, bias.strength).map(T::round_exact),
            Some((bits, Some(bias))) => {
                // Written to a normalised integer, read and biased in the format.
                let read = exact.map(|m| T::round(quantised(f64::from(m), bits)));
                let strength = T::round(bias.strength);
                let mut k = 0;
                read.map(|m| {
                    k += 1;
                    m.lerp(T::round(bias.target[k]), strength)
                })
            }
            _ => exact.map(T::round_exact),
        };
        [a, b, c, d, z]
    }

    fn distribution(&self, s: &mut Source) -> (Vec<Point>, f64) {
        let generic = |s: &mut Source| {
            let count = s.count(3, 12);
            (s.scattered(Depths::Unit, count), s.unit())
        };
        match self.kind {
            Kind::Generic => generic(s),
            Kind::Silhouettes => s.silhouettes(Depths::Unit, 2),
            Kind::Own => s.own_surface(Depths::Unit, 2),
            Kind::Degenerate | Kind::OneTexel => {
                let most = if self.kind == Kind::OneTexel { 1 } else { 2 };
                let count = s.count(1, most);
                let points = s.scattered(Depths::Unit, count);
                let at = s.pick(&points).depth;
                let query = match s.count(0, 3) {
                    0 => at,
                    1 => at + s.sign() * s.magnitude(-7.0, -2.0),
                    2 => at + s.sign() * s.magnitude(-2.0, 0.0),
                    _ => s.unit(),
                };
                (points, query)
            }
            Kind::Ends => {
                let mut points: Vec<Point> = [0.0, 1.0]
                    .iter()
                    .map(|&depth| Point {
                        depth,
                        weight: s.unit(),
                    })
                    .collect();
                let between = s.count(0, 4);
                points.extend(s.scattered(Depths::Unit, between));
                let query = match s.count(0, 3) {
                    0 => 0.0,
                    1 => 1.0,
                    2 => (s.pick(&[0.0, 1.0]) - s.magnitude(-7.0, -2.0)).abs(),
                    _ => s.unit(),
                };
                (points, query)
            }
            Kind::Any => match s.count(0, 2) {
                0 => generic(s),
                1 => s.silhouettes(Depths::Unit, 2),
                _ => s.own_surface(Depths::Unit, 2),
            },
        }
    }
}

fn mix(exact: [DoubleDouble; 4], target: [f64; MAX_MOMENTS], strength: f64) -> [DoubleDouble; 4] {
    let mut mixed = exact;
    for (m, target) in mixed.iter_mut().zip(&target[1..]) {
        *m += DoubleDouble::from(strength) * (DoubleDouble::from(*target) - *m);
    }
    mixed
}

/// A number from -1 to 1, stored in so many bits.
fn quantised(x: f64, bits: u32) -> f64 {
    let steps = (2.0_f64.powi(bits as i32) - 1.0) / 2.0;
    ((x + 1.0) * steps).round() / steps - 1.0
}

/// A row's exact bounds, and what rounding each of the row's numbers and the result once does to them.
#[derive(Clone, Copy, Debug)]
pub struct Truth {
    exact: [Wide; 2],
    /// To first order; 1 where that is more.
    sensitivities: [f64; 2],
}

impl Truth {
    /// Of a row; `None` if no distribution has such moments, or only a degenerate one.
    #[must_use]
    pub fn of<T: Format>(bound: Bound, row: [T; 5]) -> Option<Self> {
        let row = row.map(T::widen);
        if !bound.is_valid(row) {
            return None;
        }
        let rounding = Rounding::new::<T>(0);
        let wide = row.map(Wide::from);
        let mut sensitivities = [rounding.of(1.0, 0); 2];
        let step = Wide::from(STEP);
        for (k, number) in row.iter().enumerate() {
            let at = |step: Wide| {
                let mut moved = wide;
                moved[k] += step;
                bound.exact(moved)
            };
            let (there, back) = (at(step), at(-step));
            for ((sensitivity, there), back) in sensitivities.iter_mut().zip(there).zip(back) {
                let slope = f64::from((there - back) / (step + step)).abs();
                let moved = slope * rounding.of(*number, 0);
                // Nothing is known of a derivative that is no number: it is not counted.
                *sensitivity += if moved.is_nan() { 0.0 } else { moved };
            }
        }
        Some(Self {
            exact: bound.exact(wide),
            sensitivities: sensitivities.map(|s| s.min(1.0)),
        })
    }

    /// The error over the sensitivity: the larger quotient of both bounds; infinite for what is not a number.
    #[must_use]
    pub fn over_sensitivity<T: Format>(&self, computed: [T; 2]) -> f64 {
        let mut greatest = 0.0_f64;
        for ((exact, sensitivity), computed) in
            self.exact.iter().zip(self.sensitivities).zip(computed)
        {
            let error = f64::from(Wide::from(computed.widen()) - *exact).abs();
            let over = error / sensitivity;
            greatest = greatest.max(if over.is_nan() { f64::INFINITY } else { over });
        }
        greatest
    }
}

/// What to measure.
#[derive(Clone, Debug)]
pub struct Options {
    /// Number formats.
    pub precisions: Vec<Precision>,
    /// Rows of each family, bound and precision.
    pub samples: u64,
    /// Seed of the rows.
    pub seed: u64,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            precisions: vec![Precision::F32, Precision::F64],
            samples: 1000,
            seed: 1,
        }
    }
}

/// What came out for the rows of one family.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Line {
    /// The family's name.
    pub family: String,
    /// The bound.
    pub bound: Bound,
    /// The number format.
    pub precision: Precision,
    /// The arithmetic.
    pub form: Form,
    /// Rows with moments of a distribution that is not degenerate.
    pub valid: u64,
    /// All rows with a bound that is not from 0 to 1, or no number, or an upper bound below the lower one.
    pub out_of_range: u64,
    /// Errors over sensitivities of the valid rows.
    pub over: Option<Quantiles>,
    /// The number of the row with the greatest one.
    pub worst: Option<u64>,
}

/// Everything that was measured.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Shadows {
    /// Rows of each family, bound and precision.
    pub samples: u64,
    /// Seed.
    pub seed: u64,
    /// The figures.
    pub lines: Vec<Line>,
    /// What compensation costs.
    pub costs: Vec<Cost>,
}

/// What compensation costs a kernel.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Cost {
    /// The plain kernel function.
    pub kernel: String,
    /// The number format.
    pub precision: Precision,
    /// Nanoseconds of processor time for a row, plain and compensated, one row at a time: medians of rounds.
    pub nanoseconds: [f64; 2],
}

/// Measures.
///
/// # Errors
/// [`StressError::Samples`], and [`StressError::Kernel`] if a kernel cannot be timed.
pub fn measure(options: &Options, progress: &mut dyn FnMut(&str)) -> Result<Shadows, StressError> {
    if options.samples < LEAST_SAMPLES {
        return Err(StressError::Samples(options.samples));
    }
    let mut found = Shadows {
        samples: options.samples,
        seed: options.seed,
        lines: Vec::new(),
        costs: Vec::new(),
    };
    for precision in &options.precisions {
        progress(&format!("run time, {precision}"));
        for bound in BOUNDS {
            found.costs.extend(match precision {
                Precision::F32 => cost::<f32>(bound, options)?,
                Precision::F64 => cost::<f64>(bound, options)?,
            });
        }
    }
    for bound in BOUNDS {
        for family in &DISTRIBUTIONS {
            for precision in &options.precisions {
                progress(&format!("{}, {}, {precision}", bound.name(), family.name));
                found.lines.extend(match precision {
                    Precision::F32 => of_family::<f32>(bound, family, options),
                    Precision::F64 => of_family::<f64>(bound, family, options),
                });
            }
        }
    }
    Ok(found)
}

const FORMS: [Form; 2] = [Form::Plain, Form::Compensated];

fn of_family<T: Format>(bound: Bound, family: &Distributions, options: &Options) -> Vec<Line> {
    let rows: Vec<(u64, Option<[f64; 2]>, [bool; 2])> = (0..options.samples)
        .into_par_iter()
        .map(|index| {
            let row = family.row::<T>(bound, options.seed, index);
            let computed = FORMS.map(|form| bound.computed(form, row));
            let truth = Truth::of(bound, row);
            let over = truth.map(|truth| computed.map(|c| truth.over_sensitivity(c)));
            (index, over, computed.map(is_in_range))
        })
        .collect();
    let line = |(k, form): (usize, Form)| {
        let over: Vec<(u64, f64)> = rows
            .iter()
            .filter_map(|(index, over, _)| Some((*index, (*over)?[k])))
            .collect();
        Line {
            family: family.name.into(),
            bound,
            precision: T::PRECISION,
            form,
            valid: over.len() as u64,
            out_of_range: rows.iter().filter(|row| !row.2[k]).count() as u64,
            worst: over
                .iter()
                .max_by(|a, b| a.1.total_cmp(&b.1))
                .map(|worst| worst.0),
            over: (!over.is_empty()).then(|| Quantiles::of(over.iter().map(|o| o.1).collect())),
        }
    };
    FORMS.into_iter().enumerate().map(line).collect()
}

/// Rows that are timed at a time, and how often.
const TIMED_ROWS: u64 = 4096;
const ROUNDS: usize = 9;

fn cost<T: Format>(bound: Bound, options: &Options) -> Result<Option<Cost>, StressError> {
    let Some(kernel) = bound.kernel() else {
        return Ok(None);
    };
    let rows: Vec<T> = (0..TIMED_ROWS)
        .flat_map(|index| DISTRIBUTIONS[0].row::<T>(bound, options.seed, index))
        .collect();
    let fail = |function: &str, problem: &dyn fmt::Display| StressError::Kernel {
        kernel: function.into(),
        problem: problem.to_string(),
    };
    let names = [kernel.to_owned(), format!("{kernel}_compensated")];
    let mut kernels = Vec::new();
    for name in &names {
        let rows = (TIMED_ROWS as usize, cast_slice(&rows));
        let native = native::Native::from_bytes(name, T::PRECISION, rows.0, rows.1);
        kernels.push(native.map_err(|e| fail(name, &e))?);
    }
    let mut seconds = [Vec::new(), Vec::new()];
    for _ in 0..ROUNDS {
        for ((kernel, name), seconds) in kernels.iter_mut().zip(&names).zip(&mut seconds) {
            seconds.push(kernel.time(Mode::REFERENCE).map_err(|e| fail(name, &e))?);
        }
    }
    let median = |mut seconds: Vec<f64>| {
        seconds.sort_by(f64::total_cmp);
        seconds[ROUNDS / 2] * 1e9 / TIMED_ROWS as f64
    };
    Ok(Some(Cost {
        kernel: kernel.into(),
        precision: T::PRECISION,
        nanoseconds: seconds.map(median),
    }))
}

fn is_in_range<T: Format>([lower, upper]: [T; 2]) -> bool {
    let (zero, one) = (T::round(0.0), T::round(1.0));
    zero <= lower && lower <= upper && upper <= one
}

impl Shadows {
    /// Whether every result was a number from 0 to 1.
    #[must_use]
    pub fn passed(&self) -> bool {
        self.lines.iter().all(|line| line.out_of_range == 0)
    }

    /// A table for each bound; `command` is what made it.
    #[must_use]
    pub fn report(&self, command: &str) -> Report {
        let mut report = Report::new("Shadows of four numbers under stress", command);
        report.fact("rows of each family, bound and precision", self.samples);
        report.fact("seed", self.seed);
        for bound in BOUNDS {
            report.tables.push(self.table(bound));
        }
        report.tables.push(self.cost());
        let mut families = Table::new(
            "shadow-families",
            "Families",
            [Column::text("family"), Column::text("rows")],
        );
        for family in &DISTRIBUTIONS {
            families.push([family.name.into(), family.summary.into()]);
        }
        report.tables.push(families);
        report
    }

    fn cost(&self) -> Table {
        let mut table = Table::new(
            "shadow-costs",
            "Run time of the native kernels on one thread, row by row, on the generic family",
            [
                Column::text("kernel"),
                Column::text("precision"),
                Column::fixed("plain", 0).of("ns"),
                Column::fixed("compensated", 0).of("ns"),
                Column::fixed("times", 2),
            ],
        );
        for cost in &self.costs {
            let [plain, compensated] = cost.nanoseconds;
            table.push([
                cost.kernel.as_str().into(),
                cost.precision.to_string().into(),
                plain.into(),
                compensated.into(),
                (compensated / plain).into(),
            ]);
        }
        table
    }

    fn table(&self, bound: Bound) -> Table {
        let mut table = Table::new(
            format!("over-{}", bound.name()),
            format!(
                "Error over sensitivity of the {} bound: of 90 % of the valid rows at most, and the \
                 greatest. The sensitivity is what rounding each number of the row and the result \
                 once does to the answer",
                bound.name()
            ),
            [
                Column::text("family"),
                Column::text("precision"),
                Column::count("valid"),
                Column::number("plain, 90 %"),
                Column::number("greatest"),
                Column::number("compensated, 90 %"),
                Column::number("greatest"),
            ],
        );
        let plain = |line: &&Line| line.bound == bound && line.form == Form::Plain;
        for line in self.lines.iter().filter(plain) {
            let is_other = |other: &&Line| {
                other.form == Form::Compensated
                    && (&other.family, other.bound, other.precision)
                        == (&line.family, line.bound, line.precision)
            };
            let other = self.lines.iter().find(is_other).and_then(|l| l.over);
            table.push([
                line.family.as_str().into(),
                line.precision.to_string().into(),
                line.valid.into(),
                line.over.map(|o| o.ninety).into(),
                line.over.map(|o| o.greatest).into(),
                other.map(|o| o.ninety).into(),
                other.map(|o| o.greatest).into(),
            ]);
        }
        table
    }

    /// The greatest quotient of a form of a bound, over all families and precisions.
    #[must_use]
    pub fn greatest(&self, bound: Bound, form: Form) -> f64 {
        let lines = self.lines.iter();
        let of_both = lines.filter(|l| (l.bound, l.form) == (bound, form));
        of_both
            .filter_map(|l| l.over)
            .map(|o| o.greatest)
            .fold(0.0, f64::max)
    }
}
