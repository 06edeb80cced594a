//! Soft shadows: summed-area tables against exact sums, and techniques against rays to all of the light.

use std::path::Path;

use hankel_dsl::glam::UVec2;
use hankel_frames::passes::{light_depth, summed_area};
use hankel_frames::scene::{Mesh, Scene};
use hankel_frames::truth::{by_rays, by_technique};
use hankel_frames::{Clock, Executor, NoShaders, Quiet, Show, graph_of};
use hankel_host::device::NativeDevice;

fn scene(light: &str, shadow: &str) -> (Scene, Mesh) {
    lit(&format!("direction = [0.62, -0.62, 0.48]\n{light}"), shadow)
}

fn lit(light: &str, shadow: &str) -> (Scene, Mesh) {
    let text = format!(
        "[geometry]\nprocedural = 'box'\n[camera]\neye = [1.9, 1.6, 3.1]\ntarget = [-0.2, 0.2, -0.3]\n\
         [light]\n{light}\n[shadow]\n{shadow}\n\
         [output]\nwidth = 160\nheight = 90\n"
    );
    let scene = Scene::parse(&text, Path::new("test.toml")).unwrap_or_else(|e| panic!("{e}"));
    let mesh = scene.mesh().unwrap_or_else(|e| panic!("{e}"));
    (scene, mesh)
}

/// The elements of a table before and after they are summed up, of so many channels.
fn tables(resolve: &'static str, sum: &'static str, size: u32) -> [Vec<u32>; 2] {
    // Penumbrae of so few texels that the table's sums wrap.
    let (scene, mesh) = scene("radius = 0.1", &format!("size = {size}"));
    let (mut graph, given, _) = graph_of(&scene, &mesh, Show::Light).unwrap();
    let given = given[0];
    let depth = light_depth(&mut graph, &given).unwrap();
    let texels = graph.constant("texels", &UVec2::splat(size));
    let resolved = graph
        .compute("resolve", resolve)
        .arg("size", texels)
        .arg("area", given.area)
        .arg("depth", depth)
        .elements(size as usize * size as usize)
        .unwrap();
    let summed = summed_area(&mut graph, &given, depth, resolve, sum).unwrap();
    graph.keep(resolved);
    graph.keep(summed);
    let mut device = NativeDevice::new();
    let mut executor = Executor::new(&mut device, &NoShaders, graph).unwrap();
    executor.run(Clock::Frame, &mut Quiet).unwrap();
    [resolved, summed].map(|h| bytemuck::pod_collect_to_vec(&executor.read(h).unwrap()))
}

/// A table holds the sums over all texels to the upper left, modulo 2^32, to the bit: also of a map whose
/// lines are no multiple of the workgroup's parts.
#[test]
fn a_summed_area_table_holds_exact_sums() {
    for (resolve, sum, channels, size) in [
        ("resolve_summed", "prefix_sums", 4, 64_usize),
        ("resolve_summed", "prefix_sums", 4, 77),
        ("resolve_summed_6", "prefix_sums_6", 6, 77),
    ] {
        let [texels, table] = tables(resolve, sum, size as u32);
        assert_eq!(table.len(), channels * size * size);
        let mut has_wrapped = false;
        for channel in 0..channels {
            let mut above = vec![0_u64; size];
            for y in 0..size {
                let mut row = 0;
                for (x, above) in above.iter_mut().enumerate() {
                    let i = (y * size + x) * channels + channel;
                    row += u64::from(texels[i]);
                    *above += row;
                    assert_eq!(table[i], *above as u32, "{resolve}, {size}: {x}, {y}");
                    has_wrapped |= *above > u64::from(u32::MAX);
                }
            }
        }
        assert!(has_wrapped, "{resolve}, {size}");
    }
}

