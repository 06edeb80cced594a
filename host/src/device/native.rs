//! This machine's processor as a device: buffers are memory, kernels are called directly.

use hankel_dsl::glam::Vec4;
use hankel_dsl::native::describe::{Kernel, TexelFormat};
use hankel_dsl::native::{Arg, Call, Mode, TextureMut, TextureRef, lanes};

use super::error::{DeviceError, Result};
use super::extent::{self, Extent};
use super::slots::{self, Given, Slot, Use};
use super::{Backend, Bind, BufferId, Device, Pass, Program, TextureId, TextureShape};

/// The native device. It has no rasteriser; vertex and fragment kernels run as maps over arrays
/// of attributes and varyings.
#[derive(Debug)]
pub struct NativeDevice {
    number: u32,
    name: String,
    mode: Mode,
    buffers: Vec<Option<Memory>>,
    textures: Vec<Option<Texture>>,
}

/// Bytes at an address that fits every layout.
#[derive(Debug, Default)]
struct Memory {
    words: Vec<u128>,
    bytes: usize,
}

#[derive(Debug)]
struct Texture {
    shape: TextureShape,
    memory: Memory,
}

impl Memory {
    fn zeroed(bytes: usize) -> Option<Self> {
        let mut words = Vec::new();
        let count = bytes.div_ceil(size_of::<u128>());
        words.try_reserve_exact(count).ok()?;
        words.resize(count, 0);
        Some(Self { words, bytes })
    }

    fn get(&self) -> &[u8] {
        &bytemuck::cast_slice(&self.words)[..self.bytes]
    }

    fn get_mut(&mut self) -> &mut [u8] {
        &mut bytemuck::cast_slice_mut(&mut self.words)[..self.bytes]
    }
}

impl Default for NativeDevice {
    fn default() -> Self {
        Self::new()
    }
}

impl NativeDevice {
    /// All cores, SIMD lanes where the kernels have them.
    #[must_use]
    pub fn new() -> Self {
        Self::with_mode(Mode::default())
    }

    /// A device that runs kernels in the given way.
    #[must_use]
    pub fn with_mode(mode: Mode) -> Self {
        let cores = if mode.parallel {
            std::thread::available_parallelism().map_or(1, usize::from)
        } else {
            1
        };
        let lanes = if mode.lanes && lanes::level().is_some() {
            "SIMD lanes"
        } else {
            "scalar"
        };
        let name = format!(
            "native ({}, {lanes}, {cores} threads)",
            std::env::consts::ARCH
        );
        Self {
            number: super::next_device(),
            name,
            mode,
            buffers: Vec::new(),
            textures: Vec::new(),
        }
    }

    fn memory(&mut self, what: &str, bytes: usize) -> Result<Memory> {
        Memory::zeroed(bytes).ok_or_else(|| DeviceError::OutOfMemory {
            during: format!("making {what} of {bytes} bytes"),
        })
    }

    fn stale(&self, what: String) -> DeviceError {
        DeviceError::Handle {
            what,
            device: self.name.clone(),
        }
    }

    fn buffer_at(&self, id: BufferId) -> Result<usize> {
        let index = id.index as usize;
        if id.device == self.number && self.buffers.get(index).is_some_and(Option::is_some) {
            Ok(index)
        } else {
            Err(self.stale(format!("buffer {}", id.index)))
        }
    }

    fn texture_at(&self, id: TextureId) -> Result<usize> {
        let index = id.index as usize;
        if id.device == self.number && self.textures.get(index).is_some_and(Option::is_some) {
            Ok(index)
        } else {
            Err(self.stale(format!("texture {}", id.index)))
        }
    }

