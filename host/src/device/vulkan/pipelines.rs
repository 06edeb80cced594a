//! Shader modules, bindings and pipelines of the Vulkan device, kept by content.

use std::borrow::Cow;
use std::collections::HashMap;
use std::panic::{AssertUnwindSafe, catch_unwind};

use hankel_dsl::native::describe::{
    BuiltIn, Channels, Kernel, Output, Param, Precision, Role, Rounding, SamplerKind, Scalar,
    Stage, TexelAccess, Type,
};

use super::super::error::{DeviceError, Result};
use super::super::route;
use super::super::slots::{self, Given, Slot, Use};
use super::super::{
    Bind, Blend, BufferId, Colour, Cull, Depth, DepthTest, Draw, Format, Pass, Program, Shader,
    TextureShape, Topology,
};
use super::{VulkanDevice, resources, words};

/// What is kept.
#[derive(Debug, Default)]
pub struct Pipelines {
    modules: HashMap<ModuleKey, wgpu::ShaderModule>,
    layouts: HashMap<Vec<wgpu::BindGroupLayoutEntry>, wgpu::BindGroupLayout>,
    compute: HashMap<ComputeKey, wgpu::ComputePipeline>,
    render: HashMap<RenderKey, wgpu::RenderPipeline>,
}

#[derive(Clone, Debug, PartialEq, Eq, Hash)]
enum ModuleKey {
    Passthrough(Vec<u32>, String),
    Naga(Vec<u32>),
    Wgsl(String),
}

#[derive(Clone, Debug, PartialEq, Eq, Hash)]
struct ComputeKey {
    module: wgpu::ShaderModule,
    entry_point: String,
    layout: wgpu::BindGroupLayout,
}

#[derive(Clone, Debug, PartialEq, Eq, Hash)]
struct RenderKey {
    vertex: (wgpu::ShaderModule, String, wgpu::BindGroupLayout),
    fragment: Option<(wgpu::ShaderModule, String, wgpu::BindGroupLayout)>,
    attributes: Vec<(u32, wgpu::VertexFormat)>,
    targets: Vec<(wgpu::TextureFormat, Blend)>,
    depth: Option<(DepthTest, bool)>,
    samples: u32,
    topology: Topology,
    cull: Cull,
    immediate_size: u32,
}

/// A kernel's arguments, bound.
pub struct Bound {
    pub layout: wgpu::BindGroupLayout,
    pub group: wgpu::BindGroup,
    /// Push constants.
    pub pushed: Vec<u8>,
}

/// Whether code has push constants, not a uniform buffer in their place.
fn has_push_constants(shader: Shader<'_>) -> bool {
    match shader {
        Shader::SpirvPassthrough(code) | Shader::SpirvThroughNaga(code) => {
            words::has_push_constants(code)
        }
        Shader::Wgsl { text, .. } => text.contains("var<immediate>"),
    }
}

/// A stage of a pipeline.
struct Linked {
    module: wgpu::ShaderModule,
    entry_point: String,
}

/// Descriptor sets of the stages: each counts its bindings from 0, so in one pipeline they need a
/// set each.
const VERTEX_SET: u32 = 0;
const FRAGMENT_SET: u32 = 1;

/// SPIR-V's number and name for a stage.
const fn model(stage: &Stage) -> (u32, &'static str) {
    match stage {
        Stage::Vertex => (0, "vertex"),
        Stage::Fragment => (4, "fragment"),
        Stage::Compute { .. } => (5, "compute"),
    }
}

/// A compute kernel's workgroup.
pub fn threads(kernel: &Kernel) -> Result<[u32; 3]> {
    match kernel.stage {
        Stage::Compute { threads, .. } => Ok(threads),
        Stage::Vertex | Stage::Fragment => Err(DeviceError::Stage {
            kernel: kernel.name.clone(),
            stage: model(&kernel.stage).1,
            problem: "Vulkan runs it in a render pass, with `draw`".into(),
        }),
    }
}

/// Runs what may panic on odd modules.
fn caught<T>(work: impl FnOnce() -> T) -> std::result::Result<T, String> {
    catch_unwind(AssertUnwindSafe(work)).map_err(|payload| {
        let words = payload
            .downcast_ref::<String>()
            .map(String::as_str)
            .or_else(|| payload.downcast_ref::<&str>().copied())
            .unwrap_or("no message");
        format!("naga or wgpu panicked: {words}")
    })
}

