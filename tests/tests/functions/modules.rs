//! Modules that a tool of the language's own joins with its host: Slang's by slangc, WESL's by its linker in
//! JavaScript, naga_oil's by its composer. Each stub imports the shipped module, and another module of its host's
//! imports it, too. What comes out is run on Vulkan: slangc's SPIR-V as it is, the others' WGSL through wgpu.

use std::collections::BTreeMap;
use std::process::Command;

use hankel_codegen::Language;
use hankel_dsl::native::function::Function;
use hankel_matrix::column::Column;
use hankel_matrix::known::Known;
use hankel_matrix::subject::{Code, Subject};
use hankel_matrix::tools::Tools;
use naga_oil::compose::{
    ComposableModuleDescriptor, Composer, NagaModuleDescriptor, ShaderLanguage,
};

use super::tsl::{link_node_modules, said};
use super::{
    HLSL_HOST, PREFIX, agree, code, hlsl_entry, in_form, natives, place, stub_name, text, tools,
    wgsl,
};

/// Another module of the host that imports the library, too. `most` gives the count only if the library's constant
/// reached it: else the stub writes nothing.
const MOST: &str = "\
struct Light { color: vec4<f32> }
fn lerp(a: u32, b: u32, t: bool) -> u32 { return select(a, b, t); }
fn most(count: u32) -> u32 { return lerp(0u, count, HANKEL_SHADOWS_API > 0u); }
";

/// A stub in WGSL that has the library from `imports`.
fn importing(function: &Function, imports: &str) -> String {
    let code = wgsl(function, "");
    let text = String::from_utf8(code.bytes).expect("text");
    let count = "arrayLength(&results)";
    assert_eq!(text.matches(count).count(), 1);
    format!(
        "{imports}\n{}",
        text.replace(count, &format!("most({count})"))
    )
}

/// A stub's code in WGSL.
fn in_wgsl(function: &Function, text: String) -> Code {
    code(
        text,
        &stub_name(function),
        [("rows", "binding", 0), ("results", "binding", 1)],
    )
}

/// All of the library's functions in one module of SPIR-V, which slangc makes of a text that imports the shipped
/// module.
fn slang(functions: &[Function], tools: &Tools) -> Vec<Subject> {
    let folder = tempfile::tempdir().expect("a folder");
    let write = |name: &str, text: &str| {
        std::fs::write(folder.path().join(name), text).expect("a file");
    };
    write("hankel_shadows.slang", &text("slang"));
    write(
        "host.slang",
        "module host;\nimport hankel_shadows;\npublic uint most(uint count)\n{\n\
         \x20   return HANKEL_SHADOWS_API > 0 ? count : 0u;\n}\n",
    );
    let mut stubs = format!(
        "import hankel_shadows;\nimport host;\nimport hankel_shadows;\n{HLSL_HOST}\
         float lerp(float a, float b, float t) {{ return a + (b - a) * t; }}\n"
    );
    for f in functions {
        let bound = "if (id.x < bytes";
        let own = hlsl_entry(f, &format!("{}_slang", stub_name(f)));
        assert_eq!(own.matches(bound).count(), 1);
        stubs.push_str("[shader(\"compute\")]\n");
        stubs.push_str(&own.replace(bound, "if (id.x < most(bytes)"));
    }
    write("stubs.slang", &stubs);
    let slangc = tools.slangc().expect("slangc: `./check` installs it");
    said(
        Command::new(slangc)
            // Its package lacks the library that optimises SPIR-V.
            .args(["stubs.slang", "-target", "spirv", "-O0"])
            .args(["-profile", "spirv_1_3", "-fp-mode", "precise"])
            .args(["-fvk-use-entrypoint-name", "-fvk-t-shift", "0", "all"])
            .args(["-fvk-u-shift", "1", "all"])
            .args(["-warnings-as-errors", "all", "-o", "stubs.spv"])
            .current_dir(folder.path()),
    );
    let bytes = std::fs::read(folder.path().join("stubs.spv")).expect("SPIR-V");
    functions
        .iter()
        .map(|f| {
            let code = Code {
                bytes: bytes.clone(),
                entry_point: format!("{}_slang", stub_name(f)),
                places: [
                    (0, place("rows", "binding", 0)),
                    (1, place("results", "binding", 1)),
                ]
                .into(),
                sizes_slot: None,
                sized: Vec::new(),
            };
            in_form(f, "slang", [(Language::Spirv, code)])
        })
        .collect()
}

