//! Runs a graph on a device, as often as one likes, and each time only what has to run.
//!
//! Buffers and textures are made once. Values that are never needed at the same time share one, if
//! they are alike ([`Memory`]). A pass runs if something that it reads is another than when it ran
//! last, or if its output is needed again and another value has taken its place: after the camera
//! has moved, nothing runs that the camera does not reach, and when nothing has changed, nothing
//! runs.

mod schedule;

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::{Duration, Instant};

use bytemuck::cast_slice;
use hankel_dsl::native::Entry;
use hankel_dsl::native::describe::{Range, Stage as KernelStage};
use hankel_dsl::native::layout::Element;
use hankel_host::device::slots;
use hankel_host::device::{Arithmetic, Backend, Bind, BufferId, Device, Program, TextureId};
use serde::{Deserialize, Serialize};

use crate::error::{FrameError, Result, during};
use crate::graph::{Argument, Call, Graph, Handle, Origin, Pass, Shape, Target, Work};
use crate::visibility::{Draw, FullScreen, Onto, Source, Stage, Visibility};
use schedule::{Blocks, State};

/// Where the shaders of kernels come from, by entry-point name. The native device needs none.
pub trait Shaders {
    /// The SPIR-V of a kernel; `None` if there is none.
    fn words(&self, kernel: &str) -> Option<&[u32]>;
}

/// No shaders: enough for [`Backend::Native`].
#[derive(Clone, Copy, Debug, Default)]
pub struct NoShaders;

impl Shaders for NoShaders {
    fn words(&self, _: &str) -> Option<&[u32]> {
        None
    }
}

/// SPIR-V modules by entry-point name.
impl Shaders for BTreeMap<String, Vec<u32>> {
    fn words(&self, kernel: &str) -> Option<&[u32]> {
        self.get(kernel).map(Vec::as_slice)
    }
}

/// Told how far a frame is.
pub trait Progress {
    /// `step` of `steps` begins.
    fn begin(&mut self, name: &str, step: usize, steps: usize);
    /// The share of the current step that is done, 0 to 1. Not every step tells.
    fn advance(&mut self, share: f32);
}

/// Tells nobody.
#[derive(Clone, Copy, Debug, Default)]
pub struct Quiet;

impl Progress for Quiet {
    fn begin(&mut self, _: &str, _: usize, _: usize) {}
    fn advance(&mut self, _: f32) {}
}

/// When a run waits for the device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Clock {
    /// After each pass: each has its time, by the device's own clock if it has one, and the whole takes a
    /// little longer.
    Passes,
    /// At the end: only the whole has a time.
    Frame,
}

/// How long a part of the frame took.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Timing {
    /// Name of the part: a pass's label, `set-up`, or `read back`.
    pub name: String,
    /// By the GPU's timestamps where the device has them, else wall time. The first time that a pass runs,
    /// wall time includes the driver's compilation of its shaders.
    pub seconds: f64,
}

impl Timing {
    pub(crate) fn new(name: impl Into<String>, time: Duration) -> Self {
        Self {
            name: name.into(),
            seconds: time.as_secs_f64(),
        }
    }
}

/// What a run did.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Run {
    /// Passes that ran, in order. Their times are 0 with [`Clock::Frame`].
    pub ran: Vec<Timing>,
    /// Passes that did not have to.
    pub unchanged: Vec<String>,
    /// Wall time of the whole.
    pub seconds: f64,
    /// Share of the pixels whose samples see different triangles, of all draws of pictures that counted them
    /// together, at most 1: rays do.
    pub edges: Option<f64>,
}

/// What a graph takes on its device.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Memory {
    /// Bytes of all buffers and textures, which is also the most at any time.
    pub bytes: usize,
    /// What they would be if no two values shared one.
    pub unshared: usize,
}

/// What is on the device.
#[derive(Clone, Copy, Debug)]
enum Block {
    Buffer(BufferId),
    Texture(TextureId),
}

/// A graph on a device.
pub struct Executor<'d> {
    device: &'d mut dyn Device,
    shaders: &'d dyn Shaders,
    graph: Graph,
    needed: Vec<bool>,
    blocks: Blocks,
    on_device: Vec<Block>,
    /// Bytes of what is given.
    given: Vec<Option<Arc<[u8]>>>,
    state: State,
    visibility: Visibility,
}

