//! From moments to the three-term recurrence of their orthogonal polynomials.
//!
//! Monic polynomials that are orthogonal with respect to a distribution satisfy
//! `p_{k+1}(x) = (x - α_k) p_k(x) - β_k p_{k-1}(x)`. Chebyshev's algorithm finds the coefficients
//! from the moments (W. Gautschi, *Orthogonal Polynomials*, 2004, section 2.1.7). It is the Cholesky
//! factorisation of the Hankel matrix, which it never forms: `β_k` is the quotient of two pivots,
//! `α_k` the difference of two entries below the diagonal.
//!
//! What low precision loses of tight surfaces it loses here, where pivots are small differences of
//! moments. All that follows from the coefficients is well conditioned. So this is the one place
//! where the compensated variant computes with twice the digits.

use hankel_dsl::{Real, lit, unroll};

use super::twofold::Arithmetic;
use super::{MAX, MAX_MOMENTS};

/// The recurrence about the query point, in a unit of length that keeps powers of depths within
/// range.
#[derive(Clone, Copy)]
pub(crate) struct Recurrence<R> {
    /// `α_k` minus the query point; `a[0]` is the mean.
    pub a: [R; MAX],
    /// `β_k` from index 1 on; `b[1]` is the variance.
    pub b: [R; MAX + 1],
    /// Mean square distance to the query point: `a[0]² + b[1]`.
    pub square: R,
    /// The variance's share of it.
    pub spread: R,
    /// The squared mean's share of it.
    pub rest: R,
    /// The unit of length: 1 for N up to 2, where no high powers occur and a rounding less counts;
    /// else the root of the mean square distance.
    pub unit: R,
    /// `m_0`, or 0 if it is not a positive number.
    pub total: R,
}

/// `x`, or 0 if it is not a number or so large that its products would be infinite.
#[inline(always)]
pub(crate) fn finite<R: Real>(x: R, largest: R) -> R {
    R::select(x.abs().le(largest), x, lit!(0.0))
}

/// The largest |a| that is used: 2N factors of that size and a few more stay within the type's
/// range for the largest N.
#[inline(always)]
pub(crate) fn farthest<R: Real>() -> R {
    let half: R = lit!(0.5);
    half / R::epsilon().sqrt()
}

/// 2 to that power, of which the exponent is in `f64`'s range.
const fn two_to(power: i32) -> f64 {
    f64::from_bits(((1023 + power) as u64) << 52)
}

/// A power of two that brings a total into the middle of `f32`'s range.
#[inline(always)]
fn scale<R: Real>(total: R) -> R {
    let one: R = lit!(1.0);
    let large = R::select(total.gt(lit!(1e27)), lit!(two_to(-110)), lit!(two_to(-60)));
    let small = if const { R::IS_WIDE } {
        let mut small = one;
        let mut scaled = total;
        // From 2⁻⁵³⁴ on up, all get from 2⁻³⁰ to 2³⁰.
        raise(
            &mut small,
            &mut scaled,
            lit!(two_to(270)),
            lit!(two_to(-240)),
        );
        raise(
            &mut small,
            &mut scaled,
            lit!(two_to(135)),
            lit!(two_to(-105)),
        );
        raise(&mut small, &mut scaled, lit!(two_to(68)), lit!(two_to(-38)));
        raise(&mut small, &mut scaled, lit!(two_to(34)), lit!(two_to(-4)));
        small
    } else {
        R::select(total.lt(lit!(1e-27)), lit!(two_to(110)), lit!(two_to(60)))
    };
    R::select(
        total.lt(lit!(1e-9)),
        small,
        R::select(total.gt(lit!(1e9)), large, one),
    )
}

/// What brings totals down to 2⁻¹⁰⁷⁴ to where [`scale`] reaches: 1 for nearly all of them.
#[inline(always)]
fn lift<R: Real>(total: R) -> R {
    let one: R = lit!(1.0);
    if const { R::IS_WIDE } {
        R::select(total.lt(lit!(two_to(-510))), lit!(two_to(540)), one)
    } else {
        one
    }
}

