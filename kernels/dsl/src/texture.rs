//! Textures and samplers as a kernel sees them. On both sides a value of a few words that is
//! passed by copy; coordinates beyond the edge read the nearest texel with `load`.

use glam::{UVec2, UVec3, Vec2, Vec4};

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
    pub type Sampled2d = Image!(2D, type=f32, sampled);
    pub type Sampled2dMultisampled = Image!(2D, type=f32, sampled, multisampled);
    pub type Sampled3d = Image!(3D, type=f32, sampled);

    // One for each texel format that a kernel can write.
    pub type Storage2dR32Float = Image!(2D, format = r32f, sampled = false);
    pub type Storage2dRgba32Float = Image!(2D, format = rgba32f, sampled = false);
    pub type Storage2dRgba16Float = Image!(2D, format = rgba16f, sampled = false);
    pub type Storage2dRgba16Unorm = Image!(2D, format = rgba16, sampled = false);
    pub type Storage2dRgba8Unorm = Image!(2D, format = rgba8, sampled = false);
    pub type Storage2dR32Uint = Image!(2D, format = r32ui, sampled = false);
    pub type Storage2dRgba32Uint = Image!(2D, format = rgba32ui, sampled = false);
    pub type Storage3dR32Float = Image!(3D, format = r32f, sampled = false);
    pub type Storage3dRgba32Float = Image!(3D, format = rgba32f, sampled = false);
    pub type Storage3dRgba16Float = Image!(3D, format = rgba16f, sampled = false);
    pub type Storage3dRgba16Unorm = Image!(3D, format = rgba16, sampled = false);
    pub type Storage3dRgba8Unorm = Image!(3D, format = rgba8, sampled = false);
    pub type Storage3dR32Uint = Image!(3D, format = r32ui, sampled = false);
    pub type Storage3dRgba32Uint = Image!(3D, format = rgba32ui, sampled = false);
}
#[cfg(target_arch = "spirv")]
use image::{Sampled2d, Sampled2dMultisampled, Sampled3d};

/// A filterable texture of two dimensions.
#[derive(Clone, Copy)]
pub struct Texture2d<'a>(
    #[cfg(target_arch = "spirv")] &'a Sampled2d,
    #[cfg(not(target_arch = "spirv"))] native::TextureRef<'a>,
);

/// A texture of two dimensions with several samples in each texel.
#[derive(Clone, Copy)]
pub struct Texture2dMultisampled<'a>(
    #[cfg(target_arch = "spirv")] &'a Sampled2dMultisampled,
    #[cfg(not(target_arch = "spirv"))] native::TextureRef<'a>,
);

/// A filterable texture of three dimensions.
#[derive(Clone, Copy)]
pub struct Texture3d<'a>(
    #[cfg(target_arch = "spirv")] &'a Sampled3d,
    #[cfg(not(target_arch = "spirv"))] native::TextureRef<'a>,
);

/// How a texture is filtered between texels and beyond its edge.
#[derive(Clone, Copy)]
pub struct Sampler(
    #[cfg(target_arch = "spirv")] spirv_std::Sampler,
    #[cfg(not(target_arch = "spirv"))] native::Sampler,
);

#[cfg(target_arch = "spirv")]
#[allow(missing_docs, reason = "documented on the host's side")]
mod spirv {
    use super::*;
    use spirv_std::image::{ImageWithMethods, sample_with};

    impl<'a> Texture2d<'a> {
        #[doc(hidden)]
        #[inline(always)]
        pub fn new(image: &'a Sampled2d) -> Self {
            Self(image)
        }
        #[inline(always)]
        pub fn size(self) -> UVec2 {
            self.0.query_size_lod(0)
        }
        #[inline(always)]
        pub fn load(self, at: UVec2) -> Vec4 {
            self.0.fetch_with_lod(at, 0)
        }
        #[inline(always)]
        pub fn sample(self, sampler: Sampler, uv: Vec2) -> Vec4 {
            self.0.sample_by_lod(sampler.0, uv, 0.0)
        }
        #[inline(always)]
        pub fn gather<const CHANNEL: u32>(self, sampler: Sampler, uv: Vec2) -> Vec4 {
            self.0.gather(sampler.0, uv, CHANNEL)
        }
    }

    impl<'a> Texture2dMultisampled<'a> {
        #[doc(hidden)]
        #[inline(always)]
        pub fn new(image: &'a Sampled2dMultisampled) -> Self {
            Self(image)
        }
        #[inline(always)]
        pub fn size(self) -> UVec2 {
            self.0.query_size()
        }
        #[inline(always)]
        pub fn load(self, at: UVec2, sample: u32) -> Vec4 {
            self.0
                .fetch_with(at, sample_with::sample_index(sample as i32))
        }
    }

