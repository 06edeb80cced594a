//! A frame as data: values, and passes that make values of other values.
//!
//! A [`Graph`] is made before there is a device. Whoever adds a pass names a kernel and gives its
//! arguments by the names of its parameters; he gets handles of what the pass writes. So a pass
//! can only read what an earlier one wrote: there is no order to get wrong.
//!
//! ```
//! # use hankel_frames::graph::{Graph, GraphError};
//! # use hankel_host::device::{Format, TextureShape};
//! # use hankel_dsl::native::describe::TexelFormat;
//! # fn main() -> Result<(), GraphError> {
//! let mut graph = Graph::new(hankel_shadows::entries());
//! let depth = TextureShape::depth(512, 512).multisampled(4);
//! let depth = graph.cleared("depth", depth);
//! let moments = graph
//!     .compute("resolve", "resolve_symmetric")
//!     .arg("depth", depth)
//!     .image([512, 512])?;
//! graph.keep(moments);
//! # Ok(())
//! # }
//! ```
//!
//! Everything is checked while the graph is made, by the same rules that devices check a call by:
//! the kernel and its stage, each parameter's kind, type, format and size, that nothing is read and
//! written at once, that no handle is older than the last change of what it stands for. An error
//! names the pass, the kernel, the parameter, and says what to do.
//!
//! [`crate::Executor`] runs a graph, as often as one likes.

mod add;
mod check;
mod forms;
mod print;

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};

use bytemuck::cast_slice;
use hankel_dsl::glam::Vec4;
use hankel_dsl::native::describe::Layout;
use hankel_dsl::native::layout::Element;
use hankel_dsl::native::{Entry, Sampler};
use hankel_host::device::{Blend, TextureShape};

pub use add::{AddCompute, AddDraw, Written};
pub use check::GraphError;
pub use forms::{FULL_SCREEN_VERTICES, ImagePasses};
pub use print::{PassSummary, Summary};

/// [`Result`](std::result::Result) of making a graph.
pub type Result<T> = std::result::Result<T, GraphError>;

/// A value of a graph: what a buffer or texture holds from the pass that writes it to the one that
/// changes it, or what was given.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Handle {
    graph: u32,
    pub(crate) index: u32,
}

impl Handle {
    pub(crate) const fn at(self) -> usize {
        self.index as usize
    }
}

/// What holds a value.
#[derive(Clone, Debug, PartialEq)]
pub enum Shape {
    /// A buffer.
    Buffer {
        /// Its size.
        bytes: usize,
        /// Layout of its elements.
        layout: Layout,
    },
    /// A texture.
    Texture(TextureShape),
}

impl Shape {
    /// Size in bytes.
    #[must_use]
    pub fn bytes(&self) -> usize {
        match self {
            Self::Buffer { bytes, .. } => *bytes,
            Self::Texture(shape) => shape.bytes(),
        }
    }
}

/// Where a value comes from.
#[derive(Clone, Debug)]
pub enum Origin {
    /// It is given, with these bytes at first.
    Given {
        /// At first.
        bytes: Arc<[u8]>,
        /// Nobody will ever change it.
        is_constant: bool,
    },
    /// A pass makes it.
    Made {
        /// The pass's number.
        pass: usize,
    },
    /// A pass makes it of another value, in the same place.
    Changed {
        /// The pass's number.
        pass: usize,
        /// What is there no more afterwards.
        from: Handle,
    },
}

/// A value, as far as it is known before anything runs.
#[derive(Clone, Debug)]
pub struct Value {
    /// Name for messages.
    pub label: Cow<'static, str>,
    /// What holds it.
    pub shape: Shape,
    /// Where it comes from.
    pub origin: Origin,
    /// The pass that changed it in its place, after which nobody can read it.
    changed_by: Option<usize>,
}

impl Value {
    /// The pass that writes it; `None` if it is given.
    #[must_use]
    pub const fn pass(&self) -> Option<usize> {
        match self.origin {
            Origin::Given { .. } => None,
            Origin::Made { pass } | Origin::Changed { pass, .. } => Some(pass),
        }
    }
}

