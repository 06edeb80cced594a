//! Programs of others: each in a process group of its own, so that it can be ended with all that
//! it has started, and with a time limit.

use std::io::{self, Read};
use std::path::Path;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use crate::signals::ours;

/// A program that runs, and ends with this: when it is dropped, or when the command is
/// interrupted.
#[derive(Debug)]
pub struct Program {
    /// Its name, for messages.
    name: String,
    /// The process, whose pipes may be taken. To wait for it or to end it, use the methods.
    pub child: Child,
    ended: bool,
}

impl Program {
    /// Starts a program in a group of its own.
    ///
    /// # Errors
    /// The system's words: it is not there, or cannot be run.
    pub fn start(command: &mut Command) -> io::Result<Self> {
        #[cfg(unix)]
        std::os::unix::process::CommandExt::process_group(command, 0);
        let mut busy = 50;
        let child = loop {
            let mut ours = ours();
            match command.spawn() {
                // A program that was written a moment ago: another thread's child has inherited the
                // file while it was open, and not let go of it yet.
                Err(error) if error.kind() == io::ErrorKind::ExecutableFileBusy && busy > 0 => {
                    drop(ours);
                    busy -= 1;
                    thread::sleep(Duration::from_millis(10));
                }
                started => {
                    let child = started?;
                    ours.groups.insert(child.id());
                    break child;
                }
            }
        };
        Ok(Self {
            name: name(command),
            child,
            ended: false,
        })
    }

    /// The program's file name.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Its group, for [`kill_group`].
    #[must_use]
    pub fn group(&self) -> u32 {
        self.child.id()
    }

    /// How it ended, if it did.
    ///
    /// # Errors
    /// The system's words.
    pub fn try_wait(&mut self) -> io::Result<Option<ExitStatus>> {
        let status = self.child.try_wait()?;
        self.ended |= status.is_some();
        Ok(status)
    }

    /// Waits for its end.
    ///
    /// # Errors
    /// The system's words.
    pub fn wait(&mut self) -> io::Result<ExitStatus> {
        let status = self.child.wait()?;
        self.ended = true;
        Ok(status)
    }

    /// Waits for its end, but not for longer than this.
    ///
    /// # Errors
    /// The system's words.
    pub fn wait_for(&mut self, limit: Duration) -> io::Result<Option<ExitStatus>> {
        let until = Instant::now() + limit;
        let mut pause = Duration::from_millis(1);
        loop {
            let status = self.try_wait()?;
            if status.is_some() || Instant::now() >= until {
                return Ok(status);
            }
            thread::sleep(pause);
            pause = (pause * 2).min(Duration::from_millis(20));
        }
    }

    /// Ends it and what it has started.
    pub fn kill(&mut self) {
        kill_group(self.child.id());
        // Where there are no groups; what fails here has ended already.
        let _ = self.child.kill();
        let _ = self.child.wait();
        self.ended = true;
    }
}

impl Drop for Program {
    fn drop(&mut self) {
        if !self.ended {
            self.kill();
        }
        ours().groups.remove(&self.child.id());
    }
}

/// Ends a process group of a [`Program`] that still lives, from any thread.
pub fn kill_group(leader: u32) {
    #[cfg(unix)]
    {
        use rustix::process::{Pid, Signal, kill_process_group};
        let group = i32::try_from(leader).ok().and_then(Pid::from_raw);
        if let Some(group) = group {
            // What is gone already needs no ending.
            let _ = kill_process_group(group, Signal::KILL);
        }
    }
    #[cfg(not(unix))]
    let _ = leader;
}

/// The file name of the program that a command starts.
#[must_use]
pub fn name(command: &Command) -> String {
    let program = command.get_program();
    Path::new(program)
        .file_name()
        .unwrap_or(program)
        .to_string_lossy()
        .into_owned()
}

/// What is kept of a program's words: the end of them, in bytes.
const KEPT: usize = 64 * 1024;

/// Text that grows in another thread; only its end is kept, 64 KiB.
#[derive(Clone, Debug, Default)]
pub struct Log {
    words: Arc<Mutex<String>>,
    /// Pipes that are not at their end.
    open: Arc<AtomicUsize>,
}

impl Log {
    /// What there is so far, without empty lines at the end.
    #[must_use]
    pub fn text(&self) -> String {
        let text = self.words.lock().unwrap_or_else(PoisonError::into_inner);
        text.trim_end().to_owned()
    }

    /// The same of a program that has ended: waits up to a second for what is still in its pipes.
    #[must_use]
    pub fn last_words(&self) -> String {
        let until = Instant::now() + Duration::from_secs(1);
        while self.open.load(Ordering::Acquire) > 0 && Instant::now() < until {
            thread::sleep(Duration::from_millis(1));
        }
        self.text()
    }

