//! Hamburger six moment shadow mapping: the least shadow that a texel's six moments allow, with depths
//! anywhere on the line. They lie in two textures.

use hankel_dsl::native::describe::TexelFormat;
use hankel_moments::bias::{Bias, SYMMETRIC_6_16, SYMMETRIC_6_32};
use hankel_shadows::shade::encoding;

use super::{Map, Technique};
use crate::graph::{Graph, Handle, Result};
use crate::passes::{BILINEAR, Given, blur, light_depth, resolve, shade};
use crate::scene::DepthRange;

pub const TECHNIQUE: Technique = Technique {
    name: "hamburger-6",
    summary: "six moments, depths anywhere on the line",
    // The moment bias spreads a single surface a little, which keeps it from shading itself.
    depth_bias: 0.0,
    maps: &[
        map(TexelFormat::Rgba16Unorm, encoding::SYMMETRIC),
        map(TexelFormat::Rgba32Float, encoding::PLAIN),
    ],
    is_lower_bound: true,
    is_soft: false,
    add,
};

const fn bias(encoding: u32) -> Bias {
    match encoding {
        encoding::PLAIN => SYMMETRIC_6_32,
        _ => SYMMETRIC_6_16,
    }
}

const fn map(format: TexelFormat, encoding: u32) -> Map {
    Map {
        format,
        depth_range: DepthRange::Symmetric,
        encoding,
        moment_bias: bias(encoding).strength as f32,
        // Six moments do not fit: the kernel has a target of its own.
        bias_target: [0.0; 4],
    }
}

fn add(graph: &mut Graph, given: &Given) -> Result<Handle> {
    let encoding = given.shadow.map.encoding;
    let kernel = match encoding {
        encoding::PLAIN => "resolve_plain_6",
        _ => "resolve_symmetric_6",
    };
    let depth = light_depth(graph, given)?;
    let size = [given.shadow.size, given.shadow.size, 1];
    let maps = resolve(graph, given, kernel)
        .arg("depth", depth)
        .texels(size)
        .texels(size)
        .finish()?
        .outputs;
    let first = blur(graph, given, maps[0])?;
    let second = blur(graph, given, maps[1])?;
    let target = graph.constant("bias target", &bias(encoding).six());
    shade(graph, given, "shade_hamburger_6", |pass| {
        pass.arg("target", target)
            .arg("first", first)
            .arg("second", second)
            .arg("sampler", BILINEAR)
            .constant("encoding", encoding)
    })
}