impl VulkanDevice {
    /// A program's shader module, with its bindings in descriptor set `set`.
    fn link(&mut self, program: &Program<'_>, slots: &[Slot<'_>], set: u32) -> Result<Linked> {
        let kernel = program.kernel;
        let during = || format!("loading kernel `{}`", kernel.name);
        let refused = |detail: String| DeviceError::Refused {
            during: during(),
            detail,
        };
        let shader = program.shader.ok_or_else(|| DeviceError::NoCode {
            kernel: kernel.name.clone(),
            wanted: "a shader",
            device: self.name.clone(),
        })?;
        if kernel.precision == Some(Precision::F64) && !self.has_f64() {
            return Err(self.missing("64-bit floats", kernel));
        }
        if kernel.rounding == Rounding::Exact && !matches!(shader, Shader::SpirvPassthrough(_)) {
            return Err(refused(
                "its arithmetic must be done as it is written, which only untouched SPIR-V can \
                 ask of a driver"
                    .into(),
            ));
        }
        if !kernel.subgroups.is_unused()
            && !self.device.features().contains(wgpu::Features::SUBGROUP)
        {
            return Err(self.missing("subgroups", kernel));
        }
        let numbered = Role::BuiltIn {
            built_in: BuiltIn::PrimitiveIndex,
        };
        if kernel.params.iter().any(|param| param.role == numbered)
            && !self
                .device
                .features()
                .contains(wgpu::Features::PRIMITIVE_INDEX)
        {
            return Err(self.missing("numbers of primitives", kernel));
        }
        for output in &kernel.outputs {
            let (feature, what) = match output {
                Output::ClipDistances { .. } => (wgpu::Features::CLIP_DISTANCES, "clip distances"),
                Output::SecondSource { .. } => (
                    wgpu::Features::DUAL_SOURCE_BLENDING,
                    "a second source of blending",
                ),
                _ => continue,
            };
            if !self.device.features().contains(feature) {
                return Err(self.missing(what, kernel));
            }
        }
        let constants = slots::constants(kernel, program.constants)?;
        let numbered: Vec<(u32, u32)> = kernel
            .params
            .iter()
            .filter_map(|p| match p.role {
                Role::Constant { id, .. } => Some(id),
                _ => None,
            })
            .zip(constants.iter().copied())
            .collect();
        let (key, entry_point) = match shader {
            Shader::SpirvPassthrough(code) => {
                if !self.has_passthrough() {
                    return Err(self.missing("untouched SPIR-V", kernel));
                }
                let code = words::specialise(code, &numbered)
                    .and_then(|w| {
                        if set == 0 {
                            Ok(w)
                        } else {
                            words::move_to_set(&w, set)
                        }
                    })
                    .map_err(refused)?;
                self.check_words(kernel, slots, set, &code)?;
                (
                    ModuleKey::Passthrough(code, kernel.name.clone()),
                    kernel.name.clone(),
                )
            }
            Shader::SpirvThroughNaga(code) => {
                let written: Vec<u32> = slots
                    .iter()
                    .filter(|s| {
                        matches!(
                            s.role,
                            Use::StorageTexture {
                                access: TexelAccess::Write,
                                ..
                            }
                        )
                    })
                    .filter_map(|s| s.binding)
                    .collect();
                let code = words::specialise(code, &numbered)
                    .and_then(|w| words::write_only(&w, &written))
                    .and_then(|w| {
                        if set == 0 {
                            Ok(w)
                        } else {
                            words::move_to_set(&w, set)
                        }
                    })
                    .map_err(refused)?;
                (ModuleKey::Naga(code), kernel.name.clone())
            }
            Shader::Wgsl { text, entry_point } => {
                if constants != slots::constants(kernel, &[])? {
                    return Err(DeviceError::Constants {
                        kernel: kernel.name.clone(),
                        problem: "constants are already part of its WGSL: generate the text for \
                                  these values, and pass none"
                            .into(),
                    });
                }
                let text = if set == 0 {
                    text.to_string()
                } else {
                    text.replace("@group(0)", &format!("@group({set})"))
                };
                let text = route::for_naga(&text).into_owned();
                (ModuleKey::Wgsl(text), entry_point.to_string())
            }
        };
        if let Some(module) = self.pipelines.modules.get(&key) {
            return Ok(Linked {
                module: module.clone(),
                entry_point,
            });
        }
        let label = Some(kernel.name.as_str());
        let module = match &key {
            ModuleKey::Passthrough(code, name) => self.guarded(&during, |device| {
                let entry = wgpu::PassthroughShaderEntryPoint {
                    name: Cow::Borrowed(name),
                    workgroup_size: (0, 0, 0),
                };
                let descriptor = wgpu::ShaderModuleDescriptorPassthrough {
                    label,
                    entry_points: Cow::Borrowed(std::slice::from_ref(&entry)),
                    spirv: Some(Cow::Borrowed(code)),
                    ..Default::default()
                };
                // SAFETY: `check_words` saw a whole module with this entry point, whose bindings
                // and capabilities the pipeline has; that the rest is valid SPIR-V is the
                // contract of `Shader::SpirvPassthrough`, and every module comes from spirv-val.
                unsafe { device.create_shader_module_passthrough(descriptor) }
            })?,
            ModuleKey::Naga(code) => {
                let options = naga::front::spv::Options {
                    adjust_coordinate_space: false,
                    strict_capabilities: false,
                    block_ctx_dump_prefix: None,
                };
                let module = caught(|| {
                    naga::front::spv::Frontend::new(code.iter().copied(), &options).parse()
                })
                .map_err(refused)?
                .map_err(|e| refused(format!("naga cannot read its SPIR-V: {e}")))?;
                let source = wgpu::ShaderSource::Naga(Cow::Owned(module));
                self.make_module(label, source, &during)?
            }
            ModuleKey::Wgsl(text) => {
                let source = wgpu::ShaderSource::Wgsl(Cow::Borrowed(text));
                self.make_module(label, source, &during)?
            }
        };
        self.pipelines.modules.insert(key, module.clone());
        Ok(Linked {
            module,
            entry_point,
        })
    }

    fn make_module(
        &self,
        label: Option<&str>,
        source: wgpu::ShaderSource<'_>,
        during: &dyn Fn() -> String,
    ) -> Result<wgpu::ShaderModule> {
        self.guarded(during, |device| {
            caught(|| device.create_shader_module(wgpu::ShaderModuleDescriptor { label, source }))
        })?
        .map_err(|detail| DeviceError::Refused {
            during: during(),
            detail,
        })
    }

    fn missing(&self, feature: &str, kernel: &Kernel) -> DeviceError {
        DeviceError::Missing {
            device: self.name.clone(),
            feature: feature.into(),
            what: format!("kernel `{}`", kernel.name),
        }
    }

    /// Refuses a module that would leave the driver without what it looks up unchecked.
    fn check_words(
        &self,
        kernel: &Kernel,
        slots: &[Slot<'_>],
        set: u32,
        code: &[u32],
    ) -> Result<()> {
        let refused = |detail: String| DeviceError::Refused {
            during: format!("loading kernel `{}`", kernel.name),
            detail,
        };
        let found = words::summary(code).map_err(refused)?;
        let (model, stage) = model(&kernel.stage);
        if !found.entry_points.contains(&(model, kernel.name.clone())) {
            let names: Vec<&str> = found.entry_points.iter().map(|(_, n)| n.as_str()).collect();
            return Err(refused(format!(
                "its SPIR-V has no {stage} entry point of this name, only: {}",
                names.join(", ")
            )));
        }
        for (s, binding) in &found.bindings {
            if *s != set || !slots.iter().any(|slot| slot.binding == Some(*binding)) {
                return Err(refused(format!(
                    "its SPIR-V binds {binding} in set {s}, which its description does not: \
                     rebuild the shader"
                )));
            }
        }
        let features = self.device.features();
        for (capability, feature, name) in [
            (9, wgpu::Features::SHADER_F16, "16-bit floats"),
            (10, wgpu::Features::SHADER_F64, "64-bit floats"),
            (11, wgpu::Features::SHADER_INT64, "64-bit integers"),
        ] {
            if found.capabilities.contains(&capability) && !features.contains(feature) {
                return Err(self.missing(name, kernel));
            }
        }
        Ok(())
    }

    /// Binds checked arguments.
    pub(super) fn bind(
        &mut self,
        program: &Program<'_>,
        slots: &[Slot<'_>],
        args: &[Bind<'_>],
        visibility: wgpu::ShaderStages,
    ) -> Result<Bound> {
        let kernel = program.kernel;
        let mut entries = Vec::new();
        let mut resources: Vec<(u32, Resource)> = Vec::new();
        let mut pushed = Vec::new();
        for (slot, bind) in slots.iter().zip(args) {
            let Some(binding) = slot.binding else {
                continue;
            };
            // A text of another language has them in a uniform buffer.
            if slot.push && program.shader.is_some_and(has_push_constants) {
                let Bind::Bytes(bytes) = bind else {
                    return Err(slots::refuse(kernel, slot, "it must be bytes".into()));
                };
                if !self.device.features().contains(wgpu::Features::IMMEDIATES) {
                    return Err(self.missing("push constants", kernel));
                }
                self.limit(
                    format!("kernel `{}`, {slot}: its size in bytes", kernel.name),
                    bytes.len() as u64,
                    self.limits.max_immediate_size.into(),
                )?;
                pushed = bytes.to_vec();
                // Bound all the same: wgpu closes gaps in the numbers of bindings, and SPIR-V that goes
                // to the driver as it is keeps its own.
            }
            let (ty, resource) = self.resource(kernel, slot, bind)?;
            entries.push(wgpu::BindGroupLayoutEntry {
                binding,
                visibility,
                ty,
                count: None,
            });
            resources.push((binding, resource));
        }
        let during = || format!("binding the arguments of kernel `{}`", kernel.name);
        let layout = match self.pipelines.layouts.get(&entries) {
            Some(layout) => layout.clone(),
            None => {
                let layout = self.guarded(&during, |device| {
                    device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
                        label: Some(&kernel.name),
                        entries: &entries,
                    })
                })?;
                self.pipelines.layouts.insert(entries, layout.clone());
                layout
            }
        };
        let group = self.guarded(&during, |device| {
            let entries: Vec<wgpu::BindGroupEntry<'_>> = resources
                .iter()
                .map(|(binding, resource)| wgpu::BindGroupEntry {
                    binding: *binding,
                    resource: resource.binding(),
                })
                .collect();
            device.create_bind_group(&wgpu::BindGroupDescriptor {
                label: Some(&kernel.name),
                layout: &layout,
                entries: &entries,
            })
        })?;
        Ok(Bound {
            layout,
            group,
            pushed,
        })
    }

    /// One argument: its type in the layout, and what is bound.
    fn resource(
        &mut self,
        kernel: &Kernel,
        slot: &Slot<'_>,
        bind: &Bind<'_>,
    ) -> Result<(wgpu::BindingType, Resource)> {
        let buffer = |ty| wgpu::BindingType::Buffer {
            ty,
            has_dynamic_offset: false,
            min_binding_size: None,
        };
        let storage = |read_only| buffer(wgpu::BufferBindingType::Storage { read_only });
        let refuse = |problem: &str| slots::refuse(kernel, slot, problem.into());
        Ok(match slot.role {
            Use::Uniform(_) => {
                let (buffer_id, bytes) = self.buffer_of(bind)?;
                self.limit(
                    format!("kernel `{}`, {slot}: its size in bytes", kernel.name),
                    bytes,
                    self.limits.max_uniform_buffer_binding_size,
                )?;
                (
                    buffer(wgpu::BufferBindingType::Uniform),
                    Resource::Buffer(buffer_id, bytes.next_multiple_of(16)),
                )
            }
            Use::Element(_)
            | Use::ElementMut(_)
            | Use::Storage(_)
            | Use::StorageMut { .. }
            | Use::Atomic { .. }
            | Use::Output(_) => {
                let (buffer_id, bytes) = self.buffer_of(bind)?;
                self.limit(
                    format!("kernel `{}`, {slot}: its size in bytes", kernel.name),
                    bytes,
                    self.limits.max_storage_buffer_binding_size,
                )?;
                (
                    storage(!slot.role.is_written()),
                    Resource::Buffer(buffer_id, bytes),
                )
            }
            Use::Texture(kind) => {
                let Bind::Texture(id) = bind else {
                    return Err(refuse("it must be a texture"));
                };
                let texture = self.image(*id)?;
                let view_dimension = resources::view_dimension(kind);
                let sample_type = if kind.is_depth() {
                    wgpu::TextureSampleType::Depth
                } else {
                    match kind.channels() {
                        Channels::Float => wgpu::TextureSampleType::Float {
                            filterable: texture.filterable,
                        },
                        Channels::Uint => wgpu::TextureSampleType::Uint,
                        Channels::Sint => wgpu::TextureSampleType::Sint,
                    }
                };
                let ty = wgpu::BindingType::Texture {
                    sample_type,
                    view_dimension,
                    multisampled: kind.is_multisampled(),
                };
                let view = texture.texture.create_view(&wgpu::TextureViewDescriptor {
                    dimension: Some(view_dimension),
                    ..Default::default()
                });
                (ty, Resource::View(view))
            }
            Use::StorageTexture {
                format,
                array,
                access,
                ..
            } => {
                let Bind::Texture(id) = bind else {
                    return Err(refuse("it must be a texture"));
                };
                let texture = self.image(*id)?;
                let can = self
                    .adapter
                    .get_texture_format_features(resources::format(Format::Texel(format)))
                    .flags;
                let (access, flag, does) = match access {
                    TexelAccess::Write => (
                        wgpu::StorageTextureAccess::WriteOnly,
                        wgpu::TextureFormatFeatureFlags::STORAGE_WRITE_ONLY,
                        "writing",
                    ),
                    TexelAccess::Read => (
                        wgpu::StorageTextureAccess::ReadOnly,
                        wgpu::TextureFormatFeatureFlags::STORAGE_READ_ONLY,
                        "storage of",
                    ),
                    TexelAccess::ReadWrite => (
                        wgpu::StorageTextureAccess::ReadWrite,
                        wgpu::TextureFormatFeatureFlags::STORAGE_READ_WRITE,
                        "reading and writing",
                    ),
                };
                if !texture.usage.contains(wgpu::TextureUsages::STORAGE_BINDING)
                    || !can.contains(flag)
                {
                    let feature = format!("{does} {} textures", format.name());
                    return Err(self.missing(&feature, kernel));
                }
                let view_dimension = match texture.shape.dimensions {
                    1 => wgpu::TextureViewDimension::D1,
                    3 => wgpu::TextureViewDimension::D3,
                    _ if array => wgpu::TextureViewDimension::D2Array,
                    _ => wgpu::TextureViewDimension::D2,
                };
                let view = if array {
                    texture.texture.create_view(&wgpu::TextureViewDescriptor {
                        dimension: Some(view_dimension),
                        ..Default::default()
                    })
                } else {
                    texture.view.clone()
                };
                let ty = wgpu::BindingType::StorageTexture {
                    access,
                    format: resources::format(Format::Texel(format)),
                    view_dimension,
                };
                (ty, Resource::View(view))
            }
            Use::Sampler(kind) => {
                let Bind::Sampler(sampler) = bind else {
                    return Err(refuse("it must be a sampler"));
                };
                let ty = match kind {
                    SamplerKind::Comparison => wgpu::SamplerBindingType::Comparison,
                    SamplerKind::Filtering if sampler.is_filtering() => {
                        wgpu::SamplerBindingType::Filtering
                    }
                    // A texture that the device cannot filter is read by such a sampler, too.
                    SamplerKind::Filtering | SamplerKind::NonFiltering => {
                        wgpu::SamplerBindingType::NonFiltering
                    }
                };
                (
                    wgpu::BindingType::Sampler(ty),
                    Resource::Sampler(self.sampler(*sampler)?),
                )
            }
            Use::Attribute(..) | Use::Varying(..) | Use::Interface(_) => {
                return Err(refuse("it is not bound to a set"));
            }
        })
    }

    /// The buffer behind an argument, and how many bytes of it are meant.
    fn buffer_of(&self, bind: &Bind<'_>) -> Result<(wgpu::Buffer, u64)> {
        Ok(match bind {
            Bind::Buffer(id) => {
                let memory = self.memory(*id)?;
                (memory.buffer.clone(), memory.bytes as u64)
            }
            Bind::Bytes(bytes) => {
                let memory = self.make_buffer("bytes of a call", bytes.len())?;
                self.upload(&memory, bytes)?;
                (memory.buffer, bytes.len() as u64)
            }
            Bind::Texture(_) | Bind::Sampler(_) => {
                return Err(self.stale("what was given for a buffer".into()));
            }
        })
    }

    pub(super) fn compute_pipeline(
        &mut self,
        program: &Program<'_>,
        slots: &[Slot<'_>],
        bound: &Bound,
    ) -> Result<wgpu::ComputePipeline> {
        let layout = &bound.layout;
        let immediate_size = bound.pushed.len() as u32;
        let kernel = program.kernel;
        if let Stage::Compute {
            threads,
            workgroup_bytes,
            ..
        } = kernel.stage
        {
            let name = &kernel.name;
            let n = threads.iter().fold(1u64, |n, &t| n * u64::from(t));
            self.limit(
                format!("the workgroup of kernel `{name}`"),
                n,
                self.limits.max_compute_invocations_per_workgroup.into(),
            )?;
            self.limit(
                format!("the workgroup memory of kernel `{name}` in bytes"),
                workgroup_bytes.into(),
                self.limits.max_compute_workgroup_storage_size.into(),
            )?;
        }
        let linked = self.link(program, slots, 0)?;
        let key = ComputeKey {
            module: linked.module,
            entry_point: linked.entry_point,
            layout: layout.clone(),
        };
        if let Some(pipeline) = self.pipelines.compute.get(&key) {
            return Ok(pipeline.clone());
        }
        let during = || format!("compiling kernel `{}`", kernel.name);
        let pipeline = self
            .guarded(&during, |device| {
                caught(|| {
                    let layouts = [Some(layout)];
                    let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
                        label: Some(&kernel.name),
                        bind_group_layouts: &layouts,
                        immediate_size,
                    });
                    device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
                        label: Some(&kernel.name),
                        layout: Some(&layout),
                        module: &key.module,
                        entry_point: Some(&key.entry_point),
                        compilation_options: Default::default(),
                        cache: None,
                    })
                })
            })?
            .map_err(|detail| DeviceError::Refused {
                during: during(),
                detail,
            })?;
        self.pipelines.compute.insert(key, pipeline.clone());
        Ok(pipeline)
    }
}

