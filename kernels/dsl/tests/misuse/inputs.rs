//! Attributes about inputs that say nothing, or twice, or of what is not there.
#![allow(unused_imports)]
use hankel_dsl::glam::Vec2;
use hankel_dsl::{Buffer, Element, Sampler, Texture2d, kernel};

#[derive(Clone, Copy, Element)]
#[repr(C)]
pub struct Twice {
    #[range(0.0..=1.0)]
    #[values(1, 2)]
    pub x: f32,
}

#[derive(Clone, Copy, Element)]
#[repr(C)]
pub struct Open {
    #[range(0.0..1.0)]
    pub x: f32,
}

/// A length that refers to nothing.
#[kernel(compute, threads(64))]
pub fn unknown(
    #[element] x: f32,
    #[storage]
    #[length(tabel)]
    table: Buffer<'_, f32>,
) -> f32 {
    x + table.get(0)
}

/// A sampler has no numbers.
#[kernel(compute, threads(64), parity(absolute = 1e-2, why = "weights may be rounded"))]
pub fn nothing(
    #[element] uv: Vec2,
    #[texture] source: Texture2d<'_>,
    #[sampler]
    #[range(0..=1)]
    sampler: Sampler,
) -> f32 {
    source.sample_level(sampler, uv, 0.0).x
}

/// A default of what is read for each invocation.
#[kernel(compute, threads(64))]
pub fn default(
    #[element]
    #[default(1.0)]
    x: f32,
) -> f32 {
    x
}

/// Two words for rounding.
#[kernel(compute, threads(64), exact, pinned)]
pub fn both(#[element] x: f32) -> f32 {
    x
}

fn main() {}
