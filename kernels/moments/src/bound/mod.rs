//! Bounds for any even number of power moments up to twelve, with the total free (\[MBD\], Algorithm 1;
//! \[MSM\], Algorithm 2).
//!
//! Among all distributions with moments `m_0` to `m_2N`, the share below a query point is least and
//! greatest for one that consists of the query point and N others. It is found in two steps:
//!
//! 1. [`recurrence`]: the moments' three-term recurrence. It is the step that loses digits.
//! 2. [`kernel`]: the N points are roots of a polynomial. Only those on the side of the query point
//!    that has fewer are needed, at most three ([`roots`]), and weights follow from the recurrence as
//!    quotients of sums of squares: no Vandermonde system, no order to choose.
//!
//! Where the published algorithm has a root at infinity there is a reciprocal of 0 here.

mod adjoint;
mod canonical;
mod canonical_adjoint;
mod kernel;
mod recurrence;
mod roots;
mod twofold;

use hankel_dsl::{Real, lit};

pub use adjoint::{Gradient, bound_adjoint, bound_adjoint_compensated, mix_bias_adjoint};
pub use canonical::{Canonical, canonical, canonical_compensated};
pub use canonical_adjoint::canonical_adjoint;
use kernel::Kernel;
use recurrence::Recurrence;
pub(crate) use twofold::{Arithmetic, Plain, Twofold};

/// The largest N.
pub const MAX: usize = 6;
/// The length of a moment vector: the first 2N + 1 elements count.
pub const MAX_MOMENTS: usize = 2 * MAX + 1;

/// The least and the greatest amount that a distribution with given moments can have below a query
/// point, both from 0 to the total `m_0`; the greatest includes the query point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds<R> {
    /// Greatest lower bound.
    pub lower: R,
    /// Least upper bound.
    pub upper: R,
}

/// Whether an order's steps are so long that each is a function of its own natively, which kernels share, and has loops in
/// a shader. Natively, arguments in memory would cost a tenth of the time in plain arithmetic, and a fifth in twice the
/// digits for N = 3. In a shader, operations in a row would be up to 39 000, which no instruction cache holds.
const fn is_long<R: Real, A: Arithmetic<R>>(n: usize) -> bool {
    A::TWICE && n > 3
}

impl<R: Real> Bounds<R> {
    /// Between both: the lower one for `overestimation` 0, the upper one for 1.
    #[inline(always)]
    pub fn blend(self, overestimation: R) -> R {
        // Rounding must not leave the range.
        (self.lower + overestimation.saturate() * (self.upper - self.lower)).min(self.upper)
    }
}

/// The bounds at `eta` for moments `m_0` to `m_2N`, N from 1 to 6; the rest of `m` is not used.
///
/// Depths may be anywhere: their mean square from 1e-25 to 1e9, and the query point from -1e9 to 1e9; a query point
/// farther than that is moved there.
/// Anything is accepted: moments that no distribution has give the bounds
/// of others, what is not a number or beyond range (1e37, and 1e25 times the total; in `f64` 1e290 and 1e100) counts as
/// 0, and a total that is not positive gives 0.
#[inline(always)]
pub fn bound<R: Real, const N: usize>(m: [R; MAX_MOMENTS], eta: R) -> Bounds<R> {
    let floor = R::epsilon() * lit!(0.25);
    bounds::<R, Plain<R>, N>(&Recurrence::<R, Plain<R>>::new::<N>(m, eta, floor))
}

/// [`bound`] in about twice the digits of the number type wherever digits are lost: in the recurrence,
/// where tight surfaces lose most of them, and at the query point and at the roots, where the recurrence
/// cancels once more.
///
/// The error is a few roundings: within the range of [`bound`], at most four times what rounding each
/// argument and the result once does to the answer. That is measured, not proved, for rows of every kind
/// that a renderer meets, in `f32` and `f64`: `hankel stress` prints the worst of them. The total must be a normal
/// number: of a subnormal one, quotients lose digits. In `f32` tails must not be too long: coefficients of the recurrence
/// end at 1e7, 1e5, 6000, 1400 and 400 times the root of the mean square for N from 2 to 6. Depths whose logarithm is normal
/// with a variance of 0.6 are beyond that for N = 6.
#[inline(always)]
pub fn bound_compensated<R: Real, const N: usize>(m: [R; MAX_MOMENTS], eta: R) -> Bounds<R> {
    let floor = R::epsilon() * (R::epsilon() * R::epsilon());
    bounds::<R, Twofold<R>, N>(&Recurrence::<R, Twofold<R>>::new::<N>(m, eta, floor))
}

