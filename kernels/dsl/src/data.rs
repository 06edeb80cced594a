//! Types for memory that Rust's own have no place in: truth values, and vectors of three without
//! padding.

use glam::Vec3;

use crate::Element;

/// A truth value in a buffer or a uniform: a `u32` that is 0 or 1, as graphics interfaces have it. Any
/// number other than 0 reads as true.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(transparent)]
pub struct Bool(pub(crate) u32);

impl Bool {
    /// False.
    pub const FALSE: Self = Self(0);
    /// True.
    pub const TRUE: Self = Self(1);

    /// From Rust's own.
    #[inline(always)]
    #[must_use]
    pub const fn new(value: bool) -> Self {
        Self(value as u32)
    }

    /// As Rust's own.
    #[inline(always)]
    #[must_use]
    pub const fn get(self) -> bool {
        self.0 != 0
    }
}

impl From<bool> for Bool {
    #[inline(always)]
    fn from(value: bool) -> Self {
        Self::new(value)
    }
}

impl From<Bool> for bool {
    #[inline(always)]
    fn from(value: Bool) -> Self {
        value.get()
    }
}

/// Three floats in a buffer with nothing after them: 12 bytes, in every language. (As the element of a
/// buffer, a `Vec3` has 12 bytes in Rust and 16 in shaders, and is refused.)
#[derive(Clone, Copy, Debug, Default, PartialEq, Element)]
#[repr(C)]
pub struct PackedVec3 {
    /// The first component.
    pub x: f32,
    /// The second component.
    pub y: f32,
    /// The third component.
    pub z: f32,
}

impl From<Vec3> for PackedVec3 {
    #[inline(always)]
    fn from(v: Vec3) -> Self {
        Self {
            x: v.x,
            y: v.y,
            z: v.z,
        }
    }
}

impl From<PackedVec3> for Vec3 {
    #[inline(always)]
    fn from(v: PackedVec3) -> Self {
        Self::new(v.x, v.y, v.z)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::native::layout::Element as _;

    #[test]
    fn truth_is_one_and_anything_but_zero() {
        assert_eq!(bytemuck::cast::<Bool, u32>(true.into()), 1);
        assert!(bytemuck::cast::<u32, Bool>(7).get());
        assert!(!bool::from(Bool::FALSE));
    }

    #[test]
    fn packed_vectors_have_no_padding() {
        assert_eq!((PackedVec3::layout().size, PackedVec3::ALIGN), (12, 4));
        let v = Vec3::new(1.0, 2.0, 3.0);
        assert_eq!(Vec3::from(PackedVec3::from(v)), v);
    }
}
