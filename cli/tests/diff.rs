//! `hankel diff` as a reviewer types it.

mod desk;

use desk::Desk;
use serde_json::Value;

/// What the command says where all goes well.
fn says(desk: &Desk, line: &str) -> String {
    desk.hankel(line).code(0).out()
}

#[test]
fn a_reviewer_sees_what_changed() {
    let desk = Desk::new();
    let build = |out: &str, options: &str| says(&desk, &format!("build --out {out} {options}"));
    build("one", "--kernel vsm --kernel hamburger_4msm");
    build("same", "--kernel vsm --kernel hamburger_4msm");
    build(
        "moved",
        "--kernel vsm --kernel hausdorff_4msm --hlsl-space 3",
    );

    let same = says(&desk, "diff one same --deny any");
    assert!(same.contains("nothing changed"), "{same}");

    // Another space is something that an engine binds; a new kernel is not, a missing one is.
    let moved = says(&desk, "diff one moved");
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
    desk.hankel("diff one moved --deny interface").code(1);
    // Neither a text nor a new kernel is of the interface.
    build(
        "more",
        "--kernel vsm --kernel hamburger_4msm --kernel hausdorff_4msm",
    );
    desk.hankel("diff one more --deny interface").code(0);
    desk.hankel("diff one more --deny any").code(1);
}

#[test]
fn numbers_of_two_builds_are_compared() {
    let desk = Desk::new();
    // The same bindings, and another encoding of the moments for good.
    says(&desk, "build --out one --kernel shade_hamburger");
    says(
        &desk,
        "build --out two --kernel shade_hamburger --set encoding=1",
    );
    let text = says(&desk, "diff one two --run --format json");
    let json: Value = serde_json::from_str(&text).expect("JSON");
    let found = &json["numbers"]["shade_hamburger"];
    assert!(found["values"].as_u64() > Some(1000), "{text}");
    assert!(found["beyond"].as_u64() > Some(0), "{text}");
    let item = &json["items"]["kernel shade_hamburger"];
    let changes = item["changes"].as_array().expect("changes");
    assert!(
        changes.iter().any(|it| it["what"] == "cost.operations"),
        "{text}"
    );
}

#[test]
fn libraries_are_compared() {
    let desk = Desk::new();
    says(&desk, "build --form functions --out one");
    says(&desk, "build --form functions --out two --prefix other");
    let text = says(&desk, "diff one two");
    assert!(text.contains("prefix: hankel -> other"), "{text}");
    assert!(text.contains("+ file "), "{text}");
    desk.hankel("diff one nowhere")
        .fails(2, &["nowhere", "no such folder"]);
}

#[test]
fn what_cannot_be_compared_is_refused() {
    let desk = Desk::new();
    std::fs::create_dir(desk.path("empty")).expect("a folder");
    desk.write("broken/manifest.json", "{");
    says(&desk, "build --out one --kernel vsm");
    desk.hankel("diff one empty")
        .fails(2, &["empty", "neither manifest.json"]);
    desk.hankel("diff broken one")
        .fails(2, &["broken", "manifest.json"]);
    // A module that is not the one of the manifest never reaches a driver.
    let build = |out: &str, value: u32| {
        let line = format!("build --out {out} --kernel shade_hamburger --set encoding={value}");
        says(&desk, &line);
    };
    build("first", 1);
    build("second", 2);
    desk.write("second/spirv/shade_hamburger.spv", "x");
    let words = ["second", "shade_hamburger.spv", "is not the file"];
    desk.hankel("diff first second --run").fails(2, &words);
}
