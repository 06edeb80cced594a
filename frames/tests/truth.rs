//! Techniques against rays: pictures of the light that arrives.

use std::path::Path;

use hankel_frames::Quiet;
use hankel_frames::scene::{Mesh, Scene, Shadow};
use hankel_frames::techniques::{self, DepthBias, Map, Technique};
use hankel_frames::truth::{Arriving, by_rays, by_technique, filtered, measure};

/// A scene whose surfaces are all shaded as if they faced the light, so that no pixel is left out of a comparison.
fn scene(geometry: &str, size: u32, shadow: &str) -> (Scene, Mesh) {
    let eye = if geometry == "box" {
        "[1.9, 1.6, 3.1]"
    } else {
        "[7.4, 6.2, 12.4]"
    };
    let text = format!(
        "[geometry]\nprocedural = '{geometry}'\n[camera]\neye = {eye}\ntarget = [-0.2, 0.2, -0.3]\n\
         [light]\ndirection = [0.62, -0.62, 0.48]\n[shadow]\nsize = {size}\nleak_cut = 0.0\n{shadow}\n\
         [output]\nwidth = 160\nheight = 90\n"
    );
    let scene = Scene::parse(&text, Path::new("test.toml")).unwrap_or_else(|e| panic!("{e}"));
    let mut mesh = scene.mesh().unwrap_or_else(|e| panic!("{e}"));
    mesh.normals.fill(-scene.lights[0].direction());
    (scene, mesh)
}

fn technique_of(scene: &Scene, mesh: &Mesh) -> Arriving {
    by_technique(scene, mesh).unwrap_or_else(|e| panic!("{e}"))
}

/// How much darker a picture is than another, at its worst pixel.
fn darker(picture: &Arriving, truth: &Arriving) -> f32 {
    let pairs = picture.values.iter().zip(&truth.values);
    pairs.map(|(a, b)| b - a).fold(0.0, f32::max)
}

/// The bias mixes so much of a harmless distribution in, which may be all shadow. It also takes up
/// what rounding does to the moments, so that only what rounding does to the bound itself remains: 1e-5.
fn allowed(shadow: &Shadow) -> f32 {
    shadow.moment_bias + 1e-5
}

fn is_float(map: &Map) -> bool {
    map.format.bytes() == 4 * map.format.channels()
}

/// The published strengths for 32 bits take up one rounding of each moment. On its way through a
/// mean of four, two sums of seven products and a bilinear lookup a moment is rounded 20 times, by
/// 2^-24 each: 1.2e-6. Other maps have a bias for all that rounds.
fn with_map(technique: &str, map: &Map) -> String {
    let bias = if is_float(map) && map.moment_bias < 1e-5 {
        4.0 * map.moment_bias
    } else {
        map.moment_bias
    };
    format!(
        "technique = '{technique}'\nformat = '{}'\ndepth_range = '{}'\nmoment_bias = {bias}",
        map.format.name(),
        map.depth_range.name()
    )
}

#[test]
fn lower_bounds_are_nowhere_darker_than_all_samples_filtered() {
    for geometry in ["box", "yard"] {
        for bias in ["", "depth_bias = 0.002"] {
            let mut truths: Vec<(DepthBias, Arriving)> = Vec::new();
            for t in techniques::ALL.iter().filter(|t| t.is_lower_bound) {
                for map in t.maps {
                    let settings = format!("{}\n{bias}", with_map(t.name, map));
                    let (scene, mesh) = scene(geometry, 256, &settings);
                    // Bias by bias, there is one truth for all.
                    let bias = scene.shadow.depth_bias;
                    if !truths.iter().any(|(b, _)| *b == bias) {
                        truths.push((bias, filtered(&scene, &mesh, &mut |_| ())));
                    }
                    let truth = truths.iter().find(|(b, _)| *b == bias).map(|(_, t)| t);
                    let picture = technique_of(&scene, &mesh);
                    let by = darker(&picture, truth.unwrap());
                    println!("{geometry}, {settings:?}: darker by {by}");
                    assert!(
                        by <= allowed(&scene.shadow),
                        "{geometry}, {settings:?}: darker by {by}"
                    );
                }
            }
        }
    }
}

