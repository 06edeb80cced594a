//! Hamburger and Hausdorff four moment shadow mapping step by step as published (\[MSM\],
//! Listings 3 and 4, with the lecture's correction of the back substitution). Tests compare the
//! kernels' cost and error with these. They divide by a coefficient that may be zero: not to be
//! used for anything else.
#![no_std]

use hankel_dsl::{Element, Real, kernel, lit};
use hankel_moments::Moments4;

hankel_dsl::kernels![hamburger_listing, hausdorff_listing];

/// The published functions' other parameters.
#[derive(Clone, Copy, Debug, PartialEq, Element)]
#[repr(C)]
pub struct Biases<R> {
    /// How much of (1/2, 1/2, 1/2, 1/2) is mixed in.
    pub moment_bias: R,
    /// What is taken off the receiver's depth.
    pub depth_bias: R,
}

/// A receiver and the four moments at its place in the map.
#[derive(Clone, Copy, Debug, PartialEq, Element)]
#[repr(C)]
pub struct Receiver<R> {
    /// The filtered moments.
    pub moments: Moments4<R>,
    /// The receiver's depth.
    pub depth: R,
}

/// A shadow.
#[derive(Clone, Copy, Debug, PartialEq, Element)]
#[repr(C)]
pub struct Shadow<R> {
    /// 0: lit, 1: in full shadow.
    pub shadow: R,
}

/// Biased moments, query depth, and the two other support points, the lower first.
struct Support<R> {
    b: Moments4<R>,
    z0: R,
    z1: R,
    z2: R,
}

#[inline(always)]
fn support<R: Real>(biases: &Biases<R>, receiver: Receiver<R>) -> Support<R> {
    let half: R = lit!(0.5);
    let target = Moments4 {
        b1: half,
        b2: half,
        b3: half,
        b4: half,
    };
    let b = receiver.moments.lerp(target, biases.moment_bias);
    let z0 = receiver.depth - biases.depth_bias;
    // Cholesky factorisation of the Hankel matrix: the products that are needed.
    let l32_d22 = -b.b1 * b.b2 + b.b3;
    let d22 = -b.b1 * b.b1 + b.b2;
    let square_variance = -b.b2 * b.b2 + b.b4;
    let d33_d22 = square_variance * d22 - l32_d22 * l32_d22;
    let one: R = lit!(1.0);
    let inv_d22 = one / d22;
    let l32 = l32_d22 * inv_d22;
    // Forward substitution, scaling, backward substitution.
    let mut c1 = z0 - b.b1;
    let mut c2 = z0 * z0 - (b.b2 + l32 * c1);
    c1 *= inv_d22;
    c2 *= d22 / d33_d22;
    c1 -= l32 * c2;
    let c0 = one - (c1 * b.b1 + c2 * b.b2);
    // The quadratic's roots.
    let p = c1 / c2;
    let q = c0 / c2;
    let root = (p * p * lit!(0.25) - q).sqrt();
    let middle = -p * half;
    Support {
        b,
        z0,
        z1: middle - root,
        z2: middle + root,
    }
}

#[inline(always)]
fn three<R: Real>(s: &Support<R>) -> R {
    let zero: R = lit!(0.0);
    let one: R = lit!(1.0);
    let Support { b, z0, z1, z2 } = *s;
    let both = z2.lt(z0);
    let lower = z1.lt(z0);
    let pick = |a, b, c| R::select(both, a, R::select(lower, b, c));
    let (s0, s1) = (pick(z1, z0, zero), pick(z0, z1, zero));
    let (s2, s3) = (pick(one, zero, zero), pick(one, one, zero));
    let quotient = (s0 * z2 - b.b1 * (s0 + z2) + b.b2) / ((z2 - s1) * (z0 - z1));
    s2 + s3 * quotient
}

/// Hamburger four moment shadow mapping as published.
#[kernel(compute, threads(64), precision(f32, f64))]
pub fn hamburger_listing<R: Real>(
    #[uniform] biases: &Biases<R>,
    #[element] receiver: Receiver<R>,
) -> Shadow<R> {
    Shadow {
        shadow: three(&support(biases, receiver)).saturate(),
    }
}

/// Hausdorff four moment shadow mapping as published.
#[kernel(compute, threads(64), precision(f32, f64))]
pub fn hausdorff_listing<R: Real>(
    #[uniform] biases: &Biases<R>,
    #[element] receiver: Receiver<R>,
) -> Shadow<R> {
    let s = support(biases, receiver);
    let zero: R = lit!(0.0);
    let one: R = lit!(1.0);
    let Moments4 { b1, b2, b3, b4 } = s.b;
    let free = ((b3 - b2) * s.z0 + b3 - b4) / ((b2 - b1) * s.z0 + b2 - b3);
    let w1 = R::select(s.z0.gt(free), one, zero);
    let four = (b2 - b1
        + (b3 - b1 - (free + one) * (b2 - b1)) * (free - w1 - s.z0) / (s.z0 * (s.z0 - free)))
        / (free - w1)
        + one
        - b1;
    let outside = s.z1.lt(zero) | s.z2.gt(one);
    Shadow {
        shadow: R::select(outside, four, three(&s)).saturate(),
    }
}
