//! A folder of generated files: changed as a whole, by one process at a time, and nothing outside
//! of it.
//!
//! A change is prepared in `.hankel` inside the folder, in this order, so that it can be stopped
//! after any step and the next change still knows which files are Hankel's:
//!
//! 1. `.hankel/owned.json`: the contents that Hankel wrote or is about to write,
//! 2. every new file, under a number,
//! 3. renames to the final names, removal of old files, and last the file that describes the rest,
//! 4. `.hankel` is removed.
//!
//! A change that was stopped is finished by the next one. The folder is locked meanwhile; the
//! system takes the lock back from a process that ends. Below the folder no symbolic link is
//! followed, and only regular files are opened.

use std::collections::{BTreeMap, BTreeSet};
use std::fs::{File, TryLockError};
use std::io::{ErrorKind, Read, Write};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use cap_fs_ext::{DirExt, FileTypeExt, FollowSymlinks, OpenOptionsFollowExt, OpenOptionsSyncExt};
use cap_std::fs::{Dir, FileType, OpenOptions};

use crate::Language;
use crate::build::MANIFEST_FILE;
use crate::error::{During, Error, Result};
use crate::files::sha256;
use crate::frame::{CONTENTS, FRAME_FILE};
use crate::functions::{FORMS, api};

/// Where a change is prepared.
pub(crate) const STAGE: &str = ".hankel";

/// Says in [`STAGE`] which contents are Hankel's.
const OWNED: &str = "owned.json";

/// Size beyond which a file is none of a build's, in bytes.
pub(crate) const MOST_BYTES: u64 = 64 << 20;

/// How long to wait for another process that changes the folder. It does so for milliseconds.
const PATIENCE: Duration = Duration::from_secs(30);

/// Folders of a build: one for each language, the headers', and that of a frame's buffers.
pub(crate) const SUBFOLDERS: [&str; Language::ALL.len() + 2] = {
    let mut names = ["include"; Language::ALL.len() + 2];
    let mut i = 0;
    while i < Language::ALL.len() {
        names[i] = Language::ALL[i].name();
        i += 1;
    }
    names[i] = CONTENTS;
    names
};

/// Contents by their path in a folder, as SHA-256. Several where an earlier change was stopped.
pub(crate) type Owned = BTreeMap<String, BTreeSet<String>>;

/// What is at a path.
#[derive(Debug, PartialEq, Eq)]
pub(crate) enum Found {
    /// Nothing.
    Nothing,
    /// A regular file with these bytes.
    File(Vec<u8>),
    /// No file that could be read: the path, or a folder above it, and what is wrong with it.
    Other(PathBuf, &'static str),
}

/// What a change did.
#[derive(Debug, Default, PartialEq, Eq)]
pub(crate) struct Change {
    /// Files that were written, in order.
    pub written: Vec<String>,
    /// Files that were right already.
    pub unchanged: usize,
    /// Files that were removed.
    pub removed: Vec<String>,
}

/// A folder that is open, and locked until it is dropped.
pub(crate) struct Folder {
    dir: Dir,
    path: PathBuf,
    /// Called after each step that changes the folder.
    #[cfg(test)]
    after_step: Box<dyn Fn()>,
}

impl Folder {
    /// Opens a folder to change it, and makes it if it is not there. Waits for other processes.
    pub fn create(path: &Path) -> Result<Self> {
        if let Some(kind) = not_a_folder(path) {
            return Err(Error::NotAFolder {
                path: path.to_owned(),
                kind,
            });
        }
        std::fs::create_dir_all(path).during("create", path)?;
        Self::lock(path, File::try_lock)
    }

    /// Opens a folder to read it. `None`: there is no such folder.
    pub fn open(path: &Path) -> Result<Option<Self>> {
        match not_a_folder(path) {
            Some(kind) => Err(Error::NotAFolder {
                path: path.to_owned(),
                kind,
            }),
            None if !path.exists() => Ok(None),
            None => Self::lock(path, File::try_lock_shared).map(Some),
        }
    }

