//! Runs a program to its end or to its time-out, with all that it started.

use std::fs::File;
use std::io;
use std::os::unix::process::{CommandExt, ExitStatusExt};
use std::path::Path;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

/// How a program ended.
pub(super) enum End {
    /// By itself; what it printed.
    Ended(ExitStatus, String),
    /// It was killed.
    TimedOut,
}

/// Characters of its output that are kept.
const KEPT: usize = 8000;

unsafe extern "C" {
    fn kill(pid: i32, signal: i32) -> i32;
}

const SIGKILL: i32 = 9;

/// A process group that is not outlived by what it was for.
struct Group(Child);

impl Group {
    fn kill(&mut self) {
        if let Ok(id) = i32::try_from(self.0.id()) {
            // SAFETY: the call takes two numbers. The group is that of a child that was not waited
            // for, so that its number belongs to nobody else.
            unsafe { kill(-id, SIGKILL) };
        }
        let _ = self.0.wait();
    }
}

impl Drop for Group {
    fn drop(&mut self) {
        if !matches!(self.0.try_wait(), Ok(Some(_))) {
            self.kill();
        }
    }
}

/// Runs `command`; what it prints goes through the file `log`.
pub(super) fn run(command: &mut Command, log: &Path, timeout: Duration) -> io::Result<End> {
    let file = File::create(log)?;
    let child = command
        .stdin(Stdio::null())
        .stdout(file.try_clone()?)
        .stderr(file)
        .process_group(0)
        .spawn()?;
    let mut group = Group(child);
    let begin = Instant::now();
    let mut pause = Duration::from_millis(1);
    loop {
        if let Some(status) = group.0.try_wait()? {
            let text = std::fs::read(log)?;
            let text = String::from_utf8_lossy(&text);
            let text = match text.char_indices().nth(KEPT) {
                Some((end, _)) => format!("{} …", &text[..end]),
                None => text.into_owned(),
            };
            return Ok(End::Ended(status, text.trim_end().into()));
        }
        if begin.elapsed() >= timeout {
            group.kill();
            return Ok(End::TimedOut);
        }
        std::thread::sleep(pause);
        pause = (pause * 2).min(Duration::from_millis(10));
    }
}

/// A status that is not success, in words.
pub(super) fn words(status: ExitStatus) -> String {
    match (status.signal(), status.code()) {
        (Some(signal), _) => format!("signal {signal}"),
        (None, Some(code)) => format!("exit status {code}"),
        (None, None) => "no status".into(),
    }
}
