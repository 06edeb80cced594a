//! What tests of the command line work with.

#![allow(dead_code, reason = "each test binary uses a part of it")]

use std::fs;
#[cfg(unix)]
use std::os::unix::process::ExitStatusExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::thread;
use std::time::{Duration, Instant};

use tempfile::TempDir;

/// A command that takes longer hangs; one builds a crate first.
pub const PATIENCE: Duration = Duration::from_secs(300);

pub fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .parent()
        .expect("cli/ lies in the repository")
}

/// A folder outside of the repository.
pub struct Desk(TempDir);

impl Desk {
    pub fn new() -> Self {
        Self(tempfile::tempdir().expect("a temporary folder"))
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    pub fn write(&self, name: &str, text: impl AsRef<[u8]>) -> PathBuf {
        let path = self.path(name);
        fs::create_dir_all(path.parent().expect("it has a folder")).expect("the desk");
        fs::write(&path, text).expect("the desk can be written");
        path
    }

    pub fn read(&self, name: &str) -> String {
        fs::read_to_string(self.path(name)).unwrap_or_else(|e| panic!("{name}: {e}"))
    }

    /// Names in the folder.
    pub fn names(&self) -> Vec<String> {
        let mut names: Vec<String> = fs::read_dir(self.0.path())
            .expect("the desk")
            .map(|e| {
                e.expect("an entry")
                    .file_name()
                    .to_string_lossy()
                    .into_owned()
            })
            .collect();
        names.sort();
        names
    }

    pub fn fifo(&self, name: &str) -> PathBuf {
        let path = self.path(name);
        let made = Command::new("mkfifo").arg(&path).status();
        assert!(made.expect("mkfifo runs").success());
        path
    }

    /// `hankel` with these words, here.
    pub fn command(&self, line: &str) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_hankel"));
        command
            .args(line.split_whitespace())
            .current_dir(self.0.path())
            // No compiler, wherever the test runs.
            .env("HANKEL_CACHE", self.path("no-cache"))
            .env_remove("HANKEL_TOOLCHAIN")
            .env_remove("HANKEL_TOOLCHAIN_ARCHIVE")
            .stdin(Stdio::null());
        command
    }

    pub fn hankel(&self, line: &str) -> Run {
        run(&mut self.command(line))
    }
}

/// Runs a command to its end, which must come.
pub fn run(command: &mut Command) -> Run {
    let child = command
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("it starts");
    let id = child.id().to_string();
    let (send, ended) = std::sync::mpsc::channel::<()>();
    let watch = thread::spawn(move || {
        let late = ended.recv_timeout(PATIENCE).is_err();
        if late {
            let _ = Command::new("kill").args(["-KILL", &id]).status();
        }
        late
    });
    let output = child.wait_with_output().expect("it ends");
    let _ = send.send(());
    let late = watch.join().expect("the watch");
    assert!(!late, "it hangs: {command:?}");
    Run(output)
}

/// Waits until something is so.
pub fn until(what: &str, mut is_so: impl FnMut() -> bool) {
    let began = Instant::now();
    while !is_so() {
        assert!(began.elapsed() < PATIENCE, "never: {what}");
        thread::sleep(Duration::from_millis(20));
    }
}

/// Sends a signal to one process.
pub fn signal(child: &Child, name: &str) {
    let sent = Command::new("kill")
        .args([&format!("-{name}"), &child.id().to_string()])
        .status();
    assert!(sent.expect("kill runs").success());
}

pub struct Run(pub Output);

impl Run {
    pub fn out(&self) -> String {
        String::from_utf8_lossy(&self.0.stdout).into_owned()
    }

    /// The error stream, with its line breaks undone.
    pub fn err(&self) -> String {
        String::from_utf8_lossy(&self.0.stderr)
            .replace(['│', '\n'], " ")
            .split_whitespace()
            .collect::<Vec<_>>()
            .join(" ")
    }

    pub fn code(&self, expected: i32) -> &Self {
        let status = self.0.status;
        assert_eq!(
            status.code(),
            Some(expected),
            "{status}\n{}\n{}",
            self.out(),
            self.err()
        );
        assert!(!self.err().contains("panicked"), "{}", self.err());
        self
    }

    /// It ended by a signal.
    #[cfg(unix)]
    pub fn ended_by(&self, signal: i32) -> &Self {
        assert_eq!(self.0.status.signal(), Some(signal), "{}", self.err());
        self
    }

    /// Fails with a code and words.
    pub fn fails(&self, code: i32, words: &[&str]) {
        self.code(code);
        for word in words {
            assert!(self.err().contains(word), "no `{word}` in: {}", self.err());
        }
    }
}
