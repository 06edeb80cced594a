//! Textures of integers, storage textures that are read, and gathers from cubes.

use hankel_dsl::access::{Read, ReadWrite};
use hankel_dsl::format::{
    R32Float, R32Sint, R32Uint, Rg11B10Ufloat, Rg16Float, Rgb10A2Uint, Rgb10A2Unorm, Rgba8Sint,
    Rgba8Snorm, Rgba16Float, Rgba32Float,
};
use hankel_dsl::glam::{IVec2, IVec4, UVec2, UVec3, UVec4, Vec2, Vec3, Vec4};
use hankel_dsl::{
    ComparisonSampler, DepthTextureCube, Element, NonFilteringSampler, Sampler, StorageTexture2d,
    StorageTexture2dArray, StorageTexture3d, Texture2d, Texture2dArray, Texture2dMultisampled,
    Texture3d, TextureCube, TextureCubeArray, array_element, kernel,
};

/// Texels of integers, as they are: of all levels, of layers, of a volume.
#[kernel(compute, threads(8, 8), range(61, 37), outputs(rgba32uint, rgba32sint))]
pub fn whole(
    #[index] at: UVec2,
    #[texture]
    #[levels(3)]
    counts: Texture2d<'_, u32>,
    #[texture]
    #[layers(4)]
    offsets: Texture2dArray<'_, i32>,
    #[texture] volume: Texture3d<'_, u32>,
) -> (UVec4, IVec4) {
    let level = at.y % 3;
    let size = counts.level_size(level);
    let count = counts.load_level(UVec2::new(at.x % size.x, at.y % size.y), level);
    let size = volume.size();
    let inside = UVec3::new(at.x % size.x, at.y % size.y, (at.x ^ at.y) % size.z);
    (count ^ volume.load(inside), offsets.load(at, at.x % 4))
}

/// Four unsigned integers that every format holds.
#[kernel(compute, threads(8, 8), texture(rgba8uint, rgba16uint, rgba32uint))]
pub fn counted_texels(#[index] at: UVec2) -> UVec4 {
    UVec4::new(at.x, at.y, 255, (at.x ^ at.y) & 127)
}

/// Four signed integers that every format holds.
#[kernel(compute, threads(8, 8), texture(rgba8sint, rgba16sint, rgba32sint))]
pub fn signed_texels(#[index] at: UVec2) -> IVec4 {
    let x = at.x as i32;
    IVec4::new(x - 30, at.y as i32, -128, if x & 1 == 0 { -x } else { 127 })
}

/// Steps of formats with four channels: none is in the middle between two numbers that a format has, so that none is
/// rounded in different ways.
#[kernel(
    compute,
    threads(8, 8),
    texture(
        rgba32float,
        rgba16float,
        rgba16unorm,
        rgba16snorm,
        rgba8unorm,
        rgba8snorm
    )
)]
pub fn four_shares(#[index] at: UVec2) -> Vec4 {
    let [x, y] = shares(at);
    Vec4::new(x, y, -x, 1.0 - y)
}

/// The same of two, also drawn.
#[kernel(
    compute,
    threads(8, 8),
    texture(rg32float, rg16float, rg16unorm, rg16snorm, rg8unorm, rg8snorm),
    forms(fragment)
)]
pub fn two_shares(#[index] at: UVec2) -> Vec2 {
    let [x, y] = shares(at);
    Vec2::new(x, -y)
}

/// The same of one.
#[kernel(
    compute,
    threads(8, 8),
    texture(r32float, r16float, r16unorm, r16snorm, r8unorm, r8snorm)
)]
pub fn one_share(#[index] at: UVec2) -> f32 {
    let [x, y] = shares(at);
    x - y
}

/// Two numbers from 0 to 1 for a texel.
fn shares(at: UVec2) -> [f32; 2] {
    let share = |i: u32| ((i & 63) as f32 + 0.25) / 64.0;
    [share(at.x), share(at.y)]
}

