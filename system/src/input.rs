//! Files of others. What is not a regular file could block for ever or never end, and what is too
//! large could take all memory: both are refused before anything is read.

use std::fs::File;
use std::io::{self, Read};
use std::path::{Path, PathBuf};

/// Why a file was not read.
#[derive(Debug, thiserror::Error)]
pub enum InputError {
    /// The system's words.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// A folder, device, pipe or socket.
    #[error("{}: it is {what}; a regular file is expected", path.display())]
    NotRegular {
        /// What was named.
        path: PathBuf,
        /// What it is.
        what: &'static str,
    },
    /// A file that is larger than it may be.
    #[error("{}: it is larger than the limit of {}", path.display(), size(*most))]
    TooLarge {
        /// The file.
        path: PathBuf,
        /// Bytes that it may have.
        most: u64,
    },
    /// Bytes that are not text.
    #[error("{}: it is not UTF-8 text", path.display())]
    NotText {
        /// The file.
        path: PathBuf,
    },
}

impl InputError {
    /// What is wrong, without the file's name in front.
    #[must_use]
    pub fn problem(&self) -> String {
        match self {
            Self::Io { source, .. } => source.to_string(),
            Self::NotRegular { what, .. } => format!("it is {what}; a regular file is expected"),
            Self::TooLarge { most, .. } => {
                format!("it is larger than the limit of {}", size(*most))
            }
            Self::NotText { .. } => "it is not UTF-8 text".into(),
        }
    }

    /// Whether the machine is to blame, and not the file: it cannot be read although it is one.
    #[must_use]
    pub fn is_machine(&self) -> bool {
        matches!(self, Self::Io { source, .. } if source.kind() == io::ErrorKind::PermissionDenied)
    }

    /// Whether the file is not there.
    #[must_use]
    pub fn is_missing(&self) -> bool {
        matches!(self, Self::Io { source, .. } if source.kind() == io::ErrorKind::NotFound)
    }
}

/// `64 MiB`.
pub(crate) fn size(bytes: u64) -> String {
    match bytes {
        n if n >= 1 << 30 => format!("{} GiB", n >> 30),
        n if n >= 1 << 20 => format!("{} MiB", n >> 20),
        n if n >= 1 << 10 => format!("{} KiB", n >> 10),
        n => format!("{n} bytes"),
    }
}

/// Opens a regular file. A pipe that nobody writes to does not block this.
///
/// # Errors
/// [`InputError::Io`], [`InputError::NotRegular`].
pub fn open(path: &Path) -> Result<File, InputError> {
    let file = open_any(path)?;
    match what(&file, path)? {
        None => Ok(file),
        Some(what) => Err(InputError::NotRegular {
            path: path.into(),
            what,
        }),
    }
}

/// Reads a regular file of at most `most` bytes.
///
/// # Errors
/// [`InputError`].
pub fn read(path: &Path, most: u64) -> Result<Vec<u8>, InputError> {
    let file = open(path)?;
    let mut bytes = Vec::new();
    // One byte more tells whether there is more; a file may grow while it is read.
    file.take(most.saturating_add(1))
        .read_to_end(&mut bytes)
        .map_err(|source| InputError::Io {
            path: path.into(),
            source,
        })?;
    if bytes.len() as u64 > most {
        return Err(InputError::TooLarge {
            path: path.into(),
            most,
        });
    }
    Ok(bytes)
}

/// Reads a regular file of at most `most` bytes of UTF-8 text.
///
/// # Errors
/// [`InputError`].
pub fn read_text(path: &Path, most: u64) -> Result<String, InputError> {
    String::from_utf8(read(path, most)?).map_err(|_| InputError::NotText { path: path.into() })
}

/// Opens what there is, without waiting for another program.
fn open_any(path: &Path) -> Result<File, InputError> {
    let mut options = File::options();
    options.read(true);
    #[cfg(unix)]
    {
        use std::os::unix::fs::OpenOptionsExt;
        // Regular files do not care.
        options.custom_flags(rustix::fs::OFlags::NONBLOCK.bits().cast_signed());
    }
    options.open(path).map_err(|source| InputError::Io {
        path: path.into(),
        source,
    })
}

/// What it is, if it is not a regular file, in words.
fn what(file: &File, path: &Path) -> Result<Option<&'static str>, InputError> {
    let metadata = file.metadata().map_err(|source| InputError::Io {
        path: path.into(),
        source,
    })?;
    Ok(kind(&metadata.file_type()))
}

/// What it is, if it is not a regular file, in words.
pub(crate) fn kind(file: &std::fs::FileType) -> Option<&'static str> {
    #[cfg(unix)]
    {
        use std::os::unix::fs::FileTypeExt;
        if file.is_fifo() {
            return Some("a pipe");
        }
        if file.is_char_device() || file.is_block_device() {
            return Some("a device");
        }
        if file.is_socket() {
            return Some("a socket");
        }
    }
    match (file.is_file(), file.is_dir()) {
        (true, _) => None,
        (_, true) => Some("a folder"),
        _ => Some("not a regular file"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_ends_is_read() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("file");
        std::fs::write(&path, "12345").unwrap();
        assert_eq!(read(&path, 5).unwrap(), b"12345");
        let error = read(&path, 4).unwrap_err();
        assert!(
            error.to_string().contains("the limit of 4 bytes"),
            "{error}"
        );
        let error = read(folder.path(), 10).unwrap_err().to_string();
        assert!(error.contains("a folder"), "{error}");
        assert!(
            read(&folder.path().join("nowhere"), 1)
                .unwrap_err()
                .is_missing()
        );
        std::fs::write(&path, [0xff, 0xfe]).unwrap();
        assert!(
            read_text(&path, 5)
                .unwrap_err()
                .to_string()
                .contains("UTF-8")
        );
        #[cfg(unix)]
        {
            let error = read(Path::new("/dev/zero"), 10).unwrap_err().to_string();
            assert!(error.contains("a device"), "{error}");
            let fifo = folder.path().join("fifo");
            assert!(
                std::process::Command::new("mkfifo")
                    .arg(&fifo)
                    .status()
                    .unwrap()
                    .success()
            );
            let error = read(&fifo, 10).unwrap_err().to_string();
            assert!(error.contains("a pipe"), "{error}");
        }
    }
}
