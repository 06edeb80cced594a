//! Kernels on another instruction set than this process uses.
//!
//! A process chooses its lanes' instruction set once. So each other one is measured in a process of
//! its own, which lives as long as the measurement and is asked for one call after the other, so
//! that all take turns.

use std::ffi::OsString;
use std::io::{BufRead, BufReader, Write};
use std::path::PathBuf;
use std::process::{ChildStdin, ChildStdout, Command, Stdio};

use hankel_dsl::native::Mode;
use hankel_system::process::Program as Process;
use serde::{Deserialize, Serialize};

use super::SpeedError;
use super::native::Native;
use crate::families::Precision;

/// How a process is started that [serves](serve): a program and its arguments.
#[derive(Clone, Debug)]
pub struct Program {
    /// The program, usually the running one.
    pub path: PathBuf,
    /// What makes it call [`serve`].
    pub arguments: Vec<OsString>,
}

#[derive(Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Request {
    /// Forget all kernels.
    Clear,
    /// One more kernel; they are numbered from 0.
    Load {
        function: String,
        precision: Precision,
        rows: usize,
        /// File of the elements as they lie in memory.
        elements: PathBuf,
    },
    /// One call of a kernel on one thread, on lanes.
    Time(usize),
}

#[derive(Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Answer {
    Done,
    Seconds(f64),
    Failed(String),
}

/// Answers requests for measurements, a line of JSON each, until there are no more.
///
/// # Errors
///
/// The streams break.
pub fn serve(requests: impl BufRead, mut answers: impl Write) -> std::io::Result<()> {
    let mut kernels = Vec::new();
    for line in requests.lines() {
        let answer = match serde_json::from_str(&line?) {
            Ok(request) => {
                answer(request, &mut kernels).unwrap_or_else(|e| Answer::Failed(e.to_string()))
            }
            Err(error) => Answer::Failed(error.to_string()),
        };
        serde_json::to_writer(&mut answers, &answer)?;
        writeln!(answers)?;
        answers.flush()?;
    }
    Ok(())
}

fn answer(request: Request, kernels: &mut Vec<Native>) -> Result<Answer, SpeedError> {
    match request {
        Request::Clear => {
            kernels.clear();
            Ok(Answer::Done)
        }
        Request::Load {
            function,
            precision,
            rows,
            elements,
        } => {
            let bytes = std::fs::read(elements)?;
            kernels.push(Native::from_bytes(&function, precision, rows, &bytes)?);
            Ok(Answer::Done)
        }
        Request::Time(index) => match kernels.get_mut(index) {
            Some(kernel) => Ok(Answer::Seconds(kernel.time(Mode {
                lanes: true,
                ..Mode::REFERENCE
            })?)),
            None => Ok(Answer::Failed(format!("there is no kernel {index}"))),
        },
    }
}

/// A process that measures on one instruction set.
pub struct Worker {
    _process: Process,
    requests: Option<ChildStdin>,
    answers: BufReader<ChildStdout>,
    /// The instruction set.
    pub level: &'static str,
}

impl Worker {
    pub fn start(program: &Program, level: &'static str) -> Result<Self, SpeedError> {
        let mut command = Command::new(&program.path);
        command
            .args(&program.arguments)
            .env("HANKEL_SIMD", level)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped());
        let mut process = Process::start(&mut command).map_err(|error| {
            SpeedError::Worker(level, format!("{}: {error}", program.path.display()))
        })?;
        let pipes = (process.child.stdin.take(), process.child.stdout.take());
        let (Some(requests), Some(answers)) = pipes else {
            unreachable!("both streams are piped")
        };
        Ok(Self {
            _process: process,
            requests: Some(requests),
            answers: BufReader::new(answers),
            level,
        })
    }

    /// Forgets all kernels.
    pub fn clear(&mut self) -> Result<(), SpeedError> {
        self.ask(&Request::Clear).map(drop)
    }

    /// Hands over one more kernel on rows; they are numbered from 0.
    pub fn load(
        &mut self,
        function: &str,
        precision: Precision,
        rows: usize,
        elements: PathBuf,
    ) -> Result<(), SpeedError> {
        let request = Request::Load {
            function: function.into(),
            precision,
            rows,
            elements,
        };
        self.ask(&request).map(drop)
    }

    /// Seconds of one call.
    pub fn time(&mut self, kernel: usize) -> Result<f64, SpeedError> {
        match self.ask(&Request::Time(kernel))? {
            Answer::Seconds(seconds) => Ok(seconds),
            _ => Err(SpeedError::Worker(self.level, "it gave no time".into())),
        }
    }

    fn ask(&mut self, request: &Request) -> Result<Answer, SpeedError> {
        let failed = |problem: String| SpeedError::Worker(self.level, problem);
        let line = serde_json::to_string(request).map_err(|e| failed(e.to_string()))?;
        if let Some(requests) = &mut self.requests {
            writeln!(requests, "{line}").map_err(|e| failed(e.to_string()))?;
        }
        let mut line = String::new();
        self.answers
            .read_line(&mut line)
            .map_err(|e| failed(e.to_string()))?;
        match serde_json::from_str(&line) {
            Ok(Answer::Failed(problem)) => Err(failed(problem)),
            Ok(answer) => Ok(answer),
            Err(_) if line.is_empty() => Err(failed("it ended".into())),
            Err(_) => Err(failed(format!("it said: {}", line.trim()))),
        }
    }
}
