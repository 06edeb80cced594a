//! Committed SPIR-V belongs to its sources. Where rust-gpu's compiler is there, it is made again
//! and compared byte for byte; where not, the hashes of what it was made from are the guard. Both
//! say which it was, and CI fails if it was not what it should have been.

use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use std::process::Command;

use hankel_codegen::compile::{Compiler, LINKED_SUBFOLDER, Wanted, compile};
use hankel_codegen::finished::finish_all;
use hankel_dsl::native::describe::Kernel;
use hankel_tests::{Crate, root};
use hankel_toolchain::{Options, Silent};

/// `.ci/run` reads it.
const REPORT: &str = "target/spirv-rebuilt.txt";

#[test]
fn committed_spirv_follows_from_its_sources() {
    let crates = [
        Crate::shadows(),
        Crate::conformance(),
        Crate::iteration(),
        Crate::listing(),
        Crate::ports(),
    ];
    let toolchain = match hankel_toolchain::ensure(&Options::from_env(), &mut Silent) {
        Ok(toolchain) => toolchain,
        Err(hankel_toolchain::Error::NotInstalled { .. }) => {
            assert!(
                std::env::var_os("HANKEL_REQUIRE_COMPILER").is_none(),
                "HANKEL_REQUIRE_COMPILER is set, but there is no rust-gpu compiler"
            );
            eprintln!("SPIR-V: no rust-gpu compiler here; checked by the hashes of its sources");
            return;
        }
        Err(error) => panic!("{error}"),
    };
    let compiler = Compiler {
        backend: toolchain.backend,
        bin: toolchain.bin,
        channel: toolchain.channel,
    };
    let mut lines = String::new();
    for one in crates {
        let kernels: Vec<_> = one.entries.iter().map(|e| e.kernel.clone()).collect();
        let names: Vec<&str> = kernels.iter().map(|k| k.name.as_str()).collect();
        let target = root().join("target");
        let linked = target.join(LINKED_SUBFOLDER);
        let compile = |wanted| {
            // No module is taken from an earlier build, nor from the one before.
            if linked.exists() {
                fs::remove_dir_all(&linked).unwrap();
            }
            compile(&one.manifest, &compiler, &target, wanted, &mut |_| {})
                .unwrap_or_else(|e| panic!("{e}"))
        };
        // A build of some kernels gives what a build of all gives.
        let some: Vec<&str> = names.iter().step_by(30).copied().collect();
        let alone = compile(Wanted::Only(&some)).modules;
        assert_eq!(alone.keys().collect::<Vec<_>>(), {
            let mut some = some.iter().collect::<Vec<_>>();
            some.sort();
            some
        });
        let compiled = compile(Wanted::All(&names));
        let is_alone = |kernel: &&Kernel| some.contains(&kernel.name.as_str());
        let alone_kernels: Vec<Kernel> = kernels.iter().filter(is_alone).cloned().collect();
        let alone = finish_all(&alone, &alone_kernels, None).unwrap_or_else(|e| panic!("{e}"));
        let fresh = finish_all(&compiled.modules, &kernels, None).unwrap_or_else(|e| panic!("{e}"));
        for (name, bytes) in &fresh {
            assert_eq!(
                Some(bytes),
                one.bundle.modules.get(name),
                "{name}: run `cargo xtask spirv`"
            );
        }
        assert_eq!(fresh.len(), one.bundle.modules.len());
        for (name, bytes) in &alone {
            assert!(fresh.get(name) == Some(bytes), "{name}: alone it is other");
        }
        // What was recorded is what a build reads, no less and no more.
        assert_eq!(
            compiled.inputs, one.bundle.origin.inputs,
            "run `cargo xtask spirv`"
        );
        let line = format!(
            "SPIR-V: {} modules of {} rebuilt from source, the same bytes as committed\n",
            fresh.len(),
            one.bundle.origin.crate_name
        );
        eprint!("{line}");
        lines.push_str(&line);
    }
    fs::write(root().join(REPORT), lines).expect("target/ can be written");
}

/// The record that is embedded in `hankel` watches whole folders: all that the compiler read lies
/// in them.
#[test]
fn the_program_knows_every_source_of_its_kernels() {
    let recorded = Crate::shadows().bundle.origin.inputs;
    assert!(recorded.files.len() > 20, "{recorded:?}");
    for (name, hash) in &recorded.files {
        let known = ["src/", "Cargo.toml", "build.rs"].iter().any(|rest| {
            name.starts_with(rest)
                || ["dsl", "macros", "moments"]
                    .iter()
                    .any(|krate| name.starts_with(&format!("../{krate}/{rest}")))
        });
        assert!(known, "codegen/embedded/build.rs does not watch {name}");
        assert_eq!(hash.is_none(), name.ends_with("build.rs"), "{name}");
    }
    assert!(recorded.folders.is_empty() && recorded.environment.is_empty());
}

/// `.ci/run` with a stand-in for `./check`, with and without an archive beside the checkout.
fn ci(archive: bool, check: &str) -> (bool, String) {
    let place = tempfile::tempdir().expect("a temporary folder");
    let checkout = place.path().join("checkout");
    let put = |path: &Path, text: &str| {
        fs::create_dir_all(path.parent().expect("it lies in a folder")).expect("a folder");
        fs::write(path, text).expect("a file");
        fs::set_permissions(path, fs::Permissions::from_mode(0o755)).expect("a mode");
    };
    let run = fs::read_to_string(root().join(".ci/run")).expect("it can be read");
    put(&checkout.join(".ci/run"), &run);
    put(
        &checkout.join("check"),
        &format!("#!/bin/sh\nset -eu\n{check}\n"),
    );
    fs::create_dir(checkout.join("target")).expect("a folder");
    put(
        &checkout.join(REPORT),
        "SPIR-V: 1 module of an earlier run\n",
    );
    if archive {
        put(
            &place.path().join("shared/toolchain/rust-gpu-1.tar.zst"),
            "",
        );
    }
    let output = Command::new(checkout.join(".ci/run"))
        .env_remove("HANKEL_TOOLCHAIN_ARCHIVE")
        .env_remove("HANKEL_REQUIRE_COMPILER")
        .output()
        .expect("it starts");
    let said = [output.stdout, output.stderr].concat();
    (
        output.status.success(),
        String::from_utf8_lossy(&said).into_owned(),
    )
}

#[test]
fn ci_says_whether_spirv_was_rebuilt_and_fails_if_it_should_have_been() {
    let rebuilds = format!(
        "test \"$HANKEL_REQUIRE_COMPILER\" = yes\ntest -f \"$HANKEL_TOOLCHAIN_ARCHIVE\"\n\
         echo 'SPIR-V: 75 modules rebuilt' > {REPORT}"
    );
    let (fine, said) = ci(true, &rebuilds);
    assert!(
        fine && said.ends_with("SPIR-V: 75 modules rebuilt\n"),
        "{said}"
    );
    let (fine, said) = ci(true, "true");
    assert!(
        !fine && said.contains("NOT rebuilt from source, though"),
        "{said}"
    );
    let (fine, said) = ci(false, "test -z \"${HANKEL_REQUIRE_COMPILER:-}\"");
    assert!(
        fine && said
            .ends_with("NOT rebuilt from source: only the hashes of its sources were checked\n"),
        "{said}"
    );
    let (fine, _) = ci(false, "false");
    assert!(!fine);
}
