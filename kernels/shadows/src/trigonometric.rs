//! Trigonometric moment shadow mapping: as maps over rows of moments, and from depths to shading.

use hankel_dsl::glam::{UVec2, Vec3, Vec4};
use hankel_dsl::{Element, Real, Sampler, Texture2d, kernel};
use hankel_moments::{
    Bounds, HalfAngle, TrigonometricMoments, cut_leak, trigonometric_4, trigonometric_4_compensated,
};

use crate::bounds::Shadow;
use crate::samples::Samples;
use crate::shade::Light;

/// How a map holds trigonometric moments: values of the specialisation constant `encoding`.
pub mod encoding {
    /// As they are.
    pub const PLAIN: u32 = 0;
    /// Moved from [-1, 1] to [0, 1].
    pub const UNORM: u32 = 1;
}

/// How trigonometric moments are turned into a shadow.
#[derive(Clone, Copy, Debug, PartialEq, Element)]
#[repr(C)]
pub struct TrigonometricSettings<R> {
    /// How much of the uniform distribution is mixed in, from 0 to 1.
    #[magnitude(1e-7..=1e-2)]
    #[default(0)]
    pub moment_bias: R,
    /// What is taken off the receiver's depth.
    #[magnitude(1e-7..=1e-2)]
    #[default(0)]
    pub depth_bias: R,
    /// Where between the least shadow, 0, and the greatest, 1.
    #[range(0.0..=1.0)]
    #[default(0)]
    pub overestimation: R,
    /// A shadow of 1 minus this is full: from 0 to 0.5.
    #[range(0.0..=0.5)]
    #[default(0)]
    pub light_leak: R,
}

/// A receiver and the trigonometric moments at its place in the map.
#[derive(Clone, Copy, Debug, PartialEq, Element)]
#[repr(C)]
pub struct TrigonometricReceiver<R> {
    /// The filtered moments.
    pub moments: TrigonometricMoments<R>,
    /// The receiver's depth, from 0 to 1.
    #[range(0.0..=1.0)]
    pub depth: R,
}

/// A depth.
#[derive(Clone, Copy, Debug, PartialEq, Element)]
#[repr(C)]
pub struct UnitDepth<R> {
    /// Depth, from 0 to 1.
    #[range(0.0..=1.0)]
    pub depth: R,
}

#[inline(always)]
fn biased<R: Real>(
    settings: &TrigonometricSettings<R>,
    receiver: TrigonometricReceiver<R>,
) -> (TrigonometricMoments<R>, R) {
    let m = receiver.moments.biased(settings.moment_bias);
    (m, receiver.depth - settings.depth_bias)
}

#[inline(always)]
fn shadow<R: Real>(settings: &TrigonometricSettings<R>, bounds: Bounds<R>) -> Shadow<R> {
    Shadow {
        shadow: cut_leak(bounds.blend(settings.overestimation), settings.light_leak),
    }
}

/// Trigonometric moment shadow mapping: the shadow that two complex trigonometric moments allow,
/// for depths in [0, 1].
#[kernel(
    compute,
    threads(64),
    precision(f32, f64),
    compensated = trigonometric_4msm_compensated,
    inputs = crate::inputs::trigonometric_receivers
)]
pub fn trigonometric_4msm<R: Real>(
    #[uniform] settings: &TrigonometricSettings<R>,
    #[element] receiver: TrigonometricReceiver<R>,
) -> Shadow<R> {
    let (m, z) = biased(settings, receiver);
    shadow(settings, trigonometric_4(m, HalfAngle::of_depth(z)))
}

/// `trigonometric_4msm` with what is ill-conditioned in about twice the digits.
#[kernel(
    compute,
    threads(64),
    precision(f32, f64),
    pinned,
    inputs = crate::inputs::trigonometric_receivers,
    parity(
        absolute = 2e-45,
        why = "shaders take a product's error from partial products, which may underflow: one subnormal step"
    )
)]
pub fn trigonometric_4msm_compensated<R: Real>(
    #[uniform] settings: &TrigonometricSettings<R>,
    #[element] receiver: TrigonometricReceiver<R>,
) -> Shadow<R> {
    let (m, z) = biased(settings, receiver);
    shadow(settings, trigonometric_4_compensated(m, z))
}

