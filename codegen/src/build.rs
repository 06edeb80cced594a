//! A build: every kernel that is asked for, in every language that is asked for, to a folder.
//!
//! ```text
//! OUT/manifest.json
//! OUT/LANGUAGE/KERNEL.EXTENSION
//! OUT/include/hankel.h, hankel.rs, hankel_wgpu.rs, hankel_bytemuck.rs, hankel.js, hankel.d.ts
//! ```
//!
//! The folder holds what the last build asked for: files that an earlier build wrote and this one
//! does not make are removed, files that are right already are left alone. What is right is known
//! by making it, not by what the folder says of itself. Files that hankel did not write, or that
//! were edited since, are not overwritten unless `force` says so.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use hankel_dsl::native::describe::{ConstantValue, Kernel, Role};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::Language;
use crate::comment;
use crate::error::{Error, Failure, Result, Step};
use crate::files::sha256;
use crate::finish::{self, Finished};
use crate::folder::{Change, Folder, Found, Owned};
use crate::frame;
use crate::functions::api;
use crate::headers::{self, InWgsl, Layouts};
use crate::manifest::{
    self, FileEntry, KernelEntry, LanguageEntry, Manifest, Versions, WriteOptions,
};
use crate::spirv;
use crate::translate::{Ir, Options, Place, Written};
use crate::translated::Translated;

pub use crate::folder::is_own;

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
    /// A filter fits none, two kernels share a name, a frozen constant is no kernel's, a variant has
    /// no kernel, or a binding with a place of its own does not exist.
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
            .chain(self.options.variants.values().flat_map(BTreeMap::keys))
            .find(|name| !constants.contains(name.as_str()))
        {
            let known = constants.into_iter().map(str::to_owned).collect();
            return Err(Error::UnknownConstant {
                name: name.clone(),
                known,
            });
        }
        let all = self.options.constants.iter();
        let all = all.chain(self.options.variants.values().flatten());
        for (name, value) in all {
            for param in chosen.values().flat_map(|kernel| &kernel.params) {
                if let Role::Constant { scalar, .. } = param.role
                    && param.name == *name
                    && value.word(scalar).is_none()
                {
                    return Err(Error::ConstantType {
                        name: name.clone(),
                        value: *value,
                        scalar,
                    });
                }
            }
        }
        let mut names: BTreeSet<String> = chosen.keys().map(|&name| name.to_owned()).collect();
        for (suffix, values) in &self.options.variants {
            let fail = |problem: String| Error::Variant {
                suffix: suffix.clone(),
                problem,
            };
            let copies: Vec<_> = chosen.values().filter(|it| has_all(it, values)).collect();
            if copies.is_empty() {
                return Err(fail(
                    "no kernel that is built has all of its constants".into(),
                ));
            }
            for kernel in copies {
                let name = format!("{}{suffix}", kernel.name);
                if !names.insert(name.clone()) {
                    return Err(fail(format!("two kernels would be named `{name}`")));
                }
            }
        }
        self.options.placement.check(&self.kernels)?;
        Ok(chosen.into_values().collect())
    }

    /// The chosen kernels and their variants.
    fn jobs(&self, chosen: &[&Kernel]) -> Vec<Variant> {
        let mut jobs = Vec::new();
        for kernel in chosen {
            let suffixes = self.options.variants.iter();
            let copies = suffixes.filter(|(_, values)| has_all(kernel, values));
            jobs.push(Variant {
                of: kernel.name.clone(),
                kernel: (*kernel).clone(),
                options: self.options.clone(),
                set: 0,
            });
            jobs.extend(copies.map(|(suffix, values)| {
                let name = format!("{}{suffix}", kernel.name);
                let mut options = self.options.clone();
                options.constants.extend(values.clone());
                options.placement = options.placement.of_copy(&kernel.name, &name);
                Variant {
                    of: kernel.name.clone(),
                    kernel: Kernel {
                        name,
                        ..(*kernel).clone()
                    },
                    options,
                    set: 0,
                }
            }));
        }
        jobs
    }

    fn targets(&self) -> BTreeSet<Language> {
        if self.targets.is_empty() {
            Language::ALL.into()
        } else {
            self.targets.iter().copied().collect()
        }
    }

    /// Hash of everything that the files follow from; `beside` are those that are no shaders.
    fn inputs_sha256(
        &self,
        chosen: &[&Kernel],
        spirv: &BTreeMap<&str, String>,
        beside: &[(String, Vec<u8>)],
    ) -> String {
        let beside: BTreeMap<&str, String> = beside
            .iter()
            .map(|(path, bytes)| (path.as_str(), sha256(bytes)))
            .collect();
        let options = WriteOptions::of(self);
        let versions = Versions::with(&self.rust_gpu);
        let inputs = (
            manifest::FORMAT,
            &self.crate_name,
            chosen,
            options,
            versions,
            env!("HANKEL_CODEGEN_SHA256"),
            spirv,
            beside,
        );
        // Nothing in it can fail to become JSON.
        sha256(&serde_json::to_vec(&inputs).unwrap_or_default())
    }
}

