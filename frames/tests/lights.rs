//! Lights: how strong they are and of which colour, spot lights, several in one scene, and those that a picture
//! can do without.

use std::path::Path;

use hankel_dsl::glam::{DVec3, Vec3, Vec4};
use hankel_frames::scene::{CameraView, Light, Mesh, Scene, Source};
use hankel_frames::techniques::{self, DepthBias};
use hankel_frames::truth::{Arriving, by_rays, by_technique, filtered};
use hankel_frames::visibility::cast::{Caster, Lens};
use hankel_frames::{Clock, Frame, NoShaders, Quiet, Show, graph_of};
use hankel_host::device::NativeDevice;

const SUN: &str = "[[light]]\ndirection = [0.62, -0.62, 0.48]\n";
const LAMP: &str = "[[light]]\nposition = [-0.9, 2.2, 0.7]\ndirection = [0.4, -1.0, -0.3]\n";

fn scene(geometry: &str, lights: &str, more: &str) -> (Scene, Mesh) {
    let text = format!(
        "[geometry]\nprocedural = '{geometry}'\n[camera]\neye = [1.9, 1.6, 3.1]\n\
         target = [-0.2, 0.2, -0.3]\n{lights}{more}\n[output]\nwidth = 96\nheight = 54\n"
    );
    let scene = Scene::parse(&text, Path::new("test.toml")).unwrap_or_else(|e| panic!("{e}"));
    let mesh = scene.mesh().unwrap_or_else(|e| panic!("{e}"));
    (scene, mesh)
}

fn drawn(scene: &Scene, mesh: &Mesh, show: Show) -> Vec<Vec4> {
    let mut device = NativeDevice::new();
    let mut frame = Frame::still(&mut device, &NoShaders, scene, mesh, show).unwrap();
    frame.run(Clock::Frame, &mut Quiet).unwrap();
    frame.linear().unwrap()
}

/// The largest difference of two pictures' channels.
fn apart(a: &[Vec4], b: &[Vec4]) -> f32 {
    assert_eq!(a.len(), b.len());
    let pairs = a.iter().zip(b);
    pairs.fold(0.0, |most, (a, b)| most.max((*a - *b).abs().max_element()))
}

/// Two pictures together, without what both have.
fn without(a: &[Vec4], b: &[Vec4], both: &[Vec4]) -> Vec<Vec4> {
    let all = a.iter().zip(b).zip(both);
    all.map(|((a, b), both)| (*a + *b - *both).truncate().extend(1.0))
        .collect()
}

/// What a light adds to a picture is in proportion to its strength and to its colour, on surfaces and in a medium.
#[test]
fn a_light_adds_its_strength_and_colour() {
    for more in ["", "[medium]\nextinction = 0.3\n"] {
        let of = |light: &str| {
            let light = format!("{SUN}{light}\n");
            let (scene, mesh) = scene("box", &light, &format!("{more}[shadow]\nsize = 64"));
            drawn(&scene, &mesh, Show::Picture)
        };
        let (none, one) = (of("strength = 0.0"), of(""));
        let (three, red) = (of("strength = 3.0"), of("colour = [1.0, 0.25, 0.0]"));
        let mut added = 0.0_f32;
        for (((none, one), three), red) in none.iter().zip(&one).zip(&three).zip(&red) {
            let light = *one - *none;
            added = added.max(light.x);
            // Pictures are kept in 16-bit floats, of 11 bits.
            let rounded = three.max_element().max(1.0) * 2.0 / 2048.0;
            assert!((*three - *none - light * 3.0).abs().max_element() < 3.0 * rounded);
            let tinted = light * Vec4::new(1.0, 0.25, 0.0, 0.0);
            assert!((*red - *none - tinted).abs().max_element() < rounded);
        }
        assert!(added > 0.3, "{added}");
    }
}

