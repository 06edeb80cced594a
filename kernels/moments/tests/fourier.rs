//! Fourier series of comparisons: what their terms are, and what they add up to.

use std::f64::consts::PI;

use hankel_moments::{OddHarmonics, fourier_light};

/// c_k.
fn frequency(k: usize) -> f64 {
    (2 * k - 1) as f64 * PI
}

#[test]
fn harmonics_are_those_of_the_standard_library() {
    for i in 0..=1000 {
        let z = f64::from(i) / 1000.0;
        let rounded = f64::from(z as f32);
        let single = OddHarmonics::<f32>::of_depth(z as f32);
        for (group, double) in OddHarmonics::<f64>::of_depth(z).into_iter().enumerate() {
            for k in 0..4 {
                let angle = frequency(4 * group + k + 1) * z;
                assert!((double.cos[k] - angle.cos()).abs() < 2e-14, "{k} {z}");
                assert!((double.sin[k] - angle.sin()).abs() < 2e-14, "{k} {z}");
                let angle = frequency(4 * group + k + 1) * rounded;
                let [cos, sin] = [single[group].cos[k], single[group].sin[k]].map(f64::from);
                assert!((cos - angle.cos()).abs() < 4e-6, "{k} {z}");
                assert!((sin - angle.sin()).abs() < 4e-6, "{k} {z}");
            }
        }
    }
}

/// The mean of two depths' terms gives the mean of their series, which is near the share that lies beyond a place.
#[test]
fn sums_are_those_of_the_series() {
    let depths = [(0.21, 0.3), (0.64, 0.7)];
    let mut compared = 0;
    for i in 0..=100 {
        let z = f64::from(i) / 100.0;
        let (mut sum, mut series) = (0.0, 0.0);
        for (group, query) in OddHarmonics::<f64>::of_depth(z).into_iter().enumerate() {
            let weights = [1, 2, 3, 4].map(|k| 2.0 / frequency(4 * group + k));
            let mut mean = OddHarmonics {
                cos: [0.0; 4],
                sin: [0.0; 4],
            };
            for (d, w) in depths {
                let harmonics = OddHarmonics::<f64>::of_depth(d)[group];
                for (k, weight) in weights.into_iter().enumerate() {
                    mean.cos[k] += w * harmonics.cos[k];
                    mean.sin[k] += w * harmonics.sin[k];
                    let angle = frequency(4 * group + k + 1) * (d - z);
                    series += w * weight * angle.sin();
                }
            }
            sum += query.sum(mean, weights);
        }
        assert!((sum - series).abs() < 1e-13, "{z}: {sum} {series}");
        if depths.iter().all(|(d, _)| (d - z).abs() > 0.1) {
            let beyond = depths.iter().filter(|(d, _)| *d > z);
            let share: f64 = beyond.map(|(_, w)| w).sum();
            assert!((sum + 0.5 - share).abs() < 0.06, "{z}: {sum} {share}");
            compared += 1;
        }
    }
    assert!(compared > 40, "{compared}");
}

#[test]
fn a_surface_is_lit_and_what_is_behind_it_is_not() {
    for (sum, light) in [
        (0.7_f32, 1.0_f32),
        (0.0, 1.0),
        (-0.25, 0.5),
        (-0.5, 0.0),
        (-0.6, 0.0),
    ] {
        assert_eq!(fourier_light(sum), light);
    }
}
