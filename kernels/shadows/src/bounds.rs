//! Single functions as maps over rows: for other engines to take from the generated code, for
//! `hankel eval`, and for parity in both precisions.

use hankel_dsl::{Element, Real, kernel};
use hankel_moments::{
    Moments4, cut_leak, hamburger_4, hausdorff_4, hausdorff_4_compensated, variance_2,
};

/// How a bound is turned into a shadow.
#[derive(Clone, Copy, Debug, PartialEq, Element)]
#[repr(C)]
pub struct Settings<R> {
    /// The moment vector that the bias mixes in.
    #[default(0)]
    pub bias_target: Moments4<R>,
    /// How much of it, from 0 to 1.
    #[magnitude(1e-7..=1e-2)]
    #[default(0)]
    pub moment_bias: R,
    /// What is taken off the receiver's depth.
    #[magnitude(1e-7..=1e-2)]
    #[default(0)]
    pub depth_bias: R,
    /// A shadow of 1 minus this is full: from 0 to 0.5, 0.02 in the lecture.
    #[range(0.0..=0.5)]
    #[default(0)]
    pub light_leak: R,
    /// The least variance of variance shadow mapping.
    #[magnitude(1e-7..=1e-2)]
    #[default(0)]
    pub least_variance: R,
}

/// A receiver and the four moments at its place in the map.
#[derive(Clone, Copy, Debug, PartialEq, Element)]
#[repr(C)]
pub struct Receiver4<R> {
    /// The filtered moments.
    pub moments: Moments4<R>,
    /// The receiver's depth, in the moments' range.
    pub depth: R,
}

/// A receiver and the two moments at its place in the map.
#[derive(Clone, Copy, Debug, PartialEq, Element)]
#[repr(C)]
pub struct Receiver2<R> {
    /// Mean depth.
    pub b1: R,
    /// Mean square of the depth.
    pub b2: R,
    /// The receiver's depth, in the moments' range.
    pub depth: R,
}

/// A shadow.
#[derive(Clone, Copy, Debug, PartialEq, Element)]
#[repr(C)]
pub struct Shadow<R> {
    /// 0: lit, 1: in full shadow.
    pub shadow: R,
}

#[inline(always)]
fn biased<R: Real>(settings: &Settings<R>, receiver: Receiver4<R>) -> (Moments4<R>, R) {
    let m = receiver
        .moments
        .lerp(settings.bias_target, settings.moment_bias);
    (m, receiver.depth - settings.depth_bias)
}

#[inline(always)]
fn cut<R: Real>(shadow: R, settings: &Settings<R>) -> Shadow<R> {
    Shadow {
        shadow: cut_leak(shadow, settings.light_leak),
    }
}

/// Hamburger four moment shadow mapping: the least shadow that the moments allow, for depths in
/// [-1, 1] or [0, 1]. Other depths: `moment_bound_n2`.
#[kernel(
    compute,
    threads(64),
    precision(f32, f64),
    inputs = crate::inputs::receivers_4
)]
pub fn hamburger_4msm<R: Real>(
    #[uniform] settings: &Settings<R>,
    #[element] receiver: Receiver4<R>,
) -> Shadow<R> {
    let (m, z) = biased(settings, receiver);
    cut(hamburger_4(m, z), settings)
}

/// Hausdorff four moment shadow mapping: the least shadow that the moments allow, for depths in
/// [0, 1].
#[kernel(
    compute,
    threads(64),
    precision(f32, f64),
    compensated = hausdorff_4msm_compensated,
    inputs = crate::inputs::unit_receivers_4
)]
pub fn hausdorff_4msm<R: Real>(
    #[uniform] settings: &Settings<R>,
    #[element] receiver: Receiver4<R>,
) -> Shadow<R> {
    let (m, z) = biased(settings, receiver);
    cut(hausdorff_4(m, z), settings)
}

/// `hausdorff_4msm` with what is ill-conditioned in about twice the digits.
#[kernel(
    compute,
    threads(64),
    precision(f32, f64),
    pinned,
    inputs = crate::inputs::unit_receivers_4,
    parity(
        absolute = 2e-45,
        why = "shaders take a product's error from partial products, which may underflow: one subnormal step"
    )
)]
pub fn hausdorff_4msm_compensated<R: Real>(
    #[uniform] settings: &Settings<R>,
    #[element] receiver: Receiver4<R>,
) -> Shadow<R> {
    let (m, z) = biased(settings, receiver);
    cut(hausdorff_4_compensated(m, z), settings)
}

/// Variance shadow mapping: the least shadow that two moments allow.
#[kernel(
    compute,
    threads(64),
    precision(f32, f64),
    inputs = crate::inputs::receivers_2
)]
pub fn vsm<R: Real>(
    #[uniform] settings: &Settings<R>,
    #[element] receiver: Receiver2<R>,
) -> Shadow<R> {
    let z = receiver.depth - settings.depth_bias;
    cut(
        variance_2(receiver.b1, receiver.b2, z, settings.least_variance),
        settings,
    )
}
