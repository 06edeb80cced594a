//! Ambient occlusion in screen space (McGuire, Osman, Bukowski and Hennessy, The Alchemy Screen-Space
//! Ambient Obscurance Algorithm, 2011, equation 10), of depths alone, and a blur that keeps edges.

use hankel_dsl::glam::{UVec2, Vec2, Vec3};
use hankel_dsl::{Element, Real, Texture2d, kernel, to_i32};

use crate::particles::hash;

/// The camera, and what counts as near.
#[derive(Clone, Copy, Debug, PartialEq, Element)]
#[repr(C)]
pub struct View {
    /// Half the picture's width and height at distance 1, in metres.
    #[range(0.4..=1.0)]
    pub half: Vec2,
    /// How far occluders count, in metres.
    #[range(0.1..=0.5)]
    pub radius: f32,
    /// The slope, seen from the receiver, below which nothing occludes: hides what rounding of
    /// depths makes.
    #[range(0.01..=0.05)]
    pub bias: f32,
    /// Factor of the occlusion.
    #[range(0.5..=2.0)]
    pub strength: f32,
    /// Distances whose difference is this, in metres, do not share in the blur.
    #[range(0.1..=0.5)]
    pub edge: f32,
    /// Fills the structure up.
    pub padding: Vec2,
}

/// Samples of a pixel.
const SAMPLES: u32 = 12;
/// Cosine and sine of the golden angle, pi (3 - sqrt(5)): the turn from one sample to the next (Vogel,
/// A better way to construct the sunflower head, 1979).
const TURN: Vec2 = Vec2::new(-0.737_368_9, 0.675_490_3);

/// How much of the ambient light comes to each pixel, 0 to 1. The depths are distances along the view
/// axis in metres.
#[kernel(
    compute,
    threads(8, 8),
    texture(r32float),
    pinned,
    parity(non_finite, why = "positions of absurd depths overflow")
)]
pub fn ssao(
    #[index] at: UVec2,
    #[uniform] view: &View,
    #[texture]
    #[size(61, 37)]
    depths: Texture2d<'_>,
) -> f32 {
    let texels = depths.size();
    let last = texels - UVec2::ONE;
    let size = Vec2::new(texels.x as f32, texels.y as f32);
    let place = |x: u32, y: u32| {
        let depth = depths.load(UVec2::new(x, y)).x;
        let on_screen = (Vec2::new(x as f32, y as f32) + 0.5) / size * 2.0 - 1.0;
        (on_screen * view.half * depth).extend(depth)
    };
    let here = place(at.x, at.y);
    // The normal from the neighbours that are nearer in depth.
    let east = place(if at.x < last.x { at.x + 1 } else { at.x }, at.y) - here;
    let west = here - place(at.x - u32::from(at.x > 0), at.y);
    let south = place(at.x, if at.y < last.y { at.y + 1 } else { at.y }) - here;
    let north = here - place(at.x, at.y - u32::from(at.y > 0));
    let nearer = |a: Vec3, b: Vec3, has_a: bool, has_b: bool| {
        if has_a && (!has_b || Real::abs(a.z) < Real::abs(b.z)) {
            a
        } else {
            b
        }
    };
    let along_x = nearer(east, west, at.x < last.x, at.x > 0);
    let along_y = nearer(south, north, at.y < last.y, at.y > 0);
    // Towards the camera, which looks along z.
    let normal = along_y.cross(along_x);
    let normal = normal / Real::sqrt(normal.dot(normal) + 1e-30);

    // The radius in texels, and a first direction that differs from pixel to pixel: a point of the
    // circle without sine and cosine.
    let reach = Real::clamp(view.radius / here.z / view.half.x * 0.5 * size.x, 1.0, 64.0);
    let noise = hash(at.x + texels.x * at.y);
    let t = (noise >> 8) as f32 * (1.0 / 16_777_216.0);
    let mut direction = Vec2::new(1.0 - t * t, 2.0 * t) / (1.0 + t * t);
    if noise & 1 == 1 {
        direction = -direction;
    }
    if noise & 2 == 2 {
        direction = Vec2::new(-direction.y, direction.x);
    }
    let from = Vec2::new(at.x as f32 + 0.5, at.y as f32 + 0.5);
    let mut sum = 0.0;
    let mut i = 0;
    while i < SAMPLES {
        let radius = reach * Real::sqrt((i as f32 + 0.5) * (1.0 / SAMPLES as f32));
        let to = from + direction * radius;
        direction = Vec2::new(
            direction.x * TURN.x - direction.y * TURN.y,
            direction.x * TURN.y + direction.y * TURN.x,
        );
        let x = to_i32(Real::clamp(to.x, 0.0, size.x - 1.0)) as u32;
        let y = to_i32(Real::clamp(to.y, 0.0, size.y - 1.0)) as u32;
        let towards = place(x, y) - here;
        let square = towards.dot(towards);
        // What is farther away than the radius does not count.
        if square < view.radius * view.radius {
            let height = towards.dot(normal) - view.bias * here.z;
            sum += Real::max(height, 0.0) / (square + 1e-4);
        }
        i += 1;
    }
    Real::max(
        1.0 - sum * (view.strength * view.radius) * (2.0 / SAMPLES as f32),
        0.0,
    )
}

/// The mean of 5 by 5 pixels, those alone whose depths are near.
#[kernel(
    compute,
    threads(8, 8),
    texture(r32float),
    pinned,
    parity(non_finite, why = "differences of absurd depths overflow")
)]
pub fn ssao_blur(
    #[index] at: UVec2,
    #[uniform] view: &View,
    #[texture]
    #[size(61, 37)]
    depths: Texture2d<'_>,
    #[texture]
    #[size(61, 37)]
    light: Texture2d<'_>,
) -> f32 {
    let last = depths.size() - UVec2::ONE;
    let depth = depths.load(at).x;
    let (mut sum, mut weights) = (0.0, 0.0);
    let mut row = 0;
    while row < 5 {
        let mut column = 0;
        while column < 5 {
            let (x, y) = (at.x + column, at.y + row);
            // Two to the left and above, within the picture.
            let x = (if x < 2 { 2 } else { x }) - 2;
            let y = (if y < 2 { 2 } else { y }) - 2;
            let tap = UVec2::new(
                if x > last.x { last.x } else { x },
                if y > last.y { last.y } else { y },
            );
            let far = Real::abs(depths.load(tap).x - depth) / view.edge;
            let weight = Real::max(1.0 - far, 0.0);
            sum += light.load(tap).x * weight;
            weights += weight;
            column += 1;
        }
        row += 1;
    }
    sum / weights
}
