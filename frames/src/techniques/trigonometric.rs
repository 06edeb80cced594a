//! Trigonometric moment shadow mapping: the least shadow that two complex trigonometric moments allow.

use hankel_dsl::native::describe::TexelFormat;
use hankel_moments::bias::{Bias, TRIGONOMETRIC_2_16, TRIGONOMETRIC_2_32};
use hankel_shadows::trigonometric::encoding;

use super::{DepthBias, Map, Technique};
use crate::graph::{Graph, Handle, Result};
use crate::passes::{Given, blur, light_depth, resolve_depth, shade_filtered};
use crate::scene::DepthRange;

pub const TECHNIQUE: Technique = Technique {
    name: "tmsm",
    summary: "two complex trigonometric moments",
    // The moment bias spreads a single surface a little, which keeps it from shading itself.
    depth_bias: DepthBias::NONE,
    maps: &[
        map(
            TexelFormat::Rgba16Unorm,
            encoding::UNORM,
            TRIGONOMETRIC_2_16,
        ),
        map(
            TexelFormat::Rgba32Float,
            encoding::PLAIN,
            TRIGONOMETRIC_2_32,
        ),
    ],
    is_lower_bound: true,
    is_soft: false,
    add,
};

const fn map(format: TexelFormat, encoding: u32, bias: Bias) -> Map {
    Map {
        format,
        depth_range: DepthRange::Unit,
        encoding,
        moment_bias: bias.strength as f32,
        // Those of the uniform distribution, whichever there are.
        bias_target: [0.0; 4],
    }
}

fn add(graph: &mut Graph, given: &Given) -> Result<Handle> {
    let encoding = given.shadow.map.encoding;
    let kernel = match encoding {
        encoding::PLAIN => "resolve_trigonometric_plain",
        _ => "resolve_trigonometric_unorm",
    };
    let depth = light_depth(graph, given)?;
    let map = resolve_depth(graph, given, kernel, depth).image([given.shadow.size; 2])?;
    let map = blur(graph, given, map)?;
    shade_filtered(
        graph,
        given,
        "shade_trigonometric",
        &[("map", map)],
        |pass| pass.constant("encoding", encoding),
    )
}
