//! Bounds from warped depths.

#[allow(dead_code, reason = "each test needs some of it")]
mod common;

use common::distribution;
use hankel_moments::{markov_1, warped_2};
use proptest::prelude::*;

proptest! {
    /// Both are lower bounds, for the depths themselves: a warp keeps their order.
    #[test]
    fn no_more_than_the_true_share(
        d in distribution(6),
        z in 0.0..1.0_f64,
        c in 1.0..40.0_f64,
        least in prop_oneof![Just(0.0), 1e-6..1e-2_f64],
    ) {
        let below = d.below(z);
        let rising = d.map(|z| f64::exp(c * z));
        let w = f64::exp(c * z);
        prop_assert!(markov_1(rising.moment(1), w) <= below + 1e-9);
        let (least_below, least_above) = warped_2(rising.moment(1), rising.moment(2), w, least);
        // Rounding of the variance, 1e-15, over the least distance that counts.
        prop_assume!(d.distance(z) > 1e-3);
        prop_assert!(least_below <= below + 1e-6, "{least_below} {below}");
        prop_assert!(least_above <= 1.0 - below + 1e-6, "{least_above} {below}");
        // A warp that falls exchanges the sides.
        let falling = d.map(|z| f64::exp(-c * z));
        let w = f64::exp(-c * z);
        let (least_above, least_below) = warped_2(falling.moment(1), falling.moment(2), w, least);
        prop_assert!(least_below <= below + 1e-6, "{least_below} {below}");
        prop_assert!(least_above <= 1.0 - below + 1e-6, "{least_above} {below}");
    }

    /// Whatever they are given, finite numbers in [0, 1].
    #[test]
    fn results_are_shares(mean: f32, square: f32, w: f32, least: f32) {
        let markov = markov_1(mean, w);
        let (below, above) = warped_2(mean, square, w, least);
        for share in [markov, below, above] {
            prop_assert!((0.0..=1.0).contains(&share), "{share}");
        }
        prop_assert!(below == 0.0 || above == 0.0);
    }
}

/// One caster before a receiver far behind it: all of them take it for full shadow.
#[test]
fn a_caster_far_before_a_receiver_shades_it() {
    let (caster, receiver) = (0.2_f32, 0.7_f32);
    let (c, z) = ((80.0 * caster).exp(), (80.0 * receiver).exp());
    assert!(markov_1(c, z) > 0.999_999);
    let (c, z) = ((40.0 * caster).exp(), (40.0 * receiver).exp());
    assert!(warped_2(c, c * c, z, 1.6e-5).0 > 0.999_9);
    let (c, z) = ((-5.0 * caster).exp(), (-5.0 * receiver).exp());
    assert!(warped_2(c, c * c, z, 1.6e-5).1 > 0.999_9);
    // And nothing shades the caster itself.
    let c = (40.0 * caster).exp();
    assert_eq!(warped_2(c, c * c, c, 1.6e-5), (0.0, 0.0));
    assert_eq!(markov_1(c, c), 0.0);
}

/// What is warped less leaks more: half a region by one caster, half by the receiver, a second receiver
/// behind. The exponential tells them apart, mean and variance of depths do not.
#[test]
fn a_warp_leaks_less_than_depths() {
    let (caster, receiver) = (0.1_f64, 0.5_f64);
    let half = |f: &dyn Fn(f64) -> f64| 0.5 * (f(caster) + f(receiver));
    let behind = 0.55;
    let warp = |z: f64| f64::exp(40.0 * z);
    let (mean, square) = (half(&warp), half(&|z| warp(z).powi(2)));
    let warped = warped_2(mean, square, warp(behind), 0.0).0;
    let plain = hankel_moments::variance_2(half(&|z| z), half(&|z| z * z), behind, 0.0);
    assert!(warped > 0.9 && plain < 0.7, "{warped} {plain}");
}
