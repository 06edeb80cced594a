//! The languages that are written.

use std::fmt;
use std::str::FromStr;

use hankel_dsl::native::describe::Stage;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::{Error, Result};

/// A language that is written.
#[derive(
    Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, JsonSchema,
)]
#[serde(rename_all = "lowercase")]
pub enum Language {
    /// SPIR-V 1.5 for Vulkan 1.2: validated, optimised.
    Spirv,
    /// WebGPU's language.
    Wgsl,
    /// Direct3D's; the shader model is an option.
    Hlsl,
    /// Metal's; the version is an option.
    Msl,
    /// GLSL 4.50.
    Glsl,
    /// GLSL ES 3.10.
    Essl310,
    /// GLSL ES 3.00 (WebGL 2): vertex and fragment stages only.
    Essl300,
}

impl Language {
    /// All, in the order of the manifest.
    pub const ALL: [Self; 7] = [
        Self::Spirv,
        Self::Wgsl,
        Self::Hlsl,
        Self::Msl,
        Self::Glsl,
        Self::Essl310,
        Self::Essl300,
    ];

    /// The name on the command line, in the manifest and of the output's folder.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Spirv => "spirv",
            Self::Wgsl => "wgsl",
            Self::Hlsl => "hlsl",
            Self::Msl => "msl",
            Self::Glsl => "glsl",
            Self::Essl310 => "essl310",
            Self::Essl300 => "essl300",
        }
    }

    /// The file's extension; GLSL tools tell the stage by it.
    pub fn extension(self, stage: &Stage) -> &'static str {
        match (self, stage) {
            (Self::Spirv, _) => "spv",
            (Self::Wgsl, _) => "wgsl",
            (Self::Hlsl, _) => "hlsl",
            (Self::Msl, _) => "metal",
            (_, Stage::Compute { .. }) => "comp",
            (_, Stage::Vertex) => "vert",
            (_, Stage::Fragment) => "frag",
        }
    }
}

impl fmt::Display for Language {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Spirv => "SPIR-V",
            Self::Wgsl => "WGSL",
            Self::Hlsl => "HLSL",
            Self::Msl => "MSL",
            Self::Glsl => "GLSL",
            Self::Essl310 => "GLSL ES 3.10",
            Self::Essl300 => "GLSL ES 3.00",
        })
    }
}

impl FromStr for Language {
    type Err = Error;

    fn from_str(name: &str) -> Result<Self> {
        let wanted = name.to_ascii_lowercase();
        Self::ALL
            .into_iter()
            .find(|language| language.name() == wanted)
            .ok_or_else(|| Error::UnknownTarget {
                name: name.into(),
                known: Self::ALL
                    .iter()
                    .map(|language| language.name().into())
                    .collect(),
            })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_read_back() {
        for language in Language::ALL {
            assert_eq!(language.name().parse::<Language>().unwrap(), language);
            let json = serde_json::to_string(&language).unwrap();
            assert_eq!(json, format!("\"{}\"", language.name()));
        }
        assert!(
            "cuda"
                .parse::<Language>()
                .unwrap_err()
                .to_string()
                .contains("spirv, wgsl")
        );
    }
}
