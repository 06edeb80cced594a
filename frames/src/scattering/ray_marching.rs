//! Ray marching: along each pixel's ray, places are lit or not by the nearest depth of the shadow map. With a spot
//! light these are places within its cone.

use super::Scattering;
use crate::graph::{Graph, Handle, Result};
use crate::passes::{Given, Volume, light_depth, scatter};
use crate::scene::Shadow;
use crate::visibility::SAMPLES;

pub const TECHNIQUE: Scattering = Scattering {
    name: "ray-marching",
    summary: "steps along each ray, each with a lookup in the shadow map",
    has_steps: true,
    not_for_spots: None,
    add,
};

fn add(graph: &mut Graph, given: &Given, volume: &Volume, picture: Handle) -> Result<Handle> {
    // The kernel looks at the first of several samples, whatever a map is made of.
    let several = Given {
        shadow: Shadow {
            multisampling: SAMPLES,
            ..given.shadow
        },
        ..*given
    };
    let depth = light_depth(graph, &several)?;
    let kernel = if given.is_spot {
        "scatter_march_spot"
    } else {
        "scatter_march"
    };
    scatter(graph, given, volume, picture, kernel, |pass| {
        pass.arg("depth", depth)
            .note(format!("{} steps", volume.steps))
    })
}