    fn lock(path: &Path, lock: impl Fn(&File) -> Result<(), TryLockError>) -> Result<Self> {
        let file = File::open(path).during("open", path)?;
        let start = Instant::now();
        loop {
            match lock(&file) {
                // File systems without locks are used without.
                Ok(()) | Err(TryLockError::Error(_)) => break,
                Err(TryLockError::WouldBlock) if start.elapsed() > PATIENCE => {
                    return Err(Error::Busy {
                        path: path.to_owned(),
                        seconds: PATIENCE.as_secs(),
                    });
                }
                Err(TryLockError::WouldBlock) => std::thread::sleep(Duration::from_millis(10)),
            }
        }
        Ok(Self {
            dir: Dir::from_std_file(file),
            path: path.to_owned(),
            #[cfg(test)]
            after_step: Box::new(|| {}),
        })
    }

    /// The file at a path with at most one folder in it.
    pub fn read(&self, name: &str) -> Result<Found> {
        let (folder, file) = split(name);
        let sub;
        let dir = match folder {
            None => &self.dir,
            Some(folder) => match self.kind(&self.dir, folder, name)? {
                None => return Ok(Found::Nothing),
                Some("a folder") => {
                    sub = self.sub(folder)?;
                    &sub
                }
                Some(kind) => return Ok(Found::Other(self.path.join(folder), kind)),
            },
        };
        match self.kind(dir, file, name)? {
            None => Ok(Found::Nothing),
            Some("a file") => self.read_file(dir, file, name),
            Some(kind) => Ok(Found::Other(self.path.join(name), kind)),
        }
    }

    fn read_file(&self, dir: &Dir, file: &str, name: &str) -> Result<Found> {
        let path = self.path.join(name);
        let mut options = OpenOptions::new();
        // What replaced the file just now can neither lead out of the folder nor make this wait.
        options.read(true).follow(FollowSymlinks::No).nonblock(true);
        let opened = dir.open_with(file, &options).during("read", &path)?;
        let mut bytes = Vec::new();
        let read = opened.take(MOST_BYTES + 1).read_to_end(&mut bytes);
        read.during("read", &path)?;
        Ok(if bytes.len() as u64 > MOST_BYTES {
            Found::Other(path, "a file of more than 64 MiB")
        } else {
            Found::File(bytes)
        })
    }

    /// The names in a folder, of what is no folder.
    pub fn files_in(&self, folder: &str) -> Result<Vec<String>> {
        let path = self.path.join(folder);
        if self.kind(&self.dir, folder, folder)? != Some("a folder") {
            return Ok(Vec::new());
        }
        let mut names = Vec::new();
        for entry in self.sub(folder)?.entries().during("read", &path)? {
            let entry = entry.during("read", &path)?;
            if !entry.file_type().during("read", &path)?.is_dir() {
                names.push(entry.file_name().to_string_lossy().into_owned());
            }
        }
        names.sort();
        Ok(names)
    }

    /// Refuses a folder with the `record` of another kind of build, which `holds` something else.
    pub fn refuse(&self, record: &'static str, holds: &'static str) -> Result<()> {
        match self.read(record)? {
            Found::Nothing => Ok(()),
            Found::File(_) | Found::Other(..) => Err(Error::OtherKind {
                path: self.path.clone(),
                record,
                holds,
            }),
        }
    }

    /// Where a file of the folder is.
    pub fn path_of(&self, name: &str) -> PathBuf {
        self.path.join(name)
    }

    /// Whether a change was stopped before its end.
    pub fn was_stopped(&self) -> Result<bool> {
        Ok(self.kind(&self.dir, STAGE, STAGE)?.is_some())
    }

