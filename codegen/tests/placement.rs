//! Bindings that a host wants elsewhere: in texts, as the compilers of the languages see them, in the
//! manifest and in the headers.

mod support;

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::process::Command;

use hankel_codegen::build::{Generated, Request, generate};
use hankel_codegen::check::{Budget, check};
use hankel_codegen::manifest::{Manifest, StageName};
use hankel_codegen::placement::Placement;
use hankel_codegen::{Error, Language, Step};
use hankel_dsl::native::describe::ConstantValue;
use rspirv::dr::Operand;
use rspirv::spirv::{Decoration, Op};

/// Every language elsewhere, and some bindings in places of their own.
const PLACES: &str = "\
# What the host has at other places.
[resample.source]
hlsl = { register = 40 }
wgsl = { group = 5, binding = 9 }
msl = { slot = 20 }
glsl = { binding = 77 }

[resample.linear]
hlsl = { register = 3, space = 4 }

[bound.out]
hlsl = { space = 1 }
wgsl = { binding = 11 }
msl = { slot = 12 }
essl310 = { binding = 1 }
";

fn placed(places: &str) -> Placement {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("places.toml");
    std::fs::write(&file, places).unwrap();
    let mut placement = Placement::default();
    placement.read(&file).unwrap();
    placement
}

fn elsewhere() -> Request {
    let mut request = support::request();
    let placement = &mut request.options.placement;
    *placement = placed(PLACES);
    placement.hlsl_space = 2;
    placement.register_base = 5;
    placement.wgsl_group = 1;
    placement.msl_slot_base = 8;
    placement.glsl_binding_base = 3;
    request
}

fn text(generated: &Generated, file: &str) -> String {
    String::from_utf8(generated.files[file].clone()).unwrap()
}

/// Runs a program that must not complain.
fn succeeds(command: &mut Command) {
    let output = command.output().unwrap();
    let said = [output.stdout, output.stderr].concat();
    assert!(
        output.status.success(),
        "{command:?}\n{}",
        String::from_utf8_lossy(&said)
    );
}

/// glslang's module of a text.
fn compiled(folder: &Path, file: &str, text: &str, arguments: &[&str]) -> rspirv::dr::Module {
    let path = folder.join(file.replace('/', "."));
    let out = folder.join("out.spv");
    std::fs::write(&path, text).unwrap();
    succeeds(
        Command::new("glslangValidator")
            .args(arguments)
            .arg("-o")
            .arg(&out)
            .arg(&path),
    );
    rspirv::dr::load_bytes(std::fs::read(&out).unwrap()).unwrap()
}

/// Where a module's variables are: set and binding.
fn reflected(module: &rspirv::dr::Module) -> BTreeSet<(u32, u32)> {
    let mut places: BTreeMap<u32, (u32, u32)> = BTreeMap::new();
    for note in &module.annotations {
        if let [
            Operand::IdRef(target),
            Operand::Decoration(what),
            Operand::LiteralBit32(number),
        ] = note.operands.as_slice()
        {
            match what {
                Decoration::DescriptorSet => places.entry(*target).or_default().0 = *number,
                Decoration::Binding => places.entry(*target).or_default().1 = *number,
                _ => {}
            }
        }
    }
    places.into_values().collect()
}

/// Where the manifest says that a kernel's bindings are.
fn said(manifest: &Manifest, kernel: &str, language: Language) -> BTreeSet<(u32, u32)> {
    let bindings = manifest.kernels[kernel].bindings.iter();
    bindings
        .filter_map(|binding| binding.places.get(&language))
        .filter_map(|place| Some((place.space.unwrap_or(0), place.index?)))
        .collect()
}

