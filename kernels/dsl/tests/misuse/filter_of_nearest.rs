#![allow(unused_imports)]
use hankel_dsl::{DepthTexture2d, NonFilteringSampler, glam::*, kernel};

/// A depth.
#[kernel(fragment)]
fn depth(
    #[frag_coord] at: Vec3,
    #[texture] depths: DepthTexture2d<'_>,
    #[sampler]
    #[filter(linear)]
    sampler: NonFilteringSampler,
) -> f32 {
    depths.sample(sampler, at.truncate())
}

fn main() {}
