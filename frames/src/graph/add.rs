//! How passes are added to a graph.

use std::borrow::Cow;

use hankel_dsl::native::describe::{ConstantValue, Output, Role, Stage};
use hankel_host::device::slots;
use hankel_host::device::{Blend, Format, TextureShape};

use super::check::{GraphError, Place, allowed, listed, stage_name};
use super::{
    Argument, Call, Graph, Handle, Origin, Pass, Result, Shape, Surfaces, Target, Value, Work,
};
use crate::visibility::SAMPLES;

/// How large an output is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Size {
    /// Elements of a buffer.
    Elements(usize),
    /// Texels of a texture.
    Texels([u32; 3]),
}

/// A kernel's arguments by name.
#[derive(Clone, Debug, Default)]
struct Named {
    kernel: Cow<'static, str>,
    args: Vec<(Cow<'static, str>, Argument)>,
    constants: Vec<(Cow<'static, str>, ConstantValue)>,
}

impl Named {
    fn new(kernel: impl Into<Cow<'static, str>>) -> Self {
        Self {
            kernel: kernel.into(),
            ..Self::default()
        }
    }

    /// The call of a kernel of stage `stage`; outputs have no argument yet.
    fn call(&self, graph: &Graph, pass: &str, stage: &str) -> Result<Call> {
        let place = self.place(pass);
        let kernel = graph.find(place)?;
        let description = &graph.kernels[kernel].kernel;
        let has = stage_name(&description.stage);
        if has != stage {
            return Err(place.kernel(format!(
                "it is a {has} kernel, but the pass wants a {stage} kernel here"
            )));
        }
        if description.is_fragment_form() {
            return Err(place.kernel(
                "it is the fragment form of an image pass: name the compute form, with `compute`, and let the \
                 graph draw it with `set_image_passes`",
            ));
        }
        let all = slots::drawn_slots(description);
        // Nothing says yet what a draw does to memory: it would not be ordered with other passes.
        let fragment = matches!(description.stage, Stage::Fragment);
        if let Some(slot) = all.iter().find(|s| fragment && s.role.is_written()) {
            return Err(place.argument(
                &slot.name,
                "a draw of a frame writes its targets alone: write memory in a compute pass",
            ));
        }
        let takes = &all[..all.len() - outputs(&description.stage, &description.outputs)];
        for (i, (name, _)) in self.args.iter().enumerate() {
            if !takes.iter().any(|s| s.name == *name) {
                let names = listed(takes.iter().map(|s| &s.name));
                return Err(place.argument(name, format!("it takes no such argument, but {names}")));
            }
            if self.args[..i].iter().any(|(other, _)| other == name) {
                return Err(place.argument(name, "it is given twice"));
            }
        }
        let args = takes
            .iter()
            .map(|slot| {
                let found = self.args.iter().find(|(name, _)| *name == slot.name);
                let Some((_, argument)) = found else {
                    return Err(place.argument(&slot.name, "it is not given"));
                };
                if let Argument::Value(handle) = argument {
                    graph.current(*handle, |problem| place.argument(&slot.name, problem))?;
                }
                Ok(*argument)
            })
            .collect::<Result<Vec<_>>>()?;
        Ok(Call {
            kernel,
            args,
            constants: self.constants(graph, place, kernel)?,
            most: None,
        })
    }

    fn constants(&self, graph: &Graph, place: Place<'_>, kernel: usize) -> Result<Vec<u32>> {
        let params = &graph.kernels[kernel].kernel.params;
        let mut values = Vec::new();
        let mut names = Vec::new();
        for param in params {
            let Role::Constant {
                default, scalar, ..
            } = param.role
            else {
                continue;
            };
            let given = self.constants.iter().find(|(name, _)| *name == param.name);
            let default = ConstantValue::of_word(scalar, default);
            let value = given.map_or(default, |(_, value)| *value);
            let word = value.word(scalar).ok_or_else(|| {
                format!(
                    "it is {}, which `{value}` is not",
                    ConstantValue::kind(scalar)
                )
            });
            let word = word.and_then(|word| {
                allowed(param.inputs.domain.as_ref(), value.number())?;
                Ok(word)
            });
            values.push(word.map_err(|problem| place.argument(&param.name, problem))?);
            names.push(param.name.as_str());
        }
        match self.constants.iter().find(|(n, _)| !names.contains(&&**n)) {
            Some((name, _)) => Err(place.argument(
                name,
                format!("it has no such constant, but {}", listed(names)),
            )),
            None => Ok(values),
        }
    }

    fn place<'a>(&'a self, pass: &'a str) -> Place<'a> {
        Place {
            pass,
            kernel: &self.kernel,
        }
    }
}

/// How many of a kernel's arguments are outputs.
fn outputs(stage: &Stage, outputs: &[Output]) -> usize {
    match stage {
        Stage::Compute { .. } => outputs.len(),
        Stage::Vertex | Stage::Fragment => 0,
    }
}

/// Values of calls, each once.
fn reads<'a>(calls: impl IntoIterator<Item = &'a Call>, first: &[Handle]) -> Vec<Handle> {
    let mut reads = first.to_vec();
    for argument in calls.into_iter().flat_map(|c| &c.args) {
        if let Argument::Value(handle) = argument
            && !reads.contains(handle)
        {
            reads.push(*handle);
        }
    }
    reads
}

/// What a pass wrote.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Written {
    /// Its kernel's outputs, in order.
    pub outputs: Vec<Handle>,
    /// What it changed in its place, by the parameters' names.
    changed: Vec<(String, Handle)>,
}

