//! One small kernel for each thing that a kernel can do: maps in one, two and three dimensions,
//! both precisions, uniforms, buffers, counters, constants, textures of every shape, samplers,
//! workgroup memory with both kinds of output, vertex and fragment stages. Tests take this crate
//! through the whole chain as if it were somebody's own.
#![no_std]

use hankel_dsl::glam::{IVec2, UVec2, UVec3, UVec4, Vec2, Vec3, Vec4};
use hankel_dsl::{
    Atomics, Buffer, Element, Real, Sampler, Texture2d, Texture2dMultisampled, Texture3d, kernel,
    lit,
};

pub mod called;
pub mod data;
pub mod general;
pub mod layers;
mod masked;
pub mod math;
pub mod sampling;
pub mod shadow;
pub mod stage;
pub mod subgroup;
pub mod texels;
pub mod texture;
pub mod workgroup;

hankel_dsl::kernels![
    affine,
    rounding,
    constants,
    gather,
    histogram,
    workgroup::scan,
    workgroup::maximum,
    workgroup::product,
    workgroup::group_histogram,
    workgroup::places,
    workgroup::neighbours,
    subgroup::quick_sum,
    subgroup::places_of_odd,
    subgroup::votes,
    subgroup::after_loops,
    subgroup::exchanged,
    subgroup::reduced,
    subgroup::reduced_floats,
    subgroup::quads,
    masked::looked_up,
    checker,
    gradient,
    downsample,
    texel_counts,
    last_sample,
    filtered,
    slice,
    corner,
    tint,
    general::scatter,
    general::step,
    general::halve,
    general::compact,
    general::signed,
    general::extremes,
    general::firsts,
    general::float_sum,
    general::blur_grid,
    general::cells,
    general::counted,
    general::bits_set,
    general::tallied,
    general::bordered,
    general::ends,
    general::several,
    stage::numbered,
    stage::flat,
    stage::counted_bits,
    stage::holes,
    stage::deep,
    stage::only_deep,
    stage::slopes,
    stage::grained_slopes,
    stage::sample,
    stage::interpolated,
    stage::covered_place,
    stage::screen_linear,
    stage::at_samples,
    stage::coverage,
    stage::primitives,
    stage::clipped,
    stage::boxed,
    stage::stained,
    stage::linked,
    stage::sloped,
    texture::mirror,
    texture::spread,
    texture::corners,
    texture::gathered,
    called::called_map,
    called::called_texel,
    data::switched,
    data::wide,
    data::swapped_bytes,
    data::signed_wide,
    data::extended,
    data::signs,
    data::packed,
    data::skinned,
    data::bones_in_world,
    data::halves,
    data::faded,
    data::half_bits,
    data::own_halves,
    data::own_half_vectors,
    data::half_directions,
    data::specialised,
    data::pushed,
    data::pushed_colour,
    texels::whole,
    texels::counted_texels,
    texels::signed_texels,
    texels::four_shares,
    texels::two_shares,
    texels::one_share,
    texels::counted_pairs,
    texels::small_pairs,
    texels::counted,
    texels::small,
    texels::small_stores,
    texels::pairs,
    texels::signed_pairs,
    texels::single,
    texels::two_forms,
    texels::two_forms_rgba8unorm,
    texels::several_forms,
    texels::fade,
    texels::tally,
    texels::turn,
    texels::blurred,
    texels::edges,
    texels::written_layers,
    texels::counted_layers,
    texels::read_layers,
    texels::face_corners,
    texels::faces,
    texels::faces_lit,
    texels::sample_count,
    texels::shares_of_word,
    texels::counts_of_word,
    texels::floats_of_word,
    texels::read_words,
    texels::four_integers,
    texels::samples_of_integers,
    sampling::behind_an_index,
    sampling::held_twice,
    sampling::levels,
    sampling::level_count,
    sampling::trilinear,
    sampling::volume_levels,
    sampling::mirrored,
    sampling::by_gradients,
    sampling::receding,
    sampling::neighbours_of_texels,
    sampling::blurred_sideways,
    sampling::neighbours_in_space,
    shadow::lit,
    shadow::soft,
    shadow::four_lit,
    shadow::layers_lit,
    shadow::deepest,
    shadow::hidden,
    shadow::cubes_lit,
    shadow::four_by_offsets,
    shadow::blockers,
    shadow::unlit,
    shadow::depth_of_sample,
    layers::stacked,
    layers::between,
    layers::around,
    layers::around_by_gradients,
    layers::surroundings,
    layers::along,
    layers::ramp,
    layers::counts,
    layers::written_counts,
    layers::along_integers,
    layers::rearranged,
    math::angles,
    math::angles_free,
    math::arcs,
    math::arcs_free,
    math::exponentials,
    math::exponentials_free,
    math::powers,
    math::powers_free,
    math::steps,
    math::native_angles,
    math::native_powers,
    math::vectors,
    math::directions,
    math::waves,
];

