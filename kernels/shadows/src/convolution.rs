//! Convolution shadow maps (\[CSM\] of [`hankel_moments`]), from depths to shading: cosines and sines of four or of
//! eight odd multiples of a depth are filtered, and the Fourier series of a comparison is made of their means.
//!
//! Channels are moved from [-1, 1] to [0, 1]; the authors store 8 bits. A texture has the cosines, or the sines, of
//! four terms. Comparisons are as wide as the terms leave them: unlike a bound, the shadow is too dark at some
//! places and too light at others.

#![allow(
    clippy::too_many_arguments,
    reason = "a kernel's parameters are its bindings"
)]

use core::ops::{AddAssign, Div};

use hankel_dsl::glam::{UVec2, Vec3, Vec4};
use hankel_dsl::{Element, Sampler, Texture2d, Texture2dMultisampled, kernel};
use hankel_moments::{OddHarmonics, fourier_light};

use crate::depth::Transform;
use crate::mips::{Raster, View};
use crate::resolve::mean;
use crate::shade::{Light, shade_with};

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
    fn sum(self, weights: Vec4, receiver: OddHarmonics<f32>) -> f32 {
        let signed = |v: Vec4| array(v * 2.0 - Vec4::ONE);
        let mean = OddHarmonics {
            cos: signed(self.cosines),
            sin: signed(self.sines),
        };
        receiver.sum(mean, array(weights))
    }
}

#[inline(always)]
fn low(z: f32) -> Terms {
    let [low, _] = OddHarmonics::of_depth(z);
    Terms::held(low)
}

#[inline(always)]
fn high(z: f32) -> Terms {
    let [_, high] = OddHarmonics::of_depth(z);
    Terms::held(high)
}

/// The shadow of a receiver's depth from 0 to 1, by four terms.
#[inline(always)]
pub(crate) fn shadow_4(series: &Series, terms: Terms, z: f32) -> f32 {
    let [low, _] = OddHarmonics::of_depth(z);
    1.0 - fourier_light(terms.sum(series.low, low))
}

/// The same by eight.
#[inline(always)]
pub(crate) fn shadow_8(series: &Series, terms: [Terms; 2], z: f32) -> f32 {
    let [low, high] = OddHarmonics::of_depth(z);
    let [first, second] = terms;
    1.0 - fourier_light(first.sum(series.low, low) + second.sum(series.high, high))
}

/// Means of a texel's cosines and sines of four terms, in 8 bits.
#[kernel(
    compute,
    threads(8, 8),
    outputs(rgba8unorm, rgba8unorm),
    inputs = crate::inputs::maps::depths,
    parity(
        ulp = 0,
        absolute = 4e-3,
        why = "sums and products only, then rounding to 1/255: drivers may round a tie either way, which is one step"
    )
)]
pub fn resolve_convolution_rgba8unorm(
    #[index] at: UVec2,
    #[constant(id = 0, default = 4)]
    #[values(1, 4)]
    samples: u32,
    #[texture] depth: Texture2dMultisampled<'_>,
) -> (Vec4, Vec4) {
    let terms = mean(depth, at, samples, low);
    (terms.cosines, terms.sines)
}

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
pub fn resolve_convolution_rgba16unorm(
    #[index] at: UVec2,
    #[constant(id = 0, default = 4)]
    #[values(1, 4)]
    samples: u32,
    #[texture] depth: Texture2dMultisampled<'_>,
) -> (Vec4, Vec4) {
    let terms = mean(depth, at, samples, low);
    (terms.cosines, terms.sines)
}

/// Means of a texel's cosines and sines of eight terms, in 8 bits: of terms 1 to 4, then of terms 5 to 8.
#[kernel(
    compute,
    threads(8, 8),
    outputs(rgba8unorm, rgba8unorm, rgba8unorm, rgba8unorm),
    inputs = crate::inputs::maps::depths,
    parity(
        ulp = 0,
        absolute = 4e-3,
        why = "sums and products only, then rounding to 1/255: drivers may round a tie either way, which is one step"
    )
)]
pub fn resolve_convolution_8_rgba8unorm(
    #[index] at: UVec2,
    #[constant(id = 0, default = 4)]
    #[values(1, 4)]
    samples: u32,
    #[texture] depth: Texture2dMultisampled<'_>,
) -> (Vec4, Vec4, Vec4, Vec4) {
    let first = mean(depth, at, samples, low);
    let second = mean(depth, at, samples, high);
    (first.cosines, first.sines, second.cosines, second.sines)
}

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
pub fn resolve_convolution_8_rgba16unorm(
    #[index] at: UVec2,
    #[constant(id = 0, default = 4)]
    #[values(1, 4)]
    samples: u32,
    #[texture] depth: Texture2dMultisampled<'_>,
) -> (Vec4, Vec4, Vec4, Vec4) {
    let first = mean(depth, at, samples, low);
    let second = mean(depth, at, samples, high);
    (first.cosines, first.sines, second.cosines, second.sines)
}

/// Shading with convolution shadow mapping, by four terms.
#[kernel(
    fragment,
    inputs = crate::inputs::maps::shaded_convolution,
    parity(
        ulp = 0,
        absolute = 5e-5,
        why = "the depth in the light's view is rounded, by up to 3e-7, and the steepest slope of four terms is 16; drivers may contract products and sums: each of 8 products of numbers up to 1 with weights that add up to 1.1, doubled, is off by up to 4e-6; the light's strength is 2.5"
    )
)]
pub fn shade_convolution(
    #[varying] world: Vec3,
    #[varying]
    #[unit_vector]
    normal: Vec3,
    #[varying]
    #[range(0.0..=1.0)]
    colour: Vec3,
    #[uniform] light: &Light,
    #[uniform] series: &Series,
    #[texture] cosines: Texture2d<'_>,
    #[texture] sines: Texture2d<'_>,
    #[sampler] sampler: Sampler,
) -> Vec4 {
    shade_with(light, world, normal, colour, |uv, z| {
        let terms = Terms {
            cosines: cosines.sample_level(sampler, uv, 0.0),
            sines: sines.sample_level(sampler, uv, 0.0),
        };
        shadow_4(series, terms, z)
    })
}

