//! What a kernel crate's SPIR-V was made from: a record that is made after a build, from what cargo
//! and rustc say that they read, and compared with the present state before the SPIR-V is used.
//!
//! Recorded are, with their hashes, the files that rustc read (`include!`, `#[path]` and what lies
//! outside of the crate among them), the manifests of the crates in folders, what build scripts
//! watch, the environment variables that were asked for, the entries in `Cargo.lock` of the
//! packages that were compiled, and what counts of cargo's settings. A new file can only matter if
//! one of these changes, too; the one exception, a new `build.rs`, is recorded as absent.
//!
//! Paths are relative to the crate's folder, so that the record holds wherever the files are.
//!
//! This file is also compiled into `codegen/embedded`'s build script: it depends on nothing of
//! this crate.

use std::collections::{BTreeMap, BTreeSet};
use std::ffi::OsString;
use std::io::Read;
use std::path::{Component, Path, PathBuf};
use std::time::SystemTime;

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use toml::{Table, Value};

/// Size of the largest input, in bytes.
const MOST_BYTES: u64 = 256 << 20;

/// Most files in a folder that a build script watches.
const MOST_FILES: usize = 100_000;

/// What SPIR-V was made from. Each hash is SHA-256 in hexadecimal.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Inputs {
    /// Files by their path from the crate's folder, with `/`; `None`: there is no such file.
    pub files: BTreeMap<String, Option<String>>,
    /// Folders that build scripts watch, with everything in them.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub folders: BTreeMap<String, Option<String>>,
    /// Environment variables by name; `None`: it is not set.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub environment: BTreeMap<String, Option<String>>,
    /// `Cargo.lock`'s entry of each package that was compiled, as `name version`; `None`: it has
    /// none.
    pub packages: BTreeMap<String, Option<String>>,
    /// What counts of cargo's configuration and of the workspace's Cargo.toml.
    pub settings: String,
}

/// What is to be recorded.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Names {
    /// Paths of files from the crate's folder.
    pub files: BTreeSet<String>,
    /// Paths of folders.
    pub folders: BTreeSet<String>,
    /// Names of environment variables.
    pub environment: BTreeSet<String>,
    /// Packages, as `name version`.
    pub packages: BTreeSet<String>,
}

/// What went wrong, and with which file.
#[derive(Debug)]
pub struct InputError {
    /// The file or folder.
    pub path: PathBuf,
    /// What is wrong with it.
    pub problem: String,
}

impl std::fmt::Display for InputError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}: {}", self.path.display(), self.problem)
    }
}

impl std::error::Error for InputError {}

fn fail(path: &Path, problem: impl ToString) -> InputError {
    InputError {
        path: path.to_owned(),
        problem: problem.to_string(),
    }
}

impl Inputs {
    /// The present state of what `names` says, for the crate in `folder`.
    ///
    /// # Errors
    ///
    /// Something that is there cannot be read.
    pub fn take(folder: &Path, names: &Names) -> Result<Self, InputError> {
        let folder = normal(&std::path::absolute(folder).map_err(|error| fail(folder, error))?);
        let settings = Settings::find(&folder, &names.files)?;
        let files = names
            .files
            .iter()
            .map(|name| Ok((name.clone(), file_hash(&folder.join(name))?)))
            .collect::<Result<_, InputError>>()?;
        let folders = names
            .folders
            .iter()
            .map(|name| Ok((name.clone(), folder_hash(&folder.join(name))?)))
            .collect::<Result<_, InputError>>()?;
        let environment = names
            .environment
            .iter()
            .map(|name| {
                let value = settings.variable(name);
                (name.clone(), value.map(|it| hash(it.as_encoded_bytes())))
            })
            .collect();
        Ok(Self {
            files,
            folders,
            environment,
            packages: locked(&workspace_of(&folder)?.join("Cargo.lock"), &names.packages)?,
            settings: settings.hash(),
        })
    }

    /// What was recorded.
    #[must_use]
    pub fn names(&self) -> Names {
        Names {
            files: self.files.keys().cloned().collect(),
            folders: self.folders.keys().cloned().collect(),
            environment: self.environment.keys().cloned().collect(),
            packages: self.packages.keys().cloned().collect(),
        }
    }

    /// How the present state differs from the recorded one, for the crate in `folder`; empty if it
    /// does not.
    #[must_use]
    pub fn changes(&self, folder: &Path) -> Vec<String> {
        match Self::take(folder, &self.names()) {
            Ok(now) => self.difference(&now),
            Err(error) => vec![error.to_string()],
        }
    }

