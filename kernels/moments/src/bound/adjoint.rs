//! Derivatives of the bounds.
//!
//! The bound is the optimum of a linear programme, and what multiplies the moments in the dual is
//! its gradient: the coefficients of the polynomial `q` of degree 2N that touches the step from 1
//! to 0 at the query point from below (S. Karlin, W. Studden, *Tchebycheff Systems*, 1966, chapter
//! III). It is 1 at the roots below, 0 at those above and at the query point, and stationary at all
//! roots. The step moves with the query point, so the derivative to that is minus its weight times
//! `q'`. The query point's own weight has the gradient `(K(u) / K(0))²`.
//!
//! This is the adjoint of the algorithm, \[MBD\] Eq. 22 to 30, without going through it: no
//! derivative of a root, none of a weight, and nothing that is singular where a root is at infinity
//! (Theorem 14 there).

use hankel_dsl::{Mask, Real, apart, array_element, array_element_mut, lit, unroll};

use super::kernel::{Kernel, fine};
use super::recurrence::{Recurrence, beyond, finite, power_of_two};
use super::roots::{least_of_cubic, least_of_quadratic, least_three, least_two, whole};
use super::twofold::{Arithmetic, Plain, Twofold};
use super::{MAX, MAX_MOMENTS, is_long};

/// The derivative of something that depends on a bound.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gradient<R> {
    /// To the moments `m_0` to `m_2N`; the rest is 0.
    pub m: [R; MAX_MOMENTS],
    /// To the query point.
    pub eta: R,
}

/// The adjoint of [`bound`](super::bound) and [`blend`](super::Bounds::blend): the derivatives of the blend to
/// moments and query point, times the upstream gradient `d_bound`.
///
/// Takes anything that [`bound`](super::bound) takes. A derivative is limited to 1e25, in 64 bits to 1e100, times
/// `d_bound`, which is limited to 1e12, and the derivative to the query point, which is in proportion to the total,
/// to 1e37, in 64 bits to 1e290.
#[inline(always)]
pub fn bound_adjoint<R: Real, const N: usize>(
    m: [R; MAX_MOMENTS],
    eta: R,
    overestimation: R,
    d_bound: R,
) -> Gradient<R> {
    let floor = R::epsilon() * lit!(0.25);
    adjoint::<R, Plain<R>, N>(m, eta, overestimation, d_bound, floor)
}

/// [`bound_adjoint`] of [`bound_compensated`](super::bound_compensated), in about twice the digits throughout.
///
/// No derivative has an error of more than four times what rounding each argument and the result once does to it.
/// That is measured, not proved, in `f32` and `f64`, for rows of the families that
/// [`bound_compensated`](super::bound_compensated) is measured on; a derivative that is less than the number
/// type's epsilon times the greatest of its row counts as that, for N = 6 one below 1e-12 as 1e-12. One beyond the
/// limit of [`bound_adjoint`] is that limit.
#[inline(always)]
pub fn bound_adjoint_compensated<R: Real, const N: usize>(
    m: [R; MAX_MOMENTS],
    eta: R,
    overestimation: R,
    d_bound: R,
) -> Gradient<R> {
    let floor = R::epsilon() * (R::epsilon() * R::epsilon());
    adjoint::<R, Twofold<R>, N>(m, eta, overestimation, d_bound, floor)
}

/// The adjoint of [`mix_bias`](super::mix_bias): takes the gradient with respect to the mixed moments, and returns that
/// with respect to the given ones.
#[inline(always)]
pub fn mix_bias_adjoint<R: Real, const N: usize>(
    mut d: [R; MAX_MOMENTS],
    target: [R; MAX_MOMENTS],
    strength: R,
) -> [R; MAX_MOMENTS] {
    let strength = strength.saturate();
    let one: R = lit!(1.0);
    unroll!(k in 1..(2 * N + 1), max 13, {
        d[0] += strength * (target[k] * d[k]);
        d[k] = (one - strength) * d[k];
    });
    d
}

