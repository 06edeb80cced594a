//! Shadow maps of four, six, eight or ten power moments in 32-bit floats, shaded by the bound for any number of
//! moments ([`hankel_moments::bound`]; \[MSM\], Algorithm 2; \[MBD\], Algorithm 1). Moments lie in as many
//! textures as they need: four in one; of more, odd ones in the first and even ones in the second, the ninth and
//! the tenth in a third.

use core::ops::{AddAssign, Div};

use hankel_dsl::glam::{UVec2, Vec3, Vec4};
use hankel_dsl::{Sampler, Texture2d, kernel};
use hankel_moments::{MAX_MOMENTS, bias_target, bound, bound_compensated, mix_bias};

use crate::samples::Samples;
use crate::shade::Light;

/// A texel of each texture.
#[derive(Clone, Copy)]
struct Texels {
    odd: Vec4,
    even: Vec4,
    last: Vec4,
}

impl AddAssign for Texels {
    #[inline(always)]
    fn add_assign(&mut self, other: Self) {
        self.odd += other.odd;
        self.even += other.even;
        self.last += other.last;
    }
}

impl Div<f32> for Texels {
    type Output = Self;
    #[inline(always)]
    fn div(self, by: f32) -> Self {
        Self {
            odd: self.odd / by,
            even: self.even / by,
            last: self.last / by,
        }
    }
}

/// Powers of a depth in [0, 1], moved to [-1, 1].
#[inline(always)]
fn powers(z: f32) -> Texels {
    let z = 2.0 * z - 1.0;
    let z2 = z * z;
    let z3 = z2 * z;
    let z4 = z2 * z2;
    let z5 = z4 * z;
    Texels {
        odd: Vec4::new(z, z3, z5, z4 * z3),
        even: Vec4::new(z2, z4, z3 * z3, z4 * z4),
        last: Vec4::new(z5 * z4, z5 * z5, 0.0, 0.0),
    }
}

/// Means of a texel's eight moments.
#[inline(always)]
fn mean_8(depth: impl Samples, at: UVec2, samples: u32) -> (Vec4, Vec4) {
    let texels = depth.mean_of_depths(at, samples, powers);
    (texels.odd, texels.even)
}

/// Means of a texel's ten moments.
#[inline(always)]
fn mean_10(depth: impl Samples, at: UVec2, samples: u32) -> (Vec4, Vec4, Vec4) {
    let texels = depth.mean_of_depths(at, samples, powers);
    (texels.odd, texels.even, texels.last)
}

of_samples! {
    /// Means of a texel's eight moments, depths moved to [-1, 1], as they are.
    #[kernel(
        compute,
        threads(8, 8),
        outputs(rgba32float, rgba32float),
        forms(fragment),
        inputs = crate::inputs::maps::depths
    )]
    resolve_plain_8,
    resolve_single_plain_8,
    (#[index] at: UVec2,) -> (Vec4, Vec4),
    |depth; samples| { mean_8(depth, at, samples) }
}

of_samples! {
    /// Means of a texel's ten moments, depths moved to [-1, 1], as they are.
    #[kernel(
        compute,
        threads(8, 8),
        outputs(rgba32float, rgba32float, rgba32float),
        inputs = crate::inputs::maps::depths
    )]
    resolve_plain_10,
    resolve_single_plain_10,
    (#[index] at: UVec2,) -> (Vec4, Vec4, Vec4),
    |depth; samples| { mean_10(depth, at, samples) }
}

/// The least shadow that moments 0 to 2N allow for a receiver's depth from 0 to 1. The bias mixes in
/// [`bias_target`].
#[inline(always)]
fn shadow<const N: usize>(light: &Light, m: [f32; MAX_MOMENTS], z: f32) -> f32 {
    bound::<f32, N>(biased::<N>(light, m), 2.0 * z - 1.0).lower
}

/// [`shadow`] with what is ill-conditioned in about twice the digits.
#[inline(always)]
fn shadow_compensated<const N: usize>(light: &Light, m: [f32; MAX_MOMENTS], z: f32) -> f32 {
    bound_compensated::<f32, N>(biased::<N>(light, m), 2.0 * z - 1.0).lower
}

#[inline(always)]
fn biased<const N: usize>(light: &Light, m: [f32; MAX_MOMENTS]) -> [f32; MAX_MOMENTS] {
    mix_bias::<f32, N>(m, bias_target::<f32, N>(), light.moment_bias)
}

/// Moments 0 to 4 from a texel.
#[inline(always)]
fn moments_4(map: Vec4) -> [f32; MAX_MOMENTS] {
    let mut m = [0.0; MAX_MOMENTS];
    m[0] = 1.0;
    m[1] = map.x;
    m[2] = map.y;
    m[3] = map.z;
    m[4] = map.w;
    m
}

/// Moments 0 to 8 from the texels of odd and even ones.
#[inline(always)]
fn moments_8(odd: Vec4, even: Vec4) -> [f32; MAX_MOMENTS] {
    let mut m = [0.0; MAX_MOMENTS];
    m[0] = 1.0;
    m[1] = odd.x;
    m[2] = even.x;
    m[3] = odd.y;
    m[4] = even.y;
    m[5] = odd.z;
    m[6] = even.z;
    m[7] = odd.w;
    m[8] = even.w;
    m
}

