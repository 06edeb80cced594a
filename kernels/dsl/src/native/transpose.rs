//! Between rows in memory and SIMD lanes: a vector for each column of a table.
//!
//! A register consists of blocks of 128 bits, and what stays within blocks is cheap to move. So
//! lanes are numbered such that each block works for itself: where a register has `B` blocks, lane
//! `j` of block `i` holds row `B * j + i`. A register is filled with a block's worth of numbers
//! from each of `B` rows that follow each other, by one plain load where the rows are as short as
//! that. Four such registers of `f32`, two of `f64`, transposed within blocks, are columns; columns
//! become rows the same way.

use fearless_simd::prelude::*;
use fearless_simd::{Level, Simd};

use super::lanes::token;

#[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
mod x86 {
    #[cfg(target_arch = "x86")]
    use core::arch::x86::*;
    #[cfg(target_arch = "x86_64")]
    use core::arch::x86_64::*;

    use fearless_simd::prelude::*;
    use fearless_simd::{Avx2, Avx512, f32x8, f32x16, f64x4, f64x8, kernel};

    macro_rules! shuffles {
        ($level:ident, $vector:ident, $unpack:ident: $low:ident $high:ident,
         $spread:ident($x:ident): $spread_value:expr, $align:ident($y:ident): $align_value:expr) => {
            kernel!(
                #[inline(always)]
                pub fn $unpack(
                    token: $level,
                    a: $vector<$level>,
                    b: $vector<$level>,
                ) -> ($vector<$level>, $vector<$level>) {
                    let (a, b) = (a.into(), b.into());
                    ($low(a, b).simd_into(token), $high(a, b).simd_into(token))
                }
            );
            kernel!(
                #[inline(always)]
                pub fn $spread(token: $level, $x: $vector<$level>) -> $vector<$level> {
                    let $x = $x.into();
                    $spread_value.simd_into(token)
                }
            );
            kernel!(
                #[inline(always)]
                pub fn $align(token: $level, $y: $vector<$level>) -> $vector<$level> {
                    let $y = $y.into();
                    $align_value.simd_into(token)
                }
            );
        };
    }

    shuffles!(Avx2, f32x8, unpack_f32x8: _mm256_unpacklo_ps _mm256_unpackhi_ps,
        spread_f32x8(v): _mm256_permutevar8x32_ps(v, _mm256_setr_epi32(0, 2, 4, 6, 1, 3, 5, 7)),
        align_f32x8(v): _mm256_permutevar8x32_ps(v, _mm256_setr_epi32(0, 4, 1, 5, 2, 6, 3, 7)));
    shuffles!(Avx512, f32x16, unpack_f32x16: _mm512_unpacklo_ps _mm512_unpackhi_ps,
        spread_f32x16(v): _mm512_permutexvar_ps(
            _mm512_setr_epi32(0, 4, 8, 12, 1, 5, 9, 13, 2, 6, 10, 14, 3, 7, 11, 15), v),
        align_f32x16(v): _mm512_permutexvar_ps(
            _mm512_setr_epi32(0, 4, 8, 12, 1, 5, 9, 13, 2, 6, 10, 14, 3, 7, 11, 15), v));
    shuffles!(Avx2, f64x4, unpack_f64x4: _mm256_unpacklo_pd _mm256_unpackhi_pd,
        spread_f64x4(v): _mm256_permute4x64_pd::<0b11_01_10_00>(v),
        align_f64x4(v): _mm256_permute4x64_pd::<0b11_01_10_00>(v));
    shuffles!(Avx512, f64x8, unpack_f64x8: _mm512_unpacklo_pd _mm512_unpackhi_pd,
        spread_f64x8(v): _mm512_permutexvar_pd(_mm512_setr_epi64(0, 4, 1, 5, 2, 6, 3, 7), v),
        align_f64x8(v): _mm512_permutexvar_pd(_mm512_setr_epi64(0, 2, 4, 6, 1, 3, 5, 7), v));
}

