//! rustup's nightly and the backend that cargo-gpu-install compiles for it: what most
//! users of rust-gpu have.

use std::env::consts::{DLL_PREFIX, DLL_SUFFIX, EXE_SUFFIX};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use hankel_system::process::which;

use crate::error::{During, Error, Result};
use crate::pinned::{self, COMPONENTS, NIGHTLY, RUST_GPU_VERSION};
use crate::process;
use crate::progress::Progress;
use crate::toolchain::{Origin, Toolchain, version_of};

/// What rustup and cargo-gpu-install keep, and where.
#[derive(Clone, Debug)]
pub(crate) struct Rustup {
    /// rustup's folder.
    home: PathBuf,
    /// cargo-gpu-install's folder for this version of the backend.
    backend: PathBuf,
}

impl Rustup {
    /// The usual places; `None` if the user has no home folder.
    pub(crate) fn usual() -> Option<Self> {
        let home = std::env::var_os("RUSTUP_HOME").filter(|home| !home.is_empty());
        let home = match home {
            Some(home) => PathBuf::from(home),
            None => std::env::home_dir()?.join(".rustup"),
        };
        // The crate's own naming: dots become underscores.
        let folder = RUST_GPU_VERSION.replace('.', "_");
        let backend = cargo_gpu_install::cache_dir()
            .ok()?
            .join("codegen")
            .join(folder);
        Some(Self { home, backend })
    }

    fn sysroot(&self) -> PathBuf {
        self.home
            .join("toolchains")
            .join(format!("{NIGHTLY}-{}", pinned::host()))
    }

    fn backend_file(&self) -> PathBuf {
        self.backend
            .join(format!("{DLL_PREFIX}rustc_codegen_spirv{DLL_SUFFIX}"))
    }

    /// Components of the nightly that are not installed.
    fn missing_components(&self) -> Vec<&'static str> {
        let list = self.sysroot().join("lib/rustlib/components");
        let list = fs::read_to_string(list).unwrap_or_default();
        COMPONENTS
            .into_iter()
            .filter(|name| {
                // `rust-src`, `rustc-dev-<host>`, `llvm-tools-preview-<host>`
                !list.lines().any(|line| {
                    line == *name
                        || line
                            .strip_prefix(name)
                            .is_some_and(|rest| rest.starts_with('-'))
                })
            })
            .collect()
    }

    /// What is not there yet, for people. Reads a few files, runs nothing.
    pub(crate) fn missing(&self) -> Vec<String> {
        let mut missing = Vec::new();
        if which(Path::new("rustup")).is_none() {
            missing.push("rustup in PATH".to_owned());
        }
        if !self
            .sysroot()
            .join(format!("bin/rustc{EXE_SUFFIX}"))
            .is_file()
        {
            missing.push(format!("rustup toolchain {NIGHTLY}"));
        } else {
            let components = self.missing_components();
            missing.extend(
                components
                    .iter()
                    .map(|name| format!("its component {name}")),
            );
        }
        if !self.backend_file().is_file() {
            missing.push(format!(
                "rust-gpu's backend {RUST_GPU_VERSION} compiled for it"
            ));
        }
        missing
    }

    /// The toolchain, if nothing is missing.
    pub(crate) fn find(&self) -> Option<Toolchain> {
        if !self.missing().is_empty() {
            return None;
        }
        let root = self.sysroot();
        let rustc_version = version_of(&root.join(format!("bin/rustc{EXE_SUFFIX}")))?;
        Some(Toolchain {
            origin: Origin::Rustup,
            backend: self.backend_file(),
            root,
            bin: None,
            channel: Some(NIGHTLY.to_owned()),
            rustc_version,
            rust_gpu_version: RUST_GPU_VERSION.to_owned(),
        })
    }

    /// Installs what is missing. `work` is an existing folder for logs and a throw-away
    /// crate.
    pub(crate) fn install(&self, work: &Path, progress: &mut dyn Progress) -> Result<Toolchain> {
        if which(Path::new("rustup")).is_none() {
            return Err(fail("rustup is not in PATH".to_owned()));
        }
        progress.step("rustup toolchain", 1, 2);
        self.install_nightly(work, progress)?;
        progress.step("rust-gpu's backend", 2, 2);
        progress.line("compiling it takes some minutes");
        let fresh = !self.backend.exists();
        if let Err(why) = compile_backend(work) {
            // Nothing half-made stays; what others put there does.
            if fresh && self.backend.exists() {
                fs::remove_dir_all(&self.backend).during("remove", &self.backend)?;
                for folder in self.backend.ancestors().skip(1).take(2) {
                    let _ = fs::remove_dir(folder);
                }
            }
            return Err(fail(why));
        }
        self.find().ok_or_else(|| {
            fail(format!(
                "cargo-gpu-install succeeded, but {} missing",
                self.missing().join(", ")
            ))
        })
    }

    fn install_nightly(&self, work: &Path, progress: &mut dyn Progress) -> Result<()> {
        if self.sysroot().is_dir() && self.missing_components().is_empty() {
            progress.line("installed already");
            return Ok(());
        }
        let toolchain = format!("{NIGHTLY}-{}", pinned::host());
        let mut rustup = Command::new("rustup");
        rustup
            .args([
                "toolchain",
                "install",
                &toolchain,
                "--profile=minimal",
                "--no-self-update",
            ])
            // cargo-gpu-install insists on clippy too.
            .args(
                COMPONENTS
                    .into_iter()
                    .chain(["clippy"])
                    .flat_map(|name| ["--component", name]),
            )
            .env_remove("RUST_BACKTRACE");
        let log = work.join("rustup.log");
        let what = format!("rustup toolchain install {NIGHTLY}");
        process::run(&mut rustup, &what, &log, |line| {
            if line.starts_with("info:") {
                progress.line(line);
            }
        })
        .map_err(|error| match error {
            Error::Command { tail, .. } => fail(format!("{what} failed:\n{tail}")),
            other => other,
        })
    }
}

