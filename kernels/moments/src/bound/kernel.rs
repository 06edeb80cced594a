//! From the recurrence to the points of the distribution that attains the bound.

use hankel_dsl::{Real, apart, array_element, array_element_mut, lit, unroll};

use super::recurrence::Recurrence;
use super::roots::{Monic, least_of_cubic, least_of_quadratic, least_three, least_two, whole};
use super::twofold::{Arithmetic, product};
use super::{MAX, is_long};

/// What a query point makes of a recurrence.
///
/// Depths are `u`, relative to the query point; points of the extremal distribution other than it
/// are the roots of the kernel polynomial `K(u) = Σ p_k(u) p_k(0) / h_k` (\[MBD\], Eq. 16). They are
/// given by their reciprocals `v = 1/u`: `K(0)`, a sum of squares, is the leading coefficient of the
/// polynomial in `v`, so that it never loses a degree, and a root at infinity is `v = 0`.
///
/// The side of the query point with fewer roots is always the negative one: if need be the axis is
/// turned around.
#[derive(Clone, Copy)]
pub(crate) struct Kernel<R: Real, A> {
    /// The recurrence, turned around where `turned`.
    pub a: [R; MAX],
    /// Its other coefficients.
    pub b: [R; MAX + 1],
    /// `p_k(0)`
    pub y: [R; MAX + 1],
    /// `h_N / h_k`: the weights of the inner product that makes vectors `p_k(u)` of different
    /// roots orthogonal.
    pub c: [R; MAX + 1],
    /// Mean square distance to the query point.
    pub mean_square: R,
    /// Coefficients of `K`, lowest power first.
    pub k: [R; MAX + 1],
    /// `Σ c_k y_k²`
    pub square: R,
    /// Weight of the query point.
    pub own: R,
    /// Weight of all other points: 1 - `own`, without cancellation.
    pub others: R,
    /// The monic polynomial whose roots are `v / reach`.
    pub e: Monic<R>,
    /// The root of the sum of all `v²`: no root is nearer than its reciprocal.
    pub reach: R,
    /// The recurrence, turned around where `turned`, with all its digits.
    fine_a: [A; MAX],
    fine_b: [A; MAX + 1],
    /// `p_{N-1}(0)` and `p_N(0)` with all their digits.
    fine_y: [A; 2],
    /// Whether the axis was turned around.
    pub turned: R::Mask,
    /// How many roots are on the negative side, 0 to N/2.
    pub few: R,
}

impl<R: Real, A: Arithmetic<R>> Kernel<R, A> {
    /// For N steps of a recurrence.
    #[inline(always)]
    pub fn new<const N: usize>(recurrence: &Recurrence<R, A>) -> Self {
        of_recurrence::<R, A, N>(recurrence)
    }

    #[inline(always)]
    fn dot<const N: usize>(&self, x: &[R; MAX + 1], y: &[R; MAX + 1]) -> R {
        let mut sum = x[N] * y[N];
        unroll!(k in 0..N, max 7, {
            sum += self.c[k] * (x[k] * y[k]);
        });
        sum
    }

