//! What is seen through each sample: triangles are rasterised where the device can, and rays are
//! cast where it cannot. Nothing else of a frame knows which.

pub mod cast;
pub(crate) mod fragments;
mod raster;
mod rays;

use hankel_dsl::native::Entry;
use hankel_host::device::{
    Backend, Bind, Blend, BufferId, Cull, DepthTest, Device, Program, TextureId, TextureShape,
    Topology,
};

use crate::error::Result;
use raster::Raster;
use rays::Rays;

/// Samples of a pixel or texel.
pub const SAMPLES: u32 = cast::SAMPLES.len() as u32;

/// The depth where nothing is.
pub(crate) const FAR: f32 = 1.0;
/// Which depths are seen.
pub(crate) const SEEN: DepthTest = DepthTest::Less;
/// What indices make.
pub(crate) const TOPOLOGY: Topology = Topology::Triangles;
/// Both faces are seen.
pub(crate) const CULL: Cull = Cull::None;

/// A buffer, and a number that is another whenever its content is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Source {
    pub buffer: BufferId,
    pub stamp: u64,
}

/// A stage of a draw: its kernel's code and arguments, in the order of
/// [`hankel_host::device::slots::drawn_slots`].
pub(crate) struct Stage<'a> {
    pub entry: &'a Entry,
    pub program: Program<'a>,
    pub args: Vec<Bind<'a>>,
}

/// What is drawn into.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Onto {
    Depth(TextureId),
    Colour {
        texture: TextureId,
        /// Of each pixel that is drawn; if there are more than in the texture, that gets their mean.
        samples: u32,
        background: [f64; 4],
        blend: Blend,
        before: Option<TextureId>,
    },
}

/// A draw, with everything on the device.
pub(crate) struct Draw<'a> {
    /// The pass's number, by which things are kept from run to run.
    pub pass: usize,
    pub label: &'a str,
    pub positions: Source,
    pub indices: Source,
    /// Number of indices.
    pub count: u32,
    pub clip_from_world: Source,
    pub vertex: Stage<'a>,
    pub fragment: Option<Stage<'a>>,
    pub onto: Onto,
    pub shape: TextureShape,
}

/// A triangle over all pixels of its targets, with everything on the device.
pub(crate) struct FullScreen<'a> {
    pub label: &'a str,
    pub vertex: Stage<'a>,
    pub fragment: Stage<'a>,
    pub targets: Vec<TextureId>,
}

/// One of the two.
pub(crate) enum Visibility {
    Raster(Raster),
    Rays(Rays),
}

impl Visibility {
    /// What a device can do.
    pub fn of(backend: Backend) -> Self {
        match backend {
            Backend::Vulkan => Self::Raster(Raster::default()),
            Backend::Native => Self::Rays(Rays::default()),
        }
    }

    /// Draws; `advance` is told the share that is done. Where it was counted, gives the share of
    /// the pixels whose samples see different triangles.
    pub fn draw(
        &mut self,
        device: &mut dyn Device,
        draw: &Draw<'_>,
        advance: &mut dyn FnMut(f32),
    ) -> Result<Option<f64>> {
        match self {
            Self::Raster(raster) => raster.draw(device, draw).map(|()| None),
            Self::Rays(rays) => rays.draw(device, draw, advance),
        }
    }

    /// Runs a fragment kernel for each pixel of its targets.
    pub fn cover(&self, device: &mut dyn Device, drawn: &FullScreen<'_>) -> Result<()> {
        match self {
            Self::Raster(_) => raster::cover(device, drawn),
            Self::Rays(_) => rays::cover(device, drawn),
        }
    }

    /// Bytes on the device that it keeps for itself.
    pub const fn bytes(&self) -> usize {
        match self {
            Self::Raster(raster) => raster.bytes,
            Self::Rays(rays) => rays.bytes,
        }
    }

    /// Gives them back.
    pub fn free(&mut self, device: &mut dyn Device) {
        match self {
            Self::Raster(raster) => raster.free(device),
            Self::Rays(rays) => rays.free(device),
        }
    }
}
