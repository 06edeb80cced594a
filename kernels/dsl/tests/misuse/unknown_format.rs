#![allow(unused_imports)]
use hankel_dsl::{
    Atomics, Buffer, Element, Real, Sampler, Shared, StorageMut, Texture2d, barrier, cooperative,
    glam::*, kernel,
};

/// White.
#[kernel(compute, threads(8, 8), texture(rgba13float))]
fn white(#[index] at: UVec2) -> Vec4 {
    Vec4::ONE
}

fn main() {}
