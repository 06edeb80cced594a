//! The runners for WGSL in other people's WebGPU: Dawn in Node.js, and a page of Chromium. Both are
//! programs in JavaScript that are part of this one, and are laid into a folder to be run.

use std::fs;
use std::path::Path;
use std::process::Command;
use std::time::Duration;

use crate::column::Column;
use crate::tools::{Tool, Tools};

/// The runners' files.
const FILES: [(&str, &str); 7] = [
    ("chromium.mjs", include_str!("chromium.mjs")),
    ("dawn.mjs", include_str!("dawn.mjs")),
    ("execute.mjs", include_str!("execute.mjs")),
    ("page.html", include_str!("page.html")),
    ("page.mjs", include_str!("page.mjs")),
    ("runner.mjs", include_str!("runner.mjs")),
    ("wgsl.mjs", include_str!("wgsl.mjs")),
];

/// The command that runs a column's runner out of `folder`. Within it one kernel may take `limit`.
///
/// # Errors
/// In words: a tool that is not there, a file that cannot be written.
pub fn command(
    column: Column,
    tools: &Tools,
    folder: &Path,
    limit: Duration,
) -> Result<Command, String> {
    for (name, text) in FILES {
        let file = folder.join(name);
        fs::write(&file, text).map_err(|e| format!("cannot write {}: {e}", file.display()))?;
    }
    let gone = |tool: Tool| format!("{} is gone", tool.name());
    let mut command = Command::new(tools.node().ok_or_else(|| gone(Tool::Node))?);
    if column == Column::WgslChromium {
        let chromium = tools.chromium().ok_or_else(|| gone(Tool::Chromium))?;
        command.arg(folder.join("chromium.mjs"));
        command.env("HANKEL_CHROMIUM", chromium);
    } else {
        command.arg(folder.join("dawn.mjs"));
        command.env("HANKEL_NODE_MODULES", tools.node_modules());
    }
    command.env("HANKEL_JOB_SECONDS", limit.as_secs().to_string());
    Ok(command)
}
