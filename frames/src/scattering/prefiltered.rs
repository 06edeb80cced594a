//! Prefiltered single scattering with four moments, or with six: the filtered map is resampled such that rays
//! from the camera are rows, and means along rows hold what each ray scatters up to any length.
//!
//! It is for directional lights, as the papers have it: their coordinates, and the bounds of these, are about the
//! direction of the light. About the line from the camera to a spot light, rays would be rows as well, by the angle at
//! the light. But there the transmittance to the camera and the phase function depend on a ray's inclination at each
//! place of a row, and the weights of a row's means must not. The papers say nothing of that.

use hankel_dsl::glam::UVec2;
use hankel_moments::bias::SYMMETRIC_6_32;
use hankel_shadows::scattering::MapRows;

use super::Scattering;
use crate::graph::{Graph, GraphError, Handle, Result};
use crate::passes::{Given, POWER_MOMENTS, Rectification, Volume, blur, moment_map, scatter};
use crate::scene::Shadow;
use crate::visibility::SAMPLES;

/// Why, and what else to use.
const NOT_FOR_SPOTS: Option<&str> = Some(
    "`ray-marching` with a light that has a `position`: prefiltered single scattering is that of directional lights",
);

pub const FOUR: Scattering = Scattering {
    name: "prefiltered",
    summary: "prefiltered single scattering, four moments",
    has_steps: false,
    not_for_spots: NOT_FOR_SPOTS,
    add: add_four,
};

pub const SIX: Scattering = Scattering {
    name: "prefiltered-6",
    summary: "prefiltered single scattering, six moments",
    has_steps: false,
    not_for_spots: NOT_FOR_SPOTS,
    add: add_six,
};

/// A map of four moments of opaque and translucent casters, with the scene's filter. Where a technique of shadows has
/// the same one, these are its passes, and nothing is made twice.
///
/// Moments into which translucent casters are blended are those of a distribution of depths, like any others, and
/// [`rectify`](hankel_shadows::scattering::rectify) takes nothing else for granted.
fn filtered(graph: &mut Graph, given: &Given) -> Result<Handle> {
    let given = Given {
        shadow: Shadow {
            map: POWER_MOMENTS[0],
            ..given.shadow
        },
        ..*given
    };
    let map = moment_map(graph, &given)?;
    blur(graph, &given, map)
}

/// How rays are rows of the light's map.
fn rectification(volume: &Volume) -> Result<Rectification> {
    volume.rectification.ok_or_else(|| GraphError::Argument {
        pass: "rectify".into(),
        kernel: "rectify".into(),
        parameter: "rectified".into(),
        problem: "a spot light has no such coordinates: use ray marching".into(),
    })
}

/// Means along rows of the rectified map: of the first four moments for `order` 0, of the others for 1.
fn means(
    graph: &mut Graph,
    given: &Given,
    rectification: &Rectification,
    map: Handle,
    order: u32,
) -> Result<Handle> {
    let [columns, rows] = rectification.texels;
    let table = graph
        .compute("rectify", "rectify")
        .constant("order", order)
        .arg("light", given.light)
        .arg("rectified", rectification.rectified)
        .arg("rows", rectification.rows)
        .arg("map", map)
        .elements(columns as usize * rows as usize)?;
    let lines = MapRows {
        invocations: 64 * rows,
        length: columns,
        padding: UVec2::ZERO,
    };
    let lines = graph.constant("lines", &lines);
    let summed = graph
        .compute("means", "prefix_means")
        .arg("lines", lines)
        .arg("rectified", rectification.rectified)
        .arg("rows", rectification.rows)
        .arg("table", table)
        .finish()?;
    // The kernel writes its table.
    Ok(summed.changed("table").unwrap_or(table))
}

fn add_four(graph: &mut Graph, given: &Given, volume: &Volume, picture: Handle) -> Result<Handle> {
    let rectification = rectification(volume)?;
    let map = filtered(graph, given)?;
    let table = means(graph, given, &rectification, map, 0)?;
    scatter(
        graph,
        given,
        volume,
        picture,
        "scatter_prefiltered",
        SAMPLES,
        |pass| {
            pass.arg("rectified", rectification.rectified)
                .arg("table", table)
        },
    )
}

fn add_six(graph: &mut Graph, given: &Given, volume: &Volume, picture: Handle) -> Result<Handle> {
    let rectification = rectification(volume)?;
    let map = filtered(graph, given)?;
    let first = means(graph, given, &rectification, map, 0)?;
    let second = means(graph, given, &rectification, map, 1)?;
    let target = graph.constant("bias target", &SYMMETRIC_6_32.six());
    scatter(
        graph,
        given,
        volume,
        picture,
        "scatter_prefiltered_6",
        SAMPLES,
        |pass| {
            pass.arg("rectified", rectification.rectified)
                .arg("target", target)
                .arg("first", first)
                .arg("second", second)
        },
    )
}