    /// N = 2, one root on each side: the negative one's weight from total, mean and mean square
    /// alone, which are exact. The nearer root enters as a distance and the farther one as a
    /// reciprocal; of the two weights the one without cancellation is computed.
    #[inline(always)]
    fn lesser_of_two(&self, mean: R, mean_square: R) -> R {
        let zero: R = lit!(0.0);
        let one: R = lit!(1.0);
        let [k0, k1, k2, ..] = self.k;
        let k2 = k2.abs();
        let root = (k1 * k1 + k2 * k0 * lit!(4.0)).sqrt();
        let s = ((k1.abs() + root) * lit!(0.5)).max(R::epsilon() * k0);
        let near = k0 / s;
        let far = k2 / s;
        let near_is_below = k1.gt(zero);
        // How far the mean lies to the nearer root's side.
        let toward = R::select(near_is_below, -mean, mean);
        let shared = one + near * far;
        // Where terms cancel, the rounding error is about that of a weight of this size.
        let near_noise = mean_square * far / (near * shared);
        let far_noise = mean_square * (far * far) / shared;
        let half: R = lit!(0.5);
        let of_near = (mean_square * far + toward) / (near * shared);
        let of_far = far * far * (mean_square - toward * near) / shared;
        let near_is_exact = near_noise.lt(half) | toward.ge(zero);
        let far_is_exact = far_noise.lt(half) | toward.le(zero);
        let is_exact = (near_is_below & near_is_exact) | (!near_is_below & far_is_exact);
        let is_other_exact = (near_is_below & far_is_exact) | (!near_is_below & near_is_exact);
        let wanted = R::select(near_is_below, of_near, of_far);
        let other = R::select(near_is_below, of_far, of_near);
        let is_small = wanted.lt(half) | !is_other_exact;
        R::select(is_exact & is_small, wanted, one - (self.own + other))
    }
}

/// [`Kernel::new`]
#[apart(R, if is_long::<R, A>(N))]
#[inline(always)]
fn of_recurrence<R: Real, A: Arithmetic<R>, const N: usize>(
    recurrence: &Recurrence<R, A>,
) -> Kernel<R, A> {
    let zero: R = lit!(0.0);
    let one: R = lit!(1.0);
    let least: R = lit!(1e-37);
    let mut fine_a = recurrence.a;
    let fine_b = recurrence.b;
    let mut a = [zero; MAX];
    let mut b = [zero; MAX + 1];
    unroll!(k in 0..N, max 7, {
        a[k] = fine_a[k].rounded();
        b[k + 1] = fine_b[k + 1].rounded();
    });
    let mut y = [one; MAX + 1];
    let mut fine_y = [A::of(one); 2];
    y[1] = -a[0];
    if const { A::TWICE } {
        fine_y[1] = fine_a[0].scaled(-one);
        unroll!(k in 1..N, max 7, loop if is_long::<R, A>(N), {
            let a = array_element(&fine_a, k as u32);
            let b = array_element(&fine_b, k as u32);
            let next = a.sum_of_products(fine_y[1], b, fine_y[0]).scaled(-one);
            fine_y[0] = fine_y[1];
            fine_y[1] = next;
            *array_element_mut(&mut y, k as u32 + 1) = next.rounded();
        });
    } else {
        unroll!(k in 1..N, max 7, {
            y[k + 1] = -(a[k] * y[k] + b[k] * y[k - 1]);
        });
    }

    // The roots and the query point interlace with the roots of p_N, and how many of those
    // are below the query point is the number of permanences of sign (Sturm).
    let mut below = zero;
    unroll!(k in 0..N, max 7, {
        let (is, was) = (y[k + 1].ge(zero), y[k].ge(zero));
        below += R::select((is & was) | !(is | was), one, zero);
    });
    let count: R = whole!(R, N);
    let turned = below.gt(count * lit!(0.5));
    let sign = R::select(turned, -one, one);
    unroll!(k in 0..N, max 7, {
        a[k] *= sign;
    });
    unroll!(k in 0..(N + 1), max 7, {
        if const { k % 2 == 1 } {
            y[k] *= sign;
        }
    });
    if const { A::TWICE } {
        unroll!(k in 0..N, max 7, {
            fine_a[k] = fine_a[k].scaled(sign);
        });
        let odd = const { N % 2 };
        fine_y[odd] = fine_y[odd].scaled(sign);
    }
    let few = R::select(turned, count - below, below);

    let mut c = [one; MAX + 1];
    unroll!(k in 0..N, max 7, {
        c[N - 1 - k] = c[N - k] * b[N - k];
    });
    let mut outer = zero;
    unroll!(k in 2..(N + 1), max 7, {
        outer += c[k] * (y[k] * y[k]);
    });
    // The first two terms are the mean square times c_1.
    let square = (outer + c[1] * recurrence.square).max(least);
    let (own, others) = if const { N == 1 } {
        (recurrence.spread, recurrence.rest)
    } else {
        let own = (c[0] / square).min(recurrence.spread);
        let others = (outer + c[1] * (y[1] * y[1])) / square;
        let others = R::select(own.lt(lit!(0.5)), one - own, others);
        (own, others.max(recurrence.rest))
    };

    // K_k = y_k p_k + β_k K_{k-1}, all in powers of u.
    let mut p = [zero; MAX + 2];
    let mut before = p;
    let mut kernel = [zero; MAX + 1];
    p[0] = one;
    kernel[0] = one;
    unroll!(k in 0..N, max 7, {
        let mut next = [zero; MAX + 2];
        unroll!(i in 0..(MAX + 1), max 7, {
            if const { i <= k + 1 } {
                let mut t = zero;
                if const { i <= k } {
                    t -= a[k] * p[i];
                }
                if const { k > 0 && i < k } {
                    t -= b[k] * before[i];
                }
                if const { i > 0 } {
                    t += p[i - 1];
                }
                next[i] = t;
            }
        });
        before = p;
        p = next;
        unroll!(i in 0..(MAX + 1), max 7, {
            if const { i <= k } {
                kernel[i] = b[k + 1] * kernel[i] + y[k + 1] * p[i];
            } else if const { i == k + 1 } {
                kernel[i] = y[k + 1];
            }
        });
    });
    kernel[0] = square;

    let (e, reach) = if const { N == 1 && !A::TWICE } {
        // Of one root, the reciprocal is a quotient.
        let mut e = [one; MAX + 1];
        let half: R = lit!(0.5);
        let nearest = half / R::epsilon();
        e[1] = (kernel[1] / square).clamp(-nearest, nearest);
        (e, one)
    } else {
        reversed::<R, N>(&kernel)
    };
    Kernel {
        a,
        b,
        y,
        c,
        mean_square: recurrence.square,
        k: kernel,
        square,
        own,
        others,
        e,
        reach,
        fine_a,
        fine_b,
        fine_y,
        turned,
        few,
    }
}

