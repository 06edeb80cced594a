//! The strengths as a report.

use super::{Biases, SHARE, TOLERANCE};
use crate::report::{Cell, Column, Report, Table};

impl Biases {
    /// The table; `command` is what made it.
    #[must_use]
    pub fn report(&self, command: &str) -> Report {
        let mut report = Report::new("How much bias stored moments need", command);
        report.fact("regions for each strength on trial", self.samples);
        report.fact("seed", self.seed);
        let mut table = Table::new(
            "biases",
            format!(
                "The least strength that leaves fewer than {SHARE:e} invalid results: a matrix that \
                 is not positive definite (definite); a bound that is no number or beyond the truth \
                 by more than {TOLERANCE} and the strength (robust: this project's solvers; listing: \
                 the published code). Beside it the published strength, and shares of invalid \
                 results without a bias and with the published one"
            ),
            [
                Column::text("format"),
                Column::text("target"),
                Column::number("definite"),
                Column::number("robust"),
                Column::number("listing"),
                Column::number("published"),
                Column::number("no bias: not definite"),
                Column::number("beyond"),
                Column::number("published: not definite"),
                Column::number("beyond"),
            ],
        );
        for f in &self.found {
            let target: Vec<String> = f.target[1..]
                .iter()
                .map(|t| format!("{}", (t * 1e4).round() / 1e4))
                .collect();
            // A strength that was searched for and not found is no gap in the table.
            let searched = |strength: Option<f64>| -> Cell {
                strength.map_or_else(|| "none".into(), Into::into)
            };
            table.push([
                f.format.to_string().into(),
                target.join(" ").into(),
                searched(f.definite),
                searched(f.robust),
                if f.format.has_listing() {
                    searched(f.listing)
                } else {
                    Cell::Empty
                },
                f.published.into(),
                f.without[0].into(),
                f.without[1].into(),
                f.with_published.map(|s| s[0]).into(),
                f.with_published.map(|s| s[1]).into(),
            ]);
        }
        if (self.samples as f64) < 4.0 / SHARE {
            report.notes.push(format!(
                "{} regions are too few to see {SHARE:e} in: strengths come out too small",
                self.samples
            ));
        }
        report.tables.push(table);
        report
    }
}
