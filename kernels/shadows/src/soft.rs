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
//!
//! Mean moments come from a pyramid of summed-area tables: each level is the table of a map of half the size. A
//! region is read from the first level where it is so small that its sum is below 2^32. So no region is too large, and
//! an integer has 21.8 bits for a number from 0 to 1 whatever the size of the light. With one table it has what the
//! largest region leaves: 17.3 bits for 112 x 234 texels. Moments have to be biased by as much as they are rounded, and
//! a bias lets light into shadows that are close to their blockers.

use hankel_dsl::glam::{UVec2, UVec4, Vec2, Vec3, Vec4};
use hankel_dsl::{
    Buffer, Element, Real, Shared, StorageMut, array_element, barrier, kernel, to_i32,
};
use hankel_moments::{
    Blockers, Fixed4, Fixed6, FixedPoint, Moments4, Moments6, Quantized4, Quantized6, Region, Span,
    blockers_2, blockers_4, blockers_6, dequantize_symmetric_4, dequantize_symmetric_6,
    quantize_symmetric_4, quantize_symmetric_6,
};

use crate::grid::within;
use crate::library::store::symmetric_depth;
use crate::resolve::mean_symmetric;
use crate::samples::Samples;
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
    /// What of these two shares is gone for a receiver at depth 1: the farther off a spot light is, the
    /// smaller it looks. 0 for a directional light.
    #[range(0.0..=1.0)]
    pub narrowing: f32,
    /// Fills the structure up.
    pub padding: f32,
}

/// Texels of a region that is read from a level of a pyramid, at most, with those that it covers in part.
pub const MOST_TEXELS: u32 = 34 * 34;

/// What stands for 1 in a pyramid's integers.
pub const POINT: FixedPoint = FixedPoint::for_kernel(MOST_TEXELS);

impl Area {
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

/// A pyramid of summed-area tables, one after the other, each with its rows from the top.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Element)]
#[repr(C)]
pub struct Pyramid {
    /// Texels of the first level: those of the map.
    #[range(1..=16)]
    pub size: UVec2,
    /// How many levels there are. Each has half as many texels along an axis as the one before, rounded up. The last
    /// one has [`MOST_TEXELS`] at most, so that any region may be read from it.
    #[range(1..=4)]
    pub levels: u32,
    /// Fills the structure up.
    pub padding: u32,
}

/// A level of a [`Pyramid`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Level {
    /// Elements before its first one.
    pub first: u32,
    /// Its texels.
    pub size: UVec2,
}

impl Level {
    /// The one with half as many texels.
    #[inline(always)]
    #[must_use]
    pub fn next(self) -> Self {
        let half = |n: u32| n / 2 + n % 2;
        Self {
            first: self.first + self.size.x * self.size.y,
            size: UVec2::new(half(self.size.x), half(self.size.y)),
        }
    }
}

impl Pyramid {
    /// The first level.
    #[inline(always)]
    #[must_use]
    pub fn base(&self) -> Level {
        Level {
            first: 0,
            size: self.size,
        }
    }

    /// All levels for a map of `size` texels.
    #[must_use]
    pub fn of(size: [u32; 2]) -> Self {
        let mut this = Self {
            size: UVec2::from_array(size),
            levels: 1,
            padding: 0,
        };
        let mut level = this.base();
        while level.size.element_product() > MOST_TEXELS {
            level = level.next();
            this.levels += 1;
        }
        this
    }

    /// All levels, the largest first.
    pub fn all(&self) -> impl Iterator<Item = Level> {
        core::iter::successors(Some(self.base()), |level| Some(level.next()))
            .take(self.levels as usize)
    }
}

/// Two levels of a pyramid: one to read, and the next one to write.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Element)]
#[repr(C)]
pub struct Halving {
    /// Texels of the level to write.
    #[range(1..=16)]
    pub size: UVec2,
    /// Texels of the level to read.
    #[range(1..=32)]
    pub whole: UVec2,
    /// Elements before the first one of the level to read; those of the next level follow its last one.
    #[range(0..=64)]
    pub first: u32,
    /// Fills the structure up.
    pub padding: u32,
}

