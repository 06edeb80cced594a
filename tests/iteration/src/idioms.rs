//! What an author takes for granted in Rust: each needs the patched `core` or references that are resolved.

use hankel_dsl::glam::{IVec4, UVec4, Vec3, Vec4};
use hankel_dsl::{Atomics, Shared, barrier, kernel};

/// Iterators one after the other: by value, by reference, ranges.
#[kernel(compute, threads(64))]
pub fn linked(#[element] x: UVec4, #[element] y: UVec4) -> u32 {
    let (a, b) = (x.to_array(), y.to_array());
    let mut sum = 0_u32;
    for number in a.into_iter().chain(b) {
        sum = sum.wrapping_mul(3).wrapping_add(number);
    }
    for number in a[..2].iter().chain(&a[1..]) {
        sum = sum.wrapping_mul(5) ^ number;
    }
    for number in (0..3).chain(7..9) {
        sum = sum.wrapping_mul(3).wrapping_add(number);
    }
    a.iter()
        .chain(&b)
        .fold(sum, |sum, number| sum.rotate_left(3) ^ number)
}

/// The neighbours of a cell, which are told by a pair that is compared with a constant one.
#[kernel(compute, threads(64))]
pub fn neighbours(#[element] x: UVec4) -> i32 {
    let (at, other) = ((x.x & 0xffff) as i32, (x.y & 0xffff) as i32);
    let mut sum = 0_i32;
    for dy in -1..=1 {
        for dx in -1..=1 {
            if (dx, dy) != (0, 0) {
                sum = sum.wrapping_add((at ^ dx).wrapping_mul(other ^ dy));
            }
        }
    }
    sum
}

/// Numbers in order, in descending order of their low bytes, and turned.
#[kernel(compute, threads(64))]
pub fn sorted(#[element] x: UVec4) -> UVec4 {
    let mut numbers = x.to_array();
    numbers.sort_unstable();
    numbers.sort_unstable_by_key(|number| number & 0xff);
    numbers.sort_unstable_by(|a, b| (b & 0xffff).cmp(&(a & 0xffff)));
    numbers.rotate_left(1);
    numbers.rotate_right((x.x & 3) as usize);
    UVec4::from_array(numbers)
}

/// Whether small numbers are in order: upwards, downwards and without repetition, by their last bits.
#[kernel(compute, threads(64))]
pub fn in_order(#[element] x: UVec4) -> u32 {
    let numbers = (x & 3).to_array();
    let up = numbers.is_sorted();
    let down = numbers.is_sorted_by(|a, b| a > b);
    let by_bits = numbers.is_sorted_by_key(|number| number & 1);
    u32::from(up) | u32::from(down) << 1 | u32::from(by_bits) << 2
}

/// How many elements are less than the next one, whether they read the same backwards, whether they come before that
/// order, and the largest but for the first.
#[kernel(compute, threads(64))]
pub fn rising(#[element] x: UVec4) -> UVec4 {
    let a = x.to_array();
    let rises = a.iter().zip(a.iter().skip(1)).filter(|(p, q)| p < q);
    let count = rises.count() as u32;
    let is_same = a.iter().eq(a.iter().rev());
    let is_less = a.iter().lt(a.iter().rev());
    let largest = a.into_iter().skip(1).max();
    UVec4::new(count, is_same.into(), is_less.into(), largest.unwrap_or(0))
}

/// Where a number stands among those in order.
#[kernel(compute, threads(64))]
pub fn placed(#[element] x: u32) -> u32 {
    let numbers = [1, 5, 9, 1000, 0x7fff_ffff];
    let place = match numbers.binary_search(&x) {
        Ok(place) => place,
        Err(place) => place + 100,
    };
    let smaller = numbers.partition_point(|number| *number < x & 0xff);
    place as u32 + smaller as u32 * 1000
}

/// References that are chosen while the kernel runs.
#[kernel(compute, threads(64))]
pub fn chosen(#[element] x: UVec4) -> UVec4 {
    let numbers = x.to_array();
    let one = if x.x > x.y {
        &numbers[2]
    } else {
        &numbers[(x.z & 3) as usize]
    };
    let large = numbers.iter().find(|number| **number > 0x8000_0000);
    UVec4::new(
        *one,
        large.copied().unwrap_or(3),
        numbers.iter().min().map_or(7, |least| least ^ 1),
        numbers.iter().max().map_or(9, |most| most ^ 2),
    )
}