    impl<'a> Texture3d<'a> {
        #[doc(hidden)]
        #[inline(always)]
        pub fn new(image: &'a Sampled3d) -> Self {
            Self(image)
        }
        #[inline(always)]
        pub fn size(self) -> UVec3 {
            self.0.query_size_lod(0)
        }
        #[inline(always)]
        pub fn load(self, at: UVec3) -> Vec4 {
            self.0.fetch_with_lod(at, 0)
        }
        #[inline(always)]
        pub fn sample(self, sampler: Sampler, uvw: glam::Vec3) -> Vec4 {
            self.0.sample_by_lod(sampler.0, uvw, 0.0)
        }
    }

    impl Sampler {
        #[doc(hidden)]
        #[inline(always)]
        pub fn new(sampler: &spirv_std::Sampler) -> Self {
            Self(*sampler)
        }
    }
}

#[cfg(not(target_arch = "spirv"))]
mod host {
    use super::{Sampler, Texture2d, Texture2dMultisampled, Texture3d, UVec2, UVec3, Vec2, Vec4};
    use crate::native::{self, Address, Filter, TextureRef};
    use glam::Vec3;

    impl<'a> Texture2d<'a> {
        #[doc(hidden)]
        #[must_use]
        pub fn new(texture: TextureRef<'a>) -> Self {
            Self(texture)
        }
        /// Width and height in texels.
        #[inline]
        #[must_use]
        pub fn size(self) -> UVec2 {
            UVec2::new(self.0.size[0], self.0.size[1])
        }
        /// The texel at `at`, which must lie inside. (Natively the nearest one is read otherwise;
        /// on a GPU it is the bounds-check policy's choice.)
        #[inline]
        #[must_use]
        pub fn load(self, at: UVec2) -> Vec4 {
            texel(&self.0, UVec3::new(at.x, at.y, 0), 0)
        }
        /// A filtered value at `uv`, where (0, 0) is the first texel's outer corner and (1, 1) the
        /// last one's. Hardware may round the interpolation weights to 8 bits.
        #[inline]
        #[must_use]
        pub fn sample(self, sampler: Sampler, uv: Vec2) -> Vec4 {
            filter(&self.0, sampler.0, Vec3::new(uv.x, uv.y, 0.5))
        }
        /// Channel `CHANNEL` (0 to 3) of the four texels that a linear filter reads at `uv`: lower
        /// left, lower right, upper right, upper left, where the first row is the upper one. Which
        /// four they are is rounded to 8 bits on hardware: stay away from the middle of texels.
        #[inline]
        #[must_use]
        pub fn gather<const CHANNEL: u32>(self, sampler: Sampler, uv: Vec2) -> Vec4 {
            const { assert!(CHANNEL < 4, "a texel has channels 0 to 3") };
            let size = [self.0.size[0], self.0.size[1]];
            let base = [0, 1].map(|d| (uv[d] * size[d] as f32 - 0.5).floor() as i64);
            let tap = |dx: i64, dy: i64| {
                let at = [base[0] + dx, base[1] + dy];
                let at = [0, 1].map(|d| wrap(at[d], size[d], sampler.0.address));
                texel(&self.0, UVec3::new(at[0], at[1], 0), 0)[CHANNEL as usize]
            };
            Vec4::new(tap(0, 1), tap(1, 1), tap(1, 0), tap(0, 0))
        }
    }

    impl<'a> Texture2dMultisampled<'a> {
        #[doc(hidden)]
        #[must_use]
        pub fn new(texture: TextureRef<'a>) -> Self {
            Self(texture)
        }
        /// Width and height in texels.
        #[inline]
        #[must_use]
        pub fn size(self) -> UVec2 {
            UVec2::new(self.0.size[0], self.0.size[1])
        }
        /// One sample of the texel at `at`; both must exist.
        #[inline]
        #[must_use]
        pub fn load(self, at: UVec2, sample: u32) -> Vec4 {
            texel(&self.0, UVec3::new(at.x, at.y, 0), sample)
        }
    }

    impl<'a> Texture3d<'a> {
        #[doc(hidden)]
        #[must_use]
        pub fn new(texture: TextureRef<'a>) -> Self {
            Self(texture)
        }
        /// Width, height and depth in texels.
        #[inline]
        #[must_use]
        pub fn size(self) -> UVec3 {
            UVec3::from_array(self.0.size)
        }
        /// The texel at `at`, which must lie inside.
        #[inline]
        #[must_use]
        pub fn load(self, at: UVec3) -> Vec4 {
            texel(&self.0, at, 0)
        }
        /// A filtered value; see [`Texture2d::sample`].
        #[inline]
        #[must_use]
        pub fn sample(self, sampler: Sampler, uvw: Vec3) -> Vec4 {
            filter(&self.0, sampler.0, uvw)
        }
    }

