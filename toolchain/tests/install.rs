//! Installing from archives, good and bad, interrupted and at the same time.
#![cfg(unix)]

mod common;

use std::fs;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::process::Command;

use common::*;
use hankel_toolchain::{
    Error, Method, Options, Origin, Progress, Silent, ensure, find, install, pinned, status,
};

/// Installing this must fail, and leave nothing behind. The answer is the error's text.
fn refused(scratch: &Scratch, options: &Options, archive: &Path) -> (Error, String) {
    let error = install(options, Some(Method::Archive(archive.into())), &mut Silent).unwrap_err();
    assert_eq!(scratch.toolchains(), [""; 0]);
    assert_eq!(
        find(options)
            .unwrap()
            .filter(|found| found.origin == Origin::Cache),
        None
    );
    let text = error.to_string();
    (error, text)
}

#[test]
fn a_good_archive_is_installed_once() {
    let scratch = Scratch::new();
    let archive = good_archive(&scratch, "a");
    let options = Options {
        archive: Some(archive),
        ..scratch.options()
    };
    let mut record = Record::default();
    let toolchain = ensure(&options, &mut record).unwrap();
    assert_eq!(toolchain.origin, Origin::Archive);
    assert_usable(&toolchain);
    assert_eq!(record.steps, ["1/1 unpack"]);
    let (done, total) = *record.advances.last().unwrap();
    assert_eq!(Some(done), total);
    assert_eq!(scratch.toolchains(), [pinned::name()]);

    let mut record = Record::default();
    let again = ensure(&options, &mut record).unwrap();
    assert_eq!(
        (again.origin, &again.root),
        (Origin::Cache, &toolchain.root)
    );
    assert_usable(&again);
    assert!(record.steps.is_empty());
    assert_eq!(find(&options).unwrap(), Some(again));
}

#[test]
fn a_wrong_checksum_shows_both_sums() {
    let scratch = Scratch::new();
    let bytes = archive_bytes(&toolchain_entries("a"));
    let wrong = sha256(b"something else");
    let archive = write_archive(&scratch.join("a"), &bytes, &wrong);
    let (error, text) = refused(&scratch, &scratch.options(), &archive);
    assert!(matches!(error, Error::Checksum { .. }), "{text}");
    assert!(
        text.contains(&wrong) && text.contains(&sha256(&bytes)),
        "{text}"
    );
    assert!(text.contains("toolchain.tar.zst"), "{text}");
}

#[test]
fn a_file_of_checksums_does_not_replace_a_built_in_one() {
    let scratch = Scratch::new();
    let (name, built_in) = pinned::ARCHIVES[0];
    let bytes = archive_bytes(&toolchain_entries("a"));
    let archive = scratch.join("a").join(name);
    fs::create_dir_all(scratch.join("a")).unwrap();
    fs::write(&archive, &bytes).unwrap();
    let sums = format!("{}  {name}\n", sha256(&bytes));
    fs::write(archive.with_file_name("SHA256SUMS"), sums).unwrap();
    let (error, text) = refused(&scratch, &scratch.options(), &archive);
    assert!(matches!(error, Error::Checksum { .. }), "{text}");
    assert!(text.contains(built_in), "{text}");

    let told = Options {
        sha256: Some(sha256(&bytes)),
        ..scratch.options()
    };
    install(&told, Some(Method::Archive(archive)), &mut Silent).unwrap();
}

#[test]
fn a_truncated_archive_is_refused() {
    let scratch = Scratch::new();
    let bytes = archive_bytes(&toolchain_entries("a"));
    let half = &bytes[..bytes.len() / 2];
    let archive = write_archive(&scratch.join("a"), half, &sha256(&bytes));
    let (error, text) = refused(&scratch, &scratch.options(), &archive);
    assert!(matches!(error, Error::Checksum { .. }), "{text}");

    // Somebody took the checksum of the truncated file.
    let archive = write_archive(&scratch.join("b"), half, &sha256(half));
    let (error, text) = refused(&scratch, &scratch.options(), &archive);
    assert!(matches!(error, Error::Archive { .. }), "{text}");
    assert!(text.contains("truncated"), "{text}");
}