/// A kernel's code for a device. Only that kind of code is asked for.
fn program<'a>(
    entry: &'a Entry,
    shaders: &'a dyn Shaders,
    backend: Backend,
    arithmetic: Arithmetic,
    pass: &Pass,
    constants: &'a [u32],
) -> Result<Program<'a>> {
    let kernel = &entry.kernel;
    let shader = match backend {
        Backend::Native => None,
        Backend::Vulkan => {
            let words = shaders.words(&kernel.name);
            let words = words.ok_or_else(|| FrameError::NoShader {
                pass: pass.label.to_string(),
                kernel: kernel.name.clone(),
            })?;
            Some(arithmetic.shader(words))
        }
    };
    Ok(Program {
        kernel,
        constants,
        native: Some(&entry.run),
        shader,
    })
}

/// The arithmetic of a pass: stages of a draw go the same way.
fn arithmetic(graph: &Graph, pass: &Pass) -> Arithmetic {
    Arithmetic::of(Graph::calls(pass).map(|call| &graph.kernels()[call.kernel].kernel))
}

/// Whether a uniform says how many invocations run, which devices want to read.
fn says_range(entry: &Entry, parameter: &str) -> bool {
    matches!(
        &entry.kernel.stage,
        KernelStage::Compute { range: Range::Uniform { param, .. }, .. } if param == parameter
    )
}

/// Everything that a pass's calls are made of.
struct Place<'a> {
    graph: &'a Graph,
    shaders: &'a dyn Shaders,
    backend: Backend,
    pass: &'a Pass,
    blocks: &'a Blocks,
    on_device: &'a [Block],
    given: &'a [Option<Arc<[u8]>>],
}

impl<'a> Place<'a> {
    fn block(&self, handle: Handle) -> Result<Block> {
        let block = self.blocks.of[handle.at()].map(|block| self.on_device[block]);
        block.ok_or_else(|| unused(self.graph, handle))
    }

    fn buffer(&self, handle: Handle) -> Result<BufferId> {
        match self.block(handle)? {
            Block::Buffer(id) => Ok(id),
            Block::Texture(_) => Err(wrong_kind(self.graph, handle, "a texture")),
        }
    }

    fn texture(&self, handle: Handle) -> Result<TextureId> {
        match self.block(handle)? {
            Block::Texture(id) => Ok(id),
            Block::Buffer(_) => Err(wrong_kind(self.graph, handle, "a buffer")),
        }
    }

    /// A kernel with its code and arguments.
    fn stage(&self, call: &'a Call) -> Result<Stage<'a>> {
        let entry = &self.graph.kernels()[call.kernel];
        let way = arithmetic(self.graph, self.pass);
        let constants = &call.constants;
        Ok(Stage {
            entry,
            program: program(entry, self.shaders, self.backend, way, self.pass, constants)?,
            args: self.args(entry, call)?,
        })
    }

    fn args(&self, entry: &Entry, call: &Call) -> Result<Vec<Bind<'a>>> {
        let slots = slots::drawn_slots(&entry.kernel);
        let bind = |(slot, argument): (&slots::Slot<'_>, &Argument)| {
            Ok(match argument {
                Argument::Sampler(sampler) => Bind::Sampler(*sampler),
                Argument::Value(handle) => match (&self.given[handle.at()], self.block(*handle)?) {
                    (Some(bytes), _) if says_range(entry, &slot.name) => Bind::Bytes(bytes),
                    (_, Block::Buffer(id)) => Bind::Buffer(id),
                    (_, Block::Texture(id)) => Bind::Texture(id),
                },
            })
        };
        slots.iter().zip(&call.args).map(bind).collect()
    }
}

fn unused(graph: &Graph, handle: Handle) -> FrameError {
    FrameError::Value {
        value: graph.values()[handle.at()].label.to_string(),
        problem: "no pass that runs touches it: `keep` what should be there after a run".into(),
    }
}

fn wrong_kind(graph: &Graph, handle: Handle, is: &str) -> FrameError {
    FrameError::Value {
        value: graph.values()[handle.at()].label.to_string(),
        problem: format!("it is {is}"),
    }
}

