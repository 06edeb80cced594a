//! Single scattering in a homogeneous medium: phase function, transmittance, and the coordinates in which
//! rays from the camera are rows of a shadow map (\[BHS\], section "Single scattering" and section 1 of the
//! supplement; \[PSS\]).
//!
//! The camera is the origin and the light goes along z. A point has a radius r, its distance from the axis;
//! an azimuth φ about it; and an inclination θ towards it, 0 where the light goes to. All points of a ray from
//! the camera share φ and θ. A point with less θ is farther from the light than one with more, at the same
//! r and φ. So with π - θ as its depth, a shadow map over r and φ tells of all rays with one φ in one row.

use hankel_dsl::math::{self, Elementary};
use hankel_dsl::{Element, Real, lit};

use crate::moments::{within, within_one};

/// What of the light is scattered by an angle with that cosine, for each steradian: the phase function of
/// Henyey and Greenstein (1941). Its mean cosine is `g`, which is clamped to [-0.99, 0.99]: 0 scatters to all
/// sides alike, above 0 forward. The result is above 0, and its integral over all directions is 1.
#[inline(always)]
pub fn henyey_greenstein<R: Real>(g: R, cosine: R) -> R {
    let one: R = lit!(1.0);
    let g = within(g, lit!(-0.99), lit!(0.99));
    let square = g * g;
    let x = one + square - g * within(cosine, -one, one) * lit!(2.0);
    // (1 - |g|)² is 1e-4 at least.
    let x = x.max(lit!(1e-4));
    (one - square) / (x * x.sqrt()) * lit!(0.25 / core::f64::consts::PI)
}

/// The share of light that passes a way of length `distance` through a medium with `extinction` per length:
/// Beer's law. Neither is less than 0. An optical depth above 80 counts as 80, which is 2e-35.
#[inline(always)]
pub fn transmittance<R: Elementary>(extinction: R, distance: R) -> R {
    math::exp(-within(extinction * distance, lit!(0.0), lit!(80.0)))
}

/// Where the rays of a view lie about the light's axis.
#[derive(Clone, Copy, Debug, PartialEq, Element)]
#[repr(C)]
pub struct RectifiedBounds<R> {
    /// The largest radius; the least is 0.
    pub radius: R,
    /// The azimuth in the middle of all.
    pub azimuth: R,
    /// How far azimuths go to each side of it, from 0 to π.
    pub half_azimuth: R,
    /// The least inclination, from 0 to π.
    pub least: R,
    /// The largest inclination, from 0 to π.
    pub largest: R,
}

#[inline(always)]
fn cross<R: Real>(a: [R; 3], b: [R; 3]) -> R {
    a[0] * b[1] - a[1] * b[0]
}

/// The distance from the axis.
#[inline(always)]
fn radius<R: Real>(p: [R; 3]) -> R {
    (p[0] * p[0] + p[1] * p[1]).sqrt()
}

/// The inclination of a point by its distance from the axis and its place along it, from 0 to π.
#[inline(always)]
pub fn inclination<R: Elementary>(radius: R, along: R) -> R {
    math::atan2(radius.abs(), along)
}

/// Between two points.
#[inline(always)]
fn between<R: Real>(a: [R; 3], b: [R; 3], t: R) -> [R; 3] {
    [a[0].lerp(b[0], t), a[1].lerp(b[1], t), a[2].lerp(b[2], t)]
}

/// Which of both ends of the axis a view holds: where the light goes to, and where it comes from.
#[inline(always)]
fn poles<R: Real>(q: [[R; 3]; 4]) -> (R::Mask, R::Mask) {
    let zero: R = lit!(0.0);
    let turns = [
        cross(q[0], q[1]),
        cross(q[1], q[2]),
        cross(q[2], q[3]),
        cross(q[3], q[0]),
    ];
    let positive = turns[0].gt(zero) & turns[1].gt(zero) & turns[2].gt(zero) & turns[3].gt(zero);
    let negative = turns[0].lt(zero) & turns[1].lt(zero) & turns[2].lt(zero) & turns[3].lt(zero);
    // Where the axis meets the far plane: n · q0 over n's last component, of which only the sign counts.
    let (u, v) = (
        [q[1][0] - q[0][0], q[1][1] - q[0][1], q[1][2] - q[0][2]],
        [q[3][0] - q[0][0], q[3][1] - q[0][1], q[3][2] - q[0][2]],
    );
    let n = [
        u[1] * v[2] - u[2] * v[1],
        u[2] * v[0] - u[0] * v[2],
        u[0] * v[1] - u[1] * v[0],
    ];
    let height = (n[0] * q[0][0] + n[1] * q[0][1] + n[2] * q[0][2]) * n[2];
    let surrounds = positive | negative;
    (surrounds & height.gt(zero), surrounds & height.lt(zero))
}