fn fail(why: String) -> Error {
    let help = "with a network, run it again; without one, give an archive \
                (`hankel toolchain install --from FILE`) or build from source";
    Error::Rustup {
        why,
        help: help.to_owned(),
    }
}

/// Lets cargo-gpu-install compile the backend. It reads the version to install from the
/// crate that it is pointed at or from its settings; but it always wants a crate.
fn compile_backend(work: &Path) -> Result<(), String> {
    let folder = work.join("rustup-crate");
    let made = fs::create_dir_all(&folder)
        .and_then(|()| fs::write(folder.join("lib.rs"), ""))
        .and_then(|()| {
            let manifest = "[package]\nname = \"none\"\nversion = \"0.0.0\"\n\
                            edition = \"2024\"\n[lib]\npath = \"lib.rs\"\n[workspace]\n";
            fs::write(folder.join("Cargo.toml"), manifest)
        });
    let result = made
        .map_err(|error| format!("{}: {error}", folder.display()))
        .and_then(|()| {
            let mut install =
                cargo_gpu_install::install::Install::from_shader_crate(folder.clone());
            install.spirv_builder_version = Some(RUST_GPU_VERSION.to_owned());
            install.auto_install_rust_toolchain = true;
            install
                .run()
                .map(drop)
                .map_err(|error| format!("{error:#}"))
        });
    let _ = fs::remove_dir_all(&folder);
    result
}

#[cfg(test)]
mod tests {
    use super::*;

    fn write(path: &Path, text: &str) {
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, text).unwrap();
    }

    #[test]
    fn names_what_is_missing_until_nothing_is() {
        let folder = crate::tests::scratch("rustup");
        let rustup = Rustup {
            home: folder.join("home"),
            backend: folder.join("0_10_0"),
        };
        let missing = |rustup: &Rustup| {
            let mut missing = rustup.missing();
            missing.retain(|what| what != "rustup in PATH");
            missing.join("; ")
        };
        let text = missing(&rustup);
        assert!(text.contains(NIGHTLY) && text.contains("backend"), "{text}");

        let root = rustup.sysroot();
        write(&root.join(format!("bin/rustc{EXE_SUFFIX}")), "");
        write(
            &root.join("lib/rustlib/components"),
            "rust-src\nrustc-x86_64-unknown-linux-gnu\n",
        );
        let text = missing(&rustup);
        assert!(
            text.contains("rustc-dev") && text.contains("llvm-tools"),
            "{text}"
        );
        assert!(!text.contains("rust-src"), "{text}");

        let list = "rust-src\nrustc-dev-some-host\nllvm-tools-preview-some-host\n";
        write(&root.join("lib/rustlib/components"), list);
        write(&rustup.backend_file(), "");
        assert_eq!(missing(&rustup), "");
        fs::remove_dir_all(folder).unwrap();
    }
}
