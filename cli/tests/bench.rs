//! `hankel bench` as a user types it.

use std::path::Path;
use std::process::{Command, Output};

use serde_json::Value;

fn hankel(folder: &Path, line: &str) -> Output {
    Command::new(env!("CARGO_BIN_EXE_hankel"))
        .args(line.split_whitespace())
        .current_dir(folder)
        .env_remove("HANKEL_PYTHON")
        .output()
        .expect("hankel starts")
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
fn bounds_are_measured_on_every_instruction_set() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let line = "bench bounds --quick --n 2,1 --samples 400 --rounds 1 --out report";
    let output = hankel(folder.path(), line);
    let error = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{error}");
    let text = String::from_utf8_lossy(&output.stdout);
    for part in ["scalar [ns]", "bound, compensated", "bounds.html"] {
        assert!(text.contains(part), "no `{part}` in\n{text}");
    }

    let report = folder.path().join("report");
    let json = std::fs::read(report.join("bounds.json")).expect("there is a report");
    let json: Value = serde_json::from_slice(&json).expect("it is JSON");
    assert_eq!(json["command"], format!("hankel {line}"));
    let tables = json["tables"].as_array().expect("it has tables");
    let table = |id: &str| tables.iter().find(|t| t["id"] == id);
    let times = table("times").expect("it has run times");
    let rows = times["rows"].as_array().expect("the table has rows");
    // Four kernels for each of these n, each in both precisions.
    assert_eq!(rows.len(), 16);
    // Every way to run a kernel was measured.
    for row in rows {
        let numbers = row.as_array().expect("a row is an array").iter().skip(3);
        assert!(numbers.into_iter().all(Value::is_number), "{row}");
    }
    let columns = times["columns"].as_array().expect("the table has columns");
    for (level, _) in hankel_dsl::native::lanes::levels() {
        assert!(columns.iter().any(|c| c["name"] == level), "no {level}");
    }
    // Shaders are counted, or the report says why not.
    let notes = json["notes"].to_string();
    match table("instructions") {
        Some(table) => assert!(!table["rows"].as_array().expect("rows").is_empty()),
        None => assert!(notes.contains("instruction counts"), "{notes}"),
    }
    let page = std::fs::read_to_string(report.join("bounds.html")).expect("there is a page");
    assert!(page.contains("<svg") && page.contains("Pareto front"));
}

#[test]
fn json_goes_to_the_output_stream() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let line = "bench bounds --quick --n 1 --samples 100 --rounds 1 --format json";
    let output = hankel(folder.path(), line);
    let json: Value = serde_json::from_slice(&output.stdout).expect("it is JSON");
    assert!(json["facts"].to_string().contains("processor"));
    // Nothing is written where no folder was named.
    assert_eq!(
        std::fs::read_dir(folder.path()).expect("a folder").count(),
        0
    );
}

#[test]
fn misuse_is_explained() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    fails(folder.path(), "bench bounds --n 7", 2, &["7", "1..=6"]);
    fails(
        folder.path(),
        "bench bounds --samples 3",
        2,
        &["from 16 to"],
    );
    fails(folder.path(), "bench bounds --rounds 0", 2, &["from 1 to"]);
    fails(folder.path(), "bench bounds --python x", 2, &["--against"]);
    let quick = "bench bounds --quick --n 1 --samples 100";
    fails(
        folder.path(),
        &format!("{quick} --against diffmoments --python /nonexistent/python"),
        3,
        &["/nonexistent/python", "--python", "HANKEL_PYTHON"],
    );
    std::fs::write(folder.path().join("file"), "").expect("the folder can be written");
    fails(
        folder.path(),
        &format!("{quick} --rounds 1 --out file"),
        2,
        &["cannot write file", "a folder is expected"],
    );
}

const SCENE: &str = "[geometry]\nprocedural = 'box'\n[camera]\neye = [3.0, 3.0, 4.0]\n\
    target = [0.0, 0.5, 0.0]\n[light]\ndirection = [-1.0, -2.0, -0.5]\n";

