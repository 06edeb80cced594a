//! Any Vulkan adapter through wgpu: a GPU, or lavapipe on a machine without one.

mod clock;
mod filter;
mod floats;
mod indirect;
mod own;
mod pipelines;
mod resources;
pub mod words;

use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};

use hankel_dsl::glam::Vec4;
use hankel_dsl::native::Sampler;

use super::error::{DeviceError, Result};
use super::extent::{self, Extent};
use super::slots::{self, Given, Slot};
use super::{Backend, Bind, BufferId, Device, Pass, Program, TextureId, TextureShape};
use clock::Clock;
pub use floats::Floats;
use indirect::Indirect;
use pipelines::Pipelines;
use resources::{Memory, Texture};

/// Features that are used where the adapter has them.
fn wanted_features() -> wgpu::Features {
    wgpu::Features::PASSTHROUGH_SHADERS
        | wgpu::Features::SHADER_F16
        | wgpu::Features::SHADER_F64
        | wgpu::Features::SHADER_INT64
        | wgpu::Features::SUBGROUP
        | wgpu::Features::IMMEDIATES
        | wgpu::Features::PRIMITIVE_INDEX
        | wgpu::Features::CLIP_DISTANCES
        | wgpu::Features::DUAL_SOURCE_BLENDING
        | wgpu::Features::FLOAT32_FILTERABLE
        | wgpu::Features::FLOAT32_BLENDABLE
        | wgpu::Features::TEXTURE_FORMAT_16BIT_NORM
        | wgpu::Features::TEXTURE_ADAPTER_SPECIFIC_FORMAT_FEATURES
        | clock::FEATURES
}

/// A Vulkan device.
///
/// Shader modules and pipelines are kept as long as the device, by content: the second run of a
/// kernel compiles nothing.
#[derive(Debug)]
pub struct VulkanDevice {
    number: u32,
    name: String,
    device: wgpu::Device,
    queue: wgpu::Queue,
    adapter: wgpu::Adapter,
    limits: wgpu::Limits,
    faults: Arc<Faults>,
    buffers: Vec<Option<Memory>>,
    textures: Vec<Option<Texture>>,
    samplers: HashMap<Sampler, wgpu::Sampler>,
    pipelines: Pipelines,
    /// Made when the first range is in a buffer.
    indirect: Option<Indirect>,
    /// While times are taken.
    clock: Option<Clock>,
    by_timestamps: bool,
    /// Measured when it is first asked for.
    floats: Option<Floats>,
    rounds_products: Option<bool>,
}

/// How many workgroups run along x, y, z.
enum Groups {
    Known([u32; 3]),
    /// What a buffer of three numbers says.
    InBuffer(wgpu::Buffer),
}

/// What the driver reported outside of a call.
#[derive(Debug, Default)]
struct Faults {
    lost: Mutex<Option<String>>,
    uncaptured: Mutex<Option<wgpu::Error>>,
}

/// Which error of wgpu an error scope catches.
const SCOPES: [wgpu::ErrorFilter; 3] = [
    wgpu::ErrorFilter::Validation,
    wgpu::ErrorFilter::OutOfMemory,
    wgpu::ErrorFilter::Internal,
];

/// wgpu's error and all its causes, on one line each.
fn causes(error: &dyn std::error::Error) -> String {
    let mut text = error.to_string().trim().to_string();
    let mut next = error.source();
    while let Some(cause) = next {
        let words = cause.to_string();
        if !text.contains(words.trim()) {
            text.push_str(": ");
            text.push_str(words.trim());
        }
        next = cause.source();
    }
    text
}

impl VulkanDevice {
    /// Opens the adapter that wgpu prefers: a discrete GPU before an integrated one before a
    /// software driver. VK_DRIVER_FILES (or VK_ICD_FILENAMES) restricts the choice.
    ///
    /// # Errors
    /// [`DeviceError::NoDriver`] without any adapter, [`DeviceError::NoDevice`] if it gives none.
    pub fn new() -> Result<Self> {
        let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle();
        descriptor.backends = wgpu::Backends::VULKAN;
        descriptor.flags = wgpu::InstanceFlags::empty();
        let instance = wgpu::Instance::new(descriptor);
        let options = wgpu::RequestAdapterOptions {
            power_preference: wgpu::PowerPreference::HighPerformance,
            ..Default::default()
        };
        let adapter = pollster::block_on(instance.request_adapter(&options)).map_err(|e| {
            DeviceError::NoDriver {
                detail: e.to_string(),
            }
        })?;
        Self::from_adapter(adapter)
    }

