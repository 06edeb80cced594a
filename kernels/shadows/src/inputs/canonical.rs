//! Rows for the distributions that attain the bounds.

use std::vec::Vec;

use hankel_dsl::native::inputs::{Float, Given, Request, Source};

use super::{Depths, Distribution, ROWS, rounded};

/// Moments m_0 to m_2n and a query point.
fn row(n: usize, total: f64, d: &Distribution) -> Vec<f64> {
    let moments = (0..=2 * n as i32).map(|j| total * d.moment(j));
    moments.chain([d.query]).collect()
}

/// Upstream gradients to n reciprocals, n weights and the own weight, of several kinds: any; to the weights alone,
/// 1 up to some point and 0 from there, as a bound has them; to a single number.
fn upstream(n: usize, s: &mut Source) -> Vec<f64> {
    let count = 2 * n + 1;
    match s.count(0, 3) {
        0 | 1 => (0..count).map(|_| s.between(-1.0, 1.0)).collect(),
        2 => {
            let below = s.count(0, n as u32) as usize;
            let one_of = |at: usize| (n..n + below).contains(&at);
            (0..count).map(|at| f64::from(one_of(at))).collect()
        }
        _ => {
            let only = s.count(0, count as u32 - 1) as usize;
            (0..count).map(|at| f64::from(at == only)).collect()
        }
    }
}

/// Settings and rows, and for the adjoint the upstream gradients.
fn rows<R: Float>(n: usize, adjoint: bool, request: &Request) -> Vec<Given> {
    let mut s = Source::new(request.seed);
    // As for the bounds: the bias that is recommended for 32-bit floats grows with n.
    let strength = 1e-7 * 10.0_f64.powi(n as i32 - 1);
    let runs = [
        ("moments, no bias", 0.0),
        ("moments, recommended bias", strength),
        ("moments of other totals", 0.0),
        (
            "moments of mirrored distributions, query at the centre",
            0.0,
        ),
    ];
    runs.into_iter()
        .enumerate()
        .map(|(run, (what, bias))| {
            let mut all = Vec::new();
            let mut gradients = Vec::new();
            for _ in 0..ROWS {
                let mut d = Distribution::draw(Depths::Symmetric, n, &mut s);
                let mut total = 1.0;
                if run == 2 {
                    total = s.magnitude(-3.0, 3.0);
                }
                if run == 3 {
                    // For odd n a point is at infinity.
                    let halves = d.points.iter().map(|&(z, w)| (z, 0.5 * w));
                    d.points = halves.flat_map(|(z, w)| [(z, w), (-z, w)]).collect();
                    d.query = s.pick(&[0.0, 0.0, 1e-30, -1e-7, 1e-5]);
                }
                all.extend(row(n, total, &d).into_iter().map(R::of));
                if adjoint {
                    gradients.extend(upstream(n, &mut s).into_iter().map(R::of));
                }
            }
            let given = Given::new(what)
                .uniform("settings", &rounded::<R, 1>([bias]))
                .buffer("row", &all);
            if adjoint {
                given.buffer("upstream", &gradients)
            } else {
                given
            }
        })
        .collect()
}

macro_rules! orders {
    ($($n:literal $rows:ident $adjoint_rows:ident),*) => {
        $(
            /// Moments of distributions and a query, for points and weights of that order.
            #[must_use]
            pub fn $rows<R: Float>(request: &Request) -> Vec<Given> {
                rows::<R>($n, false, request)
            }

            /// The same with upstream gradients.
            #[must_use]
            pub fn $adjoint_rows<R: Float>(request: &Request) -> Vec<Given> {
                rows::<R>($n, true, request)
            }
        )*
    };
}

orders! {
    1 rows_1 adjoint_rows_1,
    2 rows_2 adjoint_rows_2,
    3 rows_3 adjoint_rows_3,
    4 rows_4 adjoint_rows_4,
    5 rows_5 adjoint_rows_5,
    6 rows_6 adjoint_rows_6
}
