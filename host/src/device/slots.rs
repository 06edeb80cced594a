//! A kernel's arguments, one after the other, and whether what was given fits them: the checks
//! that both devices make before anything runs.

use std::fmt;

use hankel_dsl::native::Sampler;
use hankel_dsl::native::describe::{
    Channels, Kernel, Layout, Output, Role, SamplerKind, Scalar, TexelAccess, TexelFormat,
    TextureKind, Type,
};

use super::error::{DeviceError, Result};
use super::{Format, TextureShape};

/// What an argument is for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Use<'a> {
    /// One value that every invocation reads.
    Uniform(&'a Layout),
    /// A buffer of which each invocation reads its own element.
    Element(&'a Layout),
    /// A buffer that every invocation reads anywhere.
    Storage(&'a Layout),
    /// A buffer of which each invocation reads and writes its own element.
    ElementMut(&'a Layout),
    /// A buffer that every invocation reads and writes anywhere.
    StorageMut {
        /// An element's layout.
        layout: &'a Layout,
        /// Which element lies where is not compared.
        unordered: bool,
    },
    /// Integers with atomic operations.
    Atomic {
        /// Which.
        scalar: Scalar,
        /// Which lies where is not compared.
        unordered: bool,
    },
    /// A texture that is read.
    Texture(TextureKind),
    /// A sampler.
    Sampler(SamplerKind),
    /// One value for each vertex.
    Attribute(u32, &'a Type),
    /// One value for each fragment; an argument on the native device only.
    Varying(u32, &'a Type),
    /// A buffer that is written, one element for each invocation.
    Output(&'a Layout),
    /// A texture of which any texel is read or written.
    StorageTexture {
        /// Its format.
        format: TexelFormat,
        /// 2 or 3.
        dimensions: u32,
        /// It has any number of layers.
        array: bool,
        /// What is done with its texels.
        access: TexelAccess,
    },
    /// What a vertex or fragment stage returns; an argument on the native device only: a buffer, or of the fragment form
    /// of an image pass its target.
    Interface(&'a Type),
}

/// An argument of a kernel.
#[derive(Clone, Debug, PartialEq)]
pub struct Slot<'a> {
    /// The parameter's name, or `output`; `output[1]` is the second of several outputs.
    pub name: String,
    /// Number in descriptor set 0, if it has one.
    pub binding: Option<u32>,
    /// What it is for.
    pub role: Use<'a>,
    /// Push constants: bytes, not a buffer.
    pub push: bool,
}

impl fmt::Display for Slot<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "argument `{}`", self.name)?;
        if let Some(binding) = self.binding {
            write!(f, " (binding {binding})")?;
        }
        Ok(())
    }
}

impl Use<'_> {
    /// Whether the kernel writes it.
    #[must_use]
    pub const fn is_written(&self) -> bool {
        match self {
            Self::ElementMut(_)
            | Self::StorageMut { .. }
            | Self::Atomic { .. }
            | Self::Output(_)
            | Self::Interface(_) => true,
            Self::StorageTexture { access, .. } => access.writes(),
            _ => false,
        }
    }

    /// Size of an element in bytes, for what lies in a buffer.
    #[must_use]
    pub fn element_bytes(&self) -> Option<usize> {
        Some(match self {
            Self::Uniform(l) | Self::Element(l) | Self::ElementMut(l) | Self::Storage(l) => {
                l.size as usize
            }
            Self::StorageMut { layout, .. } | Self::Output(layout) => layout.size as usize,
            Self::Atomic { .. } => 4,
            Self::Attribute(_, ty) | Self::Varying(_, ty) | Self::Interface(ty) => type_bytes(ty),
            Self::Texture(_) | Self::Sampler(_) | Self::StorageTexture { .. } => return None,
        })
    }

    /// What must be given for it, in words.
    const fn wanted(&self) -> &'static str {
        match self {
            Self::Texture(_) => "a texture",
            Self::Sampler(kind) => kind.wanted(),
            Self::StorageTexture { access, .. } => {
                if access.writes() {
                    "a texture to write"
                } else {
                    "a texture"
                }
            }
            Self::Uniform(_)
            | Self::Element(_)
            | Self::Storage(_)
            | Self::Attribute(..)
            | Self::Varying(..) => "a buffer or bytes",
            Self::ElementMut(_)
            | Self::StorageMut { .. }
            | Self::Atomic { .. }
            | Self::Output(_)
            | Self::Interface(_) => "a buffer",
        }
    }
}

/// Bytes of a scalar.
#[must_use]
pub const fn scalar_bytes(scalar: Scalar) -> usize {
    scalar.bytes()
}

/// Bytes of a value, tightly packed where it is a vector.
#[must_use]
pub fn type_bytes(ty: &Type) -> usize {
    match ty {
        Type::Scalar { scalar } => scalar_bytes(*scalar),
        Type::Vector { scalar, size } => scalar_bytes(*scalar) * *size as usize,
        Type::Array { length, stride, .. } => *length as usize * *stride as usize,
        Type::Struct { layout } => layout.size as usize,
    }
}

/// The type of a clip-space position.
pub const POSITION: Type = Type::Vector {
    scalar: Scalar::F32,
    size: 4,
};

/// The type of a fragment's depth.
pub const DEPTH: Type = Type::Scalar {
    scalar: Scalar::F32,
};

/// A kernel's arguments in order: the bound parameters, attributes and varyings, then the
/// outputs. On the native device these are all arguments, in every stage.
#[must_use]
pub fn slots(kernel: &Kernel) -> Vec<Slot<'_>> {
    let mut all = Vec::new();
    for param in &kernel.params {
        let (binding, role) = match &param.role {
            Role::Uniform {
                binding, layout, ..
            } => (Some(*binding), Use::Uniform(layout)),
            Role::Element { binding, layout } => (Some(*binding), Use::Element(layout)),
            Role::Storage { binding, layout } => (Some(*binding), Use::Storage(layout)),
            Role::ElementMut { binding, layout } => (Some(*binding), Use::ElementMut(layout)),
            Role::StorageMut {
                binding,
                layout,
                unordered,
            } => (
                Some(*binding),
                Use::StorageMut {
                    layout,
                    unordered: *unordered,
                },
            ),
            Role::Atomic {
                binding,
                scalar,
                unordered,
            } => (
                Some(*binding),
                Use::Atomic {
                    scalar: *scalar,
                    unordered: *unordered,
                },
            ),
            Role::Texture { binding, texture } => (Some(*binding), Use::Texture(*texture)),
            Role::StorageTexture {
                binding,
                format,
                dimensions,
                array,
                access,
            } => (
                Some(*binding),
                Use::StorageTexture {
                    format: *format,
                    dimensions: *dimensions,
                    array: *array,
                    access: *access,
                },
            ),
            Role::Sampler { binding, sampler } => (Some(*binding), Use::Sampler(*sampler)),
            Role::Attribute { location, ty } => (None, Use::Attribute(*location, ty)),
            Role::Varying { location, ty, .. } => (None, Use::Varying(*location, ty)),
            Role::Constant { .. } | Role::Index | Role::BuiltIn { .. } | Role::Shared { .. } => {
                continue;
            }
        };
        all.push(Slot {
            name: param.name.clone(),
            binding,
            role,
            push: matches!(param.role, Role::Uniform { push: true, .. }),
        });
    }
    for (i, output) in kernel.outputs.iter().enumerate() {
        let (binding, role) = match output {
            Output::Buffer { binding, layout } => (Some(*binding), Use::Output(layout)),
            Output::Texture {
                binding,
                format,
                dimensions,
            } => (
                Some(*binding),
                Use::StorageTexture {
                    format: *format,
                    dimensions: *dimensions,
                    array: false,
                    access: TexelAccess::Write,
                },
            ),
            Output::Position => (None, Use::Interface(&POSITION)),
            Output::Depth => (None, Use::Interface(&DEPTH)),
            // What it leaves of the others is compared.
            Output::SampleMask => continue,
            Output::ClipDistances { ty }
            | Output::Varying { ty, .. }
            | Output::Target { ty, .. }
            | Output::SecondSource { ty } => (None, Use::Interface(ty)),
        };
        let name = if kernel.outputs.len() == 1 {
            "output".into()
        } else {
            format!("output[{i}]")
        };
        all.push(Slot {
            name,
            binding,
            role,
            push: false,
        });
    }
    all
}

