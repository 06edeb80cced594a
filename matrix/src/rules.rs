//! What each column may differ by.

use hankel_dsl::native::describe::{Kernel, Tolerance};
use hankel_host::parity::numbers::Rules;

use crate::column::Column;

/// What `kernel` may differ by in `column`. Columns that flush subnormal numbers have a reference
/// that does, if `flushed_reference`; otherwise their absurd inputs, of which many are subnormal,
/// need only give finite results.
#[must_use]
pub fn of(kernel: &Kernel, column: Column, flushed_reference: bool) -> Rules {
    if matches!(column, Column::Native | Column::NativeSimd) {
        let exact = Tolerance {
            ulp: 0,
            absolute: 0.0,
            why: "the same operations, neither fused nor reordered".into(),
        };
        return Rules::of(kernel, exact);
    }
    let mut rules = Rules::of(kernel, kernel.tolerance.clone());
    if column.flushes() {
        rules.flushes = true;
        rules.hostile &= flushed_reference;
    }
    rules
}
