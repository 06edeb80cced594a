//! Runs the matrix.

use std::collections::BTreeMap;
use std::ffi::OsString;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use hankel_codegen::files::sha256;
use hankel_dsl::native::Mode;
use hankel_dsl::native::describe::Kernel;
use hankel_host::device::NativeDevice;
use hankel_host::parity::execute::{self, Written};
use hankel_host::parity::numbers::{Found, Numbers, Rules};

use crate::cache::Cache;
use crate::column::Column;
use crate::flush::flushed;
use crate::job::Job;
use crate::known::Known;
use crate::prepare::Prepared;
use crate::process::{Failure, Runner};
use crate::report::{Cell, ColumnReport, Outcome, Report, Row};
use crate::subject::{Code, Subject};
use crate::tools::{Dxc, Status, Tool, Tools};
use crate::vulkan::{VulkanJob, Way};
use crate::{compile, locate, msl, rules, webgpu};

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
    /// How many kernels are compiled or run at a time.
    pub at_once: usize,
    /// Known differences.
    pub known: Known,
    /// All kernels of the crate are there.
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

/// A kernel with its inputs and the reference's results.
struct Ready<'a> {
    subject: &'a Subject,
    prepared: Prepared,
    inputs: PathBuf,
    /// SHA-256 of inputs and reference.
    hash: String,
    reference: Result<Vec<Written>, String>,
    /// The same as on a device that flushes subnormal numbers; none where that cannot be had.
    flushed: Option<Result<Vec<Written>, String>>,
    simd: Result<Vec<Written>, String>,
}

impl Ready<'_> {
    fn kernel(&self) -> &Kernel {
        &self.subject.entry.kernel
    }

    /// What a column is compared with.
    fn reference_for(&self, column: Column) -> &Result<Vec<Written>, String> {
        match &self.flushed {
            Some(flushed) if column.flushes() => flushed,
            _ => &self.reference,
        }
    }
}

/// Lets some work at a time.
#[derive(Debug)]
struct Permits {
    free: Mutex<usize>,
    freed: Condvar,
}

impl Permits {
    fn new(n: usize) -> Self {
        Self {
            free: Mutex::new(n.max(1)),
            freed: Condvar::new(),
        }
    }

    fn hold<T>(&self, work: impl FnOnce() -> T) -> T {
        let mut free = locked(&self.free);
        while *free == 0 {
            free = self
                .freed
                .wait(free)
                .unwrap_or_else(PoisonError::into_inner);
        }
        *free -= 1;
        drop(free);
        let value = work();
        *locked(&self.free) += 1;
        self.freed.notify_one();
        value
    }
}

fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
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
    let work = tempfile::tempdir().map_err(io("making a folder for the work"))?;

    progress("looking for compilers and drivers");
    let wanted: Vec<Tool> = Tool::ALL
        .into_iter()
        .filter(|t| request.columns.iter().any(|c| c.tools().contains(t)))
        .collect();
    let tools: Vec<Status> = thread::scope(|s| {
        let all: Vec<_> = wanted
            .iter()
            .map(|&t| s.spawn(move || request.tools.status(t)))
            .collect();
        all.into_iter().filter_map(|t| t.join().ok()).collect()
    });

    progress("running the reference");
    let ready = references(request, subjects, work.path()).map_err(io("writing inputs"))?;

    let cache = Cache::new(request.cache.as_deref(), &request.runner);
    let shared = Shared {
        request,
        work: work.path(),
        tools: &tools,
        cache: &cache,
        permits: Permits::new(request.at_once),
        progress,
        left: Mutex::new(0),
    };
    let mut cells: Vec<BTreeMap<Column, Cell>> = ready.iter().map(|_| BTreeMap::new()).collect();
    let mut devices: BTreeMap<Column, String> = BTreeMap::new();
    let mut cached = 0;

    // What needs no other program is settled at once, the rest is queued by column.
    let mut queues: Vec<(Column, Vec<Unit<'_>>)> = Vec::new();
    for &column in &request.columns {
        let mut queue = Vec::new();
        for (row, it) in ready.iter().enumerate() {
            match shared.settle(column, it) {
                Settled::Cell(cell) => {
                    cells[row].insert(column, cell);
                }
                Settled::Cached(cell) => {
                    cached += 1;
                    cells[row].insert(column, cell);
                }
                Settled::Run(unit) => queue.push(Unit { row, ..*unit }),
            }
        }
        if !queue.is_empty() {
            queues.push((column, queue));
        }
    }
    *locked(&shared.left) = queues.iter().map(|(_, q)| q.len()).sum();

    let done: Vec<Ran> = thread::scope(|s| {
        let mut all = Vec::new();
        for (column, queue) in &queues {
            // Only where a process is started for each kernel anyway do several go on at a time.
            let lines = if *column == Column::Msl {
                request.at_once.max(1)
            } else {
                1
            };
            let next = Arc::new(Mutex::new(0));
            for line in 0..lines {
                let (shared, next) = (&shared, Arc::clone(&next));
                all.push(s.spawn(move || shared.column(*column, queue, &next, line)));
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
                    .or_else(|| cache.device(column, &tools)),
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
        cache.keep_device(*column, &tools, device);
    }
    complain(request, &mut report);
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
        kernel: kernel.name.clone(),
        stage: match kernel.stage {
            hankel_dsl::native::describe::Stage::Compute { .. } => "compute",
            hankel_dsl::native::describe::Stage::Vertex => "vertex",
            hankel_dsl::native::describe::Stage::Fragment => "fragment",
        }
        .into(),
        invocations: it.prepared.cases.iter().map(|c| c.invocations as u64).sum(),
        non_finite: it
            .reference
            .iter()
            .flatten()
            .map(|w| numbers.non_finite(w))
            .sum(),
        cells,
    }
}

/// Makes the inputs of all kernels, and runs them natively.
fn references<'a>(
    request: &Request,
    subjects: &'a [Subject],
    work: &Path,
) -> std::io::Result<Vec<Ready<'a>>> {
    let next = Mutex::new(0);
    let made: Mutex<Vec<(usize, std::io::Result<Ready<'a>>)>> = Mutex::default();
    thread::scope(|s| {
        for _ in 0..request.at_once.clamp(1, subjects.len().max(1)) {
            s.spawn(|| {
                loop {
                    let i = {
                        let mut next = locked(&next);
                        *next += 1;
                        *next - 1
                    };
                    let Some(subject) = subjects.get(i) else {
                        break;
                    };
                    let one = reference(request, subject, work);
                    locked(&made).push((i, one));
                }
            });
        }
    });
    let mut made = made.into_inner().unwrap_or_else(PoisonError::into_inner);
    made.sort_by_key(|(i, _)| *i);
    made.into_iter().map(|(_, one)| one).collect()
}

fn reference<'a>(
    request: &Request,
    subject: &'a Subject,
    work: &Path,
) -> std::io::Result<Ready<'a>> {
    let kernel = &subject.entry.kernel;
    let inputs = work.join(format!("{}.inputs", kernel.name));
    let prepared = Prepared::new(kernel, request.seed, &inputs)?;
    let program = subject.entry.program(None, &[]);
    let natively = |mode: Mode| -> Result<Vec<Written>, String> {
        let mut device = NativeDevice::with_mode(mode);
        prepared
            .cases
            .iter()
            .map(|case| {
                execute::dispatch(&mut device, &program, case)
                    .map_err(|e| format!("{} inputs: {e}", case.class))
            })
            .collect()
    };
    let reference = natively(Mode::REFERENCE);
    let flushed = request
        .columns
        .iter()
        .any(|c| c.flushes())
        .then(|| flushed(|| natively(Mode::REFERENCE)))
        .flatten();
    let simd = natively(Mode::default());
    let mut all = fs::read(&inputs)?;
    let references = reference.iter().chain(flushed.iter().flatten());
    for written in references.flatten().flatten() {
        all.extend_from_slice(written);
    }
    Ok(Ready {
        subject,
        prepared,
        inputs,
        hash: sha256(&all),
        reference,
        flushed,
        simd,
    })
}

