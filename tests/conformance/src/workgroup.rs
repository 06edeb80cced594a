//! Kernels whose invocations work together: shared memory of several kinds, barriers in loops,
//! one to three dimensions, a helper that waits.

use hankel_dsl::glam::{UVec2, UVec3};
use hankel_dsl::{
    Buffer, Real, Shared, SharedAtomics, StorageMut, barrier, cooperative, kernel, storage_barrier,
};

/// Inclusive prefix sums within each workgroup (Hillis and Steele).
#[kernel(compute, threads(64))]
pub fn scan(
    #[local_index] me: u32,
    #[shared] sums: Shared<'_, u32, 64>,
    #[element] x: Option<u32>,
) -> u32 {
    let mut sum = x.unwrap_or(0);
    let mut reach = 1;
    while reach < 64 {
        sums.set(me, sum);
        barrier();
        if me >= reach {
            sum = sum.wrapping_add(sums.get(me - reach));
        }
        barrier();
        reach *= 2;
    }
    sum
}

/// The largest number of each workgroup.
#[kernel(compute, threads(64), range(x))]
pub fn maximum(
    #[local_index] me: u32,
    #[group_id] group: u32,
    #[shared] largest: Shared<'_, f32, 64>,
    #[element] x: Option<f32>,
    #[storage] out: StorageMut<'_, f32>,
) {
    largest.set(me, x.unwrap_or(-3.0e38));
    let mut half = 32;
    while half > 0 {
        barrier();
        if me < half {
            largest.set(me, Real::max(largest.get(me), largest.get(me + half)));
        }
        half /= 2;
    }
    if me == 0 {
        out.set(group, largest.get(0));
    }
}

/// Rows and columns of a tile.
const TILE: usize = 8;

/// A product of two square matrices whose size is a multiple of the tile's, row by row, from tiles
/// in workgroup memory.
#[kernel(
    compute,
    threads(8, 8),
    range(24, 24),
    parity(non_finite, why = "sums and products of absurd numbers overflow")
)]
pub fn product(
    #[index] at: UVec2,
    #[local_id] local: UVec2,
    #[local_index] me: u32,
    #[shared] left: Shared<'_, f32, { TILE * TILE }>,
    #[shared] right: Shared<'_, f32, { TILE * TILE }>,
    #[storage] a: Buffer<'_, f32>,
    #[storage] b: Buffer<'_, f32>,
) -> f32 {
    let tile = TILE as u32;
    let mut sum = 0.0;
    let mut start = 0;
    while start < 24 {
        left.set(me, a.get(at.y * 24 + start + local.x));
        right.set(me, b.get((start + local.y) * 24 + at.x));
        barrier();
        let mut k = 0;
        while k < tile {
            sum += left.get(local.y * tile + k) * right.get(k * tile + local.x);
            k += 1;
        }
        barrier();
        start += tile;
    }
    sum
}

/// Counts the numbers of each workgroup by their two lowest bits, in shared counters, and finds the
/// smallest signed one.
#[kernel(compute, threads(64), range(x))]
pub fn group_histogram(
    #[local_index] me: u32,
    #[group_id] group: u32,
    #[shared] bins: SharedAtomics<'_, u32, 4>,
    #[shared] least: SharedAtomics<'_, i32, 1>,
    #[element] x: Option<u32>,
    #[storage] out: StorageMut<'_, u32>,
) {
    if me < 4 {
        bins.store(me, 0);
    }
    if me == 0 {
        least.store(0, 0x7fff_ffff);
    }
    barrier();
    if let Some(x) = x {
        bins.add(x & 3, 1);
        least.min(0, (x >> 1) as i32);
    }
    barrier();
    if me < 4 {
        out.set(group * 5 + me, bins.load(me));
    }
    if me == 4 {
        out.set(group * 5 + 4, least.load(0) as u32);
    }
}

/// The sum over the workgroup of what each invocation gives; all get it.
#[cooperative]
pub fn sum_of_group(me: u32, parts: Shared<'_, u32, 32>, mine: u32) -> u32 {
    parts.set(me, mine);
    let mut half = 16;
    while half > 0 {
        barrier();
        if me < half {
            parts.set(me, parts.get(me).wrapping_add(parts.get(me + half)));
        }
        half /= 2;
    }
    barrier();
    let sum = parts.get(0);
    barrier();
    sum
}

/// Three dimensions, a helper that waits, called twice, and every id there is.
#[kernel(compute, threads(4, 4, 2), range(9, 5, 3), cooperative(sum_of_group))]
pub fn places(
    #[index] at: UVec3,
    #[local_id] local: UVec3,
    #[local_index] me: u32,
    #[group_id] group: UVec3,
    #[group_count] groups: UVec3,
    #[shared] parts: Shared<'_, u32, 32>,
) -> u32 {
    let all = sum_of_group(me, parts, at.x + at.y + at.z);
    let number = (group.z * groups.y + group.y) * groups.x + group.x;
    let locals = sum_of_group(me, parts, local.x + 10 * local.y + 100 * local.z);
    all + 1000 * number + locals
}

/// Neighbours exchange through a buffer; the barrier is for storage.
#[kernel(compute, threads(32), range(out))]
pub fn neighbours(#[index] i: u32, #[local_index] me: u32, #[storage] out: StorageMut<'_, u32>) {
    let inside = i < out.len();
    if inside {
        out.set(i, i ^ 5);
    }
    storage_barrier();
    let next = if me < 31 && i + 1 < out.len() {
        i + 1
    } else {
        i
    };
    let mut value = 0;
    if inside {
        value = out.get(next);
    }
    storage_barrier();
    if inside {
        out.set(i, value);
    }
}
