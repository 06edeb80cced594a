//! For CI: compares what is committed with what the sources give, and holds budgets.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::path::Path;

use hankel_system::{fields, input};
use serde::{Deserialize, Serialize};

use crate::build::Generated;
use crate::error::{Error, Failure, Result};
use crate::finish;
use crate::folder::{Folder, Found, STAGE, SUBFOLDERS};
use crate::frame::{CONTENTS, FRAME_FILE};
use crate::lint::Finding;
use crate::manifest::KernelEntry;
use crate::spirv;

/// Limits on a kernel's cost; see [`Cost`](crate::cost::Cost) for what is counted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Limits {
    /// Most arithmetic instructions.
    pub arithmetic: Option<u32>,
    /// Most scalar operations.
    pub operations: Option<u32>,
    /// Most branches.
    pub branches: Option<u32>,
    /// Most texture instructions.
    pub texture: Option<u32>,
    /// Most instructions in all.
    pub total: Option<u32>,
    /// Most 32-bit values alive at one place.
    pub registers: Option<u32>,
    /// Most findings of [`crate::lint`].
    pub findings: Option<u32>,
}

/// `hankel.toml`:
///
/// ```toml
/// [budget]
/// branches = 4
///
/// [budget.kernels.hamburger_4msm_f32]
/// arithmetic = 80
/// ```
#[derive(Clone, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Config {
    /// The budget.
    #[serde(default, deserialize_with = "fields::table")]
    pub budget: Budget,
}

/// Limits for all kernels and for single ones.
#[derive(Clone, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Budget {
    /// Most arithmetic instructions of any kernel.
    pub arithmetic: Option<u32>,
    /// Most scalar operations.
    pub operations: Option<u32>,
    /// Most branches.
    pub branches: Option<u32>,
    /// Most texture instructions.
    pub texture: Option<u32>,
    /// Most instructions in all.
    pub total: Option<u32>,
    /// Most 32-bit values alive at one place.
    pub registers: Option<u32>,
    /// Most findings of [`crate::lint`].
    pub findings: Option<u32>,
    /// Limits of single kernels, which come before those for all.
    #[serde(default, deserialize_with = "fields::map")]
    pub kernels: BTreeMap<String, Limits>,
}

/// Most bytes of a budget.
const MAX_BYTES: u64 = 1 << 20;

impl Config {
    /// Reads `hankel.toml`.
    ///
    /// # Errors
    ///
    /// The file cannot be read, or says something that is not known.
    pub fn read(path: &Path) -> Result<Self> {
        let fail = |problem: String| Error::Budget {
            path: path.to_owned(),
            problem,
        };
        let text = input::read_text(path, MAX_BYTES).map_err(|error| fail(error.problem()))?;
        toml::from_str(&text).map_err(|error| fail(error.to_string().trim().to_owned()))
    }
}

impl Budget {
    /// The limits of a kernel.
    pub fn of(&self, kernel: &str) -> Limits {
        let own = self.kernels.get(kernel).copied().unwrap_or_default();
        Limits {
            arithmetic: own.arithmetic.or(self.arithmetic),
            operations: own.operations.or(self.operations),
            branches: own.branches.or(self.branches),
            texture: own.texture.or(self.texture),
            total: own.total.or(self.total),
            registers: own.registers.or(self.registers),
            findings: own.findings.or(self.findings),
        }
    }
}

/// A kernel that grew past its budget.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct OverBudget {
    /// The kernel.
    pub kernel: String,
    /// What is limited.
    pub what: &'static str,
    /// How much of it there is.
    pub got: u32,
    /// How much there may be.
    pub limit: u32,
    /// What the lint found, if that is limited.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub findings: Vec<Finding>,
}

/// A file that differs.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Changed {
    /// Its path in the folder.
    pub file: String,
    /// A unified diff from what is committed to what the sources give; for SPIR-V, sizes.
    pub diff: String,
}

