//! Textures of which any texel may be read, written, or both.

use core::marker::PhantomData;

use glam::{UVec2, UVec3};

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
    use glam::{IVec2, IVec4, UVec2, UVec4, Vec2, Vec3, Vec4};
    #[cfg(target_arch = "spirv")]
    use spirv_std::Image;

    use super::Format;

    macro_rules! formats {
        ($($(#[doc = $doc:literal])* $name:ident $word:literal $spirv:ident $value:ident $channels:literal $channel:ident;)*) => { $(
            $(#[doc = $doc])*
            #[derive(Clone, Copy, Debug)]
            pub enum $name {}

            impl Format for $name {
                type Value = $value;
                #[cfg(target_arch = "spirv")]
                type Line = Image!(1D, format = $spirv, sampled = false);
                #[cfg(target_arch = "spirv")]
                type Flat = Image!(2D, format = $spirv, sampled = false);
                #[cfg(target_arch = "spirv")]
                type Layers = Image!(2D, format = $spirv, sampled = false, arrayed);
                #[cfg(target_arch = "spirv")]
                type Volume = Image!(3D, format = $spirv, sampled = false);
                #[cfg(target_arch = "spirv")]
                #[inline(always)]
                fn line_size(image: &Self::Line) -> u32 {
                    image.query_size()
                }
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
                fn layers(image: &Self::Layers) -> u32 {
                    let size: glam::UVec3 = image.query_size();
                    size.z
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

    texel_formats!(formats);
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
    type Line;
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
    fn line_size(image: &Self::Line) -> u32;
    #[cfg(target_arch = "spirv")]
    #[doc(hidden)]
    fn flat_size(image: &Self::Flat) -> UVec2;
    #[cfg(target_arch = "spirv")]
    #[doc(hidden)]
    fn layers_size(image: &Self::Layers) -> UVec2;
    #[cfg(target_arch = "spirv")]
    #[doc(hidden)]
    fn layers(image: &Self::Layers) -> u32;
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
    /// A texture of one dimension.
    StorageTexture1d, Line, line_size, u32,
        (at: u32), at, UVec3::new(at, 0, 0), |size| size.x;
    /// A texture of three dimensions.
    StorageTexture3d, Volume, volume_size, UVec3,
        (at: UVec3), at, at, |size| size;
}

impl<F: Format, A: Access> StorageTexture2dArray<'_, F, A> {
    /// Layers, 1 or more.
    #[inline]
    #[must_use]
    pub fn layers(self) -> u32 {
        #[cfg(target_arch = "spirv")]
        {
            F::layers(self.0)
        }
        #[cfg(not(target_arch = "spirv"))]
        {
            self.0.size()[2]
        }
    }
}
