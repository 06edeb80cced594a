//! Techniques of single scattering: each one a file that adds its passes to a graph, after those of the surfaces,
//! and a line in [`ALL`]. Nothing else knows their names. A scene without a medium has none of their passes.

mod prefiltered;
mod ray_marching;

use std::fmt;

use crate::graph::{Graph, Handle, Result};
use crate::passes::{Given, Volume};

/// A way to compute what a medium scatters.
pub struct Scattering {
    /// Its name in scene files.
    pub name: &'static str,
    /// What it is, in a few words.
    pub summary: &'static str,
    /// Whether it looks at so many places along each ray as the scene says.
    pub has_steps: bool,
    /// What is to be used in its place with spot lights, and why; `None` if it is for them.
    pub not_for_spots: Option<&'static str>,
    /// Adds its passes: what the camera sees of a picture of surfaces through the medium.
    pub add: fn(&mut Graph, &Given, &Volume, Handle) -> Result<Handle>,
}

/// All of them.
pub const ALL: [&Scattering; 3] = [
    &prefiltered::FOUR,
    &prefiltered::SIX,
    &ray_marching::TECHNIQUE,
];

impl Scattering {
    /// The technique of a name.
    #[must_use]
    pub fn named(name: &str) -> Option<&'static Self> {
        ALL.into_iter().find(|t| t.name == name)
    }
}

impl PartialEq for Scattering {
    fn eq(&self, other: &Self) -> bool {
        self.name == other.name
    }
}

impl fmt::Debug for Scattering {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name)
    }
}