#[inline(always)]
fn adjoint<R: Real, A: Arithmetic<R>, const N: usize>(
    m: [R; MAX_MOMENTS],
    eta: R,
    overestimation: R,
    d_bound: R,
    floor: R,
) -> Gradient<R> {
    let zero: R = lit!(0.0);
    let one: R = lit!(1.0);
    let recurrence = Recurrence::<R, A>::new::<N>(m, eta, floor);
    let kernel = Kernel::<R, A>::new::<N>(&recurrence);
    // The unit of u: in twice the digits a power of two, so that going back to lengths rounds nothing.
    let reach = if const { A::TWICE } {
        let square = kernel.reach * kernel.reach;
        power_of_two(square.clamp(lit!(1e-24), lit!(1e24)))
    } else {
        kernel.reach
    };
    let (e, own_weight) = if const { A::TWICE } {
        fine::<R, A, N>(&kernel, reach)
    } else {
        let mut e = [A::of(one); MAX + 1];
        unroll!(i in 1..(N + 1), max 7, {
            e[i] = A::of(kernel.e[i]);
        });
        (e, A::of(kernel.own))
    };

    // All in powers of u times the reach. (K(u) / K(0)) is Σ e_i u^i.
    let per_reach = if const { A::TWICE } {
        kernel.reach / reach
    } else {
        one
    };
    let (rest, factor) = minor::<R, A, N>(&kernel, &e, per_reach);
    let blend = overestimation.saturate();
    let own_share = R::select(kernel.turned, blend - one, blend);
    let minor_share = R::select(kernel.turned, -one, one);
    let minor_share = R::select(kernel.few.gt(zero), minor_share, zero);
    let sign = R::select(kernel.turned, -one, one);
    let per_length = sign * (reach * recurrence.per_unit);
    let limit = limit::<R>();
    let present = recurrence.total.gt(zero);
    let upstream = R::select(present, finite(d_bound, lit!(1e12)), zero);
    let query = recurrence.query;
    let (mut q, slope);
    if const { A::TWICE } {
        let of_own = e[1].scaled(lit!(2.0)).times_plain(own_share);
        let of_minor = factor[1].times_plain(minor_share);
        slope = of_own.plus(of_minor).scaled(per_length);
        // Each factor in powers of x before they are multiplied: for a query point far from all others, the move
        // cancels, and of a square twice as many digits.
        let root_limit: R = if const { R::IS_WIDE } {
            lit!(1e100)
        } else {
            lit!(1e18)
        };
        let e = moved::<R, A, N>(&e, per_length, query, root_limit);
        let rest = moved::<R, A, N>(&rest, per_length, query, root_limit);
        let factor = match const { N / 2 } {
            0 => factor,
            1 => moved::<R, A, 2>(&factor, per_length, query, limit),
            2 => moved::<R, A, 4>(&factor, per_length, query, limit),
            _ => moved::<R, A, 6>(&factor, per_length, query, limit),
        };
        q = blended::<R, A, N>(&e, own_share, &rest, &factor, minor_share);
        q[0] = A::select(kernel.turned, A::of(one).plus(q[0]), q[0]);
    } else {
        q = blended::<R, A, N>(&e, own_share, &rest, &factor, minor_share);
        q[0] = A::select(kernel.turned, A::of(one).plus(q[0]), q[0]);

        // In powers of x - eta.
        let per_length = A::of(per_length);
        let most_power: R = if const { R::IS_WIDE } {
            lit!(1e200)
        } else {
            lit!(1e37)
        };
        let mut power = per_length;
        unroll!(i in 1..(2 * N + 1), max 13, {
            q[i] = q[i].times_within(power, limit);
            power = power.times_within(per_length, most_power);
        });
        slope = q[1];

        // In powers of x: Horner's scheme, repeated.
        unroll!(j in 0..(2 * N), max 13, {
            unroll!(i in 0..(2 * N), max 13, {
                // Each time one coefficient less: from the highest but one down to j.
                if const { i + j < 2 * N } {
                    let carried = q[2 * N - i].times_plain(query);
                    q[2 * N - 1 - i] = q[2 * N - 1 - i].minus(carried).within(-limit, limit);
                }
            });
        });
    }
    // The total is the last factor: it may be large where the others are small.
    let d_eta = own_weight.times(slope).rounded().clamp(-limit, limit) * -upstream;
    let d_eta = times_total(d_eta, recurrence.total);
    let mut m = [zero; MAX_MOMENTS];
    unroll!(i in 0..(2 * N + 1), max 13, {
        m[i] = q[i].rounded() * upstream;
    });
    Gradient { m, eta: d_eta }
}

/// The product with a total, whose magnitude is limited to [`beyond`], and never infinite on its way.
#[inline(always)]
fn times_total<R: Real>(x: R, total: R) -> R {
    let one: R = lit!(1.0);
    let most = beyond::<R>();
    let mut factor = total;
    // Natively, a total of up to 1 needs no quotient: `x` is at most `most`.
    if const { cfg!(target_arch = "spirv") } || total.gt(one).any() {
        factor = total.min(most / x.abs().max(one));
    }
    x * factor
}

/// The largest magnitude of a derivative.
#[inline(always)]
fn limit<R: Real>() -> R {
    if const { R::IS_WIDE } {
        lit!(1e100)
    } else {
        lit!(1e25)
    }
}

