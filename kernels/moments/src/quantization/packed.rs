//! Six moments in 64 or 96 bits.

use hankel_dsl::glam::{Vec2, Vec3};
use hankel_dsl::{Element, to_i32};

use super::six::Quantized6;
use super::unorm::{from_unorm, to_unorm};

/// Six moments in two texels of R10G10B10A2 (the lecture): each word holds three channels of 10
/// bits, red lowest, as `rgb10a2unorm` in WebGPU, `A2B10G10R10_UNORM_PACK32` in Vulkan and
/// `R10G10B10A2_UNORM` in DXGI. The two bits of alpha are 0 and ignored.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Element)]
#[repr(C)]
pub struct Packed6 {
    /// The channels r0, g0, b0.
    pub first: u32,
    /// The channels r1, g1, b1.
    pub second: u32,
}

impl Packed6 {
    /// Each channel of `q` rounded to 10 bits, see [`to_unorm`].
    #[inline(always)]
    #[must_use]
    pub fn pack(q: Quantized6<f32>) -> Self {
        Self {
            first: word(q.r0, q.g0, q.b0),
            second: word(q.r1, q.g1, q.b1),
        }
    }

    /// The channels, in [0, 1].
    #[inline(always)]
    #[must_use]
    pub fn unpack(self) -> Quantized6<f32> {
        Quantized6 {
            r0: channel(self.first),
            g0: channel(self.first >> 10),
            b0: channel(self.first >> 20),
            r1: channel(self.second),
            g1: channel(self.second >> 10),
            b1: channel(self.second >> 20),
        }
    }
}

#[inline(always)]
fn word(r: f32, g: f32, b: f32) -> u32 {
    let bits = |x: f32| to_i32(to_unorm::<f32, 10>(x)) as u32;
    bits(r) | bits(g) << 10 | bits(b) << 20
}

#[inline(always)]
fn channel(word: u32) -> f32 {
    from_unorm::<f32, 10>((word & 0x3ff) as f32)
}

/// Three channels in a word, 10 bits each, the first one lowest, as [`Packed6`] has them; each rounded as
/// [`to_unorm`] has it.
#[inline(always)]
#[must_use]
pub fn pack_10(channels: Vec3) -> u32 {
    word(channels.x, channels.y, channels.z)
}

/// The channels of [`pack_10`], in [0, 1].
#[inline(always)]
#[must_use]
pub fn unpack_10(word: u32) -> Vec3 {
    Vec3::new(channel(word), channel(word >> 10), channel(word >> 20))
}

/// Two channels in a word, 16 bits each, the first one lowest, as `rg16unorm` in WebGPU has them; each
/// rounded as [`to_unorm`] has it. Six moments take three such words.
#[inline(always)]
#[must_use]
pub fn pack_16(channels: Vec2) -> u32 {
    let bits = |x: f32| to_i32(to_unorm::<f32, 16>(x)) as u32;
    bits(channels.x) | bits(channels.y) << 16
}

/// The channels of [`pack_16`], in [0, 1].
#[inline(always)]
#[must_use]
pub fn unpack_16(word: u32) -> Vec2 {
    let channel = |bits: u32| from_unorm::<f32, 16>(bits as f32);
    Vec2::new(channel(word & 0xffff), channel(word >> 16))
}
