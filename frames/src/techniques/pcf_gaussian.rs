//! Percentage-closer filtering with the weights of a Gaussian and of bilinear lookup, over all
//! samples: what filtered shadow maps approximate. Slow.

use super::Technique;
use crate::graph::{Graph, Handle, Result};
use crate::passes::{DEPTHS, Given, gaussian, light_depth, shade};
use crate::visibility::SAMPLES;

pub const TECHNIQUE: Technique = Technique {
    name: "pcf-gaussian",
    summary: "percentage-closer filtering with the other techniques' weights",
    // As for `pcf`.
    depth_bias: 2e-3,
    maps: DEPTHS,
    is_lower_bound: true,
    takes_one_sample: false,
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
    let weights = graph.constants("weights", &gaussian(given.shadow.filter));
    shade(graph, given, "shade_pcf_gaussian", |pass| {
        pass.arg("depth", depth)
            .arg("weights", weights)
            .constant("samples", SAMPLES)
    })
}
