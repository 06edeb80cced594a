//! Textures and samplers as a kernel sees them. On both sides a value of a few words that is
//! passed by copy.
//!
//! Every texture of a kind is declared once, in [`textures`]; what its methods compute is declared
//! once for each side: `spirv` and `host`.

use core::marker::PhantomData;

use glam::{IVec2, IVec4, UVec2, UVec3, UVec4, Vec2, Vec3, Vec4};

#[cfg(not(target_arch = "spirv"))]
use crate::native;

#[cfg(target_arch = "spirv")]
#[allow(missing_docs, reason = "named by the macros only")]
pub mod image {
    use core::arch::asm;
    use spirv_std::Image;

    /// Writes all four channels, whatever the format keeps of them: naga wants them, and
    /// spirv-std's own `write` takes as many as the format has.
    ///
    /// # Safety
    /// `image` is a storage image, `at` a texel of it, `channels` four numbers of its kind.
    #[inline(always)]
    pub unsafe fn write<I, C, V>(image: &I, at: C, channels: V) {
        // SAFETY: the caller's.
        unsafe {
            asm!(
                "%image = OpLoad _ {image}",
                "%at = OpLoad _ {at}",
                "%channels = OpLoad _ {channels}",
                "OpImageWrite %image %at %channels",
                image = in(reg) image, at = in(reg) &at, channels = in(reg) &channels,
            );
        }
    }
    /// The comparison of a reference with each of four texels.
    ///
    /// # Safety
    /// `image` holds depths, `sampler` compares, `at` is a coordinate for the image.
    #[inline(always)]
    pub unsafe fn gather_compare<I, C>(
        image: &I,
        sampler: spirv_std::Sampler,
        at: C,
        reference: f32,
    ) -> glam::Vec4 {
        let mut result = glam::Vec4::ZERO;
        // SAFETY: the caller's.
        unsafe {
            asm!(
                "%image = OpLoad _ {image}",
                "%sampler = OpLoad _ {sampler}",
                "%at = OpLoad _ {at}",
                "%reference = OpLoad _ {reference}",
                "%sampled = OpSampledImage _ %image %sampler",
                "%result = OpImageDrefGather typeof*{result} %sampled %at %reference",
                "OpStore {result} %result",
                image = in(reg) image, sampler = in(reg) &sampler, at = in(reg) &at,
                reference = in(reg) &reference, result = in(reg) &mut result,
            );
        }
        result
    }

