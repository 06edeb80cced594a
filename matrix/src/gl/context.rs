//! A context of OpenGL ES without a window. All calls that the compiler cannot check are here;
//! what they read and write is as long as they are told because this module makes it so.

use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use glow::HasContext as _;
use hankel_dsl::native::{self, Address, Compare, Filter, level_size};
use khronos_egl as egl;

use super::texels::Texel;

/// `EGL_PLATFORM_SURFACELESS_MESA`.
const PLATFORM_SURFACELESS_MESA: egl::Enum = 0x31DD;

/// How long the device may work on one run.
const PATIENCE: Duration = Duration::from_secs(60);

/// Texture unit where textures are made, beyond those that a kernel is bound to.
const MAKING: u32 = 31;

/// Colour attachments that OpenGL has names for.
const MOST_TARGETS: u32 = 32;

/// How many errors are read at most: a lost context gives them without end.
const MOST_ERRORS: usize = 8;

/// Calls OpenGL.
macro_rules! gl {
    ($context:expr, $($call:tt)+) => {{
        // SAFETY: the context is current on this thread, the only one that has it: `Context` is
        // not `Send`, and `make_current` begins every job. Objects are of this context and live
        // until `release`. Slices have the lengths that the other arguments tell.
        unsafe { $context.gl.$($call)+ }
    }};
}

/// An object that is to be deleted.
#[derive(Clone, Copy)]
enum Made {
    Shader(glow::Shader),
    Program(glow::Program),
    Buffer(glow::Buffer),
    Texture(glow::Texture),
    Sampler(glow::Sampler),
    Framebuffer(glow::Framebuffer),
    VertexArray(glow::VertexArray),
    Fence(glow::Fence),
}

/// A linked program.
#[derive(Clone, Copy)]
pub(super) struct Program(glow::Program);

/// A buffer.
#[derive(Clone, Copy)]
pub(super) struct Buffer {
    raw: glow::Buffer,
    bytes: usize,
}

/// How a texture is seen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum View {
    /// Two dimensions.
    Flat,
    /// Layers of two dimensions.
    Array,
    /// Three dimensions.
    Volume,
    /// The faces of a cube.
    Cube,
    /// Cubes in an array.
    Cubes,
}

impl View {
    /// By WebGPU's name.
    pub(super) fn named(name: &str) -> Result<Self, String> {
        Ok(match name {
            "2d" => Self::Flat,
            "2d-array" => Self::Array,
            "3d" => Self::Volume,
            "cube" => Self::Cube,
            "cube-array" => Self::Cubes,
            _ => return Err(format!("GLSL ES 3.10 has no {name} textures")),
        })
    }
}

/// What a texture is to be.
#[derive(Clone, Copy, Debug)]
pub(super) struct Shape {
    /// How it is seen.
    pub(super) view: View,
    /// Texels of level 0 along each axis.
    pub(super) size: [u32; 3],
    /// Mip levels.
    pub(super) levels: u32,
    /// Layers.
    pub(super) layers: u32,
}

impl Shape {
    /// Two dimensions, one level, one layer.
    pub(super) const fn flat(size: [u32; 3]) -> Self {
        Self {
            view: View::Flat,
            size: [size[0], size[1], 1],
            levels: 1,
            layers: 1,
        }
    }
}

/// A texture.
#[derive(Clone, Copy)]
pub(super) struct Texture {
    raw: glow::Texture,
    target: u32,
    pub(super) texel: Texel,
    pub(super) size: [u32; 3],
}

impl Texture {
    /// Whether it has slices or layers, which are bound all at once and read one by one.
    const fn is_layered(self) -> bool {
        matches!(self.target, glow::TEXTURE_3D | glow::TEXTURE_2D_ARRAY)
    }
}

/// A sampler.
#[derive(Clone, Copy)]
pub(super) struct Sampler(glow::Sampler);

/// An attribute of the vertices that are drawn: its location, its component type, how many
/// components, and the buffer with one value for each vertex.
#[derive(Clone, Copy)]
pub(super) struct Attribute {
    /// Location.
    pub(super) location: u32,
    /// `FLOAT`, `INT` or `UNSIGNED_INT`.
    pub(super) component: u32,
    /// 1 to 4.
    pub(super) size: u32,
    /// The values, tightly packed.
    pub(super) values: Buffer,
}

/// A context that is current on this thread.
struct Current {
    egl: egl::DynamicInstance<egl::EGL1_5>,
    display: egl::Display,
    context: egl::Context,
}