/// A point and its weight.
#[derive(Clone, Copy, Debug, PartialEq, Element)]
#[repr(C)]
pub struct Pair<R> {
    /// The point.
    pub x: R,
    /// Its weight.
    pub w: R,
}

/// An affine map.
#[derive(Clone, Copy, Debug, PartialEq, Element)]
#[repr(C)]
pub struct Affine<R> {
    /// Factor.
    #[range(0.5..=2.0)]
    pub scale: R,
    /// Summand.
    pub offset: R,
}

/// The affine map of the point, its square root and its weight's smaller half.
#[kernel(
    compute,
    threads(64),
    precision(f32, f64),
    parity(non_finite, why = "sums and products of absurd numbers overflow")
)]
pub fn affine<R: Real>(#[uniform] map: &Affine<R>, #[element] pair: Pair<R>) -> Pair<R> {
    let x = (pair.x * map.scale + map.offset).abs();
    Pair {
        x: x.sqrt() / (x + lit!(1.0)),
        w: pair.w.min(pair.w * lit!(0.5)).floor(),
    }
}

/// The sum of the point and its weight as it is rounded, and what the rounding took off (TwoSum:
/// Knuth, The Art of Computer Programming 2, section 4.2.2, theorem B). A compiler that reorders
/// sums finds that nothing was.
#[kernel(
    compute,
    threads(64),
    precision(f32, f64),
    exact,
    parity(non_finite, why = "sums and products of absurd numbers overflow")
)]
pub fn rounding<R: Real>(#[element] pair: Pair<R>) -> Pair<R> {
    let sum = pair.x + pair.w;
    let weight = sum - pair.x;
    Pair {
        x: sum,
        w: (pair.x - (sum - weight)) + (pair.w - weight),
    }
}

/// Constants in a row, each of which rounds. A compiler that makes one constant of two rounds once.
#[kernel(compute, threads(64), precision(f32, f64), exact)]
pub fn constants<R: Real>(#[element] pair: Pair<R>) -> Pair<R> {
    Pair {
        x: pair.x * lit!(0.1) * lit!(0.7) / lit!(3.3) / lit!(1.7),
        w: -(pair.w - lit!(5.3)) + lit!(0.9) - lit!(0.1),
    }
}

/// An index and what to add to what is found there; every kind of field that is no float.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Element)]
#[repr(C)]
pub struct Step {
    /// A signed pair.
    pub delta: IVec2,
    /// An unsigned number.
    pub jump: u32,
    /// A signed number.
    pub turn: i32,
}

/// The sum of two elements of a table, of which one is found by the invocation's own step.
#[kernel(
    compute,
    threads(64),
    parity(non_finite, why = "sums and products of absurd numbers overflow")
)]
pub fn gather(
    #[index] i: u32,
    #[storage] table: Buffer<'_, f32>,
    #[element] step: Step,
    #[constant(id = 3, default = 2)]
    #[values(0, 1, 7)]
    stride: u32,
) -> f32 {
    let sum = step
        .delta
        .x
        .wrapping_add(step.delta.y)
        .wrapping_add(step.turn);
    let far = (i.wrapping_mul(stride).wrapping_add(step.jump) ^ sum as u32) % table.len();
    table.get(i % table.len()) + table.get(far)
}

/// Counts the numbers by their two lowest bits, and keeps the largest.
#[kernel(compute, threads(64))]
pub fn histogram(#[element] x: u32, #[atomic] bins: Atomics<'_>) {
    bins.add(x & 3, 1);
    bins.max(4, x);
}

/// A checkerboard of two values.
#[derive(Clone, Copy, Debug, PartialEq, Element)]
#[repr(C)]
pub struct Checker {
    /// Values of the fields.
    pub colours: [Vec4; 2],
    /// Width and height of a field in texels, at least 1.
    #[range(1..=8)]
    pub field: UVec2,
    /// Fills the structure up.
    pub padding: UVec2,
}

