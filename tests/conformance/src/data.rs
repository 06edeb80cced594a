//! What memory can hold beside numbers of 32 bits and vectors of them: truth values, 64-bit integers,
//! vectors of three without padding.

use hankel_dsl::glam::{UVec2, Vec3, Vec4};
use hankel_dsl::{Bool, Element, PackedVec3, kernel};

/// What to do with a number.
#[derive(Clone, Copy, Debug, PartialEq, Element)]
#[repr(C)]
pub struct Switches {
    /// Whether its bits are turned over.
    pub inverted: Bool,
    /// Whether it is doubled.
    pub doubled: Bool,
}

/// A number, and whether it counts.
#[derive(Clone, Copy, Debug, PartialEq, Element)]
#[repr(C)]
pub struct Vote {
    /// The number.
    pub number: u32,
    /// Whether it counts.
    pub counts: Bool,
}

/// Numbers that switches change, and whether they are odd then.
#[kernel(compute, threads(64))]
pub fn switched(#[uniform] switches: &Switches, #[element] vote: Vote) -> Vote {
    let mut number = vote.number;
    if switches.inverted.get() {
        number = !number;
    }
    if switches.doubled.get() != vote.counts.get() {
        number = number.wrapping_mul(2);
    }
    Vote {
        number,
        counts: (number & 1 == 1).into(),
    }
}

/// The next state of a random number generator (Knuth, MMIX), turned.
#[kernel(compute, threads(64))]
pub fn wide(#[element] state: u64, #[element] by: u32) -> u64 {
    let next = state
        .wrapping_mul(6_364_136_223_846_793_005)
        .wrapping_add(1_442_695_040_888_963_407);
    let by = by & 63;
    (next >> by) ^ (next / (state | 1))
}

/// A sum, and its distance from zero.
#[kernel(compute, threads(64))]
pub fn signed_wide(#[element] a: i64, #[element] b: i32) -> (i64, u64) {
    let sum = a.wrapping_add(b as i64);
    let distance = if sum < 0 { sum.wrapping_neg() } else { sum };
    (sum, distance as u64)
}

/// Points that are turned a quarter round the third axis.
#[kernel(compute, threads(64))]
pub fn packed(#[element] point: PackedVec3) -> PackedVec3 {
    let p = Vec3::from(point);
    Vec3::new(-p.y, p.x, p.z).into()
}

/// What differs from one draw or dispatch to the next.
#[derive(Clone, Copy, Debug, PartialEq, Element)]
#[repr(C)]
pub struct Tint {
    /// What is added to each colour.
    pub add: Vec4,
    /// What it is multiplied by before.
    #[range(0.0..=1.0)]
    pub strength: f32,
    /// Which bits of numbers are turned over.
    pub mask: u32,
    /// What is added to numbers.
    pub offset: UVec2,
}

/// Numbers that are changed by what is part of the commands.
#[kernel(compute, threads(64))]
pub fn pushed(#[push] tint: &Tint, #[element] numbers: UVec2) -> UVec2 {
    let turned = numbers ^ UVec2::splat(tint.mask);
    UVec2::new(
        turned.x.wrapping_add(tint.offset.x),
        turned.y.wrapping_sub(tint.offset.y),
    )
}

/// Colours of fragments, beside a uniform.
#[kernel(
    fragment,
    parity(non_finite, why = "sums and products of absurd numbers overflow")
)]
pub fn pushed_colour(#[uniform] base: &Vec4, #[push] tint: &Tint, #[varying] colour: Vec4) -> Vec4 {
    (colour + *base) * tint.strength + tint.add
}
