//! Inputs that the kernels are for, which no range of single numbers gives: moments of
//! distributions, as renderers meet them and as papers measure with, and ([`maps`]) shadow maps.
//! Only for the host: parity runs them.

pub mod canonical;
pub mod maps;
pub mod mips;
pub mod scattering;
pub mod soft;
pub mod tiles;
pub mod translucent;

use std::vec::Vec;

use hankel_dsl::native::inputs::{Float, Given, Request, Source};
use hankel_moments::{
    Moments4, Moments6, quantize_symmetric_4, quantize_symmetric_6, quantize_unit_4,
    quantize_unit_6,
};

/// Rows of a run.
const ROWS: usize = 1021;

/// Where depths lie.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Depths {
    Unit,
    Symmetric,
}

impl Depths {
    const fn ends(self) -> (f64, f64) {
        match self {
            Self::Unit => (0.0, 1.0),
            Self::Symmetric => (-1.0, 1.0),
        }
    }
}

/// Depths with weights that sum to 1, and a query.
struct Distribution {
    points: Vec<(f64, f64)>,
    query: f64,
}

impl Distribution {
    /// The kinds that a map holds where it is filtered, for moments up to order 2 n: anything, two
    /// surfaces, a receiver within its own surface, exactly as few depths as make the moments
    /// degenerate, one depth, depths at the ends.
    fn draw(depths: Depths, n: usize, s: &mut Source) -> Self {
        let (low, high) = depths.ends();
        let fewest = n as u32;
        let scattered = |s: &mut Source, count: u32| -> Vec<(f64, f64)> {
            (0..count)
                .map(|_| (s.between(low, high), s.between(0.05, 1.0)))
                .collect()
        };
        let surface = |s: &mut Source, centre: f64, spread: f64, count: u32, share: f64| {
            (0..count)
                .map(|_| {
                    let depth = (centre + spread * s.between(-0.5, 0.5)).clamp(low, high);
                    (depth, s.between(0.2, 1.0) * share)
                })
                .collect::<Vec<_>>()
        };
        let kind = s.count(0, 6);
        let (mut points, query) = match kind {
            0 | 1 => {
                let count = s.count(fewest + 1, 6 * fewest);
                let points = scattered(s, count);
                (points, s.between(low, high))
            }
            2 => {
                let (near, far) = (s.between(low, high), s.between(low, high));
                let share = s.between(0.05, 0.95);
                let spread = [s.magnitude(-4.0, -2.0), s.magnitude(-4.0, -2.0)];
                let count = s.count(fewest, 4 * fewest);
                let mut points = surface(s, near, spread[0], count, share);
                points.extend(surface(s, far, spread[1], count, 1.0 - share));
                let query = match s.count(0, 2) {
                    0 => near + s.sign() * spread[0] * s.between(0.5, 10.0),
                    1 => far + spread[1] * s.between(-0.5, 0.5),
                    _ => s.between(near.min(far), near.max(far)),
                };
                (points, query)
            }
            3 => {
                let spread = s.magnitude(-3.0, -1.5);
                let centre = s.between(low + spread, high - spread);
                let count = s.count(fewest + 1, 6 * fewest);
                let query = centre + spread * s.between(-0.5, 0.5);
                (surface(s, centre, spread, count, 1.0), query)
            }
            4 => {
                let count = s.count(1, fewest);
                let points = scattered(s, count);
                let at = s.pick(&points).0;
                (points, at + s.pick(&[0.0, 1e-6, -1e-6, 0.1]))
            }
            5 => {
                let points = scattered(s, 1);
                (points, s.between(low, high))
            }
            _ => {
                let count = s.count(0, 2 * fewest);
                let mut points = scattered(s, count);
                points.push((low, s.between(0.05, 1.0)));
                points.push((high, s.between(0.05, 1.0)));
                let near = s.pick(&[low, high]);
                (points, near + s.pick(&[0.0, 1e-7, -1e-7, 0.25]))
            }
        };
        let total: f64 = points.iter().map(|p| p.1).sum();
        for p in &mut points {
            p.1 /= total;
        }
        Self { points, query }
    }

    /// The moment of an order.
    fn moment(&self, order: i32) -> f64 {
        self.points.iter().map(|(z, w)| w * z.powi(order)).sum()
    }

    fn four(&self) -> Moments4<f64> {
        Moments4 {
            b1: self.moment(1),
            b2: self.moment(2),
            b3: self.moment(3),
            b4: self.moment(4),
        }
    }

    fn six(&self) -> Moments6<f64> {
        Moments6 {
            b1: self.moment(1),
            b2: self.moment(2),
            b3: self.moment(3),
            b4: self.moment(4),
            b5: self.moment(5),
            b6: self.moment(6),
        }
    }
}