/// Two integers that every format holds.
#[kernel(compute, threads(8, 8), texture(rg8uint, rg16uint, rg32uint))]
pub fn counted_pairs(#[index] at: UVec2) -> UVec2 {
    UVec2::new(255 - at.x, at.y)
}

/// Two signed ones.
#[kernel(compute, threads(8, 8), texture(rg8sint, rg16sint, rg32sint))]
pub fn small_pairs(#[index] at: UVec2) -> IVec2 {
    IVec2::new(at.x as i32 - 128, 127 - at.y as i32)
}

/// One integer that every format holds.
#[kernel(compute, threads(8, 8), texture(r8uint, r16uint, r32uint))]
pub fn counted(#[index] at: UVec2) -> u32 {
    (at.x ^ at.y) & 255
}

/// One signed one.
#[kernel(compute, threads(8, 8), texture(r8sint, r16sint, r32sint))]
pub fn small(#[index] at: UVec2) -> i32 {
    at.x as i32 - at.y as i32
}

/// Numbers from 0 to 1 that share a word, the last of which has four steps.
#[kernel(compute, threads(8, 8), texture(rgb10a2unorm))]
pub fn shares_of_word(#[index] at: UVec2) -> Vec4 {
    let share = |n: u32| (n & 1023) as f32 / 1023.0;
    Vec4::new(
        share(at.x * 31 + at.y),
        share(at.y * 17),
        share(1023 - at.x),
        (at.x & 3) as f32 / 3.0,
    )
}

/// Integers that share a word.
#[kernel(compute, threads(8, 8), texture(rgb10a2uint))]
pub fn counts_of_word(#[index] at: UVec2) -> UVec4 {
    UVec4::new(
        (at.x * 31 + at.y) & 1023,
        (at.y * 17) & 1023,
        1023 - (at.x & 1023),
        at.x & 3,
    )
}

/// Floats without a sign that share a word: powers of two, and steps of one between them.
#[kernel(compute, threads(8, 8), texture(rg11b10ufloat))]
pub fn floats_of_word(#[index] at: UVec2) -> Vec3 {
    let power = (1_u32 << (at.y & 7)) as f32 / 16.0;
    let step = |n: u32, digits: f32| power * (1.0 + n as f32 / digits);
    Vec3::new(
        step(at.x & 63, 64.0),
        step((at.x * 5 + at.y) & 63, 64.0),
        step(at.x & 31, 32.0),
    )
}

/// Texels whose channels share a word, as they are read.
#[kernel(
    compute,
    threads(8, 8),
    texture(rgba32float),
    parity(
        ulp = 0,
        absolute = 5e-7,
        why = "a step of 1/1023 or 1/3 may be a product with that, which is rounded"
    )
)]
pub fn read_words(
    #[index] at: UVec2,
    #[texture] floats: StorageTexture2d<'_, Rg11B10Ufloat, Read>,
    #[texture] shares: StorageTexture2d<'_, Rgb10A2Unorm, Read>,
    #[texture] counts: StorageTexture2d<'_, Rgb10A2Uint, Read>,
) -> Vec4 {
    let size = floats.size();
    let place = UVec2::new(at.x % size.x, at.y % size.y);
    let (a, b, c) = (floats.load(place), shares.load(place), counts.load(place));
    Vec4::new(a.x + b.w, a.y, a.z + b.x, (c.x + c.y * 3 + c.w) as f32)
}

/// Storage textures of two channels and of signed numbers, written at any texel.
#[kernel(compute, threads(8, 8), range(16, 16))]
pub fn small_stores(
    #[index] at: UVec2,
    #[texture] two: StorageTexture2d<'_, Rg16Float>,
    #[texture]
    #[layers(2)]
    signed: StorageTexture2dArray<'_, Rgba8Snorm>,
) {
    let [x, y] = shares(at);
    if at.cmplt(two.size()).all() {
        two.store(at, Vec2::new(x, y));
    }
    if at.cmplt(signed.size()).all() {
        signed.store(at, at.x & 1, Vec4::new(-x, x, -y, y));
    }
}

