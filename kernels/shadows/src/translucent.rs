//! Translucent casters: the distribution of their depths, blended into a map of moments, or hashed into depths.
//!
//! A light ray that meets surfaces of opacities a_1, a_2, … at depths z_1 < z_2 < … loses the share a_l of what
//! is left of it at each. So the shadow at a depth is that of a distribution in which z_l has the weight
//! a_l (1 - a_1) … (1 - a_{l-1}). Its moments come about by alpha blending, from the farthest surface to the
//! nearest: `a * source + (1 - a) * destination` (Peters, Münstermann, Wetzstein, Klein: Beyond Hard Shadows,
//! 2016; lecture, "Translucent occluders").
//!
//! Four moments and an opacity are five channels. [`translucent_moments`] draws them in two halves, each with the
//! opacity as its alpha. Six moments are two halves of three channels: [`translucent_moments_6`]. What stores them in a
//! map puts them before the opaque surfaces, sample by sample: `resolve_translucent_unit`, for example, is
//! [`resolve_unit`](crate::resolve::resolve_unit) with translucent casters.

use hankel_dsl::glam::{UVec2, Vec2, Vec3, Vec4};
use hankel_dsl::{Real, Texture2d, kernel, to_i32};
use hankel_moments::{Moments4, quantize_symmetric_4, quantize_unit_4};

use crate::depth::Transform;
use crate::library::lookups::percentage_closer;
use crate::library::store::channels;
use crate::packed::{words_10, words_16};
use crate::samples::{Samples, mean_of};
use crate::shade::{Light, encoding, in_range, shade_by};
use crate::six::{halves, plain_halves};

/// A vertex of a translucent surface: position; colour with opacity; position in clip space once more.
#[kernel(
    vertex,
    parity(non_finite, why = "sums of products: those of absurd numbers overflow")
)]
pub fn translucent(
    #[attribute] position: Vec3,
    #[attribute]
    #[range(0.0..=1.0)]
    colour: Vec3,
    #[attribute]
    #[range(0.0..=1.0)]
    opacity: f32,
    #[uniform] view: &Transform,
) -> (Vec4, Vec4, Vec4) {
    let clip = view.apply(position);
    let surface = Vec4::new(colour.x, colour.y, colour.z, opacity);
    (clip, surface, clip)
}

/// A place in clip space by what its w divides; nothing that is drawn lies nearer than the floor.
#[inline(always)]
fn divided(place: Vec4) -> Vec3 {
    let w = Real::max(place.w, 1e-6);
    Vec3::new(place.x / w, place.y / w, place.z / w)
}

/// Depth from 0 to 1 and opacity of a translucent fragment.
#[inline(always)]
pub(crate) fn depth_and_opacity(surface: Vec4, place: Vec4) -> (f32, f32) {
    (Real::saturate(divided(place).z), Real::saturate(surface.w))
}

/// A depth's four moments as a map has them.
#[inline(always)]
fn four(z: f32, how: u32) -> Vec4 {
    let m = Moments4::of_depth(in_range(z, how));
    if how == encoding::UNIT {
        channels(quantize_unit_4(m))
    } else if how == encoding::SYMMETRIC {
        channels(quantize_symmetric_4(m))
    } else {
        Vec4::new(m.b1, m.b2, m.b3, m.b4)
    }
}

/// A depth's six moments as maps have them: the odd ones, and the even ones.
#[inline(always)]
fn six(z: f32, how: u32) -> [Vec4; 2] {
    if how == encoding::SYMMETRIC {
        halves(z)
    } else {
        plain_halves(z)
    }
}

/// Half of a translucent fragment's four moments as `encoding` says, for alpha blending into zeros:
/// the first two channels with `part` 0, the other two with 1. Alpha is the opacity.
#[kernel(
    fragment,
    inputs = crate::inputs::translucent::places,
    parity(
        ulp = 0,
        absolute = 7.7e-6,
        why = "sums of products: drivers may contract two of them, and so leave out the rounding of products of at most 82 (depths in [0, 1]), which is 3.8e-6; 16 bits round by as much"
    )
)]
pub fn translucent_moments(
    #[varying]
    #[range(0.0..=1.0)]
    surface: Vec4,
    #[varying] place: Vec4,
    #[constant(id = 0, default = 2)]
    #[values(encoding::PLAIN, encoding::UNIT, encoding::SYMMETRIC)]
    encoding: u32,
    #[constant(id = 1, default = 0)]
    #[values(0, 1)]
    part: u32,
) -> Vec4 {
    let (depth, opacity) = depth_and_opacity(surface, place);
    let m = four(depth, encoding);
    let half = if part == 0 {
        Vec2::new(m.x, m.y)
    } else {
        Vec2::new(m.z, m.w)
    };
    Vec4::new(half.x, half.y, 0.0, opacity)
}

