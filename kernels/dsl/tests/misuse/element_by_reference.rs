#![allow(unused_imports)]
use hankel_dsl::{
    Atomics, Buffer, Element, Real, Sampler, Shared, StorageMut, Texture2d, barrier, cooperative,
    glam::*, kernel,
};

/// Doubles.
#[kernel(compute, threads(64))]
fn double(#[element] x: &f32) -> f32 {
    2.0 * *x
}

fn main() {}
