#![allow(unused_imports)]
use hankel_dsl::{
    Atomics, Buffer, Element, Real, Sampler, Shared, StorageMut, Texture2d, barrier, cooperative,
    glam::*, kernel, subgroup_add,
};

/// Says that it depends on what it does not use.
#[kernel(compute, threads(64), depends(subgroup_size))]
fn plain(#[element] x: u32) -> u32 {
    x
}

fn main() {}
