//! Why a source has no form in the libraries, and where.

use std::fmt;

use proc_macro2::Span;

/// A construct that is outside of the subset, with its place.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Refusal {
    /// File, line and column from 1.
    pub place: String,
    /// What it is, and what to write instead.
    pub reason: String,
}

impl Refusal {
    /// At a place of a file.
    pub fn at(file: &str, span: Span, reason: impl Into<String>) -> Self {
        let start = span.start();
        Self {
            place: format!("{file}:{}:{}", start.line, start.column + 1),
            reason: reason.into(),
        }
    }
}

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.place, self.reason)
    }
}

impl std::error::Error for Refusal {}