    impl Sampler {
        #[doc(hidden)]
        #[must_use]
        pub fn new(sampler: native::Sampler) -> Self {
            Self(sampler)
        }
    }

    #[inline]
    fn texel(t: &TextureRef<'_>, at: UVec3, sample: u32) -> Vec4 {
        let size = UVec3::from_array(t.size);
        let at = at.min(size - UVec3::ONE);
        let sample = sample.min(t.samples - 1);
        let index = ((at.z as usize * size.y as usize + at.y as usize) * size.x as usize
            + at.x as usize)
            * t.samples as usize
            + sample as usize;
        t.format.load(&t.bytes[index * t.format.bytes()..])
    }

    /// The coordinate of a texel that may lie beyond the edge.
    #[inline]
    fn wrap(i: i64, size: u32, address: Address) -> u32 {
        let size = i64::from(size);
        let i = match address {
            Address::ClampToEdge => i.clamp(0, size - 1),
            Address::Repeat => i.rem_euclid(size),
        };
        // In 0..size, which came from a u32.
        i as u32
    }

    /// Linear or nearest filtering as the Vulkan specification defines it ("Texel Filtering").
    fn filter(t: &TextureRef<'_>, sampler: native::Sampler, uvw: Vec3) -> Vec4 {
        let size = t.size;
        let at = uvw.to_array();
        let mut base = [0_i64; 3];
        let mut weight = [0.0_f32; 3];
        for d in 0..3 {
            let x = at[d] * size[d] as f32;
            let x = if sampler.filter == Filter::Linear {
                x - 0.5
            } else {
                x
            };
            let x = match sampler.deviation.offset[d] {
                0 => x,
                n => x + f32::from(n) / 1024.0,
            };
            let floor = x.floor();
            base[d] = floor as i64;
            weight[d] = if sampler.filter == Filter::Linear {
                x - floor
            } else {
                0.0
            };
            if size[d] == 1 && d == 2 {
                (base[d], weight[d]) = (0, 0.0);
            }
        }
        let tap = |dx: i64, dy: i64, dz: i64| {
            let at = UVec3::new(
                wrap(base[0] + dx, size[0], sampler.address),
                wrap(base[1] + dy, size[1], sampler.address),
                wrap(base[2] + dz, size[2], sampler.address),
            );
            texel(t, at, 0)
        };
        if sampler.filter == Filter::Nearest {
            return tap(0, 0, 0);
        }
        let rounded = |value: Vec4| {
            let channels = sampler.deviation.channels;
            if channels == [0; 4] {
                return value;
            }
            let mut largest = Vec4::ZERO;
            for corner in 0..8 {
                let tap = tap(corner & 1, corner >> 1 & 1, corner >> 2);
                largest = largest.max(tap.abs());
            }
            let steps = channels.map(|n| f32::from(n) / 16_777_216.0);
            value + largest * Vec4::from_array(steps)
        };
        let slice = |dz: i64| {
            let near = tap(0, 0, dz) * (1.0 - weight[0]) + tap(1, 0, dz) * weight[0];
            let far = tap(0, 1, dz) * (1.0 - weight[0]) + tap(1, 1, dz) * weight[0];
            near * (1.0 - weight[1]) + far * weight[1]
        };
        let front = slice(0);
        rounded(if weight[2] == 0.0 {
            front
        } else {
            front * (1.0 - weight[2]) + slice(1) * weight[2]
        })
    }
}

/// A value that a storage texture can hold in one texel.
pub trait Texel: Copy {
    /// All four channels; those that the value lacks are 0, alpha 1.
    type Channels;
    /// To all four channels.
    fn channels(self) -> Self::Channels;
}

impl Texel for f32 {
    type Channels = Vec4;
    #[inline(always)]
    fn channels(self) -> Vec4 {
        Vec4::new(self, 0.0, 0.0, 1.0)
    }
}

impl Texel for Vec4 {
    type Channels = Vec4;
    #[inline(always)]
    fn channels(self) -> Vec4 {
        self
    }
}

impl Texel for u32 {
    type Channels = glam::UVec4;
    #[inline(always)]
    fn channels(self) -> glam::UVec4 {
        glam::UVec4::new(self, 0, 0, 1)
    }
}

impl Texel for glam::UVec4 {
    type Channels = Self;
    #[inline(always)]
    fn channels(self) -> Self {
        self
    }
}
