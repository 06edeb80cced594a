#![allow(unused_imports)]
use hankel_dsl::{
    Atomics, Buffer, Element, Real, Sampler, Shared, StorageMut, Texture2d, barrier, cooperative,
    glam::*, kernel,
};

#[derive(Clone, Copy, Element)]
#[repr(C)]
struct Counted<R> {
    x: R,
    count: u32,
    more: u32,
}

/// Counts.
#[kernel(compute, threads(64))]
fn count<R: Real>(#[element] x: Counted<R>) -> Counted<R> {
    x
}

fn main() {}
