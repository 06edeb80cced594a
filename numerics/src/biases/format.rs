//! What is stored, how it is read back, and whether a result is valid.

use std::fmt;

use hankel_dsl::lit;
use hankel_listing::{Biases, Receiver, hamburger_listing};
use hankel_moments::bias::{self, Basis, Bias, PUBLISHED};
use hankel_moments::{
    Bounds, HalfAngle, MAX_MOMENTS, Moments4, Moments6, Quantized4, Quantized6,
    TrigonometricMoments, bound, dequantize_symmetric_4, dequantize_symmetric_6, dequantize_unit_4,
    dequantize_unit_6, from_unorm, hausdorff_4, hausdorff_4_symmetric, quantize_symmetric_4,
    quantize_symmetric_6, quantize_unit_4, quantize_unit_6, to_unorm, trigonometric_4,
};
use serde::{Deserialize, Serialize};

use super::{Criterion, TOLERANCE};
use crate::families::draw::{Point, Source};
use crate::families::{Depths, Row, validity};
use crate::numbers::DoubleDouble;

/// How moments are stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Storage {
    /// As 32-bit floats.
    Float,
    /// As normalised integers of so many bits: in the optimised basis where there is one, otherwise
    /// each moment from -1 to 1.
    Normalised(u32),
}

/// Which moments, stored how.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Format {
    /// What moments are means of.
    #[serde(with = "basis")]
    pub basis: Basis,
    count: usize,
    /// Whether bounds are those of depths that are known to be in the range (the Hausdorff problem).
    pub in_range: bool,
    /// How they are stored.
    pub storage: Storage,
}

/// Bases by name.
mod basis {
    use hankel_moments::bias::Basis;
    use serde::de::{Deserialize, Deserializer, Error};
    use serde::ser::Serializer;

    pub fn serialize<S: Serializer>(basis: &Basis, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(super::name_of(*basis))
    }

    pub fn deserialize<'a, D: Deserializer<'a>>(deserializer: D) -> Result<Basis, D::Error> {
        let name = String::deserialize(deserializer)?;
        [Basis::Unit, Basis::Symmetric, Basis::Trigonometric]
            .into_iter()
            .find(|b| super::name_of(*b) == name)
            .ok_or_else(|| D::Error::custom(format!("`{name}` is not a basis")))
    }
}

const fn name_of(basis: Basis) -> &'static str {
    match basis {
        Basis::Unit => "unit",
        Basis::Symmetric => "symmetric",
        Basis::Trigonometric => "trigonometric",
    }
}

const fn of(basis: Basis, count: usize, storage: Storage) -> Format {
    Format {
        basis,
        count,
        in_range: false,
        storage,
    }
}

/// Four moments, for bounds of depths in the range.
const fn in_range(basis: Basis, storage: Storage) -> Format {
    Format {
        in_range: true,
        ..of(basis, 4, storage)
    }
}

const FLOAT: Storage = Storage::Float;
const SIXTEEN: Storage = Storage::Normalised(16);
const TEN: Storage = Storage::Normalised(10);

/// All that are measured.
pub const FORMATS: [Format; 25] = [
    of(Basis::Unit, 4, FLOAT),
    of(Basis::Unit, 4, SIXTEEN),
    of(Basis::Unit, 4, TEN),
    of(Basis::Unit, 6, FLOAT),
    of(Basis::Unit, 6, SIXTEEN),
    of(Basis::Unit, 6, TEN),
    of(Basis::Symmetric, 4, FLOAT),
    of(Basis::Symmetric, 4, SIXTEEN),
    of(Basis::Symmetric, 4, TEN),
    of(Basis::Symmetric, 6, FLOAT),
    of(Basis::Symmetric, 6, SIXTEEN),
    of(Basis::Symmetric, 6, TEN),
    of(Basis::Symmetric, 8, FLOAT),
    of(Basis::Symmetric, 8, SIXTEEN),
    of(Basis::Symmetric, 8, TEN),
    of(Basis::Trigonometric, 4, FLOAT),
    of(Basis::Trigonometric, 4, SIXTEEN),
    of(Basis::Trigonometric, 4, TEN),
    of(Basis::Symmetric, 10, FLOAT),
    in_range(Basis::Unit, FLOAT),
    in_range(Basis::Unit, SIXTEEN),
    in_range(Basis::Unit, TEN),
    in_range(Basis::Symmetric, FLOAT),
    in_range(Basis::Symmetric, SIXTEEN),
    in_range(Basis::Symmetric, TEN),
];

impl fmt::Display for Format {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}-{}", self.without_bits(), self.bits())
    }
}

impl Format {
    /// Moments after the zeroth.
    #[must_use]
    pub const fn count(self) -> usize {
        self.count
    }