    fn from_adapter(adapter: wgpu::Adapter) -> Result<Self> {
        let info = adapter.get_info();
        let name = [info.name.as_str(), &info.driver_info]
            .into_iter()
            .filter(|part| !part.is_empty())
            .collect::<Vec<_>>()
            .join(", ");
        let limits = adapter.limits();
        let (device, queue) = pollster::block_on(adapter.request_device(&wgpu::DeviceDescriptor {
            label: Some("hankel"),
            required_features: adapter.features() & wanted_features(),
            required_limits: limits.clone(),
            ..Default::default()
        }))
        .map_err(|e| DeviceError::NoDevice {
            adapter: name.clone(),
            detail: causes(&e),
        })?;
        let faults = Arc::new(Faults::default());
        let lost = Arc::clone(&faults);
        device.set_device_lost_callback(move |_, words| {
            *lost.lost.lock().unwrap_or_else(PoisonError::into_inner) = Some(words);
        });
        let uncaptured = Arc::clone(&faults);
        device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| {
            let mut slot = uncaptured
                .uncaptured
                .lock()
                .unwrap_or_else(PoisonError::into_inner);
            slot.get_or_insert(error);
        }));
        Ok(Self {
            number: super::next_device(),
            name,
            device,
            queue,
            adapter,
            limits,
            faults,
            buffers: Vec::new(),
            textures: Vec::new(),
            samplers: HashMap::new(),
            pipelines: Pipelines::default(),
            indirect: None,
            clock: None,
            by_timestamps: false,
            floats: None,
            rounds_products: None,
        })
    }

    /// Whether the device runs kernels in `f64`.
    #[must_use]
    pub fn has_f64(&self) -> bool {
        self.device.features().contains(wgpu::Features::SHADER_F64)
    }

    /// Whether SPIR-V can be handed to the driver untouched.
    #[must_use]
    pub fn has_passthrough(&self) -> bool {
        self.device
            .features()
            .contains(wgpu::Features::PASSTHROUGH_SHADERS)
    }

    /// The largest storage buffer that a kernel can use, in bytes.
    #[must_use]
    pub fn max_storage_bytes(&self) -> u64 {
        self.limits.max_storage_buffer_binding_size
    }

    /// Gives the device up, as if the driver had crashed: every later call is
    /// [`DeviceError::Lost`].
    pub fn destroy(&mut self) {
        self.device.destroy();
        // The loss is reported while polling; what the poll itself says does not matter.
        let _ = self.device.poll(wgpu::PollType::wait_indefinitely());
    }

    /// Does something that wgpu may refuse.
    fn guarded<T>(
        &self,
        during: &dyn Fn() -> String,
        work: impl FnOnce(&wgpu::Device) -> T,
    ) -> Result<T> {
        self.check_alive(during)?;
        let scopes = SCOPES.map(|filter| self.device.push_error_scope(filter));
        let value = work(&self.device);
        let mut error = None;
        // Scopes form a stack: the last is popped first.
        for scope in scopes.into_iter().rev() {
            let caught = pollster::block_on(scope.pop());
            error = error.or(caught);
        }
        self.check_alive(during)?;
        let stray = self
            .faults
            .uncaptured
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .take();
        match error.or(stray) {
            None => Ok(value),
            Some(wgpu::Error::OutOfMemory { .. }) => {
                Err(DeviceError::OutOfMemory { during: during() })
            }
            Some(wgpu::Error::Validation { source, .. } | wgpu::Error::Internal { source, .. }) => {
                Err(DeviceError::Refused {
                    during: during(),
                    detail: causes(source.as_ref()),
                })
            }
        }
    }

    fn check_alive(&self, during: &dyn Fn() -> String) -> Result<()> {
        let lost = self
            .faults
            .lost
            .lock()
            .unwrap_or_else(PoisonError::into_inner);
        match &*lost {
            None => Ok(()),
            Some(words) => Err(DeviceError::Lost {
                device: self.name.clone(),
                during: during(),
                detail: words.clone(),
            }),
        }
    }

    /// Waits for all submitted work.
    fn finish(&self, during: &dyn Fn() -> String) -> Result<()> {
        let polled = self.guarded(during, |device| {
            device.poll(wgpu::PollType::wait_indefinitely())
        })?;
        polled.map(|_| ()).map_err(|e| DeviceError::Refused {
            during: during(),
            detail: e.to_string(),
        })
    }

    fn limit(&self, what: String, wanted: u64, limit: u64) -> Result<()> {
        if wanted > limit {
            return Err(DeviceError::Limit {
                what,
                wanted,
                limit,
                device: self.name.clone(),
            });
        }
        Ok(())
    }

    fn stale(&self, what: String) -> DeviceError {
        DeviceError::Handle {
            what,
            device: self.name.clone(),
        }
    }

    fn memory(&self, id: BufferId) -> Result<&Memory> {
        let found = self.buffers.get(id.index as usize).and_then(Option::as_ref);
        found
            .filter(|_| id.device == self.number)
            .ok_or_else(|| self.stale(format!("buffer {}", id.index)))
    }

    fn image(&self, id: TextureId) -> Result<&Texture> {
        let found = self
            .textures
            .get(id.index as usize)
            .and_then(Option::as_ref);
        found
            .filter(|_| id.device == self.number)
            .ok_or_else(|| self.stale(format!("texture {}", id.index)))
    }

    fn given<'a>(&self, bind: &Bind<'a>) -> Result<Given<'a>> {
        Ok(match bind {
            Bind::Buffer(id) => Given::Buffer {
                id: id.index,
                bytes: self.memory(*id)?.bytes,
            },
            Bind::Bytes(b) => Given::Bytes(b),
            Bind::Texture(id) => Given::Texture {
                id: id.index,
                shape: self.image(*id)?.shape,
            },
            Bind::Sampler(s) => Given::Sampler(*s),
        })
    }

    /// Looks up and checks the arguments of a kernel.
    fn checked<'k, 'a>(
        &self,
        program: &Program<'k>,
        slots: Vec<Slot<'k>>,
        args: &[Bind<'a>],
    ) -> Result<(Vec<Slot<'k>>, Vec<Given<'a>>)> {
        let given = args
            .iter()
            .map(|b| self.given(b))
            .collect::<Result<Vec<_>>>()?;
        slots::check(program.kernel, &slots, &given)?;
        Ok((slots, given))
    }
}

