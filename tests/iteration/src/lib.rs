//! Kernels that iterate over arrays, slices and ranges, and kernels of enums whose variants hold
//! different data. They are a crate of their own since a crate that iterates is compiled otherwise.
#![no_std]
#![allow(
    clippy::manual_contains,
    clippy::manual_is_multiple_of,
    clippy::unnecessary_sort_by,
    reason = "the closures of `any` and `find` are what is tested"
)]

use hankel_dsl::glam::{IVec4, UVec4, Vec3, Vec4};
use hankel_dsl::{Bool, Buffer, Element, StorageMut, kernel};

mod adapters;
mod closures;
mod idioms;
mod integers;
mod loops;

use adapters::*;
use closures::*;
use idioms::*;
use integers::*;
use loops::*;

hankel_dsl::kernels![
    adapted,
    walked,
    changed,
    numbered_rows,
    reduced,
    pieces,
    searched,
    ordered,
    sliced,
    made,
    of_table,
    divisors,
    bits,
    cut_short,
    buffered,
    distances,
    farthest,
    tokens,
    rewritten,
    attempts,
    linked,
    neighbours,
    sorted,
    in_order,
    rising,
    placed,
    chosen,
    numbered_pairs,
    halved,
    lit,
    checked,
    wide_bits,
    mirrored,
    raised,
    extended,
    ranked,
    answered,
    small,
    skipped,
    halves,
    taps,
    flattened,
    again,
    sieved,
    in_bytes,
    of_functions,
    gathered,
    handed_on,
    counted_by_for,
    counted_by_while,
    window_by_for,
    window_by_while,
];

/// Four numbers four times: by reference in two ways, by value, and from the end.
#[kernel(compute, threads(64))]
pub fn walked(#[element] x: UVec4) -> UVec4 {
    let numbers = x.to_array();
    let mut sums = [0_u32; 4];
    for number in numbers.iter() {
        sums[0] = sums[0].wrapping_mul(3).wrapping_add(*number);
    }
    for number in &numbers {
        sums[1] = sums[1].wrapping_mul(5) ^ number;
    }
    for number in numbers {
        sums[2] = sums[2].rotate_left(7).wrapping_add(number);
    }
    for number in numbers.iter().rev() {
        sums[3] = sums[3].wrapping_mul(3).wrapping_add(*number);
    }
    UVec4::from_array(sums)
}

/// Numbers that are changed in their array, in two ways.
#[kernel(compute, threads(64))]
pub fn changed(#[element] x: UVec4) -> UVec4 {
    let mut numbers = x.to_array();
    for number in numbers.iter_mut() {
        *number = number.wrapping_mul(*number);
    }
    let mut before = 0;
    for number in &mut numbers {
        *number ^= before;
        before = *number >> 3;
    }
    UVec4::from_array(numbers)
}

/// Two rows of numbers side by side, with the number of the column.
#[kernel(compute, threads(64))]
pub fn numbered_rows(#[element] x: UVec4, #[element] y: UVec4) -> u32 {
    let rows = [x.to_array(), y.to_array()];
    let mut sum = 0_u32;
    for (column, number) in rows[0].iter().enumerate() {
        sum = sum.wrapping_add(number.wrapping_mul(column as u32 + 1));
    }
    for (a, b) in rows[0].iter().zip(&rows[1]) {
        sum = sum.wrapping_mul(5).wrapping_add(a ^ b);
    }
    // What is numbered and in pairs is taken by value.
    for (column, (a, b)) in rows[0].into_iter().zip(rows[1]).enumerate() {
        sum ^= (a & b) >> column;
    }
    for row in &rows {
        for number in row {
            sum = sum.wrapping_mul(7).wrapping_add(*number);
        }
    }
    sum
}

/// A polynomial by Horner's rule, a sum of squares, and the largest product with a factor.
#[kernel(
    compute,
    threads(64),
    parity(non_finite, why = "sums and products of absurd numbers overflow")
)]
pub fn reduced(#[element] coefficients: Vec4, #[element] x: f32) -> Vec4 {
    let c = coefficients.to_array();
    let value = c.iter().fold(0.0, |sum, c| sum * x + c);
    let squares: f32 = c.iter().map(|c| c * c).sum();
    let mut largest = 0.0;
    c.iter().for_each(|c| {
        if c * x > largest {
            largest = c * x;
        }
    });
    Vec4::new(value, squares, largest, 1.0)
}

