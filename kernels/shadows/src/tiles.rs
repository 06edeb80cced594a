//! Tiles of a shadow map. What the depths of a tile and of those around it lie between decides the shadow
//! of most receivers: it is full where all depths are in front of them, and there is none where they lie
//! on a plane, or in front of one, that all depths are behind. Only elsewhere a map is read, and tiles
//! that no caster comes near need no map at all.
//!
//! A list of the other tiles, and how many there are, stays on the device: passes over listed tiles run
//! as far as it says.

use hankel_dsl::format::Rgba16Unorm;
use hankel_dsl::glam::{UVec2, Vec2, Vec3, Vec4};
use hankel_dsl::{
    Atomics, Buffer, Element, Real, Sampler, StorageMut, StorageTexture2d, Texture2d, kernel,
    to_i32,
};
use hankel_moments::hamburger_4;

use crate::blur::{Taps, filtered};
use crate::grid::within;
use crate::resolve::mean_symmetric;
use crate::samples::Samples;
use crate::shade::{
    Light, biased, encoding, in_range, look_up, shade_by, shade_with, weighted_nearer,
};

/// Texels of a tile along each axis.
pub const EDGE: u32 = 8;
/// Texels of a tile: invocations of a workgroup.
pub const TEXELS: u32 = EDGE * EDGE;
/// Listed tiles in a row of workgroups: rows are added as tiles are listed, of which WebGPU runs at most
/// 65535.
pub const ACROSS: u32 = 256;
/// What a moment bias of 6e-5 hides: in front of a plane by less than this, in units of the map's depth,
/// nothing casts a shadow on it that four moments in 16 bits show. They spread a surface by four times
/// as much.
const HIDDEN: f32 = 1e-3;

/// How far passes over listed tiles run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Element)]
#[repr(C)]
pub struct Listed {
    /// Invocations: rows of workgroups.
    pub size: UVec2,
    /// Tiles in the list.
    pub tiles: u32,
    /// Fills the structure up.
    pub padding: u32,
}

/// A map's tiles.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Element)]
#[repr(C)]
pub struct Tiles {
    /// Tiles along u and v, the last ones not always whole.
    #[range(1..=8192)]
    pub across: UVec2,
}

/// What depths lie between: a plane that none is in front of, and the greatest of them.
#[derive(Clone, Copy, Debug, PartialEq, Element)]
#[repr(C)]
pub struct Bounds {
    /// By how much the plane's depth grows from texel to texel, along u and along v.
    #[range(-0.01..=0.01)]
    pub slope: Vec2,
    /// Its depth in the middle of the tile.
    #[range(0.0..=1.0)]
    pub least: f32,
    /// The greatest depth.
    #[range(0.0..=1.0)]
    pub most: f32,
}

/// How many tiles `texels` need.
#[inline(always)]
#[expect(
    clippy::manual_div_ceil,
    reason = "`div_ceil` has a branch, which would be in the texts"
)]
pub const fn tiles_of(texels: u32) -> u32 {
    (texels + EDGE - 1) / EDGE
}

/// From a tile's middle to the centre of its texel `i`.
#[inline(always)]
fn from_middle(i: u32) -> f32 {
    i as f32 - 0.5 * (EDGE - 1) as f32
}

of_samples! {
    /// What the depths of each tile lie between, of all samples; tiles follow each other row by row. The
    /// plane's slope is that of the depths between opposite edges of the tile.
    #[kernel(
        compute,
        threads(8, 8),
        range(tiles.across),
        inputs = crate::inputs::tiles::depths,
        parity(
            ulp = 0,
            absolute = 1e-6,
            why = "drivers may contract products and sums, once in each of three terms of a plane's depth"
        )
    )]
    tile_depths,
    tile_single_depths,
    (
        #[index] tile: UVec2,
        #[uniform] tiles: &Tiles,
    ) -> Bounds,
    |depth; samples| {
        // It says the range.
        let _ = tiles;
        bounds(depth, tile, samples)
    }
}

/// What the depths of a tile lie between; depths beyond [0, 1] are moved to its ends.
#[inline(always)]
fn bounds(depth: impl Samples, tile: UVec2, samples: u32) -> Bounds {
    let size = depth.size();
    let (left, top) = (EDGE * tile.x, EDGE * tile.y);
    let load = |x: u32, y: u32, sample: u32| {
        let at = UVec2::new(
            within((left + x) as i32, size.x),
            within((top + y) as i32, size.y),
        );
        Real::saturate(depth.load_sample(at, sample).x)
    };
    let last = EDGE - 1;
    let width = last as f32;
    let slope = Vec2::new(
        (load(last, EDGE / 2, 0) - load(0, EDGE / 2, 0)) / width,
        (load(EDGE / 2, last, 0) - load(EDGE / 2, 0, 0)) / width,
    );
    let (mut least, mut most) = (2.0, 0.0);
    let mut y = 0;
    while y < EDGE {
        let mut x = 0;
        while x < EDGE {
            let plane = slope.x * from_middle(x) + slope.y * from_middle(y);
            let mut sample = 0;
            while sample < samples {
                let z = load(x, y, sample);
                least = Real::min(least, z - plane);
                most = Real::max(most, z);
                sample += 1;
            }
            x += 1;
        }
        y += 1;
    }
    Bounds { slope, least, most }
}

