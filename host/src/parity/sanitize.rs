//! The sanitizer over a kernel's inputs: whether anything races or is read before it is written, and
//! whether the result depends on the order of the invocations.

use std::fmt;

use hankel_dsl::native::Mode;
use hankel_dsl::native::describe::{Kernel, Param, Role, Stage, Tolerance};
use hankel_dsl::native::sanitize::Order;

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
                write!(
                    f,
                    ". If only the places of the elements depend on it, mark that parameter as `unordered`"
                )
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

/// Runs a case in every order of [`Order::ALL`], each access looked at. `run` runs a case natively.
/// A kernel in which invocations do not [meet](meets) is run in ascending order alone.
pub fn check<E: fmt::Display>(
    kernel: &Kernel,
    case: &Case,
    mut run: impl FnMut(Mode, &Case) -> Result<Written, E>,
) -> Result<Written, Fault> {
    let mut in_order = |order: Order| {
        run(Mode::sanitized(order), case).map_err(|e| Fault::Ended {
            order,
            message: e.to_string(),
        })
    };
    let [first, others @ ..] = Order::ALL;
    let reference = in_order(first)?;
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
        hostile: true,
    };
    for order in others {
        let written = in_order(order)?;
        let mut found = Found::default();
        numbers.compare(case, &exact, None, &reference, &written, &mut found);
        if found.beyond > 0 {
            return Err(Fault::Order {
                order,
                numbers: found.beyond,
                first: found.first.map(Box::new),
            });
        }
    }
    Ok(reference)
}