/// A vector as the type that it is under another name: `S`'s own, or that of the level that `S` is.
#[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
macro_rules! same {
    ($token:expr, $vector:expr) => {
        SimdBase::from_slice($token, $vector.as_slice())
    };
}

macro_rules! blocks {
    ($module:ident, $float:ident, $vector:ident, $per_block:literal,
     $unpack8:ident $spread8:ident $align8:ident, $unpack16:ident $spread16:ident $align16:ident) => {
        mod $module {
            use super::*;

            /// Blocks of a register.
            pub const fn blocks<S: Simd>() -> usize {
                S::$vector::LEN / $per_block
            }

            #[inline(always)]
            fn block(table: &[$float], at: usize) -> [$float; $per_block] {
                let mut block = [0.0; $per_block];
                block.copy_from_slice(&table[at..at + $per_block]);
                block
            }

            /// Blocks that start in `table` at `start` and every `step` from there.
            #[inline(always)]
            pub fn load<S: Simd>(table: &[$float], start: usize, step: usize) -> S::$vector {
                let (t, at) = (token::<S>(), start);
                if step == $per_block {
                    return S::$vector::from_slice(t, &table[at..at + S::$vector::LEN]);
                }
                match blocks::<S>() {
                    1 => S::$vector::from_slice(t, &block(table, at)),
                    2 => {
                        let both = [block(table, at), block(table, at + step)];
                        S::$vector::from_slice(t, both.as_flattened())
                    }
                    _ => {
                        let all = [
                            block(table, at),
                            block(table, at + step),
                            block(table, at + 2 * step),
                            block(table, at + 3 * step),
                        ];
                        S::$vector::from_slice(t, all.as_flattened())
                    }
                }
            }

            /// Stores them, in order.
            #[inline(always)]
            pub fn store<S: Simd>(v: S::$vector, table: &mut [$float], start: usize, step: usize) {
                if step == $per_block {
                    return v.store_slice(&mut table[start..start + S::$vector::LEN]);
                }
                let all = v.as_slice();
                for i in 0..blocks::<S>() {
                    table[start + i * step..][..$per_block]
                        .copy_from_slice(&all[i * $per_block..][..$per_block]);
                }
            }

            /// The numbers of `a` and `b` in turn: of each block's lower half, of the upper.
            #[inline(always)]
            pub fn unpack<S: Simd>(a: S::$vector, b: S::$vector) -> (S::$vector, S::$vector) {
                match token::<S>().level() {
                    #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
                    Level::Avx2(t) => {
                        let (low, high) = x86::$unpack8(t, same!(t, a), same!(t, b));
                        (same!(token::<S>(), low), same!(token::<S>(), high))
                    }
                    #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
                    Level::Avx512(t) => {
                        let (low, high) = x86::$unpack16(t, same!(t, a), same!(t, b));
                        (same!(token::<S>(), low), same!(token::<S>(), high))
                    }
                    _ => a.interleave(b),
                }
            }

            /// From the order in memory to the order of lanes.
            #[inline(always)]
            pub fn spread<S: Simd>(v: S::$vector) -> S::$vector {
                match token::<S>().level() {
                    #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
                    Level::Avx2(t) => same!(token::<S>(), x86::$spread8(t, same!(t, v))),
                    #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
                    Level::Avx512(t) => same!(token::<S>(), x86::$spread16(t, same!(t, v))),
                    _ => v,
                }
            }

            /// And back.
            #[inline(always)]
            pub fn align<S: Simd>(v: S::$vector) -> S::$vector {
                match token::<S>().level() {
                    #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
                    Level::Avx2(t) => same!(token::<S>(), x86::$align8(t, same!(t, v))),
                    #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
                    Level::Avx512(t) => same!(token::<S>(), x86::$align16(t, same!(t, v))),
                    _ => v,
                }
            }
        }
    };
}

blocks!(quads, f32, f32s, 4, unpack_f32x8 spread_f32x8 align_f32x8,
    unpack_f32x16 spread_f32x16 align_f32x16);
