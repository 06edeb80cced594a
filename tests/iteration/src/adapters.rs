//! Iterators of iterators, chains of closures, parts of slices, and numbers as bytes.

use hankel_dsl::glam::{UVec2, UVec4};
use hankel_dsl::kernel;

/// The least and the greatest of what adapters make of arrays by value.
#[kernel(compute, threads(64))]
pub fn adapted(#[element] x: UVec4) -> UVec4 {
    let a = x.to_array();
    UVec4::new(
        a.into_iter().map(|t| t ^ 21).min().unwrap_or(1),
        a.into_iter()
            .filter(|t| *t > 7)
            .reduce(u32::max)
            .unwrap_or(2),
        a.into_iter()
            .filter_map(|t| t.checked_sub(5))
            .min()
            .unwrap_or(3),
        a.into_iter().map(|t| t & 0xff).max().unwrap_or(4),
    )
}

/// Both parts of an array, and the patterns that a slice may have.
#[kernel(compute, threads(64))]
pub fn halves(#[element] x: UVec4, #[element] at: u32) -> UVec4 {
    let numbers = x.to_array();
    let (front, back) = numbers.split_at((at & 3) as usize);
    let mut sums = [0_u32; 2];
    for number in front {
        sums[0] = sums[0].wrapping_mul(3).wrapping_add(*number);
    }
    for number in back {
        sums[1] = sums[1].wrapping_mul(5).wrapping_add(*number);
    }
    let ends = match numbers.as_slice() {
        [0, rest @ ..] => rest[0],
        [first, .., last] => first ^ last.rotate_left(1),
        _ => 7,
    };
    UVec4::new(sums[0], sums[1], ends, back.len() as u32)
}

/// The places of a grid: one range for each number of another one.
#[kernel(compute, threads(64))]
pub fn taps(#[element] x: UVec4) -> UVec2 {
    let mut sums = [0_u32; 2];
    for (row, column) in (0..3_u32).flat_map(|row| (0..3_u32).map(move |column| (row, column))) {
        sums[0] = sums[0]
            .wrapping_mul(7)
            .wrapping_add(x.x.wrapping_mul(row) ^ column);
    }
    for number in (0..x.y & 7).flat_map(|i| i..2 * i) {
        sums[1] = sums[1].wrapping_mul(3).wrapping_add(number ^ x.z);
    }
    UVec2::from_array(sums)
}

/// Rows of numbers as one: by value, numbered, and by reference.
#[kernel(compute, threads(64))]
pub fn flattened(#[element] x: UVec4, #[element] y: UVec4) -> UVec4 {
    let rows = [x.to_array(), y.to_array()];
    let mut sum = 0_u32;
    for number in rows.into_iter().flatten() {
        sum = sum.wrapping_mul(7).wrapping_add(number);
    }
    let numbered = rows.into_iter().flatten().enumerate();
    let weighed = numbered.fold(0_u32, |sum, (i, number)| {
        sum ^ number.wrapping_mul(i as u32)
    });
    let hash = rows
        .iter()
        .flatten()
        .fold(0_u32, |sum, number| sum.wrapping_mul(3) ^ number);
    UVec4::new(sum, weighed, hash, 0)
}

/// A range that begins again, and one of which the next number is looked at before it is taken.
#[kernel(compute, threads(64))]
pub fn again(#[element] x: UVec4) -> UVec4 {
    let numbers = x.to_array();
    let mut sums = [0_u32; 2];
    for i in (0..4_usize).cycle().take(7) {
        sums[0] = sums[0].wrapping_mul(7).wrapping_add(numbers[i]);
    }
    let mut all = (0..x.x & 7).peekable();
    while let Some(number) = all.next() {
        if all.peek().is_some() {
            sums[1] = sums[1].wrapping_mul(3).wrapping_add(number ^ x.y);
        }
    }
    // An iterator that has ended, and stays so.
    let mut once = (0..1_u32).fuse();
    let first = once.next().unwrap_or(9);
    let second = once.next().unwrap_or(9);
    UVec4::new(sums[0], sums[1], first, second)
}

/// Closures after closures, each of which knows another number.
#[kernel(compute, threads(64))]
pub fn sieved(#[element] x: UVec4, #[element] y: UVec4) -> UVec4 {
    let numbers = x.to_array();
    let odd = numbers
        .iter()
        .filter_map(|n| if n & 1 == 1 { Some(n ^ y.x) } else { None })
        .filter_map(|n| if n > y.y { Some(n & y.z) } else { None })
        .fold(0_u32, u32::wrapping_add);
    let greatest = numbers
        .iter()
        .map(|n| n ^ y.x)
        .max_by_key(|n| n & y.w)
        .unwrap_or(0);
    let kept = numbers
        .iter()
        .map(|n| n ^ y.x)
        .filter(|n| n & y.y != 0)
        .fold(1_u32, |sum, n| sum.wrapping_mul(y.z) ^ n);
    let sums = numbers.iter().scan(y.w, |sum, n| {
        *sum = sum.wrapping_add(*n);
        Some(*sum)
    });
    let until = sums
        .map_while(|n| if n & 3 == 3 { None } else { Some(n ^ y.x) })
        .fold(0_u32, |sum, n| sum.rotate_left(3) ^ n);
    UVec4::new(odd, greatest, kept, until)
}

/// Numbers from bytes and as bytes, in either order.
#[kernel(compute, threads(64))]
pub fn in_bytes(#[element] x: UVec4) -> UVec4 {
    let little = x.x.to_le_bytes();
    let big = x.y.to_be_bytes();
    let mixed = [little[0], big[0], little[3], big[3]];
    let signed = (x.z as i32).to_le_bytes();
    let [low, high, ..] = f32::from_bits(x.w).to_le_bytes();
    UVec4::new(
        u32::from_le_bytes(mixed),
        u32::from_be_bytes(little),
        i32::from_le_bytes(signed) as u32,
        u32::from(u16::from_le_bytes([low, high])),
    )
}
