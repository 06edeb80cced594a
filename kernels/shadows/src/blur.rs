//! The separable filter, run once along rows and once along columns.

use core::ops::{Add, AddAssign, Mul};

use hankel_dsl::glam::{IVec2, UVec2, Vec4};
use hankel_dsl::{Buffer, Element, Texture2d, kernel};

use crate::grid::within;

/// The direction of a filter pass.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Element)]
#[repr(C)]
pub struct Direction {
    /// Step from one tap to the next in texels: (1, 0) or (0, 1).
    #[values(0, 1)]
    pub step: IVec2,
}

/// The weighted sum of what `of` takes from the texels around one.
#[inline(always)]
pub(crate) fn filtered<T: Add<Output = T> + AddAssign + Mul<f32, Output = T>>(
    at: UVec2,
    direction: &Direction,
    weights: Buffer<'_, f32>,
    source: Texture2d<'_>,
    of: impl Fn(Vec4) -> T,
) -> T {
    let size = source.size();
    let at = at.as_ivec2();
    let tap = |offset: IVec2| {
        let p = at + offset;
        of(source.load(UVec2::new(within(p.x, size.x), within(p.y, size.y))))
    };
    let mut sum = tap(IVec2::ZERO) * weights.get(0);
    let mut offset = direction.step;
    let mut i = 1;
    while i < weights.len() {
        sum += (tap(offset) + tap(-offset)) * weights.get(i);
        offset += direction.step;
        i += 1;
    }
    sum
}

/// One pass of a symmetric separable filter; texels beyond the edge repeat the edge. `weights`
/// holds the centre's weight, then those at distance 1, 2, …; the centre plus twice the others
/// should be 1.
#[kernel(
    compute,
    threads(8, 8),
    texture(rgba16unorm, rgba32float),
    inputs = crate::inputs::maps::blurred,
    parity(
        ulp = 0,
        absolute = 1.6e-5,
        exact(rgba32float),
        non_finite,
        why = "sums and products only, then rounding to 1/65535: drivers may round a tie either way, which is one step"
    )
)]
pub fn blur(
    #[index] at: UVec2,
    #[uniform] direction: &Direction,
    #[storage]
    #[length(1..=7)]
    #[range(0.0..=0.15)]
    weights: Buffer<'_, f32>,
    #[texture] source: Texture2d<'_>,
) -> Vec4 {
    filtered(at, direction, weights, source, |texel| texel)
}

/// The same of four channels of 8 bits.
#[kernel(
    compute,
    threads(8, 8),
    texture(rgba8unorm),
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
    #[uniform] direction: &Direction,
    #[storage]
    #[length(1..=7)]
    #[range(0.0..=0.15)]
    weights: Buffer<'_, f32>,
    #[texture] source: Texture2d<'_>,
) -> Vec4 {
    filtered(at, direction, weights, source, |texel| texel)
}

/// The same of four 16-bit floats.
#[kernel(
    compute,
    threads(8, 8),
    texture(rgba16float),
    inputs = crate::inputs::maps::blurred_warps,
    parity(
        ulp = 1,
        non_finite,
        why = "sums and products only, then rounding to 16 bits, up or down: one step; absurd numbers overflow"
    )
)]
pub fn blur_rgba16float(
    #[index] at: UVec2,
    #[uniform] direction: &Direction,
    #[storage]
    #[length(1..=7)]
    #[range(0.0..=0.15)]
    weights: Buffer<'_, f32>,
    #[texture] source: Texture2d<'_>,
) -> Vec4 {
    filtered(at, direction, weights, source, |texel| texel)
}

/// The same of one 32-bit float.
#[kernel(
    compute,
    threads(8, 8),
    texture(r32float),
    inputs = crate::inputs::maps::blurred_warps,
    parity(non_finite, why = "sums of products: those of absurd numbers overflow")
)]
pub fn blur_r32float(
    #[index] at: UVec2,
    #[uniform] direction: &Direction,
    #[storage]
    #[length(1..=7)]
    #[range(0.0..=0.15)]
    weights: Buffer<'_, f32>,
    #[texture] source: Texture2d<'_>,
) -> f32 {
    filtered(at, direction, weights, source, |texel| texel.x)
}