    fn given<'a>(&self, bind: &Bind<'a>) -> Result<Given<'a>> {
        Ok(match bind {
            Bind::Buffer(id) => {
                let index = self.buffer_at(*id)?;
                let bytes = self.buffers[index].as_ref().map_or(0, |m| m.bytes);
                Given::Buffer {
                    id: id.index,
                    bytes,
                }
            }
            Bind::Bytes(b) => Given::Bytes(b),
            Bind::Texture(id) => {
                let index = self.texture_at(*id)?;
                let Some(texture) = &self.textures[index] else {
                    return Err(self.stale(format!("texture {}", id.index)));
                };
                Given::Texture {
                    id: id.index,
                    shape: texture.shape,
                }
            }
            Bind::Sampler(s) => Given::Sampler(*s),
        })
    }

    /// Runs a checked call. What is written was taken out of the device into `written`.
    fn call(
        &self,
        program: &Program<'_>,
        slots: &[Slot<'_>],
        args: &[Bind<'_>],
        count: usize,
        written: &mut [Written],
    ) -> Result<()> {
        let kernel = program.kernel;
        let run = program.native.ok_or_else(|| DeviceError::NoCode {
            kernel: kernel.name.clone(),
            wanted: "native code",
            device: self.name.clone(),
        })?;
        // Bytes of one call may lie anywhere.
        let aligned: Vec<Option<Memory>> = args
            .iter()
            .map(|bind| match bind {
                Bind::Bytes(b) => Memory::zeroed(b.len()).map(|mut m| {
                    m.get_mut().copy_from_slice(b);
                    m
                }),
                _ => None,
            })
            .collect();
        let mut taken = written.iter_mut();
        let mut call = Call {
            args: Vec::with_capacity(args.len()),
            constants: slots::constants(kernel, program.constants)?,
            mode: self.mode,
        };
        for ((slot, bind), aligned) in slots.iter().zip(args).zip(&aligned) {
            let arg = if slot.role.is_written() {
                match taken.next() {
                    Some(Written::Bytes(memory)) => Arg::BytesMut(memory.get_mut()),
                    Some(Written::Texture(shape, format, memory)) => Arg::TextureMut(TextureMut {
                        // Depth or layers: one of them is 1.
                        size: [shape.size[0], shape.size[1], shape.size[2] * shape.layers],
                        format: *format,
                        bytes: memory.get_mut(),
                    }),
                    None => return Err(slots::refuse(kernel, slot, "it is missing".into())),
                }
            } else {
                self.read_arg(kernel, slot, bind, aligned.as_ref(), count)?
            };
            call.args.push(arg);
        }
        run(&mut call).map_err(|source| DeviceError::Native {
            kernel: kernel.name.clone(),
            source,
        })
    }

    fn read_arg<'a>(
        &'a self,
        kernel: &Kernel,
        slot: &Slot<'_>,
        bind: &Bind<'_>,
        aligned: Option<&'a Memory>,
        count: usize,
    ) -> Result<Arg<'a>> {
        let gone = || slots::refuse(kernel, slot, "it is not there any more".into());
        Ok(match bind {
            Bind::Buffer(_) | Bind::Bytes(_) => {
                let memory = match bind {
                    Bind::Buffer(id) => self.buffers[self.buffer_at(*id)?].as_ref(),
                    _ => aligned,
                };
                let bytes = memory.ok_or_else(gone)?.get();
                let own = matches!(
                    slot.role,
                    Use::Element(_) | Use::Attribute(..) | Use::Varying(..)
                );
                match slot.role.element_bytes() {
                    Some(size) if own => Arg::Bytes(&bytes[..bytes.len().min(count * size)]),
                    _ => Arg::Bytes(bytes),
                }
            }
            Bind::Texture(id) => {
                let texture = self.textures[self.texture_at(*id)?]
                    .as_ref()
                    .ok_or_else(gone)?;
                Arg::Texture(TextureRef {
                    size: texture.shape.size,
                    levels: texture.shape.levels,
                    layers: texture.shape.layers,
                    samples: texture.shape.samples,
                    number: 0,
                    format: texture.shape.format.texel(),
                    bytes: texture.memory.get(),
                })
            }
            Bind::Sampler(s) => Arg::Sampler(*s),
        })
    }
}

/// What a call writes, taken out of the device while it runs.
enum Written {
    Bytes(Memory),
    Texture(TextureShape, TexelFormat, Memory),
}

impl Device for NativeDevice {
    fn name(&self) -> &str {
        &self.name
    }

    fn backend(&self) -> Backend {
        Backend::Native
    }

    fn buffer(&mut self, label: &str, bytes: usize) -> Result<BufferId> {
        let memory = self.memory(&format!("buffer `{label}`"), bytes)?;
        let index = self.buffers.len() as u32;
        self.buffers.push(Some(memory));
        Ok(BufferId {
            device: self.number,
            index,
        })
    }

    fn texture(&mut self, label: &str, shape: &TextureShape) -> Result<TextureId> {
        super::check_shape(label, shape)?;
        let memory = self.memory(&format!("texture `{label}`"), shape.bytes())?;
        let index = self.textures.len() as u32;
        self.textures.push(Some(Texture {
            shape: *shape,
            memory,
        }));
        Ok(TextureId {
            device: self.number,
            index,
        })
    }

    fn write_buffer(&mut self, buffer: BufferId, bytes: &[u8]) -> Result<()> {
        let index = self.buffer_at(buffer)?;
        let Some(memory) = &mut self.buffers[index] else {
            return Ok(());
        };
        super::check_write("buffer", bytes.len(), memory.bytes, false)?;
        memory.get_mut()[..bytes.len()].copy_from_slice(bytes);
        Ok(())
    }

    fn write_texture(&mut self, texture: TextureId, bytes: &[u8]) -> Result<()> {
        let index = self.texture_at(texture)?;
        let Some(texture) = &mut self.textures[index] else {
            return Ok(());
        };
        super::check_write("texture", bytes.len(), texture.memory.bytes, true)?;
        texture.memory.get_mut().copy_from_slice(bytes);
        Ok(())
    }

    fn clear_buffer(&mut self, buffer: BufferId) -> Result<()> {
        let index = self.buffer_at(buffer)?;
        if let Some(memory) = &mut self.buffers[index] {
            memory.get_mut().fill(0);
        }
        Ok(())
    }