/// A polynomial in `(x - at) per_length`, a power of two, in powers of `x`: Horner's scheme, repeated.
#[apart(R, if DEGREE > 1)]
#[inline(always)]
fn moved<R: Real, A: Arithmetic<R>, const DEGREE: usize>(
    p: &Fine<A>,
    per_length: R,
    at: R,
    limit: R,
) -> Fine<A> {
    let mut p = *p;
    // In powers of `x per_length` first: there, coefficients are within range even if `at` is far.
    let at = at * per_length;
    unroll!(j in 0..DEGREE, max 7, loop if DEGREE > 3, {
        unroll!(i in 0..DEGREE, max 7, loop if DEGREE > 3, {
            // Each time one coefficient less: from the highest but one down to j.
            if i + j < DEGREE {
                let higher = (DEGREE - i) as u32;
                let carried = array_element(&p, higher).times_plain(at);
                let lower = array_element(&p, higher - 1).minus(carried).within(-limit, limit);
                *array_element_mut(&mut p, higher - 1) = lower;
            }
        });
    });
    // Not by powers of the length, which may be beyond range where the products are not.
    unroll!(j in 1..(DEGREE + 1), max 7, loop if DEGREE > 3, {
        unroll!(i in 1..(DEGREE + 1), max 7, loop if DEGREE > 3, {
            if i >= j {
                let scaled = array_element(&p, i as u32).scaled(per_length);
                *array_element_mut(&mut p, i as u32) = scaled;
            }
        });
        let limited = array_element(&p, j as u32).within(-limit, limit);
        *array_element_mut(&mut p, j as u32) = limited;
    });
    p
}

/// `own_share e² + minor_share rest² factor`
#[apart(R, if is_long::<R, A>(N))]
#[inline(always)]
fn blended<R: Real, A: Arithmetic<R>, const N: usize>(
    e: &Fine<A>,
    own_share: R,
    rest: &Fine<A>,
    factor: &Fine<A>,
    minor_share: R,
) -> [A; MAX_MOMENTS] {
    let limit = limit::<R>();
    let own = squared::<R, A, N>(e);
    let mut minor = [A::of(lit!(0.0)); MAX_MOMENTS];
    if const { N > 1 } {
        // At least one root is divided out.
        let square = match const { N } {
            2 => squared::<R, A, 1>(rest),
            3 => squared::<R, A, 2>(rest),
            4 => squared::<R, A, 3>(rest),
            5 => squared::<R, A, 4>(rest),
            _ => squared::<R, A, 5>(rest),
        };
        if const { A::TWICE } {
            minor = product_within::<R, A, N>(factor, &square, limit);
        } else {
            // In powers of the distance to the query point, the factor has no constant.
            unroll!(i in 1..(MAX + 1), max 7, {
                unroll!(j in 0..(2 * MAX), max 13, {
                    if const { i <= N / 2 * 2 && j <= 2 * less(N, 1) && i + j <= 2 * N } {
                        let product = factor[i].times(square[j]);
                        // The first of its power, or one more.
                        if const { i == 1 || j == 2 * less(N, 1) } {
                            minor[i + j] = product;
                        } else {
                            minor[i + j] = minor[i + j].plus(product);
                        }
                    }
                });
            });
        }
    }
    let mut q = [A::of(lit!(0.0)); MAX_MOMENTS];
    unroll!(i in 0..(2 * N + 1), max 13, {
        let of_own = if const { A::TWICE } {
            own[i].within(-limit, limit)
        } else {
            own[i]
        };
        q[i] = of_own.times_plain(own_share).plus(minor[i].times_plain(minor_share));
    });
    q
}

/// The product of a polynomial of degree 2 (N / 2) and one of degree 2N - 2, without what is beyond degree 2N, by
/// [`Arithmetic::times_within`].
#[apart(R, if is_long::<R, A>(N))]
#[inline(always)]
fn product_within<R: Real, A: Arithmetic<R>, const N: usize>(
    factor: &Fine<A>,
    square: &[A; MAX_MOMENTS],
    limit: R,
) -> [A; MAX_MOMENTS] {
    let mut product = [A::of(lit!(0.0)); MAX_MOMENTS];
    unroll!(i in 0..(N / 2 * 2 + 1), max 7, loop if is_long::<R, A>(N), {
        unroll!(j in 0..(2 * less(N, 1) + 1), max 13, loop if is_long::<R, A>(N), {
            if i + j <= 2 * N {
                let by = array_element(factor, i as u32);
                let term = product_term::<R, A, N>(by, array_element(square, j as u32), limit);
                let sum = array_element_mut(&mut product, (i + j) as u32);
                // The first of its power, or one more.
                *sum = if i == 0 || j == 2 * less(N, 1) {
                    term
                } else {
                    sum.plus(term)
                };
            }
        });
    });
    product
}

