#![allow(unused_imports)]
use hankel_dsl::{
    Atomics, Buffer, Element, Real, Sampler, Shared, StorageMut, Texture2d, barrier, cooperative,
    glam::*, kernel,
};

/// Dangerous.
#[kernel(compute, threads(64))]
unsafe fn dangerous(#[element] x: f32) -> f32 {
    x
}

fn main() {}
