//! Variance soft shadow mapping: as moment soft shadow mapping, by mean and variance of the parts of a
//! region, and by depths where these bound nothing.

use super::soft::SUMMED;
use super::{DepthBias, Map, Technique};
use crate::graph::{Graph, Handle, Result};
use crate::passes::{Given, TABLES, by_samples, light_depth, shade, summed_area};

pub const TECHNIQUE: Technique = Technique {
    name: "vssm",
    summary: "variance soft shadows of an area light",
    depth_bias: DepthBias::Share(1e-3),
    // The least variance: more than rounding asks for, since two moments do not bound a slope from below.
    maps: &[Map {
        moment_bias: 2e-5,
        ..SUMMED
    }],
    is_lower_bound: false,
    is_soft: true,
    add,
};

/// Parts of a region along each axis.
const PARTS: u32 = 3;

fn add(graph: &mut Graph, given: &Given) -> Result<Handle> {
    let depth = light_depth(graph, given)?;
    let [table, pyramid] = summed_area(graph, given, depth, &TABLES)?;
    shade(graph, given, by_samples(given, "shade_vssm"), |pass| {
        pass.arg("area", given.area)
            .arg("pyramid", pyramid)
            .arg("table", table)
            .arg("depth", depth)
            .constant("parts", PARTS)
    })
}
