//! The passes of a plan on a device.

use std::time::Instant;

use bytemuck::{bytes_of, cast_slice};
use hankel_dsl::glam::{Mat4, Vec3, Vec4};
use hankel_dsl::native::describe::{Kernel, Output, Role, TexelFormat};
use hankel_dsl::native::{Entry, Sampler};
use hankel_shadows::blur::Direction;
use hankel_shadows::depth::Transform;
use hankel_shadows::shade::{Light, encoding};

use super::cast::{Caster, Lens, SAMPLES};
use super::error::{FrameError, Result};
use super::fragments::{Fragments, Varying};
use super::plan::{Pass, Plan};
use super::{Picture, Progress, Rendering, Shaders, Timing};
use crate::device::{
    self, Arithmetic, Backend, Bind, BufferId, Colour, Cull, Depth, DepthTest, Device, DeviceError,
    Draw, Program, TextureId, TextureShape, Topology,
};
use crate::scene::{CameraView, DepthRange, LightView, MapFormat, Mesh, Scene, Shadow, Technique};

/// What is seen where nothing is: a pale sky, in linear light.
const BACKGROUND: [f32; 3] = [0.5, 0.6, 0.72];
/// Light from the sky.
const AMBIENT: Vec4 = Vec4::new(0.24, 0.28, 0.33, 0.0);
/// What the light adds on a surface that faces it.
const IRRADIANCE: f32 = 1.15;
/// What pictures are kept in until they are encoded: linear light.
const PICTURE: TexelFormat = TexelFormat::Rgba16Float;

pub(super) struct Frame<'a> {
    device: &'a mut dyn Device,
    scene: &'a Scene,
    mesh: &'a Mesh,
    shaders: &'a dyn Shaders,
    progress: &'a mut dyn Progress,
    entries: Vec<Entry>,
    plan: Plan,
    light: LightView,
    camera: CameraView,
    geometry: GeometryBuffers,
    /// Rays are cast natively only.
    caster: Option<Caster<'a>>,
    timings: Vec<Timing>,
    made: Vec<TextureId>,
    edges: Option<f64>,
}

/// The mesh on the device.
struct GeometryBuffers {
    positions: BufferId,
    normals: BufferId,
    colours: BufferId,
    indices: BufferId,
}

fn transform(clip_from_world: Mat4) -> Transform {
    Transform {
        row_x: clip_from_world.row(0),
        row_y: clip_from_world.row(1),
        row_z: clip_from_world.row(2),
        row_w: clip_from_world.row(3),
    }
}

fn failed(during: &str) -> impl FnOnce(DeviceError) -> FrameError + '_ {
    move |source| FrameError::Device {
        during: during.into(),
        source,
    }
}

fn find<'a>(entries: &'a [Entry], name: &str) -> Result<&'a Entry> {
    entries
        .iter()
        .find(|e| e.kernel.name == name)
        .ok_or_else(|| FrameError::Kernel {
            kernel: name.into(),
            problem: "it is not among the built-in kernels".into(),
        })
}

/// A kernel's code for one device. Only that kind of code is asked for.
fn program<'a>(
    entries: &'a [Entry],
    shaders: &'a dyn Shaders,
    backend: Backend,
    name: &str,
    constants: &'a [u32],
) -> Result<Program<'a>> {
    let arithmetic = Arithmetic::of([&find(entries, name)?.kernel]);
    routed(entries, shaders, backend, arithmetic, name, constants)
}

/// The two stages of a draw on Vulkan, which go the same way.
fn stages<'a>(
    entries: &'a [Entry],
    shaders: &'a dyn Shaders,
    vertex: &str,
    fragment: &str,
    constants: &'a [u32],
) -> Result<[Program<'a>; 2]> {
    let both = [
        &find(entries, vertex)?.kernel,
        &find(entries, fragment)?.kernel,
    ];
    let way = Arithmetic::of(both);
    let vulkan = Backend::Vulkan;
    Ok([
        routed(entries, shaders, vulkan, way, vertex, &[])?,
        routed(entries, shaders, vulkan, way, fragment, constants)?,
    ])
}

fn routed<'a>(
    entries: &'a [Entry],
    shaders: &'a dyn Shaders,
    backend: Backend,
    arithmetic: Arithmetic,
    name: &str,
    constants: &'a [u32],
) -> Result<Program<'a>> {
    let entry = find(entries, name)?;
    let shader = match backend {
        Backend::Native => None,
        Backend::Vulkan => {
            let words = shaders.words(name).ok_or_else(|| FrameError::Kernel {
                kernel: name.into(),
                problem: "there is no shader of it: build the shaders first".into(),
            })?;
            Some(arithmetic.shader(words))
        }
    };
    Ok(Program {
        kernel: &entry.kernel,
        constants,
        native: Some(&entry.run),
        shader,
    })
}

