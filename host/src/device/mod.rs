//! One interface to run kernels by their description, and two devices behind it: this machine's
//! processor ([`native::NativeDevice`]) and any Vulkan adapter ([`vulkan::VulkanDevice`]).
//!
//! A caller makes buffers and textures, names them in the order of the kernel's description, and
//! reads the results back:
//! - [`Device::dispatch`] runs compute kernels on both devices; the native one also runs vertex
//!   and fragment kernels, as maps over arrays of attributes or varyings.
//! - [`Device::draw`] rasterises; only the Vulkan device does.
//!
//! Every argument is checked against the description before anything is submitted, alike on both
//! devices. The number of invocations follows from what is written, see [`extent::extent`].

pub mod error;
pub mod extent;
pub mod native;
pub mod route;
pub mod slots;
pub mod vulkan;

use std::fmt;
use std::sync::atomic::{AtomicU32, Ordering};

use hankel_dsl::glam::Vec4;
use hankel_dsl::native::describe::{Kernel, TexelFormat};
use hankel_dsl::native::{Call, CallError, Sampler, level_size, texture_bytes};
use serde::{Deserialize, Serialize};

pub use error::{DeviceError, Result};
pub use native::NativeDevice;
pub use route::Arithmetic;
pub use vulkan::{Floats, VulkanDevice};

/// A buffer of a device.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct BufferId {
    device: u32,
    index: u32,
}

/// A texture of a device.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct TextureId {
    device: u32,
    index: u32,
}

/// A number for a new device, so that handles of one are not taken for another's.
fn next_device() -> u32 {
    static NEXT: AtomicU32 = AtomicU32::new(0);
    NEXT.fetch_add(1, Ordering::Relaxed)
}

/// Which of the devices.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Backend {
    /// This machine's processor.
    Native,
    /// A Vulkan adapter through wgpu.
    Vulkan,
}

impl fmt::Display for Backend {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Native => "native",
            Self::Vulkan => "vulkan",
        })
    }
}

/// Opens a device.
///
/// # Errors
/// [`DeviceError::NoDriver`] or [`DeviceError::NoDevice`] for Vulkan; the native device always
/// opens.
pub fn open(backend: Backend) -> Result<Box<dyn Device>> {
    Ok(match backend {
        Backend::Native => Box::new(NativeDevice::new()),
        Backend::Vulkan => Box::new(VulkanDevice::new()?),
    })
}

/// What texels are.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Format {
    /// A colour format.
    Texel(TexelFormat),
    /// 32-bit float depth: what [`Depth`] draws into, and what a kernel reads as one float.
    Depth32,
}

impl Format {
    /// The format of the bytes in memory: depth is one 32-bit float.
    #[must_use]
    pub const fn texel(self) -> TexelFormat {
        match self {
            Self::Texel(t) => t,
            Self::Depth32 => TexelFormat::R32Float,
        }
    }

    /// The name in lower case, as in WebGPU.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Texel(t) => t.name(),
            Self::Depth32 => "depth32float",
        }
    }

    /// Whether what is drawn into it can be blended: colours, but for integers. Blending of 32-bit floats is optional
    /// in WebGPU (`float32-blendable`): a device without it says so when it is to draw.
    #[must_use]
    pub const fn is_blendable(self) -> bool {
        match self {
            Self::Texel(t) => !t.is_integer(),
            Self::Depth32 => false,
        }
    }

    /// Whether it has 32-bit floats.
    #[must_use]
    pub const fn has_32_bit_floats(self) -> bool {
        match self {
            Self::Texel(t) => !t.is_integer() && t.bytes() == 4 * t.channels(),
            Self::Depth32 => true,
        }
    }
}

