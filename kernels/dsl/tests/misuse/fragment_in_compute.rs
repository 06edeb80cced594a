#![allow(unused_imports)]
use hankel_dsl::glam::Vec3;
use hankel_dsl::kernel;

/// A compute kernel that asks for its pixel.
#[kernel(compute, threads(64))]
fn height(#[frag_coord] at: Vec3, #[element] x: f32) -> f32 {
    at.y + x
}

fn main() {}
