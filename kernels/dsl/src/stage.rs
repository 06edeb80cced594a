//! What vertex and fragment kernels say beyond a map from their inputs to their outputs: a depth of
//! their own, how values are interpolated, fragments that are dropped, derivatives.

use glam::{Vec2, Vec3, Vec4};

/// The depth of a fragment, from 0 to 1, in place of the one that it was rasterised with. A fragment
/// kernel returns it by itself or beside colours: `-> (Vec4, Depth)`. What lies beyond 0 and 1 is
/// clamped by the host and by most devices; Vulkan does not promise it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Depth(pub f32);

/// A value that is not interpolated between vertices: that of one vertex of the primitive. Integers
/// need no `Flat`: they are never interpolated.
///
/// A vertex kernel returns it, `-> (Vec4, Flat<f32>)`, and a fragment kernel takes it,
/// `#[varying] x: Flat<f32>`. Which vertex it is differs: the first one in Direct3D, Vulkan, Metal
/// and WebGPU, the last one in OpenGL; who needs the same everywhere gives all vertices of a
/// primitive the same value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Flat<T>(pub T);

/// A value that is interpolated linearly on the screen, without the perspective's division:
/// `noperspective` of GLSL and HLSL, `@interpolate(linear)` of WGSL. GLSL ES does not have it.
///
/// A vertex kernel returns it, `-> (Vec4, Linear<Vec2>)`, and the fragment kernel takes the same,
/// `#[varying] x: Linear<Vec2>`; also with [`Centroid`] or [`PerSample`] inside, `Linear<Centroid<Vec2>>`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Linear<T>(pub T);

/// A value that is interpolated at a place that lies in the pixel and in its primitive. A pixel's
/// centre may lie beyond an edge of the primitive, where values are extrapolated, if the target has
/// several samples. Both stages say it, as for [`Linear`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Centroid<T>(pub T);

/// A value that is interpolated at each sample of a target with several samples. The fragment kernel
/// then runs once for each sample. Both stages say it, as for [`Linear`]. GLSL ES 3.10 and 3.00 do not have
/// it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PerSample<T>(pub T);

/// Which samples of the pixel a fragment writes, a bit for each, the first sample's the lowest. Samples that
/// its primitive does not cover stay as they are. A fragment kernel returns it beside its colours:
/// `-> (Vec4, SampleMask)`. GLSL ES 3.10 and 3.00 do not have it.
///
/// On the host a pixel has one sample: without the lowest bit nothing of the fragment is written to its
/// targets.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SampleMask(pub u32);

/// How far inside of up to 8 planes a vertex lies. What of a primitive lies outside of a plane, where the interpolated
/// distance is below 0, is clipped. A vertex kernel returns it beside the position: `-> (Vec4, ClipDistances<2>)`.
/// WebGPU and GLSL ES have them where what the manifest `requires` is there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClipDistances<const PLANES: usize>(pub [f32; PLANES]);

impl<const PLANES: usize> ClipDistances<PLANES> {
    /// All of them.
    #[doc(hidden)]
    #[inline(always)]
    #[must_use]
    pub const fn all(self) -> [f32; PLANES] {
        const {
            assert!(
                PLANES >= 1 && PLANES <= 8,
                "a vertex has 1 to 8 clip distances"
            );
        };
        self.0
    }
}

/// A second colour for the first target, which blending may take as a factor ("dual-source blending"): a transmittance of
/// each channel, for example. A fragment kernel with one target returns it beside its colour and of the same type:
/// `-> (Vec4, SecondSource<Vec4>)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SecondSource<T>(pub T);

/// Drops the fragment: nothing of it is written, no colour and no depth.
///
/// In a fragment kernel only. What is computed after it does not run; take derivatives before,
/// since a neighbour that was dropped has none to give.
#[inline(always)]
pub fn discard() -> ! {
    #[cfg(target_arch = "spirv")]
    {
        spirv_std::arch::kill()
    }
    #[cfg(not(target_arch = "spirv"))]
    {
        crate::native::fragment::discard()
    }
}

/// What has derivatives: `f32` and vectors of it.
#[cfg(target_arch = "spirv")]
pub trait Derivative: Copy + spirv_std::arch::Derivative {}

