#![allow(unused_imports)]
use hankel_dsl::{
    Atomics, Buffer, Element, Real, Sampler, Shared, StorageMut, Texture2d, barrier, cooperative,
    glam::*, kernel,
};

/// Writes to another invocation's element.
#[kernel(compute, threads(64))]
fn scatter(#[storage] x: Buffer<'_, f32>, #[index] i: u32) -> f32 {
    x[(i + 1) as usize] = 1.0;
    x.get(i)
}

fn main() {}