/// The same of depths with one sample in each texel.
#[test]
fn lower_bounds_of_single_samples_are_nowhere_darker() {
    let mut truths: Vec<Arriving> = Vec::new();
    for bias in ["", "depth_bias = 0.002"] {
        let mut all: Vec<(DepthBias, Arriving)> = Vec::new();
        let techniques = techniques::ALL.iter();
        for t in techniques.filter(|t| t.is_lower_bound) {
            for map in t.maps {
                let settings = format!("{}\n{bias}\nmultisampling = 1", with_map(t.name, map));
                let (scene, mesh) = scene("box", 256, &settings);
                let bias = scene.shadow.depth_bias;
                if !all.iter().any(|(b, _)| *b == bias) {
                    all.push((bias, filtered(&scene, &mesh, &mut |_| ())));
                }
                let truth = all.iter().find(|(b, _)| *b == bias).map(|(_, t)| t);
                let by = darker(&technique_of(&scene, &mesh), truth.unwrap());
                println!("{settings:?}: darker by {by}");
                assert!(by <= allowed(&scene.shadow), "{settings:?}: darker by {by}");
            }
        }
        truths.extend(all.into_iter().map(|(_, truth)| truth));
    }
    // It is another truth than that of four samples.
    let (scene, mesh) = scene("box", 256, "depth_bias = 0.002");
    let four = filtered(&scene, &mesh, &mut |_| ());
    assert!(truths.iter().all(|truth| *truth.values != *four.values));
}

/// The kernel does in single precision what the truth does in double precision.
#[test]
fn filtering_comparisons_of_all_samples_is_the_truth() {
    for (filter, fit) in [(1, "scene"), (5, "scene"), (5, "camera")] {
        let shadow = format!("technique = 'pcf-gaussian'\nfilter = {filter}\nfit = '{fit}'");
        let (scene, mesh) = scene("yard", 256, &shadow);
        let truth = filtered(&scene, &mesh, &mut |_| ());
        let errors = technique_of(&scene, &mesh).errors(&truth).unwrap();
        // A place is rounded to 256 * 2^-24 texels.
        assert!(errors.worst < 1e-4, "{filter}, {fit}: {errors}");
    }
}

/// With its default bias, a comparison of depths leaves open ground lit, whatever the map's texels and the filter are.
#[test]
fn open_ground_does_not_shade_itself() {
    for technique in ["pcf", "pcf-gaussian", "pcf-gaussian-tiles"] {
        for (size, filter) in [(64, 1), (64, 9), (256, 5), (256, 15), (512, 3)] {
            let shadow = format!("technique = '{technique}'\nfilter = {filter}\nmultisampling = 1");
            let (scene, mesh) = scene("empty", size, &shadow);
            let picture = technique_of(&scene, &mesh);
            let darkest = picture.values.iter().copied().fold(1.0, f32::min);
            assert!(darkest > 0.999, "{technique}, {size}, {filter}: {darkest}");
        }
    }
}