/// What has derivatives: `f32` and vectors of it.
#[cfg(not(target_arch = "spirv"))]
pub trait Derivative: Copy {
    /// As four numbers, zeros behind.
    #[doc(hidden)]
    fn wide(self) -> Vec4;
    /// The first of four numbers.
    #[doc(hidden)]
    fn narrow(wide: Vec4) -> Self;
}

macro_rules! derivative {
    ($($t:ty, $wide:expr, $narrow:expr;)*) => { $(
        impl Derivative for $t {
            #[cfg(not(target_arch = "spirv"))]
            #[inline]
            fn wide(self) -> Vec4 {
                let wide: fn($t) -> Vec4 = $wide;
                wide(self)
            }
            #[cfg(not(target_arch = "spirv"))]
            #[inline]
            fn narrow(wide: Vec4) -> Self {
                let narrow: fn(Vec4) -> $t = $narrow;
                narrow(wide)
            }
        }
    )* };
}

derivative! {
    f32, |x| Vec4::new(x, 0.0, 0.0, 0.0), |v| v.x;
    Vec2, |v| v.extend(0.0).extend(0.0), |v| v.truncate().truncate();
    Vec3, |v| v.extend(0.0), |v| v.truncate();
    Vec4, |v| v, |v| v;
}

#[cfg(not(target_arch = "spirv"))]
use crate::native::fragment::{Axis, Grain, derivative, width};

macro_rules! functions {
    ($($(#[doc = $doc:literal])* $name:ident, $how:ident, $native:expr;)*) => { $(
        $(#[doc = $doc])*
        #[cfg_attr(target_arch = "spirv", inline(always))]
        #[cfg_attr(not(target_arch = "spirv"), track_caller)]
        #[must_use]
        pub fn $name<T: Derivative>(value: T) -> T {
            #[cfg(target_arch = "spirv")]
            {
                spirv_std::arch::Derivative::$how(value)
            }
            #[cfg(not(target_arch = "spirv"))]
            {
                let native: fn(Vec4, &'static core::panic::Location<'static>) -> Vec4 = $native;
                T::narrow(native(value.wide(), core::panic::Location::caller()))
            }
        }
    )* };
}

functions! {
    /// How much a value grows from one pixel to the next along x: the difference between two
    /// fragments of a quad of 2 x 2.
    ///
    /// In a fragment kernel, and in control flow that is the same for the four fragments of a quad;
    /// the native device reports other uses. Each device chooses between [`dpdx_coarse`] and
    /// [`dpdx_fine`].
    dpdx, dfdx, |v, at| derivative(v, Axis::X, Grain::Fine, at);
    /// As [`dpdx`], along y. Rows are counted downwards in Direct3D, Vulkan, Metal and WebGPU; in
    /// OpenGL upwards.
    dpdy, dfdy, |v, at| derivative(v, Axis::Y, Grain::Fine, at);
    /// `|dpdx| + |dpdy|`.
    fwidth, fwidth, |v, at| width(v, Grain::Fine, at);
    /// The difference along x of two fragments of the quad, the same for all four of them: of the
    /// first row on the host and most devices. MSL and GLSL ES have no such function.
    dpdx_coarse, dfdx_coarse, |v, at| derivative(v, Axis::X, Grain::Coarse, at);
    /// The difference along y of two fragments of the quad, the same for all four of them: of the
    /// first column on the host and most devices. MSL and GLSL ES have no such function.
    dpdy_coarse, dfdy_coarse, |v, at| derivative(v, Axis::Y, Grain::Coarse, at);
    /// `|dpdx_coarse| + |dpdy_coarse|`.
    fwidth_coarse, fwidth_coarse, |v, at| width(v, Grain::Coarse, at);
    /// The difference along x of the fragment and its neighbour in the quad's row. MSL and GLSL ES
    /// have no such function.
    dpdx_fine, dfdx_fine, |v, at| derivative(v, Axis::X, Grain::Fine, at);
    /// The difference along y of the fragment and its neighbour in the quad's column. MSL and GLSL
    /// ES have no such function.
    dpdy_fine, dfdy_fine, |v, at| derivative(v, Axis::Y, Grain::Fine, at);
    /// `|dpdx_fine| + |dpdy_fine|`.
    fwidth_fine, fwidth_fine, |v, at| width(v, Grain::Fine, at);
}