impl Current {
    fn make(&self) -> Result<(), String> {
        self.egl
            .make_current(self.display, None, None, Some(self.context))
            .map_err(|error| format!("EGL: the context cannot be made current: {error}"))
    }
}

impl Drop for Current {
    fn drop(&mut self) {
        // The display stays: it is the process's, others may use it. Nothing is left to report to.
        let _ = self.egl.make_current(self.display, None, None, None);
        let _ = self.egl.destroy_context(self.display, self.context);
    }
}

/// OpenGL ES.
pub(super) struct Context {
    // Dropped first, while the context is current: it unhooks its callback.
    gl: glow::Context,
    current: Current,
    made: Vec<Made>,
    said: Arc<Mutex<Vec<String>>>,
}

impl Drop for Context {
    fn drop(&mut self) {
        // Whatever fails here, the process is done with the device.
        let _ = self.release();
    }
}

impl Context {
    pub(super) fn open() -> Result<Self, String> {
        // SAFETY: the system's EGL library does nothing on loading that would need care.
        let egl = unsafe { egl::DynamicInstance::<egl::EGL1_5>::load_required() }
            .map_err(|error| format!("no EGL 1.5: {error}"))?;
        let offered = egl
            .query_string(None, egl::EXTENSIONS)
            .map(|it| it.to_string_lossy().into_owned())
            .unwrap_or_default();
        let display = if offered.contains("EGL_MESA_platform_surfaceless") {
            // SAFETY: that platform takes the default display only, which is no pointer.
            unsafe {
                egl.get_platform_display(
                    PLATFORM_SURFACELESS_MESA,
                    egl::DEFAULT_DISPLAY,
                    &[egl::ATTRIB_NONE],
                )
            }
            .map_err(|error| format!("EGL has no display without a window: {error}"))?
        } else {
            // SAFETY: the default display is no pointer.
            unsafe { egl.get_display(egl::DEFAULT_DISPLAY) }.ok_or("EGL has no default display")?
        };
        egl.initialize(display)
            .map_err(|error| format!("EGL cannot be initialised: {error}"))?;
        egl.bind_api(egl::OPENGL_ES_API)
            .map_err(|error| format!("EGL has no OpenGL ES: {error}"))?;
        let config = egl
            .choose_first_config(
                display,
                &[
                    egl::SURFACE_TYPE,
                    egl::PBUFFER_BIT,
                    egl::RENDERABLE_TYPE,
                    egl::OPENGL_ES3_BIT,
                    egl::NONE,
                ],
            )
            .map_err(|error| format!("EGL has no configuration: {error}"))?
            .ok_or("EGL has no configuration for OpenGL ES 3")?;
        let attributes = |minor| {
            [
                egl::CONTEXT_MAJOR_VERSION,
                3,
                egl::CONTEXT_MINOR_VERSION,
                minor,
                // So that errors come with words.
                egl::CONTEXT_OPENGL_DEBUG,
                egl::TRUE as egl::Int,
                egl::NONE,
            ]
        };
        let context = egl
            .create_context(display, config, None, &attributes(2))
            .or_else(|_| egl.create_context(display, config, None, &attributes(1)))
            .map_err(|error| format!("EGL has no context of OpenGL ES 3.1: {error}"))?;
        let current = Current {
            egl,
            display,
            context,
        };
        current.make()?;
        // SAFETY: the context is current; what EGL gives are functions of OpenGL ES.
        let gl = unsafe {
            glow::Context::from_loader_function(|name| {
                current
                    .egl
                    .get_proc_address(name)
                    .map_or(std::ptr::null(), |it| it as *const _)
            })
        };
        let mut it = Self {
            gl,
            current,
            made: Vec::new(),
            said: Arc::default(),
        };
        it.listen();
        gl!(it, disable(glow::DITHER));
        gl!(it, pixel_store_i32(glow::UNPACK_ALIGNMENT, 1));
        gl!(it, pixel_store_i32(glow::PACK_ALIGNMENT, 1));
        it.check("setting up")?;
        Ok(it)
    }

    /// Keeps what the driver says of errors.
    fn listen(&mut self) {
        if !self.gl.supports_debug() {
            return;
        }
        gl!(self, enable(glow::DEBUG_OUTPUT));
        gl!(self, enable(glow::DEBUG_OUTPUT_SYNCHRONOUS));
        let said = Arc::clone(&self.said);
        gl!(
            self,
            debug_message_callback(move |_, kind, _, _, message| {
                if kind == glow::DEBUG_TYPE_ERROR {
                    said.lock()
                        .unwrap_or_else(PoisonError::into_inner)
                        .push(message.trim().to_owned());
                }
            })
        );
    }

