//! Programs of others: started with a time limit, in a process group of their own, with all that
//! they say kept.

use std::io::{BufRead, BufReader, Read, Write};
use std::process::{ChildStdin, Command, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel, sync_channel};
use std::thread;
use std::time::{Duration, Instant};

pub use hankel_system::process::Finished;
use hankel_system::process::{Log, Program, kill_group};
use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::job::{Driver, Kind, Reply};

/// How a program failed.
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

impl From<hankel_system::process::Failure> for Failure {
    fn from(failure: hankel_system::process::Failure) -> Self {
        use hankel_system::process::Failure as F;
        match failure {
            F::System { .. } => Self::refused(failure.to_string()),
            F::TimedOut {
                program,
                seconds,
                words,
            } => Self::TimedOut {
                program,
                seconds,
                log: words,
            },
        }
    }
}

/// Runs a program to its end.
///
/// # Errors
/// [`Failure::TimedOut`]; [`Failure::Refused`] if it cannot be started. Its exit status is for the
/// caller to judge.
pub fn run(command: &mut Command, limit: Duration) -> Result<Finished, Failure> {
    Ok(hankel_system::process::run(command, limit)?)
}

/// Lines of a runner that nobody has asked for yet: more wait in its pipe.
const MOST_LINES: usize = 64;

/// Bytes of the longest line that a runner may write.
const MOST_BYTES: u64 = 64 << 20;

/// A program that answers one job after the other, see [`crate::job`].
#[derive(Debug)]
pub struct Runner {
    program: Program,
    input: Option<ChildStdin>,
    lines: Receiver<String>,
    log: Log,
    /// What it runs on.
    pub driver: Driver,
}

impl Runner {
    /// Starts a runner and waits until it is ready.
    ///
    /// # Errors
    /// It ends or says something else first.
    pub fn start(command: &mut Command, limit: Duration) -> Result<Self, Failure> {
        command
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped());
        let mut program = Program::start(command).map_err(|e| {
            let name = hankel_system::process::name(command);
            Failure::refused(format!("cannot start {name}: {e}"))
        })?;
        let log = Log::default();
        if let Some(stderr) = program.child.stderr.take() {
            log.follow(stderr)
                .map_err(|e| Failure::refused(format!("cannot follow a program: {e}")))?;
        }
        let (sender, lines) = sync_channel(MOST_LINES);
        if let Some(stdout) = program.child.stdout.take() {
            thread::spawn(move || {
                let mut stdout = BufReader::new(stdout);
                loop {
                    let mut line = Vec::new();
                    let read = stdout
                        .by_ref()
                        .take(MOST_BYTES)
                        .read_until(b'\n', &mut line);
                    // One that is longer ends here, and the rest is no answer.
                    let is_whole = line.ends_with(b"\n") || (line.len() as u64) < MOST_BYTES;
                    let line = String::from_utf8_lossy(&line);
                    if !matches!(read, Ok(1..))
                        || !is_whole
                        || sender.send(line.trim_end().to_owned()).is_err()
                    {
                        break;
                    }
                }
            });
        }
        let mut runner = Self {
            input: program.child.stdin.take(),
            program,
            lines,
            log,
            driver: Driver::default(),
        };
        runner.driver = runner.answer(limit, limit, &|value| Driver::deserialize(value).ok())?;
        Ok(runner)
    }

    /// Has a job done.
    ///
    /// # Errors
    /// [`Failure::Refused`] or [`Failure::Lacks`] with the runner's words, or how it failed.
    pub fn ask(&mut self, job: &impl Serialize, id: u64, limit: Duration) -> Result<(), Failure> {
        let mut line = serde_json::to_string(job)
            .map_err(|e| Failure::refused(format!("the job is no JSON: {e}")))?;
        line.push('\n');
        let until = Instant::now() + limit;
        // A runner that does not read lets this wait.
        let (done, waits) = channel::<()>();
        let group = self.program.group();
        let watch = thread::spawn(move || {
            let is_late = waits.recv_timeout(limit) == Err(RecvTimeoutError::Timeout);
            if is_late {
                kill_group(group);
            }
            is_late
        });
        let written = self.input.as_mut().map(|input| {
            input
                .write_all(line.as_bytes())
                .and_then(|()| input.flush())
        });
        drop(done);
        if watch.join().unwrap_or(false) {
            return Err(self.is_late(limit));
        }
        if !matches!(written, Some(Ok(()))) {
            return Err(self.crashed());
        }
        let left = until.saturating_duration_since(Instant::now());
        let reply = self.answer(left, limit, &|value| {
            let reply: Reply = serde_json::from_value(value.clone()).ok()?;
            (reply.id == id).then_some(reply)
        })?;
        let Some(message) = reply.error else {
            return Ok(());
        };
        let program = self.program.name().to_owned();
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
        matches!(self.program.try_wait(), Ok(None))
    }

    /// Waits for a line that `take` takes, for what is left of the limit; other lines are kept as words.
    fn answer<T>(
        &mut self,
        left: Duration,
        limit: Duration,
        take: &dyn Fn(&Value) -> Option<T>,
    ) -> Result<T, Failure> {
        let until = Instant::now() + left;
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
                Err(RecvTimeoutError::Timeout) => return Err(self.is_late(limit)),
                Err(RecvTimeoutError::Disconnected) => return Err(self.crashed()),
            }
        }
    }

    /// It has had its time: it ends.
    fn is_late(&mut self, limit: Duration) -> Failure {
        self.program.kill();
        Failure::TimedOut {
            program: self.program.name().to_owned(),
            seconds: limit.as_secs(),
            log: self.log.text(),
        }
    }

    /// It has closed its output: how it ended.
    fn crashed(&mut self) -> Failure {
        self.input = None;
        // It may still be on its way out.
        let status = self.program.wait_for(Duration::from_secs(2));
        let status = status.ok().flatten();
        if status.is_none() {
            self.program.kill();
        }
        Failure::Crashed {
            program: self.program.name().to_owned(),
            how: status.map_or_else(|| "it closed its output".into(), |s| s.to_string()),
            log: self.log.last_words(),
        }
    }
}

impl Drop for Runner {
    fn drop(&mut self) {
        // A runner ends when its input does; a moment for it to tidy up.
        self.input = None;
        let _ = self.program.wait_for(Duration::from_secs(3));
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
    fn a_program_that_hangs_or_is_missing_is_a_failure() {
        let error = run(&mut shell("echo begun; sleep 60"), SHORT).unwrap_err();
        assert!(
            matches!(&error, Failure::TimedOut { log, .. } if log == "begun"),
            "{error:?}"
        );
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
        let driver = Driver {
            name: "here".into(),
            ..Driver::default()
        };
        assert_eq!(runner.driver, driver);
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