impl<'a> Frame<'a> {
    pub(super) fn new(
        device: &'a mut dyn Device,
        scene: &'a Scene,
        mesh: &'a Mesh,
        shaders: &'a dyn Shaders,
        progress: &'a mut dyn Progress,
    ) -> Result<Self> {
        let start = Instant::now();
        let plan = Plan::new(scene);
        progress.begin("set-up", 0, plan.passes.len() + 1);
        let entries = hankel_shadows::entries();
        // What is missing shows before anything is drawn.
        for name in plan.kernels() {
            program(&entries, shaders, device.backend(), name, &[])?;
        }
        let during = "uploading the geometry";
        let mut upload =
            |name: &str, bytes: &[u8]| device.buffer_from(name, bytes).map_err(failed(during));
        let geometry = GeometryBuffers {
            positions: upload("positions", cast_slice(&mesh.positions))?,
            normals: upload("normals", cast_slice(&mesh.normals))?,
            colours: upload("colours", cast_slice(&mesh.colours))?,
            indices: upload("indices", cast_slice(mesh.indices()))?,
        };
        let native = device.backend() == Backend::Native;
        let shadow = &scene.shadow;
        let aspect = scene.width as f32 / scene.height as f32;
        Ok(Self {
            // The filter and the sampler's interpolation stay inside of the map.
            light: LightView::new(scene.light, mesh, shadow.size, shadow.filter / 2 + 1),
            camera: CameraView::new(&scene.camera, mesh, aspect),
            caster: native.then(|| Caster::new(mesh)),
            timings: vec![Timing::new("set-up", start.elapsed())],
            made: Vec::new(),
            edges: None,
            device,
            scene,
            mesh,
            shaders,
            progress,
            entries,
            plan,
            geometry,
        })
    }

    pub(super) fn run(mut self) -> Result<Rendering> {
        let passes = self.plan.passes.clone();
        let mut map = None;
        let mut picture = None;
        for (i, pass) in passes.iter().enumerate() {
            self.progress.begin(pass.name(), i + 1, passes.len() + 1);
            let start = Instant::now();
            match pass {
                Pass::Depth { size, samples } => map = Some(self.depth(*size, *samples)?),
                Pass::Resolve {
                    kernel,
                    size,
                    format,
                } => {
                    let depth = map.ok_or_else(|| out_of_order(pass))?;
                    map = Some(self.filter(
                        pass.name(),
                        kernel,
                        *size,
                        *format,
                        &[Bind::Texture(depth)],
                    )?);
                }
                Pass::Blur {
                    kernel,
                    step,
                    weights,
                    size,
                    format,
                } => {
                    let source = map.ok_or_else(|| out_of_order(pass))?;
                    let direction = Direction {
                        step: (*step).into(),
                    };
                    map = Some(self.filter(
                        pass.name(),
                        kernel,
                        *size,
                        *format,
                        &[
                            Bind::Bytes(bytes_of(&direction)),
                            Bind::Bytes(cast_slice(weights)),
                            Bind::Texture(source),
                        ],
                    )?);
                }
                Pass::Shade {
                    kernel,
                    width,
                    height,
                    samples,
                } => {
                    let map = map.ok_or_else(|| out_of_order(pass))?;
                    picture = Some(self.shade(kernel, [*width, *height], *samples, map)?);
                }
            }
            self.device.wait().map_err(failed(pass.name()))?;
            self.progress.advance(1.0);
            self.timings.push(Timing::new(pass.name(), start.elapsed()));
        }
        let start = Instant::now();
        let texels = match picture {
            Some(Shaded::There(texture)) => self
                .device
                .read_texture(texture)
                .map_err(failed("reading the picture back"))?,
            Some(Shaded::Here(texels)) => texels,
            None => Vec::new(),
        };
        let picture = Picture::from_linear(
            self.scene.width,
            self.scene.height,
            texels
                .chunks_exact(PICTURE.bytes())
                .map(|t| PICTURE.load(t)),
        );
        self.timings.push(Timing::new("read back", start.elapsed()));
        self.free()?;
        Ok(Rendering {
            picture,
            device: self.device.name().into(),
            triangles: self.mesh.triangles.len(),
            texel: self.light.texel,
            edges: self.edges,
            plan: self.plan,
            timings: self.timings,
        })
    }

