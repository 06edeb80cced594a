//! Image passes in both forms, compute and fragment: the same passes of the same kernels, and the same pictures.

mod common;

use std::collections::BTreeMap;
use std::path::Path;

use common::shaders;
use hankel_dsl::native::describe::TexelFormat;
use hankel_frames::graph::{Graph, ImagePasses, Shape, Work};
use hankel_frames::scene::Scene;
use hankel_frames::{Clock, Executor, NoShaders, Quiet, Shaders, Show, graph_of, techniques};
use hankel_host::device::slots;
use hankel_host::device::{Backend, open};
use hankel_host::parity::compare::Kind;

/// Scenes with every image pass: each technique with each of its maps, of four samples of depth and of one, mip levels,
/// glass, several lights, a medium.
fn scenes() -> Vec<(String, Scene)> {
    let plain = "procedural = 'box'";
    let mut all = Vec::new();
    let mut add = |geometry: &str, shadow: String, lights: &str| {
        let text = format!(
            r#"
            [geometry]
            {geometry}
            [camera]
            eye = [3.0, 3.0, 4.0]
            target = [0.0, 0.5, 0.0]
            {lights}
            [shadow]
            size = 128
            filter = 5
            {shadow}
            [output]
            width = 96
            height = 64
            "#
        );
        let scene = Scene::parse(&text, Path::new("test.toml"));
        all.push((
            format!("{geometry} {shadow} {lights}"),
            scene.unwrap_or_else(|e| panic!("{e}")),
        ));
    };
    let one = "[light]\ndirection = [-1.0, -2.0, -0.5]\nradius = 0.1";
    for technique in techniques::ALL {
        for map in technique.maps {
            let shadow = format!(
                "technique = '{}'\nformat = '{}'\ndepth_range = '{}'",
                technique.name,
                map.format.name(),
                map.depth_range.name()
            );
            add(plain, shadow.clone(), one);
            add(plain, format!("{shadow}\nmultisampling = 1"), one);
        }
    }
    for technique in ["hamburger", "convolution", "esm", "evsm4"] {
        add(
            plain,
            format!("technique = '{technique}'\nmips = true\nanisotropy = 4"),
            one,
        );
    }
    for (technique, format) in [
        ("hamburger", "rgba16unorm"),
        ("hamburger", "rgba32float"),
        ("hamburger-6", "rgba16unorm"),
        ("hamburger-6", "rgba32float"),
        ("hamburger-6", "r32uint"),
        ("hamburger-6", "rg32uint"),
    ] {
        for samples in [4, 1] {
            add(
                "procedural = 'glass'",
                format!(
                    "technique = '{technique}'\nformat = '{format}'\nmultisampling = {samples}"
                ),
                one,
            );
        }
    }
    add(
        plain,
        String::new(),
        "[[light]]\ndirection = [-1.0, -2.0, -0.5]\n[[light]]\ndirection = [1.0, -2.0, -0.5]",
    );
    let spot = "[light]\nposition = [2.0, 4.0, 1.0]\ndirection = [-2.0, -4.0, -1.0]";
    for light in [one, spot] {
        for samples in [4, 1] {
            let medium = "[medium]\nextinction = 0.2\ntechnique = 'ray-marching'\nsteps = 8";
            add(
                plain,
                format!("multisampling = {samples}"),
                &format!("{light}\n{medium}"),
            );
        }
    }
    all
}

/// A scene's graph with all that its image passes write to be kept, by the pass and its number.
fn kept(scene: &Scene, form: ImagePasses) -> Graph {
    let scene = Scene {
        image_passes: form,
        ..scene.clone()
    };
    let mesh = scene.mesh().unwrap_or_else(|e| panic!("{e}"));
    let (mut graph, ..) = graph_of(&scene, &mesh, Show::Picture).unwrap_or_else(|e| panic!("{e}"));
    let needed = graph.needed();
    let passes = graph.passes().iter().zip(needed);
    let written: Vec<_> = passes
        .filter(|(pass, needed)| *needed && is_image(&graph, &pass.work))
        .flat_map(|(pass, _)| pass.writes.clone())
        .collect();
    written.into_iter().for_each(|handle| graph.keep(handle));
    graph
}

/// Whether a pass has a fragment form, or is one.
fn is_image(graph: &Graph, work: &Work) -> bool {
    match work {
        Work::FullScreen { .. } => true,
        Work::Compute(call) => graph.kernels()[call.kernel]
            .kernel
            .fragment_form()
            .is_some(),
        _ => false,
    }
}

/// What all image passes of a graph write, with labels and formats.
fn run(
    graph: &Graph,
    backend: Backend,
    shaders: &dyn Shaders,
) -> Vec<(String, TexelFormat, Vec<u8>)> {
    let mut device = open(backend).unwrap_or_else(|e| panic!("{e}"));
    let mut executor =
        Executor::new(&mut *device, shaders, graph.clone()).unwrap_or_else(|e| panic!("{e}"));
    executor
        .run(Clock::Frame, &mut Quiet)
        .unwrap_or_else(|e| panic!("{e}"));
    let kept = graph.kept().to_vec();
    kept.into_iter()
        .map(|handle| {
            let value = graph.value(handle).expect("a value");
            let Shape::Texture(shape) = value.shape else {
                panic!("{}: a buffer", value.label);
            };
            let bytes = executor.read(handle).unwrap_or_else(|e| panic!("{e}"));
            (value.label.to_string(), shape.format.texel(), bytes)
        })
        .collect()
}

