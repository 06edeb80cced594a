//! Numbers of four registers. The operations of a kernel depend on each other, and a processor waits some cycles for the
//! result of each; those of the other registers fill the time. With two registers, derivatives of bounds take 1.1 to 1.4
//! times the time. With six, more numbers are kept in memory than is gained.
//!
//! A product and a sum are never fused, so that a lane's result is the scalar result bit for bit.

use core::mem::MaybeUninit;
use core::ops::{Add, AddAssign, BitAnd, BitOr, Div, Mul, MulAssign, Neg, Not, Sub, SubAssign};

use bytemuck::{Pod, Zeroable, cast_slice, cast_slice_mut};

use super::Scalar;
#[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
use super::permute;
use super::register::Register;
use super::transpose;
use crate::math::Elementary;
use crate::native::layout::Lane;
use crate::{Mask, Real, unroll};

// No closures over lanes, nor functions as arguments: what is not inlined into the code of an instruction set is compiled
// for the baseline processor.

/// What the comparison of registers gives.
type MaskOf<R> = <R as Register>::Mask;

/// A type for each kind of register, not one that is generic over registers: rustc inlines the operations of registers
/// into those of concrete types, once, where LLVM would do it at each place that uses them.
macro_rules! lanes {
    ($(#[$doc:meta])* $name:ident, $mask_name:ident: four of $register:ty, by $by:ident, $features:literal) => {
        $(#[$doc])*
        #[derive(Clone, Copy)]
        pub struct $name($register, $register, $register, $register);

        /// A truth value for each lane.
        #[derive(Clone, Copy)]
        pub struct $mask_name(MaskOf<$register>, MaskOf<$register>, MaskOf<$register>, MaskOf<$register>);

        const _: () = {
            type R = $register;
            type Number = <R as Register>::Number;
            lanes!(@all $features $by $name, $mask_name, 4: 0 1 2 3);
        };
    };
    // `$registers` is how many registers there are, `$i` are the fields that hold them.
    (@all $features:literal $by:ident $name:ident, $mask_name:ident, $registers:literal: $($i:tt)+) => {
        lanes!(@operator $features $name Add add AddAssign add_assign: $($i)+);
        lanes!(@operator $features $name Sub sub SubAssign sub_assign: $($i)+);
        lanes!(@operator $features $name Mul mul MulAssign mul_assign: $($i)+);

        impl Div for $name {
            type Output = Self;
            #[inline(always)]
            fn div(self, o: Self) -> Self {
                lanes!(@compiled $features (a: $name = self, b: $name = o) -> $name {
                    $name($(R::div(a.$i, b.$i)),+)
                })
            }
        }

        impl Neg for $name {
            type Output = Self;
            #[inline(always)]
            fn neg(self) -> Self {
                lanes!(@compiled $features (a: $name = self) -> $name {
                    $name($(R::neg(a.$i)),+)
                })
            }
        }

        impl BitAnd for $mask_name {
            type Output = Self;
            #[inline(always)]
            fn bitand(self, o: Self) -> Self {
                lanes!(@compiled $features (a: $mask_name = self, b: $mask_name = o) -> $mask_name {
                    $mask_name($(R::both(a.$i, b.$i)),+)
                })
            }
        }

        impl BitOr for $mask_name {
            type Output = Self;
            #[inline(always)]
            fn bitor(self, o: Self) -> Self {
                lanes!(@compiled $features (a: $mask_name = self, b: $mask_name = o) -> $mask_name {
                    $mask_name($(R::either(a.$i, b.$i)),+)
                })
            }
        }

        impl Not for $mask_name {
            type Output = Self;
            #[inline(always)]
            fn not(self) -> Self {
                lanes!(@compiled $features (a: $mask_name = self) -> $mask_name {
                    $mask_name($(R::not(a.$i)),+)
                })
            }
        }

        impl Mask for $mask_name {
            #[inline(always)]
            fn any(self) -> bool {
                lanes!(@compiled $features (a: $mask_name = self) -> bool {
                    false $(| R::any(a.$i))+
                })
            }
            #[inline(always)]
            fn all(self) -> bool {
                lanes!(@compiled $features (a: $mask_name = self) -> bool {
                    true $(& R::all(a.$i))+
                })
            }
        }

        impl $name {
            /// A function of scalars of each lane, for what has no instruction.
            #[inline(always)]
            fn each<const N: usize>(
                self,
                function: impl Fn(Number) -> [Number; N],
            ) -> [Self; N] {
                /// Lanes of the widest register.
                const MOST: usize = 16;
                let mut numbers = [[Number::zeroed(); MOST]; $registers];
                $(R::store(self.$i, &mut numbers[$i], 0);)+
                let mut results = [[[Number::zeroed(); MOST]; $registers]; N];
                for (i, register) in numbers.iter().enumerate() {
                    for (k, number) in register[..R::LANES].iter().enumerate() {
                        let values = function(*number);
                        for (result, value) in results.iter_mut().zip(values) {
                            result[i][k] = value;
                        }
                    }
                }
                let mut all = [self; N];
                for (lanes, result) in all.iter_mut().zip(&results) {
                    *lanes = Self($(R::load(&result[$i], 0)),+);
                }
                all
            }
        }

        impl Real for $name {
            type Mask = $mask_name;
            const IS_WIDE: bool = Number::IS_WIDE;

            #[inline(always)]
            fn literal<const BITS: u64>() -> Self {
                Self($(lanes!(@each $i R::literal::<BITS>())),+)
            }
            #[inline(always)]
            fn epsilon() -> Self {
                Self::splat(Number::epsilon())
            }
            lanes!(@function $features $name sqrt = sqrt(): $($i)+);
            lanes!(@function $features $name abs = abs(): $($i)+);
            lanes!(@function $features $name floor = floor(): $($i)+);
            lanes!(@function $features $name min = min(o): $($i)+);
            lanes!(@function $features $name max = max(o): $($i)+);
            lanes!(@comparison $features $name $mask_name lt: $($i)+);
            lanes!(@comparison $features $name $mask_name le: $($i)+);
            lanes!(@comparison $features $name $mask_name eq: $($i)+);
            #[inline(always)]
            fn select(mask: $mask_name, a: Self, b: Self) -> Self {
                lanes!(@compiled $features (mask: $mask_name = mask, a: $name = a, b: $name = b) -> $name {
                    $name($(R::select(mask.$i, a.$i, b.$i)),+)
                })
            }
            #[inline(always)]
            fn two_sum(self, o: Self) -> (Self, Self) {
                lanes!(@compiled $features (a: $name = self, b: $name = o) -> ($name, $name) {
                    let both = [$(R::two_sum(a.$i, b.$i)),+];
                    ($name($(both[$i].0),+), $name($(both[$i].1),+))
                })
            }
            #[inline(always)]
            fn two_product(self, o: Self) -> (Self, Self) {
                lanes!(@compiled $features (a: $name = self, b: $name = o) -> ($name, $name) {
                    let both = [$(R::two_product(a.$i, b.$i)),+];
                    ($name($(both[$i].0),+), $name($(both[$i].1),+))
                })
            }
            #[inline(always)]
            fn apart<T>(work: impl FnOnce() -> T) -> T {
                #[target_feature(enable = $features)]
                #[inline(never)]
                fn apart<T>(work: impl FnOnce() -> T) -> T {
                    work()
                }
                // SAFETY: only `on_lanes` uses these types, on processors that have the instruction set.
                unsafe { apart(work) }
            }
        }

        // SAFETY: the loop over `at` fills every column.
        unsafe impl Lane for $name {
            type Scalar = Number;
            const LANES: usize = $registers * R::LANES;

            #[inline(always)]
            fn splat(value: Number) -> Self {
                let all = R::splat(value);
                Self($(lanes!(@each $i all)),+)
            }
            #[inline(always)]
            fn columns<T: Pod>(rows: &[T], columns: &mut [MaybeUninit<Self>]) {
                let table = cast_slice(rows);
                let rows = R::LANES * $by::Table::<R, T>::WIDTH;
                unroll!(group in 0..($by::Table::<R, T>::WIDTH.div_ceil($by::Table::<R, T>::STEP)), {
                    let from = const {
                        transpose::first_of(group, $by::Table::<R, T>::STEP, $by::Table::<R, T>::WIDTH)
                    };
                    let some = [$($by::Table::<R, T>::columns(&table[$i * rows..], from)),+];
                    unroll!(k in 0..$by::MOST, {
                        if const { k < $by::Table::<R, T>::STEP } {
                            columns[from + k].write(Self($(some[$i][k]),+));
                        }
                    });
                });
            }
            #[inline(always)]
            fn put_columns<T: Pod>(columns: &[Self], rows: &mut [T]) {
                let table = cast_slice_mut(rows);
                let rows = R::LANES * $by::Table::<R, T>::WIDTH;
                unroll!(group in 0..($by::Table::<R, T>::WIDTH.div_ceil($by::Table::<R, T>::STEP)), {
                    let from = const {
                        transpose::first_of(group, $by::Table::<R, T>::STEP, $by::Table::<R, T>::WIDTH)
                    };
                    let mut some = [$([columns[from].$i; $by::MOST]),+];
                    unroll!(k in 0..$by::MOST, {
                        if const { k < $by::Table::<R, T>::STEP } {
                            $(some[$i][k] = columns[from + k].$i;)+
                        }
                    });
                    $($by::Table::<R, T>::put_columns(&some[$i], &mut table[$i * rows..], from);)+
                });
            }
        }

        impl Elementary for $name {
            #[inline(always)]
            fn largest() -> Self {
                Self::splat(Number::largest())
            }
            #[inline(always)]
            fn guard(self) -> Self {
                self
            }
            #[inline(always)]
            fn upper(self) -> Self {
                if const { Number::IS_WIDE } {
                    // 53 bits are cut into 26, a sign and 26: the upper half must be rounded (Veltkamp).
                    let scaled = self * crate::lit!(134_217_729.0);
                    return scaled - (scaled - self);
                }
                let mask = R::bits::<0xffff_f000>();
                Self($(R::and(self.$i, mask)),+)
            }
            #[inline(always)]
            fn decompose(self) -> (Self, Self) {
                let root = R::splat(Number::ROOT);
                let fraction = R::splat(Number::FRACTION);
                let from_root = Self($(R::sub_bits(self.$i, root)),+);
                (
                    Self($(R::exponent(from_root.$i)),+),
                    Self($(R::add_bits(R::and(from_root.$i, fraction), root)),+),
                )
            }
            lanes!(@function $features $name power_of_two = power(): $($i)+);
            #[inline(always)]
            fn copy_sign(self, sign: Self) -> Self {
                self.abs().flip_sign(sign)
            }
            #[inline(always)]
            fn flip_sign(self, sign: Self) -> Self {
                let mask = R::splat(Number::SIGN);
                Self($(R::xor(self.$i, R::and(sign.$i, mask))),+)
            }
            #[inline(always)]
            fn reciprocal_seed(self) -> Self {
                if const { Number::IS_WIDE } {
                    // From `f32`, as on devices without integers of 64 bits.
                    let [seed] = self.each(|x| [x.reciprocal_seed()]);
                    return seed;
                }
                let start = R::bits::<0x7ef3_11c7>();
                Self($(R::sub_bits(start, self.$i)),+)
            }
            #[inline(always)]
            fn inverse_root_seed(self) -> Self {
                if const { Number::IS_WIDE } {
                    let [seed] = self.each(|x| [x.inverse_root_seed()]);
                    return seed;
                }
                let start = R::bits::<0x5f37_5a86>();
                Self($(R::sub_bits(start, R::half_bits(self.$i))),+)
            }
            #[inline(always)]
            fn reduce_large(self) -> (Self, Self, Self) {
                let [q, high, low] = self.each(|x| {
                    // A lane that is no large number is not asked for.
                    let largest = Number::largest();
                    let is_large = x.gt(crate::lit!(3200.0)) & x.le(largest);
                    let (q, high, low) = Number::select(is_large, x, largest).reduce_large();
                    [q, high, low]
                });
                (q, high, low)
            }
            #[inline(always)]
            fn odd_sum(self, other: Self) -> Self {
                let (sum, error) = self.two_sum(other);
                let zero = crate::lit!(0.0);
                let (low, negative) = (error.lt(zero), sum.lt(zero));
                let away = (low & negative) | (!low & !negative);
                let one = R::splat(Number::LAST_BIT);
                let before = Self($(R::sub_bits(sum.$i, one)),+);
                let odd = Self::select(away, sum, before);
                let odd = Self($(R::or(odd.$i, one)),+);
                Self::select(error.eq(zero), sum, odd)
            }
            #[inline(always)]
            fn not_a_number(self) -> Self {
                let bits = R::splat(Number::NAN);
                Self($(R::or(self.$i, bits)),+)
            }
            #[inline(always)]
            fn unbounded(self) -> Self {
                let bits = R::splat(Number::INFINITY);
                Self($(R::or(self.$i, bits)),+)
            }
        }
    };
    (@each $i:tt $value:expr) => { $value };
    // An operation of a trait, which cannot have an instruction set of its own, in a function that has. There the
    // compiler turns it into a few instructions before it is inlined anywhere. Without it each instruction would be a call
    // with its operands in memory, and to undo that took most of a build.
    (@compiled $features:literal ($($argument:ident: $type:ty = $value:expr),+) -> $result:ty $body:block) => {{
        #[target_feature(enable = $features)]
        #[inline]
        fn compiled($($argument: $type),+) -> $result $body
        // SAFETY: only `on_lanes` uses these types, on processors that have the instruction set.
        unsafe { compiled($($value),+) }
    }};
    (
        @operator $features:literal $name:ident
        $operator:ident $method:ident $assign:ident $assign_method:ident: $($i:tt)+
    ) => {
        impl $operator for $name {
            type Output = Self;
            #[inline(always)]
            fn $method(self, o: Self) -> Self {
                lanes!(@compiled $features (a: $name = self, b: $name = o) -> $name {
                    $name($(R::$method(a.$i, b.$i)),+)
                })
            }
        }
        impl $assign for $name {
            #[inline(always)]
            fn $assign_method(&mut self, o: Self) {
                *self = $operator::$method(*self, o);
            }
        }
    };
    (@function $features:literal $name:ident $method:ident = $function:ident(): $($i:tt)+) => {
        #[inline(always)]
        fn $method(self) -> Self {
            lanes!(@compiled $features (a: $name = self) -> $name {
                $name($(R::$function(a.$i)),+)
            })
        }
    };
    (@function $features:literal $name:ident $method:ident = $function:ident($o:ident): $($i:tt)+) => {
        #[inline(always)]
        fn $method(self, $o: Self) -> Self {
            lanes!(@compiled $features (a: $name = self, b: $name = $o) -> $name {
                $name($(R::$function(a.$i, b.$i)),+)
            })
        }
    };
    (@comparison $features:literal $name:ident $mask_name:ident $method:ident: $($i:tt)+) => {
        #[inline(always)]
        fn $method(self, o: Self) -> $mask_name {
            lanes!(@compiled $features (a: $name = self, b: $name = o) -> $mask_name {
                $mask_name($(R::$method(a.$i, b.$i)),+)
            })
        }
    };
}

#[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
lanes! {
    /// AVX2's `f32`.
    Avx2F32, Avx2F32Mask: four of super::x86::F32x8, by transpose, "avx2,fma"
}
#[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
lanes! {
    /// AVX2's `f64`.
    Avx2F64, Avx2F64Mask: four of super::x86::F64x4, by transpose, "avx2,fma"
}
#[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
lanes! {
    /// AVX-512's `f32`.
    Avx512F32, Avx512F32Mask: four of super::x86::F32x16, by permute, "avx512f,avx512bw,avx512cd,avx512dq,avx512vl"
}
#[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
lanes! {
    /// AVX-512's `f64`.
    Avx512F64, Avx512F64Mask: four of super::x86::F64x8, by transpose, "avx512f,avx512bw,avx512cd,avx512dq,avx512vl"
}
#[cfg(target_arch = "aarch64")]
lanes! {
    /// NEON's `f32`.
    NeonF32, NeonF32Mask: four of super::neon::F32x4, by transpose, "neon"
}
#[cfg(target_arch = "aarch64")]
lanes! {
    /// NEON's `f64`.
    NeonF64, NeonF64Mask: four of super::neon::F64x2, by transpose, "neon"
}