/// An argument of a kernel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Argument {
    /// A value.
    Value(Handle),
    /// A sampler.
    Sampler(Sampler),
}

impl From<Handle> for Argument {
    fn from(handle: Handle) -> Self {
        Self::Value(handle)
    }
}

impl From<Sampler> for Argument {
    fn from(sampler: Sampler) -> Self {
        Self::Sampler(sampler)
    }
}

/// A kernel with its arguments, checked.
#[derive(Clone, Debug, PartialEq)]
pub struct Call {
    /// Its number among the graph's kernels.
    pub kernel: usize,
    /// Its arguments, in the order of [`hankel_host::device::slots::slots`]; what is changed in its
    /// place stands there as it was before.
    pub args: Vec<Argument>,
    /// Values of the specialisation constants, in the order of the parameters.
    pub constants: Vec<u32>,
    /// Where a buffer says how far a compute kernel runs: no farther than this along x, y, z.
    pub most: Option<[u32; 3]>,
}

/// What a draw is made of: triangles, and the transform by which its vertex kernel puts them into
/// clip space. A rasteriser needs the indices only; rays need all three.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Surfaces {
    /// World-space positions of the vertices, as `Vec3`.
    pub positions: Handle,
    /// Three vertices for each triangle, as `u32`.
    pub indices: Handle,
    /// The transform, as [`hankel_shadows::depth::Transform`].
    pub clip_from_world: Handle,
}

/// What a draw draws into.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Target {
    /// Depth, all samples of it.
    Depth {
        /// It.
        depth: Handle,
    },
    /// One colour: all samples of it, or the mean of each pixel's, as its texture has one sample or several.
    /// Without blending, what is nearest is seen, and depth itself is dropped.
    Colour {
        /// It.
        colour: Handle,
        /// Samples of a pixel.
        samples: u32,
        /// The colour where nothing is.
        background: [f64; 4],
        /// How fragments are put together with what is there. Those that blend do not hide each other.
        blend: Blend,
        /// Depth of what hides them, with as many samples; it stays as it is.
        before: Option<Handle>,
    },
}

/// What a pass does.
#[derive(Clone, Debug, PartialEq)]
pub enum Work {
    /// Fills with one value: a buffer with zeros, a texture with what [`Graph::filled`] was given.
    Clear(Vec4),
    /// Copies textures into the mip levels of one.
    Levels(Vec<Handle>),
    /// Runs a compute kernel.
    Compute(Call),
    /// Draws a triangle over all pixels of what the pass writes, without depth and blending: an image pass in its
    /// fragment form.
    FullScreen {
        /// The vertex stage: [`FULL_SCREEN_VERTICES`] vertices without attributes.
        vertex: Call,
        /// The fragment stage.
        fragment: Call,
    },
    /// Draws triangles.
    Draw {
        /// What.
        surfaces: Surfaces,
        /// The vertex stage.
        vertex: Call,
        /// The fragment stage; none for depth.
        fragment: Option<Call>,
        /// Into what.
        target: Target,
    },
}

/// A pass: work, what it reads and what it writes.
#[derive(Clone, Debug, PartialEq)]
pub struct Pass {
    /// Name for messages and timings.
    pub label: Cow<'static, str>,
    /// What it does.
    pub work: Work,
    /// Values that it reads, each once.
    pub reads: Vec<Handle>,
    /// Values that it writes.
    pub writes: Vec<Handle>,
    /// What a reader of the plan should know beside kernels and sizes.
    pub note: Option<String>,
}

/// Something that was left out.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize)]
pub struct Omission {
    /// What.
    pub what: Cow<'static, str>,
    /// Why.
    pub why: Cow<'static, str>,
}

/// A frame as data.
#[derive(Clone, Debug)]
pub struct Graph {
    number: u32,
    kernels: Arc<[Entry]>,
    values: Vec<Value>,
    passes: Vec<Pass>,
    kept: Vec<Handle>,
    omitted: Vec<Omission>,
    /// What given values are, by their numbers.
    meanings: BTreeMap<u32, Cow<'static, str>>,
}

