//! What soft shadows read: summed-area tables of the small scene of [`maps`], and lights of several
//! sizes.

use std::vec;
use std::vec::Vec;

use hankel_dsl::glam::{UVec2, Vec2};
use hankel_dsl::native::inputs::{Given, Request, Source};
use hankel_moments::bias::{SYMMETRIC_4_16_LECTURE, SYMMETRIC_6_16};
use hankel_moments::{Moments4, Moments6, quantize_symmetric_4, quantize_symmetric_6};

use super::maps::{self, SAMPLES, SIZE};
use crate::soft::{Area, Halving, Level, POINT, Points, Pyramid, PyramidLines};

/// Lights from hardly more than a point to one whose penumbrae fill half of the map, the second and the third
/// spot lights.
fn areas() -> [Area; 3] {
    [(0.5_f32, 0.0), (6.0, 0.4), (30.0, 0.9)].map(|(spread, narrowing)| Area {
        spread: Vec2::new(spread, 0.6 * spread),
        slack: 0.1,
        margin: 0.05,
        narrowing,
        padding: 0.0,
    })
}

/// The integers of numbers from 0 to 1.
fn fixed<const N: usize>(numbers: [f64; N]) -> [u32; N] {
    numbers.map(|x| (x.clamp(0.0, 1.0) * f64::from(POINT.one)).round() as u32)
}

