//! Ports that make or draw surfaces.

use std::collections::HashMap;

use hankel_dsl::bytemuck::bytes_of;
use hankel_dsl::glam::{DVec2, DVec3, UVec3, Vec2, Vec3, Vec4};
use hankel_dsl::native::describe::TexelFormat;
use hankel_dsl::native::inputs::Source;
use hankel_example_ports::gbuffer::Object;
use hankel_example_ports::marching_cubes::{Grid, Triangle, table};
use hankel_host::device::{Bind, TextureShape};

use crate::run::{Drawn, Port, Prepared, REPEATED, Runner, Way, picture};

pub const MARCHING_CUBES: Port = Port {
    file: "marching_cubes",
    what: "marching cubes, its table derived",
    kernels: &["marching_cubes"],
    prepare: |runner, scale| {
        let cells = scale.of(24, 64);
        let middle = f64::from(cells) / 2.0;
        let radius = middle * 0.7;
        let ball = field(cells, |p| (p - DVec3::splat(middle)).length() - radius);
        let surface = Surface::new(runner, cells, &ball);
        Prepared {
            work: Box::new(move |runner| surface.run(runner)),
            check: Box::new(move |runner| {
                let found = surface.triangles(runner);
                assert_eq!(closed(&found), 2, "a ball has the Euler characteristic 2");
                let volume = volume(&found);
                let exact = 4.0 / 3.0 * std::f64::consts::PI * radius.powi(3);
                assert!((volume / exact - 1.0).abs() < 0.01, "{volume}, not {exact}");
                for point in found.iter().flat_map(|t| [t.a, t.b, t.c]) {
                    let from = (point.truncate().as_dvec3() - DVec3::splat(middle)).length();
                    assert!(
                        (from - radius).abs() < 0.02,
                        "{point}: {from}, not {radius}"
                    );
                }
                // A torus, which has a hole.
                let torus = field(cells, |p| {
                    let p = p - DVec3::splat(middle);
                    DVec2::new(DVec2::new(p.x, p.y).length() - middle * 0.55, p.z).length()
                        - middle * 0.25
                });
                let surface = Surface::new(runner, cells, &torus);
                surface.run(runner);
                assert_eq!(closed(&surface.triangles(runner)), 0);
                // Chance meets every case, ambiguous faces among them.
                let mut chance = Source::new(6);
                let inner = 1.0..f64::from(cells);
                let noise = field(cells, |p| {
                    let inside = p.to_array().iter().all(|x| inner.contains(x));
                    if inside {
                        chance.between(-1.0, 1.0)
                    } else {
                        1.0
                    }
                });
                let surface = Surface::new(runner, cells, &noise);
                surface.run(runner);
                closed(&surface.triangles(runner));
            }),
        }
    },
};

/// The values of a function on the points of a grid.
fn field(cells: u32, mut at: impl FnMut(DVec3) -> f64) -> Vec<f32> {
    let n = cells + 1;
    (0..n * n * n)
        .map(|i| at(UVec3::new(i % n, i / n % n, i / n / n).as_dvec3()) as f32)
        .collect()
}

/// A surface that is searched in a field.
#[derive(Clone, Copy)]
struct Surface {
    grid: Grid,
    field: hankel_host::device::BufferId,
    table: hankel_host::device::BufferId,
    count: hankel_host::device::BufferId,
    triangles: hankel_host::device::BufferId,
}

impl Surface {
    fn new(runner: &mut Runner<'_>, cells: u32, field: &[f32]) -> Self {
        let most = (5 * cells * cells * cells).min(400_000);
        Self {
            grid: Grid {
                cells: UVec3::splat(cells),
                level: 0.0,
            },
            field: runner.buffer(field),
            table: runner.buffer(&table()),
            count: runner.zeros(4),
            triangles: runner.zeros(most as usize * size_of::<Triangle>()),
        }
    }

    fn run(&self, runner: &mut Runner<'_>) {
        runner.clear(self.count);
        let [a, b, c, d] = [self.field, self.table, self.count, self.triangles].map(Bind::Buffer);
        runner.dispatch(
            "marching_cubes",
            &[Bind::Bytes(bytes_of(&self.grid)), a, b, c, d],
        );
    }

    fn triangles(&self, runner: &mut Runner<'_>) -> Vec<Triangle> {
        let count = runner.read::<u32>(self.count)[0] as usize;
        let mut all: Vec<Triangle> = runner.read(self.triangles);
        assert!(count > 100 && count <= all.len(), "{count} triangles");
        all.truncate(count);
        all
    }
}

