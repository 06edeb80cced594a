//! Frames without a GPU: what is planned, and native pictures against rays.

use std::path::Path;

use hankel_dsl::glam::{DVec3, Vec3};
use hankel_frames::scene::{CameraView, Light, Procedural, Scene};
use hankel_frames::techniques::Technique;
use hankel_frames::visibility::cast::{Caster, Lens, Segment};
use hankel_frames::{
    Clock, Frame, FrameError, NoShaders, Picture, Progress, Quiet, Show, graph_of, render,
    render_on, techniques,
};
use hankel_host::device::{Backend, open};

fn scene(shadow: &str) -> Scene {
    let text = format!(
        r#"
        [geometry]
        procedural = "box"
        [camera]
        eye = [2.0, 6.0, 4.0]
        target = [0.0, 0.2, 0.0]
        [light]
        direction = [1.0, -1.0, 0.4]
        [shadow]
        {shadow}
        [output]
        width = 192
        height = 128
        "#
    );
    Scene::parse(&text, Path::new("test.toml")).unwrap_or_else(|e| panic!("{e}"))
}

fn with_map(technique: &str, map: &techniques::Map) -> String {
    format!(
        "technique = '{technique}'\nformat = '{}'\ndepth_range = '{}'",
        map.format.name(),
        map.depth_range.name()
    )
}

fn plan(shadow: &str) -> (Vec<String>, String) {
    let scene = scene(shadow);
    let mesh = scene.mesh().unwrap_or_else(|e| panic!("{e}"));
    let (graph, ..) = graph_of(&scene, &mesh, Show::Picture).unwrap_or_else(|e| panic!("{e}"));
    let summary = graph.summary();
    let passes = summary.passes.iter().map(|p| p.pass.clone()).collect();
    (passes, summary.to_string())
}

#[test]
fn a_plan_holds_what_is_needed_and_says_what_is_not() {
    let (passes, text) = plan("");
    assert_eq!(
        passes,
        ["depth", "resolve", "blur rows", "blur columns", "shade"]
    );
    for line in [
        "1. depth: light_depth, 1024x1024, 4 samples, depth32float",
        "2. resolve: resolve_symmetric, 1024x1024, rgba16unorm",
        "3. blur rows: blur_rgba16unorm, 1024x1024, rgba16unorm, 7 taps",
        "5. shade: surface and shade_hamburger, 192x128, 4 samples, rgba16float",
        "no mips: the map is read at its own resolution",
    ] {
        assert!(text.lines().any(|l| l == line), "{line}:\n{text}");
    }

    let (passes, text) = plan("filter = 1\ndepth_range = 'unit'\ntechnique = 'hausdorff'");
    assert_eq!(passes, ["depth", "resolve", "shade"]);
    assert!(
        text.contains("no blur: the filter is one texel wide"),
        "{text}"
    );
    assert!(
        text.contains("resolve_unit") && text.contains("shade_hausdorff"),
        "{text}"
    );

    let (passes, text) = plan("technique = 'pcf'");
    assert_eq!(passes, ["depth", "shade"]);
    assert!(
        text.contains("no moments") && text.contains("no blur"),
        "{text}"
    );
    assert!(!text.contains("no depth bias"), "{text}");

    let (_, text) = plan("technique = 'vsm'\nformat = 'rg32float'");
    assert!(
        text.contains("no quantisation") && text.contains("blur_rg32float"),
        "{text}"
    );
    assert!(
        text.contains("resolve_variance") && text.contains("shade_variance"),
        "{text}"
    );
}

/// A technique whose passes do not fit their kernels would fail here.
#[test]
fn every_technique_makes_a_graph_for_every_map() {
    for technique in techniques::ALL {
        for map in technique.maps {
            let (passes, text) = plan(&with_map(technique.name, map));
            assert_eq!(passes.last().map(String::as_str), Some("shade"));
            let kept = text
                .lines()
                .any(|l| l.contains("resolve_") && l.contains(map.format.name()));
            // A table is a buffer; who compares depths themselves says so.
            let is_table = passes.contains(&"sum columns".to_owned());
            let has_no_map = text.contains("no moments: ");
            assert!(kept || is_table || has_no_map, "{text}");
        }
    }
}

fn native(scene: &Scene) -> Picture {
    render(scene, Backend::Native, &NoShaders, &mut Quiet)
        .unwrap_or_else(|e| panic!("{e}"))
        .picture
}

