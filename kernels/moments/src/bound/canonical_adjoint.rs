//! Derivatives of what depends on the points and weights of the distribution that attains the bounds.
//!
//! Points and weights are given by the moments: `own eta^k + Σ w_i x_i^k = m_k` for k from 0 to 2N. The
//! transposed system of its derivatives asks for a polynomial `λ` of degree 2N, of which the coefficients are
//! the gradient to the moments (\[MBD\], Eq. 22 to 30, are the same for the bounds). With upstream gradients
//! `g`, it is
//!
//! - `g_own` at the query point,
//! - `g_weight` at each other point, where
//! - its slope times the weight is the upstream gradient to the point.
//!
//! The query point moves only its own term and all distances, so that the derivative to it is
//! `Σ g_reciprocal v_i² - own λ'(eta)`, `v_i` being the reciprocal of the distance.
//!
//! In the reciprocal `v`, `P(v) = v^2N λ(1 / v)` has the value `v_i^2N g_weight` and that slope plus `g_reciprocal
//! v_i^2N / w_i`. The quotient is a sum of squares, of which one is 1 where `v_i` is 0: nothing is singular where
//! a point is at infinity. There, its weight is 0 and stays so, and the reciprocal has a derivative like any other.
//!
//! Newton's divided differences give the polynomial. Those of `v^2N` times the upstream gradients follow from both
//! by Leibniz' rule: gradients that are equal have differences of exactly 0. So a group of points that are close
//! together does no harm to a result that depends on their weight as a whole, as bounds do.

use hankel_dsl::{Real, lit, unroll};

use super::adjoint::Gradient;
use super::canonical::Canonical;
use super::kernel::Kernel;
use super::recurrence::{Recurrence, finite};
use super::roots::all;
use super::twofold::Plain;
use super::{MAX, MAX_MOMENTS};

/// The largest magnitude of a factor.
const LIMIT: f64 = 1e25;

#[inline(always)]
fn bounded<R: Real>(x: R) -> R {
    let limit: R = lit!(LIMIT);
    x.clamp(-limit, limit)
}

/// A point other than the query point, with its upstream gradients.
#[derive(Clone, Copy)]
struct Node<R> {
    /// The reciprocal of its distance, as the kernel has it: divided by the reach.
    v: R,
    /// Gradient to its weight, less that to the query point's.
    weight: R,
    /// Gradient to its reciprocal.
    reciprocal: R,
}

/// A node as a point of the projective line, `tau : t` with the larger of both 1: its reciprocal is `t / tau`.
#[derive(Clone, Copy)]
struct Place<R> {
    t: R,
    tau: R,
    /// `1 / tau`
    size: R,
}

