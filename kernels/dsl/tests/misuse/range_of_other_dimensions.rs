#![allow(unused_imports)]
use hankel_dsl::{
    Atomics, Buffer, Element, Real, Sampler, Shared, StorageMut, Texture2d, barrier, cooperative,
    glam::*, kernel,
};

/// The index.
#[kernel(compute, threads(8, 8), range(64))]
fn index(#[index] at: UVec2) -> u32 {
    at.x
}

fn main() {}
