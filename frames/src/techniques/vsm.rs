//! Variance shadow mapping: the least shadow that mean and variance of a texel's depths allow.

use super::Technique;
use crate::graph::{Graph, Handle, Result};
use crate::passes::{BILINEAR, Given, POWER_MOMENTS, blur, moment_map, shade};

pub const TECHNIQUE: Technique = Technique {
    name: "vsm",
    summary: "two moments: mean and variance",
    // The least variance keeps a surface from shading itself.
    depth_bias: 0.0,
    maps: POWER_MOMENTS,
    is_lower_bound: true,
    is_soft: false,
    add,
};

fn add(graph: &mut Graph, given: &Given) -> Result<Handle> {
    let map = moment_map(graph, given)?;
    let map = blur(graph, given, map)?;
    shade(graph, given, "shade_variance", |pass| {
        pass.arg("map", map)
            .arg("sampler", BILINEAR)
            .constant("encoding", given.shadow.map.encoding)
    })
}
