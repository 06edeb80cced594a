//! Parameters that are called as a variable of generated code could be, or as a word of a target's language.

use hankel_dsl::glam::{UVec2, Vec4};
use hankel_dsl::{Buffer, Real, kernel, lit};

use super::{Affine, Pair};

/// A map over lanes.
#[kernel(
    compute,
    threads(64),
    precision(f32, f64),
    parity(non_finite, why = "sums and products of absurd numbers overflow")
)]
pub fn called_map<R: Real>(
    #[uniform] out: &Affine<R>,
    #[uniform] uniforms: &Affine<R>,
    #[element] i: Pair<R>,
    #[element] start: Pair<R>,
    #[constant(id = 0, default = 1)]
    #[values(0, 1)]
    value: u32,
) -> Pair<R> {
    let moved = i.x * out.scale + uniforms.offset;
    if value == 1 {
        Pair {
            x: moved,
            w: start.w.min(lit!(0.5)),
        }
    } else {
        Pair {
            x: start.x,
            w: moved.max(lit!(0.5)),
        }
    }
}

/// Texels.
#[kernel(compute, threads(8, 8), texture(rgba32float))]
pub fn called_texel(
    #[index] at: UVec2,
    #[uniform] size: &UVec2,
    #[storage] count: Buffer<'_, u32>,
) -> Vec4 {
    let i = (at.x ^ size.y) % count.len();
    Vec4::new(
        (size.x & 0xff) as f32,
        (count.get(i) & 0xff) as f32,
        at.y as f32,
        1.0,
    )
}
