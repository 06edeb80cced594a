//! What memory can hold beside numbers of 32 bits and vectors of them: truth values, 64-bit integers,
//! vectors of three without padding, numbers of 16 bits, matrices.

use hankel_dsl::glam::{Mat4, UVec2, UVec4, Vec2, Vec3, Vec4};
use hankel_dsl::{
    Bool, Buffer, Element, F16, F16x2, F16x4, Half, Half2, Half3, Half4, PackedVec3, kernel,
};

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

/// The next state of a random number generator (Knuth, MMIX), shifted and turned.
#[kernel(compute, threads(64))]
pub fn wide(#[element] state: u64, #[element] by: u32) -> u64 {
    let next = state
        .wrapping_mul(6_364_136_223_846_793_005)
        .wrapping_add(1_442_695_040_888_963_407);
    let turned = state.rotate_left(by) ^ next.rotate_right(35);
    let by = by & 63;
    (next >> by) ^ (next / (state | 1)) ^ turned
}

/// Numbers with their bytes in the other order.
#[kernel(compute, threads(64))]
pub fn swapped_bytes(#[element] a: u32, #[element] b: u64) -> (u32, u64) {
    (a.swap_bytes(), b.swap_bytes())
}

/// A sum, and its distance from zero.
#[kernel(compute, threads(64))]
pub fn signed_wide(#[element] a: i64, #[element] b: i32) -> (i64, u64) {
    let sum = a.wrapping_add(b as i64);
    let distance = if sum < 0 { sum.wrapping_neg() } else { sum };
    (sum, distance as u64)
}

/// Numbers that get 64 bits, by the sign that they had.
#[kernel(compute, threads(64))]
pub fn extended(#[element] a: i32, #[element] b: u32) -> (u64, i64) {
    let signed = a as u64 ^ (b as i16 as u64) << 3;
    let unsigned = b as i64 ^ (a as u8 as i64) << 3;
    (signed, unsigned)
}

/// 64-bit numbers that are read with the other sign: shifted by a constant and by a number, compared, shifted back.
#[kernel(compute, threads(64))]
pub fn signs(#[element] x: UVec2) -> UVec4 {
    let wide = (x.x as u64) << 32 | x.y as u64;
    let signed = wide as i64;
    UVec4::new(
        (signed >> 40) as u32,
        (signed >> (x.y & 63)) as u32,
        u32::from(signed < 5),
        (signed.wrapping_mul(3) as u64 >> 40) as u32,
    )
}

/// Points that are turned a quarter round the third axis.
#[kernel(compute, threads(64))]
pub fn packed(#[element] point: PackedVec3) -> PackedVec3 {
    let p = Vec3::from(point);
    Vec3::new(-p.y, p.x, p.z).into()
}

/// Where the camera is, and how often the skeleton's bones are turned.
#[derive(Clone, Copy, Debug, PartialEq, Element)]
#[repr(C)]
pub struct Camera {
    /// From the world to clip space.
    pub clip_from_world: Mat4,
    /// From a model to the world, for each of two models.
    pub world_from_model: [Mat4; 2],
    /// Added to each bone's number.
    pub first_bone: u32,
    /// Added to the number of the bone, too.
    pub frame: u32,
    /// Fills the structure up.
    pub padding: UVec2,
}

/// Points in clip space, each moved by a bone and by its model.
#[kernel(
    compute,
    threads(64),
    parity(non_finite, why = "sums and products of absurd numbers overflow")
)]
pub fn skinned(
    #[index] i: u32,
    #[uniform] camera: &Camera,
    #[storage] bones: Buffer<'_, Mat4>,
    #[element] point: Vec4,
) -> Vec4 {
    let bone = bones.get(camera.first_bone.wrapping_add(camera.frame ^ i) % bones.len());
    let model = camera.world_from_model[(i & 1) as usize];
    camera.clip_from_world * (model * (bone * point))
}

