//! A build: every kernel that is asked for, in every language that is asked for, to a folder.
//!
//! ```text
//! OUT/manifest.json
//! OUT/LANGUAGE/KERNEL.EXTENSION
//! OUT/include/hankel.h, OUT/include/hankel.rs
//! ```
//!
//! The folder holds what the last build asked for: files that an earlier build wrote and this one
//! does not make are removed. The manifest's `inputs_sha256` says what the files follow from;
//! while it is the same and the files are as they were written, nothing is done. Files that hankel
//! did not write, or that were edited since, are not overwritten unless `force` says so.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use hankel_dsl::native::describe::{Kernel, Role};
use rayon::prelude::*;
use serde::Serialize;

use crate::Language;
use crate::error::{During, Error, Failure, Result, Step};
use crate::files::{sha256, write_whole};
use crate::finish::{self, Finished};
use crate::headers::{self, Layouts};
use crate::manifest::{
    self, FileEntry, KernelEntry, LanguageEntry, Manifest, Versions, WriteOptions,
};
use crate::translate::{Ir, Options, Place, WRITERS, Written};

/// The manifest's file.
pub const MANIFEST_FILE: &str = "manifest.json";

/// What is to be built.
#[derive(Clone, Debug)]
pub struct Request {
    /// The kernel crate's name.
    pub crate_name: String,
    /// Its kernels: all; `filter` chooses.
    pub kernels: Vec<Kernel>,
    /// Kernels to build: names of entry points or functions, `*` for any letters; empty: all.
    pub filter: Vec<String>,
    /// Languages to write; empty: all.
    pub targets: Vec<Language>,
    /// How.
    pub options: Options,
    /// Hash of the sources ([`crate::source_hash::hash`]).
    pub source_sha256: String,
    /// Version of rust-gpu.
    pub rust_gpu: String,
}

/// The SPIR-V of a crate's kernels, by entry point.
#[derive(Clone, Debug, PartialEq)]
pub enum Modules {
    /// As rust-gpu wrote it.
    Raw(BTreeMap<String, Vec<u8>>),
    /// Finished before, as a bundle has it.
    Final(BTreeMap<String, Vec<u8>>),
}

/// Files and manifest of a build, in memory.
#[derive(Clone, Debug)]
pub struct Generated {
    /// What was made.
    pub manifest: Manifest,
    /// Every file by its path in the output folder, the manifest included.
    pub files: BTreeMap<String, Vec<u8>>,
}

/// What a build did.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Report {
    /// Files that were written.
    pub written: Vec<String>,
    /// Files that were right already.
    pub unchanged: usize,
    /// Files of an earlier build that were removed.
    pub removed: Vec<String>,
    /// Kernels that were built.
    pub kernels: usize,
    /// (kernel, language, why) of what cannot be expressed.
    pub unsupported: Vec<(String, Language, String)>,
}

impl Request {
    /// The chosen kernels, by name.
    ///
    /// # Errors
    ///
    /// A filter fits none, two kernels share a name, or a frozen constant is no kernel's.
    pub fn chosen(&self) -> Result<Vec<&Kernel>> {
        let mut chosen: BTreeMap<&str, &Kernel> = BTreeMap::new();
        let mut used = BTreeSet::new();
        for kernel in &self.kernels {
            let fits = |filter: &&String| {
                matches(filter, &kernel.name) || matches(filter, &kernel.function)
            };
            let fitting: Vec<&String> = self.filter.iter().filter(fits).collect();
            if self.filter.is_empty() || !fitting.is_empty() {
                used.extend(fitting);
                if chosen.insert(&kernel.name, kernel).is_some() {
                    return Err(Error::DuplicateKernel {
                        name: kernel.name.clone(),
                    });
                }
            }
        }
        if let Some(name) = self.filter.iter().find(|filter| !used.contains(filter)) {
            let known = self
                .kernels
                .iter()
                .map(|kernel| kernel.name.clone())
                .collect();
            return Err(Error::UnknownKernel {
                name: name.clone(),
                known,
            });
        }
        let constants: BTreeSet<&str> = chosen
            .values()
            .flat_map(|kernel| constants(kernel))
            .collect();
        if let Some(name) = self
            .options
            .constants
            .keys()
            .find(|name| !constants.contains(name.as_str()))
        {
            let known = constants.into_iter().map(str::to_owned).collect();
            return Err(Error::UnknownConstant {
                name: name.clone(),
                known,
            });
        }
        Ok(chosen.into_values().collect())
    }

    fn targets(&self) -> BTreeSet<Language> {
        if self.targets.is_empty() {
            Language::ALL.into()
        } else {
            self.targets.iter().copied().collect()
        }
    }

