//! What translucent casters give: two panes in the small scene of [`maps`], blended or hashed before its depths.

use std::vec::Vec;

use hankel_dsl::glam::{UVec2, Vec4};
use hankel_dsl::native::describe::TexelFormat;
use hankel_dsl::native::inputs::{Given, Request, Source};
use hankel_moments::{Moments6, quantize_symmetric_6};

use super::maps::{self, SAMPLES, SIZE};
use crate::shade::encoding;

/// The panes from the farthest to the nearest: depth, opacity, and the share of the map's rows that they cover.
const PANES: [[f64; 3]; 2] = [[0.7, 0.6, 0.8], [0.42, 0.25, 0.5]];

/// Which panes are before the opaque surface, in each sample of each texel.
fn panes() -> impl Iterator<Item = impl Iterator<Item = [f64; 3]>> {
    let row = SIZE[0] as usize * SAMPLES;
    let last = SIZE[1] as usize - 1;
    maps::samples().into_iter().enumerate().map(move |(i, z)| {
        let down = (i / row) as f64 / last as f64;
        let is_there = move |&[depth, _, share]: &[f64; 3]| depth < z && down < share;
        PANES.into_iter().filter(is_there)
    })
}

/// A texture of these samples, as many in each texel as the kernel's texture of that name has.
fn texture(
    request: &Request,
    given: Given,
    name: &str,
    all: impl IntoIterator<Item = Vec4>,
) -> Given {
    let samples = request.samples(name);
    let texels = all.into_iter().step_by(SAMPLES / samples as usize);
    given.texture(name, SIZE, samples, TexelFormat::Rgba16Float, texels)
}

/// Depths of opaque surfaces, and four moments that are blended before them, as a map has them that is stored as `how`
/// says.
fn blended(request: &Request, how: u32) -> Vec<Given> {
    halves(request, |second, z| {
        let [x, y, z, w] = maps::channels(how, z);
        if second { [z, w, 0.0] } else { [x, y, 0.0] }
    })
}

/// Of depths in [0, 1], in the optimised basis.
#[must_use]
pub fn blended_unit(request: &Request) -> Vec<Given> {
    blended(request, encoding::UNIT)
}

/// Of depths in [-1, 1], in the optimised basis.
#[must_use]
pub fn blended_symmetric(request: &Request) -> Vec<Given> {
    blended(request, encoding::SYMMETRIC)
}

/// Of depths in [-1, 1], as they are.
#[must_use]
pub fn blended_plain(request: &Request) -> Vec<Given> {
    blended(request, encoding::PLAIN)
}

/// Six moments in the optimised basis.
#[must_use]
pub fn blended_symmetric_6(request: &Request) -> Vec<Given> {
    halves(request, |second, z| {
        let q = quantize_symmetric_6(Moments6::of_depth(2.0 * z - 1.0));
        if second {
            [q.r1, q.g1, q.b1]
        } else {
            [q.r0, q.g0, q.b0]
        }
    })
}

/// Six moments as they are.
#[must_use]
pub fn blended_plain_6(request: &Request) -> Vec<Given> {
    halves(request, |second, z| {
        let m = Moments6::of_depth(2.0 * z - 1.0);
        if second {
            [m.b2, m.b4, m.b6]
        } else {
            [m.b1, m.b3, m.b5]
        }
    })
}

/// Two moments, stored as the kernel's `encoding` says.
#[must_use]
pub fn blended_variance(request: &Request) -> Vec<Given> {
    let how = request.constant("encoding").unwrap_or(encoding::SYMMETRIC);
    let of = |z| {
        let [first, second] = maps::two(how, z);
        [first, second, 0.0]
    };
    maps::depths(request)
        .into_iter()
        .map(|given| texture(request, given, "blended", blended_panes(of)))
        .collect()
}

/// Depths of opaque surfaces, and both halves of what `of` gives for a depth, blended before them.
fn halves(request: &Request, of: impl Fn(bool, f64) -> [f64; 3]) -> Vec<Given> {
    maps::depths(request)
        .into_iter()
        .map(|given| texture(request, given, "first", blended_panes(|z| of(false, z))))
        .map(|given| texture(request, given, "second", blended_panes(|z| of(true, z))))
        .collect()
}

/// What `of` gives for the depths of the panes of a sample, blended.
fn blended_panes(of: impl Fn(f64) -> [f64; 3]) -> impl Iterator<Item = Vec4> {
    panes().map(move |panes| {
        let sum = panes.fold([0.0; 4], |sum: [f64; 4], [depth, opacity, _]| {
            let [x, y, z] = of(depth);
            let source = [x, y, z, 1.0];
            std::array::from_fn(|i| opacity * source[i] + (1.0 - opacity) * sum[i])
        });
        Vec4::from_array(sum.map(|x| x as f32))
    })
}

/// Fragments in the middle of a map's texels, as a rasteriser has them: surfaces, and places in clip space, of
/// which every other one has a w of 2, by which division is exact.
fn drawn(request: &Request) -> Given {
    let mut s = Source::new(request.seed);
    let (mut surfaces, mut places) = (Vec::new(), Vec::new());
    for _ in 0..1009 {
        let opacity = match s.count(0, 4) {
            0 => 0.0,
            1 => 1.0,
            _ => s.between(0.0, 1.0),
        };
        let mut middle = |size: u32| {
            let texel = f64::from(s.count(0, size - 1));
            (2.0 * (texel + 0.5) / f64::from(size) - 1.0) as f32
        };
        let (x, y) = (middle(SIZE[0]), middle(SIZE[1]));
        let place = Vec4::new(x, y, s.between(0.0, 1.0) as f32, 1.0);
        places.push(place * s.pick(&[1.0, 2.0]));
        surfaces.push(Vec4::new(0.2, 0.4, 0.6, opacity as f32));
    }
    Given::new("fragments of translucent surfaces")
        .buffer("surface", &surfaces)
        .buffer("place", &places)
}

/// Fragments whose moments are blended.
#[must_use]
pub fn places(request: &Request) -> Vec<Given> {
    [drawn(request)].into()
}

/// Fragments whose depths are hashed.
#[must_use]
pub fn fragments(request: &Request) -> Vec<Given> {
    [drawn(request).uniform("size", &UVec2::from_array(SIZE))].into()
}

/// What shading with hashed depths reads.
#[must_use]
pub fn shaded(request: &Request) -> Vec<Given> {
    let mut s = Source::new(request.seed);
    let kept = panes().map(|panes| {
        panes.fold(Vec4::ONE, |kept, [depth, opacity, _]| {
            let mut channel = |x: f32| {
                let is_kept = s.between(0.0, 1.0) < opacity;
                if is_kept { x.min(depth as f32) } else { x }
            };
            Vec4::from_array(kept.to_array().map(&mut channel))
        })
    });
    let kept: Vec<Vec4> = kept.collect();
    maps::shaded_depths(request)
        .into_iter()
        .map(|given| texture(request, given, "kept", kept.iter().copied()))
        .collect()
}
