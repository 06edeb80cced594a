//! What soft shadows read: summed-area tables of the small scene of [`maps`], and lights of several
//! sizes.

use std::vec::Vec;

use hankel_dsl::glam::{UVec2, Vec2, Vec4};
use hankel_dsl::native::describe::TexelFormat;
use hankel_dsl::native::inputs::{Given, Request, Source};
use hankel_moments::bias::{SYMMETRIC_4_16_LECTURE, SYMMETRIC_6_16};
use hankel_moments::{FixedPoint, Moments4, Moments6, quantize_symmetric_4, quantize_symmetric_6};

use super::maps::{self, SAMPLES, SIZE};
use crate::soft::{Area, Lines};

/// Lights from hardly more than a point to one whose penumbrae fill half of the map, the second and the third
/// spot lights.
fn areas() -> [Area; 3] {
    [(0.5_f32, 0.0), (6.0, 0.4), (30.0, 0.9)].map(|(spread, narrowing)| Area {
        spread: Vec2::new(spread, 0.6 * spread),
        slack: 0.1,
        margin: 0.05,
        one: FixedPoint::for_kernel((2.0 * spread + 2.0) as u32 * (1.2 * spread + 2.0) as u32).one,
        narrowing,
    })
}

/// The integers of the map's texels, whose channels `of` gives for a depth in [-1, 1].
fn texels<const N: usize>(one: u32, of: impl Fn(f64) -> [f64; N]) -> Vec<[u32; N]> {
    let depths = maps::samples();
    let texel = |samples: &[f64]| {
        let mut mean = [0.0; N];
        for z in samples {
            for (mean, x) in mean.iter_mut().zip(of(2.0 * z - 1.0)) {
                *mean += x / SAMPLES as f64;
            }
        }
        mean.map(|x| (x.clamp(0.0, 1.0) * f64::from(one)).round() as u32)
    };
    depths.chunks_exact(SAMPLES).map(texel).collect()
}

/// Four moments.
fn four(z: f64) -> [f64; 4] {
    let q = quantize_symmetric_4(Moments4::of_depth(z));
    [q.r, q.g, q.b, q.a]
}

/// Six.
fn six(z: f64) -> [f64; 6] {
    let q = quantize_symmetric_6(Moments6::of_depth(z));
    [q.r0, q.g0, q.b0, q.r1, q.g1, q.b1]
}

/// The summed-area table of texels.
fn summed<const N: usize>(mut sums: Vec<[u32; N]>) -> Vec<[u32; N]> {
    let width = SIZE[0] as usize;
    for i in 0..sums.len() {
        let before = |there: bool, back: usize| if there { sums[i - back] } else { [0; N] };
        let (left, above) = (i % width > 0, i >= width);
        let others = [before(left, 1), before(above, width)];
        let both = before(left && above, width + 1);
        for (k, both) in both.into_iter().enumerate() {
            sums[i][k] = sums[i][k]
                .wrapping_add(others[0][k])
                .wrapping_add(others[1][k])
                .wrapping_sub(both);
        }
    }
    sums
}

/// Tables whose rows, or columns, are to be summed up: of a map, and of any integers, in lines that the
/// workgroup has fewer and more parts than.
fn tables<const N: usize>(request: &Request, of_map: &[[u32; N]]) -> Vec<Given> {
    let mut s = Source::new(request.seed);
    let [width, height] = SIZE;
    let mut any = |count: u32| {
        let mut element = || [0; N].map(|_: u32| s.bits() as u32);
        (0..count).map(|_| element()).collect::<Vec<_>>()
    };
    let lines = |count: u32, length: u32, across: u32| Lines {
        invocations: 64 * count,
        length,
        across,
        padding: 0,
    };
    [
        ("rows of a map", lines(height, width, 0), of_map.to_vec()),
        ("columns of a map", lines(width, height, 1), of_map.to_vec()),
        ("long rows", lines(5, 331, 0), any(5 * 331)),
        ("long columns", lines(7, 192, 1), any(7 * 192)),
        ("one row of one", lines(1, 1, 0), any(1)),
    ]
    .into_iter()
    .map(|(what, lines, table)| {
        Given::new(what)
            .uniform("lines", &lines)
            .buffer("table", table.as_flattened())
    })
    .collect()
}

/// Tables of four moments, to be summed up.
#[must_use]
pub fn table(request: &Request) -> Vec<Given> {
    tables(request, &texels(FixedPoint::for_kernel(300).one, four))
}

/// Tables of six moments, to be summed up.
#[must_use]
pub fn table_6(request: &Request) -> Vec<Given> {
    tables(request, &texels(FixedPoint::for_kernel(300).one, six))
}

/// Depths of several samples, and a fixed point.
#[must_use]
pub fn resolved(request: &Request) -> Vec<Given> {
    let all = areas().into_iter().flat_map(|area| {
        let given = maps::depths(request).into_iter();
        given.map(move |given| {
            given
                .uniform("size", &UVec2::from_array(SIZE))
                .uniform("area", &area)
        })
    });
    all.collect()
}

/// Fragments and lights: `of` adds what a technique looks up.
fn shaded_by(request: &Request, moment_bias: f32, of: impl Fn(Given, Area) -> Given) -> Vec<Given> {
    let mut s = Source::new(request.seed);
    areas()
        .into_iter()
        .map(|area| {
            let [world, normals, colours] = maps::fragments(&mut s);
            let bias = SYMMETRIC_4_16_LECTURE;
            let given = Given::new("a light with an area")
                .buffer("world", &world)
                .buffer("normal", &normals)
                .buffer("colour", &colours)
                .uniform("light", &maps::light(&bias, moment_bias, 1e-3, 1))
                .uniform("area", &area);
            of(given, area)
        })
        .collect()
}

/// What moment soft shadow mapping reads.
#[must_use]
pub fn shaded(request: &Request) -> Vec<Given> {
    shaded_by(request, 2e-5, |given, area| {
        let table = summed(texels(area.one, four));
        given
            .uniform("size", &UVec2::from_array(SIZE))
            .buffer("table", table.as_flattened())
    })
}

/// What moment soft shadow mapping reads with six moments.
#[must_use]
pub fn shaded_6(request: &Request) -> Vec<Given> {
    shaded_by(request, 5e-5, |given, area| {
        let table = summed(texels(area.one, six));
        given
            .uniform("size", &UVec2::from_array(SIZE))
            .uniform("target", &SYMMETRIC_6_16.six())
            .buffer("table", table.as_flattened())
    })
}

/// What variance soft shadow mapping reads.
#[must_use]
pub fn shaded_parts(request: &Request) -> Vec<Given> {
    shaded(request).into_iter().map(with_depths).collect()
}

/// Depths of several samples.
fn with_depths(given: Given) -> Given {
    let texels = maps::samples();
    let texels = texels.iter().map(|&z| Vec4::new(z as f32, 0.0, 0.0, 0.0));
    given.texture("depth", SIZE, SAMPLES as u32, TexelFormat::R32Float, texels)
}

/// What percentage-closer soft shadows read.
#[must_use]
pub fn searched(request: &Request) -> Vec<Given> {
    let points = |count: u32| {
        let part = |i: u32, step: f64| 2.0 * (f64::from(i) * step + 0.5).fract() - 1.0;
        (0..count)
            .map(|i| Vec2::new(part(i, 0.754_877_67) as f32, part(i, 0.569_840_3) as f32))
            .collect::<Vec<_>>()
    };
    shaded_by(request, 0.0, |given, _| {
        with_depths(
            given
                .buffer("search", &points(16))
                .buffer("filter", &points(31)),
        )
    })
}
