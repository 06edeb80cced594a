//! Programs of others: started with a time limit, in a process group of their own, with all that
//! they say kept.

use std::io::{BufRead, BufReader, Read, Write};
use std::process::{Child, ChildStdin, Command, ExitStatus, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::job::{Kind, Reply};

/// How a program let us down.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, thiserror::Error)]
#[serde(rename_all = "snake_case", tag = "kind")]
pub enum Failure {
    /// It refused what it was given, or was not understood.
    #[error("{message}")]
    Refused {
        /// Its words.
        message: String,
    },
    /// The device lacks a feature that the code needs, and says so.
    #[error("the device lacks {what}")]
    Lacks {
        /// What.
        what: String,
    },
    /// It ended without an answer.
    #[error("{program} crashed: {how}\n{log}")]
    Crashed {
        /// Which program.
        program: String,
        /// Exit code or signal.
        how: String,
        /// What it said.
        log: String,
    },
    /// It gave no answer in time.
    #[error("{program} gave no answer in {seconds} s\n{log}")]
    TimedOut {
        /// Which program.
        program: String,
        /// The limit.
        seconds: u64,
        /// What it said until then.
        log: String,
    },
}

impl Failure {
    /// A refusal.
    pub fn refused(message: impl Into<String>) -> Self {
        Self::Refused {
            message: message.into(),
        }
    }
}

/// What is kept of a program's words: the end of them.
const KEPT: usize = 64 * 1024;

/// Text that grows in another thread.
#[derive(Clone, Debug, Default)]
struct Log(Arc<Mutex<String>>);

impl Log {
    fn text(&self) -> String {
        let text = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        text.trim_end().to_owned()
    }

    fn push(&self, more: &str) {
        let mut text = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        text.push_str(more);
        if text.len() > KEPT {
            let mut cut = text.len() - KEPT;
            while !text.is_char_boundary(cut) {
                cut += 1;
            }
            text.drain(..cut);
        }
    }

    fn follow(&self, mut from: impl Read + Send + 'static) -> thread::JoinHandle<()> {
        let log = self.clone();
        thread::spawn(move || {
            let mut bytes = [0; 4096];
            while let Ok(n @ 1..) = from.read(&mut bytes) {
                log.push(&String::from_utf8_lossy(&bytes[..n]));
            }
        })
    }
}

/// What a program that ended by itself left.
#[derive(Clone, Debug)]
pub struct Finished {
    /// Its exit status.
    pub status: ExitStatus,
    /// What it wrote to standard output.
    pub stdout: String,
    /// What it wrote to standard error.
    pub stderr: String,
}

impl Finished {
    /// All that it wrote.
    #[must_use]
    pub fn words(&self) -> String {
        format!("{}\n{}", self.stdout.trim_end(), self.stderr.trim_end())
            .trim()
            .to_owned()
    }

    /// Whether a signal ended it, and which.
    #[must_use]
    pub fn crash(&self) -> Option<String> {
        (self.status.code().is_none()).then(|| describe(self.status))
    }
}

/// `exit status: 1`, `signal: 11 (SIGSEGV)`.
fn describe(status: ExitStatus) -> String {
    status.to_string()
}

/// Starts a program in a group of its own.
fn start(command: &mut Command, program: &str) -> Result<Child, Failure> {
    #[cfg(unix)]
    std::os::unix::process::CommandExt::process_group(command, 0);
    command
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .map_err(|e| Failure::refused(format!("cannot start {program}: {e}")))
}

/// Ends a program and what it started.
fn kill(child: &mut Child) {
    if cfg!(unix) {
        // The group's number is the program's. What fails here has ended already.
        let _ = Command::new("kill")
            .args(["-KILL", "--", &format!("-{}", child.id())])
            .stderr(Stdio::null())
            .status();
    }
    let _ = child.kill();
    let _ = child.wait();
}

fn name(command: &Command) -> String {
    let program = std::path::Path::new(command.get_program());
    program
        .file_name()
        .unwrap_or(command.get_program())
        .to_string_lossy()
        .into_owned()
}

/// Runs a program to its end.
///
/// # Errors
/// [`Failure::TimedOut`]; [`Failure::Refused`] if it cannot be started. Its exit status is for the
/// caller to judge.
pub fn run(command: &mut Command, limit: Duration) -> Result<Finished, Failure> {
    let program = name(command);
    let mut child = start(command.stdin(Stdio::null()), &program)?;
    let (out, err) = (Log::default(), Log::default());
    let readers: Vec<_> = [
        child.stdout.take().map(|s| out.follow(s)),
        child.stderr.take().map(|s| err.follow(s)),
    ]
    .into_iter()
    .flatten()
    .collect();
    let began = Instant::now();
    let mut pause = Duration::from_millis(1);
    let status = loop {
        // What it has started may hold its pipes after its own end.
        let ended = match child.try_wait() {
            Ok(status) => status.filter(|_| readers.iter().all(|r| r.is_finished())),
            Err(e) => {
                kill(&mut child);
                return Err(Failure::refused(format!("cannot wait for {program}: {e}")));
            }
        };
        match ended {
            Some(status) => break status,
            None if began.elapsed() < limit => thread::sleep(pause),
            None => {
                kill(&mut child);
                return Err(Failure::TimedOut {
                    program,
                    seconds: limit.as_secs(),
                    log: format!("{}\n{}", out.text(), err.text()).trim().to_owned(),
                });
            }
        }
        pause = (pause * 2).min(Duration::from_millis(20));
    };
    Ok(Finished {
        status,
        stdout: out.text(),
        stderr: err.text(),
    })
}

/// A program that answers one job after the other, see [`crate::job`].
#[derive(Debug)]
pub struct Runner {
    program: String,
    child: Child,
    input: Option<ChildStdin>,
    lines: Receiver<String>,
    log: Log,
    /// What it runs on, in its words.
    pub ready: String,
}

impl Runner {
    /// Starts a runner and waits until it is ready.
    ///
    /// # Errors
    /// It ends or says something else first.
    pub fn start(command: &mut Command, limit: Duration) -> Result<Self, Failure> {
        let program = name(command);
        let mut child = start(command.stdin(Stdio::piped()), &program)?;
        let log = Log::default();
        if let Some(stderr) = child.stderr.take() {
            log.follow(stderr);
        }
        let (sender, lines) = channel();
        if let Some(stdout) = child.stdout.take() {
            thread::spawn(move || {
                for line in BufReader::new(stdout).lines() {
                    let Ok(line) = line else { break };
                    if sender.send(line).is_err() {
                        break;
                    }
                }
            });
        }
        let mut runner = Self {
            program,
            input: child.stdin.take(),
            child,
            lines,
            log,
            ready: String::new(),
        };
        let ready = runner.answer(limit, &|value| {
            Some(value.get("ready")?.as_str()?.to_owned())
        })?;
        runner.ready = ready;
        Ok(runner)
    }

    /// Has a job done.
    ///
    /// # Errors
    /// [`Failure::Refused`] or [`Failure::Lacks`] with the runner's words, or how it let us down.
    pub fn ask(&mut self, job: &impl Serialize, id: u64, limit: Duration) -> Result<(), Failure> {
        let mut line = serde_json::to_string(job)
            .map_err(|e| Failure::refused(format!("the job is no JSON: {e}")))?;
        line.push('\n');
        let written = self.input.as_mut().map(|input| {
            input
                .write_all(line.as_bytes())
                .and_then(|()| input.flush())
        });
        if !matches!(written, Some(Ok(()))) {
            return Err(self.crashed());
        }
        let reply = self.answer(limit, &|value| {
            let reply: Reply = serde_json::from_value(value.clone()).ok()?;
            (reply.id == id).then_some(reply)
        })?;
        let Some(message) = reply.error else {
            return Ok(());
        };
        let program = self.program.clone();
        Err(match reply.kind {
            Kind::Refused => Failure::Refused { message },
            Kind::Lacks => Failure::Lacks { what: message },
            Kind::Crashed => Failure::Crashed {
                program,
                how: message.lines().next().unwrap_or_default().into(),
                log: message,
            },
            Kind::TimedOut => Failure::TimedOut {
                program,
                seconds: limit.as_secs(),
                log: message,
            },
        })
    }

    /// Whether it still runs.
    pub fn lives(&mut self) -> bool {
        matches!(self.child.try_wait(), Ok(None))
    }

    /// Waits for a line that `take` takes; other lines are kept as words.
    fn answer<T>(
        &mut self,
        limit: Duration,
        take: &dyn Fn(&Value) -> Option<T>,
    ) -> Result<T, Failure> {
        let until = Instant::now() + limit;
        loop {
            let left = until.saturating_duration_since(Instant::now());
            match self.lines.recv_timeout(left) {
                Ok(line) => {
                    let taken = serde_json::from_str(&line).ok().as_ref().and_then(take);
                    if let Some(value) = taken {
                        return Ok(value);
                    }
                    self.log.push(&format!("{line}\n"));
                }
                Err(RecvTimeoutError::Timeout) => {
                    kill(&mut self.child);
                    return Err(Failure::TimedOut {
                        program: self.program.clone(),
                        seconds: limit.as_secs(),
                        log: self.log.text(),
                    });
                }
                Err(RecvTimeoutError::Disconnected) => return Err(self.crashed()),
            }
        }
    }

    /// It has closed its output: how it ended.
    fn crashed(&mut self) -> Failure {
        self.input = None;
        // It may still be on its way out.
        let until = Instant::now() + Duration::from_secs(2);
        let status = loop {
            match self.child.try_wait() {
                Ok(Some(status)) => break Some(status),
                Ok(None) if Instant::now() < until => thread::sleep(Duration::from_millis(10)),
                _ => break None,
            }
        };
        if status.is_none() {
            kill(&mut self.child);
        }
        Failure::Crashed {
            program: self.program.clone(),
            how: status.map_or_else(|| "it closed its output".into(), describe),
            log: self.log.text(),
        }
    }
}

impl Drop for Runner {
    fn drop(&mut self) {
        // A runner ends when its input does; a moment for it to tidy up.
        self.input = None;
        let until = Instant::now() + Duration::from_secs(3);
        while Instant::now() < until {
            match self.child.try_wait() {
                Ok(None) => thread::sleep(Duration::from_millis(5)),
                _ => return,
            }
        }
        kill(&mut self.child);
    }
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;

    fn shell(script: &str) -> Command {
        let mut command = Command::new("sh");
        command.args(["-c", script]);
        command
    }

    const SHORT: Duration = Duration::from_millis(300);
    const LONG: Duration = Duration::from_secs(20);

    #[test]
    fn words_and_status_are_kept() {
        let done = run(&mut shell("echo out; echo err >&2; exit 3"), LONG).unwrap();
        assert_eq!(done.status.code(), Some(3));
        assert_eq!((done.stdout.as_str(), done.stderr.as_str()), ("out", "err"));
        assert_eq!(done.crash(), None);
        let dead = run(&mut shell("kill -SEGV $$"), LONG).unwrap();
        assert!(dead.crash().unwrap().contains("11"), "{dead:?}");
    }

    #[test]
    fn a_hanging_program_is_ended_with_what_it_started() {
        // It waits for what it started, or leaves it behind with the pipes open.
        for script in ["echo begun; sleep 60 & wait", "echo begun; sleep 60 &"] {
            let began = Instant::now();
            let error = run(&mut shell(script), SHORT).unwrap_err();
            assert!(began.elapsed() < LONG);
            assert!(
                matches!(&error, Failure::TimedOut { log, .. } if log == "begun"),
                "{error:?}"
            );
        }
    }

    #[test]
    fn a_missing_program_is_an_error() {
        let error = run(&mut Command::new("no-such-program"), LONG).unwrap_err();
        assert!(error.to_string().contains("no-such-program"), "{error}");
    }

    const READY: &str = r#"echo '{"ready":"here"}'; "#;

    #[test]
    fn a_runner_answers() {
        let script = format!(
            r#"{READY} read a; echo noise; echo '{{"id":1}}'; read b; echo '{{"id":2,"error":"no"}}'; read c"#
        );
        let mut runner = Runner::start(&mut shell(&script), LONG).unwrap();
        assert_eq!(runner.ready, "here");
        runner.ask(&"job", 1, LONG).unwrap();
        assert_eq!(runner.ask(&"job", 2, LONG), Err(Failure::refused("no")));
        assert!(runner.lives());
    }

    #[test]
    fn a_runner_that_dies_or_hangs_is_told_apart() {
        let script = format!("{READY} read a; echo last words >&2; kill -SEGV $$");
        let mut runner = Runner::start(&mut shell(&script), LONG).unwrap();
        let error = runner.ask(&"job", 1, LONG).unwrap_err();
        assert!(
            matches!(&error, Failure::Crashed { how, log, .. } if how.contains("11") && log == "last words"),
            "{error:?}"
        );
        assert!(!runner.lives());

        let script = format!("{READY} read a; sleep 60");
        let mut runner = Runner::start(&mut shell(&script), LONG).unwrap();
        let error = runner.ask(&"job", 1, SHORT).unwrap_err();
        assert!(matches!(error, Failure::TimedOut { .. }), "{error:?}");
        assert!(!runner.lives());
    }
}
