//! SIMD lanes as a [`Real`]: `fearless_simd`'s native-width vectors, whichever instruction set the
//! processor turns out to have. The lanes never fuse a product and a sum, so that a lane's result
//! is the scalar result bit for bit.

use core::ops::{Add, AddAssign, BitAnd, BitOr, Div, Mul, MulAssign, Neg, Not, Sub, SubAssign};

use std::sync::OnceLock;
use std::vec::Vec;

use fearless_simd::prelude::*;
use fearless_simd::{Level, Simd};

use super::layout::Lane;
use crate::{Mask, Real};

/// The instruction sets that this processor has and lanes can use, widest first, each by its name.
#[must_use]
pub fn levels() -> Vec<(&'static str, Level)> {
    let best = Level::new();
    let mut all = Vec::new();
    #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
    all.extend(
        [
            ("avx512", best.as_avx512().map(|s| s.level())),
            ("avx2", best.as_avx2().map(|s| s.level())),
            ("sse4.2", best.as_sse4_2().map(|s| s.level())),
        ]
        .into_iter()
        .filter_map(|(name, level)| Some((name, level?))),
    );
    #[cfg(target_arch = "aarch64")]
    all.extend(best.as_neon().map(|s| ("neon", s.level())));
    all.push(("baseline", Level::baseline()));
    all
}

/// The instruction set in use: the best one, or the one that the environment variable
/// `HANKEL_SIMD` names, if the processor has it.
#[must_use]
pub fn level() -> Level {
    static LEVEL: OnceLock<Level> = OnceLock::new();
    *LEVEL.get_or_init(|| {
        let wanted = std::env::var("HANKEL_SIMD").ok();
        let levels = levels();
        let named = levels
            .iter()
            .find(|(name, _)| wanted.as_deref() == Some(name));
        named.map_or_else(Level::new, |(_, level)| *level)
    })
}

/// Its name, for reports.
#[must_use]
pub fn level_name() -> &'static str {
    let name = |level: &Level| std::mem::discriminant(level);
    levels()
        .iter()
        .find(|(_, l)| name(l) == name(&level()))
        .map_or("baseline", |(n, _)| n)
}

/// The token of instruction set `S`, out of nothing.
///
/// Lane types cannot be named outside of this crate, and the executor creates them only inside
/// [`fearless_simd::dispatch`], where the token exists.
#[inline(always)]
fn token<S: Simd>() -> S {
    const { assert!(size_of::<S>() == 0) }
    // SAFETY: `S` has no bytes, so any pointer that is not null and aligned reads a valid value;
    // and code that gets here runs under `dispatch` with a token of this very type.
    unsafe { core::ptr::NonNull::<S>::dangling().read() }
}

macro_rules! lanes {
    ($name:ident, $vector:ident, $mask_name:ident, $mask:ident, $float:ident) => {
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
                Self::select(self.lt(o), self, o)
            }
            #[inline(always)]
            fn max(self, o: Self) -> Self {
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
        }

        impl<S: Simd> Lane for $name<S> {
            type Scalar = $float;
            const LANES: usize = S::$vector::LEN;
            #[inline(always)]
            fn from_fn(f: impl FnMut(usize) -> $float) -> Self {
                Self(S::$vector::from_fn(token::<S>(), f))
            }
            #[inline(always)]
            fn splat(value: $float) -> Self {
                Self(S::$vector::simd_from(token::<S>(), value))
            }
            #[inline(always)]
            fn get(&self, i: usize) -> $float {
                self.0.as_slice()[i]
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

lanes!(F32s, f32s, F32Mask, mask32s, f32);
lanes!(F64s, f64s, F64Mask, mask64s, f64);

/// A scalar that has lanes.
pub trait Scalar: Real {
    /// Lanes of it.
    type Lanes<S: Simd>: Lane<Scalar = Self>;
}

impl Scalar for f32 {
    type Lanes<S: Simd> = F32s<S>;
}

impl Scalar for f64 {
    type Lanes<S: Simd> = F64s<S>;
}
