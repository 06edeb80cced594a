//! [`trigonometric_4`](super::trigonometric_4) in about twice the digits wherever digits are lost.
//!
//! Where surfaces are tight, four steps cancel: the covariance, its factorisation, K near the directions where it is 0,
//! and the search for the maximum between two directions that nearly coincide.
//!
//! - Covariance, K, and the directions of depth 0 and of the query point are [`Twofold`]. So are the ends of the
//!   search, as roots of quadratic polynomials in the cotangent of half the angle.
//! - The search has a coordinate of its own: t is the tangent of half the angle from a direction amid its ends. The
//!   numerators of all that it needs are quadratic polynomials in t. Their coefficients are computed in twice the digits
//!   and then rounded; at the small t of a short search nothing cancels any more, so that its steps are plain.
//! - Where there is no such point on the arc, N = |q - s|² and M = AC - D² - N (by the metric Σ⁻¹, with A, C and D of
//!   the module above) give the share of what is neither at s nor at q: M / (M + N), without a difference.

use hankel_dsl::{Real, lit};

use super::TrigonometricMoments;
use crate::bound::{Arithmetic, Bounds, Twofold};
use crate::moments::{within, within_one};

/// A constant in twice the digits: the nearest `f64`, and what that leaves out.
macro_rules! fine {
    ($high:expr, $low:expr) => {
        if const { R::IS_WIDE } {
            Twofold::of_two(lit!($high), lit!($low))
        } else {
            Twofold::of_two(lit!($high), lit!($high - ($high as f32) as f64))
        }
    };
}

/// Horner's scheme, highest coefficient first.
macro_rules! series {
    ($y:expr; $first:expr, $($next:expr),*) => {{
        let mut sum: R = lit!($first);
        $( sum = sum * $y + lit!($next); )*
        sum
    }};
}

/// Steps of Newton's method. Nearly all rows are at rounding errors after two, one of a few ten thousand needs five in
/// `f32` and six in `f64`.
const STEPS: u32 = 6;
const STEPS_WIDE: u32 = 8;

/// [`trigonometric_4`](super::trigonometric_4) for a depth `z`, clamped to [0, 1], in about twice the digits wherever
/// digits are lost.
///
/// The error is at most four times what rounding each argument and the result once does to the answer. That is
/// measured, not proved, for rows of every kind that a renderer meets, in `f32` and `f64`.
#[inline(always)]
pub fn trigonometric_4_compensated<R: Real>(m: TrigonometricMoments<R>, z: R) -> Bounds<R> {
    let zero: R = lit!(0.0);
    let one: R = lit!(1.0);
    let kernel = Kernel::new(m);
    let query = Half::of_depth(z);
    // From s to q, over twice the sine of half the angle: a unit vector, also where they coincide.
    let across = kernel.shear(query.sin.scaled(-one), query.cos);
    let length = query.sin.scaled(lit!(2.0)).times(query.per_square());
    let start = kernel.start;
    let end = Sheared {
        u: start.u.plus(across.u.times(length)),
        v: start.v.plus(across.v.times(length)),
    };
    let by_start = kernel.form(start);
    let by_end = kernel.form(end);
    let start_square = by_start.product(start);
    let end_square = by_end.product(end).rounded();
    let a = Twofold::of(one).plus(start_square);
    let d = Twofold::of(one).plus(by_start.product(end));
    let start_square = start_square.rounded();

    // The share that is not at s and q. A - D and C - D are negative where one of both weighs nothing.
    let is_at_start = by_start.product(across).rounded().ge(zero);
    let is_at_end = by_end.product(across).rounded().le(zero);
    let (u, v) = (across.u.rounded(), across.v.rounded());
    let (p, q) = (kernel.p.rounded(), kernel.q.rounded());
    let cross = start.u.cross(across.v, start.v, across.u).rounded();
    let of_one = R::select(is_at_start, start_square, end_square);
    let is_of_one = is_at_start | is_at_end;
    let rest = R::select(is_of_one, of_one, cross * p * (cross * q));
    let others = rest / (rest + R::select(is_of_one, one, u * u * p + v * v * q));

    // Of the mean from s, across the chord.
    let (x, y) = kernel.mean;
    let beyond = query.cos.cross(x, query.cos, Twofold::of(one));
    let is_on_arc = beyond.plus(query.sin.times(y)).rounded().gt(zero);
    let is_straddled = d.rounded().lt(zero);
    let floor = (start_square + one).sqrt() * (end_square + one).sqrt() * R::epsilon();
    let arcs = Arcs {
        kernel,
        by_start,
        by_end,
        a,
        d: d.scaled(-one).at_least(floor),
    };
    let below = R::select(is_on_arc, others, zero);
    let above = R::select(is_on_arc, zero, others);
    let lower = R::select(is_straddled, arcs.weight(query, one), below);
    let above = R::select(is_straddled, arcs.weight(query.mirrored(), -one), above);
    Bounds {
        lower,
        upper: (one - above).max(lower),
    }
}

