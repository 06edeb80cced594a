//! What the invocations of a workgroup share: memory, and barriers at which they wait for one
//! another.

#[cfg(not(target_arch = "spirv"))]
use core::cell::Cell;
#[cfg(not(target_arch = "spirv"))]
use core::marker::PhantomData;

use crate::{AtomicInteger, Stored};

/// Memory of the workgroup: an array of `N` that each of its invocations may read and write.
///
/// What one invocation writes, another may read after a [`barrier`]. Nothing is in it at the start.
///
/// `i` must be less than `N`; a shader does not test that, the native device does.
#[derive(Clone, Copy)]
pub struct Shared<'a, T, const N: usize>(
    #[cfg(target_arch = "spirv")] &'a [T; N],
    #[cfg(not(target_arch = "spirv"))] &'a [Cell<T>],
);

/// Integers (`u32` or `i32`) of the workgroup on which only atomic operations work, as on
/// [`Atomics`](crate::Atomics). The invocations write them before they count with them: nothing is
/// in them at the start.
#[derive(Clone, Copy)]
pub struct SharedAtomics<'a, T, const N: usize>(
    #[cfg(target_arch = "spirv")] &'a [T; N],
    #[cfg(not(target_arch = "spirv"))] &'a [Cell<u32>],
    #[cfg(not(target_arch = "spirv"))] PhantomData<fn() -> T>,
);

#[cfg(target_arch = "spirv")]
#[allow(
    missing_docs,
    invalid_reference_casting,
    reason = "documented on the host's side; the array comes from a `&mut` of the entry point"
)]
mod spirv {
    use super::{AtomicInteger, Shared, SharedAtomics, Stored};
    use spirv_std::arch;
    use spirv_std::arch::IndexUnchecked;
    use spirv_std::memory::{Scope, Semantics};

    const SCOPE: u32 = Scope::Workgroup as u32;
    const NONE: u32 = Semantics::NONE.bits();
    const STORAGE: u32 = Semantics::UNIFORM_MEMORY.bits() | Semantics::ACQUIRE_RELEASE.bits();

    #[inline(always)]
    pub fn barrier() {
        arch::workgroup_memory_barrier_with_group_sync();
    }

    #[inline(always)]
    pub fn storage_barrier() {
        arch::control_barrier::<SCOPE, SCOPE, STORAGE>();
    }

    impl<'a, T: Stored, const N: usize> Shared<'a, T, N> {
        #[doc(hidden)]
        #[inline(always)]
        pub fn new(slots: &'a [T; N]) -> Self {
            Self(slots)
        }
        #[inline(always)]
        pub fn get(self, i: u32) -> T {
            // SAFETY: the caller's contract.
            unsafe { *self.0.index_unchecked(i as usize) }
        }
        #[inline(always)]
        pub fn set(self, i: u32, value: T) {
            // SAFETY: the same.
            unsafe {
                let slot = self.0.index_unchecked(i as usize) as *const T as *mut T;
                *slot = value;
            }
        }
    }

    impl<'a, T: AtomicInteger, const N: usize> SharedAtomics<'a, T, N> {
        #[doc(hidden)]
        #[inline(always)]
        pub fn new(slots: &'a [T; N]) -> Self {
            Self(slots)
        }
        crate::atomics::operations!();
    }
}

#[cfg(not(target_arch = "spirv"))]
mod host {
    use core::cell::Cell;
    use core::marker::PhantomData;
    use core::panic::Location;

    use super::{AtomicInteger, Shared, SharedAtomics, Stored};
    use crate::native::sanitize::{self, Access, Space};
    use crate::storage::out_of_range;

    /// Waits until all invocations of the workgroup are here; what they wrote to [`Shared`] memory
    /// before can then be read by all.
    ///
    /// It stands wherever control flow is uniform: in a loop or a branch only if all invocations of
    /// the workgroup take it alike. The native device checks that.
    ///
    /// # Panics
    /// Natively it works only in a kernel, and in what a kernel names in `cooperative(…)`.
    pub fn barrier() {
        alone("barrier")
    }

    /// As [`barrier`], for what was written to [`StorageMut`](crate::StorageMut) buffers: it can
    /// then be read by all invocations of the same workgroup.
    ///
    /// # Panics
    /// As for [`barrier`].
    pub fn storage_barrier() {
        alone("storage_barrier")
    }