    /// The files and folders that are there of what was recorded, as absolute paths: `Cargo.lock`, and the files of
    /// cargo's settings that count among them.
    ///
    /// # Errors
    ///
    /// One of the latter cannot be read.
    pub fn paths(&self, folder: &Path) -> Result<BTreeSet<PathBuf>, InputError> {
        let folder = normal(&std::path::absolute(folder).map_err(|error| fail(folder, error))?);
        let present = |(name, hash): (&String, &Option<String>)| {
            hash.as_ref().map(|_| normal(&folder.join(name)))
        };
        let mut paths: BTreeSet<PathBuf> = self.files.iter().filter_map(present).collect();
        for root in self.folders.iter().filter_map(present) {
            let mut found = Vec::new();
            list(&root, &root, &mut found)?;
            for (_, path) in found {
                // A folder changes when a file is added to it, or taken away, and not when one is edited.
                paths.extend(path.parent().map(Path::to_owned));
                paths.insert(path);
            }
            paths.insert(root);
        }
        let lock = workspace_of(&folder)?.join("Cargo.lock");
        paths.extend(lock.is_file().then_some(lock));
        let files = self.files.keys().cloned().collect();
        paths.extend(Settings::find(&folder, &files)?.read);
        Ok(paths)
    }

    /// When the last of the files was changed.
    #[must_use]
    pub fn newest(&self, folder: &Path) -> Option<SystemTime> {
        let mut paths: Vec<PathBuf> = self.files.keys().map(|name| folder.join(name)).collect();
        for name in self.folders.keys() {
            let mut found = Vec::new();
            let root = folder.join(name);
            // What cannot be listed could not be recorded either.
            let _ = list(&root, &root, &mut found);
            paths.extend(found.into_iter().map(|(_, path)| path));
        }
        let changed = |path: &PathBuf| std::fs::metadata(path).and_then(|data| data.modified());
        paths.iter().filter_map(|path| changed(path).ok()).max()
    }

    fn difference(&self, now: &Self) -> Vec<String> {
        type Recorded = BTreeMap<String, Option<String>>;
        let mut all = Vec::new();
        let mut compare = |what: &str, before: &Recorded, now: &Recorded| {
            for (name, before) in before {
                let how = match (before, now.get(name).unwrap_or(&None)) {
                    (before, now) if before == now => continue,
                    (_, None) => "is gone",
                    (None, _) => "is new",
                    _ => "has changed",
                };
                all.push(format!("{what}`{name}` {how}"));
            }
        };
        compare("", &self.files, &now.files);
        compare("", &self.folders, &now.folders);
        compare(
            "the environment variable ",
            &self.environment,
            &now.environment,
        );
        compare("Cargo.lock's entry of ", &self.packages, &now.packages);
        if self.settings != now.settings {
            all.push("cargo's configuration or the workspace's Cargo.toml has changed".into());
        }
        all
    }
}

fn hash(bytes: &[u8]) -> String {
    Sha256::digest(bytes)
        .iter()
        .map(|byte| format!("{byte:02x}"))
        .collect()
}

/// Hash of a regular file; `None` if there is none at the path. Rust sources and Cargo.toml are the
/// same with `\r\n` at the ends of their lines.
fn file_hash(path: &Path) -> Result<Option<String>, InputError> {
    let Ok(data) = std::fs::metadata(path) else {
        return Ok(None);
    };
    // What has become a FIFO or a device must not be waited for.
    if !data.is_file() {
        return Ok(None);
    }
    let mut bytes = Vec::new();
    std::fs::File::open(path)
        .and_then(|file| file.take(MOST_BYTES + 1).read_to_end(&mut bytes))
        .map_err(|error| fail(path, error))?;
    if bytes.len() as u64 > MOST_BYTES {
        return Err(fail(path, "an input of more than 256 MiB"));
    }
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    if (name.ends_with(".rs") || name == "Cargo.toml")
        && let Ok(text) = std::str::from_utf8(&bytes)
        && text.contains("\r\n")
    {
        return Ok(Some(hash(text.replace("\r\n", "\n").as_bytes())));
    }
    Ok(Some(hash(&bytes)))
}

