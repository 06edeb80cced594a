//! The columns: ways to run a kernel.

use std::fmt;
use std::str::FromStr;

use hankel_codegen::Language;
use serde::{Deserialize, Serialize};

use crate::tools::{Status, Tool};

/// A way to run a kernel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Column {
    /// Natively, one invocation after the other: the reference.
    Native,
    /// Natively, on SIMD lanes and all cores.
    NativeSimd,
    /// SPIR-V handed to the Vulkan driver as it is.
    Spirv,
    /// SPIR-V through wgpu, where naga reads and writes it anew.
    SpirvNaga,
    /// WGSL through wgpu.
    Wgsl,
    /// SPIR-V on SwiftShader.
    SpirvSwiftshader,
    /// GLSL 4.50, compiled by glslang, on the Vulkan driver.
    Glsl,
    /// GLSL ES 3.10 on OpenGL ES.
    Essl310,
    /// GLSL ES 3.00 on OpenGL ES.
    Essl300,
    /// HLSL, compiled by DXC, on the Vulkan driver.
    HlslDxc,
    /// HLSL, compiled by glslang, on the Vulkan driver.
    HlslGlslang,
    /// MSL, compiled by clang++, on the processor.
    Msl,
    /// WGSL in Dawn for Node.js.
    WgslDawn,
    /// WGSL in a page of Chromium.
    WgslChromium,
}

impl Column {
    /// All of them, in the report's order.
    pub const ALL: [Self; 14] = [
        Self::Native,
        Self::NativeSimd,
        Self::Spirv,
        Self::SpirvNaga,
        Self::Wgsl,
        Self::SpirvSwiftshader,
        Self::Glsl,
        Self::Essl310,
        Self::Essl300,
        Self::HlslDxc,
        Self::HlslGlslang,
        Self::Msl,
        Self::WgslDawn,
        Self::WgslChromium,
    ];

    /// Those that take no other tool than a Vulkan driver, and no other language than what runs on it
    /// as it is: plain parity.
    pub const PLAIN: [Self; 5] = [
        Self::Native,
        Self::NativeSimd,
        Self::Spirv,
        Self::SpirvNaga,
        Self::Wgsl,
    ];

    /// The name on the command line and in files.
    #[must_use]
    pub const fn id(self) -> &'static str {
        match self {
            Self::Native => "native",
            Self::NativeSimd => "native-simd",
            Self::Spirv => "spirv",
            Self::SpirvNaga => "spirv-naga",
            Self::Wgsl => "wgsl",
            Self::SpirvSwiftshader => "spirv-swiftshader",
            Self::Glsl => "glsl",
            Self::Essl310 => "essl310",
            Self::Essl300 => "essl300",
            Self::HlslDxc => "hlsl-dxc",
            Self::HlslGlslang => "hlsl-glslang",
            Self::Msl => "msl",
            Self::WgslDawn => "wgsl-dawn",
            Self::WgslChromium => "wgsl-chromium",
        }
    }

    /// How a kernel is run.
    #[must_use]
    pub const fn how(self) -> &'static str {
        match self {
            Self::Native => "natively, scalar: the reference",
            Self::NativeSimd => "natively, on SIMD lanes and all cores",
            Self::Spirv => "SPIR-V, as it is, on Vulkan",
            Self::SpirvNaga => "SPIR-V through naga in wgpu, on Vulkan",
            Self::Wgsl => "WGSL through naga in wgpu, on Vulkan",
            Self::SpirvSwiftshader => "SPIR-V, as it is, on SwiftShader",
            Self::Glsl => "GLSL 4.50 through glslang, on Vulkan",
            Self::Essl310 => "GLSL ES 3.10 on OpenGL ES",
            Self::Essl300 => "GLSL ES 3.00 on OpenGL ES",
            Self::HlslDxc => "HLSL through DXC, on Vulkan",
            Self::HlslGlslang => "HLSL through glslang, on Vulkan",
            Self::Msl => "MSL through clang++, on the processor",
            Self::WgslDawn => "WGSL through Tint, in Dawn on SwiftShader",
            Self::WgslChromium => "WGSL in a page of headless Chromium, on SwiftShader",
        }
    }

    /// What is run; none natively.
    #[must_use]
    pub const fn language(self) -> Option<Language> {
        Some(match self {
            Self::Native | Self::NativeSimd => return None,
            Self::Spirv | Self::SpirvNaga | Self::SpirvSwiftshader => Language::Spirv,
            Self::Wgsl | Self::WgslDawn | Self::WgslChromium => Language::Wgsl,
            Self::Glsl => Language::Glsl,
            Self::Essl310 => Language::Essl310,
            Self::Essl300 => Language::Essl300,
            Self::HlslDxc | Self::HlslGlslang => Language::Hlsl,
            Self::Msl => Language::Msl,
        })
    }

    /// Whether its device flushes subnormal numbers, as all of SwiftShader's do.
    #[must_use]
    pub const fn flushes(self) -> bool {
        matches!(
            self,
            Self::SpirvSwiftshader | Self::WgslDawn | Self::WgslChromium
        )
    }

    /// Whether its device may flush subnormal numbers: [what does](Self::flushes), and Vulkan devices, which say so
    /// when they are opened.
    #[must_use]
    pub fn may_flush(self) -> bool {
        self.flushes() || self.tools().contains(&Tool::Vulkan)
    }

    /// What it takes.
    #[must_use]
    pub const fn tools(self) -> &'static [Tool] {
        match self {
            Self::Native | Self::NativeSimd => &[],
            Self::Spirv | Self::SpirvNaga | Self::Wgsl => &[Tool::Vulkan],
            Self::SpirvSwiftshader => &[Tool::SwiftShader],
            Self::Glsl | Self::HlslGlslang => &[Tool::Glslang, Tool::Vulkan],
            Self::Essl310 | Self::Essl300 => &[Tool::Egl],
            Self::HlslDxc => &[Tool::Dxc, Tool::Vulkan],
            Self::Msl => &[Tool::Clang],
            Self::WgslDawn => &[Tool::Node, Tool::Dawn, Tool::SwiftShader],
            Self::WgslChromium => &[Tool::Node, Tool::Chromium, Tool::SwiftShader],
        }
    }

    /// Those of `all` that it takes.
    pub(crate) fn statuses(self, all: &[Status]) -> impl Iterator<Item = &Status> {
        all.iter()
            .filter(move |status| self.tools().contains(&status.tool))
    }
}

impl fmt::Display for Column {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.id())
    }
}

impl FromStr for Column {
    type Err = String;

    fn from_str(name: &str) -> Result<Self, String> {
        Self::ALL
            .into_iter()
            .find(|c| c.id() == name)
            .ok_or_else(|| {
                let known: Vec<&str> = Self::ALL.iter().map(|c| c.id()).collect();
                format!("`{name}` is not a column; there are {}", known.join(", "))
            })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_read_back_and_are_the_ones_in_files() {
        for column in Column::ALL {
            assert_eq!(column.id().parse::<Column>(), Ok(column));
            let json = serde_json::to_string(&column).unwrap();
            assert_eq!(json, format!("\"{}\"", column.id()));
        }
        let error = "metal".parse::<Column>().unwrap_err();
        assert!(error.contains("msl"), "{error}");
    }
}
