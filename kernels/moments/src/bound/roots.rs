//! Roots of real-rooted polynomials, by as many steps for every input.
//!
//! Polynomials are monic and given by their other coefficients: `e[i]` belongs to
//! `v^(degree - i)`, `e[0]` is 1. Roots are expected in [-1, 1].

use hankel_dsl::{Mask, Real, apart, lit, unroll};

use super::MAX;

/// Coefficients of a monic polynomial, highest power first.
pub(crate) type Monic<R> = [R; MAX + 1];

/// The most steps of Laguerre's method towards a root. Near a root each is cubic, and three or four
/// are enough. Of a distant group of roots each only takes off a share of the distance, for four of five
/// roots five eighths, for five of six three fifths: so many steps go down to a rounding error of the largest root.
const STEPS: u32 = 18;
const STEPS_WIDE: u32 = 40;

/// A whole number up to 12 as an `$R`: `$k` is a constant. Without branches, which a compiler would have to remove at each
/// place.
macro_rules! whole {
    // Code that is never reached has differences below 0.
    ($R:ty, $k:tt - $less:tt) => {
        whole!($R, usize::saturating_sub($k, $less))
    };
    ($R:ty, $k:expr) => {
        whole!(@of $R, $k, 1 1.0, 2 2.0, 3 3.0, 4 4.0, 5 5.0, 6 6.0, 7 7.0, 8 8.0, 9 9.0, 10 10.0, 11 11.0, 12 12.0)
    };
    (@of $R:ty, $k:expr, $($value:literal $number:literal),*) => {{
        const { assert!($k <= 12, "whole! goes up to 12") };
        let mut number: $R = lit!(0.0);
        $(
            if const { $k == $value } {
                number = lit!($number);
            }
        )*
        number
    }};
}
pub(crate) use whole;

/// Value, first derivative and half the second derivative.
#[inline(always)]
fn value<R: Real, const DEGREE: usize>(e: &Monic<R>, v: R) -> (R, R, R) {
    let zero: R = lit!(0.0);
    let mut p = e[0];
    let mut d = zero;
    let mut h = zero;
    unroll!(i in 1..(DEGREE + 1), max 7, {
        h = h * v + d;
        d = d * v + p;
        p = p * v + e[i];
    });
    (p, d, h)
}

/// Value, and length of Laguerre's step. For a polynomial with real roots only, it never passes the next root
/// on the side that it is taken to (A. Householder, *The Numerical Treatment of a Single Nonlinear
/// Equation*, 1970, section 4.4).
#[inline(always)]
fn laguerre<R: Real, const DEGREE: usize>(e: &Monic<R>, v: R) -> (R, R) {
    let (p, d, h) = value::<R, DEGREE>(e, v);
    let zero: R = lit!(0.0);
    let less = whole!(R, DEGREE - 1);
    let least: R = lit!(1e-30);
    let square = less * (less * (d * d) - whole!(R, 2 * DEGREE) * (p * h));
    let length = whole!(R, DEGREE) * p.abs() / (d.abs() + square.max(zero).sqrt()).max(least);
    (p, length)
}

/// One step of Newton's method, kept within the bracket.
#[inline(always)]
fn newton<R: Real, const DEGREE: usize>(e: &Monic<R>, v: R, low: R, high: R) -> R {
    let (p, d, _) = value::<R, DEGREE>(e, v);
    let least: R = lit!(1e-30);
    let slope = R::select(d.abs().lt(least), least, d);
    (v - p / slope).clamp(low, high)
}

/// A way to a root, within limits.
#[derive(Clone, Copy)]
struct Way<R> {
    from: R,
    /// 1 or -1.
    direction: R,
    /// The polynomial's sign before the root: 1 or -1.
    sign: R,
    low: R,
    high: R,
}

/// One of Laguerre's steps along a way, and whether another follows it: not where the step is so short that another would
/// change nothing, nor where rounding has taken the last one past the root.
#[inline(always)]
fn step<R: Real, const DEGREE: usize>(
    e: &Monic<R>,
    way: Way<R>,
    v: R,
    goes_on: R::Mask,
) -> (R, R::Mask) {
    // The next step would be cubic in this one.
    let short: R = if const { R::IS_WIDE } {
        lit!(1e-9)
    } else {
        R::epsilon()
    };
    let (value, length) = laguerre::<R, DEGREE>(e, v);
    let goes_on = goes_on & (value * way.sign).gt(lit!(0.0));
    let next = (v + way.direction * length).clamp(way.low, way.high);
    let v = R::select(goes_on, next, v);
    (v, goes_on & length.gt(v.abs() * short))
}

