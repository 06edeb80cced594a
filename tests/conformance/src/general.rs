//! Kernels that write where they like: scatter, changes in place, atomics that return what was
//! there, several outputs, ranges over buffers.

use hankel_dsl::glam::{UVec2, UVec3, Vec4};
use hankel_dsl::{Atomics, Buffer, Element, StorageMut, kernel};

use crate::Pair;

/// Each number goes to another place: a permutation, as the length is a prime number.
#[kernel(compute, threads(64))]
pub fn scatter(#[index] i: u32, #[element] x: u32, #[storage] out: StorageMut<'_, u32>) {
    let n = out.len();
    // Less than 2^32: the length is at most a few thousand.
    out.set((i * 1031 + 7) % n, x ^ i);
}

/// A point moves by its weight, in place; what it was is returned, and by how much it moved.
#[kernel(
    compute,
    threads(64),
    parity(non_finite, why = "sums and products of absurd numbers overflow")
)]
pub fn step(#[element] pair: &mut Pair<f32>, #[uniform] time: &f32) -> (Pair<f32>, f32) {
    let before = *pair;
    let move_by = pair.w * *time;
    pair.x += move_by;
    pair.w *= 0.5;
    (before, move_by)
}

/// A point halves, in place, and nothing else.
#[kernel(compute, threads(64))]
pub fn halve(#[element] pair: &mut Pair<f32>) {
    pair.x *= 0.5;
}

/// Keeps the numbers whose two lowest bits are zero, in whatever order; the first counter says how
/// many, the second what the last bits of all were.
#[kernel(compute, threads(64))]
pub fn compact(
    #[element] x: u32,
    #[atomic] counters: Atomics<'_>,
    #[storage(unordered)] kept: StorageMut<'_, u32>,
) {
    counters.or(1, x & 0xff);
    if x & 3 == 0 {
        let place = counters.add(0, 1);
        kept.set(place, x);
    }
}

/// Every atomic operation on signed numbers; each counter has one of its own.
#[kernel(compute, threads(64))]
pub fn signed(#[element] x: i32, #[atomic] counters: Atomics<'_, i32>) {
    counters.add(0, x >> 8);
    counters.sub(1, x >> 8);
    counters.and(2, x);
    counters.or(3, x);
    counters.xor(4, x);
}

/// The smallest and the largest of signed numbers.
#[kernel(compute, threads(64))]
pub fn extremes(#[element] x: i32, #[atomic] counters: Atomics<'_, i32>) {
    counters.min(0, x);
    counters.max(1, x);
}

/// Sixteen kinds of numbers: whoever comes first of its kind is counted, by exchange and by
/// compare-exchange; all leave the same value.
#[kernel(compute, threads(64))]
pub fn firsts(#[element] x: u32, #[atomic] counters: Atomics<'_>) {
    let kind = x & 15;
    if counters.exchange(kind, kind + 1) == 0 {
        counters.add(16 + kind, 1);
    }
    if counters.compare_exchange(32 + kind, 0, kind + 1) == 0 {
        counters.add(48 + kind, 1);
    }
    counters.store(64 + kind, counters.load(80) + kind);
}

/// A sum of floats by compare-exchange; all sums are small integers, so that no order rounds.
#[kernel(compute, threads(64))]
pub fn float_sum(#[element] x: u32, #[atomic] sums: Atomics<'_>) {
    let mut old = sums.load(0);
    loop {
        let sum = f32::from_bits(old) + (x & 15) as f32;
        let seen = sums.compare_exchange(0, old, sum.to_bits());
        if seen == old {
            break;
        }
        old = seen;
    }
}

/// A buffer as a grid: the mean of a cell and its right and lower neighbours.
#[kernel(compute, threads(8, 8), range(grid.size), parity(non_finite, why = "sums and products of absurd numbers overflow"))]
pub fn blur_grid(
    #[index] at: UVec2,
    #[uniform] grid: &Grid,
    #[storage] cells: Buffer<'_, f32>,
) -> f32 {
    let right = if at.x + 1 < grid.size.x {
        at.x + 1
    } else {
        at.x
    };
    let below = if at.y + 1 < grid.size.y {
        at.y + 1
    } else {
        at.y
    };
    let cell = |x: u32, y: u32| cells.get(y * grid.size.x + x);
    (cell(at.x, at.y) + cell(right, at.y) + cell(at.x, below)) * grid.weight
}

