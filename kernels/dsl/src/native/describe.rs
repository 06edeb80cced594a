//! What a kernel is, without its code: the one record from which codegen writes the manifest, the
//! host allocates and binds, and the command line prints. `#[kernel]` fills it in from the
//! function's signature; nothing in it is written by hand.

use std::boxed::Box;
use std::string::String;
use std::vec::Vec;

use serde::{Deserialize, Serialize};

use super::call::{Address, Compare, Filter};

/// One entry point.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Kernel {
    /// The entry point's name in SPIR-V: the function's name, with the precision (`_f64`) or the
    /// output's texel format (`_rgba16unorm`) appended where one function makes several. The fragment
    /// form of an image pass ends in `_fragment`.
    pub name: String,
    /// The name of the Rust function.
    pub function: String,
    /// The first paragraph of the function's documentation.
    pub summary: String,
    /// Where the function stands: file as the compiler saw it.
    pub file: String,
    /// Line of the attribute, from 1.
    pub line: u32,
    /// The licence of the function's crate, as SPDX writes it; empty if its Cargo.toml says none.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub licence: String,
    /// The pipeline stage, with what only that stage has.
    pub stage: Stage,
    /// The floating-point type of a function that is generic over `Real`; `None` for one that is
    /// written for `f32` as it stands.
    pub precision: Option<Precision>,
    /// The function's parameters, in order.
    pub params: Vec<Param>,
    /// What the function returns, in order; empty for a kernel that only writes to its parameters.
    pub outputs: Vec<Output>,
    /// How closely every backend must agree with the native scalar run.
    pub tolerance: Tolerance,
    /// What compilers and drivers may do with its floating-point arithmetic.
    #[serde(default)]
    pub rounding: Rounding,
    /// What it does with subgroups.
    #[serde(default, skip_serializing_if = "Subgroups::is_unused")]
    pub subgroups: Subgroups,
    /// The function of the kernel that computes the same, from the same parameters, in about twice the digits.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub compensated: Option<String>,
    /// Of an image pass with two forms: what its other form is.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub image_pass: Option<ImagePass>,
    /// Another vertex kernel that computes the position from the same numbers in the same way gives the same bits.
    #[serde(default, skip_serializing_if = "core::ops::Not::not")]
    pub invariant: bool,
}

/// A text of a description. A call, not inlined: the built-in kernels have thousands of them.
#[doc(hidden)]
#[inline(never)]
#[must_use]
pub fn text(text: &'static str) -> String {
    text.into()
}

/// A form of an image pass that comes from one function in two: a compute kernel that writes texels of
/// storage textures, and a fragment kernel that returns them as colours.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", tag = "kind")]
pub enum ImagePass {
    /// The compute form.
    Compute {
        /// The entry point of the fragment form, which has the same parameters.
        fragment: String,
    },
    /// The fragment form. It is drawn over all pixels of its targets, by a triangle that covers them, without
    /// depth and blending; its [index](Role::Index) is the pixel. A target may have any format of the channels
    /// that the kernel returns: the format is not part of the shader.
    Fragment,
}

impl Kernel {
    /// The entry point of the fragment form, of a kernel that is the compute form of an image pass.
    #[must_use]
    pub fn fragment_form(&self) -> Option<&str> {
        match &self.image_pass {
            Some(ImagePass::Compute { fragment }) => Some(fragment),
            _ => None,
        }
    }

    /// How many outputs are stored in a buffer or texture: a mask of samples is not.
    #[must_use]
    pub fn stored_outputs(&self) -> usize {
        let mask = |output: &&Output| **output == Output::SampleMask;
        self.outputs.len() - self.outputs.iter().filter(mask).count()
    }

    /// Whether it is the fragment form of an image pass.
    #[must_use]
    pub fn is_fragment_form(&self) -> bool {
        self.image_pass == Some(ImagePass::Fragment)
    }
}

/// What a kernel does with subgroups.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Subgroups {
    /// Nothing.
    #[default]
    Unused,
    /// It uses them, and its result is the same for every size.
    AnySize,
    /// Its result depends on their size.
    Sized,
}

impl Subgroups {
    /// Of a kernel that does or does not use them, and whose result does or does not depend on their
    /// size.
    #[doc(hidden)]
    #[must_use]
    pub const fn of(used: bool, sized: bool) -> Self {
        match (used, sized) {
            (false, _) => Self::Unused,
            (true, false) => Self::AnySize,
            (true, true) => Self::Sized,
        }
    }