#[inline(always)]
fn bounds<R: Real, A: Arithmetic<R>, const N: usize>(recurrence: &Recurrence<R, A>) -> Bounds<R> {
    const { assert!(N >= 1 && N <= MAX) }
    let zero: R = lit!(0.0);
    let one: R = lit!(1.0);
    let kernel = Kernel::<R, A>::new::<N>(recurrence);
    let weight = kernel::weight::<R, A, N>(&kernel);
    let share = R::select(kernel.turned, kernel.others - weight, weight);
    // Mean and variance alone bound it (Cantelli); more moments never leave that, rounding does.
    let spread = recurrence.spread;
    let is_above = recurrence.a[0].rounded().lt(zero);
    let least = R::select(is_above, recurrence.rest, zero);
    let most = R::select(is_above, one, spread);
    let lower = share.clamp(least, most).saturate();
    let upper = (lower + kernel.own).min(one);
    Bounds {
        lower: lower * recurrence.total,
        upper: upper * recurrence.total,
    }
}

/// Moments `m` with a share `strength` of them, from 0 to 1, replaced by the moments of
/// `target`, a distribution with total 1: `(1 - strength) m + strength m_0 target` (\[MBD\],
/// Algorithm 1; \[MSM\], section 4.2). The total stays.
#[inline(always)]
pub fn mix_bias<R: Real, const N: usize>(
    m: [R; MAX_MOMENTS],
    target: [R; MAX_MOMENTS],
    strength: R,
) -> [R; MAX_MOMENTS] {
    let strength = strength.saturate();
    let mut mixed = m;
    hankel_dsl::unroll!(k in 1..(2 * N + 1), max 13, {
        mixed[k] = m[k].lerp(m[0] * target[k], strength);
    });
    mixed
}

/// The bias as \[MBD\], Algorithm 1, has it: `(1 - strength) m + strength target`, all moments alike.
/// With a target of total 1 the total becomes `(1 - strength) m_0 + strength`, whatever it was: for a
/// total of 1 this is [`mix_bias`], for a small one it is stronger. Kernels use [`mix_bias`], which is
/// the same for every unit of weight.
#[inline(always)]
pub fn mix_bias_and_total<R: Real, const N: usize>(
    m: [R; MAX_MOMENTS],
    target: [R; MAX_MOMENTS],
    strength: R,
) -> [R; MAX_MOMENTS] {
    let strength = strength.saturate();
    let mut mixed = m;
    hankel_dsl::unroll!(k in 0..(2 * N + 1), max 13, {
        mixed[k] = m[k].lerp(target[k], strength);
    });
    mixed
}

/// A distribution on [-1, 1] to mix in with [`mix_bias`]: its moments `m_0` to `m_2N`, `m_0` being 1.
///
/// For N = 2, 3, 4 the vectors published with \[MBOIT\] for 32-bit floats
/// ([`SYMMETRIC_4_32`](crate::bias::SYMMETRIC_4_32) and on), which \[MBD\] uses, too. None is
/// published for N = 1, 5 and 6: there, N + 1 equal weights at equal distances from -1 to 1, which is
/// this library's own choice.
#[inline(always)]
pub fn bias_target<R: Real, const N: usize>() -> [R; MAX_MOMENTS] {
    let mut target = [lit!(0.0); MAX_MOMENTS];
    target[0] = lit!(1.0);
    if const { N == 1 } {
        target[2] = lit!(1.0);
    } else if const { N == 2 } {
        target[2] = lit!(0.375);
        target[4] = lit!(0.375);
    } else if const { N == 3 } {
        target[2] = lit!(0.48);
        target[4] = lit!(0.451);
        target[6] = lit!(0.45);
    } else if const { N == 4 } {
        target[2] = lit!(0.75);
        target[4] = lit!(203.0 / 300.0);
        target[6] = lit!(0.63);
        target[8] = lit!(0.600_303_030_303_030_3);
    } else if const { N == 5 } {
        // The means of 1, 0.6 and 0.2, to the power of 2, 4, 6, 8 and 10.
        target[2] = lit!(7.0 / 15.0);
        target[4] = lit!(1.1312 / 3.0);
        target[6] = lit!(1.04672 / 3.0);
        target[8] = lit!(1.016_798_72 / 3.0);
        target[10] = lit!(1.006_046_72 / 3.0);
    } else {
        // Two sevenths of the sum of 1, 2/3 and 1/3, to the power of 2, 4, 6, 8, 10 and 12.
        target[2] = lit!(4.0 / 9.0);
        target[4] = lit!(28.0 / 81.0);
        target[6] = lit!(1588.0 / 5103.0);
        target[8] = lit!(13636.0 / 45927.0);
        target[10] = lit!(120_148.0 / 413_343.0);
        target[12] = lit!(1_071_076.0 / 3_720_087.0);
    }
    target
}
