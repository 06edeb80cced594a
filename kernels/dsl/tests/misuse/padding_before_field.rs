#![allow(unused_imports)]
use hankel_dsl::{
    Atomics, Buffer, Element, Real, Sampler, Shared, StorageMut, Texture2d, barrier, cooperative,
    glam::*, kernel,
};

#[derive(Clone, Copy, Element)]
#[repr(C)]
struct Light {
    strength: f32,
    direction: Vec3,
}

fn main() {}