/// What a check found.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Report {
    /// Files that are up to date.
    pub same: usize,
    /// A build of the folder was stopped before its end.
    pub stopped: bool,
    /// Files that differ.
    pub changed: Vec<Changed>,
    /// Files that should be there.
    pub missing: Vec<String>,
    /// Files that should not.
    pub extra: Vec<String>,
    /// Committed SPIR-V that spirv-val rejects.
    pub invalid: Vec<String>,
    /// Kernels past their budget.
    pub over_budget: Vec<OverBudget>,
    /// Names in the budget that are not names of kernels.
    pub unknown_in_budget: Vec<String>,
}

impl Report {
    /// Whether everything is as it should be.
    pub fn is_fine(&self) -> bool {
        let Self {
            same: _,
            stopped,
            changed,
            missing,
            extra,
            invalid,
            over_budget,
            unknown_in_budget,
        } = self;
        !stopped
            && changed.is_empty()
            && missing.is_empty()
            && extra.is_empty()
            && invalid.is_empty()
            && over_budget.is_empty()
            && unknown_in_budget.is_empty()
    }
}

/// Compares the folder `committed` with what was generated.
///
/// # Errors
///
/// It is not a folder, or a file that is there cannot be read.
pub fn check(generated: &Generated, committed: &Path, budget: &Budget) -> Result<Report> {
    let mut report = Report::default();
    let folder = Folder::open(committed)?;
    for (name, expected) in &generated.files {
        let found = match &folder {
            Some(folder) => folder.read(name)?,
            None => Found::Nothing,
        };
        match found {
            Found::File(there) if there == *expected => report.same += 1,
            Found::File(there) => {
                if name.ends_with(".spv") {
                    report
                        .invalid
                        .extend(invalid(name, &there).map(|failure| failure.to_string()));
                }
                report.changed.push(Changed {
                    file: name.clone(),
                    diff: unified_diff(name, &there, expected),
                });
            }
            Found::Nothing => report.missing.push(name.clone()),
            Found::Other(path, kind) => report.changed.push(Changed {
                file: name.clone(),
                diff: format!("{} is {kind}\n", path.display()),
            }),
        }
    }
    if let Some(folder) = &folder {
        report.stopped = folder.was_stopped()?;
        report.extra = extra(folder, generated)?;
    }
    report.extra.sort();
    for (kernel, entry) in &generated.manifest.kernels {
        report
            .over_budget
            .extend(over_budget(kernel, entry, budget.of(kernel)));
    }
    let known = &generated.manifest.kernels;
    report.unknown_in_budget = budget
        .kernels
        .keys()
        .filter(|name| !known.contains_key(*name))
        .cloned()
        .collect();
    Ok(report)
}

fn over_budget(kernel: &str, entry: &KernelEntry, limits: Limits) -> Vec<OverBudget> {
    const FINDINGS: &str = "findings of the lint";
    let cost = entry.cost;
    [
        (
            "arithmetic instructions",
            cost.arithmetic,
            limits.arithmetic,
        ),
        ("scalar operations", cost.operations, limits.operations),
        ("branches", cost.branches, limits.branches),
        ("texture instructions", cost.texture, limits.texture),
        ("instructions", cost.total, limits.total),
        ("registers", cost.registers, limits.registers),
        (FINDINGS, entry.findings.len() as u32, limits.findings),
    ]
    .into_iter()
    .filter_map(|(what, got, limit)| {
        let limit = limit.filter(|limit| got > *limit)?;
        Some(OverBudget {
            kernel: kernel.into(),
            what,
            got,
            limit,
            findings: match what {
                FINDINGS => entry.findings.clone(),
                _ => Vec::new(),
            },
        })
    })
    .collect()
}

fn invalid(name: &str, bytes: &[u8]) -> Option<Failure> {
    spirv::words(bytes, name)
        .and_then(|words| finish::validate(&words, name))
        .err()
}