#[test]
fn texts_have_the_bindings_that_the_manifest_says() {
    let generated = generate(&elsewhere(), &support::modules()).unwrap();
    let manifest = &generated.manifest;
    let folder = tempfile::tempdir().unwrap();
    let mut seen = BTreeMap::new();
    for (kernel, entry) in &manifest.kernels {
        for (language, file) in &entry.languages {
            let said = said(manifest, kernel, *language);
            let found = match language {
                Language::Wgsl => {
                    let text = text(&generated, &file.file);
                    let module = naga::front::wgsl::parse_str(&text).unwrap();
                    let places = module.global_variables.iter();
                    places
                        .filter_map(|(_, it)| it.binding)
                        .map(|it| (it.group, it.binding))
                        .collect()
                }
                // glslang's HLSL knows nothing of what came after shader model 5.
                Language::Hlsl if kernel != "wide_f64" => {
                    let text = text(&generated, &file.file);
                    let stage = match entry.stage {
                        StageName::Compute => "comp",
                        StageName::Vertex => "vert",
                        StageName::Fragment => "frag",
                    };
                    let arguments = ["-D", "-V", "-S", stage, "-e", &file.entry_point];
                    reflected(&compiled(folder.path(), &file.file, &text, &arguments))
                }
                Language::Glsl | Language::Essl310 if entry.stage == StageName::Compute => {
                    let text = text(&generated, &file.file);
                    reflected(&compiled(folder.path(), &file.file, &text, &["-V"]))
                }
                Language::Msl => {
                    let text = text(&generated, &file.file);
                    for binding in &entry.bindings {
                        let Some(place) = binding.places.get(language) else {
                            continue;
                        };
                        let name = place.name.as_ref().unwrap();
                        let slot = place.index.unwrap();
                        let declared = format!("{name} [[{}({slot})]]", place.class);
                        assert!(text.contains(&declared), "no `{declared}` in\n{text}");
                    }
                    continue;
                }
                _ => continue,
            };
            assert_eq!(found, said, "{kernel} in {language}");
            *seen.entry(*language).or_insert(0) += said.len();
        }
    }
    // Not nothing was compared.
    for language in [
        Language::Wgsl,
        Language::Hlsl,
        Language::Glsl,
        Language::Essl310,
    ] {
        assert!(seen[&language] >= 8, "{seen:?}");
    }
    are_where_they_are_wanted(&generated);
}

fn are_where_they_are_wanted(generated: &Generated) {
    let manifest = &generated.manifest;
    let place = |kernel: &str, name: &str, language: Language| {
        let bindings = &manifest.kernels[kernel].bindings;
        let binding = bindings.iter().find(|it| it.name == name).unwrap();
        let place = &binding.places[&language];
        (place.space, place.class.clone(), place.index)
    };
    use Language::{Essl310, Glsl, Hlsl, Msl, Spirv, Wgsl};
    for (kernel, name, language, space, class, index) in [
        ("resample", "source", Hlsl, Some(2), "t", 40),
        ("resample", "depth", Hlsl, Some(2), "t", 6),
        ("resample", "linear", Hlsl, Some(4), "s", 3),
        ("resample", "out", Hlsl, Some(2), "u", 5),
        ("tint", "linear", Hlsl, Some(2), "s", 5),
        ("bound", "out", Hlsl, Some(1), "u", 5),
        ("resample", "source", Wgsl, Some(5), "binding", 9),
        ("resample", "depth", Wgsl, Some(1), "binding", 2),
        ("bound", "out", Wgsl, Some(1), "binding", 11),
        ("resample", "source", Msl, None, "texture", 20),
        ("resample", "depth", Msl, None, "texture", 9),
        ("bound", "settings", Msl, None, "buffer", 8),
        ("bound", "out", Msl, None, "buffer", 12),
        ("resample", "source", Glsl, None, "texture", 77),
        ("resample", "depth", Glsl, None, "texture", 5),
        ("bound", "out", Essl310, None, "buffer", 1),
        ("bound", "input", Essl310, None, "buffer", 3),
        ("resample", "source", Spirv, Some(0), "binding", 0),
    ] {
        let expected = (space, class.to_owned(), Some(index));
        assert_eq!(
            place(kernel, name, language),
            expected,
            "{kernel}.{name} in {language}"
        );
    }
    // The sizes come after the last buffer.
    let msl = &manifest.kernels["bound"].languages[&Msl];
    assert_eq!(msl.sizes_buffer, Some(13));
    assert!(text(generated, &msl.file).contains("[[buffer(13)]]"));
}

