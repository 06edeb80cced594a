//! Mip levels of filtered maps, and lookup in them with the footprint of a pixel: trilinear, or anisotropic
//! with several places along its longer axis.
//!
//! What maps hold is the mean of something over depths, so the mean of texels is what the map of a coarser
//! level holds: whatever a technique makes of a texel it makes of a texel of any level.
//!
//! Footprints come from the camera and the plane of the surface, not from differences between neighbouring
//! pixels: they are the same on every device, and where a triangle ends, too. Places are sampled one by one,
//! because which ones a sampler takes for an anisotropic lookup is up to the device.

use hankel_dsl::glam::{UVec2, Vec2, Vec3, Vec4};
use hankel_dsl::{Element, Real, Texture2d, kernel, math, to_i32};

use crate::depth::{Transform, row_times_point};
use crate::grid::within;
use crate::shade::{Light, dot, shade_with};

/// The sum of the texels that a texel of the next level covers, each by the share of it that is covered: 2 x 2
/// of even sizes; of odd sizes 3 along an axis, of which the outer ones are shared with the neighbours.
#[inline(always)]
fn halved(at: UVec2, source: Texture2d<'_>) -> Vec4 {
    let size = source.size();
    let (columns, rows) = (2 + (size.x & 1), 2 + (size.y & 1));
    let mut sum = Vec4::ZERO;
    let mut y = 0;
    while y < rows {
        let mut row = Vec4::ZERO;
        let mut x = 0;
        while x < columns {
            let texel = source.load(UVec2::new(
                within((2 * at.x + x) as i32, size.x),
                within((2 * at.y + y) as i32, size.y),
            ));
            row += texel * share(at.x, x, size.x);
            x += 1;
        }
        sum += row * share(at.y, y, size.y);
        y += 1;
    }
    sum
}

/// How much of texel `at` of the next level texel `2 at + tap` of `size` is.
#[inline(always)]
fn share(at: u32, tap: u32, size: u32) -> f32 {
    let half = (size / 2) as f32;
    // In parts of a texel of which `size` make one of the next level.
    let parts = if tap == 0 {
        half - at as f32
    } else if tap == 1 {
        half
    } else {
        at as f32 + 1.0
    };
    if size & 1 == 0 {
        0.5
    } else {
        parts / size as f32
    }
}

/// The next mip level: half of the texels along each axis, rounded down.
#[kernel(
    compute,
    threads(8, 8),
    texture(rgba16unorm, rgba32float),
    forms(fragment),
    inputs = crate::inputs::mips::halved,
    parity(
        ulp = 0,
        absolute = 1.6e-5,
        exact(rgba32float),
        non_finite,
        why = "sums and products only, then rounding to 1/65535: drivers may round a tie either way, which is one step"
    )
)]
pub fn halve(#[index] at: UVec2, #[texture] source: Texture2d<'_>) -> Vec4 {
    halved(at, source)
}

/// The same of four channels of 8 bits.
#[kernel(
    compute,
    threads(8, 8),
    texture(rgba8unorm),
    forms(fragment = halve),
    inputs = crate::inputs::mips::halved,
    parity(
        ulp = 0,
        absolute = 4e-3,
        non_finite,
        why = "sums and products only, then rounding to 1/255: drivers may round a tie either way, which is one step"
    )
)]
pub fn halve_rgba8unorm(#[index] at: UVec2, #[texture] source: Texture2d<'_>) -> Vec4 {
    halved(at, source)
}

/// The same of four 16-bit floats.
#[kernel(
    compute,
    threads(8, 8),
    texture(rgba16float),
    forms(fragment = halve),
    inputs = crate::inputs::mips::halved,
    parity(
        ulp = 1,
        non_finite,
        why = "sums and products only, then rounding to 16 bits, up or down: one step; absurd numbers overflow"
    )
)]
pub fn halve_rgba16float(#[index] at: UVec2, #[texture] source: Texture2d<'_>) -> Vec4 {
    halved(at, source)
}

/// The same of two channels of 16 bits.
#[kernel(
    compute,
    threads(8, 8),
    texture(rg16unorm),
    forms(fragment = halve),
    inputs = crate::inputs::mips::halved,
    parity(
        ulp = 0,
        absolute = 1.6e-5,
        non_finite,
        why = "sums and products only, then rounding to 1/65535: drivers may round a tie either way, which is one step"
    )
)]
pub fn halve_rg16unorm(#[index] at: UVec2, #[texture] source: Texture2d<'_>) -> Vec2 {
    let texel = halved(at, source);
    Vec2::new(texel.x, texel.y)
}

