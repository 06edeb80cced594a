//! A built-in kernel with its arguments in memory, ready to be called as any user calls it.

use std::time::Instant;

use bytemuck::{bytes_of, cast_slice, cast_slice_mut, pod_read_unaligned};
use hankel_dsl::native::describe::{self, Layout, Output, Role, Scalar, Type};
use hankel_dsl::native::{Arg, Call, Entry, Mode};
use hankel_moments::MAX_MOMENTS;

use super::SpeedError;
use crate::families::{Format, Precision, Row};

/// Bytes at an address that any element may have.
struct Block {
    words: Vec<u128>,
    bytes: usize,
}

impl Block {
    fn new(bytes: usize) -> Self {
        Self {
            words: vec![0; bytes.div_ceil(16)],
            bytes,
        }
    }

    fn get(&self) -> &[u8] {
        &cast_slice(&self.words)[..self.bytes]
    }

    fn get_mut(&mut self) -> &mut [u8] {
        &mut cast_slice_mut(&mut self.words)[..self.bytes]
    }
}

/// A map over rows that reads one uniform and one element buffer and writes one buffer, with all
/// three.
pub struct Native {
    entry: Entry,
    uniform: Block,
    elements: Block,
    output: Block,
    output_layout: Layout,
    rows: usize,
}

/// The built-in entry point of a function in a precision.
fn entry(function: &str, precision: Precision) -> Option<Entry> {
    let precision = match precision {
        Precision::F32 => describe::Precision::F32,
        Precision::F64 => describe::Precision::F64,
    };
    hankel_shadows::entries()
        .into_iter()
        .find(|e| e.kernel.function == function && e.kernel.precision == Some(precision))
}

/// Whether there is such an entry point.
pub fn exists(function: &str, precision: Precision) -> bool {
    entry(function, precision).is_some()
}

impl Native {
    /// The kernel on these rows, lower bounds without a bias; of an adjoint, the derivatives of the
    /// bounds' sum.
    pub fn new<T: Format>(function: &str, rows: &[Row<T>]) -> Result<Self, SpeedError> {
        let mut native = Self::empty(function, T::PRECISION, rows.len())?;
        let layout = native.element_layout()?;
        let stride = layout.size as usize;
        let sources: Vec<(usize, Source)> = layout
            .fields
            .iter()
            .map(|field| {
                let unknown = || SpeedError::Kernel {
                    kernel: function.into(),
                    problem: format!("its rows have a field `{}`", field.name),
                };
                let is_number = matches!(
                    (&field.ty, T::PRECISION),
                    (
                        Type::Scalar {
                            scalar: Scalar::F32
                        },
                        Precision::F32
                    ) | (
                        Type::Scalar {
                            scalar: Scalar::F64
                        },
                        Precision::F64
                    )
                );
                let source = Source::named(&field.name).filter(|_| is_number);
                Ok((field.offset as usize, source.ok_or_else(unknown)?))
            })
            .collect::<Result<_, SpeedError>>()?;
        let all = native.elements.get_mut().chunks_exact_mut(stride);
        for (row, bytes) in rows.iter().zip(all) {
            for &(offset, source) in &sources {
                let value = match source {
                    Source::Moment(k) => row.m[k],
                    Source::Query => row.eta,
                    Source::One => T::round(1.0),
                };
                bytes[offset..offset + size_of::<T>()].copy_from_slice(bytes_of(&value));
            }
        }
        Ok(native)
    }

    /// The kernel on elements as they lie in memory.
    pub fn from_bytes(
        function: &str,
        precision: Precision,
        rows: usize,
        bytes: &[u8],
    ) -> Result<Self, SpeedError> {
        let mut native = Self::empty(function, precision, rows)?;
        if bytes.len() != native.elements.bytes {
            return Err(SpeedError::Kernel {
                kernel: function.into(),
                problem: format!(
                    "{} bytes were given for rows of {} bytes in all",
                    bytes.len(),
                    native.elements.bytes
                ),
            });
        }
        native.elements.get_mut().copy_from_slice(bytes);
        Ok(native)
    }

