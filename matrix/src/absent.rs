//! The table of cells that do not run although everything is installed: what a language cannot
//! express, and what a device lacks. A kernel that slips out of a column does not fail there; the
//! table says that it did.

use std::collections::{BTreeMap, BTreeSet};

use serde::{Deserialize, Serialize};

use crate::column::Column;
use crate::report::{Outcome, Report};

/// The table: kernels by column, and by whether the device lacks something or the language cannot
/// express them.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Absent {
    /// What devices lack a feature for.
    #[serde(default)]
    pub lacks: BTreeMap<Column, BTreeSet<String>>,
    /// What languages cannot express.
    #[serde(default)]
    pub inexpressible: BTreeMap<Column, BTreeSet<String>>,
}

impl Absent {
    /// Reads a table from its text.
    ///
    /// # Errors
    /// In words: the place, and what is wrong.
    pub fn parse(text: &str) -> Result<Self, String> {
        toml::from_str(text).map_err(|e| e.to_string())
    }

    /// The table of a report.
    #[must_use]
    pub fn of(report: &Report) -> Self {
        let mut table = Self::default();
        for row in &report.kernels {
            for (column, cell) in &row.cells {
                let part = match &cell.outcome {
                    Outcome::Lacking { .. } => &mut table.lacks,
                    Outcome::Inexpressible { .. } => &mut table.inexpressible,
                    _ => continue,
                };
                part.entry(*column).or_default().insert(row.kernel.clone());
            }
        }
        table
    }

    /// The text of the table.
    #[must_use]
    pub fn text(&self) -> String {
        let mut text = String::from(
            "# Cells of `hankel parity --matrix` that do not run although all tools are there; `hankel\n\
             # parity --matrix --write-absent FILE` writes this table. A run with all kernels in all\n\
             # columns fails if it finds another.\n",
        );
        for (name, part) in [
            ("lacks", &self.lacks),
            ("inexpressible", &self.inexpressible),
        ] {
            text += &format!("\n[{name}]\n");
            for (column, kernels) in part {
                text += &format!("{column} = [\n");
                for kernel in kernels {
                    text += &format!("    {kernel:?},\n");
                }
                text += "]\n";
            }
        }
        text
    }

    /// How a report differs from the table, a line for each cell; cells whose tools are not
    /// installed say nothing.
    #[must_use]
    pub fn differences(&self, report: &Report) -> Vec<String> {
        let mut all = Vec::new();
        for row in &report.kernels {
            for (column, cell) in &row.cells {
                let listed = |part: &BTreeMap<Column, BTreeSet<String>>| {
                    part.get(column).is_some_and(|k| k.contains(&row.kernel))
                };
                let wanted = match (listed(&self.lacks), listed(&self.inexpressible)) {
                    (true, _) => "lacks",
                    (_, true) => "-",
                    _ => "runs",
                };
                let found = match &cell.outcome {
                    Outcome::NotInstalled { .. } | Outcome::NoReference { .. } => continue,
                    Outcome::Lacking { .. } => "lacks",
                    Outcome::Inexpressible { .. } => "-",
                    _ => "runs",
                };
                if wanted != found {
                    all.push(format!(
                        "{} in {column}: `{found}`, by the table `{wanted}`",
                        row.kernel
                    ));
                }
            }
        }
        all
    }
}
