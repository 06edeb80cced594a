//! Results that are kept from one build to the next. A file is named by the hash of all that its content follows
//! from. So a kept file is never stale, and one that is missing or damaged is made again.

use std::collections::BTreeSet;
use std::path::PathBuf;

use crate::files::{self, sha256, write_whole};
use crate::folder::MOST_BYTES;

/// Length of the hash that stands before what is kept.
const HASH: usize = 64;

/// A folder of results that are kept.
#[derive(Clone, Debug)]
pub(crate) struct Kept {
    folder: PathBuf,
    /// The end of its files' names, after a dot.
    extension: &'static str,
}

impl Kept {
    /// Modules.
    pub(crate) fn within(folder: impl Into<PathBuf>) -> Self {
        Self::of("spv", folder)
    }

    pub(crate) fn of(extension: &'static str, folder: impl Into<PathBuf>) -> Self {
        Self {
            folder: folder.into(),
            extension,
        }
    }

    /// The file of a result.
    fn file(&self, name: &str) -> PathBuf {
        self.folder.join(format!("{name}.{}", self.extension))
    }

    /// A result, if it is the one that was written.
    pub(crate) fn read(&self, name: &str) -> Option<Vec<u8>> {
        let mut file = files::read(&self.file(name), MOST_BYTES).ok()?;
        let bytes = file.split_off(HASH.min(file.len()));
        (file == sha256(&bytes).as_bytes()).then_some(bytes)
    }

    /// Keeps a result. One that cannot be kept is made again next time.
    pub(crate) fn write(&self, name: &str, bytes: &[u8]) {
        let mut file = sha256(bytes).into_bytes();
        file.extend_from_slice(bytes);
        let _ = write_whole(&self.file(name), &file);
    }

    /// Removes results of other names. A failure leaves a file that the next build removes.
    pub(crate) fn sweep(&self, used: &BTreeSet<&str>) {
        let entries = std::fs::read_dir(&self.folder)
            .into_iter()
            .flatten()
            .flatten();
        for path in entries.map(|entry| entry.path()) {
            let is_used = |stem: &str| used.contains(stem);
            let stem = path.file_stem().and_then(|stem| stem.to_str());
            if path.extension().is_some_and(|it| it == self.extension) && !stem.is_some_and(is_used)
            {
                let _ = std::fs::remove_file(&path);
            }
        }
    }
}
