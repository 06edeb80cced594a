#![allow(unused_imports)]
use hankel_dsl::{
    Atomics, Buffer, Element, Real, Sampler, Shared, StorageMut, Texture2d, barrier, cooperative,
    glam::*, kernel,
};

/// Shares.
#[kernel(fragment)]
fn share(#[shared] slots: Shared<'_, f32, 64>) -> Vec4 {
    Vec4::splat(slots.get(0))
}

fn main() {}