/// A unified diff from what is committed to what the sources give; sizes of what is not text.
pub(crate) fn unified_diff(name: &str, there: &[u8], expected: &[u8]) -> String {
    match (std::str::from_utf8(there), std::str::from_utf8(expected)) {
        (Ok(there), Ok(expected)) => similar::TextDiff::from_lines(there, expected)
            .unified_diff()
            .context_radius(3)
            .header(&format!("committed/{name}"), &format!("generated/{name}"))
            .to_string(),
        _ => format!(
            "--- committed/{name}\n+++ generated/{name}\nbinary files differ: {} and {} bytes\n",
            there.len(),
            expected.len()
        ),
    }
}

/// Files in the folders of a build that do not belong to it. Other files beside these folders are ignored, and so
/// are hidden files, which are an editor's or the system's.
fn extra(folder: &Folder, generated: &Generated) -> Result<Vec<String>> {
    let mut extra = Vec::new();
    let has_frame = generated.files.contains_key(FRAME_FILE);
    for sub in SUBFOLDERS {
        // A name that others may use, too.
        if sub == CONTENTS && !has_frame {
            continue;
        }
        for file in folder.files_in(sub)? {
            let name = format!("{sub}/{file}");
            if !file.starts_with('.') && !generated.files.contains_key(&name) {
                extra.push(name);
            }
        }
    }
    Ok(extra)
}

/// Most lines of differences that a report prints; files beyond that are named only.
const MAX_LINES: usize = 400;

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (mut room, mut told) = (MAX_LINES, BTreeSet::new());
        for changed in &self.changed {
            // What is wrong with a folder is wrong with each of its files.
            if !told.insert(changed.diff.as_str()) {
                continue;
            }
            let lines = changed.diff.lines().count();
            if lines > room {
                writeln!(f, "changed: {}, {lines} lines of differences", changed.file)?;
                continue;
            }
            room -= lines;
            writeln!(f, "{}", changed.diff)?;
        }
        if self.stopped {
            writeln!(
                f,
                "{STAGE}: a build of this folder was interrupted; the next `hankel build` completes it"
            )?;
        }
        for file in &self.missing {
            writeln!(f, "missing: {file}")?;
        }
        for file in &self.extra {
            writeln!(f, "not from the sources: {file}")?;
        }
        for failure in &self.invalid {
            writeln!(f, "invalid: {failure}")?;
        }
        for over in &self.over_budget {
            let OverBudget {
                kernel,
                what,
                got,
                limit,
                findings,
            } = over;
            writeln!(
                f,
                "over budget: kernel `{kernel}` has {got} {what}, {limit} are allowed"
            )?;
            for finding in findings {
                writeln!(f, "  {finding}")?;
            }
        }
        for kernel in &self.unknown_in_budget {
            writeln!(
                f,
                "the budget names `{kernel}`, but there is no such kernel"
            )?;
        }
        write!(
            f,
            "{} files up to date, {} changed, {} missing, {} extra, {} over budget",
            self.same,
            self.changed.len(),
            self.missing.len(),
            self.extra.len(),
            self.over_budget.len()
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn differences_are_told_once_and_within_a_page() {
        let changed = |file: &str, diff: String| Changed {
            file: file.into(),
            diff,
        };
        let report = Report {
            changed: vec![
                changed("wgsl/a.wgsl", "wgsl is a symbolic link\n".into()),
                changed("wgsl/b.wgsl", "wgsl is a symbolic link\n".into()),
                changed("hlsl/a.hlsl", "-line\n".repeat(MAX_LINES)),
                changed("hlsl/b.hlsl", "+line\n".into()),
            ],
            ..Report::default()
        };
        let told = report.to_string();
        assert_eq!(told.matches("wgsl is a symbolic link").count(), 1);
        assert_eq!(told.matches("-line").count(), 0);
        assert!(told.contains("changed: hlsl/a.hlsl, 400 lines of differences\n"));
        assert!(told.contains("+line\n"));
        assert!(told.contains("4 changed"));
    }
}
