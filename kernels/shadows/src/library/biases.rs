//! Biases for `mix_bias`: the vector that is mixed in, and how much of it.
//!
//! A name says what the moments are means of (powers of depths in [-1, 1]: symmetric; in [0, 1]: unit),
//! how many there are, and what each is stored in.

use hankel_dsl::glam::{Vec3, Vec4};
use hankel_moments::Bias;
use hankel_moments::bias::{self, MEASURED};

const fn four(bias: &Bias) -> Vec4 {
    let m = bias.four();
    Vec4::new(m.b1, m.b2, m.b3, m.b4)
}

const fn low(bias: &Bias) -> Vec3 {
    let m = bias.six();
    Vec3::new(m.b1, m.b2, m.b3)
}

const fn high(bias: &Bias) -> Vec3 {
    let m = bias.six();
    Vec3::new(m.b4, m.b5, m.b6)
}

/// The strength that was measured for a format: entry `index`, which must be that format's.
const fn measured(index: usize, count: usize, bits: u32) -> f32 {
    let bias = MEASURED[index].bias;
    assert!(bias.count == count && bias.bits == bits);
    bias.strength as f32
}

/// Target for four power moments of depths in [-1, 1] in 16 bits (\[MBOIT\], Table 1 of the supplement).
pub const SYMMETRIC_FOUR_SIXTEEN_BITS_TARGET: Vec4 = four(&bias::SYMMETRIC_4_16);
/// Strength for four power moments of depths in [-1, 1] in 16 bits (\[MBOIT\], Table 1 of the
/// supplement).
pub const SYMMETRIC_FOUR_SIXTEEN_BITS_STRENGTH: f32 = bias::SYMMETRIC_4_16.strength as f32;

/// Target for four power moments of depths in [-1, 1] in 32-bit floats (\[MBOIT\], Table 1 of the
/// supplement).
pub const SYMMETRIC_FOUR_FLOAT_TARGET: Vec4 = four(&bias::SYMMETRIC_4_32);
/// Strength for four power moments of depths in [-1, 1] in 32-bit floats (\[MBOIT\], Table 1 of the
/// supplement).
pub const SYMMETRIC_FOUR_FLOAT_STRENGTH: f32 = bias::SYMMETRIC_4_32.strength as f32;

/// Target for four power moments of depths in [-1, 1] in 16 bits, rounded as the lecture has it.
pub const SYMMETRIC_FOUR_LECTURE_TARGET: Vec4 = four(&bias::SYMMETRIC_4_16_LECTURE);
/// Strength for four power moments of depths in [-1, 1] in 16 bits, as the lecture has it.
pub const SYMMETRIC_FOUR_LECTURE_STRENGTH: f32 = bias::SYMMETRIC_4_16_LECTURE.strength as f32;

/// Target for four power moments of depths in [0, 1] in 16 bits (\[MSM\], section 4.2 and Listing 3).
pub const UNIT_FOUR_TARGET: Vec4 = four(&bias::UNIT_4_16);
/// Strength for four power moments of depths in [0, 1] in 16 bits (\[MSM\], section 4.2 and Listing 3).
pub const UNIT_FOUR_STRENGTH: f32 = bias::UNIT_4_16.strength as f32;

/// Target where depths are clamped to [0, 1] and many are at the ends (\[BHS\], section 4 of the
/// supplement).
pub const CLAMPED_FOUR_TARGET: Vec4 = four(&bias::CLAMPED_4_16);
/// Strength where depths are clamped to [0, 1] and many are at the ends (\[BHS\], section 4 of the
/// supplement).
pub const CLAMPED_FOUR_STRENGTH: f32 = bias::CLAMPED_4_16.strength as f32;

/// Target for the Hausdorff problem, four power moments of depths in [-1, 1]: the arcsine distribution's moments.
pub const HAUSDORFF_SYMMETRIC_FOUR_TARGET: Vec4 = four(&bias::HAUSDORFF_SYMMETRIC_4_16);
/// Strength for the Hausdorff problem, four power moments of depths in [-1, 1] in 16 bits, as measured.
pub const HAUSDORFF_SYMMETRIC_FOUR_SIXTEEN_BITS_STRENGTH: f32 =
    bias::HAUSDORFF_SYMMETRIC_4_16.strength as f32;
