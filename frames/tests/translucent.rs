//! Translucent casters: blending on both devices, and techniques against rays and against lists of all surfaces.

mod common;

use std::path::Path;

use hankel_dsl::glam::{Mat4, UVec2, Vec3, Vec4};
use hankel_dsl::native::describe::TexelFormat;
use hankel_frames::graph::{Graph, Handle, Surfaces};
use hankel_frames::measure::Choices;
use hankel_frames::passes::TRANSLUCENT;
use hankel_frames::plan::{Wanted, plan};
use hankel_frames::scene::{Fit, Light, Mesh, Scene};
use hankel_frames::techniques::Technique;
use hankel_frames::truth::{Arriving, by_rays, by_technique, filtered};
use hankel_frames::visibility::cast::{Caster, Segment};
use hankel_frames::{Clock, Executor, Frame, NoShaders, Quiet, Show, graph_of};
use hankel_host::device::{Backend, Blend, NativeDevice, open};
use hankel_shadows::depth::Transform;

/// Texels of a map along an edge.
const SIZE: u32 = 64;

/// Panes across the whole map, from the first drawn to the last: depth, colour and opacity.
fn panes(all: &[(f32, f32, f32)]) -> Mesh {
    let mut mesh = Mesh::default();
    for &(depth, colour, opacity) in all {
        let corners = [[-2.0, -2.0], [2.0, -2.0], [2.0, 2.0], [-2.0, 2.0]];
        mesh.quad(corners.map(|[x, y]| Vec3::new(x, y, depth)));
        mesh.paint(Vec3::splat(colour));
        mesh.fade(opacity);
    }
    mesh
}

/// A draw of panes.
struct Draw<'a> {
    mesh: &'a Mesh,
    blend: Blend,
    fragment: &'static str,
    format: TexelFormat,
    background: f64,
    /// An opaque pane before which they are drawn.
    before: Option<f32>,
}

impl Draw<'_> {
    /// All samples of all texels on a device.
    fn samples(&self, backend: Backend) -> Vec<Vec4> {
        let mut graph = Graph::new(hankel_shadows::entries());
        let identity = Mat4::IDENTITY;
        let view = Transform {
            row_x: identity.row(0),
            row_y: identity.row(1),
            row_z: identity.row(2),
            row_w: identity.row(3),
        };
        let view = graph.parameter("view", &view);
        let size = [SIZE; 2];
        let before = self.before.map(|depth| {
            let mesh = panes(&[(depth, 0.0, 1.0)]);
            let positions = graph.buffer("opaque", &mesh.positions);
            let surfaces = Surfaces {
                positions,
                indices: graph.buffer("opaque indices", mesh.indices()),
                clip_from_world: view,
            };
            let draw = graph.draw("depth", surfaces, "light_depth");
            draw.arg("position", positions)
                .arg("light", view)
                .depth(size)
                .unwrap()
        });
        let positions = graph.buffer("positions", &self.mesh.positions);
        let colours = graph.buffer("colours", &self.mesh.colours);
        let opacities = graph.buffer("opacities", &self.mesh.all_opacities());
        let surfaces = Surfaces {
            positions,
            indices: graph.buffer("indices", self.mesh.indices()),
            clip_from_world: view,
        };
        let texels = graph.constant("size", &UVec2::splat(SIZE));
        let mut pass = graph
            .draw("blend", surfaces, "translucent")
            .arg("position", positions)
            .arg("colour", colours)
            .arg("opacity", opacities)
            .arg("view", view)
            .fragment(self.fragment)
            .blend(self.blend);
        if self.fragment == "stochastic_depths" {
            pass = pass.arg("size", texels);
        }
        if let Some(depth) = before {
            pass = pass.before(depth);
        }
        let drawn = pass
            .samples(size, self.format, [self.background; 4])
            .unwrap();
        graph.keep(drawn);
        let bytes = run(graph, drawn, backend);
        let texels = bytes.chunks_exact(self.format.bytes());
        texels.map(|t| self.format.load(t)).collect()
    }
}