/// The coefficients `e` and the query point's weight with all digits that the recurrence has.
#[apart(R, if is_long::<R, A>(N))]
#[inline(always)]
pub(crate) fn fine<R: Real, A: Arithmetic<R>, const N: usize>(
    kernel: &Kernel<R, A>,
    reach: R,
) -> ([A; MAX + 1], A) {
    let zero = A::of(lit!(0.0));
    let one = A::of(lit!(1.0));
    let minus: R = lit!(-1.0);
    // As `of_recurrence` has it, with p_k and the one before in place.
    let mut p = [zero; MAX + 1];
    let mut before = p;
    let mut powers = p;
    let mut weight = one;
    let (mut y, mut y_before) = (one, zero);
    p[0] = one;
    powers[0] = one;
    unroll!(k in 0..N, max 7, loop if is_long::<R, A>(N), {
        let a = array_element(&kernel.fine_a, k as u32);
        let b = array_element(&kernel.fine_b, k as u32);
        let y_next = if k == 0 {
            a.scaled(minus)
        } else {
            a.sum_of_products(y, b, y_before).scaled(minus)
        };
        (y_before, y) = (y, y_next);
        let b_next = array_element(&kernel.fine_b, k as u32 + 1);
        weight = weight.times(b_next);
        let mut carried = zero;
        unroll!(i in 0..(N + 1), max 7, loop if is_long::<R, A>(N), {
            if i <= k + 1 {
                let here = array_element(&p, i as u32);
                let mut next = zero;
                if i <= k {
                    next = next.minus(a.times(here));
                }
                if i < k {
                    next = next.minus(b.times(array_element(&before, i as u32)));
                }
                if i > 0 {
                    next = next.plus(carried);
                }
                *array_element_mut(&mut before, i as u32) = here;
                *array_element_mut(&mut p, i as u32) = next;
                carried = here;
                let power = array_element_mut(&mut powers, i as u32);
                *power = if i <= k {
                    b_next.times(*power).plus(y.times(next))
                } else {
                    y
                };
            }
        });
    });
    let square = powers[0].at_least(lit!(1e-37));
    let per_reach = A::of(R::literal::<{ 1.0_f64.to_bits() }>() / reach);
    let largest: R = lit!(1e17);
    let mut e = [one; MAX + 1];
    let mut power = per_reach;
    unroll!(i in 1..(N + 1), max 7, loop if is_long::<R, A>(N), {
        let ratio = array_element(&powers, i as u32).over(square);
        *array_element_mut(&mut e, i as u32) = ratio.times_within(power, largest);
        power = power.times(per_reach);
    });
    (e, weight.over(square).within(lit!(0.0), lit!(1.0)))
}

