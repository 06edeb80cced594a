//! Single scattering of a light in a homogeneous medium: of a directional light by marching along rays, and
//! prefiltered with four or six moments (\[BHS\], lecture, "Prefiltered single scattering"; \[PSS\]); of a spot
//! light by marching along rays. Sources are named in [`hankel_moments`].
//!
//! Both see of a picture what the camera does, depth by depth, and give the picture as it is behind the
//! medium: what surfaces send to the camera is weakened, and what the medium scatters is added. The share of
//! light that a ray's medium scatters, ∫ V(s) σ exp(-σ s) ds with the visibility V of the light and the
//! extinction σ, is from 0 to 1; phase function and albedo are factors of all of it.
//!
//! Of a spot light, the radiance is ∫ V(s) σ_s exp(-σ s) p(θ(s)) E(s) ds: the phase function p differs from place
//! to place, as does the irradiance E of a face that is turned to the light. That is what surfaces get: the intensity
//! over the square of the distance, times what the cone leaves. The medium does not weaken a light on its way to a
//! place, neither for surfaces nor for the medium itself.
//!
//! Prefiltered single scattering turns the map into coordinates in which rays from the camera are rows (see
//! [`hankel_moments::rectified_bounds`]). Then a mean over a row's first texels is an integral along rays. These
//! coordinates are about the direction of the light, which a spot light does not have: \[BHS\] defines them for
//! directional lights only.

use hankel_dsl::glam::{UVec2, Vec2, Vec3, Vec4};
use hankel_dsl::{
    Buffer, Element, Real, Shared, StorageMut, Texture2d, Texture2dMultisampled, barrier, kernel,
    math, to_i32,
};
use hankel_moments::bias::SYMMETRIC_4_32;
use hankel_moments::{
    Bounds, Moments4, Moments6, Quantized4, dequantize_symmetric_4, hamburger_4_bounds,
    hamburger_6, henyey_greenstein, inclination, rectified_depth, sparse_2, transmittance,
};

use crate::depth::row_times_point;
use crate::grid::within;
use crate::samples::Samples;
use crate::shade::{Light, within_cone};
use crate::soft::{in_texels, nearest, texel};

/// How a picture's pixels look into the world.
#[derive(Clone, Copy, Debug, PartialEq, Element)]
#[repr(C)]
pub struct View {
    /// Where the camera is (x, y, z); w: one over the near plane's distance along the view.
    pub eye: Vec4,
    /// From the camera through the middle of the upper left pixel (x, y, z), of length 1 along the view; w: what
    /// depth 1 adds to one over the distance along the view.
    pub first: Vec4,
    /// To the next pixel to the right (x, y, z).
    pub right: Vec4,
    /// To the next pixel below (x, y, z).
    pub down: Vec4,
}

/// A homogeneous medium that a light shines through.
#[derive(Clone, Copy, Debug, PartialEq, Element)]
#[repr(C)]
pub struct Medium {
    /// Extinction per unit of length.
    #[range(0.0..=2.0)]
    pub extinction: f32,
    /// The radiance that the medium would send to all sides, were it lit everywhere and so thick that nothing
    /// else is seen, for a phase function of 1 and a light of irradiance 1.
    #[range(0.0..=20.0)]
    pub source: f32,
    /// The mean cosine of what is scattered, from -0.99 to 0.99.
    #[range(-0.99..=0.99)]
    pub anisotropy: f32,
    /// Steps along a ray, where one is marched along.
    #[range(1..=64)]
    pub steps: u32,
}

/// A shadow map in rectified coordinates: columns are radii, rows are azimuths.
#[derive(Clone, Copy, Debug, PartialEq, Element)]
#[repr(C)]
pub struct Rectified {
    /// The direction of the middle azimuth, of length 1 and at right angles to the light (x, y, z); w: the
    /// largest radius.
    pub across: Vec4,
    /// The direction a quarter turn on (x, y, z); w: how far azimuths go to each side of the middle.
    pub aside: Vec4,
    /// The way the light goes, of length 1 (x, y, z); w: length of the map's whole depth.
    pub along: Vec4,
    /// The camera's coordinates in the map and its depth there (x, y, z), from 0 to 1 inside; w: how much of
    /// a harmless distribution is mixed into moments.
    pub eye: Vec4,
    /// Mean of the least and the largest inclination.
    pub middle: f32,
    /// One over half of what lies between them.
    pub scale: f32,
    /// Texels of a row.
    #[range(1..=16)]
    pub columns: u32,
    /// Rows.
    #[range(1..=16)]
    pub rows: u32,
}