    pub(super) fn name(&self) -> String {
        let said = |what| gl!(self, get_parameter_string(what));
        format!(
            "{}, {}, {}",
            said(glow::RENDERER),
            said(glow::VERSION),
            said(glow::SHADING_LANGUAGE_VERSION)
        )
    }

    pub(super) fn make_current(&self) -> Result<(), String> {
        self.current.make()
    }

    /// The errors since the last check, if there are any.
    pub(super) fn check(&self, doing: &str) -> Result<(), String> {
        let codes: Vec<String> = (0..MOST_ERRORS)
            .map(|_| gl!(self, get_error()))
            .take_while(|&code| code != glow::NO_ERROR)
            .map(|code| match code {
                glow::INVALID_ENUM => "GL_INVALID_ENUM".into(),
                glow::INVALID_VALUE => "GL_INVALID_VALUE".into(),
                glow::INVALID_OPERATION => "GL_INVALID_OPERATION".into(),
                glow::INVALID_FRAMEBUFFER_OPERATION => "GL_INVALID_FRAMEBUFFER_OPERATION".into(),
                glow::OUT_OF_MEMORY => "GL_OUT_OF_MEMORY".into(),
                glow::CONTEXT_LOST => "GL_CONTEXT_LOST".into(),
                other => format!("error {other:#x}"),
            })
            .collect();
        let said = std::mem::take(&mut *self.said.lock().unwrap_or_else(PoisonError::into_inner));
        if codes.is_empty() {
            return Ok(());
        }
        Err(format!(
            "{doing}: {}",
            codes.into_iter().chain(said).collect::<Vec<_>>().join("; ")
        ))
    }

    /// How much there is to delete now: what is made afterwards is deleted by
    /// [`Self::release_from`].
    pub(super) fn mark(&self) -> usize {
        self.made.len()
    }

    /// Deletes all that was made.
    pub(super) fn release(&mut self) -> Result<(), String> {
        self.current.make()?;
        gl!(self, use_program(None));
        self.release_from(0)
    }

    /// Deletes all that was made after the mark.
    pub(super) fn release_from(&mut self, mark: usize) -> Result<(), String> {
        while self.made.len() > mark {
            match self.made.pop() {
                Some(Made::Shader(it)) => gl!(self, delete_shader(it)),
                Some(Made::Program(it)) => gl!(self, delete_program(it)),
                Some(Made::Buffer(it)) => gl!(self, delete_buffer(it)),
                Some(Made::Texture(it)) => gl!(self, delete_texture(it)),
                Some(Made::Sampler(it)) => gl!(self, delete_sampler(it)),
                Some(Made::Framebuffer(it)) => gl!(self, delete_framebuffer(it)),
                Some(Made::VertexArray(it)) => gl!(self, delete_vertex_array(it)),
                Some(Made::Fence(it)) => gl!(self, delete_sync(it)),
                None => break,
            }
        }
        self.check("deleting")
    }

    /// Compiles and links; `captured` are the outputs of the vertex stage that are kept.
    pub(super) fn program(
        &mut self,
        stages: &[(u32, &str)],
        captured: &[&str],
    ) -> Result<Program, String> {
        let program = gl!(self, create_program())?;
        self.made.push(Made::Program(program));
        for &(stage, text) in stages {
            let shader = gl!(self, create_shader(stage))?;
            self.made.push(Made::Shader(shader));
            gl!(self, shader_source(shader, text));
            gl!(self, compile_shader(shader));
            if !gl!(self, get_shader_compile_status(shader)) {
                let log = gl!(self, get_shader_info_log(shader));
                return Err(format!("it does not compile: {}", words(&log)));
            }
            gl!(self, attach_shader(program, shader));
        }
        if !captured.is_empty() {
            gl!(
                self,
                transform_feedback_varyings(program, captured, glow::INTERLEAVED_ATTRIBS)
            );
        }
        gl!(self, link_program(program));
        if !gl!(self, get_program_link_status(program)) {
            let log = gl!(self, get_program_info_log(program));
            return Err(format!("it does not link: {}", words(&log)));
        }
        self.check("compiling")?;
        Ok(Program(program))
    }

    pub(super) fn use_program(&self, program: Program) {
        gl!(self, use_program(Some(program.0)));
    }