    /// Functions that sample at a constant offset in texels, which spirv-std does not have. `$operands` are the image
    /// operands, the offset last among them. It is made of constants, of which `codegen` makes one.
    macro_rules! shifted {
        (
            @one ($vector:ident $($axis:ident $word:ident)*) $construct:literal
            $(#[doc = $doc:literal])* $name:ident($($arg:ident: $ty:ty),*) -> $result:ty = $op:literal, $operands:literal
        ) => {
            $(#[doc = $doc])*
            ///
            /// # Safety
            /// The types fit the image.
            #[inline(always)]
            pub unsafe fn $name<I, C, $(const $axis: i32),*>(
                image: &I,
                sampler: spirv_std::Sampler,
                at: C,
                $($arg: $ty,)*
            ) -> $result {
                let mut result = <$result>::default();
                let offset = glam::$vector::ZERO;
                // SAFETY: the caller's.
                unsafe {
                    asm!(
                        "%image = OpLoad _ {image}",
                        "%sampler = OpLoad _ {sampler}",
                        "%at = OpLoad _ {at}",
                        $(concat!("%", stringify!($arg), " = OpLoad _ {", stringify!($arg), "}"),)*
                        $construct,
                        "%sampled = OpSampledImage _ %image %sampler",
                        concat!("%result = ", $op, " typeof*{result} %sampled %at ", $operands, " %offset"),
                        "OpStore {result} %result",
                        image = in(reg) image, sampler = in(reg) &sampler, at = in(reg) &at,
                        $($arg = in(reg) &$arg,)*
                        offset = in(reg) &offset, $($word = in(reg) $axis,)*
                        result = in(reg) &mut result,
                    );
                }
                result
            }
        };
        (
            $axes:tt $construct:literal;
            $($(#[doc = $doc:literal])* $name:ident $args:tt -> $result:ty = $op:literal, $operands:literal;)*
        ) => { $(
            shifted! { @one $axes $construct $(#[doc = $doc])* $name $args -> $result = $op, $operands }
        )* };
    }
    shifted! {
        (IVec2 X x Y y) "%offset = OpCompositeConstruct typeof*{offset} {x} {y}";
        /// At the fragment's level.
        sample_shifted() -> glam::Vec4 = "OpImageSampleImplicitLod", "ConstOffset";
        /// The same with a bias.
        sample_bias_shifted(bias: f32) -> glam::Vec4 = "OpImageSampleImplicitLod", "Bias|ConstOffset %bias";
        /// At a level.
        sample_level_shifted(level: f32) -> glam::Vec4 = "OpImageSampleExplicitLod", "Lod|ConstOffset %level";
        /// At the level of derivatives.
        sample_gradient_shifted(dx: glam::Vec2, dy: glam::Vec2) -> glam::Vec4
            = "OpImageSampleExplicitLod", "Grad|ConstOffset %dx %dy";
        /// A channel of four texels.
        gather_shifted(channel: u32) -> glam::Vec4 = "OpImageGather", "%channel ConstOffset";
        /// A comparison at the fragment's level.
        compare_shifted(reference: f32) -> f32 = "OpImageSampleDrefImplicitLod", "%reference ConstOffset";
        /// A comparison at a level.
        compare_level_shifted(reference: f32, level: f32) -> f32
            = "OpImageSampleDrefExplicitLod", "%reference Lod|ConstOffset %level";
        /// Comparisons of four texels.
        gather_compare_shifted(reference: f32) -> glam::Vec4 = "OpImageDrefGather", "%reference ConstOffset";
    }
    shifted! {
        (IVec3 X x Y y Z z) "%offset = OpCompositeConstruct typeof*{offset} {x} {y} {z}";
        /// At the fragment's level, in three dimensions.
        sample_shifted_3d() -> glam::Vec4 = "OpImageSampleImplicitLod", "ConstOffset";
        /// The same with a bias.
        sample_bias_shifted_3d(bias: f32) -> glam::Vec4 = "OpImageSampleImplicitLod", "Bias|ConstOffset %bias";
        /// At a level, in three dimensions.
        sample_level_shifted_3d(level: f32) -> glam::Vec4 = "OpImageSampleExplicitLod", "Lod|ConstOffset %level";
        /// At the level of derivatives, in three dimensions.
        sample_gradient_shifted_3d(dx: glam::Vec3, dy: glam::Vec3) -> glam::Vec4
            = "OpImageSampleExplicitLod", "Grad|ConstOffset %dx %dy";
    }

    pub type Texture1d = Image!(1D, type=f32, sampled);
    pub type Texture2d = Image!(2D, type=f32, sampled);
    pub type Texture2dArray = Image!(2D, type=f32, sampled, arrayed);
    pub type Texture2dMultisampled = Image!(2D, type=f32, sampled, multisampled);
    pub type Texture3d = Image!(3D, type=f32, sampled);
    pub type TextureCube = Image!(cube, type=f32, sampled);
    pub type TextureCubeArray = Image!(cube, type=f32, sampled, arrayed);
    pub type DepthTexture2d = Image!(2D, type=f32, sampled, depth);
    pub type DepthTexture2dArray = Image!(2D, type=f32, sampled, arrayed, depth);
    pub type DepthTextureCube = Image!(cube, type=f32, sampled, depth);
    pub type DepthTextureCubeArray = Image!(cube, type=f32, sampled, arrayed, depth);
    pub type DepthTexture2dMultisampled = Image!(2D, type=f32, sampled, multisampled, depth);
    pub type UintTexture1d = Image!(1D, type=u32, sampled);
    pub type UintTexture2d = Image!(2D, type=u32, sampled);
    pub type UintTexture2dArray = Image!(2D, type=u32, sampled, arrayed);
    pub type UintTexture2dMultisampled = Image!(2D, type=u32, sampled, multisampled);
    pub type UintTexture3d = Image!(3D, type=u32, sampled);
    pub type UintTextureCube = Image!(cube, type=u32, sampled);
    pub type UintTextureCubeArray = Image!(cube, type=u32, sampled, arrayed);
    pub type SintTexture1d = Image!(1D, type=i32, sampled);
    pub type SintTexture2d = Image!(2D, type=i32, sampled);
    pub type SintTexture2dArray = Image!(2D, type=i32, sampled, arrayed);
    pub type SintTexture2dMultisampled = Image!(2D, type=i32, sampled, multisampled);
    pub type SintTexture3d = Image!(3D, type=i32, sampled);
    pub type SintTextureCube = Image!(cube, type=i32, sampled);
    pub type SintTextureCubeArray = Image!(cube, type=i32, sampled, arrayed);

    /// Reads all four channels, whatever the format keeps of them.
    ///
    /// # Safety
    /// `image` is a storage image, `at` a texel of it, `channels` four numbers of its kind.
    #[inline(always)]
    pub unsafe fn read<I, C, V: Default>(image: &I, at: C) -> V {
        let mut channels = V::default();
        // SAFETY: the caller's.
        unsafe {
            asm!(
                "%image = OpLoad _ {image}",
                "%at = OpLoad _ {at}",
                "%channels = OpImageRead typeof*{channels} %image %at",
                "OpStore {channels} %channels",
                image = in(reg) image, at = in(reg) &at, channels = in(reg) &mut channels,
            );
        }
        channels
    }
}
/// Declares textures, and makes them of what the macros bind.
macro_rules! textures {
    ($($(#[doc = $doc:literal])* $name:ident;)*) => { $(
        $(#[doc = $doc])*
        #[derive(Clone, Copy)]
        pub struct $name<'a>(
            #[cfg(target_arch = "spirv")] &'a image::$name,
            #[cfg(not(target_arch = "spirv"))] native::TextureRef<'a>,
        );

        impl<'a> $name<'a> {
            #[cfg(target_arch = "spirv")]
            #[doc(hidden)]
            #[inline(always)]
            pub fn new(image: &'a image::$name) -> Self {
                Self(image)
            }
            #[cfg(not(target_arch = "spirv"))]
            #[doc(hidden)]
            #[must_use]
            pub fn new(texture: native::TextureRef<'a>) -> Self {
                Self(texture)
            }
        }
    )* };
}

textures! {
    /// Depths in two dimensions, which a [`ComparisonSampler`] compares with a reference. A [`NonFilteringSampler`] reads
    /// them as they are.
    DepthTexture2d;
    /// Depths in two dimensions with several samples in each texel.
    DepthTexture2dMultisampled;
    /// Layers of such depths.
    DepthTexture2dArray;
    /// Such depths on the faces of a cube.
    DepthTextureCube;
    /// Such cubes in an array.
    DepthTextureCubeArray;
}

/// Declares [`Channel`], with the images of all textures that may hold any numbers.
macro_rules! channels {
    ($($image:ident)*) => {
        /// What the channels of a texture are: `f32`, `u32` or `i32`.
        pub trait Channel: Copy {
            /// All four channels of a texel.
            type Texel: Copy;
            $(
                #[cfg(target_arch = "spirv")]
                #[doc(hidden)]
                type $image;
            )*
            #[cfg(not(target_arch = "spirv"))]
            #[doc(hidden)]
            fn load(
                texture: &native::TextureRef<'_>,
                at: [u32; 3],
                layer: u32,
                level: u32,
                sample: u32,
            ) -> Self::Texel;
        }
    };
}

channels!(Texture1d Texture2d Texture2dArray Texture2dMultisampled Texture3d TextureCube TextureCubeArray);

macro_rules! channel {
    ($number:ty: $texel:ty, $load:expr; $($image:ident = $of_numbers:ident)*) => {
        impl Channel for $number {
            type Texel = $texel;
            $(
                #[cfg(target_arch = "spirv")]
                type $image = image::$of_numbers;
            )*
            #[cfg(not(target_arch = "spirv"))]
            #[inline]
            fn load(
                texture: &native::TextureRef<'_>,
                at: [u32; 3],
                layer: u32,
                level: u32,
                sample: u32,
            ) -> $texel {
                $load(texture, at, layer, level, sample)
            }
        }
    };
}

channel! {
    f32: Vec4, native::sampling::load;
    Texture1d = Texture1d
    Texture2d = Texture2d
    Texture2dArray = Texture2dArray
    Texture2dMultisampled = Texture2dMultisampled
    Texture3d = Texture3d
    TextureCube = TextureCube
    TextureCubeArray = TextureCubeArray
}
channel! {
    u32: UVec4, native::sampling::load_integer;
    Texture1d = UintTexture1d
    Texture2d = UintTexture2d
    Texture2dArray = UintTexture2dArray
    Texture2dMultisampled = UintTexture2dMultisampled
    Texture3d = UintTexture3d
    TextureCube = UintTextureCube
    TextureCubeArray = UintTextureCubeArray
}
channel! {
    i32: IVec4, |t, at, layer, level, sample| {
        native::sampling::load_integer(t, at, layer, level, sample).as_ivec4()
    };
    Texture1d = SintTexture1d
    Texture2d = SintTexture2d
    Texture2dArray = SintTexture2dArray
    Texture2dMultisampled = SintTexture2dMultisampled
    Texture3d = SintTexture3d
    TextureCube = SintTextureCube
    TextureCubeArray = SintTextureCubeArray
}

/// Declares textures of any numbers.
macro_rules! textures_of {
    ($($(#[doc = $doc:literal])* $name:ident;)*) => { $(
        $(#[doc = $doc])*
        #[derive(Clone, Copy)]
        pub struct $name<'a, T: Channel = f32>(
            #[cfg(target_arch = "spirv")] &'a T::$name,
            #[cfg(not(target_arch = "spirv"))] native::TextureRef<'a>,
            PhantomData<T>,
        );

        impl<'a, T: Channel> $name<'a, T> {
            #[cfg(target_arch = "spirv")]
            #[doc(hidden)]
            #[inline(always)]
            pub fn new(image: &'a T::$name) -> Self {
                Self(image, PhantomData)
            }
            #[cfg(not(target_arch = "spirv"))]
            #[doc(hidden)]
            #[must_use]
            pub fn new(texture: native::TextureRef<'a>) -> Self {
                Self(texture, PhantomData)
            }
        }
    )* };
}

textures_of! {
    /// A texture of two dimensions: of floats, which can be filtered, or with a second argument of
    /// integers: `Texture2d<'_, u32>`.
    Texture2d;
    /// Layers of such textures.
    Texture2dArray;
    /// A texture of three dimensions, of floats or integers.
    Texture3d;
    /// A texture of one dimension; it has one level.
    Texture1d;
    /// A texture of two dimensions with several samples in each texel.
    Texture2dMultisampled;
    /// Six textures of two dimensions on the faces of a cube, sampled by a direction. One of integers can only be
    /// gathered from.
    TextureCube;
    /// Cubes in an array.
    TextureCubeArray;
}

/// A texture of two dimensions, or an array of them, that is read `X` texels further to the right and `Y` further down
/// than the coordinates say, at whichever level: [`Texture2d::shifted`] makes it. One of three dimensions is read `Z` texels
/// further in, too. What lies beyond the edge follows from the sampler, as ever.
#[derive(Clone, Copy)]
pub struct Shifted<T, const X: i32, const Y: i32, const Z: i32 = 0>(T);

/// Whether every language has the offset.
const fn is_offset(texels: i32) -> bool {
    texels >= -8 && texels <= 7
}

macro_rules! shifts {
    ($($name:ident)*) => { $(
        impl $name<'_> {
            /// The same texture, read `X` texels further to the right and `Y` further down: each from -8 to 7.
            #[inline(always)]
            #[must_use]
            pub fn shifted<const X: i32, const Y: i32>(self) -> Shifted<Self, X, Y> {
                const { assert!(is_offset(X) && is_offset(Y), "an offset is from -8 to 7 texels") };
                Shifted(self)
            }
        }
    )* };
}

shifts!(Texture2d Texture2dArray DepthTexture2d DepthTexture2dArray);

impl Texture3d<'_> {
    /// The same texture, read `X`, `Y` and `Z` texels further along its axes: each from -8 to 7.
    #[inline(always)]
    #[must_use]
    pub fn shifted<const X: i32, const Y: i32, const Z: i32>(self) -> Shifted<Self, X, Y, Z> {
        const {
            assert!(
                is_offset(X) && is_offset(Y) && is_offset(Z),
                "an offset is from -8 to 7 texels"
            );
        };
        Shifted(self)
    }
}

/// How a texture is filtered between texels, between levels, and beyond the edge.
#[derive(Clone, Copy)]
pub struct Sampler(
    #[cfg(target_arch = "spirv")] spirv_std::Sampler,
    #[cfg(not(target_arch = "spirv"))] native::Sampler,
);

/// A sampler that takes the nearest texel of the nearest level: what depths that are not compared, and integers, are sampled
/// with. WebGPU tells it apart from others by the layout of its bind group.
#[derive(Clone, Copy)]
pub struct NonFilteringSampler(
    #[cfg(target_arch = "spirv")] spirv_std::Sampler,
    #[cfg(not(target_arch = "spirv"))] native::Sampler,
);

/// The same for depths, and how they are compared with a reference: what is filtered is how many
/// comparisons hold.
#[derive(Clone, Copy)]
pub struct ComparisonSampler(
    #[cfg(target_arch = "spirv")] spirv_std::Sampler,
    #[cfg(not(target_arch = "spirv"))] native::Sampler,
);

macro_rules! samplers {
    ($($name:ident)*) => { $(
        impl $name {
            #[cfg(target_arch = "spirv")]
            #[doc(hidden)]
            #[inline(always)]
            pub fn new(sampler: &spirv_std::Sampler) -> Self {
                Self(*sampler)
            }
            #[cfg(not(target_arch = "spirv"))]
            #[doc(hidden)]
            #[must_use]
            pub fn new(sampler: native::Sampler) -> Self {
                Self(sampler)
            }
        }
    )* };
}

samplers!(Sampler NonFilteringSampler ComparisonSampler);

#[cfg(target_arch = "spirv")]
#[allow(missing_docs, reason = "documented on the host's side")]
mod spirv {
    use super::*;
    use spirv_std::image::{ImageWithMethods, sample_with};

    /// `$size` is the type of a size, `$place` makes a coordinate for floats of what a method takes,
    /// `$texel` one for whole numbers.
    macro_rules! sizes {
        ($($name:ty: $size:ty, $query:ty, $take:expr;)*) => { $(
            impl $name {
                #[inline(always)]
                pub fn size(self) -> $size {
                    self.level_size(0)
                }
                #[inline(always)]
                pub fn level_size(self, level: u32) -> $size {
                    let size: $query = self.0.query_size_lod(level);
                    $take(size)
                }
                #[inline(always)]
                pub fn levels(self) -> u32 {
                    self.0.query_levels()
                }
            }
        )* };
    }
    sizes! {
        Texture2d<'_>: UVec2, UVec2, |size| size;
        Texture2d<'_, u32>: UVec2, UVec2, |size| size;
        Texture2d<'_, i32>: UVec2, UVec2, |size| size;
        Texture2dArray<'_>: UVec2, UVec3, UVec3::truncate;
        Texture2dArray<'_, u32>: UVec2, UVec3, UVec3::truncate;
        Texture2dArray<'_, i32>: UVec2, UVec3, UVec3::truncate;
        Texture3d<'_>: UVec3, UVec3, |size| size;
        Texture3d<'_, u32>: UVec3, UVec3, |size| size;
        Texture3d<'_, i32>: UVec3, UVec3, |size| size;
        TextureCube<'_>: UVec2, UVec2, |size| size;
        TextureCube<'_, u32>: UVec2, UVec2, |size| size;
        TextureCube<'_, i32>: UVec2, UVec2, |size| size;
        TextureCubeArray<'_>: UVec2, UVec3, UVec3::truncate;
        TextureCubeArray<'_, u32>: UVec2, UVec3, UVec3::truncate;
        TextureCubeArray<'_, i32>: UVec2, UVec3, UVec3::truncate;
        DepthTexture2d<'_>: UVec2, UVec2, |size| size;
        DepthTexture2dArray<'_>: UVec2, UVec3, UVec3::truncate;
        DepthTextureCube<'_>: UVec2, UVec2, |size| size;
        DepthTextureCubeArray<'_>: UVec2, UVec3, UVec3::truncate;
    }

    macro_rules! layers {
        ($($name:ty: $count:ident;)*) => { $(
            impl $name {
                #[inline(always)]
                pub fn $count(self) -> u32 {
                    let size: UVec3 = self.0.query_size_lod(0);
                    size.z
                }
            }
        )* };
    }
    layers! {
        Texture2dArray<'_>: layers;
        Texture2dArray<'_, u32>: layers;
        Texture2dArray<'_, i32>: layers;
        DepthTexture2dArray<'_>: layers;
        TextureCubeArray<'_>: cubes;
        TextureCubeArray<'_, u32>: cubes;
        TextureCubeArray<'_, i32>: cubes;
        DepthTextureCubeArray<'_>: cubes;
    }

    macro_rules! loads {
        ($($name:ty: $texel:ty => $value:ty, ($($arg:ident: $ty:ty),*), $at:expr, $take:expr;)*) => { $(
            impl $name {
                #[inline(always)]
                pub fn load(self, $($arg: $ty),*) -> $value {
                    self.load_level($($arg,)* 0)
                }
                #[inline(always)]
                pub fn load_level(self, $($arg: $ty,)* level: u32) -> $value {
                    let texel: $texel = self.0.fetch_with_lod($at, level);
                    $take(texel)
                }
            }
        )* };
    }
    loads! {
        Texture2d<'_>: Vec4 => Vec4, (at: UVec2), at, |texel| texel;
        Texture2d<'_, u32>: UVec4 => UVec4, (at: UVec2), at, |texel| texel;
        Texture2d<'_, i32>: IVec4 => IVec4, (at: UVec2), at, |texel| texel;
        Texture2dArray<'_>: Vec4 => Vec4, (at: UVec2, layer: u32), at.extend(layer), |texel| texel;
        Texture2dArray<'_, u32>: UVec4 => UVec4, (at: UVec2, layer: u32), at.extend(layer), |texel| texel;
        Texture2dArray<'_, i32>: IVec4 => IVec4, (at: UVec2, layer: u32), at.extend(layer), |texel| texel;
        Texture3d<'_>: Vec4 => Vec4, (at: UVec3), at, |texel| texel;
        Texture3d<'_, u32>: UVec4 => UVec4, (at: UVec3), at, |texel| texel;
        Texture3d<'_, i32>: IVec4 => IVec4, (at: UVec3), at, |texel| texel;
        DepthTexture2d<'_>: Vec4 => f32, (at: UVec2), at, |texel: Vec4| texel.x;
        DepthTexture2dArray<'_>: Vec4 => f32, (at: UVec2, layer: u32), at.extend(layer), |texel: Vec4| texel.x;
    }

    macro_rules! samples {
        ($($name:ident: ($($arg:ident: $ty:ty),*), $gradient:ty, $at:expr;)*) => { $(
            impl $name<'_> {
                #[inline(always)]
                pub fn sample(self, sampler: Sampler, $($arg: $ty),*) -> Vec4 {
                    self.0.sample(sampler.0, $at)
                }
                #[inline(always)]
                pub fn sample_bias(self, sampler: Sampler, $($arg: $ty,)* bias: f32) -> Vec4 {
                    self.0.sample_bias(sampler.0, $at, bias)
                }
                #[inline(always)]
                pub fn sample_level(self, sampler: Sampler, $($arg: $ty,)* level: f32) -> Vec4 {
                    self.0.sample_by_lod(sampler.0, $at, level)
                }
                #[inline(always)]
                pub fn sample_gradient(
                    self,
                    sampler: Sampler,
                    $($arg: $ty,)*
                    dx: $gradient,
                    dy: $gradient,
                ) -> Vec4 {
                    self.0.sample_by_gradient(sampler.0, $at, dx, dy)
                }
            }
        )* };
    }
    samples! {
        Texture2d: (uv: Vec2), Vec2, uv;
        Texture2dArray: (uv: Vec2, layer: u32), Vec2, uv.extend(layer as f32);
        Texture3d: (uvw: Vec3), Vec3, uvw;
        TextureCube: (direction: Vec3), Vec3, direction;
        TextureCubeArray: (direction: Vec3, cube: u32), Vec3, direction.extend(cube as f32);
    }

    macro_rules! gathers {
        ($($name:ty, $sampler:ty: ($($arg:ident: $ty:ty),*), $at:expr => $value:ty;)*) => { $(
            impl $name {
                #[inline(always)]
                pub fn gather<const CHANNEL: u32>(self, sampler: $sampler, $($arg: $ty),*) -> $value {
                    self.0.gather(sampler.0, $at, CHANNEL)
                }
            }
        )* };
    }
    gathers! {
        Texture2d<'_>, Sampler: (uv: Vec2), uv => Vec4;
        Texture2d<'_, u32>, NonFilteringSampler: (uv: Vec2), uv => UVec4;
        Texture2d<'_, i32>, NonFilteringSampler: (uv: Vec2), uv => IVec4;
        Texture2dArray<'_>, Sampler: (uv: Vec2, layer: u32), uv.extend(layer as f32) => Vec4;
        Texture2dArray<'_, u32>, NonFilteringSampler: (uv: Vec2, layer: u32), uv.extend(layer as f32) => UVec4;
        Texture2dArray<'_, i32>, NonFilteringSampler: (uv: Vec2, layer: u32), uv.extend(layer as f32) => IVec4;
        TextureCube<'_>, Sampler: (direction: Vec3), direction => Vec4;
        TextureCube<'_, u32>, NonFilteringSampler: (direction: Vec3), direction => UVec4;
        TextureCube<'_, i32>, NonFilteringSampler: (direction: Vec3), direction => IVec4;
        TextureCubeArray<'_>, Sampler: (direction: Vec3, cube: u32), direction.extend(cube as f32) => Vec4;
        TextureCubeArray<'_, u32>, NonFilteringSampler: (direction: Vec3, cube: u32), direction.extend(cube as f32) => UVec4;
        TextureCubeArray<'_, i32>, NonFilteringSampler: (direction: Vec3, cube: u32), direction.extend(cube as f32) => IVec4;
    }

    macro_rules! depths {
        ($($name:ident: ($($arg:ident: $ty:ty),*), $at:expr;)*) => { $(
            impl $name<'_> {
                #[inline(always)]
                pub fn sample(self, sampler: NonFilteringSampler, $($arg: $ty),*) -> f32 {
                    self.0.sample(sampler.0, $at).x
                }
                #[inline(always)]
                pub fn sample_level(self, sampler: NonFilteringSampler, $($arg: $ty,)* level: u32) -> f32 {
                    self.0.sample_by_lod(sampler.0, $at, level as f32).x
                }
                #[inline(always)]
                pub fn gather(self, sampler: NonFilteringSampler, $($arg: $ty),*) -> Vec4 {
                    self.0.gather(sampler.0, $at, 0)
                }
            }
        )* };
    }
    depths! {
        DepthTexture2d: (uv: Vec2), uv;
        DepthTexture2dArray: (uv: Vec2, layer: u32), uv.extend(layer as f32);
        DepthTextureCube: (direction: Vec3), direction;
        DepthTextureCubeArray: (direction: Vec3, cube: u32), direction.extend(cube as f32);
    }

    macro_rules! comparisons {
        ($($name:ident: ($($arg:ident: $ty:ty),*), $at:expr;)*) => { $(
            impl $name<'_> {
                #[inline(always)]
                pub fn compare(
                    self,
                    sampler: ComparisonSampler,
                    $($arg: $ty,)*
                    reference: f32,
                ) -> f32 {
                    self.0.sample_depth_reference(sampler.0, $at, reference)
                }
                #[inline(always)]
                pub fn compare_level_zero(
                    self,
                    sampler: ComparisonSampler,
                    $($arg: $ty,)*
                    reference: f32,
                ) -> f32 {
                    self.0
                        .sample_depth_reference_by_lod(sampler.0, $at, reference, 0.0)
                }
            }
        )* };
    }
    comparisons! {
        DepthTexture2d: (uv: Vec2), uv;
        DepthTexture2dArray: (uv: Vec2, layer: u32), uv.extend(layer as f32);
        DepthTextureCube: (direction: Vec3), direction;
        DepthTextureCubeArray: (direction: Vec3, cube: u32), direction.extend(cube as f32);
    }

    macro_rules! compared_gathers {
        ($($name:ident: ($($arg:ident: $ty:ty),*), $at:expr;)*) => { $(
            impl $name<'_> {
                #[inline(always)]
                pub fn gather_compare(
                    self,
                    sampler: ComparisonSampler,
                    $($arg: $ty,)*
                    reference: f32,
                ) -> Vec4 {
                    // SAFETY: the types are right.
                    unsafe { image::gather_compare(self.0, sampler.0, $at, reference) }
                }
            }
        )* };
    }
    compared_gathers! {
        DepthTexture2d: (uv: Vec2), uv;
        DepthTexture2dArray: (uv: Vec2, layer: u32), uv.extend(layer as f32);
        DepthTextureCube: (direction: Vec3), direction;
        DepthTextureCubeArray: (direction: Vec3, cube: u32), direction.extend(cube as f32);
    }

    macro_rules! shifted {
        ($($name:ident: ($($arg:ident: $ty:ty),*), $at:expr;)*) => { $(
            impl<const X: i32, const Y: i32> Shifted<$name<'_>, X, Y> {
                #[inline(always)]
                pub fn sample(self, sampler: Sampler, $($arg: $ty),*) -> Vec4 {
                    // SAFETY: the types fit, here and below.
                    unsafe { image::sample_shifted::<_, _, X, Y>(self.0.0, sampler.0, $at) }
                }
                #[inline(always)]
                pub fn sample_bias(self, sampler: Sampler, $($arg: $ty,)* bias: f32) -> Vec4 {
                    // SAFETY: as above.
                    unsafe { image::sample_bias_shifted::<_, _, X, Y>(self.0.0, sampler.0, $at, bias) }
                }
                #[inline(always)]
                pub fn sample_level(self, sampler: Sampler, $($arg: $ty,)* level: f32) -> Vec4 {
                    // SAFETY: as above.
                    unsafe { image::sample_level_shifted::<_, _, X, Y>(self.0.0, sampler.0, $at, level) }
                }
                #[inline(always)]
                pub fn sample_gradient(
                    self,
                    sampler: Sampler,
                    $($arg: $ty,)*
                    dx: Vec2,
                    dy: Vec2,
                ) -> Vec4 {
                    // SAFETY: as above.
                    unsafe { image::sample_gradient_shifted::<_, _, X, Y>(self.0.0, sampler.0, $at, dx, dy) }
                }
                #[inline(always)]
                pub fn gather<const CHANNEL: u32>(self, sampler: Sampler, $($arg: $ty),*) -> Vec4 {
                    // SAFETY: as above.
                    unsafe { image::gather_shifted::<_, _, X, Y>(self.0.0, sampler.0, $at, CHANNEL) }
                }
            }
        )* };
    }
    shifted! {
        Texture2d: (uv: Vec2), uv;
        Texture2dArray: (uv: Vec2, layer: u32), uv.extend(layer as f32);
    }

    macro_rules! shifted_comparisons {
        ($($name:ident: ($($arg:ident: $ty:ty),*), $at:expr;)*) => { $(
            impl<const X: i32, const Y: i32> Shifted<$name<'_>, X, Y> {
                #[inline(always)]
                pub fn compare(self, sampler: ComparisonSampler, $($arg: $ty,)* reference: f32) -> f32 {
                    // SAFETY: the types fit, here and below.
                    unsafe { image::compare_shifted::<_, _, X, Y>(self.0.0, sampler.0, $at, reference) }
                }
                #[inline(always)]
                pub fn compare_level_zero(
                    self,
                    sampler: ComparisonSampler,
                    $($arg: $ty,)*
                    reference: f32,
                ) -> f32 {
                    // SAFETY: as above.
                    unsafe { image::compare_level_shifted::<_, _, X, Y>(self.0.0, sampler.0, $at, reference, 0.0) }
                }
                #[inline(always)]
                pub fn gather_compare(
                    self,
                    sampler: ComparisonSampler,
                    $($arg: $ty,)*
                    reference: f32,
                ) -> Vec4 {
                    // SAFETY: as above.
                    unsafe { image::gather_compare_shifted::<_, _, X, Y>(self.0.0, sampler.0, $at, reference) }
                }
            }
        )* };
    }
    shifted_comparisons! {
        DepthTexture2d: (uv: Vec2), uv;
        DepthTexture2dArray: (uv: Vec2, layer: u32), uv.extend(layer as f32);
    }

