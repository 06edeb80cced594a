//! All texel formats, in one table.

/// Calls a macro with the table: of each format its name here and in WebGPU, rust-gpu's for `Image!`, the value of a texel in
/// a shader, how many channels it has, and how a channel is stored (`native::channel`).
///
/// These are the formats of WebGPU's storage textures, but for `bgra8unorm`, which SPIR-V does not have. A format's number
/// is its place: new ones follow the others.
macro_rules! texel_formats {
    ($then:ident) => {
        $then! {
            /// One 32-bit float.
            R32Float "r32float" r32f f32 1 Float32;
            /// Four 32-bit floats.
            Rgba32Float "rgba32float" rgba32f Vec4 4 Float32;
            /// Four 16-bit floats.
            Rgba16Float "rgba16float" rgba16f Vec4 4 Float16;
            /// Four 16-bit numbers from 0 to 1.
            Rgba16Unorm "rgba16unorm" rgba16 Vec4 4 Unorm16;
            /// Four 8-bit numbers from 0 to 1.
            Rgba8Unorm "rgba8unorm" rgba8 Vec4 4 Unorm8;
            /// One 32-bit unsigned integer.
            R32Uint "r32uint" r32ui u32 1 Uint32;
            /// Four 32-bit unsigned integers.
            Rgba32Uint "rgba32uint" rgba32ui UVec4 4 Uint32;
            /// One 32-bit signed integer.
            R32Sint "r32sint" r32i i32 1 Sint32;
            /// Four 32-bit signed integers.
            Rgba32Sint "rgba32sint" rgba32i IVec4 4 Sint32;
            /// Two 32-bit unsigned integers.
            Rg32Uint "rg32uint" rg32ui UVec2 2 Uint32;
            /// Two 32-bit signed integers.
            Rg32Sint "rg32sint" rg32i IVec2 2 Sint32;
            /// Four 16-bit unsigned integers. What does not fit must not be written.
            Rgba16Uint "rgba16uint" rgba16ui UVec4 4 Uint16;
            /// Four 16-bit signed integers. What does not fit must not be written.
            Rgba16Sint "rgba16sint" rgba16i IVec4 4 Sint16;
            /// Four 8-bit unsigned integers. What does not fit must not be written.
            Rgba8Uint "rgba8uint" rgba8ui UVec4 4 Uint8;
            /// Four 8-bit signed integers. What does not fit must not be written.
            Rgba8Sint "rgba8sint" rgba8i IVec4 4 Sint8;
            /// Two 32-bit floats.
            Rg32Float "rg32float" rg32f Vec2 2 Float32;
            /// Two 16-bit floats.
            Rg16Float "rg16float" rg16f Vec2 2 Float16;
            /// One 16-bit float.
            R16Float "r16float" r16f f32 1 Float16;
            /// Two 16-bit numbers from 0 to 1.
            Rg16Unorm "rg16unorm" rg16 Vec2 2 Unorm16;
            /// One 16-bit number from 0 to 1.
            R16Unorm "r16unorm" r16 f32 1 Unorm16;
            /// Two 8-bit numbers from 0 to 1.
            Rg8Unorm "rg8unorm" rg8 Vec2 2 Unorm8;
            /// One 8-bit number from 0 to 1.
            R8Unorm "r8unorm" r8 f32 1 Unorm8;
            /// Four 16-bit numbers from -1 to 1.
            Rgba16Snorm "rgba16snorm" rgba16_snorm Vec4 4 Snorm16;
            /// Two 16-bit numbers from -1 to 1.
            Rg16Snorm "rg16snorm" rg16_snorm Vec2 2 Snorm16;
            /// One 16-bit number from -1 to 1.
            R16Snorm "r16snorm" r16_snorm f32 1 Snorm16;
            /// Four 8-bit numbers from -1 to 1.
            Rgba8Snorm "rgba8snorm" rgba8_snorm Vec4 4 Snorm8;
            /// Two 8-bit numbers from -1 to 1.
            Rg8Snorm "rg8snorm" rg8_snorm Vec2 2 Snorm8;
            /// One 8-bit number from -1 to 1.
            R8Snorm "r8snorm" r8_snorm f32 1 Snorm8;
            /// Two 16-bit unsigned integers. What does not fit must not be written.
            Rg16Uint "rg16uint" rg16ui UVec2 2 Uint16;
            /// One 16-bit unsigned integer. What does not fit must not be written.
            R16Uint "r16uint" r16ui u32 1 Uint16;
            /// Two 8-bit unsigned integers. What does not fit must not be written.
            Rg8Uint "rg8uint" rg8ui UVec2 2 Uint8;
            /// One 8-bit unsigned integer. What does not fit must not be written.
            R8Uint "r8uint" r8ui u32 1 Uint8;
            /// Two 16-bit signed integers. What does not fit must not be written.
            Rg16Sint "rg16sint" rg16i IVec2 2 Sint16;
            /// One 16-bit signed integer. What does not fit must not be written.
            R16Sint "r16sint" r16i i32 1 Sint16;
            /// Two 8-bit signed integers. What does not fit must not be written.
            Rg8Sint "rg8sint" rg8i IVec2 2 Sint8;
            /// One 8-bit signed integer. What does not fit must not be written.
            R8Sint "r8sint" r8i i32 1 Sint8;
            /// Three 10-bit numbers from 0 to 1, and one of 2 bits.
            Rgb10A2Unorm "rgb10a2unorm" rgb10_a2 Vec4 4 Unorm10And2;
            /// Three 10-bit unsigned integers, and one of 2 bits. What does not fit must not be written.
            Rgb10A2Uint "rgb10a2uint" rgb10_a2ui UVec4 4 Uint10And2;
            /// Two 11-bit and one 10-bit float without a sign, which end in 6 and 5 binary digits. What is negative becomes 0.
            Rg11B10Ufloat "rg11b10ufloat" r11f_g11f_b10f Vec3 3 Float11And10;
        }
    };
}
