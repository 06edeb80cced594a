//! Waiting for edits.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, channel};
use std::time::Duration;

use notify::{Event, EventKind, RecommendedWatcher, RecursiveMode, Watcher};

use crate::failure::{Failure, Result};

/// Editors write a file in several steps: a change counts when nothing has followed it for this
/// long.
const QUIET: Duration = Duration::from_millis(30);

/// Waits for changes in folders. Folders are watched, not files: editors replace files.
pub struct Edits {
    watcher: RecommendedWatcher,
    events: Receiver<notify::Result<Event>>,
    watched: BTreeSet<PathBuf>,
    ignored: PathBuf,
}

impl Edits {
    /// Watches nothing yet; what lies in the folder `ignored` will not count.
    ///
    /// # Errors
    /// The system has no way to tell of changes.
    pub fn new(ignored: &Path) -> Result<Self> {
        let (sender, events) = channel();
        let watcher = notify::recommended_watcher(sender)
            .map_err(|e| Failure::machine(format!("files cannot be watched: {e}"), None))?;
        let ignored = std::path::absolute(ignored).unwrap_or_else(|_| ignored.to_owned());
        Ok(Self {
            watcher,
            events,
            watched: BTreeSet::new(),
            ignored: ignored.canonicalize().unwrap_or(ignored),
        })
    }

    /// Watches the folders of `inputs` (files or folders), and all folders below `sources`.
    /// Folders that are watched already are left alone, those that cannot be are left out.
    pub fn add(&mut self, inputs: &[PathBuf], sources: &Path) {
        let mut folders = BTreeSet::new();
        below(sources, &mut folders);
        below(&sources.join(".cargo"), &mut folders);
        for input in inputs {
            let folder = if input.is_dir() {
                Some(input.as_path())
            } else {
                input.parent()
            };
            folders.extend(folder.and_then(|f| f.canonicalize().ok()));
        }
        for folder in folders {
            if !self.watched.contains(&folder)
                && self
                    .watcher
                    .watch(&folder, RecursiveMode::NonRecursive)
                    .is_ok()
            {
                self.watched.insert(folder);
            }
        }
    }

    /// Returns after the next edit.
    ///
    /// # Errors
    /// The system tells of no more changes.
    pub fn wait(&self) -> Result<()> {
        loop {
            let event = self
                .events
                .recv()
                .map_err(|e| Failure::machine(format!("files are no longer watched: {e}"), None))?;
            if self.counts(&event) {
                break;
            }
        }
        // The rest of the same edit.
        while self.events.recv_timeout(QUIET).is_ok() {}
        Ok(())
    }

    fn counts(&self, event: &notify::Result<Event>) -> bool {
        // Events were lost: anything may have changed.
        let Ok(event) = event else { return true };
        if matches!(event.kind, EventKind::Access(_)) {
            return false;
        }
        event.need_rescan()
            || event.paths.iter().any(|path| {
                let name = path.file_name().unwrap_or_default().to_string_lossy();
                // cargo writes the lock file, editors hidden files and copies.
                let own = name.starts_with('.') && name != ".cargo"
                    || name.ends_with('~')
                    || name == "Cargo.lock";
                !own && !path.starts_with(&self.ignored)
            })
    }
}

/// A folder and those below it, without hidden ones and cargo's.
fn below(folder: &Path, found: &mut BTreeSet<PathBuf>) {
    let Ok(folder) = folder.canonicalize() else {
        return;
    };
    let entries = std::fs::read_dir(&folder).into_iter().flatten().flatten();
    for entry in entries {
        let name = entry.file_name().to_string_lossy().into_owned();
        let is_folder = entry.file_type().is_ok_and(|kind| kind.is_dir());
        if is_folder && !name.starts_with('.') && name != "target" {
            below(&entry.path(), found);
        }
    }
    found.insert(folder);
}