impl<'d> Executor<'d> {
    /// Makes everything that a graph needs on a device; nothing runs yet.
    ///
    /// # Errors
    /// [`FrameError::NoShader`] for a kernel of a pass that would run; [`FrameError::Device`];
    /// [`FrameError::Value`] if what is to be kept is changed by a later pass.
    pub fn new(device: &'d mut dyn Device, shaders: &'d dyn Shaders, graph: Graph) -> Result<Self> {
        let needed = graph.needed();
        let backend = device.backend();
        for (pass, _) in graph.passes().iter().zip(&needed).filter(|(_, n)| **n) {
            let way = arithmetic(&graph, pass);
            for call in Graph::calls(pass) {
                let entry = &graph.kernels()[call.kernel];
                program(entry, shaders, backend, way, pass, &call.constants)?;
            }
        }
        let blocks = Blocks::new(&graph, &needed);
        let kept_is_changed = graph.kept().iter().find(|kept| {
            let changes = |pass: &Pass| {
                pass.writes.iter().any(|w| {
                    matches!(graph.values()[w.at()].origin, Origin::Changed { from, .. } if from == **kept)
                })
            };
            let runs = graph.passes().iter().zip(&needed).filter(|(_, n)| **n);
            runs.map(|(pass, _)| pass).any(changes)
        });
        if let Some(kept) = kept_is_changed {
            return Err(FrameError::Value {
                value: graph.values()[kept.at()].label.to_string(),
                problem: "it is to be kept, but a later pass changes it: keep what that returned"
                    .into(),
            });
        }
        let given = graph.values().iter().map(|value| match &value.origin {
            Origin::Given { bytes, .. } => Some(Arc::clone(bytes)),
            _ => None,
        });
        let given: Vec<_> = given.collect();
        let mut this = Self {
            visibility: Visibility::of(backend),
            state: State::new(&graph, &blocks),
            device,
            shaders,
            needed,
            on_device: Vec::new(),
            given,
            blocks,
            graph,
        };
        // From here on, what was made is freed when `this` goes.
        for (i, shape) in this.blocks.shapes.iter().enumerate() {
            let tenant = (0..this.graph.values().len()).find(|v| this.blocks.of[*v] == Some(i));
            let label = tenant.map_or("", |v| &this.graph.values()[v].label);
            let made = match shape {
                Shape::Buffer { bytes, .. } => this.device.buffer(label, *bytes).map(Block::Buffer),
                Shape::Texture(shape) => this.device.texture(label, shape).map(Block::Texture),
            };
            this.on_device.push(made.map_err(during(label))?);
        }
        for value in 0..this.given.len() {
            this.upload(value)?;
        }
        Ok(this)
    }

    /// The graph.
    #[must_use]
    pub const fn graph(&self) -> &Graph {
        &self.graph
    }

    /// The device's name.
    #[must_use]
    pub fn device_name(&self) -> &str {
        self.device.name()
    }

    /// What it takes on the device. What visibility needs for itself counts from the first run on.
    #[must_use]
    pub fn memory(&self) -> Memory {
        let own = self.visibility.bytes();
        Memory {
            bytes: self.blocks.bytes() + own,
            unshared: self.blocks.unshared + own,
        }
    }

    fn upload(&mut self, value: usize) -> Result<()> {
        let (Some(bytes), Some(block)) = (&self.given[value], self.blocks.of[value]) else {
            return Ok(());
        };
        let label = &*self.graph.values()[value].label;
        match self.on_device[block] {
            Block::Buffer(id) => self.device.write_buffer(id, bytes),
            Block::Texture(id) => self.device.write_texture(id, bytes),
        }
        .map_err(during(label))
    }

    /// Gives a parameter another value. The same value again changes nothing.
    ///
    /// # Errors
    /// [`FrameError::Value`] for a handle of another graph, something that is not given or is
    /// constant, or a value of another type; [`FrameError::Device`].
    pub fn set<T: Element>(&mut self, parameter: Handle, value: &T) -> Result<()> {
        self.set_buffer(parameter, std::slice::from_ref(value))
    }

    /// Gives a buffer other elements, as many as it has.
    ///
    /// # Errors
    /// As for [`Executor::set`].
    pub fn set_buffer<T: Element>(&mut self, buffer: Handle, elements: &[T]) -> Result<()> {
        let Some(value) = self.graph.value(buffer) else {
            return Err(FrameError::Value {
                value: T::layout().name,
                problem: "the handle belongs to another graph".into(),
            });
        };
        let refuse = |problem: String| FrameError::Value {
            value: value.label.to_string(),
            problem,
        };
        match &value.origin {
            Origin::Given {
                is_constant: false, ..
            } => {}
            Origin::Given { .. } => {
                return Err(refuse("it is constant: make it a parameter".into()));
            }
            _ => {
                return Err(refuse(
                    "a pass writes it: only what is given can be set".into(),
                ));
            }
        }
        let bytes: &[u8] = cast_slice(elements);
        let layout = T::layout();
        let has = match &value.shape {
            Shape::Buffer { bytes, layout: has } if *has == layout => *bytes,
            Shape::Buffer { layout: has, .. } => {
                return Err(refuse(format!(
                    "it holds {}, not {}",
                    has.name, layout.name
                )));
            }
            Shape::Texture(_) => return Err(refuse("it is a texture".into())),
        };
        if has != bytes.len() {
            return Err(refuse(format!(
                "it has {has} bytes, not {}: another length needs another graph",
                bytes.len()
            )));
        }
        if self.given[buffer.at()].as_deref() == Some(bytes) {
            return Ok(());
        }
        self.given[buffer.at()] = Some(bytes.into());
        self.state.changed(buffer);
        self.upload(buffer.at())
    }

