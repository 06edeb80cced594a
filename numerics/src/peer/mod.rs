//! `diffmoments`, the 2025 paper's own code (PyPI), as a process beside this one: what it computes
//! and how long it takes, on rows that are given to it.
//!
//! The process lives as long as the [`Peer`]. It pins itself to one core where the system can do
//! that, so that its times are those of one thread.

use std::ffi::OsStr;
use std::io::{BufRead, BufReader, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::process::{ChildStdin, ChildStdout, Command, Stdio};

use hankel_system::process::Program;
use hankel_system::temporary::Folder;
use serde::Deserialize;
use serde_json::json;

use crate::families::{Format, Precision, Row};

const SCRIPT: &str = include_str!("child.py");

/// Why there is no answer.
#[derive(Debug, thiserror::Error)]
pub enum PeerError {
    /// No such interpreter.
    #[error(
        "`{python}` does not start: {source}; name another Python with `--python` or HANKEL_PYTHON"
    )]
    Start {
        /// What was started.
        python: PathBuf,
        /// The system's words.
        source: std::io::Error,
    },
    /// The interpreter has not what it takes.
    #[error(
        "`{python}` has no package `{package}`: install it with `{python} -m pip install diffmoments numpy`, or name a Python that has it with `--python` or HANKEL_PYTHON"
    )]
    NoPackage {
        /// The interpreter.
        python: PathBuf,
        /// What it lacks.
        package: String,
    },
    /// A call that failed over there.
    #[error("diffmoments failed: {0}")]
    Failed(String),
    /// The process ended, or said something that is no answer.
    #[error("the process that runs diffmoments is gone: {0}")]
    Gone(String),
    /// Files for arrays cannot be written or read.
    #[error("a temporary file for diffmoments: {0}")]
    Io(#[from] std::io::Error),
}

#[derive(Default, Deserialize)]
#[serde(default)]
struct Answer {
    missing: Option<String>,
    error: Option<String>,
    version: Option<String>,
    numpy: Option<String>,
    cpu: Option<u32>,
    seconds: Option<f64>,
}

/// What is computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// The bounds themselves.
    Bound,
    /// Their derivatives, after the bounds were computed.
    Gradient,
}

/// A process that runs `diffmoments`.
pub struct Peer {
    process: Program,
    requests: Option<ChildStdin>,
    answers: BufReader<ChildStdout>,
    messages: std::fs::File,
    folder: Folder,
    loaded: Option<Loaded>,
    /// Version of the package.
    pub version: String,
    /// Version of its arrays' package.
    pub numpy: String,
    /// The core that it keeps to; `None` where the system offers no such thing.
    pub cpu: Option<u32>,
}

#[derive(Clone, Copy)]
struct Loaded {
    n: usize,
    rows: usize,
    precision: Precision,
}

/// The interpreter that `HANKEL_PYTHON` names, or else `python3`.
#[must_use]
pub fn default_python() -> PathBuf {
    std::env::var_os("HANKEL_PYTHON")
        .filter(|name| !name.is_empty())
        .map_or_else(|| PathBuf::from("python3"), PathBuf::from)
}

impl Peer {
    /// Starts a process with this interpreter.
    ///
    /// # Errors
    ///
    /// There is no such interpreter, or it has no `diffmoments` or no `numpy`.
    pub fn start(python: impl AsRef<OsStr>) -> Result<Self, PeerError> {
        let python = PathBuf::from(python.as_ref());
        let folder = Folder::new()?;
        let messages = folder.path().join("messages");
        let mut command = Command::new(&python);
        command
            .args(["-c", SCRIPT])
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(std::fs::File::create(&messages)?);
        let mut process = Program::start(&mut command).map_err(|source| PeerError::Start {
            python: python.clone(),
            source,
        })?;
        let pipes = (process.child.stdin.take(), process.child.stdout.take());
        let (Some(requests), Some(answers)) = pipes else {
            unreachable!("both streams are piped")
        };
        let mut peer = Self {
            process,
            requests: Some(requests),
            answers: BufReader::new(answers),
            messages: std::fs::File::open(&messages)?,
            folder,
            loaded: None,
            version: String::new(),
            numpy: String::new(),
            cpu: None,
        };
        let hello = peer.listen()?;
        if let Some(package) = hello.missing {
            let package = match package.as_str() {
                "diffmoments_ext" => "diffmoments".into(),
                _ => package,
            };
            return Err(PeerError::NoPackage { python, package });
        }
        peer.version = hello.version.unwrap_or_default();
        peer.numpy = hello.numpy.unwrap_or_default();
        peer.cpu = hello.cpu;
        Ok(peer)
    }

    /// Name and version.
    #[must_use]
    pub fn name(&self) -> String {
        format!("diffmoments {}", self.version)
            .trim_end()
            .to_owned()
    }

    /// Hands over rows of order `n`, for bounds without a bias, lower ones; gradients will be those
    /// of the bounds' sum.
    ///
    /// # Errors
    ///
    /// No space for them, here or there.
    pub fn load<T: Format>(&mut self, n: usize, rows: &[Row<T>]) -> Result<(), PeerError> {
        self.loaded = None;
        let path = self.folder.path().join("rows");
        let mut file = std::io::BufWriter::new(std::fs::File::create(&path)?);
        for k in 0..=2 * n {
            for row in rows {
                file.write_all(bytemuck::bytes_of(&row.m[k]))?;
            }
        }
        for row in rows {
            file.write_all(bytemuck::bytes_of(&row.eta))?;
        }
        let one = T::round(1.0);
        for _ in rows {
            file.write_all(bytemuck::bytes_of(&one))?;
        }
        file.into_inner()
            .map_err(std::io::IntoInnerError::into_error)?;
        self.ask(&json!({
            "do": "load",
            "path": path,
            "n": n,
            "rows": rows.len(),
            "bytes": size_of::<T>(),
            "bias": 0.0,
            "overestimation": 0.0,
        }))?;
        // The process has its own copy now.
        std::fs::remove_file(&path)?;
        self.loaded = Some(Loaded {
            n,
            rows: rows.len(),
            precision: T::PRECISION,
        });
        Ok(())
    }

