//! Runs other programs: what they print goes into a log file, line by line past a
//! callback, and the end of it into the error if they fail.

use std::fs::File;
use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

use crate::error::{During, Error, Result};

/// Lines of output that an error quotes.
const TAIL_LINES: usize = 12;

/// Kills the program when the caller unwinds, so that nothing goes on writing into a
/// folder that nobody watches.
struct Running(Child);

impl Drop for Running {
    fn drop(&mut self) {
        if let Ok(None) = self.0.try_wait() {
            let _ = self.0.kill();
            let _ = self.0.wait();
        }
    }
}

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
    let child = command
        .stdin(Stdio::null())
        .stdout(writer)
        .stderr(twin)
        .spawn()
        .during("run", &program);
    // The command keeps the write ends: without this the reader would never see the end.
    command.stdout(Stdio::null()).stderr(Stdio::null());
    let mut running = Running(child?);
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
            tail.push(line.to_owned());
        }
    }
    let status = running.0.wait().during("wait for", &program)?;
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
    let output = command
        .stdin(Stdio::null())
        .stderr(Stdio::null())
        .output()
        .ok()?;
    output
        .status
        .success()
        .then(|| String::from_utf8_lossy(&output.stdout).into_owned())
}

/// Where `program` is in `PATH`.
pub(crate) fn which(program: &str) -> Option<PathBuf> {
    let path = std::env::var_os("PATH")?;
    let file = format!("{program}{}", std::env::consts::EXE_SUFFIX);
    std::env::split_paths(&path)
        .map(|folder| folder.join(&file))
        .find(|file| file.is_file())
}
