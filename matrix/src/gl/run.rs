//! A job's cases, run.

use std::fmt::Write as _;

use crate::job::{Arg, Case, Job, Place, Role, Scalar, Slot, Stage, Value};

use super::context::{Attribute, Buffer, Context, Program, Shape, Texture, View};
use super::texels::{self, Texel};
use super::text::{self, Variable};

/// Width of what fragments are drawn into, one pixel each: as in every column. A power of two: a
/// pixel's centre is then no rounded number.
const WIDTH: u32 = hankel_dsl::native::fragment::COLUMNS;

/// Hands a texture on, whose samples lie side by side, to the samples of another.
const SPREAD: &str = "#version 320 es
precision highp float;
precision highp int;
uniform highp sampler2D u_samples;
uniform int u_count;
layout(location = 0) out vec4 colour;
void main() {
    ivec2 at = ivec2(gl_FragCoord.xy);
    colour = texelFetch(u_samples, ivec2(at.x * u_count + gl_SampleID, at.y), 0);
}
";

/// Three vertices whose triangle covers everything.
const COVER: &str = "#version 320 es
void main() {
    vec2 corner = vec2(float(gl_VertexID & 1), float(gl_VertexID >> 1));
    gl_Position = vec4(corner * 4.0 - 1.0, 0.0, 1.0);
}
";

/// Something that is written and will be read back.
enum Written {
    Buffer(Buffer),
    Texture(Texture),
    Bytes(Vec<u8>),
}

/// A program and what its stage passes on.
struct Pipeline {
    program: Program,
    /// Vertex: what is captured, in order: the slot and its components.
    captured: Vec<(usize, u32)>,
    /// Fragment: what the stage takes: the slot of each.
    taken: Vec<usize>,
}

/// Whether the text gives every image the format that it has. llvmpipe takes the image's format
/// whatever the text says, so that running it shows nothing.
fn check_formats(job: &Job, code: &str) -> Result<(), String> {
    for slot in &job.slots {
        if let Role::StorageTexture { format, .. } = &slot.role
            && let Some(name) = slot.place.as_ref().and_then(|p| p.name.as_deref())
        {
            let wanted = texels::in_text(format)?;
            if !text::layout(code, name).iter().any(|word| word == wanted) {
                return Err(format!(
                    "{}: it is {format}, but the text does not say {wanted}",
                    slot.name
                ));
            }
        }
    }
    Ok(())
}

/// The results of all cases.
pub(super) fn run(context: &mut Context, job: &Job) -> Result<Vec<u8>, String> {
    context.make_current()?;
    let read = |path: &std::path::Path| {
        std::fs::read(path).map_err(|error| format!("{}: {error}", path.display()))
    };
    let code = String::from_utf8(read(&job.code)?)
        .map_err(|error| format!("{}: {error}", job.code.display()))?;
    let inputs = read(&job.inputs)?;
    // What the compiler refuses comes first, with its words.
    let pipeline = pipeline(context, job, &code)?;
    check_formats(job, &code)?;
    let mut results = Vec::new();
    for (i, case) in job.cases.iter().enumerate() {
        let mark = context.mark();
        Run {
            context: &mut *context,
            job,
            case,
            inputs: &inputs,
            pipeline: &pipeline,
        }
        .case(&mut results)
        .map_err(|error| format!("case {i}: {error}"))?;
        context.release_from(mark)?;
    }
    Ok(results)
}