    /// Makes every pass run again, for measurements.
    pub fn forget(&mut self) {
        self.state.forget();
    }

    /// Runs what has to run.
    ///
    /// # Errors
    /// [`FrameError::Device`]. What did not run then runs the next time.
    pub fn run(&mut self, clock: Clock, progress: &mut dyn Progress) -> Result<Run> {
        let whole = Instant::now();
        let due = self.state.due(&self.graph, &self.needed, &self.blocks);
        let steps = due.iter().filter(|d| **d).count();
        let mut run = Run::default();
        let during_clock = during("timing the passes");
        let has_clock =
            clock == Clock::Passes && self.device.begin_clock().map_err(during_clock)?;
        // Which of the device's times are of a pass.
        let mut laps = Vec::new();
        for (pass, is_due) in due.iter().enumerate() {
            let label = self.graph.passes()[pass].label.to_string();
            if !is_due {
                if self.needed[pass] {
                    run.unchanged.push(label);
                }
                continue;
            }
            progress.begin(&label, run.ran.len() + 1, steps);
            let start = Instant::now();
            let first = self.device.laps();
            self.state.begin(&self.graph, &self.blocks, pass);
            let edges = self.run_pass(pass, &mut |share| progress.advance(share))?;
            if let Some(edges) = edges {
                run.edges = Some((run.edges.unwrap_or(0.0) + edges).min(1.0));
            }
            let mut time = Duration::ZERO;
            if clock == Clock::Passes {
                self.device.wait().map_err(during(&label))?;
                time = start.elapsed();
                laps.push(first..self.device.laps());
            }
            self.state.end(&self.graph, &self.blocks, pass);
            progress.advance(1.0);
            run.ran.push(Timing::new(label, time));
        }
        if clock == Clock::Frame {
            self.device
                .wait()
                .map_err(during("waiting for the frame"))?;
        }
        if has_clock {
            let times = self
                .device
                .end_clock()
                .map_err(during("timing the passes"))?;
            for (timing, laps) in run.ran.iter_mut().zip(laps) {
                // A pass that the device did not time keeps its wall time.
                if let Some(times) = times.get(laps).filter(|it| !it.is_empty()) {
                    timing.seconds = times.iter().sum();
                }
            }
        }
        run.seconds = whole.elapsed().as_secs_f64();
        Ok(run)
    }

    /// Runs everything again, `rounds` times, and gives the median time of each pass: the steady
    /// state, if it has run before.
    ///
    /// # Errors
    /// As for [`Executor::run`].
    pub fn steady(&mut self, rounds: usize) -> Result<Vec<Timing>> {
        let mut all: Vec<(String, Vec<f64>)> = Vec::new();
        for _ in 0..rounds {
            self.forget();
            for (i, timing) in self
                .run(Clock::Passes, &mut Quiet)?
                .ran
                .into_iter()
                .enumerate()
            {
                match all.get_mut(i) {
                    Some((_, times)) => times.push(timing.seconds),
                    None => all.push((timing.name, vec![timing.seconds])),
                }
            }
        }
        let median = |mut times: Vec<f64>| {
            times.sort_by(f64::total_cmp);
            times[times.len() / 2]
        };
        let timings = all.into_iter().map(|(name, times)| Timing {
            name,
            seconds: median(times),
        });
        Ok(timings.collect())
    }