/// Half the angle of a direction: πz for depth z. A vector of any length but 0.
#[derive(Clone, Copy)]
struct Half<R> {
    cos: Twofold<R>,
    sin: Twofold<R>,
}

impl<R: Real> Half<R> {
    /// For a depth, which is clamped to [0, 1], by the series of [`HalfAngle`](super::HalfAngle). Its length is 1 but
    /// for about a hundredth of a rounding.
    #[inline(always)]
    fn of_depth(z: R) -> Self {
        let zero: R = lit!(0.0);
        let one: R = lit!(1.0);
        let z = within(z, zero, one);
        let is_low = z.lt(lit!(0.25));
        let is_high = z.gt(lit!(0.75));
        let center = R::select(is_low, zero, R::select(is_high, one, lit!(0.5)));
        // The difference is exact.
        let pi: Twofold<R> = fine!(core::f64::consts::PI, 1.224_646_799_147_353_2e-16);
        let x = pi.times_plain(z - center);
        let square = x.times(x);
        let y = square.rounded();
        let sixth: Twofold<R> = fine!(1.0 / 6.0, 9.251_858_538_542_97e-18);
        let rest = y
            * y
            * series!(y;
            1.0 / 355_687_428_096_000.0, -1.0 / 1_307_674_368_000.0, 1.0 / 6_227_020_800.0,
            -1.0 / 39_916_800.0, 1.0 / 362_880.0, -1.0 / 5040.0, 1.0 / 120.0);
        let ratio = Twofold::of(one).minus(square.times(sixth));
        let sin = x.times(ratio.plus(Twofold::of(rest)));
        let rest = y
            * y
            * series!(y;
            1.0 / 20_922_789_888_000.0, -1.0 / 87_178_291_200.0, 1.0 / 479_001_600.0,
            -1.0 / 3_628_800.0, 1.0 / 40_320.0, -1.0 / 720.0, 1.0 / 24.0);
        let cos = Twofold::of(one).minus(square.scaled(lit!(0.5)));
        let cos = cos.plus(Twofold::of(rest));
        let minus = |x: Twofold<R>| x.scaled(-one);
        Self {
            cos: Twofold::select(is_low, cos, minus(Twofold::select(is_high, cos, sin))),
            sin: Twofold::select(is_low, sin, Twofold::select(is_high, minus(sin), cos)),
        }
    }

    /// One over the square of its length, which must be 1 but for a few roundings.
    #[inline(always)]
    fn per_square(self) -> Twofold<R> {
        let one: R = lit!(1.0);
        let square = self.cos.sum_of_products(self.cos, self.sin, self.sin);
        Twofold::of_two(one, -square.minus(Twofold::of(one)).rounded())
    }

    #[inline(always)]
    fn mirrored(self) -> Self {
        Self {
            cos: self.cos.scaled(lit!(-1.0)),
            sin: self.sin,
        }
    }

    /// Whether its angle is no larger.
    #[inline(always)]
    fn is_up_to(self, other: Self) -> R::Mask {
        let cross = self.cos.cross(other.sin, self.sin, other.cos);
        cross.rounded().ge(lit!(0.0))
    }

    /// Of length 1, rounded.
    #[inline(always)]
    fn unit(self) -> (R, R) {
        normalized(self.cos.rounded(), self.sin.rounded())
    }

    /// The tangent of its angle from a unit vector.
    #[inline(always)]
    fn from(self, (cos, sin): (R, R)) -> R {
        let most: R = lit!(1024.0);
        let cross = self.sin.times_plain(cos).minus(self.cos.times_plain(sin));
        let along = self.cos.rounded() * cos + self.sin.rounded() * sin;
        let cross = cross.rounded();
        let least = cross.abs() * lit!(1.0 / 1024.0);
        (cross / along.max(least.max(lit!(1e-37)))).clamp(-most, most)
    }

