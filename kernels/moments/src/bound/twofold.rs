//! Numbers of which the rounding error is kept, or is not: what Chebyshev's algorithm runs on.

use hankel_dsl::{Real, function, lit};

/// The arithmetic that the recurrence needs.
pub(crate) trait Arithmetic<R: Real>: Copy {
    /// Whether it has about twice the digits of the base type.
    const TWICE: bool;
    /// Exactly `x`.
    fn of(x: R) -> Self;
    /// `high + low`, of which `low` is a rounding error of `high`.
    fn of_two(high: R, low: R) -> Self;
    /// `a b - c d`
    fn difference(a: R, b: R, c: R, d: R) -> Self;
    /// The nearest number of the base type.
    fn rounded(self) -> R;
    /// Difference.
    fn minus(self, other: Self) -> Self;
    /// Product.
    fn times(self, other: Self) -> Self;
    /// Product with a number of the base type.
    fn times_plain(self, x: R) -> Self;
    /// Product with a power of two.
    fn scaled(self, power: R) -> Self;
    /// Sum.
    fn plus(self, other: Self) -> Self;
    /// `self a + b c`
    fn sum_of_products(self, a: Self, b: Self, c: Self) -> Self;
    /// `self a - b c`
    fn cross(self, a: Self, b: Self, c: Self) -> Self;
    /// Quotient. Its magnitude is limited to 2⁸⁰, so that a vanishing divisor (which must not be
    /// negative) does no harm.
    fn over(self, positive: Self) -> Self;
    /// `floor` if the number is less.
    fn at_least(self, floor: R) -> Self;
    /// Moved between the limits.
    fn within(self, low: R, high: R) -> Self;
}

/// A divisor that keeps a quotient's magnitude below 2⁸⁰.
#[function]
#[inline(always)]
fn divisor<R: Real>(numerator: R, positive: R) -> R {
    let smallest: R = lit!(1e-37);
    let least = numerator.abs() * lit!(1.0 / (1_u128 << 80) as f64);
    positive.max(least.max(smallest))
}

/// A number as it is.
#[derive(Clone, Copy)]
pub(crate) struct Plain<R>(R);

impl<R: Real> Arithmetic<R> for Plain<R> {
    const TWICE: bool = false;
    #[inline(always)]
    fn of(x: R) -> Self {
        Self(x)
    }
    #[inline(always)]
    fn of_two(high: R, _low: R) -> Self {
        Self(high)
    }
    #[inline(always)]
    fn difference(a: R, b: R, c: R, d: R) -> Self {
        Self(a * b - c * d)
    }
    #[inline(always)]
    fn rounded(self) -> R {
        self.0
    }
    #[inline(always)]
    fn minus(self, other: Self) -> Self {
        Self(self.0 - other.0)
    }
    #[inline(always)]
    fn times(self, other: Self) -> Self {
        Self(self.0 * other.0)
    }
    #[inline(always)]
    fn times_plain(self, x: R) -> Self {
        Self(self.0 * x)
    }
    #[inline(always)]
    fn scaled(self, power: R) -> Self {
        Self(self.0 * power)
    }
    #[inline(always)]
    fn plus(self, other: Self) -> Self {
        Self(self.0 + other.0)
    }
    #[inline(always)]
    fn sum_of_products(self, a: Self, b: Self, c: Self) -> Self {
        Self(self.0 * a.0 + b.0 * c.0)
    }
    #[inline(always)]
    fn cross(self, a: Self, b: Self, c: Self) -> Self {
        Self(self.0 * a.0 - b.0 * c.0)
    }
    #[inline(always)]
    fn over(self, positive: Self) -> Self {
        Self(self.0 / divisor(self.0, positive.0))
    }
    #[inline(always)]
    fn at_least(self, floor: R) -> Self {
        Self(self.0.max(floor))
    }
    #[inline(always)]
    fn within(self, low: R, high: R) -> Self {
        Self(self.0.clamp(low, high))
    }
}

