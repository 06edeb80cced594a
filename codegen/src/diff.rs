//! What changed between two builds, for whoever reviews the change or binds the shaders.
//!
//! Everything comes from the manifests, so a new field of the manifest is compared without a word
//! here. A change is one of the *interface* if code that binds or calls the old shader may have to
//! change with it: a binding, a layout, a workgroup size, an entry point, a signature.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::path::Path;

use serde::Serialize;
use serde_json::Value;

use crate::Language;
use crate::build::MANIFEST_FILE;
use crate::error::{Error, Result};
use crate::files::sha256;
use crate::folder::{Folder, Found};
use crate::functions::api;
use crate::manifest::{KernelEntry, Manifest, WriteOptions};

/// What changed.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Diff {
    /// Versions and options: `made_by.naga`, `options.shader_model`.
    pub build: Vec<Change>,
    /// Kernels, structures in memory, or libraries of functions, by what they are and their name:
    /// `kernel hamburger_4msm_f32`, `layout Light`.
    pub items: BTreeMap<String, Item>,
    /// How many of them are the same.
    pub same: usize,
}

/// A kernel, a layout, or a library that is not the same.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case", tag = "state")]
pub enum Item {
    /// Only the new build has it.
    Added,
    /// Only the old build has it: a change of the interface.
    Removed,
    /// Both have it.
    Changed {
        /// What of it, in the words of the manifest.
        changes: Vec<Change>,
        /// Languages whose text changed.
        texts: Vec<Language>,
    },
}

/// A value that is not the same.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Change {
    /// Its path in the manifest's entry: `bindings.moments.format`.
    pub what: String,
    /// The old value, if there was one.
    pub old: Option<Value>,
    /// The new value, if there is one.
    pub new: Option<Value>,
    /// Code that binds or calls the shader may have to change.
    pub interface: bool,
}

impl Item {
    /// A change, if there is any.
    fn of(changes: Vec<Change>, texts: Vec<Language>) -> Option<Self> {
        (!changes.is_empty() || !texts.is_empty()).then_some(Self::Changed { changes, texts })
    }

    /// Whether code that binds or calls it may have to change.
    #[must_use]
    pub fn changes_interface(&self) -> bool {
        match self {
            Self::Added => false,
            Self::Removed => true,
            Self::Changed { changes, .. } => changes.iter().any(|change| change.interface),
        }
    }
}

impl Diff {
    /// Whether nothing changed at all.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.build.is_empty() && self.items.is_empty()
    }

    /// Whether code that binds or calls the shaders may have to change.
    #[must_use]
    pub fn changes_interface(&self) -> bool {
        self.items.values().any(Item::changes_interface)
    }
}

/// Compares two folders that `hankel build` wrote: both of shaders, or both of functions.
///
/// # Errors
///
/// A folder that cannot be read, has no manifest, or one of another format; folders of different
/// kinds.
pub fn compare(old: &Path, new: &Path) -> Result<Diff> {
    match (Build::read(old)?, Build::read(new)?) {
        (Build::Shaders(old), Build::Shaders(new)) => Ok(of_manifests(&old, &new)),
        (Build::Functions(old), Build::Functions(new)) => Ok(of_libraries(&old, &new)),
        _ => Err(Error::Compared {
            path: new.to_owned(),
            problem: format!(
                "it and {} are of different kinds: one has shaders, the other has functions",
                old.display()
            ),
        }),
    }
}

/// What a folder says of itself.
enum Build {
    Shaders(Box<Manifest>),
    Functions(api::Record),
}