    /// Number and size in bytes of a uniform block.
    pub(super) fn uniform_block(&self, program: Program, name: &str) -> Option<(u32, usize)> {
        let index = gl!(self, get_uniform_block_index(program.0, name))?;
        let size = gl!(
            self,
            get_active_uniform_block_parameter_i32(program.0, index, glow::UNIFORM_BLOCK_DATA_SIZE)
        );
        Some((index, usize::try_from(size).unwrap_or(0)))
    }

    pub(super) fn place_uniform_block(&self, program: Program, block: u32, index: u32) {
        gl!(self, uniform_block_binding(program.0, block, index));
    }

    /// Sets a number of the program in use, or a sampler's texture unit.
    pub(super) fn set_number(
        &self,
        program: Program,
        name: &str,
        number: u32,
    ) -> Result<(), String> {
        // A variable without a location is one that nothing reads.
        if let Some(location) = gl!(self, get_uniform_location(program.0, name)) {
            gl!(
                self,
                uniform_1_i32(Some(&location), length(number as usize)?)
            );
        }
        Ok(())
    }

    /// A buffer with the bytes, and zeros up to `least` bytes.
    pub(super) fn buffer(&mut self, bytes: &[u8], least: usize) -> Result<Buffer, String> {
        let raw = gl!(self, create_buffer())?;
        self.made.push(Made::Buffer(raw));
        let target = glow::COPY_WRITE_BUFFER;
        gl!(self, bind_buffer(target, Some(raw)));
        let size = bytes.len().max(least);
        length(size)?;
        if size == bytes.len() {
            gl!(
                self,
                buffer_data_u8_slice(target, bytes, glow::DYNAMIC_COPY)
            );
        } else {
            let mut padded = bytes.to_vec();
            padded.resize(size, 0);
            gl!(
                self,
                buffer_data_u8_slice(target, &padded, glow::DYNAMIC_COPY)
            );
        }
        gl!(self, bind_buffer(target, None));
        self.check("making a buffer")?;
        Ok(Buffer { raw, bytes: size })
    }

    pub(super) fn bind_uniform(&self, index: u32, buffer: Buffer) {
        gl!(
            self,
            bind_buffer_base(glow::UNIFORM_BUFFER, index, Some(buffer.raw))
        );
    }

    pub(super) fn bind_storage(&self, index: u32, buffer: Buffer) {
        gl!(
            self,
            bind_buffer_base(glow::SHADER_STORAGE_BUFFER, index, Some(buffer.raw))
        );
    }

    pub(super) fn read_buffer(&self, buffer: Buffer) -> Result<Vec<u8>, String> {
        if buffer.bytes == 0 {
            return Ok(Vec::new());
        }
        let target = glow::COPY_READ_BUFFER;
        gl!(self, bind_buffer(target, Some(buffer.raw)));
        let size = length(buffer.bytes)?;
        let mapped = gl!(self, map_buffer_range(target, 0, size, glow::MAP_READ_BIT));
        if mapped.is_null() {
            self.check("mapping a buffer")?;
            return Err("a buffer cannot be mapped".into());
        }
        // SAFETY: `size` bytes of it are mapped, to be read, until they are unmapped below.
        let bytes = unsafe { std::slice::from_raw_parts(mapped, buffer.bytes) }.to_vec();
        gl!(self, unmap_buffer(target));
        gl!(self, bind_buffer(target, None));
        self.check("reading a buffer")?;
        Ok(bytes)
    }

