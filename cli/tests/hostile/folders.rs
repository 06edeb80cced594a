//! Output folders: built twice as different things, edited, damaged.

use std::fs;
use std::os::unix::fs::symlink;

use crate::desk::Desk;

/// `check` could not tell which build a file belongs to.
#[test]
fn shaders_and_libraries_do_not_share_a_folder() {
    let desk = Desk::new();
    desk.hankel("build --out s --kernel vsm").code(0);
    let both = ["manifest.json", "shaders", "give another one"];
    desk.hankel("build --form functions --out s")
        .fails(2, &both);
    assert!(!desk.path("s/functions.json").exists());
    desk.hankel("build --form functions --out lib").code(0);
    let both = ["functions.json", "libraries", "give another one"];
    desk.hankel("build --out lib --kernel vsm").fails(2, &both);
    assert!(!desk.path("lib/manifest.json").exists());
    // However it came to be.
    fs::copy(desk.path("s/manifest.json"), desk.path("lib/manifest.json")).unwrap();
    desk.hankel("check lib").fails(2, &["manifest.json", "lib"]);
}

#[test]
fn everything_in_a_folder_of_libraries_is_checked() {
    let desk = Desk::new();
    desk.hankel("build --form functions --out lib").code(0);
    desk.hankel("check lib").code(0);
    for (option, named) in [
        ("--budget nope.toml", "--budget"),
        ("--kernel zzz", "--kernel"),
        ("--scene nope.toml", "--scene"),
    ] {
        let line = format!("check lib {option}");
        desk.hankel(&line)
            .fails(2, &[named, "libraries of functions"]);
    }
    desk.write("lib/hlsl/own.hlsl", "x");
    fs::create_dir(desk.path("lib/.hankel")).unwrap();
    let done = desk.hankel("check lib");
    let out = done.code(1).out();
    assert!(out.contains("hlsl/own.hlsl is extra"), "{out}");
    assert!(out.contains("stopped before its end"), "{out}");
}

#[test]
fn a_damaged_record_of_libraries_is_named() {
    let desk = Desk::new();
    desk.hankel("build --form functions --out lib").code(0);
    let record = desk.read("lib/functions.json");
    desk.write("lib/functions.json", "{");
    desk.hankel("check lib")
        .fails(2, &["lib/functions.json", "not a record of libraries"]);
    let prefix = "\"prefix\": \"hankel\"";
    assert!(record.contains(prefix));
    let other = record.replace(prefix, "\"prefix\": \"../../etc/passwd\"");
    desk.write("lib/functions.json", other);
    desk.hankel("check lib")
        .fails(2, &["lib/functions.json", "../../etc/passwd"]);
    fs::remove_file(desk.path("lib/functions.json")).unwrap();
    fs::create_dir(desk.path("lib/functions.json")).unwrap();
    desk.hankel("check lib")
        .fails(2, &["lib/functions.json", "a folder"]);
}

#[test]
fn edited_shaders_are_not_compared_by_what_their_manifest_says() {
    let desk = Desk::new();
    desk.hankel("build --out old --kernel vsm").code(0);
    desk.hankel("build --out new --kernel vsm").code(0);
    desk.hankel("diff old new --deny any").code(0);
    desk.write("new/wgsl/vsm.wgsl", "evil");
    desk.hankel("diff old new --deny any")
        .fails(2, &["wgsl/vsm.wgsl", "build it again"]);
    desk.hankel("build --out new --kernel vsm --force").code(0);
    fs::remove_file(desk.path("new/spirv/vsm.spv")).unwrap();
    desk.hankel("diff old new")
        .fails(2, &["spirv/vsm.spv", "is missing"]);
    // A header is compared, too.
    desk.hankel("build --out new --kernel vsm").code(0);
    let header = desk.read("new/include/hankel.h");
    let manifest = desk.read("new/manifest.json");
    let edited = format!("{header}\n");
    let hash = |text: &str| hankel_codegen::files::sha256(text.as_bytes());
    assert!(manifest.contains(&hash(&header)));
    desk.write("new/include/hankel.h", &edited);
    desk.write(
        "new/manifest.json",
        manifest.replace(&hash(&header), &hash(&edited)),
    );
    let done = desk.hankel("diff old new --deny any");
    let out = done.code(1).out();
    assert!(out.contains("~ file include/hankel.h"), "{out}");
}

#[test]
fn a_budget_that_cannot_be_read_is_not_passed_over() {
    let desk = Desk::new();
    desk.hankel("build --out s --kernel vsm").code(0);
    symlink("nowhere", desk.path("hankel.toml")).unwrap();
    desk.hankel("check s").fails(2, &["hankel.toml"]);
    fs::remove_file(desk.path("hankel.toml")).unwrap();
    fs::create_dir(desk.path("hankel.toml")).unwrap();
    desk.hankel("check s").fails(2, &["hankel.toml"]);
}

#[test]
fn a_depfile_takes_no_place_of_the_build() {
    let desk = Desk::new();
    for (line, place) in [
        (
            "build --out d --kernel vsm --depfile d/hlsl/vsm.hlsl",
            "hlsl/vsm.hlsl",
        ),
        (
            "build --out d --kernel vsm --depfile d/manifest.json",
            "manifest.json",
        ),
        (
            "build --out d --form functions --depfile ./d/c/hankel_shadows.h",
            "c/hankel_shadows.h",
        ),
    ] {
        desk.hankel(line).fails(2, &["--depfile", place]);
        assert!(!desk.path("d").exists(), "{line}");
    }
    // However the paths are written.
    let absolute = desk.path("d/shaders.d");
    let line = format!(
        "build --out d --kernel vsm --depfile {}",
        absolute.display()
    );
    desk.hankel(&line).code(0);
    desk.hankel("build --out ./e --kernel vsm --depfile e/shaders.d")
        .code(0);
    assert!(absolute.is_file() && desk.path("e/shaders.d").is_file());
}