    fn clear_texture(&mut self, texture: TextureId, value: Vec4) -> Result<()> {
        let index = self.texture_at(texture)?;
        if let Some(texture) = &mut self.textures[index] {
            super::check_clear("texture", &texture.shape, value)?;
            let filled = super::filled(&texture.shape, value);
            texture.memory.get_mut().copy_from_slice(&filled);
        }
        Ok(())
    }

    fn copy_to_level(&mut self, from: TextureId, to: TextureId, level: u32) -> Result<()> {
        let (source, target) = (self.texture_at(from)?, self.texture_at(to)?);
        let (Some(one), Some(other)) = (&self.textures[source], &self.textures[target]) else {
            return Ok(());
        };
        super::check_copy(&one.shape, &other.shape, level)?;
        // A texture is no level of itself unless it is the only one.
        if source == target {
            return Ok(());
        }
        let copied = self.textures[source].take();
        if let (Some(from), Some(to)) = (&copied, &mut self.textures[target]) {
            let start = to.shape.bytes_before(level);
            let bytes = from.memory.get();
            to.memory.get_mut()[start..start + bytes.len()].copy_from_slice(bytes);
        }
        self.textures[source] = copied;
        Ok(())
    }

    fn read_buffer(&mut self, buffer: BufferId) -> Result<Vec<u8>> {
        let index = self.buffer_at(buffer)?;
        Ok(self.buffers[index]
            .as_ref()
            .map_or_else(Vec::new, |m| m.get().to_vec()))
    }

    fn read_texture(&mut self, texture: TextureId) -> Result<Vec<u8>> {
        let index = self.texture_at(texture)?;
        Ok(self.textures[index]
            .as_ref()
            .map_or_else(Vec::new, |t| t.memory.get().to_vec()))
    }

    fn free_buffer(&mut self, buffer: BufferId) -> Result<()> {
        let index = self.buffer_at(buffer)?;
        self.buffers[index] = None;
        Ok(())
    }

    fn free_texture(&mut self, texture: TextureId) -> Result<()> {
        let index = self.texture_at(texture)?;
        self.textures[index] = None;
        Ok(())
    }

    fn dispatch(&mut self, program: &Program<'_>, args: &[Bind<'_>]) -> Result<()> {
        let kernel = program.kernel;
        let slots = slots::slots(kernel);
        let given = args
            .iter()
            .map(|b| self.given(b))
            .collect::<Result<Vec<_>>>()?;
        slots::check(kernel, &slots, &given)?;
        let extent = match extent::extent(kernel, &slots, &given)? {
            Extent::Known(extent) => extent,
            Extent::InBuffer {
                slot,
                offset,
                dimensions,
            } => {
                let Bind::Buffer(id) = args[slot] else {
                    // The checks let no other kind through.
                    return Ok(());
                };
                let bytes = self.buffers[self.buffer_at(id)?].as_ref();
                let bytes = bytes.map_or(&[][..], Memory::get);
                let extent = extent::in_bytes(bytes, offset, dimensions);
                extent::check_count(kernel, extent)?;
                extent
            }
        };
        if extent.contains(&0) {
            return Ok(());
        }
        let mut written = Vec::new();
        for (_, bind) in slots.iter().zip(args).filter(|(s, _)| s.role.is_written()) {
            written.push(match bind {
                Bind::Buffer(id) => {
                    let memory = self.buffers[id.index as usize].take().unwrap_or_default();
                    Written::Bytes(memory)
                }
                Bind::Texture(id) => {
                    let Some(t) = self.textures[id.index as usize].take() else {
                        continue;
                    };
                    Written::Texture(t.shape, t.shape.format.texel(), t.memory)
                }
                // The checks let no other kind through.
                Bind::Bytes(_) | Bind::Sampler(_) => continue,
            });
        }
        let count = extent.iter().map(|n| *n as usize).product();
        let result = self.call(program, &slots, args, count, &mut written);
        // Put back also after a failure: the buffers are still the caller's.
        let binds = slots
            .iter()
            .zip(args)
            .filter(|(s, _)| s.role.is_written())
            .map(|(_, b)| b);
        for (bind, written) in binds.zip(written) {
            match (bind, written) {
                (Bind::Buffer(id), Written::Bytes(memory)) => {
                    self.buffers[id.index as usize] = Some(memory);
                }
                (Bind::Texture(id), Written::Texture(shape, _, memory)) => {
                    self.textures[id.index as usize] = Some(Texture { shape, memory });
                }
                _ => {}
            }
        }
        result
    }

    fn draw(&mut self, pass: &Pass<'_>) -> Result<()> {
        Err(DeviceError::Pass {
            pass: pass.label.into(),
            problem: "the native device has no rasteriser; cast rays, or run the stages' kernels \
                      over arrays with `dispatch`"
                .into(),
        })
    }

    fn wait(&mut self) -> Result<()> {
        Ok(())
    }
}