impl Rectified {
    #[inline(always)]
    fn size(&self) -> UVec2 {
        UVec2::new(self.columns, self.rows)
    }
}

#[inline(always)]
fn dot(a: Vec4, b: Vec3) -> f32 {
    a.x * b.x + a.y * b.y + a.z * b.z
}

/// What a pixel looks at.
struct Ray {
    /// From the camera, of length 1 along the view.
    direction: Vec3,
    /// Its length.
    length: f32,
    /// How far along the view the pixel's samples end.
    ends: Vec4,
    /// What passes from there to the camera.
    passed: Vec4,
}

impl Ray {
    /// The ray through a pixel's middle. It ends where the pixel's `samples` samples of `surfaces` do, one or
    /// four of them.
    #[inline(always)]
    fn new(view: &View, medium: &Medium, surfaces: impl Samples, at: UVec2, samples: u32) -> Self {
        let (x, y) = (at.x as f32, at.y as f32);
        let way = |first: f32, right: f32, down: f32| {
            Real::clamp(first + right * x + down * y, -1e6, 1e6)
        };
        let direction = Vec3::new(
            way(view.first.x, view.right.x, view.down.x),
            way(view.first.y, view.right.y, view.down.y),
            way(view.first.z, view.right.z, view.down.z),
        );
        let square =
            direction.x * direction.x + direction.y * direction.y + direction.z * direction.z;
        let length = Real::sqrt(Real::max(square, 1e-20));
        let end = |i: u32| {
            let z = Real::saturate(surfaces.load_sample(at, if i < samples { i } else { 0 }).x);
            1.0 / Real::max(view.eye.w + view.first.w * z, 1e-6)
        };
        let ends = Vec4::new(end(0), end(1), end(2), end(3));
        let passed = |end: f32| transmittance(medium.extinction, end * length);
        Self {
            direction,
            length,
            ends,
            passed: Vec4::new(
                passed(ends.x),
                passed(ends.y),
                passed(ends.z),
                passed(ends.w),
            ),
        }
    }

    /// How far along the view the farthest sample ends.
    #[inline(always)]
    fn farthest(&self) -> f32 {
        Real::max(
            Real::max(self.ends.x, self.ends.y),
            Real::max(self.ends.z, self.ends.w),
        )
    }

    /// What passes from a place to the camera, each sample's way cut off at its surface: the mean of them. What
    /// two places differ by in this is what the medium between them takes.
    #[inline(always)]
    fn remains(&self, passed: f32) -> f32 {
        mean(Vec4::new(
            Real::max(passed, self.passed.x),
            Real::max(passed, self.passed.y),
            Real::max(passed, self.passed.z),
            Real::max(passed, self.passed.w),
        ))
    }

    /// The cosine of the angle between the ray and the way a directional light goes.
    #[inline(always)]
    fn cosine(&self, light: &Light) -> f32 {
        -dot(light.position, self.direction) / self.length
    }

    /// What the medium sends to the camera of a directional light of irradiance 1, if it scatters this share of
    /// it, from 0 to 1. What is scattered goes against the ray.
    #[inline(always)]
    fn scattered(&self, medium: &Medium, light: &Light, share: f32) -> f32 {
        let phase = henyey_greenstein(medium.anisotropy, -self.cosine(light));
        medium.source * phase * share
    }

    /// What is seen of a surface's colour through the medium, which adds so much for a light's colour of 1. Each
    /// channel is in [0, 65504], which is the most that a 16-bit float holds.
    #[inline(always)]
    fn behind(&self, picture: Vec4, light: &Light, added: f32) -> Vec4 {
        let through = mean(self.passed);
        let seen = |c: f32, light: f32| Real::clamp(c * through + added * light, 0.0, 65504.0);
        Vec4::new(
            seen(picture.x, light.colour.x),
            seen(picture.y, light.colour.y),
            seen(picture.z, light.colour.z),
            1.0,
        )
    }
}