    /// Runs one pass.
    fn run_pass(&mut self, pass: usize, advance: &mut dyn FnMut(f32)) -> Result<Option<f64>> {
        let number = pass;
        let pass = &self.graph.passes()[number];
        let place = Place {
            graph: &self.graph,
            shaders: self.shaders,
            backend: self.device.backend(),
            pass,
            blocks: &self.blocks,
            on_device: &self.on_device,
            given: &self.given,
        };
        match &pass.work {
            Work::Clear(value) => {
                for made in &pass.writes {
                    match place.block(*made)? {
                        Block::Buffer(id) => self.device.clear_buffer(id),
                        Block::Texture(id) => self.device.clear_texture(id, *value),
                    }
                    .map_err(during(&pass.label))?;
                }
                Ok(None)
            }
            Work::Levels(levels) => {
                for made in &pass.writes {
                    let whole = place.texture(*made)?;
                    for (level, from) in (0..).zip(levels) {
                        let from = place.texture(*from)?;
                        self.device
                            .copy_to_level(from, whole, level)
                            .map_err(during(&pass.label))?;
                    }
                }
                Ok(None)
            }
            Work::Compute(call) => {
                let Stage { program, args, .. } = place.stage(call)?;
                self.device
                    .dispatch(&program, &args)
                    .map_err(during(&pass.label))?;
                Ok(None)
            }
            Work::FullScreen { vertex, fragment } => {
                let targets = pass.writes.iter().map(|made| place.texture(*made));
                let drawn = FullScreen {
                    label: &pass.label,
                    vertex: place.stage(vertex)?,
                    fragment: place.stage(fragment)?,
                    targets: targets.collect::<Result<_>>()?,
                };
                self.visibility.cover(&mut *self.device, &drawn)?;
                Ok(None)
            }
            Work::Draw {
                surfaces,
                vertex,
                fragment,
                target,
            } => {
                let source = |handle| -> Result<Source> {
                    Ok(Source {
                        buffer: place.buffer(handle)?,
                        stamp: self.state.stamp(handle),
                    })
                };
                let bytes = |handle: Handle| self.graph.values()[handle.at()].shape.bytes();
                let (drawn, onto) = match target {
                    Target::Depth { depth } => (*depth, Onto::Depth(place.texture(*depth)?)),
                    Target::Colour {
                        colour,
                        samples,
                        background,
                        blend,
                        before,
                    } => {
                        let onto = Onto::Colour {
                            texture: place.texture(*colour)?,
                            samples: *samples,
                            background: *background,
                            blend: *blend,
                            before: before.map(|depth| place.texture(depth)).transpose()?,
                        };
                        (*colour, onto)
                    }
                };
                let Shape::Texture(shape) = self.graph.values()[drawn.at()].shape else {
                    return Err(wrong_kind(&self.graph, drawn, "a buffer"));
                };
                let draw = Draw {
                    pass: number,
                    label: &pass.label,
                    positions: source(surfaces.positions)?,
                    indices: source(surfaces.indices)?,
                    count: (bytes(surfaces.indices) / size_of::<u32>()) as u32,
                    clip_from_world: source(surfaces.clip_from_world)?,
                    vertex: place.stage(vertex)?,
                    fragment: fragment.as_ref().map(|f| place.stage(f)).transpose()?,
                    onto,
                    shape,
                };
                self.visibility.draw(&mut *self.device, &draw, advance)
            }
        }
    }

    /// The bytes of a value that was kept, or that is given.
    ///
    /// # Errors
    /// [`FrameError::Value`] for a value that is not there now, or of another graph;
    /// [`FrameError::Device`].
    pub fn read(&mut self, value: Handle) -> Result<Vec<u8>> {
        let Some(known) = self.graph.value(value) else {
            return Err(FrameError::Value {
                value: "a value".into(),
                problem: "the handle belongs to another graph".into(),
            });
        };
        let label = known.label.clone();
        let Some(block) = self.blocks.of[value.at()] else {
            return Err(unused(&self.graph, value));
        };
        if !self.state.is_there(&self.blocks, value) {
            return Err(FrameError::Value {
                value: label.into(),
                problem: "it is not there: `keep` it, and run the graph".into(),
            });
        }
        match self.on_device[block] {
            Block::Buffer(id) => self.device.read_buffer(id),
            Block::Texture(id) => self.device.read_texture(id),
        }
        .map_err(during(&label))
    }
}

impl Drop for Executor<'_> {
    fn drop(&mut self) {
        self.visibility.free(&mut *self.device);
        for block in self.on_device.drain(..) {
            // The device is gone if it cannot free.
            let _ = match block {
                Block::Buffer(id) => self.device.free_buffer(id),
                Block::Texture(id) => self.device.free_texture(id),
            };
        }
    }
}