/// Moments 0 to 10.
#[inline(always)]
fn moments_10(odd: Vec4, even: Vec4, last: Vec4) -> [f32; MAX_MOMENTS] {
    let mut m = moments_8(odd, even);
    m[9] = last.x;
    m[10] = last.y;
    m
}

/// Shading by a bound of the moments in a texel of each texture: plain and compensated, without and with mip levels.
macro_rules! shadings {
    (
        $n:literal, $moments:ident($($map:ident),*), inputs($inputs:ident);
        $of:ident:
        $(#[$doc:meta])* $shade:ident,
        $(#[$mips_doc:meta])* $mips:ident;
        $compensated:ident:
        $(#[$shade_compensated_doc:meta])* $shade_compensated:ident,
        $(#[$mips_compensated_doc:meta])* $mips_compensated:ident;
        $($how:tt)*
    ) => {
        #[inline(always)]
        fn $of(light: &Light, $($map: Vec4,)* z: f32) -> f32 {
            shadow::<$n>(light, $moments($($map),*), z)
        }

        #[inline(always)]
        fn $compensated(light: &Light, $($map: Vec4,)* z: f32) -> f32 {
            shadow_compensated::<$n>(light, $moments($($map),*), z)
        }

        shading! {
            $(#[$doc])* $shade,
            $(#[$mips_doc])* $mips,
            $of($($map),*), inputs($inputs), uniforms(), constants(),
            $($how)*
        }

        shading! {
            $(#[$shade_compensated_doc])* $shade_compensated,
            $(#[$mips_compensated_doc])* $mips_compensated,
            $compensated($($map),*), inputs($inputs), uniforms(), constants(),
            $($how)*
        }
    };
}

shadings! {
    2, moments_4(map), inputs(moments_4);
    shadow_4:
    /// Shading with the least shadow that four moments allow.
    shade_moments_4,
    /// Shading with the least shadow that four moments allow, with mip levels.
    shade_moments_4_mips;
    shadow_4_compensated:
    /// Shading with the least shadow that four moments allow, with what is ill-conditioned in about twice the digits.
    shade_moments_4_compensated,
    /// Shading with the least shadow that four moments allow, with what is ill-conditioned in about twice the digits,
    /// and with mip levels.
    shade_moments_4_compensated_mips;
    pinned, parity(
        ulp = 0,
        absolute = 2e-3,
        why = "the depth in the light's view is rounded, by up to 3e-7 of the range from -1 to 1; behind a single surface with the least bias, 5e-7, the bound's steepest slope is 2600, and the light's strength is 2.5"
    )
}

shadings! {
    3, moments_8(first, second), inputs(moments_6);
    shadow_6:
    /// Shading with the least shadow that six moments allow.
    shade_moments_6,
    /// Shading with the least shadow that six moments allow, with mip levels.
    shade_moments_6_mips;
    shadow_6_compensated:
    /// Shading with the least shadow that six moments allow, with what is ill-conditioned in about twice the digits.
    shade_moments_6_compensated,
    /// Shading with the least shadow that six moments allow, with what is ill-conditioned in about twice the digits,
    /// and with mip levels.
    shade_moments_6_compensated_mips;
    pinned, parity(
        ulp = 0,
        absolute = 1.7e-3,
        why = "the depth in the light's view is rounded, by up to 3e-7 of the range from -1 to 1; behind a single surface with the least bias, 5e-6, the bound's steepest slope is 2200, and the light's strength is 2.5"
    )
}

shadings! {
    4, moments_8(first, second), inputs(moments_8);
    shadow_8:
    /// Shading with the least shadow that eight moments allow.
    shade_moments_8,
    /// Shading with the least shadow that eight moments allow, with mip levels.
    shade_moments_8_mips;
    shadow_8_compensated:
    /// Shading with the least shadow that eight moments allow, with what is ill-conditioned in about twice the digits.
    shade_moments_8_compensated,
    /// Shading with the least shadow that eight moments allow, with what is ill-conditioned in about twice the digits,
    /// and with mip levels.
    shade_moments_8_compensated_mips;
    pinned, parity(
        ulp = 0,
        absolute = 8e-4,
        why = "the depth in the light's view is rounded, by up to 3e-7 of the range from -1 to 1; behind a single surface with the least bias, 5e-5, the bound's steepest slope is 1000, and the light's strength is 2.5"
    )
}

shadings! {
    5, moments_10(first, second, third), inputs(moments_10);
    shadow_10:
    /// Shading with the least shadow that ten moments allow.
    shade_moments_10,
    /// Shading with the least shadow that ten moments allow, with mip levels.
    shade_moments_10_mips;
    shadow_10_compensated:
    /// Shading with the least shadow that ten moments allow, with what is ill-conditioned in about twice the digits.
    shade_moments_10_compensated,
    /// Shading with the least shadow that ten moments allow, with what is ill-conditioned in about twice the digits,
    /// and with mip levels.
    shade_moments_10_compensated_mips;
    pinned, parity(
        ulp = 0,
        absolute = 5e-4,
        why = "the depth in the light's view is rounded, by up to 3e-7 of the range from -1 to 1; behind a single surface with the least bias, 1.5e-4, the bound's steepest slope is 640, and the light's strength is 2.5"
    )
}
