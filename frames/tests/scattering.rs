//! What a medium scatters: techniques against rays, and what a medium does to a frame.

use std::f64::consts::PI;
use std::path::Path;

use hankel_dsl::glam::{DVec3, Vec3};
use hankel_frames::measure::{Ask, Choices, Pictures, Session, Subject};
use hankel_frames::passes::{TRANSLUCENT, TRANSLUCENT_IN_MEDIUM};
use hankel_frames::plan::{Wanted, plan};
use hankel_frames::scattering::{self, Scattering};
use hankel_frames::scene::{CameraView, Fit, Light, Mesh, Scene, Source};
use hankel_frames::techniques::Technique;
use hankel_frames::truth::scattering::{Scattered, Through, compare, transmittance};
use hankel_frames::truth::{Arriving, by_technique, scattered_by_technique};
use hankel_frames::visibility::cast::{Caster, Lens};
use hankel_frames::{Clock, Frame, NoShaders, Quiet, Show, graph_of, render_on};
use hankel_host::device::NativeDevice;

fn parsed(text: &str) -> (Scene, Mesh) {
    let scene = Scene::parse(text, Path::new("test.toml")).unwrap_or_else(|e| panic!("{e}"));
    let mesh = scene.mesh().unwrap_or_else(|e| panic!("{e}"));
    (scene, mesh)
}

/// A file of `scenes/`, in a small picture.
fn file(name: &str, size: u32) -> (Scene, Mesh) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("../scenes/{name}.toml"));
    let mut scene = Scene::read(&path).unwrap_or_else(|e| panic!("{e}"));
    (scene.width, scene.height) = (96, 54);
    scene.shadow.size = size;
    let mesh = scene.mesh().unwrap_or_else(|e| panic!("{e}"));
    (scene, mesh)
}

fn by(scene: &Scene, mesh: &Mesh, technique: &str, steps: u32) -> Arriving {
    let mut scene = scene.clone();
    let medium = scene.medium.as_mut().unwrap();
    medium.technique = Scattering::named(technique).unwrap();
    medium.steps = steps;
    scattered_by_technique(&scene, mesh).unwrap_or_else(|e| panic!("{e}"))
}

/// An open field under an empty sky, which nothing shades.
fn open(camera: &str, medium: &str) -> (Scene, Mesh) {
    parsed(&format!(
        "[geometry]\nprocedural = 'empty'\n[camera]\n{camera}\n[light]\ndirection = [0.3, -1.0, 0.2]\n\
         [medium]\n{medium}\n[shadow]\nsize = 128\n[output]\nwidth = 48\nheight = 30\n"
    ))
}

/// What a medium without shadow scatters is 1 - exp(-σ d) for rays of length d: by every technique, and by rays.
#[test]
fn a_medium_in_light_alone_has_its_analytic_picture() {
    for camera in [
        "eye = [1.0, 2.0, 6.0]\ntarget = [0, 0.5, 0]",
        // With the light, so that azimuths go all around.
        "eye = [-0.6, 4.0, -0.4]\ntarget = [0.6, 0.0, 0.4]",
    ] {
        let (scene, mesh) = open(camera, "extinction = 0.2");
        let mut truth = Scattered::new(&scene, &mesh).unwrap();
        let picture = truth.picture();
        assert!(truth.refine(&mut |_| ()).unwrap() < 1e-3);
        assert!(picture.values.iter().all(|v| *v > 0.3 && *v < 0.99));
        for technique in scattering::ALL {
            let name = technique.name;
            let errors = by(&scene, &mesh, name, 16).errors(&picture).unwrap();
            println!("{camera:?}, {name}: {errors}");
            // One ray stands for a pixel's samples: as far as the farthest of them it is below the ground. Moments
            // do not tell the ground before a ray's end from what would shade the ray.
            let limit = if name == "ray-marching" { 0.009 } else { 0.02 };
            assert!(errors.rms < limit, "{name}: {errors}");
        }
    }
}

