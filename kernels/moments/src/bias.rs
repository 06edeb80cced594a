//! Biases: rounding can push moments out of the set that distributions can have; mixing in a
//! little of a fixed, valid vector pulls them back (\[MSM\], section 4.2; \[BHS\], section 4 of the
//! supplement).
//!
//! Here are the published ones, named by basis, number of moments and bits of each stored channel.
//! Stored moments of few random depths are invalid more often than not: their Hankel matrix is not
//! positive definite. The symmetric biases make all of 50 000 valid again; those for [0, 1] leave the
//! shares stated with them. [`MEASURED`] has the least strengths that this project found, for more
//! formats and a wider choice of depths.
//!
//! ```
//! use hankel_moments::bias::SYMMETRIC_4_32;
//!
//! // Moments 0 to 4 of a surface at depth 0.5, with the bias mixed in.
//! let z = 0.5_f64;
//! let biased: [f64; 5] = core::array::from_fn(|i| {
//!     let m = z.powi(i as i32);
//!     m + SYMMETRIC_4_32.strength * (SYMMETRIC_4_32.target[i] - m)
//! });
//! assert_eq!(biased[0], 1.0);
//! assert!(biased[2] - biased[1] * biased[1] > 0.0);
//! ```

use crate::{MAX_MOMENTS, Moments4, Moments6};

/// What moments are means of.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Basis {
    /// Powers of depths in [0, 1].
    Unit,
    /// Powers of depths in [-1, 1].
    Symmetric,
    /// Cosines and sines of multiples of an angle.
    Trigonometric,
}

/// A bias.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bias {
    /// What the moments are means of.
    pub basis: Basis,
    /// How many moments there are after the zeroth. A trigonometric moment is complex, and counts
    /// as two: its cosine and its sine.
    pub count: usize,
    /// Bits of each stored channel: a float's for 32, else a normalised integer's in the basis
    /// optimised for it.
    pub bits: u32,
    /// The vector to be mixed in, from its zeroth moment, 1, on; what follows `count` is 0.
    pub target: [f64; MAX_MOMENTS],
    /// How much of it, from 0 to 1.
    pub strength: f64,
}

impl Bias {
    /// The target's first four moments.
    #[must_use]
    pub const fn four(&self) -> Moments4<f32> {
        Moments4 {
            b1: self.target[1] as f32,
            b2: self.target[2] as f32,
            b3: self.target[3] as f32,
            b4: self.target[4] as f32,
        }
    }

    /// The target's first six moments.
    #[must_use]
    pub const fn six(&self) -> Moments6<f32> {
        Moments6 {
            b1: self.target[1] as f32,
            b2: self.target[2] as f32,
            b3: self.target[3] as f32,
            b4: self.target[4] as f32,
            b5: self.target[5] as f32,
            b6: self.target[6] as f32,
        }
    }
}

const fn bias<const N: usize>(basis: Basis, bits: u32, moments: [f64; N], strength: f64) -> Bias {
    let mut target = [0.0; MAX_MOMENTS];
    target[0] = 1.0;
    let mut i = 0;
    while i < N {
        target[i + 1] = moments[i];
        i += 1;
    }
    Bias {
        basis,
        count: N,
        bits,
        target,
        strength,
    }
}

/// Half a surface at each end of [0, 1] and, for the share `uniform`, all depths between.
const fn ends_and_uniform<const N: usize>(uniform: f64) -> [f64; N] {
    let mut moments = [0.0; N];
    let mut i = 0;
    while i < N {
        moments[i] = (1.0 - uniform) * 0.5 + uniform / (i + 2) as f64;
        i += 1;
    }
    moments
}

/// Half a surface at each end of [0, 1]: the best for the average of moments (\[MSM\], section 4.2
/// and Listing 3). It does not help depths at the ends themselves: what is there stays on the
/// boundary of the valid moments. Of up to two random depths' moments, 4.8 % stay invalid; where some
/// of the depths are at the ends, 22 %.
pub const UNIT_4_16: Bias = bias(Basis::Unit, 16, [0.5; 4], 3e-5);

