//! Which rows are valid, and where their queries are singular.

use hankel_dsl::lit;
use hankel_moments::MAX_MOMENTS;
use hankel_numerics::accuracy::orthogonal_roots;
use hankel_numerics::families::{Row, Validity, last_place, scaled, validity};
use hankel_numerics::numbers::DoubleDouble;

fn row(m: &[f64]) -> Row<f64> {
    let mut row = Row::default();
    row.m[..m.len()].copy_from_slice(m);
    row
}

#[test]
fn distributions_are_told_from_what_is_none() {
    // Three equal points at -1, 0, 1.
    let three = [1.0, 0.0, 2.0 / 3.0, 0.0, 2.0 / 3.0];
    assert!(validity(1, &row(&three[..3])).is_definite());
    assert!(validity(2, &row(&three)).is_definite());
    // Two points: singular for n = 2, to the last bit.
    assert_eq!(validity(2, &row(&[1.0, 0.0, 1.0, 0.0, 1.0])), Validity::Not);
    assert_eq!(validity(1, &row(&[1.0, 0.5, 0.2])), Validity::Not);
    assert_eq!(validity(1, &row(&[1.0, 0.5, -1.0])), Validity::Not);
}

#[test]
fn an_excess_far_below_double_double_is_seen() {
    let tiny = 2.0_f64.powi(-52);
    // A third pivot of one unit in the last place.
    let m = [1.0, 0.0, 1.0, 0.0, 1.0 + tiny];
    let Validity::Definite(left) = validity(2, &row(&m)) else {
        panic!("it is positive definite");
    };
    assert!((left / tiny - 1.0).abs() < 1e-9, "{left}");
}

#[test]
fn a_singular_matrix_is_one_to_the_last_bit() {
    // Points at 1/2 and 3/4, weights 1/3 and 2/3 of 3: elimination divides by 3, and by 24.
    let moments: Vec<f64> = (0..7)
        .map(|j| 0.5_f64.powi(j) + 2.0 * 0.75_f64.powi(j))
        .collect();
    assert_eq!(validity(3, &row(&moments)), Validity::Not);
    assert!(validity(1, &row(&moments)).is_definite());
    for (x, place) in [(1.0, 1.0), (0.75, 0.25), (-6.0, 2.0), (1e-310, 0.0)] {
        let found = last_place(x);
        assert!(place == 0.0 || found == place, "{x}: {found}");
        assert!(x % found == 0.0 && x % (2.0 * found) != 0.0, "{x}: {found}");
    }
}

#[test]
fn scaling_takes_the_smallest_numbers() {
    let tiny = f64::from_bits(3);
    let (scaled, exponent) = scaled(&row(&[tiny, 0.0, tiny])).unwrap();
    assert_eq!(scaled.m[0], 1.5);
    assert_eq!(exponent, -1073);
    assert!(hankel_numerics::families::scaled(&row(&[0.0, 0.0, 1.0])).is_none());
    assert!(hankel_numerics::families::scaled(&row(&[f64::NAN, 0.0, 1.0])).is_none());
}

#[test]
fn roots_are_those_of_legendre_polynomials() {
    // Moments of the uniform distribution on [-1, 1].
    let mut m = [lit!(0.0); MAX_MOMENTS];
    for (j, m) in m.iter_mut().enumerate().step_by(2) {
        let one: DoubleDouble = lit!(1.0);
        *m = one / DoubleDouble::from((j + 1) as f64);
    }
    let roots = orthogonal_roots(3, &m).unwrap().map(f64::from);
    let expected = [-0.6_f64.sqrt(), 0.0, 0.6_f64.sqrt()];
    for (root, expected) in roots.iter().zip(expected) {
        assert!((root - expected).abs() < 1e-15, "{root} {expected}");
    }
    let roots = orthogonal_roots(5, &m).unwrap().map(f64::from);
    let outer = (5.0 + 2.0 * (10.0_f64 / 7.0).sqrt()).sqrt() / 3.0;
    let inner = (5.0 - 2.0 * (10.0_f64 / 7.0).sqrt()).sqrt() / 3.0;
    let expected = [-outer, -inner, 0.0, inner, outer];
    for (root, expected) in roots.iter().zip(expected) {
        assert!((root - expected).abs() < 1e-15, "{root} {expected}");
    }
}