#[test]
fn what_is_no_archive_is_refused() {
    let scratch = Scratch::new();
    let archive = write_archive(&scratch.join("a"), b"hello", &sha256(b"hello"));
    let (error, text) = refused(&scratch, &scratch.options(), &archive);
    assert!(matches!(error, Error::Archive { .. }), "{text}");

    let missing = scratch.join("no/such.tar.zst");
    let (_, text) = refused(&scratch, &scratch.options(), &missing);
    assert!(text.contains("no/such.tar.zst"), "{text}");
}

#[test]
fn an_archive_of_something_else_is_refused() {
    let scratch = Scratch::new();
    let mut entries = toolchain_entries("a");
    entries.retain(|entry| entry.name != "./bin/cargo");
    let bytes = archive_bytes(&entries);
    let archive = write_archive(&scratch.join("a"), &bytes, &sha256(&bytes));
    let (error, text) = refused(&scratch, &scratch.options(), &archive);
    assert!(
        matches!(error, Error::NotAToolchainArchive { .. }),
        "{text}"
    );
    assert!(text.contains("bin/cargo"), "{text}");

    let mut entries = toolchain_entries("b");
    entries[0].data = b"#!/bin/sh\necho 'rustc 1.80.0-nightly (rust-gpu 0.9.0)'\n".into();
    let bytes = archive_bytes(&entries);
    let archive = write_archive(&scratch.join("b"), &bytes, &sha256(&bytes));
    let (_, text) = refused(&scratch, &scratch.options(), &archive);
    assert!(text.contains("0.9.0") && text.contains("0.10.0"), "{text}");

    let mut entries = toolchain_entries("c");
    entries[0].data = b"\x7fELF for another machine".into();
    let bytes = archive_bytes(&entries);
    let archive = write_archive(&scratch.join("c"), &bytes, &sha256(&bytes));
    let (_, text) = refused(&scratch, &scratch.options(), &archive);
    assert!(text.contains("does not run"), "{text}");
}

#[test]
fn entries_that_lead_out_are_refused() {
    let link = |name: &str, target: &str| Entry {
        link: Some(target.into()),
        ..file(name, 0o777, "")
    };
    for hostile in [
        vec![file("../escaped", 0o644, "x")],
        vec![file("bin/../../escaped", 0o644, "x")],
        vec![file("/escaped", 0o644, "x")],
        vec![link("lib/up", ".."), file("lib/up/escaped", 0o644, "x")],
        vec![link("lib/up", "/"), file("lib/up/escaped", 0o644, "x")],
    ] {
        let scratch = Scratch::new();
        let entry = hostile[0].name.clone();
        let mut entries = toolchain_entries("a");
        entries.extend(hostile);
        let bytes = archive_bytes(&entries);
        let archive = write_archive(&scratch.join("a"), &bytes, &sha256(&bytes));
        let (error, text) = refused(&scratch, &scratch.options(), &archive);
        assert!(matches!(error, Error::UnsafeEntry { .. }), "{text}");
        assert!(text.contains(&format!("`{entry}`")), "{text}");
        assert!(!scratch.join("cache/toolchains/escaped").exists());
    }
}

#[test]
fn a_checksum_must_come_from_somewhere() {
    let scratch = Scratch::new();
    let bytes = archive_bytes(&toolchain_entries("a"));
    let archive = scratch.join("plain.tar.zst");
    fs::write(&archive, &bytes).unwrap();
    let (error, text) = refused(&scratch, &scratch.options(), &archive);
    assert!(matches!(error, Error::ChecksumUnknown { .. }), "{text}");
    assert!(
        text.contains("SHA256SUMS") && text.contains("plain.tar.zst"),
        "{text}"
    );

    let options = Options {
        sha256: Some(sha256(&bytes)),
        ..scratch.options()
    };
    install(&options, Some(Method::Archive(archive)), &mut Silent).unwrap();
}

#[test]
fn the_name_of_a_known_archive_is_not_enough() {
    let scratch = Scratch::new();
    let (name, sum) = pinned::ARCHIVES[0];
    let archive = scratch.join(name);
    fs::write(&archive, archive_bytes(&toolchain_entries("a"))).unwrap();
    let (error, text) = refused(&scratch, &scratch.options(), &archive);
    assert!(matches!(error, Error::Checksum { .. }), "{text}");
    assert!(text.contains(sum), "{text}");
}