/// Two integers.
#[kernel(compute, threads(8, 8), texture(rg32uint))]
pub fn pairs(#[index] at: UVec2) -> UVec2 {
    at * UVec2::new(0x0101_0101, 3)
}

/// Two signed integers.
#[kernel(compute, threads(8, 8), texture(rg32sint))]
pub fn signed_pairs(#[index] at: UVec2) -> IVec2 {
    IVec2::new(-(at.x as i32), at.y as i32 - 1000)
}

/// One signed integer.
#[kernel(compute, threads(8, 8), texture(r32sint))]
pub fn single(#[index] at: UVec2) -> i32 {
    at.x as i32 - 2 * at.y as i32
}

/// What two forms of an image pass read.
#[derive(Clone, Copy, Debug, PartialEq, Element)]
#[repr(C)]
pub struct Palette {
    /// Colours.
    pub colours: [Vec4; 4],
    /// From a texel to the next.
    #[values(1, 2, 3)]
    pub step: UVec2,
    /// Fills the structure up.
    pub padding: UVec2,
}

/// An image pass in two forms: texels, each in a colour of the palette.
/// The constant is in no arithmetic of floats, which compilers and drivers reassociate.
#[kernel(
    compute,
    threads(8, 8),
    texture(rgba16unorm, rgba32float),
    forms(fragment),
    parity(
        ulp = 0,
        absolute = 1.6e-5,
        exact(rgba32float),
        non_finite,
        why = "one step of the format: rounding of a tie is the driver's choice; absurd colours overflow"
    )
)]
pub fn two_forms(
    #[index] at: UVec2,
    #[uniform] palette: &Palette,
    #[constant(id = 0, default = 1)]
    #[values(1, 3)]
    rows: u32,
    #[texture] source: Texture2d<'_>,
) -> Vec4 {
    let size = source.size();
    let colour = array_element(&palette.colours, (at.x * palette.step.x + at.y * rows) & 3);
    let texel = source.load(UVec2::new(at.x % size.x, at.y % size.y));
    colour * texel
}

/// The same in 8 bits, whose fragment form is that one.
#[kernel(
    compute,
    threads(8, 8),
    texture(rgba8unorm),
    forms(fragment = two_forms),
    parity(
        ulp = 0,
        absolute = 4e-3,
        non_finite,
        why = "one step of the format: rounding of a tie is the driver's choice; absurd colours overflow"
    )
)]
pub fn two_forms_rgba8unorm(
    #[index] at: UVec2,
    #[uniform] palette: &Palette,
    #[constant(id = 0, default = 1)]
    #[values(1, 3)]
    rows: u32,
    #[texture] source: Texture2d<'_>,
) -> Vec4 {
    two_forms(at, palette, rows, source)
}

/// An image pass in two forms with several results, of several types.
#[kernel(
    compute,
    threads(8, 8),
    outputs(r32uint, rg32uint, rgba32sint, r32float),
    forms(fragment)
)]
pub fn several_forms(
    #[index] at: UVec2,
    #[texture] source: Texture2d<'_, u32>,
) -> (u32, UVec2, IVec4, f32) {
    let size = source.size();
    let texel = source.load(UVec2::new(at.x % size.x, at.y % size.y));
    let whole = IVec4::new(at.x as i32, -(at.y as i32), texel.z as i32, -1);
    (texel.x ^ at.y, at, whole, at.x as f32 * 0.5)
}

/// Every texel halves, in place.
#[kernel(compute, threads(8, 8), range(size))]
pub fn fade(
    #[index] at: UVec2,
    #[uniform] size: &UVec2,
    #[texture] light: StorageTexture2d<'_, R32Float, ReadWrite>,
) {
    let last = *size - UVec2::ONE;
    light.store(last - at, light.load(last - at) * 0.5);
}

