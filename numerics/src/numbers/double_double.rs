use std::ops::{Add, Div, Mul, Neg};

use hankel_dsl::Real;

use super::error_free::{ordered_sum, product};

/// The unevaluated sum of two `f64`, of which the second is at most half a unit in the first's last
/// place: 106 bits or a little more, with the exponents of `f64`.
///
/// Relative errors are below 3·2⁻¹⁰⁶ for `+`, 7·2⁻¹⁰⁶ for `*`, 16·2⁻¹⁰⁶ for `/` (M. Joldeş,
/// J.-M. Muller, V. Popescu: *Tight and Rigorous Error Bounds for Basic Building Blocks of
/// Double-Word Arithmetic*, 2017) and 4·2⁻¹⁰⁶ for the square root (V. Lefèvre, N. Louvet, J.-M.
/// Muller, J. Picot, L. Rideau: *Accurate Calculation of Euclidean Norms Using Double-Word
/// Arithmetic*, 2023), while nothing on the way underflows (as it may below 2⁻⁹⁰⁰) or overflows.
#[derive(Clone, Copy, Debug, Default, PartialEq, PartialOrd)]
pub struct DoubleDouble {
    high: f64,
    low: f64,
}

impl DoubleDouble {
    /// The sum `a + b`, exactly.
    #[inline(always)]
    #[must_use]
    pub fn of_sum(a: f64, b: f64) -> Self {
        let (high, low) = a.two_sum(b);
        Self { high, low }
    }

    /// The nearest `f64`.
    #[inline(always)]
    #[must_use]
    pub fn high(self) -> f64 {
        self.high
    }

    /// What [`high`](Self::high) leaves out.
    #[inline(always)]
    #[must_use]
    pub fn low(self) -> f64 {
        self.low
    }

    /// `high + low` where `high` is the larger.
    #[inline(always)]
    fn ordered(high: f64, low: f64) -> Self {
        let (high, low) = ordered_sum(high, low);
        Self { high, low }
    }
}

impl From<f64> for DoubleDouble {
    #[inline(always)]
    fn from(x: f64) -> Self {
        Self { high: x, low: 0.0 }
    }
}

impl From<f32> for DoubleDouble {
    #[inline(always)]
    fn from(x: f32) -> Self {
        f64::from(x).into()
    }
}

impl From<DoubleDouble> for f64 {
    #[inline(always)]
    fn from(x: DoubleDouble) -> Self {
        x.high
    }
}

impl Neg for DoubleDouble {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self {
            high: -self.high,
            low: -self.low,
        }
    }
}

impl Add for DoubleDouble {
    type Output = Self;
    #[inline(never)]
    fn add(self, other: Self) -> Self {
        let (s, s_error) = self.high.two_sum(other.high);
        let (t, t_error) = self.low.two_sum(other.low);
        let (s, rest) = ordered_sum(s, s_error + t);
        Self::ordered(s, rest + t_error)
    }
}

impl Mul for DoubleDouble {
    type Output = Self;
    #[inline(never)]
    fn mul(self, other: Self) -> Self {
        let (p, error) = product(self.high, other.high);
        let cross = self.high * other.low + self.low * other.high;
        Self::ordered(p, error + (cross + self.low * other.low))
    }
}

impl Div for DoubleDouble {
    type Output = Self;
    #[inline(never)]
    fn div(self, other: Self) -> Self {
        let quotient = self.high / other.high;
        let (p, error) = product(quotient, other.high);
        let taken = Self::ordered(p, error + quotient * other.low);
        let rest = (self.high - taken.high) + (self.low - taken.low);
        Self::ordered(quotient, rest / other.high)
    }
}

remaining_operators!([] DoubleDouble);

impl Real for DoubleDouble {
    ordered!();

    #[inline(always)]
    fn literal<const BITS: u64>() -> Self {
        f64::from_bits(BITS).into()
    }
    /// 2⁻¹⁰⁴, as is customary: what follows 1 directly is much nearer, but a sum or a product near 1
    /// is no better than this.
    #[inline(always)]
    fn epsilon() -> Self {
        (f64::EPSILON * f64::EPSILON).into()
    }
    #[inline(never)]
    fn sqrt(self) -> Self {
        let root = self.high.sqrt();
        if root == 0.0 {
            return root.into();
        }
        let (p, error) = product(root, root);
        let rest = ((self.high - p) - error) + self.low;
        Self::ordered(root, rest / (2.0 * root))
    }
    #[inline(always)]
    fn abs(self) -> Self {
        // By the sign bit, so that -0 has one result.
        if self.high.is_sign_negative() {
            -self
        } else {
            self
        }
    }
    #[inline(always)]
    fn floor(self) -> Self {
        let high = self.high.floor();
        let low = if high == self.high {
            self.low.floor()
        } else {
            0.0
        };
        Self::ordered(high, low)
    }
}
