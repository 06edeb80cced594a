//! From moments to the three-term recurrence of their orthogonal polynomials.
//!
//! Monic polynomials that are orthogonal with respect to a distribution satisfy
//! `p_{k+1}(x) = (x - α_k) p_k(x) - β_k p_{k-1}(x)`. Chebyshev's algorithm finds the coefficients
//! from the moments (W. Gautschi, *Orthogonal Polynomials*, 2004, section 2.1.7). It is the Cholesky
//! factorisation of the Hankel matrix, which it never forms: `β_k` is the quotient of two pivots,
//! `α_k` the difference of two entries below the diagonal.
//!
//! What low precision loses of tight surfaces it loses here, where pivots are small differences of
//! moments. The compensated variant computes them with twice the digits, and the first row of
//! differences, of products of two moments each, with all that are left.

use hankel_dsl::{Mask, Real, apart, array_element, array_element_mut, function, lit, unroll};

use super::twofold::Arithmetic;
use super::{MAX, MAX_MOMENTS, is_long};

/// The recurrence about the query point, in a unit of length that keeps powers of depths within
/// range. Its coefficients keep all digits that they were computed with.
#[derive(Clone, Copy)]
pub(crate) struct Recurrence<R, A> {
    /// `α_k` minus the query point; `a[0]` is the mean.
    pub a: [A; MAX],
    /// `β_k` from index 1 on; `b[1]` is the variance.
    pub b: [A; MAX + 1],
    /// Mean square distance to the query point: `a[0]² + b[1]`.
    pub square: R,
    /// The variance's share of it.
    pub spread: R,
    /// The squared mean's share of it.
    pub rest: R,
    /// The reciprocal of the unit of length, near the root of the mean square distance: a power of two in twice the
    /// digits. Otherwise that of the depths for N up to 2, where no high powers occur and a rounding
    /// less counts, and else the root itself.
    pub per_unit: R,
    /// `m_0`, or 0 if it is not a positive number.
    pub total: R,
    /// The query point, or where it was moved to.
    pub query: R,
}

/// `x`, or 0 if it is not a number or so large that its products would be infinite.
#[inline(always)]
pub(crate) fn finite<R: Real>(x: R, largest: R) -> R {
    R::select(x.abs().le(largest), x, lit!(0.0))
}

/// The largest |a| that is used: 2N factors of that size and a few more stay within the type's
/// range.
#[inline(always)]
fn farthest<R: Real, A: Arithmetic<R>, const N: usize>() -> R {
    if const { N == 6 && !R::IS_WIDE } {
        lit!(400.0)
    } else if const { !A::TWICE } {
        let half: R = lit!(0.5);
        half / R::epsilon().sqrt()
    } else if const { R::IS_WIDE } {
        lit!(1e12)
    } else if const { N < 3 } {
        lit!(1e7)
    } else if const { N == 3 } {
        lit!(1e5)
    } else if const { N == 4 } {
        lit!(6e3)
    } else {
        lit!(1.4e3)
    }
}

/// 2 to that power, of which the exponent is in `f64`'s range.
pub(crate) const fn two_to(power: i32) -> f64 {
    f64::from_bits(((1023 + power) as u64) << 52)
}

/// What is beyond counts as 0.
#[inline(always)]
pub(crate) fn beyond<R: Real>() -> R {
    if const { R::IS_WIDE } {
        lit!(1e290)
    } else {
        lit!(1e37)
    }
}

/// The largest moment, relative to the total, whose products with others are finite.
#[inline(always)]
fn largest<R: Real>() -> R {
    if const { R::IS_WIDE } {
        lit!(1e100)
    } else {
        lit!(1e25)
    }
}

/// The largest distance.
#[inline(always)]
fn far<R: Real, const N: usize>() -> R {
    if const { R::IS_WIDE } {
        lit!(1e30)
    } else if const { N > 2 } {
        lit!(1e12)
    } else {
        lit!(1e9)
    }
}

/// A power of two of which the square times `total` is from 1/4 to 4, for normal numbers up to [`beyond`]; 1 if `total` is
/// there itself, as in nearly all rows: then nothing is computed.
#[inline(always)]
fn per_root<R: Real>(total: R) -> R {
    let one: R = lit!(1.0);
    let is_elsewhere = has_other_total(total);
    let mut root = one;
    if is_elsewhere.any() {
        root = R::select(is_elsewhere, per_root_of_any(total), one);
    }
    root
}

#[inline(always)]
fn has_other_total<R: Real>(total: R) -> R::Mask {
    total.lt(lit!(0.25)) | total.gt(lit!(4.0))
}