#[inline(always)]
fn mean(v: Vec4) -> f32 {
    0.25 * ((v.x + v.y) + (v.z + v.w))
}

/// A number from 0 to 1 for a pixel: interleaved gradient noise (J. Jimenez: Next Generation Post Processing
/// in Call of Duty: Advanced Warfare, 2014). Any nine pixels that are neighbours have very different ones.
#[inline(always)]
fn offset(at: UVec2) -> f32 {
    let x = 0.067_110_56 * at.x as f32 + 0.005_837_15 * at.y as f32;
    math::fract(52.982_918 * math::fract(x))
}

of_samples! {
    /// A picture through a medium that a directional light shines through, by marching along each pixel's ray: `steps`
    /// places as far from each other, from a start that differs from pixel to pixel but not from frame to frame, each
    /// of which is lit or not by the nearest depth of the map. A step counts as much as it scatters towards the camera,
    /// and of each sample of the pixel as far as that sample's surface. Of multisampled texels one sample is looked at,
    /// another one in each step.
    #[kernel(
        compute,
        threads(8, 8),
        texture(rgba16float, rgba32float),
        forms(fragment),
        pinned,
        inputs = crate::inputs::scattering::marched,
        parity(
            ulp = 1,
            exact(rgba32float),
            why = "rounding to 16 bits, up or down: one step"
        )
    )]
    scatter_march,
    scatter_single_march,
    (
        #[index] at: UVec2,
        #[uniform] view: &View,
        #[uniform] medium: &Medium,
        #[uniform] light: &Light,
        #[texture] picture: Texture2d<'_>,
    ) -> Vec4,
    |surfaces, depth; samples| {
        let ray = Ray::new(view, medium, surfaces, at, samples);
        let eye = Vec3::new(view.eye.x, view.eye.y, view.eye.z);
        let start = |row: Vec4| row_times_point(row, eye);
        let (u, v, z) = (
            start(light.row_u),
            start(light.row_v),
            start(light.row_depth),
        );
        let (du, dv, dz) = (
            dot(light.row_u, ray.direction),
            dot(light.row_v, ray.direction),
            dot(light.row_depth, ray.direction),
        );
        let size = depth.size();
        let step = ray.farthest() / Real::max(medium.steps as f32, 1.0);
        let per_step = transmittance(medium.extinction, step * ray.length);
        let offset = offset(at);
        let (mut passed, mut before, mut share) = (1.0, 1.0, 0.0);
        let mut i = 0;
        while i < medium.steps {
            let t = (i as f32 + offset) * step;
            let place = in_texels(
                Vec2::new(
                    Real::clamp(u + du * t, -16.0, 16.0),
                    Real::clamp(v + dv * t, -16.0, 16.0),
                ),
                size,
            );
            let sample = i.checked_rem(samples).unwrap_or(0);
            let found = depth.load_sample(nearest(place, size), sample).x;
            passed *= per_step;
            let after = ray.remains(passed);
            // Nothing is beyond the map's depth.
            if found >= Real::min(z + dz * t, 1.0) {
                share += before - after;
            }
            before = after;
            i += 1;
        }
        let added = ray.scattered(medium, light, Real::saturate(share));
        ray.behind(picture.load(at), light, added)
    }
}

/// A ray that passes a spot light nearer than this share of its own length is taken to pass it so far off, which
/// is less than a pixel.
const NEAREST: f32 = 1e-4;

/// What a spot light's cone holds of a ray. A place of it is told by the angle that it is seen by from the light,
/// from the ray's nearest place on: of equal angles, equal parts of the light's irradiance arrive (equi-angular
/// sampling; C. Kulla and M. Fajardo: Importance Sampling Techniques for Path Tracing in Participating Media, 2012).
struct Crossing {
    /// How far along the ray the place is that is nearest to the light.
    foot: f32,
    /// How far that is from the light.
    distance: f32,
    /// The length of the ray.
    length: f32,
    /// The angles, above -π/2 and below π/2; both are the same if the cone holds nothing of the ray.
    first: f32,
    last: f32,
}