    /// Hash of everything that the files follow from.
    fn inputs_sha256(&self, chosen: &[&Kernel]) -> String {
        let options = WriteOptions::of(&self.options);
        let versions = Versions::with(&self.rust_gpu);
        let inputs = (
            manifest::FORMAT,
            &self.crate_name,
            chosen,
            self.targets(),
            options,
            versions,
            WRITERS,
            &self.source_sha256,
        );
        // Nothing in it can fail to become JSON.
        sha256(&serde_json::to_vec(&inputs).unwrap_or_default())
    }
}

fn constants(kernel: &Kernel) -> impl Iterator<Item = &str> {
    kernel
        .params
        .iter()
        .filter(|param| matches!(param.role, Role::Constant { .. }))
        .map(|param| param.name.as_str())
}

/// Whether a name fits a pattern with `*` for any letters.
#[must_use]
pub fn matches(pattern: &str, name: &str) -> bool {
    // The second wildcard, for one letter, is not used: no name has this character.
    wildmatch::WildMatchPattern::<'*', '\0'>::new(pattern).matches(name)
}

/// Finishes raw modules: what a bundle is made of. In parallel.
///
/// # Errors
///
/// Each kernel that fails, or has no module.
pub fn finish_all(
    raw: &BTreeMap<String, Vec<u8>>,
    kernels: &[Kernel],
) -> Result<BTreeMap<String, Vec<u8>>> {
    let results: Vec<_> = kernels
        .par_iter()
        .map(|kernel| {
            let module = raw.get(&kernel.name).ok_or_else(|| missing(kernel))?;
            Ok((kernel.name.clone(), finish::finish(module, kernel)?.spirv))
        })
        .collect();
    collect(results)
}

fn missing(kernel: &Kernel) -> Failure {
    Failure {
        kernel: kernel.name.clone(),
        step: Step::Describe,
        construct: None,
        message: "there is no SPIR-V module for it".into(),
        panicked: false,
    }
}

/// All results, or all failures.
fn collect<T, C: FromIterator<T>>(results: Vec<Result<T, Failure>>) -> Result<C> {
    let mut failures = Vec::new();
    let collected = results
        .into_iter()
        .filter_map(|result| result.map_err(|failure| failures.push(failure)).ok())
        .collect();
    match failures.len() {
        0 => Ok(collected),
        1 => Err(Error::Kernel(failures.remove(0))),
        _ => Err(Error::Kernels(failures)),
    }
}

/// Makes every file in memory. Kernels are worked on in parallel.
///
/// # Errors
///
/// The request asks for what is not there, or kernels fail: all of those are named.
pub fn generate(request: &Request, modules: &Modules) -> Result<Generated> {
    let chosen = request.chosen()?;
    let inputs_sha256 = request.inputs_sha256(&chosen);
    let all: Vec<Kernel> = chosen.iter().map(|kernel| (*kernel).clone()).collect();
    let layouts = Layouts::of(&all);
    let targets = request.targets();
    let results: Vec<Result<_, Failure>> = chosen
        .par_iter()
        .map(|kernel| one(kernel, modules, &targets, &layouts, &request.options))
        .collect();
    let made: Vec<(KernelEntry, Files)> = collect(results)?;
    let mut files = BTreeMap::new();
    let mut kernels = BTreeMap::new();
    for (kernel, (entry, texts)) in chosen.iter().zip(made) {
        kernels.insert(kernel.name.clone(), entry);
        files.extend(texts);
    }
    files.insert(
        "include/hankel.h".into(),
        headers::c_header(&layouts).into_bytes(),
    );
    files.insert(
        "include/hankel.rs".into(),
        headers::rust_module(&layouts).into_bytes(),
    );
    let file_entry = |bytes: &Vec<u8>| FileEntry {
        sha256: sha256(bytes),
        bytes: bytes.len() as u64,
    };
    let manifest = Manifest {
        format: manifest::FORMAT,
        made_by: Versions::with(&request.rust_gpu),
        crate_name: request.crate_name.clone(),
        inputs_sha256,
        options: WriteOptions::of(&request.options),
        kernels,
        layouts: manifest::layouts(&layouts),
        files: files
            .iter()
            .map(|(path, bytes)| (path.clone(), file_entry(bytes)))
            .collect(),
    };
    files.insert(MANIFEST_FILE.into(), manifest.to_json().into_bytes());
    Ok(Generated { manifest, files })
}

/// Paths and contents.
type Files = Vec<(String, Vec<u8>)>;

/// A kernel as naga reads it, as often as it is asked for.
struct Readings<'a> {
    kernel: &'a Kernel,
    spirv: &'a [u8],
    settable: Option<Ir>,
    frozen: Option<Ir>,
}

