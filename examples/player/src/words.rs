//! WebGPU's words, which `frame.json` has, as wgpu's values; and what texels of a picture mean.

use serde_json::Value;

use crate::Result;

/// What texels are, and their size in bytes.
#[derive(Clone, Copy)]
pub struct Texel {
    pub format: wgpu::TextureFormat,
    pub bytes: u32,
}

/// Makes a function from words to values of a type.
macro_rules! words {
    ($(fn $name:ident() -> $ty:ty { $($word:literal => $value:expr,)* })*) => { $(
        pub fn $name(word: &str) -> Result<$ty> {
            match word {
                $($word => Ok($value),)*
                other => Err(format!(
                    "frame.json: `{other}` is not one of {}",
                    [$($word),*].join(", ")
                )),
            }
        }
    )* };
}

words! {
    fn format() -> (wgpu::TextureFormat, u32) {
        "depth32float" => (wgpu::TextureFormat::Depth32Float, 4),
        "r32float" => (wgpu::TextureFormat::R32Float, 4),
        "r32sint" => (wgpu::TextureFormat::R32Sint, 4),
        "r32uint" => (wgpu::TextureFormat::R32Uint, 4),
        "rg32float" => (wgpu::TextureFormat::Rg32Float, 8),
        "rg32sint" => (wgpu::TextureFormat::Rg32Sint, 8),
        "rg32uint" => (wgpu::TextureFormat::Rg32Uint, 8),
        "rgba32float" => (wgpu::TextureFormat::Rgba32Float, 16),
        "rgba32sint" => (wgpu::TextureFormat::Rgba32Sint, 16),
        "rgba32uint" => (wgpu::TextureFormat::Rgba32Uint, 16),
        "r16float" => (wgpu::TextureFormat::R16Float, 2),
        "r16sint" => (wgpu::TextureFormat::R16Sint, 2),
        "r16snorm" => (wgpu::TextureFormat::R16Snorm, 2),
        "r16uint" => (wgpu::TextureFormat::R16Uint, 2),
        "r16unorm" => (wgpu::TextureFormat::R16Unorm, 2),
        "rg16float" => (wgpu::TextureFormat::Rg16Float, 4),
        "rg16sint" => (wgpu::TextureFormat::Rg16Sint, 4),
        "rg16snorm" => (wgpu::TextureFormat::Rg16Snorm, 4),
        "rg16uint" => (wgpu::TextureFormat::Rg16Uint, 4),
        "rg16unorm" => (wgpu::TextureFormat::Rg16Unorm, 4),
        "rgba16float" => (wgpu::TextureFormat::Rgba16Float, 8),
        "rgba16sint" => (wgpu::TextureFormat::Rgba16Sint, 8),
        "rgba16snorm" => (wgpu::TextureFormat::Rgba16Snorm, 8),
        "rgba16uint" => (wgpu::TextureFormat::Rgba16Uint, 8),
        "rgba16unorm" => (wgpu::TextureFormat::Rgba16Unorm, 8),
        "r8sint" => (wgpu::TextureFormat::R8Sint, 1),
        "r8snorm" => (wgpu::TextureFormat::R8Snorm, 1),
        "r8uint" => (wgpu::TextureFormat::R8Uint, 1),
        "r8unorm" => (wgpu::TextureFormat::R8Unorm, 1),
        "rg8sint" => (wgpu::TextureFormat::Rg8Sint, 2),
        "rg8snorm" => (wgpu::TextureFormat::Rg8Snorm, 2),
        "rg8uint" => (wgpu::TextureFormat::Rg8Uint, 2),
        "rg8unorm" => (wgpu::TextureFormat::Rg8Unorm, 2),
        "rgba8sint" => (wgpu::TextureFormat::Rgba8Sint, 4),
        "rgba8snorm" => (wgpu::TextureFormat::Rgba8Snorm, 4),
        "rgba8uint" => (wgpu::TextureFormat::Rgba8Uint, 4),
        "rgba8unorm" => (wgpu::TextureFormat::Rgba8Unorm, 4),
    }
    fn filter() -> wgpu::FilterMode {
        "nearest" => wgpu::FilterMode::Nearest,
        "linear" => wgpu::FilterMode::Linear,
    }
    fn mipmap_filter() -> wgpu::MipmapFilterMode {
        "nearest" => wgpu::MipmapFilterMode::Nearest,
        "linear" => wgpu::MipmapFilterMode::Linear,
    }
    fn address() -> wgpu::AddressMode {
        "clamp-to-edge" => wgpu::AddressMode::ClampToEdge,
        "repeat" => wgpu::AddressMode::Repeat,
        "mirror-repeat" => wgpu::AddressMode::MirrorRepeat,
    }
    fn compare() -> wgpu::CompareFunction {
        "never" => wgpu::CompareFunction::Never,
        "less" => wgpu::CompareFunction::Less,
        "equal" => wgpu::CompareFunction::Equal,
        "less-equal" => wgpu::CompareFunction::LessEqual,
        "greater" => wgpu::CompareFunction::Greater,
        "not-equal" => wgpu::CompareFunction::NotEqual,
        "greater-equal" => wgpu::CompareFunction::GreaterEqual,
        "always" => wgpu::CompareFunction::Always,
    }
    fn topology() -> wgpu::PrimitiveTopology {
        "triangle-list" => wgpu::PrimitiveTopology::TriangleList,
        "point-list" => wgpu::PrimitiveTopology::PointList,
    }
    fn cull_mode() -> Option<wgpu::Face> {
        "none" => None,
        "front" => Some(wgpu::Face::Front),
        "back" => Some(wgpu::Face::Back),
    }
    fn blend_operation() -> wgpu::BlendOperation {
        "add" => wgpu::BlendOperation::Add,
        "min" => wgpu::BlendOperation::Min,
    }
    fn blend_factor() -> wgpu::BlendFactor {
        "zero" => wgpu::BlendFactor::Zero,
        "one" => wgpu::BlendFactor::One,
        "src" => wgpu::BlendFactor::Src,
        "src-alpha" => wgpu::BlendFactor::SrcAlpha,
        "one-minus-src-alpha" => wgpu::BlendFactor::OneMinusSrcAlpha,
    }
    fn vertex_format() -> wgpu::VertexFormat {
        "float32" => wgpu::VertexFormat::Float32,
        "float32x2" => wgpu::VertexFormat::Float32x2,
        "float32x3" => wgpu::VertexFormat::Float32x3,
        "float32x4" => wgpu::VertexFormat::Float32x4,
        "uint32" => wgpu::VertexFormat::Uint32,
        "uint32x2" => wgpu::VertexFormat::Uint32x2,
        "uint32x3" => wgpu::VertexFormat::Uint32x3,
        "uint32x4" => wgpu::VertexFormat::Uint32x4,
        "sint32" => wgpu::VertexFormat::Sint32,
        "sint32x2" => wgpu::VertexFormat::Sint32x2,
        "sint32x3" => wgpu::VertexFormat::Sint32x3,
        "sint32x4" => wgpu::VertexFormat::Sint32x4,
    }
    fn view_dimension() -> wgpu::TextureViewDimension {
        "1d" => wgpu::TextureViewDimension::D1,
        "2d" => wgpu::TextureViewDimension::D2,
        "2d-array" => wgpu::TextureViewDimension::D2Array,
        "3d" => wgpu::TextureViewDimension::D3,
        "cube" => wgpu::TextureViewDimension::Cube,
        "cube-array" => wgpu::TextureViewDimension::CubeArray,
    }
    fn buffer_usage() -> wgpu::BufferUsages {
        "index" => wgpu::BufferUsages::INDEX,
        "storage" => wgpu::BufferUsages::STORAGE,
        "uniform" => wgpu::BufferUsages::UNIFORM,
        "vertex" => wgpu::BufferUsages::VERTEX,
    }
    fn texture_usage() -> wgpu::TextureUsages {
        "copy-destination" => wgpu::TextureUsages::COPY_DST,
        "copy-source" => wgpu::TextureUsages::COPY_SRC,
        "render-attachment" => wgpu::TextureUsages::RENDER_ATTACHMENT,
        "storage-binding" => wgpu::TextureUsages::STORAGE_BINDING,
        "texture-binding" => wgpu::TextureUsages::TEXTURE_BINDING,
    }
}

