//! The report as a table for people.

use std::fmt;

use comfy_table::{CellAlignment, Table, presets};

use super::{Outcome, Report};

/// A tolerance in a few characters.
fn tolerance(t: &hankel_dsl::native::describe::Tolerance) -> String {
    match (t.ulp, t.absolute) {
        (0, 0.0) => "bit for bit".into(),
        (ulp, 0.0) => format!("{ulp} ulp"),
        (0, absolute) => format!("{absolute:e}"),
        (ulp, absolute) => format!("{ulp} ulp or {absolute:e}"),
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "reference: {}, scalar; Vulkan: {}; seed {}",
            self.native, self.vulkan, self.seed
        )?;
        let mut table = Table::new();
        table.load_preset(presets::ASCII_MARKDOWN);
        table.set_header([
            "kernel",
            "path",
            "cases",
            "max ulp",
            "max abs",
            "tolerance",
            "result",
        ]);
        for column in [2, 3, 4] {
            if let Some(column) = table.column_mut(column) {
                column.set_cell_alignment(CellAlignment::Right);
            }
        }
        for kernel in &self.kernels {
            let allowed = tolerance(&kernel.tolerance);
            if kernel.error.is_some() {
                let name = kernel.kernel.as_str();
                table.add_row([name, "native scalar", "", "", "", &allowed, "ERROR"]);
            }
            for path in &kernel.paths {
                let exact = path.path == super::Path::NativeLanes;
                let (result, ran) = match &path.outcome {
                    Outcome::Passed => ("pass", true),
                    Outcome::Failed => ("FAIL", true),
                    Outcome::Error { .. } => ("ERROR", false),
                    Outcome::Unavailable { .. } => ("none", false),
                };
                let number = |text: String| if ran { text } else { String::new() };
                let ulp = match path.found.largest_ulp {
                    u64::MAX => "NaN".to_string(),
                    n => n.to_string(),
                };
                let absolute = match path.found.largest_absolute {
                    None => "inf".to_string(),
                    Some(0.0) => "0".to_string(),
                    Some(x) => format!("{x:.2e}"),
                };
                table.add_row([
                    kernel.kernel.clone(),
                    path.path.to_string(),
                    number(path.found.cases.to_string()),
                    number(ulp),
                    number(absolute),
                    if exact {
                        "bit for bit".into()
                    } else {
                        allowed.clone()
                    },
                    result.into(),
                ]);
            }
        }
        writeln!(f, "{table}")?;
        for kernel in &self.kernels {
            details(f, kernel)?;
        }
        let failed = self.kernels.iter().filter(|k| !k.passed).count();
        match failed {
            0 => writeln!(f, "all {} kernels agree", self.kernels.len()),
            n => writeln!(f, "{n} of {} kernels do not agree", self.kernels.len()),
        }
    }
}

/// What the table has no room for: reasons, errors, the first difference.
fn details(f: &mut fmt::Formatter<'_>, kernel: &super::KernelReport) -> fmt::Result {
    let name = &kernel.kernel;
    if let Some(error) = &kernel.error {
        writeln!(f, "{name}: {error}")?;
    }
    if kernel.non_finite > 0 {
        writeln!(
            f,
            "{name}: {} results are not finite, though every input is",
            kernel.non_finite
        )?;
    }
    let mut differs = false;
    for path in &kernel.paths {
        differs |= path.found.largest_ulp > 0;
        match &path.outcome {
            Outcome::Passed => {}
            Outcome::Error { message } => writeln!(f, "{name}, {}: {message}", path.path)?,
            Outcome::Unavailable { reason } => writeln!(f, "{name}, {}: {reason}", path.path)?,
            Outcome::Failed => {
                writeln!(
                    f,
                    "{name}, {}: {} of {} numbers are beyond the tolerance",
                    path.path, path.found.beyond, path.found.values
                )?;
                if let Some(d) = &path.found.first {
                    writeln!(
                        f,
                        "  first: {} of invocation {} ({} inputs): expected {}, got {}",
                        d.value, d.invocation, d.class, d.expected, d.got
                    )?;
                    let inputs: Vec<String> =
                        d.inputs.iter().map(|(n, v)| format!("{n} = {v}")).collect();
                    if !inputs.is_empty() {
                        writeln!(f, "  with {}", inputs.join(", "))?;
                    }
                }
            }
        }
    }
    if differs && !kernel.tolerance.why.is_empty() {
        writeln!(
            f,
            "{name}: may differ by {}: {}",
            tolerance(&kernel.tolerance),
            kernel.tolerance.why
        )?;
    }
    Ok(())
}
