//! Where output goes, and what was there before.

use std::fs;
use std::os::unix::fs::{FileTypeExt, MetadataExt, PermissionsExt, symlink};
use std::thread;

use crate::desk::{Desk, run};

const ROWS: &str = "b1,b2,depth\n0.5,0.3,0.2\n";
const SCENE: &str = "[geometry]\nprocedural = \"box\"\n[camera]\neye = [3.0, 3.0, 4.0]\n\
target = [0.0, 0.5, 0.0]\n[light]\ndirection = [-1.0, -2.0, -0.5]\n[output]\nwidth = 16\nheight = 9\n";

const EVAL: &str = "eval vsm --input rows.csv --output";

#[test]
fn devices_pipes_links_and_modes_stay_what_they_are() {
    let desk = Desk::new();
    desk.write("rows.csv", ROWS);
    // A device, named by a link.
    symlink("/dev/null", desk.path("null")).expect("a link");
    desk.hankel(&format!("{EVAL} null")).code(0);
    assert!(desk.path("null").is_symlink());
    assert!(
        fs::metadata("/dev/null")
            .expect("a device")
            .file_type()
            .is_char_device()
    );
    // A pipe.
    let fifo = desk.fifo("fifo");
    let reader = thread::spawn(move || fs::read_to_string(fifo).expect("a pipe"));
    desk.hankel(&format!("{EVAL} fifo")).code(0);
    assert!(reader.join().expect("the reader").starts_with("shadow\n"));
    // What is open already.
    let out = desk
        .hankel(&format!("--quiet {EVAL} /dev/stdout"))
        .code(0)
        .out();
    assert!(out.starts_with("shadow\n"), "{out}");
    // A mode, through a link.
    let kept = desk.write("kept.csv", "old");
    fs::set_permissions(&kept, fs::Permissions::from_mode(0o600)).expect("a mode");
    symlink("kept.csv", desk.path("link.csv")).expect("a link");
    desk.hankel(&format!("{EVAL} link.csv")).code(0);
    assert!(desk.path("link.csv").is_symlink());
    assert!(desk.read("kept.csv").starts_with("shadow\n"));
    assert_eq!(fs::metadata(&kept).expect("a file").mode() & 0o777, 0o600);
}

#[test]
fn inputs_are_not_overwritten() {
    let desk = Desk::new();
    desk.write("rows.csv", ROWS);
    desk.write("scene.toml", SCENE);
    desk.write("moments.csv", "m0,m1,m2,z\n1,0.5,0.34,0.9\n");
    desk.write("places.toml", "[vsm.rows]\nwgsl = { binding = 7 }\n");
    // A triangle, whose corners are in a file of their own. Applications may add what they like as `extras`.
    let corners: [f32; 9] = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0];
    let corners: Vec<u8> = corners.iter().flat_map(|it| it.to_le_bytes()).collect();
    desk.write("corners.bin", corners);
    desk.write(
        "model.gltf",
        r#"{"asset": {"version": "2.0", "extras": [1, "two"]}, "scene": 0, "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}], "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3",
        "min": [0, 0, 0], "max": [1, 1, 1]}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}], "buffers": [{"byteLength": 36, "uri": "corners.bin"}]}"#,
    );
    desk.write(
        "model.toml",
        SCENE.replace("procedural = \"box\"", "model = \"model.gltf\""),
    );
    fs::hard_link(desk.path("rows.csv"), desk.path("same.csv")).expect("a link");
    for line in [
        "build --out s --kernel vsm --bindings places.toml --depfile places.toml".into(),
        "build --out s --scene scene.toml --depfile scene.toml".into(),
        "render model.toml --out corners.bin".into(),
        "render model.toml --out model.gltf".into(),
        format!("{EVAL} rows.csv"),
        format!("{EVAL} same.csv"),
        "judge --functions z,z^2 --input moments.csv --output ./moments.csv".into(),
        "render scene.toml --out scene.toml".into(),
    ] {
        desk.hankel(&line).fails(2, &["is read", "another name"]);
    }
    desk.hankel("parity --matrix --kernel vsm --column native --json r --html ./r")
        .fails(2, &["two outputs"]);
    assert_eq!(
        (desk.read("rows.csv"), desk.read("scene.toml")),
        (ROWS.into(), SCENE.into())
    );
    // The manifest of the folder itself, and of folders that are compared.
    desk.hankel("build --out s --kernel vsm").code(0);
    let manifest = desk.read("s/manifest.json");
    desk.hankel("build --out s --kernel vsm --depfile s/manifest.json")
        .fails(2, &["--depfile", "the build's own"]);
    desk.hankel("diff s s --scene scene.toml --out s/manifest.json")
        .fails(2, &["is compared"]);
    assert_eq!(desk.read("s/manifest.json"), manifest);
}