blocks!(couples, f64, f64s, 2, unpack_f64x4 spread_f64x4 align_f64x4,
    unpack_f64x8 spread_f64x8 align_f64x8);

#[inline(always)]
fn transpose<S: Simd>([a, b, c, d]: [S::f32s; 4]) -> [S::f32s; 4] {
    let (ac, bd) = (quads::unpack::<S>(a, c), quads::unpack::<S>(b, d));
    let (low, high) = (
        quads::unpack::<S>(ac.0, bd.0),
        quads::unpack::<S>(ac.1, bd.1),
    );
    [low.0, low.1, high.0, high.1]
}

/// Column `at` of `table`, which has `width` columns and a row for each lane.
#[inline(always)]
pub fn column_f32<S: Simd>(table: &[f32], width: usize, at: usize) -> S::f32s {
    let blocks = quads::blocks::<S>();
    match width {
        1 => quads::spread::<S>(quads::load::<S>(table, 0, 4)),
        2 => {
            let low = quads::load::<S>(table, 0, 4);
            let (a, b) = low.deinterleave(quads::load::<S>(table, 4 * blocks, 4));
            quads::spread::<S>(if at == 0 { a } else { b })
        }
        3 => {
            let row = 3 * blocks;
            // Nothing follows the last row: these start a number early, and are turned back.
            let last = quads::load::<S>(table, 3 * row - 1, 3);
            transpose::<S>([
                quads::load::<S>(table, 0, 3),
                quads::load::<S>(table, row, 3),
                quads::load::<S>(table, 2 * row, 3),
                last.slide_within_blocks::<1>(last),
            ])[at]
        }
        _ => {
            // The last four columns overlap others.
            let first = (at / 4 * 4).min(width - 4);
            let row = blocks * width;
            transpose::<S>([
                quads::load::<S>(table, first, width),
                quads::load::<S>(table, row + first, width),
                quads::load::<S>(table, 2 * row + first, width),
                quads::load::<S>(table, 3 * row + first, width),
            ])[at - first]
        }
    }
}

/// Fills `table` with columns; see [`super::layout::Lane::put_column`].
#[inline(always)]
pub fn put_column_f32<S: Simd>(
    table: &mut [f32],
    width: usize,
    at: usize,
    [a, b, c, d]: [S::f32s; 4],
) {
    if at + 1 < width && (width < 4 || at % 4 != 3) {
        return;
    }
    let blocks = quads::blocks::<S>();
    match width {
        1 => quads::store::<S>(quads::align::<S>(d), table, 0, 4),
        2 => {
            let (low, high) = quads::align::<S>(c).interleave(quads::align::<S>(d));
            quads::store::<S>(low, table, 0, 4);
            quads::store::<S>(high, table, 4 * blocks, 4);
        }
        3 => {
            let row = 3 * blocks;
            let [r0, r1, r2, r3] = transpose::<S>([b, c, d, d]);
            // A row's fourth number is overwritten by the next row.
            quads::store::<S>(r0, table, 0, 3);
            quads::store::<S>(r1, table, row, 3);
            quads::store::<S>(r2, table, 2 * row, 3);
            // The last row has none.
            let last = r3.as_slice();
            for i in 0..blocks {
                let length = if i + 1 < blocks { 4 } else { 3 };
                table[3 * row + 3 * i..][..length].copy_from_slice(&last[4 * i..][..length]);
            }
        }
        _ => {
            let (first, row) = (at - 3, blocks * width);
            let [r0, r1, r2, r3] = transpose::<S>([a, b, c, d]);
            quads::store::<S>(r0, table, first, width);
            quads::store::<S>(r1, table, row + first, width);
            quads::store::<S>(r2, table, 2 * row + first, width);
            quads::store::<S>(r3, table, 3 * row + first, width);
        }
    }
}

