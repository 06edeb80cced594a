#![allow(unused_imports)]
use hankel_dsl::{
    Atomics, Buffer, Element, Real, Sampler, Shared, StorageMut, Texture2d, barrier, cooperative,
    glam::*, kernel,
};

#[derive(Clone, Copy, Element)]
struct Light {
    strength: f32,
}

fn main() {}
