//! Percentage-closer filtering: the share of a square of the map's depths that are nearer than the
//! receiver. Translucent casters are kept in a share of the depths, by a hash of where they are, so that the
//! noise is the same in each frame (stochastic transparency: Enderton, Sintorn, Shirley, Luebke, 2010).

use hankel_dsl::glam::UVec2;
use hankel_dsl::native::describe::TexelFormat;
use hankel_host::device::Blend;

use super::Technique;
use crate::graph::{Graph, Handle, Result};
use crate::passes::{
    CANNOT_BLEND_ONE, DEPTHS, Given, TRANSLUCENT, draw_translucent, opaque_depth, shade,
};

pub const TECHNIQUE: Technique = Technique {
    name: "pcf",
    summary: "percentage-closer filtering of the depths themselves",
    // The comparison has no slack, and a slope would be shaded by its own texels.
    depth_bias: 2e-3,
    maps: DEPTHS,
    is_lower_bound: false,
    takes_one_sample: true,
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
    if given.shadow.multisampling == 1 {
        if given.translucent.is_some() {
            graph.omit(TRANSLUCENT, CANNOT_BLEND_ONE);
        }
        return shade(graph, given, "shade_single_pcf", |pass| {
            pass.arg("depth", depth)
        });
    }
    let Some(translucent) = given.translucent else {
        return shade(graph, given, "shade_pcf", |pass| pass.arg("depth", depth));
    };
    let size = given.shadow.size;
    let texels = graph.constant("size", &UVec2::splat(size));
    let label = "keep by chance";
    let kept = draw_translucent(graph, given, &translucent, label, given.light_view)
        .fragment("stochastic_depths")
        .arg("size", texels)
        .blend(Blend::Least)
        .samples([size; 2], TexelFormat::Rgba16Unorm, [1.0; 4])?;
    shade(graph, given, "shade_stochastic", |pass| {
        pass.arg("depth", depth).arg("kept", kept)
    })
}