/// [`Arithmetic::times_within`], of which there are up to seventy in a row.
#[apart(R, if is_long::<R, A>(N))]
#[inline(always)]
fn product_term<R: Real, A: Arithmetic<R>, const N: usize>(a: A, b: A, limit: R) -> A {
    a.times_within(b, limit)
}

/// Coefficients of a monic polynomial, highest power first.
type Fine<A> = [A; MAX + 1];

/// The square of a polynomial, of which the coefficients up to DEGREE count.
#[apart(R, if is_long::<R, A>(DEGREE))]
#[inline(always)]
fn squared<R: Real, A: Arithmetic<R>, const DEGREE: usize>(p: &Fine<A>) -> [A; MAX_MOMENTS] {
    let two: R = lit!(2.0);
    let mut square = [A::of(lit!(0.0)); MAX_MOMENTS];
    unroll!(i in 0..(DEGREE + 1), max 7, loop if is_long::<R, A>(DEGREE), {
        let own = array_element(p, i as u32);
        *array_element_mut(&mut square, 2 * i as u32) = own.times(own);
        if i < DEGREE {
            let next = own.scaled(two).times(array_element(p, i as u32 + 1));
            *array_element_mut(&mut square, 2 * i as u32 + 1) = next;
        }
    });
    unroll!(i in 0..(DEGREE + 1), max 7, loop if is_long::<R, A>(DEGREE), {
        unroll!(j in 0..(DEGREE + 1), max 7, loop if is_long::<R, A>(DEGREE), {
            if j > i + 1 {
                let twice = array_element(p, i as u32).scaled(two);
                let product = twice.times(array_element(p, j as u32));
                let sum = array_element_mut(&mut square, (i + j) as u32);
                *sum = sum.plus(product);
            }
        });
    });
    square
}

/// The polynomial that is 1 at the negative roots, 0 at the others and at 0, and stationary at all
/// roots: it is the first result's square times the second.
#[inline(always)]
fn minor<R: Real, A: Arithmetic<R>, const N: usize>(
    kernel: &Kernel<R, A>,
    e: &Fine<A>,
    per_reach: R,
) -> (Fine<A>, Fine<A>) {
    let zero: R = lit!(0.0);
    let one: R = lit!(1.0);
    if const { N == 1 } {
        return (*e, [A::of(zero); MAX + 1]);
    }
    let (first, second, third) = if const { N == 2 } {
        (least_of_quadratic(&kernel.e), zero, zero)
    } else if const { N == 3 } {
        (least_of_cubic(&kernel.e), zero, zero)
    } else if const { N == 4 } {
        let (first, second) = least_two::<R, 4, 3>(&kernel.e);
        (first, second, zero)
    } else if const { N == 5 } {
        let (first, second) = least_two::<R, 5, 4>(&kernel.e);
        (first, second, zero)
    } else {
        least_three(&kernel.e)
    };
    let first = exact_root::<R, A, N>(e, first, per_reach);
    let rest = deflated::<R, A, N>(e, first);
    let single = single::<R, A, N>(&rest, first);
    if const { N < 4 } {
        (rest, single)
    } else {
        let of_single = (&rest, &single);
        let second = exact_root::<R, A, N>(e, second, per_reach);
        let rest = if const { N == 4 } {
            deflated::<R, A, 3>(&rest, second)
        } else if const { N == 5 } {
            deflated::<R, A, 4>(&rest, second)
        } else {
            deflated::<R, A, 5>(&rest, second)
        };
        let double = double::<R, A, N>(&rest, first, second);
        let is_double = kernel.few.gt(one);
        let rest_of_two = selected::<R, A, N>(is_double, &rest, of_single.0);
        let factor_of_two = selected::<R, A, N>(is_double, &double, of_single.1);
        if const { N < 6 } {
            (rest_of_two, factor_of_two)
        } else {
            let third = exact_root::<R, A, N>(e, third, per_reach);
            let rest = deflated::<R, A, 4>(&rest, third);
            let triple = triple::<R, A, N>(&rest, first, second, third);
            let is_triple = kernel.few.gt(lit!(2.0));
            (
                selected::<R, A, N>(is_triple, &rest, &rest_of_two),
                selected::<R, A, N>(is_triple, &triple, &factor_of_two),
            )
        }
    }
}

/// `a` where `mask` holds, else `b`.
#[inline(always)]
fn selected<R: Real, A: Arithmetic<R>, const N: usize>(
    mask: R::Mask,
    a: &Fine<A>,
    b: &Fine<A>,
) -> Fine<A> {
    let mut either = *b;
    unroll!(i in 0..(N + 1), max 7, {
        either[i] = A::select(mask, a[i], b[i]);
    });
    either
}

