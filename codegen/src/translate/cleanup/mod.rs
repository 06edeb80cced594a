//! Makes naga's module read as a person would have written it.
//!
//! naga's SPIR-V reader keeps SPIR-V's shape: inputs are copied to private globals, an inner
//! function computes on those, and its outputs are copied back; every buffer is a structure around
//! its contents. Here
//!
//! - [`fold_entry_point`] puts the inner function into the entry point: inputs are its arguments,
//!   outputs its return value;
//! - [`unwrap_blocks`] takes the structure off buffers: `input[i]`, not `input.elements[i]`;
//! - [`matrix_types`] makes a matrix of a structure that holds its columns;
//! - [`plain_loops`] ends loops with `break` in their body instead of a condition at their end;
//! - [`constant_indices`] makes `v[0]` with a constant index `v.x`;
//! - [`drop_dead_locals`] drops variables that are only written, [`drop_copies`] those that hold what another one holds;
//! - [`drop_last_return`] drops the `return` at the end;
//! - [`name_loads`] names what is loaded after the member or structure that it comes from;
//! - [`name_phis`] and [`name_values`] name what has no name in SPIR-V after what it is;
//! - [`name_bit_counts`] names counts of bits, where a variable's precision must widen them;
//! - [`restore_sampling`] says again where varyings are evaluated;
//! - [`restore_layers`] asks for the number of layers of a texture where SPIR-V does;
//! - [`restore_depths`] takes depths that are read as they are for what they are;
//! - [`name_roundings`] names every result of arithmetic, where that must be computed as written.
//!
//! Each declines where it does not apply, and the validator has the last word: it runs after them,
//! and where it rejects the result, the module stays as naga read it.

mod bits;
mod blocks;
mod copies;
mod depths;
mod entry_point;
mod layers;
mod locals;
mod loops;
mod matrices;
mod names;
mod rounding;
mod sampling;
mod shapes;
mod values;
mod walk;

pub use bits::{convert_wide_signs, has_bit_counts, has_functions_of_bits, name_bit_counts};
pub use blocks::unwrap_blocks;
pub use copies::drop_copies;
pub use depths::restore_depths;
pub use entry_point::fold_entry_point;
pub use layers::restore_layers;
pub use locals::{drop_dead_locals, drop_unused_locals};
pub use loops::{has_late_loops, plain_loops};
pub use matrices::matrix_types;
pub use names::{name_loads, name_result};
pub use rounding::{ROUNDED, name_results, name_roundings};
pub use sampling::restore_sampling;
pub use shapes::{constant_indices, drop_last_return, turn_empty_ifs};
pub use values::{name_phis, name_values};
pub(crate) use walk::{each_statement, each_within, with_types};
