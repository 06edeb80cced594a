//! Variance soft shadow mapping: as moment soft shadow mapping, by mean and variance of the parts of a
//! region, and by depths where these bound nothing.

use hankel_dsl::glam::UVec2;

use super::Technique;
use super::soft::SUMMED;
use crate::graph::{Graph, Handle, Result};
use crate::passes::{Given, light_depth, shade, summed_area};

pub const TECHNIQUE: Technique = Technique {
    name: "vssm",
    summary: "variance soft shadows of an area light",
    depth_bias: 1e-3,
    maps: &[SUMMED],
    is_lower_bound: false,
    resolves: false,
    is_soft: true,
    add,
};

/// Parts of a region along each axis.
const PARTS: u32 = 3;

fn add(graph: &mut Graph, given: &Given) -> Result<Handle> {
    let depth = light_depth(graph, given)?;
    let table = summed_area(graph, given, depth, "resolve_summed", "prefix_sums")?;
    let size = graph.constant("size", &UVec2::splat(given.shadow.size));
    shade(graph, given, "shade_vssm", |pass| {
        pass.arg("area", given.area)
            .arg("size", size)
            .arg("table", table)
            .arg("depth", depth)
            .constant("parts", PARTS)
    })
}
