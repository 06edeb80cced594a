//! Optimised quantisation, and the integers that hold it, as maps over rows. Arguments of any value
//! are brought into their ranges first.

use hankel_dsl::{Real, kernel};
use hankel_moments::{
    Fixed4, Fixed6, FixedPoint, Moments4, Moments6, Packed6, Quantized4, Quantized6, Rectangle4,
    Rectangle6, dequantize_symmetric_4, dequantize_symmetric_6, dequantize_unit_4,
    dequantize_unit_6, quantize_symmetric_4, quantize_symmetric_6, quantize_unit_4,
    quantize_unit_6,
};

/// Four moments of depths in [0, 1] to the basis optimised for 16 bits.
#[kernel(
    compute,
    threads(64),
    precision(f32, f64),
    inputs = crate::inputs::unit_moments_4
)]
pub fn quantize_4_unit<R: Real>(#[element] moments: Moments4<R>) -> Quantized4<R> {
    quantize_unit_4(moments.clamped())
}

/// The basis optimised for 16 bits to four moments of depths in [0, 1].
#[kernel(
    compute,
    threads(64),
    precision(f32, f64),
    inputs = crate::inputs::unit_quantized_4
)]
pub fn dequantize_4_unit<R: Real>(
    #[element]
    #[range(0.0..=1.0)]
    quantized: Quantized4<R>,
) -> Moments4<R> {
    dequantize_unit_4(quantized.saturated())
}

/// Four moments of depths in [-1, 1] to the basis optimised for 16 bits.
#[kernel(
    compute,
    threads(64),
    precision(f32, f64),
    inputs = crate::inputs::symmetric_moments_4
)]
pub fn quantize_4_symmetric<R: Real>(#[element] moments: Moments4<R>) -> Quantized4<R> {
    quantize_symmetric_4(moments.clamped())
}

/// The basis optimised for 16 bits to four moments of depths in [-1, 1].
#[kernel(
    compute,
    threads(64),
    precision(f32, f64),
    inputs = crate::inputs::symmetric_quantized_4
)]
pub fn dequantize_4_symmetric<R: Real>(
    #[element]
    #[range(0.0..=1.0)]
    quantized: Quantized4<R>,
) -> Moments4<R> {
    dequantize_symmetric_4(quantized.saturated())
}

/// Six moments of depths in [0, 1] to the basis optimised for 10 bits.
#[kernel(
    compute,
    threads(64),
    precision(f32, f64),
    inputs = crate::inputs::unit_moments_6
)]
pub fn quantize_6_unit<R: Real>(#[element] moments: Moments6<R>) -> Quantized6<R> {
    quantize_unit_6(moments.clamped())
}

/// The basis optimised for 10 bits to six moments of depths in [0, 1].
#[kernel(
    compute,
    threads(64),
    precision(f32, f64),
    inputs = crate::inputs::unit_quantized_6
)]
pub fn dequantize_6_unit<R: Real>(
    #[element]
    #[range(0.0..=1.0)]
    quantized: Quantized6<R>,
) -> Moments6<R> {
    dequantize_unit_6(quantized.saturated())
}

/// Six moments of depths in [-1, 1] to the basis optimised for 10 bits.
#[kernel(
    compute,
    threads(64),
    precision(f32, f64),
    inputs = crate::inputs::symmetric_moments_6
)]
pub fn quantize_6_symmetric<R: Real>(#[element] moments: Moments6<R>) -> Quantized6<R> {
    quantize_symmetric_6(moments.clamped())
}

/// The basis optimised for 10 bits to six moments of depths in [-1, 1].
#[kernel(
    compute,
    threads(64),
    precision(f32, f64),
    inputs = crate::inputs::symmetric_quantized_6
)]
pub fn dequantize_6_symmetric<R: Real>(
    #[element]
    #[range(0.0..=1.0)]
    quantized: Quantized6<R>,
) -> Moments6<R> {
    dequantize_symmetric_6(quantized.saturated())
}

/// Six quantised moments to two words of 10 bits for each channel (R10G10B10A2).
#[kernel(compute, threads(64))]
pub fn pack_6(
    #[element]
    #[range(0.0..=1.0)]
    quantized: Quantized6<f32>,
) -> Packed6 {
    Packed6::pack(quantized)
}

/// Two words of 10 bits for each channel (R10G10B10A2) to six quantised moments.
#[kernel(compute, threads(64))]
pub fn unpack_6(#[element] packed: Packed6) -> Quantized6<f32> {
    packed.unpack()
}

/// Four quantised moments to the integers that a summed-area table adds up.
#[kernel(compute, threads(64))]
pub fn to_summed_area_4(
    #[uniform] fixed_point: &FixedPoint,
    #[element]
    #[range(0.0..=1.0)]
    quantized: Quantized4<f32>,
) -> Fixed4 {
    Fixed4::of(quantized, *fixed_point)
}

/// Four entries of a summed-area table to the mean of four quantised moments over the rectangle
/// between them.
#[kernel(compute, threads(64))]
pub fn from_summed_area_4(
    #[uniform] fixed_point: &FixedPoint,
    #[element] rectangle: Rectangle4,
) -> Quantized4<f32> {
    rectangle.mean(*fixed_point)
}

/// Six quantised moments to the integers that a summed-area table adds up.
#[kernel(compute, threads(64))]
pub fn to_summed_area_6(
    #[uniform] fixed_point: &FixedPoint,
    #[element]
    #[range(0.0..=1.0)]
    quantized: Quantized6<f32>,
) -> Fixed6 {
    Fixed6::of(quantized, *fixed_point)
}

/// Four entries of a summed-area table to the mean of six quantised moments over the rectangle
/// between them.
#[kernel(compute, threads(64))]
pub fn from_summed_area_6(
    #[uniform] fixed_point: &FixedPoint,
    #[element] rectangle: Rectangle6,
) -> Quantized6<f32> {
    rectangle.mean(*fixed_point)
}