impl Written {
    /// What a parameter that the kernel writes to holds now.
    #[must_use]
    pub fn changed(&self, parameter: &str) -> Option<Handle> {
        let found = self.changed.iter().find(|(name, _)| name == parameter);
        found.map(|(_, handle)| *handle)
    }
}

/// A compute pass on its way into a graph.
#[derive(Debug)]
#[must_use = "a pass is part of the graph only after `image`, `elements` or `finish`"]
pub struct AddCompute<'g> {
    graph: &'g mut Graph,
    label: Cow<'static, str>,
    call: Named,
    sizes: Vec<Size>,
    most: Option<[u32; 3]>,
    note: Option<String>,
}

impl Graph {
    /// Begins a pass that runs a compute kernel.
    pub fn compute(
        &mut self,
        label: impl Into<Cow<'static, str>>,
        kernel: impl Into<Cow<'static, str>>,
    ) -> AddCompute<'_> {
        AddCompute {
            graph: self,
            label: label.into(),
            call: Named::new(kernel),
            sizes: Vec::new(),
            most: None,
            note: None,
        }
    }

    /// Adds a pass that copies textures into the mip levels of one, the largest first: each has half as many texels
    /// along each axis as the one before, rounded down, and one at least. If the same pass is there already, it
    /// gives what that one makes.
    ///
    /// # Errors
    /// [`GraphError::Levels`]; the graph is then as it was.
    pub fn levels(
        &mut self,
        label: impl Into<Cow<'static, str>>,
        levels: &[Handle],
    ) -> Result<Handle> {
        let label = label.into();
        let shape = self.check_levels(&label, levels)?;
        let same = self.passes.iter().find_map(|pass| match &pass.work {
            Work::Levels(there) if there == levels => pass.writes.first().copied(),
            _ => None,
        });
        if let Some(made) = same
            && self.is_current(made)
        {
            return Ok(made);
        }
        let made = self.made(label.clone(), Shape::Texture(shape));
        self.passes.push(Pass {
            label,
            work: Work::Levels(levels.to_vec()),
            reads: levels.to_vec(),
            writes: vec![made],
            note: Some(format!("{} levels", levels.len())),
        });
        Ok(made)
    }

    /// Begins a pass that draws triangles.
    pub fn draw(
        &mut self,
        label: impl Into<Cow<'static, str>>,
        surfaces: Surfaces,
        vertex: impl Into<Cow<'static, str>>,
    ) -> AddDraw<'_> {
        AddDraw {
            graph: self,
            label: label.into(),
            surfaces,
            vertex: Named::new(vertex),
            fragment: None,
            blend: Blend::Off,
            before: None,
        }
    }
}

