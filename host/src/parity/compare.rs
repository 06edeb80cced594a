//! How far apart two numbers are.

use std::cmp::Ordering;

use hankel_dsl::native::channel::Stored;
use hankel_dsl::native::describe::{Channels, Scalar, TexelFormat};
use serde::{Deserialize, Serialize};

use crate::flat::Number;

/// The distance of two numbers in units in the last place: how many floats lie between them, plus
/// one. Zeros of different sign are equal, and so are NaNs; a NaN and a number are as far apart
/// as can be.
#[must_use]
pub fn ulp_f32(a: f32, b: f32) -> u64 {
    match (a.is_nan(), b.is_nan()) {
        (true, true) => 0,
        (false, false) => ordered_f32(a).abs_diff(ordered_f32(b)),
        _ => u64::MAX,
    }
}

/// As [`ulp_f32`].
#[must_use]
pub fn ulp_f64(a: f64, b: f64) -> u64 {
    match (a.is_nan(), b.is_nan()) {
        (true, true) => 0,
        (false, false) => {
            let distance = ordered_f64(a).abs_diff(ordered_f64(b));
            u64::try_from(distance).unwrap_or(u64::MAX)
        }
        _ => u64::MAX,
    }
}

/// As [`ulp_f32`], of the bits of halves.
fn ulp_f16(a: u16, b: u16) -> u64 {
    let is_nan = |bits: u16| bits & 0x7fff > 0x7c00;
    match (is_nan(a), is_nan(b)) {
        (true, true) => 0,
        (false, false) => ordered_f16(a).abs_diff(ordered_f16(b)).into(),
        _ => u64::MAX,
    }
}

/// A half's place among all halves, both zeros at 0.
fn ordered_f16(bits: u16) -> i32 {
    let magnitude = i32::from(bits & 0x7fff);
    if bits >> 15 == 1 {
        -magnitude
    } else {
        magnitude
    }
}

/// A float's place among all floats, both zeros at 0.
fn ordered_f32(x: f32) -> i64 {
    let magnitude = i64::from(x.to_bits() & 0x7fff_ffff);
    if x.is_sign_negative() {
        -magnitude
    } else {
        magnitude
    }
}

fn ordered_f64(x: f64) -> i128 {
    let magnitude = i128::from(x.to_bits() & (u64::MAX >> 1));
    if x.is_sign_negative() {
        -magnitude
    } else {
        magnitude
    }
}

/// A subnormal float as zero, any other as it is.
fn flushed(number: Number) -> Number {
    match number {
        Number::F32(x) if x.is_subnormal() => Number::F32(0.0),
        Number::F64(x) if x.is_subnormal() => Number::F64(0.0),
        other => other,
    }
}

/// The type of an output value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// A number in memory.
    Scalar(Scalar),
    /// A step of a normalised channel of this format.
    Normalised(TexelFormat),
    /// A channel of 8 or 16 bits of this format.
    Integer(TexelFormat),
    /// All channels of this format, which share a word.
    Packed(TexelFormat),
}

impl Kind {
    /// A number as its type is written: integers have no fraction.
    #[must_use]
    pub fn spelled(&self, x: f64) -> String {
        let is_integer = match self {
            Self::Scalar(it) => !matches!(it, Scalar::F32 | Scalar::F64 | Scalar::F16),
            Self::Integer(_) => true,
            Self::Normalised(_) => false,
            Self::Packed(format) => format.is_integer(),
        };
        match is_integer {
            true => format!("{x:.0}"),
            false => format!("{x:?}"),
        }
    }

    /// The type of a texture's channels.
    #[must_use]
    pub const fn of(format: TexelFormat) -> Self {
        match (format.stored(), format.numbers()) {
            (Stored::Float32, _) => Self::Scalar(Scalar::F32),
            (Stored::Float16, _) => Self::Scalar(Scalar::F16),
            (Stored::Unorm { .. } | Stored::Snorm { .. }, _) => Self::Normalised(format),
            (Stored::Integer { bits: 32 }, Channels::Sint) => Self::Scalar(Scalar::I32),
            (Stored::Integer { bits: 32 }, _) => Self::Scalar(Scalar::U32),
            (Stored::Integer { .. }, _) => Self::Integer(format),
            (Stored::Packed, _) => Self::Packed(format),
        }
    }

    /// Bytes of a value.
    #[must_use]
    pub const fn bytes(self) -> usize {
        match self {
            Self::Scalar(s) => crate::device::slots::scalar_bytes(s),
            Self::Normalised(format) | Self::Integer(format) | Self::Packed(format) => {
                format.channel_bytes()
            }
        }
    }

