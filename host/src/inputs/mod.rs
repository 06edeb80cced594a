//! Inputs for a kernel, made from its description: ordinary ones, ones at the edges of what is
//! meant, and absurd but finite ones. The same seed makes the same inputs.
//!
//! What a number is like follows from the attributes of its field or parameter, see
//! [`describe::Inputs`](hankel_dsl::native::describe::Inputs), and from nothing else. Integers keep
//! to their ranges in every class: they are counts and indices, and what lies beyond is a mistake of
//! the caller, not an input.
//!
//! A kernel's author may give inputs with a function of their own ([`of_entry`]).

pub mod values;

use std::collections::BTreeMap;
use std::fmt;

use fastrand::Rng;
use hankel_dsl::native::channel::Stored;
use hankel_dsl::native::describe::{
    Channels, ConstantValue, Domain, Inputs, Kernel, Layout, Length, Output, Param, Range, Role,
    SamplerKind, Scalar, Stage, TexelFormat, TextureKind,
};
use hankel_dsl::native::inputs::{Given, Request, Value};
use hankel_dsl::native::{Address, Compare, Filter, Sampler, fragment};
use serde::{Deserialize, Serialize};

use crate::crates::KernelEntry;
use crate::device::slots::{self, Slot, Use};
use crate::device::{Format, TextureShape};
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
    /// What the author calls them, if the author made them.
    pub what: Option<String>,
    /// One for each of [`slots::slots`].
    pub args: Vec<Input>,
    /// Invocations that write something.
    pub invocations: usize,
}

impl Case {
    /// The inputs in words: their class, and what their author calls them.
    #[must_use]
    pub fn called(&self) -> String {
        match &self.what {
            Some(what) => format!("{} inputs ({what})", self.class),
            None => format!("{} inputs", self.class),
        }
    }
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
/// Texels along each side of a cube.
const FACE: u32 = 17;
/// Layers of an array, or its cubes.
const LAYERS: u32 = 3;
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
/// - a kernel that writes a normalised format, or draws into one as the fragment form of an image pass may,
///   gets none so large that it overflows on the way: what becomes of a NaN there is not defined;
/// - a kernel with a sampler gets none that filtering could overflow with.
fn magnitudes(kernel: &Kernel) -> (f64, f64) {
    let least = if flushes(kernel) { 1e-5 } else { 0.0 };
    let normalised = kernel.outputs.iter().any(|o| match o {
        Output::Texture { format, .. } => {
            matches!(format.stored(), Stored::Unorm { .. } | Stored::Snorm { .. })
        }
        _ => false,
    });
    let samples = kernel
        .params
        .iter()
        .any(|p| matches!(p.role, Role::Sampler { .. }));
    let most = match (normalised || kernel.is_fragment_form(), samples) {
        (true, _) => 1e8,
        (false, true) => 1e12,
        (false, false) => f64::MAX,
    };
    (least, most)
}

/// Why there are no inputs for a kernel.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum InputError {
    /// An attribute refers to a parameter that the kernel does not have.
    #[error(
        "#[count_of({param})] or #[index_of({param})] or #[length({param})]: the kernel has no buffer or texture `{param}`"
    )]
    NoParameter {
        /// Its name.
        param: String,
    },
    /// Lengths that depend on each other in a circle, or on what comes to nothing.
    #[error("the length of `{param}`: {problem}")]
    Length {
        /// The buffer.
        param: String,
        /// What is wrong.
        problem: String,
    },
    /// The author's function failed, or gave what does not fit.
    #[error("the kernel's own inputs: {problem}")]
    Own {
        /// What is wrong.
        problem: String,
    },
}

