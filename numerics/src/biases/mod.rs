//! How much bias stored moments need.
//!
//! Moments that are stored in few bits need not be those of any distribution, and what a solver makes
//! of them then is anybody's guess. A bias moves them back. Here the least strength is searched that
//! leaves fewer than one invalid result in a million, for every number of moments and every format,
//! over regions as renderers meet them: one texel, few surfaces, tight surfaces one behind the other,
//! a surface that shadows itself, anything. Depths in [0, 1] lie at the ends as well, as clamped ones
//! do.
//!
//! What counts as invalid depends on the solver:
//! - Published solvers factorise the Hankel matrix (Toeplitz, for trigonometric moments), which must
//!   be positive definite: once stored, read back and biased, all in `f32`.
//! - Of a robust solver the result counts: a bound that is no number, or beyond the truth (a lower
//!   bound above the share that does lie below the query, an upper bound below the share that lies at
//!   the query or below) by more than [`TOLERANCE`] and the strength, which the bias itself may make
//!   of it.
//! - Four moments have the published code itself (`hankel-listing`), by the same measure.

mod format;
mod tables;

#[doc(hidden)]
pub use format::Region;
pub use format::{FORMATS, Format, Storage};

use std::sync::atomic::{AtomicU64, Ordering};

use hankel_moments::MAX_MOMENTS;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::families::draw::Source;

/// How far a bound may be beyond the truth: a fiftieth, the darkness that the lecture's shader takes
/// for full shadow.
pub const TOLERANCE: f64 = 0.02;

/// Invalid results among all, below which a strength suffices.
pub const SHARE: f64 = 1e-6;

/// Strengths on trial in each decade.
const PER_DECADE: i32 = 20;
/// From 10^-9...
const FIRST: i32 = -9 * PER_DECADE;
/// ...to 10^-0.5.
const LAST: i32 = -PER_DECADE / 2;

/// Fewer regions cannot tell.
pub const LEAST_SAMPLES: u64 = 1000;

/// Why nothing was measured.
#[derive(Debug, thiserror::Error)]
pub enum BiasError {
    /// Too few regions.
    #[error(
        "{0} regions are too few: give at least {LEAST_SAMPLES}; one in a million shows in 4000000"
    )]
    Samples(u64),
    /// No format of that name.
    #[error("there is no format `{given}`; there are: {}", known())]
    Format {
        /// What was asked for.
        given: String,
    },
}

fn known() -> String {
    let names: Vec<String> = FORMATS.iter().map(ToString::to_string).collect();
    names.join(", ")
}

/// What to measure.
#[derive(Clone, Debug)]
pub struct Options {
    /// Formats.
    pub formats: Vec<Format>,
    /// Regions for each strength on trial.
    pub samples: u64,
    /// Seed of the regions.
    pub seed: u64,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            formats: FORMATS.to_vec(),
            samples: 4_000_000,
            seed: 1,
        }
    }
}

/// What makes a result invalid.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Criterion {
    /// The matrix must be positive definite.
    Definite,
    /// The robust solver's bounds must contain the truth.
    Robust,
    /// The published code's bounds must contain the truth; four power moments.
    Listing,
}

/// The least strength for a format.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Found {
    /// The format.
    pub format: Format,
    /// What is mixed in, from its zeroth moment on.
    pub target: Vec<f64>,
    /// For solvers that need a positive definite matrix; `None` if no strength suffices.
    pub definite: Option<f64>,
    /// For the robust solver.
    pub robust: Option<f64>,
    /// For the published code for four moments; `None` also where there is none.
    pub listing: Option<f64>,
    /// Shares of invalid results without any bias, by [`Criterion::Definite`] and
    /// [`Criterion::Robust`].
    pub without: [f64; 2],
    /// The published strength for this format, if there is one.
    pub published: Option<f64>,
    /// Invalid results with it, by the same criteria.
    pub with_published: Option<[f64; 2]>,
}

/// Everything that was measured.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Biases {
    /// Regions for each strength on trial.
    pub samples: u64,
    /// Seed of the regions.
    pub seed: u64,
    /// The strengths.
    pub found: Vec<Found>,
}

