//! Powers, roots, order, and numbers of 8 and 16 bits, which have 32 in a shader.

use hankel_dsl::glam::{UVec2, UVec4};
use hankel_dsl::kernel;

/// Powers and roots of integers.
#[kernel(compute, threads(64))]
pub fn raised(#[element] x: UVec4) -> UVec4 {
    UVec4::new(
        x.x.wrapping_pow(x.y & 31) ^ 3_u32.pow(x.z & 7),
        (x.y as i32).wrapping_pow(x.x & 15) as u32 ^ (x.z as i32 & 7).pow(2) as u32,
        x.z.isqrt() ^ x.w.checked_ilog2().unwrap_or(99),
        x.w.trailing_zeros().pow(x.x & 3)
            ^ x.w
                .checked_pow(x.x & 7)
                .unwrap_or(x.w.saturating_pow(x.y & 7))
            ^ (x.w as i32).saturating_pow(x.z & 7) as u32,
    )
}

/// Numbers that get more bits, each by its own sign, whichever sign the wider type has.
#[kernel(compute, threads(64))]
pub fn extended(#[element] x: UVec4) -> UVec4 {
    UVec4::new(
        x.x as i16 as u32 ^ (x.x >> 16) as u8 as i32 as u32,
        x.y as u16 as i32 as u32 ^ (x.y >> 8) as i8 as u32,
        x.z as i8 as u16 as u32 | ((x.z >> 8) as u8 as i16 as i32 as u32) << 16,
        u32::from(x.w as u8 as i32 > 100) + 2 * u32::from((x.w as i8 as i32) < 0),
    )
}

/// How tall something is.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Height {
    Low,
    Middle,
    High,
}

#[inline]
fn height(x: u32) -> Height {
    match x & 3 {
        0 => Height::Low,
        1 => Height::Middle,
        _ => Height::High,
    }
}

/// Tuples, arrays and enums in order.
#[kernel(compute, threads(64))]
pub fn ranked(#[element] x: UVec4) -> UVec4 {
    let (a, b) = (x.x & 1, x.z & 1);
    UVec4::new(
        u32::from((a, x.y) < (b, x.w)) + 2 * u32::from((a, x.y as f32) >= (b, x.w as f32)),
        ((a, x.y, x.w).cmp(&(b, x.w, x.y)) as i32 + 1) as u32
            + 3 * ([a, x.y].cmp(&[b, x.w]) as i32 + 1) as u32,
        u32::from(Some(x.x & 3) < Some(x.y & 3))
            + 2 * u32::from([a, x.y] < [b, x.w])
            + 4 * u32::from([a, x.y] >= [b, x.w]),
        u32::from(height(x.x) < height(x.y)) + 2 * (height(x.z).max(height(x.w)) as u32),
    )
}

/// An answer that may not be there.
#[inline]
fn answer(x: u32, y: u32) -> Option<bool> {
    (x & 1 == 0).then_some(y > 0x4000_0000)
}

/// Truths that may not be there.
#[kernel(compute, threads(64))]
pub fn answered(#[element] x: UVec2) -> u32 {
    match answer(x.x, x.y) {
        Some(true) => 1,
        Some(false) => 2,
        None => answer(x.y, x.x).map_or(3, |it| 4 + u32::from(it)),
    }
}

/// Numbers of 8 and 16 bits: they wrap, and have signs.
#[kernel(compute, threads(64))]
pub fn small(#[element] x: UVec4) -> UVec4 {
    let (a, b) = (x.x as u8, (x.x >> 8) as u8);
    let (c, d) = (x.y as i8, (x.y >> 8) as i8);
    let (e, f) = (x.z as u16, (x.z >> 16) as u16);
    let (g, h) = (x.w as i16, (x.w >> 16) as i16);
    let bytes = a.wrapping_mul(b).wrapping_add(b >> 3) ^ (a << (b & 7)) ^ !a;
    let signed = c.wrapping_sub(d).wrapping_mul(3) ^ (c >> (d & 7)) ^ (c / (d & 15).max(1));
    let halves = e.wrapping_add(f) ^ (e % (f | 1)) ^ e.rotate_left(5);
    let of_sign = g.wrapping_neg().wrapping_add(h) ^ (g % (h.wrapping_abs() | 1));
    UVec4::new(
        u32::from(bytes) | u32::from(a < b) << 8 | u32::from(a.max(b)) << 16,
        i32::from(signed) as u32 ^ u32::from(c < d) << 8 ^ ((c as u8 as u32) << 16),
        u32::from(halves) ^ u32::from(e as u8 > f as u8) << 16 ^ (f32::from(f) * 2.0) as u32,
        i32::from(of_sign) as u32 ^ u32::from(g <= h) << 20 ^ (f32::from(g) as i32) as u32,
    )
}

/// Iterators that begin and end where something no longer holds, and the least by a key.
#[kernel(compute, threads(64))]
pub fn skipped(#[element] x: UVec4) -> UVec4 {
    let numbers = x.to_array();
    let all = || numbers.into_iter();
    UVec4::new(
        all()
            .take_while(|it| *it < 0xc000_0000)
            .skip_while(|it| it & 1 == 0)
            .sum(),
        all().min_by_key(|it| it & 0xff).unwrap_or(1),
        all().max_by_key(|it| it & 0xff).unwrap_or(2),
        (0..x.x & 7).count() as u32 + all().filter(|it| it & 1 == 0).count() as u32 * 8,
    )
}
