//! Texel formats on the host: how a texel's bytes become numbers and back, the same way a GPU does
//! it (Vulkan specification, "Fixed-Point Data Conversions" and "16-Bit Floating-Point Numbers").

use glam::{UVec4, Vec4};

use super::describe::TexelFormat;

/// Every format, in the order of their numbers.
pub const FORMATS: [TexelFormat; 7] = [
    TexelFormat::R32Float,
    TexelFormat::Rgba32Float,
    TexelFormat::Rgba16Float,
    TexelFormat::Rgba16Unorm,
    TexelFormat::Rgba8Unorm,
    TexelFormat::R32Uint,
    TexelFormat::Rgba32Uint,
];

impl TexelFormat {
    /// Bytes of one texel.
    #[must_use]
    pub const fn bytes(self) -> usize {
        match self {
            Self::R32Float | Self::Rgba8Unorm | Self::R32Uint => 4,
            Self::Rgba16Float | Self::Rgba16Unorm => 8,
            Self::Rgba32Float | Self::Rgba32Uint => 16,
        }
    }

    /// Channels of one texel.
    #[must_use]
    pub const fn channels(self) -> usize {
        match self {
            Self::R32Float | Self::R32Uint => 1,
            _ => 4,
        }
    }

    /// Whether the channels are integers.
    #[must_use]
    pub const fn is_uint(self) -> bool {
        matches!(self, Self::R32Uint | Self::Rgba32Uint)
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
            Self::R32Uint | Self::Rgba32Uint => self.load_uint(bytes).as_vec4(),
        }
    }

    /// Reads one texel of an integer format; channels that the format lacks are 0, alpha 1.
    #[inline]
    #[must_use]
    pub fn load_uint(self, bytes: &[u8]) -> UVec4 {
        let u32_at = |i: usize| u32::from_le_bytes(take(bytes, i));
        match self {
            Self::R32Uint => UVec4::new(u32_at(0), 0, 0, 1),
            Self::Rgba32Uint => UVec4::new(u32_at(0), u32_at(1), u32_at(2), u32_at(3)),
            _ => self.load(bytes).as_uvec4(),
        }
    }

    /// Writes one texel of a float format. A normalised format clamps to its range and rounds to
    /// the nearest step; NaN becomes 0.
    #[inline]
    pub fn store(self, bytes: &mut [u8], v: Vec4) {
        let v = v.to_array();
        match self {
            Self::R32Float => bytes[..4].copy_from_slice(&v[0].to_le_bytes()),
            Self::Rgba32Float => {
                for (b, x) in bytes.chunks_exact_mut(4).zip(v) {
                    b.copy_from_slice(&x.to_le_bytes());
                }
            }
            Self::Rgba16Float => {
                for (b, x) in bytes.chunks_exact_mut(2).zip(v) {
                    b.copy_from_slice(&half::f16::from_f32(x).to_bits().to_le_bytes());
                }
            }
            Self::Rgba16Unorm => {
                for (b, x) in bytes.chunks_exact_mut(2).zip(v) {
                    // `as` saturates and takes NaN to 0.
                    let n = (x.clamp(0.0, 1.0) * 65535.0).round_ties_even() as u16;
                    b.copy_from_slice(&n.to_le_bytes());
                }
            }
            Self::Rgba8Unorm => {
                for (b, x) in bytes.iter_mut().zip(v) {
                    *b = (x.clamp(0.0, 1.0) * 255.0).round_ties_even() as u8;
                }
            }
            Self::R32Uint | Self::Rgba32Uint => {
                self.store_uint(bytes, UVec4::from_array(v.map(|x| x as u32)));
            }
        }
    }

    /// Writes one texel of an integer format.
    #[inline]
    pub fn store_uint(self, bytes: &mut [u8], v: UVec4) {
        if self.is_uint() {
            for (b, x) in bytes.chunks_exact_mut(4).zip(v.to_array()) {
                b.copy_from_slice(&x.to_le_bytes());
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
    fn numbers_and_formats_agree() {
        for (i, f) in FORMATS.into_iter().enumerate() {
            assert_eq!(f as usize, i);
            assert_eq!(serde_json::to_value(f).unwrap(), f.name());
        }
    }
}