    /// Whether the kernel has nothing to do with them.
    #[must_use]
    pub const fn is_unused(&self) -> bool {
        matches!(self, Self::Unused)
    }
}

/// What compilers and drivers may do with a kernel's floating-point arithmetic.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Rounding {
    /// Contract a product and a sum into one operation, and reorder sums.
    #[default]
    Free,
    /// Neither, wherever a language can ask for that. Without it the result is as good, but other
    /// bits: languages that cannot ask for it get the kernel all the same.
    Pinned,
    /// Neither: otherwise the result is wrong. Languages that cannot ask for it do not get the
    /// kernel.
    Exact,
}

/// A pipeline stage.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", tag = "kind")]
pub enum Stage {
    /// A compute shader.
    Compute {
        /// Invocations of a workgroup along x, y, z.
        threads: [u32; 3],
        /// How many of the dimensions index the output: 1, 2 or 3.
        dimensions: u32,
        /// Whether the invocations of a workgroup share memory or wait for one another.
        cooperative: bool,
        /// Bytes of workgroup memory.
        workgroup_bytes: u32,
        /// How many invocations run.
        range: Range,
    },
    /// A vertex shader: one invocation for each vertex.
    Vertex,
    /// A fragment shader: one invocation for each covered fragment.
    Fragment,
}

/// How many invocations of a compute kernel run; those that the last workgroups have beyond it do
/// nothing.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", tag = "kind")]
pub enum Range {
    /// As many as the first output has elements or texels; without outputs, as many as the first
    /// buffer that is read has.
    #[default]
    Outputs,
    /// As many as a buffer has elements.
    Elements {
        /// The buffer's parameter.
        param: String,
    },
    /// A fixed number along x, y, z.
    Fixed {
        /// It.
        size: [u32; 3],
    },
    /// What a uniform says: as many `u32` in a row as the kernel has dimensions.
    Uniform {
        /// The uniform's parameter.
        param: String,
        /// Where they begin, in bytes.
        offset: u32,
    },
}

/// A floating-point type.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Precision {
    /// IEEE 754 binary32.
    F32,
    /// IEEE 754 binary64.
    F64,
}

/// A parameter of a kernel.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Param {
    /// The parameter's name in Rust; also the variable's name in every language that allows it.
    pub name: String,
    /// What it is bound to.
    pub role: Role,
    /// What its numbers are like.
    #[serde(default, skip_serializing_if = "Inputs::is_empty")]
    pub inputs: Inputs,
}

/// What the numbers of a parameter or a field are like, as its attributes say: parity makes inputs
/// from it, the command line takes defaults and units from it. Of nested structures the innermost
/// attribute counts.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Inputs {
    /// Where they lie; without it floats lie in \[-1, 1\] and integers anywhere.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub domain: Option<Domain>,
    /// What a uniform's number is unless somebody says otherwise.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub default: Option<f64>,
    /// Their unit.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unit: Option<String>,
    /// How many elements a buffer has.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub length: Option<Length>,
    /// How many texels a texture has along each axis.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub size: Option<[u32; 3]>,
    /// How many mip levels it has; without it 1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub levels: Option<u32>,
    /// How many layers or cubes an array has; without it 3.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub layers: Option<u32>,
    /// What a sampler does between texels; without it it interpolates.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub filter: Option<Filter>,
    /// What a sampler does between levels; without it it interpolates.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mip_filter: Option<Filter>,
    /// What a sampler does beyond the edge; without it it clamps, and repeats for inputs at the edge.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub address: Option<Address>,
    /// How a comparison sampler compares; without it `less-equal`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub compare: Option<Compare>,
}

impl Inputs {
    /// Whether nothing is said.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        *self == Self::default()
    }

    /// These, and where they say nothing, what `outer` says of all numbers inside.
    #[must_use]
    pub fn within(&self, outer: &Self) -> Self {
        Self {
            domain: self.domain.clone().or_else(|| outer.domain.clone()),
            default: self.default.or(outer.default),
            unit: self.unit.clone().or_else(|| outer.unit.clone()),
            ..Self::default()
        }
    }
}

/// Where numbers lie.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", tag = "kind")]
pub enum Domain {
    /// From one to the other, both included.
    Range {
        /// The least.
        least: f64,
        /// The greatest.
        most: f64,
    },
    /// Of any order of magnitude between two positive numbers.
    Magnitude {
        /// The least.
        least: f64,
        /// The greatest.
        most: f64,
    },
    /// One of these.
    Values {
        /// All there are.
        values: Vec<f64>,
    },
    /// The vector's length is 1.
    UnitVector,
    /// Integers of a buffer of which no two are alike.
    Distinct,
    /// How many elements a buffer, or texels a texture, has.
    CountOf {
        /// The parameter.
        param: String,
    },
    /// The number of an element of a buffer, from 0.
    IndexOf {
        /// The parameter.
        param: String,
    },
}