    #[inline(always)]
    fn select(mask: R::Mask, a: Self, b: Self) -> Self {
        Self {
            cos: Twofold::select(mask, a.cos, b.cos),
            sin: Twofold::select(mask, a.sin, b.sin),
        }
    }
}

#[inline(always)]
fn normalized<R: Real>(x: R, y: R) -> (R, R) {
    let least: R = lit!(1e-37);
    let length = (x * x + y * y).max(least).sqrt();
    (x / length, y / length)
}

/// A vector after a shear that makes the covariance diagonal.
#[derive(Clone, Copy)]
struct Sheared<R> {
    u: Twofold<R>,
    v: Twofold<R>,
}

/// The linear function of a vector that Σ⁻¹ makes of another one.
#[derive(Clone, Copy)]
struct Form<R>(Sheared<R>);

impl<R: Real> Form<R> {
    #[inline(always)]
    fn product(self, a: Sheared<R>) -> Twofold<R> {
        a.u.sum_of_products(self.0.u, a.v, self.0.v)
    }
}

/// The kernel K, by a Cholesky factorisation of the covariance.
#[derive(Clone, Copy)]
struct Kernel<R: Real> {
    mean: (Twofold<R>, Twofold<R>),
    /// Whether the first axis is y: the one with more variance.
    is_swapped: R::Mask,
    /// Of the second component on the first.
    slope: Twofold<R>,
    /// One over the variances of the components.
    p: Twofold<R>,
    q: Twofold<R>,
    /// The direction of depth 0, relative to the mean.
    start: Sheared<R>,
}

impl<R: Real> Kernel<R> {
    #[inline(always)]
    fn new(m: TrigonometricMoments<R>) -> Self {
        let one: R = lit!(1.0);
        let half: R = lit!(0.5);
        let fine_one = Twofold::of(one);
        let (x, y) = (Twofold::of(within_one(m.c1)), Twofold::of(within_one(m.s1)));
        let (c2, s2) = (Twofold::of(within_one(m.c2)), Twofold::of(within_one(m.s2)));
        let xx = fine_one.plus(c2).scaled(half).minus(x.times(x));
        let yy = fine_one.minus(c2).scaled(half).minus(y.times(y));
        let xy = s2.scaled(half).minus(x.times(y));
        let is_swapped = yy.rounded().gt(xx.rounded());
        // Below what rounding leaves of moments whose bounds it does not decide about.
        let floor = R::epsilon() * R::epsilon();
        let first = Twofold::select(is_swapped, yy, xx).at_least(floor);
        let slope = xy.over(first).within(-one, one);
        let second = Twofold::select(is_swapped, xx, yy).minus(slope.times(xy));
        let origin = Sheared {
            u: fine_one,
            v: fine_one,
        };
        let mut kernel = Self {
            mean: (x, y),
            is_swapped,
            slope,
            p: fine_one.over(first),
            q: fine_one.over(second.at_least(floor)),
            start: origin,
        };
        kernel.start = kernel.shear(fine_one.minus(x), y.scaled(-one));
        kernel
    }

    #[inline(always)]
    fn shear(&self, x: Twofold<R>, y: Twofold<R>) -> Sheared<R> {
        let u = Twofold::select(self.is_swapped, y, x);
        let v = Twofold::select(self.is_swapped, x, y);
        Sheared {
            u,
            v: v.minus(self.slope.times(u)),
        }
    }

    #[inline(always)]
    fn form(&self, a: Sheared<R>) -> Form<R> {
        Form(Sheared {
            u: a.u.times(self.p),
            v: a.v.times(self.q),
        })
    }
}

/// K with one of its arguments, as a quadratic form of the other one's half angle: `start` cos² + 2 `mixed` cos sin +
/// `west` sin².
#[derive(Clone, Copy)]
struct Quadratic<R> {
    start: Twofold<R>,
    mixed: Twofold<R>,
    west: Twofold<R>,
}

impl<R: Real> Quadratic<R> {
    /// `start` is K at depth 0; seen counterclockwise (`side` 1) or clockwise (-1).
    #[inline(always)]
    fn new(kernel: &Kernel<R>, form: Form<R>, start: Twofold<R>, side: R) -> Self {
        let Form(Sheared { u, v }) = form;
        let u = u.minus(kernel.slope.times(v));
        let x = Twofold::select(kernel.is_swapped, v, u);
        let y = Twofold::select(kernel.is_swapped, u, v);
        Self {
            start,
            mixed: y.scaled(side),
            west: start.minus(x.scaled(lit!(2.0))),
        }
    }

