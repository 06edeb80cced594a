#![allow(unused_imports)]
use hankel_dsl::{Atomics, Buffer, Element, Group, Real, Sampler, Texture2d, glam::*, kernel};

/// Reads a neighbour.
#[kernel(compute, threads(64), phases(1))]
fn neighbour(#[group] slots: Group<'_, f32, 32>, #[element] x: Option<f32>) -> f32 {
    slots.get(1) + x.unwrap_or(0.0)
}

fn main() {}
