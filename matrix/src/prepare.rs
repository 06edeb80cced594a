//! From a kernel's cases to what a [`Job`] says of them.

use std::fs;
use std::io;
use std::path::Path;

use hankel_dsl::native::describe::{self, Kernel, Output, Type};
use hankel_host::device::extent::{self, Extent};
use hankel_host::device::slots::{self, Given, Use};
use hankel_host::inputs::{Case as HostCase, Input};
use hankel_host::parity::execute::Written;

use crate::job::{Arg, Case, Job, Place, Role, Scalar, Slot, Stage, Value};
use crate::subject::Code;

/// A kernel's inputs, written to a file.
#[derive(Debug)]
pub struct Prepared {
    /// The cases as the host has them.
    pub cases: Vec<HostCase>,
    /// The cases as runners get them.
    runs: Vec<Case>,
}

impl Prepared {
    /// Writes the inputs of `kernel` to `file`.
    ///
    /// # Errors
    /// Writing the file.
    pub fn new(kernel: &Kernel, cases: Vec<HostCase>, file: &Path) -> io::Result<Self> {
        let mut bytes = Vec::new();
        let runs = cases.iter().map(|c| run(kernel, c, &mut bytes)).collect();
        fs::write(file, bytes)?;
        Ok(Self { cases, runs })
    }

    /// The job of running `code`.
    ///
    /// # Errors
    /// In words: a type at a stage's interface that no runner takes.
    pub fn job(
        &self,
        kernel: &Kernel,
        code: &Code,
        file: &Path,
        inputs: &Path,
        results: &Path,
    ) -> Result<Job, String> {
        let slots = slots::slots(kernel)
            .iter()
            .map(|s| slot(kernel, s, code))
            .collect::<Result<_, _>>()?;
        Ok(Job {
            id: 0,
            kernel: kernel.name.clone(),
            entry_point: code.entry_point.clone(),
            stage: match kernel.stage {
                describe::Stage::Compute { threads, .. } => Stage::Compute { threads },
                describe::Stage::Vertex => Stage::Vertex,
                describe::Stage::Fragment => Stage::Fragment,
            },
            code: file.to_owned(),
            slots,
            sizes_slot: code.sizes_slot,
            sized: code.sized.clone(),
            cases: self.runs.clone(),
            inputs: inputs.to_owned(),
            results: results.to_owned(),
        })
    }

    /// Takes a results file apart.
    ///
    /// # Errors
    /// In words: another length than the cases make.
    pub fn results(&self, kernel: &Kernel, mut bytes: &[u8]) -> Result<Vec<Written>, String> {
        let whole = bytes.len();
        let slots = slots::slots(kernel);
        let mut all = Vec::with_capacity(self.cases.len());
        for run in &self.runs {
            let mut written = Vec::new();
            for (slot, arg) in slots.iter().zip(&run.args) {
                if !slot.role.is_written() {
                    continue;
                }
                let length = match arg {
                    Arg::Bytes { length, .. } | Arg::Texture { length, .. } => {
                        usize::try_from(*length).unwrap_or(usize::MAX)
                    }
                    Arg::Sampler(_) => 0,
                };
                let (own, rest) = bytes.split_at_checked(length).ok_or_else(|| {
                    format!("the results have {whole} bytes, which is fewer than the cases write")
                })?;
                written.push(own.to_vec());
                bytes = rest;
            }
            all.push(written);
        }
        if bytes.is_empty() {
            Ok(all)
        } else {
            Err(format!(
                "the results have {whole} bytes, {} more than the cases write",
                bytes.len()
            ))
        }
    }
}

fn run(kernel: &Kernel, case: &HostCase, bytes: &mut Vec<u8>) -> Case {
    let mut put = |own: &[u8]| {
        // Where any type may begin.
        bytes.resize(bytes.len().next_multiple_of(16), 0);
        let offset = bytes.len() as u64;
        bytes.extend_from_slice(own);
        (offset, own.len() as u64)
    };
    let args = case
        .args
        .iter()
        .map(|input| match input {
            Input::Bytes(own) => {
                let (offset, length) = put(own);
                Arg::Bytes { offset, length }
            }
            Input::Texture { shape, bytes: own } => {
                let (offset, length) = put(own);
                Arg::Texture {
                    format: shape.format.name().into(),
                    dimensions: shape.dimensions,
                    size: shape.size,
                    levels: shape.levels,
                    layers: shape.layers,
                    samples: shape.samples,
                    offset,
                    length,
                }
            }
            Input::Sampler(s) => Arg::Sampler(*s),
        })
        .collect();
    Case {
        invocations: case.invocations as u32,
        groups: groups(kernel, case),
        args,
    }
}

