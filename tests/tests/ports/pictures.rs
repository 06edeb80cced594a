//! Ports that work on pictures.

use hankel_dsl::bytemuck::bytes_of;
use hankel_dsl::glam::{DVec2, DVec3, Vec2};
use hankel_dsl::native::describe::TexelFormat::{R32Float, Rgba8Unorm, Rgba16Float};
use hankel_example_ports::bloom::Glow;
use hankel_example_ports::fxaa::Contrast;
use hankel_example_ports::ssao::View;
use hankel_host::device::{Bind, TextureShape};

use crate::run::{LINEAR, Port, Prepared, Runner, picture};

/// Which side of some edges a point of the unit square is on: a polygon's, and a ring's.
fn figure(p: DVec2) -> bool {
    let q = p - DVec2::new(0.38, 0.45);
    let polygon = q.x.abs() * 0.9 + q.y.abs() * 0.35 < 0.2 && q.y < 0.31;
    let ring = ((p - DVec2::new(0.68, 0.6)).length() - 0.2).abs() < 0.045;
    polygon || ring
}

/// The share of each pixel that the figure covers, from so many samples along each axis.
fn coverage(size: u32, samples: u32) -> Vec<f32> {
    let mut all = Vec::new();
    for pixel in 0..size * size {
        let (x, y) = (pixel % size, pixel / size);
        let on = |i: u32, k: u32| {
            (f64::from(i) + (f64::from(k) + 0.5) / f64::from(samples)) / f64::from(size)
        };
        let inside = (0..samples * samples)
            .filter(|k| figure(DVec2::new(on(x, k % samples), on(y, k / samples))))
            .count();
        all.push(inside as f32 / (samples * samples) as f32);
    }
    all
}

pub const FXAA: Port = Port {
    file: "fxaa",
    what: "fast approximate antialiasing",
    kernels: &["fxaa"],
    prepare: |runner, scale| {
        let size = scale.of(96, 512);
        let shape = TextureShape::d2(size, size, Rgba8Unorm);
        let (dark, bright) = (0.2, 0.8);
        let aliased = coverage(size, 1);
        let colours: Vec<[f32; 4]> = aliased
            .iter()
            .map(|c| [dark + (bright - dark) * c; 4])
            .collect();
        let source = runner.texels(&shape, &colours);
        let out = runner.texture(&shape);
        let contrast = Contrast {
            relative: 0.125,
            absolute: 0.04,
            thin: 0.75,
            padding: 0.0,
        };
        Prepared {
            work: Box::new(move |runner| {
                let args = [
                    Bind::Bytes(bytes_of(&contrast)),
                    Bind::Texture(source),
                    LINEAR,
                    Bind::Texture(out),
                ];
                runner.dispatch("fxaa", &args);
            }),
            check: Box::new(move |runner| {
                let smooth = runner.read_texels(out, Rgba8Unorm);
                let is: Vec<f32> = smooth
                    .iter()
                    .map(|c| (c[0] - dark) / (bright - dark))
                    .collect();
                let exact = coverage(size, 16);
                let error = |from: &[f32]| {
                    let sum: f32 = from.iter().zip(&exact).map(|(a, b)| (a - b).powi(2)).sum();
                    (sum / exact.len() as f32).sqrt()
                };
                let (before, after) = (error(&aliased), error(&is));
                assert!(after < 0.6 * before, "{after}, of {before} without");
                for (i, (was, is)) in aliased.iter().zip(&is).enumerate() {
                    let (x, y) = (i as u32 % size, i as u32 / size);
                    let alike = |dx: i64, dy: i64| {
                        let at = |i: u32, d: i64| (i64::from(i) + d).clamp(0, i64::from(size) - 1);
                        aliased[(at(y, dy) * i64::from(size) + at(x, dx)) as usize] == *was
                    };
                    if [(1, 0), (-1, 0), (0, 1), (0, -1)]
                        .into_iter()
                        .all(|(x, y)| alike(x, y))
                    {
                        assert!((was - is).abs() < 0.01, "({x}, {y}) is on no edge");
                    }
                }
                picture("fxaa", runner.way, size, &smooth);
            }),
        }
    },
};