/// Shading with convolution shadow mapping, by eight terms.
#[kernel(
    fragment,
    inputs = crate::inputs::maps::shaded_convolution_8,
    parity(
        ulp = 0,
        absolute = 1e-4,
        why = "the depth in the light's view is rounded, by up to 3e-7, and the steepest slope of eight terms is 32; drivers may contract products and sums: each of 16 products of numbers up to 1 with weights that add up to 1.3, doubled, is off by up to 8e-6; the light's strength is 2.5"
    )
)]
pub fn shade_convolution_8(
    #[varying] world: Vec3,
    #[varying]
    #[unit_vector]
    normal: Vec3,
    #[varying]
    #[range(0.0..=1.0)]
    colour: Vec3,
    #[uniform] light: &Light,
    #[uniform] series: &Series,
    #[texture] cosines: Texture2d<'_>,
    #[texture] sines: Texture2d<'_>,
    #[texture] high_cosines: Texture2d<'_>,
    #[texture] high_sines: Texture2d<'_>,
    #[sampler] sampler: Sampler,
) -> Vec4 {
    shade_with(light, world, normal, colour, |uv, z| {
        let first = Terms {
            cosines: cosines.sample_level(sampler, uv, 0.0),
            sines: sines.sample_level(sampler, uv, 0.0),
        };
        let second = Terms {
            cosines: high_cosines.sample_level(sampler, uv, 0.0),
            sines: high_sines.sample_level(sampler, uv, 0.0),
        };
        shadow_8(series, [first, second], z)
    })
}

/// Shading with convolution shadow mapping, by four terms, with mip levels.
#[kernel(
    fragment,
    inputs = crate::inputs::mips::shaded_convolution,
    parity(
        ulp = 0,
        absolute = 5e-5,
        why = "the depth in the light's view is rounded, by up to 3e-7, and the steepest slope of four terms is 16; drivers may contract products and sums: each of 8 products of numbers up to 1 with weights that add up to 1.1, doubled, is off by up to 4e-6; the light's strength is 2.5"
    )
)]
pub fn shade_convolution_mips(
    #[varying] world: Vec3,
    #[varying]
    #[unit_vector]
    normal: Vec3,
    #[varying]
    #[range(0.0..=1.0)]
    colour: Vec3,
    #[varying]
    #[unit_vector]
    plane: Vec3,
    #[uniform] light: &Light,
    #[uniform] camera: &Transform,
    #[uniform] raster: &Raster,
    #[uniform] series: &Series,
    #[texture] cosines: Texture2d<'_>,
    #[texture] sines: Texture2d<'_>,
    #[sampler] sampler: Sampler,
) -> Vec4 {
    let view = View {
        light,
        camera,
        raster,
        size: cosines.size(),
    };
    view.light_up(world, normal, colour, plane, |footprint, uv, z| {
        let terms = Terms {
            cosines: footprint.mean(uv, |uv, level| cosines.sample_level(sampler, uv, level)),
            sines: footprint.mean(uv, |uv, level| sines.sample_level(sampler, uv, level)),
        };
        shadow_4(series, terms, z)
    })
}

/// Shading with convolution shadow mapping, by eight terms, with mip levels.
#[kernel(
    fragment,
    inputs = crate::inputs::mips::shaded_convolution_8,
    parity(
        ulp = 0,
        absolute = 1e-4,
        why = "the depth in the light's view is rounded, by up to 3e-7, and the steepest slope of eight terms is 32; drivers may contract products and sums: each of 16 products of numbers up to 1 with weights that add up to 1.3, doubled, is off by up to 8e-6; the light's strength is 2.5"
    )
)]
pub fn shade_convolution_8_mips(
    #[varying] world: Vec3,
    #[varying]
    #[unit_vector]
    normal: Vec3,
    #[varying]
    #[range(0.0..=1.0)]
    colour: Vec3,
    #[varying]
    #[unit_vector]
    plane: Vec3,
    #[uniform] light: &Light,
    #[uniform] camera: &Transform,
    #[uniform] raster: &Raster,
    #[uniform] series: &Series,
    #[texture] cosines: Texture2d<'_>,
    #[texture] sines: Texture2d<'_>,
    #[texture] high_cosines: Texture2d<'_>,
    #[texture] high_sines: Texture2d<'_>,
    #[sampler] sampler: Sampler,
) -> Vec4 {
    let view = View {
        light,
        camera,
        raster,
        size: cosines.size(),
    };
    view.light_up(world, normal, colour, plane, |footprint, uv, z| {
        let first = Terms {
            cosines: footprint.mean(uv, |uv, level| cosines.sample_level(sampler, uv, level)),
            sines: footprint.mean(uv, |uv, level| sines.sample_level(sampler, uv, level)),
        };
        let second = Terms {
            cosines: footprint.mean(uv, |uv, level| {
                high_cosines.sample_level(sampler, uv, level)
            }),
            sines: footprint.mean(uv, |uv, level| high_sines.sample_level(sampler, uv, level)),
        };
        shadow_8(series, [first, second], z)
    })
}