/// What the depths of each tile and of those around it lie between, by the slope of the tile. Where one of
/// the depths is nearer than the far end, 1, the tile is listed: its place along u in 16 bits, and along v.
#[kernel(
    compute,
    threads(8, 8),
    range(tiles.across),
    inputs = crate::inputs::tiles::of_depths,
    parity(
        ulp = 0,
        absolute = 1e-6,
        non_finite,
        why = "drivers may contract products and sums, once in each of three terms of a plane's depth; absurd depths overflow"
    )
)]
pub fn tile_list(
    #[index] at: UVec2,
    #[uniform] tiles: &Tiles,
    #[storage] depths: Buffer<'_, Bounds>,
    #[constant(id = 0, default = 1)]
    #[values(1, 2)]
    reach: u32,
    #[atomic] listed: Atomics<'_>,
    #[storage(unordered)] list: StorageMut<'_, u32>,
) -> Bounds {
    let (x, y) = (at.x as i32, at.y as i32);
    let tile = |x: i32, y: i32| {
        let (x, y) = (within(x, tiles.across.x), within(y, tiles.across.y));
        depths.get(within((y * tiles.across.x + x) as i32, depths.len()))
    };
    let slope = tile(x, y).slope;
    let (mut least, mut most) = (2.0, 0.0);
    let mut is_empty = true;
    let reach = reach as i32;
    let mut dy = -reach;
    while dy <= reach {
        let mut dx = -reach;
        while dx <= reach {
            let other = tile(x + dx, y + dy);
            // Of the difference of both planes, the least is at a corner of the other tile.
            let half = 0.5 * EDGE as f32;
            let turned = Real::abs(other.slope.x - slope.x) + Real::abs(other.slope.y - slope.y);
            let away = slope.x * (dx * EDGE as i32) as f32 + slope.y * (dy * EDGE as i32) as f32;
            least = Real::min(least, other.least - half * turned - away);
            most = Real::max(most, other.most);
            let is_flat = (other.slope.x == 0.0) & (other.slope.y == 0.0);
            is_empty = is_empty & is_flat & (other.least >= 1.0);
            dx += 1;
        }
        dy += 1;
    }
    if !is_empty {
        let place = listed.add(2, 1);
        listed.max(0, ACROSS * TEXELS);
        listed.max(1, place / ACROSS + 1);
        if place < list.len() {
            list.set(place, at.x | (at.y << 16));
        }
    }
    Bounds { slope, least, most }
}

/// The texel of an invocation over listed tiles; beyond the map where it has none.
#[inline(always)]
fn texel(at: UVec2, listed: &Listed, list: Buffer<'_, u32>, map: UVec2) -> UVec2 {
    let place = at.y * ACROSS + at.x / TEXELS;
    let mut texel = map;
    if (place < listed.tiles) & (place < list.len()) {
        let tile = list.get(place);
        let inside = at.x % TEXELS;
        texel = UVec2::new(
            EDGE * (tile & 0xffff) + inside % EDGE,
            EDGE * (tile >> 16) + inside / EDGE,
        );
    }
    texel
}

of_samples! {
    /// [`crate::resolve::resolve_symmetric`] for listed tiles.
    #[kernel(
        compute,
        threads(64, 1),
        range(listed.size),
        inputs = crate::inputs::tiles::listed_depths,
        parity(
            ulp = 0,
            absolute = 1.6e-5,
            why = "sums and products only, then rounding to 1/65535: drivers may round a tie either way, which is one step"
        )
    )]
    resolve_symmetric_tiles,
    resolve_single_symmetric_tiles,
    (
        #[index] at: UVec2,
        #[uniform] listed: &Listed,
        #[storage]
        #[distinct]
        list: Buffer<'_, u32>,
        #[texture] map: StorageTexture2d<'_, Rgba16Unorm>,
    ),
    |depth; samples| {
        let size = depth.size();
        let texel = texel(at, listed, list, size);
        if (texel.x < size.x) & (texel.y < size.y) {
            map.store(texel, mean_symmetric(depth, texel, samples));
        }
    }
}