/// The adjoint of [`canonical`](super::canonical): from the upstream gradient `d` to reciprocals, weights and own
/// weight, the gradient to moments and query point. What `d` has beyond N is not used.
///
/// Takes anything that [`canonical`](super::canonical) takes. Of a point at infinity the weight has the derivative
/// 0. Points that coincide, and weights of 0, are those of degenerate moments, which have no derivatives: there
/// they are those of points that are an epsilon of the reach apart, and of moments with pivots as large as their
/// rounding errors. Each factor of a derivative is limited to 1e25, a derivative to 1e37; an
/// upstream gradient above 1e12 counts as 0.
#[inline(always)]
pub fn canonical_adjoint<R: Real, const N: usize>(
    m: [R; MAX_MOMENTS],
    eta: R,
    d: Canonical<R>,
) -> Gradient<R> {
    const { assert!(N >= 1 && N <= MAX) }
    let zero: R = lit!(0.0);
    let one: R = lit!(1.0);
    let limit: R = lit!(LIMIT);
    let floor = R::epsilon() * lit!(0.25);
    let recurrence = Recurrence::<R, Plain<R>>::new::<N>(m, eta, floor);
    let kernel = Kernel::<R, Plain<R>>::new::<N>(&recurrence);
    let roots = all::<R, N>(&kernel.e);

    // λ times the lesser of the total and 1. For a small total, derivatives of reciprocals are in proportion to its
    // inverse, which comes last; for a large one, those to the query point are in proportion to it.
    let total = recurrence.total;
    let present = total.gt(zero);
    let small = R::select(present, total.min(one), one);
    let large = total.max(one);
    let upstream = |d: R| R::select(present, finite(d, lit!(1e12)), zero);
    let d_own = upstream(d.own) * small;
    let sign = R::select(kernel.turned, -one, one);
    let mut nodes = [Node {
        v: zero,
        weight: zero,
        reciprocal: zero,
    }; MAX];
    let mut of_distances = zero;
    unroll!(i in 0..N, max 7, {
        // A turned axis turns their order.
        let back = N - 1 - i;
        let weight = R::select(kernel.turned, d.weights[back], d.weights[i]);
        let reciprocal = R::select(kernel.turned, d.reciprocals[back], d.reciprocals[i]);
        let reciprocal = upstream(reciprocal) * sign;
        nodes[i] = Node {
            v: roots[i],
            weight: upstream(weight) * small - d_own,
            reciprocal,
        };
        of_distances += reciprocal * (roots[i] * roots[i]);
    });
    let nodes = from_afar::<R, N>(nodes);

    // A unit of length in which the points are on both sides of 1.
    let middle = if const { N == 1 } {
        one
    } else {
        nodes[const { N / 2 }].v.abs().max(R::epsilon())
    };
    let per_middle = one / middle;
    let reach = kernel.reach * middle;
    let per_length = reach * recurrence.per_unit;
    let mut places = [Place {
        t: zero,
        tau: one,
        size: one,
    }; MAX];
    let mut slopes = [zero; MAX];
    unroll!(i in 0..N, max 7, {
        let v = nodes[i].v * per_middle;
        let size = v.abs().max(one);
        let place = Place {
            t: v / size,
            tau: one / size,
            size,
        };
        let slope = (nodes[i].reciprocal / large * per_length).clamp(-limit, limit);
        let per_weight = per_weight::<R, N>(&kernel, place.tau / reach, place.t);
        slopes[i] = (slope * per_weight).clamp(-limit, limit);
        places[i] = place;
    });
    let mut q = interpolated::<R, N>(&nodes, &places, &slopes);

    // In powers of x - eta.
    let turned_length = sign * per_length;
    let mut power = turned_length;
    unroll!(i in 1..(2 * N + 1), max 13, {
        q[i] = (q[i].clamp(-limit, limit) * power).clamp(-limit, limit);
        power = (power * turned_length).clamp(-limit, limit);
    });
    let most: R = lit!(1e37);
    let reach = kernel.reach * recurrence.per_unit;
    let of_distances = (sign * of_distances * reach).clamp(-limit, limit) * reach;
    let of_own = kernel.own * q[1];
    let of_own = of_own * large.min(most / of_own.abs().max(one));
    let d_eta = (of_distances.clamp(-most, most) - of_own).clamp(-most, most);

    // In powers of x: Horner's scheme, repeated.
    q[0] = d_own;
    let eta = finite(eta, lit!(1e12));
    unroll!(j in 0..(2 * MAX), max 13, {
        unroll!(i in 0..(2 * MAX), max 13, {
            // Each time one coefficient less: from the highest but one down to j.
            if const { i + j < 2 * N } {
                let carried = q[2 * N - i] * eta;
                q[2 * N - 1 - i] = (q[2 * N - 1 - i] - carried).clamp(-limit, limit);
            }
        });
    });
    let per_small = one / small;
    let mut gradient = Gradient {
        m: [zero; MAX_MOMENTS],
        eta: d_eta,
    };
    unroll!(i in 0..(2 * N + 1), max 13, {
        gradient.m[i] = q[i] * per_small.min(most / q[i].abs().max(one));
    });
    gradient
}

