//! How the channels of texels are stored.

use glam::{UVec4, Vec4};

use super::describe::Channels;

/// How a channel is stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stored {
    /// A 32-bit float.
    Float32,
    /// A 16-bit float.
    Float16,
    /// From 0 to 1 in equal steps.
    Unorm {
        /// Bits of the number of a step.
        bits: u32,
    },
    /// From -1 to 1 in equal steps.
    Snorm {
        /// Bits of the number of a step, with its sign.
        bits: u32,
    },
    /// An integer.
    Integer {
        /// Its bits.
        bits: u32,
    },
    /// With the others of its texel in one 32-bit word, each with bits of its own.
    Packed,
}

/// A way to store texels: the channels of each.
pub(super) trait Texels {
    /// Bytes of a channel; of packed ones, of the texel.
    const BYTES: usize;
    const STORED: Stored;
    const NUMBERS: Channels;
    /// Bits of each channel.
    const BITS: [u32; 4];
    /// Reads a channel of a texel; integers as their values.
    fn load(texel: &[u8], channel: usize) -> f32;
    /// Reads an integer; a signed one as its bits.
    fn load_integer(texel: &[u8], channel: usize) -> u32;
    /// Writes so many channels.
    fn store(texel: &mut [u8], channels: usize, v: Vec4);
    /// Writes so many integers.
    fn store_integers(texel: &mut [u8], channels: usize, v: UVec4);
}

impl<C: Channel> Texels for C {
    const BYTES: usize = C::SIZE;
    const STORED: Stored = C::STORING;
    const NUMBERS: Channels = C::KIND;
    const BITS: [u32; 4] = [8 * C::SIZE as u32; 4];
    #[inline(always)]
    fn load(texel: &[u8], channel: usize) -> f32 {
        C::read(&texel[channel * C::SIZE..(channel + 1) * C::SIZE])
    }
    #[inline(always)]
    fn load_integer(texel: &[u8], channel: usize) -> u32 {
        C::read_integer(&texel[channel * C::SIZE..(channel + 1) * C::SIZE])
    }
    #[inline(always)]
    fn store(texel: &mut [u8], channels: usize, v: Vec4) {
        let all = texel.chunks_exact_mut(C::SIZE).take(channels);
        for (bytes, x) in all.zip(v.to_array()) {
            C::write(x, bytes);
        }
    }
    #[inline(always)]
    fn store_integers(texel: &mut [u8], channels: usize, v: UVec4) {
        if C::KIND == Channels::Float {
            return <Self as Texels>::store(texel, channels, v.as_vec4());
        }
        let all = texel.chunks_exact_mut(C::SIZE).take(channels);
        for (bytes, x) in all.zip(v.to_array()) {
            bytes.copy_from_slice(&x.to_le_bytes()[..C::SIZE]);
        }
    }
}

/// A channel by itself.
trait Channel {
    const SIZE: usize;
    const STORING: Stored;
    const KIND: Channels;
    /// Reads it; integers as their values.
    fn read(bytes: &[u8]) -> f32;
    /// Reads an integer; a signed one as its bits.
    fn read_integer(bytes: &[u8]) -> u32;
    /// Writes it.
    fn write(x: f32, bytes: &mut [u8]);
}

#[inline(always)]
fn array<const N: usize>(bytes: &[u8]) -> [u8; N] {
    let mut all = [0; N];
    all.copy_from_slice(bytes);
    all
}