impl AddCompute<'_> {
    /// Gives an argument by its parameter's name.
    pub fn arg(
        mut self,
        parameter: impl Into<Cow<'static, str>>,
        argument: impl Into<Argument>,
    ) -> Self {
        self.call.args.push((parameter.into(), argument.into()));
        self
    }

    /// Gives a specialisation constant; without it, it has its default.
    pub fn constant(
        mut self,
        name: impl Into<Cow<'static, str>>,
        value: impl Into<ConstantValue>,
    ) -> Self {
        self.call.constants.push((name.into(), value.into()));
        self
    }

    /// Says something for readers of the plan.
    pub fn note(mut self, note: impl Into<String>) -> Self {
        self.note = Some(note.into());
        self
    }

    /// The next output is a texture of so many texels; its format is the kernel's.
    pub fn texels(mut self, size: [u32; 3]) -> Self {
        self.sizes.push(Size::Texels(size));
        self
    }

    /// The next output is a buffer of so many elements.
    pub fn of(mut self, elements: usize) -> Self {
        self.sizes.push(Size::Elements(elements));
        self
    }

    /// Says how far a kernel runs at most along x, y, z, if an earlier pass says how far in a buffer.
    pub const fn at_most(mut self, invocations: [u32; 3]) -> Self {
        self.most = Some(invocations);
        self
    }

    /// Adds the pass of a kernel whose one output is a texture of two dimensions. If the same pass is there
    /// already, by whichever technique, it gives what that one makes.
    ///
    /// # Errors
    /// [`GraphError`].
    pub fn image(self, [width, height]: [u32; 2]) -> Result<Handle> {
        let shape = [width, height, 1];
        if let Ok(call) = self.call.call(self.graph, &self.label, "compute") {
            let made = self.graph.passes.iter().find_map(|pass| {
                let (Work::Compute(there), [made]) = (&pass.work, &*pass.writes) else {
                    return None;
                };
                let has_same = there.kernel == call.kernel
                    && there.constants == call.constants
                    && there.args.split_last() == Some((&Argument::Value(*made), &call.args));
                has_same.then_some(*made)
            });
            if let Some(made) = made
                && self.graph.is_current(made)
                && matches!(&self.graph.values[made.at()].shape, Shape::Texture(t) if t.size == shape)
            {
                return Ok(made);
            }
        }
        self.texels(shape).only()
    }

    /// Adds the pass of a kernel whose one output is a buffer.
    ///
    /// # Errors
    /// [`GraphError`].
    pub fn elements(self, elements: usize) -> Result<Handle> {
        self.of(elements).only()
    }

    fn only(self) -> Result<Handle> {
        let (pass, kernel) = (self.label.clone(), self.call.kernel.clone());
        let written = self.finish()?;
        // `finish` has compared the numbers of outputs and of sizes, which is one.
        written.outputs.first().copied().ok_or_else(|| {
            let place = Place {
                pass: &pass,
                kernel: &kernel,
            };
            place.kernel("it has no output")
        })
    }

    /// Adds the pass.
    ///
    /// # Errors
    /// [`GraphError`]; the graph is then as it was.
    pub fn finish(self) -> Result<Written> {
        let before = self.graph.values.len();
        let graph = self.graph;
        let place = self.call.place(&self.label);
        let mut call = self.call.call(graph, &self.label, "compute")?;
        call.most = self.most;
        let kernel = graph.kernels[call.kernel].kernel.clone();
        if kernel.outputs.len() != self.sizes.len() {
            return Err(place.kernel(format!(
                "it has {} outputs, but sizes of {} are given",
                kernel.outputs.len(),
                self.sizes.len()
            )));
        }
        let slots = slots::slots(&kernel);
        let reads = reads([&call], &[]);
        let mut changes = Vec::new();
        for (slot, argument) in slots.iter().zip(&call.args) {
            let (true, Argument::Value(from)) = (slot.role.is_written(), argument) else {
                continue;
            };
            if matches!(graph.values[from.at()].origin, Origin::Given { .. }) {
                return Err(place.argument(
                    &slot.name,
                    "the kernel writes it, but it was given: begin with `zeros` or `cleared`",
                ));
            }
            changes.push((slot.name.clone(), *from));
        }
        let names = slots[slots.len() - kernel.outputs.len()..].iter();
        let shapes = names
            .zip(kernel.outputs.iter().zip(&self.sizes))
            .map(|(slot, (output, size))| {
                output_shape(output, *size).map_err(|p| place.argument(&slot.name, p))
            })
            .collect::<Result<Vec<_>>>()?;
        let only = shapes.len() == 1;
        let labelled = shapes.into_iter().enumerate().map(|(i, shape)| {
            let label = match only {
                true => self.label.clone(),
                false => format!("{} {i}", self.label).into(),
            };
            graph.made(label, shape)
        });
        let outputs: Vec<Handle> = labelled.collect();
        call.args
            .extend(outputs.iter().map(|h| Argument::Value(*h)));
        if let Err(error) = graph.check(place, &call) {
            graph.values.truncate(before);
            return Err(error);
        }
        let pass = graph.passes.len();
        let mut writes = outputs.clone();
        let mut changed = Vec::new();
        for (name, from) in changes {
            let value = &mut graph.values[from.at()];
            value.changed_by = Some(pass);
            let value = Value {
                label: value.label.clone(),
                shape: value.shape.clone(),
                origin: Origin::Changed { pass, from },
                changed_by: None,
            };
            let handle = graph.push(value);
            writes.push(handle);
            changed.push((name, handle));
        }
        graph.passes.push(Pass {
            label: self.label,
            work: Work::Compute(call),
            reads,
            writes,
            note: self.note,
        });
        Ok(Written { outputs, changed })
    }
}