/// The most steps of its format that channels of two textures are apart.
fn steps(format: TexelFormat, a: &[u8], b: &[u8]) -> u64 {
    let kind = Kind::of(format);
    assert_eq!(a.len(), b.len());
    let channels = a
        .chunks_exact(kind.bytes())
        .zip(b.chunks_exact(kind.bytes()));
    channels
        .map(|(a, b)| kind.compare(a, b, true).ulp)
        .max()
        .unwrap_or_default()
}

/// A fragment form is there, and has the parameters and as many outputs as each of its compute forms; the
/// shader of a fragment form has no format.
#[test]
fn forms_have_the_same_parameters() {
    let kernels = hankel_shadows::entries();
    let mut forms: BTreeMap<&str, usize> = BTreeMap::new();
    for compute in kernels.iter().map(|entry| &entry.kernel) {
        let Some(name) = compute.fragment_form() else {
            continue;
        };
        let found = kernels.iter().find(|entry| entry.kernel.name == name);
        let fragment = &found.unwrap_or_else(|| panic!("there is no {name}")).kernel;
        assert!(fragment.is_fragment_form(), "{name}");
        assert_eq!(compute.params, fragment.params, "{name}");
        assert_eq!(compute.outputs.len(), fragment.outputs.len(), "{name}");
        let has_texels =
            |slot: &slots::Slot<'_>| matches!(slot.role, slots::Use::StorageTexture { .. });
        assert!(!slots::slots(fragment).iter().any(has_texels), "{name}");
        *forms.entry(name).or_default() += 1;
    }
    let all = kernels.iter().filter(|e| e.kernel.is_fragment_form());
    assert_eq!(all.count(), forms.len(), "each is somebody's form");
    // One for all formats.
    assert_eq!(forms["blur_fragment"], 7);
}

/// In the fragment form nothing that has one is computed, and no texture is stored to but by other passes.
#[test]
fn image_passes_are_drawn() {
    for (name, scene) in scenes() {
        let [compute, fragment] = ImagePasses::ALL.map(|form| kept(&scene, form));
        let drawn = |graph: &Graph| {
            let works = graph.passes().iter().map(|pass| &pass.work);
            works
                .filter(|work| matches!(work, Work::FullScreen { .. }))
                .count()
        };
        assert_eq!(drawn(&compute), 0, "{name}");
        let images = compute
            .passes()
            .iter()
            .filter(|pass| is_image(&compute, &pass.work));
        assert_eq!(drawn(&fragment), images.count(), "{name}");
        let left = fragment
            .passes()
            .iter()
            .filter_map(|pass| match &pass.work {
                Work::Compute(call) => Some(&fragment.kernels()[call.kernel].kernel),
                _ => None,
            });
        for kernel in left {
            assert!(kernel.fragment_form().is_none(), "{name}: {}", kernel.name);
            let what = format!("fragment form of `{}`", kernel.name);
            assert!(fragment.omitted().iter().any(|o| o.what == what), "{what}");
        }
    }
}

/// Natively both forms are one body: the same bits.
#[test]
fn both_forms_are_the_same_natively() {
    let mut drawn = 0;
    for (name, scene) in scenes() {
        let [compute, fragment] =
            ImagePasses::ALL.map(|form| run(&kept(&scene, form), Backend::Native, &NoShaders));
        assert_eq!(compute.len(), fragment.len(), "{name}");
        for ((label, _, a), (_, _, b)) in compute.iter().zip(&fragment) {
            assert!(a == b, "{name}: {label}");
            assert!(a.iter().any(|byte| *byte != 0), "{name}: {label} is empty");
            drawn += 1;
        }
    }
    assert!(drawn > 50, "{drawn}");
}

/// What a rasteriser stores is what a storage texture holds, within a step of the format: either may round a tie
/// up or down, and what one pass rounds another filters.
#[test]
fn both_forms_agree_on_vulkan() {
    let shaders = shaders();
    let mut formats = std::collections::BTreeSet::new();
    for (name, scene) in scenes() {
        let [compute, fragment] =
            ImagePasses::ALL.map(|form| run(&kept(&scene, form), Backend::Vulkan, &shaders));
        assert_eq!(compute.len(), fragment.len(), "{name}");
        for ((label, format, a), (_, other, b)) in compute.iter().zip(&fragment) {
            assert_eq!(format, other, "{name}: {label}");
            let apart = steps(*format, a, b);
            println!("{label} {}: {apart} steps apart", format.name());
            let is_whole = matches!(Kind::of(*format), Kind::Scalar(_));
            let most = if is_whole { 0 } else { 1 };
            assert!(apart <= most, "{name}: {label}: {apart} steps");
            formats.insert(format.name());
        }
    }
    for format in [
        "r32float",
        "r32uint",
        "rg16float",
        "rg16unorm",
        "rg32float",
        "rg32uint",
        "rgba16float",
        "rgba16unorm",
        "rgba32float",
        "rgba8unorm",
    ] {
        assert!(formats.contains(format), "{formats:?}");
    }
}

