//! Results, kept by what they follow from: the code, the inputs and the reference's results, what
//! may differ, the versions of compilers and drivers, and this program itself.

use std::ffi::OsString;
use std::fs;
use std::path::{Path, PathBuf};

use hankel_codegen::files::{sha256, write_whole};
use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::column::Column;
use crate::tools::Status;

/// The folder of kept results.
#[derive(Debug)]
pub struct Cache {
    folder: Option<PathBuf>,
    /// SHA-256 of the program that runs things.
    program: String,
}

impl Cache {
    /// A cache in `folder`, or one that keeps nothing. `runner` is the program that runs things.
    #[must_use]
    pub fn new(folder: Option<&Path>, runner: &[OsString]) -> Self {
        let program = runner.first().and_then(|p| fs::read(p).ok());
        Self {
            // Without the program's hash, what it does could change unseen.
            folder: folder
                .filter(|_| program.is_some())
                .map(|f| f.join("matrix")),
            program: sha256(&program.unwrap_or_default()),
        }
    }

    /// The name of what follows from `what`.
    #[must_use]
    pub fn key(&self, what: &impl Serialize) -> String {
        let text = serde_json::to_string(&(&self.program, what)).unwrap_or_default();
        sha256(text.as_bytes())
    }

    /// What was kept under a name.
    #[must_use]
    pub fn get<T: DeserializeOwned>(&self, key: &str) -> Option<T> {
        let bytes = fs::read(self.folder.as_ref()?.join(format!("{key}.json"))).ok()?;
        serde_json::from_slice(&bytes).ok()
    }

    /// Keeps something. What cannot be kept is made again next time.
    pub fn put(&self, key: &str, what: &impl Serialize) {
        let Some(folder) = &self.folder else { return };
        if let Ok(text) = serde_json::to_vec(what)
            && fs::create_dir_all(folder).is_ok()
        {
            let _ = write_whole(&folder.join(format!("{key}.json")), &text);
        }
    }

    /// The name under which the device is kept that ran a column.
    #[must_use]
    pub fn device_key(&self, column: Column, tools: &[Status]) -> String {
        let own: Vec<&Status> = column.statuses(tools).collect();
        self.key(&("device", column, own))
    }
}