impl Build {
    fn read(path: &Path) -> Result<Self> {
        let fail = |problem: String| Error::Compared {
            path: path.to_owned(),
            problem,
        };
        let Some(folder) = Folder::open(path)? else {
            return Err(fail("there is no such folder".into()));
        };
        if let Some(manifest) = manifest_of(&folder, path)? {
            let files = manifest.files.iter().map(|(name, it)| (name, &it.sha256));
            as_recorded(&folder, files)?
                .map_or(Ok(()), |name| Err(fail(edited(name, MANIFEST_FILE))))?;
            return Ok(Self::Shaders(Box::new(manifest)));
        }
        if let Found::File(bytes) = folder.read(api::FILE)? {
            let record: api::Record = serde_json::from_slice(&bytes)
                .map_err(|error| fail(format!("{}: {error}", api::FILE)))?;
            as_recorded(&folder, &record.files)?
                .map_or(Ok(()), |name| Err(fail(edited(name, api::FILE))))?;
            return Ok(Self::Functions(record));
        }
        Err(fail(format!(
            "it has neither {MANIFEST_FILE} nor {}",
            api::FILE
        )))
    }
}

/// The manifest of a folder, whatever has become of the files that it names; none if there is no such file.
fn manifest_of(folder: &Folder, path: &Path) -> Result<Option<Manifest>> {
    let fail = |problem: String| Error::Compared {
        path: path.to_owned(),
        problem,
    };
    match folder.read(MANIFEST_FILE)? {
        Found::Nothing => Ok(None),
        Found::Other(_, kind) => Err(fail(format!("{MANIFEST_FILE} is {kind}"))),
        Found::File(bytes) => Manifest::from_json(&bytes)
            .map(Some)
            .map_err(|problem| fail(format!("{MANIFEST_FILE}: {problem}"))),
    }
}

/// What a folder of shaders was built with, whatever has become of its files since.
///
/// # Errors
///
/// The folder cannot be read, or has no manifest, or one of another format.
pub fn options(path: &Path) -> Result<WriteOptions> {
    let fail = |problem: &str| Error::Compared {
        path: path.to_owned(),
        problem: problem.into(),
    };
    let Some(folder) = Folder::open(path)? else {
        return Err(fail("there is no such folder"));
    };
    let manifest = manifest_of(&folder, path)?;
    manifest
        .map(|it| it.options)
        .ok_or_else(|| fail(&format!("it has no {MANIFEST_FILE}")))
}

/// The first file that is missing, or has another hash than the one that was recorded.
fn as_recorded<'a>(
    folder: &Folder,
    files: impl IntoIterator<Item = (&'a String, &'a String)>,
) -> Result<Option<&'a str>> {
    for (name, hash) in files {
        match folder.read(name)? {
            Found::File(bytes) if sha256(&bytes) == *hash => {}
            _ => return Ok(Some(name)),
        }
    }
    Ok(None)
}

fn edited(name: &str, record: &str) -> String {
    format!("{name} is missing, or is not the file that {record} names: build it again")
}

/// The manifest of a folder of shaders.
///
/// # Errors
///
/// As for [`compare`]; the folder has functions.
pub fn shaders(path: &Path) -> Result<Manifest> {
    match Build::read(path)? {
        Build::Shaders(manifest) => Ok(*manifest),
        Build::Functions(_) => Err(Error::Compared {
            path: path.to_owned(),
            problem: "it has functions, no shaders".into(),
        }),
    }
}

/// The first thing that whoever binds the SPIR-V of `old` would have to change to bind that of `new`.
#[must_use]
pub fn bound_otherwise(old: &KernelEntry, new: &KernelEntry) -> Option<Change> {
    // Where other languages bind it, and constants that are frozen, do not matter to SPIR-V.
    let is_of_spirv = |path: &str| {
        is_interface(path)
            && !path.contains(".places.")
            && !path.starts_with("languages.")
            && !path.starts_with("constants.")
            && !path.ends_with(".summary")
    };
    let mut all = changes("", old, new, is_of_spirv).into_iter();
    all.find(|change| change.interface)
}

