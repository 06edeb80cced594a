//! The command line as a user types it.

mod desk;

use std::fs;
use std::process::Command;

use desk::{Desk, Run, root};

#[test]
fn help_has_examples_and_exit_codes() {
    let desk = Desk::new();
    let help = desk.hankel("--help").code(0).out();
    for word in ["Examples:", "Exit codes", "build", "parity", "completions"] {
        assert!(help.contains(word), "{help}");
    }
    for command in [
        "build",
        "check",
        "list",
        "new",
        "parity",
        "eval",
        "judge",
        "plan",
        "render",
        "bench frames",
        "toolchain install",
    ] {
        let help = desk.hankel(&format!("{command} --help")).code(0).out();
        assert!(help.contains("Example"), "{command}: {help}");
    }
    desk.hankel("frobnicate")
        .fails(2, &["unrecognized subcommand"]);
    desk.hankel("build --frobnicate")
        .fails(2, &["unexpected argument"]);
}

#[test]
fn completions_are_scripts() {
    let desk = Desk::new();
    assert!(
        desk.hankel("completions bash")
            .code(0)
            .out()
            .contains("_hankel()")
    );
    assert!(
        desk.hankel("completions fish")
            .code(0)
            .out()
            .contains("complete -c hankel")
    );
}

#[test]
fn a_build_is_whole_and_then_left_alone() {
    let desk = Desk::new();
    let first = desk.hankel("build --out shaders").code(0).out();
    let modules = root().join("snapshots/spirv");
    let count = fs::read_dir(modules)
        .expect("the committed modules")
        .filter(|file| {
            let path = file.as_ref().expect("a file").path();
            path.extension().is_some_and(|end| end == "spv")
        })
        .count();
    assert!(first.contains(&format!("{count} kernels")), "{first}");
    for file in [
        "wgsl/hamburger_4msm.wgsl",
        "hlsl/shade_hamburger.hlsl",
        "msl/surface.metal",
        "glsl/vsm.comp",
        "spirv/vsm.spv",
        "manifest.json",
        "include/hankel.h",
        "include/hankel.rs",
    ] {
        assert!(desk.path("shaders").join(file).is_file(), "{file}");
    }
    let before = fs::metadata(desk.path("shaders/manifest.json"))
        .and_then(|m| m.modified())
        .ok();
    let second = desk.hankel("build --out shaders").code(0).out();
    assert!(second.contains("0 files written"), "{second}");
    let after = fs::metadata(desk.path("shaders/manifest.json"))
        .and_then(|m| m.modified())
        .ok();
    assert_eq!(before, after);
    let quiet = "--quiet build --out quiet --kernel vsm";
    assert_eq!(desk.hankel(quiet).code(0).out(), "");
}

#[test]
fn a_build_can_be_narrowed() {
    let desk = Desk::new();
    let json = desk
        .hankel("build --out s --target hlsl --shader-model 5.1 --kernel quantize_* --format json")
        .code(0)
        .out();
    assert!(json.contains("\"kernels\": 8"), "{json}");
    assert!(desk.path("s/hlsl/quantize_4_unit.hlsl").is_file());
    assert!(!desk.path("s/wgsl").exists());
}

#[test]
fn nothing_is_built_for_a_dependency_file_that_cannot_be_written() {
    let desk = Desk::new();
    desk.hankel("build --out s --kernel vsm --depfile nowhere/s.d")
        .code(2);
    assert!(!desk.path("s").exists());
    desk.hankel("build --out s --kernel vsm --depfile s/s.d")
        .code(0);
    assert!(desk.path("s/s.d").is_file());
}

