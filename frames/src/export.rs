//! An exported frame: a graph as `frame.json` says it. Resources, passes and uniforms come from the
//! graph and from the kernels' descriptions; nothing here knows a technique, a pass or a format by name.

use std::collections::{BTreeMap, BTreeSet};

use hankel_codegen::frame::{
    self, Attribute, BlendComponent, Buffer, BufferUsage, Call as ShaderCall, ColourTarget,
    DepthTarget, Draft, Draw, Frame, Frozen, Indices, Pass as FramePass, Resource, Texture,
    TextureUsage, Uniform, WorkgroupsFrom,
};
use hankel_codegen::manifest::Versions;
use hankel_dsl::glam::Vec4;
use hankel_dsl::native::describe::{ConstantValue, Kernel, Role, Scalar, Stage, Type};
use hankel_dsl::native::{Address, Compare, Filter, Sampler};
use hankel_host::device::slots::{self, Use};
use hankel_host::device::{Blend, Cull, DepthTest, TextureShape, Topology};

use crate::frame::{Show, graph as graph_of};
use crate::graph::{
    Argument, Call, Graph, GraphError, Handle, Origin, Result, Shape, Surfaces, Target, Work,
};
use crate::lights::light_view;
use crate::scattering::Scattering;
use crate::scene::{Fit, Medium, Mesh, Scene, Shadow};
use crate::techniques::Technique;
use crate::visibility::{CULL, FAR, SEEN, TOPOLOGY};

/// The frame of a scene, for [`hankel_codegen::frame::generate`]; `file` is the scene's name in it.
///
/// # Errors
/// [`GraphError`] for a technique that does not fit its kernels, or a vertex attribute that no graphics
/// API has a format for.
pub fn export(scene: &Scene, file: &str, mesh: &Mesh) -> Result<Draft> {
    let (graph, _, picture) = graph_of(scene, mesh, Show::Picture)?;
    let shadow = &scene.shadow;
    // Each light has its own in its uniforms.
    let view = light_view(scene, &scene.lights[0], mesh);
    let shadow = frame::Shadow {
        technique: shadow.technique.name.into(),
        format: shadow.map.format.name().into(),
        depth_range: shadow.map.depth_range.name().into(),
        size: shadow.size,
        multisampling: shadow.multisampling,
        filter: shadow.filter,
        fit: shadow.fit.name().into(),
        samples: shadow.samples,
        moment_bias: shadow.moment_bias,
        depth_bias: shadow.depth_bias.share(&view, shadow.radius()),
        leak_cut: shadow.leak_cut,
        mips: shadow.mips,
        anisotropy: shadow.anisotropy,
    };
    let needed = graph.needed();
    let mut export = Export::new(&graph, &needed);
    let passes = graph.passes().iter().zip(&needed).filter(|(_, n)| **n);
    let passes = passes
        .map(|(pass, _)| export.pass(&pass.label, &pass.work, &pass.writes))
        .collect::<Result<_>>()?;
    let picture = export.name(picture);
    Ok(Draft {
        frame: Frame {
            format: frame::FORMAT,
            made_by: Versions::with(""),
            scene: file.into(),
            shadow,
            scattering: scene.medium.map(|medium| frame::Scattering {
                technique: medium.technique.name.into(),
                steps: medium.steps,
            }),
            image_passes: scene.image_passes.name().into(),
            picture,
            buffers: export.buffers,
            textures: export.textures,
            samplers: export
                .samplers
                .into_iter()
                .map(|(_, n, s)| (n, s))
                .collect(),
            uniforms: export.uniforms,
            shaders: BTreeMap::new(),
            passes,
        },
        shaders: export.shaders,
        contents: export.contents,
    })
}

/// The way to make shadows that a frame says it has; `None` if there is none like it. What else a scene
/// file may say of shadows, biases for example, is as the technique has it.
#[must_use]
pub fn recorded(shadow: &frame::Shadow) -> Option<Shadow> {
    let technique = Technique::named(&shadow.technique)?;
    let map = technique.maps.iter().find(|map| {
        (map.format.name(), map.depth_range.name())
            == (shadow.format.as_str(), shadow.depth_range.as_str())
    })?;
    let fit = [Fit::Scene, Fit::Camera];
    Some(Shadow {
        size: shadow.size,
        multisampling: shadow.multisampling,
        filter: shadow.filter,
        fit: fit.into_iter().find(|fit| fit.name() == shadow.fit)?,
        mips: shadow.mips,
        anisotropy: shadow.anisotropy,
        ..Shadow::of(technique, *map)
    })
}