/// How many workgroups a case takes.
fn groups(kernel: &Kernel, case: &HostCase) -> [u32; 3] {
    let describe::Stage::Compute { threads, .. } = kernel.stage else {
        return [1; 3];
    };
    let slots = slots::slots(kernel);
    let given: Vec<Given<'_>> = case
        .args
        .iter()
        .zip(0..)
        .map(|(input, id)| match input {
            Input::Bytes(b) => match slots[id as usize].role {
                Use::Uniform(_) => Given::Bytes(b),
                _ => Given::Buffer { id, bytes: b.len() },
            },
            Input::Texture { shape, .. } => Given::Texture { id, shape: *shape },
            Input::Sampler(s) => Given::Sampler(*s),
        })
        .collect();
    // The inputs are made to fit.
    let Ok(Extent::Known(extent)) = extent::extent(kernel, &slots, &given) else {
        return [0; 3];
    };
    [0, 1, 2].map(|i| extent[i].div_ceil(threads[i].max(1)))
}

fn slot(kernel: &Kernel, slot: &slots::Slot<'_>, code: &Code) -> Result<Slot, String> {
    let place = slot.binding.and_then(|b| code.places.get(&b));
    Ok(Slot {
        name: slot.name.clone(),
        binding: slot.binding,
        place: place.map(|p| Place {
            name: p.name.clone(),
            class: p.class.clone(),
            index: p.index,
            block: p.block.clone(),
            combined_with: p.combined_with.clone(),
        }),
        role: role(kernel, slot)?,
    })
}

fn role(kernel: &Kernel, slot: &slots::Slot<'_>) -> Result<Role, String> {
    Ok(match slot.role {
        Use::Uniform(_) => Role::Uniform,
        Use::Element(_) | Use::Storage(_) => Role::Read,
        Use::Atomic { .. } => Role::Atomic,
        Use::ElementMut(_) | Use::StorageMut { .. } | Use::Output(_) => Role::Write,
        Use::Sampler(_) => Role::Sampler,
        Use::Texture(kind) => Role::Texture {
            view: kind.view().into(),
            depth: kind.is_depth(),
            multisampled: kind.is_multisampled(),
        },
        Use::StorageTexture {
            format,
            dimensions,
            array,
            access,
        } => Role::StorageTexture {
            format: format.name().into(),
            view: describe::storage_view(dimensions, array).into(),
            access: access.word().into(),
        },
        Use::Attribute(location, ty) => Role::Attribute {
            location,
            value: value(ty)?,
        },
        Use::Varying(location, ty) => Role::Varying {
            location,
            value: value(ty)?,
        },
        Use::Interface(_) => {
            // Slots name the outputs in the order of the description.
            let index = slot
                .name
                .strip_prefix("output[")
                .and_then(|rest| rest.strip_suffix(']')?.parse().ok())
                .unwrap_or(0);
            match kernel.outputs.get(index) {
                Some(Output::Position) => Role::Position,
                Some(Output::Depth) => Role::Depth,
                Some(Output::ClipDistances { ty }) => Role::ClipDistances {
                    value: distances(ty),
                },
                Some(Output::SecondSource { ty }) => Role::SecondSource { value: value(ty)? },
                Some(Output::Varying { location, ty, .. }) => Role::Passed {
                    location: *location,
                    value: value(ty)?,
                },
                Some(Output::Target { location, ty }) => Role::Target {
                    location: *location,
                    value: value(ty)?,
                },
                _ => return Err(format!("`{}` is not an output of a stage", slot.name)),
            }
        }
    })
}

/// Clip distances, an array of floats.
fn distances(ty: &Type) -> Value {
    let size = match ty {
        Type::Array { length, .. } => *length,
        _ => 1,
    };
    Value {
        scalar: Scalar::F32,
        size,
    }
}

/// A type that passes between stages.
fn value(ty: &Type) -> Result<Value, String> {
    let (scalar, size) = ty
        .components()
        .ok_or("only scalars and vectors pass between stages")?;
    let scalar = match scalar {
        describe::Scalar::F32 => Scalar::F32,
        describe::Scalar::U32 => Scalar::U32,
        describe::Scalar::I32 => Scalar::I32,
        describe::Scalar::F64 | describe::Scalar::U64 | describe::Scalar::I64 => {
            return Err("64-bit values do not pass between stages".into());
        }
        describe::Scalar::Bool => return Err("truth values do not pass between stages".into()),
        describe::Scalar::F16 => return Err("halves in memory do not pass between stages".into()),
    };
    Ok(Value { scalar, size })
}
