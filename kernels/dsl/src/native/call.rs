//! A call of a kernel on the host's own processor: untyped arguments in the order of the
//! kernel's description, and how to run it.

use std::string::String;
use std::vec::Vec;

use serde::{Deserialize, Serialize};

use super::describe::TexelFormat;
use super::sanitize::Order;

/// An argument: first those of the parameters that are bound to something, in their order
/// (constants, built-ins and workgroup memory take none), then one for each output.
///
/// Byte slices must be aligned to the layout's alignment; 16 always is.
#[derive(Debug)]
pub enum Arg<'a> {
    /// Uniform value, read-only buffer, vertex attributes or varyings.
    Bytes(&'a [u8]),
    /// What is written.
    BytesMut(&'a mut [u8]),
    /// A texture that is read.
    Texture(TextureRef<'a>),
    /// A texture that is written.
    TextureMut(TextureMut<'a>),
    /// A sampler.
    Sampler(Sampler),
}

/// A texture in memory: level after level, in each layer after layer, in each slice after slice and
/// row after row, each texel's samples together; no padding.
#[derive(Clone, Copy, Debug)]
pub struct TextureRef<'a> {
    /// Width, height, depth of level 0 in texels; 1 for a dimension that is not there.
    pub size: [u32; 3],
    /// Mip levels, 1 or more. Each has half the size of the one before, rounded down, but at
    /// least 1.
    pub levels: u32,
    /// Layers of an array, 1 for what is none. The faces of a cube are six layers: +x, -x, +y, -y,
    /// +z, -z.
    pub layers: u32,
    /// Samples of a texel, 1 unless multisampled.
    pub samples: u32,
    /// Format of the texels; a depth is [`TexelFormat::R32Float`].
    pub format: TexelFormat,
    /// Which of the textures it is that a kernel reads. A call numbers them, whatever this was.
    pub number: u8,
    /// As many as [`texture_bytes`] says.
    pub bytes: &'a [u8],
}

/// Texels along each axis of a mip level.
#[must_use]
pub fn level_size(size: [u32; 3], level: u32) -> [u32; 3] {
    size.map(|n| n.checked_shr(level).unwrap_or(0).max(1))
}

/// Bytes of a texture's levels before `levels`, which are all of them where it is their number. The
/// largest number there is, if they are more.
#[must_use]
pub fn texture_bytes(
    size: [u32; 3],
    levels: u32,
    layers: u32,
    samples: u32,
    format: TexelFormat,
) -> usize {
    (0..levels).fold(0, |sum: usize, level| {
        let level = level_size(size, level)
            .into_iter()
            .chain([layers, samples])
            .fold(format.bytes(), |n, s| n.saturating_mul(s as usize));
        sum.saturating_add(level)
    })
}

/// As [`TextureRef`], to be written; one level, one sample.
#[derive(Debug)]
pub struct TextureMut<'a> {
    /// Width, height, depth in texels; of an array, its layers in place of the depth.
    pub size: [u32; 3],
    /// Format of the texels; the kernel's own.
    pub format: TexelFormat,
    /// `size[0] * size[1] * size[2] * format.bytes()` bytes.
    pub bytes: &'a mut [u8],
}

/// A sampler. There are no border colours: WebGPU has none.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct Sampler {
    /// Between texels, where the level of detail is 0 or less.
    pub magnify: Filter,
    /// Between texels, where it is more.
    pub minify: Filter,
    /// Between mip levels.
    pub mip: Filter,
    /// Beyond the edge along u, v, w.
    pub address: [Address; 3],
    /// How a comparison sampler compares.
    pub compare: Option<Compare>,
    /// Most samples along the longer axis of a pixel's footprint, 1 to 16. A hint: WebGPU and Vulkan
    /// leave it to the implementation which samples it takes, and more than 1 goes with linear
    /// filters only. The native device takes one.
    pub anisotropy: u16,
    /// Natively: how it departs from what the specification computes. Other devices ignore it.
    pub deviation: Deviation,
}

impl Sampler {
    /// The same filter between texels and between levels, the same address mode in all directions,
    /// no comparison.
    #[must_use]
    pub const fn new(filter: Filter, address: Address) -> Self {
        Self {
            magnify: filter,
            minify: filter,
            mip: filter,
            address: [address; 3],
            compare: None,
            anisotropy: 1,
            deviation: Deviation::NONE,
        }
    }

    /// Whether any filter interpolates.
    #[must_use]
    pub fn is_filtering(&self) -> bool {
        [self.magnify, self.minify, self.mip].contains(&Filter::Linear)
    }
}

