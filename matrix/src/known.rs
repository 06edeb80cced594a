//! The list of known differences: which cells are known to fail, how and by how much, and why. A
//! cell that fails otherwise than the list says fails the run, and so does one that fails no more, so
//! that the list never rots.

use std::path::Path;

use hankel_system::input;
use serde::Deserialize;

use crate::column::Column;
use crate::report::{Cell, Outcome, Report};

/// Seed of the inputs that lists speak of: others may not meet a difference, or a greater one.
pub const SEED: u64 = 1;

/// Most bytes of a list.
const MAX_BYTES: u64 = 16 << 20;

/// The list.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Known {
    /// Its entries.
    #[serde(default)]
    pub difference: Vec<Difference>,
}

/// An entry: cells that fail for one reason.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Difference {
    /// What differs.
    pub what: String,
    /// Why.
    pub why: String,
    /// The issue of whoever is to mend it, or the folder with its minimal case.
    pub upstream: Option<String>,
    /// The cells.
    pub cells: Vec<KnownCell>,
}

/// A cell that is known to fail.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct KnownCell {
    /// The kernel's row.
    pub kernel: String,
    /// The column.
    pub column: Column,
    /// How it fails: the word of [`Outcome::word`].
    pub outcome: String,
    /// `FAIL`: how many numbers are beyond what is allowed.
    pub numbers: Option<u64>,
    /// `FAIL`: the largest difference, to two digits; none if it is infinite.
    pub absolute: Option<f64>,
    /// Any other: words that the compiler's or driver's message has.
    pub says: Option<String>,
}

impl KnownCell {
    /// Why a cell is not what is known; none if it is.
    fn mismatch(&self, cell: &Cell, sized: bool) -> Option<String> {
        let word = cell.outcome.word();
        if word != self.outcome {
            return Some(format!("`{word}`, not `{}`", self.outcome));
        }
        if let Outcome::Foreign { failure } = &cell.outcome {
            let said = failure.to_string();
            let wanted = self.says.as_deref().unwrap_or_default();
            return (!said.contains(wanted)).then(|| format!("other words than `{wanted}`"));
        }
        let found = cell.found.as_ref().filter(|_| sized)?;
        if Some(found.beyond) != self.numbers {
            return Some(format!(
                "{} numbers, not {}",
                found.beyond,
                self.numbers.unwrap_or(0)
            ));
        }
        let same = match (found.largest_absolute, self.absolute) {
            (Some(a), Some(b)) => (a - b).abs() <= 0.05 * b,
            (a, b) => a.is_none() && b.is_none(),
        };
        (!same).then(|| {
            let number = |x: Option<f64>| x.map_or("inf".into(), |x| format!("{x:.1e}"));
            format!(
                "a largest difference of {}, not {}",
                number(found.largest_absolute),
                number(self.absolute)
            )
        })
    }
}

impl Known {
    /// Reads a list.
    ///
    /// # Errors
    /// In words: the file, the place, and what is wrong.
    pub fn read(file: &Path) -> Result<Self, String> {
        let text = input::read_text(file, MAX_BYTES).map_err(|e| e.to_string())?;
        Self::parse(&text).map_err(|e| format!("{}: {e}", file.display()))
    }

    /// Reads a list from its text.
    ///
    /// # Errors
    /// In words: the place, and what is wrong.
    pub fn parse(text: &str) -> Result<Self, String> {
        let known: Self = toml::from_str(text).map_err(|e| e.to_string())?;
        for (i, entry) in known.difference.iter().enumerate() {
            let empty = [
                ("cells", entry.cells.is_empty()),
                ("what", entry.what.trim().is_empty()),
                ("why", entry.why.trim().is_empty()),
            ];
            if let Some((name, _)) = empty.iter().find(|(_, empty)| *empty) {
                return Err(format!("difference {}: `{name}` is empty", i + 1));
            }
            for cell in &entry.cells {
                let problem = match cell.outcome.as_str() {
                    "FAIL" if cell.numbers.is_none() => "needs `numbers` and `absolute`",
                    "FAIL" => continue,
                    "REFUSED" | "CRASHED" if cell.says.is_none() => "needs `says`",
                    "REFUSED" | "CRASHED" | "TIMEOUT" => continue,
                    _ => "is none of FAIL, REFUSED, CRASHED, TIMEOUT",
                };
                return Err(format!(
                    "difference {}, {} in {}: the outcome `{}` {problem}",
                    i + 1,
                    cell.kernel,
                    cell.column,
                    cell.outcome
                ));
            }
        }
        Ok(known)
    }

    /// Marks the cells that the list explains. Complains of cells that fail otherwise than it says;
    /// if the inputs are those of [`SEED`], of cells that do not fail any more; and, if `whole`, of
    /// those that there are not: then all kernels were run.
    pub fn apply(&self, report: &mut Report, whole: bool) {
        let sized = report.seed == SEED;
        for entry in &self.difference {
            for known in &entry.cells {
                let place = format!("{} in {}", known.kernel, known.column);
                let cell = report
                    .kernels
                    .iter_mut()
                    .find(|row| row.kernel == known.kernel)
                    .and_then(|row| row.cells.get_mut(&known.column));
                let problem = match cell {
                    None if whole => "there is no such cell; take it off the list".to_owned(),
                    Some(cell) if cell.outcome == Outcome::Passed && sized => {
                        "it passed; take it off the list".to_owned()
                    }
                    Some(cell) if cell.outcome.fails() => match known.mismatch(cell, sized) {
                        Some(other) => format!("it fails otherwise: {other}"),
                        None => {
                            cell.outcome = Outcome::Known {
                                what: entry.what.clone(),
                                why: entry.why.clone(),
                                upstream: entry.upstream.clone(),
                                how: Box::new(cell.outcome.clone()),
                            };
                            continue;
                        }
                    },
                    _ => continue,
                };
                report.complaints.push(format!(
                    "the known difference \"{}\" of {place}: {problem}",
                    entry.what
                ));
            }
        }
    }
}