/// Parts of an array: every second element, all but the first, the two in the middle.
#[kernel(compute, threads(64))]
pub fn pieces(#[element] x: UVec4) -> UVec4 {
    let numbers = x.to_array();
    let mut sums = [0_u32; 4];
    for number in numbers.iter().step_by(2) {
        sums[0] = sums[0].wrapping_mul(3).wrapping_add(*number);
    }
    for number in &numbers[1..] {
        sums[1] = sums[1].wrapping_mul(3).wrapping_add(*number);
    }
    for number in numbers.iter().copied().skip(1).take(2) {
        sums[2] = sums[2].wrapping_mul(3).wrapping_add(number);
    }
    for number in numbers.iter().take_while(|number| **number & 1 == 0) {
        sums[3] = sums[3].wrapping_add(*number);
    }
    UVec4::from_array(sums)
}

/// What is found among numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Element)]
#[repr(C)]
pub struct Findings {
    /// The place of the first odd number; 4 if there is none.
    pub odd: u32,
    /// 1: one is zero; 2: all are small; 4: the number that was asked for is there; 8: the first is
    /// it; 16: it is from 3 to 9.
    pub bits: u32,
    /// The smallest.
    pub least: u32,
    /// The largest.
    pub most: u32,
}

/// Searches four numbers in several ways.
#[kernel(compute, threads(64))]
pub fn searched(#[element] x: UVec4, #[element] wanted: u32) -> Findings {
    let numbers = x.to_array().map(|number| number & 15);
    let wanted = wanted & 15;
    let odd = numbers.iter().position(|number| number & 1 == 1);
    let mut bits = 0;
    if numbers.iter().any(|number| *number == 0) {
        bits |= 1;
    }
    if numbers.iter().all(|number| *number < 12) {
        bits |= 2;
    }
    if numbers.contains(&wanted) {
        bits |= 4;
    }
    if numbers.first() == Some(&wanted) {
        bits |= 8;
    }
    if (3..=9).contains(&wanted) {
        bits |= 16;
    }
    Findings {
        odd: match odd {
            Some(place) => place as u32,
            None => 4,
        },
        bits,
        least: numbers.iter().copied().min().unwrap_or(99),
        most: numbers.iter().copied().max().unwrap_or(99),
    }
}

/// Sorts numbers in place.
fn sort(numbers: &mut [u32]) {
    for end in (1..numbers.len()).rev() {
        for i in 0..end {
            if numbers[i] > numbers[i + 1] {
                numbers.swap(i, i + 1);
            }
        }
    }
}

/// Four numbers in order.
#[kernel(compute, threads(64))]
pub fn ordered(#[element] x: UVec4) -> UVec4 {
    let mut numbers = x.to_array();
    sort(&mut numbers);
    UVec4::from_array(numbers)
}

/// A checksum of numbers (Adler, without its modulus).
fn checksum(numbers: &[u32]) -> u32 {
    let (mut a, mut b) = (1_u32, 0_u32);
    for number in numbers {
        a = a.wrapping_add(*number);
        b = b.wrapping_add(a);
    }
    a ^ b.rotate_left(16)
}

/// The sum of an array of any length.
fn total<const N: usize>(numbers: &[u32; N]) -> u32 {
    let mut sum = 0_u32;
    for number in numbers {
        sum = sum.wrapping_add(*number);
    }
    sum
}

/// Functions that take slices and arrays.
#[kernel(compute, threads(64))]
pub fn sliced(#[element] x: UVec4) -> UVec4 {
    let numbers = x.to_array();
    UVec4::new(
        checksum(&numbers),
        checksum(&[x.x, x.w]),
        total(&numbers),
        total(&[x.y, x.y, x.z]),
    )
}

/// Arrays that are made, compared, filled, copied and turned round.
#[kernel(compute, threads(64))]
pub fn made(#[element] x: UVec4) -> UVec4 {
    let squares: [u32; 4] = core::array::from_fn(|i| x.x.wrapping_mul((i * i) as u32));
    let halves = x.to_array().map(|number| number / 2);
    let mut numbers = [0; 4];
    numbers.fill(x.y);
    numbers[(x.z & 3) as usize] = 7;
    let mut copy = [0; 4];
    copy.copy_from_slice(&numbers);
    copy.reverse();
    UVec4::new(
        squares[3] ^ squares[1],
        halves[0].wrapping_add(halves[3]),
        u32::from(copy == numbers),
        copy[0] ^ copy[1].rotate_left(8) ^ copy[2].rotate_left(16) ^ copy[3].rotate_left(24),
    )
}

