//! A scene, and how its shadows are to be made: what `render` and `build` are asked alike.

use std::path::{Path, PathBuf};

use hankel_frames::Picture;
use hankel_frames::graph::ImagePasses;
use hankel_frames::plan::Wanted;
use hankel_frames::scene::{Scene, Shadow};
use hankel_system::output::{self, Output};

use crate::args::{Backend, Maps};
use crate::commands::plan::{of_maps, of_scene, technique};
use crate::failure::{Failure, Result};
use crate::print::{self, say};

/// The technique that a plan chooses.
pub const AUTO: &str = "auto";

/// How shadows are to be made.
pub struct Asked<'a> {
    /// A technique's name, or [`AUTO`]; the scene's own without it.
    pub technique: Option<&'a str>,
    /// The greatest error of a plan.
    pub error: Option<f64>,
    /// What a plan chooses from.
    pub maps: &'a Maps,
    /// Where the frame will run.
    pub backend: Backend,
    /// How its image passes run.
    pub image_passes: ImagePasses,
}

impl Asked<'_> {
    /// Reads a scene, with the technique that was asked for by name.
    pub fn read(&self, file: &Path) -> Result<Scene> {
        let mut scene = Scene {
            image_passes: self.image_passes,
            ..Scene::read(file)?
        };
        let is_planned = self.technique == Some(AUTO);
        if let Some(name) = self.technique.filter(|_| !is_planned) {
            scene.shadow = with_technique(scene.shadow, name)?;
        }
        if is_planned != self.error.is_some() || (!self.maps.is_empty() && !is_planned) {
            return Err(Failure::input(
                "--technique auto needs --error, and --error, --size, --filter, --fit and --multisampling need --technique auto",
                "Write --technique auto --error 0.05, or a technique's name: then the scene file says the rest.",
            ));
        }
        Ok(scene)
    }

    /// The scene with the plan's shadows, if a plan was asked for, which is printed unless `quiet`.
    /// `None` if there is none; why has been told.
    pub fn planned(&self, scene: Scene, quiet: bool) -> Result<Option<Scene>> {
        let Some(error) = self.error else {
            return Ok(Some(scene));
        };
        let wanted = Wanted {
            error,
            seconds: None,
            bytes: None,
        };
        let (mesh, choices) = (scene.mesh()?, of_maps(self.maps));
        match of_scene(&scene, &mesh, &choices, wanted, self.backend, quiet)? {
            Ok(plan) => {
                if !quiet {
                    say!("{plan}");
                }
                Ok(Some(plan.scene))
            }
            Err(none) => {
                print::note(format_args!("{none}"));
                Ok(None)
            }
        }
    }
}

/// A scene's shadows by a technique; biases that the scene gives are for its own.
pub fn with_technique(shadow: Shadow, name: &str) -> Result<Shadow> {
    let technique = technique(name)?;
    Ok(shadow.by_technique(technique))
}

/// The files that a scene is read from.
pub fn files(file: &Path, scene: &Scene) -> Vec<PathBuf> {
    let mut files = vec![file.to_path_buf()];
    files.extend(scene.files());
    files
}

/// Places for pictures, none of which is one of the `inputs`.
pub fn places(pictures: &[PathBuf], inputs: &[PathBuf]) -> Result<Vec<Output>> {
    fn paths(all: &[PathBuf]) -> Vec<&Path> {
        all.iter().map(PathBuf::as_path).collect()
    }
    let outputs = output::create_all(&paths(pictures), &paths(inputs))?;
    pictures.iter().try_for_each(|it| check_name(it))?;
    Ok(outputs)
}

/// Writes pictures to the places made for them.
pub fn save<const N: usize>(pictures: [&Picture; N], outputs: Vec<Output>) -> Result<()> {
    for (picture, output) in pictures.into_iter().zip(outputs) {
        picture.save(output)?;
    }
    Ok(())
}

/// Whether a file is to hold linear light.
pub fn is_exr(out: &Path) -> bool {
    out.extension()
        .is_some_and(|extension| extension.eq_ignore_ascii_case("exr"))
}

/// Refuses the name of a picture that would be a PNG file with another extension. A name without one may be a
/// device's.
fn check_name(out: &Path) -> Result<()> {
    let extension = out.extension().unwrap_or_default().to_string_lossy();
    if matches!(extension.to_ascii_lowercase().as_str(), "png" | "exr" | "") {
        return Ok(());
    }
    Err(Failure::input(
        format!(
            "{}: `.{extension}` is not a supported picture format",
            out.display()
        ),
        "Name a file .png, or .exr for linear light in floats.",
    ))
}

/// `scan.png` and `vulkan` to `scan-vulkan.png`.
pub fn beside(out: &Path, what: &str) -> PathBuf {
    let mut name = out.file_stem().unwrap_or_default().to_os_string();
    name.push("-");
    name.push(what);
    if let Some(extension) = out.extension() {
        name.push(".");
        name.push(extension);
    }
    out.with_file_name(name)
}
