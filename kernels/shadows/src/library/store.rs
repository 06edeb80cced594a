//! What a map stores: moments of a depth, the optimised bases, packing, fixed point.

use hankel_dsl::glam::{UVec4, Vec3, Vec4};
use hankel_dsl::{function, to_i32};
use hankel_moments::{
    Fixed4, FixedPoint, Moments4, Moments6, Quantized4, Quantized6, Rectangle4,
    TrigonometricMoments, dequantize_symmetric_6, from_unorm, quantize_symmetric_6, to_unorm,
};

use super::bounds::{four, six};

#[inline(always)]
fn moments(m: Moments4<f32>) -> Vec4 {
    Vec4::new(m.b1, m.b2, m.b3, m.b4)
}

#[inline(always)]
pub(crate) fn channels(q: Quantized4<f32>) -> Vec4 {
    Vec4::new(q.r, q.g, q.b, q.a)
}

#[inline(always)]
fn quantized(channels: Vec4) -> Quantized4<f32> {
    Quantized4 {
        r: channels.x,
        g: channels.y,
        b: channels.z,
        a: channels.w,
    }
}

/// A depth in [0, 1] as one in [-1, 1].
#[function]
pub fn symmetric_depth(depth: f32) -> f32 {
    2.0 * depth - 1.0
}

/// The first four power moments of one depth. The moments of a filter region are the mean of those of
/// its depths.
#[function]
pub fn moments_of_depth(depth: f32) -> Vec4 {
    moments(Moments4::of_depth(depth))
}

/// The first two trigonometric moments of one depth in [0, 1]: the cosine and the sine of 2 pi z (x, y)
/// and of 4 pi z (z, w).
#[function]
pub fn trigonometric_moments_of_depth(depth: f32) -> Vec4 {
    let m = TrigonometricMoments::of_depth(depth);
    Vec4::new(m.c1, m.s1, m.c2, m.s2)
}

/// Moments of depths in [0, 1] to the basis optimised for 4 x 16 bits: channels in [0, 1] (\[MSM\],
/// Listing 1). In floats it magnifies rounding to a step of 16 bits; that for [-1, 1] does not.
#[function]
pub fn quantize_unit_four(moments: Vec4) -> Vec4 {
    channels(hankel_moments::quantize_unit_4(four(moments)))
}

/// The basis optimised for 4 x 16 bits to moments of depths in [0, 1] (\[MSM\], Listing 2).
#[function]
pub fn dequantize_unit_four(channels: Vec4) -> Vec4 {
    moments(hankel_moments::dequantize_unit_4(quantized(channels)))
}

/// Moments of depths in [-1, 1] to the basis optimised for 4 x 16 bits: channels in [0, 1].
#[function]
pub fn quantize_symmetric_four(moments: Vec4) -> Vec4 {
    channels(hankel_moments::quantize_symmetric_4(four(moments)))
}

/// The basis optimised for 4 x 16 bits to moments of depths in [-1, 1].
#[function]
pub fn dequantize_symmetric_four(channels: Vec4) -> Vec4 {
    moments(hankel_moments::dequantize_symmetric_4(quantized(channels)))
}

/// Moments of depths in [-1, 1] to those of the same depths moved to [0, 1].
#[function]
pub fn symmetric_to_unit(moments: Vec4) -> Vec4 {
    self::moments(four(moments).symmetric_to_unit())
}

/// Six moments of depths in [-1, 1] to the basis optimised for 2 x 3 channels of 10 bits: the first
/// texel's channels, in [0, 1]. `low` holds moments 1 to 3, `high` moments 4 to 6.
#[function]
pub fn quantize_symmetric_six_first(low: Vec3, high: Vec3) -> Vec3 {
    let q = quantize_symmetric_6(six(low, high));
    Vec3::new(q.r0, q.g0, q.b0)
}

