//! Means over a rectangle of any size and place, from a summed-area table in integers (\[BHS\], lecture,
//! "Caveat: bilinear interpolation").
//!
//! Entries wrap, so they must not be interpolated. Along each axis the rectangle's two ends lie within a
//! texel each: with the whole texels between, these make three by three smaller rectangles. Their sums do
//! not wrap. They are weighted by how much of them the rectangle covers. That takes 4 x 4 entries. Where a texel more or
//! less does not matter, all texels that the rectangle touches take 2 x 2.

use hankel_dsl::{Real, lit, to_i32};

use super::fixed_point::{Fixed4, Fixed6, FixedPoint};
use super::four::Quantized4;
use super::six::Quantized6;

/// One axis of a rectangle: a texel of which a part counts, then some that count wholly, then another of
/// which a part counts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Span {
    /// Texels before the first one.
    pub first: u32,
    /// Texels before the first whole one.
    pub whole: u32,
    /// Texels before the last one: never less than `whole`.
    pub last: u32,
    /// Texels up to the end of the last one; `last` if nothing of it counts.
    pub end: u32,
    /// How much of the first one counts, 0 to 1.
    pub first_share: f32,
    /// How much of the last one counts, 0 to 1.
    pub last_share: f32,
    /// Length in texels, also of what lies beyond the table: the sum of all shares, so that the weights of a mean have
    /// the sum 1. Twice the reach differs from it by what the ends were rounded.
    pub length: f32,
    /// Length of what lies on the table.
    pub inside: f32,
}

impl Span {
    /// The texels within `reach` of `middle`, both in texels, from 0 at the first texel's first edge.
    /// The reach is raised to half a texel and cut at 32768; `middle` is moved to less than 65536 from the
    /// table of `size` texels, of which there are from 1 to 65536.
    #[inline(always)]
    #[must_use]
    pub fn around(middle: f32, reach: f32, size: u32) -> Self {
        let edge = size as f32;
        let middle = Real::clamp(middle, -65536.0, edge + 65536.0);
        let reach = Real::clamp(reach, 0.5, 32768.0);
        let (start, stop) = (middle - reach, middle + reach);
        let on = |x: f32| Real::clamp(x, 0.0, edge);
        let (from, to) = (on(start), on(stop));
        let first = Real::min(Real::floor(from), edge - 1.0);
        let whole = first + 1.0;
        let last = Real::max(Real::floor(to), whole);
        let first_share = Real::saturate(Real::min(whole, to) - from);
        let last_share = Real::saturate(to - last);
        let end = if last_share > 0.0 { last + 1.0 } else { last };
        let inside = first_share + (last - whole) + last_share;
        let before = Real::min(stop, 0.0) - Real::min(start, 0.0);
        let after = Real::max(stop, edge) - Real::max(start, edge);
        Self {
            first: to_i32(first) as u32,
            whole: to_i32(whole) as u32,
            last: to_i32(last) as u32,
            end: to_i32(end) as u32,
            first_share,
            last_share,
            length: inside + (before + after),
            inside,
        }
    }
}

/// A rectangle over a summed-area table.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Region {
    /// Along rows.
    pub x: Span,
    /// Along columns.
    pub y: Span,
}

macro_rules! means {
    ($region:ident, $touched:ident: $fixed:ident, $quantized:ident, $($channel:ident)*) => {
        impl Region {
            /// The mean over the rectangle, each channel in [0, 1]. `before` gives the sum, modulo 2^32, over
            /// so many columns and so many rows, from the first on. What lies beyond the table counts as
            /// `beyond`.
            #[inline(always)]
            #[must_use]
            pub fn $region(
                self,
                point: FixedPoint,
                beyond: $quantized<f32>,
                before: impl Fn(u32, u32) -> $fixed,
            ) -> $quantized<f32> {
                let Self { x, y } = self;
                let zero: f32 = lit!(0.0);
                let one: f32 = lit!(1.0);
                // Sums over the three parts of so many rows.
                let row = |rows: u32| {
                    let start = before(x.first, rows);
                    let (whole, last) = (before(x.whole, rows), before(x.last, rows));
                    let end = before(x.end, rows);
                    (whole.minus(start), last.minus(whole), end.minus(last))
                };
                // A loop, so that a shader has the code that reads entries once for each of four columns, and not
                // for each of sixteen entries.
                let nothing = $fixed { $($channel: 0,)* };
                let mut above = (nothing, nothing, nothing);
                let mut mean = $quantized { $($channel: zero,)* };
                let mut k = 0;
                while k < 4 {
                    // What lies above the first rows counts as nothing.
                    let (rows, share) = if k == 0 {
                        (y.first, zero)
                    } else if k == 1 {
                        (y.whole, y.first_share)
                    } else if k == 2 {
                        (y.last, one)
                    } else {
                        (y.end, y.last_share)
                    };
                    let below = row(rows);
                    let first = below.0.minus(above.0);
                    let whole = below.1.minus(above.1);
                    let last = below.2.minus(above.2);
                    $(mean.$channel += (first.$channel as f32 * x.first_share
                        + whole.$channel as f32
                        + last.$channel as f32 * x.last_share)
                        * share;)*
                    above = below;
                    k += 1;
                }
                let texels = x.length * y.length;
                let missing = texels - x.inside * y.inside;
                // A point that is known becomes one constant. Of `texels * point` a compiler may make it, too, and
                // would round otherwise than all others.
                let unit = one / Real::max(point.one as f32, one);
                let scale = unit / texels;
                let missing = missing / texels;
                $quantized {
                    $($channel: Real::saturate(mean.$channel * scale + missing * beyond.$channel),)*
                }
            }

            /// As the mean over the rectangle, but texels that it covers in part count as those that it covers wholly.
            /// What lies beyond the table has the share that it has in the rectangle. Reads 4 entries in place of 16.
            #[inline(always)]
            #[must_use]
            pub fn $touched(
                self,
                point: FixedPoint,
                beyond: $quantized<f32>,
                before: impl Fn(u32, u32) -> $fixed,
            ) -> $quantized<f32> {
                let Self { x, y } = self;
                let one: f32 = lit!(1.0);
                let row = |rows: u32| before(x.end, rows).minus(before(x.first, rows));
                let sum = row(y.end).minus(row(y.first));
                let inside = (x.inside * y.inside) / (x.length * y.length);
                let texels = ((x.end - x.first) * (y.end - y.first)) as f32;
                // As above: an order of operations in which a known point does not change a rounding.
                let unit = one / Real::max(point.one as f32, one);
                let scale = inside * (unit / texels);
                let missing = one - inside;
                $quantized {
                    $($channel: Real::saturate(
                        sum.$channel as f32 * scale + missing * beyond.$channel
                    ),)*
                }
            }
        }
    };
}

means!(mean_4, mean_touched_4: Fixed4, Quantized4, r g b a);
means!(mean_6, mean_touched_6: Fixed6, Quantized6, r0 g0 b0 r1 g1 b1);