/// An unevaluated sum of two numbers, the second within the first's rounding error: about twice
/// the digits (T. Dekker, *A floating-point technique for extending the available precision*, 1971).
///
/// Every error term comes from [`Real::two_sum`] and [`Real::two_product`], which hide it from
/// compilers that reorder sums: `(high + low) - high` written out, a driver makes it `low`.
#[derive(Clone, Copy)]
pub(crate) struct Twofold<R> {
    high: R,
    low: R,
}

impl<R: Real> Twofold<R> {
    /// `high + low` where `low` is small: both parts renewed.
    #[inline(always)]
    fn of_parts(high: R, low: R) -> Self {
        let (high, low) = high.two_sum(low);
        Self { high, low }
    }

    /// The product: rounded, and what that took off.
    #[inline(always)]
    fn product(self, other: Self) -> (R, R) {
        let (product, error) = self.high.two_product(other.high);
        (
            product,
            error + (self.high * other.low + self.low * other.high),
        )
    }
}

impl<R: Real> Arithmetic<R> for Twofold<R> {
    const TWICE: bool = true;
    #[inline(always)]
    fn of(x: R) -> Self {
        Self {
            high: x,
            low: lit!(0.0),
        }
    }
    #[inline(always)]
    fn of_two(high: R, low: R) -> Self {
        Self { high, low }
    }
    #[inline(always)]
    fn difference(a: R, b: R, c: R, d: R) -> Self {
        let (first, rest) = a.two_product(b);
        let (second, other) = c.two_product(d);
        let (sum, error) = first.two_sum(-second);
        // Where the products cancel, their errors are all that is left.
        let (sum, left) = sum.two_sum(rest - other);
        Self::of_parts(sum, error + left)
    }
    #[inline(always)]
    fn rounded(self) -> R {
        self.high
    }
    #[inline(always)]
    fn minus(self, other: Self) -> Self {
        let (sum, error) = self.high.two_sum(-other.high);
        Self::of_parts(sum, error + (self.low - other.low))
    }
    #[inline(always)]
    fn times(self, other: Self) -> Self {
        let (product, rest) = self.product(other);
        Self::of_parts(product, rest)
    }
    #[inline(always)]
    fn times_plain(self, x: R) -> Self {
        let (product, error) = self.high.two_product(x);
        Self::of_parts(product, error + self.low * x)
    }
    #[inline(always)]
    fn scaled(self, power: R) -> Self {
        Self {
            high: self.high * power,
            low: self.low * power,
        }
    }
    #[inline(always)]
    fn plus(self, other: Self) -> Self {
        let (sum, error) = self.high.two_sum(other.high);
        Self::of_parts(sum, error + (self.low + other.low))
    }
    #[inline(always)]
    fn sum_of_products(self, a: Self, b: Self, c: Self) -> Self {
        let one: R = lit!(1.0);
        self.cross(a, b.scaled(-one), c)
    }
    #[inline(always)]
    fn cross(self, a: Self, b: Self, c: Self) -> Self {
        let (first, rest) = self.product(a);
        let (second, other) = b.product(c);
        let (sum, error) = first.two_sum(-second);
        Self::of_parts(sum, error + (rest - other))
    }
    #[inline(always)]
    fn over(self, positive: Self) -> Self {
        let by = divisor(self.high, positive.high);
        let first = self.high / by;
        let (product, error) = first.two_product(positive.high);
        let rest = ((self.high - product) - error + self.low - first * positive.low) / by;
        Self::of_parts(first, rest)
    }
    #[inline(always)]
    fn at_least(self, floor: R) -> Self {
        let is_less = self.high.lt(floor);
        Self {
            high: R::select(is_less, floor, self.high),
            low: R::select(is_less, lit!(0.0), self.low),
        }
    }
    #[inline(always)]
    fn within(self, low: R, high: R) -> Self {
        let inside = low.le(self.high) & self.high.le(high);
        Self {
            high: self.high.clamp(low, high),
            low: R::select(inside, self.low, lit!(0.0)),
        }
    }
}