impl Readings<'_> {
    /// With constants to be set, or with their values.
    fn get(&mut self, frozen: bool) -> Result<&Ir, Failure> {
        let kernel = self.kernel;
        let place = match frozen {
            true => &mut self.frozen,
            false => &mut self.settable,
        };
        if place.is_none() {
            *place = Some(if frozen {
                let values = finish::freeze(self.spirv, kernel, &defaults(kernel))?;
                Ir::read(&values.spirv, kernel)?
            } else {
                Ir::read(self.spirv, kernel)?
            });
        }
        place.as_ref().ok_or_else(|| missing(kernel))
    }
}

/// One kernel in every language.
fn one(
    kernel: &Kernel,
    modules: &Modules,
    targets: &BTreeSet<Language>,
    layouts: &Layouts,
    options: &Options,
) -> Result<(KernelEntry, Files), Failure> {
    let open = open_module(kernel, modules, options)?;
    let mut entry = manifest::entry(kernel, layouts, options, open.cost);
    let mut files = Vec::new();
    let mut readings = Readings {
        kernel,
        spirv: &open.spirv,
        settable: None,
        frozen: None,
    };
    for &language in targets {
        let path = format!(
            "{}/{}.{}",
            language.name(),
            kernel.name,
            language.extension(&kernel.stage)
        );
        let file = LanguageEntry {
            file: path.clone(),
            entry_point: kernel.name.clone(),
            sizes_buffer: None,
            sized_bindings: Vec::new(),
            requires: Vec::new(),
        };
        if language == Language::Spirv {
            for binding in &mut entry.bindings {
                let place = Place {
                    name: Some(binding.name.clone()),
                    class: "binding".into(),
                    index: Some(binding.binding),
                    space: Some(0),
                    block: None,
                    combined_with: Vec::new(),
                };
                binding.places.insert(language, place);
            }
            entry.languages.insert(language, file);
            files.push((path, open.spirv.clone()));
            continue;
        }
        // Only WGSL can express a specialisation constant: the others get its value before
        // optimisation, so that branches on it disappear. So does WGSL where implementations would
        // refuse it otherwise.
        let has_open_constants =
            constants(kernel).any(|name| !options.constants.contains_key(name));
        let ir = readings.get(language != Language::Wgsl && has_open_constants)?;
        if entry.findings.is_empty() {
            entry.findings = ir.findings();
        }
        let mut written = ir.write(language, kernel, options)?;
        if written == Written::Unsettable {
            written = readings.get(true)?.write(language, kernel, options)?;
            for constant in &mut entry.constants {
                constant.overridable_in.retain(|it| *it != language);
            }
        }
        match written {
            Written::Text(text) => {
                for binding in &mut entry.bindings {
                    if let Some(place) = text.places.get(&binding.binding) {
                        binding.places.insert(language, place.clone());
                    }
                }
                entry.languages.insert(
                    language,
                    LanguageEntry {
                        entry_point: text.entry_point,
                        sizes_buffer: text.sizes_slot,
                        sized_bindings: text.sized,
                        requires: text.requires,
                        ..file
                    },
                );
                files.push((path, text.source.into_bytes()));
            }
            Written::Unsupported(reason) => {
                entry.unsupported.insert(language, reason);
            }
            Written::Unsettable => {
                let reason = "implementations refuse it even with the values of its constants";
                entry.unsupported.insert(language, reason.into());
            }
        }
    }
    Ok((entry, files))
}

fn defaults(kernel: &Kernel) -> BTreeMap<String, u32> {
    kernel
        .params
        .iter()
        .filter_map(|param| match param.role {
            Role::Constant { default, .. } => Some((param.name.clone(), default)),
            _ => None,
        })
        .collect()
}

/// The final module, with the constants that the options freeze.
fn open_module(kernel: &Kernel, modules: &Modules, options: &Options) -> Result<Finished, Failure> {
    let finished = match modules {
        Modules::Raw(raw) => finish::finish(
            raw.get(&kernel.name).ok_or_else(|| missing(kernel))?,
            kernel,
        )?,
        Modules::Final(done) => {
            let spirv = done
                .get(&kernel.name)
                .ok_or_else(|| missing(kernel))?
                .clone();
            let cost = crate::cost::of_spirv(&spirv, &kernel.name)?;
            Finished { spirv, cost }
        }
    };
    if constants(kernel).any(|name| options.constants.contains_key(name)) {
        finish::freeze(&finished.spirv, kernel, &options.constants)
    } else {
        Ok(finished)
    }
}

