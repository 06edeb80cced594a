#![allow(unused_imports)]
use hankel_dsl::{Centroid, Linear, SampleMask, glam::*, kernel};

/// Takes an integer between vertices.
#[kernel(fragment)]
fn between(#[varying] id: Centroid<u32>) -> u32 {
    id.0
}

fn main() {}
