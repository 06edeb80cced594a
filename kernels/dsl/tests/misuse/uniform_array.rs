#![allow(unused_imports)]
use hankel_dsl::{
    Atomics, Buffer, Element, Real, Sampler, Shared, StorageMut, Texture2d, barrier, cooperative,
    glam::*, kernel,
};

#[derive(Clone, Copy, Element)]
#[repr(C)]
struct Weights {
    all: [f32; 4],
}

/// A sum.
#[kernel(compute, threads(64))]
fn sum(#[uniform] weights: &Weights, #[element] x: f32) -> f32 {
    x * weights.all[0]
}

fn main() {}
