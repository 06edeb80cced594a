//! Measured biases do what they are for.

use hankel_moments::bias::{MEASURED, Measured};
use hankel_numerics::biases::{FORMATS, Found, Options, measure};

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
        let Measured { bias, robust } = measured;
        let format = found.format;
        assert_eq!(
            (bias.basis, bias.count, bias.bits),
            (format.basis, format.count(), format.bits())
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
