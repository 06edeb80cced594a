//! Exported frames: what `build --scene` writes is played by a program that knows nothing of
//! Hankel, and gives the picture of `render`.

mod desk;

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;
use std::process::Command;

use desk::Desk;
use hankel_codegen::spirv::words;
use hankel_codegen::{finish, frame};
use hankel_example_player::{Picture, Player};
use hankel_frames::techniques;
use serde_json::Value;

const SCENE: &str = r#"
[geometry]
procedural = "box"
[camera]
eye = [3.0, 3.0, 4.0]
target = [0.0, 0.5, 0.0]
[light]
direction = [-1.0, -2.0, -0.5]
radius = 0.1
[shadow]
size = 128
filter = 5
[output]
width = 96
height = 64
"#;

/// Share of the pixels that may differ by more than 1/255. SPIR-V forbids drivers to contract sums where
/// a kernel asks for it, WGSL cannot, and where a bound is steep the last bit shows: in this scene with
/// `soft` 0.3 % of the pixels differ, and 0.7 % between the native picture and that of Vulkan.
const ROUNDED: f64 = 0.005;

fn json(desk: &Desk, file: &str) -> Value {
    serde_json::from_str(&desk.read(file)).expect("it is JSON")
}

/// What a player makes of a folder.
fn played(desk: &Desk, folder: &str) -> Picture {
    let mut player = Player::open(&desk.path(folder)).unwrap_or_else(|e| panic!("{folder}: {e}"));
    player.run().unwrap_or_else(|e| panic!("{folder}: {e}"));
    player.picture().expect("a picture")
}

/// What `render` makes of a scene.
fn rendered(desk: &Desk, scene: &str, options: &str) -> Picture {
    desk.hankel(&format!(
        "render {scene} --out r.png --backend vulkan {options}"
    ))
    .code(0);
    Picture::read(&desk.path("r.png")).expect("a picture")
}

/// The share of pixels that differ by more than 1/255, and the largest difference.
fn compare(a: &Picture, b: &Picture) -> (f64, u8) {
    assert_eq!((a.width, a.height), (b.width, b.height));
    let pairs = a.pixels.chunks_exact(3).zip(b.pixels.chunks_exact(3));
    let differences = pairs.map(|(a, b)| {
        let channels = a.iter().zip(b).map(|(a, b)| a.abs_diff(*b));
        channels.max().unwrap_or_default()
    });
    let differences: Vec<u8> = differences.collect();
    let over = differences.iter().filter(|d| **d > 1).count();
    let largest = differences.iter().copied().max().unwrap_or_default();
    (over as f64 / differences.len() as f64, largest)
}

fn difference(a: &Picture, b: &Picture) -> f64 {
    compare(a, b).0
}

