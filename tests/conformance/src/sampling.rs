//! Mip levels, and what samplers do with them.
//!
//! The level is the same along a row, or in a workgroup: llvmpipe 22.3.6 reads for eight invocations
//! beside each other the level of the first one.

use hankel_dsl::glam::{UVec2, UVec3, Vec2, Vec3, Vec4};
use hankel_dsl::{Element, Sampler, Texture2d, Texture2dArray, Texture3d, kernel};

/// Texels of all levels, and how large their level is.
#[kernel(compute, threads(8, 8), texture(rgba32float))]
pub fn levels(
    #[index] at: UVec2,
    #[texture]
    #[levels(4)]
    source: Texture2d<'_>,
) -> Vec4 {
    let level = at.y % 4;
    let size = source.level_size(level);
    let texel = source.load_level(UVec2::new(at.x % size.x, at.y % size.y), level);
    Vec4::new(texel.x, texel.y, size.x as f32, size.y as f32)
}

/// Texels of the last level of a volume, and which level that is.
#[kernel(compute, threads(8, 8), texture(rgba32float))]
pub fn level_count(
    #[index] at: UVec2,
    #[texture]
    #[size(21, 10, 6)]
    #[levels(3)]
    source: Texture3d<'_>,
) -> Vec4 {
    let last = source.levels() - 1;
    let size = source.level_size(last);
    let place = UVec3::new(at.x % size.x, at.y % size.y, (at.x + at.y) % size.z);
    let texel = source.load_level(place, last);
    Vec4::new(texel.x, texel.y, last as f32, size.z as f32)
}

/// A texture between texels and between levels, before the first of them and after the last.
#[kernel(compute, threads(64))]
pub fn trilinear(
    #[index] i: u32,
    #[element]
    #[range(-0.5..=1.5)]
    uv: Vec2,
    #[texture]
    #[size(64, 32)]
    #[levels(6)]
    source: Texture2d<'_>,
    #[sampler] sampler: Sampler,
) -> f32 {
    source
        .sample_level(sampler, uv, (i % 29) as f32 * 0.25 - 0.5)
        .x
}

/// A volume between texels and between levels.
#[kernel(compute, threads(64))]
pub fn volume_levels(
    #[index] i: u32,
    #[element]
    #[range(-0.5..=1.5)]
    place: Vec4,
    #[texture]
    #[size(16, 8, 8)]
    #[levels(3)]
    source: Texture3d<'_>,
    #[sampler]
    #[address(mirror_repeat)]
    sampler: Sampler,
) -> f32 {
    source
        .sample_level(sampler, place.truncate(), (i % 9) as f32 * 0.25)
        .x
}

/// The texels of a level, mirrored to both sides, each at its middle.
#[kernel(compute, threads(8, 8), texture(rgba32float))]
pub fn mirrored(
    #[index] at: UVec2,
    #[texture]
    #[size(16, 8)]
    #[levels(3)]
    source: Texture2d<'_>,
    #[sampler]
    #[filter(nearest)]
    #[mip_filter(nearest)]
    #[address(mirror_repeat)]
    sampler: Sampler,
) -> Vec4 {
    let level = at.y % 3;
    let size = source.level_size(level);
    // Before, within and beyond the texture.
    let place = |i: u32, n: u32| ((i * 7) % (5 * n)) as f32 + 0.5 - 2.0 * n as f32;
    let u = place(at.x, size.x) / size.x as f32;
    let v = place(at.y, size.y) / size.y as f32;
    source.sample_level(sampler, Vec2::new(u, v), level as f32 + 0.25)
}

/// Texels of the level that gradients ask for: a quarter of a level below it, since an implementation
/// may find up to half a level more.
#[kernel(compute, threads(8, 8), texture(rgba32float))]
pub fn by_gradients(
    #[index] at: UVec2,
    #[texture]
    #[size(64, 32)]
    #[levels(4)]
    source: Texture2d<'_>,
    #[sampler]
    #[filter(nearest)]
    #[mip_filter(nearest)]
    #[address(repeat)]
    sampler: Sampler,
) -> Vec4 {
    let level = at.y % 4;
    let (size, whole) = (source.level_size(level), source.size());
    let middle = Vec2::new(at.x as f32 + 0.5, at.y as f32 + 0.5);
    let uv = middle / Vec2::new(size.x as f32, size.y as f32);
    // 2 to the power of -1/4, in texels.
    let step = 0.840_896_4 * (1_u32 << level) as f32;
    let dx = Vec2::new(step / whole.x as f32, 0.0);
    let dy = Vec2::new(0.0, 0.5 * step / whole.y as f32);
    source.sample_gradient(sampler, uv, dx, dy)
}

/// Four colours.
#[derive(Clone, Copy, Debug, PartialEq, Element)]
#[repr(C)]
pub struct Tints {
    /// The colours.
    pub colours: [Vec4; 4],
}

/// A texture at the level of the fragment, behind an index that may be out of range. WGSL does not get the kernel: an
/// implementation refuses it, since only some fragments may come to the texture.
#[kernel(
    fragment,
    parity(non_finite, why = "products of absurd colours overflow")
)]
pub fn behind_an_index(
    #[frag_coord] at: Vec3,
    #[varying]
    #[values(0, 1, 2, 3)]
    which: u32,
    #[uniform] tints: &Tints,
    #[texture]
    #[size(64, 32)]
    source: Texture2d<'_>,
    #[sampler]
    #[filter(nearest)]
    sampler: Sampler,
) -> Vec4 {
    let tint = tints.colours[which as usize];
    let size = source.size();
    let uv = Vec2::new(at.x / size.x as f32, at.y / size.y as f32);
    source.sample(sampler, uv) * tint
}