/// Which lines of a pyramid's levels are summed up: their rows or their columns. A workgroup of 64 invocations has
/// a line.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Element)]
#[repr(C)]
pub struct PyramidLines {
    /// Texels of the first level.
    #[range(1..=64)]
    pub size: UVec2,
    /// 64 for each line of all levels.
    #[range(64..=1024)]
    pub invocations: u32,
    /// 0: rows. 1: columns.
    #[values(0, 1)]
    pub across: u32,
}

/// What a table's entries are made of: integers modulo 2^32.
trait Sums: Copy {
    const ZERO: Self;
    fn plus(self, other: Self) -> Self;
    fn minus(self, other: Self) -> Self;
    /// A fourth of each, the nearest integer.
    fn quarter(self) -> Self;
    /// Those of the far end, which is all that lies beyond a map.
    fn far() -> Self;
}

#[inline(always)]
fn quarter(n: u32) -> u32 {
    (n + 2) / 4
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
    #[inline(always)]
    fn quarter(self) -> Self {
        Self::new(
            quarter(self.x),
            quarter(self.y),
            quarter(self.z),
            quarter(self.w),
        )
    }
    #[inline(always)]
    fn far() -> Self {
        vector(Fixed4::of(far_4(), POINT))
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
    #[inline(always)]
    fn quarter(self) -> Self {
        Self {
            r0: quarter(self.r0),
            g0: quarter(self.g0),
            b0: quarter(self.b0),
            r1: quarter(self.r1),
            g1: quarter(self.g1),
            b1: quarter(self.b1),
        }
    }
    #[inline(always)]
    fn far() -> Self {
        Self::of(far_6(), POINT)
    }
}

/// Moments of the far end. Beyond a map, nothing is nearer.
#[inline(always)]
fn far_4() -> Quantized4<f32> {
    quantize_symmetric_4(Moments4::of_depth(1.0))
}

/// Six moments of the far end.
#[inline(always)]
fn far_6() -> Quantized6<f32> {
    quantize_symmetric_6(Moments6::of_depth(1.0))
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
            #[group_id] group: u32,
            #[shared] totals: Shared<'_, $element, 64>,
            #[uniform] lines: &PyramidLines,
            #[storage] table: StorageMut<'_, $element>,
        ) {
            // Lines do not reach beyond the table, whatever the uniform says.
            let entries = table.len();
            let is_row = lines.across == 0;
            let count = |size: UVec2| if is_row { size.y } else { size.x };
            let mut level = Level {
                first: 0,
                size: lines.size,
            };
            let mut line = group;
            while line >= count(level.size) && count(level.size) > 0 && level.first < entries {
                line -= count(level.size);
                level = level.next();
            }
            let (step, length) = if is_row {
                (1, level.size.x)
            } else {
                (level.size.x, level.size.y)
            };
            let start = level.first + if is_row { line * level.size.x } else { line };
            let place = |k: u32| start + k * step;
            let share = length.div_ceil(64);
            let first = me * share;
            let end = if first + share < length {
                first + share
            } else {
                length
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
    /// Prefix sums along the lines of all levels of a pyramid, in their place, modulo 2^32: each element becomes
    /// the sum of those before it in its line, and of itself. Once along rows and once along columns makes
    /// summed-area tables.
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

macro_rules! halve {
    ($(#[doc = $doc:literal])* $name:ident, $element:ident, $inputs:ident) => {
        $(#[doc = $doc])*
        #[kernel(
            compute,
            threads(8, 8),
            range(halving.size),
            inputs = crate::inputs::soft::$inputs
        )]
        pub fn $name(
            #[index] at: UVec2,
            #[uniform] halving: &Halving,
            #[storage] table: StorageMut<'_, $element>,
        ) {
            let Halving { size, whole, first, .. } = *halving;
            let entries = table.len();
            let texel = |x: u32, y: u32| {
                let place = first + y * whole.x + x;
                if x < whole.x && y < whole.y && place < entries {
                    table.get(place)
                } else {
                    <$element as Sums>::far()
                }
            };
            let (x, y) = (2 * at.x, 2 * at.y);
            let above = Sums::plus(texel(x, y), texel(x + 1, y));
            let below = Sums::plus(texel(x, y + 1), texel(x + 1, y + 1));
            let mean = Sums::quarter(Sums::plus(above, below));
            let place = first + whole.x * whole.y + at.y * size.x + at.x;
            if place < entries {
                table.set(place, mean);
            }
        }
    };
}

halve!(
    /// A level of a pyramid that is to be made of sums, from the one before it: the mean of 2 x 2 texels. What lies
    /// beyond the map counts as its far end.
    halve_summed,
    UVec4,
    halved
);

halve!(
    /// As [`halve_summed`], of six integers.
    halve_summed_6,
    Fixed6,
    halved_6
);

/// The nearest texel of a texture.
#[inline(always)]
fn inside(at: UVec2, size: UVec2) -> UVec2 {
    UVec2::new(within(at.x as i32, size.x), within(at.y as i32, size.y))
}

of_samples! {
    /// Mean of a texel's four moments, depths moved to [-1, 1], in the optimised basis, as integers: the first level of
    /// a pyramid, before [`halve_summed`] makes the others and [`prefix_sums`] their sums.
    #[kernel(compute, threads(8, 8), range(size), pinned, inputs = crate::inputs::soft::resolved)]
    resolve_summed,
    resolve_single_summed,
    (
        #[index] at: UVec2,
        #[uniform] size: &UVec2,
        #[storage] table: StorageMut<'_, UVec4>,
    ),
    |depth; samples| {
        let q = mean_symmetric(depth, inside(at, depth.size()), samples);
        let q = Quantized4 {
            r: q.x,
            g: q.y,
            b: q.z,
            a: q.w,
        };
        let place = at.y * size.x + at.x;
        if place < table.len() {
            table.set(place, vector(Fixed4::of(q, POINT)));
        }
    }
}

of_samples! {
    /// Mean of a texel's six moments, as [`resolve_summed`] has it of four.
    #[kernel(compute, threads(8, 8), range(size), pinned, inputs = crate::inputs::soft::resolved_6)]
    resolve_summed_6,
    resolve_single_summed_6,
    (
        #[index] at: UVec2,
        #[uniform] size: &UVec2,
        #[storage] table: StorageMut<'_, Fixed6>,
    ),
    |depth; samples| {
        let texels = quantized(depth, inside(at, depth.size()), samples);
        let q = Quantized6 {
            r0: texels.first.x,
            g0: texels.first.y,
            b0: texels.first.z,
            r1: texels.second.x,
            g1: texels.second.y,
            b1: texels.second.z,
        };
        let place = at.y * size.x + at.x;
        if place < table.len() {
            table.set(place, Fixed6::of(q, POINT));
        }
    }
}

/// The rectangle within `reach` texels of a place, which is given in texels.
#[inline(always)]
pub(crate) fn region(place: Vec2, reach: Vec2, size: UVec2) -> Region {
    Region {
        x: Span::around(place.x, reach.x, size.x),
        y: Span::around(place.y, reach.y, size.y),
    }
}

/// A region of a pyramid: in the first level where it has no more than [`MOST_TEXELS`], or in the last one.
#[inline(always)]
fn region_of(pyramid: &Pyramid, place: Vec2, reach: Vec2) -> (Level, Region) {
    let most = MOST_TEXELS as f32;
    // Texels that it covers, those at its edges in part.
    let texels = |reach: Vec2| (2.0 * reach.x + 2.0) * (2.0 * reach.y + 2.0);
    let mut level = pyramid.base();
    let (mut place, mut reach) = (place, reach);
    let mut k = 1;
    while k < pyramid.levels && texels(reach) > most {
        level = level.next();
        place = Vec2::new(0.5 * place.x, 0.5 * place.y);
        reach = Vec2::new(0.5 * reach.x, 0.5 * reach.y);
        k += 1;
    }
    (level, region(place, reach, level.size))
}

/// Where in a pyramid the sum over so many columns and rows of a level stands, and the bits of it that count: none if
/// there are no columns or no rows, as nothing comes before the first of them. Without a branch: a region has 16 of
/// these.
#[inline(always)]
fn entry(columns: u32, rows: u32, level: Level) -> (u32, u32) {
    let (is_column, is_row) = (columns.min(1), rows.min(1));
    let index = level.first + (rows - is_row) * level.size.x + (columns - is_column);
    (index, (is_column & is_row).wrapping_neg())
}

/// A pyramid of summed-area tables of four moments.
struct Table<'a> {
    entries: Buffer<'a, UVec4>,
    pyramid: &'a Pyramid,
}

impl Table<'_> {
    /// The sum over so many columns and rows of a level.
    #[inline(always)]
    fn before(&self, columns: u32, rows: u32, level: Level) -> Fixed4 {
        let (i, bits) = entry(columns, rows, level);
        let sum = self.entries.get(i);
        Fixed4 {
            r: sum.x & bits,
            g: sum.y & bits,
            b: sum.z & bits,
            a: sum.w & bits,
        }
    }

    /// The mean moments within `reach` texels of a place. Beyond the map, nothing is nearer than its end.
    #[inline(always)]
    fn around(&self, place: Vec2, reach: Vec2) -> Moments4<f32> {
        let (level, region) = region_of(self.pyramid, place, reach);
        dequantize_symmetric_4(region.mean_4(POINT, far_4(), |columns, rows| {
            self.before(columns, rows, level)
        }))
    }

    /// The same over all texels that the region touches, by a quarter of the reads.
    #[inline(always)]
    fn touched(&self, place: Vec2, reach: Vec2) -> Moments4<f32> {
        let (level, region) = region_of(self.pyramid, place, reach);
        dequantize_symmetric_4(region.mean_touched_4(POINT, far_4(), |columns, rows| {
            self.before(columns, rows, level)
        }))
    }
}

/// [`Table`] of six moments.
struct Table6<'a> {
    entries: Buffer<'a, Fixed6>,
    pyramid: &'a Pyramid,
}

