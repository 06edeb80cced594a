//! Files of others. What is no regular file could block for ever or never end, and what is too
//! large could take all memory: both are refused before anything is read.

use std::fs::File;
use std::io::{self, BufRead, BufReader, Read};
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
    #[error("{}: it has more than the {} that are read at most", path.display(), size(*most))]
    TooLarge {
        /// The file.
        path: PathBuf,
        /// Bytes that it may have.
        most: u64,
    },
    /// Bytes that are no text.
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
                format!("it has more than the {} that are read at most", size(*most))
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
fn size(bytes: u64) -> String {
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

/// Bytes that a row of a table may have, with the line breaks in its quoted cells.
pub const ROW: usize = 1 << 20;

/// Opens a table in CSV, which is read row by row: a regular file of any length, or a pipe, in
/// which another program may write it. A row of more than [`ROW`] bytes is an error while reading,
/// and so is a quoted cell that the file does not close; the error names the line.
///
/// # Errors
/// [`InputError::Io`]; [`InputError::NotRegular`] for folders, devices and sockets.
pub fn open_table(path: &Path) -> Result<Rows, InputError> {
    // A named pipe that nobody has opened yet: this waits for its writer, as every program does.
    let file = if is_pipe(path) {
        File::open(path).map_err(|source| InputError::Io {
            path: path.into(),
            source,
        })?
    } else {
        open(path)?
    };
    Ok(Rows {
        from: BufReader::with_capacity(1 << 16, file),
        is_new: true,
        place: Place {
            part: Part::Start,
            bytes: 0,
            line: 1,
            row: 1,
            quote: 1,
        },
    })
}

#[cfg(unix)]
fn is_pipe(path: &Path) -> bool {
    use std::os::unix::fs::FileTypeExt;
    path.metadata().is_ok_and(|m| m.file_type().is_fifo())
}

#[cfg(not(unix))]
fn is_pipe(_: &Path) -> bool {
    false
}

/// A reader of a table in CSV whose rows have at most [`ROW`] bytes, and whose quoted cells end.
#[derive(Debug)]
pub struct Rows {
    from: BufReader<File>,
    /// Whether nothing was read yet.
    is_new: bool,
    place: Place,
}

impl Read for Rows {
    fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
        let from = self.from.fill_buf()?;
        if from.is_empty() {
            self.place.end()?;
            return Ok(0);
        }
        let count = from.len().min(into.len());
        into[..count].copy_from_slice(&from[..count]);
        self.from.consume(count);
        let mut bytes = &into[..count];
        // The mark of UTF-8, which the first cell may have in front of its quote.
        if self.is_new {
            bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
        }
        self.is_new = false;
        self.place.follow(bytes)?;
        Ok(count)
    }
}

/// Where in a table its reader is.
#[derive(Debug)]
struct Place {
    part: Part,
    /// Bytes of the row so far.
    bytes: usize,
    /// The present line, from 1.
    line: u64,
    /// The line on which the row begins.
    row: u64,
    /// The line with the last quote that began a cell.
    quote: u64,
}

/// A part of a row.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Part {
    /// The beginning of a cell.
    Start,
    /// A cell without quotes, where a quote means nothing.
    Plain,
    /// A quoted cell, where commas and line breaks mean nothing.
    Quoted,
    /// Behind a quote in a quoted cell: it ends the cell, or a second one makes it a letter.
    Quote,
}

impl Place {
    /// Goes on behind these bytes.
    fn follow(&mut self, bytes: &[u8]) -> io::Result<()> {
        for &byte in bytes {
            self.step(byte);
            if self.bytes > ROW {
                return Err(self.too_long());
            }
        }
        Ok(())
    }

