//! A folder of libraries: written, and compared with its sources.

use std::collections::BTreeMap;
use std::fmt;
use std::path::{Component, Path};

use serde::Serialize;

use super::api::{FILE, LibraryRecord, Record};
use super::ir::Library;
use crate::error::{During, Error, Result};
use crate::files::{sha256, write_whole};

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
    pub files: Vec<String>,
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
        for file in &self.files {
            writeln!(f, "{file}")?;
        }
        write!(
            f,
            "{} files no longer follow from their sources: build them again",
            self.files.len()
        )
    }
}

impl Folder {
    /// The libraries with names that begin with `prefix`, from sources with a hash.
    ///
    /// # Errors
    /// A prefix that is no name.
    pub fn new(libraries: &[Library], prefix: &str, sources: &str) -> Result<Self> {
        let is_name = prefix.starts_with(|c: char| c.is_ascii_lowercase())
            && !prefix.ends_with('_')
            && !prefix.contains("__")
            && prefix
                .chars()
                .all(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_');
        if !is_name || super::names::is_taken(prefix) {
            return Err(Error::Option {
                option: "--prefix",
                value: prefix.into(),
                expected: "lower-case letters, digits and single underscores, beginning with a \
                           letter, and no word of a shading language",
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

    /// Writes the folder. What already is as it should be is left alone; nothing is written if
    /// something is in the way.
    ///
    /// # Errors
    /// A signature changed and the library's number did not; a file that hankel did not write is in
    /// the way, unless `force`; a file cannot be written.
    pub fn write(&self, out: &Path, force: bool) -> Result<Report> {
        let before = read(out);
        self.same_api(before.as_ref())?;
        let mut changed = Vec::new();
        for (name, bytes) in &self.files {
            let path = out.join(name);
            match std::fs::read(&path) {
                Ok(there) if there == *bytes => {}
                Ok(there) => {
                    let ours = if name == FILE {
                        before.is_some()
                    } else {
                        let old = before.as_ref().and_then(|b| b.files.get(name));
                        old.is_some_and(|hash| *hash == sha256(&there))
                    };
                    if !ours && !force {
                        return Err(Error::InTheWay { path, kind: None });
                    }
                    changed.push(name);
                }
                Err(e) if e.kind() == std::io::ErrorKind::NotFound => changed.push(name),
                Err(source) => {
                    return Err(Error::Io {
                        action: "read",
                        path,
                        source,
                    });
                }
            }
        }
        // The record comes last: it is believed.
        changed.sort_by_key(|name| *name == FILE);
        for name in &changed {
            write_whole(&out.join(name), &self.files[*name])?;
        }
        let mut removed = Vec::new();
        for (name, hash) in before.iter().flat_map(|b| &b.files) {
            let inside = Path::new(name)
                .components()
                .all(|part| matches!(part, Component::Normal(_)));
            let path = out.join(name);
            if inside
                && !self.files.contains_key(name)
                && std::fs::read(&path).is_ok_and(|there| sha256(&there) == *hash)
            {
                std::fs::remove_file(&path).during("remove", &path)?;
                removed.push(name.clone());
            }
        }
        Ok(Report {
            unchanged: self.files.len() - changed.len(),
            written: changed.into_iter().cloned().collect(),
            removed,
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
        let before = read(committed).ok_or_else(|| Error::Manifest {
            path: committed.join(FILE),
            problem: "it is missing, or no record of libraries of functions".into(),
        })?;
        self.same_api(Some(&before))?;
        let mut files = Vec::new();
        for (name, bytes) in &self.files {
            match std::fs::read(committed.join(name)) {
                Ok(there) if there == *bytes => {}
                Ok(_) => files.push(format!("{name} differs")),
                Err(_) => files.push(format!("{name} is missing")),
            }
        }
        let extra = before.files.keys().filter(|n| !self.files.contains_key(*n));
        files.extend(extra.map(|name| format!("{name} has no source any more")));
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
            let changes = new.breaks(old);
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

/// What a folder is said to hold.
#[must_use]
pub fn read(folder: &Path) -> Option<Record> {
    serde_json::from_slice(&std::fs::read(folder.join(FILE)).ok()?).ok()
}
