//! Soft shadows: summed-area tables against exact sums, and techniques against rays to all of the light.

use std::path::Path;

use hankel_dsl::glam::{UVec2, Vec3};
use hankel_dsl::native::layout::Element;
use hankel_frames::passes::{TABLES, TABLES_6, Tables, light_depth, summed_area};
use hankel_frames::scene::{Mesh, Scene};
use hankel_frames::techniques::Technique;
use hankel_frames::truth::{by_rays, by_technique};
use hankel_frames::{Clock, Executor, NoShaders, Quiet, Show, graph_of};
use hankel_host::device::NativeDevice;
use hankel_moments::{
    Fixed4, Fixed6, Moments4, Moments6, quantize_symmetric_4, quantize_symmetric_6,
};
use hankel_shadows::soft::{Level, POINT, Pyramid};

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

/// A pyramid of a scene's map: the elements of its first level before they are summed up, and those of all levels
/// after it.
fn tables<T: Element>(kernels: &Tables<T>, size: u32) -> [Vec<u32>; 2] {
    let (scene, mesh) = scene("radius = 0.1", &format!("size = {size}"));
    let (mut graph, given, _) = graph_of(&scene, &mesh, Show::Light).unwrap();
    let given = given[0];
    let depth = light_depth(&mut graph, &given).unwrap();
    let texels = graph.constant("texels", &UVec2::splat(size));
    let empty = graph.zeros::<T>("empty", (size * size) as usize);
    let resolved = graph
        .compute("resolve", kernels.resolve)
        .arg("size", texels)
        .arg("depth", depth)
        .arg("table", empty)
        .finish()
        .unwrap();
    let resolved = resolved.changed("table").unwrap();
    let [summed, _] = summed_area(&mut graph, &given, depth, kernels).unwrap();
    graph.keep(resolved);
    graph.keep(summed);
    let mut device = NativeDevice::new();
    let mut executor = Executor::new(&mut device, &NoShaders, graph).unwrap();
    executor.run(Clock::Frame, &mut Quiet).unwrap();
    [resolved, summed].map(|h| bytemuck::pod_collect_to_vec(&executor.read(h).unwrap()))
}

/// A level's table holds the sums over all of its texels to the upper left, modulo 2^32, to the bit; its texels are
/// the means of those of the level before, and what lies beyond the map is far: also of a map whose lines are no
/// multiple of the workgroup's parts, and whose levels have odd sizes.
fn holds_exact_sums<T: Element>(kernels: &Tables<T>, channels: usize, size: u32) {
    let [mut texels, table] = tables(kernels, size);
    let far: Vec<u32> = match channels {
        4 => {
            let Fixed4 { r, g, b, a } =
                Fixed4::of(quantize_symmetric_4(Moments4::of_depth(1.0)), POINT);
            vec![r, g, b, a]
        }
        _ => {
            let far = Fixed6::of(quantize_symmetric_6(Moments6::of_depth(1.0)), POINT);
            bytemuck::pod_collect_to_vec(&[far.r0, far.g0, far.b0, far.r1, far.g1, far.b1])
        }
    };
    let levels: Vec<Level> = Pyramid::of([size; 2]).all().collect();
    let last = levels.last().unwrap();
    let count = (last.first + last.size.x * last.size.y) as usize;
    assert_eq!(table.len(), channels * count);
    assert!(levels.len() > 1);
    let mut has_wrapped = false;
    for level in levels {
        let [width, height] = level.size.to_array().map(|n| n as usize);
        for channel in 0..channels {
            let mut above = vec![0_u64; width];
            for y in 0..height {
                let mut row = 0;
                for (x, above) in above.iter_mut().enumerate() {
                    let i = y * width + x;
                    row += u64::from(texels[i * channels + channel]);
                    *above += row;
                    let entry = table[(level.first as usize + i) * channels + channel];
                    assert_eq!(entry, *above as u32, "{size}, {level:?}: {x}, {y}");
                    has_wrapped |= *above > u64::from(u32::MAX);
                }
            }
        }
        let [across, down] = [width.div_ceil(2), height.div_ceil(2)];
        let mut halved = Vec::new();
        for i in 0..across * down * channels {
            let (x, y, c) = (i / channels % across, i / channels / across, i % channels);
            let at = |x: usize, y: usize| match x < width && y < height {
                true => texels[(y * width + x) * channels + c],
                false => far[c],
            };
            let (x, y) = (2 * x, 2 * y);
            halved.push((at(x, y) + at(x + 1, y) + at(x, y + 1) + at(x + 1, y + 1) + 2) / 4);
        }
        texels = halved;
    }
    assert!(has_wrapped, "{size}");
}

#[test]
fn pyramids_hold_exact_sums() {
    holds_exact_sums(&TABLES, 4, 64);
    holds_exact_sums(&TABLES, 4, 77);
    holds_exact_sums(&TABLES_6, 6, 77);
}

