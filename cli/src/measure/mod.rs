//! The commands that measure bounds and frames: `judge`, `bench` and `stress`. They are the Cargo feature
//! `measure`, since what they measure with takes longer to compile than all else.

mod args;
mod bench;
#[cfg(feature = "frames")]
mod candidates;
mod failure;
#[cfg(feature = "frames")]
mod frames;
mod judge;
mod stress;

use std::path::Path;
#[cfg(feature = "frames")]
use std::path::PathBuf;

use hankel_numerics::report::Report;

pub use args::Command;

use crate::args::Format;
#[cfg(feature = "frames")]
use crate::failure::Failure;
use crate::failure::{Outcome, Result};
use crate::print::{self, say};

/// Runs a command that measures.
pub fn run(command: &Command, quiet: bool) -> Result<Outcome> {
    match command {
        Command::Judge(a) => judge::run(a, quiet),
        Command::Bench(a) => bench::run(a, quiet),
        Command::Stress(a) => stress::run(a, quiet),
    }
}

/// Writes a report's files where a folder is given for them, over none of the inputs, and prints it.
fn deliver(
    report: &Report,
    out: Option<&Path>,
    name: &str,
    inputs: &[PathBuf],
    format: Format,
    quiet: bool,
) -> Result<()> {
    let paths = match out {
        Some(folder) => {
            let inputs: Vec<&Path> = inputs.iter().map(PathBuf::as_path).collect();
            report.write(folder, name, &inputs)?
        }
        None => Vec::new(),
    };
    match format {
        Format::Json => print::json(report),
        Format::Text => {
            say!("{report}");
            if !quiet {
                for path in paths {
                    say!("{}", path.display());
                }
            }
        }
    }
    Ok(())
}

/// The scene files that were named, or else all in the folder `scenes`.
#[cfg(feature = "frames")]
fn scene_files(named: &[PathBuf]) -> Result<Vec<PathBuf>> {
    const FOLDER: &str = "scenes";
    if !named.is_empty() {
        return Ok(named.to_vec());
    }
    let found = std::fs::read_dir(FOLDER).into_iter().flatten().flatten();
    let mut files: Vec<PathBuf> = found
        .map(|entry| entry.path())
        .filter(|path| path.extension().is_some_and(|e| e == "toml"))
        .collect();
    files.sort();
    if files.is_empty() {
        return Err(Failure::input(
            format!("there are no scene files in {FOLDER}/"),
            "Name scene files with --scene FILE.",
        ));
    }
    Ok(files)
}

/// The command line as it was typed, as near as a program can know, for reports.
fn command_line() -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "-_=./,:*@%+".contains(c);
    std::iter::once("hankel".to_owned())
        .chain(std::env::args_os().skip(1).map(|argument| {
            let text = argument.to_string_lossy();
            if !text.is_empty() && text.chars().all(plain) {
                text.into_owned()
            } else {
                format!("'{}'", text.replace('\'', "'\\''"))
            }
        }))
        .collect::<Vec<_>>()
        .join(" ")
}