impl Device for VulkanDevice {
    fn name(&self) -> &str {
        &self.name
    }

    fn backend(&self) -> Backend {
        Backend::Vulkan
    }

    fn is_gpu(&self) -> bool {
        self.adapter.get_info().device_type != wgpu::DeviceType::Cpu
    }

    fn buffer(&mut self, label: &str, bytes: usize) -> Result<BufferId> {
        let memory = self.make_buffer(label, bytes)?;
        let index = self.buffers.len() as u32;
        self.buffers.push(Some(memory));
        Ok(BufferId {
            device: self.number,
            index,
        })
    }

    fn texture(&mut self, label: &str, shape: &TextureShape) -> Result<TextureId> {
        let texture = self.make_texture(label, shape)?;
        let index = self.textures.len() as u32;
        self.textures.push(Some(texture));
        Ok(TextureId {
            device: self.number,
            index,
        })
    }

    fn write_buffer(&mut self, buffer: BufferId, bytes: &[u8]) -> Result<()> {
        let memory = self.memory(buffer)?;
        super::check_write(&memory.what(), bytes.len(), memory.bytes, false)?;
        self.upload(memory, bytes)
    }

    fn write_texture(&mut self, texture: TextureId, bytes: &[u8]) -> Result<()> {
        let shape = self.image(texture)?.shape;
        super::check_write(
            &self.image(texture)?.what(),
            bytes.len(),
            shape.bytes(),
            true,
        )?;
        if shape.samples > 1 || shape.format == super::Format::Depth32 {
            self.upload_samples(texture, bytes)
        } else {
            self.upload_texels(self.image(texture)?, bytes)
        }
    }

    fn clear_buffer(&mut self, buffer: BufferId) -> Result<()> {
        let memory = self.memory(buffer)?;
        self.guarded(&|| format!("clearing {}", memory.what()), |device| {
            let mut encoder = device.create_command_encoder(&Default::default());
            self.timed(&mut encoder, |it| it.clear_buffer(&memory.buffer, 0, None));
            self.queue.submit([encoder.finish()]);
        })
    }

