//! Builds, checks, bundles and new crates on disk.

mod support;

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::process::Command;
use std::time::Instant;

use hankel_codegen::build::{Modules, build, finish_all, generate};
use hankel_codegen::bundle::Bundle;
use hankel_codegen::check::{Budget, Config, Limits, check};
use hankel_codegen::manifest::{Manifest, schema};
use hankel_codegen::scaffold::{Dsl, scaffold};
use hankel_codegen::{Error, source_hash};

fn build_all(out: &Path) -> hankel_codegen::build::Report {
    build(&support::request(), out, false, || Ok(support::modules())).unwrap()
}

#[test]
fn the_same_bytes_each_time() {
    let first = generate(&support::request(), &support::modules()).unwrap();
    let second = generate(&support::request(), &support::modules()).unwrap();
    assert_eq!(first.files, second.files);
    let mut turned = support::request();
    turned.kernels.reverse();
    turned.targets = hankel_codegen::Language::ALL.into_iter().rev().collect();
    assert_eq!(
        generate(&turned, &support::modules()).unwrap().files,
        first.files
    );
    // From finished modules as from raw ones.
    let Modules::Raw(raw) = support::modules() else {
        unreachable!()
    };
    let done = Modules::Final(finish_all(&raw, &support::all()).unwrap());
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
        let output = Command::new(compiler)
            .args(arguments)
            .arg(&header)
            .output()
            .unwrap();
        assert!(
            output.status.success(),
            "{}",
            String::from_utf8_lossy(&output.stderr)
        );
    }
    let library = folder.path().join("header.rlib");
    let output = Command::new("rustc")
        .args([
            "--edition=2021",
            "--crate-type=lib",
            "--crate-name=header",
            "-o",
        ])
        .arg(&library)
        .arg(folder.path().join("include/hankel.rs"))
        .output()
        .unwrap();
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
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
    let start = Instant::now();
    let second = build(&support::request(), folder.path(), false, || {
        panic!("nothing to compile")
    })
    .unwrap();
    assert!(start.elapsed().as_secs_f64() < 0.3);
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
    // No temporary file is left.
    let odd: Vec<_> = fs::read_dir(folder.path().join("wgsl"))
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .filter(|name| name.starts_with('.'))
        .collect();
    assert!(odd.is_empty(), "{odd:?}");
}

#[test]
fn the_folder_holds_what_was_asked_for_last() {
    let folder = tempfile::tempdir().unwrap();
    build_all(folder.path());
    fs::write(folder.path().join("notes.txt"), "mine").unwrap();
    let mut request = support::request();
    request.filter = vec!["bo*".into()];
    request.targets = vec![hankel_codegen::Language::Wgsl];
    let report = build(&request, folder.path(), false, || Ok(support::modules())).unwrap();
    assert!(
        report.removed.contains(&"hlsl/bound.hlsl".to_owned()),
        "{report:?}"
    );
    assert!(!folder.path().join("hlsl").exists());
    assert!(folder.path().join("wgsl/bound.wgsl").exists());
    assert!(folder.path().join("notes.txt").exists());
    request.filter = vec!["nothing".into()];
    let error = build(&request, folder.path(), false, || Ok(support::modules())).unwrap_err();
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
    let error = build(&request, folder.path(), false, || Ok(support::modules())).unwrap_err();
    assert!(
        matches!(&error, Error::InTheWay { path: other } if *other == path),
        "{error}"
    );
    assert_eq!(fs::read_to_string(&path).unwrap(), "mine");
    assert!(
        !folder.path().join("manifest.json").exists(),
        "nothing is half-written"
    );
    build(&request, folder.path(), true, || Ok(support::modules())).unwrap();
    // An edit counts as the user's too.
    fs::write(&path, "edited").unwrap();
    assert!(build(&request, folder.path(), false, || Ok(support::modules())).is_err());
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
}