/// Places of bindings and open constants are in the texts, in what a build depends on, and in what a
/// folder must be checked with.
#[test]
fn bindings_go_where_they_are_wanted() {
    let desk = Desk::new();
    desk.write(
        "places.toml",
        "[shade_hamburger.map]\nhlsl = { register = 9 }\nwgsl = { group = 3, binding = 0 }\n",
    );
    let options = "--kernel shade_hamburger --hlsl-space 2 --register-base 1 --wgsl-group 1 \
                   --msl-slot-base 8 --glsl-binding-base 4 --bindings places.toml --open-constants \
                   --variant _unit:encoding=1";
    desk.hankel(&format!("build --out s --depfile s.d {options}"))
        .code(0);
    let text = |file: &str| fs::read_to_string(desk.path(file)).expect("it was written");
    for (file, words) in [
        ("s/hlsl/shade_hamburger.hlsl", "map : register(t9, space2)"),
        (
            "s/hlsl/shade_hamburger.hlsl",
            "light : register(b1, space2)",
        ),
        (
            "s/hlsl/shade_hamburger_unit.hlsl",
            "map : register(t9, space2)",
        ),
        ("s/hlsl/shade_hamburger_unit.hlsl", " shade_hamburger_unit("),
        (
            "s/hlsl/shade_hamburger.hlsl",
            "#define SHADE_HAMBURGER_ENCODING 2u",
        ),
        ("s/wgsl/shade_hamburger.wgsl", "@group(3) @binding(0)"),
        ("s/wgsl/shade_hamburger.wgsl", "@group(1) @binding(0)"),
        ("s/msl/shade_hamburger.metal", "map [[texture(8)]]"),
        ("s/glsl/shade_hamburger.frag", "binding = 4"),
        (
            "s/include/hankel.h",
            "HANKEL_SHADE_HAMBURGER_UNIT_HLSL_FILE",
        ),
        ("s/manifest.json", "\"wgsl_group\": 1"),
    ] {
        let text = text(file);
        assert!(text.contains(words), "no `{words}` in {file}:\n{text}");
    }
    // A constant that a variant has a value for is none that a pipeline can be given.
    let header = text("s/include/hankel.h");
    assert!(header.contains("HANKEL_SHADE_HAMBURGER_CONSTANT_ENCODING"));
    assert!(!header.contains("HANKEL_SHADE_HAMBURGER_UNIT_CONSTANT_ENCODING"));
    assert!(!text("s/hlsl/shade_hamburger_unit.hlsl").contains("encoding"));
    assert!(text("s.d").contains("places.toml"), "{}", text("s.d"));
    desk.hankel(&format!("check s {options}")).code(0);
    desk.hankel("check s --kernel shade_hamburger").code(1);
    desk.write(
        "places.toml",
        "[shade_hamburger.map]\nhlsl = { register = 8 }\n",
    );
    desk.hankel(&format!("check s {options}")).code(1);

    desk.write(
        "places.toml",
        "[shade_hamburger.light]\nwgsl = { binding = 1 }\n",
    );
    desk.hankel("build --out t --bindings places.toml").fails(
        2,
        &[
            "places.toml:1",
            "`shade_hamburger`",
            "`light` (line 1) and `map`",
        ],
    );
    desk.write("places.toml", "\n[shade_hamburger.lamp]\n");
    desk.hankel("build --out t --bindings places.toml")
        .fails(2, &["places.toml:2", "`lamp`", "light, map, sampler"]);
    desk.hankel("build --out t --bindings nowhere.toml")
        .fails(2, &["nowhere.toml"]);
    desk.hankel("build --out t --hlsl-space 256")
        .fails(2, &["256", "--hlsl-space"]);
    desk.hankel("build --out t --msl-slot-base 200")
        .fails(2, &["slot", "base"]);
    for (variant, words) in [
        ("unit", "no `:`"),
        ("_A:encoding=1", "cannot end a kernel's name"),
        ("_a:encoding", "no `=`"),
        ("_a:nosuch=1", "nosuch"),
    ] {
        desk.hankel(&format!("build --out t --variant {variant}"))
            .fails(2, &[words]);
    }
    assert!(!desk.path("t").exists());
}

#[test]
fn misuse_of_build_is_explained() {
    let desk = Desk::new();
    desk.hankel("build --target cobol")
        .fails(2, &["no target is named `cobol`", "wgsl"]);
    desk.hankel("build --kernel nosuch")
        .fails(2, &["no kernel is named `nosuch`", "hamburger_4msm"]);
    desk.hankel("build --shader-model 4.0")
        .fails(2, &["shader model `4.0`", "5.1"]);
    desk.hankel("build --msl-version 9")
        .fails(2, &["MSL version `9`"]);
    desk.hankel("build --bounds-checks some")
        .fails(2, &["bounds checks `some`"]);
    desk.hankel("build --set encoding=unit")
        .fails(2, &["whole number", "`unit`"]);
    desk.hankel("build --set encoding")
        .fails(2, &["--set encoding", "no `=`"]);
    desk.hankel("build --set encoding=4294967296")
        .fails(2, &["from 0 to 4294967295", "`4294967296` is not"]);
    desk.hankel("build --set encoding=1 --set encoding=2")
        .fails(2, &["--set encoding=2", "`encoding` was set to 1 already"]);
    desk.write("file", "");
    desk.hankel("build --out file")
        .fails(2, &["file is a file", "a folder is expected"]);
    desk.hankel("build --out file/deeper")
        .fails(2, &["file/deeper", "Not a directory"]);
    desk.hankel("check file")
        .fails(2, &["file", "it is not a folder"]);
    desk.hankel("build --set nosuch=1").fails(2, &["nosuch"]);
    desk.hankel("build --manifest-path nowhere/Cargo.toml")
        .fails(2, &["nowhere", "no such file"]);
    desk.hankel("check nowhere")
        .fails(2, &["nowhere", "no such folder"]);
    for option in ["--target wgsl", "--open-constants", "--wgsl-group 2"] {
        let name = option.split(' ').next().unwrap_or_default();
        desk.hankel(&format!("build --form functions --out lib {option}"))
            .fails(2, &[&format!("{name}: it is for shaders")]);
        assert!(!desk.path("lib").exists());
    }
}