fn pipeline(context: &mut Context, job: &Job, code: &str) -> Result<Pipeline, String> {
    let mut captured = Vec::new();
    let mut taken = Vec::new();
    let program = match job.stage {
        Stage::Compute { .. } => context.program(&[(glow::COMPUTE_SHADER, code)], &[])?,
        Stage::Vertex => {
            let outs = text::variables(code, "out");
            let mut names = Vec::new();
            for (i, slot) in job.slots.iter().enumerate() {
                match slot.role {
                    Role::Position => {
                        names.push("gl_Position");
                        captured.push((i, 4));
                    }
                    Role::ClipDistances { value } => {
                        names.push("gl_ClipDistance");
                        captured.push((i, value.size));
                    }
                    Role::Passed { location, value } => {
                        let out = find(&outs, location)
                            .ok_or_else(|| format!("no output has location {location}"))?;
                        fits(out, value)?;
                        names.push(&out.name);
                        captured.push((i, value.size));
                    }
                    _ => {}
                }
            }
            let idle = format!("{}\nvoid main() {{}}\n", text::version(code));
            context.program(
                &[(glow::VERTEX_SHADER, code), (glow::FRAGMENT_SHADER, &idle)],
                &names,
            )?
        }
        Stage::Fragment => {
            let before;
            (before, taken) = stage_before(job, code)?;
            context.program(
                &[
                    (glow::FRAGMENT_SHADER, code),
                    (glow::VERTEX_SHADER, &before),
                ],
                &[],
            )?
        }
    };
    Ok(Pipeline {
        program,
        captured,
        taken,
    })
}

fn find(variables: &[Variable], location: u32) -> Option<&Variable> {
    variables.iter().find(|it| it.location == Some(location))
}

/// Refuses values of another type than the text's: they would be read as something else.
fn fits(variable: &Variable, value: Value) -> Result<(), String> {
    let (scalar, vector) = match value.scalar {
        Scalar::F32 => ("float", "vec"),
        Scalar::U32 => ("uint", "uvec"),
        Scalar::I32 => ("int", "ivec"),
    };
    let wanted = match value.size {
        1 => scalar.to_owned(),
        size => format!("{vector}{size}"),
    };
    if variable.kind == wanted {
        Ok(())
    } else {
        Err(format!(
            "{} is a {}, not a {wanted}",
            variable.name, variable.kind
        ))
    }
}

/// A vertex stage that hands a fragment stage its varyings, and the slots that it hands on: the
/// attribute at location 0 is the place of the point, those after it are these slots.
fn stage_before(job: &Job, code: &str) -> Result<(String, Vec<usize>), String> {
    let version = text::version(code);
    // Locations of what is passed on are no part of GLSL ES 3.00.
    let located = version != "#version 300 es";
    let mut declared = format!("{version}\nlayout(location = 0) in vec2 a_place;\n");
    let mut body = String::new();
    let mut taken = Vec::new();
    for it in text::variables(code, "in") {
        let slot = job.slots.iter().position(|slot| {
            matches!(slot.role, Role::Varying { location, .. } if it.location == Some(location))
        });
        let slot =
            slot.ok_or_else(|| format!("the job gives nothing for the input {}", it.name))?;
        if let Role::Varying { value, .. } = job.slots[slot].role {
            fits(&it, value)?;
        }
        let Variable {
            qualifiers,
            kind,
            name,
            location,
        } = &it;
        taken.push(slot);
        let number = taken.len();
        let layout = match location {
            Some(location) if located => format!("layout(location = {location}) "),
            _ => String::new(),
        };
        // Writing to a string cannot fail.
        let _ = writeln!(
            declared,
            "layout(location = {number}) in highp {kind} a_{number};\n\
             {layout}{qualifiers} out highp {kind} {name};"
        );
        let _ = writeln!(body, "    {name} = a_{number};");
    }
    let stage = format!(
        "{declared}void main() {{\n{body}    gl_PointSize = 1.0;\n    \
         gl_Position = vec4(a_place, -1.0, 1.0);\n}}\n"
    );
    Ok((stage, taken))
}

/// A case being run.
struct Run<'a> {
    context: &'a mut Context,
    job: &'a Job,
    case: &'a Case,
    inputs: &'a [u8],
    pipeline: &'a Pipeline,
}

