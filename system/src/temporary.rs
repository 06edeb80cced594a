//! Folders that are gone after the command, however it ends.

use std::io;
use std::path::{Path, PathBuf};

use tempfile::TempDir;

use crate::signals;

/// A folder that is removed with all that is in it when this is dropped, or when the command is
/// interrupted.
#[derive(Debug)]
pub struct Folder(TempDir);

impl Folder {
    /// A new folder where the system keeps such.
    ///
    /// # Errors
    /// There is no room or no permission.
    pub fn new() -> io::Result<Self> {
        Self::within(&std::env::temp_dir())
    }

    /// A new folder in another one.
    ///
    /// # Errors
    /// As [`Folder::new`].
    pub fn within(folder: &Path) -> io::Result<Self> {
        let folder = tempfile::Builder::new()
            .prefix(".hankel-")
            .tempdir_in(folder)?;
        signals::remember(folder.path());
        Ok(Self(folder))
    }

    /// Where it is.
    #[must_use]
    pub fn path(&self) -> &Path {
        self.0.path()
    }

    /// A name in it.
    #[must_use]
    pub fn join(&self, name: impl AsRef<Path>) -> PathBuf {
        self.path().join(name)
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        // What cannot be removed now is removed by the system, some day.
        let _ = std::fs::remove_dir_all(self.path());
        signals::forget(self.path());
    }
}

impl AsRef<Path> for Folder {
    fn as_ref(&self) -> &Path {
        self.path()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_goes_with_what_is_in_it() {
        let folder = Folder::new().unwrap();
        let path = folder.path().to_owned();
        std::fs::write(folder.join("file"), "text").unwrap();
        drop(folder);
        assert!(!path.exists());
    }
}
