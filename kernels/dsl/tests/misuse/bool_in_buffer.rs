#![allow(unused_imports)]
use hankel_dsl::{Atomics, Buffer, Element, Group, Real, Sampler, Texture2d, glam::*, kernel};

#[derive(Clone, Copy, Element)]
#[repr(C)]
struct Switch {
    on: bool,
}

fn main() {}
