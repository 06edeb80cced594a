//! Hamburger four moment shadow mapping: the least shadow that a texel's four moments allow, with
//! depths anywhere on the line.

use super::{DepthBias, Technique};
use crate::graph::{Graph, Handle, Result};
use crate::passes::{Given, POWER_MOMENTS, blur, moment_map, shade_filtered};

pub const TECHNIQUE: Technique = Technique {
    name: "hamburger",
    summary: "four moments, depths anywhere on the line",
    // The moment bias spreads a single surface a little, which keeps it from shading itself.
    depth_bias: DepthBias::NONE,
    maps: POWER_MOMENTS,
    is_lower_bound: true,
    is_soft: false,
    add,
};

fn add(graph: &mut Graph, given: &Given) -> Result<Handle> {
    let map = moment_map(graph, given)?;
    let map = blur(graph, given, map)?;
    shade_filtered(graph, given, "shade_hamburger", &[("map", map)], |pass| {
        pass.constant("encoding", given.shadow.map.encoding)
    })
}
