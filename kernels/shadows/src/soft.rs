//! Soft shadows of an area light: percentage-closer soft shadows (\[PCSS\]), variance soft shadows
//! (\[VSSM\]), and moment soft shadows (\[BHS\], lecture, "Moment soft shadow mapping"). Sources are named
//! in [`hankel_moments`].
//!
//! What lies a depth d before a receiver is seen from it, against the light, moved in the map by d times the
//! light's half width: the same for all receivers. Of a directional light, as its depths are distances; of a spot
//! light, because depth in its map is linear in the reciprocal of the distance D, and so are both the size of a
//! thing in the map and a penumbra's: with half width w, blocker and receiver at D_b and D_r, that is
//! w (D_r - D_b) / D_b on the receiver, and w (1 / D_b - 1 / D_r) as seen from the light. Penumbrae are
//! therefore as wide as their blockers are far, without a division.

use hankel_dsl::glam::{UVec2, UVec4, Vec2, Vec3, Vec4};
use hankel_dsl::{
    Buffer, Element, Real, Shared, StorageMut, Texture2dMultisampled, barrier, kernel, to_i32,
};
use hankel_moments::{
    Blockers, Fixed4, Fixed6, FixedPoint, Moments4, Moments6, Quantized4, Quantized6, Region, Span,
    blockers_2, blockers_4, blockers_6, dequantize_symmetric_4, dequantize_symmetric_6,
    hamburger_4, hamburger_6, quantize_symmetric_4, quantize_symmetric_6,
};

use crate::grid::within;
use crate::library::store::symmetric_depth;
use crate::resolve::mean_symmetric;
use crate::shade::{Light, biased, shade_with};
use crate::six::quantized;

/// An area light as its shadow map sees it.
#[derive(Clone, Copy, Debug, PartialEq, Element)]
#[repr(C)]
pub struct Area {
    /// How far a shadow's edge reaches to each side, in texels along u and v, for a distance of the map's
    /// whole depth between blocker and receiver.
    #[range(0.0..=40.0)]
    pub spread: Vec2,
    /// How much nearer the steepest surface that must not shade itself comes within the penumbra's reach, as
    /// a share of the distance between blocker and receiver, for a receiver at depth 0. Single depths are compared
    /// with that surface.
    #[range(0.0..=0.5)]
    pub slack: f32,
    /// How much nearer a receiver is moved before it is compared with a whole region, as a share of the same
    /// distance.
    #[range(0.0..=0.5)]
    pub margin: f32,
    /// The integer that stands for 1 in the summed-area table ([`FixedPoint`]).
    #[range(1..=16_777_216)]
    pub one: u32,
    /// What of these two shares is gone for a receiver at depth 1: the farther off a spot light is, the
    /// smaller it looks. 0 for a directional light.
    #[range(0.0..=1.0)]
    pub narrowing: f32,
}

/// Texels to each side that a summed-area table is read over, at most. There, its numbers have as many
/// bits as those of a map of 16 bits.
pub const MOST_REACH: f32 = 128.0;

impl Area {
    /// The table's fixed point.
    #[inline(always)]
    fn point(&self) -> FixedPoint {
        FixedPoint { one: self.one }
    }

    /// What a share of a distance for a receiver at depth 0 is for one at depth `z`.
    #[inline(always)]
    fn seen_from(&self, share: f32, z: f32) -> f32 {
        share * (1.0 - self.narrowing * z)
    }

    /// Half the size in texels of what is filtered for blockers so far before a receiver, in the map's depth:
    /// at least half a texel.
    #[inline(always)]
    pub(crate) fn reach(&self, distance: f32) -> Vec2 {
        let d = Real::saturate(distance);
        Vec2::new(
            Real::max(self.spread.x * d, 0.5),
            Real::max(self.spread.y * d, 0.5),
        )
    }
}

/// Lines of a table: its rows or its columns. A workgroup of 64 invocations has a line.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Element)]
#[repr(C)]
pub struct Lines {
    /// 64 for each line.
    #[range(64..=1024)]
    pub invocations: u32,
    /// Elements of a line.
    #[range(1..=64)]
    pub length: u32,
    /// 0: a line's elements follow each other (rows). 1: lines do (columns).
    #[values(0, 1)]
    pub across: u32,
    /// Fills the structure up.
    pub padding: u32,
}

/// What a table's entries are made of: integers modulo 2^32.
trait Sums: Copy {
    const ZERO: Self;
    fn plus(self, other: Self) -> Self;
    fn minus(self, other: Self) -> Self;
}

