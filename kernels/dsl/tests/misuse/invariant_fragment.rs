#![allow(unused_imports)]
use hankel_dsl::{glam::*, kernel};

/// A colour.
#[kernel(fragment, invariant)]
fn colour(#[varying] light: Vec4) -> Vec4 {
    light
}

fn main() {}