impl Table6<'_> {
    #[inline(always)]
    fn before(&self, columns: u32, rows: u32, level: Level) -> Fixed6 {
        let (i, bits) = entry(columns, rows, level);
        let sum = self.entries.get(i);
        Fixed6 {
            r0: sum.r0 & bits,
            g0: sum.g0 & bits,
            b0: sum.b0 & bits,
            r1: sum.r1 & bits,
            g1: sum.g1 & bits,
            b1: sum.b1 & bits,
        }
    }

    #[inline(always)]
    fn around(&self, place: Vec2, reach: Vec2) -> Moments6<f32> {
        let (level, region) = region_of(self.pyramid, place, reach);
        dequantize_symmetric_6(region.mean_6(POINT, far_6(), |columns, rows| {
            self.before(columns, rows, level)
        }))
    }

    #[inline(always)]
    fn touched(&self, place: Vec2, reach: Vec2) -> Moments6<f32> {
        let (level, region) = region_of(self.pyramid, place, reach);
        dequantize_symmetric_6(region.mean_touched_6(POINT, far_6(), |columns, rows| {
            self.before(columns, rows, level)
        }))
    }
}

/// A place in the map in texels.
#[inline(always)]
pub(crate) fn in_texels(uv: Vec2, size: UVec2) -> Vec2 {
    Vec2::new(uv.x * size.x as f32, uv.y * size.y as f32)
}