/// A kernel to be run in a column.
#[derive(Clone, Copy)]
struct Unit<'a> {
    row: usize,
    it: &'a Ready<'a>,
    code: &'a Code,
}

/// What came of a column's queue, or of a part of it.
struct Ran {
    column: Column,
    /// The device, if a runner was started.
    device: Option<String>,
    /// Cells with the numbers of their rows.
    cells: Vec<(usize, Cell)>,
}

/// What is known of a cell before anything is run.
enum Settled<'a> {
    Cell(Cell),
    Cached(Cell),
    Run(Box<Unit<'a>>),
}

/// What all columns share.
struct Shared<'a> {
    request: &'a Request,
    work: &'a Path,
    tools: &'a [Status],
    cache: &'a Cache,
    permits: Permits,
    progress: &'a (dyn Fn(&str) + Sync),
    left: Mutex<usize>,
}

impl<'a> Shared<'a> {
    fn settle(&self, column: Column, it: &'a Ready<'a>) -> Settled<'a> {
        if let Err(problem) = &it.reference {
            let message = format!("the native scalar run fails: {problem}");
            return Settled::Cell(Cell::unrun(Outcome::Foreign {
                failure: Failure::refused(message),
            }));
        }
        let Some(language) = column.language() else {
            let results = if column == Column::Native {
                &it.reference
            } else {
                &it.simd
            };
            let results = results.clone().map_err(Failure::refused);
            return Settled::Cell(judge(it, column, None, results, Duration::ZERO));
        };
        for tool in column.tools() {
            if let Some(status) = self.tools.iter().find(|s| s.tool == *tool)
                && !status.is_there()
            {
                let what = match &status.problem {
                    None => status.name.clone(),
                    Some(problem) => format!("{} ({problem})", status.name),
                };
                return Settled::Cell(Cell::unrun(Outcome::NotInstalled {
                    what,
                    install: status.install.clone(),
                }));
            }
        }
        let code = match it.subject.codes.get(&language) {
            Some(Ok(code)) => code,
            Some(Err(reason)) => {
                return Settled::Cell(Cell::unrun(Outcome::Inexpressible {
                    reason: reason.clone(),
                }));
            }
            None => {
                return Settled::Cell(Cell::unrun(Outcome::Inexpressible {
                    reason: format!("{language} was not written"),
                }));
            }
        };
        if let Some(cell) = self.cache.get(&self.key(column, it, code)) {
            return Settled::Cached(cell);
        }
        Settled::Run(Box::new(Unit { row: 0, it, code }))
    }

    fn key(&self, column: Column, it: &Ready<'_>, code: &Code) -> String {
        let versions: Vec<&Status> = self
            .tools
            .iter()
            .filter(|s| column.tools().contains(&s.tool))
            .collect();
        self.cache.key(&(
            column,
            it.kernel(),
            sha256(&code.bytes),
            &code.entry_point,
            &code.places,
            &it.hash,
            rules::of(it.kernel(), column, it.flushed.is_some()),
            versions,
        ))
    }

    /// Runs what is left of a column's queue.
    fn column(&self, column: Column, queue: &[Unit<'_>], next: &Mutex<usize>, line: usize) -> Ran {
        let folder = self.work.join(format!("{column}-{line}"));
        let mut engine = Engine {
            shared: self,
            column,
            folder,
            runner: None,
            device: None,
        };
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
                judge(unit.it, column, Some(unit.code), results, began.elapsed())
            });
            let settled = matches!(
                cell.outcome,
                Outcome::Passed
                    | Outcome::Differs
                    | Outcome::Lacking { .. }
                    | Outcome::Foreign {
                        failure: Failure::Refused { .. }
                    }
            );
            if settled {
                self.cache.put(&self.key(column, unit.it, unit.code), &cell);
            }
            found.push((unit.row, cell));
            let left = {
                let mut left = locked(&self.left);
                *left -= 1;
                *left
            };
            (self.progress)(&format!(
                "{left} cells left; {column}: {}",
                unit.it.kernel().name
            ));
        }
        Ran {
            column,
            device: engine.device,
            cells: found,
        }
    }
}

