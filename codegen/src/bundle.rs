//! SPIR-V that is committed, with the hash of the sources that it was made from: whoever has no
//! rust-gpu builds from it, as long as the hash holds.
//!
//! A bundle is a folder of `.spv` files, one for each entry point, final, and `source.json`.

use std::collections::BTreeMap;
use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::error::{During, Error, Result};
use crate::files::{sha256, write_whole};
use crate::finish::PIPELINE;
use crate::source_hash::Sources;

/// The file that says what a bundle is made from.
pub const SOURCE_FILE: &str = "source.json";

/// What a bundle is made from.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Origin {
    /// The kernel crate.
    pub crate_name: String,
    /// [`Sources::sha256`] of it.
    pub source_sha256: String,
    /// Version of rust-gpu.
    pub rust_gpu: String,
    /// [`PIPELINE`] of the Hankel that finished the modules.
    pub pipeline: u32,
    /// SHA-256 of each module, by entry point.
    pub modules: BTreeMap<String, String>,
}

/// Final SPIR-V of a kernel crate, and where it comes from.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Bundle {
    /// What it is made from.
    pub origin: Origin,
    /// The modules by entry point.
    pub modules: BTreeMap<String, Vec<u8>>,
}

impl Bundle {
    /// Modules that were just made from `sources`.
    pub fn new(sources: &Sources, rust_gpu: &str, modules: BTreeMap<String, Vec<u8>>) -> Self {
        let origin = Origin {
            crate_name: sources.name.clone(),
            source_sha256: sources.sha256.clone(),
            rust_gpu: rust_gpu.into(),
            pipeline: PIPELINE,
            modules: modules
                .iter()
                .map(|(name, bytes)| (name.clone(), sha256(bytes)))
                .collect(),
        };
        Self { origin, modules }
    }

    /// Reads a bundle's folder.
    ///
    /// # Errors
    ///
    /// A file is missing, unreadable, or not the one that `source.json` means.
    pub fn read(folder: &Path) -> Result<Self> {
        let path = folder.join(SOURCE_FILE);
        let source = std::fs::read(&path).during("read", &path)?;
        Self::assemble(folder, &source, |name| {
            let path = folder.join(name);
            std::fs::read(&path).during("read", &path)
        })
    }

    /// Reads a bundle that is embedded in the program: file names and contents.
    ///
    /// # Errors
    ///
    /// As for [`Self::read`].
    pub fn from_files(files: &[(&str, &[u8])]) -> Result<Self> {
        let place = Path::new("the embedded SPIR-V");
        let find = |name: &str| {
            let file = files.iter().find(|(file, _)| *file == name);
            file.map(|(_, bytes)| bytes.to_vec())
                .ok_or_else(|| Error::Bundle {
                    path: place.join(name),
                    problem: "there is no such file".into(),
                })
        };
        Self::assemble(place, &find(SOURCE_FILE)?, find)
    }

    fn assemble(
        folder: &Path,
        source: &[u8],
        read: impl Fn(&str) -> Result<Vec<u8>>,
    ) -> Result<Self> {
        let origin: Origin = serde_json::from_slice(source).map_err(|error| Error::Bundle {
            path: folder.join(SOURCE_FILE),
            problem: error.to_string(),
        })?;
        let mut modules = BTreeMap::new();
        for (name, expected) in &origin.modules {
            let file = format!("{name}.spv");
            let bytes = read(&file)?;
            if sha256(&bytes) != *expected {
                return Err(Error::Bundle {
                    path: folder.join(file),
                    problem: format!("it is not the file that {SOURCE_FILE} means"),
                });
            }
            modules.insert(name.clone(), bytes);
        }
        Ok(Self { origin, modules })
    }

    /// Writes the bundle's folder, and removes modules of other kernels from it. Files that
    /// already are as they should be are left alone.
    ///
    /// # Errors
    ///
    /// A file cannot be written or removed.
    pub fn write(&self, folder: &Path) -> Result<()> {
        std::fs::create_dir_all(folder).during("create", folder)?;
        let put = |name: &str, bytes: &[u8]| {
            let path = folder.join(name);
            let there = std::fs::read(&path).is_ok_and(|there| there == bytes);
            if there {
                Ok(())
            } else {
                write_whole(&path, bytes)
            }
        };
        for (name, bytes) in &self.modules {
            put(&format!("{name}.spv"), bytes)?;
        }
        let mut json =
            serde_json::to_string_pretty(&self.origin).map_err(|error| Error::Bundle {
                path: folder.join(SOURCE_FILE),
                problem: error.to_string(),
            })?;
        json.push('\n');
        put(SOURCE_FILE, json.as_bytes())?;
        for entry in std::fs::read_dir(folder).during("read", folder)? {
            let path = entry.during("read", folder)?.path();
            let name = path
                .file_stem()
                .unwrap_or_default()
                .to_string_lossy()
                .into_owned();
            let module = path.extension().is_some_and(|extension| extension == "spv");
            if module && !self.modules.contains_key(&name) {
                std::fs::remove_file(&path).during("remove", &path)?;
            }
        }
        Ok(())
    }

    /// Whether the bundle is made from the sources with this hash, by this pipeline.
    ///
    /// # Errors
    ///
    /// [`Error::Stale`] says what differs.
    pub fn check_current(&self, source_sha256: &str) -> Result<()> {
        let short = |hash: &str| hash.chars().take(12).collect::<String>();
        let reason = if self.origin.pipeline != PIPELINE {
            format!(
                "it was finished by pipeline {}, this is {PIPELINE}",
                self.origin.pipeline
            )
        } else if self.origin.source_sha256 != source_sha256 {
            format!(
                "`{}` has changed (its hash is {}, the SPIR-V's {})",
                self.origin.crate_name,
                short(source_sha256),
                short(&self.origin.source_sha256)
            )
        } else {
            return Ok(());
        };
        Err(Error::Stale { reason })
    }
}
