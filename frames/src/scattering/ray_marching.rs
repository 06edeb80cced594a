//! Ray marching: along each pixel's ray, places are lit or not by the nearest depth of the shadow map.

use super::Scattering;
use crate::graph::{Graph, Handle, Result};
use crate::passes::{Given, Volume, light_depth, scatter};

pub const TECHNIQUE: Scattering = Scattering {
    name: "ray-marching",
    summary: "steps along each ray, each with a lookup in the shadow map",
    has_steps: true,
    add,
};

fn add(graph: &mut Graph, given: &Given, volume: &Volume, picture: Handle) -> Result<Handle> {
    let depth = light_depth(graph, given)?;
    scatter(graph, given, volume, picture, "scatter_march", |pass| {
        pass.arg("depth", depth)
            .note(format!("{} steps", volume.steps))
    })
}
