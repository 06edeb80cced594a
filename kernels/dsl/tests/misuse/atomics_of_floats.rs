#![allow(unused_imports)]
use hankel_dsl::{
    Atomics, Buffer, Element, Real, Sampler, Shared, StorageMut, Texture2d, barrier, cooperative,
    glam::*, kernel,
};

/// Adds.
#[kernel(compute, threads(64))]
fn add(#[element] x: f32, #[atomic] sums: Atomics<'_, f32>) {
    sums.add(0, x);
}

fn main() {}
