//! Exponential and exponential variance shadow maps.

use hankel_dsl::glam::Vec4;
use hankel_dsl::{Real, function};
use hankel_moments::{markov_1, warped_2};

use crate::exponential::{Exponents, exponential};

/// What an exponential shadow map stores (\[ESM\], section 3): `exp(exponent * depth)`, for depths in [0, 1].
/// The exponent is from 0 to 80. The mean over a filter region is that of its depths.
#[function]
pub fn exponential_of_depth(depth: f32, exponent: f32) -> f32 {
    exponential(exponent, depth)
}

/// Exponential shadow mapping: the least share of the filter region that is nearer than `depth`, from the
/// mean of `exponential_of_depth`; in [0, 1] (\[ESM\]; Markov's inequality).
#[function]
pub fn exponential_bound(mean: f32, depth: f32, exponent: f32) -> f32 {
    markov_1(mean, exponential(exponent, depth))
}

/// What an exponential variance shadow map stores of a depth in [0, 1] (\[LVSM\]): a warp that grows with depth,
/// `exp(p (2 depth - 1))`, and its square (x, y); one that falls, `exp(-n (2 depth - 1))`, and its square (z, w).
/// The exponents p and n are from 0 to 42 for maps of 32-bit floats, to 5.54 for 16 bits.
#[function]
pub fn exponential_moments_of_depth(
    depth: f32,
    positive_exponent: f32,
    negative_exponent: f32,
) -> Vec4 {
    let exponents = Exponents {
        positive: positive_exponent,
        negative: negative_exponent,
    };
    let (positive, negative) = exponents.warp(depth);
    Vec4::new(positive, positive * positive, negative, negative * negative)
}

/// Exponential variance shadow mapping: the least share of the filter region that is nearer than `depth`, in
/// [0, 1], from means of `exponential_moments_of_depth`: the larger of what both warps give (\[LVSM\]).
///
/// `least_variance`, in [0, 1], is relative: a variance is taken to be that share of the squared warp at least.
#[function]
pub fn exponential_variance_bound(
    warped: Vec4,
    depth: f32,
    positive_exponent: f32,
    negative_exponent: f32,
    least_variance: f32,
) -> f32 {
    let exponents = Exponents {
        positive: positive_exponent,
        negative: negative_exponent,
    };
    let (positive, negative) = exponents.warp(depth);
    let (nearer, _) = warped_2(warped.x, warped.y, positive, least_variance);
    // What falls with depth is larger where depth is less.
    let (_, also_nearer) = warped_2(warped.z, warped.w, negative, least_variance);
    Real::max(nearer, also_nearer)
}