/// `p_k(u)` for the root `u = 1 / (reach v)`, all times a common factor that keeps them within
/// range.
#[inline(always)]
fn vector<R: Real, A: Arithmetic<R>, const N: usize>(kernel: &Kernel<R, A>, v: R) -> [R; MAX + 1] {
    let one: R = lit!(1.0);
    // u = s / t, and the larger of both is 1.
    let v = v * kernel.reach;
    let is_near = v.abs().gt(one);
    let t = R::select(is_near, one, v);
    let s = R::select(is_near, one / R::select(is_near, v, one), one);
    if const { A::TWICE } {
        return refined::<R, A, N>(kernel, s, t, is_near);
    }
    let mut z = [one; MAX + 1];
    z[1] = s - kernel.a[0] * t;
    unroll!(k in 1..N, max 7, {
        z[k + 1] = (s - kernel.a[k] * t) * z[k] - kernel.b[k] * (t * t) * z[k - 1];
    });
    let mut power = t;
    unroll!(k in 0..N, max 7, {
        z[N - 1 - k] *= power;
        power *= t;
    });
    z
}

/// [`vector`](vector) for the root next to `s / t`, of which `t` is 1 where it `is_near`,
/// and else `s`.
///
/// Where roots are close together, or close to the query point, all of this cancels: the recurrence
/// and the kernel polynomial are evaluated in twice the digits, at a point that has no rounding
/// error. From there it is not far to the root, so that single digits are enough for the way.
#[inline(always)]
fn refined<R: Real, A: Arithmetic<R>, const N: usize>(
    kernel: &Kernel<R, A>,
    s: R,
    t: R,
    is_near: R::Mask,
) -> [R; MAX + 1] {
    let zero: R = lit!(0.0);
    let one: R = lit!(1.0);
    let s_moves = R::select(is_near, one, zero);
    let t_moves = one - s_moves;
    let fine_s = A::of(s);
    let (square, rest) = product(t, t);
    let t_square = A::of_two(square, rest);

    // Value, first derivative and half the second one, in s or t.
    let mut z = [one; MAX + 1];
    let mut d = [zero; MAX + 1];
    let mut h = [zero; MAX + 1];
    let mut before = A::of(zero);
    let mut fine = A::of(one);
    unroll!(k in 0..N, max 7, loop if is_long::<R, A>(N), {
        let at = k as u32;
        let factor = fine_s.minus(array_element(&kernel.fine_a, at).times_plain(t));
        let slope = s_moves - t_moves * array_element(&kernel.a, at);
        let f = factor.rounded();
        if k == 0 {
            before = fine;
            fine = factor;
            d[1] = slope;
        } else {
            let by = array_element(&kernel.fine_b, at).times(t_square);
            let next = factor.cross(fine, by, before);
            before = fine;
            fine = next;
            let bend = t_moves * array_element(&kernel.b, at);
            let b = by.rounded();
            let steep = (bend + bend) * t;
            let (z0, z1) = (array_element(&z, at), array_element(&z, at - 1));
            let (d0, d1) = (array_element(&d, at), array_element(&d, at - 1));
            let (h0, h1) = (array_element(&h, at), array_element(&h, at - 1));
            *array_element_mut(&mut d, at + 1) = f * d0 + slope * z0 - b * d1 - steep * z1;
            *array_element_mut(&mut h, at + 1) =
                f * h0 + slope * d0 - b * h1 - steep * d1 - bend * z1;
        }
        *array_element_mut(&mut z, at + 1) = fine.rounded();
    });

    // The kernel polynomial times u, by Christoffel and Darboux.
    let b = kernel.fine_b[N];
    let across = b.times_plain(t);
    let [y_before, y] = kernel.fine_y;
    let along = y.times_plain(s).plus(across.times(y_before));
    let over = b.times(t_square).times(y);
    let value = along.cross(fine, over, before).rounded();
    let (a0, o0) = (along.rounded(), over.rounded());
    let (y_before, y) = (y_before.rounded(), y.rounded());
    let b = b.rounded();
    let a1 = s_moves * y + t_moves * (b * y_before);
    let o2 = t_moves * (b * y);
    let o1 = (o2 + o2) * t;
    let slope = a0 * d[N] + a1 * z[N] - o0 * d[N - 1] - o1 * z[N - 1];
    let bend = a0 * h[N] + a1 * d[N] - o0 * h[N - 1] - o1 * d[N - 1] - o2 * z[N - 1];
    // The nearer root of the parabola that touches it: right to third order.
    let least: R = lit!(1e-37);
    let scale = one / value.abs().max(slope.abs()).max(bend.abs()).max(least);
    let (value, slope, bend) = (value * scale, slope * scale, bend * scale);
    let root = (slope * slope - value * bend * lit!(4.0)).max(zero).sqrt();
    let step = (value + value) / (slope.abs() + root).max(least);
    let quarter: R = lit!(0.25);
    let w = R::select(is_near, s, t).abs() * quarter;
    let step = R::select(slope.lt(zero), step, -step).clamp(-w, w);

    let mut power = one;
    let t = t + t_moves * step;
    unroll!(k in 0..(N + 1), max 7, {
        z[N - k] = (z[N - k] + step * (d[N - k] + step * h[N - k])) * power;
        power *= t;
    });
    z
}