impl Crossing {
    /// Of the ray from `eye` along `way`, which is of length 1.
    #[inline(always)]
    fn new(light: &Light, eye: Vec3, way: Vec3, length: f32) -> Self {
        let toward = Vec3::new(
            light.position.x - eye.x,
            light.position.y - eye.y,
            light.position.z - eye.z,
        );
        let foot = toward.x * way.x + toward.y * way.y + toward.z * way.z;
        let off = Vec3::new(
            foot * way.x - toward.x,
            foot * way.y - toward.y,
            foot * way.z - toward.z,
        );
        let square = off.x * off.x + off.y * off.y + off.z * off.z;
        let distance = Real::max(Real::sqrt(square), Real::max(NEAREST * length, 1e-10));
        // The way from the light to a place is cos θ off / distance + sin θ way. Its product with the cone's axis,
        // scaled as `light.cone` is, is the cosine of θ less the angle in the middle, times the root of `most`.
        let across = dot(light.cone, off) / distance;
        let along = dot(light.cone, way);
        let edge = -light.cone.w;
        let most = across * across + along * along;
        let beyond = most - edge * edge;
        let half = math::atan2(Real::sqrt(Real::max(beyond, 0.0)), edge);
        let middle = math::atan2(along, across);
        let first = Real::max(math::atan2(-foot, distance), middle - half);
        let last = Real::min(math::atan2(length - foot, distance), middle + half);
        Self {
            foot,
            distance,
            length,
            first,
            last: if beyond > 0.0 {
                Real::max(first, last)
            } else {
                first
            },
        }
    }

    /// How far along the ray an angle's place is, and one over its distance from the light.
    #[inline(always)]
    fn at(&self, angle: f32) -> (f32, f32) {
        let (sin, cos) = math::sin_cos(angle);
        let cos = Real::max(cos, 1e-6);
        let s = self.foot + self.distance * (sin / cos);
        (Real::clamp(s, 0.0, self.length), cos / self.distance)
    }
}

of_samples! {
    /// A picture through a medium that a spot light shines through, by marching along what the light's cone holds of
    /// each pixel's ray: `steps` parts that the light sees by equal angles, a place in each, which is lit or not by the
    /// nearest depth of the map. Where it lies in its part differs from pixel to pixel but not from frame to frame. A
    /// part counts as much as the medium in it scatters towards the camera: transmittance and the fall of the light with
    /// the square of the distance are integrals over the part; cone and phase function are those of its place. Samples
    /// are looked at as by [`scatter_march`].
    #[kernel(
        compute,
        threads(8, 8),
        texture(rgba16float, rgba32float),
        forms(fragment),
        pinned,
        inputs = crate::inputs::scattering::marched_spot,
        parity(
            ulp = 1,
            exact(rgba32float),
            why = "rounding to 16 bits, up or down: one step"
        )
    )]
    scatter_march_spot,
    scatter_single_march_spot,
    (
        #[index] at: UVec2,
        #[uniform] view: &View,
        #[uniform] medium: &Medium,
        #[uniform] light: &Light,
        #[texture] picture: Texture2d<'_>,
    ) -> Vec4,
    |surfaces, depth; samples| {
        let ray = Ray::new(view, medium, surfaces, at, samples);
        let eye = Vec3::new(view.eye.x, view.eye.y, view.eye.z);
        let way = Vec3::new(
            ray.direction.x / ray.length,
            ray.direction.y / ray.length,
            ray.direction.z / ray.length,
        );
        let crossing = Crossing::new(light, eye, way, ray.farthest() * ray.length);
        let part = (crossing.last - crossing.first) / Real::max(medium.steps as f32, 1.0);
        // The mean of 1 / d² between two places that are 1 / a and 1 / b off is a b part / sin(part).
        let wide = Real::min(part, 3.0);
        let stretch = wide / Real::max(math::sin(wide), 1e-20);
        let offset = offset(at);
        let size = depth.size();
        let (mut start, mut near) = crossing.at(crossing.first);
        let mut before = ray.remains(transmittance(medium.extinction, start));
        let mut share = 0.0;
        let mut i = 0;
        while i < medium.steps {
            let (end, far) = crossing.at(crossing.first + (i as f32 + 1.0) * part);
            let s = start + (end - start) * offset;
            let world = Vec3::new(eye.x + s * way.x, eye.y + s * way.y, eye.z + s * way.z);
            // All places are before the light; the floor keeps what is beside it finite.
            let w = Real::max(row_times_point(light.row_w, world), 1e-6);
            let place = in_texels(
                Vec2::new(
                    Real::clamp(row_times_point(light.row_u, world) / w, -16.0, 16.0),
                    Real::clamp(row_times_point(light.row_v, world) / w, -16.0, 16.0),
                ),
                size,
            );
            let sample = i.checked_rem(samples).unwrap_or(0);
            let found = depth.load_sample(nearest(place, size), sample).x;
            let toward = Vec3::new(
                light.position.x - world.x,
                light.position.y - world.y,
                light.position.z - world.z,
            );
            let square = toward.x * toward.x + toward.y * toward.y + toward.z * toward.z;
            let distance = Real::max(Real::sqrt(square), 1e-20);
            let cosine = (toward.x * way.x + toward.y * way.y + toward.z * way.z) / distance;
            let phase = henyey_greenstein(medium.anisotropy, cosine);
            let fall = 1.0 - light.falloff + light.falloff * (near * far * stretch);
            let within = within_cone(light, toward, distance);
            let unshaded = (within * within) * fall * phase;
            let after = ray.remains(transmittance(medium.extinction, end));
            // Nothing is beyond the map's depth.
            if found >= Real::min(row_times_point(light.row_depth, world) / w, 1.0) {
                share += (before - after) * unshaded;
            }
            start = end;
            near = far;
            before = after;
            i += 1;
        }
        ray.behind(picture.load(at), light, medium.source * share)
    }
}

