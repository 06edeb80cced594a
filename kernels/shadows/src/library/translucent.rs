//! Translucent casters.

use hankel_dsl::function;
use hankel_dsl::glam::{Vec3, Vec4};

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
