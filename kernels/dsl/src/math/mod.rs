//! Elementary functions, with the same bits on every backend.
//!
//! They are written in sums, products and operations on bits, so that a device has no say in them:
//! on every route that keeps to arithmetic as it is written (a kernel that is `pinned` or `exact`),
//! the result has the same bits as natively, scalar or in lanes. Where a shader's compiler may
//! reorder sums it is at most 2 ulp from the true value. Natively, of `f32`:
#![doc = include_str!("accuracy.md")]
//!
//! The table says of which arguments: all 2^32 of them, or a part
//! (`cargo test --release -p hankel-dsl --test elementary -- --ignored` takes all); functions of two are
//! sampled. Of `f64`, 1 ulp at most, on a sample. Denormal numbers are arguments and results as all
//! others are; a device that flushes them gets zero. What is outside of a function's domain gives NaN
//! natively and in SPIR-V; languages that know no NaN (WGSL) promise nothing of it.
//!
//! They are functions, not methods: `x.sin()` of an `f32` is the standard library's where that is
//! linked, and another function on another machine. Each takes an `f32`, an `f64` or a kernel's
//! `R: Elementary`; a vector's components go through `v.map(math::sin)`.
//!
//! [`native`] has the device's own instructions: faster, and as wrong as each language allows.
//!
//! ```
//! use hankel_dsl::math;
//! assert_eq!(math::atan2(1.0_f32, 1.0), core::f32::consts::FRAC_PI_4);
//! assert_eq!(math::pow(2.0_f32, 0.5), core::f32::consts::SQRT_2);
//! ```
//!
//! Lengths, dot and cross products, `normalize`, `distance`, `reflect` and `refract` are methods of
//! [`glam`]'s vectors; they use `+ - * /` and `sqrt` alone.

mod exponential;
mod inverse;
pub mod native;
mod polynomials;
mod power;
mod primitives;
mod reduce;
mod rounding;
mod trigonometric;

pub use exponential::{cosh, exp, exp_m1, exp2, sinh, tanh};
pub use inverse::{acos, asin, atan, atan2};
pub use power::{cbrt, ln, ln_1p, log2, pow};
pub use primitives::Elementary;
pub use rounding::{ceil, floor, fma, fract, mix, round, sign, smoothstep, step, trunc};
pub use trigonometric::{cos, sin, sin_cos, tan};

use crate::{Real, lit};

/// Between `low` and `high`. Unlike [`Real::clamp`] it keeps a NaN natively.
#[inline(always)]
fn bounded<R: Real>(x: R, low: R, high: R) -> R {
    R::select(x.lt(low), low, R::select(x.gt(high), high, x))
}

/// The sum of two numbers of which the first is not the smaller one, and what rounding took off.
#[inline(always)]
fn ordered_sum<R: Real>(large: R, small: R) -> (R, R) {
    let sum = large + small;
    (sum, (large - sum) + small)
}

/// The reciprocal of a positive number from 2^-100 to 2^100, within 2 ulp (Newton).
#[inline(always)]
fn reciprocal<R: Elementary>(x: R) -> R {
    let mut y = x.reciprocal_seed();
    y = y * (R::literal::<TWO>() - x * y);
    y = y * (R::literal::<TWO>() - x * y);
    y = y * (R::literal::<TWO>() - x * y);
    if R::IS_WIDE {
        y = y * (R::literal::<TWO>() - x * y);
        y = y * (R::literal::<TWO>() - x * y);
    }
    y
}

const ONE: u64 = 1.0_f64.to_bits();
const TWO: u64 = 2.0_f64.to_bits();

/// The quotient of two numbers in two parts each, in two parts: 2^-44 of it, of `f64` 2^-100.
#[inline(always)]
fn quotient<R: Elementary>(over: (R, R), under: (R, R)) -> (R, R) {
    let inverse = reciprocal(under.0);
    let first = over.0 * inverse;
    let (product, error) = first.two_product(under.0);
    let left = ((over.0 - product) - error) + (over.1 - first * under.1);
    let second = left * inverse;
    ordered_sum(first, second)
}

/// `x * 2^n` for any whole `n` whose power or whose result has an exponent.
#[inline(always)]
fn scaled<R: Elementary>(x: R, n: R) -> R {
    let half = (n * lit!(0.5)).floor();
    // Two steps: the power itself may have no exponent.
    (x * half.power_of_two()).guard() * (n - half).power_of_two()
}