/// The SPIR-V of a kernel in a folder of shaders.
///
/// # Errors
///
/// The folder cannot be read, has no such file, or another one than its manifest says.
pub fn spirv(path: &Path, kernel: &str) -> Result<Vec<u8>> {
    let fail = |problem: String| Error::Compared {
        path: path.to_owned(),
        problem,
    };
    let manifest = shaders(path)?;
    let file = manifest
        .kernels
        .get(kernel)
        .and_then(|entry| entry.languages.get(&Language::Spirv))
        .map(|language| &language.file)
        .ok_or_else(|| fail(format!("kernel `{kernel}` has no SPIR-V in it")))?;
    let found = Folder::open(path)?.map(|folder| folder.read(file));
    match found.transpose()? {
        Some(Found::File(bytes))
            if manifest
                .files
                .get(file)
                .is_some_and(|entry| entry.sha256 == sha256(&bytes)) =>
        {
            Ok(bytes)
        }
        _ => Err(fail(format!(
            "{file} is missing, or is not the file that {MANIFEST_FILE} names"
        ))),
    }
}

/// Compares two manifests.
#[must_use]
pub fn of_manifests(old: &Manifest, new: &Manifest) -> Diff {
    let mut diff = Diff {
        build: [
            changes("made_by", &old.made_by, &new.made_by, |_| false),
            changes("options", &old.options, &new.options, |_| false),
        ]
        .concat(),
        ..Diff::default()
    };
    diff.add("layout", &old.layouts, &new.layouts, |one, other| {
        Item::of(
            changes("", one, other, |path| !path.ends_with("summary")),
            Vec::new(),
        )
    });
    diff.add("kernel", &old.kernels, &new.kernels, |one, other| {
        let mut found = changes("", one, other, is_interface);
        // The place in the source is no property of the shader.
        found.retain(|change| !["file", "line"].contains(&change.what.as_str()));
        // Another language is an offer, and so is another one that lets a constant be specialised.
        for change in &mut found {
            let is_offer = change.what.starts_with("languages.") && change.old.is_none()
                || change.what.ends_with(".overridable_in") && !loses_overrides(one, other);
            change.interface &= !is_offer;
        }
        let texts = one
            .languages
            .iter()
            .filter_map(|(language, before)| {
                let after = other.languages.get(language)?;
                let hash = |of: &Manifest, file: &str| Some(of.files.get(file)?.sha256.clone());
                (hash(old, &before.file) != hash(new, &after.file)).then_some(*language)
            })
            .collect();
        Item::of(found, texts)
    });
    diff.add_files(&others(old), &others(new));
    diff
}

/// Hashes of the files that are of no kernel alone: headers.
fn others(manifest: &Manifest) -> BTreeMap<String, &String> {
    let of_kernels: BTreeSet<&String> = manifest
        .kernels
        .values()
        .flat_map(|kernel| kernel.languages.values().map(|text| &text.file))
        .collect();
    let others = manifest.files.iter();
    others
        .filter(|(name, _)| !of_kernels.contains(name))
        .map(|(name, file)| (name.clone(), &file.sha256))
        .collect()
}

/// Compares two records of libraries.
#[must_use]
pub fn of_libraries(old: &api::Record, new: &api::Record) -> Diff {
    let mut diff = Diff {
        build: [
            changes("hankel", &old.hankel, &new.hankel, |_| false),
            changes("prefix", &old.prefix, &new.prefix, |_| true),
            changes("functions", &old.functions, &new.functions, |_| false),
        ]
        .concat(),
        ..Diff::default()
    };
    diff.add("library", &old.libraries, &new.libraries, |one, other| {
        let mut found = changes("", one, other, |path| path.starts_with("signatures."));
        // A new function is an offer.
        for change in &mut found {
            change.interface &= change.old.is_some();
        }
        Item::of(found, Vec::new())
    });
    diff.add_files(&old.files, &new.files);
    diff
}

