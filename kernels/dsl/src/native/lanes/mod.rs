//! SIMD lanes as a [`Real`](crate::Real), of whichever instruction set the processor turns out to have.

use std::sync::OnceLock;
use std::vec::Vec;

use bytemuck::Pod;
use fearless_simd::{Level, Simd};

use super::layout::Lane;
use crate::math::Elementary;

#[cfg(target_arch = "aarch64")]
mod neon;
mod number;
#[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
mod permute;
mod register;
mod transpose;
#[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
mod x86;

/// Whether kernels are compiled for lanes: the feature `lanes`.
pub const BUILT: bool = cfg!(feature = "lanes");

/// The instruction sets that this processor has and lanes gain from, widest first, each by its
/// name. Narrower ones are not among them: from SSE2 and SSE4.2 lanes gain nothing over scalar code
/// (`cargo bench --workspace --bench lanes` measured it), and every one that is here costs a
/// compiled copy of each kernel. None where lanes are not [built](BUILT).
#[must_use]
pub fn levels() -> Vec<(&'static str, Level)> {
    let mut all = Vec::new();
    if !BUILT {
        return all;
    }
    let best = Level::new();
    #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
    all.extend(
        [
            ("avx512", best.as_avx512().map(|s| s.level())),
            ("avx2", best.as_avx2().map(|s| s.level())),
        ]
        .into_iter()
        .filter_map(|(name, level)| Some((name, level?))),
    );
    #[cfg(target_arch = "aarch64")]
    all.extend(best.as_neon().map(|s| ("neon", s.level())));
    all
}

/// The name of [`level`] where no lanes are used.
pub const SCALAR: &str = "scalar";

/// The instruction set in use: the best of [`levels`], or the one that the environment variable
/// `HANKEL_SIMD` names, if the processor has it. `None`: kernels run as scalar code.
#[must_use]
pub fn level() -> Option<Level> {
    static LEVEL: OnceLock<Option<Level>> = OnceLock::new();
    *LEVEL.get_or_init(|| {
        let wanted = std::env::var("HANKEL_SIMD").ok();
        if wanted.as_deref() == Some(SCALAR) {
            return None;
        }
        let levels = levels();
        let named = levels
            .iter()
            .find(|(name, _)| wanted.as_deref() == Some(name));
        named.or(levels.first()).map(|(_, level)| *level)
    })
}

/// Its name, for reports.
#[must_use]
pub fn level_name() -> &'static str {
    let Some(level) = level() else { return SCALAR };
    levels()
        .iter()
        .find(|(_, l)| std::mem::discriminant(l) == std::mem::discriminant(&level))
        .map_or(SCALAR, |(name, _)| name)
}

/// A scalar that has lanes. Only [`on_lanes`] may use the types of lanes: their operations need the instruction set.
pub trait Scalar: Elementary + Pod {
    /// Lanes of AVX2.
    #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
    type Avx2: Lane<Scalar = Self> + Elementary;
    /// Lanes of AVX-512.
    #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
    type Avx512: Lane<Scalar = Self> + Elementary;
    /// Lanes of NEON.
    #[cfg(target_arch = "aarch64")]
    type Neon: Lane<Scalar = Self> + Elementary;

    /// The bits of sqrt(1/2).
    const ROOT: Self;
    /// The bits of a significand.
    const FRACTION: Self;
    /// The bit of the sign.
    const SIGN: Self;
    /// The last bit.
    const LAST_BIT: Self;
    /// The bits of a quiet NaN.
    const NAN: Self;
    /// The bits of infinity.
    const INFINITY: Self;
}

macro_rules! scalar {
    (
        $number:ident, $avx2:ident, $avx512:ident, $neon:ident;
        root: $root:literal, fraction: $fraction:literal, sign: $sign:literal
    ) => {
        impl Scalar for $number {
            #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
            type Avx2 = number::$avx2;
            #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
            type Avx512 = number::$avx512;
            #[cfg(target_arch = "aarch64")]
            type Neon = number::$neon;

            const ROOT: Self = Self::from_bits($root);
            const FRACTION: Self = Self::from_bits($fraction);
            const SIGN: Self = Self::from_bits($sign);
            const LAST_BIT: Self = Self::from_bits(1);
            const NAN: Self = Self::NAN;
            const INFINITY: Self = Self::INFINITY;
        }
    };
}