impl<'a> Run<'a> {
    fn case(mut self, results: &mut Vec<u8>) -> Result<(), String> {
        if self.case.args.len() != self.job.slots.len() {
            return Err(format!(
                "{} arguments are given for {} slots",
                self.case.args.len(),
                self.job.slots.len()
            ));
        }
        let mut written: Vec<Option<Written>> = Vec::new();
        let mut bindings = Vec::new();
        // Making a multisampled texture draws, so all is made before anything is bound.
        for (slot, arg) in self.job.slots.iter().zip(&self.case.args) {
            let it = self
                .make(slot, arg)
                .map_err(|error| format!("{}: {error}", slot.name))?;
            if let (Some(place), Some(it)) = (&slot.place, it) {
                bindings.push((slot, place, it));
            }
            written.push(it.filter(|_| slot.role.is_written()).map(|it| match it {
                Made::Texture(it) => Written::Texture(it),
                Made::Buffer(it) | Made::Uniform(it) => Written::Buffer(it),
            }));
        }
        self.context.use_program(self.pipeline.program);
        self.bind(&bindings)?;
        match self.job.stage {
            Stage::Compute { .. } => {
                if !self.case.groups.contains(&0) {
                    self.context.dispatch(self.case.groups)?;
                }
            }
            Stage::Vertex => self.vertices(&mut written)?,
            Stage::Fragment => self.fragments(&mut written)?,
        }
        for (slot, it) in self.job.slots.iter().zip(written) {
            match it {
                Some(Written::Buffer(it)) => results.extend(self.context.read_buffer(it)?),
                Some(Written::Texture(it)) => results.extend(self.texels(it)?),
                Some(Written::Bytes(it)) => results.extend(it),
                None if slot.role.is_written() => {
                    return Err(format!("{}: nothing wrote it", slot.name));
                }
                None => {}
            }
        }
        Ok(())
    }

    /// What is bound for a slot.
    fn make(&mut self, slot: &Slot, arg: &Arg) -> Result<Option<Made>, String> {
        Ok(match (&slot.role, arg) {
            (Role::Uniform, Arg::Bytes { .. }) => {
                let block = slot.place.as_ref().and_then(|it| it.block.as_deref());
                // The block may end after its last member, at the next multiple of its alignment.
                let least = block
                    .and_then(|it| self.context.uniform_block(self.pipeline.program, it))
                    .map_or(0, |(_, size)| size);
                let bytes = self.bytes(arg)?;
                Some(Made::Uniform(self.context.buffer(bytes, least)?))
            }
            (Role::Read | Role::Atomic | Role::Write, Arg::Bytes { .. }) => {
                let bytes = self.bytes(arg)?;
                Some(Made::Buffer(self.context.buffer(bytes, 0)?))
            }
            (
                role @ (Role::Texture { .. } | Role::StorageTexture { .. }),
                Arg::Texture {
                    format,
                    size,
                    levels,
                    layers,
                    samples,
                    ..
                },
            ) => {
                let (view, texel) = match role {
                    Role::Texture {
                        view, depth: true, ..
                    } => (view.clone(), Texel::DEPTH),
                    Role::Texture { view, .. } => (view.clone(), Texel::named(format)?),
                    Role::StorageTexture { view, .. } => (view.clone(), Texel::named(format)?),
                    _ => return Err(format!("{arg:?} is given for {role:?}")),
                };
                let bytes = self.bytes(arg)?;
                Some(Made::Texture(if *samples == 1 {
                    let shape = Shape {
                        view: View::named(&view)?,
                        size: *size,
                        levels: *levels,
                        layers: *layers,
                    };
                    self.context.texture(texel, &shape, Some(bytes))?
                } else {
                    self.spread(texel, *size, *samples, bytes)?
                }))
            }
            (Role::Sampler, Arg::Sampler(_))
            | (
                Role::Attribute { .. }
                | Role::Varying { .. }
                | Role::Position
                | Role::Passed { .. }
                | Role::ClipDistances { .. }
                | Role::SecondSource { .. }
                | Role::Depth
                | Role::Target { .. },
                _,
            ) => None,
            (role, arg) => return Err(format!("{arg:?} is given for {role:?}")),
        })
    }