#[test]
fn headers_have_the_bindings_that_the_manifest_says() {
    let generated = generate(&elsewhere(), &support::modules()).unwrap();
    let c = text(&generated, "include/hankel.h");
    for line in [
        "#define HANKEL_RESAMPLE_HLSL_SOURCE 40u /* t */\n#define HANKEL_RESAMPLE_HLSL_SOURCE_SPACE 2u\n",
        "#define HANKEL_RESAMPLE_WGSL_SOURCE 9u /* binding */\n#define HANKEL_RESAMPLE_WGSL_SOURCE_GROUP 5u\n",
        "#define HANKEL_BOUND_MSL_SIZES_BUFFER 13u\n",
        "#define HANKEL_RESAMPLE_GLSL_SOURCE 77u /* texture */\n",
        "#define HANKEL_RESAMPLE_SPIRV_SOURCE 0u /* binding */\n#define HANKEL_RESAMPLE_SPIRV_LINEAR",
    ] {
        assert!(c.contains(line), "no\n{line}in\n{c}");
    }
    let folder = tempfile::tempdir().unwrap();
    for (path, bytes) in &generated.files {
        let path = folder.path().join(path);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, bytes).unwrap();
    }
    succeeds(
        Command::new("cc")
            .args(["-x", "c", "-std=c11", "-Wall", "-Werror", "-fsyntax-only"])
            .arg(folder.path().join("include/hankel.h")),
    );
    // Rust: the numbers, as a program sees them.
    let main = "mod shaders { include!(\"include/hankel.rs\"); }
        use shaders::resample as r;
        fn main() {
            println!(\"{} {} {} {} {}\", r::bindings::SOURCE, r::wgsl_bindings::SOURCE,
                r::wgsl_groups::SOURCE, r::wgsl_groups::DEPTH, shaders::bound::wgsl_bindings::OUT);
        }";
    std::fs::write(folder.path().join("main.rs"), main).unwrap();
    succeeds(Command::new("rustc").current_dir(folder.path()).args([
        "--edition=2021",
        "-Adead_code",
        "main.rs",
    ]));
    let output = Command::new(folder.path().join("main")).output().unwrap();
    assert_eq!(String::from_utf8_lossy(&output.stdout), "0 9 5 1 11\n");
    // JavaScript: layouts by group.
    let main = "import { resample_kernel as r, bound_kernel as b } from './include/hankel.mjs';
        const of = (k) => Object.entries(k.layouts).map(([g, l]) => [g, l.entries.map((e) => e.binding)]);
        console.log(JSON.stringify([r.bindings.source, r.groups.source, of(r), of(b)]));";
    std::fs::write(folder.path().join("main.mjs"), main).unwrap();
    std::fs::rename(
        folder.path().join("include/hankel.js"),
        folder.path().join("include/hankel.mjs"),
    )
    .unwrap();
    let output = Command::new("node")
        .current_dir(folder.path())
        .arg("main.mjs")
        .output()
        .unwrap();
    assert_eq!(
        String::from_utf8_lossy(&output.stdout),
        "[9,5,[[\"1\",[1,2,3]],[\"5\",[9]]],[[\"1\",[0,1,11]]]]\n",
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    let types = text(&generated, "include/hankel.d.ts");
    for words in [
        "readonly groups: Readonly<Record<Binding, number>>;",
        "readonly layouts: Readonly<Record<number, GPUBindGroupLayoutDescriptor>>;",
    ] {
        assert!(types.contains(words), "{types}");
    }
    assert!(!types.contains("readonly layout:") && !types.contains("group 0"));
}

