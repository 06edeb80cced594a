//! Ray marching: along each pixel's ray, places are lit or not by the nearest depth of the shadow map. With a spot
//! light these are places within its cone.

use super::Scattering;
use crate::graph::{Graph, Handle, Result};
use crate::passes::{Given, Volume, by_samples, light_depth, scatter};

pub const TECHNIQUE: Scattering = Scattering {
    name: "ray-marching",
    summary: "steps along each ray, each with a lookup in the shadow map",
    has_steps: true,
    not_for_spots: None,
    add,
};

fn add(graph: &mut Graph, given: &Given, volume: &Volume, picture: Handle) -> Result<Handle> {
    let depth = light_depth(graph, given)?;
    let kernel = by_samples(
        given,
        if given.is_spot {
            "scatter_march_spot"
        } else {
            "scatter_march"
        },
    );
    let samples = given.shadow.multisampling;
    scatter(graph, given, volume, picture, &kernel, samples, |pass| {
        pass.arg("depth", depth)
            .note(format!("{} steps", volume.steps))
    })
}
