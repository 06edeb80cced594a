//! Builds, checks, bundles and new crates on disk.

mod support;

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::process::Command;

use hankel_codegen::Error;
use hankel_codegen::build::{Modules, build, generate};
use hankel_codegen::bundle::Bundle;
use hankel_codegen::check::{Budget, Config, Limits, check};
use hankel_codegen::compile::Compiled;
use hankel_codegen::finished::finish_all;
use hankel_codegen::inputs::{Inputs, Names};
use hankel_codegen::manifest::{Manifest, schema};
use hankel_codegen::scaffold::{Dsl, scaffold};

fn build_all(out: &Path) -> hankel_codegen::build::Report {
    build(&support::request(), &support::modules(), out, false).unwrap()
}

#[test]
fn the_same_bytes_each_time() {
    let first = generate(&support::request(), &support::modules()).unwrap();
    let second = generate(&support::request(), &support::modules()).unwrap();
    assert_eq!(first.files, second.files);
    // Whatever order kernels and languages are named in.
    let mut named = support::request();
    named.targets = hankel_codegen::Language::ALL.to_vec();
    let in_order = generate(&named, &support::modules()).unwrap();
    named.kernels.reverse();
    named.targets.reverse();
    let turned = generate(&named, &support::modules()).unwrap();
    assert_eq!(turned.files, in_order.files);
    // From finished modules as from raw ones.
    let Modules::Raw(raw) = support::modules() else {
        unreachable!()
    };
    let done = Modules::Final(finish_all(&raw, &support::all(), None).unwrap());
    assert_eq!(
        generate(&support::request(), &done).unwrap().files,
        first.files
    );
}

#[test]
fn the_manifest_follows_its_schema() {
    let committed = include_str!("../manifest.schema.json");
    assert_eq!(
        committed,
        schema(),
        "write the derived schema to codegen/manifest.schema.json"
    );
    let schema = serde_json::from_str(committed).unwrap();
    let validator = jsonschema::validator_for(&schema).unwrap();
    let generated = generate(&support::request(), &support::modules()).unwrap();
    let json: serde_json::Value =
        serde_json::from_slice(&generated.files["manifest.json"]).unwrap();
    let problems: Vec<String> = validator
        .iter_errors(&json)
        .map(|error| error.to_string())
        .collect();
    assert!(problems.is_empty(), "{problems:#?}");
    let mut broken = json.clone();
    broken["kernels"]["bound"]["stage"] = "mesh".into();
    assert!(!validator.is_valid(&broken));
    let read = Manifest::from_json(&generated.files["manifest.json"]).unwrap();
    assert_eq!(read, generated.manifest);
    // Nothing of the machine.
    let text = String::from_utf8(generated.files["manifest.json"].clone()).unwrap();
    assert!(
        !text.contains("/home") && text.contains("\"src/lib.rs\""),
        "{text}"
    );
}

/// Runs a program that must not complain.
fn succeeds(command: &mut Command) {
    let output = command.output().unwrap();
    let said = [output.stdout, output.stderr].concat();
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&said)
    );
}

#[test]
fn headers_compile_and_check_themselves() {
    let folder = tempfile::tempdir().unwrap();
    build_all(folder.path());
    let header = folder.path().join("include/hankel.h");
    for (compiler, arguments) in [
        (
            "cc",
            ["-x", "c", "-std=c11", "-Wall", "-Werror", "-fsyntax-only"],
        ),
        (
            "c++",
            [
                "-x",
                "c++",
                "-std=c++11",
                "-Wall",
                "-Werror",
                "-fsyntax-only",
            ],
        ),
    ] {
        succeeds(Command::new(compiler).args(arguments).arg(&header));
    }
    let library = folder.path().join("header.rlib");
    succeeds(
        Command::new("rustc")
            .args([
                "--edition=2021",
                "--crate-type=lib",
                "--crate-name=header",
                "-o",
            ])
            .arg(&library)
            .arg(folder.path().join("include/hankel.rs")),
    );
    // For bytemuck, whose traits stand here as they are declared there.
    let both = "pub mod bytemuck {\n    pub unsafe trait Zeroable {}\n    pub unsafe trait Pod: Zeroable + Copy {}\n}\n\
                include!(\"include/hankel.rs\");\ninclude!(\"include/hankel_bytemuck.rs\");\n";
    fs::write(folder.path().join("both.rs"), both).unwrap();
    succeeds(
        Command::new("rustc")
            .args(["--edition=2021", "--crate-type=lib", "-Dwarnings", "-o"])
            .arg(folder.path().join("both.rlib"))
            .arg(folder.path().join("both.rs")),
    );
    // The checks are checks.
    let text = fs::read_to_string(&header).unwrap();
    fs::write(&header, text.replace("float b3;", "double b3;")).unwrap();
    let output = Command::new("cc")
        .args(["-x", "c", "-std=c11", "-fsyntax-only"])
        .arg(&header)
        .output()
        .unwrap();
    assert!(!output.status.success());
}