    /// Seconds of processor time that the rows' bounds or gradients take, with or without retained
    /// roots. The bounds
    /// that gradients need are computed beforehand, outside of the time.
    ///
    /// # Errors
    ///
    /// No rows were given to it, or the call fails.
    pub fn time(&mut self, quantity: Quantity, retained_roots: bool) -> Result<f64, PeerError> {
        self.loaded()?;
        let gradient = quantity == Quantity::Gradient;
        let answer =
            self.ask(&json!({"do": "time", "gradient": gradient, "retain": retained_roots}))?;
        answer
            .seconds
            .ok_or_else(|| PeerError::Gone("it gave no time".into()))
    }

    /// The bounds that [`Peer::time`] computed last, one for each row.
    ///
    /// # Errors
    ///
    /// No rows were given to it, or the process ended.
    pub fn bounds(&mut self) -> Result<Vec<f64>, PeerError> {
        let Loaded { rows, .. } = self.loaded()?;
        self.fetch("bounds", rows)
    }

    /// The gradients that [`Peer::time`] computed last: for each row those to m_0 to m_2n and then
    /// that to the query point.
    ///
    /// # Errors
    ///
    /// No rows were given to it, or the process ended.
    pub fn gradients(&mut self) -> Result<Vec<Vec<f64>>, PeerError> {
        let Loaded { n, rows, .. } = self.loaded()?;
        let columns = self.fetch("gradients", rows * (2 * n + 2))?;
        let row = |i: usize| columns.iter().skip(i).step_by(rows).copied().collect();
        Ok((0..rows).map(row).collect())
    }

    /// From now on, bounds of the rows lie between the lower one, for 0, and the upper one, for 1.
    ///
    /// # Errors
    ///
    /// No rows were given to it, or the process ended.
    pub fn overestimate(&mut self, weight: f64) -> Result<(), PeerError> {
        self.loaded()?;
        self.ask(&json!({"do": "overestimate", "weight": weight}))?;
        Ok(())
    }

    /// The canonical representations of the rows: for each the n + 1 points, the query point among
    /// them, and then their weights.
    ///
    /// # Errors
    ///
    /// No rows were given to it, or the process ended.
    pub fn canonical(&mut self) -> Result<Vec<Vec<f64>>, PeerError> {
        let Loaded { n, rows, .. } = self.loaded()?;
        let columns = self.fetch("canonical", rows * (2 * n + 2))?;
        let row = |i: usize| columns.iter().skip(i).step_by(rows).copied().collect();
        Ok((0..rows).map(row).collect())
    }

    fn loaded(&self) -> Result<Loaded, PeerError> {
        self.loaded
            .ok_or_else(|| PeerError::Failed("it was given no rows".into()))
    }

    fn fetch(&mut self, what: &str, count: usize) -> Result<Vec<f64>, PeerError> {
        let Loaded { precision, .. } = self.loaded()?;
        let path = self.folder.path().join(what);
        self.ask(&json!({"do": what, "path": path}))?;
        let numbers = read(&path, precision)?;
        std::fs::remove_file(&path)?;
        if numbers.len() != count {
            return Err(PeerError::Gone(format!(
                "{} numbers came for {count}",
                numbers.len()
            )));
        }
        Ok(numbers)
    }

    fn ask(&mut self, request: &serde_json::Value) -> Result<Answer, PeerError> {
        let sent = self
            .requests
            .as_mut()
            .map(|requests| writeln!(requests, "{request}"));
        if let Some(Err(error)) = sent {
            return Err(self.gone(&error.to_string()));
        }
        let answer = self.listen()?;
        match answer.error {
            Some(error) => Err(PeerError::Failed(error)),
            None => Ok(answer),
        }
    }

    fn listen(&mut self) -> Result<Answer, PeerError> {
        let mut line = String::new();
        match self.answers.read_line(&mut line) {
            Ok(0) => Err(self.gone("it said nothing")),
            Ok(_) => serde_json::from_str(&line).map_err(|_| self.gone(line.trim())),
            Err(error) => Err(self.gone(&error.to_string())),
        }
    }

    /// An error with the last line of what the process complained about.
    fn gone(&mut self, problem: &str) -> PeerError {
        let mut messages = Vec::new();
        let _ = self
            .messages
            .seek(SeekFrom::Start(0))
            .and_then(|_| self.messages.read_to_end(&mut messages));
        let messages = String::from_utf8_lossy(&messages);
        let last = messages.lines().rfind(|line| !line.trim().is_empty());
        PeerError::Gone(last.unwrap_or(problem).trim().to_owned())
    }
}

impl Drop for Peer {
    fn drop(&mut self) {
        // The end of its input ends it, after the call that it is in.
        drop(self.requests.take());
        self.process.kill();
    }
}

fn read(path: &Path, precision: Precision) -> std::io::Result<Vec<f64>> {
    let bytes = std::fs::read(path)?;
    Ok(match precision {
        Precision::F32 => bytes
            .as_chunks()
            .0
            .iter()
            .map(|b| f64::from(f32::from_ne_bytes(*b)))
            .collect(),
        Precision::F64 => bytes
            .as_chunks()
            .0
            .iter()
            .map(|b| f64::from_ne_bytes(*b))
            .collect(),
    })
}
