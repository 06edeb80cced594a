//! Six moment shadow mapping: as a map over rows of moments, and from depths to shading. Six moments lie in
//! two textures, whose fourth channels are not used: the odd ones in the first, the even ones in the second.

use core::ops::{AddAssign, Div};

use hankel_dsl::glam::{UVec2, Vec3, Vec4};
use hankel_dsl::{Element, Real, Sampler, Texture2d, kernel};
use hankel_moments::{
    Bounds, Moments6, Quantized6, cut_leak, dequantize_symmetric_6, hamburger_6,
    hamburger_6_compensated, quantize_symmetric_6,
};

use crate::bounds::Shadow;
use crate::samples::Samples;
use crate::shade::{Light, encoding};

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

#[inline(always)]
fn biased<R: Real>(settings: &Settings6<R>, receiver: Receiver6<R>) -> (Moments6<R>, R) {
    let m = receiver.moments.clamped().lerp(
        settings.bias_target.clamped(),
        settings.moment_bias.saturate(),
    );
    (m, receiver.depth - settings.depth_bias)
}

#[inline(always)]
fn shadow<R: Real>(settings: &Settings6<R>, bounds: Bounds<R>) -> Shadow<R> {
    Shadow {
        shadow: cut_leak(bounds.blend(settings.overestimation), settings.light_leak),
    }
}

/// Hamburger six moment shadow mapping: the shadow that the moments allow, for depths anywhere in
/// [-1, 1].
#[kernel(
    compute,
    threads(64),
    precision(f32, f64),
    compensated = hamburger_6msm_compensated,
    inputs = crate::inputs::receivers_6
)]
pub fn hamburger_6msm<R: Real>(
    #[uniform] settings: &Settings6<R>,
    #[element] receiver: Receiver6<R>,
) -> Shadow<R> {
    let (m, z) = biased(settings, receiver);
    shadow(settings, hamburger_6(m, z))
}

/// `hamburger_6msm` with what is ill-conditioned in about twice the digits.
#[kernel(
    compute,
    threads(64),
    precision(f32, f64),
    pinned,
    inputs = crate::inputs::receivers_6,
    parity(
        absolute = 2e-45,
        why = "shaders take a product's error from partial products, which may underflow: one subnormal step"
    )
)]
pub fn hamburger_6msm_compensated<R: Real>(
    #[uniform] settings: &Settings6<R>,
    #[element] receiver: Receiver6<R>,
) -> Shadow<R> {
    let (m, z) = biased(settings, receiver);
    shadow(settings, hamburger_6_compensated(m, z))
}

/// A texel of each texture.
#[derive(Clone, Copy)]
pub(crate) struct Texels {
    pub(crate) first: Vec4,
    pub(crate) second: Vec4,
}

impl AddAssign for Texels {
    #[inline(always)]
    fn add_assign(&mut self, other: Self) {
        self.first += other.first;
        self.second += other.second;
    }
}

impl Div<f32> for Texels {
    type Output = Self;
    #[inline(always)]
    fn div(self, by: f32) -> Self {
        Self {
            first: self.first / by,
            second: self.second / by,
        }
    }
}

/// Depth in [0, 1] as a depth in [-1, 1].
#[inline(always)]
fn symmetric(z: f32) -> Moments6<f32> {
    Moments6::of_depth(2.0 * z - 1.0)
}

/// Means of a texel's six moments, depths moved to [-1, 1], in the optimised basis.
#[inline(always)]
pub(crate) fn quantized(depth: impl Samples, at: UVec2, samples: u32) -> Texels {
    // Half by half: glslang takes minutes for pinned sums of a structure in a loop (it looks for what
    // has to be `precise` through each member again).
    let sum = |half: usize| depth.mean_of_depths(at, samples, |z| halves(z)[half]);
    Texels {
        first: sum(0),
        second: sum(1),
    }
}

#[inline(always)]
fn mean_symmetric(depth: impl Samples, at: UVec2, samples: u32) -> (Vec4, Vec4) {
    let texels = quantized(depth, at, samples);
    (texels.first, texels.second)
}

