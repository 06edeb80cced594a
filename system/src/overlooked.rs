//! Changes that cargo overlooks. It goes by dates: a file with other contents than before, and a date before
//! the last build (`cp -p`, `rsync -t`, an unpacked archive, a clock that was set back), is not compiled again.

use std::collections::{BTreeMap, BTreeSet};
use std::ffi::OsStr;
use std::fs::{self, File};
use std::hash::{DefaultHasher, Hash, Hasher};
use std::io::{self, ErrorKind, Read, Write};
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use serde::{Deserialize, Serialize};

use crate::input;

/// Size of the largest record, in bytes.
const MOST_BYTES: u64 = 64 << 20;

/// Most files that count of one folder.
const MOST_FILES: usize = 100_000;

/// What could not be done to keep cargo's work up to date.
#[derive(Debug, thiserror::Error)]
#[error("cannot {action} {}: {source}", path.display())]
pub struct RecordError {
    /// What was tried.
    pub action: &'static str,
    /// With which file or folder.
    pub path: PathBuf,
    /// Why it failed.
    pub source: io::Error,
}

/// What a build in a target folder read, and when it began. The record is kept in that folder. While this exists,
/// other builds of Hankel's in the folder wait: they would write over what this one is about to read.
#[derive(Debug)]
pub struct LastBuild {
    target_dir: PathBuf,
    file: PathBuf,
    _lock: File,
}

#[derive(Debug, Serialize, Deserialize)]
struct Made {
    began: SystemTime,
    /// Names of the packages whose files these are.
    packages: BTreeSet<String>,
    /// By path; folders stand for all that is in them.
    contents: BTreeMap<String, u64>,
}

impl LastBuild {
    /// That of the build in cargo's `target_dir` which `build` tells from the other ones there: its manifest and
    /// flags.
    ///
    /// # Errors
    /// The folder or its lock cannot be made.
    pub fn of<'a>(
        target_dir: &Path,
        build: impl IntoIterator<Item = &'a OsStr>,
    ) -> Result<Self, RecordError> {
        fs::create_dir_all(target_dir).map_err(fail("create", target_dir))?;
        let path = target_dir.join("hankel.lock");
        let lock = File::create(&path).map_err(fail("create", &path))?;
        // File systems without locks are used without.
        let _ = lock.lock();
        Ok(Self {
            file: target_dir.join(record_of(build)),
            target_dir: target_dir.to_owned(),
            _lock: lock,
        })
    }

    /// Has cargo compile the packages again that the build was of if it would overlook a change. Those of registries
    /// and the compiler's own stay.
    ///
    /// # Errors
    /// cargo's record of what it has compiled cannot be removed.
    pub fn forget_if_overlooked(&self) -> Result<(), RecordError> {
        let Ok(text) = input::read(&self.file, MOST_BYTES) else {
            return Ok(());
        };
        // What another version wrote says nothing.
        match serde_json::from_slice::<Made>(&text) {
            Ok(made) if made.overlooked() => self.forget(&made.packages),
            _ => Ok(()),
        }
    }

    /// Keeps what a build that began at `began` has read: files, and folders with all that is in them. A path
    /// that is not UTF-8 is left out, as cargo leaves it out. `messages` is what cargo said, as JSON; packages within `own` are the
    /// compiler's.
    ///
    /// # Errors
    /// The record cannot be written.
    pub fn record(
        &self,
        read: impl IntoIterator<Item = PathBuf>,
        messages: &str,
        own: &[PathBuf],
        began: SystemTime,
    ) -> Result<(), RecordError> {
        let contents = read.into_iter().filter_map(|path| {
            let state = State::of(&path);
            Some((path.into_os_string().into_string().ok()?, state.contents))
        });
        let made = Made {
            began,
            packages: local_packages(messages, own),
            contents: contents.collect(),
        };
        let write = || -> io::Result<()> {
            let mut file = tempfile::NamedTempFile::new_in(&self.target_dir)?;
            file.write_all(&serde_json::to_vec(&made)?)?;
            file.persist(&self.file)?;
            Ok(())
        };
        write().map_err(fail("write", &self.file))
    }

    /// Removes cargo's fingerprints of these packages: those of all profiles, for this machine and for other targets.
    fn forget(&self, packages: &BTreeSet<String>) -> Result<(), RecordError> {
        let within = |folder: &Path| -> Result<Vec<PathBuf>, RecordError> {
            match fs::read_dir(folder) {
                Ok(found) => Ok(found.filter_map(|it| Some(it.ok()?.path())).collect()),
                Err(error) if is_absent(&error) => Ok(Vec::new()),
                Err(error) => Err(fail("list", folder)(error)),
            }
        };
        // `release`, or `spirv-unknown-vulkan1.2/release`.
        for profile in within(&self.target_dir)? {
            let nested = within(&profile)?;
            for folder in nested.into_iter().chain([profile]) {
                for unit in within(&folder.join(".fingerprint"))? {
                    let name = unit.file_name().and_then(OsStr::to_str);
                    if !name.is_some_and(|name| is_of(name, packages)) {
                        continue;
                    }
                    match fs::remove_dir_all(&unit) {
                        Err(error) if !is_absent(&error) => {
                            return Err(fail("remove", &unit)(error));
                        }
                        _ => {}
                    }
                }
            }
        }
        Ok(())
    }
}