/// Half of a translucent fragment's six moments as `encoding` says, depths moved to [-1, 1], for alpha blending into
/// zeros: the odd ones with `part` 0, the even ones with 1. Alpha is the opacity.
#[kernel(
    fragment,
    inputs = crate::inputs::translucent::places,
    parity(
        ulp = 0,
        absolute = 4e-6,
        why = "sums of products: drivers may contract them, and so leave out the rounding of up to three products of at most 24, which is 9.5e-7 each"
    )
)]
pub fn translucent_moments_6(
    #[varying]
    #[range(0.0..=1.0)]
    surface: Vec4,
    #[varying] place: Vec4,
    #[constant(id = 0, default = 2)]
    #[values(encoding::PLAIN, encoding::SYMMETRIC)]
    encoding: u32,
    #[constant(id = 1, default = 0)]
    #[values(0, 1)]
    part: u32,
) -> Vec4 {
    let (depth, opacity) = depth_and_opacity(surface, place);
    let [odd, even] = six(depth, encoding);
    let half = if part == 0 { odd } else { even };
    Vec4::new(half.x, half.y, half.z, opacity)
}

/// The mean of a texel's four moments as `how` says: in each sample, what is blended in two halves, before the moments
/// of the depth of the opaque surface.
#[inline(always)]
fn mean_4(
    depth: impl Samples,
    first: impl Samples,
    second: impl Samples,
    at: UVec2,
    samples: u32,
    how: u32,
) -> Vec4 {
    mean_of(samples, |i| {
        let opaque = four(Real::saturate(depth.load_sample(at, i).x), how);
        let (front, back) = (first.load_sample(at, i), second.load_sample(at, i));
        let passes = 1.0 - front.w;
        Vec4::new(
            front.x + passes * opaque.x,
            front.y + passes * opaque.y,
            back.x + passes * opaque.z,
            back.y + passes * opaque.w,
        )
    })
}

/// The same of six moments: the odd ones, and the even ones.
#[inline(always)]
fn mean_6(
    depth: impl Samples,
    first: impl Samples,
    second: impl Samples,
    at: UVec2,
    samples: u32,
    how: u32,
) -> (Vec4, Vec4) {
    (
        mean_of(samples, |i| {
            let opaque = six(Real::saturate(depth.load_sample(at, i).x), how);
            before(first.load_sample(at, i), opaque[0])
        }),
        mean_of(samples, |i| {
            let opaque = six(Real::saturate(depth.load_sample(at, i).x), how);
            before(second.load_sample(at, i), opaque[1])
        }),
    )
}

/// What is blended, before an opaque surface's moments; of three channels.
#[inline(always)]
fn before(blended: Vec4, opaque: Vec4) -> Vec4 {
    let passes = 1.0 - blended.w;
    Vec4::new(
        blended.x + passes * opaque.x,
        blended.y + passes * opaque.y,
        blended.z + passes * opaque.z,
        0.0,
    )
}

of_samples! {
    /// Mean of a texel's moments, depths in [0, 1], in the basis optimised for 16 bits: in each sample, what
    /// [`translucent_moments`] has blended, before the opaque surface.
    #[kernel(
        compute,
        threads(8, 8),
        texture(rgba16unorm),
        forms(fragment),
        inputs = crate::inputs::translucent::blended_unit,
        parity(
            ulp = 0,
            absolute = 1.6e-5,
            why = "sums and products only, then rounding to 1/65535: drivers may round a tie either way, which is one step"
        )
    )]
    resolve_translucent_unit,
    resolve_single_translucent_unit,
    (#[index] at: UVec2,) -> Vec4,
    |depth, first, second; samples| {
        mean_4(depth, first, second, at, samples, encoding::UNIT)
    }
}

