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

    // What is not run is said, and why.
    says(
        &desk,
        "build --out moved --kernel shade_hamburger --hlsl-space 3",
    );
    let text = says(&desk, "diff one moved --run");
    assert!(
        text.contains("shade_hamburger: not run: its interface changed"),
        "{text}"
    );
    says(
        &desk,
        "build --out wgsl --kernel shade_hamburger --target wgsl",
    );
    desk.hankel("diff one wgsl --run")
        .fails(2, &["--run", "wgsl", "no SPIR-V", "--target spirv"]);
    for (out, value) in [("first", 1), ("second", 2)] {
        let options = format!("--kernel shade_hamburger --variant _v:encoding={value}");
        says(&desk, &format!("build --out {out} {options}"));
    }
    let text = says(&desk, "diff first second --run");
    assert!(
        text.contains("shade_hamburger_v: not run: the crate has no kernel"),
        "{text}"
    );
}

#[test]
#[cfg(feature = "frames")]
fn a_scene_by_both_builds_is_compared() {
    let desk = Desk::new();
    let scene = "[geometry]\nprocedural = \"box\"\n[camera]\neye = [3.0, 3.0, 4.0]\ntarget = [0.0, 0.5, 0.0]\n\
                 [light]\ndirection = [-1.0, -2.0, -0.5]\n[shadow]\nsize = 128\nfilter = 5\n\
                 [output]\nwidth = 96\nheight = 64\n";
    desk.write("s.toml", scene);
    says(&desk, "build --out one --kernel shade_hamburger");
    // As if the map held depths in [0, 1].
    says(
        &desk,
        "build --out two --kernel shade_hamburger --set encoding=1",
    );
    let share = |old: &str, new: &str| {
        let line = format!("diff {old} {new} --scene s.toml --out p.png --format json");
        let json: Value = serde_json::from_str(&says(&desk, &line)).expect("JSON");
        let pictures = &json["pictures"];
        assert_eq!(pictures["kernels"][0], "shade_hamburger", "{json}");
        for file in pictures["files"].as_array().expect("files") {
            let file = desk.path(file.as_str().expect("a path"));
            assert!(file.is_file(), "{}", file.display());
        }
        pictures["difference"]["over_8"].as_f64().expect("a share")
    };
    assert_eq!(share("one", "one").to_bits(), 0.0_f64.to_bits());
    let changed = share("one", "two");
    assert!(changed > 0.01, "{changed}");

    // Where another text is bound does not matter to SPIR-V.
    says(
        &desk,
        "build --out moved --kernel shade_hamburger --hlsl-space 3",
    );
    assert_eq!(share("one", "moved").to_bits(), 0.0_f64.to_bits());

    says(&desk, "build --out other --kernel vsm");
    desk.hankel("diff other other --scene s.toml --out p.png")
        .fails(2, &["no kernel", "shade_hamburger"]);
    desk.hankel("diff one two --scene s.toml --out s.toml")
        .fails(2, &["s.toml", "overwritten"]);
    assert_eq!(desk.read("s.toml"), scene);
    let manifest = desk.read("one/manifest.json");
    desk.write(
        "one/manifest.json",
        manifest.replacen("\"binding\": 0", "\"binding\": 9", 1),
    );
    desk.hankel("diff one two --scene s.toml --out p.png")
        .fails(2, &["one", "shade_hamburger", "binding: 9 -> 0"]);
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
