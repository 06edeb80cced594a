#![allow(unused_imports)]
use hankel_dsl::{Atomics, Buffer, Element, Group, Real, Sampler, Texture2d, glam::*, kernel};

/// Reads a neighbour.
#[kernel(compute, threads(64))]
fn neighbour(#[group] slots: Group<'_, f32, 64>, #[element] x: f32) -> f32 {
    slots.get(1) + x
}

fn main() {}
