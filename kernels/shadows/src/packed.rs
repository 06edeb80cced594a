//! Six moment shadow mapping with moments in words of 32 bits, from depths to shading: two words of three
//! channels with 10 bits, 64 bits in all (the lecture), or three words of two channels with 16 bits, 96 in
//! all. No sampler filters integers, so lookup mixes four texels itself; and every device of WebGPU can
//! write them, unlike textures of 16-bit channels.

use hankel_dsl::glam::{IVec2, UVec2, UVec4, Vec2, Vec3, Vec4};
use hankel_dsl::{Real, Texture2d, kernel, to_i32};
use hankel_moments::{
    Moments6, Quantized6, dequantize_symmetric_6, hamburger_6, pack_10, pack_16, unpack_10,
    unpack_16,
};

use crate::blur::Taps;
use crate::grid::within;
use crate::samples::Samples;
use crate::shade::{Light, shade_with};
use crate::six::quantized;

/// The first channels of two words of 10 bits each, and of three of 16 bits.
#[inline(always)]
fn first_10(words: UVec4) -> Vec4 {
    unpack_10(words.x).extend(0.0)
}

/// The others.
#[inline(always)]
fn second_10(words: UVec4) -> Vec4 {
    unpack_10(words.y).extend(0.0)
}

#[inline(always)]
fn first_16(words: UVec4) -> Vec4 {
    let (low, high) = (unpack_16(words.x), unpack_16(words.y));
    Vec4::new(low.x, low.y, high.x, 0.0)
}

#[inline(always)]
fn second_16(words: UVec4) -> Vec4 {
    let (low, high) = (unpack_16(words.y), unpack_16(words.z));
    Vec4::new(low.y, high.x, high.y, 0.0)
}

#[inline(always)]
pub(crate) fn words_10(first: Vec4, second: Vec4) -> UVec2 {
    UVec2::new(pack_10(first.truncate()), pack_10(second.truncate()))
}

#[inline(always)]
pub(crate) fn words_16(first: Vec4, second: Vec4) -> (u32, u32, u32) {
    (
        pack_16(Vec2::new(first.x, first.y)),
        pack_16(Vec2::new(first.z, second.x)),
        pack_16(Vec2::new(second.y, second.z)),
    )
}

/// Means of a texel's six moments in words of three channels with 10 bits.
#[inline(always)]
fn mean_10(depth: impl Samples, at: UVec2, samples: u32) -> UVec2 {
    let texels = quantized(depth, at, samples);
    words_10(texels.first, texels.second)
}

/// The same in words of two channels with 16 bits.
#[inline(always)]
fn mean_16(depth: impl Samples, at: UVec2, samples: u32) -> (u32, u32, u32) {
    let texels = quantized(depth, at, samples);
    words_16(texels.first, texels.second)
}

of_samples! {
    /// Means of a texel's six moments, depths moved to [-1, 1], in the optimised basis: two words of three
    /// channels with 10 bits.
    #[kernel(
        compute,
        threads(8, 8),
        texture(rg32uint),
        forms(fragment),
        pinned,
        inputs = crate::inputs::maps::depths
    )]
    resolve_packed_10,
    resolve_single_packed_10,
    (#[index] at: UVec2,) -> UVec2,
    |depth; samples| { mean_10(depth, at, samples) }
}

of_samples! {
    /// Means of a texel's six moments, depths moved to [-1, 1], in the optimised basis: three words of two
    /// channels with 16 bits.
    #[kernel(
        compute,
        threads(8, 8),
        outputs(r32uint, r32uint, r32uint),
        forms(fragment),
        pinned,
        inputs = crate::inputs::maps::depths
    )]
    resolve_packed_16,
    resolve_single_packed_16,
    (#[index] at: UVec2,) -> (u32, u32, u32),
    |depth; samples| { mean_16(depth, at, samples) }
}