/// The default bias of comparisons is near the best one for scenes that differ, and far nearer the rays than none that
/// follows the map.
#[test]
fn a_depth_bias_that_follows_the_map_is_near_the_best() {
    for name in ["contact", "foliage", "room", "wires"] {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("../scenes/{name}.toml"));
        let mut scene = Scene::read(&path).unwrap_or_else(|e| panic!("{e}"));
        (scene.width, scene.height) = (96, 54);
        scene.shadow = scene
            .shadow
            .by_technique(Technique::named("pcf-gaussian").unwrap());
        scene.shadow = Shadow {
            size: 256,
            filter: 5,
            multisampling: 1,
            ..scene.shadow
        };
        let mesh = scene.mesh().unwrap_or_else(|e| panic!("{e}"));
        let truth = by_rays(&scene, &mesh, &mut |_| ());
        let error = |bias: DepthBias| {
            let mut scene = scene.clone();
            scene.shadow.depth_bias = bias;
            technique_of(&scene, &mesh).errors(&truth).unwrap().rms
        };
        let default = error(scene.shadow.technique.depth_bias);
        let constant = error(DepthBias::Share(0.002));
        let slopes = [0.5, 0.75, 1.5, 2.0].map(|slope| error(DepthBias::Slope(slope)));
        println!(
            "{name}: {default:.4}; 0.002 {constant:.4}; slopes of 0.5, 0.75, 1.5 and 2 {slopes:.4?}"
        );
        let best = slopes.into_iter().fold(default, f64::min);
        assert!(default < 1.25 * best, "{name}: {default} {slopes:?}");
        assert!(default < 0.5 * constant, "{name}: {default} {constant}");
    }
}

/// Truth that was darker nowhere would prove nothing: it has shadow, light, and what is between.
#[test]
fn the_filtered_truth_is_a_soft_picture_of_the_hard_one() {
    let (scene, mesh) = scene("box", 1024, "filter = 3\ndepth_bias = 0.003");
    let soft = filtered(&scene, &mesh, &mut |_| ());
    let sharp = by_rays(&scene, &mesh, &mut |_| ());
    let share = |p: &Arriving, wanted: fn(f32) -> bool| {
        p.values.iter().filter(|v| wanted(**v)).count() as f64 / p.values.len() as f64
    };
    for picture in [&soft, &sharp] {
        let [dark, lit] = [share(picture, |v| v < 0.01), share(picture, |v| v > 0.99)];
        assert!(dark > 0.03 && lit > 0.5 && dark + lit < 1.0, "{dark} {lit}");
    }
    let errors = soft.errors(&sharp).unwrap();
    // They differ at the shadow's edges only.
    assert!(errors.rms < 0.06 && errors.percentile_99 < 0.3, "{errors}");
    // A picture without shadow is far from both.
    let nothing = Arriving {
        values: vec![1.0; soft.values.len()],
        ..soft.clone()
    };
    assert!(nothing.errors(&sharp).unwrap().rms > 0.2);
}

/// What a technique is for: it is nearer to the rays than no shadow at all. More moments, and a second
/// warp, leave a tighter bound, so that less is too light. Maps of 32 bits. (Techniques of different kinds
/// have no such order: an exponential leaks less far from a caster, and more near it.)
#[test]
fn more_moments_and_warps_leak_less() {
    let (one, mesh) = scene("yard", 1024, "");
    let sharp = by_rays(&one, &mesh, &mut |_| ());
    let lit = Arriving {
        values: vec![1.0; sharp.values.len()],
        ..sharp.clone()
    };
    let without = lit.errors(&sharp).unwrap().rms;
    let error = |name: &str| {
        let maps = Technique::named(name).unwrap().maps;
        let map = maps.iter().find(|map| is_float(map)).unwrap();
        let format = map.format.name();
        let shadow = format!("technique = '{name}'\nformat = '{format}'");
        let (scene, mesh) = scene("yard", 1024, &shadow);
        let errors = technique_of(&scene, &mesh).errors(&sharp).unwrap();
        println!("{name}: {errors}; without shadow {without}");
        assert!(errors.rms < 0.8 * without, "{name}: {errors}");
        errors.wrongly_lit
    };
    let order = |names: &[&str]| {
        let errors: Vec<f64> = names.iter().map(|name| error(name)).collect();
        assert!(errors.is_sorted(), "{names:?}: {errors:?}");
    };
    order(&["hamburger-6", "hamburger", "vsm"]);
    order(&["moments-10", "moments-8", "moments-6", "moments-4"]);
    order(&["evsm4", "evsm2"]);
    order(&["tmsm"]);
    order(&["esm"]);
}

