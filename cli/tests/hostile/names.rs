//! Names, texts and values that mean something to somebody else.

use std::ffi::OsStr;
use std::fs;
use std::os::unix::ffi::OsStrExt;

use crate::desk::{Desk, run};

/// Colours, titles, a cleared screen: nothing of what others wrote steers the terminal.
#[test]
fn text_of_others_does_not_steer_the_terminal() {
    const ESCAPE: &str = "\u{1b}[31m";
    let desk = Desk::new();
    desk.write("rows.csv", format!("{ESCAPE}b1,b2,depth\n0.5,0.3,0.2\n"));
    desk.write("cell.csv", format!("b1,b2,depth\n0.5,{ESCAPE},0.2\n"));
    desk.write(
        "scene.toml",
        format!("[geometry]\nprocedural = \"box\"\n\"{ESCAPE}\" = 1\n"),
    );
    let model = format!("{{\"asset\":{{\"version\":\"{ESCAPE}\"}}}}");
    desk.write("model.gltf", model);
    desk.write(
        "budget.toml",
        format!("[budget]\n\"\\u001b[31m\" = 1 # {ESCAPE}\n"),
    );
    desk.hankel("build --out s --kernel vsm").code(0);
    let wgsl = desk.path("s/wgsl/vsm.wgsl");
    fs::write(&wgsl, format!("// {ESCAPE}\n")).expect("the desk can be written");
    desk.write(
        "bin/glslangValidator",
        format!("#!/bin/sh\necho '{ESCAPE} 1'\n"),
    );
    let status = std::process::Command::new("chmod")
        .args(["+x", "bin/glslangValidator"])
        .current_dir(desk.path("."))
        .status();
    assert!(status.expect("chmod runs").success());
    let path = format!("{}:/usr/bin:/bin", desk.path("bin").display());
    let mut kernel = desk.command("list --kernel");
    kernel.arg(format!("{ESCAPE}x"));
    let mut commands = vec![kernel];
    for line in [
        "eval vsm --input rows.csv --output o.csv",
        "eval vsm --input cell.csv --output o.csv",
        "render scene.toml --out p.png",
        "check s --kernel vsm",
        "check s --kernel vsm --format json",
        "check s --kernel vsm --budget budget.toml",
        "doctor",
        "doctor --format json",
    ] {
        let mut command = desk.command(line);
        command.env("PATH", &path);
        commands.push(command);
    }
    for mut command in commands {
        let done = run(&mut command);
        let bytes = [done.0.stdout.clone(), done.0.stderr.clone()].concat();
        assert!(
            !bytes.contains(&0x1b),
            "{command:?}: {}{}",
            done.out(),
            done.err()
        );
        let said = format!("{}{}", done.out(), done.err());
        assert!(
            said.contains("u{1b}") || said.contains("u001b"),
            "{command:?}: {said}"
        );
    }
}

#[test]
fn a_pattern_of_many_wildcards_is_matched_at_once() {
    let desk = Desk::new();
    let pattern = format!("{}a*b*c*zz", "*".repeat(40));
    desk.hankel(&format!("list --kernel {pattern}"))
        .fails(2, &["no kernel is named"]);
    let out = desk
        .hankel("list --kernel **v*s*m** --kernel quantize*4*unit")
        .code(0)
        .out();
    for name in ["vsm", "quantize_4_unit", "dequantize_4_unit"] {
        assert_eq!(
            out.contains(&format!("\n{name} ")),
            !name.starts_with('d'),
            "{out}"
        );
    }
}

#[test]
fn what_is_set_is_used_or_refused() {
    let desk = Desk::new();
    run(desk
        .command("list --kernel vsm")
        .env("HANKEL_SIMD", "avx9000"))
    .fails(2, &["HANKEL_SIMD=avx9000", "scalar"]);
    run(desk
        .command("list --kernel vsm")
        .env("HANKEL_SIMD", "scalar"))
    .code(0);
    for (set, words) in [
        ("--set encoding=1 --set encoding=2", "was set to 1 already"),
        ("--set encoding=4294967296", "from 0 to 4294967295"),
        ("--set encoding=-1", "from 0 to"),
        ("--set encoding", "no `=`"),
    ] {
        desk.hankel(&format!("build --out s --kernel shade_hamburger {set}"))
            .fails(2, &[words]);
    }
}

#[test]
fn names_of_crates_are_names() {
    let desk = Desk::new();
    for name in [
        "fn",
        "self",
        "gen",
        "hankel-macros",
        "hankel",
        "core",
        "proc-macro",
    ] {
        desk.hankel(&format!("new {name}"))
            .fails(2, &[&format!("`{name}`")]);
    }
    assert_eq!(desk.names(), [""; 0]);
    // There may be an empty folder.
    fs::create_dir(desk.path("mine")).expect("the desk");
    desk.hankel("new mine").code(0);
    assert_eq!(desk.names(), ["mine"]);
    assert!(desk.path("mine/src/lib.rs").is_file());
}