/// What a picture's medium adds, in its first channel, where nothing casts a shadow: without the light from the sky,
/// and without what a light sends to surfaces, as that passes the medium. And by how much that may be rounded: pictures
/// are kept in 16-bit floats, of 11 bits.
fn added(scene: &Scene, mesh: &Mesh) -> Vec<[f64; 2]> {
    let drawn = |with: &dyn Fn(&mut Scene)| {
        let mut scene = scene.clone();
        with(&mut scene);
        let mut device = NativeDevice::new();
        let mut frame = Frame::still(&mut device, &NoShaders, &scene, mesh, Show::Picture).unwrap();
        frame.run(Clock::Frame, &mut Quiet).unwrap();
        frame.linear().unwrap()
    };
    let dark = |scene: &mut Scene| scene.lights[0].strength = 0.0;
    let clear = |scene: &mut Scene| scene.medium = None;
    let (all, without) = (drawn(&|_| ()), drawn(&dark));
    let (surfaces, ambient) = (
        drawn(&clear),
        drawn(&|scene| {
            dark(scene);
            clear(scene);
        }),
    );
    let through = transmittance(scene, mesh).values;
    let of = |i: usize| {
        let through = f64::from(through[i]);
        let [all, without, surfaces, ambient] =
            [&all, &without, &surfaces, &ambient].map(|picture| f64::from(picture[i].x));
        [
            all - without - through * (surfaces - ambient),
            (all + without + through * (surfaces + ambient)) / 2048.0,
        ]
    };
    (0..all.len()).map(of).collect()
}

/// The phase function of Henyey and Greenstein.
fn phase(g: f64, cosine: f64) -> f64 {
    (1.0 - g * g) / (4.0 * PI * (1.0 + g * g - 2.0 * g * cosine).powf(1.5))
}

/// The camera, and the segment that a pixel's middle sees, as long as it sees: to the far plane at most.
fn rays(scene: &Scene, mesh: &Mesh) -> (DVec3, impl Fn(usize) -> DVec3 + use<>) {
    let width = scene.width;
    let aspect = width as f32 / scene.height as f32;
    let view = CameraView::new(&scene.camera, mesh, aspect);
    let lens = Lens::new(view.clip_from_world, width, scene.height);
    let caster = Caster::of(mesh);
    let eye = scene.camera.eye.as_dvec3();
    let end = move |i: usize| {
        let segment = lens.segment([i as u32 % width, i as u32 / width], [0.5, 0.5]);
        let t = caster.first(&segment).map_or(1.0, |hit| hit.t);
        segment.at(t) - eye
    };
    (eye, end)
}

/// Pixels without an edge between what they see.
fn even(taken: &[f32], width: usize, i: usize) -> bool {
    let inner = (width..taken.len() - width).contains(&i) && (1..width - 1).contains(&(i % width));
    inner
        && [i - 1, i + 1, i - width, i + width]
            .iter()
            .all(|&j| (taken[j] - taken[i]).abs() < 0.05)
}

/// What is scattered by an angle θ is told by the phase function: forward scattering is seen against the light.
#[test]
fn a_picture_has_the_phase_function_of_its_medium() {
    for (camera, g) in [
        ("eye = [-1.0, 0.6, -6.0]\ntarget = [0.3, 1.0, 0]", 0.6),
        ("eye = [-1.0, 0.6, -6.0]\ntarget = [0.3, 1.0, 0]", -0.4),
        ("eye = [1.0, 0.6, 6.0]\ntarget = [0, 0.9, 0]", 0.6),
    ] {
        let medium = format!("extinction = 0.2\nscattering = 0.15\nanisotropy = {g:?}");
        let (mut scene, mesh) = open(camera, &medium);
        let direction = DVec3::new(0.1, -0.5, -1.0).normalize();
        scene.lights[0].source = Source::Directional {
            direction: direction.as_vec3(),
        };
        let taken = Scattered::new(&scene, &mesh).unwrap().unshadowed().values;
        let (_, end) = rays(&scene, &mesh);
        for technique in scattering::ALL {
            scene.medium.as_mut().unwrap().technique = technique;
            let mut compared = 0;
            // Moments do not tell the ground before a ray's end from what would shade the ray.
            let limit = if technique.has_steps { 0.03 } else { 0.1 };
            for (i, [added, rounded]) in added(&scene, &mesh).into_iter().enumerate() {
                if !even(&taken, scene.width as usize, i) {
                    continue;
                }
                let cosine = -direction.dot(end(i).normalize());
                let wanted = 1.15 * PI * 0.75 * phase(g, cosine) * f64::from(taken[i]);
                assert!(
                    (added - wanted).abs() < limit * wanted + rounded,
                    "{technique:?}, {i}: {added} {wanted}"
                );
                compared += 1;
            }
            assert!(compared > 700, "{technique:?}: {compared}");
        }
    }
}