/// A medium whose light is made as a frame says it is; `None` if there is no such technique.
#[must_use]
pub fn recorded_medium(medium: &Medium, scattering: &frame::Scattering) -> Option<Medium> {
    Some(Medium {
        technique: Scattering::named(&scattering.technique)?,
        steps: scattering.steps,
        ..*medium
    })
}

/// What has been said of a graph so far.
struct Export<'g> {
    graph: &'g Graph,
    /// Names of shaders, by kernel and values of its constants.
    calls: BTreeMap<(usize, Vec<u32>), String>,
    /// Names of resources, by the value that was first in their place.
    names: BTreeMap<usize, String>,
    taken: BTreeSet<String>,
    buffers: BTreeMap<String, Buffer>,
    textures: BTreeMap<String, Texture>,
    samplers: Vec<(Sampler, String, frame::Sampler)>,
    uniforms: BTreeMap<String, Uniform>,
    shaders: BTreeMap<String, Frozen>,
    contents: BTreeMap<String, Vec<u8>>,
}

/// Where a resource is used.
#[derive(Clone, Copy)]
struct Place<'a> {
    pass: &'a str,
    parameter: &'a str,
}

impl<'g> Export<'g> {
    fn new(graph: &'g Graph, needed: &[bool]) -> Self {
        let mut values: BTreeMap<usize, BTreeSet<&[u32]>> = BTreeMap::new();
        let passes = graph.passes().iter().zip(needed).filter(|(_, n)| **n);
        for call in passes.flat_map(|(pass, _)| Graph::calls(pass)) {
            values
                .entry(call.kernel)
                .or_default()
                .insert(&call.constants);
        }
        let mut calls = BTreeMap::new();
        let mut shaders = BTreeMap::new();
        for (number, all) in values {
            let kernel = &graph.kernels()[number].kernel;
            let params = kernel.params.iter().filter_map(|p| match p.role {
                Role::Constant { scalar, .. } => Some((&p.name, scalar)),
                _ => None,
            });
            for constants in &all {
                let given = params.clone().zip(constants.iter().copied());
                // A kernel that is called with several values has a shader for each. Of a number that is no part of a
                // name, the bits are.
                let mut name = kernel.name.clone();
                if all.len() > 1 {
                    for ((constant, _), word) in given.clone() {
                        name.push_str(&format!("_{constant}_{word}"));
                    }
                }
                let values = given.map(|((constant, scalar), word)| {
                    (constant.clone(), ConstantValue::of_word(scalar, word))
                });
                let frozen = Frozen {
                    kernel: kernel.name.clone(),
                    constants: values.collect(),
                };
                shaders.insert(name.clone(), frozen);
                calls.insert((number, constants.to_vec()), name);
            }
        }
        Self {
            graph,
            calls,
            names: BTreeMap::new(),
            taken: BTreeSet::new(),
            buffers: BTreeMap::new(),
            textures: BTreeMap::new(),
            samplers: Vec::new(),
            uniforms: BTreeMap::new(),
            shaders,
            contents: BTreeMap::new(),
        }
    }

    /// A name that nothing has, like a label.
    fn unique(&mut self, label: &str) -> String {
        let label = label.replace("'s", "").to_ascii_lowercase();
        let words = label.split(|c: char| !c.is_ascii_alphanumeric());
        let words: Vec<&str> = words.filter(|word| !word.is_empty()).collect();
        let stem = match words.join("_") {
            none if none.is_empty() => "value".into(),
            stem => stem,
        };
        let mut name = stem.clone();
        let mut number = 2;
        while !self.taken.insert(name.clone()) {
            name = format!("{stem}_{number}");
            number += 1;
        }
        name
    }

    /// The name of what holds a value, which is described when it is asked for first.
    fn name(&mut self, handle: Handle) -> String {
        let root = self.graph.root(handle);
        if let Some(name) = self.names.get(&root.at()) {
            return name.clone();
        }
        let value = &self.graph.values()[root.at()];
        let name = self.unique(&value.label);
        self.names.insert(root.at(), name.clone());
        match &value.shape {
            Shape::Texture(shape) => self.add_texture(&name, shape),
            Shape::Buffer { bytes, layout } => {
                let (contents, constant) = match &value.origin {
                    Origin::Given { bytes, is_constant } => {
                        let file = format!("{}/{name}.bin", frame::CONTENTS);
                        self.contents.insert(file.clone(), bytes.to_vec());
                        (Some(file), *is_constant)
                    }
                    Origin::Made { .. } | Origin::Changed { .. } => (None, false),
                };
                let buffer = Buffer {
                    bytes: *bytes as u64,
                    ty: frame::type_name(layout),
                    stride: layout.size,
                    usage: BTreeSet::new(),
                    contents,
                    constant,
                    meaning: self.graph.meaning(root).unwrap_or_default().into(),
                };
                self.buffers.insert(name.clone(), buffer);
            }
        }
        name
    }

