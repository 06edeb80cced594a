//! The separable filter, run once along rows and once along columns.

use core::ops::{Add, AddAssign, Mul};

use hankel_dsl::glam::{IVec2, UVec2, Vec2, Vec4};
use hankel_dsl::{Element, Texture2d, array_element, kernel};

use crate::grid::within;

/// The most weights of a filter pass: filters have up to 31 taps.
pub const MOST_WEIGHTS: usize = 16;

/// A pass of a symmetric separable filter: its direction and its weights, those of the centre and of the taps to one
/// side. The centre's plus twice the others should be 1.
#[derive(Clone, Copy, Debug, PartialEq, Element)]
#[repr(C)]
pub struct Taps {
    /// Step from one tap to the next in texels: (1, 0) or (0, 1).
    #[values(0, 1)]
    pub step: IVec2,
    /// How many weights there are, 1 to 16.
    #[range(1..=7)]
    pub count: u32,
    /// Fills the structure up.
    pub padding: u32,
    /// The centre's weight, then those at distance 1, 2, …; each in `x`, as arrays in uniforms are made of vectors.
    #[range(0.0..=0.15)]
    pub weights: [Vec4; MOST_WEIGHTS],
}

impl Taps {
    /// A pass along `step`.
    ///
    /// # Panics
    /// With more than [`MOST_WEIGHTS`].
    #[cfg(not(target_arch = "spirv"))]
    #[must_use]
    pub fn new(step: IVec2, weights: &[f32]) -> Self {
        let mut all = [Vec4::ZERO; MOST_WEIGHTS];
        for (i, weight) in weights.iter().enumerate() {
            all[i].x = *weight;
        }
        Self {
            step,
            count: weights.len() as u32,
            padding: 0,
            weights: all,
        }
    }

    /// Weight `i`.
    #[inline(always)]
    pub(crate) fn weight(&self, i: u32) -> f32 {
        array_element(&self.weights, i).x
    }
}

/// The weighted sum of what `of` takes from the texels around one.
#[inline(always)]
pub(crate) fn filtered<T: Add<Output = T> + AddAssign + Mul<f32, Output = T>>(
    at: UVec2,
    taps: &Taps,
    source: Texture2d<'_>,
    of: impl Fn(Vec4) -> T,
) -> T {
    let size = source.size();
    let at = at.as_ivec2();
    let tap = |offset: IVec2| {
        let p = at + offset;
        of(source.load(UVec2::new(within(p.x, size.x), within(p.y, size.y))))
    };
    let mut sum = tap(IVec2::ZERO) * taps.weight(0);
    let mut offset = taps.step;
    let mut i = 1;
    while i < taps.count {
        sum += (tap(offset) + tap(-offset)) * taps.weight(i);
        offset += taps.step;
        i += 1;
    }
    sum
}

/// One pass of a symmetric separable filter; texels beyond the edge repeat the edge.
#[kernel(
    compute,
    threads(8, 8),
    texture(rgba16unorm, rgba32float),
    forms(fragment),
    inputs = crate::inputs::maps::blurred,
    parity(
        ulp = 0,
        absolute = 1.6e-5,
        exact(rgba32float),
        non_finite,
        why = "sums and products only, then rounding to 1/65535: drivers may round a tie either way, which is one step"
    )
)]
pub fn blur(#[index] at: UVec2, #[uniform] taps: &Taps, #[texture] source: Texture2d<'_>) -> Vec4 {
    filtered(at, taps, source, |texel| texel)
}

/// The same of four channels of 8 bits.
#[kernel(
    compute,
    threads(8, 8),
    texture(rgba8unorm),
    forms(fragment = blur),
    inputs = crate::inputs::maps::blurred,
    parity(
        ulp = 0,
        absolute = 4e-3,
        non_finite,
        why = "sums and products only, then rounding to 1/255: drivers may round a tie either way, which is one step"
    )
)]
pub fn blur_rgba8unorm(
    #[index] at: UVec2,
    #[uniform] taps: &Taps,
    #[texture] source: Texture2d<'_>,
) -> Vec4 {
    filtered(at, taps, source, |texel| texel)
}

/// The same of four 16-bit floats.
#[kernel(
    compute,
    threads(8, 8),
    texture(rgba16float),
    forms(fragment = blur),
    inputs = crate::inputs::maps::blurred_warps,
    parity(
        ulp = 1,
        non_finite,
        why = "sums and products only, then rounding to 16 bits, up or down: one step; absurd numbers overflow"
    )
)]
pub fn blur_rgba16float(
    #[index] at: UVec2,
    #[uniform] taps: &Taps,
    #[texture] source: Texture2d<'_>,
) -> Vec4 {
    filtered(at, taps, source, |texel| texel)
}

/// The same of two channels of 16 bits.
#[kernel(
    compute,
    threads(8, 8),
    texture(rg16unorm),
    forms(fragment = blur),
    inputs = crate::inputs::maps::blurred,
    parity(
        ulp = 0,
        absolute = 1.6e-5,
        non_finite,
        why = "sums and products only, then rounding to 1/65535: drivers may round a tie either way, which is one step"
    )
)]
pub fn blur_rg16unorm(
    #[index] at: UVec2,
    #[uniform] taps: &Taps,
    #[texture] source: Texture2d<'_>,
) -> Vec2 {
    filtered(at, taps, source, |texel| Vec2::new(texel.x, texel.y))
}

/// The same of two 16-bit floats.
#[kernel(
    compute,
    threads(8, 8),
    texture(rg16float),
    forms(fragment = blur),
    inputs = crate::inputs::maps::blurred_warps,
    parity(
        ulp = 1,
        non_finite,
        why = "sums and products only, then rounding to 16 bits, up or down: one step; absurd numbers overflow"
    )
)]
pub fn blur_rg16float(
    #[index] at: UVec2,
    #[uniform] taps: &Taps,
    #[texture] source: Texture2d<'_>,
) -> Vec2 {
    filtered(at, taps, source, |texel| Vec2::new(texel.x, texel.y))
}

/// The same of two 32-bit floats.
#[kernel(
    compute,
    threads(8, 8),
    texture(rg32float),
    forms(fragment = blur),
    inputs = crate::inputs::maps::blurred,
    parity(non_finite, why = "sums of products: those of absurd numbers overflow")
)]
pub fn blur_rg32float(
    #[index] at: UVec2,
    #[uniform] taps: &Taps,
    #[texture] source: Texture2d<'_>,
) -> Vec2 {
    filtered(at, taps, source, |texel| Vec2::new(texel.x, texel.y))
}

/// The same of one 32-bit float.
#[kernel(
    compute,
    threads(8, 8),
    texture(r32float),
    forms(fragment),
    inputs = crate::inputs::maps::blurred_warps,
    parity(non_finite, why = "sums of products: those of absurd numbers overflow")
)]
pub fn blur_r32float(
    #[index] at: UVec2,
    #[uniform] taps: &Taps,
    #[texture] source: Texture2d<'_>,
) -> f32 {
    filtered(at, taps, source, |texel| texel.x)
}