    /// A texture that can be read, written and drawn into; without `bytes`, what is in it is not
    /// said. Neither filtered nor repeated unless a sampler says so.
    pub(super) fn texture(
        &mut self,
        texel: Texel,
        shape: &Shape,
        bytes: Option<&[u8]>,
    ) -> Result<Texture, String> {
        let &Shape {
            view,
            size,
            levels,
            layers,
        } = shape;
        let target = match view {
            View::Flat => glow::TEXTURE_2D,
            View::Array => glow::TEXTURE_2D_ARRAY,
            View::Volume => glow::TEXTURE_3D,
            View::Cube => glow::TEXTURE_CUBE_MAP,
            View::Cubes => glow::TEXTURE_CUBE_MAP_ARRAY,
        };
        let of_level = |level: u32| {
            let [width, height, depth] = level_size(size, level);
            // One of them is 1.
            [width, height, depth.saturating_mul(layers)]
        };
        let expected = (0..levels).fold(0, |sum: usize, level| {
            sum.saturating_add(texels(of_level(level)).saturating_mul(texel.bytes))
        });
        if let Some(bytes) = bytes
            && bytes.len() != expected
        {
            return Err(format!(
                "a texture of {shape:?} has {expected} bytes, not {}",
                bytes.len()
            ));
        }
        let [width, height, depth] = lengths(of_level(0))?;
        let count = length(levels as usize)?;
        let raw = gl!(self, create_texture())?;
        self.made.push(Made::Texture(raw));
        gl!(self, active_texture(glow::TEXTURE0 + MAKING));
        gl!(self, bind_texture(target, Some(raw)));
        if matches!(view, View::Flat | View::Cube) {
            gl!(
                self,
                tex_storage_2d(target, count, texel.internal, width, height)
            );
        } else {
            gl!(
                self,
                tex_storage_3d(target, count, texel.internal, width, height, depth)
            );
        }
        // Before any upload: that into a texture without storage has the same error again.
        self.check("making a texture")?;
        let mut rest = bytes.unwrap_or_default();
        for level in (0..levels).filter(|_| bytes.is_some()) {
            let (own, after) = rest.split_at(texels(of_level(level)) * texel.bytes);
            rest = after;
            self.fill(target, texel, level, of_level(level), own)?;
        }
        for (what, value) in [
            (glow::TEXTURE_MIN_FILTER, glow::NEAREST_MIPMAP_NEAREST),
            (glow::TEXTURE_MAG_FILTER, glow::NEAREST),
            (glow::TEXTURE_WRAP_S, glow::CLAMP_TO_EDGE),
            (glow::TEXTURE_WRAP_T, glow::CLAMP_TO_EDGE),
            (glow::TEXTURE_WRAP_R, glow::CLAMP_TO_EDGE),
        ] {
            gl!(self, tex_parameter_i32(target, what, value as i32));
        }
        gl!(self, bind_texture(target, None));
        self.check("filling a texture")?;
        Ok(Texture {
            raw,
            target,
            texel,
            // With layers in place of a depth.
            size: of_level(0),
        })
    }

    /// Fills a level of the texture that is bound to a target: layer by layer.
    fn fill(
        &self,
        target: u32,
        texel: Texel,
        level: u32,
        size: [u32; 3],
        bytes: &[u8],
    ) -> Result<(), String> {
        let [width, height, depth] = lengths(size)?;
        let level = length(level as usize)?;
        if matches!(target, glow::TEXTURE_2D | glow::TEXTURE_CUBE_MAP) {
            let layer = (bytes.len() / size[2].max(1) as usize).max(1);
            for (face, bytes) in (0..).zip(bytes.chunks_exact(layer)) {
                let target = match target {
                    glow::TEXTURE_CUBE_MAP => glow::TEXTURE_CUBE_MAP_POSITIVE_X + face,
                    flat => flat,
                };
                gl!(
                    self,
                    tex_sub_image_2d(
                        target,
                        level,
                        0,
                        0,
                        width,
                        height,
                        texel.format,
                        texel.component,
                        glow::PixelUnpackData::Slice(Some(bytes))
                    )
                );
            }
            return Ok(());
        }
        gl!(
            self,
            tex_sub_image_3d(
                target,
                level,
                0,
                0,
                0,
                width,
                height,
                depth,
                texel.format,
                texel.component,
                glow::PixelUnpackData::Slice(Some(bytes))
            )
        );
        Ok(())
    }

    /// A depth buffer, to be drawn into and then read as a texture.
    pub(super) fn depth(&mut self, size: [u32; 2]) -> Result<Texture, String> {
        let [width, height, _] = lengths([size[0], size[1], 1])?;
        let raw = gl!(self, create_texture())?;
        self.made.push(Made::Texture(raw));
        let target = glow::TEXTURE_2D;
        gl!(self, active_texture(glow::TEXTURE0 + MAKING));
        gl!(self, bind_texture(target, Some(raw)));
        let internal = glow::DEPTH_COMPONENT32F;
        gl!(self, tex_storage_2d(target, 1, internal, width, height));
        for what in [glow::TEXTURE_MIN_FILTER, glow::TEXTURE_MAG_FILTER] {
            gl!(self, tex_parameter_i32(target, what, glow::NEAREST as i32));
        }
        gl!(self, bind_texture(target, None));
        self.check("making a depth buffer")?;
        Ok(Texture {
            raw,
            target,
            texel: Texel::named("depth32float")?,
            size: [size[0], size[1], 1],
        })
    }