    /// Bits of each channel.
    #[must_use]
    pub const fn bits(self) -> u32 {
        match self.storage {
            Storage::Float => 32,
            Storage::Normalised(bits) => bits,
        }
    }

    /// The name, without the bits.
    pub(super) fn without_bits(self) -> String {
        let range = if self.in_range { "-hausdorff" } else { "" };
        format!("{}-{}{range}", name_of(self.basis), self.count)
    }

    /// Whether there is published code for it: four moments by Hamburger's problem.
    pub(super) fn has_listing(self) -> bool {
        self.count == 4 && self.basis != Basis::Trigonometric && !self.in_range
    }

    fn published_bias(self) -> Option<Bias> {
        let mut fitting = PUBLISHED.into_iter().filter(|(_, b)| {
            (b.basis, b.count, b.bits) == (self.basis, self.count, self.bits()) && !self.in_range
        });
        // Of those for [0, 1], the one for clamped depths: it alone suits depths at the ends.
        let suits = |b: &Bias| self.basis != Basis::Unit || b.target[2] < 0.5;
        fitting.find(|(_, b)| suits(b)).map(|(_, b)| b)
    }

    /// The published strength.
    pub(super) fn published(self) -> Option<f64> {
        self.published_bias().map(|b| b.strength)
    }

    /// What is mixed in: the published vector for this format, or else that for as many moments and
    /// the most similar number of bits. For depths in the range, this project's own.
    #[doc(hidden)]
    #[must_use]
    pub fn target(self) -> [f64; MAX_MOMENTS] {
        let fallback = match (self.basis, self.count, self.storage) {
            (Basis::Unit, 4, _) if self.in_range => bias::HAUSDORFF_UNIT_4_16,
            (Basis::Symmetric, 4, _) if self.in_range => bias::HAUSDORFF_SYMMETRIC_4_16,
            (Basis::Unit, 4, _) => bias::CLAMPED_4_16,
            (Basis::Unit, _, _) => bias::CLAMPED_6_10,
            (Basis::Symmetric, 4, _) => bias::SYMMETRIC_4_16,
            (Basis::Symmetric, 6, _) => bias::SYMMETRIC_6_16,
            (Basis::Symmetric, 8, _) => bias::SYMMETRIC_8_16,
            (Basis::Symmetric, _, _) => bias::SYMMETRIC_10_32,
            (Basis::Trigonometric, _, _) => bias::TRIGONOMETRIC_2_16,
        };
        self.published_bias().unwrap_or(fallback).target
    }
}

/// A region of a shadow map: its moments, a query, and how much lies below it.
#[doc(hidden)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Region {
    /// Power moments, the zeroth first, or cosines and sines.
    moments: [f64; MAX_MOMENTS],
    query: f64,
    /// Share strictly below the query.
    pub below: f64,
    /// Share at the query or below.
    up_to: f64,
}

impl Region {
    pub(super) fn draw(format: Format, s: &mut Source) -> Self {
        let depths = match format.basis {
            Basis::Symmetric => Depths::Symmetric,
            Basis::Unit | Basis::Trigonometric => Depths::Unit,
        };
        let n = format.count / 2;
        let (low, high) = depths.ends();
        let (mut points, mut query) = match s.count(0, 4) {
            0 => few(s, depths, 1),
            1 => {
                let count = s.count(1, n + 1);
                few(s, depths, count)
            }
            2 => s.silhouettes(depths, n),
            3 => s.own_surface(depths, n),
            _ => {
                let count = s.count(n + 1, 6 * n);
                let points = s.scattered(depths, count);
                (points, s.between(low, high))
            }
        };
        // Clamped depths: some at the ends.
        if depths == Depths::Unit && s.count(0, 3) == 0 {
            let end = s.pick(&[low, high]);
            let count = s.count(1, points.len());
            for point in &mut points[..count] {
                point.depth = end;
            }
            if s.count(0, 1) == 0 {
                query = end - end.signum() * s.magnitude(-6.0, -1.0);
            }
        }
        Self::new(format.basis, &points, query.clamp(low, high))
    }

    /// Depths with weights that add up to 1, in [-1, 1], and a query.
    #[must_use]
    pub fn of(points: &[(f64, f64)], query: f64) -> Self {
        let points: Vec<Point> = points
            .iter()
            .map(|&(depth, weight)| Point { depth, weight })
            .collect();
        Self::new(Basis::Symmetric, &points, query)
    }

