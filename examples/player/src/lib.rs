//! A player of frames: runs what `frame.json` describes, with wgpu and the WGSL beside it. It knows nothing
//! of Hankel; <https://docs.rs/wgpu> and the schema of `frame.json` are all it takes to read it.

mod words;

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use serde_json::Value;

use words::{Texel, filter, texel, vertex_format};

/// What can go wrong, in words.
pub type Result<T> = std::result::Result<T, String>;

/// A member of an object, or the path that leads nowhere.
fn at<'v>(value: &'v Value, name: &str) -> Result<&'v Value> {
    value
        .get(name)
        .ok_or_else(|| format!("frame.json: there is no `{name}` in {value:.60}"))
}

fn text<'v>(value: &'v Value, name: &str) -> Result<&'v str> {
    let member = at(value, name)?;
    member
        .as_str()
        .ok_or_else(|| format!("frame.json: `{name}` is no text"))
}

fn whole(value: &Value) -> Result<u32> {
    let number = value.as_u64().and_then(|number| u32::try_from(number).ok());
    number.ok_or_else(|| format!("frame.json: {value} is no whole number"))
}

fn number(value: &Value, name: &str) -> Result<u32> {
    whole(at(value, name)?)
}

fn list<'v>(value: &'v Value, name: &str) -> Result<&'v Vec<Value>> {
    let member = at(value, name)?;
    member
        .as_array()
        .ok_or_else(|| format!("frame.json: `{name}` is no list"))
}

fn three(value: &Value, name: &str) -> Result<[u32; 3]> {
    match list(value, name)?.as_slice() {
        [x, y, z] => Ok([whole(x)?, whole(y)?, whole(z)?]),
        _ => Err(format!("frame.json: `{name}` has not three numbers")),
    }
}

/// Red, green, blue, alpha.
fn colour(value: &Value) -> Result<wgpu::Color> {
    let channel = |i: usize| {
        let number = value.get(i).and_then(Value::as_f64);
        number.ok_or_else(|| format!("frame.json: {value} is no colour"))
    };
    Ok(wgpu::Color {
        r: channel(0)?,
        g: channel(1)?,
        b: channel(2)?,
        a: channel(3)?,
    })
}

fn members<'v>(
    value: &'v Value,
    name: &str,
) -> Result<impl Iterator<Item = (&'v String, &'v Value)>> {
    let member = at(value, name)?;
    let object = member.as_object();
    Ok(object
        .ok_or_else(|| format!("frame.json: `{name}` is no object"))?
        .iter())
}

fn find<'m, T>(all: &'m BTreeMap<String, T>, name: &str) -> Result<&'m T> {
    all.get(name)
        .ok_or_else(|| format!("frame.json: nothing is named `{name}`"))
}

/// A texture, and what its texels are.
struct Texture {
    texture: wgpu::Texture,
    texel: Texel,
}

impl Texture {
    fn view(&self) -> wgpu::TextureView {
        self.texture.create_view(&Default::default())
    }
}

/// A pass, ready to run.
enum Pass {
    Clear {
        buffers: Vec<String>,
        textures: Vec<String>,
        /// What textures are filled with, if that is not zeros.
        value: Option<wgpu::Color>,
    },
    /// Textures that are copied into the mip levels of one.
    Levels {
        texture: String,
        levels: Vec<String>,
    },
    Compute {
        pipeline: wgpu::ComputePipeline,
        groups: Vec<(u32, wgpu::BindGroup)>,
        workgroups: [u32; 3],
    },
    Draw {
        pipeline: wgpu::RenderPipeline,
        groups: Vec<(u32, wgpu::BindGroup)>,
        attributes: Vec<String>,
        /// Without them, the vertices in their order.
        indices: Option<String>,
        count: u32,
        colours: Vec<Colour>,
        depth: Option<Depth>,
    },
}

struct Colour {
    view: wgpu::TextureView,
    resolve: Option<wgpu::TextureView>,
    clear: wgpu::Color,
}