    /// Ends a call that is not the twin's.
    #[cold]
    pub(crate) fn alone(name: &str) -> ! {
        panic!(
            "{name}() was called outside of a workgroup: mark the function that calls it with #[cooperative], and name it in the kernel's `cooperative(…)`"
        )
    }

    impl<'a, T: Stored, const N: usize> Shared<'a, T, N> {
        #[doc(hidden)]
        #[must_use]
        pub fn new(slots: &'a [Cell<T>; N]) -> Self {
            Self(slots)
        }

        #[inline(always)]
        #[track_caller]
        fn slot(self, i: u32, access: Access) -> &'a Cell<T> {
            match self.0.get(i as usize) {
                Some(slot) => {
                    let words = core::slice::from_ref(slot);
                    sanitize::look(Space::Workgroup, access, words, Location::caller());
                    slot
                }
                None => out_of_range(i, N),
            }
        }

        /// Element `i`.
        #[inline(always)]
        #[track_caller]
        #[must_use]
        pub fn get(self, i: u32) -> T {
            self.slot(i, Access::Read).get()
        }

        /// Overwrites element `i`.
        #[inline(always)]
        #[track_caller]
        pub fn set(self, i: u32, value: T) {
            self.slot(i, Access::Write).set(value);
        }
    }

    macro_rules! operation {
        ($($(#[$doc:meta])* $name:ident = |$old:ident, $value:ident| $new:expr;)*) => {$(
            $(#[$doc])*
            #[inline]
            #[track_caller]
            pub fn $name(self, i: u32, value: T) -> T {
                self.update(i, Access::Atomic, |$old| {
                    let $value = value.to_bits();
                    $new
                })
            }
        )*};
    }

    impl<'a, T: AtomicInteger, const N: usize> SharedAtomics<'a, T, N> {
        #[doc(hidden)]
        #[must_use]
        pub fn new(slots: &'a [Cell<u32>; N]) -> Self {
            Self(slots, PhantomData)
        }

        #[inline]
        #[track_caller]
        fn update(self, i: u32, access: Access, new: impl Fn(u32) -> u32) -> T {
            let Some(slot) = self.0.get(i as usize) else {
                out_of_range(i, N)
            };
            let words = core::slice::from_ref(slot);
            sanitize::look(Space::Workgroup, access, words, Location::caller());
            let old = slot.get();
            slot.set(new(old));
            T::from_bits(old)
        }

        operation! {
            /// Adds `value` to integer `i`, modulo 2^32. Returns what was there.
            add = |old, value| old.wrapping_add(value);
            /// Subtracts `value` from integer `i`, modulo 2^32. Returns what was there.
            sub = |old, value| old.wrapping_sub(value);
            /// Lowers integer `i` to `value` if it is larger. Returns what was there.
            min = |old, value| T::from_bits(old).least(T::from_bits(value)).to_bits();
            /// Raises integer `i` to `value` if it is smaller. Returns what was there.
            max = |old, value| T::from_bits(old).most(T::from_bits(value)).to_bits();
            /// Clears the bits of integer `i` that `value` lacks. Returns what was there.
            and = |old, value| old & value;
            /// Sets the bits of `value` in integer `i`. Returns what was there.
            or = |old, value| old | value;
            /// Flips the bits of `value` in integer `i`. Returns what was there.
            xor = |old, value| old ^ value;
            /// Puts `value` in the place of integer `i`. Returns what was there.
            exchange = |_old, value| value;
        }

        /// Puts `value` in the place of integer `i` if that is `expected`. Returns what was there.
        #[inline]
        #[track_caller]
        pub fn compare_exchange(self, i: u32, expected: T, value: T) -> T {
            self.update(i, Access::Atomic, |old| {
                if old == expected.to_bits() {
                    value.to_bits()
                } else {
                    old
                }
            })
        }
        /// Integer `i` as it is now.
        #[inline]
        #[track_caller]
        #[must_use]
        pub fn load(self, i: u32) -> T {
            self.update(i, Access::Atomic, |old| old)
        }
        /// Overwrites integer `i`.
        #[inline]
        #[track_caller]
        pub fn store(self, i: u32, value: T) {
            self.update(i, Access::AtomicStore, |_| value.to_bits());
        }
    }
}

#[cfg(not(target_arch = "spirv"))]
pub(crate) use host::alone;
#[cfg(not(target_arch = "spirv"))]
pub use host::{barrier, storage_barrier};
#[cfg(target_arch = "spirv")]
pub use spirv::{barrier, storage_barrier};
