//! Every hand-made kernel in every language, checked by the tools of those languages.

mod support;

use std::path::Path;
use std::process::Command;

use hankel_codegen::Language;
use hankel_codegen::build::generate;
use hankel_codegen::finish;
use hankel_codegen::manifest;
use hankel_codegen::translate::{Ir, Options, Text, Written};
use hankel_dsl::native::describe::{Kernel, Rounding, Stage};

fn ir(kernel: &Kernel) -> Ir {
    let finished = finish::finish(&support::spirv(&kernel.name), kernel).unwrap();
    Ir::read(&finished.spirv, kernel).unwrap()
}

fn text(kernel: &Kernel, language: Language) -> Text {
    match ir(kernel)
        .write(language, kernel, &Options::default())
        .unwrap()
    {
        Written::Text(text) => text,
        other => panic!("{other:?}"),
    }
}

/// Runs glslangValidator on a file.
fn glslang(arguments: &[&str], file: &Path) {
    let output = Command::new("glslangValidator")
        .args(arguments)
        .arg(file)
        .output()
        .unwrap_or_else(|error| {
            panic!(
                "this test needs glslangValidator (Debian: apt-get install glslang-tools): {error}"
            )
        });
    let said = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success(), "{}:\n{said}", file.display());
}

#[test]
fn compilers_accept_what_is_written() {
    let folder = tempfile::tempdir().unwrap();
    let generated = generate(&support::request(), &support::modules()).unwrap();
    let scratch = folder.path().join("out.spv");
    let scratch = scratch.to_str().unwrap();
    let mut checked = 0;
    for (name, entry) in &generated.manifest.kernels {
        let stage = &support::all()
            .into_iter()
            .find(|kernel| kernel.name == *name)
            .unwrap()
            .stage;
        for (language, file) in &entry.languages {
            let path = folder.path().join(&file.file);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(&path, &generated.files[&file.file]).unwrap();
            let stage = match stage {
                Stage::Compute { .. } => "comp",
                Stage::Vertex => "vert",
                Stage::Fragment => "frag",
            };
            match language {
                Language::Glsl | Language::Essl310 | Language::Essl300 => {
                    glslang(&["-S", stage], &path);
                }
                // glslang's HLSL knows nothing of what came after shader model 5.
                Language::Hlsl if name != "wide_f64" => {
                    glslang(
                        &[
                            "-D",
                            "-V",
                            "-S",
                            stage,
                            "-e",
                            &file.entry_point,
                            "-o",
                            scratch,
                        ],
                        &path,
                    );
                }
                _ => continue,
            }
            checked += 1;
        }
    }
    assert_eq!(checked, 23);
}

#[test]
fn text_reads_as_by_hand() {
    for kernel in support::all() {
        assert!(ir(&kernel).is_clean(), "{}", kernel.name);
    }
    let wgsl = text(&support::bound(), Language::Wgsl).source;
    assert!(
        wgsl.contains("var<storage> input: array<Moments>;"),
        "{wgsl}"
    );
    assert!(wgsl.contains("let moments = input[id.x];"), "{wgsl}");
    assert!(
        wgsl.contains("moments.b1 ") && !wgsl.contains("b1_"),
        "{wgsl}"
    );
    for leftover in [
        "var<private>",
        "function_",
        "type_",
        "member",
        "return;",
        "fma(",
    ] {
        assert!(!wgsl.contains(leftover), "{leftover} in\n{wgsl}");
    }
    // One guard, and no test but the kernel's own.
    assert_eq!(wgsl.matches("if ").count(), 1, "{wgsl}");
    let hlsl = text(&support::resample(), Language::Hlsl).source;
    assert!(
        hlsl.contains("SamplerState linear_ : register(s0);"),
        "{hlsl}"
    );
    assert!(!hlsl.contains("nagaSampler"), "{hlsl}");
    let glsl = text(&support::bound(), Language::Glsl).source;
    assert!(
        glsl.contains("readonly buffer InputBuffer { Moments b_input[]; };"),
        "{glsl}"
    );
    let msl = text(&support::bound(), Language::Msl).source;
    assert!(
        msl.contains("device MomentsBuffer const& input [[buffer(1)]]"),
        "{msl}"
    );
}

#[test]
fn a_value_stored_once_is_returned() {
    let wgsl = text(&support::fullscreen(), Language::Wgsl).source;
    assert!(wgsl.contains("struct FullscreenOutput {"), "{wgsl}");
    assert!(!wgsl.contains("var "), "{wgsl}");
    // Stored on two paths: a local variable.
    let wgsl = text(&support::tint(), Language::Wgsl).source;
    assert!(
        wgsl.contains("var color: vec4<f32>;") && wgsl.contains("return color_1;"),
        "{wgsl}"
    );
}

#[test]
fn loops_leave_from_their_body() {
    for language in [
        Language::Wgsl,
        Language::Hlsl,
        Language::Msl,
        Language::Glsl,
    ] {
        let source = text(&support::total(), language).source;
        assert_eq!(source.matches("break;").count(), 1, "{source}");
        assert!(
            !source.contains("loop_init") && !source.contains("continuing"),
            "{source}"
        );
    }
}

