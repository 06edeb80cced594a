//! Ports that find how much light there is.

use hankel_dsl::bytemuck::bytes_of;
use hankel_dsl::glam::{DVec3, UVec2, Vec3, Vec4};
use hankel_dsl::native::describe::TexelFormat;
use hankel_example_ports::path::{Camera, Sphere};
use hankel_example_ports::reflection::{Eye, Material};
use hankel_example_ports::shadow::{Reading, Views};
use hankel_example_ports::sky::{Conditions, Model};
use hankel_host::device::{Bind, BufferId, TextureId, TextureShape};

use crate::run::{Drawn, LINEAR, Port, Prepared, Runner, Way, comparing, picture};
use crate::surfaces::{Ball, eye, seen, to_clip};

/// Traces the paths of a scene.
fn trace(runner: &mut Runner<'_>, camera: &Camera, spheres: &[Sphere]) -> Vec<[f32; 4]> {
    let spheres = runner.buffer(spheres);
    let out = runner.zeros((camera.size.x * camera.size.y * 16) as usize);
    let [a, b] = [spheres, out].map(Bind::Buffer);
    runner.dispatch("path_trace", &[Bind::Bytes(bytes_of(camera)), a, b]);
    runner.read(out)
}

fn sphere(place: [f32; 4], albedo: [f32; 4], light: f32) -> Sphere {
    Sphere {
        place: place.into(),
        albedo: albedo.into(),
        light: Vec4::new(light, light, light, 0.0),
    }
}

pub const PATH: Port = Port {
    file: "path",
    what: "path tracer of spheres",
    kernels: &["path_trace"],
    prepare: |runner, scale| {
        let (width, height) = (scale.of(64, 256), scale.of(48, 192));
        let camera = Camera {
            place: Vec4::new(0.0, 0.6, 3.0, 0.6),
            sky: Vec4::new(0.6, 0.75, 1.0, 0.0),
            size: UVec2::new(width, height),
            paths: scale.of(16, 4),
            bounces: 5,
            seed: 3,
            padding: 0,
            padding_2: UVec2::ZERO,
        };
        let spheres = [
            sphere([0.0, -100.5, -1.0, 100.0], [0.5, 0.5, 0.45, 0.0], 0.0),
            sphere([-1.05, 0.0, -1.0, 0.5], [0.8, 0.25, 0.2, 0.0], 0.0),
            sphere([0.0, 0.0, -1.0, 0.5], [0.95, 0.95, 0.95, 1.0], 0.0),
            sphere([1.05, 0.0, -1.0, 0.5], [0.2, 0.6, 0.3, 0.0], 0.0),
            sphere([0.4, 1.6, -0.6, 0.35], [0.0, 0.0, 0.0, 0.0], 3.0),
        ];
        let there = runner.buffer(&spheres);
        let out = runner.zeros((width * height * 16) as usize);
        Prepared {
            work: Box::new(move |runner| {
                let [a, b] = [there, out].map(Bind::Buffer);
                runner.dispatch("path_trace", &[Bind::Bytes(bytes_of(&camera)), a, b]);
            }),
            check: Box::new(move |runner| {
                // A furnace: every path meets a wall that gives 1 and reflects half of what comes.
                let inside = Camera {
                    bounces: 6,
                    paths: 2,
                    ..camera
                };
                let walls = [sphere([0.0, 0.0, 0.0, 9.0], [0.5, 0.5, 0.5, 0.0], 1.0)];
                let expected = (1.0 - 0.5_f32.powi(6)) / 0.5;
                for light in trace(runner, &inside, &walls) {
                    assert!(
                        (light[0] - expected).abs() < 1e-4,
                        "{light:?}, not {expected}"
                    );
                }
                // One sphere under a sky of 1 reflects its albedo, diffuse or as a mirror; the rest is sky.
                let sky = Camera {
                    sky: Vec4::ONE,
                    ..camera
                };
                for mirror in [0.0, 1.0] {
                    let one = [sphere([0.0, 0.6, 0.0, 1.0], [0.7, 0.7, 0.7, mirror], 0.0)];
                    let light = trace(runner, &sky, &one);
                    let middle = light[(height / 2 * width + width / 2) as usize][0];
                    assert!((middle - 0.7).abs() < 1e-4, "{middle}");
                    assert!((light[0][0] - 1.0).abs() < 1e-6, "{:?}", light[0]);
                }
                let light: Vec<[f32; 4]> = runner.read(out);
                let pixels: Vec<[f32; 4]> = light
                    .iter()
                    .map(|p| p.map(|x| (x / (1.0 + x)).sqrt()))
                    .collect();
                picture("path", runner.way, width, &pixels);
            }),
        }
    },
};