/// The types say what the module has, and refuse what it has not.
#[test]
fn typescript_accepts_what_is_there_and_nothing_else() {
    let folder = tempfile::tempdir().unwrap();
    build_all(folder.path());
    let include = folder.path().join("include");
    fs::write(
        include.join("use.ts"),
        "import { Settings, bound_kernel } from \"./hankel.js\";\n\
         const view = new DataView(new ArrayBuffer(Settings.size));\n\
         Settings.write(view, 0, { bias: 1, depth_bias: 2, pad0: 0, pad1: 0 });\n\
         // @ts-expect-error there is no such field\n\
         Settings.write(view, 0, { bias: 1, depth: 2 });\n\
         export const slot: number = bound_kernel.bindings.settings;\n\
         // @ts-expect-error there is no such binding\n\
         export const none: number = bound_kernel.bindings.nosuch;\n\
         export const layout = (device: GPUDevice): GPUBindGroupLayout =>\n    \
         device.createBindGroupLayout(bound_kernel.layout);\n",
    )
    .unwrap();
    let tools = std::env::var_os("HANKEL_TOOLS").map(std::path::PathBuf::from);
    let modules = tools
        .or_else(|| Some(std::env::home_dir()?.join(".cache/hankel/tools")))
        .unwrap()
        .join("node_modules");
    assert!(
        modules.join("typescript").is_dir(),
        "typescript is not in {}: `./check` installs it",
        modules.display()
    );
    succeeds(
        Command::new("node")
            .arg(modules.join("typescript/bin/tsc"))
            .args([
                "--noEmit", "--strict", "--target", "es2022", "--module", "es2022",
            ])
            .args([
                "--moduleResolution",
                "bundler",
                "--types",
                "@webgpu/types",
                "--typeRoots",
            ])
            .arg(&modules)
            .arg("use.ts")
            .current_dir(&include),
    );
}

#[test]
fn nothing_is_done_while_nothing_changes() {
    let folder = tempfile::tempdir().unwrap();
    let first = build_all(folder.path());
    assert_eq!(
        first.written.len(),
        first
            .written
            .iter()
            .collect::<std::collections::BTreeSet<_>>()
            .len()
    );
    assert_eq!(first.written.last().unwrap(), "manifest.json");
    let times: BTreeMap<_, _> = first
        .written
        .iter()
        .map(|file| {
            (
                file,
                fs::metadata(folder.path().join(file))
                    .unwrap()
                    .modified()
                    .unwrap(),
            )
        })
        .collect();
    let second = build_all(folder.path());
    assert_eq!(
        (second.written.len(), second.unchanged),
        (0, first.written.len())
    );
    for (file, time) in times {
        assert_eq!(
            fs::metadata(folder.path().join(file))
                .unwrap()
                .modified()
                .unwrap(),
            time,
            "{file}"
        );
    }
    // A deleted file comes back, and only that is written.
    fs::remove_file(folder.path().join("wgsl/bound.wgsl")).unwrap();
    assert_eq!(build_all(folder.path()).written, ["wgsl/bound.wgsl"]);
    // Nothing of the preparation is left.
    assert!(!folder.path().join(".hankel").exists());
}