/// How often a root is improved: each time its error is cubed, until it is that of the coefficients.
const REFINEMENTS: usize = 3;

/// The negative root of the polynomial next to `v`, with all digits that the coefficients have; 0 stays. In twice the
/// digits `per_reach` takes `v` to the polynomial's unit.
#[apart(R, if A::TWICE)]
#[inline(always)]
fn exact_root<R: Real, A: Arithmetic<R>, const N: usize>(e: &Fine<A>, v: R, per_reach: R) -> A {
    let zero: R = lit!(0.0);
    let mut root = A::of(v);
    if const { A::TWICE } {
        let v = v * per_reach;
        root = A::of(v);
        let quarter: R = lit!(0.25);
        let least: R = lit!(1e-37);
        unroll!(_step in 0..REFINEMENTS, max 7, loop if is_long::<R, A>(N), {
            let mut p = e[0];
            let mut d = A::of(zero);
            let mut h = zero;
            unroll!(i in 1..(N + 1), max 7, loop if is_long::<R, A>(N), {
                h = h * v + d.rounded();
                d = d.times(root).plus(p);
                p = p.times(root).plus(array_element(e, i as u32));
            });
            // The nearer root of the parabola that touches it: right to third order.
            let (value, slope) = (p.rounded(), d.rounded());
            let disk = (slope * slope - value * h * lit!(4.0)).max(zero).sqrt();
            let step = (value + value) / (slope.abs() + disk).max(least);
            let w = v.abs() * quarter;
            let step = R::select(slope.lt(zero), step, -step).clamp(-w, w);
            root = root.plus(A::of(step));
        });
    }
    root
}

/// The polynomial of degree DEGREE without the root: coefficients that are left over are 0.
///
/// Division from the highest power down loses the digits of small coefficients where the root is one of the largest,
/// division from the lowest power up those of large ones where it is one of the smallest. In twice the digits each
/// coefficient is taken from the division with the lesser rounding error (G. Peters, J. Wilkinson, *Practical
/// Problems Arising in the Solution of Polynomial Equations*, 1971, section 4).
#[apart(R, if A::TWICE)]
#[inline(always)]
fn deflated<R: Real, A: Arithmetic<R>, const DEGREE: usize>(e: &Fine<A>, v: A) -> Fine<A> {
    let zero: R = lit!(0.0);
    let one: R = lit!(1.0);
    let mut rest = *e;
    unroll!(i in 1..DEGREE, max 7, loop if is_long::<R, A>(DEGREE), {
        let carried = v.times(array_element(&rest, i as u32 - 1));
        let lower = array_element(e, i as u32).plus(carried);
        *array_element_mut(&mut rest, i as u32) = lower;
    });
    if const { A::TWICE } {
        let size = v.rounded().abs();
        let per_root = v.inverse();
        let per_size = per_root.rounded().abs();
        let mut down = [one; MAX + 1];
        unroll!(i in 1..DEGREE, max 7, loop if is_long::<R, A>(DEGREE), {
            let carried = size * array_element(&down, i as u32 - 1);
            let most = array_element(e, i as u32).rounded().abs().max(carried);
            *array_element_mut(&mut down, i as u32) = most;
        });
        let mut from_below = A::of(zero);
        let mut up = zero;
        unroll!(j in 1..DEGREE, max 7, loop if is_long::<R, A>(DEGREE), {
            let i = (DEGREE - j) as u32;
            let higher = array_element(e, i + 1);
            from_below = from_below.minus(higher).times(per_root);
            up = up.max(higher.rounded().abs()) * per_size;
            let is_nearer = up.lt(array_element(&down, i));
            let nearer = A::select(is_nearer, from_below, array_element(&rest, i));
            *array_element_mut(&mut rest, i) = nearer;
        });
    }
    unroll!(i in 0..(MAX + 1), max 7, {
        if const { i >= DEGREE } {
            rest[i] = A::of(zero);
        }
    });
    rest
}

/// The quotient of a polynomial by `v - at`, and the remainder at index `degree`; what is beyond
/// has no meaning.
#[inline(always)]
fn divided<R: Real, A: Arithmetic<R>, const N: usize>(
    e: &Fine<A>,
    at: A,
    degree: usize,
) -> Fine<A> {
    let mut quotient = *e;
    // Natively, what is not used of it is not computed.
    let last = if const { cfg!(target_arch = "spirv") } {
        degree
    } else {
        MAX
    };
    unroll!(i in 1..(MAX + 1), max 7, loop if is_long::<R, A>(N), {
        if i <= last {
            let carried = at.times(array_element(&quotient, i as u32 - 1));
            let lower = array_element(e, i as u32).plus(carried);
            *array_element_mut(&mut quotient, i as u32) = lower;
        }
    });
    quotient
}

