//! A compiler that was found, and what it takes to run it.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::{Mutex, OnceLock};
use std::time::SystemTime;

use serde::Serialize;

use crate::error::{Error, Result};
use crate::pinned;
use crate::process;

/// Where a toolchain comes from. In the order in which they are tried.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Origin {
    /// The folder that the user named.
    ExplicitPath,
    /// Installed earlier in the user's cache folder.
    Cache,
    /// Unpacked from an archive just now.
    Archive,
    /// rustup's nightly, with the backend that cargo-gpu-install compiled for it.
    Rustup,
    /// Built from source just now.
    Source,
}

impl Origin {
    /// All of them, in order.
    pub const ALL: [Self; 5] = [
        Self::ExplicitPath,
        Self::Cache,
        Self::Archive,
        Self::Rustup,
        Self::Source,
    ];

    /// A name for people.
    pub fn name(self) -> &'static str {
        match self {
            Self::ExplicitPath => "explicit path",
            Self::Cache => "cache",
            Self::Archive => "archive",
            Self::Rustup => "rustup",
            Self::Source => "source",
        }
    }
}

/// A usable compiler.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[non_exhaustive]
pub struct Toolchain {
    /// Where it comes from.
    pub origin: Origin,
    /// Its sysroot.
    pub root: PathBuf,
    /// rust-gpu's code generator, as spirv-builder wants it.
    pub backend: PathBuf,
    /// Folder that has to come first in `PATH`; `None`: rustup's proxies do it.
    pub bin: Option<PathBuf>,
    /// rustup's name of the toolchain; `None`: it is not one of rustup's.
    pub channel: Option<String>,
    /// What `rustc --version` prints.
    pub rustc_version: String,
    /// Version of rust-gpu, or `unknown` where nothing tells.
    pub rust_gpu_version: String,
}

impl Toolchain {
    /// A self-contained toolchain in the folder `root`: `Err` says what is wrong with it.
    pub(crate) fn at(root: &Path, origin: Origin) -> Result<Self, String> {
        if !root.is_dir() {
            return Err("there is no such folder".to_owned());
        }
        let exe = std::env::consts::EXE_SUFFIX;
        let bin = root.join("bin");
        let rustc = bin.join(format!("rustc{exe}"));
        let backend = root.join("lib").join(pinned::BACKEND_FILE);
        for file in [&rustc, &bin.join(format!("cargo{exe}")), &backend] {
            if !file.is_file() {
                let name = file.strip_prefix(root).unwrap_or(file);
                return Err(format!("it has no {}", name.display()));
            }
        }
        // What is being installed has the same name each time, and often the same time stamp.
        let staged = matches!(origin, Origin::Archive | Origin::Source);
        let version = if staged {
            ask_version(&rustc)
        } else {
            version_of(&rustc)
        };
        let Some(rustc_version) = version else {
            return Err("its bin/rustc does not run on this machine, or prints nothing".to_owned());
        };
        let rust_gpu_version = rust_gpu_in(&rustc_version).unwrap_or("unknown").to_owned();
        if rust_gpu_version != "unknown" && rust_gpu_version != pinned::RUST_GPU_VERSION {
            return Err(format!(
                "its rust-gpu is {rust_gpu_version}; this Hankel works with {}",
                pinned::RUST_GPU_VERSION
            ));
        }
        Ok(Self {
            origin,
            root: root.to_owned(),
            backend,
            bin: Some(bin),
            channel: None,
            rustc_version,
            rust_gpu_version,
        })
    }

    /// Compiles and runs a program for the host with it: proof that its standard library,
    /// its linker and its sysroot fit together. Takes less than a second. Shaders are not
    /// tried, since their first build takes half a minute.
    ///
    /// `folder` receives what is compiled; it must exist.
    pub fn self_test(&self, folder: &Path) -> Result<()> {
        use crate::error::During;
        let source = folder.join("self_test.rs");
        let program = folder.join(format!("self_test{}", std::env::consts::EXE_SUFFIX));
        let text = "fn main() { assert_eq!(\"4 5\".split(' ').count(), 2); }\n";
        std::fs::write(&source, text).during("write", &source)?;
        let rustc = self
            .root
            .join(format!("bin/rustc{}", std::env::consts::EXE_SUFFIX));
        let mut compile = Command::new(rustc);
        compile
            .args(["--edition=2021", "-o"])
            .arg(&program)
            .arg(&source);
        let log = folder.join("self_test.log");
        process::run(
            &mut compile,
            "compiling a program for the host",
            &log,
            |_| {},
        )?;
        process::run(
            &mut Command::new(&program),
            "running that program",
            &log,
            |_| {},
        )
    }

    pub(crate) fn not_at(path: &Path, why: String) -> Error {
        Error::NotAToolchain {
            path: path.to_owned(),
            why,
        }
    }
}

/// The `x.y.z` after `rust-gpu ` in a version line.
fn rust_gpu_in(version: &str) -> Option<&str> {
    let (_, rest) = version.split_once("rust-gpu ")?;
    let end = rest
        .find(|c: char| !c.is_ascii_digit() && c != '.')
        .unwrap_or(rest.len());
    (end > 0).then(|| &rest[..end])
}

fn ask_version(rustc: &Path) -> Option<String> {
    process::ask(Command::new(rustc).arg("--version"))
}

/// A program's file and its time stamp, and what it said.
type Versions = Mutex<HashMap<(PathBuf, SystemTime), String>>;

/// What `rustc --version` prints. Asked once per process and file.
pub(crate) fn version_of(rustc: &Path) -> Option<String> {
    static KNOWN: OnceLock<Versions> = OnceLock::new();
    let modified = std::fs::metadata(rustc)
        .and_then(|data| data.modified())
        .ok()?;
    let key = (rustc.to_owned(), modified);
    let known = KNOWN.get_or_init(Versions::default);
    if let Ok(known) = known.lock()
        && let Some(version) = known.get(&key)
    {
        return Some(version.clone());
    }
    let version = ask_version(rustc)?;
    if let Ok(mut known) = known.lock() {
        known.insert(key, version.clone());
    }
    Some(version)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_version_line_names_rust_gpu() {
        let line = "rustc 1.98.1-nightly (rust-gpu 0.10.0 and Cranelift, no LLVM)";
        assert_eq!(rust_gpu_in(line), Some("0.10.0"));
        assert_eq!(rust_gpu_in("rustc 1.95.0 (59807616e 2026-04-14)"), None);
        assert_eq!(rust_gpu_in("rust-gpu next"), None);
    }
}