    #[inline(always)]
    fn scaled(self, by: R) -> Self {
        Self {
            start: self.start.scaled(by),
            mixed: self.mixed.scaled(by),
            west: self.west.scaled(by),
        }
    }

    /// The first half angle, from 0 on, where it is 0. It must be positive at 0.
    #[inline(always)]
    fn zero(self) -> Half<R> {
        let zero: R = lit!(0.0);
        let Self { start, mixed, west } = self;
        let disk = mixed.cross(mixed, start, west).at_least(zero);
        let root = disk.rounded().sqrt();
        let rest = disk.minus(Twofold::of(root).times_plain(root)).rounded();
        let rest = rest / (root + root).max(lit!(1e-18));
        let root = Twofold::of(root).plus(Twofold::of(rest));
        // The greater root of the cotangent, without cancellation.
        let is_falling = mixed.rounded().gt(zero);
        Half {
            cos: Twofold::select(is_falling, west.scaled(lit!(-1.0)), root.minus(mixed)),
            sin: Twofold::select(is_falling, mixed.plus(root), start),
        }
    }

    /// Of the half angle b + t b', times `by`: a polynomial in t. `x` and `y` are the direction of b.
    #[inline(always)]
    fn about(self, x: Twofold<R>, y: Twofold<R>, by: R) -> Polynomial<R> {
        let half: R = lit!(0.5);
        let center = self.start.plus(self.west).scaled(half);
        let along = self.start.minus(self.west).scaled(half);
        let there = along.sum_of_products(x, self.mixed, y);
        let across = self.mixed.cross(x, along, y);
        Polynomial {
            value: center.plus(there).rounded() * by,
            slope: across.rounded() * by * lit!(2.0),
            bend: center.minus(there).rounded() * by,
        }
    }
}

/// `value` + `slope` t + `bend` t².
#[derive(Clone, Copy)]
struct Polynomial<R> {
    value: R,
    slope: R,
    bend: R,
}

impl<R: Real> Polynomial<R> {
    #[inline(always)]
    fn at(self, t: R) -> (R, R) {
        let bent = self.bend * t;
        (
            self.value + t * (self.slope + bent),
            self.slope + bent * lit!(2.0),
        )
    }
}

/// What the weight of a point on an arc is made of, by powers of the tangent of half its angle from the middle.
struct OnArc<R> {
    /// The direction relative to the mean, in the kernel's axes, over 1 + t².
    u: Polynomial<R>,
    v: Polynomial<R>,
    /// K with the start, over K of start and end, and with the end.
    s: Polynomial<R>,
    e: Polynomial<R>,
    /// The kernel's factors of u² and v².
    p: R,
    q: R,
}

impl<R: Real> OnArc<R> {
    /// 1/w, and the first two derivatives of its logarithm.
    #[inline(always)]
    fn at(&self, t: R) -> (R, R, R) {
        let zero: R = lit!(0.0);
        let one: R = lit!(1.0);
        let two: R = lit!(2.0);
        let w = t * t + one;
        let (u0, u1) = self.u.at(t);
        let (v0, v1) = self.v.at(t);
        let (s0, s1) = self.s.at(t);
        let (e0, e1) = self.e.at(t);
        let (s0, e0) = (s0.max(zero), e0.max(zero));
        let own = u0 * u0 * self.p + w * w + v0 * v0 * self.q;
        let value = own + s0 * e0;
        let own_slope = u0 * u1 * self.p + t * w * two + v0 * v1 * self.q;
        let slope = (own_slope * two + (s0 * e1 + s1 * e0)) / value;
        let own_bend = (u1 * u1 + u0 * self.u.bend * two) * self.p
            + (t * t * lit!(4.0) + w * two)
            + (v1 * v1 + v0 * self.v.bend * two) * self.q;
        let bend = own_bend * two + (s0 * self.e.bend + self.s.bend * e0 + s1 * e1) * two;
        // By half the angle, of which the derivative is 1 + t²; and all is over (1 + t²)².
        let bend = (bend / value - slope * slope) * w + t * slope * two;
        (
            value / (w * w),
            slope * w - t * lit!(4.0),
            bend * w - w * lit!(4.0),
        )
    }
}