    fn add_texture(&mut self, name: &str, shape: &TextureShape) {
        let texture = Texture {
            dimensions: shape.dimensions,
            size: shape.size,
            layers: shape.layers,
            levels: shape.levels,
            samples: shape.samples,
            format: shape.format.name().into(),
            usage: BTreeSet::new(),
        };
        self.textures.insert(name.into(), texture);
    }

    /// A texture that a draw needs for itself.
    fn scratch(&mut self, label: &str, shape: &TextureShape) -> String {
        let name = self.unique(label);
        self.add_texture(&name, shape);
        self.attachment(name)
    }

    /// A texture that is drawn into.
    fn attachment(&mut self, name: String) -> String {
        if let Some(texture) = self.textures.get_mut(&name) {
            texture.usage.insert(TextureUsage::RenderAttachment);
        }
        name
    }

    fn buffer(&mut self, handle: Handle, usage: BufferUsage) -> String {
        let name = self.name(handle);
        if let Some(buffer) = self.buffers.get_mut(&name) {
            buffer.usage.insert(usage);
        }
        name
    }

    /// What is bound to a parameter.
    fn bound(&mut self, place: Place<'_>, role: Use<'_>, argument: &Argument) -> Resource {
        let handle = match argument {
            Argument::Sampler(sampler) => return Resource::Sampler(self.sampler(place, *sampler)),
            Argument::Value(handle) => *handle,
        };
        let name = self.name(handle);
        if let Some(texture) = self.textures.get_mut(&name) {
            texture.usage.insert(match role {
                Use::StorageTexture { .. } => TextureUsage::StorageBinding,
                _ => TextureUsage::TextureBinding,
            });
            return Resource::Texture(name);
        }
        let usage = match role {
            Use::Uniform(_) => {
                self.uniform(place, handle, &name);
                BufferUsage::Uniform
            }
            _ => BufferUsage::Storage,
        };
        Resource::Buffer(self.buffer(handle, usage))
    }

    /// Says what a uniform's numbers are, if they are given.
    fn uniform(&mut self, place: Place<'_>, handle: Handle, name: &str) {
        let value = &self.graph.values()[handle.at()];
        let (Origin::Given { bytes, is_constant }, Shape::Buffer { layout, .. }) =
            (&value.origin, &value.shape)
        else {
            return;
        };
        if self.uniforms.contains_key(name) {
            return;
        }
        let meaning = match self.graph.meaning(handle) {
            Some(meaning) => meaning.to_owned(),
            None => format!("`{}` of pass `{}`.", place.parameter, place.pass),
        };
        let uniform = Uniform {
            meaning,
            constant: *is_constant,
            fields: frame::fields(layout, bytes),
        };
        self.uniforms.insert(name.to_owned(), uniform);
    }

    fn sampler(&mut self, place: Place<'_>, sampler: Sampler) -> String {
        if let Some((_, name, _)) = self.samplers.iter().find(|(it, ..)| *it == sampler) {
            return name.clone();
        }
        let name = self.unique(place.parameter);
        let described = frame::Sampler {
            mag_filter: filter(sampler.magnify).into(),
            min_filter: filter(sampler.minify).into(),
            mipmap_filter: filter(sampler.mip).into(),
            address_modes: sampler.address.map(|mode| address(mode).into()),
            compare: sampler.compare.map(|compare| comparison(compare).into()),
            max_anisotropy: sampler.anisotropy,
        };
        self.samplers.push((sampler, name.clone(), described));
        name
    }

