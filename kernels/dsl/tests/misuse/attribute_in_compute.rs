#![allow(unused_imports)]
use hankel_dsl::{
    Atomics, Buffer, Element, Real, Sampler, Shared, StorageMut, Texture2d, barrier, cooperative,
    glam::*, kernel,
};

/// A vertex where there is none.
#[kernel(compute, threads(64))]
fn vertex(#[attribute] x: f32) -> f32 {
    x
}

fn main() {}