/// What lies between two texels of four numbers each.
#[inline(always)]
fn lerp(a: Vec4, b: Vec4, t: f32) -> Vec4 {
    a + (b - a) * t
}

/// Between the four nearest of `size` texels, at a place that is given in texels from the first one's middle.
/// The sums are explicit, as a sampler's weights have few bits.
#[inline(always)]
fn bilinear(place: Vec2, size: UVec2, load: impl Fn(UVec2) -> Vec4) -> Vec4 {
    let inside = |x: f32, size: u32| Real::clamp(x, 0.0, (within(i32::MAX, size)) as f32);
    let (x, y) = (inside(place.x, size.x), inside(place.y, size.y));
    let (left, top) = (to_i32(x), to_i32(y));
    let (fx, fy) = (x - left as f32, y - top as f32);
    let tap = |dx: i32, dy: i32| {
        load(UVec2::new(
            within(left + dx, size.x),
            within(top + dy, size.y),
        ))
    };
    lerp(
        lerp(tap(0, 0), tap(1, 0), fx),
        lerp(tap(0, 1), tap(1, 1), fx),
        fy,
    )
}

/// From here to 1, a depth of the map is taken to be farther and farther than it is: 1 is nothing, and what casts
/// shadows is kept off both ends of the map's range by this much.
const FARTHEST: f32 = 0.995;

/// What there is to know of a row; nothing of one that is not there.
#[inline(always)]
fn row_of(rows: Buffer<'_, Vec4>, row: u32) -> Vec4 {
    if row < rows.len() {
        rows.get(row)
    } else {
        Vec4::ZERO
    }
}