/// Compares results with the reference.
fn judge(
    it: &Ready<'_>,
    column: Column,
    code: Option<&Code>,
    results: Result<Vec<Written>, Failure>,
    took: Duration,
) -> Cell {
    let kernel = it.kernel();
    let rules: Rules = rules::of(kernel, column, it.flushed.is_some());
    let mut cell = Cell {
        outcome: Outcome::Passed,
        rules: Some(rules.clone()),
        found: None,
        line: None,
        seconds: took.as_secs_f64(),
    };
    let text = code.map(|code| String::from_utf8_lossy(&code.bytes));
    match (results, it.reference_for(column)) {
        (Err(Failure::Lacks { what }), _) => cell.outcome = Outcome::Lacking { what },
        (Err(failure), _) => {
            cell.line = text
                .as_deref()
                .and_then(|text| locate::of_message(text, &failure.to_string()));
            cell.outcome = Outcome::Foreign { failure };
        }
        (Ok(results), Ok(reference)) => {
            let numbers = Numbers::of(kernel);
            let mut found = Found::default();
            for ((case, a), b) in it.prepared.cases.iter().zip(reference).zip(&results) {
                numbers.compare(case, &rules, a, b, &mut found);
            }
            if found.beyond > 0 {
                cell.outcome = Outcome::Differs;
                cell.line =
                    text.as_deref()
                        .zip(found.first.as_ref())
                        .and_then(|(text, difference)| {
                            locate::of_output(text, kernel, code?, &difference.value)
                        });
            }
            cell.found = Some(found);
        }
        (Ok(_), Err(problem)) => {
            cell.outcome = Outcome::Foreign {
                failure: Failure::refused(problem.clone()),
            };
        }
    }
    cell
}

/// What runs a column's kernels, one after the other.
struct Engine<'a> {
    shared: &'a Shared<'a>,
    column: Column,
    folder: PathBuf,
    runner: Option<Runner>,
    device: Option<String>,
}

