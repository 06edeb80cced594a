//! What vertex and fragment kernels say beyond their inputs and outputs.

use hankel_dsl::format::Rgba32Float;
use hankel_dsl::glam::{IVec3, UVec2, UVec4, Vec2, Vec3, Vec4};
use hankel_dsl::{
    Atomics, Centroid, ClipDistances, Depth, Element, Flat, Linear, PerSample, SampleMask,
    SecondSource, StorageMut, StorageTexture2d, discard, dpdx, dpdx_coarse, dpdx_fine, dpdy,
    dpdy_coarse, dpdy_fine, fwidth, fwidth_fine, kernel,
};

/// Numbers of the vertex and of its instance, integers, and a float that is not interpolated.
#[kernel(vertex)]
pub fn numbered(
    #[vertex_index] vertex: u32,
    #[instance_index] instance: u32,
    #[attribute] position: Vec4,
    #[attribute] id: u32,
    #[attribute] turn: IVec3,
) -> (Vec4, u32, IVec3, Flat<f32>) {
    (
        position,
        (vertex * 3 + instance * 7) ^ id,
        turn,
        Flat(vertex as f32 * 0.5),
    )
}

/// Varyings that are not interpolated, to an integer target and a float one.
#[kernel(fragment)]
pub fn flat(
    #[varying] id: u32,
    #[varying] turn: IVec3,
    #[varying] weight: Flat<f32>,
) -> (UVec4, f32) {
    (
        UVec4::new(id, turn.x as u32, turn.y as u32, turn.z as u32),
        weight.0,
    )
}

/// Functions of a number's bits, which GLSL ES 3.00 does not have.
#[kernel(fragment)]
pub fn counted_bits(#[varying] id: u32) -> UVec4 {
    UVec4::new(
        id.count_ones(),
        id.leading_zeros(),
        id.trailing_zeros(),
        id.reverse_bits(),
    )
}

/// Where the fragment is and which way it faces; half of the fragments are dropped.
#[kernel(fragment)]
pub fn holes(#[varying] colour: Vec4, #[frag_coord] at: Vec3, #[front_facing] front: bool) -> Vec4 {
    if colour.x < 0.0 {
        discard();
    }
    let sign = if front { 1.0 } else { -1.0 };
    Vec4::new(at.x, at.y, at.z + sign, colour.y)
}

/// A depth beside a colour; some fragments are dropped, of which neither is written.
#[kernel(fragment)]
pub fn deep(#[varying] colour: Vec4, #[varying] near: f32) -> (Vec4, Depth) {
    if colour.x > 0.5 {
        discard();
    }
    (colour, Depth(unit(near)))
}

/// A depth alone.
#[kernel(fragment)]
pub fn only_deep(#[varying] near: f32) -> Depth {
    Depth(unit(near))
}

/// The nearest number from 0 to 1.
#[allow(clippy::manual_clamp, reason = "core's function has more tests in it")]
fn unit(x: f32) -> f32 {
    if x < 0.0 {
        0.0
    } else if x > 1.0 {
        1.0
    } else {
        x
    }
}

/// Derivatives that are the same however coarse they are.
#[kernel(fragment)]
pub fn slopes(#[frag_coord] at: Vec3) -> (Vec4, Vec4) {
    let square = Vec2::new(at.x * at.x, at.y * at.y * 0.5);
    let (x, y) = (dpdx(square), dpdy(square));
    let wide = fwidth(Vec3::new(at.x * 3.0 - at.y, at.y * at.y, -at.x * at.x));
    (
        Vec4::new(x.x, x.y, y.x, y.y),
        Vec4::new(wide.x, wide.y, wide.z, dpdx(at.x * -5.0)),
    )
}

/// Derivatives of the quad's rows and columns, a derivative of a derivative among them.
#[kernel(fragment)]
pub fn grained_slopes(#[frag_coord] at: Vec3) -> (Vec4, Vec4) {
    let value = at.x * at.x * at.y * at.y;
    let twisted = dpdy_fine(dpdx_fine(value));
    (
        Vec4::new(
            dpdx_fine(value),
            dpdy_fine(value),
            fwidth_fine(value),
            twisted,
        ),
        Vec4::new(dpdx_coarse(at.x * at.x), dpdy_coarse(at.y * at.y), 0.0, 1.0),
    )
}

/// The sample of the pixel: the only one where targets have one each.
#[kernel(fragment)]
pub fn sample(#[varying] id: u32, #[sample_index] sample: u32) -> u32 {
    id ^ (sample + 1)
}

/// Where each value is interpolated in a pixel that an edge crosses, and in the perspective of which plane.
#[kernel(vertex, parity(non_finite, why = "sums of absurd numbers overflow"))]
pub fn interpolated(
    #[attribute] position: Vec4,
    #[attribute] uv: Vec2,
    #[attribute] tint: Vec3,
) -> (
    Vec4,
    Vec2,
    Centroid<Vec2>,
    Linear<Vec3>,
    Linear<Centroid<f32>>,
    PerSample<f32>,
    Linear<PerSample<f32>>,
) {
    let (light, shade) = (tint.x + tint.y, tint.z * 0.5);
    (
        position,
        uv,
        Centroid(uv),
        Linear(tint),
        Linear(Centroid(light)),
        PerSample(shade),
        Linear(PerSample(tint.y)),
    )
}

