//! One hash over everything that a kernel crate's SPIR-V is made from.
//!
//! Hashed: every `.rs` file and `Cargo.toml` of the crate and of the path dependencies that it
//! compiles for SPIR-V, and name, version and checksum of the registry crates that `Cargo.lock`
//! gives those. Not hashed, because SPIR-V does not follow from it: files under `src/native`
//! (the host's half of the DSL), `tests`, `benches` and `examples`, dev-dependencies, what is only
//! compiled for other targets than SPIR-V, and where the files lie. Line ends count as `\n`.
//!
//! This file is also compiled into `codegen/embedded`'s build script: it depends on nothing of
//! this crate.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Component, Path, PathBuf};

use sha2::{Digest, Sha256};
use toml::{Table, Value};

/// What went wrong, and with which file.
#[derive(Debug)]
pub struct HashError {
    /// The file or folder.
    pub path: PathBuf,
    /// What is wrong with it.
    pub problem: String,
}

impl std::fmt::Display for HashError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}: {}", self.path.display(), self.problem)
    }
}

impl std::error::Error for HashError {}

fn fail(path: &Path, problem: impl ToString) -> HashError {
    HashError {
        path: path.to_owned(),
        problem: problem.to_string(),
    }
}

/// The sources of a kernel crate.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Sources {
    /// SHA-256 in hexadecimal.
    pub sha256: String,
    /// The crate's name.
    pub name: String,
    /// Every file that was hashed, and the lock file.
    pub files: Vec<PathBuf>,
    /// The folders of the crate and of its path dependencies.
    pub folders: Vec<PathBuf>,
}

/// Reads and hashes the sources of the crate whose Cargo.toml is `manifest`.
///
/// # Errors
///
/// A file cannot be read, or a Cargo.toml is none.
pub fn hash(manifest: &Path) -> Result<Sources, HashError> {
    let mut crates = BTreeMap::new();
    let mut registry = BTreeSet::new();
    let root = normal(&std::path::absolute(manifest).map_err(|error| fail(manifest, error))?);
    let name = add_crate(&root, &mut crates, &mut registry)?;
    let mut digest = Sha256::new();
    let mut files = Vec::new();
    // By the crates' names, not their places.
    for (name, folder) in &crates {
        let mut own = Vec::new();
        list(folder, folder, &mut own)?;
        own.sort();
        for (relative, path) in own {
            let text = std::fs::read_to_string(&path).map_err(|error| fail(&path, error))?;
            let text = text.replace("\r\n", "\n");
            for part in [name.as_str(), &relative, &text] {
                digest.update((part.len() as u64).to_le_bytes());
                digest.update(part);
            }
            files.push(path);
        }
    }
    if let Some(lock) = lock_file(&root) {
        for line in locked(&lock, &registry)? {
            digest.update((line.len() as u64).to_le_bytes());
            digest.update(line);
        }
        files.push(lock);
    }
    let sha256 = digest
        .finalize()
        .iter()
        .map(|byte| format!("{byte:02x}"))
        .collect();
    Ok(Sources {
        sha256,
        name,
        files,
        folders: crates.into_values().collect(),
    })
}

/// Adds a crate and its path dependencies; gives its name.
fn add_crate(
    manifest: &Path,
    crates: &mut BTreeMap<String, PathBuf>,
    registry: &mut BTreeSet<String>,
) -> Result<String, HashError> {
    let table = read_toml(manifest)?;
    let name = table
        .get("package")
        .and_then(|package| package.get("name"))
        .and_then(Value::as_str)
        .ok_or_else(|| fail(manifest, "it has no [package] name"))?
        .to_owned();
    let folder = manifest.parent().unwrap_or(Path::new(".")).to_owned();
    if crates.insert(name.clone(), folder.clone()).is_some() {
        return Ok(name);
    }
    let workspace = workspace(&folder)?;
    for (key, value) in dependencies(&table) {
        let (value, base) = match (value.get("workspace"), &workspace) {
            (Some(Value::Boolean(true)), Some((root, shared))) => match shared.get(&key) {
                Some(value) => (value.clone(), root.clone()),
                None => {
                    let problem = format!("`{key}` is not among the workspace's dependencies");
                    return Err(fail(manifest, problem));
                }
            },
            _ => (value, folder.clone()),
        };
        match value.get("path").and_then(Value::as_str) {
            Some(path) => {
                add_crate(
                    &normal(&base.join(path).join("Cargo.toml")),
                    crates,
                    registry,
                )?;
            }
            None => {
                let package = value.get("package").and_then(Value::as_str).unwrap_or(&key);
                registry.insert(package.to_owned());
            }
        }
    }
    Ok(name)
}