/// The root's vector and its square, both freed of the query point's vector, to which it would
/// be orthogonal if the root were exact: what a root's rounding error does to its weight is
/// thereby undone to first order.
#[apart(R, if is_long::<R, A>(N))]
#[inline(always)]
fn freed<R: Real, A: Arithmetic<R>, const N: usize>(
    kernel: &Kernel<R, A>,
    v: R,
) -> ([R; MAX + 1], R) {
    let z = vector::<R, A, N>(kernel, v);
    let shared = kernel.dot::<N>(&z, &kernel.y) / kernel.square;
    let mut x = z;
    unroll!(k in 0..(N + 1), max 7, {
        x[k] = z[k] - shared * kernel.y[k];
    });
    let least: R = lit!(1e-37);
    (x, kernel.dot::<N>(&x, &x).max(least))
}

/// The weight of a single root.
#[inline(always)]
pub(crate) fn weight_of<R: Real, A: Arithmetic<R>, const N: usize>(
    kernel: &Kernel<R, A>,
    v: R,
) -> R {
    let (x, square) = freed::<R, A, N>(kernel, v);
    kernel.c[0] * x[0] * (x[0] / square)
}

/// The weight of a single root, small ones to their own last digits: those of roots near
/// infinity, which freeing would drown.
#[inline(always)]
pub(crate) fn small_weight_of<R: Real, A: Arithmetic<R>, const N: usize>(
    kernel: &Kernel<R, A>,
    v: R,
) -> R {
    let z = vector::<R, A, N>(kernel, v);
    let least: R = lit!(1e-37);
    let share = z[0] / kernel.dot::<N>(&z, &z).max(least);
    let weight = kernel.c[0] * z[0] * share;
    R::select(
        weight.lt(lit!(1e-3)),
        weight,
        weight_of::<R, A, N>(kernel, v),
    )
}

