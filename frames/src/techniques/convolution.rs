//! Convolution shadow mapping: the mean of a Fourier series of comparisons, by four terms or by eight. What is
//! filtered are cosines and sines of depths.

use std::f64::consts::PI;

use hankel_dsl::glam::Vec4;
use hankel_dsl::native::describe::TexelFormat;
use hankel_shadows::convolution::Series;

use super::{DepthBias, Map, Technique};
use crate::graph::{Graph, Handle, Result};
use crate::passes::{DEPTHS, Given, filtered_maps, shade_filtered};

/// How much the higher terms are attenuated against ringing: the last by exp(-1) (Annen and others, 2007).
const ATTENUATION: f64 = 1.0;

/// The authors store 8 bits.
const MAPS: &[Map] = &[map(TexelFormat::Rgba8Unorm), map(TexelFormat::Rgba16Unorm)];

const fn map(format: TexelFormat) -> Map {
    Map {
        format,
        ..DEPTHS[0]
    }
}

pub const FOUR: Technique = Technique {
    name: "convolution",
    summary: "a Fourier series of the comparison, four terms",
    // On a surface the series is half, and twice the series is all light.
    depth_bias: DepthBias::NONE,
    maps: MAPS,
    is_lower_bound: false,
    is_soft: false,
    add: |graph, given| {
        let [make, shade] = ["resolve_convolution", "shade_convolution"];
        add(graph, given, 4, make, shade)
    },
};

pub const EIGHT: Technique = Technique {
    name: "convolution-8",
    summary: "a Fourier series of the comparison, eight terms",
    add: |graph, given| {
        let [make, shade] = ["resolve_convolution_8", "shade_convolution_8"];
        add(graph, given, 8, make, shade)
    },
    ..FOUR
};

/// The parameters of the kernel that shades, of which four terms have the first two.
const TEXTURES: [&str; 4] = ["cosines", "sines", "high_cosines", "high_sines"];

/// The weights of `terms` terms of the series of a square wave.
fn series(terms: usize) -> Series {
    let weight = |k: usize| {
        let attenuation = (-ATTENUATION * (k as f64 / terms as f64).powi(2)).exp();
        let weight = 2.0 / ((2 * k - 1) as f64 * PI);
        if k <= terms {
            (attenuation * weight) as f32
        } else {
            0.0
        }
    };
    let four = |first: usize| Vec4::from_array([0, 1, 2, 3].map(|k| weight(first + k)));
    Series {
        low: four(1),
        high: four(5),
    }
}

fn add(
    graph: &mut Graph,
    given: &Given,
    terms: usize,
    make: &str,
    shade: &'static str,
) -> Result<Handle> {
    let series = graph.constant("series", &series(terms));
    let kernel = format!("{make}_{}", given.shadow.map.format.name());
    let maps = filtered_maps(graph, given, &kernel, &TEXTURES[..terms / 2])?;
    shade_filtered(graph, given, shade, &maps, |pass| {
        pass.arg("series", series)
    })
}
