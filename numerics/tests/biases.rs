//! Measured biases do what they are for.

use hankel_moments::bias::{MEASURED, Measured};
use hankel_numerics::biases::{
    Criterion, FORMATS, Found, Options, Region, formats_named, measure, strengths,
};

/// A two-hundredth of the regions that the constants come from.
const SAMPLES: u64 = 20_000;

fn found() -> Vec<(Measured, Found)> {
    let options = Options {
        samples: SAMPLES,
        seed: 11,
        ..Options::default()
    };
    let found = measure(&options, &mut |_| ()).unwrap().found;
    assert_eq!(found.len(), FORMATS.len());
    // What no strength makes valid has no constant.
    let found: Vec<Found> = found.into_iter().filter(|f| f.definite.is_some()).collect();
    assert_eq!(found.len(), MEASURED.len());
    MEASURED.into_iter().zip(found).collect()
}

#[test]
fn measured_strengths_suffice_and_are_not_far_above_what_is_needed() {
    for (measured, found) in found() {
        let Measured {
            bias,
            robust,
            in_range,
        } = measured;
        let format = found.format;
        assert_eq!(
            (bias.basis, bias.count, bias.bits, in_range),
            (format.basis, format.count(), format.bits(), format.in_range)
        );
        assert_eq!(bias.target[..=bias.count], found.target[..], "{format}");
        // Fewer regions need no more, and not less by orders of magnitude.
        let definite = found.definite.unwrap();
        assert!(definite <= bias.strength, "{format}: {definite}");
        assert!(definite > 0.02 * bias.strength, "{format}: {definite}");
        let enough = found.robust.unwrap();
        assert!(enough <= robust, "{format}: {enough}");
        assert!(enough > 0.02 * robust, "{format}: {enough}");
        // Without any, thousands are invalid.
        assert!(found.without[0] > 0.1, "{format}: {:?}", found.without);
    }
}

#[test]
fn strengths_rise_in_two_digits() {
    let all: Vec<f64> = strengths().collect();
    assert!(all.is_sorted_by(|a, b| a < b));
    assert_eq!(all[0], 1e-9);
    assert!(all.contains(&0.1) && all.contains(&0.032));
}

#[test]
fn more_bias_is_never_worse_and_coarser_formats_need_more() {
    let found: Vec<Found> = {
        let options = Options {
            formats: formats_named(&["symmetric-4-32".into(), "symmetric-4-10".into()]).unwrap(),
            samples: 4000,
            seed: 3,
        };
        measure(&options, &mut |_| ()).unwrap().found
    };
    let [float, coarse] = &found[..] else {
        panic!("two formats")
    };
    for f in [float, coarse] {
        // Without a bias, one texel alone makes the matrix singular.
        assert!(f.without[0] > 0.1, "{f:?}");
        assert!(f.definite.unwrap() > 0.0, "{f:?}");
        assert!(f.robust.unwrap() <= f.definite.unwrap(), "{f:?}");
    }
    assert!(coarse.definite > float.definite);
}

#[test]
fn a_bound_beyond_the_truth_is_invalid() {
    let format = formats_named(&["symmetric-4-32".into()]).unwrap()[0];
    let region = Region::of(&[(0.0, 1.0)], 0.5);
    let target = format.target();
    let good = format.is_invalid(&region, Criterion::Robust, &target, 1e-6);
    assert!(!good);
    // The same moments, but everything lies behind the query.
    let mut lie = region;
    lie.below = 0.0;
    assert!(format.is_invalid(&lie, Criterion::Robust, &target, 1e-6));
}