/// A filtered map of four moments in rectified coordinates, row after row. Of a place's moments three are
/// told by two depths (\[BHS\], section 2 of the supplement), each of which becomes another depth there.
/// `order` 0 gives the first four moments of these, 1 the fifth and the sixth. `rows` has for each row the direction
/// of its azimuth (x, y, z), of length 1, and its extinction per unit of radius (w).
#[kernel(compute, threads(64), pinned, inputs = crate::inputs::scattering::rectified)]
pub fn rectify(
    #[index] i: u32,
    #[constant(id = 0, default = 0)]
    #[values(0, 1)]
    order: u32,
    #[uniform] light: &Light,
    #[uniform] rectified: &Rectified,
    #[storage]
    #[length(1..=16)]
    #[range(-1.0..=1.0)]
    rows: Buffer<'_, Vec4>,
    #[texture] map: Texture2d<'_>,
) -> Vec4 {
    let at = texel(i, rectified.size());
    let share = |i: u32, count: u32| (i as f32 + 0.5) / Real::max(count as f32, 1.0);
    let radius = share(at.x, rectified.columns) * rectified.across.w;
    let row = row_of(rows, at.y);
    let away = Vec3::new(radius * row.x, radius * row.y, radius * row.z);
    let near = |x: f32| Real::clamp(x, -16.0, 16.0);
    let uv = Vec2::new(
        near(rectified.eye.x + dot(light.row_u, away)),
        near(rectified.eye.y + dot(light.row_v, away)),
    );
    let size = map.size();
    let place = in_texels(uv, size);
    let place = Vec2::new(place.x - 0.5, place.y - 0.5);
    let q = bilinear(place, size, |at| map.load(at));
    let m = dequantize_symmetric_4(Quantized4 {
        r: q.x,
        g: q.y,
        b: q.z,
        a: q.w,
    });
    let points = sparse_2(m.b1, m.b2, m.b3);
    let depth = |z: f32| {
        let z = 0.5 * z + 0.5;
        let along = (z - rectified.eye.z) * rectified.along.w;
        let depth = rectified_depth(
            inclination(radius, along),
            rectified.middle,
            rectified.scale,
        );
        let beyond = Real::saturate((z - FARTHEST) / (1.0 - FARTHEST));
        depth + (1.0 - depth) * beyond
    };
    let of = |z: f32| {
        let m = Moments6::of_depth(z);
        if order == 0 {
            Vec4::new(m.b1, m.b2, m.b3, m.b4)
        } else {
            Vec4::new(m.b5, m.b6, 0.0, 0.0)
        }
    };
    lerp(of(depth(points.z1)), of(depth(points.z2)), points.w2)
}

/// The rows of a rectified map. A workgroup of 64 invocations has a row.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Element)]
#[repr(C)]
pub struct MapRows {
    /// 64 for each row.
    #[range(64..=1024)]
    pub invocations: u32,
    /// Texels of a row.
    #[range(1..=64)]
    pub length: u32,
    /// Fills the structure up.
    pub padding: UVec2,
}

/// Means along rows of a map in rectified coordinates, in its place: each texel becomes the mean of those
/// before it in its row, and of itself. A texel's weight is what the medium in it scatters that reaches the
/// camera, by the extinction of `rows` (see [`rectify`]).
///
/// A workgroup of 64 invocations has a row. Each adds up a 64th of it; a scan of these totals tells each what
/// comes before its part, as in [`crate::soft::prefix_sums`].
#[kernel(
    compute,
    threads(64),
    pinned,
    range(lines.invocations),
    inputs = crate::inputs::scattering::means,
    parity(non_finite, why = "sums of products: those of absurd numbers overflow")
)]
pub fn prefix_means(
    #[local_index] me: u32,
    #[group_id] row: u32,
    #[shared] totals: Shared<'_, Vec4, 64>,
    #[shared] weights: Shared<'_, f32, 64>,
    #[uniform] lines: &MapRows,
    #[uniform] rectified: &Rectified,
    #[storage]
    #[length(1..=16)]
    #[range(-1.0..=1.0)]
    rows: Buffer<'_, Vec4>,
    #[storage] table: StorageMut<'_, Vec4>,
) {
    // Rows do not reach beyond the table, whatever the uniform says.
    let entries = table.len();
    let length = lines.length;
    let place = |k: u32| row * length + k;
    let extinction = row_of(rows, row).w;
    let width = rectified.across.w / Real::max(length as f32, 1.0);
    let weight = |k: u32| transmittance(extinction, k as f32 * width);
    let share = length.div_ceil(64);
    let first = me * share;
    let end = if first + share < length {
        first + share
    } else {
        length
    };
    let (mut total, mut weighed) = (Vec4::ZERO, 0.0);
    let mut k = first;
    while k < end {
        if place(k) < entries {
            let w = weight(k);
            total += table.get(place(k)) * w;
            weighed += w;
        }
        k += 1;
    }
    // Of each the sum over all parts before this one.
    let (mut sum, mut sum_weighed) = (Vec4::ZERO, 0.0);
    let (mut scanned, mut scanned_weighed) = (total, weighed);
    let mut reach = 1;
    while reach < 64 {
        totals.set(me, scanned);
        weights.set(me, scanned_weighed);
        barrier();
        if me >= reach {
            let (before, before_weighed) = (totals.get(me - reach), weights.get(me - reach));
            scanned += before;
            scanned_weighed += before_weighed;
            sum += before;
            sum_weighed += before_weighed;
        }
        barrier();
        reach *= 2;
    }
    let mut k = first;
    while k < end {
        if place(k) < entries {
            let w = weight(k);
            sum += table.get(place(k)) * w;
            sum_weighed += w;
            table.set(place(k), sum / Real::max(sum_weighed, 1e-30));
        }
        k += 1;
    }
}