/// What a device may do with the numbers of a sampler, to find out natively what follows from it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct Deviation {
    /// The levels of a texture for which `offset` and `twist` are.
    pub levels: Levels,
    /// How far a coordinate is moved along each axis, in 1/1024 of a texel: rounding of the weights.
    pub offset: [i16; 3],
    /// How far the level of detail is moved, in 1/1024 of a level: rounding of its fraction.
    pub level: i16,
    /// How far the product of the weights along both axes is moved, in 1/1024, while the sums of weights along either
    /// stay: rounding of the weights of four texels.
    pub twist: i8,
    /// What is added to each channel, in 2^-24 of the largest magnitude that is read: rounding of
    /// the filter's sums.
    pub channels: [i8; 4],
    /// The texture that `channels` are for, by its number.
    pub texture: u8,
}

impl Deviation {
    /// As the specification computes.
    pub const NONE: Self = Self {
        levels: Levels::All,
        offset: [0; 3],
        level: 0,
        twist: 0,
        channels: [0; 4],
        texture: 0,
    };
}

/// Some levels of a texture. Of two neighbours one is even, the other odd.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[repr(u8)]
pub enum Levels {
    /// All of them.
    #[default]
    All,
    /// Those of even number.
    Even,
    /// Those of odd number.
    Odd,
}

impl Levels {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::All, Self::Even, Self::Odd];

    /// Whether a level is one of these.
    #[must_use]
    pub const fn has(self, level: u32) -> bool {
        match self {
            Self::All => true,
            Self::Even => level.is_multiple_of(2),
            Self::Odd => !level.is_multiple_of(2),
        }
    }
}

/// What a sampler does between texels or levels. Names are WebGPU's.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[repr(u32)]
pub enum Filter {
    /// The nearest one.
    Nearest,
    /// Linear interpolation of the nearest ones.
    Linear,
}

/// What a sampler does beyond the texture's edge. Names are WebGPU's.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[repr(u32)]
pub enum Address {
    /// The texel at the edge.
    ClampToEdge,
    /// The texture again.
    Repeat,
    /// The texture again, every other time mirrored.
    MirrorRepeat,
}

/// How a comparison sampler compares the reference, which stands first, with a texel. Names are
/// WebGPU's.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[repr(u32)]
pub enum Compare {
    /// Never true.
    Never,
    /// `<`
    Less,
    /// `==`
    Equal,
    /// `<=`
    LessEqual,
    /// `>`
    Greater,
    /// `!=`
    NotEqual,
    /// `>=`
    GreaterEqual,
    /// Always true.
    Always,
}

impl Filter {
    /// Both.
    pub const ALL: [Self; 2] = [Self::Nearest, Self::Linear];
}

impl Address {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::ClampToEdge, Self::Repeat, Self::MirrorRepeat];
}

impl Compare {
    /// All of them.
    pub const ALL: [Self; 8] = [
        Self::Never,
        Self::Less,
        Self::Equal,
        Self::LessEqual,
        Self::Greater,
        Self::NotEqual,
        Self::GreaterEqual,
        Self::Always,
    ];

    /// Whether it holds.
    #[inline]
    #[must_use]
    pub fn holds(self, reference: f32, texel: f32) -> bool {
        match self {
            Self::Never => false,
            Self::Less => reference < texel,
            Self::Equal => reference == texel,
            Self::LessEqual => reference <= texel,
            Self::Greater => reference > texel,
            Self::NotEqual => reference != texel,
            Self::GreaterEqual => reference >= texel,
            Self::Always => true,
        }
    }
}

/// How a call is run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Mode {
    /// Run a map over SIMD lanes where its source allows it. The lanes do not fuse: results are
    /// those of the scalar run, bit for bit.
    pub lanes: bool,
    /// Use all cores (rayon's global pool).
    pub parallel: bool,
    /// Look at every access to memory that is written, with the invocations in this order
    /// ([`sanitize`](super::sanitize)): one thread, no lanes, whatever else is said.
    pub sanitize: Option<Order>,
    /// Invocations of a subgroup, one of [`SUBGROUP_SIZES`]; for kernels that have
    /// [`subgroups`](super::describe::Subgroups).
    pub subgroup_size: u32,
}

/// The sizes that subgroups can have natively.
pub const SUBGROUP_SIZES: [u32; 5] = [4, 8, 16, 32, 64];

/// The size that they have unless something else is said: that of most GPUs.
pub const SUBGROUP_SIZE: u32 = 32;

impl Default for Mode {
    fn default() -> Self {
        Self {
            lanes: true,
            parallel: true,
            sanitize: None,
            subgroup_size: SUBGROUP_SIZE,
        }
    }
}