/// Whether some language lets a constant be specialised in the old one alone.
fn loses_overrides(old: &KernelEntry, new: &KernelEntry) -> bool {
    let of = |kernel: &KernelEntry| -> BTreeSet<(String, Language)> {
        let constants = kernel.constants.iter();
        constants
            .flat_map(|it| {
                it.overridable_in
                    .iter()
                    .map(|language| (it.name.clone(), *language))
            })
            .collect()
    };
    !of(old).is_subset(&of(new))
}

/// Whether code that binds a kernel follows from what the manifest's entry says at `path`.
fn is_interface(path: &str) -> bool {
    let first = path.split('.').next().unwrap_or_default();
    let last = path.rsplit('.').next().unwrap_or_default();
    let value_of_constant =
        first == "constants" && !["id", "macro", "overridable_in"].contains(&last);
    let interface = [
        "stage",
        "workgroup_size",
        "dimensions",
        "range",
        "bindings",
        "constants",
        "inputs",
        "outputs",
        "languages",
    ];
    interface.contains(&first) && !value_of_constant
}

impl Diff {
    /// Adds the items of a kind that are not the same.
    fn add<T>(
        &mut self,
        kind: &str,
        old: &BTreeMap<String, T>,
        new: &BTreeMap<String, T>,
        compare: impl Fn(&T, &T) -> Option<Item>,
    ) {
        let names: BTreeSet<&String> = old.keys().chain(new.keys()).collect();
        for name in names {
            let item = match (old.get(name), new.get(name)) {
                (None, _) => Item::Added,
                (_, None) => Item::Removed,
                (Some(one), Some(other)) => match compare(one, other) {
                    Some(item) => item,
                    None => {
                        self.same += 1;
                        continue;
                    }
                },
            };
            self.items.insert(format!("{kind} {name}"), item);
        }
    }

    /// Adds the files that differ, by their hashes.
    fn add_files<T: PartialEq>(&mut self, old: &BTreeMap<String, T>, new: &BTreeMap<String, T>) {
        self.add("file", old, new, |one, other| {
            (one != other).then(|| Item::Changed {
                changes: Vec::new(),
                texts: Vec::new(),
            })
        });
    }
}

/// The values of two things that are not the same; `interface` says of a path what it is.
fn changes<T: Serialize>(
    root: &str,
    old: &T,
    new: &T,
    interface: impl Fn(&str) -> bool,
) -> Vec<Change> {
    let values = |it: &T| {
        let mut values = BTreeMap::new();
        // Maps have string keys and floats are finite: nothing here can fail.
        flatten(
            root.to_owned(),
            serde_json::to_value(it).unwrap_or_default(),
            &mut values,
        );
        values
    };
    let (old, new) = (values(old), values(new));
    let paths: BTreeSet<&String> = old.keys().chain(new.keys()).collect();
    paths
        .into_iter()
        .filter(|path| old.get(*path) != new.get(*path))
        .map(|path| Change {
            what: path.clone(),
            old: old.get(path).cloned(),
            new: new.get(path).cloned(),
            interface: interface(path),
        })
        .collect()
}

/// All values within `value` by their paths. Elements of an array that have names go by these.
fn flatten(path: String, value: Value, out: &mut BTreeMap<String, Value>) {
    let below = |name: &str| match path.as_str() {
        "" => name.to_owned(),
        path => format!("{path}.{name}"),
    };
    let name = |value: &Value| Some(value.get("name")?.as_str()?.to_owned());
    match value {
        Value::Object(fields) => {
            for (name, value) in fields {
                flatten(below(&name), value, out);
            }
        }
        Value::Array(elements)
            if !elements.is_empty() && elements.iter().all(|it| name(it).is_some()) =>
        {
            for mut value in elements {
                let name = name(&value).unwrap_or_default();
                if let Value::Object(fields) = &mut value {
                    fields.remove("name");
                }
                flatten(below(&name), value, out);
            }
        }
        value => {
            out.insert(path, value);
        }
    }
}