/// What an output of a compute kernel is written to.
fn output_shape(output: &Output, size: Size) -> std::result::Result<Shape, String> {
    match (output, size) {
        (Output::Buffer { layout, .. }, Size::Elements(n)) => Ok(Shape::Buffer {
            bytes: n.saturating_mul(layout.size as usize),
            layout: layout.clone(),
        }),
        (
            Output::Texture {
                format, dimensions, ..
            },
            Size::Texels(size),
        ) => Ok(Shape::Texture(if *dimensions == 3 {
            TextureShape::d3(size, *format)
        } else {
            TextureShape::d2(size[0], size[1], *format)
        })),
        (Output::Buffer { .. }, Size::Texels(_)) => {
            Err("it is a buffer: give a number of elements".into())
        }
        _ => Err("it is a texture: give its size in texels".into()),
    }
}

/// A draw on its way into a graph. Arguments belong to the stage that was named last.
#[derive(Debug)]
#[must_use = "a pass is part of the graph only after `depth` or `colour`"]
pub struct AddDraw<'g> {
    graph: &'g mut Graph,
    label: Cow<'static, str>,
    surfaces: Surfaces,
    vertex: Named,
    fragment: Option<Named>,
    blend: Blend,
    before: Option<Handle>,
}

impl AddDraw<'_> {
    fn stage(&mut self) -> &mut Named {
        self.fragment.as_mut().unwrap_or(&mut self.vertex)
    }

    /// Names the fragment kernel.
    pub fn fragment(mut self, kernel: impl Into<Cow<'static, str>>) -> Self {
        self.fragment = Some(Named::new(kernel));
        self
    }

    /// Gives an argument by its parameter's name.
    pub fn arg(
        mut self,
        parameter: impl Into<Cow<'static, str>>,
        argument: impl Into<Argument>,
    ) -> Self {
        let (parameter, argument) = (parameter.into(), argument.into());
        self.stage().args.push((parameter, argument));
        self
    }

    /// Gives a specialisation constant; without it, it has its default.
    pub fn constant(
        mut self,
        name: impl Into<Cow<'static, str>>,
        value: impl Into<ConstantValue>,
    ) -> Self {
        let (name, value) = (name.into(), value.into());
        self.stage().constants.push((name, value));
        self
    }

    /// Fragments are put together with what is there, in the order of the triangles, and do not hide each other.
    pub const fn blend(mut self, blend: Blend) -> Self {
        self.blend = blend;
        self
    }

    /// Only fragments that are nearer than this depth are blended, sample by sample.
    pub const fn before(mut self, depth: Handle) -> Self {
        self.before = Some(depth);
        self
    }

    /// Adds the pass: depth alone, [`SAMPLES`] samples of each texel.
    ///
    /// # Errors
    /// [`GraphError`]; the graph is then as it was.
    pub fn depth(self, [width, height]: [u32; 2]) -> Result<Handle> {
        self.depth_alone(TextureShape::depth(width, height).multisampled(SAMPLES))
    }

    /// Adds the pass: depth alone, one sample in the middle of each texel.
    ///
    /// # Errors
    /// [`GraphError`]; the graph is then as it was.
    pub fn single_depth(self, [width, height]: [u32; 2]) -> Result<Handle> {
        self.depth_alone(TextureShape::depth(width, height))
    }

    fn depth_alone(self, shape: TextureShape) -> Result<Handle> {
        if let Some(fragment) = &self.fragment {
            let place = fragment.place(&self.label);
            return Err(place.kernel("depth is drawn without a fragment kernel: leave it out"));
        }
        if self.blend != Blend::Off || self.before.is_some() {
            return Err(GraphError::Draw {
                pass: self.label.into(),
                problem: "depth is not blended: leave `blend` and `before` out".into(),
            });
        }
        self.finish(shape, |depth| Target::Depth { depth })
    }

    /// Adds the pass: a picture in `format`, the mean of [`SAMPLES`] samples of each pixel.
    ///
    /// # Errors
    /// [`GraphError`]; the graph is then as it was.
    pub fn colour(
        self,
        [width, height]: [u32; 2],
        format: hankel_dsl::native::describe::TexelFormat,
        background: [f64; 4],
    ) -> Result<Handle> {
        self.coloured(TextureShape::d2(width, height, format), SAMPLES, background)
    }

    /// Adds the pass: a picture with all [`SAMPLES`] samples of each pixel.
    ///
    /// # Errors
    /// [`GraphError`]; the graph is then as it was.
    pub fn samples(
        self,
        [width, height]: [u32; 2],
        format: hankel_dsl::native::describe::TexelFormat,
        background: [f64; 4],
    ) -> Result<Handle> {
        let shape = TextureShape::d2(width, height, format).multisampled(SAMPLES);
        self.coloured(shape, SAMPLES, background)
    }

    /// Adds the pass: a picture with one sample in the middle of each pixel.
    ///
    /// # Errors
    /// [`GraphError`]; the graph is then as it was.
    pub fn single_samples(
        self,
        [width, height]: [u32; 2],
        format: hankel_dsl::native::describe::TexelFormat,
        background: [f64; 4],
    ) -> Result<Handle> {
        self.coloured(TextureShape::d2(width, height, format), 1, background)
    }

    fn coloured(self, shape: TextureShape, samples: u32, background: [f64; 4]) -> Result<Handle> {
        if self.fragment.is_none() {
            return Err(GraphError::Draw {
                pass: self.label.into(),
                problem: "a colour needs a fragment kernel: name one with `fragment`".into(),
            });
        }
        self.graph
            .check_blend(&self.label, self.blend, self.before, shape, samples)?;
        let (blend, before) = (self.blend, self.before);
        self.finish(shape, |colour| Target::Colour {
            colour,
            samples,
            background,
            blend,
            before,
        })
    }

    fn finish(self, shape: TextureShape, target: impl Fn(Handle) -> Target) -> Result<Handle> {
        let Self {
            graph,
            label,
            surfaces,
            vertex: named,
            fragment: named_fragment,
            blend,
            before,
        } = self;
        if shape.size.contains(&0) || shape.format.texel().is_integer() {
            let what = if shape.format == Format::Depth32 {
                "depth"
            } else {
                "colour"
            };
            return Err(GraphError::Draw {
                pass: label.into(),
                problem: format!(
                    "its {what} is {}x{} texels of {}: at least one is needed, and floats",
                    shape.size[0],
                    shape.size[1],
                    shape.format.name()
                ),
            });
        }
        graph.check_surfaces(&label, &surfaces)?;
        let place = named.place(&label);
        let vertex = named.call(graph, &label, "vertex")?;
        graph.check(place, &vertex)?;
        graph.check_attributes(place, &vertex, &surfaces)?;
        let fragment = match &named_fragment {
            Some(named) => {
                let place = named.place(&label);
                let call = named.call(graph, &label, "fragment")?;
                graph.check(place, &call)?;
                graph.check_stages(place, &vertex, call.kernel)?;
                Some(call)
            }
            None => None,
        };
        let Surfaces {
            positions,
            indices,
            clip_from_world,
        } = surfaces;
        let mut first = vec![positions, indices, clip_from_world];
        first.extend(before);
        let same = graph
            .passes
            .iter()
            .find_map(|pass| match (&pass.work, &*pass.writes) {
                (
                    Work::Draw {
                        surfaces: s,
                        vertex: v,
                        fragment: f,
                        target: t,
                    },
                    [made],
                ) => (*s == surfaces && *v == vertex && *f == fragment && *t == target(*made))
                    .then_some(*made),
                _ => None,
            });
        // What another technique has drawn already.
        if let Some(made) = same
            && graph.is_current(made)
            && graph.values[made.at()].shape == Shape::Texture(shape)
        {
            return Ok(made);
        }
        let reads = reads(std::iter::once(&vertex).chain(&fragment), &first);
        let made = graph.made(label.clone(), Shape::Texture(shape));
        graph.passes.push(Pass {
            label,
            work: Work::Draw {
                surfaces,
                vertex,
                fragment,
                target: target(made),
            },
            reads,
            writes: vec![made],
            note: (blend != Blend::Off).then(|| format!("{} blending", blend.name())),
        });
        Ok(made)
    }
}