/// Whatever `--force` says of files that are in the way.
#[test]
fn inputs_stay_where_generated_files_would_be() {
    let desk = Desk::new();
    let places = "[vsm.receiver]\nwgsl = { binding = 7 }\n";
    desk.write("frame.json", SCENE);
    desk.write("manifest.json", places);
    for line in [
        "build --scene frame.json --out . --force --target wgsl",
        "build --kernel vsm --out . --force --target wgsl --bindings manifest.json",
    ] {
        desk.hankel(line).fails(2, &["is read", "another name"]);
    }
    assert_eq!(
        (desk.read("frame.json"), desk.read("manifest.json")),
        (SCENE.into(), places.into())
    );
    // A report is a folder of files, too.
    desk.write("scene.toml", SCENE);
    fs::create_dir(desk.path("report")).expect("a folder");
    symlink("../scene.toml", desk.path("report/frames.json")).expect("a link");
    let bench = "bench frames --scene scene.toml --technique pcf --size 64 --filter 1 --fit scene --rounds 1";
    desk.hankel(&format!("{bench} --multisampling 1 --out report"))
        .fails(2, &["is read", "another name"]);
    assert_eq!(desk.read("scene.toml"), SCENE);
    // What no regular file gives would be waited for.
    fs::create_dir(desk.path("other")).expect("a folder");
    desk.fifo("other/measured.jsonl");
    desk.hankel(&format!("{bench} --multisampling 1 --out other"))
        .fails(2, &["measured.jsonl", "a pipe"]);
}

#[test]
fn pictures_beside_each_other_keep_the_bytes_of_their_names() {
    use std::ffi::OsStr;
    use std::os::unix::ffi::OsStrExt;
    let desk = Desk::new();
    desk.write("scene.toml", SCENE);
    let mut command = desk.command("render scene.toml --compare --limit 0 --out");
    command.arg(OsStr::from_bytes(b"q\xff.png"));
    run(&mut command);
    let name = OsStr::from_bytes(b"q\xff-vulkan.png");
    assert!(desk.path("").join(name).is_file(), "{:?}", desk.names());
}

/// Before the work, which would be lost.
#[test]
fn outputs_that_cannot_be_written_are_found_first() {
    let desk = Desk::new();
    desk.write("scene.toml", SCENE);
    desk.write("file", "");
    for line in [
        "render scene.toml --out no/o.png",
        "render scene.toml --out . --compare",
        "bench bounds --out file --samples 10000000 --rounds 1000",
        "bench bounds --out /dev/null/x --samples 10000000 --rounds 1000",
        "stress --out file --samples 10000000",
        "parity --matrix --html .",
        "parity --matrix --json no/r.json",
    ] {
        desk.hankel(line).code(2);
    }
    assert_eq!(desk.names(), ["file", "scene.toml"]);
}

#[test]
fn a_full_disk_is_the_machines_fault() {
    let desk = Desk::new();
    desk.write("rows.csv", ROWS);
    desk.write("scene.toml", SCENE);
    desk.write("moments.csv", "m0,m1,m2,z\n1,0.5,0.34,0.9\n");
    for line in [
        "eval vsm --input rows.csv --output /dev/full",
        "judge --functions z,z^2 --input moments.csv --output /dev/full",
        "render scene.toml --out /dev/full",
        "parity --matrix --kernel vsm --column native --json /dev/full",
    ] {
        desk.hankel(line).fails(3, &["/dev/full"]);
    }
}
