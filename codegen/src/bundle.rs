//! SPIR-V that is committed, with the hash of the sources that it was made from: whoever has no
//! rust-gpu builds from it, as long as the hash holds.
//!
//! A bundle is a folder of `.spv` files, one for each entry point, final, and `source.json`.

use std::collections::BTreeMap;
use std::path::Path;

use hankel_dsl::native::describe::Kernel;
use serde::{Deserialize, Serialize};

use crate::compile::Compiled;
use crate::error::{During, Error, Result};
use crate::files::{self, sha256};
use crate::finish::PIPELINE;
use crate::folder::{Folder, MOST_BYTES, Owned};
use crate::inputs::Inputs;

/// The file that says what a bundle is made from.
pub const SOURCE_FILE: &str = "source.json";

/// What a bundle is made from.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Origin {
    /// The kernel crate.
    pub crate_name: String,
    /// What made it.
    pub made_by: MadeBy,
    /// Hash of the kernels' descriptions, as far as SPIR-V follows from them.
    pub kernels: String,
    /// What the compiler read.
    pub inputs: Inputs,
    /// SHA-256 of each module, by entry point.
    pub modules: BTreeMap<String, String>,
}

/// What made a bundle.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MadeBy {
    /// Version of rust-gpu.
    pub rust_gpu: String,
    /// What its compiler's `rustc --version` prints.
    pub compiler: String,
    /// The crate with SPIRV-Tools.
    pub spirv_tools: String,
    /// [`PIPELINE`] of the Hankel that finished the modules.
    pub pipeline: String,
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
    /// `modules`, which were just finished from what was `compiled` of `kernels`.
    pub fn new(
        crate_name: &str,
        kernels: &[Kernel],
        rust_gpu: &str,
        compiled: &Compiled,
        modules: BTreeMap<String, Vec<u8>>,
    ) -> Self {
        let origin = Origin {
            crate_name: crate_name.into(),
            made_by: MadeBy {
                rust_gpu: rust_gpu.into(),
                compiler: compiled.compiler.clone(),
                spirv_tools: env!("HANKEL_SPIRV_TOOLS_VERSION").into(),
                pipeline: PIPELINE.into(),
            },
            kernels: hash_of(kernels),
            inputs: compiled.inputs.clone(),
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
        let source = files::read(&folder.join(SOURCE_FILE), MOST_BYTES)?;
        Self::assemble(folder, &source, |name| {
            files::read(&folder.join(name), MOST_BYTES)
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
        let mut json =
            serde_json::to_string_pretty(&self.origin).map_err(|error| Error::Bundle {
                path: folder.join(SOURCE_FILE),
                problem: error.to_string(),
            })?;
        json.push('\n');
        let mut files: BTreeMap<String, Vec<u8>> = self
            .modules
            .iter()
            .map(|(name, bytes)| (format!("{name}.spv"), bytes.clone()))
            .collect();
        files.insert(SOURCE_FILE.into(), json.into_bytes());
        let place = Folder::create(folder)?;
        let mut owned = Owned::new();
        for entry in std::fs::read_dir(folder).during("read", folder)? {
            let path = entry.during("read", folder)?.path();
            if path.extension().is_some_and(|extension| extension == "spv") {
                let name = path.file_name().unwrap_or_default().to_string_lossy();
                let hash = sha256(&files::read(&path, MOST_BYTES)?);
                owned.insert(name.into_owned(), [hash].into());
            }
        }
        place.update(&files, SOURCE_FILE, owned, true)?;
        Ok(())
    }

    /// Whether the bundle is made of these kernels by this Hankel and this version of rust-gpu.
    ///
    /// # Errors
    ///
    /// [`Error::Stale`] says what differs.
    pub fn check_made(&self, kernels: &[Kernel], rust_gpu: &str) -> Result<()> {
        let made = &self.origin.made_by;
        let mut reasons = Vec::new();
        let mut compare = |what: &str, theirs: &str, ours: &str| {
            if theirs != ours {
                let short = |text: &str| text.chars().take(12).collect::<String>();
                reasons.push(format!("{what} {}, not {}", short(theirs), short(ours)));
            }
        };
        compare("it was made by rust-gpu", &made.rust_gpu, rust_gpu);
        compare(
            "it was made with SPIRV-Tools",
            &made.spirv_tools,
            env!("HANKEL_SPIRV_TOOLS_VERSION"),
        );
        compare("it was finished by pipeline", &made.pipeline, PIPELINE);
        compare(
            "the kernels' descriptions have the hash",
            &self.origin.kernels,
            &hash_of(kernels),
        );
        stale(reasons)
    }

    /// Whether everything that the compiler read is as it was, for the crate in `folder`.
    ///
    /// # Errors
    ///
    /// [`Error::Stale`] says what differs.
    pub fn check_inputs(&self, folder: &Path) -> Result<()> {
        stale(self.origin.inputs.changes(folder))
    }
}

fn stale(reasons: Vec<String>) -> Result<()> {
    const SHOWN: usize = 3;
    if reasons.is_empty() {
        return Ok(());
    }
    let mut reason = reasons[..reasons.len().min(SHOWN)].join("; ");
    if reasons.len() > SHOWN {
        reason.push_str(&format!("; and {} more", reasons.len() - SHOWN));
    }
    Err(Error::Stale { reason })
}

/// Hash of what SPIR-V follows from: all but where a kernel stands, what is said of it and its licence.
fn hash_of(kernels: &[Kernel]) -> String {
    let mut kernels = kernels.to_vec();
    kernels.sort_by(|a, b| a.name.cmp(&b.name));
    for kernel in &mut kernels {
        kernel.file.clear();
        kernel.line = 0;
        kernel.licence.clear();
        kernel.summary.clear();
    }
    // Nothing in it can fail to become JSON.
    sha256(&serde_json::to_vec(&kernels).unwrap_or_default())
}