of_samples! {
    /// The same, depths moved to [-1, 1].
    #[kernel(
        compute,
        threads(8, 8),
        texture(rgba16unorm),
        forms(fragment),
        inputs = crate::inputs::translucent::blended_symmetric,
        parity(
            ulp = 0,
            absolute = 1.6e-5,
            why = "sums and products only, then rounding to 1/65535: drivers may round a tie either way, which is one step"
        )
    )]
    resolve_translucent_symmetric,
    resolve_single_translucent_symmetric,
    (#[index] at: UVec2,) -> Vec4,
    |depth, first, second; samples| {
        mean_4(depth, first, second, at, samples, encoding::SYMMETRIC)
    }
}

of_samples! {
    /// The same, depths moved to [-1, 1], moments as they are, for a 32-bit map.
    #[kernel(
        compute,
        threads(8, 8),
        texture(rgba32float),
        forms(fragment),
        inputs = crate::inputs::translucent::blended_plain,
        parity(non_finite, why = "sums of products: those of absurd numbers overflow")
    )]
    resolve_translucent_plain,
    resolve_single_translucent_plain,
    (#[index] at: UVec2,) -> Vec4,
    |depth, first, second; samples| {
        mean_4(depth, first, second, at, samples, encoding::PLAIN)
    }
}

of_samples! {
    /// Means of a texel's six moments, depths moved to [-1, 1], in the basis optimised for 16 bits: in each sample, what
    /// [`translucent_moments_6`] has blended, before the opaque surface.
    #[kernel(
        compute,
        threads(8, 8),
        outputs(rgba16unorm, rgba16unorm),
        forms(fragment),
        inputs = crate::inputs::translucent::blended_symmetric_6,
        parity(
            ulp = 0,
            absolute = 1.6e-5,
            why = "sums and products only, then rounding to 1/65535: drivers may round a tie either way, which is one step"
        )
    )]
    resolve_translucent_symmetric_6,
    resolve_single_translucent_symmetric_6,
    (#[index] at: UVec2,) -> (Vec4, Vec4),
    |depth, first, second; samples| {
        mean_6(depth, first, second, at, samples, encoding::SYMMETRIC)
    }
}

of_samples! {
    /// The same as they are, for 32-bit maps.
    #[kernel(
        compute,
        threads(8, 8),
        outputs(rgba32float, rgba32float),
        forms(fragment),
        inputs = crate::inputs::translucent::blended_plain_6,
        parity(non_finite, why = "sums of products: those of absurd numbers overflow")
    )]
    resolve_translucent_plain_6,
    resolve_single_translucent_plain_6,
    (#[index] at: UVec2,) -> (Vec4, Vec4),
    |depth, first, second; samples| {
        mean_6(depth, first, second, at, samples, encoding::PLAIN)
    }
}

of_samples! {
    /// As [`resolve_translucent_symmetric_6`], in two words of three channels with 10 bits.
    #[kernel(
        compute,
        threads(8, 8),
        texture(rg32uint),
        forms(fragment),
        pinned,
        inputs = crate::inputs::translucent::blended_symmetric_6
    )]
    resolve_translucent_packed_10,
    resolve_single_translucent_packed_10,
    (#[index] at: UVec2,) -> UVec2,
    |depth, first, second; samples| {
        let (first, second) = mean_6(depth, first, second, at, samples, encoding::SYMMETRIC);
        words_10(first, second)
    }
}

of_samples! {
    /// As [`resolve_translucent_symmetric_6`], in three words of two channels with 16 bits.
    #[kernel(
        compute,
        threads(8, 8),
        outputs(r32uint, r32uint, r32uint),
        forms(fragment),
        pinned,
        inputs = crate::inputs::translucent::blended_symmetric_6
    )]
    resolve_translucent_packed_16,
    resolve_single_translucent_packed_16,
    (#[index] at: UVec2,) -> (u32, u32, u32),
    |depth, first, second; samples| {
        let (first, second) = mean_6(depth, first, second, at, samples, encoding::SYMMETRIC);
        words_16(first, second)
    }
}

/// What a fragment lets through of what is seen behind it, for multiplicative blending: each channel loses
/// the share `opacity`, and what the surface's colour has of that is not lost.
#[kernel(fragment)]
pub fn tint(
    #[varying]
    #[range(0.0..=1.0)]
    surface: Vec4,
) -> Vec4 {
    let opacity = Real::saturate(surface.w);
    let channel = |colour: f32| 1.0 - opacity * (1.0 - Real::saturate(colour));
    Vec4::new(
        channel(surface.x),
        channel(surface.y),
        channel(surface.z),
        1.0,
    )
}

