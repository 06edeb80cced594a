//! From a crate's SPIR-V that is not linked yet to a module for each entry point, by rust-gpu's linker.
//!
//! rustc compiles the crate with `-Zno-link`. It then leaves the crate's SPIR-V, an object, and a file `CRATE.rlink`,
//! from which `rustc -Zlink-only` links it. Linking takes most of a build, in proportion to what is linked. So an entry
//! point is linked again only if what it reaches has changed, and several processes each link a part.

use std::collections::{BTreeMap, BTreeSet};
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::Stdio;
use std::time::Duration;

use hankel_system::process::Program;
use hankel_system::temporary::Folder;
use object::read::archive::ArchiveFile;
use rspirv::dr::Module;
use rustc_codegen_spirv_types::{CompileResult, ModuleResult};

use crate::compile::{CRATE_TYPE, Compiler, TARGET};
use crate::error::{During, Error, Result};
use crate::files::sha256;
use crate::kept::Kept;
use crate::messages::Messages;
use crate::spirv::assigned::copy_assigned;
use crate::spirv::fingerprint::{self, Fingerprint};
use crate::spirv::{self, divide, unlinked};

/// Most processes that link at once: each reads the standard library's SPIR-V.
const MOST_PROCESSES: usize = 8;

/// The end of the names of the lists that rust-gpu writes of its modules.
pub(crate) const LIST: &str = ".spv.json";

/// The end of the names of objects.
const OBJECT: &str = ".rcgu.o";

/// How long a compiler counts as one that cannot link what it has not compiled just now: the cause may have been another
/// one, like a full disk.
const NOTED_FOR: Duration = Duration::from_secs(24 * 60 * 60);

/// Whether linking is a step of its own: [`Unlinked`]. Where this compiler cannot do that, or what it would link is wrong,
/// it compiles and links at once. Such modules compute the same, and a few have other bytes: with lines of the source in
/// them, rust-gpu keeps branches that are empty.
pub(crate) struct Separately {
    is_on: bool,
    has_failed: bool,
    /// Holds the version of a compiler that links nothing by itself.
    file: PathBuf,
    version: String,
}

impl Separately {
    /// For this version of the compiler. `file` is for the note.
    pub(crate) fn of(file: PathBuf, version: &str) -> Self {
        let age = std::fs::metadata(&file).and_then(|it| it.modified());
        let age = age.map_or(Duration::MAX, |it| it.elapsed().unwrap_or_default());
        let is_noted =
            age < NOTED_FOR && std::fs::read_to_string(&file).is_ok_and(|it| it == version);
        Self {
            is_on: !is_noted,
            has_failed: false,
            file,
            version: version.into(),
        }
    }

    pub(crate) fn is_on(&self) -> bool {
        self.is_on
    }

    /// rustc's flag.
    pub(crate) fn flag(&self) -> Option<&'static str> {
        self.is_on.then_some("-Zno-link")
    }

    /// It could not be linked. Either the compiler cannot do that, or what it links is wrong.
    pub(crate) fn fails(&mut self) {
        self.is_on = false;
        self.has_failed = true;
    }

    /// What could not be linked by itself was linked at once: so it was the compiler. Where this cannot be noted, the
    /// next build tries both again.
    pub(crate) fn at_once_works(&self) {
        if self.has_failed {
            let _ = std::fs::write(&self.file, &self.version);
        }
    }
}

/// A crate that rustc has compiled and not linked.
pub(crate) struct Unlinked<'a> {
    pub compiler: &'a Compiler,
    /// What `rustc --version` prints.
    pub version: &'a str,
    /// rustc's flags, the target's among them.
    pub flags: &'a [OsString],
    /// Where rust-gpu's artefacts are.
    pub target_dir: &'a Path,
    /// Where linked modules are kept, a folder for each crate.
    pub linked_dir: &'a Path,
    /// What cargo said.
    pub messages: &'a Messages,
    /// The list of modules that linking would have written.
    pub list: &'a Path,
    /// Whether other entry points of the crate may be asked for by the next build.
    pub is_part: bool,
}

