//! Six moment shadow mapping as a map over rows of moments.

use hankel_dsl::{Element, Real, kernel};
use hankel_moments::{Moments6, cut_leak, hamburger_6};

use crate::bounds::Shadow;

/// How six moments are turned into a shadow.
#[derive(Clone, Copy, Debug, PartialEq, Element)]
#[repr(C)]
pub struct Settings6<R> {
    /// How much of `bias_target` is mixed in, from 0 to 1.
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
    /// The moment vector that the bias mixes in.
    #[default(0)]
    pub bias_target: Moments6<R>,
}

/// A receiver and the six moments at its place in the map.
#[derive(Clone, Copy, Debug, PartialEq, Element)]
#[repr(C)]
pub struct Receiver6<R> {
    /// The filtered moments.
    pub moments: Moments6<R>,
    /// The receiver's depth, in the moments' range.
    pub depth: R,
}

/// Hamburger six moment shadow mapping: the shadow that the moments allow, for depths anywhere in
/// [-1, 1].
#[kernel(
    compute,
    threads(64),
    precision(f32, f64),
    inputs = crate::inputs::receivers_6
)]
pub fn hamburger_6msm<R: Real>(
    #[uniform] settings: &Settings6<R>,
    #[element] receiver: Receiver6<R>,
) -> Shadow<R> {
    let m = receiver.moments.clamped().lerp(
        settings.bias_target.clamped(),
        settings.moment_bias.saturate(),
    );
    let bounds = hamburger_6(m, receiver.depth - settings.depth_bias);
    Shadow {
        shadow: cut_leak(bounds.blend(settings.overestimation), settings.light_leak),
    }
}