#[test]
fn constants_stay_overridable_where_the_language_can() {
    let wgsl = text(&support::resample(), Language::Wgsl).source;
    assert!(wgsl.contains("@id(7) override taps: u32 = 3u;"), "{wgsl}");
    let generated = generate(&support::request(), &support::modules()).unwrap();
    let hlsl = String::from_utf8(generated.files["hlsl/resample.hlsl"].clone()).unwrap();
    assert!(hlsl.contains("* 3.0") && !hlsl.contains("taps"), "{hlsl}");
    let constant = &generated.manifest.kernels["resample"].constants[0];
    assert_eq!(constant.overridable_in, [Language::Spirv, Language::Wgsl]);
    // Frozen, it is a value everywhere.
    let mut request = support::request();
    request.options.constants.insert("taps".into(), 5.into());
    let generated = generate(&request, &support::modules()).unwrap();
    for file in [
        "wgsl/resample.wgsl",
        "hlsl/resample.hlsl",
        "msl/resample.metal",
    ] {
        let text = String::from_utf8(generated.files[file].clone()).unwrap();
        assert!(text.contains("* 5") && !text.contains("taps"), "{text}");
    }
    assert!(
        generated.manifest.kernels["resample"].constants[0]
            .overridable_in
            .is_empty()
    );
    request.options.constants.insert("tips".into(), 5.into());
    let error = generate(&request, &support::modules()).unwrap_err();
    assert!(
        error.to_string().contains("`tips`") && error.to_string().contains("taps"),
        "{error}"
    );
}

#[test]
fn what_a_language_lacks_is_said() {
    let generated = generate(&support::request(), &support::modules()).unwrap();
    let wide = &generated.manifest.kernels["wide_f64"];
    for language in [
        Language::Wgsl,
        Language::Msl,
        Language::Essl310,
        Language::Essl300,
    ] {
        assert!(wide.unsupported[&language].contains("64-bit"), "{language}");
    }
    for kernel in generated.manifest.kernels.values() {
        assert_eq!(
            kernel.languages.len() + kernel.unsupported.len(),
            Language::ALL.len()
        );
    }
    let resample = &generated.manifest.kernels["resample"];
    assert!(resample.unsupported[&Language::Essl310].contains("Rgba16Unorm"));
    assert_eq!(
        resample.languages[&Language::Wgsl].requires,
        ["texture-formats-tier1"]
    );
    // Direct3D's old compiler loads no doubles.
    let mut request = support::request();
    request.options.shader_model = "5.1".parse().unwrap();
    let generated = generate(&request, &support::modules()).unwrap();
    assert!(generated.manifest.kernels["wide_f64"].unsupported[&Language::Hlsl].contains("6.2"));
}

/// The operations that glslang may neither contract nor reorder, and all of them.
fn no_contraction(arguments: &[&str], name: &str, source: &str) -> (usize, usize) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    let module = folder.path().join("out.spv");
    std::fs::write(&path, source).unwrap();
    let output = ["-S", "comp", "-o", module.to_str().unwrap()];
    glslang(&[arguments, &output].concat(), &path);
    let module = rspirv::dr::load_bytes(std::fs::read(&module).unwrap()).unwrap();
    use rspirv::spirv::Op::{FAdd, FMul, FSub};
    let arithmetic = module.functions.iter().flat_map(|it| it.all_inst_iter());
    let arithmetic: Vec<_> = arithmetic
        .filter(|it| matches!(it.class.opcode, FAdd | FSub | FMul))
        .filter_map(|it| it.result_id)
        .collect();
    let text = rspirv::binary::Disassemble::disassemble(&module);
    let decorated = |id: &&u32| text.contains(&format!("OpDecorate %{id} NoContraction"));
    (
        arithmetic.iter().filter(decorated).count(),
        arithmetic.len(),
    )
}

#[test]
fn exact_arithmetic_is_precise_where_the_language_can() {
    let kernel = support::rounding();
    let glsl = text(&kernel, Language::Glsl);
    assert!(
        glsl.source
            .contains("precise float difference = (sum - x);"),
        "{}",
        glsl.source
    );
    assert!(glsl.requires.is_empty());
    let es = text(&kernel, Language::Essl310);
    assert!(
        es.source.starts_with("#version 310 es\n// ")
            && es
                .source
                .contains("\n#extension GL_EXT_gpu_shader5 : require\n"),
        "{}",
        es.source
    );
    assert_eq!(es.requires, ["GL_EXT_gpu_shader5"]);
    let hlsl = text(&kernel, Language::Hlsl);
    assert!(
        hlsl.source
            .contains("        precise float difference = (sum - x);"),
        "{}",
        hlsl.source
    );
    // What it means to a compiler; and what it would be without (reordered at once, in HLSL).
    let entry = ["-D", "-V", "-e", hlsl.entry_point.as_str()];
    for (arguments, name, source) in [
        (["-V"].as_slice(), "rounding.comp", &glsl.source),
        (["-V"].as_slice(), "rounding_es.comp", &es.source),
        (entry.as_slice(), "rounding.hlsl", &hlsl.source),
    ] {
        assert_eq!(no_contraction(arguments, name, source), (8, 8), "{source}");
        let plain = source.replace("precise ", "");
        assert_eq!(no_contraction(arguments, name, &plain).0, 0, "{plain}");
    }
    // Other kernels stay as they are.
    let bound = text(&support::bound(), Language::Hlsl).source;
    assert!(
        !bound.contains("precise") && !bound.contains("rounded"),
        "{bound}"
    );
}

