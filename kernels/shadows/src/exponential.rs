//! Exponential shadow maps and exponential variance shadow maps, from depths to shading.
//!
//! The warps are computed by [`math`]: the same bits on every device, so that a map and what is compared
//! with it agree. They are taken of each sample's depth, and then filtered.

use hankel_dsl::glam::{UVec2, Vec2, Vec3, Vec4};
use hankel_dsl::{Element, Real, Sampler, Texture2d, kernel, math};
use hankel_moments::{markov_1, warped_2};

use crate::samples::Samples;
use crate::shade::Light;

/// Exponents of the two warps of exponential variance shadow maps, for depths moved to [-1, 1].
#[derive(Clone, Copy, Debug, PartialEq, Element)]
#[repr(C)]
pub struct Exponents {
    /// Of the warp that grows with depth: from 0 to 42 for 32-bit floats, to 5.54 for 16 bits, whose
    /// largest number is 65504.
    #[range(1.0..=42.0)]
    pub positive: f32,
    /// Of the one that falls, likewise.
    #[range(1.0..=42.0)]
    pub negative: f32,
}

impl Exponents {
    /// Both warps of a depth from 0 to 1, each above 0.
    #[inline(always)]
    pub(crate) fn warp(&self, z: f32) -> (f32, f32) {
        let z = 2.0 * Real::saturate(z) - 1.0;
        let most = |exponent: f32| Real::clamp(exponent, 0.0, 42.0);
        (
            math::exp(most(self.positive) * z),
            math::exp(-(most(self.negative) * z)),
        )
    }
}

/// `exp(exponent * z)` of a depth from 0 to 1; the exponent is at most 80.
#[inline(always)]
pub(crate) fn exponential(exponent: f32, z: f32) -> f32 {
    math::exp(Real::clamp(exponent, 0.0, 80.0) * Real::saturate(z))
}

/// Mean of a texel's `exp(exponent * z)`.
#[inline(always)]
fn mean_exponential(depth: impl Samples, at: UVec2, samples: u32, exponent: &f32) -> f32 {
    depth.mean_of_depths(at, samples, |z| exponential(*exponent, z))
}

/// Means of a texel's two warps and of their squares.
#[inline(always)]
fn mean_warps(depth: impl Samples, at: UVec2, samples: u32, exponents: &Exponents) -> Vec4 {
    depth.mean_of_depths(at, samples, |z| {
        let (positive, negative) = exponents.warp(z);
        Vec4::new(positive, positive * positive, negative, negative * negative)
    })
}

/// The same of the warp that grows with depth alone.
#[inline(always)]
fn mean_positive(depth: impl Samples, at: UVec2, samples: u32, exponents: &Exponents) -> Vec2 {
    depth.mean_of_depths(at, samples, |z| {
        let (positive, _) = exponents.warp(z);
        Vec2::new(positive, positive * positive)
    })
}

of_samples! {
    /// Mean of a texel's `exp(exponent * z)`, depths z in [0, 1]: an exponential shadow map.
    #[kernel(
        compute,
        threads(8, 8),
        texture(r32float),
        forms(fragment),
        pinned,
        inputs = crate::inputs::maps::exponential_depths
    )]
    resolve_esm,
    resolve_single_esm,
    (
        #[index] at: UVec2,
        #[uniform]
        #[range(1.0..=80.0)]
        exponent: &f32,
    ) -> f32,
    |depth; samples| { mean_exponential(depth, at, samples, exponent) }
}

of_samples! {
    /// Means of a texel's two warps and of their squares: an exponential variance shadow map.
    #[kernel(
        compute,
        threads(8, 8),
        texture(rgba16float, rgba32float),
        forms(fragment),
        pinned,
        inputs = crate::inputs::maps::warped_depths,
        parity(
            ulp = 1,
            exact(rgba32float),
            non_finite,
            why = "rounding to 16 bits, up or down: one step; with exponents above 5.54 they overflow"
        )
    )]
    resolve_evsm,
    resolve_single_evsm,
    (
        #[index] at: UVec2,
        #[uniform] exponents: &Exponents,
    ) -> Vec4,
    |depth; samples| { mean_warps(depth, at, samples, exponents) }
}

of_samples! {
    /// The same of the warp that grows with depth alone, in two channels.
    #[kernel(
        compute,
        threads(8, 8),
        texture(rg16float, rg32float),
        forms(fragment),
        pinned,
        inputs = crate::inputs::maps::warped_depths,
        parity(
            ulp = 1,
            exact(rg32float),
            non_finite,
            why = "rounding to 16 bits, up or down: one step; with exponents above 5.54 they overflow"
        )
    )]
    resolve_positive_evsm,
    resolve_single_positive_evsm,
    (
        #[index] at: UVec2,
        #[uniform] exponents: &Exponents,
    ) -> Vec2,
    |depth; samples| { mean_positive(depth, at, samples, exponents) }
}

shading! {
    /// Shading with exponential shadow mapping.
    shade_esm,
    /// Shading with exponential shadow mapping, with mip levels.
    shade_esm_mips,
    exponential_shadow(map), inputs(shaded_exponential), uniforms(
        #[range(1.0..=80.0)]
        exponent: &f32
    ), constants(),
    pinned
}

/// The least shadow that the mean of exponentials allows for a receiver's depth from 0 to 1.
#[inline(always)]
fn exponential_shadow(_: &Light, exponent: &f32, texel: Vec4, z: f32) -> f32 {
    markov_1(texel.x, exponential(*exponent, z))
}

shading! {
    /// Shading with exponential variance shadow mapping, by the warp that grows with depth or by both: the
    /// larger of two lower bounds is one, too.
    shade_evsm,
    /// Shading with exponential variance shadow mapping, with mip levels.
    shade_evsm_mips,
    warped_shadow(map), inputs(shaded_warps), uniforms(exponents: &Exponents), constants(
        #[constant(id = 0, default = 2)]
        #[values(1, 2)]
        warps: u32
    ),
    parity(
        ulp = 0,
        absolute = 5e-3,
        why = "the depth in the light's view is rounded, by up to 3e-7, and a warp 40 times as much; the bound's steepest slope with a relative variance of 1.6e-5 is 0.65 / 4e-3, and the light's strength is 2.5"
    )
}

/// The least shadow that a texel's warps allow for a receiver's depth from 0 to 1.
#[inline(always)]
fn warped_shadow(light: &Light, exponents: &Exponents, texel: Vec4, z: f32, warps: u32) -> f32 {
    let (positive, negative) = exponents.warp(z);
    let (nearer, _) = warped_2(texel.x, texel.y, positive, light.moment_bias);
    if warps == 1 {
        nearer
    } else {
        // What falls with depth is larger where depth is less.
        let (_, also_nearer) = warped_2(texel.z, texel.w, negative, light.moment_bias);
        Real::max(nearer, also_nearer)
    }
}
