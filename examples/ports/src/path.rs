//! A path tracer: spheres, diffuse and mirrors, under a sky of one colour (Kajiya, The Rendering
//! Equation, 1986; cosine-weighted directions, so that a bounce multiplies by the albedo alone).

use hankel_dsl::glam::{UVec2, Vec2, Vec3, Vec4};
use hankel_dsl::{Buffer, Element, Real, kernel};

use crate::particles::{hash, unit};

/// A sphere.
#[derive(Clone, Copy, Debug, PartialEq, Element)]
#[repr(C)]
pub struct Sphere {
    /// Its middle, and its radius.
    #[range(-1.0..=1.0)]
    pub place: Vec4,
    /// Albedo, and whether it is a mirror: above 0.
    #[range(-0.5..=0.9)]
    pub albedo: Vec4,
    /// The light that it gives off.
    #[range(0.0..=1.0)]
    pub light: Vec4,
}

/// The camera, at a point, looking along -z.
#[derive(Clone, Copy, Debug, PartialEq, Element)]
#[repr(C)]
pub struct Camera {
    /// Where it is; its fourth number is half the picture's height at distance 1.
    #[range(0.3..=3.0)]
    pub place: Vec4,
    /// The light of the sky.
    #[range(0.0..=1.0)]
    pub sky: Vec4,
    /// Width and height of the picture.
    #[range(1..=64)]
    pub size: UVec2,
    /// Paths of a pixel.
    #[range(1..=3)]
    pub paths: u32,
    /// Surfaces that a path meets at most.
    #[range(1..=4)]
    pub bounces: u32,
    /// Another number gives other paths.
    pub seed: u32,
    /// Fills the structure up.
    pub padding: u32,
    /// Fills the structure up.
    pub padding_2: UVec2,
}

/// The mean light of a pixel's paths, row by row.
#[kernel(
    compute,
    threads(8, 8),
    range(camera.size),
    pinned,
    parity(non_finite, why = "distances of absurd spheres overflow")
)]
pub fn path_trace(
    #[index] at: UVec2,
    #[uniform] camera: &Camera,
    #[storage] spheres: Buffer<'_, Sphere>,
) -> Vec4 {
    let size = Vec2::new(camera.size.x as f32, camera.size.y as f32);
    let mut bits = hash((at.y * camera.size.x + at.x) ^ hash(camera.seed));
    let mut random = || {
        bits = hash(bits);
        unit(bits)
    };
    let mut light = Vec3::ZERO;
    let mut path = 0;
    while path < camera.paths {
        let inside = Vec2::new(at.x as f32 + random(), at.y as f32 + random());
        let on_screen = (inside * 2.0 - size) * (camera.place.w / size.y);
        let mut origin = camera.place.truncate();
        let mut towards = Vec3::new(on_screen.x, -on_screen.y, -1.0);
        towards /= Real::sqrt(towards.dot(towards));
        let mut share = Vec3::ONE;
        let mut found = Vec3::ZERO;
        let mut bounce = 0;
        while bounce < camera.bounces {
            let mut nearest = 1e30;
            let mut hit = spheres.len();
            let mut i = 0;
            while i < spheres.len() {
                let sphere = spheres.get(i).place;
                let to_middle = sphere.truncate() - origin;
                let middle = to_middle.dot(towards);
                // The square of half the chord.
                let aside = to_middle - towards * middle;
                let half = sphere.w * sphere.w - aside.dot(aside);
                if half > 0.0 {
                    let root = Real::sqrt(half);
                    let mut distance = middle - root;
                    if distance < 1e-3 {
                        distance = middle + root;
                    }
                    if distance > 1e-3 && distance < nearest {
                        nearest = distance;
                        hit = i;
                    }
                }
                i += 1;
            }
            if hit == spheres.len() {
                found += share * camera.sky.truncate();
                break;
            }
            let sphere = spheres.get(hit);
            found += share * sphere.light.truncate();
            share *= sphere.albedo.truncate();
            origin += towards * nearest;
            let mut normal = (origin - sphere.place.truncate()) / sphere.place.w;
            if normal.dot(towards) > 0.0 {
                normal = -normal;
            }
            if sphere.albedo.w > 0.0 {
                towards -= normal * (2.0 * normal.dot(towards));
            } else {
                // A point of the unit sphere around the normal's end, from one in the unit ball that is
                // not in its middle. Of 16 tries one succeeds but for a chance of 7e-6.
                let mut point = Vec3::X;
                let mut tries = 0;
                while tries < 16 {
                    let (x, y, z) = (random(), random(), random());
                    let tried = Vec3::new(x, y, z) * 2.0 - 1.0;
                    let square = tried.dot(tried);
                    if square <= 1.0 && square > 1e-6 {
                        point = tried / Real::sqrt(square);
                        break;
                    }
                    tries += 1;
                }
                towards = normal + point * 0.999;
            }
            towards /= Real::sqrt(towards.dot(towards));
            bounce += 1;
        }
        light += found;
        path += 1;
    }
    (light / camera.paths as f32).extend(1.0)
}