/// How many elements a buffer has.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", tag = "kind")]
pub enum Length {
    /// From one to the other, both included.
    Between {
        /// The fewest.
        least: u32,
        /// The most.
        most: u32,
    },
    /// As many as another parameter has elements or texels, times a number, plus a number.
    Of {
        /// The other parameter.
        param: String,
        /// The factor.
        times: u32,
        /// The summand.
        plus: i32,
    },
}

/// What a parameter is bound to. `binding` is the number in descriptor set 0, counted over the
/// parameters in order and then the outputs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", tag = "kind")]
pub enum Role {
    /// A uniform buffer with one value.
    Uniform {
        /// Number in set 0; of push constants only where a language has none.
        binding: u32,
        /// Layout of the value.
        layout: Layout,
        /// Push constants: a value that is part of the commands, not in a buffer.
        #[serde(default, skip_serializing_if = "core::ops::Not::not")]
        push: bool,
    },
    /// A read-only storage buffer of which the invocation gets its own element.
    Element {
        /// Number in set 0.
        binding: u32,
        /// Layout of an element.
        layout: Layout,
    },
    /// A read-only storage buffer that any invocation may read anywhere.
    Storage {
        /// Number in set 0.
        binding: u32,
        /// Layout of an element.
        layout: Layout,
    },
    /// A storage buffer of which the invocation reads its own element and writes it back.
    ElementMut {
        /// Number in set 0.
        binding: u32,
        /// Layout of an element.
        layout: Layout,
    },
    /// A storage buffer that any invocation may read and write anywhere.
    StorageMut {
        /// Number in set 0.
        binding: u32,
        /// Layout of an element.
        layout: Layout,
        /// Which element lies where depends on the order in which invocations run: what is in it
        /// is the same each time, in another order.
        #[serde(default, skip_serializing_if = "core::ops::Not::not")]
        unordered: bool,
    },
    /// A storage buffer of integers on which only atomic operations work.
    Atomic {
        /// Number in set 0.
        binding: u32,
        /// `u32` or `i32`.
        scalar: Scalar,
        /// As for [`Role::StorageMut`].
        #[serde(default, skip_serializing_if = "core::ops::Not::not")]
        unordered: bool,
    },
    /// A texture that is read by coordinates or through a sampler.
    Texture {
        /// Number in set 0.
        binding: u32,
        /// Shape and texel type.
        texture: TextureKind,
    },
    /// A texture of which any texel may be read, written, or both.
    StorageTexture {
        /// Number in set 0.
        binding: u32,
        /// The format, which is part of the shader.
        format: TexelFormat,
        /// 2 or 3.
        dimensions: u32,
        /// It has any number of layers.
        #[serde(default, skip_serializing_if = "core::ops::Not::not")]
        array: bool,
        /// What is done with its texels.
        #[serde(default, skip_serializing_if = "TexelAccess::is_write")]
        access: TexelAccess,
    },
    /// A sampler.
    Sampler {
        /// Number in set 0.
        binding: u32,
        /// What it does.
        sampler: SamplerKind,
    },
    /// A specialisation constant.
    Constant {
        /// `SpecId`.
        id: u32,
        /// `u32`, `i32`, `f32` or `bool`.
        scalar: Scalar,
        /// The 32 bits of the value unless specialised: a truth value is 0 or 1.
        default: u32,
    },
    /// The invocation's own index; in the fragment form of an image pass the pixel. Bound to nothing.
    Index,
    /// What the device knows of the invocation; bound to nothing.
    BuiltIn {
        /// Which.
        built_in: BuiltIn,
    },
    /// Memory of the workgroup; bound to nothing.
    Shared {
        /// Layout of an element.
        layout: Layout,
        /// Number of elements.
        length: u32,
        /// Integers on which only atomic operations work.
        atomic: bool,
    },
    /// A vertex attribute (vertex stage).
    Attribute {
        /// Input location.
        location: u32,
        /// Its type.
        ty: Type,
    },
    /// A value interpolated between vertices (fragment stage).
    Varying {
        /// Input location.
        location: u32,
        /// Its type.
        ty: Type,
        /// How.
        #[serde(default, skip_serializing_if = "Interpolation::is_usual")]
        interpolation: Interpolation,
    },
}