/// The nodes by falling distance: so factors of high powers of reciprocals stay small. Those close together stay
/// neighbours, unless one at the same distance on the other side gets between.
#[inline(always)]
fn from_afar<R: Real, const N: usize>(mut nodes: [Node<R>; MAX]) -> [Node<R>; MAX] {
    unroll!(pass in 0..N, max 7, {
        unroll!(i in 0..(MAX - 1), max 7, {
            if const { i + 1 < N && (i + pass).is_multiple_of(2) } {
                let (a, b) = (nodes[i], nodes[i + 1]);
                let swap = b.v.abs().lt(a.v.abs());
                let pick = |a: R, b: R| R::select(swap, b, a);
                nodes[i] = Node {
                    v: pick(a.v, b.v),
                    weight: pick(a.weight, b.weight),
                    reciprocal: pick(a.reciprocal, b.reciprocal),
                };
                nodes[i + 1] = Node {
                    v: pick(b.v, a.v),
                    weight: pick(b.weight, a.weight),
                    reciprocal: pick(b.reciprocal, a.reciprocal),
                };
            }
        });
    });
    nodes
}

/// `t^2N` over the share of the total that the root at `s / t` has: the sum of all `(t^N p_k(s / t))² / h_k`.
#[inline(always)]
fn per_weight<R: Real, const N: usize>(kernel: &Kernel<R, Plain<R>>, s: R, t: R) -> R {
    let one: R = lit!(1.0);
    let limit: R = lit!(1e12);
    let least: R = lit!(1e-37);
    let mut z = [one; MAX + 1];
    z[1] = s - kernel.a[0] * t;
    unroll!(k in 1..N, max 7, {
        let next = (s - kernel.a[k] * t) * z[k] - kernel.b[k] * (t * t) * z[k - 1];
        z[k + 1] = next.clamp(-limit, limit);
    });
    let mut square = kernel.c[N] * (z[N] * z[N]);
    let mut power = t;
    unroll!(k in 0..N, max 7, {
        let z = z[N - 1 - k] * power;
        square += kernel.c[N - 1 - k] * (z * z);
        power *= t;
    });
    (square / kernel.c[0].max(least)).min(lit!(LIMIT))
}

/// The polynomial of degree 2N in distances that is 0 at the query point and has the nodes' values and slopes.
///
/// It is `Σ c_k u^(2N - k) Π (tau - t u)` over the first k nodes, each of them taken twice. All divided differences
/// are in proportion to the `size` of their nodes, which keeps them within range wherever these are.
#[inline(always)]
fn interpolated<R: Real, const N: usize>(
    nodes: &[Node<R>; MAX],
    places: &[Place<R>; MAX],
    slopes: &[R; MAX],
) -> [R; MAX_MOMENTS] {
    let zero: R = lit!(0.0);
    let one: R = lit!(1.0);

    // Divided differences of v^2N: complete homogeneous polynomials.
    let mut h = [zero; MAX_MOMENTS];
    let mut of_power = [zero; 2 * MAX];
    let mut c = [zero; 2 * MAX];
    let mut size = one;
    h[0] = one;
    unroll!(j in 0..(2 * N), max 13, {
        let place = places[const { j / 2 }];
        let v = place.t * place.size;
        add_variable::<R, N, j>(&mut h, v);
        of_power[j] = bounded(h[2 * N - j] * size);
        size = bounded(size * place.size);
        c[j] = of_power[j] * nodes[const { j / 2 }].weight;
    });

    // Reciprocals of differences; what is closer counts as an epsilon apart.
    let mut per_difference = [[zero; MAX]; MAX];
    unroll!(i in 0..N, max 7, {
        unroll!(j in 1..N, max 7, {
            if const { i < j } {
                let difference = places[i].tau * places[j].t - places[j].tau * places[i].t;
                let per_size = one / difference.abs().max(R::epsilon());
                per_difference[i][j] = R::select(difference.lt(zero), -per_size, per_size);
            }
        });
    });

    let mut differences = Differences {
        of_values: [zero; 2 * MAX],
        of_slopes: [zero; 2 * MAX],
    };
    unroll!(order in 1..(2 * N), max 13, {
        differences.raise::<N, order>(nodes, places, slopes, &per_difference);
        differences.add_to::<N, order>(&mut c, &of_power, places);
    });

    let mut q = [zero; MAX_MOMENTS];
    unroll!(i in 0..(2 * N), max 13, {
        // Multiplied by the factor of this node, and so of a degree more.
        let place = places[(2 * N - 1 - i) / 2];
        multiply::<R, i>(&mut q, &place);
        q[i + 1] += c[2 * N - 1 - i];
    });
    q
}

