//! The archives of a release: what is in them, where `cargo binstall` looks for it, and checksums.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

const TARGET: &str = "x86_64-unknown-linux-gnu";

fn root() -> PathBuf {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    here.parent().expect("cli/ lies in the root").to_owned()
}

fn script(arguments: &[&str], binary: &str) -> Output {
    Command::new(root().join("integrations/release/archive.sh"))
        .args(arguments)
        .env("HANKEL_BINARY", binary)
        .output()
        .expect("bash runs")
}

fn said(command: &mut Command) -> String {
    let done = command.output().expect("the program starts");
    let errors = String::from_utf8_lossy(&done.stderr);
    assert!(done.status.success(), "{command:?}: {errors}");
    String::from_utf8_lossy(&done.stdout).into_owned()
}

#[test]
fn an_archive_has_the_program_where_binstall_looks_for_it() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("release");
    let done = script(
        &[TARGET, out.to_str().unwrap()],
        env!("CARGO_BIN_EXE_hankel"),
    );
    let errors = String::from_utf8_lossy(&done.stderr);
    assert!(done.status.success(), "{errors}");

    // The names are those of the package's description.
    let manifest = std::fs::read_to_string(root().join("cli/Cargo.toml")).unwrap();
    let value = |key: &str| {
        let line = manifest
            .lines()
            .find_map(|l| l.strip_prefix(&format!("{key} = \"")))
            .unwrap_or_else(|| panic!("no {key}"));
        line.trim_end_matches('"')
            .replace("{ version }", env!("CARGO_PKG_VERSION"))
            .replace("{ target }", TARGET)
            .replace("{ bin }", "hankel")
            .replace("{ binary-ext }", "")
    };
    let name = value("pkg-url");
    let archive = out.join(name.rsplit('/').next().unwrap());
    assert!(archive.is_file(), "no {}", archive.display());
    assert_eq!(value("pkg-fmt"), "tgz");
    said(
        Command::new("tar")
            .arg("-xzf")
            .arg(&archive)
            .arg("-C")
            .arg(folder.path()),
    );
    let program = folder.path().join(value("bin-dir"));
    let version = said(Command::new(&program).arg("--version"));
    assert_eq!(
        version.trim(),
        concat!("hankel ", env!("CARGO_PKG_VERSION"))
    );
    for beside in ["README.md", "LICENSE-MIT", "LICENSE-APACHE"] {
        assert!(program.with_file_name(beside).is_file(), "no {beside}");
    }
    said(
        Command::new("sha256sum")
            .args(["--check", "--strict", "SHA256SUMS"])
            .current_dir(&out),
    );
}

#[test]
fn the_same_program_gives_the_same_archive_and_bad_input_none() {
    let folder = tempfile::tempdir().unwrap();
    let program = folder.path().join("program");
    std::fs::write(&program, "#!/bin/sh\n").unwrap();
    let sums = |out: &str| {
        let out = folder.path().join(out);
        for target in ["aarch64-unknown-linux-gnu", TARGET] {
            let done = script(&[target, out.to_str().unwrap()], program.to_str().unwrap());
            let errors = String::from_utf8_lossy(&done.stderr);
            assert!(done.status.success(), "{errors}");
        }
        std::fs::read_to_string(out.join("SHA256SUMS")).unwrap()
    };
    let first = sums("first");
    assert_eq!(first.lines().count(), 2, "{first}");
    assert_eq!(first, sums("second"));

    let none = folder.path().join("none");
    let bad = |arguments: &[&str], binary: &str, code: i32, words: &str| {
        let done = script(arguments, binary);
        let errors = String::from_utf8_lossy(&done.stderr);
        assert_eq!(done.status.code(), Some(code), "{errors}");
        assert!(errors.contains(words), "{errors}");
    };
    let out = none.to_str().unwrap();
    bad(&[], "", 2, "usage: ");
    bad(&["../x", out], "", 2, "`../x` is not a target");
    bad(
        &[TARGET, out],
        "/nothing/here",
        2,
        "/nothing/here: there is no such file",
    );
    bad(
        &["x86_64-unknown-linux-musl", out],
        "",
        3,
        "set CXX_x86_64_unknown_linux_musl",
    );
    assert!(!none.exists());
}
