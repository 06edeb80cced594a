//! Shadow maps of a small scene, as the frame's passes make them: depths of a plane with boxes and
//! a slanted wall, four samples in each texel; their moments, filtered and stored; and fragments on
//! what casts and receives the shadows.

use std::vec::Vec;

use hankel_dsl::glam::{IVec2, Vec2, Vec3, Vec4};
use hankel_dsl::native::describe::TexelFormat;
use hankel_dsl::native::inputs::{Given, Request, Source, Value};
use hankel_dsl::native::{Address, Filter, Sampler};
use hankel_moments::bias::{
    Bias, CLAMPED_4_16, HAUSDORFF_SYMMETRIC_4_16, HAUSDORFF_SYMMETRIC_4_32, HAUSDORFF_UNIT_4_16,
    MEASURED, SYMMETRIC_4_16, SYMMETRIC_4_32, SYMMETRIC_6_16, SYMMETRIC_6_32, SYMMETRIC_8_32,
    SYMMETRIC_10_32, TRIGONOMETRIC_2_16, TRIGONOMETRIC_2_32,
};
use hankel_moments::{
    Moments4, Moments6, OddHarmonics, TrigonometricMoments, from_unorm, pack_10, pack_16,
    quantize_symmetric_4, quantize_symmetric_6, quantize_unit_4, to_unorm,
};

use crate::blur::Taps;
use crate::convolution::Series;
use crate::exponential::Exponents;
use crate::shade::{Light, encoding};
use crate::trigonometric;

/// Texels of a map.
pub(super) const SIZE: [u32; 2] = [61, 37];
/// Samples of a texel.
pub(super) const SAMPLES: usize = 4;
/// Fragments of a run.
pub(super) const FRAGMENTS: usize = 1009;

/// The boxes' ends along u and v, and their depths.
const BOXES: [[f64; 5]; 4] = [
    [0.1, 0.35, 0.2, 0.6, 0.3],
    [0.3, 0.5, 0.4, 0.9, 0.5],
    [0.6, 0.62, 0.1, 0.95, 0.2],
    [0.7, 0.95, 0.15, 0.4, 0.62],
];

/// The depth that the light sees at a place of the map, from 0 to 1.
pub(super) fn depth(u: f64, v: f64) -> f64 {
    let ground = 0.75 + 0.2 * v;
    let wall = if u > 0.8 { 0.45 + 0.5 * (1.0 - u) } else { 1.0 };
    let mut nearest = f64::min(ground, wall);
    for [left, right, top, bottom, depth] in BOXES {
        if (left..right).contains(&u) && (top..bottom).contains(&v) {
            nearest = nearest.min(depth);
        }
    }
    nearest
}

/// Depths of the samples of each texel, together.
pub(super) fn samples() -> Vec<f64> {
    // Where 4x multisampling looks, in sixteenths of a texel.
    const AT: [[f64; 2]; SAMPLES] = [[6.0, 2.0], [14.0, 6.0], [2.0, 10.0], [10.0, 14.0]];
    let [width, height] = SIZE;
    let mut all = Vec::new();
    for y in 0..height {
        for x in 0..width {
            all.extend(AT.map(|[dx, dy]| {
                depth(
                    (f64::from(x) + dx / 16.0) / f64::from(width),
                    (f64::from(y) + dy / 16.0) / f64::from(height),
                )
            }));
        }
    }
    all
}

/// How a map holds moments, and the bias that is published for it.
pub(super) fn published(how: u32) -> Bias {
    match how {
        encoding::UNIT => CLAMPED_4_16,
        encoding::SYMMETRIC => SYMMETRIC_4_16,
        _ => SYMMETRIC_4_32,
    }
}

/// How a map holds moments, and the bias for the Hausdorff problem.
pub(super) fn measured_in_range(how: u32) -> Bias {
    match how {
        encoding::UNIT => HAUSDORFF_UNIT_4_16,
        encoding::SYMMETRIC => HAUSDORFF_SYMMETRIC_4_16,
        _ => HAUSDORFF_SYMMETRIC_4_32,
    }
}

