//! What a runner is asked to do: one kernel in one language, with the inputs of all its cases.
//!
//! Runners are programs of their own, so that a driver that crashes takes nothing with it, and may
//! be written in any language: a job is one line of JSON, the inputs are a file of bytes, and so
//! are the results.
//!
//! - A runner starts by printing one line, its [`Driver`]: `{"ready": "name and versions of the device"}`.
//! - It reads a [`Job`] from each line of its standard input, and answers each with one line,
//!   a [`Reply`].
//! - [`Job::inputs`] holds the bytes that the arguments point into; of a texture they are packed,
//!   level by level, layer by layer, slice by slice, row by row, a texel's samples together.
//! - [`Job::results`] is written whole before the reply: for every case in order, for every slot
//!   that is written in order, its bytes. A buffer or texture has as many as its argument. What a
//!   vertex or fragment stage returns has `invocations` tightly packed values.

use std::path::PathBuf;

use hankel_dsl::native::Sampler;
use hankel_dsl::native::describe::TexelAccess;
use serde::{Deserialize, Serialize};

/// What a runner runs on, and what that does otherwise than others.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Driver {
    /// Its name and versions.
    #[serde(rename = "ready")]
    pub name: String,
    /// It flushes subnormal numbers.
    #[serde(default)]
    pub flushes: bool,
    /// Its samplers round products of weights ([`hankel_host::parity::intervals`]).
    #[serde(default)]
    pub rounds_products: bool,
}

/// A kernel to be run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Job {
    /// Its number, for the reply.
    pub id: u64,
    /// The kernel's name.
    pub kernel: String,
    /// The entry point's name in the code.
    pub entry_point: String,
    /// The stage.
    pub stage: Stage,
    /// The text, or the SPIR-V.
    pub code: PathBuf,
    /// The arguments, as `hankel_host::device::slots::slots` orders them.
    pub slots: Vec<Slot>,
    /// MSL: slot of the buffer with the sizes of others in bytes, one `u32` each.
    #[serde(default)]
    pub sizes_slot: Option<u32>,
    /// MSL: bindings whose sizes that buffer holds, in order.
    #[serde(default)]
    pub sized: Vec<u32>,
    /// The runs.
    pub cases: Vec<Case>,
    /// File with the bytes of the inputs.
    pub inputs: PathBuf,
    /// File to be written.
    pub results: PathBuf,
}

/// A pipeline stage.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", tag = "kind")]
pub enum Stage {
    /// A compute shader.
    Compute {
        /// Invocations of a workgroup.
        threads: [u32; 3],
    },
    /// A vertex shader, one invocation for each vertex: the results are what each of them returns.
    Vertex,
    /// A fragment shader: invocation `i` gets the `i`th value of each varying, not interpolated.
    Fragment,
}

/// An argument of a kernel.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Slot {
    /// The parameter's name.
    pub name: String,
    /// Number in descriptor set 0, if it is bound.
    pub binding: Option<u32>,
    /// Where it is bound in this language; none for what the kernel does not use.
    pub place: Option<Place>,
    /// What it is for.
    pub role: Role,
}

/// Where a binding is in a language: see `hankel_codegen::translate::Place`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Place {
    /// The variable's name in the text.
    pub name: Option<String>,
    /// What numbers it.
    pub class: String,
    /// The number.
    pub index: Option<u32>,
    /// GLSL: name of the block around a buffer.
    pub block: Option<String>,
    /// GLSL: bindings of the textures that this sampler has become one with.
    pub combined_with: Vec<u32>,
}