/// Six moments of depths in [-1, 1] to the basis optimised for 2 x 3 channels of 10 bits: the second
/// texel's channels, in [0, 1]. `low` holds moments 1 to 3, `high` moments 4 to 6.
#[function]
pub fn quantize_symmetric_six_second(low: Vec3, high: Vec3) -> Vec3 {
    let q = quantize_symmetric_6(six(low, high));
    Vec3::new(q.r1, q.g1, q.b1)
}

#[inline(always)]
fn dequantized(first: Vec3, second: Vec3) -> Moments6<f32> {
    dequantize_symmetric_6(Quantized6 {
        r0: first.x,
        g0: first.y,
        b0: first.z,
        r1: second.x,
        g1: second.y,
        b1: second.z,
    })
}

/// The basis optimised for 2 x 3 channels of 10 bits to moments 1 to 3 of depths in [-1, 1], from both
/// texels' channels.
#[function]
pub fn dequantize_symmetric_six_low(first: Vec3, second: Vec3) -> Vec3 {
    let m = dequantized(first, second);
    Vec3::new(m.b1, m.b2, m.b3)
}

/// The basis optimised for 2 x 3 channels of 10 bits to moments 4 to 6 of depths in [-1, 1], from both
/// texels' channels.
#[function]
pub fn dequantize_symmetric_six_high(first: Vec3, second: Vec3) -> Vec3 {
    let m = dequantized(first, second);
    Vec3::new(m.b4, m.b5, m.b6)
}

/// Three channels in [0, 1] in a word of R10G10B10A2, red lowest; each is rounded to the nearest of
/// 1023 steps. The two bits of alpha are 0.
#[function]
pub fn pack_ten_bits(channels: Vec3) -> u32 {
    let bits = |x: f32| to_i32(to_unorm::<f32, 10>(x)) as u32;
    bits(channels.x) | (bits(channels.y) << 10) | (bits(channels.z) << 20)
}

/// The three channels, in [0, 1], of a word of R10G10B10A2.
#[function]
pub fn unpack_ten_bits(word: u32) -> Vec3 {
    let channel = |word: u32| from_unorm::<f32, 10>((word & 0x3ff) as f32);
    Vec3::new(channel(word), channel(word >> 10), channel(word >> 20))
}

/// Four channels in [0, 1] as integers of a summed-area table, in which `one` stands for 1: at most
/// 2^32 - 1 over the texels of the largest kernel, and at most 2^24.
#[function]
pub fn to_fixed_four(channels: Vec4, one: u32) -> UVec4 {
    let fixed = Fixed4::of(quantized(channels), FixedPoint { one });
    UVec4::new(fixed.r, fixed.g, fixed.b, fixed.a)
}

#[inline(always)]
pub(super) fn fixed(entry: UVec4) -> Fixed4 {
    Fixed4 {
        r: entry.x,
        g: entry.y,
        b: entry.z,
        a: entry.w,
    }
}

/// The sum over a rectangle of a summed-area table, modulo 2^32, from the entries left of and above its
/// first texel (`before_both`), above its last column (`before_row`), left of its last row
/// (`before_column`) and at its last texel; an entry beyond the table's edge is 0.
#[function]
pub fn rectangle_of_fixed_four(
    before_both: UVec4,
    before_row: UVec4,
    before_column: UVec4,
    last: UVec4,
) -> UVec4 {
    let rectangle = Rectangle4 {
        before_both: fixed(before_both),
        before_row: fixed(before_row),
        before_column: fixed(before_column),
        last: fixed(last),
        texels: 1,
    };
    let sum = rectangle.sum();
    UVec4::new(sum.r, sum.g, sum.b, sum.a)
}

/// The mean, in [0, 1], of the channels of `texels` texels whose integers add up to `sum`; `one` stands
/// for 1.
#[function]
pub fn mean_of_fixed_four(sum: UVec4, one: u32, texels: u32) -> Vec4 {
    let point = FixedPoint { one };
    Vec4::new(
        point.mean(sum.x, texels),
        point.mean(sum.y, texels),
        point.mean(sum.z, texels),
        point.mean(sum.w, texels),
    )
}