    fn new(basis: Basis, points: &[Point], query: f64) -> Self {
        let total: f64 = points.iter().map(|p| p.weight).sum();
        // The kernels' query is an f32, and so is the truth about it.
        let query = f64::from(query as f32);
        let mut moments = [0.0; MAX_MOMENTS];
        let (mut below, mut up_to) = (0.0, 0.0);
        for p in points {
            let w = p.weight / total;
            if p.depth < query {
                below += w;
            }
            if p.depth <= query {
                up_to += w;
            }
            if basis == Basis::Trigonometric {
                let TrigonometricMoments { c1, s1, c2, s2 } =
                    TrigonometricMoments::<f64>::of_depth(p.depth);
                for (m, x) in moments.iter_mut().zip([1.0, c1, s1, c2, s2]) {
                    *m += w * x;
                }
                continue;
            }
            let mut power = w;
            for m in &mut moments {
                *m += power;
                power *= p.depth;
            }
        }
        Self {
            moments,
            query,
            below,
            up_to,
        }
    }
}

/// Few depths, and a query at one of them, near one, or anywhere.
fn few(s: &mut Source, depths: Depths, count: usize) -> (Vec<Point>, f64) {
    let points = s.scattered(depths, count);
    let at = s.pick(&points).depth;
    let (low, high) = depths.ends();
    let query = match s.count(0, 2) {
        0 => at,
        1 => at + s.sign() * s.magnitude(-6.0, -1.0),
        _ => s.between(low, high),
    };
    (points, query)
}

/// A channel through so many bits.
fn channel(storage: Storage, x: f32) -> f32 {
    match storage {
        Storage::Float => x,
        Storage::Normalised(10) => from_unorm::<f32, 10>(to_unorm::<f32, 10>(x)),
        Storage::Normalised(_) => from_unorm::<f32, 16>(to_unorm::<f32, 16>(x)),
    }
}

/// A number from -1 to 1 through so many bits.
fn signed(storage: Storage, x: f32) -> f32 {
    match storage {
        Storage::Float => x,
        Storage::Normalised(_) => channel(storage, 0.5 * x + 0.5) * 2.0 - 1.0,
    }
}

impl Format {
    /// Moments as a shader reads them.
    fn read_back(self, exact: &[f64; MAX_MOMENTS]) -> [f32; MAX_MOMENTS] {
        let mut m = exact.map(|x| x as f32);
        let storage = self.storage;
        if storage == Storage::Float {
            return m;
        }
        let (unit, symmetric) = (Basis::Unit, Basis::Symmetric);
        match (self.basis, self.count) {
            (basis, 4) if basis == unit || basis == symmetric => {
                // Exact moments are transformed where they are rendered, in better than 16 bits.
                let given = Moments4 {
                    b1: exact[1],
                    b2: exact[2],
                    b3: exact[3],
                    b4: exact[4],
                };
                let q = if basis == unit {
                    quantize_unit_4(given)
                } else {
                    quantize_symmetric_4(given)
                };
                let stored = |x: f64| channel(storage, x as f32);
                let q = Quantized4 {
                    r: stored(q.r),
                    g: stored(q.g),
                    b: stored(q.b),
                    a: stored(q.a),
                };
                let read = if basis == unit {
                    dequantize_unit_4(q)
                } else {
                    dequantize_symmetric_4(q)
                };
                m[1..5].copy_from_slice(&[read.b1, read.b2, read.b3, read.b4]);
            }
            (basis, 6) if basis == unit || basis == symmetric => {
                let given = Moments6 {
                    b1: exact[1],
                    b2: exact[2],
                    b3: exact[3],
                    b4: exact[4],
                    b5: exact[5],
                    b6: exact[6],
                };
                let q = if basis == unit {
                    quantize_unit_6(given)
                } else {
                    quantize_symmetric_6(given)
                };
                let stored = |x: f64| channel(storage, x as f32);
                let q = Quantized6 {
                    r0: stored(q.r0),
                    g0: stored(q.g0),
                    b0: stored(q.b0),
                    r1: stored(q.r1),
                    g1: stored(q.g1),
                    b1: stored(q.b1),
                };
                let read = if basis == unit {
                    dequantize_unit_6(q)
                } else {
                    dequantize_symmetric_6(q)
                };
                m[1..7].copy_from_slice(&[read.b1, read.b2, read.b3, read.b4, read.b5, read.b6]);
            }
            _ => {
                for m in &mut m[1..=self.count] {
                    *m = signed(storage, *m);
                }
            }
        }
        m
    }