/// `n - by`, also where an instance that is never run asks for less than 0.
const fn less(n: usize, by: usize) -> usize {
    n.saturating_sub(by)
}

/// The factor that makes `rest(u)²` 1 and stationary at the root, by powers of `u`: `u` times a straight line; `rest`
/// has degree N - 1.
#[apart(R, if is_long::<R, A>(N))]
#[inline(always)]
fn single<R: Real, A: Arithmetic<R>, const N: usize>(rest: &Fine<A>, v: A) -> Fine<A> {
    let one: R = lit!(1.0);
    let zero: R = lit!(0.0);
    let quotient = divided::<R, A, N>(rest, v, less(N, 1));
    let value = quotient[const { less(N, 1) }];
    let slope = divided::<R, A, N>(&quotient, v, less(N, 2))[const { less(N, 2) }];
    let per_value = value.inverse();
    let mut power = A::of(one);
    unroll!(_k in 1..N, max 7, loop if is_long::<R, A>(N), {
        power = power.times(v);
    });
    // 1 / rest at the root: all its roots are on the other side, so it is between 0 and 1.
    let share = power.times(per_value).within(zero, one);
    let at_root = v.times(share.times(share));
    let twice = v.times(slope.times(per_value)).scaled(lit!(2.0));
    let tilt = twice.minus(A::of(whole!(R, 2 * N - 1)));
    let constant = at_root.times(A::of(one).minus(tilt));
    let linear = at_root.times(v.times(tilt));
    let mut factor = [A::of(zero); MAX + 1];
    factor[1] = constant;
    factor[2] = linear;
    factor
}

/// `a per`, moved between `-limit` and `limit`.
#[inline(always)]
fn limited<R: Real, A: Arithmetic<R>>(a: A, per: A, limit: R) -> A {
    a.times(per).within(-limit, limit)
}

/// [`single`] for two roots, of which `rest`, of degree N - 2, has none: `u` times a cubic.
///
/// In the reciprocal, the cubic meets `s(v)² = (v^N / rest(v))²` doubly at both roots. With the
/// straight line `l` that meets `s`, it is `l² + (v - v_1)(v - v_2) t`, where the straight line `t`
/// meets `2 l` times the second divided difference of `s`. Divided differences of a quotient of
/// polynomials follow from theirs by Leibniz' rule, without cancellation where both roots meet.
#[apart(R, if is_long::<R, A>(N))]
#[inline(always)]
fn double<R: Real, A: Arithmetic<R>, const N: usize>(rest: &Fine<A>, v1: A, v2: A) -> Fine<A> {
    let zero = A::of(lit!(0.0));
    let one = A::of(lit!(1.0));
    let two: R = lit!(2.0);
    // Divided differences of rest, named by their arguments.
    let by_1 = divided::<R, A, N>(rest, v1, less(N, 2));
    let by_2 = divided::<R, A, N>(rest, v2, less(N, 2));
    let by_11 = divided::<R, A, N>(&by_1, v1, less(N, 3));
    let by_12 = divided::<R, A, N>(&by_1, v2, less(N, 3));
    let r1 = by_1[const { less(N, 2) }];
    let r2 = by_2[const { less(N, 2) }];
    let r11 = by_11[const { less(N, 3) }];
    let r12 = by_12[const { less(N, 3) }];
    let r22 = divided::<R, A, N>(&by_2, v2, less(N, 3))[const { less(N, 3) }];
    let by_112 = divided::<R, A, N>(&by_11, v2, less(N, 4));
    let r112 = by_112[const { less(N, 4) }];
    let r122 = divided::<R, A, N>(&by_12, v2, less(N, 4))[const { less(N, 4) }];
    let r1122 = if const { N == 6 } {
        divided::<R, A, N>(&by_112, v2, 1)[1]
    } else if const { N == 5 } {
        one
    } else {
        zero
    };
    // Divided differences of v^N: complete homogeneous polynomials.
    let (mut p2, mut p12, mut p22, mut p112, mut p122, mut p1122) =
        (one, zero, zero, zero, zero, zero);
    let mut p1 = one;
    unroll!(_k in 0..N, max 7, loop if is_long::<R, A>(N), {
        p1122 = v2.times(p1122).plus(p112);
        p122 = v2.times(p122).plus(p12);
        p112 = v1.times(p112).plus(p12);
        p22 = v2.times(p22).plus(p2);
        p12 = v2.times(p12).plus(p1);
        p1 = v1.times(p1);
        p2 = v2.times(p2);
    });
    let (per_r1, per_r2) = (r1.inverse(), r2.inverse());
    // And of the quotient, which is x² times factors x / (x + w), x being -v and w the other roots. The k-th derivative
    // over k! is at most x^(2 - k) times Σ binomial(2, j) binomial(k - j + 3, 3), j from 0 to 2, for four such factors:
    // 1, 6, 19, 44. Divided differences are its means over all weighted averages of their points (Hermite and Genocchi).
    // There x is at least the first root's x times that root's weight, of which the mean reciprocal is 3 for two of
    // four points.
    let (x1, x2) = (v1.rounded().abs(), v2.rounded().abs());
    let nearest: R = lit!(1e-30);
    let s1 = limited(p1, per_r1, x1 * lit!(2.0) * x1);
    let s2 = limited(p2, per_r2, x2 * lit!(2.0) * x2);
    let s12 = limited(p12.minus(r12.times(s2)), per_r1, x1 * lit!(6.0));
    let s22 = limited(p22.minus(r22.times(s2)), per_r2, x2 * lit!(6.0));
    let s112 = limited(
        p112.minus(r11.times(s12)).minus(r112.times(s2)),
        per_r1,
        lit!(19.0),
    );
    let s122 = limited(
        p122.minus(r12.times(s22)).minus(r122.times(s2)),
        per_r1,
        lit!(19.0),
    );
    let s1122 = limited(
        p1122
            .minus(r11.times(s122))
            .minus(r112.times(s22))
            .minus(r1122.times(s2)),
        per_r1,
        R::literal::<{ 132.0_f64.to_bits() }>() / x1.max(nearest),
    );
    // l = s1 + s12 (v - v1), t = t0 + t1 (v - v1).
    let t0 = s1.times(s112).scaled(two);
    let t1 = s1.times(s1122).plus(s12.times(s122)).scaled(two);
    let l0 = s1.minus(s12.times(v1));
    let t0 = t0.minus(t1.times(v1));
    let (sum, product) = (v1.plus(v2), v1.times(v2));
    [
        // Coefficients of u^1 to u^4: of the cubic, those of v^3 to v^0.
        zero,
        t1,
        s12.times(s12).plus(t0).minus(t1.times(sum)),
        l0.times(s12)
            .scaled(two)
            .minus(t0.times(sum))
            .plus(t1.times(product)),
        l0.times(l0).plus(t0.times(product)),
        zero,
        zero,
    ]
}

