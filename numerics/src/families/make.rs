//! Rows of each kind.

use hankel_moments::bias::{Bias, CLAMPED_4_16, CLAMPED_6_10, SYMMETRIC_4_16, SYMMETRIC_6_16};
use hankel_moments::{
    MAX, MAX_MOMENTS, Moments4, Moments6, bias_target, dequantize_symmetric_4,
    dequantize_symmetric_6, dequantize_unit_4, dequantize_unit_6, from_unorm, quantize_symmetric_4,
    quantize_symmetric_6, quantize_unit_4, quantize_unit_6, to_unorm,
};

use super::draw::{Point, Source};
use super::{Depths, Format, Kind, Precision, Row};
use crate::numbers::DoubleDouble;

/// Strengths for moments stored as 32-bit floats, n = 1 to 6: those of the 2025 paper's package,
/// twice what is published with moment-based transparency.
const FLOAT_STRENGTHS: [f64; MAX] = [1e-7, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2];

/// How much of which moments is mixed in.
struct Mixture {
    strength: f64,
    target: [f64; MAX_MOMENTS],
}

/// A row of order `n`.
pub fn row<T: Format>(kind: Kind, n: usize, s: &mut Source) -> Row<T> {
    match kind {
        Kind::Paper { per_order } => {
            let points: Vec<Point> = (0..=per_order * n)
                .map(|_| Point {
                    weight: s.unit(),
                    depth: s.normal(),
                })
                .collect();
            let eta = s.normal();
            rounded(n, &points, eta, Mass::Free, None)
        }
        Kind::Generic { depths, free_mass } => {
            let (points, eta) = generic(depths, n, s);
            let mass = if free_mass {
                Mass::Is(s.magnitude(-3.0, 3.0))
            } else {
                Mass::Is(1.0)
            };
            rounded(n, &points, eta, mass, None)
        }
        Kind::Silhouettes { biased } => {
            let (points, eta) = s.silhouettes(Depths::Symmetric, n);
            rounded(n, &points, eta, Mass::Is(1.0), float_bias(biased, n))
        }
        Kind::Own { biased } => {
            let (points, eta) = s.own_surface(Depths::Symmetric, n);
            rounded(n, &points, eta, Mass::Is(1.0), float_bias(biased, n))
        }
        Kind::Degenerate { biased } => {
            let count = s.count(1, n);
            let points = s.scattered(Depths::Symmetric, count);
            let eta = query(&points, s);
            rounded(n, &points, eta, Mass::Is(1.0), float_bias(biased, n))
        }
        Kind::OneTexel { biased } => {
            let points = s.scattered(Depths::Symmetric, 1);
            let eta = query(&points, s);
            rounded(n, &points, eta, Mass::Is(1.0), float_bias(biased, n))
        }
        Kind::AllEqual { biased } => all_equal(biased, n, s),
        Kind::Ends => {
            let mut points: Vec<Point> = [0.0, 1.0]
                .iter()
                .map(|&depth| Point {
                    depth,
                    weight: s.between(0.0, 1.0),
                })
                .collect();
            let between = s.count(0, 2 * n);
            points.extend(s.scattered(Depths::Unit, between));
            let eta = match s.count(0, 3) {
                0 => 0.0,
                1 => 1.0,
                2 => s.pick(&[0.0, 1.0]) + s.sign() * s.magnitude(-7.0, -2.0),
                _ => s.unit(),
            };
            rounded(n, &points, eta, Mass::Is(1.0), None)
        }
        Kind::Quantised { depths, bits } => quantised(depths, bits, n, s),
        Kind::Denormal => {
            let (points, eta) = generic(Depths::Symmetric, n, s);
            // From the smallest normal number down to where a few bits are left.
            let scale = T::LEAST_NORMAL * s.magnitude(-5.0, 0.0);
            let unscaled: Row<f64> = rounded(n, &points, eta, Mass::Is(1.0), None);
            let mut row = unscaled.map(T::round);
            row.m = unscaled.m.map(|m| T::round(m * scale));
            row
        }
        Kind::Mass { exponent } => {
            let (points, eta) = generic(Depths::Symmetric, n, s);
            let mass = 10.0_f64.powi(exponent);
            rounded(n, &points, eta, Mass::Is(mass), None)
        }
        Kind::Units => {
            let (mut points, eta) = generic(Depths::Symmetric, n, s);
            let mass = Mass::Is(s.magnitude(-6.0, 6.0));
            // The last moment has 2n times its power: it stays within the range of `f32`.
            let most = (14.0 / n as f64).min(8.0);
            let length = s.magnitude(-most, most);
            for point in &mut points {
                point.depth *= length;
            }
            rounded(n, &points, eta * length, mass, None)
        }
        Kind::HeavyTail => {
            let count = s.count(n + 1, 4 * n);
            let mut points: Vec<Point> = (0..count)
                .map(|_| Point {
                    weight: s.unit(),
                    depth: s.normal(),
                })
                .collect();
            for _ in 0..s.count(1, 3) {
                points.push(Point {
                    weight: s.magnitude(-6.0, -2.0),
                    depth: s.sign() * s.magnitude(0.5, 2.0),
                });
            }
            let eta = match s.count(0, 3) {
                0 => s.pick(&points).depth * s.between(0.9, 1.1),
                _ => s.normal(),
            };
            rounded(n, &points, eta, Mass::Is(1.0), None)
        }
        Kind::Impossible => impossible(n, s),
        Kind::NotFinite => not_finite(n, s),
    }
}

