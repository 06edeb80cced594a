//! What there is to see and how: scene files.
//!
//! A scene file is TOML. Only geometry, camera and light must be given:
//!
//! ```toml
//! [geometry]
//! model = "../models/brain.glb"   # beside the scene file; or: procedural = "yard"
//! ground = 4.0                    # a square under the model, in model widths; 0: none, default
//! opacity = 0.4                   # of the model, not of its ground: the share of light that does not pass; 1, default
//!
//! [camera]
//! eye = [0.2, 0.25, 0.3]
//! target = [0.0, 0.07, 0.0]
//! up = [0.0, 1.0, 0.0]            # default
//! fov = 40.0                      # vertical, degrees, default
//!
//! [light]
//! direction = [-0.5, -0.8, -0.3]  # the way the light goes
//! strength = 1.0                  # default; irradiance of what faces the light, times 1.15
//! colour = [1.0, 1.0, 1.0]        # default; linear, 0 to 1
//! radius = 0.02                   # of the light, as seen: the tangent of the angle; 0: a point, default
//! shape = "disc"                  # default; or "square"
//!
//! # A spot light: [light] with these; `strength` is that at a distance of 1.
//! # position = [0.0, 3.0, 0.0]
//! # direction = [0.0, -1.0, 0.0]
//! # angle = 60.0                  # default; of its cone, from edge to edge, degrees
//! # inner = 48.0                  # of what does not fade; 0.8 of the angle, default
//! # radius = 0.1                  # a length: half the width of what shines, across the axis; 0: a point, default
//!
//! # Several lights: [[light]] for each.
//!
//! [shadow]
//! technique = "hamburger"         # default; or another technique of docs/frames.md
//! size = 1024                     # default; texels along an edge of the map
//! multisampling = 4               # default; samples of depth in each texel; or 1
//! format = "rgba16unorm"          # one of those that the technique has; default: its first
//! depth_range = "symmetric"       # [-1, 1]; or "unit", [0, 1]; default: that of the technique's first map in the format
//! filter = 7                      # default; Gaussian, taps along an axis, odd; 1: none
//! fit = "scene"                   # default: the map holds all; or "camera": what the camera sees
//! samples = [32, 32]              # default; of `pcss`: depths for the search of blockers, and for the filter
//! moment_bias = 6e-5              # without unit; each map has its default
//! depth_bias = 0.0                # a share of the map's depth, 0 to 0.1; each technique has its default
//! leak_cut = 0.02                 # default; a shadow of 1 minus this is full, and lighter ones are darkened in proportion
//! mips = false                    # default; whether the filtered map has mip levels
//! # anisotropy = 1                # default; only with mip levels: the longest footprint of a pixel, in its widths
//!
//! [medium]                        # a homogeneous medium all around; without it: none
//! extinction = 0.1                # share of light lost per unit of length; has to be given
//! scattering = 0.1                # what of it is scattered, the rest is absorbed; all of it, default
//! anisotropy = 0.0                # default; mean cosine of the angle of scattering; 0: to all sides alike
//! technique = "prefiltered"       # or "prefiltered-6", "ray-marching"; default: the first for all of the lights
//! steps = 64                      # default; along a ray, where one is marched along
//!
//! [output]
//! width = 960                     # default
//! height = 540                    # default
//! ```
//!
//! Everything is checked when the file is read; an error names file, line, column, the field and
//! what it may be. The frame does not fail on a scene that was read.

mod error;
mod light;
mod mesh;
mod model;
mod procedural;
mod text;
mod view;

use std::path::{Path, PathBuf};

use hankel_dsl::glam::Vec3;
use hankel_shadows::soft::MOST_POINTS;
use hankel_system::input;
use serde::Deserialize;

use crate::graph::ImagePasses;
use crate::scattering::{self, Scattering};
use crate::techniques::{self, DepthBias, Map, Technique};
use crate::visibility::SAMPLES;

pub use error::{Place, Result, SceneError};
pub use light::{Area, AreaShape, Light, Source, Spot};
pub use mesh::{Bounds, Mesh};
pub use model::{MAX_TRIANGLES, MAX_VERTICES};
pub use procedural::Procedural;
pub use view::{CameraView, LightView};

/// Coordinates beyond this lose the precision that depths need.
const FAR_OFF: f32 = 1e6;

/// A scene whose values are all in range.
#[derive(Clone, Debug, PartialEq)]
pub struct Scene {
    /// What there is.
    pub geometry: Geometry,
    /// Who looks.
    pub camera: Camera,
    /// What shines: one light to [`Scene::MAX_LIGHTS`].
    pub lights: Vec<Light>,
    /// What fills the space between surfaces, if anything does.
    pub medium: Option<Medium>,
    /// How shadows are made.
    pub shadow: Shadow,
    /// The picture's width in pixels, 1 to [`Scene::MAX_OUTPUT`].
    pub width: u32,
    /// The picture's height in pixels, 1 to [`Scene::MAX_OUTPUT`].
    pub height: u32,
    /// How its image passes run, which changes no picture. Scene files do not say it.
    pub image_passes: ImagePasses,
}

