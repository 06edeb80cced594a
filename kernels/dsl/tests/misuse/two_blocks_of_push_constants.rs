#![allow(unused_imports)]
use hankel_dsl::{
    Atomics, Buffer, Element, Real, Sampler, Shared, StorageMut, Texture2d, barrier, cooperative,
    glam::*, kernel,
};

/// Has two.
#[kernel(compute, threads(64))]
fn two(#[push] a: &Vec4, #[push] b: &Vec4, #[element] x: Vec4) -> Vec4 {
    x * *a + *b
}

fn main() {}
