//! The cells: what is settled beforehand, what the cache has, and what has to be run.

use std::path::Path;
use std::sync::Mutex;
use std::time::{Duration, Instant};

use hankel_codegen::files::sha256;
use hankel_dsl::native::describe::Precision;
use hankel_dsl::native::lanes;
use hankel_host::parity::execute::Written;
use hankel_host::parity::intervals::{Intervals, Products};
use hankel_host::parity::numbers::{Found, Numbers, Rules};

use super::Request;
use super::engine::Engine;
use super::permits::{Permits, locked};
use super::reference::Ready;
use crate::cache::Cache;
use crate::column::Column;
use crate::job::Driver;
use crate::machine::Machine;
use crate::process::Failure;
use crate::report::{Cell, Outcome};
use crate::subject::Code;
use crate::tools::Status;
use crate::{locate, rules};

/// A kernel to be run in a column.
#[derive(Clone, Copy)]
pub(super) struct Unit<'a> {
    /// The kernel's number.
    pub(super) row: usize,
    pub(super) it: &'a Ready<'a>,
    pub(super) code: &'a Code,
}

/// What came of a column's queue, or of a part of it.
pub(super) struct Ran {
    pub(super) column: Column,
    /// The device, if a runner was started.
    pub(super) device: Option<String>,
    /// Cells with the numbers of their rows.
    pub(super) cells: Vec<(usize, Cell)>,
}

/// What is known of a cell before anything is run.
pub(super) enum Settled<'a> {
    Cell(Box<Cell>),
    Cached(Box<Cell>),
    Run(Unit<'a>),
}

/// What all columns share.
pub(super) struct Shared<'a> {
    pub(super) request: &'a Request,
    /// The folder of the whole run.
    pub(super) work: &'a Path,
    pub(super) tools: &'a [Status],
    pub(super) cache: &'a Cache,
    pub(super) permits: Permits,
    pub(super) progress: &'a (dyn Fn(&str) + Sync),
    /// Cells that are still to be run.
    pub(super) left: Mutex<usize>,
}

impl<'a> Shared<'a> {
    /// What is known of the cell of kernel `row` before anything is run.
    pub(super) fn settle(&self, column: Column, row: usize, it: &'a Ready<'a>) -> Settled<'a> {
        let unrun = |outcome| Settled::Cell(Box::new(Cell::unrun(outcome)));
        if let Err(problem) = &it.reference {
            return unrun(Outcome::NoReference {
                problem: problem.clone(),
            });
        }
        if column == Column::NativeSimd && !lanes::BUILT {
            return unrun(Outcome::Lacking {
                what: "SIMD lanes: hankel was built without the feature `lanes`".into(),
            });
        }
        let Some(language) = column.language() else {
            let results = if column == Column::Native {
                &it.reference
            } else {
                &it.simd
            };
            let results = results.clone().map_err(Failure::refused);
            let mut cell = judge(it, column, None, None, results, Duration::ZERO);
            if column == Column::Native {
                finite(it, &mut cell);
            }
            return Settled::Cell(Box::new(cell));
        };
        if let Some(status) = column.statuses(self.tools).find(|s| !s.is_there()) {
            let what = match &status.problem {
                None => status.name.clone(),
                Some(problem) => format!("{} ({problem})", status.name),
            };
            return unrun(Outcome::NotInstalled {
                what,
                install: status.install.clone(),
            });
        }
        let code = match it.subject.codes.get(&language) {
            Some(Ok(code)) => code,
            Some(Err(reason)) => {
                return unrun(Outcome::Inexpressible {
                    reason: reason.clone(),
                });
            }
            None => {
                return unrun(Outcome::Inexpressible {
                    reason: format!("{language} was not written"),
                });
            }
        };
        if let Some(what) = rules::lacking(it.kernel(), column, &code.bytes) {
            return unrun(Outcome::Lacking { what });
        }
        let key = self.key(column, it, code);
        match key.and_then(|key| self.cache.get(&key)) {
            Some(cell) => Settled::Cached(Box::new(cell)),
            None => Settled::Run(Unit { row, it, code }),
        }
    }

    fn key(&self, column: Column, it: &Ready<'_>, code: &Code) -> Option<String> {
        let versions: Vec<&Status> = column.statuses(self.tools).collect();
        self.cache.key(&(
            column,
            Machine::this(),
            it.kernel(),
            sha256(&code.bytes),
            &code.entry_point,
            &code.places,
            &it.hash,
            rules::of(it.kernel(), column, column.flushes(), it.flushed.is_some()),
            versions,
        ))
    }

    /// Runs what is left of a column's queue.
    pub(super) fn column(
        &self,
        column: Column,
        queue: &[Unit<'_>],
        next: &Mutex<usize>,
        line: usize,
    ) -> Ran {
        let mut engine = Engine::new(self.request, self.work, column, line);
        let mut found = Vec::new();
        loop {
            let i = {
                let mut next = locked(next);
                *next += 1;
                *next - 1
            };
            let Some(unit) = queue.get(i) else { break };
            let cell = self.permits.hold(|| {
                let began = Instant::now();
                let results = engine.run(unit);
                judge(
                    unit.it,
                    column,
                    engine.driver.as_ref(),
                    Some(unit.code),
                    results,
                    began.elapsed(),
                )
            });
            // A refusal may be this machine's (no space, a lost device), and costs little to repeat.
            let ran = matches!(
                cell.outcome,
                Outcome::Passed | Outcome::Differs | Outcome::Lacking { .. }
            );
            if let Some(key) = self.key(column, unit.it, unit.code).filter(|_| ran) {
                self.cache.put(&key, &cell);
            }
            found.push((unit.row, cell));
            let left = {
                let mut left = locked(&self.left);
                *left -= 1;
                *left
            };
            (self.progress)(&format!(
                "{left} cells left; {column}: {}",
                unit.it.subject.name
            ));
        }
        Ran {
            column,
            device: engine.driver.map(|driver| driver.name),
            cells: found,
        }
    }
}