/// Two rows side by side, by reference, with the number of the column.
#[kernel(compute, threads(64))]
pub fn numbered_pairs(#[element] x: UVec4, #[element] y: UVec4) -> u32 {
    let (a, b) = (x.to_array(), y.to_array());
    let mut sum = 0_u32;
    for (column, (a, b)) in a.iter().zip(&b).enumerate() {
        sum = sum.wrapping_add((a ^ b).wrapping_mul(column as u32 + 1));
    }
    sum
}

/// A number, halved again and again.
struct Halves(u32);

impl Iterator for Halves {
    type Item = u32;

    fn next(&mut self) -> Option<u32> {
        self.0 /= 2;
        (self.0 > 0).then_some(self.0)
    }
}

/// An iterator of the author's own, and one that `core` makes of a function.
#[kernel(compute, threads(64))]
pub fn halved(#[element] x: u32) -> u32 {
    let mut sum = Halves(x)
        .take(5)
        .fold(0_u32, |sum, half| sum.wrapping_mul(3) ^ half);
    for half in Halves(x & 0xff) {
        sum ^= half;
    }
    let next = |number: &u32| (*number > 3).then_some(number / 2);
    core::iter::successors(Some(x & 0xfff), next)
        .take(6)
        .fold(sum, |sum, number| sum.wrapping_mul(3) ^ number)
}

/// What a surface is made of.
#[derive(Clone, Copy)]
enum Material {
    /// Scatters light.
    Diffuse(Vec3),
    /// Bends it.
    Glass(f32),
    /// Reflects it.
    Mirror,
}

/// Where a ray meets a surface.
#[derive(Clone, Copy)]
struct Hit {
    distance: f32,
    material: Material,
}

/// The hit of a ray, if there is one.
fn hit(v: Vec4) -> Option<Hit> {
    if v.x < 0.0 {
        return None;
    }
    let material = match v.y {
        y if y < -16.0 => Material::Diffuse(Vec3::new(v.z, v.w, v.x)),
        y if y < 16.0 => Material::Glass(v.z),
        _ => Material::Mirror,
    };
    Some(Hit {
        distance: v.x,
        material,
    })
}

/// An `Option` of what holds an enum with data.
#[kernel(compute, threads(64))]
pub fn lit(#[element] x: IVec4) -> f32 {
    let v = Vec4::new(
        (x.x >> 24) as f32,
        (x.y >> 24) as f32,
        (x.z >> 24) as f32,
        (x.w >> 24) as f32,
    );
    let Some(Hit { distance, material }) = hit(v) else {
        return -1.0;
    };
    distance
        + match material {
            Material::Diffuse(colour) => colour.x + colour.y * 2.0 + colour.z * 4.0,
            Material::Glass(index) => index * 0.5,
            Material::Mirror => 0.25,
        }
}

/// Signed and unsigned integers that may overflow.
#[kernel(compute, threads(64))]
pub fn checked(#[element] x: IVec4) -> UVec4 {
    let (a, b) = (x.x as u32, x.y as u32);
    let turns: i32 = (0..4).take(3).map(|i| i * (x.x >> 4)).sum();
    UVec4::new(
        x.x.checked_add(x.y & 3).unwrap_or(7) as u32,
        x.x.checked_sub(x.z).unwrap_or(9) as u32,
        x.z.checked_mul(x.w).map_or(1, |product| product as u32) ^ turns as u32,
        x.w.saturating_add(x.z) as u32
            ^ x.w.saturating_sub(x.y) as u32
            ^ a.saturating_add(b)
            ^ a.saturating_sub(b)
            ^ a.checked_mul(b).unwrap_or(5)
            ^ x.y.signum() as u32
            ^ u32::try_from(x.z).unwrap_or(3),
    )
}

/// The bits of 64-bit numbers.
#[kernel(compute, threads(64))]
pub fn wide_bits(#[element] x: UVec4) -> UVec4 {
    let number = u64::from(x.x) << (x.z & 31) ^ u64::from(x.y);
    UVec4::new(
        number.leading_zeros(),
        number.trailing_zeros(),
        number.count_ones(),
        (number.reverse_bits() >> 13) as u32,
    )
}

/// A workgroup in a crate that iterates, where rustc inlines everything: the sum of what its invocations hand to each
/// other.
#[kernel(compute, threads(64), range(x))]
pub fn mirrored(
    #[local_index] me: u32,
    #[shared] shared: Shared<'_, u32, 64>,
    #[element] x: Option<u32>,
    #[atomic] sum: Atomics<'_>,
) {
    shared.set(me, x.unwrap_or(0));
    barrier();
    sum.add(0, shared.get(63 - me));
}
