#![allow(unused_imports)]
use hankel_dsl::{
    Atomics, Buffer, Element, Real, Sampler, Shared, StorageMut, Texture2d, barrier, cooperative,
    glam::*, kernel,
};

/// A sample.
#[kernel(compute, threads(64))]
fn sample(#[element] uv: Vec2, #[texture] map: Texture2d<'_>, #[sampler] sampler: Sampler) -> f32 {
    map.sample(sampler, uv).x
}

fn main() {}
