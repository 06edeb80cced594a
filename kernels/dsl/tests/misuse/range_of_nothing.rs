#![allow(unused_imports)]
use hankel_dsl::{
    Atomics, Buffer, Element, Real, Sampler, Shared, StorageMut, Texture2d, barrier, cooperative,
    glam::*, kernel,
};

/// The index.
#[kernel(compute, threads(64), range(size))]
fn index(#[index] at: u32) -> u32 {
    at
}

fn main() {}
