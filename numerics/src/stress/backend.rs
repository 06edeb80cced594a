//! Where kernels run: natively, on lanes, or wherever somebody else says.

use std::collections::BTreeMap;

use bytemuck::{cast_slice, cast_slice_mut};
use hankel_dsl::native::describe::{self, Kernel, Role};
use hankel_dsl::native::{Arg, Call, Entry, Mode};

use super::StressError;
use crate::families::{Format, Precision, Row};

/// Why a kernel did not run.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum BackendError {
    /// The backend cannot run such kernels: the report says so and goes on.
    #[error("{0}")]
    Lacks(String),
    /// Something is wrong.
    #[error("{0}")]
    Failed(String),
}

/// Something that runs built-in kernels which read one uniform and one element buffer and write one
/// buffer.
pub trait Backend {
    /// Its name in tables.
    fn name(&self) -> String;

    /// Runs a kernel; returns `output` bytes.
    ///
    /// # Errors
    /// The call did not run.
    fn run(
        &mut self,
        kernel: &Kernel,
        uniform: &[u8],
        elements: &[u8],
        output: usize,
    ) -> Result<Vec<u8>, BackendError>;
}

/// Bytes at an address that any element may have.
pub(crate) struct Aligned {
    words: Vec<u128>,
    bytes: usize,
}

impl Aligned {
    pub fn zeros(bytes: usize) -> Self {
        Self {
            words: vec![0; bytes.div_ceil(16)],
            bytes,
        }
    }

    pub fn copy(bytes: &[u8]) -> Self {
        let mut aligned = Self::zeros(bytes.len());
        aligned.get_mut().copy_from_slice(bytes);
        aligned
    }

    pub fn get(&self) -> &[u8] {
        &cast_slice(&self.words)[..self.bytes]
    }

    pub fn get_mut(&mut self) -> &mut [u8] {
        &mut cast_slice_mut(&mut self.words)[..self.bytes]
    }
}

/// The name of one row after the other.
pub const NATIVE: &str = "native";

/// The name of SIMD lanes, which must give the scalar bits.
pub const LANES: &str = "lanes";

/// This machine's processor.
pub struct Native {
    mode: Mode,
    entries: BTreeMap<String, Entry>,
}

impl Native {
    /// One row after the other on one thread.
    #[must_use]
    pub fn scalar() -> Self {
        Self::with(Mode::REFERENCE)
    }

    /// As users run it: SIMD lanes, all cores.
    #[must_use]
    pub fn lanes() -> Self {
        Self::with(Mode::default())
    }

    fn with(mode: Mode) -> Self {
        let entries = hankel_shadows::entries();
        Self {
            mode,
            entries: entries
                .into_iter()
                .map(|e| (e.kernel.name.clone(), e))
                .collect(),
        }
    }
}

impl Backend for Native {
    fn name(&self) -> String {
        let name = if self.mode.lanes { LANES } else { NATIVE };
        name.into()
    }

    fn run(
        &mut self,
        kernel: &Kernel,
        uniform: &[u8],
        elements: &[u8],
        output: usize,
    ) -> Result<Vec<u8>, BackendError> {
        let entry = self
            .entries
            .get(&kernel.name)
            .ok_or_else(|| BackendError::Lacks("it is not built in".into()))?;
        let (uniform, elements) = (Aligned::copy(uniform), Aligned::copy(elements));
        let mut written = Aligned::zeros(output);
        let mut call = Call {
            args: vec![
                Arg::Bytes(uniform.get()),
                Arg::Bytes(elements.get()),
                Arg::BytesMut(written.get_mut()),
            ],
            constants: Vec::new(),
            mode: self.mode,
        };
        (entry.run)(&mut call).map_err(|e| BackendError::Failed(e.to_string()))?;
        Ok(written.get().to_vec())
    }
}

