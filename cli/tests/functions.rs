//! Libraries of functions from the command line.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

fn hankel(arguments: &[&str], folder: &Path) -> Output {
    Command::new(env!("CARGO_BIN_EXE_hankel"))
        .args(arguments)
        .current_dir(folder)
        .output()
        .expect("hankel starts")
}

fn root() -> PathBuf {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    here.parent().expect("cli/ lies in the root").to_owned()
}

#[test]
fn libraries_are_built_and_checked_inside_a_checkout_and_outside() {
    let elsewhere = tempfile::tempdir().unwrap();
    let out = elsewhere.path().join("libraries");
    let out = out.to_str().unwrap();
    // Outside, from the sources that are in the program.
    let built = hankel(
        &["build", "--form", "functions", "--out", out],
        elsewhere.path(),
    );
    let words = String::from_utf8_lossy(&built.stdout).into_owned();
    assert!(
        built.status.success(),
        "{words}{}",
        String::from_utf8_lossy(&built.stderr)
    );
    assert!(words.contains(" functions, "), "{words}");
    let hlsl = std::fs::read_to_string(Path::new(out).join("hlsl/hankel_shadows.hlsl")).unwrap();
    assert!(hlsl.contains("float hankel_hamburger_bound(float4 moments, float depth)"));
    // Inside, from those on disk: the same.
    let checked = hankel(&["check", out], &root());
    let words = String::from_utf8_lossy(&checked.stdout).into_owned();
    assert_eq!(checked.status.code(), Some(0), "{words}");

    std::fs::remove_file(Path::new(out).join("msl/hankel_shadows.h.metal")).unwrap();
    let checked = hankel(&["check", out], &root());
    assert_eq!(checked.status.code(), Some(1));
    let words = String::from_utf8_lossy(&checked.stdout).into_owned();
    assert!(
        words.contains("msl/hankel_shadows.h.metal is missing"),
        "{words}"
    );
    // What differs is shown.
    let edited = Path::new(out).join("hlsl/hankel_shadows.hlsl");
    let text = std::fs::read_to_string(&edited).unwrap();
    std::fs::write(&edited, text.replacen("0.628f", "0.629f", 1)).unwrap();
    let checked = hankel(&["check", out], &root());
    let words = String::from_utf8_lossy(&checked.stdout).into_owned();
    for part in [
        "hlsl/hankel_shadows.hlsl differs",
        "\n-static",
        "0.629f",
        "\n+static",
        "2 files no longer follow",
    ] {
        assert!(words.contains(part), "`{part}` is not in {words}");
    }
}

#[test]
fn a_wrong_prefix_and_a_crate_without_libraries_are_misuse() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("x");
    let out = out.to_str().unwrap();
    let wrong = [
        "build",
        "--form",
        "functions",
        "--out",
        out,
        "--prefix",
        "My-Engine",
    ];
    let wrong = hankel(&wrong, folder.path());
    assert_eq!(wrong.status.code(), Some(2));
    let words = String::from_utf8_lossy(&wrong.stderr);
    assert!(
        words.contains("--prefix `My-Engine` cannot be used"),
        "{words}"
    );
    let manifest = root().join("tests/conformance/Cargo.toml");
    let manifest = manifest.to_str().unwrap();
    let none = [
        "build",
        "--form",
        "functions",
        "--out",
        out,
        "--manifest-path",
        manifest,
    ];
    let none = hankel(&none, folder.path());
    assert_eq!(none.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&none.stderr).contains("library!"));
    assert!(!Path::new(out).exists());
}

#[test]
fn what_libraries_follow_from_is_known_to_build_tools() {
    let elsewhere = tempfile::tempdir().unwrap();
    let manifest = root().join("kernels/shadows/Cargo.toml");
    let manifest = manifest.to_str().unwrap();
    let line = "build --form functions --out lib --depfile lib.d --manifest-path";
    let mut arguments: Vec<&str> = line.split(' ').collect();
    arguments.push(manifest);
    let built = hankel(&arguments, elsewhere.path());
    assert!(
        built.status.success(),
        "{}",
        String::from_utf8_lossy(&built.stderr)
    );
    let rule = std::fs::read_to_string(elsewhere.path().join("lib.d")).unwrap();
    assert!(rule.starts_with("lib/functions.json:"), "{rule}");
    for file in [
        "shadows/Cargo.toml",
        "shadows/src/library",
        "moments/src/lib.rs",
    ] {
        assert!(rule.contains(file), "no {file} in {rule}");
    }
}

#[test]
fn a_choice_of_functions_is_what_an_engine_takes() {
    let elsewhere = tempfile::tempdir().unwrap();
    let run = |line: &str| {
        let arguments: Vec<&str> = line.split(' ').collect();
        let output = hankel(&arguments, elsewhere.path());
        let words = [output.stdout, output.stderr].concat();
        (
            output.status.code(),
            String::from_utf8_lossy(&words).into_owned(),
        )
    };
    let size = || {
        let path = elsewhere.path().join("lib/wgsl/hankel_shadows.wgsl");
        std::fs::read_to_string(path).expect("a library")
    };
    assert_eq!(run("build --form functions --out lib").0, Some(0));
    let whole = size();
    let (code, words) =
        run("build --form functions --out lib --function hamburger_bound --function mix_*");
    // That fewer are chosen is no change of a signature.
    assert_eq!(code, Some(0), "{words}");
    let few = size();
    assert!(
        few.len() * 4 < whole.len(),
        "{} of {}",
        few.len(),
        whole.len()
    );
    assert!(few.contains("fn hankel_hamburger_bound(") && few.contains("fn hankel_mix_bias("));
    assert!(few.contains("HANKEL_SHADOWS_SYMMETRIC_FOUR_SIXTEEN_BITS_TARGET"));
    assert!(!few.contains("fn hankel_hausdorff_bound("));
    // The folder remembers the choice.
    assert_eq!(run("check lib").0, Some(0));

    let (code, words) = run("build --form functions --out lib --function hamburger_bonud");
    assert_eq!(code, Some(2), "{words}");
    assert!(
        words.contains("no function is named `hamburger_bonud`")
            && words.contains("hamburger_bound"),
        "{words}"
    );
    let (code, words) = run("build --out shaders --function mix_*");
    assert_eq!(code, Some(2), "{words}");
    assert!(words.contains("--form functions"), "{words}");
}