/// What a pixel's centre sees, and whether a ray from there to the light is blocked.
enum Truth {
    Sky,
    Ground { lit: bool },
    Box,
}

fn truth(scene: &Scene) -> Vec<Truth> {
    let mesh = scene.mesh().unwrap_or_else(|e| panic!("{e}"));
    let caster = Caster::of(&mesh);
    let view = CameraView::new(
        &scene.camera,
        &mesh,
        scene.width as f32 / scene.height as f32,
    );
    let lens = Lens::new(view.clip_from_world, scene.width, scene.height);
    let towards = -scene.lights[0].direction().as_dvec3() * 100.0;
    (0..scene.width * scene.height)
        .map(|i| {
            let segment = lens.segment([i % scene.width, i / scene.width], [0.5, 0.5]);
            let Some(hit) = caster.first(&segment) else {
                return Truth::Sky;
            };
            let at = segment.at(hit.t);
            if at.y.abs() > 1e-6 {
                return Truth::Box;
            }
            let blocked = caster
                .first(&Segment::new(at + DVec3::Y * 1e-6, towards))
                .is_some();
            Truth::Ground { lit: !blocked }
        })
        .collect()
}

/// Greys of ground pixels well inside of light, and well inside of shadow.
fn ground(scene: &Scene, picture: &Picture, distance: i32) -> [Vec<u8>; 2] {
    let truth = truth(scene);
    let (width, height) = (scene.width as i32, scene.height as i32);
    let mut greys = [Vec::new(), Vec::new()];
    for y in distance..height - distance {
        for x in distance..width - distance {
            let Truth::Ground { lit } = truth[(y * width + x) as usize] else {
                continue;
            };
            let alike = (-distance..=distance).all(|dy| {
                (-distance..=distance).all(|dx| {
                    let there = &truth[((y + dy) * width + x + dx) as usize];
                    matches!(there, Truth::Ground { lit: l } if *l == lit)
                })
            });
            if alike {
                greys[usize::from(lit)].push(picture.pixels[(y * width + x) as usize][1]);
            }
        }
    }
    assert!(truth.iter().any(|t| matches!(t, Truth::Sky)));
    assert!(truth.iter().any(|t| matches!(t, Truth::Box)));
    greys
}

fn range(greys: &[u8]) -> [u8; 2] {
    assert!(greys.len() > 100, "{}", greys.len());
    [
        greys.iter().copied().min().unwrap_or(0),
        greys.iter().copied().max().unwrap_or(0),
    ]
}

#[test]
fn percentage_closer_filtering_is_what_rays_say() {
    let scene = scene("technique = 'pcf'\nfilter = 3\nsize = 512\ndepth_bias = 0.003");
    let [dark, bright] = ground(&scene, &native(&scene), 2);
    let ([dark_low, dark_high], [bright_low, bright_high]) = (range(&dark), range(&bright));
    // One grey each: no acne, no gap.
    assert_eq!((dark_low, bright_low), (dark_high, bright_high));
    assert!(bright_low > dark_high + 60, "{bright_low} {dark_high}");
}

/// Shadow of one box on one plane: two depths, which every technique resolves. The cut takes what
/// bias and rounding leave.
fn is_as_filtered_depths(technique: &str) {
    gives_that_light(technique, "");
}

fn gives_that_light(technique: &str, settings: &str) {
    let pcf = scene("technique = 'pcf'\nfilter = 3\nsize = 512\ndepth_bias = 0.003");
    let wanted = ground(&pcf, &native(&pcf), 3).map(|g| i32::from(range(&g)[0]));
    for map in Technique::named(technique).unwrap().maps {
        let map = with_map(technique, map);
        let scene = scene(&format!("filter = 3\nsize = 512\n{settings}\n{map}"));
        let greys = ground(&scene, &native(&scene), 3);
        for (greys, wanted) in greys.iter().zip(wanted) {
            let off = greys
                .iter()
                .filter(|&&g| (i32::from(g) - wanted).abs() > 3)
                .count();
            assert!(
                off == 0,
                "{technique} {map}: {off} of {} are not {wanted} but {:?}",
                greys.len(),
                range(greys)
            );
        }
    }
}

#[test]
fn hamburger_gives_the_same_light_and_shadow() {
    is_as_filtered_depths("hamburger");
}

#[test]
fn one_sample_of_depth_gives_the_same_light_and_shadow() {
    gives_that_light("pcf", "depth_bias = 0.003\nmultisampling = 1");
    gives_that_light("hamburger", "multisampling = 1");
}

