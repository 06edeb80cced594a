//! The trigonometric moment problem with two complex moments (TMSM, m = 2).
//!
//! # Depths as angles
//! A depth z in [0, 1] is the angle 2πz (\[MSM\], Definition 13): the full circle, so 0 and 1 are
//! the same direction. They are not the same query point, though: nothing lies below 0. Therefore
//! a query point is given by half its angle, [`HalfAngle`].
//!
//! # The bound
//! The published solution inverts a 3x3 complex Toeplitz matrix. Sorted by real functions, the same
//! four numbers are the mean m and the covariance Σ of the points (cos 2πz, sin 2πz) in the plane,
//! and the matrix' kernel b*(x) B⁻¹ b(y), turned by its phase, is the real number
//!
//! K(x, y) = 1 + (x - m)ᵀ Σ⁻¹ (y - m).
//!
//! So 1/K(x, x) is the most that one direction can weigh; and y completes x to a canonical
//! representation (Proposition 16) if it is where the line K(x, y) = 0 meets the circle.
//!
//! Let s be the direction of depth 0 and q that of the query point. Wanted is the least share on
//! the open arc from s to q, and the optimum has points at s and q (Conjecture 17). Zeros of K(s, ·)
//! and of K(q, ·) alternate along the circle, hence there are three cases:
//!
//! - K(s, q) < 0: one further point x on the arc, one on its complement. By the published
//!   Equation 5 the weight at x is 1/w = K(x, x) - K(x, s) K(x, q) / K(s, q), here a sum of positive
//!   terms. The weights of s and q are not negative while x is between the zeros of K(q, ·) and of
//!   K(s, ·) on the arc. 1/w is the product of two functions of the form r cos(φ - φ0) - k, both
//!   positive there, and so its logarithm is concave: instead of the published quartic, Newton's
//!   method within brackets finds the one maximum, which may be at either end.
//! - K(s, q) >= 0, m on the arc's side of the chord from s to q: two further points on the arc. The
//!   share at s and q together is at most (A + C - 2D) / (AC - D²), with A = K(s, s),
//!   C = K(q, q), D = K(s, q); the published w3 is (C - D) / (AC - D²). If D exceeds the lesser of A
//!   and C, one of the two weights is 0 and the other is all.
//! - m on the other side: 0.
//!
//! The greatest share is 1 minus the least on the complement, by mirroring depths.
//!
//! [`trigonometric_4_compensated`] computes the same in about twice the digits. It is a source of its own: libraries of
//! functions are written from the plain one, which they need without generic arithmetic.

mod compensated;

use hankel_dsl::{Element, Real, lit, unroll};

pub use compensated::trigonometric_4_compensated;

use crate::bound::Bounds;
use crate::moments::{within, within_one};

/// Half the angle of a depth, πz for depth z, as a unit vector with `sin` >= 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HalfAngle<R> {
    cos: R,
    sin: R,
}

/// The first two trigonometric moments of a distribution of depths in [0, 1].
#[derive(Clone, Copy, Debug, PartialEq, Element)]
#[repr(C)]
pub struct TrigonometricMoments<R> {
    /// Mean of cos 2πz.
    pub c1: R,
    /// Mean of sin 2πz.
    pub s1: R,
    /// Mean of cos 4πz.
    pub c2: R,
    /// Mean of sin 4πz.
    pub s2: R,
}

/// Horner's scheme without a constant term, highest coefficient first.
macro_rules! series {
    ($y:expr; $first:expr, $($next:expr),*) => {{
        let mut sum = $y * lit!($first);
        $( sum = (sum + lit!($next)) * $y; )*
        sum
    }};
}

