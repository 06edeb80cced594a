//! Exponential variance shadow mapping: the least shadow that mean and variance of warped depths allow,
//! with the warp that grows with depth or with one that falls as well. Both are filtered as they are.

use hankel_dsl::native::describe::TexelFormat;
use hankel_shadows::exponential::Exponents;

use super::{DepthBias, Map, Technique};
use crate::graph::{Graph, Handle, Result};
use crate::passes::{Given, blur, light_depth, resolve_depth, shade_filtered};
use crate::scene::DepthRange;

/// By `Map::encoding`: what is usual for 32-bit floats, and the most of which 16 bits hold the square.
const EXPONENTS: [Exponents; 2] = [
    Exponents {
        positive: 40.0,
        negative: 5.0,
    },
    Exponents {
        positive: 5.54,
        negative: 5.54,
    },
];

/// Maps of 32-bit and of 16-bit floats.
const fn maps(wide: TexelFormat, narrow: TexelFormat) -> [Map; 2] {
    [
        // The usual least deviation, 1e-4 of a depth in [-1, 1], as the warp with exponent 40 shows it. It is
        // four times what rounding leaves of a variance: 20 roundings by 2^-24 of either moment.
        map(wide, 0, 1.6e-5),
        // What rounding leaves: three times, each moment is rounded by 2^-11.
        map(narrow, 1, 4e-3),
    ]
}

const fn map(format: TexelFormat, encoding: u32, least_variance: f32) -> Map {
    Map {
        format,
        depth_range: DepthRange::Symmetric,
        encoding,
        moment_bias: least_variance,
        bias_target: [0.0; 4],
    }
}

pub const POSITIVE: Technique = Technique {
    name: "evsm2",
    summary: "mean and variance of one exponential",
    // The least variance keeps a surface from shading itself.
    depth_bias: DepthBias::NONE,
    maps: &maps(TexelFormat::Rg32Float, TexelFormat::Rg16Float),
    is_lower_bound: true,
    is_soft: false,
    add: |graph, given| add(graph, given, "resolve_positive_evsm", 1),
};

pub const BOTH: Technique = Technique {
    name: "evsm4",
    summary: "mean and variance of two exponentials",
    maps: &maps(TexelFormat::Rgba32Float, TexelFormat::Rgba16Float),
    add: |graph, given| add(graph, given, "resolve_evsm", 2),
    ..POSITIVE
};

fn add(graph: &mut Graph, given: &Given, kernel: &str, warps: u32) -> Result<Handle> {
    let map = given.shadow.map;
    let exponents = graph.constant("exponents", &EXPONENTS[map.encoding as usize]);
    let depth = light_depth(graph, given)?;
    let kernel = format!("{kernel}_{}", map.format.name());
    let map = resolve_depth(graph, given, &kernel, depth)
        .arg("exponents", exponents)
        .image([given.shadow.size; 2])?;
    let map = blur(graph, given, map)?;
    shade_filtered(graph, given, "shade_evsm", &[("map", map)], |pass| {
        pass.arg("exponents", exponents).constant("warps", warps)
    })
}