    /// Makes the folder hold `files`, of which `last` is written last and describes the others.
    ///
    /// Files of `owned` that are not in `files` are removed, unless they were edited since. A file
    /// that is in the way and is not owned stops the change before its first step, unless `force`.
    pub fn update(
        &self,
        files: &BTreeMap<String, Vec<u8>>,
        last: &str,
        owned: Owned,
        force: bool,
    ) -> Result<Change> {
        let mut owned = owned;
        let stopped = self.take_over(&mut owned)?;
        owned.retain(|name, _| files.contains_key(name) || can_be_removed(name));
        let mut change = Change::default();
        // That which says what the others are comes first: if it is damaged, nothing else is known.
        let described = files.iter().filter(|(name, _)| *name == last);
        for (name, bytes) in described.chain(files.iter().filter(|(name, _)| *name != last)) {
            match self.read(name)? {
                Found::File(there) if there == *bytes => {
                    change.unchanged += 1;
                    continue;
                }
                Found::File(there) if force || is_owned(&owned, name, &there) => {}
                Found::Nothing => {}
                Found::Other(path, kind)
                    if force && path == self.path.join(name) && kind != "a folder" => {}
                Found::File(_) => return Err(self.in_the_way(name, None)),
                Found::Other(path, kind) => {
                    return Err(Error::InTheWay {
                        path,
                        kind: Some(kind),
                    });
                }
            }
            change.written.push(name.clone());
        }
        change.written.sort_by_key(|name| name == last);
        for name in owned.keys().filter(|name| !files.contains_key(*name)) {
            if let Found::File(there) = self.read(name)?
                && is_owned(&owned, name, &there)
            {
                change.removed.push(name.clone());
            }
        }
        if !stopped && change.written.is_empty() && change.removed.is_empty() {
            return Ok(change);
        }
        self.prepare(files, &change, &owned, stopped)?;
        let stage = self.sub(STAGE)?;
        for (number, name) in change.written.iter().enumerate() {
            // What does not belong goes before the description says so.
            if name == last {
                self.remove_old(&change, &owned, files)?;
            }
            self.put(&stage, &number.to_string(), name)?;
        }
        if !change.written.iter().any(|name| name == last) {
            self.remove_old(&change, &owned, files)?;
        }
        self.clear_stage(true)?;
        Ok(change)
    }

    /// Adds what a stopped change owned; whether there was one.
    fn take_over(&self, owned: &mut Owned) -> Result<bool> {
        match self.kind(&self.dir, STAGE, STAGE)? {
            None => return Ok(false),
            Some("a folder") => {}
            Some(kind) => return Err(self.in_the_way(STAGE, Some(kind))),
        }
        if let Found::File(bytes) = self.read(&format!("{STAGE}/{OWNED}"))?
            && let Ok(before) = serde_json::from_slice::<Owned>(&bytes)
        {
            for (name, hashes) in before {
                owned.entry(name).or_default().extend(hashes);
            }
        }
        Ok(true)
    }

    /// Steps 1 and 2. If they fail, nothing has changed.
    fn prepare(
        &self,
        files: &BTreeMap<String, Vec<u8>>,
        change: &Change,
        owned: &Owned,
        stopped: bool,
    ) -> Result<()> {
        let mut all = owned.clone();
        for name in &change.written {
            let hashes = all.entry(name.clone()).or_default();
            hashes.insert(sha256(&files[name]));
        }
        let json = serde_json::to_vec(&all).unwrap_or_default();
        let prepared = (|| -> Result<()> {
            if stopped {
                self.clear_stage(false)?;
            } else {
                let path = self.path.join(STAGE);
                self.dir.create_dir(STAGE).during("create", &path)?;
                self.step();
            }
            let stage = self.sub(STAGE)?;
            self.write(&stage, "new", &json)?;
            self.put(&stage, "new", &format!("{STAGE}/{OWNED}"))?;
            for (number, name) in change.written.iter().enumerate() {
                self.write(&stage, &number.to_string(), &files[name])?;
            }
            Ok(())
        })();
        if prepared.is_err() {
            // The first error is the one to report. What a stopped change owned must stay known.
            let _ = self.clear_stage(!stopped);
        }
        prepared
    }

    /// Removes what is in [`STAGE`]; with `whole` its list of what is owned and itself, too.
    fn clear_stage(&self, whole: bool) -> Result<()> {
        let stage = self.sub(STAGE)?;
        let path = self.path.join(STAGE);
        for name in self.files_in(STAGE)? {
            if name != OWNED {
                stage
                    .remove_file(&name)
                    .during("remove", &path.join(&name))?;
                self.step();
            }
        }
        if whole {
            match stage.remove_file(OWNED) {
                Err(error) if error.kind() == ErrorKind::NotFound => {}
                other => {
                    other.during("remove", &path.join(OWNED))?;
                    self.step();
                }
            }
            self.dir.remove_dir(STAGE).during("remove", &path)?;
            self.step();
        }
        Ok(())
    }

