//! What single scattering reads: the small scene of [`maps`] as a camera sees it across the light, along it
//! and against it, and its map in rectified coordinates.

use std::vec::Vec;

use hankel_dsl::glam::{UVec2, Vec3, Vec4};
use hankel_dsl::native::describe::TexelFormat;
use hankel_dsl::native::inputs::{Given, Request, Source};
use hankel_moments::bias::{SYMMETRIC_4_16, SYMMETRIC_6_32};
use hankel_moments::{
    Moments6, RectifiedBounds, inclination, rectified_bounds, rectified_depth, row_extinction,
    row_inclinations, transmittance,
};

use super::maps::{self, SAMPLES, SIZE};
use crate::scattering::{MapRows, Medium, Rectified, View};
use crate::shade::{Light, encoding};

/// Distances of the near and of the far plane.
const RANGE: [f64; 2] = [0.05, 4.0];
/// Texels of a row of the rectified map, and rows.
const TABLE: [u32; 2] = [67, 29];

/// A camera in the world of the map, whose light goes along y.
#[derive(Clone, Copy)]
struct Camera {
    what: &'static str,
    eye: Vec3,
    forward: Vec3,
    /// Half the width and the height of what is seen at a distance of 1.
    half: [f32; 2],
}

fn cameras() -> [Camera; 3] {
    let camera = |what, eye: [f32; 3], target: [f32; 3], half: [f32; 2]| Camera {
        what,
        eye: eye.into(),
        forward: (Vec3::from(target) - Vec3::from(eye)).normalize(),
        half,
    };
    [
        camera(
            "a view across the light",
            [0.45, 0.3, 1.3],
            [0.5, 0.6, 0.3],
            [0.7, 0.4],
        ),
        camera(
            "a view along the light",
            [0.4, -0.4, 0.5],
            [0.5, 0.8, 0.55],
            [0.5, 0.3],
        ),
        camera(
            "a view against the light",
            [0.3, 0.72, 0.6],
            [0.35, 0.0, 0.5],
            [0.8, 0.5],
        ),
    ]
}

impl Camera {
    fn axes(&self) -> [Vec3; 2] {
        let right = self.forward.cross(Vec3::new(0.1, 0.2, 0.97)).normalize();
        [
            right * self.half[0],
            right.cross(self.forward) * self.half[1],
        ]
    }

    /// The way through a point of the picture, from (-1, -1) to (1, 1).
    fn way(&self, x: f64, y: f64) -> Vec3 {
        let [right, down] = self.axes();
        self.forward + right * x as f32 + down * y as f32
    }

    fn view(&self) -> View {
        let [width, height] = SIZE.map(f64::from);
        let [right, down] = self.axes();
        let [near, far] = RANGE;
        let step = |n: u32| 2.0 / n as f32;
        View {
            eye: self.eye.extend((1.0 / near) as f32),
            first: self
                .way(1.0 / width - 1.0, 1.0 / height - 1.0)
                .extend((1.0 / far - 1.0 / near) as f32),
            right: (right * step(SIZE[0])).extend(0.0),
            down: (down * step(SIZE[1])).extend(0.0),
        }
    }

    /// How far along the view a ray goes.
    fn end(&self, way: Vec3) -> f64 {
        const STEPS: u32 = 96;
        for i in 1..STEPS {
            let t = RANGE[1] * f64::from(i) / f64::from(STEPS);
            let p = self.eye + way * t as f32;
            let p = [p.x, p.y, p.z].map(f64::from);
            let is_inside = (0.0..1.0).contains(&p[0]) && (0.0..1.0).contains(&p[2]);
            if is_inside && p[1] > maps::depth(p[0], p[2]) {
                return t;
            }
        }
        RANGE[1]
    }

    /// The depth of each sample of each pixel.
    fn surfaces(&self) -> Vec<f64> {
        let [width, height] = SIZE.map(f64::from);
        let [near, far] = RANGE;
        let mut all = Vec::new();
        for y in 0..SIZE[1] {
            for x in 0..SIZE[0] {
                for sample in 0..SAMPLES as u32 {
                    let dx = (f64::from(sample) + 0.5) / SAMPLES as f64;
                    let x = (f64::from(x) + dx) / width * 2.0 - 1.0;
                    let y = (f64::from(y) + 0.5) / height * 2.0 - 1.0;
                    let end = self.end(self.way(x, y));
                    let z = (1.0 / end - 1.0 / near) / (1.0 / far - 1.0 / near);
                    all.push(z);
                }
            }
        }
        all
    }