impl Unlinked<'_> {
    /// Links it. `None`: this compiler's files are not as they are expected, or the linker fails. Then the crate is to be
    /// linked as a whole, by which cargo says what is wrong.
    pub(crate) fn link(&self) -> Option<BTreeMap<String, Vec<u8>>> {
        let (folder, name) = place(self.list)?;
        let rlink = std::fs::read(rlink_of(self.list)?).ok()?;
        let rlink = Rlink::of(&rlink, &folder, &name)?;
        let object = std::fs::read(&rlink.object).ok()?;
        let words = unlinked::lean(&spirv::words(&object, &name).ok()?);
        let mut module = spirv::load(&words, &name).ok()?;
        copy_assigned(&mut module);
        rlink.remove_others(&folder, &name);
        let kept = Kept::within(self.linked_dir.join(&name));
        let base = self.base()?;
        let parts: BTreeMap<String, (String, Fingerprint)> = fingerprint::entry_points(&module)
            .into_iter()
            .map(|(name, it)| (name, (named(&base, &it), it)))
            .collect();
        let mut modules = BTreeMap::new();
        let mut changed = Vec::new();
        for (entry, (file, fingerprint)) in &parts {
            match kept.read(file) {
                Some(bytes) => {
                    modules.insert(entry.clone(), bytes);
                }
                None => changed.push((fingerprint.size, entry.as_str())),
            }
        }
        for (entry, bytes) in self.link_parts(&module, &rlink, &name, changed)? {
            kept.write(&parts.get(&entry)?.0, &bytes);
            modules.insert(entry, bytes);
        }
        if !self.is_part {
            kept.sweep(&parts.values().map(|(file, _)| file.as_str()).collect());
        }
        Some(modules)
    }

    /// The modules of these entry points, which come with their sizes.
    fn link_parts(
        &self,
        module: &Module,
        rlink: &Rlink<'_>,
        name: &str,
        entries: Vec<(u64, &str)>,
    ) -> Option<Vec<(String, Vec<u8>)>> {
        let processors = std::thread::available_parallelism().map_or(1, usize::from);
        let groups = grouped(entries, processors.min(MOST_PROCESSES));
        if groups.is_empty() {
            return Some(Vec::new());
        }
        let all = Folder::within(self.target_dir).ok()?;
        let done: Vec<_> = std::thread::scope(|scope| {
            let running: Vec<_> = groups
                .iter()
                .enumerate()
                .map(|(number, group)| {
                    let all = all.path();
                    scope.spawn(move || {
                        let folder = as_long_as(&rlink.folder, all, number)?;
                        self.link_part(&divide::part(module, group), rlink, &folder, name)
                    })
                })
                .collect();
            running
                .into_iter()
                .map(|it| it.join().ok().flatten())
                .collect()
        });
        let modules: Option<Vec<_>> = done.into_iter().collect();
        Some(modules?.into_iter().flatten().collect())
    }

    fn link_part(
        &self,
        part: &Module,
        rlink: &Rlink<'_>,
        folder: &Path,
        name: &str,
    ) -> Option<BTreeMap<String, Vec<u8>>> {
        std::fs::create_dir_all(folder).ok()?;
        let object = folder.join(rlink.object.file_name()?);
        std::fs::write(&object, spirv::bytes(&spirv::store(part))).ok()?;
        let file = folder.join(format!("{name}.rlink"));
        std::fs::write(&file, rlink.moved_to(folder)?).ok()?;
        let mut rustc = self.compiler.command("rustc");
        rustc
            .current_dir(folder)
            .args(["-Zunstable-options", "-Zlink-only"])
            .arg(&file)
            .args(["--crate-type", CRATE_TYPE, "-Copt-level=3"])
            .args(self.flags)
            .stdout(Stdio::null())
            .stderr(Stdio::null());
        let status = Program::start(&mut rustc).ok()?.wait().ok()?;
        let list = folder.join(format!("{name}{LIST}"));
        status.success().then(|| read_list(&list).ok()).flatten()
    }

    /// A hash of what all modules follow from, beside their own parts: the compiler, its flags, and the crates that
    /// are linked with this one.
    fn base(&self) -> Option<String> {
        let mut parts = vec![self.version.to_owned(), TARGET.to_owned()];
        for program in self.compiler.files() {
            let data = std::fs::metadata(&program).ok()?;
            parts.push(format!("{} {:?}", data.len(), data.modified().ok()));
        }
        let flags = self
            .flags
            .iter()
            .map(|it| it.to_string_lossy().into_owned());
        parts.extend(flags);
        let mut libraries = Vec::new();
        for rlib in rlibs(self.messages) {
            let bytes = std::fs::read(rlib).ok()?;
            let archive = ArchiveFile::parse(&*bytes).ok()?;
            for member in archive.members() {
                let member = member.ok()?;
                if member.name().ends_with(b".o") {
                    libraries.push(of_library(member.data(&*bytes).ok()?)?);
                }
            }
        }
        // cargo names them in any order.
        libraries.sort_unstable();
        parts.extend(libraries);
        Some(sha256(parts.join("\n").as_bytes()))
    }
}

