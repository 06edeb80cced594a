//! Runs the matrix.

mod cells;
mod engine;
mod permits;
mod reference;

use std::collections::BTreeMap;
use std::ffi::OsString;
use std::path::PathBuf;
use std::sync::Mutex;
use std::thread;
use std::time::{Duration, Instant};

use hankel_dsl::native::describe::Stage;
use hankel_host::parity::numbers::Numbers;
use hankel_system::temporary::Folder;

use crate::absent::Absent;
use crate::cache::Cache;
use crate::column::Column;
use crate::known::Known;
use crate::process::Failure;
use crate::report::{Cell, ColumnReport, Outcome, Report, Row};
use crate::subject::Subject;
use crate::tools::{Status, Tool, Tools};
use cells::{Ran, Settled, Shared, Unit};
use permits::{Permits, locked};
use reference::{Ready, references};

/// What is to be run, and with what.
#[derive(Clone, Debug)]
pub struct Request {
    /// The columns.
    pub columns: Vec<Column>,
    /// Seed of the inputs.
    pub seed: u64,
    /// How long a compiler or device may take for one kernel.
    pub limit: Duration,
    /// Where compilers, drivers and browsers are.
    pub tools: Tools,
    /// The program and its arguments before `vulkan` or `gl` that run [`crate::serve`].
    pub runner: Vec<OsString>,
    /// Where results are kept; none to keep none and use none.
    pub cache: Option<PathBuf>,
    /// Known differences.
    pub known: Known,
    /// Cells that are known not to run; none where that is not to be compared.
    pub absent: Option<Absent>,
    /// All kernels of the crate are there, and all columns.
    pub whole: bool,
    /// Columns that must run: one that is not installed is a complaint.
    pub required: Vec<Column>,
}

/// Why the matrix could not be begun.
#[derive(Debug, thiserror::Error)]
#[error("{what}: {source}")]
pub struct Error {
    /// What was tried.
    what: String,
    /// The system's words.
    source: std::io::Error,
}

