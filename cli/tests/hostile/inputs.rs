//! Files that never end, that nobody writes to, or that are larger than memory.

use std::os::unix::fs::PermissionsExt;
use std::time::{Duration, Instant};

use crate::desk::{Desk, run};

const SCENE: &str = "[geometry]\nmodel = \"MODEL\"\n[camera]\neye = [3.0, 3.0, 4.0]\n\
target = [0.0, 0.5, 0.0]\n[light]\ndirection = [-1.0, -2.0, -0.5]\n[output]\nwidth = 16\nheight = 9\n";

const GLTF: &str = r#"{"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],"nodes":[{"mesh":0}],
"meshes":[{"primitives":[{"attributes":{"POSITION":0}}]}],
"accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3","min":[0,0,0],"max":[1,1,1]}],
"bufferViews":[{"buffer":0,"byteLength":36}],"buffers":[{"byteLength":36,"uri":"URI"}]}"#;

/// What is no regular file, or has no end, is refused by its name and at once.
#[test]
fn devices_and_pipes_are_no_inputs() {
    let desk = Desk::new();
    desk.fifo("fifo");
    for place in ["fifo", "/dev/zero", "."] {
        let what = match place {
            "fifo" => "a pipe",
            "." => "a folder",
            _ => "a device",
        };
        let words = [what, "regular file"];
        desk.hankel(&format!("render {place} --out p.png"))
            .fails(2, &words);
        let scene = desk.write("scene.toml", SCENE.replace("MODEL", place));
        desk.hankel(&format!("render {} --out p.png", scene.display()))
            .fails(2, &words);
        desk.write("model.gltf", GLTF.replace("URI", place));
        desk.write("scene.toml", SCENE.replace("MODEL", "model.gltf"));
        desk.hankel("render scene.toml --out p.png")
            .fails(2, &words);
        desk.hankel("build --out s --kernel vsm").code(0);
        desk.hankel(&format!("check s --kernel vsm --budget {place}"))
            .fails(2, &words);
        for option in ["--known", "--absent"] {
            desk.hankel(&format!("parity --matrix --column native {option} {place}"))
                .fails(2, &words);
        }
        let archive = format!(
            "toolchain install --from {place} --sha256 {}",
            "0".repeat(64)
        );
        desk.hankel(&archive).fails(2, &words);
    }
    desk.hankel("check s --kernel vsm --budget nope.toml")
        .fails(2, &["nope.toml"]);
    // Tables may come through pipes, but rows have an end.
    desk.hankel("eval vsm --input /dev/zero --output o.csv")
        .fails(2, &["a device"]);
    desk.write("line.csv", vec![b'1'; 3 << 20]);
    for line in [
        "eval vsm --input line.csv --output o.csv",
        "judge --functions z --input line.csv --output o.csv",
    ] {
        desk.hankel(line).fails(2, &["line.csv", "1 MiB"]);
    }
}

/// A quoted cell may have many lines, but it has an end, which is not the file's.
#[test]
fn a_quote_that_is_not_closed_is_named_with_its_line() {
    let desk = Desk::new();
    let lines = "1\n".repeat(2 << 20);
    desk.write("long.csv", format!("b1,b2,depth\n0.5,0.3,\"{lines}"));
    desk.write("cut.csv", "b1,b2,depth\n0.5,0.3,0.2\n0.1,0.2,\"0.3");
    desk.write("header.csv", "b1,b2,\"depth\n0.5,0.3,0.2\n");
    desk.write("moments.csv", "m0,m1,z\n1,0.5,\"0.4\n");
    for (line, words) in [
        (
            "eval vsm --input long.csv",
            ["long.csv", "line 2:", "1 MiB"],
        ),
        (
            "eval vsm --input cut.csv",
            ["cut.csv", "line 3:", "not closed"],
        ),
        (
            "eval vsm --input header.csv",
            ["header.csv", "line 1:", "not closed"],
        ),
        (
            "judge --functions z --input moments.csv",
            ["moments.csv", "line 2:", "not closed"],
        ),
    ] {
        desk.hankel(&format!("{line} --output o.csv"))
            .fails(2, &words);
        assert!(!desk.path("o.csv").exists(), "{line}");
    }
    desk.write("rows.csv", "\"b1\",b2,depth\n\"0.5\n\",0.3,\"0.2\"");
    desk.hankel("eval vsm --input rows.csv --output o.csv")
        .code(0);
    assert_eq!(desk.read("o.csv").lines().count(), 2);
}