/// Laguerre's steps towards one, two or three roots in one loop. The steps towards one root wait for each other: a processor
/// computes those towards another meanwhile.
///
/// Each lane stops on its own, so that its result does not depend on its neighbours.
macro_rules! approach {
    ($($(#[$doc:meta])* $name:ident -> $Roots:ty: $($way:ident $v:ident $goes_on:ident),*;)*) => {$(
        $(#[$doc])*
        #[inline(always)]
        fn $name<R: Real, const DEGREE: usize>(e: &Monic<R>, $($way: Way<R>),*) -> $Roots {
            let most = if const { R::IS_WIDE } { STEPS_WIDE } else { STEPS };
            let zero: R = lit!(0.0);
            $(
                let mut $v = $way.from;
                let mut $goes_on = zero.le(zero);
            )*
            let mut i = 0;
            while i < most {
                $(
                    if $goes_on.any() {
                        ($v, $goes_on) = step::<R, DEGREE>(e, $way, $v, $goes_on);
                    }
                )*
                i += 1;
            }
            [$($v),*]
        }
    )*};
}

approach! {
    /// To one root.
    approach -> [R; 1]: way v goes_on;
    /// To two roots.
    approach_two -> [R; 2]: down low goes_down, up high goes_up;
    /// To three roots.
    approach_three -> [R; 3]: down low goes_down, up middle goes_up, last high goes_on;
}

/// The least root, from the left: Laguerre's step from minus infinity, and then steps that never
/// pass it.
#[inline(always)]
fn from_outside<R: Real, const DEGREE: usize>(e: &Monic<R>) -> R {
    let zero: R = lit!(0.0);
    let one: R = lit!(1.0);
    let less = whole!(R, DEGREE - 1);
    let square = less * (less * (e[1] * e[1]) - whole!(R, 2 * DEGREE) * e[2]);
    let v = -(e[1] + square.max(zero).sqrt()) * (one / whole!(R, DEGREE));
    let sign = if const { DEGREE.is_multiple_of(2) } {
        one
    } else {
        -one
    };
    let way = Way {
        from: v,
        direction: one,
        sign,
        low: v,
        high: one,
    };
    approach::<R, DEGREE>(e, way)[0]
}

/// The least root of a quadratic, if it is negative; else 0.
#[inline(always)]
pub(crate) fn least_of_quadratic<R: Real>(e: &Monic<R>) -> R {
    let zero: R = lit!(0.0);
    let root = (e[1] * e[1] - e[2] * lit!(4.0)).max(zero).sqrt();
    let sum = (e[1].abs() + root) * lit!(0.5);
    let least: R = lit!(1e-30);
    R::select(e[1].gt(zero), -sum, e[2] / sum.max(least)).min(zero)
}

/// The least root of a cubic, if it is negative; else 0.
#[inline(always)]
pub(crate) fn least_of_cubic<R: Real>(e: &Monic<R>) -> R {
    let one: R = lit!(1.0);
    let zero: R = lit!(0.0);
    from_outside::<R, 3>(e).clamp(-one, zero)
}

/// The two least roots, where they are negative; else 0. DEGREE is 4 or 5, REDUCED one less.
///
/// Two roots that nearly coincide are told apart from between them: by the derivative's least
/// root, which such a pair encloses and which has no near neighbour itself.
#[inline(always)]
pub(crate) fn least_two<R: Real, const DEGREE: usize, const REDUCED: usize>(
    e: &Monic<R>,
) -> (R, R) {
    let one: R = lit!(1.0);
    let zero: R = lit!(0.0);
    let mut derivative = *e;
    unroll!(i in 1..(REDUCED + 1), max 7, {
        derivative[i] = e[i] * (whole!(R, DEGREE - i) / whole!(R, DEGREE));
    });
    let between = from_outside::<R, REDUCED>(&derivative).clamp(-one, zero);
    around::<R, DEGREE>(e, between)
}

/// The two least roots, where they are negative, from a point between them; else 0.
#[inline(always)]
fn around<R: Real, const DEGREE: usize>(e: &Monic<R>, between: R) -> (R, R) {
    let one: R = lit!(1.0);
    let zero: R = lit!(0.0);
    // Between both, the polynomial has the sign that it does not have on the left.
    let sign = if const { DEGREE.is_multiple_of(2) } {
        -one
    } else {
        one
    };
    let up = Way {
        from: between,
        direction: one,
        sign,
        low: -one,
        high: zero,
    };
    let down = Way {
        direction: -one,
        ..up
    };
    let [first, second] = approach_two::<R, DEGREE>(e, down, up);
    (first, second)
}

/// The three least roots of a polynomial of degree 6, where they are negative; else 0.
///
/// Its derivative's two least roots separate them. Each pair that nearly coincides is told apart from
/// between, as [`least_two`] does it; so are stationary points of three roots that are close together.
#[inline(always)]
pub(crate) fn least_three<R: Real>(e: &Monic<R>) -> (R, R, R) {
    let one: R = lit!(1.0);
    let zero: R = lit!(0.0);
    // Each from one product: of two constants in a row, compilers may make one that rounds otherwise.
    let (mut derivative, mut second) = (*e, *e);
    unroll!(i in 1..6, max 7, {
        derivative[i] = e[i] * (whole!(R, 6 - i) / whole!(R, 6));
        second[i] = e[i] * (whole!(R, 6 - i) * whole!(R, 5 - i) / lit!(30.0));
    });
    let between = from_outside::<R, 4>(&second).clamp(-one, zero);
    let (first, second) = around::<R, 5>(&derivative, between);
    let up = Way {
        from: first,
        direction: one,
        sign: -one,
        low: -one,
        high: zero,
    };
    let down = Way {
        direction: -one,
        ..up
    };
    let last = Way {
        from: second,
        sign: one,
        ..up
    };
    let [first, second, third] = approach_three::<R, 6>(e, down, up, last);
    (first, second, third)
}

/// All roots in ascending order: those of each derivative bracket those of the one before
/// (C. Yuksel, *High-Performance Polynomial Root Finding for Graphics*, 2022), here with Laguerre's
/// steps, which need no bisection.
#[inline(always)]
pub(crate) fn all<R: Real, const DEGREE: usize>(e: &Monic<R>) -> [R; MAX] {
    let mut roots = [lit!(0.0); MAX];
    unroll!(d in 1..(DEGREE + 1), max 7, {
        roots = of_derivative::<R, DEGREE, d>(e, &roots);
    });
    roots
}

/// The roots of the derivative of degree D, between its stationary points.
#[apart(R, if D > 2)]
#[inline(always)]
fn of_derivative<R: Real, const DEGREE: usize, const D: usize>(
    e: &Monic<R>,
    stationary: &[R; MAX],
) -> [R; MAX] {
    let one: R = lit!(1.0);
    let derivative = derivative::<R, DEGREE, D>(e);
    let mut roots = *stationary;
    if const { D == 1 } {
        roots[0] = -derivative[1];
        return roots;
    }
    unroll!(i in 0..D, max 7, {
        // From the stationary point above, or for the last one from that below.
        let low = if const { i == 0 } { -one } else { stationary[i - 1] };
        let high = if const { i + 1 == D } { one } else { stationary[i] };
        let (from, direction) = if const { i + 1 == D } {
            (low, one)
        } else {
            (high, -one)
        };
        // Above root i for all but the last, below that.
        let sign = if const { i + 1 == D || (D + i).is_multiple_of(2) } {
            -one
        } else {
            one
        };
        let way = Way {
            from,
            direction,
            sign,
            low: -one,
            high: one,
        };
        let [v] = approach::<R, D>(&derivative, way);
        roots[i] = newton::<R, D>(&derivative, v, low, high);
    });
    roots
}

/// The derivative of degree D: monic again.
#[inline(always)]
fn derivative<R: Real, const DEGREE: usize, const D: usize>(e: &Monic<R>) -> Monic<R> {
    let mut derivative = *e;
    unroll!(i in 1..(D + 1), max 7, {
        let mut ratio: R = lit!(1.0);
        unroll!(j in 0..i, max 7, {
            ratio *= whole!(R, D - j) / whole!(R, DEGREE - j);
        });
        derivative[i] = e[i] * ratio;
    });
    derivative
}
