//! Six moments: the published transforms for depths in [0, 1] and in [-1, 1].

use hankel_dsl::{Element, Real, lit};

use super::unorm::{from_unorm, to_unorm};
use crate::Moments6;
use crate::moments::within;

/// Six moments in the optimised basis: each channel is in [0, 1] for valid moments, up to rounding. Two texels of
/// three channels.
#[derive(Clone, Copy, Debug, PartialEq, Element)]
#[repr(C)]
pub struct Quantized6<R> {
    /// The first texel's red channel, [0, 1].
    pub r0: R,
    /// The first texel's green channel, [0, 1].
    pub g0: R,
    /// The first texel's blue channel, [0, 1].
    pub b0: R,
    /// The second texel's red channel, [0, 1].
    pub r1: R,
    /// The second texel's green channel, [0, 1].
    pub g1: R,
    /// The second texel's blue channel, [0, 1].
    pub b1: R,
}

impl<R: Real> Quantized6<R> {
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
            r0: f(self.r0),
            g0: f(self.g0),
            b0: f(self.b0),
            r1: f(self.r1),
            g1: f(self.g1),
            b1: f(self.b1),
        }
    }
}

/// Moments of depths in [0, 1] to the optimised basis (\[BHS\], Table 1 of the supplement).
///
/// Its coefficients reach 3456 and magnify the rounding of the moments. In `f32` a depth's channels
/// are off by up to 6.3e-4, more than half a step of 10 bits; those of [`quantize_symmetric_6`],
/// which gains as many bits, by 3.4e-6.
#[inline(always)]
pub fn quantize_unit_6<R: Real>(m: Moments6<R>) -> Quantized6<R> {
    let Moments6 {
        b1,
        b2,
        b3,
        b4,
        b5,
        b6,
    } = m;
    Quantized6 {
        r0: b1 * lit!(-0.399_821_744_17) + lit!(0.999_944_693_3) + b2 * lit!(5.372_499_433)
            - b3 * lit!(19.400_931_206)
            + b4 * lit!(5.960_150_628_3)
            + b5 * lit!(21.716_342_727)
            - b6 * lit!(14.248_134_4),
        g0: b1 * lit!(-0.203_645_803_7) + lit!(0.000_369_842_4) + b2 * lit!(61.687_438_614)
            - b3 * lit!(280.261_084_56)
            + b4 * lit!(480.867_774_52)
            - b5 * lit!(370.617_028_6)
            + b6 * lit!(109.526_059_42),
        b0: b1 * lit!(35.997_693_025) - b2 * lit!(419.960_561_41) + b3 * lit!(1_791.820_766_6)
            - b4 * lit!(3_455.657_854_7)
            + b5 * lit!(3_071.706_068_1)
            - b6 * lit!(1_023.906_108),
        r1: b1 * lit!(24.253_667_437) + lit!(0.000_080_780_2) - b2 * lit!(187.462_439_64)
            + b3 * lit!(499.102_282_52)
            - b4 * lit!(516.528_818_73)
            + b5 * lit!(144.631_795_23)
            + b6 * lit!(37.003_250_859),
        g1: b1 * lit!(14.571_662_352) + lit!(0.000_005_927_4) - b2 * lit!(64.120_119_623)
            + b3 * lit!(75.292_307_128)
            + b4 * lit!(8.798_154_992)
            - b5 * lit!(43.073_239_823)
            + b6 * lit!(8.531_561_620_9),
        b1: b1 * lit!(2.546_432_685_7) + lit!(0.977_460_266_9) - b2 * lit!(78.049_820_13)
            + b3 * lit!(350.776_912_36)
            - b4 * lit!(674.561_536_41)
            + b5 * lit!(598.689_027_36)
            - b6 * lit!(199.398_971_52),
    }
}

