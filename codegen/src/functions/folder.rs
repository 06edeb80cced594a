//! A folder of libraries: written, and compared with its sources.

use std::collections::BTreeMap;
use std::fmt;
use std::path::Path;

use serde::Serialize;

use super::FORMS;
use super::api::{FILE, LibraryRecord, Record};
use super::ir::Library;
use crate::build::MANIFEST_FILE;
use crate::check::unified_diff;
use crate::error::{Error, Result};
use crate::files::sha256;
use crate::folder::{self, Found};

/// Letters of a prefix at most.
const LONGEST_PREFIX: usize = 64;

/// Libraries in every language, in memory.
#[derive(Clone, Debug, PartialEq)]
pub struct Folder {
    /// What it holds.
    record: Record,
    /// The texts, by path.
    files: BTreeMap<String, Vec<u8>>,
}

/// What was written.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Report {
    /// Files that were written.
    pub written: Vec<String>,
    /// Files that already were as they should be.
    pub unchanged: usize,
    /// Files of the last build that were removed.
    pub removed: Vec<String>,
    /// Functions in all libraries.
    pub functions: usize,
}

/// How a folder differs from its sources.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Differences {
    /// Files that differ, are missing, or should not be there.
    pub files: Vec<Difference>,
}

/// A file that is not as it should be.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Difference {
    /// Its path in the folder; the folder itself, `.`, where a build of it was stopped.
    pub file: String,
    /// What is wrong with it.
    pub problem: &'static str,
    /// A unified diff from what is committed to what the sources give.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub diff: Option<String>,
}

impl Differences {
    /// Whether there are none.
    #[must_use]
    pub fn is_fine(&self) -> bool {
        self.files.is_empty()
    }
}

impl fmt::Display for Differences {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.is_fine() {
            return f.write_str("all files follow from their sources");
        }
        for it in &self.files {
            writeln!(f, "{} {}", it.file, it.problem)?;
            if let Some(diff) = &it.diff {
                f.write_str(diff)?;
            }
        }
        let (count, follow) = match self.files.len() {
            1 => ("1 file".into(), "follows from its sources: build it again"),
            n => (
                format!("{n} files"),
                "follow from their sources: build them again",
            ),
        };
        write!(f, "{count} no longer {follow}")
    }
}

impl Folder {
    /// The libraries with names that begin with `prefix`, from sources with a hash. `functions` is what of them was
    /// [chosen](super::read_chosen).
    ///
    /// # Errors
    /// A prefix that is no name.
    pub fn new(
        libraries: &[Library],
        prefix: &str,
        functions: &[String],
        sources: &str,
    ) -> Result<Self> {
        if !is_prefix(prefix) {
            return Err(Error::Option {
                option: "--prefix",
                value: prefix.into(),
                expected: "a prefix is made of lower-case letters, digits and single underscores, \
                           begins with a letter, has at most 64 of them, is no word of a shading language and \
                           does not begin with `gl_`",
            });
        }
        let texts = super::files(libraries, prefix, sources);
        let hashes = texts
            .iter()
            .map(|(path, text)| (path.clone(), sha256(text.as_bytes())))
            .collect();
        let record = Record {
            hankel: crate::VERSION.into(),
            prefix: prefix.into(),
            functions: functions.to_vec(),
            libraries: libraries
                .iter()
                .map(|l| (l.name.clone(), LibraryRecord::of(l)))
                .collect(),
            files: hashes,
        };
        let mut files: BTreeMap<String, Vec<u8>> = texts
            .into_iter()
            .map(|(path, text)| (path, text.into_bytes()))
            .collect();
        let mut json = serde_json::to_vec_pretty(&record).unwrap_or_default();
        json.push(b'\n');
        files.insert(FILE.into(), json);
        Ok(Self { record, files })
    }

    /// The texts, by path.
    #[must_use]
    pub const fn files(&self) -> &BTreeMap<String, Vec<u8>> {
        &self.files
    }

    /// Writes the folder. What already is as it should be is left alone; nothing is written if
    /// something is in the way.
    ///
    /// # Errors
    /// A signature changed and the library's number did not; a file that hankel did not write is in
    /// the way, unless `force`; a file cannot be written.
    pub fn write(&self, out: &Path, force: bool) -> Result<Report> {
        let folder = folder::Folder::create(out)?;
        folder.refuse(MANIFEST_FILE, "shaders")?;
        let mut owned = folder::Owned::new();
        // What is no record is in the way.
        if let Ok(Some((before, hash))) = record(&folder) {
            self.same_api(Some(&before))?;
            owned.insert(FILE.into(), [hash].into());
            owned.extend(
                before
                    .files
                    .into_iter()
                    .map(|(name, hash)| (name, [hash].into())),
            );
        }
        let change = folder.update(&self.files, FILE, owned, force)?;
        Ok(Report {
            written: change.written,
            unchanged: change.unchanged,
            removed: change.removed,
            functions: self
                .record
                .libraries
                .values()
                .flat_map(|l| l.signatures.values())
                .filter(|s| s.starts_with('('))
                .count(),
        })
    }