/// What a texture is to be.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct TextureShape {
    /// 1, 2 or 3.
    pub dimensions: u32,
    /// Width, height, depth of level 0 in texels, each at least 1, and 1 beyond the dimensions.
    pub size: [u32; 3],
    /// Mip levels, at least 1; more in two and three dimensions, with one sample. What is drawn, and
    /// what a kernel writes, goes to level 0.
    pub levels: u32,
    /// Layers, at least 1; more in two dimensions, with one sample. Six of them are the faces of a
    /// cube: +x, -x, +y, -y, +z, -z. What is drawn goes to the first one.
    pub layers: u32,
    /// Samples of a texel: 1, or 4 in two dimensions.
    pub samples: u32,
    /// Its texels.
    pub format: Format,
}

impl TextureShape {
    /// One dimension.
    #[must_use]
    pub const fn d1(width: u32, format: TexelFormat) -> Self {
        Self {
            dimensions: 1,
            ..Self::d2(width, 1, format)
        }
    }

    /// Two dimensions, one sample.
    #[must_use]
    pub const fn d2(width: u32, height: u32, format: TexelFormat) -> Self {
        Self {
            dimensions: 2,
            size: [width, height, 1],
            levels: 1,
            layers: 1,
            samples: 1,
            format: Format::Texel(format),
        }
    }

    /// Three dimensions.
    #[must_use]
    pub const fn d3(size: [u32; 3], format: TexelFormat) -> Self {
        Self {
            dimensions: 3,
            size,
            levels: 1,
            layers: 1,
            samples: 1,
            format: Format::Texel(format),
        }
    }

    /// A depth buffer.
    #[must_use]
    pub const fn depth(width: u32, height: u32) -> Self {
        Self {
            dimensions: 2,
            size: [width, height, 1],
            levels: 1,
            layers: 1,
            samples: 1,
            format: Format::Depth32,
        }
    }

    /// The same with so many samples.
    #[must_use]
    pub const fn multisampled(mut self, samples: u32) -> Self {
        self.samples = samples;
        self
    }

    /// The same with so many mip levels.
    #[must_use]
    pub const fn with_levels(mut self, levels: u32) -> Self {
        self.levels = levels;
        self
    }

    /// The same with so many layers.
    #[must_use]
    pub const fn with_layers(mut self, layers: u32) -> Self {
        self.layers = layers;
        self
    }

    /// Bytes of all texels, packed: level after level, in each layer after layer, slice after slice,
    /// row after row, a texel's samples together.
    #[must_use]
    pub fn bytes(&self) -> usize {
        self.bytes_before(self.levels)
    }

    /// Bytes of the levels before one.
    #[must_use]
    pub fn bytes_before(&self, level: u32) -> usize {
        texture_bytes(
            self.size,
            level,
            self.layers,
            self.samples,
            self.format.texel(),
        )
    }

    /// A level: how many texels it has along each axis.
    #[must_use]
    pub fn level_size(&self, level: u32) -> [u32; 3] {
        level_size(self.size, level)
    }

    /// The most levels that its size allows.
    #[must_use]
    pub fn most_levels(&self) -> u32 {
        self.size.iter().max().map_or(1, |n| n.max(&1).ilog2() + 1)
    }
}

/// Refuses shapes that no device has.
fn check_shape(label: &str, shape: &TextureShape) -> Result<()> {
    let single = shape.levels == 1 && shape.layers == 1 && shape.samples == 1;
    let problem = if !matches!(shape.dimensions, 1..=3) {
        format!("{} dimensions; textures have 1, 2 or 3", shape.dimensions)
    } else if shape.size.contains(&0) {
        format!("a size of {:?}; each must be at least 1", shape.size)
    } else if shape.size[shape.dimensions as usize..] != [1, 1][shape.dimensions as usize - 1..] {
        format!(
            "a size of {:?} in {} dimensions",
            shape.size, shape.dimensions
        )
    } else if !(1..=shape.most_levels()).contains(&shape.levels) {
        format!(
            "{} mip levels; its size has 1 to {}",
            shape.levels,
            shape.most_levels()
        )
    } else if !matches!(shape.samples, 1 | 4) {
        format!("{} samples; textures have 1 or 4", shape.samples)
    } else if shape.samples != 1 && (shape.levels != 1 || shape.layers != 1) {
        "several samples and several levels or layers".into()
    } else if shape.layers == 0 || (shape.dimensions != 2 && shape.layers != 1) {
        format!("{} layers in {} dimensions", shape.layers, shape.dimensions)
    } else if shape.dimensions == 1 && !single {
        "several samples or levels in one dimension".into()
    } else if shape.dimensions != 2 && (shape.samples != 1 || shape.format == Format::Depth32) {
        format!(
            "several samples or depth in {} dimensions",
            shape.dimensions
        )
    } else {
        return Ok(());
    };
    Err(DeviceError::Transfer {
        what: format!("texture `{label}`"),
        problem: format!("it was asked for with {problem}"),
    })
}