/// Where depths are clamped to [0, 1], many are at the ends. A fifth of the target is uniform, which
/// puts it inside the valid moments (\[BHS\], section 4 of the supplement). Of up to two depths'
/// moments, 2.4 % stay invalid, at the ends or between.
pub const CLAMPED_4_16: Bias = bias(Basis::Unit, 16, ends_and_uniform::<4>(0.2), 3e-5);

/// Where depths are clamped to [0, 1]; half of the target is uniform, for three depths suffice to
/// lie on the boundary of six moments (\[BHS\], section 4 of the supplement; 10 bits: the lecture).
/// Of up to three depths' moments, 0.014 % stay invalid.
pub const CLAMPED_6_10: Bias = bias(Basis::Unit, 10, ends_and_uniform::<6>(0.5), 4e-3);

/// As [`SYMMETRIC_4_16`], rounded: what moment shadow mapping uses (the lecture).
pub const SYMMETRIC_4_16_LECTURE: Bias = bias(Basis::Symmetric, 16, [0.0, 0.63, 0.0, 0.63], 6e-5);

/// Four power moments, 16 bits (\[MBOIT\], Table 1 of the supplement).
pub const SYMMETRIC_4_16: Bias = bias(Basis::Symmetric, 16, [0.0, 0.628, 0.0, 0.628], 6e-5);

/// Four power moments, 32-bit floats (\[MBOIT\], Table 1 of the supplement).
pub const SYMMETRIC_4_32: Bias = bias(Basis::Symmetric, 32, [0.0, 0.375, 0.0, 0.375], 5e-7);

/// Six power moments, 16 bits (\[MBOIT\], Table 1 of the supplement).
pub const SYMMETRIC_6_16: Bias = bias(
    Basis::Symmetric,
    16,
    [0.0, 0.5566, 0.0, 0.489, 0.0, 0.478_693_82],
    6e-4,
);

/// Six power moments, 32-bit floats (\[MBOIT\], Table 1 of the supplement). Distributions on the
/// real line have these moments, but none within [-1, 1] has.
pub const SYMMETRIC_6_32: Bias = bias(
    Basis::Symmetric,
    32,
    [0.0, 0.48, 0.0, 0.451, 0.0, 0.45],
    5e-6,
);

/// Eight power moments, 16 bits (\[MBOIT\], Table 1 of the supplement); of these, what is left invalid
/// is not measured: the basis that they are stored in is not here.
pub const SYMMETRIC_8_16: Bias = bias(
    Basis::Symmetric,
    16,
    [
        0.0,
        0.424_749_163_879_598_66,
        0.0,
        0.224_078_026_755_852_84,
        0.0,
        0.153_692_307_692_307_68,
        0.0,
        0.129_004_405_290_891_2,
    ],
    2.5e-3,
);

/// Eight power moments, 32-bit floats (\[MBOIT\], Table 1 of the supplement).
pub const SYMMETRIC_8_32: Bias = bias(
    Basis::Symmetric,
    32,
    [
        0.0,
        0.75,
        0.0,
        0.676_666_666_666_666_6,
        0.0,
        0.63,
        0.0,
        0.600_303_030_303_030_3,
    ],
    5e-5,
);

/// Ten power moments, 32-bit floats. Nothing is published for them: the target is this project's own, six
/// equal weights at equal distances from -1 to 1; the strength is the least with which the bounds of this
/// crate hold ([`MEASURED`]).
pub const SYMMETRIC_10_32: Bias = bias(
    Basis::Symmetric,
    32,
    [
        0.0,
        7.0 / 15.0,
        0.0,
        1.1312 / 3.0,
        0.0,
        1.04672 / 3.0,
        0.0,
        1.016_798_72 / 3.0,
        0.0,
        1.006_046_72 / 3.0,
    ],
    1.5e-4,
);

/// Two trigonometric moments, 16 bits (\[MBOIT\], Table 1 of the supplement). The target of
/// trigonometric moments is the uniform distribution, whose moments are 0: the bias scales them by
/// 1 - strength.
pub const TRIGONOMETRIC_2_16: Bias = bias(Basis::Trigonometric, 16, [0.0; 4], 4e-4);

