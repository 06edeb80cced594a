//! Variance shadow maps (\[VSM\] of [`hankel_moments`]), from depths to shading: a depth and its square are filtered,
//! in two channels.

use hankel_dsl::glam::{UVec2, Vec2, Vec3, Vec4};
use hankel_dsl::{Real, Sampler, Texture2d, kernel};
use hankel_moments::variance_2;

use crate::samples::{Samples, mean_of};
use crate::shade::{Light, encoding, in_range};
use crate::translucent::depth_and_opacity;

/// The two moments of a depth from 0 to 1, as a map has them. Where depths are in [-1, 1], 16 bits have the first one moved
/// to [0, 1].
#[inline(always)]
fn two(z: f32, how: u32) -> Vec2 {
    let x = in_range(z, how);
    let first = if how == encoding::SYMMETRIC { z } else { x };
    Vec2::new(first, x * x)
}

/// Moments from a map's texel.
#[inline(always)]
fn decode(texel: Vec4, how: u32) -> Vec2 {
    let first = if how == encoding::SYMMETRIC {
        2.0 * texel.x - 1.0
    } else {
        texel.x
    };
    Vec2::new(first, texel.y)
}

of_samples! {
    /// Mean of a texel's depths and of their squares: a variance shadow map.
    #[kernel(
        compute,
        threads(8, 8),
        texture(rg16unorm, rg32float),
        forms(fragment),
        inputs = crate::inputs::maps::depths,
        parity(
            ulp = 0,
            absolute = 1.6e-5,
            exact(rg32float),
            why = "sums and products only, then rounding to 1/65535: drivers may round a tie either way, which is one step"
        )
    )]
    resolve_variance,
    resolve_single_variance,
    (
        #[index] at: UVec2,
        #[constant(id = 1, default = 2)]
        #[values(encoding::PLAIN, encoding::UNIT, encoding::SYMMETRIC)]
        encoding: u32,
    ) -> Vec2,
    |depth; samples| { depth.mean_of_depths(at, samples, |z| two(z, encoding)) }
}

/// A translucent fragment's two moments as `encoding` says, for alpha blending into zeros. Alpha is the opacity.
#[kernel(
    fragment,
    inputs = crate::inputs::translucent::places,
    parity(
        ulp = 0,
        absolute = 4e-6,
        why = "sums of products: drivers may contract two of them, and so leave out the rounding of products of at most 1"
    )
)]
pub fn translucent_variance(
    #[varying]
    #[range(0.0..=1.0)]
    surface: Vec4,
    #[varying] place: Vec4,
    #[constant(id = 0, default = 2)]
    #[values(encoding::PLAIN, encoding::UNIT, encoding::SYMMETRIC)]
    encoding: u32,
) -> Vec4 {
    let (depth, opacity) = depth_and_opacity(surface, place);
    let m = two(depth, encoding);
    Vec4::new(m.x, m.y, 0.0, opacity)
}

of_samples! {
    /// The same as [`resolve_variance`]: in each sample, what [`translucent_variance`] has blended, before the opaque
    /// surface.
    #[kernel(
        compute,
        threads(8, 8),
        texture(rg16unorm, rg32float),
        forms(fragment),
        inputs = crate::inputs::translucent::blended_variance,
        parity(
            ulp = 0,
            absolute = 1.6e-5,
            exact(rg32float),
            non_finite,
            why = "sums and products only, then rounding to 1/65535: drivers may round a tie either way, which is one step"
        )
    )]
    resolve_translucent_variance,
    resolve_single_translucent_variance,
    (
        #[index] at: UVec2,
        #[constant(id = 1, default = 2)]
        #[values(encoding::PLAIN, encoding::UNIT, encoding::SYMMETRIC)]
        encoding: u32,
    ) -> Vec2,
    |depth, blended; samples| {
        mean_of(samples, |i| {
            let opaque = two(Real::saturate(depth.load_sample(at, i).x), encoding);
            let front = blended.load_sample(at, i);
            let passes = 1.0 - front.w;
            Vec2::new(front.x + passes * opaque.x, front.y + passes * opaque.y)
        })
    }
}

/// The least shadow that a texel's mean and variance allow for a receiver's depth from 0 to 1.
#[inline(always)]
fn variance_shadow(light: &Light, texel: Vec4, z: f32, how: u32) -> f32 {
    let m = decode(texel, how);
    variance_2(m.x, m.y, in_range(z, how), light.moment_bias)
}

shading! {
    /// Shading with variance shadow mapping. The moments are as they are: against rounding, `moment_bias` is the least
    /// variance.
    shade_variance,
    /// Shading with variance shadow mapping, with mip levels.
    shade_variance_mips,
    variance_shadow(map), inputs(shaded_variance), uniforms(), constants(
        #[constant(id = 0, default = 2)]
        #[values(encoding::PLAIN, encoding::UNIT, encoding::SYMMETRIC)]
        encoding: u32
    ),
    parity(
        ulp = 0,
        absolute = 5e-4,
        why = "the depth in the light's view is rounded, by up to 3e-7, and the bound's steepest slope with the least bias, 5e-7, is 1400"
    )
}