/// One pass of a symmetric separable filter over two words of three channels with 10 bits: see
/// [`crate::blur::blur`].
#[kernel(
    compute,
    threads(8, 8),
    texture(rg32uint),
    forms(fragment),
    pinned,
    inputs = crate::inputs::maps::blurred_10
)]
pub fn blur_packed_10(
    #[index] at: UVec2,
    #[uniform] taps: &Taps,
    #[texture] map: Texture2d<'_, u32>,
) -> UVec2 {
    let size = map.size();
    let tap = |offset: IVec2| map.load(texel(at, offset, size));
    let weight = taps.weight(0);
    let centre = tap(IVec2::ZERO);
    let mut first = first_10(centre) * weight;
    let mut second = second_10(centre) * weight;
    let mut offset = taps.step;
    let mut i = 1;
    while i < taps.count {
        let (before, after, weight) = (tap(-offset), tap(offset), taps.weight(i));
        first += (first_10(after) + first_10(before)) * weight;
        second += (second_10(after) + second_10(before)) * weight;
        offset += taps.step;
        i += 1;
    }
    words_10(first, second)
}

/// One pass of a symmetric separable filter over three words of two channels with 16 bits: see
/// [`crate::blur::blur`].
#[kernel(
    compute,
    threads(8, 8),
    outputs(r32uint, r32uint, r32uint),
    forms(fragment),
    pinned,
    inputs = crate::inputs::maps::blurred_16
)]
pub fn blur_packed_16(
    #[index] at: UVec2,
    #[uniform] taps: &Taps,
    #[texture] low: Texture2d<'_, u32>,
    #[texture] middle: Texture2d<'_, u32>,
    #[texture] high: Texture2d<'_, u32>,
) -> (u32, u32, u32) {
    let size = low.size();
    let tap = |offset: IVec2| {
        let at = texel(at, offset, size);
        UVec4::new(low.load(at).x, middle.load(at).x, high.load(at).x, 0)
    };
    let weight = taps.weight(0);
    let centre = tap(IVec2::ZERO);
    let mut first = first_16(centre) * weight;
    let mut second = second_16(centre) * weight;
    let mut offset = taps.step;
    let mut i = 1;
    while i < taps.count {
        let (before, after, weight) = (tap(-offset), tap(offset), taps.weight(i));
        first += (first_16(after) + first_16(before)) * weight;
        second += (second_16(after) + second_16(before)) * weight;
        offset += taps.step;
        i += 1;
    }
    words_16(first, second)
}

/// The texel at `at + offset`; beyond the edge the nearest one.
#[inline(always)]
fn texel(at: UVec2, offset: IVec2, size: UVec2) -> UVec2 {
    let at = at.as_ivec2() + offset;
    UVec2::new(within(at.x, size.x), within(at.y, size.y))
}

/// Shading with Hamburger six moment shadow mapping, from two words of three channels with 10 bits.
/// `target` is the moment vector that the bias mixes in; the light's own is for four.
#[kernel(
    fragment,
    inputs = crate::inputs::maps::shaded_10,
    parity(
        ulp = 0,
        absolute = 2e-4,
        why = "the depth in the light's view is rounded, by up to 3e-7, and a place in a map of 61 texels by 4e-6 texels, which moves moments between a near and a far texel by as much; with the least bias, 6e-4, the bound's steepest slope in depth is 0.65 over a deviation of 1.8e-2; the most that was measured is 1.02e-4"
    )
)]
pub fn shade_packed_10(
    #[varying] world: Vec3,
    #[varying]
    #[unit_vector]
    normal: Vec3,
    #[varying]
    #[range(0.0..=1.0)]
    colour: Vec3,
    #[uniform] light: &Light,
    #[uniform] target: &Moments6<f32>,
    #[texture] map: Texture2d<'_, u32>,
) -> Vec4 {
    shade_with(light, world, normal, colour, |uv, z| {
        let square = Square::around(uv, map.size());
        let tap = |dx, dy| map.load(square.texel(dx, dy));
        let (a, b, c, d) = (tap(0, 0), tap(1, 0), tap(0, 1), tap(1, 1));
        let first = square.mixed(first_10(a), first_10(b), first_10(c), first_10(d));
        let second = square.mixed(second_10(a), second_10(b), second_10(c), second_10(d));
        shadow(light, target, first, second, z)
    })
}