impl<R: Real> HalfAngle<R> {
    /// For a depth, which is clamped to [0, 1].
    ///
    /// Taylor series about the nearest of 0, 1/2 and 1, at most π/4 away, cut off where they leave
    /// 1e-19 for the sine and 3e-18 for the cosine: what remains is the rounding of either
    /// precision, at most 2 epsilon.
    #[inline(always)]
    pub fn of_depth(z: R) -> Self {
        let zero: R = lit!(0.0);
        let one: R = lit!(1.0);
        let z = within(z, zero, one);
        let is_low = z.lt(lit!(0.25));
        let is_high = z.gt(lit!(0.75));
        let center = R::select(is_low, zero, R::select(is_high, one, lit!(0.5)));
        let x = (z - center) * lit!(core::f64::consts::PI);
        let y = x * x;
        let sin = x + x * series!(y;
            1.0 / 355_687_428_096_000.0, -1.0 / 1_307_674_368_000.0, 1.0 / 6_227_020_800.0,
            -1.0 / 39_916_800.0, 1.0 / 362_880.0, -1.0 / 5040.0, 1.0 / 120.0, -1.0 / 6.0);
        let cos = one
            + series!(y;
            1.0 / 20_922_789_888_000.0, -1.0 / 87_178_291_200.0, 1.0 / 479_001_600.0,
            -1.0 / 3_628_800.0, 1.0 / 40_320.0, -1.0 / 720.0, 1.0 / 24.0, -0.5);
        Self {
            cos: R::select(is_low, cos, -R::select(is_high, cos, sin)),
            sin: R::select(is_low, sin, R::select(is_high, -sin, cos)),
        }
    }

    /// From a unit vector with `sin` >= 0.
    #[inline(always)]
    pub fn of_unit_vector(cos: R, sin: R) -> Self {
        Self { cos, sin }
    }

    /// For the direction of any vector with components in [-1e6, 1e6]; one in the lower half-plane
    /// is turned around. Of a vector that is 0 or not a number: some direction.
    #[inline(always)]
    pub fn of_vector(cos: R, sin: R) -> Self {
        let big: R = lit!(1e6);
        let (cos, sin) = (within(cos, -big, big), within(sin, -big, big));
        let is_lower = sin.lt(lit!(0.0));
        Self::normalized(
            R::select(is_lower, -cos, cos),
            R::select(is_lower, -sin, sin),
        )
    }

    /// cos πz.
    #[inline(always)]
    pub fn cos(self) -> R {
        self.cos
    }

    /// sin πz, never negative.
    #[inline(always)]
    pub fn sin(self) -> R {
        self.sin
    }

    /// For depth 1 - z.
    #[inline(always)]
    pub fn mirrored(self) -> Self {
        Self {
            cos: -self.cos,
            sin: self.sin,
        }
    }

    /// (cos 2πz, sin 2πz)
    #[inline(always)]
    pub fn direction(self) -> (R, R) {
        (
            (self.cos - self.sin) * (self.cos + self.sin),
            self.cos * self.sin * lit!(2.0),
        )
    }

    /// The inverse of [`direction`](Self::direction) for vectors about as long as 1.
    #[inline(always)]
    fn of_direction(x: R, y: R) -> Self {
        let zero: R = lit!(0.0);
        let is_right = x.gt(zero);
        // A bisector: (1 + x, y), or the same direction as (y, 1 - x), where it does not cancel.
        let far = x.abs() + lit!(1.0);
        let toward = R::select(y.ge(zero), far, -far);
        Self::normalized(
            R::select(is_right, toward, y),
            R::select(is_right, y.abs(), far),
        )
    }

    #[inline(always)]
    fn normalized(cos: R, sin: R) -> Self {
        let least = R::epsilon() * R::epsilon();
        let length = (cos * cos + sin * sin).max(least).sqrt();
        Self {
            cos: cos / length,
            sin: sin / length,
        }
    }

    /// Halfway.
    #[inline(always)]
    fn middle(self, other: Self) -> Self {
        Self::normalized(self.cos + other.cos, self.sin + other.sin)
    }

    /// Farther by `step`, an angle if it is small.
    #[inline(always)]
    fn turned(self, step: R) -> Self {
        Self::normalized(self.cos - step * self.sin, self.sin + step * self.cos)
    }

