//! Bounds from two to twelve power moments with a free total.

use hankel_dsl::function;
use hankel_dsl::glam::{Vec2, Vec3, Vec4};
use hankel_moments::{MAX_MOMENTS, bound, bound_compensated};

use super::bounds::pair;

/// The least (x) and the greatest (y) amount below `depth`, from two power moments and their total;
/// both from 0 to `total`. Depths may be anywhere.
#[function]
pub fn bounds_of_two(total: f32, moments: Vec2, depth: f32) -> Vec2 {
    let mut m = [0.0_f32; MAX_MOMENTS];
    m[0] = total;
    m[1] = moments.x;
    m[2] = moments.y;
    pair(bound::<f32, 1>(m, depth))
}

#[inline(always)]
fn four(total: f32, moments: Vec4) -> [f32; MAX_MOMENTS] {
    let mut m = [0.0_f32; MAX_MOMENTS];
    m[0] = total;
    m[1] = moments.x;
    m[2] = moments.y;
    m[3] = moments.z;
    m[4] = moments.w;
    m
}

#[inline(always)]
fn six(total: f32, low: Vec3, high: Vec3) -> [f32; MAX_MOMENTS] {
    let mut m = [0.0_f32; MAX_MOMENTS];
    m[0] = total;
    m[1] = low.x;
    m[2] = low.y;
    m[3] = low.z;
    m[4] = high.x;
    m[5] = high.y;
    m[6] = high.z;
    m
}

#[inline(always)]
fn eight(total: f32, low: Vec4, high: Vec4) -> [f32; MAX_MOMENTS] {
    let mut m = four(total, low);
    m[5] = high.x;
    m[6] = high.y;
    m[7] = high.z;
    m[8] = high.w;
    m
}

/// The least (x) and the greatest (y) amount below `depth`, from four power moments and their total;
/// both from 0 to `total`. Depths may be anywhere.
#[function]
pub fn bounds_of_four(total: f32, moments: Vec4, depth: f32) -> Vec2 {
    pair(bound::<f32, 2>(four(total, moments), depth))
}

/// `bounds_of_four` with the ill-conditioned part in about twice the digits.
#[function]
pub fn bounds_of_four_compensated(total: f32, moments: Vec4, depth: f32) -> Vec2 {
    pair(bound_compensated::<f32, 2>(four(total, moments), depth))
}

/// The least (x) and the greatest (y) amount below `depth`, from six power moments (1 to 3 in `low`,
/// 4 to 6 in `high`) and their total; both from 0 to `total`. Depths may be anywhere.
#[function]
pub fn bounds_of_six(total: f32, low: Vec3, high: Vec3, depth: f32) -> Vec2 {
    pair(bound::<f32, 3>(six(total, low, high), depth))
}

/// `bounds_of_six` with the ill-conditioned part in about twice the digits.
#[function]
pub fn bounds_of_six_compensated(total: f32, low: Vec3, high: Vec3, depth: f32) -> Vec2 {
    pair(bound_compensated::<f32, 3>(six(total, low, high), depth))
}

/// The least (x) and the greatest (y) amount below `depth`, from eight power moments (1 to 4 in `low`,
/// 5 to 8 in `high`) and their total; both from 0 to `total`. Depths may be anywhere.
#[function]
pub fn bounds_of_eight(total: f32, low: Vec4, high: Vec4, depth: f32) -> Vec2 {
    pair(bound::<f32, 4>(eight(total, low, high), depth))
}

/// The least (x) and the greatest (y) amount below `depth`, from ten power moments (1 to 4 in `low`,
/// 5 to 8 in `middle`, 9 and 10 in `high`) and their total; both from 0 to `total`. Depths may be
/// anywhere.
#[function]
pub fn bounds_of_ten(total: f32, low: Vec4, middle: Vec4, high: Vec2, depth: f32) -> Vec2 {
    let mut m = eight(total, low, middle);
    m[9] = high.x;
    m[10] = high.y;
    pair(bound::<f32, 5>(m, depth))
}

/// The least (x) and the greatest (y) amount below `depth`, from twelve power moments (1 to 4 in `low`,
/// 5 to 8 in `middle`, 9 to 12 in `high`) and their total; both from 0 to `total`. Depths may be
/// anywhere.
#[function]
pub fn bounds_of_twelve(total: f32, low: Vec4, middle: Vec4, high: Vec4, depth: f32) -> Vec2 {
    let mut m = eight(total, low, middle);
    m[9] = high.x;
    m[10] = high.y;
    m[11] = high.z;
    m[12] = high.w;
    pair(bound::<f32, 6>(m, depth))
}