/// The bounds of radius, azimuth and inclination of all rays of a view (\[BHS\], section 1 of the
/// supplement). `corners` are those of the far plane, one after the other around it, from the camera, in
/// coordinates whose z goes along the light. The near plane does not count: rays start at the camera.
///
/// Where the view holds an end of the axis, azimuths go all around, and an inclination is 0 or π. Otherwise
/// the extreme azimuths are those of two corners, and the extreme inclinations those of corners or of a point
/// of an edge, where the derivative of the cosine along the edge is 0.
#[must_use]
pub fn rectified_bounds<R: Elementary>(corners: [[R; 3]; 4]) -> RectifiedBounds<R> {
    let (zero, one): (R, R) = (lit!(0.0), lit!(1.0));
    let pi: R = lit!(core::f64::consts::PI);
    let (to, from) = poles(corners);
    let mut bounds = RectifiedBounds {
        radius: zero,
        azimuth: zero,
        half_azimuth: zero,
        least: pi,
        largest: zero,
    };
    let mut widest: R = lit!(-1.0);
    for (i, a) in corners.into_iter().enumerate() {
        bounds.radius = bounds.radius.max(radius(a));
        for b in corners.into_iter().skip(i + 1) {
            let dot = a[0] * b[0] + a[1] * b[1];
            let angle = math::atan2(cross(a, b), dot);
            let is_wider = angle.abs().gt(widest);
            let middle = math::atan2(a[1], a[0]) + angle * lit!(0.5);
            bounds.azimuth = R::select(is_wider, middle, bounds.azimuth);
            widest = R::select(is_wider, angle.abs(), widest);
        }
        let b = corners[(i + 1) % 4];
        let d = [b[0] - a[0], b[1] - a[1], b[2] - a[2]];
        let (aa, ad, dd) = (
            a[0] * a[0] + a[1] * a[1] + a[2] * a[2],
            a[0] * d[0] + a[1] * d[1] + a[2] * d[2],
            d[0] * d[0] + d[1] * d[1] + d[2] * d[2],
        );
        let under = d[2] * ad - a[2] * dd;
        let t = (a[2] * ad - d[2] * aa) / R::select(under.eq(zero), one, under);
        // Beyond the edge, the corner itself.
        let t = R::select(under.eq(zero), zero, within(t, zero, one));
        for p in [a, between(a, b, t)] {
            let inclination = inclination(radius(p), p[2]);
            bounds.least = bounds.least.min(inclination);
            bounds.largest = bounds.largest.max(inclination);
        }
    }
    bounds.half_azimuth = R::select(to | from, pi, widest * lit!(0.5));
    bounds.least = R::select(to, zero, bounds.least);
    bounds.largest = R::select(from, pi, bounds.largest);
    bounds
}

/// The least and the largest inclination of those rays of a view that have this azimuth; the first is larger
/// if there are none. `corners` as in [`rectified_bounds`].
#[must_use]
pub fn row_inclinations<R: Elementary>(corners: [[R; 3]; 4], azimuth: R) -> (R, R) {
    let (zero, one): (R, R) = (lit!(0.0), lit!(1.0));
    let pi: R = lit!(core::f64::consts::PI);
    let (to, from) = poles(corners);
    let (sin, cos) = math::sin_cos(azimuth);
    let way = [cos, sin, zero];
    let (mut least, mut largest) = (R::select(to, zero, pi), R::select(from, pi, zero));
    for (i, a) in corners.into_iter().enumerate() {
        let b = corners[(i + 1) % 4];
        let (at_a, at_b) = (cross(way, a), cross(way, b));
        let crosses = (at_a.le(zero) & at_b.ge(zero)) | (at_a.ge(zero) & at_b.le(zero));
        let under = at_a - at_b;
        let t = at_a / R::select(under.eq(zero), one, under);
        let p = between(a, b, within(t, zero, one));
        let is_there = crosses & (p[0] * cos + p[1] * sin).ge(zero);
        let inclination = inclination(radius(p), p[2]);
        least = R::select(is_there, least.min(inclination), least);
        largest = R::select(is_there, largest.max(inclination), largest);
    }
    (least, largest)
}

/// What extinction along a row of rectified coordinates is per unit of radius. A ray with inclination θ goes
/// 1 / sin θ for each unit of radius, and the rays of a row differ in θ: one in their middle stands for all.
/// `least` and `largest` are from 0 to π; 1 / sin θ is at most 100.
#[inline(always)]
#[must_use]
pub fn row_extinction<R: Elementary>(extinction: R, least: R, largest: R) -> R {
    let middle = (least + largest) * lit!(0.5);
    extinction / math::sin(middle).max(lit!(0.01))
}