    /// The far plane's corners: along x and z of the world, and along the light.
    fn corners(&self) -> [[f64; 3]; 4] {
        [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]].map(|[x, y]| {
            let p = self.way(x, y);
            [p.x, p.z, p.y].map(|x| f64::from(x) * RANGE[1])
        })
    }

    fn bounds(&self) -> RectifiedBounds<f64> {
        rectified_bounds(self.corners())
    }

    fn rectified(&self, [columns, rows]: [u32; 2]) -> Rectified {
        let b = self.bounds();
        let (sin, cos) = b.azimuth.sin_cos();
        Rectified {
            across: Vec4::new(cos as f32, 0.0, sin as f32, b.radius as f32),
            aside: Vec4::new(-sin as f32, 0.0, cos as f32, b.half_azimuth as f32),
            along: Vec4::new(0.0, 1.0, 0.0, 1.0),
            eye: Vec3::new(self.eye.x, self.eye.z, self.eye.y).extend(5e-6),
            middle: (0.5 * (b.least + b.largest)) as f32,
            scale: (2.0 / (b.largest - b.least)) as f32,
            columns,
            rows,
        }
    }

    /// The azimuth in the middle of a row.
    fn azimuth(&self, row: u32, rows: u32) -> f64 {
        let b = self.bounds();
        let share = (f64::from(row) + 0.5) / f64::from(rows);
        b.azimuth + (2.0 * share - 1.0) * b.half_azimuth
    }

    /// Each row's direction, and its extinction per unit of radius.
    fn rows(&self, medium: &Medium, rows: u32) -> Vec<Vec4> {
        let row = |i| {
            let azimuth = self.azimuth(i, rows);
            let (least, largest) = row_inclinations(self.corners(), azimuth);
            let extinction = row_extinction(f64::from(medium.extinction), least, largest);
            let (sin, cos) = azimuth.sin_cos();
            Vec4::new(cos as f32, 0.0, sin as f32, extinction as f32)
        };
        (0..rows).map(row).collect()
    }

    /// The moments of the depth in each texel of the rectified map, and their means along rows.
    fn tables(&self, medium: &Medium, [columns, rows]: [u32; 2]) -> [Vec<[f64; 6]>; 2] {
        let b = self.bounds();
        let (middle, scale) = (0.5 * (b.least + b.largest), 2.0 / (b.largest - b.least));
        let all = self.rows(medium, rows);
        let width = b.radius / f64::from(columns);
        let (mut texels, mut means) = (Vec::new(), Vec::new());
        for (row, extinction) in (0..rows).zip(all.iter().map(|row| row.w)) {
            let (sin, cos) = self.azimuth(row, rows).sin_cos();
            let (mut sum, mut weight) = ([0.0; 6], 0.0);
            for column in 0..columns {
                let radius = (f64::from(column) + 0.5) * width;
                let [x, y, z] = [self.eye.x, self.eye.y, self.eye.z].map(f64::from);
                let (u, v) = (x + radius * cos, z + radius * sin);
                let is_inside = (0.0..1.0).contains(&u) && (0.0..1.0).contains(&v);
                let depth = if is_inside { maps::depth(u, v) } else { 1e3 };
                let theta = inclination(radius, depth - y);
                let m = Moments6::of_depth(rectified_depth(theta, middle, scale));
                let m = [m.b1, m.b2, m.b3, m.b4, m.b5, m.b6];
                let w = transmittance(f64::from(extinction), f64::from(column) * width);
                weight += w;
                for (sum, m) in sum.iter_mut().zip(m) {
                    *sum += w * m;
                }
                texels.push(m);
                means.push(sum.map(|s| s / weight));
            }
        }
        [texels, means]
    }
}

/// The light that goes along y.
fn light() -> Light {
    Light {
        position: Vec4::new(0.0, -1.0, 0.0, 0.0),
        ..maps::light(&SYMMETRIC_4_16, 6e-5, 0.0, 1)
    }
}

fn media() -> [Medium; 3] {
    [(0.1, 0.0, 7), (0.6, 0.5, 32), (2.0, -0.3, 61)].map(|(extinction, anisotropy, steps)| Medium {
        extinction,
        source: 3.5,
        anisotropy,
        steps,
    })
}