/// The same of two 16-bit floats.
#[kernel(
    compute,
    threads(8, 8),
    texture(rg16float),
    forms(fragment = halve),
    inputs = crate::inputs::mips::halved,
    parity(
        ulp = 1,
        non_finite,
        why = "sums and products only, then rounding to 16 bits, up or down: one step; absurd numbers overflow"
    )
)]
pub fn halve_rg16float(#[index] at: UVec2, #[texture] source: Texture2d<'_>) -> Vec2 {
    let texel = halved(at, source);
    Vec2::new(texel.x, texel.y)
}

/// The same of two 32-bit floats.
#[kernel(
    compute,
    threads(8, 8),
    texture(rg32float),
    forms(fragment = halve),
    inputs = crate::inputs::mips::halved,
    parity(non_finite, why = "sums of products: those of absurd numbers overflow")
)]
pub fn halve_rg32float(#[index] at: UVec2, #[texture] source: Texture2d<'_>) -> Vec2 {
    let texel = halved(at, source);
    Vec2::new(texel.x, texel.y)
}

/// The same of one 32-bit float.
#[kernel(
    compute,
    threads(8, 8),
    texture(r32float),
    forms(fragment),
    inputs = crate::inputs::mips::halved,
    parity(non_finite, why = "sums of products: those of absurd numbers overflow")
)]
pub fn halve_r32float(#[index] at: UVec2, #[texture] source: Texture2d<'_>) -> f32 {
    halved(at, source).x
}

/// The picture that footprints are those of a pixel of, and how maps are looked up.
#[derive(Clone, Copy, Debug, PartialEq, Element)]
#[repr(C)]
pub struct Raster {
    /// Pixels of a row.
    #[range(16.0..=4096.0)]
    pub width: f32,
    /// Rows.
    #[range(16.0..=4096.0)]
    pub height: f32,
    /// How many times as long as wide a footprint is at most, from 1 (trilinear lookup) to 16. Longer ones are
    /// taken for wider ones.
    #[range(1.0..=16.0)]
    pub anisotropy: f32,
}

/// A vertex as the camera sees it, with its own normal beside the one that it is lit by: the plane that
/// footprints are on.
#[kernel(
    vertex,
    parity(non_finite, why = "sums of products: those of absurd numbers overflow")
)]
pub fn surface_with_plane(
    #[attribute] position: Vec3,
    #[attribute]
    #[unit_vector]
    normal: Vec3,
    #[attribute]
    #[range(0.0..=1.0)]
    colour: Vec3,
    #[attribute]
    #[unit_vector]
    plane: Vec3,
    #[uniform] camera: &Transform,
) -> (Vec4, Vec3, Vec3, Vec3, Vec3) {
    (camera.apply(position), position, normal, colour, plane)
}

/// What a pixel sees of a map: an ellipse, as places along its longer axis.
#[derive(Clone, Copy)]
pub(crate) struct Footprint {
    /// Its longer axis over its shorter one, 1 or more.
    length: f32,
    /// From a place to the next, in coordinates of the map.
    step: Vec2,
    /// Its shorter axis in texels, 1 or more.
    pub(crate) width: f32,
}

#[inline(always)]
fn cross(a: Vec3, b: Vec3) -> Vec3 {
    Vec3::new(
        a.y * b.z - a.z * b.y,
        a.z * b.x - a.x * b.z,
        a.x * b.y - a.y * b.x,
    )
}

impl Footprint {
    /// Of the pixel that sees the point `world` of a surface with the normal `plane`, whatever its length and
    /// sign, in a map of `size` texels.
    ///
    /// On the surface, a step that moves the picture's x by one pixel and leaves y as it is has three
    /// projections that are known: on the normal, and on the gradients of both coordinates. The ellipse's axes
    /// are the singular values of both steps in the map.
    #[inline(always)]
    fn of(
        light: &Light,
        camera: &Transform,
        raster: &Raster,
        world: Vec3,
        plane: Vec3,
        size: UVec2,
    ) -> Self {
        // What lies beside the camera is not seen; the floor keeps its quotients finite.
        let w = Real::max(row_times_point(camera.row_w, world), 1e-6);
        // In clip space, times w.
        let gradient = |row: Vec4| {
            let at = row_times_point(row, world) / w;
            Vec3::new(
                row.x - at * camera.row_w.x,
                row.y - at * camera.row_w.y,
                row.z - at * camera.row_w.z,
            )
        };
        let (right, up) = (gradient(camera.row_x), gradient(camera.row_y));
        let (across, down) = (cross(up, plane), cross(plane, right));
        // Seen edge-on, a pixel sees all of a plane; below it is cut to some maps' widths.
        let volume = dot(across, right);
        let scale = 2.0 * w / Real::max(Real::abs(volume), 1e-12);
        let (scale_x, scale_y) = (scale / raster.width, scale / raster.height);
        let (columns, rows) = (size.x as f32, size.y as f32);
        // As far as receivers are moved: places that are farther off would be rounded to other texels.
        let near = |t: f32| Real::clamp(t, -16.0, 16.0);
        // Coordinates of a spot light's map are quotients, too.
        let distance = Real::max(row_times_point(light.row_w, world), 1e-6);
        let slope = |row: Vec4| {
            let at = row_times_point(row, world) / distance;
            Vec3::new(
                (row.x - at * light.row_w.x) / distance,
                (row.y - at * light.row_w.y) / distance,
                (row.z - at * light.row_w.z) / distance,
            )
        };
        let (u, v) = (slope(light.row_u), slope(light.row_v));
        let (xu, xv) = (
            near(dot(u, across) * scale_x) * columns,
            near(dot(v, across) * scale_x) * rows,
        );
        let (yu, yv) = (
            near(dot(u, down) * scale_y) * columns,
            near(dot(v, down) * scale_y) * rows,
        );
        let steps = [Vec2::new(xu, xv), Vec2::new(yu, yv)];
        Self::of_steps(steps, Vec2::new(columns, rows), raster.anisotropy)
    }

