#![allow(unused_imports)]
use hankel_dsl::{
    Atomics, Buffer, Element, Real, Sampler, Shared, StorageMut, Texture2d, barrier, cooperative,
    glam::*, kernel,
};

/// Doubles.
#[kernel(compute, threads(64), precision(f32, f64))]
fn double<R: Real>(#[element] x: Option<R>) -> R {
    barrier();
    x.unwrap_or(R::literal::<0>())
}

fn main() {}