/// A spot light without casters: the picture is the integral over each ray of intensity over squared distance, cone,
/// phase function and transmittance.
#[test]
fn a_spot_light_in_a_medium_has_its_analytic_picture() {
    let light = "[light]\nposition = [0.4, 2.2, -0.5]\ndirection = [0.2, -1.0, 0.3]\nangle = 70.0\n\
                 inner = 40.0\nstrength = 60.0\n";
    let medium = "[medium]\nextinction = 0.3\nscattering = 0.2\nanisotropy = 0.4\nsteps = 64\n";
    for camera in [
        // The light itself is in view.
        "eye = [1.0, 1.8, 6.0]\ntarget = [0.2, 1.2, 0]",
        // From within the cone, along it.
        "eye = [0.42, 1.6, -0.4]\ntarget = [0.6, 0.0, 0.4]",
        // From within the cone, back to the light.
        "eye = [0.7, 0.4, 0.3]\ntarget = [0.42, 1.9, -0.45]",
    ] {
        let (scene, mesh) = parsed(&format!(
            "[geometry]\nprocedural = 'empty'\n[camera]\n{camera}\n{light}{medium}[shadow]\nsize = 128\n\
             [output]\nwidth = 48\nheight = 30\n"
        ));
        assert_eq!(scene.medium.unwrap().technique.name, "ray-marching");
        let spot = *scene.lights[0].spot().unwrap();
        let taken = Scattered::new(&scene, &mesh).unwrap().unshadowed().values;
        let (eye, end) = rays(&scene, &mesh);
        let position = spot.position.as_dvec3();
        // What is added along a unit of a ray's length.
        let density = |way: DVec3, s: f64| {
            let toward = position - (eye + way * s);
            let distance = toward.length();
            let cosine = -toward.dot(spot.direction.as_dvec3()) / distance;
            let edge = |degrees: f64| degrees.to_radians().cos();
            let fade = ((cosine - edge(35.0)) / (edge(20.0) - edge(35.0))).clamp(0.0, 1.0);
            let irradiance = 60.0 * 1.15 * fade * fade / (distance * distance);
            let scattered = 0.2 * phase(0.4, toward.dot(way) / distance) * irradiance;
            PI * scattered * (-0.3 * s).exp()
        };
        let integral = |way: DVec3| -> f64 {
            const STEPS: u32 = 20_000;
            let (length, way) = (way.length(), way.normalize());
            let step = length / f64::from(STEPS);
            let places = (0..STEPS).map(|k| (f64::from(k) + 0.5) * step);
            places.map(|s| density(way, s) * step).sum()
        };
        let (mut lit, mut compared, mut largest) = (0, 0, 0.0_f64);
        for (i, [added, rounded]) in added(&scene, &mesh).into_iter().enumerate() {
            if !even(&taken, scene.width as usize, i) {
                continue;
            }
            let (wanted, length) = (integral(end(i)), end(i).length());
            let off = (added - wanted).abs();
            // One ray stands for a pixel's samples: as far as the farthest of them it is below the ground.
            let width = scene.width as usize;
            let longer = [i - width, i + width].map(|j| (end(j).length() - length).abs() / 2.0);
            let below = density(end(i).normalize(), length) * longer[0].max(longer[1]);
            compared += 1;
            if wanted > 20.0 * rounded {
                lit += 1;
                largest = largest.max(off / wanted);
            }
            assert!(
                off < 0.02 * wanted + rounded + below,
                "{camera}, {i}: {added} {wanted}"
            );
        }
        println!("{camera:?}: at most {largest:.4} off, {lit} of {compared} pixels lit");
        assert!(lit > 200 && compared > 900, "{camera}");
    }
}