fn run(graph: Graph, value: Handle, backend: Backend) -> Vec<u8> {
    let mut device = open(backend).unwrap_or_else(|e| panic!("{e}"));
    let shaders = common::shaders();
    let mut executor = Executor::new(&mut *device, &shaders, graph).unwrap();
    executor.run(Clock::Frame, &mut Quiet).unwrap();
    executor.read(value).unwrap()
}

/// What three panes make in each mode, on both devices: in the order in which they are drawn, and only where
/// they are nearer than what hides them.
#[test]
fn blending_is_what_its_mode_says() {
    let three = [(0.7, 0.25, 0.5), (0.2, 0.5, 0.25), (0.4, 1.0, 0.75)];
    let mesh = panes(&three);
    // What `tint` gives of one.
    let tint = |(_, colour, opacity): (f32, f32, f32)| {
        let channel = 1.0 - opacity * (1.0 - colour);
        Vec4::new(channel, channel, channel, 1.0)
    };
    let sum = three.map(tint).into_iter().sum::<Vec4>();
    let product = three.map(tint).into_iter().fold(Vec4::ONE, |a, b| a * b);
    let product_of_two = tint(three[1]) * tint(three[2]);
    let last = tint(three[2]);
    let over = three.iter().fold(0.0, |b, (_, _, a)| a + (1.0 - a) * b);
    for backend in [Backend::Native, Backend::Vulkan] {
        let check = |blend, format, background, before, expected: Vec4, step: f32| {
            let draw = Draw {
                mesh: &mesh,
                blend,
                fragment: "tint",
                format,
                background,
                before,
            };
            for (i, sample) in draw.samples(backend).into_iter().enumerate() {
                let off = (sample - expected).abs().max_element();
                assert!(
                    off <= step,
                    "{backend}, {blend:?}, {i}: {sample} {expected}"
                );
            }
        };
        // Half a step for each pane, and one for what the hardware rounds otherwise.
        let unorm = 2.5 / 65535.0;
        let half = 2.5 / 1024.0;
        check(
            Blend::Multiplicative,
            TexelFormat::Rgba16Unorm,
            1.0,
            None,
            product,
            unorm,
        );
        check(
            Blend::Multiplicative,
            TexelFormat::Rgba16Float,
            1.0,
            None,
            product,
            half,
        );
        let nearer = Some(0.5);
        check(
            Blend::Multiplicative,
            TexelFormat::Rgba16Unorm,
            1.0,
            nearer,
            product_of_two,
            unorm,
        );
        check(
            Blend::Additive,
            TexelFormat::Rgba16Float,
            0.0,
            None,
            sum,
            half,
        );
        check(
            Blend::Least,
            TexelFormat::Rgba16Unorm,
            1.0,
            None,
            tint(three[0]),
            unorm,
        );
        // Its alpha is 1: the last one stays.
        check(
            Blend::Alpha,
            TexelFormat::Rgba16Unorm,
            0.0,
            None,
            last,
            unorm,
        );
        let draw = Draw {
            mesh: &mesh,
            blend: Blend::Alpha,
            fragment: "translucent_moments",
            format: TexelFormat::Rgba16Unorm,
            background: 0.0,
            before: None,
        };
        for sample in draw.samples(backend) {
            assert!(
                (sample.w - over).abs() <= unorm,
                "{backend}: {sample} {over}"
            );
        }
    }
}

