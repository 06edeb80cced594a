//! Moment soft shadow mapping: blockers, penumbra and shadow by moments of regions of any size, from a
//! pyramid of summed-area tables of four moments, or of six.

use hankel_dsl::native::describe::TexelFormat;
use hankel_moments::bias::{SYMMETRIC_4_16_LECTURE, SYMMETRIC_6_16};

use super::{DepthBias, Map, Technique};
use crate::graph::{Graph, Handle, Result};
use crate::passes::{Given, TABLES, TABLES_6, biased, light_depth, shade, summed_area};
use crate::scene::DepthRange;

pub const FOUR: Technique = Technique {
    name: "soft",
    summary: "moment soft shadows of an area light, four moments",
    depth_bias: DepthBias::Share(1e-3),
    maps: &[SUMMED],
    is_lower_bound: false,
    is_soft: true,
    add: add_four,
};

pub const SIX: Technique = Technique {
    name: "soft-6",
    summary: "moment soft shadows of an area light, six moments",
    maps: &[Map {
        moment_bias: 5e-6,
        ..SUMMED
    }],
    add: add_six,
    ..FOUR
};

/// How a summed-area table is stored: each number in a word.
pub const SUMMED: Map = Map {
    format: TexelFormat::R32Uint,
    depth_range: DepthRange::Symmetric,
    encoding: 0,
    moment_bias: 1e-6,
    ..biased(SYMMETRIC_4_16_LECTURE)
};

fn add_four(graph: &mut Graph, given: &Given) -> Result<Handle> {
    let depth = light_depth(graph, given)?;
    let [table, pyramid] = summed_area(graph, given, depth, &TABLES)?;
    shade(graph, given, "shade_soft", |pass| {
        pass.arg("area", given.area)
            .arg("pyramid", pyramid)
            .arg("table", table)
    })
}

fn add_six(graph: &mut Graph, given: &Given) -> Result<Handle> {
    let depth = light_depth(graph, given)?;
    let [table, pyramid] = summed_area(graph, given, depth, &TABLES_6)?;
    let target = graph.constant("bias target", &SYMMETRIC_6_16.six());
    shade(graph, given, "shade_soft_6", |pass| {
        pass.arg("area", given.area)
            .arg("target", target)
            .arg("pyramid", pyramid)
            .arg("table", table)
    })
}
