//! A make-believe toolchain and archives of it.
#![allow(dead_code, reason = "every test file uses a part of this")]

use std::fmt::Write as _;
use std::fs;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};

use hankel_toolchain::{Options, Progress, Toolchain};
use sha2::{Digest, Sha256};

/// What the make-believe `rustc --version` prints.
pub const VERSION: &str = "rustc 1.98.1-nightly (make-believe, rust-gpu 0.10.0)";

/// A folder that goes away with the test.
pub struct Scratch(pub PathBuf);

impl Scratch {
    pub fn new() -> Self {
        static COUNT: AtomicU32 = AtomicU32::new(0);
        let count = COUNT.fetch_add(1, Ordering::Relaxed);
        let name = format!("hankel-toolchain-test-{}-{count}", std::process::id());
        let folder = std::env::temp_dir().join(name);
        fs::create_dir_all(&folder).unwrap();
        Self(folder)
    }

    pub fn join(&self, name: &str) -> PathBuf {
        self.0.join(name)
    }

    /// Options that see nothing of this machine but this folder.
    pub fn options(&self) -> Options {
        Options {
            cache: Some(self.join("cache")),
            ..Options::default()
        }
    }

    /// Names in the folder of installed toolchains, hidden ones too, without the lock.
    pub fn toolchains(&self) -> Vec<String> {
        let Ok(entries) = fs::read_dir(self.join("cache/toolchains")) else {
            return Vec::new();
        };
        let mut names: Vec<String> = entries
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .collect();
        names.retain(|name| name != ".lock");
        names.sort();
        names
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

/// One entry of an archive.
pub struct Entry {
    pub name: String,
    pub mode: u32,
    pub data: Vec<u8>,
    pub link: Option<String>,
}

pub fn file(name: &str, mode: u32, data: impl Into<Vec<u8>>) -> Entry {
    Entry {
        name: name.into(),
        mode,
        data: data.into(),
        link: None,
    }
}

/// Bytes that do not compress.
pub fn noise(count: usize) -> Vec<u8> {
    let mut state = 0x2545_f491_4f6c_dd1d_u64;
    let mut byte = || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 32) as u8
    };
    (0..count).map(|_| byte()).collect()
}

fn rustc(version: &str) -> Entry {
    file(
        "./bin/rustc",
        0o755,
        format!("#!/bin/sh\necho '{version}'\n"),
    )
}

/// The files of a make-believe toolchain; `salt` makes archives differ.
pub fn toolchain_entries(salt: &str) -> Vec<Entry> {
    vec![
        rustc(VERSION),
        file("./bin/cargo", 0o755, "#!/bin/sh\n"),
        file("./lib/librustc_codegen_spirv.so", 0o644, "inside"),
        file(
            "./lib/rustlib/src/rust/library/core/src/lib.rs",
            0o644,
            format!("// {salt}\n"),
        ),
        file(
            "./lib/rustlib/some-host/lib/libstd.rlib",
            0o644,
            noise(3_000_000),
        ),
    ]
}

/// Writes the same files as a folder.
pub fn toolchain_folder(root: &Path) {
    use std::os::unix::fs::PermissionsExt;
    for entry in toolchain_entries("folder") {
        let path = root.join(entry.name.trim_start_matches("./"));
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(&path, &entry.data).unwrap();
        fs::set_permissions(&path, fs::Permissions::from_mode(entry.mode)).unwrap();
    }
}

pub fn sha256(data: &[u8]) -> String {
    Sha256::digest(data)
        .iter()
        .fold(String::new(), |mut text, byte| {
            let _ = write!(text, "{byte:02x}");
            text
        })
}

/// A `.tar.zst` of these entries. Names are written as they are, hostile ones too.
pub fn archive_bytes(entries: &[Entry]) -> Vec<u8> {
    let mut tar = tar::Builder::new(Vec::new());
    for entry in entries {
        let mut header = tar::Header::new_gnu();
        header.as_old_mut().name[..entry.name.len()].copy_from_slice(entry.name.as_bytes());
        header.set_mode(entry.mode);
        header.set_size(entry.data.len() as u64);
        if let Some(target) = &entry.link {
            header.set_entry_type(tar::EntryType::Symlink);
            header.set_link_name_literal(target).unwrap();
        }
        header.set_cksum();
        tar.append(&header, &entry.data[..]).unwrap();
    }
    zstd::encode_all(&tar.into_inner().unwrap()[..], 1).unwrap()
}

/// Writes an archive and a `SHA256SUMS` file beside it, in a folder of their own.
pub fn write_archive(folder: &Path, bytes: &[u8], sum: &str) -> PathBuf {
    fs::create_dir_all(folder).unwrap();
    let path = folder.join("toolchain.tar.zst");
    fs::File::create(&path).unwrap().write_all(bytes).unwrap();
    fs::write(
        folder.join("SHA256SUMS"),
        format!("{sum}  toolchain.tar.zst\n"),
    )
    .unwrap();
    path
}

/// An archive of a make-believe toolchain with the right checksum beside it.
pub fn good_archive(scratch: &Scratch, name: &str) -> PathBuf {
    let bytes = archive_bytes(&toolchain_entries(name));
    write_archive(&scratch.join(name), &bytes, &sha256(&bytes))
}

/// Writes down what it is told.
#[derive(Default)]
pub struct Record {
    pub steps: Vec<String>,
    pub lines: Vec<String>,
    pub advances: Vec<(u64, Option<u64>)>,
}

impl Progress for Record {
    fn step(&mut self, name: &str, index: usize, count: usize) {
        self.steps.push(format!("{index}/{count} {name}"));
    }

    fn advance(&mut self, done: u64, total: Option<u64>) {
        self.advances.push((done, total));
    }

    fn line(&mut self, text: &str) {
        self.lines.push(text.to_owned());
    }
}

pub fn assert_usable(toolchain: &Toolchain) {
    assert_eq!(toolchain.rustc_version, VERSION);
    assert_eq!(toolchain.rust_gpu_version, "0.10.0");
    assert!(toolchain.backend.is_file());
    assert!(toolchain.bin.as_ref().unwrap().join("rustc").is_file());
    assert_eq!(toolchain.channel, None);
}
