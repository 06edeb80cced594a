//! Hashes, and files that are there whole or not at all.

use std::path::Path;
use std::sync::atomic::{AtomicU32, Ordering};

use sha2::{Digest, Sha256};

use crate::error::{During, Result};

/// SHA-256 in hexadecimal.
pub fn sha256(bytes: &[u8]) -> String {
    Sha256::digest(bytes)
        .iter()
        .map(|byte| format!("{byte:02x}"))
        .collect()
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