/// Bones in the world, and how they turn directions.
#[kernel(
    compute,
    threads(64),
    parity(non_finite, why = "sums and products of absurd numbers overflow")
)]
pub fn bones_in_world(#[uniform] world_from_model: &Mat4, #[element] bone: Mat4) -> (Mat4, Mat4) {
    let world = *world_from_model * bone;
    (world, world.transpose())
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

/// Two pairs of halves.
#[derive(Clone, Copy, Debug, PartialEq, Element)]
#[repr(C)]
pub struct Halves {
    /// The first pair.
    pub a: F16x2,
    /// The second pair; neither is zero.
    pub b: F16x2,
}

/// What is computed of them.
#[derive(Clone, Copy, Debug, PartialEq, Element)]
#[repr(C)]
pub struct HalfResults {
    /// Their sum and their difference.
    pub sums: F16x2,
    /// Their product and their quotient.
    pub products: F16x2,
    /// The root of the product's magnitude, and the larger of the sums.
    pub others: F16x2,
    /// The mean of a pair, computed in 32 bits.
    pub mean: f32,
}

/// Arithmetic on halves: each result is rounded to one.
#[kernel(
    compute,
    threads(64),
    inputs = inputs::halves,
    parity(
        non_finite,
        why = "sums, products and quotients may be beyond 65504"
    )
)]
pub fn halves(#[element] pair: Halves) -> HalfResults {
    let (a, b) = (pair.a, pair.b);
    let sums = F16x2::new(a.x() + b.x(), a.y() - b.y());
    let product = a.x() * b.x();
    let larger = if sums.x() > sums.y() {
        sums.x()
    } else {
        sums.y()
    };
    let both = Vec2::from(a);
    HalfResults {
        sums,
        products: F16x2::new(product, a.y() / b.y()),
        others: F16x2::new(product.abs().sqrt(), larger),
        mean: (both.x + both.y) * 0.5,
    }
}

/// The bits of any number of 32 bits as a half, and of any half as a number of 32.
#[kernel(compute, threads(64))]
pub fn half_bits(#[element] bits: u32) -> UVec2 {
    let wide = F16::from_bits(bits).get().to_bits();
    UVec2::new(F16::new(f32::from_bits(bits)).to_bits(), wide)
}

/// What the device's own halves give, as numbers of 32 bits.
#[derive(Clone, Copy, Debug, PartialEq, Element)]
#[repr(C)]
pub struct OwnHalves {
    /// A sum, a difference, a product and a quotient.
    pub operators: Vec4,
    /// A root, a magnitude, the smaller and the larger of two.
    pub functions: Vec4,
    /// A sum of a product, a whole number, one that is limited, and one that a comparison chooses.
    pub others: Vec4,
}

/// Arithmetic on halves by the device's own instructions.
#[kernel(
    compute,
    threads(64),
    inputs = inputs::own_halves,
    parity(
        ulp = 32768,
        why = "a quotient, a root and a product with a sum of 16 bits are within 4 ulp, each of which is 8192 ulp of f32"
    )
)]
pub fn own_halves(#[element] pair: Halves) -> OwnHalves {
    let (a, b) = (Half2::from(pair.a), Half2::from(pair.b));
    let (x, y) = (a.x, b.x);
    let larger = if x > y { x } else { y };
    OwnHalves {
        operators: Half4::new(x + y, x - y, x * y, a.y / b.y).into(),
        functions: Half4::new(a.y.abs().sqrt(), y.abs(), x.min(y), x.max(y)).into(),
        others: Half4::new(
            x.abs().mul_add(y.abs(), b.y.abs()),
            x.floor(),
            y.clamp(Half::new(-0.5), Half::new(1.5)),
            larger,
        )
        .into(),
    }
}

/// Vectors of halves, two, three and four at a time.
#[kernel(
    compute,
    threads(64),
    inputs = inputs::own_halves,
    parity(
        ulp = 65536,
        absolute = 0.0625,
        why = "four results of 16 bits in a row, each within 2 ulp; those of sums that cancel, of numbers below 32"
    )
)]
pub fn own_half_vectors(#[element] pair: Halves) -> OwnHalves {
    let (a, b) = (Half2::from(pair.a), Half2::from(pair.b));
    let all = Half4::from(F16x4 {
        xy: pair.a,
        zw: pair.b,
    });
    let mut three = Half3::new(b.x, a.y, b.y) * (a.x * Half::new(0.0625));
    three += Half3::from(Vec3::new(0.1, 0.2, 0.3));
    let mut index = 0;
    let mut sum = Half2::default();
    while index < 3 {
        sum = sum.mul_add(Half2::splat(Half::new(0.5)), a.max(b));
        index += 1;
    }
    let back = F16x2::from(sum.min(-b));
    OwnHalves {
        operators: all.into(),
        functions: Vec3::from(three - Half3::splat(b.x)).extend(a.abs().dot(b.abs()).get()),
        others: Vec4::new(
            all.abs().dot(all.abs()).get(),
            Vec2::from(back).x,
            Vec2::from(sum).y,
            three.dot(three).get(),
        ),
    }
}

