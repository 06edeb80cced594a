//! The folder of installed toolchains.
//!
//! ```text
//! <cache>/toolchains/
//!   rust-gpu-<version>-rust-<version>-<host>/   appears whole or not at all
//!   .new-...                                    being filled; removed by the next run
//!   .old-...                                    being replaced; removed by the next run
//!   .build/                                     stages of the build from source, resumed
//!   .lock                                       held while any of this changes
//! ```

use std::fs::{self, File, TryLockError};
use std::path::{Path, PathBuf};

use crate::error::{During, Error, Result};
use crate::options::Options;
use crate::pinned;
use crate::progress::Progress;

/// The toolchains' folder of one cache.
#[derive(Clone, Debug)]
pub(crate) struct Cache {
    folder: PathBuf,
}

impl Cache {
    pub(crate) fn of(options: &Options) -> Result<Self> {
        Ok(Self {
            folder: options.cache_folder()?.join("toolchains"),
        })
    }

    pub(crate) fn folder(&self) -> &Path {
        &self.folder
    }

    /// Where the toolchain of this version for this machine is, if it is installed.
    pub(crate) fn installed(&self) -> PathBuf {
        self.folder.join(pinned::name())
    }

    /// Where a toolchain is while another one takes its place.
    fn replaced(&self) -> PathBuf {
        self.folder.join(format!(".old-{}", pinned::name()))
    }

    /// Where the build from source keeps its stages.
    pub(crate) fn build(&self) -> PathBuf {
        self.folder.join(".build")
    }

    /// Waits until no other process changes this folder, then removes what interrupted
    /// ones left in it.
    pub(crate) fn lock(&self, progress: &mut dyn Progress) -> Result<Locked> {
        fs::create_dir_all(&self.folder).during("create", &self.folder)?;
        let path = self.folder.join(".lock");
        let file = File::options()
            .create(true)
            .truncate(false)
            .write(true)
            .open(&path)
            .during("open", &path)?;
        match file.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => {
                progress.line("waiting for another installation to end");
                file.lock().during("lock", &path)?;
            }
            Err(TryLockError::Error(error)) => return Err(error).during("lock", &path),
        }
        let locked = Locked {
            cache: self.clone(),
            _file: file,
        };
        locked.sweep()?;
        Ok(locked)
    }
}

/// The right to change the folder; ends when dropped, or with the process.
#[derive(Debug)]
pub(crate) struct Locked {
    cache: Cache,
    _file: File,
}

impl Locked {
    pub(crate) fn cache(&self) -> &Cache {
        &self.cache
    }

    fn sweep(&self) -> Result<()> {
        let folder = &self.cache.folder;
        // A replacement that was interrupted between its two steps: the toolchain that was there stays.
        let (installed, old) = (self.cache.installed(), self.cache.replaced());
        if old.is_dir() && !installed.exists() {
            fs::rename(&old, &installed).during("restore", &installed)?;
        }
        for entry in fs::read_dir(folder).during("read", folder)? {
            let entry = entry.during("read", folder)?;
            let name = entry.file_name();
            let name = name.to_string_lossy();
            if name.starts_with(".new-") || name.starts_with(".old-") {
                let path = entry.path();
                let folder = entry.file_type().is_ok_and(|kind| kind.is_dir());
                let removed = if folder {
                    fs::remove_dir_all(&path)
                } else {
                    fs::remove_file(&path)
                };
                removed.during("remove", &path)?;
            }
        }
        Ok(())
    }

    /// Makes an empty folder to fill.
    pub(crate) fn staging(&self) -> Result<Staging<'_>> {
        let path = self.cache.folder.join(format!(".new-{}", pinned::name()));
        fs::create_dir(&path).during("create", &path)?;
        hankel_system::signals::remember(&path);
        Ok(Staging { locked: self, path })
    }
}

/// A folder that is being filled. It goes when dropped, unless it was published.
#[derive(Debug)]
pub(crate) struct Staging<'a> {
    locked: &'a Locked,
    path: PathBuf,
}

impl Staging<'_> {
    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    /// Gives the folder its final name, in place of what had that name.
    pub(crate) fn publish(self) -> Result<PathBuf> {
        let target = self.locked.cache.installed();
        let old = self.locked.cache.replaced();
        match fs::rename(&target, &old) {
            Ok(()) => {}
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => {}
            Err(error) => return Err(error).during("replace", &target),
        }
        fs::rename(&self.path, &target).during("create", &target)?;
        if old.exists() {
            fs::remove_dir_all(&old).during("remove", &old)?;
        }
        Ok(target)
    }
}

impl Drop for Staging<'_> {
    fn drop(&mut self) {
        // After `publish` it is gone already. What cannot be removed now is swept later.
        let _ = fs::remove_dir_all(&self.path);
        hankel_system::signals::forget(&self.path);
    }
}

/// Fails if fewer than `needed` bytes are free where `folder`, which may not exist yet,
/// will be.
pub(crate) fn check_space(options: &Options, folder: &Path, needed: u64) -> Result<()> {
    let existing = folder
        .ancestors()
        .find(|path| path.is_dir())
        .unwrap_or(folder);
    let available = (options.free_space)(existing).during("ask for free space in", existing)?;
    if available < needed {
        return Err(Error::NoSpace {
            folder: folder.to_owned(),
            needed,
            available,
        });
    }
    Ok(())
}
