//! One module for each command: it calls the library that does the work, and prints.

pub mod build;
pub mod check;
pub mod completions;
pub mod eval;
pub mod list;
pub mod new;
pub mod parity;
pub mod render;
pub mod toolchain;

use serde::Serialize;

/// Prints a report as JSON.
fn print_json(report: &impl Serialize) {
    match serde_json::to_string_pretty(report) {
        Ok(text) => println!("{text}"),
        // A map with keys that are no text: none of the reports has one.
        Err(error) => eprintln!("the report has no JSON form: {error}"),
    }
}