/// An inclination as a depth from -1, nearest to the light, to 1: π - θ, of which the bounds are mapped
/// to these ends and what is beyond to the nearer one. `middle` is the mean of the bounds, `scale` one over
/// half of their distance.
#[inline(always)]
pub fn rectified_depth<R: Real>(inclination: R, middle: R, scale: R) -> R {
    within_one((middle - inclination) * scale)
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::f64::consts::PI;
    use proptest::prelude::*;

    type Point = [f64; 3];

    fn dot(a: Point, b: Point) -> f64 {
        a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
    }

    fn crossed(a: Point, b: Point) -> Point {
        [
            a[1] * b[2] - a[2] * b[1],
            a[2] * b[0] - a[0] * b[2],
            a[0] * b[1] - a[1] * b[0],
        ]
    }

    fn scaled(a: Point, by: f64) -> Point {
        a.map(|x| x * by)
    }

    fn sum(a: Point, b: Point) -> Point {
        [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
    }

    fn unit(a: Point) -> Point {
        scaled(a, 1.0 / dot(a, a).sqrt())
    }

    /// The far plane's corners of a camera that looks along `forward`, turned by `roll`.
    fn corners(forward: Point, roll: f64, [x, y]: [f64; 2], far: f64) -> [Point; 4] {
        let forward = unit(forward);
        let aside = if forward[0].abs() < 0.8 {
            [1.0, 0.0, 0.0]
        } else {
            [0.0, 1.0, 0.0]
        };
        let right = unit(crossed(forward, aside));
        let up = crossed(right, forward);
        let (sin, cos) = roll.sin_cos();
        let across = sum(scaled(right, cos), scaled(up, sin));
        let down = sum(scaled(right, -sin), scaled(up, cos));
        [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]].map(|[i, j]| {
            let aside = sum(scaled(across, i * x), scaled(down, j * y));
            scaled(sum(forward, aside), far)
        })
    }

    /// A point of the far plane.
    fn at(q: [Point; 4], s: f64, t: f64) -> Point {
        between(between(q[0], q[1], s), between(q[3], q[2], s), t)
    }

    fn view() -> impl Strategy<Value = [Point; 4]> {
        let direction = [-1.0..1.0, -1.0..1.0, -1.0..1.0_f64]
            .prop_filter("a direction", |d| dot(*d, *d) > 1e-3);
        let axis = prop_oneof![
            Just([0.0, 0.0, 1.0]),
            Just([0.0, 0.0, -1.0]),
            Just([1.0, 0.0, 0.0]),
            Just([0.05, 0.0, 1.0]),
        ];
        let forward = prop_oneof![3 => direction, 1 => axis];
        (forward, 0.0..6.3, [0.05..2.0, 0.05..2.0_f64], 0.1..100.0)
            .prop_map(|(forward, roll, half, far)| corners(forward, roll, half, far))
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(2000))]

        /// All points of the far plane lie within the bounds, and the bounds are no wider than they.
        #[test]
        fn bounds_hold_the_view_and_nothing_else(q in view()) {
            let b = rectified_bounds(q);
            let (mut largest, mut least, mut most, mut around) = (0.0_f64, PI, 0.0_f64, 0.0_f64);
            const N: usize = 65;
            for i in 0..N * N {
                let share = |k: usize| k as f64 / (N - 1) as f64;
                let p = at(q, share(i % N), share(i / N));
                let theta = f64::acos(p[2] / dot(p, p).sqrt());
                largest = largest.max(p[0].hypot(p[1]));
                (least, most) = (least.min(theta), most.max(theta));
                let mut phi = f64::atan2(p[1], p[0]) - b.azimuth;
                phi -= (phi / (2.0 * PI)).round() * 2.0 * PI;
                if p[0].hypot(p[1]) > 1e-6 {
                    around = around.max(phi.abs());
                }
            }
            let slack = 1e-6;
            prop_assert!(largest <= b.radius * (1.0 + slack) && largest >= b.radius * (1.0 - slack));
            prop_assert!(around <= b.half_azimuth + slack, "{around} {b:?}");
            prop_assert!(least >= b.least - slack && most <= b.largest + slack, "{least} {most} {b:?}");
            // The grid's step, seen from the camera, is 4 / 64 at most.
            let step = 0.07;
            prop_assert!(least <= b.least + step && most >= b.largest - step, "{least} {most} {b:?}");
            if b.half_azimuth < 0.9 * PI {
                prop_assert!(around >= b.half_azimuth - slack, "{around} {b:?}");
            }
        }

        /// The inclinations of a row are those of the far plane's points with that azimuth.
        #[test]
        fn rows_have_the_inclinations_of_their_rays(q in view(), s in 0.01..0.99_f64, t in 0.01..0.99_f64) {
            let p = at(q, s, t);
            prop_assume!(p[0].hypot(p[1]) > 1e-3 * dot(p, p).sqrt());
            let (least, largest) = row_inclinations(q, f64::atan2(p[1], p[0]));
            let theta = inclination(p[0].hypot(p[1]), p[2]);
            prop_assert!(theta >= least - 1e-9 && theta <= largest + 1e-9, "{theta} {least} {largest}");
            let b = rectified_bounds(q);
            prop_assert!(least >= b.least - 1e-9 && largest <= b.largest + 1e-9);
        }
    }

    #[test]
    fn a_view_along_the_light_is_all_around() {
        for (forward, least, largest) in [
            ([0.0, 0.0, 1.0], 0.0, f64::atan(0.5_f64.hypot(0.25))),
            ([0.0, 0.0, -1.0], PI - f64::atan(0.5_f64.hypot(0.25)), PI),
        ] {
            let b = rectified_bounds(corners(forward, 0.3, [0.5, 0.25], 8.0));
            assert_eq!(b.half_azimuth, PI);
            assert!((b.least - least).abs() < 1e-12 && (b.largest - largest).abs() < 1e-12);
            assert!((b.radius - 8.0 * 0.5_f64.hypot(0.25)).abs() < 1e-12);
        }
    }

    #[test]
    fn a_view_across_the_light_is_a_sector() {
        let b = rectified_bounds(corners([0.0, 1.0, 0.0], 0.0, [0.5, 0.5], 2.0));
        assert!(
            (b.azimuth - 0.5 * PI).abs() < 1e-12 && (b.half_azimuth - f64::atan(0.5)).abs() < 1e-12
        );
        // On the middle of the upper edge, the inclination is less than at its corners.
        assert!((b.least - (0.5 * PI - f64::atan(0.5))).abs() < 1e-12);
        assert!((b.largest - (0.5 * PI + f64::atan(0.5))).abs() < 1e-12);
    }

    #[test]
    fn the_phase_function_integrates_to_one_with_its_mean_cosine() {
        for g in [-0.8, 0.0, 0.3, 0.9] {
            let (mut all, mut mean) = (0.0, 0.0);
            const N: usize = 200_000;
            for i in 0..N {
                let cosine = (i as f64 + 0.5) / N as f64 * 2.0 - 1.0;
                let share = henyey_greenstein(g, cosine) * 2.0 * PI * 2.0 / N as f64;
                all += share;
                mean += share * cosine;
            }
            assert!(
                (all - 1.0).abs() < 1e-5 && (mean - g).abs() < 1e-5,
                "{g}: {all} {mean}"
            );
        }
    }

    /// The mean of what is lit along a row, each texel with the light that is scattered in it and reaches the
    /// camera, is the scattered light of a ray with that row's inclination.
    #[test]
    fn a_weighted_row_is_the_integral_along_its_ray() {
        let (extinction, theta, width, texels) = (0.3, 0.9_f64, 0.25, 40);
        let lit = |k: usize| f64::from(u8::from(k % 7 < 3 || k.is_multiple_of(5)));
        let rate = row_extinction(extinction, theta, theta);
        let weight = |k: usize| transmittance(rate, k as f64 * width);
        for end in 1..=texels {
            let total: f64 = (0..end).map(weight).sum();
            let mean = (0..end).map(|k| weight(k) * lit(k)).sum::<f64>() / total;
            let length = end as f64 * width / theta.sin();
            let scattered = mean * (1.0 - transmittance(extinction, length));
            // Many steps along the ray.
            const STEPS: usize = 40_000;
            let step = length / STEPS as f64;
            let along: f64 = (0..STEPS)
                .map(|i| {
                    let s = (i as f64 + 0.5) * step;
                    let k = (s * theta.sin() / width) as usize;
                    lit(k) * extinction * (-extinction * s).exp() * step
                })
                .sum();
            assert!(
                (scattered - along).abs() < 1e-4,
                "{end}: {scattered} {along}"
            );
        }
    }

    #[test]
    fn what_is_nearer_to_the_light_has_the_lesser_depth() {
        let (near, far) = (inclination(2.0, -1.0), inclination(2.0, 3.0));
        let depth = |theta| rectified_depth(theta, 1.5, 1.0);
        assert!(depth(near) < depth(far));
        assert_eq!((depth(PI), depth(0.0)), (-1.0, 1.0));
        assert_eq!(inclination(0.0, -1.0), PI);
        let least = transmittance(1.0_f64, 1e9) / (-80.0_f64).exp();
        assert!((least - 1.0).abs() < 1e-14);
    }
}
