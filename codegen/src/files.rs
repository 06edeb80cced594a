//! Hashes, files that are there whole or not at all, and files of a size that can be read.

use std::io::Read;
use std::path::Path;
use std::sync::atomic::{AtomicU32, Ordering};

use sha2::{Digest, Sha256};

use crate::error::{During, Error, Result};

/// SHA-256 in hexadecimal.
pub fn sha256(bytes: &[u8]) -> String {
    Sha256::digest(bytes)
        .iter()
        .map(|byte| format!("{byte:02x}"))
        .collect()
}

/// Reads a regular file of at most `most` bytes. What is at its path may be anything: a FIFO would
/// make the reader wait, and a device never ends.
///
/// # Errors
///
/// It cannot be read, is no regular file, or is larger.
pub fn read(path: &Path, most: u64) -> Result<Vec<u8>> {
    let wrong = |kind: String| Error::NotAFile {
        path: path.to_owned(),
        kind,
    };
    let data = std::fs::metadata(path).during("read", path)?;
    if data.is_dir() {
        return Err(wrong("a folder".into()));
    }
    if !data.is_file() {
        return Err(wrong("a device, FIFO or socket, no file".into()));
    }
    let mut bytes = Vec::new();
    let file = std::fs::File::open(path).during("read", path)?;
    let read = file.take(most.saturating_add(1)).read_to_end(&mut bytes);
    read.during("read", path)?;
    if bytes.len() as u64 > most {
        return Err(wrong(format!("larger than {} MiB", most >> 20)));
    }
    Ok(bytes)
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