/// A crate with a path dependency, a workspace and a lock file.
fn write_crates(root: &Path) {
    let write = |path: &str, text: &str| {
        let path = root.join(path);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, text).unwrap();
    };
    write(
        "Cargo.toml",
        "[workspace]\nmembers = [\"a\", \"b\"]\n[workspace.dependencies]\nb = { path = \"b\" }\n",
    );
    write(
        "Cargo.lock",
        "[[package]]\nname = \"glam\"\nversion = \"1.0.0\"\nsource = \"s\"\nchecksum = \"c\"\n[[package]]\nname = \"rayon\"\nversion = \"1.0.0\"\nsource = \"s\"\n",
    );
    write(
        "a/Cargo.toml",
        "[package]\nname = \"a\"\n[dependencies]\nb.workspace = true\n",
    );
    write("a/src/lib.rs", "// a\n");
    write(
        "b/Cargo.toml",
        "[package]\nname = \"b\"\n[dependencies]\nglam = \"1\"\n[target.'cfg(not(target_arch = \"spirv\"))'.dependencies]\nrayon = \"1\"\n",
    );
    write("b/src/lib.rs", "// b\n");
    write("b/src/native/host.rs", "// host\n");
    write("b/tests/t.rs", "// test\n");
}

#[test]
fn the_source_hash_follows_the_sources_alone() {
    let (one, two) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    write_crates(one.path());
    write_crates(two.path());
    let hash = |root: &Path| source_hash::hash(&root.join("a/Cargo.toml")).unwrap();
    let before = hash(one.path());
    assert_eq!(
        before.sha256,
        hash(two.path()).sha256,
        "the place does not count"
    );
    assert_eq!((before.name.as_str(), before.files.len()), ("a", 5));
    let changes = |path: &str, text: &str| {
        let path = two.path().join(path);
        let old = fs::read_to_string(&path).ok();
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(&path, text).unwrap();
        let changed = hash(two.path()).sha256 != before.sha256;
        match old {
            Some(old) => fs::write(&path, old).unwrap(),
            None => fs::remove_file(&path).unwrap(),
        }
        changed
    };
    assert!(changes("a/src/lib.rs", "// A\n"));
    assert!(changes("b/src/lib.rs", "// B\n"));
    assert!(changes("b/src/more.rs", ""));
    assert!(changes(
        "a/Cargo.toml",
        "[package]\nname = \"a\"\n[dependencies]\nb = { path = \"../b\" }\n"
    ));
    let lock = fs::read_to_string(two.path().join("Cargo.lock")).unwrap();
    assert!(changes("Cargo.lock", &lock.replacen("1.0.0", "1.0.1", 1)));
    assert!(!changes(
        "Cargo.lock",
        &lock.replace(
            "\"rayon\"\nversion = \"1.0.0\"",
            "\"rayon\"\nversion = \"1.0.1\""
        )
    ));
    assert!(!changes("a/src/lib.rs", "// a\r\n"));
    assert!(!changes("b/src/native/host.rs", "// other\n"));
    assert!(!changes("b/tests/t.rs", "// other\n"));
    assert!(!changes("a/README.md", "other"));
    fs::remove_file(two.path().join("b/Cargo.toml")).unwrap();
    let error = source_hash::hash(&two.path().join("a/Cargo.toml")).unwrap_err();
    assert!(error.to_string().contains("Cargo.toml"), "{error}");
}

#[test]
fn bundles_are_read_back_and_never_stale() {
    let (crates, folder) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    write_crates(crates.path());
    let sources = source_hash::hash(&crates.path().join("a/Cargo.toml")).unwrap();
    let Modules::Raw(raw) = support::modules() else {
        unreachable!()
    };
    let modules = finish_all(&raw, &support::all()).unwrap();
    let bundle = Bundle::new(&sources, "0.10.0", modules);
    fs::write(folder.path().join("old.spv"), "").unwrap();
    bundle.write(folder.path()).unwrap();
    assert!(!folder.path().join("old.spv").exists());
    let read = Bundle::read(folder.path()).unwrap();
    assert_eq!(read, bundle);
    read.check_current(&sources.sha256).unwrap();
    let error = read.check_current(&"1".repeat(64)).unwrap_err();
    assert!(matches!(error, Error::Stale { .. }), "{error}");
    assert!(error.advice().unwrap().contains("hankel toolchain install"));
    let mut older = read.clone();
    older.origin.pipeline -= 1;
    assert!(older.check_current(&sources.sha256).is_err());
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
    let sources = source_hash::hash(&path.join("Cargo.toml")).unwrap();
    assert_eq!(sources.name, "my-kernels");
    assert!(
        sources
            .folders
            .iter()
            .any(|folder| folder.ends_with("kernels/macros"))
    );
    for (name, problem) in [
        ("my-kernels", "not empty"),
        ("Mine", "no name"),
        ("1a", "no name"),
    ] {
        let error = scaffold(&folder.path().join(name), &dsl)
            .unwrap_err()
            .to_string();
        assert!(error.contains(problem), "{error}");
    }
}
