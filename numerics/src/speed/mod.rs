//! How fast bounds are: every built-in kernel for bounds and their derivatives, in every precision,
//! scalar and on every instruction set, on one thread and on all, beside `diffmoments` and beside
//! what the machine could do at best.
//!
//! Everything that is compared takes turns, round after round, so that whatever else the machine
//! does disturbs all alike; what counts is the median. Times on one thread are processor time, since
//! a long call would be interrupted more often than a short one; on all cores, wall time. Kernels are called as any user calls them,
//! through their entry points, on rows in memory; `diffmoments` through its own functions on arrays
//! in memory, without allocations and without Python's overhead.

pub mod count;
mod errors;
mod machine;
pub(crate) mod native;
mod tables;
mod worker;

pub use errors::{ErrorOf, Quantiles};
pub use machine::{Bandwidth, Limits, Peak};
pub use worker::{Program, serve};

use std::path::PathBuf;
use std::time::Instant;

use hankel_dsl::native::lanes::{SCALAR, level_name, levels};
use hankel_dsl::native::{CallError, Mode};
use hankel_moments::MAX;
use hankel_system::temporary::Folder;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::families::{Family, Format, ORDERS, Precision, Row};
use crate::peer::{Peer, PeerError, Quantity};
use count::Operations;
use native::Native;
use worker::Worker;

/// The rows that speed is measured on.
pub const SPEED_FAMILY: &str = "paper";

/// Why nothing was measured.
#[derive(Debug, thiserror::Error)]
pub enum SpeedError {
    /// An order that there are no bounds for.
    #[error("there is no bound of order {0}: give n from 1 to {most}", most = MAX)]
    Order(usize),
    /// Nothing to measure with.
    #[error("{0} rows are too few: give at least {LEAST_ROWS}")]
    Rows(usize),
    /// No rounds to measure in.
    #[error("a median needs at least one round")]
    Rounds,
    /// A kernel that is not what is expected of it.
    #[error("kernel `{kernel}`: {problem}")]
    Kernel {
        /// Which.
        kernel: String,
        /// What is wrong.
        problem: String,
    },
    /// A kernel's call that did not run.
    #[error(transparent)]
    Call(#[from] CallError),
    /// The process for another instruction set.
    #[error("the process that measures with {0}: {1}")]
    Worker(&'static str, String),
    /// The process for the other implementation.
    #[error(transparent)]
    Peer(#[from] PeerError),
    /// A temporary file.
    #[error("a temporary file for the rows: {0}")]
    Io(#[from] std::io::Error),
}

/// The fewest rows that can be measured.
pub const LEAST_ROWS: usize = 16;

/// What to measure.
#[derive(Clone, Debug)]
pub struct Options {
    /// Orders n, from 1 to 6.
    pub orders: Vec<usize>,
    /// Rows of a call.
    pub rows: usize,
    /// Rounds in which everything has its turn.
    pub rounds: usize,
    /// Rows that errors are taken over.
    pub error_rows: usize,
    /// Seed of the rows.
    pub seed: u64,
    /// Small arrays and short runs where the machine's limits are measured.
    pub quick: bool,
    /// The interpreter that has `diffmoments`; `None` leaves it out.
    pub python: Option<PathBuf>,
    /// How to measure other instruction sets than this process uses; `None` leaves them out.
    pub worker: Option<Program>,
}

impl Options {
    /// A million rows in five rounds.
    #[must_use]
    pub fn full() -> Self {
        Self {
            orders: ORDERS.collect(),
            rows: 1_000_000,
            rounds: 5,
            error_rows: 20_000,
            seed: 1,
            quick: false,
            python: None,
            worker: None,
        }
    }

    /// A look in seconds: figures scatter.
    #[must_use]
    pub fn quick() -> Self {
        Self {
            rows: 20_000,
            rounds: 3,
            error_rows: 1000,
            quick: true,
            ..Self::full()
        }
    }
}

/// How a bound or its derivatives are computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Solver {
    /// The bound.
    Plain,
    /// The bound, with the ill-conditioned part in about twice the digits.
    Compensated,
    /// The derivatives.
    Adjoint,
    /// The derivatives, in about twice the digits; for n up to 3.
    CompensatedAdjoint,
    /// `diffmoments`: the bound.
    Peer,
    /// `diffmoments`: the bound, with roots kept for the derivatives.
    PeerRetained,
    /// `diffmoments`: the derivatives.
    PeerAdjoint,
    /// `diffmoments`: the derivatives from roots that were kept.
    PeerAdjointRetained,
}

impl Solver {
    /// Those of this project.
    pub const OWN: [Self; 4] = [
        Self::Plain,
        Self::Compensated,
        Self::Adjoint,
        Self::CompensatedAdjoint,
    ];
    /// Those of the other.
    pub const PEER: [Self; 4] = [
        Self::Peer,
        Self::PeerRetained,
        Self::PeerAdjoint,
        Self::PeerAdjointRetained,
    ];

    /// In words, as in tables.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Plain => "bound",
            Self::Compensated => "bound, compensated",
            Self::Adjoint => "adjoint",
            Self::CompensatedAdjoint => "adjoint, compensated",
            Self::Peer => "diffmoments bound",
            Self::PeerRetained => "diffmoments bound, roots retained",
            Self::PeerAdjoint => "diffmoments adjoint",
            Self::PeerAdjointRetained => "diffmoments adjoint, roots retained",
        }
    }

    /// Whether it is `diffmoments`.
    #[must_use]
    pub fn is_peer(self) -> bool {
        Self::PEER.contains(&self)
    }

    /// Whether it computes derivatives.
    #[must_use]
    pub const fn is_adjoint(self) -> bool {
        matches!(
            self,
            Self::Adjoint
                | Self::CompensatedAdjoint
                | Self::PeerAdjoint
                | Self::PeerAdjointRetained
        )
    }

    /// The built-in kernel's function.
    #[must_use]
    pub fn function(self, n: usize) -> Option<String> {
        match self {
            Self::Plain => Some(format!("moment_bound_n{n}")),
            Self::Compensated => Some(format!("moment_bound_compensated_n{n}")),
            Self::Adjoint => Some(format!("moment_bound_adjoint_n{n}")),
            Self::CompensatedAdjoint => Some(format!("moment_bound_adjoint_compensated_n{n}")),
            _ => None,
        }
    }
}

/// Run times of one thing.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Timing {
    /// What was run.
    pub solver: Solver,
    /// Of which order.
    pub n: usize,
    /// In which precision.
    pub precision: Precision,
    /// `scalar`, or the instruction set of the lanes; `library` for what this project did not
    /// compile.
    pub path: String,
    /// On how many threads.
    pub threads: usize,
    /// Nanoseconds for a row, of each call.
    pub times: Vec<f64>,
}

