//! Depths, and samplers that compare with them.

use hankel_dsl::glam::{UVec2, Vec2, Vec3, Vec4};
use hankel_dsl::{
    ComparisonSampler, DepthTexture2d, DepthTexture2dArray, DepthTexture2dMultisampled,
    DepthTextureCube, DepthTextureCubeArray, NonFilteringSampler, kernel,
};

/// Which texels are behind the reference.
#[kernel(
    compute,
    threads(64),
    parity(
        ulp = 0,
        absolute = 1e-3,
        why = "0 or 1, but drivers may take subnormal depths for 0"
    )
)]
pub fn lit(
    #[index] i: u32,
    #[element]
    #[range(0.0..=1.0)]
    reference: f32,
    #[texture]
    #[size(64, 32)]
    depths: DepthTexture2d<'_>,
    #[sampler]
    #[filter(nearest)]
    #[address(repeat)]
    sampler: ComparisonSampler,
) -> f32 {
    let middle = Vec2::new((i % 64) as f32 + 0.5, (i / 64) as f32 + 0.5);
    depths.compare_level_zero(
        sampler,
        middle * Vec2::new(1.0 / 64.0, 1.0 / 32.0),
        reference,
    )
}

/// How much of the four nearest texels is in front of the reference.
#[kernel(compute, threads(64))]
pub fn soft(
    #[element]
    #[range(0.0..=1.0)]
    at: Vec4,
    #[texture] depths: DepthTexture2d<'_>,
    #[sampler]
    #[compare(greater)]
    sampler: ComparisonSampler,
) -> f32 {
    depths.compare_level_zero(sampler, Vec2::new(at.x, at.y), at.z)
}

/// Which of the four texels around a corner are behind the middle depth.
#[kernel(compute, threads(8, 8), texture(rgba32float))]
pub fn four_lit(
    #[index] at: UVec2,
    #[texture]
    #[size(32, 16)]
    depths: DepthTexture2d<'_>,
    #[sampler]
    #[compare(less)]
    #[address(repeat)]
    sampler: ComparisonSampler,
) -> Vec4 {
    let corner = Vec2::new(at.x as f32 / 32.0, at.y as f32 / 16.0);
    depths.gather_compare(sampler, corner, 0.5)
}

/// The same in each layer in turn, and one layer filtered.
#[kernel(compute, threads(8, 8), texture(rgba32float))]
pub fn layers_lit(
    #[index] at: UVec2,
    #[texture]
    #[size(32, 16)]
    depths: DepthTexture2dArray<'_>,
    #[sampler]
    #[compare(greater_equal)]
    #[address(repeat)]
    sampler: ComparisonSampler,
) -> Vec4 {
    let corner = Vec2::new(at.x as f32 / 32.0, at.y as f32 / 16.0);
    let four = depths.gather_compare(sampler, corner, at.x % 3, 0.5);
    let place = Vec2::new(at.x as f32 / 37.0, at.y as f32 / 21.0);
    let lit = depths.compare_level_zero(sampler, place, at.x % 3, 0.25);
    Vec4::new(four.x, four.y + four.z, four.w, lit)
}

/// Depths as they are, of a level and of a layer: the larger of two.
#[kernel(
    compute,
    threads(8, 8),
    texture(r32float),
    parity(
        ulp = 0,
        absolute = 1e-30,
        why = "drivers may take subnormal depths for 0 where they are drawn"
    )
)]
pub fn deepest(
    #[index] at: UVec2,
    #[texture]
    #[levels(3)]
    depths: DepthTexture2d<'_>,
    #[texture]
    #[size(16, 8)]
    layers: DepthTexture2dArray<'_>,
) -> f32 {
    let level = at.y % 3;
    let (size, own) = (depths.level_size(level), layers.size());
    let near = depths.load_level(UVec2::new(at.x % size.x, at.y % size.y), level);
    let far = layers.load(UVec2::new(at.x % own.x, at.y % own.y), level);
    if near > far { near } else { far }
}

/// Which texels around a light hide what lies in their direction, by the level that neighbouring
/// fragments make of a layer, too.
#[kernel(fragment)]
pub fn hidden(
    #[frag_coord] at: Vec3,
    #[texture]
    #[size(8, 8)]
    around: DepthTextureCube<'_>,
    #[texture]
    #[size(32, 32)]
    #[levels(3)]
    layers: DepthTexture2dArray<'_>,
    #[sampler]
    #[mip_filter(nearest)]
    #[address(mirror_repeat)]
    sampler: ComparisonSampler,
) -> Vec4 {
    // Across edges of the cube, but not its corners: what lies beyond those is left open.
    let to = Vec3::new(at.x - 31.75, (at.y - 8.0) * 0.25, 5.0);
    let uv = Vec2::new(at.x * 1.681_792_8 / 32.0, at.y / 32.0);
    Vec4::new(
        around.compare_level_zero(sampler, to, 0.5),
        layers.compare(sampler, uv, 1, 0.5),
        0.0,
        1.0,
    )
}

/// The same around each of several lights: which texels of its cube hide what lies in their direction.
#[kernel(fragment)]
pub fn cubes_lit(
    #[frag_coord] at: Vec3,
    #[texture]
    #[size(8, 8)]
    #[layers(2)]
    lights: DepthTextureCubeArray<'_>,
    #[sampler]
    #[mip_filter(nearest)]
    sampler: ComparisonSampler,
) -> Vec4 {
    let light = at.x as u32 % lights.cubes();
    let to = Vec3::new(at.x - 31.75, (at.y - 8.0) * 0.25, 5.0);
    Vec4::new(
        lights.compare_level_zero(sampler, to, light, 0.5),
        light as f32,
        0.0,
        1.0,
    )
}