/// A picture as it is seen through a `tint`.
#[kernel(
    compute,
    threads(8, 8),
    texture(rgba16float),
    forms(fragment),
    parity(
        ulp = 1,
        non_finite,
        why = "one product, then rounding to 16 bits, up or down: one step; absurd numbers overflow"
    )
)]
pub fn tinted(
    #[index] at: UVec2,
    #[texture] picture: Texture2d<'_>,
    #[texture] tint: Texture2d<'_>,
) -> Vec4 {
    let (colour, tint) = (picture.load(at), tint.load(at));
    Vec4::new(
        colour.x * tint.x,
        colour.y * tint.y,
        colour.z * tint.z,
        colour.w,
    )
}

/// A mixing of 32 bits (Wellons: Hash prospector, 2018, "lowbias32").
#[inline(always)]
fn mixed(x: u32) -> u32 {
    let x = (x ^ (x >> 16)).wrapping_mul(0x7feb_352d);
    let x = (x ^ (x >> 15)).wrapping_mul(0x846c_a68b);
    x ^ (x >> 16)
}

/// Layers of a map's depth whose surfaces have thresholds of their own.
const LAYERS: f32 = 1024.0;

/// What [`stochastic_depths`] writes for a fragment at `texel` with depth `z`.
#[inline(always)]
pub(crate) fn kept_depths(texel: UVec2, z: f32, opacity: f32) -> Vec4 {
    let layer = to_i32(z * LAYERS) as u32;
    let across = mixed(texel.y ^ mixed(layer));
    let random = mixed(texel.x ^ across);
    let within = (random >> 8) as f32 / 16_777_216.0;
    let kept = |quarter: u32| {
        let threshold = 0.25 * (((quarter ^ random) & 3) as f32 + within);
        if threshold < opacity { z } else { 1.0 }
    };
    Vec4::new(kept(0), kept(1), kept(2), kept(3))
}

/// Four depths of a translucent fragment, for blending that keeps the least: each is the fragment's depth with
/// the probability `opacity`, and else 1 (stochastic transparency: Enderton, Sintorn, Shirley, Luebke, 2010).
///
/// The four thresholds lie in the four quarters of [0, 1), in one of four orders, so that of an opacity of 0.5
/// two of four remain. What is random is a hash of the texel and of the depth in 1024 layers (hashed
/// alpha: Wyman, McGuire, 2017): always the same for the same surface, and another for one behind it.
#[kernel(fragment, inputs = crate::inputs::translucent::fragments)]
pub fn stochastic_depths(
    #[varying]
    #[range(0.0..=1.0)]
    surface: Vec4,
    #[varying] place: Vec4,
    #[uniform] size: &UVec2,
) -> Vec4 {
    let place = divided(place);
    let texel = |x: f32, size: u32| {
        let at = Real::saturate(0.5 * x + 0.5) * size as f32;
        to_i32(Real::min(at, 65536.0)) as u32
    };
    let texel = UVec2::new(texel(place.x, size.x), texel(place.y, size.y));
    kept_depths(texel, Real::saturate(place.z), surface.w)
}

of_samples! {
    /// Shading with percentage-closer filtering by what [`stochastic_depths`] has kept: of each texel four depths, each
    /// the nearer one of a kept one and of the opaque surface's depth, which is that of another sample for each.
    #[kernel(fragment, inputs = crate::inputs::translucent::shaded)]
    shade_stochastic,
    shade_single_stochastic,
    (
        #[varying] world: Vec3,
        #[varying]
        #[unit_vector]
        normal: Vec3,
        #[varying]
        #[range(0.0..=1.0)]
        colour: Vec3,
        #[uniform] light: &Light,
    ) -> Vec4,
    |depth, kept| {
        shade_by(light, world, normal, colour, |uv, z| {
            percentage_closer(depth.size(), light.filter_radius, uv, |at| {
                let sample = |i: u32, kept: f32| {
                    let nearest = Real::min(depth.load_sample(at, i).x, kept);
                    if nearest < z { 0.25 } else { 0.0 }
                };
                sample(0, kept.load_sample(at, 0).x)
                    + sample(1, kept.load_sample(at, 1).y)
                    + sample(2, kept.load_sample(at, 2).z)
                    + sample(3, kept.load_sample(at, 3).w)
            })
        })
    }
}
