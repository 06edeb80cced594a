#![allow(unused_imports)]
use hankel_dsl::{
    Atomics, Buffer, Element, Real, Sampler, Shared, StorageMut, Texture2d, barrier, cooperative,
    glam::*, kernel, subgroup_add,
};

/// Asks for its subgroup.
#[kernel(fragment)]
fn ask(#[subgroup_size] size: u32) -> Vec4 {
    Vec4::splat(size as f32)
}

fn main() {}