/// What of a spot light's cone is in shadow is near the rays. What is reached is measured, with a tenth on top.
#[test]
fn a_spot_light_scatters_near_the_rays() {
    let (scene, mesh) = file("lantern", 512);
    let pictures = [8, 32, 128].map(|steps| by(&scene, &mesh, "ray-marching", steps));
    let all: Vec<&Arriving> = pictures.iter().collect();
    let (compared, truth) = compare(&scene, &mesh, &all, &mut |_| ()).unwrap().unwrap();
    let most = truth.values.iter().copied().fold(0.0, f32::max);
    println!(
        "lantern: {} steps of the truth, {most} at most",
        compared.steps
    );
    let errors = compared.errors;
    for ((errors, steps), limit) in errors
        .iter()
        .zip([8, 32, 128])
        .zip([0.0205, 0.0054, 0.0024])
    {
        println!("lantern, {steps} steps: {errors}");
        assert!(errors.rms < limit, "{steps}: {errors}");
    }
    assert!(errors.is_sorted_by(|a, b| a.rms > b.rms) && most > 0.2);
}

/// Root of the mean square error of each technique. What they reach is measured, with a tenth on top.
#[test]
fn scattered_light_is_near_the_rays() {
    for (name, limits) in [
        ("shafts", [0.0082, 0.0030, 0.0019, 0.0132, 0.0091]),
        ("mist", [0.0180, 0.0110, 0.0091, 0.0328, 0.0201]),
    ] {
        let (scene, mesh) = file(name, 512);
        let ways = [
            ("ray-marching", 8),
            ("ray-marching", 32),
            ("ray-marching", 128),
            ("prefiltered", 1),
            ("prefiltered-6", 1),
        ];
        let pictures = ways.map(|(technique, steps)| by(&scene, &mesh, technique, steps));
        let all: Vec<&Arriving> = pictures.iter().collect();
        let (compared, truth) = compare(&scene, &mesh, &all, &mut |_| ()).unwrap().unwrap();
        let least = compared.errors.iter().map(|e| e.rms).fold(1.0, f64::min);
        println!(
            "{name}: {} steps of the truth, the last doubling changed it by {:.5}",
            compared.steps, compared.change
        );
        assert!(compared.change <= 0.1 * least);
        let unshadowed = Scattered::new(&scene, &mesh).unwrap().unshadowed();
        println!(
            "{name}, without shadow: {}",
            unshadowed.errors(&truth).unwrap()
        );
        for (((technique, steps), errors), limit) in ways.iter().zip(&compared.errors).zip(limits) {
            println!("{name}, {technique}, {steps} steps: {errors}");
            assert!(errors.rms < limit, "{name}, {technique}, {steps}: {errors}");
        }
        // More steps bring marching nearer to the truth.
        let marched = &compared.errors[..3];
        assert!(marched.is_sorted_by(|a, b| a.rms > b.rms), "{name}");
    }
}

/// A pane of glass over the ground, with light straight through it.
fn under_glass(shadow: &str, medium: &str) -> (Scene, Mesh) {
    let (scene, mut mesh) = parsed(&format!(
        "[geometry]\nprocedural = 'empty'\n[camera]\neye = [9.0, 1.5, 0.0]\ntarget = [0.0, 1.2, 0.0]\nfov = 50.0\n\
         [light]\ndirection = [0.05, -1.0, 0.0]\n[medium]\nextinction = 0.15\n{medium}\n\
         [shadow]\nsize = 128\nfilter = 3\n{shadow}\n[output]\nwidth = 40\nheight = 22\n"
    ));
    mesh.fade(1.0);
    let corners = [[-2.5, 2.5], [2.5, 2.5], [2.5, -2.5], [-2.5, -2.5]];
    mesh.quad(corners.map(|[x, z]| Vec3::new(x, 3.0, z)));
    mesh.paint(Vec3::ONE);
    mesh.fade(0.8);
    (scene, mesh)
}

