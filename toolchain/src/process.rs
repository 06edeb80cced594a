//! Runs other programs: what they print goes into a log file, line by line past a
//! callback, and the end of it into the error if they fail.

use std::fs::File;
use std::io::{BufRead, BufReader, Read, Write};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Duration;

use hankel_system::process::Program;

use crate::error::{During, Error, Result};

/// Lines of output that an error quotes.
const TAIL_LINES: usize = 12;

/// Characters of each that it quotes: some command lines are very long.
const TAIL_WIDTH: usize = 240;

/// How long a program may take to say something about itself.
const PATIENCE: Duration = Duration::from_secs(5);

/// Runs `command` to its end and gives every line that it prints to `each`.
pub(crate) fn run(
    command: &mut Command,
    what: &str,
    log: &Path,
    mut each: impl FnMut(&str),
) -> Result<()> {
    let mut file = File::create(log).during("create", log)?;
    let (reader, writer) = std::io::pipe().during("open a pipe for", log)?;
    let program = PathBuf::from(command.get_program());
    let twin = writer.try_clone().during("open a pipe for", log)?;
    // It ends when the caller unwinds, so that nothing goes on writing into a folder that nobody
    // watches.
    let running = Program::start(command.stdin(Stdio::null()).stdout(writer).stderr(twin))
        .during("run", &program);
    // The command keeps the write ends: without this the reader would never see the end.
    command.stdout(Stdio::null()).stderr(Stdio::null());
    let mut running = running?;
    let mut tail: Vec<String> = Vec::new();
    for line in BufReader::new(reader).split(b'\n') {
        let line = line.during("read the output of", &program)?;
        let line = String::from_utf8_lossy(&line);
        let line = line.trim_end();
        writeln!(file, "{line}").during("write", log)?;
        each(line);
        if !line.trim().is_empty() {
            if tail.len() == TAIL_LINES {
                tail.remove(0);
            }
            tail.push(line.chars().take(TAIL_WIDTH).collect());
        }
    }
    let status = running.wait().during("wait for", &program)?;
    if status.success() {
        return Ok(());
    }
    Err(Error::Command {
        what: what.to_owned(),
        status: status.to_string(),
        log: log.to_owned(),
        tail: tail.join("\n"),
    })
}

/// What `command` prints on its standard output, if it succeeds.
pub(crate) fn output(command: &mut Command) -> Option<String> {
    command
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::null());
    let mut running = Program::start(command).ok()?;
    let mut text = Vec::new();
    running.child.stdout.take()?.read_to_end(&mut text).ok()?;
    let status = running.wait().ok()?;
    status
        .success()
        .then(|| String::from_utf8_lossy(&text).into_owned())
}

/// What a program says about itself in a line or two, if it says so soon.
pub(crate) fn ask(command: &mut Command) -> Option<String> {
    let done = hankel_system::process::run(command, PATIENCE).ok()?;
    let text = done.stdout.trim();
    (done.status.success() && !text.is_empty()).then(|| text.to_owned())
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;
    use crate::tests::scratch;

    fn shell(script: &str) -> Command {
        let mut command = Command::new("sh");
        command.args(["-c", script]);
        command
    }

    #[test]
    fn a_failure_quotes_the_end_and_keeps_everything() {
        let folder = scratch("process");
        let log = folder.join("log");
        let mut lines = 0;
        let mut script = shell("for i in $(seq 40); do echo line $i; done; echo bad >&2; exit 3");
        let error = run(&mut script, "the script", &log, |_| lines += 1)
            .unwrap_err()
            .to_string();
        assert_eq!(lines, 41);
        assert!(
            error.contains("the script failed (exit status: 3)"),
            "{error}"
        );
        assert!(
            error.contains("line 40\n    bad") && !error.contains("line 20\n"),
            "{error}"
        );
        assert!(
            std::fs::read_to_string(&log)
                .unwrap()
                .starts_with("line 1\nline 2\n")
        );
        std::fs::remove_dir_all(folder).unwrap();
    }

    #[test]
    fn unwinding_ends_the_program() {
        let folder = scratch("process");
        let (log, file) = (folder.join("log"), folder.join("too-late"));
        let mut script = shell("echo now; sleep 1; echo late > \"$0\"");
        script.arg(&file);
        let stopped = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| {
            run(&mut script, "the script", &log, |_| {
                panic!("stopped on purpose")
            })
        }));
        assert!(stopped.is_err());
        std::thread::sleep(Duration::from_millis(1300));
        assert!(!file.exists());
        std::fs::remove_dir_all(folder).unwrap();
    }

    #[test]
    fn a_program_that_is_not_there_is_named() {
        let folder = scratch("process");
        let mut command = Command::new("hankel-no-such-program");
        let error = run(&mut command, "x", &folder.join("log"), |_| {})
            .unwrap_err()
            .to_string();
        assert!(error.contains("hankel-no-such-program"), "{error}");
        assert_eq!(output(&mut command), None);
        assert_eq!(ask(&mut command), None);
        std::fs::remove_dir_all(folder).unwrap();
    }
}