/// Preetham's model in double precision, by its formulas as they are printed. Chromaticities and
/// luminance of a direction.
fn preetham(t: f64, sun: f64, theta: f64, gamma: f64) -> [f64; 3] {
    let perez = |c: [f64; 5], theta: f64, gamma: f64| {
        (1.0 + c[0] * (c[1] / theta.cos()).exp())
            * (1.0 + c[2] * (c[3] * gamma).exp() + c[4] * gamma.cos().powi(2))
    };
    let luminance = [
        0.1787 * t - 1.4630,
        -0.3554 * t + 0.4275,
        -0.0227 * t + 5.3251,
        0.1206 * t - 2.5771,
        -0.0670 * t + 0.3703,
    ];
    let x = [
        -0.0193 * t - 0.2592,
        -0.0665 * t + 0.0008,
        -0.0004 * t + 0.2125,
        -0.0641 * t - 0.8989,
        -0.0033 * t + 0.0452,
    ];
    let y = [
        -0.0167 * t - 0.2608,
        -0.0950 * t + 0.0092,
        -0.0079 * t + 0.2102,
        -0.0441 * t - 1.6537,
        -0.0109 * t + 0.0529,
    ];
    let chi = (4.0 / 9.0 - t / 120.0) * (std::f64::consts::PI - 2.0 * sun);
    let zenith_luminance = (4.0453 * t - 4.9710) * chi.tan() - 0.2155 * t + 2.4192;
    let powers = [sun.powi(3), sun.powi(2), sun, 1.0];
    let bilinear = |m: [[f64; 4]; 3]| -> f64 {
        let rows = m.map(|row| row.iter().zip(powers).map(|(a, b)| a * b).sum::<f64>());
        t * t * rows[0] + t * rows[1] + rows[2]
    };
    let zenith_x = bilinear([
        [0.00166, -0.00375, 0.00209, 0.0],
        [-0.02903, 0.06377, -0.03202, 0.00394],
        [0.11693, -0.21196, 0.06052, 0.25886],
    ]);
    let zenith_y = bilinear([
        [0.00275, -0.00610, 0.00317, 0.0],
        [-0.04214, 0.08970, -0.04153, 0.00516],
        [0.15346, -0.26756, 0.06670, 0.26688],
    ]);
    [(x, zenith_x), (y, zenith_y), (luminance, zenith_luminance)]
        .map(|(c, zenith)| zenith * perez(c, theta, gamma) / perez(c, 0.0, sun))
}

pub const SKY: Port = Port {
    file: "sky",
    what: "analytic sky by day (Preetham)",
    kernels: &["sky_model", "sky"],
    prepare: |runner, scale| {
        let size = scale.of(96, 512);
        let conditions = Conditions {
            sun: 1.0,
            turbidity: 3.0,
        };
        let given = runner.buffer(&[conditions]);
        let model = runner.zeros(size_of::<Model>());
        let shape = TextureShape::d2(size, size, TexelFormat::Rgba16Float);
        let out = runner.texture(&shape);
        Prepared {
            work: Box::new(move |runner| {
                runner.dispatch("sky_model", &[given, model].map(Bind::Buffer));
                let sizes = UVec2::splat(size);
                let args = [
                    Bind::Bytes(bytes_of(&sizes)),
                    Bind::Buffer(model),
                    Bind::Texture(out),
                ];
                runner.dispatch("sky", &args);
            }),
            check: Box::new(move |runner| {
                let light = runner.read_texels(out, TexelFormat::Rgba16Float);
                let mut compared = 0;
                for (i, light) in (0..).zip(&light) {
                    let on = |i: u32| (f64::from(i) + 0.5) / f64::from(size) * 2.0 - 1.0;
                    let (u, v) = (on(i % size), on(i / size));
                    let radius = u * u + v * v;
                    if radius > 0.98 {
                        continue;
                    }
                    let theta = (1.0 - radius).acos();
                    let wide = (2.0 - radius).sqrt();
                    let towards = DVec3::new(u * wide, v * wide, 1.0 - radius);
                    let gamma = towards
                        .dot(DVec3::new(1.0_f64.sin(), 0.0, 1.0_f64.cos()))
                        .acos();
                    let [x, y, luminance] = preetham(3.0, 1.0, theta, gamma);
                    // Luminance is a fixed sum of the three, which gamut does not cut off here.
                    let is = f64::from(light[0]) * 0.2126
                        + f64::from(light[1]) * 0.7152
                        + f64::from(light[2]) * 0.0722;
                    assert!((is / luminance - 1.0).abs() < 2e-3, "{is}, not {luminance}");
                    // Blue by CIE XYZ, of which Y is the luminance.
                    let (xx, zz) = (x / y * luminance, (1.0 - x - y) / y * luminance);
                    let blue = 0.0557 * xx - 0.2040 * luminance + 1.0570 * zz;
                    assert!(
                        (f64::from(light[2]) / blue - 1.0).abs() < 2e-3,
                        "{light:?}, not {blue}"
                    );
                    compared += 1;
                }
                assert!(compared > 5000, "{compared} pixels");
                let pixels: Vec<[f32; 4]> = light
                    .iter()
                    .map(|p| p.map(|x| (1.0 - (-x * 0.12).exp()).powf(1.0 / 2.2)))
                    .collect();
                picture("sky", runner.way, size, &pixels);
            }),
        }
    },
};