    /// Appends.
    pub fn push(&self, more: &str) {
        let mut text = self.words.lock().unwrap_or_else(PoisonError::into_inner);
        text.push_str(more);
        if text.len() > KEPT {
            let mut cut = text.len() - KEPT;
            while !text.is_char_boundary(cut) {
                cut += 1;
            }
            text.drain(..cut);
        }
    }

    /// Appends all that comes from a pipe, in a thread that ends with it.
    ///
    /// # Errors
    /// The system lets no more threads be made.
    pub fn follow(
        &self,
        mut from: impl Read + Send + 'static,
    ) -> io::Result<thread::JoinHandle<()>> {
        let log = self.clone();
        self.open.fetch_add(1, Ordering::AcqRel);
        let reader = thread::Builder::new().spawn(move || {
            let mut bytes = [0; 4096];
            while let Ok(n @ 1..) = from.read(&mut bytes) {
                log.push(&String::from_utf8_lossy(&bytes[..n]));
            }
            log.open.fetch_sub(1, Ordering::AcqRel);
        });
        if reader.is_err() {
            self.open.fetch_sub(1, Ordering::AcqRel);
        }
        reader
    }
}

/// What a program that ended by itself left.
#[derive(Clone, Debug)]
pub struct Finished {
    /// Its exit status.
    pub status: ExitStatus,
    /// The end of what it wrote to standard output, at most 64 KiB.
    pub stdout: String,
    /// The same of standard error.
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
        (self.status.code().is_none()).then(|| self.status.to_string())
    }
}

/// Why a program did not run to its end.
#[derive(Debug, thiserror::Error)]
pub enum Failure {
    /// It cannot be started or waited for.
    #[error("cannot {action} {program}: {source}")]
    System {
        /// `start`, `follow` or `wait for`.
        action: &'static str,
        /// Which program.
        program: String,
        /// The system's words.
        source: io::Error,
    },
    /// It was ended after its time.
    #[error("{program} gave no answer in {seconds} s")]
    TimedOut {
        /// Which program.
        program: String,
        /// The limit.
        seconds: u64,
        /// What it said until then.
        words: String,
    },
}

/// Runs a program to its end, without input, and keeps what it says.
///
/// # Errors
/// [`Failure`]. Its exit status is for the caller to judge.
pub fn run(command: &mut Command, limit: Duration) -> Result<Finished, Failure> {
    let program = name(command);
    let fail = |action| {
        let program = program.clone();
        move |source| Failure::System {
            action,
            program,
            source,
        }
    };
    command
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped());
    let mut running = Program::start(command).map_err(fail("start"))?;
    let (out, err) = (Log::default(), Log::default());
    let mut readers = Vec::new();
    if let (Some(stdout), Some(stderr)) = (running.child.stdout.take(), running.child.stderr.take())
    {
        readers.push(out.follow(stdout).map_err(fail("follow"))?);
        readers.push(err.follow(stderr).map_err(fail("follow"))?);
    }
    let until = Instant::now() + limit;
    let mut pause = Duration::from_millis(1);
    loop {
        let status = running.try_wait().map_err(fail("wait for"))?;
        // What it has started may hold its pipes after its own end.
        if let Some(status) = status
            && readers.iter().all(thread::JoinHandle::is_finished)
        {
            return Ok(Finished {
                status,
                stdout: out.text(),
                stderr: err.text(),
            });
        }
        if Instant::now() >= until {
            running.kill();
            return Err(Failure::TimedOut {
                program,
                seconds: limit.as_secs(),
                words: format!("{}\n{}", out.text(), err.text()).trim().to_owned(),
            });
        }
        thread::sleep(pause);
        pause = (pause * 2).min(Duration::from_millis(20));
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
                matches!(&error, Failure::TimedOut { words, .. } if words == "begun"),
                "{error:?}"
            );
        }
    }

    #[test]
    fn a_dropped_program_ends() {
        let mut program = Program::start(&mut shell("sleep 60 & wait")).unwrap();
        assert!(program.wait_for(SHORT).unwrap().is_none());
        let group = program.child.id();
        drop(program);
        let gone = |_: &u32| {
            let group = rustix::process::Pid::from_raw(group.cast_signed()).unwrap();
            rustix::process::test_kill_process_group(group).is_err()
        };
        // Orphans are reaped by the system, not by this process.
        let ended = (0..200).any(|n| {
            thread::sleep(Duration::from_millis(10));
            gone(&n)
        });
        assert!(ended);
    }

    #[test]
    fn a_missing_program_is_an_error() {
        let error = run(&mut Command::new("no-such-program"), LONG).unwrap_err();
        assert!(error.to_string().contains("no-such-program"), "{error}");
    }
}