    /// Whether its angle is no larger.
    #[inline(always)]
    fn is_up_to(self, other: Self) -> R::Mask {
        (self.cos * other.sin - self.sin * other.cos).ge(lit!(0.0))
    }

    #[inline(always)]
    fn select(mask: R::Mask, a: Self, b: Self) -> Self {
        Self {
            cos: R::select(mask, a.cos, b.cos),
            sin: R::select(mask, a.sin, b.sin),
        }
    }
}

impl<R: Real> TrigonometricMoments<R> {
    /// The moments of a single depth, which is clamped to [0, 1].
    #[inline(always)]
    pub fn of_depth(z: R) -> Self {
        let (c1, s1) = HalfAngle::of_depth(z).direction();
        Self {
            c1,
            s1,
            c2: (c1 - s1) * (c1 + s1),
            s2: c1 * s1 * lit!(2.0),
        }
    }

    /// Those of depths 1 - z.
    #[inline(always)]
    pub fn mirrored(self) -> Self {
        Self {
            c1: self.c1,
            s1: -self.s1,
            c2: self.c2,
            s2: -self.s2,
        }
    }

    /// Mixed with `strength`, from 0 to 1, of the uniform distribution, all of whose moments are 0:
    /// the bias that is farthest from every boundary.
    #[inline(always)]
    pub fn biased(self, strength: R) -> Self {
        let rest = R::select(strength.ge(lit!(0.0)), strength.min(lit!(1.0)), lit!(0.0));
        let rest = -rest + lit!(1.0);
        Self {
            c1: self.c1 * rest,
            s1: self.s1 * rest,
            c2: self.c2 * rest,
            s2: self.s2 * rest,
        }
    }
}

/// A vector after a shear that makes the covariance diagonal.
#[derive(Clone, Copy)]
struct Sheared<R> {
    u: R,
    v: R,
}

/// The kernel K, by a Cholesky factorisation of the covariance.
#[derive(Clone, Copy)]
struct Kernel<R: Real> {
    /// The mean.
    x: R,
    y: R,
    /// Whether the first axis is y: the one with more variance.
    is_swapped: R::Mask,
    /// Of the second component on the first.
    slope: R,
    /// One over the variances of the components.
    p: R,
    q: R,
}

impl<R: Real> Kernel<R> {
    #[inline(always)]
    fn new(m: TrigonometricMoments<R>) -> Self {
        let one: R = lit!(1.0);
        let half: R = lit!(0.5);
        let (x, y) = (within_one(m.c1), within_one(m.s1));
        let (c2, s2) = (within_one(m.c2), within_one(m.s2));
        let xx = c2 * half + half - x * x;
        let yy = half - c2 * half - y * y;
        let xy = s2 * half - x * y;
        let is_swapped = yy.gt(xx);
        // Variances are lifted to the size of their own rounding errors.
        let first = R::select(is_swapped, yy, xx).max(R::epsilon() * lit!(0.25));
        let slope = (xy / first).clamp(-one, one);
        let second = R::select(is_swapped, xx, yy) - slope * xy;
        Self {
            x,
            y,
            is_swapped,
            slope,
            p: one / first,
            q: one / second.max(R::epsilon() * lit!(0.015625)),
        }
    }

    #[inline(always)]
    fn shear(&self, x: R, y: R) -> Sheared<R> {
        let u = R::select(self.is_swapped, y, x);
        let v = R::select(self.is_swapped, x, y);
        Sheared {
            u,
            v: v - self.slope * u,
        }
    }

    /// A point relative to the mean.
    #[inline(always)]
    fn at(&self, x: R, y: R) -> Sheared<R> {
        self.shear(x - self.x, y - self.y)
    }

    /// The product that Σ⁻¹ gives.
    #[inline(always)]
    fn product(&self, a: Sheared<R>, b: Sheared<R>) -> R {
        a.u * b.u * self.p + a.v * b.v * self.q
    }

