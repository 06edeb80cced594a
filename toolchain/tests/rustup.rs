//! rustup where there is no network: a clear error, soon, and nothing left behind.
#![cfg(unix)]

mod common;

use std::path::Path;
use std::process::Command;

use common::Scratch;
use hankel_toolchain::{Error, Method, Options, Silent, install};

/// Set for the child only.
const CHILD: &str = "HANKEL_TEST_RUSTUP";

#[test]
#[ignore = "the part of the next test that runs in another environment"]
fn child_without_network() {
    // Only ever started by `run`: with a network, this would install a toolchain.
    if std::env::var_os(CHILD).is_none() {
        return;
    }
    let error = install(&Options::from_env(), Some(Method::Rustup), &mut Silent).unwrap_err();
    assert!(matches!(error, Error::Rustup { .. }), "{error}");
    println!("ERROR: {error}");
}

fn files_below(folder: &Path) -> Vec<String> {
    let Ok(entries) = std::fs::read_dir(folder) else {
        return Vec::new();
    };
    entries
        .map(|entry| entry.unwrap())
        .flat_map(|entry| match entry.file_type().unwrap().is_dir() {
            true => files_below(&entry.path()),
            false => vec![entry.file_name().into_string().unwrap()],
        })
        .collect()
}

fn run(scratch: &Scratch, configure: impl Fn(&mut Command)) -> String {
    let mut child = Command::new(std::env::current_exe().unwrap());
    child
        .args([
            "--exact",
            "child_without_network",
            "--ignored",
            "--nocapture",
        ])
        .env(CHILD, "1")
        .env("HANKEL_CACHE", scratch.join("cache"))
        .env("XDG_CACHE_HOME", scratch.join("xdg"))
        .env("RUSTUP_HOME", scratch.join("rustup"))
        // Nothing listens on the discard port: the connection is refused at once.
        .env("RUSTUP_DIST_SERVER", "http://127.0.0.1:9")
        .env_remove("RUSTUP_TOOLCHAIN");
    configure(&mut child);
    let output = child.output().unwrap();
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(
        output.status.success(),
        "{text}{}",
        String::from_utf8_lossy(&output.stderr)
    );
    assert_eq!(files_below(&scratch.join("xdg")), [""; 0]);
    assert_eq!(scratch.toolchains(), [""; 0]);
    assert_eq!(files_below(&scratch.join("rustup/toolchains")), [""; 0]);
    assert!(text.contains("ERROR: "), "{text}");
    text
}

#[test]
fn no_network() {
    let scratch = Scratch::new();
    let text = run(&scratch, |_| {});
    assert!(
        text.contains("nightly-2026-07-03") || text.contains("not in PATH"),
        "{text}"
    );
    assert!(text.contains("help: with a network"), "{text}");
    assert!(!text.contains("backtrace"), "{text}");
}

#[test]
fn no_rustup() {
    let scratch = Scratch::new();
    let text = run(&scratch, |child| {
        child.env("PATH", scratch.join("empty"));
    });
    assert!(text.contains("rustup is not in PATH"), "{text}");
}
