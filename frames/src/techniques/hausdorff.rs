//! Hausdorff four moment shadow mapping: the least shadow that a texel's four moments allow, with
//! depths within the map's range. It leaks less.

use hankel_moments::bias::{
    Bias, HAUSDORFF_SYMMETRIC_4_16, HAUSDORFF_SYMMETRIC_4_32, HAUSDORFF_UNIT_4_16,
};

use super::{DepthBias, Map, Technique};
use crate::graph::{Graph, Handle, Result};
use crate::passes::{Given, POWER_MOMENTS, biased, blur, moment_map, shade_filtered};

pub const TECHNIQUE: Technique = Technique {
    name: "hausdorff",
    summary: "four moments, depths within the map's range",
    // The moment bias spreads a single surface a little, which keeps it from shading itself.
    depth_bias: DepthBias::NONE,
    maps: MAPS,
    is_lower_bound: true,
    is_soft: false,
    add,
};

/// Those of other techniques, with biases of their own: the published ones leave moments on the boundary of what
/// depths in a range can have.
const MAPS: &[Map] = &[
    pulled(POWER_MOMENTS[0], HAUSDORFF_SYMMETRIC_4_16),
    pulled(POWER_MOMENTS[1], HAUSDORFF_UNIT_4_16),
    pulled(POWER_MOMENTS[2], HAUSDORFF_SYMMETRIC_4_32),
];

const fn pulled(map: Map, bias: Bias) -> Map {
    let Map {
        moment_bias,
        bias_target,
        ..
    } = biased(bias);
    Map {
        moment_bias,
        bias_target,
        ..map
    }
}

fn add(graph: &mut Graph, given: &Given) -> Result<Handle> {
    let map = moment_map(graph, given)?;
    let map = blur(graph, given, map)?;
    shade_filtered(graph, given, "shade_hausdorff", &[("map", map)], |pass| {
        pass.constant("encoding", given.shadow.map.encoding)
    })
}
