//! Published algorithms, step by step and in the format that they are measured in, to compare with:
//! no reordering, no guard that their text does not have. Four moments are in `hankel-listing`, as
//! kernels.
//!
//! - [`moment_bound`]: \[MBD\], Algorithm 1 with the choices of its section 5.1: Cholesky's
//!   factorisation of the Hankel matrix, roots of the kernel polynomial by a formula up to degree 2 and
//!   by bracketed Newton steps beyond, weights by Björck and Pereyra from roots in the order of their
//!   magnitude.
//! - [`six_moments`]: \[BHS\], section 3 of the supplement, with the cubic's roots by the cosine that
//!   its shader code takes them by.
//! - [`two_points`]: \[BHS\], Theorem 1 of the supplement.
//!
//! They divide by what may be 0, and take roots of what may be negative: their results may be no
//! numbers.

mod roots;
mod six;
mod solver;
mod two_points;

pub use six::six_moments;
pub use solver::{mixed, moment_bound};
pub use two_points::{Sparse, two_points};

use std::ops::{Add, Div, Mul, Neg, Sub};

use crate::families::Format;

/// A number format with the library's functions.
pub trait Float:
    Format
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
{
    /// The angle of a vector.
    fn atan2(y: Self, x: Self) -> Self;
    /// Cosine.
    fn cos(self) -> Self;
    /// Sine.
    fn sin(self) -> Self;
    /// `self * a + b`, rounded once.
    fn fused(self, a: Self, b: Self) -> Self;
    /// Positive infinity.
    const INFINITY: Self;
}

macro_rules! float {
    ($($float:ident),*) => {$(
        impl Float for $float {
            fn atan2(y: Self, x: Self) -> Self {
                $float::atan2(y, x)
            }
            fn cos(self) -> Self {
                $float::cos(self)
            }
            fn sin(self) -> Self {
                $float::sin(self)
            }
            fn fused(self, a: Self, b: Self) -> Self {
                $float::mul_add(self, a, b)
            }
            const INFINITY: Self = $float::INFINITY;
        }
    )*};
}

float!(f32, f64);

/// Solves a symmetric positive definite system by Cholesky's factorisation L L'.
#[allow(
    clippy::needless_range_loop,
    reason = "indices are those of the published form"
)]
fn cholesky_solve<T: Float, const SIZE: usize>(
    size: usize,
    matrix: &[[T; SIZE]; SIZE],
    right: &[T; SIZE],
) -> [T; SIZE] {
    let mut l = [[T::default(); SIZE]; SIZE];
    for i in 0..size {
        for j in 0..=i {
            let mut sum = matrix[i][j];
            for k in 0..j {
                sum -= l[i][k] * l[j][k];
            }
            l[i][j] = if i == j { root(sum) } else { sum / l[j][j] };
        }
    }
    let mut x = *right;
    for i in 0..size {
        for k in 0..i {
            let taken = l[i][k] * x[k];
            x[i] -= taken;
        }
        x[i] = x[i] / l[i][i];
    }
    for i in (0..size).rev() {
        for k in i + 1..size {
            let taken = l[k][i] * x[k];
            x[i] -= taken;
        }
        x[i] = x[i] / l[i][i];
    }
    x
}

/// The square root, no number for what is negative.
fn root<T: Float>(x: T) -> T {
    if x < T::default() {
        T::round(f64::NAN)
    } else {
        x.sqrt()
    }
}