    /// A multisampled texture, to be drawn into.
    pub(super) fn multisampled(
        &mut self,
        texel: Texel,
        size: [u32; 3],
        samples: u32,
    ) -> Result<Texture, String> {
        let [width, height, _] = lengths(size)?;
        let raw = gl!(self, create_texture())?;
        self.made.push(Made::Texture(raw));
        let target = glow::TEXTURE_2D_MULTISAMPLE;
        gl!(self, active_texture(glow::TEXTURE0 + MAKING));
        gl!(self, bind_texture(target, Some(raw)));
        gl!(
            self,
            tex_storage_2d_multisample(
                target,
                length(samples as usize)?,
                texel.internal,
                width,
                height,
                true
            )
        );
        gl!(self, bind_texture(target, None));
        self.check("making a multisampled texture")?;
        Ok(Texture {
            raw,
            target,
            texel,
            size: [size[0], size[1], 1],
        })
    }

    pub(super) fn bind_texture(&self, unit: u32, texture: Texture) {
        gl!(self, active_texture(glow::TEXTURE0.saturating_add(unit)));
        gl!(self, bind_texture(texture.target, Some(texture.raw)));
        // That of the case before, if it is there still.
        gl!(self, bind_sampler(unit, None));
    }

    pub(super) fn bind_image(&self, unit: u32, texture: Texture) {
        gl!(
            self,
            bind_image_texture(
                unit,
                Some(texture.raw),
                0,
                texture.is_layered(),
                0,
                glow::READ_WRITE,
                texture.texel.internal
            )
        );
    }

    pub(super) fn sampler(&mut self, sampler: &native::Sampler) -> Result<Sampler, String> {
        if sampler.anisotropy != 1 {
            return Err("OpenGL ES has no anisotropic filters".into());
        }
        let raw = gl!(self, create_sampler())?;
        self.made.push(Made::Sampler(raw));
        let magnify = match sampler.magnify {
            Filter::Nearest => glow::NEAREST,
            Filter::Linear => glow::LINEAR,
        };
        let minify = match (sampler.minify, sampler.mip) {
            (Filter::Nearest, Filter::Nearest) => glow::NEAREST_MIPMAP_NEAREST,
            (Filter::Nearest, Filter::Linear) => glow::NEAREST_MIPMAP_LINEAR,
            (Filter::Linear, Filter::Nearest) => glow::LINEAR_MIPMAP_NEAREST,
            (Filter::Linear, Filter::Linear) => glow::LINEAR_MIPMAP_LINEAR,
        };
        let [u, v, w] = sampler.address.map(|it| match it {
            Address::ClampToEdge => glow::CLAMP_TO_EDGE,
            Address::Repeat => glow::REPEAT,
            Address::MirrorRepeat => glow::MIRRORED_REPEAT,
        });
        let mut states = vec![
            (glow::TEXTURE_MIN_FILTER, minify),
            (glow::TEXTURE_MAG_FILTER, magnify),
            (glow::TEXTURE_WRAP_S, u),
            (glow::TEXTURE_WRAP_T, v),
            (glow::TEXTURE_WRAP_R, w),
        ];
        if let Some(compare) = sampler.compare {
            let how = match compare {
                Compare::Never => glow::NEVER,
                Compare::Less => glow::LESS,
                Compare::Equal => glow::EQUAL,
                Compare::LessEqual => glow::LEQUAL,
                Compare::Greater => glow::GREATER,
                Compare::NotEqual => glow::NOTEQUAL,
                Compare::GreaterEqual => glow::GEQUAL,
                Compare::Always => glow::ALWAYS,
            };
            states.push((glow::TEXTURE_COMPARE_MODE, glow::COMPARE_REF_TO_TEXTURE));
            states.push((glow::TEXTURE_COMPARE_FUNC, how));
        }
        for (what, value) in states {
            gl!(self, sampler_parameter_i32(raw, what, value as i32));
        }
        self.check("making a sampler")?;
        Ok(Sampler(raw))
    }

    pub(super) fn bind_sampler(&self, unit: u32, sampler: Sampler) {
        gl!(self, bind_sampler(unit, Some(sampler.0)));
    }