/// Light falls off with the square of the distance from a lamp and with the cosine on the ground, as far as its
/// cone goes.
#[test]
fn a_spot_light_has_its_analytic_picture() {
    let light = "[light]\nposition = [0.3, 2.0, 0.1]\ndirection = [0.1, -1.0, 0.0]\nangle = 50.0\n\
                 inner = 30.0\nstrength = 4.0\ncolour = [1.0, 0.5, 0.25]\n";
    let (scene, mesh) = scene("empty", light, "[shadow]\nsize = 128");
    let picture = drawn(&scene, &mesh, Show::Picture);
    let dark = {
        let mut dark = scene.clone();
        dark.lights[0].strength = 0.0;
        drawn(&dark, &mesh, Show::Picture)
    };
    let aspect = scene.width as f32 / scene.height as f32;
    let view = CameraView::new(&scene.camera, &mesh, aspect);
    let lens = Lens::new(view.clip_from_world, scene.width, scene.height);
    let caster = Caster::of(&mesh);
    let paint = mesh.colours[0];
    let spot = *scene.lights[0].spot().unwrap();
    let (mut lit, mut faded, mut out) = (0, 0, 0);
    for (i, (pixel, dark)) in picture.iter().zip(&dark).enumerate() {
        let at = [i as u32 % scene.width, i as u32 / scene.width];
        let segment = lens.segment(at, [0.5, 0.5]);
        let Some(hit) = caster.first(&segment) else {
            continue;
        };
        let way = spot.position.as_dvec3() - segment.at(hit.t);
        let distance = way.length();
        let along = -way.dot(spot.direction.as_dvec3()) / distance;
        let degrees = along.acos().to_degrees();
        let cosine = |degrees: f64| degrees.to_radians().cos();
        let fade = ((along - cosine(25.0)) / (cosine(15.0) - cosine(25.0))).clamp(0.0, 1.0);
        let light = 4.0 * 1.15 * fade * fade * way.y / distance.powi(3);
        let wanted = Vec3::new(1.0, 0.5, 0.25) * paint * light as f32;
        // An edge of the ground, or of the cone, within the pixel.
        if at[0] == 0 || (degrees - 25.0).abs() < 1.0 || (degrees - 15.0).abs() < 1.0 {
            continue;
        }
        let added = (*pixel - *dark).truncate();
        assert!(
            (added - wanted).abs().max_element() < 4e-3,
            "{at:?}: {added} {wanted}"
        );
        match degrees {
            d if d < 15.0 => lit += 1,
            d if d < 25.0 => faded += 1,
            _ => out += 1,
        }
    }
    assert!(lit > 50 && faded > 50 && out > 500, "{lit} {faded} {out}");
}

/// Each technique of hard shadows works for a lamp, with each of its maps, fitted or not: lower bounds are nowhere
/// darker than their filtered truth, and all are near to the rays.
#[test]
fn every_technique_of_hard_shadows_shades_from_a_lamp() {
    for fit in ["scene", "camera"] {
        let mut truths: Vec<(DepthBias, Arriving)> = Vec::new();
        let (one, mesh) = scene("box", LAMP, "");
        let rays = by_rays(&one, &mesh, &mut |_| ());
        // The nearest picture without any shadow or cone: the mean everywhere.
        let count = rays.values.len() as f64;
        let mean = rays.values.iter().map(|v| f64::from(*v)).sum::<f64>() / count;
        let squares = rays.values.iter().map(|v| (f64::from(*v) - mean).powi(2));
        let none = (squares.sum::<f64>() / count).sqrt();
        for t in techniques::ALL {
            for map in t.maps {
                let is_float = map.format.bytes() == 4 * map.format.channels();
                // Against all rounding, see `frames/tests/truth.rs`.
                let is_small = is_float && map.moment_bias < 1e-5;
                let bias = map.moment_bias * if is_small { 4.0 } else { 1.0 };
                let shadow = format!(
                    "[shadow]\nmoment_bias = {bias}\ntechnique = '{}'\nformat = '{}'\ndepth_range = '{}'\nsize = 256\n\
                     filter = 3\nleak_cut = 0.0\nfit = '{fit}'",
                    t.name,
                    map.format.name(),
                    map.depth_range.name()
                );
                // `frames/tests/soft.rs` has those.
                if t.is_soft {
                    continue;
                }
                let (scene, mesh) = scene("box", LAMP, &shadow);
                let picture = by_technique(&scene, &mesh).unwrap();
                let errors = picture.errors(&rays).unwrap();
                println!(
                    "{fit}, {}, {}: {errors}; none {none:.4}",
                    t.name,
                    map.format.name()
                );
                assert!(errors.rms < 0.3 * none, "{}: {errors}", t.name);
                if !t.is_lower_bound {
                    continue;
                }
                let bias = scene.shadow.depth_bias;
                if !truths.iter().any(|(b, _)| *b == bias) {
                    truths.push((bias, filtered(&scene, &mesh, &mut |_| ())));
                }
                let truth = truths.iter().find(|(b, _)| *b == bias).map(|(_, t)| t);
                let pairs = picture.values.iter().zip(&truth.unwrap().values);
                let darker = pairs.map(|(a, b)| b - a).fold(0.0, f32::max);
                // The bias may be all shadow. Depths and places are rounded after division, too: twice what
                // those of a directional light are allowed; the cone's edge is steep: 21 times 4e-7.
                let allowed = scene.shadow.moment_bias + 3e-5;
                assert!(darker <= allowed, "{fit}, {}: darker by {darker}", t.name);
            }
        }
    }
}

