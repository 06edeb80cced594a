//! How accurate bounds, points and derivatives are by the measures of the 2025 paper (\[MBD\]):
//! [`table_1`] has those of its Table 1, [`singularities`] those of its Figure 6.

mod orthogonal;
pub mod singularities;
pub mod table_1;
mod tables;

pub use orthogonal::orthogonal_roots;

use hankel_moments::MAX;

use crate::families::Precision;
use crate::peer::PeerError;
use crate::stress::StressError;

/// Why nothing was measured.
#[derive(Debug, thiserror::Error)]
pub enum AccuracyError {
    /// An order that there are no bounds for.
    #[error("there is no bound of order {0}: give n from 1 to {most}", most = MAX)]
    Order(usize),
    /// Too few rows.
    #[error("{0} rows are too few: give at least {LEAST_SAMPLES}")]
    Samples(u64),
    /// The rows' family is gone.
    #[error("there is no family `{0}` of rows")]
    Family(&'static str),
    /// No such kernel.
    #[error("there is no kernel `{function}` in {precision}")]
    NoKernel {
        /// The function.
        function: String,
        /// The precision.
        precision: Precision,
    },
    /// A kernel that did not run.
    #[error(transparent)]
    Kernel(#[from] StressError),
    /// The process for the other implementation.
    #[error(transparent)]
    Peer(#[from] PeerError),
}

/// The fewest rows.
pub const LEAST_SAMPLES: u64 = 16;
