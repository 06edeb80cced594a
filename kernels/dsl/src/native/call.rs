//! A call of a kernel on the host's own processor: untyped arguments in the order of the
//! kernel's description, and how to run it.

use std::string::String;
use std::vec::Vec;

use super::describe::TexelFormat;

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

/// A texture in memory: texels row by row, slice by slice, each texel's samples together; no
/// padding.
#[derive(Clone, Copy, Debug)]
pub struct TextureRef<'a> {
    /// Width, height, depth in texels; 1 for a dimension that is not there.
    pub size: [u32; 3],
    /// Samples of a texel, 1 unless multisampled.
    pub samples: u32,
    /// Format of the texels.
    pub format: TexelFormat,
    /// `size[0] * size[1] * size[2] * samples * format.bytes()` bytes.
    pub bytes: &'a [u8],
}

/// As [`TextureRef`], to be written; one sample.
#[derive(Debug)]
pub struct TextureMut<'a> {
    /// Width, height, depth in texels.
    pub size: [u32; 3],
    /// Format of the texels; the kernel's own.
    pub format: TexelFormat,
    /// `size[0] * size[1] * size[2] * format.bytes()` bytes.
    pub bytes: &'a mut [u8],
}

/// A sampler.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Sampler {
    /// Between texels.
    pub filter: Filter,
    /// Beyond the edge.
    pub address: Address,
    /// Natively: how it departs from what the specification computes. Other devices ignore it.
    pub deviation: Deviation,
}

impl Sampler {
    /// One that is linear between texels or takes the nearest, and repeats the texture beyond its edge
    /// or the edge.
    #[must_use]
    pub const fn new(linear: bool, repeat: bool) -> Self {
        Self {
            filter: if linear {
                Filter::Linear
            } else {
                Filter::Nearest
            },
            address: if repeat {
                Address::Repeat
            } else {
                Address::ClampToEdge
            },
            deviation: Deviation::NONE,
        }
    }
}

/// What a device may do with the numbers of a sampler, to find out natively what follows from it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Deviation {
    /// How far a coordinate is moved along each axis, in 1/1024 of a texel: rounding of the weights.
    pub offset: [i16; 3],
    /// What is added to each channel, in 2^-24 of the largest magnitude that is read: rounding of
    /// the filter's sums.
    pub channels: [i8; 4],
}

impl Deviation {
    /// As the specification computes.
    pub const NONE: Self = Self {
        offset: [0; 3],
        channels: [0; 4],
    };
}

/// What a sampler does between texels.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u32)]
pub enum Filter {
    /// The nearest texel.
    Nearest,
    /// Linear interpolation of the nearest texels.
    Linear,
}

/// What a sampler does beyond the texture's edge.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u32)]
pub enum Address {
    /// The texel at the edge.
    ClampToEdge,
    /// The texture again.
    Repeat,
}

/// How a call is run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Mode {
    /// Run a map over SIMD lanes where its source allows it. The lanes do not fuse: results are
    /// those of the scalar run, bit for bit.
    pub lanes: bool,
    /// Use all cores (rayon's global pool).
    pub parallel: bool,
}

impl Default for Mode {
    fn default() -> Self {
        Self {
            lanes: true,
            parallel: true,
        }
    }
}

impl Mode {
    /// One thread, no lanes: what every other way to run a kernel is compared with.
    pub const REFERENCE: Self = Self {
        lanes: false,
        parallel: false,
    };
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
