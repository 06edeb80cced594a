//! Trigonometric moment shadow mapping.

use std::ops::{Add, Div, Mul, Neg, Sub};

use hankel_moments::TrigonometricMoments;

use super::{Float, root};

/// A complex number.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Complex<T> {
    re: T,
    im: T,
}

impl<T: Float> Complex<T> {
    fn new(re: T, im: T) -> Self {
        Self { re, im }
    }
    fn real(re: T) -> Self {
        Self::new(re, T::default())
    }
    fn conjugate(self) -> Self {
        Self::new(self.re, -self.im)
    }
    fn square(self) -> T {
        self.re * self.re + self.im * self.im
    }
    fn scaled(self, by: T) -> Self {
        Self::new(self.re * by, self.im * by)
    }
    /// The angle over a full turn, from 0 to 1.
    fn depth(self) -> T {
        let turns = T::atan2(self.im, self.re) / T::round(std::f64::consts::TAU);
        if turns < T::default() {
            turns + T::round(1.0)
        } else {
            turns
        }
    }
    /// A power with the exponent 1 / `degree`.
    fn root(self, degree: f64) -> Self {
        let magnitude = root(self.square());
        if magnitude == T::default() {
            return self;
        }
        let angle = T::atan2(self.im, self.re) / T::round(degree);
        let length = T::round(magnitude.widen().powf(1.0 / degree));
        Self::new(length * Float::cos(angle), length * Float::sin(angle))
    }
}

impl<T: Float> Add for Complex<T> {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self::new(self.re + other.re, self.im + other.im)
    }
}
impl<T: Float> Sub for Complex<T> {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        Self::new(self.re - other.re, self.im - other.im)
    }
}
impl<T: Float> Mul for Complex<T> {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        Self::new(
            self.re * other.re - self.im * other.im,
            self.re * other.im + self.im * other.re,
        )
    }
}
impl<T: Float> Div for Complex<T> {
    type Output = Self;
    fn div(self, other: Self) -> Self {
        let square = other.square();
        let product = self * other.conjugate();
        Self::new(product.re / square, product.im / square)
    }
}
impl<T: Float> Neg for Complex<T> {
    type Output = Self;
    fn neg(self) -> Self {
        Self::new(-self.re, -self.im)
    }
}

type Vector<T> = [Complex<T>; 3];

/// The inverse of the Toeplitz matrix, by Cramer's rule.
struct Kernel<T> {
    inverse: [Vector<T>; 3],
}

impl<T: Float> Kernel<T> {
    fn new(m: TrigonometricMoments<T>) -> Self {
        let one = Complex::real(T::round(1.0));
        let first = Complex::new(m.c1, m.s1);
        let second = Complex::new(m.c2, m.s2);
        // B_jk = b_(j - k), conjugate above the diagonal.
        let b = [
            [one, first.conjugate(), second.conjugate()],
            [first, one, first.conjugate()],
            [second, first, one],
        ];
        let minor = |i: usize, j: usize| {
            let rows = [(i + 1) % 3, (i + 2) % 3];
            let columns = [(j + 1) % 3, (j + 2) % 3];
            b[rows[0]][columns[0]] * b[rows[1]][columns[1]]
                - b[rows[0]][columns[1]] * b[rows[1]][columns[0]]
        };
        let determinant = b[0][0] * minor(0, 0) + b[0][1] * minor(0, 1) + b[0][2] * minor(0, 2);
        let inverse = std::array::from_fn(|i| std::array::from_fn(|j| minor(j, i) / determinant));
        Self { inverse }
    }

    /// The inverse times the vector of a direction.
    fn of(&self, x: Complex<T>) -> Vector<T> {
        let powers = [Complex::real(T::round(1.0)), x, x * x];
        self.inverse
            .map(|row| row[0] * powers[0] + row[1] * powers[1] + row[2] * powers[2])
    }

    /// `b*(x) v`
    fn at(x: Complex<T>, v: Vector<T>) -> Complex<T> {
        let x = x.conjugate();
        v[0] + v[1] * x + v[2] * (x * x)
    }
}