#[test]
fn a_folder_of_other_places_is_not_current() {
    let folder = tempfile::tempdir().unwrap();
    let modules = support::modules();
    let build = |request: &Request| {
        hankel_codegen::build::build(request, &modules, folder.path(), false).unwrap()
    };
    let is_current = |request: &Request| {
        let generated = generate(request, &modules).unwrap();
        check(&generated, folder.path(), &Budget::default())
            .unwrap()
            .is_fine()
    };
    build(&support::request());
    assert!(is_current(&support::request()));
    type Change = fn(&mut Placement);
    let changes: [Change; 6] = [
        |it| it.hlsl_space = 1,
        |it| it.register_base = 1,
        |it| it.wgsl_group = 1,
        |it| it.msl_slot_base = 1,
        |it| it.glsl_binding_base = 1,
        |it| *it = placed("[bound.out]\nmsl = { slot = 9 }\n"),
    ];
    for change in changes {
        let mut request = support::request();
        change(&mut request.options.placement);
        assert!(!is_current(&request), "{:?}", request.options.placement);
        let report = build(&request);
        assert!(report.written.iter().any(|file| file == "manifest.json"));
        assert!(report.written.len() > 1, "{:?}", report.written);
        assert!(is_current(&request));
        assert!(!is_current(&support::request()));
        // What the folder says of itself is what it was built with, and no path of this machine.
        let bytes = std::fs::read(folder.path().join("manifest.json")).unwrap();
        let manifest = Manifest::from_json(&bytes).unwrap();
        assert_eq!(
            manifest.options.placement,
            request.options.placement.without_origin()
        );
        assert!(!String::from_utf8(bytes).unwrap().contains("places.toml"));
    }
    build(&support::request());
    let text = std::fs::read_to_string(folder.path().join("manifest.json")).unwrap();
    assert!(!text.contains("placement"));
}

/// What is said of a file of places.
fn complaint(places: &str) -> String {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("places.toml");
    std::fs::write(&file, places).unwrap();
    let mut request = support::request();
    let read = request.options.placement.read(&file);
    let error = match read {
        Ok(()) => generate(&request, &support::modules()).unwrap_err(),
        Err(error) => error,
    };
    assert!(error.advice().is_some());
    error.to_string()
}

#[test]
fn a_wrong_file_of_places_is_explained() {
    for (places, words) in [
        (
            "\n[bounds.out]\nmsl = { slot = 1 }\n",
            &["places.toml:2", "no kernel is named `bounds`", "bound, "][..],
        ),
        (
            "[bound.settings]\n[bound.output]\nmsl = { slot = 1 }\n",
            &[
                "places.toml:2",
                "`bound`",
                "no bound parameter `output`",
                "settings, input, out",
            ],
        ),
        (
            "[resample.taps]\nmsl = { slot = 1 }\n",
            &["places.toml:1", "no bound parameter `taps`"],
        ),
        (
            "[bound.out]\nmetal = { slot = 1 }\n",
            &["places.toml", "line 2", "`metal`", "`msl`"],
        ),
        (
            "[bound.out]\nmsl = { index = 1 }\n",
            &["places.toml", "line 2", "`index`", "`slot`"],
        ),
        (
            "[bound.out]\nhlsl = { space = 256 }\n",
            &["line 2", "256", "u8"],
        ),
        ("[bound.out]\nwgsl = { group = -1 }\n", &["line 2", "-1"]),
        (
            "[resample.linear]\nglsl = { binding = 1 }\n",
            &["places.toml:1", "sampler `linear`", "no binding of its own"],
        ),
        // The others stay where they are.
        (
            "\n[resample.depth]\nhlsl = { register = 0 }\n",
            &[
                "places.toml:2",
                "kernel `resample`",
                "`source` and `depth` (line 2)",
                "register t0 of space 0 in HLSL",
            ],
        ),
        (
            "[bound.input]\nmsl = { slot = 7 }\n[bound.out]\nmsl = { slot = 7 }\n",
            &[
                "`input` (line 1) and `out` (line 3)",
                "buffer slot 7 in MSL",
            ],
        ),
        (
            "[bound.out]\nwgsl = { binding = 0 }\n",
            &[
                "`settings` and `out` (line 1)",
                "binding 0 of group 0 in WGSL",
            ],
        ),
        (
            "[bound.input]\nglsl = { binding = 2 }\n",
            &["`input` (line 1) and `out`", "buffer binding 2 in GLSL"],
        ),
        (
            "[bound.out]\nessl310 = { binding = 0 }\n",
            &["buffer binding 0 in GLSL ES 3.10"],
        ),
        (
            "[tint.linear]\nmsl = { slot = 16 }\n",
            &["places.toml:1", "`linear`", "sampler slot 16", "above 15"],
        ),
    ] {
        let said = complaint(places);
        for word in words {
            assert!(said.contains(word), "no `{word}` in: {said}");
        }
    }
    // Different classes, spaces and groups do not collide.
    let mut request = support::request();
    request.options.placement = placed(
        "[bound.out]\nhlsl = { register = 0 }\n[resample.depth]\nhlsl = { register = 0, space = 1 }\n\
         wgsl = { group = 1, binding = 0 }\n",
    );
    generate(&request, &support::modules()).unwrap();
}