/// Distances along the view axis of a room: a floor, a wall, a ball on the floor.
fn room(size: u32, half: Vec2) -> Vec<[f32; 4]> {
    let on = |i: u32| (f64::from(i) + 0.5) / f64::from(size) * 2.0 - 1.0;
    (0..size * size)
        .map(|i| {
            let way = DVec3::new(
                on(i % size) * f64::from(half.x),
                on(i / size) * f64::from(half.y),
                1.0,
            );
            // y points down; the floor lies 1 below the eye, the wall 4 before it.
            let mut depth = 4.0_f64;
            if way.y > 0.0 {
                depth = depth.min(1.0 / way.y);
            }
            let ball = DVec3::new(0.3, 0.7, 3.2);
            let (a, b, c) = (way.dot(way), way.dot(ball), ball.dot(ball) - 0.09);
            if b * b > a * c {
                depth = depth.min((b - (b * b - a * c).sqrt()) / a);
            }
            [depth as f32, 0.0, 0.0, 0.0]
        })
        .collect()
}

pub const SSAO: Port = Port {
    file: "ssao",
    what: "ambient occlusion in screen space, and its blur",
    kernels: &["ssao", "ssao_blur"],
    prepare: |runner, scale| {
        let size = scale.of(96, 512);
        let view = View {
            half: Vec2::splat(0.6),
            radius: 0.4,
            bias: 0.01,
            strength: 2.0,
            edge: 0.2,
            padding: Vec2::ZERO,
        };
        let shape = TextureShape::d2(size, size, R32Float);
        let depths = runner.texels(&shape, &room(size, view.half));
        let (light, blurred) = (runner.texture(&shape), runner.texture(&shape));
        Prepared {
            work: Box::new(move |runner| {
                let of_view = Bind::Bytes(bytes_of(&view));
                let [a, b, c] = [depths, light, blurred].map(Bind::Texture);
                runner.dispatch("ssao", &[of_view, a, b]);
                runner.dispatch("ssao_blur", &[of_view, a, b, c]);
            }),
            check: Box::new(move |runner| {
                let read = |runner: &mut Runner<'_>, texture| -> Vec<f32> {
                    let texels = runner.read_texels(texture, R32Float);
                    texels.iter().map(|t| t[0]).collect()
                };
                let (raw, smooth) = (read(runner, light), read(runner, blurred));
                let at = |from: &[f32], x: f64, y: f64| {
                    let to = |v: f64| ((v / 0.6 + 1.0) * 0.5 * f64::from(size)) as u32;
                    from[(to(y) * size + to(x)) as usize]
                };
                // Far from everything the wall is plain; the crease of wall and floor is dark, on
                // both sides; so is the floor beside the ball.
                assert!(at(&raw, -0.3, -0.4) > 0.999);
                assert!(at(&smooth, -0.3, -0.4) > 0.999);
                assert!(at(&smooth, -0.3, 0.24) < 0.8, "{}", at(&smooth, -0.3, 0.24));
                assert!(at(&smooth, -0.3, 0.27) < 0.8, "{}", at(&smooth, -0.3, 0.27));
                assert!(at(&smooth, -0.3, 0.5) > 0.95, "{}", at(&smooth, -0.3, 0.5));
                assert!(raw.iter().all(|x| (0.0..=1.0).contains(x)));
                // The blur takes noise away, and leaves the mean.
                let mean = |v: &[f32]| v.iter().sum::<f32>() / v.len() as f32;
                assert!((mean(&raw) - mean(&smooth)).abs() < 0.01);
                let rough = |v: &[f32]| {
                    let steps = v.windows(2).map(|w| (w[0] - w[1]).powi(2));
                    steps.sum::<f32>()
                };
                assert!(
                    rough(&smooth) < 0.4 * rough(&raw),
                    "{} {}",
                    rough(&smooth),
                    rough(&raw)
                );
                let pixels: Vec<[f32; 4]> = smooth.iter().map(|x| [*x; 4]).collect();
                picture("ssao", runner.way, size, &pixels);
            }),
        }
    },
};

/// Levels of the bloom.
const LEVELS: u32 = 4;