/// Builds into the folder `out`, if anything has changed.
///
/// `modules` is only called if it has: it may compile. The whole check of a folder that is up to
/// date takes some milliseconds.
///
/// # Errors
///
/// As for [`generate`]; a file that hankel did not write is in the way, unless `force`; a file
/// cannot be written. Nothing is written unless everything could be made.
pub fn build(
    request: &Request,
    out: &Path,
    force: bool,
    modules: impl FnOnce() -> Result<Modules>,
) -> Result<Report> {
    let chosen = request.chosen()?;
    let before = read_manifest(out);
    if let Some(before) = &before
        && before.inputs_sha256 == request.inputs_sha256(&chosen)
        && is_whole(before, out)
    {
        return Ok(report(
            before,
            Vec::new(),
            before.files.len() + 1,
            Vec::new(),
        ));
    }
    let generated = generate(request, &modules()?)?;
    let (changed, unchanged) = compare(&generated, before.as_ref(), out, force)?;
    let mut written = Vec::new();
    for path in changed {
        write_whole(&out.join(path), &generated.files[path])?;
        written.push(path.clone());
    }
    let removed = remove_old(&generated, before.as_ref(), out)?;
    Ok(report(&generated.manifest, written, unchanged, removed))
}

fn report(
    manifest: &Manifest,
    written: Vec<String>,
    unchanged: usize,
    removed: Vec<String>,
) -> Report {
    let unsupported = manifest
        .kernels
        .iter()
        .flat_map(|(name, entry)| {
            entry
                .unsupported
                .iter()
                .map(|(language, why)| (name.clone(), *language, why.clone()))
        })
        .collect();
    Report {
        written,
        unchanged,
        removed,
        kernels: manifest.kernels.len(),
        unsupported,
    }
}

/// The manifest of the last build, if it is one that this hankel reads.
fn read_manifest(out: &Path) -> Option<Manifest> {
    Manifest::from_json(&std::fs::read(out.join(MANIFEST_FILE)).ok()?).ok()
}

/// Whether every file is as the manifest says.
fn is_whole(manifest: &Manifest, out: &Path) -> bool {
    manifest.files.iter().all(|(path, entry)| {
        std::fs::read(out.join(path)).is_ok_and(|bytes| sha256(&bytes) == entry.sha256)
    })
}

/// The files that must be written, the manifest last, and how many need not be.
fn compare<'a>(
    generated: &'a Generated,
    before: Option<&Manifest>,
    out: &Path,
    force: bool,
) -> Result<(Vec<&'a String>, usize)> {
    let mut changed = Vec::new();
    let mut unchanged = 0;
    for (name, bytes) in &generated.files {
        let path = out.join(name);
        let there = match std::fs::read(&path) {
            Ok(there) => there,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => {
                changed.push(name);
                continue;
            }
            Err(source) => {
                return Err(Error::Io {
                    action: "read",
                    path,
                    source,
                });
            }
        };
        if there == *bytes {
            unchanged += 1;
            continue;
        }
        let ours = if name == MANIFEST_FILE {
            before.is_some()
        } else {
            before
                .and_then(|before| before.files.get(name))
                .is_some_and(|entry| entry.sha256 == sha256(&there))
        };
        if !ours && !force {
            return Err(Error::InTheWay { path });
        }
        changed.push(name);
    }
    changed.sort_by_key(|name| *name == MANIFEST_FILE);
    Ok((changed, unchanged))
}

/// Removes files of the last build that this one does not make, unless they were edited.
fn remove_old(generated: &Generated, before: Option<&Manifest>, out: &Path) -> Result<Vec<String>> {
    let mut removed = Vec::new();
    for (name, entry) in before.into_iter().flat_map(|before| &before.files) {
        // A manifest from elsewhere must not lead out of the folder.
        let inside = Path::new(name)
            .components()
            .all(|part| matches!(part, std::path::Component::Normal(_)));
        if generated.files.contains_key(name) || !inside {
            continue;
        }
        let path = out.join(name);
        if std::fs::read(&path).is_ok_and(|bytes| sha256(&bytes) == entry.sha256) {
            std::fs::remove_file(&path).during("remove", &path)?;
            removed.push(name.clone());
            // The folder goes with its last file; if it is not empty, it stays.
            if let Some(folder) = path.parent().filter(|folder| *folder != out) {
                let _ = std::fs::remove_dir(folder);
            }
        }
    }
    Ok(removed)
}

#[cfg(test)]
mod tests {
    use super::matches;

    #[test]
    fn stars_stand_for_any_letters() {
        assert!(matches("blur", "blur") && !matches("blur", "blur_f32"));
        assert!(matches("blur*", "blur_f32") && matches("*f32", "blur_f32") && matches("*", ""));
        assert!(matches("b*r*2", "blur_f32") && !matches("b*x", "blur"));
    }
}