/// The weight of the negative side's roots together.
#[inline(always)]
pub(crate) fn weight<R: Real, A: Arithmetic<R>, const N: usize>(kernel: &Kernel<R, A>) -> R {
    let zero: R = lit!(0.0);
    let one: R = lit!(1.0);
    let weight = if const { N == 1 } {
        zero
    } else if const { N == 2 && A::TWICE } {
        weight_of::<R, A, N>(kernel, least_of_quadratic(&kernel.e))
    } else if const { N == 2 } {
        kernel.lesser_of_two(kernel.a[0], kernel.mean_square)
    } else if const { N == 3 } {
        weight_of::<R, A, N>(kernel, least_of_cubic(&kernel.e))
    } else {
        let (first, second, third) = if const { N == 4 } {
            let (first, second) = least_two::<R, 4, 3>(&kernel.e);
            (first, second, zero)
        } else if const { N == 5 } {
            let (first, second) = least_two::<R, 5, 4>(&kernel.e);
            (first, second, zero)
        } else {
            least_three(&kernel.e)
        };
        let (x, x_square) = freed::<R, A, N>(kernel, first);
        let (z, z_square) = freed::<R, A, N>(kernel, second);
        let (x_share, z_share) = (x[0] / x_square, z[0] / z_square);
        let single = kernel.c[0] * x[0] * x_share;
        // The length of the first axis' projection into the space of both vectors, which need
        // not be exactly orthogonal.
        let overlap = kernel.dot::<N>(&x, &z);
        let cosine = ((overlap / x_square) * (overlap / z_square)).min(lit!(0.5));
        let both = single + kernel.c[0] * z_share * (z[0] - x_share * overlap * lit!(2.0));
        let two = R::select(kernel.few.gt(one), both / (one - cosine), single);
        if const { N < 6 } {
            two
        } else {
            // What the third vector adds, without what it shares with that space.
            let (w, w_square) = freed::<R, A, N>(kernel, third);
            let by_x = kernel.dot::<N>(&w, &x);
            let by_z = kernel.dot::<N>(&w, &z) - by_x * (overlap / x_square);
            let z_rest = z_square * (one - cosine);
            let z_first = (z[0] - x_share * overlap) / z_rest;
            let first = w[0] - by_x * x_share - by_z * z_first;
            let shared =
                (by_x / x_square) * (by_x / w_square) + (by_z / z_rest) * (by_z / w_square);
            let rest = w_square * (one - shared.min(lit!(0.5)));
            let all = two + kernel.c[0] * first * (first / rest);
            R::select(kernel.few.gt(lit!(2.0)), all, two)
        }
    };
    R::select(kernel.few.gt(zero), weight.clamp(zero, kernel.others), zero)
}

/// The polynomial in the reciprocal, made monic, with its roots divided by the reach that is
/// returned with it.
#[inline(always)]
fn reversed<R: Real, const N: usize>(kernel: &[R; MAX + 1]) -> (Monic<R>, R) {
    let zero: R = lit!(0.0);
    let one: R = lit!(1.0);
    let half: R = lit!(0.5);
    let tiny: R = lit!(1e-30);
    let nearest = half / R::epsilon();
    let mut most = kernel[1].abs();
    unroll!(i in 2..(N + 1), max 7, {
        most = most.max(kernel[i].abs());
    });
    let per_first = one / kernel[0].max(most * tiny);
    let first = (kernel[1] * per_first).clamp(-nearest, nearest);
    let limit = nearest * nearest;
    let second = (kernel[2] * per_first).clamp(-limit, limit);
    let squares = (first * first - second * lit!(2.0)).max(zero);
    let reach = squares.sqrt().clamp(lit!(1e-6), nearest);
    let per_reach = one / reach;
    let largest: R = lit!(32.0);
    let mut e = [one; MAX + 1];
    let mut power = per_reach;
    unroll!(i in 1..(N + 1), max 7, {
        e[i] = (kernel[i] * per_first * power).clamp(-largest, largest);
        power *= per_reach;
    });
    (e, reach)
}