/// A cube whose faces have one colour in each level.
fn cube(runner: &mut Runner<'_>, levels: u32, colour: impl Fn(u32, u32) -> [f32; 4]) -> TextureId {
    let shape = TextureShape::d2(16, 16, TexelFormat::Rgba16Float)
        .with_levels(levels)
        .with_layers(6);
    let mut texels = Vec::new();
    for level in 0..levels {
        let n = (16 >> level) * (16 >> level);
        for face in 0..6 {
            texels.extend(std::iter::repeat_n(colour(face, level), n as usize));
        }
    }
    runner.texels(&shape, &texels)
}

/// Draws the sphere, or natively its vertices.
struct Mirror {
    positions: BufferId,
    count: u32,
    size: u32,
    target: TextureId,
    depth: Option<TextureId>,
    ways: [BufferId; 4],
}

impl Mirror {
    fn draw(&self, runner: &mut Runner<'_>, material: &Material, environment: TextureId) {
        let of_eye = Eye {
            to_clip: to_clip(0.0),
            place: eye(),
        };
        let at = Bind::Buffer(self.positions);
        let attributes = [at, at, Bind::Bytes(bytes_of(&of_eye))];
        let textures = [
            Bind::Bytes(bytes_of(material)),
            Bind::Texture(environment),
            LINEAR,
        ];
        if runner.way == Way::Native {
            let [clip, normal, view, out] = self.ways.map(Bind::Buffer);
            let [a, b, c] = attributes;
            runner.dispatch("reflection_vertex", &[a, b, c, clip, normal, view]);
            let [a, b, c] = textures;
            runner.dispatch("reflection", &[normal, view, a, b, c, out]);
            return;
        }
        runner.draw(&Drawn {
            vertex: ("reflection_vertex", &attributes),
            fragment: ("reflection", &textures),
            count: self.count,
            targets: &[self.target],
            depth: self.depth,
        });
    }

    /// Points of the sphere, and their colours.
    fn colours(&self, runner: &mut Runner<'_>, ball: &Ball) -> Vec<(DVec3, [f32; 4])> {
        if runner.way == Way::Native {
            let colours: Vec<[f32; 4]> = runner.read(self.ways[3]);
            let places = ball.positions.iter().map(|p| p.as_dvec3());
            return places.zip(colours).filter(|(p, _)| p.z > 0.5).collect();
        }
        let texels = runner.read_texels(self.target, TexelFormat::Rgba16Float);
        let size = self.size;
        (0..)
            .zip(texels)
            .filter_map(|(i, texel)| Some((seen(i % size, i / size, size)?, texel)))
            .collect()
    }
}

