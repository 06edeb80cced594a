#![allow(unused_imports)]
use hankel_dsl::{
    Atomics, Buffer, Element, Real, Sampler, Shared, StorageMut, Texture2d, barrier, cooperative,
    glam::*, kernel,
};

/// Adds.
#[cooperative]
fn add(a: f32, b: f32) -> f32 {
    a + b
}

fn main() {}
