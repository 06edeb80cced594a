//! Translucent casters: the distribution of their depths, blended into a map of moments, or hashed into depths.
//!
//! A light ray that meets surfaces of opacities a_1, a_2, … at depths z_1 < z_2 < … loses the share a_l of what
//! is left of it at each. So the shadow at a depth is that of a distribution in which z_l has the weight
//! a_l (1 - a_1) … (1 - a_{l-1}). Its moments come about by alpha blending, from the farthest surface to the
//! nearest: `a * source + (1 - a) * destination` (Peters, Münstermann, Wetzstein, Klein: Beyond Hard Shadows,
//! 2016; lecture, "Translucent occluders").
//!
//! Four moments and an opacity are five channels. [`translucent_moments`] draws them in two halves, each with the
//! opacity as its alpha; [`resolve_translucent`] puts them before the opaque surfaces, sample by sample. Six moments
//! are two halves of three channels: [`translucent_moments_6`], [`resolve_translucent_6`].

use hankel_dsl::glam::{UVec2, Vec2, Vec3, Vec4};
use hankel_dsl::{Real, Texture2d, Texture2dMultisampled, kernel, to_i32};
use hankel_moments::{Moments4, Quantized4, quantize_symmetric_4, quantize_unit_4};

use crate::depth::Transform;
use crate::library::lookups::percentage_closer;
use crate::resolve::mean_of;
use crate::shade::{Light, encoding, shade_by};
use crate::six::halves;

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

/// A depth's four moments in the optimised basis.
#[inline(always)]
fn quantized(z: f32, how: u32) -> Quantized4<f32> {
    if how == encoding::UNIT {
        quantize_unit_4(Moments4::of_depth(z))
    } else {
        quantize_symmetric_4(Moments4::of_depth(2.0 * z - 1.0))
    }
}

/// Half of a translucent fragment's four moments in the optimised basis, for alpha blending into zeros:
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
    #[values(encoding::UNIT, encoding::SYMMETRIC)]
    encoding: u32,
    #[constant(id = 1, default = 0)]
    #[values(0, 1)]
    part: u32,
) -> Vec4 {
    let q = quantized(Real::saturate(divided(place).z), encoding);
    let half = if part == 0 {
        Vec2::new(q.r, q.g)
    } else {
        Vec2::new(q.b, q.a)
    };
    Vec4::new(half.x, half.y, 0.0, Real::saturate(surface.w))
}

/// Mean of a texel's moments: in each sample, what [`translucent_moments`] has blended, before the moments of
/// the depth of the opaque surface.
#[kernel(
    compute,
    threads(8, 8),
    texture(rgba16unorm),
    forms(fragment),
    inputs = crate::inputs::translucent::blended,
    parity(
        ulp = 0,
        absolute = 1.6e-5,
        why = "sums and products only, then rounding to 1/65535: drivers may round a tie either way, which is one step"
    )
)]
pub fn resolve_translucent(
    #[index] at: UVec2,
    #[constant(id = 0, default = 4)]
    #[values(1, 4)]
    samples: u32,
    #[constant(id = 1, default = 2)]
    #[values(encoding::UNIT, encoding::SYMMETRIC)]
    encoding: u32,
    #[texture] depth: Texture2dMultisampled<'_>,
    #[texture] first: Texture2dMultisampled<'_>,
    #[texture] second: Texture2dMultisampled<'_>,
) -> Vec4 {
    let sample = |i: u32| {
        let q = quantized(Real::saturate(depth.load(at, i).x), encoding);
        let (front, back) = (first.load(at, i), second.load(at, i));
        let passes = 1.0 - front.w;
        Vec4::new(
            front.x + passes * q.r,
            front.y + passes * q.g,
            back.x + passes * q.b,
            back.y + passes * q.a,
        )
    };
    mean_of(samples, sample)
}

/// Half of a translucent fragment's six moments in the optimised basis, depths moved to [-1, 1], for alpha blending
/// into zeros: the odd ones with `part` 0, the even ones with 1. Alpha is the opacity.
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
    #[constant(id = 0, default = 0)]
    #[values(0, 1)]
    part: u32,
) -> Vec4 {
    let [odd, even] = halves(Real::saturate(divided(place).z));
    let half = if part == 0 { odd } else { even };
    Vec4::new(half.x, half.y, half.z, Real::saturate(surface.w))
}

/// Means of a texel's six moments: in each sample, what [`translucent_moments_6`] has blended, before the moments of
/// the depth of the opaque surface.
#[kernel(
    compute,
    threads(8, 8),
    outputs(rgba16unorm, rgba16unorm),
    forms(fragment),
    inputs = crate::inputs::translucent::blended_6,
    parity(
        ulp = 0,
        absolute = 1.6e-5,
        why = "sums and products only, then rounding to 1/65535: drivers may round a tie either way, which is one step"
    )
)]
pub fn resolve_translucent_6(
    #[index] at: UVec2,
    #[constant(id = 0, default = 4)]
    #[values(1, 4)]
    samples: u32,
    #[texture] depth: Texture2dMultisampled<'_>,
    #[texture] first: Texture2dMultisampled<'_>,
    #[texture] second: Texture2dMultisampled<'_>,
) -> (Vec4, Vec4) {
    (
        mean_of(samples, |i| {
            let opaque = halves(Real::saturate(depth.load(at, i).x));
            before(first.load(at, i), opaque[0])
        }),
        mean_of(samples, |i| {
            let opaque = halves(Real::saturate(depth.load(at, i).x));
            before(second.load(at, i), opaque[1])
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

/// Shading with percentage-closer filtering, all four samples of each texel: of each the nearer one of the
/// opaque surface's depth and of one that [`stochastic_depths`] has kept.
#[kernel(fragment, inputs = crate::inputs::translucent::shaded)]
pub fn shade_stochastic(
    #[varying] world: Vec3,
    #[varying]
    #[unit_vector]
    normal: Vec3,
    #[varying]
    #[range(0.0..=1.0)]
    colour: Vec3,
    #[uniform] light: &Light,
    #[texture] depth: Texture2dMultisampled<'_>,
    #[texture] kept: Texture2dMultisampled<'_>,
) -> Vec4 {
    shade_by(light, world, normal, colour, |uv, z| {
        percentage_closer(depth.size(), light.filter_radius, uv, |at| {
            let sample = |i: u32, kept: f32| {
                let nearest = Real::min(depth.load(at, i).x, kept);
                if nearest < z { 0.25 } else { 0.0 }
            };
            sample(0, kept.load(at, 0).x)
                + sample(1, kept.load(at, 1).y)
                + sample(2, kept.load(at, 2).z)
                + sample(3, kept.load(at, 3).w)
        })
    })
}
