//! Visibility by rays, for the device without a rasteriser: one ray through each sample, and the
//! stages' kernels over arrays of what the rays found.
//!
//! A tree is built when triangles change, rays through pixels are cast when the view changes; what
//! changes neither shades the same fragments again.

use std::collections::HashMap;

use hankel_dsl::glam::{Mat4, Vec3, Vec4};
use hankel_dsl::native::describe::{Kernel, Output, Role, TexelFormat};
use hankel_host::device::slots::{POSITION, type_bytes};
use hankel_host::device::{Bind, Blend, BufferId, Device, Program};

use super::cast::{Caster, Lens, SAMPLES, places};
use super::fragments::{Fragments, Varying};
use super::{Draw, FullScreen, Onto, Stage};
use crate::error::{FrameError, Result, during};

/// Fragments that are shaded at once.
const BATCH: usize = 1 << 14;

/// What rays found through the pixels of a view.
struct Found {
    stamps: [u64; 3],
    size: [u32; 2],
    fragments: Fragments,
}

/// What is kept from run to run.
#[derive(Default)]
pub struct Rays {
    /// By buffers of positions and indices, and whether nothing hides anything; with the buffers' stamps.
    casters: HashMap<([BufferId; 2], bool), ([u64; 2], Caster)>,
    /// By pass: outputs of the vertex kernel.
    vertices: HashMap<usize, Vec<BufferId>>,
    /// By pass.
    found: HashMap<usize, Found>,
    /// What a batch is shaded into.
    batch: Option<BufferId>,
    pub bytes: usize,
}

impl Rays {
    pub fn draw(
        &mut self,
        device: &mut dyn Device,
        draw: &Draw<'_>,
        advance: &mut dyn FnMut(f32),
    ) -> Result<Option<f64>> {
        self.build(device, draw)?;
        let bytes = device
            .read_buffer(draw.clip_from_world.buffer)
            .map_err(during(draw.label))?;
        // Rows, as `hankel_shadows::depth::Transform` has them.
        let rows: Vec<f32> = bytemuck::pod_collect_to_vec(&bytes);
        let rows = <[f32; 16]>::try_from(rows).map_err(|_| FrameError::Value {
            value: draw.label.into(),
            problem: "its transform is no 4x4 matrix".into(),
        })?;
        let clip_from_world = Mat4::from_cols_array(&rows).transpose();
        let [width, height, _] = draw.shape.size;
        let lens = Lens::new(clip_from_world, width, height);
        match (draw.onto, &draw.fragment) {
            (
                Onto::Colour {
                    texture,
                    samples,
                    background,
                    blend,
                    before,
                },
                Some(stage),
            ) => {
                let vertices = self.run_vertices(device, draw)?;
                let depths = before.map(|depth| device.read_texture(depth)).transpose();
                let depths = depths.map_err(during(draw.label))?;
                let hidden = Hidden {
                    samples: places(samples),
                    blend,
                    position: vertices.first().map_or(&[][..], Vec::as_slice),
                    depths: depths.as_deref(),
                };
                self.find(draw, &lens, &hidden, advance);
                let colour = |b: f64| b as f32;
                let target = Samples {
                    blend,
                    background: Vec4::from(background.map(colour)),
                    format: draw.shape.format.texel(),
                    drawn: samples as usize,
                    kept: draw.shape.samples as usize,
                };
                let texels = self.shade(device, draw, stage, &lens, &vertices, &target)?;
                device
                    .write_texture(texture, &texels)
                    .map_err(during(draw.label))?;
                // A map's samples are no picture's.
                let is_picture = target.kept < target.drawn;
                let found = self.found.get(&draw.pass).filter(|_| is_picture);
                Ok(found.map(|f| f.fragments.edges()))
            }
            (Onto::Colour { texture, .. } | Onto::Depth(texture), _) => {
                let vertices = self.run_vertices(device, draw)?;
                let position = vertices.first().map_or(&[][..], Vec::as_slice);
                let clip: Vec<Vec4> = bytemuck::pod_collect_to_vec(position);
                let caster = self.caster(draw)?;
                let places = places(draw.shape.samples);
                let depths = caster.depths(&lens, &clip, [width, height], places, advance);
                device
                    .write_texture(texture, bytemuck::cast_slice(&depths))
                    .map_err(during(draw.label))?;
                Ok(None)
            }
        }
    }