    /// The texels as they lie in memory, row by row, slice by slice.
    pub(super) fn read_texture(&mut self, texture: Texture) -> Result<Vec<u8>, String> {
        let [width, height, depth] = lengths(texture.size)?;
        let texel = texture.texel;
        let slice = texels([texture.size[0], texture.size[1], 1]);
        let mut pixels = vec![0; slice * texel.read_bytes];
        let mut bytes = Vec::with_capacity(texels(texture.size) * texel.bytes);
        self.framebuffer()?;
        for z in 0..depth {
            if texture.is_layered() {
                gl!(
                    self,
                    framebuffer_texture_layer(
                        glow::FRAMEBUFFER,
                        glow::COLOR_ATTACHMENT0,
                        Some(texture.raw),
                        0,
                        z
                    )
                );
            } else {
                self.attach(0, texture);
            }
            self.complete()?;
            gl!(
                self,
                read_pixels(
                    0,
                    0,
                    width,
                    height,
                    texel.read_format,
                    texel.read_component,
                    glow::PixelPackData::Slice(Some(&mut pixels))
                )
            );
            self.check("reading a texture")?;
            for pixel in pixels.chunks_exact(texel.read_bytes) {
                texel.pack(pixel, &mut bytes);
            }
        }
        gl!(self, bind_framebuffer(glow::FRAMEBUFFER, None));
        Ok(bytes)
    }

    /// Makes a framebuffer and binds it.
    fn framebuffer(&mut self) -> Result<(), String> {
        let raw = gl!(self, create_framebuffer())?;
        self.made.push(Made::Framebuffer(raw));
        gl!(self, bind_framebuffer(glow::FRAMEBUFFER, Some(raw)));
        Ok(())
    }

    fn attach(&self, number: u32, texture: Texture) {
        gl!(
            self,
            framebuffer_texture_2d(
                glow::FRAMEBUFFER,
                glow::COLOR_ATTACHMENT0 + number,
                texture.target,
                Some(texture.raw),
                0
            )
        );
    }

    fn complete(&self) -> Result<(), String> {
        let status = gl!(self, check_framebuffer_status(glow::FRAMEBUFFER));
        self.check("making a framebuffer")?;
        if status == glow::FRAMEBUFFER_COMPLETE {
            Ok(())
        } else {
            Err(format!("a framebuffer is not complete: {status:#x}"))
        }
    }

    /// Binds a framebuffer with these colour attachments, by number, this depth buffer, cleared to 0,
    /// and a viewport of `size`.
    pub(super) fn draw_into(
        &mut self,
        targets: &[(u32, Texture)],
        depth: Option<Texture>,
        size: [u32; 2],
    ) -> Result<(), String> {
        self.framebuffer()?;
        if let Some((number, _)) = targets.iter().find(|it| it.0 >= MOST_TARGETS) {
            return Err(format!("no framebuffer has a colour {number}"));
        }
        let most = targets.iter().map(|it| it.0 + 1).max().unwrap_or(0);
        let mut buffers = vec![glow::NONE; most as usize];
        for &(number, texture) in targets {
            self.attach(number, texture);
            buffers[number as usize] = glow::COLOR_ATTACHMENT0 + number;
        }
        gl!(self, draw_buffers(&buffers));
        if let Some(depth) = depth {
            gl!(
                self,
                framebuffer_texture_2d(
                    glow::FRAMEBUFFER,
                    glow::DEPTH_ATTACHMENT,
                    depth.target,
                    Some(depth.raw),
                    0
                )
            );
            gl!(self, enable(glow::DEPTH_TEST));
            gl!(self, depth_func(glow::ALWAYS));
            gl!(self, depth_mask(true));
            gl!(self, clear_buffer_f32_slice(glow::DEPTH, 0, &[0.0]));
        } else {
            gl!(self, disable(glow::DEPTH_TEST));
        }
        self.complete()?;
        gl!(
            self,
            viewport(0, 0, length(size[0] as usize)?, length(size[1] as usize)?)
        );
        self.check("setting up a framebuffer")
    }

    /// Runs the program in use over so many workgroups.
    pub(super) fn dispatch(&mut self, groups: [u32; 3]) -> Result<(), String> {
        gl!(self, dispatch_compute(groups[0], groups[1], groups[2]));
        self.check("dispatching")?;
        gl!(self, memory_barrier(glow::ALL_BARRIER_BITS));
        self.wait()
    }