/// Both arcs between depth 0 and a query point.
struct Arcs<R: Real> {
    kernel: Kernel<R>,
    by_start: Form<R>,
    by_end: Form<R>,
    /// K(s, s)
    a: Twofold<R>,
    /// -K(s, q)
    d: Twofold<R>,
}

impl<R: Real> Arcs<R> {
    /// The least weight of the one point on an arc from depth 0 on: counterclockwise to `query` (`side` 1), or
    /// clockwise, where `query` is the mirrored one (-1).
    #[inline(always)]
    fn weight(&self, query: Half<R>, side: R) -> R {
        let zero: R = lit!(0.0);
        let one: R = lit!(1.0);
        let two: R = lit!(2.0);
        let kernel = &self.kernel;
        let to_start = Quadratic::new(kernel, self.by_start, self.a, side);
        let to_end = Quadratic::new(kernel, self.by_end, self.d.scaled(-one), side);
        // Rounding must not push the ends out of the arc, to the other end of the circle.
        let first = Half {
            cos: Twofold::of(one),
            sin: Twofold::of(zero),
        };
        let low = to_end.scaled(-one).zero();
        let high = to_start.zero();
        let low = Half::select(low.is_up_to(query), low, first);
        let high = Half::select(high.is_up_to(query), high, query);
        // The middle. It may be anywhere near; where it is counts.
        let (low_unit, high_unit) = (low.unit(), high.unit());
        let middle = normalized(low_unit.0 + high_unit.0, low_unit.1 + high_unit.1);
        let (low, high) = (low.from(middle), high.from(middle));
        let (cos, sin) = middle;
        let (fine_cos, fine_sin) = (Twofold::of(cos), Twofold::of(sin));
        let middle = Half {
            cos: fine_cos,
            sin: fine_sin,
        };
        let per_square = middle.per_square();
        let x = fine_cos
            .cross(fine_cos, fine_sin, fine_sin)
            .times(per_square);
        let y = fine_cos.times(fine_sin).scaled(two).times(per_square);

        // In powers of t, all over 1 + t²: the direction relative to the mean, and K with s and with q.
        let s = to_start.about(x, y, one / self.d.rounded());
        let e = to_end.about(x, y, one);
        let y = y.scaled(side);
        let (mean_x, mean_y) = kernel.mean;
        let value = kernel.shear(x.minus(mean_x), y.minus(mean_y));
        let slope = kernel.shear(y.scaled(-two * side), x.scaled(two * side));
        let bend = kernel.shear(x.plus(mean_x), y.plus(mean_y));
        let arc = OnArc {
            u: Polynomial {
                value: value.u.rounded(),
                slope: slope.u.rounded(),
                bend: -bend.u.rounded(),
            },
            v: Polynomial {
                value: value.v.rounded(),
                slope: slope.v.rounded(),
                bend: -bend.v.rounded(),
            },
            s,
            e,
            p: kernel.p.rounded(),
            q: kernel.q.rounded(),
        };
        let (value_low, slope_low, _) = arc.at(low);
        let (value_high, slope_high, _) = arc.at(high);
        let mut greatest = value_low.max(value_high).max(one);
        let falls = slope_low.le(zero);
        let rises = slope_high.ge(zero) & !falls;
        let mut high = R::select(falls, low, high);
        let mut low = R::select(rises, high, low);
        let half: R = lit!(0.5);
        let mut t = (low + high) * half;
        let steps = if const { R::IS_WIDE } {
            STEPS_WIDE
        } else {
            STEPS
        };
        let mut i = 0;
        while i < steps {
            let (value, slope, bend) = arc.at(t);
            greatest = greatest.max(value);
            let is_rising = slope.gt(zero);
            low = R::select(is_rising, t, low);
            high = R::select(is_rising, high, t);
            let is_bent = bend.lt(-R::epsilon());
            let step = slope / R::select(is_bent, -bend, one);
            // The tangent of the sum, of a small step.
            let rest = one - t * step;
            let next = (t + step) / rest.max(R::epsilon());
            let is_inside = is_bent & rest.gt(zero) & low.le(next) & next.le(high);
            t = R::select(is_inside, next, (low + high) * half);
            i += 1;
        }
        one / greatest
    }
}
