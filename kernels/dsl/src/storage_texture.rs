//! Textures of which any texel may be read, written, or both.

use core::marker::PhantomData;

use glam::{IVec2, IVec4, UVec2, UVec3, UVec4, Vec4};

use crate::Texel;
#[cfg(not(target_arch = "spirv"))]
use crate::native::{
    describe::{TexelAccess, TexelFormat},
    exec::{Channels, Texels},
};
#[cfg(target_arch = "spirv")]
use crate::texture::image;

/// Formats of storage textures, as types.
pub mod format {
    use super::{Format, IVec2, IVec4, UVec2, UVec4, Vec4};

    macro_rules! formats {
        ($($(#[doc = $doc:literal])* $name:ident, $texel:ty, $flat:ident, $layers:ident, $volume:ident;)*) => { $(
            $(#[doc = $doc])*
            #[derive(Clone, Copy, Debug)]
            pub enum $name {}

            impl Format for $name {
                type Value = $texel;
                #[cfg(target_arch = "spirv")]
                type Flat = super::image::$flat;
                #[cfg(target_arch = "spirv")]
                type Layers = super::image::$layers;
                #[cfg(target_arch = "spirv")]
                type Volume = super::image::$volume;
                #[cfg(target_arch = "spirv")]
                #[inline(always)]
                fn flat_size(image: &Self::Flat) -> glam::UVec2 {
                    image.query_size()
                }
                #[cfg(target_arch = "spirv")]
                #[inline(always)]
                fn layers_size(image: &Self::Layers) -> glam::UVec2 {
                    let size: glam::UVec3 = image.query_size();
                    size.truncate()
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
        R32Float, f32, Storage2dR32Float, Storage2dArrayR32Float, Storage3dR32Float;
        /// Four 32-bit floats.
        Rgba32Float, Vec4, Storage2dRgba32Float, Storage2dArrayRgba32Float, Storage3dRgba32Float;
        /// Four 16-bit floats.
        Rgba16Float, Vec4, Storage2dRgba16Float, Storage2dArrayRgba16Float, Storage3dRgba16Float;
        /// Four 16-bit numbers from 0 to 1.
        Rgba16Unorm, Vec4, Storage2dRgba16Unorm, Storage2dArrayRgba16Unorm, Storage3dRgba16Unorm;
        /// Four 8-bit numbers from 0 to 1.
        Rgba8Unorm, Vec4, Storage2dRgba8Unorm, Storage2dArrayRgba8Unorm, Storage3dRgba8Unorm;
        /// One 32-bit unsigned integer.
        R32Uint, u32, Storage2dR32Uint, Storage2dArrayR32Uint, Storage3dR32Uint;
        /// Four 32-bit unsigned integers.
        Rgba32Uint, UVec4, Storage2dRgba32Uint, Storage2dArrayRgba32Uint, Storage3dRgba32Uint;
        /// One 32-bit signed integer.
        R32Sint, i32, Storage2dR32Sint, Storage2dArrayR32Sint, Storage3dR32Sint;
        /// Four 32-bit signed integers.
        Rgba32Sint, IVec4, Storage2dRgba32Sint, Storage2dArrayRgba32Sint, Storage3dRgba32Sint;
        /// Two 32-bit unsigned integers.
        Rg32Uint, UVec2, Storage2dRg32Uint, Storage2dArrayRg32Uint, Storage3dRg32Uint;
        /// Two 32-bit signed integers.
        Rg32Sint, IVec2, Storage2dRg32Sint, Storage2dArrayRg32Sint, Storage3dRg32Sint;
        /// Four 16-bit unsigned integers. What does not fit must not be written.
        Rgba16Uint, UVec4, Storage2dRgba16Uint, Storage2dArrayRgba16Uint, Storage3dRgba16Uint;
        /// Four 16-bit signed integers. What does not fit must not be written.
        Rgba16Sint, IVec4, Storage2dRgba16Sint, Storage2dArrayRgba16Sint, Storage3dRgba16Sint;
        /// Four 8-bit unsigned integers. What does not fit must not be written.
        Rgba8Uint, UVec4, Storage2dRgba8Uint, Storage2dArrayRgba8Uint, Storage3dRgba8Uint;
        /// Four 8-bit signed integers. What does not fit must not be written.
        Rgba8Sint, IVec4, Storage2dRgba8Sint, Storage2dArrayRgba8Sint, Storage3dRgba8Sint;
    }
}

/// What a kernel does with a storage texture, as types.
pub mod access {
    #[cfg(not(target_arch = "spirv"))]
    use super::TexelAccess;
    use super::{Access, Readable, Writable};

    macro_rules! accesses {
        ($($(#[doc = $doc:literal])* $name:ident: $($can:ident),*;)*) => { $(
            $(#[doc = $doc])*
            #[derive(Clone, Copy, Debug)]
            pub enum $name {}

            impl Access for $name {
                #[cfg(not(target_arch = "spirv"))]
                const ACCESS: TexelAccess = TexelAccess::$name;
            }
            $(impl $can for $name {})*
        )* };
    }

    accesses! {
        /// Texels are written.
        Write: Writable;
        /// Texels are read.
        Read: Readable;
        /// Texels are read and written. WGSL has this for [`R32Float`](super::format::R32Float),
        /// [`R32Uint`](super::format::R32Uint) and [`R32Sint`](super::format::R32Sint).
        ReadWrite: Readable, Writable;
    }
}

/// One of those in [`access`](mod@access).
pub trait Access: Copy {
    /// Its description.
    #[cfg(not(target_arch = "spirv"))]
    const ACCESS: TexelAccess;
}

/// An access that reads.
pub trait Readable: Access {}

/// An access that writes.
pub trait Writable: Access {}

/// A format of a storage texture: one of those in [`format`](mod@format).
pub trait Format: Copy {
    /// What a texel is made of.
    type Value: Texel;
    #[cfg(target_arch = "spirv")]
    #[doc(hidden)]
    type Flat;
    #[cfg(target_arch = "spirv")]
    #[doc(hidden)]
    type Layers;
    #[cfg(target_arch = "spirv")]
    #[doc(hidden)]
    type Volume;
    #[cfg(target_arch = "spirv")]
    #[doc(hidden)]
    fn flat_size(image: &Self::Flat) -> UVec2;
    #[cfg(target_arch = "spirv")]
    #[doc(hidden)]
    fn layers_size(image: &Self::Layers) -> UVec2;
    #[cfg(target_arch = "spirv")]
    #[doc(hidden)]
    fn volume_size(image: &Self::Volume) -> UVec3;
    /// Its description.
    #[cfg(not(target_arch = "spirv"))]
    const FORMAT: TexelFormat;
}

/// `$place` makes a coordinate of what `store` and `load` take, which is `$whole` in three dimensions;
/// `$sized` takes the size out of one in three dimensions.
macro_rules! textures {
    ($(
        $(#[doc = $doc:literal])*
        $name:ident, $image:ident, $size:ident, $size_type:ty,
        ($($arg:ident: $arg_type:ty),*), $place:expr, $whole:expr, $sized:expr;
    )*) => { $(
        $(#[doc = $doc])*
        #[derive(Clone, Copy)]
        pub struct $name<'a, F: Format, A: Access = access::Write>(
            #[cfg(target_arch = "spirv")] &'a F::$image,
            #[cfg(not(target_arch = "spirv"))] Texels<'a>,
            PhantomData<(F, A)>,
        );

        #[cfg(target_arch = "spirv")]
        #[allow(missing_docs, reason = "documented on the host's side")]
        impl<'a, F: Format, A: Access> $name<'a, F, A> {
            #[doc(hidden)]
            #[inline(always)]
            pub fn new(image: &'a F::$image) -> Self {
                Self(image, PhantomData)
            }
            #[inline(always)]
            pub fn size(self) -> $size_type {
                F::$size(self.0)
            }
            #[inline(always)]
            pub fn store(self, $($arg: $arg_type,)* value: F::Value)
            where
                A: Writable,
            {
                // SAFETY: the caller's contract; exports with bounds checks test it again.
                unsafe { image::write(self.0, $place, Texel::channels(value)) }
            }
            #[inline(always)]
            pub fn load(self, $($arg: $arg_type),*) -> F::Value
            where
                A: Readable,
            {
                // SAFETY: the caller's contract; exports with bounds checks test it again.
                Texel::of(unsafe { image::read(self.0, $place) })
            }
        }

        #[cfg(not(target_arch = "spirv"))]
        impl<'a, F: Format, A: Access> $name<'a, F, A> {
            #[doc(hidden)]
            #[must_use]
            pub fn new(texels: Texels<'a>) -> Self {
                Self(texels, PhantomData)
            }
            /// Texels along each axis; of an array, those of a layer.
            #[inline]
            #[must_use]
            pub fn size(self) -> $size_type {
                let sized: fn(UVec3) -> $size_type = $sized;
                sized(UVec3::from_array(self.0.size()))
            }
            #[track_caller]
            fn inside(self, at: UVec3) -> UVec3 {
                let size = UVec3::from_array(self.0.size());
                assert!(
                    at.cmplt(size).all(),
                    "texel {at} is out of range: the texture has {size}"
                );
                at
            }
            /// Writes the texel at `at`, which must lie inside; of an array, in a layer that is there. A
            /// shader does not test that, unless it was exported with bounds checks; the native device
            /// does, and reports the kernel. An integer must fit the format: what becomes of one that
            /// does not differs. No two invocations write the same texel: which comes last is undefined.
            #[inline]
            #[track_caller]
            pub fn store(self, $($arg: $arg_type,)* value: F::Value)
            where
                A: Writable,
                F::Value: Texel<Channels: Channels>,
            {
                self.0.store(self.inside($whole), value);
            }
            /// The texel at `at`, which must lie inside. An invocation sees what it wrote itself; what
            /// others of the same run wrote must not be read, as no barrier orders texels.
            #[inline]
            #[must_use]
            #[track_caller]
            pub fn load(self, $($arg: $arg_type),*) -> F::Value
            where
                A: Readable,
                F::Value: Texel<Channels: Channels>,
            {
                self.0.load(self.inside($whole))
            }
        }
    )* };
}

textures! {
    /// A texture of two dimensions of which any texel may be written: `StorageTexture2d<'_,
    /// Rgba16Float>`; or read, or both: `StorageTexture2d<'_, R32Uint, ReadWrite>`.
    StorageTexture2d, Flat, flat_size, UVec2,
        (at: UVec2), at, at.extend(0), |size| size.truncate();
    /// Layers of two dimensions: `store(at, layer, value)`.
    StorageTexture2dArray, Layers, layers_size, UVec2,
        (at: UVec2, layer: u32), at.extend(layer), at.extend(layer), |size| size.truncate();
    /// A texture of three dimensions.
    StorageTexture3d, Volume, volume_size, UVec3,
        (at: UVec3), at, at, |size| size;
}
