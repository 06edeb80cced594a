//! Between rows in memory and SIMD lanes: a vector for each column of a table.
//!
//! A register consists of blocks of 128 bits, and what stays within blocks is cheap to move. So
//! lanes are numbered such that each block works for itself: where a register has `B` blocks, lane
//! `j` of block `i` holds row `B * j + i`. A register is filled with a block's worth of numbers
//! from each of `B` rows that follow each other, by one plain load where the rows are as short as
//! that. Four such registers of `f32`, two of `f64`, transposed within blocks, are columns; columns
//! become rows the same way.

use core::marker::PhantomData;

use bytemuck::{Pod, Zeroable};

use super::register::Register;

/// The most columns that come at once.
pub const MOST: usize = 4;

/// The first column of a group of `step` columns. The last group ends with the table, and may overlap the one before.
pub const fn first_of(group: usize, step: usize, width: usize) -> usize {
    let (first, last) = (group * step, width - step);
    if first < last { first } else { last }
}

/// A table for registers `R` whose rows are of type `T`.
pub struct Table<R, T>(PhantomData<(R, T)>);

impl<R: Register, T> Table<R, T> {
    /// Its columns.
    pub const WIDTH: usize = size_of::<T>() / size_of::<R::Number>();
    /// Columns that come at once.
    pub const STEP: usize = {
        let most = if R::PER_BLOCK == 4 || Self::WHOLE_ROWS {
            4
        } else {
            2
        };
        if Self::WIDTH < most {
            Self::WIDTH
        } else {
            most
        }
    };
    /// Blocks of a register.
    const BLOCKS: usize = R::LANES / R::PER_BLOCK;
    /// Numbers of the rows that start the blocks of a register.
    const ROWS: usize = Self::WIDTH * Self::BLOCKS;
    /// Whether rows of four `f64` are best moved side by side: so few shuffles across blocks cost less than loading by
    /// blocks.
    const WHOLE_ROWS: bool = R::PER_BLOCK == 2 && Self::WIDTH == 4 && Self::BLOCKS == 4;
}

// Conditions are `const` blocks: the compiler then never sees what they exclude.

impl<R: Register, T: Pod> Table<R, T> {
    /// The first [`Self::STEP`] of these are columns of `table` from `first` on. It has a row for each lane.
    #[inline(always)]
    pub fn columns(table: &[R::Number], first: usize) -> [R; MOST] {
        let row = Self::ROWS;
        if const { Self::WIDTH == 1 } {
            return [R::spread(R::load(table, 0)); 4];
        }
        if const { Self::WHOLE_ROWS } {
            let low = R::deinterleave(R::load(table, 0), R::load(table, 8));
            let high = R::deinterleave(R::load(table, 16), R::load(table, 24));
            let (a, c) = R::deinterleave(low.0, high.0);
            let (b, d) = R::deinterleave(low.1, high.1);
            return [R::spread(a), R::spread(b), R::spread(c), R::spread(d)];
        }
        if const { R::PER_BLOCK == 2 } {
            let (a, b) = R::unpack(load::<R, T>(table, first), load::<R, T>(table, row + first));
            return [a, b, a, b];
        }
        if const { Self::WIDTH == 2 } {
            let (a, b) = R::deinterleave(R::load(table, 0), R::load(table, R::LANES));
            let (a, b) = (R::spread(a), R::spread(b));
            return [a, b, a, b];
        }
        if const { Self::WIDTH == 3 } {
            // Nothing follows the last row: these start a number early, and are turned back.
            let last = load::<R, T>(table, 3 * row - 1);
            return transpose([
                load::<R, T>(table, 0),
                load::<R, T>(table, row),
                load::<R, T>(table, 2 * row),
                R::rotate(last),
            ]);
        }
        transpose([
            load::<R, T>(table, first),
            load::<R, T>(table, row + first),
            load::<R, T>(table, 2 * row + first),
            load::<R, T>(table, 3 * row + first),
        ])
    }

