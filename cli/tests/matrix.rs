//! `hankel parity --matrix` and `hankel doctor` as a user types them, with compilers that refuse,
//! crash, hang or are not there.
#![cfg(unix)]

use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::PathBuf;
use std::process::Command;

use tempfile::TempDir;

/// A folder outside of the repository, and a cache of its own.
struct Desk(TempDir);

struct Done {
    code: Option<i32>,
    out: String,
    err: String,
}

impl Desk {
    fn new() -> Self {
        Self(tempfile::tempdir().expect("a temporary folder"))
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    /// A program that is this shell script.
    fn program(&self, name: &str, script: &str) -> String {
        let path = self.path(name);
        fs::write(&path, format!("#!/bin/sh\n{script}\n")).expect("the desk can be written");
        fs::set_permissions(&path, fs::Permissions::from_mode(0o755)).expect("it is ours");
        path.display().to_string()
    }

    fn hankel(&self, line: &str, variables: &[(&str, &str)]) -> Done {
        let output = Command::new(env!("CARGO_BIN_EXE_hankel"))
            .args(line.split_whitespace())
            .current_dir(self.0.path())
            .env("HANKEL_CACHE", self.path("cache"))
            .env("CI", "")
            .envs(variables.iter().copied())
            .output()
            .expect("hankel starts");
        Done {
            code: output.status.code(),
            out: String::from_utf8_lossy(&output.stdout).into_owned(),
            err: String::from_utf8_lossy(&output.stderr).into_owned(),
        }
    }
}

impl Done {
    #[track_caller]
    fn says(self, code: i32, words: &[&str]) -> Self {
        assert_eq!(self.code, Some(code), "{}\n{}", self.out, self.err);
        for word in words {
            let all = format!("{}\n{}", self.out, self.err);
            assert!(all.contains(word), "no `{word}` in: {all}");
        }
        self
    }
}

#[test]
fn a_second_run_takes_its_cells_from_the_cache() {
    let desk = Desk::new();
    let line = "parity --matrix --kernel vsm --column native --column spirv --column glsl \
                --html page.html --json report.json";
    desk.hankel(line, &[])
        .says(0, &["vsm", "all pass", "0 from the cache"]);
    desk.hankel(line, &[]).says(0, &["4 from the cache"]);
    desk.hankel(&format!("{line} --no-cache"), &[])
        .says(0, &["0 from the cache"]);
    let page = fs::read_to_string(desk.path("page.html")).expect("the page is there");
    assert!(page.starts_with("<!DOCTYPE html>") && page.contains("vsm"));
    let report = fs::read_to_string(desk.path("report.json")).expect("the report is there");
    assert!(report.contains("\"largest_ulp\": 0"), "{report}");
}

#[test]
fn a_compiler_that_refuses_crashes_or_hangs_is_told_apart() {
    let desk = Desk::new();
    let line = "parity --matrix --kernel vsm --column glsl --limit 2";
    let with = |script: &str| {
        let program = desk.program(
            "glslang",
            &format!("case $1 in --version) echo glslang 1.0; exit;; esac\n{script}"),
        );
        desk.hankel(line, &[("HANKEL_GLSLANG", &program)])
    };
    with("echo 'ERROR: vsm.glsl:3: odd words'; exit 2")
        .says(1, &["REFUSED", "odd words", "line 3"]);
    with("echo last words; kill -SEGV $$").says(1, &["CRASHED", "SIGSEGV", "last words"]);
    with("echo begun; sleep 60").says(1, &["TIMEOUT", "2 s", "begun"]);
}

#[test]
fn what_is_not_installed_is_named_and_fails_only_if_required() {
    let desk = Desk::new();
    let gone = [("HANKEL_CLANG", "/nowhere/clang++")];
    let line = "parity --matrix --kernel vsm --column msl --column native";
    desk.hankel(line, &gone)
        .says(0, &["missing", "apt-get install clang"]);
    desk.hankel(&format!("{line} --require msl"), &gone)
        .says(1, &["msl is required", "apt-get install clang"]);
    desk.hankel(&format!("{line} --require all"), &[])
        .says(1, &["hlsl-dxc is required", "not asked for"]);
    desk.hankel("doctor", &gone)
        .says(1, &["clang++: not installed", "apt-get install clang-19"]);
}

#[test]
fn a_known_difference_is_one_cell_with_its_outcome() {
    let desk = Desk::new();
    let known = desk.path("known.toml");
    let refusing = desk.program(
        "glslang",
        "case $1 in --version) echo glslang 1.0; exit;; esac\necho 'ERROR: odd words'; exit 2",
    );
    let refusing = [("HANKEL_GLSLANG", refusing.as_str())];
    let line = format!(
        "parity --matrix --kernel vsm_f64 --column glsl --known {}",
        known.display()
    );
    let write = |cells: &str| {
        let text = format!(
            "[[difference]]\nwhat = \"all of it\"\nwhy = \"for a test\"\ncells = [{cells}]\n"
        );
        fs::write(&known, text).expect("the desk can be written");
    };
    let cell = |kernel: &str, rest: &str| {
        format!("{{ kernel = \"{kernel}\", column = \"glsl\", {rest} }}")
    };
    let refused = "outcome = \"REFUSED\", says = \"odd words\"";
    write(&cell("vsm_f64", refused));
    desk.hankel(&line, &refusing).says(0, &["known"]);
    // Another outcome, and other words, are not what is known.
    write(&cell(
        "vsm_f64",
        "outcome = \"FAIL\", numbers = 1, absolute = 0.1",
    ));
    desk.hankel(&line, &refusing)
        .says(1, &["vsm_f64 in glsl", "fails otherwise", "`REFUSED`"]);
    write(&cell(
        "vsm_f64",
        "outcome = \"REFUSED\", says = \"even words\"",
    ));
    desk.hankel(&line, &refusing)
        .says(1, &["fails otherwise", "even words"]);
    // Each cell is stale by itself.
    write(&cell("vsm_f64", refused));
    desk.hankel(&line, &[])
        .says(1, &["vsm_f64 in glsl", "it passed; take it off the list"]);
    write(&cell("other", refused));
    desk.hankel(&line, &[]).says(0, &["all pass"]);
    for (cells, words) in [
        ("", "`cells` is empty"),
        (&*cell("vsm", "outcome = \"FAIL\""), "`numbers`"),
        (&*cell("vsm", "outcome = \"same\""), "none of FAIL"),
    ] {
        write(cells);
        desk.hankel(&line, &[]).says(2, &["known.toml", words]);
    }
    desk.hankel("parity --matrix --known nosuch.toml", &[])
        .says(2, &["nosuch.toml"]);
}

#[test]
fn cells_that_do_not_run_are_a_table() {
    let desk = Desk::new();
    let table = desk.path("absent.toml");
    let line = "parity --matrix --kernel vsm --kernel vsm_f64 --column wgsl --column native";
    desk.hankel(&format!("{line} --write-absent {}", table.display()), &[])
        .says(0, &["all pass"]);
    let text = fs::read_to_string(&table).expect("the table is there");
    assert!(text.contains("wgsl = [\n    \"vsm_f64\",\n]"), "{text}");
    fs::write(&table, "[lacks]\nfoo = 3\n").expect("the desk can be written");
    desk.hankel(&format!("{line} --absent {}", table.display()), &[])
        .says(2, &["absent.toml", "foo"]);
}

#[test]
fn continuous_integration_takes_nothing_from_the_cache() {
    let desk = Desk::new();
    let line = "parity --matrix --kernel vsm --column native --column spirv";
    desk.hankel(line, &[("CI", "")])
        .says(0, &["0 from the cache"]);
    desk.hankel(line, &[("CI", "")])
        .says(0, &["2 from the cache"]);
    desk.hankel(line, &[("CI", "true")])
        .says(0, &["0 from the cache"]);
    // What a driver reads decides, too.
    desk.hankel(line, &[("CI", ""), ("LP_NATIVE_VECTOR_WIDTH", "128")])
        .says(0, &["0 from the cache"]);
}

#[test]
fn misuse_is_explained() {
    let desk = Desk::new();
    desk.hankel("parity --matrix --column metal", &[])
        .says(2, &["metal", "msl"]);
    desk.hankel("parity --matrix --require metal", &[])
        .says(2, &["metal", "msl"]);
    desk.hankel("parity --require msl", &[])
        .says(2, &["--matrix"]);
    desk.hankel("parity --matrix --limit 0", &[])
        .says(2, &["0"]);
    desk.hankel("parity --matrix --kernel nosuch", &[])
        .says(2, &["nosuch"]);
}