/// What is right is not asked of the folder itself.
#[test]
fn a_manifest_that_was_edited_is_not_believed() {
    let folder = tempfile::tempdir().unwrap();
    build_all(folder.path());
    let path = folder.path().join("manifest.json");
    let right = fs::read_to_string(&path).unwrap();
    let mut json: serde_json::Value = serde_json::from_str(&right).unwrap();
    json["files"] = serde_json::json!({});
    fs::write(&path, json.to_string()).unwrap();
    fs::remove_dir_all(folder.path().join("hlsl")).unwrap();
    let report = build_all(folder.path());
    assert!(
        report.written.contains(&"hlsl/bound.hlsl".into()),
        "{report:?}"
    );
    assert_eq!(fs::read_to_string(&path).unwrap(), right);
    let edited = right.replacen("\"binding\": 0", "\"binding\": 7", 1);
    assert_ne!(edited, right);
    fs::write(&path, edited).unwrap();
    assert_eq!(build_all(folder.path()).written, ["manifest.json"]);
    assert_eq!(fs::read_to_string(&path).unwrap(), right);
    // One of an older format still says what its build wrote.
    let mut json: serde_json::Value = serde_json::from_str(&right).unwrap();
    json["format"] = 0.into();
    json["made_by"] = serde_json::json!({ "hankel": "0.0.1" });
    json.as_object_mut().unwrap().remove("kernels");
    let old = "// of another version\n";
    fs::write(folder.path().join("wgsl/bound.wgsl"), old).unwrap();
    json["files"]["wgsl/bound.wgsl"]["sha256"] =
        hankel_codegen::files::sha256(old.as_bytes()).into();
    fs::write(&path, json.to_string()).unwrap();
    assert_eq!(
        build_all(folder.path()).written,
        ["wgsl/bound.wgsl", "manifest.json"]
    );
    // One that is no manifest is the user's.
    fs::write(&path, "{}").unwrap();
    let error = build(
        &support::request(),
        &support::modules(),
        folder.path(),
        false,
    )
    .unwrap_err();
    assert!(
        error.to_string().contains("manifest.json is in the way"),
        "{error}"
    );
}

#[test]
fn the_folder_holds_what_was_asked_for_last() {
    let folder = tempfile::tempdir().unwrap();
    build_all(folder.path());
    fs::write(folder.path().join("notes.txt"), "mine").unwrap();
    let mut request = support::request();
    request.filter = vec!["bo*".into()];
    request.targets = vec![hankel_codegen::Language::Wgsl];
    let report = build(&request, &support::modules(), folder.path(), false).unwrap();
    assert!(
        report.removed.contains(&"hlsl/bound.hlsl".to_owned()),
        "{report:?}"
    );
    assert!(!folder.path().join("hlsl").exists());
    assert!(folder.path().join("wgsl/bound.wgsl").exists());
    assert!(folder.path().join("notes.txt").exists());
    request.filter = vec!["nothing".into()];
    let error = build(&request, &support::modules(), folder.path(), false).unwrap_err();
    assert!(
        error.to_string().contains("`nothing`") && error.to_string().contains("resample"),
        "{error}"
    );
}

#[test]
fn files_of_the_users_stay() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("wgsl/bound.wgsl");
    fs::create_dir(folder.path().join("wgsl")).unwrap();
    fs::write(&path, "mine").unwrap();
    let request = support::request();
    let error = build(&request, &support::modules(), folder.path(), false).unwrap_err();
    assert!(
        matches!(&error, Error::InTheWay { path: other, .. } if *other == path),
        "{error}"
    );
    assert_eq!(fs::read_to_string(&path).unwrap(), "mine");
    assert!(
        !folder.path().join("manifest.json").exists(),
        "nothing is half-written"
    );
    build(&request, &support::modules(), folder.path(), true).unwrap();
    // An edit counts as the user's too.
    fs::write(&path, "edited").unwrap();
    assert!(build(&request, &support::modules(), folder.path(), false).is_err());
}