    /// Removes the files that a change removes, and folders that it leaves empty.
    fn remove_old(
        &self,
        change: &Change,
        owned: &Owned,
        files: &BTreeMap<String, Vec<u8>>,
    ) -> Result<()> {
        for name in &change.removed {
            let (folder, file) = split(name);
            let path = self.path.join(name);
            match folder {
                None => self.dir.remove_file(file).during("remove", &path)?,
                Some(folder) => {
                    let sub = self.sub(folder)?;
                    sub.remove_file(file).during("remove", &path)?;
                }
            }
            self.step();
        }
        let of_new: BTreeSet<_> = files.keys().filter_map(|name| split(name).0).collect();
        let of_old: BTreeSet<_> = owned.keys().filter_map(|name| split(name).0).collect();
        for folder in of_old.difference(&of_new) {
            // One that is not empty, or no folder, stays.
            if self.kind(&self.dir, folder, folder)? == Some("a folder")
                && self.dir.remove_dir(folder).is_ok()
            {
                self.step();
            }
        }
        Ok(())
    }

    /// Renames a file of the stage to its place.
    fn put(&self, stage: &Dir, from: &str, name: &str) -> Result<()> {
        let (folder, file) = split(name);
        let path = self.path.join(name);
        let sub;
        let to = match folder {
            None => &self.dir,
            Some(folder) => {
                if self.kind(&self.dir, folder, name)?.is_none() {
                    let path = self.path.join(folder);
                    self.dir.create_dir(folder).during("create", &path)?;
                    self.step();
                }
                sub = self.sub(folder)?;
                &sub
            }
        };
        stage.rename(from, to, file).during("write", &path)?;
        self.step();
        Ok(())
    }

    fn write(&self, dir: &Dir, name: &str, bytes: &[u8]) -> Result<()> {
        let path = self.path.join(STAGE).join(name);
        let mut options = OpenOptions::new();
        options
            .write(true)
            .create_new(true)
            .follow(FollowSymlinks::No);
        let mut file = dir.open_with(name, &options).during("create", &path)?;
        self.step();
        file.write_all(bytes).during("write", &path)?;
        self.step();
        Ok(())
    }

    /// A folder in this one, which is no link.
    fn sub(&self, name: &str) -> Result<Dir> {
        let path = self.path.join(name);
        self.dir.open_dir_nofollow(name).during("open", &path)
    }

    /// What is at a name, without following it: `None` for nothing.
    fn kind(&self, dir: &Dir, name: &str, whole: &str) -> Result<Option<&'static str>> {
        match dir.symlink_metadata(name) {
            Ok(data) => Ok(Some(kind(data.file_type()))),
            Err(error) if error.kind() == ErrorKind::NotFound => Ok(None),
            Err(source) => Err(Error::Io {
                action: "read",
                path: self.path.join(whole),
                source,
            }),
        }
    }

    fn in_the_way(&self, name: impl AsRef<Path>, kind: Option<&'static str>) -> Error {
        Error::InTheWay {
            path: self.path.join(name),
            kind,
        }
    }

    #[cfg(test)]
    fn step(&self) {
        (self.after_step)();
    }

    #[cfg(not(test))]
    #[inline]
    fn step(&self) {}
}

/// The folder and the file of a path in the folder.
fn split(name: &str) -> (Option<&str>, &str) {
    match name.split_once('/') {
        Some((folder, file)) => (Some(folder), file),
        None => (None, name),
    }
}

/// Whether a path in an output folder belongs to builds: a record, what lies in a folder of texts, or a hidden file.
#[must_use]
pub fn is_own(name: &Path) -> bool {
    let mut parts = name.components();
    let first = parts.next().and_then(|part| part.as_os_str().to_str());
    let first = first.unwrap_or_default();
    match parts.next() {
        None => {
            [MANIFEST_FILE, FRAME_FILE, api::FILE].contains(&first)
                || first.ends_with(".spv")
                || first.starts_with('.')
        }
        Some(_) => has_texts(first) || first.starts_with('.'),
    }
}

/// Whether builds write texts into a folder of this name.
fn has_texts(folder: &str) -> bool {
    SUBFOLDERS.contains(&folder) || FORMS.iter().any(|form| form.name == folder)
}

/// Whether a path is one that a build or a bundle may have written: whatever else a list from
/// elsewhere names is left alone.
fn can_be_removed(name: &str) -> bool {
    let (folder, file) = split(name);
    let plain = !file.contains(['/', '\\']) && !file.starts_with('.');
    plain
        && match folder {
            None => file.ends_with(".spv") || file == FRAME_FILE,
            Some(folder) => has_texts(folder),
        }
}

fn is_owned(owned: &Owned, name: &str, there: &[u8]) -> bool {
    owned
        .get(name)
        .is_some_and(|hashes| hashes.contains(&sha256(there)))
}

