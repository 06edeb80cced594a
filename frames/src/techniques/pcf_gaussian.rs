//! Percentage-closer filtering with the weights of a Gaussian and of bilinear lookup, over all
//! samples: what filtered shadow maps approximate. Slow.

use hankel_dsl::glam::IVec2;

use super::{DepthBias, Technique};
use crate::graph::{Graph, Handle, Result};
use crate::passes::{DEPTHS, Given, by_samples, light_depth, shade, taps_along};

pub const TECHNIQUE: Technique = Technique {
    name: "pcf-gaussian",
    summary: "percentage-closer filtering with the other techniques' weights",
    // As for `pcf`.
    depth_bias: DepthBias::COMPARED,
    maps: DEPTHS,
    is_lower_bound: true,
    is_soft: false,
    add,
};

fn add(graph: &mut Graph, given: &Given) -> Result<Handle> {
    graph.omit(
        "moments",
        "percentage-closer filtering compares the depths themselves",
    );
    graph.omit("blur", "its weights are part of the comparison");
    let depth = light_depth(graph, given)?;
    let taps = taps_along(graph, given.shadow.filter, IVec2::ZERO);
    shade(
        graph,
        given,
        by_samples(given, "shade_pcf_gaussian"),
        |pass| pass.arg("taps", taps).arg("depth", depth),
    )
}