#[test]
fn a_full_disk_is_noticed_before() {
    let scratch = Scratch::new();
    let archive = good_archive(&scratch, "a");
    let options = Options {
        free_space: |_| Ok(5_000_000),
        ..scratch.options()
    };
    let (error, text) = refused(&scratch, &options, &archive);
    let Error::NoSpace {
        needed, available, ..
    } = error
    else {
        panic!("{text}")
    };
    assert_eq!((available, needed > 15_000_000), (5_000_000, true));
    assert!(text.contains("5 MB available"), "{text}");
    assert!(text.contains("HANKEL_CACHE"), "{text}");
}

#[test]
fn a_cache_that_cannot_be_written_is_named() {
    let scratch = Scratch::new();
    let archive = good_archive(&scratch, "a");
    fs::write(scratch.join("cache"), "a file").unwrap();
    let method = Some(Method::Archive(archive));
    let error = install(&scratch.options(), method, &mut Silent)
        .unwrap_err()
        .to_string();
    assert!(error.contains("cache/toolchains"), "{error}");
}

/// Ends the process, or unwinds, in the middle of unpacking.
struct Stop {
    abort: bool,
}

impl Progress for Stop {
    fn step(&mut self, _: &str, _: usize, _: usize) {}
    fn advance(&mut self, _: u64, _: Option<u64>) {
        if self.abort {
            std::process::abort();
        }
        panic!("stopped on purpose");
    }
    fn line(&mut self, _: &str) {}
}

#[test]
fn unwinding_in_the_middle_leaves_nothing() {
    let scratch = Scratch::new();
    let archive = good_archive(&scratch, "a");
    let method = Some(Method::Archive(archive));
    let stopped = catch_unwind(AssertUnwindSafe(|| {
        install(
            &scratch.options(),
            method.clone(),
            &mut Stop { abort: false },
        )
    }));
    assert!(stopped.is_err());
    assert_eq!(scratch.toolchains(), [""; 0]);
    assert_usable(&install(&scratch.options(), method, &mut Silent).unwrap());
}

const CHILD_CACHE: &str = "HANKEL_TEST_CACHE";

#[test]
#[ignore = "the part of the next test that gets killed"]
fn child_that_is_killed() {
    let Some(cache) = std::env::var_os(CHILD_CACHE) else {
        return;
    };
    let options = Options {
        cache: Some(cache.into()),
        ..Options::from_env()
    };
    let _ = ensure(&options, &mut Stop { abort: true });
}

#[test]
fn being_killed_in_the_middle_leaves_what_the_next_run_removes() {
    let scratch = Scratch::new();
    let archive = good_archive(&scratch, "a");
    let status = Command::new(std::env::current_exe().unwrap())
        .args(["--exact", "child_that_is_killed", "--ignored"])
        .env(CHILD_CACHE, scratch.join("cache"))
        .env("HANKEL_TOOLCHAIN_ARCHIVE", &archive)
        .env_remove("HANKEL_TOOLCHAIN")
        .env_remove("HANKEL_TOOLCHAIN_SHA256")
        .output()
        .unwrap()
        .status;
    assert!(!status.success());
    let left = scratch.toolchains();
    assert!(left.len() == 1 && left[0].starts_with(".new-"), "{left:?}");
    let options = Options {
        archive: Some(archive),
        ..scratch.options()
    };
    let found = find(&options).unwrap();
    assert!(found.is_none_or(|found| found.origin == Origin::Rustup));
    assert_usable(&ensure(&options, &mut Silent).unwrap());
    assert_eq!(scratch.toolchains(), [pinned::name()]);
}

/// Between the two steps by which a toolchain takes another one's place.
#[test]
fn a_toolchain_that_was_being_replaced_stays() {
    let scratch = Scratch::new();
    let options = Options {
        archive: Some(good_archive(&scratch, "a")),
        ..scratch.options()
    };
    let installed = ensure(&options, &mut Silent).unwrap().root;
    let folder = installed.parent().unwrap();
    let old = folder.join(format!(".old-{}", pinned::name()));
    fs::rename(&installed, &old).unwrap();
    fs::create_dir(folder.join(format!(".new-{}", pinned::name()))).unwrap();
    let mut record = Record::default();
    let found = ensure(&options, &mut record).unwrap();
    assert_eq!((found.origin, &found.root), (Origin::Cache, &installed));
    assert_usable(&found);
    assert!(record.steps.is_empty(), "{:?}", record.steps);
    assert_eq!(scratch.toolchains(), [pinned::name()]);
}