/// The arguments of a stage of a pipeline that draws: without varyings, positions and targets,
/// which the pipeline hands on itself.
#[must_use]
pub fn drawn_slots(kernel: &Kernel) -> Vec<Slot<'_>> {
    let mut all = slots(kernel);
    all.retain(|s| !matches!(s.role, Use::Varying(..) | Use::Interface(_)));
    all
}

/// The values of a kernel's specialisation constants: those given, or the defaults if none are.
///
/// # Errors
/// [`DeviceError::Constants`] for another number of them than the kernel has.
pub fn constants(kernel: &Kernel, given: &[u32]) -> Result<Vec<u32>> {
    let defaults: Vec<u32> = kernel
        .params
        .iter()
        .filter_map(|p| match p.role {
            Role::Constant { default, .. } => Some(default),
            _ => None,
        })
        .collect();
    if given.is_empty() {
        return Ok(defaults);
    }
    if given.len() != defaults.len() {
        return Err(DeviceError::Constants {
            kernel: kernel.name.clone(),
            problem: format!(
                "it has {} constants, {} were given",
                defaults.len(),
                given.len()
            ),
        });
    }
    Ok(given.to_vec())
}

/// What was given for an argument, as far as the checks look at it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Given<'a> {
    /// A buffer of so many bytes. The number tells buffers apart.
    Buffer {
        /// Its number.
        id: u32,
        /// Its size.
        bytes: usize,
    },
    /// Bytes.
    Bytes(&'a [u8]),
    /// A texture.
    Texture {
        /// Its number.
        id: u32,
        /// Its shape.
        shape: TextureShape,
    },
    /// A sampler.
    Sampler(Sampler),
}