/// The optimised basis to moments of depths in [0, 1]: the inverse of [`quantize_unit_6`].
#[inline(always)]
pub fn dequantize_unit_6<R: Real>(q: Quantized6<R>) -> Moments6<R> {
    let Quantized6 {
        r0,
        g0,
        b0,
        r1,
        g1,
        b1,
    } = q;
    Moments6 {
        b1: r0 * lit!(-0.792_373_259_668_460_3)
            + lit!(0.798_552_261_964_285_1)
            + g0 * lit!(0.234_139_857_333_348_4)
            + b0 * lit!(0.036_420_229_235_185_46)
            - r1 * lit!(0.026_311_192_653_028)
            + g1 * lit!(0.005_106_059_004_521_581_5)
            - b1 * lit!(0.006_452_769_231_234_413),
        b2: r0 * lit!(-0.792_758_996_038_331_4)
            + lit!(0.587_326_009_597_395)
            + g0 * lit!(0.233_887_974_050_046_24)
            - b0 * lit!(0.005_792_776_305_803_658)
            - r1 * lit!(0.026_887_307_924_913_017)
            + g1 * lit!(0.003_874_658_958_810_398_7)
            + b1 * lit!(0.210_039_012_136_928_63),
        b3: r0 * lit!(-0.733_942_572_105_381)
            + lit!(0.417_931_629_992_886_8)
            + g0 * lit!(0.279_972_066_601_200_66)
            - b0 * lit!(0.023_218_014_282_926_56)
            - r1 * lit!(0.014_368_192_159_273_879)
            + g1 * lit!(0.008_575_636_229_371_79)
            + b1 * lit!(0.323_151_666_784_141_6),
        b4: r0 * lit!(-0.674_889_366_305_697_2)
            + lit!(0.301_298_005_067_824_17)
            + g0 * lit!(0.327_148_295_758_921)
            - b0 * lit!(0.030_124_608_752_137_284)
            - r1 * lit!(0.002_588_328_700_099_025)
            - g1 * lit!(0.001_981_286_654_658_833_3)
            + b1 * lit!(0.382_044_442_621_923_2),
        b5: r0 * lit!(-0.623_686_685_481_449_7)
            + lit!(0.219_884_683_856_259_23)
            + g0 * lit!(0.365_296_195_980_286_2)
            - b0 * lit!(0.032_463_881_970_808_184)
            + r1 * lit!(0.010_426_190_161_885_509)
            - g1 * lit!(0.021_325_151_280_361_745)
            + b1 * lit!(0.412_939_229_748_987_3),
        b6: r0 * lit!(-0.580_409_737_308_330_5)
            + lit!(0.161_332_324_013_335_55)
            + g0 * lit!(0.394_015_128_562_457_7)
            - b0 * lit!(0.033_672_912_438_249_8)
            + r1 * lit!(0.024_972_808_928_384_004)
            - g1 * lit!(0.043_690_863_815_864_525)
            + b1 * lit!(0.428_557_400_333_260_7),
    }
}

/// The lecture adds this to the last channel.
macro_rules! symmetric_offset {
    () => {
        lit!(0.018_888_946)
    };
}

/// Moments of depths in [-1, 1] to the optimised basis (the lecture): the odd moments make the first
/// texel, the even ones the second.
#[inline(always)]
pub fn quantize_symmetric_6<R: Real>(m: Moments6<R>) -> Quantized6<R> {
    let Moments6 {
        b1,
        b2,
        b3,
        b4,
        b5,
        b6,
    } = m;
    Quantized6 {
        r0: b1 * lit!(2.5) + lit!(0.5) - b3 * lit!(10.0) + b5 * lit!(8.0),
        g0: b1 * lit!(-1.874_998_64) + lit!(0.5) + b3 * lit!(4.207_575_43)
            - b5 * lit!(1.832_576_79),
        b0: b1 * lit!(1.265_830_39) + lit!(0.5) - b3 * lit!(1.476_448_83) + b5 * lit!(0.710_616_6),
        r1: (b2 - b4) * lit!(4.0),
        g1: b2 * lit!(9.0) - b4 * lit!(24.0) + b6 * lit!(16.0),
        b1: b2 * lit!(-0.577_598_06) + symmetric_offset!() + b4 * lit!(4.619_366_48)
            - b6 * lit!(3.079_539_07),
    }
}

/// The optimised basis to moments of depths in [-1, 1]: the inverse of [`quantize_symmetric_6`].
#[inline(always)]
pub fn dequantize_symmetric_6<R: Real>(q: Quantized6<R>) -> Moments6<R> {
    let r0 = q.r0 - lit!(0.5);
    let g0 = q.g0 - lit!(0.5);
    let b0 = q.b0 - lit!(0.5);
    let Quantized6 { r1, g1, .. } = q;
    let b1 = q.b1 - symmetric_offset!();
    Moments6 {
        b1: r0 * lit!(-0.028_777_890_285_483_478)
            + g0 * lit!(0.476_355_509_862_619_54)
            + b0 * lit!(1.552_428_093_358_247_5),
        b2: r1 * lit!(0.000_012_530_305_023_071_764)
            + g1 * lit!(0.166_684_941_155_795_88)
            + b1 * lit!(0.866_025_401_162_627_3),
        b3: r0 * lit!(0.099_952_358_753_959_8)
            + g0 * lit!(0.845_325_814_122_439_1)
            + b0 * lit!(1.054_725_708_514_208_3),
        b4: r1 * lit!(-0.249_987_469_694_976_93)
            + g1 * lit!(0.166_684_941_155_795_88)
            + b1 * lit!(0.866_025_401_162_627_3),
        b5: r0 * lit!(0.258_933_539_156_663_34)
            + g0 * lit!(0.907_796_170_820_980_3)
            + b0 * lit!(0.833_273_356_468_308_1),
        b6: r1 * lit!(-0.374_988_252_839_040_86)
            + g1 * lit!(0.218_767_132_333_558_66)
            + b1 * lit!(0.811_898_813_589_963_1),
    }
}