#[test]
fn files_of_ones_own_are_not_overwritten() {
    let desk = Desk::new();
    fs::create_dir_all(desk.path("s/wgsl")).expect("the desk can be written");
    let own = desk.write("s/wgsl/vsm.wgsl", "// mine\n");
    desk.hankel("build --out s --kernel vsm")
        .fails(2, &["in the way", "--force"]);
    assert_eq!(fs::read_to_string(&own).ok().as_deref(), Some("// mine\n"));
    assert!(
        !desk.path("s/manifest.json").exists(),
        "nothing is half-written"
    );
    desk.hankel("build --out s --kernel vsm --force").code(0);
}

/// What stands where a build reads or writes may be anything: nothing is waited for, followed, or
/// read to an end that never comes.
#[cfg(unix)]
#[test]
fn what_is_no_file_is_refused() {
    use std::os::unix::fs::symlink;
    let desk = Desk::new();
    symlink("nowhere", desk.path("dangling")).expect("a link");
    desk.hankel("build --out dangling")
        .fails(2, &["dangling is a symbolic link that leads nowhere"]);
    let build = "build --out s --kernel vsm --target wgsl --target hlsl";
    desk.hankel(build).code(0);
    let fifo = |name: &str| {
        let _ = fs::remove_file(desk.path(name));
        let made = Command::new("mkfifo").arg(desk.path(name)).status();
        assert!(made.is_ok_and(|status| status.success()), "{name}");
    };
    fifo("s/manifest.json");
    desk.hankel(build).fails(
        2,
        &["s/manifest.json is in the way: it is a FIFO", "--force"],
    );
    let out = desk
        .hankel("check s --kernel vsm --target wgsl --target hlsl")
        .code(1)
        .out();
    assert!(out.contains("s/manifest.json is a FIFO"), "{out}");
    desk.hankel(&format!("{build} --force")).code(0);
    fifo("s/wgsl/vsm.wgsl");
    desk.hankel(build).fails(2, &["it is a FIFO"]);
    desk.hankel(&format!("{build} --force")).code(0);
    // A folder of the output leads elsewhere.
    fs::create_dir(desk.path("victim")).expect("a folder");
    fs::rename(desk.path("s/hlsl/vsm.hlsl"), desk.path("victim/vsm.hlsl")).expect("it moves");
    fs::remove_dir(desk.path("s/hlsl")).expect("it is empty");
    symlink(desk.path("victim"), desk.path("s/hlsl")).expect("a link");
    desk.hankel("build --out s --kernel vsm --target wgsl")
        .code(0);
    assert!(
        desk.path("victim/vsm.hlsl").is_file(),
        "nothing is removed through a link"
    );
    desk.hankel(build).fails(
        2,
        &[
            "s/hlsl is in the way: it is a symbolic link",
            "follows no links",
        ],
    );
    fifo("budget.toml");
    for budget in ["nope.toml", "budget.toml", "/dev/zero", "s"] {
        desk.hankel(&format!("check s --budget {budget}"))
            .fails(2, &[budget]);
    }
}

/// Builds that are killed at any time leave nothing in the way of the next one, with other options
/// or the same.
#[cfg(unix)]
#[test]
fn a_killed_build_leaves_nothing_behind() {
    let desk = Desk::new();
    let lines = [
        "build --out s --kernel *4msm* --target wgsl --target msl",
        "build --out s --kernel *4msm* --target wgsl --target hlsl --set nothing",
    ]
    .map(|line| line.replace(" --set nothing", " --shader-model 6.2"));
    let start = std::time::Instant::now();
    desk.hankel(&lines[0]).code(0);
    let whole = start.elapsed();
    for round in 0..12_u32 {
        let mut child = Command::new(env!("CARGO_BIN_EXE_hankel"))
            .args(lines[round as usize % 2].split_whitespace())
            .current_dir(desk.path(""))
            .stdout(std::process::Stdio::null())
            .spawn()
            .expect("hankel starts");
        // The files are written at the end.
        std::thread::sleep(whole * (80 + 2 * round) / 100);
        child.kill().expect("it is ours");
        child.wait().expect("it ends");
    }
    desk.hankel(&lines[1]).code(0);
    desk.hankel(&lines[1].replace("build --out", "check"))
        .code(0);
    let names: Vec<String> = fs::read_dir(desk.path("s"))
        .expect("it was built")
        .filter_map(|entry| entry.ok()?.file_name().into_string().ok())
        .collect();
    assert_eq!(names.len(), 4, "{names:?}");
}

#[test]
fn two_builds_at_once_do_not_mix() {
    let desk = Desk::new();
    let lines = [
        "build -q --out s --kernel *4msm* --target wgsl",
        "build -q --out s --kernel quantize_4* --target hlsl",
    ];
    for _ in 0..6 {
        let children = lines.map(|line| {
            Command::new(env!("CARGO_BIN_EXE_hankel"))
                .args(line.split_whitespace())
                .current_dir(desk.path(""))
                .spawn()
                .expect("hankel starts")
        });
        for mut child in children {
            assert!(child.wait().is_ok_and(|status| status.success()));
        }
        let right = lines
            .iter()
            .filter(|line| {
                let line = line.replace("build -q --out", "check");
                desk.hankel(&line).0.status.success()
            })
            .count();
        assert_eq!(right, 1, "the folder is that of one build");
    }
}

