//! Tables in CSV, which are read row by row, so that they may be larger than memory: regular files of any
//! length, or pipes, into which another program may write them.

use std::fs::File;
use std::io::{self, BufRead, BufReader, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use csv::{Position, StringRecord};

use crate::input::{self, InputError, size};

/// A row or a cell of a table that cannot be used.
#[derive(Debug, thiserror::Error)]
#[error("{}: row {row} (line {line}){}: {problem}", path.display(), column.as_ref().map_or_else(String::new, |c| format!(", column `{c}`")))]
pub struct CellError {
    /// The file.
    pub path: PathBuf,
    /// Row, from 1, without the header.
    pub row: u64,
    /// Line of the file, from 1.
    pub line: u64,
    /// The column; none for the row as a whole.
    pub column: Option<String>,
    /// What is wrong.
    pub problem: String,
}

/// Columns other than those that are wanted.
#[derive(Debug, thiserror::Error)]
#[error("{}: {problem}; the columns must be: {wanted}", path.display())]
pub struct ColumnsError {
    /// The file.
    pub path: PathBuf,
    /// Which is wrong, and how.
    pub problem: String,
    /// The columns that there must be, in any order.
    pub wanted: String,
}

/// Why a table's next row was not read.
#[derive(Debug, thiserror::Error)]
pub enum TableError {
    /// The file cannot be read: its own words, or a row of more than 1 MiB, or a quoted cell that the file does not
    /// close.
    #[error(transparent)]
    Input(#[from] InputError),
    /// A row that is not text, or has more or fewer cells than the header.
    #[error(transparent)]
    Cell(#[from] CellError),
}

/// A table with a header.
#[derive(Debug)]
pub struct Table {
    path: PathBuf,
    header: StringRecord,
    reader: csv::Reader<Rows>,
    /// Rows that were read.
    count: u64,
}

/// Where a row is.
#[derive(Clone, Debug)]
pub struct Place {
    row: u64,
    position: Option<Position>,
}

impl Table {
    /// Opens a table and reads its header. A pipe that nobody has opened yet is waited for, as every program does.
    ///
    /// # Errors
    /// [`InputError::Io`]; [`InputError::NotRegular`] for folders, devices and sockets.
    pub fn open(path: &Path) -> Result<Self, InputError> {
        let mut reader = csv::ReaderBuilder::new()
            .flexible(true)
            .trim(csv::Trim::All)
            .from_reader(open_rows(path)?);
        let header = reader.headers().map_err(|e| InputError::Io {
            path: path.into(),
            source: e.into(),
        })?;
        Ok(Self {
            path: path.into(),
            header: header.clone(),
            reader,
            count: 0,
        })
    }

    /// The file.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Names of the columns, without blanks around them.
    #[must_use]
    pub fn header(&self) -> &StringRecord {
        &self.header
    }

    /// For each column of the file, which of the wanted ones it is: each is there once, in any order.
    ///
    /// # Errors
    /// [`ColumnsError`].
    pub fn columns(&self, wanted: &[&str]) -> Result<Vec<usize>, ColumnsError> {
        let wrong = |problem: String| ColumnsError {
            path: self.path.clone(),
            problem,
            wanted: wanted.join(", "),
        };
        if self.header.iter().all(str::is_empty) {
            return Err(wrong("it has no header".into()));
        }
        let mut found = Vec::new();
        for (i, name) in self.header.iter().enumerate() {
            let Some(place) = wanted.iter().position(|w| *w == name) else {
                let problem = format!("column {} is `{name}`, which is not expected", i + 1);
                return Err(wrong(problem));
            };
            if found.contains(&place) {
                return Err(wrong(format!("there are two columns `{name}`")));
            }
            found.push(place);
        }
        let missing = wanted
            .iter()
            .enumerate()
            .filter(|(i, _)| !found.contains(i));
        let missing: Vec<&str> = missing.map(|(_, name)| *name).collect();
        if missing.is_empty() {
            return Ok(found);
        }
        let (columns, are) = match missing.len() {
            1 => ("column", "is"),
            _ => ("columns", "are"),
        };
        Err(wrong(format!(
            "{columns} `{}` {are} missing",
            missing.join("`, `")
        )))
    }

    /// Reads the next row into `cells`, as many as the header has, without blanks around them; none at the end.
    ///
    /// # Errors
    /// [`TableError`].
    pub fn next(&mut self, cells: &mut StringRecord) -> Result<Option<Place>, TableError> {
        let is_row = self.reader.read_record(cells);
        let row = self.count + 1;
        let place = |position: Option<&Position>| Place {
            row,
            position: position.cloned(),
        };
        match is_row {
            Ok(false) => return Ok(None),
            Ok(true) => self.count = row,
            // Such an error names the line itself: a row without an end has no position.
            Err(e) if e.is_io_error() => {
                return Err(TableError::Input(InputError::Io {
                    path: self.path.clone(),
                    source: e.into(),
                }));
            }
            Err(e) => {
                let problem = match e.kind() {
                    csv::ErrorKind::Utf8 { .. } => "it is not UTF-8 text".to_string(),
                    _ => e.to_string(),
                };
                return Err(self.wrong(&place(e.position()), None, problem).into());
            }
        }
        let place = place(cells.position());
        let (has, wanted) = (cells.len(), self.header.len());
        if has != wanted {
            let problem = format!("it has {has} cells, the header has {wanted}");
            return Err(self.wrong(&place, None, problem).into());
        }
        Ok(Some(place))
    }

    /// What is wrong with a row, or with its cell in a column.
    #[must_use]
    pub fn wrong(&self, place: &Place, column: Option<&str>, problem: String) -> CellError {
        CellError {
            path: self.path.clone(),
            row: place.row,
            line: place.position.as_ref().map_or(0, |p| self.line(p)),
            column: column.map(Into::into),
            problem,
        }
    }

    /// The line on which a row begins. The reader counts the empty lines before it as part of it; they are looked up
    /// again only for an error.
    fn line(&self, position: &Position) -> u64 {
        let skipped = || -> io::Result<u64> {
            let mut file = BufReader::new(input::open(&self.path).map_err(io::Error::other)?);
            file.seek(SeekFrom::Start(position.byte()))?;
            let empty = file
                .bytes()
                .map_while(Result::ok)
                .take_while(|b| matches!(b, b'\n' | b'\r'));
            Ok(empty.filter(|&b| b == b'\n').count() as u64)
        };
        // A pipe, or a file that vanished meanwhile, leaves the reader's own count.
        position.line() + skipped().unwrap_or(0)
    }
}

/// Bytes that a row of a table may have, with the line breaks in its quoted cells.
const ROW: usize = 1 << 20;

fn open_rows(path: &Path) -> Result<Rows, InputError> {
    // A named pipe that nobody has opened yet: this waits for its writer, as every program does.
    let file = if is_pipe(path) {
        File::open(path).map_err(|source| InputError::Io {
            path: path.into(),
            source,
        })?
    } else {
        input::open(path)?
    };
    Ok(Rows {
        from: BufReader::with_capacity(1 << 16, file),
        is_new: true,
        at: At {
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

/// The bytes of a table whose rows have at most [`ROW`] of them, and whose quoted cells end.
#[derive(Debug)]
struct Rows {
    from: BufReader<File>,
    /// Whether nothing was read yet.
    is_new: bool,
    at: At,
}

impl Read for Rows {
    fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
        let from = self.from.fill_buf()?;
        if from.is_empty() {
            self.at.end()?;
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
        self.at.follow(bytes)?;
        Ok(count)
    }
}

/// Where in a table its reader is.
#[derive(Debug)]
struct At {
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

impl At {
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
                &format!("the row that begins there is larger than the limit of {most}"),
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_is_counted_with_the_empty_ones_before_it() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("table");
        for (text, words) in [
            (
                &b"a,b\n1,2\n\n\n1,\xff"[..],
                "row 2 (line 5): it is not UTF-8",
            ),
            (
                b"a,b\r\n1,2\r\n\r\n1\r\n",
                "row 2 (line 4): it has 1 cells, the header has 2",
            ),
            (b"\na,b\n\n1", "row 1 (line 4): it has 1 cells"),
        ] {
            std::fs::write(&path, text).unwrap();
            let mut table = Table::open(&path).unwrap();
            let mut cells = StringRecord::new();
            let error = loop {
                match table.next(&mut cells) {
                    Ok(place) => assert!(place.is_some()),
                    Err(error) => break error.to_string(),
                }
            };
            assert!(error.contains(words), "{error}");
        }
    }

    /// What is wrong with a table of this text.
    fn refused(text: impl AsRef<[u8]>) -> Option<String> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("table");
        std::fs::write(&path, &text).unwrap();
        let mut read = Vec::new();
        match open_rows(&path).unwrap().read_to_end(&mut read) {
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