/// Whether a folder of a fingerprint, `PACKAGE-HASH`, is that of one of the packages.
fn is_of(unit: &str, packages: &BTreeSet<String>) -> bool {
    unit.rsplit_once('-')
        .is_some_and(|(package, _)| packages.contains(package))
}

/// Names of the packages in folders, neither of registries nor within `own`, that cargo says it has compiled, now or
/// before.
fn local_packages(messages: &str, own: &[PathBuf]) -> BTreeSet<String> {
    #[derive(Deserialize)]
    struct Artifact {
        package_id: String,
        manifest_path: PathBuf,
    }
    let messages = messages.lines().filter(|line| line.starts_with('{'));
    messages
        .filter_map(|line| serde_json::from_str::<Artifact>(line).ok())
        .filter(|it| it.package_id.starts_with("path+"))
        .filter(|it| !own.iter().any(|own| it.manifest_path.starts_with(own)))
        .filter_map(|it| name_of(&it.package_id).map(str::to_owned))
        .collect()
}

/// The name in cargo's identifier of a package: `path+file:///FOLDER/NAME#VERSION`, or `…#NAME@VERSION`.
fn name_of(id: &str) -> Option<&str> {
    let (source, fragment) = id.rsplit_once('#')?;
    match fragment.split_once('@') {
        Some((name, _)) => Some(name),
        None => source.trim_end_matches('/').rsplit('/').next(),
    }
}

/// The record's name.
fn record_of<'a>(build: impl IntoIterator<Item = &'a OsStr>) -> String {
    let mut hasher = DefaultHasher::new();
    build.into_iter().for_each(|it| it.hash(&mut hasher));
    format!("hankel-inputs-{:016x}.json", hasher.finish())
}

fn fail(action: &'static str, path: &Path) -> impl FnOnce(io::Error) -> RecordError {
    let path = path.to_owned();
    move |source| RecordError {
        action,
        path,
        source,
    }
}

fn is_absent(error: &io::Error) -> bool {
    matches!(error.kind(), ErrorKind::NotFound | ErrorKind::NotADirectory)
}

impl Made {
    fn overlooked(&self) -> bool {
        self.contents.iter().any(|(path, before)| {
            let now = State::of(Path::new(path));
            now.contents != *before && now.newest.is_some_and(|date| date <= self.began)
        })
    }
}

/// What is at a path.
struct State {
    /// A hash of names and contents. 64 bits: it tells edits apart, and guards against no attack.
    contents: u64,
    /// When the newest file there was changed; `None`: there is no file.
    newest: Option<SystemTime>,
}

impl State {
    fn of(path: &Path) -> Self {
        let mut hasher = DefaultHasher::new();
        let mut newest = None;
        for file in files_in(path) {
            file.hash(&mut hasher);
            let date = fs::metadata(&file).and_then(|it| it.modified()).ok();
            newest = newest.max(date);
            // What cannot be read counts by its name. cargo says what is wrong with it.
            if let Ok(mut contents) = input::open(&file) {
                hash(&mut contents, &mut hasher);
            }
        }
        Self {
            contents: hasher.finish(),
            newest,
        }
    }
}