/// What the lecture adds of the receiver's own depth to the mean of the blockers'.
const EPSILON: f32 = 1e-3;

/// The mean distance of the blockers that a search has found, in depths of [0, 1]. It has compared with a depth that is
/// nearer than the receiver by `nearer`.
#[inline(always)]
fn mean_distance(found: Blockers<f32>, nearer: f32) -> f32 {
    let Blockers { share, moment } = found;
    // They are told from the nearer depth; distances are those of depths in [-1, 1].
    let moment = moment + 2.0 * nearer * share;
    0.5 * Blockers { share, moment }.distance(EPSILON)
}

/// What some lookups have found, one after the other.
struct Found {
    /// The mean distance of the last one's blockers, and of the one's before.
    distance: f32,
    before: f32,
    /// How much nearer than the receiver a blocker has to be in the next one.
    nearer: f32,
    /// The share of blockers in the last one.
    share: f32,
}

impl Found {
    /// Whether there may be shadow. One lookup without blockers does not say so, as a lower bound is often 0 for thin
    /// casters in a large region. After two of them, further ones would be the same.
    #[inline(always)]
    fn any(&self) -> bool {
        self.distance > 0.0 || self.before > 0.0
    }
}

/// As many lookups for a receiver at depth `z`: the first wherever the light may be behind something, each other one
/// within the penumbra that the one before tells. What is nearer than the receiver by less than the area's margin times
/// the distance does not block; for the first lookup, by less than `nearer`. `blockers` tells those of a region that are
/// nearer than some depth. A loop, so that a shader has its code once.
#[inline(always)]
fn look_up(
    area: &Area,
    z: f32,
    nearer: f32,
    lookups: u32,
    blockers: impl Fn(Vec2, f32) -> Blockers<f32>,
) -> Found {
    let margin = area.seen_from(area.margin, z);
    let mut found = Found {
        distance: Real::saturate(z),
        before: 1.0,
        nearer,
        share: 0.0,
    };
    let mut step = 0;
    while step < lookups && found.any() {
        let now = blockers(area.reach(found.distance), z - found.nearer);
        let distance = mean_distance(now, found.nearer);
        found = Found {
            distance,
            before: found.distance,
            nearer: margin * distance,
            share: now.share,
        };
        step += 1;
    }
    found
}