    fn empty(function: &str, precision: Precision, rows: usize) -> Result<Self, SpeedError> {
        let wrong = |problem: &str| SpeedError::Kernel {
            kernel: function.into(),
            problem: problem.into(),
        };
        let entry = entry(function, precision).ok_or_else(|| wrong("there is no such kernel"))?;
        let [uniform, element] = entry.kernel.params.as_slice() else {
            return Err(wrong("it does not have one uniform and one element"));
        };
        let (
            Role::Uniform {
                layout: uniform, ..
            },
            Role::Element {
                layout: element, ..
            },
        ) = (&uniform.role, &element.role)
        else {
            return Err(wrong("it does not have one uniform and one element"));
        };
        let [Output::Buffer { layout: output, .. }] = entry.kernel.outputs.as_slice() else {
            return Err(wrong("it does not write one buffer"));
        };
        Ok(Self {
            // Zeros: no overestimation, no bias.
            uniform: Block::new(uniform.size as usize),
            elements: Block::new(element.size as usize * rows),
            output: Block::new(output.size as usize * rows),
            output_layout: output.clone(),
            entry,
            rows,
        })
    }

    fn element_layout(&self) -> Result<Layout, SpeedError> {
        self.entry
            .kernel
            .params
            .iter()
            .find_map(|p| match &p.role {
                Role::Element { layout, .. } => Some(layout.clone()),
                _ => None,
            })
            .ok_or_else(|| SpeedError::Kernel {
                kernel: self.entry.kernel.name.clone(),
                problem: "it has no element".into(),
            })
    }

    /// The elements as they lie in memory.
    pub fn elements(&self) -> &[u8] {
        self.elements.get()
    }

    /// Bytes that a row is, read and written.
    pub fn bytes_per_row(&self) -> usize {
        (self.elements.bytes + self.output.bytes) / self.rows.max(1)
    }

    /// Calls the kernel; returns the seconds that the call took: of processor time on one thread,
    /// which nothing else on the machine adds to, and of wall time on all.
    pub fn time(&mut self, mode: Mode) -> Result<f64, SpeedError> {
        let mut call = Call {
            args: vec![
                Arg::Bytes(self.uniform.get()),
                Arg::Bytes(self.elements.get()),
                Arg::BytesMut(self.output.get_mut()),
            ],
            constants: Vec::new(),
            mode,
        };
        if mode.parallel {
            let start = Instant::now();
            (self.entry.run)(&mut call)?;
            return Ok(start.elapsed().as_secs_f64());
        }
        let start = thread_seconds();
        (self.entry.run)(&mut call)?;
        Ok(thread_seconds() - start)
    }

    /// What the latest call wrote: the numbers of each row.
    pub fn outputs(&self) -> Vec<Vec<f64>> {
        let stride = self.output_layout.size as usize;
        let number = |row: &[u8], field: &describe::Field| {
            let bytes = &row[field.offset as usize..][..field.size as usize];
            if field.size == 4 {
                f64::from(pod_read_unaligned::<f32>(bytes))
            } else {
                pod_read_unaligned::<f64>(bytes)
            }
        };
        self.output
            .get()
            .chunks_exact(stride)
            .map(|row| {
                self.output_layout
                    .fields
                    .iter()
                    .map(|f| number(row, f))
                    .collect()
            })
            .collect()
    }
}

/// Processor time of this thread.
#[cfg(unix)]
fn thread_seconds() -> f64 {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
    time.tv_sec as f64 + time.tv_nsec as f64 * 1e-9
}

/// Wall time, where there is no other.
#[cfg(not(unix))]
fn thread_seconds() -> f64 {
    use std::sync::OnceLock;
    static START: OnceLock<Instant> = OnceLock::new();
    START.get_or_init(Instant::now).elapsed().as_secs_f64()
}

/// Where a field of an element comes from.
#[derive(Clone, Copy)]
enum Source {
    Moment(usize),
    Query,
    One,
}

impl Source {
    fn named(name: &str) -> Option<Self> {
        match name {
            "eta" => Some(Self::Query),
            "d_bound" => Some(Self::One),
            _ => name
                .strip_prefix('m')?
                .parse()
                .ok()
                .filter(|k| *k < MAX_MOMENTS)
                .map(Self::Moment),
        }
    }
}
