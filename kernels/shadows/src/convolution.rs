//! Convolution shadow maps (\[CSM\] of [`hankel_moments`]), from depths to shading: cosines and sines of four or of
//! eight odd multiples of a depth are filtered, and the Fourier series of a comparison is made of their means.
//!
//! Channels are moved from [-1, 1] to [0, 1]; the authors store 8 bits. A texture has the cosines, or the sines, of
//! four terms. Comparisons are as wide as the terms leave them: unlike a bound, the shadow is too dark at some
//! places and too light at others.

use core::ops::{AddAssign, Div};

use hankel_dsl::glam::{UVec2, Vec3, Vec4};
use hankel_dsl::{Element, Sampler, Texture2d, kernel};
use hankel_moments::{OddHarmonics, fourier_light};

use crate::samples::Samples;
use crate::shade::Light;

/// What each term counts for.
#[derive(Clone, Copy, Debug, PartialEq, Element)]
#[repr(C)]
pub struct Series {
    /// Of terms 1 to 4: 2 / ((2k - 1) π), times what attenuates ringing, from 0 to 1.
    #[range(0.0..=0.64)]
    pub low: Vec4,
    /// Of terms 5 to 8.
    #[range(0.0..=0.08)]
    pub high: Vec4,
}

/// Four terms of a depth, or their means.
#[derive(Clone, Copy)]
pub(crate) struct Terms {
    pub(crate) cosines: Vec4,
    pub(crate) sines: Vec4,
}

impl AddAssign for Terms {
    #[inline(always)]
    fn add_assign(&mut self, other: Self) {
        self.cosines += other.cosines;
        self.sines += other.sines;
    }
}

impl Div<f32> for Terms {
    type Output = Self;
    #[inline(always)]
    fn div(self, by: f32) -> Self {
        Self {
            cosines: self.cosines / by,
            sines: self.sines / by,
        }
    }
}

#[inline(always)]
fn array(v: Vec4) -> [f32; 4] {
    [v.x, v.y, v.z, v.w]
}

impl Terms {
    /// As a map holds those of one depth.
    #[inline(always)]
    fn held(harmonics: OddHarmonics<f32>) -> Self {
        let unorm = |[a, b, c, d]: [f32; 4]| {
            let half = |x: f32| 0.5 * x + 0.5;
            Vec4::new(half(a), half(b), half(c), half(d))
        };
        Self {
            cosines: unorm(harmonics.cos),
            sines: unorm(harmonics.sin),
        }
    }

    /// What these terms of a map add to the series of a receiver.
    #[inline(always)]
    pub(crate) fn sum(self, weights: Vec4, receiver: OddHarmonics<f32>) -> f32 {
        let signed = |v: Vec4| array(v * 2.0 - Vec4::ONE);
        let mean = OddHarmonics {
            cos: signed(self.cosines),
            sin: signed(self.sines),
        };
        receiver.sum(mean, array(weights))
    }
}

#[inline(always)]
pub(crate) fn low(z: f32) -> Terms {
    let [low, _] = OddHarmonics::of_depth(z);
    Terms::held(low)
}

#[inline(always)]
pub(crate) fn high(z: f32) -> Terms {
    let [_, high] = OddHarmonics::of_depth(z);
    Terms::held(high)
}

/// The shadow of a receiver's depth from 0 to 1, by four terms.
#[inline(always)]
fn shadow_4(_: &Light, series: &Series, cosines: Vec4, sines: Vec4, z: f32) -> f32 {
    let [low, _] = OddHarmonics::of_depth(z);
    let terms = Terms { cosines, sines };
    1.0 - fourier_light(terms.sum(series.low, low))
}

/// The same by eight.
#[inline(always)]
fn shadow_8(
    _: &Light,
    series: &Series,
    cosines: Vec4,
    sines: Vec4,
    high_cosines: Vec4,
    high_sines: Vec4,
    z: f32,
) -> f32 {
    let [low, high] = OddHarmonics::of_depth(z);
    let first = Terms { cosines, sines };
    let second = Terms {
        cosines: high_cosines,
        sines: high_sines,
    };
    1.0 - fourier_light(first.sum(series.low, low) + second.sum(series.high, high))
}

/// Means of a texel's cosines and sines of four terms.
#[inline(always)]
fn mean_4(depth: impl Samples, at: UVec2, samples: u32) -> (Vec4, Vec4) {
    let terms = depth.mean_of_depths(at, samples, low);
    (terms.cosines, terms.sines)
}

/// The same of eight.
#[inline(always)]
fn mean_8(depth: impl Samples, at: UVec2, samples: u32) -> (Vec4, Vec4, Vec4, Vec4) {
    let first = depth.mean_of_depths(at, samples, low);
    let second = depth.mean_of_depths(at, samples, high);
    (first.cosines, first.sines, second.cosines, second.sines)
}

