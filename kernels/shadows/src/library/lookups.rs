//! What looks a map up more than once. The engine's own lookup is a parameter: samples, texels and entries come
//! from wherever the engine keeps them.

use hankel_dsl::glam::{UVec2, UVec4, Vec2, Vec4};
use hankel_dsl::{Real, function, to_i32};
use hankel_moments::{FixedPoint, Moments4, quantize_symmetric_4};

use super::store::{channels, fixed, moments_of_depth, quantize_symmetric_four, symmetric_depth};
use crate::grid::within;
use crate::mips::Footprint;
use crate::samples::mean_of;
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
        narrowing: 0.0,
        padding: 0.0,
    };
    area.reach(distance)
}

/// The mean of four moments in the basis optimised for 4 x 16 bits, over the rectangle within `reach` texels of
/// `place`, also in texels, from a summed-area table of `size` entries (\[BHS\], lecture, "Caveat: bilinear
/// interpolation"). `one` stands for 1 in the table: no more than 2^32 over the texels of the largest rectangle.
/// Beyond the table, nothing is nearer than depth 1.
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
    let nearest = |t: f32, size: u32| {
        let last = (size - 1) as f32;
        // Not negative, so that cutting the fraction off is rounding down.
        to_i32(Real::clamp(t * size as f32, 0.0, last))
    };
    let (left, top) = (
        nearest(uv.x, size.x) - radius as i32,
        nearest(uv.y, size.y) - radius as i32,
    );
    let width = 2 * radius + 1;
    let mut shadowed = 0.0;
    let mut row = 0;
    while row < width {
        let y = within(top + row as i32, size.y);
        let mut column = 0;
        while column < width {
            shadowed += compare(UVec2::new(within(left + column as i32, size.x), y));
            column += 1;
        }
        row += 1;
    }
    let width = width as f32;
    shadowed / (width * width)
}

/// Percentage-closer filtering with the weights of a separable filter and of bilinear lookup: what a filtered
/// shadow map approximates. `weight` gives the filter's weight of a texel that is so many texels away along one
/// axis, from 0 to `count - 1`; all weights of an axis have the sum 1, both sides counted. A map has `size`
/// texels; beyond its edge the last texel counts once more. `compare` gives the share of a texel's samples that
/// are nearer than the receiver, from 0 to 1; it is called `4 * count * count` times.
#[function]
#[inline(always)]
pub fn percentage_closer_weighted(
    size: UVec2,
    count: u32,
    uv: Vec2,
    weight: impl Fn(u32) -> f32,
    compare: impl Fn(UVec2) -> f32,
) -> f32 {
    // In texels from the first one's centre; beyond the edge as at it.
    let place = |t: f32, size: u32| Real::clamp(t * size as f32 - 0.5, 0.0, (size - 1) as f32);
    let (x, y) = (place(uv.x, size.x), place(uv.y, size.y));
    let (left, top) = (to_i32(x), to_i32(y));
    let (right_share, low_share) = (x - left as f32, y - top as f32);
    let count = count as i32;
    let weight_at = |d: i32| {
        let d = if d < 0 { -d } else { d };
        if d < count { weight(d as u32) } else { 0.0 }
    };
    let width = 2 * count as u32;
    let mut shadowed = 0.0;
    let mut row = 0;
    while row < width {
        let dy = row as i32 + 1 - count;
        let mut of_row = 0.0;
        let mut column = 0;
        while column < width {
            let dx = column as i32 + 1 - count;
            let at = UVec2::new(within(left + dx, size.x), within(top + dy, size.y));
            let share = weight_at(dx) * (1.0 - right_share) + weight_at(dx - 1) * right_share;
            of_row += share * compare(at);
            column += 1;
        }
        let share = weight_at(dy) * (1.0 - low_share) + weight_at(dy - 1) * low_share;
        shadowed += share * of_row;
        row += 1;
    }
    Real::saturate(shadowed)
}

/// Anisotropic lookup (P. Heckbert, *Fundamentals of Texture Mapping and Image Warping*, 1989): the mean of a
/// filtered map over what a pixel sees of it. `dx` and `dy` are how much `uv` changes to the next pixel along x and
/// along y; a map has `size` texels. `anisotropy`, from 1 (trilinear lookup) to 16, is how many times as long as wide a
/// footprint is at most. Longer ones are taken for wider ones.
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