/// The mean of what `of` gives for the depths of each texel, filtered over 3 x 3 texels.
pub(super) fn filtered<const N: usize>(of: impl Fn(f64) -> [f64; N]) -> Vec<[f64; N]> {
    let all = samples();
    let [width, height] = SIZE.map(|n| n as i32);
    let plus = |sum: &mut [f64; N], w: f64, with: [f64; N]| {
        for (sum, x) in sum.iter_mut().zip(with) {
            *sum += w * x;
        }
    };
    let texel = |x: i32, y: i32| {
        let i = (y.clamp(0, height - 1) * width + x.clamp(0, width - 1)) as usize * SAMPLES;
        let mut sum = [0.0; N];
        for z in &all[i..i + SAMPLES] {
            plus(&mut sum, 1.0 / SAMPLES as f64, of(*z));
        }
        sum
    };
    let mut map = Vec::new();
    for y in 0..height {
        for x in 0..width {
            let mut sum = [0.0; N];
            for dy in -1..=1 {
                for dx in -1..=1_i32 {
                    let weight = |d: i32| if d == 0 { 0.5 } else { 0.25 };
                    plus(&mut sum, weight(dx) * weight(dy), texel(x + dx, y + dy));
                }
            }
            map.push(sum);
        }
    }
    map
}

/// A depth's four channels in a map that is stored as `how` says, before they are rounded.
pub(super) fn channels(how: u32, z: f64) -> [f64; 4] {
    let z = if how == encoding::UNIT {
        z
    } else {
        2.0 * z - 1.0
    };
    let m = Moments4::of_depth(z);
    let q = match how {
        encoding::UNIT => quantize_unit_4(m),
        encoding::SYMMETRIC => quantize_symmetric_4(m),
        _ => return [m.b1, m.b2, m.b3, m.b4],
    };
    [q.r, q.g, q.b, q.a]
}

/// The texels of a map of four moments, stored as `how` says.
pub(super) fn texels(how: u32) -> Vec<Vec4> {
    let map = filtered(|z| {
        let z = match how {
            encoding::UNIT => z,
            _ => 2.0 * z - 1.0,
        };
        let m = Moments4::of_depth(z);
        [m.b1, m.b2, m.b3, m.b4]
    });
    let moments = map
        .iter()
        .map(|&[b1, b2, b3, b4]| Moments4 { b1, b2, b3, b4 });
    moments.map(|m| stored(how, m)).collect()
}

/// What is left of numbers in 16 bits from 0 to 1.
pub(super) fn unorm(channels: [f64; 4]) -> Vec4 {
    let channel = |x: f64| from_unorm::<f64, 16>(to_unorm::<f64, 16>(x)) as f32;
    Vec4::from_array(channels.map(channel))
}

/// Moments as a map stores them: 16 bits in the optimised basis, or floats.
fn stored(how: u32, m: Moments4<f64>) -> Vec4 {
    let q = match how {
        encoding::UNIT => quantize_unit_4(m),
        encoding::SYMMETRIC => quantize_symmetric_4(m),
        _ => return Vec4::new(m.b1 as f32, m.b2 as f32, m.b3 as f32, m.b4 as f32),
    };
    unorm([q.r, q.g, q.b, q.a])
}

/// A light whose map's coordinates are the world's x and z, each from 0 to 1, and whose depth is y.
pub(super) fn light(bias: &Bias, moment_bias: f32, depth_bias: f32, radius: u32) -> Light {
    let target = bias.four();
    Light {
        row_u: Vec4::new(1.0, 0.0, 0.0, 0.0),
        row_v: Vec4::new(0.0, 0.0, 1.0, 0.0),
        row_depth: Vec4::new(0.0, 1.0, 0.0, 0.0),
        row_w: Vec4::W,
        position: Vec4::new(0.36, -0.8, 0.48, 0.0),
        colour: Vec3::new(2.5, 2.0, 1.5),
        falloff: 0.0,
        cone: Vec4::W,
        ambient: Vec4::new(0.1, 0.12, 0.15, 0.0),
        bias_target: Vec4::new(target.b1, target.b2, target.b3, target.b4),
        moment_bias,
        depth_bias,
        light_leak: 0.02,
        filter_radius: radius,
    }
}

