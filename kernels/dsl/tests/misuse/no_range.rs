#![allow(unused_imports)]
use hankel_dsl::{
    Atomics, Buffer, Element, Real, Sampler, Shared, StorageMut, Texture2d, barrier, cooperative,
    glam::*, kernel,
};

/// Writes ones.
#[kernel(compute, threads(64))]
fn ones(#[index] i: u32, #[storage] out: StorageMut<'_, u32>) {
    out.set(i, 1);
}

fn main() {}
