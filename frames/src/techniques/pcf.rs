//! Percentage-closer filtering: the share of a square of the map's depths that are nearer than the
//! receiver.

use super::Technique;
use crate::graph::{Graph, Handle, Result};
use crate::passes::{DEPTHS, Given, light_depth, shade};

pub const TECHNIQUE: Technique = Technique {
    name: "pcf",
    summary: "percentage-closer filtering of the depths themselves",
    // The comparison has no slack, and a slope would be shaded by its own texels.
    depth_bias: 2e-3,
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
    let depth = light_depth(graph, given)?;
    shade(graph, given, "shade_pcf", |pass| pass.arg("depth", depth))
}
