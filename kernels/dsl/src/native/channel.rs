//! How the channels of texels are stored.

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
}

/// A way to store a channel.
pub(super) trait Channel {
    const BYTES: usize;
    const STORED: Stored;
    const NUMBERS: Channels;
    /// Reads it; integers as their values.
    fn load(bytes: &[u8]) -> f32;
    /// Reads an integer; a signed one as its bits.
    fn load_integer(bytes: &[u8]) -> u32;
    /// Writes it.
    fn store(x: f32, bytes: &mut [u8]);
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
            const BYTES: usize = size_of::<$memory>();
            const STORED: Stored = $stored;
            const NUMBERS: Channels = Channels::$numbers;
            #[inline(always)]
            fn load(bytes: &[u8]) -> f32 {
                let $read = <$memory>::from_le_bytes(array(bytes));
                $load
            }
            #[inline(always)]
            fn load_integer(bytes: &[u8]) -> u32 {
                match Self::NUMBERS {
                    Channels::Float => Self::load(bytes) as u32,
                    _ => <$memory>::from_le_bytes(array(bytes)) as i32 as u32,
                }
            }
            #[inline(always)]
            fn store($x: f32, bytes: &mut [u8]) {
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