/// Checks what was given for `slots` of `kernel`: number, kinds, sizes, formats, and that nothing
/// is both read and written.
///
/// # Errors
/// [`DeviceError::Count`] and [`DeviceError::Argument`].
pub fn check(kernel: &Kernel, slots: &[Slot<'_>], given: &[Given<'_>]) -> Result<()> {
    if slots.len() != given.len() {
        return Err(DeviceError::Count {
            kernel: kernel.name.clone(),
            expected: slots.len(),
            names: slots
                .iter()
                .map(|s| s.name.as_str())
                .collect::<Vec<_>>()
                .join(", "),
            got: given.len(),
        });
    }
    for (slot, given) in slots.iter().zip(given) {
        let checked = match (slot.role, given) {
            (Use::Interface(ty), Given::Texture { shape, .. }) if kernel.is_fragment_form() => {
                check_target(ty, shape)
            }
            _ => check_one(slot, given),
        };
        checked.map_err(|problem| refuse(kernel, slot, problem))?;
    }
    for (i, slot) in slots
        .iter()
        .enumerate()
        .filter(|(_, s)| s.role.is_written())
    {
        for (j, other) in slots.iter().enumerate().filter(|(j, _)| *j != i) {
            let same = match (&given[i], &given[j]) {
                (Given::Buffer { id: a, .. }, Given::Buffer { id: b, .. })
                | (Given::Texture { id: a, .. }, Given::Texture { id: b, .. }) => a == b,
                _ => false,
            };
            if same {
                let problem = format!(
                    "it is written, and also given as `{}`: use two",
                    slots[j].name
                );
                debug_assert!(other.name != slot.name);
                return Err(refuse(kernel, slot, problem));
            }
        }
    }
    Ok(())
}

/// An argument error.
pub(crate) fn refuse(kernel: &Kernel, slot: &Slot<'_>, problem: String) -> DeviceError {
    DeviceError::Argument {
        kernel: kernel.name.clone(),
        argument: slot.to_string(),
        problem,
    }
}

