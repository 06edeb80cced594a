//! Texel formats on the host: how a texel's bytes become numbers and back, the same way a GPU does
//! it (Vulkan specification, "Fixed-Point Data Conversions" and "16-Bit Floating-Point Numbers").

use glam::{UVec4, Vec4};

use super::channel::{self, Stored, Texels};
use super::describe::{Channels, TexelFormat};

/// A texel; channels that the format lacks are 0, alpha 1.
#[inline(always)]
fn all<T>(channels: usize, zero: T, one: T, channel: impl Fn(usize) -> T) -> [T; 4]
where
    T: Copy,
{
    let absent = [zero, zero, zero, one];
    std::array::from_fn(|i| if i < channels { channel(i) } else { absent[i] })
}

macro_rules! formats {
    ($($(#[doc = $doc:literal])* $name:ident $word:literal $spirv:ident $value:ident $channels:literal $channel:ident;)*) => {
        /// Every format, in the order of their numbers.
        pub const FORMATS: [TexelFormat; [$($word),*].len()] = [$(TexelFormat::$name),*];

        impl TexelFormat {
            /// Channels of one texel.
            #[must_use]
            pub const fn channels(self) -> usize {
                match self {
                    $(Self::$name => $channels,)*
                }
            }

            /// Bytes of one channel; of channels that share a word, of all of them.
            #[must_use]
            pub const fn channel_bytes(self) -> usize {
                match self {
                    $(Self::$name => <channel::$channel as Texels>::BYTES,)*
                }
            }

            /// Bits of each channel.
            #[must_use]
            pub const fn channel_bits(self) -> [u32; 4] {
                match self {
                    $(Self::$name => <channel::$channel as Texels>::BITS,)*
                }
            }

            /// How a channel is stored.
            #[must_use]
            pub const fn stored(self) -> channel::Stored {
                match self {
                    $(Self::$name => <channel::$channel as Texels>::STORED,)*
                }
            }

            /// What the channels are in a shader.
            #[must_use]
            pub const fn numbers(self) -> Channels {
                match self {
                    $(Self::$name => <channel::$channel as Texels>::NUMBERS,)*
                }
            }

            /// The name in lower case, as in WebGPU: `rgba16unorm`.
            #[must_use]
            pub const fn name(self) -> &'static str {
                match self {
                    $(Self::$name => $word,)*
                }
            }

            /// Reads one texel of a float format; channels that the format lacks are 0, alpha 1.
            /// `bytes` has at least [`Self::bytes`] bytes. Integer formats read as their values.
            #[inline]
            #[must_use]
            pub fn load(self, bytes: &[u8]) -> Vec4 {
                match self {
                    $(Self::$name => Vec4::from_array(all($channels, 0.0, 1.0, |i| {
                        <channel::$channel as Texels>::load(bytes, i)
                    })),)*
                }
            }

            /// Reads one texel of an integer format; channels that the format lacks are 0, alpha 1. Signed
            /// numbers come as their bits.
            #[inline]
            #[must_use]
            pub fn load_integer(self, bytes: &[u8]) -> UVec4 {
                match self {
                    $(Self::$name => UVec4::from_array(all($channels, 0, 1, |i| {
                        <channel::$channel as Texels>::load_integer(bytes, i)
                    })),)*
                }
            }

            /// Writes one texel of a float format. A normalised format clamps to its range and rounds to
            /// the nearest step; NaN becomes 0.
            #[inline]
            pub fn store(self, bytes: &mut [u8], v: Vec4) {
                match self {
                    $(Self::$name => <channel::$channel as Texels>::store(bytes, $channels, v),)*
                }
            }

            /// Writes one texel of an integer format, which must [hold](Self::holds) it; otherwise the lower
            /// bits are kept. Signed numbers are given as their bits.
            #[inline]
            pub fn store_integer(self, bytes: &mut [u8], v: UVec4) {
                match self {
                    $(Self::$name => <channel::$channel as Texels>::store_integers(bytes, $channels, v),)*
                }
            }
        }
    };
}

texel_formats!(formats);

impl TexelFormat {
    /// Bytes of one texel.
    #[must_use]
    pub const fn bytes(self) -> usize {
        match self.stored() {
            Stored::Packed => self.channel_bytes(),
            _ => self.channels() * self.channel_bytes(),
        }
    }

    /// Whether the channels are integers.
    #[must_use]
    pub const fn is_integer(self) -> bool {
        !matches!(self.numbers(), Channels::Float)
    }

    /// Whether an integer format can hold the numbers, of which signed ones are given as their bits.
    /// Vulkan leaves what it cannot hold undefined ("Texel Output Format Conversion"), and WGSL
    /// clamps it.
    #[inline]
    #[must_use]
    pub fn holds(self, v: UVec4) -> bool {
        let fits = |(x, bits): (u32, u32)| match self.numbers() {
            Channels::Float => true,
            Channels::Uint => bits == 32 || x >> bits == 0,
            Channels::Sint => {
                bits == 32 || (-(1 << (bits - 1))..1 << (bits - 1)).contains(&(x as i32))
            }
        };
        let mut channels = v.to_array().into_iter().zip(self.channel_bits());
        channels.by_ref().take(self.channels()).all(fits)
    }
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
    fn every_step_of_a_signed_normalised_format_survives_a_round_trip() {
        let mut b = [0u8; 8];
        for n in -32767..=32767_i16 {
            let v = Vec4::splat(f32::from(n) / 32767.0);
            TexelFormat::Rgba16Snorm.store(&mut b, v);
            assert_eq!(TexelFormat::Rgba16Snorm.load(&b), v);
        }
        TexelFormat::Rgba8Snorm.store(&mut b, Vec4::new(-2.0, 2.0, f32::NAN, -0.5));
        assert_eq!(b[..4], [0x81, 0x7f, 0, 0xc0]);
        // The least number stands for -1 as well.
        assert_eq!(TexelFormat::R8Snorm.load(&[0x80]).x, -1.0);
    }

    #[test]
    fn channels_that_a_format_lacks_are_0_and_alpha_1() {
        let mut b = [0xff_u8; 16];
        TexelFormat::Rg16Float.store(&mut b, Vec4::new(0.5, -2.0, 7.0, 7.0));
        assert_eq!(b[4..], [0xff; 12]);
        assert_eq!(
            TexelFormat::Rg16Float.load(&b),
            Vec4::new(0.5, -2.0, 0.0, 1.0)
        );
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
        let alike = |f: &TexelFormat| f.is_integer() && f.stored() != Stored::Packed;
        for format in FORMATS.into_iter().filter(alike) {
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
