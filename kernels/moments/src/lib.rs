//! The moment problem, as moment shadow mapping needs it: from a few moments of the depths in a
//! filter region, how much of the region is surely nearer than a receiver?
//!
//! Everything is generic over [`Real`](hankel_dsl::Real) and free of bindings and entry points.
//! Functions take finite arguments of any value, valid moments or not, and return finite numbers
//! in the stated range; none makes a NaN on the way.
//!
//! Depths are in [0, 1] ("unit") or [-1, 1] ("symmetric"); the j-th moment is the mean of the
//! depth's j-th power; the zeroth is 1.
//!
//! # Sources
//! - \[MSM\] C. Peters, R. Klein: *Moment Shadow Mapping* (2015), and its supplement.
//! - \[BHS\] C. Peters, C. Münstermann, N. Wetzstein, R. Klein: *Beyond Hard Shadows: Moment Shadow
//!   Maps for Single Scattering, Soft Shadows and Translucent Occluders* (2016), its supplement, and
//!   the lecture on both.
//! - \[MBOIT\] C. Münstermann, S. Krumpen, R. Klein, C. Peters: *Moment-Based Order-Independent
//!   Transparency* (2018), its supplement.
//! - \[MBD\] M. Worchel, M. Alexa: *Moment Bounds are Differentiable: Efficiently Approximating
//!   Measures in Inverse Rendering* (2025).
//! - \[VSM\] W. Donnelly, A. Lauritzen: *Variance Shadow Maps* (2006).
//! - \[VSSM\] B. Yang, Z. Dong, J. Feng, H.-P. Seidel, J. Kautz: *Variance Soft Shadow Mapping* (2010).
//! - \[PCSS\] R. Fernando: *Percentage-Closer Soft Shadows* (2005).
//! - \[ESM\] T. Annen, T. Mertens, H.-P. Seidel, E. Flerackers, J. Kautz: *Exponential Shadow Maps*
//!   (2008).
//! - \[CSM\] T. Annen, T. Mertens, P. Bekaert, H.-P. Seidel, J. Kautz: *Convolution Shadow Maps*
//!   (2007).
//! - \[PSS\] O. Klehm, H.-P. Seidel, E. Eisemann: *Prefiltered Single Scattering* (2014).
//! - \[LVSM\] A. Lauritzen, M. McCool: *Layered Variance Shadow Maps* (2008).
#![no_std]

pub mod bias;
mod blockers;
mod bound;
mod degenerate;
mod exponential;
mod fourier;
mod hamburger;
mod hausdorff;
mod leak;
mod moments;
mod orthogonal;
mod quantization;
mod scattering;
mod six;
mod sparse;
mod trigonometric;
mod variance;

pub use bias::Bias;
pub use blockers::Blockers;
pub use bound::{
    Bounds, Canonical, Gradient, MAX, MAX_MOMENTS, bias_target, bound, bound_adjoint,
    bound_adjoint_compensated, bound_compensated, canonical, canonical_adjoint,
    canonical_compensated, mix_bias, mix_bias_adjoint, mix_bias_and_total,
};
pub use degenerate::{Degenerate4, Degenerate6, ThreePoints, degenerate_4, degenerate_6};
pub use exponential::{markov_1, warped_2};
pub use fourier::{OddHarmonics, fourier_light};
pub use hamburger::{blockers_4, hamburger_4, hamburger_4_bounds};
pub use hausdorff::{
    hausdorff_4, hausdorff_4_compensated, hausdorff_4_symmetric, hausdorff_4_symmetric_compensated,
};
pub use leak::cut_leak;
pub use moments::{Moments4, Moments6};
pub use quantization::{
    Fixed4, Fixed6, FixedPoint, Packed6, Quantized4, Quantized6, Rectangle4, Rectangle6, Region,
    Span, dequantize_symmetric_4, dequantize_symmetric_6, dequantize_unit_4, dequantize_unit_6,
    from_unorm, pack_10, pack_16, quantize_symmetric_4, quantize_symmetric_6, quantize_unit_4,
    quantize_unit_6, to_unorm, unpack_10, unpack_16,
};
pub use scattering::{
    RectifiedBounds, henyey_greenstein, inclination, rectified_bounds, rectified_depth,
    row_extinction, row_inclinations, transmittance,
};
pub use six::{blockers_6, hamburger_6, hamburger_6_compensated};
pub use sparse::{TwoPoints, sparse_2};
pub use trigonometric::{
    HalfAngle, TrigonometricMoments, trigonometric_4, trigonometric_4_compensated,
    trigonometric_4_lower,
};
pub use variance::{blockers_2, variance_2};
