//! How many invocations run, and whether what is given is large enough for them.

use hankel_dsl::native::describe::{Kernel, Range, Stage};

use super::error::{DeviceError, Result};
use super::slots::{Given, Slot, Use, refuse};

/// How far a kernel runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Extent {
    /// So many invocations along x, y, z.
    Known([u32; 3]),
    /// As many as a buffer says when the kernel begins: one `u32` for each dimension.
    InBuffer {
        /// The argument's number.
        slot: usize,
        /// Where the numbers begin, in bytes.
        offset: u32,
        /// How many there are, 1 to 3.
        dimensions: u32,
    },
}

/// The numbers of a range in the bytes of its uniform; 1 for the dimensions that it does not have.
#[must_use]
pub fn in_bytes(bytes: &[u8], offset: u32, dimensions: u32) -> [u32; 3] {
    let mut extent = [1; 3];
    let words = bytes.get(offset as usize..).unwrap_or_default();
    for (n, word) in extent
        .iter_mut()
        .take(dimensions as usize)
        .zip(words.chunks_exact(4))
    {
        *n = u32::from_le_bytes([word[0], word[1], word[2], word[3]]);
    }
    extent
}

/// How many invocations run along x, y, z, as the kernel's [`Range`] says; where its outputs say
/// it, as many as the first has elements or texels, without outputs as many as the first buffer
/// that is read has.
///
/// A buffer of which each invocation has its own element must have at least as many elements,
/// except where the invocations of a workgroup work together: they are told. Outputs must have that size where they say it;
/// elsewhere a texture must have it, and a buffer at least that many elements.
///
/// A uniform that says the range may be a buffer that another kernel has written. Its numbers are
/// not known here, so that the kernel must have neither outputs nor elements.
///
/// # Errors
/// [`DeviceError::Argument`] for a buffer that is too short, an output of another size, or one for
/// each invocation where a buffer says the range; [`DeviceError::Stage`] for a kernel that nothing
/// tells the number of invocations, or that tells too large a one.
pub fn extent(kernel: &Kernel, slots: &[Slot<'_>], given: &[Given<'_>]) -> Result<Extent> {
    let arguments = Arguments {
        kernel,
        slots,
        given,
    };
    let by_outputs = Range::Outputs;
    let (range, dimensions) = match &kernel.stage {
        Stage::Compute {
            range, dimensions, ..
        } => (range, *dimensions),
        Stage::Vertex | Stage::Fragment => (&by_outputs, 1),
    };
    let extent = match range {
        Range::Outputs => arguments.of_outputs()?,
        Range::Elements { param } => {
            let i = arguments.named(param)?;
            [arguments.elements(i)?, 1, 1]
        }
        Range::Fixed { size } => *size,
        Range::Uniform { param, offset } => {
            let slot = arguments.named(param)?;
            let Given::Bytes(bytes) = given[slot] else {
                arguments.none_for_each_invocation(slot)?;
                return Ok(Extent::InBuffer {
                    slot,
                    offset: *offset,
                    dimensions,
                });
            };
            in_bytes(bytes, *offset, dimensions)
        }
    };
    check_count(kernel, extent)?;
    let invocations = extent.iter().product();
    if *range != Range::Outputs {
        arguments.outputs_hold(extent, invocations)?;
    }
    arguments.elements_suffice(invocations)?;
    Ok(Extent::Known(extent))
}

/// Whether 32 bits can count the invocations.
///
/// # Errors
/// [`DeviceError::Stage`] if they cannot.
pub fn check_count(kernel: &Kernel, extent: [u32; 3]) -> Result<()> {
    let invocations = extent.iter().map(|n| u128::from(*n)).product::<u128>();
    if invocations <= u128::from(u32::MAX) {
        return Ok(());
    }
    Err(DeviceError::Stage {
        kernel: kernel.name.clone(),
        stage: "compute",
        problem: format!("{extent:?} invocations are more than 32 bits can count"),
    })
}

struct Arguments<'a, 'k> {
    kernel: &'a Kernel,
    slots: &'a [Slot<'k>],
    given: &'a [Given<'a>],
}

impl Arguments<'_, '_> {
    fn refuse(&self, i: usize, problem: String) -> DeviceError {
        refuse(self.kernel, &self.slots[i], problem)
    }

    fn named(&self, param: &str) -> Result<usize> {
        let i = self.slots.iter().position(|s| s.name == param);
        i.ok_or_else(|| self.nothing_says())
    }

    fn nothing_says(&self) -> DeviceError {
        DeviceError::Stage {
            kernel: self.kernel.name.clone(),
            stage: "compute",
            problem: "nothing says how many invocations it runs: give it an output, a parameter \
                      that is a buffer, or `range(…)`"
                .into(),
        }
    }