/// All combinations of values that a kernel's specialisation constants are run with: those of
/// `#[values]` or the ends of a `#[range]`, and the default; one empty combination without constants.
#[must_use]
pub fn constants(kernel: &Kernel) -> Vec<Vec<u32>> {
    let mut all: Vec<Vec<u32>> = vec![Vec::new()];
    for param in &kernel.params {
        let Role::Constant {
            default, scalar, ..
        } = param.role
        else {
            continue;
        };
        let word = |x: f64| match scalar {
            Scalar::Bool => u32::from(x != 0.0),
            Scalar::I32 => (x as i32).cast_unsigned(),
            Scalar::F32 => (x as f32).to_bits(),
            _ => x as u32,
        };
        let mut values = vec![default];
        match &param.inputs.domain {
            Some(Domain::Values { values: listed }) => {
                values.extend(listed.iter().map(|v| word(*v)));
            }
            Some(Domain::Range { least, most } | Domain::Magnitude { least, most }) => {
                values.extend([word(*least), word(*most)]);
            }
            _ if scalar == Scalar::Bool => values.extend([0, 1]),
            _ => {}
        }
        // The default comes first.
        values[1..].sort_unstable();
        let mut seen = Vec::new();
        values.retain(|v| {
            !seen.contains(v) && {
                seen.push(*v);
                true
            }
        });
        all = all
            .iter()
            .flat_map(|before| values.iter().map(|v| [&before[..], &[*v]].concat()))
            .collect();
    }
    all
}

/// Makes other values the defaults of a kernel's specialisation constants, in their order; gives
/// the constants' names with the values.
pub fn set_constants(kernel: &mut Kernel, values: &[u32]) -> BTreeMap<String, ConstantValue> {
    let mut values = values.iter();
    let mut set = BTreeMap::new();
    for param in &mut kernel.params {
        if let Role::Constant {
            default, scalar, ..
        } = &mut param.role
            && let Some(value) = values.next()
        {
            *default = *value;
            set.insert(param.name.clone(), ConstantValue::of_word(*scalar, *value));
        }
    }
    set
}

/// The cases of an entry point, for the values that its specialisation constants have by default:
/// from the author's function, if there is one, else from the attributes.
///
/// The edge and hostile ones of an author's function have its lengths, sizes and integers, which belong
/// together; their floats are edge and hostile ones by the attributes.
/// Where nothing belongs together, in a map over rows of floats, they come from the attributes alone and are
/// as many as those say. So do those of a kernel that reads textures: these have sizes of their own, and
/// what a map of one size holds at edge coordinates is compared with depths that lie on it to the last bit.
///
/// # Errors
/// See [`InputError`].
pub fn of_entry(entry: &KernelEntry, seed: u64) -> Result<Vec<Case>, InputError> {
    let kernel = &entry.kernel;
    let own = |problem: String| InputError::Own { problem };
    let constants = kernel.params.iter().filter_map(|p| match p.role {
        Role::Constant { default, .. } => Some((p.name.clone(), default)),
        _ => None,
    });
    let multisampled = kernel.params.iter().filter_map(|p| match p.role {
        Role::Texture { texture, .. } if texture.is_multisampled() => Some(p.name.clone()),
        _ => None,
    });
    let request = Request {
        seed: mixed(kernel, seed),
        constants: constants.collect(),
        multisampled: multisampled.collect(),
    };
    let Some(given) = entry.own_inputs(&request).map_err(own)? else {
        return cases(kernel, seed);
    };
    if given.is_empty() {
        return Err(own("the function gave none".into()));
    }
    let mut all = Vec::new();
    for (i, given) in given.iter().enumerate() {
        let rng = Rng::with_seed(mixed(kernel, seed) ^ ((i as u64) << 40));
        all.push(case(kernel, Class::Ordinary, rng, Some(given))?);
    }
    if !is_tied(kernel) {
        let made = cases(kernel, seed)?;
        all.extend(made.into_iter().filter(|c| c.class != Class::Ordinary));
        return Ok(all);
    }
    for (i, class) in Class::ALL.into_iter().enumerate() {
        if class == Class::Ordinary {
            continue;
        }
        for (run, given) in (0..runs(kernel)).zip(given.iter().cycle()) {
            let rng = Rng::with_seed(mixed(kernel, seed) ^ ((i as u64) << 32) ^ run);
            all.push(case(kernel, class, rng, Some(given))?);
        }
    }
    Ok(all)
}