/// Runs `subjects` in all columns of `request`. `progress` gets words about what is being done.
///
/// What goes wrong with a kernel is part of the report; nothing stops the others.
///
/// # Errors
/// A folder for the work cannot be made.
pub fn run(
    request: &Request,
    subjects: &[Subject],
    progress: &(dyn Fn(&str) + Sync),
) -> Result<Report, Error> {
    let began = Instant::now();
    let io = |what: &str| {
        let what = what.to_owned();
        move |source| Error { what, source }
    };
    let work = Folder::new().map_err(io("making a folder for the work"))?;

    progress("looking for compilers and drivers");
    let wanted: Vec<Tool> = Tool::ALL
        .into_iter()
        .filter(|t| request.columns.iter().any(|c| c.tools().contains(t)))
        .collect();
    let tools: Vec<Status> = request.tools.statuses(&wanted);

    progress("running the reference");
    let ready = references(request, subjects, work.path()).map_err(io("writing inputs"))?;

    // How many kernels are compiled or run at a time.
    let at_once = thread::available_parallelism().map_or(1, usize::from);
    let cache = Cache::new(request.cache.as_deref(), &request.runner);
    let shared = Shared {
        request,
        work: work.path(),
        tools: &tools,
        cache: &cache,
        permits: Permits::new(at_once),
        progress,
        left: Mutex::new(0),
    };
    let mut cells: Vec<BTreeMap<Column, Cell>> = ready.iter().map(|_| BTreeMap::new()).collect();
    let mut devices: BTreeMap<Column, String> = BTreeMap::new();
    let mut cached = 0;

    // What needs no other program is settled at once, the rest is queued by column.
    let mut queues: Vec<(Column, Vec<Unit<'_>>, Mutex<usize>)> = Vec::new();
    for &column in &request.columns {
        let mut queue = Vec::new();
        for (row, it) in ready.iter().enumerate() {
            match shared.settle(column, row, it) {
                Settled::Cell(cell) => {
                    cells[row].insert(column, *cell);
                }
                Settled::Cached(cell) => {
                    cached += 1;
                    cells[row].insert(column, *cell);
                }
                Settled::Run(unit) => queue.push(unit),
            }
        }
        if !queue.is_empty() {
            queues.push((column, queue, Mutex::new(0)));
        }
    }
    *locked(&shared.left) = queues.iter().map(|(_, queue, _)| queue.len()).sum();

    let done: Vec<Ran> = thread::scope(|s| {
        let mut all = Vec::new();
        for (column, queue, next) in &queues {
            // Only where a process is started for each kernel anyway do several go on at a time.
            let lines = if *column == Column::Msl { at_once } else { 1 };
            for line in 0..lines {
                let shared = &shared;
                all.push(s.spawn(move || shared.column(*column, queue, next, line)));
            }
        }
        all.into_iter().filter_map(|t| t.join().ok()).collect()
    });
    for ran in done {
        if let Some(device) = ran.device {
            devices.insert(ran.column, device);
        }
        for (row, cell) in ran.cells {
            cells[row].insert(ran.column, cell);
        }
    }

    // A thread that panicked left its cells behind.
    for (column, queue, _) in &queues {
        for unit in queue {
            cells[unit.row].entry(*column).or_insert_with(|| {
                Cell::unrun(Outcome::Foreign {
                    failure: Failure::refused("hankel itself failed here; please report it"),
                })
            });
        }
    }

    let mut report = Report {
        hankel: hankel_codegen::VERSION.into(),
        seed: request.seed,
        columns: request
            .columns
            .iter()
            .map(|&column| ColumnReport {
                column,
                how: column.how().into(),
                device: devices
                    .get(&column)
                    .cloned()
                    .or_else(|| cache.get(&cache.device_key(column, &tools)?)),
            })
            .collect(),
        kernels: ready
            .iter()
            .zip(cells)
            .map(|(it, cells)| row(it, cells))
            .collect(),
        tools: tools.clone(),
        complaints: Vec::new(),
        seconds: 0.0,
        cached,
        passed: false,
    };
    for (column, device) in &devices {
        if let Some(key) = cache.device_key(*column, &tools) {
            cache.put(&key, device);
        }
    }
    complain(request, &mut report);
    if let Some(absent) = &request.absent {
        let differences = absent.differences(&report);
        report.complaints.extend(differences);
    }
    request.known.apply(&mut report, request.whole);
    report.passed = report.complaints.is_empty()
        && report
            .kernels
            .iter()
            .all(|r| r.cells.values().all(|c| !c.outcome.fails()));
    report.seconds = began.elapsed().as_secs_f64();
    Ok(report)
}

/// Required columns that did not run.
fn complain(request: &Request, report: &mut Report) {
    for column in &request.required {
        let missing =
            report
                .kernels
                .iter()
                .find_map(|r| match r.cells.get(column).map(|c| &c.outcome) {
                    Some(Outcome::NotInstalled { what, install }) => {
                        Some(format!("{what} is not installed; {install}"))
                    }
                    None => Some("it was not asked for".into()),
                    _ => None,
                });
        if let Some(why) = missing {
            report
                .complaints
                .push(format!("column {column} is required: {why}"));
        }
    }
}

fn row(it: &Ready<'_>, cells: BTreeMap<Column, Cell>) -> Row {
    let kernel = it.kernel();
    let numbers = Numbers::of(kernel);
    Row {
        kernel: it.subject.name.clone(),
        stage: match kernel.stage {
            Stage::Compute { .. } => "compute",
            Stage::Vertex => "vertex",
            Stage::Fragment => "fragment",
        }
        .into(),
        invocations: it.prepared.cases.iter().map(|c| c.invocations as u64).sum(),
        non_finite: it
            .reference
            .iter()
            .flatten()
            .zip(&it.prepared.cases)
            .map(|(written, case)| numbers.non_finite(case, written).0)
            .sum(),
        cells,
    }
}