/// [`crate::blur::blur`] for listed tiles.
#[kernel(
    compute,
    threads(64, 1),
    range(listed.size),
    inputs = crate::inputs::tiles::listed_moments,
    parity(
        ulp = 0,
        absolute = 1.6e-5,
        non_finite,
        why = "sums and products only, then rounding to 1/65535: drivers may round a tie either way, which is one step"
    )
)]
pub fn blur_tiles(
    #[index] at: UVec2,
    #[uniform] listed: &Listed,
    #[storage]
    #[distinct]
    list: Buffer<'_, u32>,
    #[uniform] taps: &Taps,
    #[texture] source: Texture2d<'_>,
    #[texture] map: StorageTexture2d<'_, Rgba16Unorm>,
) {
    let size = source.size();
    let texel = texel(at, listed, list, size);
    if (texel.x < size.x) & (texel.y < size.y) {
        map.store(texel, filtered(texel, taps, source, |t| t));
    }
}

/// The shadow of a receiver at `z` where the depths that a filter takes in lie in `between`; the filter is
/// asked only where they do not decide. Where the receiver is behind the plane by less than `slack` or by
/// what half a texel makes out, it lies on it.
#[inline(always)]
fn unless_settled(
    map: UVec2,
    between: Buffer<'_, Bounds>,
    slack: f32,
    uv: Vec2,
    z: f32,
    filter: impl FnOnce() -> f32,
) -> f32 {
    let texels = |t: f32, size: u32| Real::clamp(t * size as f32, 0.0, size as f32);
    let (u, v) = (texels(uv.x, map.x), texels(uv.y, map.y));
    // Not negative, so that cutting the fraction off is rounding down.
    let tile = |t: f32, size: u32| within(to_i32(t), size) / EDGE;
    let (x, y) = (tile(u, map.x), tile(v, map.y));
    let i = within((y * tiles_of(map.x) + x) as i32, between.len());
    let depths = between.get(i);
    let slope = depths.slope;
    let from_middle = |t: f32, tile: u32| t - (tile * EDGE) as f32 - 0.5 * EDGE as f32;
    let plane = depths.least + slope.x * from_middle(u, x) + slope.y * from_middle(v, y);
    let half_texel = 0.5 * (Real::abs(slope.x) + Real::abs(slope.y));
    let mut shadow = 0.0;
    if z > plane + half_texel + slack {
        shadow = 1.0;
        if z <= depths.most {
            shadow = filter();
        }
    }
    shadow
}

/// [`crate::shade::shade_hamburger`] where a tile's depths do not decide.
#[kernel(
    fragment,
    inputs = crate::inputs::tiles::shaded,
    parity(
        ulp = 0,
        absolute = 5e-4,
        why = "the depth in the light's view is rounded, by up to 3e-7, and the bound's steepest slope with the least bias, 5e-7, is 1400"
    )
)]
pub fn shade_hamburger_tiles(
    #[varying] world: Vec3,
    #[varying]
    #[unit_vector]
    normal: Vec3,
    #[varying]
    #[range(0.0..=1.0)]
    colour: Vec3,
    #[uniform] light: &Light,
    #[storage] between: Buffer<'_, Bounds>,
    #[texture] map: Texture2d<'_>,
    #[sampler] sampler: Sampler,
) -> Vec4 {
    shade_with(light, world, normal, colour, |uv, z| {
        unless_settled(map.size(), between, HIDDEN, uv, z, || {
            let m = look_up(map, sampler, encoding::SYMMETRIC, uv);
            hamburger_4(biased(light, m), in_range(z, encoding::SYMMETRIC))
        })
    })
}

of_samples! {
    /// [`crate::shade::shade_pcf_gaussian`] where a tile's depths do not decide.
    #[kernel(
        fragment,
        inputs = crate::inputs::tiles::weighted_depths,
        parity(
            ulp = 0,
            absolute = 4e-5,
            why = "drivers may contract products and sums: a place in a map of 61 texels is then off by 4e-6 texels, and so are the weights of the light, whose strength is 2.5"
        )
    )]
    shade_pcf_gaussian_tiles,
    shade_single_pcf_gaussian_tiles,
    (
        #[varying] world: Vec3,
        #[varying]
        #[unit_vector]
        normal: Vec3,
        #[varying]
        #[range(0.0..=1.0)]
        colour: Vec3,
        #[uniform] light: &Light,
        #[uniform] taps: &Taps,
        #[storage] between: Buffer<'_, Bounds>,
    ) -> Vec4,
    |depth; samples| {
        shade_by(light, world, normal, colour, |uv, z| {
            unless_settled(depth.size(), between, 0.0, uv, z, || {
                weighted_nearer(depth, taps, samples, uv, z)
            })
        })
    }
}
