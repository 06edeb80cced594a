//! What the matrix found.

use std::collections::BTreeMap;

use hankel_host::parity::numbers::{Found, Rules};
use serde::{Deserialize, Serialize};

use crate::column::Column;
use crate::process::Failure;
use crate::tools::Status;

/// The whole matrix.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Report {
    /// Version of Hankel.
    pub hankel: String,
    /// Seed of the inputs.
    pub seed: u64,
    /// The columns.
    pub columns: Vec<ColumnReport>,
    /// The compilers, drivers and browsers.
    pub tools: Vec<Status>,
    /// The kernels, in the crate's order.
    pub kernels: Vec<Row>,
    /// Entries of the list of known differences that do not hold any more, and columns that were
    /// required and did not run.
    pub complaints: Vec<String>,
    /// How long it took, in seconds.
    pub seconds: f64,
    /// Cells that were taken from the cache.
    pub cached: usize,
    /// Whether no cell failed and there are no complaints.
    pub passed: bool,
}

/// A column.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ColumnReport {
    /// Which.
    pub column: Column,
    /// How its kernels are run.
    pub how: String,
    /// The device that ran them, in its own words; none if nothing had to be run.
    pub device: Option<String>,
}

/// A kernel.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Row {
    /// Its name.
    pub kernel: String,
    /// `compute`, `vertex` or `fragment`.
    pub stage: String,
    /// Invocations with inputs of all classes.
    pub invocations: u64,
    /// Values of the reference that are not finite, though every input is.
    pub non_finite: u64,
    /// Its cells.
    pub cells: BTreeMap<Column, Cell>,
}

/// A kernel on one way.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Cell {
    /// How it ended.
    pub outcome: Outcome,
    /// What it may differ by.
    pub rules: Option<Rules>,
    /// What it differs by, where it ran.
    pub found: Option<Found>,
    /// The line of the generated text that it is about, where that can be told.
    pub line: Option<Line>,
    /// How long it took, in seconds.
    pub seconds: f64,
}

/// A line of generated text.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Line {
    /// Its number, from 1.
    pub number: usize,
    /// What stands there.
    pub text: String,
}

/// How a cell ended.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", tag = "kind")]
pub enum Outcome {
    /// All numbers are within what is allowed.
    Passed,
    /// Some are not.
    Differs,
    /// Finite inputs give natively what is not finite, and the kernel does not say so:
    /// `parity(non_finite, why = "…")`.
    NotFinite {
        /// How many numbers.
        count: u64,
    },
    /// There is nothing to compare with: the native scalar run failed, or there are no inputs.
    NoReference {
        /// Why, and with which input.
        problem: String,
    },
    /// A compiler or driver refused it, crashed, or gave no answer.
    Foreign {
        /// How.
        failure: Failure,
    },
    /// It differs, is refused or crashes, as the list of known differences says.
    Known {
        /// What differs.
        what: String,
        /// Why.
        why: String,
        /// The issue of whoever is to mend it.
        upstream: Option<String>,
        /// How it ended.
        how: Box<Outcome>,
    },
    /// The language cannot express it.
    Inexpressible {
        /// Why.
        reason: String,
    },
    /// The device that is there lacks a feature that the kernel needs.
    Lacking {
        /// Which.
        what: String,
    },
    /// Something that it takes is not installed.
    NotInstalled {
        /// What.
        what: String,
        /// The command that installs it.
        install: String,
    },
}

impl Outcome {
    /// One word, as tables have it.
    #[must_use]
    pub const fn word(&self) -> &'static str {
        match self {
            Self::Passed => "pass",
            Self::Differs => "FAIL",
            Self::NotFinite { .. } => "INFINITE",
            Self::NoReference { .. } => "NATIVE",
            Self::Foreign { failure } => match failure {
                Failure::Refused { .. } => "REFUSED",
                Failure::Crashed { .. } => "CRASHED",
                Failure::TimedOut { .. } => "TIMEOUT",
                Failure::Lacks { .. } => "lacks",
            },
            Self::Lacking { .. } => "lacks",
            Self::Known { .. } => "known",
            Self::Inexpressible { .. } => "-",
            Self::NotInstalled { .. } => "missing",
        }
    }

    /// Whether it fails a run.
    #[must_use]
    pub const fn fails(&self) -> bool {
        matches!(
            self,
            Self::Differs
                | Self::NotFinite { .. }
                | Self::NoReference { .. }
                | Self::Foreign { .. }
        )
    }
}

impl Cell {
    /// A cell that was not run.
    #[must_use]
    pub const fn unrun(outcome: Outcome) -> Self {
        Self {
            outcome,
            rules: None,
            found: None,
            line: None,
            seconds: 0.0,
        }
    }
}