#[test]
fn check_finds_what_does_not_follow() {
    let desk = Desk::new();
    desk.hankel("build --out s --kernel vsm").code(0);
    desk.hankel("check s --kernel vsm").code(0);
    // What the folder was built with holds where nothing else is said.
    desk.hankel("check s").code(0);
    let out = desk.hankel("check s --kernel vs*m").code(1).out();
    assert!(out.contains("manifest.json"), "{out}");
    let every_option = "--kernel shade_hamburger --target hlsl --target wgsl --variant _unit:encoding=1 \
        --hlsl-space 2 --wgsl-group 1 --shader-model 6.2 --msl-version 3.0 --bounds-checks \
        restrict --open-constants";
    desk.hankel(&format!("build --out every {every_option}"))
        .code(0);
    desk.hankel("check every").code(0);
    desk.hankel(&format!("check every {every_option}")).code(0);
    desk.hankel("check every --target hlsl").code(1);
    let file = desk.path("s/wgsl/vsm.wgsl");
    let text = fs::read_to_string(&file).expect("it was built");
    fs::write(&file, text.replacen("1f", "2f", 1)).expect("the desk can be written");
    let run = desk.hankel("check s --kernel vsm");
    let out = run.code(1).out();
    for word in ["--- ", "+++ ", "vsm.wgsl", "-", "+"] {
        assert!(out.contains(word), "{out}");
    }
    // What it was built with is known from its manifest, whatever has become of the file.
    let file_of_every = desk.path("every/hlsl/shade_hamburger.hlsl");
    let hlsl = fs::read_to_string(&file_of_every).expect("it was built");
    fs::write(&file_of_every, format!("{hlsl}\n")).expect("the desk can be written");
    let out = desk.hankel("check every").code(1).out();
    assert!(out.contains("1 changed, 0 missing"), "{out}");
    fs::remove_file(&file_of_every).expect("it is there");
    let out = desk.hankel("check every").code(1).out();
    assert!(out.contains("0 changed, 1 missing"), "{out}");
    let json = desk
        .hankel("check s --kernel vsm --format json")
        .code(1)
        .out();
    assert!(json.contains("\"changed\""), "{json}");
    fs::write(&file, &text).expect("the desk can be written");
    desk.write("hankel.toml", "[budget.kernels.vsm]\noperations = 3\n");
    let out = desk.hankel("check s --kernel vsm").code(1).out();
    assert!(out.contains("operations"), "{out}");
    desk.write("hankel.toml", "[budget]\noperatoins = 3\n");
    desk.hankel("check s --kernel vsm")
        .fails(2, &["hankel.toml", "operatoins"]);
}

#[test]
fn the_list_shows_bindings_and_cost() {
    let desk = Desk::new();
    let out = desk
        .hankel("list --kernel hamburger_4msm --bindings")
        .code(0)
        .out();
    for word in ["map 1-D", "moment_bias f32 @16", "binding 2: Shadow"] {
        assert!(out.contains(word), "{out}");
    }
    let json = desk.hankel("list --kernel vsm --format json").code(0).out();
    assert!(json.contains("\"operations\""), "{json}");
}

const ROWS: &str = "depth,b1,b2,b3,b4\n0.5,0.5,0.34,0.26,0.2056\n0.9,0.5,0.34,0.26,0.2056\n0.1,0.5,0.34,0.26,0.2056\n";

#[test]
fn eval_runs_rows_alike_on_both_backends() {
    let desk = Desk::new();
    let header = desk
        .hankel("list --kernel hamburger_4msm --bindings")
        .code(0)
        .out();
    assert!(header.contains("depth"), "{header}");
    // Columns are the fields, nested ones by their path.
    let rows = ROWS.replace("b1,b2,b3,b4", "moments.b1,moments.b2,moments.b3,moments.b4");
    desk.write("rows.csv", &rows);
    desk.hankel("eval hamburger_4msm --input rows.csv --output native.csv --set moment_bias=0")
        .code(0);
    desk.hankel("eval hamburger_4msm --input rows.csv --output vulkan.csv --backend vulkan")
        .code(0);
    let (a, b) = (
        fs::read_to_string(desk.path("native.csv")).expect("it was written"),
        fs::read_to_string(desk.path("vulkan.csv")).expect("it was written"),
    );
    assert_eq!(a, b);
    // Two surfaces at 0.2 and 0.8, half each: half the shadow between them.
    let shadows: Vec<f32> = a
        .lines()
        .skip(1)
        .map(|l| l.parse().expect("a number"))
        .collect();
    assert_eq!(a.lines().next(), Some("shadow"));
    assert!(
        (shadows[0] - 0.5).abs() < 1e-3 && shadows[1] > 0.99 && shadows[2] < 0.01,
        "{shadows:?}"
    );
    desk.hankel("eval hamburger_4msm --input rows.csv --output f64.csv --precision f64")
        .code(0);
    desk.hankel(
        "eval hamburger_4msm --input rows.csv --output f64v.csv --precision f64 --backend vulkan",
    )
    .code(0);
    assert_eq!(
        fs::read(desk.path("f64.csv")).ok(),
        fs::read(desk.path("f64v.csv")).ok()
    );
}