pub const REFLECTION: Port = Port {
    file: "reflection",
    what: "reflection of an environment cube by roughness",
    kernels: &["reflection_vertex", "reflection"],
    prepare: |runner, scale| {
        let size = scale.of(64, 1024);
        let ball = Ball::new(48);
        let n = ball.positions.len();
        let native = runner.way == Way::Native;
        let mirror = Mirror {
            positions: runner.buffer(&ball.positions),
            count: n as u32,
            size,
            target: runner.texture(&TextureShape::d2(size, size, TexelFormat::Rgba16Float)),
            depth: (!native).then(|| runner.texture(&TextureShape::depth(size, size))),
            ways: [16, 12, 12, 16].map(|bytes| runner.zeros(bytes * n)),
        };
        let mirror = std::rc::Rc::new(mirror);
        // Faces are told by their colours, and levels by the last channel, which is not drawn.
        let faces = cube(runner, 3, |face, level| {
            let on = |c: u32| f32::from(face / 2 == c) * if face % 2 == 0 { 1.0 } else { 0.5 };
            [on(0), on(1), on(2), 1.0].map(|x| x / (1 << level) as f32)
        });
        let polished = Material {
            specular: Vec4::new(1.0, 1.0, 1.0, 0.0),
            diffuse: Vec4::ZERO,
        };
        let again = std::rc::Rc::clone(&mirror);
        Prepared {
            work: Box::new(move |runner| mirror.draw(runner, &polished, faces)),
            check: Box::new(move |runner| {
                let mut compared = 0;
                for level in [0.0, 1.0, 2.0] {
                    let material = Material {
                        specular: Vec4::new(1.0, 1.0, 1.0, level / 2.0),
                        ..polished
                    };
                    again.draw(runner, &material, faces);
                    for (place, colour) in again.colours(runner, &ball) {
                        let view = (eye().truncate().as_dvec3() - place).normalize();
                        let way = 2.0 * place.dot(view) * place - view;
                        let mut axes = way.abs().to_array();
                        axes.sort_by(f64::total_cmp);
                        // Not where faces meet.
                        if axes[2] * 0.7 < axes[1] {
                            continue;
                        }
                        let axis = (0..3).find(|i| way.abs()[*i] == axes[2]).unwrap_or(0);
                        let mut expected = [0.0; 3];
                        expected[axis] =
                            if way[axis] > 0.0 { 1.0 } else { 0.5 } / 2.0_f32.powf(level);
                        for (a, b) in colour.iter().zip(expected) {
                            assert!(
                                (a - b).abs() < 2e-3,
                                "{place}, level {level}: {colour:?}, not {expected:?}"
                            );
                        }
                        compared += 1;
                    }
                }
                assert!(compared > 1000, "{compared} points");
                // Whatever the reflectance is, nothing gets lost in an environment of 1.
                let white = cube(runner, 3, |_, _| [1.0; 4]);
                let glass = Material {
                    specular: Vec4::new(0.04, 0.04, 0.04, 0.3),
                    diffuse: Vec4::ONE,
                };
                again.draw(runner, &glass, white);
                for (place, colour) in again.colours(runner, &ball) {
                    assert!((colour[0] - 1.0).abs() < 2e-3, "{place}: {colour:?}");
                }
                // And a dark one reflects by Schlick's law.
                let black = Material {
                    diffuse: Vec4::ZERO,
                    ..glass
                };
                again.draw(runner, &black, white);
                for (place, colour) in again.colours(runner, &ball) {
                    let view = (eye().truncate().as_dvec3() - place).normalize();
                    let expected = 0.04 + 0.96 * (1.0 - place.dot(view)).powi(5);
                    assert!(
                        (f64::from(colour[0]) - expected).abs() < 2e-3,
                        "{place}: {colour:?}, not {expected}"
                    );
                }
                if runner.way != Way::Native {
                    let metal = Material {
                        specular: Vec4::new(0.9, 0.9, 0.9, 0.25),
                        diffuse: Vec4::ONE * 0.5,
                    };
                    again.draw(runner, &metal, faces);
                    let pixels = runner.read_texels(again.target, TexelFormat::Rgba16Float);
                    picture("reflection", runner.way, again.size, &pixels);
                }
            }),
        }
    },
};