/// A checkerboard.
#[kernel(
    compute,
    threads(8, 8),
    texture(rgba8unorm, rgba16float),
    parity(
        ulp = 0,
        absolute = 4e-3,
        non_finite,
        why = "one step of the format: rounding of a tie is the driver's choice; 16 bits overflow"
    )
)]
pub fn checker(#[index] at: UVec2, #[uniform] checker: &Checker) -> Vec4 {
    let x = at.x / (checker.field.x | 1);
    let y = at.y / (checker.field.y | 1);
    if (x + y) & 1 == 0 {
        checker.colours[0]
    } else {
        checker.colours[1]
    }
}

/// The index itself, in three dimensions.
#[kernel(compute, threads(4, 4, 4), texture(rgba32float))]
pub fn gradient(#[index] at: UVec3) -> Vec4 {
    Vec4::new(at.x as f32, at.y as f32, at.z as f32, 1.0)
}

/// The mean of four texels.
#[kernel(
    compute,
    threads(8, 8),
    texture(r32float),
    parity(non_finite, why = "sums and products of absurd numbers overflow")
)]
pub fn downsample(#[index] at: UVec2, #[texture] source: Texture2d<'_>) -> f32 {
    let last = source.size() - UVec2::ONE;
    let tap = |dx: u32, dy: u32| {
        let (x, y) = (2 * at.x + dx, 2 * at.y + dy);
        let x = if x > last.x { last.x } else { x };
        let y = if y > last.y { last.y } else { y };
        source.load(UVec2::new(x, y)).x
    };
    (tap(0, 0) + tap(1, 0) + (tap(0, 1) + tap(1, 1))) * 0.25
}

/// Integers in a texture.
#[kernel(compute, threads(8, 8), texture(rgba32uint))]
pub fn texel_counts(#[index] at: UVec2) -> UVec4 {
    UVec4::new(at.x, at.y, at.x ^ at.y, at.x.wrapping_mul(at.y))
}

/// The last sample of each texel.
#[kernel(compute, threads(8, 8), texture(rgba32float))]
pub fn last_sample(#[index] at: UVec2, #[texture] source: Texture2dMultisampled<'_>) -> Vec4 {
    let last = source.size() - UVec2::ONE;
    let x = if at.x > last.x { last.x } else { at.x };
    let y = if at.y > last.y { last.y } else { at.y };
    source.load(UVec2::new(x, y), 3)
}

/// A texture through a sampler, at points that the rows give.
#[kernel(compute, threads(64))]
pub fn filtered(
    #[element]
    #[range(-0.5..=1.5)]
    uv: Vec2,
    #[texture] source: Texture2d<'_>,
    #[sampler] sampler: Sampler,
) -> f32 {
    source.sample_level(sampler, uv, 0.0).x
}

/// Texels of a volume.
#[kernel(compute, threads(8, 8), texture(rgba32float))]
pub fn slice(#[index] at: UVec2, #[texture] volume: Texture3d<'_>) -> Vec4 {
    let size = volume.size();
    volume.load(UVec3::new(
        at.x % size.x,
        at.y % size.y,
        (at.x + at.y) % size.z,
    ))
}

/// A vertex moved by a uniform, with a varying.
#[kernel(
    vertex,
    parity(non_finite, why = "sums and products of absurd numbers overflow")
)]
pub fn corner(
    #[attribute] position: Vec3,
    #[attribute] colour: Vec4,
    #[uniform] map: &Affine<f32>,
) -> (Vec4, Vec4) {
    let place = |x: f32| x * map.scale + map.offset;
    (
        Vec4::new(place(position.x), place(position.y), position.z, 1.0),
        colour,
    )
}

/// A colour times a uniform's, and the sum of its channels to a second target.
#[kernel(
    fragment,
    parity(non_finite, why = "sums and products of absurd numbers overflow")
)]
pub fn tint(#[varying] colour: Vec4, #[uniform] map: &Affine<f32>) -> (Vec4, Vec4) {
    let tinted = colour * map.scale;
    // Of the colour itself: drivers may take a common factor out of a sum.
    let sum = colour.x + colour.y + colour.z;
    (tinted, Vec4::new(sum, map.offset, 0.0, 1.0))
}
