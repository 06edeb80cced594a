//! Inputs to measure bounds with: what a renderer meets, what papers measure with, and what
//! nobody should send.
//!
//! A [`Family`] makes row after row from a seed, the same on every machine and with any number of
//! threads. Points and weights are drawn in `f64`, their moments summed in double-double and
//! rounded once to the precision that is measured, so that both precisions see the same rows.
//! Where a renderer would compute with what it stores (quantisation, filtering), so does the
//! family, in that precision.
//!
//! Rounding alone can take moments out of the set that distributions have; [`validity`] says of
//! each rounded row whether it did.

pub(crate) mod draw;
mod make;
mod precision;
mod validity;

pub use precision::{Format, Precision};
#[doc(hidden)]
pub use validity::last_place;
pub use validity::{Validity, pivots, scaled, validity};

use std::fmt;
use std::ops::RangeInclusive;

use hankel_moments::{MAX, MAX_MOMENTS};

use draw::Source;

/// Numbers of moments beyond the zeroth, halved, that there are bounds for.
pub const ORDERS: RangeInclusive<usize> = 1..=MAX;

/// Moments and a query point.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Row<T> {
    /// The moments m_0 to m_2n; what follows is 0.
    pub m: [T; MAX_MOMENTS],
    /// Where the bound is asked for.
    pub eta: T,
}

impl<T: Copy> Row<T> {
    /// The same row in another type.
    pub fn map<U>(&self, mut f: impl FnMut(T) -> U) -> Row<U> {
        Row {
            m: self.m.map(&mut f),
            eta: f(self.eta),
        }
    }

    /// What a kernel of order `n` reads: m_0 to m_2n and the query point.
    pub fn columns(&self, n: usize) -> impl Iterator<Item = T> + '_ {
        self.m[..=2 * n].iter().copied().chain([self.eta])
    }
}

/// A kind of rows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Family {
    /// Its name on the command line and in tables.
    pub name: &'static str,
    /// What its rows are.
    pub summary: &'static str,
    kind: Kind,
}

/// Where depths lie.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Depths {
    /// \[0, 1\]
    Unit,
    /// \[-1, 1\]
    Symmetric,
}

impl Depths {
    /// The nearest and the farthest.
    pub(crate) const fn ends(self) -> (f64, f64) {
        match self {
            Self::Unit => (0.0, 1.0),
            Self::Symmetric => (-1.0, 1.0),
        }
    }
}

/// What is done to moments between the distribution and the solver.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Kind {
    /// Normal points, weights in \[0, 1\]; so many points for each order, and one or none more.
    Paper { per_order: usize },
    /// Any points in a range.
    Generic { depths: Depths, free_mass: bool },
    /// Two surfaces, each tight.
    Silhouettes { biased: bool },
    /// One surface, and a query within.
    Own { biased: bool },
    /// At most n points.
    Degenerate { biased: bool },
    /// One point.
    OneTexel { biased: bool },
    /// One point, filtered in the precision that is measured.
    AllEqual { biased: bool },
    /// Points at the ends of \[0, 1\].
    Ends,
    /// Stored in few bits.
    Quantised { depths: Depths, bits: u32 },
    /// A total weight below the smallest normal number.
    Denormal,
    /// A total weight of 10 to this power.
    Mass { exponent: i32 },
    /// Other units of weight and of length.
    Units,
    /// A few points far from all others, and light.
    HeavyTail,
    /// No distribution's moments.
    Impossible,
    /// NaN or infinity somewhere.
    NotFinite,
}

const fn family(name: &'static str, summary: &'static str, kind: Kind) -> Family {
    Family {
        name,
        summary,
        kind,
    }
}