    /// Elements of a buffer.
    fn elements(&self, i: usize) -> Result<u32> {
        let bytes = match self.given[i] {
            Given::Buffer { bytes, .. } => bytes,
            Given::Bytes(bytes) => bytes.len(),
            Given::Texture { .. } | Given::Sampler(_) => 0,
        };
        let n = bytes / self.slots[i].role.element_bytes().unwrap_or(1).max(1);
        u32::try_from(n)
            .map_err(|_| self.refuse(i, format!("{n} elements are more than 32 bits can count")))
    }

    /// The size that an output asks for; none for other arguments.
    fn size(&self, i: usize) -> Result<Option<[u32; 3]>> {
        // Outputs come last; a texture before them is a parameter, which may be of any size.
        if i + self.kernel.stored_outputs() < self.slots.len() {
            return Ok(None);
        }
        Ok(match (self.slots[i].role, self.given[i]) {
            (Use::StorageTexture { .. } | Use::Interface(_), Given::Texture { shape, .. }) => {
                Some(shape.size)
            }
            (Use::Output(_) | Use::Interface(_), _) => Some([self.elements(i)?, 1, 1]),
            _ => None,
        })
    }

    fn of_outputs(&self) -> Result<[u32; 3]> {
        let mut extent: Option<([u32; 3], usize)> = None;
        for i in 0..self.slots.len() {
            let Some(size) = self.size(i)? else { continue };
            let Some((first, j)) = extent else {
                extent = Some((size, i));
                continue;
            };
            // Beside a texture, a buffer has an element for each texel.
            let is_buffer = matches!(self.slots[i].role, Use::Output(_));
            let texels = first.iter().map(|n| u64::from(*n)).product::<u64>();
            let fits = if is_buffer && first[1] > 1 {
                u64::from(size[0]) == texels
            } else {
                first == size
            };
            if !fits {
                return Err(self.refuse(
                    i,
                    format!(
                        "{size:?} invocations would write it, but `{}` needs {first:?}",
                        self.slots[j].name
                    ),
                ));
            }
        }
        if let Some((size, _)) = extent {
            return Ok(size);
        }
        let counted = |s: &Slot<'_>| {
            matches!(
                s.role,
                Use::Element(_) | Use::ElementMut(_) | Use::Storage(_)
            )
        };
        let i = self.slots.iter().position(counted);
        Ok([self.elements(i.ok_or_else(|| self.nothing_says())?)?, 1, 1])
    }

    /// Nothing has an element or a texel of its own for each invocation: whether there are enough
    /// cannot be checked where a buffer says the range.
    fn none_for_each_invocation(&self, says: usize) -> Result<()> {
        let first_output = self.slots.len() - self.kernel.stored_outputs();
        for (i, slot) in self.slots.iter().enumerate() {
            let own = matches!(slot.role, Use::Element(_) | Use::ElementMut(_));
            if own || i >= first_output {
                return Err(self.refuse(
                    says,
                    format!(
                        "it says how many invocations run, and `{}` has one element for each: give \
                         the uniform's bytes, not a buffer, or write the kernel with `StorageMut`",
                        slot.name
                    ),
                ));
            }
        }
        Ok(())
    }

    /// Outputs that do not say the range are large enough for it.
    fn outputs_hold(&self, extent: [u32; 3], invocations: u32) -> Result<()> {
        for i in 0..self.slots.len() {
            let Some(size) = self.size(i)? else { continue };
            let texture = matches!(self.slots[i].role, Use::StorageTexture { .. });
            if texture && size != extent {
                return Err(self.refuse(
                    i,
                    format!("it has {size:?} texels, but {extent:?} invocations run"),
                ));
            }
            if !texture && size[0] < invocations {
                return Err(self.refuse(
                    i,
                    format!(
                        "it has {} elements, but {invocations} invocations run",
                        size[0]
                    ),
                ));
            }
        }
        Ok(())
    }

    fn elements_suffice(&self, invocations: u32) -> Result<()> {
        // A workgroup's last invocations may have no element of their own; they are told so.
        let told = matches!(
            self.kernel.stage,
            Stage::Compute {
                cooperative: true,
                ..
            }
        );
        for (i, slot) in self.slots.iter().enumerate() {
            let own = match slot.role {
                Use::Element(_) => !told,
                Use::ElementMut(_) | Use::Attribute(..) | Use::Varying(..) => true,
                _ => false,
            };
            if own && self.elements(i)? < invocations {
                return Err(self.refuse(
                    i,
                    format!(
                        "it has {} elements, but {invocations} invocations run",
                        self.elements(i)?
                    ),
                ));
            }
        }
        Ok(())
    }
}