#[test]
fn a_check_shows_what_differs() {
    let folder = tempfile::tempdir().unwrap();
    build_all(folder.path());
    let generated = generate(&support::request(), &support::modules()).unwrap();
    let report = check(&generated, folder.path(), &Budget::default()).unwrap();
    assert!(report.is_fine(), "{report}");
    let edited = folder.path().join("wgsl/bound.wgsl");
    let text = fs::read_to_string(&edited).unwrap();
    fs::write(&edited, text.replace("0.1f", "0.2f")).unwrap();
    fs::remove_file(folder.path().join("msl/tint.metal")).unwrap();
    fs::write(folder.path().join("glsl/old.comp"), "").unwrap();
    fs::write(folder.path().join("spirv/bound.spv"), [0; 40]).unwrap();
    let mut budget = Budget {
        branches: Some(1),
        findings: Some(0),
        ..Budget::default()
    };
    budget.kernels.insert(
        "bound".into(),
        Limits {
            arithmetic: Some(11),
            ..Limits::default()
        },
    );
    budget.kernels.insert("gone".into(), Limits::default());
    let report = check(&generated, folder.path(), &budget).unwrap();
    assert!(!report.is_fine());
    let diff = &report
        .changed
        .iter()
        .find(|changed| changed.file == "wgsl/bound.wgsl")
        .unwrap()
        .diff;
    assert!(
        diff.contains("--- committed/wgsl/bound.wgsl\n+++ generated/wgsl/bound.wgsl\n@@ "),
        "{diff}"
    );
    assert!(
        diff.lines()
            .any(|line| line.starts_with('-') && line.contains("0.2f")),
        "{diff}"
    );
    assert_eq!(report.missing, ["msl/tint.metal"]);
    assert_eq!(report.extra, ["glsl/old.comp"]);
    assert_eq!(report.invalid.len(), 1, "{:?}", report.invalid);
    assert_eq!(report.unknown_in_budget, ["gone"]);
    let text = report.to_string();
    assert!(
        text.contains("kernel `bound` has 12 arithmetic instructions, 11 are allowed"),
        "{text}"
    );
    assert!(text.contains("kernel `total` has "), "{text}");
    // What the lint found is shown.
    assert!(
        text.contains(
            "kernel `total` has 1 findings of the lint, 0 are allowed\n  `total`: a loop that"
        ),
        "{text}"
    );
    let json = serde_json::to_value(&report).unwrap();
    assert_eq!(json["missing"][0], "msl/tint.metal");
    // A build that was stopped shows.
    fs::create_dir(folder.path().join(".hankel")).unwrap();
    let report = check(&generated, folder.path(), &Budget::default()).unwrap();
    assert!(report.stopped && !report.is_fine(), "{report}");
    assert!(
        report
            .to_string()
            .contains("a build of this folder was interrupted"),
        "{report}"
    );
    // An editor's own files do not.
    fs::write(folder.path().join("glsl/.old.comp.swp"), "").unwrap();
    let report = check(&generated, folder.path(), &Budget::default()).unwrap();
    assert_eq!(report.extra, ["glsl/old.comp"]);
    // A folder that is not there lacks everything.
    let report = check(&generated, &folder.path().join("none"), &Budget::default()).unwrap();
    assert_eq!(report.missing.len(), generated.files.len());
}

#[test]
fn budgets_are_read() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("hankel.toml");
    fs::write(
        &path,
        "[budget]\nbranches = 3\n[budget.kernels.bound]\narithmetic = 12\n",
    )
    .unwrap();
    let budget = Config::read(&path).unwrap().budget;
    assert_eq!(budget.of("bound").arithmetic, Some(12));
    assert_eq!(budget.of("bound").branches, Some(3));
    assert_eq!(budget.of("other").arithmetic, None);
    fs::write(&path, "[budget]\nbranchs = 3\n").unwrap();
    let error = Config::read(&path).unwrap_err().to_string();
    assert!(
        error.contains("hankel.toml") && error.contains("branchs"),
        "{error}"
    );
    // What is no file is neither read to its end nor waited for.
    for (path, problem) in [
        (folder.path().join("nope.toml"), "No such file"),
        (folder.path().to_owned(), "a folder"),
        ("/dev/zero".into(), "a device"),
    ] {
        let error = Config::read(&path).unwrap_err();
        assert!(matches!(error, Error::Budget { .. }), "{error:?}");
        assert!(error.to_string().contains(problem), "{error}");
    }
    fs::write(&path, vec![b'#'; 2 << 20]).unwrap();
    let error = Config::read(&path).unwrap_err().to_string();
    assert!(error.contains("the limit of 1 MiB"), "{error}");
}

