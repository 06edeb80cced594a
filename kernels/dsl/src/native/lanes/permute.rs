//! [`super::transpose`] for AVX-512's `f32`, where one instruction puts numbers of two registers into any order.
//!
//! A register has two rows of up to eight columns, as they are in memory. Two such registers make one for each four
//! columns of four rows, two of these one for each two columns of eight rows, and two of these a column. Columns become
//! rows the same way. Rows of one, two or four numbers, and up to four columns that are left over, need fewer
//! instructions by blocks.

#[cfg(target_arch = "x86")]
use core::arch::x86::*;
#[cfg(target_arch = "x86_64")]
use core::arch::x86_64::*;

use core::marker::PhantomData;

use bytemuck::Pod;

use super::register::Register;
use super::transpose;
use super::x86::F32x16;
use crate::unroll;

/// The most columns that come at once.
pub const MOST: usize = 8;

/// Whether all columns are moved by blocks.
const fn by_blocks(width: usize) -> bool {
    matches!(width, 1 | 2 | 4)
}

/// Where each number of a register comes from: 0 to 15 in the first of two registers, 16 to 31 in the second.
type Order = [i32; 16];

/// The order of a register: for each lane `k` below `count`, where its number comes from.
macro_rules! order {
    ($k:ident in 0..$count:expr, $from:expr) => {{
        let mut order: Order = [0; 16];
        let mut $k = 0;
        while $k < $count {
            order[$k] = ($from) as i32;
            $k += 1;
        }
        order
    }};
}

/// The row that a lane has.
const fn row(lane: usize) -> usize {
    4 * (lane % 4) + lane / 4
}

/// The lane that has a row.
const fn lane(row: usize) -> usize {
    4 * (row % 4) + row / 4
}

/// Where pair `i` of rows is loaded from: 16 numbers that end within the table.
const fn start(width: usize, i: usize) -> usize {
    let (start, last) = (2 * i * width, 16 * width - 16);
    if start < last { start } else { last }
}

/// Four columns, from `4 group` on, of four rows: pairs `2 quad` and the next one.
const fn quad(width: usize, group: usize, quad: usize) -> Order {
    order!(k in 0..16, {
        let (column, row) = (4 * group + k / 4, k % 4);
        let half = row / 2;
        let at = if width > MOST {
            MOST * (row % 2) + column
        } else if column < width {
            let pair = 2 * quad + half;
            2 * pair * width - start(width, pair) + width * (row % 2) + column
        } else {
            0
        };
        16 * half + at
    })
}

/// Two columns of eight rows: of each four columns the first two, or the others.
const fn octet(others: bool) -> Order {
    order!(k in 0..16, {
        let (column, row) = (2 * others as usize + k / 8, k % 8);
        16 * (row / 4) + 4 * column + row % 4
    })
}

/// A column of all rows: of each two the first, or the other.
const fn whole(other: bool) -> Order {
    order!(k in 0..16, 16 * (row(k) / 8) + 8 * other as usize + row(k) % 8)
}

/// From two columns, those of the first eight rows, or of the others.
const fn of_columns(others: bool) -> Order {
    order!(k in 0..16, 16 * (k / 8) + lane(8 * others as usize + k % 8))
}

/// From two columns of eight rows, and two others of them, four of the first four rows, or of the others, by rows.
const fn of_octets(others: bool) -> Order {
    order!(k in 0..16, {
        let (row, column) = (4 * others as usize + k / 4, k % 4);
        16 * (column / 2) + 8 * (column % 2) + row
    })
}

/// From four columns of four rows, and the four others, the first two rows, or the others, as they are in memory.
const fn of_quads(width: usize, others: bool) -> Order {
    let length = if width < MOST { width } else { MOST };
    order!(k in 0..2 * length, {
        let (row, column) = (2 * others as usize + k / length, k % length);
        16 * (column / 4) + 4 * row + column % 4
    })
}

#[inline(always)]
fn permute(a: F32x16, order: &'static Order, b: F32x16) -> F32x16 {
    // SAFETY: lanes are for `on_lanes` alone, which asks whether the processor has the instruction. So many numbers are
    // in an order.
    unsafe { _mm512_permutex2var_ps(a, _mm512_loadu_si512(order.as_ptr().cast()), b) }
}

/// Two times eight numbers: from `start` on, and from `step` after it.
#[inline(always)]
fn load_halves(table: &[f32], start: usize, step: usize) -> F32x16 {
    let from = table[start..start + step + 8].as_ptr();
    // SAFETY: as above. All numbers are within the slice.
    unsafe {
        let low = _mm512_castps256_ps512(_mm256_loadu_ps(from));
        _mm512_insertf32x8::<1>(low, _mm256_loadu_ps(from.add(step)))
    }
}

