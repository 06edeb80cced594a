//! Which of several toolchains is used, and what `status` says about each.
#![cfg(unix)]

mod common;

use std::fs;

use common::*;
use hankel_toolchain::{Error, Options, Origin, Silent, State, ensure, find, install, status};

#[test]
fn a_named_folder_comes_before_everything() {
    let scratch = Scratch::new();
    let folder = scratch.join("mine");
    toolchain_folder(&folder);
    let options = Options {
        archive: Some(good_archive(&scratch, "a")),
        ..scratch.options()
    };
    ensure(&options, &mut Silent).unwrap();

    let named = Options {
        path: Some(folder.clone()),
        ..options.clone()
    };
    for found in [
        find(&named).unwrap().unwrap(),
        ensure(&named, &mut Silent).unwrap(),
        install(&named, None, &mut Silent).unwrap(),
    ] {
        assert_eq!((found.origin, &found.root), (Origin::ExplicitPath, &folder));
        assert_usable(&found);
    }
    let answer = status(&named);
    assert_eq!(answer.used, Some(Origin::ExplicitPath));
    assert!(answer.to_string().contains("> explicit path"), "{answer}");

    assert_eq!(find(&options).unwrap().unwrap().origin, Origin::Cache);
    assert_eq!(status(&options).used, Some(Origin::Cache));
}

#[test]
fn a_named_folder_that_is_wrong_is_not_passed_over() {
    let scratch = Scratch::new();
    let options = Options {
        archive: Some(good_archive(&scratch, "a")),
        ..scratch.options()
    };
    ensure(&options, &mut Silent).unwrap();
    let folder = scratch.join("mine");
    let named = Options {
        path: Some(folder.clone()),
        ..options
    };
    let check = |part: &str| {
        for error in [
            find(&named).unwrap_err(),
            ensure(&named, &mut Silent).unwrap_err(),
            install(&named, None, &mut Silent).unwrap_err(),
        ] {
            assert!(matches!(error, Error::NotAToolchain { .. }), "{error}");
            let text = error.to_string();
            assert!(text.contains(part) && text.contains("mine"), "{text}");
        }
        let answer = status(&named);
        assert_eq!((answer.used, answer.ways[0].state), (None, State::Unusable));
    };
    check("no such folder");
    toolchain_folder(&folder);
    fs::remove_file(folder.join("lib/librustc_codegen_spirv.so")).unwrap();
    check("librustc_codegen_spirv.so");
}

#[test]
fn the_cache_comes_before_an_archive() {
    let scratch = Scratch::new();
    let first = Options {
        archive: Some(good_archive(&scratch, "a")),
        ..scratch.options()
    };
    ensure(&first, &mut Silent).unwrap();
    let second = Options {
        archive: Some(good_archive(&scratch, "b")),
        ..scratch.options()
    };
    assert_eq!(ensure(&second, &mut Silent).unwrap().origin, Origin::Cache);
    // Not even looked at.
    let missing = Options {
        archive: Some(scratch.join("none.tar.zst")),
        ..scratch.options()
    };
    assert_eq!(ensure(&missing, &mut Silent).unwrap().origin, Origin::Cache);
}

#[test]
fn an_archive_comes_before_rustup_and_source() {
    let scratch = Scratch::new();
    let options = Options {
        archive: Some(good_archive(&scratch, "a")),
        ..scratch.options()
    };
    let answer = status(&options);
    assert_eq!(answer.ways[2].state, State::Installable);
    assert_eq!(answer.used, Some(Origin::Archive));
    assert!(
        answer
            .to_string()
            .ends_with("used: archive, which is unpacked when it is first needed")
    );
    assert_eq!(
        install(&options, None, &mut Silent).unwrap().origin,
        Origin::Archive
    );
}

#[test]
fn status_lists_all_five_in_order() {
    let scratch = Scratch::new();
    let options = Options {
        archive: Some(scratch.join("none.tar.zst")),
        bootstrap: Some("no-such-toolchain".into()),
        ..scratch.options()
    };
    let answer = status(&options);
    assert_eq!(answer.used, None);
    let origins: Vec<Origin> = answer.ways.iter().map(|way| way.origin).collect();
    assert_eq!(origins, Origin::ALL);
    let text = answer.to_string();
    for part in [
        "HANKEL_TOOLCHAIN is not set",
        "nothing is installed",
        "none.tar.zst",
    ] {
        assert!(text.contains(part), "{part}: {text}");
    }
    assert_eq!(answer.ways[4].state, State::Unusable);
    let json = serde_json::to_value(&answer).unwrap();
    assert_eq!(json["ways"][0]["origin"], "explicit-path");
    assert_eq!(json["ways"][0]["state"], "absent");
    assert_eq!(json["ways"][2]["state"], "unusable");
    assert_eq!(json["rust_gpu_version"], "0.10.0");
    assert!(
        scratch.toolchains().is_empty(),
        "status must not make anything"
    );
}
