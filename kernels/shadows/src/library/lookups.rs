//! What looks a map up more than once. The engine's own lookup is a parameter: samples, texels and entries come
//! from wherever the engine keeps them.

use hankel_dsl::glam::{UVec2, UVec4, Vec2, Vec4};
use hankel_dsl::{Real, function};
use hankel_moments::{FixedPoint, Moments4, quantize_symmetric_4};

use super::store::{channels, fixed, moments_of_depth, quantize_symmetric_four, symmetric_depth};
use crate::mips::Footprint;
use crate::resolve::mean_of;
use crate::shade::{percentage, weighted};
use crate::soft::{Area, region};

/// A texel of a map of moments (\[BHS\], lecture, "Generate a moment shadow map"): the mean of the first four
/// moments of all samples' depths, which `sample_depth` gives in [0, 1] and which are moved to [-1, 1]. A depth
/// map without multisampling has one sample.
#[function]
#[inline(always)]
pub fn resolve_four(samples: u32, sample_depth: impl Fn(u32) -> f32) -> Vec4 {
    mean_of(samples, |i| {
        moments_of_depth(symmetric_depth(Real::saturate(sample_depth(i))))
    })
}

/// `resolve_four` in the basis optimised for 4 x 16 bits: channels in [0, 1].
#[function]
#[inline(always)]
pub fn resolve_quantized_four(samples: u32, sample_depth: impl Fn(u32) -> f32) -> Vec4 {
    mean_of(samples, |i| {
        quantize_symmetric_four(moments_of_depth(symmetric_depth(Real::saturate(
            sample_depth(i),
        ))))
    })
}

/// Half the size in texels, along u and v, of what is filtered for blockers that lie `distance` before a receiver,
/// in the map's depth from 0 to 1: at least half a texel. `spread` is that size for the map's whole depth.
///
/// `blockers_of_four` has distances between depths in [-1, 1]: half of such a one is meant here.
#[function]
pub fn penumbra_reach(distance: f32, spread: Vec2) -> Vec2 {
    let area = Area {
        spread,
        slack: 0.0,
        margin: 0.0,
        one: 1,
        narrowing: 0.0,
    };
    area.reach(distance)
}

/// The mean of four moments in the basis optimised for 4 x 16 bits, over the rectangle within `reach` texels of
/// `place`, also in texels, from a summed-area table of `size` entries (\[BHS\], lecture, "Caveat: bilinear
/// interpolation"). `one` stands for 1 in the table. Beyond the table, nothing is nearer than depth 1.
///
/// `sum_before` gives the sum over so many columns and so many rows, from the first on: the entry at the last of
/// them, and 0 where there are none. It is called 16 times.
#[function]
#[inline(always)]
pub fn mean_of_table_four(
    place: Vec2,
    reach: Vec2,
    size: UVec2,
    one: u32,
    sum_before: impl Fn(u32, u32) -> UVec4,
) -> Vec4 {
    let region = region(place, reach, size);
    let beyond = quantize_symmetric_4(Moments4::of_depth(1.0));
    channels(region.mean_4(FixedPoint { one }, beyond, |columns, rows| {
        fixed(sum_before(columns, rows))
    }))
}

/// Percentage-closer filtering (W. Reeves, D. Salesin, R. Cook, *Rendering Antialiased Shadows with Depth Maps*,
/// 1987): the mean of what `compare` gives for the texels of a square, `2 radius + 1` wide, around the one that
/// `uv` is in. A map has `size` texels; beyond its edge the last texel counts once more. `compare` gives 1 where
/// the map is nearer than the receiver, else 0.
#[function]
#[inline(always)]
pub fn percentage_closer(
    size: UVec2,
    radius: u32,
    uv: Vec2,
    compare: impl Fn(UVec2) -> f32,
) -> f32 {
    percentage(size, radius, uv, compare)
}

/// Percentage-closer filtering with the weights of a separable filter and of bilinear lookup: what a filtered
/// shadow map approximates. `weight` gives the filter's weight of a texel that is so many texels away along one
/// axis, from 0 to `count - 1`; all weights of an axis have the sum 1, both sides counted. A map has `size`
/// texels; beyond its edge the last texel counts once more. `compare` gives the share of a texel's samples that
/// are nearer than the receiver, from 0 to 1. It is called `4 count count` times.
#[function]
#[inline(always)]
pub fn percentage_closer_weighted(
    size: UVec2,
    count: u32,
    uv: Vec2,
    weight: impl Fn(u32) -> f32,
    compare: impl Fn(UVec2) -> f32,
) -> f32 {
    weighted(size, count, uv, weight, compare)
}

/// Anisotropic lookup (P. Heckbert, *Fundamentals of Texture Mapping and Image Warping*, 1989): the mean of a
/// filtered map over what a pixel sees of it. `dx` and `dy` are how much `uv` changes to the next pixel along x and
/// along y; a map has `size` texels. The longer axis of a footprint counts for up to `anisotropy` times the shorter
/// one, from 1 (trilinear lookup) to 16.
///
/// `sample_of_width` looks the map up at a place, with a linear filter, between mip levels too, where texels are
/// `width` texels of the whole map wide: the level is the logarithm of that to base 2. It is called at most
/// `anisotropy + 2` times. The bias and the bound come after.
#[function]
#[inline(always)]
pub fn mean_of_footprint(
    uv: Vec2,
    dx: Vec2,
    dy: Vec2,
    size: UVec2,
    anisotropy: f32,
    sample_of_width: impl Fn(Vec2, f32) -> Vec4,
) -> Vec4 {
    let texels = Vec2::new(size.x as f32, size.y as f32);
    // No footprint is wider than that in the map, and squares of steps stay finite.
    let near = |t: f32| Real::clamp(t, -16.0, 16.0);
    let step = |d: Vec2| Vec2::new(near(d.x) * texels.x, near(d.y) * texels.y);
    let footprint = Footprint::of_steps([step(dx), step(dy)], texels, anisotropy);
    footprint.mean(uv, |uv| sample_of_width(uv, footprint.width))
}