    fn clear_texture(&mut self, texture: TextureId, value: Vec4) -> Result<()> {
        let image = self.image(texture)?;
        super::check_clear(&image.what(), &image.shape, value)?;
        if image.is_drawn_into() {
            return self.fill(image, value);
        }
        let filled = super::filled(&image.shape, value);
        self.write_texture(texture, &filled)
    }

    fn copy_to_level(&mut self, from: TextureId, to: TextureId, level: u32) -> Result<()> {
        let (source, target) = (self.image(from)?, self.image(to)?);
        super::check_copy(&source.shape, &target.shape, level)?;
        // A texture is no level of itself unless it is the only one.
        if from == to {
            return Ok(());
        }
        self.copy_texels(source, target, level)
    }

    fn read_buffer(&mut self, buffer: BufferId) -> Result<Vec<u8>> {
        let memory = self.memory(buffer)?;
        let mut bytes = self.download(&memory.buffer, memory.physical(), &memory.what())?;
        bytes.truncate(memory.bytes);
        Ok(bytes)
    }

    fn read_texture(&mut self, texture: TextureId) -> Result<Vec<u8>> {
        if self.image(texture)?.shape.samples > 1 {
            self.download_samples(texture)
        } else {
            self.download_texels(self.image(texture)?)
        }
    }

    fn free_buffer(&mut self, buffer: BufferId) -> Result<()> {
        self.memory(buffer)?.buffer.destroy();
        self.buffers[buffer.index as usize] = None;
        Ok(())
    }

    fn free_texture(&mut self, texture: TextureId) -> Result<()> {
        self.image(texture)?.texture.destroy();
        self.textures[texture.index as usize] = None;
        Ok(())
    }

    fn dispatch(&mut self, program: &Program<'_>, args: &[Bind<'_>]) -> Result<()> {
        let kernel = program.kernel;
        let slots = slots::slots(kernel);
        let threads = pipelines::threads(kernel)?;
        let (slots, given) = self.checked(program, slots, args)?;
        let groups = match extent::extent(kernel, &slots, &given)? {
            Extent::Known(extent) if extent.contains(&0) => return Ok(()),
            Extent::Known(extent) => {
                let groups = [0, 1, 2].map(|i| extent[i].div_ceil(threads[i].max(1)));
                for (axis, n) in ["x", "y", "z"].into_iter().zip(groups) {
                    self.limit(
                        format!(
                            "the number of workgroups of kernel `{}` along {axis}",
                            kernel.name
                        ),
                        n.into(),
                        self.limits.max_compute_workgroups_per_dimension.into(),
                    )?;
                }
                Groups::Known(groups)
            }
            Extent::InBuffer {
                slot,
                offset,
                dimensions,
            } => {
                let Bind::Buffer(id) = args[slot] else {
                    // The checks let no other kind through.
                    return Ok(());
                };
                Groups::InBuffer(self.groups_of(kernel, threads, id, offset, dimensions)?)
            }
        };
        let during = || format!("running kernel `{}`", kernel.name);
        let bound = self.bind(program, &slots, args, wgpu::ShaderStages::COMPUTE)?;
        let pipeline = self.compute_pipeline(program, &slots, &bound)?;
        self.guarded(&during, |device| {
            let mut encoder = device.create_command_encoder(&Default::default());
            self.timed(&mut encoder, |encoder| {
                let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
                    label: Some(&kernel.name),
                    timestamp_writes: None,
                });
                pass.set_pipeline(&pipeline);
                pass.set_bind_group(0, &bound.group, &[]);
                if !bound.pushed.is_empty() {
                    pass.set_immediates(0, &bound.pushed);
                }
                match &groups {
                    Groups::Known([x, y, z]) => pass.dispatch_workgroups(*x, *y, *z),
                    Groups::InBuffer(groups) => pass.dispatch_workgroups_indirect(groups, 0),
                }
            });
            self.queue.submit([encoder.finish()]);
        })
    }

    fn draw(&mut self, pass: &Pass<'_>) -> Result<()> {
        self.draw_pass(pass)
    }

    fn wait(&mut self) -> Result<()> {
        self.finish(&|| "waiting".into())
    }

    fn begin_clock(&mut self) -> Result<bool> {
        VulkanDevice::begin_clock(self)
    }

    fn laps(&self) -> usize {
        VulkanDevice::laps(self)
    }

    fn end_clock(&mut self) -> Result<Vec<f64>> {
        VulkanDevice::end_clock(self)
    }
}
