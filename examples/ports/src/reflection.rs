//! Reflections of an environment that is a cube, blurred for rough surfaces by its mip levels.

use hankel_dsl::glam::{Vec3, Vec4};
use hankel_dsl::{Element, Real, Sampler, TextureCube, kernel};

/// A surface.
#[derive(Clone, Copy, Debug, PartialEq, Element)]
#[repr(C)]
pub struct Material {
    /// Reflectance along the normal, and roughness, 0 to 1.
    #[range(0.0..=1.0)]
    pub specular: Vec4,
    /// Albedo of what is not reflected.
    #[range(0.0..=1.0)]
    pub diffuse: Vec4,
}

/// From the world to the picture.
#[derive(Clone, Copy, Debug, PartialEq, Element)]
#[repr(C)]
pub struct Eye {
    /// Columns of the matrix from the world to clip space.
    pub to_clip: [Vec4; 4],
    /// Where the eye is.
    pub place: Vec4,
}

/// A vertex of a surface: its normal, and the way to the eye.
#[kernel(
    vertex,
    pinned,
    parity(non_finite, why = "sums and products of absurd numbers overflow")
)]
pub fn reflection_vertex(
    #[attribute] position: Vec3,
    #[attribute] normal: Vec3,
    #[uniform] eye: &Eye,
) -> (Vec4, Vec3, Vec3) {
    let m = &eye.to_clip;
    (
        m[0] * position.x + m[1] * position.y + m[2] * position.z + m[3],
        normal,
        eye.place.truncate() - position,
    )
}

/// The light that a surface reflects: sharp or blurred in the mirrored direction, by Schlick's
/// reflectance (An Inexpensive BRDF Model for Physically-based Rendering, 1994, equation 15), and from
/// everywhere by the last level. `view` points from the surface to the eye.
#[kernel(
    fragment,
    parity(
        ulp = 64,
        absolute = 1e-5,
        non_finite,
        why = "lengths of absurd vectors overflow; the fifth power has five roundings"
    )
)]
pub fn reflection(
    #[varying]
    #[unit_vector]
    normal: Vec3,
    #[varying]
    #[unit_vector]
    view: Vec3,
    #[uniform] material: &Material,
    #[texture]
    #[size(16, 16)]
    #[levels(5)]
    environment: TextureCube<'_>,
    #[sampler]
    #[filter(nearest)]
    #[mip_filter(nearest)]
    sampler: Sampler,
) -> Vec4 {
    let normal = normal / Real::sqrt(normal.dot(normal) + 1e-20);
    let view = view / Real::sqrt(view.dot(view) + 1e-20);
    let cosine = normal.dot(view);
    let mirrored = normal * (2.0 * cosine) - view;
    let last = environment.levels() as f32 - 1.0;
    let sharp = environment.sample_level(sampler, mirrored, material.specular.w * last);
    let around = environment.sample_level(sampler, normal, last);
    let away = 1.0 - Real::saturate(cosine);
    let square = away * away;
    let fresnel = square * square * away;
    let f0 = material.specular.truncate();
    let reflectance = f0 + (1.0 - f0) * fresnel;
    let diffuse = material.diffuse.truncate() * around.truncate();
    (sharp.truncate() * reflectance + diffuse * (1.0 - reflectance)).extend(1.0)
}
