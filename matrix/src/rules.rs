//! What each column may differ by.

use hankel_dsl::native::describe::{Kernel, Tolerance};
use hankel_host::parity::numbers::Rules;

use crate::column::Column;

/// What `kernel` may differ by in `column`.
#[must_use]
pub fn of(kernel: &Kernel, column: Column) -> Rules {
    let native = matches!(column, Column::Native | Column::NativeSimd);
    if native {
        let exact = Tolerance {
            ulp: 0,
            absolute: 0.0,
            why: "the same operations, neither fused nor reordered".into(),
        };
        return Rules::of(kernel, exact);
    }
    Rules::of(kernel, kernel.tolerance.clone())
}

/// Why a column cannot run a kernel although the language expresses it.
#[must_use]
pub fn inapplicable(_kernel: &Kernel, _column: Column) -> Option<String> {
    None
}