/// Each function in the WGSL that WESL's linker makes of modules.
fn wesl(functions: &[Function], tools: &Tools) -> Vec<Subject> {
    let folder = tempfile::tempdir().expect("a folder");
    link_node_modules(folder.path(), tools, "wesl");
    let write = |name: &str, text: &str| {
        std::fs::write(folder.path().join(name), text).expect("a file");
    };
    write("hankel_shadows.wesl", &text("wesl"));
    let import = "import package::hankel_shadows::HANKEL_SHADOWS_API;";
    write("host.wesl", &format!("{import}\n{MOST}"));
    for f in functions {
        let imports = format!(
            "import package::hankel_shadows::{PREFIX}_{};\nimport package::host::most;",
            f.name
        );
        write(&format!("{}.wesl", stub_name(f)), &importing(f, &imports));
    }
    write("wesl.mjs", include_str!("wesl.mjs"));
    let given = said(
        Command::new(tools.node().expect("Node.js"))
            .args(["wesl.mjs", "hankel_shadows", "host"])
            .args(functions.iter().map(stub_name))
            .current_dir(folder.path()),
    );
    let mut texts: BTreeMap<String, String> = serde_json::from_str(&given).expect("JSON");
    functions
        .iter()
        .map(|f| {
            let text = texts.remove(&stub_name(f)).expect("the stub");
            in_form(f, "wesl", [(Language::Wgsl, in_wgsl(f, text))])
        })
        .collect()
}

/// Each function in the module that naga_oil composes, as naga writes it.
fn naga_oil(functions: &[Function]) -> Vec<Subject> {
    let mut composer = Composer::default();
    let library = text("naga-oil");
    let import = "#import hankel::shadows::HANKEL_SHADOWS_API";
    let host = format!("#define_import_path host\n{import}\n{MOST}");
    for (file_path, source) in [("hankel_shadows.wgsl", &library), ("host.wgsl", &host)] {
        let module = ComposableModuleDescriptor {
            source,
            file_path,
            language: ShaderLanguage::Wgsl,
            ..Default::default()
        };
        if let Err(e) = composer.add_composable_module(module) {
            panic!("{file_path}: {}", e.emit_to_string(&composer));
        }
    }
    functions
        .iter()
        .map(|f| {
            let imports = format!(
                "#import hankel::shadows::{PREFIX}_{}\n#import host::most",
                f.name
            );
            let source = importing(f, &imports);
            let module = composer
                .make_naga_module(NagaModuleDescriptor {
                    source: &source,
                    file_path: "stub.wgsl",
                    ..Default::default()
                })
                .map_err(|e| e.emit_to_string(&composer))
                .unwrap_or_else(|e| panic!("{}: {e}", f.name));
            let info = naga::valid::Validator::new(
                naga::valid::ValidationFlags::all(),
                naga::valid::Capabilities::empty(),
            )
            .validate(&module)
            .unwrap_or_else(|e| panic!("{}: {e:?}", f.name));
            let flags = naga::back::wgsl::WriterFlags::empty();
            let text = naga::back::wgsl::write_string(&module, &info, flags)
                .unwrap_or_else(|e| panic!("{}: {e}", f.name));
            in_form(f, "naga_oil", [(Language::Wgsl, in_wgsl(f, text))])
        })
        .collect()
}

#[test]
fn every_function_of_a_module_computes_the_native_bits() {
    let (tools, functions) = (tools(), natives());
    let mut subjects = slang(&functions, &tools);
    subjects.extend(wesl(&functions, &tools));
    subjects.extend(naga_oil(&functions));
    // None differs: these columns pin what is pinned, and lavapipe rounds the rest as it is written.
    let known = Known::default();
    agree(
        &subjects,
        vec![Column::Native, Column::Wgsl, Column::Spirv],
        tools,
        known,
    );
}