/// Refuses what does not fit into a buffer (`exact` false) or a texture (`exact` true).
fn check_write(what: &str, given: usize, room: usize, exact: bool) -> Result<()> {
    if given > room || (exact && given != room) {
        return Err(DeviceError::Transfer {
            what: what.into(),
            problem: format!("{given} bytes were given, but it has {room}"),
        });
    }
    Ok(())
}

/// Refuses what a texture of integers is not filled with.
fn check_clear(what: &str, shape: &TextureShape, value: Vec4) -> Result<()> {
    if shape.format.texel().is_integer() && value != Vec4::ZERO {
        return Err(DeviceError::Transfer {
            what: what.into(),
            problem: format!("its texels are integers, which are cleared to 0, not to {value}"),
        });
    }
    Ok(())
}

/// Refuses to copy a texture into a level of another that it is not like.
fn check_copy(from: &TextureShape, to: &TextureShape, level: u32) -> Result<()> {
    let is_plain = |shape: &TextureShape| {
        shape.samples == 1 && shape.layers == 1 && shape.format != Format::Depth32
    };
    let problem = if level >= to.levels {
        format!("it has {} levels, and none is number {level}", to.levels)
    } else if !is_plain(from) || !is_plain(to) || from.levels != 1 {
        "only textures of colours with one sample and one layer are copied, into a level from one that has one"
            .into()
    } else if (from.format, from.dimensions) != (to.format, to.dimensions) {
        format!(
            "its texels are {} in {} dimensions, those of the copied texture {} in {}",
            to.format.name(),
            to.dimensions,
            from.format.name(),
            from.dimensions
        )
    } else if from.size != to.level_size(level) {
        format!(
            "level {level} has {:?} texels, the copied texture {:?}",
            to.level_size(level),
            from.size
        )
    } else {
        return Ok(());
    };
    Err(DeviceError::Transfer {
        what: "texture".into(),
        problem,
    })
}

/// The bytes of a texture that holds one value.
fn filled(shape: &TextureShape, value: Vec4) -> Vec<u8> {
    let format = shape.format.texel();
    let mut texel = vec![0; format.bytes()];
    if !format.is_integer() {
        format.store(&mut texel, value);
    }
    texel.repeat(shape.bytes() / texel.len())
}

/// An argument of a kernel, in the order of [`slots::slots`].
#[derive(Clone, Copy, Debug)]
pub enum Bind<'a> {
    /// A buffer.
    Buffer(BufferId),
    /// Bytes for this one call; only for what is read.
    Bytes(&'a [u8]),
    /// A texture.
    Texture(TextureId),
    /// A sampler.
    Sampler(Sampler),
}

