//! Inputs for a kernel, made from its description: ordinary ones, ones at the edges of what is
//! meant, and absurd but finite ones. The same seed makes the same inputs.
//!
//! What a number is like follows from, in this order:
//! 1. a range in its field's documentation, `[0, 1]` or `from 0 to 1`;
//! 2. its name, see [`values::by_name`];
//! 3. its type: floats lie in [-1, 1]; a `u32` of a uniform in 0..=8 (counts and radii), elsewhere
//!    anywhere, 0, 1, -1 and the extremes among them.
//!
//! Integers keep to their ranges in every class: they are counts and indices, and what lies
//! beyond is a mistake of the caller, not an input.

pub mod values;

use std::fmt;

use fastrand::Rng;
use hankel_dsl::native::describe::{
    Kernel, Layout, Output, Range, Role, Stage, TexelFormat, TextureKind,
};
use hankel_dsl::native::{Address, Filter, Sampler};
use serde::{Deserialize, Serialize};

use crate::device::TextureShape;
use crate::device::slots::{self, Slot, Use};
use crate::flat;
use values::Values;

/// What inputs are like.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Class {
    /// As in use.
    Ordinary,
    /// At the ends of the ranges: zeros, ones, neighbours of them, surfaces in one place.
    Edge,
    /// Finite, but absurd: zeros of both signs, subnormal numbers, the largest ones, random bits.
    Hostile,
}

impl Class {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Ordinary, Self::Edge, Self::Hostile];
}

impl fmt::Display for Class {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Ordinary => "ordinary",
            Self::Edge => "edge",
            Self::Hostile => "hostile",
        })
    }
}

/// An argument of a case.
#[derive(Clone, Debug, PartialEq)]
pub enum Input {
    /// Contents of a buffer; zeros for one that is written.
    Bytes(Vec<u8>),
    /// Contents of a texture; zeros for one that is written.
    Texture {
        /// Its shape.
        shape: TextureShape,
        /// Its texels.
        bytes: Vec<u8>,
    },
    /// A sampler.
    Sampler(Sampler),
}

/// The arguments of one run.
#[derive(Clone, Debug, PartialEq)]
pub struct Case {
    /// What they are like.
    pub class: Class,
    /// One for each of [`slots::slots`].
    pub args: Vec<Input>,
    /// Invocations that write something.
    pub invocations: usize,
}

/// The seed unless the user gives one.
pub const SEED: u64 = 0x4861_6e6b_656c;

/// Elements of a one-dimensional run: no multiple of any workgroup's size.
const ELEMENTS: usize = 4099;
/// Vertices or fragments of a run.
const STAGE_ELEMENTS: usize = 1009;
/// Texels of a two-dimensional run.
const FLAT: [u32; 3] = [61, 37, 1];
/// Texels of a three-dimensional run.
const VOLUME: [u32; 3] = [13, 11, 7];
/// Elements of a buffer that is read anywhere, by kernels that do not run over rows.
const TABLE: usize = 7;
/// Counters.
const COUNTERS: usize = 256;

/// Whether a kernel's stage may flush subnormal numbers: Vulkan lets every stage do so, and
/// lavapipe does where it draws.
#[must_use]
pub fn flushes(kernel: &Kernel) -> bool {
    matches!(kernel.stage, Stage::Vertex | Stage::Fragment)
}

/// The magnitudes of a kernel's hostile inputs. All there are, except where the result would
/// depend on what nobody promises:
/// - a stage that flushes subnormal numbers gets none so small that a product of a few is one;
/// - a kernel that writes a normalised format gets none so large that it overflows on the way:
///   what becomes of a NaN there is not defined;
/// - a kernel with a sampler gets none that filtering could overflow with.
fn magnitudes(kernel: &Kernel) -> (f64, f64) {
    let least = if flushes(kernel) { 1e-5 } else { 0.0 };
    let normalised = kernel.outputs.iter().any(|o| {
        matches!(
            o,
            Output::Texture {
                format: TexelFormat::Rgba16Unorm | TexelFormat::Rgba8Unorm,
                ..
            }
        )
    });
    let samples = kernel
        .params
        .iter()
        .any(|p| matches!(p.role, Role::Sampler { .. }));
    let most = match (normalised, samples) {
        (true, _) => 1e8,
        (false, true) => 1e12,
        (false, false) => f64::MAX,
    };
    (least, most)
}