    /// Which of the values at the start of two byte slices comes first.
    #[must_use]
    pub fn order(self, a: &[u8], b: &[u8]) -> Ordering {
        match self {
            Self::Scalar(scalar) => {
                let read = |bytes: &[u8]| Number::read(scalar, bytes);
                match (read(a), read(b)) {
                    (Number::F32(a), Number::F32(b)) => a.total_cmp(&b),
                    (Number::F64(a), Number::F64(b)) => a.total_cmp(&b),
                    (Number::U32(a), Number::U32(b)) => a.cmp(&b),
                    (Number::I32(a), Number::I32(b)) => a.cmp(&b),
                    (Number::U64(a), Number::U64(b)) => a.cmp(&b),
                    (Number::I64(a), Number::I64(b)) => a.cmp(&b),
                    (Number::F16(a), Number::F16(b)) => ordered_f16(a).cmp(&ordered_f16(b)),
                    _ => Ordering::Equal,
                }
            }
            Self::Normalised(_) | Self::Integer(_) | Self::Packed(_) => {
                a[..self.bytes()].cmp(&b[..self.bytes()])
            }
        }
    }

    /// Compares the values at the start of two byte slices. Integers and normalised channels
    /// count steps. With `flush`, subnormal numbers count as zero.
    #[must_use]
    pub fn compare(self, a: &[u8], b: &[u8], flush: bool) -> Distance {
        match self {
            Self::Scalar(scalar) => {
                let read = |bytes: &[u8]| {
                    let number = Number::read(scalar, bytes);
                    if flush { flushed(number) } else { number }
                };
                let (a, b) = (read(a), read(b));
                let ulp = match (a, b) {
                    (Number::F32(a), Number::F32(b)) => ulp_f32(a, b),
                    (Number::F64(a), Number::F64(b)) => ulp_f64(a, b),
                    (Number::U32(a), Number::U32(b)) => a.abs_diff(b).into(),
                    (Number::I32(a), Number::I32(b)) => a.abs_diff(b).into(),
                    (Number::U64(a), Number::U64(b)) => a.abs_diff(b),
                    (Number::I64(a), Number::I64(b)) => a.abs_diff(b),
                    (Number::F16(a), Number::F16(b)) => ulp_f16(a, b),
                    _ => u64::MAX,
                };
                Distance::new(ulp, a.to_f64(), b.to_f64())
            }
            Self::Normalised(format) => {
                let ((a, value_a), (b, value_b)) = (step(format, a), step(format, b));
                Distance::new(a.abs_diff(b), value_a, value_b)
            }
            Self::Integer(format) => {
                let read = |bytes: &[u8]| {
                    let mut texel = [0; 16];
                    let own = &bytes[..format.channel_bytes()];
                    texel[..own.len()].copy_from_slice(own);
                    format.load_integer(&texel).x as i32
                };
                let (a, b) = (read(a), read(b));
                Distance::new(a.abs_diff(b).into(), a.into(), b.into())
            }
            Self::Packed(format) => farthest(format, a, b),
        }
    }
}

/// The distance of the channels that differ most, in steps: floats without a sign are in the order of their bits.
fn farthest(format: TexelFormat, a: &[u8], b: &[u8]) -> Distance {
    let (values_a, values_b) = (format.load(a), format.load(b));
    let (steps_a, steps_b) = (format.load_integer(a), format.load_integer(b));
    let channels = (0..format.channels()).map(|i| {
        let (x, y) = (values_a[i], values_b[i]);
        let steps = match (x.is_nan(), y.is_nan()) {
            (true, true) => 0,
            (false, false) => steps_a[i].abs_diff(steps_b[i]).into(),
            _ => u64::MAX,
        };
        Distance::new(steps, x.into(), y.into())
    });
    channels
        .max_by_key(|distance| distance.ulp)
        .unwrap_or_else(|| Distance::new(0, 0.0, 0.0))
}

/// The number of the step that a normalised channel is at, and its value.
fn step(format: TexelFormat, bytes: &[u8]) -> (i64, f64) {
    let mut all = [0; 8];
    all[..format.channel_bytes()].copy_from_slice(&bytes[..format.channel_bytes()]);
    let unsigned = i64::from_le_bytes(all);
    let (number, most) = match format.stored() {
        Stored::Snorm { bits } => {
            let most = (1 << (bits - 1)) - 1;
            let number = if unsigned > most {
                unsigned - (1 << bits)
            } else {
                unsigned
            };
            // The least number stands for -1 as well.
            (number.max(-most), most)
        }
        _ => (unsigned, (1 << (8 * format.channel_bytes())) - 1),
    };
    (number, number as f64 / most as f64)
}

/// How far apart two values are.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Distance {
    /// In units in the last place, or steps.
    pub ulp: u64,
    /// As numbers; infinite if only one of them is finite.
    pub absolute: f64,
    /// The first one.
    pub a: f64,
    /// The second one.
    pub b: f64,
}