/// How a value is interpolated between vertices.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Interpolation {
    /// Along the primitive's surface, at the centre of the pixel.
    #[default]
    Perspective,
    /// The same, where the primitive covers the pixel.
    PerspectiveCentroid,
    /// The same, at each sample.
    PerspectiveSample,
    /// Along the screen, at the centre of the pixel.
    Linear,
    /// The same, where the primitive covers the pixel.
    LinearCentroid,
    /// The same, at each sample.
    LinearSample,
    /// That of one vertex. Integers always are.
    Flat,
}

impl Interpolation {
    /// Whether it is what a language does if nothing is said.
    #[must_use]
    pub fn is_usual(&self) -> bool {
        *self == Self::default()
    }

    /// Without the perspective's division.
    #[must_use]
    pub const fn is_linear(self) -> bool {
        matches!(
            self,
            Self::Linear | Self::LinearCentroid | Self::LinearSample
        )
    }

    /// Where the primitive covers the pixel.
    #[must_use]
    pub const fn is_centroid(self) -> bool {
        matches!(self, Self::PerspectiveCentroid | Self::LinearCentroid)
    }

    /// At each sample of the pixel, for each of which the kernel then runs.
    #[must_use]
    pub const fn is_per_sample(self) -> bool {
        matches!(self, Self::PerspectiveSample | Self::LinearSample)
    }

    /// WGSL's words, as in `@interpolate(linear, centroid)`; none for what is usual.
    #[must_use]
    pub const fn words(self) -> Option<&'static str> {
        Some(match self {
            Self::Perspective => return None,
            Self::PerspectiveCentroid => "perspective, centroid",
            Self::PerspectiveSample => "perspective, sample",
            Self::Linear => "linear",
            Self::LinearCentroid => "linear, centroid",
            Self::LinearSample => "linear, sample",
            Self::Flat => "flat",
        })
    }
}

/// What a sampler does, in WebGPU's words.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SamplerKind {
    /// It may filter.
    Filtering,
    /// It takes the nearest texel of the nearest level: what depths that are not compared and integers are sampled with.
    NonFiltering,
    /// It compares depths with a reference.
    Comparison,
}

impl SamplerKind {
    /// Whether it compares.
    #[must_use]
    pub const fn is_comparison(self) -> bool {
        matches!(self, Self::Comparison)
    }

    /// Whether a sampler is one of these.
    #[must_use]
    pub fn fits(self, sampler: &super::Sampler) -> bool {
        match self {
            Self::Filtering => sampler.compare.is_none(),
            Self::NonFiltering => sampler.compare.is_none() && !sampler.is_filtering(),
            Self::Comparison => sampler.compare.is_some(),
        }
    }

    /// What must be given, for a message.
    #[must_use]
    pub const fn wanted(self) -> &'static str {
        match self {
            Self::Filtering => "a sampler that does not compare",
            Self::NonFiltering => "a sampler that neither filters nor compares",
            Self::Comparison => "a sampler that compares",
        }
    }
}

/// How a storage texture is seen, in WebGPU's words: `1d`, `2d`, `2d-array`, `3d`.
#[must_use]
pub const fn storage_view(dimensions: u32, array: bool) -> &'static str {
    match (dimensions, array) {
        (1, _) => "1d",
        (3, _) => "3d",
        (_, true) => "2d-array",
        (_, false) => "2d",
    }
}

/// What a kernel does with the texels of a storage texture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum TexelAccess {
    /// Writes them.
    #[default]
    Write,
    /// Reads them.
    Read,
    /// Reads and writes them.
    ReadWrite,
}

impl TexelAccess {
    /// Whether texels are read.
    #[must_use]
    pub const fn reads(self) -> bool {
        matches!(self, Self::Read | Self::ReadWrite)
    }

    /// Whether texels are written.
    #[must_use]
    pub const fn writes(self) -> bool {
        matches!(self, Self::Write | Self::ReadWrite)
    }

    /// Whether texels are only written: what a description says nothing of.
    const fn is_write(&self) -> bool {
        matches!(self, Self::Write)
    }

    /// WebGPU's word: `write-only`, `read-only`, `read-write`.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Self::Write => "write-only",
            Self::Read => "read-only",
            Self::ReadWrite => "read-write",
        }
    }
}