macro_rules! channels {
    ($($name:ident: $memory:ty, $stored:expr, $numbers:ident, |$read:ident| $load:expr, |$x:ident| $store:expr;)*) => { $(
        pub(super) enum $name {}

        impl Channel for $name {
            const SIZE: usize = size_of::<$memory>();
            const STORING: Stored = $stored;
            const KIND: Channels = Channels::$numbers;
            #[inline(always)]
            fn read(bytes: &[u8]) -> f32 {
                let $read = <$memory>::from_le_bytes(array(bytes));
                $load
            }
            #[inline(always)]
            fn read_integer(bytes: &[u8]) -> u32 {
                match Self::KIND {
                    Channels::Float => Self::read(bytes) as u32,
                    _ => <$memory>::from_le_bytes(array(bytes)) as i32 as u32,
                }
            }
            #[inline(always)]
            fn write($x: f32, bytes: &mut [u8]) {
                let stored: $memory = $store;
                bytes.copy_from_slice(&stored.to_le_bytes());
            }
        }
    )* };
}

// `as` saturates and takes NaN to 0.
channels! {
    Float32: f32, Stored::Float32, Float, |x| x, |x| x;
    Float16: u16, Stored::Float16, Float, |x| half::f16::from_bits(x).to_f32(), |x| half::f16::from_f32(x).to_bits();
    Unorm16: u16, Stored::Unorm { bits: 16 }, Float, |x| f32::from(x) / 65535.0,
        |x| (x.clamp(0.0, 1.0) * 65535.0).round_ties_even() as u16;
    Unorm8: u8, Stored::Unorm { bits: 8 }, Float, |x| f32::from(x) / 255.0,
        |x| (x.clamp(0.0, 1.0) * 255.0).round_ties_even() as u8;
    Snorm16: i16, Stored::Snorm { bits: 16 }, Float, |x| (f32::from(x) / 32767.0).max(-1.0),
        |x| (x.clamp(-1.0, 1.0) * 32767.0).round_ties_even() as i16;
    Snorm8: i8, Stored::Snorm { bits: 8 }, Float, |x| (f32::from(x) / 127.0).max(-1.0),
        |x| (x.clamp(-1.0, 1.0) * 127.0).round_ties_even() as i8;
    Uint32: u32, Stored::Integer { bits: 32 }, Uint, |x| x as f32, |x| x as u32;
    Uint16: u16, Stored::Integer { bits: 16 }, Uint, |x| x.into(), |x| x as u16;
    Uint8: u8, Stored::Integer { bits: 8 }, Uint, |x| x.into(), |x| x as u8;
    Sint32: i32, Stored::Integer { bits: 32 }, Sint, |x| x as f32, |x| x as i32;
    Sint16: i16, Stored::Integer { bits: 16 }, Sint, |x| x.into(), |x| x as i16;
    Sint8: i8, Stored::Integer { bits: 8 }, Sint, |x| x.into(), |x| x as i8;
}

/// Channels in one word, the first in its lowest bits.
macro_rules! packed {
    ($($name:ident: $numbers:ident, $bits:expr, |$read:ident, $of:ident| $load:expr, |$x:ident, $to:ident| $store:expr;)*) => { $(
        pub(super) enum $name {}

        impl $name {
            /// The bits below a channel.
            fn below(channel: usize) -> u32 {
                <Self as Texels>::BITS[..channel].iter().sum()
            }
        }

        impl Texels for $name {
            const BYTES: usize = 4;
            const STORED: Stored = Stored::Packed;
            const NUMBERS: Channels = Channels::$numbers;
            const BITS: [u32; 4] = $bits;
            #[inline]
            fn load(texel: &[u8], channel: usize) -> f32 {
                let ($read, $of) = (Self::load_integer(texel, channel), Self::BITS[channel]);
                $load
            }
            #[inline]
            fn load_integer(texel: &[u8], channel: usize) -> u32 {
                let word = u32::from_le_bytes(array(&texel[..4]));
                word >> Self::below(channel) & ((1 << Self::BITS[channel]) - 1)
            }
            #[inline]
            fn store(texel: &mut [u8], channels: usize, v: Vec4) {
                let mut all = [0; 4];
                for ((to, $x), $to) in all.iter_mut().zip(v.to_array()).zip(Self::BITS) {
                    *to = $store;
                }
                Self::store_integers(texel, channels, UVec4::from_array(all));
            }
            #[inline]
            fn store_integers(texel: &mut [u8], channels: usize, v: UVec4) {
                let word = (0..channels).fold(0, |word, i| {
                    word | (v[i] & ((1 << Self::BITS[i]) - 1)) << Self::below(i)
                });
                texel[..4].copy_from_slice(&word.to_le_bytes());
            }
        }
    )* };
}

