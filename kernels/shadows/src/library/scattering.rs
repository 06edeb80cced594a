//! Single scattering in a homogeneous medium.

use hankel_dsl::function;
use hankel_dsl::glam::Vec2;
use hankel_moments::Bounds;

use crate::scattering::overestimated;

/// What of the light is scattered by an angle with that cosine, for each steradian: the phase function of
/// Henyey and Greenstein (1941). Its integral over all directions is 1. `anisotropy` is its mean cosine, clamped
/// to [-0.99, 0.99]: 0 scatters to all sides alike, above 0 forward.
#[function]
pub fn henyey_greenstein(anisotropy: f32, cosine: f32) -> f32 {
    hankel_moments::henyey_greenstein(anisotropy, cosine)
}

/// The share of light that passes a way of length `distance` through a medium with `extinction` per length:
/// Beer's law. Neither is negative. An optical depth above 80 counts as 80.
#[function]
pub fn transmittance(extinction: f32, distance: f32) -> f32 {
    hankel_moments::transmittance(extinction, distance)
}

/// An inclination as the depth of a rectified shadow map, from -1, nearest to the light, to 1 (\[BHS\], section
/// "Single scattering"). The inclination of a point is `atan2(r, l)` for its distance r from the light's axis
/// through the camera and its place l along it, from 0, where the light goes to, to pi. `middle` is the mean of
/// the bounds of all inclinations, `scale` is one over half of their distance.
#[function]
pub fn rectified_depth(inclination: f32, middle: f32, scale: f32) -> f32 {
    hankel_moments::rectified_depth(inclination, middle, scale)
}

/// The share of a ray that is lit, in [0, 1], from the least (x) and the greatest (y) share of it that is in
/// shadow, as `hamburger_bounds` gives them: the least, which is too bright, where the ray goes with the light, the
/// greatest where it goes against it (\[BHS\], lecture, "Adaptive overestimation"). `cosine` is that of the angle
/// between the ray and the way that the light goes.
#[function]
pub fn lit_share(bounds: Vec2, cosine: f32) -> f32 {
    let bounds = Bounds {
        lower: bounds.x,
        upper: bounds.y,
    };
    overestimated(bounds, cosine)
}
