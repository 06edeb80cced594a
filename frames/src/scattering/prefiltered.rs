//! Prefiltered single scattering with four moments, or with six: the filtered map is resampled such that rays
//! from the camera are rows, and means along rows hold what each ray scatters up to any length.

use hankel_moments::bias::SYMMETRIC_6_32;
use hankel_shadows::soft::Lines;

use super::Scattering;
use crate::graph::{Graph, Handle, Result};
use crate::passes::{Given, POWER_MOMENTS, Volume, blur, light_depth, moments, scatter};
use crate::scene::Shadow;

pub const FOUR: Scattering = Scattering {
    name: "prefiltered",
    summary: "prefiltered single scattering, four moments",
    has_steps: false,
    add: add_four,
};

pub const SIX: Scattering = Scattering {
    name: "prefiltered-6",
    summary: "prefiltered single scattering, six moments",
    has_steps: false,
    add: add_six,
};

/// A map of four moments of its own, with the scene's filter; it is that of the surfaces if theirs is stored alike.
fn filtered(graph: &mut Graph, given: &Given) -> Result<Handle> {
    let given = Given {
        shadow: Shadow {
            map: POWER_MOMENTS[0],
            ..given.shadow
        },
        ..*given
    };
    let depth = light_depth(graph, &given)?;
    let map = moments(graph, &given, depth)?;
    blur(graph, &given, map)
}

/// Means along rows of the rectified map: of the first four moments for `order` 0, of the others for 1.
fn means(
    graph: &mut Graph,
    given: &Given,
    volume: &Volume,
    map: Handle,
    order: u32,
) -> Result<Handle> {
    let [columns, rows] = volume.texels;
    let table = graph
        .compute("rectify", "rectify")
        .constant("order", order)
        .arg("light", given.light)
        .arg("rectified", volume.rectified)
        .arg("rows", volume.rows)
        .arg("map", map)
        .elements(columns as usize * rows as usize)?;
    let lines = Lines {
        invocations: 64 * rows,
        length: columns,
        across: 0,
        padding: 0,
    };
    let lines = graph.constant("lines", &lines);
    let summed = graph
        .compute("means", "prefix_means")
        .arg("lines", lines)
        .arg("rectified", volume.rectified)
        .arg("rows", volume.rows)
        .arg("table", table)
        .finish()?;
    // The kernel writes its table.
    Ok(summed.changed("table").unwrap_or(table))
}

fn add_four(graph: &mut Graph, given: &Given, volume: &Volume, picture: Handle) -> Result<Handle> {
    let map = filtered(graph, given)?;
    let table = means(graph, given, volume, map, 0)?;
    scatter(
        graph,
        given,
        volume,
        picture,
        "scatter_prefiltered",
        |pass| pass.arg("rectified", volume.rectified).arg("table", table),
    )
}

fn add_six(graph: &mut Graph, given: &Given, volume: &Volume, picture: Handle) -> Result<Handle> {
    let map = filtered(graph, given)?;
    let first = means(graph, given, volume, map, 0)?;
    let second = means(graph, given, volume, map, 1)?;
    let target = graph.constant("bias target", &SYMMETRIC_6_32.six());
    scatter(
        graph,
        given,
        volume,
        picture,
        "scatter_prefiltered_6",
        |pass| {
            pass.arg("rectified", volume.rectified)
                .arg("target", target)
                .arg("first", first)
                .arg("second", second)
        },
    )
}