/// Stores what [`load_halves`] loads.
#[inline(always)]
fn store_halves(a: F32x16, table: &mut [f32], start: usize, step: usize) {
    let to = table[start..start + step + 8].as_mut_ptr();
    // SAFETY: as above. All numbers are within the slice.
    unsafe {
        _mm256_storeu_ps(to, _mm512_castps512_ps256(a));
        _mm256_storeu_ps(to.add(step), _mm512_extractf32x8_ps::<1>(a));
    }
}

/// Stores the first `count` numbers.
#[inline(always)]
fn store_part(a: F32x16, table: &mut [f32], start: usize, count: usize) {
    let to = table[start..start + count].as_mut_ptr();
    // SAFETY: as above. So many numbers are within the slice.
    unsafe { _mm512_mask_storeu_ps(to, ((1_u32 << count) - 1) as __mmask16, a) };
}

/// A table whose rows are of type `T`.
pub struct Table<R, T>(PhantomData<(R, T)>);

impl<T: Pod> Table<F32x16, T> {
    /// Its columns.
    pub const WIDTH: usize = transpose::Table::<F32x16, T>::WIDTH;
    /// Columns that come at once.
    pub const STEP: usize = if by_blocks(Self::WIDTH) {
        transpose::Table::<F32x16, T>::STEP
    } else if Self::WIDTH < MOST {
        Self::WIDTH
    } else {
        MOST
    };

    /// The first [`Self::STEP`] of these are columns of `table` from `first` on. It has a row for each lane.
    #[inline(always)]
    pub fn columns(table: &[f32], first: usize) -> [F32x16; MOST] {
        if const { by_blocks(Self::WIDTH) } {
            let [a, b, c, d] = transpose::Table::<F32x16, T>::columns(table, first);
            return [a, b, c, d, a, b, c, d];
        }
        let none = F32x16::load(table, 0);
        let mut pairs = [none; 8];
        unroll!(i in 0..8, {
            pairs[i] = if const { Self::WIDTH > MOST } {
                load_halves(table, 2 * i * Self::WIDTH + first, Self::WIDTH)
            } else {
                F32x16::load(table, const { start(Self::WIDTH, i) })
            };
        });
        let mut quads = [[none; 2]; 4];
        unroll!(i in 0..4, {
            unroll!(group in 0..2, {
                if const { 4 * group < Self::STEP } {
                    let order = const { &quad(Self::WIDTH, group, i) };
                    quads[i][group] = permute(pairs[2 * i], order, pairs[2 * i + 1]);
                }
            });
        });
        let mut columns = [none; MOST];
        unroll!(group in 0..4, {
            if const { 2 * group < Self::STEP } {
                let order = const { &octet(group % 2 == 1) };
                let low = permute(quads[0][group / 2], order, quads[1][group / 2]);
                let high = permute(quads[2][group / 2], order, quads[3][group / 2]);
                columns[2 * group] = permute(low, const { &whole(false) }, high);
                columns[2 * group + 1] = permute(low, const { &whole(true) }, high);
            }
        });
        columns
    }

    /// Stores the first [`Self::STEP`] of these into the columns of `table` from `first` on.
    #[inline(always)]
    pub fn put_columns(columns: &[F32x16; MOST], table: &mut [f32], first: usize) {
        let [a, b, c, d, e, f, g, h] = *columns;
        if const { by_blocks(Self::WIDTH) } {
            return transpose::Table::<F32x16, T>::put_columns(&[a, b, c, d], table, first);
        }
        if const { Self::WIDTH > MOST && matches!(Self::WIDTH % MOST, 1..=4) }
            && !first.is_multiple_of(MOST)
        {
            // The others are stored already.
            return transpose::Table::<F32x16, T>::put_columns(&[e, f, g, h], table, first + 4);
        }
        let mut octets = [[a; 4]; 2];
        unroll!(half in 0..2, {
            unroll!(group in 0..4, {
                if const { 2 * group < Self::STEP } {
                    let order = const { &of_columns(half == 1) };
                    octets[half][group] = permute(columns[2 * group], order, columns[2 * group + 1]);
                }
            });
        });
        let mut quads = [[a; 2]; 4];
        unroll!(i in 0..4, {
            unroll!(group in 0..2, {
                if const { 4 * group < Self::STEP } {
                    let order = const { &of_octets(i % 2 == 1) };
                    quads[i][group] = permute(octets[i / 2][2 * group], order, octets[i / 2][2 * group + 1]);
                }
            });
        });
        unroll!(i in 0..8, {
            let order = const { &of_quads(Self::WIDTH, i % 2 == 1) };
            let rows = permute(quads[i / 2][0], order, quads[i / 2][1]);
            if const { Self::WIDTH > MOST } {
                store_halves(rows, table, 2 * i * Self::WIDTH + first, Self::WIDTH);
            } else if const { 2 * i * Self::WIDTH <= 16 * Self::WIDTH - 16 } {
                // The next rows overwrite what is beyond these.
                F32x16::store(rows, table, 2 * i * Self::WIDTH);
            } else {
                store_part(rows, table, 2 * i * Self::WIDTH, 2 * Self::WIDTH);
            }
        });
    }
}