/// How colours are put together.
pub fn blend(value: &Value) -> Result<wgpu::BlendState> {
    let component = |name: &str| {
        let word = |part: &str| value[name][part].as_str().unwrap_or_default();
        Ok::<_, String>(wgpu::BlendComponent {
            operation: blend_operation(word("operation"))?,
            src_factor: blend_factor(word("src_factor"))?,
            dst_factor: blend_factor(word("dst_factor"))?,
        })
    };
    Ok(wgpu::BlendState {
        color: component("color")?,
        alpha: component("alpha")?,
    })
}

pub fn texel(word: &str) -> Result<Texel> {
    format(word).map(|(format, bytes)| Texel { format, bytes })
}

/// What a buffer is used as; the player writes to all.
pub fn buffer_usages(words: &[Value]) -> Result<wgpu::BufferUsages> {
    words
        .iter()
        .try_fold(wgpu::BufferUsages::COPY_DST, |all, word| {
            Ok(all | buffer_usage(word.as_str().unwrap_or_default())?)
        })
}

/// What a texture is used as.
pub fn texture_usages(words: &[Value]) -> Result<wgpu::TextureUsages> {
    words
        .iter()
        .try_fold(wgpu::TextureUsages::empty(), |all, word| {
            Ok(all | texture_usage(word.as_str().unwrap_or_default())?)
        })
}

/// Red, green and blue of a texel, linear.
pub fn linear(format: wgpu::TextureFormat, texel: &[u8]) -> Option<[f32; 3]> {
    let half = |i: usize| from_half(u16::from_le_bytes([texel[2 * i], texel[2 * i + 1]]));
    let single = |i: usize| {
        texel[4 * i..]
            .first_chunk()
            .map_or(0.0, |it| f32::from_le_bytes(*it))
    };
    match format {
        wgpu::TextureFormat::Rgba16Float => Some([0, 1, 2].map(half)),
        wgpu::TextureFormat::Rgba32Float => Some([0, 1, 2].map(single)),
        wgpu::TextureFormat::Rgba8Unorm => Some([0, 1, 2].map(|i| f32::from(texel[i]) / 255.0)),
        _ => None,
    }
}

/// A 16-bit float (IEEE 754 binary16).
fn from_half(bits: u16) -> f32 {
    let sign = if bits >> 15 == 1 { -1.0 } else { 1.0 };
    let fraction = f32::from(bits & 0x3ff) / 1024.0;
    sign * match bits >> 10 & 0x1f {
        0 => fraction * 2.0_f32.powi(-14),
        31 if fraction == 0.0 => f32::INFINITY,
        31 => f32::NAN,
        exponent => (1.0 + fraction) * 2.0_f32.powi(i32::from(exponent) - 15),
    }
}

/// sRGB's transfer function (IEC 61966-2-1), to 8 bits.
pub fn srgb(linear: f32) -> u8 {
    let x = linear.clamp(0.0, 1.0);
    let y = if x <= 0.003_130_8 {
        12.92 * x
    } else {
        1.055 * x.powf(1.0 / 2.4) - 0.055
    };
    (y * 255.0).round() as u8
}
