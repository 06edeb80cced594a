//! Integers that any invocation may change at any time.

#[cfg(not(target_arch = "spirv"))]
use core::marker::PhantomData;
#[cfg(not(target_arch = "spirv"))]
use core::sync::atomic::AtomicU32;

/// A buffer of integers (`u32`, or `i32`) on which only atomic operations work. Each operation
/// returns the value that was there before.
///
/// The order of invocations is undefined. A sum, a minimum or a set of bits does
/// not depend on it; the values returned on the way do, and so does `exchange`. Where they decide
/// *where* something is written, say so of that buffer: `#[storage(unordered)]`.
///
/// `i` must be less than [`Atomics::len`]. A shader does not test that, unless it was exported with
/// bounds checks; the native device does, and reports the kernel.
#[derive(Clone, Copy)]
pub struct Atomics<'a, T = u32>(
    #[cfg(target_arch = "spirv")] &'a [T],
    #[cfg(not(target_arch = "spirv"))] &'a [AtomicU32],
    #[cfg(not(target_arch = "spirv"))] PhantomData<fn() -> T>,
);

#[cfg(target_arch = "spirv")]
#[allow(
    missing_docs,
    clippy::missing_safety_doc,
    invalid_reference_casting,
    reason = "documented on the host's side; the slice comes from a `&mut` of the entry point, and SPIR-V atomics take a pointer"
)]
mod spirv {
    use super::Atomics;
    use spirv_std::arch;
    use spirv_std::arch::IndexUnchecked;
    use spirv_std::memory::{Scope, Semantics};

    const SCOPE: u32 = Scope::QueueFamily as u32;
    const NONE: u32 = Semantics::NONE.bits();

    /// An integer with atomic operations.
    pub trait AtomicInteger: spirv_std::Integer {
        unsafe fn fetch_min(slot: &mut Self, value: Self) -> Self;
        unsafe fn fetch_max(slot: &mut Self, value: Self) -> Self;
    }

    impl AtomicInteger for u32 {
        #[inline(always)]
        unsafe fn fetch_min(slot: &mut Self, value: Self) -> Self {
            // SAFETY: the caller's.
            unsafe { arch::atomic_u_min::<u32, SCOPE, NONE>(slot, value) }
        }
        #[inline(always)]
        unsafe fn fetch_max(slot: &mut Self, value: Self) -> Self {
            // SAFETY: the caller's.
            unsafe { arch::atomic_u_max::<u32, SCOPE, NONE>(slot, value) }
        }
    }

    impl AtomicInteger for i32 {
        #[inline(always)]
        unsafe fn fetch_min(slot: &mut Self, value: Self) -> Self {
            // SAFETY: the caller's.
            unsafe { arch::atomic_s_min::<i32, SCOPE, NONE>(slot, value) }
        }
        #[inline(always)]
        unsafe fn fetch_max(slot: &mut Self, value: Self) -> Self {
            // SAFETY: the caller's.
            unsafe { arch::atomic_s_max::<i32, SCOPE, NONE>(slot, value) }
        }
    }

    /// The operations on integers of `self.0`, with the caller's `SCOPE` and `NONE`.
    macro_rules! operations {
        () => {
            #[inline(always)]
            #[allow(clippy::mut_from_ref, reason = "an atomic operation takes a pointer")]
            unsafe fn slot(self, i: u32) -> &'a mut T {
                // SAFETY: the caller's.
                unsafe { &mut *(self.0.index_unchecked(i as usize) as *const T as *mut T) }
            }

            $crate::atomics::operations! {
                add = arch::atomic_i_add::<T, SCOPE, NONE>;
                sub = arch::atomic_i_sub::<T, SCOPE, NONE>;
                min = T::fetch_min;
                max = T::fetch_max;
                and = arch::atomic_and::<T, SCOPE, NONE>;
                or = arch::atomic_or::<T, SCOPE, NONE>;
                xor = arch::atomic_xor::<T, SCOPE, NONE>;
                exchange = arch::atomic_exchange::<T, SCOPE, NONE>;
            }

            #[inline(always)]
            pub fn compare_exchange(self, i: u32, expected: T, value: T) -> T {
                // SAFETY: as for the others.
                unsafe {
                    arch::atomic_compare_exchange::<T, SCOPE, NONE, NONE>(
                        self.slot(i),
                        value,
                        expected,
                    )
                }
            }
            #[inline(always)]
            pub fn load(self, i: u32) -> T {
                // SAFETY: as for the others.
                unsafe { arch::atomic_load::<T, SCOPE, NONE>(self.slot(i)) }
            }
            #[inline(always)]
            pub fn store(self, i: u32, value: T) {
                // SAFETY: as for the others.
                unsafe { arch::atomic_store::<T, SCOPE, NONE>(self.slot(i), value) }
            }
        };
        ($($name:ident = $function:path;)*) => {$(
            #[inline(always)]
            pub fn $name(self, i: u32, value: T) -> T {
                // SAFETY: `i` is in range by contract; the integer is only touched atomically.
                unsafe { $function(self.slot(i), value) }
            }
        )*};
    }
    pub(crate) use operations;

    impl<'a, T: AtomicInteger> Atomics<'a, T> {
        #[doc(hidden)]
        #[inline(always)]
        pub fn new(integers: &'a [T]) -> Self {
            Self(integers)
        }
        #[inline(always)]
        pub fn len(self) -> u32 {
            self.0.len() as u32
        }
        #[inline(always)]
        pub fn is_empty(self) -> bool {
            self.len() == 0
        }
        operations!();
    }
}

