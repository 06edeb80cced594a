//! Numbers of which the rounding error is kept, or is not: what Chebyshev's algorithm runs on.

use hankel_dsl::{Real, function, lit};

use super::recurrence::two_to;

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
    /// Product moved between `-limit` and `limit`, which is at most 1e37 (in 64 bits 1e250), and never infinite on its
    /// way: error terms of what is infinite are no numbers. Nor must `other` be above that.
    fn times_within(self, other: Self, limit: R) -> Self;
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
    /// 1 / x, limited to 1e18, in 64 bits to 1e90.
    fn inverse(self) -> Self;
    /// `a` where `mask` holds, else `b`.
    fn select(mask: R::Mask, a: Self, b: Self) -> Self;
}

/// A divisor that keeps a quotient's magnitude below 2⁸⁰.
#[function]
#[inline(always)]
fn divisor<R: Real>(numerator: R, positive: R) -> R {
    let smallest: R = lit!(1e-37);
    let least = numerator.abs() * lit!(1.0 / (1_u128 << 80) as f64);
    positive.max(least.max(smallest))
}

/// The magnitude of what [`Arithmetic::inverse`] divides by, at least.
#[inline(always)]
fn least_divisor<R: Real>() -> R {
    if const { R::IS_WIDE } {
        lit!(1e-90)
    } else {
        lit!(1e-18)
    }
}

/// The product: rounded, and what that took off. Of a product that is too small for
/// [`Real::two_product`] to be exact everywhere, nothing: so every backend has the same bits, and the same sign
/// where that decides.
#[inline(always)]
pub(crate) fn product<R: Real>(a: R, b: R) -> (R, R) {
    let least: R = if const { R::IS_WIDE } {
        lit!(two_to(-900))
    } else {
        lit!(two_to(-78))
    };
    let (product, error) = a.two_product(b);
    let is_small = product.abs().lt(least);
    (product, R::select(is_small, lit!(0.0), error))
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
    fn times_within(self, other: Self, limit: R) -> Self {
        Self((self.0 * other.0).clamp(-limit, limit))
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
    #[inline(always)]
    fn inverse(self) -> Self {
        let least = least_divisor::<R>();
        let one: R = lit!(1.0);
        let x = self.0;
        Self(one / R::select(x.lt(lit!(0.0)), x.min(-least), x.max(least)))
    }
    #[inline(always)]
    fn select(mask: R::Mask, a: Self, b: Self) -> Self {
        Self(R::select(mask, a.0, b.0))
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
        let (product, error) = product(self.high, other.high);
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
        let (first, rest) = product(a, b);
        let (second, other) = product(c, d);
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
        let (product, error) = product(self.high, x);
        Self::of_parts(product, error + self.low * x)
    }
    #[inline(always)]
    fn times_within(self, other: Self, limit: R) -> Self {
        let one: R = lit!(1.0);
        let largest: R = if const { R::IS_WIDE } {
            lit!(1e250)
        } else {
            lit!(1e37)
        };
        let most = largest / other.high.abs().max(one);
        self.within(-most, most).times(other).within(-limit, limit)
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
        let (product, error) = product(first, positive.high);
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
    #[inline(always)]
    fn inverse(self) -> Self {
        let one: R = lit!(1.0);
        let sign = R::select(self.high.lt(lit!(0.0)), -one, one);
        let magnitude = self.scaled(sign).at_least(least_divisor());
        // Quotients are limited to 2⁸⁰.
        let lift = if const { R::IS_WIDE } {
            R::select(magnitude.high.lt(lit!(1e-20)), lit!(two_to(240)), one)
        } else {
            one
        };
        let inverse = Self::of(one).over(magnitude.scaled(lift));
        inverse.scaled(lift).scaled(sign)
    }
    #[inline(always)]
    fn select(mask: R::Mask, a: Self, b: Self) -> Self {
        Self {
            high: R::select(mask, a.high, b.high),
            low: R::select(mask, a.low, b.low),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parts(x: Twofold<f32>) -> (f32, f32) {
        (x.high, x.low)
    }

    #[test]
    fn a_limited_product_is_never_infinite_on_its_way() {
        let limit = 1e25_f32;
        for (a, b, expected) in [
            (1e25, 1e25, limit),
            (-1e25, 1e25, -limit),
            (3e24, -1e37, -limit),
            (-1e20, -1e30, limit),
        ] {
            let (a, b) = (Twofold::of(a), Twofold::of(b));
            // Not so without a limit.
            assert!(parts(a.times(b)).1.is_nan());
            assert_eq!(parts(a.times_within(b, limit)), (expected, 0.0));
        }
        let (a, b) = (Twofold::of_two(0.3, 1e-9), Twofold::of_two(-3e10, 100.0));
        assert_eq!(parts(a.times_within(b, limit)), parts(a.times(b)));
    }
}
