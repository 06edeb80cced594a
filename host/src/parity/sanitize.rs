//! The sanitizer over a kernel's inputs: whether anything races or is read before it is written, and
//! whether the result depends on the order of the invocations.

use std::fmt;

use hankel_dsl::native::describe::{Kernel, Param, Role, Stage, Subgroups, Tolerance};
use hankel_dsl::native::sanitize::Order;
use hankel_dsl::native::{Mode, SUBGROUP_SIZE, SUBGROUP_SIZES};

use super::execute::Written;
use super::numbers::{Difference, Found, Numbers, Rules};
use crate::inputs::Case;

/// What is wrong with a kernel.
#[derive(Clone, Debug, PartialEq)]
pub enum Fault {
    /// A run ended with these words, which say where.
    Ended {
        /// In which order the invocations ran.
        order: Order,
        /// The words.
        message: String,
    },
    /// Two orders give different results.
    Order {
        /// The one that differs from ascending order.
        order: Order,
        /// How many numbers differ.
        numbers: u64,
        /// The first of them; none if another number of bytes was written.
        first: Option<Box<Difference>>,
        /// Whether a parameter is marked as `unordered`.
        unordered: bool,
    },
    /// Subgroups of another size give another result.
    SubgroupSize {
        /// The size.
        size: u32,
        /// How many numbers differ.
        numbers: u64,
        /// The first of them; none if another number of bytes was written.
        first: Option<Box<Difference>>,
    },
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Ended {
                order: Order::Ascending,
                message,
            } => f.write_str(message),
            Self::Ended { order, message } => {
                write!(f, "{message} (with the invocations {order})")
            }
            Self::Order {
                order,
                numbers,
                first,
                unordered,
            } => {
                write!(
                    f,
                    "the result depends on the order of the invocations: {numbers} numbers are others if the invocations run {order}"
                )?;
                if let Some(d) = first {
                    write!(
                        f,
                        "; the first is `{}` of element {}: {} in ascending order, then {}",
                        d.value, d.invocation, d.expected, d.got
                    )?;
                }
                f.write_str(if *unordered {
                    ". Of a parameter that is `unordered`, it is not only the places that depend on it: which elements \
                     are written does, too"
                } else {
                    ". If only the places of the elements depend on it, mark that parameter as `unordered`"
                })
            }
            Self::SubgroupSize {
                size,
                numbers,
                first,
            } => {
                write!(
                    f,
                    "the result depends on the size of subgroups: {numbers} numbers are others with subgroups of {size}"
                )?;
                if let Some(d) = first {
                    write!(
                        f,
                        "; the first is `{}` of element {}: {} with subgroups of {SUBGROUP_SIZE}, then {}",
                        d.value, d.invocation, d.expected, d.got
                    )?;
                }
                write!(f, ". If it is meant to, write `depends(subgroup_size)`")
            }
        }
    }
}

/// Whether invocations can meet in memory that one of them writes.
#[must_use]
pub fn meets(kernel: &Kernel) -> bool {
    let cooperative = matches!(
        kernel.stage,
        Stage::Compute {
            cooperative: true,
            ..
        }
    );
    let shared = |param: &Param| match param.role {
        Role::StorageMut { .. } | Role::Atomic { .. } => true,
        Role::StorageTexture { access, .. } => access.writes(),
        _ => false,
    };
    cooperative || kernel.params.iter().any(shared)
}

/// Runs a case in every order of [`Order::ALL`], and with subgroups of every size, each access looked at. `run` runs a case natively.
/// A kernel in which invocations do not [meet](meets) is run in ascending order alone.
pub fn check<E: fmt::Display>(
    kernel: &Kernel,
    case: &Case,
    mut run: impl FnMut(Mode, &Case) -> Result<Written, E>,
) -> Result<Written, Fault> {
    let mut in_order = |order: Order, subgroup_size: u32| {
        let mode = Mode::sanitized(order).in_subgroups_of(subgroup_size);
        run(mode, case).map_err(|e| Fault::Ended {
            order,
            message: if subgroup_size == SUBGROUP_SIZE {
                e.to_string()
            } else {
                format!("{e} (with subgroups of {subgroup_size})")
            },
        })
    };
    let [first, others @ ..] = Order::ALL;
    let reference = in_order(first, SUBGROUP_SIZE)?;
    if !meets(kernel) {
        return Ok(reference);
    }
    let numbers = Numbers::of(kernel);
    let exact = Rules {
        tolerance: Tolerance {
            ulp: 0,
            absolute: 0.0,
            ..kernel.tolerance.clone()
        },
        flushes: false,
        rounds_products: false,
        hostile: true,
    };
    for order in others {
        let written = in_order(order, SUBGROUP_SIZE)?;
        let mut found = Found::default();
        numbers.compare(case, &exact, None, &reference, &written, &mut found);
        if found.beyond > 0 {
            return Err(Fault::Order {
                order,
                numbers: found.beyond,
                first: found.first.map(Box::new),
                unordered: numbers.has_unordered(),
            });
        }
    }
    // Of every size nothing is wrong, and if the kernel does not say otherwise, nothing other.
    let sizes = SUBGROUP_SIZES
        .into_iter()
        .filter(|size| *size != SUBGROUP_SIZE && !kernel.subgroups.is_unused());
    for size in sizes {
        let written = in_order(first, size)?;
        if kernel.subgroups == Subgroups::Sized {
            continue;
        }
        let mut found = Found::default();
        numbers.compare(case, &exact, None, &reference, &written, &mut found);
        if found.beyond > 0 {
            return Err(Fault::SubgroupSize {
                size,
                numbers: found.beyond,
                first: found.first.map(Box::new),
            });
        }
    }
    Ok(reference)
}
