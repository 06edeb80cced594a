//! Hausdorff four moment shadow mapping: the least shadow that a texel's four moments allow, with
//! depths within the map's range. It leaks less.

use super::Technique;
use crate::graph::{Graph, Handle, Result};
use crate::passes::{Given, POWER_MOMENTS, blur, moment_map, shade_filtered};

pub const TECHNIQUE: Technique = Technique {
    name: "hausdorff",
    summary: "four moments, depths within the map's range",
    // The published biases put their weight at the ends of the depth range, where the Hausdorff
    // problem discards it: a surface stays sharp, and what 16 bits round would decide between
    // light and full shadow.
    depth_bias: 1e-3,
    maps: POWER_MOMENTS,
    is_lower_bound: true,
    is_soft: false,
    add,
};

fn add(graph: &mut Graph, given: &Given) -> Result<Handle> {
    let map = moment_map(graph, given)?;
    let map = blur(graph, given, map)?;
    shade_filtered(graph, given, "shade_hausdorff", &[("map", map)], |pass| {
        pass.constant("encoding", given.shadow.map.encoding)
    })
}
