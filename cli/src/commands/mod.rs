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

use crate::args::Format;
use crate::failure::Result;
use crate::print::{self, say};
use hankel_numerics::report::Report;

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
