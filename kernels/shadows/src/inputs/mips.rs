//! Maps with mip levels, and the pixels that look at them. All pixels of a run have the same footprint, because
//! some drivers take the level of a few neighbouring pixels from the first of them.

use std::vec;
use std::vec::Vec;

use hankel_dsl::glam::{Vec3, Vec4};
use hankel_dsl::native::describe::TexelFormat;
use hankel_dsl::native::inputs::{Given, Request, Source};
use hankel_moments::bias::{
    Bias, SYMMETRIC_4_32, SYMMETRIC_6_16, SYMMETRIC_6_32, TRIGONOMETRIC_2_16, TRIGONOMETRIC_2_32,
};
use hankel_moments::{Moments6, TrigonometricMoments, quantize_symmetric_6};

use super::maps::{self, EXPONENTS, SIZE};
use crate::depth::Transform;
use crate::mips::Raster;
use crate::shade::encoding;
use crate::trigonometric;

/// Maps of which the next level has as many texels as a run: of even sizes and of odd ones.
#[must_use]
pub fn halved(_: &Request) -> Vec<Given> {
    let [width, height] = SIZE.map(|n| 2 * n);
    [
        ("even sizes", width, height),
        ("odd sizes", width + 1, height + 1),
    ]
    .into_iter()
    .map(|(what, width, height)| {
        let texels = (0..width * height).map(|i| {
            let middle = |i: u32, n: u32| (f64::from(i) + 0.5) / f64::from(n);
            let z = maps::depth(middle(i % width, width), middle(i / width, height));
            let powers = [z, z * z, z * z * z, z * z * z * z];
            Vec4::from_array(powers.map(|x| x as f32))
        });
        let format = TexelFormat::Rgba32Float;
        Given::new(what).texture("source", [width, height], 1, format, texels)
    })
    .collect()
}

/// Weights of what a texel of the next level covers.
fn shares(at: usize, size: usize) -> Vec<(usize, f64)> {
    let half = (size / 2) as f64;
    let taps = if size.is_multiple_of(2) {
        [0.5, 0.5, 0.0]
    } else {
        [half - at as f64, half, at as f64 + 1.0].map(|part| part / size as f64)
    };
    let taps = taps.into_iter().enumerate();
    taps.map(|(i, w)| ((2 * at + i).min(size - 1), w)).collect()
}

/// A map's texels, and those of all of its other levels.
fn levels<const N: usize>(mut map: Vec<[f64; N]>) -> (u32, Vec<[f64; N]>) {
    let [mut width, mut height] = SIZE.map(|n| n as usize);
    let (mut first, mut count) = (0, 1);
    while width.max(height) > 1 {
        let [columns, rows] = [width, height].map(|n| (n / 2).max(1));
        let next = map.len();
        for y in 0..rows {
            for x in 0..columns {
                let mut sum = [0.0; N];
                for (j, down) in shares(y, height) {
                    for (i, across) in shares(x, width) {
                        let texel = map[first + j * width + i];
                        for (sum, x) in sum.iter_mut().zip(texel) {
                            *sum += down * across * x;
                        }
                    }
                }
                map.push(sum);
            }
        }
        (first, width, height) = (next, columns, rows);
        count += 1;
    }
    (count, map)
}

/// A way to look at the map, of which world-space x and z are the coordinates and y is the depth.
struct Look {
    what: &'static str,
    camera: Transform,
    raster: Raster,
    /// The normal of the surface.
    plane: Vec3,
}

/// Without perspective: rows of clip-space x and y.
fn look(what: &'static str, x: Vec4, y: Vec4, [width, height]: [f32; 2], anisotropy: f32) -> Look {
    Look {
        what,
        camera: Transform {
            row_x: x,
            row_y: y,
            row_z: Vec4::new(0.0, 0.4, 0.1, 0.2),
            row_w: Vec4::W,
        },
        raster: Raster {
            width,
            height,
            anisotropy,
        },
        plane: Vec3::new(0.2, -0.9, 0.15),
    }
}

fn looks() -> [Look; 5] {
    let (x, z) = (
        Vec4::new(1.0, 0.0, 0.0, -0.4),
        Vec4::new(0.0, 0.0, 1.0, -0.5),
    );
    // Turned, and from a side.
    let (turned, flat) = (
        Vec4::new(0.8, 0.1, -0.6, 0.1),
        Vec4::new(0.1, 1.1, 0.15, -0.8),
    );
    [
        look("near", x, z, [4096.0, 2048.0], 4.0),
        look("far, trilinear", x, z, [24.0, 31.0], 1.0),
        look("from a side, trilinear", turned, flat, [150.0, 120.0], 1.0),
        look("from a side, 4 to 1", turned, flat, [150.0, 120.0], 4.0),
        look("from a side, 16 to 1", turned, flat, [90.0, 160.0], 16.0),
    ]
}

