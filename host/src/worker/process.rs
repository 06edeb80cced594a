//! One worker, from the side of who asks.

use std::io::{self, BufReader, BufWriter, Write};
use std::path::Path;
use std::process::{ChildStdin, ChildStdout, Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::thread;
use std::time::Duration;

use hankel_dsl::native::call::Ending;
use hankel_dsl::native::describe::Kernel;
use hankel_dsl::native::inputs::{Given, Request};
use hankel_dsl::native::{Call, CallError};
use hankel_system::process::{Log, Program, kill_group};

use super::frame::{Answer, Asked, read_header, read_results, write_call, write_header};
use super::{STACK, Worker, ending};

/// A worker that runs.
#[derive(Debug)]
pub(super) struct Process {
    program: Program,
    requests: BufWriter<ChildStdin>,
    answers: BufReader<ChildStdout>,
    log: Log,
}

/// How long a plug-in may take to be loaded and to describe itself.
const LOADING: Duration = Duration::from_secs(60);

impl Process {
    pub fn start(worker: &Worker, library: &Path) -> Result<(Self, Vec<Kernel>), String> {
        let mut command = Command::new(&worker.program);
        command
            .args(&worker.arguments)
            .arg(library)
            // Of every thread that it starts.
            .env("RUST_MIN_STACK", STACK.to_string())
            .env("RUST_BACKTRACE", "0")
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped());
        let mut program = Program::start(&mut command).map_err(|e| {
            format!(
                "cannot start a process to run it in ({}): {e}",
                worker.program.display()
            )
        })?;
        let log = Log::default();
        if let Some(stderr) = program.child.stderr.take() {
            log.follow(stderr)
                .map_err(|e| format!("cannot read the messages of its process: {e}"))?;
        }
        let pipes = (program.child.stdin.take(), program.child.stdout.take());
        let (Some(requests), Some(answers)) = pipes else {
            unreachable!("both streams are piped")
        };
        let mut process = Self {
            program,
            requests: BufWriter::with_capacity(1 << 16, requests),
            answers: BufReader::with_capacity(1 << 16, answers),
            log,
        };
        let answer = process.within(LOADING, |process| read_header(&mut process.answers));
        match answer {
            Ok(Some(Answer::Kernels(kernels))) => Ok((process, kernels)),
            Ok(Some(Answer::Failed(problem))) => Err(problem),
            other => Err(format!(
                "cannot read its kernel descriptions: the process {}",
                process.ended(other.is_err_and(|late| late), LOADING)
            )),
        }
    }

    pub fn call(
        &mut self,
        index: usize,
        call: &mut Call<'_>,
        limit: Duration,
    ) -> Result<(), CallError> {
        let answer = self.within(limit, |process| {
            write_call(&mut process.requests, index, call)?;
            let answer = read_header(&mut process.answers)?;
            if let Some(Answer::Done) = answer {
                read_results(&mut process.answers, call)?;
            }
            Ok(answer)
        });
        match answer {
            Ok(Some(Answer::Done)) => Ok(()),
            Ok(Some(Answer::Failed(message))) => Err(CallError::Plugin { message }),
            other => Err(CallError::Ended {
                how: self.ended(other.is_err_and(|late| late), limit),
                culprit: None,
            }),
        }
    }

    /// The inputs that an entry point has of its own.
    pub fn inputs(
        &mut self,
        kernel: usize,
        request: &Request,
        limit: Duration,
    ) -> Result<Option<Vec<Given>>, CallError> {
        let request = request.clone();
        let answer = self.within(limit, |process| {
            write_header(&mut process.requests, &Asked::Inputs { kernel, request })?;
            process.requests.flush()?;
            read_header(&mut process.answers)
        });
        match answer {
            Ok(Some(Answer::Inputs(given))) => Ok(given),
            Ok(Some(Answer::Failed(message))) => Err(CallError::Plugin { message }),
            other => Err(CallError::Ended {
                how: self.ended(other.is_err_and(|late| late), limit),
                culprit: None,
            }),
        }
    }

    /// Does something with the worker that may block, but ends the worker after a time. The error
    /// is whether it was too late; else the pipe broke.
    fn within<T>(
        &mut self,
        limit: Duration,
        work: impl FnOnce(&mut Self) -> io::Result<T>,
    ) -> Result<T, bool> {
        let (done, wait) = channel::<()>();
        let late = AtomicBool::new(false);
        let group = self.program.group();
        let result = thread::scope(|scope| {
            let late = &late;
            let watch = move || {
                if wait.recv_timeout(limit) == Err(RecvTimeoutError::Timeout) {
                    late.store(true, Ordering::Relaxed);
                    kill_group(group);
                }
            };
            let watched = thread::Builder::new().spawn_scoped(scope, watch);
            let result = watched.and_then(|_| work(self));
            drop(done);
            result
        });
        match result {
            Ok(value) if !late.load(Ordering::Relaxed) => Ok(value),
            _ => Err(late.into_inner()),
        }
    }

    /// How it ended.
    fn ended(&mut self, late: bool, limit: Duration) -> Ending {
        if late {
            return Ending::TimedOut {
                seconds: limit.as_secs(),
            };
        }
        let status = self.program.wait_for(Duration::from_secs(2));
        ending(status.ok().flatten(), &self.log.last_words())
    }
}