/// The share of the light that a pixel's ray scatters towards the camera, by the share of its ray that is lit:
/// what `lit` gives for where a row of the map is to be read, in texels from the first one's middle, and for a
/// depth from -1 to 1.
///
/// The four samples of a pixel are near ones and far ones: where these are as far apart as texels of a row are,
/// each has its own lookup.
#[inline(always)]
fn scattered(ray: &Ray, rectified: &Rectified, lit: impl Fn(Vec2, f32) -> f32) -> f32 {
    let (x, y, along) = (
        dot(rectified.across, ray.direction),
        dot(rectified.aside, ray.direction),
        dot(rectified.along, ray.direction),
    );
    let radius = Real::sqrt(x * x + y * y);
    let depth = rectified_depth(
        inclination(radius, along),
        rectified.middle,
        rectified.scale,
    );
    let turn = math::atan2(y, x) / Real::max(rectified.aside.w, 1e-6);
    let row = (0.5 * turn + 0.5) * rectified.rows as f32 - 0.5;
    let per_texel = rectified.columns as f32 / Real::max(rectified.across.w, 1e-6);
    // The mean up to a texel's end stands in the texel.
    let column = |end: f32| Real::clamp(radius * end * per_texel - 1.0, -1.0, 65536.0);
    let least = Real::min(
        Real::min(ray.ends.x, ray.ends.y),
        Real::min(ray.ends.z, ray.ends.w),
    );
    let largest = Real::max(
        Real::max(ray.ends.x, ray.ends.y),
        Real::max(ray.ends.z, ray.ends.w),
    );
    let between = 0.5 * (least + largest);
    let is_far = |end: f32| if end > between { 1.0 } else { 0.0 };
    let far = Vec4::new(
        is_far(ray.ends.x),
        is_far(ray.ends.y),
        is_far(ray.ends.z),
        is_far(ray.ends.w),
    );
    let is_split = column(largest) - column(least) > 1.0;
    // How much of the pixel its samples' rays scatter, were all lit, and where they end in the mean.
    let part = |of: Vec4| {
        let count = of.x + of.y + of.z + of.w;
        let ends = of.x * ray.ends.x + of.y * ray.ends.y + of.z * ray.ends.z + of.w * ray.ends.w;
        let passed =
            of.x * ray.passed.x + of.y * ray.passed.y + of.z * ray.passed.z + of.w * ray.passed.w;
        (ends / Real::max(count, 1.0), 0.25 * (count - passed))
    };
    let lookups = if is_split { 2 } else { 1 };
    let mut of = if is_split { Vec4::ONE - far } else { Vec4::ONE };
    let mut share = 0.0;
    let mut i = 0;
    while i < lookups {
        let (end, most) = part(of);
        share += most * lit(Vec2::new(column(end), row), depth);
        of = far;
        i += 1;
    }
    Real::saturate(share)
}

/// Where between the bounds a ray's shadow is taken to be: at the lower one, which is too bright, where the
/// ray goes with the light, at the upper one where it goes against it (lecture, "Adaptive overestimation").
#[inline(always)]
pub(crate) fn overestimated(bounds: Bounds<f32>, cosine: f32) -> f32 {
    1.0 - bounds.blend(0.5 - 0.5 * cosine)
}

