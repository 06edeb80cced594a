//! The few depths that have given moments.

use hankel_dsl::function;
use hankel_dsl::glam::{Vec3, Vec4};
use hankel_moments::{ThreePoints, degenerate_6, sparse_2};

use super::bounds::six;

/// The two depths that have three given moments: the nearer one (x), the farther one (y), and their
/// shares (z, w). Depths are in [-1, 1], the shares add up to 1.
#[function]
pub fn two_depths(moments: Vec3) -> Vec4 {
    let points = sparse_2(moments.x, moments.y, moments.z);
    Vec4::new(points.z1, points.z2, points.w1, points.w2)
}

#[inline(always)]
fn three(low: Vec3, high: Vec3) -> ThreePoints<f32> {
    degenerate_6(six(low, high)).points
}

/// The three depths that explain six moments if any three do, in ascending order and in [-1, 1].
/// `low` holds moments 1 to 3, `high` moments 4 to 6.
#[function]
pub fn three_depths(low: Vec3, high: Vec3) -> Vec3 {
    let points = three(low, high);
    Vec3::new(points.z1, points.z2, points.z3)
}

/// The shares of `three_depths`, in their order; they add up to 1.
#[function]
pub fn three_shares(low: Vec3, high: Vec3) -> Vec3 {
    let points = three(low, high);
    Vec3::new(points.w1, points.w2, points.w3)
}