/// `at + (v - v3) (slope + (v - v2) bend)` by powers of v.
#[inline(always)]
fn parabola<R: Real, A: Arithmetic<R>>(v2: A, v3: A, at: A, slope: A, bend: A) -> [A; 3] {
    let linear = slope.minus(bend.times(v2));
    [
        at.minus(v3.times(linear)),
        linear.minus(bend.times(v3)),
        bend,
    ]
}

/// [`single`] for three roots, of which `rest`, of degree N - 3, has none: `u` times a polynomial of degree 5.
///
/// In the reciprocal it is `l² + (v - v_1)(v - v_2)(v - v_3) t`, where the parabola `l` meets `s` and the
/// parabola `t` meets `2 l` times the third divided difference of `s`.
#[apart(R, if is_long::<R, A>(N))]
#[inline(always)]
fn triple<R: Real, A: Arithmetic<R>, const N: usize>(
    rest: &Fine<A>,
    v1: A,
    v2: A,
    v3: A,
) -> Fine<A> {
    let zero = A::of(lit!(0.0));
    let one = A::of(lit!(1.0));
    let two: R = lit!(2.0);
    // Divided differences of rest, named by their arguments; with four it is 1, with more 0.
    let by_1 = divided::<R, A, N>(rest, v1, less(N, 3));
    let by_2 = divided::<R, A, N>(rest, v2, less(N, 3));
    let by_3 = divided::<R, A, N>(rest, v3, less(N, 3));
    let by_12 = divided::<R, A, N>(&by_1, v2, less(N, 4));
    let r1 = by_1[const { less(N, 3) }];
    let r2 = by_2[const { less(N, 3) }];
    let r3 = by_3[const { less(N, 3) }];
    let r11 = divided::<R, A, N>(&by_1, v1, less(N, 4))[const { less(N, 4) }];
    let r12 = by_12[const { less(N, 4) }];
    let r13 = divided::<R, A, N>(&by_1, v3, less(N, 4))[const { less(N, 4) }];
    let r23 = divided::<R, A, N>(&by_2, v3, less(N, 4))[const { less(N, 4) }];
    let r112 = divided::<R, A, N>(&by_12, v1, less(N, 5))[const { less(N, 5) }];
    let r122 = divided::<R, A, N>(&by_12, v2, less(N, 5))[const { less(N, 5) }];
    let r123 = divided::<R, A, N>(&by_12, v3, less(N, 5))[const { less(N, 5) }];
    // Divided differences of v^N: complete homogeneous polynomials.
    let mut p3 = one;
    let (mut p23, mut p123, mut p1123, mut p1223, mut p1233) = (zero, zero, zero, zero, zero);
    let (mut p11223, mut p12233, mut p112233) = (zero, zero, zero);
    unroll!(_k in 0..N, max 7, loop if is_long::<R, A>(N), {
        p112233 = v1.times(p112233).plus(p12233);
        p12233 = v2.times(p12233).plus(p1233);
        p11223 = v1.times(p11223).plus(p1223);
        p1233 = v3.times(p1233).plus(p123);
        p1223 = v2.times(p1223).plus(p123);
        p1123 = v1.times(p1123).plus(p123);
        p123 = v1.times(p123).plus(p23);
        p23 = v2.times(p23).plus(p3);
        p3 = v3.times(p3);
    });
    let (per_r1, per_r2, per_r3) = (r1.inverse(), r2.inverse(), r3.inverse());
    // And of the quotient, with limits as in `double`: x³ times three factors x / (x + w). Derivatives over k! are at most
    // 1, 6, 18, 38, 66 and 102 times x^(3 - k). The weight of the points at the first two roots has a mean reciprocal of
    // 4/3 (four points of five) and 2 (three of five), and a mean square reciprocal of 10/3 (four of six).
    let (x1, x2, x3) = (v1.rounded().abs(), v2.rounded().abs(), v3.rounded().abs());
    let third: R = lit!(38.0);
    let per_x2 = one.rounded() / x2.max(lit!(1e-15));
    let s3 = limited(p3, per_r3, x3 * lit!(2.0) * x3 * x3);
    let s23 = limited(p23.minus(r23.times(s3)), per_r2, x2 * lit!(6.0) * x2);
    let s123 = limited(
        p123.minus(r12.times(s23)).minus(r123.times(s3)),
        per_r1,
        x1 * lit!(18.0),
    );
    let s1123 = limited(
        p1123
            .minus(r11.times(s123))
            .minus(r112.times(s23))
            .minus(s3),
        per_r1,
        third,
    );
    let s1223 = limited(
        p1223
            .minus(r12.times(s123))
            .minus(r122.times(s23))
            .minus(s3),
        per_r2,
        third,
    );
    let s1233 = limited(
        p1233
            .minus(r13.times(s123))
            .minus(r123.times(s23))
            .minus(s3),
        per_r3,
        third,
    );
    let s11223 = limited(
        p11223
            .minus(r12.times(s1223))
            .minus(r112.times(s123))
            .minus(s23),
        per_r1,
        per_x2 * lit!(88.0),
    );
    let s12233 = limited(
        p12233
            .minus(r23.times(s1233))
            .minus(r123.times(s123))
            .minus(s23),
        per_r2,
        per_x2 * lit!(132.0),
    );
    let s112233 = limited(
        p112233
            .minus(r12.times(s12233))
            .minus(r123.times(s1233))
            .minus(s123),
        per_r1,
        per_x2 * lit!(340.0) * per_x2,
    );
    // l = s3 + (v - v3) (s23 + (v - v2) s123), and t as well; both by powers of v.
    let t3 = s3.times(s1233).scaled(two);
    let t23 = s3.times(s12233).plus(s23.times(s1223)).scaled(two);
    let t123 = s3
        .times(s112233)
        .plus(s23.times(s11223))
        .plus(s123.times(s1123))
        .scaled(two);
    let l = parabola(v2, v3, s3, s23, s123);
    let t = parabola(v2, v3, t3, t23, t123);
    let e1 = v1.plus(v2).plus(v3);
    let e2 = v1.times(v2).plus(v1.plus(v2).times(v3));
    let e3 = v1.times(v2).times(v3);
    [
        // Coefficients of u^1 to u^6: of the quintic, those of v^5 to v^0.
        zero,
        t[2],
        l[2].times(l[2]).plus(t[1]).minus(t[2].times(e1)),
        l[1].times(l[2])
            .scaled(two)
            .plus(t[0])
            .minus(t[1].times(e1))
            .plus(t[2].times(e2)),
        l[1].times(l[1])
            .plus(l[0].times(l[2]).scaled(two))
            .minus(t[0].times(e1))
            .plus(t[1].times(e2))
            .minus(t[2].times(e3)),
        l[0].times(l[1])
            .scaled(two)
            .plus(t[0].times(e2))
            .minus(t[1].times(e3)),
        l[0].times(l[0]).minus(t[0].times(e3)),
    ]
}
