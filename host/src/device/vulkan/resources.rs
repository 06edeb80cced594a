//! Buffers and textures of the Vulkan device, and what goes to and from them.

use hankel_dsl::glam::Vec4;
use hankel_dsl::native::describe::{Channels, TexelFormat, TextureKind};
use hankel_dsl::native::{Address, Compare, Filter, Sampler};

use super::super::error::{DeviceError, Result};
use super::super::{Format, TextureId, TextureShape};
use super::{VulkanDevice, own};

/// Rows of a texture start at multiples of this in a buffer that it is copied to.
const ROW: usize = wgpu::COPY_BYTES_PER_ROW_ALIGNMENT as usize;

/// A buffer.
#[derive(Debug)]
pub struct Memory {
    pub buffer: wgpu::Buffer,
    /// Bytes that were asked for.
    pub bytes: usize,
    label: String,
}

impl Memory {
    /// Bytes that it really has: no less than a uniform's, whose end is padded.
    pub fn physical(&self) -> u64 {
        padded(self.bytes)
    }

    /// Name for messages.
    pub fn what(&self) -> String {
        format!("buffer `{}`", self.label)
    }
}

/// A texture.
#[derive(Debug)]
pub struct Texture {
    pub texture: wgpu::Texture,
    /// The first layer of level 0: what is drawn into and written.
    pub view: wgpu::TextureView,
    pub shape: TextureShape,
    /// What the adapter lets it be used for.
    pub usage: wgpu::TextureUsages,
    /// Whether a linear sampler may be used on it.
    pub filterable: bool,
    label: String,
}

impl Texture {
    /// Name for messages.
    pub fn what(&self) -> String {
        format!("texture `{}`", self.label)
    }

    /// Whether a pass may have it as its target.
    pub fn is_drawn_into(&self) -> bool {
        self.usage.contains(wgpu::TextureUsages::RENDER_ATTACHMENT)
    }
}

fn padded(bytes: usize) -> u64 {
    (bytes as u64).next_multiple_of(16).max(16)
}

/// The format in wgpu.
pub fn format(format: Format) -> wgpu::TextureFormat {
    macro_rules! by_name {
        ($texel:expr; $($name:ident)*) => {
            match $texel {
                $(TexelFormat::$name => wgpu::TextureFormat::$name,)*
                TexelFormat::Rgb10A2Unorm => wgpu::TextureFormat::Rgb10a2Unorm,
                TexelFormat::Rgb10A2Uint => wgpu::TextureFormat::Rgb10a2Uint,
                TexelFormat::Rg11B10Ufloat => wgpu::TextureFormat::Rg11b10Ufloat,
            }
        };
    }
    match format {
        Format::Depth32 => wgpu::TextureFormat::Depth32Float,
        Format::Texel(texel) => by_name! { texel;
            R32Float Rg32Float Rgba32Float R16Float Rg16Float Rgba16Float
            R16Unorm Rg16Unorm Rgba16Unorm R8Unorm Rg8Unorm Rgba8Unorm
            R16Snorm Rg16Snorm Rgba16Snorm R8Snorm Rg8Snorm Rgba8Snorm
            R32Uint Rg32Uint Rgba32Uint R16Uint Rg16Uint Rgba16Uint R8Uint Rg8Uint Rgba8Uint
            R32Sint Rg32Sint Rgba32Sint R16Sint Rg16Sint Rgba16Sint R8Sint Rg8Sint Rgba8Sint
        },
    }
}

/// How a kernel sees a texture.
pub fn view_dimension(kind: TextureKind) -> wgpu::TextureViewDimension {
    match (kind.dimensions(), kind.is_cube(), kind.is_array()) {
        (1, ..) => wgpu::TextureViewDimension::D1,
        (3, ..) => wgpu::TextureViewDimension::D3,
        (_, false, false) => wgpu::TextureViewDimension::D2,
        (_, false, true) => wgpu::TextureViewDimension::D2Array,
        (_, true, false) => wgpu::TextureViewDimension::Cube,
        (_, true, true) => wgpu::TextureViewDimension::CubeArray,
    }
}

