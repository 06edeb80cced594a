//! Optimised quantisation: an affine change of basis that makes the set of valid moment vectors
//! fill the unit cube, so that few bits for each channel suffice (\[MSM\], section 4.1 and section 8
//! of the supplement; \[BHS\], section 3 of the supplement). It gains 12.3 bits for four moments of
//! depths in [0, 1] and 30.5 bits for six. The transforms for depths in [-1, 1] gain 12.2 and 30.5,
//! counting the change of the depths' range, and their coefficients are much smaller: in `f32`, they
//! are the ones to use.
//!
//! | moments | stored as | by |
//! | --- | --- | --- |
//! | four | 4 x 16 bits, normalised | [`Quantized4`], a texture `rgba16unorm` |
//! | four | 4 x 32-bit floats | the moments themselves, no transform |
//! | six | 2 x R10G10B10A2, normalised | [`Quantized6`], [`Packed6`], [`pack_10`] |
//! | six | 3 x 2 x 16 bits, normalised | [`Quantized6`], [`pack_16`] |
//! | either | 32-bit integers of a summed-area table | [`FixedPoint`], [`Fixed4`], [`Fixed6`], [`Region`] |
//!
//! All maps are affine, so filtering commutes with them. They take moments in [-1, 1] and channels
//! in [0, 1]; `clamped` and `saturated` bring anything there. Constant summands come first in a sum:
//! drivers may move them there, which changes the rounding.

mod fixed_point;
mod four;
mod packed;
mod six;
mod summed_area;
mod unorm;

pub use fixed_point::{Fixed4, Fixed6, FixedPoint, Rectangle4, Rectangle6};
pub use four::{
    Quantized4, dequantize_symmetric_4, dequantize_unit_4, quantize_symmetric_4, quantize_unit_4,
};
pub use packed::{Packed6, pack_10, pack_16, unpack_10, unpack_16};
pub use six::{
    Quantized6, dequantize_symmetric_6, dequantize_unit_6, quantize_symmetric_6, quantize_unit_6,
};
pub use summed_area::{Region, Span};
pub use unorm::{from_unorm, to_unorm};