/// What the device knows of an invocation. Ids and counts have as many dimensions as the kernel, those
/// of subgroups one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum BuiltIn {
    /// Its place in its workgroup.
    LocalId,
    /// Its number in its workgroup, counted along x, then y, then z.
    LocalIndex,
    /// Its workgroup.
    GroupId,
    /// How many workgroups the range needs.
    GroupCount,
    /// Invocations of its subgroup.
    SubgroupSize,
    /// Its number in its subgroup.
    SubgroupInvocationId,
    /// Its subgroup in its workgroup.
    SubgroupId,
    /// How many subgroups its workgroup has.
    SubgroupCount,
    /// The vertex's number (vertex stage).
    VertexIndex,
    /// The instance's number (vertex stage).
    InstanceIndex,
    /// Where the fragment is in the target, and its depth (fragment stage).
    FragCoord,
    /// Whether the fragment's primitive faces the viewer (fragment stage).
    FrontFacing,
    /// Which sample of its pixel the fragment is (fragment stage).
    SampleIndex,
    /// Which samples of the pixel the primitive covers, a bit for each (fragment stage).
    SampleMask,
    /// The number of the fragment's primitive in its instance (fragment stage).
    PrimitiveIndex,
}

/// What the texels of a texture that is read hold.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Holds {
    Floats,
    Unsigned,
    Signed,
    Depths,
}

/// How a texture is seen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum View {
    D1,
    D2,
    D2Array,
    D3,
    Cube,
    CubeArray,
}

/// How many samples a texel has.
#[derive(Clone, Copy)]
enum Samples {
    One,
    Several,
}

