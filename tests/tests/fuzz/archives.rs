//! Archives of toolchains, whose checksum is right.

use std::fs;

use bolero::check;
use hankel_toolchain::{Method, Options, Progress, install};
use sha2::{Digest, Sha256};

use crate::damage::{Damage, keep, says, time};

struct Silent;

impl Progress for Silent {
    fn step(&mut self, _: &str, _: usize, _: usize) {}
    fn advance(&mut self, _: u64, _: Option<u64>) {}
    fn line(&mut self, _: &str) {}
}

/// Files, folders and a link, but no compiler: nothing is started.
fn tar() -> Vec<u8> {
    let mut tar = tar::Builder::new(Vec::new());
    for (name, text) in [
        ("bin/cargo", "#!/bin/sh\n"),
        ("lib/a/b.rlib", "archive"),
        ("c", ""),
    ] {
        let mut header = tar::Header::new_gnu();
        header.set_size(text.len() as u64);
        header.set_mode(0o755);
        tar.append_data(&mut header, name, text.as_bytes())
            .expect("in memory");
    }
    let mut header = tar::Header::new_gnu();
    header.set_entry_type(tar::EntryType::Symlink);
    header.set_size(0);
    tar.append_link(&mut header, "lib/link", "a/b.rlib")
        .expect("in memory");
    tar.into_inner().expect("in memory")
}

fn pack(tar: &[u8]) -> Vec<u8> {
    zstd::encode_all(tar, 1).expect("in memory")
}

#[test]
fn archives() {
    let folder = tempfile::tempdir().expect("a folder");
    let files = [tar(), pack(&tar())];
    check!()
        .with_type::<Damage>()
        .with_test_time(time())
        .for_each(|damage| {
            let (whole, mut bytes) = damage.of(&files);
            // What is inside is damaged before it is compressed, or else nothing of it is read.
            if std::ptr::eq(whole, &files[0]) {
                bytes = pack(&bytes);
            }
            let archive = keep("archive", &bytes);
            let sum: String = Sha256::digest(&bytes)
                .iter()
                .map(|b| format!("{b:02x}"))
                .collect();
            let options = Options {
                cache: Some(folder.path().join("cache")),
                sha256: Some(sum),
                ..Options::default()
            };
            let method = Some(Method::Archive(archive));
            match install(&options, method, &mut Silent) {
                Ok(_) => panic!("it has no compiler"),
                Err(error) => says(&error),
            }
            let names = |folder| -> Vec<_> {
                let entries = fs::read_dir(folder).into_iter().flatten().flatten();
                entries
                    .map(|e| e.file_name())
                    .filter(|n| n != ".lock")
                    .collect()
            };
            assert_eq!(names(folder.path().to_owned()), ["cache"]);
            let left = names(folder.path().join("cache/toolchains"));
            assert!(left.is_empty(), "{left:?}");
        });
}