/// A level's texels and layers.
fn extent(shape: &TextureShape, level: u32) -> wgpu::Extent3d {
    let [width, height, depth] = shape.level_size(level);
    wgpu::Extent3d {
        width,
        height,
        // One of them is 1.
        depth_or_array_layers: depth * shape.layers,
    }
}

/// A level, to be copied.
fn level_of(texture: &wgpu::Texture, mip_level: u32) -> wgpu::TexelCopyTextureInfo<'_> {
    wgpu::TexelCopyTextureInfo {
        mip_level,
        ..texture.as_image_copy()
    }
}

/// A view of one layer of a level.
fn layer_of(texture: &wgpu::Texture, level: u32, layer: u32) -> wgpu::TextureView {
    let layers = texture.dimension() == wgpu::TextureDimension::D2;
    texture.create_view(&wgpu::TextureViewDescriptor {
        base_mip_level: level,
        mip_level_count: Some(1),
        base_array_layer: layer,
        array_layer_count: layers.then_some(1),
        ..Default::default()
    })
}

impl VulkanDevice {
    pub(super) fn make_buffer(&self, label: &str, bytes: usize) -> Result<Memory> {
        self.limit(
            format!("the size of buffer `{label}` in bytes"),
            bytes as u64,
            self.limits.max_buffer_size,
        )?;
        let usage = wgpu::BufferUsages::STORAGE
            | wgpu::BufferUsages::UNIFORM
            | wgpu::BufferUsages::VERTEX
            | wgpu::BufferUsages::INDEX
            | wgpu::BufferUsages::COPY_SRC
            | wgpu::BufferUsages::COPY_DST;
        let during = || format!("making buffer `{label}` of {bytes} bytes");
        let buffer = self.guarded(&during, |device| {
            device.create_buffer(&wgpu::BufferDescriptor {
                label: Some(label),
                size: padded(bytes),
                usage,
                mapped_at_creation: false,
            })
        })?;
        Ok(Memory {
            buffer,
            bytes,
            label: label.into(),
        })
    }

    pub(super) fn upload(&self, memory: &Memory, bytes: &[u8]) -> Result<()> {
        let during = || format!("writing {}", memory.what());
        let whole = bytes.len() / 4 * 4;
        self.guarded(&during, |_| {
            if whole > 0 {
                self.queue.write_buffer(&memory.buffer, 0, &bytes[..whole]);
            }
            if whole < bytes.len() {
                // The last word is padded: wgpu writes whole words.
                let mut word = [0; 4];
                word[..bytes.len() - whole].copy_from_slice(&bytes[whole..]);
                self.queue.write_buffer(&memory.buffer, whole as u64, &word);
            }
        })
    }