/// What is bound.
enum Resource {
    Buffer(wgpu::Buffer, u64),
    View(wgpu::TextureView),
    Sampler(wgpu::Sampler),
}

impl Resource {
    fn binding(&self) -> wgpu::BindingResource<'_> {
        match self {
            Self::Buffer(buffer, size) => wgpu::BindingResource::Buffer(wgpu::BufferBinding {
                buffer,
                offset: 0,
                size: std::num::NonZero::new(*size),
            }),
            Self::View(view) => wgpu::BindingResource::TextureView(view),
            Self::Sampler(sampler) => wgpu::BindingResource::Sampler(sampler),
        }
    }
}

/// A draw call, ready to be encoded.
struct Ready {
    pipeline: wgpu::RenderPipeline,
    groups: Vec<wgpu::BindGroup>,
    pushed: Vec<u8>,
    attributes: Vec<wgpu::Buffer>,
    indices: Option<wgpu::Buffer>,
    count: u32,
}

/// A vertex attribute's format.
fn vertex_format(ty: &Type) -> Option<wgpu::VertexFormat> {
    use wgpu::VertexFormat as F;
    Some(match ty.components()? {
        (Scalar::F32, 1) => F::Float32,
        (Scalar::F32, 2) => F::Float32x2,
        (Scalar::F32, 3) => F::Float32x3,
        (Scalar::F32, 4) => F::Float32x4,
        (Scalar::U32, 1) => F::Uint32,
        (Scalar::U32, 2) => F::Uint32x2,
        (Scalar::U32, 3) => F::Uint32x3,
        (Scalar::U32, 4) => F::Uint32x4,
        (Scalar::I32, 1) => F::Sint32,
        (Scalar::I32, 2) => F::Sint32x2,
        (Scalar::I32, 3) => F::Sint32x3,
        (Scalar::I32, 4) => F::Sint32x4,
        _ => return None,
    })
}