/// The Euler characteristic of a surface; fails if it has a hole, or if two triangles that touch do not
/// turn alike. Points that two cells share have the same bits.
fn closed(triangles: &[Triangle]) -> i64 {
    let mut points = HashMap::new();
    let mut edges: HashMap<(usize, usize), i32> = HashMap::new();
    for triangle in triangles {
        let corners = [triangle.a, triangle.b, triangle.c].map(|p| {
            // Both zeros are one place.
            let bits = (p + 0.0).to_array().map(f32::to_bits);
            let next = points.len();
            *points.entry(bits).or_insert(next)
        });
        for i in 0..3 {
            let (a, b) = (corners[i], corners[(i + 1) % 3]);
            // There and back cancel.
            *edges.entry((a.min(b), a.max(b))).or_default() += if a < b { 1 } else { -1 };
        }
    }
    let open = edges.values().filter(|n| **n != 0).count();
    assert_eq!(open, 0, "{open} of {} edges are open", edges.len());
    points.len() as i64 - edges.len() as i64 + triangles.len() as i64
}

/// What a closed surface encloses: positive if it turns counter-clockwise from outside.
fn volume(triangles: &[Triangle]) -> f64 {
    let corner = |v: Vec4| v.truncate().as_dvec3();
    triangles
        .iter()
        .map(|t| corner(t.a).dot(corner(t.b).cross(corner(t.c))) / 6.0)
        .sum()
}

/// A sphere of radius 1 around the origin, in triangles.
pub struct Ball {
    pub positions: Vec<Vec3>,
    pub tangents: Vec<Vec4>,
    pub uvs: Vec<Vec2>,
}

impl Ball {
    /// So many parts from pole to pole, and twice as many around.
    pub fn new(parts: u32) -> Self {
        let mut ball = Self {
            positions: Vec::new(),
            tangents: Vec::new(),
            uvs: Vec::new(),
        };
        let mut corner = |i: u32, j: u32| {
            let theta = f64::from(i) / f64::from(parts) * std::f64::consts::PI;
            let phi = f64::from(j) / f64::from(parts) * std::f64::consts::PI;
            let flat = DVec2::new(phi.cos(), phi.sin());
            let place = DVec3::new(theta.sin() * flat.x, theta.cos(), theta.sin() * flat.y);
            ball.positions.push(place.as_vec3());
            ball.tangents
                .push(Vec4::new(-flat.y as f32, 0.0, flat.x as f32, 1.0));
            ball.uvs
                .push(Vec2::new(j as f32 / parts as f32, i as f32 / parts as f32));
        };
        for i in 0..parts {
            for j in 0..2 * parts {
                for (a, b) in [(0, 0), (1, 0), (1, 1), (0, 0), (1, 1), (0, 1)] {
                    corner(i + a, j + b);
                }
            }
        }
        ball
    }
}

/// How much larger than its distance what is seen is: half the picture's height at distance 1 is its
/// reciprocal.
const ZOOM: f32 = 2.5;
/// Where the eye is, on the z axis.
const EYE: f32 = 3.0;

/// Columns of the matrix from the world to clip space, and what is added to x there.
pub fn to_clip(shift: f32) -> [Vec4; 4] {
    let (near, far) = (1.0, 10.0);
    let a = far / (far - near);
    [
        Vec4::new(ZOOM, 0.0, 0.0, 0.0),
        Vec4::new(0.0, ZOOM, 0.0, 0.0),
        Vec4::new(0.0, 0.0, -a, -1.0),
        Vec4::new(shift, 0.0, a * (EYE - near), EYE),
    ]
}

/// The eye.
pub fn eye() -> Vec4 {
    Vec4::new(0.0, 0.0, EYE, 1.0)
}

/// Where the ray through a pixel meets the sphere.
pub fn seen(x: u32, y: u32, size: u32) -> Option<DVec3> {
    let on = |i: u32| (f64::from(i) + 0.5) / f64::from(size) * 2.0 - 1.0;
    let way = DVec3::new(on(x), -on(y), -f64::from(ZOOM)) / f64::from(ZOOM);
    let from = eye().truncate().as_dvec3();
    let (a, b, c) = (way.dot(way), from.dot(way), from.dot(from) - 1.0);
    let root = b * b - a * c;
    // Not the rim, where triangles are visible.
    (root > 0.2 * a).then(|| from + way * ((-b - root.sqrt()) / a))
}

/// The unit vector of a point of the square.
fn from_octahedral(p: DVec2) -> DVec3 {
    let z = 1.0 - p.x.abs() - p.y.abs();
    let fold = |a: f64, b: f64| {
        if z < 0.0 {
            (1.0 - b.abs()) * a.signum()
        } else {
            a
        }
    };
    DVec3::new(fold(p.x, p.y), fold(p.y, p.x), z).normalize()
}