/// [`per_root`] of a total that may be far from 1.
#[inline(always)]
fn per_root_of_any<R: Real>(total: R) -> R {
    let (mut root, mut square): (R, R) = (lit!(1.0), total);
    // To where `power_of_two` reaches.
    if const { R::IS_WIDE } {
        raise(
            &mut root,
            &mut square,
            lit!(two_to(270)),
            lit!(two_to(-510)),
        );
        raise(
            &mut root,
            &mut square,
            lit!(two_to(135)),
            lit!(two_to(-240)),
        );
        raise(&mut root, &mut square, lit!(two_to(68)), lit!(two_to(-105)));
        lower(
            &mut root,
            &mut square,
            lit!(two_to(-240)),
            lit!(two_to(480)),
        );
        lower(
            &mut root,
            &mut square,
            lit!(two_to(-120)),
            lit!(two_to(240)),
        );
        lower(&mut root, &mut square, lit!(two_to(-60)), lit!(two_to(120)));
    } else {
        raise(&mut root, &mut square, lit!(two_to(24)), lit!(two_to(-70)));
    }
    lower(&mut root, &mut square, lit!(two_to(-30)), lit!(two_to(60)));
    let root = root / power_of_two(square);
    if const { R::IS_WIDE } {
        root
    } else {
        // Of a total that is subnormal, times a power of a length.
        root.min(lit!(two_to(70)))
    }
}

/// Multiplies `root` by a power of two, and `square` by its square, if that is below `limit`.
#[inline(always)]
fn raise<R: Real>(root: &mut R, square: &mut R, by: R, limit: R) {
    let is_small = square.lt(limit);
    *root = R::select(is_small, *root * by, *root);
    *square = R::select(is_small, *square * by * by, *square);
}

/// Multiplies `root` by a power of two, and `square` by its square, if that is above `limit`.
#[inline(always)]
fn lower<R: Real>(root: &mut R, square: &mut R, by: R, limit: R) {
    let is_large = square.gt(limit);
    *root = R::select(is_large, *root * by, *root);
    *square = R::select(is_large, *square * by * by, *square);
}

/// One step of [`power_of_two`].
#[inline(always)]
fn halve<R: Real>(square: &mut R, unit: &mut R, below: R, squared: R, by: R) {
    let small = square.lt(below);
    *square = R::select(small, *square * squared, *square);
    *unit = R::select(small, *unit * by, *unit);
}

/// A power of two from half the root of `square` to twice that, for squares from 1e-24 to 1e24.
#[function]
#[inline(always)]
pub(crate) fn power_of_two<R: Real>(square: R) -> R {
    let mut square = square;
    let mut unit: R = lit!(1.0);
    let large = square.gt(lit!(1.0));
    square = R::select(large, square * lit!(two_to(-80)), square);
    unit = R::select(large, lit!(two_to(40)), unit);
    halve(
        &mut square,
        &mut unit,
        lit!(two_to(-64)),
        lit!(two_to(64)),
        lit!(two_to(-32)),
    );
    halve(
        &mut square,
        &mut unit,
        lit!(two_to(-32)),
        lit!(two_to(32)),
        lit!(two_to(-16)),
    );
    halve(
        &mut square,
        &mut unit,
        lit!(two_to(-16)),
        lit!(two_to(16)),
        lit!(two_to(-8)),
    );
    halve(
        &mut square,
        &mut unit,
        lit!(two_to(-8)),
        lit!(two_to(8)),
        lit!(two_to(-4)),
    );
    halve(
        &mut square,
        &mut unit,
        lit!(two_to(-4)),
        lit!(two_to(4)),
        lit!(two_to(-2)),
    );
    halve(
        &mut square,
        &mut unit,
        lit!(two_to(-2)),
        lit!(two_to(2)),
        lit!(two_to(-1)),
    );
    unit
}

/// [`power_of_two`] of a mean square depth, of which the power for the last moment is within range,
/// too.
#[inline(always)]
fn depth_unit<R: Real, const N: usize>(mean_square: R) -> R {
    let unit = power_of_two(mean_square.clamp(lit!(1e-37), lit!(1e24)));
    if const { R::IS_WIDE } {
        unit
    } else if const { N == 1 } {
        unit.clamp(lit!(two_to(-50)), lit!(two_to(50)))
    } else if const { N == 2 } {
        unit.clamp(lit!(two_to(-26)), lit!(two_to(26)))
    } else if const { N == 3 } {
        unit.clamp(lit!(two_to(-18)), lit!(two_to(18)))
    } else if const { N == 4 } {
        unit.clamp(lit!(two_to(-13)), lit!(two_to(13)))
    } else if const { N == 6 } {
        unit.clamp(lit!(two_to(-9)), lit!(two_to(9)))
    } else {
        unit.clamp(lit!(two_to(-10)), lit!(two_to(10)))
    }
}

