//! The separable filter, run once along rows and once along columns.

use hankel_dsl::glam::{IVec2, UVec2, Vec4};
use hankel_dsl::{Buffer, Element, Texture2d, kernel};

/// The direction of a filter pass.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Element)]
#[repr(C)]
pub struct Direction {
    /// Step from one tap to the next in texels: (1, 0) or (0, 1).
    pub step: IVec2,
}

/// One pass of a symmetric separable filter; texels beyond the edge repeat the edge. `weights`
/// holds the centre's weight, then those at distance 1, 2, …; the centre plus twice the others
/// should be 1.
#[kernel(
    compute,
    threads(8, 8),
    texture(rgba16unorm, rgba32float),
    parity(
        ulp = 0,
        absolute = 1.6e-5,
        why = "sums and products only; a 16-bit target then rounds to 1/65535, where drivers may round a tie either way, which is one step"
    )
)]
pub fn blur(
    #[index] at: UVec2,
    #[uniform] direction: &Direction,
    #[storage] weights: Buffer<'_, f32>,
    #[texture] source: Texture2d<'_>,
) -> Vec4 {
    let last = source.size().as_ivec2() - IVec2::ONE;
    let at = at.as_ivec2();
    let tap = |offset: IVec2| {
        let p = at + offset;
        source.load(UVec2::new(within(p.x, last.x), within(p.y, last.y)))
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

/// `i` moved to the nearest of 0 to `last`.
#[inline(always)]
fn within(i: i32, last: i32) -> u32 {
    let i = if i < 0 { 0 } else { i };
    (if i > last { last } else { i }) as u32
}
