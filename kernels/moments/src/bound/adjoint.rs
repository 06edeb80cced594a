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

use hankel_dsl::{Real, lit, unroll};

use super::kernel::Kernel;
use super::recurrence::{Recurrence, finite};
use super::roots::{least_of_cubic, least_of_quadratic, least_three, least_two, whole};
use super::twofold::{Arithmetic, Plain, Twofold};
use super::{MAX, MAX_MOMENTS};

/// The derivative of something that depends on a bound.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gradient<R> {
    /// To the moments `m_0` to `m_2N`; the rest is 0.
    pub m: [R; MAX_MOMENTS],
    /// To the query point.
    pub eta: R,
}

/// What [`blend`](super::Bounds::blend) makes of [`bound`](super::bound) as seen from behind: the
/// derivatives to moments and query point, times `d_bound`.
///
/// Takes anything that [`bound`](super::bound) takes. Each factor of a derivative is limited to
/// 1e25, `d_bound` to 1e12, and the derivative to the query point, which is in proportion to the total,
/// to 1e37.
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
/// For N up to 3, no derivative has an error of more than four times what rounding each argument and the result
/// once does to it. That is measured, not proved, in `f32` and `f64`, for rows of the families that
/// [`bound_compensated`](super::bound_compensated) is measured on; a derivative that is less than the number
/// type's epsilon times the greatest of its row counts as that. For N from 4 on it is not promised.
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

/// [`mix_bias`](super::mix_bias) as seen from behind: from the gradient to the mixed moments that
/// to the given ones.
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
    let (e, own_weight) = if const { A::TWICE } {
        kernel.fine::<N>()
    } else {
        let mut e = [A::of(one); MAX + 1];
        unroll!(i in 1..(N + 1), max 7, {
            e[i] = A::of(kernel.e[i]);
        });
        (e, A::of(kernel.own))
    };

    // All in powers of u times the reach. (K(u) / K(0))², K(u) being Σ e_i u^i.
    let own = squared::<R, A, N>(&e);
    let minor = minor::<R, A, N>(&kernel, &e);
    let blend = overestimation.saturate();
    let own_share = R::select(kernel.turned, blend - one, blend);
    let minor_share = R::select(kernel.turned, -one, one);
    let minor_share = R::select(kernel.few.gt(zero), minor_share, zero);
    let mut q = [A::of(zero); MAX_MOMENTS];
    unroll!(i in 0..(2 * N + 1), max 13, {
        q[i] = own[i].times_plain(own_share).plus(minor[i].times_plain(minor_share));
    });
    q[0] = A::select(kernel.turned, A::of(one).plus(q[0]), q[0]);

    // In powers of x - eta.
    let limit: R = lit!(1e25);
    let sign = R::select(kernel.turned, -one, one);
    let per_length = A::of(sign * (kernel.reach / recurrence.unit));
    let mut power = per_length;
    unroll!(i in 1..(2 * N + 1), max 13, {
        q[i] = q[i].times_within(power, limit);
        power = power.times_within(per_length, limit);
    });
    let present = recurrence.total.gt(zero);
    let factor = R::select(present, finite(d_bound, lit!(1e12)), zero);
    // The total is the last factor: it may be large where the others are small.
    let d_eta = own_weight.times(q[1]).rounded().clamp(-limit, limit) * -factor;
    let most: R = lit!(1e37);
    let d_eta = d_eta * recurrence.total.min(most / d_eta.abs().max(one));

    // In powers of x: Horner's scheme, repeated.
    let eta = finite(eta, lit!(1e12));
    unroll!(j in 0..(2 * N), max 13, {
        unroll!(i in 0..(2 * N), max 13, {
            // Each time one coefficient less: from the highest but one down to j.
            if const { i + j < 2 * N } {
                let carried = q[2 * N - i].times_plain(eta);
                q[2 * N - 1 - i] = q[2 * N - 1 - i].minus(carried).within(-limit, limit);
            }
        });
    });
    let mut gradient = Gradient {
        m: [zero; MAX_MOMENTS],
        eta: d_eta,
    };
    unroll!(i in 0..(2 * N + 1), max 13, {
        gradient.m[i] = q[i].rounded() * factor;
    });
    gradient
}

/// Coefficients of a monic polynomial, highest power first.
type Fine<A> = [A; MAX + 1];

/// The square of a polynomial of degree N.
#[inline(always)]
fn squared<R: Real, A: Arithmetic<R>, const N: usize>(p: &Fine<A>) -> [A; MAX_MOMENTS] {
    let mut square = [A::of(lit!(0.0)); MAX_MOMENTS];
    unroll!(i in 0..(N + 1), max 7, {
        unroll!(j in 0..(N + 1), max 7, {
            square[i + j] = square[i + j].plus(p[i].times(p[j]));
        });
    });
    square
}