/// Every family.
pub const FAMILIES: &[Family] = &[
    family(
        "paper",
        "2n+1 standard normal points, weights and queries as the 2025 paper's package draws them",
        Kind::Paper { per_order: 2 },
    ),
    family(
        "paper-fewest",
        "the same with n+1 points, the fewest that give a positive definite Hankel matrix",
        Kind::Paper { per_order: 1 },
    ),
    family(
        "generic-symmetric",
        "n+1 to 6n depths anywhere in [-1, 1], m_0 = 1",
        Kind::Generic {
            depths: Depths::Symmetric,
            free_mass: false,
        },
    ),
    family(
        "generic-unit",
        "n+1 to 6n depths anywhere in [0, 1], m_0 = 1",
        Kind::Generic {
            depths: Depths::Unit,
            free_mass: false,
        },
    ),
    family(
        "generic-mass",
        "n+1 to 6n depths anywhere in [-1, 1], m_0 from 1e-3 to 1e3",
        Kind::Generic {
            depths: Depths::Symmetric,
            free_mass: true,
        },
    ),
    family(
        "silhouettes",
        "two surfaces in [-1, 1] of spread 1e-4 to 1e-2, query near, in or between; no bias",
        Kind::Silhouettes { biased: false },
    ),
    family(
        "silhouettes-biased",
        "the same with the bias recommended for 32-bit floats",
        Kind::Silhouettes { biased: true },
    ),
    family(
        "self",
        "a query within its own surface of spread 1e-3 to 3e-2; no bias",
        Kind::Own { biased: false },
    ),
    family(
        "self-biased",
        "the same with the bias recommended for 32-bit floats",
        Kind::Own { biased: true },
    ),
    family(
        "quantised-16-unit",
        "depths in [0, 1], optimised quantisation to 16 bits, recommended bias (n = 2, 3)",
        Kind::Quantised {
            depths: Depths::Unit,
            bits: 16,
        },
    ),
    family(
        "quantised-16-symmetric",
        "depths in [-1, 1], optimised quantisation to 16 bits, recommended bias (n = 2, 3)",
        Kind::Quantised {
            depths: Depths::Symmetric,
            bits: 16,
        },
    ),
    family(
        "quantised-10-unit",
        "depths in [0, 1], optimised quantisation to 10 bits, recommended bias (n = 2, 3)",
        Kind::Quantised {
            depths: Depths::Unit,
            bits: 10,
        },
    ),
    family(
        "quantised-10-symmetric",
        "depths in [-1, 1], optimised quantisation to 10 bits, recommended bias (n = 2, 3)",
        Kind::Quantised {
            depths: Depths::Symmetric,
            bits: 10,
        },
    ),
    family(
        "degenerate",
        "at most n depths in [-1, 1], query anywhere or at one of them; no bias",
        Kind::Degenerate { biased: false },
    ),
    family(
        "degenerate-biased",
        "the same with the bias recommended for 32-bit floats",
        Kind::Degenerate { biased: true },
    ),
    family(
        "one-texel",
        "a single depth, query at it, near it or anywhere; no bias",
        Kind::OneTexel { biased: false },
    ),
    family(
        "one-texel-biased",
        "the same with the bias recommended for 32-bit floats",
        Kind::OneTexel { biased: true },
    ),
    family(
        "all-equal",
        "many texels of one depth, stored and filtered in the precision measured; no bias",
        Kind::AllEqual { biased: false },
    ),
    family(
        "all-equal-biased",
        "the same with the bias recommended for 32-bit floats, mixed in that precision",
        Kind::AllEqual { biased: true },
    ),
    family(
        "ends",
        "depths at 0, at 1 and between, query at 0, at 1, next to them or between",
        Kind::Ends,
    ),
    family(
        "denormal",
        "generic depths with a total weight below the smallest normal number",
        Kind::Denormal,
    ),
    family(
        "mass-1e-30",
        "generic depths with m_0 = 1e-30",
        Kind::Mass { exponent: -30 },
    ),
    family(
        "mass-1e30",
        "generic depths with m_0 = 1e30",
        Kind::Mass { exponent: 30 },
    ),
    family(
        "units",
        "generic depths in other units: of weight 1e-6 to 1e6, of length 1e-8 to 1e8, less for more moments",
        Kind::Units,
    ),
    family(
        "heavy-tail",
        "normal points, and 1 to 3 more that are 3 to 100 times as far and have 1e-6 to 1e-2 of the weight",
        Kind::HeavyTail,
    ),
    family(
        "impossible",
        "moments that no distribution has, of every size",
        Kind::Impossible,
    ),
    family(
        "not-finite",
        "NaN or infinity in one or more of the moments, or in the query",
        Kind::NotFinite,
    ),
];

impl fmt::Display for Family {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name)
    }
}

impl Family {
    /// The family of a name.
    #[must_use]
    pub fn named(name: &str) -> Option<&'static Self> {
        FAMILIES.iter().find(|f| f.name == name)
    }

    /// Whether there are rows of an order: optimised quantisation is published for n = 2 and 3.
    #[must_use]
    pub fn has(&self, n: usize) -> bool {
        match self.kind {
            Kind::Quantised { .. } => (2..=3).contains(&n),
            _ => ORDERS.contains(&n),
        }
    }

    /// Row number `index` of order `n`, which must be one that the family [has](Self::has).
    #[must_use]
    pub fn row<T: Format>(&self, n: usize, seed: u64, index: u64) -> Row<T> {
        let mut source = Source::new(self.name, n, seed, index);
        make::row(self.kind, n, &mut source)
    }
}