/// A kernel that is written: itself, or once more with constants fixed and under another name.
pub(crate) struct Variant {
    /// The kernel whose module it has.
    pub of: String,
    /// With the name that is written.
    pub kernel: Kernel,
    /// With the constants' values.
    pub options: Options,
    /// Descriptor set of its bindings in the SPIR-V that is written.
    pub set: u32,
}

fn has_all(kernel: &Kernel, values: &BTreeMap<String, ConstantValue>) -> bool {
    values
        .keys()
        .all(|name| constants(kernel).any(|constant| constant == name))
}

pub(crate) fn constants(kernel: &Kernel) -> impl Iterator<Item = &str> {
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

pub(crate) fn missing(kernel: &Kernel) -> Failure {
    Failure {
        kernel: kernel.name.clone(),
        step: Step::Describe,
        construct: None,
        message: "there is no SPIR-V module for it".into(),
        panicked: false,
    }
}

/// All results, or all failures.
pub(crate) fn collect<T, C: FromIterator<T>>(results: Vec<Result<T, Failure>>) -> Result<C> {
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
    let jobs = request.jobs(&chosen);
    assemble(request, &chosen, &jobs, modules, None, |_| Ok(Files::new()))
}

/// The same. What was written of a kernel by an earlier build is taken from the folder `kept`, if nothing that it
/// follows from has changed since; else it is put there.
///
/// # Errors
///
/// As for [`generate`]. What cannot be kept is made again by the next build.
pub fn generate_kept(request: &Request, modules: &Modules, kept: &Path) -> Result<Generated> {
    let chosen = request.chosen()?;
    let jobs = request.jobs(&chosen);
    assemble(request, &chosen, &jobs, modules, Some(kept), |_| {
        Ok(Files::new())
    })
}

/// Makes the files of `jobs`, which are copies of the kernels `chosen`, and what `beside` makes of their
/// entries in the manifest.
pub(crate) fn assemble(
    request: &Request,
    chosen: &[&Kernel],
    jobs: &[Variant],
    modules: &Modules,
    kept: Option<&Path>,
    beside: impl FnOnce(&BTreeMap<String, KernelEntry>) -> Result<Files>,
) -> Result<Generated> {
    let all: Vec<Kernel> = chosen.iter().map(|kernel| (*kernel).clone()).collect();
    let layouts = Layouts::of(&all);
    let targets = request.targets();
    let kept = kept.map(|folder| Translated::within(folder, &targets, &layouts));
    let results: Vec<Result<_, Failure>> = jobs
        .par_iter()
        .map(|job| {
            let make = || one(job, modules, &targets, &layouts);
            match &kept {
                Some(kept) => kept.get(job, modules, make),
                None => make(),
            }
        })
        .collect();
    let made: Vec<Made> = collect(results)?;
    if let Some(kept) = kept.filter(|_| request.filter.is_empty()) {
        kept.sweep();
    }
    let mut files = BTreeMap::new();
    let mut kernels = BTreeMap::new();
    let mut spirv = BTreeMap::new();
    let mut in_wgsl = InWgsl::new();
    for (job, it) in jobs.iter().zip(made) {
        let name = job.kernel.name.as_str();
        if targets.contains(&Language::Wgsl) {
            let places = job.options.placement.in_wgsl(&job.kernel)?;
            in_wgsl.insert(name.to_owned(), places);
        }
        spirv.insert(name, it.spirv);
        kernels.insert(name.to_owned(), it.entry);
        files.extend(it.files);
    }
    let known = request.kernels.first().map_or("", |it| it.licence.as_str());
    for (path, text) in headers::files(&layouts, &kernels, &in_wgsl) {
        let licence = comment::licence(known).map_or_else(String::new, |it| {
            // C before 1999 has no other comments.
            match path.ends_with(".h") {
                true => format!("/* {it} */\n"),
                false => format!("// {it}\n"),
            }
        });
        files.insert(path.into(), (licence + &text).into_bytes());
    }
    let file_entry = |bytes: &Vec<u8>| FileEntry {
        sha256: sha256(bytes),
        bytes: bytes.len() as u64,
    };
    let beside = beside(&kernels)?;
    let inputs_sha256 = request.inputs_sha256(chosen, &spirv, &beside);
    files.extend(beside);
    let manifest = Manifest {
        format: manifest::FORMAT,
        made_by: Versions::with(&request.rust_gpu),
        crate_name: request.crate_name.clone(),
        inputs_sha256,
        options: WriteOptions::of(request),
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
pub(crate) type Files = Vec<(String, Vec<u8>)>;

/// What is made of one kernel.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Made {
    /// What the manifest says of it.
    pub entry: KernelEntry,
    pub files: Files,
    /// Hash of its SPIR-V.
    pub spirv: String,
}

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
    job: &Variant,
    modules: &Modules,
    targets: &BTreeSet<Language>,
    layouts: &Layouts,
) -> Result<Made, Failure> {
    let Variant {
        of,
        kernel,
        options,
        set,
    } = job;
    let open = open_module(of, kernel, modules, options)?;
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
                binding.set = *set;
                let place = Place {
                    name: Some(binding.name.clone()),
                    class: "binding".into(),
                    index: Some(binding.binding),
                    space: Some(*set),
                    block: None,
                    combined_with: Vec::new(),
                };
                binding.places.insert(language, place);
            }
            entry.languages.insert(language, file);
            let module = match set {
                0 => open.spirv.clone(),
                _ => frame::in_set(&open.spirv, &kernel.name, *set)?,
            };
            files.push((path, module));
            continue;
        }
        // Only WGSL can express a specialisation constant: the others get its value before
        // optimisation, so that branches on it disappear, unless it is to stay open. So does WGSL
        // where implementations would refuse it otherwise.
        let has_open_constants =
            constants(kernel).any(|name| !options.constants.contains_key(name));
        let settles = language != Language::Wgsl && !options.open_constants;
        let ir = readings.get(settles && has_open_constants)?;
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
    Ok(Made {
        entry,
        files,
        spirv: sha256(&open.spirv),
    })
}

