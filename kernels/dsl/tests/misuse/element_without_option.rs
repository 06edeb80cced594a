#![allow(unused_imports)]
use hankel_dsl::{
    Atomics, Buffer, Element, Real, Sampler, Shared, StorageMut, Texture2d, barrier, cooperative,
    glam::*, kernel,
};

/// Reads a neighbour.
#[kernel(compute, threads(64))]
fn neighbour(
    #[local_index] me: u32,
    #[shared] slots: Shared<'_, f32, 64>,
    #[element] x: f32,
) -> f32 {
    slots.set(me, x);
    barrier();
    slots.get(me ^ 1)
}

fn main() {}