/// Declares [`TextureKind`]: of each its type in Rust, how it is seen, what it holds, and how many samples a texel has.
macro_rules! texture_kinds {
    ($($(#[doc = $doc:literal])* $kind:ident $name:literal $view:ident $holds:ident $samples:ident;)*) => {
        /// Shape of a texture that is read.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
        #[serde(rename_all = "snake_case")]
        pub enum TextureKind { $($(#[doc = $doc])* $kind,)* }

        impl TextureKind {
            /// All of them.
            pub const ALL: &[Self] = &[$(Self::$kind),*];

            /// The type in Rust, without the lifetime.
            #[must_use]
            pub const fn name(self) -> &'static str {
                match self { $(Self::$kind => $name,)* }
            }

            const fn seen(self) -> View {
                match self { $(Self::$kind => View::$view,)* }
            }

            const fn holds(self) -> Holds {
                match self { $(Self::$kind => Holds::$holds,)* }
            }

            /// Whether its texels have several samples.
            #[must_use]
            pub const fn is_multisampled(self) -> bool {
                matches!(match self { $(Self::$kind => Samples::$samples,)* }, Samples::Several)
            }
        }
    };
}

texture_kinds! {
    /// One dimension.
    Texture1d "Texture1d" D1 Floats One;
    /// Two dimensions, filterable.
    Texture2d "Texture2d" D2 Floats One;
    /// Layers of two dimensions.
    Texture2dArray "Texture2dArray" D2Array Floats One;
    /// Two dimensions with several samples in each texel; read sample by sample.
    Texture2dMultisampled "Texture2dMultisampled" D2 Floats Several;
    /// Three dimensions, filterable.
    Texture3d "Texture3d" D3 Floats One;
    /// The six faces of a cube, filterable.
    TextureCube "TextureCube" Cube Floats One;
    /// Cubes in an array.
    TextureCubeArray "TextureCubeArray" CubeArray Floats One;
    /// Depths in two dimensions, which a sampler compares with a reference.
    DepthTexture2d "DepthTexture2d" D2 Depths One;
    /// Layers of such depths.
    DepthTexture2dArray "DepthTexture2dArray" D2Array Depths One;
    /// Depths with several samples in each texel; read sample by sample.
    DepthTexture2dMultisampled "DepthTexture2dMultisampled" D2 Depths Several;
    /// Such depths on the faces of a cube.
    DepthTextureCube "DepthTextureCube" Cube Depths One;
    /// Such cubes in an array.
    DepthTextureCubeArray "DepthTextureCubeArray" CubeArray Depths One;
    /// One dimension of unsigned integers.
    UintTexture1d "Texture1d<u32>" D1 Unsigned One;
    /// Two dimensions of unsigned integers, not filtered.
    UintTexture2d "Texture2d<u32>" D2 Unsigned One;
    /// Layers of two dimensions of unsigned integers.
    UintTexture2dArray "Texture2dArray<u32>" D2Array Unsigned One;
    /// Unsigned integers with several samples in each texel.
    UintTexture2dMultisampled "Texture2dMultisampled<u32>" D2 Unsigned Several;
    /// Three dimensions of unsigned integers.
    UintTexture3d "Texture3d<u32>" D3 Unsigned One;
    /// Unsigned integers on the faces of a cube, which are gathered.
    UintTextureCube "TextureCube<u32>" Cube Unsigned One;
    /// Such cubes in an array.
    UintTextureCubeArray "TextureCubeArray<u32>" CubeArray Unsigned One;
    /// One dimension of signed integers.
    SintTexture1d "Texture1d<i32>" D1 Signed One;
    /// Two dimensions of signed integers, not filtered.
    SintTexture2d "Texture2d<i32>" D2 Signed One;
    /// Layers of two dimensions of signed integers.
    SintTexture2dArray "Texture2dArray<i32>" D2Array Signed One;
    /// Signed integers with several samples in each texel.
    SintTexture2dMultisampled "Texture2dMultisampled<i32>" D2 Signed Several;
    /// Three dimensions of signed integers.
    SintTexture3d "Texture3d<i32>" D3 Signed One;
    /// Signed integers on the faces of a cube, which are gathered.
    SintTextureCube "TextureCube<i32>" Cube Signed One;
    /// Such cubes in an array.
    SintTextureCubeArray "TextureCubeArray<i32>" CubeArray Signed One;
}

impl TextureKind {
    /// How it is seen, in WebGPU's words: `1d`, `2d`, `2d-array`, `3d`, `cube`, `cube-array`.
    #[must_use]
    pub const fn view(self) -> &'static str {
        match self.seen() {
            View::D1 => "1d",
            View::D2 => "2d",
            View::D2Array => "2d-array",
            View::D3 => "3d",
            View::Cube => "cube",
            View::CubeArray => "cube-array",
        }
    }

    /// Dimensions of a texel's place within a layer: 1, 2 or 3.
    #[must_use]
    pub const fn dimensions(self) -> u32 {
        match self.seen() {
            View::D1 => 1,
            View::D3 => 3,
            View::D2 | View::D2Array | View::Cube | View::CubeArray => 2,
        }
    }

    /// Whether it has any number of layers or cubes.
    #[must_use]
    pub const fn is_array(self) -> bool {
        matches!(self.seen(), View::D2Array | View::CubeArray)
    }

    /// What its channels are as a kernel sees them: floats, or integers of one sign.
    #[must_use]
    pub const fn channels(self) -> Channels {
        match self.holds() {
            Holds::Floats | Holds::Depths => Channels::Float,
            Holds::Unsigned => Channels::Uint,
            Holds::Signed => Channels::Sint,
        }
    }

    /// Whether its layers are faces of cubes.
    #[must_use]
    pub const fn is_cube(self) -> bool {
        matches!(self.seen(), View::Cube | View::CubeArray)
    }

    /// Whether it holds depths.
    #[must_use]
    pub const fn is_depth(self) -> bool {
        matches!(self.holds(), Holds::Depths)
    }

    /// Whether it can have several mip levels.
    #[must_use]
    pub const fn has_levels(self) -> bool {
        !self.is_multisampled() && self.dimensions() != 1
    }

    /// Why a texture of so many layers does not fit, if it does not.
    #[must_use]
    pub fn misfit(self, layers: u32) -> Option<String> {
        let faces = if self.is_cube() { 6 } else { 1 };
        let fits = if self.is_array() {
            layers > 0 && layers.is_multiple_of(faces)
        } else {
            layers == faces
        };
        (!fits).then(|| {
            let wanted = match (self.is_array(), self.is_cube()) {
                (false, false) => "1",
                (false, true) => "the 6 of a cube",
                (true, false) => "at least 1",
                (true, true) => "6 for each cube",
            };
            std::format!("it has {layers} layers, not {wanted}")
        })
    }
}

/// What a kernel writes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", tag = "kind")]
pub enum Output {
    /// A storage buffer: element `i` is written by invocation `i`, and by no other.
    Buffer {
        /// Number in set 0.
        binding: u32,
        /// Layout of an element.
        layout: Layout,
    },
    /// A storage texture: its texel at the invocation's index.
    Texture {
        /// Number in set 0.
        binding: u32,
        /// The format, which is part of the shader.
        format: TexelFormat,
        /// 2 or 3.
        dimensions: u32,
    },
    /// The clip-space position (vertex stage).
    Position,
    /// A value handed to the fragment stage (vertex stage).
    Varying {
        /// Output location.
        location: u32,
        /// Its type.
        ty: Type,
        /// How it will be interpolated; see [`Role::Varying`].
        #[serde(default, skip_serializing_if = "Interpolation::is_usual")]
        interpolation: Interpolation,
    },
    /// The fragment's depth, in place of that of its primitive (fragment stage).
    Depth,
    /// Which samples of the pixel are written (fragment stage).
    SampleMask,
    /// Distances from planes at which the primitive is clipped (vertex stage).
    ClipDistances {
        /// Their type: an array of 1 to 8 `f32`.
        ty: Type,
    },
    /// The second source of blending into the target at location 0 (fragment stage).
    SecondSource {
        /// Its type, that of the target.
        ty: Type,
    },
    /// A colour attachment (fragment stage).
    Target {
        /// Output location.
        location: u32,
        /// Its type.
        ty: Type,
    },
}

/// The type of a value in memory or at a stage's interface.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", tag = "kind")]
pub enum Type {
    /// A scalar.
    Scalar {
        /// Which.
        scalar: Scalar,
    },
    /// A vector.
    Vector {
        /// Its components' type.
        scalar: Scalar,
        /// 2, 3 or 4.
        size: u32,
    },
    /// An array of fixed length.
    Array {
        /// Its elements' type.
        element: Box<Type>,
        /// Number of elements.
        length: u32,
        /// Bytes from one element to the next.
        stride: u32,
    },
    /// A structure.
    Struct {
        /// Its layout.
        layout: Layout,
    },
}

impl Type {
    /// What a value is in shaders and in the texts beside them: two halves are one number of 32 bits.
    #[must_use]
    pub const fn in_shader(&self) -> &Self {
        const WORD: &Type = &Type::Scalar {
            scalar: Scalar::U32,
        };
        match self {
            Self::Vector {
                scalar: Scalar::F16,
                ..
            } => WORD,
            other => other,
        }
    }

    /// The scalar and the number of components that a scalar or a vector has [in shaders](Self::in_shader).
    #[must_use]
    pub const fn components(&self) -> Option<(Scalar, u32)> {
        match self.in_shader() {
            Self::Scalar { scalar } => Some((*scalar, 1)),
            Self::Vector { scalar, size } => Some((*scalar, *size)),
            Self::Array { .. } | Self::Struct { .. } => None,
        }
    }
}

/// A scalar type.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Scalar {
    /// 32-bit float.
    F32,
    /// 64-bit float.
    F64,
    /// 32-bit unsigned integer.
    U32,
    /// 32-bit signed integer.
    I32,
    /// 64-bit unsigned integer.
    U64,
    /// 64-bit signed integer.
    I64,
    /// A truth value: 32 bits that are 0 or 1.
    Bool,
    /// 16-bit float, of which a [`F16x2`](crate::F16x2) has two: a vector here, one number of 32 bits in shaders.
    F16,
}

impl Scalar {
    /// Its name in Rust; a truth value's as it is in general.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::F32 => "f32",
            Self::F64 => "f64",
            Self::U32 => "u32",
            Self::I32 => "i32",
            Self::U64 => "u64",
            Self::I64 => "i64",
            Self::Bool => "bool",
            Self::F16 => "f16",
        }
    }

    /// Bytes in memory.
    #[must_use]
    pub const fn bytes(self) -> usize {
        match self {
            Self::F64 | Self::U64 | Self::I64 => 8,
            Self::F32 | Self::U32 | Self::I32 | Self::Bool => 4,
            Self::F16 => 2,
        }
    }
}

