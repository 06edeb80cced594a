//! Compaction: the elements that are wanted, without gaps, with one atomic operation a workgroup.

use hankel_dsl::{Atomics, Shared, StorageMut, barrier, kernel};

use crate::sort::sum_before;

/// Keeps the numbers above a threshold, in whatever order; the counter says how many.
#[kernel(compute, threads(256), range(x), cooperative(sum_before))]
pub fn compact_above(
    #[local_index] me: u32,
    #[shared] sums: Shared<'_, u32, 256>,
    #[shared] base: Shared<'_, u32, 1>,
    #[uniform]
    #[range(-0.5..=0.5)]
    threshold: &f32,
    #[element] x: Option<f32>,
    #[atomic] count: Atomics<'_>,
    #[storage(unordered)]
    #[length(x)]
    kept: StorageMut<'_, f32>,
) {
    let mut wanted = 0;
    let mut value = 0.0;
    if let Some(x) = x {
        value = x;
        if x > *threshold {
            wanted = 1;
        }
    }
    let before = sum_before(me, sums, wanted);
    if me == 255 {
        base.set(0, count.add(0, sums.get(me)));
    }
    barrier();
    if wanted == 1 {
        kept.set(base.get(0) + before, value);
    }
}