/// Depths anywhere in a range, and a query there or a little beyond.
fn generic(depths: Depths, n: usize, s: &mut Source) -> (Vec<Point>, f64) {
    let count = s.count(n + 1, 6 * n);
    let points = s.scattered(depths, count);
    let (low, high) = depths.ends();
    let margin = 0.1 * (high - low);
    (points, s.between(low - margin, high + margin))
}

/// At one of few points, near one, or anywhere.
fn query(points: &[Point], s: &mut Source) -> f64 {
    let at = s.pick(points).depth;
    match s.count(0, 3) {
        0 => at,
        1 => at + s.sign() * s.magnitude(-7.0, -2.0),
        2 => at + s.sign() * s.magnitude(-2.0, 0.0),
        _ => s.between(-1.1, 1.1),
    }
}

fn float_bias(biased: bool, n: usize) -> Option<Mixture> {
    let target = match n {
        1 => bias_target::<f64, 1>(),
        2 => bias_target::<f64, 2>(),
        3 => bias_target::<f64, 3>(),
        4 => bias_target::<f64, 4>(),
        5 => bias_target::<f64, 5>(),
        _ => bias_target::<f64, 6>(),
    };
    biased.then(|| Mixture {
        strength: FLOAT_STRENGTHS[n - 1],
        target,
    })
}

/// The total weight.
enum Mass {
    /// As the weights are.
    Free,
    /// So much.
    Is(f64),
}

/// Moments in double-double, the bias mixed in, rounded once. Depths are rounded first: a texel
/// holds its depth in the same precision as everything else.
fn rounded<T: Format>(
    n: usize,
    points: &[Point],
    eta: f64,
    mass: Mass,
    bias: Option<Mixture>,
) -> Row<T> {
    let exact = exact_moments(n, points, &mass);
    let mut row = Row {
        eta: T::round(eta),
        ..Row::default()
    };
    for j in 0..=2 * n {
        let mut m = exact[j];
        if let Some(bias) = &bias {
            let target = DoubleDouble::from(bias.target[j]) * exact[0];
            m += DoubleDouble::from(bias.strength) * (target - m);
        }
        row.m[j] = T::round_exact(m);
    }
    row
}

fn exact_moments(n: usize, points: &[Point], mass: &Mass) -> [DoubleDouble; MAX_MOMENTS] {
    let zero = DoubleDouble::from(0.0);
    let mut total = zero;
    for p in points {
        total += DoubleDouble::from(p.weight);
    }
    let scale = match mass {
        Mass::Free => DoubleDouble::from(1.0),
        Mass::Is(mass) => DoubleDouble::from(*mass) / total,
    };
    let mut m = [zero; MAX_MOMENTS];
    for p in points {
        let depth = DoubleDouble::from(p.depth);
        let mut power = DoubleDouble::from(p.weight) * scale;
        for m in m.iter_mut().take(2 * n + 1) {
            *m += power;
            power *= depth;
        }
    }
    m
}

