//! Percentage-closer soft shadows: the mean distance of blockers in a search region, and percentage-closer
//! filtering over the penumbra that it makes.

use hankel_dsl::glam::Vec2;
use hankel_shadows::soft::Points;

use super::Technique;
use crate::graph::{Graph, Handle, Result};
use crate::passes::{DEPTHS, Given, by_samples, light_depth, shade};
use crate::scene::Area;

pub const TECHNIQUE: Technique = Technique {
    name: "pcss",
    summary: "percentage-closer soft shadows of an area light",
    // As for `pcf`: without a penumbra, too, samples lie as far apart as a texel is wide.
    depth_bias: 2e-3,
    maps: DEPTHS,
    is_lower_bound: false,
    is_soft: true,
    add,
};

fn add(graph: &mut Graph, given: &Given) -> Result<Handle> {
    graph.omit(
        "moments",
        "percentage-closer soft shadows compare the depths themselves",
    );
    graph.omit("blur", "the filter's width differs from pixel to pixel");
    let depth = light_depth(graph, given)?;
    let [search, filter] = given
        .shadow
        .samples
        .map(|count| points(&given.source, count));
    let points = graph.constant("points", &Points::new(&search, &filter));
    shade(graph, given, by_samples(given, "shade_pcss"), |pass| {
        pass.arg("area", given.area)
            .arg("points", points)
            .arg("depth", depth)
    })
}

/// Points of a light, in units of its half width: uniform, the same for every pixel (M. Roberts: The
/// unreasonable effectiveness of quasirandom sequences, 2018).
fn points(light: &Area, count: u32) -> Vec<Vec2> {
    let part = |i: u32, step: f64| (f64::from(i) * step + 0.5).fract();
    (0..count)
        .map(|i| {
            light.point([
                part(i, 0.754_877_666_246_693),
                part(i, 0.569_840_290_998_053),
            ])
        })
        .map(|[x, y]| Vec2::new(x as f32, y as f32))
        .collect()
}