#[test]
fn a_base_that_is_too_high_is_refused() {
    let mut request = support::request();
    request.filter = vec!["bound".into()];
    // Three buffers and their sizes: 27 to 30.
    request.options.placement.msl_slot_base = 27;
    generate(&request, &support::modules()).unwrap();
    for (base, words) in [
        (28, "buffer of sizes"),
        (29, "`out` would be at buffer slot 31"),
    ] {
        request.options.placement.msl_slot_base = base;
        let error = generate(&request, &support::modules()).unwrap_err();
        let Error::Kernel(failure) = &error else {
            panic!("{error}")
        };
        assert_eq!(failure.step, Step::Place);
        assert!(error.to_string().contains(words), "{error}");
    }
    request.options.placement.msl_slot_base = 0;
    request.options.placement.glsl_binding_base = 255;
    let error = generate(&request, &support::modules()).unwrap_err();
    assert!(error.to_string().contains("above 255"), "{error}");
}

/// The 32-bit constants of a module.
fn numbers(module: &rspirv::dr::Module) -> BTreeSet<u32> {
    let all = module.types_global_values.iter();
    all.filter(|it| it.class.opcode == Op::Constant)
        .filter_map(|it| match it.operands.as_slice() {
            [Operand::LiteralBit32(number)] => Some(*number),
            _ => None,
        })
        .collect()
}

#[test]
fn constants_stay_open_if_that_is_asked_for() {
    let mut request = support::request();
    request.options.open_constants = true;
    let generated = generate(&request, &support::modules()).unwrap();
    let constant = &generated.manifest.kernels["resample"].constants[0];
    assert_eq!(constant.overridable_in, Language::ALL);
    assert_eq!(constant.macro_name.as_deref(), Some("RESAMPLE_TAPS"));
    let folder = tempfile::tempdir().unwrap();
    for (file, declared, arguments) in [
        (
            "hlsl/resample.hlsl",
            "#ifndef RESAMPLE_TAPS\n#define RESAMPLE_TAPS 3u\n#endif\n\
             static const uint taps = uint(RESAMPLE_TAPS);\n",
            &["-D", "-V", "-S", "comp", "-e", "resample"][..],
        ),
        (
            "glsl/resample.comp",
            "#ifndef RESAMPLE_TAPS\n#define RESAMPLE_TAPS 3u\n#endif\n\
             const uint taps = uint(RESAMPLE_TAPS);\n",
            &["-V"],
        ),
    ] {
        let text = text(&generated, file);
        assert!(text.contains(declared), "{text}");
        let set = [arguments, &["-DRESAMPLE_TAPS=41"]].concat();
        let plain = numbers(&compiled(folder.path(), file, &text, arguments));
        let set = numbers(&compiled(folder.path(), file, &text, &set));
        // It is a factor of a float.
        let [default, other] = [3.0_f32, 41.0].map(f32::to_bits);
        assert!(
            plain.contains(&default) && !plain.contains(&other),
            "{plain:?}"
        );
        assert!(set.contains(&other) && !set.contains(&default), "{set:?}");
    }
    let msl = text(&generated, "msl/resample.metal");
    let declared = "constant uint taps_given [[function_constant(7)]];\n\
                    constant uint taps = is_function_constant_defined(taps_given) ? taps_given : 3u;\n";
    assert!(msl.contains(declared), "{msl}");
    assert_eq!(msl.matches("3u").count(), 1, "{msl}");
    // With a value it is a value.
    request.options.constants.insert("taps".into(), 5.into());
    let generated = generate(&request, &support::modules()).unwrap();
    let hlsl = text(&generated, "hlsl/resample.hlsl");
    assert!(hlsl.contains("* 5") && !hlsl.contains("taps"), "{hlsl}");
    let constant = &generated.manifest.kernels["resample"].constants[0];
    assert!(constant.overridable_in.is_empty() && constant.macro_name.is_none());
}