/// Every technique with every one of its maps gives the picture that `render` gives.
#[test]
fn a_player_that_knows_no_hankel_draws_the_same() {
    let desk = Desk::new();
    let mut kinds = BTreeSet::new();
    let mut wrong = Vec::new();
    for technique in techniques::ALL {
        for map in technique.maps {
            let name = technique.name;
            let (format, range) = (map.format.name(), map.depth_range.name());
            let map = format!(
                "[shadow]\ntechnique = \"{name}\"\nformat = \"{format}\"\ndepth_range = \"{range}\""
            );
            desk.write("scene.toml", SCENE.replace("[shadow]", &map));
            desk.hankel("build --scene scene.toml --out frame --target wgsl")
                .code(0);
            let expected = rendered(&desk, "scene.toml", "");
            let picture = played(&desk, "frame");
            let (share, largest) = compare(&picture, &expected);
            let told = format!(
                "{name} {format} {range}: {:.3} % of the pixels differ by more than 1/255, the most by {largest}",
                share * 100.0
            );
            println!("{told}");
            if share > ROUNDED {
                wrong.push(told);
            }
            // It is a picture of something.
            let colours: BTreeSet<&[u8]> = picture.pixels.chunks_exact(3).collect();
            assert!(colours.len() > 20, "{name}: {} colours", colours.len());
            let passes = json(&desk, "frame/frame.json")["passes"].clone();
            for pass in passes.as_array().expect("a list") {
                kinds.insert(pass["kind"].as_str().expect("a word").to_owned());
            }
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
    assert!(
        kinds.contains("compute") && kinds.contains("draw"),
        "{kinds:?}"
    );
}

/// The levels of a map are copied together, and looked up.
#[test]
fn mip_levels_are_played() {
    let desk = Desk::new();
    for technique in ["hamburger", "hamburger-6", "esm"] {
        let shadow = format!("[shadow]\ntechnique = \"{technique}\"\nmips = true\nanisotropy = 4");
        desk.write("scene.toml", SCENE.replace("[shadow]", &shadow));
        desk.hankel("build --scene scene.toml --out frame --target wgsl")
            .code(0);
        let expected = rendered(&desk, "scene.toml", "");
        let (share, largest) = compare(&played(&desk, "frame"), &expected);
        assert!(
            share <= ROUNDED,
            "{technique}: {share}, the most by {largest}"
        );
        let frame = json(&desk, "frame/frame.json");
        assert_eq!(frame["shadow"]["anisotropy"], 4);
        let passes = frame["passes"].as_array().expect("a list");
        let levels = passes.iter().find(|pass| pass["kind"] == "levels");
        // 128 x 128 texels to one.
        let levels = levels.expect("levels")["levels"].as_array().map(Vec::len);
        assert_eq!(levels, Some(8), "{technique}");
    }
}

/// Image passes are drawn: nothing is computed, no texture is stored to, and the picture is the same.
#[test]
fn image_passes_are_played_as_draws() {
    let desk = Desk::new();
    for (technique, format) in [
        ("hamburger", "rgba16unorm"),
        ("hamburger-6", "rg32uint"),
        ("hamburger-6", "r32uint"),
        ("vsm", "rg16unorm"),
        ("vsm", "rg32float"),
        ("evsm2", "rg16float"),
        ("evsm4", "rgba16float"),
        ("convolution", "rgba8unorm"),
        ("esm", "r32float"),
    ] {
        let shadow = format!("[shadow]\ntechnique = \"{technique}\"\nformat = \"{format}\"");
        desk.write("scene.toml", SCENE.replace("[shadow]", &shadow));
        let build = "build --scene scene.toml --target wgsl --out";
        desk.hankel(&format!("{build} computed")).code(0);
        desk.hankel(&format!("{build} drawn --image-passes fragment"))
            .code(0);
        let (share, largest) = compare(&played(&desk, "drawn"), &played(&desk, "computed"));
        assert!(
            share == 0.0,
            "{technique} {format}: {share} of the pixels, the most by {largest}"
        );
        let drawn = rendered(&desk, "scene.toml", "--image-passes fragment");
        let (share, largest) = compare(&played(&desk, "drawn"), &drawn);
        assert!(
            share <= ROUNDED,
            "{technique} {format}: {share} of the pixels, the most by {largest}"
        );
        let frame = json(&desk, "drawn/frame.json");
        assert_eq!(frame["image_passes"], "fragment");
        let kinds = |frame: &Value| -> Vec<String> {
            let passes = frame["passes"].as_array().expect("a list").iter();
            let kind = |pass: &Value| pass["kind"].as_str().expect("a word").to_owned();
            passes.map(kind).collect()
        };
        let computed = kinds(&json(&desk, "computed/frame.json"));
        let drawn: Vec<&str> = computed
            .iter()
            .map(|kind| {
                if kind == "draw" {
                    "draw"
                } else {
                    "full-screen"
                }
            })
            .collect();
        assert_eq!(kinds(&frame), drawn, "{technique} {format}");
        // Resolve, and the filter along rows and columns, of each texture of the map.
        assert!(drawn.len() >= 5 && drawn.contains(&"full-screen"));
        let text = desk.read("drawn/frame.json");
        assert!(!text.contains("storage-binding"), "{technique} {format}");
        assert!(desk.read("computed/frame.json").contains("storage-binding"));
        // The folder says itself which form it has.
        desk.hankel("check drawn --scene scene.toml").code(0);
    }
    desk.hankel("build --scene scene.toml --out d --image-passes vertex")
        .code(2);
}

/// Techniques whose passes write or read buffers at any place, which WebGL 2 cannot.
const WITH_BUFFERS: [&str; 5] = [
    "soft",
    "soft-6",
    "vssm",
    "hamburger-tiles",
    "pcf-gaussian-tiles",
];

/// A frame of depths with one sample, and drawn image passes, has all of its shaders in WebGL 2's language, and is
/// played.
#[test]
fn frames_of_single_samples_are_all_in_webgl_2() {
    let desk = Desk::new();
    let techniques = techniques::ALL.iter();
    for technique in techniques.filter(|t| !WITH_BUFFERS.contains(&t.name)) {
        for map in technique.maps {
            let (name, format) = (technique.name, map.format.name());
            let range = map.depth_range.name();
            let shadow = format!(
                "[shadow]\ntechnique = \"{name}\"\nformat = \"{format}\"\ndepth_range = \"{range}\"\nmultisampling = 1"
            );
            desk.write("scene.toml", SCENE.replace("[shadow]", &shadow));
            let options = "--target wgsl --target essl300 --image-passes fragment";
            desk.hankel(&format!("build --scene scene.toml --out frame {options}"))
                .code(0);
            let frame = json(&desk, "frame/frame.json");
            assert_eq!(frame["shadow"]["multisampling"], 1);
            for (shader, said) in frame["shaders"].as_object().expect("shaders") {
                let why = &said["unsupported"]["essl300"];
                // Three targets of 16 bytes are more than every device draws into: it is computed.
                let is_computed = name.starts_with("moments-10") && shader.starts_with("resolve");
                assert_eq!(why.is_null(), !is_computed, "{name}: {shader}: {why}");
            }
            let expected = rendered(&desk, "scene.toml", "--image-passes fragment");
            let (share, largest) = compare(&played(&desk, "frame"), &expected);
            assert!(
                share <= ROUNDED,
                "{name} {format}: {share} of the pixels, the most by {largest}"
            );
        }
    }
    let medium = "[medium]\nextinction = 0.2\ntechnique = \"ray-marching\"\nsteps = 16\n";
    let spot = SCENE.replace("[light]", "[light]\nposition = [0.0, 3.0, 0.0]");
    for scene in [SCENE, &spot] {
        let scene = scene.replace("[shadow]", "[shadow]\nmultisampling = 1");
        desk.write("scene.toml", scene + medium);
        let options = "--target wgsl --target essl300 --image-passes fragment";
        desk.hankel(&format!("build --scene scene.toml --out frame {options}"))
            .code(0);
        let frame = json(&desk, "frame/frame.json");
        for (shader, said) in frame["shaders"].as_object().expect("shaders") {
            let why = &said["unsupported"]["essl300"];
            assert!(why.is_null(), "{shader}: {why}");
        }
        let expected = rendered(&desk, "scene.toml", "--image-passes fragment");
        let (share, largest) = compare(&played(&desk, "frame"), &expected);
        assert!(
            share <= ROUNDED,
            "{share} of the pixels, the most by {largest}"
        );
    }
}

/// A browser plays such frames with WebGL 2, in the texts of that language.
#[test]
fn frames_of_single_samples_are_played_in_webgl_2() {
    let desk = Desk::new();
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    let chromium = std::env::var_os("HANKEL_CHROMIUM").unwrap_or_else(|| "chromium".into());
    let medium = "[medium]\nextinction = 0.2\ntechnique = \"ray-marching\"\nsteps = 16\n";
    for (technique, format, more, rest) in [
        // Chromium has no textures of 16-bit channels on SwiftShader.
        ("hamburger", "rgba32float", "", ""),
        (
            "hamburger",
            "rgba32float",
            "mips = true\nanisotropy = 4\n",
            "",
        ),
        ("hamburger", "rgba32float", "", medium),
        ("hamburger-6", "rg32uint", "", ""),
        ("hamburger-6", "r32uint", "", ""),
        ("vsm", "rg32float", "", ""),
        ("evsm2", "rg16float", "", ""),
        ("evsm4", "rgba16float", "", ""),
        ("convolution", "rgba8unorm", "", ""),
        ("esm", "r32float", "", ""),
        ("pcf", "r32float", "", ""),
        ("pcf-gaussian", "r32float", "", ""),
        ("pcss", "r32float", "", ""),
    ] {
        let shadow = format!(
            "[shadow]\ntechnique = \"{technique}\"\nformat = \"{format}\"\nmultisampling = 1\n{more}"
        );
        desk.write("scene.toml", SCENE.replace("[shadow]", &shadow) + rest);
        let options = "--target essl300 --image-passes fragment";
        desk.hankel(&format!("build --scene scene.toml --out frame {options}"))
            .code(0);
        let expected = rendered(&desk, "scene.toml", "--image-passes fragment");
        let page = here.join("../examples/player/webgl");
        let played = Command::new("node")
            .arg(here.join("../examples/chromium.mjs"))
            .args([chromium.as_os_str(), desk.path("").as_os_str()])
            .arg(format!("page={}", page.display()))
            .arg(format!("frame={}", desk.path("frame").display()))
            .output()
            .expect("node starts");
        let said = String::from_utf8_lossy(&played.stderr);
        assert!(played.status.success(), "{technique} {format}: {said}");
        let light = fs::read(desk.path("picture.bin")).expect("the page has posted it");
        let light: Vec<f32> = light
            .chunks_exact(4)
            .map(|it| f32::from_le_bytes([it[0], it[1], it[2], it[3]]))
            .collect();
        let picture = Picture::of_linear(expected.width, expected.height, &light);
        let (share, largest) = compare(&picture.expect("all of its pixels"), &expected);
        println!(
            "{technique} {format} {more:?} {rest:?}: {share} of the pixels, the most by {largest}"
        );
        assert!(
            share <= ROUNDED,
            "{technique} {format} {more:?} {rest:?}: {share} of the pixels, the most by {largest}"
        );
    }
}

/// What is blended, kept sample by sample, or scattered on the way to the camera, is played too.
#[test]
fn glass_and_a_medium_are_played() {
    let desk = Desk::new();
    let glass = SCENE.replace("procedural = \"box\"", "procedural = \"glass\"");
    let medium = |technique: &str| {
        format!("{SCENE}[medium]\nextinction = 0.2\ntechnique = \"{technique}\"\n")
    };
    let mut wrong = Vec::new();
    for (what, shadow, scene) in [
        ("glass", "hamburger", glass.clone()),
        ("glass", "pcf", glass),
        ("medium", "hamburger", medium("prefiltered")),
        ("medium", "pcf", medium("ray-marching")),
        (
            "medium",
            "pcf",
            medium("ray-marching").replace("[light]", "[light]\nposition = [0.0, 3.0, 0.0]"),
        ),
    ] {
        let shadow = format!("[shadow]\ntechnique = \"{shadow}\"");
        let scene = scene.replace("[shadow]", &shadow);
        desk.write("scene.toml", scene);
        desk.hankel("build --scene scene.toml --out frame --target wgsl")
            .code(0);
        let expected = rendered(&desk, "scene.toml", "");
        let (share, largest) = compare(&played(&desk, "frame"), &expected);
        let told = format!("{what}, {shadow}: {share} of the pixels, the most by {largest}");
        println!("{told}");
        if share > ROUNDED {
            wrong.push(told);
        }
        let frame = desk.read("frame/frame.json");
        assert_eq!(frame.contains("\"blend\""), what == "glass", "{what}");
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}

/// An engine has its own camera: with other numbers in the uniform's fields, the picture is that of the
/// scene with the other camera.
#[test]
fn uniforms_are_replaced_by_meaning() {
    let desk = Desk::new();
    let moved = SCENE.replace("eye = [3.0, 3.0, 4.0]", "eye = [-2.0, 2.5, 4.5]");
    desk.write("scene.toml", SCENE);
    desk.write("moved.toml", &moved);
    for scene in ["scene", "moved"] {
        desk.hankel(&format!(
            "build --scene {scene}.toml --out {scene} --target wgsl --technique hamburger"
        ))
        .code(0);
    }
    let other = json(&desk, "moved/frame.json");
    let uniform = &other["uniforms"]["camera"];
    let meaning = uniform["meaning"].as_str().expect("words");
    assert!(meaning.contains("clip space of the picture"), "{meaning}");
    let mut player = Player::open(&desk.path("scene")).expect("a frame");
    player.run().expect("it runs");
    for field in uniform["fields"].as_array().expect("fields") {
        assert!(!field["meaning"].as_str().expect("words").is_empty());
        let name = field["name"].as_str().expect("a name");
        player
            .set("camera", name, &field["value"])
            .expect("a field");
    }
    let before = player.picture().expect("a picture");
    player.run().expect("it runs again");
    let picture = player.picture().expect("a picture");
    assert!(difference(&before, &picture) > 0.1);
    let expected = rendered(&desk, "moved.toml", "--technique hamburger");
    assert!(difference(&picture, &expected) <= ROUNDED);
    let wrong = player.set("camera", "row_x", &Value::from(1.0));
    assert!(wrong.unwrap_err().contains("vec4<f32>"));
    assert!(player.set("camera", "row_q", &Value::from(1.0)).is_err());
}

/// The file follows its schema, and what it says of itself holds.
#[test]
fn the_file_follows_its_schema() {
    let committed = include_str!("../../codegen/frame.schema.json");
    assert_eq!(
        committed,
        frame::schema(),
        "cargo run -p hankel-codegen --example schema -- frame > codegen/frame.schema.json"
    );
    let schema = serde_json::from_str(committed).expect("JSON");
    let validator = jsonschema::validator_for(&schema).expect("a schema");
    let desk = Desk::new();
    desk.write("scene.toml", SCENE);
    for technique in ["hamburger", "pcf", "soft", "vssm"] {
        desk.hankel(&format!(
            "build --scene scene.toml --technique {technique} --out frame"
        ))
        .code(0);
        let it = json(&desk, "frame/frame.json");
        let problems: Vec<String> = validator.iter_errors(&it).map(|e| e.to_string()).collect();
        assert!(problems.is_empty(), "{problems:#?}");
        let mut broken = it.clone();
        broken["passes"][0]["kind"] = "guess".into();
        assert!(!validator.is_valid(&broken));
        broken = it.clone();
        broken["buffers"]["positions"]["bytes"] = "many".into();
        assert!(!validator.is_valid(&broken));

        let text = desk.read("frame/frame.json");
        assert!(
            !text.contains("/tmp") && !text.contains("/home"),
            "nothing of the machine"
        );
        for buffer in it["buffers"].as_object().expect("buffers").values() {
            if let Some(file) = buffer["contents"].as_str() {
                let bytes = fs::metadata(desk.path("frame").join(file))
                    .expect("a file")
                    .len();
                assert_eq!(Some(bytes), buffer["bytes"].as_u64(), "{file}");
            }
        }
        let manifest = json(&desk, "frame/manifest.json");
        let shaders = it["shaders"].as_object().expect("shaders");
        assert_eq!(
            manifest["kernels"].as_object().expect("kernels").len(),
            shaders.len()
        );
        for (name, shader) in shaders {
            assert_eq!(
                shader["bindings"], manifest["kernels"][name]["bindings"],
                "{name}"
            );
            for language in shader["languages"].as_object().expect("languages").values() {
                let file = language["file"].as_str().expect("a path");
                assert!(manifest["files"][file].is_object(), "{file}");
            }
            // Constants are frozen: WGSL has nothing to set, and SPIR-V neither.
            let wgsl = desk.read(&format!("frame/wgsl/{name}.wgsl"));
            assert!(!wgsl.contains("override"), "{name}");
            let spirv = fs::read(desk.path(&format!("frame/spirv/{name}.spv"))).expect("a module");
            let spirv = words(&spirv, name).expect("SPIR-V");
            finish::validate(&spirv, name).expect("valid SPIR-V");
            // The set that is said is the one in the module: OpDecorate … DescriptorSet.
            let sets: BTreeSet<u32> = decorations(&spirv, 34).collect();
            let fragment = shader["stage"] == "fragment";
            assert!(
                sets.iter().all(|set| *set == u32::from(fragment)),
                "{name}: {sets:?}"
            );
        }
    }
}

/// Numbers of a decoration in a module.
fn decorations(words: &[u32], decoration: u32) -> impl Iterator<Item = u32> {
    let mut rest = &words[5..];
    std::iter::from_fn(move || {
        let [first, ..] = rest else { return None };
        let (now, next) = rest.split_at((first >> 16) as usize);
        rest = next;
        Some(now)
    })
    .filter_map(move |it| match it {
        [first, _, kind, number] if first & 0xffff == 71 && *kind == decoration => Some(*number),
        _ => None,
    })
}

/// The folder is one of a build: checked, kept from what others wrote, and cleared by the next build.
#[test]
fn the_folder_obeys_the_rules_of_builds() {
    let desk = Desk::new();
    desk.write("scene.toml", SCENE);
    let options = "--scene scene.toml --target wgsl --target hlsl";
    let out = desk
        .hankel(&format!("build {options} --out frame"))
        .code(0)
        .out();
    assert!(out.contains("frame.json: 5 passes"), "{out}");
    let again = desk.hankel(&format!("build {options} --out frame --depfile f.d"));
    assert!(
        again.code(0).out().contains(" 0 files written"),
        "{}",
        again.out()
    );
    assert!(desk.read("f.d").contains("scene.toml"));
    desk.hankel(&format!("check frame {options}")).code(0);
    desk.hankel("check frame")
        .fails(2, &["holds a frame", "--scene"]);
    // Another scene, another frame.
    desk.write("scene.toml", SCENE.replace("filter = 5", "filter = 7"));
    let differs = desk.hankel(&format!("check frame {options}")).code(1).out();
    assert!(
        differs.contains("frame.json") && differs.contains("-    \"filter\": 5"),
        "{differs}"
    );
    desk.write("scene.toml", SCENE);

    let positions = desk.path("frame/frame/positions.bin");
    fs::write(&positions, "mine").expect("it is there");
    desk.hankel(&format!("build {options} --out frame"))
        .fails(2, &["positions.bin", "edited since", "--force"]);
    desk.hankel(&format!("build {options} --out frame --force"))
        .code(0);
    fs::write(desk.path("frame/frame/extra.bin"), "mine").expect("a file");
    let extra = desk.hankel(&format!("check frame {options}")).code(1).out();
    assert!(
        extra.contains("not from the sources: frame/extra.bin"),
        "{extra}"
    );
    fs::remove_file(desk.path("frame/frame/extra.bin")).expect("it is there");

    desk.hankel("build --out frame --kernel vsm --target wgsl")
        .code(0);
    assert!(!desk.path("frame/frame.json").exists() && !desk.path("frame/frame").exists());
    assert!(!desk.path("frame/wgsl/shade_hamburger.wgsl").exists());
    assert!(desk.path("frame/wgsl/vsm.wgsl").is_file());
}

/// What a plan chose is in the file, so that the folder can be checked though times vary.
#[test]
fn a_planned_frame_can_be_checked() {
    let desk = Desk::new();
    desk.write("scene.toml", SCENE);
    let auto =
        "--scene scene.toml --technique auto --size 64 --filter 1 --fit camera --target wgsl";
    let out = desk
        .hankel(&format!("build {auto} --error 0.3 --out frame"))
        .code(0)
        .out();
    assert!(out.contains("predicted: error 0."), "{out}");
    assert_eq!(json(&desk, "frame/frame.json")["shadow"]["size"], 64);
    desk.hankel("check frame --scene scene.toml --technique auto --target wgsl")
        .code(0);
    desk.hankel(&format!("build {auto} --error 0.000001 --out none"))
        .fails(1, &["nothing has an error of at most"]);
    assert!(!desk.path("none").exists());
}

/// Options that say what the frame says, or nothing of it.
#[test]
fn options_that_make_no_sense_together_are_refused() {
    let desk = Desk::new();
    desk.write("scene.toml", SCENE);
    let build = "build --scene scene.toml --out frame";
    for (options, words) in [
        ("--kernel vsm", "--kernel does not go with --scene"),
        ("--set encoding=1", "--set does not go with --scene"),
        (
            "--variant _a:encoding=1",
            "--variant does not go with --scene",
        ),
        (
            "--open-constants",
            "--open-constants does not go with --scene",
        ),
        (
            "--manifest-path x/Cargo.toml",
            "--manifest-path does not go with --scene",
        ),
        (
            "--form functions",
            "--form functions does not go with --scene",
        ),
        ("--watch", "--watch does not go with --scene"),
        ("--technique magic", "no technique magic"),
        ("--technique auto", "needs --error"),
        ("--size 64", "need --technique auto"),
        ("--wgsl-group 255", "fragment shaders need the next one"),
    ] {
        desk.hankel(&format!("{build} {options}"))
            .fails(2, &[words]);
    }
    desk.hankel("build --out frame --size 64")
        .fails(2, &["--scene"]);
    desk.hankel("build --out frame --technique vsm")
        .fails(2, &["--scene"]);
    desk.hankel("build --scene nowhere.toml --out frame")
        .fails(2, &["nowhere.toml"]);
    desk.write(
        "places.toml",
        "[shade_hamburger.light]\nwgsl = { group = 0, binding = 0 }\n",
    );
    desk.hankel(&format!("{build} --bindings places.toml"))
        .fails(
            2,
            &[
                "pass `shade`",
                "`camera`",
                "`light`",
                "the same place in WGSL",
            ],
        );
    assert!(!desk.path("frame").exists());
    // A frame whose shaders are elsewhere is played as well.
    desk.write(
        "places.toml",
        "[shade_hamburger.light]\nwgsl = { group = 3, binding = 7 }\n",
    );
    desk.hankel(&format!(
        "{build} --wgsl-group 1 --bindings places.toml --target wgsl"
    ))
    .code(0);
    let expected = rendered(&desk, "scene.toml", "");
    assert!(difference(&played(&desk, "frame"), &expected) <= ROUNDED);
}
