//! Buffers, counters and workgroup memory as a kernel sees them.

#[cfg(not(target_arch = "spirv"))]
use core::sync::atomic::{AtomicU32, Ordering};
#[cfg(target_arch = "spirv")]
use spirv_std::arch::IndexUnchecked;

/// A read-only buffer that every invocation may read anywhere.
#[derive(Clone, Copy)]
pub struct Buffer<'a, T>(&'a [T]);

impl<'a, T: Copy> Buffer<'a, T> {
    #[doc(hidden)]
    #[inline(always)]
    pub fn new(elements: &'a [T]) -> Self {
        Self(elements)
    }

    /// Number of elements.
    #[inline(always)]
    #[must_use]
    pub fn len(self) -> u32 {
        self.0.len() as u32
    }

    /// Whether there is none.
    #[inline(always)]
    #[must_use]
    pub fn is_empty(self) -> bool {
        self.len() == 0
    }

    /// Element `i`, which must be less than [`Buffer::len`]. A shader does not test that, unless it
    /// was exported with bounds checks; the native device does, and reports the kernel.
    #[inline(always)]
    #[must_use]
    pub fn get(self, i: u32) -> T {
        #[cfg(target_arch = "spirv")]
        // SAFETY: the caller's contract; exports with bounds checks test it again.
        return unsafe { *self.0.index_unchecked(i as usize) };
        #[cfg(not(target_arch = "spirv"))]
        return self.0[i as usize];
    }
}

/// Counters that any invocation may add to. Only commutative operations, and none that returns the
/// old value: the result does not depend on the order in which invocations run.
#[derive(Clone, Copy)]
pub struct Atomics<'a>(
    #[cfg(target_arch = "spirv")] &'a [u32],
    #[cfg(not(target_arch = "spirv"))] &'a [AtomicU32],
);

#[cfg(target_arch = "spirv")]
#[allow(
    missing_docs,
    invalid_reference_casting,
    reason = "documented on the host's side; the slice comes from a `&mut` of the entry point, and SPIR-V atomics take a pointer"
)]
mod spirv {
    use super::{Atomics, IndexUnchecked};
    use spirv_std::memory::{Scope, Semantics};

    const SCOPE: u32 = Scope::QueueFamily as u32;
    const NONE: u32 = Semantics::NONE.bits();

    macro_rules! operation {
        ($($(#[$doc:meta])* $name:ident = $function:ident;)*) => {
            impl Atomics<'_> {$(
                $(#[$doc])*
                #[inline(always)]
                pub fn $name(self, i: u32, value: u32) {
                    // SAFETY: `i` is in range by contract; the counter is only touched atomically.
                    unsafe {
                        let slot = self.0.index_unchecked(i as usize) as *const u32 as *mut u32;
                        spirv_std::arch::$function::<u32, SCOPE, NONE>(&mut *slot, value);
                    }
                }
            )*}
        };
    }

    operation! {
        add = atomic_i_add;
        min = atomic_u_min;
        max = atomic_u_max;
        or = atomic_or;
        and = atomic_and;
        xor = atomic_xor;
    }

    impl<'a> Atomics<'a> {
        #[doc(hidden)]
        #[inline(always)]
        pub fn new(counters: &'a [u32]) -> Self {
            Self(counters)
        }
        #[inline(always)]
        pub fn len(self) -> u32 {
            self.0.len() as u32
        }
    }
}

#[cfg(not(target_arch = "spirv"))]
mod host {
    use super::{AtomicU32, Atomics, Ordering};

    macro_rules! operation {
        ($($(#[$doc:meta])* $name:ident = $function:ident;)*) => {
            impl Atomics<'_> {$(
                $(#[$doc])*
                ///
                /// `i` must be less than [`Atomics::len`].
                #[inline]
                pub fn $name(self, i: u32, value: u32) {
                    self.0[i as usize].$function(value, Ordering::Relaxed);
                }
            )*}
        };
    }

    operation! {
        /// Adds `value` to counter `i`, modulo 2^32.
        add = fetch_add;
        /// Lowers counter `i` to `value` if it is larger.
        min = fetch_min;
        /// Raises counter `i` to `value` if it is smaller.
        max = fetch_max;
        /// Sets the bits of `value` in counter `i`.
        or = fetch_or;
        /// Clears the bits of counter `i` that `value` lacks.
        and = fetch_and;
        /// Flips the bits of `value` in counter `i`.
        xor = fetch_xor;
    }

    impl<'a> Atomics<'a> {
        #[doc(hidden)]
        #[must_use]
        pub fn new(counters: &'a [AtomicU32]) -> Self {
            Self(counters)
        }
        /// Number of counters.
        #[must_use]
        pub fn len(self) -> u32 {
            self.0.len() as u32
        }
        /// Whether there is none.
        #[must_use]
        pub fn is_empty(self) -> bool {
            self.0.is_empty()
        }
    }
}

/// The workgroup's memory as the phase before left it: one slot for each of its `N` invocations.
///
/// A kernel with phases is a function that is called once for each phase and returns its own
/// slot's next value. It reads all slots and writes only its own, so there is no race to get
/// wrong; the barrier between phases is the macro's.
#[derive(Clone, Copy)]
pub struct Group<'a, T, const N: usize> {
    slots: &'a [T; N],
    me: u32,
}

impl<'a, T: Copy, const N: usize> Group<'a, T, N> {
    #[doc(hidden)]
    #[inline(always)]
    pub fn new(slots: &'a [T; N], me: u32) -> Self {
        Self { slots, me }
    }

    /// The invocation's index in its workgroup, from 0 to `N - 1`.
    #[inline(always)]
    #[must_use]
    pub fn me(self) -> u32 {
        self.me
    }

    /// The invocation's own slot. Not to be read in phase 0.
    #[inline(always)]
    #[must_use]
    pub fn own(self) -> T {
        self.get(self.me)
    }

    /// Slot `i` < `N` of any invocation. Not to be read in phase 0.
    #[inline(always)]
    #[must_use]
    pub fn get(self, i: u32) -> T {
        #[cfg(target_arch = "spirv")]
        // SAFETY: the caller's contract.
        return unsafe { *self.slots.index_unchecked(i as usize) };
        #[cfg(not(target_arch = "spirv"))]
        return self.slots[i as usize];
    }
}