/// The same map as a spot light has one: above its middle, with a cone that fades within it, and everything divided
/// by 2, which is exact.
pub(super) fn spot(light: &Light) -> Light {
    Light {
        row_u: light.row_u * 2.0,
        row_v: light.row_v * 2.0,
        row_depth: light.row_depth * 2.0,
        row_w: Vec4::W * 2.0,
        position: Vec4::new(0.5, -1.0, 0.5, 1.0),
        falloff: 1.0,
        cone: Vec4::new(0.0, 8.0, 0.0, -7.0),
        depth_bias: light.depth_bias * 4.0,
        ..*light
    }
}

/// Fragments on the surfaces of the scene, just before and behind them, in the shadows of the boxes,
/// and beyond the map.
pub(super) fn fragments(s: &mut Source) -> [Vec<Vec3>; 3] {
    let (mut world, mut normals, mut colours) = (Vec::new(), Vec::new(), Vec::new());
    for _ in 0..FRAGMENTS {
        let (u, v) = match s.count(0, 7) {
            0 => (s.between(-0.3, 1.3), s.between(-0.3, 1.3)),
            // Along an edge of a box.
            1 => {
                let [left, right, top, bottom, _] = s.pick(&BOXES);
                (
                    s.pick(&[left, right]) + s.between(-0.03, 0.03),
                    s.between(top, bottom),
                )
            }
            _ => (s.between(0.0, 1.0), s.between(0.0, 1.0)),
        };
        let ground = 0.75 + 0.2 * v;
        let z = match s.count(0, 4) {
            0 => depth(u, v),
            1 => depth(u, v) + s.sign() * s.magnitude(-5.0, -2.0),
            2 => s.between(0.0, 1.0),
            _ => ground,
        };
        world.push(Vec3::new(u as f32, z as f32, v as f32));
        let n = Vec3::new(s.normal() as f32, s.normal() as f32, s.normal() as f32);
        let up = Vec3::new(0.0, -1.0, 0.0);
        normals.push(if n.length() > 1e-3 { n.normalize() } else { up });
        let mut channel = || s.between(0.0, 1.0) as f32;
        colours.push(Vec3::new(channel(), channel(), channel()));
    }
    [world, normals, colours]
}

/// Fragments and a light.
fn fragments_in_light(s: &mut Source, what: &str, light: &Light) -> Given {
    let [world, normals, colours] = fragments(s);
    Given::new(what)
        .buffer("world", &world)
        .buffer("normal", &normals)
        .buffer("colour", &colours)
        .uniform("light", light)
}

/// What shading reads beside a map: fragments, light and sampler.
pub(super) fn fragments_and_light(s: &mut Source, what: &str, light: &Light) -> Given {
    fragments_in_light(s, what, light).sampler(
        "sampler",
        Sampler::new(Filter::Linear, Address::ClampToEdge),
    )
}

/// A map of floats.
pub(super) fn with_map(given: Given, name: &str, map: &[Vec4]) -> Given {
    let texels = map.iter().copied();
    given.texture(name, SIZE, 1, TexelFormat::Rgba32Float, texels)
}

/// The same with the published bias and a depth bias, with ten times that strength and none, and with the
/// published bias and a spot light. With a sampler, if there are `maps` for it.
pub(super) fn with_bias(request: &Request, bias: &Bias, maps: &[(&str, Vec<Vec4>)]) -> Vec<Given> {
    let mut s = Source::new(request.seed);
    let strength = bias.strength as f32;
    [
        ("a map's bias as published", strength, 1e-3, false),
        ("ten times the published bias", 10.0 * strength, 0.0, false),
        ("a spot light", strength, 1e-3, true),
    ]
    .into_iter()
    .map(|(what, moment_bias, depth_bias, is_spot)| {
        let light = light(bias, moment_bias, depth_bias, 1);
        let light = if is_spot { spot(&light) } else { light };
        let given = if maps.is_empty() {
            fragments_in_light(&mut s, what, &light)
        } else {
            fragments_and_light(&mut s, what, &light)
        };
        maps.iter()
            .fold(given, |given, (name, map)| with_map(given, name, map))
    })
    .collect()
}