#[test]
fn hausdorff_gives_the_same_light_and_shadow() {
    is_as_filtered_depths("hausdorff");
}

#[test]
fn variance_gives_the_same_light_and_shadow() {
    is_as_filtered_depths("vsm");
}

#[test]
fn six_moments_give_the_same_light_and_shadow() {
    is_as_filtered_depths("hamburger-6");
}

#[test]
fn any_number_of_moments_gives_the_same_light_and_shadow() {
    for technique in ["moments-4", "moments-6", "moments-8", "moments-10"] {
        is_as_filtered_depths(technique);
        is_as_filtered_depths(&format!("{technique}-compensated"));
    }
}

#[test]
fn trigonometric_moments_give_the_same_light_and_shadow() {
    is_as_filtered_depths("tmsm");
}

/// As bright where nothing shades; what is well behind the box is dark, what is near it is as a slow rise leaves it.
#[test]
fn series_give_the_same_light() {
    let pcf = scene("technique = 'pcf'\nfilter = 3\nsize = 512\ndepth_bias = 0.003");
    let [dark, lit] = ground(&pcf, &native(&pcf), 3).map(|g| i32::from(range(&g)[0]));
    for technique in ["convolution", "convolution-8"] {
        for map in Technique::named(technique).unwrap().maps {
            let map = with_map(technique, map);
            let scene = scene(&format!("filter = 3\nsize = 512\n{map}"));
            let [shaded, bright] = ground(&scene, &native(&scene), 3);
            let [low, high] = range(&bright).map(i32::from);
            assert!(low >= lit - 3 && high <= lit + 3, "{map}: {low} {high}");
            let [low, high] = range(&shaded).map(i32::from);
            println!("{map}: {low} {high}, lit {lit}, dark {dark}");
            assert!(
                (low - dark).abs() <= 3 && high <= lit + 3,
                "{map}: {low} {high}"
            );
        }
    }
}

#[test]
fn exponentials_give_the_same_light_and_shadow() {
    is_as_filtered_depths("esm");
}

#[test]
fn variance_of_exponentials_gives_the_same_light_and_shadow() {
    is_as_filtered_depths("evsm2");
    is_as_filtered_depths("evsm4");
}

/// A light that is a point has hard shadows, whatever the technique could do.
#[test]
fn soft_shadows_of_a_point_give_the_same_light_and_shadow() {
    for technique in ["soft", "soft-6"] {
        is_as_filtered_depths(technique);
    }
    // They compare single depths as `pcf` does, with the same bias.
    for technique in ["pcss", "vssm"] {
        gives_that_light(technique, "depth_bias = 0.003");
    }
}

/// The page about frames says of each technique what it is and how its map may be stored.
#[test]
fn the_table_of_techniques_is_current() {
    let page = include_str!("../../docs/frames.md");
    for t in techniques::ALL {
        let maps: Vec<String> = t
            .maps
            .iter()
            .map(|m| format!("`{}` {}", m.format.name(), m.depth_range.name()))
            .collect();
        let row = format!("| `{}` | {} | {} |", t.name, t.summary, maps.join(", "));
        assert!(
            page.lines().any(|l| l == row),
            "docs/frames.md has no row\n{row}"
        );
    }
}

#[test]
fn the_picture_is_upright_and_not_mirrored() {
    // The sun stands to the left, the shadow falls to the right; the sky is above.
    let mut scene = scene("filter = 1\nsize = 256");
    scene.camera.eye = Vec3::new(0.0, 2.0, 9.0);
    scene.camera.target = Vec3::ZERO;
    scene.lights = vec![Light::directional(Vec3::new(1.0, -1.0, 0.0))];
    let picture = native(&scene);
    let at = |x: usize, y: usize| picture.pixels[y * 192 + x];
    assert_eq!(at(10, 4), at(180, 4));
    assert!(
        at(10, 4)[2] > at(10, 4)[0] + 20,
        "sky is blue: {:?}",
        at(10, 4)
    );
    let row = 72;
    assert!(
        at(60, row)[1] > at(124, row)[1] + 60,
        "{:?} {:?}",
        at(60, row),
        at(124, row)
    );
}