/// The shadow of a receiver at depth `z` by moments. Blockers are searched twice: wherever the light may be behind
/// something, which mixes near blockers with far ones that the receiver does not see, and then within the penumbra that
/// this tells. `touched` is for that, the blockers in all texels that a region touches: a mean distance needs no more.
/// `within` tells those in exactly the region, for the shadow.
#[inline(always)]
fn shadow(
    area: &Area,
    z: f32,
    touched: impl Fn(Vec2, f32) -> Blockers<f32>,
    within: impl Fn(Vec2, f32) -> Blockers<f32>,
) -> f32 {
    let nearer = area.seen_from(area.margin, z) * Real::saturate(z);
    let found = look_up(area, z, nearer, 2, touched);
    if found.any() {
        within(area.reach(found.distance), z - found.nearer).share
    } else {
        0.0
    }
}

/// Shading with moment soft shadow mapping: the blockers' distance by the moments of all that the light may
/// be behind, the penumbra's width by that, and the shadow by the moments within. `table` is the pyramid.
#[kernel(
    fragment,
    inputs = crate::inputs::soft::shaded,
    parity(
        ulp = 0,
        absolute = 3e-2,
        why = "sums of products that a driver may contract: a moment is off by up to 2.4e-7, and the bias is 1e-6; where a region has only a few depths the bound is off by about a hundredth, and the light's strength is 2.5"
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
    #[uniform] pyramid: &Pyramid,
    #[storage]
    #[length(512)]
    table: Buffer<'_, UVec4>,
) -> Vec4 {
    shade_with(light, world, normal, colour, |uv, z| {
        let table = Table {
            entries: table,
            pyramid,
        };
        let place = in_texels(uv, pyramid.size);
        let blockers = |b: Moments4<f32>, z: f32| blockers_4(biased(light, b), symmetric_depth(z));
        shadow(
            area,
            z,
            |reach, z| blockers(table.touched(place, reach), z),
            |reach, z| blockers(table.around(place, reach), z),
        )
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
        why = "sums of products that a driver may contract: a moment is off by up to 2.4e-7, and the bias is 5e-6; where a region has only a few depths the bound is off by about a hundredth, and the light's strength is 2.5"
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
    #[uniform] pyramid: &Pyramid,
    #[storage]
    #[length(512)]
    table: Buffer<'_, Fixed6>,
) -> Vec4 {
    shade_with(light, world, normal, colour, |uv, z| {
        let table = Table6 {
            entries: table,
            pyramid,
        };
        let place = in_texels(uv, pyramid.size);
        let blockers = |b: Moments6<f32>, z: f32| {
            blockers_6(b.lerp(*target, light.moment_bias), symmetric_depth(z))
        };
        shadow(
            area,
            z,
            |reach, z| blockers(table.touched(place, reach), z),
            |reach, z| blockers(table.around(place, reach), z),
        )
    })
}

/// The texel of a place that is given in texels; beyond the map, the nearest one.
#[inline(always)]
pub(crate) fn nearest(place: Vec2, size: UVec2) -> UVec2 {
    let within = |x: f32, size: u32| to_i32(Real::clamp(x, 0.0, (size - 1) as f32)) as u32;
    UVec2::new(within(place.x, size.x), within(place.y, size.y))
}

of_samples! {
    /// Shading with variance soft shadow mapping (\[VSSM\]): as moment soft shadow mapping, by mean and variance.
    /// They bound nothing where the mean is not before the receiver. So a region is divided into `parts` by
    /// `parts` smaller ones; in those where that is so, 2 x 2 depths of the map are compared instead. The
    /// moments are as they are: against rounding, `moment_bias` is the least variance.
    #[kernel(fragment, pinned, inputs = crate::inputs::soft::shaded_parts)]
    shade_vssm,
    shade_single_vssm,
    (
        #[varying] world: Vec3,
        #[varying]
        #[unit_vector]
        normal: Vec3,
        #[varying]
        #[range(0.0..=1.0)]
        colour: Vec3,
        #[uniform] light: &Light,
        #[uniform] area: &Area,
        #[uniform] pyramid: &Pyramid,
        #[storage]
        #[length(512)]
        table: Buffer<'_, UVec4>,
        #[constant(id = 0, default = 3)]
        #[values(1, 2, 3, 4)]
        parts: u32,
    ) -> Vec4,
    |depth| {
        shade_with(light, world, normal, colour, |uv, z| {
            let table = Table {
                entries: table,
                pyramid,
            };
            let place = in_texels(uv, pyramid.size);
            let per_part = 1.0 / parts as f32;
            look_up(area, z, 0.0, 2, |reach, z| {
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
                            let found = depth.load_sample(nearest(at, depth.size()), 0).x;
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
            })
            .share
        })
    }
}

/// The most points that percentage-closer soft shadows look at, for either purpose.
pub const MOST_POINTS: usize = 512;

/// Where percentage-closer soft shadows look: points of the light, in units of its half width.
#[derive(Clone, Copy, Debug, PartialEq, Element)]
#[repr(C)]
pub struct Points {
    /// How many are looked at for blockers.
    #[range(1..=40)]
    pub search: u32,
    /// How many are looked at for the shadow.
    #[range(1..=40)]
    pub filter: u32,
    /// Fills the structure up.
    pub padding: UVec2,
    /// Where for blockers (x, y), and where for the shadow (z, w).
    #[range(-1.0..=1.0)]
    pub places: [Vec4; MOST_POINTS],
}

impl Points {
    /// Those of a search and of a filter.
    ///
    /// # Panics
    /// With more than [`MOST_POINTS`].
    #[cfg(not(target_arch = "spirv"))]
    #[must_use]
    pub fn new(search: &[Vec2], filter: &[Vec2]) -> Self {
        let mut places = [Vec4::ZERO; MOST_POINTS];
        for (i, point) in search.iter().enumerate() {
            (places[i].x, places[i].y) = (point.x, point.y);
        }
        for (i, point) in filter.iter().enumerate() {
            (places[i].z, places[i].w) = (point.x, point.y);
        }
        Self {
            search: search.len() as u32,
            filter: filter.len() as u32,
            padding: UVec2::ZERO,
            places,
        }
    }
}

of_samples! {
    /// Shading with percentage-closer soft shadows: the mean distance of the blockers among some depths, and the
    /// share of blockers among others, within the penumbra. `points` are where to look. Each depth is compared with
    /// what the steepest surface that does not shade itself has there. Of multisampled texels, one sample is looked
    /// at, another one for each point.
    #[kernel(fragment, pinned, inputs = crate::inputs::soft::searched)]
    shade_pcss,
    shade_single_pcss,
    (
        #[varying] world: Vec3,
        #[varying]
        #[unit_vector]
        normal: Vec3,
        #[varying]
        #[range(0.0..=1.0)]
        colour: Vec3,
        #[uniform] light: &Light,
        #[uniform] area: &Area,
        #[uniform] points: &Points,
    ) -> Vec4,
    |depth; samples| {
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
                let sample = i.checked_rem(samples).unwrap_or(0);
                (depth.load_sample(nearest(at, size), sample).x, z - slack)
            };
            let (mut distances, mut blockers) = (0.0, 0.0);
            let mut i = 0;
            while i < points.search {
                let point = array_element(&points.places, i);
                let (found, limit) = behind(i, Vec2::new(point.x, point.y), z);
                if found < limit {
                    distances += z - found;
                    blockers += 1.0;
                }
                i += 1;
            }
            let mut shadow = 0.0;
            // Without blockers all is light, as published: what the filter finds was not to be found.
            if blockers > 0.0 {
                let distance = distances / blockers;
                let mut shadowed = 0.0;
                let mut i = 0;
                while i < points.filter {
                    let point = array_element(&points.places, i);
                    let (found, limit) = behind(i, Vec2::new(point.z, point.w), distance);
                    if found < limit {
                        shadowed += 1.0;
                    }
                    i += 1;
                }
                shadow = shadowed / points.filter as f32;
            }
            shadow
        })
    }
}
