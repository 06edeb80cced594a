//! Which invocation a kernel panics in.

use hankel_dsl::native::describe::{Kernel, Range, Stage};

use crate::device::slots::{self, Use};
use crate::inputs::{self, Case, Input};

/// The case with its first `invocations` alone, where each reads an element of its own and writes
/// one; none for kernels over texels, with shared memory, or that write anywhere.
fn first(kernel: &Kernel, case: &Case, invocations: usize) -> Option<Case> {
    if let Stage::Compute {
        cooperative, range, ..
    } = &kernel.stage
        && (*cooperative || *range != Range::Outputs)
    {
        return None;
    }
    let mut shorter = case.clone();
    shorter.invocations = invocations;
    for (slot, arg) in slots::slots(kernel).iter().zip(&mut shorter.args) {
        match (slot.role, arg) {
            (
                Use::Element(_)
                | Use::Attribute(..)
                | Use::Varying(..)
                | Use::Interface(_)
                | Use::ElementMut(_)
                | Use::Output(_),
                Input::Bytes(bytes),
            ) => bytes.truncate(invocations * slot.role.element_bytes()?),
            (Use::StorageMut { .. } | Use::Atomic { .. } | Use::StorageTexture { .. }, _) => {
                return None;
            }
            _ => {}
        }
    }
    Some(shorter)
}

/// The inputs of the first invocation of `case` that `fails` says a run panics in, in words; none
/// where that cannot be told.
pub fn culprit(
    kernel: &Kernel,
    case: &Case,
    mut fails: impl FnMut(&Case) -> bool,
) -> Option<String> {
    let mut fails_with = |n: usize| first(kernel, case, n).map(|case| fails(&case));
    let (mut good, mut bad) = (0, case.invocations);
    if !fails_with(bad)? {
        return None;
    }
    while bad - good > 1 {
        let middle = good + (bad - good) / 2;
        if fails_with(middle)? {
            bad = middle;
        } else {
            good = middle;
        }
    }
    let inputs: Vec<String> = inputs::of_invocation(kernel, case, good)
        .iter()
        .map(|(name, value)| format!("{name} = {value}"))
        .collect();
    Some(format!("invocation {good}, with {}", inputs.join(", ")))
}