    /// Builds the tree if triangles have changed.
    fn build(&mut self, device: &mut dyn Device, draw: &Draw<'_>) -> Result<()> {
        let key = caster_of(draw);
        let (buffers, is_blended) = key;
        let stamps = [draw.positions.stamp, draw.indices.stamp];
        if self.casters.get(&key).is_some_and(|(s, _)| *s == stamps) {
            return Ok(());
        }
        let mut read = |id| device.read_buffer(id).map_err(during(draw.label));
        let positions: Vec<Vec3> = bytemuck::pod_collect_to_vec(&read(buffers[0])?);
        let triangles: Vec<[u32; 3]> = bytemuck::pod_collect_to_vec(&read(buffers[1])?);
        let far = triangles.as_flattened().iter().max();
        if let Some(far) = far.filter(|i| **i as usize >= positions.len()) {
            return Err(FrameError::Value {
                value: draw.label.into(),
                problem: format!(
                    "its indices name vertex {far}, but there are {}, counted from 0",
                    positions.len()
                ),
            });
        }
        let caster = if is_blended {
            Caster::of_layers(&positions, &triangles)
        } else {
            Caster::new(&positions, &triangles)
        };
        self.casters.insert(key, (stamps, caster));
        Ok(())
    }

    fn caster(&self, draw: &Draw<'_>) -> Result<&Caster> {
        let built = self.casters.get(&caster_of(draw)).map(|(_, caster)| caster);
        built.ok_or_else(|| FrameError::Value {
            value: draw.label.into(),
            problem: "its triangles are not there".into(),
        })
    }

    /// Casts rays through the pixels if triangles or view have changed, or what hides them may have.
    fn find(
        &mut self,
        draw: &Draw<'_>,
        lens: &Lens,
        hidden: &Hidden<'_>,
        advance: &mut dyn FnMut(f32),
    ) {
        let stamps = [draw.positions, draw.indices, draw.clip_from_world].map(|s| s.stamp);
        let [width, height, _] = draw.shape.size;
        let size = [width, height];
        let same = |f: &Found| f.stamps == stamps && f.size == size;
        if hidden.depths.is_none() && self.found.get(&draw.pass).is_some_and(same) {
            return;
        }
        if let Some((_, caster)) = self.casters.get(&caster_of(draw)) {
            // Shading is the rest.
            let mut cast = |share: f32| advance(share * 0.7);
            let fragments = if hidden.blend == Blend::Off {
                Fragments::find(caster, lens, size, hidden.samples, &mut cast)
            } else {
                let clip: Vec<Vec4> = bytemuck::pod_collect_to_vec(hidden.position);
                let depths: Option<Vec<f32>> = hidden.depths.map(bytemuck::pod_collect_to_vec);
                let depths = depths.as_deref();
                Fragments::layers(caster, lens, size, hidden.samples, &clip, depths, &mut cast)
            };
            let found = Found {
                stamps,
                size,
                fragments,
            };
            self.found.insert(draw.pass, found);
        }
    }

    /// Runs the vertex kernel over all vertices: the bytes of each of its outputs.
    fn run_vertices(&mut self, device: &mut dyn Device, draw: &Draw<'_>) -> Result<Vec<Vec<u8>>> {
        let Stage { entry, args, .. } = &draw.vertex;
        if !self.vertices.contains_key(&draw.pass) {
            let count = self.caster(draw)?.vertex_count();
            let mut made = Vec::new();
            for output in &entry.kernel.outputs {
                let bytes = components(output) * size_of::<f32>() * count;
                made.push(
                    device
                        .buffer(draw.label, bytes)
                        .map_err(during(draw.label))?,
                );
                self.bytes += bytes;
            }
            self.vertices.insert(draw.pass, made);
        }
        let outputs = &self.vertices[&draw.pass];
        let mut all = args.clone();
        all.extend(outputs.iter().map(|id| Bind::Buffer(*id)));
        device
            .dispatch(&native(&draw.vertex), &all)
            .map_err(during(draw.label))?;
        outputs
            .iter()
            .map(|id| device.read_buffer(*id).map_err(during(draw.label)))
            .collect()
    }

