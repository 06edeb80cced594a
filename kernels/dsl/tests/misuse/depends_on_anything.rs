#![allow(unused_imports)]
use hankel_dsl::{
    Atomics, Buffer, Element, Real, Sampler, Shared, StorageMut, Texture2d, barrier, cooperative,
    glam::*, kernel, subgroup_add,
};

/// Depends on the weather.
#[kernel(compute, threads(64), depends(weather))]
fn moody(#[element] x: Option<u32>) -> u32 {
    subgroup_add(x.unwrap_or(0))
}

fn main() {}