/// Translucent casters shade a medium by their opacity, where what they are looked up in holds them, whatever the
/// technique of the surfaces' shadows is.
#[test]
fn glass_shades_a_medium() {
    for shadow in [
        "technique = 'hamburger'",
        "technique = 'hamburger'\nformat = 'rgba32float'",
        "technique = 'pcf'",
    ] {
        let (scene, mesh) = under_glass(shadow, "");
        let mut without = mesh.clone();
        without.triangles.truncate(2);
        for technique in ["prefiltered", "prefiltered-6"] {
            let [glass, none] = [&mesh, &without].map(|mesh| by(&scene, mesh, technique, 1));
            let (compared, _) = compare(&scene, &mesh, &[&glass, &none], &mut |_| ())
                .unwrap()
                .unwrap();
            let [errors, unshaded] = [compared.errors[0], compared.errors[1]];
            println!("{shadow:?}, {technique}: {errors}; without glass {unshaded}");
            // It is a little too dark without any caster, too.
            let lit = [errors, unshaded].map(|e| e.wrongly_lit);
            assert!(lit[0] < 0.2 * lit[1], "{technique}: {errors}; {unshaded}");
            assert!(
                errors.rms < 0.6 * unshaded.rms,
                "{technique}: {errors}; {unshaded}"
            );
        }
    }
}

/// A map that surfaces have is not made again for the medium; what a technique cannot show is said.
#[test]
fn glass_in_a_medium_is_made_once_and_what_is_left_out_is_said() {
    let told = |shadow: &str, medium: &str| {
        let (scene, mesh) = under_glass(shadow, medium);
        let (graph, ..) = graph_of(&scene, &mesh, Show::Picture).unwrap();
        let omitted = graph.omitted().iter().map(|o| o.what.to_string());
        let passes = graph.passes().iter().map(|pass| pass.label.to_string());
        (passes.collect::<Vec<_>>(), omitted.collect::<Vec<_>>())
    };
    let count = |passes: &[String], label: &str| passes.iter().filter(|p| *p == label).count();
    for technique in ["prefiltered", "prefiltered-6"] {
        let medium = format!("technique = '{technique}'");
        for (shadow, resolves, halves) in [
            ("technique = 'hamburger'", 1, 1),
            ("technique = 'hausdorff'", 1, 1),
            // Two moments; another format; and one whose surfaces have no map.
            ("technique = 'vsm'", 2, 1),
            ("technique = 'hamburger'\nformat = 'rgba32float'", 2, 2),
            ("technique = 'pcf'", 1, 1),
        ] {
            let (passes, omitted) = told(shadow, &medium);
            assert_eq!(count(&passes, "resolve"), resolves, "{shadow}: {passes:?}");
            assert_eq!(
                count(&passes, "blur rows"),
                resolves,
                "{shadow}: {passes:?}"
            );
            assert_eq!(
                count(&passes, "blend first half"),
                halves,
                "{shadow}: {passes:?}"
            );
            let is_left_out = |what: &String| what.starts_with(TRANSLUCENT);
            assert!(!omitted.iter().any(is_left_out), "{shadow}: {omitted:?}");
        }
    }
    let (_, omitted) = told("technique = 'hamburger'", "technique = 'ray-marching'");
    assert!(
        omitted.contains(&TRANSLUCENT_IN_MEDIUM.into()),
        "{omitted:?}"
    );
    assert!(!omitted.contains(&TRANSLUCENT.into()), "{omitted:?}");
    // Of surfaces it is said as without a medium.
    let (_, omitted) = told("technique = 'esm'", "technique = 'prefiltered'");
    assert!(omitted.contains(&TRANSLUCENT.into()), "{omitted:?}");
}

fn small(steps: &[u32]) -> Choices {
    Choices {
        techniques: ["pcf", "hamburger"]
            .map(|name| Technique::named(name).unwrap())
            .into(),
        sizes: vec![64, 128],
        filters: vec![3],
        fits: vec![Fit::Scene],
        steps: steps.into(),
        ..Choices::default()
    }
}

