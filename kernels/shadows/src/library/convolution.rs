//! Convolution shadow maps: the Fourier series of a depth comparison (\[CSM\]).

use hankel_dsl::function;
use hankel_dsl::glam::Vec4;
use hankel_moments::{OddHarmonics, fourier_light};

use crate::convolution::{Terms, high, low};

/// The cosines of terms 1 to 4 that a convolution shadow map stores of a depth in [0, 1], moved to [0, 1]:
/// of (2k - 1) pi depth for term k (\[CSM\], section 3). Their mean is that of the filter region.
#[function]
pub fn convolution_cosines_of_depth(depth: f32) -> Vec4 {
    low(depth).cosines
}

/// The sines of terms 1 to 4, likewise.
#[function]
pub fn convolution_sines_of_depth(depth: f32) -> Vec4 {
    low(depth).sines
}

/// The cosines of terms 5 to 8, likewise.
#[function]
pub fn convolution_high_cosines_of_depth(depth: f32) -> Vec4 {
    high(depth).cosines
}

/// The sines of terms 5 to 8, likewise.
#[function]
pub fn convolution_high_sines_of_depth(depth: f32) -> Vec4 {
    high(depth).sines
}

/// Convolution shadow mapping by four terms: the share of the filter region that is nearer than `depth`, in
/// [0, 1], from means of `convolution_cosines_of_depth` and `convolution_sines_of_depth`.
///
/// `weights` are 2 / ((2k - 1) pi) for term k, times what attenuates ringing (\[CSM\], section 4), if
/// anything. It is an estimate and no bound. `cosines` and `sines` are clamped to [0, 1], and so is `depth`.
#[function]
pub fn convolution_shadow(cosines: Vec4, sines: Vec4, weights: Vec4, depth: f32) -> f32 {
    let [receiver, _] = OddHarmonics::of_depth(depth);
    let terms = Terms { cosines, sines };
    1.0 - fourier_light(terms.sum(weights, receiver))
}

/// `convolution_shadow` by eight terms: `high_cosines`, `high_sines` and `high_weights` are those of terms 5
/// to 8.
#[function]
pub fn convolution_shadow_of_eight(
    cosines: Vec4,
    sines: Vec4,
    high_cosines: Vec4,
    high_sines: Vec4,
    weights: Vec4,
    high_weights: Vec4,
    depth: f32,
) -> f32 {
    let [receiver, high_receiver] = OddHarmonics::of_depth(depth);
    let first = Terms { cosines, sines };
    let second = Terms {
        cosines: high_cosines,
        sines: high_sines,
    };
    1.0 - fourier_light(first.sum(weights, receiver) + second.sum(high_weights, high_receiver))
}
