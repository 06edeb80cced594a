#![allow(unused_imports)]
use hankel_dsl::{
    Atomics, Buffer, Element, Real, Sampler, Shared, StorageMut, Texture2d, barrier, cooperative,
    glam::*, kernel,
};

/// Shares.
#[kernel(compute, threads(64), range(64))]
fn share(#[shared] slots: Shared<'_, f32>) -> f32 {
    slots.get(0)
}

fn main() {}