/// Where it costs a command nothing, rows get the compensated form.
#[test]
fn eval_computes_in_twice_the_digits_unless_it_is_to_be_fast() {
    let desk = Desk::new();
    // Two thin surfaces: plain elimination loses most of the digits.
    let header = "m0,m1,m2,m3,m4,m5,m6,eta";
    let row = "1,0.5500125,0.32506253,0.20256564,0.13189186,0.08925484,0.06247703,0.4";
    desk.write("rows.csv", format!("{header}\n{row}\n"));
    let result = |kernel: &str| {
        let line = format!("eval {kernel} --input rows.csv --output out.csv");
        let said = desk.hankel(&line).code(0).out();
        let rows = fs::read_to_string(desk.path("out.csv")).expect("it was written");
        (said, rows)
    };
    let (said, rows) = result("moment_bound_n3");
    assert!(said.contains("moment_bound_compensated_n3"), "{said}");
    assert_eq!(rows, result("moment_bound_compensated_n3").1);
    assert_ne!(rows, result("moment_bound_n3 --fast").1);
    let of_f64 = result("moment_bound_n3 --precision f64").0;
    assert!(
        of_f64.contains("moment_bound_compensated_n3_f64"),
        "{of_f64}"
    );
}

#[test]
fn eval_explains_bad_tables_and_writes_nothing() {
    let desk = Desk::new();
    let good = "b1,b2,depth\n0.5,0.3,0.2\n";
    for (name, table, words) in [
        (
            "text.csv",
            "b1,b2,depth\n0.5,0.3,0.2\n0.5,x,0.2\n",
            &["row 2", "b2", "x"][..],
        ),
        (
            "nan.csv",
            "b1,b2,depth\n0.5,NaN,0.2\n",
            &["row 1", "b2"][..],
        ),
        ("missing.csv", "b1,depth\n0.5,0.2\n", &["b2"][..]),
        ("extra.csv", "b1,b2,depth,b9\n0.5,0.3,0.2,1\n", &["b9"][..]),
        ("short.csv", "b1,b2,depth\n0.5,0.3\n", &["row 1"][..]),
        ("empty.csv", "", &["empty.csv"][..]),
    ] {
        desk.write(name, table);
        desk.hankel(&format!("eval vsm --input {name} --output out.csv"))
            .fails(2, words);
        assert!(!desk.path("out.csv").exists(), "{name}");
    }
    desk.hankel("eval vsm --input nowhere.csv --output out.csv")
        .fails(2, &["nowhere.csv"]);
    desk.write("good.csv", good);
    desk.hankel("eval vsm --input good.csv --output out.csv --set nosuch=1")
        .fails(2, &["nosuch", "least_variance"]);
    desk.hankel("eval shade_pcf --input good.csv --output out.csv")
        .fails(2, &["shade_pcf"]);
    desk.hankel("eval vsm --input good.csv --output nowhere/out.csv")
        .fails(2, &["nowhere"]);
    assert!(!desk.path("out.csv").exists());
    desk.hankel("eval vsm --input good.csv --output out.csv")
        .code(0);
}

/// Half of the depths at 0.2, half at 0.8, known by two moments.
#[test]
fn a_linear_programme_judges_a_table() {
    let desk = Desk::new();
    desk.write("rows.csv", "m0,m1,m2,z\n1,0.5,0.34,0.9\n2,1,0.68,0.9\n");
    let out = desk
        .hankel("judge --functions z,z^2 --range line --input rows.csv --output out.csv")
        .code(0)
        .out();
    assert!(out.contains("2 rows"), "{out}");
    let text = fs::read_to_string(desk.path("out.csv")).expect("it was written");
    let lower: Vec<f64> = text
        .lines()
        .skip(1)
        .filter_map(|l| l.split(',').next()?.parse().ok())
        .collect();
    assert_eq!(text.lines().next(), Some("lower,upper,margin,residual"));
    assert!(
        (lower[0] - 0.64).abs() < 1e-9 && (lower[1] - 1.28).abs() < 1e-9,
        "{text}"
    );
    desk.hankel("judge --functions z,z^2 --range -1,1 --input rows.csv --output out.csv")
        .code(0);
    desk.write("bad.csv", "m0,m1,m2,z\n1,0.5,0.34,0.9\n1,0.5,0.2,0.9\n");
    for (line, words) in [
        (
            "--functions z,z^2 --input bad.csv",
            &["row 2", "no distribution", "away"][..],
        ),
        ("--functions z,z^99 --input rows.csv", &["z^99", "z^16"]),
        (
            "--functions z,z^2 --range 1,0 --input rows.csv",
            &["1 to 0"],
        ),
        (
            "--functions z,z^2 --range 1 --input rows.csv",
            &["--range 1", "line"],
        ),
        ("--functions z --input rows.csv", &["m2"]),
        ("--functions z,z^2 --input nowhere.csv", &["nowhere.csv"]),
    ] {
        desk.hankel(&format!("judge {line} --output new.csv"))
            .fails(2, words);
        assert!(!desk.path("new.csv").exists(), "{line}");
    }
}

