//! What looks a map up more than once. The engine's own lookup is a parameter: samples, texels and entries come
//! from wherever the engine keeps them.

use hankel_dsl::glam::{UVec2, UVec4, Vec2, Vec4};
use hankel_dsl::{Real, function};
use hankel_moments::{FixedPoint, Moments4, quantize_symmetric_4};

use super::store::{channels, fixed, moments_of_depth, quantize_symmetric_four, symmetric_depth};
use crate::resolve::mean_of;
use crate::shade::percentage;
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