/// The value of a specialisation constant, as people write it: `2`, `0.5`, `true`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum ConstantValue {
    /// A truth value.
    Bool(bool),
    /// A whole number.
    Integer(i64),
    /// A number with a fraction.
    Float(f64),
}

impl From<bool> for ConstantValue {
    fn from(b: bool) -> Self {
        Self::Bool(b)
    }
}

impl From<u32> for ConstantValue {
    fn from(n: u32) -> Self {
        Self::Integer(n.into())
    }
}

impl From<i32> for ConstantValue {
    fn from(n: i32) -> Self {
        Self::Integer(n.into())
    }
}

impl From<f32> for ConstantValue {
    fn from(x: f32) -> Self {
        Self::Float(x.into())
    }
}

// No value is NaN: neither JSON nor `parse` has one.
impl Eq for ConstantValue {}

impl ConstantValue {
    /// The value of 32 bits.
    #[must_use]
    pub fn of_word(scalar: Scalar, word: u32) -> Self {
        match scalar {
            Scalar::Bool => Self::Bool(word != 0),
            Scalar::I32 => Self::Integer(word.cast_signed().into()),
            Scalar::F32 => Self::Float(f32::from_bits(word).into()),
            _ => Self::Integer(word.into()),
        }
    }

    /// Its 32 bits as a constant of that type; none if it is not one. A truth value may be 0 or 1, too, and a number
    /// with a fraction a whole one.
    #[must_use]
    pub fn word(self, scalar: Scalar) -> Option<u32> {
        match (scalar, self) {
            (Scalar::Bool, Self::Bool(b)) => Some(b.into()),
            (Scalar::Bool, Self::Integer(n @ (0 | 1))) => u32::try_from(n).ok(),
            (Scalar::U32, Self::Integer(n)) => u32::try_from(n).ok(),
            (Scalar::I32, Self::Integer(n)) => i32::try_from(n).ok().map(i32::cast_unsigned),
            (Scalar::F32, Self::Integer(n)) => Some((n as f32).to_bits()),
            (Scalar::F32, Self::Float(x)) => {
                let single = x as f32;
                single.is_finite().then(|| single.to_bits())
            }
            _ => None,
        }
    }