#[test]
fn bounds_are_put_under_stress() {
    let desk = Desk::new();
    let out = desk
        .hankel("stress --family paper,self --n 1,2 --samples 100 --backend vulkan --out report")
        .code(0)
        .out();
    for words in [
        "not finite",
        "sensitivity of the compensated",
        "lanes",
        "programme",
    ] {
        assert!(out.contains(words), "{words}: {out}");
    }
    for file in ["stress.html", "stress.json", "stress-errors.csv"] {
        assert!(desk.path("report").join(file).is_file(), "{file}");
    }
    // Through naga, where nothing forbids a driver to reorder sums, error terms are still there.
    desk.hankel("stress -q --family silhouettes,self --n 2,3 --samples 500 --precision f32 --backend vulkan --out gpu")
        .code(0);
    let errors = fs::read_to_string(desk.path("gpu/stress-errors.csv")).expect("it was written");
    let ninety = |solver: &str| -> Vec<f64> {
        let on_device = |l: &&str| {
            l.contains(&format!(",f32,{solver},"))
                && !l.contains(",native,")
                && !l.contains(",lanes,")
        };
        let lines = errors.lines().filter(on_device);
        // Columns from the last: device names have commas.
        lines
            .filter_map(|l| l.rsplit(',').nth(9)?.parse().ok())
            .collect()
    };
    let (plain, compensated) = (ninety("plain"), ninety("compensated"));
    assert_eq!((plain.len(), compensated.len()), (4, 4), "{errors}");
    for (plain, compensated) in plain.iter().zip(&compensated) {
        assert!(compensated * 10.0 < *plain, "{errors}");
    }
    let out = desk
        .hankel("stress --singularities --n 1 --samples 16 --precision f64")
        .code(0)
        .out();
    assert!(out.contains("| 1 | f64       | plain"), "{out}");
    let out = desk
        .hankel("stress --shadows --samples 16 --precision f32")
        .code(0)
        .out();
    assert!(out.contains("trigonometric bound"), "{out}");
    let json = desk
        .hankel("stress --family one-texel --n 1 --samples 50 --format json")
        .code(0)
        .out();
    assert!(json.contains("\"id\": \"over-plain\""), "{json}");
    desk.hankel("stress --family nosuch")
        .fails(2, &["`nosuch`", "silhouettes"]);
    desk.hankel("stress --biases --samples 20")
        .fails(2, &["20 regions", "1000"]);
    desk.hankel("stress --family paper --samples 16 --against diffmoments --python nowhere")
        .fails(3, &["nowhere", "--python"]);
}

#[test]
fn parity_reports_and_filters() {
    let desk = Desk::new();
    let out = desk.hankel("parity --kernel quantize_4_unit").code(0).out();
    for word in ["native-simd", "spirv-naga", "wgsl", "same", "all pass"] {
        assert!(out.contains(word), "{out}");
    }
    assert!(!out.contains("msl"), "{out}");
    let json = desk
        .hankel("parity --kernel vsm --seed 5 --format json")
        .code(0)
        .out();
    assert!(json.contains("\"seed\": 5"), "{json}");
    desk.hankel("parity --kernel nosuch").fails(2, &["nosuch"]);
}

/// Whatever the processor's instruction set: lanes give the scalar bits.
#[test]
fn every_instruction_set_gives_the_same_bits() {
    let desk = Desk::new();
    let levels = hankel_dsl::native::lanes::levels();
    let names = levels.iter().map(|(name, _)| *name);
    for level in names.chain([hankel_dsl::native::lanes::SCALAR]) {
        let output = Command::new(env!("CARGO_BIN_EXE_hankel"))
            .args([
                "parity",
                "--kernel",
                "*4msm*",
                "--kernel",
                "quantize*",
                "--format",
                "json",
            ])
            .current_dir(desk.path(""))
            .env("HANKEL_SIMD", level)
            .output()
            .expect("hankel starts");
        let json = Run(output).code(0).out();
        assert!(json.contains("\"native-simd\""), "{level}: {json}");
        assert!(json.contains("\"passed\": true"), "{level}: {json}");
    }
}