/// Searches the least strengths.
///
/// # Errors
/// Too few regions.
pub fn measure(options: &Options, progress: &mut dyn FnMut(&str)) -> Result<Biases, BiasError> {
    if options.samples < LEAST_SAMPLES {
        return Err(BiasError::Samples(options.samples));
    }
    let mut biases = Biases {
        samples: options.samples,
        seed: options.seed,
        found: Vec::new(),
    };
    for &format in &options.formats {
        let target = format.target();
        let search = Search {
            format,
            target,
            samples: options.samples,
            seed: options.seed,
        };
        let mut least = |criterion| {
            progress(&format!("{format}, {criterion:?}"));
            search.least(criterion)
        };
        let definite = least(Criterion::Definite);
        let robust = least(Criterion::Robust);
        let listing = format
            .has_listing()
            .then(|| least(Criterion::Listing))
            .flatten();
        let published = format.published();
        let shares = |strength: f64| {
            [Criterion::Definite, Criterion::Robust].map(|c| search.share(c, strength))
        };
        biases.found.push(Found {
            format,
            target: target[..=format.count()].to_vec(),
            definite,
            robust,
            listing,
            without: shares(0.0),
            published,
            with_published: published.map(shares),
        });
    }
    Ok(biases)
}

/// Formats of these names; of none, all.
///
/// # Errors
/// [`BiasError::Format`], with the names that there are.
pub fn formats_named(names: &[String]) -> Result<Vec<Format>, BiasError> {
    if names.is_empty() {
        return Ok(FORMATS.to_vec());
    }
    names
        .iter()
        .map(|name| {
            FORMATS
                .iter()
                .find(|f| f.to_string() == *name)
                .copied()
                .ok_or_else(|| BiasError::Format {
                    given: name.clone(),
                })
        })
        .collect()
}

struct Search {
    format: Format,
    target: [f64; MAX_MOMENTS],
    samples: u64,
    seed: u64,
}

impl Search {
    fn region(&self, index: u64) -> Region {
        // The same regions for every number of bits.
        let name = self.format.without_bits();
        let mut source = Source::new(&name, self.format.count(), self.seed, index);
        Region::draw(self.format, &mut source)
    }

    fn is_invalid(&self, index: u64, criterion: Criterion, strength: f64) -> bool {
        let region = self.region(index);
        self.format
            .is_invalid(&region, criterion, &self.target, strength)
    }

    /// The share of invalid results.
    fn share(&self, criterion: Criterion, strength: f64) -> f64 {
        // A hundredth of the regions shows any share that is not tiny.
        let samples = self.samples.min(400_000);
        let invalid = (0..samples)
            .into_par_iter()
            .filter(|&index| self.is_invalid(index, criterion, strength))
            .count();
        invalid as f64 / samples as f64
    }

    /// Whether few enough results are invalid; gives up when there are too many.
    fn suffices(&self, criterion: Criterion, strength: f64) -> bool {
        let allowed = (SHARE * self.samples as f64).ceil() as u64;
        let invalid = AtomicU64::new(0);
        (0..self.samples)
            .into_par_iter()
            .try_for_each(|index| {
                if self.is_invalid(index, criterion, strength)
                    && invalid.fetch_add(1, Ordering::Relaxed) + 1 >= allowed
                {
                    None
                } else {
                    Some(())
                }
            })
            .is_some()
    }

    /// The least strength that suffices, by bisection; `None` if the largest on trial does not.
    fn least(&self, criterion: Criterion) -> Option<f64> {
        if self.suffices(criterion, 0.0) {
            return Some(0.0);
        }
        let (mut low, mut high) = (FIRST - 1, LAST);
        if !self.suffices(criterion, strength(high)) {
            return None;
        }
        while high - low > 1 {
            let middle = low.midpoint(high);
            if self.suffices(criterion, strength(middle)) {
                high = middle;
            } else {
                low = middle;
            }
        }
        Some(strength(high))
    }
}

/// The strengths on trial, ascending.
pub fn strengths() -> impl Iterator<Item = f64> {
    (FIRST..=LAST).map(strength)
}

/// Of a whole number of steps, with two digits rounded up.
fn strength(step: i32) -> f64 {
    let exact = 10.0_f64.powf(f64::from(step) / f64::from(PER_DECADE));
    let unit = 10.0_f64.powi(exact.log10().floor() as i32 - 1);
    // Powers of ten come out a rounding error above themselves.
    let digits = (exact / unit - 1e-9).ceil();
    // Decimal digits as text are the nearest number.
    let exponent = unit.log10().round();
    format!("{digits}e{exponent}").parse().unwrap_or(exact)
}
