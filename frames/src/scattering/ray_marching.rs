//! Ray marching: along each pixel's ray, places are lit or not by the nearest depth of the shadow map. With a spot
//! light these are places within its cone.

use super::Scattering;
use crate::graph::{Graph, Handle, Result};
use crate::passes::{Given, TRANSLUCENT_IN_MEDIUM, Volume, by_samples, opaque_depth, scatter};

pub const TECHNIQUE: Scattering = Scattering {
    name: "ray-marching",
    summary: "steps along each ray, each with a lookup in the shadow map",
    has_steps: true,
    not_for_spots: None,
    add,
};

fn add(graph: &mut Graph, given: &Given, volume: &Volume, picture: Handle) -> Result<Handle> {
    if given.translucent.is_some() {
        graph.omit(
            TRANSLUCENT_IN_MEDIUM,
            "ray marching looks up the nearest depth, and a share of it cannot be told: use prefiltered scattering \
             where all lights are directional",
        );
    }
    let depth = opaque_depth(graph, given)?;
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