#[test]
fn without_a_driver_vulkan_says_how_to_get_one() {
    let desk = Desk::new();
    let output = Command::new(env!("CARGO_BIN_EXE_hankel"))
        .arg("parity")
        .current_dir(desk.path(""))
        .env("VK_DRIVER_FILES", "/nowhere.json")
        .env("VK_ICD_FILENAMES", "/nowhere.json")
        .output()
        .expect("hankel starts");
    Run(output).fails(3, &["no Vulkan device", "libvulkan1"]);
}

const SCENE: &str = r#"
[geometry]
procedural = "box"
[camera]
eye = [3.0, 3.0, 4.0]
target = [0.0, 0.5, 0.0]
[light]
direction = [-1.0, -2.0, -0.5]
[output]
width = 64
height = 36
"#;

#[test]
fn a_scene_is_rendered_and_compared() {
    let desk = Desk::new();
    desk.write("scene.toml", SCENE);
    let out = desk
        .hankel("render scene.toml --out a.png --compare --format json")
        .code(0)
        .out();
    assert!(out.contains("\"psnr\""), "{out}");
    assert!(out.contains("\"unshared\""), "{out}");
    let out = desk
        .hankel("render scene.toml --out a.png --errors")
        .code(0)
        .out();
    for line in [
        "1. depth: light_depth",
        "no mips",
        "MB if passes shared no memory",
        "light against rays: rms 0.",
        "light against all samples, filtered: rms 0.",
    ] {
        assert!(out.contains(line), "{line}: {out}");
    }
    desk.hankel("render scene.toml --out a.png --compare --limit 0")
        .fails(1, &["the pictures differ", "at most 0.000 %"]);
    desk.hankel("render scene.toml --out a.png --compare --limit 101")
        .fails(2, &["from 0 to 100"]);
    for file in ["a.png", "a-vulkan.png", "a-difference.png"] {
        let bytes = fs::read(desk.path(file)).expect("it was written");
        assert_eq!(&bytes[1..4], b"PNG", "{file}");
    }
    // Linear light, in floats.
    desk.hankel("render scene.toml --out a.EXR").code(0);
    let bytes = fs::read(desk.path("a.EXR")).expect("it was written");
    assert_eq!(bytes[..4], [0x76, 0x2f, 0x31, 0x01]);
    desk.hankel("render scene.toml --out b.exr --compare")
        .fails(2, &["b.exr", "PNG", "--compare"]);
    // A spot light, hard and soft, and in a medium, which not every technique of scattering is for.
    let lamp = SCENE.replace("[light]", "[light]\nposition = [0.0, 3.0, 0.0]");
    desk.write("lamp.toml", &lamp);
    desk.hankel("render lamp.toml --out c.png").code(0);
    desk.hankel("render lamp.toml --out c.png --technique soft")
        .code(0);
    let mist = lamp + "\n[medium]\nextinction = 0.1\n";
    desk.write("mist.toml", &mist);
    desk.hankel("render mist.toml --out c.png").code(0);
    desk.write("mist.toml", mist + "technique = \"prefiltered\"\n");
    desk.hankel("render mist.toml --out b.png").fails(
        2,
        &["mist.toml", "`medium.technique`", "directional lights"],
    );
    desk.hankel("render nowhere.toml --out b.png")
        .fails(2, &["nowhere.toml"]);
    desk.write("bad.toml", SCENE.replace("64", "0"));
    desk.hankel("render bad.toml --out b.png")
        .fails(2, &["bad.toml", "width"]);
    assert!(!desk.path("b.png").exists());
}