/// Texels of one depth, each with its moments in `T`, filtered in `T` with weights that sum to 1
/// but for rounding.
fn all_equal<T: Format>(biased: bool, n: usize, s: &mut Source) -> Row<T> {
    let points = s.scattered(Depths::Symmetric, 1);
    let texel: Row<T> = rounded(n, &points, query(&points, s), Mass::Is(1.0), None);
    let count = s.count(2, 81);
    let raw: Vec<f64> = (0..count).map(|_| s.between(0.05, 1.0)).collect();
    let total: f64 = raw.iter().sum();
    let mut row = Row {
        eta: texel.eta,
        ..Row::default()
    };
    for w in raw {
        let w = T::round(w / total);
        for (sum, &m) in row.m.iter_mut().zip(&texel.m) {
            *sum += w * m;
        }
    }
    match float_bias(biased, n) {
        Some(bias) => mixed(n, row, &bias),
        None => row,
    }
}

/// The bias mixed in as a kernel does it, in `T`.
fn mixed<T: Format>(n: usize, mut row: Row<T>, bias: &Mixture) -> Row<T> {
    let strength = T::round(bias.strength);
    for j in 1..=2 * n {
        let m = row.m[j];
        row.m[j] = m + strength * (T::round(bias.target[j]) * row.m[0] - m);
    }
    row
}

/// A renderer's distribution, stored in `bits` bits in the optimised basis, read back and biased in
/// `T`.
fn quantised<T: Format>(depths: Depths, bits: u32, n: usize, s: &mut Source) -> Row<T> {
    let (points, eta) = match s.count(0, 2) {
        0 => generic(depths, n, s),
        1 => s.silhouettes(depths, n),
        _ => s.own_surface(depths, n),
    };
    let exact = exact_moments(n, &points, &Mass::Is(1.0)).map(f64::from);
    let read: [T; 6] = match (n, bits) {
        (2, 10) => four::<T, 10>(depths, &exact),
        (2, _) => four::<T, 16>(depths, &exact),
        (_, 10) => six::<T, 10>(depths, &exact),
        (_, _) => six::<T, 16>(depths, &exact),
    };
    let mut row = Row {
        eta: T::round(eta),
        ..Row::default()
    };
    row.m[0] = T::round(1.0);
    row.m[1..=2 * n].copy_from_slice(&read[..2 * n]);
    mixed(n, row, &recommended(depths, bits, n))
}

/// A channel that was written with `BITS` bits and is read in `T`.
fn channel<T: Format, const BITS: usize>(x: f64) -> T {
    from_unorm::<T, BITS>(T::round(to_unorm::<f64, BITS>(x)))
}

/// Four moments through the optimised basis and back.
fn four<T: Format, const BITS: usize>(depths: Depths, exact: &[f64; MAX_MOMENTS]) -> [T; 6] {
    let m = Moments4 {
        b1: exact[1],
        b2: exact[2],
        b3: exact[3],
        b4: exact[4],
    };
    let q = match depths {
        Depths::Unit => quantize_unit_4(m),
        Depths::Symmetric => quantize_symmetric_4(m),
    };
    let q = hankel_moments::Quantized4 {
        r: channel::<T, BITS>(q.r),
        g: channel::<T, BITS>(q.g),
        b: channel::<T, BITS>(q.b),
        a: channel::<T, BITS>(q.a),
    };
    let m = match depths {
        Depths::Unit => dequantize_unit_4(q),
        Depths::Symmetric => dequantize_symmetric_4(q),
    };
    [m.b1, m.b2, m.b3, m.b4, T::default(), T::default()]
}