impl Sums for UVec4 {
    const ZERO: Self = Self::ZERO;
    #[inline(always)]
    fn plus(self, other: Self) -> Self {
        vector(fixed(self).plus(fixed(other)))
    }
    #[inline(always)]
    fn minus(self, other: Self) -> Self {
        vector(fixed(self).minus(fixed(other)))
    }
}

impl Sums for Fixed6 {
    const ZERO: Self = Self {
        r0: 0,
        g0: 0,
        b0: 0,
        r1: 0,
        g1: 0,
        b1: 0,
    };
    #[inline(always)]
    fn plus(self, other: Self) -> Self {
        self.plus(other)
    }
    #[inline(always)]
    fn minus(self, other: Self) -> Self {
        self.minus(other)
    }
}

#[inline(always)]
fn fixed(v: UVec4) -> Fixed4 {
    Fixed4 {
        r: v.x,
        g: v.y,
        b: v.z,
        a: v.w,
    }
}

#[inline(always)]
fn vector(f: Fixed4) -> UVec4 {
    UVec4::new(f.r, f.g, f.b, f.a)
}

macro_rules! prefix_sums {
    ($(#[doc = $doc:literal])* $name:ident, $element:ident, $inputs:ident) => {
        $(#[doc = $doc])*
        #[kernel(
            compute,
            threads(64),
            range(lines.invocations),
            inputs = crate::inputs::soft::$inputs
        )]
        pub fn $name(
            #[local_index] me: u32,
            #[group_id] line: u32,
            #[group_count] count: u32,
            #[shared] totals: Shared<'_, $element, 64>,
            #[uniform] lines: &Lines,
            #[storage] table: StorageMut<'_, $element>,
        ) {
            // Lines do not reach beyond the table, whatever the uniform says.
            let entries = table.len();
            let is_row = lines.across == 0;
            let step = if is_row { 1 } else { count };
            let first_of_all = if is_row { line * lines.length } else { line };
            let place = |k: u32| first_of_all + k * step;
            let share = lines.length.div_ceil(64);
            let first = me * share;
            let end = if first + share < lines.length {
                first + share
            } else {
                lines.length
            };
            let mut total = <$element as Sums>::ZERO;
            let mut k = first;
            while k < end {
                if place(k) < entries {
                    total = Sums::plus(total, table.get(place(k)));
                }
                k += 1;
            }
            let mut sum = total;
            let mut reach = 1;
            while reach < 64 {
                totals.set(me, sum);
                barrier();
                if me >= reach {
                    sum = Sums::plus(sum, totals.get(me - reach));
                }
                barrier();
                reach *= 2;
            }
            let mut before = Sums::minus(sum, total);
            let mut k = first;
            while k < end {
                if place(k) < entries {
                    before = Sums::plus(before, table.get(place(k)));
                    table.set(place(k), before);
                }
                k += 1;
            }
        }
    };
}

prefix_sums!(
    /// Prefix sums along the lines of a table, in its place, modulo 2^32: each element becomes the sum of
    /// those before it in its line, and of itself. Once along rows and once along columns makes a summed-area
    /// table.
    ///
    /// A workgroup has a line. Each of its invocations adds up a 64th of it; a scan of these totals (Hillis
    /// and Steele: Data Parallel Algorithms, 1986) tells each what comes before its part.
    prefix_sums,
    UVec4,
    table
);

prefix_sums!(
    /// As [`prefix_sums`], of six integers.
    prefix_sums_6,
    Fixed6,
    table_6
);

/// The texel that an element of a table belongs to: rows from the top, one after the other.
#[inline(always)]
pub(crate) fn texel(i: u32, size: UVec2) -> UVec2 {
    // A division that has no branch which leaves the kernel: a texture is a texel wide at least.
    let (x, y) = (i.checked_rem(size.x), i.checked_div(size.x));
    UVec2::new(x.unwrap_or(0), within(y.unwrap_or(0) as i32, size.y))
}

/// The nearest texel of a texture.
#[inline(always)]
fn inside(at: UVec2, size: UVec2) -> UVec2 {
    UVec2::new(within(at.x as i32, size.x), within(at.y as i32, size.y))
}

