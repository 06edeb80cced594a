//! A shadow over a whole picture: places from depths, a shadow map through a comparison sampler, and a
//! bias along the receiver's own plane, from derivatives (Isidoro, Shadow Mapping: GPU-based Tips and
//! Techniques, 2006).

use hankel_dsl::glam::{UVec2, Vec2, Vec3, Vec4};
use hankel_dsl::{
    ComparisonSampler, DepthTexture2d, Element, Real, Texture2d, dpdx, dpdy, kernel, to_i32,
};

/// From the picture to the light.
#[derive(Clone, Copy, Debug, PartialEq, Element)]
#[repr(C)]
pub struct Light {
    /// Columns of the matrix from texture coordinates and depth of the picture to those of the shadow
    /// map, which is orthographic: the fourth coordinate stays 1.
    pub to_map: [Vec4; 4],
    /// What is taken off the depth beside the plane's own bias.
    #[range(0.0..=0.01)]
    pub bias: f32,
    /// How far apart the nine taps are, in texels of the map.
    #[range(0.5..=2.0)]
    pub spread: f32,
    /// Fills the structure up.
    pub padding: Vec2,
}

/// How much of the light comes to each pixel, 0 to 1: the mean of nine comparisons that are filtered
/// themselves.
#[kernel(
    fragment,
    pinned,
    parity(
        ulp = 16,
        absolute = 1e-5,
        non_finite,
        why = "the weights of a sum of nine; planes of absurd depths overflow"
    )
)]
pub fn shadow_lit(
    #[frag_coord] at: Vec3,
    #[uniform] light: &Light,
    #[texture]
    #[size(64, 32)]
    depths: Texture2d<'_>,
    #[texture]
    #[size(32, 32)]
    map: DepthTexture2d<'_>,
    #[sampler] sampler: ComparisonSampler,
) -> f32 {
    let texels = depths.size();
    let size = Vec2::new(texels.x as f32, texels.y as f32);
    let x = to_i32(Real::clamp(at.x, 0.0, size.x - 1.0)) as u32;
    let y = to_i32(Real::clamp(at.y, 0.0, size.y - 1.0)) as u32;
    let uv = Vec2::new(at.x, at.y) / size;
    let depth = depths.load(UVec2::new(x, y)).x;
    let m = &light.to_map;
    let place = (m[0] * uv.x + m[1] * uv.y + (m[2] * depth + m[3])).truncate();
    // The plane z = p · (u, v) through this pixel and its neighbours.
    let (dx, dy) = (dpdx(place), dpdy(place));
    let area = dx.x * dy.y - dx.y * dy.x;
    let mut plane = Vec2::ZERO;
    if Real::abs(area) > 1e-12 {
        plane = Vec2::new(dy.y * dx.z - dx.y * dy.z, dx.x * dy.z - dy.x * dx.z) / area;
    }
    let of_map = map.size();
    let step = Vec2::new(light.spread / of_map.x as f32, light.spread / of_map.y as f32);
    let mut sum = 0.0;
    let mut i = 0;
    while i < 9 {
        let aside = Vec2::new((i % 3) as f32 - 1.0, (i / 3) as f32 - 1.0) * step;
        let reference = Real::saturate(place.z + plane.dot(aside) - light.bias);
        sum += map.compare(sampler, place.truncate() + aside, reference);
        i += 1;
    }
    sum * (1.0 / 9.0)
}