    /// Reads the first `size` bytes of a buffer, `size` a multiple of 4.
    pub(super) fn download(&self, from: &wgpu::Buffer, size: u64, what: &str) -> Result<Vec<u8>> {
        let during = || format!("reading {what}");
        let staging = self.guarded(&during, |device| {
            let staging = device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("read"),
                size,
                usage: wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ,
                mapped_at_creation: false,
            });
            let mut encoder = device.create_command_encoder(&Default::default());
            encoder.copy_buffer_to_buffer(from, 0, &staging, 0, size);
            self.queue.submit([encoder.finish()]);
            staging
        })?;
        self.map(&staging, &during)
    }

    /// Waits for a staging buffer and takes its bytes.
    fn map(&self, staging: &wgpu::Buffer, during: &dyn Fn() -> String) -> Result<Vec<u8>> {
        let refused = |detail: String| DeviceError::Refused {
            during: during(),
            detail,
        };
        let (send, receive) = std::sync::mpsc::channel();
        self.guarded(during, |_| {
            staging.slice(..).map_async(wgpu::MapMode::Read, move |r| {
                // The receiver outlives the wait below.
                let _ = send.send(r);
            });
        })?;
        self.finish(during)?;
        match receive.try_recv() {
            Ok(Ok(())) => {}
            Ok(Err(e)) => return Err(refused(e.to_string())),
            Err(_) => return Err(refused("the driver never finished".into())),
        }
        let bytes = staging
            .slice(..)
            .get_mapped_range()
            .map_err(|e| refused(e.to_string()))?;
        Ok(bytes.to_vec())
    }

    pub(super) fn make_texture(&self, label: &str, shape: &TextureShape) -> Result<Texture> {
        super::super::check_shape(label, shape)?;
        let limit = match shape.dimensions {
            1 => self.limits.max_texture_dimension_1d,
            2 => self.limits.max_texture_dimension_2d,
            _ => self.limits.max_texture_dimension_3d,
        };
        self.limit(
            format!("the layers of texture `{label}`"),
            shape.layers.into(),
            self.limits.max_texture_array_layers.into(),
        )?;
        for (axis, n) in ["width", "height", "depth"].into_iter().zip(shape.size) {
            self.limit(
                format!("the {axis} of texture `{label}`"),
                n.into(),
                limit.into(),
            )?;
        }
        let missing = |feature: &str| DeviceError::Missing {
            device: self.name.clone(),
            feature: format!("{} {feature}", shape.format.name()),
            what: format!("texture `{label}`"),
        };
        let format = format(shape.format);
        if !self.device.features().contains(format.required_features()) {
            return Err(missing("textures"));
        }
        let can = self.adapter.get_texture_format_features(format);
        let mut usage =
            wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::RENDER_ATTACHMENT;
        if shape.samples > 1 {
            if !can
                .flags
                .contains(wgpu::TextureFormatFeatureFlags::MULTISAMPLE_X4)
            {
                return Err(missing("textures with 4 samples"));
            }
        } else {
            usage |= wgpu::TextureUsages::COPY_SRC
                | wgpu::TextureUsages::COPY_DST
                | wgpu::TextureUsages::STORAGE_BINDING;
        }
        if shape.dimensions != 2 {
            usage -= wgpu::TextureUsages::RENDER_ATTACHMENT;
        }
        usage &= can.allowed_usages;
        let during = || {
            format!(
                "making texture `{label}` of {:?} {} texels",
                shape.size,
                shape.format.name()
            )
        };
        let (texture, view) = self.guarded(&during, |device| {
            let texture = device.create_texture(&wgpu::TextureDescriptor {
                label: Some(label),
                size: extent(shape, 0),
                mip_level_count: shape.levels,
                sample_count: shape.samples,
                dimension: match shape.dimensions {
                    1 => wgpu::TextureDimension::D1,
                    2 => wgpu::TextureDimension::D2,
                    _ => wgpu::TextureDimension::D3,
                },
                format,
                usage,
                view_formats: &[],
            });
            let view = layer_of(&texture, 0, 0);
            (texture, view)
        })?;
        let float = wgpu::TextureSampleType::Float { filterable: true };
        let filterable = shape.samples == 1
            && format.sample_type(None, Some(self.device.features())) == Some(float);
        Ok(Texture {
            texture,
            view,
            shape: *shape,
            usage,
            filterable,
            label: label.into(),
        })
    }

    pub(super) fn upload_texels(&self, texture: &Texture, bytes: &[u8]) -> Result<()> {
        let shape = &texture.shape;
        self.guarded(&|| format!("writing {}", texture.what()), |_| {
            for level in 0..shape.levels {
                let [width, height, _] = shape.level_size(level);
                let layout = wgpu::TexelCopyBufferLayout {
                    offset: shape.bytes_before(level) as u64,
                    bytes_per_row: Some(width * shape.format.texel().bytes() as u32),
                    rows_per_image: Some(height),
                };
                self.queue.write_texture(
                    level_of(&texture.texture, level),
                    bytes,
                    layout,
                    extent(shape, level),
                );
            }
        })
    }

    /// Copies a texture with one level into a level of another one.
    pub(super) fn copy_texels(&self, from: &Texture, to: &Texture, level: u32) -> Result<()> {
        let during = || format!("copying {} to level {level} of {}", from.what(), to.what());
        self.guarded(&during, |device| {
            let mut encoder = device.create_command_encoder(&Default::default());
            self.timed(&mut encoder, |it| {
                it.copy_texture_to_texture(
                    from.texture.as_image_copy(),
                    level_of(&to.texture, level),
                    extent(&from.shape, 0),
                );
            });
            self.queue.submit([encoder.finish()]);
        })
    }

    /// Fills a texture that can be drawn into, by passes that draw nothing.
    pub(super) fn fill(&self, texture: &Texture, value: Vec4) -> Result<()> {
        let shape = &texture.shape;
        let [r, g, b, a] = value.to_array().map(f64::from);
        self.guarded(&|| format!("clearing {}", texture.what()), |device| {
            let mut encoder = device.create_command_encoder(&Default::default());
            self.timed(&mut encoder, |encoder| {
                for level in 0..shape.levels {
                    for layer in 0..shape.layers {
                        let view = layer_of(&texture.texture, level, layer);
                        let colour = wgpu::RenderPassColorAttachment {
                            view: &view,
                            depth_slice: None,
                            resolve_target: None,
                            ops: wgpu::Operations {
                                load: wgpu::LoadOp::Clear(wgpu::Color { r, g, b, a }),
                                store: wgpu::StoreOp::Store,
                            },
                        };
                        let depth = wgpu::RenderPassDepthStencilAttachment {
                            view: &view,
                            depth_ops: Some(wgpu::Operations {
                                load: wgpu::LoadOp::Clear(value.x),
                                store: wgpu::StoreOp::Store,
                            }),
                            stencil_ops: None,
                        };
                        let is_depth = shape.format == Format::Depth32;
                        let colours = if is_depth { vec![] } else { vec![Some(colour)] };
                        encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                            label: Some("clear"),
                            color_attachments: &colours,
                            depth_stencil_attachment: is_depth.then_some(depth),
                            ..Default::default()
                        });
                    }
                }
            });
            self.queue.submit([encoder.finish()]);
        })
    }

    pub(super) fn download_texels(&self, texture: &Texture) -> Result<Vec<u8>> {
        let shape = &texture.shape;
        // Of each level: where it begins in the staging buffer, bytes of a row, there and padded.
        let mut size = 0;
        let levels: Vec<(usize, usize, usize)> = (0..shape.levels)
            .map(|level| {
                let [width, height, depth] = shape.level_size(level).map(|n| n as usize);
                let row = width * shape.format.texel().bytes();
                let pitch = row.next_multiple_of(ROW);
                let start = size;
                size += pitch * height * depth * shape.layers as usize;
                (start, row, pitch)
            })
            .collect();
        let during = || format!("reading {}", texture.what());
        let staging = self.guarded(&during, |device| {
            let staging = device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("read"),
                size: size as u64,
                usage: wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ,
                mapped_at_creation: false,
            });
            let mut encoder = device.create_command_encoder(&Default::default());
            for (level, &(start, _, pitch)) in (0..).zip(&levels) {
                encoder.copy_texture_to_buffer(
                    level_of(&texture.texture, level),
                    wgpu::TexelCopyBufferInfo {
                        buffer: &staging,
                        layout: wgpu::TexelCopyBufferLayout {
                            offset: start as u64,
                            bytes_per_row: Some(pitch as u32),
                            rows_per_image: Some(shape.level_size(level)[1]),
                        },
                    },
                    extent(shape, level),
                );
            }
            self.queue.submit([encoder.finish()]);
            staging
        })?;
        let padded = self.map(&staging, &during)?;
        let ends = levels.iter().skip(1).map(|it| it.0).chain([padded.len()]);
        Ok(levels
            .iter()
            .zip(ends)
            .flat_map(|(&(start, row, pitch), end)| {
                padded[start..end]
                    .chunks_exact(pitch)
                    .flat_map(move |r| &r[..row])
            })
            .copied()
            .collect())
    }

    pub(super) fn sampler(&mut self, sampler: Sampler) -> Result<wgpu::Sampler> {
        if let Some(made) = self.samplers.get(&sampler) {
            return Ok(made.clone());
        }
        let filter = |it: Filter| match it {
            Filter::Nearest => wgpu::FilterMode::Nearest,
            Filter::Linear => wgpu::FilterMode::Linear,
        };
        let [u, v, w] = sampler.address.map(|it| match it {
            Address::ClampToEdge => wgpu::AddressMode::ClampToEdge,
            Address::Repeat => wgpu::AddressMode::Repeat,
            Address::MirrorRepeat => wgpu::AddressMode::MirrorRepeat,
        });
        let made = self.guarded(&|| "making a sampler".into(), |device| {
            device.create_sampler(&wgpu::SamplerDescriptor {
                label: None,
                address_mode_u: u,
                address_mode_v: v,
                address_mode_w: w,
                mag_filter: filter(sampler.magnify),
                min_filter: filter(sampler.minify),
                mipmap_filter: match sampler.mip {
                    Filter::Nearest => wgpu::MipmapFilterMode::Nearest,
                    Filter::Linear => wgpu::MipmapFilterMode::Linear,
                },
                compare: sampler.compare.map(|it| match it {
                    Compare::Never => wgpu::CompareFunction::Never,
                    Compare::Less => wgpu::CompareFunction::Less,
                    Compare::Equal => wgpu::CompareFunction::Equal,
                    Compare::LessEqual => wgpu::CompareFunction::LessEqual,
                    Compare::Greater => wgpu::CompareFunction::Greater,
                    Compare::NotEqual => wgpu::CompareFunction::NotEqual,
                    Compare::GreaterEqual => wgpu::CompareFunction::GreaterEqual,
                    Compare::Always => wgpu::CompareFunction::Always,
                }),
                anisotropy_clamp: sampler.anisotropy.max(1),
                ..Default::default()
            })
        })?;
        self.samplers.insert(sampler, made.clone());
        Ok(made)
    }

    /// Draws texels from a buffer where copies do not reach: several samples, and depths.
    pub(super) fn upload_samples(&mut self, texture: TextureId, bytes: &[u8]) -> Result<()> {
        let (texture, shape, what) = {
            let t = self.image(texture)?;
            if !t.is_drawn_into() {
                return Err(DeviceError::Missing {
                    device: self.name.clone(),
                    feature: format!("drawing into {}", shape_name(&t.shape)),
                    what: t.what(),
                });
            }
            (t.texture.clone(), t.shape, t.what())
        };
        let depths = || bytes.chunks_exact(4).map(|d| [d[0], d[1], d[2], d[3]]);
        if shape.format == Format::Depth32
            && depths().any(|d| !(0.0..=1.0).contains(&f32::from_le_bytes(d)))
        {
            return Err(DeviceError::Transfer {
                what,
                problem: "depths lie between 0 and 1".into(),
            });
        }
        for level in 0..shape.levels {
            let one = TextureShape {
                size: shape.level_size(level),
                levels: 1,
                layers: 1,
                ..shape
            };
            let level_bytes = &bytes[shape.bytes_before(level)..];
            for (layer, bytes) in (0..shape.layers).zip(level_bytes.chunks_exact(one.bytes())) {
                let view = layer_of(&texture, level, layer);
                self.draw_samples(&view, &one, &what, bytes)?;
            }
        }
        Ok(())
    }

    fn draw_samples(
        &self,
        view: &wgpu::TextureView,
        shape: &TextureShape,
        what: &str,
        bytes: &[u8],
    ) -> Result<()> {
        let values = to_vec4(shape.format, bytes);
        let memory = self.make_buffer("samples", values.len())?;
        self.upload(&memory, &values)?;
        let depth = shape.format == Format::Depth32;
        let (result, scalar) = if depth {
            ("@builtin(frag_depth) f32", ".x")
        } else {
            match shape.format.texel().numbers() {
                Channels::Float => ("@location(0) vec4<f32>", ""),
                Channels::Uint => ("@location(0) vec4<u32>", ""),
                Channels::Sint => ("@location(0) vec4<i32>", ""),
            }
        };
        let ty = channel_type(shape.format);
        let text = format!(
            "@group(0) @binding(0) var<storage, read> samples: array<vec4<{ty}>>;\n\
             @vertex fn corner(@builtin(vertex_index) i: u32) -> @builtin(position) vec4<f32> {{\n\
             return vec4<f32>(f32(i & 1u) * 4.0 - 1.0, f32(i >> 1u) * 4.0 - 1.0, 0.0, 1.0);\n\
             }}\n\
             @fragment fn fill(@builtin(position) at: vec4<f32>, @builtin(sample_index) s: u32) -> {result} {{\n\
             let i = (u32(at.y) * {width}u + u32(at.x)) * {samples}u + s;\n\
             return samples[i]{scalar};\n\
             }}\n",
            width = shape.size[0],
            samples = shape.samples,
        );
        let format = format(shape.format);
        self.guarded(&|| format!("writing {what}"), |device| {
            let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
                label: Some("samples"),
                source: wgpu::ShaderSource::Wgsl(text.into()),
            });
            let target = [Some(wgpu::ColorTargetState {
                format,
                blend: None,
                write_mask: wgpu::ColorWrites::ALL,
            })];
            let pipeline = device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
                label: Some("samples"),
                layout: None,
                vertex: wgpu::VertexState {
                    module: &module,
                    entry_point: Some("corner"),
                    compilation_options: Default::default(),
                    buffers: &[],
                },
                primitive: Default::default(),
                depth_stencil: depth.then(|| wgpu::DepthStencilState {
                    format,
                    depth_write_enabled: Some(true),
                    depth_compare: Some(wgpu::CompareFunction::Always),
                    stencil: Default::default(),
                    bias: Default::default(),
                }),
                multisample: wgpu::MultisampleState {
                    count: shape.samples,
                    ..Default::default()
                },
                fragment: Some(wgpu::FragmentState {
                    module: &module,
                    entry_point: Some("fill"),
                    compilation_options: Default::default(),
                    targets: if depth { &[] } else { &target },
                }),
                multiview_mask: None,
                cache: None,
            });
            let group = device.create_bind_group(&wgpu::BindGroupDescriptor {
                label: Some("samples"),
                layout: &pipeline.get_bind_group_layout(0),
                entries: &[wgpu::BindGroupEntry {
                    binding: 0,
                    resource: memory.buffer.as_entire_binding(),
                }],
            });
            let mut encoder = device.create_command_encoder(&Default::default());
            {
                let colour = [Some(wgpu::RenderPassColorAttachment {
                    view,
                    depth_slice: None,
                    resolve_target: None,
                    ops: wgpu::Operations {
                        load: wgpu::LoadOp::Clear(wgpu::Color::TRANSPARENT),
                        store: wgpu::StoreOp::Store,
                    },
                })];
                let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                    label: Some("samples"),
                    color_attachments: if depth { &[] } else { &colour },
                    depth_stencil_attachment: depth.then_some(
                        wgpu::RenderPassDepthStencilAttachment {
                            view,
                            depth_ops: Some(wgpu::Operations {
                                load: wgpu::LoadOp::Clear(0.0),
                                store: wgpu::StoreOp::Store,
                            }),
                            stencil_ops: None,
                        },
                    ),
                    ..Default::default()
                });
                pass.set_pipeline(&pipeline);
                pass.set_bind_group(0, &group, &[]);
                pass.draw(0..3, 0..1);
            }
            self.queue.submit([encoder.finish()]);
        })
    }

    /// Reads the samples of a multisampled texture through a compute shader.
    pub(super) fn download_samples(&mut self, texture: TextureId) -> Result<Vec<u8>> {
        let (view, shape, what) = {
            let t = self.image(texture)?;
            (t.view.clone(), t.shape, t.what())
        };
        let values = shape.bytes() / shape.format.texel().bytes() * 16;
        let memory = self.make_buffer("samples", values)?;
        let ty = channel_type(shape.format);
        let (kind, load) = if shape.format == Format::Depth32 {
            (
                "texture_depth_multisampled_2d".to_string(),
                "vec4<f32>(textureLoad(image, at, s), 0.0, 0.0, 1.0)",
            )
        } else {
            (
                format!("texture_multisampled_2d<{ty}>"),
                "textureLoad(image, at, s)",
            )
        };
        let text = format!(
            "@group(0) @binding(0) var image: {kind};\n\
             @group(0) @binding(1) var<storage, read_write> samples: array<vec4<{ty}>>;\n\
             @compute @workgroup_size(8, 8) fn take(@builtin(global_invocation_id) id: vec3<u32>) {{\n\
             let size = textureDimensions(image);\n\
             if (id.x >= size.x || id.y >= size.y) {{ return; }}\n\
             let at = vec2<i32>(id.xy);\n\
             for (var s = 0; s < {samples}; s++) {{\n\
             samples[(id.y * size.x + id.x) * {samples}u + u32(s)] = {load};\n\
             }}\n\
             }}\n",
            samples = shape.samples,
        );
        self.guarded(&|| format!("reading {what}"), |device| {
            let pipeline = own::pipeline(device, "samples", text);
            let resources = [
                wgpu::BindingResource::TextureView(&view),
                memory.buffer.as_entire_binding(),
            ];
            let [x, y, _] = shape.size;
            let groups = [x.div_ceil(8), y.div_ceil(8), 1];
            self.run_own(device, "samples", &pipeline, resources, groups);
        })?;
        let values = self.download(&memory.buffer, memory.physical(), &what)?;
        Ok(from_vec4(shape.format, &values[..memory.bytes]))
    }
}