packed! {
    Unorm10And2: Float, [10, 10, 10, 2],
        |n, bits| n as f32 / ((1 << bits) - 1) as f32,
        |x, bits| (x.clamp(0.0, 1.0) * ((1 << bits) - 1) as f32).round_ties_even() as u32;
    Uint10And2: Uint, [10, 10, 10, 2], |n, _bits| n as f32, |x, _bits| x as u32;
    Float11And10: Float, [11, 11, 10, 0], |n, bits| unsigned_float(n, bits), |x, bits| to_unsigned_float(x, bits);
}

/// A float without a sign of so many bits, of which five are the exponent (Vulkan specification, "Unsigned 11-Bit
/// Floating-Point Numbers").
fn unsigned_float(n: u32, bits: u32) -> f32 {
    if bits == 0 {
        return 1.0;
    }
    let digits = bits - 5;
    let (exponent, mantissa) = (n >> digits, n & ((1 << digits) - 1));
    let share = mantissa as f32 / (1 << digits) as f32;
    match exponent {
        0 => share * 2.0_f32.powi(-14),
        31 if mantissa == 0 => f32::INFINITY,
        31 => f32::NAN,
        _ => (1.0 + share) * 2.0_f32.powi(exponent as i32 - 15),
    }
}

/// The nearest such float; what is too large becomes the largest, and what is negative 0.
fn to_unsigned_float(x: f32, bits: u32) -> u32 {
    if bits == 0 {
        return 0;
    }
    let digits = bits - 5;
    let infinity = 31 << digits;
    if x.is_nan() {
        return infinity + 1;
    }
    if x == f32::INFINITY {
        return infinity;
    }
    let x = x.max(0.0);
    let least_normal = 2.0_f32.powi(-14);
    let n = if x < least_normal {
        (x / least_normal * (1 << digits) as f32).round_ties_even() as u32
    } else {
        // The exponent's bias is 127, and becomes 15.
        let wide = x.to_bits() - (112 << 23);
        let shift = 23 - digits;
        (wide + (1 << (shift - 1)) - 1 + (wide >> shift & 1)) >> shift
    };
    n.min(infinity - 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_float_without_a_sign_survives_a_round_trip() {
        for bits in [10, 11] {
            let infinity = 31 << (bits - 5);
            for n in 0..=infinity {
                assert_eq!(to_unsigned_float(unsigned_float(n, bits), bits), n, "{n}");
            }
            assert!(unsigned_float(infinity + 1, bits).is_nan());
            assert_eq!(to_unsigned_float(-1.0, bits), 0);
            assert_eq!(to_unsigned_float(1e9, bits), infinity - 1);
        }
        assert_eq!(unsigned_float(15 << 6, 11), 1.0);
    }

    #[test]
    fn channels_of_a_word_do_not_touch_each_other() {
        let mut texel = [0; 4];
        Uint10And2::store_integers(&mut texel, 4, UVec4::new(1, 2, 1023, 3));
        assert_eq!(
            u32::from_le_bytes(texel),
            1 | 2 << 10 | 1023 << 20 | 3 << 30
        );
        assert_eq!(
            [0, 1, 2, 3].map(|i| Uint10And2::load_integer(&texel, i)),
            [1, 2, 1023, 3]
        );
        Unorm10And2::store(&mut texel, 4, Vec4::new(1.0, 0.5, -1.0, 0.4));
        assert_eq!(
            [0, 1, 2, 3].map(|i| Unorm10And2::load_integer(&texel, i)),
            [1023, 512, 0, 1]
        );
    }
}