pub const BLOOM: Port = Port {
    file: "bloom",
    what: "bloom over a chain of mip levels",
    kernels: &["bloom_bright", "bloom_down", "bloom_up", "bloom_composite"],
    prepare: |runner, scale| {
        let size = scale.of(128, 512);
        let glow = Glow {
            threshold: 1.0,
            spread: 0.5,
            strength: 0.8,
            padding: 0.0,
        };
        let shape = |size: u32| TextureShape::d2(size, size, Rgba16Float);
        // A lamp of 3 by 3 texels in the middle of a picture that is darker than the threshold.
        let middle = size / 2;
        let colours: Vec<[f32; 4]> = (0..size * size)
            .map(|i| {
                let near = |i: u32| i.abs_diff(middle) <= 1;
                if near(i % size) && near(i / size) {
                    [40.0, 24.0, 8.0, 1.0]
                } else {
                    [0.25, 0.25, 0.5, 1.0]
                }
            })
            .collect();
        let source = runner.texels(&shape(size), &colours);
        let chain = |runner: &mut Runner<'_>| -> Vec<_> {
            (1..=LEVELS)
                .map(|level| runner.texture(&shape(size >> level)))
                .collect()
        };
        let (down, up) = (chain(runner), chain(runner));
        let mips = runner.texture(&shape(size / 2).with_levels(LEVELS));
        let picture_of = runner.texture(&TextureShape::d2(size, size, Rgba8Unorm));
        let (narrow, wide) = (down.clone(), up.clone());
        let composite = move |runner: &mut Runner<'_>, from| {
            let args = [
                Bind::Bytes(bytes_of(&glow)),
                Bind::Texture(from),
                Bind::Texture(mips),
                LINEAR,
                Bind::Texture(picture_of),
            ];
            runner.dispatch("bloom_composite", &args);
        };
        Prepared {
            work: Box::new(move |runner| {
                let of_glow = Bind::Bytes(bytes_of(&glow));
                let texture = Bind::Texture;
                runner.dispatch(
                    "bloom_bright",
                    &[of_glow, texture(source), LINEAR, texture(down[0])],
                );
                for pair in down.windows(2) {
                    runner.dispatch("bloom_down", &[texture(pair[0]), LINEAR, texture(pair[1])]);
                }
                for level in (0..down.len() - 1).rev() {
                    let below = if level + 2 == down.len() {
                        down[level + 1]
                    } else {
                        up[level + 1]
                    };
                    let [a, b, c] = [down[level], below, up[level]].map(texture);
                    runner.dispatch("bloom_up", &[of_glow, a, b, LINEAR, c]);
                }
                composite(runner, source);
            }),
            check: Box::new(move |runner| {
                let read =
                    |runner: &mut Runner<'_>, texture| runner.read_texels(texture, Rgba16Float);
                let sum = |texels: &[[f32; 4]]| texels.iter().map(|t| f64::from(t[0])).sum::<f64>();
                let close = |a: f64, b: f64, what: &str| {
                    assert!((a / b - 1.0).abs() < 0.01, "{what}: {a}, not {b}");
                };
                let downs: Vec<f64> = narrow.iter().map(|t| sum(&read(runner, *t))).collect();
                assert!(downs[0] > 1.0, "{downs:?}");
                // The taps share each texel out: a quarter of the sum, in a quarter of the texels.
                for pair in downs.windows(2) {
                    close(pair[1], pair[0] / 4.0, "down");
                }
                // On the way up each level gets its own and, enlarged, half of the one below it.
                let mut below = downs[LEVELS as usize - 1];
                for level in (0..LEVELS as usize - 1).rev() {
                    let expected = downs[level] + 0.5 * 4.0 * below;
                    below = sum(&read(runner, wide[level]));
                    close(below, expected, "up");
                }
                // The picture with the levels that were made.
                let mut levels = Vec::new();
                for level in &wide[..LEVELS as usize - 1] {
                    levels.extend(read(runner, *level));
                }
                levels.extend(read(runner, narrow[LEVELS as usize - 1]));
                let fill = |runner: &mut Runner<'_>, texels: &[[f32; 4]]| {
                    let mut bytes = vec![0; texels.len() * 8];
                    for (to, texel) in bytes.chunks_mut(8).zip(texels) {
                        Rgba16Float.store(to, (*texel).into());
                    }
                    runner
                        .device
                        .write_texture(mips, &bytes)
                        .expect("it is as large");
                };
                fill(runner, &levels);
                composite(runner, source);
                let pixels = runner.read_texels(picture_of, Rgba8Unorm);
                picture("bloom", runner.way, size, &pixels);
                // Levels of one value each: their mean is added.
                let mut even = Vec::new();
                for level in 0..LEVELS {
                    let n = (size >> (level + 1)).pow(2) as usize;
                    even.extend(std::iter::repeat_n([level as f32; 4], n));
                }
                fill(runner, &even);
                composite(runner, source);
                let corner = runner.read_texels(picture_of, Rgba8Unorm)[0];
                let light = 0.25 + 0.8 * (0.0 + 1.0 + 2.0 + 3.0) / 4.0;
                assert!(
                    (corner[0] - light / (1.0 + light)).abs() < 0.003,
                    "{corner:?}"
                );
            }),
        }
    },
};
