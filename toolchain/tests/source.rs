//! The build from source where it cannot start or get on. The build itself takes 20
//! minutes and a network; it is not a test.
#![cfg(all(target_os = "linux", target_arch = "x86_64", target_env = "gnu"))]

mod common;

use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::PathBuf;

use common::*;
use hankel_toolchain::{Error, Method, Options, Silent, State, install, status};

fn attempt(options: &Options) -> Error {
    install(options, Some(Method::Source), &mut Silent).unwrap_err()
}

/// A make-believe Rust 1.97 whose cargo always fails in this way.
fn bootstrap(scratch: &Scratch, version: &str, message: &str) -> String {
    let root = scratch.join("bootstrap");
    fs::create_dir_all(root.join("bin")).unwrap();
    for (name, script) in [
        ("rustc", format!("#!/bin/sh\necho '{version}'\n")),
        (
            "cargo",
            format!("#!/bin/sh\necho '{message}' >&2\nexit 101\n"),
        ),
    ] {
        let path = root.join("bin").join(name);
        fs::write(&path, script).unwrap();
        fs::set_permissions(&path, fs::Permissions::from_mode(0o755)).unwrap();
    }
    root.into_os_string().into_string().unwrap()
}

/// Options with a bootstrap that passes; `None` where this machine has no C++ compiler
/// or another program that the build looks for first.
fn startable(scratch: &Scratch, message: &str) -> Option<Options> {
    let version = "rustc 1.97.0-nightly (make-believe)";
    let options = Options {
        bootstrap: Some(bootstrap(scratch, version, message)),
        rust_src: Some(PathBuf::from("none.deb")),
        ..scratch.options()
    };
    let way = status(&options).ways.pop().unwrap();
    if way.state == State::Installable {
        assert!(way.why.contains(version), "{}", way.why);
        return Some(options);
    }
    eprintln!("not tested here: missing {}", way.missing.join(", "));
    None
}

#[test]
fn a_bootstrap_that_is_missing_or_of_the_wrong_version_is_named() {
    let scratch = Scratch::new();
    let options = Options {
        bootstrap: Some("no-such".into()),
        ..scratch.options()
    };
    let error = attempt(&options);
    assert!(matches!(error, Error::MissingTools { .. }), "{error}");
    let text = error.to_string();
    assert!(
        text.contains("no-such") && text.contains("HANKEL_BOOTSTRAP"),
        "{text}"
    );

    let old = bootstrap(&scratch, "rustc 1.60.0 (old)", "");
    let text = attempt(&Options {
        bootstrap: Some(old),
        ..scratch.options()
    })
    .to_string();
    assert!(text.contains("1.60.0") && text.contains("1.97"), "{text}");
    assert_eq!(scratch.toolchains(), [""; 0]);
}

#[test]
fn no_network() {
    let scratch = Scratch::new();
    let message = "error: failed to download from the registry";
    let Some(options) = startable(&scratch, message) else {
        return;
    };
    let error = attempt(&options);
    assert!(matches!(error, Error::Network { .. }), "{error}");
    let text = error.to_string();
    assert!(
        text.contains("rust-gpu's backend") && text.contains(message),
        "{text}"
    );
    // What is kept for the next run is no toolchain.
    assert_eq!(scratch.toolchains(), [".build"]);
}

#[test]
fn a_full_disk_is_noticed_before() {
    let scratch = Scratch::new();
    let Some(options) = startable(&scratch, "") else {
        return;
    };
    let error = attempt(&Options {
        free_space: |_| Ok(2_000_000_000),
        ..options
    });
    let Error::NoSpace {
        needed, available, ..
    } = error
    else {
        panic!("{error}")
    };
    assert_eq!((available, needed > 3_000_000_000), (2_000_000_000, true));
}
