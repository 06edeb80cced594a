//! How far before a receiver its blockers are: soft shadows have penumbrae as wide as that.

use hankel_dsl::function;
use hankel_dsl::glam::{Vec2, Vec3, Vec4};
use hankel_moments::{Blockers, blockers_2, blockers_4, blockers_6};

use super::bounds::{four, six};

#[inline(always)]
fn pair(found: Blockers<f32>, epsilon: f32) -> Vec2 {
    Vec2::new(found.share, found.distance(epsilon))
}

/// Moment-based blocker search: the share of the search region that is nearer than `depth` (x, the same as
/// `hamburger_bound`), and its mean distance from there (y), from 0 to `depth` + 1, for depths in [-1, 1].
/// The penumbra of a distant light is as wide as that distance times twice the tangent of the angle from the
/// light's middle to its edge; that of a near light is wider, as the light's distance from the blockers says.
///
/// `epsilon` is how much of the receiver's own depth is added to the mean, 0.001 in the lecture of \[BHS\]:
/// where hardly anything is nearer, the distance goes to 0.
#[function]
pub fn blockers_of_four(moments: Vec4, depth: f32, epsilon: f32) -> Vec2 {
    pair(blockers_4(four(moments), depth), epsilon)
}

/// `blockers_of_four` from six moments: `low` holds moments 1 to 3, `high` moments 4 to 6.
#[function]
pub fn blockers_of_six(low: Vec3, high: Vec3, depth: f32, epsilon: f32) -> Vec2 {
    pair(blockers_6(six(low, high), depth), epsilon)
}

/// `blockers_of_four` from mean (x) and mean square (y), as variance soft shadow mapping has it: what is not
/// nearer is as far as the receiver. `least_variance` is that of `variance_bound`.
#[function]
pub fn blockers_of_two(moments: Vec2, depth: f32, least_variance: f32, epsilon: f32) -> Vec2 {
    pair(
        blockers_2(moments.x, moments.y, depth, least_variance),
        epsilon,
    )
}