/// Whatever is drawn by chance is what its opacity says on average, also behind something else.
#[test]
fn chance_keeps_the_share_that_opacities_say() {
    for [near, far] in [[0.25_f32, 0.5], [0.1, 0.9], [0.37, 0.61], [0.0, 1.0]] {
        let mesh = panes(&[(0.3, 0.0, near), (0.8, 0.0, far)]);
        let draw = Draw {
            mesh: &mesh,
            blend: Blend::Least,
            fragment: "stochastic_depths",
            format: TexelFormat::Rgba16Unorm,
            background: 1.0,
            before: None,
        };
        let native = draw.samples(Backend::Native);
        assert_eq!(
            native,
            draw.samples(Backend::Vulkan),
            "the noise is always the same"
        );
        // Sample i reads channel i.
        let depths = native
            .chunks_exact(4)
            .flat_map(|texel| [0, 1, 2, 3].map(|i| texel[i][i]));
        let depths: Vec<f32> = depths.collect();
        let share = |at: f32| {
            let count = depths.iter().filter(|d| (**d - at).abs() < 1e-4).count();
            count as f32 / depths.len() as f32
        };
        // Of 16384 samples the share's standard deviation is 0.004 at most.
        for (at, expected) in [
            (0.3, near),
            (0.8, far * (1.0 - near)),
            (1.0, (1.0 - far) * (1.0 - near)),
        ] {
            let share = share(at);
            assert!(
                (share - expected).abs() < 0.012,
                "{near} {far}, {at}: {share} {expected}"
            );
        }
    }
}

#[test]
fn what_cannot_be_blended_is_refused() {
    let mesh = panes(&[(0.5, 0.5, 0.5)]);
    let add = |format, blend, of: &dyn Fn(&mut Graph, Surfaces) -> Option<Handle>| {
        let mut graph = Graph::new(hankel_shadows::entries());
        let positions = graph.buffer("positions", &mesh.positions);
        let colours = graph.buffer("colours", &mesh.colours);
        let opacities = graph.buffer("opacities", &mesh.all_opacities());
        let rows = [Vec4::X, Vec4::Y, Vec4::Z, Vec4::W];
        let [row_x, row_y, row_z, row_w] = rows;
        let view = Transform {
            row_x,
            row_y,
            row_z,
            row_w,
        };
        let view = graph.parameter("view", &view);
        let surfaces = Surfaces {
            positions,
            indices: graph.buffer("indices", mesh.indices()),
            clip_from_world: view,
        };
        let before = of(&mut graph, surfaces);
        let mut pass = graph
            .draw("glass", surfaces, "translucent")
            .arg("position", positions)
            .arg("colour", colours)
            .arg("opacity", opacities)
            .arg("view", view)
            .fragment("tint")
            .blend(blend);
        if let Some(before) = before {
            pass = pass.before(before);
        }
        pass.samples([32; 2], format, [0.0; 4])
            .map_err(|e| e.to_string())
    };
    let none = |_: &mut Graph, _: Surfaces| None;
    let refused = |made: Result<Handle, String>, parts: &[&str]| {
        let error = made.unwrap_err();
        assert!(parts.iter().all(|part| error.contains(part)), "{error}");
    };
    assert!(add(TexelFormat::Rgba16Unorm, Blend::Alpha, &none).is_ok());
    assert!(add(TexelFormat::Rgba32Float, Blend::Off, &none).is_ok());
    assert!(add(TexelFormat::Rgba32Float, Blend::Alpha, &none).is_ok());
    let depth = |size: u32| {
        move |graph: &mut Graph, surfaces: Surfaces| {
            let draw = graph
                .draw("depth", surfaces, "light_depth")
                .arg("position", surfaces.positions)
                .arg("light", surfaces.clip_from_world);
            Some(draw.depth([size; 2]).unwrap())
        }
    };
    assert!(add(TexelFormat::Rgba16Unorm, Blend::Additive, &depth(32)).is_ok());
    refused(
        add(TexelFormat::Rgba16Unorm, Blend::Alpha, &depth(16)),
        &["pass `glass`", "`before`", "`depth` is 16x16", "32x32"],
    );
    let single = |graph: &mut Graph, surfaces: Surfaces| {
        let draw = graph
            .draw("depth", surfaces, "light_depth")
            .arg("position", surfaces.positions)
            .arg("light", surfaces.clip_from_world);
        Some(draw.single_depth([32; 2]).unwrap())
    };
    refused(
        add(TexelFormat::Rgba16Unorm, Blend::Second, &none),
        &["pass `glass`", "second source"],
    );
    refused(
        add(TexelFormat::Rgba16Unorm, Blend::Alpha, &single),
        &["pass `glass`", "`before`", "with 1 samples", "with 4"],
    );
    refused(
        add(TexelFormat::Rgba16Unorm, Blend::Off, &depth(32)),
        &["pass `glass`", "`before`", "`blend`"],
    );
    refused(
        add(TexelFormat::Rgba16Unorm, Blend::Alpha, &|_, s| {
            Some(s.positions)
        }),
        &["`before`", "`positions` is a buffer"],
    );
    let mut graph = Graph::new(hankel_shadows::entries());
    let positions = graph.buffer("positions", &mesh.positions);
    let surfaces = Surfaces {
        positions,
        indices: graph.buffer("indices", mesh.indices()),
        clip_from_world: positions,
    };
    let draw = graph
        .draw("depth", surfaces, "light_depth")
        .blend(Blend::Alpha);
    let error = draw.depth([32; 2]).unwrap_err().to_string();
    assert!(error.contains("depth is not blended"), "{error}");
}

