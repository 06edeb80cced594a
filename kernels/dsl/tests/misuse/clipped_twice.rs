#![allow(unused_imports)]
use hankel_dsl::{ClipDistances, glam::*, kernel};

/// Between two planes.
#[kernel(vertex)]
fn clipped(#[attribute] position: Vec4) -> (Vec4, ClipDistances<1>, ClipDistances<1>) {
    (position, ClipDistances([position.x]), ClipDistances([position.y]))
}

fn main() {}