impl VulkanDevice {
    pub(super) fn draw_pass(&mut self, pass: &Pass<'_>) -> Result<()> {
        let shape = self.check_pass(pass)?;
        let mut ready = Vec::with_capacity(pass.draws.len());
        for draw in pass.draws {
            ready.push(self.ready(pass, shape.samples, draw)?);
        }
        let colours = pass
            .colours
            .iter()
            .map(|c| {
                let resolve = c.resolve.map(|id| self.image(id).map(|t| t.view.clone()));
                Ok((
                    self.image(c.texture)?.view.clone(),
                    resolve.transpose()?,
                    c.clear,
                ))
            })
            .collect::<Result<Vec<_>>>()?;
        let depth = match pass.depth {
            Some(depth) => Some((self.image(depth.texture)?.view.clone(), depth)),
            None => None,
        };
        self.guarded(&|| format!("drawing pass `{}`", pass.label), |device| {
            let mut encoder = device.create_command_encoder(&Default::default());
            self.timed(&mut encoder, |encoder| {
                let colours: Vec<_> = colours.iter().map(|c| Some(colour_attachment(c))).collect();
                let mut encoded = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                    label: Some(pass.label),
                    color_attachments: &colours,
                    depth_stencil_attachment: depth
                        .as_ref()
                        .map(|(view, depth)| depth_attachment(view, depth)),
                    ..Default::default()
                });
                for draw in &ready {
                    encoded.set_pipeline(&draw.pipeline);
                    for (i, group) in (0..).zip(&draw.groups) {
                        encoded.set_bind_group(i, group, &[]);
                    }
                    if !draw.pushed.is_empty() {
                        encoded.set_immediates(0, &draw.pushed);
                    }
                    for (i, buffer) in (0..).zip(&draw.attributes) {
                        encoded.set_vertex_buffer(i, buffer.slice(..));
                    }
                    if let Some(indices) = &draw.indices {
                        encoded.set_index_buffer(indices.slice(..), wgpu::IndexFormat::Uint32);
                        encoded.draw_indexed(0..draw.count, 0, 0..1);
                    } else {
                        encoded.draw(0..draw.count, 0..1);
                    }
                }
            });
            self.queue.submit([encoder.finish()]);
        })
    }

    /// Checks that the targets fit together; gives the shape that they share.
    fn check_pass(&self, pass: &Pass<'_>) -> Result<TextureShape> {
        let bad = |problem: String| DeviceError::Pass {
            pass: pass.label.into(),
            problem,
        };
        let mut shared: Option<TextureShape> = None;
        let mut targets: Vec<(String, TextureShape)> = Vec::new();
        for (
            i,
            Colour {
                texture,
                resolve,
                blend,
                ..
            },
        ) in pass.colours.iter().enumerate()
        {
            let target = self.image(*texture)?;
            let shape = target.shape;
            if shape.format == Format::Depth32 {
                return Err(bad(format!("colour target {i} is a depth buffer")));
            }
            if *blend != Blend::Off && !shape.format.is_blendable() {
                return Err(bad(format!(
                    "colour target {i} is {}, which no device can blend: use floats or normalised integers",
                    shape.format.name()
                )));
            }
            let blends_floats = self
                .device
                .features()
                .contains(wgpu::Features::FLOAT32_BLENDABLE);
            if *blend != Blend::Off && shape.format.has_32_bit_floats() && !blends_floats {
                return Err(bad(format!(
                    "colour target {i} is {}, and {} cannot blend 32-bit floats: use 16 bits",
                    shape.format.name(),
                    self.name
                )));
            }
            if let Some(id) = resolve {
                let to = self.image(*id)?.shape;
                if shape.samples == 1
                    || to
                        != (TextureShape {
                            samples: 1,
                            ..shape
                        })
                {
                    return Err(bad(format!(
                        "colour target {i} ({shape:?}) cannot be resolved into {to:?}: give the \
                         same size and format with one sample"
                    )));
                }
            }
            targets.push((format!("colour target {i}"), shape));
        }
        if let Some(depth) = pass.depth {
            let shape = self.image(depth.texture)?.shape;
            if shape.format != Format::Depth32 {
                return Err(bad(format!("its depth buffer is {}", shape.format.name())));
            }
            targets.push(("the depth buffer".into(), shape));
        }
        for (name, shape) in targets {
            let first = *shared.get_or_insert(shape);
            if shape.dimensions != 2 {
                return Err(bad(format!("{name} has three dimensions")));
            }
            if (shape.size, shape.samples) != (first.size, first.samples) {
                return Err(bad(format!(
                    "{name} is {}x{} with {} samples, the first target {}x{} with {}",
                    shape.size[0],
                    shape.size[1],
                    shape.samples,
                    first.size[0],
                    first.size[1],
                    first.samples
                )));
            }
        }
        shared.ok_or_else(|| bad("it has neither a colour target nor a depth buffer".into()))
    }

    fn ready(&mut self, pass: &Pass<'_>, samples: u32, draw: &Draw<'_>) -> Result<Ready> {
        let bad = |problem: String| DeviceError::Pass {
            pass: pass.label.into(),
            problem,
        };
        let vertex = draw.vertex.kernel;
        if vertex.stage != Stage::Vertex {
            return Err(wrong_stage(vertex, "vertex"));
        }
        self.check_link(pass, draw)?;
        let (slots, given) =
            self.checked(&draw.vertex, slots::drawn_slots(vertex), draw.vertex_args)?;
        let mut formats = Vec::new();
        let mut attributes = Vec::new();
        for ((slot, given), bind) in slots.iter().zip(&given).zip(draw.vertex_args) {
            let Use::Attribute(location, ty) = slot.role else {
                continue;
            };
            let format = vertex_format(ty).ok_or_else(|| {
                slots::refuse(
                    vertex,
                    slot,
                    "attributes are 32-bit numbers or vectors".into(),
                )
            })?;
            let bytes = match given {
                Given::Buffer { bytes, .. } => *bytes,
                Given::Bytes(bytes) => bytes.len(),
                Given::Texture { .. } | Given::Sampler(_) => 0,
            };
            let elements = bytes / slots::type_bytes(ty);
            if draw.indices.is_none() && elements < draw.count as usize {
                return Err(slots::refuse(
                    vertex,
                    slot,
                    format!(
                        "it has {elements} elements, but {} vertices are drawn",
                        draw.count
                    ),
                ));
            }
            formats.push((location, format));
            attributes.push(self.buffer_of(bind)?.0);
        }
        let indices = draw
            .indices
            .map(|id| self.index_buffer(id, draw.count))
            .transpose()?;
        let bound = self.bind(
            &draw.vertex,
            &slots,
            draw.vertex_args,
            wgpu::ShaderStages::VERTEX,
        )?;
        let linked = self.link(&draw.vertex, &slots, VERTEX_SET)?;
        let vertex_stage = (linked.module, linked.entry_point, bound.layout.clone());
        let mut groups = vec![bound.group];
        let mut pushed = bound.pushed;
        let mut fragment_stage = None;
        if let Some(fragment) = &draw.fragment {
            let slots = slots::drawn_slots(fragment.kernel);
            let (slots, _) = self.checked(fragment, slots, draw.fragment_args)?;
            let visible = wgpu::ShaderStages::FRAGMENT;
            let bound = self.bind(fragment, &slots, draw.fragment_args, visible)?;
            let linked = self.link(fragment, &slots, FRAGMENT_SET)?;
            fragment_stage = Some((linked.module, linked.entry_point, bound.layout));
            groups.push(bound.group);
            // The stages have one block of them.
            if !pushed.is_empty() && !bound.pushed.is_empty() && pushed != bound.pushed {
                return Err(bad(
                    "both stages have push constants, and other ones: give them the same bytes, or make one of them a uniform"
                        .into(),
                ));
            }
            if pushed.is_empty() {
                pushed = bound.pushed;
            }
        } else if !draw.fragment_args.is_empty() {
            return Err(bad(
                "fragment arguments were given without a fragment kernel".into(),
            ));
        }
        let targets = pass
            .colours
            .iter()
            .map(|c| {
                let format = self.image(c.texture)?.shape.format;
                Ok((resources::format(format), c.blend))
            })
            .collect::<Result<Vec<_>>>()?;
        let key = RenderKey {
            vertex: vertex_stage,
            fragment: fragment_stage,
            attributes: formats,
            targets,
            depth: pass.depth.map(|d| (d.test, d.write)),
            samples,
            topology: draw.topology,
            cull: draw.cull,
            immediate_size: pushed.len() as u32,
        };
        let pipeline = self.render_pipeline(pass, draw, key)?;
        Ok(Ready {
            pipeline,
            groups,
            pushed,
            attributes,
            indices,
            count: draw.count,
        })
    }

    fn index_buffer(&self, id: BufferId, count: u32) -> Result<wgpu::Buffer> {
        let memory = self.memory(id)?;
        if memory.bytes / 4 < count as usize {
            return Err(DeviceError::Transfer {
                what: memory.what(),
                problem: format!("it holds {} indices, {count} are drawn", memory.bytes / 4),
            });
        }
        Ok(memory.buffer.clone())
    }

    /// Checks that the stages fit together and the targets.
    fn check_link(&self, pass: &Pass<'_>, draw: &Draw<'_>) -> Result<()> {
        let bad = |problem: String| DeviceError::Pass {
            pass: pass.label.into(),
            problem,
        };
        let vertex = draw.vertex.kernel;
        let Some(fragment) = draw.fragment.map(|f| f.kernel) else {
            return if pass.colours.is_empty() {
                Ok(())
            } else {
                Err(bad(
                    "it has colour targets, but a draw call without a fragment kernel".into(),
                ))
            };
        };
        if fragment.stage != Stage::Fragment {
            return Err(wrong_stage(fragment, "fragment"));
        }
        for Param { name, role, .. } in &fragment.params {
            let Role::Varying {
                location,
                ty,
                interpolation,
            } = role
            else {
                continue;
            };
            let made = vertex.outputs.iter().find_map(|o| match o {
                Output::Varying {
                    location: l,
                    ty,
                    interpolation,
                } if l == location => Some((ty, interpolation)),
                _ => None,
            });
            if made != Some((ty, interpolation)) {
                return Err(bad(format!(
                    "kernel `{}` reads varying `{name}` at location {location}, which kernel `{}` \
                     {}",
                    fragment.name,
                    vertex.name,
                    if made.is_some() {
                        "makes with another type or another interpolation"
                    } else {
                        "does not make"
                    }
                )));
            }
        }
        let mut targets = 0;
        if fragment.outputs.contains(&Output::Depth) && pass.depth.is_none() {
            return Err(bad(format!(
                "kernel `{}` writes a depth, but the pass has no depth buffer",
                fragment.name
            )));
        }
        for output in &fragment.outputs {
            let Output::Target { location, ty } = output else {
                continue;
            };
            targets += 1;
            let Some(colour) = pass.colours.get(*location as usize) else {
                return Err(bad(format!(
                    "kernel `{}` writes colour target {location}, which the pass lacks",
                    fragment.name
                )));
            };
            let format = self.image(colour.texture)?.shape.format;
            let numbers = slots::target_channels(ty);
            if format.texel().numbers() != numbers {
                return Err(bad(format!(
                    "colour target {location} is {}, but kernel `{}` writes {}",
                    format.name(),
                    fragment.name,
                    match numbers {
                        Channels::Float => "floats",
                        Channels::Uint => "unsigned integers",
                        Channels::Sint => "signed integers",
                    }
                )));
            }
        }
        let second = fragment
            .outputs
            .iter()
            .any(|it| matches!(it, Output::SecondSource { .. }));
        if !second && pass.colours.iter().any(|it| it.blend == Blend::Second) {
            return Err(bad(format!(
                "it blends with a second source, which kernel `{}` does not return",
                fragment.name
            )));
        }
        if targets != pass.colours.len() {
            return Err(bad(format!(
                "it has {} colour targets, but kernel `{}` writes {targets}",
                pass.colours.len(),
                fragment.name
            )));
        }
        Ok(())
    }

    fn render_pipeline(
        &mut self,
        pass: &Pass<'_>,
        draw: &Draw<'_>,
        key: RenderKey,
    ) -> Result<wgpu::RenderPipeline> {
        if let Some(pipeline) = self.pipelines.render.get(&key) {
            return Ok(pipeline.clone());
        }
        let during = || {
            let fragment = draw
                .fragment
                .map_or_else(String::new, |f| format!(", `{}`", f.kernel.name));
            format!(
                "compiling kernels `{}`{fragment} for pass `{}`",
                draw.vertex.kernel.name, pass.label
            )
        };
        let attributes: Vec<[wgpu::VertexAttribute; 1]> = key
            .attributes
            .iter()
            .map(|&(shader_location, format)| {
                [wgpu::VertexAttribute {
                    format,
                    offset: 0,
                    shader_location,
                }]
            })
            .collect();
        let buffers: Vec<Option<wgpu::VertexBufferLayout<'_>>> = attributes
            .iter()
            .map(|attribute| {
                Some(wgpu::VertexBufferLayout {
                    array_stride: attribute[0].format.size(),
                    step_mode: wgpu::VertexStepMode::Vertex,
                    attributes: attribute,
                })
            })
            .collect();
        let targets: Vec<Option<wgpu::ColorTargetState>> = key
            .targets
            .iter()
            .map(|&(format, blend)| {
                Some(wgpu::ColorTargetState {
                    format,
                    blend: blend_state(blend),
                    write_mask: wgpu::ColorWrites::ALL,
                })
            })
            .collect();
        let pipeline = self
            .guarded(&during, |device| {
                caught(|| {
                    let mut layouts = vec![Some(&key.vertex.2)];
                    layouts.extend(key.fragment.as_ref().map(|f| Some(&f.2)));
                    let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
                        label: Some(pass.label),
                        bind_group_layouts: &layouts,
                        immediate_size: key.immediate_size,
                    });
                    device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
                        label: Some(pass.label),
                        layout: Some(&layout),
                        vertex: wgpu::VertexState {
                            module: &key.vertex.0,
                            entry_point: Some(&key.vertex.1),
                            compilation_options: Default::default(),
                            buffers: &buffers,
                        },
                        primitive: wgpu::PrimitiveState {
                            topology: match key.topology {
                                Topology::Triangles => wgpu::PrimitiveTopology::TriangleList,
                                Topology::Points => wgpu::PrimitiveTopology::PointList,
                            },
                            cull_mode: match key.cull {
                                Cull::None => None,
                                Cull::Back => Some(wgpu::Face::Back),
                                Cull::Front => Some(wgpu::Face::Front),
                            },
                            ..Default::default()
                        },
                        depth_stencil: key.depth.map(|(test, write)| wgpu::DepthStencilState {
                            format: wgpu::TextureFormat::Depth32Float,
                            depth_write_enabled: Some(write),
                            depth_compare: Some(match test {
                                DepthTest::Less => wgpu::CompareFunction::Less,
                                DepthTest::LessEqual => wgpu::CompareFunction::LessEqual,
                                DepthTest::Greater => wgpu::CompareFunction::Greater,
                                DepthTest::Always => wgpu::CompareFunction::Always,
                            }),
                            stencil: Default::default(),
                            bias: Default::default(),
                        }),
                        multisample: wgpu::MultisampleState {
                            count: key.samples,
                            ..Default::default()
                        },
                        fragment: key.fragment.as_ref().map(|f| wgpu::FragmentState {
                            module: &f.0,
                            entry_point: Some(&f.1),
                            compilation_options: Default::default(),
                            targets: &targets,
                        }),
                        multiview_mask: None,
                        cache: None,
                    })
                })
            })?
            .map_err(|detail| DeviceError::Refused {
                during: during(),
                detail,
            })?;
        self.pipelines.render.insert(key, pipeline.clone());
        Ok(pipeline)
    }
}