    /// Whether the result for a region is invalid.
    #[doc(hidden)]
    #[must_use]
    pub fn is_invalid(
        self,
        region: &Region,
        criterion: Criterion,
        target: &[f64; MAX_MOMENTS],
        strength: f64,
    ) -> bool {
        let mut m = self.read_back(&region.moments);
        m[0] = 1.0;
        for (m, target) in m.iter_mut().zip(target).take(self.count + 1).skip(1) {
            *m += strength as f32 * (*target as f32 - *m);
        }
        m[self.count + 1..].fill(0.0);
        let slack = TOLERANCE + strength;
        let query = region.query as f32;
        let beyond = |bounds: Bounds<f32>| {
            let (lower, upper) = (f64::from(bounds.lower), f64::from(bounds.upper));
            // What is no number is not within.
            let within = lower <= region.below + slack && upper >= region.up_to - slack;
            !within
        };
        match (criterion, self.basis) {
            (Criterion::Definite, Basis::Trigonometric) => !is_toeplitz_definite(&m),
            (Criterion::Definite, basis) => {
                !is_hankel_definite(self.count / 2, &m) || self.in_range && !is_inside(basis, &m)
            }
            (Criterion::Robust, Basis::Trigonometric) => {
                let moments = TrigonometricMoments {
                    c1: m[1],
                    s1: m[2],
                    c2: m[3],
                    s2: m[4],
                };
                let mut bounds = trigonometric_4(moments, HalfAngle::of_depth(query));
                // 0 and 1 are the same direction: at the ends, what lies there is not told apart.
                if query <= 0.0 || query >= 1.0 {
                    bounds.upper = 1.0;
                    bounds.lower = 0.0;
                }
                beyond(bounds)
            }
            (Criterion::Robust, basis) if self.in_range => {
                let m = four(&m);
                let lower = match basis {
                    Basis::Unit => hausdorff_4(m, query),
                    _ => hausdorff_4_symmetric(m, query),
                };
                beyond(Bounds { lower, upper: 1.0 })
            }
            (Criterion::Robust, _) => beyond(match self.count {
                4 => bound::<f32, 2>(m, query),
                6 => bound::<f32, 3>(m, query),
                8 => bound::<f32, 4>(m, query),
                _ => bound::<f32, 5>(m, query),
            }),
            (Criterion::Listing, _) => beyond(listed(&m, query)),
        }
    }
}

fn four(m: &[f32; MAX_MOMENTS]) -> Moments4<f32> {
    Moments4 {
        b1: m[1],
        b2: m[2],
        b3: m[3],
        b4: m[4],
    }
}

/// Both bounds by the published code, which has the lower one: the upper one is that of the mirrored
/// depths, turned over.
fn listed(m: &[f32; MAX_MOMENTS], query: f32) -> Bounds<f32> {
    // Its own bias is that for [0, 1]; here one is mixed in already.
    let biases = Biases {
        moment_bias: 0.0,
        depth_bias: 0.0,
    };
    let lower = |side: f32| {
        let moments = Moments4 {
            b1: side * m[1],
            b2: m[2],
            b3: side * m[3],
            b4: m[4],
        };
        let depth = side * query;
        hamburger_listing(&biases, Receiver { moments, depth }).shadow
    };
    Bounds {
        lower: lower(1.0),
        upper: 1.0 - lower(-1.0),
    }
}

/// Whether the Hankel matrix is positive definite: in `f64` where that is sure.
fn is_hankel_definite(n: usize, m: &[f32; MAX_MOMENTS]) -> bool {
    let row = Row {
        m: m.map(f64::from),
        eta: 0.0,
    };
    let (pivots, diagonal) = crate::families::pivots(n, &row.m);
    let mut left = 1.0;
    for (pivot, diagonal) in pivots.iter().zip(diagonal).take(n + 1) {
        left *= pivot / diagonal;
        if left.is_nan() || left <= 1e-8 {
            return validity(n, &row).is_definite();
        }
    }
    true
}

/// Whether x (1 - x) times the distribution, or (1 + x) (1 - x) times it, has a positive definite Hankel matrix. With that
/// of the distribution itself, its moments are inside those of the Hausdorff problem.
fn is_inside(basis: Basis, m: &[f32; MAX_MOMENTS]) -> bool {
    let [b0, b1, b2, b3, b4] = [m[0], m[1], m[2], m[3], m[4]].map(DoubleDouble::from);
    let (n0, n1, n2) = match basis {
        Basis::Unit => (b1 - b2, b2 - b3, b3 - b4),
        _ => (b0 - b2, b1 - b3, b2 - b4),
    };
    f64::from(n0) > 0.0 && f64::from(n0 * n2 - n1 * n1) > 0.0
}

/// Whether the Toeplitz matrix of 1, c1 + i s1 and c2 + i s2 is positive definite.
fn is_toeplitz_definite(m: &[f32; MAX_MOMENTS]) -> bool {
    let [c1, s1, c2, s2] = [m[1], m[2], m[3], m[4]].map(DoubleDouble::from);
    let one: DoubleDouble = lit!(1.0);
    let first = c1 * c1 + s1 * s1;
    let second = c2 * c2 + s2 * s2;
    // The real part of the first squared times the second's conjugate.
    let product = (c1 * c1 - s1 * s1) * c2 + c1 * s1 * (s2 + s2);
    let determinant = one - first - first - second + product + product;
    first < one && second < one && f64::from(determinant) > 0.0
}
