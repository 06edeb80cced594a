//! Textures of which any texel may be written.

use core::marker::PhantomData;

use glam::{UVec2, UVec3, UVec4, Vec4};

use crate::Texel;
#[cfg(not(target_arch = "spirv"))]
use crate::native::{describe::TexelFormat, exec::Texels};
#[cfg(target_arch = "spirv")]
use crate::texture::image;

/// Formats of storage textures, as types.
pub mod format {
    use super::{Format, UVec4, Vec4};

    macro_rules! formats {
        ($($(#[doc = $doc:literal])* $name:ident, $texel:ty, $flat:ident, $volume:ident;)*) => { $(
            $(#[doc = $doc])*
            #[derive(Clone, Copy, Debug)]
            pub enum $name {}

            impl Format for $name {
                type Value = $texel;
                #[cfg(target_arch = "spirv")]
                type Flat = super::image::$flat;
                #[cfg(target_arch = "spirv")]
                type Volume = super::image::$volume;
                #[cfg(target_arch = "spirv")]
                #[inline(always)]
                fn flat_size(image: &Self::Flat) -> glam::UVec2 {
                    image.query_size()
                }
                #[cfg(target_arch = "spirv")]
                #[inline(always)]
                fn volume_size(image: &Self::Volume) -> glam::UVec3 {
                    image.query_size()
                }
                #[cfg(not(target_arch = "spirv"))]
                const FORMAT: super::TexelFormat = super::TexelFormat::$name;
            }
        )* };
    }

    formats! {
        /// One 32-bit float.
        R32Float, f32, Storage2dR32Float, Storage3dR32Float;
        /// Four 32-bit floats.
        Rgba32Float, Vec4, Storage2dRgba32Float, Storage3dRgba32Float;
        /// Four 16-bit floats.
        Rgba16Float, Vec4, Storage2dRgba16Float, Storage3dRgba16Float;
        /// Four 16-bit numbers from 0 to 1.
        Rgba16Unorm, Vec4, Storage2dRgba16Unorm, Storage3dRgba16Unorm;
        /// Four 8-bit numbers from 0 to 1.
        Rgba8Unorm, Vec4, Storage2dRgba8Unorm, Storage3dRgba8Unorm;
        /// One 32-bit unsigned integer.
        R32Uint, u32, Storage2dR32Uint, Storage3dR32Uint;
        /// Four 32-bit unsigned integers.
        Rgba32Uint, UVec4, Storage2dRgba32Uint, Storage3dRgba32Uint;
    }
}

/// A format of a storage texture: one of those in [`format`](mod@format).
pub trait Format: Copy {
    /// What a texel is made of.
    type Value: Texel;
    #[cfg(target_arch = "spirv")]
    #[doc(hidden)]
    type Flat;
    #[cfg(target_arch = "spirv")]
    #[doc(hidden)]
    type Volume;
    #[cfg(target_arch = "spirv")]
    #[doc(hidden)]
    fn flat_size(image: &Self::Flat) -> UVec2;
    #[cfg(target_arch = "spirv")]
    #[doc(hidden)]
    fn volume_size(image: &Self::Volume) -> UVec3;
    /// Its description.
    #[cfg(not(target_arch = "spirv"))]
    const FORMAT: TexelFormat;
}

macro_rules! textures {
    ($($(#[doc = $doc:literal])* $name:ident, $image:ident, $size:ident, $at:ty, $whole:expr, $sized:expr;)*) => { $(
        $(#[doc = $doc])*
        #[derive(Clone, Copy)]
        pub struct $name<'a, F: Format>(
            #[cfg(target_arch = "spirv")] &'a F::$image,
            #[cfg(not(target_arch = "spirv"))] Texels<'a>,
            PhantomData<F>,
        );

        #[cfg(target_arch = "spirv")]
        #[allow(missing_docs, reason = "documented on the host's side")]
        impl<'a, F: Format> $name<'a, F> {
            #[doc(hidden)]
            #[inline(always)]
            pub fn new(image: &'a F::$image) -> Self {
                Self(image, PhantomData)
            }
            #[inline(always)]
            pub fn size(self) -> $at {
                F::$size(self.0)
            }
            #[inline(always)]
            pub fn store(self, at: $at, value: F::Value) {
                // SAFETY: the caller's contract; exports with bounds checks test it again.
                unsafe { image::write(self.0, at, Texel::channels(value)) }
            }
        }

        #[cfg(not(target_arch = "spirv"))]
        impl<'a, F: Format> $name<'a, F> {
            #[doc(hidden)]
            #[must_use]
            pub fn new(texels: Texels<'a>) -> Self {
                Self(texels, PhantomData)
            }
            /// Texels along each axis.
            #[inline]
            #[must_use]
            pub fn size(self) -> $at {
                let sized: fn(UVec3) -> $at = $sized;
                sized(UVec3::from_array(self.0.size()))
            }
            /// Writes the texel at `at`, which must lie inside. A shader does not test that, unless
            /// it was exported with bounds checks; the native device does, and reports the kernel.
            /// No two invocations write the same texel: which comes last is undefined.
            #[inline]
            #[track_caller]
            pub fn store(self, at: $at, value: F::Value)
            where
                F::Value: Texel<Channels: crate::native::exec::Channels>,
            {
                let whole: fn($at) -> UVec3 = $whole;
                let (at, size) = (whole(at), UVec3::from_array(self.0.size()));
                assert!(
                    at.cmplt(size).all(),
                    "texel {at} is out of range: the texture has {size}"
                );
                self.0.store(at, value);
            }
        }
    )* };
}

textures! {
    /// A texture of two dimensions of which any texel may be written: `StorageTexture2d<'_,
    /// Rgba16Float>`.
    StorageTexture2d, Flat, flat_size, UVec2, |at| at.extend(0), |size| size.truncate();
    /// A texture of three dimensions of which any texel may be written.
    StorageTexture3d, Volume, volume_size, UVec3, |at| at, |size| size;
}