/// Mean of a texel's four moments, depths moved to [-1, 1], in the optimised basis, as integers: what
/// [`prefix_sums`] makes a summed-area table of. Rows from the top, one after the other.
#[kernel(compute, threads(8, 8), range(size), pinned, inputs = crate::inputs::soft::resolved)]
pub fn resolve_summed(
    #[index] at: UVec2,
    #[constant(id = 0, default = 4)]
    #[values(1, 4)]
    samples: u32,
    #[uniform] size: &UVec2,
    #[uniform] area: &Area,
    #[texture] depth: Texture2dMultisampled<'_>,
) -> UVec4 {
    let q = mean_symmetric(depth, inside(at, depth.size()), samples);
    let q = Quantized4 {
        r: q.x,
        g: q.y,
        b: q.z,
        a: q.w,
    };
    vector(Fixed4::of(q, area.point()))
}

/// The same of six moments.
#[kernel(compute, threads(8, 8), range(size), pinned, inputs = crate::inputs::soft::resolved)]
pub fn resolve_summed_6(
    #[index] at: UVec2,
    #[constant(id = 0, default = 4)]
    #[values(1, 4)]
    samples: u32,
    #[uniform] size: &UVec2,
    #[uniform] area: &Area,
    #[texture] depth: Texture2dMultisampled<'_>,
) -> Fixed6 {
    let texels = quantized(depth, inside(at, depth.size()), samples);
    let q = Quantized6 {
        r0: texels.first.x,
        g0: texels.first.y,
        b0: texels.first.z,
        r1: texels.second.x,
        g1: texels.second.y,
        b1: texels.second.z,
    };
    Fixed6::of(q, area.point())
}

/// The rectangle within `reach` texels of a place, which is given in texels.
#[inline(always)]
pub(crate) fn region(place: Vec2, reach: Vec2, size: UVec2) -> Region {
    Region {
        x: Span::around(place.x, Real::min(reach.x, MOST_REACH), size.x),
        y: Span::around(place.y, Real::min(reach.y, MOST_REACH), size.y),
    }
}

/// Where in a table the sum over so many columns and rows stands, and whether it stands there: nothing comes
/// before the first of them.
#[inline(always)]
fn entry(columns: u32, rows: u32, size: UVec2) -> (u32, bool) {
    // Without a branch.
    let is_any = (columns > 0) & (rows > 0);
    (
        if is_any {
            (rows - 1) * size.x + columns - 1
        } else {
            0
        },
        is_any,
    )
}

/// A summed-area table of four moments.
struct Table<'a> {
    entries: Buffer<'a, UVec4>,
    size: UVec2,
    point: FixedPoint,
}

impl Table<'_> {
    /// The mean moments within `reach` texels of a place. Beyond the map, nothing is nearer than its end.
    #[inline(always)]
    fn around(&self, place: Vec2, reach: Vec2) -> Moments4<f32> {
        let beyond = quantize_symmetric_4(Moments4::of_depth(1.0));
        let region = region(place, reach, self.size);
        let q = region.mean_4(self.point, beyond, |columns, rows| {
            let (i, is_any) = entry(columns, rows, self.size);
            let sum = fixed(self.entries.get(i));
            Fixed4 {
                r: if is_any { sum.r } else { 0 },
                g: if is_any { sum.g } else { 0 },
                b: if is_any { sum.b } else { 0 },
                a: if is_any { sum.a } else { 0 },
            }
        });
        dequantize_symmetric_4(q)
    }
}

/// The same of six.
struct Table6<'a> {
    entries: Buffer<'a, Fixed6>,
    size: UVec2,
    point: FixedPoint,
}

impl Table6<'_> {
    #[inline(always)]
    fn around(&self, place: Vec2, reach: Vec2) -> Moments6<f32> {
        let beyond = quantize_symmetric_6(Moments6::of_depth(1.0));
        let region = region(place, reach, self.size);
        let q = region.mean_6(self.point, beyond, |columns, rows| {
            let (i, is_any) = entry(columns, rows, self.size);
            let sum = self.entries.get(i);
            Fixed6 {
                r0: if is_any { sum.r0 } else { 0 },
                g0: if is_any { sum.g0 } else { 0 },
                b0: if is_any { sum.b0 } else { 0 },
                r1: if is_any { sum.r1 } else { 0 },
                g1: if is_any { sum.g1 } else { 0 },
                b1: if is_any { sum.b1 } else { 0 },
            }
        });
        dequantize_symmetric_6(q)
    }
}

/// A place in the map in texels.
#[inline(always)]
pub(crate) fn in_texels(uv: Vec2, size: UVec2) -> Vec2 {
    Vec2::new(uv.x * size.x as f32, uv.y * size.y as f32)
}

/// What the lecture adds of the receiver's own depth to the mean of the blockers'.
const EPSILON: f32 = 1e-3;

