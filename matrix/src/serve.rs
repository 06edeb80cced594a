//! The loop of a runner that is part of this program, see [`crate::job`].

use std::io::{self, BufRead, Write};

use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::job::{Driver, Kind, Reply};

/// Why a job was not done.
pub(crate) struct Problem {
    pub kind: Kind,
    pub words: String,
}

impl From<String> for Problem {
    fn from(words: String) -> Self {
        Self {
            kind: Kind::Refused,
            words,
        }
    }
}

/// Says what the runner runs on, then does the jobs of standard input until it ends. `run` gives a job's number with how
/// it went.
///
/// # Errors
/// In words: a line that is no job, an output that nobody reads.
pub(crate) fn serve<J: DeserializeOwned>(
    driver: &Driver,
    mut run: impl FnMut(&J) -> (u64, Result<(), Problem>),
) -> Result<(), String> {
    say(driver)?;
    for line in io::stdin().lock().lines() {
        let line = line.map_err(|e| format!("standard input: {e}"))?;
        let job = serde_json::from_str(&line).map_err(|e| format!("this is not a job: {e}"))?;
        let (id, done) = run(&job);
        let (error, kind) = match done {
            Ok(()) => (None, Kind::default()),
            Err(problem) => (Some(problem.words), problem.kind),
        };
        say(&Reply { id, error, kind })?;
    }
    Ok(())
}

fn say(what: &impl Serialize) -> Result<(), String> {
    let line = serde_json::to_string(what).map_err(|e| e.to_string())?;
    let mut out = io::stdout().lock();
    writeln!(out, "{line}")
        .and_then(|()| out.flush())
        .map_err(|e| format!("standard output: {e}"))
}