fn defaults(kernel: &Kernel) -> BTreeMap<String, ConstantValue> {
    kernel
        .params
        .iter()
        .filter_map(|param| match param.role {
            Role::Constant {
                scalar, default, ..
            } => Some((param.name.clone(), ConstantValue::of_word(scalar, default))),
            _ => None,
        })
        .collect()
}

/// The final module, with the constants that the options freeze.
fn open_module(
    of: &str,
    kernel: &Kernel,
    modules: &Modules,
    options: &Options,
) -> Result<Finished, Failure> {
    let module = |all: &BTreeMap<String, Vec<u8>>| -> Result<Vec<u8>, Failure> {
        let module = all.get(of).ok_or_else(|| missing(kernel))?;
        if of == kernel.name {
            return Ok(module.clone());
        }
        let mut module = spirv::load(&spirv::words(module, &kernel.name)?, &kernel.name)?;
        spirv::names::rename_entry_point(&mut module, of, &kernel.name);
        Ok(spirv::bytes(&spirv::store(&module)))
    };
    let finished = match modules {
        Modules::Raw(raw) => finish::finish(&module(raw)?, kernel)?,
        Modules::Final(done) => {
            let spirv = module(done)?;
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

/// Builds into the folder `out`: writes the files that are not right already.
///
/// # Errors
///
/// As for [`generate`]; a file that hankel did not write is in the way, unless `force`; a file
/// cannot be written. Nothing is written unless everything could be made. A build that is stopped
/// while it writes is finished by the next one.
pub fn build(request: &Request, modules: &Modules, out: &Path, force: bool) -> Result<Report> {
    write(&generate(request, modules)?, out, force)
}

/// Writes what was made into the folder `out`, as [`build`] does.
///
/// # Errors
///
/// A file that hankel did not write is in the way, unless `force`; a file cannot be written.
pub fn write(generated: &Generated, out: &Path, force: bool) -> Result<Report> {
    let folder = Folder::create(out)?;
    refuse_libraries(&folder)?;
    let owned = written_before(&folder)?;
    let change = folder.update(&generated.files, MANIFEST_FILE, owned, force)?;
    Ok(report(&generated.manifest, change))
}

/// Whether `out` is, or can become, a folder: to be asked before much is done for it.
///
/// # Errors
///
/// It is something else, or holds libraries of functions.
pub fn check_output(out: &Path) -> Result<()> {
    Folder::open(out)?.map_or(Ok(()), |folder| refuse_libraries(&folder))
}

/// Libraries are in folders of their own: `check` could not tell what belongs to which build.
fn refuse_libraries(folder: &Folder) -> Result<()> {
    folder.refuse(api::FILE, "libraries of functions")
}

fn report(manifest: &Manifest, change: Change) -> Report {
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
        written: change.written,
        unchanged: change.unchanged,
        removed: change.removed,
        kernels: manifest.kernels.len(),
        unsupported,
    }
}

/// What the manifest in the folder says that its build wrote. Manifests of other versions are
/// understood, too.
fn written_before(folder: &Folder) -> Result<Owned> {
    #[derive(Deserialize)]
    struct Before {
        #[serde(rename = "format")]
        _format: u32,
        #[serde(rename = "made_by")]
        _made_by: serde::de::IgnoredAny,
        files: BTreeMap<String, FileEntry>,
    }
    let mut owned = Owned::new();
    if let Found::File(bytes) = folder.read(MANIFEST_FILE)?
        && let Ok(before) = serde_json::from_slice::<Before>(&bytes)
    {
        owned.insert(MANIFEST_FILE.into(), [sha256(&bytes)].into());
        for (name, entry) in before.files {
            owned.insert(name, [entry.sha256].into());
        }
    }
    Ok(owned)
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
