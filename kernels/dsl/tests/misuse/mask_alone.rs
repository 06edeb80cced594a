#![allow(unused_imports)]
use hankel_dsl::{Centroid, Linear, SampleMask, glam::*, kernel};

/// Masks nothing.
#[kernel(fragment)]
fn masked(#[varying] id: u32) -> SampleMask {
    SampleMask(id)
}

fn main() {}