/// Strength for the Hausdorff problem, four power moments of depths in [-1, 1] in 32-bit floats, as measured.
pub const HAUSDORFF_SYMMETRIC_FOUR_FLOAT_STRENGTH: f32 =
    bias::HAUSDORFF_SYMMETRIC_4_32.strength as f32;
/// Target for the Hausdorff problem, four power moments of depths in [0, 1]: the arcsine distribution's moments.
pub const HAUSDORFF_UNIT_FOUR_TARGET: Vec4 = four(&bias::HAUSDORFF_UNIT_4_16);
/// Strength for the Hausdorff problem, four power moments of depths in [0, 1] in 16 bits, as measured.
pub const HAUSDORFF_UNIT_FOUR_SIXTEEN_BITS_STRENGTH: f32 =
    bias::HAUSDORFF_UNIT_4_16.strength as f32;

/// Strength for two trigonometric moments in 16 bits (\[MBOIT\], Table 1 of the supplement): they are
/// scaled by 1 minus this.
pub const TRIGONOMETRIC_SIXTEEN_BITS_STRENGTH: f32 = bias::TRIGONOMETRIC_2_16.strength as f32;
/// Strength for two trigonometric moments in 32-bit floats (\[MBOIT\], Table 1 of the supplement): they
/// are scaled by 1 minus this.
pub const TRIGONOMETRIC_FLOAT_STRENGTH: f32 = bias::TRIGONOMETRIC_2_32.strength as f32;

/// Target for moments 1 to 3 of six power moments of depths in [-1, 1] in 32-bit floats (\[MBOIT\],
/// Table 1 of the supplement).
pub const SYMMETRIC_SIX_FLOAT_LOW_TARGET: Vec3 = low(&bias::SYMMETRIC_6_32);
/// Target for moments 4 to 6 of six power moments of depths in [-1, 1] in 32-bit floats.
pub const SYMMETRIC_SIX_FLOAT_HIGH_TARGET: Vec3 = high(&bias::SYMMETRIC_6_32);
/// Strength for six power moments of depths in [-1, 1] in 32-bit floats.
pub const SYMMETRIC_SIX_FLOAT_STRENGTH: f32 = bias::SYMMETRIC_6_32.strength as f32;

/// Target for moments 1 to 3 of six power moments of depths in [-1, 1] in 16 bits (\[MBOIT\], Table 1
/// of the supplement).
pub const SYMMETRIC_SIX_SIXTEEN_BITS_LOW_TARGET: Vec3 = low(&bias::SYMMETRIC_6_16);
/// Target for moments 4 to 6 of six power moments of depths in [-1, 1] in 16 bits.
pub const SYMMETRIC_SIX_SIXTEEN_BITS_HIGH_TARGET: Vec3 = high(&bias::SYMMETRIC_6_16);
/// Strength for six power moments of depths in [-1, 1] in 16 bits.
pub const SYMMETRIC_SIX_SIXTEEN_BITS_STRENGTH: f32 = bias::SYMMETRIC_6_16.strength as f32;

/// The least strength that was measured to leave fewer than one in a million moments invalid: four of
/// depths in [-1, 1], 16 bits in the optimised basis, with the lecture's target.
pub const MEASURED_SYMMETRIC_FOUR_SIXTEEN_BITS: f32 = measured(7, 4, 16);
/// The least strength that was measured to leave fewer than one in a million moments invalid: four of
/// depths in [-1, 1], 32-bit floats.
pub const MEASURED_SYMMETRIC_FOUR_FLOAT: f32 = measured(6, 4, 32);
/// The least strength that was measured to leave fewer than one in a million moments invalid: six of
/// depths in [-1, 1], 32-bit floats.
pub const MEASURED_SYMMETRIC_SIX_FLOAT: f32 = measured(9, 6, 32);
/// The least strength that was measured to leave fewer than one in a million moments invalid: six of
/// depths in [-1, 1], 10 bits in the optimised basis, with the target for 16 bits.
pub const MEASURED_SYMMETRIC_SIX_TEN_BITS: f32 = measured(11, 6, 10);
/// The least strength that was measured to leave fewer than one in a million moments invalid: two
/// trigonometric moments, 32-bit floats.
pub const MEASURED_TRIGONOMETRIC_FLOAT: f32 = measured(14, 4, 32);
/// The least strength that was measured to leave fewer than one in a million moments invalid: two
/// trigonometric moments, 16 bits.
pub const MEASURED_TRIGONOMETRIC_SIXTEEN_BITS: f32 = measured(15, 4, 16);