/// Hash of all files in a folder, or of the file at the path; `None` if there is neither.
fn folder_hash(root: &Path) -> Result<Option<String>, InputError> {
    if !root.is_dir() {
        return file_hash(root);
    }
    let mut files = Vec::new();
    list(root, root, &mut files)?;
    files.sort();
    let mut digest = Sha256::new();
    for (name, path) in files {
        for part in [name, file_hash(&path)?.unwrap_or_default()] {
            digest.update((part.len() as u64).to_le_bytes());
            digest.update(part);
        }
    }
    Ok(Some(
        digest
            .finalize()
            .iter()
            .map(|byte| format!("{byte:02x}"))
            .collect(),
    ))
}

/// Every file below a folder: path with `/` relative to it, and where it is. Not what is hidden,
/// cargo's or git's own, another crate, or a folder that Hankel generates.
fn list(root: &Path, folder: &Path, found: &mut Vec<(String, PathBuf)>) -> Result<(), InputError> {
    for entry in std::fs::read_dir(folder).map_err(|error| fail(folder, error))? {
        let entry = entry.map_err(|error| fail(folder, error))?;
        let path = entry.path();
        let name = entry.file_name().to_string_lossy().into_owned();
        if name.starts_with('.') || name == "Cargo.lock" {
            continue;
        }
        let kind = entry.file_type().map_err(|error| fail(&path, error))?;
        if kind.is_dir() {
            if name != "target" && !path.join("Cargo.toml").is_file() && !is_generated(&path) {
                list(root, &path, found)?;
            }
        } else {
            found.push((relative(root, &path), path));
        }
        if found.len() > MOST_FILES {
            return Err(fail(root, format!("it has more than {MOST_FILES} files")));
        }
    }
    Ok(())
}

/// Whether a folder is the output of a build: its manifest says so.
fn is_generated(folder: &Path) -> bool {
    let manifest = folder.join("manifest.json");
    if !manifest.is_file() {
        return false;
    }
    let mut start = Vec::new();
    let read =
        std::fs::File::open(&manifest).and_then(|file| file.take(4096).read_to_end(&mut start));
    let start = String::from_utf8_lossy(&start);
    read.is_ok() && start.contains("\"made_by\"") && start.contains("\"hankel\"")
}

/// What counts of a configuration file of cargo's, and of those that it includes: the nearest first, as cargo looks
/// settings up. Each file is read once.
fn read_configuration(
    file: &Path,
    seen: &mut BTreeSet<PathBuf>,
    configuration: &mut Vec<Table>,
) -> Result<(), InputError> {
    // Other tables say how to fetch, link, print, and where to: SPIR-V does not follow from these.
    const TABLES: [&str; 6] = ["env", "include", "patch", "paths", "profile", "unstable"];
    if !seen.insert(file.to_owned()) {
        return Ok(());
    }
    let mut table = read_toml(file)?;
    table.retain(|name, _| TABLES.contains(&name));
    let included: Vec<PathBuf> = match table.get("include") {
        Some(Value::Array(all)) => all.iter().filter_map(included_path).collect(),
        Some(one) => included_path(one).into_iter().collect(),
        None => Vec::new(),
    };
    if !table.is_empty() {
        configuration.push(table);
    }
    let folder = file.parent().unwrap_or(Path::new("."));
    // A later one has precedence over those before it.
    for path in included.iter().rev() {
        let path = normal(&folder.join(path));
        // cargo refuses one that is not there, unless it is optional.
        if path.is_file() {
            read_configuration(&path, seen, configuration)?;
        }
    }
    Ok(())
}

/// The path in an entry of `include`: text, or a table.
fn included_path(value: &Value) -> Option<PathBuf> {
    let path = match value {
        Value::Table(table) => table.get("path")?,
        other => other,
    };
    path.as_str().map(PathBuf::from)
}

/// What counts of cargo's settings.
struct Settings {
    /// Tables of configuration files, nearest first.
    configuration: Vec<Table>,
    /// What the crates inherit from the Cargo.toml of their workspaces, and what the workspace
    /// decides.
    workspaces: BTreeMap<String, Value>,
    /// The files that these are from.
    read: BTreeSet<PathBuf>,
}

