//! What a session has measured, in a file: one line of JSON each, written as soon as it is known.

use std::fs::{File, OpenOptions};
use std::io::{self, BufRead, BufReader, Write};
use std::path::{Path, PathBuf};

use hankel_system::input::{self, InputError};
use serde::{Deserialize, Serialize};

use crate::executor::Timing;
use crate::truth::Errors;

/// Why a file of measurements cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum StoreError {
    /// It is no regular file, or cannot be opened.
    #[error(transparent)]
    Input(#[from] InputError),
    /// It cannot be read or written.
    #[error("{}: {source}", file.display())]
    Io {
        /// The file.
        file: PathBuf,
        /// What went wrong.
        source: io::Error,
    },
    /// It is not what a session has written.
    #[error(
        "{}:{line}: {problem}: this is not a file of measurements, or a damaged one; remove it, or \
         choose another folder", file.display()
    )]
    Damaged {
        /// The file.
        file: PathBuf,
        /// Where, from 1.
        line: usize,
        /// What is wrong.
        problem: String,
    },
    /// It was made under other conditions.
    #[error(
        "{} was measured with {was}, and this is {is}: choose another folder, or remove the file",
        file.display()
    )]
    Other {
        /// The file.
        file: PathBuf,
        /// What differs, as it was.
        was: String,
        /// The same, as it is.
        is: String,
    },
}

/// What is known of one configuration.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "what", rename_all = "snake_case")]
pub(super) enum Line {
    /// The first line: under which conditions it was measured.
    Conditions { name: String, value: String },
    /// The light of a subject's pixels by rays.
    Truth { subject: String, values: Vec<f32> },
    /// How far off a configuration's light is.
    Errors {
        subject: String,
        configuration: String,
        errors: Errors,
        /// Of what its medium scatters alone.
        #[serde(skip_serializing_if = "Option::is_none", default)]
        scattered: Option<Errors>,
        bytes: usize,
    },
    /// One round's times.
    Round {
        subject: String,
        configuration: String,
        passes: Vec<Timing>,
    },
}

/// The file. Another process that appends to it at the same time is not provided for.
pub(super) struct Store {
    file: PathBuf,
    to: File,
}

impl Store {
    /// Opens or makes the file, and gives what it holds. A last line that was not finished is cut off.
    pub fn open(file: &Path) -> Result<(Self, Vec<Line>), StoreError> {
        let io = |source| StoreError::Io {
            file: file.to_path_buf(),
            source,
        };
        // What is no regular file would make this wait.
        match input::open(file) {
            Err(error) if !error.is_missing() => return Err(StoreError::Input(error)),
            _ => {}
        }
        let to = OpenOptions::new()
            .read(true)
            .append(true)
            .create(true)
            .open(file)
            .map_err(io)?;
        let mut lines = Vec::new();
        let mut whole = 0_u64;
        let mut reader = BufReader::new(&to);
        let mut bytes = Vec::new();
        loop {
            bytes.clear();
            let read = reader.read_until(b'\n', &mut bytes).map_err(io)?;
            if read == 0 {
                break;
            }
            if bytes.last() != Some(&b'\n') {
                // Ended in the middle of it.
                to.set_len(whole).map_err(io)?;
                break;
            }
            whole += read as u64;
            let line = serde_json::from_slice(&bytes).map_err(|e| StoreError::Damaged {
                file: file.to_path_buf(),
                line: lines.len() + 1,
                problem: e.to_string(),
            })?;
            lines.push(line);
        }
        let file = file.to_path_buf();
        Ok((Self { file, to }, lines))
    }

    /// The file's path.
    pub fn path(&self) -> &Path {
        &self.file
    }

    /// Adds a line.
    pub fn add(&mut self, line: &Line) -> Result<(), StoreError> {
        let written = serde_json::to_vec(line)
            .map_err(io::Error::from)
            .and_then(|mut bytes| {
                bytes.push(b'\n');
                self.to.write_all(&bytes)
            });
        written.map_err(|source| StoreError::Io {
            file: self.file.clone(),
            source,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(name: &str) -> Line {
        Line::Conditions {
            name: name.into(),
            value: "x".into(),
        }
    }

    #[test]
    fn a_line_that_was_not_finished_is_cut_off() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("a.jsonl");
        let (mut store, lines) = Store::open(&file).unwrap();
        assert!(lines.is_empty());
        store.add(&line("a")).unwrap();
        store.add(&line("b")).unwrap();
        drop(store);
        let mut text = std::fs::read(&file).unwrap();
        text.extend(b"{\"what\":\"cond");
        std::fs::write(&file, text).unwrap();
        let (mut store, lines) = Store::open(&file).unwrap();
        assert_eq!(lines, [line("a"), line("b")]);
        store.add(&line("c")).unwrap();
        drop(store);
        let (_, lines) = Store::open(&file).unwrap();
        assert_eq!(lines, [line("a"), line("b"), line("c")]);

        std::fs::write(&file, "something else\n").unwrap();
        let error = Store::open(&file).err().unwrap().to_string();
        assert!(error.contains("a.jsonl:1:"), "{error}");
    }
}