impl Graph {
    /// An empty graph, for passes of these kernels.
    #[must_use]
    pub fn new(kernels: impl Into<Arc<[Entry]>>) -> Self {
        static NEXT: AtomicU32 = AtomicU32::new(0);
        Self {
            number: NEXT.fetch_add(1, Ordering::Relaxed),
            kernels: kernels.into(),
            values: Vec::new(),
            passes: Vec::new(),
            kept: Vec::new(),
            omitted: Vec::new(),
            meanings: BTreeMap::new(),
        }
    }

    /// Its kernels.
    #[must_use]
    pub fn kernels(&self) -> &[Entry] {
        &self.kernels
    }

    /// Its passes, in the order in which they run.
    #[must_use]
    pub fn passes(&self) -> &[Pass] {
        &self.passes
    }

    /// Its values; a handle's are [`Graph::value`].
    #[must_use]
    pub fn values(&self) -> &[Value] {
        &self.values
    }

    /// What the frame is for: see [`Graph::keep`].
    #[must_use]
    pub fn kept(&self) -> &[Handle] {
        &self.kept
    }

    /// What was left out.
    #[must_use]
    pub fn omitted(&self) -> &[Omission] {
        &self.omitted
    }

    /// The value of a handle; `None` for another graph's.
    #[must_use]
    pub fn value(&self, handle: Handle) -> Option<&Value> {
        self.values
            .get(handle.at())
            .filter(|_| handle.graph == self.number)
    }

    /// A number or structure that may change from run to run.
    pub fn parameter<T: Element>(
        &mut self,
        label: impl Into<Cow<'static, str>>,
        value: &T,
    ) -> Handle {
        self.given(label, std::slice::from_ref(value), false)
    }

    /// A buffer that may change from run to run, its length excepted.
    pub fn buffer<T: Element>(
        &mut self,
        label: impl Into<Cow<'static, str>>,
        elements: &[T],
    ) -> Handle {
        self.given(label, elements, false)
    }

    /// A number or structure that never changes. What depends on it alone need not be kept from
    /// run to run.
    pub fn constant<T: Element>(
        &mut self,
        label: impl Into<Cow<'static, str>>,
        value: &T,
    ) -> Handle {
        self.given(label, std::slice::from_ref(value), true)
    }

    /// A buffer that never changes.
    pub fn constants<T: Element>(
        &mut self,
        label: impl Into<Cow<'static, str>>,
        elements: &[T],
    ) -> Handle {
        self.given(label, elements, true)
    }

    fn given<T: Element>(
        &mut self,
        label: impl Into<Cow<'static, str>>,
        elements: &[T],
        is_constant: bool,
    ) -> Handle {
        let bytes: &[u8] = cast_slice(elements);
        let label = label.into();
        let shape = Shape::Buffer {
            bytes: bytes.len(),
            layout: T::layout(),
        };
        // The same constant is there once: passes that differ in nothing else are the same.
        let is_same = |v: &Value| {
            let Origin::Given {
                bytes: there,
                is_constant: true,
            } = &v.origin
            else {
                return false;
            };
            v.label == label && v.shape == shape && **there == *bytes
        };
        if is_constant && let Some(index) = self.values.iter().position(is_same) {
            return Handle {
                graph: self.number,
                index: index as u32,
            };
        }
        self.push(Value {
            label,
            shape,
            origin: Origin::Given {
                bytes: bytes.into(),
                is_constant,
            },
            changed_by: None,
        })
    }

    /// A texture of zeros, for kernels that write where they like.
    pub fn cleared(&mut self, label: impl Into<Cow<'static, str>>, shape: TextureShape) -> Handle {
        self.clear(label.into(), Shape::Texture(shape), Vec4::ZERO)
    }

    /// A texture of floats that holds one value everywhere, rounded to its format, for kernels that write
    /// where they like.
    ///
    /// # Errors
    /// [`GraphError::Fill`] for a texture of integers.
    pub fn filled(
        &mut self,
        label: impl Into<Cow<'static, str>>,
        shape: TextureShape,
        value: Vec4,
    ) -> Result<Handle> {
        let label = label.into();
        if shape.format.texel().is_integer() {
            return Err(GraphError::Fill {
                value: label.into(),
                format: shape.format.name().into(),
            });
        }
        Ok(self.clear(label, Shape::Texture(shape), value))
    }