/// Techniques against 256 rays to the light from each pixel: root of the mean square error. What they reach
/// is measured, with a tenth on top; a hard shadow has 0.043 and 0.071.
#[test]
fn soft_shadows_are_near_the_rays() {
    for (light, limits) in [
        (
            "radius = 0.05",
            [
                ("pcss", 0.0146),
                ("vssm", 0.0225),
                ("soft", 0.0123),
                ("soft-6", 0.012),
            ],
        ),
        (
            "radius = 0.1\nshape = 'square'",
            [
                ("pcss", 0.021),
                ("vssm", 0.049),
                ("soft", 0.0155),
                ("soft-6", 0.0125),
            ],
        ),
    ] {
        let (scene_of_truth, mesh) = scene(light, "");
        let truth = by_rays(&scene_of_truth, &mesh, &mut |_| ());
        let sharp = by_rays(&point(&scene_of_truth), &mesh, &mut |_| ());
        println!("{light:?}: hard {}", sharp.errors(&truth).unwrap());
        for (technique, limit) in limits {
            let (scene, mesh) = scene(light, &format!("technique = '{technique}'\nsize = 512"));
            let picture = by_technique(&scene, &mesh).unwrap_or_else(|e| panic!("{e}"));
            let errors = picture.errors(&truth).unwrap();
            println!("{light:?}, {technique}: {errors}");
            assert!(errors.rms < limit, "{light:?}, {technique}: {errors}");
        }
    }
}

/// The same with a lamp, from which blockers and receivers are at very different distances.
#[test]
fn lamps_have_soft_shadows() {
    let light = "position = [-2.2, 2.6, -1.7]\ndirection = [0.62, -0.7, 0.48]\nangle = 70.0\nradius = 0.25\n\
                 shape = 'square'";
    let (scene_of_truth, mesh) = lit(light, "");
    let truth = by_rays(&scene_of_truth, &mesh, &mut |_| ());
    let sharp = by_rays(&point(&scene_of_truth), &mesh, &mut |_| ());
    println!("hard {}", sharp.errors(&truth).unwrap());
    for (technique, limit) in [
        ("pcss", 0.02),
        ("vssm", 0.0375),
        ("soft", 0.0156),
        ("soft-6", 0.0144),
    ] {
        let shadow = format!("technique = '{technique}'\nsize = 512");
        let (scene, mesh) = lit(light, &shadow);
        let picture = by_technique(&scene, &mesh).unwrap_or_else(|e| panic!("{e}"));
        let errors = picture.errors(&truth).unwrap();
        println!("{technique}: {errors}");
        assert!(errors.rms < limit, "{technique}: {errors}");
    }
}

/// The scene with the light's middle alone.
fn point(scene: &Scene) -> Scene {
    let mut scene = scene.clone();
    scene.lights[0].area.radius = 0.0;
    scene
}

/// The truth of a light that is hardly more than a point is that of a point, and of a larger one it has more
/// pixels between light and shadow.
#[test]
fn the_truth_softens_with_the_light() {
    let between = |light: &str| {
        let (scene, mesh) = scene(light, "");
        let picture = by_rays(&scene, &mesh, &mut |_| ());
        let errors = by_rays(&point(&scene), &mesh, &mut |_| ())
            .errors(&picture)
            .unwrap();
        let count = picture
            .values
            .iter()
            .filter(|v| **v > 0.02 && **v < 0.98)
            .count();
        (errors.rms, count)
    };
    let (point, few) = between("radius = 0.00001");
    let (disc, more) = between("radius = 0.1");
    assert!(point < 1e-3, "{point}");
    assert!(disc > 0.05 && more > 2 * few, "{disc} {few} {more}");
}

/// More samples bring percentage-closer soft shadows nearer to the truth.
#[test]
fn samples_count() {
    let light = "radius = 0.1";
    let (scene_of_truth, mesh) = scene(light, "");
    let truth = by_rays(&scene_of_truth, &mesh, &mut |_| ());
    let error = |samples: &str| {
        let shadow = format!("technique = 'pcss'\nsize = 512\nsamples = {samples}");
        let (scene, mesh) = scene(light, &shadow);
        let picture = by_technique(&scene, &mesh).unwrap_or_else(|e| panic!("{e}"));
        picture.errors(&truth).unwrap().rms
    };
    let errors = ["[8, 8]", "[32, 32]", "[128, 128]"].map(error);
    assert!(errors.is_sorted_by(|a, b| a > b), "{errors:?}");
}
