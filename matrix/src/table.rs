//! The report as a table for people.

use std::fmt;

use comfy_table::{Table, presets};

use crate::process::Failure;
use crate::report::{Cell, Outcome, Report};

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for column in &self.columns {
            writeln!(
                f,
                "{}: {}{}",
                column.column,
                column.how,
                column
                    .device
                    .as_ref()
                    .map_or_else(String::new, |d| format!(" ({d})"))
            )?;
        }
        for tool in self.tools.iter().filter(|t| t.is_there()) {
            writeln!(
                f,
                "{}: {}",
                tool.name,
                tool.version.as_deref().unwrap_or("")
            )?;
        }
        let mut table = Table::new();
        table.load_preset(presets::ASCII_MARKDOWN);
        let mut head = vec!["kernel".to_owned()];
        head.extend(self.columns.iter().map(|c| c.column.to_string()));
        table.set_header(head);
        for row in &self.kernels {
            let mut line = vec![row.kernel.clone()];
            line.extend(
                self.columns
                    .iter()
                    .map(|c| row.cells.get(&c.column).map_or_else(String::new, brief)),
            );
            table.add_row(line);
        }
        writeln!(f, "{table}")?;
        for row in &self.kernels {
            for (column, cell) in &row.cells {
                details(f, &format!("{}, {column}", row.kernel), cell)?;
            }
        }
        for complaint in &self.complaints {
            writeln!(f, "{complaint}")?;
        }
        let failed = self
            .kernels
            .iter()
            .flat_map(|r| r.cells.values())
            .filter(|c| c.outcome.fails())
            .count();
        writeln!(
            f,
            "{} kernels in {} columns: {} failed, {} of them from the cache, {:.1} s",
            self.kernels.len(),
            self.columns.len(),
            failed,
            self.cached,
            self.seconds
        )
    }
}

/// A cell in a few characters.
pub(crate) fn brief(cell: &Cell) -> String {
    match (&cell.outcome, &cell.found) {
        (Outcome::Passed, Some(found)) if found.largest_ulp == 0 => "same".into(),
        (Outcome::Passed, Some(found)) => match found.largest_absolute {
            Some(x) => format!("{x:.1e}"),
            None => "inf".into(),
        },
        (outcome, _) => outcome.word().into(),
    }
}

fn details(f: &mut fmt::Formatter<'_>, name: &str, cell: &Cell) -> fmt::Result {
    match &cell.outcome {
        Outcome::Differs => {
            if let Some(found) = &cell.found {
                writeln!(
                    f,
                    "{name}: {} of {} numbers are beyond what is allowed; at most {} ulp, {:?} absolute",
                    found.beyond, found.values, found.largest_ulp, found.largest_absolute
                )?;
                if let Some(d) = &found.first {
                    writeln!(
                        f,
                        "    {} inputs, invocation {}: {} is {}, expected {} ({} ulp)",
                        d.class, d.invocation, d.value, d.got, d.expected, d.ulp
                    )?;
                    let inputs: Vec<String> =
                        d.inputs.iter().map(|(n, v)| format!("{n} = {v}")).collect();
                    writeln!(f, "    {}", inputs.join(", "))?;
                }
            }
        }
        Outcome::Foreign { failure } => {
            let words = failure.to_string();
            writeln!(
                f,
                "{name}: {}",
                words.lines().take(12).collect::<Vec<_>>().join("\n    ")
            )?;
            if let Failure::Crashed { .. } | Failure::TimedOut { .. } = failure {
                writeln!(f, "    its whole output is in the JSON report")?;
            }
        }
        _ => return Ok(()),
    }
    if let Some(line) = &cell.line {
        writeln!(f, "    line {}: {}", line.number, line.text)?;
    }
    Ok(())
}