/// The first or the last moments, as a table holds them.
fn four(all: &[[f64; 6]], first: usize) -> Vec<Vec4> {
    let of = |m: &[f64; 6]| {
        let of = |i: usize| m.get(first + i).copied().unwrap_or(0.0) as f32;
        Vec4::new(of(0), of(1), of(2), of(3))
    };
    all.iter().map(of).collect()
}

/// What every picture through a medium is made of; `of` adds what a technique looks up.
fn pictures(request: &Request, of: impl Fn(Given, &Camera, &Medium) -> Given) -> Vec<Given> {
    lit(request, &[light(); 3], of)
}

/// The same with lights, one for each camera.
fn lit(
    request: &Request,
    lights: &[Light; 3],
    of: impl Fn(Given, &Camera, &Medium) -> Given,
) -> Vec<Given> {
    let mut s = Source::new(request.seed);
    cameras()
        .iter()
        .zip(media())
        .zip(lights)
        .map(|((camera, medium), light)| {
            let mut colour = || s.between(0.0, 1.5) as f32;
            let mut pixel = || Vec4::new(colour(), colour(), colour(), 1.0);
            let picture: Vec<Vec4> = (0..SIZE[0] * SIZE[1]).map(|_| pixel()).collect();
            let given = Given::new(camera.what)
                .uniform("view", &camera.view())
                .uniform("medium", &medium)
                .uniform("light", light)
                .texture("picture", SIZE, 1, TexelFormat::Rgba32Float, picture);
            let given = maps::with_samples(request, given, "surfaces", &camera.surfaces());
            of(given, camera, &medium)
        })
        .collect()
}

/// What marching along rays reads.
#[must_use]
pub fn marched(request: &Request) -> Vec<Given> {
    pictures(request, |given, _, _| maps::with_depth(request, given))
}

/// The same with a spot light: one above the map, one that does not fall off with the distance, and one that the
/// camera's rays pass close by.
#[must_use]
pub fn marched_spot(request: &Request) -> Vec<Given> {
    let above = maps::spot(&light());
    let even = Light {
        falloff: 0.0,
        ..above
    };
    let near = Light {
        position: Vec4::new(0.33, 0.3, 0.55, 1.0),
        ..above
    };
    lit(request, &[above, even, near], |given, _, _| {
        maps::with_depth(request, given)
    })
}

/// What prefiltered single scattering reads.
#[must_use]
pub fn prefiltered(request: &Request) -> Vec<Given> {
    pictures(request, |given, camera, medium| {
        let [_, means] = camera.tables(medium, TABLE);
        given
            .uniform("rectified", &camera.rectified(TABLE))
            .buffer("table", &four(&means, 0))
    })
}

/// What prefiltered single scattering with six moments reads.
#[must_use]
pub fn prefiltered_6(request: &Request) -> Vec<Given> {
    pictures(request, |given, camera, medium| {
        let [_, means] = camera.tables(medium, TABLE);
        given
            .uniform("rectified", &camera.rectified(TABLE))
            .uniform("target", &SYMMETRIC_6_32.six())
            .buffer("first", &four(&means, 0))
            .buffer("second", &four(&means, 4))
    })
}

/// A map of moments that is to be rectified.
#[must_use]
pub fn rectified(_: &Request) -> Vec<Given> {
    let map = maps::texels(encoding::SYMMETRIC);
    cameras()
        .iter()
        .zip(media())
        .map(|(camera, medium)| {
            let given = Given::new(camera.what)
                .uniform("light", &light())
                .uniform("rectified", &camera.rectified(TABLE))
                .buffer("rows", &camera.rows(&medium, TABLE[1]));
            maps::with_map(given, "map", &map)
        })
        .collect()
}

/// MapRows whose means are to be taken: of a map, and of lengths that the workgroup has fewer and more parts than.
#[must_use]
pub fn means(_: &Request) -> Vec<Given> {
    let sizes = [TABLE, [331, 5], [1, 3]];
    cameras()
        .iter()
        .zip(media())
        .zip(sizes)
        .map(|((camera, medium), size)| {
            let [texels, _] = camera.tables(&medium, size);
            Given::new(camera.what)
                .uniform(
                    "lines",
                    &MapRows {
                        invocations: 64 * size[1],
                        length: size[0],
                        padding: UVec2::ZERO,
                    },
                )
                .uniform("rectified", &camera.rectified(size))
                .buffer("rows", &camera.rows(&medium, size[1]))
                .buffer("table", &four(&texels, 0))
        })
        .collect()
}