/// The least share below `z`, from 0 to 1, over all distributions on \[0, 1\] with two complex
/// trigonometric moments (\[MSM\], Conjecture 17, Equations 3 to 5).
#[must_use]
#[allow(
    clippy::needless_range_loop,
    reason = "indices are those of the published form"
)]
pub fn trigonometric<T: Float>(m: TrigonometricMoments<T>, z: T) -> T {
    let (zero, one) = (T::default(), T::round(1.0));
    let kernel = Kernel::new(m);
    let angle = z * T::round(std::f64::consts::TAU);
    let query = Complex::new(Float::cos(angle), Float::sin(angle));
    let start = Complex::real(one);
    let of_start = kernel.of(start);
    let of_query = kernel.of(query);
    // The canonical representation with a point at one: b*(x) v = 0, a quadratic in conj(x).
    let [c0, c1, c2] = of_start;
    let half = -c1.scaled(T::round(0.5));
    let r = (half * half - c0 * c2).root(2.0);
    let mut others = [(half - r) / c2, (half + r) / c2].map(|x| x.conjugate().depth());
    if others[1] < others[0] {
        others.swap(0, 1);
    }
    if z <= others[0] {
        return zero;
    }
    let (a, c) = (
        Kernel::at(start, of_start).re,
        Kernel::at(query, of_query).re,
    );
    let d = root(Kernel::at(query, of_start).square());
    if z > others[1] {
        // The critical point that is a weight: (C - D) / (AC - D²).
        let end = ((c - d) / (a * c - d * d)).min(one / a).max(zero);
        let own = one / (c + end * d * d / (one - end * a));
        return (one - own - end).max(zero);
    }
    // 1/w_0 as a trigonometric polynomial, its derivative as a quartic in x.
    let quotient = Kernel::at(query, of_start);
    let mut f = [Complex::real(zero); 5];
    for j in 0..3 {
        for k in 0..3 {
            let product = of_query[k].conjugate() * of_start[j] / quotient;
            f[k + 2 - j] = f[k + 2 - j] + kernel.inverse[j][k] - product;
        }
    }
    let two = T::round(2.0);
    let derivative = [
        -f[0].scaled(two),
        -f[1],
        Complex::real(zero),
        f[3],
        f[4].scaled(two),
    ];
    let mut most = zero;
    for x in quartic_roots(derivative) {
        let place = x.depth();
        let magnitude = root(x.square());
        let is_direction = (magnitude - one).abs() < T::round(1e-2);
        if is_direction && place < z {
            let x = x.scaled(one / magnitude);
            let mut value = f[4];
            for &c in f.iter().rev().skip(1) {
                value = value * x + c;
            }
            // Times x to the power of -2.
            most = most.max((value / (x * x)).re);
        }
    }
    if most > zero {
        (one / most).min(one)
    } else {
        zero
    }
}

/// The roots of a quartic, lowest coefficient first (L. Ferrari, by way of the resolvent cubic).
fn quartic_roots<T: Float>(c: [Complex<T>; 5]) -> [Complex<T>; 4] {
    let number = |x: f64| Complex::real(T::round(x));
    let [e, d, c2, b, a] = c;
    let (b, c2, d, e) = (b / a, c2 / a, d / a, e / a);
    // Depressed: y^4 + p y^2 + q y + r, x = y - b/4.
    let bb = b * b;
    let p = c2 - bb * number(0.375);
    let q = bb * b * number(0.125) - b * c2 * number(0.5) + d;
    let r = e - b * d * number(0.25) + bb * c2 * number(0.0625) - bb * bb * number(3.0 / 256.0);
    // A root of the resolvent 8 m^3 + 8 p m^2 + (2 p^2 - 8 r) m - q^2.
    let p0 = -(p * p * number(1.0 / 12.0)) - r;
    let q0 = -(p * p * p * number(1.0 / 108.0)) + p * r * number(1.0 / 3.0) - q * q * number(0.125);
    let inner = (q0 * q0 * number(0.25) + p0 * p0 * p0 * number(1.0 / 27.0)).root(2.0);
    let (u, v) = (-(q0 * number(0.5)) + inner, -(q0 * number(0.5)) - inner);
    let u = if u.square() < v.square() { v } else { u }.root(3.0);
    let shift = if u.square() == T::default() {
        u
    } else {
        u - p0 / (u * number(3.0))
    };
    let m = shift - p * number(1.0 / 3.0);
    let w = (m * number(2.0)).root(2.0);
    let corner = q / w;
    let rest = |sign: f64| {
        (-(m * number(2.0)) - p * number(2.0) + corner.scaled(T::round(sign * 2.0))).root(2.0)
    };
    let (s, t) = (rest(-1.0), rest(1.0));
    let base = -(b * number(0.25));
    let half = number(0.5);
    [
        base + (w + s) * half,
        base + (w - s) * half,
        base + (-w + t) * half,
        base + (-w - t) * half,
    ]
}