struct Depth {
    view: wgpu::TextureView,
    /// Without one, what is there stays.
    clear: Option<f32>,
    store: bool,
}

/// A frame on a device.
pub struct Player {
    device: wgpu::Device,
    queue: wgpu::Queue,
    frame: Value,
    buffers: BTreeMap<String, wgpu::Buffer>,
    textures: BTreeMap<String, Texture>,
    passes: Vec<Pass>,
}

/// A picture in 8-bit sRGB, rows from the top.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Picture {
    /// Pixels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Red, green, blue of each pixel.
    pub pixels: Vec<u8>,
}

impl Player {
    /// Reads a frame from the folder that `hankel build --scene` wrote, with WGSL among its languages, and
    /// makes its resources and pipelines.
    ///
    /// # Errors
    /// No device, a file that is not there or says something else than the schema, a shader that has no
    /// WGSL, a feature that the device lacks.
    pub fn open(folder: &Path) -> Result<Self> {
        let file = |name: &str| {
            let path = folder.join(name);
            fs::read(&path).map_err(|e| format!("{}: {e}", path.display()))
        };
        let frame: Value = serde_json::from_slice(&file("frame.json")?)
            .map_err(|e| format!("{}: {e}", folder.join("frame.json").display()))?;
        let format = number(&frame, "format")?;
        if format != 1 {
            return Err(format!(
                "frame.json has format {format}: this player reads 1"
            ));
        }
        let (device, queue) = device()?;
        // What wgpu has against a frame is told as an error, at the end of this function.
        let scope = device.push_error_scope(wgpu::ErrorFilter::Validation);

        let mut buffers = BTreeMap::new();
        for (name, it) in members(&frame, "buffers")? {
            let contents = match it.get("contents").and_then(Value::as_str) {
                Some(path) => file(path)?,
                None => Vec::new(),
            };
            let buffer = device.create_buffer(&wgpu::BufferDescriptor {
                label: Some(name),
                // wgpu copies words.
                size: u64::from(number(it, "bytes")?).next_multiple_of(4),
                usage: words::buffer_usages(list(it, "usage")?)?,
                mapped_at_creation: false,
            });
            queue.write_buffer(&buffer, 0, &contents);
            buffers.insert(name.clone(), buffer);
        }

        let picture = text(&frame, "picture")?;
        let mut textures = BTreeMap::new();
        for (name, it) in members(&frame, "textures")? {
            let texel = texel(text(it, "format")?)?;
            let [width, height, depth] = three(it, "size")?;
            let dimensions = number(it, "dimensions")?;
            let mut usage = words::texture_usages(list(it, "usage")?)?;
            if name == picture {
                usage |= wgpu::TextureUsages::COPY_SRC;
            }
            let samples = number(it, "samples")?;
            if samples == 1 {
                usage |= wgpu::TextureUsages::COPY_DST;
            }
            let texture = device.create_texture(&wgpu::TextureDescriptor {
                label: Some(name),
                size: wgpu::Extent3d {
                    width,
                    height,
                    depth_or_array_layers: match dimensions {
                        3 => depth,
                        _ => number(it, "layers")?,
                    },
                },
                mip_level_count: number(it, "levels")?,
                sample_count: samples,
                dimension: match dimensions {
                    1 => wgpu::TextureDimension::D1,
                    3 => wgpu::TextureDimension::D3,
                    _ => wgpu::TextureDimension::D2,
                },
                format: texel.format,
                usage,
                view_formats: &[],
            });
            textures.insert(name.clone(), Texture { texture, texel });
        }

        let mut samplers = BTreeMap::new();
        for (name, it) in members(&frame, "samplers")? {
            samplers.insert(name.clone(), sampler(&device, name, it)?);
        }

        let mut modules = BTreeMap::new();
        for (name, it) in members(&frame, "shaders")? {
            let Some(wgsl) = it.get("languages").and_then(|all| all.get("wgsl")) else {
                let why = it.pointer("/unsupported/wgsl").and_then(Value::as_str);
                let why = why.unwrap_or("build with `--target wgsl`");
                return Err(format!("shader `{name}` has no WGSL: {why}"));
            };
            let source = String::from_utf8(file(text(wgsl, "file")?)?)
                .map_err(|e| format!("shader `{name}`: {e}"))?;
            let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
                label: Some(name),
                source: wgpu::ShaderSource::Wgsl(source.into()),
            });
            modules.insert(
                name.clone(),
                (module, text(wgsl, "entry_point")?.to_owned()),
            );
        }

        let make = Make {
            device: &device,
            frame: &frame,
            buffers: &buffers,
            textures: &textures,
            samplers: &samplers,
            modules: &modules,
        };
        let passes = list(&frame, "passes")?;
        let passes = passes
            .iter()
            .map(|pass| make.pass(pass))
            .collect::<Result<_>>()?;
        if let Some(error) = pollster::block_on(scope.pop()) {
            return Err(error.to_string());
        }
        Ok(Self {
            device,
            queue,
            frame,
            buffers,
            textures,
            passes,
        })
    }

    /// The frame's description.
    #[must_use]
    pub const fn frame(&self) -> &Value {
        &self.frame
    }

    /// Writes a field of a uniform: numbers as `frame.json` has them in `value`.
    ///
    /// # Errors
    /// There is no such uniform or field, or the numbers are of another type.
    pub fn set(&mut self, uniform: &str, field: &str, value: &Value) -> Result<()> {
        let fields = list(at(at(&self.frame, "uniforms")?, uniform)?, "fields")?;
        let of_name = |it: &&Value| it.get("name").and_then(Value::as_str) == Some(field);
        let it = fields
            .iter()
            .find(of_name)
            .ok_or_else(|| format!("uniform `{uniform}` has no field `{field}`"))?;
        let ty = text(it, "type")?;
        let numbers: Vec<&Value> = match value {
            Value::Array(all) => all.iter().collect(),
            one => vec![one],
        };
        let mut bytes = Vec::new();
        for number in &numbers {
            let word = if ty.contains("f32") {
                number.as_f64().map(|x| (x as f32).to_le_bytes())
            } else if ty.contains("u32") {
                whole(number).ok().map(u32::to_le_bytes)
            } else {
                None
            };
            bytes.extend(word.ok_or_else(|| format!("`{field}` is {ty}, not {number}"))?);
        }
        let offset = u64::from(number(it, "offset")?);
        if bytes.len() != number(it, "size")? as usize {
            return Err(format!("`{field}` is {ty}, not {value}"));
        }
        self.queue
            .write_buffer(find(&self.buffers, uniform)?, offset, &bytes);
        Ok(())
    }

    /// Runs all passes.
    ///
    /// # Errors
    /// What wgpu says of them.
    pub fn run(&mut self) -> Result<()> {
        let scope = self.device.push_error_scope(wgpu::ErrorFilter::Validation);
        for pass in &self.passes {
            let mut encoder = self.device.create_command_encoder(&Default::default());
            match pass {
                Pass::Clear {
                    buffers,
                    textures,
                    value,
                } => {
                    for name in buffers {
                        encoder.clear_buffer(find(&self.buffers, name)?, 0, None);
                    }
                    for name in textures {
                        let texture = find(&self.textures, name)?;
                        let Some(value) = value else {
                            self.clear(texture);
                            continue;
                        };
                        let filled = Colour {
                            view: texture.view(),
                            resolve: None,
                            clear: *value,
                        };
                        encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                            color_attachments: &[Some(filled.attachment())],
                            ..Default::default()
                        });
                    }
                }
                Pass::Levels { texture, levels } => {
                    let whole = &find(&self.textures, texture)?.texture;
                    for (mip_level, name) in (0..).zip(levels) {
                        let level = &find(&self.textures, name)?.texture;
                        let to = wgpu::TexelCopyTextureInfo {
                            mip_level,
                            ..whole.as_image_copy()
                        };
                        encoder.copy_texture_to_texture(level.as_image_copy(), to, level.size());
                    }
                }
                Pass::Compute {
                    pipeline,
                    groups,
                    workgroups: [x, y, z],
                } => {
                    let mut pass = encoder.begin_compute_pass(&Default::default());
                    pass.set_pipeline(pipeline);
                    for (number, group) in groups {
                        pass.set_bind_group(*number, group, &[]);
                    }
                    pass.dispatch_workgroups(*x, *y, *z);
                }
                Pass::Draw {
                    pipeline,
                    groups,
                    attributes,
                    indices,
                    count,
                    colours,
                    depth,
                } => {
                    let colours: Vec<_> = colours.iter().map(|it| Some(it.attachment())).collect();
                    let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                        color_attachments: &colours,
                        depth_stencil_attachment: depth.as_ref().map(Depth::attachment),
                        ..Default::default()
                    });
                    pass.set_pipeline(pipeline);
                    for (number, group) in groups {
                        pass.set_bind_group(*number, group, &[]);
                    }
                    for (slot, name) in (0..).zip(attributes) {
                        pass.set_vertex_buffer(slot, find(&self.buffers, name)?.slice(..));
                    }
                    if let Some(indices) = indices {
                        let indices = find(&self.buffers, indices)?.slice(..);
                        pass.set_index_buffer(indices, wgpu::IndexFormat::Uint32);
                        pass.draw_indexed(0..*count, 0, 0..1);
                    } else {
                        pass.draw(0..*count, 0..1);
                    }
                }
            }
            self.queue.submit([encoder.finish()]);
        }
        match pollster::block_on(scope.pop()) {
            Some(error) => Err(error.to_string()),
            None => Ok(()),
        }
    }

    /// Fills a texture with zeros.
    fn clear(&self, it: &Texture) {
        let texture = &it.texture;
        for level in 0..texture.mip_level_count() {
            let size = wgpu::Extent3d {
                width: (texture.width() >> level).max(1),
                height: (texture.height() >> level).max(1),
                depth_or_array_layers: match texture.dimension() {
                    wgpu::TextureDimension::D3 => (texture.depth_or_array_layers() >> level).max(1),
                    _ => texture.depth_or_array_layers(),
                },
            };
            let row = size.width * it.texel.bytes;
            let zeros = vec![0; (row * size.height * size.depth_or_array_layers) as usize];
            self.queue.write_texture(
                wgpu::TexelCopyTextureInfo {
                    mip_level: level,
                    ..texture.as_image_copy()
                },
                &zeros,
                wgpu::TexelCopyBufferLayout {
                    offset: 0,
                    bytes_per_row: Some(row),
                    rows_per_image: Some(size.height),
                },
                size,
            );
        }
    }

    /// Waits, and reads the picture.
    ///
    /// # Errors
    /// Its texels are of a format that is no picture's, or the device fails.
    pub fn picture(&self) -> Result<Picture> {
        let it = find(&self.textures, text(&self.frame, "picture")?)?;
        let (width, height) = (it.texture.width(), it.texture.height());
        let row = width * it.texel.bytes;
        let pitch = row.next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT);
        let staging = self.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("picture"),
            size: u64::from(pitch) * u64::from(height),
            usage: wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ,
            mapped_at_creation: false,
        });
        let mut encoder = self.device.create_command_encoder(&Default::default());
        encoder.copy_texture_to_buffer(
            it.texture.as_image_copy(),
            wgpu::TexelCopyBufferInfo {
                buffer: &staging,
                layout: wgpu::TexelCopyBufferLayout {
                    offset: 0,
                    bytes_per_row: Some(pitch),
                    rows_per_image: Some(height),
                },
            },
            it.texture.size(),
        );
        self.queue.submit([encoder.finish()]);
        staging.slice(..).map_async(wgpu::MapMode::Read, |_| {});
        let waited = self.device.poll(wgpu::PollType::wait_indefinitely());
        waited.map_err(|e| e.to_string())?;
        let mapped = staging.slice(..).get_mapped_range();
        let mapped = mapped.map_err(|e| e.to_string())?;
        let mut pixels = Vec::new();
        for row in mapped
            .chunks_exact(pitch as usize)
            .map(|it| &it[..row as usize])
        {
            for texel in row.chunks_exact(it.texel.bytes as usize) {
                let linear = words::linear(it.texel.format, texel);
                let linear = linear.ok_or("the picture has no format of pictures")?;
                pixels.extend(linear.map(words::srgb));
            }
        }
        Ok(Picture {
            width,
            height,
            pixels,
        })
    }
}

