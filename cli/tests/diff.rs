//! `hankel diff` as a reviewer types it.

use std::path::Path;
use std::process::{Command, Output};

use serde_json::Value;

fn hankel(folder: &Path, line: &str) -> Output {
    Command::new(env!("CARGO_BIN_EXE_hankel"))
        .args(line.split_whitespace())
        .current_dir(folder)
        .output()
        .expect("hankel starts")
}

fn succeeds(folder: &Path, line: &str) -> String {
    let output = hankel(folder, line);
    let error = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{line}: {error}");
    String::from_utf8(output.stdout).expect("text")
}

fn fails(folder: &Path, line: &str, code: i32, words: &[&str]) {
    let output = hankel(folder, line);
    let error = String::from_utf8_lossy(&output.stderr).replace(['│', '\n'], " ");
    let error = error.split_whitespace().collect::<Vec<_>>().join(" ");
    assert_eq!(output.status.code(), Some(code), "{line}: {error}");
    for word in words {
        assert!(error.contains(word), "{line}: no `{word}` in {error}");
    }
}

#[test]
fn a_reviewer_sees_what_changed() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let at = folder.path();
    let build = |out: &str, options: &str| succeeds(at, &format!("build --out {out} {options}"));
    build("one", "--kernel vsm --kernel hamburger_4msm");
    build("same", "--kernel vsm --kernel hamburger_4msm");
    build(
        "moved",
        "--kernel vsm --kernel hausdorff_4msm --hlsl-space 3",
    );

    let same = succeeds(at, "diff one same --deny any");
    assert!(same.contains("nothing changed"), "{same}");

    // Another space is something that an engine binds; a new kernel is not, a missing one is.
    let moved = succeeds(at, "diff one moved");
    for line in [
        "- kernel hamburger_4msm  [interface]",
        "+ kernel hausdorff_4msm",
        "~ kernel vsm",
        "options.placement.hlsl_space: none -> 3",
        "bindings.out.places.hlsl.space: 0 -> 3  [interface]",
        "text: hlsl",
    ] {
        assert!(moved.contains(line), "no `{line}` in\n{moved}");
    }
    let denied = hankel(at, "diff one moved --deny interface");
    assert_eq!(denied.status.code(), Some(1));
    let offered = hankel(at, "diff moved moved --deny interface");
    assert_eq!(offered.status.code(), Some(0));
}

#[test]
fn numbers_of_two_builds_are_compared() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let at = folder.path();
    // The same bindings, and another encoding of the moments for good.
    succeeds(at, "build --out one --kernel shade_hamburger");
    succeeds(
        at,
        "build --out two --kernel shade_hamburger --set encoding=1",
    );
    let text = succeeds(at, "diff one two --run --format json");
    let json: Value = serde_json::from_str(&text).expect("JSON");
    let found = &json["numbers"]["shade_hamburger"];
    assert!(found["values"].as_u64() > Some(1000), "{text}");
    assert!(found["beyond"].as_u64() > Some(0), "{text}");
    let item = &json["items"]["kernel shade_hamburger"];
    let costs = item["changes"].as_array().expect("changes").iter();
    let registers = costs.filter(|it| it["what"] == "cost.operations").count();
    assert_eq!(registers, 1, "{text}");
}

#[test]
fn libraries_are_compared_by_their_signatures() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let at = folder.path();
    succeeds(at, "build --form functions --out one");
    succeeds(at, "build --form functions --out two --prefix other");
    let text = succeeds(at, "diff one two");
    assert!(text.contains("prefix: hankel -> other"), "{text}");
    assert!(text.contains("+ file "), "{text}");
    fails(at, "diff one nowhere", 2, &["nowhere", "no such folder"]);
}

#[test]
fn what_cannot_be_compared_is_refused() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let at = folder.path();
    std::fs::create_dir(at.join("empty")).expect("a folder");
    std::fs::create_dir(at.join("broken")).expect("a folder");
    std::fs::write(at.join("broken/manifest.json"), "{").expect("a file");
    succeeds(at, "build --out one --kernel vsm");
    fails(at, "diff one empty", 2, &["empty", "neither manifest.json"]);
    fails(at, "diff broken one", 2, &["broken", "manifest.json"]);
    // A module that is not the one of the manifest never reaches a driver.
    let build = |out: &str, value: u32| {
        let line = format!("build --out {out} --kernel shade_hamburger --set encoding={value}");
        succeeds(at, &line);
    };
    build("first", 1);
    build("second", 2);
    std::fs::write(at.join("second/spirv/shade_hamburger.spv"), "x").expect("a file");
    let words = ["second", "shade_hamburger.spv", "is not the file"];
    fails(at, "diff first second --run", 2, &words);
}