/// Units in which moments and what is computed of them are within the number type's range: powers of two.
struct Units<R> {
    /// [`per_root`] of the total.
    per_root: R,
    /// The unit of length.
    length: R,
    /// Its reciprocal.
    per_length: R,
}

/// Units in which the total is near 1, and depths have a mean square near 1. In twice the digits each row has its unit of
/// length; in plain arithmetic one whose depths have about the size of a shadow map's keeps 1, and nothing is computed.
#[inline(always)]
fn units<R: Real, A: Arithmetic<R>, const N: usize>(total: R, mean_square: R) -> Units<R> {
    let one: R = lit!(1.0);
    let mut units = Units {
        per_root: one,
        length: one,
        per_length: one,
    };
    // Below it, pivots would be less than the least that they are lifted to.
    let least = if const { N > 4 } {
        total * lit!(two_to(-5))
    } else {
        total * lit!(two_to(-8))
    };
    let has_another = mean_square.lt(least) | mean_square.gt(total * lit!(two_to(8)));
    let is_elsewhere = has_another | has_other_total(total);
    if const { A::TWICE } || is_elsewhere.any() {
        let per_root = per_root(total);
        let scaled_total = (total * per_root * per_root).max(lit!(1e-12));
        let near = depth_unit::<R, N>(mean_square * per_root * per_root / scaled_total);
        let length = if const { A::TWICE } {
            near
        } else {
            R::select(has_another, near, one)
        };
        units = Units {
            per_root,
            length,
            per_length: one / length,
        };
    }
    units
}

impl<R: Real, A: Arithmetic<R>> Recurrence<R, A> {
    /// The first N steps for moments `m_0` to `m_2N`, of any value, and query point `eta`.
    ///
    /// What is not a number, or too large, counts as 0: a moment above 1e37, or in the unit of length above 1e25 times
    /// the total (in 64 bits 1e290 and 1e100). A query point farther than 1e12, for N up to 2 in
    /// `f32` 1e9, is moved there.
    ///
    /// Pivots are lifted to the size of their own rounding errors, `floor` times the moment on the
    /// diagonal: `ε/4` for plain arithmetic.
    #[inline(always)]
    pub fn new<const N: usize>(m: [R; MAX_MOMENTS], eta: R, floor: R) -> Self {
        by_chebyshev::<R, A, N>(m, eta, floor)
    }
}

