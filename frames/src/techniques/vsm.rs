//! Variance shadow mapping: the least shadow that mean and variance of a texel's depths allow.

use hankel_dsl::native::describe::TexelFormat;

use super::{DepthBias, Map, Technique};
use crate::graph::{Graph, Handle, Result};
use crate::passes::{Blended, Given, POWER_MOMENTS, blur, resolve_casters, shade_filtered};

/// Two moments and an opacity are three channels.
const BLENDED: Blended = Blended {
    fragment: "translucent_variance",
    draws: &[("blend", "blended")],
};

pub const TECHNIQUE: Technique = Technique {
    name: "vsm",
    summary: "two moments: mean and variance",
    // The least variance keeps a surface from shading itself.
    depth_bias: DepthBias::NONE,
    maps: &[
        two_of(POWER_MOMENTS[0], TexelFormat::Rg16Unorm),
        two_of(POWER_MOMENTS[1], TexelFormat::Rg16Unorm),
        two_of(POWER_MOMENTS[2], TexelFormat::Rg32Float),
    ],
    is_lower_bound: true,
    is_soft: false,
    add,
};

/// Two channels for a map of four moments. The least variance is the bias that the same bits need for four.
const fn two_of(map: Map, format: TexelFormat) -> Map {
    Map { format, ..map }
}

fn add(graph: &mut Graph, given: &Given) -> Result<Handle> {
    let map = given.shadow.map;
    let kernel = format!("resolve_variance_{}", map.format.name());
    let map = resolve_casters(graph, given, &kernel, &BLENDED)?
        .constant("encoding", map.encoding)
        .image([given.shadow.size; 2])?;
    let map = blur(graph, given, map)?;
    shade_filtered(graph, given, "shade_variance", &[("map", map)], |pass| {
        pass.constant("encoding", given.shadow.map.encoding)
    })
}
