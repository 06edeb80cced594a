//! Prefix sums, and a stable radix sort of keys with values, 4 bits a pass (Satish, Harris and Garland,
//! Designing Efficient Sorting Algorithms for Manycore GPUs, 2009, section 4).
//!
//! A pass over `n` keys is, with `g = n / 256` rounded up:
//! 1. `sort_count`: how often each block of 256 keys has each of the 16 digits, `16 g` counts, digit by
//!    digit;
//! 2. their exclusive prefix sums: `scan_blocks` over the counts, again over the blocks' sums until
//!    there is one block, and back with `scan_add`;
//! 3. `sort_scatter`: each block is sorted in workgroup memory, and its runs of equal digits go to their
//!    places.

use hankel_dsl::{
    Buffer, Element, Shared, SharedAtomics, StorageMut, barrier, cooperative, kernel,
};

/// Invocations of a workgroup, and keys of a block.
const BLOCK: u32 = 256;
/// Values of a digit.
const DIGITS: u32 = 16;

/// The sum, modulo 2^32, of what the invocations before this one give. `sums` then has, for each, that
/// with its own; wait before it is written again.
#[cooperative]
pub fn sum_before(me: u32, sums: Shared<'_, u32, 256>, mine: u32) -> u32 {
    let mut sum = mine;
    sums.set(me, sum);
    let mut reach = 1;
    while reach < BLOCK {
        barrier();
        if me >= reach {
            sum = sum.wrapping_add(sums.get(me - reach));
        }
        barrier();
        sums.set(me, sum);
        reach *= 2;
    }
    barrier();
    sum.wrapping_sub(mine)
}

/// Exclusive prefix sums within each block of 256 numbers, modulo 2^32, and the sum of each block.
#[kernel(compute, threads(256), cooperative(sum_before))]
pub fn scan_blocks(
    #[local_index] me: u32,
    #[group_id] group: u32,
    #[shared] sums: Shared<'_, u32, 256>,
    #[element] x: Option<u32>,
    #[storage] totals: StorageMut<'_, u32>,
) -> u32 {
    let before = sum_before(me, sums, x.unwrap_or(0));
    if me == BLOCK - 1 {
        totals.set(group, sums.get(me));
    }
    before
}

/// Adds to each number what comes before its block of 256.
#[kernel(compute, threads(256))]
pub fn scan_add(
    #[index] i: u32,
    #[element] x: &mut u32,
    #[storage]
    #[length(x)]
    before: Buffer<'_, u32>,
) {
    *x = (*x).wrapping_add(before.get(i / BLOCK));
}

/// A pass of the sort.
#[derive(Clone, Copy, Debug, PartialEq, Element)]
#[repr(C)]
pub struct Digit {
    /// The digit's lowest bit.
    #[values(0, 4, 8, 12, 16, 20, 24, 28)]
    pub shift: u32,
}

/// How often each digit is in each block: of digit `d` in block `b` of `g` at `d g + b`.
#[kernel(compute, threads(256), range(key))]
pub fn sort_count(
    #[local_index] me: u32,
    #[group_id] group: u32,
    #[group_count] groups: u32,
    #[shared] bins: SharedAtomics<'_, u32, 16>,
    #[uniform] digit: &Digit,
    #[element] key: Option<u32>,
    #[storage]
    #[length(key)]
    counts: StorageMut<'_, u32>,
) {
    if me < DIGITS {
        bins.store(me, 0);
    }
    barrier();
    if let Some(key) = key {
        bins.add((key >> digit.shift) & (DIGITS - 1), 1);
    }
    barrier();
    if me < DIGITS {
        counts.set(me * groups + group, bins.load(me));
    }
}

/// Puts keys and values in the order of a digit. `offsets` are the prefix sums of the counts. (Offsets
/// that are not let invocations write to one place: the inputs from attributes have one key.)
#[kernel(
    compute,
    threads(256),
    range(keys),
    cooperative(sum_before),
    inputs = inputs::blocks
)]
pub fn sort_scatter(
    #[index] i: u32,
    #[local_index] me: u32,
    #[group_id] group: u32,
    #[group_count] groups: u32,
    #[shared] sums: Shared<'_, u32, 256>,
    #[shared] block_keys: Shared<'_, u32, 256>,
    #[shared] block_values: Shared<'_, u32, 256>,
    #[shared] starts: Shared<'_, u32, 16>,
    #[uniform] digit: &Digit,
    #[storage]
    #[length(1)]
    keys: Buffer<'_, u32>,
    #[storage]
    #[length(1)]
    values: Buffer<'_, u32>,
    #[storage]
    #[length(16)]
    #[range(0..=0)]
    offsets: Buffer<'_, u32>,
    #[storage]
    #[length(keys)]
    sorted_keys: StorageMut<'_, u32>,
    #[storage]
    #[length(keys)]
    sorted_values: StorageMut<'_, u32>,
) {
    // What fills the last block up has the last digit, and stays behind all keys.
    let mut key = 0xffff_ffff;
    let mut value = 0;
    if i < keys.len() {
        key = keys.get(i);
        value = values.get(i);
    }
    let mut bit = 0;
    while bit < 4 {
        let one = (key >> (digit.shift + bit)) & 1;
        let zeros_before = sum_before(me, sums, 1 - one);
        let mut place = zeros_before;
        if one == 1 {
            place = sums.get(BLOCK - 1) + me - zeros_before;
        }
        block_keys.set(place, key);
        block_values.set(place, value);
        barrier();
        key = block_keys.get(me);
        value = block_values.get(me);
        bit += 1;
    }
    let mine = (key >> digit.shift) & (DIGITS - 1);
    let mut is_first = true;
    if me > 0 {
        is_first = mine != (block_keys.get(me - 1) >> digit.shift) & (DIGITS - 1);
    }
    if is_first {
        starts.set(mine, me);
    }
    barrier();
    if i < keys.len() {
        let place = offsets.get(mine * groups + group) + me - starts.get(mine);
        sorted_keys.set(place, key);
        sorted_values.set(place, value);
    }
}

#[cfg(not(target_arch = "spirv"))]
mod inputs {
    //! Keys with the offsets that belong to them.

    use std::vec;
    use std::vec::Vec;

    use hankel_dsl::native::inputs::{Given, Request, Source};

    use super::{BLOCK, DIGITS, Digit};

    /// Blocks of keys, of which some are equal, and a last block that is not full.
    pub fn blocks(request: &Request) -> Vec<Given> {
        let mut chance = Source::new(request.seed);
        [(1000, 0), (1024, 28), (257, 4)]
            .into_iter()
            .map(|(n, shift)| {
                let keys: Vec<u32> = (0..n).map(|_| chance.bits() as u32 & 0xf00f_f0ff).collect();
                let values: Vec<u32> = (0..n).collect();
                let blocks = n.div_ceil(BLOCK);
                let mut offsets = vec![0_u32; (DIGITS * blocks) as usize];
                for (i, key) in keys.iter().enumerate() {
                    let of_key = (key >> shift) & (DIGITS - 1);
                    offsets[(of_key * blocks + i as u32 / BLOCK) as usize] += 1;
                }
                let mut sum = 0;
                for offset in &mut offsets {
                    sum += core::mem::replace(offset, sum);
                }
                Given::new("keys and their offsets")
                    .uniform("digit", &Digit { shift })
                    .buffer("keys", &keys)
                    .buffer("values", &values)
                    .buffer("offsets", &offsets)
            })
            .collect()
    }
}