impl Distance {
    fn new(ulp: u64, a: f64, b: f64) -> Self {
        let difference = (a - b).abs();
        let absolute = match (ulp, difference.is_nan()) {
            (0, _) => 0.0,
            (_, true) => f64::INFINITY,
            _ => difference,
        };
        Self {
            ulp,
            absolute,
            a,
            b,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn neighbours_are_one_apart_over_every_boundary() {
        for x in [
            0.0f32,
            1.0,
            -1.0,
            1e-40,
            f32::MIN_POSITIVE,
            2.0f32.powi(23),
            f32::MAX,
        ] {
            assert_eq!(ulp_f32(x, x.next_up()), 1, "{x:e}");
            assert_eq!(ulp_f32(x.next_up(), x), 1);
            assert_eq!(ulp_f32(-x, -x.next_up()), 1);
        }
        for x in [0.0f64, 1.0, 5e-324, f64::MIN_POSITIVE, f64::MAX] {
            assert_eq!(ulp_f64(x, x.next_up()), 1, "{x:e}");
        }
    }

    #[test]
    fn signs_zeros_and_nans() {
        assert_eq!(ulp_f32(0.0, -0.0), 0);
        assert_eq!(ulp_f32(f32::from_bits(1), -f32::from_bits(1)), 2);
        assert_eq!(ulp_f32(1.0, -1.0), 2 * u64::from(1.0f32.to_bits()));
        assert_eq!(ulp_f32(f32::NAN, -f32::NAN), 0);
        assert_eq!(ulp_f32(f32::NAN, 0.0), u64::MAX);
        assert_eq!(ulp_f64(0.0, f64::NAN), u64::MAX);
        assert_eq!(ulp_f32(f32::INFINITY, f32::MAX), 1);
        assert_eq!(
            ulp_f64(f64::INFINITY, f64::NEG_INFINITY),
            2 * f64::INFINITY.to_bits()
        );
    }

    #[test]
    fn the_distance_is_a_metric() {
        let mut rng = fastrand::Rng::with_seed(3);
        for _ in 0..10_000 {
            let [a, b, c] = [(); 3].map(|()| f32::from_bits(rng.u32(..)));
            if [a, b, c].iter().any(|x| x.is_nan()) {
                continue;
            }
            assert_eq!(ulp_f32(a, b), ulp_f32(b, a));
            assert!(ulp_f32(a, c) <= ulp_f32(a, b) + ulp_f32(b, c));
            assert_eq!(ulp_f32(a, b) == 0, a == b);
        }
    }

    #[test]
    fn every_kind_counts_its_own_steps() {
        let d = Kind::Scalar(Scalar::U32).compare(&7u32.to_le_bytes(), &4u32.to_le_bytes(), false);
        assert_eq!((d.ulp, d.absolute), (3, 3.0));
        let d =
            Kind::Scalar(Scalar::I32).compare(&(-7i32).to_le_bytes(), &4i32.to_le_bytes(), false);
        assert_eq!((d.ulp, d.absolute), (11, 11.0));
        // Wide ones differ where floats do not tell them apart.
        let wide = u64::MAX - 1;
        let d =
            Kind::Scalar(Scalar::U64).compare(&u64::MAX.to_le_bytes(), &wide.to_le_bytes(), false);
        assert_eq!(d.ulp, 1);
        let d = Kind::Normalised(TexelFormat::Rg16Unorm).compare(
            &65535u16.to_le_bytes(),
            &65533u16.to_le_bytes(),
            false,
        );
        assert_eq!((d.ulp, d.a), (2, 1.0));
        let d = Kind::Normalised(TexelFormat::R8Unorm).compare(&[0], &[255], false);
        assert_eq!((d.ulp, d.absolute), (255, 1.0));
        let d = Kind::Normalised(TexelFormat::Rgba8Snorm).compare(&[0x80], &[127], false);
        assert_eq!((d.ulp, d.a, d.b), (254, -1.0, 1.0));
        let d = Kind::Integer(TexelFormat::Rgba8Sint).compare(&[0xff], &[2], false);
        assert_eq!((d.ulp, d.a), (3, -1.0));
        let d = Kind::Integer(TexelFormat::Rgba16Uint).compare(&[0xff, 0xff], &[0, 0xff], false);
        assert_eq!((d.ulp, d.a), (255, 65535.0));
        // 1.0 and the next half float.
        let d = Kind::Scalar(Scalar::F16).compare(
            &0x3c00u16.to_le_bytes(),
            &0x3c01u16.to_le_bytes(),
            false,
        );
        assert_eq!((d.ulp, d.a, d.absolute), (1, 1.0, 1.0 / 1024.0));
        let d =
            Kind::Scalar(Scalar::F32).compare(&1f32.to_le_bytes(), &f32::NAN.to_le_bytes(), false);
        assert_eq!((d.ulp, d.absolute), (u64::MAX, f64::INFINITY));
        let least = f32::from_bits(1).to_le_bytes();
        let zero = 0f32.to_le_bytes();
        assert_eq!(
            Kind::Scalar(Scalar::F32).compare(&least, &zero, true).ulp,
            0
        );
        assert_eq!(
            Kind::Scalar(Scalar::F32).compare(&least, &zero, false).ulp,
            1
        );
    }
}
