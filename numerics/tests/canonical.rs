//! Derivatives of the points and weights that attain the bounds, against dual numbers and differences, and how
//! exact they are.

use hankel_dsl::Real;
use hankel_moments::{Canonical, Gradient, MAX_MOMENTS, canonical, canonical_adjoint};
use hankel_numerics::families::{Family, Format, Row, scaled, validity};
use hankel_numerics::numbers::{Dual, Wide};
use hankel_numerics::stress::gradient_of;

/// Rows of a family that some distribution has.
fn rows<T: Format>(family: &str, n: usize, count: u64) -> Vec<Row<T>> {
    let family = Family::named(family).unwrap();
    let is_valid = |row: &Row<T>| {
        scaled(&row.map(T::widen)).is_some_and(|(row, _)| validity(n, &row).is_definite())
    };
    let rows: Vec<Row<T>> = (0..count)
        .map(|index| family.row::<T>(n, 5, index))
        .filter(is_valid)
        .collect();
    assert!(4 * rows.len() as u64 > count, "{family} {n} {}", rows.len());
    rows
}

/// Upstream gradients to N reciprocals, weights and the own weight.
fn upstream(n: usize, random: &mut fastrand::Rng) -> Canonical<f32> {
    let mut d = Canonical::none();
    let mut next = || random.f32() * 2.0 - 1.0;
    for i in 0..n {
        d.reciprocals[i] = next();
        d.weights[i] = next();
    }
    d.own = next();
    d
}

fn in_type<R: Real + From<f32>>(d: &Canonical<f32>) -> Canonical<R> {
    Canonical {
        reciprocals: d.reciprocals.map(R::from),
        weights: d.weights.map(R::from),
        own: d.own.into(),
    }
}

/// Compiled once for each number and order: written out, it is megabytes of code.
#[inline(never)]
fn found<R: Real, const N: usize>(m: [R; MAX_MOMENTS], eta: R) -> Canonical<R> {
    canonical::<R, N>(m, eta)
}

/// What the upstream gradients are of.
fn result<R: Real + From<f32>, const N: usize>(
    m: [R; MAX_MOMENTS],
    eta: R,
    d: &Canonical<f32>,
) -> R {
    let (found, d) = (found::<R, N>(m, eta), in_type::<R>(d));
    let mut sum = found.own * d.own;
    for i in 0..N {
        sum += found.weights[i] * d.weights[i] + found.reciprocals[i] * d.reciprocals[i];
    }
    sum
}

#[inline(never)]
fn exact<const N: usize>(m: [Wide; MAX_MOMENTS], eta: Wide, d: &Canonical<f32>) -> Gradient<Wide> {
    canonical_adjoint::<Wide, N>(m, eta, in_type(d))
}

/// Derivatives to m_0 to m_2N and the query point.
fn listed<R: Copy>(n: usize, g: &Gradient<R>) -> Vec<R> {
    g.m[..=2 * n].iter().chain([&g.eta]).copied().collect()
}

/// Calls a function of the order for each.
macro_rules! for_all_orders {
    ($function:ident) => {
        $function::<1>();
        $function::<2>();
        $function::<3>();
        $function::<4>();
        $function::<5>();
        $function::<6>();
    };
}

/// Compares derivatives of rows of some families by the adjoint with what `expected` gives for a row, upstream gradients
/// and the number of the derivative.
fn with_rows<const N: usize>(
    expected: impl Fn([Wide; MAX_MOMENTS], Wide, &Canonical<f32>, usize) -> f64,
) {
    let mut random = fastrand::Rng::with_seed(N as u64);
    for family in ["paper", "generic-symmetric", "silhouettes-biased"] {
        for row in rows::<f64>(family, N, 8) {
            let (m, eta) = (row.m.map(Wide::from), Wide::from(row.eta));
            let d = upstream(N, &mut random);
            let found = listed(N, &exact::<N>(m, eta, &d))
                .into_iter()
                .map(f64::from);
            let found: Vec<f64> = found.collect();
            let most = found.iter().fold(0.0, |most: f64, g| most.max(g.abs()));
            for (direction, found) in found.iter().enumerate() {
                let expected = expected(m, eta, &d, direction);
                assert!(
                    (found - expected).abs() <= 1e-14 * most,
                    "n = {N} {family} {row:?} {direction}: {found:e} {expected:e}"
                );
            }
        }
    }
}

fn follows_from_differences<const N: usize>() {
    // What differences of second order leave out is the step's square, and rounding is far below that.
    let step = Wide::from(1.0 / (1_u128 << 100) as f64);
    with_rows::<N>(|m, eta, d, direction| {
        let at = |step: Wide| {
            let (mut m, mut eta) = (m, eta);
            if direction <= 2 * N {
                m[direction] += step;
            } else {
                eta += step;
            }
            result::<Wide, N>(m, eta, d)
        };
        f64::from((at(step) - at(-step)) / (step + step))
    });
}

#[test]
fn the_adjoint_agrees_with_differences() {
    for_all_orders!(follows_from_differences);
}