    /// The device outlives the frame.
    fn free(&mut self) -> Result<()> {
        let GeometryBuffers {
            positions,
            normals,
            colours,
            indices,
        } = self.geometry;
        for id in [positions, normals, colours, indices] {
            self.device
                .free_buffer(id)
                .map_err(failed("freeing buffers"))?;
        }
        for id in self.made.drain(..) {
            self.device
                .free_texture(id)
                .map_err(failed("freeing textures"))?;
        }
        Ok(())
    }

    fn texture(&mut self, label: &str, shape: &TextureShape) -> Result<TextureId> {
        let id = self.device.texture(label, shape).map_err(failed(label))?;
        self.made.push(id);
        Ok(id)
    }

    fn depth(&mut self, size: u32, samples: u32) -> Result<TextureId> {
        let uniform = transform(self.light.clip_from_world);
        if self.caster.is_some() {
            let outputs = self.vertices("light_depth", &[Bind::Bytes(bytes_of(&uniform))])?;
            let clip: Vec<Vec4> = bytemuck::pod_collect_to_vec(&outputs[0]);
            let Some(caster) = &self.caster else {
                return Err(no_caster());
            };
            let lens = Lens::new(self.light.clip_from_world, size, size);
            let progress = &mut *self.progress;
            let depths = caster.depths(&lens, &clip, size, &mut |share| progress.advance(share));
            let shape = TextureShape::d2(size, size, TexelFormat::R32Float).multisampled(samples);
            let map = self.texture("depth", &shape)?;
            self.device
                .write_texture(map, cast_slice(&depths))
                .map_err(failed("depth"))?;
            return Ok(map);
        }
        let map = self.texture(
            "depth",
            &TextureShape::depth(size, size).multisampled(samples),
        )?;
        let vertex = program(
            &self.entries,
            self.shaders,
            Backend::Vulkan,
            "light_depth",
            &[],
        )?;
        self.device
            .draw(&device::Pass {
                label: "depth",
                colours: &[],
                depth: Some(depth_target(map)),
                draws: &[Draw {
                    vertex,
                    vertex_args: &[
                        Bind::Buffer(self.geometry.positions),
                        Bind::Bytes(bytes_of(&uniform)),
                    ],
                    fragment: None,
                    fragment_args: &[],
                    indices: Some(self.geometry.indices),
                    count: self.mesh.indices().len() as u32,
                    topology: Topology::Triangles,
                    cull: Cull::None,
                }],
            })
            .map_err(failed("depth"))?;
        Ok(map)
    }

