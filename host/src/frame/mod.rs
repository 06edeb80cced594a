//! From a scene to a picture, on this machine's processor or on Vulkan.
//!
//! The same kernels run on both: depth from the light, moments, filter, shading. What differs is
//! who finds the triangles. Vulkan rasterises with four samples in a pixel; natively a ray is cast
//! through each sample, and the fragment kernel runs over the array of what the rays found.
//!
//! [`Plan`] says which passes a scene needs; [`render`] makes the picture; [`compare`] makes both
//! and tells how they differ. Nothing is approximated on one side only, so pictures differ where a
//! sample lies so near an edge that rounding decides what it sees, and where a sampler rounds.

pub mod cast;
mod error;
mod fragments;
mod picture;
mod plan;
mod run;

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::time::Duration;

use serde::Serialize;

use crate::device::{self, Backend, Device};
use crate::scene::{Mesh, Scene};

pub use error::{FrameError, Result};
pub use picture::{Difference, Picture};
pub use plan::{Omission, Pass, Plan, gaussian};

/// Where the shaders of the built-in kernels come from, by entry-point name. The native device
/// needs none.
pub trait Shaders {
    /// The SPIR-V of a kernel; `None` if there is none.
    fn words(&self, kernel: &str) -> Option<&[u32]>;
}

/// No shaders: enough for [`Backend::Native`].
#[derive(Clone, Copy, Debug, Default)]
pub struct NoShaders;

impl Shaders for NoShaders {
    fn words(&self, _: &str) -> Option<&[u32]> {
        None
    }
}

/// SPIR-V modules by entry-point name.
impl Shaders for BTreeMap<String, Vec<u32>> {
    fn words(&self, kernel: &str) -> Option<&[u32]> {
        self.get(kernel).map(Vec::as_slice)
    }
}

/// Told how far a frame is.
pub trait Progress {
    /// `step` of `steps` begins.
    fn begin(&mut self, name: &str, step: usize, steps: usize);
    /// The share of the current step that is done, 0 to 1. Not every step tells.
    fn advance(&mut self, share: f32);
}

/// Tells nobody.
#[derive(Clone, Copy, Debug, Default)]
pub struct Quiet;

impl Progress for Quiet {
    fn begin(&mut self, _: &str, _: usize, _: usize) {}
    fn advance(&mut self, _: f32) {}
}

/// How long a part of the frame took.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Timing {
    /// Name of the part: `set-up`, a pass's name, or `read back`.
    pub name: Cow<'static, str>,
    /// Wall time, until the device was done, compilation of its shaders included.
    pub seconds: f64,
}

impl Timing {
    fn new(name: &'static str, time: Duration) -> Self {
        Self {
            name: name.into(),
            seconds: time.as_secs_f64(),
        }
    }
}

/// A picture and how it came about. All but the picture can be serialised.
#[derive(Clone, Debug, Serialize)]
pub struct Rendering {
    /// The picture.
    #[serde(skip)]
    pub picture: Picture,
    /// Which device made it.
    pub device: String,
    /// The scene's triangles.
    pub triangles: usize,
    /// Edge of the shadow map's texels in world units, along x and y.
    pub texel: [f32; 2],
    /// Share of the pixels whose samples see different triangles, where that was counted
    /// (natively): where rounding may decide what a sample sees.
    pub edges: Option<f64>,
    /// What was done, and what was not.
    pub plan: Plan,
    /// How long it took, in order.
    pub timings: Vec<Timing>,
}

impl Rendering {
    /// Wall time of all parts.
    #[must_use]
    pub fn seconds(&self) -> f64 {
        self.timings.iter().map(|t| t.seconds).sum()
    }
}

/// Both pictures of a scene.
#[derive(Clone, Debug, Serialize)]
pub struct Comparison {
    /// From this machine's processor.
    pub native: Rendering,
    /// From Vulkan.
    pub vulkan: Rendering,
    /// How they differ.
    pub difference: Difference,
}

/// Share of the pixels where rounding of the sampler's weights, of the target to half precision and
/// of the moments to 16 bits may be seen, away from edges.
const ROUNDED: f64 = 0.01;

impl Comparison {
    /// The share of pixels that may differ by more than 1/255 between the backends.
    ///
    /// A rasteriser puts vertices on a grid of 1/256 pixel, rays do not. So an edge may be half a
    /// step and a rounding away from where the ray sees it, at most 1/256 pixel, and a sample sees
    /// another triangle only if it lies in a strip of that half-width along the edge. A strip
    /// crosses at most sqrt(2) of a pixel; four samples, none likelier than another to lie in it: of
    /// the pixels with an edge, at most 4 * sqrt(2) * 2/256 = 4.4 % have such a sample. The same
    /// happens to texels of the shadow map, where a changed sample is a quarter of one texel and the
    /// filter spreads it: its share of the picture is counted as once more as much.
    #[must_use]
    pub fn limit(&self) -> f64 {
        let edges = self.native.edges.unwrap_or(0.0);
        2.0 * 4.0 * 2.0_f64.sqrt() * 2.0 / 256.0 * edges + ROUNDED
    }
}

/// By how much [`compare`] amplifies the difference picture unless told otherwise.
pub const AMPLIFICATION: u32 = 16;

/// Loads the scene's geometry, opens a device, and renders.
///
/// # Errors
/// See [`FrameError`].
pub fn render(
    scene: &Scene,
    backend: Backend,
    shaders: &dyn Shaders,
    progress: &mut dyn Progress,
) -> Result<Rendering> {
    let mesh = scene.mesh()?;
    let mut device = open(backend)?;
    render_on(&mut *device, scene, &mesh, shaders, progress)
}

/// Renders a scene natively and on Vulkan, and compares the pictures; `amplification` is that of
/// the difference picture.
///
/// # Errors
/// See [`FrameError`].
pub fn compare(
    scene: &Scene,
    shaders: &dyn Shaders,
    amplification: u32,
    progress: &mut dyn Progress,
) -> Result<Comparison> {
    // Whether there is a driver shows before the long work starts.
    let mut vulkan = open(Backend::Vulkan)?;
    let mut native = open(Backend::Native)?;
    let mesh = scene.mesh()?;
    let native = render_on(&mut *native, scene, &mesh, shaders, progress)?;
    let vulkan = render_on(&mut *vulkan, scene, &mesh, shaders, progress)?;
    let difference = native.picture.difference(&vulkan.picture, amplification)?;
    Ok(Comparison {
        native,
        vulkan,
        difference,
    })
}

/// Renders a scene's triangles on a device that is open already.
///
/// # Errors
/// See [`FrameError`].
pub fn render_on(
    device: &mut dyn Device,
    scene: &Scene,
    mesh: &Mesh,
    shaders: &dyn Shaders,
    progress: &mut dyn Progress,
) -> Result<Rendering> {
    run::Frame::new(device, scene, mesh, shaders, progress)?.run()
}

fn open(backend: Backend) -> Result<Box<dyn Device>> {
    device::open(backend).map_err(|source| FrameError::Device {
        during: format!("opening the {backend} device"),
        source,
    })
}