    impl<const X: i32, const Y: i32, const Z: i32> Shifted<Texture3d<'_>, X, Y, Z> {
        #[inline(always)]
        pub fn sample(self, sampler: Sampler, uvw: Vec3) -> Vec4 {
            // SAFETY: the types fit, here and below.
            unsafe { image::sample_shifted_3d::<_, _, X, Y, Z>(self.0.0, sampler.0, uvw) }
        }
        #[inline(always)]
        pub fn sample_bias(self, sampler: Sampler, uvw: Vec3, bias: f32) -> Vec4 {
            // SAFETY: as above.
            unsafe {
                image::sample_bias_shifted_3d::<_, _, X, Y, Z>(self.0.0, sampler.0, uvw, bias)
            }
        }
        #[inline(always)]
        pub fn sample_level(self, sampler: Sampler, uvw: Vec3, level: f32) -> Vec4 {
            // SAFETY: as above.
            unsafe {
                image::sample_level_shifted_3d::<_, _, X, Y, Z>(self.0.0, sampler.0, uvw, level)
            }
        }
        #[inline(always)]
        pub fn sample_gradient(self, sampler: Sampler, uvw: Vec3, dx: Vec3, dy: Vec3) -> Vec4 {
            // SAFETY: as above.
            unsafe {
                image::sample_gradient_shifted_3d::<_, _, X, Y, Z>(self.0.0, sampler.0, uvw, dx, dy)
            }
        }
    }

    macro_rules! lines {
        ($($name:ty: $texel:ty;)*) => { $(
            impl $name {
                #[inline(always)]
                pub fn size(self) -> u32 {
                    self.0.query_size_lod(0)
                }
                #[inline(always)]
                pub fn load(self, at: u32) -> $texel {
                    self.0.fetch_with_lod(at, 0)
                }
            }
        )* };
    }
    lines! {
        Texture1d<'_>: Vec4;
        Texture1d<'_, u32>: UVec4;
        Texture1d<'_, i32>: IVec4;
    }

    impl Texture1d<'_> {
        #[inline(always)]
        pub fn sample(self, sampler: Sampler, u: f32) -> Vec4 {
            self.0.sample(sampler.0, u)
        }
    }

    macro_rules! multisampled {
        ($($name:ty: $texel:ty => $value:ty, $take:expr;)*) => { $(
            impl $name {
                #[inline(always)]
                pub fn size(self) -> UVec2 {
                    self.0.query_size()
                }
                #[inline(always)]
                pub fn samples(self) -> u32 {
                    self.0.query_samples()
                }
                #[inline(always)]
                pub fn load(self, at: UVec2, sample: u32) -> $value {
                    let texel: $texel = self.0.fetch_with(at, sample_with::sample_index(sample as i32));
                    $take(texel)
                }
            }
        )* };
    }
    multisampled! {
        Texture2dMultisampled<'_>: Vec4 => Vec4, |texel| texel;
        Texture2dMultisampled<'_, u32>: UVec4 => UVec4, |texel| texel;
        Texture2dMultisampled<'_, i32>: IVec4 => IVec4, |texel| texel;
        DepthTexture2dMultisampled<'_>: Vec4 => f32, |texel: Vec4| texel.x;
    }
}