impl fmt::Display for Change {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let shown = |value: &Option<Value>| match value {
            None => "none".into(),
            Some(Value::String(text)) => text.clone(),
            Some(value) => value.to_string(),
        };
        write!(
            f,
            "{}: {} -> {}",
            self.what,
            shown(&self.old),
            shown(&self.new)
        )?;
        let number = |value: &Option<Value>| value.as_ref().and_then(Value::as_f64);
        if let (Some(old), Some(new)) = (number(&self.old), number(&self.new))
            && self.what.starts_with("cost.")
            && old > 0.0
        {
            write!(f, " ({:+.1} %)", 100.0 * (new - old) / old)?;
        }
        if self.interface {
            f.write_str("  [interface]")?;
        }
        Ok(())
    }
}

impl fmt::Display for Diff {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.is_empty() {
            return write!(f, "nothing changed: {} items are the same", self.same);
        }
        for change in &self.build {
            writeln!(f, "{change}")?;
        }
        for (name, item) in &self.items {
            match item {
                Item::Added => writeln!(f, "+ {name}")?,
                Item::Removed => writeln!(f, "- {name}  [interface]")?,
                Item::Changed { changes, texts } => {
                    writeln!(f, "~ {name}")?;
                    for change in changes {
                        writeln!(f, "    {change}")?;
                    }
                    if !texts.is_empty() {
                        let texts: Vec<&str> = texts.iter().map(|it| it.name()).collect();
                        writeln!(f, "    text: {}", texts.join(", "))?;
                    }
                }
            }
        }
        let count = |which: fn(&Item) -> bool| self.items.values().filter(|it| which(it)).count();
        write!(
            f,
            "{} changed, {} added, {} removed, {} the same; interface of {}",
            count(|it| matches!(it, Item::Changed { .. })),
            count(|it| matches!(it, Item::Added)),
            count(|it| matches!(it, Item::Removed)),
            self.same,
            match count(Item::changes_interface) {
                0 => "none changed".into(),
                n => format!("{n} changed"),
            }
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::functions::api::{LibraryRecord, Record};

    fn record(signatures: &[(&str, &str)]) -> Record {
        let library = LibraryRecord {
            api: 1,
            signatures: signatures
                .iter()
                .map(|(name, signature)| ((*name).into(), (*signature).into()))
                .collect(),
        };
        Record {
            hankel: "1".into(),
            prefix: "hankel".into(),
            functions: Vec::new(),
            libraries: [("shadows".into(), library)].into(),
            files: BTreeMap::new(),
        }
    }

    #[test]
    fn a_changed_signature_is_of_the_interface_and_a_new_one_is_not() {
        let old = record(&[("bound", "(z: f32) -> f32")]);
        let more = record(&[("bound", "(z: f32) -> f32"), ("bias", "() -> f32")]);
        let other = record(&[("bound", "(z: vec2<f32>) -> f32")]);
        assert!(of_libraries(&old, &old).is_empty());
        let offered = of_libraries(&old, &more);
        assert!(!offered.is_empty() && !offered.changes_interface());
        assert!(of_libraries(&old, &other).changes_interface());
        assert!(of_libraries(&more, &old).changes_interface());
    }

    #[test]
    fn elements_with_names_are_compared_by_them() {
        let values = |text: &str| {
            let mut values = BTreeMap::new();
            let json = serde_json::from_str(text).expect("JSON");
            flatten(String::new(), json, &mut values);
            values
        };
        // Their order does not count, that of others does.
        let one = values(r#"{"a": [{"name": "x", "n": 1}, {"name": "y", "n": 2}], "b": [1, 2]}"#);
        let two = values(r#"{"a": [{"name": "y", "n": 2}, {"name": "x", "n": 1}], "b": [2, 1]}"#);
        assert_eq!(one["a.x.n"], two["a.x.n"]);
        assert_ne!(one["b"], two["b"]);
    }
}
