//! Rounded results of two `f64` together with their rounding errors, where
//! [`two_sum`](Real::two_sum) and [`two_product`](Real::two_product) are not enough.

use hankel_dsl::Real;

/// The sum and its error, where `a` is 0 or has an exponent not less than `b`'s (Dekker 1971).
#[inline(always)]
pub fn ordered_sum(a: f64, b: f64) -> (f64, f64) {
    let s = a + b;
    (s, b - (s - a))
}

/// The product and its error, however large: exact unless the error underflows, which it cannot
/// where a factor is 0 or the product is above [`PRODUCT_UNDERFLOW`] in magnitude. The error of a
/// product that overflows has the sign of what is missing.
#[inline(always)]
pub fn product(a: f64, b: f64) -> (f64, f64) {
    let p = a * b;
    if a.abs().max(b.abs()).max(p.abs()) > HALVES_OVERFLOW {
        // Where the processor has no such instruction, this is a slow call.
        return (p, f64::mul_add(a, b, -p));
    }
    a.two_product(b)
}

/// 2⁻⁹⁰⁰
pub const PRODUCT_UNDERFLOW: f64 = f64::from_bits((1023 - 900) << 52);
/// 2⁹⁹⁰: from here on the halves of a factor, or their products, may overflow.
const HALVES_OVERFLOW: f64 = f64::from_bits((1023 + 990) << 52);