/// Whether a kernel has integers, or buffers and images with a length of their own, and reads no texture.
fn is_tied(kernel: &Kernel) -> bool {
    let slots = slots::slots(kernel);
    let has_integers = |layout: &Layout| {
        let leaves = flat::leaves(layout);
        let mut scalars = leaves.iter().map(|leaf| leaf.scalar);
        scalars.any(|scalar| !matches!(scalar, Scalar::F32 | Scalar::F64))
    };
    let tied = slots.iter().any(|slot| match slot.role {
        Use::Storage(_)
        | Use::StorageMut { .. }
        | Use::StorageTexture { .. }
        | Use::Atomic { .. } => true,
        Use::Uniform(layout) | Use::Element(layout) | Use::ElementMut(layout) => {
            has_integers(layout)
        }
        _ => false,
    });
    tied && !slots
        .iter()
        .any(|slot| matches!(slot.role, Use::Texture(_)))
}

/// How many cases a class has.
fn runs(kernel: &Kernel) -> u64 {
    let has_uniform = kernel
        .params
        .iter()
        .any(|p| matches!(p.role, Role::Uniform { .. }));
    if has_uniform { 4 } else { 1 }
}

/// The name goes in, so that kernels do not share inputs by accident.
fn mixed(kernel: &Kernel, seed: u64) -> u64 {
    kernel.function.bytes().fold(seed, |h, b| {
        (h ^ u64::from(b)).wrapping_mul(0x0100_0000_01b3)
    })
}

/// The cases of a kernel from its attributes alone, several for uniforms to vary: they hold one
/// value for a whole run.
///
/// # Errors
/// See [`InputError`].
pub fn cases(kernel: &Kernel, seed: u64) -> Result<Vec<Case>, InputError> {
    let mut all = Vec::new();
    for (i, class) in Class::ALL.into_iter().enumerate() {
        for run in 0..runs(kernel) {
            let rng = Rng::with_seed(mixed(kernel, seed) ^ ((i as u64) << 32) ^ run);
            all.push(case(kernel, class, rng, None)?);
        }
    }
    Ok(all)
}

/// How much of what a case has.
struct Extents {
    /// Invocations.
    elements: usize,
    /// Elements of a buffer that is read anywhere and says nothing of its length.
    table: usize,
    /// Texels of what is written, and of textures that say nothing of their size.
    size: [u32; 3],
    /// Texels of a volume that is written, also beside a flat range.
    volume: [u32; 3],
}

fn case(
    kernel: &Kernel,
    class: Class,
    rng: Rng,
    given: Option<&Given>,
) -> Result<Case, InputError> {
    let mut values = Values {
        rng,
        class,
        magnitudes: magnitudes(kernel),
        lengths: BTreeMap::new(),
    };
    let slots = slots::slots(kernel);
    let mut given = Own::new(&slots, given)?;
    if kernel.is_fragment_form() {
        given.cover_fragments();
    }
    let size = texels(kernel, &given, &mut values);
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
    let mut extents = Extents {
        elements,
        table: match kernel.stage {
            _ if writes => ELEMENTS.max(elements),
            Stage::Compute { .. } if !over_texels => ELEMENTS.max(elements),
            _ => TABLE,
        },
        size: size.unwrap_or(match kernel.is_fragment_form() {
            true => [fragment::COLUMNS, FLAT[1], 1],
            false => FLAT,
        }),
        volume: match (&kernel.stage, size) {
            (Stage::Compute { dimensions: 3, .. }, Some(size)) => size,
            _ => VOLUME,
        },
    };
    values.lengths = lengths(kernel, &slots, &given, &mut extents, &mut values.rng)?;
    let mut args: Vec<Input> = slots
        .iter()
        .map(|slot| match given.get(&slot.name) {
            Some(own) if class == Class::Ordinary => Ok(own.clone()),
            Some(own) => like(kernel, slot, own, &mut values),
            None => input(kernel, slot, &mut values, &extents),
        })
        .collect::<Result<_, _>>()?;
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
            for (word, n) in words.zip(extents.size_of_range(*dimensions)) {
                word.copy_from_slice(&n.to_le_bytes());
            }
        }
    }
    let what = given.what.map(|what| match class {
        Class::Ordinary => what,
        Class::Edge | Class::Hostile => format!("shaped like {what}"),
    });
    Ok(Case {
        class,
        what,
        args,
        invocations: extents.elements,
    })
}