scalar!(f32, Avx2F32, Avx512F32, NeonF32; root: 0x3f35_04f3, fraction: 0x007f_ffff, sign: 0x8000_0000);
scalar!(f64, Avx2F64, Avx512F64, NeonF64;
    root: 0x3fe6_a09e_667f_3bcd, fraction: 0x000f_ffff_ffff_ffff, sign: 0x8000_0000_0000_0000);

/// Bytes of a cache line.
#[cfg(target_arch = "x86_64")]
const LINE: usize = 64;

/// Asks for as many rows as these that follow them in memory, if any do: the next group's, while this one is computed.
#[inline(always)]
pub(super) fn fetch_next<T>(rows: &[T]) {
    #[cfg(target_arch = "x86_64")]
    {
        use core::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
        let start = rows.as_ptr().wrapping_add(rows.len()).cast::<i8>();
        for at in (0..size_of_val(rows)).step_by(LINE) {
            // SAFETY: an address that is not mapped does nothing.
            unsafe { _mm_prefetch::<_MM_HINT_T0>(start.wrapping_add(at)) };
        }
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = rows;
}

/// Asks for memory that results will be written to, so that it has arrived when they have been computed.
#[inline(always)]
pub(super) fn fetch_to_write<T>(slots: &[T]) {
    #[cfg(target_arch = "x86_64")]
    {
        use core::arch::x86_64::{_MM_HINT_ET0, _mm_prefetch};
        let start = slots.as_ptr().cast::<i8>();
        for at in (0..size_of_val(slots)).step_by(LINE) {
            // SAFETY: all of it is within the slice.
            unsafe { _mm_prefetch::<_MM_HINT_ET0>(start.wrapping_add(at)) };
        }
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = slots;
}

/// What is done with lanes.
pub trait Work {
    /// The scalar type.
    type Scalar: Scalar;
    /// What comes of it.
    type Output;
    /// It. An implementation is marked `#[inline(always)]`, as is everything over lanes that it calls.
    fn run<L: Lane<Scalar = Self::Scalar> + Elementary>(self) -> Self::Output;
}

/// Does `work` with the lanes of `level`, compiled for its instruction set; `None` if it is not among [`levels`].
#[inline(always)]
pub fn on_lanes<W: Work>(level: Level, work: W) -> Option<W::Output> {
    macro_rules! run {
        ($simd:ident, $Lanes:ident) => {
            Some(Simd::vectorize(
                $simd,
                #[inline(always)]
                || work.run::<<W::Scalar as Scalar>::$Lanes>(),
            ))
        };
    }
    match level {
        _ if !BUILT => None,
        #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
        Level::Avx512(simd) => run!(simd, Avx512),
        #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
        Level::Avx2(simd) => run!(simd, Avx2),
        #[cfg(target_arch = "aarch64")]
        Level::Neon(simd) => run!(simd, Neon),
        _ => None,
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use core::mem::MaybeUninit;
    use std::vec;

    use super::*;
    use crate::Mask;

    /// Numbers of `bits` bits whose exponents go from `low` to `high`: powers of two, their
    /// neighbours, few bits, all bits, random bits, both signs; and both zeros.
    pub fn magnitudes(low: i32, high: i32, bits: i32) -> impl Iterator<Item = f64> + Clone {
        let mut state = 1_u64;
        let mut random = move || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            state >> 11
        };
        let step = ((high - low) / 24).max(1);
        let exponents = (low..=high).step_by(step as usize).chain([high]);
        let power = |e: i32| 2_f64.powi(e / 2) * 2_f64.powi(e - e / 2);
        exponents
            .flat_map(move |e| {
                let last = power(1 - bits);
                let noise = ((random() >> (53 - bits)) | 1 << (bits - 1)) as f64 * power(1 - bits);
                let half = (random() >> (53 - bits / 2)) as f64 * power(1 - bits / 2);
                [1.0, 1.0 + last, 2.0 - last, 1.5, 1.0 + half / 4.0, noise].map(|x| x * power(e))
            })
            .flat_map(|x| [x, -x])
            .chain([0.0, -0.0])
    }

    /// Every two of them.
    pub fn pairs(low: i32, high: i32, bits: i32) -> impl Iterator<Item = (f64, f64)> {
        let all = magnitudes(low, high, bits);
        all.clone()
            .flat_map(move |a| all.clone().map(move |b| (a, b)))
    }

    /// Lanes that hold these numbers.
    #[inline(always)]
    fn lanes<L: Lane>(numbers: &[L::Scalar]) -> L {
        let mut lanes = [MaybeUninit::uninit()];
        L::columns(numbers, &mut lanes);
        // SAFETY: there is one column.
        unsafe { lanes[0].assume_init() }
    }

    /// The bits of a number.
    trait Bits {
        fn bits(self) -> u64;
    }

    impl Bits for f32 {
        fn bits(self) -> u64 {
            self.to_bits().into()
        }
    }

    impl Bits for f64 {
        fn bits(self) -> u64 {
            self.to_bits()
        }
    }

    /// Errors of sums and products.
    struct Errors<'a, T>(&'a [T], &'a [T]);

    impl<T: Scalar + Bits> Work for Errors<'_, T> {
        type Scalar = T;
        type Output = ();
        #[inline(always)]
        fn run<L: Lane<Scalar = T>>(self) {
            let name = level_name();
            for (a, b) in self
                .0
                .chunks_exact(L::LANES)
                .zip(self.1.chunks_exact(L::LANES))
            {
                let (x, y) = (lanes::<L>(a), lanes::<L>(b));
                let (sum, product) = (x.two_sum(y), x.two_product(y));
                let numbers = |lanes: L| {
                    let mut out = a.to_vec();
                    L::put_columns(&[lanes], &mut out);
                    out
                };
                let sum = (numbers(sum.0), numbers(sum.1));
                let product = (numbers(product.0), numbers(product.1));
                for i in 0..L::LANES {
                    let (scalar_sum, scalar_product) = (a[i].two_sum(b[i]), a[i].two_product(b[i]));
                    for (lane, scalar) in [
                        (sum.0[i], scalar_sum.0),
                        (sum.1[i], scalar_sum.1),
                        (product.0[i], scalar_product.0),
                        (product.1[i], scalar_product.1),
                    ] {
                        assert_eq!(lane.bits(), scalar.bits(), "{name}, lane {i}");
                    }
                }
            }
        }
    }

    #[test]
    fn exact_errors_are_the_same_on_every_level() {
        let single: (Vec<f32>, Vec<f32>) = pairs(-39, 62, 24)
            .map(|(a, b)| (a as f32, b as f32))
            .unzip();
        let double: (Vec<f64>, Vec<f64>) = pairs(-450, 494, 53).unzip();
        for (_, level) in levels() {
            on_lanes(level, Errors(&single.0, &single.1)).expect("it has lanes");
            on_lanes(level, Errors(&double.0, &double.1)).expect("it has lanes");
        }
    }

    /// Operations of two numbers, and those of their bits, lane by lane against the scalar's.
    struct Operations<'a, T>(&'a [T]);

    impl<T: Scalar + Bits> Work for Operations<'_, T> {
        type Scalar = T;
        type Output = ();
        #[inline(always)]
        fn run<L: Lane<Scalar = T> + Elementary>(self) {
            for a in self.0 {
                for b in self.0 {
                    let (x, y) = (L::splat(*a), L::splat(*b));
                    let one = |truth: bool| {
                        if truth {
                            crate::lit!(1.0)
                        } else {
                            crate::lit!(0.0)
                        }
                    };
                    let chosen =
                        |mask: L::Mask| L::select(mask, crate::lit!(1.0), crate::lit!(0.0));
                    for (i, (lanes, scalar)) in [
                        (x.min(y), a.min(*b)),
                        (x.max(y), a.max(*b)),
                        (x.abs(), a.abs()),
                        (-x, -*a),
                        (x.floor(), a.floor()),
                        (x.copy_sign(y), a.copy_sign(*b)),
                        (x.flip_sign(y), a.flip_sign(*b)),
                        (chosen(x.lt(y)), one(a.lt(*b).any())),
                        (chosen(x.le(y)), one(a.le(*b).any())),
                        (chosen(x.eq(y)), one(a.eq(*b).any())),
                        (chosen(!x.lt(y)), one(!a.lt(*b).any())),
                        (
                            chosen(x.lt(y) | x.eq(y)),
                            one(a.lt(*b).any() | a.eq(*b).any()),
                        ),
                        (
                            chosen(x.le(y) & x.eq(y)),
                            one(a.le(*b).any() & a.eq(*b).any()),
                        ),
                    ]
                    .into_iter()
                    .enumerate()
                    {
                        let mut out = vec![*a; L::LANES];
                        L::put_columns(&[lanes], &mut out);
                        for lane in out {
                            assert_eq!(lane.bits(), scalar.bits(), "{i}");
                        }
                    }
                    assert_eq!(x.lt(y).any(), a.lt(*b).any());
                    assert_eq!(x.lt(y).all(), a.lt(*b).any());
                }
            }
        }
    }

    /// What the elementary functions are made of, of normal numbers above zero and of whole numbers, lane by lane against
    /// the scalar's.
    struct Parts<'a, T> {
        normal: &'a [T],
        whole: &'a [T],
    }

    impl<T: Scalar + Bits> Work for Parts<'_, T> {
        type Scalar = T;
        type Output = ();
        #[inline(always)]
        fn run<L: Lane<Scalar = T> + Elementary>(self) {
            let agree = |lanes: L, scalar: T, what: &str| {
                let mut out = vec![scalar; L::LANES];
                L::put_columns(&[lanes], &mut out);
                for lane in out {
                    assert_eq!(lane.bits(), scalar.bits(), "{what}");
                }
            };
            for n in self.whole {
                agree(L::splat(*n).power_of_two(), n.power_of_two(), "power");
            }
            for a in self.normal {
                let x = L::splat(*a);
                let (lanes, scalar) = (x.decompose(), a.decompose());
                agree(lanes.0, scalar.0, "exponent");
                agree(lanes.1, scalar.1, "significand");
                agree(x.upper(), a.upper(), "upper half");
                agree(x.reciprocal_seed(), a.reciprocal_seed(), "reciprocal");
                agree(x.inverse_root_seed(), a.inverse_root_seed(), "root");
                agree(x.not_a_number(), a.not_a_number(), "NaN");
                agree(x.unbounded(), a.unbounded(), "infinity");
                if a.gt(crate::lit!(3200.0)).any() {
                    let (lanes, scalar) = (x.reduce_large(), a.reduce_large());
                    agree(lanes.0, scalar.0, "quarter turns");
                    agree(lanes.1, scalar.1, "angle");
                    agree(lanes.2, scalar.2, "rest of the angle");
                }
                for b in self.normal {
                    for b in [*b, -*b] {
                        agree(x.odd_sum(L::splat(b)), a.odd_sum(b), "odd sum");
                    }
                }
            }
        }
    }

    #[test]
    fn parts_of_elementary_functions_are_those_of_the_scalar() {
        let double: Vec<f64> = magnitudes(-1022, 1022, 53).filter(|x| *x > 0.0).collect();
        let single: Vec<f32> = magnitudes(-126, 126, 24)
            .filter(|x| *x > 0.0)
            .map(|x| x as f32)
            .collect();
        let double_whole: Vec<f64> = (-1022..=1023).map(f64::from).collect();
        let single_whole: Vec<f32> = (-126_i16..=127).map(f32::from).collect();
        for (_, level) in levels() {
            let parts = Parts {
                normal: &single,
                whole: &single_whole,
            };
            on_lanes(level, parts).expect("it has lanes");
            let parts = Parts {
                normal: &double,
                whole: &double_whole,
            };
            on_lanes(level, parts).expect("it has lanes");
        }
    }

    #[test]
    fn operations_are_those_of_the_scalar() {
        let double = [
            0.0,
            -0.0,
            1.0,
            -1.0,
            1.5,
            -2.75,
            1e-310,
            f64::NAN,
            -f64::NAN,
            f64::INFINITY,
            f64::MIN,
        ];
        let single = double.map(|x| x as f32);
        for (_, level) in levels() {
            on_lanes(level, Operations(&single)).expect("it has lanes");
            on_lanes(level, Operations(&double)).expect("it has lanes");
        }
    }
}
