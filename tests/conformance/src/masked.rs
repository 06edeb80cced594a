//! A kernel in a module that nobody else sees, with an index that cannot be out of range before a
//! barrier.

use hankel_dsl::glam::UVec4;
use hankel_dsl::{Element, Shared, barrier, kernel};

/// Numbers that are looked up.
#[derive(Clone, Copy, Debug, PartialEq, Element)]
#[repr(C)]
pub struct Table {
    /// They.
    pub numbers: [UVec4; 8],
}

/// A number of a table that the invocation's own number finds, from the invocation across the workgroup.
#[kernel(compute, threads(64))]
pub fn looked_up(
    #[local_index] me: u32,
    #[uniform] table: &Table,
    #[shared] found: Shared<'_, u32, 64>,
    #[element] x: Option<u32>,
) -> u32 {
    let x = x.unwrap_or(0);
    let row = table.numbers[(x & 7) as usize];
    let other = table.numbers[((x >> 8) % 5) as usize];
    found.set(me, row.x ^ other.y);
    barrier();
    found.get(63 - me)
}
