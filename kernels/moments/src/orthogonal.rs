//! Six moments as what they say about orthogonal polynomials.

use hankel_dsl::{Real, lit, unroll};

use crate::Moments6;

/// The three-term recurrence of the polynomials that are orthogonal for six moments of depths in
/// [-1, 1]: p1 = x - a0, p2 = (x - a1) p1 - c1, p3 = (x - a2) p2 - c2 p1.
///
/// These are the Cholesky factors of the 4x4 Hankel matrix (\[BHS\], section 3 of the supplement):
/// the pivots are 1, c1, c1 c2, c1 c2 c3, and a1 = L21 - L10, a2 = L32 - L21. The advantage over
/// the factors themselves: whatever they are, as long as c1, c2, c3 are positive they belong to
/// *some* distribution, and for depths in [-1, 1] all of them are in [-1, 1]. So moments that
/// rounding has pushed out of bounds are taken back by a clamp.
#[derive(Clone, Copy)]
pub(crate) struct Recurrence<R> {
    pub a0: R,
    pub a1: R,
    pub a2: R,
    pub c1: R,
    pub c2: R,
    pub c3: R,
}

impl<R: Real> Recurrence<R> {
    #[inline(always)]
    pub fn new(m: Moments6<R>) -> Self {
        let Moments6 {
            b1,
            b2,
            b3,
            b4,
            b5,
            b6,
        } = m.clamped();
        let one: R = lit!(1.0);
        // Each positive quantity is lifted to the size of its own rounding errors.
        let epsilon = R::epsilon();
        let least = epsilon * epsilon;
        let pivot1 = (b2 - b1 * b1).max(epsilon * lit!(0.25)).min(one);
        let s12 = b3 - b1 * b2;
        let s13 = b4 - b1 * b3;
        let l21 = s12 / pivot1;
        let l31 = s13 / pivot1;
        let t22 = b4 - b2 * b2 - l21 * s12;
        let t23 = b5 - b2 * b3 - l21 * s13;
        let t33 = b6 - b3 * b3 - l31 * s13;
        let c2 = (t22 / pivot1).max(least / pivot1).min(one);
        let pivot2 = c2 * pivot1;
        let l32 = t23 / pivot2;
        let c3 = ((t33 - l32 * t23) / pivot2).max(least).min(one);
        Self {
            a0: b1,
            a1: (l21 - b1).clamp(-one, one),
            a2: (l32 - l21).clamp(-one, one),
            c1: pivot1,
            c2,
            c3,
        }
    }

    /// The coefficients taken back, one after another, to where all roots of p1, p2 and p3 are in
    /// [-1, 1]. The moments up to the fifth change by no more than rounding has changed them.
    ///
    /// In canonical moments u1, u2, ... (Dette and Studden, The Theory of Canonical Moments, 1997),
    /// with v = 1 - u, the coefficients are a0 = 2 u1 - 1, c1 = 4 u1 v1 u2, a1 = 2 (v1 u2 + v2 u3) - 1,
    /// c2 = 4 v2 u3 v3 u4 and a2 = 2 (v3 u4 + v4 u5) - 1, and they belong to a distribution on
    /// [-1, 1] if and only if all u are in [0, 1]. For each coefficient the u before its own are known.
    #[inline(always)]
    pub fn within_range(self) -> Self {
        let zero: R = lit!(0.0);
        let one: R = lit!(1.0);
        let two: R = lit!(2.0);
        let half: R = lit!(0.5);
        let least = R::epsilon() * R::epsilon();
        let Self { a0, .. } = self;
        // 4 u1 v1
        let most = ((one + a0) * (one - a0)).max(least);
        let c1 = self.c1.min(most);
        let u2 = c1 / most;
        let v2 = one - u2;
        let start = (one - a0) * half * u2;
        let a1 = self.a1.clamp(start * two - one, (start + v2) * two - one);

        let v2_u3 = ((one + a1) * half - start).max(zero).min(v2);
        let v3 = (v2 - v2_u3) / v2.max(least);
        let most = (v2_u3 * v3 * lit!(4.0)).max(least);
        let c2 = self.c2.min(most);
        let u4 = c2 / most;
        let v4 = one - u4;
        let start = v3 * u4;
        let a2 = self.a2.clamp(start * two - one, (start + v4) * two - one);
        Self {
            a1,
            a2,
            c1,
            c2,
            ..self
        }
    }
}

/// The positive root of s³ + a s² + b s - c with c >= 0, whose other roots are real and not
/// positive, by Laguerre's method.
///
/// From above it converges monotonically, to the third order. It starts at the smaller of two
/// bounds: Laguerre's own, from afar, and without the cube, which is near where another root is
/// much larger. Coefficients of any other cubic give some number that is not negative.
#[inline(always)]
pub(crate) fn positive_root<R: Real>(a: R, b: R, c: R) -> R {
    let zero: R = lit!(0.0);
    let one: R = lit!(1.0);
    let spread = (a * a - b * lit!(3.0)).max(zero).sqrt();
    let from_afar = (spread * lit!(2.0) - a) * lit!(1.0 / 3.0);
    // a s² + b s - c = 0, in the form that does not cancel.
    let root = (b * b + a.max(zero) * c * lit!(4.0)).sqrt() + b.abs();
    let is_falling = b.lt(zero);
    let top = R::select(is_falling, root, c * lit!(2.0));
    let bottom = R::select(is_falling, a * lit!(2.0), root);
    let has_bound = bottom.gt(top * (R::epsilon() * R::epsilon())) & a.gt(zero);
    let without_cube = top / R::select(has_bound, bottom, one);
    let mut s = R::select(has_bound, without_cube.min(from_afar), from_afar).max(zero);
    unroll!(_i in 0..4, {
        let p = ((s + a) * s + b) * s - c;
        let thrice = p * lit!(3.0);
        let slope = (s * lit!(3.0) + a * lit!(2.0)) * s + b;
        let half_bend = s * lit!(3.0) + a;
        let root = (slope * slope - thrice * half_bend).max(zero).sqrt();
        let denominator = slope.max(zero) + root * lit!(2.0);
        let is_steep = denominator.gt(p.abs() * R::epsilon());
        let step = thrice / R::select(is_steep, denominator, one);
        s = (s - R::select(is_steep, step, zero)).max(zero);
    });
    s
}