/// Two trigonometric moments, 32-bit floats; see [`TRIGONOMETRIC_2_16`].
pub const TRIGONOMETRIC_2_32: Bias = bias(Basis::Trigonometric, 32, [0.0; 4], 4e-7);

/// Three trigonometric moments, 16 bits; see [`TRIGONOMETRIC_2_16`].
pub const TRIGONOMETRIC_3_16: Bias = bias(Basis::Trigonometric, 16, [0.0; 6], 6.5e-4);

/// Three trigonometric moments, 32-bit floats; see [`TRIGONOMETRIC_2_16`].
pub const TRIGONOMETRIC_3_32: Bias = bias(Basis::Trigonometric, 32, [0.0; 6], 8e-7);

/// Four trigonometric moments, 16 bits; see [`TRIGONOMETRIC_2_16`].
pub const TRIGONOMETRIC_4_16: Bias = bias(Basis::Trigonometric, 16, [0.0; 8], 8.5e-4);

/// Four trigonometric moments, 32-bit floats; see [`TRIGONOMETRIC_2_16`].
pub const TRIGONOMETRIC_4_32: Bias = bias(Basis::Trigonometric, 32, [0.0; 8], 1.5e-6);

/// For the Hausdorff problem, whose depths are known to be in the range: moments of Chebyshev's arcsine distribution on
/// [0, 1]. Each is in the middle of the interval that those before it leave. The published targets do not suit that
/// problem with any strength: they lie on the boundary of its valid moments.
const ARCSINE_UNIT: [f64; 4] = [0.5, 0.375, 0.3125, 0.273_437_5];

/// The same on [-1, 1].
const ARCSINE_SYMMETRIC: [f64; 4] = [0.0, 0.5, 0.0, 0.375];

/// Four power moments for the Hausdorff problem on [0, 1], 16 bits. Target and strength are this project's own: the
/// strength is the least that leaves the moments inside those of the problem ([`MEASURED`]).
pub const HAUSDORFF_UNIT_4_16: Bias = bias(Basis::Unit, 16, ARCSINE_UNIT, 7.1e-5);

/// Four power moments for the Hausdorff problem on [-1, 1], 16 bits; see [`HAUSDORFF_UNIT_4_16`].
pub const HAUSDORFF_SYMMETRIC_4_16: Bias = bias(Basis::Symmetric, 16, ARCSINE_SYMMETRIC, 5.7e-5);

/// Four power moments for the Hausdorff problem on [-1, 1], 32-bit floats; see [`HAUSDORFF_UNIT_4_16`].
pub const HAUSDORFF_SYMMETRIC_4_32: Bias = bias(Basis::Symmetric, 32, ARCSINE_SYMMETRIC, 9e-7);

/// All that are published, each with its constant's name.
pub const PUBLISHED: [(&str, Bias); 16] = [
    ("UNIT_4_16", UNIT_4_16),
    ("CLAMPED_4_16", CLAMPED_4_16),
    ("CLAMPED_6_10", CLAMPED_6_10),
    ("SYMMETRIC_4_16_LECTURE", SYMMETRIC_4_16_LECTURE),
    ("SYMMETRIC_4_16", SYMMETRIC_4_16),
    ("SYMMETRIC_4_32", SYMMETRIC_4_32),
    ("SYMMETRIC_6_16", SYMMETRIC_6_16),
    ("SYMMETRIC_6_32", SYMMETRIC_6_32),
    ("SYMMETRIC_8_16", SYMMETRIC_8_16),
    ("SYMMETRIC_8_32", SYMMETRIC_8_32),
    ("TRIGONOMETRIC_2_16", TRIGONOMETRIC_2_16),
    ("TRIGONOMETRIC_2_32", TRIGONOMETRIC_2_32),
    ("TRIGONOMETRIC_3_16", TRIGONOMETRIC_3_16),
    ("TRIGONOMETRIC_3_32", TRIGONOMETRIC_3_32),
    ("TRIGONOMETRIC_4_16", TRIGONOMETRIC_4_16),
    ("TRIGONOMETRIC_4_32", TRIGONOMETRIC_4_32),
];