#[cfg(not(target_arch = "spirv"))]
mod host {
    use core::marker::PhantomData;
    use core::panic::Location;
    use core::sync::atomic::{AtomicU32, Ordering::Relaxed};

    use super::Atomics;
    use crate::native::sanitize::{self, Access, Space};

    /// An integer with atomic operations: `u32` and `i32`.
    #[diagnostic::on_unimplemented(
        message = "`{Self}` has no atomic operations",
        note = "every shader language has them for `u32` and `i32`, and for nothing else"
    )]
    pub trait AtomicInteger: Copy + sealed::Sealed {
        /// From its bits.
        #[doc(hidden)]
        fn from_bits(bits: u32) -> Self;
        /// Its bits.
        #[doc(hidden)]
        fn to_bits(self) -> u32;
        /// The smaller one.
        #[doc(hidden)]
        fn least(self, other: Self) -> Self;
        /// The larger one.
        #[doc(hidden)]
        fn most(self, other: Self) -> Self;
    }

    mod sealed {
        pub trait Sealed {}
        impl Sealed for u32 {}
        impl Sealed for i32 {}
    }

    macro_rules! integer {
        ($($ty:ty),*) => {$(
            impl AtomicInteger for $ty {
                #[inline]
                fn from_bits(bits: u32) -> Self {
                    bits as Self
                }
                #[inline]
                fn to_bits(self) -> u32 {
                    self as u32
                }
                #[inline]
                fn least(self, other: Self) -> Self {
                    Ord::min(self, other)
                }
                #[inline]
                fn most(self, other: Self) -> Self {
                    Ord::max(self, other)
                }
            }
        )*};
    }

    integer!(u32, i32);

    macro_rules! operation {
        ($($(#[$doc:meta])* $name:ident = $function:ident;)*) => {$(
            $(#[$doc])*
            #[inline]
            #[track_caller]
            pub fn $name(self, i: u32, value: T) -> T {
                T::from_bits(self.slot(i).$function(value.to_bits(), Relaxed))
            }
        )*};
    }

    impl<'a, T: AtomicInteger> Atomics<'a, T> {
        #[doc(hidden)]
        #[must_use]
        pub fn new(words: &'a [AtomicU32]) -> Self {
            Self(words, PhantomData)
        }
        /// Number of integers.
        #[must_use]
        pub fn len(self) -> u32 {
            self.0.len() as u32
        }
        /// Whether there is none.
        #[must_use]
        pub fn is_empty(self) -> bool {
            self.0.is_empty()
        }

        #[inline]
        #[track_caller]
        fn slot(self, i: u32) -> &'a AtomicU32 {
            match self.0.get(i as usize) {
                Some(slot) => {
                    let words = core::slice::from_ref(slot);
                    sanitize::look(Space::Storage, Access::Atomic, words, Location::caller());
                    slot
                }
                None => crate::storage::out_of_range(i, self.0.len()),
            }
        }

        #[inline]
        #[track_caller]
        fn update(self, i: u32, new: impl Fn(T) -> T) -> T {
            let slot = self.slot(i);
            let mut old = slot.load(Relaxed);
            loop {
                let value = new(T::from_bits(old)).to_bits();
                match slot.compare_exchange_weak(old, value, Relaxed, Relaxed) {
                    Ok(old) => return T::from_bits(old),
                    Err(now) => old = now,
                }
            }
        }

        operation! {
            /// Adds `value` to integer `i`, modulo 2^32. Returns what was there.
            add = fetch_add;
            /// Subtracts `value` from integer `i`, modulo 2^32. Returns what was there.
            sub = fetch_sub;
            /// Clears the bits of integer `i` that `value` lacks. Returns what was there.
            and = fetch_and;
            /// Sets the bits of `value` in integer `i`. Returns what was there.
            or = fetch_or;
            /// Flips the bits of `value` in integer `i`. Returns what was there.
            xor = fetch_xor;
            /// Puts `value` in the place of integer `i`. Returns what was there.
            exchange = swap;
        }

        /// Lowers integer `i` to `value` if it is larger. Returns what was there.
        #[inline]
        #[track_caller]
        pub fn min(self, i: u32, value: T) -> T {
            self.update(i, |old| old.least(value))
        }
        /// Raises integer `i` to `value` if it is smaller. Returns what was there.
        #[inline]
        #[track_caller]
        pub fn max(self, i: u32, value: T) -> T {
            self.update(i, |old| old.most(value))
        }
        /// Puts `value` in the place of integer `i` if that is `expected`. Returns what was there:
        /// `expected`, if the exchange took place.
        #[inline]
        #[track_caller]
        pub fn compare_exchange(self, i: u32, expected: T, value: T) -> T {
            let (expected, value) = (expected.to_bits(), value.to_bits());
            let result = self
                .slot(i)
                .compare_exchange(expected, value, Relaxed, Relaxed);
            T::from_bits(result.unwrap_or_else(|old| old))
        }
        /// Integer `i` as it is now.
        #[inline]
        #[track_caller]
        #[must_use]
        pub fn load(self, i: u32) -> T {
            T::from_bits(self.slot(i).load(Relaxed))
        }
        /// Overwrites integer `i`.
        #[inline]
        #[track_caller]
        pub fn store(self, i: u32, value: T) {
            self.slot(i).store(value.to_bits(), Relaxed);
        }
    }
}

#[cfg(not(target_arch = "spirv"))]
pub use host::AtomicInteger;
#[cfg(target_arch = "spirv")]
pub use spirv::AtomicInteger;
#[cfg(target_arch = "spirv")]
pub(crate) use spirv::operations;