    /// Runs the fragment kernel over what the rays found: the target's texels.
    fn shade(
        &mut self,
        device: &mut dyn Device,
        draw: &Draw<'_>,
        stage: &Stage<'_>,
        lens: &Lens,
        vertices: &[Vec<u8>],
        target: &Samples,
    ) -> Result<Vec<u8>> {
        let batch = match self.batch {
            Some(batch) => batch,
            None => {
                let bytes = BATCH * size_of::<Vec4>();
                let batch = device
                    .buffer("fragments", bytes)
                    .map_err(during(draw.label))?;
                self.bytes += bytes;
                *self.batch.insert(batch)
            }
        };
        let caster = self.caster(draw)?;
        let Some(Found { fragments, .. }) = self.found.get(&draw.pass) else {
            return Ok(Vec::new());
        };
        let varyings = varyings(&draw.vertex.entry.kernel, &stage.entry.kernel, vertices);
        let values = fragments.interpolate(caster, lens, &varyings);
        let program = native(stage);
        let mut colours: Vec<Vec4> = Vec::with_capacity(fragments.count());
        // Always as many, so that one buffer is enough for all frames: the last ones may be
        // nobody's.
        let mut parts: Vec<Vec<f32>> = vec![Vec::new(); values.len()];
        while colours.len() < fragments.count() {
            let begin = colours.len();
            let count = BATCH.min(fragments.count() - begin);
            for ((part, all), varying) in parts.iter_mut().zip(&values).zip(&varyings) {
                let n = varying.components;
                part.clear();
                part.extend_from_slice(&all[begin * n..(begin + count) * n]);
                part.resize(BATCH * n, 0.0);
            }
            let args: Vec<Bind<'_>> = arguments(&stage.entry.kernel, &stage.args, &parts)
                .chain([Bind::Buffer(batch)])
                .collect();
            device
                .dispatch(&program, &args)
                .map_err(during(draw.label))?;
            let bytes = device.read_buffer(batch).map_err(during(draw.label))?;
            let shaded: Vec<Vec4> = bytemuck::pod_collect_to_vec(&bytes);
            colours.extend_from_slice(&shaded[..count]);
        }
        Ok(target.drawn(fragments, &colours))
    }

    pub fn free(&mut self, device: &mut dyn Device) {
        let outputs = self.vertices.drain().flat_map(|(_, buffers)| buffers);
        for buffer in outputs.chain(self.batch.take()) {
            // The device is gone if it cannot free.
            let _ = device.free_buffer(buffer);
        }
        self.bytes = 0;
    }
}

/// The native device runs the kernel for each pixel without a rasteriser.
pub fn cover(device: &mut dyn Device, drawn: &FullScreen<'_>) -> Result<()> {
    let mut args = drawn.fragment.args.clone();
    args.extend(drawn.targets.iter().map(|target| Bind::Texture(*target)));
    device
        .dispatch(&native(&drawn.fragment), &args)
        .map_err(during(drawn.label))
}

/// By what a draw's triangles are kept.
fn caster_of(draw: &Draw<'_>) -> ([BufferId; 2], bool) {
    let is_blended = matches!(draw.onto, Onto::Colour { blend, .. } if blend != Blend::Off);
    let buffers = [draw.positions.buffer, draw.indices.buffer];
    (buffers, is_blended)
}

/// The stage's kernel as the native device runs it.
const fn native<'a>(stage: &Stage<'a>) -> Program<'a> {
    Program {
        shader: None,
        ..stage.program
    }
}

