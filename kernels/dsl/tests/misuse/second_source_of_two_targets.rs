#![allow(unused_imports)]
use hankel_dsl::{SecondSource, glam::*, kernel};

/// Glass.
#[kernel(fragment)]
fn glass(#[varying] light: Vec4) -> (Vec4, Vec4, SecondSource<Vec4>) {
    (light, light, SecondSource(light))
}

fn main() {}