/// Rows of numbers.
#[derive(Clone, Copy, Debug, PartialEq, Element)]
#[repr(C)]
pub struct Rows {
    /// The rows.
    pub rows: [UVec4; 5],
}

/// How many rows of a uniform have a number, and the sum of their last numbers.
#[kernel(compute, threads(64))]
pub fn of_table(#[uniform] table: &Rows, #[element] x: u32) -> u32 {
    let mut found = 0_u32;
    for row in &table.rows {
        if row.x & 7 == x & 7 {
            found += 1;
        }
    }
    let sum = table
        .rows
        .iter()
        .fold(0_u32, |sum, row| sum.wrapping_add(row.w));
    sum.wrapping_mul(8).wrapping_add(found)
}

/// The first prime numbers.
const PRIMES: [u32; 6] = [2, 3, 5, 7, 11, 13];

/// The sum of the prime numbers that divide a number.
#[kernel(compute, threads(64))]
pub fn divisors(#[element] x: u32) -> u32 {
    let mut sum = 0;
    for prime in PRIMES {
        if x % prime == 0 {
            sum += prime;
        }
    }
    let last = PRIMES.into_iter().rev().find(|prime| x % prime == 0);
    sum * 16 + last.unwrap_or(0)
}

/// Ranges: in steps, backwards, filtered, mapped.
#[kernel(compute, threads(64))]
pub fn bits(#[element] x: u32) -> UVec4 {
    let mut set = 0_u32;
    for i in (0..32).filter(|i| x >> i & 1 == 1) {
        set = set.wrapping_mul(3).wrapping_add(i);
    }
    let mut pairs = 0;
    for i in (0..32).step_by(2) {
        pairs += (x >> i & 3) * (x & 3);
    }
    let mut turned = 0;
    for i in (0..32).rev() {
        turned |= (x >> i & 1) << (31 - i);
    }
    let sum: u32 = (1..=4).map(|i| (x >> i & 0xff) * i).sum();
    UVec4::new(set, pairs, turned, sum)
}

/// A loop over an array that is left, and turns that are left out.
#[kernel(compute, threads(64))]
pub fn cut_short(#[element] x: UVec4) -> u32 {
    let mut sum = 0_u32;
    for (i, number) in x.to_array().iter().enumerate() {
        if number & 7 == 0 {
            continue;
        }
        if *number > 0xc000_0000 {
            break;
        }
        sum = sum.wrapping_mul(5).wrapping_add(number ^ i as u32);
    }
    sum
}

/// The numbers of a part of a buffer, eight at a time, in an array.
#[kernel(compute, threads(64))]
pub fn buffered(
    #[index] i: u32,
    #[element] seed: u32,
    #[storage] numbers: Buffer<'_, u32>,
    #[storage] out: StorageMut<'_, u32>,
) {
    let window: [u32; 8] =
        core::array::from_fn(|k| numbers.get((i + k as u32) % numbers.len()) & 0xff);
    let mut best = seed & 0xff;
    for pair in 0..4 {
        let (a, b) = (window[2 * pair], window[2 * pair + 1]);
        best = [a, b, best].into_iter().fold(0, u32::max);
    }
    out.set(i % out.len(), best);
}

/// A body.
#[derive(Clone, Copy)]
enum Shape {
    /// Between two corners.
    Block { low: Vec3, high: Vec3 },
    /// A ball.
    Ball { centre: Vec3, radius: f32 },
    /// What lies below a height.
    Ground(f32),
    /// Nothing.
    Empty,
}

impl Shape {
    /// How far a point is from it, roughly.
    fn distance(&self, p: Vec3) -> f32 {
        match self {
            Self::Block { low, high } => {
                let (below, above) = (low.x - p.x, p.x - high.x);
                if below > above { below } else { above }
            }
            Self::Ball { centre, radius } => {
                let way = p - *centre;
                way.x * way.x + way.y * way.y + way.z * way.z - radius * radius
            }
            Self::Ground(height) => p.y - height,
            Self::Empty => 1.0e9,
        }
    }
}