#[test]
fn variants_live_beside_their_kernel() {
    let mut request = support::request();
    let values: BTreeMap<String, ConstantValue> = [("taps".into(), 5.into())].into();
    request
        .options
        .variants
        .insert("_wide".into(), values.clone());
    request.options.placement = placed("[resample.depth]\nhlsl = { register = 30 }\n");
    let generated = generate(&request, &support::modules()).unwrap();
    let names: Vec<&str> = generated
        .manifest
        .kernels
        .keys()
        .map(String::as_str)
        .collect();
    assert!(names.contains(&"resample") && names.contains(&"resample_wide"));
    assert_eq!(names.len(), support::all().len() + 1);
    assert_eq!(generated.manifest.options.variants["_wide"], values);
    let (own, wide) = (
        text(&generated, "hlsl/resample.hlsl"),
        text(&generated, "hlsl/resample_wide.hlsl"),
    );
    assert!(
        own.contains("void resample(") && own.contains("* 3.0"),
        "{own}"
    );
    assert!(
        wide.contains("void resample_wide(") && wide.contains("* 5.0"),
        "{wide}"
    );
    assert!(own.contains("register(t30)") && wide.contains("register(t30)"));
    let spirv = rspirv::dr::load_bytes(&generated.files["spirv/resample_wide.spv"]).unwrap();
    assert_eq!(
        spirv.entry_points[0].operands[2],
        Operand::LiteralString("resample_wide".into())
    );
    let entry = &generated.manifest.kernels["resample_wide"];
    for (language, file) in &entry.languages {
        let expected = match language {
            Language::Glsl => "main",
            _ => "resample_wide",
        };
        assert_eq!(file.entry_point, expected);
    }
    assert_eq!(entry.constants[0].value, 5.into());
    let c = text(&generated, "include/hankel.h");
    assert!(c.contains("HANKEL_RESAMPLE_WIDE_HLSL_FILE \"hlsl/resample_wide.hlsl\""));
    // From finished modules, which have the kernel's own name, the same.
    let hankel_codegen::build::Modules::Raw(raw) = support::modules() else {
        unreachable!()
    };
    let done = hankel_codegen::finished::finish_all(&raw, &support::all(), None).unwrap();
    let done = hankel_codegen::build::Modules::Final(done);
    assert_eq!(generate(&request, &done).unwrap().files, generated.files);

    let error = |suffix: &str, constant: &str| {
        let mut request = support::request();
        let values = [(constant.to_owned(), 1.into())].into();
        request.options.variants.insert(suffix.into(), values);
        generate(&request, &support::modules())
            .unwrap_err()
            .to_string()
    };
    assert!(error("_wide", "tips").contains("`tips`"));
    let mut narrow = support::request();
    narrow.filter = vec!["resample".into()];
    narrow.kernels.push(hankel_dsl::native::describe::Kernel {
        name: "resample_wide".into(),
        ..support::resample()
    });
    narrow.filter.push("resample_wide".into());
    narrow.options.variants.insert("_wide".into(), values);
    let said = generate(&narrow, &support::modules())
        .unwrap_err()
        .to_string();
    assert!(
        said.contains("two kernels would be named `resample_wide`"),
        "{said}"
    );
}

/// What `wgpu.rs` includes and runs. `INSTA_UPDATE=always` writes it anew.
#[test]
fn what_is_included_is_what_is_made() {
    let mut request = support::request();
    request.filter = vec!["bound".into()];
    request.targets = vec![Language::Wgsl];
    request.options.placement = placed("[bound.out]\nwgsl = { group = 3, binding = 5 }\n");
    request.options.placement.wgsl_group = 1;
    let generated = generate(&request, &support::modules()).unwrap();
    let here = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/placed");
    for file in [
        "include/hankel.rs",
        "include/hankel_wgpu.rs",
        "wgsl/bound.wgsl",
    ] {
        let made = text(&generated, file);
        let path = here.join(file);
        if std::env::var_os("INSTA_UPDATE").is_some_and(|it| it == "always") {
            std::fs::write(&path, &made).unwrap();
        }
        let there = std::fs::read_to_string(&path).unwrap();
        assert_eq!(there, made, "{}: not as it is made now", path.display());
    }
}
