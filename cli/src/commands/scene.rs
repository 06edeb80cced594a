//! A scene, and how its shadows are to be made: what `render` and `build` are asked alike.

use std::path::Path;

use hankel_frames::plan::Wanted;
use hankel_frames::scene::{Scene, Shadow};

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
}

impl Asked<'_> {
    /// Reads a scene, with the technique that was asked for by name.
    pub fn read(&self, file: &Path) -> Result<Scene> {
        let mut scene = Scene::read(file)?;
        let is_planned = self.technique == Some(AUTO);
        if let Some(name) = self.technique.filter(|_| !is_planned) {
            scene.shadow = with_technique(scene.shadow, name)?;
        }
        if is_planned != self.error.is_some() || (!self.maps.is_empty() && !is_planned) {
            return Err(Failure::input(
                "--technique auto needs --error, and --error, --size, --filter and --fit need --technique auto",
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

/// A scene's shadows by another technique: what else the scene says of them, biases for example, was for
/// its own.
pub fn with_technique(shadow: Shadow, name: &str) -> Result<Shadow> {
    let technique = technique(name)?;
    Ok(Shadow {
        size: shadow.size,
        filter: shadow.filter,
        fit: shadow.fit,
        mips: shadow.mips,
        anisotropy: shadow.anisotropy,
        ..Shadow::of(technique, technique.maps[0])
    })
}