#[cfg(not(target_arch = "spirv"))]
mod host {
    use super::{
        Channel, ComparisonSampler, DepthTexture2d, DepthTexture2dArray,
        DepthTexture2dMultisampled, DepthTextureCube, DepthTextureCubeArray, IVec4,
        NonFilteringSampler, Sampler, Shifted, Texture1d, Texture2d, Texture2dArray,
        Texture2dMultisampled, Texture3d, TextureCube, TextureCubeArray, UVec2, UVec3, UVec4, Vec2,
        Vec3, Vec4,
    };
    use crate::native::sampling::{self, Place};
    use crate::native::{TextureRef, fragment, level_size, sanitize};
    use core::panic::Location;

    const fn flat(uv: Vec2, layer: u32) -> Place {
        Place::Flat {
            at: Vec3::new(uv.x, uv.y, 0.0),
            dimensions: 2,
            layer,
            shift: [0; 3],
        }
    }

    macro_rules! seen {
        ($(($($of:tt)*) $name:ty: $($part:tt).+;)*) => { $(
            impl $($of)* $name {
                /// The texture that it reads.
                const fn texture(&self) -> &TextureRef<'_> {
                    &self.$($part).+
                }
            }
        )* };
    }
    seen! {
        (<T: Channel>) Texture2d<'_, T>: 0;
        (<T: Channel>) Texture2dArray<'_, T>: 0;
        (<T: Channel>) Texture3d<'_, T>: 0;
        (<T: Channel>) TextureCube<'_, T>: 0;
        (<T: Channel>) TextureCubeArray<'_, T>: 0;
        () DepthTexture2d<'_>: 0;
        () DepthTexture2dArray<'_>: 0;
        () DepthTextureCube<'_>: 0;
        () DepthTextureCubeArray<'_>: 0;
        (<const X: i32, const Y: i32>) Shifted<Texture2d<'_>, X, Y>: 0.0;
        (<const X: i32, const Y: i32>) Shifted<Texture2dArray<'_>, X, Y>: 0.0;
        (<const X: i32, const Y: i32>) Shifted<DepthTexture2d<'_>, X, Y>: 0.0;
        (<const X: i32, const Y: i32>) Shifted<DepthTexture2dArray<'_>, X, Y>: 0.0;
        (<const X: i32, const Y: i32, const Z: i32>) Shifted<Texture3d<'_>, X, Y, Z>: 0.0;
    }

    /// Like [`flat`], with an offset in texels.
    const fn shifted(uv: Vec2, layer: u32, [x, y]: [i32; 2]) -> Place {
        Place::Flat {
            at: Vec3::new(uv.x, uv.y, 0.0),
            dimensions: 2,
            layer,
            shift: [x, y, 0],
        }
    }

    const fn volume(at: Vec3, shift: [i32; 3]) -> Place {
        Place::Flat {
            at,
            dimensions: 3,
            layer: 0,
            shift,
        }
    }

    const fn cube(direction: Vec3, cube: u32) -> Place {
        Place::Cube {
            direction,
            first: 6 * cube,
        }
    }

    /// What the derivatives of a place are those of.
    const fn coordinates(place: Place) -> Vec3 {
        match place {
            Place::Flat { at, .. } => at,
            Place::Cube { direction, .. } => direction,
        }
    }

    /// The level of detail of a fragment, from its neighbours.
    fn detail(texture: &TextureRef<'_>, place: Place, at: &'static Location<'static>) -> f32 {
        let (dx, dy) = fragment::gradients(coordinates(place), at);
        sampling::detail(texture, place, dx, dy)
    }

    macro_rules! sizes {
        ($(($($of:tt)*) $name:ty: $size:ty, $take:expr;)*) => { $(
            impl $($of)* $name {
                /// Texels of level 0 along each axis; of an array, those of a layer.
                #[inline]
                #[must_use]
                pub fn size(self) -> $size {
                    self.level_size(0)
                }
                /// Texels of a level along each axis: half of those of the level before, rounded
                /// down, but at least 1.
                #[inline]
                #[must_use]
                pub fn level_size(self, level: u32) -> $size {
                    $take(UVec3::from_array(level_size(self.0.size, level)))
                }
                /// Mip levels, 1 or more.
                #[inline]
                #[must_use]
                pub fn levels(self) -> u32 {
                    self.0.levels
                }
            }
        )* };
    }
    sizes! {
        (<T: Channel>) Texture2d<'_, T>: UVec2, UVec3::truncate;
        (<T: Channel>) Texture2dArray<'_, T>: UVec2, UVec3::truncate;
        (<T: Channel>) Texture3d<'_, T>: UVec3, |size| size;
        (<T: Channel>) TextureCube<'_, T>: UVec2, UVec3::truncate;
        (<T: Channel>) TextureCubeArray<'_, T>: UVec2, UVec3::truncate;
        () DepthTexture2d<'_>: UVec2, UVec3::truncate;
        () DepthTexture2dArray<'_>: UVec2, UVec3::truncate;
        () DepthTextureCube<'_>: UVec2, UVec3::truncate;
        () DepthTextureCubeArray<'_>: UVec2, UVec3::truncate;
    }

    macro_rules! layers {
        ($($(#[doc = $doc:literal])* ($($of:tt)*) $name:ty: $count:ident, $faces:literal;)*) => { $(
            impl $($of)* $name {
                $(#[doc = $doc])*
                #[inline]
                #[must_use]
                pub fn $count(self) -> u32 {
                    self.0.layers / $faces
                }
            }
        )* };
    }
    layers! {
        /// Layers, 1 or more.
        (<T: Channel>) Texture2dArray<'_, T>: layers, 1;
        /// Layers, 1 or more.
        () DepthTexture2dArray<'_>: layers, 1;
        /// Cubes, 1 or more.
        (<T: Channel>) TextureCubeArray<'_, T>: cubes, 6;
        /// Cubes, 1 or more.
        () DepthTextureCubeArray<'_>: cubes, 6;
    }

    macro_rules! loads {
        ($(($($of:tt)*) $name:ty: $value:ty, ($($arg:ident: $ty:ty),*), $at:expr, $layer:expr, $take:expr;)*) => { $(
            impl $($of)* $name {
                /// The texel at `at`, which must lie inside. (Natively the nearest one is read
                /// otherwise, and the sanitizer says so; on a GPU it is the bounds-check policy's choice.)
                #[inline]
                #[must_use]
                #[track_caller]
                pub fn load(self, $($arg: $ty),*) -> $value {
                    self.load_level($($arg,)* 0)
                }
                /// The same of a level, which must exist.
                #[inline]
                #[must_use]
                #[track_caller]
                pub fn load_level(self, $($arg: $ty,)* level: u32) -> $value {
                    sanitize::look_for_texel(&self.0, $at, $layer, level, 0, Location::caller());
                    $take(&self.0, $at, $layer, level, 0)
                }
            }
        )* };
    }
    loads! {
        (<T: Channel>) Texture2d<'_, T>: T::Texel, (at: UVec2), [at.x, at.y, 0], 0, T::load;
        (<T: Channel>) Texture2dArray<'_, T>: T::Texel, (at: UVec2, layer: u32), [at.x, at.y, 0], layer, T::load;
        (<T: Channel>) Texture3d<'_, T>: T::Texel, (at: UVec3), at.to_array(), 0, T::load;
        () DepthTexture2d<'_>: f32, (at: UVec2), [at.x, at.y, 0], 0, depth;
        () DepthTexture2dArray<'_>: f32, (at: UVec2, layer: u32), [at.x, at.y, 0], layer, depth;
    }

    /// The depth in a texel.
    fn depth(texture: &TextureRef<'_>, at: [u32; 3], layer: u32, level: u32, sample: u32) -> f32 {
        sampling::load(texture, at, layer, level, sample).x
    }

    macro_rules! samples {
        ($(($($of:tt)*) $name:ty: ($($arg:ident: $ty:ty),*), $gradient:ty, $place:expr, $extend:expr;)*) => { $(
            impl $($of)* $name {
                /// A filtered value, at the level of detail that follows from how the coordinates
                /// differ between neighbouring fragments: in fragment kernels only, and in control
                /// flow that is the same for a quad. Coordinates in a layer begin at the first
                /// texel's outer corner and end, with 1, at the last one's; a cube is seen from
                /// its middle, along a direction of any length. Hardware may round the weights to
                /// 8 bits.
                #[inline]
                #[must_use]
                #[track_caller]
                pub fn sample(self, sampler: Sampler, $($arg: $ty),*) -> Vec4 {
                    let detail = detail(self.texture(), $place, Location::caller());
                    sampling::sample(self.texture(), &sampler.0, $place, detail)
                }
                /// The same with `bias` added to the level of detail, from -16 to 15.99.
                #[inline]
                #[must_use]
                #[track_caller]
                pub fn sample_bias(self, sampler: Sampler, $($arg: $ty,)* bias: f32) -> Vec4 {
                    let detail = detail(self.texture(), $place, Location::caller());
                    sampling::sample(self.texture(), &sampler.0, $place, detail + bias)
                }
                /// A filtered value at a level of detail: 0 is the largest level, and between two
                /// levels the sampler says what is taken.
                #[inline]
                #[must_use]
                pub fn sample_level(self, sampler: Sampler, $($arg: $ty,)* level: f32) -> Vec4 {
                    sampling::sample(self.texture(), &sampler.0, $place, level)
                }
                /// A filtered value at the level of detail of given derivatives of the coordinates
                /// along x and y of the target. An implementation may find a larger level of detail:
                /// up to half a level where a gradient is along an axis, more where it is not.
                #[inline]
                #[must_use]
                pub fn sample_gradient(
                    self,
                    sampler: Sampler,
                    $($arg: $ty,)*
                    dx: $gradient,
                    dy: $gradient,
                ) -> Vec4 {
                    let detail = sampling::detail(self.texture(), $place, $extend(dx), $extend(dy));
                    sampling::sample(self.texture(), &sampler.0, $place, detail)
                }
            }
        )* };
    }
    samples! {
        () Texture2d<'_>: (uv: Vec2), Vec2, flat(uv, 0), |d: Vec2| d.extend(0.0);
        () Texture2dArray<'_>: (uv: Vec2, layer: u32), Vec2, flat(uv, layer), |d: Vec2| d.extend(0.0);
        () Texture3d<'_>: (uvw: Vec3), Vec3, volume(uvw, [0; 3]), |d| d;
        (<const X: i32, const Y: i32, const Z: i32>) Shifted<Texture3d<'_>, X, Y, Z>: (uvw: Vec3), Vec3, volume(uvw, [X, Y, Z]), |d| d;
        () TextureCube<'_>: (direction: Vec3), Vec3, cube(direction, 0), |d| d;
        () TextureCubeArray<'_>: (direction: Vec3, cube_index: u32), Vec3, cube(direction, cube_index), |d| d;
        (<const X: i32, const Y: i32>) Shifted<Texture2d<'_>, X, Y>: (uv: Vec2), Vec2, shifted(uv, 0, [X, Y]), |d: Vec2| d.extend(0.0);
        (<const X: i32, const Y: i32>) Shifted<Texture2dArray<'_>, X, Y>: (uv: Vec2, layer: u32), Vec2, shifted(uv, layer, [X, Y]), |d: Vec2| d.extend(0.0);
    }

    macro_rules! gathers {
        ($(($($of:tt)*) $name:ty, $sampler:ty: ($($arg:ident: $ty:ty),*), $place:expr => $value:ty, $gather:expr;)*) => { $(
            impl $($of)* $name {
                /// Channel `CHANNEL` (0 to 3) of the four texels of level 0 that a linear filter
                /// reads: lower left, lower right, upper right, upper left, where the first row is
                /// the upper one; of a cube, on the face that the direction hits. Which four they are is rounded to 8 bits on hardware: stay away
                /// from the middle of texels.
                #[inline]
                #[must_use]
                pub fn gather<const CHANNEL: u32>(self, sampler: $sampler, $($arg: $ty),*) -> $value {
                    const { assert!(CHANNEL < 4, "a texel has channels 0 to 3") };
                    $gather(self.texture(), &sampler.0, $place, CHANNEL as usize)
                }
            }
        )* };
    }
    gathers! {
        () Texture2d<'_>, Sampler: (uv: Vec2), flat(uv, 0) => Vec4, sampling::gather;
        () Texture2d<'_, u32>, NonFilteringSampler: (uv: Vec2), flat(uv, 0) => UVec4, sampling::gather_integers;
        () Texture2d<'_, i32>, NonFilteringSampler: (uv: Vec2), flat(uv, 0) => IVec4, gather_signed;
        () Texture2dArray<'_>, Sampler: (uv: Vec2, layer: u32), flat(uv, layer) => Vec4, sampling::gather;
        () Texture2dArray<'_, u32>, NonFilteringSampler: (uv: Vec2, layer: u32), flat(uv, layer) => UVec4, sampling::gather_integers;
        () Texture2dArray<'_, i32>, NonFilteringSampler: (uv: Vec2, layer: u32), flat(uv, layer) => IVec4, gather_signed;
        () TextureCube<'_>, Sampler: (direction: Vec3), cube(direction, 0) => Vec4, sampling::gather;
        () TextureCube<'_, u32>, NonFilteringSampler: (direction: Vec3), cube(direction, 0) => UVec4, sampling::gather_integers;
        () TextureCube<'_, i32>, NonFilteringSampler: (direction: Vec3), cube(direction, 0) => IVec4, gather_signed;
        () TextureCubeArray<'_>, Sampler: (direction: Vec3, cube_index: u32), cube(direction, cube_index) => Vec4, sampling::gather;
        () TextureCubeArray<'_, u32>, NonFilteringSampler: (direction: Vec3, cube_index: u32), cube(direction, cube_index) => UVec4, sampling::gather_integers;
        () TextureCubeArray<'_, i32>, NonFilteringSampler: (direction: Vec3, cube_index: u32), cube(direction, cube_index) => IVec4, gather_signed;
        (<const X: i32, const Y: i32>) Shifted<Texture2d<'_>, X, Y>, Sampler: (uv: Vec2), shifted(uv, 0, [X, Y]) => Vec4, sampling::gather;
        (<const X: i32, const Y: i32>) Shifted<Texture2dArray<'_>, X, Y>, Sampler: (uv: Vec2, layer: u32), shifted(uv, layer, [X, Y]) => Vec4, sampling::gather;
    }

    /// A channel of four texels of signed integers.
    fn gather_signed(
        texture: &TextureRef<'_>,
        sampler: &crate::native::Sampler,
        place: Place,
        channel: usize,
    ) -> IVec4 {
        sampling::gather_integers(texture, sampler, place, channel).as_ivec4()
    }

    macro_rules! depths {
        ($($name:ty: ($($arg:ident: $ty:ty),*), $place:expr;)*) => { $(
            impl $name {
                /// The depth of the nearest texel, at the level of detail of the fragment: see
                /// [`Texture2d::sample`].
                #[inline]
                #[must_use]
                #[track_caller]
                pub fn sample(self, sampler: NonFilteringSampler, $($arg: $ty),*) -> f32 {
                    let detail = detail(self.texture(), $place, Location::caller());
                    sampling::sample(self.texture(), &sampler.0, $place, detail).x
                }
                /// The same of a level.
                #[inline]
                #[must_use]
                pub fn sample_level(self, sampler: NonFilteringSampler, $($arg: $ty,)* level: u32) -> f32 {
                    sampling::sample(self.texture(), &sampler.0, $place, level as f32).x
                }
                /// The depths of the four texels of level 0 that a linear filter would read, in the order of
                /// [`Texture2d::gather`].
                #[inline]
                #[must_use]
                pub fn gather(self, sampler: NonFilteringSampler, $($arg: $ty),*) -> Vec4 {
                    sampling::gather(self.texture(), &sampler.0, $place, 0)
                }
            }
        )* };
    }
    depths! {
        DepthTexture2d<'_>: (uv: Vec2), flat(uv, 0);
        DepthTexture2dArray<'_>: (uv: Vec2, layer: u32), flat(uv, layer);
        DepthTextureCube<'_>: (direction: Vec3), cube(direction, 0);
        DepthTextureCubeArray<'_>: (direction: Vec3, cube_index: u32), cube(direction, cube_index);
    }

    macro_rules! comparisons {
        ($(($($of:tt)*) $name:ty: ($($arg:ident: $ty:ty),*), $place:expr;)*) => { $(
            impl $($of)* $name {
                /// Compares `reference` with the texels that the sampler reads, reference first,
                /// and filters how many hold: from 0 to 1. At the level of detail of the fragment,
                /// see [`Texture2d::sample`].
                #[inline]
                #[must_use]
                #[track_caller]
                pub fn compare(
                    self,
                    sampler: ComparisonSampler,
                    $($arg: $ty,)*
                    reference: f32,
                ) -> f32 {
                    let detail = detail(self.texture(), $place, Location::caller());
                    sampling::compare(self.texture(), &sampler.0, $place, reference, detail)
                }
                /// The same at level 0, in every stage. (No language compares at other levels that
                /// all of them have.)
                #[inline]
                #[must_use]
                pub fn compare_level_zero(
                    self,
                    sampler: ComparisonSampler,
                    $($arg: $ty,)*
                    reference: f32,
                ) -> f32 {
                    sampling::compare(self.texture(), &sampler.0, $place, reference, 0.0)
                }
            }
        )* };
    }
    comparisons! {
        () DepthTexture2d<'_>: (uv: Vec2), flat(uv, 0);
        () DepthTexture2dArray<'_>: (uv: Vec2, layer: u32), flat(uv, layer);
        () DepthTextureCube<'_>: (direction: Vec3), cube(direction, 0);
        () DepthTextureCubeArray<'_>: (direction: Vec3, cube_index: u32), cube(direction, cube_index);
        (<const X: i32, const Y: i32>) Shifted<DepthTexture2d<'_>, X, Y>: (uv: Vec2), shifted(uv, 0, [X, Y]);
        (<const X: i32, const Y: i32>) Shifted<DepthTexture2dArray<'_>, X, Y>: (uv: Vec2, layer: u32), shifted(uv, layer, [X, Y]);
    }

    macro_rules! compared_gathers {
        ($(($($of:tt)*) $name:ty: ($($arg:ident: $ty:ty),*), $place:expr;)*) => { $(
            impl $($of)* $name {
                /// Whether `reference` compares with each of the four texels of level 0 that a
                /// linear filter reads, 1 or 0, in the order of [`Texture2d::gather`].
                #[inline]
                #[must_use]
                pub fn gather_compare(
                    self,
                    sampler: ComparisonSampler,
                    $($arg: $ty,)*
                    reference: f32,
                ) -> Vec4 {
                    sampling::gather_compare(self.texture(), &sampler.0, $place, reference)
                }
            }
        )* };
    }
    compared_gathers! {
        () DepthTexture2d<'_>: (uv: Vec2), flat(uv, 0);
        () DepthTexture2dArray<'_>: (uv: Vec2, layer: u32), flat(uv, layer);
        () DepthTextureCube<'_>: (direction: Vec3), cube(direction, 0);
        () DepthTextureCubeArray<'_>: (direction: Vec3, cube_index: u32), cube(direction, cube_index);
        (<const X: i32, const Y: i32>) Shifted<DepthTexture2d<'_>, X, Y>: (uv: Vec2), shifted(uv, 0, [X, Y]);
        (<const X: i32, const Y: i32>) Shifted<DepthTexture2dArray<'_>, X, Y>: (uv: Vec2, layer: u32), shifted(uv, layer, [X, Y]);
    }

    impl<T: Channel> Texture1d<'_, T> {
        /// Texels.
        #[inline]
        #[must_use]
        pub fn size(self) -> u32 {
            self.0.size[0]
        }
        /// The texel at `at`, which must lie inside; see [`Texture2d::load`].
        #[inline]
        #[must_use]
        #[track_caller]
        pub fn load(self, at: u32) -> T::Texel {
            sanitize::look_for_texel(&self.0, [at, 0, 0], 0, 0, 0, Location::caller());
            T::load(&self.0, [at, 0, 0], 0, 0, 0)
        }
    }

    impl Texture1d<'_> {
        /// A filtered value; see [`Texture2d::sample`]. In fragment kernels only: not every language
        /// samples a texture of one dimension at a level.
        #[inline]
        #[must_use]
        #[track_caller]
        pub fn sample(self, sampler: Sampler, u: f32) -> Vec4 {
            let place = Place::Flat {
                at: Vec3::new(u, 0.0, 0.0),
                dimensions: 1,
                layer: 0,
                shift: [0; 3],
            };
            let detail = detail(&self.0, place, Location::caller());
            sampling::sample(&self.0, &sampler.0, place, detail)
        }
    }

    macro_rules! multisampled {
        ($(($($of:tt)*) $name:ty: $value:ty, $load:expr;)*) => { $(
            impl $($of)* $name {
                /// Width and height in texels.
                #[inline]
                #[must_use]
                pub fn size(self) -> UVec2 {
                    UVec3::from_array(self.0.size).truncate()
                }
                /// Samples of a texel.
                #[inline]
                #[must_use]
                pub fn samples(self) -> u32 {
                    self.0.samples
                }
                /// One sample of the texel at `at`; both must exist.
                #[inline]
                #[must_use]
                #[track_caller]
                pub fn load(self, at: UVec2, sample: u32) -> $value {
                    sanitize::look_for_texel(&self.0, [at.x, at.y, 0], 0, 0, sample, Location::caller());
                    $load(&self.0, [at.x, at.y, 0], 0, 0, sample)
                }
            }
        )* };
    }
    multisampled! {
        (<T: Channel>) Texture2dMultisampled<'_, T>: T::Texel, T::load;
        () DepthTexture2dMultisampled<'_>: f32, depth;
    }
}