/// A built-in kernel that maps rows of moments to numbers, and how its uniform is laid out.
#[derive(Clone, Debug)]
pub struct Map {
    /// What it is.
    pub kernel: Kernel,
    /// Numbers that it writes for each row.
    outputs: usize,
    /// Bytes of the uniform.
    uniform: usize,
    /// Whether rows end with the derivative of a result to the bound.
    has_d_bound: bool,
}

impl Map {
    /// The entry point of a function in a precision; `None` if there is none.
    ///
    /// # Errors
    /// The kernel is not a map from rows of moments, settings first.
    pub fn find(function: &str, precision: Precision) -> Result<Option<Self>, StressError> {
        let wanted = match precision {
            Precision::F32 => describe::Precision::F32,
            Precision::F64 => describe::Precision::F64,
        };
        let Some(kernel) = hankel_shadows::entries()
            .into_iter()
            .map(|e| e.kernel)
            .find(|k| k.function == function && k.precision == Some(wanted))
        else {
            return Ok(None);
        };
        let wrong = || StressError::Kernel {
            kernel: kernel.name.clone(),
            problem: "it is not a map from rows of moments with settings before them".into(),
        };
        let [uniform, element] = kernel.params.as_slice() else {
            return Err(wrong());
        };
        let (Role::Uniform { layout: u, .. }, Role::Element { layout: e, .. }) =
            (&uniform.role, &element.role)
        else {
            return Err(wrong());
        };
        let [describe::Output::Buffer { layout: output, .. }] = kernel.outputs.as_slice() else {
            return Err(wrong());
        };
        let size = match precision {
            Precision::F32 => 4,
            Precision::F64 => 8,
        };
        let names: Vec<&str> = e.fields.iter().map(|f| f.name.as_str()).collect();
        let has_d_bound = names.last() == Some(&"d_bound");
        let numbers = names.len() - usize::from(has_d_bound);
        let packed = |layout: &describe::Layout| {
            layout.size as usize == layout.fields.len() * size
                && layout
                    .fields
                    .iter()
                    .enumerate()
                    .all(|(i, f)| f.offset as usize == i * size)
        };
        let settings: Vec<&str> = u.fields.iter().map(|f| f.name.as_str()).collect();
        let as_expected = packed(e)
            && packed(output)
            && names[..numbers]
                .iter()
                .enumerate()
                .all(|(i, name)| *name == "eta" && i + 1 == numbers || *name == format!("m{i}"))
            && settings.starts_with(&["overestimation", "bias"]);
        if !as_expected {
            return Err(wrong());
        }
        Ok(Some(Self {
            outputs: output.fields.len(),
            uniform: u.size as usize,
            has_d_bound,
            kernel,
        }))
    }

    /// What the kernel makes of rows of order `n` without a bias: its outputs, row after row.
    ///
    /// # Errors
    /// The backend's.
    pub fn run<T: Format>(
        &self,
        backend: &mut dyn Backend,
        n: usize,
        rows: &[Row<T>],
        overestimation: f64,
    ) -> Result<Vec<T>, StressError> {
        let name = backend.name();
        let fail = |error: BackendError| StressError::Backend {
            kernel: self.kernel.name.clone(),
            backend: name.clone(),
            error,
        };
        let mut uniform = vec![0; self.uniform];
        let setting = T::round(overestimation);
        uniform[..size_of::<T>()].copy_from_slice(bytemuck::bytes_of(&setting));
        let one = T::round(1.0);
        let mut elements: Vec<T> = Vec::with_capacity(rows.len() * (2 * n + 3));
        for row in rows {
            elements.extend(row.columns(n));
            if self.has_d_bound {
                elements.push(one);
            }
        }
        let bytes = rows.len() * self.outputs * size_of::<T>();
        let written = backend
            .run(&self.kernel, &uniform, cast_slice(&elements), bytes)
            .map_err(fail)?;
        if written.len() != bytes {
            let problem = format!("{} bytes came for {bytes}", written.len());
            return Err(fail(BackendError::Failed(problem)));
        }
        Ok(written
            .chunks_exact(size_of::<T>())
            .map(bytemuck::pod_read_unaligned)
            .collect())
    }
}