/// A crate with a path dependency, a workspace and a lock file, and the record of a build of it.
fn write_crates(root: &Path) -> Names {
    let write = |path: &str, text: &str| {
        let path = root.join(path);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, text).unwrap();
    };
    write(
        "Cargo.toml",
        "[workspace]\nmembers = [\"a\", \"b\"]\n[workspace.dependencies]\nb = { path = \"b\" }\nc = \"1\"\n",
    );
    write(
        "Cargo.lock",
        "[[package]]\nname = \"a\"\nversion = \"0.1.0\"\ndependencies = [\"b\"]\n\
         [[package]]\nname = \"b\"\nversion = \"0.1.0\"\ndependencies = [\"glam\", \"rayon\"]\n\
         [[package]]\nname = \"glam\"\nversion = \"1.0.0\"\nsource = \"s\"\nchecksum = \"c\"\n\
         [[package]]\nname = \"rayon\"\nversion = \"1.0.0\"\nsource = \"s\"\n",
    );
    write(
        "a/Cargo.toml",
        "[package]\nname = \"a\"\nversion = \"0.1.0\"\n[dependencies]\nb.workspace = true\n",
    );
    write("a/src/lib.rs", "// a\n");
    write("coef.txt", "1\r\n");
    write("a/data/table.bin", "1");
    write(
        "b/Cargo.toml",
        "[package]\nname = \"b\"\nversion = \"0.1.0\"\n",
    );
    write("b/src/lib.rs", "// b\n");
    write("b/src/native/host.rs", "// host\n");
    let set = |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect();
    Names {
        files: set(&[
            "Cargo.toml",
            "build.rs",
            "src/lib.rs",
            "../coef.txt",
            "../b/Cargo.toml",
            "../b/build.rs",
            "../b/src/lib.rs",
        ]),
        folders: set(&["data"]),
        environment: set(&["HANKEL_TEST_WEIGHT"]),
        packages: set(&["a 0.1.0", "b 0.1.0", "glam 1.0.0"]),
    }
}

#[test]
fn a_record_of_inputs_follows_what_was_read() {
    let (one, two) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let names = write_crates(one.path());
    write_crates(two.path());
    let recorded = Inputs::take(&one.path().join("a"), &names).unwrap();
    assert_eq!(recorded.names(), names);
    let root = two.path();
    let changes = || recorded.changes(&root.join("a"));
    assert_eq!(changes(), [""; 0], "the place does not count");
    let edit = |path: &str, text: Option<&str>| {
        let path = root.join(path);
        let old = fs::read(&path).ok();
        match text {
            Some(text) => {
                fs::create_dir_all(path.parent().unwrap()).unwrap();
                fs::write(&path, text).unwrap();
            }
            None => fs::remove_file(&path).unwrap(),
        }
        let found = changes();
        match old {
            Some(old) => fs::write(&path, old).unwrap(),
            None => fs::remove_file(&path).unwrap(),
        }
        found.join("; ")
    };
    for (path, text, expected) in [
        ("a/src/lib.rs", Some("// A\n"), "`src/lib.rs` has changed"),
        (
            "b/src/lib.rs",
            Some("// B\n"),
            "`../b/src/lib.rs` has changed",
        ),
        ("b/src/lib.rs", None, "`../b/src/lib.rs` is gone"),
        ("coef.txt", Some("1\n"), "`../coef.txt` has changed"),
        ("a/build.rs", Some("fn main() {}"), "`build.rs` is new"),
        ("a/data/more/new.bin", Some("2"), "`data` has changed"),
        ("a/data/table.bin", None, "`data` has changed"),
        // Line ends of sources, and what was not read, do not count.
        ("a/src/lib.rs", Some("// a\r\n"), ""),
        ("b/src/native/host.rs", Some("// other\n"), ""),
        ("a/README.md", Some("other"), ""),
        ("a/shaders/include/hankel.rs", Some("other"), ""),
        ("a/data/.table.bin.swp", Some("other"), ""),
        ("a/.cargo/config.toml", Some("[build]\njobs = 1\n"), ""),
        (
            "a/.cargo/config.toml",
            Some("[patch.crates-io]\nglam = { path = \"x\" }\n"),
            "cargo's configuration or the workspace's Cargo.toml has changed",
        ),
        (
            "a/.cargo/config.toml",
            Some("[env]\nHANKEL_TEST_WEIGHT = \"2\"\n"),
            "the environment variable `HANKEL_TEST_WEIGHT` is new; cargo's configuration or the \
             workspace's Cargo.toml has changed",
        ),
    ] {
        assert_eq!(edit(path, text), expected, "{path}");
    }
    let shared = fs::read_to_string(root.join("Cargo.toml")).unwrap();
    for (from, to, counts) in [
        ("c = \"1\"", "c = \"2\"", false),
        ("path = \"b\"", "path = \"b\", features = [\"x\"]", true),
        (
            "[workspace]",
            "[profile.release]\nopt-level = 1\n[workspace]",
            true,
        ),
    ] {
        assert_ne!(shared.replace(from, to), shared);
        let found = edit("Cargo.toml", Some(&shared.replace(from, to)));
        assert_eq!(
            found.contains("workspace's Cargo.toml"),
            counts,
            "{from}: {found}"
        );
    }
    let lock = fs::read_to_string(root.join("Cargo.lock")).unwrap();
    for (from, to, expected) in [
        (
            "\"c\"",
            "\"d\"",
            "Cargo.lock's entry of `glam 1.0.0` has changed",
        ),
        (
            "\"rayon\"\nversion = \"1.0.0\"",
            "\"rayon\"\nversion = \"1.0.1\"",
            "",
        ),
        (
            "\"glam\"\nversion = \"1.0.0\"",
            "\"glam\"\nversion = \"1.0.1\"",
            "Cargo.lock's entry of `b 0.1.0` has changed; Cargo.lock's entry of `glam 1.0.0` is gone",
        ),
        // A second version, for a package that was not compiled.
        (
            "dependencies = [\"glam\", \"rayon\"]",
            "dependencies = [\"glam 1.0.0\", \"rayon\"]\n[[package]]\nname = \"glam\"\nversion = \"2.0.0\"\nsource = \"s\"",
            "",
        ),
    ] {
        assert_ne!(lock.replacen(from, to, 1), lock, "{from}");
        assert_eq!(
            edit("Cargo.lock", Some(&lock.replacen(from, to, 1))),
            expected
        );
    }
}