/// Finite inputs give finite results, unless the kernel says otherwise.
fn finite(it: &Ready<'_>, cell: &mut Cell) {
    let Ok(reference) = &it.reference else {
        return;
    };
    if it.kernel().tolerance.non_finite {
        return;
    }
    let numbers = Numbers::of(it.kernel());
    let (mut count, mut first) = (0, None);
    for (case, written) in it.prepared.cases.iter().zip(reference) {
        let (n, found) = numbers.non_finite(case, written);
        count += n;
        first = first.or(found);
    }
    if count > 0 {
        cell.outcome = Outcome::NotFinite { count };
        if let Some(found) = &mut cell.found {
            found.first = first;
        }
    }
}

/// Compares results with the reference.
fn judge(
    it: &Ready<'_>,
    column: Column,
    driver: Option<&Driver>,
    code: Option<&Code>,
    results: Result<Vec<Written>, Failure>,
    took: Duration,
) -> Cell {
    let kernel = it.kernel();
    let flushes = driver.map_or(column.flushes(), |driver| driver.flushes);
    // What flushes does so with 32-bit floats.
    let flushes = flushes && kernel.precision != Some(Precision::F64);
    let rounds_products = driver.is_some_and(|driver| driver.rounds_products);
    let rules = Rules {
        rounds_products,
        ..rules::of(kernel, column, flushes, it.flushed.is_some())
    };
    let mut cell = Cell {
        outcome: Outcome::Passed,
        rules: Some(rules.clone()),
        found: None,
        line: None,
        seconds: took.as_secs_f64(),
    };
    // SPIR-V has no lines.
    let text = code
        .and_then(|code| str::from_utf8(&code.bytes).ok())
        .filter(|text| !text.contains('\0'));
    let numbers = Numbers::of(kernel);
    let intervals = match column.language() {
        // This processor's lanes round as its scalar code does.
        None => Ok(Default::default()),
        Some(_) if rounds_products => it.intervals(Products::Rounded),
        Some(_) => it.intervals(Products::Exact),
    };
    let compared = |reference: &[Written], results: &[Written], intervals: &[Option<Intervals>]| {
        let mut found = Found::default();
        let cases = it.prepared.cases.iter().zip(reference).zip(results);
        for (i, ((case, a), b)) in cases.enumerate() {
            let interval = intervals.get(i).and_then(Option::as_ref);
            numbers.compare(case, &rules, interval, a, b, &mut found);
        }
        found
    };
    let references: Result<Vec<&Vec<Written>>, &String> = it
        .references_for(column, flushes)
        .iter()
        .map(Result::as_ref)
        .collect();
    let expected = references.and_then(|references| Ok((references, intervals?)));
    match (results, expected) {
        (Err(Failure::Lacks { what }), _) => cell.outcome = Outcome::Lacking { what },
        (Err(failure), _) => {
            cell.line = text.and_then(|text| locate::of_message(text, &failure.to_string()));
            cell.outcome = Outcome::Foreign { failure };
        }
        (Ok(results), Ok((references, intervals))) => {
            // One size of subgroups for all cases.
            let found = references
                .iter()
                .map(|reference| compared(reference, &results, intervals))
                .min_by_key(|found| found.beyond)
                .unwrap_or_default();
            if found.beyond > 0 {
                cell.outcome = Outcome::Differs;
                cell.line = text
                    .zip(found.first.as_ref())
                    .and_then(|(text, difference)| {
                        locate::of_output(text, kernel, code?, &difference.value)
                    });
            }
            cell.found = Some(found);
        }
        (Ok(_), Err(problem)) => {
            cell.outcome = Outcome::Foreign {
                failure: Failure::refused(problem.as_str()),
            };
        }
    }
    cell
}