/// Comparisons of all samples, filtered, are the truth for a lamp, too; and with a fine map they are near the rays.
#[test]
fn filtered_comparisons_are_the_truth_for_a_lamp() {
    for fit in ["scene", "camera"] {
        let shadow =
            format!("[shadow]\ntechnique = 'pcf-gaussian'\nsize = 256\nfilter = 5\nfit = '{fit}'");
        let (made, mesh) = scene("box", LAMP, &shadow);
        let picture = by_technique(&made, &mesh).unwrap();
        let truth = filtered(&made, &mesh, &mut |_| ());
        let errors = picture.errors(&truth).unwrap();
        // A place is rounded to 256 * 2^-24 texels, before and after division.
        assert!(errors.worst < 2e-4, "{fit}: {errors}");
        // Without a filter, and with a bias that is larger than what a texel's depths differ by.
        let shadow = format!("[shadow]\nsize = 1024\nfilter = 1\ndepth_bias = 0.01\nfit = '{fit}'");
        let (scene, mesh) = scene("box", LAMP, &shadow);
        let truth = filtered(&scene, &mesh, &mut |_| ());
        let errors = truth.errors(&by_rays(&scene, &mesh, &mut |_| ())).unwrap();
        println!("{fit}: {errors}");
        assert!(errors.rms < 0.05, "{fit}: {errors}");
    }
}

/// A map of a lamp holds all that is within its cone and before it, also where surfaces go on behind it.
#[test]
fn a_lamp_among_surfaces_shades_what_is_before_it() {
    let light =
        "[light]\nposition = [0.0, 0.6, 1.2]\ndirection = [0.0, -0.3, -1.0]\nangle = 100.0\n";
    for fit in ["scene", "camera"] {
        let shadow = format!("[shadow]\ntechnique = 'pcf'\nsize = 512\nfilter = 1\nfit = '{fit}'");
        let (scene, mesh) = scene("box", light, &shadow);
        let rays = by_rays(&scene, &mesh, &mut |_| ());
        let errors = by_technique(&scene, &mesh).unwrap().errors(&rays).unwrap();
        println!("{fit}: {errors}");
        assert!(errors.rms < 0.06, "{fit}: {errors}");
        let dark = rays.values.iter().filter(|v| **v < 0.01).count();
        assert!(dark > 300, "{dark}");
    }
}