#[test]
fn a_scene_is_planned() {
    let desk = Desk::new();
    desk.write("scene.toml", SCENE);
    let few = "--technique vsm,pcf --size 64,128 --filter 1,3 --fit camera";
    let out = desk
        .hankel(&format!("plan scene.toml --error 0.3 {few}"))
        .code(0)
        .out();
    for part in [
        "predicted: error 0.",
        "fitted to what the camera sees",
        "not pcf",
    ] {
        assert!(out.contains(part), "{part}: {out}");
    }
    let line = format!("plan scene.toml --error 0.3 --memory 0.001 {few} --format json");
    let out = desk.hankel(&line).code(1).out();
    assert!(out.contains("beyond the memory budget"), "{out}");
    // Four samples of depth and one are tried, and one if that is said.
    let vsm = "--technique vsm --size 64 --filter 1 --fit camera --format json";
    let considered = |more: &str| {
        let line = format!("plan scene.toml --error 0.3 {vsm} {more}");
        let plan: serde_json::Value =
            serde_json::from_str(&desk.hankel(&line).code(0).out()).expect("it is JSON");
        let choice = plan["choice"].as_str().expect("a plan has a choice");
        (choice.to_owned(), plan["considered"].as_u64())
    };
    let (choice, of_one) = considered("--multisampling 1");
    assert!(choice.contains(", one sample, 64²"), "{choice}");
    assert_eq!(considered("").1, of_one.map(|count| 2 * count));
    desk.hankel("plan scene.toml --error 0.3 --multisampling 2")
        .fails(2, &["give 4 or 1"]);
    desk.hankel("plan scene.toml --error 0")
        .fails(2, &["above 0"]);
    desk.hankel("plan scene.toml --error 0.1 --technique magic")
        .fails(2, &["no technique magic", "hamburger"]);
    desk.hankel("plan scene.toml --error 0.1 --scattering fog")
        .fails(2, &["no technique of scattering fog", "ray-marching"]);
    for option in ["--steps 8", "--scattering ray-marching"] {
        desk.hankel(&format!("plan scene.toml --error 0.1 {option}"))
            .fails(
                2,
                &["is for scenes with a medium", "the scene has no medium"],
            );
    }
    desk.hankel("plan scene.toml --error 0.1 --filter 4")
        .fails(2, &["odd number"]);

    desk.hankel("render scene.toml --out a.png --technique vsm")
        .code(0);
    assert!(desk.path("a.png").exists());
    desk.hankel("render scene.toml --out b.png --technique auto")
        .fails(2, &["needs --error"]);
    desk.hankel("render scene.toml --out b.png --technique magic")
        .fails(2, &["no technique magic"]);
    desk.hankel("render scene.toml --out b.png --size 64")
        .fails(2, &["need --technique auto"]);
    let auto = "--technique auto --size 64 --filter 1 --fit camera";
    desk.hankel(&format!(
        "render scene.toml --out b.png {auto} --error 0.000001"
    ))
    .fails(1, &["nothing has an error of at most", "nearest"]);
    assert!(!desk.path("b.png").exists());
    let out = desk
        .hankel(&format!("render scene.toml --out b.png {auto} --error 0.3"))
        .code(0)
        .out();
    assert!(
        out.contains("predicted: error 0.") && out.contains("1. depth"),
        "{out}"
    );
    assert!(desk.path("b.png").exists());
}

/// A crate of one's own, outside of the repository, through the plug-in.
#[test]
fn a_new_crate_may_be_the_present_folder() {
    use std::os::unix::fs::{MetadataExt, PermissionsExt};
    let desk = Desk::new();
    let here = desk.path("mine");
    fs::create_dir(&here).expect("a folder");
    fs::set_permissions(&here, fs::Permissions::from_mode(0o700)).expect("a mode");
    let before = fs::metadata(&here).expect("it is there").ino();
    desk::run(desk.command("new .").current_dir(&here)).code(0);
    let after = fs::metadata(&here).expect("it is there");
    assert_eq!((after.ino(), after.mode() & 0o777), (before, 0o700));
    assert!(here.join("Cargo.toml").is_file() && here.join("src/lib.rs").is_file());
    std::os::unix::fs::symlink("nowhere", desk.path("dangling")).expect("a link");
    desk.hankel("new dangling").fails(2, &["it is a link"]);
    desk.hankel("new hankel_dsl")
        .fails(2, &["another crate's name"]);
}

#[test]
fn a_new_crate_builds_at_once() {
    let desk = Desk::new();
    let path = desk.path("my-kernels");
    let out = desk
        .hankel(&format!("new {}", path.display()))
        .code(0)
        .out();
    assert!(
        out.contains("Cargo.toml") && out.contains("README.md"),
        "{out}"
    );
    desk.hankel(&format!("new {}", path.display()))
        .fails(2, &["not empty"]);
    desk.hankel("new Bad-Name")
        .fails(2, &["Bad-Name", "letters"]);
    // The same versions as the repository's, so that nothing is fetched.
    fs::copy(root().join("Cargo.lock"), path.join("Cargo.lock")).expect("a copy");
    let list = format!("list --manifest-path {}", path.join("Cargo.toml").display());
    // What this repository has compiled for the DSL serves here, too.
    let target = root().join("target");
    let run = desk::run(desk.command(&list).env("CARGO_TARGET_DIR", &target));
    // Its native side was built and asked; its SPIR-V needs a compiler, which is not here.
    run.fails(3, &["my-kernels", "hankel toolchain install"]);
    let test = Command::new("cargo")
        .args(["test", "--release"])
        .current_dir(&path)
        .env("CARGO_TARGET_DIR", target.join("hankel/native"))
        .output()
        .expect("cargo starts");
    assert!(
        test.status.success(),
        "{}",
        String::from_utf8_lossy(&test.stderr)
    );
}

#[test]
fn toolchain_status_says_what_there_is() {
    let desk = Desk::new();
    let out = desk.hankel("toolchain status").out();
    for word in ["rust-gpu 0.10.0", "cache", "archive", "rustup", "source"] {
        assert!(out.contains(word), "{out}");
    }
    let json = desk.hankel("toolchain status --format json").out();
    assert!(json.contains("\"ways\""), "{json}");
    desk.hankel("toolchain install --from nowhere.tar.zst")
        .fails(2, &["nowhere.tar.zst"]);
}
