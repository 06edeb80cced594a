//! Hashes, files that are there whole or not at all, and files of a size that can be read.

use std::path::Path;
use std::sync::atomic::{AtomicU32, Ordering};

use hankel_system::input::{self, InputError};
use sha2::{Digest, Sha256};

use crate::error::{During, Error, Result};

/// SHA-256 in hexadecimal.
pub fn sha256(bytes: &[u8]) -> String {
    Sha256::digest(bytes)
        .iter()
        .map(|byte| format!("{byte:02x}"))
        .collect()
}

/// Reads a regular file of at most `most` bytes.
///
/// # Errors
///
/// It cannot be read, is no regular file, or is larger.
pub fn read(path: &Path, most: u64) -> Result<Vec<u8>> {
    input::read(path, most).map_err(|error| match error {
        InputError::Io { path, source } => Error::Io {
            action: "read",
            path,
            source,
        },
        other => Error::NotAFile {
            problem: other.problem(),
            path: path.to_owned(),
        },
    })
}

/// Writes a file by way of a sibling that is renamed; folders above it are made.
pub fn write_whole(path: &Path, bytes: &[u8]) -> Result<()> {
    static COUNT: AtomicU32 = AtomicU32::new(0);
    if let Some(folder) = path.parent() {
        std::fs::create_dir_all(folder).during("create", folder)?;
    }
    let count = COUNT.fetch_add(1, Ordering::Relaxed);
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let sibling = path.with_file_name(format!(".{name}.{}-{count}", std::process::id()));
    let written = std::fs::write(&sibling, bytes)
        .during("write", &sibling)
        .and_then(|()| std::fs::rename(&sibling, path).during("write", path));
    if written.is_err() {
        // The first error is the one to report.
        let _ = std::fs::remove_file(&sibling);
    }
    written
}