/// `ROWS` rows of numbers, one after the other, rounded once.
fn rows<R: Float>(count: usize, mut row: impl FnMut(&mut Vec<f64>)) -> Vec<R> {
    let mut all = Vec::new();
    for _ in 0..count {
        row(&mut all);
    }
    all.into_iter().map(R::of).collect()
}

fn rounded<R: Float, const N: usize>(numbers: [f64; N]) -> [R; N] {
    numbers.map(R::of)
}

/// Moments 1 to `count` of a distribution of depths in [-1, 1], of the kinds that the built-in
/// bounds are tested on.
#[must_use]
pub fn powers(count: usize, source: &mut Source) -> Vec<f64> {
    let d = Distribution::draw(Depths::Symmetric, count.div_ceil(2).max(1), source);
    (1..=count as i32).map(|j| d.moment(j)).collect()
}

/// Settings of a bound and its rows: moments m_0 to m_2n, the query, and for the adjoint the
/// derivative of a result to the bound.
fn bounds<R: Float>(n: usize, adjoint: bool, request: &Request) -> Vec<Given> {
    let mut s = Source::new(request.seed);
    // The bias that is recommended for 32-bit floats grows with n.
    let strength = 1e-7 * 10.0_f64.powi(n as i32 - 1);
    let runs = [
        ("moments, no bias", 0.0, 0.0),
        ("moments, recommended bias", 0.0, strength),
        ("moments, overestimation and bias", 0.25, strength),
        ("moments of other totals", 0.0, 0.0),
    ];
    runs.into_iter()
        .enumerate()
        .map(|(run, (what, overestimation, bias))| {
            let all = rows::<R>(ROWS, |row| {
                let d = Distribution::draw(Depths::Symmetric, n, &mut s);
                // A free total: what a ray has passed.
                let total = if run == 3 {
                    s.magnitude(-3.0, 3.0)
                } else {
                    1.0
                };
                row.extend((0..=2 * n as i32).map(|j| total * d.moment(j)));
                row.push(d.query);
                if adjoint {
                    row.push(s.between(-1.0, 1.0));
                }
            });
            Given::new(what)
                .uniform("settings", &rounded::<R, 2>([overestimation, bias]))
                .buffer("row", &all)
        })
        .collect()
}