/// What shading with a map of moments reads, for the map's `encoding`.
#[must_use]
pub fn shaded(request: &Request) -> Vec<Given> {
    let how = request.constant("encoding").unwrap_or(encoding::SYMMETRIC);
    with_bias(request, &published(how), &[("map", texels(how))])
}

/// A depth's two moments in a variance shadow map, which is stored as `how` says.
pub(super) fn two(how: u32, z: f64) -> [f64; 2] {
    let x = if how == encoding::UNIT {
        z
    } else {
        2.0 * z - 1.0
    };
    let first = if how == encoding::SYMMETRIC { z } else { x };
    [first, x * x]
}

/// What shading with a variance shadow map reads, for its `encoding`.
#[must_use]
pub fn shaded_variance(request: &Request) -> Vec<Given> {
    let how = request.constant("encoding").unwrap_or(encoding::SYMMETRIC);
    let map = filtered(|z| two(how, z));
    let texels = map.iter().map(|m| stored_two(how, *m));
    with_bias(request, &published(how), &[("map", texels.collect())])
}

/// Two moments as a map stores them: 16 bits, or floats.
pub(super) fn stored_two(how: u32, [first, second]: [f64; 2]) -> Vec4 {
    match how {
        encoding::PLAIN => Vec4::new(first as f32, second as f32, 0.0, 1.0),
        _ => unorm([first, second, 0.0, 1.0]),
    }
}

/// The same for the Hausdorff problem.
#[must_use]
pub fn shaded_in_range(request: &Request) -> Vec<Given> {
    let how = request.constant("encoding").unwrap_or(encoding::SYMMETRIC);
    with_bias(request, &measured_in_range(how), &[("map", texels(how))])
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
    let map = filtered(|z| {
        let m = Moments6::of_depth(2.0 * z - 1.0);
        let q = quantize_symmetric_6(m);
        if is_plain {
            [m.b1, m.b3, m.b5, m.b2, m.b4, m.b6]
        } else {
            [q.r0, q.g0, q.b0, q.r1, q.g1, q.b1]
        }
    });
    let texture = |first: usize| {
        let texels = map.iter().map(|m| {
            let channels = [m[first], m[first + 1], m[first + 2], 0.0];
            if is_plain {
                Vec4::from_array(channels.map(|x| x as f32))
            } else {
                unorm(channels)
            }
        });
        texels.collect::<Vec<_>>()
    };
    let maps = [("first", texture(0)), ("second", texture(3))];
    let given = with_bias(request, &bias, &maps).into_iter();
    given.map(|g| g.uniform("target", &bias.six())).collect()
}

/// What shading with a map of trigonometric moments reads, for the map's `encoding`.
#[must_use]
pub fn shaded_trigonometric(request: &Request) -> Vec<Given> {
    let is_plain = request.constant("encoding") == Some(trigonometric::encoding::PLAIN);
    let map = filtered(|z| {
        let m = TrigonometricMoments::of_depth(z);
        let m = [m.c1, m.s1, m.c2, m.s2];
        if is_plain {
            m
        } else {
            m.map(|x| 0.5 * x + 0.5)
        }
    });
    let bias = if is_plain {
        TRIGONOMETRIC_2_32
    } else {
        TRIGONOMETRIC_2_16
    };
    let texels = map.iter().map(|m| {
        if is_plain {
            Vec4::from_array(m.map(|x| x as f32))
        } else {
            unorm(*m)
        }
    });
    with_bias(request, &bias, &[("map", texels.collect())])
}

/// The textures of maps of 4, 6, 8 and 10 moments as they are, and the moment of each channel.
pub(super) fn many(count: usize) -> &'static [(&'static str, [usize; 4])] {
    match count {
        4 => &[("map", [1, 2, 3, 4])],
        10 => &[
            ("first", [1, 3, 5, 7]),
            ("second", [2, 4, 6, 8]),
            ("third", [9, 10, 11, 11]),
        ],
        _ => &[("first", [1, 3, 5, 7]), ("second", [2, 4, 6, 8])],
    }
}

/// Moments 0 to `count` of a depth from 0 to 1, moved to [-1, 1]; those beyond are 0.
pub(super) fn powers(count: usize, z: f64) -> [f64; 12] {
    core::array::from_fn(|k| {
        if k <= count {
            (2.0 * z - 1.0).powi(k as i32)
        } else {
            0.0
        }
    })
}