    /// A buffer of so many zeros, for kernels that add to it or write where they like.
    pub fn zeros<T: Element>(
        &mut self,
        label: impl Into<Cow<'static, str>>,
        elements: usize,
    ) -> Handle {
        let shape = Shape::Buffer {
            bytes: elements.saturating_mul(size_of::<T>()),
            layout: T::layout(),
        };
        self.clear(label.into(), shape, Vec4::ZERO)
    }

    fn clear(&mut self, label: Cow<'static, str>, shape: Shape, value: Vec4) -> Handle {
        let made = self.made(label.clone(), shape);
        self.passes.push(Pass {
            label,
            work: Work::Clear(value),
            reads: Vec::new(),
            writes: vec![made],
            note: None,
        });
        made
    }

    /// Says that a value is what the frame is for: it is there after each run. Passes that no such
    /// value needs do not run.
    ///
    /// # Panics
    /// For another graph's handle.
    pub fn keep(&mut self, value: Handle) {
        assert!(
            value.graph == self.number,
            "this handle belongs to another graph"
        );
        if !self.kept.contains(&value) {
            self.kept.push(value);
        }
    }

    /// Says what a given value is, to those who will give others in its place.
    ///
    /// # Panics
    /// For another graph's handle.
    pub fn describe(&mut self, value: Handle, meaning: impl Into<Cow<'static, str>>) {
        assert!(
            value.graph == self.number,
            "this handle belongs to another graph"
        );
        self.meanings.insert(value.index, meaning.into());
    }

    /// What a given value is, if that was said.
    #[must_use]
    pub fn meaning(&self, value: Handle) -> Option<&str> {
        self.value(value)?;
        self.meanings.get(&value.index).map(|meaning| &**meaning)
    }

    /// Notes what a technique leaves out, and why; the same is noted once.
    pub fn omit(&mut self, what: impl Into<Cow<'static, str>>, why: impl Into<Cow<'static, str>>) {
        let omission = Omission {
            what: what.into(),
            why: why.into(),
        };
        if !self.omitted.contains(&omission) {
            self.omitted.push(omission);
        }
    }

    /// Which passes the kept values need.
    #[must_use]
    pub fn needed(&self) -> Vec<bool> {
        let mut needed = vec![false; self.passes.len()];
        let mut open: Vec<Handle> = self.kept.clone();
        while let Some(handle) = open.pop() {
            let Some(pass) = self.values[handle.at()].pass() else {
                continue;
            };
            if !std::mem::replace(&mut needed[pass], true) {
                open.extend(&self.passes[pass].reads);
            }
        }
        needed
    }

    /// The kernels that a pass calls, by number.
    pub(crate) fn calls(pass: &Pass) -> impl Iterator<Item = &Call> {
        let (first, second) = match &pass.work {
            Work::Clear(_) | Work::Levels(_) => (None, None),
            Work::Compute(call) => (Some(call), None),
            Work::FullScreen { vertex, fragment } => (Some(vertex), Some(fragment)),
            Work::Draw {
                vertex, fragment, ..
            } => (Some(vertex), fragment.as_ref()),
        };
        first.into_iter().chain(second)
    }

    fn push(&mut self, value: Value) -> Handle {
        let index = self.values.len() as u32;
        self.values.push(value);
        Handle {
            graph: self.number,
            index,
        }
    }

    /// Whether nobody has changed a value in its place.
    fn is_current(&self, handle: Handle) -> bool {
        self.values[handle.at()].changed_by.is_none()
    }

    /// A value that the next pass makes.
    fn made(&mut self, label: Cow<'static, str>, shape: Shape) -> Handle {
        let pass = self.passes.len();
        self.push(Value {
            label,
            shape,
            origin: Origin::Made { pass },
            changed_by: None,
        })
    }
}