/// A value at the centre of the pixel, and at a place of it that the primitive covers.
#[kernel(fragment)]
pub fn covered_place(#[varying] uv: Vec2, #[varying] within: Centroid<Vec2>) -> Vec4 {
    Vec4::new(uv.x, uv.y, within.0.x, within.0.y)
}

/// Values that are linear on the screen.
#[kernel(fragment)]
pub fn screen_linear(
    #[varying] uv: Vec2,
    #[varying] within: Centroid<Vec2>,
    #[varying] tint: Linear<Vec3>,
    #[varying] light: Linear<Centroid<f32>>,
) -> (Vec4, Vec4) {
    (
        tint.0.extend(light.0.0),
        Vec4::new(uv.x, uv.y, within.0.x, within.0.y),
    )
}

/// Values at each sample, for each of which the kernel runs.
#[kernel(
    fragment,
    parity(non_finite, why = "squares of absurd numbers overflow")
)]
pub fn at_samples(
    #[varying] uv: Vec2,
    #[varying] within: Centroid<Vec2>,
    #[varying] tint: Linear<Vec3>,
    #[varying] light: Linear<Centroid<f32>>,
    #[varying] shade: PerSample<f32>,
    #[varying] green: Linear<PerSample<f32>>,
) -> (Vec4, Vec4) {
    let (shade, green) = (shade.0, green.0.0);
    (
        Vec4::new(shade, shade * shade, green, green * green),
        tint.0
            .extend(if uv.x > within.0.x { light.0.0 } else { uv.y }),
    )
}

/// The samples of the pixel that the primitive covers. Of an odd primitive those are drawn that the number's
/// other bits name, of an even one all.
#[kernel(fragment)]
pub fn coverage(#[varying] id: u32, #[sample_mask] covered: u32) -> (Vec2, SampleMask) {
    let mask = if id & 1 == 0 {
        u32::MAX
    } else {
        covered & (id >> 1)
    };
    (
        Vec2::new(covered as f32, (id & 0xffff) as f32),
        SampleMask(mask),
    )
}

/// The number of the primitive beside one from its vertices.
#[kernel(fragment)]
pub fn primitives(#[varying] id: u32, #[primitive_index] primitive: u32) -> UVec2 {
    UVec2::new(primitive, id ^ (primitive * 5))
}

/// A fragment in its pixel's list.
#[derive(Clone, Copy, Debug, PartialEq, Element)]
#[repr(C)]
pub struct Link {
    /// Whose it is.
    pub id: u32,
    /// The link after it, counted from 1; 0 ends the list.
    pub next: u32,
}

/// A link for each fragment that is not dropped, at the head of its pixel's list (Yang et al., Real-Time
/// Concurrent Linked List Construction on the GPU, 2010, section 3), in whatever order.
#[kernel(fragment)]
pub fn linked(
    #[varying] id: u32,
    #[frag_coord] at: Vec3,
    #[atomic] count: Atomics<'_>,
    #[atomic(unordered)]
    #[length(1024)]
    heads: Atomics<'_>,
    #[storage(unordered)] links: StorageMut<'_, Link>,
) -> u32 {
    if id & 3 == 0 {
        discard();
    }
    let place = count.add(0, 1);
    let next = heads.exchange(at.y as u32 * 64 + at.x as u32, place + 1);
    links.set(place, Link { id, next });
    id
}

/// Slopes to a texture, at the fragment's own texel, and how many fragments lie beyond it: memory is
/// written behind the derivatives.
#[kernel(fragment)]
pub fn sloped(
    #[varying] colour: Vec4,
    #[frag_coord] at: Vec3,
    #[texture] slopes: StorageTexture2d<'_, Rgba32Float>,
    #[atomic] beyond: Atomics<'_>,
) -> Vec4 {
    let (x, y) = (dpdx(at.x * at.x), dpdy(at.y * at.y));
    let place = UVec2::new(at.x as u32, at.y as u32);
    let size = slopes.size();
    if (place.x < size.x) & (place.y < size.y) {
        slopes.store(place, Vec4::new(x, y, at.x, at.y));
    } else {
        beyond.add(0, 1);
    }
    colour
}

/// A vertex between two planes, in front of which a primitive is drawn, with a varying behind their distances.
#[kernel(
    vertex,
    invariant,
    parity(non_finite, why = "sums of absurd numbers overflow")
)]
pub fn clipped(
    #[attribute] position: Vec4,
    #[attribute] planes: Vec2,
    #[attribute] uv: Vec2,
) -> (Vec4, ClipDistances<2>, Vec2) {
    (
        position,
        ClipDistances([position.x + planes.x, planes.y]),
        uv,
    )
}

/// A vertex in a box of six planes.
#[kernel(vertex)]
pub fn boxed(
    #[attribute] position: Vec4,
    #[attribute] least: Vec3,
    #[attribute] most: Vec3,
) -> (Vec4, ClipDistances<6>) {
    (
        position,
        ClipDistances([least.x, least.y, least.z, most.x, most.y, most.z]),
    )
}

/// Stained glass: its own light, and how much of what is behind it each channel lets through.
#[kernel(fragment)]
pub fn stained(
    #[varying]
    #[range(0.0..=1.0)]
    light: Vec4,
    #[varying]
    #[range(0.0..=1.0)]
    tint: Vec4,
) -> (Vec4, SecondSource<Vec4>) {
    (
        light * 0.5,
        SecondSource(Vec4::new(1.0 - tint.x, 1.0 - tint.y, tint.z, tint.w)),
    )
}
