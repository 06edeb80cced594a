//! SHA-256 of files and streams.

use std::fmt::Write as _;
use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

use sha2::{Digest, Sha256};

use crate::error::{During, Error, Result};

/// 64 hexadecimal digits.
pub(crate) fn hex(hash: Sha256) -> String {
    let mut text = String::with_capacity(64);
    for byte in hash.finalize() {
        let _ = write!(text, "{byte:02x}");
    }
    text
}

pub(crate) fn of_bytes<'a>(parts: impl IntoIterator<Item = &'a [u8]>) -> String {
    let mut hash = Sha256::new();
    for part in parts {
        // The length keeps ("ab", "c") and ("a", "bc") apart.
        hash.update((part.len() as u64).to_le_bytes());
        hash.update(part);
    }
    hex(hash)
}

pub(crate) fn of_file(path: &Path) -> Result<String> {
    let mut reader = Hashing::new(File::open(path).during("open", path)?);
    io::copy(&mut reader, &mut io::sink()).during("read", path)?;
    Ok(hex(reader.hash))
}

/// Fails unless the file has that checksum.
pub(crate) fn check_file(path: &Path, expected: &str) -> Result<()> {
    let actual = of_file(path)?;
    if actual == expected {
        return Ok(());
    }
    Err(Error::Checksum {
        path: path.to_owned(),
        expected: expected.to_owned(),
        actual,
    })
}

/// Hashes what is read through it.
pub(crate) struct Hashing<R> {
    inner: R,
    pub(crate) hash: Sha256,
    pub(crate) bytes: u64,
}

impl<R> Hashing<R> {
    pub(crate) fn new(inner: R) -> Self {
        Self {
            inner,
            hash: Sha256::new(),
            bytes: 0,
        }
    }
}

impl<R: Read> Read for Hashing<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let count = self.inner.read(buffer)?;
        self.hash.update(&buffer[..count]);
        self.bytes += count as u64;
        Ok(count)
    }
}