    fn step(&mut self, byte: u8) {
        self.bytes += 1;
        if byte == b'\n' {
            self.line += 1;
        }
        self.part = match (self.part, byte) {
            (Part::Start, b'"') => {
                self.quote = self.line;
                Part::Quoted
            }
            (Part::Quoted, b'"') => Part::Quote,
            (Part::Quoted, _) | (Part::Quote, b'"') => Part::Quoted,
            (_, b',') => Part::Start,
            (_, b'\n' | b'\r') => {
                self.bytes = 0;
                self.row = self.line;
                Part::Start
            }
            _ => Part::Plain,
        };
    }

    fn too_long(&self) -> io::Error {
        let most = size(ROW as u64);
        match self.part {
            Part::Quoted => refusal(
                self.quote,
                &format!(
                    "the quote that begins a cell there is not closed within the {most} that a row \
                     may have: close it, or leave it out"
                ),
            ),
            _ => refusal(
                self.row,
                &format!(
                    "the row that begins there has more than the {most} that are read at most"
                ),
            ),
        }
    }

    /// What is wrong with a table that ends here.
    fn end(&self) -> io::Result<()> {
        match self.part {
            Part::Quoted => Err(refusal(
                self.quote,
                "the quote that begins a cell there is not closed where the file ends: close it, \
                 or write the table again if its end is missing",
            )),
            _ => Ok(()),
        }
    }
}

/// Why a table is not read on, and in which line.
fn refusal(line: u64, problem: &str) -> io::Error {
    io::Error::new(
        io::ErrorKind::InvalidData,
        format!("line {line}: {problem}"),
    )
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

/// What is no regular file, in words.
fn what(file: &File, path: &Path) -> Result<Option<&'static str>, InputError> {
    let metadata = file.metadata().map_err(|source| InputError::Io {
        path: path.into(),
        source,
    })?;
    Ok(kind(&metadata.file_type()))
}

/// What is no regular file, in words.
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
        _ => Some("no regular file"),
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
            error.to_string().contains("more than the 4 bytes"),
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

    /// What is wrong with a table of this text.
    fn refused(text: impl AsRef<[u8]>) -> Option<String> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("table");
        std::fs::write(&path, &text).unwrap();
        let mut read = Vec::new();
        match open_table(&path).unwrap().read_to_end(&mut read) {
            Ok(_) => {
                assert_eq!(read, text.as_ref());
                None
            }
            Err(error) => Some(error.to_string()),
        }
    }

    #[test]
    fn a_row_that_does_not_end_is_refused() {
        let digits = "1".repeat(ROW);
        for (text, words) in [
            (format!("{digits}1"), "line 1: the row"),
            (format!("a,b\n\n1,{digits}"), "line 3: the row"),
            (format!("a\n\"\n\",{digits}"), "line 2: the row"),
            (
                format!("a,b\n1,\"{}", "1\n".repeat(ROW)),
                "line 2: the quote",
            ),
            (format!("\u{feff}\"{digits}"), "line 1: the quote"),
        ] {
            let error = refused(&text).unwrap();
            assert!(error.contains(words) && error.contains("1 MiB"), "{error}");
        }
        assert_eq!(refused(&digits), None);
        for row in ["a,b\n1,2\n", "1,2\r", "\"1\n\",2\r\n"] {
            assert_eq!(refused(row.repeat(ROW / 2)), None);
        }
    }

    #[test]
    fn a_quote_that_is_not_closed_is_refused() {
        for (text, line) in [
            ("a,b\n1,\"2", 2),
            ("a,b\n1,\"2\n3,4\n", 2),
            ("a,b\r\n\"1\r\n2\",\"3", 3),
            ("\"a\"\"", 1),
            ("\u{feff}\"a", 1),
        ] {
            let error = refused(text).unwrap();
            assert!(
                error.contains(&format!("line {line}: the quote")) && error.contains("file ends"),
                "{text:?}: {error}"
            );
        }
        for text in [
            "",
            "a,b\n1,\"2\"",
            "\"a\"\"b\",\"\"\n",
            "a\" b,2\"\n",
            "\"a\"b\"c\n",
            "\u{feff}\"a\nb\"\n",
        ] {
            assert_eq!(refused(text), None, "{text:?}");
        }
    }
}
