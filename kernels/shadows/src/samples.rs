//! Textures of several samples in each texel, or of one: WebGL 2 and GLSL ES 3.00 have no multisampled textures that a
//! shader reads. A kernel that looks at samples is written once, and is two kernels.

use core::ops::{AddAssign, Div};

use hankel_dsl::glam::{UVec2, Vec4};
use hankel_dsl::{Real, Texture2d, Texture2dMultisampled};

/// The mean over a texel's samples.
#[inline(always)]
pub(crate) fn mean_of<T: AddAssign + Div<f32, Output = T>>(
    samples: u32,
    sample: impl Fn(u32) -> T,
) -> T {
    let mut sum = sample(0);
    let mut i = 1;
    while i < samples {
        sum += sample(i);
        i += 1;
    }
    sum / samples as f32
}

/// A texture of several samples in each texel, or of one.
pub(crate) trait Samples: Copy {
    /// Width and height in texels.
    fn size(self) -> UVec2;

    /// Sample `i` of a texel; of one sample, always that.
    fn load_sample(self, at: UVec2, i: u32) -> Vec4;

    /// The mean of what `of` gives for the depth in each sample of a texel; depths beyond [0, 1] are moved to its ends.
    #[inline(always)]
    fn mean_of_depths<T: AddAssign + Div<f32, Output = T>>(
        self,
        at: UVec2,
        samples: u32,
        of: impl Fn(f32) -> T,
    ) -> T {
        mean_of(samples, |i| of(Real::saturate(self.load_sample(at, i).x)))
    }
}

impl Samples for Texture2dMultisampled<'_> {
    #[inline(always)]
    fn size(self) -> UVec2 {
        <Texture2dMultisampled<'_>>::size(self)
    }

    #[inline(always)]
    fn load_sample(self, at: UVec2, i: u32) -> Vec4 {
        self.load(at, i)
    }
}

impl Samples for Texture2d<'_> {
    #[inline(always)]
    fn size(self) -> UVec2 {
        <Texture2d<'_>>::size(self)
    }

    #[inline(always)]
    fn load_sample(self, at: UVec2, _: u32) -> Vec4 {
        self.load(at)
    }

    #[inline(always)]
    fn mean_of_depths<T: AddAssign + Div<f32, Output = T>>(
        self,
        at: UVec2,
        _: u32,
        of: impl Fn(f32) -> T,
    ) -> T {
        of(Real::saturate(self.load(at).x))
    }
}

/// A kernel that looks at samples, and its counterpart for textures of one sample, which has `_single` after the first
/// word of its name.
///
/// The names of these textures follow the other parameters, and are parameters of both after those; then the name by
/// which the body has the number of samples, which is a constant of the first kernel, and 1 in the other. A body that
/// does not ask has none. What one of the two kernels alone says of itself stands in brackets after its name.
macro_rules! of_samples {
    (
        $(#[doc = $doc:literal])*
        #[kernel($($how:tt)*)]
        $several:ident $([$($several_how:tt)*])?,
        $single:ident $([$($single_how:tt)*])?,
        ($($params:tt)*) $(-> $returned:tt)?,
        |$($texture:ident),+; $samples:ident| { $($body:tt)* }
    ) => {
        $(#[doc = $doc])*
        #[kernel($($how)* $(, $($several_how)*)?)]
        pub fn $several(
            $($params)*
            #[constant(id = 0, default = 4)]
            #[values(1, 4)]
            $samples: u32,
            $(#[texture] $texture: hankel_dsl::Texture2dMultisampled<'_>,)+
        ) $(-> $returned)? {
            $($body)*
        }

        $(#[doc = $doc])*
        ///
        /// For textures of one sample.
        #[kernel($($how)* $(, $($single_how)*)?)]
        pub fn $single(
            $($params)*
            $(#[texture] $texture: hankel_dsl::Texture2d<'_>,)+
        ) $(-> $returned)? {
            let $samples = 1;
            $($body)*
        }
    };
    (
        $(#[doc = $doc:literal])*
        #[kernel($($how:tt)*)]
        $several:ident,
        $single:ident,
        ($($params:tt)*) $(-> $returned:tt)?,
        |$($texture:ident),+| { $($body:tt)* }
    ) => {
        $(#[doc = $doc])*
        #[kernel($($how)*)]
        pub fn $several(
            $($params)*
            $(#[texture] $texture: hankel_dsl::Texture2dMultisampled<'_>,)+
        ) $(-> $returned)? {
            $($body)*
        }

        $(#[doc = $doc])*
        ///
        /// For textures of one sample.
        #[kernel($($how)*)]
        pub fn $single(
            $($params)*
            $(#[texture] $texture: hankel_dsl::Texture2d<'_>,)+
        ) $(-> $returned)? {
            $($body)*
        }
    };
}
