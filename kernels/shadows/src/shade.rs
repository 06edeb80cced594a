//! Forward shading with a shadow map: each technique is a fragment kernel over the same varyings and the
//! same light. Here are those of four power moments and of the depths themselves, and what all share.

use hankel_dsl::glam::{UVec2, Vec2, Vec3, Vec4};
use hankel_dsl::{Element, Real, Sampler, Texture2d, kernel};
use hankel_moments::{
    Moments4, Quantized4, cut_leak, dequantize_symmetric_4, dequantize_unit_4, hamburger_4,
    hausdorff_4, hausdorff_4_symmetric,
};

use crate::blur::Taps;
use crate::depth::{Transform, row_times_point};
use crate::library::lookups::{percentage_closer, percentage_closer_weighted};
use crate::samples::{Samples, mean_of};

/// How the map holds moments: values of the specialisation constant `encoding`.
pub mod encoding {
    /// As they are, depths in [-1, 1].
    pub const PLAIN: u32 = 0;
    /// Depths in [0, 1]; four and more moments in the optimised basis.
    pub const UNIT: u32 = 1;
    /// Depths in [-1, 1]; four and more moments in the optimised basis, and all of them moved to [0, 1].
    pub const SYMMETRIC: u32 = 2;
}

/// A directional light or a spot light, and how its shadow map is read.
#[derive(Clone, Copy, Debug, PartialEq, Element)]
#[repr(C)]
pub struct Light {
    /// Row that takes a world-space point to the map's horizontal coordinate, 0 to 1, times that of `row_w`.
    pub row_u: Vec4,
    /// Row that takes a world-space point to the map's vertical coordinate, 0 (first row) to 1, times that of
    /// `row_w`.
    pub row_v: Vec4,
    /// Row that takes a world-space point to its depth in the map, 0 to 1, times that of `row_w`.
    pub row_depth: Vec4,
    /// Row that takes a world-space point to what the others are divided by: the distance along a spot light's
    /// axis; 1 for a directional light.
    pub row_w: Vec4,
    /// Where the light is, in homogeneous coordinates: the unit vector towards it and 0 for a directional light,
    /// its place and 1 for a spot light.
    pub position: Vec4,
    /// Of each channel the irradiance of a face that is turned to the light, at a distance of 1 from a spot light.
    pub colour: Vec3,
    /// 1 if the light falls off with the square of the distance, 0 if it does not.
    #[range(0.0..=1.0)]
    pub falloff: f32,
    /// The axis of a spot light, the way it shines, times a scale (x, y, z), and an offset (w): scale times the
    /// cosine of the angle from the axis, plus the offset, is 0 at the cone's edge and 1 where it begins to
    /// fade. Zeros and 1 for a light without a cone.
    pub cone: Vec4,
    /// Colour and strength of the ambient light.
    pub ambient: Vec4,
    /// The moment vector that the bias mixes in.
    pub bias_target: Vec4,
    /// How much of it, from 0 to 1; for variance shadow mapping the least variance, for exponential
    /// variance shadow mapping the least one relative to the square of the receiver's warped depth.
    #[magnitude(1e-7..=1e-2)]
    pub moment_bias: f32,
    /// What is taken off a receiver's depth, in the map's range of 0 to 1; of a spot light's map, where the
    /// distance along the axis is 1: it falls with the square of that, as the map's depth grows ever more slowly.
    #[magnitude(1e-7..=1e-2)]
    pub depth_bias: f32,
    /// A shadow of 1 minus this is full: from 0 to 0.5, 0.02 in the lecture.
    #[range(0.0..=0.5)]
    pub light_leak: f32,
    /// Texels of the percentage-closer filter to each side of the receiver's own.
    #[range(0..=4)]
    pub filter_radius: u32,
}

/// A vertex as the camera sees it: position, world-space position, normal and colour.
#[kernel(
    vertex,
    parity(non_finite, why = "sums of products: those of absurd numbers overflow")
)]
pub fn surface(
    #[attribute] position: Vec3,
    #[attribute]
    #[unit_vector]
    normal: Vec3,
    #[attribute]
    #[range(0.0..=1.0)]
    colour: Vec3,
    #[uniform] camera: &Transform,
) -> (Vec4, Vec3, Vec3, Vec3) {
    (camera.apply(position), position, normal, colour)
}

#[inline(always)]
pub(crate) fn dot(a: Vec3, b: Vec3) -> f32 {
    a.x * b.x + a.y * b.y + a.z * b.z
}

/// How far within a light's cone a place is from which the light is `toward`, so far off: from 0 to 1. The square
/// of it is what the cone leaves of the light.
///
/// The cone fades as in glTF (KHR_lights_punctual, "Inner and Outer Cone Angles").
#[inline(always)]
pub(crate) fn within_cone(light: &Light, toward: Vec3, distance: f32) -> f32 {
    let axis = Vec3::new(light.cone.x, light.cone.y, light.cone.z);
    Real::saturate(light.cone.w - dot(axis, toward) / distance)
}

