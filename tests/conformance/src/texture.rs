//! Textures that are written anywhere, and texels that are gathered.

use hankel_dsl::format::{R32Uint, Rgba8Unorm, Rgba32Float};
use hankel_dsl::glam::{UVec2, UVec3, Vec2, Vec3, Vec4};
use hankel_dsl::{Sampler, StorageTexture2d, StorageTexture3d, Texture2d, kernel};

/// Each invocation writes the texel that is opposite to its own, in two textures.
#[kernel(
    compute,
    threads(8, 8),
    range(size),
    parity(
        ulp = 0,
        absolute = 4e-3,
        why = "one step of the format: rounding of a tie is the driver's choice"
    )
)]
pub fn mirror(
    #[index] at: UVec2,
    #[uniform] size: &UVec2,
    #[texture] colours: StorageTexture2d<'_, Rgba8Unorm>,
    #[texture] numbers: StorageTexture2d<'_, R32Uint>,
) {
    let opposite = *size - UVec2::ONE - at;
    let share = at.x as f32 / 64.0;
    colours.store(opposite, Vec4::new(share, 1.0 - share, 0.5, 1.0));
    numbers.store(opposite, at.y * numbers.size().x + at.x);
}

/// Each invocation writes two texels of a volume, one below the other.
#[kernel(compute, threads(4, 4), range(13, 11))]
pub fn spread(#[index] at: UVec2, #[texture] volume: StorageTexture3d<'_, Rgba32Float>) {
    let depth = volume.size().z;
    let value = Vec4::new(at.x as f32, at.y as f32, 0.5, 1.0);
    volume.store(UVec3::new(at.x, at.y, 0), value);
    volume.store(UVec3::new(at.x, at.y, depth - 1), value * 2.0);
}

/// The second channels of the four texels around a corner, the corner's own point in the middle.
#[kernel(
    compute,
    threads(8, 8),
    texture(rgba32float),
    parity(ulp = 0, absolute = 0.0, why = "texels as they are")
)]
pub fn corners(
    #[index] at: UVec2,
    #[texture] source: Texture2d<'_>,
    #[sampler] sampler: Sampler,
) -> Vec4 {
    let size = source.size();
    let corner = Vec2::new(at.x as f32 / size.x as f32, at.y as f32 / size.y as f32);
    source.gather::<1>(sampler, corner)
}

/// The first channels of the texels around the lower right corner of the fragment's own.
#[kernel(fragment, parity(ulp = 0, absolute = 0.0, why = "texels as they are"))]
pub fn gathered(
    #[frag_coord] at: Vec3,
    #[texture] source: Texture2d<'_>,
    #[sampler] sampler: Sampler,
) -> Vec4 {
    let size = source.size();
    let corner = Vec2::new((at.x + 0.5) / size.x as f32, (at.y + 0.5) / size.y as f32);
    source.gather::<0>(sampler, corner)
}