/// A shape for messages.
fn shape_name(shape: &TextureShape) -> String {
    format!("{} with {} samples", shape.format.name(), shape.samples)
}

/// WGSL's type of a channel.
fn channel_type(format: Format) -> &'static str {
    match format.texel().numbers() {
        Channels::Float => "f32",
        Channels::Uint => "u32",
        Channels::Sint => "i32",
    }
}

/// Texels as four 32-bit channels each.
fn to_vec4(format: Format, bytes: &[u8]) -> Vec<u8> {
    let texel = format.texel();
    let wide = if texel.is_integer() {
        TexelFormat::Rgba32Uint
    } else {
        TexelFormat::Rgba32Float
    };
    let mut out = vec![0; bytes.len() / texel.bytes() * 16];
    for (from, to) in bytes
        .chunks_exact(texel.bytes())
        .zip(out.chunks_exact_mut(16))
    {
        if texel.is_integer() {
            wide.store_integer(to, texel.load_integer(from));
        } else {
            wide.store(to, texel.load(from));
        }
    }
    out
}

/// The inverse of [`to_vec4`].
fn from_vec4(format: Format, values: &[u8]) -> Vec<u8> {
    let texel = format.texel();
    let wide = if texel.is_integer() {
        TexelFormat::Rgba32Uint
    } else {
        TexelFormat::Rgba32Float
    };
    let mut out = vec![0; values.len() / 16 * texel.bytes()];
    for (from, to) in values
        .chunks_exact(16)
        .zip(out.chunks_exact_mut(texel.bytes()))
    {
        if texel.is_integer() {
            texel.store_integer(to, wide.load_integer(from));
        } else {
            texel.store(to, wide.load(from));
        }
    }
    out
}