/// Each surface counts once, also where a ray passes through the edge between its triangles, and twice where two
/// lie in one place.
#[test]
fn light_passes_the_product_of_what_surfaces_let_pass() {
    let transmittance = |mesh: &Mesh, x: f64, y: f64| {
        let caster = Caster::of_translucent(mesh).unwrap();
        let segment = Segment::new([x, y, -1.0].into(), [0.0, 0.0, 3.0].into());
        caster.transmittance(&segment, &mesh.all_opacities())
    };
    let mesh = panes(&[
        (0.1, 0.0, 0.5),
        (0.5, 0.0, 0.2),
        (0.5, 0.0, 0.2),
        (0.9, 0.0, 0.9),
    ]);
    let expected = 0.5 * 0.8 * 0.8 * 0.1;
    // The panes' diagonals go through places with x = y.
    for (x, y) in [
        (0.3, -0.2),
        (0.25, 0.25),
        (-1.0, -1.0),
        (0.0, 0.0),
        (1.7, 1.7),
    ] {
        let passes = transmittance(&mesh, x, y);
        assert!((passes - expected).abs() < 1e-6, "{x} {y}: {passes}");
    }
    assert_eq!(transmittance(&mesh, 2.5, 0.0), 1.0);
    // A ball, through its poles and anywhere.
    let mut ball = Mesh::default();
    ball.sphere(Vec3::new(0.0, 0.0, 0.5), 0.4, 16);
    ball.fade(0.3);
    for (x, y) in [(0.0, 0.0), (0.1, 0.2), (0.0, 0.2), (-0.05, 0.0)] {
        assert!((transmittance(&ball, x, y) - 0.49).abs() < 1e-6, "{x} {y}");
    }
}

fn scene(shadow: &str) -> (Scene, Mesh) {
    scene_of(512, 5, shadow)
}

fn scene_of(size: u32, filter: u32, shadow: &str) -> (Scene, Mesh) {
    let text = format!(
        "[geometry]\nprocedural = 'glass'\n[camera]\neye = [4.4, 3.4, 5.6]\ntarget = [-0.1, 0.7, 0.4]\n\
         [light]\ndirection = [-0.45, -0.8, 0.3]\n[shadow]\nsize = {size}\nfilter = {filter}\n{shadow}\n\
         [output]\nwidth = 160\nheight = 90\n"
    );
    let scene = Scene::parse(&text, Path::new("test.toml")).unwrap_or_else(|e| panic!("{e}"));
    let mesh = scene.mesh().unwrap_or_else(|e| panic!("{e}"));
    (scene, mesh)
}

fn light(scene: &Scene, mesh: &Mesh) -> Arriving {
    by_technique(scene, mesh).unwrap_or_else(|e| panic!("{e}"))
}