/// Small numbers, whose products are exact.
fn small(x: IVec4) -> Vec4 {
    Vec4::new(
        (x.x >> 24) as f32,
        (x.y >> 24) as f32,
        (x.z >> 24) as f32,
        (x.w >> 24) as f32,
    )
}

/// One of the shapes, by a number.
fn shape(kind: u32, v: Vec4) -> Shape {
    let p = Vec3::new(v.x, v.y, v.z);
    match kind % 4 {
        0 => Shape::Block {
            low: p - 0.5,
            high: p + 0.25,
        },
        1 => Shape::Ball {
            centre: p,
            radius: v.w,
        },
        2 => Shape::Ground(v.w),
        _ => Shape::Empty,
    }
}

/// An enum whose variants hold different data: the distance of a point from a shape.
#[kernel(compute, threads(64))]
pub fn distances(#[element] kind: u32, #[element] v: IVec4) -> f32 {
    let v = small(v);
    shape(kind, v).distance(Vec3::new(0.25, v.w, 0.5))
}

/// An array of enums: the largest distance of several shapes, and which it is.
#[kernel(compute, threads(64))]
pub fn farthest(#[element] kinds: UVec4, #[element] v: IVec4) -> Vec4 {
    let v = small(v);
    let shapes = [
        shape(kinds.x % 3, v),
        shape(kinds.y % 3, v * 0.5),
        shape(kinds.z % 3, v * -0.25),
    ];
    let mut most = -1.0e9;
    let mut which = 3;
    for (i, shape) in shapes.iter().enumerate() {
        let distance = shape.distance(Vec3::new(0.25, v.w, 0.5));
        if distance > most {
            most = distance;
            which = i;
        }
    }
    let chosen = shapes[(kinds.w % 3) as usize].distance(Vec3::ZERO);
    Vec4::new(most, which as f32, chosen, 0.0)
}

/// A token of a small language: variants of numbers of different types.
#[derive(Clone, Copy)]
enum Token {
    Pair { low: u32, high: i32 },
    Real(f32),
    Whole(u32),
    Flag(Bool),
    End,
}

/// One of the tokens.
fn token(x: UVec4) -> Token {
    match x.x % 5 {
        0 => Token::Real((x.y >> 8) as f32 * 0.5),
        1 => Token::Whole(x.y),
        2 => Token::Pair {
            low: x.y,
            high: x.z as i32 >> 3,
        },
        3 => Token::Flag((x.y & 1 == 1).into()),
        _ => Token::End,
    }
}

/// What a token says, as a number.
#[kernel(compute, threads(64))]
pub fn tokens(#[element] x: UVec4) -> u32 {
    match token(x) {
        Token::Real(value) => value as u32,
        Token::Whole(value) if value & 1 == 1 => value / 3,
        Token::Whole(value) => value,
        Token::Pair { low, high } => low ^ high as u32,
        Token::Flag(flag) if flag.get() => 11,
        Token::Flag(_) => 12,
        Token::End => 13,
    }
}

/// A token that becomes another again and again.
#[kernel(compute, threads(64))]
pub fn rewritten(#[element] x: UVec4) -> u32 {
    let mut token = token(x);
    for i in 0..(x.w & 7) {
        token = match token {
            Token::Real(value) => Token::Whole(value as u32 + i),
            Token::Whole(value) => Token::Pair {
                low: value,
                high: i as i32 - 3,
            },
            Token::Pair { low, high } => Token::Real(((low & 0xffff) as i32 + high) as f32),
            Token::Flag(flag) => Token::Whole(u32::from(!flag.get())),
            Token::End => Token::End,
        };
    }
    if let Token::Pair { low, high } = token {
        return low.wrapping_add(high as u32);
    }
    match token {
        Token::Real(value) => value.to_bits(),
        Token::Whole(value) => value,
        _ => 5,
    }
}

/// A half, or why there is none.
fn half(x: u32) -> Result<f32, u32> {
    if x & 1 == 0 {
        Ok((x >> 8) as f32 * 0.5)
    } else {
        Err(x)
    }
}

/// Results whose success and failure have different types.
#[kernel(compute, threads(64))]
pub fn attempts(#[element] x: u32) -> u32 {
    let first = match half(x) {
        Ok(value) => value as u32,
        Err(odd) => odd.wrapping_mul(3),
    };
    let second = half(x >> 1).map_or_else(|odd| odd ^ 0xff, |value| value as u32);
    first ^ second
}