/// Dependencies that are compiled for SPIR-V, or by a proc macro for it.
fn dependencies(table: &Table) -> Vec<(String, Value)> {
    let mut found = Vec::new();
    let mut take = |table: Option<&Value>| {
        found.extend(
            table
                .and_then(Value::as_table)
                .into_iter()
                .flatten()
                .map(|(k, v)| (k.clone(), v.clone())),
        );
    };
    take(table.get("dependencies"));
    take(table.get("build-dependencies"));
    for (target, tables) in table
        .get("target")
        .and_then(Value::as_table)
        .into_iter()
        .flatten()
    {
        let other = target
            .replace(' ', "")
            .contains("not(target_arch=\"spirv\")");
        if !other {
            take(tables.get("dependencies"));
        }
    }
    found
}

/// The root of the workspace that a folder is in, and its shared dependencies.
fn workspace(folder: &Path) -> Result<Option<(PathBuf, Table)>, HashError> {
    for root in folder.ancestors() {
        let manifest = root.join("Cargo.toml");
        if !manifest.is_file() {
            continue;
        }
        if let Some(Value::Table(workspace)) = read_toml(&manifest)?.get("workspace") {
            let shared = workspace.get("dependencies").and_then(Value::as_table);
            return Ok(Some((root.to_owned(), shared.cloned().unwrap_or_default())));
        }
    }
    Ok(None)
}

fn lock_file(manifest: &Path) -> Option<PathBuf> {
    manifest
        .ancestors()
        .skip(1)
        .map(|folder| folder.join("Cargo.lock"))
        .find(|file| file.is_file())
}

/// Name, version and checksum of the named crates and of what they depend on.
fn locked(lock: &Path, names: &BTreeSet<String>) -> Result<BTreeSet<String>, HashError> {
    let table = read_toml(lock)?;
    let packages: Vec<&Table> = table
        .get("package")
        .and_then(Value::as_array)
        .into_iter()
        .flatten()
        .filter_map(Value::as_table)
        .collect();
    let text = |package: &Table, key: &str| {
        package
            .get(key)
            .and_then(Value::as_str)
            .unwrap_or_default()
            .to_owned()
    };
    let mut wanted: Vec<String> = names.iter().cloned().collect();
    let mut seen = BTreeSet::new();
    let mut lines = BTreeSet::new();
    while let Some(want) = wanted.pop() {
        if !seen.insert(want.clone()) {
            continue;
        }
        // `name`, or `name version` where there are several.
        let mut parts = want.split(' ');
        let (name, version) = (parts.next().unwrap_or_default(), parts.next());
        for package in &packages {
            let fits = text(package, "name") == name
                && version.is_none_or(|version| text(package, "version") == version);
            if !fits || !package.contains_key("source") {
                continue;
            }
            lines.insert(format!(
                "{name} {} {}",
                text(package, "version"),
                text(package, "checksum")
            ));
            let more = package
                .get("dependencies")
                .and_then(Value::as_array)
                .into_iter()
                .flatten();
            wanted.extend(more.filter_map(Value::as_str).map(str::to_owned));
        }
    }
    Ok(lines)
}

fn read_toml(path: &Path) -> Result<Table, HashError> {
    let text = std::fs::read_to_string(path).map_err(|error| fail(path, error))?;
    text.parse()
        .map_err(|error: toml::de::Error| fail(path, error.message()))
}

/// Source files below a folder: path with `/` relative to the crate, and where it is.
fn list(root: &Path, folder: &Path, found: &mut Vec<(String, PathBuf)>) -> Result<(), HashError> {
    const OTHER: [&str; 4] = ["tests", "benches", "examples", "target"];
    for entry in std::fs::read_dir(folder).map_err(|error| fail(folder, error))? {
        let entry = entry.map_err(|error| fail(folder, error))?;
        let path = entry.path();
        let name = entry.file_name().to_string_lossy().into_owned();
        let kind = entry.file_type().map_err(|error| fail(&path, error))?;
        if kind.is_dir() {
            let at_root = folder == root;
            let skipped = name.starts_with('.')
                || at_root && OTHER.contains(&name.as_str())
                // A crate within the crate's folder is another crate.
                || path.join("Cargo.toml").is_file()
                || folder == root.join("src") && name == "native";
            if !skipped {
                list(root, &path, found)?;
            }
        } else if name.ends_with(".rs") || name == "Cargo.toml" && folder == root {
            let relative = path.strip_prefix(root).unwrap_or(&path);
            let parts: Vec<_> = relative
                .components()
                .map(|part| part.as_os_str().to_string_lossy())
                .collect();
            found.push((parts.join("/"), path));
        }
    }
    Ok(())
}

/// Without `.` and `..`, so that a crate that is reached by two ways is one.
fn normal(path: &Path) -> PathBuf {
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