#[test]
fn progress_counts_up_and_timings_name_every_step() {
    #[derive(Default)]
    struct Log(Vec<(String, usize, usize)>, f32);
    impl Progress for Log {
        fn begin(&mut self, name: &str, step: usize, steps: usize) {
            self.0.push((name.into(), step, steps));
            self.1 = 0.0;
        }
        fn advance(&mut self, share: f32) {
            assert!(share >= self.1 && share <= 1.0);
            self.1 = share;
        }
    }
    let scene = scene("size = 64");
    let mut log = Log::default();
    let rendering = render(&scene, Backend::Native, &NoShaders, &mut log).unwrap();
    let names: Vec<&str> = log.0.iter().map(|(n, ..)| n.as_str()).collect();
    assert_eq!(
        names,
        ["depth", "resolve", "blur rows", "blur columns", "shade"]
    );
    assert!(
        log.0
            .iter()
            .enumerate()
            .all(|(i, (_, step, steps))| *step == i + 1 && *steps == 5)
    );
    let timed: Vec<&str> = rendering.timings.iter().map(|t| &*t.name).collect();
    assert_eq!((timed[0], timed[6]), ("set-up", "read back"));
    assert_eq!(timed[1..6], names[..]);
    assert_eq!(rendering.triangles, 14);
    let edges = rendering.edges.unwrap();
    assert!(edges > 0.01 && edges < 0.1, "{edges}");
}

#[test]
fn any_valid_scene_renders() {
    // Inside of the box, behind everything, light along the ground, one pixel.
    for (eye, light, width, height) in [
        (Vec3::new(0.0, 0.5, 0.1), Vec3::NEG_Y, 7, 5),
        (Vec3::new(0.0, 50.0, 0.1), Vec3::Y, 3, 9),
        (Vec3::new(40.0, 0.0, 0.0), Vec3::X, 9, 3),
        (Vec3::new(3.0, 3.0, 3.0), Vec3::new(0.0, -1.0, 1e-5), 1, 1),
    ] {
        let mut scene = scene("size = 16\nfilter = 31");
        scene.camera.eye = eye;
        scene.camera.target = eye + Vec3::new(-1.0, 0.3, 0.2);
        scene.lights = vec![Light::directional(light)];
        (scene.width, scene.height) = (width, height);
        assert_eq!(native(&scene).pixels.len(), (width * height) as usize);
    }
}

#[test]
fn a_missing_shader_is_named() {
    let scene = scene("");
    let mesh = Procedural::Box.mesh();
    let mut device = open(Backend::Vulkan).unwrap_or_else(|e| panic!("{e}"));
    let e = render_on(&mut *device, &scene, &mesh, &NoShaders, &mut Quiet).unwrap_err();
    assert!(matches!(e, FrameError::NoShader { .. }));
    let text = e.to_string();
    assert!(
        text.contains("light_depth") && text.contains("build the shaders"),
        "{text}"
    );
}

/// A map that is fitted to the camera's view moves with the camera, and the picture is that of a frame
/// that was made for this camera.
#[test]
fn a_fitted_map_follows_the_camera() {
    let before = scene("size = 128\nfilter = 3\nfit = 'camera'");
    let mesh = before.mesh().unwrap_or_else(|e| panic!("{e}"));
    let mut after = before.clone();
    after.camera.eye = Vec3::new(-1.5, 3.0, 2.0);
    let mut device = open(Backend::Native).unwrap();
    let show = Show::Picture;
    let mut frame = Frame::new(&mut *device, &NoShaders, &before, &mesh, show).unwrap();
    frame.run(Clock::Frame, &mut Quiet).unwrap();
    let first = frame.picture().unwrap();
    frame.set_camera(&after.camera).unwrap();
    let run = frame.run(Clock::Frame, &mut Quiet).unwrap();
    assert!(run.unchanged.is_empty(), "{run:?}");
    let moved = frame.picture().unwrap();
    assert_ne!(first, moved);
    drop(frame);
    let mut fresh = Frame::new(&mut *device, &NoShaders, &after, &mesh, show).unwrap();
    fresh.run(Clock::Frame, &mut Quiet).unwrap();
    assert_eq!(fresh.picture().unwrap(), moved);
}

/// The reference of a scene file's keys is that of the code.
#[test]
fn the_page_has_every_key_of_a_scene_file() {
    let page = include_str!("../../docs/frames.md");
    let source = include_str!("../src/scene/mod.rs");
    let keys = source
        .split_once("//! ```toml\n")
        .and_then(|(_, rest)| rest.split_once("//! ```\n"))
        .expect("the reference")
        .0;
    let keys: Vec<&str> = keys
        .lines()
        .map(|line| line.trim_start_matches("//!").trim_start_matches(' '))
        .collect();
    assert!(page.contains(&keys.join("\n")), "docs/frames.md lacks it");
}