/// What of the light a face gets that nothing shades: the cosine of the angle between its normal and the light,
/// times what the cone and the distance leave. 0 for a face that is turned from the light, and outside of its cone.
#[inline(always)]
fn unshaded(light: &Light, world: Vec3, normal: Vec3) -> f32 {
    let toward = Vec3::new(
        light.position.x - light.position.w * world.x,
        light.position.y - light.position.w * world.y,
        light.position.z - light.position.w * world.z,
    );
    let square = dot(toward, toward);
    // A normal interpolated to nothing has no direction, and a light shines from a point; the floors keep both
    // finite.
    let distance = Real::max(Real::sqrt(square), 1e-20);
    let length = Real::max(Real::sqrt(dot(normal, normal)), 1e-20);
    let cosine = Real::max(dot(normal, toward) / length / distance, 0.0);
    let within = within_cone(light, toward, distance);
    let fall = Real::max(1.0 - light.falloff + light.falloff * square, 1e-20);
    cosine * (within * within) / fall
}

/// Lambert's law with a shadow from 0 (lit) to 1, plus ambient light; each channel in [0, 65504].
#[inline(always)]
fn lit(light: &Light, unshaded: f32, colour: Vec3, shadow: f32) -> Vec4 {
    let direct = unshaded * (1.0 - shadow);
    // 65504 is the most that a 16-bit float target holds.
    let shade = |colour: f32, light: f32, ambient: f32| {
        Real::clamp(colour * (direct * light + ambient), 0.0, 65504.0)
    };
    Vec4::new(
        shade(colour.x, light.colour.x, light.ambient.x),
        shade(colour.y, light.colour.y, light.ambient.y),
        shade(colour.z, light.colour.z, light.ambient.z),
        1.0,
    )
}

/// A receiver in the map: coordinates and biased depth, from 0 to 1 inside. What is far outside is
/// moved nearer, which changes nothing but that it stays finite.
#[inline(always)]
fn receiver(light: &Light, world: Vec3) -> (Vec2, f32) {
    let near = |x: f32| Real::clamp(x, -16.0, 16.0);
    // Nothing behind a spot light is asked for; the floor keeps it finite.
    let w = Real::max(row_times_point(light.row_w, world), 1e-6);
    let uv = Vec2::new(
        near(row_times_point(light.row_u, world) / w),
        near(row_times_point(light.row_v, world) / w),
    );
    let z = row_times_point(light.row_depth, world) / w;
    (uv, near(z - light.depth_bias / (w * w)))
}

/// Lambert's law with what `shadow` gives for a receiver's coordinates in the map and its depth, both
/// from 0 to 1 inside. It is not asked for a face that is turned from the light, nor outside of its cone.
#[inline(always)]
pub(crate) fn shade_by(
    light: &Light,
    world: Vec3,
    normal: Vec3,
    colour: Vec3,
    shadow: impl FnOnce(Vec2, f32) -> f32,
) -> Vec4 {
    let unshaded = unshaded(light, world, normal);
    let mut shadowed = 1.0;
    if unshaded > 0.0 {
        let (uv, z) = receiver(light, world);
        shadowed = shadow(uv, z);
    }
    lit(light, unshaded, colour, shadowed)
}

/// The same after the cut against light leaking.
#[inline(always)]
pub(crate) fn shade_with(
    light: &Light,
    world: Vec3,
    normal: Vec3,
    colour: Vec3,
    shadow: impl FnOnce(Vec2, f32) -> f32,
) -> Vec4 {
    shade_by(light, world, normal, colour, |uv, z| {
        cut_leak(shadow(uv, z), light.light_leak)
    })
}

/// Moments from a map's texel.
#[inline(always)]
fn decode(texel: Vec4, how: u32) -> Moments4<f32> {
    let q = Quantized4 {
        r: texel.x,
        g: texel.y,
        b: texel.z,
        a: texel.w,
    };
    if how == encoding::UNIT {
        dequantize_unit_4(q)
    } else if how == encoding::SYMMETRIC {
        dequantize_symmetric_4(q)
    } else {
        Moments4 {
            b1: q.r,
            b2: q.g,
            b3: q.b,
            b4: q.a,
        }
    }
}

/// The map's depth range: [0, 1] or [-1, 1].
#[inline(always)]
pub(crate) fn in_range(z: f32, how: u32) -> f32 {
    if how == encoding::UNIT {
        z
    } else {
        2.0 * z - 1.0
    }
}

/// The map's moments at a place.
#[inline(always)]
pub(crate) fn look_up(map: Texture2d<'_>, sampler: Sampler, how: u32, uv: Vec2) -> Moments4<f32> {
    decode(map.sample_level(sampler, uv, 0.0), how)
}

/// Moments with the light's bias mixed in.
#[inline(always)]
pub(crate) fn biased(light: &Light, m: Moments4<f32>) -> Moments4<f32> {
    let t = light.bias_target;
    let target = Moments4 {
        b1: t.x,
        b2: t.y,
        b3: t.z,
        b4: t.w,
    };
    m.lerp(target, light.moment_bias)
}

