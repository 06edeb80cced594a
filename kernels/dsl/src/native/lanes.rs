//! SIMD lanes as a [`Real`]: `fearless_simd`'s native-width vectors, whichever instruction set the
//! processor turns out to have. The lanes never fuse a product and a sum, so that a lane's result
//! is the scalar result bit for bit.

use core::ops::{Add, AddAssign, BitAnd, BitOr, Div, Mul, MulAssign, Neg, Not, Sub, SubAssign};

use std::sync::OnceLock;
use std::vec::Vec;

use fearless_simd::prelude::*;
use fearless_simd::{Level, Simd};

use super::layout::Lane;
use super::transpose;
use crate::math::Elementary;
use crate::{Mask, Real};

/// The instruction sets that this processor has and lanes gain from, widest first, each by its
/// name. Narrower ones are not among them: from SSE2 and SSE4.2 lanes gain nothing over scalar code
/// (`cargo bench -p hankel-shadows --bench lanes` measured it), and every one that is here costs a
/// compiled copy of each kernel.
#[must_use]
pub fn levels() -> Vec<(&'static str, Level)> {
    let best = Level::new();
    let mut all = Vec::new();
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

/// `$lanes` compiled for the instruction set of `$level`, an `Option<Level>` out of [`levels`], with
/// its token as `$simd`; else `$scalar`. Unlike [`fearless_simd::dispatch`] it compiles nothing for
/// instruction sets that are not among [`levels`].
macro_rules! on_level {
    ($level:expr, $simd:ident => $lanes:expr, $scalar:expr) => {
        match $level {
            #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
            Some(fearless_simd::Level::Avx512($simd)) => fearless_simd::Simd::vectorize(
                $simd,
                #[inline(always)]
                || $lanes,
            ),
            #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
            Some(fearless_simd::Level::Avx2($simd)) => fearless_simd::Simd::vectorize(
                $simd,
                #[inline(always)]
                || $lanes,
            ),
            #[cfg(target_arch = "aarch64")]
            Some(fearless_simd::Level::Neon($simd)) => fearless_simd::Simd::vectorize(
                $simd,
                #[inline(always)]
                || $lanes,
            ),
            _ => $scalar,
        }
    };
}
pub(super) use on_level;

/// The token of instruction set `S`, out of nothing.
///
/// Lane types cannot be named outside of this crate, and the executor creates them only inside
/// [`on_level`], where the token exists.
#[inline(always)]
pub(super) fn token<S: Simd>() -> S {
    const { assert!(size_of::<S>() == 0) }
    // SAFETY: `S` has no bytes, so any pointer that is not null and aligned reads a valid value;
    // and code that gets here runs under `on_level` with a token of this very type.
    unsafe { core::ptr::NonNull::<S>::dangling().read() }
}

/// Whether `mul_sub` of instruction set `S` rounds once.
#[inline(always)]
fn fuses<S: Simd>() -> bool {
    match token::<S>().level() {
        #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
        Level::Avx2(_) | Level::Avx512(_) => true,
        #[cfg(target_arch = "aarch64")]
        Level::Neon(_) => true,
        _ => false,
    }
}

/// Whether `min` and `max` of instruction set `S` are a comparison and a choice, and so give the
/// scalar's bits even of a NaN or of zeros of both signs.
#[inline(always)]
fn picks<S: Simd>() -> bool {
    match token::<S>().level() {
        #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
        Level::Sse2(_) | Level::Sse4_2(_) | Level::Avx2(_) | Level::Avx512(_) => true,
        _ => false,
    }
}

macro_rules! lanes {
    ($name:ident, $vector:ident, $mask_name:ident, $mask:ident, $float:ident, $column:ident, $put_column:ident) => {
        /// As many numbers as a register of `S` holds.
        #[derive(Clone, Copy)]
        pub struct $name<S: Simd>(S::$vector);

        /// A truth value for each lane.
        #[derive(Clone, Copy)]
        pub struct $mask_name<S: Simd>(S::$mask);

        impl<S: Simd> BitAnd for $mask_name<S> {
            type Output = Self;
            #[inline(always)]
            fn bitand(self, o: Self) -> Self {
                Self(self.0 & o.0)
            }
        }

        impl<S: Simd> BitOr for $mask_name<S> {
            type Output = Self;
            #[inline(always)]
            fn bitor(self, o: Self) -> Self {
                Self(self.0 | o.0)
            }
        }

        impl<S: Simd> Not for $mask_name<S> {
            type Output = Self;
            #[inline(always)]
            fn not(self) -> Self {
                Self(!self.0)
            }
        }

        impl<S: Simd> Mask for $mask_name<S> {
            #[inline(always)]
            fn any(self) -> bool {
                self.0.any_true()
            }
            #[inline(always)]
            fn all(self) -> bool {
                self.0.all_true()
            }
        }

        lanes!(@operator $name, Add, add, AddAssign, add_assign);
        lanes!(@operator $name, Sub, sub, SubAssign, sub_assign);
        lanes!(@operator $name, Mul, mul, MulAssign, mul_assign);

        impl<S: Simd> Div for $name<S> {
            type Output = Self;
            #[inline(always)]
            fn div(self, o: Self) -> Self {
                Self(self.0 / o.0)
            }
        }

        impl<S: Simd> Neg for $name<S> {
            type Output = Self;
            #[inline(always)]
            fn neg(self) -> Self {
                Self(-self.0)
            }
        }

        impl<S: Simd> Real for $name<S> {
            type Mask = $mask_name<S>;
            const IS_WIDE: bool = <$float as Real>::IS_WIDE;

            #[inline(always)]
            fn literal<const BITS: u64>() -> Self {
                Self(S::$vector::simd_from(token::<S>(), const { f64::from_bits(BITS) as $float }))
            }
            #[inline(always)]
            fn epsilon() -> Self {
                Self(S::$vector::simd_from(token::<S>(), $float::EPSILON))
            }
            #[inline(always)]
            fn sqrt(self) -> Self {
                Self(self.0.sqrt())
            }
            #[inline(always)]
            fn abs(self) -> Self {
                Self(self.0.abs())
            }
            #[inline(always)]
            fn floor(self) -> Self {
                Self(self.0.floor())
            }
            #[inline(always)]
            fn min(self, o: Self) -> Self {
                if picks::<S>() {
                    return Self(self.0.min(o.0));
                }
                Self::select(self.lt(o), self, o)
            }
            #[inline(always)]
            fn max(self, o: Self) -> Self {
                if picks::<S>() {
                    return Self(self.0.max(o.0));
                }
                Self::select(self.gt(o), self, o)
            }
            #[inline(always)]
            fn lt(self, o: Self) -> Self::Mask {
                $mask_name(self.0.simd_lt(o.0))
            }
            #[inline(always)]
            fn le(self, o: Self) -> Self::Mask {
                $mask_name(self.0.simd_le(o.0))
            }
            #[inline(always)]
            fn eq(self, o: Self) -> Self::Mask {
                $mask_name(self.0.simd_eq(o.0))
            }
            #[inline(always)]
            fn select(mask: Self::Mask, a: Self, b: Self) -> Self {
                Self(mask.0.select(a.0, b.0))
            }
            #[inline(always)]
            fn two_sum(self, o: Self) -> (Self, Self) {
                let sum = self + o;
                let from_o = sum - self;
                (sum, (self - (sum - from_o)) + (o - from_o))
            }
            #[inline(always)]
            fn two_product(self, o: Self) -> (Self, Self) {
                let product = self * o;
                if fuses::<S>() {
                    return (product, Self(self.0.mul_sub(o.0, product.0)));
                }
                let (high, o_high) = (self.upper(), o.upper());
                let (low, o_low) = (self - high, o - o_high);
                let error = (high * o_high - product) + high * o_low + low * o_high;
                (product, error + low * o_low)
            }
        }

        impl<S: Simd> Lane for $name<S> {
            type Scalar = $float;
            const LANES: usize = S::$vector::LEN;
            #[inline(always)]
            fn splat(value: $float) -> Self {
                Self(S::$vector::simd_from(token::<S>(), value))
            }
            #[inline(always)]
            fn column(table: &[$float], width: usize, at: usize) -> Self {
                Self(transpose::$column::<S>(table, width, at))
            }
            #[inline(always)]
            fn put_column(table: &mut [$float], width: usize, at: usize, last: &[Self; 4]) {
                let [a, b, c, d] = *last;
                transpose::$put_column::<S>(table, width, at, [a.0, b.0, c.0, d.0]);
            }
        }
    };
    (@operator $name:ident, $op:ident, $method:ident, $assign:ident, $assign_method:ident) => {
        impl<S: Simd> $op for $name<S> {
            type Output = Self;
            #[inline(always)]
            fn $method(self, o: Self) -> Self {
                Self($op::$method(self.0, o.0))
            }
        }
        impl<S: Simd> $assign for $name<S> {
            #[inline(always)]
            fn $assign_method(&mut self, o: Self) {
                *self = $op::$method(*self, o);
            }
        }
    };
}

lanes!(
    F32s,
    f32s,
    F32Mask,
    mask32s,
    f32,
    column_f32,
    put_column_f32
);
lanes!(
    F64s,
    f64s,
    F64Mask,
    mask64s,
    f64,
    column_f64,
    put_column_f64
);

/// Operations on bits that the elementary functions are made of; what has no instruction goes
/// through the lanes one by one, which is what the scalar does.
macro_rules! elementary {
    (
        $name:ident, $float:ident, $vector:ident, $signed:ident, $unsigned:ident, $bits:ident,
        $digits:literal, $bias:literal, $root:literal, $fraction:literal
    ) => {
        impl<S: Simd> $name<S> {
            #[inline(always)]
            fn bits(self) -> S::$unsigned {
                self.0.bitcast()
            }
            #[inline(always)]
            fn of_bits(bits: S::$unsigned) -> Self {
                Self(bits.bitcast())
            }
            #[inline(always)]
            fn each<const N: usize>(self, function: impl Fn($float) -> [$float; N]) -> [Self; N] {
                let mut lanes = [[0.0; 16]; N];
                let lanes_of = <Self as Lane>::LANES;
                for i in 0..lanes_of {
                    let values = function(self.0[i]);
                    for (all, value) in lanes.iter_mut().zip(values) {
                        all[i] = value;
                    }
                }
                lanes.map(|all| Self(S::$vector::from_slice(token::<S>(), &all[..lanes_of])))
            }
        }

        impl<S: Simd> Elementary for $name<S> {
            #[inline(always)]
            fn largest() -> Self {
                Self::splat($float::MAX)
            }
            #[inline(always)]
            fn guard(self) -> Self {
                self
            }
            #[inline(always)]
            fn upper(self) -> Self {
                elementary!(@upper $float, self)
            }
            #[inline(always)]
            fn decompose(self) -> (Self, Self) {
                let from_root = self.bits() - $root;
                let signed: S::$signed = from_root.bitcast();
                let exponent = S::$vector::float_from(signed >> $digits);
                (Self(exponent), Self::of_bits((from_root & $fraction) + $root))
            }
            #[inline(always)]
            fn power_of_two(self) -> Self {
                let n = S::$signed::truncate_from(self.0) + $bias;
                Self((n << $digits).bitcast())
            }
            #[inline(always)]
            fn copy_sign(self, sign: Self) -> Self {
                Self(self.0.copysign(sign.0))
            }
            #[inline(always)]
            fn flip_sign(self, sign: Self) -> Self {
                let sign = sign.bits() & (1 << ($bits::BITS - 1));
                Self::of_bits(self.bits() ^ sign)
            }
            #[inline(always)]
            fn reciprocal_seed(self) -> Self {
                elementary!(@seed $float, self, reciprocal_seed, |bits: S::u32s| {
                    S::u32s::simd_from(token::<S>(), 0x7ef3_11c7) - bits
                })
            }
            #[inline(always)]
            fn inverse_root_seed(self) -> Self {
                elementary!(@seed $float, self, inverse_root_seed, |bits: S::u32s| {
                    S::u32s::simd_from(token::<S>(), 0x5f37_5a86) - (bits >> 1)
                })
            }
            #[inline(always)]
            fn reduce_large(self) -> (Self, Self, Self) {
                let [q, high, low] = self.each(|x| {
                    // A lane that is no large number is not asked for.
                    let x = if x > 3200.0 && x <= $float::MAX { x } else { $float::MAX };
                    let (q, high, low) = x.reduce_large();
                    [q, high, low]
                });
                (q, high, low)
            }
            #[inline(always)]
            fn odd_sum(self, other: Self) -> Self {
                let (sum, error) = self.two_sum(other);
                let bits = sum.bits();
                let zero = Self::splat(0.0);
                let (low, negative) = (error.lt(zero), sum.lt(zero));
                let away = (low & negative) | (!low & !negative);
                let odd = Self::select(away, sum, Self::of_bits(bits - 1));
                let odd = Self::of_bits(odd.bits() | 1);
                Self::select(error.eq(zero), sum, odd)
            }
            #[inline(always)]
            fn not_a_number(self) -> Self {
                Self::of_bits(self.bits() | $float::NAN.to_bits())
            }
            #[inline(always)]
            fn unbounded(self) -> Self {
                Self::of_bits(self.bits() | $float::INFINITY.to_bits())
            }
        }
    };
    (@upper f32, $self:ident) => {
        Self::of_bits($self.bits() & 0xffff_f000)
    };
    // 53 bits are cut into 26, a sign and 26: the upper half must be rounded (Veltkamp).
    (@upper f64, $self:ident) => {{
        let scaled = $self.0 * 134_217_729.0;
        Self(scaled - (scaled - $self.0))
    }};
    (@seed f32, $self:ident, $method:ident, $bits:expr) => {
        Self::of_bits($bits($self.bits()))
    };
    // From `f32`, as on devices without integers of 64 bits.
    (@seed f64, $self:ident, $method:ident, $bits:expr) => {{
        let [seed] = $self.each(|x| [x.$method()]);
        seed
    }};
}

elementary!(
    F32s,
    f32,
    f32s,
    i32s,
    u32s,
    u32,
    23,
    127,
    0x3f35_04f3,
    0x007f_ffff
);
elementary!(
    F64s,
    f64,
    f64s,
    i64s,
    u64s,
    u64,
    52,
    1023,
    0x3fe6_a09e_667f_3bcd,
    0x000f_ffff_ffff_ffff
);

/// A scalar that has lanes.
pub trait Scalar: Elementary {
    /// Lanes of it.
    type Lanes<S: Simd>: Lane<Scalar = Self> + Elementary;
}

impl Scalar for f32 {
    type Lanes<S: Simd> = F32s<S>;
}

impl Scalar for f64 {
    type Lanes<S: Simd> = F64s<S>;
}

#[cfg(test)]
pub(crate) mod tests {
    use std::vec;

    use fearless_simd::dispatch;

    use super::*;
    use crate::native::pairs::Pair;

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

    #[inline(always)]
    fn agree<L: Lane>(a: &[L::Scalar], b: &[L::Scalar], bits: impl Fn(L::Scalar) -> u64) {
        let name = level_name();
        for (a, b) in a.chunks_exact(L::LANES).zip(b.chunks_exact(L::LANES)) {
            let (x, y) = (L::column(a, 1, 0), L::column(b, 1, 0));
            let (sum, product) = (x.two_sum(y), x.two_product(y));
            let numbers = |lanes: L| {
                let mut out = a.to_vec();
                L::put_column(&mut out, 1, 0, &[lanes; 4]);
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
                    assert_eq!(bits(lane), bits(scalar), "{name}, lane {i}");
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
            #[inline(always)]
            fn both<S: Simd>(_: S, single: &(Vec<f32>, Vec<f32>), double: &(Vec<f64>, Vec<f64>)) {
                agree::<F32s<S>>(&single.0, &single.1, |x| x.to_bits().into());
                agree::<F64s<S>>(&double.0, &double.1, f64::to_bits);
                agree::<Pair<F32s<S>>>(&single.0, &single.1, |x| x.to_bits().into());
                agree::<Pair<F64s<S>>>(&double.0, &double.1, f64::to_bits);
            }
            dispatch!(level, simd => both(simd, &single, &double));
        }
    }

    #[inline(always)]
    fn smaller_and_larger<L: Lane>(values: &[L::Scalar], bits: impl Fn(L::Scalar) -> u64) {
        for a in values {
            for b in values {
                let (x, y) = (L::splat(*a), L::splat(*b));
                for (lanes, scalar) in [(x.min(y), a.min(*b)), (x.max(y), a.max(*b))] {
                    let mut out = vec![*a; L::LANES];
                    L::put_column(&mut out, 1, 0, &[lanes; 4]);
                    for lane in out {
                        assert_eq!(bits(lane), bits(scalar));
                    }
                }
            }
        }
    }

    #[test]
    fn min_and_max_choose_what_the_scalar_chooses() {
        let double = [
            0.0,
            -0.0,
            1.0,
            -1.0,
            1e-310,
            f64::NAN,
            -f64::NAN,
            f64::INFINITY,
            f64::MIN,
        ];
        let single = double.map(|x| x as f32);
        for (_, level) in levels() {
            #[inline(always)]
            fn both<S: Simd>(_: S, single: &[f32], double: &[f64]) {
                smaller_and_larger::<F32s<S>>(single, |x| x.to_bits().into());
                smaller_and_larger::<F64s<S>>(double, f64::to_bits);
                smaller_and_larger::<Pair<F32s<S>>>(single, |x| x.to_bits().into());
                smaller_and_larger::<Pair<F64s<S>>>(double, f64::to_bits);
            }
            dispatch!(level, simd => both(simd, &single, &double));
        }
    }
}