fn hash(file: &mut File, hasher: &mut DefaultHasher) {
    let mut buffer = [0; 1 << 16];
    let mut bytes = 0;
    while let Ok(read @ 1..) = file.read(&mut buffer) {
        hasher.write(&buffer[..read]);
        bytes += read;
    }
    hasher.write_usize(bytes);
}

/// The file itself, or the files in a folder and in folders in it, in order. Links to folders are not followed:
/// they may lead in circles.
fn files_in(path: &Path) -> Vec<PathBuf> {
    if !path.is_dir() {
        let is_there = path.symlink_metadata().is_ok();
        return is_there.then(|| path.to_owned()).into_iter().collect();
    }
    let mut files = Vec::new();
    let mut folders = vec![path.to_owned()];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
            match entry.file_type() {
                Ok(kind) if kind.is_dir() => folders.push(entry.path()),
                _ => files.push(entry.path()),
            }
            if files.len() >= MOST_FILES {
                break;
            }
        }
    }
    files.sort();
    files
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    #[test]
    fn a_change_with_an_old_date_is_found() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        let put = |name: &str, text: &str, date: SystemTime| {
            fs::create_dir_all(path(name).parent().unwrap()).unwrap();
            fs::write(path(name), text).unwrap();
            let file = File::options().write(true).open(path(name)).unwrap();
            file.set_modified(date).unwrap();
        };
        let began = SystemTime::now();
        let (before, after) = (
            began - Duration::from_secs(3600),
            began + Duration::from_secs(3600),
        );
        put("src/lib.rs", "// 1", before);
        put("data/deep/table", "1", before);
        let target = path("target");
        let fingerprints = |unit: &str| {
            let profiles = ["release", "describe", "spirv/release"];
            profiles.map(|it| target.join(it).join(".fingerprint").join(unit))
        };
        // Two packages in folders; one of a registry whose name begins like one of them, and one of the compiler.
        let local = ["mine-0123456789abcdef", "on-the-way-0123456789abcdef"].map(fingerprints);
        let local = local.as_flattened();
        let others = ["mine-not-0123456789abcdef", "core-0123456789abcdef"].map(fingerprints);
        let others = others.as_flattened();
        let own = [PathBuf::from("/rust/library")];
        let messages = [
            ("path+file:///a/mine#0.1.0", "/a/mine"),
            ("path+file:///a/b#on-the-way@1.0.0", "/a/b"),
            ("registry+https://a/b#mine-not@1.0.0", "/registry/mine-not"),
            ("path+file:///rust/library/core#0.0.0", "/rust/library/core"),
        ];
        let messages = messages.map(|(id, folder)| {
            format!("{{\"package_id\":\"{id}\",\"manifest_path\":\"{folder}/Cargo.toml\"}}\n")
        });
        let messages = format!("not JSON\n{}{{\"success\":true}}\n", messages.concat());
        let last = LastBuild::of(&target, [OsStr::new("Cargo.toml")]).unwrap();
        let forgets = |name: &str, text: &str, date: SystemTime| {
            for it in local.iter().chain(others) {
                fs::create_dir_all(it).unwrap();
            }
            let read = ["src/lib.rs", "data", "build.rs"].map(path);
            last.record(read, &messages, &own, began).unwrap();
            put(name, text, date);
            last.forget_if_overlooked().unwrap();
            assert!(others.iter().all(|it| it.exists()));
            let left = local.iter().filter(|it| it.exists()).count();
            assert!(left == 0 || left == local.len(), "{left}");
            left == 0
        };
        // Cargo sees what has a later date itself.
        for (name, text, date, forgotten) in [
            ("src/lib.rs", "// 1", before, false),
            ("src/lib.rs", "// 2", after, false),
            ("src/lib.rs", "// 3", before, true),
            ("data/deep/table", "2", after, false),
            ("data/deep/table", "3", before, true),
            ("data/new", "", before, true),
            ("build.rs", "", before, true),
        ] {
            assert_eq!(forgets(name, text, date), forgotten, "{name} {text}");
        }
    }

    #[test]
    fn builds_have_records_of_their_own() {
        let of = |build: [&str; 2]| record_of(build.map(OsStr::new));
        assert_ne!(of(["a", "b"]), of(["ab", ""]));
        assert_eq!(of(["a", "b"]), of(["a", "b"]));
    }
}
