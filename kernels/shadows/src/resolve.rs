//! From depth to filterable moments: each sample's depth gives a moment vector, the texel stores their mean
//! (\[BHS\], lecture, "Generate a moment shadow map", step 2). Here are four power moments.
//!
//! Each way to store a texel has a kernel for depth of several samples, `resolve_…`, and one for depth of one sample,
//! `resolve_single_…`.

use hankel_dsl::glam::{UVec2, Vec4};
use hankel_dsl::kernel;
use hankel_moments::{Moments4, quantize_symmetric_4, quantize_unit_4};

use crate::library::store::channels;
use crate::samples::Samples;

/// Depth in [0, 1] as a depth in [-1, 1].
#[inline(always)]
fn symmetric(z: f32) -> Moments4<f32> {
    Moments4::of_depth(2.0 * z - 1.0)
}

/// Mean of a texel's moments, depths moved to [-1, 1], in the basis optimised for 16 bits.
#[inline(always)]
pub(crate) fn mean_symmetric(depth: impl Samples, at: UVec2, samples: u32) -> Vec4 {
    depth.mean_of_depths(at, samples, |z| {
        channels(quantize_symmetric_4(symmetric(z)))
    })
}

/// The same of depths in [0, 1].
#[inline(always)]
fn mean_unit(depth: impl Samples, at: UVec2, samples: u32) -> Vec4 {
    depth.mean_of_depths(at, samples, |z| {
        channels(quantize_unit_4(Moments4::of_depth(z)))
    })
}

/// Mean of a texel's moments, depths moved to [-1, 1], as they are.
#[inline(always)]
fn mean_plain(depth: impl Samples, at: UVec2, samples: u32) -> Vec4 {
    depth.mean_of_depths(at, samples, |z| {
        let m = symmetric(z);
        Vec4::new(m.b1, m.b2, m.b3, m.b4)
    })
}

of_samples! {
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
    resolve_unit,
    resolve_single_unit,
    (#[index] at: UVec2,) -> Vec4,
    |depth; samples| { mean_unit(depth, at, samples) }
}

of_samples! {
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
    resolve_symmetric,
    resolve_single_symmetric,
    (#[index] at: UVec2,) -> Vec4,
    |depth; samples| { mean_symmetric(depth, at, samples) }
}

of_samples! {
    /// Mean of a texel's moments, depths moved to [-1, 1], as they are, for a 32-bit map.
    #[kernel(
        compute,
        threads(8, 8),
        texture(rgba32float),
        forms(fragment),
        inputs = crate::inputs::maps::depths
    )]
    resolve_plain,
    resolve_single_plain,
    (#[index] at: UVec2,) -> Vec4,
    |depth; samples| { mean_plain(depth, at, samples) }
}