/// What is given to install from, or to pack into, is an argument as others are.
#[test]
fn what_is_given_for_a_toolchain_and_is_none_is_misuse() {
    let desk = Desk::new();
    desk.write("v.csv", "b1,b2,depth\n");
    let (other, own) = (
        "0".repeat(64),
        "91459190870844a084e08eec6cf4435531f6df8a88cf77c4da6603a55dca2411",
    );
    for (options, words) in [
        ("nope".into(), "nope"),
        ("v.csv".into(), "no checksum is known for v.csv"),
        ("v.csv --sha256 zz".into(), "`zz` is not a SHA-256"),
        (format!("v.csv --sha256 {other}"), "wrong checksum of v.csv"),
        (format!("v.csv --sha256 {own}"), "v.csv cannot be unpacked"),
    ] {
        desk.hankel(&format!("toolchain install --from {options}"))
            .fails(2, &[words]);
    }
    for name in ["rustc", "cargo"] {
        let path = desk.write(&format!("kit/bin/{name}"), "#!/bin/sh\necho rustc 1.0.0\n");
        let mode = std::fs::Permissions::from_mode(0o755);
        std::fs::set_permissions(path, mode).expect("a mode");
    }
    desk.write("kit/lib/librustc_codegen_spirv.so", "");
    let kit = desk.path("kit");
    run(desk
        .command("toolchain pack v.csv")
        .env("HANKEL_TOOLCHAIN", kit))
    .fails(2, &["v.csv"]);
    assert_eq!(desk.read("v.csv"), "b1,b2,depth\n");
}

#[test]
fn a_table_may_come_through_a_pipe() {
    let desk = Desk::new();
    let fifo = desk.fifo("rows");
    let writer = std::thread::spawn(move || std::fs::write(fifo, "b1,b2,depth\n0.5,0.3,0.2\n"));
    desk.hankel("eval vsm --input rows --output out.csv")
        .code(0);
    writer.join().expect("the writer").expect("a pipe");
    assert_eq!(desk.read("out.csv").lines().count(), 2);
}

#[test]
fn numbers_of_samples_have_an_end() {
    let desk = Desk::new();
    for line in [
        "stress --samples 18446744073709551615",
        "stress --samples 1000000000000",
        "stress --biases --samples 18446744073709551615",
        "stress --singularities --samples 1000000000000",
        "bench bounds --samples 2000000000",
        "bench bounds --samples 18446744073709551615",
        "bench bounds --rounds 18446744073709551615",
    ] {
        desk.hankel(line).code(2);
    }
}

/// A program in PATH that says nothing and does not end.
fn hanging(desk: &Desk, names: &[&str]) -> std::path::PathBuf {
    for name in names {
        let path = desk.write(&format!("bin/{name}"), "#!/bin/sh\nsleep 600 & wait\n");
        let mode = std::fs::Permissions::from_mode(0o755);
        std::fs::set_permissions(path, mode).expect("a mode");
    }
    desk.path("bin")
}

#[test]
fn tools_that_hang_are_waited_for_together_and_not_for_long() {
    let desk = Desk::new();
    let tools = [
        "glslangValidator",
        "dxc",
        "clang++-19",
        "node",
        "chromium",
        "rustc",
        "rustup",
    ];
    let bin = hanging(&desk, &tools);
    let path = format!("{}:/usr/bin:/bin", bin.display());
    let began = Instant::now();
    let doctor = run(desk.command("doctor").env("PATH", &path));
    assert!(
        doctor.out().contains("glslangValidator gave no answer"),
        "{}",
        doctor.out()
    );
    assert!(
        began.elapsed() < Duration::from_secs(40),
        "{:?}",
        began.elapsed()
    );
    let began = Instant::now();
    run(desk.command("toolchain status").env("PATH", &path));
    assert!(
        began.elapsed() < Duration::from_secs(50),
        "{:?}",
        began.elapsed()
    );
}

/// All in the same place: a tree has nothing to split by, and a ray meets them all.
#[test]
fn triangles_in_the_same_place_cost_no_more_than_one() {
    use std::fmt::Write;
    let desk = Desk::new();
    let mut indices = String::new();
    for _ in 0..100_000 {
        let _ = indices.write_str("AAABAAIA");
    }
    let triangle: Vec<u8> = [[0.0_f32, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 1.0]]
        .iter()
        .flatten()
        .flat_map(|x| x.to_le_bytes())
        .collect();
    desk.write("triangle.bin", triangle);
    let gltf = format!(
        r#"{{"asset":{{"version":"2.0"}},"scene":0,"scenes":[{{"nodes":[0]}}],"nodes":[{{"mesh":0}}],
"meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}},"indices":1}}]}}],
"accessors":[{{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3","min":[0,0,0],"max":[1,1,1]}},
{{"bufferView":1,"componentType":5123,"count":300000,"type":"SCALAR"}}],
"bufferViews":[{{"buffer":0,"byteLength":36}},{{"buffer":1,"byteLength":600000}}],
"buffers":[{{"byteLength":36,"uri":"triangle.bin"}},
{{"byteLength":600000,"uri":"data:application/octet-stream;base64,{indices}"}}]}}"#
    );
    desk.write("many.gltf", gltf);
    desk.write("scene.toml", SCENE.replace("MODEL", "many.gltf"));
    let began = Instant::now();
    desk.hankel("render scene.toml --out p.png").code(0);
    assert!(
        began.elapsed() < Duration::from_secs(20),
        "{:?}",
        began.elapsed()
    );
}