/// Where triangles come from.
#[derive(Clone, Debug, PartialEq)]
pub enum Geometry {
    /// A glTF file.
    Model {
        /// The file; a relative path in a scene file counts from that file's folder.
        file: PathBuf,
        /// Edge of a square of ground under the model, in units of the model's larger horizontal
        /// extent; 0 for none.
        ground: f32,
        /// Share of light that the model does not let pass, 0 to 1; below 1 only with ground, which is opaque. What its
        /// materials say themselves is multiplied by this.
        opacity: f32,
    },
    /// A built-in scene.
    Procedural(Procedural),
}

/// A pinhole camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// Where it is.
    pub eye: Vec3,
    /// What it looks at; not `eye`.
    pub target: Vec3,
    /// What is up in the picture; not along the view.
    pub up: Vec3,
    /// Vertical field of view in degrees, 1 to 170.
    pub fov: f32,
}

/// A homogeneous medium that a light shines through. It ends with what the camera sees, or at the far plane of
/// its view.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Medium {
    /// Share of light that is lost per unit of length, for short ways: 1e-6 to 1e6.
    pub extinction: f32,
    /// What of it is scattered and not absorbed: 0 to `extinction`.
    pub scattering: f32,
    /// The mean cosine of the angle of scattering, -0.9 (backward) to 0.9 (forward): the parameter of Henyey and
    /// Greenstein's phase function.
    pub anisotropy: f32,
    /// How its light is computed.
    pub technique: &'static Scattering,
    /// Steps along each ray, where the technique marches along rays: 1 to [`Scene::MAX_STEPS`].
    pub steps: u32,
}

impl Default for Medium {
    fn default() -> Self {
        Self {
            extinction: 0.1,
            scattering: 0.1,
            anisotropy: 0.0,
            technique: scattering::ALL[0],
            steps: 64,
        }
    }
}

/// The interval that depths are mapped to before moments are taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum DepthRange {
    /// `[0, 1]`.
    Unit,
    /// `[-1, 1]`.
    Symmetric,
}

impl DepthRange {
    /// As scene files name it.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Unit => "unit",
            Self::Symmetric => "symmetric",
        }
    }
}

/// What the shadow map holds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Fit {
    /// All of the scene: the map stays as it is when the camera moves.
    #[default]
    Scene,
    /// What the camera sees, and what may cast shadows on it: smaller texels, other ones whenever the
    /// camera moves.
    Camera,
}

impl Fit {
    /// As scene files name it.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Scene => "scene",
            Self::Camera => "camera",
        }
    }
}

/// How shadows are made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shadow {
    /// From depths to shadow.
    pub technique: &'static Technique,
    /// Texels along an edge of the map, 16 to [`Scene::MAX_MAP`].
    pub size: u32,
    /// Samples of depth in each texel, of which the map is made: [`SAMPLES`] or 1. Where rays through a medium are
    /// marched along, the camera's depth has as many.
    pub multisampling: u32,
    /// How its map is stored, one of the technique's.
    pub map: Map,
    /// Taps of the Gaussian along an axis: odd, 1 (no filter) to [`Scene::MAX_FILTER`].
    pub filter: u32,
    /// What the map holds.
    pub fit: Fit,
    /// Depths that a soft shadow looks at in its search of blockers, and in its filter, where it looks at
    /// single ones: 1 to [`Scene::MAX_SAMPLES`] each.
    pub samples: [u32; 2],
    /// What is done so that rounding cannot make moments impossible, 0 to 0.1: how far they are pulled
    /// towards those of a harmless distribution, or what [`Map::moment_bias`] says of the technique.
    pub moment_bias: f32,
    /// Subtracted from the receiver's depth. Scene files say it as a share of the map's whole depth, 0 to 0.1.
    pub depth_bias: DepthBias,
    /// A shadow of 1 minus this is full, and lighter ones are darkened in proportion: 0 to 0.9, of which what is beyond
    /// 0.5 counts as 0.5.
    pub leak_cut: f32,
    /// Whether the filtered map has mip levels, from which a pixel takes the mean over all that it sees of the map.
    /// Techniques without a map that is interpolated have none.
    pub mips: bool,
    /// With mip levels, how many times as long as wide what a pixel sees of the map is at most, 1 to
    /// [`Scene::MAX_ANISOTROPY`]: longer ones are taken for wider ones, and 1 is trilinear lookup.
    pub anisotropy: u32,
}

impl Default for Shadow {
    fn default() -> Self {
        Self::of(techniques::ALL[0], techniques::ALL[0].maps[0])
    }
}