/// The trigonometric moments of one depth: what a map for them stores.
#[kernel(compute, threads(64), precision(f32, f64))]
pub fn trigonometric_moments<R: Real>(#[element] depth: UnitDepth<R>) -> TrigonometricMoments<R> {
    TrigonometricMoments::of_depth(depth.depth)
}

#[inline(always)]
fn moments(z: f32) -> Vec4 {
    let m = TrigonometricMoments::of_depth(z);
    Vec4::new(m.c1, m.s1, m.c2, m.s2)
}

/// Mean of a texel's moments, as they are.
#[inline(always)]
fn mean_plain(depth: impl Samples, at: UVec2, samples: u32) -> Vec4 {
    depth.mean_of_depths(at, samples, moments)
}

/// Mean of a texel's moments, moved to [0, 1].
#[inline(always)]
fn mean_unorm(depth: impl Samples, at: UVec2, samples: u32) -> Vec4 {
    depth.mean_of_depths(at, samples, |z| moments(z) * 0.5 + Vec4::splat(0.5))
}

of_samples! {
    /// Mean of a texel's two complex trigonometric moments, depths in [0, 1], as they are, for a 32-bit map.
    #[kernel(
        compute,
        threads(8, 8),
        texture(rgba32float),
        forms(fragment),
        inputs = crate::inputs::maps::depths,
        parity(
            ulp = 0,
            absolute = 1e-6,
            why = "drivers may contract products and sums: sine and cosine of half the angle are within 2.4e-7 either way, and doubling the angle twice makes four times that"
        )
    )]
    resolve_trigonometric_plain,
    resolve_single_trigonometric_plain,
    (#[index] at: UVec2,) -> Vec4,
    |depth; samples| { mean_plain(depth, at, samples) }
}

of_samples! {
    /// Mean of a texel's two complex trigonometric moments, depths in [0, 1], moved to [0, 1] for 16 bits.
    #[kernel(
        compute,
        threads(8, 8),
        texture(rgba16unorm),
        forms(fragment),
        inputs = crate::inputs::maps::depths,
        parity(
            ulp = 0,
            absolute = 1.6e-5,
            why = "sums and products only, then rounding to 1/65535: drivers may round a tie either way, which is one step"
        )
    )]
    resolve_trigonometric_unorm,
    resolve_single_trigonometric_unorm,
    (#[index] at: UVec2,) -> Vec4,
    |depth; samples| { mean_unorm(depth, at, samples) }
}

shading! {
    /// Shading with trigonometric moment shadow mapping.
    shade_trigonometric,
    /// Shading with trigonometric moment shadow mapping, with mip levels.
    shade_trigonometric_mips,
    trigonometric_shadow(map), inputs(shaded_trigonometric), uniforms(), constants(
        #[constant(id = 0, default = 1)]
        #[values(encoding::PLAIN, encoding::UNORM)]
        encoding: u32
    ),
    parity(
        ulp = 0,
        absolute = 4e-3,
        why = "the depth in the light's view is rounded, by up to 1.5e-7; with the least bias, 4e-7, the bound's steepest slope is 0.65 over a deviation of 4.5e-4 on the circle, 7.1e-5 in depth, and the light's strength is 2.5"
    )
}

/// The least shadow that a texel's moments allow for a receiver's depth from 0 to 1.
#[inline(always)]
pub(crate) fn trigonometric_shadow(light: &Light, texel: Vec4, z: f32, how: u32) -> f32 {
    let held = |x: f32| {
        if how == encoding::UNORM {
            2.0 * x - 1.0
        } else {
            x
        }
    };
    let m = TrigonometricMoments {
        c1: held(texel.x),
        s1: held(texel.y),
        c2: held(texel.z),
        s2: held(texel.w),
    };
    trigonometric_4(m.biased(light.moment_bias), HalfAngle::of_depth(z)).lower
}