/// What comes through a medium and what that scatters are all of the light where nothing casts a shadow.
#[test]
fn nothing_is_lost_in_light_alone() {
    let (scene, mesh) = open(
        "eye = [1.0, 2.0, 6.0]
target = [0, 0.5, 0]",
        "extinction = 0.2",
    );
    let truth = Through::new(&scene, &mesh, 1e-3).unwrap();
    for pixel in [0, 31, 700, 48 * 30 - 1] {
        let (seen, surfaces) = (truth.pixel(pixel), truth.surfaces(pixel));
        // 16 rays for the medium, 256 for surfaces: their means differ where a pixel's rays differ in length.
        assert!((seen - 1.0).abs() < 5e-3, "{pixel}: {seen}");
        assert!(surfaces > 0.01 && surfaces < 0.8, "{pixel}: {surfaces}");
    }
    let mut device = NativeDevice::new();
    let mut pictures = Pictures::default();
    // Coarse depths without a filter shade the ground itself.
    let all = Choices {
        techniques: vec![Technique::named("hamburger").unwrap()],
        sizes: vec![128],
        ..small(&[16])
    };
    for c in all.configurations().iter().filter(|c| c.suits(&scene)) {
        let light = pictures.light(&mut device, &NoShaders, &scene, &mesh, c);
        let light = light.unwrap();
        let off = light.values.iter().map(|v| (f64::from(*v) - 1.0).powi(2));
        let rms = (off.sum::<f64>() / light.values.len() as f64).sqrt();
        println!("{c}: {rms:.4}");
        assert!(rms < 0.03, "{c}: {rms}");
    }
}

/// The two truths of what is scattered are one.
#[test]
fn pixels_scatter_what_the_whole_picture_does() {
    let (scene, mesh) = file("shafts", 64);
    let whole = Scattered::new(&scene, &mesh).unwrap();
    let picture = whole.picture();
    // With the steps that the picture begins with.
    let through = Through::new(&scene, &mesh, 1.0).unwrap();
    assert_eq!(through.steps(), 2 * whole.steps());
    let off = (0..scene.width * scene.height).step_by(37).map(|i| {
        let off = through.scattered(i) - f64::from(picture.values[i as usize]);
        off * off
    });
    let off: Vec<f64> = off.collect();
    let rms = (off.iter().sum::<f64>() / off.len() as f64).sqrt();
    assert!(rms < 0.004, "{rms}");
}

/// A plan chooses among techniques of scattering, too, and says why it leaves the others out; what it predicts is
/// what a session measures.
#[test]
fn a_plan_chooses_how_a_medium_scatters() {
    let (mut scene, mesh) = file("shafts", 64);
    (scene.width, scene.height) = (48, 27);
    let choices = small(&[2, 16]);
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("measured.jsonl");
    let subject = Subject {
        name: "shafts".into(),
        scene: scene.clone(),
        mesh: mesh.clone(),
    };
    let ask = Ask {
        configurations: choices.configurations(),
        rounds: 1,
    };
    let mut device = NativeDevice::new();
    let mut session = Session::open(&file, &[]).unwrap();
    let all = session
        .measure(&mut device, &NoShaders, &subject, &ask, &mut |_| ())
        .unwrap();
    // Two sizes; the map of `pcf` and three of `hamburger`, each with four samples and with one; four ways to scatter.
    assert_eq!(all.len(), 2 * (1 + 3) * 2 * 4);
    let scattered = |way: &str| {
        let is_it = |m: &&hankel_frames::measure::Measurement| {
            m.configuration.size == 128
                && m.configuration
                    .scattering
                    .is_some_and(|s| s.to_string() == way)
        };
        all.iter().find(is_it).unwrap().scattered.unwrap().rms
    };
    assert!(scattered("ray-marching, 16 steps") < scattered("ray-marching, 2 steps"));
    assert!(scattered("prefiltered-6") < 0.05);
    let mut errors: Vec<f64> = all.iter().map(|m| m.errors.rms).collect();
    errors.sort_by(f64::total_cmp);
    let wanted = Wanted {
        error: errors[errors.len() / 3],
        seconds: None,
        bytes: None,
    };
    let found = plan(
        &mut device,
        &NoShaders,
        &scene,
        &mesh,
        &choices,
        wanted,
        &mut Quiet,
    );
    let plan = found.unwrap().unwrap_or_else(|none| panic!("{none}"));
    let chosen = all.iter().find(|m| m.configuration == plan.configuration);
    let chosen = chosen.unwrap();
    assert!(chosen.errors.rms <= wanted.error * 1.02, "{plan}");
    assert!(
        (chosen.errors.rms - plan.error.rms).abs() < 0.05 * wanted.error,
        "{plan}"
    );
    assert_eq!(plan.considered, all.len());
    let medium = plan.scene.medium.unwrap();
    let scattering = plan.configuration.scattering.unwrap();
    assert_eq!(
        (medium.technique, medium.steps),
        (scattering.technique, scattering.steps)
    );
    let text = plan.to_string();
    for way in choices.scattered() {
        let named = format!("not scattering by {way}");
        assert!(text.contains(&named), "{named}: {text}");
    }
}