    /// K for two points relative to the mean.
    #[inline(always)]
    fn value(&self, a: Sheared<R>, b: Sheared<R>) -> R {
        a.u * b.u * self.p + lit!(1.0) + a.v * b.v * self.q
    }

    /// 1 minus the product.
    #[inline(always)]
    fn rest(&self, a: Sheared<R>, b: Sheared<R>) -> R {
        -(a.u * b.u * self.p) + lit!(1.0) - a.v * b.v * self.q
    }

    /// The first direction, counterclockwise from `a` (`side` 1) or clockwise (-1), where K with
    /// `a` is 0.
    #[inline(always)]
    fn zero(&self, a: Sheared<R>, side: R) -> HalfAngle<R> {
        let one: R = lit!(1.0);
        let v = a.v * self.q;
        let u = a.u * self.p - self.slope * v;
        let x = R::select(self.is_swapped, v, u);
        let y = R::select(self.is_swapped, u, v);
        let length = (x * x + y * y).max(R::epsilon() * R::epsilon()).sqrt();
        // The line's distance from the center is the cosine of half the angle it cuts off.
        let cos = ((x * self.x - one + y * self.y) / length).clamp(-one, one);
        let (x, y) = (x / length, y / length);
        let sin = ((one - cos) * (one + cos)).sqrt() * side;
        HalfAngle::of_direction(cos * x - sin * y, cos * y + sin * x)
    }
}

/// The least and the greatest share below the depth of `query`, over all distributions of depths
/// in [0, 1] with trigonometric moments `m` (\[MSM\], section 7.4 of the supplement); both in
/// [0, 1]. At depth 0 nothing, and at depth 1 not the weight at 1.
///
/// Moments are clamped to [-1, 1]; ones that no distribution has give the bounds of a nearby
/// vector.
#[inline(always)]
pub fn trigonometric_4<R: Real>(m: TrigonometricMoments<R>, query: HalfAngle<R>) -> Bounds<R> {
    let above = trigonometric_4_lower(m.mirrored(), query.mirrored());
    let lower = trigonometric_4_lower(m, query);
    Bounds {
        lower,
        upper: (-above + lit!(1.0)).max(lower),
    }
}

/// The lower of [`trigonometric_4`]'s bounds alone.
#[inline(always)]
pub fn trigonometric_4_lower<R: Real>(m: TrigonometricMoments<R>, query: HalfAngle<R>) -> R {
    let zero: R = lit!(0.0);
    let one: R = lit!(1.0);
    let kernel = Kernel::new(m);
    let (x, y) = query.direction();
    let start = kernel.at(one, zero);
    let end = kernel.at(x, y);
    let a = kernel.value(start, start);
    let c = kernel.value(end, end);
    let d = kernel.value(start, end);
    // AC - D² as a sum of squares, and all three relative to A and C.
    let (u, v) = (start.u - end.u, start.v - end.v);
    let cross = start.u * end.v - start.v * end.u;
    let gram = (cross * cross * kernel.q + u * u) * kernel.p + v * v * kernel.q;
    let large = a.max(c);
    let small = a.min(c);
    let ratio = (small / large).sqrt();
    let scale = large.sqrt() * small.sqrt();
    let coherence = (d.abs() / scale).min(ratio);
    let incoherence = (gram / large / small).max(R::epsilon() * R::epsilon());
    let excess = one - ratio;
    let unequal = (excess / incoherence).min(one / (one + ratio)) * excess;
    let at_ends = (ratio * lit!(2.0) / (one + coherence) + unequal) / small;

    let is_on_arc = (query.cos * (kernel.x - one) + query.sin * kernel.y).gt(zero);
    let two = R::select(is_on_arc, one - at_ends.min(one), zero);
    let floor = scale * R::epsilon();
    let straddling = weight_on_arc(&kernel, start, end, d.abs().max(floor), query);
    R::select(d.lt(zero), straddling, two)
}