/// The bias of maps of 4, 6, 8 or 10 moments in floats.
pub(super) fn float_bias(count: usize) -> Bias {
    match count {
        4 => SYMMETRIC_4_32,
        6 => SYMMETRIC_6_32,
        8 => SYMMETRIC_8_32,
        _ => SYMMETRIC_10_32,
    }
}

fn shaded_moments(request: &Request, count: usize) -> Vec<Given> {
    let map = filtered(|z| powers(count, z));
    let maps: Vec<_> = many(count)
        .iter()
        .map(|(name, channels)| {
            let texel = |m: &[f64; 12]| Vec4::from_array(channels.map(|k| m[k] as f32));
            (*name, map.iter().map(texel).collect())
        })
        .collect();
    with_bias(request, &float_bias(count), &maps)
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

/// The textures of convolution shadow maps of eight terms; of four, the first two.
pub(super) const TERMS: [&str; 4] = ["cosines", "sines", "high_cosines", "high_sines"];

/// Cosines and sines of eight terms of a depth from 0 to 1, each from 0 to 1, texture by texture.
pub(super) fn terms(z: f64) -> [f64; 16] {
    let [low, high] = OddHarmonics::of_depth(z);
    let all = [low.cos, low.sin, high.cos, high.sin];
    core::array::from_fn(|i| 0.5 * all[i / 4][i % 4] + 0.5)
}

/// The weights of `count` terms, attenuated as much as convolution shadow maps are.
pub(super) fn series(count: usize) -> Series {
    let weight = |k: usize| {
        let attenuation = f64::exp(-(k as f64 / count as f64).powi(2));
        (2.0 * attenuation / ((2 * k - 1) as f64 * core::f64::consts::PI)) as f32
    };
    let four = |first: usize| Vec4::from_array(core::array::from_fn(|k| weight(first + k)));
    Series {
        low: four(1),
        high: four(5),
    }
}

fn convolution(request: &Request, count: usize) -> Vec<Given> {
    let map = filtered(terms);
    let texture = |i: usize| {
        let texel = |m: &[f64; 16]| unorm(core::array::from_fn(|k| m[4 * i + k]));
        map.iter().map(texel).collect()
    };
    let maps: Vec<_> = (0..count / 2).map(|i| (TERMS[i], texture(i))).collect();
    with_bias(request, &SYMMETRIC_4_32, &maps)
        .into_iter()
        .map(|given| given.uniform("series", &series(count)))
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

/// The warps of a depth for exponential variance shadow maps, and their squares.
pub(super) fn warps(exponents: &Exponents, z: f64) -> [f64; 4] {
    let z = 2.0 * z - 1.0;
    let positive = f64::exp(f64::from(exponents.positive) * z);
    let negative = f64::exp(-f64::from(exponents.negative) * z);
    [positive, positive * positive, negative, negative * negative]
}

/// Six quantised moments in words: two of 10 bits a channel, or three of 16.
fn words(of: impl Fn([Vec3; 2]) -> Vec<u32>) -> Vec<Vec<u32>> {
    let map = filtered(|z| {
        let q = quantize_symmetric_6(Moments6::of_depth(2.0 * z - 1.0));
        [q.r0, q.g0, q.b0, q.r1, q.g1, q.b1]
    });
    let texels = map.iter().map(|m| {
        let [a, b, c, d, e, f] = m.map(|x| x as f32);
        of([Vec3::new(a, b, c), Vec3::new(d, e, f)])
    });
    texels.collect()
}

fn words_10() -> Vec<Vec<u32>> {
    words(|[first, second]| [pack_10(first), pack_10(second)].into())
}

fn words_16() -> Vec<Vec<u32>> {
    words(|[first, second]| {
        let pairs = [
            Vec2::new(first.x, first.y),
            Vec2::new(first.z, second.x),
            Vec2::new(second.y, second.z),
        ];
        pairs.map(pack_16).into()
    })
}

/// Textures of words, each of some of a texel's.
fn with_words(mut given: Given, textures: &[(&str, TexelFormat)], texels: &[Vec<u32>]) -> Given {
    let mut first = 0;
    for (name, format) in textures {
        let words = texels
            .iter()
            .flat_map(|texel| &texel[first..first + format.channels()]);
        let value = Value::Texture {
            size: [SIZE[0], SIZE[1], 1],
            levels: 1,
            layers: 1,
            samples: 1,
            format: *format,
            bytes: words.flat_map(|word| word.to_le_bytes()).collect(),
        };
        given.args.push(((*name).into(), value));
        first += format.channels();
    }
    given
}

const IN_10: [(&str, TexelFormat); 1] = [("map", TexelFormat::Rg32Uint)];
const IN_16: [(&str, TexelFormat); 3] = [
    ("low", TexelFormat::R32Uint),
    ("middle", TexelFormat::R32Uint),
    ("high", TexelFormat::R32Uint),
];

/// What shading with six moments in 10 bits each reads.
#[must_use]
pub fn shaded_10(request: &Request) -> Vec<Given> {
    // The bias that is measured for six moments of depths in [-1, 1] in 10 bits.
    let bias = MEASURED[11].bias;
    let given = with_bias(request, &bias, &[]).into_iter();
    given
        .map(|given| with_words(given.uniform("target", &bias.six()), &IN_10, &words_10()))
        .collect()
}

/// What shading with six moments in 16 bits each reads.
#[must_use]
pub fn shaded_16(request: &Request) -> Vec<Given> {
    let bias = SYMMETRIC_6_16;
    let given = with_bias(request, &bias, &[]).into_iter();
    given
        .map(|given| with_words(given.uniform("target", &bias.six()), &IN_16, &words_16()))
        .collect()
}

/// Six moments in 10 bits each, and the taps of a filter.
#[must_use]
pub fn blurred_10(_: &Request) -> Vec<Given> {
    filters("a map of words", |given| {
        with_words(given, &IN_10, &words_10())
    })
}

/// Six moments in 16 bits each, and the taps of a filter.
#[must_use]
pub fn blurred_16(_: &Request) -> Vec<Given> {
    filters("maps of words", |given| {
        with_words(given, &IN_16, &words_16())
    })
}

/// Exponents for maps of 32 and of 16 bits, and the relative variances that go with them.
pub(super) const EXPONENTS: [(&str, Exponents, f32); 2] = [
    (
        "exponents for 32 bits",
        Exponents {
            positive: 40.0,
            negative: 5.0,
        },
        1.6e-5,
    ),
    (
        "exponents for 16 bits",
        Exponents {
            positive: 5.54,
            negative: 5.54,
        },
        4e-3,
    ),
];

/// What shading with an exponential shadow map reads.
#[must_use]
pub fn shaded_exponential(request: &Request) -> Vec<Given> {
    let mut s = Source::new(request.seed);
    [(10.0_f32, 0.0), (80.0, 1e-3)]
        .into_iter()
        .map(|(exponent, depth_bias)| {
            let map = filtered(|z| [f64::exp(f64::from(exponent) * z)]);
            let light = light(&SYMMETRIC_4_32, 0.0, depth_bias, 1);
            fragments_and_light(&mut s, "an exponential shadow map", &light)
                .uniform("exponent", &exponent)
                .texture(
                    "map",
                    SIZE,
                    1,
                    TexelFormat::R32Float,
                    map.iter().map(|[x]| Vec4::new(*x as f32, 0.0, 0.0, 0.0)),
                )
        })
        .collect()
}

/// What shading with an exponential variance shadow map reads.
#[must_use]
pub fn shaded_warps(request: &Request) -> Vec<Given> {
    let mut s = Source::new(request.seed);
    EXPONENTS
        .into_iter()
        .map(|(what, exponents, variance)| {
            let map = filtered(|z| warps(&exponents, z));
            let map = map.iter().map(|m| Vec4::from_array(m.map(|x| x as f32)));
            let light = light(&SYMMETRIC_4_32, variance, 0.0, 1);
            let given = fragments_and_light(&mut s, what, &light).uniform("exponents", &exponents);
            with_map(given, "map", &map.collect::<Vec<_>>())
        })
        .collect()
}

/// The map of depths, with as many samples in each texel as the kernel's `depth` has.
pub(super) fn with_depth(request: &Request, given: Given) -> Given {
    with_samples(request, given, "depth", &samples())
}

/// A texture of one channel, with as many of these samples in each texel as the kernel's texture of that name has.
pub(super) fn with_samples(request: &Request, given: Given, name: &str, all: &[f64]) -> Given {
    let samples = request.samples(name);
    let texels = all
        .iter()
        .step_by(SAMPLES / samples as usize)
        .map(|&z| Vec4::new(z as f32, 0.0, 0.0, 0.0));
    given.texture(name, SIZE, samples, TexelFormat::R32Float, texels)
}

/// What shading with a map of depths reads.
#[must_use]
pub fn shaded_depths(request: &Request) -> Vec<Given> {
    let mut s = Source::new(request.seed);
    [(0, false), (1, false), (3, false), (1, true)]
        .into_iter()
        .map(|(radius, is_spot)| {
            let light = light(&SYMMETRIC_4_32, 0.0, 1e-3, radius);
            let light = if is_spot { spot(&light) } else { light };
            let given = fragments_in_light(&mut s, "a map of depths", &light);
            with_depth(request, given)
        })
        .collect()
}

/// What shading with a map of depths and a filter reads.
#[must_use]
pub fn weighted_depths(request: &Request) -> Vec<Given> {
    let all = [
        &[1.0_f32][..],
        &[0.5, 0.25],
        &[0.32, 0.24, 0.1],
        &[0.5, 0.25],
    ];
    let given = shaded_depths(request).into_iter().zip(all);
    given
        .map(|(given, weights)| given.uniform("taps", &Taps::new(IVec2::ZERO, weights)))
        .collect()
}

/// A map of depths.
#[must_use]
pub fn depths(request: &Request) -> Vec<Given> {
    [with_depth(request, Given::new("a map of depths"))].into()
}

/// [`depths`], and an exponent.
#[must_use]
pub fn exponential_depths(request: &Request) -> Vec<Given> {
    [10.0_f32, 80.0]
        .iter()
        .flat_map(|exponent| {
            let all = depths(request).into_iter();
            all.map(|given| given.uniform("exponent", exponent))
        })
        .collect()
}

/// [`depths`], and exponents that 16-bit floats have room for.
#[must_use]
pub fn warped_depths(request: &Request) -> Vec<Given> {
    let [_, (_, narrow, _)] = EXPONENTS;
    let half = Exponents {
        positive: 5.0,
        negative: 1.0,
    };
    [narrow, half]
        .iter()
        .flat_map(|exponents| {
            let all = depths(request).into_iter();
            all.map(|given| given.uniform("exponents", exponents))
        })
        .collect()
}

/// A map of moments and the taps of a filter.
#[must_use]
pub fn blurred(_: &Request) -> Vec<Given> {
    with_filter("a map of moments", &texels(encoding::SYMMETRIC))
}

/// A map of warps and the taps of a filter.
#[must_use]
pub fn blurred_warps(_: &Request) -> Vec<Given> {
    let [_, (_, narrow, _)] = EXPONENTS;
    let map = filtered(|z| warps(&narrow, z));
    let map = map.iter().map(|m| Vec4::from_array(m.map(|x| x as f32)));
    with_filter("a map of warps", &map.collect::<Vec<_>>())
}

/// A map, filtered along each axis.
pub(super) fn with_filter(what: &str, map: &[Vec4]) -> Vec<Given> {
    filters(what, |given| with_map(given, "source", map))
}

/// Filters along each axis, of what `with` adds.
fn filters(what: &str, with: impl Fn(Given) -> Given) -> Vec<Given> {
    [(IVec2::X, 0.75_f64), (IVec2::Y, 1.5)]
        .into_iter()
        .map(|(step, sigma)| {
            let raw: Vec<f64> = (0..5)
                .map(|i| (-0.5 * (f64::from(i) / sigma).powi(2)).exp())
                .collect();
            let total = raw[0] + 2.0 * raw[1..].iter().sum::<f64>();
            let weights: Vec<f32> = raw.iter().map(|w| (w / total) as f32).collect();
            with(Given::new(what).uniform("taps", &Taps::new(step, &weights)))
        })
        .collect()
}