impl Picture {
    /// Of linear light: four floats for each pixel, rows from the top. `None` if they are not so many.
    #[must_use]
    pub fn of_linear(width: u32, height: u32, light: &[f32]) -> Option<Self> {
        if light.len() != 4 * width as usize * height as usize {
            return None;
        }
        let pixels = light.chunks_exact(4).flat_map(|it| &it[..3]);
        Some(Self {
            width,
            height,
            pixels: pixels.map(|it| words::srgb(*it)).collect(),
        })
    }

    /// Writes a PNG file.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn save(&self, path: &Path) -> Result<()> {
        let fail = |e: &dyn std::error::Error| format!("{}: {e}", path.display());
        let file = fs::File::create(path).map_err(|e| fail(&e))?;
        let mut encoder = png::Encoder::new(file, self.width, self.height);
        encoder.set_color(png::ColorType::Rgb);
        encoder.set_source_srgb(png::SrgbRenderingIntent::Perceptual);
        let mut writer = encoder.write_header().map_err(|e| fail(&e))?;
        writer
            .write_image_data(&self.pixels)
            .map_err(|e| fail(&e))?;
        writer.finish().map_err(|e| fail(&e))
    }

    /// Reads a PNG file of 8-bit colours without alpha.
    ///
    /// # Errors
    /// The file cannot be read, or is another one.
    pub fn read(path: &Path) -> Result<Self> {
        let fail = |e: &dyn std::error::Error| format!("{}: {e}", path.display());
        let file = fs::File::open(path).map_err(|e| fail(&e))?;
        let decoder = png::Decoder::new(std::io::BufReader::new(file));
        let mut reader = decoder.read_info().map_err(|e| fail(&e))?;
        let mut pixels = vec![0; reader.output_buffer_size().unwrap_or_default()];
        let info = reader.next_frame(&mut pixels).map_err(|e| fail(&e))?;
        pixels.truncate(info.buffer_size());
        if info.color_type != png::ColorType::Rgb {
            return Err(format!(
                "{}: it has not red, green and blue",
                path.display()
            ));
        }
        Ok(Self {
            width: info.width,
            height: info.height,
            pixels,
        })
    }
}