impl Timing {
    /// The median.
    #[must_use]
    pub fn median(&self) -> f64 {
        let mut sorted = self.times.clone();
        sorted.sort_by(f64::total_cmp);
        match sorted.len() {
            0 => f64::NAN,
            len if len % 2 == 1 => sorted[len / 2],
            len => f64::midpoint(sorted[len / 2 - 1], sorted[len / 2]),
        }
    }

    /// The shortest.
    #[must_use]
    pub fn least(&self) -> f64 {
        self.times.iter().copied().fold(f64::INFINITY, f64::min)
    }
}

/// What a kernel does for a row.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Work {
    /// The kernel.
    pub solver: Solver,
    /// Its order.
    pub n: usize,
    /// Its precision.
    pub precision: Precision,
    /// Bytes read and written.
    pub bytes: usize,
    /// Operations as rows run together in lanes.
    pub operations: Operations,
    /// Operations of a row that runs alone.
    pub needed: Operations,
}

/// All that was measured.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Speed {
    /// Rows of a call.
    pub rows: usize,
    /// Rounds.
    pub rounds: usize,
    /// Rows that errors were taken over.
    pub error_rows: usize,
    /// Seed of the rows.
    pub seed: u64,
    /// The instruction set that this process uses.
    pub level: String,
    /// The processor, as the system calls it.
    pub processor: String,
    /// `diffmoments` and its circumstances, if it was there.
    pub peer: Option<String>,
    /// The machine's limits.
    pub limits: Limits,
    /// Run times.
    pub timings: Vec<Timing>,
    /// Bytes and operations.
    pub work: Vec<Work>,
    /// Errors.
    pub errors: Vec<ErrorOf>,
}

/// What has its turn in each round.
#[derive(Clone, Copy)]
enum Contestant {
    /// A kernel in this process: its number, and how it is run.
    Here(usize, Mode),
    /// A kernel in another process: the process's number and the kernel's there.
    There(usize, usize),
    /// `diffmoments`: what, and whether with retained roots.
    Peer(Quantity, bool),
}