pub const SHADOW: Port = Port {
    file: "shadow",
    what: "shadow through a comparison sampler, bias from derivatives",
    kernels: &["shadow_vertex", "shadow_lit"],
    prepare: |runner, scale| {
        let size = scale.of(64, 1024);
        let of_map = 64;
        let native = runner.way == Way::Native;
        // The receiver is a plane that tilts away from the light, so that its own texels hide it from
        // taps beside it, unless the bias follows it. Natively there are no triangles to take
        // derivatives of: there it does not tilt.
        let tilt = if native { 0.0 } else { 1.0 };
        let plane = move |u: f32, v: f32| 0.4 + tilt * (0.2 * u + 0.1 * v);
        // A square in front of it.
        let hidden = |u: f32, v: f32| (u - 0.5).abs() < 0.25 && (v - 0.5).abs() < 0.25;
        let map: Vec<[f32; 4]> = (0..of_map * of_map)
            .map(|i| {
                let on = |i: u32| (i as f32 + 0.5) / of_map as f32;
                let (u, v) = (on(i % of_map), on(i / of_map));
                [if hidden(u, v) { 0.2 } else { plane(u, v) }, 0.0, 0.0, 0.0]
            })
            .collect();
        let map = runner.texels(&TextureShape::depth(of_map, of_map), &map);
        // The picture shows the plane as the light does, y down: the triangle covers all of it.
        let corner = |u: f32, v: f32| Vec3::new(u, v, plane(u, v));
        let views = Views {
            to_clip: [
                Vec4::new(2.0, 0.0, 0.0, 0.0),
                Vec4::new(0.0, -2.0, 0.0, 0.0),
                Vec4::ZERO,
                Vec4::new(-1.0, 1.0, 0.5, 1.0),
            ],
            to_map: [Vec4::X, Vec4::Y, Vec4::Z, Vec4::W],
        };
        let reading = Reading {
            bias: 0.004,
            spread: 2.0,
        };
        let corners = if native {
            // The pixels themselves.
            let on = |i: u32| (i as f32 + 0.5) / size as f32;
            (0..size * size)
                .map(|i| corner(on(i % size), on(i / size)))
                .collect()
        } else {
            vec![corner(0.0, 0.0), corner(0.0, 2.0), corner(2.0, 0.0)]
        };
        let corners = runner.buffer(&corners);
        let target = runner.texture(&TextureShape::d2(size, size, TexelFormat::R32Float));
        let ways = [16, 12, 4].map(|bytes| runner.zeros((size * size * bytes) as usize));
        Prepared {
            work: Box::new(move |runner| {
                let vertex_args = [Bind::Buffer(corners), Bind::Bytes(bytes_of(&views))];
                let fragment_args = [
                    Bind::Bytes(bytes_of(&reading)),
                    Bind::Texture(map),
                    comparing(),
                ];
                if native {
                    let [clip, place, out] = ways.map(Bind::Buffer);
                    let ([a, b], [c, d, e]) = (vertex_args, fragment_args);
                    runner.dispatch("shadow_vertex", &[a, b, clip, place]);
                    runner.dispatch("shadow_lit", &[place, c, d, e, out]);
                    return;
                }
                runner.draw(&Drawn {
                    vertex: ("shadow_vertex", &vertex_args),
                    fragment: ("shadow_lit", &fragment_args),
                    count: 3,
                    targets: &[target],
                    depth: None,
                });
            }),
            check: Box::new(move |runner| {
                let lit: Vec<f32> = if native {
                    runner.read(ways[2])
                } else {
                    let texels = runner.read_texels(target, TexelFormat::R32Float);
                    texels.iter().map(|t| t[0]).collect()
                };
                let mut between = 0;
                for (i, lit) in (0..).zip(&lit) {
                    let on = |i: u32| (f64::from(i) + 0.5) / f64::from(size);
                    // How far within the square's shadow, in texels of the map; at its edge it has
                    // no neighbours.
                    let within = |x: f64| (0.25 - (x - 0.5).abs()) * f64::from(of_map);
                    let inside = within(on(i % size)).min(within(on(i / size)));
                    if inside > 3.5 {
                        assert!(*lit < 1e-6, "{i}: {lit} within the shadow");
                    } else if inside < -3.5 && inside > -12.5 {
                        assert!(*lit > 1.0 - 1e-6, "{i}: {lit} outside of the shadow");
                    } else if *lit > 0.01 && *lit < 0.99 {
                        between += 1;
                    }
                }
                assert!(between > 200, "{between} pixels between light and shadow");
                if !native {
                    let pixels: Vec<[f32; 4]> = lit.iter().map(|x| [*x; 4]).collect();
                    picture("shadow", runner.way, size, &pixels);
                }
            }),
        }
    },
};
