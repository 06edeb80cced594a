//! Bloom over a chain of halved pictures (Jimenez, Next Generation Post Processing in Call of Duty:
//! Advanced Warfare, 2014): 13 taps down, a tent of 3 by 3 up, and a picture that reads all levels.

use hankel_dsl::glam::{UVec2, Vec2, Vec3, Vec4};
use hankel_dsl::{Element, Real, Sampler, Texture2d, kernel};

/// What glows, and how much.
#[derive(Clone, Copy, Debug, PartialEq, Element)]
#[repr(C)]
pub struct Glow {
    /// The brightness from which a pixel glows.
    #[default(1.0)]
    #[range(0.2..=0.8)]
    pub threshold: f32,
    /// How much of the wider picture is added to the narrower one on the way up.
    #[default(1.0)]
    #[range(0.2..=1.0)]
    pub spread: f32,
    /// How much of the bloom is added to the picture.
    #[default(0.3)]
    #[range(0.0..=1.0)]
    pub strength: f32,
    /// Fills the structure up.
    pub padding: f32,
}

/// Half the picture of what is brighter than the threshold: four filtered taps, bright ones weighed down
/// by their brightness, so that single pixels do not flicker (Karis, 2013).
#[kernel(
    compute,
    threads(8, 8),
    texture(rgba16float),
    parity(
        ulp = 1,
        absolute = 1e-6,
        non_finite,
        why = "rounding to the format is the driver's choice; absurd colours overflow it"
    )
)]
pub fn bloom_bright(
    #[index] at: UVec2,
    #[uniform] glow: &Glow,
    #[texture]
    #[size(122, 74)]
    source: Texture2d<'_>,
    #[sampler] sampler: Sampler,
) -> Vec4 {
    let texels = source.size();
    let size = Vec2::new(texels.x as f32, texels.y as f32);
    let middle = Vec2::new(at.x as f32 * 2.0 + 1.0, at.y as f32 * 2.0 + 1.0);
    let mut sum = Vec3::ZERO;
    let mut weights = 0.0;
    let mut tap = |x: f32, y: f32| {
        let colour = source.sample_level(sampler, (middle + Vec2::new(x, y)) / size, 0.0);
        let brightest = Real::max(colour.x, Real::max(colour.y, colour.z));
        let above = Real::max(brightest - glow.threshold, 0.0) / Real::max(brightest, 1e-4);
        let weight = 1.0 / (1.0 + brightest);
        sum += colour.truncate() * (above * weight);
        weights += weight;
    };
    tap(-1.0, -1.0);
    tap(1.0, -1.0);
    tap(-1.0, 1.0);
    tap(1.0, 1.0);
    (sum / weights).extend(1.0)
}

/// Half a picture: the mean of five overlapping boxes of 4 by 4 texels, the middle one counting half.
#[kernel(
    compute,
    threads(8, 8),
    texture(rgba16float),
    parity(
        ulp = 1,
        absolute = 1e-6,
        non_finite,
        why = "rounding to the format is the driver's choice; absurd colours overflow it"
    )
)]
pub fn bloom_down(
    #[index] at: UVec2,
    #[texture]
    #[size(122, 74)]
    source: Texture2d<'_>,
    #[sampler] sampler: Sampler,
) -> Vec4 {
    let texels = source.size();
    let size = Vec2::new(texels.x as f32, texels.y as f32);
    let middle = Vec2::new(at.x as f32 * 2.0 + 1.0, at.y as f32 * 2.0 + 1.0);
    let tap = |x: f32, y: f32| source.sample_level(sampler, (middle + Vec2::new(x, y)) / size, 0.0);
    let inner = tap(-1.0, -1.0) + tap(1.0, -1.0) + (tap(-1.0, 1.0) + tap(1.0, 1.0));
    let corners = tap(-2.0, -2.0) + tap(2.0, -2.0) + (tap(-2.0, 2.0) + tap(2.0, 2.0));
    let sides = tap(0.0, -2.0) + tap(0.0, 2.0) + (tap(-2.0, 0.0) + tap(2.0, 0.0));
    inner * 0.125 + corners * 0.03125 + sides * 0.0625 + tap(0.0, 0.0) * 0.125
}

/// A picture and the wider one below it, enlarged by a tent.
#[kernel(
    compute,
    threads(8, 8),
    texture(rgba16float),
    parity(
        ulp = 1,
        absolute = 1e-6,
        non_finite,
        why = "rounding to the format is the driver's choice; absurd colours overflow it"
    )
)]
pub fn bloom_up(
    #[index] at: UVec2,
    #[uniform] glow: &Glow,
    #[texture]
    #[size(61, 37)]
    narrow: Texture2d<'_>,
    #[texture]
    #[size(30, 18)]
    wide: Texture2d<'_>,
    #[sampler] sampler: Sampler,
) -> Vec4 {
    let (here, texels) = (narrow.size(), wide.size());
    let size = Vec2::new(texels.x as f32, texels.y as f32);
    let uv = (Vec2::new(at.x as f32, at.y as f32) + 0.5) / Vec2::new(here.x as f32, here.y as f32);
    let tap = |x: f32, y: f32| wide.sample_level(sampler, uv + Vec2::new(x, y) / size, 0.0);
    let corners = tap(-1.0, -1.0) + tap(1.0, -1.0) + (tap(-1.0, 1.0) + tap(1.0, 1.0));
    let sides = tap(0.0, -1.0) + tap(0.0, 1.0) + (tap(-1.0, 0.0) + tap(1.0, 0.0));
    let tent = corners * 0.0625 + sides * 0.125 + tap(0.0, 0.0) * 0.25;
    narrow.load(at) + tent * glow.spread
}

/// The picture with its bloom, a mip chain of which every level counts alike, and a curve that keeps it
/// below 1 (Reinhard et al., Photographic Tone Reproduction for Digital Images, 2002, equation 3).
#[kernel(
    compute,
    threads(8, 8),
    texture(rgba8unorm),
    parity(
        ulp = 0,
        absolute = 4e-3,
        why = "one step of the format: rounding of a tie is the driver's choice"
    )
)]
pub fn bloom_composite(
    #[index] at: UVec2,
    #[uniform] glow: &Glow,
    #[texture]
    #[size(61, 37)]
    source: Texture2d<'_>,
    #[texture]
    #[size(32, 16)]
    #[levels(4)]
    bloom: Texture2d<'_>,
    #[sampler] sampler: Sampler,
) -> Vec4 {
    let texels = source.size();
    let uv =
        (Vec2::new(at.x as f32, at.y as f32) + 0.5) / Vec2::new(texels.x as f32, texels.y as f32);
    let levels = bloom.levels();
    let mut sum = Vec3::ZERO;
    let mut level = 0;
    while level < levels {
        sum += bloom.sample_level(sampler, uv, level as f32).truncate();
        level += 1;
    }
    let colour = source.load(at).truncate() + sum * (glow.strength / levels as f32);
    (colour / (colour + 1.0)).extend(1.0)
}
