//! Programs of others: each in a process group of its own, so that it can be ended with all that
//! it has started, and with a time limit.

use std::io::{self, BufRead, BufReader, Read};
use std::path::{Path, PathBuf};
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
    /// Whether it has ended and its number may be another's.
    reaped: bool,
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
            reaped: false,
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

    /// How it ended, if it did. What it has started may still run.
    ///
    /// # Errors
    /// The system's words.
    pub fn try_wait(&mut self) -> io::Result<Option<ExitStatus>> {
        #[cfg(unix)]
        return status(self.child.id(), false);
        #[cfg(not(unix))]
        self.child.try_wait()
    }

    /// Waits for its end.
    ///
    /// # Errors
    /// The system's words.
    pub fn wait(&mut self) -> io::Result<ExitStatus> {
        #[cfg(unix)]
        if let Some(status) = status(self.child.id(), true)? {
            return Ok(status);
        }
        self.child.wait()
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
        self.reaped = true;
    }
}

impl Drop for Program {
    fn drop(&mut self) {
        if !self.reaped {
            self.kill();
        }
        ours().groups.remove(&self.child.id());
    }
}

/// How a child of this process ended, if it did; `waits` for that. It is not reaped: until it is, its number is that of
/// its group and of no other, and what it has started can be ended by it.
#[cfg(unix)]
fn status(child: u32, waits: bool) -> io::Result<Option<ExitStatus>> {
    use std::os::unix::process::ExitStatusExt;

    use rustix::process::{Pid, WaitId, WaitIdOptions, waitid};
    let Some(child) = i32::try_from(child).ok().and_then(Pid::from_raw) else {
        return Ok(None);
    };
    let mut options = WaitIdOptions::EXITED | WaitIdOptions::NOWAIT;
    options.set(WaitIdOptions::NOHANG, !waits);
    let found = rustix::io::retry_on_intr(|| waitid(WaitId::Pid(child), options))?;
    // As `wait` gives it: the exit code in the second byte, or the signal in the first.
    Ok(found.and_then(|it| {
        let code = it.exit_status().map(|code| (code & 0xff) << 8);
        let signal = it.terminating_signal().map(|signal| {
            let has_core = if it.dumped() { 0x80 } else { 0 };
            signal | has_core
        });
        code.or(signal).map(ExitStatus::from_raw)
    }))
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

/// Where a program is in `PATH`.
#[must_use]
pub fn which(program: &Path) -> Option<PathBuf> {
    let mut file = program.as_os_str().to_owned();
    let suffix = std::env::consts::EXE_SUFFIX;
    if !file.to_string_lossy().ends_with(suffix) {
        file.push(suffix);
    }
    std::env::split_paths(&std::env::var_os("PATH")?)
        .map(|folder| folder.join(&file))
        .find(|path| path.is_file())
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

/// What a program that was [followed](follow) left.
#[derive(Clone, Debug)]
pub struct Said {
    /// Its exit status.
    pub status: ExitStatus,
    /// What it wrote to standard output.
    pub stdout: String,
    /// What it wrote to standard error, without blanks at the ends of lines.
    pub stderr: String,
}

/// Runs a program to its end, however long that takes, and gives `each` the lines that it writes to standard error: for
/// cargo, which may have much to compile. What is not UTF-8 is replaced.
///
/// # Errors
/// The system's words.
pub fn follow(command: &mut Command, each: &mut dyn FnMut(&str)) -> io::Result<Said> {
    command.stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut running = Program::start(command)?;
    let (out, err) = (running.child.stdout.take(), running.child.stderr.take());
    // Both pipes are drained at once: either could fill up while the other is waited for.
    let reader = thread::Builder::new().spawn(move || {
        let mut bytes = Vec::new();
        if let Some(mut pipe) = out {
            // A pipe that breaks ends the text; the status tells the rest.
            let _ = pipe.read_to_end(&mut bytes);
        }
        bytes
    })?;
    let mut stderr = String::new();
    for line in err
        .into_iter()
        .flat_map(|pipe| BufReader::new(pipe).split(b'\n'))
    {
        let Ok(line) = line else { break };
        let line = String::from_utf8_lossy(&line);
        let line = line.trim_end();
        each(line);
        stderr.push_str(line);
        stderr.push('\n');
    }
    let stdout = reader.join().unwrap_or_default();
    Ok(Said {
        status: running.wait()?,
        stdout: String::from_utf8_lossy(&stdout).into_owned(),
        stderr,
    })
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

    /// Of a program that has ended by itself, too.
    #[test]
    fn what_a_program_leaves_behind_ends_with_it() {
        let mut program = Program::start(&mut shell("sleep 60 & exit 7")).unwrap();
        assert_eq!(program.wait().unwrap().code(), Some(7));
        let group = program.group();
        let lives = || {
            let group = rustix::process::Pid::from_raw(group.cast_signed()).unwrap();
            rustix::process::test_kill_process_group(group).is_ok()
        };
        assert!(lives());
        assert_eq!(program.try_wait().unwrap().unwrap().code(), Some(7));
        drop(program);
        let ended = (0..200).any(|_| {
            thread::sleep(Duration::from_millis(10));
            !lives()
        });
        assert!(ended);
    }

    #[test]
    fn lines_are_followed_to_the_end() {
        let script = r"echo out; printf 'a\n\377\nb  \n' >&2; exit 3";
        let mut lines = Vec::new();
        let said = follow(&mut shell(script), &mut |line| lines.push(line.to_owned())).unwrap();
        assert_eq!(lines, ["a", "\u{fffd}", "b"]);
        assert_eq!(said.status.code(), Some(3));
        assert_eq!(
            (said.stdout.as_str(), said.stderr.as_str()),
            ("out\n", "a\n\u{fffd}\nb\n")
        );
    }

    #[test]
    fn programs_with_a_dot_in_their_name_are_found() {
        assert!(which(Path::new("sh")).is_some());
        // `sh.5` is not `sh`.
        assert_eq!(which(Path::new("sh.5")), None);
    }

    #[test]
    fn a_missing_program_is_an_error() {
        let error = run(&mut Command::new("no-such-program"), LONG).unwrap_err();
        assert!(error.to_string().contains("no-such-program"), "{error}");
    }
}