fn check_one(slot: &Slot<'_>, given: &Given<'_>) -> std::result::Result<(), String> {
    let wanted = || Err(format!("it must be {}", slot.role.wanted()));
    let bytes = match given {
        Given::Buffer { bytes, .. } => Some(*bytes),
        Given::Bytes(b) if !slot.role.is_written() => Some(b.len()),
        _ => None,
    };
    if let Some(size) = slot.role.element_bytes() {
        let Some(bytes) = bytes else { return wanted() };
        if let Use::Uniform(layout) = slot.role {
            if slot.push && matches!(given, Given::Buffer { .. }) {
                return Err("it must be bytes: push constants are in no buffer".into());
            }
            return if bytes == size {
                Ok(())
            } else {
                Err(format!(
                    "it has {bytes} bytes, but one `{}` has {size}",
                    layout.name
                ))
            };
        }
        if size == 0 || !bytes.is_multiple_of(size) {
            return Err(format!(
                "{bytes} bytes are no whole number of elements of {size} bytes"
            ));
        }
        if bytes == 0
            && matches!(
                slot.role,
                Use::Storage(_) | Use::StorageMut { .. } | Use::Atomic { .. }
            )
        {
            return Err("it is empty: give at least one element".into());
        }
        return Ok(());
    }
    match (slot.role, given) {
        (Use::Sampler(kind), Given::Sampler(sampler)) if kind.fits(sampler) => Ok(()),
        (Use::Texture(kind), Given::Texture { shape, .. }) => check_texture(kind, shape),
        (
            Use::StorageTexture {
                format,
                dimensions,
                array,
                access,
            },
            Given::Texture { shape, .. },
        ) => {
            let does = if access.writes() { "writes" } else { "reads" };
            if shape.format != Format::Texel(format) {
                Err(format!(
                    "its format is {}, but the kernel {does} {}",
                    shape.format.name(),
                    format.name()
                ))
            } else if shape.dimensions != dimensions {
                Err(format!(
                    "it has {} dimensions, not {dimensions}",
                    shape.dimensions
                ))
            } else if shape.samples != 1 {
                Err("it is multisampled".into())
            } else if shape.levels != 1 || (shape.layers != 1 && !array) {
                Err(format!(
                    "it has {} levels and {} layers, but the kernel {does} one",
                    shape.levels, shape.layers
                ))
            } else {
                Ok(())
            }
        }
        _ => wanted(),
    }
}

/// What the channels of a target must be for a value of this type.
#[must_use]
pub fn target_channels(ty: &Type) -> Channels {
    match ty {
        Type::Scalar {
            scalar: Scalar::U32,
        }
        | Type::Vector {
            scalar: Scalar::U32,
            ..
        } => Channels::Uint,
        Type::Scalar {
            scalar: Scalar::I32,
        }
        | Type::Vector {
            scalar: Scalar::I32,
            ..
        } => Channels::Sint,
        _ => Channels::Float,
    }
}

/// A texture that the fragment form of an image pass draws into.
fn check_target(ty: &Type, shape: &TextureShape) -> std::result::Result<(), String> {
    let wanted = target_channels(ty);
    let is_plain = shape.dimensions == 2
        && (shape.levels, shape.layers, shape.samples) == (1, 1, 1)
        && shape.format != Format::Depth32;
    if !is_plain {
        return Err(
            "it must be a texture of two dimensions, not of depths, with one level, layer and sample".into(),
        );
    }
    if shape.format.texel().numbers() != wanted {
        return Err(format!(
            "its format is {}, but the kernel draws {} channels",
            shape.format.name(),
            wanted.word()
        ));
    }
    Ok(())
}

fn check_texture(kind: TextureKind, shape: &TextureShape) -> std::result::Result<(), String> {
    let (dimensions, multisampled) = (kind.dimensions(), kind.is_multisampled());
    if shape.dimensions != dimensions {
        return Err(format!(
            "it has {} dimensions, not {dimensions}",
            shape.dimensions
        ));
    }
    match (multisampled, shape.samples) {
        (true, 1) => return Err("it has one sample, but the kernel reads several".into()),
        (false, n) if n != 1 => {
            return Err(format!("it has {n} samples, but the kernel reads one"));
        }
        _ => {}
    }
    if let Some(problem) = kind.misfit(shape.layers) {
        return Err(problem);
    }
    if !kind.has_levels() && shape.levels != 1 {
        return Err(format!("it has {} levels, not 1", shape.levels));
    }
    if kind.is_cube() && shape.size[0] != shape.size[1] {
        return Err("the faces of a cube are squares".into());
    }
    if kind.is_depth() && shape.format != Format::Depth32 {
        return Err(format!(
            "its format is {}, but the kernel reads depths",
            shape.format.name()
        ));
    }
    if shape.format.texel().numbers() != kind.channels() {
        let reads = match kind.channels() {
            Channels::Float => "floats",
            Channels::Uint => "unsigned integers",
            Channels::Sint => "signed integers",
        };
        return Err(format!(
            "its format is {}, but the kernel reads {reads}",
            shape.format.name()
        ));
    }
    Ok(())
}