/// The cases of a kernel, several for uniforms to vary: they hold one value for a whole run.
#[must_use]
pub fn cases(kernel: &Kernel, seed: u64) -> Vec<Case> {
    let has_uniform = kernel
        .params
        .iter()
        .any(|p| matches!(p.role, Role::Uniform { .. }));
    let runs = if has_uniform { 4 } else { 1 };
    let mut all = Vec::new();
    for (i, class) in Class::ALL.into_iter().enumerate() {
        for run in 0..runs {
            // The name goes in, so that kernels do not share inputs by accident.
            let name = kernel.function.bytes().fold(seed, |h, b| {
                (h ^ u64::from(b)).wrapping_mul(0x0100_0000_01b3)
            });
            let rng = Rng::with_seed(name ^ ((i as u64) << 32) ^ run);
            all.push(case(kernel, class, rng));
        }
    }
    all
}

fn case(kernel: &Kernel, class: Class, rng: Rng) -> Case {
    let mut values = Values {
        rng,
        class,
        magnitudes: magnitudes(kernel),
    };
    let slots = slots::slots(kernel);
    let size = texels(kernel);
    let elements = match (&kernel.stage, size) {
        (Stage::Compute { .. }, Some(size)) => size.iter().map(|&n| n as usize).product(),
        (Stage::Compute { .. }, None) => ELEMENTS,
        (Stage::Vertex | Stage::Fragment, _) => STAGE_ELEMENTS,
    };
    // What is read beside texels, vertices or fragments is a short table that each of them may
    // walk through; over rows it has a row for each. What is written has room for them all.
    let over_texels = matches!(kernel.outputs.first(), Some(Output::Texture { .. }));
    let writes = slots
        .iter()
        .any(|s| matches!(s.role, Use::StorageMut { .. }));
    let table = match kernel.stage {
        Stage::Compute { .. } if writes || !over_texels => ELEMENTS.max(elements),
        _ => TABLE,
    };
    let size = size.unwrap_or(FLAT);
    // A volume that is written beside a flat range.
    let volume = match kernel.stage {
        Stage::Compute { dimensions: 3, .. } => size,
        _ => VOLUME,
    };
    let mut args: Vec<Input> = slots
        .iter()
        .map(|s| input(s, &mut values, elements, table, [size, volume]))
        .collect();
    if let Stage::Compute {
        range: Range::Uniform { param, offset },
        dimensions,
        ..
    } = &kernel.stage
    {
        let said = slots.iter().position(|s| s.name == *param);
        if let Some(Input::Bytes(bytes)) = said.map(|i| &mut args[i]) {
            let words = bytes.get_mut(*offset as usize..).unwrap_or_default();
            let words = words.chunks_exact_mut(4).take(*dimensions as usize);
            for (word, n) in words.zip(size_of_range(*dimensions)) {
                word.copy_from_slice(&n.to_le_bytes());
            }
        }
    }
    let invocations = elements;
    Case {
        class,
        args,
        invocations,
    }
}

/// How far a kernel of so many dimensions runs where nothing fixes it.
const fn size_of_range(dimensions: u32) -> [u32; 3] {
    match dimensions {
        1 => [ELEMENTS as u32, 1, 1],
        2 => FLAT,
        _ => VOLUME,
    }
}

/// How far the kernel runs; none for a map over the elements of a buffer.
fn texels(kernel: &Kernel) -> Option<[u32; 3]> {
    let Stage::Compute {
        range, dimensions, ..
    } = &kernel.stage
    else {
        return None;
    };
    match (range, kernel.outputs.first()) {
        (Range::Fixed { size }, _) => Some(*size),
        (Range::Uniform { .. }, _) | (Range::Outputs, Some(Output::Texture { .. })) => {
            Some(size_of_range(*dimensions))
        }
        (Range::Outputs | Range::Elements { .. }, _) => None,
    }
}

