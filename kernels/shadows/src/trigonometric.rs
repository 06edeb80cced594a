//! Trigonometric moment shadow mapping as maps over rows of moments.

use hankel_dsl::{Element, Real, kernel};
use hankel_moments::{HalfAngle, TrigonometricMoments, cut_leak, trigonometric_4};

use crate::bounds::Shadow;

/// How trigonometric moments are turned into a shadow.
#[derive(Clone, Copy, Debug, PartialEq, Element)]
#[repr(C)]
pub struct TrigonometricSettings<R> {
    /// How much of the uniform distribution is mixed in, from 0 to 1.
    #[magnitude(1e-7..=1e-2)]
    #[default(0)]
    pub moment_bias: R,
    /// What is taken off the receiver's depth.
    #[magnitude(1e-7..=1e-2)]
    #[default(0)]
    pub depth_bias: R,
    /// Where between the least shadow, 0, and the greatest, 1.
    #[range(0.0..=1.0)]
    #[default(0)]
    pub overestimation: R,
    /// A shadow of 1 minus this is full: from 0 to 0.5.
    #[range(0.0..=0.5)]
    #[default(0)]
    pub light_leak: R,
}

/// A receiver and the trigonometric moments at its place in the map.
#[derive(Clone, Copy, Debug, PartialEq, Element)]
#[repr(C)]
pub struct TrigonometricReceiver<R> {
    /// The filtered moments.
    pub moments: TrigonometricMoments<R>,
    /// The receiver's depth, from 0 to 1.
    #[range(0.0..=1.0)]
    pub depth: R,
}

/// A depth.
#[derive(Clone, Copy, Debug, PartialEq, Element)]
#[repr(C)]
pub struct UnitDepth<R> {
    /// Depth, from 0 to 1.
    #[range(0.0..=1.0)]
    pub depth: R,
}

/// Trigonometric moment shadow mapping: the shadow that two complex trigonometric moments allow,
/// for depths in [0, 1].
#[kernel(
    compute,
    threads(64),
    precision(f32, f64),
    inputs = crate::inputs::trigonometric_receivers
)]
pub fn trigonometric_4msm<R: Real>(
    #[uniform] settings: &TrigonometricSettings<R>,
    #[element] receiver: TrigonometricReceiver<R>,
) -> Shadow<R> {
    let m = receiver.moments.biased(settings.moment_bias);
    let query = HalfAngle::of_depth(receiver.depth - settings.depth_bias);
    let bounds = trigonometric_4(m, query);
    Shadow {
        shadow: cut_leak(bounds.blend(settings.overestimation), settings.light_leak),
    }
}

/// The trigonometric moments of one depth: what a map for them stores.
#[kernel(compute, threads(64), precision(f32, f64))]
pub fn trigonometric_moments<R: Real>(#[element] depth: UnitDepth<R>) -> TrigonometricMoments<R> {
    TrigonometricMoments::of_depth(depth.depth)
}