/// The picture of several lights is the sum of theirs, with the light from the sky once; each casts its own shadow,
/// and what is told of them is their mean.
#[test]
fn several_lights_add_up() {
    let shadow = "[shadow]\nsize = 128";
    let [sun, lamp, both] =
        [SUN, LAMP, format!("{SUN}{LAMP}").as_str()].map(|lights| scene("box", lights, shadow));
    let dark = {
        let (mut dark, mesh) = sun.clone();
        dark.lights[0].strength = 0.0;
        drawn(&dark, &mesh, Show::Picture)
    };
    let [one, other, sum] =
        [&sun, &lamp, &both].map(|(scene, mesh)| drawn(scene, mesh, Show::Picture));
    let wanted = without(&one, &other, &dark);
    assert!(apart(&sum, &wanted) < 4e-3, "{}", apart(&sum, &wanted));
    assert!(apart(&one, &other) > 0.1);
    let mean = |of: &dyn Fn(&Scene, &Mesh) -> Arriving| {
        let [one, other, both] = [&sun, &lamp, &both].map(|(scene, mesh)| of(scene, mesh));
        let half = one
            .values
            .iter()
            .zip(&other.values)
            .map(|(a, b)| 0.5 * (a + b));
        let half = Arriving {
            values: half.collect(),
            ..both.clone()
        };
        let errors = both.errors(&half).unwrap();
        assert!(errors.worst < 1e-5, "{errors}");
    };
    mean(&|scene, mesh| by_technique(scene, mesh).unwrap());
    mean(&|scene, mesh| by_rays(scene, mesh, &mut |_| ()));
    mean(&|scene, mesh| filtered(scene, mesh, &mut |_| ()));
    // They share what is the camera's alone, and geometry.
    let (graph, given, _) = graph_of(&both.0, &both.1, Show::Picture).unwrap();
    assert_eq!(given[0].positions, given[1].positions);
    assert_eq!(given[0].camera, given[1].camera);
    let names: Vec<String> = graph.summary().passes.into_iter().map(|p| p.pass).collect();
    assert_eq!(
        names.iter().filter(|n| *n == "shade").count(),
        2,
        "{names:?}"
    );
    assert_eq!(names.last().map(String::as_str), Some("sum"));
}

/// Lights in a medium add up as well: what is behind it is weakened once.
#[test]
fn several_lights_add_up_in_a_medium() {
    let second = "[[light]]\ndirection = [-0.3, -1.0, 0.4]\nstrength = 2.0\n";
    let more = "[medium]\nextinction = 0.2\ntechnique = 'ray-marching'\n[shadow]\nsize = 64";
    let [one, other, both] =
        [SUN, second, format!("{SUN}{second}").as_str()].map(|lights| scene("box", lights, more));
    let (mut dark, mesh) = one.clone();
    dark.lights[0].strength = 0.0;
    let dark = drawn(&dark, &mesh, Show::Picture);
    let [a, b, sum] = [&one, &other, &both].map(|(scene, mesh)| drawn(scene, mesh, Show::Picture));
    let wanted = without(&a, &b, &dark);
    assert!(apart(&sum, &wanted) < 8e-3, "{}", apart(&sum, &wanted));
}