/// A device with all that frames may need, as far as there is one.
fn device() -> Result<(wgpu::Device, wgpu::Queue)> {
    // `Rgba16Unorm` to write and to filter, `Rgba32Float` to filter.
    let wanted = wgpu::Features::TEXTURE_FORMAT_16BIT_NORM
        | wgpu::Features::TEXTURE_ADAPTER_SPECIFIC_FORMAT_FEATURES
        | wgpu::Features::FLOAT32_FILTERABLE;
    let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle();
    descriptor.backends = wgpu::Backends::PRIMARY;
    let instance = wgpu::Instance::new(descriptor);
    let adapter = pollster::block_on(instance.request_adapter(&Default::default()))
        .map_err(|e| e.to_string())?;
    pollster::block_on(adapter.request_device(&wgpu::DeviceDescriptor {
        label: Some("player"),
        required_features: adapter.features() & wanted,
        required_limits: adapter.limits(),
        ..Default::default()
    }))
    .map_err(|e| e.to_string())
}

fn sampler(device: &wgpu::Device, name: &str, it: &Value) -> Result<wgpu::Sampler> {
    let modes = list(it, "address_modes")?;
    let mode = |i: usize| words::address(modes.get(i).and_then(Value::as_str).unwrap_or_default());
    let compare = it.get("compare").and_then(Value::as_str);
    Ok(device.create_sampler(&wgpu::SamplerDescriptor {
        label: Some(name),
        address_mode_u: mode(0)?,
        address_mode_v: mode(1)?,
        address_mode_w: mode(2)?,
        mag_filter: filter(text(it, "mag_filter")?)?,
        min_filter: filter(text(it, "min_filter")?)?,
        mipmap_filter: words::mipmap_filter(text(it, "mipmap_filter")?)?,
        compare: compare.map(words::compare).transpose()?,
        anisotropy_clamp: number(it, "max_anisotropy")? as u16,
        ..Default::default()
    }))
}