    /// Of a pixel whose steps to its neighbours, along x and along y, are `steps` in a map of `size` texels.
    #[inline(always)]
    pub(crate) fn of_steps(steps: [Vec2; 2], size: Vec2, anisotropy: f32) -> Self {
        let [x, y] = steps;
        // The squares of the axes are the eigenvalues of [[uu, uv], [uv, vv]].
        let (uu, uv, vv) = (
            x.x * x.x + y.x * y.x,
            x.x * x.y + y.x * y.y,
            x.y * x.y + y.y * y.y,
        );
        let (mean, half) = (0.5 * (uu + vv), 0.5 * (uu - vv));
        let root = Real::sqrt(half * half + uv * uv);
        let long = Real::sqrt(mean + root);
        let short = Real::abs(x.x * y.y - x.y * y.x) / Real::max(long, 1e-6);
        let anisotropy = Real::clamp(anisotropy, 1.0, 16.0);
        let width = Real::max(Real::max(short, long / anisotropy), 1.0);
        let length = Real::max(long / width, 1.0);
        // The longer axis; of a circle none.
        let (u, v) = if half > 0.0 {
            (root + half, uv)
        } else {
            (uv, root - half)
        };
        let step = long / (length * Real::max(Real::sqrt(u * u + v * v), 1e-12));
        Self {
            length,
            step: Vec2::new(u * step / size.x, v * step / size.y),
            width,
        }
    }

    /// The level whose texels are as wide as it is.
    #[inline(always)]
    pub(crate) fn level(self) -> f32 {
        math::log2(self.width)
    }

    /// The mean over the footprint of what `sample` gives for a place. Places have distances as
    /// large as the footprint is wide; those that stick out count in part, so that nothing jumps where there is
    /// one more.
    #[inline(always)]
    pub(crate) fn mean(self, uv: Vec2, sample: impl Fn(Vec2) -> Vec4) -> Vec4 {
        let reach = 0.5 * (self.length + 1.0);
        // How many places there are on each side.
        let whole = to_i32(reach);
        let count = (if (whole as f32) < reach {
            whole
        } else {
            whole - 1
        }) as u32;
        let mut sum = sample(uv);
        let mut i = 0;
        while i < count {
            let distance = (i + 1) as f32;
            let away = self.step * distance;
            let weight = Real::min(reach - distance, 1.0);
            sum += (sample(uv + away) + sample(uv - away)) * weight;
            i += 1;
        }
        sum / self.length
    }
}

/// What all pixels share.
#[derive(Clone, Copy)]
pub(crate) struct View<'a> {
    pub(crate) light: &'a Light,
    pub(crate) camera: &'a Transform,
    pub(crate) raster: &'a Raster,
    /// Texels of the map.
    pub(crate) size: UVec2,
}

impl View<'_> {
    /// Lambert's law with what `shadow` gives for a pixel's footprint, its coordinates in the map and its depth.
    #[inline(always)]
    pub(crate) fn light_up(
        self,
        world: Vec3,
        normal: Vec3,
        colour: Vec3,
        plane: Vec3,
        shadow: impl FnOnce(Footprint, Vec2, f32) -> f32,
    ) -> Vec4 {
        shade_with(self.light, world, normal, colour, |uv, z| {
            let View {
                light,
                camera,
                raster,
                size,
            } = self;
            let footprint = Footprint::of(light, camera, raster, world, plane, size);
            shadow(footprint, uv, z)
        })
    }
}
