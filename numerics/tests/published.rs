//! Published algorithms give what the kernels give where both are well conditioned.

use hankel_moments::{
    Moments6, bias_target, bound, hamburger_6, mix_bias, mix_bias_and_total, sparse_2,
};
use hankel_numerics::families::{Family, Format, ORDERS, Row};
use hankel_numerics::published::{mixed, moment_bound, six_moments, two_points};
use hankel_numerics::stress::bounds_of;

fn rows<T: Format>(family: &str, n: usize, count: u64) -> impl Iterator<Item = Row<T>> {
    let family = Family::named(family).unwrap();
    (0..count).map(move |index| family.row(n, 3, index))
}

/// The share of pairs that are nearer than a tolerance.
fn near(pairs: impl Iterator<Item = (f64, f64)>, tolerance: f64) -> f64 {
    let all: Vec<bool> = pairs.map(|(a, b)| (a - b).abs() <= tolerance).collect();
    all.iter().filter(|is_near| **is_near).count() as f64 / all.len() as f64
}

#[test]
fn the_2025_solver_agrees_in_f64() {
    for n in ORDERS {
        let pairs = rows::<f64>("generic-symmetric", n, 400).flat_map(|row| {
            let (a, b) = (
                moment_bound(n, row.m, row.eta),
                bounds_of(n, row.m, row.eta),
            );
            [(a.lower, b.lower), (a.upper, b.upper)]
        });
        let share = near(pairs, 1e-6);
        assert!(share > 0.99, "n = {n}: {share}");
    }
}

fn six<T: Format>(row: &Row<T>) -> Moments6<T> {
    let [_, b1, b2, b3, b4, b5, b6, ..] = row.m;
    Moments6 {
        b1,
        b2,
        b3,
        b4,
        b5,
        b6,
    }
}

#[test]
fn six_moments_agree_in_f64() {
    let pairs = rows::<f64>("silhouettes-biased", 3, 1000).flat_map(|row| {
        let a = six_moments(six(&row), row.eta);
        let b = hamburger_6(six(&row), row.eta);
        [(a.lower, b.lower), (a.upper, b.upper)]
    });
    let share = near(pairs, 1e-4);
    assert!(share > 0.98, "{share}");
}

#[test]
fn two_points_agree_in_f64() {
    for row in rows::<f64>("generic-symmetric", 2, 200) {
        let [_, b1, b2, b3, ..] = row.m;
        let (a, b) = (two_points(b1, b2, b3), sparse_2(b1, b2, b3));
        for (x, y) in [
            (a.z[0], b.z1),
            (a.z[1], b.z2),
            (a.w[0], b.w1),
            (a.w[1], b.w2),
        ] {
            assert!((x - y).abs() < 1e-8, "{a:?} {b:?}");
        }
    }
}

/// The paper's bias mixes the total in as well, the kernels' keeps it. With a total of 1 they are the
/// same; of a small total the paper's bias is most.
#[test]
fn the_papers_bias_is_another_one_but_for_a_total_of_one() {
    let target = bias_target::<f64, 2>();
    let mut apart = 0.0_f64;
    for (family, is_one) in [("generic-mass", false), ("generic-symmetric", true)] {
        for row in rows::<f64>(family, 2, 200) {
            let published = mixed(row.m, target, 1e-3);
            let all = mix_bias_and_total::<f64, 2>(row.m, target, 1e-3);
            for k in 0..=4 {
                let size = published[k].abs().max(row.m[k].abs());
                assert!((all[k] - published[k]).abs() <= 4.0 * f64::EPSILON * size);
            }
            let kept = mix_bias::<f64, 2>(row.m, target, 1e-3);
            assert_eq!(kept[0], row.m[0]);
            if is_one {
                for k in 0..=4 {
                    assert!((kept[k] - published[k]).abs() <= 4.0 * f64::EPSILON);
                }
            }
            let its = moment_bound(2, published, row.eta).lower / published[0];
            let of_its = bound::<f64, 2>(published, row.eta).lower / published[0];
            assert!((its - of_its).abs() < 1e-6, "{its} {of_its}");
            let own = bound::<f64, 2>(kept, row.eta).lower / kept[0];
            apart = apart.max((own - its).abs());
        }
    }
    assert!(apart > 1e-2, "{apart}");
}
