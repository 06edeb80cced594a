#![allow(unused_imports)]
use hankel_dsl::{
    Atomics, Buffer, Element, Real, Sampler, Shared, StorageMut, Texture2d, barrier, cooperative,
    glam::*, kernel,
};

/// Too many.
#[derive(Clone, Copy, Element)]
#[repr(C)]
struct Many {
    /// Numbers.
    numbers: [Vec4; 9],
}

/// Has 144 bytes.
#[kernel(compute, threads(64))]
fn many(#[push] all: &Many, #[element] x: Vec4) -> Vec4 {
    x * all.numbers[0]
}

fn main() {}
