//! Fast approximate antialiasing, a formulation of its own of the published idea (Lottes, FXAA, 2009):
//! find edges by their contrast, follow each to its ends, and move the pixel across it by as much as
//! the edge would cover.

use hankel_dsl::glam::{UVec2, Vec2, Vec4};
use hankel_dsl::{Element, Real, Sampler, Texture2d, kernel, math};

/// When a pixel is on an edge.
#[derive(Clone, Copy, Debug, PartialEq, Element)]
#[repr(C)]
pub struct Contrast {
    /// The contrast that counts, as a share of the brightest neighbour.
    #[default(0.125)]
    #[range(0.05..=0.3)]
    pub relative: f32,
    /// The contrast that counts at least.
    #[default(0.04)]
    #[range(0.02..=0.1)]
    pub absolute: f32,
    /// How much of what is thinner than a pixel is taken away, 0 to 1.
    #[default(0.75)]
    #[range(0.0..=1.0)]
    pub thin: f32,
    /// Fills the structure up.
    pub padding: f32,
}

/// How bright a colour as it is displayed looks (ITU-R BT.601).
#[inline(always)]
fn luma(colour: Vec4) -> f32 {
    colour.x * 0.299 + colour.y * 0.587 + colour.z * 0.114
}

/// The picture with smoother edges. Its sampler filters linearly and clamps to the edge.
#[kernel(
    compute,
    threads(8, 8),
    texture(rgba8unorm),
    parity(
        ulp = 0,
        absolute = 4e-3,
        why = "one step of the format: rounding of a tie is the driver's choice"
    )
)]
pub fn fxaa(
    #[index] at: UVec2,
    #[uniform] contrast: &Contrast,
    #[texture]
    #[size(61, 37)]
    source: Texture2d<'_>,
    #[sampler] sampler: Sampler,
) -> Vec4 {
    let texels = source.size();
    let last = texels - UVec2::ONE;
    // Neighbours, the edge's texels beyond the edge.
    let near = |x: u32, y: u32| {
        let x = if x > last.x { last.x } else { x };
        let y = if y > last.y { last.y } else { y };
        luma(source.load(UVec2::new(x, y)))
    };
    let left = at.x - u32::from(at.x > 0);
    let up = at.y - u32::from(at.y > 0);
    let (right, down) = (at.x + 1, at.y + 1);
    let colour = source.load(at);
    let middle = luma(colour);
    let (north, south) = (near(at.x, up), near(at.x, down));
    let (west, east) = (near(left, at.y), near(right, at.y));
    let most = north.max_of(south).max_of(west.max_of(east)).max_of(middle);
    let least = north.min_of(south).min_of(west.min_of(east)).min_of(middle);
    let range = most - least;
    if range < contrast.absolute.max_of(most * contrast.relative) {
        return colour;
    }
    let (north_west, north_east) = (near(left, up), near(right, up));
    let (south_west, south_east) = (near(left, down), near(right, down));

    // Second differences across rows and columns: the edge runs where they are larger.
    let across_rows = Real::abs(north + south - 2.0 * middle) * 2.0
        + Real::abs(north_west + south_west - 2.0 * west)
        + Real::abs(north_east + south_east - 2.0 * east);
    let across_columns = Real::abs(west + east - 2.0 * middle) * 2.0
        + Real::abs(north_west + north_east - 2.0 * north)
        + Real::abs(south_west + south_east - 2.0 * south);
    let is_flat = across_rows >= across_columns;
    let (before, after) = if is_flat {
        (north, south)
    } else {
        (west, east)
    };

    // The side of the pixel on which the edge lies, and the brightness in the middle of it.
    let (rise_before, rise_after) = (Real::abs(before - middle), Real::abs(after - middle));
    let is_before = rise_before >= rise_after;
    let (side, beyond, rise) = if is_before {
        (-1.0, before, rise_before)
    } else {
        (1.0, after, rise_after)
    };
    let on_edge = 0.5 * (middle + beyond);

    // Both ends of the edge: where the brightness leaves that of the edge.
    let size = Vec2::new(texels.x as f32, texels.y as f32);
    let (across, along) = if is_flat {
        (Vec2::new(0.0, side), Vec2::new(1.0, 0.0))
    } else {
        (Vec2::new(side, 0.0), Vec2::new(0.0, 1.0))
    };
    let here = Vec2::new(at.x as f32 + 0.5, at.y as f32 + 0.5);
    let start = here + across * 0.5;
    let beside = |steps: f32| {
        luma(source.sample_level(sampler, (start + along * steps) / size, 0.0)) - on_edge
    };
    let limit = rise * 0.25;
    let (mut back, mut forth) = (1.0, 1.0);
    let (mut end_back, mut end_forth) = (beside(-1.0), beside(1.0));
    while Real::abs(end_back) < limit && back < 10.0 {
        back += 1.0;
        end_back = beside(-back);
    }
    while Real::abs(end_forth) < limit && forth < 10.0 {
        forth += 1.0;
        end_forth = beside(forth);
    }
    // At the nearer end the edge steps to this pixel's side or away from it. Only what it steps
    // over is covered.
    let is_back = back < forth;
    let (nearer, end) = if is_back {
        (back, end_back)
    } else {
        (forth, end_forth)
    };
    let mut shift = 0.0;
    if (end < 0.0) != (middle < on_edge) {
        shift = 0.5 - nearer / (back + forth);
    }

    // What is thinner than a pixel stands out of its surroundings.
    let around = (2.0 * (north + south + (west + east))
        + (north_west + north_east + (south_west + south_east)))
        * (1.0 / 12.0);
    let stands_out = math::smoothstep(0.0, 1.0, Real::saturate(Real::abs(around - middle) / range));
    let thin = stands_out * stands_out * contrast.thin;
    source.sample_level(sampler, (here + across * shift.max_of(thin)) / size, 0.0)
}

/// `Real`'s smaller and larger one, by names that are not those of `f32`.
trait Ordered {
    fn min_of(self, other: f32) -> f32;
    fn max_of(self, other: f32) -> f32;
}

impl Ordered for f32 {
    #[inline(always)]
    fn min_of(self, other: f32) -> f32 {
        Real::min(self, other)
    }
    #[inline(always)]
    fn max_of(self, other: f32) -> f32 {
        Real::max(self, other)
    }
}
