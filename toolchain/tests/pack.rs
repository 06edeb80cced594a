//! Packing an installed toolchain for others.
#![cfg(unix)]

mod common;

use std::fs;
use std::os::unix::fs::PermissionsExt;

use common::*;
use hankel_toolchain::{Error, Method, Options, Silent, ensure, find, install, pack, pinned};

#[test]
fn a_packed_toolchain_can_be_installed_elsewhere() {
    let here = Scratch::new();
    let options = Options {
        archive: Some(good_archive(&here, "a")),
        ..here.options()
    };
    let toolchain = ensure(&options, &mut Silent).unwrap();
    let out = here.join("out");
    let packed = pack(&toolchain, &out, &mut Silent).unwrap();
    assert_eq!(packed.path, out.join(format!("{}.tar.zst", pinned::name())));
    let bytes = fs::read(&packed.path).unwrap();
    assert_eq!(
        (packed.bytes, &packed.sha256),
        (bytes.len() as u64, &sha256(&bytes))
    );

    let there = Scratch::new();
    let method = Some(Method::Archive(packed.path.clone()));
    // It bears the name of the archive whose checksum is built in: the file beside it does not beat
    // that, its own checksum has to be given.
    let refused = install(&there.options(), method.clone(), &mut Silent).unwrap_err();
    assert!(matches!(refused, Error::Checksum { .. }), "{refused}");
    let told = Options {
        sha256: Some(packed.sha256.clone()),
        ..there.options()
    };
    let installed = install(&told, method, &mut Silent).unwrap();
    assert_usable(&installed);
    let mode = |file| {
        fs::metadata(installed.root.join(file))
            .unwrap()
            .permissions()
            .mode()
            & 0o777
    };
    assert_eq!(
        (mode("bin/rustc"), mode("lib/librustc_codegen_spirv.so")),
        (0o755, 0o644)
    );

    // The same toolchain gives the same bytes, whoever has unpacked it and when.
    let again = find(&there.options()).unwrap().unwrap();
    assert_eq!(
        pack(&again, &there.join("out"), &mut Silent)
            .unwrap()
            .sha256,
        packed.sha256
    );
    let sums = fs::read_to_string(out.join("SHA256SUMS")).unwrap();
    assert_eq!(
        sums,
        format!("{}  {}.tar.zst\n", packed.sha256, pinned::name())
    );
}

#[test]
fn sums_of_other_files_stay() {
    let scratch = Scratch::new();
    let folder = scratch.join("mine");
    toolchain_folder(&folder);
    let options = Options {
        path: Some(folder),
        ..scratch.options()
    };
    let toolchain = find(&options).unwrap().unwrap();
    let out = scratch.join("out");
    fs::create_dir_all(&out).unwrap();
    let other = format!("{}  another.file\n", sha256(b"x"));
    fs::write(out.join("SHA256SUMS"), &other).unwrap();
    let packed = pack(&toolchain, &out, &mut Silent).unwrap();
    pack(&toolchain, &out, &mut Silent).unwrap();
    let sums = fs::read_to_string(out.join("SHA256SUMS")).unwrap();
    assert_eq!(
        sums,
        format!("{other}{}  {}.tar.zst\n", packed.sha256, pinned::name())
    );
    let names = fs::read_dir(out).unwrap().count();
    assert_eq!(names, 2, "nothing partial stays");
}