/// Puts one variable more into the complete homogeneous polynomials of J variables, of degrees up to 2N - J.
#[inline(always)]
fn add_variable<R: Real, const N: usize, const J: usize>(h: &mut [R; MAX_MOMENTS], v: R) {
    unroll!(degree in 1..(2 * MAX + 1), max 13, {
        if const { degree + J <= 2 * N } {
            h[degree] = bounded(h[degree] + v * h[degree - 1]);
        }
    });
}

/// Multiplies a polynomial of degree DEGREE by the factor of a node.
#[inline(always)]
fn multiply<R: Real, const DEGREE: usize>(q: &mut [R; MAX_MOMENTS], place: &Place<R>) {
    unroll!(j in 0..(DEGREE + 1), max 13, {
        q[DEGREE + 1 - j] = bounded(place.tau * q[DEGREE + 1 - j] - place.t * q[DEGREE - j]);
    });
}

/// Divided differences of the upstream gradients, by their first node: those to weights with slopes of near nodes,
/// and slopes of far ones, which are 0 at infinity with the weight.
struct Differences<R> {
    of_values: [R; 2 * MAX],
    of_slopes: [R; 2 * MAX],
}

impl<R: Real> Differences<R> {
    /// Those of ORDER from those of one less.
    #[inline(always)]
    fn raise<const N: usize, const ORDER: usize>(
        &mut self,
        nodes: &[Node<R>; MAX],
        places: &[Place<R>; MAX],
        slopes: &[R; MAX],
        per_difference: &[[R; MAX]; MAX],
    ) {
        let zero: R = lit!(0.0);
        let one: R = lit!(1.0);
        let Self {
            of_values,
            of_slopes,
        } = self;
        unroll!(first in 0..(2 * MAX - 1), max 13, {
            if const { first + ORDER < 2 * N } {
            let i = const { first / 2 };
            let k = const { (first + ORDER) / 2 };
            if const { ORDER == 1 && first.is_multiple_of(2) } {
                let is_near = places[i].size.gt(one);
                let slope = slopes[i] * places[i].size * places[i].size;
                of_values[first] = R::select(is_near, bounded(slope), zero);
                of_slopes[first] = R::select(is_near, zero, slopes[i]);
            } else if const { ORDER == 1 } {
                let step = nodes[k].weight - nodes[i].weight;
                of_values[first] = bounded(step * per_difference[i][k]);
                of_slopes[first] = zero;
            } else {
                let per = per_difference[i][k];
                let (tau_i, tau_k) = (places[i].tau, places[k].tau);
                let step = tau_k * of_values[first + 1] - tau_i * of_values[first];
                of_values[first] = bounded(step * per);
                let step = tau_k * of_slopes[first + 1] - tau_i * of_slopes[first];
                of_slopes[first] = bounded(step * per);
            }
            }
        });
    }

    /// Adds what those of ORDER contribute to the coefficients, by Leibniz' rule.
    #[inline(always)]
    fn add_to<const N: usize, const ORDER: usize>(
        &self,
        c: &mut [R; 2 * MAX],
        of_power: &[R; 2 * MAX],
        places: &[Place<R>; MAX],
    ) {
        unroll!(first in 0..(2 * MAX - 1), max 13, {
            if const { first + ORDER < 2 * N } {
                let tau = places[const { (first + ORDER) / 2 }].tau;
                let mut term = of_power[first] * (self.of_values[first] * tau);
                if const { first == 0 } {
                    term += self.of_slopes[0] * tau;
                }
                c[first + ORDER] = bounded(c[first + ORDER] + term);
            }
        });
    }
}
