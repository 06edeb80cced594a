//! Summed-area tables in 32-bit integers (the lecture, "SAT over a moment shadow map"). A table's
//! entry is the sum of all channels to its upper left, modulo 2^32. Four entries give the sum over a
//! rectangle; however often the entries wrapped, it is exact as long as it is itself below 2^32.

use hankel_dsl::{Element, Real, lit, to_i32};

use super::four::Quantized4;
use super::six::Quantized6;
use super::unorm::nearest;
use crate::moments::within;

/// The fixed point of a summed-area table.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Element)]
#[repr(C)]
pub struct FixedPoint {
    /// The integer that stands for 1: see `FixedPoint::for_kernel`. The default is for kernels of at
    /// most 27 x 27 texels.
    #[range(1..=16_777_216)]
    #[default(5_891_580)]
    pub one: u32,
}

impl FixedPoint {
    /// The finest for kernels of at most `texels` texels: log2(2^32 / `texels`) bits after the
    /// point, 22.5 for 27 x 27.
    ///
    /// The lecture's factor is 2^32 / `texels`. Here it is (2^32 - 1) / `texels`, rounded down, so
    /// that a kernel full of ones does not wrap to 0; and at most 2^24, which is all that a 32-bit
    /// float in [0.5, 1] resolves, so that every conversion is exact. No texels count as one; with
    /// more than 2^32 - 1 of them there would be no bit left.
    #[must_use]
    pub const fn for_kernel(texels: u32) -> Self {
        let texels = if texels == 0 { 1 } else { texels };
        let one = u32::MAX / texels;
        Self {
            one: if one < 1 << 24 { one } else { 1 << 24 },
        }
    }

    /// The integer for `x`: the nearest. Below 0 and NaN count as 0, above 1 as 1.
    #[inline(always)]
    #[must_use]
    pub fn to_fixed(self, x: f32) -> u32 {
        let n = nearest(within(x, 0.0, 1.0) * self.one as f32);
        to_i32(Real::min(n, lit!(16_777_216.0))) as u32
    }

    /// The mean, in [0, 1], of `texels` numbers whose integers add up to `sum`; 0 texels count as
    /// one.
    #[inline(always)]
    #[must_use]
    pub fn mean(self, sum: u32, texels: u32) -> f32 {
        let most = texels as f32 * self.one as f32;
        Real::saturate(sum as f32 / Real::max(most, lit!(1.0)))
    }
}

/// The integers of a [`Quantized4`]'s channels, or sums of them modulo 2^32.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Element)]
#[repr(C)]
pub struct Fixed4 {
    /// Of the first channel (red).
    pub r: u32,
    /// Of the second channel (green).
    pub g: u32,
    /// Of the third channel (blue).
    pub b: u32,
    /// Of the fourth channel (alpha).
    pub a: u32,
}

/// A rectangle of a summed-area table of [`Fixed4`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Element)]
#[repr(C)]
pub struct Rectangle4 {
    /// The entry left of and above the rectangle's first texel; 0 at the table's edge.
    pub before_both: Fixed4,
    /// The entry above the rectangle's last column; 0 at the table's edge.
    pub before_row: Fixed4,
    /// The entry left of the rectangle's last row; 0 at the table's edge.
    pub before_column: Fixed4,
    /// The entry at the rectangle's last texel.
    pub last: Fixed4,
    /// Texels of the rectangle; no more than the fixed point is for.
    #[range(1..=16_777_216)]
    pub texels: u32,
}

/// The integers of a [`Quantized6`]'s channels, or sums of them modulo 2^32.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Element)]
#[repr(C)]
pub struct Fixed6 {
    /// Of the first texel's red channel.
    pub r0: u32,
    /// Of the first texel's green channel.
    pub g0: u32,
    /// Of the first texel's blue channel.
    pub b0: u32,
    /// Of the second texel's red channel.
    pub r1: u32,
    /// Of the second texel's green channel.
    pub g1: u32,
    /// Of the second texel's blue channel.
    pub b1: u32,
}

/// A rectangle of a summed-area table of [`Fixed6`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Element)]
#[repr(C)]
pub struct Rectangle6 {
    /// The entry left of and above the rectangle's first texel; 0 at the table's edge.
    pub before_both: Fixed6,
    /// The entry above the rectangle's last column; 0 at the table's edge.
    pub before_row: Fixed6,
    /// The entry left of the rectangle's last row; 0 at the table's edge.
    pub before_column: Fixed6,
    /// The entry at the rectangle's last texel.
    pub last: Fixed6,
    /// Texels of the rectangle; no more than the fixed point is for.
    #[range(1..=16_777_216)]
    pub texels: u32,
}

macro_rules! sums {
    ($fixed:ident, $rectangle:ident, $quantized:ident, $($channel:ident)*) => {
        impl $fixed {
            /// The integers of a texel's channels.
            #[inline(always)]
            #[must_use]
            pub fn of(q: $quantized<f32>, point: FixedPoint) -> Self {
                Self { $($channel: point.to_fixed(q.$channel),)* }
            }

            /// The sum, modulo 2^32.
            #[inline(always)]
            #[must_use]
            pub fn plus(self, other: Self) -> Self {
                Self { $($channel: self.$channel.wrapping_add(other.$channel),)* }
            }

            /// The difference, modulo 2^32.
            #[inline(always)]
            #[must_use]
            pub fn minus(self, other: Self) -> Self {
                Self { $($channel: self.$channel.wrapping_sub(other.$channel),)* }
            }
        }

        impl $rectangle {
            /// The sum over the rectangle: exact if `texels` is no more than the fixed point is
            /// for.
            #[inline(always)]
            #[must_use]
            pub fn sum(self) -> $fixed {
                self.last
                    .minus(self.before_row)
                    .minus(self.before_column)
                    .plus(self.before_both)
            }

            /// The mean over the rectangle, each channel in [0, 1].
            #[inline(always)]
            #[must_use]
            pub fn mean(self, point: FixedPoint) -> $quantized<f32> {
                let sum = self.sum();
                $quantized { $($channel: point.mean(sum.$channel, self.texels),)* }
            }
        }
    };
}

sums!(Fixed4, Rectangle4, Quantized4, r g b a);
sums!(Fixed6, Rectangle6, Quantized6, r0 g0 b0 r1 g1 b1);
