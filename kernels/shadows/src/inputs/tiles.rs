//! What passes over tiles read: tiles of the small scene of [`maps`], and of maps that are mostly empty.

use std::vec::Vec;

use hankel_dsl::glam::{UVec2, Vec2, Vec4};
use hankel_dsl::native::describe::TexelFormat;
use hankel_dsl::native::inputs::{Given, Request, Source};

use super::maps::{self, SAMPLES, SIZE};
use crate::shade::encoding;
use crate::tiles::{ACROSS, Bounds, EDGE, Listed, TEXELS, Tiles, tiles_of};

/// Tiles of the scene's map along u and v.
fn across() -> UVec2 {
    UVec2::new(tiles_of(SIZE[0]), tiles_of(SIZE[1]))
}

/// What the depths of each tile lie between, and `reach` tiles around it, by slopes from edge to edge.
fn tiles(reach: i32) -> Vec<Bounds> {
    let all = maps::samples();
    let [width, height] = SIZE.map(|n| n as i32);
    let texel = |x: i32, y: i32| {
        let (x, y) = (x.clamp(0, width - 1), y.clamp(0, height - 1));
        &all[(y * width + x) as usize * SAMPLES..][..SAMPLES]
    };
    let edge = EDGE as i32;
    let across = across().as_ivec2();
    (0..across.y * across.x)
        .map(|i| {
            let (left, top) = (edge * (i % across.x), edge * (i / across.x));
            let first = |dx: i32, dy: i32| texel(left + dx, top + dy)[0];
            let (last, half) = (edge - 1, edge / 2);
            let slope = [
                (first(last, half) - first(0, half)) / f64::from(last),
                (first(half, last) - first(half, 0)) / f64::from(last),
            ];
            let (mut least, mut most) = (2.0_f64, 0.0_f64);
            let reached = -edge * reach..edge * (1 + reach);
            for y in reached.clone() {
                for x in reached.clone() {
                    let plane = slope[0] * (f64::from(x) - 3.5) + slope[1] * (f64::from(y) - 3.5);
                    for z in texel(left + x, top + y) {
                        (least, most) = (least.min(z - plane), most.max(*z));
                    }
                }
            }
            Bounds {
                slope: Vec2::from_array(slope.map(|x| x as f32)),
                least: least as f32,
                most: most as f32,
            }
        })
        .collect()
}

/// Depths.
#[must_use]
pub fn depths(request: &Request) -> Vec<Given> {
    let across = across();
    let all = maps::depths(request).into_iter();
    all.map(|given| given.uniform("tiles", &Tiles { across }))
        .collect()
}

/// Depths of tiles: of the scene, which fills its map, and of maps that casters hardly touch.
#[must_use]
pub fn of_depths(request: &Request) -> Vec<Given> {
    const FAR: Bounds = Bounds {
        slope: Vec2::ZERO,
        least: 1.0,
        most: 1.0,
    };
    let mut s = Source::new(request.seed);
    let mut sparse = |across: UVec2, casters: u32| {
        let mut depths = std::vec![FAR; (across.x * across.y) as usize];
        for _ in 0..casters {
            let i = s.count(0, across.x * across.y - 1) as usize;
            let near = s.between(0.0, 1.0);
            let mut slope = || s.between(-0.01, 0.01) as f32;
            depths[i] = Bounds {
                slope: Vec2::new(slope(), slope()),
                least: near as f32,
                most: s.between(near, 1.0) as f32,
            };
        }
        (across, depths)
    };
    [
        ("a full map", (across(), tiles(0))),
        ("a map with few casters", sparse(UVec2::new(23, 17), 9)),
        ("an empty map", sparse(UVec2::new(9, 9), 0)),
    ]
    .into_iter()
    .map(|(what, (across, depths))| {
        Given::new(what)
            .uniform("tiles", &Tiles { across })
            .buffer("depths", &depths)
    })
    .collect()
}

/// A list of two rows of workgroups: every other tile of the map, among others that lie beyond it.
fn with_list(given: Given) -> Given {
    let across = across();
    let tiles = ACROSS + 9;
    // One more than is listed, which is not to be looked at.
    let list: Vec<u32> = (0..=tiles)
        .map(|place| {
            let (i, is_beyond) = (place / 13, u32::from(place % 13 != 0));
            let beyond = is_beyond * (across.y + place);
            (i % across.x) | ((i / across.x + beyond) << 16)
        })
        .collect();
    let listed = Listed {
        size: UVec2::new(ACROSS * TEXELS, 2),
        tiles,
        padding: 0,
    };
    let texels = (0..SIZE[0] * SIZE[1]).map(|_| Vec4::new(1.0, 0.5, 0.25, 0.0));
    given
        .uniform("listed", &listed)
        .buffer("list", &list)
        .texture("map", SIZE, 1, TexelFormat::Rgba16Unorm, texels)
}

/// A list of tiles and depths.
#[must_use]
pub fn listed_depths(request: &Request) -> Vec<Given> {
    maps::depths(request).into_iter().map(with_list).collect()
}

/// A list of tiles, a map of moments and the taps of a filter.
#[must_use]
pub fn listed_moments(request: &Request) -> Vec<Given> {
    maps::blurred(request).into_iter().map(with_list).collect()
}

/// What shading with a map of moments reads, and what the depths of its tiles lie between.
#[must_use]
pub fn shaded(request: &Request) -> Vec<Given> {
    let request = Request {
        constants: [("encoding".into(), encoding::SYMMETRIC)].into(),
        ..request.clone()
    };
    let all = maps::shaded(&request).into_iter();
    all.map(|given| given.buffer("between", &tiles(1)))
        .collect()
}

/// The same for a map of depths and a filter.
#[must_use]
pub fn weighted_depths(request: &Request) -> Vec<Given> {
    let all = maps::weighted_depths(request).into_iter();
    all.map(|given| given.buffer("between", &tiles(1)))
        .collect()
}
