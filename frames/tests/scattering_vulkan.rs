//! Scattered light on Vulkan: the pictures are those of the native device, and how long passes take there. The
//! shaders are the committed SPIR-V of the built-in kernels.

mod common;

use std::path::Path;

use common::shaders;
use hankel_frames::scattering::Scattering;
use hankel_frames::scene::{Mesh, Scene};
use hankel_frames::truth::{scattered_by_technique, scattered_by_technique_on};
use hankel_frames::{Clock, Frame, Quiet, Show};
use hankel_host::device::{self, Backend};

/// A file of `scenes/`, with a technique and a number of steps.
fn file(name: &str, technique: &str, steps: u32, output: [u32; 2], size: u32) -> (Scene, Mesh) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("../scenes/{name}.toml"));
    let mut scene = Scene::read(&path).unwrap_or_else(|e| panic!("{e}"));
    [scene.width, scene.height] = output;
    scene.shadow.size = size;
    let medium = scene.medium.as_mut().unwrap();
    medium.technique = Scattering::named(technique).unwrap();
    medium.steps = steps;
    let mesh = scene.mesh().unwrap_or_else(|e| panic!("{e}"));
    (scene, mesh)
}

const WAYS: [(&str, u32); 5] = [
    ("ray-marching", 8),
    ("ray-marching", 32),
    ("ray-marching", 128),
    ("prefiltered", 1),
    ("prefiltered-6", 1),
];

/// Those that are for a scene's light.
fn ways(scene: &str) -> &'static [(&'static str, u32)] {
    if scene == "lantern" {
        &WAYS[..3]
    } else {
        &WAYS
    }
}

#[test]
fn both_backends_scatter_alike() {
    let shaders = shaders();
    for scene in ["shafts", "mist", "lantern"] {
        for (technique, steps) in ways(scene) {
            let (scene_of_both, mesh) = file(scene, technique, *steps, [96, 54], 256);
            let native = scattered_by_technique(&scene_of_both, &mesh).unwrap();
            let mut device = device::open(Backend::Vulkan).unwrap_or_else(|e| panic!("{e}"));
            let vulkan =
                scattered_by_technique_on(&mut *device, &shaders, &scene_of_both, &mesh).unwrap();
            let errors = vulkan.errors(&native).unwrap();
            println!("{scene}, {technique}, {steps} steps: {errors}");
            // Where a sample of map or picture lies on an edge, a rasteriser and a ray may see different surfaces.
            assert!(errors.rms < 0.005, "{scene}, {technique}: {errors}");
        }
    }
}

/// A frame's passes in their steady state.
#[test]
fn passes_of_scattering_have_their_times() {
    let shaders = shaders();
    let all = ["shafts", "lantern"].map(|scene| ways(scene).iter().map(move |way| (scene, way)));
    for (name, (technique, steps)) in all.into_iter().flatten() {
        let (scene, mesh) = file(name, technique, *steps, [960, 540], 512);
        let mut device = device::open(Backend::Vulkan).unwrap_or_else(|e| panic!("{e}"));
        let mut frame = Frame::new(&mut *device, &shaders, &scene, &mesh, Show::Picture).unwrap();
        frame.run(Clock::Frame, &mut Quiet).unwrap();
        let passes = frame.executor().steady(5).unwrap();
        let text = passes
            .iter()
            .map(|p| format!("{} {:.1}", p.name, p.seconds * 1e3));
        let text: Vec<String> = text.collect();
        println!(
            "{name}, {technique}, {steps} steps, 960x540, map of 512² [ms]: {}",
            text.join(", ")
        );
        assert_eq!(text.iter().filter(|p| p.starts_with("scatter ")).count(), 1);
    }
}

/// A pass's time does not include what the processor does before it, and no pass is without.
#[test]
fn times_of_passes_add_up() {
    let shaders = shaders();
    let (scene, mesh) = file("shafts", "prefiltered", 1, [960, 540], 512);
    let mut device = device::open(Backend::Vulkan).unwrap_or_else(|e| panic!("{e}"));
    let mut frame = Frame::new(&mut *device, &shaders, &scene, &mesh, Show::Picture).unwrap();
    // The driver compiles.
    frame.run(Clock::Frame, &mut Quiet).unwrap();
    for _ in 0..3 {
        frame.executor().forget();
        let run = frame.run(Clock::Passes, &mut Quiet).unwrap();
        let sum: f64 = run.ran.iter().map(|pass| pass.seconds).sum();
        println!("{sum} of {}: {:?}", run.seconds, run.ran);
        assert!(sum <= run.seconds, "{sum} of {}", run.seconds);
        assert!(sum > 0.2 * run.seconds, "{sum} of {}", run.seconds);
        assert!(run.ran.iter().all(|pass| pass.seconds > 0.0));
    }
}
