//! Hamburger six moment shadow mapping: the least shadow that a texel's six moments allow, with depths
//! anywhere on the line. They lie in two textures that are interpolated, or in words of 32 bits.

use hankel_dsl::glam::IVec2;
use hankel_dsl::native::describe::TexelFormat;
use hankel_moments::bias::{Bias, MEASURED, SYMMETRIC_6_16, SYMMETRIC_6_32};
use hankel_shadows::shade::encoding;

use super::{DepthBias, Map, Technique};
use crate::graph::{Graph, Handle, Result};
use crate::passes::{
    Blended, Given, blurred, resolve_casters, shade, shade_filtered, taps_along, textures,
};
use crate::scene::DepthRange;

pub const TECHNIQUE: Technique = Technique {
    name: "hamburger-6",
    summary: "six moments, depths anywhere on the line",
    // The moment bias spreads a single surface a little, which keeps it from shading itself.
    depth_bias: DepthBias::NONE,
    maps: &[
        map(
            TexelFormat::Rgba16Unorm,
            encoding::SYMMETRIC,
            SYMMETRIC_6_16,
        ),
        map(TexelFormat::Rgba32Float, encoding::PLAIN, SYMMETRIC_6_32),
        map(TexelFormat::R32Uint, WORDS[0].encoding, WORDS[0].bias),
        map(TexelFormat::Rg32Uint, WORDS[1].encoding, WORDS[1].bias),
    ],
    is_lower_bound: true,
    is_soft: false,
    add,
};

const fn map(format: TexelFormat, encoding: u32, bias: Bias) -> Map {
    Map {
        format,
        depth_range: DepthRange::Symmetric,
        encoding,
        moment_bias: bias.strength as f32,
        // Six moments do not fit: the kernel has a target of its own.
        bias_target: [0.0; 4],
    }
}

/// A way to put six moments into words.
struct Words {
    encoding: u32,
    bias: Bias,
    resolve: &'static str,
    blur: &'static str,
    shade: &'static str,
    /// The textures' names in the kernels that filter and shade.
    textures: &'static [&'static str],
}

const WORDS: [Words; 2] = [
    // Three textures of two channels with 16 bits in a word.
    Words {
        encoding: 3,
        bias: SYMMETRIC_6_16,
        resolve: "resolve_packed_16",
        blur: "blur_packed_16",
        shade: "shade_packed_16",
        textures: &["low", "middle", "high"],
    },
    // One texture of two words, each of three channels with 10 bits.
    Words {
        encoding: 4,
        bias: TEN_BITS,
        resolve: "resolve_packed_10",
        blur: "blur_packed_10",
        shade: "shade_packed_10",
        textures: &["map"],
    },
];

/// Measured for moments that are rounded once; here they are up to three times, when they are made and by the
/// filter along rows and along columns.
const TEN_BITS: Bias = {
    let one = MEASURED[11].bias;
    assert!(one.count == 6 && one.bits == 10);
    Bias {
        strength: 3.0 * one.strength,
        ..one
    }
};

fn add(graph: &mut Graph, given: &Given) -> Result<Handle> {
    let encoding = given.shadow.map.encoding;
    let words = WORDS.iter().find(|words| words.encoding == encoding);
    let (kernel, count, bias) = match words {
        Some(words) => (words.resolve, words.textures.len(), words.bias),
        None if encoding == encoding::PLAIN => ("resolve_plain_6", 2, SYMMETRIC_6_32),
        None => ("resolve_symmetric_6", 2, SYMMETRIC_6_16),
    };
    let pass = resolve_casters(
        graph,
        given,
        kernel,
        &Blended::halves("translucent_moments_6"),
    )?;
    let maps = textures(pass, given, count)?;
    let target = graph.constant("bias target", &bias.six());
    if let Some(words) = words {
        let maps = blur_words(graph, given, words, maps)?;
        graph.omit("mips", "no sampler interpolates words");
        return shade(graph, given, words.shade, |pass| {
            let maps = words.textures.iter().zip(maps);
            maps.fold(pass.arg("target", target), |pass, (name, map)| {
                pass.arg(*name, map)
            })
        });
    }
    let maps = blurred(graph, given, &maps, &["first", "second"])?;
    shade_filtered(graph, given, "shade_hamburger_6", &maps, |pass| {
        pass.arg("target", target).constant("encoding", encoding)
    })
}

/// The filter, over all textures of words at once.
fn blur_words(
    graph: &mut Graph,
    given: &Given,
    words: &Words,
    mut maps: Vec<Handle>,
) -> Result<Vec<Handle>> {
    let taps = given.shadow.filter;
    if taps <= 1 {
        graph.omit("blur", "the filter is one texel wide");
        return Ok(maps);
    }
    let size = [given.shadow.size, given.shadow.size, 1];
    for (label, step) in [("blur rows", IVec2::X), ("blur columns", IVec2::Y)] {
        let pass = taps_along(graph, taps, step);
        let pass = graph
            .compute(label, words.blur)
            .arg("taps", pass)
            .note(format!("{taps} taps"));
        let textures = words.textures.iter().zip(&maps);
        let pass = textures.fold(pass, |pass, (name, map)| pass.arg(*name, *map).texels(size));
        maps = pass.finish()?.outputs;
    }
    Ok(maps)
}