/// Techniques against 256 rays to the light from each pixel: root of the mean square error. What they reach
/// is measured, with a tenth on top; a hard shadow has 0.043 and 0.071.
#[test]
fn soft_shadows_are_near_the_rays() {
    for (light, limits) in [
        (
            "radius = 0.05",
            [
                ("pcss", 0.0107),
                ("vssm", 0.0225),
                ("soft", 0.0115),
                ("soft-6", 0.0112),
            ],
        ),
        (
            "radius = 0.1\nshape = 'square'",
            [
                ("pcss", 0.0125),
                ("vssm", 0.049),
                ("soft", 0.0106),
                ("soft-6", 0.0093),
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
        ("pcss", 0.015),
        ("vssm", 0.0375),
        ("soft", 0.0138),
        ("soft-6", 0.0135),
    ] {
        let shadow = format!("technique = '{technique}'\nsize = 512");
        let (scene, mesh) = lit(light, &shadow);
        let picture = by_technique(&scene, &mesh).unwrap_or_else(|e| panic!("{e}"));
        let errors = picture.errors(&truth).unwrap();
        println!("{technique}: {errors}");
        assert!(errors.rms < limit, "{technique}: {errors}");
    }
}

/// A lid over a floor, so far above it that what hides a part of the light lies far outside of what the camera sees of
/// the floor: a map that is fitted to that has the same penumbra as one of all of the scene.
#[test]
fn fitted_maps_hold_what_hides_a_part_of_the_light() {
    let mut mesh = Mesh::default();
    for (half, y, x) in [(4.0, 0.0, 0.0), (1.2, 3.0, 1.5)] {
        let corners = [[-1.0, 1.0], [1.0, 1.0], [1.0, -1.0], [-1.0, -1.0]];
        mesh.quad(corners.map(|[u, v]| Vec3::new(x + half * u, y, half * v)));
        mesh.paint(Vec3::ONE);
    }
    for light in [
        "direction = [0.0, -1.0, 0.0]\nradius = 0.3",
        "position = [0.0, 9.0, 0.0]\ndirection = [0.0, -1.0, 0.01]\nangle = 30.0\nradius = 4.0",
    ] {
        let scene = |shadow: &str| {
            let text = format!(
                "[geometry]\nprocedural = 'box'\n[camera]\neye = [0.0, 2.0, 0.01]\ntarget = [0.0, 0.0, 0.0]\n\
                 fov = 30.0\n[light]\n{light}\nshape = 'square'\n[shadow]\n{shadow}\n\
                 [output]\nwidth = 32\nheight = 18\n"
            );
            Scene::parse(&text, Path::new("test.toml")).unwrap_or_else(|e| panic!("{e}"))
        };
        let truth = by_rays(&scene(""), &mesh, &mut |_| ());
        let between = truth.values.iter().filter(|v| **v > 0.1 && **v < 0.9);
        assert!(between.count() > 200);
        // Those whose own error does not hide what is missing.
        for technique in ["soft", "soft-6", "pcss"] {
            let [fitted, whole] = ["camera", "scene"].map(|fit| {
                let scene = scene(&format!(
                    "technique = '{technique}'\nsize = 256\nfit = '{fit}'"
                ));
                let picture = by_technique(&scene, &mesh).unwrap_or_else(|e| panic!("{e}"));
                picture.errors(&truth).unwrap()
            });
            println!("{light:?}, {technique}: fitted {fitted}; whole {whole}");
            assert!(
                fitted.rms < 1.1 * whole.rms,
                "{technique}: {fitted}; {whole}"
            );
            assert!(whole.rms < 0.03, "{technique}: {whole}");
        }
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

/// Percentage-closer soft shadows of thin posts that stand on the ground, where a search of all that the light may be
/// behind finds little of them: the post's own place is looked at.
#[test]
fn posts_have_shadows_where_they_stand() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes/soft.toml");
    let mut scene = Scene::read(&path).unwrap_or_else(|e| panic!("{e}"));
    (scene.width, scene.height, scene.shadow.size) = (96, 54, 512);
    let mesh = scene.mesh().unwrap_or_else(|e| panic!("{e}"));
    let truth = by_rays(&scene, &mesh, &mut |_| ());
    let technique = Technique::named("pcss").unwrap();
    scene.shadow = scene.shadow.by_technique(technique);
    for (samples, limit) in [(16, 0.0985), (32, 0.092), (33, 0.092)] {
        scene.shadow.samples = [samples; 2];
        let picture = by_technique(&scene, &mesh).unwrap_or_else(|e| panic!("{e}"));
        let errors = picture.errors(&truth).unwrap();
        println!("{samples}: {errors}");
        assert!(errors.rms < limit, "{samples}: {errors}");
    }
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
