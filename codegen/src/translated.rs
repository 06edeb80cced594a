//! Kernels in their languages, kept from one build to the next (`kept.rs`). An edit changes few of a crate's kernels,
//! and to translate all others again would take seconds.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::Mutex;

use hankel_dsl::native::describe::Kernel;
use serde::{Deserialize, Serialize};

use crate::Language;
use crate::build::{Made, Modules, Variant};
use crate::error::Failure;
use crate::files::sha256;
use crate::headers::Layouts;
use crate::kept::Kept;
use crate::manifest::KernelEntry;

/// What was made of kernels by earlier builds.
pub(crate) struct Translated {
    kept: Kept,
    /// What every translation follows from, beside its own kernel; `None`: it cannot be told.
    base: Option<String>,
    /// The names of what this build used.
    used: Mutex<BTreeSet<String>>,
}

/// The beginning of a kept file; the contents of `files` follow.
#[derive(Serialize, Deserialize)]
struct Head {
    entry: KernelEntry,
    spirv: String,
    /// Paths, and their contents' sizes in bytes.
    files: Vec<(String, usize)>,
}

impl Translated {
    pub(crate) fn within(folder: &Path, targets: &BTreeSet<Language>, layouts: &Layouts) -> Self {
        let base = program().map(|program| {
            let versions = [
                env!("HANKEL_CODEGEN_SHA256"),
                env!("HANKEL_NAGA_VERSION"),
                env!("HANKEL_SPIRV_TOOLS_VERSION"),
            ];
            sha256(format!("{program}\n{versions:?}\n{targets:?}\n{layouts:?}").as_bytes())
        });
        // Builds in other languages keep theirs.
        let languages = &sha256(format!("{targets:?}").as_bytes())[..16];
        Self {
            kept: Kept::of("texts", folder.join(languages)),
            base,
            used: Mutex::default(),
        }
    }

    /// What is kept of a kernel, or what `make` makes of it.
    pub(crate) fn get(
        &self,
        job: &Variant,
        modules: &Modules,
        make: impl FnOnce() -> Result<Made, Failure>,
    ) -> Result<Made, Failure> {
        let Some(name) = self.name_of(job, modules) else {
            return make();
        };
        let kept = self.kept.read(&name).and_then(|bytes| read(&bytes));
        let made = match kept {
            Some(mut made) => {
                made.entry.line = job.kernel.line;
                made
            }
            None => {
                let made = make()?;
                if let Some(bytes) = bytes(&made) {
                    self.kept.write(&name, &bytes);
                }
                made
            }
        };
        if let Ok(mut used) = self.used.lock() {
            used.insert(name);
        }
        Ok(made)
    }

    /// Removes what this build has not used.
    pub(crate) fn sweep(&self) {
        if let Ok(used) = self.used.lock() {
            self.kept.sweep(&used.iter().map(String::as_str).collect());
        }
    }

    /// A name that says what a translation follows from.
    fn name_of(&self, job: &Variant, modules: &Modules) -> Option<String> {
        let base = self.base.as_ref()?;
        let Variant {
            of,
            kernel,
            options,
            set,
        } = job;
        let (kind, all) = match modules {
            Modules::Raw(all) => ("raw", all),
            Modules::Final(all) => ("final", all),
        };
        let module = sha256(all.get(of)?);
        // An edit above a kernel moves its line, and nothing else.
        let kernel = Kernel {
            line: 0,
            ..kernel.clone()
        };
        let description = serde_json::to_string(&kernel).ok()?;
        let parts = format!("{base}\n{kind} {of} {module} {set}\n{options:?}\n{description}");
        Some(sha256(parts.as_bytes()))
    }
}

/// Which program this is: texts follow from all of its code.
fn program() -> Option<String> {
    let file = std::env::current_exe().ok()?;
    let data = std::fs::metadata(file).ok()?;
    Some(format!("{} {:?}", data.len(), data.modified().ok()?))
}

fn bytes(made: &Made) -> Option<Vec<u8>> {
    let files = made.files.iter();
    let head = Head {
        entry: made.entry.clone(),
        spirv: made.spirv.clone(),
        files: files
            .map(|(path, content)| (path.clone(), content.len()))
            .collect(),
    };
    let mut bytes = serde_json::to_vec(&head).ok()?;
    bytes.push(b'\n');
    bytes.extend(made.files.iter().flat_map(|(_, content)| content));
    Some(bytes)
}

fn read(bytes: &[u8]) -> Option<Made> {
    let end = bytes.iter().position(|byte| *byte == b'\n')?;
    let head: Head = serde_json::from_slice(&bytes[..end]).ok()?;
    let mut rest = &bytes[end + 1..];
    let mut files = Vec::new();
    for (path, size) in head.files {
        let (content, after) = rest.split_at_checked(size)?;
        files.push((path, content.to_vec()));
        rest = after;
    }
    Some(Made {
        entry: head.entry,
        files,
        spirv: head.spirv,
    })
}

/// Where the texts of a crate's kernels are kept, within cargo's target folder.
#[must_use]
pub fn folder(target: &Path, crate_name: &str) -> PathBuf {
    target.join("hankel/translated").join(crate_name)
}