of_samples! {
    /// Means of a texel's cosines and sines of four terms, in 8 bits.
    #[kernel(
        compute,
        threads(8, 8),
        outputs(rgba8unorm, rgba8unorm),
        forms(fragment),
        inputs = crate::inputs::maps::depths,
        parity(
            ulp = 0,
            absolute = 4e-3,
            why = "sums and products only, then rounding to 1/255: drivers may round a tie either way, which is one step"
        )
    )]
    resolve_convolution_rgba8unorm,
    resolve_single_convolution_rgba8unorm,
    (#[index] at: UVec2,) -> (Vec4, Vec4),
    |depth; samples| { mean_4(depth, at, samples) }
}

of_samples! {
    /// Means of a texel's cosines and sines of eight terms, in 8 bits: of terms 1 to 4, then of terms 5 to 8.
    #[kernel(
        compute,
        threads(8, 8),
        outputs(rgba8unorm, rgba8unorm, rgba8unorm, rgba8unorm),
        forms(fragment),
        inputs = crate::inputs::maps::depths,
        parity(
            ulp = 0,
            absolute = 4e-3,
            why = "sums and products only, then rounding to 1/255: drivers may round a tie either way, which is one step"
        )
    )]
    resolve_convolution_8_rgba8unorm,
    resolve_single_convolution_8_rgba8unorm,
    (#[index] at: UVec2,) -> (Vec4, Vec4, Vec4, Vec4),
    |depth; samples| { mean_8(depth, at, samples) }
}

of_samples! {
    /// Means of a texel's cosines and sines of four terms, in 16 bits.
    #[kernel(
        compute,
        threads(8, 8),
        outputs(rgba16unorm, rgba16unorm),
        inputs = crate::inputs::maps::depths,
        parity(
            ulp = 0,
            absolute = 1.6e-5,
            why = "sums and products only, then rounding to 1/65535: drivers may round a tie either way, which is one step"
        )
    )]
    resolve_convolution_rgba16unorm [forms(fragment = resolve_convolution_rgba8unorm)],
    resolve_single_convolution_rgba16unorm [forms(fragment = resolve_single_convolution_rgba8unorm)],
    (#[index] at: UVec2,) -> (Vec4, Vec4),
    |depth; samples| { mean_4(depth, at, samples) }
}

of_samples! {
    /// Means of a texel's cosines and sines of eight terms, in 16 bits: of terms 1 to 4, then of terms 5 to 8.
    #[kernel(
        compute,
        threads(8, 8),
        outputs(rgba16unorm, rgba16unorm, rgba16unorm, rgba16unorm),
        inputs = crate::inputs::maps::depths,
        parity(
            ulp = 0,
            absolute = 1.6e-5,
            why = "sums and products only, then rounding to 1/65535: drivers may round a tie either way, which is one step"
        )
    )]
    resolve_convolution_8_rgba16unorm [forms(fragment = resolve_convolution_8_rgba8unorm)],
    resolve_single_convolution_8_rgba16unorm [forms(fragment = resolve_single_convolution_8_rgba8unorm)],
    (#[index] at: UVec2,) -> (Vec4, Vec4, Vec4, Vec4),
    |depth; samples| { mean_8(depth, at, samples) }
}

shading! {
    /// Shading with convolution shadow mapping, by four terms.
    shade_convolution,
    /// Shading with convolution shadow mapping, by four terms, with mip levels.
    shade_convolution_mips,
    shadow_4(cosines, sines), inputs(shaded_convolution), uniforms(series: &Series), constants(),
    parity(
        ulp = 0,
        absolute = 5e-5,
        why = "the depth in the light's view is rounded, by up to 3e-7, and the steepest slope of four terms is 16; drivers may contract products and sums: each of 8 products of numbers up to 1 with weights that add up to 1.1, doubled, is off by up to 4e-6; the light's strength is 2.5"
    )
}

shading! {
    /// Shading with convolution shadow mapping, by eight terms.
    shade_convolution_8,
    /// Shading with convolution shadow mapping, by eight terms, with mip levels.
    shade_convolution_8_mips,
    shadow_8(cosines, sines, high_cosines, high_sines), inputs(shaded_convolution_8), uniforms(series: &Series), constants(),
    parity(
        ulp = 0,
        absolute = 1e-4,
        why = "the depth in the light's view is rounded, by up to 3e-7, and the steepest slope of eight terms is 32; drivers may contract products and sums: each of 16 products of numbers up to 1 with weights that add up to 1.3, doubled, is off by up to 8e-6; the light's strength is 2.5"
    )
}