/// Floats of a stage's output.
fn components(output: &Output) -> usize {
    let ty = match output {
        Output::Varying { ty, .. } | Output::Target { ty, .. } => ty,
        _ => &POSITION,
    };
    type_bytes(ty) / size_of::<f32>()
}

/// What the vertex stage hands to the fragment stage, in the order in which that takes it. That it
/// does was checked with the graph.
fn varyings(vertex: &Kernel, fragment: &Kernel, vertices: &[Vec<u8>]) -> Vec<Varying> {
    let wanted = fragment.params.iter().filter_map(|p| match &p.role {
        Role::Varying { location, .. } => Some(*location),
        _ => None,
    });
    wanted
        .filter_map(|wanted| {
            let is_it =
                |o: &Output| matches!(o, Output::Varying { location, .. } if *location == wanted);
            let mut handed = vertex.outputs.iter().zip(vertices);
            handed.find(|(o, _)| is_it(o)).map(|(o, bytes)| Varying {
                components: components(o),
                vertices: bytemuck::pod_collect_to_vec(bytes),
            })
        })
        .collect()
}

/// The arguments of the fragment kernel in the order of its parameters: varyings among the others.
fn arguments<'a>(
    kernel: &'a Kernel,
    others: &'a [Bind<'a>],
    varyings: &'a [Vec<f32>],
) -> impl Iterator<Item = Bind<'a>> {
    let mut others = others.iter();
    let mut varyings = varyings.iter();
    let slots = hankel_host::device::slots::slots(kernel);
    let kinds: Vec<bool> = slots
        .iter()
        .filter(|s| !matches!(s.role, hankel_host::device::slots::Use::Interface(_)))
        .map(|s| matches!(s.role, hankel_host::device::slots::Use::Varying(..)))
        .collect();
    kinds.into_iter().filter_map(move |is_varying| {
        if is_varying {
            let values = varyings.next()?;
            Some(Bind::Bytes(bytemuck::cast_slice(values)))
        } else {
            others.next().copied()
        }
    })
}

/// What hides fragments from each other.
struct Hidden<'a> {
    /// Where the samples of a pixel lie.
    samples: &'static [[f64; 2]],
    /// Without blending the nearest hides the others.
    blend: Blend,
    /// Where the vertices go in clip space.
    position: &'a [u8],
    /// What hides all of them, one depth for each sample.
    depths: Option<&'a [u8]>,
}

/// How a colour target takes up fragments.
struct Samples {
    blend: Blend,
    background: Vec4,
    format: TexelFormat,
    /// Samples of a pixel that are drawn.
    drawn: usize,
    /// How many the target has: all of them, or one, their mean.
    kept: usize,
}

impl Samples {
    /// The texels after all fragments are drawn, stored as colour targets store them: each sample after each
    /// fragment, and then their mean.
    fn drawn(&self, fragments: &Fragments, colours: &[Vec4]) -> Vec<u8> {
        let mut texel = vec![0; self.format.bytes()];
        let mut through = |c: Vec4| {
            self.format.store(&mut texel, c);
            self.format.load(&texel)
        };
        let background = through(self.background);
        let mut picture = Vec::new();
        let mut stored = vec![0; self.format.bytes()];
        for pixel in fragments.drawn() {
            let mut samples = [background; SAMPLES.len()];
            let samples = &mut samples[..self.drawn];
            for (i, sees) in pixel {
                for (sample, sees) in samples.iter_mut().zip(sees) {
                    if sees {
                        *sample = through(self.blend.apply(colours[i], Vec4::ONE, *sample));
                    }
                }
            }
            let mean = [samples.iter().sum::<Vec4>() / samples.len() as f32];
            let all = if self.kept == self.drawn {
                &*samples
            } else {
                &mean
            };
            for colour in all {
                self.format.store(&mut stored, *colour);
                picture.extend_from_slice(&stored);
            }
        }
        picture
    }
}