/// Means of a texel's six moments, depths moved to [-1, 1], as they are.
#[inline(always)]
fn mean_plain(depth: impl Samples, at: UVec2, samples: u32) -> (Vec4, Vec4) {
    let texels = depth.mean_of_depths(at, samples, |z| {
        let [first, second] = plain_halves(z);
        Texels { first, second }
    });
    (texels.first, texels.second)
}

of_samples! {
    /// Means of a texel's six moments, depths moved to [-1, 1], in the basis optimised for 16 bits.
    #[kernel(
        compute,
        threads(8, 8),
        outputs(rgba16unorm, rgba16unorm),
        forms(fragment),
        inputs = crate::inputs::maps::depths,
        parity(
            ulp = 0,
            absolute = 1.6e-5,
            why = "sums and products only, then rounding to 1/65535: drivers may round a tie either way, which is one step"
        )
    )]
    resolve_symmetric_6,
    resolve_single_symmetric_6,
    (#[index] at: UVec2,) -> (Vec4, Vec4),
    |depth; samples| { mean_symmetric(depth, at, samples) }
}

of_samples! {
    /// Means of a texel's six moments, depths moved to [-1, 1], as they are, for 32-bit maps.
    #[kernel(
        compute,
        threads(8, 8),
        outputs(rgba32float, rgba32float),
        forms(fragment),
        inputs = crate::inputs::maps::depths
    )]
    resolve_plain_6,
    resolve_single_plain_6,
    (#[index] at: UVec2,) -> (Vec4, Vec4),
    |depth; samples| { mean_plain(depth, at, samples) }
}

shading! {
    /// Shading with Hamburger six moment shadow mapping. `target` is the moment vector that the bias mixes in;
    /// the light's own is for four.
    shade_hamburger_6,
    /// Shading with Hamburger six moment shadow mapping, with mip levels. `target` is the moment vector that the bias
    /// mixes in; the light's own is for four.
    shade_hamburger_6_mips,
    hamburger_6_shadow(first, second), inputs(shaded_6), uniforms(target: &Moments6<f32>), constants(
        #[constant(id = 0, default = 2)]
        #[values(encoding::PLAIN, encoding::SYMMETRIC)]
        encoding: u32
    ),
    parity(
        ulp = 0,
        absolute = 4e-4,
        why = "the depth in the light's view is rounded, by up to 3e-7; with the least bias, 5e-6, the bound's steepest slope is 0.65 over a deviation of 1.5e-3, and the light's strength is 2.5"
    )
}

/// The least shadow that six moments allow for a receiver's depth from 0 to 1, of a texel of each texture.
#[inline(always)]
pub(crate) fn hamburger_6_shadow(
    light: &Light,
    target: &Moments6<f32>,
    odd: Vec4,
    even: Vec4,
    z: f32,
    how: u32,
) -> f32 {
    let m = if how == encoding::SYMMETRIC {
        dequantize_symmetric_6(Quantized6 {
            r0: odd.x,
            g0: odd.y,
            b0: odd.z,
            r1: even.x,
            g1: even.y,
            b1: even.z,
        })
    } else {
        Moments6 {
            b1: odd.x,
            b2: even.x,
            b3: odd.y,
            b4: even.y,
            b5: odd.z,
            b6: even.z,
        }
    };
    hamburger_6(m.lerp(*target, light.moment_bias), 2.0 * z - 1.0).lower
}

/// Quantised moments of a depth in [0, 1]: the odd ones, and the even ones.
#[inline(always)]
pub(crate) fn halves(z: f32) -> [Vec4; 2] {
    let q = quantize_symmetric_6(symmetric(z));
    [
        Vec4::new(q.r0, q.g0, q.b0, 0.0),
        Vec4::new(q.r1, q.g1, q.b1, 0.0),
    ]
}

/// Moments of a depth in [0, 1] as they are: the odd ones, and the even ones.
#[inline(always)]
pub(crate) fn plain_halves(z: f32) -> [Vec4; 2] {
    let m = symmetric(z);
    [
        Vec4::new(m.b1, m.b3, m.b5, 0.0),
        Vec4::new(m.b2, m.b4, m.b6, 0.0),
    ]
}
