//! What other techniques do, where the depths of a tile of the map do not settle it: tiles that no
//! caster comes near are neither resolved nor blurred, receivers that are on the nearest surface, or
//! behind all of them, read no map.

use hankel_dsl::glam::{IVec2, UVec2, Vec4};
use hankel_host::device::TextureShape;
use hankel_moments::{Moments4, quantize_symmetric_4};
use hankel_shadows::tiles::{ACROSS, EDGE, Listed, TEXELS, Tiles, tiles_of};

use super::{DepthBias, Map, Technique};
use crate::graph::{Graph, Handle, Result};
use crate::passes::{
    BILINEAR, DEPTHS, Given, POWER_MOMENTS, by_samples, light_depth, shade, taps_along,
};

pub const HAMBURGER: Technique = Technique {
    name: "hamburger-tiles",
    summary: "`hamburger` where a tile's depths do not settle it",
    depth_bias: DepthBias::NONE,
    maps: &[SYMMETRIC],
    is_lower_bound: true,
    is_soft: false,
    add: hamburger,
};

pub const PCF_GAUSSIAN: Technique = Technique {
    name: "pcf-gaussian-tiles",
    summary: "`pcf-gaussian` where a tile's depths do not settle it",
    // As for `pcf`.
    depth_bias: DepthBias::COMPARED,
    maps: DEPTHS,
    is_lower_bound: true,
    is_soft: false,
    add: pcf_gaussian,
};

const SYMMETRIC: Map = POWER_MOMENTS[0];

/// What is known of a map's tiles.
struct Known {
    /// What the depths within reach of a tile's filter lie between.
    between: Handle,
    /// Tiles that a caster is within reach of.
    list: Handle,
    /// How many.
    listed: Handle,
    /// Invocations over all tiles, if all are listed.
    most: [u32; 3],
}

fn known(graph: &mut Graph, given: &Given, depth: Handle) -> Result<Known> {
    let across = tiles_of(given.shadow.size);
    let count = across as usize * across as usize;
    // The filter and bilinear lookup.
    let reach = (given.shadow.filter / 2 + 1).div_ceil(EDGE);
    let tiles = Tiles {
        across: UVec2::splat(across),
    };
    let tiles = graph.constant("tiles", &tiles);
    let depths = graph
        .compute("tile depths", by_samples(given, "tile_depths"))
        .arg("tiles", tiles)
        .arg("depth", depth)
        .elements(count)?;
    let listed = graph.zeros::<Listed>("listed", 1);
    let list = graph.zeros::<u32>("list", count);
    let written = graph
        .compute("tile list", "tile_list")
        .arg("tiles", tiles)
        .arg("depths", depths)
        .arg("listed", listed)
        .arg("list", list)
        .constant("reach", reach)
        .of(count)
        .finish()?;
    // The kernel writes both.
    Ok(Known {
        between: written.outputs.first().copied().unwrap_or(depths),
        list: written.changed("list").unwrap_or(list),
        listed: written.changed("listed").unwrap_or(listed),
        most: [ACROSS * TEXELS, (across * across).div_ceil(ACROSS), 1],
    })
}

/// A map that holds the moments of the far end, 1, in the tiles that are not listed.
fn empty(graph: &mut Graph, given: &Given, label: &'static str) -> Result<Handle> {
    let [width, height] = [given.shadow.size; 2];
    let far = quantize_symmetric_4(Moments4::of_depth(1.0_f32));
    let shape = TextureShape::d2(width, height, SYMMETRIC.format);
    graph.filled(label, shape, Vec4::new(far.r, far.g, far.b, far.a))
}

fn hamburger(graph: &mut Graph, given: &Given) -> Result<Handle> {
    let depth = light_depth(graph, given)?;
    let Known {
        between,
        list,
        listed,
        most,
    } = known(graph, given, depth)?;
    let map = empty(graph, given, "map")?;
    let written = graph
        .compute("resolve", by_samples(given, "resolve_symmetric_tiles"))
        .arg("listed", listed)
        .arg("list", list)
        .arg("depth", depth)
        .arg("map", map)
        .at_most(most)
        .note("listed tiles")
        .finish()?;
    let mut map = written.changed("map").unwrap_or(map);
    let taps = given.shadow.filter;
    if taps <= 1 {
        graph.omit("blur", "the filter is one texel wide");
    } else {
        for (label, name, step) in [
            ("blur rows", "rows", IVec2::X),
            ("blur columns", "columns", IVec2::Y),
        ] {
            let pass = taps_along(graph, taps, step);
            let target = empty(graph, given, name)?;
            let written = graph
                .compute(label, "blur_tiles")
                .arg("listed", listed)
                .arg("list", list)
                .arg("taps", pass)
                .arg("source", map)
                .arg("map", target)
                .at_most(most)
                .note(format!("{taps} taps, listed tiles"))
                .finish()?;
            map = written.changed("map").unwrap_or(target);
        }
    }
    shade(graph, given, "shade_hamburger_tiles", |pass| {
        pass.arg("between", between)
            .arg("map", map)
            .arg("sampler", BILINEAR)
    })
}

fn pcf_gaussian(graph: &mut Graph, given: &Given) -> Result<Handle> {
    graph.omit(
        "moments",
        "percentage-closer filtering compares the depths themselves",
    );
    let depth = light_depth(graph, given)?;
    let Known { between, .. } = known(graph, given, depth)?;
    let taps = taps_along(graph, given.shadow.filter, IVec2::ZERO);
    let kernel = by_samples(given, "shade_pcf_gaussian_tiles");
    shade(graph, given, kernel, |pass| {
        pass.arg("taps", taps)
            .arg("between", between)
            .arg("depth", depth)
    })
}