/// Against rays: root of the mean square error. What techniques reach is measured, with a tenth on top.
/// `pcf-gaussian` shows opaque casters only.
#[test]
fn shadows_of_glass_are_near_the_rays() {
    let (base, mesh) = scene("");
    let truth = by_rays(&base, &mesh, &mut |_| ());
    let share = |low: f32, high: f32| {
        let within = truth
            .values
            .iter()
            .filter(|v| (low..high).contains(v))
            .count();
        within as f64 / truth.values.len() as f64
    };
    // The picture holds what is to be told apart: shadow, shadows of glass, light.
    assert!(share(0.0, 0.02) > 0.02, "{}", share(0.0, 0.02));
    assert!(share(0.1, 0.9) > 0.05, "{}", share(0.1, 0.9));
    assert!(share(0.98, 1.1) > 0.4, "{}", share(0.98, 1.1));
    for (technique, more, limit) in [
        ("hamburger", "", 0.070),
        ("hamburger", "format = 'rgba32float'", 0.070),
        ("hamburger-6", "", 0.070),
        ("hamburger-6", "format = 'rgba32float'", 0.070),
        ("hamburger-6", "format = 'r32uint'", 0.070),
        ("hamburger-6", "format = 'rg32uint'", 0.070),
        ("moments-4", "", 0.070),
        ("moments-6", "", 0.070),
        ("hausdorff", "", 0.072),
        ("vsm", "", 0.092),
        ("pcf", "", 0.0415),
        ("pcf-gaussian", "", 0.171),
    ] {
        for samples in [4, 1] {
            let (scene, mesh) = scene(&format!(
                "technique = '{technique}'\nmultisampling = {samples}\n{more}"
            ));
            let errors = light(&scene, &mesh).errors(&truth).unwrap();
            println!("{technique} {more:?}, {samples}: {errors}");
            assert!(
                errors.rms < limit,
                "{technique} {more:?}, {samples}: {errors}"
            );
        }
    }
}

/// How much darker a picture is than another, at its worst pixel.
fn darker(picture: &Arriving, truth: &Arriving) -> f32 {
    let pairs = picture.values.iter().zip(&truth.values);
    pairs.map(|(a, b)| b - a).fold(0.0, f32::max)
}

/// Also of glass, moments give lower bounds: nowhere darker than the same filter over lists of all surfaces in
/// each sample, but for the bias, which may be all shadow, and what rounding does to the bound.
#[test]
fn blended_moments_are_nowhere_darker_than_all_surfaces_filtered() {
    for (technique, map) in [
        ("hamburger", "rgba16unorm' depth_range='symmetric"),
        ("hamburger", "rgba16unorm' depth_range='unit"),
        ("hamburger", "rgba32float"),
        ("hausdorff", "rgba16unorm' depth_range='symmetric"),
        ("hausdorff", "rgba16unorm' depth_range='unit"),
        ("hausdorff", "rgba32float"),
        ("vsm", "rg16unorm' depth_range='symmetric"),
        ("vsm", "rg16unorm' depth_range='unit"),
        ("vsm", "rg32float"),
        ("hamburger-6", "rgba16unorm"),
        ("hamburger-6", "rgba32float"),
        ("hamburger-6", "r32uint"),
        ("hamburger-6", "rg32uint"),
        ("moments-4", "rgba32float"),
        ("moments-6", "rgba32float"),
    ] {
        let map = map.replace(' ', "\n");
        for samples in [4, 1] {
            let (scene, mesh) = scene(&format!(
                "technique = '{technique}'\nformat = '{map}'\nmultisampling = {samples}\nleak_cut = 0.0"
            ));
            let truth = filtered(&scene, &mesh, &mut |_| ());
            let by = darker(&light(&scene, &mesh), &truth);
            println!("{technique}, {map:?}, {samples}: darker by {by}");
            assert!(
                by < scene.shadow.moment_bias + 1e-5,
                "{technique}, {map:?}, {samples}: darker by {by}"
            );
        }
    }
}