#[test]
fn only_one_of_many_unpacks() {
    let scratch = Scratch::new();
    let options = Options {
        archive: Some(good_archive(&scratch, "a")),
        ..scratch.options()
    };
    let origins: Vec<Origin> = std::thread::scope(|scope| {
        let runs: Vec<_> = (0..4)
            .map(|_| scope.spawn(|| ensure(&options, &mut Silent).unwrap()))
            .collect();
        let found = runs.into_iter().map(|run| run.join().unwrap());
        found
            .inspect(assert_usable)
            .map(|toolchain| toolchain.origin)
            .collect()
    });
    let unpacked = origins
        .iter()
        .filter(|origin| **origin == Origin::Archive)
        .count();
    assert_eq!(unpacked, 1, "{origins:?}");
    assert_eq!(scratch.toolchains(), [pinned::name()]);
}

#[test]
fn another_archive_replaces_the_first() {
    let scratch = Scratch::new();
    let (first, second) = (good_archive(&scratch, "a"), good_archive(&scratch, "b"));
    let options = scratch.options();
    let core = |root: &Path| {
        fs::read_to_string(root.join("lib/rustlib/src/rust/library/core/src/lib.rs")).unwrap()
    };
    let one = install(&options, Some(Method::Archive(first.clone())), &mut Silent).unwrap();
    assert_eq!(core(&one.root), "// a\n");
    let two = install(&options, Some(Method::Archive(second)), &mut Silent).unwrap();
    assert_eq!((core(&two.root).as_str(), &two.root), ("// b\n", &one.root));
    assert_eq!(scratch.toolchains(), [pinned::name()]);

    // A replacement that fails leaves the old one in place.
    fs::write(
        first.with_file_name("SHA256SUMS"),
        sha256(b"") + "  toolchain.tar.zst\n",
    )
    .unwrap();
    install(&options, Some(Method::Archive(first)), &mut Silent).unwrap_err();
    assert_eq!(core(&find(&options).unwrap().unwrap().root), "// b\n");
}

#[test]
fn damage_is_named_and_mended() {
    let scratch = Scratch::new();
    let archive = good_archive(&scratch, "a");
    let options = Options {
        archive: Some(archive),
        ..scratch.options()
    };
    let root = ensure(&options, &mut Silent).unwrap().root;

    for (file, change) in [("bin/rustc", Some("#!/bin/sh\n")), ("bin/cargo", None)] {
        match change {
            Some(text) => fs::write(root.join(file), text).unwrap(),
            None => fs::remove_file(root.join(file)).unwrap(),
        }
        let error = find(&options).unwrap_err();
        assert!(matches!(error, Error::Damaged { .. }), "{error}");
        assert!(error.to_string().contains(file), "{error}");
        assert!(status(&options).to_string().contains(file));
        // Without an archive there is nothing to mend it with.
        let bare = Options {
            archive: None,
            ..options.clone()
        };
        assert!(matches!(
            ensure(&bare, &mut Silent),
            Err(Error::Damaged { .. })
        ));
        let mut record = Record::default();
        assert_eq!(
            ensure(&options, &mut record).unwrap().origin,
            Origin::Archive
        );
        assert!(
            record.lines.iter().any(|line| line.contains(file)),
            "{:?}",
            record.lines
        );
    }

    // A file of the library: too many to look at each time, but not for `status`.
    fs::remove_file(root.join("lib/rustlib/src/rust/library/core/src/lib.rs")).unwrap();
    find(&options).unwrap().unwrap();
    let text = status(&options).to_string();
    assert!(
        text.contains("damaged") && text.contains("4 files"),
        "{text}"
    );
    assert_eq!(
        install(&options, None, &mut Silent).unwrap().origin,
        Origin::Archive
    );
    assert!(!status(&options).to_string().contains("damaged"));

    fs::write(root.join("hankel-toolchain.json"), "{").unwrap();
    let error = find(&options).unwrap_err().to_string();
    assert!(error.contains("hankel-toolchain.json"), "{error}");
    fs::remove_file(root.join("hankel-toolchain.json")).unwrap();
    let error = find(&options).unwrap_err().to_string();
    assert!(
        error.contains("hankel-toolchain.json is missing"),
        "{error}"
    );
}