    /// Runs a map over the texels of a new texture.
    fn filter(
        &mut self,
        label: &str,
        kernel: &str,
        size: u32,
        format: TexelFormat,
        args: &[Bind<'_>],
    ) -> Result<TextureId> {
        let target = self.texture(label, &TextureShape::d2(size, size, format))?;
        let program = program(
            &self.entries,
            self.shaders,
            self.device.backend(),
            kernel,
            &[],
        )?;
        let mut args = args.to_vec();
        args.push(Bind::Texture(target));
        self.device
            .dispatch(&program, &args)
            .map_err(failed(label))?;
        Ok(target)
    }

    /// The light as the shading kernels take it.
    fn light(&self) -> Light {
        let shadow = &self.scene.shadow;
        let clip = self.light.clip_from_world;
        let target = Shadow::published(shadow.depth_range, shadow.format).four();
        Light {
            row_u: clip.row(0) * 0.5 + Vec4::W * 0.5,
            // Rows of the map count from the top.
            row_v: clip.row(1) * -0.5 + Vec4::W * 0.5,
            row_depth: clip.row(2),
            toward: (-self.light.direction).extend(IRRADIANCE),
            ambient: AMBIENT,
            bias_target: Vec4::new(target.b1, target.b2, target.b3, target.b4),
            moment_bias: shadow.moment_bias,
            depth_bias: shadow.depth_bias,
            light_leak: shadow.leak_cut,
            filter_radius: shadow.filter / 2,
        }
    }

    fn shade(
        &mut self,
        kernel: &str,
        size: [u32; 2],
        samples: u32,
        map: TextureId,
    ) -> Result<Shaded> {
        let light = self.light();
        let light = Bind::Bytes(bytes_of(&light));
        let shadow = &self.scene.shadow;
        let pcf = shadow.technique == Technique::Pcf;
        let encoding = match (shadow.format, shadow.depth_range) {
            (MapFormat::Rgba32float, _) => encoding::PLAIN,
            (MapFormat::Rgba16unorm, DepthRange::Unit) => encoding::UNIT,
            (MapFormat::Rgba16unorm, DepthRange::Symmetric) => encoding::SYMMETRIC,
        };
        let constants: &[u32] = if pcf { &[] } else { &[encoding] };
        let sampler = Sampler::new(true, false);
        let mut args = vec![light, Bind::Texture(map)];
        if !pcf {
            args.push(Bind::Sampler(sampler));
        }
        let camera = transform(self.camera.clip_from_world);
        let camera = Bind::Bytes(bytes_of(&camera));
        if self.caster.is_some() {
            return self.shade_natively(kernel, size, &args, constants, camera);
        }
        let [width, height] = size;
        let shape = TextureShape::d2(width, height, PICTURE);
        let multisampled = self.texture("samples", &shape.multisampled(samples))?;
        let resolved = self.texture("picture", &shape)?;
        let depth = TextureShape::depth(width, height).multisampled(samples);
        let depth = self.texture("camera depth", &depth)?;
        let [r, g, b] = BACKGROUND.map(f64::from);
        let [vertex, fragment] = stages(&self.entries, self.shaders, "surface", kernel, constants)?;
        self.device
            .draw(&device::Pass {
                label: "shade",
                colours: &[Colour {
                    texture: multisampled,
                    resolve: Some(resolved),
                    clear: Some([r, g, b, 1.0]),
                }],
                depth: Some(depth_target(depth)),
                draws: &[Draw {
                    vertex,
                    vertex_args: &[
                        Bind::Buffer(self.geometry.positions),
                        Bind::Buffer(self.geometry.normals),
                        Bind::Buffer(self.geometry.colours),
                        camera,
                    ],
                    fragment: Some(fragment),
                    fragment_args: &args,
                    indices: Some(self.geometry.indices),
                    count: self.mesh.indices().len() as u32,
                    topology: Topology::Triangles,
                    cull: Cull::None,
                }],
            })
            .map_err(failed("shade"))?;
        Ok(Shaded::There(resolved))
    }

    fn shade_natively(
        &mut self,
        kernel: &str,
        size: [u32; 2],
        args: &[Bind<'_>],
        constants: &[u32],
        camera: Bind<'_>,
    ) -> Result<Shaded> {
        let lens = Lens::new(self.camera.clip_from_world, size[0], size[1]);
        let Some(caster) = &self.caster else {
            return Err(no_caster());
        };
        let progress = &mut *self.progress;
        // Shading is the rest.
        let fragments = Fragments::find(caster, &lens, size, &mut |share| {
            progress.advance(share * 0.7)
        });
        self.edges = Some(fragments.edges());
        let vertices = self.vertices("surface", &[camera])?;
        let surface = find(&self.entries, "surface")?.kernel.clone();
        let fragment = find(&self.entries, kernel)?.kernel.clone();
        let varyings = varyings(&surface, &fragment, &vertices)?;
        let values = fragments.interpolate(self.mesh, &lens, &varyings);
        let shaded = self.run_over(kernel, constants, &values, args, fragments.count())?;
        let colours: Vec<Vec4> = bytemuck::pod_collect_to_vec(&shaded);
        Ok(Shaded::Here(resolve(&fragments, &colours)))
    }

    /// Runs the fragment kernel over arrays of varyings; gives its target's bytes.
    fn run_over(
        &mut self,
        kernel: &str,
        constants: &[u32],
        varyings: &[Vec<f32>],
        args: &[Bind<'_>],
        count: usize,
    ) -> Result<Vec<u8>> {
        let entry = find(&self.entries, kernel)?;
        let target = self
            .device
            .buffer("target", count * size_of::<Vec4>())
            .map_err(failed("shade"))?;
        let mut all: Vec<Bind<'_>> = varyings
            .iter()
            .map(|v| Bind::Bytes(cast_slice(v)))
            .collect();
        all.extend_from_slice(args);
        all.push(Bind::Buffer(target));
        let program = Program {
            kernel: &entry.kernel,
            constants,
            native: Some(&entry.run),
            shader: None,
        };
        let done = self.device.dispatch(&program, &all);
        let bytes = done.and_then(|()| self.device.read_buffer(target));
        let freed = self.device.free_buffer(target);
        let bytes = bytes.map_err(failed("shade"))?;
        freed.map_err(failed("shade"))?;
        Ok(bytes)
    }

    /// Runs a vertex kernel natively over all vertices: the bytes of each of its outputs. `uniforms`
    /// follow the attributes.
    fn vertices(&mut self, name: &str, uniforms: &[Bind<'_>]) -> Result<Vec<Vec<u8>>> {
        let entry = find(&self.entries, name)?;
        let GeometryBuffers {
            positions,
            normals,
            colours,
            ..
        } = self.geometry;
        let attributes = entry
            .kernel
            .params
            .iter()
            .filter(|p| matches!(p.role, Role::Attribute { .. }))
            .count();
        let mut args: Vec<Bind<'_>> = [positions, normals, colours]
            .into_iter()
            .take(attributes)
            .map(Bind::Buffer)
            .collect();
        args.extend_from_slice(uniforms);
        let mut outputs = Vec::new();
        for output in &entry.kernel.outputs {
            let bytes = components(output) * size_of::<f32>() * self.mesh.positions.len();
            let id = self.device.buffer(name, bytes).map_err(failed(name))?;
            outputs.push(id);
            args.push(Bind::Buffer(id));
        }
        let program = Program {
            kernel: &entry.kernel,
            constants: &[],
            native: Some(&entry.run),
            shader: None,
        };
        self.device
            .dispatch(&program, &args)
            .map_err(failed(name))?;
        outputs
            .into_iter()
            .map(|id| {
                let bytes = self.device.read_buffer(id).map_err(failed(name))?;
                self.device.free_buffer(id).map_err(failed(name))?;
                Ok(bytes)
            })
            .collect()
    }
}

/// Where the shaded picture is.
enum Shaded {
    /// On the device.
    There(TextureId),
    /// In memory.
    Here(Vec<u8>),
}

/// Floats of a stage's output.
fn components(output: &Output) -> usize {
    match output {
        Output::Varying { ty, .. } | Output::Target { ty, .. } => {
            device::slots::type_bytes(ty) / size_of::<f32>()
        }
        _ => device::slots::type_bytes(&device::slots::POSITION) / size_of::<f32>(),
    }
}

/// What the vertex stage hands to the fragment stage, in the order in which that takes it.
fn varyings(surface: &Kernel, fragment: &Kernel, vertices: &[Vec<u8>]) -> Result<Vec<Varying>> {
    let wanted = fragment.params.iter().filter_map(|p| match &p.role {
        Role::Varying { location, .. } => Some(*location),
        _ => None,
    });
    wanted
        .map(|wanted| {
            surface
                .outputs
                .iter()
                .zip(vertices)
                .find(|(o, _)| matches!(o, Output::Varying { location, .. } if *location == wanted))
                .map(|(o, bytes)| Varying {
                    components: components(o),
                    vertices: bytemuck::pod_collect_to_vec(bytes),
                })
                .ok_or_else(|| FrameError::Kernel {
                    kernel: fragment.name.clone(),
                    problem: format!("nothing is handed to its location {wanted}"),
                })
        })
        .collect()
}

/// The mean of each pixel's samples, stored as the colour targets store them.
fn resolve(fragments: &Fragments, colours: &[Vec4]) -> Vec<u8> {
    let mut stored = [0; PICTURE.bytes()];
    let mut through = |c: Vec4| {
        PICTURE.store(&mut stored, c);
        PICTURE.load(&stored)
    };
    let background = through(Vec3::from(BACKGROUND).extend(1.0));
    let colours: Vec<Vec4> = colours.iter().map(|&c| through(c)).collect();
    let mut picture = Vec::new();
    let mut texel = [0; PICTURE.bytes()];
    for samples in fragments.samples() {
        let sum: Vec4 = samples
            .iter()
            .map(|s| s.map_or(background, |i| colours[i]))
            .sum();
        PICTURE.store(&mut texel, sum / SAMPLES.len() as f32);
        picture.extend_from_slice(&texel);
    }
    picture
}

fn depth_target(texture: TextureId) -> Depth {
    Depth {
        texture,
        clear: Some(1.0),
        test: DepthTest::Less,
        write: true,
    }
}

fn out_of_order(pass: &Pass) -> FrameError {
    FrameError::Kernel {
        kernel: pass.name().into(),
        problem: "its pass comes before the one that makes its input".into(),
    }
}

fn no_caster() -> FrameError {
    FrameError::Kernel {
        kernel: "light_depth".into(),
        problem: "rays are cast on the native device only".into(),
    }
}