/// The native picture and that of Vulkan, both with drawn image passes.
#[test]
fn drawn_pictures_agree() {
    let (_, scene) = scenes().swap_remove(0);
    let scene = Scene {
        image_passes: ImagePasses::Fragment,
        ..scene
    };
    let comparison = hankel_frames::compare(&scene, &shaders(), 16, &mut Quiet);
    let comparison = comparison.unwrap_or_else(|e| panic!("{e}"));
    assert!(
        comparison.difference.over_1 <= comparison.limit(),
        "{}",
        comparison.difference
    );
    let plan = comparison.native.plan.to_string();
    assert!(plan.contains("full_screen and blur_fragment"), "{plan}");
}

/// Without the kernels of the fragment forms, the graph says which one is missing.
#[test]
fn a_form_that_is_not_there_is_named() {
    let (_, scene) = scenes().swap_remove(0);
    let mesh = scene.mesh().unwrap_or_else(|e| panic!("{e}"));
    let (graph, ..) = graph_of(&scene, &mesh, Show::Picture).unwrap_or_else(|e| panic!("{e}"));
    let resolve = graph.passes().iter().find_map(|pass| match &pass.work {
        Work::Compute(call) => Some(call.kernel),
        _ => None,
    });
    let kernel = resolve.expect("a compute pass");
    let name = graph.kernels()[kernel]
        .kernel
        .fragment_form()
        .map(str::to_owned);
    let name = name.expect("it has a fragment form");
    let mut kernels = hankel_shadows::entries();
    kernels.retain(|entry| entry.kernel.name != name);
    let mut alone = Graph::new(kernels);
    let depth = hankel_host::device::TextureShape::depth(8, 8).multisampled(4);
    let depth = alone.cleared("depth", depth);
    let compute = graph.kernels()[kernel].kernel.name.clone();
    let resolved = alone.compute("resolve", compute).arg("depth", depth);
    resolved.image([8, 8]).unwrap_or_else(|e| panic!("{e}"));
    let error = alone.set_image_passes(ImagePasses::Fragment).unwrap_err();
    let error = error.to_string();
    assert!(
        error.contains(&format!("kernel `{name}`: there is no such kernel")),
        "{error}"
    );
}

/// Times of both forms on Vulkan, in rounds that take turns: the same passes, each with a time.
#[test]
fn both_forms_are_timed() {
    let text = r#"
        [geometry]
        procedural = 'box'
        [camera]
        eye = [3.0, 3.0, 4.0]
        target = [0.0, 0.5, 0.0]
        [light]
        direction = [-1.0, -2.0, -0.5]
        [shadow]
        size = 1024
        filter = 9
        mips = true
        "#;
    let shaders = shaders();
    for map in ["rgba16unorm", "rgba32float"] {
        let text = format!("{text}\nformat = '{map}'\n[output]\nwidth = 96\nheight = 64\n");
        let scene = Scene::parse(&text, Path::new("test.toml")).unwrap_or_else(|e| panic!("{e}"));
        let mut devices =
            ImagePasses::ALL.map(|_| open(Backend::Vulkan).unwrap_or_else(|e| panic!("{e}")));
        let mut executors: Vec<Executor<'_>> = devices
            .iter_mut()
            .zip(ImagePasses::ALL)
            .map(|(device, form)| {
                let made = Executor::new(&mut **device, &shaders, kept(&scene, form));
                let mut executor = made.unwrap_or_else(|e| panic!("{e}"));
                executor.steady(1).unwrap_or_else(|e| panic!("{e}"));
                executor
            })
            .collect();
        // By pass, mip levels as one, and form: the seconds of each round.
        let mut times: BTreeMap<String, [Vec<f64>; 2]> = BTreeMap::new();
        for round in 0..5 {
            for (form, executor) in executors.iter_mut().enumerate() {
                let timings = executor.steady(1).unwrap_or_else(|e| panic!("{e}"));
                for timing in timings {
                    let all = times.entry(timing.name).or_default();
                    all[form].resize(round + 1, 0.0);
                    all[form][round] += timing.seconds;
                }
            }
        }
        for (pass, forms) in times {
            let median = |mut seconds: Vec<f64>| {
                seconds.sort_by(f64::total_cmp);
                seconds[seconds.len() / 2]
            };
            let [compute, fragment] = forms.map(median);
            assert!(
                compute > 0.0 && fragment > 0.0,
                "{pass}: {compute} {fragment}"
            );
            println!(
                "{map} {pass}: {:.1} ms computed, {:.1} ms drawn",
                compute * 1e3,
                fragment * 1e3
            );
        }
    }
}