/// The least shadow that a texel's four moments allow for a receiver's depth from 0 to 1, with depths
/// anywhere on the line.
#[inline(always)]
pub(crate) fn hamburger_shadow(light: &Light, texel: Vec4, z: f32, how: u32) -> f32 {
    hamburger_4(biased(light, decode(texel, how)), in_range(z, how))
}

/// The same with depths within the map's range.
#[inline(always)]
pub(crate) fn hausdorff_shadow(light: &Light, texel: Vec4, z: f32, how: u32) -> f32 {
    let m = biased(light, decode(texel, how));
    let z = in_range(z, how);
    if how == encoding::UNIT {
        hausdorff_4(m, z)
    } else {
        hausdorff_4_symmetric(m, z)
    }
}

shading! {
    /// Shading with Hamburger four moment shadow mapping.
    shade_hamburger,
    /// Shading with Hamburger four moment shadow mapping, with mip levels.
    shade_hamburger_mips,
    hamburger_shadow(map), inputs(shaded), uniforms(), constants(
        #[constant(id = 0, default = 2)]
        #[values(encoding::PLAIN, encoding::UNIT, encoding::SYMMETRIC)]
        encoding: u32
    ),
    parity(
        ulp = 0,
        absolute = 5e-4,
        why = "the depth in the light's view is rounded, by up to 3e-7, and the bound's steepest slope with the least bias, 5e-7, is 1400"
    )
}

shading! {
    /// Shading with Hausdorff four moment shadow mapping.
    shade_hausdorff,
    /// Shading with Hausdorff four moment shadow mapping, with mip levels.
    shade_hausdorff_mips,
    hausdorff_shadow(map), inputs(shaded_in_range), uniforms(), constants(
        #[constant(id = 0, default = 2)]
        #[values(encoding::PLAIN, encoding::UNIT, encoding::SYMMETRIC)]
        encoding: u32
    ),
    parity(
        ulp = 0,
        absolute = 5e-4,
        why = "the depth in the light's view is rounded, by up to 3e-7, and the bound's steepest slope with the least bias, 5e-7, is 1400"
    )
}

/// [`percentage_closer_weighted`] of the samples of a depth map that are nearer than `z`.
#[inline(always)]
pub(crate) fn weighted_nearer(
    depth: impl Samples,
    taps: &Taps,
    samples: u32,
    uv: Vec2,
    z: f32,
) -> f32 {
    let weight = |i: u32| taps.weight(i);
    percentage_closer_weighted(depth.size(), taps.count, uv, weight, |at| {
        let is_nearer = |i: u32| {
            if depth.load_sample(at, i).x < z {
                1.0
            } else {
                0.0
            }
        };
        mean_of(samples, is_nearer)
    })
}

of_samples! {
    /// Shading with percentage-closer filtering: the share of a square of depths that is nearer than
    /// the receiver, the first sample of each texel. The reference for the others.
    #[kernel(fragment, inputs = crate::inputs::maps::shaded_depths)]
    shade_pcf,
    shade_single_pcf,
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
    |depth| {
        shade_by(light, world, normal, colour, |uv, z| {
            percentage_closer(depth.size(), light.filter_radius, uv, |at| {
                if depth.load_sample(at, 0).x < z { 1.0 } else { 0.0 }
            })
        })
    }
}

of_samples! {
    /// Shading with percentage-closer filtering that has the weights of a separable filter and of
    /// bilinear lookup, over all samples of each texel: what a filtered shadow map approximates, and
    /// what lower bounds are never darker than. `taps` are those of [`crate::blur::blur`]; their step is not used.
    #[kernel(
        fragment,
        inputs = crate::inputs::maps::weighted_depths,
        parity(
            ulp = 0,
            absolute = 4e-5,
            why = "drivers may contract products and sums: a place in a map of 61 texels is then off by 4e-6 texels, and so are the weights of the light, whose strength is 2.5"
        )
    )]
    shade_pcf_gaussian,
    shade_single_pcf_gaussian,
    (
        #[varying] world: Vec3,
        #[varying]
        #[unit_vector]
        normal: Vec3,
        #[varying]
        #[range(0.0..=1.0)]
        colour: Vec3,
        #[uniform] light: &Light,
        #[uniform] taps: &Taps,
    ) -> Vec4,
    |depth; samples| {
        shade_by(light, world, normal, colour, |uv, z| {
            weighted_nearer(depth, taps, samples, uv, z)
        })
    }
}

/// The sum of two pictures, which two lights make of the same surfaces; each channel in [0, 65504].
#[kernel(
    compute,
    threads(8, 8),
    texture(rgba16float, rgba32float),
    forms(fragment),
    parity(
        ulp = 1,
        exact(rgba32float),
        why = "one sum, then rounding to 16 bits, up or down: one step"
    )
)]
pub fn sum_lights(
    #[index] at: UVec2,
    #[texture] first: Texture2d<'_>,
    #[texture] second: Texture2d<'_>,
) -> Vec4 {
    let (a, b) = (first.load(at), second.load(at));
    // 65504 is the most that 16 bits hold.
    let channel = |a: f32, b: f32| Real::clamp(a + b, 0.0, 65504.0);
    Vec4::new(channel(a.x, b.x), channel(a.y, b.y), channel(a.z, b.z), 1.0)
}
