//! Biases: rounding can push moments out of the set that distributions can have; mixing in a
//! little of a fixed, valid vector pulls them back (\[MSM\], section 4.2; \[BHS\], section 4 of the
//! supplement).

use crate::Moments4;

/// A published bias.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bias {
    /// The vector to be mixed in.
    pub target: Moments4<f32>,
    /// How much of it, from 0 to 1.
    pub strength: f32,
}

const fn even(b: f32) -> Moments4<f32> {
    Moments4 {
        b1: 0.0,
        b2: b,
        b3: 0.0,
        b4: b,
    }
}

/// Depths in [0, 1], moments stored in 16 bits with optimised quantisation: half a surface at
/// each end of the range (\[MSM\], section 4.2 and Listing 3).
pub const UNIT_16: Bias = Bias {
    target: Moments4 {
        b1: 0.5,
        b2: 0.5,
        b3: 0.5,
        b4: 0.5,
    },
    strength: 3e-5,
};

/// Depths in [-1, 1], moments stored in 16 bits with optimised quantisation (the lecture).
pub const SYMMETRIC_16: Bias = Bias {
    target: even(0.63),
    strength: 6e-5,
};

/// Depths in [-1, 1], moments stored as 32-bit floats (published with moment-based transparency
/// for four power moments).
pub const SYMMETRIC_32: Bias = Bias {
    target: even(0.375),
    strength: 5e-7,
};
