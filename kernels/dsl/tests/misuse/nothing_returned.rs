#![allow(unused_imports)]
use hankel_dsl::{
    Atomics, Buffer, Element, Real, Sampler, Shared, StorageMut, Texture2d, barrier, cooperative,
    glam::*, kernel,
};

/// Nothing.
#[kernel(compute, threads(64))]
fn nothing(#[element] x: f32) {}

fn main() {}