impl Mode {
    /// One thread, no lanes: what every other way to run a kernel is compared with.
    pub const REFERENCE: Self = Self {
        lanes: false,
        parallel: false,
        sanitize: None,
        subgroup_size: SUBGROUP_SIZE,
    };

    /// One thread, with every access looked at.
    #[must_use]
    pub const fn sanitized(order: Order) -> Self {
        Self {
            sanitize: Some(order),
            ..Self::REFERENCE
        }
    }

    /// The same with every access looked at: in ascending order if none is said.
    #[must_use]
    pub const fn looked_at(self) -> Self {
        Self {
            sanitize: match self.sanitize {
                None => Some(Order::Ascending),
                said => said,
            },
            ..self
        }
    }

    /// The same with subgroups of another size.
    #[must_use]
    pub const fn in_subgroups_of(self, subgroup_size: u32) -> Self {
        Self {
            subgroup_size,
            ..self
        }
    }
}

/// A call.
#[derive(Debug)]
pub struct Call<'a> {
    /// Arguments, see [`Arg`].
    pub args: Vec<Arg<'a>>,
    /// Values of the specialisation constants in the order of the parameters; as many as the
    /// kernel has.
    pub constants: Vec<u32>,
    /// How to run it.
    pub mode: Mode,
}

/// Why a call did not run.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum CallError {
    /// Too few or too many arguments.
    #[error("{expected} arguments are expected, {got} were given")]
    Count {
        /// Number that the description asks for.
        expected: usize,
        /// Number given.
        got: usize,
    },
    /// An argument of the wrong kind.
    #[error("argument `{name}` must be {expected}")]
    Kind {
        /// The parameter's name.
        name: &'static str,
        /// What it must be.
        expected: &'static str,
    },
    /// A buffer whose size or alignment does not fit its type.
    #[error(
        "argument `{name}`: {bytes} bytes at this address are no whole number of aligned elements of {size} bytes"
    )]
    Size {
        /// The parameter's name.
        name: &'static str,
        /// Its bytes.
        bytes: usize,
        /// Size of an element.
        size: usize,
    },
    /// Element buffers of different lengths.
    #[error(
        "argument `{name}` has {got} elements, but {expected} invocations run: give each element buffer as many elements as the output"
    )]
    Length {
        /// The parameter's name.
        name: &'static str,
        /// Invocations.
        expected: usize,
        /// Elements.
        got: usize,
    },
    /// Subgroups of a size that there is not.
    #[error("subgroups have 4, 8, 16, 32 or 64 invocations, not {size}")]
    Subgroups {
        /// The size.
        size: u32,
    },
    /// More invocations than 32 bits can count.
    #[error("{} x {} x {} invocations are more than 32 bits can count", extent[0], extent[1], extent[2])]
    Range {
        /// Along each axis.
        extent: [u32; 3],
    },
    /// A texture of another format than the kernel's, or bytes that do not fit its size.
    #[error("argument `{name}`: {problem}")]
    Texture {
        /// The parameter's name.
        name: &'static str,
        /// What does not fit.
        problem: String,
    },
    /// The plug-in was built for other entry points, or for descriptions alone.
    #[error("its native code was not built: ask for the kernel when its crate is loaded")]
    NotBuilt,
    /// What a plug-in reported.
    #[error("{message}")]
    Plugin {
        /// Its words.
        message: String,
    },
    /// The process that the kernel ran in ended before the call did.
    #[error("its process {how}{}", culprit.as_ref().map_or_else(String::new, |c| std::format!(", {c}")))]
    Ended {
        /// How.
        how: Ending,
        /// The element that is enough for that, if one is.
        culprit: Option<Culprit>,
    },
    /// The kernel itself panicked: an index out of range, most likely.
    #[error("the kernel panicked: {message}")]
    Panic {
        /// The panic's message.
        message: String,
    },
}

/// How a process ended that ran a kernel.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Ending {
    /// It was ended after its time.
    #[error("was ended after {seconds} s: does a loop never end?")]
    TimedOut {
        /// The limit.
        seconds: u64,
    },
    /// It ran out of stack.
    #[error("overflowed its stack of {mebibytes} MiB")]
    Stack {
        /// The limit.
        mebibytes: u32,
    },
    /// It crashed.
    #[error("{how}")]
    Crashed {
        /// Its exit code or signal, and what it said last.
        how: String,
    },
}

/// An element of a map that ends the process by itself.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("at element {element} (counted from 0): {inputs}")]
pub struct Culprit {
    /// Which, counted from 0.
    pub element: usize,
    /// The values of its inputs: `depth = 0.5, moments.b1 = 0.25`.
    pub inputs: String,
}

/// Runs a kernel natively.
pub type Run = fn(&mut Call<'_>) -> Result<(), CallError>;
