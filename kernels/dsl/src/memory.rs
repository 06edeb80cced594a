//! Buffers that are only read, as a kernel sees them.

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
    #[cfg_attr(not(target_arch = "spirv"), track_caller)]
    #[must_use]
    pub fn get(self, i: u32) -> T {
        #[cfg(target_arch = "spirv")]
        // SAFETY: the caller's contract; exports with bounds checks test it again.
        return unsafe { *self.0.index_unchecked(i as usize) };
        #[cfg(not(target_arch = "spirv"))]
        return self.0[i as usize];
    }
}

/// Element `i` of an array, which must be less than `N`. As with [`Buffer::get`], a shader does not test that.
#[inline(always)]
#[cfg_attr(not(target_arch = "spirv"), track_caller)]
#[must_use]
pub fn array_element<T: Copy, const N: usize>(array: &[T; N], i: u32) -> T {
    #[cfg(target_arch = "spirv")]
    // SAFETY: the caller's contract; exports with bounds checks test it again.
    return unsafe { *array.index_unchecked(i as usize) };
    #[cfg(not(target_arch = "spirv"))]
    return array[i as usize];
}

/// Element `i` of a local array, to be written. As with [`array_element`], a shader does not test that it is there.
#[inline(always)]
#[cfg_attr(not(target_arch = "spirv"), track_caller)]
#[must_use]
pub fn array_element_mut<T, const N: usize>(array: &mut [T; N], i: u32) -> &mut T {
    #[cfg(target_arch = "spirv")]
    // SAFETY: the caller's contract; exports with bounds checks test it again.
    return unsafe { array.index_unchecked_mut(i as usize) };
    #[cfg(not(target_arch = "spirv"))]
    return &mut array[i as usize];
}