/// Percentage-closer filtering of four texels around a place, by offsets, and which texels of another corner are lit.
#[kernel(compute, threads(8, 8), texture(rgba32float))]
pub fn four_by_offsets(
    #[index] at: UVec2,
    #[texture]
    #[size(32, 16)]
    depths: DepthTexture2d<'_>,
    #[texture]
    #[size(32, 16)]
    layers: DepthTexture2dArray<'_>,
    #[sampler]
    #[filter(nearest)]
    #[compare(less)]
    #[address(repeat)]
    sampler: ComparisonSampler,
) -> Vec4 {
    let uv = Vec2::new((at.x as f32 + 0.5) / 32.0, (at.y as f32 + 0.5) / 16.0);
    let sum = depths
        .shifted::<-1, -1>()
        .compare_level_zero(sampler, uv, 0.5)
        + depths
            .shifted::<1, -1>()
            .compare_level_zero(sampler, uv, 0.5)
        + depths
            .shifted::<-1, 1>()
            .compare_level_zero(sampler, uv, 0.5)
        + depths
            .shifted::<1, 1>()
            .compare_level_zero(sampler, uv, 0.5);
    let layer = layers
        .shifted::<2, 0>()
        .compare_level_zero(sampler, uv, at.x % 3, 0.25);
    let corner = Vec2::new(at.x as f32 / 32.0, at.y as f32 / 16.0);
    let four = depths
        .shifted::<3, -4>()
        .gather_compare(sampler, corner, 0.75);
    Vec4::new(
        sum * 0.25,
        layer,
        four.x + four.y * 2.0,
        four.z + four.w * 2.0,
    )
}

/// A search for blockers and a comparison in the same depths: how many of the four texels around a corner lie before a
/// reference, the nearest of them, the depth of a level, and whether it is lit.
#[kernel(
    compute,
    threads(8, 8),
    texture(rgba32float),
    parity(
        ulp = 0,
        absolute = 1e-30,
        why = "drivers may take subnormal depths for 0 where they are drawn"
    )
)]
pub fn blockers(
    #[index] at: UVec2,
    #[texture]
    #[size(32, 16)]
    #[levels(2)]
    depths: DepthTexture2d<'_>,
    #[sampler]
    #[address(repeat)]
    nearest: NonFilteringSampler,
    #[sampler]
    #[filter(nearest)]
    #[mip_filter(nearest)]
    #[compare(less)]
    #[address(repeat)]
    compares: ComparisonSampler,
) -> Vec4 {
    let corner = Vec2::new(at.x as f32 / 32.0, at.y as f32 / 16.0);
    let middle = Vec2::new((at.x as f32 + 0.5) / 32.0, (at.y as f32 + 0.5) / 16.0);
    let four = depths.gather(nearest, corner);
    let is_before = |depth: f32| if depth < 0.5 { 1.0 } else { 0.0 };
    let least = |a: f32, b: f32| if a < b { a } else { b };
    Vec4::new(
        is_before(four.x) + is_before(four.y) + (is_before(four.z) + is_before(four.w)),
        least(least(four.x, four.y), least(four.z, four.w)),
        depths.sample_level(nearest, middle, at.y & 1),
        depths.compare_level_zero(compares, middle, 0.25),
    )
}

/// Depths as they are, of a layer and around a light: nearest texels and gathered ones.
#[kernel(
    fragment,
    parity(
        ulp = 0,
        absolute = 1e-30,
        why = "drivers may take subnormal depths for 0 where they are drawn"
    )
)]
pub fn unlit(
    #[frag_coord] at: Vec3,
    #[texture]
    #[size(32, 16)]
    #[levels(3)]
    layers: DepthTexture2dArray<'_>,
    #[texture]
    #[size(16, 16)]
    around: DepthTextureCube<'_>,
    #[texture]
    #[size(16, 16)]
    #[layers(2)]
    lights: DepthTextureCubeArray<'_>,
    #[sampler]
    #[address(repeat)]
    sampler: NonFilteringSampler,
) -> Vec4 {
    // Away from what lies between two levels, and between two texels of each.
    let uv = Vec2::new((at.x * 1.681_792_8 + 0.1) / 32.0, (at.y + 0.15) / 16.0);
    let to = Vec3::new((at.x % 16.0) * 0.1 - 0.77, (at.y % 16.0) * 0.1 - 0.77, 1.0);
    let light = at.x as u32 & 1;
    let four = around.gather(sampler, Vec3::new(1.0, 0.375, -0.125));
    Vec4::new(
        layers.sample(sampler, uv, 1),
        layers.sample_level(sampler, uv, light, 2),
        around.sample_level(sampler, to, 0) + four.x,
        lights.sample_level(sampler, to, light, 0) + four.z,
    )
}

/// Each sample of depths with several.
#[kernel(
    compute,
    threads(8, 8),
    texture(r32float),
    parity(
        ulp = 0,
        absolute = 1e-30,
        why = "drivers may take subnormal depths for 0 where they are drawn"
    )
)]
pub fn depth_of_sample(
    #[index] at: UVec2,
    #[texture] depths: DepthTexture2dMultisampled<'_>,
) -> f32 {
    let size = depths.size();
    let place = UVec2::new(at.x % size.x, at.y % size.y);
    depths.load(place, (at.x + at.y) % depths.samples())
}