/// A number that constants of every type change.
#[kernel(
    compute,
    threads(64),
    parity(non_finite, why = "squares of absurd numbers overflow")
)]
pub fn specialised(
    #[element] x: f32,
    #[constant(id = 0, default = 0.5)]
    #[values(0.5, -2.0)]
    scale: f32,
    #[constant(id = 1, default = -3)]
    #[values(-3, 7)]
    offset: i32,
    #[constant(id = 2, default = true)] squared: bool,
) -> f32 {
    let y = x * scale + offset as f32;
    if squared { y * y } else { y }
}

/// Directions and mixtures of halves.
#[kernel(
    compute,
    threads(64),
    inputs = inputs::own_halves,
    parity(
        ulp = 65536,
        absolute = 0.03125,
        why = "five results of 16 bits in a row, each within 2 ulp; those of sums that cancel, of numbers below 8"
    )
)]
pub fn half_directions(#[element] pair: Halves) -> OwnHalves {
    let (a, b) = (Half2::from(pair.a), Half2::from(pair.b));
    let (least, most) = (Half4::splat(Half::new(-2.0)), Half4::splat(Half::new(2.0)));
    let all = Half4::new(a.x, a.y, b.x, b.y).clamp(least, most);
    let three = Half3::new(all.x, all.y, Half::new(1.5));
    let direction = three.normalize();
    OwnHalves {
        operators: all.lerp(Half::new(0.5) * most, Half::new(0.25)).into(),
        functions: Vec3::from(direction).extend(f32::from(three.length())),
        others: (all / Half::new(4.0)).into(),
    }
}

/// A colour halfway to grey.
#[kernel(
    compute,
    threads(64),
    parity(
        ulp = 1,
        why = "a driver may add in another order, and a half be rounded to its neighbour"
    )
)]
pub fn faded(
    #[element]
    #[range(0.0..=4.0)]
    colour: F16x4,
) -> F16x4 {
    let colour = Vec4::from(colour).clamp(Vec4::ZERO, Vec4::splat(4.0));
    let grey = Vec4::splat((colour.x + colour.y + colour.z) * (1.0 / 3.0));
    ((colour + grey) * 0.5).into()
}

#[cfg(not(target_arch = "spirv"))]
mod inputs {
    //! Halves that are numbers.

    use hankel_dsl::F16x2;
    use hankel_dsl::native::inputs::{Given, Request, Source};

    extern crate std;

    use std::vec::Vec;

    use super::Halves;

    /// Any finite ones, of which those of the second pair are not zero.
    pub fn halves(request: &Request) -> Vec<Given> {
        let mut chance = Source::new(request.seed);
        let mut half = |least: u32| loop {
            let bits = chance.bits() as u32 & 0xffff;
            if (least..0x7c00).contains(&(bits & 0x7fff)) {
                return bits;
            }
        };
        let pairs: Vec<Halves> = (0..4099)
            .map(|_| Halves {
                a: F16x2::from_bits(half(0) | (half(0) << 16)),
                b: F16x2::from_bits(half(1) | (half(1) << 16)),
            })
            .collect();
        [Given::new("finite halves").buffer("pair", &pairs)].into()
    }

    /// From 1/16 to 16, of both signs, so that no result leaves the range of a half, nor is so small that a device may
    /// take it for zero.
    pub fn own_halves(request: &Request) -> Vec<Given> {
        let mut chance = Source::new(request.seed);
        let mut half = || {
            let bits = chance.bits() as u32;
            (0x2c00 + bits % 0x2000) | ((bits >> 16) & 0x8000)
        };
        let pairs: Vec<Halves> = (0..4099)
            .map(|_| Halves {
                a: F16x2::from_bits(half() | (half() << 16)),
                b: F16x2::from_bits(half() | (half() << 16)),
            })
            .collect();
        [Given::new("halves from 1/16 to 16").buffer("pair", &pairs)].into()
    }
}
