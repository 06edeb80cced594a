//! Texel formats on the host: how a texel's bytes become numbers and back, the same way a GPU does
//! it (Vulkan specification, "Fixed-Point Data Conversions" and "16-Bit Floating-Point Numbers").

use glam::{UVec4, Vec4};

use super::describe::{Channels, TexelFormat};

/// Every format, in the order of their numbers.
pub const FORMATS: [TexelFormat; 15] = [
    TexelFormat::R32Float,
    TexelFormat::Rgba32Float,
    TexelFormat::Rgba16Float,
    TexelFormat::Rgba16Unorm,
    TexelFormat::Rgba8Unorm,
    TexelFormat::R32Uint,
    TexelFormat::Rgba32Uint,
    TexelFormat::R32Sint,
    TexelFormat::Rgba32Sint,
    TexelFormat::Rg32Uint,
    TexelFormat::Rg32Sint,
    TexelFormat::Rgba16Uint,
    TexelFormat::Rgba16Sint,
    TexelFormat::Rgba8Uint,
    TexelFormat::Rgba8Sint,
];

impl TexelFormat {
    /// Bytes of one texel.
    #[must_use]
    pub const fn bytes(self) -> usize {
        self.channels() * self.channel_bytes()
    }

    /// Channels of one texel.
    #[must_use]
    pub const fn channels(self) -> usize {
        match self {
            Self::R32Float | Self::R32Uint | Self::R32Sint => 1,
            Self::Rg32Uint | Self::Rg32Sint => 2,
            _ => 4,
        }
    }

    /// Bytes of one channel.
    #[must_use]
    pub const fn channel_bytes(self) -> usize {
        match self {
            Self::Rgba8Unorm | Self::Rgba8Uint | Self::Rgba8Sint => 1,
            Self::Rgba16Float | Self::Rgba16Unorm | Self::Rgba16Uint | Self::Rgba16Sint => 2,
            _ => 4,
        }
    }

    /// What the channels are in a shader.
    #[must_use]
    pub const fn numbers(self) -> Channels {
        match self {
            Self::R32Uint
            | Self::Rg32Uint
            | Self::Rgba32Uint
            | Self::Rgba16Uint
            | Self::Rgba8Uint => Channels::Uint,
            Self::R32Sint
            | Self::Rg32Sint
            | Self::Rgba32Sint
            | Self::Rgba16Sint
            | Self::Rgba8Sint => Channels::Sint,
            _ => Channels::Float,
        }
    }

    /// Whether the channels are integers.
    #[must_use]
    pub const fn is_integer(self) -> bool {
        !matches!(self.numbers(), Channels::Float)
    }

