//! Translucent casters.

use hankel_dsl::glam::{UVec2, Vec3, Vec4};
use hankel_dsl::{Real, function};

use crate::translucent::kept_depths;

/// What a map of moments stores of translucent surfaces before others (\[BHS\], lecture, "Translucent
/// occluders"): `front` holds moments, or channels in an optimised basis, that have been blended by opacity into
/// zeros, `opacity` is what of the light they take together, `behind` holds those of what lies behind them.
#[function]
pub fn blend_translucent(front: Vec4, opacity: f32, behind: Vec4) -> Vec4 {
    let passes = 1.0 - opacity;
    Vec4::new(
        front.x + passes * behind.x,
        front.y + passes * behind.y,
        front.z + passes * behind.z,
        front.w + passes * behind.w,
    )
}

/// `blend_translucent` for three of six moments.
#[function]
pub fn blend_translucent_six(front: Vec3, opacity: f32, behind: Vec3) -> Vec3 {
    let passes = 1.0 - opacity;
    Vec3::new(
        front.x + passes * behind.x,
        front.y + passes * behind.y,
        front.z + passes * behind.z,
    )
}

/// Four depths of a translucent fragment with depth `z` from 0 to 1, for blending that keeps the least: each is `z`
/// with the probability `opacity`, and else 1 (E. Enderton et al., *Stochastic Transparency*, 2010). A hash of the
/// texel and of the depth decides, so that a picture does not flicker (C. Wyman, M. McGuire, *Hashed Alpha Testing*,
/// 2017).
#[function]
#[inline(always)]
pub fn stochastic_depths(texel: UVec2, z: f32, opacity: f32) -> Vec4 {
    kept_depths(texel, Real::saturate(z), opacity)
}