/// Terms of a Fourier series make the comparison steeper, so that less is too light. 8 bits, which its authors store,
/// are as good as 16.
#[test]
fn more_terms_of_a_series_leak_less() {
    let (one, mesh) = scene("yard", 1024, "");
    let sharp = by_rays(&one, &mesh, &mut |_| ());
    let lit = Arriving {
        values: vec![1.0; sharp.values.len()],
        ..sharp.clone()
    };
    let without = lit.errors(&sharp).unwrap();
    let errors = |shadow: &str| {
        let (scene, mesh) = scene("yard", 1024, shadow);
        let errors = technique_of(&scene, &mesh).errors(&sharp).unwrap();
        println!("{shadow}: {errors}; without shadow {without}");
        errors
    };
    let [four, eight] = ["convolution", "convolution-8"].map(|name| {
        let [coarse, fine] = ["rgba8unorm", "rgba16unorm"]
            .map(|format| errors(&format!("technique = '{name}'\nformat = '{format}'")));
        assert!((coarse.rms - fine.rms).abs() < 1e-3, "{name}");
        fine
    });
    assert!(eight.wrongly_lit < four.wrongly_lit && four.wrongly_lit < without.wrongly_lit);
    assert!(eight.rms < 0.9 * four.rms && four.rms < 0.85 * without.rms);
    assert!(eight.wrongly_dark < 0.01 && four.wrongly_dark < 0.01);
}

/// No light arrives at a surface that is turned from it, whatever a map or a ray says there: here at the ground, which
/// the light comes to from below.
#[test]
fn nothing_arrives_where_a_surface_is_turned_away() {
    for light in [
        "direction = [0.9, 0.05, -0.4]",
        "position = [-4.0, -0.6, 2.0]\ndirection = [0.9, 0.3, -0.4]\nangle = 90.0",
    ] {
        let text = format!(
            "[geometry]\nprocedural = 'box'\n[camera]\neye = [1.9, 1.6, 3.1]\ntarget = [-0.2, 0.2, -0.3]\n\
             [light]\n{light}\n[shadow]\ntechnique = 'pcf'\nsize = 64\n[output]\nwidth = 32\nheight = 18\n"
        );
        let scene = Scene::parse(&text, Path::new("test.toml")).unwrap_or_else(|e| panic!("{e}"));
        let mesh = scene.mesh().unwrap_or_else(|e| panic!("{e}"));
        let mut faced = mesh.clone();
        faced.normals.fill(-scene.lights[0].direction());
        let pictures = |mesh: &Mesh| {
            [
                technique_of(&scene, mesh),
                by_rays(&scene, mesh, &mut |_| ()),
                filtered(&scene, mesh, &mut |_| ()),
            ]
        };
        for (turned, faced) in pictures(&mesh).iter().zip(&pictures(&faced)) {
            let pairs = turned.values.iter().zip(&faced.values);
            // The ground that the box does not shade.
            let ground = pairs.filter(|(turned, faced)| **turned == 0.0 && **faced > 0.5);
            let count = ground.count();
            assert!(count > 50, "{light}: {count} of {}", turned.values.len());
        }
    }
}

/// Surfaces that shade themselves in the reference would count as light that the technique lets through.
#[test]
fn the_filtered_reference_of_errors_has_a_depth_bias() {
    let (scene, mesh) = scene("yard", 512, "technique = 'hamburger'");
    assert_eq!(scene.shadow.depth_bias, DepthBias::NONE);
    let measured = measure(&scene, &mesh, &mut Quiet).unwrap_or_else(|e| panic!("{e}"));
    let reported = measured.filtered.expect("the light is a point");
    let without = technique_of(&scene, &mesh)
        .errors(&filtered(&scene, &mesh, &mut |_| ()))
        .unwrap_or_else(|e| panic!("{e}"));
    println!("reported {reported}, without a bias {without}");
    assert!(reported.wrongly_lit < 0.5 * without.wrongly_lit);
}