#[test]
fn frames_are_measured_once() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let write = |name: &str, text: &str| {
        std::fs::write(folder.path().join(name), text).expect("the folder can be written");
    };
    let read = |name: &str| {
        let path = folder.path().join("report").join(name);
        std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
    };
    write("one.toml", SCENE);
    let line = "bench frames --scene one.toml --technique pcf --size 64,128 --filter 1,3 \
                --output 32x18,64x36 --rounds 2 --out report";
    let output = hankel(folder.path(), line);
    let error = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{error}");
    let page = read("frames.html");
    for part in [
        "<title>pcf, 64",
        "Pareto front",
        "frames-one-32x18-rays.png",
        "-off.png",
    ] {
        assert!(page.contains(part), "no `{part}` in {page}");
    }
    let json: Value = serde_json::from_str(&read("frames.json")).expect("it is JSON");
    let tables = json["tables"].as_array().expect("it has tables");
    let rows = |id: &str| {
        let table = tables
            .iter()
            .find(|t| t["id"] == id)
            .unwrap_or_else(|| panic!("no {id}"));
        table["rows"].as_array().expect("rows").clone()
    };
    // Two sizes, filters, fits and numbers of samples, in two sizes of the picture.
    assert_eq!(rows("configurations").len(), 32);
    assert_eq!(read("frames-configurations.csv").lines().count(), 33);
    // With each number of samples two passes, each against texels, taps and pixels.
    assert_eq!(rows("growth").len(), 12);
    assert_eq!((rows("fit").len(), rows("doubling").len()), (2, 2));
    assert_eq!(rows("one-sample").len(), 2);
    let kept = read("measured.jsonl");

    // Nothing is measured twice, and the plan is compared with what is there.
    let output = hankel(folder.path(), &format!("{line} --error 0.000001 --quiet"));
    let error = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{error}");
    assert_eq!(read("measured.jsonl"), kept);
    assert!(read("frames-plans.csv").contains("none"));

    // A medium is scattered by each technique, with each number of steps.
    write("mist.toml", &format!("{SCENE}[medium]\nextinction = 0.2\n"));
    let line = "bench frames --scene mist.toml --technique pcf --size 64 --filter 1 --fit scene --steps 2,4 \
                --scattering ray-marching,prefiltered --output 16x9 --rounds 1 --out mist";
    let output = hankel(folder.path(), line);
    let error = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{error}");
    let table = std::fs::read_to_string(folder.path().join("mist/frames-scattering.csv"));
    let table = table.expect("there is a table of scattering");
    for way in [
        "prefiltered",
        "\"ray-marching, 2 steps\"",
        "\"ray-marching, 4 steps\"",
    ] {
        assert!(table.contains(way), "{way}: {table}");
    }
    assert_eq!(table.lines().count(), 4, "{table}");

    fails(
        folder.path(),
        "bench frames --out report",
        2,
        &["no scene files in scenes/", "--scene"],
    );
    let line = "bench frames --scene one.toml --output 32 --out report";
    fails(folder.path(), line, 2, &["320x180"]);
    // The same name for something else.
    write("one.toml", &SCENE.replace("3.0, 3.0", "3.0, 3.5"));
    let line = "bench frames --scene one.toml --technique pcf --output 32x18 --out report";
    fails(
        folder.path(),
        line,
        2,
        &["measured.jsonl was measured with", "another folder"],
    );
}

#[test]
fn candidates_are_ranked_on_shadow_maps() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    std::fs::write(folder.path().join("box.toml"), SCENE).expect("written");
    let line = "bench candidates --functions 2 --scene box.toml --regions 10 --out report --quiet";
    let output = hankel(folder.path(), line);
    let error = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{error}");
    let text = String::from_utf8_lossy(&output.stdout);
    for part in ["variance shadow maps", "the worst", "z, z^2"] {
        assert!(text.contains(part), "no `{part}` in\n{text}");
    }
    let report = folder.path().join("report");
    let all = std::fs::read_to_string(report.join("candidates-all.csv")).expect("it is there");
    // A heading, and 37 times 36 halves.
    assert_eq!(all.lines().count(), 1 + 666);
    assert!(all.starts_with("rank,functions,error,box"), "{all}");
    let page = std::fs::read_to_string(report.join("candidates.html")).expect("there is a page");
    assert!(page.contains("<svg") && page.contains("mean error"));
}

#[test]
fn candidates_need_scenes() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let missing = ["no scene files in scenes/", "--scene FILE"];
    fails(folder.path(), "bench candidates --out report", 2, &missing);
    std::fs::write(folder.path().join("box.toml"), SCENE).expect("written");
    let twice = "bench candidates --functions 1 --scene box.toml --scene box.toml --out report";
    fails(folder.path(), twice, 2, &["two scenes `box`"]);
    let even = "bench candidates --filter 4 --scene box.toml --out report";
    fails(folder.path(), even, 2, &["odd number"]);
    assert!(!folder.path().join("report/candidates-all.csv").exists());
}