/// Six moments through the optimised basis and back.
fn six<T: Format, const BITS: usize>(depths: Depths, exact: &[f64; MAX_MOMENTS]) -> [T; 6] {
    let m = Moments6 {
        b1: exact[1],
        b2: exact[2],
        b3: exact[3],
        b4: exact[4],
        b5: exact[5],
        b6: exact[6],
    };
    let q = match depths {
        Depths::Unit => quantize_unit_6(m),
        Depths::Symmetric => quantize_symmetric_6(m),
    };
    let q = hankel_moments::Quantized6 {
        r0: channel::<T, BITS>(q.r0),
        g0: channel::<T, BITS>(q.g0),
        b0: channel::<T, BITS>(q.b0),
        r1: channel::<T, BITS>(q.r1),
        g1: channel::<T, BITS>(q.g1),
        b1: channel::<T, BITS>(q.b1),
    };
    let m = match depths {
        Depths::Unit => dequantize_unit_6(q),
        Depths::Symmetric => dequantize_symmetric_6(q),
    };
    [m.b1, m.b2, m.b3, m.b4, m.b5, m.b6]
}

/// The published bias; where none is published for so many bits, one that is as many steps.
fn recommended(depths: Depths, bits: u32, n: usize) -> Mixture {
    let Bias {
        bits: published,
        target,
        strength,
        ..
    } = match (depths, n) {
        (Depths::Unit, 2) => CLAMPED_4_16,
        (Depths::Symmetric, 2) => SYMMETRIC_4_16,
        (Depths::Unit, _) => CLAMPED_6_10,
        (Depths::Symmetric, _) => SYMMETRIC_6_16,
    };
    let steps = |bits: u32| 2.0_f64.powi(bits as i32);
    Mixture {
        strength: strength * steps(published) / steps(bits),
        target,
    }
}

/// Moments of no distribution.
fn impossible<T: Format>(n: usize, s: &mut Source) -> Row<T> {
    let count = 2 * n + 1;
    let mut m = [0.0; MAX_MOMENTS];
    let kind = s.count(0, 5);
    match kind {
        // Noise.
        0 => m[..count].fill_with(|| s.between(-1.0, 1.0)),
        // A distribution's, but for the sign of the total or of an even moment.
        1 | 2 => {
            let (points, _) = generic(Depths::Symmetric, n, s);
            m = exact_moments(n, &points, &Mass::Is(1.0)).map(f64::from);
            let j = if kind == 1 { 0 } else { 2 * s.count(1, n) };
            m[j] = -m[j];
        }
        // A distribution's, moved a little.
        3 => {
            let points = s.scattered(Depths::Symmetric, n);
            m = exact_moments(n, &points, &Mass::Is(1.0)).map(f64::from);
            let j = s.count(1, 2 * n);
            m[j] += s.sign() * s.magnitude(-7.0, 0.0);
        }
        // Nothing, or next to nothing.
        4 => m[..count].fill_with(|| s.pick(&[0.0, 0.0, -0.0, 1e-30, -1e-30])),
        // Every size.
        _ => {
            let largest = match T::PRECISION {
                Precision::F32 => 38.5,
                Precision::F64 => 308.2,
            };
            m[..count].fill_with(|| s.sign() * s.magnitude(-largest, largest));
        }
    }
    let eta = match s.count(0, 2) {
        0 => s.between(-1.1, 1.1),
        1 => s.pick(&[0.0, -1.0, 1.0]),
        _ => s.sign() * s.magnitude(-30.0, 30.0),
    };
    Row {
        m: m.map(T::round),
        eta: T::round(eta),
    }
}

/// A distribution's moments, but for NaN and infinity in some places.
fn not_finite<T: Format>(n: usize, s: &mut Source) -> Row<T> {
    let (points, eta) = generic(Depths::Symmetric, n, s);
    let mut row: Row<T> = rounded(n, &points, eta, Mass::Is(1.0), None);
    for _ in 0..s.count(1, 3) {
        let bad = T::round(s.pick(&[f64::NAN, -f64::NAN, f64::INFINITY, f64::NEG_INFINITY]));
        match s.count(0, 2 * n + 1) {
            j if j <= 2 * n => row.m[j] = bad,
            _ => row.eta = bad,
        }
    }
    row
}