impl Settings {
    /// For the crate in `folder`, with the files of its record: the Cargo.toml among them are those
    /// of the crates in folders that belong to it.
    fn find(folder: &Path, files: &BTreeSet<String>) -> Result<Self, InputError> {
        let mut configuration = Vec::new();
        let home = std::env::var_os("CARGO_HOME")
            .map(PathBuf::from)
            .or_else(|| Some(std::env::home_dir()?.join(".cargo")));
        let above = folder.ancestors().map(|folder| folder.join(".cargo"));
        let mut seen = BTreeSet::new();
        for place in above.chain(home) {
            let file = ["config", "config.toml"]
                .map(|name| place.join(name))
                .into_iter()
                .find(|file| file.is_file());
            if let Some(file) = file {
                read_configuration(&file, &mut seen, &mut configuration)?;
            }
        }
        let mut workspaces = BTreeMap::new();
        let root = workspace_of(folder)?;
        let mut keep = |root: &Path, path: &[&str]| -> Result<(), InputError> {
            let manifest = root.join("Cargo.toml");
            seen.insert(manifest.clone());
            let mut value = Value::Table(read_toml(&manifest)?);
            for key in path {
                match value.get(key) {
                    Some(inner) => value = inner.clone(),
                    None => return Ok(()),
                }
            }
            let name = format!("{} {}", relative(folder, root), path.join("."));
            workspaces.insert(name, value);
            Ok(())
        };
        for key in ["patch", "profile", "replace"] {
            keep(&root, &[key])?;
        }
        keep(&root, &["workspace", "resolver"])?;
        for file in files.iter().filter(|file| {
            let name = file.rsplit('/').next();
            name == Some("Cargo.toml")
        }) {
            let manifest = folder.join(file);
            // One that is gone shows as a change of the files.
            let Ok(table) = read_toml(&manifest) else {
                continue;
            };
            let own = manifest.parent().unwrap_or(folder);
            let root = workspace_of(own)?;
            keep(&root, &["workspace", "package"])?;
            for name in inherited(&table) {
                keep(&root, &["workspace", "dependencies", &name])?;
            }
        }
        Ok(Self {
            configuration,
            workspaces,
            read: seen,
        })
    }

    /// An environment variable as cargo's configuration gives it to rustc.
    fn variable(&self, name: &str) -> Option<OsString> {
        let set = std::env::var_os(name);
        let configured = self
            .configuration
            .iter()
            .find_map(|table| table.get("env")?.get(name));
        match configured {
            Some(Value::Table(table)) => {
                let force = table.get("force").and_then(Value::as_bool) == Some(true);
                let value = table.get("value").and_then(Value::as_str);
                if force { None } else { set }.or_else(|| value.map(OsString::from))
            }
            Some(Value::String(value)) => set.or_else(|| Some(value.into())),
            _ => set,
        }
    }

    fn hash(&self) -> String {
        let mut text = String::new();
        for table in &self.configuration {
            text.push_str(&spell(&Value::Table(table.clone())));
        }
        for (name, value) in &self.workspaces {
            text.push_str(&format!("{name:?}{}", spell(value)));
        }
        hash(text.as_bytes())
    }
}

/// A value with the keys of its tables sorted.
fn spell(value: &Value) -> String {
    match value {
        Value::Table(table) => {
            let sorted: BTreeMap<_, _> = table.iter().map(|(k, v)| (k, spell(v))).collect();
            format!("{sorted:?}")
        }
        Value::Array(values) => format!("{:?}", values.iter().map(spell).collect::<Vec<_>>()),
        other => format!("{other:?}"),
    }
}

/// The dependencies that a crate takes over from its workspace.
fn inherited(manifest: &Table) -> BTreeSet<String> {
    const KINDS: [&str; 2] = ["build-dependencies", "dependencies"];
    let of_targets = manifest
        .get("target")
        .and_then(Value::as_table)
        .into_iter()
        .flatten()
        .filter_map(|(_, table)| table.as_table());
    std::iter::once(manifest)
        .chain(of_targets)
        .flat_map(|table| KINDS.map(|kind| table.get(kind)))
        .flatten()
        .filter_map(Value::as_table)
        .flatten()
        .filter(|(_, value)| value.get("workspace").and_then(Value::as_bool) == Some(true))
        .map(|(name, _)| name.clone())
        .collect()
}

