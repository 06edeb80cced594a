#![allow(unused_imports)]
use hankel_dsl::{
    Atomics, Buffer, Element, Real, Sampler, Shared, StorageMut, Texture2d, barrier, cooperative,
    glam::*, kernel, subgroup_add,
};

/// Writes no texel.
#[kernel(compute, threads(64), forms(fragment))]
fn add(#[element] x: f32) -> f32 {
    x + 1.0
}

fn main() {}