macro_rules! orders {
    ($($n:literal $rows:ident $adjoint_rows:ident),*) => {
        $(
            /// Moments of distributions and a query, for bounds of that order.
            #[must_use]
            pub fn $rows<R: Float>(request: &Request) -> Vec<Given> {
                bounds::<R>($n, false, request)
            }

            /// The same for their derivatives.
            #[must_use]
            pub fn $adjoint_rows<R: Float>(request: &Request) -> Vec<Given> {
                bounds::<R>($n, true, request)
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

/// Biases of a shadow: of the moments and of the depth, cut of light leaks, least variance.
const SHADOWS: [(&str, [f64; 4]); 3] = [
    ("moments of a map, no bias", [0.0, 0.0, 0.0, 1e-6]),
    ("moments of a map, 16 bits' bias", [6e-5, 1e-3, 0.02, 1e-5]),
    ("moments of a map, 32 bits' bias", [5e-7, 1e-4, 0.1, 1e-4]),
];

/// Rows for the bounds of shadow mapping with four moments.
fn four<R: Float>(depths: Depths, columns: usize, request: &Request) -> Vec<Given> {
    let mut s = Source::new(request.seed);
    let target = match depths {
        Depths::Unit => [0.5; 4],
        Depths::Symmetric => [0.0, 0.628, 0.0, 0.628],
    };
    SHADOWS
        .into_iter()
        .map(|(what, [bias, depth, leak, variance])| {
            let [a, b, c, d] = target;
            let settings = rounded::<R, 8>([a, b, c, d, bias, depth, leak, variance]);
            let all = rows::<R>(ROWS, |row| {
                let d = Distribution::draw(depths, 2, &mut s);
                row.extend((1..=columns as i32).map(|j| d.moment(j)));
                row.push(d.query);
            });
            Given::new(what)
                .uniform("settings", &settings)
                .buffer("receiver", &all)
        })
        .collect()
}

/// Four moments of depths in [-1, 1] and a receiver.
#[must_use]
pub fn receivers_4<R: Float>(request: &Request) -> Vec<Given> {
    four::<R>(Depths::Symmetric, 4, request)
}

/// Four moments of depths in [0, 1] and a receiver.
#[must_use]
pub fn unit_receivers_4<R: Float>(request: &Request) -> Vec<Given> {
    four::<R>(Depths::Unit, 4, request)
}

/// Two moments of depths in [0, 1] and a receiver.
#[must_use]
pub fn receivers_2<R: Float>(request: &Request) -> Vec<Given> {
    four::<R>(Depths::Unit, 2, request)
}

/// Six moments of depths in [-1, 1] and a receiver.
#[must_use]
pub fn receivers_6<R: Float>(request: &Request) -> Vec<Given> {
    let mut s = Source::new(request.seed);
    SHADOWS
        .into_iter()
        .map(|(what, [bias, depth, leak, _])| {
            let settings = [
                bias,
                depth,
                0.2 * leak,
                leak,
                0.0,
                0.5566,
                0.0,
                0.489,
                0.0,
                0.4787,
            ];
            let all = rows::<R>(ROWS, |row| {
                let d = Distribution::draw(Depths::Symmetric, 3, &mut s);
                row.extend((1..=6).map(|j| d.moment(j)));
                row.push(d.query);
            });
            Given::new(what)
                .uniform("settings", &rounded::<R, 10>(settings))
                .buffer("receiver", &all)
        })
        .collect()
}

/// Two complex trigonometric moments and a receiver.
#[must_use]
pub fn trigonometric_receivers<R: Float>(request: &Request) -> Vec<Given> {
    let mut s = Source::new(request.seed);
    SHADOWS
        .into_iter()
        .map(|(what, [bias, depth, leak, _])| {
            let all = rows::<R>(ROWS, |row| {
                let d = Distribution::draw(Depths::Unit, 2, &mut s);
                for k in [1.0, 2.0] {
                    let angle = |z: f64| core::f64::consts::TAU * k * z;
                    row.push(d.points.iter().map(|(z, w)| w * angle(*z).cos()).sum());
                    row.push(d.points.iter().map(|(z, w)| w * angle(*z).sin()).sum());
                }
                row.push(d.query);
            });
            Given::new(what)
                .uniform(
                    "settings",
                    &rounded::<R, 4>([bias, depth, 0.2 * leak, leak]),
                )
                .buffer("receiver", &all)
        })
        .collect()
}

/// Rows of a kernel that reads moments alone.
fn moments<R: Float>(
    depths: &[Depths],
    n: usize,
    request: &Request,
    name: &str,
    what: &str,
    mut row: impl FnMut(&Distribution, &mut Vec<f64>),
) -> Vec<Given> {
    let mut s = Source::new(request.seed);
    let all = rows::<R>(3 * ROWS, |all| {
        let depths = s.pick(depths);
        row(&Distribution::draw(depths, n, &mut s), all);
    });
    [Given::new(what).buffer(name, &all)].into()
}

const BOTH: [Depths; 2] = [Depths::Unit, Depths::Symmetric];

macro_rules! powers {
    ($($name:ident: $depths:expr, $n:literal, $count:literal;)*) => {
        $(
            /// So many moments of distributions.
            #[must_use]
            pub fn $name<R: Float>(request: &Request) -> Vec<Given> {
                moments::<R>(&$depths, $n, request, "moments", "moments", |d, row| {
                    row.extend((1..=$count).map(|j| d.moment(j)));
                })
            }
        )*
    };
}

powers! {
    moments_3: BOTH, 2, 3;
    moments_4: BOTH, 2, 4;
    moments_6: BOTH, 3, 6;
    unit_moments_4: [Depths::Unit], 2, 4;
    unit_moments_6: [Depths::Unit], 3, 6;
    symmetric_moments_4: [Depths::Symmetric], 2, 4;
    symmetric_moments_6: [Depths::Symmetric], 3, 6;
}

macro_rules! quantized {
    ($($name:ident: $depths:expr, $n:literal, $of:ident, $quantize:ident, [$($channel:ident),*];)*) => {
        $(
            /// Moments of distributions in the optimised basis.
            #[must_use]
            pub fn $name<R: Float>(request: &Request) -> Vec<Given> {
                moments::<R>(&[$depths], $n, request, "quantized", "a map's texels", |d, row| {
                    let q = $quantize(d.$of());
                    row.extend([$(q.$channel),*]);
                })
            }
        )*
    };
}

quantized! {
    unit_quantized_4: Depths::Unit, 2, four, quantize_unit_4, [r, g, b, a];
    symmetric_quantized_4: Depths::Symmetric, 2, four, quantize_symmetric_4, [r, g, b, a];
    unit_quantized_6: Depths::Unit, 3, six, quantize_unit_6, [r0, g0, b0, r1, g1, b1];
    symmetric_quantized_6: Depths::Symmetric, 3, six, quantize_symmetric_6, [r0, g0, b0, r1, g1, b1];
}
