//! The techniques: each one a file that adds its passes to a graph, and a line in [`ALL`]. Nothing
//! else knows their names.

mod convolution;
mod esm;
mod evsm;
mod hamburger;
mod hamburger_6;
mod hausdorff;
mod moments;
mod pcf;
mod pcf_gaussian;
mod pcss;
mod soft;
mod tiles;
mod trigonometric;
mod vsm;
mod vssm;

use std::fmt;

use hankel_dsl::native::describe::TexelFormat;

use crate::graph::{Graph, Handle, Result};
use crate::passes::Given;
use crate::scene::{DepthRange, Light, LightView};

/// A way to turn depths into shadows.
pub struct Technique {
    /// Its name in scene files.
    pub name: &'static str,
    /// What it is, in a few words.
    pub summary: &'static str,
    /// What is taken off a receiver's depth unless the scene says otherwise.
    pub depth_bias: DepthBias,
    /// How its map may be stored: at least one, the first unless the scene says otherwise.
    pub maps: &'static [Map],
    /// Whether its shadow is never darker than [`crate::truth::filtered`], but for rounding.
    pub is_lower_bound: bool,
    /// Whether its penumbrae are those of a light with an area. It has no filter of a fixed width then,
    /// and of a light that is a point nothing to gain.
    pub is_soft: bool,
    /// Adds its passes; gives the picture.
    pub add: fn(&mut Graph, &Given) -> Result<Handle>,
}

/// What is taken off a receiver's depth before it is compared, so that a surface does not shade itself.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum DepthBias {
    /// A share of the map's whole depth, 0 to 0.1.
    Share(f32),
    /// What a surface of this slope, depth over width, rises over the filter's radius and one texel more: as far as the
    /// depths are that a receiver is compared with. Of a spot light's map, the texels are those at its far end.
    Slope(f32),
}

impl DepthBias {
    /// None.
    pub const NONE: Self = Self::Share(0.0);
    /// That of percentage-closer filtering, measured on the scenes of `scenes/`: see docs/frames.md.
    pub const COMPARED: Self = Self::Slope(1.0);

    /// As a share of the whole depth of a map, for a filter that reaches so many texels to each side; at most
    /// [`DepthBias::MOST`].
    #[must_use]
    pub fn share(self, view: &LightView, radius: u32) -> f32 {
        match self {
            Self::Share(share) => share,
            Self::Slope(slope) => {
                let [x, y] = view.texel;
                let reach = x.max(y) * (radius + 1) as f32;
                (slope * reach / view.depth).min(Self::MOST)
            }
        }
    }

    /// The greatest share.
    pub const MOST: f32 = 0.1;
}

/// A way to store what a technique filters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Map {
    /// What its texels are; scene files name it.
    pub format: TexelFormat,
    /// The interval that depths are mapped to.
    pub depth_range: DepthRange,
    /// How kernels of the technique call it: a value of a constant of theirs, for example.
    pub encoding: u32,
    /// Against what rounding does to moments, unless the scene says otherwise. In most techniques how
    /// far they are pulled towards those of a harmless distribution, from 0 to 1; with mean and
    /// variance alone, the least variance; where depths are warped, the least variance relative to
    /// the square of the receiver's warped depth.
    pub moment_bias: f32,
    /// Moments of that distribution, if there are four and the technique takes them from the light.
    pub bias_target: [f32; 4],
}

/// All of them.
pub const ALL: [&Technique; 26] = [
    &hamburger::TECHNIQUE,
    &hausdorff::TECHNIQUE,
    &hamburger_6::TECHNIQUE,
    &moments::FOUR,
    &moments::FOUR_COMPENSATED,
    &moments::SIX,
    &moments::SIX_COMPENSATED,
    &moments::EIGHT,
    &moments::EIGHT_COMPENSATED,
    &moments::TEN,
    &moments::TEN_COMPENSATED,
    &trigonometric::TECHNIQUE,
    &vsm::TECHNIQUE,
    &esm::TECHNIQUE,
    &evsm::POSITIVE,
    &evsm::BOTH,
    &convolution::FOUR,
    &convolution::EIGHT,
    &pcf::TECHNIQUE,
    &pcf_gaussian::TECHNIQUE,
    &pcss::TECHNIQUE,
    &vssm::TECHNIQUE,
    &soft::FOUR,
    &soft::SIX,
    &tiles::HAMBURGER,
    &tiles::PCF_GAUSSIAN,
];

impl Technique {
    /// The technique of a name.
    #[must_use]
    pub fn named(name: &str) -> Option<&'static Self> {
        ALL.into_iter().find(|t| t.name == name)
    }

    /// Why it is not for these lights, and what to do; `None` if it is.
    #[must_use]
    pub fn not_for(&self, lights: &[Light]) -> Option<&'static str> {
        let has_area = lights.iter().any(|light| light.area.radius > 0.0);
        let why = "it is for lights with an area, and none has one here: give a light a `radius` \
                   above 0, or choose another technique";
        (self.is_soft && !has_area).then_some(why)
    }
}

impl PartialEq for Technique {
    fn eq(&self, other: &Self) -> bool {
        self.name == other.name
    }
}

impl fmt::Debug for Technique {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name)
    }
}
