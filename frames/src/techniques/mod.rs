//! The techniques: each one a file that adds its passes to a graph, and a line in [`ALL`]. Nothing
//! else knows their names.

mod hamburger;
mod hausdorff;
mod pcf;
mod pcf_gaussian;
mod vsm;

use std::fmt;

use crate::graph::{Graph, Handle, Result};
use crate::passes::Given;

/// A way to turn depths into shadows.
pub struct Technique {
    /// Its name in scene files.
    pub name: &'static str,
    /// What it is, in a few words.
    pub summary: &'static str,
    /// What is taken off a receiver's depth unless the scene says otherwise, in units of the map's
    /// whole depth.
    pub depth_bias: f32,
    /// Whether its shadow is never darker than [`crate::truth::filtered`], but for rounding.
    pub is_lower_bound: bool,
    /// Adds its passes; gives the picture.
    pub add: fn(&mut Graph, &Given) -> Result<Handle>,
}

/// All of them.
pub const ALL: [&Technique; 5] = [
    &hamburger::TECHNIQUE,
    &hausdorff::TECHNIQUE,
    &vsm::TECHNIQUE,
    &pcf::TECHNIQUE,
    &pcf_gaussian::TECHNIQUE,
];

impl Technique {
    /// The technique of a name.
    #[must_use]
    pub fn named(name: &str) -> Option<&'static Self> {
        ALL.into_iter().find(|t| t.name == name)
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