/// The polynomial that is 1 at the negative roots, 0 at the others and at 0, and stationary at all
/// roots.
#[inline(always)]
fn minor<R: Real, A: Arithmetic<R>, const N: usize>(
    kernel: &Kernel<R, A>,
    e: &Fine<A>,
) -> [A; MAX_MOMENTS] {
    let zero: R = lit!(0.0);
    let one: R = lit!(1.0);
    if const { N == 1 } {
        return [A::of(zero); MAX_MOMENTS];
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
    let first = exact_root::<R, A, N>(e, first);
    let rest = deflated::<R, A, N>(e, first);
    let single = single::<R, A, N>(&rest, first);
    if const { N < 4 } {
        return single;
    }
    let second = exact_root::<R, A, N>(e, second);
    let rest = deflated::<R, A, N>(&rest, second);
    let double = double::<R, A, N>(&rest, first, second);
    let is_double = kernel.few.gt(one);
    let mut minor = single;
    unroll!(i in 0..(2 * N + 1), max 13, {
        minor[i] = A::select(is_double, double[i], single[i]);
    });
    if const { N < 6 } {
        return minor;
    }
    let third = exact_root::<R, A, N>(e, third);
    let rest = deflated::<R, A, N>(&rest, third);
    let triple = triple::<R, A, N>(&rest, first, second, third);
    let is_triple = kernel.few.gt(lit!(2.0));
    unroll!(i in 0..(2 * N + 1), max 13, {
        minor[i] = A::select(is_triple, triple[i], minor[i]);
    });
    minor
}

/// How often a root is improved: each time its error is cubed, until it is that of the coefficients.
const REFINEMENTS: usize = 3;

/// The negative root of the polynomial next to `v`, with all digits that the coefficients have; 0 stays.
#[inline(always)]
fn exact_root<R: Real, A: Arithmetic<R>, const N: usize>(e: &Fine<A>, v: R) -> A {
    let zero: R = lit!(0.0);
    let mut root = A::of(v);
    if const { A::TWICE } {
        let quarter: R = lit!(0.25);
        let least: R = lit!(1e-37);
        unroll!(_step in 0..REFINEMENTS, max 7, {
            let mut p = e[0];
            let mut d = A::of(zero);
            let mut h = zero;
            unroll!(i in 1..(N + 1), max 7, {
                h = h * v + d.rounded();
                d = d.times(root).plus(p);
                p = p.times(root).plus(e[i]);
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

/// The polynomial without the root: coefficients that are left over are 0.
#[inline(always)]
fn deflated<R: Real, A: Arithmetic<R>, const N: usize>(e: &Fine<A>, v: A) -> Fine<A> {
    let mut rest = *e;
    unroll!(i in 1..N, max 7, {
        rest[i] = e[i].plus(v.times(rest[i - 1]));
    });
    rest[N] = A::of(lit!(0.0));
    rest
}

/// The quotient of a polynomial by `v - at`, and the remainder at index `degree`; what is beyond
/// has no meaning.
#[inline(always)]
fn divided<R: Real, A: Arithmetic<R>>(e: &Fine<A>, at: A) -> Fine<A> {
    let mut quotient = *e;
    unroll!(i in 1..(MAX + 1), max 7, {
        quotient[i] = e[i].plus(at.times(quotient[i - 1]));
    });
    quotient
}

/// `n - by`, also where an instance that is never run asks for less than 0.
const fn less(n: usize, by: usize) -> usize {
    n.saturating_sub(by)
}

/// `u rest(u)²` times the straight line that makes it 1 and stationary at the root; `rest` has
/// degree N - 1.
#[inline(always)]
fn single<R: Real, A: Arithmetic<R>, const N: usize>(rest: &Fine<A>, v: A) -> [A; MAX_MOMENTS] {
    let one: R = lit!(1.0);
    let zero: R = lit!(0.0);
    let quotient = divided(rest, v);
    let value = quotient[const { less(N, 1) }];
    let slope = divided(&quotient, v)[const { less(N, 2) }];
    let per_value = value.inverse();
    let mut power = A::of(one);
    unroll!(k in 1..N, max 7, {
        power = power.times(v);
    });
    // 1 / rest at the root: all its roots are on the other side, so it is between 0 and 1.
    let share = power.times(per_value).within(zero, one);
    let at_root = v.times(share.times(share));
    let twice = v.times(slope.times(per_value)).scaled(lit!(2.0));
    let tilt = twice.minus(A::of(whole::<R>(2 * N - 1)));
    let constant = at_root.times(A::of(one).minus(tilt));
    let linear = at_root.times(v.times(tilt));
    let square = squared::<R, A, N>(rest);
    let mut q = [A::of(zero); MAX_MOMENTS];
    unroll!(i in 1..(2 * N + 1), max 13, {
        q[i] = constant.times(square[i - 1]);
        if const { i > 1 } {
            q[i] = q[i].plus(linear.times(square[i - 2]));
        }
    });
    q
}

/// `u rest(u)²` times the cubic that makes it 1 and stationary at both roots; `rest` has degree
/// N - 2.
///
/// In the reciprocal, the cubic meets `s(v)² = (v^N / rest(v))²` doubly at both roots. With the
/// straight line `l` that meets `s`, it is `l² + (v - v_1)(v - v_2) t`, where the straight line `t`
/// meets `2 l` times the second divided difference of `s`. Divided differences of a quotient of
/// polynomials follow from theirs by Leibniz' rule, without cancellation where both roots meet.
#[inline(always)]
fn double<R: Real, A: Arithmetic<R>, const N: usize>(
    rest: &Fine<A>,
    v1: A,
    v2: A,
) -> [A; MAX_MOMENTS] {
    let zero = A::of(lit!(0.0));
    let one = A::of(lit!(1.0));
    let two: R = lit!(2.0);
    // Divided differences of rest, named by their arguments.
    let by_1 = divided(rest, v1);
    let by_2 = divided(rest, v2);
    let by_11 = divided(&by_1, v1);
    let by_12 = divided(&by_1, v2);
    let r1 = by_1[const { less(N, 2) }];
    let r2 = by_2[const { less(N, 2) }];
    let r11 = by_11[const { less(N, 3) }];
    let r12 = by_12[const { less(N, 3) }];
    let r22 = divided(&by_2, v2)[const { less(N, 3) }];
    let r112 = divided(&by_11, v2)[const { less(N, 4) }];
    let r122 = divided(&by_12, v2)[const { less(N, 4) }];
    let r1122 = if const { N == 6 } {
        divided(&divided(&by_11, v2), v2)[1]
    } else if const { N == 5 } {
        one
    } else {
        zero
    };
    // Divided differences of v^N: complete homogeneous polynomials.
    let (mut p2, mut p12, mut p22, mut p112, mut p122, mut p1122) =
        (one, zero, zero, zero, zero, zero);
    let mut p1 = one;
    unroll!(k in 0..N, max 7, {
        p1122 = v2.times(p1122).plus(p112);
        p122 = v2.times(p122).plus(p12);
        p112 = v1.times(p112).plus(p12);
        p22 = v2.times(p22).plus(p2);
        p12 = v2.times(p12).plus(p1);
        p1 = v1.times(p1);
        p2 = v2.times(p2);
    });
    let (per_r1, per_r2) = (r1.inverse(), r2.inverse());
    // And of the quotient.
    let limit: R = lit!(1e9);
    let quotient = |rest: A, per: A| rest.times(per).within(-limit, limit);
    let s1 = quotient(p1, per_r1);
    let s2 = quotient(p2, per_r2);
    let s12 = quotient(p12.minus(r12.times(s2)), per_r1);
    let s22 = quotient(p22.minus(r22.times(s2)), per_r2);
    let s112 = quotient(p112.minus(r11.times(s12)).minus(r112.times(s2)), per_r1);
    let s122 = quotient(p122.minus(r12.times(s22)).minus(r122.times(s2)), per_r1);
    let s1122 = quotient(
        p1122
            .minus(r11.times(s122))
            .minus(r112.times(s22))
            .minus(r1122.times(s2)),
        per_r1,
    );
    // l = s1 + s12 (v - v1), t = t0 + t1 (v - v1).
    let t0 = s1.times(s112).scaled(two);
    let t1 = s1.times(s1122).plus(s12.times(s122)).scaled(two);
    let l0 = s1.minus(s12.times(v1));
    let t0 = t0.minus(t1.times(v1));
    let (sum, product) = (v1.plus(v2), v1.times(v2));
    let cubic = [
        // Coefficients of u^0 to u^3, of v^3 to v^0.
        t1,
        s12.times(s12).plus(t0).minus(t1.times(sum)),
        l0.times(s12)
            .scaled(two)
            .minus(t0.times(sum))
            .plus(t1.times(product)),
        l0.times(l0).plus(t0.times(product)),
    ];
    times_square::<R, A, N, 4>(cubic, rest)
}

/// `u rest(u)²` times a polynomial of `TERMS` coefficients, that of `u^0` first.
#[inline(always)]
fn times_square<R: Real, A: Arithmetic<R>, const N: usize, const TERMS: usize>(
    factors: [A; TERMS],
    rest: &Fine<A>,
) -> [A; MAX_MOMENTS] {
    let square = squared::<R, A, N>(rest);
    let mut q = [A::of(lit!(0.0)); MAX_MOMENTS];
    unroll!(i in 0..TERMS, max 7, {
        unroll!(j in 0..(2 * MAX), max 13, {
            if const { i + j < 2 * N } {
                q[i + j + 1] = q[i + j + 1].plus(factors[i].times(square[j]));
            }
        });
    });
    q
}

/// [`double`] for three roots of which `rest`, of degree N - 3, has none: `u rest(u)²` times the polynomial of
/// degree 5 that makes it 1 and stationary at all three.
///
/// In the reciprocal it is `l² + (v - v_1)(v - v_2)(v - v_3) t`, where the parabola `l` meets `s` and the
/// parabola `t` meets `2 l` times the third divided difference of `s`.
#[inline(always)]
fn triple<R: Real, A: Arithmetic<R>, const N: usize>(
    rest: &Fine<A>,
    v1: A,
    v2: A,
    v3: A,
) -> [A; MAX_MOMENTS] {
    let zero = A::of(lit!(0.0));
    let one = A::of(lit!(1.0));
    let two: R = lit!(2.0);
    // Divided differences of rest, named by their arguments; with four it is 1, with more 0.
    let by_1 = divided(rest, v1);
    let by_2 = divided(rest, v2);
    let by_3 = divided(rest, v3);
    let by_12 = divided(&by_1, v2);
    let r1 = by_1[const { less(N, 3) }];
    let r2 = by_2[const { less(N, 3) }];
    let r3 = by_3[const { less(N, 3) }];
    let r11 = divided(&by_1, v1)[const { less(N, 4) }];
    let r12 = by_12[const { less(N, 4) }];
    let r13 = divided(&by_1, v3)[const { less(N, 4) }];
    let r23 = divided(&by_2, v3)[const { less(N, 4) }];
    let r112 = divided(&by_12, v1)[const { less(N, 5) }];
    let r122 = divided(&by_12, v2)[const { less(N, 5) }];
    let r123 = divided(&by_12, v3)[const { less(N, 5) }];
    // Divided differences of v^N: complete homogeneous polynomials.
    let mut p3 = one;
    let (mut p23, mut p123, mut p1123, mut p1223, mut p1233) = (zero, zero, zero, zero, zero);
    let (mut p11223, mut p12233, mut p112233) = (zero, zero, zero);
    unroll!(k in 0..N, max 7, {
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
    // And of the quotient.
    let limit: R = lit!(1e12);
    let quotient = |rest: A, per: A| rest.times(per).within(-limit, limit);
    let s3 = quotient(p3, per_r3);
    let s23 = quotient(p23.minus(r23.times(s3)), per_r2);
    let s123 = quotient(p123.minus(r12.times(s23)).minus(r123.times(s3)), per_r1);
    let s1123 = quotient(
        p1123
            .minus(r11.times(s123))
            .minus(r112.times(s23))
            .minus(s3),
        per_r1,
    );
    let s1223 = quotient(
        p1223
            .minus(r12.times(s123))
            .minus(r122.times(s23))
            .minus(s3),
        per_r2,
    );
    let s1233 = quotient(
        p1233
            .minus(r13.times(s123))
            .minus(r123.times(s23))
            .minus(s3),
        per_r3,
    );
    let s11223 = quotient(
        p11223
            .minus(r12.times(s1223))
            .minus(r112.times(s123))
            .minus(s23),
        per_r1,
    );
    let s12233 = quotient(
        p12233
            .minus(r23.times(s1233))
            .minus(r123.times(s123))
            .minus(s23),
        per_r2,
    );
    let s112233 = quotient(
        p112233
            .minus(r12.times(s12233))
            .minus(r123.times(s1233))
            .minus(s123),
        per_r1,
    );
    // l = s3 + (v - v3) (s23 + (v - v2) s123), and t as well; both by powers of v.
    let t3 = s3.times(s1233).scaled(two);
    let t23 = s3.times(s12233).plus(s23.times(s1223)).scaled(two);
    let t123 = s3
        .times(s112233)
        .plus(s23.times(s11223))
        .plus(s123.times(s1123))
        .scaled(two);
    let parabola = |at: A, slope: A, bend: A| {
        let linear = slope.minus(bend.times(v2));
        [
            at.minus(v3.times(linear)),
            linear.minus(bend.times(v3)),
            bend,
        ]
    };
    let l = parabola(s3, s23, s123);
    let t = parabola(t3, t23, t123);
    let e1 = v1.plus(v2).plus(v3);
    let e2 = v1.times(v2).plus(v1.plus(v2).times(v3));
    let e3 = v1.times(v2).times(v3);
    // Coefficients of u^0 to u^5, of v^5 to v^0.
    let quintic = [
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
    ];
    times_square::<R, A, N, 6>(quintic, rest)
}