/// As [`column_f32`].
#[inline(always)]
pub fn column_f64<S: Simd>(table: &[f64], width: usize, at: usize) -> S::f64s {
    if width == 1 {
        return couples::spread::<S>(couples::load::<S>(table, 0, 2));
    }
    if width == 4 && couples::blocks::<S>() == 4 {
        // Whole rows side by side: so few shuffles across blocks cost less than loading by blocks.
        let low = couples::load::<S>(table, 0, 2);
        let low = low.deinterleave(couples::load::<S>(table, 8, 2));
        let high = couples::load::<S>(table, 16, 2);
        let high = high.deinterleave(couples::load::<S>(table, 24, 2));
        let (a, c) = low.0.deinterleave(high.0);
        let (b, d) = low.1.deinterleave(high.1);
        return couples::spread::<S>([a, b, c, d][at]);
    }
    // The last two columns overlap others where the width is odd.
    let first = (at / 2 * 2).min(width - 2);
    let row = couples::blocks::<S>() * width;
    let (a, b) = couples::unpack::<S>(
        couples::load::<S>(table, first, width),
        couples::load::<S>(table, row + first, width),
    );
    if at == first { a } else { b }
}

/// As [`put_column_f32`].
#[inline(always)]
pub fn put_column_f64<S: Simd>(
    table: &mut [f64],
    width: usize,
    at: usize,
    [a, b, c, d]: [S::f64s; 4],
) {
    let blocks = couples::blocks::<S>();
    if width == 1 {
        couples::store::<S>(couples::align::<S>(d), table, 0, 2);
    } else if width == 4 && blocks == 4 {
        if at == 3 {
            let (a, b) = (couples::align::<S>(a), couples::align::<S>(b));
            let (c, d) = (couples::align::<S>(c), couples::align::<S>(d));
            let (ac, bd) = (a.interleave(c), b.interleave(d));
            let (low, high) = (ac.0.interleave(bd.0), ac.1.interleave(bd.1));
            couples::store::<S>(low.0, table, 0, 2);
            couples::store::<S>(low.1, table, 8, 2);
            couples::store::<S>(high.0, table, 16, 2);
            couples::store::<S>(high.1, table, 24, 2);
        }
    } else if at + 1 == width || at % 2 == 1 {
        let (low, high) = couples::unpack::<S>(c, d);
        let row = blocks * width;
        couples::store::<S>(low, table, at - 1, width);
        couples::store::<S>(high, table, row + at - 1, width);
    }
}

#[cfg(test)]
mod tests {
    use std::vec;
    use std::vec::Vec;

    use fearless_simd::dispatch;

    use super::*;
    use crate::native::lanes::levels;

    macro_rules! there_and_back {
        ($name:ident, $float:ident, $vector:ident, $column:ident, $put_column:ident) => {
            #[inline(always)]
            fn $name<S: Simd>(_: S) {
                let lanes = S::$vector::LEN;
                let count: Vec<$float> = (0..lanes).map(|i| i as $float).collect();
                let order = $column::<S>(&count, 1, 0);
                let mut sorted = order.as_slice().to_vec();
                sorted.sort_by(<$float>::total_cmp);
                assert_eq!(sorted, count);
                for width in 1..=13 {
                    let table: Vec<$float> = (0..lanes * width).map(|i| i as $float).collect();
                    let mut out = vec![-1.0; table.len()];
                    let mut last = [order; 4];
                    for at in 0..width {
                        let column = $column::<S>(&table, width, at);
                        for (x, row) in column.as_slice().iter().zip(order.as_slice()) {
                            assert_eq!(*x, table[*row as usize * width + at], "{width} {at}");
                        }
                        last = [last[1], last[2], last[3], column];
                        $put_column::<S>(&mut out, width, at, last);
                    }
                    assert_eq!(out, table);
                }
            }
        };
    }

    there_and_back!(single, f32, f32s, column_f32, put_column_f32);
    there_and_back!(double, f64, f64s, column_f64, put_column_f64);

    #[test]
    fn columns_of_every_width_become_the_rows_they_came_from() {
        for (_, level) in levels() {
            dispatch!(level, simd => single(simd));
            dispatch!(level, simd => double(simd));
        }
    }
}