/// What an argument is for.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", tag = "kind")]
pub enum Role {
    /// A uniform buffer.
    Uniform,
    /// A storage buffer that is read.
    Read,
    /// A storage buffer of `u32` counters; written.
    Atomic,
    /// A storage buffer that is written.
    Write,
    /// A texture that is read.
    Texture {
        /// How it is seen, in WebGPU's words: `2d`, `cube-array`.
        view: String,
        /// Whether it holds depths.
        depth: bool,
        /// Whether it has several samples.
        multisampled: bool,
    },
    /// A sampler.
    Sampler,
    /// A texture of which any texel is read or written.
    StorageTexture {
        /// WebGPU's name of its format.
        format: String,
        /// How it is seen, in WebGPU's words: `2d`, `2d-array`, `3d`.
        view: String,
        /// WebGPU's word for what is done with its texels: `write-only`, `read-only`, `read-write`.
        access: String,
    },
    /// A vertex attribute, tightly packed.
    Attribute {
        /// Its location.
        location: u32,
        /// Its type.
        value: Value,
    },
    /// A value of each fragment, tightly packed.
    Varying {
        /// Its location.
        location: u32,
        /// Its type.
        value: Value,
    },
    /// The position that a vertex stage returns: four floats; written.
    Position,
    /// Another value that a vertex stage returns; written.
    Passed {
        /// Its location.
        location: u32,
        /// Its type.
        value: Value,
    },
    /// The clip distances that a vertex stage returns: 1 to 8 floats; written.
    ClipDistances {
        /// Their type.
        value: Value,
    },
    /// The depth that a fragment stage returns: one float from 0 to 1; written.
    Depth,
    /// A colour that a fragment stage returns; written.
    Target {
        /// Its location.
        location: u32,
        /// Its type.
        value: Value,
    },
    /// A second source of blending that a fragment stage returns; written.
    SecondSource {
        /// Its type.
        value: Value,
    },
}

impl Role {
    /// Whether the kernel writes it.
    #[must_use]
    pub fn is_written(&self) -> bool {
        match self {
            Self::Atomic
            | Self::Write
            | Self::Position
            | Self::Passed { .. }
            | Self::ClipDistances { .. }
            | Self::Depth
            | Self::Target { .. }
            | Self::SecondSource { .. } => true,
            Self::StorageTexture { access, .. } => access != TexelAccess::Read.word(),
            _ => false,
        }
    }
}

/// A scalar or vector of 32-bit components.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Value {
    /// Its components.
    pub scalar: Scalar,
    /// How many, 1 to 4.
    pub size: u32,
}

/// A 32-bit component.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Scalar {
    /// Float.
    F32,
    /// Unsigned.
    U32,
    /// Signed.
    I32,
}

/// One run.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Case {
    /// Invocations whose results count: vertices, fragments.
    pub invocations: u32,
    /// Compute: how many workgroups.
    pub groups: [u32; 3],
    /// One for each slot.
    pub args: Vec<Arg>,
}

/// What is given for a slot.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", tag = "kind")]
pub enum Arg {
    /// A buffer, or what each vertex or fragment has of its own.
    Bytes {
        /// Where its contents begin in the inputs.
        offset: u64,
        /// How many bytes.
        length: u64,
    },
    /// A texture: its texels are packed, level after level, in each layer after layer.
    Texture {
        /// WebGPU's name of its format.
        format: String,
        /// 1, 2 or 3.
        dimensions: u32,
        /// Texels of level 0 along each axis.
        size: [u32; 3],
        /// Mip levels.
        levels: u32,
        /// Layers; of a cube its six faces: +x, -x, +y, -y, +z, -z.
        layers: u32,
        /// 1 or 4.
        samples: u32,
        /// Where its texels begin in the inputs.
        offset: u64,
        /// How many bytes.
        length: u64,
    },
    /// A sampler, in WebGPU's words.
    Sampler(Sampler),
}

/// A runner's answer.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Reply {
    /// The job's number.
    pub id: u64,
    /// What went wrong; none if the results are there.
    #[serde(default)]
    pub error: Option<String>,
    /// How it went wrong.
    #[serde(default)]
    pub kind: Kind,
}

/// How a job can go wrong.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// Something refused the code or the inputs.
    #[default]
    Refused,
    /// The device lacks a feature that the code needs, and says so.
    Lacks,
    /// What the runner had started crashed.
    Crashed,
    /// What the runner had started gave no answer in time.
    TimedOut,
}
