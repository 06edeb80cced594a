#![allow(unused_imports)]
use hankel_dsl::{
    Atomics, Buffer, Element, Real, Sampler, Shared, StorageMut, Texture2d, barrier, cooperative,
    glam::*, kernel,
};

/// The index.
#[kernel(compute, threads(8, 8), range(x))]
fn index(#[index] at: UVec2, #[storage] x: StorageMut<'_, u32>) {
    x.set(at.x, at.y);
}

fn main() {}