    /// What values of that type are, in words.
    #[must_use]
    pub const fn kind(scalar: Scalar) -> &'static str {
        match scalar {
            Scalar::I32 => "a whole number from -2147483648 to 2147483647",
            Scalar::F32 => "a number within the range of `f32`",
            Scalar::Bool => "`true` or `false`",
            _ => "a whole number from 0 to 4294967295",
        }
    }

    /// As a number.
    #[must_use]
    pub fn number(self) -> f64 {
        match self {
            Self::Bool(b) => b.into(),
            Self::Integer(n) => n as f64,
            Self::Float(x) => x,
        }
    }
}

impl core::str::FromStr for ConstantValue {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if let Ok(b) = text.parse() {
            return Ok(Self::Bool(b));
        }
        if let Ok(n) = text.parse() {
            return Ok(Self::Integer(n));
        }
        match text.parse::<f64>() {
            Ok(x) if x.is_finite() => Ok(Self::Float(x)),
            _ => Err(std::format!(
                "a specialisation constant is a whole number, a fraction, `true` or `false`, which `{text}` is not"
            )),
        }
    }
}

impl core::fmt::Display for ConstantValue {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Bool(b) => b.fmt(f),
            Self::Integer(n) => n.fmt(f),
            // An `f32`'s digits, if it is one.
            Self::Float(x) if f64::from(*x as f32) == *x => write!(f, "{:?}", *x as f32),
            Self::Float(x) => write!(f, "{x:?}"),
        }
    }
}

/// Where the parts of a value lie, in bytes (std430).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Layout {
    /// The structure's name, without type parameters; for a buffer of plain numbers the number's
    /// own name (`f32`).
    pub name: String,
    /// Size, which is also the stride in an array.
    pub size: u32,
    /// Alignment.
    pub align: u32,
    /// The fields in order. A buffer of plain numbers has one, with an empty name.
    pub fields: Vec<Field>,
}

/// A field of a structure.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Field {
    /// Its name.
    pub name: String,
    /// The first paragraph of its documentation.
    pub summary: String,
    /// Its type.
    pub ty: Type,
    /// Bytes from the structure's start.
    pub offset: u32,
    /// Size in bytes.
    pub size: u32,
    /// What its numbers are like.
    #[serde(default, skip_serializing_if = "Inputs::is_empty")]
    pub inputs: Inputs,
}

macro_rules! texel_format {
    ($($(#[doc = $doc:literal])* $name:ident $word:literal $spirv:ident $value:ident $channels:literal $channel:ident;)*) => {
        /// Formats that a kernel can write, or that a texture it reads can have.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
        #[serde(rename_all = "lowercase")]
        #[repr(u32)]
        pub enum TexelFormat {
            $($(#[doc = $doc])* $name,)*
        }
    };
}

texel_formats!(texel_format);

/// What the channels of a texel are in a shader, whatever their bits in memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Channels {
    /// `f32`.
    Float,
    /// `u32`.
    Uint,
    /// `i32`.
    Sint,
}

impl Channels {
    /// As WebGPU ends the names of formats: `float`, `uint`, `sint`.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Self::Float => "float",
            Self::Uint => "uint",
            Self::Sint => "sint",
        }
    }
}

/// How closely a backend must agree with the native scalar run: an element passes when it is
/// within `ulp` units in the last place *or* within `absolute` of it. Both zero: bit for bit.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Tolerance {
    /// Units in the last place of the kernel's precision.
    pub ulp: u32,
    /// Absolute difference.
    pub absolute: f64,
    /// Finite inputs may give results that are not finite.
    #[serde(default, skip_serializing_if = "core::ops::Not::not")]
    pub non_finite: bool,
    /// Why it is that.
    pub why: String,
}