/// The root of the workspace that the crate in `folder` belongs to: its own folder if to none.
///
/// # Errors
///
/// A Cargo.toml on the way cannot be read.
pub fn workspace_of(folder: &Path) -> Result<PathBuf, InputError> {
    let own = folder.join("Cargo.toml");
    if own.is_file()
        && let Some(root) = read_toml(&own)?
            .get("package")
            .and_then(|package| package.get("workspace"))
            .and_then(Value::as_str)
    {
        return Ok(normal(&folder.join(root)));
    }
    for root in folder.ancestors() {
        let manifest = root.join("Cargo.toml");
        if !manifest.is_file() {
            continue;
        }
        let Some(Value::Table(workspace)) = read_toml(&manifest)?.remove("workspace") else {
            continue;
        };
        let excluded = workspace
            .get("exclude")
            .and_then(Value::as_array)
            .into_iter()
            .flatten()
            .filter_map(Value::as_str)
            .any(|path| folder.starts_with(normal(&root.join(path))));
        return Ok(if excluded { folder } else { root }.to_owned());
    }
    Ok(folder.to_owned())
}

/// `Cargo.lock`'s entries of packages (`name version`): a hash of name, version, source, checksum,
/// and of those of the packages that it depends on.
fn locked(
    lock: &Path,
    packages: &BTreeSet<String>,
) -> Result<BTreeMap<String, Option<String>>, InputError> {
    let table = if lock.is_file() {
        read_toml(lock)?
    } else {
        Table::new()
    };
    let entries: Vec<&Table> = table
        .get("package")
        .and_then(Value::as_array)
        .into_iter()
        .flatten()
        .filter_map(Value::as_table)
        .collect();
    fn text<'a>(entry: &'a Table, key: &str) -> &'a str {
        entry.get(key).and_then(Value::as_str).unwrap_or_default()
    }
    let name_of = |entry: &Table| format!("{} {}", text(entry, "name"), text(entry, "version"));
    // `name`, `name version` or `name version (source)`, as far as it takes to tell them apart.
    let meant = |dependency: &str| {
        let mut parts = dependency.splitn(3, ' ');
        let (name, version) = (parts.next().unwrap_or_default(), parts.next());
        let source = parts
            .next()
            .map(|it| it.trim_matches(['(', ')']).to_owned());
        entries
            .iter()
            .filter(|entry| {
                text(entry, "name") == name
                    && version.is_none_or(|it| text(entry, "version") == it)
                    && source.as_ref().is_none_or(|it| text(entry, "source") == it)
            })
            .map(|entry| name_of(entry))
            .filter(|name| packages.contains(name))
            .collect::<Vec<_>>()
    };
    Ok(packages
        .iter()
        .map(|package| {
            let mut lines = Vec::new();
            for entry in entries.iter().filter(|entry| name_of(entry) == *package) {
                let dependencies: BTreeSet<String> = entry
                    .get("dependencies")
                    .and_then(Value::as_array)
                    .into_iter()
                    .flatten()
                    .filter_map(Value::as_str)
                    .flat_map(meant)
                    .collect();
                lines.push(format!(
                    "{package} {} {} {dependencies:?}",
                    text(entry, "source"),
                    text(entry, "checksum")
                ));
            }
            let hash = (!lines.is_empty()).then(|| hash(lines.join("\n").as_bytes()));
            (package.clone(), hash)
        })
        .collect())
}

fn read_toml(path: &Path) -> Result<Table, InputError> {
    let text = std::fs::read_to_string(path).map_err(|error| fail(path, error))?;
    text.parse()
        .map_err(|error: toml::de::Error| fail(path, error.message()))
}

/// The way from a folder to a path, with `/`; the path itself where they share nothing but the
/// root. Both are absolute and without `.` and `..`.
#[must_use]
pub fn relative(from: &Path, to: &Path) -> String {
    let shared = from
        .components()
        .zip(to.components())
        .take_while(|(a, b)| a == b)
        .count();
    let parts = |path: &Path, skip: usize| -> Vec<String> {
        path.components()
            .skip(skip)
            .map(|part| part.as_os_str().to_string_lossy().into_owned())
            .collect()
    };
    if shared < 2 {
        return to.to_string_lossy().replace('\\', "/");
    }
    let mut way = vec!["..".to_owned(); from.components().count() - shared];
    way.extend(parts(to, shared));
    if way.is_empty() {
        ".".into()
    } else {
        way.join("/")
    }
}

/// Without `.` and `..`, so that what is reached by two ways is one.
#[must_use]
pub fn normal(path: &Path) -> PathBuf {
    let mut normal = PathBuf::new();
    for part in path.components() {
        match part {
            Component::CurDir => {}
            Component::ParentDir => {
                normal.pop();
            }
            other => normal.push(other),
        }
    }
    normal
}
