//! Texture formats of OpenGL ES, by WebGPU's names.

/// `RGBA16_EXT` of `EXT_texture_norm16`.
const RGBA16_EXT: u32 = 0x805B;

/// A format: what OpenGL calls it, and how texels go to it and come back.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Texel {
    /// Sized internal format.
    pub(super) internal: u32,
    /// Format of the pixels that are uploaded.
    pub(super) format: u32,
    /// Type of their components.
    pub(super) component: u32,
    /// Bytes of a texel.
    pub(super) bytes: usize,
    /// Format that pixels are read in: of the two that a driver must offer, always four channels.
    pub(super) read_format: u32,
    /// Type that pixels are read in.
    pub(super) read_component: u32,
    /// Bytes of a pixel as it is read.
    pub(super) read_bytes: usize,
}

/// How a text names the format of an image.
pub(super) fn in_text(name: &str) -> Result<&'static str, String> {
    Ok(match name {
        "r32float" => "r32f",
        "rgba32float" => "rgba32f",
        "rgba16float" => "rgba16f",
        "rgba8unorm" => "rgba8",
        "r32uint" => "r32ui",
        "rgba32uint" => "rgba32ui",
        "r32sint" => "r32i",
        "rgba32sint" => "rgba32i",
        "rgba16uint" => "rgba16ui",
        "rgba16sint" => "rgba16i",
        "rgba8uint" => "rgba8ui",
        "rgba8sint" => "rgba8i",
        _ => return Err(format!("GLSL ES has no images of format {name}")),
    })
}

impl Texel {
    /// Depths that are compared.
    pub(super) const DEPTH: Self = Self {
        internal: glow::DEPTH_COMPONENT32F,
        format: glow::DEPTH_COMPONENT,
        component: glow::FLOAT,
        bytes: 4,
        read_format: glow::DEPTH_COMPONENT,
        read_component: glow::FLOAT,
        read_bytes: 4,
    };

    /// The format of that name. Depth is one float: kernels that do not compare read it as a colour.
    pub(super) fn named(name: &str) -> Result<Self, String> {
        let (internal, format, component, bytes) = match name {
            "r32float" | "depth32float" => (glow::R32F, glow::RED, glow::FLOAT, 4),
            "rgba32float" => (glow::RGBA32F, glow::RGBA, glow::FLOAT, 16),
            "rgba16float" => (glow::RGBA16F, glow::RGBA, glow::HALF_FLOAT, 8),
            "rgba16unorm" => (RGBA16_EXT, glow::RGBA, glow::UNSIGNED_SHORT, 8),
            "rgba8unorm" => (glow::RGBA8, glow::RGBA, glow::UNSIGNED_BYTE, 4),
            "r32uint" => (glow::R32UI, glow::RED_INTEGER, glow::UNSIGNED_INT, 4),
            "rg32uint" => (glow::RG32UI, glow::RG_INTEGER, glow::UNSIGNED_INT, 8),
            "rgba32uint" => (glow::RGBA32UI, glow::RGBA_INTEGER, glow::UNSIGNED_INT, 16),
            "rgba32sint" => (glow::RGBA32I, glow::RGBA_INTEGER, glow::INT, 16),
            "r32sint" => (glow::R32I, glow::RED_INTEGER, glow::INT, 4),
            "rgba16uint" => (glow::RGBA16UI, glow::RGBA_INTEGER, glow::UNSIGNED_SHORT, 8),
            "rgba16sint" => (glow::RGBA16I, glow::RGBA_INTEGER, glow::SHORT, 8),
            "rgba8uint" => (glow::RGBA8UI, glow::RGBA_INTEGER, glow::UNSIGNED_BYTE, 4),
            "rgba8sint" => (glow::RGBA8I, glow::RGBA_INTEGER, glow::BYTE, 4),
            _ => return Err(format!("textures of format {name} are not known here")),
        };
        let (read_format, read_component, read_bytes) = match component {
            // Integers are read as integers of 32 bits, of either sign.
            glow::SHORT | glow::BYTE => (glow::RGBA_INTEGER, glow::INT, 16),
            _ if format == glow::RGBA_INTEGER => {
                let wide = if component == glow::INT {
                    glow::INT
                } else {
                    glow::UNSIGNED_INT
                };
                (glow::RGBA_INTEGER, wide, 16)
            }
            glow::FLOAT | glow::HALF_FLOAT => (glow::RGBA, glow::FLOAT, 16),
            glow::UNSIGNED_INT | glow::INT => (glow::RGBA_INTEGER, component, 16),
            _ => (glow::RGBA, component, bytes),
        };
        Ok(Self {
            internal,
            format,
            component,
            bytes,
            read_format,
            read_component,
            read_bytes,
        })
    }

    /// Appends a pixel as it was read, as the format has it in memory.
    pub(super) fn pack(&self, pixel: &[u8], to: &mut Vec<u8>) {
        if self.component == glow::HALF_FLOAT {
            for float in pixel.chunks_exact(4) {
                let float = f32::from_le_bytes([float[0], float[1], float[2], float[3]]);
                to.extend(half(float).to_le_bytes());
            }
        } else if self.format == glow::RGBA_INTEGER && self.bytes < pixel.len() {
            // The lower bytes of each channel.
            for channel in pixel.chunks_exact(4) {
                to.extend(&channel[..self.bytes / 4]);
            }
        } else {
            // One channel is the first of the four.
            to.extend(&pixel[..self.bytes]);
        }
    }
}

/// The half of a number that is one already: half floats are read as floats.
fn half(float: f32) -> u16 {
    let bits = float.to_bits();
    let sign = (bits >> 16) as u16 & 0x8000;
    let exponent = (bits >> 23) & 0xff;
    let fraction = bits & 0x7f_ffff;
    sign | match exponent {
        0xff if fraction != 0 => 0x7e00,
        0xff => 0x7c00,
        113..=142 => (((exponent - 112) << 10) | (fraction >> 13)) as u16,
        // Subnormal halves: the leading one is spelled out.
        103..=112 => ((fraction | 0x80_0000) >> (126 - exponent)) as u16,
        0..=102 => 0,
        _ => 0x7c00,
    }
}

#[cfg(test)]
mod tests {
    use super::half;

    /// The value of a half.
    fn float(half: u16) -> f32 {
        let sign = if half & 0x8000 == 0 { 1.0 } else { -1.0 };
        let fraction = f32::from(half & 0x3ff);
        sign * match (half >> 10) & 0x1f {
            0 => fraction * 2.0f32.powi(-24),
            31 if fraction == 0.0 => f32::INFINITY,
            31 => f32::NAN,
            exponent => (1024.0 + fraction) * 2.0f32.powi(i32::from(exponent) - 25),
        }
    }

    #[test]
    fn every_half_comes_back() {
        for bits in 0..=u16::MAX {
            let value = float(bits);
            if value.is_nan() {
                assert!(float(half(value)).is_nan());
            } else {
                assert_eq!(half(value), bits, "{value}");
            }
        }
    }
}