/// A value that a storage texture can hold in one texel.
pub trait Texel: Copy {
    /// All four channels.
    type Channels: Default;
    /// To all four channels; those that the value lacks are 0, alpha 1.
    fn channels(self) -> Self::Channels;
    /// The value of these channels.
    fn of(channels: Self::Channels) -> Self;
}

macro_rules! texels {
    ($($value:ty, $channels:ty: |$it:ident| $all:expr, |$them:ident| $first:expr;)*) => { $(
        impl Texel for $value {
            type Channels = $channels;
            #[inline(always)]
            fn channels(self) -> $channels {
                let $it = self;
                $all
            }
            #[inline(always)]
            fn of($them: $channels) -> Self {
                $first
            }
        }
    )* };
}

texels! {
    f32, Vec4: |x| Vec4::new(x, 0.0, 0.0, 1.0), |v| v.x;
    Vec2, Vec4: |v| Vec4::new(v.x, v.y, 0.0, 1.0), |v| Vec2::new(v.x, v.y);
    Vec3, Vec4: |v| v.extend(1.0), |v| v.truncate();
    Vec4, Vec4: |v| v, |v| v;
    u32, UVec4: |x| UVec4::new(x, 0, 0, 1), |v| v.x;
    UVec2, UVec4: |v| UVec4::new(v.x, v.y, 0, 1), |v| UVec2::new(v.x, v.y);
    UVec4, UVec4: |v| v, |v| v;
    i32, IVec4: |x| IVec4::new(x, 0, 0, 1), |v| v.x;
    IVec2, IVec4: |v| IVec4::new(v.x, v.y, 0, 1), |v| IVec2::new(v.x, v.y);
    IVec4, IVec4: |v| v, |v| v;
}
