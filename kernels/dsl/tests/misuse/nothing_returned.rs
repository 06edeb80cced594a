#![allow(unused_imports)]
use hankel_dsl::{Atomics, Buffer, Element, Group, Real, Sampler, Texture2d, glam::*, kernel};

/// Nothing.
#[kernel(compute, threads(64))]
fn nothing(#[element] x: f32) {}

fn main() {}