impl Engine<'_> {
    fn run(&mut self, unit: &Unit<'_>) -> Result<Vec<Written>, Failure> {
        let io = |what: &str, e: std::io::Error| Failure::refused(format!("{what}: {e}"));
        let kernel = unit.it.kernel();
        let extension = self.column.language().map_or("", |l| l.name());
        let folder = self.folder.join(&kernel.name);
        fs::create_dir_all(&folder).map_err(|e| io("making a folder for the work", e))?;
        let code = folder.join(format!("{}.{extension}", kernel.name));
        fs::write(&code, &unit.code.bytes).map_err(|e| io("writing the code", e))?;
        let results = folder.join("results");
        let mut job = unit
            .it
            .prepared
            .job(kernel, unit.code, &code, &unit.it.inputs, &results)
            .map_err(Failure::refused)?;
        job.id = unit.row as u64 + 1;
        let done = self.execute(&job, kernel, &folder);
        let bytes =
            done.and_then(|()| fs::read(&results).map_err(|e| io("the runner left no results", e)));
        // The work's folder would otherwise hold the results of all kernels at once.
        let _ = fs::remove_dir_all(&folder);
        unit.it
            .prepared
            .results(kernel, &bytes?)
            .map_err(Failure::refused)
    }

    fn execute(&mut self, job: &Job, kernel: &Kernel, folder: &Path) -> Result<(), Failure> {
        let limit = self.shared.request.limit;
        let tools = &self.shared.request.tools;
        let out = folder.join("compiled.spv");
        let missing = |tool: Tool| Failure::refused(format!("{} is gone", tool.name()));
        let compiled = match self.column {
            Column::Glsl => {
                let glslang = tools.glslang().ok_or_else(|| missing(Tool::Glslang))?;
                Some(compile::glsl(&glslang, job, &out, limit)?)
            }
            Column::HlslGlslang => {
                let glslang = tools.glslang().ok_or_else(|| missing(Tool::Glslang))?;
                Some(compile::hlsl_glslang(&glslang, job, &out, limit)?)
            }
            Column::HlslDxc => {
                let dxc: Dxc = tools.dxc().map_err(Failure::refused)?;
                Some(compile::hlsl_dxc(&dxc, job, &out, limit)?)
            }
            Column::Msl => {
                let clang = tools.clang().ok_or_else(|| missing(Tool::Clang))?;
                let shared = self.shared.work.join("msl");
                fs::create_dir_all(&shared)
                    .map_err(|e| Failure::refused(format!("making a folder: {e}")))?;
                return msl::run(&clang, &shared, job, limit);
            }
            _ => None,
        };
        let way = match self.column {
            Column::SpirvNaga => Way::SpirvThroughNaga,
            Column::Wgsl => Way::Wgsl,
            _ => Way::Spirv,
        };
        let job = match compiled {
            None => job.clone(),
            Some(words) => {
                let adopted = folder.join("adopted.spv");
                fs::write(&adopted, words)
                    .map_err(|e| Failure::refused(format!("writing SPIR-V: {e}")))?;
                Job {
                    code: adopted,
                    entry_point: job.kernel.clone(),
                    ..job.clone()
                }
            }
        };
        let id = job.id;
        let foreign = matches!(
            self.column,
            Column::Essl310 | Column::Essl300 | Column::WgslDawn | Column::WgslChromium
        );
        if foreign {
            self.ask(&job, id)
        } else {
            let job = VulkanJob {
                job,
                description: kernel.clone(),
                way,
            };
            self.ask(&job, id)
        }
    }

    fn ask(&mut self, job: &impl serde::Serialize, id: u64) -> Result<(), Failure> {
        let limit = self.shared.request.limit;
        if self.runner.as_mut().is_none_or(|r| !r.lives()) {
            let mut command = self.command()?;
            let runner = Runner::start(&mut command, limit)?;
            self.device = Some(runner.ready.clone());
            self.runner = Some(runner);
        }
        let done = match &mut self.runner {
            // Runners that start something themselves have the same limit for that.
            Some(runner) => runner.ask(job, id, limit + Duration::from_secs(10)),
            None => Err(Failure::refused("there is no runner")),
        };
        if !matches!(done, Ok(()) | Err(Failure::Lacks { .. })) {
            // What one kernel broke is not the next one's: a driver may have lost its device.
            self.runner = None;
        }
        done
    }

    /// The command of this column's runner.
    fn command(&self) -> Result<Command, Failure> {
        let request = self.shared.request;
        let own = |mode: &str| {
            let mut command = Command::new(request.runner.first().map_or("".into(), |p| p.clone()));
            command.args(request.runner.iter().skip(1)).arg(mode);
            command
        };
        let swiftshader = || {
            request
                .tools
                .swiftshader()
                .ok_or_else(|| Failure::refused("SwiftShader is gone"))
        };
        let mut command = match self.column {
            Column::Essl310 | Column::Essl300 => own("gl"),
            Column::WgslDawn | Column::WgslChromium => {
                fs::create_dir_all(&self.folder)
                    .map_err(|e| Failure::refused(format!("making a folder: {e}")))?;
                webgpu::command(self.column, &request.tools, &self.folder, request.limit)
                    .map_err(Failure::refused)?
            }
            _ => own("vulkan"),
        };
        // Mesa's layer for choosing among several GPUs complains on a machine without a desktop.
        command.env("NODEVICE_SELECT", "1");
        if matches!(
            self.column,
            Column::SpirvSwiftshader | Column::WgslDawn | Column::WgslChromium
        ) {
            let driver = swiftshader()?;
            command.env("VK_DRIVER_FILES", &driver);
            command.env("VK_ICD_FILENAMES", &driver);
        }
        Ok(command)
    }
}