/// [`Recurrence::new`]
#[apart(R, if is_long::<R, A>(N))]
#[inline(always)]
fn by_chebyshev<R: Real, A: Arithmetic<R>, const N: usize>(
    m: [R; MAX_MOMENTS],
    eta: R,
    floor: R,
) -> Recurrence<R, A> {
    let zero: R = lit!(0.0);
    let one: R = lit!(1.0);
    let largest = largest::<R>();
    let far = far::<R, N>();
    let total = finite(m[0], beyond()).max(zero);
    let Units {
        per_root,
        length,
        per_length,
    } = units::<R, A, N>(total, finite(m[2], beyond()));
    // The square of a distance to it has a root that `power_of_two` finds.
    let reach = far.min(lit!(1e12));
    let mut eta = finite(eta, beyond()).clamp(-reach, reach);

    let mut current = [A::of(zero); MAX_MOMENTS];
    let scaled_total = (total * per_root * per_root).max(lit!(1e-12));
    // Far below what rounding leaves of a pivot, and far above what is too small to divide by.
    let least = if const { A::TWICE } {
        scaled_total * lit!(1e-26)
    } else {
        R::epsilon() * (R::epsilon() * (scaled_total * lit!(1e-3)))
    };
    current[0] = A::of(scaled_total);
    // Two factors: each moment times one of them is between what it is and what it becomes, and so within range.
    let (mut odd, mut even) = (per_root, per_root);
    unroll!(k in 1..(2 * N + 1), max 13, {
        if const { k % 2 == 1 } {
            odd *= per_length;
        } else {
            even *= per_length;
        }
        current[k] = A::of(finite(finite(m[k], beyond()) * odd * even, largest));
    });
    if const { A::TWICE } {
        // No distribution has larger ones of these within that range: their products are finite.
        let (most, most_square): (R, R) = if const { R::IS_WIDE } {
            (far, largest)
        } else if const { N == 1 } {
            (lit!(1e17), largest)
        } else {
            (lit!(1e12), lit!(1e17))
        };
        current[1] = A::of(finite(current[1].rounded(), most));
        current[2] = A::of(finite(current[2].rounded(), most_square));
    }
    eta = (eta * per_length).clamp(-reach, reach);
    let moved = eta * length;
    let query = A::of(eta);
    let raw = current;
    let mut previous = current;

    let mut slope = current[1].over(current[0]);
    let mut alpha = slope.within(-far, far);
    // With `scaled`, entries of the first row and all that follow are `m_0` times what they are
    // otherwise: without a quotient, they are all but exact.
    let mut beta = A::of(zero);
    let mut square = scaled_total;
    let mut unit = scaled_total;
    let mut limit = far;
    let mut a = [A::of(zero); MAX];
    let mut b = [A::of(zero); MAX + 1];
    a[0] = if const { A::TWICE } {
        let difference = A::difference(current[1].rounded(), one, eta, scaled_total);
        difference.over(current[0]).within(-far - far, far + far)
    } else {
        alpha.minus(query)
    };
    unroll!(k in 1..(N + 1), max 7, loop if is_long::<R, A>(N), {
        let mut next = current;
        unroll!(l in 1..(2 * MAX), max 13, loop if is_long::<R, A>(N), {
            let at = l as u32;
            if A::TWICE && k == 1 && l < 2 * N {
                let of_this = array_element(&raw, at).rounded();
                let of_next = array_element(&raw, at + 1).rounded();
                let t = A::difference(scaled_total, of_next, raw[1].rounded(), of_this);
                *array_element_mut(&mut next, at) = t.within(-largest, largest);
            } else if l >= k && l + k <= 2 * N {
                let of_this = alpha.times(array_element(&current, at));
                let mut t = array_element(&current, at + 1).minus(of_this);
                if k > 1 {
                    t = t.minus(beta.times(array_element(&previous, at)));
                }
                *array_element_mut(&mut next, at) = t.within(-largest, largest);
            }
        });
        if k == 2 {
            // As the Cholesky factorisation has it: where a bias is all that is left of the
            // pivot, this keeps more of it.
            let t = if const { A::TWICE } {
                let square = raw[2].rounded();
                A::difference(scaled_total, raw[4].rounded(), square, square)
            } else {
                let mean_square = raw[2].over(raw[0]);
                raw[4].minus(mean_square.times(raw[2]))
            };
            let of_slope = if const { A::TWICE } {
                let most: R = if const { R::IS_WIDE } { lit!(1e250) } else { lit!(1e37) };
                slope.times_within(current[2], most)
            } else {
                slope.times(current[2])
            };
            let t = t.minus(of_slope);
            next[2] = t.within(-largest, largest);
        }
        let at = k as u32;
        let noise = array_element(&raw, 2 * at).rounded().abs() * floor;
        let pivot = array_element(&next, at).at_least(noise.max(least));
        *array_element_mut(&mut next, at) = pivot;
        // A square of lengths. The last one multiplies nothing of this.
        let most_beta = if const { R::IS_WIDE } {
            far * far
        } else if A::TWICE && k == N {
            largest
        } else if A::TWICE || k == N {
            lit!(1e12)
        } else {
            far
        };
        beta = pivot
            .over(array_element(&current, at - 1))
            .within(zero, most_beta);
        *array_element_mut(&mut b, at) = if A::TWICE && k == 1 {
            beta.over(current[0]).within(zero, most_beta)
        } else {
            beta
        };
        if k == 1 {
            square = b[1].rounded() + a[0].rounded() * a[0].rounded();
            unit = if const { A::TWICE } {
                power_of_two(square)
            } else {
                square.sqrt()
            };
            limit = (unit * farthest::<R, A, N>()).min(far);
        }
        if k < N {
            let below = array_element(&next, at + 1).over(pivot);
            alpha = below.minus(slope).within(eta - limit, eta + limit);
            slope = below;
            *array_element_mut(&mut a, at) = alpha.minus(query);
        }
        previous = current;
        current = next;
    });

    let (mean, variance) = (a[0].rounded(), b[1].rounded());
    let spread = variance / square;
    // The complement where that rounds less.
    let rest = R::select(spread.lt(lit!(0.5)), one - spread, mean * mean / square);
    let most = farthest::<R, A, N>() * farthest::<R, A, N>();
    let mut per_unit = one;
    if const { A::TWICE || N > 2 } {
        per_unit = one / unit;
        let per_square = per_unit * per_unit;
        unroll!(k in 0..N, max 7, {
            a[k] = a[k].scaled(per_unit);
            b[k + 1] = b[k + 1].scaled(per_square).within(zero, most);
        });
        square *= per_square;
    }
    per_unit *= per_length;
    Recurrence {
        a,
        b,
        square,
        spread,
        rest,
        per_unit,
        total,
        query: moved,
    }
}