fn wrong_stage(kernel: &Kernel, wanted: &str) -> DeviceError {
    DeviceError::Stage {
        kernel: kernel.name.clone(),
        stage: model(&kernel.stage).1,
        problem: format!("it was given as the {wanted} stage of a draw call"),
    }
}

/// [`Blend`] as wgpu has it.
fn blend_state(blend: Blend) -> Option<wgpu::BlendState> {
    use wgpu::{BlendFactor, BlendOperation};
    let alike = |src_factor, dst_factor, operation| {
        let component = wgpu::BlendComponent {
            src_factor,
            dst_factor,
            operation,
        };
        Some(wgpu::BlendState {
            color: component,
            alpha: component,
        })
    };
    match blend {
        Blend::Off => None,
        Blend::Alpha => Some(wgpu::BlendState::ALPHA_BLENDING),
        Blend::Additive => alike(BlendFactor::One, BlendFactor::One, BlendOperation::Add),
        Blend::Multiplicative => alike(BlendFactor::Dst, BlendFactor::Zero, BlendOperation::Add),
        Blend::Least => alike(BlendFactor::One, BlendFactor::One, BlendOperation::Min),
        Blend::Second => alike(BlendFactor::Zero, BlendFactor::Src1, BlendOperation::Add),
    }
}

fn colour_attachment(
    (view, resolve, clear): &(
        wgpu::TextureView,
        Option<wgpu::TextureView>,
        Option<[f64; 4]>,
    ),
) -> wgpu::RenderPassColorAttachment<'_> {
    wgpu::RenderPassColorAttachment {
        view,
        depth_slice: None,
        resolve_target: resolve.as_ref(),
        ops: wgpu::Operations {
            load: match *clear {
                Some([r, g, b, a]) => wgpu::LoadOp::Clear(wgpu::Color { r, g, b, a }),
                None => wgpu::LoadOp::Load,
            },
            store: wgpu::StoreOp::Store,
        },
    }
}

fn depth_attachment<'a>(
    view: &'a wgpu::TextureView,
    depth: &Depth,
) -> wgpu::RenderPassDepthStencilAttachment<'a> {
    wgpu::RenderPassDepthStencilAttachment {
        view,
        depth_ops: Some(wgpu::Operations {
            load: depth.clear.map_or(wgpu::LoadOp::Load, wgpu::LoadOp::Clear),
            store: wgpu::StoreOp::Store,
        }),
        stencil_ops: None,
    }
}