/// A grid's size, and what a sum is multiplied by.
#[derive(Clone, Copy, Debug, PartialEq, Element)]
#[repr(C)]
pub struct Grid {
    /// Factor of a sum.
    pub weight: f32,
    /// Fills the structure up.
    pub padding: u32,
    /// Cells along x and y.
    pub size: UVec2,
}

/// The index itself, in three dimensions of a fixed size, to a buffer.
#[kernel(compute, threads(4, 4, 4), range(9, 5, 6))]
pub fn cells(#[index] at: UVec3, #[storage] table: Buffer<'_, u32>) -> u32 {
    at.x + 100 * at.y + 10_000 * at.z + (table.get(at.x) & 1)
}

/// As many invocations as a uniform says, in one dimension.
#[kernel(compute, threads(64), range(count))]
pub fn counted(#[index] i: u32, #[uniform] count: &u32, #[storage] out: StorageMut<'_, u32>) {
    let mirrored = *count - 1 - i;
    out.set(mirrored, i * 3);
}

/// How many bits are set, counted one by one, and the most of a number: atomic operations on what a loop has computed.
#[kernel(compute, threads(64))]
pub fn bits_set(
    #[element] x: u32,
    #[atomic]
    #[length(2)]
    counters: Atomics<'_>,
) {
    let mut count = 0;
    let mut rest = x;
    while rest > 0 {
        count += rest & 1;
        rest >>= 1;
    }
    counters.add(0, count);
    counters.max(1, count);
}

/// Two textures and a buffer at once.
#[kernel(compute, threads(8, 8), outputs(rgba32float, r32uint, buffer))]
pub fn several(#[index] at: UVec2) -> (Vec4, u32, UVec2) {
    (
        Vec4::new(at.x as f32, at.y as f32, 0.5, 1.0),
        at.x ^ at.y,
        at,
    )
}

/// Counts numbers by what is left when they are divided by how many counters there are.
#[kernel(compute, threads(64))]
pub fn tallied(
    #[element] x: u32,
    #[atomic]
    #[length(17)]
    bins: Atomics<'_>,
) {
    bins.add(x % bins.len(), 1);
}

/// A square grid in a buffer that has room for sixteen cells along each axis.
#[derive(Clone, Copy, Debug, PartialEq, Element)]
#[repr(C)]
pub struct Tile {
    /// Cells along x and y.
    #[range(1..=16)]
    pub cells: UVec2,
}

/// Marks the cells at the border of a grid.
#[kernel(compute, threads(8, 8), range(tile.cells))]
pub fn bordered(
    #[index] at: UVec2,
    #[uniform] tile: &Tile,
    #[storage]
    #[length(256)]
    marks: StorageMut<'_, u32>,
) {
    let last = tile.cells - 1;
    let inside = at.x > 0 && at.y > 0 && at.x < last.x && at.y < last.y;
    marks.set(at.y * 16 + at.x, if inside { 1 } else { 2 });
}

/// The sum of the first and the last number of a part of a table: where it begins, and how many follow.
#[kernel(
    compute,
    threads(64),
    inputs = inputs::parts,
    parity(non_finite, why = "sums of absurd numbers overflow")
)]
pub fn ends(#[element] part: UVec2, #[storage] table: Buffer<'_, f32>) -> f32 {
    table.get(part.x) + table.get(part.x + part.y)
}

#[cfg(not(target_arch = "spirv"))]
mod inputs {
    //! Places that are in their table.

    extern crate std;

    use std::vec::Vec;

    use hankel_dsl::glam::UVec2;
    use hankel_dsl::native::inputs::{Given, Request, Source};

    /// A table, and parts of it.
    pub fn parts(request: &Request) -> Vec<Given> {
        let mut chance = Source::new(request.seed);
        let table: Vec<f32> = (0..57).map(|_| chance.between(-1.0, 1.0) as f32).collect();
        let parts: Vec<UVec2> = (0..1001)
            .map(|_| {
                let start = chance.count(0, 56);
                UVec2::new(start, chance.count(0, 56 - start))
            })
            .collect();
        let given = Given::new("parts of a table");
        [given.buffer("table", &table).buffer("part", &parts)].into()
    }
}