/// A bias that was measured.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measured {
    /// Its strength leaves the Hankel matrix (Toeplitz matrix, for trigonometric moments) positive
    /// definite, as solvers need it that factorise it without further ado.
    pub bias: Bias,
    /// The strength from which on the bounds of this crate are within 0.02, and the strength, of the
    /// truth. Those of eight moments in `f32` need more for that than a positive definite matrix.
    pub robust: f64,
    /// Whether these are the bounds of depths that are known to be in the range (the Hausdorff problem).
    pub in_range: bool,
}

const fn measured(target: Bias, bits: u32, definite: f64, robust: f64) -> Measured {
    Measured {
        bias: Bias {
            bits,
            strength: definite,
            ..target
        },
        robust,
        in_range: false,
    }
}

const fn in_range(target: Bias, bits: u32, definite: f64, robust: f64) -> Measured {
    Measured {
        in_range: true,
        ..measured(target, bits, definite, robust)
    }
}

/// The least strengths, to two digits, that leave fewer than one result in a million invalid, among
/// 4 million regions of each format as a renderer meets them: one texel, few surfaces, surfaces close
/// behind each other, one that shadows itself, depths at the ends of [0, 1]. `hankel stress --biases`
/// measures them, and says how many are invalid without a bias and with the published one.
///
/// Targets are the published ones, but for the Hausdorff problem. Formats without an optimised basis are
/// stored as they are; eight moments in 10 bits stay invalid with any strength up to 0.3, and in 16 bits
/// hardly anything is left of them.
pub const MEASURED: [Measured; 24] = [
    measured(CLAMPED_4_16, 32, 3.6e-5, 2.3e-5),
    measured(CLAMPED_4_16, 16, 1.2e-4, 1e-4),
    measured(CLAMPED_4_16, 10, 7.1e-3, 7.1e-3),
    measured(CLAMPED_6_10, 32, 9e-4, 5.7e-4),
    measured(CLAMPED_6_10, 16, 1.8e-3, 1.5e-3),
    measured(CLAMPED_6_10, 10, 5.1e-3, 5.1e-3),
    measured(SYMMETRIC_4_32, 32, 4.5e-7, 2.6e-7),
    measured(SYMMETRIC_4_16_LECTURE, 16, 3.6e-5, 3.6e-5),
    measured(SYMMETRIC_4_16, 10, 2.3e-3, 2.3e-3),
    measured(SYMMETRIC_6_32, 32, 8e-6, 3.2e-6),
    measured(SYMMETRIC_6_16, 16, 5.1e-5, 5.1e-5),
    measured(SYMMETRIC_6_16, 10, 3.2e-3, 3.2e-3),
    measured(SYMMETRIC_8_32, 32, 2.3e-5, 1.3e-5),
    measured(SYMMETRIC_8_16, 16, 2.3e-1, 2e-1),
    measured(TRIGONOMETRIC_2_16, 32, 1.2e-7, 1e-7),
    measured(TRIGONOMETRIC_2_16, 16, 4e-5, 4e-5),
    measured(TRIGONOMETRIC_2_16, 10, 2.6e-3, 2.6e-3),
    measured(SYMMETRIC_10_32, 32, 2.9e-4, 1.5e-4),
    in_range(HAUSDORFF_UNIT_4_16, 32, 2.9e-5, 2.9e-5),
    in_range(HAUSDORFF_UNIT_4_16, 16, 7.1e-5, 5.7e-5),
    in_range(HAUSDORFF_UNIT_4_16, 10, 3.6e-3, 3.6e-3),
    in_range(HAUSDORFF_SYMMETRIC_4_32, 32, 9e-7, 6.4e-7),
    in_range(HAUSDORFF_SYMMETRIC_4_16, 16, 5.7e-5, 5.7e-5),
    in_range(HAUSDORFF_SYMMETRIC_4_16, 10, 3.6e-3, 3.6e-3),
];
