#![allow(unused_imports)]
use hankel_dsl::{
    Atomics, Buffer, Element, Real, Sampler, Shared, StorageMut, Texture2d, barrier, cooperative,
    glam::*, kernel, subgroup_add,
};

/// Adds without an `Option`.
#[kernel(compute, threads(64))]
fn add(#[element] x: u32) -> u32 {
    subgroup_add(x)
}

fn main() {}
