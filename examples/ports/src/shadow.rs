//! A shadow map through a comparison sampler, and a bias along the receiver's own plane, which
//! derivatives find (Isidoro, Shadow Mapping: GPU-based Tips and Techniques, 2006).

use hankel_dsl::glam::{Vec2, Vec3, Vec4};
use hankel_dsl::{ComparisonSampler, DepthTexture2d, Element, Real, dpdx, dpdy, kernel};

/// From the world to the picture and to the shadow map.
#[derive(Clone, Copy, Debug, PartialEq, Element)]
#[repr(C)]
pub struct Views {
    /// Columns of the matrix from the world to clip space.
    pub to_clip: [Vec4; 4],
    /// Columns of the matrix from the world to the shadow map's texture coordinates and depth. The light
    /// is directional: the fourth coordinate stays 1.
    pub to_map: [Vec4; 4],
}

/// How the shadow map is read.
#[derive(Clone, Copy, Debug, PartialEq, Element)]
#[repr(C)]
pub struct Reading {
    /// What is taken off the depth beside the plane's own bias.
    #[range(0.0..=0.01)]
    pub bias: f32,
    /// How far apart the nine taps are, in texels of the map.
    #[range(0.5..=2.0)]
    pub spread: f32,
}

/// A vertex of a receiver: where it is in the picture and in the shadow map.
#[kernel(
    vertex,
    pinned,
    parity(non_finite, why = "sums and products of absurd numbers overflow")
)]
pub fn shadow_vertex(#[attribute] position: Vec3, #[uniform] views: &Views) -> (Vec4, Vec3) {
    let by = |m: &[Vec4; 4]| m[0] * position.x + m[1] * position.y + m[2] * position.z + m[3];
    (by(&views.to_clip), by(&views.to_map).truncate())
}

/// How much of the light comes to a fragment, 0 to 1: the mean of nine comparisons that are filtered
/// themselves. `place` is the fragment in the shadow map: texture coordinates and depth.
#[kernel(
    fragment,
    parity(
        ulp = 16,
        absolute = 1e-5,
        why = "the sum of nine comparisons is formed in any order"
    )
)]
pub fn shadow_lit(
    #[varying]
    #[range(0.0..=1.0)]
    place: Vec3,
    #[uniform] reading: &Reading,
    #[texture]
    #[size(32, 32)]
    map: DepthTexture2d<'_>,
    #[sampler]
    #[filter(nearest)]
    sampler: ComparisonSampler,
) -> f32 {
    // The plane z = p · (u, v) through this fragment and its neighbours.
    let (dx, dy) = (dpdx(place), dpdy(place));
    let area = dx.x * dy.y - dx.y * dy.x;
    let mut plane = Vec2::ZERO;
    if Real::abs(area) > 1e-12 {
        plane = Vec2::new(dy.y * dx.z - dx.y * dy.z, dx.x * dy.z - dy.x * dx.z) / area;
    }
    let texels = map.size();
    let step = Vec2::new(
        reading.spread / texels.x as f32,
        reading.spread / texels.y as f32,
    );
    let mut sum = 0.0;
    let mut i = 0;
    while i < 9 {
        let aside = Vec2::new((i % 3) as f32 - 1.0, (i / 3) as f32 - 1.0) * step;
        let reference = Real::saturate(place.z + plane.dot(aside) - reading.bias);
        sum += map.compare(sampler, place.truncate() + aside, reference);
        i += 1;
    }
    sum * (1.0 / 9.0)
}