/// Where a turn's calls are repeated until, so that short calls are measured as long as long ones.
const TURN_SECONDS: f64 = 0.02;
/// But not more often than this.
const TURN_CALLS: usize = 25;

/// Measures what `options` ask for; `progress` is told what goes on.
///
/// # Errors
///
/// Options make no sense; `diffmoments` was asked for and is not there; a process that measures
/// ends.
pub fn measure(options: &Options, progress: &mut dyn FnMut(&str)) -> Result<Speed, SpeedError> {
    if let Some(n) = options.orders.iter().find(|n| !ORDERS.contains(*n)) {
        return Err(SpeedError::Order(*n));
    }
    let fewest = options.rows.min(options.error_rows);
    if fewest < LEAST_ROWS {
        return Err(SpeedError::Rows(fewest));
    }
    if options.rounds == 0 {
        return Err(SpeedError::Rounds);
    }
    // What is missing shows before the long work starts.
    let mut peer = options.python.as_ref().map(Peer::start).transpose()?;
    let mut workers = Vec::new();
    if let Some(program) = &options.worker {
        for (name, _) in levels().into_iter().filter(|(n, _)| *n != level_name()) {
            workers.push(Worker::start(program, name)?);
        }
    }
    progress("Measuring memory and arithmetic");
    let limits = Limits::measure(options.quick);
    let mut run = Run {
        options,
        workers,
        timings: Vec::new(),
        work: Vec::new(),
        errors: Vec::new(),
        threads: limits.threads,
    };
    for &n in &options.orders {
        run.order::<f32>(n, peer.as_mut(), progress)?;
        run.order::<f64>(n, peer.as_mut(), progress)?;
    }
    Ok(Speed {
        rows: options.rows,
        rounds: options.rounds,
        error_rows: options.error_rows,
        seed: options.seed,
        level: level_name().into(),
        processor: processor(),
        peer: peer.map(|peer| {
            let pinned = peer.cpu.map_or_else(
                || "not pinned: its threads, if any, count as one".into(),
                |cpu| format!("pinned to core {cpu}"),
            );
            format!("{}, numpy {}, {pinned}", peer.name(), peer.numpy)
        }),
        limits,
        timings: run.timings,
        work: run.work,
        errors: run.errors,
    })
}

struct Run<'a> {
    options: &'a Options,
    workers: Vec<Worker>,
    timings: Vec<Timing>,
    work: Vec<Work>,
    errors: Vec<ErrorOf>,
    threads: usize,
}