/// What the weight of a point on the arc is made of: 1/w = K(s, s) + K(s, start) / d * K(s, end).
struct OnArc<R> {
    start: Sheared<R>,
    end: Sheared<R>,
    d: R,
    /// K(s, start) / d and K(s, end) of the center of the directions, which is at minus the mean.
    center_start: R,
    center_end: R,
}

impl<R: Real> OnArc<R> {
    /// 1/w at a direction, and the first two derivatives of its logarithm. The second derivative of a direction
    /// points to the center.
    #[inline(always)]
    fn at(&self, kernel: &Kernel<R>, direction: HalfAngle<R>) -> (R, R, R) {
        let zero: R = lit!(0.0);
        let two: R = lit!(2.0);
        let (x, y) = direction.direction();
        let here = kernel.at(x, y);
        let tangent = kernel.shear(-y, x);
        let own = kernel.value(here, here);
        let to_start = kernel.value(here, self.start) / self.d;
        let to_end = kernel.value(here, self.end);
        let s = to_start.max(zero);
        let e = to_end.max(zero);
        let ds = kernel.product(tangent, self.start) / self.d;
        let de = kernel.product(tangent, self.end);
        let value = own + s * e;
        let slope = (kernel.product(tangent, here) * two + (s * de + e * ds)) / value;
        let outward = kernel.shear(x, y);
        let own_bend = (tangent.u * tangent.u - outward.u * here.u) * kernel.p
            + (tangent.v * tangent.v - outward.v * here.v) * kernel.q;
        let bend = (own_bend + ds * de) * two
            + (s * (self.center_end - to_end) + e * (self.center_start - to_start));
        (value, slope, bend / value - slope * slope)
    }
}

/// The least weight of the one point on the arc, where K(s, q) is -`d`.
#[inline(always)]
fn weight_on_arc<R: Real>(
    kernel: &Kernel<R>,
    start: Sheared<R>,
    end: Sheared<R>,
    d: R,
    query: HalfAngle<R>,
) -> R {
    let zero: R = lit!(0.0);
    let one: R = lit!(1.0);
    // 1/w is K(s, s) + K(s, start) / d * K(s, end). Its greatest value is searched by its logarithm's first two
    // derivatives; the second derivative of a direction points to the center, which is at minus the mean.
    let mean = kernel.shear(kernel.x, kernel.y);
    let arc = OnArc {
        start,
        end,
        d,
        center_start: kernel.rest(mean, start) / d,
        center_end: kernel.rest(mean, end),
    };
    // Rounding must not push the ends out of the arc, to the other end of the circle.
    let first = HalfAngle {
        cos: one,
        sin: zero,
    };
    let low = kernel.zero(end, -one);
    let high = kernel.zero(start, one);
    let low = HalfAngle::select(low.is_up_to(query), low, first);
    let high = HalfAngle::select(high.is_up_to(query), high, query);
    let (value_low, slope_low, _) = arc.at(kernel, low);
    let (value_high, slope_high, _) = arc.at(kernel, high);
    let mut greatest = value_low.max(value_high);
    let falls = slope_low.le(zero);
    let rises = slope_high.ge(zero) & !falls;
    let mut high = HalfAngle::select(falls, low, high);
    let mut low = HalfAngle::select(rises, high, low);
    let mut here = low.middle(high);
    // Nearly all are at rounding errors after two steps.
    unroll!(_i in 0..5, {
        let (value, slope, bend) = arc.at(kernel, here);
        greatest = greatest.max(value);
        let is_rising = slope.gt(zero);
        low = HalfAngle::select(is_rising, here, low);
        high = HalfAngle::select(is_rising, high, here);
        let is_bent = bend.lt(-R::epsilon());
        let step = slope / R::select(is_bent, -bend, one) * lit!(0.5);
        let next = here.turned(step.clamp(-one, one));
        let is_inside = is_bent & low.is_up_to(next) & next.is_up_to(high);
        here = HalfAngle::select(is_inside, next, low.middle(high));
    });
    one / greatest
}
