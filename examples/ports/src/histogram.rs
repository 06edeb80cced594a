//! A histogram through counters in workgroup memory: buffers are reached once a bin and workgroup.

use hankel_dsl::{Atomics, Real, SharedAtomics, barrier, kernel, to_i32};

/// How many numbers lie in each of 256 equal parts of 0 to 1. What lies outside counts in the first or
/// the last part.
#[kernel(compute, threads(256), range(x))]
pub fn histogram(
    #[local_index] me: u32,
    #[shared] bins: SharedAtomics<'_, u32, 256>,
    #[element]
    #[range(0.0..=1.0)]
    x: Option<f32>,
    #[atomic] counts: Atomics<'_>,
) {
    bins.store(me, 0);
    barrier();
    if let Some(x) = x {
        bins.add(to_i32(Real::clamp(x * 256.0, 0.0, 255.0)) as u32, 1);
    }
    barrier();
    let count = bins.load(me);
    if count > 0 {
        counts.add(me, count);
    }
}