    /// A shader with its arguments, and its vertex attributes.
    fn call(&mut self, pass: &str, call: &Call) -> Result<(ShaderCall, Vec<Attribute>)> {
        let kernel: &Kernel = &self.graph.kernels()[call.kernel].kernel;
        let names = frame::names(kernel);
        let mut bind = BTreeMap::new();
        let mut attributes = Vec::new();
        for (slot, argument) in slots::drawn_slots(kernel).iter().zip(&call.args) {
            if let (Use::Attribute(location, ty), Argument::Value(handle)) = (slot.role, argument) {
                let Some(format) = vertex_format(ty) else {
                    return Err(GraphError::Argument {
                        pass: pass.into(),
                        kernel: kernel.name.clone(),
                        parameter: slot.name.clone(),
                        problem:
                            "no graphics API has a vertex format for it: take an f32, u32, i32 or \
                                  a vector of them"
                                .into(),
                    });
                };
                attributes.push(Attribute {
                    name: slot.name.clone(),
                    location,
                    format,
                    buffer: self.buffer(*handle, BufferUsage::Vertex),
                    stride: slots::type_bytes(ty) as u32,
                });
                continue;
            }
            let Some(name) = slot.binding.and_then(|binding| names.get(&binding)) else {
                continue;
            };
            let place = Place {
                pass,
                parameter: name,
            };
            bind.insert(name.clone(), self.bound(place, slot.role, argument));
        }
        let key = (call.kernel, call.constants.clone());
        let shader = self.calls.get(&key).unwrap_or(&kernel.name).clone();
        Ok((ShaderCall { shader, bind }, attributes))
    }

    fn pass(&mut self, label: &str, work: &Work, writes: &[Handle]) -> Result<FramePass> {
        Ok(match work {
            Work::Clear(value) => {
                let is_zero = *value == Vec4::ZERO;
                let resources = writes.iter().map(|handle| {
                    let name = self.name(*handle);
                    if !self.textures.contains_key(&name) {
                        return Resource::Buffer(name);
                    }
                    Resource::Texture(if is_zero { name } else { self.attachment(name) })
                });
                FramePass::Clear {
                    label: label.into(),
                    resources: resources.collect(),
                    value: (!is_zero).then(|| value.to_array().map(f64::from)),
                }
            }
            Work::Levels(levels) => {
                let mut copied = |handle: &Handle, usage| {
                    let name = self.name(*handle);
                    if let Some(texture) = self.textures.get_mut(&name) {
                        texture.usage.insert(usage);
                    }
                    name
                };
                FramePass::Levels {
                    label: label.into(),
                    texture: writes.first().map_or_else(String::new, |made| {
                        copied(made, TextureUsage::CopyDestination)
                    }),
                    levels: levels
                        .iter()
                        .map(|level| copied(level, TextureUsage::CopySource))
                        .collect(),
                }
            }
            Work::Compute(call) => {
                let invocations = self.graph.invocations(call);
                let threads = match self.graph.kernels()[call.kernel].kernel.stage {
                    Stage::Compute { threads, .. } => threads,
                    Stage::Vertex | Stage::Fragment => [1; 3],
                };
                let groups = |i: usize| invocations[i].div_ceil(threads[i].max(1));
                let workgroups_from = self.graph.workgroups_from(call);
                let workgroups_from =
                    workgroups_from.map(|(handle, offset, dimensions)| WorkgroupsFrom {
                        buffer: self.name(handle),
                        offset,
                        dimensions,
                    });
                FramePass::Compute {
                    label: label.into(),
                    call: self.call(label, call)?.0,
                    invocations,
                    workgroups: [0, 1, 2].map(groups),
                    workgroups_from,
                }
            }
            Work::FullScreen { vertex, fragment } => {
                let targets = writes.iter().map(|handle| {
                    let name = self.name(*handle);
                    self.attachment(name)
                });
                let targets = targets.collect();
                FramePass::FullScreen {
                    label: label.into(),
                    vertex: self.call(label, vertex)?.0,
                    fragment: self.call(label, fragment)?.0,
                    targets,
                }
            }
            Work::Draw {
                surfaces,
                vertex,
                fragment,
                target,
            } => {
                let draw = self.draw(label, surfaces, vertex, fragment.as_ref(), target)?;
                FramePass::Draw(Box::new(draw))
            }
        })
    }