/// A kernel's native code: how it is called.
pub type NativeCode<'a> = &'a (dyn Fn(&mut Call<'_>) -> std::result::Result<(), CallError> + Sync);

/// A kernel's shader, and which way it takes to the driver.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shader<'a> {
    /// SPIR-V handed to the driver as it is. It must be valid (spirv-val): nothing checks it.
    SpirvPassthrough(&'a [u32]),
    /// SPIR-V read, validated and written anew by naga.
    SpirvThroughNaga(&'a [u32]),
    /// WGSL. Specialisation constants are already part of the text.
    Wgsl {
        /// The text.
        text: &'a str,
        /// The entry point's name in it.
        entry_point: &'a str,
    },
}

/// A kernel with its code for one device or both.
#[derive(Clone, Copy)]
pub struct Program<'a> {
    /// What it is.
    pub kernel: &'a Kernel,
    /// Values of the specialisation constants in the order of the parameters; none stands for
    /// their defaults.
    pub constants: &'a [u32],
    /// What the native device runs.
    pub native: Option<NativeCode<'a>>,
    /// What the Vulkan device runs.
    pub shader: Option<Shader<'a>>,
}

impl fmt::Debug for Program<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Program")
            .field("kernel", &self.kernel.name)
            .field("constants", &self.constants)
            .field("native", &self.native.is_some())
            .field("shader", &self.shader.is_some())
            .finish()
    }
}

/// What vertices make.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Topology {
    /// Three vertices each.
    Triangles,
    /// One vertex each, one pixel large.
    Points,
}

/// Which triangles are left out. Front faces wind counter-clockwise on the target with y up.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Cull {
    /// None.
    None,
    /// Those that face away.
    Back,
    /// Those that face the viewer.
    Front,
}

/// How what is drawn is put together with what is there, fragment by fragment in the order of the triangles.
/// `source` is the fragment's colour, `destination` what is there, `alpha` the fourth channel of `source`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Blend {
    /// `source`.
    #[default]
    Off,
    /// `alpha source + (1 - alpha) destination`; of the fourth channel itself
    /// `alpha + (1 - alpha) destination`.
    Alpha,
    /// `source + destination`.
    Additive,
    /// `source destination`.
    Multiplicative,
    /// The smaller one of `source` and `destination`, channel by channel.
    Least,
    /// `second destination`, where `second` is the [second source](hankel_dsl::SecondSource) of the fragment kernel.
    Second,
}

impl Blend {
    /// Its name in reports.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Off => "off",
            Self::Alpha => "alpha",
            Self::Additive => "additive",
            Self::Multiplicative => "multiplicative",
            Self::Least => "least",
            Self::Second => "second",
        }
    }

    /// What is there afterwards, before it is stored, of one source or two.
    #[must_use]
    pub fn apply(self, source: Vec4, second: Vec4, destination: Vec4) -> Vec4 {
        match self {
            Self::Off => source,
            Self::Alpha => {
                let alpha = source.w;
                let mixed = source * alpha + destination * (1.0 - alpha);
                mixed
                    .truncate()
                    .extend(alpha + destination.w * (1.0 - alpha))
            }
            Self::Additive => source + destination,
            Self::Multiplicative => source * destination,
            Self::Least => source.min(destination),
            Self::Second => second * destination,
        }
    }
}

/// A colour target of a pass.
#[derive(Clone, Copy, Debug)]
pub struct Colour {
    /// What is drawn into.
    pub texture: TextureId,
    /// Where the mean of the samples goes, if anywhere; for a multisampled `texture`.
    pub resolve: Option<TextureId>,
    /// What it is filled with first; `None` keeps what is there.
    pub clear: Option<[f64; 4]>,
    /// How what is drawn is put together with what is there; other than [`Blend::Off`] for formats that are
    /// [`Format::is_blendable`].
    pub blend: Blend,
}

/// Which depths pass.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum DepthTest {
    /// Nearer ones, where near is small.
    Less,
    /// Nearer ones and equal ones.
    LessEqual,
    /// Larger ones (reversed depth).
    Greater,
    /// All.
    Always,
}

/// The depth buffer of a pass.
#[derive(Clone, Copy, Debug)]
pub struct Depth {
    /// A [`Format::Depth32`] texture with as many samples as the colour targets.
    pub texture: TextureId,
    /// What it is filled with first; `None` keeps what is there.
    pub clear: Option<f32>,
    /// What passes.
    pub test: DepthTest,
    /// Whether what passes is written.
    pub write: bool,
}

