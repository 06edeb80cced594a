//! Attributes of textures and samplers that say what is not there.
#![allow(unused_imports)]
use hankel_dsl::glam::{UVec2, Vec2, Vec4};
use hankel_dsl::{Sampler, Texture1d, Texture2d, Texture2dArray, TextureCube, kernel};

/// Levels of what has one.
#[kernel(compute, threads(8, 8), texture(rgba32float))]
pub fn levels(
    #[index] at: UVec2,
    #[texture]
    #[levels(2)]
    source: Texture1d<'_>,
) -> Vec4 {
    source.load(at.x)
}

/// More levels than there are.
#[kernel(compute, threads(8, 8), texture(rgba32float))]
pub fn too_many(
    #[index] at: UVec2,
    #[texture]
    #[size(9, 4)]
    #[levels(5)]
    source: Texture2d<'_>,
) -> Vec4 {
    source.load(at)
}

/// Layers of a texture that has none.
#[kernel(compute, threads(8, 8), texture(rgba32float))]
pub fn layers(
    #[index] at: UVec2,
    #[texture]
    #[layers(2)]
    source: Texture2d<'_>,
) -> Vec4 {
    source.load(at)
}

/// A size with the layers in it.
#[kernel(compute, threads(8, 8), texture(rgba32float))]
pub fn size(
    #[index] at: UVec2,
    #[texture]
    #[size(8, 8, 3)]
    source: Texture2dArray<'_>,
) -> Vec4 {
    source.load(at, 0)
}

/// Faces that are no squares.
#[kernel(compute, threads(64))]
pub fn face(
    #[element] at: f32,
    #[texture]
    #[size(8, 4)]
    source: TextureCube<'_>,
    #[sampler] sampler: Sampler,
) -> f32 {
    source.size().x as f32 * at
}

/// A filter of a texture.
#[kernel(compute, threads(8, 8), texture(rgba32float))]
pub fn filter(
    #[index] at: UVec2,
    #[texture]
    #[filter(nearest)]
    source: Texture2d<'_>,
) -> Vec4 {
    source.load(at)
}

/// A comparison of a sampler that makes none.
#[kernel(compute, threads(64))]
pub fn compare(
    #[element] uv: Vec2,
    #[texture] source: Texture2d<'_>,
    #[sampler]
    #[compare(less)]
    sampler: Sampler,
) -> f32 {
    source.sample_level(sampler, uv, 0.0).x
}

/// An address mode that WebGPU does not have.
#[kernel(compute, threads(64))]
pub fn border(
    #[element] uv: Vec2,
    #[texture] source: Texture2d<'_>,
    #[sampler]
    #[address(clamp_to_border)]
    sampler: Sampler,
) -> f32 {
    source.sample_level(sampler, uv, 0.0).x
}

/// A sampler that is a texture.
#[kernel(compute, threads(64))]
pub fn kind(#[element] uv: Vec2, #[sampler] source: Texture2d<'_>) -> f32 {
    uv.x
}

fn main() {}
