//! Percentage-closer filtering: the share of a square of the map's depths that are nearer than the
//! receiver. Translucent casters are kept in a share of the depths, by a hash of where they are, so that the
//! noise is the same in each frame (stochastic transparency: Enderton, Sintorn, Shirley, Luebke, 2010).

use hankel_dsl::glam::UVec2;
use hankel_dsl::native::describe::TexelFormat;
use hankel_host::device::Blend;

use super::{DepthBias, Technique};
use crate::graph::{Graph, Handle, Result};
use crate::passes::{
    DEPTHS, Given, by_samples, draw_translucent, opaque_depth, samples_of_map, shade,
};

pub const TECHNIQUE: Technique = Technique {
    name: "pcf",
    summary: "percentage-closer filtering of the depths themselves",
    // The comparison has no slack, and a slope would be shaded by its own texels.
    depth_bias: DepthBias::COMPARED,
    maps: DEPTHS,
    is_lower_bound: false,
    is_soft: false,
    add,
};

fn add(graph: &mut Graph, given: &Given) -> Result<Handle> {
    graph.omit(
        "moments",
        "percentage-closer filtering compares the depths themselves",
    );
    graph.omit("blur", "depths cannot be filtered before the comparison");
    let depth = opaque_depth(graph, given)?;
    let Some(translucent) = given.translucent else {
        return shade(graph, given, by_samples(given, "shade_pcf"), |pass| {
            pass.arg("depth", depth)
        });
    };
    let texels = graph.constant("size", &UVec2::splat(given.shadow.size));
    let label = "keep by chance";
    let kept = draw_translucent(graph, given, &translucent, label, given.light_view)
        .fragment("stochastic_depths")
        .arg("size", texels)
        .blend(Blend::Least);
    let kept = samples_of_map(kept, given, TexelFormat::Rgba16Unorm, [1.0; 4])?;
    shade(
        graph,
        given,
        by_samples(given, "shade_stochastic"),
        |pass| pass.arg("depth", depth).arg("kept", kept),
    )
}
