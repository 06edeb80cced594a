//! The file that says what an installed toolchain consists of. It is written last,
//! before the folder gets its final name, and proves that the folder is whole.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::error::{During, Error, Result};
use crate::pinned;

/// The file's name in the toolchain's folder.
pub(crate) const FILE: &str = "hankel-toolchain.json";

/// Changes when older manifests can no longer be read.
const FORMAT: u32 = 1;

/// How an installed toolchain came to be.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum MadeFrom {
    /// Unpacked from an archive.
    Archive,
    /// Built from source.
    Source,
}

#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Manifest {
    format: u32,
    /// What the folder was made from.
    pub made_from: MadeFrom,
    /// SHA-256 of the archive, or of everything that went into the build from source.
    pub sha256: String,
    pub rust_gpu: String,
    /// First line of `rustc --version`.
    pub rustc: String,
    pub host: String,
    /// Number and total size of all files but this one.
    files: u64,
    bytes: u64,
    /// The programs and libraries, with their sizes: checked at each use.
    key_files: BTreeMap<String, u64>,
}

/// Files and their sizes below `root`, by their paths in it with `/`, this file left out.
fn sizes(root: &Path) -> Result<BTreeMap<String, u64>> {
    let mut found = BTreeMap::new();
    let mut folders = vec![(root.to_owned(), String::new())];
    while let Some((folder, prefix)) = folders.pop() {
        for entry in fs::read_dir(&folder).during("read", &folder)? {
            let entry = entry.during("read", &folder)?;
            let path = entry.path();
            let name = format!("{prefix}{}", entry.file_name().to_string_lossy());
            let kind = entry.file_type().during("read", &path)?;
            if kind.is_dir() {
                folders.push((path, format!("{name}/")));
            } else if name != FILE {
                found.insert(name, entry.metadata().during("read", &path)?.len());
            }
        }
    }
    Ok(found)
}

fn is_key_file(name: &str) -> bool {
    name.starts_with("bin/")
        || name.starts_with("lib/") && name.matches('/').count() == 1
        || name.ends_with(".rlib")
}

impl Manifest {
    /// Takes stock of the folder `root`.
    pub(crate) fn of(root: &Path, made_from: MadeFrom, sha256: &str, rustc: &str) -> Result<Self> {
        let files = sizes(root)?;
        Ok(Self {
            format: FORMAT,
            made_from,
            sha256: sha256.to_owned(),
            rust_gpu: pinned::RUST_GPU_VERSION.to_owned(),
            rustc: rustc.to_owned(),
            host: pinned::host().to_owned(),
            files: files.len() as u64,
            bytes: files.values().sum(),
            key_files: files
                .into_iter()
                .filter(|(name, _)| is_key_file(name))
                .collect(),
        })
    }

    pub(crate) fn write(&self, root: &Path) -> Result<()> {
        let path = root.join(FILE);
        let mut text = serde_json::to_string_pretty(self)
            .map_err(std::io::Error::from)
            .during("write", &path)?;
        text.push('\n');
        fs::write(&path, text).during("write", &path)
    }

    /// The manifest in `root`, or `None` if there is none.
    pub(crate) fn read(root: &Path) -> Result<Option<Self>> {
        let path = root.join(FILE);
        let text = match fs::read_to_string(&path) {
            Ok(text) => text,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(None),
            Err(error) => return Err(error).during("read", &path),
        };
        let damaged = |why: String| Error::Damaged {
            path: root.to_owned(),
            why: format!("{FILE}: {why}"),
        };
        let manifest: Self =
            serde_json::from_str(&text).map_err(|error| damaged(error.to_string()))?;
        if manifest.format != FORMAT {
            return Err(damaged(format!(
                "format {} is not {FORMAT}",
                manifest.format
            )));
        }
        Ok(Some(manifest))
    }

    /// Checks the programs and libraries: a few dozen files.
    pub(crate) fn check_key_files(&self, root: &Path) -> Result<()> {
        for (name, expected) in &self.key_files {
            let why = match fs::metadata(root.join(name)) {
                Ok(data) if data.len() == *expected => continue,
                Ok(data) => format!("{name} has {} bytes, not {expected}", data.len()),
                Err(_) => format!("{name} is missing"),
            };
            return Err(Error::Damaged {
                path: root.to_owned(),
                why,
            });
        }
        Ok(())
    }

    /// Checks number and total size of all files as well.
    pub(crate) fn check_all(&self, root: &Path) -> Result<()> {
        self.check_key_files(root)?;
        let found = sizes(root)?;
        let (files, bytes) = (found.len() as u64, found.values().sum::<u64>());
        if (files, bytes) == (self.files, self.bytes) {
            return Ok(());
        }
        let why = format!(
            "it has {files} files of {bytes} bytes in total, not {} of {}",
            self.files, self.bytes
        );
        Err(Error::Damaged {
            path: root.to_owned(),
            why,
        })
    }
}
