//! The least shadow that four, six, eight or ten moments of a texel in 32-bit floats allow, by the bound for any
//! number of moments, with depths anywhere on the line.

use hankel_dsl::native::describe::TexelFormat;
use hankel_moments::bias::{Bias, SYMMETRIC_4_32, SYMMETRIC_6_32, SYMMETRIC_8_32, SYMMETRIC_10_32};

use super::{DepthBias, Map, Technique};
use crate::graph::{Graph, Handle, Result};
use crate::passes::{
    Blended, Given, blurred, filtered_maps, resolve_casters, shade_filtered, textures,
};
use crate::scene::DepthRange;

pub const FOUR: Technique = Technique {
    name: "moments-4",
    summary: "four moments, by the bound for any number",
    // The moment bias spreads a single surface a little, which keeps it from shading itself.
    depth_bias: DepthBias::NONE,
    maps: &[map(SYMMETRIC_4_32)],
    is_lower_bound: true,
    is_soft: false,
    add: |graph, given| {
        let kernels = ["resolve_plain", "shade_moments_4"];
        add_blended(graph, given, kernels, "translucent_moments", &["map"])
    },
};

pub const SIX: Technique = Technique {
    name: "moments-6",
    summary: "six moments, by the bound for any number",
    maps: &[map(SYMMETRIC_6_32)],
    add: |graph, given| {
        let kernels = ["resolve_plain_6", "shade_moments_6"];
        let names = &["first", "second"];
        add_blended(graph, given, kernels, "translucent_moments_6", names)
    },
    ..FOUR
};

pub const EIGHT: Technique = Technique {
    name: "moments-8",
    summary: "eight moments, by the bound for any number",
    maps: &[map(SYMMETRIC_8_32)],
    add: |graph, given| {
        let kernels = ["resolve_plain_8", "shade_moments_8"];
        add(graph, given, kernels, &["first", "second"])
    },
    ..FOUR
};

pub const TEN: Technique = Technique {
    name: "moments-10",
    summary: "ten moments, by the bound for any number",
    maps: &[map(SYMMETRIC_10_32)],
    add: |graph, given| {
        let kernels = ["resolve_plain_10", "shade_moments_10"];
        add(graph, given, kernels, &["first", "second", "third"])
    },
    ..FOUR
};

pub const FOUR_COMPENSATED: Technique = Technique {
    name: "moments-4-compensated",
    summary: "four moments, by the bound for any number in about twice the digits",
    add: |graph, given| {
        let kernels = ["resolve_plain", "shade_moments_4_compensated"];
        add_blended(graph, given, kernels, "translucent_moments", &["map"])
    },
    ..FOUR
};

pub const SIX_COMPENSATED: Technique = Technique {
    name: "moments-6-compensated",
    summary: "six moments, by the bound for any number in about twice the digits",
    add: |graph, given| {
        let kernels = ["resolve_plain_6", "shade_moments_6_compensated"];
        let names = &["first", "second"];
        add_blended(graph, given, kernels, "translucent_moments_6", names)
    },
    ..SIX
};

pub const EIGHT_COMPENSATED: Technique = Technique {
    name: "moments-8-compensated",
    summary: "eight moments, by the bound for any number in about twice the digits",
    add: |graph, given| {
        let kernels = ["resolve_plain_8", "shade_moments_8_compensated"];
        add(graph, given, kernels, &["first", "second"])
    },
    ..EIGHT
};

pub const TEN_COMPENSATED: Technique = Technique {
    name: "moments-10-compensated",
    summary: "ten moments, by the bound for any number in about twice the digits",
    add: |graph, given| {
        let kernels = ["resolve_plain_10", "shade_moments_10_compensated"];
        add(graph, given, kernels, &["first", "second", "third"])
    },
    ..TEN
};

const fn map(bias: Bias) -> Map {
    Map {
        format: TexelFormat::Rgba32Float,
        depth_range: DepthRange::Symmetric,
        encoding: 0,
        moment_bias: bias.strength as f32,
        // The kernels have targets of their own.
        bias_target: [0.0; 4],
    }
}

/// Four or six moments, into which translucent casters can be blended.
fn add_blended(
    graph: &mut Graph,
    given: &Given,
    [make, shade]: [&'static str; 2],
    blended: &'static str,
    names: &[&'static str],
) -> Result<Handle> {
    let pass = resolve_casters(graph, given, make, &Blended::halves(blended))?;
    let maps = textures(pass, given, names.len())?;
    let maps = blurred(graph, given, &maps, names)?;
    shade_filtered(graph, given, shade, &maps, |pass| pass)
}

/// More moments: with an opacity they are more than two textures hold.
fn add(
    graph: &mut Graph,
    given: &Given,
    [make, shade]: [&'static str; 2],
    names: &[&'static str],
) -> Result<Handle> {
    let maps = filtered_maps(graph, given, make, names)?;
    shade_filtered(graph, given, shade, &maps, |pass| pass)
}