/// What `of` gives for the numbers below `count`, which is 1 at least.
fn sum(count: u32, of: impl Fn(u32) -> Vec4) -> Vec4 {
    let mut sum = of(0);
    let mut i = 1;
    while i < count {
        sum += of(i);
        i += 1;
    }
    sum
}

/// A closure that looks a texture up, held by two others.
#[kernel(
    compute,
    threads(8, 8),
    texture(rgba32float),
    parity(non_finite, why = "sums of absurd colours overflow")
)]
pub fn held_twice(
    #[index] at: UVec2,
    #[texture]
    #[size(16, 16)]
    source: Texture2d<'_>,
) -> Vec4 {
    let texel = |i: u32| {
        let texel = source.load(UVec2::new((at.x ^ i) & 15, at.y & 15));
        [texel, Vec4::new(texel.w, texel.z, texel.y, texel.x)]
    };
    let even = sum((at.x & 3) + 1, |i| texel(2 * i)[0]);
    let odd = sum(3, |i| texel(2 * i + 1)[1]);
    even + odd
}

/// A texture by the level that neighbouring fragments make, and by the next one.
#[kernel(fragment)]
pub fn receding(
    #[frag_coord] at: Vec3,
    #[texture]
    #[size(64, 32)]
    #[levels(4)]
    source: Texture2d<'_>,
    #[sampler]
    #[mip_filter(nearest)]
    #[address(mirror_repeat)]
    sampler: Sampler,
) -> Vec4 {
    let size = source.size();
    // 2 to the power of 3/4 texels from fragment to fragment along x: level 1.
    let u = at.x * 1.681_792_8 / size.x as f32;
    let v = at.y * 0.75 / size.y as f32;
    let uv = Vec2::new(u, v);
    let near = source.sample(sampler, uv);
    let far = source.sample_bias(sampler, uv, 1.0);
    Vec4::new(near.x, near.y, far.x, far.y)
}

/// Texels beside others, in whichever unit of the level: a texture's at a level, a layer's by gradients, and four in a
/// layer.
#[kernel(compute, threads(8, 8), texture(rgba32float))]
pub fn neighbours_of_texels(
    #[index] at: UVec2,
    #[texture]
    #[size(64, 32)]
    #[levels(3)]
    source: Texture2d<'_>,
    #[texture]
    #[size(32, 16)]
    #[layers(2)]
    layers: Texture2dArray<'_>,
    #[sampler]
    #[filter(nearest)]
    #[mip_filter(nearest)]
    #[address(repeat)]
    sampler: Sampler,
) -> Vec4 {
    let level = at.y % 3;
    let middle = Vec2::new(at.x as f32 + 0.5, at.y as f32 + 0.5);
    let size = source.level_size(level);
    let uv = middle / Vec2::new(size.x as f32, size.y as f32);
    let beside = source
        .shifted::<1, -2>()
        .sample_level(sampler, uv, level as f32);
    let whole = middle * Vec2::new(1.0 / 32.0, 1.0 / 16.0);
    let step = 0.840_896_4 / 32.0;
    let (dx, dy) = (Vec2::new(step, 0.0), Vec2::new(0.0, step));
    let above = layers
        .shifted::<0, -8>()
        .sample_gradient(sampler, whole, at.x & 1, dx, dy);
    let corner = Vec2::new(at.x as f32 / 32.0, at.y as f32 / 16.0);
    let four = layers
        .shifted::<7, 3>()
        .gather::<1>(sampler, corner, at.y & 1);
    Vec4::new(beside.x, above.y, four.x, four.y + four.z * 2.0)
}

/// A texture beside each fragment's place, at the fragment's level and one beyond.
#[kernel(fragment)]
pub fn blurred_sideways(
    #[frag_coord] at: Vec3,
    #[texture]
    #[size(64, 32)]
    #[levels(4)]
    source: Texture2d<'_>,
    #[sampler]
    #[mip_filter(nearest)]
    #[address(mirror_repeat)]
    sampler: Sampler,
) -> Vec4 {
    let u = at.x * 1.681_792_8 / 64.0;
    let uv = Vec2::new(u, at.y * 0.75 / 32.0);
    let left = source.shifted::<-1, 0>().sample(sampler, uv);
    let right = source.shifted::<1, 0>().sample_bias(sampler, uv, 1.0);
    Vec4::new(left.x, left.y, right.x, right.y)
}

/// Texels beside others in three dimensions, at a level and by gradients.
#[kernel(compute, threads(8, 8), texture(rgba32float))]
pub fn neighbours_in_space(
    #[index] at: UVec2,
    #[texture]
    #[size(16, 8, 8)]
    #[levels(2)]
    source: Texture3d<'_>,
    #[sampler]
    #[filter(nearest)]
    #[mip_filter(nearest)]
    #[address(repeat)]
    sampler: Sampler,
) -> Vec4 {
    let level = at.y & 1;
    let size = source.level_size(level);
    let middle = Vec3::new(
        at.x as f32 + 0.5,
        at.y as f32 + 0.5,
        (at.x % 3) as f32 + 0.5,
    );
    let place = middle / Vec3::new(size.x as f32, size.y as f32, size.z as f32);
    let beside = source
        .shifted::<1, -2, 3>()
        .sample_level(sampler, place, level as f32);
    let step = 0.840_896_4 / 16.0;
    let (dx, dy) = (Vec3::new(step, 0.0, 0.0), Vec3::new(0.0, step, 0.0));
    let whole = middle * Vec3::new(1.0 / 16.0, 1.0 / 8.0, 1.0 / 8.0);
    let above = source
        .shifted::<-8, 0, 7>()
        .sample_gradient(sampler, whole, dx, dy);
    Vec4::new(beside.x, beside.w, above.y, above.z)
}
