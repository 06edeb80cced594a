#![allow(unused_imports)]
use hankel_dsl::{Atomics, Buffer, Element, Group, Real, Sampler, Texture2d, glam::*, kernel};

/// A vertex where there is none.
#[kernel(compute, threads(64))]
fn vertex(#[attribute] x: f32) -> f32 {
    x
}

fn main() {}