impl Run<'_> {
    /// One order in one precision.
    fn order<T: Format>(
        &mut self,
        n: usize,
        mut peer: Option<&mut Peer>,
        progress: &mut dyn FnMut(&str),
    ) -> Result<(), SpeedError> {
        progress(&format!("n = {n}, {}: rows", T::PRECISION));
        let rows = rows_of::<T>(SPEED_FAMILY, n, self.options.seed, self.options.rows);
        if let Some(peer) = &mut peer {
            peer.load(n, &rows)?;
        }
        let own: Vec<(Solver, String)> = Solver::OWN
            .into_iter()
            .filter_map(|solver| Some((solver, solver.function(n)?)))
            .filter(|(_, function)| native::exists(function, T::PRECISION))
            .collect();
        let mut kernels = own
            .iter()
            .map(|(_, function)| Native::new(function, &rows))
            .collect::<Result<Vec<_>, _>>()?;
        for ((solver, function), kernel) in own.iter().zip(&kernels) {
            self.work
                .extend(work_of::<T>(*solver, function, n, kernel.bytes_per_row()));
        }
        let mut contestants = self.hand_over::<T>(n, &own, &kernels)?;
        if peer.is_some() {
            for solver in Solver::PEER {
                let (quantity, retained) = match solver {
                    Solver::Peer => (Quantity::Bound, false),
                    Solver::PeerRetained => (Quantity::Bound, true),
                    Solver::PeerAdjoint => (Quantity::Gradient, false),
                    _ => (Quantity::Gradient, true),
                };
                contestants.push((
                    Timing::new::<T>(solver, n, "library", 1),
                    Contestant::Peer(quantity, retained),
                ));
            }
        }
        // Round 0 warms up: pages, caches, clocks.
        for round in 0..=self.options.rounds {
            progress(&format!(
                "n = {n}, {}: round {round} of {}",
                T::PRECISION,
                self.options.rounds
            ));
            for (timing, contestant) in &mut contestants {
                let turn = Instant::now();
                for _ in 0..TURN_CALLS {
                    let seconds = match *contestant {
                        Contestant::Here(kernel, mode) => kernels[kernel].time(mode)?,
                        Contestant::There(worker, kernel) => self.workers[worker].time(kernel)?,
                        Contestant::Peer(quantity, retained) => match &mut peer {
                            Some(peer) => peer.time(quantity, retained)?,
                            None => break,
                        },
                    };
                    if round > 0 {
                        timing.times.push(seconds * 1e9 / rows.len() as f64);
                    }
                    if round == 0 || turn.elapsed().as_secs_f64() > TURN_SECONDS {
                        break;
                    }
                }
            }
        }
        self.timings
            .extend(contestants.into_iter().map(|(timing, _)| timing));
        drop((kernels, rows));
        progress(&format!("n = {n}, {}: errors", T::PRECISION));
        self.errors.extend(errors::measure::<T>(
            n,
            &own,
            self.options.error_rows,
            self.options.seed,
            peer,
        )?);
        Ok(())
    }

    /// Every way to run the kernels; the other processes get theirs.
    fn hand_over<T: Format>(
        &mut self,
        n: usize,
        own: &[(Solver, String)],
        kernels: &[Native],
    ) -> Result<Vec<(Timing, Contestant)>, SpeedError> {
        let mut contestants = Vec::new();
        for (i, (solver, _)) in own.iter().enumerate() {
            let ways = [(SCALAR, false), (level_name(), true)];
            for (path, lanes) in ways
                .into_iter()
                .filter(|(name, lanes)| *lanes == (*name != SCALAR))
            {
                for (threads, parallel) in [(1, false), (self.threads, true)] {
                    // On one core both are the same; scalar on all is nobody's choice.
                    if !parallel || (lanes && threads > 1) {
                        contestants.push((
                            Timing::new::<T>(*solver, n, path, threads),
                            Contestant::Here(
                                i,
                                Mode {
                                    lanes,
                                    parallel,
                                    ..Mode::REFERENCE
                                },
                            ),
                        ));
                    }
                }
            }
        }
        if self.workers.is_empty() {
            return Ok(contestants);
        }
        let folder = Folder::new()?;
        for worker in &mut self.workers {
            worker.clear()?;
        }
        for (i, ((solver, function), kernel)) in own.iter().zip(kernels).enumerate() {
            let path = folder.path().join("elements");
            std::fs::write(&path, kernel.elements())?;
            for (w, worker) in self.workers.iter_mut().enumerate() {
                worker.load(function, T::PRECISION, self.options.rows, path.clone())?;
                contestants.push((
                    Timing::new::<T>(*solver, n, worker.level, 1),
                    Contestant::There(w, i),
                ));
            }
        }
        Ok(contestants)
    }
}

impl Timing {
    fn new<T: Format>(solver: Solver, n: usize, path: &str, threads: usize) -> Self {
        Self {
            solver,
            n,
            precision: T::PRECISION,
            path: path.into(),
            threads,
            times: Vec::new(),
        }
    }
}

/// Rows of a family; none if there is no such family.
fn rows_of<T: Format>(family: &str, n: usize, seed: u64, count: usize) -> Vec<Row<T>> {
    Family::named(family).map_or_else(Vec::new, |family| {
        (0..count as u64)
            .into_par_iter()
            .map(|i| family.row(n, seed, i))
            .collect()
    })
}

/// Rows that operations are counted on. How often loops for roots turn depends on the row.
const COUNTED_ROWS: usize = 16 * count::TOGETHER;

fn work_of<T: Format>(solver: Solver, function: &str, n: usize, bytes: usize) -> Option<Work> {
    let rows = rows_of::<f32>(SPEED_FAMILY, n, 0, COUNTED_ROWS);
    Some(Work {
        solver,
        n,
        precision: T::PRECISION,
        bytes,
        operations: count::per_row(function, n, &rows, false)?,
        needed: count::per_row(function, n, &rows, true)?,
    })
}

/// The processor's name, where the system tells it.
fn processor() -> String {
    let text = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    text.lines()
        .find_map(|line| line.strip_prefix("model name")?.split_once(':'))
        .map_or_else(
            || std::env::consts::ARCH.into(),
            |(_, name)| name.trim().to_owned(),
        )
}
