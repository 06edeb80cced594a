//! Variance shadow mapping: the least shadow that mean and variance of a texel's depths allow.

use super::{DepthBias, Technique};
use crate::graph::{Graph, Handle, Result};
use crate::passes::{Given, POWER_MOMENTS, blur, moment_map, shade_filtered};

pub const TECHNIQUE: Technique = Technique {
    name: "vsm",
    summary: "two moments: mean and variance",
    // The least variance keeps a surface from shading itself.
    depth_bias: DepthBias::NONE,
    maps: POWER_MOMENTS,
    is_lower_bound: true,
    is_soft: false,
    add,
};

fn add(graph: &mut Graph, given: &Given) -> Result<Handle> {
    let map = moment_map(graph, given)?;
    let map = blur(graph, given, map)?;
    shade_filtered(graph, given, "shade_variance", &[("map", map)], |pass| {
        pass.constant("encoding", given.shadow.map.encoding)
    })
}