/// A light that reaches nothing that is seen is left out, the frame says why, and its picture stays as it is.
#[test]
fn lights_that_reach_nothing_are_left_out() {
    let below = "[[light]]\ndirection = [0.1, 1.0, 0.0]\n";
    let aside =
        "[[light]]\nposition = [60.0, 3.0, 0.0]\ndirection = [1.0, -1.0, 0.0]\nangle = 20.0\n";
    let off = "[[light]]\ndirection = [0.0, -1.0, 0.0]\nstrength = 0.0\n";
    let black = "[[light]]\ndirection = [0.0, -1.0, 0.0]\ncolour = [0.0, 0.0, 0.0]\n";
    let shadow = "[shadow]\nsize = 64";
    let lights = format!("{off}{SUN}{aside}{black}");
    let (all, mesh) = scene("empty", &format!("{lights}{below}"), shadow);
    let (graph, given, _) = graph_of(&all, &mesh, Show::Picture).unwrap();
    assert_eq!(given.len(), 1);
    let told: Vec<String> = graph
        .omitted()
        .iter()
        .filter(|o| o.what.starts_with("light "))
        .map(|o| format!("{}: {}", o.what, o.why))
        .collect();
    assert_eq!(
        told,
        [
            "light 1: its strength is 0",
            "light 3: nothing that the camera sees is within its cone",
            "light 4: its colour is black",
            "light 5: all that the camera sees is turned from it",
        ]
    );
    let (sun, _) = scene("empty", SUN, shadow);
    let picture = drawn(&all, &mesh, Show::Picture);
    assert_eq!(picture, drawn(&sun, &mesh, Show::Picture));
    // With all of them it is the same: nothing that was left out has added anything.
    let mut device = NativeDevice::new();
    let mut frame = Frame::new(&mut device, &NoShaders, &all, &mesh, Show::Picture).unwrap();
    frame.run(Clock::Frame, &mut Quiet).unwrap();
    assert!(apart(&picture, &frame.linear().unwrap()) < 2e-3);
    // Where there is no other, one stays.
    let (none, _) = scene("empty", &format!("{off}{below}"), shadow);
    let (_, given, _) = graph_of(&none, &mesh, Show::Picture).unwrap();
    assert_eq!(given.len(), 1);
}

/// A lamp that was moved makes the picture that it makes in its new place; also one of several.
#[test]
fn a_lamp_can_be_moved() {
    for fit in ["scene", "camera"] {
        let shadow = format!("[shadow]\nsize = 64\nfit = '{fit}'");
        let (first, mesh) = scene("box", &format!("{SUN}{LAMP}"), &shadow);
        let mut second = first.clone();
        let Source::Spot(spot) = &mut second.lights[1].source else {
            panic!("the second light is a lamp");
        };
        spot.position = Vec3::new(1.2, 1.8, 0.4);
        spot.direction = Vec3::new(-0.7, -1.0, 0.0).normalize();
        spot.angle = 80.0;
        second.lights[1].strength = 2.0;
        second.camera.eye.x -= 1.0;
        for show in [Show::Picture, Show::Light] {
            let mut device = NativeDevice::new();
            let mut frame = Frame::new(&mut device, &NoShaders, &first, &mesh, show).unwrap();
            frame.run(Clock::Frame, &mut Quiet).unwrap();
            frame.set_light(1, &second.lights[1]).unwrap();
            frame.set_camera(&second.camera).unwrap();
            frame.run(Clock::Frame, &mut Quiet).unwrap();
            assert_eq!(
                frame.linear().unwrap(),
                drawn(&second, &mesh, show),
                "{fit}"
            );
            let error = frame
                .set_light(2, &second.lights[1])
                .unwrap_err()
                .to_string();
            assert!(
                error.contains("light 2") && error.contains("2 lights"),
                "{error}"
            );
        }
    }
}

/// A lamp's cone fades between its two angles.
#[test]
fn a_cone_fades_from_its_inner_to_its_outer_angle() {
    let (scene, _) = scene("box", LAMP, "");
    let spot = scene.lights[0].spot().unwrap();
    assert_eq!((spot.angle, spot.inner), (60.0, 48.0));
    let aside = spot.direction.as_dvec3().any_orthonormal_vector();
    let at = |degrees: f64| {
        let (sin, cos) = degrees.to_radians().sin_cos();
        let way = spot.direction.as_dvec3() * cos + aside * sin;
        spot.within(spot.position.as_dvec3() + way * 7.0)
    };
    assert!(at(0.0) == 1.0 && at(23.9) == 1.0 && at(30.1) == 0.0 && at(170.0) == 0.0);
    assert!(at(27.0) > 0.1 && at(27.0) < 0.5);
    assert_eq!(spot.within(spot.position.as_dvec3() + DVec3::ZERO), 0.0);
    let directional = Light::directional(Vec3::new(0.0, -2.0, 0.0));
    assert!(directional.spot().is_none() && directional.direction() == Vec3::NEG_Y);
}