#[test]
fn exact_arithmetic_is_unsupported_where_the_language_cannot() {
    let kernel = support::rounding();
    let generated = generate(&support::request(), &support::modules()).unwrap();
    let entry = &generated.manifest.kernels["rounding"];
    assert_eq!(entry.rounding, manifest::Rounding::Exact);
    assert_eq!(
        generated.manifest.kernels["bound"].rounding,
        manifest::Rounding::Free
    );
    for (language, why) in [
        (Language::Wgsl, "every implementation"),
        (Language::Msl, "MSL 2.4"),
        (Language::Essl300, "no `precise`"),
    ] {
        let said = &entry.unsupported[&language];
        assert!(
            said.contains(why) && said.contains("as it is written"),
            "{said}"
        );
    }
    let options = Options {
        msl_version: "3.2".parse().unwrap(),
        ..Options::default()
    };
    let Written::Text(msl) = ir(&kernel).write(Language::Msl, &kernel, &options).unwrap() else {
        panic!("MSL 3.2 can")
    };
    let pragmas = "#include <simd/simd.h>\n\n#pragma METAL fp math_mode(safe)\n#pragma METAL fp contract(off)\n";
    assert!(msl.source.contains(pragmas), "{}", msl.source);
    // Another kernel has none.
    let bound = support::bound();
    let Written::Text(msl) = ir(&bound).write(Language::Msl, &bound, &options).unwrap() else {
        panic!("MSL 3.2 can")
    };
    assert!(!msl.source.contains("#pragma"), "{}", msl.source);
}

#[test]
fn descriptions_without_the_attribute_are_read() {
    let kernel = support::bound();
    let mut json = serde_json::to_value(&kernel).unwrap();
    assert_eq!(json["rounding"], "free");
    json.as_object_mut().unwrap().remove("rounding");
    assert_eq!(
        serde_json::from_value::<Kernel>(json.clone()).unwrap(),
        kernel
    );
    json["rounding"] = "exact".into();
    let read: Kernel = serde_json::from_value(json).unwrap();
    assert_eq!(read.rounding, Rounding::Exact);
}

#[test]
fn places_are_those_in_the_text() {
    let generated = generate(&support::request(), &support::modules()).unwrap();
    let resample = &generated.manifest.kernels["resample"];
    let place = |binding: usize, language: Language| {
        let place = &resample.bindings[binding].places[&language];
        (place.class.as_str(), place.index, place.name.as_deref())
    };
    assert_eq!(place(0, Language::Hlsl), ("t", Some(0), Some("source")));
    assert_eq!(place(1, Language::Hlsl), ("s", Some(0), Some("linear_")));
    assert_eq!(place(2, Language::Hlsl), ("t", Some(1), Some("depth")));
    assert_eq!(place(3, Language::Hlsl), ("u", Some(0), Some("out_")));
    assert_eq!(place(3, Language::Msl), ("texture", Some(2), Some("out")));
    assert_eq!(
        place(0, Language::Wgsl),
        ("binding", Some(0), Some("source"))
    );
    assert_eq!(
        place(0, Language::Glsl),
        ("texture", Some(0), Some("u_source"))
    );
    assert_eq!(
        resample.bindings[1].places[&Language::Glsl].combined_with,
        [0]
    );
    let bound = &generated.manifest.kernels["bound"];
    assert_eq!(bound.languages[&Language::Msl].sizes_buffer, Some(3));
    assert_eq!(bound.languages[&Language::Msl].sized_bindings, [1, 2]);
    let uniform = &bound.bindings[0];
    assert_eq!(
        uniform.places[&Language::Glsl].block.as_deref(),
        Some("SettingsUniform")
    );
}

#[test]
fn bounds_checks_are_written_when_asked_for() {
    let options = Options {
        bounds_checks: "restrict".parse().unwrap(),
        ..Options::default()
    };
    for (kernel, language, plain_mins) in [
        (support::exchange(), Language::Hlsl, 0),
        (support::exchange(), Language::Msl, 0),
        (support::resample(), Language::Glsl, 0),
    ] {
        let count = |text: &Text| {
            text.source.matches("min(").count() + text.source.matches("clamp(").count()
        };
        let plain = text(&kernel, language);
        let Written::Text(checked) = ir(&kernel).write(language, &kernel, &options).unwrap() else {
            panic!("{language}")
        };
        assert_eq!(count(&plain), plain_mins, "{}", plain.source);
        assert!(count(&checked) > 0, "{}", checked.source);
    }
}
