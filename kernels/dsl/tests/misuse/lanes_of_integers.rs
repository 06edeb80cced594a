#![allow(unused_imports)]
use hankel_dsl::{Atomics, Buffer, Element, Group, Real, Sampler, Texture2d, glam::*, kernel};

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
