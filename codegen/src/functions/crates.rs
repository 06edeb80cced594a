//! A crate's sources from disk.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use toml::{Table, Value};

use super::source::CrateText;
use crate::error::{During, Error, Result};
use crate::files::{self, sha256};
use crate::inputs::{normal, workspace_of};

/// Size of the largest source, in bytes.
const MOST_BYTES: u64 = 16 << 20;

/// What libraries are made from.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Sources {
    /// The kernel crate, which is the first, and the crates that it depends on by path.
    pub texts: Vec<CrateText>,
    /// Every file and folder that was read, as absolute paths.
    pub paths: Vec<PathBuf>,
}

/// The sources of the kernel crate at `manifest`.
///
/// # Errors
/// A file that cannot be read, or a Cargo.toml that is none.
pub fn sources(manifest: &Path) -> Result<Sources> {
    let manifest = normal(&std::path::absolute(manifest).during("resolve", manifest)?);
    let mut found = BTreeMap::new();
    let mut all = vec![manifest];
    let mut next = 0;
    while let Some(manifest) = all.get(next).cloned() {
        next += 1;
        if found.contains_key(&manifest) {
            continue;
        }
        let krate = Crate::read(&manifest)?;
        all.extend(krate.dependencies()?);
        found.insert(manifest, krate);
    }
    let mut sources = Sources::default();
    for manifest in all {
        if let Some(krate) = found.remove(&manifest) {
            sources.paths.push(manifest);
            sources.paths.push(krate.workspace.0.join("Cargo.toml"));
            let text = krate.text(&mut sources.paths)?;
            sources.texts.push(text);
        }
    }
    sources.paths.sort();
    sources.paths.dedup();
    Ok(sources)
}

/// Hash of all texts, in whatever order the crates are.
#[must_use]
pub fn hash(texts: &[CrateText]) -> String {
    let mut lines: Vec<String> = texts
        .iter()
        .flat_map(|krate| {
            krate
                .files
                .iter()
                .map(|(path, text)| format!("{} {path} {}\n", krate.name, sha256(text.as_bytes())))
        })
        .collect();
    lines.sort();
    sha256(lines.concat().as_bytes())
}

/// A Cargo.toml.
struct Crate {
    folder: PathBuf,
    table: Table,
    /// The Cargo.toml of its workspace, and where that is.
    workspace: (PathBuf, Table),
}

impl Crate {
    fn read(manifest: &Path) -> Result<Self> {
        let folder = manifest.parent().unwrap_or(Path::new("/")).to_owned();
        let root = workspace_of(&folder).map_err(|e| Error::Manifest {
            path: e.path,
            problem: e.problem,
        })?;
        let workspace = table(&root.join("Cargo.toml"))?;
        Ok(Self {
            table: table(manifest)?,
            folder,
            workspace: (root, workspace),
        })
    }

    /// The manifests of the crates that it depends on by path.
    fn dependencies(&self) -> Result<Vec<PathBuf>> {
        let targets = self.table.get("target").and_then(Value::as_table);
        let tables = std::iter::once(&self.table).chain(
            targets
                .into_iter()
                .flatten()
                .filter_map(|(_, t)| t.as_table()),
        );
        let (root, workspace) = &self.workspace;
        let shared = workspace
            .get("workspace")
            .and_then(|w| w.get("dependencies"));
        let mut manifests = Vec::new();
        for (name, value) in tables
            .filter_map(|t| t.get("dependencies"))
            .filter_map(Value::as_table)
            .flatten()
        {
            let inherits = value.get("workspace").and_then(Value::as_bool) == Some(true);
            let (value, base) = if inherits {
                (shared.and_then(|s| s.get(name)), root)
            } else {
                (Some(value), &self.folder)
            };
            if let Some(path) = value.and_then(|v| v.get("path")).and_then(Value::as_str) {
                manifests.push(normal(&base.join(path).join("Cargo.toml")));
            }
        }
        Ok(manifests)
    }

    /// A field of the package, or of its workspace's.
    fn field(&self, key: &str) -> String {
        let package = self.table.get("package").and_then(|p| p.get(key));
        let workspace = self.workspace.1.get("workspace");
        let inherited = workspace
            .and_then(|w| w.get("package"))
            .and_then(|p| p.get(key));
        [package, inherited]
            .into_iter()
            .flatten()
            .find_map(Value::as_str)
            .unwrap_or_default()
            .into()
    }

    fn text(&self, paths: &mut Vec<PathBuf>) -> Result<CrateText> {
        let mut krate = CrateText {
            name: self.field("name"),
            version: self.field("version"),
            licence: self.field("license"),
            ..CrateText::default()
        };
        self.add(&self.folder.join("src"), "src", &mut krate, paths)?;
        Ok(krate)
    }

    fn add(
        &self,
        folder: &Path,
        name: &str,
        krate: &mut CrateText,
        paths: &mut Vec<PathBuf>,
    ) -> Result<()> {
        // A file that is added to the folder counts, too.
        paths.push(folder.to_owned());
        for entry in std::fs::read_dir(folder).during("read", folder)? {
            let entry = entry.during("read", folder)?;
            let own = entry.file_name().to_string_lossy().into_owned();
            if own.starts_with('.') {
                continue;
            }
            let (path, name) = (entry.path(), format!("{name}/{own}"));
            if path.is_dir() {
                self.add(&path, &name, krate, paths)?;
            } else if own.ends_with(".rs") {
                let bytes = files::read(&path, MOST_BYTES)?;
                let text = String::from_utf8(bytes).map_err(|_| Error::NotAFile {
                    path: path.clone(),
                    problem: "it is no UTF-8 text".into(),
                })?;
                krate.files.insert(name, text.replace("\r\n", "\n"));
                paths.push(path);
            }
        }
        Ok(())
    }
}

fn table(path: &Path) -> Result<Table> {
    let bytes = files::read(path, MOST_BYTES)?;
    String::from_utf8_lossy(&bytes)
        .parse()
        .map_err(|e: toml::de::Error| Error::Manifest {
            path: path.into(),
            problem: e.to_string(),
        })
}