impl Extents {
    /// The size of a range that a uniform says.
    const fn size_of_range(&self, dimensions: u32) -> [u32; 3] {
        match dimensions {
            1 => [self.elements as u32, 1, 1],
            _ => self.size,
        }
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
fn texels(kernel: &Kernel, given: &Own, values: &mut Values) -> Option<[u32; 3]> {
    let Stage::Compute {
        range, dimensions, ..
    } = &kernel.stage
    else {
        return None;
    };
    match (range, kernel.outputs.first()) {
        (Range::Fixed { size }, _) => Some(*size),
        (Range::Uniform { param, offset }, _) => {
            let Some(Input::Bytes(bytes)) = given.get(param) else {
                return Some(said_size(kernel, param, *offset, *dimensions, values));
            };
            let mut size = [1; 3];
            let words = bytes.get(*offset as usize..).unwrap_or_default();
            let words = words.as_chunks().0.iter().take(*dimensions as usize);
            for (n, word) in size.iter_mut().zip(words) {
                *n = u32::from_le_bytes(*word);
            }
            Some(size)
        }
        (Range::Outputs, Some(Output::Texture { .. })) => Some(size_of_range(*dimensions)),
        (Range::Outputs | Range::Elements { .. }, _) => None,
    }
}

/// The size of a range that a uniform says, as the attributes of its numbers allow: the usual one where
/// they do, and of edge inputs now and then the least.
fn said_size(
    kernel: &Kernel,
    param: &str,
    offset: u32,
    dimensions: u32,
    values: &mut Values,
) -> [u32; 3] {
    let mut size = size_of_range(dimensions);
    let uniform = kernel.params.iter().find_map(|p| match &p.role {
        Role::Uniform { layout, .. } if p.name == param => Some((layout, &p.inputs)),
        _ => None,
    });
    let Some((layout, outer)) = uniform else {
        return size;
    };
    let leaves = flat::leaves(layout);
    for (i, n) in size.iter_mut().enumerate().take(dimensions as usize) {
        let at = offset as usize + 4 * i;
        let domain = leaves
            .iter()
            .find(|leaf| leaf.offset == at)
            .and_then(|leaf| leaf.inputs.within(outer).domain);
        match domain {
            Some(Domain::Values { values: said }) => {
                // Of none is no range.
                let said: Vec<u32> = said.iter().map(|n| *n as u32).filter(|n| *n > 0).collect();
                if !said.is_empty() {
                    *n = said[values.rng.usize(..said.len())];
                }
            }
            Some(Domain::Range { least, most } | Domain::Magnitude { least, most }) => {
                let least = (least.ceil() as u32).max(1);
                let most = (most.floor() as u32).max(least);
                *n = if values.class == Class::Edge && values.rng.bool() {
                    least
                } else {
                    (*n).clamp(least, most)
                };
            }
            _ => {}
        }
    }
    size
}

/// The arguments that the author's function gave, by the names of parameters.
#[derive(Default)]
struct Own {
    what: Option<String>,
    args: BTreeMap<String, Input>,
}

impl Own {
    fn new(slots: &[Slot<'_>], given: Option<&Given>) -> Result<Self, InputError> {
        let Some(given) = given else {
            return Ok(Self::default());
        };
        let mut args = BTreeMap::new();
        for (name, value) in &given.args {
            let bad = |problem: String| InputError::Own {
                problem: format!("`{name}` of \"{}\": {problem}", given.what),
            };
            let slot = slots
                .iter()
                .find(|s| s.name == *name && is_given(&s.role))
                .ok_or_else(|| bad("the kernel reads no such parameter".into()))?;
            let arg = own_arg(slot, value).map_err(bad)?;
            if args.insert(name.clone(), arg).is_some() {
                return Err(bad("it is given twice".into()));
            }
        }
        Ok(Self {
            what: Some(given.what.clone()),
            args,
        })
    }

    fn get(&self, name: &str) -> Option<&Input> {
        self.args.get(name)
    }

    /// Makes textures as wide as the target that fragments are laid out in, by repeating their columns: the
    /// fragment form of an image pass reads the texel of its pixel, as the compute form does of its index.
    fn cover_fragments(&mut self) {
        for input in self.args.values_mut() {
            let Input::Texture { shape, bytes } = input else {
                continue;
            };
            let [width, height, _] = shape.size;
            let is_flat = shape.dimensions == 2 && (shape.levels, shape.layers) == (1, 1);
            if !is_flat || width >= fragment::COLUMNS {
                continue;
            }
            let texel = shape.samples as usize * shape.format.texel().bytes();
            let row = width as usize * texel;
            let wide = fragment::COLUMNS as usize * texel;
            let rows = bytes.chunks_exact(row).take(height as usize);
            *bytes = rows
                .flat_map(|row| row.iter().copied().cycle().take(wide))
                .collect();
            shape.size[0] = fragment::COLUMNS;
        }
    }
}

/// What the author gives, if it fits the parameter.
fn own_arg(slot: &Slot<'_>, value: &Value) -> Result<Input, String> {
    match (value, slot.role) {
        (Value::Bytes(bytes), role) => {
            let Some(element) = role.element_bytes() else {
                return Err("it takes no bytes".into());
            };
            let whole = if matches!(role, Use::Uniform(_)) {
                bytes.len() == element
            } else {
                !bytes.is_empty() && bytes.len().is_multiple_of(element.max(1))
            };
            if whole {
                Ok(Input::Bytes(bytes.clone()))
            } else {
                Err(format!(
                    "{} bytes are no whole number of elements of {element} bytes",
                    bytes.len()
                ))
            }
        }
        (
            Value::Texture {
                size,
                levels,
                layers,
                samples,
                format,
                bytes,
            },
            Use::Texture(kind),
        ) => {
            let shape = TextureShape {
                dimensions: kind.dimensions(),
                size: *size,
                levels: *levels,
                layers: *layers,
                samples: *samples,
                format: if kind.is_depth() {
                    Format::Depth32
                } else {
                    Format::Texel(*format)
                },
            };
            if kind.is_depth() && *format != TexelFormat::R32Float {
                return Err(format!("depths are r32float, not {}", format.name()));
            }
            if format.numbers() != kind.channels() {
                return Err(format!("its format is {}", format.name()));
            }
            if kind.is_multisampled() != (*samples > 1) {
                return Err(format!("it has {samples} samples in each texel"));
            }
            if let Some(problem) = kind.misfit(*layers) {
                return Err(problem);
            }
            texels_of_shape(shape, bytes)
        }
        (
            Value::Texture {
                size,
                levels: 1,
                layers,
                samples: 1,
                format,
                bytes,
            },
            Use::StorageTexture {
                format: wanted,
                dimensions,
                array,
                ..
            },
        ) => {
            let shape = TextureShape {
                dimensions,
                layers: *layers,
                ..TextureShape::d3(*size, *format)
            };
            if *layers != 1 && !array {
                return Err(format!("it has {layers} layers; the kernel takes one"));
            }
            if *format != wanted {
                return Err(format!(
                    "its format is {}, not {}",
                    format.name(),
                    wanted.name()
                ));
            }
            if size[dimensions as usize..].iter().any(|n| *n != 1) {
                return Err(format!("it has more than {dimensions} dimensions"));
            }
            texels_of_shape(shape, bytes)
        }
        (Value::Sampler(sampler), Use::Sampler(kind)) if kind.fits(sampler) => {
            Ok(Input::Sampler(*sampler))
        }
        _ => Err("it is of another kind".into()),
    }
}

/// A texture, if the author's bytes fill it.
fn texels_of_shape(shape: TextureShape, bytes: &[u8]) -> Result<Input, String> {
    if shape.bytes() == bytes.len() && !bytes.is_empty() {
        Ok(Input::Texture {
            shape,
            bytes: bytes.to_vec(),
        })
    } else {
        Err(format!(
            "{} bytes, but its size makes {}",
            bytes.len(),
            shape.bytes()
        ))
    }
}

fn about<'a>(kernel: &'a Kernel, name: &str) -> Option<&'a Param> {
    kernel.params.iter().find(|p| p.name == name)
}

/// Whether what it holds before the run matters.
const fn is_input(role: &Use<'_>) -> bool {
    match role {
        Use::Atomic { .. } | Use::Output(_) | Use::Interface(_) => false,
        Use::StorageTexture { access, .. } => access.reads(),
        _ => true,
    }
}

/// Whether it has a number of elements or texels that other attributes may name.
const fn has_length(role: &Use<'_>) -> bool {
    is_input(role) || matches!(role, Use::Atomic { .. })
}

/// Whether an author may give it: what is written to as well, if its size is not the range's.
const fn is_given(role: &Use<'_>) -> bool {
    is_input(role) || matches!(role, Use::StorageTexture { .. })
}

/// Whether there is one element of it for each invocation.
fn is_own(kernel: &Kernel, slot: &Slot<'_>) -> bool {
    match (slot.role, &kernel.stage) {
        (Use::Element(_) | Use::ElementMut(_) | Use::Attribute(..) | Use::Varying(..), _) => true,
        (
            _,
            Stage::Compute {
                range: Range::Elements { param },
                ..
            },
        ) => slot.name == *param,
        _ => false,
    }
}

/// How many elements or texels each buffer and texture has; what is read element by element decides
/// how many invocations run.
fn lengths(
    kernel: &Kernel,
    slots: &[Slot<'_>],
    given: &Own,
    extents: &mut Extents,
    rng: &mut Rng,
) -> Result<BTreeMap<String, usize>, InputError> {
    let mut known: BTreeMap<String, usize> = BTreeMap::new();
    let mut later: Vec<(&str, bool, &Length)> = Vec::new();
    let mut elements: Option<(String, usize)> = None;
    for slot in slots.iter().filter(|s| has_length(&s.role)) {
        let name = slot.name.as_str();
        let own = is_own(kernel, slot);
        let count = match given.get(name) {
            Some(Input::Bytes(bytes)) => {
                bytes.len() / slot.role.element_bytes().unwrap_or(1).max(1)
            }
            Some(Input::Texture { shape, .. }) => shape.size.iter().map(|&n| n as usize).product(),
            Some(Input::Sampler(_)) => continue,
            None => match about(kernel, name).and_then(|p| p.inputs.length.as_ref()) {
                Some(Length::Between { least, most }) => rng.u32(*least..=*most) as usize,
                Some(of @ Length::Of { .. }) => {
                    later.push((name, own, of));
                    continue;
                }
                None => continue,
            },
        };
        known.insert(name.into(), count);
        if own {
            decide(&mut elements, name, count)?;
        }
    }
    // What depends on another waits for it; what says nothing is known once the elements are.
    let mut settled = false;
    loop {
        let before = later.len();
        let mut waiting = Vec::new();
        for (name, own, length) in later {
            let Length::Of { param, times, plus } = length else {
                continue;
            };
            if !slots.iter().any(|s| s.name == *param) {
                return Err(InputError::NoParameter {
                    param: param.clone(),
                });
            }
            match known.get(param) {
                None => waiting.push((name, own, length)),
                Some(&n) => {
                    let count = n as i64 * i64::from(*times) + i64::from(*plus);
                    let count = usize::try_from(count).map_err(|_| InputError::Length {
                        param: name.into(),
                        problem: format!("it comes to {count}, from {n} of `{param}`"),
                    })?;
                    known.insert(name.into(), count);
                    if own {
                        decide(&mut elements, name, count)?;
                    }
                }
            }
        }
        later = waiting;
        if later.is_empty() && settled {
            break;
        }
        if later.len() == before || later.is_empty() {
            if settled {
                let circle: Vec<&str> = later.iter().map(|l| l.0).collect();
                return Err(InputError::Length {
                    param: circle.join("`, `"),
                    problem: "lengths refer to each other in a circle".into(),
                });
            }
            settled = true;
            for slot in slots.iter().filter(|s| has_length(&s.role)) {
                if known.contains_key(&slot.name) || later.iter().any(|l| l.0 == slot.name) {
                    continue;
                }
                let count = match slot.role {
                    _ if is_own(kernel, slot) => {
                        elements.as_ref().map_or(extents.elements, |e| e.1)
                    }
                    Use::Storage(_) | Use::StorageMut { .. } => extents.table,
                    Use::Atomic { .. } => COUNTERS,
                    Use::Texture(kind) => texels_of(kernel, &slot.name, kind, extents.size)
                        .iter()
                        .map(|&n| n as usize)
                        .product(),
                    _ => continue,
                };
                known.insert(slot.name.clone(), count);
            }
        }
    }
    if let Some((_, count)) = elements {
        extents.elements = count;
    }
    for slot in slots.iter().filter(|s| is_own(kernel, s)) {
        known.insert(slot.name.clone(), extents.elements);
    }
    if extents.elements == 0 {
        return Err(InputError::Length {
            param: "output".into(),
            problem: "there would be no invocation".into(),
        });
    }
    Ok(known)
}

/// Takes down how many elements are read one by one, which all have alike.
fn decide(
    elements: &mut Option<(String, usize)>,
    name: &str,
    count: usize,
) -> Result<(), InputError> {
    match elements {
        Some((other, n)) if *n != count => Err(InputError::Length {
            param: name.into(),
            problem: format!("{count} elements, but `{other}`, read likewise, has {n}"),
        }),
        _ => {
            *elements = Some((name.into(), count));
            Ok(())
        }
    }
}

/// The size of a texture that is read.
fn texels_of(kernel: &Kernel, name: &str, kind: TextureKind, otherwise: [u32; 3]) -> [u32; 3] {
    match about(kernel, name).and_then(|p| p.inputs.size) {
        Some(size) => size,
        None if kind.dimensions() == 3 => VOLUME,
        None if kind.dimensions() == 1 => [otherwise[0], 1, 1],
        None if kind.is_cube() => [FACE, FACE, 1],
        None => [otherwise[0], otherwise[1], 1],
    }
}

/// What the author gave, with floats of another class: lengths, sizes and integers are kept.
fn like(
    kernel: &Kernel,
    slot: &Slot<'_>,
    own: &Input,
    values: &mut Values,
) -> Result<Input, InputError> {
    let nothing = Inputs::default();
    let said = about(kernel, &slot.name).map_or(&nothing, |p| &p.inputs);
    Ok(match own {
        Input::Bytes(given) => {
            let leaves = match slot.role {
                Use::Uniform(l) | Use::Element(l) | Use::ElementMut(l) | Use::Storage(l) => {
                    flat::leaves(l)
                }
                Use::StorageMut { layout, .. } => flat::leaves(layout),
                Use::Attribute(_, ty) | Use::Varying(_, ty) => flat::type_leaves(ty),
                _ => return Ok(own.clone()),
            };
            let stride = slot.role.element_bytes().unwrap_or(1).max(1);
            let mut made = values.elements(&leaves, said, stride, given.len() / stride)?;
            let kept = leaves
                .iter()
                .filter(|leaf| !matches!(leaf.scalar, Scalar::F32 | Scalar::F64));
            for leaf in kept {
                let place = leaf.offset..leaf.offset + leaf.scalar.bytes();
                let both = made
                    .chunks_exact_mut(stride)
                    .zip(given.chunks_exact(stride));
                for (to, from) in both {
                    to[place.clone()].copy_from_slice(&from[place.clone()]);
                }
            }
            Input::Bytes(made)
        }
        Input::Texture { .. } | Input::Sampler(_) => own.clone(),
    })
}

fn input(
    kernel: &Kernel,
    slot: &Slot<'_>,
    values: &mut Values,
    extents: &Extents,
) -> Result<Input, InputError> {
    let zeros =
        |count: usize| Input::Bytes(vec![0; count * slot.role.element_bytes().unwrap_or(0)]);
    let nothing = Inputs::default();
    let said = about(kernel, &slot.name).map_or(&nothing, |p| &p.inputs);
    let length = values.lengths.get(&slot.name).copied();
    let filled = |values: &mut Values, layout: &Layout, count: usize| {
        let bytes = values.elements(&flat::leaves(layout), said, layout.size as usize, count);
        bytes.map(Input::Bytes)
    };
    Ok(match slot.role {
        Use::Uniform(layout) => filled(values, layout, 1)?,
        Use::Element(layout) | Use::ElementMut(layout) => filled(values, layout, extents.elements)?,
        Use::Storage(layout) | Use::StorageMut { layout, .. } => {
            filled(values, layout, length.unwrap_or(extents.table))?
        }
        Use::Attribute(_, ty) | Use::Varying(_, ty) => {
            let leaves = flat::type_leaves(ty);
            let stride = slots::type_bytes(ty);
            Input::Bytes(values.elements(&leaves, said, stride, extents.elements)?)
        }
        Use::Atomic { .. } => zeros(length.unwrap_or(COUNTERS)),
        Use::Interface(_) | Use::Output(_) => zeros(extents.elements),
        Use::StorageTexture {
            format,
            dimensions,
            array,
            access,
        } => {
            let [width, height, _] = extents.size;
            let layers = said.layers.unwrap_or(LAYERS);
            let shape = match dimensions {
                1 => TextureShape::d1(width, format),
                3 => TextureShape::d3(extents.volume, format),
                _ => TextureShape::d2(width, height, format).with_layers(if array {
                    layers
                } else {
                    1
                }),
            };
            let bytes = if access.reads() {
                values.texels(said, &shape)?
            } else {
                vec![0; shape.bytes()]
            };
            Input::Texture { shape, bytes }
        }
        Use::Texture(kind) => {
            let size = texels_of(kernel, &slot.name, kind, extents.size);
            let layers = match (kind.is_array(), kind.is_cube()) {
                (false, cube) => {
                    if cube {
                        6
                    } else {
                        1
                    }
                }
                (true, cube) => said.layers.unwrap_or(LAYERS) * if cube { 6 } else { 1 },
            };
            let shape = TextureShape {
                dimensions: kind.dimensions(),
                size,
                levels: said.levels.unwrap_or(1),
                layers,
                samples: if kind.is_multisampled() { 4 } else { 1 },
                format: if kind.is_depth() {
                    Format::Depth32
                } else {
                    // No device has wide formats with several samples.
                    Format::Texel(match (kind.channels(), kind.is_multisampled()) {
                        (Channels::Float, false) => TexelFormat::Rgba32Float,
                        (Channels::Uint, false) => TexelFormat::Rgba32Uint,
                        (Channels::Sint, false) => TexelFormat::Rgba32Sint,
                        (Channels::Float, true) => TexelFormat::R32Float,
                        (Channels::Uint, true) => TexelFormat::Rg16Uint,
                        (Channels::Sint, true) => TexelFormat::Rg16Sint,
                    })
                },
            };
            let bytes = values.texels(said, &shape)?;
            Input::Texture { shape, bytes }
        }
        Use::Sampler(kind) => {
            let usual = match kind {
                SamplerKind::NonFiltering => Filter::Nearest,
                SamplerKind::Filtering | SamplerKind::Comparison => Filter::Linear,
            };
            let filter = said.filter.unwrap_or(usual);
            let address = said.address.unwrap_or(match values.class {
                Class::Edge => Address::Repeat,
                Class::Ordinary | Class::Hostile => Address::ClampToEdge,
            });
            Input::Sampler(Sampler {
                mip: said.mip_filter.unwrap_or(usual),
                compare: kind
                    .is_comparison()
                    .then(|| said.compare.unwrap_or(Compare::LessEqual)),
                ..Sampler::new(filter, address)
            })
        }
    })
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
