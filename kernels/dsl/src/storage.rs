//! Buffers that any invocation may read and write anywhere.

#[cfg(not(target_arch = "spirv"))]
use core::marker::PhantomData;
#[cfg(not(target_arch = "spirv"))]
use core::panic::Location;
#[cfg(not(target_arch = "spirv"))]
use core::sync::atomic::{AtomicU32, Ordering::Relaxed};

#[cfg(not(target_arch = "spirv"))]
use crate::native::sanitize::{self, Access, Space};

/// What memory that is written can hold: any [`Element`](macro@crate::Element), number or vector.
#[cfg(target_arch = "spirv")]
pub trait Stored: Copy {}
#[cfg(target_arch = "spirv")]
impl<T: Copy> Stored for T {}

/// What memory that is written can hold: any [`Element`](macro@crate::Element), number or vector.
#[cfg(not(target_arch = "spirv"))]
pub trait Stored: bytemuck::Pod {}
#[cfg(not(target_arch = "spirv"))]
impl<T: bytemuck::Pod> Stored for T {}

/// A buffer that every invocation may read and write anywhere.
///
/// What one invocation writes, no other invocation of the same dispatch may read or write, unless
/// a barrier lies between the two: which comes first is undefined. Integers that several
/// invocations change belong in [`Atomics`](crate::Atomics).
///
/// `i` must be less than [`StorageMut::len`]. A shader does not test that, unless it was exported
/// with bounds checks; the native device does, and reports the kernel.
#[derive(Clone, Copy)]
pub struct StorageMut<'a, T>(
    #[cfg(target_arch = "spirv")] &'a [T],
    #[cfg(not(target_arch = "spirv"))] &'a [AtomicU32],
    #[cfg(not(target_arch = "spirv"))] PhantomData<fn() -> T>,
);

#[cfg(target_arch = "spirv")]
#[allow(
    missing_docs,
    invalid_reference_casting,
    reason = "documented on the host's side; the slice comes from a `&mut` of the entry point"
)]
mod spirv {
    use super::{StorageMut, Stored};
    use spirv_std::arch::IndexUnchecked;

    impl<'a, T: Stored> StorageMut<'a, T> {
        #[doc(hidden)]
        #[inline(always)]
        pub fn new(elements: &'a [T]) -> Self {
            Self(elements)
        }
        #[inline(always)]
        pub fn len(self) -> u32 {
            self.0.len() as u32
        }
        #[inline(always)]
        pub fn is_empty(self) -> bool {
            self.len() == 0
        }
        #[inline(always)]
        pub fn get(self, i: u32) -> T {
            // SAFETY: the caller's contract; exports with bounds checks test it again.
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
}

// Words are stored one by one, relaxed: the same instructions as plain memory, but a kernel whose
// invocations race gets some value and not undefined behaviour.
#[cfg(not(target_arch = "spirv"))]
impl<'a, T: Stored> StorageMut<'a, T> {
    const WORDS: usize = {
        assert!(
            size_of::<T>() > 0 && size_of::<T>().is_multiple_of(4) && align_of::<T>() >= 4,
            "memory is made of 32-bit words: use u32, i32, f32, f64, their vectors, or a structure of them"
        );
        size_of::<T>() / 4
    };

    #[doc(hidden)]
    #[must_use]
    pub fn new(words: &'a [AtomicU32]) -> Self {
        Self(words, PhantomData)
    }

    /// Number of elements.
    #[inline]
    #[must_use]
    pub fn len(self) -> u32 {
        (self.0.len() / Self::WORDS) as u32
    }

    /// Whether there is none.
    #[inline]
    #[must_use]
    pub fn is_empty(self) -> bool {
        self.0.is_empty()
    }

    #[inline(always)]
    #[track_caller]
    fn slots(self, i: u32, access: Access) -> &'a [AtomicU32] {
        let start = i as usize * Self::WORDS;
        match self.0.get(start..start + Self::WORDS) {
            Some(slots) => {
                sanitize::look(Space::Storage, access, slots, Location::caller());
                slots
            }
            None => out_of_range(i, self.0.len() / Self::WORDS),
        }
    }

    /// Element `i`.
    #[inline(always)]
    #[track_caller]
    #[must_use]
    pub fn get(self, i: u32) -> T {
        let mut value = T::zeroed();
        let words: &mut [u32] = bytemuck::cast_slice_mut(bytemuck::bytes_of_mut(&mut value));
        for (word, slot) in words.iter_mut().zip(self.slots(i, Access::Read)) {
            *word = slot.load(Relaxed);
        }
        value
    }

    /// Overwrites element `i`.
    #[inline(always)]
    #[track_caller]
    pub fn set(self, i: u32, value: T) {
        let words: &[u32] = bytemuck::cast_slice(bytemuck::bytes_of(&value));
        for (word, slot) in words.iter().zip(self.slots(i, Access::Write)) {
            slot.store(*word, Relaxed);
        }
    }
}

/// The kernel is wrong: the call ends with these words.
#[cfg(not(target_arch = "spirv"))]
#[cold]
#[inline(never)]
#[track_caller]
pub(crate) fn out_of_range(i: u32, len: usize) -> ! {
    panic!("index {i} is out of range: the memory has {len} elements")
}