pub const GBUFFER: Port = Port {
    file: "gbuffer",
    what: "G-buffer with four targets, normal map and motion",
    kernels: &["gbuffer_vertex", "gbuffer_fragment"],
    prepare: |runner, scale| {
        let size = scale.of(64, 1024);
        let ball = Ball::new(48);
        let count = ball.positions.len() as u32;
        let object = Object {
            to_world: [Vec4::X, Vec4::Y, Vec4::Z, Vec4::W],
            to_clip: to_clip(0.0),
            to_clip_before: to_clip(-0.3),
            number: 42,
            roughness: 0.25,
            padding: Vec2::ZERO,
        };
        let colours: Vec<[f32; 4]> = (0..64)
            .map(|i| {
                if (i % 8 + i / 8) % 2 == 0 {
                    [1.0, 0.6, 0.2, 1.0]
                } else {
                    [0.2, 0.4, 0.8, 1.0]
                }
            })
            .collect();
        let colours = runner.texels(&TextureShape::d2(8, 8, TexelFormat::Rgba8Unorm), &colours);
        // Flat: the normal stays as it is.
        let bumps = [[0.5, 0.5, 1.0, 0.0]; 16];
        let bumps = runner.texels(&TextureShape::d2(4, 4, TexelFormat::Rgba16Float), &bumps);
        let attributes = [
            runner.buffer(&ball.positions),
            runner.buffer(&ball.positions),
            runner.buffer(&ball.tangents),
            runner.buffer(&ball.uvs),
        ];
        let textures = [Bind::Texture(colours), Bind::Texture(bumps), REPEATED];
        if runner.way == Way::Native {
            // The vertices themselves are the fragments.
            let n = count as usize;
            let varyings = [16, 16, 16, 12, 16, 8, 4, 4].map(|bytes| runner.zeros(bytes * n));
            let targets = [16, 16, 4, 4].map(|bytes| runner.zeros(bytes * n));
            return Prepared {
                work: Box::new(move |runner| {
                    let mut args = attributes.map(Bind::Buffer).to_vec();
                    args.push(Bind::Bytes(bytes_of(&object)));
                    args.extend(varyings.map(Bind::Buffer));
                    runner.dispatch("gbuffer_vertex", &args);
                    let mut args: Vec<Bind<'_>> =
                        varyings[1..].iter().copied().map(Bind::Buffer).collect();
                    args.extend(textures);
                    args.extend(targets.map(Bind::Buffer));
                    runner.dispatch("gbuffer_fragment", &args);
                }),
                check: Box::new(move |runner| {
                    let packed: Vec<[f32; 4]> = runner.read(targets[1]);
                    let colours: Vec<[f32; 4]> = runner.read(targets[0]);
                    let depths: Vec<f32> = runner.read(targets[2]);
                    for (i, position) in ball.positions.iter().enumerate() {
                        fragment(position.as_dvec3(), packed[i], colours[i], depths[i], 1e-5);
                    }
                    assert_eq!(runner.read::<u32>(targets[3]), vec![42; n]);
                }),
            };
        }
        let formats = [
            TexelFormat::Rgba8Unorm,
            TexelFormat::Rgba16Float,
            TexelFormat::R32Float,
            TexelFormat::R32Uint,
        ];
        let targets = formats.map(|format| runner.texture(&TextureShape::d2(size, size, format)));
        let depth = runner.texture(&TextureShape::depth(size, size));
        Prepared {
            work: Box::new(move |runner| {
                let mut args = attributes.map(Bind::Buffer).to_vec();
                args.push(Bind::Bytes(bytes_of(&object)));
                runner.draw(&Drawn {
                    vertex: ("gbuffer_vertex", &args),
                    fragment: ("gbuffer_fragment", &textures),
                    count,
                    targets: &targets,
                    depth: Some(depth),
                });
            }),
            check: Box::new(move |runner| {
                let colours = runner.read_texels(targets[0], formats[0]);
                let packed = runner.read_texels(targets[1], formats[1]);
                let depths = runner.read_texels(targets[2], formats[2]);
                let numbers = runner.read_integers(targets[3]);
                let mut covered = 0;
                for y in 0..size {
                    for x in 0..size {
                        let i = (y * size + x) as usize;
                        let Some(place) = seen(x, y, size) else {
                            continue;
                        };
                        covered += 1;
                        assert_eq!(numbers[i], 42);
                        fragment(place, packed[i], colours[i], depths[i][0], 6e-3);
                    }
                }
                assert!(covered > 1000, "{covered} pixels");
                assert_eq!(numbers[0], 0);
                picture("gbuffer", runner.way, size, &colours);
            }),
        }
    },
};

/// Whether a fragment of the sphere is right, within a tolerance.
fn fragment(place: DVec3, packed: [f32; 4], colour: [f32; 4], depth: f32, tolerance: f64) {
    let [u, v, motion, still] = packed.map(f64::from);
    let normal = from_octahedral(DVec2::new(u, v));
    assert!((normal - place).length() < tolerance, "{place}: {normal}");
    let distance = f64::from(EYE) - place.z;
    assert!(
        (f64::from(depth) - distance).abs() < tolerance,
        "{depth}, not {distance}"
    );
    // It was 0.3 to the left in clip space.
    let moved = 0.3 / distance * 0.5;
    assert!(
        (motion - moved).abs() < tolerance && still.abs() < tolerance,
        "{motion}, not {moved}"
    );
    assert!((colour[3] - 0.25).abs() < 3e-3, "{colour:?}");
}
