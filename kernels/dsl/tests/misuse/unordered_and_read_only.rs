#![allow(unused_imports)]
use hankel_dsl::{
    Atomics, Buffer, Element, Real, Sampler, Shared, StorageMut, Texture2d, barrier, cooperative,
    glam::*, kernel,
};

/// Reads a table in no order.
#[kernel(compute, threads(64))]
fn look_up(#[storage(unordered)] table: Buffer<'_, f32>, #[element] at: u32) -> f32 {
    table.get(at)
}

fn main() {}