/// Shading with moment soft shadow mapping: the blockers' distance by the moments of all that the light may
/// be behind, the penumbra's width by that, and the shadow by the moments within. `table` is the summed-area
/// table of a map of `size` texels.
#[kernel(
    fragment,
    inputs = crate::inputs::soft::shaded,
    parity(
        ulp = 0,
        absolute = 3e-2,
        why = "sums of products that a driver may contract: a moment is off by up to 2.4e-7, 1.2 % of the bias's strength, and the bound by about as much; the light's strength is 2.5"
    )
)]
pub fn shade_soft(
    #[varying] world: Vec3,
    #[varying]
    #[unit_vector]
    normal: Vec3,
    #[varying]
    #[range(0.0..=1.0)]
    colour: Vec3,
    #[uniform] light: &Light,
    #[uniform] area: &Area,
    #[uniform]
    #[range(1..=16)]
    size: &UVec2,
    #[storage]
    #[length(256)]
    table: Buffer<'_, UVec4>,
) -> Vec4 {
    shade_with(light, world, normal, colour, |uv, z| {
        let table = Table {
            entries: table,
            size: *size,
            point: area.point(),
        };
        let place = in_texels(uv, *size);
        let all = biased(light, table.around(place, area.reach(z)));
        let distance = 0.5 * blockers_4(all, symmetric_depth(z)).distance(EPSILON);
        let near = biased(light, table.around(place, area.reach(distance)));
        let margin = area.seen_from(area.margin, z);
        hamburger_4(near, symmetric_depth(z - margin * distance))
    })
}

/// The same with six moments. `target` is the moment vector that the bias mixes in; the light's own is for
/// four.
#[kernel(
    fragment,
    inputs = crate::inputs::soft::shaded_6,
    parity(
        ulp = 0,
        absolute = 3e-2,
        why = "sums of products that a driver may contract: a moment is off by up to 2.4e-7, 0.5 % of the bias's strength, and the bound by up to twice as much; the light's strength is 2.5"
    )
)]
pub fn shade_soft_6(
    #[varying] world: Vec3,
    #[varying]
    #[unit_vector]
    normal: Vec3,
    #[varying]
    #[range(0.0..=1.0)]
    colour: Vec3,
    #[uniform] light: &Light,
    #[uniform] area: &Area,
    #[uniform] target: &Moments6<f32>,
    #[uniform]
    #[range(1..=16)]
    size: &UVec2,
    #[storage]
    #[length(256)]
    table: Buffer<'_, Fixed6>,
) -> Vec4 {
    shade_with(light, world, normal, colour, |uv, z| {
        let table = Table6 {
            entries: table,
            size: *size,
            point: area.point(),
        };
        let place = in_texels(uv, *size);
        let around = |reach: Vec2| table.around(place, reach).lerp(*target, light.moment_bias);
        let blockers = blockers_6(around(area.reach(z)), symmetric_depth(z));
        let distance = 0.5 * blockers.distance(EPSILON);
        let margin = area.seen_from(area.margin, z);
        let receiver = symmetric_depth(z - margin * distance);
        hamburger_6(around(area.reach(distance)), receiver).lower
    })
}

/// The texel of a place that is given in texels; beyond the map, the nearest one.
#[inline(always)]
pub(crate) fn nearest(place: Vec2, size: UVec2) -> UVec2 {
    let within = |x: f32, size: u32| to_i32(Real::clamp(x, 0.0, (size - 1) as f32)) as u32;
    UVec2::new(within(place.x, size.x), within(place.y, size.y))
}