    /// Stores the first [`Self::STEP`] of these into the columns of `table` from `first` on.
    #[inline(always)]
    pub fn put_columns(&[a, b, c, d]: &[R; MOST], table: &mut [R::Number], first: usize) {
        let row = Self::ROWS;
        if const { Self::WIDTH == 1 } {
            return R::store(R::align(a), table, 0);
        }
        if const { Self::WHOLE_ROWS } {
            let ac = R::interleave(R::align(a), R::align(c));
            let bd = R::interleave(R::align(b), R::align(d));
            let (low, high) = (R::interleave(ac.0, bd.0), R::interleave(ac.1, bd.1));
            R::store(low.0, table, 0);
            R::store(low.1, table, 8);
            R::store(high.0, table, 16);
            return R::store(high.1, table, 24);
        }
        if const { R::PER_BLOCK == 2 } {
            let (low, high) = R::unpack(a, b);
            store::<R, T>(low, table, first);
            return store::<R, T>(high, table, row + first);
        }
        if const { Self::WIDTH == 2 } {
            let (low, high) = R::interleave(R::align(a), R::align(b));
            R::store(low, table, 0);
            return R::store(high, table, R::LANES);
        }
        if const { Self::WIDTH == 3 } {
            let [r0, r1, r2, r3] = transpose([a, b, c, c]);
            // A row's fourth number is overwritten by the next row.
            store::<R, T>(r0, table, 0);
            store::<R, T>(r1, table, row);
            store::<R, T>(r2, table, 2 * row);
            // The last row has none.
            let mut last = [R::Number::zeroed(); 16];
            R::store(r3, &mut last, 0);
            for i in 0..Self::BLOCKS {
                let length = if i + 1 < Self::BLOCKS { 4 } else { 3 };
                table[3 * row + 3 * i..][..length].copy_from_slice(&last[4 * i..][..length]);
            }
            return;
        }
        let [r0, r1, r2, r3] = transpose([a, b, c, d]);
        store::<R, T>(r0, table, first);
        store::<R, T>(r1, table, row + first);
        store::<R, T>(r2, table, 2 * row + first);
        store::<R, T>(r3, table, 3 * row + first);
    }
}

/// One block of each row that a register holds blocks of.
#[inline(always)]
fn load<R: Register, T>(table: &[R::Number], start: usize) -> R {
    if const { Table::<R, T>::WIDTH == R::PER_BLOCK } {
        R::load(table, start)
    } else {
        R::load_blocks(table, start, Table::<R, T>::WIDTH)
    }
}

/// And back.
#[inline(always)]
fn store<R: Register, T>(a: R, table: &mut [R::Number], start: usize) {
    if const { Table::<R, T>::WIDTH == R::PER_BLOCK } {
        R::store(a, table, start);
    } else {
        R::store_blocks(a, table, start, Table::<R, T>::WIDTH);
    }
}

#[inline(always)]
fn transpose<R: Register>([a, b, c, d]: [R; 4]) -> [R; 4] {
    let (ac, bd) = (R::unpack(a, c), R::unpack(b, d));
    let (low, high) = (R::unpack(ac.0, bd.0), R::unpack(ac.1, bd.1));
    [low.0, low.1, high.0, high.1]
}

#[cfg(test)]
mod tests {
    use core::array;
    use core::marker::PhantomData;

    use bytemuck::Pod;

    use crate::native::lanes::{Work, levels, on_lanes};
    use crate::native::layout::{Lane, Lanewise};

    /// Rows that count, as columns, and back.
    struct ThereAndBack<T>(PhantomData<T>);

    macro_rules! there_and_back {
        ($($number:ident)*) => {$(
            impl<const WIDTH: usize> Work for ThereAndBack<[$number; WIDTH]>
            where
                [$number; WIDTH]: Pod,
            {
                type Scalar = $number;
                type Output = ();
                #[inline(always)]
                fn run<L: Lane<Scalar = $number>>(self) {
                    const MOST: usize = 64;
                    assert!(L::LANES <= MOST);
                    let row = |i| array::from_fn(|at| (WIDTH * i + at) as $number);
                    let table: [[$number; WIDTH]; MOST] = array::from_fn(row);
                    let rows = &table[..L::LANES];
                    let columns = <[$number; WIDTH] as Lanewise<$number>>::load::<L>(rows);
                    let mut out = [[-1.0; WIDTH]; MOST];
                    <[$number; WIDTH] as Lanewise<$number>>::store::<L>(&columns, &mut out[..L::LANES]);
                    assert_eq!(out[..L::LANES], *rows);
                    // Which row each lane has is the same for a table of one column.
                    for (at, column) in columns.iter().enumerate() {
                        let mut out = [-1.0; MOST];
                        <$number as Lanewise<$number>>::store::<L>(column, &mut out[..L::LANES]);
                        for (out, row) in out.iter().zip(rows) {
                            assert_eq!(*out, row[at], "{WIDTH} {at}");
                        }
                    }
                }
            }
        )*};
    }

    there_and_back!(f32 f64);

    #[test]
    fn columns_of_every_width_become_the_rows_they_came_from() {
        macro_rules! widths {
            ($level:ident, $number:ident: $($width:literal)*) => {$(
                on_lanes($level, ThereAndBack::<[$number; $width]>(PhantomData)).expect("it has lanes");
            )*};
        }
        for (_, level) in levels() {
            widths!(level, f32: 1 2 3 4 5 6 7 8 9 10 11 12 13 14 15 16 17);
            widths!(level, f64: 1 2 3 4 5 6 7 8 9 10 11 12 13 14 15 16 17);
        }
    }
}
