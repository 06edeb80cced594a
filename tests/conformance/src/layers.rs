//! Layers, cubes, and textures of one dimension. Levels are as in [`super::sampling`].

use hankel_dsl::access::Read;
use hankel_dsl::format::{R32Sint, Rgba8Unorm};
use hankel_dsl::glam::{UVec2, UVec4, Vec2, Vec3, Vec4};
use hankel_dsl::{
    DepthTexture2dArray, Real, Sampler, StorageTexture1d, StorageTexture2dArray, Texture1d,
    Texture2dArray, TextureCube, TextureCubeArray, kernel,
};

/// Texels of all levels of all layers.
#[kernel(compute, threads(8, 8), texture(rgba32float))]
pub fn stacked(
    #[index] at: UVec2,
    #[texture]
    #[levels(2)]
    #[layers(5)]
    source: Texture2dArray<'_>,
) -> Vec4 {
    let level = at.y % 2;
    let size = source.level_size(level);
    let place = UVec2::new(at.x % size.x, at.y % size.y);
    source.load_level(place, (at.x + at.y) % 5, level)
}

/// Layers between texels and levels, and four texels of one around a corner.
#[kernel(compute, threads(8, 8), texture(rgba32float))]
pub fn between(
    #[index] at: UVec2,
    #[texture]
    #[size(32, 16)]
    #[levels(4)]
    source: Texture2dArray<'_>,
    #[sampler] sampler: Sampler,
) -> Vec4 {
    let layer = (at.x + at.y) % 3;
    let uv = Vec2::new(at.x as f32 / 37.0, at.y as f32 / 21.0);
    let corner = Vec2::new(at.x as f32 / 32.0, at.y as f32 / 16.0);
    let filtered = source.sample_level(sampler, uv, layer, (at.y % 13) as f32 * 0.25);
    let four = source.gather::<2>(sampler, corner, layer);
    Vec4::new(filtered.x, filtered.y, four.x, four.w)
}

/// A direction through a face of a cube, away from its edges whatever `on` is: SwiftShader reads beyond
/// them what nobody wrote, now and then a NaN. (`super::shadow::hidden` crosses them.)
fn through_a_face(i: u32, on: Vec2) -> Vec3 {
    let inside = |x: f32| Real::clamp(x, -0.7, 0.7);
    let group = i / 64;
    let major = if group & 1 == 0 { 1.0 } else { -1.0 };
    let (s, t) = (inside(on.x), inside(on.y) * 0.5);
    let axis = group % 3;
    if axis == 0 {
        Vec3::new(major, t, s)
    } else if axis == 1 {
        Vec3::new(s, major, t)
    } else {
        Vec3::new(t, s, major)
    }
}

/// A cube through all of its faces, between levels.
#[kernel(compute, threads(64))]
pub fn around(
    #[index] i: u32,
    #[element]
    #[range(-0.7..=0.7)]
    on: Vec2,
    #[texture]
    #[size(16, 16)]
    #[levels(3)]
    source: TextureCube<'_>,
    #[sampler] sampler: Sampler,
) -> f32 {
    let level = (i / 384 % 9) as f32 * 0.25;
    source.sample_level(sampler, through_a_face(i, on), level).x
}

/// A cube at the level that follows from gradients along a face.
#[kernel(compute, threads(64))]
pub fn around_by_gradients(
    #[index] i: u32,
    #[element]
    #[range(-0.7..=0.7)]
    on: Vec2,
    #[texture]
    #[size(16, 16)]
    #[levels(3)]
    source: TextureCube<'_>,
    #[sampler]
    #[mip_filter(nearest)]
    sampler: Sampler,
) -> f32 {
    // 2 to the power of 3/4 texels of the face, which has 8 for each unit: level 1.
    let step = 1.681_792_8 / 8.0;
    let to = through_a_face(i, on);
    let (dx, dy) = match i / 64 % 3 {
        0 => (Vec3::new(0.0, step, 0.0), Vec3::new(0.0, 0.0, step)),
        1 => (Vec3::new(step, 0.0, 0.0), Vec3::new(0.0, 0.0, step)),
        _ => (Vec3::new(step, 0.0, 0.0), Vec3::new(0.0, step, 0.0)),
    };
    source.sample_gradient(sampler, to, dx, dy).x
}

/// One of several cubes.
#[kernel(compute, threads(64))]
pub fn surroundings(
    #[index] i: u32,
    #[element]
    #[range(-0.7..=0.7)]
    on: Vec2,
    #[texture]
    #[layers(2)]
    source: TextureCubeArray<'_>,
    #[sampler] sampler: Sampler,
) -> f32 {
    let direction = through_a_face(i, on);
    source.sample_level(sampler, direction, i / 7 % 2, 0.0).y
}

/// Texels in a row.
#[kernel(compute, threads(8, 8), texture(rgba32float))]
pub fn along(
    #[index] at: UVec2,
    #[texture]
    #[size(100)]
    source: Texture1d<'_>,
) -> Vec4 {
    source.load((at.x + at.y * 3) % source.size())
}

/// A row of texels between them.
#[kernel(fragment)]
pub fn ramp(
    #[frag_coord] at: Vec3,
    #[texture]
    #[size(32)]
    source: Texture1d<'_>,
    #[sampler] sampler: Sampler,
) -> Vec4 {
    source.sample(sampler, at.x / 64.0)
}

/// How many layers and cubes there are.
#[kernel(compute, threads(64))]
pub fn counts(
    #[element] x: u32,
    #[texture]
    #[layers(5)]
    layers: Texture2dArray<'_>,
    #[texture]
    #[size(4, 4)]
    #[layers(2)]
    cubes: TextureCubeArray<'_>,
    #[texture]
    #[layers(4)]
    whole: Texture2dArray<'_, u32>,
    #[texture]
    #[size(16, 8)]
    depths: DepthTexture2dArray<'_>,
) -> UVec4 {
    UVec4::new(
        layers.layers() + x,
        cubes.cubes(),
        whole.layers() * layers.size().x,
        depths.layers(),
    )
}

/// How many layers there are to write into.
#[kernel(compute, threads(64))]
pub fn written_counts(
    #[index] i: u32,
    #[element] x: u32,
    #[texture]
    #[layers(6)]
    target: StorageTexture2dArray<'_, Rgba8Unorm>,
) -> u32 {
    let size = target.size();
    if i < size.x {
        target.store(
            UVec2::new(i, 0),
            i % target.layers(),
            Vec4::new(0.0, 1.0, 0.25, 1.0),
        );
    }
    x + target.layers()
}

/// Integers in rows, of both signs.
#[kernel(compute, threads(64))]
pub fn along_integers(
    #[index] i: u32,
    #[texture]
    #[size(100)]
    source: Texture1d<'_, u32>,
    #[texture]
    #[size(37)]
    signed: Texture1d<'_, i32>,
) -> UVec4 {
    let texel = source.load(i % source.size());
    let other = signed.load(i % signed.size());
    UVec4::new(texel.x, texel.w, other.y as u32, other.z as u32)
}

/// Texels of a row, written in another order.
#[kernel(compute, threads(64))]
pub fn rearranged(
    #[index] i: u32,
    #[element] x: u32,
    #[texture] from: StorageTexture1d<'_, R32Sint, Read>,
    #[texture] to: StorageTexture1d<'_, Rgba8Unorm>,
) -> i32 {
    let count = to.size();
    if i < count {
        to.store(
            count - 1 - i,
            Vec4::new((i & 15) as f32 / 15.0, 0.0, 1.0, 0.2),
        );
    }
    from.load(i % from.size()).wrapping_add(x as i32)
}