/// A draw call of a pass. Its two stages go the same way, [`Shader::SpirvPassthrough`] or not:
/// wgpu checks one against the other only if it has read both.
#[derive(Clone, Copy, Debug)]
pub struct Draw<'a> {
    /// The vertex stage.
    pub vertex: Program<'a>,
    /// Its arguments: bound parameters and attributes in the order of the parameters. An
    /// attribute takes a buffer of tightly packed values, one for each vertex.
    pub vertex_args: &'a [Bind<'a>],
    /// The fragment stage; none draws depth alone.
    pub fragment: Option<Program<'a>>,
    /// Its arguments: bound parameters only; varyings come from the vertex stage, targets from
    /// the pass.
    pub fragment_args: &'a [Bind<'a>],
    /// Indices into the attributes, `u32` each; none takes the vertices in their order.
    pub indices: Option<BufferId>,
    /// Number of indices, or of vertices where there are none.
    pub count: u32,
    /// What they make.
    pub topology: Topology,
    /// What is left out.
    pub cull: Cull,
}

/// A render pass: its targets, then what is drawn into them. Clip space is WebGPU's: y up,
/// depth from 0 to 1.
#[derive(Clone, Copy, Debug)]
pub struct Pass<'a> {
    /// Name for messages.
    pub label: &'a str,
    /// Targets in the order of the fragment kernel's outputs.
    pub colours: &'a [Colour],
    /// The depth buffer.
    pub depth: Option<Depth>,
    /// Draw calls, in order.
    pub draws: &'a [Draw<'a>],
}

/// A device.
///
/// Handles belong to the device that made them. Work is done in the order of the calls; reading
/// waits for it.
pub trait Device {
    /// A name for messages and reports, with the driver's version where there is one.
    fn name(&self) -> &str;

    /// Which of the devices this is.
    fn backend(&self) -> Backend;

    /// Whether work runs on a GPU, whose clocks fall while it waits: not of the native device, nor of a driver that
    /// runs on the processor.
    fn is_gpu(&self) -> bool {
        false
    }

    /// Makes a buffer of `bytes` bytes, filled with zeros. `label` is for messages.
    ///
    /// # Errors
    /// [`DeviceError::Limit`], [`DeviceError::OutOfMemory`], [`DeviceError::Lost`].
    fn buffer(&mut self, label: &str, bytes: usize) -> Result<BufferId>;

    /// Makes a texture, filled with zeros.
    ///
    /// # Errors
    /// As for [`Device::buffer`], and [`DeviceError::Missing`] for a format that the device lacks.
    fn texture(&mut self, label: &str, shape: &TextureShape) -> Result<TextureId>;

    /// Overwrites a buffer from its start.
    ///
    /// # Errors
    /// [`DeviceError::Transfer`] if `bytes` is longer than the buffer.
    fn write_buffer(&mut self, buffer: BufferId, bytes: &[u8]) -> Result<()>;

    /// Overwrites a texture: [`TextureShape::bytes`] bytes. Depths lie between 0 and 1.
    ///
    /// # Errors
    /// [`DeviceError::Transfer`] for any other number of bytes.
    fn write_texture(&mut self, texture: TextureId, bytes: &[u8]) -> Result<()>;

    /// Fills a buffer with zeros.
    ///
    /// # Errors
    /// [`DeviceError::Handle`], [`DeviceError::Lost`].
    fn clear_buffer(&mut self, buffer: BufferId) -> Result<()>;

    /// Fills a texture with one value, rounded to what its format holds; of depth, its first channel
    /// counts. Textures of integers are filled with zeros only.
    ///
    /// # Errors
    /// [`DeviceError::Handle`], [`DeviceError::Lost`], [`DeviceError::Transfer`] for a value other than 0
    /// in a texture of integers.
    fn clear_texture(&mut self, texture: TextureId, value: Vec4) -> Result<()>;