    /// The name in lower case, as in WebGPU: `rgba16unorm`.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::R32Float => "r32float",
            Self::Rgba32Float => "rgba32float",
            Self::Rgba16Float => "rgba16float",
            Self::Rgba16Unorm => "rgba16unorm",
            Self::Rgba8Unorm => "rgba8unorm",
            Self::R32Uint => "r32uint",
            Self::Rgba32Uint => "rgba32uint",
            Self::R32Sint => "r32sint",
            Self::Rgba32Sint => "rgba32sint",
            Self::Rg32Uint => "rg32uint",
            Self::Rg32Sint => "rg32sint",
            Self::Rgba16Uint => "rgba16uint",
            Self::Rgba16Sint => "rgba16sint",
            Self::Rgba8Uint => "rgba8uint",
            Self::Rgba8Sint => "rgba8sint",
        }
    }

    /// Reads one texel of a float format; channels that the format lacks are 0, alpha 1.
    /// `bytes` has at least [`Self::bytes`] bytes. Integer formats read as their values.
    #[inline]
    #[must_use]
    pub fn load(self, bytes: &[u8]) -> Vec4 {
        let f32_at = |i: usize| f32::from_le_bytes(take(bytes, i));
        let u16_at = |i: usize| u16::from_le_bytes(take(bytes, i));
        match self {
            Self::R32Float => Vec4::new(f32_at(0), 0.0, 0.0, 1.0),
            Self::Rgba32Float => Vec4::new(f32_at(0), f32_at(1), f32_at(2), f32_at(3)),
            Self::Rgba16Float => {
                let h = |i| half::f16::from_bits(u16_at(i)).to_f32();
                Vec4::new(h(0), h(1), h(2), h(3))
            }
            Self::Rgba16Unorm => {
                let n = |i| f32::from(u16_at(i)) / 65535.0;
                Vec4::new(n(0), n(1), n(2), n(3))
            }
            Self::Rgba8Unorm => {
                let n = |i: usize| f32::from(bytes[i]) / 255.0;
                Vec4::new(n(0), n(1), n(2), n(3))
            }
            _ => match self.numbers() {
                Channels::Sint => self.load_integer(bytes).as_ivec4().as_vec4(),
                _ => self.load_integer(bytes).as_vec4(),
            },
        }
    }

    /// Reads one texel of an integer format; channels that the format lacks are 0, alpha 1. Signed
    /// numbers come as their bits.
    #[inline]
    #[must_use]
    pub fn load_integer(self, bytes: &[u8]) -> UVec4 {
        let channel = |i: usize| match self {
            _ if i >= self.channels() => u32::from(i == 3),
            Self::Rgba16Uint => u16::from_le_bytes(take(bytes, i)).into(),
            Self::Rgba16Sint => i32::from(i16::from_le_bytes(take(bytes, i))) as u32,
            Self::Rgba8Uint => bytes[i].into(),
            Self::Rgba8Sint => i32::from(bytes[i] as i8) as u32,
            _ => u32::from_le_bytes(take(bytes, i)),
        };
        if self.is_integer() {
            UVec4::new(channel(0), channel(1), channel(2), channel(3))
        } else {
            self.load(bytes).as_uvec4()
        }
    }

    /// Writes one texel of a float format. A normalised format clamps to its range and rounds to
    /// the nearest step; NaN becomes 0.
    #[inline]
    pub fn store(self, bytes: &mut [u8], v: Vec4) {
        let all = v.to_array();
        match self {
            Self::R32Float => bytes[..4].copy_from_slice(&all[0].to_le_bytes()),
            Self::Rgba32Float => {
                for (b, x) in bytes.chunks_exact_mut(4).zip(all) {
                    b.copy_from_slice(&x.to_le_bytes());
                }
            }
            Self::Rgba16Float => {
                for (b, x) in bytes.chunks_exact_mut(2).zip(all) {
                    b.copy_from_slice(&half::f16::from_f32(x).to_bits().to_le_bytes());
                }
            }
            Self::Rgba16Unorm => {
                for (b, x) in bytes.chunks_exact_mut(2).zip(all) {
                    // `as` saturates and takes NaN to 0.
                    let n = (x.clamp(0.0, 1.0) * 65535.0).round_ties_even() as u16;
                    b.copy_from_slice(&n.to_le_bytes());
                }
            }
            Self::Rgba8Unorm => {
                for (b, x) in bytes.iter_mut().zip(all) {
                    *b = (x.clamp(0.0, 1.0) * 255.0).round_ties_even() as u8;
                }
            }
            _ => match self.numbers() {
                Channels::Sint => self.store_integer(bytes, v.as_ivec4().as_uvec4()),
                _ => self.store_integer(bytes, v.as_uvec4()),
            },
        }
    }

    /// Whether an integer format can hold the numbers, of which signed ones are given as their bits.
    /// Vulkan leaves what it cannot hold undefined ("Texel Output Format Conversion"), and WGSL
    /// clamps it.
    #[inline]
    #[must_use]
    pub fn holds(self, v: UVec4) -> bool {
        let bits = 8 * self.channel_bytes() as u32;
        let fits = |x: u32| match self.numbers() {
            Channels::Float => true,
            Channels::Uint => bits == 32 || x >> bits == 0,
            Channels::Sint => {
                bits == 32 || (-(1 << (bits - 1))..1 << (bits - 1)).contains(&(x as i32))
            }
        };
        v.to_array()[..self.channels()].iter().all(|x| fits(*x))
    }

    /// Writes one texel of an integer format, which must [hold](Self::holds) it; otherwise the lower
    /// bits are kept. Signed numbers are given as their bits.
    #[inline]
    pub fn store_integer(self, bytes: &mut [u8], v: UVec4) {
        if self.is_integer() {
            let size = self.channel_bytes();
            let channels = v.to_array();
            for (b, x) in bytes
                .chunks_exact_mut(size)
                .zip(&channels[..self.channels()])
            {
                b.copy_from_slice(&x.to_le_bytes()[..size]);
            }
        } else {
            self.store(bytes, v.as_vec4());
        }
    }
}