/// Each texel counts how many of its own bits a mask has, in place, in a volume.
#[kernel(compute, threads(4, 4, 2), range(9, 5, 3))]
pub fn tally(#[index] at: UVec3, #[texture] bits: StorageTexture3d<'_, R32Uint, ReadWrite>) {
    let own = bits.load(at);
    bits.store(at, (own & 0x0f0f_0f0f).count_ones() + (own ^ at.x));
}

/// Signed texels change their sign, in place, and those around the diagonal twice.
#[kernel(compute, threads(8, 8), range(61, 37))]
pub fn turn(#[index] at: UVec2, #[texture] numbers: StorageTexture2d<'_, R32Sint, ReadWrite>) {
    numbers.store(at, !numbers.load(at));
    if at.x == at.y {
        let once = numbers.load(at);
        numbers.store(at, !once);
    }
}

/// The mean of a texel and its right neighbour, from a storage texture that is only read.
#[kernel(
    compute,
    threads(8, 8),
    texture(rgba32float),
    parity(non_finite, why = "the largest halves overflow")
)]
pub fn blurred(
    #[index] at: UVec2,
    #[texture] source: StorageTexture2d<'_, Rgba16Float, Read>,
) -> Vec4 {
    let last = source.size().x - 1;
    let right = if at.x < last { at.x + 1 } else { last };
    source.load(at) * 0.5 + source.load(UVec2::new(right, at.y)) * 0.5
}

/// How far a texel of short integers is from its right neighbour.
#[kernel(compute, threads(8, 8), texture(rgba32sint))]
pub fn edges(
    #[index] at: UVec2,
    #[texture] source: StorageTexture2d<'_, Rgba8Sint, Read>,
) -> IVec4 {
    let last = source.size().x - 1;
    let right = if at.x < last { at.x + 1 } else { last };
    source.load(UVec2::new(right, at.y)) - source.load(at)
}

/// Each layer from right to left, with the place that it was written from.
#[kernel(compute, threads(4, 4, 1), range(13, 11, 3))]
pub fn written_layers(
    #[index] at: UVec3,
    #[texture]
    #[layers(3)]
    layers: StorageTexture2dArray<'_, Rgba32Float>,
) {
    let size = layers.size();
    layers.store(
        UVec2::new(size.x - 1 - at.x, at.y),
        at.z,
        Vec4::new(at.x as f32, at.y as f32, at.z as f32, size.y as f32),
    );
}

/// Texels of an array count, in place.
#[kernel(compute, threads(4, 4, 1), range(13, 11, 3))]
pub fn counted_layers(
    #[index] at: UVec3,
    #[texture]
    #[layers(3)]
    numbers: StorageTexture2dArray<'_, R32Uint, ReadWrite>,
) {
    let own = numbers.load(at.truncate(), at.z);
    numbers.store(at.truncate(), at.z, (own ^ at.x).wrapping_add(at.z + 1));
}

/// The mean of two layers that are only read.
#[kernel(
    compute,
    threads(8, 8),
    texture(rgba32float),
    parity(non_finite, why = "the largest halves overflow")
)]
pub fn read_layers(
    #[index] at: UVec2,
    #[texture]
    #[layers(2)]
    layers: StorageTexture2dArray<'_, Rgba16Float, Read>,
) -> Vec4 {
    layers.load(at, 0) * 0.5 + layers.load(at, 1) * 0.5
}

/// A direction to a corner between four texels of a face that has 16 on each side, away from the
/// face's own edges.
fn to_a_corner(at: UVec2) -> Vec3 {
    let step = |n: u32| (n % 11) as f32 / 8.0 - 0.625;
    let (s, t) = (step(at.x), step(at.y));
    let major = if (at.x / 11) & 1 == 0 { 1.0 } else { -1.0 };
    let axis = at.y / 11 % 3;
    if axis == 0 {
        Vec3::new(major, t, s)
    } else if axis == 1 {
        Vec3::new(s, major, t)
    } else {
        Vec3::new(t, s, major)
    }
}

