#![allow(unused_imports)]
use hankel_dsl::{
    Atomics, Buffer, Element, Real, Sampler, Shared, StorageMut, Texture2d, barrier, cooperative,
    glam::*, kernel,
};

/// Doubles in place: two invocations could write the same element.
#[kernel(compute, threads(64))]
fn double(#[storage] x: &mut [f32]) -> f32 {
    x[0] = 2.0;
    x[0]
}

fn main() {}