impl Shadow {
    /// What a technique does unless the scene says otherwise, with one of its maps.
    #[must_use]
    pub const fn of(technique: &'static Technique, map: Map) -> Self {
        Self {
            technique,
            size: 1024,
            multisampling: SAMPLES,
            map,
            filter: 7,
            fit: Fit::Scene,
            samples: [32, 32],
            moment_bias: map.moment_bias,
            depth_bias: technique.depth_bias,
            leak_cut: 0.02,
            mips: false,
            anisotropy: 1,
        }
    }

    /// These shadows by a technique. Biases are for one technique, and that of moments for one of its maps: with others,
    /// they are as those have them. All else stays.
    #[must_use]
    pub fn by(self, technique: &'static Technique, map: Map) -> Self {
        let is_own = technique == self.technique;
        let is_own_map = is_own && map == self.map;
        Self {
            technique,
            map,
            moment_bias: match is_own_map {
                true => self.moment_bias,
                false => map.moment_bias,
            },
            depth_bias: match is_own {
                true => self.depth_bias,
                false => technique.depth_bias,
            },
            ..self
        }
    }

    /// These shadows by a technique: as they are if it is their own, else with its first map.
    #[must_use]
    pub fn by_technique(self, technique: &'static Technique) -> Self {
        match technique == self.technique {
            true => self,
            false => self.by(technique, technique.maps[0]),
        }
    }

    /// Texels that the filter reaches to each side; a soft shadow's has no fixed width.
    #[must_use]
    pub const fn radius(&self) -> u32 {
        match self.technique.is_soft {
            true => 0,
            false => self.filter / 2,
        }
    }
}

impl Scene {
    /// Most lights.
    pub const MAX_LIGHTS: usize = 16;
    /// Most bytes of a scene file.
    pub const MAX_BYTES: u64 = 1 << 20;
    /// Most pixels along an edge of the picture.
    pub const MAX_OUTPUT: u32 = 4096;
    /// Most texels along an edge of the map.
    pub const MAX_MAP: u32 = 4096;
    /// Most taps of the filter along an axis.
    pub const MAX_FILTER: u32 = 31;
    /// The most anisotropy of a lookup in mip levels.
    pub const MAX_ANISOTROPY: u32 = 16;
    /// Most samples of a soft shadow's search and filter, each.
    pub const MAX_SAMPLES: u32 = MOST_POINTS as u32;
    /// Most steps along a ray through a medium.
    pub const MAX_STEPS: u32 = 4096;
    /// Width and height of a picture unless given.
    pub const DEFAULT_OUTPUT: [u32; 2] = [960, 540];

    /// Reads a scene file.
    ///
    /// # Errors
    /// [`SceneError::Read`], [`SceneError::Syntax`], [`SceneError::Value`]. The model is not read
    /// yet.
    pub fn read(file: &Path) -> Result<Self> {
        Self::parse(&input::read_text(file, Self::MAX_BYTES)?, file)
    }

    /// Reads a scene from text; `file` is for messages and where relative paths count from.
    ///
    /// # Errors
    /// As for [`Scene::read`].
    pub fn parse(text: &str, file: &Path) -> Result<Self> {
        text::parse(text, file)
    }

    /// The files that its geometry is read from, those of a model's buffers among them.
    #[must_use]
    pub fn files(&self) -> Vec<PathBuf> {
        match &self.geometry {
            Geometry::Model { file, .. } => model::files(file),
            Geometry::Procedural(_) => Vec::new(),
        }
    }

    /// Loads or makes the scene's triangles; at least one, none without area.
    ///
    /// # Errors
    /// [`SceneError::Read`], [`SceneError::Model`], also of a model without anything opaque and without ground;
    /// [`SceneError::Empty`].
    pub fn mesh(&self) -> Result<Mesh> {
        match &self.geometry {
            Geometry::Procedural(p) => Ok(p.mesh()),
            Geometry::Model {
                file,
                ground,
                opacity,
            } => {
                let mut mesh = model::load(file)?;
                if *opacity < 1.0 {
                    let all = mesh.all_opacities().into_iter();
                    mesh.opacities = all.map(|own| own * opacity).collect();
                }
                if *ground == 0.0 && mesh.opaque().is_empty() {
                    return Err(SceneError::Model {
                        file: file.clone(),
                        problem: "all of its materials blend (alphaMode BLEND), and nothing opaque is there to show \
                                  a shadow: put it on a `ground`"
                            .into(),
                    });
                }
                if let Some(bounds) = mesh.bounds().filter(|_| *ground > 0.0) {
                    let size = bounds.size();
                    let half = size.x.max(size.z).max(size.y * 0.1) * ground * 0.5;
                    let low = bounds.low.y;
                    let c = Vec3::new(bounds.centre().x, low, bounds.centre().z);
                    mesh.quad(
                        [[-half, half], [half, half], [half, -half], [-half, -half]]
                            .map(|[x, z]| c + Vec3::new(x, 0.0, z)),
                    );
                    mesh.paint(Vec3::new(0.42, 0.4, 0.38));
                }
                Ok(mesh)
            }
        }
    }
}