fn kind(kind: FileType) -> &'static str {
    if kind.is_file() {
        "a file"
    } else if kind.is_dir() {
        "a folder"
    } else if kind.is_symlink() {
        "a symbolic link"
    } else if FileTypeExt::is_fifo(&kind) {
        "a FIFO"
    } else if FileTypeExt::is_socket(&kind) {
        "a socket"
    } else {
        "a device"
    }
}

/// What is at a path that must be a folder, or nothing yet; `None`: one of these.
fn not_a_folder(path: &Path) -> Option<&'static str> {
    match std::fs::metadata(path) {
        Ok(data) if data.is_dir() => is_root(path).then_some("the root of a file system"),
        Ok(data) if data.is_file() => Some("a file"),
        Ok(_) => Some("a device or FIFO"),
        Err(_) if path.is_symlink() => Some("a symbolic link that leads nowhere"),
        Err(_) => None,
    }
}

fn is_root(path: &Path) -> bool {
    path.canonicalize()
        .is_ok_and(|path| path.parent().is_none())
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;
    use std::process::Command;
    use std::rc::Rc;

    use super::*;

    const LAST: &str = "manifest.json";

    type Files = BTreeMap<String, Vec<u8>>;

    fn files(list: &[(&str, &str)]) -> Files {
        list.iter()
            .map(|(name, text)| ((*name).to_owned(), text.as_bytes().to_vec()))
            .collect()
    }

    /// What three builds make. Between any two, files stay, change, come and go.
    fn build(number: usize) -> Files {
        match number {
            0 => files(&[
                ("wgsl/a.wgsl", "a"),
                ("wgsl/b.wgsl", "b"),
                ("hlsl/a.hlsl", "a"),
                (LAST, "0"),
            ]),
            1 => files(&[("wgsl/a.wgsl", "A"), ("msl/a.metal", "a"), (LAST, "1")]),
            _ => files(&[("wgsl/a.wgsl", "a"), ("hlsl/b.hlsl", "b"), (LAST, "2")]),
        }
    }

    /// What the file that is written last would say: the contents of the build that wrote it.
    fn owned(folder: &Folder) -> Owned {
        match folder.read(LAST).unwrap() {
            Found::File(bytes) => {
                let number = String::from_utf8(bytes).unwrap().parse().unwrap();
                build(number)
                    .into_iter()
                    .map(|(name, bytes)| (name, [sha256(&bytes)].into()))
                    .collect()
            }
            _ => Owned::new(),
        }
    }

    fn update(folder: &Folder, files: &Files) -> Result<Change> {
        folder.update(files, LAST, owned(folder), false)
    }

    /// Every file below a folder, and every folder that is empty.
    fn contents(root: &Path) -> Files {
        fn walk(root: &Path, folder: &Path, found: &mut Files) {
            let mut empty = true;
            for entry in std::fs::read_dir(folder).unwrap() {
                empty = false;
                let path = entry.unwrap().path();
                if path.is_dir() {
                    walk(root, &path, found);
                } else {
                    let name = path.strip_prefix(root).unwrap().to_str().unwrap();
                    found.insert(name.to_owned(), std::fs::read(&path).unwrap());
                }
            }
            if empty {
                let name = folder.strip_prefix(root).unwrap().to_str().unwrap();
                found.insert(format!("{name}/"), Vec::new());
            }
        }
        let mut found = Files::new();
        walk(root, root, &mut found);
        found
    }

    /// The process that is killed: builds `HANKEL_TEST_BUILD` in `HANKEL_TEST_FOLDER`, and ends
    /// without a word after `HANKEL_TEST_STEP` steps.
    #[test]
    fn killed() {
        let set = |name: &str| std::env::var(format!("HANKEL_TEST_{name}")).ok();
        let Some(path) = set("FOLDER") else { return };
        let last: usize = set("STEP").unwrap().parse().unwrap();
        let number: usize = set("BUILD").unwrap().parse().unwrap();
        let mut folder = Folder::create(Path::new(&path)).unwrap();
        let done = Cell::new(0);
        folder.after_step = Box::new(move || {
            done.set(done.get() + 1);
            if done.get() == last {
                // No destructor runs, as none does in a process that is killed.
                std::process::exit(77);
            }
        });
        update(&folder, &build(number)).unwrap();
    }

    fn build_and_kill(path: &Path, number: usize, step: usize) -> bool {
        let status = Command::new(std::env::current_exe().unwrap())
            .args(["--exact", "folder::tests::killed"])
            .env("HANKEL_TEST_FOLDER", path)
            .env("HANKEL_TEST_STEP", step.to_string())
            .env("HANKEL_TEST_BUILD", number.to_string())
            .output()
            .unwrap()
            .status;
        assert!(status.success() || status.code() == Some(77), "{status}");
        !status.success()
    }

    /// How many steps a build takes.
    fn steps(from: Option<usize>, to: usize) -> usize {
        let place = tempfile::tempdir().unwrap();
        let mut folder = Folder::create(place.path()).unwrap();
        if let Some(from) = from {
            update(&folder, &build(from)).unwrap();
        }
        let count = Rc::new(Cell::new(0));
        let counter = Rc::clone(&count);
        folder.after_step = Box::new(move || counter.set(counter.get() + 1));
        update(&folder, &build(to)).unwrap();
        count.get()
    }

    /// After a kill at any step, the same build and any other one find nothing in their way, and
    /// leave what they would have left without the kill.
    #[test]
    fn a_killed_build_is_finished_by_any_other() {
        for (before, killed) in [(None, 0), (Some(0), 1), (Some(1), 2)] {
            let count = steps(before, killed);
            assert!(count > 8, "{count}");
            for step in 1..=count {
                let place = tempfile::tempdir().unwrap();
                if let Some(before) = before {
                    let folder = Folder::create(place.path()).unwrap();
                    update(&folder, &build(before)).unwrap();
                }
                std::fs::write(place.path().join("notes.txt"), "mine").unwrap();
                assert!(build_and_kill(place.path(), killed, step), "{step}");
                let next = [killed, 0, 1, 2][step % 4];
                let folder = Folder::create(place.path()).unwrap();
                let change = update(&folder, &build(next));
                assert!(
                    change.is_ok(),
                    "step {step} of {killed}, then {next}: {change:?}"
                );
                drop(folder);
                let mut expected = build(next);
                expected.insert("notes.txt".into(), b"mine".into());
                assert_eq!(contents(place.path()), expected, "step {step} of {killed}");
            }
        }
    }

    /// Two kills in a row: what the first one wrote is still known after the second.
    #[test]
    fn a_build_that_is_killed_twice_is_finished() {
        for first in (3..steps(Some(0), 1)).step_by(3) {
            for second in (1..12).step_by(4) {
                let place = tempfile::tempdir().unwrap();
                update(&Folder::create(place.path()).unwrap(), &build(0)).unwrap();
                build_and_kill(place.path(), 1, first);
                build_and_kill(place.path(), 2, second);
                let folder = Folder::create(place.path()).unwrap();
                update(&folder, &build(0)).unwrap();
                assert_eq!(contents(place.path()), build(0), "{first}, {second}");
            }
        }
    }

    /// A change that cannot be prepared leaves everything as it was.
    #[test]
    fn what_is_in_the_way_stops_a_change_before_its_first_step() {
        let place = tempfile::tempdir().unwrap();
        let folder = Folder::create(place.path()).unwrap();
        update(&folder, &build(0)).unwrap();
        std::fs::create_dir(place.path().join("msl")).unwrap();
        std::fs::write(place.path().join("msl/a.metal"), "mine").unwrap();
        let before = contents(place.path());
        let error = update(&folder, &build(1)).unwrap_err();
        assert!(
            matches!(error, Error::InTheWay { kind: None, .. }),
            "{error}"
        );
        assert_eq!(contents(place.path()), before);
        // A file that was edited stays, also where the next build has none of its name.
        std::fs::remove_dir_all(place.path().join("msl")).unwrap();
        std::fs::write(place.path().join("wgsl/b.wgsl"), "edited").unwrap();
        let change = update(&folder, &build(1)).unwrap();
        assert_eq!(change.removed, ["hlsl/a.hlsl"]);
        assert!(place.path().join("wgsl/b.wgsl").exists());
    }

    #[cfg(unix)]
    #[test]
    fn links_below_the_folder_are_not_followed() {
        use std::os::unix::fs::symlink;
        let (place, other) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
        std::fs::write(other.path().join("a.wgsl"), "a").unwrap();
        std::fs::write(other.path().join("h"), "a").unwrap();
        symlink(other.path(), place.path().join("hlsl")).unwrap();
        symlink(other.path(), place.path().join("lnk")).unwrap();
        let folder = Folder::create(place.path()).unwrap();
        let hash: BTreeSet<String> = [sha256(b"a")].into();
        let mut owned = Owned::new();
        for name in [
            "hlsl/a.wgsl",
            "hlsl/h",
            "lnk/h",
            "../h",
            "wgsl/../../h",
            "x/y/z",
        ] {
            owned.insert(name.into(), hash.clone());
        }
        let new = files(&[("wgsl/a.wgsl", "a"), (LAST, "0")]);
        let change = folder.update(&new, LAST, owned.clone(), false).unwrap();
        assert!(change.removed.is_empty(), "{change:?}");
        let error = folder.update(&build(0), LAST, owned, true).unwrap_err();
        let text = error.to_string();
        assert!(
            text.ends_with("hlsl is in the way: it is a symbolic link"),
            "{text}"
        );
        assert_eq!(contents(other.path()).len(), 2);
        // A link in the place of a file: replaced only if that is asked for, and itself.
        std::fs::remove_file(place.path().join("wgsl/a.wgsl")).unwrap();
        symlink(other.path().join("h"), place.path().join("wgsl/a.wgsl")).unwrap();
        assert!(folder.update(&new, LAST, Owned::new(), false).is_err());
        folder.update(&new, LAST, Owned::new(), true).unwrap();
        assert!(!place.path().join("wgsl/a.wgsl").is_symlink());
        assert_eq!(std::fs::read(other.path().join("h")).unwrap(), b"a");
    }

    #[cfg(unix)]
    #[test]
    fn what_is_no_file_is_neither_read_nor_waited_for() {
        let place = tempfile::tempdir().unwrap();
        let folder = Folder::create(place.path()).unwrap();
        update(&folder, &build(0)).unwrap();
        let fifo = place.path().join("wgsl/a.wgsl");
        std::fs::remove_file(&fifo).unwrap();
        assert!(
            Command::new("mkfifo")
                .arg(&fifo)
                .status()
                .unwrap()
                .success()
        );
        let found = folder.read("wgsl/a.wgsl").unwrap();
        assert_eq!(found, Found::Other(fifo.clone(), "a FIFO"));
        let text = update(&folder, &build(0)).unwrap_err().to_string();
        assert!(text.ends_with("it is a FIFO"), "{text}");
        folder
            .update(&build(0), LAST, owned(&folder), true)
            .unwrap();
        assert!(fifo.is_file());
        // A sparse file of a size that no shader has.
        let large = File::create(&fifo).unwrap();
        large.set_len(MOST_BYTES + 1).unwrap();
        assert!(matches!(
            folder.read("wgsl/a.wgsl").unwrap(),
            Found::Other(..)
        ));
    }

    #[test]
    fn one_process_at_a_time() {
        let place = tempfile::tempdir().unwrap();
        let folder = Folder::create(place.path()).unwrap();
        let path = place.path().to_owned();
        let other = std::thread::spawn(move || {
            let start = Instant::now();
            let folder = Folder::create(&path).unwrap();
            update(&folder, &build(1)).unwrap();
            start.elapsed()
        });
        std::thread::sleep(Duration::from_millis(200));
        update(&folder, &build(0)).unwrap();
        drop(folder);
        assert!(other.join().unwrap() >= Duration::from_millis(150));
        assert_eq!(contents(place.path()), build(1));
    }

    #[test]
    fn the_folder_itself_must_be_one() {
        let place = tempfile::tempdir().unwrap();
        let file = place.path().join("file");
        std::fs::write(&file, "").unwrap();
        let text = Folder::create(&file).err().unwrap().to_string();
        assert!(
            text.contains("file is a file, and a folder is expected"),
            "{text}"
        );
        assert!(Folder::open(&place.path().join("none")).unwrap().is_none());
        #[cfg(unix)]
        {
            let text = Folder::create(Path::new("/")).err().unwrap().to_string();
            assert!(text.starts_with("/ is the root of a file system"), "{text}");
            let link = place.path().join("link");
            std::os::unix::fs::symlink("nowhere", &link).unwrap();
            let text = Folder::create(&link).err().unwrap().to_string();
            assert!(
                text.contains("a symbolic link that leads nowhere"),
                "{text}"
            );
        }
    }
}
