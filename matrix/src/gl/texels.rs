//! Texture formats of OpenGL ES, by WebGPU's names.

/// Formats of `EXT_texture_norm16`.
const R16_EXT: u32 = 0x822A;
const RG16_EXT: u32 = 0x822C;
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
    /// Channels of a texel.
    pub(super) channels: usize,
    /// Bytes of a texel.
    pub(super) bytes: usize,
    /// Format that pixels are read in: of the two that a driver must offer, always four channels.
    pub(super) read_format: u32,
    /// Type that pixels are read in.
    pub(super) read_component: u32,
    /// Bytes of a channel as it is read.
    pub(super) read_channel_bytes: usize,
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
        "rgba8snorm" => "rgba8_snorm",
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
        channels: 1,
        bytes: 4,
        read_format: glow::DEPTH_COMPONENT,
        read_component: glow::FLOAT,
        read_channel_bytes: 4,
        read_bytes: 4,
    };

    /// The format of that name. Depth is one float: kernels that do not compare read it as a colour.
    pub(super) fn named(name: &str) -> Result<Self, String> {
        let (internal, component) = match name {
            "r32float" | "depth32float" => (glow::R32F, glow::FLOAT),
            "rg32float" => (glow::RG32F, glow::FLOAT),
            "rgba32float" => (glow::RGBA32F, glow::FLOAT),
            "r16float" => (glow::R16F, glow::HALF_FLOAT),
            "rg16float" => (glow::RG16F, glow::HALF_FLOAT),
            "rgba16float" => (glow::RGBA16F, glow::HALF_FLOAT),
            "r16unorm" => (R16_EXT, glow::UNSIGNED_SHORT),
            "rg16unorm" => (RG16_EXT, glow::UNSIGNED_SHORT),
            "rgba16unorm" => (RGBA16_EXT, glow::UNSIGNED_SHORT),
            "r8unorm" => (glow::R8, glow::UNSIGNED_BYTE),
            "rg8unorm" => (glow::RG8, glow::UNSIGNED_BYTE),
            "rgba8unorm" => (glow::RGBA8, glow::UNSIGNED_BYTE),
            "rgba8snorm" => (glow::RGBA8_SNORM, glow::BYTE),
            "r32uint" => (glow::R32UI, glow::UNSIGNED_INT),
            "r32sint" => (glow::R32I, glow::INT),
            "rg32uint" => (glow::RG32UI, glow::UNSIGNED_INT),
            "rg32sint" => (glow::RG32I, glow::INT),
            "rgba32uint" => (glow::RGBA32UI, glow::UNSIGNED_INT),
            "rgba32sint" => (glow::RGBA32I, glow::INT),
            "r16uint" => (glow::R16UI, glow::UNSIGNED_SHORT),
            "r16sint" => (glow::R16I, glow::SHORT),
            "rg16uint" => (glow::RG16UI, glow::UNSIGNED_SHORT),
            "rg16sint" => (glow::RG16I, glow::SHORT),
            "rgba16uint" => (glow::RGBA16UI, glow::UNSIGNED_SHORT),
            "rgba16sint" => (glow::RGBA16I, glow::SHORT),
            "r8uint" => (glow::R8UI, glow::UNSIGNED_BYTE),
            "r8sint" => (glow::R8I, glow::BYTE),
            "rg8uint" => (glow::RG8UI, glow::UNSIGNED_BYTE),
            "rg8sint" => (glow::RG8I, glow::BYTE),
            "rgba8uint" => (glow::RGBA8UI, glow::UNSIGNED_BYTE),
            "rgba8sint" => (glow::RGBA8I, glow::BYTE),
            _ => return Err(format!("textures of format {name} are not known here")),
        };
        let is_integer = name.ends_with("int");
        let (channels, format, integers) = match name {
            _ if name.starts_with("rgba") => (4, glow::RGBA, glow::RGBA_INTEGER),
            _ if name.starts_with("rg") => (2, glow::RG, glow::RG_INTEGER),
            _ => (1, glow::RED, glow::RED_INTEGER),
        };
        let format = if is_integer { integers } else { format };
        let channel_bytes = match component {
            glow::FLOAT | glow::UNSIGNED_INT | glow::INT => 4,
            glow::HALF_FLOAT | glow::UNSIGNED_SHORT | glow::SHORT => 2,
            _ => 1,
        };
        let bytes = channels * channel_bytes;
        let (read_format, read_component, read_channel_bytes) = match component {
            // Signed shares cannot be drawn into, and so not be read: they are spread into floats.
            _ if name.ends_with("snorm") => (glow::RGBA, glow::FLOAT, 4),
            // Integers are read as integers of 32 bits, of either sign.
            glow::INT | glow::SHORT | glow::BYTE => (glow::RGBA_INTEGER, glow::INT, 4),
            _ if is_integer => (glow::RGBA_INTEGER, glow::UNSIGNED_INT, 4),
            glow::FLOAT | glow::HALF_FLOAT => (glow::RGBA, glow::FLOAT, 4),
            _ => (glow::RGBA, component, channel_bytes),
        };
        Ok(Self {
            internal,
            format,
            component,
            channels,
            bytes,
            read_format,
            read_component,
            read_channel_bytes,
            read_bytes: 4 * read_channel_bytes,
        })
    }

    /// Whether texels are read by way of floats that they are drawn into.
    pub(super) fn is_spread(&self) -> bool {
        self.component == glow::BYTE && self.read_component == glow::FLOAT
    }

    /// Appends a pixel as it was read, of which all channels are there, as the format has it in memory.
    pub(super) fn pack(&self, pixel: &[u8], to: &mut Vec<u8>) {
        let own = self.bytes / self.channels;
        for channel in pixel
            .chunks_exact(self.read_channel_bytes)
            .take(self.channels)
        {
            let float = || f32::from_le_bytes([channel[0], channel[1], channel[2], channel[3]]);
            if self.component == glow::HALF_FLOAT {
                to.extend(half(float()).to_le_bytes());
            } else if self.is_spread() {
                let step = (float() * 127.0).round() as i8;
                to.extend(step.to_le_bytes());
            } else {
                // The lower bytes of an integer.
                to.extend(&channel[..own]);
            }
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
