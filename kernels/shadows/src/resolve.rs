//! From depth to filterable moments: each sample's depth gives a moment vector, the texel stores their mean
//! (\[BHS\], lecture, "Generate a moment shadow map", step 2). Here are four power moments.
//!
//! Depth has several samples in each texel, or one: WebGL 2 and GLSL ES 3.00 have no multisampled textures. Each way to
//! store a texel is a function of either, and has a kernel for each, `resolve_…` and `resolve_single_…`.

use core::ops::{AddAssign, Div};

use hankel_dsl::glam::{UVec2, Vec4};
use hankel_dsl::{Real, Texture2d, Texture2dMultisampled, kernel};
use hankel_moments::{Moments4, Quantized4, quantize_symmetric_4, quantize_unit_4};

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

/// Depths of the texels of a map.
pub(crate) trait Depths: Copy {
    /// The mean of what the samples of a texel give; depths beyond [0, 1] are moved to its ends.
    fn mean<T: AddAssign + Div<f32, Output = T>>(
        self,
        at: UVec2,
        samples: u32,
        moments: impl Fn(f32) -> T,
    ) -> T;
}

impl Depths for Texture2dMultisampled<'_> {
    #[inline(always)]
    fn mean<T: AddAssign + Div<f32, Output = T>>(
        self,
        at: UVec2,
        samples: u32,
        moments: impl Fn(f32) -> T,
    ) -> T {
        mean_of(samples, |i| moments(Real::saturate(self.load(at, i).x)))
    }
}

/// Of one sample.
impl Depths for Texture2d<'_> {
    #[inline(always)]
    fn mean<T: AddAssign + Div<f32, Output = T>>(
        self,
        at: UVec2,
        _: u32,
        moments: impl Fn(f32) -> T,
    ) -> T {
        moments(Real::saturate(self.load(at).x))
    }
}

/// Two kernels that store a texel of depths alike: one for depths of several samples, one for depths of one sample.
///
/// What a texel holds is a function of [`Depths`], the texel's place, the number of samples and its uniforms. What
/// follows are the words of `#[kernel]`, which are the same for both; a kernel whose fragment form is another one's
/// names that in brackets.
macro_rules! resolves {
    (
        $(#[doc = $doc:literal])*
        $several:ident $([fragment = $form:ident])?,
        $single:ident $([fragment = $single_form:ident])?,
        $of:ident($($(#[$($about:tt)*])* $uniform:ident: &$uniform_type:ident),*) -> $texel:tt,
        $($how:tt)*
    ) => {
        $(#[doc = $doc])*
        #[kernel(compute, threads(8, 8), $(forms(fragment = $form),)? $($how)*)]
        pub fn $several(
            #[index] at: UVec2,
            #[constant(id = 0, default = 4)]
            #[values(1, 4)]
            samples: u32,
            $(#[uniform] $(#[$($about)*])* $uniform: &$uniform_type,)*
            #[texture] depth: Texture2dMultisampled<'_>,
        ) -> $texel {
            $of(depth, at, samples $(, $uniform)*)
        }

        $(#[doc = $doc])*
        /// Depths have one sample.
        #[kernel(compute, threads(8, 8), $(forms(fragment = $single_form),)? $($how)*)]
        pub fn $single(
            #[index] at: UVec2,
            $(#[uniform] $(#[$($about)*])* $uniform: &$uniform_type,)*
            #[texture] depth: Texture2d<'_>,
        ) -> $texel {
            $of(depth, at, 1 $(, $uniform)*)
        }
    };
}
pub(crate) use resolves;

#[inline(always)]
fn quantized(q: Quantized4<f32>) -> Vec4 {
    Vec4::new(q.r, q.g, q.b, q.a)
}

/// Depth in [0, 1] as a depth in [-1, 1].
#[inline(always)]
fn symmetric(z: f32) -> Moments4<f32> {
    Moments4::of_depth(2.0 * z - 1.0)
}

/// Mean of a texel's moments, depths moved to [-1, 1], in the basis optimised for 16 bits.
#[inline(always)]
pub(crate) fn mean_symmetric(depth: impl Depths, at: UVec2, samples: u32) -> Vec4 {
    depth.mean(at, samples, |z| {
        quantized(quantize_symmetric_4(symmetric(z)))
    })
}

/// The same of depths in [0, 1].
#[inline(always)]
fn mean_unit(depth: impl Depths, at: UVec2, samples: u32) -> Vec4 {
    depth.mean(at, samples, |z| {
        quantized(quantize_unit_4(Moments4::of_depth(z)))
    })
}

/// Mean of a texel's moments, depths moved to [-1, 1], as they are.
#[inline(always)]
fn mean_plain(depth: impl Depths, at: UVec2, samples: u32) -> Vec4 {
    depth.mean(at, samples, |z| {
        let m = symmetric(z);
        Vec4::new(m.b1, m.b2, m.b3, m.b4)
    })
}

resolves! {
    /// Mean of a texel's moments, depths in [0, 1], in the basis optimised for 16 bits.
    resolve_unit, resolve_single_unit, mean_unit() -> Vec4,
    texture(rgba16unorm),
    forms(fragment),
    inputs = crate::inputs::maps::depths,
    parity(
        ulp = 0,
        absolute = 1.6e-5,
        why = "sums and products only, then rounding to 1/65535: drivers may round a tie either way, which is one step"
    )
}

resolves! {
    /// Mean of a texel's moments, depths moved to [-1, 1], in the basis optimised for 16 bits.
    resolve_symmetric, resolve_single_symmetric, mean_symmetric() -> Vec4,
    texture(rgba16unorm),
    forms(fragment),
    inputs = crate::inputs::maps::depths,
    parity(
        ulp = 0,
        absolute = 1.6e-5,
        why = "sums and products only, then rounding to 1/65535: drivers may round a tie either way, which is one step"
    )
}

resolves! {
    /// Mean of a texel's moments, depths moved to [-1, 1], as they are, for a 32-bit map.
    resolve_plain, resolve_single_plain, mean_plain() -> Vec4,
    texture(rgba32float),
    forms(fragment),
    inputs = crate::inputs::maps::depths
}