/// Multiplies both by `power` if the second is below `limit`.
#[inline(always)]
fn raise<R: Real>(scale: &mut R, scaled: &mut R, power: R, limit: R) {
    let factor = R::select(scaled.lt(limit), power, lit!(1.0));
    *scale *= factor;
    *scaled *= factor;
}

impl<R: Real> Recurrence<R> {
    /// The first N steps for moments `m_0` to `m_2N`, of any value, and query point `eta`.
    ///
    /// What is not a number, or too large (the query point above 1e12, a moment above 1e25 times
    /// the total or so), counts as 0.
    ///
    /// Pivots are lifted to the size of their own rounding errors, `floor` times the moment on the
    /// diagonal: `ε/4` for plain arithmetic.
    #[inline(always)]
    pub fn new<A: Arithmetic<R>, const N: usize>(m: [R; MAX_MOMENTS], eta: R, floor: R) -> Self {
        let zero: R = lit!(0.0);
        let largest: R = lit!(1e25);
        let far: R = if const { N > 2 } {
            lit!(1e12)
        } else {
            lit!(1e9)
        };
        let total = finite(m[0], lit!(1e37)).max(zero);
        let lift = lift(total);
        let lifted = total * lift;
        let scale = scale(lifted);
        let eta = finite(eta, far);
        let query = A::of(eta);

        let mut current = [A::of(zero); MAX_MOMENTS];
        let scaled_total = (lifted * scale).max(lit!(1e-12));
        // Far below what rounding leaves of a pivot, and far above what is too small to divide by.
        let least = R::epsilon() * (R::epsilon() * (scaled_total * lit!(1e-3)));
        current[0] = A::of(scaled_total);
        unroll!(k in 1..(2 * N + 1), max 11, {
            current[k] = A::of(finite(finite(m[k], lit!(1e37)) * lift * scale, largest));
        });
        let raw = current;
        let mut previous = current;

        let mut slope = current[1].over(current[0]);
        let mut alpha = slope.within(-far, far);
        let mut beta = A::of(zero);
        let mut square = scaled_total;
        let mut unit = scaled_total;
        let mut limit = far;
        let mut a = [zero; MAX];
        let mut b = [zero; MAX + 1];
        a[0] = alpha.minus(query).rounded();
        unroll!(k in 1..(N + 1), max 6, {
            let mut next = current;
            unroll!(l in 1..10, max 11, {
                if const { l >= k && l + k <= 2 * N } {
                    let mut t = current[l + 1].minus(alpha.times(current[l]));
                    if const { k > 1 } {
                        t = t.minus(beta.times(previous[l]));
                    }
                    next[l] = t.within(-largest, largest);
                }
            });
            if const { k == 2 } {
                // As the Cholesky factorisation has it: where a bias is all that is left of the
                // pivot, this keeps more of it.
                let mean_square = raw[2].over(raw[0]);
                let t = raw[4].minus(mean_square.times(raw[2]));
                let t = t.minus(slope.times(current[2]));
                next[2] = t.within(-largest, largest);
            }
            let noise = raw[2 * k].rounded().abs() * floor;
            next[k] = next[k].at_least(noise.max(least));
            beta = next[k].over(current[k - 1]).within(zero, far);
            b[k] = beta.rounded();
            if const { k == 1 } {
                square = b[1] + a[0] * a[0];
                unit = square.sqrt();
                limit = (unit * farthest::<R>()).min(far);
            }
            if const { k < N } {
                let below = next[k + 1].over(next[k]);
                alpha = below.minus(slope).within(eta - limit, eta + limit);
                slope = below;
                a[k] = alpha.minus(query).rounded();
            }
            previous = current;
            current = next;
        });

        let spread = b[1] / square;
        let one: R = lit!(1.0);
        // The complement where that rounds less.
        let rest = R::select(spread.lt(lit!(0.5)), one - spread, a[0] * a[0] / square);
        if const { N > 2 } {
            let most = farthest::<R>() * farthest::<R>();
            unroll!(k in 0..N, max 6, {
                a[k] = a[k] / unit;
                b[k + 1] = (b[k + 1] / square).min(most);
            });
            square = one;
        } else {
            unit = one;
        }
        Self {
            a,
            b,
            square,
            spread,
            rest,
            unit,
            total,
        }
    }
}
