//! Four moments: the published transforms for depths in [0, 1] and in [-1, 1].

use hankel_dsl::{Element, Real, lit};

use super::unorm::{from_unorm, to_unorm};
use crate::Moments4;
use crate::moments::within;

/// Four moments in the optimised basis: each channel is in [0, 1] for valid moments, up to rounding.
#[derive(Clone, Copy, Debug, PartialEq, Element)]
#[repr(C)]
pub struct Quantized4<R> {
    /// First channel (red).
    pub r: R,
    /// Second channel (green).
    pub g: R,
    /// Third channel (blue).
    pub b: R,
    /// Fourth channel (alpha).
    pub a: R,
}

impl<R: Real> Quantized4<R> {
    /// Each channel in [0, 1], where those of valid moments lie anyway; a NaN becomes 0.
    #[inline(always)]
    pub fn saturated(self) -> Self {
        self.map(
            #[inline(always)]
            |x| within(x, lit!(0.0), lit!(1.0)),
        )
    }

    /// What is left of it when each channel is stored in `BITS` bits, see [`to_unorm`].
    #[inline(always)]
    pub fn stored<const BITS: usize>(self) -> Self {
        self.map(
            #[inline(always)]
            |x| from_unorm::<R, BITS>(to_unorm::<R, BITS>(x)),
        )
    }

    #[inline(always)]
    fn map(self, f: impl Fn(R) -> R) -> Self {
        Self {
            r: f(self.r),
            g: f(self.g),
            b: f(self.b),
            a: f(self.a),
        }
    }
}

/// \[MSM\] adds this to the first channel.
macro_rules! unit_offset {
    () => {
        lit!(0.035_955_884_801)
    };
}

/// Moments of depths in [0, 1] to the optimised basis (\[MSM\], Listing 1): the inverse of [`dequantize_unit_4`], as far as
/// the digits of the listings go, which is 2e-9 in `f64`.
///
/// Its coefficients reach 82 and magnify the rounding of the moments. In `f32` a depth's channels
/// are off by up to 1.5e-5, a step of 16 bits; those of [`quantize_symmetric_4`], which gains nearly
/// as many bits, by 2.3e-7.
#[inline(always)]
pub fn quantize_unit_4<R: Real>(m: Moments4<R>) -> Quantized4<R> {
    let Moments4 { b1, b2, b3, b4 } = m;
    Quantized4 {
        r: b1 * lit!(-2.072_246_399_676) + unit_offset!() + b2 * lit!(32.237_037_479_455)
            - b3 * lit!(68.571_074_247_410)
            + b4 * lit!(39.370_327_278_740),
        g: b1 * lit!(13.794_885_600_594) - b2 * lit!(59.468_397_163_472)
            + b3 * lit!(82.035_974_564_713)
            - b4 * lit!(35.364_903_080_483),
        b: b1 * lit!(0.105_877_692_774) - b2 * lit!(1.907_746_593_505)
            + b3 * lit!(9.349_655_466_107)
            - b4 * lit!(6.654_349_056_870),
        a: b1 * lit!(9.792_406_137_529) - b2 * lit!(33.765_210_807_768)
            + b3 * lit!(47.945_609_373_036)
            - b4 * lit!(23.972_804_707_621),
    }
}

/// The optimised basis to moments of depths in [0, 1] (\[MSM\], Listing 2).
#[inline(always)]
pub fn dequantize_unit_4<R: Real>(q: Quantized4<R>) -> Moments4<R> {
    let Quantized4 { r, g, b, a } = q;
    let r = r - unit_offset!();
    Moments4 {
        b1: r * lit!(0.222_774_414_6)
            + g * lit!(0.077_197_286_1)
            + b * lit!(0.792_698_663_6)
            + a * lit!(0.031_941_755_5),
        b2: r * lit!(0.154_967_926_1) + g * lit!(0.139_462_942_6) + b * lit!(0.796_341_583_8)
            - a * lit!(0.172_282_317_3),
        b3: r * lit!(0.145_198_894_6) + g * lit!(0.212_020_215_7) + b * lit!(0.725_869_446_4)
            - a * lit!(0.275_801_481_1),
        b4: r * lit!(0.163_127_443) + g * lit!(0.259_143_226_6) + b * lit!(0.653_909_249_7)
            - a * lit!(0.337_613_173_4),
    }
}

/// Moments of depths in [-1, 1] to the optimised basis (the lecture; its square roots, lost in
/// print, follow from the requirement that the curve stays in the unit cube).
#[inline(always)]
pub fn quantize_symmetric_4<R: Real>(m: Moments4<R>) -> Quantized4<R> {
    let Moments4 { b1, b2, b3, b4 } = m;
    Quantized4 {
        r: b1 * lit!(1.5) + lit!(0.5) - b3 * lit!(2.0),
        g: (b2 - b4) * lit!(4.0),
        // sqrt(3) / 2 and sqrt(12) / 9.
        b: b1 * lit!(0.866_025_403_784_438_6) + lit!(0.5) - b3 * lit!(0.384_900_179_459_750_5),
        a: (b2 + b4) * lit!(0.5),
    }
}

/// The optimised basis to moments of depths in [-1, 1]: the inverse of [`quantize_symmetric_4`].
#[inline(always)]
pub fn dequantize_symmetric_4<R: Real>(q: Quantized4<R>) -> Moments4<R> {
    let r = q.r - lit!(0.5);
    // sqrt(3) (B - 1/2)
    let b = (q.b - lit!(0.5)) * lit!(1.732_050_807_568_877_2);
    let g = q.g * lit!(0.125);
    Moments4 {
        b1: b - r * lit!(1.0 / 3.0),
        b2: q.a + g,
        b3: (b - r) * lit!(0.75),
        b4: q.a - g,
    }
}