fn follows_from_dual_numbers<const N: usize>() {
    with_rows::<N>(|m, eta, d, direction| {
        let (mut m, mut eta) = (m.map(Dual::constant), Dual::constant(eta));
        if direction <= 2 * N {
            m[direction].derivative = Wide::from(1.0);
        } else {
            eta.derivative = Wide::from(1.0);
        }
        f64::from(result::<Dual<Wide>, N>(m, eta, d).derivative)
    });
}

/// The source is the same for all orders, and those that are not here would take minutes to compile in these numbers.
#[test]
fn the_adjoint_agrees_with_dual_numbers() {
    follows_from_dual_numbers::<1>();
    follows_from_dual_numbers::<2>();
    follows_from_dual_numbers::<3>();
}

fn bounds_follow<const N: usize>() {
    for family in ["paper", "generic-symmetric", "silhouettes-biased"] {
        for row in rows::<f64>(family, N, 20) {
            let (m, eta) = (row.m.map(Wide::from), Wide::from(row.eta));
            let points = found::<Wide, N>(m, eta);
            for own in [0.0_f32, 1.0] {
                let mut d = Canonical::none();
                d.own = own;
                for i in 0..N {
                    let is_below = f64::from(points.reciprocals[i]) < 0.0;
                    d.weights[i] = f32::from(u8::from(is_below));
                }
                let here = listed(N, &exact::<N>(m, eta, &d));
                let there = listed(N, &gradient_of(N, m, eta, Wide::from(own)));
                // Roots of the bound are right to the cube of 1e-9, where its steps end, times what nearly
                // singular rows make of it.
                for (here, there) in here.into_iter().zip(there) {
                    let difference = f64::from(here - there).abs();
                    let size = f64::from(there).abs().max(1.0);
                    assert!(
                        difference <= 1e-20 * size,
                        "n = {N} {family} {row:?}: {difference:e}"
                    );
                }
            }
        }
    }
}

#[test]
fn the_adjoint_of_bounds_follows() {
    for_all_orders!(bounds_follow);
}

/// Families, and for N from 1 to 6 the largest median that is accepted, in f32 and f64, in epsilons of the format:
/// a quarter above what `docs/accuracy.md` has.
const FAMILIES: [(&str, [f64; 6]); 5] = [
    ("paper", [1.0, 5.0, 25.0, 220.0, 1.6e3, 1.3e4]),
    ("generic-symmetric", [1.25, 6.0, 25.0, 110.0, 500.0, 3.1e3]),
    ("generic-unit", [1.6, 30.0, 800.0, 1.7e4, 7e5, 1.7e7]),
    ("silhouettes-biased", [1.6, 1e4, 1.5e4, 2e4, 1.1e4, 7.3e3]),
    ("self-biased", [1.1e4, 4.5e4, 6e4, 1.2e4, 5.5e3, 9e3]),
];

/// The errors of all derivatives of a row, the largest over the largest derivative: median and 90 %.
fn errors<T: Format + Real + From<f32>, const N: usize>(family: &str) -> [f64; 2]
where
    Wide: From<T>,
{
    let mut random = fastrand::Rng::with_seed(N as u64);
    let mut errors: Vec<f64> = rows::<T>(family, N, 200)
        .into_iter()
        .map(|row| {
            let d = upstream(N, &mut random);
            let exact = exact::<N>(row.m.map(Wide::from), row.eta.into(), &d);
            let found = canonical_adjoint::<T, N>(row.m, row.eta, in_type(&d));
            let exact = listed(N, &exact);
            let most = exact
                .iter()
                .fold(0.0, |most: f64, g| most.max(f64::from(*g).abs()));
            let found = listed(N, &found).into_iter().map(Wide::from);
            let differences = found.zip(exact).map(|(a, b)| f64::from(a - b).abs());
            differences.fold(0.0, f64::max) / most
        })
        .collect();
    errors.sort_by(f64::total_cmp);
    [errors[errors.len() / 2], errors[errors.len() * 9 / 10]]
}

/// What came out for a family and order: median and 90 % error in f32, and in f64.
struct Line {
    family: &'static str,
    n: usize,
    errors: [[f64; 2]; 2],
    accepted: f64,
}

fn lines<const N: usize>(table: &mut Vec<Line>) {
    for (family, accepted) in FAMILIES {
        table.push(Line {
            family,
            n: N,
            errors: [errors::<f32, N>(family), errors::<f64, N>(family)],
            accepted: accepted[N - 1],
        });
    }
}

/// The table of `docs/accuracy.md`.
#[test]
fn derivatives_are_as_exact_as_the_documentation_says() {
    let mut table = Vec::new();
    lines::<1>(&mut table);
    lines::<2>(&mut table);
    lines::<3>(&mut table);
    lines::<4>(&mut table);
    lines::<5>(&mut table);
    lines::<6>(&mut table);
    for line in &table {
        let [[a, b], [c, d]] = line.errors;
        let (family, n) = (line.family, line.n);
        println!("| {family} | {n} | {a:.1e} | {b:.1e} | {c:.1e} | {d:.1e} |");
    }
    for line in &table {
        for (errors, epsilon) in line
            .errors
            .iter()
            .zip([f64::from(f32::EPSILON), f64::EPSILON])
        {
            let quotient = errors[0] / epsilon;
            let (family, n) = (line.family, line.n);
            assert!(quotient <= line.accepted, "{family} {n}: {quotient}");
        }
    }
}