    /// Compares a committed folder with what the sources give.
    ///
    /// # Errors
    /// A signature changed and the library's number did not; the folder is none of libraries.
    pub fn check(&self, committed: &Path) -> Result<Differences> {
        let missing = || Error::Record {
            path: committed.join(FILE),
            problem: "it is missing".into(),
        };
        let folder = folder::Folder::open(committed)?.ok_or_else(missing)?;
        folder.refuse(MANIFEST_FILE, "shaders, too")?;
        let (before, _) = record(&folder)?.ok_or_else(missing)?;
        self.same_api(Some(&before))?;
        let mut files = Vec::new();
        let mut tell = |file: &str, problem, diff| {
            files.push(Difference {
                file: file.into(),
                problem,
                diff,
            });
        };
        if folder.was_stopped()? {
            tell(".", "holds a build that was stopped before its end", None);
        }
        for (name, bytes) in &self.files {
            match folder.read(name)? {
                Found::File(there) if there == *bytes => {}
                Found::Nothing => tell(name, "is missing", None),
                Found::Other(..) => tell(name, "is not a regular file", None),
                Found::File(there) => {
                    tell(name, "differs", Some(unified_diff(name, &there, bytes)))
                }
            }
        }
        for name in before.files.keys() {
            if !self.files.contains_key(name) {
                tell(name, "has no source any more", None);
            }
        }
        for form in &FORMS {
            for file in folder.files_in(form.name)? {
                let name = format!("{}/{file}", form.name);
                let known = self.files.contains_key(&name) || before.files.contains_key(&name);
                // Hidden files are an editor's or the system's.
                if !known && !file.starts_with('.') {
                    tell(&name, "is extra: no build wrote it", None);
                }
            }
        }
        Ok(Differences { files })
    }

    fn same_api(&self, before: Option<&Record>) -> Result<()> {
        let Some(before) = before else {
            return Ok(());
        };
        for (name, old) in &before.libraries {
            let Some(new) = self.record.libraries.get(name) else {
                continue;
            };
            let mut old = old.clone();
            if before.functions != self.record.functions {
                // What is not chosen any more is no change of the library.
                old.signatures
                    .retain(|name, _| new.signatures.contains_key(name));
            }
            let changes = new.breaks(&old);
            if !changes.is_empty() && new.api <= old.api {
                return Err(Error::Api {
                    library: name.clone(),
                    api: old.api,
                    changes,
                });
            }
        }
        Ok(())
    }
}

/// Whether names may begin with it.
fn is_prefix(prefix: &str) -> bool {
    let is_name = prefix.starts_with(|c: char| c.is_ascii_lowercase())
        && !prefix.ends_with('_')
        && !prefix.contains("__")
        && prefix
            .chars()
            .all(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_');
    // GLSL keeps `GL_` for itself; file systems take names of 255 bytes.
    let is_free = !super::names::is_taken(prefix) && !format!("{prefix}_").starts_with("gl_");
    is_name && is_free && prefix.len() <= LONGEST_PREFIX
}

/// What a folder is said to hold; `None` if there is no record of libraries.
///
/// # Errors
/// A record that cannot be read, or that hankel did not write.
pub fn read(path: &Path) -> Result<Option<Record>> {
    let Some(folder) = folder::Folder::open(path)? else {
        return Ok(None);
    };
    Ok(record(&folder)?.map(|(record, _)| record))
}

/// The record in a folder, and its hash.
fn record(folder: &folder::Folder) -> Result<Option<(Record, String)>> {
    let fail = |problem: String| Error::Record {
        path: folder.path_of(FILE),
        problem,
    };
    match folder.read(FILE)? {
        Found::Nothing => Ok(None),
        Found::Other(_, kind) => Err(fail(format!("it is {kind}"))),
        Found::File(bytes) => {
            let record: Record = serde_json::from_slice(&bytes)
                .map_err(|error| fail(format!("it is not a record of libraries: {error}")))?;
            if !is_prefix(&record.prefix) {
                return Err(fail(format!(
                    "hankel writes no prefix `{}`",
                    record.prefix.escape_debug()
                )));
            }
            Ok(Some((record, sha256(&bytes))))
        }
    }
}