/// A map of four channels.
const MAP: [(&str, TexelFormat); 1] = [("map", TexelFormat::Rgba32Float)];

/// What shading with maps of what `of` gives for a depth from 0 to 1 reads, with the bias as published and ten
/// times as strong. `store` makes texels of that, for each texture by its number.
fn with_levels<const N: usize>(
    request: &Request,
    bias: &Bias,
    strength: f32,
    of: impl Fn(f64) -> [f64; N],
    textures: &[(&str, TexelFormat)],
    store: impl Fn(usize, [f64; N]) -> Vec4,
) -> Vec<Given> {
    let mut s = Source::new(request.seed);
    let (count, map) = levels(maps::filtered(of));
    let looks = looks().into_iter().enumerate();
    looks
        .map(|(i, look)| {
            let (moment_bias, depth_bias) = match i % 2 {
                0 => (strength, 1e-3),
                _ => (10.0 * strength, 0.0),
            };
            let light = maps::light(bias, moment_bias, depth_bias, 1);
            let given = maps::fragments_and_light(&mut s, look.what, &light)
                .buffer("plane", &vec![look.plane; maps::FRAGMENTS])
                .uniform("camera", &look.camera)
                .uniform("raster", &look.raster);
            let textures = textures.iter().enumerate();
            textures.fold(given, |given, (i, (name, format))| {
                let texels = map.iter().map(|m| store(i, *m));
                let [width, height] = SIZE;
                given.levels(name, [width, height, 1], count, 1, *format, texels)
            })
        })
        .collect()
}

/// Floats as they are.
fn plain(m: [f64; 4]) -> Vec4 {
    Vec4::from_array(m.map(|x| x as f32))
}

/// As a map holds them: floats, or 16 bits from 0 to 1.
fn stored(is_plain: bool, m: [f64; 4]) -> Vec4 {
    if is_plain { plain(m) } else { maps::unorm(m) }
}

/// What shading with a map of moments reads, for the map's `encoding`.
#[must_use]
pub fn shaded(request: &Request) -> Vec<Given> {
    shaded_with(request, maps::published)
}

/// The same for the Hausdorff problem.
#[must_use]
pub fn shaded_in_range(request: &Request) -> Vec<Given> {
    shaded_with(request, maps::measured_in_range)
}

fn shaded_with(request: &Request, bias: impl Fn(u32) -> Bias) -> Vec<Given> {
    let how = request.constant("encoding").unwrap_or(encoding::SYMMETRIC);
    let bias = bias(how);
    let strength = bias.strength as f32;
    let of = |z| maps::channels(how, z);
    let store = |_, m| stored(how == encoding::PLAIN, m);
    with_levels(request, &bias, strength, of, &MAP, store)
}

/// What shading with a variance shadow map reads, for its `encoding`.
#[must_use]
pub fn shaded_variance(request: &Request) -> Vec<Given> {
    let how = request.constant("encoding").unwrap_or(encoding::SYMMETRIC);
    let bias = maps::published(how);
    let strength = bias.strength as f32;
    let of = |z| maps::two(how, z);
    let store = |_, m| maps::stored_two(how, m);
    with_levels(request, &bias, strength, of, &MAP, store)
}

/// What shading with maps of six moments reads, for their `encoding`.
#[must_use]
pub fn shaded_6(request: &Request) -> Vec<Given> {
    let is_plain = request.constant("encoding") == Some(encoding::PLAIN);
    let bias = if is_plain {
        SYMMETRIC_6_32
    } else {
        SYMMETRIC_6_16
    };
    let of = |z| {
        let m = Moments6::of_depth(2.0 * z - 1.0);
        let q = quantize_symmetric_6(m);
        if is_plain {
            [m.b1, m.b3, m.b5, m.b2, m.b4, m.b6]
        } else {
            [q.r0, q.g0, q.b0, q.r1, q.g1, q.b1]
        }
    };
    let textures = ["first", "second"].map(|name| (name, TexelFormat::Rgba32Float));
    let store =
        |i: usize, m: [f64; 6]| stored(is_plain, [m[3 * i], m[3 * i + 1], m[3 * i + 2], 0.0]);
    let strength = bias.strength as f32;
    let given = with_levels(request, &bias, strength, of, &textures, store).into_iter();
    given.map(|g| g.uniform("target", &bias.six())).collect()
}