    fn draw(
        &mut self,
        label: &str,
        surfaces: &Surfaces,
        vertex: &Call,
        fragment: Option<&Call>,
        target: &Target,
    ) -> Result<Draw> {
        let (vertex, attributes) = self.call(label, vertex)?;
        let fragment = match fragment {
            Some(call) => Some(self.call(label, call)?.0),
            None => None,
        };
        let indices = self.graph.values()[surfaces.indices.at()].shape.bytes();
        let indices = Indices {
            buffer: self.buffer(surfaces.indices, BufferUsage::Index),
            format: "uint32".into(),
            count: (indices / size_of::<u32>()) as u32,
        };
        let texture = |handle: &Handle| match self.graph.values()[handle.at()].shape {
            Shape::Texture(shape) => Some(shape),
            Shape::Buffer { .. } => None,
        };
        let mut colour_targets = Vec::new();
        let depth_target = |texture: String, clear, store| DepthTarget {
            texture,
            clear,
            compare: match SEEN {
                DepthTest::Less => "less",
                DepthTest::LessEqual => "less-equal",
                DepthTest::Greater => "greater",
                DepthTest::Always => "always",
            }
            .into(),
            write: clear.is_some(),
            store,
        };
        let (depth_target, samples) = match target {
            Target::Depth { depth } => {
                let samples = texture(depth).map_or(1, |shape| shape.samples);
                let name = self.name(*depth);
                let depth = self.attachment(name);
                (Some(depth_target(depth, Some(FAR), true)), samples)
            }
            Target::Colour {
                colour,
                samples,
                background,
                blend,
                before,
            } => {
                let shape = texture(colour);
                let name = self.name(*colour);
                let drawn = self.attachment(name);
                let [width, height, _] = shape.map_or([1; 3], |shape| shape.size);
                let (texture, resolve) = match shape.filter(|shape| shape.samples < *samples) {
                    Some(shape) => {
                        let shape = shape.multisampled(*samples);
                        let all = self.scratch(&format!("{label} samples"), &shape);
                        (all, Some(drawn))
                    }
                    None => (drawn, None),
                };
                colour_targets.push(ColourTarget {
                    texture,
                    resolve,
                    clear: *background,
                    blend: blending(*blend),
                });
                let depth = match before {
                    Some(depth) => {
                        let name = self.name(*depth);
                        Some(depth_target(self.attachment(name), None, true))
                    }
                    None if *blend == Blend::Off => {
                        let shape = TextureShape::depth(width, height).multisampled(*samples);
                        let depth = self.scratch(&format!("{label} depth"), &shape);
                        Some(depth_target(depth, Some(FAR), false))
                    }
                    None => None,
                };
                (depth, *samples)
            }
        };
        Ok(Draw {
            label: label.into(),
            vertex,
            fragment,
            attributes,
            indices,
            topology: match TOPOLOGY {
                Topology::Triangles => "triangle-list",
                Topology::Points => "point-list",
            }
            .into(),
            cull_mode: match CULL {
                Cull::None => "none",
                Cull::Back => "back",
                Cull::Front => "front",
            }
            .into(),
            samples,
            colour_targets,
            depth_target,
        })
    }
}

/// WebGPU's words.
fn blending(blend: Blend) -> Option<frame::Blend> {
    let component = |operation: &str, source: &str, destination: &str| BlendComponent {
        operation: operation.into(),
        src_factor: source.into(),
        dst_factor: destination.into(),
    };
    let both = |component: BlendComponent| frame::Blend {
        color: component.clone(),
        alpha: component,
    };
    Some(match blend {
        Blend::Off => return None,
        Blend::Alpha => frame::Blend {
            color: component("add", "src-alpha", "one-minus-src-alpha"),
            alpha: component("add", "one", "one-minus-src-alpha"),
        },
        Blend::Additive => both(component("add", "one", "one")),
        Blend::Multiplicative => both(component("add", "zero", "src")),
        Blend::Least => both(component("min", "one", "one")),
        Blend::Second => both(component("add", "zero", "src1")),
    })
}

const fn filter(filter: Filter) -> &'static str {
    match filter {
        Filter::Nearest => "nearest",
        Filter::Linear => "linear",
    }
}

const fn address(address: Address) -> &'static str {
    match address {
        Address::ClampToEdge => "clamp-to-edge",
        Address::Repeat => "repeat",
        Address::MirrorRepeat => "mirror-repeat",
    }
}

const fn comparison(compare: Compare) -> &'static str {
    match compare {
        Compare::Never => "never",
        Compare::Less => "less",
        Compare::Equal => "equal",
        Compare::LessEqual => "less-equal",
        Compare::Greater => "greater",
        Compare::NotEqual => "not-equal",
        Compare::GreaterEqual => "greater-equal",
        Compare::Always => "always",
    }
}

/// `float32x3` and the like.
fn vertex_format(ty: &Type) -> Option<String> {
    let (scalar, size) = ty.components()?;
    let stem = match scalar {
        Scalar::F32 => "float32",
        Scalar::U32 => "uint32",
        Scalar::I32 => "sint32",
        Scalar::F64 | Scalar::U64 | Scalar::I64 | Scalar::Bool | Scalar::F16 => return None,
    };
    Some(match size {
        1 => stem.into(),
        size => format!("{stem}x{size}"),
    })
}
