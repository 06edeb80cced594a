#![allow(unused_imports)]
use hankel_dsl::{
    Atomics, Buffer, Element, Real, Sampler, Shared, StorageMut, Texture2d, barrier, cooperative,
    glam::*, kernel,
};

/// Doubles in place.
#[kernel(compute, threads(64))]
fn double(#[element] x: &mut f32) {
    barrier();
    *x *= 2.0;
}

fn main() {}