fn shaded_moments(request: &Request, count: usize) -> Vec<Given> {
    let bias = maps::float_bias(count);
    let many = maps::many(count);
    let textures: Vec<_> = many
        .iter()
        .map(|(name, _)| (*name, TexelFormat::Rgba32Float))
        .collect();
    let store = |i: usize, m: [f64; 12]| plain(many[i].1.map(|k| m[k]));
    let of = |z| maps::powers(count, z);
    with_levels(request, &bias, bias.strength as f32, of, &textures, store)
}

/// What shading with a map of four moments in floats reads.
#[must_use]
pub fn moments_4(request: &Request) -> Vec<Given> {
    shaded_moments(request, 4)
}

/// What shading with maps of six moments in floats reads.
#[must_use]
pub fn moments_6(request: &Request) -> Vec<Given> {
    shaded_moments(request, 6)
}

/// What shading with maps of eight moments in floats reads.
#[must_use]
pub fn moments_8(request: &Request) -> Vec<Given> {
    shaded_moments(request, 8)
}

/// What shading with maps of ten moments in floats reads.
#[must_use]
pub fn moments_10(request: &Request) -> Vec<Given> {
    shaded_moments(request, 10)
}

fn convolution(request: &Request, count: usize) -> Vec<Given> {
    let textures: Vec<_> = maps::TERMS[..count / 2]
        .iter()
        .map(|name| (*name, TexelFormat::Rgba32Float))
        .collect();
    let store = |i: usize, m: [f64; 16]| stored(false, core::array::from_fn(|k| m[4 * i + k]));
    with_levels(request, &SYMMETRIC_4_32, 0.0, maps::terms, &textures, store)
        .into_iter()
        .map(|given| given.uniform("series", &maps::series(count)))
        .collect()
}

/// What shading with a convolution shadow map of four terms reads.
#[must_use]
pub fn shaded_convolution(request: &Request) -> Vec<Given> {
    convolution(request, 4)
}

/// What shading with a convolution shadow map of eight terms reads.
#[must_use]
pub fn shaded_convolution_8(request: &Request) -> Vec<Given> {
    convolution(request, 8)
}

/// What shading with a map of trigonometric moments reads, for the map's `encoding`.
#[must_use]
pub fn shaded_trigonometric(request: &Request) -> Vec<Given> {
    let is_plain = request.constant("encoding") == Some(trigonometric::encoding::PLAIN);
    let bias = if is_plain {
        TRIGONOMETRIC_2_32
    } else {
        TRIGONOMETRIC_2_16
    };
    let of = |z| {
        let m = TrigonometricMoments::of_depth(z);
        let m = [m.c1, m.s1, m.c2, m.s2];
        if is_plain {
            m
        } else {
            m.map(|x| 0.5 * x + 0.5)
        }
    };
    let store = |_, m| stored(is_plain, m);
    with_levels(request, &bias, bias.strength as f32, of, &MAP, store)
}

/// What shading with an exponential shadow map reads.
#[must_use]
pub fn shaded_exponential(request: &Request) -> Vec<Given> {
    let runs = [10.0_f32, 80.0].into_iter().flat_map(|exponent| {
        let map = [("map", TexelFormat::R32Float)];
        let of = |z| [f64::exp(f64::from(exponent) * z)];
        let store = |_, [x]: [f64; 1]| Vec4::new(x as f32, 0.0, 0.0, 0.0);
        let given = with_levels(request, &SYMMETRIC_4_32, 0.0, of, &map, store);
        given
            .into_iter()
            .map(move |given| given.uniform("exponent", &exponent))
    });
    runs.collect()
}

/// What shading with an exponential variance shadow map reads.
#[must_use]
pub fn shaded_warps(request: &Request) -> Vec<Given> {
    let runs = EXPONENTS.into_iter().flat_map(|(_, exponents, variance)| {
        let of = |z| maps::warps(&exponents, z);
        let store = |_, m| plain(m);
        let given = with_levels(request, &SYMMETRIC_4_32, variance, of, &MAP, store);
        given
            .into_iter()
            .map(move |given| given.uniform("exponents", &exponents))
    });
    runs.collect()
}