/// Size of the largest object that is read: larger ones, like the standard library's, change with the compiler.
const MOST_READ: usize = 2 << 20;

/// A hash of the SPIR-V of a crate that is linked with others.
fn of_library(object: &[u8]) -> Option<String> {
    if object.len() > MOST_READ {
        return Some(sha256(object));
    }
    let words = unlinked::lean(&spirv::words(object, "").ok()?);
    let module = spirv::load(&words, "").ok()?;
    Some(sha256(&fingerprint::library(&module)))
}

/// The name of a kept module.
fn named(base: &str, part: &Fingerprint) -> String {
    sha256(&[base.as_bytes(), &part.hash].concat())
}

/// What rustc writes for its linker.
pub(crate) fn rlink_of(list: &Path) -> Option<PathBuf> {
    let (folder, name) = place(list)?;
    Some(folder.join(format!("{name}.rlink")))
}

/// Where rustc has written, and the crate's name there.
fn place(list: &Path) -> Option<(PathBuf, String)> {
    let name = list.file_name()?.to_str()?.strip_suffix(LIST)?;
    Some((list.parent()?.join("deps"), name.to_owned()))
}

/// The libraries for the target among cargo's artefacts.
fn rlibs(messages: &Messages) -> impl Iterator<Item = &Path> {
    let files = messages.artifacts.iter().flat_map(|it| &it.filenames);
    files.map(PathBuf::as_path).filter(|file| {
        let is_for_target = file.iter().any(|part| part == TARGET);
        is_for_target && file.extension().is_some_and(|it| it == "rlib")
    })
}

/// Entry points in at most `most` groups of about the same size.
fn grouped(mut entries: Vec<(u64, &str)>, most: usize) -> Vec<BTreeSet<&str>> {
    entries.sort_unstable_by(|a, b| b.cmp(a));
    let mut groups = vec![(0, BTreeSet::new()); most.min(entries.len())];
    for (size, entry) in entries {
        if let Some((sum, group)) = groups.iter_mut().min_by_key(|(sum, _)| *sum) {
            *sum += size;
            group.insert(entry);
        }
    }
    groups.into_iter().map(|(_, group)| group).collect()
}

/// What rustc writes for its linker, in a format of its own. It has the names of the object and of the folder for what
/// is linked.
struct Rlink<'a> {
    bytes: &'a [u8],
    /// Where the object is, and where what is linked would go.
    folder: String,
    object: PathBuf,
}

impl<'a> Rlink<'a> {
    fn of(bytes: &'a [u8], folder: &Path, name: &str) -> Option<Self> {
        let folder = folder.to_str()?.to_owned();
        let start = format!("{folder}{}{name}.", std::path::MAIN_SEPARATOR);
        let mut objects = find(bytes, start.as_bytes()).filter_map(|at| {
            let rest = &bytes[at..];
            let end = find(rest, OBJECT.as_bytes()).next()? + OBJECT.len();
            std::str::from_utf8(&rest[..end]).ok()
        });
        let (object, None) = (objects.next()?, objects.next()) else {
            return None;
        };
        Some(Self {
            bytes,
            object: object.into(),
            folder,
        })
    }

    /// Removes the objects of earlier builds: rust-gpu leaves each of them.
    fn remove_others(&self, folder: &Path, name: &str) {
        let is_object = |file: &Path| {
            let file = file.file_name().unwrap_or_default().to_string_lossy();
            file.starts_with(&format!("{name}.")) && file.ends_with(OBJECT)
        };
        let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
        for file in entries.map(|entry| entry.path()) {
            if is_object(&file) && file != self.object {
                // One that stays takes room, and does no harm.
                let _ = std::fs::remove_file(&file);
            }
        }
    }

    /// The same with another folder, whose name is as long: lengths stand in the file.
    fn moved_to(&self, folder: &Path) -> Option<Vec<u8>> {
        let (old, new) = (self.folder.as_bytes(), folder.to_str()?.as_bytes());
        if old.len() != new.len() {
            return None;
        }
        let object = self.object.to_str()?.as_bytes();
        let mut bytes = self.bytes.to_vec();
        for at in find(self.bytes, old) {
            let rest = &self.bytes[at..];
            // Libraries stay where they are.
            let is_folder =
                !rest[old.len()..].starts_with(std::path::MAIN_SEPARATOR_STR.as_bytes());
            if is_folder || rest.starts_with(object) {
                bytes[at..at + new.len()].copy_from_slice(new);
            }
        }
        Some(bytes)
    }
}

/// Where a text stands.
fn find(bytes: &[u8], text: &[u8]) -> impl Iterator<Item = usize> {
    let windows = bytes.windows(text.len()).enumerate();
    windows.filter(move |(_, it)| *it == text).map(|(at, _)| at)
}

