//! The pictures of two builds: a scene rendered with the SPIR-V of either.

use std::collections::BTreeSet;
use std::fmt;
use std::path::{Path, PathBuf};

use hankel_codegen::Language;
use hankel_codegen::diff::{bound_otherwise, shaders};
use hankel_codegen::manifest::Manifest;
use hankel_codegen::translate::Options;
use hankel_frames::scene::Scene;
use hankel_frames::{AMPLIFICATION, Difference, FrameError, export, render};
use hankel_host::device::Backend;
use serde::Serialize;

use super::module;
use crate::args::{Diff, Format};
use crate::commands::scene::{self, beside, files, is_exr, save};
use crate::failure::{Failure, Result};
use crate::progress::Progress;
use crate::session::{Session, Words};

/// A scene by the shaders of either build.
#[derive(Serialize)]
pub struct Pictures {
    /// By the new shaders, by the old ones, and their difference.
    #[serde(serialize_with = "crate::print::paths")]
    files: Vec<PathBuf>,
    /// The kernels of the scene's frame that the folders have.
    kernels: BTreeSet<String>,
    difference: Difference,
}

impl fmt::Display for Pictures {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let kernels: Vec<&str> = self.kernels.iter().map(String::as_str).collect();
        writeln!(
            f,
            "pictures with {}: {}",
            kernels.join(", "),
            self.difference
        )?;
        let files: Vec<String> = self
            .files
            .iter()
            .map(|it| it.display().to_string())
            .collect();
        f.write_str(&files.join("\n"))
    }
}

/// Refuses to write into a folder that is compared.
fn refuse_within(out: &Path, folder: &Path) -> Result<()> {
    let whole = |path: &Path| std::path::absolute(path).and_then(|path| path.canonicalize());
    let parent = match out.parent() {
        Some(parent) if parent != Path::new("") => parent,
        _ => Path::new("."),
    };
    match (whole(parent), whole(folder)) {
        (Ok(parent), Ok(folder)) if parent.starts_with(&folder) => Err(Failure::input(
            format!(
                "{} lies in {}, which is compared",
                out.display(),
                folder.display()
            ),
            "Name a file elsewhere.",
        )),
        _ => Ok(()),
    }
}

/// Renders `args.scene`, if there is one, and writes the pictures.
pub fn pictures(args: &Diff, quiet: bool) -> Result<Option<Pictures>> {
    let (Some(file), Some(out)) = (&args.scene, &args.out) else {
        return Ok(None);
    };
    if is_exr(out) {
        return Err(Failure::input(
            format!("{}: pictures are compared as PNG files", out.display()),
            "Name a file .png.",
        ));
    }
    let scene = Scene::read(file)?;
    let places = vec![out.clone(), beside(out, "old"), beside(out, "difference")];
    for folder in [&args.old, &args.new] {
        refuse_within(out, folder)?;
    }
    // Whether they can be written shows before the long work starts.
    let outputs = scene::places(&places, &files(file, &scene))?;
    let session = Session::linked(quiet);
    let own = own(&session, &scene)?;
    let all = session.all_words()?;
    let with = |folder: &Path| -> Result<(Words, BTreeSet<String>)> {
        let kernels = usable(folder, &own)?;
        let mut words = all.clone();
        for kernel in &kernels {
            words.insert(kernel.clone(), module(folder, kernel)?);
        }
        Ok((words, kernels))
    };
    let (old, mut kernels) = with(&args.old)?;
    let (new, others) = with(&args.new)?;
    kernels.extend(others);
    if kernels.is_empty() {
        return Err(Failure::input(
            format!(
                "{} and {} have no kernel of the frame of {}",
                args.old.display(),
                args.new.display(),
                file.display()
            ),
            "Build one of these: its passes call ".to_owned()
                + &own.kernels.keys().cloned().collect::<Vec<_>>().join(", ")
                + ".",
        ));
    }
    let mut progress = Progress::new(quiet || args.format == Format::Json);
    let mut picture = |words| render(&scene, Backend::Vulkan, words, &mut progress);
    let (old, new) = (picture(&old)?.picture, picture(&new)?.picture);
    let difference = old.difference(&new, AMPLIFICATION)?;
    save([&new, &old, &difference.picture], outputs)?;
    Ok(Some(Pictures {
        files: places,
        kernels,
        difference,
    }))
}

/// What this program binds: the kernels of the scene's frame.
fn own(session: &Session, scene: &Scene) -> Result<Manifest> {
    let draft = export(scene, "", &scene.mesh()?).map_err(FrameError::from)?;
    let names: BTreeSet<String> = draft.shaders.into_values().map(|it| it.kernel).collect();
    let request = session.request_for(
        names.into_iter().collect(),
        vec![Language::Spirv],
        Options::default(),
    );
    Ok(session.generate(&request)?.manifest)
}

/// Those kernels of `own` that the folder has. Each must be bound as this program binds it.
fn usable(folder: &Path, own: &Manifest) -> Result<BTreeSet<String>> {
    let manifest = shaders(folder)?;
    let mut usable = BTreeSet::new();
    for (name, entry) in &own.kernels {
        let Some(theirs) = manifest.kernels.get(name) else {
            continue;
        };
        if !theirs.languages.contains_key(&Language::Spirv) {
            continue;
        }
        if let Some(change) = bound_otherwise(theirs, entry) {
            return Err(Failure::input(
                format!(
                    "{}: kernel `{name}` is not bound as this hankel binds it: {change}",
                    folder.display()
                ),
                "Build the folder again with kernels that have today's interface.",
            ));
        }
        usable.insert(name.clone());
    }
    Ok(usable)
}