#[test]
fn configuration_files_that_others_include_count() {
    let place = tempfile::tempdir().unwrap();
    let names = write_crates(place.path());
    let folder = place.path().join("a");
    let write = |path: &str, text: &str| {
        let path = folder.join(path);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, text).unwrap();
    };
    // In a circle, too: each is read once.
    write(
        ".cargo/config.toml",
        "include = [{ path = \"one.toml\" }, \"../two.toml\"]\n",
    );
    write(".cargo/one.toml", "include = \"config.toml\"\n");
    write("two.toml", "[env]\nHANKEL_TEST_WEIGHT = \"1\"\n");
    let recorded = Inputs::take(&folder, &names).unwrap();
    assert_eq!(recorded.changes(&folder), [""; 0]);
    let paths = recorded.paths(&folder).unwrap();
    for name in [
        ".cargo/config.toml",
        ".cargo/one.toml",
        "two.toml",
        "src/lib.rs",
        "data",
    ] {
        assert!(paths.contains(&folder.join(name)), "{name}: {paths:?}");
    }
    for name in ["Cargo.lock", "Cargo.toml", "coef.txt"] {
        assert!(
            paths.contains(&place.path().join(name)),
            "{name}: {paths:?}"
        );
    }
    write("two.toml", "[env]\nHANKEL_TEST_WEIGHT = \"2\"\n");
    assert_eq!(
        recorded.changes(&folder),
        [
            "the environment variable `HANKEL_TEST_WEIGHT` has changed",
            "cargo's configuration or the workspace's Cargo.toml has changed"
        ]
    );
}

/// The folder that a build script watches when it says nothing is the whole package: with the
/// build's own output in it, but that is no source.
#[test]
fn a_build_in_the_crate_is_no_source_of_it() {
    let place = tempfile::tempdir().unwrap();
    let mut names = write_crates(place.path());
    names.folders = [".".to_owned()].into();
    let folder = place.path().join("a");
    let recorded = Inputs::take(&folder, &names).unwrap();
    build_all(&folder.join("shaders"));
    assert_eq!(recorded.changes(&folder), [""; 0]);
    fs::write(folder.join("new.txt"), "").unwrap();
    assert_eq!(recorded.changes(&folder), ["`.` has changed"]);
}

