#![allow(unused_imports)]
use hankel_dsl::{
    Atomics, Buffer, Element, Real, Sampler, Shared, StorageMut, Texture2d, barrier, cooperative,
    glam::*, kernel, subgroup_add,
};

/// Has no such form.
#[kernel(compute, threads(8, 8), texture(r32float), forms(vertex))]
fn none(#[index] at: UVec2) -> f32 {
    at.x as f32
}

fn main() {}