    /// Draws points, or one triangle of 3 vertices, with the program in use, into the framebuffer
    /// that is bound.
    pub(super) fn draw(
        &mut self,
        mode: u32,
        count: u32,
        attributes: &[Attribute],
    ) -> Result<(), String> {
        let array = gl!(self, create_vertex_array())?;
        self.made.push(Made::VertexArray(array));
        gl!(self, bind_vertex_array(Some(array)));
        for it in attributes {
            let needed = count as usize * it.size as usize * 4;
            if it.values.bytes < needed {
                return Err(format!(
                    "{count} vertices need {needed} bytes of the attribute at location {}, \
                     {} are there",
                    it.location, it.values.bytes
                ));
            }
            gl!(self, bind_buffer(glow::ARRAY_BUFFER, Some(it.values.raw)));
            let size = length(it.size as usize)?;
            if it.component == glow::FLOAT {
                gl!(
                    self,
                    vertex_attrib_pointer_f32(it.location, size, it.component, false, 0, 0)
                );
            } else {
                gl!(
                    self,
                    vertex_attrib_pointer_i32(it.location, size, it.component, 0, 0)
                );
            }
            gl!(self, enable_vertex_attrib_array(it.location));
        }
        gl!(self, bind_buffer(glow::ARRAY_BUFFER, None));
        self.check("setting up vertices")?;
        gl!(self, draw_arrays(mode, 0, length(count as usize)?));
        gl!(self, bind_vertex_array(None));
        self.check("drawing")?;
        self.wait()
    }

    /// Whether what is drawn is left out, and what is there multiplied by the second source.
    pub(super) fn blend_second(&mut self, does: bool) -> Result<(), String> {
        if does {
            gl!(self, enable(glow::BLEND));
            gl!(
                self,
                blend_func_separate(glow::ZERO, glow::SRC1_COLOR, glow::ZERO, glow::SRC1_ALPHA)
            );
        } else {
            gl!(self, disable(glow::BLEND));
            // Mesa looks at it with several targets, whether or not anything is blended.
            gl!(self, blend_func(glow::ONE, glow::ZERO));
        }
        self.check("blending")
    }

    /// Runs the vertex stage of the program in use for so many points; gives what it captures of
    /// each, `bytes` bytes a point.
    pub(super) fn capture(
        &mut self,
        count: u32,
        bytes: usize,
        attributes: &[Attribute],
    ) -> Result<Vec<u8>, String> {
        let captured = self.buffer(&[], count as usize * bytes)?;
        let target = glow::TRANSFORM_FEEDBACK_BUFFER;
        gl!(self, bind_buffer_base(target, 0, Some(captured.raw)));
        gl!(self, enable(glow::RASTERIZER_DISCARD));
        gl!(self, begin_transform_feedback(glow::POINTS));
        let drawn = self.draw(glow::POINTS, count, attributes);
        gl!(self, end_transform_feedback());
        gl!(self, disable(glow::RASTERIZER_DISCARD));
        gl!(self, bind_buffer_base(target, 0, None));
        drawn?;
        self.check("capturing")?;
        self.read_buffer(captured)
    }

    /// Waits until the device has done all.
    fn wait(&mut self) -> Result<(), String> {
        let fence = gl!(self, fence_sync(glow::SYNC_GPU_COMMANDS_COMPLETE, 0))?;
        self.made.push(Made::Fence(fence));
        let begun = Instant::now();
        loop {
            let slice = Duration::from_secs(1).as_nanos() as i32;
            match gl!(
                self,
                client_wait_sync(fence, glow::SYNC_FLUSH_COMMANDS_BIT, slice)
            ) {
                glow::ALREADY_SIGNALED | glow::CONDITION_SATISFIED => break,
                glow::TIMEOUT_EXPIRED if begun.elapsed() < PATIENCE => {}
                glow::TIMEOUT_EXPIRED => {
                    return Err(format!(
                        "the device did not finish in {} seconds",
                        PATIENCE.as_secs()
                    ));
                }
                other => {
                    self.check("waiting for the device")?;
                    return Err(format!("waiting for the device gave {other:#x}"));
                }
            }
        }
        self.check("running")
    }
}

/// A log without its blank ends; drivers may give none.
fn words(log: &str) -> &str {
    let log = log.trim_matches(|c: char| c.is_whitespace() || c == '\0');
    if log.is_empty() {
        "the driver does not say why"
    } else {
        log
    }
}

/// A size as OpenGL takes it.
fn length(size: usize) -> Result<i32, String> {
    i32::try_from(size).map_err(|_| format!("{size} is more than OpenGL can count"))
}

fn lengths(size: [u32; 3]) -> Result<[i32; 3], String> {
    Ok([
        length(size[0] as usize)?,
        length(size[1] as usize)?,
        length(size[2] as usize)?,
    ])
}

/// How many texels; of what no memory holds, as many as there are numbers.
fn texels(size: [u32; 3]) -> usize {
    size.iter()
        .fold(1, |texels: usize, &it| texels.saturating_mul(it as usize))
}