    /// A multisampled texture of these texels: they are drawn into it, as nothing uploads to one.
    fn spread(
        &mut self,
        texel: Texel,
        size: [u32; 3],
        samples: u32,
        bytes: &[u8],
    ) -> Result<Texture, String> {
        let wide = [size[0].saturating_mul(samples), size[1], 1];
        let flat = self
            .context
            .texture(texel, &Shape::flat(wide), Some(bytes))?;
        let into = self.context.multisampled(texel, size, samples)?;
        let program = self.context.program(
            &[
                (glow::VERTEX_SHADER, COVER),
                (glow::FRAGMENT_SHADER, SPREAD),
            ],
            &[],
        )?;
        self.context.use_program(program);
        self.context.set_number(program, "u_samples", 0)?;
        self.context.set_number(program, "u_count", samples)?;
        self.context.bind_texture(0, flat);
        self.context
            .draw_into(&[(0, into)], None, [size[0], size[1]])?;
        self.context.draw(glow::TRIANGLES, 3, &[])?;
        Ok(into)
    }

    /// Binds what was made where the text expects it.
    fn bind(&mut self, bindings: &[(&Slot, &Place, Made)]) -> Result<(), String> {
        let program = self.pipeline.program;
        let mut units = Vec::new();
        let (mut next_block, mut next_unit) = (0, 0);
        for &(slot, place, made) in bindings {
            let refuse = |what: &str| format!("{}: {what}", slot.name);
            let index = || {
                place
                    .index
                    .ok_or_else(|| refuse("the text has no number for it"))
            };
            match (place.class.as_str(), made) {
                ("uniform", Made::Uniform(buffer)) => {
                    let index = match place.index {
                        Some(index) => index,
                        None => {
                            let (block, _) = place
                                .block
                                .as_deref()
                                .and_then(|name| self.context.uniform_block(program, name))
                                .ok_or_else(|| refuse("the program has no such block"))?;
                            let index = next_block;
                            next_block += 1;
                            self.context.place_uniform_block(program, block, index);
                            index
                        }
                    };
                    self.context.bind_uniform(index, buffer);
                }
                ("buffer", Made::Buffer(buffer)) => self.context.bind_storage(index()?, buffer),
                ("texture", Made::Texture(texture)) => {
                    let unit = match place.index {
                        Some(index) => index,
                        None => {
                            let name = place
                                .name
                                .as_deref()
                                .ok_or_else(|| refuse("it has neither name nor number"))?;
                            let unit = next_unit;
                            next_unit += 1;
                            self.context.set_number(program, name, unit)?;
                            unit
                        }
                    };
                    self.context.bind_texture(unit, texture);
                    units.push((slot.binding, unit));
                }
                ("image", Made::Texture(texture)) => self.context.bind_image(index()?, texture),
                (class, _) => return Err(refuse(&format!("it is no {class}"))),
            }
        }
        self.context.check("binding")?;
        self.bind_samplers(&units)
    }

    /// Binds the samplers to the units of the textures that they have become one with.
    fn bind_samplers(&mut self, units: &[(Option<u32>, u32)]) -> Result<(), String> {
        for (slot, arg) in self.job.slots.iter().zip(&self.case.args) {
            let (Some(place), Arg::Sampler(sampler)) = (&slot.place, arg) else {
                continue;
            };
            let sampler = self.context.sampler(sampler)?;
            for &texture in &place.combined_with {
                let (_, unit) = units
                    .iter()
                    .find(|it| it.0 == Some(texture))
                    .ok_or_else(|| format!("{}: no texture has binding {texture}", slot.name))?;
                self.context.bind_sampler(*unit, sampler);
            }
        }
        self.context.check("binding samplers")
    }