/// Rows of four moments or fewer.
#[derive(Clone, Copy)]
struct Rows<'a> {
    table: Buffer<'a, Vec4>,
    size: UVec2,
}

impl Rows<'_> {
    #[inline(always)]
    fn interpolated(self, place: Vec2) -> Vec4 {
        bilinear(place, self.size, |at| {
            self.table.get(at.y * self.size.x + at.x)
        })
    }
}

/// The distribution that the bias of four moments mixes in.
const TARGET: Moments4<f32> = SYMMETRIC_4_32.four();

/// A picture through a medium, by prefiltered single scattering with four moments. `table` is what
/// [`prefix_means`] makes of rows of [`rectify`].
#[kernel(
    compute,
    threads(8, 8),
    texture(rgba16float, rgba32float),
    pinned,
    inputs = crate::inputs::scattering::prefiltered,
    parity(
        ulp = 1,
        exact(rgba32float),
        why = "rounding to 16 bits, up or down: one step"
    )
)]
pub fn scatter_prefiltered(
    #[index] at: UVec2,
    #[constant(id = 0, default = 4)]
    #[values(1, 4)]
    samples: u32,
    #[uniform] view: &View,
    #[uniform] medium: &Medium,
    #[uniform] light: &Light,
    #[uniform] rectified: &Rectified,
    #[texture] picture: Texture2d<'_>,
    #[texture] surfaces: Texture2dMultisampled<'_>,
    #[storage]
    #[length(256)]
    table: Buffer<'_, Vec4>,
) -> Vec4 {
    let ray = Ray::new(view, medium, surfaces, at, samples);
    let rows = Rows {
        table,
        size: rectified.size(),
    };
    let share = scattered(&ray, rectified, |place, depth| {
        let m = rows.interpolated(place);
        let m = Moments4 {
            b1: m.x,
            b2: m.y,
            b3: m.z,
            b4: m.w,
        };
        let bounds = hamburger_4_bounds(m.lerp(TARGET, rectified.eye.w), depth);
        overestimated(bounds, ray.cosine(light))
    });
    let added = ray.scattered(medium, light, share);
    ray.behind(picture.load(at), light, added)
}

/// The same with six moments, of which the last two stand in a second table. `target` is the moment vector that
/// the bias mixes in.
#[kernel(
    compute,
    threads(8, 8),
    texture(rgba16float, rgba32float),
    pinned,
    inputs = crate::inputs::scattering::prefiltered_6,
    parity(
        ulp = 1,
        exact(rgba32float),
        why = "rounding to 16 bits, up or down: one step"
    )
)]
pub fn scatter_prefiltered_6(
    #[index] at: UVec2,
    #[constant(id = 0, default = 4)]
    #[values(1, 4)]
    samples: u32,
    #[uniform] view: &View,
    #[uniform] medium: &Medium,
    #[uniform] light: &Light,
    #[uniform] rectified: &Rectified,
    #[uniform] target: &Moments6<f32>,
    #[texture] picture: Texture2d<'_>,
    #[texture] surfaces: Texture2dMultisampled<'_>,
    #[storage]
    #[length(256)]
    first: Buffer<'_, Vec4>,
    #[storage]
    #[length(256)]
    second: Buffer<'_, Vec4>,
) -> Vec4 {
    let ray = Ray::new(view, medium, surfaces, at, samples);
    let size = rectified.size();
    let (first, second) = (
        Rows { table: first, size },
        Rows {
            table: second,
            size,
        },
    );
    let share = scattered(&ray, rectified, |place, depth| {
        let (low, high) = (first.interpolated(place), second.interpolated(place));
        let m = Moments6 {
            b1: low.x,
            b2: low.y,
            b3: low.z,
            b4: low.w,
            b5: high.x,
            b6: high.y,
        };
        let bounds = hamburger_6(m.lerp(*target, rectified.eye.w), depth);
        overestimated(bounds, ray.cosine(light))
    });
    let added = ray.scattered(medium, light, share);
    ray.behind(picture.load(at), light, added)
}