    /// Copies a texture with one level into a level of another one, which has as many texels there and the same
    /// format.
    ///
    /// # Errors
    /// [`DeviceError::Handle`], [`DeviceError::Lost`], [`DeviceError::Transfer`] for textures that are not alike.
    fn copy_to_level(&mut self, from: TextureId, to: TextureId, level: u32) -> Result<()>;

    /// Waits, and reads a buffer.
    ///
    /// # Errors
    /// [`DeviceError::Lost`], [`DeviceError::OutOfMemory`], [`DeviceError::Handle`].
    fn read_buffer(&mut self, buffer: BufferId) -> Result<Vec<u8>>;

    /// Waits, and reads a texture: [`TextureShape::bytes`] bytes.
    ///
    /// # Errors
    /// As for [`Device::read_buffer`].
    fn read_texture(&mut self, texture: TextureId) -> Result<Vec<u8>>;

    /// Frees a buffer.
    ///
    /// # Errors
    /// [`DeviceError::Handle`].
    fn free_buffer(&mut self, buffer: BufferId) -> Result<()>;

    /// Frees a texture.
    ///
    /// # Errors
    /// [`DeviceError::Handle`].
    fn free_texture(&mut self, texture: TextureId) -> Result<()>;

    /// Runs a kernel over all elements of its outputs, or as far as its range says.
    ///
    /// A uniform that says the range may be a buffer that an earlier dispatch has written: see
    /// [`extent::extent`]. Vulkan then runs no more workgroups along an axis than its limit, which is at
    /// least 65535; who writes the buffer keeps within it.
    ///
    /// # Errors
    /// [`DeviceError::Count`], [`DeviceError::Argument`], [`DeviceError::Constants`] for what does
    /// not fit the description; [`DeviceError::NoCode`]; [`DeviceError::Stage`];
    /// [`DeviceError::Refused`] for a shader that wgpu, naga or the driver refuse;
    /// [`DeviceError::Native`]; [`DeviceError::Limit`].
    fn dispatch(&mut self, program: &Program<'_>, args: &[Bind<'_>]) -> Result<()>;

    /// Draws.
    ///
    /// # Errors
    /// As for [`Device::dispatch`], and [`DeviceError::Pass`]. The native device has no
    /// rasteriser and refuses.
    fn draw(&mut self, pass: &Pass<'_>) -> Result<()>;

    /// Waits until all that was asked is done.
    ///
    /// # Errors
    /// [`DeviceError::Lost`], and whatever went wrong meanwhile.
    fn wait(&mut self) -> Result<()>;

    /// Begins to take times by the device's own clock, of each dispatch, draw, clear and copy. `false` if it
    /// has none, as the native device: then wall time after [`Device::wait`] is what there is.
    ///
    /// # Errors
    /// [`DeviceError::Lost`], [`DeviceError::OutOfMemory`].
    fn begin_clock(&mut self) -> Result<bool> {
        Ok(false)
    }

    /// How many times have been taken since [`Device::begin_clock`]. At most some thousands: what is asked
    /// for after those has none.
    fn laps(&self) -> usize {
        0
    }

    /// Waits, takes no more times, and gives those taken, in seconds, in order.
    ///
    /// # Errors
    /// As for [`Device::read_buffer`].
    fn end_clock(&mut self) -> Result<Vec<f64>> {
        Ok(Vec::new())
    }

    /// Makes a buffer that holds `bytes`.
    ///
    /// # Errors
    /// As for [`Device::buffer`].
    fn buffer_from(&mut self, label: &str, bytes: &[u8]) -> Result<BufferId> {
        let id = self.buffer(label, bytes.len())?;
        self.write_buffer(id, bytes)?;
        Ok(id)
    }

    /// Makes a texture that holds `bytes`.
    ///
    /// # Errors
    /// As for [`Device::texture`] and [`Device::write_texture`].
    fn texture_from(
        &mut self,
        label: &str,
        shape: &TextureShape,
        bytes: &[u8],
    ) -> Result<TextureId> {
        let id = self.texture(label, shape)?;
        self.write_texture(id, bytes)?;
        Ok(id)
    }
}
