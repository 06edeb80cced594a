//! Mip levels of filtered maps: what they hold, and that pixels that see much of a map see its mean.

use std::path::Path;

use hankel_frames::graph::{Handle, Shape, Work};
use hankel_frames::scene::{Mesh, Scene};
use hankel_frames::truth::{Arriving, by_rays, by_technique};
use hankel_frames::{Clock, Executor, NoShaders, Quiet, Show, graph_of};
use hankel_host::device::NativeDevice;

/// The yard in a small picture, so that a pixel sees many texels.
fn scene(shadow: &str) -> (Scene, Mesh) {
    let text = format!(
        "[geometry]\nprocedural = 'yard'\n[camera]\neye = [7.4, 6.2, 12.4]\ntarget = [-0.2, 0.2, -0.3]\n\
         [light]\ndirection = [0.62, -0.62, 0.48]\n[shadow]\nleak_cut = 0.0\nfilter = 3\n{shadow}\n\
         [output]\nwidth = 64\nheight = 36\n"
    );
    let scene = Scene::parse(&text, Path::new("test.toml")).unwrap_or_else(|e| panic!("{e}"));
    let mesh = scene.mesh().unwrap_or_else(|e| panic!("{e}"));
    (scene, mesh)
}

/// Half of the texels of level to level, to the last of one; and all of one mean, for sizes that halve and for such
/// as leave a rest.
#[test]
fn each_level_has_the_mean_of_the_map() {
    for size in [64, 101] {
        let (scene, mesh) = scene(&format!(
            "format = 'rgba32float'\nsize = {size}\nmips = true"
        ));
        let (mut graph, ..) = graph_of(&scene, &mesh, Show::Light).unwrap();
        let is_levels = |work: &Work| matches!(work, Work::Levels(_));
        let pass = graph.passes().iter().find(|pass| is_levels(&pass.work));
        let made: Handle = pass.unwrap().writes[0];
        let Shape::Texture(shape) = graph.value(made).unwrap().shape else {
            panic!("levels are those of a texture");
        };
        assert_eq!(shape.levels, shape.most_levels());
        graph.keep(made);
        let mut device = NativeDevice::new();
        let mut executor = Executor::new(&mut device, &NoShaders, graph).unwrap();
        executor.run(Clock::Frame, &mut Quiet).unwrap();
        let texels: Vec<f32> = bytemuck::pod_collect_to_vec(&executor.read(made).unwrap());
        let mut first: Option<[f64; 4]> = None;
        for level in 0..shape.levels {
            let [width, height, _] = shape.level_size(level);
            let begin = shape.bytes_before(level) / 4;
            let count = width as usize * height as usize;
            let mut mean = [0.0; 4];
            for texel in texels[begin..begin + 4 * count].chunks_exact(4) {
                for (mean, x) in mean.iter_mut().zip(texel) {
                    *mean += f64::from(*x) / count as f64;
                }
            }
            let whole = first.get_or_insert(mean);
            for (a, b) in mean.iter().zip(whole) {
                assert!((a - *b).abs() < 1e-6, "{size}, level {level}: {mean:?}");
            }
        }
    }
}

/// A lower bound of more is looser, so what is wrongly lit grows with the part of the map that a pixel looks at, and
/// what is wrongly dark, because the one place that it looked at without levels is not typical, falls. With a long
/// footprint both are less than with a round one.
#[test]
fn pixels_that_see_much_of_a_map_take_its_mean() {
    let (one, mesh) = scene("");
    let rays = by_rays(&one, &mesh, &mut |_| ());
    for technique in ["hamburger", "hamburger-6", "evsm4"] {
        let errors = |mips: &str| {
            let (scene, mesh) = scene(&format!("technique = '{technique}'\nsize = 1024\n{mips}"));
            let picture: Arriving = by_technique(&scene, &mesh).unwrap_or_else(|e| panic!("{e}"));
            let errors = picture.errors(&rays).unwrap();
            println!("{technique}, {mips:?}: {errors}");
            errors
        };
        let without = errors("");
        let round = errors("mips = true");
        let long = errors("mips = true\nanisotropy = 16");
        assert!(round.wrongly_dark < without.wrongly_dark, "{technique}");
        assert!(long.wrongly_dark < round.wrongly_dark, "{technique}");
        assert!(long.rms < round.rms, "{technique}");
    }
}

/// What interpolates no map has no levels, and the plan says so.
#[test]
fn the_plan_says_where_there_are_no_levels() {
    for (technique, why) in [
        ("pcf", "interpolates no map"),
        ("pcf-gaussian", "interpolates no map"),
        (
            "hamburger-6'\nformat = 'rg32uint",
            "no sampler interpolates words",
        ),
    ] {
        let (scene, mesh) = scene(&format!("technique = '{technique}'\nmips = true"));
        let (graph, ..) = graph_of(&scene, &mesh, Show::Light).unwrap();
        let text = graph.summary().to_string();
        assert!(
            text.lines()
                .any(|line| line.starts_with("no mips: ") && line.contains(why)),
            "{text}"
        );
    }
}
