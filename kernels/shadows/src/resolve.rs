//! From multisampled depth to filterable moments: each sample's depth gives a moment vector, the
//! texel stores their mean (\[BHS\], lecture, "Generate a moment shadow map", step 2). Here are four power
//! moments.

use core::ops::{AddAssign, Div};

use hankel_dsl::glam::{UVec2, Vec4};
use hankel_dsl::{Real, Texture2dMultisampled, kernel};
use hankel_moments::{Moments4, Quantized4, quantize_symmetric_4, quantize_unit_4};

/// The mean of what the samples of a texel give; depths beyond [0, 1] are moved to its ends.
#[inline(always)]
pub(crate) fn mean<T: AddAssign + Div<f32, Output = T>>(
    depth: Texture2dMultisampled<'_>,
    at: UVec2,
    samples: u32,
    moments: impl Fn(f32) -> T,
) -> T {
    mean_of(samples, |i| moments(Real::saturate(depth.load(at, i).x)))
}

/// The mean over a texel's samples.
#[inline(always)]
pub(crate) fn mean_of<T: AddAssign + Div<f32, Output = T>>(
    samples: u32,
    sample: impl Fn(u32) -> T,
) -> T {
    let mut sum = sample(0);
    let mut i = 1;
    while i < samples {
        sum += sample(i);
        i += 1;
    }
    sum / samples as f32
}

#[inline(always)]
fn quantized(q: Quantized4<f32>) -> Vec4 {
    Vec4::new(q.r, q.g, q.b, q.a)
}

/// Depth in [0, 1] as a depth in [-1, 1].
#[inline(always)]
fn symmetric(z: f32) -> Moments4<f32> {
    Moments4::of_depth(2.0 * z - 1.0)
}

/// Mean of a texel's moments, depths moved to [-1, 1], in the basis optimised for 16 bits.
#[inline(always)]
pub(crate) fn mean_symmetric(depth: Texture2dMultisampled<'_>, at: UVec2, samples: u32) -> Vec4 {
    mean(depth, at, samples, |z| {
        quantized(quantize_symmetric_4(symmetric(z)))
    })
}

/// Mean of a texel's moments, depths in [0, 1], in the basis optimised for 16 bits.
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
pub fn resolve_unit(
    #[index] at: UVec2,
    #[constant(id = 0, default = 4)]
    #[values(1, 4)]
    samples: u32,
    #[texture] depth: Texture2dMultisampled<'_>,
) -> Vec4 {
    mean(depth, at, samples, |z| {
        quantized(quantize_unit_4(Moments4::of_depth(z)))
    })
}

/// Mean of a texel's moments, depths moved to [-1, 1], in the basis optimised for 16 bits.
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
pub fn resolve_symmetric(
    #[index] at: UVec2,
    #[constant(id = 0, default = 4)]
    #[values(1, 4)]
    samples: u32,
    #[texture] depth: Texture2dMultisampled<'_>,
) -> Vec4 {
    mean_symmetric(depth, at, samples)
}

/// Mean of a texel's moments, depths moved to [-1, 1], as they are, for a 32-bit map.
#[kernel(
    compute,
    threads(8, 8),
    texture(rgba32float),
    forms(fragment),
    inputs = crate::inputs::maps::depths
)]
pub fn resolve_plain(
    #[index] at: UVec2,
    #[constant(id = 0, default = 4)]
    #[values(1, 4)]
    samples: u32,
    #[texture] depth: Texture2dMultisampled<'_>,
) -> Vec4 {
    mean(depth, at, samples, |z| {
        let m = symmetric(z);
        Vec4::new(m.b1, m.b2, m.b3, m.b4)
    })
}
