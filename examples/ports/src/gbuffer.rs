//! A G-buffer: what a deferred renderer needs of each pixel, in four targets, one of integers.

use hankel_dsl::glam::{Vec2, Vec3, Vec4};
use hankel_dsl::{Element, Flat, Real, Sampler, Texture2d, kernel};

/// Where an object is.
#[derive(Clone, Copy, Debug, PartialEq, Element)]
#[repr(C)]
pub struct Object {
    /// Columns of the matrix from the object to the world; the last one is its place.
    pub to_world: [Vec4; 4],
    /// Columns of the matrix from the world to clip space.
    pub to_clip: [Vec4; 4],
    /// The same of the frame before.
    pub to_clip_before: [Vec4; 4],
    /// The object's number.
    #[range(0..=65535)]
    pub number: u32,
    /// How rough its surface is, 0 to 1.
    #[range(0.0..=1.0)]
    pub roughness: f32,
    /// Fills the structure up.
    pub padding: Vec2,
}

/// A matrix of four columns times a vector.
#[inline(always)]
fn transform(m: &[Vec4; 4], v: Vec4) -> Vec4 {
    m[0] * v.x + m[1] * v.y + m[2] * v.z + m[3] * v.w
}

/// A vertex: its place, now and in the frame before, and its frame of tangent, bitangent, normal. Objects
/// are scaled evenly, so that normals turn as places do.
#[kernel(
    vertex,
    pinned,
    parity(non_finite, why = "sums and products of absurd numbers overflow")
)]
pub fn gbuffer_vertex(
    #[attribute] position: Vec3,
    #[attribute] normal: Vec3,
    #[attribute] tangent: Vec4,
    #[attribute] uv: Vec2,
    #[uniform] object: &Object,
) -> (Vec4, Vec4, Vec4, Vec3, Vec4, Vec2, Flat<f32>, u32) {
    let place = transform(&object.to_world, position.extend(1.0));
    let clip = transform(&object.to_clip, place);
    (
        clip,
        clip,
        transform(&object.to_clip_before, place),
        transform(&object.to_world, normal.extend(0.0)).truncate(),
        transform(&object.to_world, tangent.truncate().extend(0.0))
            .truncate()
            .extend(tangent.w),
        uv,
        Flat(object.roughness),
        object.number,
    )
}

/// A unit vector as a point of a square (Cigolle et al., A Survey of Efficient Representations for
/// Independent Unit Vectors, 2014, section 3.3, "oct"): each coordinate from -1 to 1.
#[inline(always)]
fn octahedral(v: Vec3) -> Vec2 {
    let sum = Real::abs(v.x) + Real::abs(v.y) + Real::abs(v.z);
    let p = Vec2::new(v.x, v.y) / sum;
    if v.z >= 0.0 {
        return p;
    }
    let side = |x: f32| if x >= 0.0 { 1.0 } else { -1.0 };
    Vec2::new(
        (1.0 - Real::abs(p.y)) * side(p.x),
        (1.0 - Real::abs(p.x)) * side(p.y),
    )
}

/// A fragment: base colour and roughness; normal and motion on the screen; depth along the view axis;
/// the object's number.
#[kernel(
    fragment,
    parity(
        ulp = 64,
        absolute = 1e-5,
        non_finite,
        why = "the normal is a sum of interpolated vectors, normalised; absurd ones overflow"
    )
)]
pub fn gbuffer_fragment(
    #[varying]
    #[range(0.5..=1.0)]
    now: Vec4,
    #[varying]
    #[range(0.5..=1.0)]
    before: Vec4,
    #[varying]
    #[unit_vector]
    normal: Vec3,
    #[varying]
    #[unit_vector]
    tangent: Vec4,
    #[varying] uv: Vec2,
    #[varying] roughness: Flat<f32>,
    #[varying] number: u32,
    #[texture]
    #[size(16, 16)]
    colours: Texture2d<'_>,
    #[texture]
    #[size(16, 16)]
    bumps: Texture2d<'_>,
    #[sampler]
    #[address(repeat)]
    sampler: Sampler,
) -> (Vec4, Vec4, f32, u32) {
    let colour = colours.sample(sampler, uv).truncate();
    let bump = bumps.sample(sampler, uv).truncate() * 2.0 - 1.0;
    // Interpolated unit vectors are shorter than 1.
    let unit = |v: Vec3| v / Real::sqrt(v.dot(v) + 1e-20);
    let (normal, across) = (unit(normal), unit(tangent.truncate()));
    let sum = across * bump.x + normal.cross(across) * (bump.y * tangent.w) + normal * bump.z;
    let flat = octahedral(unit(sum));
    // From clip space to texture coordinates, y down.
    let on_screen = |clip: Vec4| Vec2::new(clip.x, -clip.y) / clip.w * 0.5;
    let motion = on_screen(now) - on_screen(before);
    (
        colour.extend(roughness.0),
        Vec4::new(flat.x, flat.y, motion.x, motion.y),
        now.w,
        number,
    )
}