/// The third channels of the four texels around a corner on a cube's face.
#[kernel(compute, threads(8, 8), texture(rgba32float))]
pub fn face_corners(
    #[index] at: UVec2,
    #[texture]
    #[size(16, 16)]
    source: TextureCube<'_>,
    #[sampler] sampler: Sampler,
) -> Vec4 {
    source.gather::<2>(sampler, to_a_corner(at))
}

/// The same of several cubes.
#[kernel(compute, threads(8, 8), texture(rgba32float))]
pub fn faces(
    #[index] at: UVec2,
    #[texture]
    #[size(16, 16)]
    #[layers(2)]
    source: TextureCubeArray<'_>,
    #[sampler] sampler: Sampler,
) -> Vec4 {
    source.gather::<0>(sampler, to_a_corner(at), (at.x + at.y) % 2)
}

/// Which of the four depths around a corner on a cube's face are behind the middle.
#[kernel(compute, threads(8, 8), texture(rgba32float))]
pub fn faces_lit(
    #[index] at: UVec2,
    #[texture]
    #[size(16, 16)]
    depths: DepthTextureCube<'_>,
    #[sampler]
    #[compare(less)]
    sampler: ComparisonSampler,
) -> Vec4 {
    depths.gather_compare(sampler, to_a_corner(at), 0.5)
}

/// Samples of a texel.
#[kernel(compute, threads(8, 8), texture(r32uint))]
pub fn sample_count(#[index] at: UVec2, #[texture] source: Texture2dMultisampled<'_>) -> u32 {
    source.samples() * 100 + (at.x + at.y) % source.samples()
}

/// Channels of the four texels around a corner: of a texture, of a layer, on a cube's face and on one of several cubes.
#[kernel(compute, threads(8, 8), texture(rgba32uint))]
pub fn four_integers(
    #[index] at: UVec2,
    #[texture]
    #[size(32, 16)]
    flat: Texture2d<'_, u32>,
    #[texture]
    #[size(32, 16)]
    #[layers(2)]
    layers: Texture2dArray<'_, i32>,
    #[texture]
    #[size(16, 16)]
    around: TextureCube<'_, u32>,
    #[texture]
    #[size(16, 16)]
    #[layers(2)]
    cubes: TextureCubeArray<'_, i32>,
    #[sampler]
    #[address(repeat)]
    sampler: NonFilteringSampler,
) -> UVec4 {
    let corner = Vec2::new(at.x as f32 / 32.0, at.y as f32 / 16.0);
    let to = to_a_corner(at);
    let a = flat.gather::<1>(sampler, corner);
    let b = layers.gather::<2>(sampler, corner, at.x & 1);
    let c = around.gather::<0>(sampler, to);
    let d = cubes.gather::<3>(sampler, to, at.y & 1);
    UVec4::new(
        a.x ^ a.w,
        (b.y ^ b.z) as u32,
        c.x ^ c.z,
        (d.w ^ d.x) as u32 ^ around.size().x,
    )
}

/// Samples that are integers, of both signs.
#[kernel(compute, threads(8, 8), texture(rgba32uint))]
pub fn samples_of_integers(
    #[index] at: UVec2,
    #[texture] unsigned: Texture2dMultisampled<'_, u32>,
    #[texture] signed: Texture2dMultisampled<'_, i32>,
) -> UVec4 {
    let size = unsigned.size();
    let place = UVec2::new(at.x % size.x, at.y % size.y);
    let sample = (at.x + at.y) % unsigned.samples();
    let (a, b) = (unsigned.load(place, sample), signed.load(place, 3 - sample));
    UVec4::new(a.x, b.x as u32, a.w, sample)
}