/// The integers of the map's texels, whose channels `of` gives for a depth in [-1, 1].
fn texels<const N: usize>(of: impl Fn(f64) -> [f64; N]) -> Vec<[u32; N]> {
    let depths = maps::samples();
    let texel = |samples: &[f64]| {
        let mut mean = [0.0; N];
        for z in samples {
            for (mean, x) in mean.iter_mut().zip(of(2.0 * z - 1.0)) {
                *mean += x / SAMPLES as f64;
            }
        }
        fixed(mean)
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
fn summed<const N: usize>(mut sums: Vec<[u32; N]>, width: usize) -> Vec<[u32; N]> {
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

/// Levels of the map's pyramid: more than its size needs, so that several are read.
const LEVELS: u32 = 3;

fn pyramid() -> Pyramid {
    Pyramid {
        size: UVec2::from_array(SIZE),
        levels: LEVELS,
        padding: 0,
    }
}

/// The texels of each level of a pyramid, `far` beyond the map.
fn levels<const N: usize>(base: Vec<[u32; N]>, far: [u32; N]) -> Vec<(Level, Vec<[u32; N]>)> {
    let mut all = vec![(pyramid().base(), base)];
    for (k, level) in pyramid().all().enumerate().skip(1) {
        let (whole, texels) = &all[k - 1];
        let halved = |i: u32| {
            let (x, y) = (2 * (i % level.size.x), 2 * (i / level.size.x));
            let at = |x: u32, y: u32| match x < whole.size.x && y < whole.size.y {
                true => texels[(y * whole.size.x + x) as usize],
                false => far,
            };
            let four = [at(x, y), at(x + 1, y), at(x, y + 1), at(x + 1, y + 1)];
            std::array::from_fn(|c| (four.iter().map(|t| t[c]).sum::<u32>() + 2) / 4)
        };
        let count = level.size.x * level.size.y;
        all.push((level, (0..count).map(halved).collect()));
    }
    all
}

/// The pyramid of the map, whose channels `of` gives for a depth in [-1, 1].
fn tables<const N: usize>(of: impl Fn(f64) -> [f64; N]) -> Vec<[u32; N]> {
    let far = fixed(of(1.0));
    let levels = levels(texels(of), far).into_iter();
    let table = |(level, texels): (Level, _)| summed(texels, level.size.x as usize);
    levels.flat_map(table).collect()
}

/// Pyramids whose rows, or columns, are to be summed up: of a map, and of any integers, in lines that the
/// workgroup has fewer and more parts than.
fn to_sum<const N: usize>(request: &Request, of: impl Fn(f64) -> [f64; N]) -> Vec<Given> {
    let mut s = Source::new(request.seed);
    let mut any = |count: u32| {
        let mut element = || [0; N].map(|_: u32| s.bits() as u32);
        (0..count).map(|_| element()).collect::<Vec<_>>()
    };
    let far = fixed(of(1.0));
    let all = levels(texels(of), far);
    let of_map: Vec<[u32; N]> = all.iter().flat_map(|(_, t)| t.iter().copied()).collect();
    let lines = |of: fn(&Level) -> u32| all.iter().map(|(level, _)| of(level)).sum();
    let sums = |count: u32, size: [u32; 2], across: u32| PyramidLines {
        size: UVec2::from_array(size),
        invocations: 64 * count,
        across,
    };
    [
        (
            "rows of a map",
            sums(lines(|l| l.size.y), SIZE, 0),
            of_map.clone(),
        ),
        (
            "columns of a map",
            sums(lines(|l| l.size.x), SIZE, 1),
            of_map.clone(),
        ),
        ("long rows", sums(5, [331, 5], 0), any(5 * 331)),
        ("long columns", sums(7, [7, 192], 1), any(7 * 192)),
        ("one row of one", sums(1, [1, 1], 0), any(1)),
    ]
    .into_iter()
    .map(|(what, lines, table)| {
        Given::new(what)
            .uniform("lines", &lines)
            .buffer("table", table.as_flattened())
    })
    .collect()
}

/// Pyramids of four moments, to be summed up.
#[must_use]
pub fn table(request: &Request) -> Vec<Given> {
    to_sum(request, four)
}

/// Pyramids of six moments, to be summed up.
#[must_use]
pub fn table_6(request: &Request) -> Vec<Given> {
    to_sum(request, six)
}

/// Pyramids whose levels are to be made, one for each.
fn to_halve<const N: usize>(of: impl Fn(f64) -> [f64; N]) -> Vec<Given> {
    let far = fixed(of(1.0));
    let all = levels(texels(of), far);
    let made = |k: usize| {
        let known = all[..=k]
            .iter()
            .flat_map(|(_, texels)| texels.iter().copied());
        let [(whole, _), (level, texels)] = [&all[k], &all[k + 1]];
        let mut table: Vec<[u32; N]> = known.collect();
        table.resize(table.len() + texels.len(), [0; N]);
        Given::new("a level of a map")
            .uniform(
                "halving",
                &Halving {
                    size: level.size,
                    whole: whole.size,
                    first: whole.first,
                    padding: 0,
                },
            )
            .buffer("table", table.as_flattened())
    };
    (0..all.len() - 1).map(made).collect()
}

/// Pyramids of four moments, whose levels are to be made.
#[must_use]
pub fn halved(_: &Request) -> Vec<Given> {
    to_halve(four)
}

/// Pyramids of six moments, whose levels are to be made.
#[must_use]
pub fn halved_6(_: &Request) -> Vec<Given> {
    to_halve(six)
}

/// Depths, and an empty table of `N` channels.
fn to_resolve<const N: usize>(request: &Request) -> Vec<Given> {
    let empty = vec![[0_u32; N]; (SIZE[0] * SIZE[1]) as usize];
    let given = maps::depths(request).into_iter();
    given
        .map(|given| {
            given
                .uniform("size", &UVec2::from_array(SIZE))
                .buffer("table", empty.as_flattened())
        })
        .collect()
}

/// Depths, for four moments.
#[must_use]
pub fn resolved(request: &Request) -> Vec<Given> {
    to_resolve::<4>(request)
}

/// Depths, for six.
#[must_use]
pub fn resolved_6(request: &Request) -> Vec<Given> {
    to_resolve::<6>(request)
}

/// Fragments and lights: `of` adds what a technique looks up.
fn shaded_by(request: &Request, moment_bias: f32, of: impl Fn(Given) -> Given) -> Vec<Given> {
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
            of(given)
        })
        .collect()
}

/// The pyramid of four moments.
fn with_tables(given: Given) -> Given {
    given
        .uniform("pyramid", &pyramid())
        .buffer("table", tables(four).as_flattened())
}

/// What moment soft shadow mapping reads.
#[must_use]
pub fn shaded(request: &Request) -> Vec<Given> {
    shaded_by(request, 1e-6, with_tables)
}

/// What moment soft shadow mapping reads with six moments.
#[must_use]
pub fn shaded_6(request: &Request) -> Vec<Given> {
    shaded_by(request, 5e-6, |given| {
        let table = tables(six);
        given
            .uniform("pyramid", &pyramid())
            .uniform("target", &SYMMETRIC_6_16.six())
            .buffer("table", table.as_flattened())
    })
}

/// What variance soft shadow mapping reads.
#[must_use]
pub fn shaded_parts(request: &Request) -> Vec<Given> {
    shaded_by(request, 2e-5, |given| {
        maps::with_depth(request, with_tables(given))
    })
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
    let points = Points::new(&points(16), &points(31));
    shaded_by(request, 0.0, |given| {
        maps::with_depth(request, given).uniform("points", &points)
    })
}