/// Shading with Hamburger six moment shadow mapping, from three words of two channels with 16 bits.
/// `target` is the moment vector that the bias mixes in; the light's own is for four.
#[kernel(
    fragment,
    inputs = crate::inputs::maps::shaded_16,
    parity(
        ulp = 0,
        absolute = 2e-4,
        why = "the depth in the light's view is rounded, by up to 3e-7, and a place in a map of 61 texels by 4e-6 texels, which moves moments between a near and a far texel by as much; with the least bias, 6e-4, the bound's steepest slope in depth is 0.65 over a deviation of 1.8e-2; the most that was measured is 1.02e-4"
    )
)]
pub fn shade_packed_16(
    #[varying] world: Vec3,
    #[varying]
    #[unit_vector]
    normal: Vec3,
    #[varying]
    #[range(0.0..=1.0)]
    colour: Vec3,
    #[uniform] light: &Light,
    #[uniform] target: &Moments6<f32>,
    #[texture] low: Texture2d<'_, u32>,
    #[texture] middle: Texture2d<'_, u32>,
    #[texture] high: Texture2d<'_, u32>,
) -> Vec4 {
    shade_with(light, world, normal, colour, |uv, z| {
        let square = Square::around(uv, low.size());
        let tap = |dx, dy| {
            let at = square.texel(dx, dy);
            UVec4::new(low.load(at).x, middle.load(at).x, high.load(at).x, 0)
        };
        let (a, b, c, d) = (tap(0, 0), tap(1, 0), tap(0, 1), tap(1, 1));
        let first = square.mixed(first_16(a), first_16(b), first_16(c), first_16(d));
        let second = square.mixed(second_16(a), second_16(b), second_16(c), second_16(d));
        shadow(light, target, first, second, z)
    })
}

/// The four texels around a place of a map, and how bilinear lookup weighs them.
#[derive(Clone, Copy)]
struct Square {
    left: i32,
    top: i32,
    right_share: f32,
    low_share: f32,
    size: UVec2,
}

impl Square {
    /// Around coordinates from 0 to 1 within the map; beyond the edge as at it.
    #[inline(always)]
    fn around(uv: Vec2, size: UVec2) -> Self {
        // In texels from the first one's centre.
        let place = |t: f32, size: u32| Real::clamp(t * size as f32 - 0.5, 0.0, (size - 1) as f32);
        let (x, y) = (place(uv.x, size.x), place(uv.y, size.y));
        // Not negative, so that cutting the fraction off is rounding down.
        let (left, top) = (to_i32(x), to_i32(y));
        Self {
            left,
            top,
            right_share: x - left as f32,
            low_share: y - top as f32,
            size,
        }
    }

    /// The first texel, or the one after it along x or y.
    #[inline(always)]
    fn texel(self, dx: i32, dy: i32) -> UVec2 {
        UVec2::new(
            within(self.left + dx, self.size.x),
            within(self.top + dy, self.size.y),
        )
    }

    /// Values at (0, 0), (1, 0), (0, 1), (1, 1), mixed.
    #[inline(always)]
    fn mixed(self, a: Vec4, b: Vec4, c: Vec4, d: Vec4) -> Vec4 {
        let mix = |near: Vec4, far: Vec4, share: f32| near * (1.0 - share) + far * share;
        let upper = mix(a, b, self.right_share);
        mix(upper, mix(c, d, self.right_share), self.low_share)
    }
}

/// The least shadow that quantised moments allow for a receiver's depth from 0 to 1.
#[inline(always)]
fn shadow(light: &Light, target: &Moments6<f32>, first: Vec4, second: Vec4, z: f32) -> f32 {
    let m = dequantize_symmetric_6(Quantized6 {
        r0: first.x,
        g0: first.y,
        b0: first.z,
        r1: second.x,
        g1: second.y,
        b1: second.z,
    });
    hamburger_6(m.lerp(*target, light.moment_bias), 2.0 * z - 1.0).lower
}