/// A surface's light is weakened by what the medium takes, and nothing is added where nothing is scattered.
#[test]
fn what_is_seen_is_weakened_by_the_way() {
    let camera = "eye = [1.0, 2.0, 6.0]\ntarget = [0, 0.5, 0]";
    let linear = |text: &str| {
        let (mut scene, mesh) = open(camera, text);
        if text.is_empty() {
            scene.medium = None;
        }
        let mut device = NativeDevice::new();
        let mut frame = Frame::new(&mut device, &NoShaders, &scene, &mesh, Show::Picture).unwrap();
        frame.run(Clock::Frame, &mut Quiet).unwrap();
        frame.linear().unwrap()
    };
    let absorbing = "extinction = 0.2\nscattering = 0.0";
    let (weak, strong) = (linear(absorbing), linear("extinction = 1e-6"));
    let (scene, mesh) = open(camera, absorbing);
    let taken = Scattered::new(&scene, &mesh).unwrap().unshadowed();
    let width = scene.width as usize;
    let mut compared = 0;
    for i in width..taken.values.len() - width {
        let around = [i, i - 1, i + 1, i - width, i + width].map(|i| taken.values[i]);
        let most = around.into_iter().fold(0.0, f32::max);
        let least = around.into_iter().fold(1.0, f32::min);
        // On an edge the means over a pixel's samples are those of different things.
        if most - least < 0.05 {
            let (weak, strong) = (weak[i].x, strong[i].x);
            let wanted = strong * (1.0 - around[0]);
            assert!(
                (weak - wanted).abs() < 0.01 * strong,
                "{i}: {weak} {wanted}"
            );
            compared += 1;
        }
    }
    assert!(compared > 800, "{compared}");
}

/// Passes of scattering are there only with a medium; those of the light's map are shared with the surfaces.
#[test]
fn without_a_medium_nothing_of_it_is_there() {
    let (mut scene, mesh) = file("shafts", 64);
    let passes = |scene: &Scene, show| {
        let (graph, _, _) = graph_of(scene, &mesh, show).unwrap();
        let summary = graph.summary();
        let names: Vec<String> = summary.passes.iter().map(|p| p.pass.clone()).collect();
        let left_out = graph.omitted().iter().any(|o| o.what == "scattering");
        (names, left_out)
    };
    let (with, is_left_out) = passes(&scene, Show::Picture);
    assert!(!is_left_out);
    let count = |names: &[String], name: &str| names.iter().filter(|n| *n == name).count();
    for name in [
        "depth",
        "resolve",
        "blur rows",
        "blur columns",
        "shade",
        "rectify",
        "means",
        "camera depth",
        "scatter",
    ] {
        assert_eq!(count(&with, name), 1, "{name}: {with:?}");
    }
    // Light on surfaces is what it is without.
    assert_eq!(count(&passes(&scene, Show::Light).0, "scatter"), 0);
    let medium = scene.medium.take();
    let (without, is_left_out) = passes(&scene, Show::Picture);
    assert!(
        is_left_out && count(&without, "scatter") == 0,
        "{without:?}"
    );
    let mut device = NativeDevice::new();
    let rendering = render_on(&mut device, &scene, &mesh, &NoShaders, &mut Quiet).unwrap();
    assert!(rendering.plan.to_string().contains("there is no medium"));
    let before = by_technique(&scene, &mesh).unwrap();
    scene.medium = medium;
    assert_eq!(by_technique(&scene, &mesh).unwrap(), before);
}

