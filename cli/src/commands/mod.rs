//! One module for each command: it calls the library that does the work, and prints.

pub mod bench;
pub mod build;
pub mod check;
pub mod completions;
pub mod doctor;
pub mod eval;
pub mod functions;
pub mod judge;
pub mod list;
pub mod new;
pub mod parity;
pub mod render;
pub mod stress;
pub mod toolchain;

use std::path::Path;

use hankel_numerics::report::Report;
use serde::Serialize;

use crate::args::Format;
use crate::failure::Result;

/// Writes a report's files where a folder is given for them, and prints it.
fn deliver(
    report: &Report,
    out: Option<&Path>,
    name: &str,
    format: Format,
    quiet: bool,
) -> Result<()> {
    let paths = match out {
        Some(folder) => report.write(folder, name)?,
        None => Vec::new(),
    };
    match format {
        Format::Json => print_json(report),
        Format::Text => {
            println!("{report}");
            if !quiet {
                for path in paths {
                    println!("{}", path.display());
                }
            }
        }
    }
    Ok(())
}

/// Prints a report as JSON.
fn print_json(report: &impl Serialize) {
    match serde_json::to_string_pretty(report) {
        Ok(text) => println!("{text}"),
        // A map with keys that are no text: none of the reports has one.
        Err(error) => eprintln!("the report has no JSON form: {error}"),
    }
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