fn input(
    slot: &Slot<'_>,
    values: &mut Values,
    elements: usize,
    table: usize,
    [size, volume]: [[u32; 3]; 2],
) -> Input {
    let zeros =
        |count: usize| Input::Bytes(vec![0; count * slot.role.element_bytes().unwrap_or(0)]);
    match slot.role {
        Use::Uniform(layout) => Input::Bytes(filled(values, &slot.name, layout, 1, true)),
        Use::Element(layout) | Use::ElementMut(layout) => {
            Input::Bytes(filled(values, &slot.name, layout, elements, false))
        }
        Use::Storage(layout) | Use::StorageMut { layout, .. } => {
            Input::Bytes(filled(values, &slot.name, layout, table, false))
        }
        Use::Attribute(_, ty) | Use::Varying(_, ty) => {
            let leaves = flat::type_leaves(ty);
            let stride = slots::type_bytes(ty);
            Input::Bytes(values.elements(&slot.name, &leaves, stride, elements, false))
        }
        Use::Atomic { .. } => zeros(COUNTERS),
        Use::Interface(_) => zeros(elements),
        Use::Output(_) => zeros(elements),
        Use::StorageTexture { format, dimensions } => {
            let shape = if dimensions == 3 {
                TextureShape::d3(volume, format)
            } else {
                TextureShape::d2(size[0], size[1], format)
            };
            Input::Texture {
                shape,
                bytes: vec![0; shape.bytes()],
            }
        }
        Use::Texture(kind) => {
            let shape = match kind {
                TextureKind::Texture2d => {
                    TextureShape::d2(size[0], size[1], TexelFormat::Rgba32Float)
                }
                TextureKind::Texture2dMultisampled => {
                    TextureShape::d2(size[0], size[1], TexelFormat::R32Float).multisampled(4)
                }
                TextureKind::Texture3d => TextureShape::d3(VOLUME, TexelFormat::Rgba32Float),
            };
            let bytes = values.texels(&slot.name, &shape);
            Input::Texture { shape, bytes }
        }
        Use::Sampler => Input::Sampler(Sampler {
            filter: Filter::Linear,
            address: match values.class {
                Class::Edge => Address::Repeat,
                Class::Ordinary | Class::Hostile => Address::ClampToEdge,
            },
        }),
    }
}

fn filled(
    values: &mut Values,
    name: &str,
    layout: &Layout,
    count: usize,
    is_uniform: bool,
) -> Vec<u8> {
    values.elements(
        name,
        &flat::leaves(layout),
        layout.size as usize,
        count,
        is_uniform,
    )
}

/// The numbers that one invocation reads as its own, and the uniforms, for a message: name and
/// value.
#[must_use]
pub fn of_invocation(kernel: &Kernel, case: &Case, invocation: usize) -> Vec<(String, String)> {
    let mut all = Vec::new();
    for (slot, arg) in slots::slots(kernel).iter().zip(&case.args) {
        let (leaves, stride, index) = match slot.role {
            Use::Uniform(l) => (flat::leaves(l), l.size as usize, 0),
            Use::Element(l) | Use::ElementMut(l) => (flat::leaves(l), l.size as usize, invocation),
            Use::Attribute(_, ty) | Use::Varying(_, ty) => {
                (flat::type_leaves(ty), slots::type_bytes(ty), invocation)
            }
            _ => continue,
        };
        let Input::Bytes(bytes) = arg else { continue };
        let Some(element) = bytes.get(index * stride..(index + 1) * stride) else {
            continue;
        };
        for leaf in leaves {
            let value = flat::Number::read(leaf.scalar, &element[leaf.offset..]);
            all.push((flat::join(&slot.name, &leaf.path), value.to_string()));
        }
    }
    all
}

/// Whether a case's arguments hold only finite numbers.
#[must_use]
pub fn is_finite(kernel: &Kernel, case: &Case) -> bool {
    slots::slots(kernel)
        .iter()
        .zip(&case.args)
        .all(|(slot, arg)| {
            let (Input::Bytes(bytes), Some(stride)) = (arg, slot.role.element_bytes()) else {
                return true;
            };
            let leaves = match slot.role {
                Use::Uniform(l) | Use::Element(l) | Use::Storage(l) => flat::leaves(l),
                Use::Attribute(_, ty) | Use::Varying(_, ty) => flat::type_leaves(ty),
                _ => return true,
            };
            bytes.chunks_exact(stride).all(|e| {
                leaves.iter().all(|l| {
                    flat::Number::read(l.scalar, &e[l.offset..])
                        .to_f64()
                        .is_finite()
                })
            })
        })
}