/// The `i`-th group of `N` bytes.
#[inline(always)]
fn take<const N: usize>(bytes: &[u8], i: usize) -> [u8; N] {
    let mut out = [0; N];
    out.copy_from_slice(&bytes[i * N..(i + 1) * N]);
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::IVec4;

    #[test]
    fn every_step_of_a_normalised_format_survives_a_round_trip() {
        let mut b = [0u8; 8];
        for n in 0..=u16::MAX {
            let v = Vec4::splat(f32::from(n) / 65535.0);
            TexelFormat::Rgba16Unorm.store(&mut b, v);
            assert_eq!(TexelFormat::Rgba16Unorm.load(&b), v);
        }
        for n in 0..=u8::MAX {
            let v = Vec4::splat(f32::from(n) / 255.0);
            TexelFormat::Rgba8Unorm.store(&mut b, v);
            assert_eq!(TexelFormat::Rgba8Unorm.load(&b), v);
        }
    }

    #[test]
    fn what_a_format_cannot_hold_is_clamped() {
        let mut b = [0u8; 8];
        TexelFormat::Rgba16Unorm.store(&mut b, Vec4::new(-1.0, 2.0, f32::NAN, f32::INFINITY));
        assert_eq!(
            TexelFormat::Rgba16Unorm.load(&b),
            Vec4::new(0.0, 1.0, 0.0, 1.0)
        );
    }

    #[test]
    fn integers_survive_a_round_trip_and_what_does_not_fit_is_known() {
        for format in FORMATS.into_iter().filter(|f| f.is_integer()) {
            let bits = 8 * format.channel_bytes() as u32;
            let signed = format.numbers() == Channels::Sint;
            let (least, most) = if signed {
                (-1_i64 << (bits - 1), (1_i64 << (bits - 1)) - 1)
            } else {
                (0, (1_i64 << bits) - 1)
            };
            let mut b = [0u8; 16];
            let v = IVec4::new(most as i32, least as i32, 1, 7).as_uvec4();
            assert!(format.holds(v), "{format:?}");
            format.store_integer(&mut b, v);
            let read = format.load_integer(&b);
            let there = format.channels();
            assert_eq!(
                read.to_array()[..there],
                v.to_array()[..there],
                "{format:?}"
            );
            let absent = [0, 0, 0, 1];
            assert_eq!(read.to_array()[there..], absent[there..], "{format:?}");
            if bits < 32 {
                assert!(!format.holds(UVec4::splat((most + 1) as u32)), "{format:?}");
                assert!(
                    !format.holds(UVec4::splat((least - 1) as u32)),
                    "{format:?}"
                );
            }
        }
    }

    #[test]
    fn numbers_and_formats_agree() {
        for (i, f) in FORMATS.into_iter().enumerate() {
            assert_eq!(f as usize, i);
            assert_eq!(serde_json::to_value(f).unwrap(), f.name());
        }
    }
}
