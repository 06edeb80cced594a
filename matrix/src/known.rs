//! The list of known differences: which cells are known to fail, and why. An entry of whose cells
//! none fails any more fails the run, so that the list never rots.

use std::path::Path;

use hankel_system::input;
use serde::Deserialize;

use crate::column::Column;
use crate::report::{Outcome, Report};

/// Seed of the inputs that lists speak of: others may not meet a difference.
pub const SEED: u64 = 1;

/// Most bytes of a list.
const MAX_BYTES: u64 = 16 << 20;

/// The list.
#[derive(Clone, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Known {
    /// Its entries.
    #[serde(default)]
    pub difference: Vec<Difference>,
}

/// An entry.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Difference {
    /// The kernels: names, `*` for any letters.
    pub kernels: Vec<String>,
    /// The columns.
    pub columns: Vec<Column>,
    /// What differs.
    pub what: String,
    /// Why.
    pub why: String,
    /// The issue of whoever is to mend it, or the folder with its minimal case.
    pub upstream: Option<String>,
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
                ("kernels", entry.kernels.is_empty()),
                ("columns", entry.columns.is_empty()),
                ("what", entry.what.trim().is_empty()),
                ("why", entry.why.trim().is_empty()),
            ];
            if let Some((name, _)) = empty.iter().find(|(_, empty)| *empty) {
                return Err(format!("difference {}: `{name}` is empty", i + 1));
            }
        }
        Ok(known)
    }

    /// Marks the cells that the list explains. Complains, if the inputs are those of [`SEED`], of
    /// entries of whose cells that ran none differs any more, and, if `whole`, of those that fit none
    /// at all: then all kernels were run.
    pub fn apply(&self, report: &mut Report, whole: bool) {
        for entry in &self.difference {
            let fits = |kernel: &str| {
                entry
                    .kernels
                    .iter()
                    .any(|pattern| hankel_codegen::build::matches(pattern, kernel))
            };
            let (mut fitted, mut differing) = (0, 0);
            let mut passed = Vec::new();
            for row in report.kernels.iter_mut().filter(|r| fits(&r.kernel)) {
                for column in &entry.columns {
                    let Some(cell) = row.cells.get_mut(column) else {
                        continue;
                    };
                    fitted += 1;
                    match &cell.outcome {
                        Outcome::Passed => passed.push(format!("{} in {column}", row.kernel)),
                        outcome if outcome.fails() => {
                            differing += 1;
                            cell.outcome = Outcome::Known {
                                what: entry.what.clone(),
                                why: entry.why.clone(),
                                upstream: entry.upstream.clone(),
                                how: Box::new(outcome.clone()),
                            };
                        }
                        _ => {}
                    }
                }
            }
            let problem = match (differing, passed.is_empty()) {
                (0, false) if report.seed == SEED => {
                    format!("is none any more: {} passed", passed.join(", "))
                }
                (0, true) if whole && fitted == 0 => "fits no kernel".into(),
                _ => continue,
            };
            report.complaints.push(format!(
                "the known difference \"{}\" {problem}; take it off the list",
                entry.what
            ));
        }
    }
}
