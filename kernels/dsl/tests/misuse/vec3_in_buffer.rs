#![allow(unused_imports)]
use hankel_dsl::{
    Atomics, Buffer, Element, Real, Sampler, Shared, StorageMut, Texture2d, barrier, cooperative,
    glam::*, kernel,
};

/// The nearest corner.
#[kernel(compute, threads(64))]
fn nearest(#[storage] corners: Buffer<'_, Vec3>, #[element] i: u32) -> f32 {
    corners.get(i).x
}

fn main() {}