    /// The bytes of an argument.
    fn bytes(&self, arg: &Arg) -> Result<&'a [u8], String> {
        let (&Arg::Bytes { offset, length } | &Arg::Texture { offset, length, .. }) = arg else {
            return Err("it has no bytes".into());
        };
        usize::try_from(offset)
            .ok()
            .zip(usize::try_from(length).ok())
            .and_then(|(offset, length)| self.inputs.get(offset..offset.checked_add(length)?))
            .ok_or_else(|| {
                format!(
                    "bytes {offset} to {offset} + {length} are not among the {} of the inputs",
                    self.inputs.len()
                )
            })
    }

    fn attribute(&mut self, slot: usize, location: u32, value: Value) -> Result<Attribute, String> {
        let bytes = self.bytes(&self.case.args[slot])?;
        Ok(Attribute {
            location,
            component: component(value.scalar),
            size: value.size,
            values: self.context.buffer(bytes, 0)?,
        })
    }

    fn vertices(&mut self, written: &mut [Option<Written>]) -> Result<(), String> {
        let mut attributes = Vec::new();
        for (i, slot) in self.job.slots.iter().enumerate() {
            if let Role::Attribute { location, value } = slot.role {
                attributes.push(self.attribute(i, location, value)?);
            }
        }
        let pipeline = self.pipeline;
        let captured = &pipeline.captured;
        let stride: usize = captured.iter().map(|it| it.1 as usize * 4).sum();
        let bytes = if self.case.invocations == 0 || stride == 0 {
            Vec::new()
        } else {
            // Nothing is drawn, but OpenGL wants something to draw into.
            let texel = Texel::named("rgba8unorm")?;
            let target = self.context.texture(texel, &Shape::flat([1; 3]), None)?;
            self.context.draw_into(&[(0, target)], None, [1; 2])?;
            self.context
                .capture(self.case.invocations, stride, &attributes)?
        };
        let mut offset = 0;
        for &(slot, size) in captured {
            let size = size as usize * 4;
            let values = bytes
                .chunks_exact(stride.max(1))
                .flat_map(|it| &it[offset..offset + size]);
            written[slot] = Some(Written::Bytes(values.copied().collect()));
            offset += size;
        }
        Ok(())
    }

    fn fragments(&mut self, written: &mut [Option<Written>]) -> Result<(), String> {
        let count = self.case.invocations;
        let width = WIDTH;
        let height = count.div_ceil(width).max(1).next_power_of_two();
        let centre = |at: u32, of: u32| (2 * at + 1) as f32 / of as f32 - 1.0;
        let places: Vec<u8> = (0..count)
            .flat_map(|i| [centre(i % width, width), centre(i / width, height)])
            .flat_map(f32::to_le_bytes)
            .collect();
        let mut attributes = vec![Attribute {
            location: 0,
            component: glow::FLOAT,
            size: 2,
            values: self.context.buffer(&places, 0)?,
        }];
        for (number, &slot) in (1..).zip(&self.pipeline.taken) {
            if let Role::Varying { value, .. } = self.job.slots[slot].role {
                attributes.push(self.attribute(slot, number, value)?);
            }
        }
        let mut targets = Vec::new();
        let mut slots = Vec::new();
        let mut depth = None;
        // llvmpipe compiles a fragment shader twice where no depth is tested: once more for tiles that are covered wholly.
        let attached = self.context.depth([width, height])?;
        let mut second = None;
        let size = [width, height, 1];
        for (i, slot) in self.job.slots.iter().enumerate() {
            match slot.role {
                Role::Target { location, value } => {
                    let texel = Texel::named(match value.scalar {
                        Scalar::F32 => "rgba32float",
                        Scalar::U32 => "rgba32uint",
                        Scalar::I32 => "rgba32sint",
                    })?;
                    // What is discarded stays as it is.
                    let zeros = vec![0; (width * height * 16) as usize];
                    let target = self
                        .context
                        .texture(texel, &Shape::flat(size), Some(&zeros))?;
                    targets.push((location, target));
                    slots.push((i, value.size as usize * 4));
                }
                Role::SecondSource { value } => {
                    let ones = 1.0_f32.to_le_bytes().repeat((width * height * 4) as usize);
                    let texel = Texel::named("rgba32float")?;
                    let target = self
                        .context
                        .texture(texel, &Shape::flat(size), Some(&ones))?;
                    second = Some((i, target, value.size as usize * 4));
                }
                Role::Depth => depth = Some(i),
                _ => {}
            }
        }
        if let Some((slot, target, bytes)) = second {
            self.context
                .draw_into(&[(0, target)], Some(attached), [width, height])?;
            if count > 0 {
                self.context.blend_second(true)?;
                let drawn = self.context.draw(glow::POINTS, count, &attributes);
                self.context.blend_second(false)?;
                drawn?;
            }
            written[slot] = Some(Written::Bytes(self.points(target, count, bytes)?));
        }
        self.context
            .draw_into(&targets, Some(attached), [width, height])?;
        if count > 0 {
            self.context.draw(glow::POINTS, count, &attributes)?;
        }
        if let Some(slot) = depth {
            let pixels = self.floats(attached, [width, height])?;
            let values = pixels.chunks_exact(16).take(count as usize);
            let values = values.flat_map(|it| &it[..4]).copied().collect();
            written[slot] = Some(Written::Bytes(values));
        }
        for ((_, target), (slot, bytes)) in targets.into_iter().zip(slots) {
            written[slot] = Some(Written::Bytes(self.points(target, count, bytes)?));
        }
        Ok(())
    }

    /// The first bytes of each of so many pixels.
    fn points(&mut self, target: Texture, count: u32, bytes: usize) -> Result<Vec<u8>, String> {
        let pixels = self.context.read_texture(target)?;
        let pixels = pixels.chunks_exact(16).take(count as usize);
        Ok(pixels.flat_map(|it| &it[..bytes]).copied().collect())
    }
}

