//! Exponential shadow mapping: the least shadow that the mean of a texel's exponentials allows. The
//! exponentials of depths are filtered.

use hankel_dsl::native::describe::TexelFormat;

use super::{DepthBias, Map, Technique};
use crate::graph::{Graph, Handle, Result};
use crate::passes::{DEPTHS, Given, blur, light_depth, resolve_depth, shade_filtered};

/// The authors' own for 32-bit floats, of which the largest is exp(88): what is left is room for sums.
const EXPONENT: f32 = 80.0;

pub const TECHNIQUE: Technique = Technique {
    name: "esm",
    summary: "the mean of an exponential, in one channel",
    // On a surface the exponential's mean is 1 or, on a slope, more.
    depth_bias: DepthBias::NONE,
    maps: &[Map {
        format: TexelFormat::R32Float,
        ..DEPTHS[0]
    }],
    is_lower_bound: true,
    is_soft: false,
    add,
};

fn add(graph: &mut Graph, given: &Given) -> Result<Handle> {
    let exponent = graph.constant("exponent", &EXPONENT);
    let depth = light_depth(graph, given)?;
    let map = resolve_depth(graph, given, "resolve_esm", depth)
        .arg("exponent", exponent)
        .image([given.shadow.size; 2])?;
    let map = blur(graph, given, map)?;
    shade_filtered(graph, given, "shade_esm", &[("map", map)], |pass| {
        pass.arg("exponent", exponent)
    })
}