/// Percentage-closer filtering by chance is off from the rays to both sides alike, but for what its filter makes
/// of edges, which an opaque shadow has as well.
#[test]
fn chance_is_not_biased() {
    let (scene, mesh) = scene_of(1024, 9, "technique = 'pcf'\ndepth_bias = 0.01");
    let truth = by_rays(&scene, &mesh, &mut |_| ());
    let picture = light(&scene, &mesh);
    // Pixels in shadow of one pane, two or three of them, away from edges.
    let pairs = picture.values.iter().zip(&truth.values);
    for expected in [0.65_f32, 0.45, 0.7, 0.65 * 0.45, 0.65 * 0.45 * 0.7] {
        let off: Vec<f64> = pairs
            .clone()
            .filter(|(_, truth)| (**truth - expected).abs() < 1e-4)
            .map(|(light, truth)| f64::from(*light) - f64::from(*truth))
            .collect();
        let n = off.len() as f64;
        let mean = off.iter().sum::<f64>() / n.max(1.0);
        let spread = (off.iter().map(|x| x * x).sum::<f64>() / n.max(1.0)).sqrt();
        println!("{expected}: {n} pixels, mean {mean:.5}, spread {spread:.5}");
        assert!(n == 0.0 || mean.abs() < 0.02, "{expected}: {n}, {mean}");
    }
}

/// Both devices draw the same picture of glass, but for edges; and after the light has turned, the same as a
/// frame that was made for that light.
#[test]
fn devices_agree_and_the_order_follows_the_light() {
    let shaders = common::shaders();
    let mut device = open(Backend::Vulkan).unwrap_or_else(|e| panic!("{e}"));
    for shadow in [
        "technique = 'hamburger'",
        "technique = 'hamburger'\nmultisampling = 1",
        "technique = 'hamburger-6'\nmultisampling = 1",
        "technique = 'pcf'\nmultisampling = 1",
    ] {
        let (scene, mesh) = scene_of(256, 5, shadow);
        let native = light(&scene, &mesh);
        let vulkan =
            hankel_frames::truth::by_technique_on(&mut *device, &shaders, &scene, &mesh).unwrap();
        let errors = native.errors(&vulkan).unwrap();
        println!("devices, {shadow:?}: {errors}");
        assert!(
            errors.rms < 0.01 && errors.percentile_99 < 0.02,
            "{shadow}: {errors}"
        );
    }

    let (scene, mesh) = scene_of(256, 5, "technique = 'hamburger'");
    let turned = Light::directional(Vec3::new(0.5, 0.6, -0.3));
    let mut device = NativeDevice::new();
    let mut frame = Frame::new(&mut device, &NoShaders, &scene, &mesh, Show::Light).unwrap();
    frame.run(Clock::Frame, &mut Quiet).unwrap();
    frame.set_light(0, &turned).unwrap();
    frame.run(Clock::Frame, &mut Quiet).unwrap();
    let moved = frame.linear().unwrap();
    drop(frame);
    let made_for = Scene {
        lights: vec![turned],
        ..scene
    };
    let mut frame = Frame::new(&mut device, &NoShaders, &made_for, &mesh, Show::Light).unwrap();
    frame.run(Clock::Frame, &mut Quiet).unwrap();
    assert_eq!(moved, frame.linear().unwrap());
}