impl Run<'_> {
    /// The texels of a texture as they lie in memory.
    fn texels(&mut self, texture: Texture) -> Result<Vec<u8>, String> {
        if !texture.texel.is_spread() {
            return self.context.read_texture(texture);
        }
        let [width, height, 1] = texture.size else {
            return Err("signed shares are read from flat textures only".into());
        };
        let pixels = self.floats(texture, [width, height])?;
        let mut bytes = Vec::new();
        for pixel in pixels.chunks_exact(16) {
            texture.texel.pack(pixel, &mut bytes);
        }
        Ok(bytes)
    }

    /// What a texture holds that OpenGL ES does not read as it is, as four floats for each texel; depths are the first of them.
    fn floats(&mut self, texture: Texture, size: [u32; 2]) -> Result<Vec<u8>, String> {
        let texel = Texel::named("rgba32float")?;
        let into = self
            .context
            .texture(texel, &Shape::flat([size[0], size[1], 1]), None)?;
        let stages = [
            (glow::VERTEX_SHADER, COVER),
            (glow::FRAGMENT_SHADER, SPREAD),
        ];
        let program = self.context.program(&stages, &[])?;
        self.context.use_program(program);
        self.context.set_number(program, "u_samples", 0)?;
        self.context.set_number(program, "u_count", 1)?;
        self.context.bind_texture(0, texture);
        self.context.draw_into(&[(0, into)], None, size)?;
        self.context.draw(glow::TRIANGLES, 3, &[])?;
        self.context.read_texture(into)
    }
}

/// What was made for a slot.
#[derive(Clone, Copy)]
enum Made {
    Uniform(Buffer),
    Buffer(Buffer),
    Texture(Texture),
}

const fn component(scalar: Scalar) -> u32 {
    match scalar {
        Scalar::F32 => glow::FLOAT,
        Scalar::U32 => glow::UNSIGNED_INT,
        Scalar::I32 => glow::INT,
    }
}