/// What pipelines are made of.
struct Make<'a> {
    device: &'a wgpu::Device,
    frame: &'a Value,
    buffers: &'a BTreeMap<String, wgpu::Buffer>,
    textures: &'a BTreeMap<String, Texture>,
    samplers: &'a BTreeMap<String, wgpu::Sampler>,
    modules: &'a BTreeMap<String, (wgpu::ShaderModule, String)>,
}

impl Make<'_> {
    fn pass(&self, pass: &Value) -> Result<Pass> {
        match text(pass, "kind")? {
            "clear" => {
                let (mut buffers, mut textures) = (Vec::new(), Vec::new());
                for it in list(pass, "resources")? {
                    if it.get("buffer").is_some() {
                        buffers.push(text(it, "buffer")?.to_owned());
                    } else {
                        textures.push(text(it, "texture")?.to_owned());
                    }
                }
                Ok(Pass::Clear {
                    buffers,
                    textures,
                    value: pass.get("value").map(colour).transpose()?,
                })
            }
            "levels" => {
                let levels = list(pass, "levels")?.iter();
                let name = |it: &Value| it.as_str().unwrap_or_default().to_owned();
                Ok(Pass::Levels {
                    texture: text(pass, "texture")?.to_owned(),
                    levels: levels.map(name).collect(),
                })
            }
            "compute" => {
                let call = at(pass, "call")?;
                let (module, entry_point) = find(self.modules, text(call, "shader")?)?;
                let pipeline =
                    self.device
                        .create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
                            label: Some(text(pass, "label")?),
                            layout: None,
                            module,
                            entry_point: Some(entry_point),
                            compilation_options: Default::default(),
                            cache: None,
                        });
                let groups = self.groups([call], |group| pipeline.get_bind_group_layout(group))?;
                Ok(Pass::Compute {
                    groups,
                    pipeline,
                    workgroups: three(pass, "workgroups")?,
                })
            }
            "full-screen" => self.full_screen(pass),
            "draw" => self.draw(pass),
            other => Err(format!("frame.json: no pass is of the kind `{other}`")),
        }
    }

    fn draw(&self, pass: &Value) -> Result<Pass> {
        let vertex = at(pass, "vertex")?;
        let fragment = pass.get("fragment");
        let mut attributes = Vec::new();
        let mut layouts = Vec::new();
        for it in list(pass, "attributes")? {
            attributes.push(text(it, "buffer")?.to_owned());
            layouts.push((
                u64::from(number(it, "stride")?),
                [wgpu::VertexAttribute {
                    format: vertex_format(text(it, "format")?)?,
                    offset: 0,
                    shader_location: number(it, "location")?,
                }],
            ));
        }
        let layouts: Vec<_> = layouts
            .iter()
            .map(|(array_stride, attributes)| {
                Some(wgpu::VertexBufferLayout {
                    array_stride: *array_stride,
                    step_mode: wgpu::VertexStepMode::Vertex,
                    attributes,
                })
            })
            .collect();
        let (mut targets, mut colours) = (Vec::new(), Vec::new());
        for it in list(pass, "colour_targets")? {
            let drawn = find(self.textures, text(it, "texture")?)?;
            targets.push(Some(wgpu::ColorTargetState {
                blend: it.get("blend").map(words::blend).transpose()?,
                ..drawn.texel.format.into()
            }));
            let resolve = it.get("resolve").and_then(Value::as_str);
            let resolve = resolve.map(|name| find(self.textures, name)).transpose()?;
            colours.push(Colour {
                view: drawn.view(),
                resolve: resolve.map(Texture::view),
                clear: colour(at(it, "clear")?)?,
            });
        }
        let (mut depth, mut depth_stencil) = (None, None);
        if let Some(it) = pass.get("depth_target") {
            let drawn = find(self.textures, text(it, "texture")?)?;
            depth = Some(Depth {
                view: drawn.view(),
                clear: it.get("clear").and_then(Value::as_f64).map(|z| z as f32),
                store: at(it, "store")?.as_bool().unwrap_or(true),
            });
            depth_stencil = Some(wgpu::DepthStencilState {
                format: drawn.texel.format,
                depth_write_enabled: at(it, "write")?.as_bool(),
                depth_compare: Some(words::compare(text(it, "compare")?)?),
                stencil: Default::default(),
                bias: Default::default(),
            });
        }
        let (module, entry_point) = find(self.modules, text(vertex, "shader")?)?;
        let second = match fragment {
            Some(call) => Some(find(self.modules, text(call, "shader")?)?),
            None => None,
        };
        let pipeline = self
            .device
            .create_render_pipeline(&wgpu::RenderPipelineDescriptor {
                label: Some(text(pass, "label")?),
                layout: None,
                vertex: wgpu::VertexState {
                    module,
                    entry_point: Some(entry_point),
                    compilation_options: Default::default(),
                    buffers: &layouts,
                },
                primitive: wgpu::PrimitiveState {
                    topology: words::topology(text(pass, "topology")?)?,
                    cull_mode: words::cull_mode(text(pass, "cull_mode")?)?,
                    ..Default::default()
                },
                depth_stencil,
                multisample: wgpu::MultisampleState {
                    count: number(pass, "samples")?,
                    ..Default::default()
                },
                fragment: second.map(|(module, entry_point)| wgpu::FragmentState {
                    module,
                    entry_point: Some(entry_point),
                    compilation_options: Default::default(),
                    targets: &targets,
                }),
                multiview_mask: None,
                cache: None,
            });
        let calls = [vertex].into_iter().chain(fragment);
        let groups = self.groups(calls, |group| pipeline.get_bind_group_layout(group))?;
        let indices = at(pass, "indices")?;
        Ok(Pass::Draw {
            groups,
            pipeline,
            attributes,
            indices: Some(text(indices, "buffer")?.to_owned()),
            count: number(indices, "count")?,
            colours,
            depth,
        })
    }

    /// A triangle over all pixels of its targets: an image pass in its fragment form.
    fn full_screen(&self, pass: &Value) -> Result<Pass> {
        let (vertex, fragment) = (at(pass, "vertex")?, at(pass, "fragment")?);
        let (mut targets, mut colours) = (Vec::new(), Vec::new());
        for name in list(pass, "targets")? {
            let drawn = find(self.textures, name.as_str().unwrap_or_default())?;
            targets.push(Some(drawn.texel.format.into()));
            colours.push(Colour {
                view: drawn.view(),
                resolve: None,
                clear: wgpu::Color::TRANSPARENT,
            });
        }
        let (module, entry_point) = find(self.modules, text(vertex, "shader")?)?;
        let (second, second_entry_point) = find(self.modules, text(fragment, "shader")?)?;
        let pipeline = self
            .device
            .create_render_pipeline(&wgpu::RenderPipelineDescriptor {
                label: Some(text(pass, "label")?),
                layout: None,
                vertex: wgpu::VertexState {
                    module,
                    entry_point: Some(entry_point),
                    compilation_options: Default::default(),
                    buffers: &[],
                },
                primitive: Default::default(),
                depth_stencil: None,
                multisample: Default::default(),
                fragment: Some(wgpu::FragmentState {
                    module: second,
                    entry_point: Some(second_entry_point),
                    compilation_options: Default::default(),
                    targets: &targets,
                }),
                multiview_mask: None,
                cache: None,
            });
        let groups = self.groups([vertex, fragment], |group| {
            pipeline.get_bind_group_layout(group)
        })?;
        Ok(Pass::Draw {
            groups,
            pipeline,
            attributes: Vec::new(),
            indices: None,
            count: 3,
            colours,
            depth: None,
        })
    }

    /// The bind groups of the calls of one pass. What a shader does not use has no place in it, and is
    /// not bound.
    fn groups<'v>(
        &self,
        calls: impl IntoIterator<Item = &'v Value>,
        layout: impl Fn(u32) -> wgpu::BindGroupLayout,
    ) -> Result<Vec<(u32, wgpu::BindGroup)>> {
        let mut views = Vec::new();
        let mut bound = Vec::new();
        for call in calls {
            let shader = at(at(self.frame, "shaders")?, text(call, "shader")?)?;
            for binding in list(shader, "bindings")? {
                let Some(place) = binding.pointer("/places/wgsl") else {
                    continue;
                };
                let resource = at(at(call, "bind")?, text(binding, "name")?)?;
                let place = (number(place, "space")?, number(place, "index")?);
                if let Some(name) = resource.get("texture").and_then(Value::as_str) {
                    views.push((bound.len(), self.view(binding, find(self.textures, name)?)?));
                }
                bound.push((place, resource));
            }
        }
        let mut entries: BTreeMap<u32, Vec<wgpu::BindGroupEntry<'_>>> = BTreeMap::new();
        for (i, ((group, binding), resource)) in bound.into_iter().enumerate() {
            let view = views.iter().find(|(of, _)| *of == i);
            let resource = if let Some((_, view)) = view {
                wgpu::BindingResource::TextureView(view)
            } else if resource.get("buffer").is_some() {
                find(self.buffers, text(resource, "buffer")?)?.as_entire_binding()
            } else {
                let sampler = find(self.samplers, text(resource, "sampler")?)?;
                wgpu::BindingResource::Sampler(sampler)
            };
            let entry = wgpu::BindGroupEntry { binding, resource };
            entries.entry(group).or_default().push(entry);
        }
        let group = |(number, entries): (u32, Vec<_>)| {
            let group = self.device.create_bind_group(&wgpu::BindGroupDescriptor {
                label: None,
                layout: &layout(number),
                entries: &entries,
            });
            (number, group)
        };
        Ok(entries.into_iter().map(group).collect())
    }

    /// A texture as a shader sees it: `depth-2d-array`, `uint-3d`, `2d-multisampled` and the like.
    fn view(&self, binding: &Value, it: &Texture) -> Result<wgpu::TextureView> {
        let seen = text(binding, "texture")?;
        let seen = seen.strip_suffix("-multisampled").unwrap_or(seen);
        let seen = ["depth-", "uint-", "sint-"]
            .into_iter()
            .find_map(|before| seen.strip_prefix(before))
            .unwrap_or(seen);
        Ok(it.texture.create_view(&wgpu::TextureViewDescriptor {
            dimension: Some(words::view_dimension(seen)?),
            ..Default::default()
        }))
    }
}

impl Colour {
    fn attachment(&self) -> wgpu::RenderPassColorAttachment<'_> {
        wgpu::RenderPassColorAttachment {
            view: &self.view,
            depth_slice: None,
            resolve_target: self.resolve.as_ref(),
            ops: wgpu::Operations {
                load: wgpu::LoadOp::Clear(self.clear),
                store: match self.resolve {
                    Some(_) => wgpu::StoreOp::Discard,
                    None => wgpu::StoreOp::Store,
                },
            },
        }
    }
}

impl Depth {
    fn attachment(&self) -> wgpu::RenderPassDepthStencilAttachment<'_> {
        wgpu::RenderPassDepthStencilAttachment {
            view: &self.view,
            depth_ops: Some(wgpu::Operations {
                load: self.clear.map_or(wgpu::LoadOp::Load, wgpu::LoadOp::Clear),
                store: match self.store {
                    true => wgpu::StoreOp::Store,
                    false => wgpu::StoreOp::Discard,
                },
            }),
            stencil_ops: None,
        }
    }
}