/// Shading with variance soft shadow mapping (\[VSSM\]): as moment soft shadow mapping, by mean and variance.
/// They bound nothing where the mean is not before the receiver. So a region is divided into `parts` by
/// `parts` smaller ones; in those where that is so, 2 x 2 depths of the map are compared instead. The
/// moments are as they are: against rounding, `moment_bias` is the least variance.
#[kernel(fragment, pinned, inputs = crate::inputs::soft::shaded_parts)]
pub fn shade_vssm(
    #[varying] world: Vec3,
    #[varying]
    #[unit_vector]
    normal: Vec3,
    #[varying]
    #[range(0.0..=1.0)]
    colour: Vec3,
    #[uniform] light: &Light,
    #[uniform] area: &Area,
    #[uniform]
    #[range(1..=16)]
    size: &UVec2,
    #[storage]
    #[length(256)]
    table: Buffer<'_, UVec4>,
    #[texture] depth: Texture2dMultisampled<'_>,
    #[constant(id = 0, default = 3)]
    #[values(1, 2, 3, 4)]
    parts: u32,
) -> Vec4 {
    shade_with(light, world, normal, colour, |uv, z| {
        let table = Table {
            entries: table,
            size: *size,
            point: area.point(),
        };
        let place = in_texels(uv, *size);
        let per_part = 1.0 / parts as f32;
        let blockers = |reach: Vec2, z: f32| {
            let (mut share, mut moment) = (0.0, 0.0);
            let half = Vec2::new(reach.x * per_part, reach.y * per_part);
            let turn = |k: u32| (2 * k + 1) as f32 * per_part - 1.0;
            let mut part = UVec2::ZERO;
            while part.y < parts {
                let middle = Vec2::new(
                    place.x + reach.x * turn(part.x),
                    place.y + reach.y * turn(part.y),
                );
                let m = table.around(middle, half);
                if m.b1 < symmetric_depth(z) {
                    let found = blockers_2(m.b1, m.b2, symmetric_depth(z), light.moment_bias);
                    share += found.share;
                    moment += found.moment;
                } else {
                    let mut k = 0;
                    while k < 4 {
                        let side = |k: u32| if k == 0 { -0.5 } else { 0.5 };
                        let at = Vec2::new(
                            middle.x + half.x * side(k & 1),
                            middle.y + half.y * side(k >> 1),
                        );
                        let found = depth.load(nearest(at, depth.size()), 0).x;
                        if found < z {
                            share += 0.25;
                            // Depths in [-1, 1] are twice as far apart.
                            moment += 0.5 * (z - found);
                        }
                        k += 1;
                    }
                }
                part.x += 1;
                if part.x >= parts {
                    part = UVec2::new(0, part.y + 1);
                }
            }
            let scale = per_part * per_part;
            Blockers {
                share: share * scale,
                moment: moment * scale,
            }
        };
        let distance = 0.5 * blockers(area.reach(z), z).distance(EPSILON);
        let margin = area.seen_from(area.margin, z);
        blockers(area.reach(distance), z - margin * distance).share
    })
}

/// Shading with percentage-closer soft shadows: the mean distance of the blockers among some depths, and the
/// share of blockers among others, within the penumbra. `search` and `filter` are where to look: points of
/// the light, in units of its half width. Each is compared with what the steepest surface that does not shade
/// itself has there. Of multisampled texels, one sample is looked at, another one for each point.
#[kernel(fragment, pinned, inputs = crate::inputs::soft::searched)]
pub fn shade_pcss(
    #[varying] world: Vec3,
    #[varying]
    #[unit_vector]
    normal: Vec3,
    #[varying]
    #[range(0.0..=1.0)]
    colour: Vec3,
    #[uniform] light: &Light,
    #[uniform] area: &Area,
    #[storage]
    #[length(1..=40)]
    #[range(-1.0..=1.0)]
    search: Buffer<'_, Vec2>,
    #[storage]
    #[length(1..=40)]
    #[range(-1.0..=1.0)]
    filter: Buffer<'_, Vec2>,
    #[texture] depth: Texture2dMultisampled<'_>,
    #[constant(id = 0, default = 4)]
    #[values(1, 4)]
    samples: u32,
) -> Vec4 {
    shade_with(light, world, normal, colour, |uv, z| {
        let size = depth.size();
        let place = in_texels(uv, size);
        let steepest = area.seen_from(area.slack, z);
        // The depth at a point, and what it is less than if it blocks: the surface's own slope allowed for.
        let behind = |i: u32, offset: Vec2, distance: f32| {
            let reach = area.reach(distance);
            let at = Vec2::new(place.x + offset.x * reach.x, place.y + offset.y * reach.y);
            let width = Real::sqrt(offset.x * offset.x + offset.y * offset.y);
            let slack = steepest * width * distance;
            (
                depth
                    .load(nearest(at, size), i.checked_rem(samples).unwrap_or(0))
                    .x,
                z - slack,
            )
        };
        let (mut distances, mut blockers) = (0.0, 0.0);
        let mut i = 0;
        while i < search.len() {
            let (found, limit) = behind(i, search.get(i), z);
            if found < limit {
                distances += z - found;
                blockers += 1.0;
            }
            i += 1;
        }
        let distance = distances / Real::max(blockers, 1.0);
        let mut shadowed = 0.0;
        let mut i = 0;
        while i < filter.len() {
            let (found, limit) = behind(i, filter.get(i), distance);
            if found < limit {
                shadowed += 1.0;
            }
            i += 1;
        }
        // Without blockers all is light, as published: what the filter finds was not to be found.
        if blockers > 0.0 {
            shadowed / filter.len() as f32
        } else {
            0.0
        }
    })
}
