//! Moments as a few depths, as maps over rows.

use hankel_dsl::{Element, Real, kernel};
use hankel_moments::{
    Degenerate4, Degenerate6, Moments4, Moments6, TwoPoints, degenerate_4, degenerate_6, sparse_2,
};

/// Three moments.
#[derive(Clone, Copy, Debug, PartialEq, Element)]
#[repr(C)]
pub struct Moments3<R> {
    /// Mean depth.
    pub b1: R,
    /// Mean square of the depth.
    pub b2: R,
    /// Mean cube of the depth.
    pub b3: R,
}

/// The two depths with three given moments, for resampling them.
#[kernel(
    compute,
    threads(64),
    precision(f32, f64),
    inputs = crate::inputs::moments_3
)]
pub fn sparse_2point<R: Real>(#[element] moments: Moments3<R>) -> TwoPoints<R> {
    sparse_2(moments.b1, moments.b2, moments.b3)
}

/// The two depths that explain four moments, if any two do, and how far they are from it.
#[kernel(
    compute,
    threads(64),
    precision(f32, f64),
    inputs = crate::inputs::moments_4
)]
pub fn degenerate_2point<R: Real>(#[element] moments: Moments4<R>) -> Degenerate4<R> {
    degenerate_4(moments)
}

/// The three depths that explain six moments, if any three do, and how far they are from it.
#[kernel(
    compute,
    threads(64),
    precision(f32, f64),
    inputs = crate::inputs::moments_6
)]
pub fn degenerate_3point<R: Real>(#[element] moments: Moments6<R>) -> Degenerate6<R> {
    degenerate_6(moments)
}
