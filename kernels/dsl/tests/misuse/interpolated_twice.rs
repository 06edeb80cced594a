#![allow(unused_imports)]
use hankel_dsl::{Centroid, Linear, SampleMask, glam::*, kernel};

/// Returns a value that is interpolated in two ways.
#[kernel(vertex)]
fn twice(#[attribute] position: Vec4) -> (Vec4, Centroid<Linear<f32>>) {
    (position, Centroid(Linear(position.x)))
}

fn main() {}