/// A folder in `within` whose name is as long as `other`.
fn as_long_as(other: &str, within: &Path, number: usize) -> Option<PathBuf> {
    let start = format!("{}{}", within.to_str()?, std::path::MAIN_SEPARATOR);
    let width = other.len().checked_sub(start.len())?;
    let folder = format!("{start}{number:0width$}");
    (folder.len() == other.len()).then(|| folder.into())
}

/// The modules of a list that rust-gpu has written, one for each entry point.
pub(crate) fn read_list(list: &Path) -> Result<BTreeMap<String, Vec<u8>>> {
    let json = std::fs::read(list).during("read", list)?;
    let result: CompileResult = serde_json::from_slice(&json).map_err(|error| Error::Bundle {
        path: list.to_owned(),
        problem: format!("rust-gpu wrote no list of modules: {error}"),
    })?;
    let ModuleResult::SingleModule(file) = result.module else {
        return Err(Error::Bundle {
            path: list.to_owned(),
            problem: "rust-gpu wrote a module for each entry point".into(),
        });
    };
    let bytes = std::fs::read(&file).during("read", &file)?;
    let crate_name = file.file_stem().unwrap_or_default().to_string_lossy();
    let module = spirv::load(&spirv::words(&bytes, &crate_name)?, &crate_name)?;
    Ok(divide::entry_points(&module)
        .into_iter()
        .map(|(name, module)| (name, spirv::bytes(&spirv::store(&module))))
        .collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_compiler_that_links_nothing_by_itself_is_noted() {
        let folder = Folder::new().unwrap();
        let of = |version: &str| Separately::of(folder.join("note"), version);
        let mut first = of("1");
        first.at_once_works();
        assert!(of("1").is_on(), "it has not failed");
        first.fails();
        assert!(
            !first.is_on() && of("1").is_on(),
            "what it linked may be wrong"
        );
        first.at_once_works();
        assert!(!of("1").is_on() && of("2").is_on());
        let note = std::fs::File::options()
            .append(true)
            .open(&first.file)
            .unwrap();
        note.set_modified(std::time::SystemTime::now() - 2 * NOTED_FOR)
            .unwrap();
        assert!(of("1").is_on());
    }

    #[test]
    fn groups_are_of_about_the_same_size() {
        let groups = grouped(vec![(1, "a"), (9, "b"), (4, "c"), (5, "d")], 2);
        assert_eq!(
            groups,
            [BTreeSet::from(["b", "a"]), BTreeSet::from(["c", "d"])]
        );
        assert_eq!(grouped(vec![(3, "a")], 8), [BTreeSet::from(["a"])]);
        assert!(grouped(Vec::new(), 8).is_empty());
    }

    #[test]
    fn what_is_linked_goes_to_another_folder_and_libraries_stay() {
        let bytes = b"rust\x10/t/spirv/deps/k.abc-cgu.0.rcgu.o\xc1\
            /t/spirv/deps/libcore.rlib\xc1\x0d/t/spirv/deps\xc1k";
        let rlink = Rlink::of(bytes, Path::new("/t/spirv/deps"), "k").unwrap();
        assert_eq!(rlink.object, Path::new("/t/spirv/deps/k.abc-cgu.0.rcgu.o"));
        let folder = as_long_as(&rlink.folder, Path::new("/t/x"), 1).unwrap();
        assert_eq!(folder, Path::new("/t/x/00000001"));
        let moved = rlink.moved_to(&folder).unwrap();
        assert_eq!(
            moved.as_slice(),
            b"rust\x10/t/x/00000001/k.abc-cgu.0.rcgu.o\xc1\
            /t/spirv/deps/libcore.rlib\xc1\x0d/t/x/00000001\xc1k"
        );
        // What has several objects, or another name, is not understood.
        assert!(Rlink::of(bytes, Path::new("/t/spirv/deps"), "other").is_none());
        let twice = [&bytes[..], bytes].concat();
        assert!(Rlink::of(&twice, Path::new("/t/spirv/deps"), "k").is_none());
        assert!(rlink.moved_to(Path::new("/t/x")).is_none());
    }

    #[test]
    fn a_name_as_long_as_another_needs_room() {
        assert_eq!(
            as_long_as("/a/bcd", Path::new("/a"), 7).unwrap(),
            Path::new("/a/007")
        );
        assert!(as_long_as("/a/b", Path::new("/a/longer"), 7).is_none());
        assert!(as_long_as("/a/b", Path::new("/a"), 77).is_none());
    }
}