#[test]
fn bundles_are_read_back_and_never_stale() {
    let (crates, folder) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let names = write_crates(crates.path());
    let krate = crates.path().join("a");
    let Modules::Raw(raw) = support::modules() else {
        unreachable!()
    };
    let compiled = Compiled {
        inputs: Inputs::take(&krate, &names).unwrap(),
        compiler: "rustc 1.98.1".into(),
        modules: raw,
    };
    let kernels = support::all();
    let modules = finish_all(&compiled.modules, &kernels, None).unwrap();
    let bundle = Bundle::new("a", &kernels, "0.10.0", &compiled, modules);
    fs::write(folder.path().join("old.spv"), "").unwrap();
    bundle.write(folder.path()).unwrap();
    assert!(!folder.path().join("old.spv").exists());
    let read = Bundle::read(folder.path()).unwrap();
    assert_eq!(read, bundle);
    read.check_made(&kernels, "0.10.0").unwrap();
    read.check_inputs(&krate).unwrap();
    fs::write(krate.join("src/lib.rs"), "// edited\n").unwrap();
    let error = read.check_inputs(&krate).unwrap_err();
    assert!(matches!(error, Error::Stale { .. }), "{error}");
    assert!(
        error.to_string().contains("`src/lib.rs` has changed"),
        "{error}"
    );
    assert!(error.advice().unwrap().contains("hankel toolchain install"));
    // Whatever made it must be the same.
    let refuses = |bundle: &Bundle, kernels: &[_], rust_gpu: &str, word: &str| {
        let error = bundle
            .check_made(kernels, rust_gpu)
            .unwrap_err()
            .to_string();
        assert!(error.contains(word), "{error}");
    };
    refuses(&read, &kernels, "0.11.0", "rust-gpu 0.10.0, not 0.11.0");
    refuses(&read, &kernels[1..], "0.10.0", "descriptions");
    let mut older = read.clone();
    older.origin.made_by.pipeline = "1".repeat(64);
    refuses(&older, &kernels, "0.10.0", "pipeline 111111111111");
    let mut older = read.clone();
    older.origin.made_by.spirv_tools = "0.1.0".into();
    refuses(&older, &kernels, "0.10.0", "SPIRV-Tools 0.1.0");
    // Where a kernel stands, and what is said of it, does not count.
    let mut moved = kernels.clone();
    moved[0].line += 1;
    read.check_made(&moved, "0.10.0").unwrap();
    let files: Vec<(String, Vec<u8>)> = fs::read_dir(folder.path())
        .unwrap()
        .map(|entry| entry.unwrap())
        .map(|entry| {
            (
                entry.file_name().into_string().unwrap(),
                fs::read(entry.path()).unwrap(),
            )
        })
        .collect();
    let files: Vec<(&str, &[u8])> = files
        .iter()
        .map(|(name, bytes)| (name.as_str(), bytes.as_slice()))
        .collect();
    assert_eq!(Bundle::from_files(&files).unwrap(), bundle);
    assert!(Bundle::from_files(&[]).is_err());
    // Tampered with.
    fs::write(folder.path().join("bound.spv"), [0; 40]).unwrap();
    let error = Bundle::read(folder.path()).unwrap_err();
    assert!(error.to_string().contains("bound.spv"), "{error}");
}

#[test]
fn failures_of_several_kernels_are_all_told() {
    let Modules::Raw(mut raw) = support::modules() else {
        unreachable!()
    };
    raw.remove("bound");
    raw.insert("tint".into(), vec![0; 8]);
    let error = generate(&support::request(), &Modules::Raw(raw)).unwrap_err();
    let text = error.to_string();
    assert!(
        text.contains("kernel `bound`") && text.contains("kernel `tint`"),
        "{text}"
    );
}

#[test]
fn a_new_crate_is_whole() {
    let folder = tempfile::tempdir().unwrap();
    let checkout = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap();
    let dsl = Dsl::Path(checkout.join("kernels/dsl"));
    let path = folder.path().join("my-kernels");
    let written = scaffold(&path, &dsl).unwrap();
    assert_eq!(written.len(), 5);
    let manifest = fs::read_to_string(path.join("Cargo.toml")).unwrap();
    assert!(
        manifest.contains("name = \"my-kernels\"") && manifest.contains("kernels/dsl"),
        "{manifest}"
    );
    for (name, problem) in [
        ("my-kernels", "not empty"),
        ("Mine", "not a name"),
        ("1a", "not a name"),
    ] {
        let error = scaffold(&folder.path().join(name), &dsl)
            .unwrap_err()
            .to_string();
        assert!(error.contains(problem), "{error}");
    }
}