/// A frame whose camera and light are moved is the frame that is made there.
#[test]
fn a_medium_follows_camera_and_light() {
    let directional = [
        "direction = [0.5, -1, 0.2]",
        "direction = [-0.7, -0.4, 0.1]",
    ];
    let spot = [
        "position = [-1, 2.5, -0.4]\ndirection = [0.5, -1, 0.2]",
        "position = [1.4, 1.5, -0.3]\ndirection = [-0.7, -0.6, 0.1]\nangle = 80",
    ];
    let ways = scattering::ALL.map(|technique| (technique.name, directional));
    for fit in ["scene", "camera"] {
        for (technique, lights) in ways.into_iter().chain([("ray-marching", spot)]) {
            let text = |eye: &str, light: &str| {
                format!(
                    "[geometry]\nprocedural = 'box'\n[camera]\neye = {eye}\ntarget = [0, 0.5, 0]\n\
                     [light]\n{light}\n[medium]\nextinction = 0.2\ntechnique = '{technique}'\n\
                     [shadow]\nsize = 64\nfit = '{fit}'\n[output]\nwidth = 32\nheight = 20\n"
                )
            };
            let (first, mesh) = parsed(&text("[2, 2, 4]", lights[0]));
            let (second, _) = parsed(&text("[-3, 1, 2]", lights[1]));
            let mut device = NativeDevice::new();
            let mut moved =
                Frame::new(&mut device, &NoShaders, &first, &mesh, Show::Scattered).unwrap();
            moved.run(Clock::Frame, &mut Quiet).unwrap();
            moved.set_camera(&second.camera).unwrap();
            moved.set_light(0, &second.lights[0]).unwrap();
            moved.run(Clock::Frame, &mut Quiet).unwrap();
            let picture: Vec<f32> = moved.linear().unwrap().iter().map(|c| c.x).collect();
            let wanted = scattered_by_technique(&second, &mesh).unwrap();
            assert_eq!(picture, wanted.values, "{technique}, {fit}");
            assert!(picture.iter().any(|share| *share > 0.01));
        }
    }
}

/// Prefiltered scattering is that of directional lights; passes of one kind of light are not those of another.
#[test]
fn kinds_of_lights_are_told_apart() {
    let (mut scene, mesh) = file("lantern", 64);
    let lamp = scene.lights[0];
    let sun = Light::directional(Vec3::new(0.8, -0.5, 0.1));
    let mut device = NativeDevice::new();
    let mut frame = Frame::new(&mut device, &NoShaders, &scene, &mesh, Show::Picture).unwrap();
    let error = frame.set_light(0, &sun).unwrap_err().to_string();
    assert!(
        error.contains("light 1") && error.contains("stay a spot light"),
        "{error}"
    );
    frame.set_light(0, &lamp).unwrap();
    for name in ["prefiltered", "prefiltered-6"] {
        scene.medium.as_mut().unwrap().technique = Scattering::named(name).unwrap();
        let error = graph_of(&scene, &mesh, Show::Picture)
            .unwrap_err()
            .to_string();
        let parts = [
            "light 1",
            "`[medium]`",
            "`ray-marching`",
            "directional lights",
        ];
        assert!(parts.iter().all(|part| error.contains(part)), "{error}");
    }
    scene.lights[0] = sun;
    assert!(graph_of(&scene, &mesh, Show::Picture).is_ok());
    // Of all ways to scatter, a plan takes those that are for the lights.
    scene.lights.push(lamp);
    let suiting = small(&[4]).configurations();
    let suiting = suiting.iter().filter(|c| c.suits(&scene));
    let names: Vec<String> = suiting.map(|c| c.scattering.unwrap().to_string()).collect();
    assert!(
        !names.is_empty() && names.iter().all(|n| n.starts_with("ray-marching")),
        "{names:?}"
    );
}