/// JSON holds text alone: a path that is none comes out as on a terminal, or not without a word.
#[test]
fn a_path_that_is_no_text_has_a_form_in_json() {
    let desk = Desk::new();
    desk.write(
        "scene.toml",
        "[geometry]\nprocedural = \"box\"\n[camera]\neye = [3.0, 3.0, 4.0]\ntarget = [0.0, 0.5, 0.0]\n\
         [light]\ndirection = [-1.0, -2.0, -0.5]\n[output]\nwidth = 16\nheight = 9\n",
    );
    let name = OsStr::from_bytes(b"x\xff.png");
    let done = run(desk
        .command("render scene.toml --format json --out")
        .arg(name));
    let out = done.code(0).out();
    let report: serde_json::Value = serde_json::from_str(&out).expect("it is JSON");
    assert_eq!(report["pictures"][0], "x\u{fffd}.png");
    assert!(desk.path(".").join(name).is_file());
    let done = run(desk
        .command("toolchain status --format json")
        .env("HANKEL_CACHE", name));
    done.fails(3, &["cannot be written as JSON", "UTF-8", "--format json"]);
    assert_eq!(done.out(), "");
}

/// Make has no spelling for a line break: what follows it would be a rule.
#[test]
fn a_path_with_a_line_break_is_in_no_rule() {
    let desk = Desk::new();
    let done = run(desk
        .command("build --kernel vsm --depfile d --out")
        .arg("d4\nall: evil"));
    done.fails(2, &["--depfile", "d4\\nall: evil", "line break"]);
    assert!(desk.names().is_empty(), "{:?}", desk.names());
}

/// The smallest direction that a float can say is one.
#[test]
fn a_short_direction_is_a_direction() {
    let desk = Desk::new();
    desk.write(
        "scene.toml",
        "[geometry]\nprocedural = \"box\"\n[camera]\neye = [3.0, 3.0, 4.0]\ntarget = [0.0, 0.5, 0.0]\n\
         [light]\ndirection = [1e-30, -1e-30, 1e-30]\n[output]\nwidth = 16\nheight = 9\n",
    );
    desk.hankel("render scene.toml --out p.png").code(0);
}

/// A prefix that no file system takes, or no GLSL compiler.
#[test]
fn a_prefix_begins_names_that_there_may_be() {
    let desk = Desk::new();
    for prefix in [&"a".repeat(65), "gl_x", "Own", "float"] {
        desk.hankel(&format!("build --form functions --out l --prefix {prefix}"))
            .fails(2, &["--prefix", "at most 64"]);
    }
    assert!(!desk.path("l").exists());
}

#[test]
fn a_file_where_a_folder_belongs_is_misuse() {
    let desk = Desk::new();
    desk.write("file", "");
    desk.hankel("build --out file --kernel vsm")
        .fails(2, &["file"]);
    desk.hankel("check file --kernel vsm").fails(2, &["file"]);
    desk.hankel("new file/crate-of-mine").code(2);
    assert_eq!(desk.read("file"), "");
}

/// An option or a key that does nothing is not passed over.
#[test]
fn what_would_do_nothing_is_refused() {
    const MODEL: &str = "{\"asset\":{\"version\":\"3.0\"}}";
    let desk = Desk::new();
    let scene = |light: &str| {
        format!(
            "[geometry]\nprocedural = \"box\"\n[camera]\neye = [3.0, 3.0, 4.0]\ntarget = [0.0, 0.5, 0.0]\n\
             [light]\ndirection = [-1.0, -2.0, -1.0]\n{light}[output]\nwidth = 16\nheight = 9\n"
        )
    };
    desk.write("scene.toml", scene(""));
    desk.write("shape.toml", scene("shape = \"square\"\n"));
    desk.write("model.gltf", MODEL);
    let model = scene("").replace("procedural = \"box\"", "model = \"model.gltf\"");
    desk.write("model.toml", model);
    for (line, words) in [
        (
            "build --out s --kernel vsm --prefix own",
            ["--prefix", "--form functions"],
        ),
        (
            "render scene.toml --out p.jpg",
            ["p.jpg", "Name a file .png"],
        ),
        ("render shape.toml --out p.png", ["light.shape", "radius"]),
        (
            "render model.toml --out p.png",
            ["glTF version is 3.0", "model.gltf"],
        ),
    ] {
        desk.hankel(line).fails(2, &words);
    }
    assert!(!desk.path("s").exists() && !desk.path("p.jpg").exists());
}

/// A folder of which the own record is damaged: the cause comes first, and differences are cut.
#[test]
fn a_damaged_manifest_is_told_in_a_page() {
    let desk = Desk::new();
    desk.hankel("build --out s --kernel vsm").code(0);
    desk.write("s/manifest.json", "{");
    let done = desk.hankel("check s");
    done.code(1);
    assert!(done.err().contains("manifest.json"), "{}", done.err());
    assert!(
        done.err().contains("a build without options"),
        "{}",
        done.err()
    );
    assert!(done.out().len() < 200_000, "{} bytes", done.out().len());
    assert!(done.out().contains("\nmissing: "), "{}", done.out());
    let whole = desk.hankel("check s --format json");
    assert!(whole.code(1).out().len() > done.out().len());
}
