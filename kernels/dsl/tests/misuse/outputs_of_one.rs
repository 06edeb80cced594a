#![allow(unused_imports)]
use hankel_dsl::{
    Atomics, Buffer, Element, Real, Sampler, Shared, StorageMut, Texture2d, barrier, cooperative,
    glam::*, kernel,
};

/// A colour.
#[kernel(compute, threads(8, 8), outputs(rgba8unorm))]
fn colour(#[index] at: UVec2) -> Vec4 {
    Vec4::ONE
}

fn main() {}
