//! The least shadow that moments allow.

use hankel_dsl::glam::{Vec2, Vec3, Vec4};
use hankel_dsl::{Real, function};
use hankel_moments::{
    Bounds, HalfAngle, Moments4, Moments6, TrigonometricMoments, hamburger_4, hamburger_4_bounds,
    hamburger_6, hausdorff_4, hausdorff_4_symmetric, trigonometric_4_lower, variance_2,
};

/// Moments from a vector.
#[inline(always)]
pub(super) fn four(m: Vec4) -> Moments4<f32> {
    Moments4 {
        b1: m.x,
        b2: m.y,
        b3: m.z,
        b4: m.w,
    }
}

/// Six moments from two vectors.
#[inline(always)]
pub(super) fn six(low: Vec3, high: Vec3) -> Moments6<f32> {
    Moments6 {
        b1: low.x,
        b2: low.y,
        b3: low.z,
        b4: high.x,
        b5: high.y,
        b6: high.z,
    }
}

/// Hamburger four moment shadow mapping: the least share of the filter region that is nearer than
/// `depth`, for depths anywhere; in [0, 1]. Published as \[MSM\], Algorithm 2.
///
/// `moments` are clamped to [-1, 1] and `depth` to [-2, 2]. Any input gives a number in range: no
/// bias is needed for that, but for little error (`mix_bias`).
#[function]
pub fn hamburger_bound(moments: Vec4, depth: f32) -> f32 {
    hamburger_4(four(moments), depth)
}

/// The least (x) and the greatest (y) share of the filter region that is nearer than `depth`, for depths
/// anywhere: `hamburger_bound`, and what it leaves out; both in [0, 1].
#[function]
pub fn hamburger_bounds(moments: Vec4, depth: f32) -> Vec2 {
    pair(hamburger_4_bounds(four(moments), depth))
}

/// Hausdorff four moment shadow mapping: the least share of the filter region that is nearer than
/// `depth`, for depths in [0, 1]; in [0, 1], and never less than `hamburger_bound`. Published as
/// \[MSM\], Algorithm 4.
///
/// `moments` are those of depths in [0, 1]; they and `depth` are clamped there.
#[function]
pub fn hausdorff_bound(moments: Vec4, depth: f32) -> f32 {
    hausdorff_4(four(moments), depth)
}

/// `hausdorff_bound` for depths in [-1, 1]; `moments` and `depth` are clamped there. It is more
/// accurate than to move the moments to [0, 1] first.
#[function]
pub fn hausdorff_symmetric_bound(moments: Vec4, depth: f32) -> f32 {
    hausdorff_4_symmetric(four(moments), depth)
}

/// Variance shadow mapping: the least share of the filter region that is nearer than `depth`, from mean
/// (x) and mean square (y), by Chebyshev's inequality; in [0, 1].
///
/// `least_variance` > 0 keeps a surface from shadowing itself.
#[function]
pub fn variance_bound(moments: Vec2, depth: f32, least_variance: f32) -> f32 {
    variance_2(moments.x, moments.y, depth, least_variance)
}

#[inline(always)]
pub(super) fn pair(bounds: Bounds<f32>) -> Vec2 {
    Vec2::new(bounds.lower, bounds.upper)
}

/// Six moment shadow mapping: the least (x) and the greatest (y) share of the filter region that is
/// nearer than `depth`, for depths in [-1, 1]; both in [0, 1].
///
/// `low` holds moments 1 to 3, `high` moments 4 to 6; they are clamped to [-1, 1].
#[function]
pub fn hamburger_six_bounds(low: Vec3, high: Vec3, depth: f32) -> Vec2 {
    pair(hamburger_6(six(low, high), depth))
}

/// The least share of the filter region that is nearer than the depth z with cosine and sine of pi z, for
/// `trigonometric_bounds`: the greatest is 1 minus the least of the mirrored moments at the mirrored depth.
#[function]
pub fn least_trigonometric_share(moments: Vec4, cosine: f32, sine: f32) -> f32 {
    let m = TrigonometricMoments {
        c1: moments.x,
        s1: moments.y,
        c2: moments.z,
        s2: moments.w,
    };
    trigonometric_4_lower(m, HalfAngle::of_unit_vector(cosine, sine))
}

/// Trigonometric moment shadow mapping: the least (x) and the greatest (y) share of the filter region
/// that is nearer than `depth`, for depths in [0, 1]; both in [0, 1].
///
/// `moments` are the means of the cosine and the sine of 2 pi z (x, y) and of 4 pi z (z, w); they are
/// clamped to [-1, 1]. The bias scales them by 1 - strength.
#[function]
pub fn trigonometric_bounds(moments: Vec4, depth: f32) -> Vec2 {
    let angle = HalfAngle::of_depth(depth);
    let mirrored = Vec4::new(moments.x, -moments.y, moments.z, -moments.w);
    let above = least_trigonometric_share(mirrored, -angle.cos(), angle.sin());
    let least = least_trigonometric_share(moments, angle.cos(), angle.sin());
    Vec2::new(least, Real::max(-above + 1.0, least))
}

/// Between the least share (x) and the greatest (y): the least for `overestimation` 0, the greatest
/// for 1.
#[function]
pub fn blend_bounds(bounds: Vec2, overestimation: f32) -> f32 {
    let both = Bounds {
        lower: bounds.x,
        upper: bounds.y,
    };
    both.blend(overestimation)
}

/// `moments` with a little of a fixed, valid vector mixed in, so that rounding does not leave them
/// invalid: `strength` from 0 to 1 of `bias_target`. The published ones are constants.
#[function]
pub fn mix_bias(moments: Vec4, bias_target: Vec4, strength: f32) -> Vec4 {
    let m = four(moments).lerp(four(bias_target), strength);
    Vec4::new(m.b1, m.b2, m.b3, m.b4)
}

/// `mix_bias` for three of six moments: moments 1 to 3 with the target's, or moments 4 to 6.
#[function]
pub fn mix_bias_six(moments: Vec3, bias_target: Vec3, strength: f32) -> Vec3 {
    Vec3::new(
        Real::lerp(moments.x, bias_target.x, strength),
        Real::lerp(moments.y, bias_target.y, strength),
        Real::lerp(moments.z, bias_target.z, strength),
    )
}

/// Takes a shadow of `1 - leak` for full shadow and scales the rest, so that weak light leaking
/// disappears. `shadow` and the result are in [0, 1]; `leak` is in [0, 0.5], 0.02 in the lecture.
#[function]
pub fn cut_leak(shadow: f32, leak: f32) -> f32 {
    hankel_moments::cut_leak(shadow, leak)
}