/// Blending is left out without translucent casters, and techniques say so when they cannot show them.
#[test]
fn what_is_left_out_is_said() {
    let omitted = |scene: &Scene, mesh: &Mesh| -> Vec<(String, String)> {
        let (graph, ..) = graph_of(scene, mesh, Show::Picture).unwrap();
        let omitted = graph.omitted().iter();
        omitted
            .map(|o| (o.what.to_string(), o.why.to_string()))
            .collect()
    };
    let passes = |scene: &Scene, mesh: &Mesh| {
        let (graph, ..) = graph_of(scene, mesh, Show::Picture).unwrap();
        graph.summary().passes.len()
    };
    let (of_glass, glass) = scene("technique = 'hamburger'");
    let mut opaque = glass.clone();
    opaque.opacities.clear();
    assert!(
        omitted(&of_glass, &opaque)
            .contains(&("blending".into(), "no caster is translucent".into()))
    );
    assert!(
        omitted(&of_glass, &glass)
            .iter()
            .all(|(what, _)| what != "blending" && what != TRANSLUCENT)
    );
    // Two draws into the map; depth, tint and what is seen through it.
    assert_eq!(passes(&of_glass, &glass), passes(&of_glass, &opaque) + 5);
    for (technique, shows) in [
        ("pcf", true),
        ("hamburger-6", true),
        ("moments-4", true),
        ("moments-6-compensated", true),
        ("esm", false),
        ("convolution", false),
        ("moments-8", false),
        ("pcf-gaussian", false),
    ] {
        let (scene, mesh) = scene(&format!("technique = '{technique}'"));
        let is_blind = omitted(&scene, &mesh)
            .iter()
            .any(|(what, _)| what == TRANSLUCENT);
        assert_eq!(is_blind, !shows, "{technique}");
    }
}

#[test]
fn a_plan_says_which_methods_cannot_show_glass() {
    let (mut scene, mesh) = scene("");
    (scene.width, scene.height) = (48, 27);
    let choices = Choices {
        techniques: ["esm", "hamburger"]
            .map(|name| Technique::named(name).unwrap())
            .into(),
        sizes: vec![128],
        filters: vec![1],
        fits: vec![Fit::Scene],
        ..Choices::default()
    };
    let wanted = Wanted {
        error: 0.5,
        seconds: None,
        bytes: None,
    };
    let mut device = NativeDevice::new();
    let found = plan(
        &mut device,
        &NoShaders,
        &scene,
        &mesh,
        &choices,
        wanted,
        &mut Quiet,
    )
    .unwrap();
    let plan = found.unwrap_or_else(|impossible| panic!("{impossible}"));
    assert!(plan.choice.starts_with("hamburger "), "{plan}");
    let text = plan.to_string();
    // This one holds all of the scene, and a fitted one is compared with it in words.
    let words = "a texel of the fitted map has";
    assert!(
        text.contains(words) && text.contains("% of the area"),
        "{text}"
    );
    assert!(
        text.contains(&format!("not esm: no {TRANSLUCENT}")),
        "{text}"
    );
    assert!(
        !text.contains("not hamburger rgba32float: no") && text.contains("alpha blending"),
        "{text}"
    );
}

#[test]
fn opacities_of_scenes_are_checked() {
    let parse = |geometry: &str| {
        let text = format!(
            "[geometry]\n{geometry}\n[camera]\neye = [2, 6, 4]\ntarget = [0, 0, 0]\n\
             [light]\ndirection = [1, -1, 0.4]\n"
        );
        Scene::parse(&text, Path::new("glass.toml")).map_err(|e| e.to_string())
    };
    let model = "model = '../models/brain.glb'";
    for (geometry, parts) in [
        (
            "opacity = 1.5\nground = 2",
            [
                "glass.toml:3:11",
                "`geometry.opacity` is 1.5",
                "from 0 to 1",
            ],
        ),
        (
            "opacity = nan\nground = 2",
            [
                "glass.toml:3:11",
                "`geometry.opacity` is NaN",
                "from 0 to 1",
            ],
        ),
        (
            "opacity = 0.5",
            ["glass.toml:3:11", "`geometry.opacity` is 0.5", "`ground`"],
        ),
    ] {
        let error = parse(&format!("{model}\n{geometry}")).unwrap_err();
        assert!(parts.iter().all(|part| error.contains(part)), "{error}");
    }
    let error = parse("procedural = 'glass'\nopacity = 0.5").unwrap_err();
    assert!(
        error.contains("`geometry.opacity`") && error.contains("its own"),
        "{error}"
    );
    assert!(parse(&format!("{model}\nopacity = 0.4\nground = 2")).is_ok());
}
