//! Builds rust-gpu's compiler from source, without rustup, without LLVM.
//!
//! rust-gpu's backend is a plug-in of rustc: it needs rustc's own crates, of one version,
//! compiled by the very compiler that loads it. rustup has them as the component
//! `rustc-dev`. Without rustup, the same crates are in Debian's `rust-src` package, and
//! everything that they depend on is on crates.io. What makes a usual build of rustc
//! long is LLVM; nothing here needs it, since SPIR-V comes from the plug-in, and the few
//! programs that run on the host during a shader build (build scripts, proc macros) can
//! come from Cranelift. So both backends are linked with rustc's front end into a single
//! static program, by cargo, with a stock compiler of the version before.
//!
//! The steps and what each leaves in the work folder:
//!
//! | step | leaves | done again when |
//! | --- | --- | --- |
//! | `rust-gpu` | `backend/` | rust-gpu's version changes |
//! | `tree` | `rust-src.deb`; `tree/`, patched | any of the edits or driver files change |
//! | `crates` | crates in cargo's own cache | always: cargo knows what it has |
//! | `compiler` | `target/`, which cargo resumes | the tree or the bootstrap changes |
//! | `std` | `std/` | the compiler changes |
//! | `sysroot` | the finished toolchain | |
//!
//! A step is complete when its file in `stamps/` holds a checksum of what went into it.

mod bootstrap;
mod debian;
mod patch;

use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::process::Command;

use bootstrap::Bootstrap;

use crate::cache::{self, Staging};
use crate::error::{During, Error, Result};
use crate::options::Options;
use crate::pinned;
use crate::process;
use crate::progress::Progress;
use crate::sha256;

const DRIVER_MAIN: &str = include_str!("../../driver/main.rs");
const DRIVER_MANIFEST: &str = include_str!("../../driver/driver.toml");
const WORKSPACE_MANIFEST: &str = include_str!("../../driver/workspace.toml");
const LOCK_FILE: &str = include_str!("../../driver/Cargo.lock");
const RUSTC_FOR_STD: &str = include_str!("../../driver/rustc-for-std.sh");

/// Disk space that the build takes at its fullest, with some to spare.
const SPACE: u64 = 3_200_000_000;

const STEPS: usize = 6;

/// Everything but the bootstrap compiler that the result depends on, as a checksum.
pub(crate) fn recipe() -> String {
    sha256::of_bytes([
        pinned::RUST_SRC_SHA256.as_bytes(),
        pinned::RUST_GPU_VERSION.as_bytes(),
        include_bytes!("mod.rs"),
        include_bytes!("patch.rs"),
        DRIVER_MAIN.as_bytes(),
        DRIVER_MANIFEST.as_bytes(),
        WORKSPACE_MANIFEST.as_bytes(),
        LOCK_FILE.as_bytes(),
        RUSTC_FOR_STD.as_bytes(),
    ])
}

/// Says whether the build can start here: platform and programs, not network and space.
/// The answer is the bootstrap compiler's version.
pub(crate) fn check(options: &Options) -> Result<String> {
    bootstrap::check(options).map(|found| found.version)
}

/// Builds in `work`, resuming what an earlier run left there, and fills `staging`.
pub(crate) fn build(
    options: &Options,
    work: &Path,
    staging: &Staging<'_>,
    progress: &mut dyn Progress,
) -> Result<()> {
    let bootstrap = bootstrap::check(options)?;
    if !work.join("target").exists() {
        cache::check_space(options, work, SPACE)?;
    }
    let stamps = work.join("stamps");
    fs::create_dir_all(&stamps).during("create", &stamps)?;
    let mut build = Build {
        options,
        work,
        bootstrap,
        progress,
    };
    build.backend()?;
    build.tree()?;
    build.crates()?;
    build.compiler()?;
    build.std()?;
    build.sysroot(staging.path())
}

struct Build<'a> {
    options: &'a Options,
    work: &'a Path,
    bootstrap: Bootstrap,
    progress: &'a mut dyn Progress,
}

impl Build<'_> {
    fn tree_folder(&self) -> PathBuf {
        self.work.join("tree")
    }

    fn compiler_file(&self) -> PathBuf {
        self.work.join("target/release/rustc")
    }

    fn std_folder(&self) -> PathBuf {
        self.work
            .join("std")
            .join(pinned::host())
            .join("release/deps")
    }

    fn log(&self, step: &str) -> PathBuf {
        self.work.join(format!("{step}.log"))
    }

    /// Announces a step; says whether an earlier run completed it with the same inputs.
    /// If not, the stamp goes: from now on what the step leaves is incomplete.
    fn begin(&mut self, index: usize, name: &str, inputs: &str) -> Result<bool> {
        self.progress.step(name, index, STEPS);
        let stamp = self.work.join("stamps").join(name);
        match fs::read_to_string(&stamp) {
            Ok(text) if text == inputs => {
                self.progress.line("done by an earlier run");
                return Ok(true);
            }
            Ok(_) => fs::remove_file(&stamp).during("remove", &stamp)?,
            Err(error) if error.kind() == ErrorKind::NotFound => {}
            Err(error) => return Err(error).during("read", &stamp),
        }
        Ok(false)
    }

    fn complete(&self, name: &str, inputs: &str) -> Result<()> {
        let stamp = self.work.join("stamps").join(name);
        fs::write(&stamp, inputs).during("write", &stamp)
    }

    /// The bootstrap's cargo, shielded from settings that are meant for other builds.
    fn cargo(&self, folder: &Path) -> Command {
        let mut cargo = Command::new(&self.bootstrap.cargo);
        for (name, _) in std::env::vars_os() {
            let text = name.to_string_lossy();
            let ours = [
                "CARGO_BUILD_",
                "CARGO_PROFILE_",
                "CARGO_TARGET_",
                "CARGO_ENCODED_",
            ]
            .iter()
            .any(|prefix| text.starts_with(prefix))
                || [
                    "RUSTFLAGS",
                    "RUSTC_WRAPPER",
                    "RUSTC_WORKSPACE_WRAPPER",
                    "RUSTUP_TOOLCHAIN",
                ]
                .contains(&&*text);
            if ours {
                cargo.env_remove(&name);
            }
        }
        cargo
            .current_dir(folder)
            .env("RUSTC", &self.bootstrap.rustc)
            .env("CARGO_TERM_COLOR", "never")
            .env("CARGO_TERM_PROGRESS_WHEN", "never")
            .env("CARGO_INCREMENTAL", "0");
        cargo
    }

    /// Runs cargo where it needs the network, and says so if that is why it fails.
    fn cargo_online(&mut self, mut cargo: Command, step: &str, what: &str) -> Result<()> {
        let log = self.log(step);
        let progress = &mut *self.progress;
        let mut downloaded = 0;
        process::run(&mut cargo, what, &log, |line| {
            if line.trim_start().starts_with("Downloaded ") {
                downloaded += 1;
                progress.advance(downloaded, None);
            }
        })
        .map_err(|error| match error {
            Error::Command { tail, .. } => Error::Network {
                what: what.to_owned(),
                help: "connect to crates.io or configure a mirror of it for cargo; run it \
                       again: what is there already is kept"
                    .to_owned(),
                tail,
            },
            other => other,
        })
    }

    /// rust-gpu's backend, as cargo unpacks it.
    fn backend(&mut self) -> Result<()> {
        let inputs = pinned::RUST_GPU_VERSION;
        let copy = self.work.join("backend");
        if self.begin(1, "rust-gpu", inputs)? && copy.is_dir() {
            return Ok(());
        }
        let fetch = self.work.join("fetch");
        let root = fetch.join("lib.rs");
        fs::create_dir_all(&fetch).during("create", &fetch)?;
        fs::write(&root, "").during("write", &root)?;
        let manifest = fetch.join("Cargo.toml");
        let text = format!(
            "[package]\nname = \"fetch\"\nversion = \"0.0.0\"\nedition = \"2024\"\n\
             [lib]\npath = \"lib.rs\"\n\
             [dependencies]\nrustc_codegen_spirv = \"={inputs}\"\n[workspace]\n"
        );
        fs::write(&manifest, text).during("write", &manifest)?;
        let mut cargo = self.cargo(&fetch);
        cargo.args(["fetch", "--target", pinned::host()]);
        self.cargo_online(cargo, "rust-gpu", "rust-gpu's backend")?;
        let mut cargo = self.cargo(&fetch);
        cargo.args(["metadata", "--format-version=1", "--offline"]);
        cargo.args(["--filter-platform", pinned::host()]);
        let unpacked = process::output(&mut cargo).and_then(|text| backend_folder(&text));
        let Some(unpacked) = unpacked else {
            return Err(Error::Patch {
                path: manifest,
                why: "cargo does not say where it keeps rustc_codegen_spirv".to_owned(),
            });
        };
        if copy.exists() {
            fs::remove_dir_all(&copy).during("remove", &copy)?;
        }
        copy_tree(
            &unpacked,
            &copy,
            &[".cargo-ok", ".cargo_vcs_info.json", "Cargo.lock"],
        )?;
        self.complete("rust-gpu", inputs)
    }

    /// rustc's source with the backend in it, edited. Always made from scratch, since an
    /// edit cannot be applied twice.
    fn tree(&mut self) -> Result<()> {
        let inputs = recipe();
        let tree = self.tree_folder();
        if self.begin(2, "tree", &inputs)? && tree.is_dir() {
            return Ok(());
        }
        // What was compiled from another tree: cargo goes by time stamps, and a file that
        // is no longer patched has an old one.
        for compiled in ["target", "std"].map(|name| self.work.join(name)) {
            if compiled.exists() {
                fs::remove_dir_all(&compiled).during("remove", &compiled)?;
            }
        }
        let package = debian::package(self.options, self.work, self.progress)?;
        debian::unpack(&package, self.work, &tree)?;
        copy_tree(
            &self.work.join("backend"),
            &tree.join("compiler/rustc_codegen_spirv"),
            &[],
        )?;
        patch::apply(&tree)?;
        self.complete("tree", &inputs)
    }

    fn crates(&mut self) -> Result<()> {
        // Cargo's cache is not ours: it is asked each time, and answers at once.
        self.progress.step("crates", 3, STEPS);
        let mut cargo = self.cargo(&self.tree_folder());
        cargo.args(["fetch", "--locked", "--target", pinned::host()]);
        self.cargo_online(cargo, "crates", "the crates that rustc depends on")
    }

    /// Paths of this machine have no business in a file that is given to others.
    fn neutral_paths(&self) -> Vec<String> {
        let mut flags = vec![format!(
            "--remap-path-prefix={}=/rust-gpu",
            self.work.display()
        )];
        let home = std::env::var_os("CARGO_HOME").map(PathBuf::from);
        let home = home.or_else(|| Some(std::env::home_dir()?.join(".cargo")));
        if let Some(home) = home {
            flags.push(format!("--remap-path-prefix={}=/cargo", home.display()));
        }
        flags
    }

    fn compiler_inputs(&self) -> String {
        sha256::of_bytes([recipe().as_bytes(), self.bootstrap.version.as_bytes()])
    }

    fn compiler(&mut self) -> Result<()> {
        let inputs = self.compiler_inputs();
        if self.begin(4, "compiler", &inputs)? && self.compiler_file().is_file() {
            return Ok(());
        }
        let release = format!("{}-nightly", pinned::RUST_VERSION);
        let version = format!(
            "{release} (rust-gpu {} and Cranelift, no LLVM; source: Debian {})",
            pinned::RUST_GPU_VERSION,
            pinned::DEBIAN_VERSION
        );
        let mut flags: Vec<String> = [
            "--cfg=bootstrap",
            "--cap-lints=allow",
            "-Csymbol-mangling-version=v0",
            "-Zunstable-options",
            // Programs that rustc prints to may close the pipe: end quietly.
            "-Zon-broken-pipe=kill",
        ]
        .map(str::to_owned)
        .into();
        flags.extend(self.neutral_paths());
        let target = self.work.join("target");
        let resumed = target.join("release").exists();
        let mut cargo = self.cargo(&self.tree_folder());
        cargo
            .args([
                "build",
                "--release",
                "--locked",
                "--offline",
                "-p",
                "rustc_spirv_driver",
            ])
            .env("CARGO_TARGET_DIR", &target)
            .env("CARGO_ENCODED_RUSTFLAGS", flags.join("\x1f"))
            // rustc's crates read these while they are compiled; its own build system
            // normally sets them.
            .env("RUSTC_BOOTSTRAP", "1")
            .env("CFG_RELEASE", &release)
            .env("CFG_RELEASE_NUM", pinned::RUST_VERSION)
            .env("CFG_RELEASE_CHANNEL", "nightly")
            .env("CFG_VERSION", &version)
            .env("CFG_COMPILER_HOST_TRIPLE", pinned::host())
            .env("CFG_LIBDIR_RELATIVE", "lib")
            .env("RUSTC_INSTALL_BINDIR", "bin")
            .env(
                "DOC_RUST_LANG_ORG_CHANNEL",
                "https://doc.rust-lang.org/nightly",
            )
            .env("REAL_LIBRARY_PATH_VAR", "LD_LIBRARY_PATH")
            // rust-gpu's build script wants the nightly's commit; this is its branch.
            .env("RUSTGPU_SKIP_TOOLCHAIN_CHECK", "1");
        let total = (!resumed).then_some(pinned::DRIVER_CRATES);
        self.compile(cargo, "compiler", "building the compiler", total)?;
        self.complete("compiler", &inputs)
    }

    /// Runs a cargo build and counts the crates that it starts.
    fn compile(
        &mut self,
        mut cargo: Command,
        step: &str,
        what: &str,
        total: Option<u64>,
    ) -> Result<()> {
        let log = self.log(step);
        let progress = &mut *self.progress;
        let mut started = 0;
        process::run(&mut cargo, what, &log, |line| {
            if line.trim_start().starts_with("Compiling ") {
                started += 1;
                progress.advance(started, total);
            }
        })
    }

    /// The host's standard library, by the new compiler. Its dependencies are vendored
    /// in the tree, so there is nothing to download.
    fn std(&mut self) -> Result<()> {
        let inputs = self.compiler_inputs();
        if self.begin(5, "std", &inputs)? && self.std_folder().is_dir() {
            return Ok(());
        }
        let target = self.work.join("std");
        if target.exists() {
            fs::remove_dir_all(&target).during("remove", &target)?;
        }
        let script = self.work.join("rustc-for-std.sh");
        fs::write(&script, RUSTC_FOR_STD).during("write", &script)?;
        make_executable(&script)?;
        let mut flags: Vec<String> = [
            "-Zforce-unstable-if-unmarked",
            "-Zinline-mir",
            // It must not look for the very library that is being built.
            "--sysroot=/dev/null",
            "--cap-lints=allow",
        ]
        .map(str::to_owned)
        .into();
        flags.extend(self.neutral_paths());
        let mut cargo = self.cargo(&self.tree_folder().join("library"));
        cargo
            .args(["build", "--release", "--manifest-path=sysroot/Cargo.toml"])
            .args([
                "--target",
                pinned::host(),
                "--features=backtrace,panic-unwind",
            ])
            .env("RUSTC", &script)
            .env("HANKEL_BOOTSTRAP_RUSTC", &self.bootstrap.rustc)
            .env("HANKEL_NEW_RUSTC", self.compiler_file())
            .env("RUSTC_BOOTSTRAP", "1")
            .env("CARGO_TARGET_DIR", &target)
            .env("CARGO_ENCODED_RUSTFLAGS", flags.join("\x1f"))
            .env("CARGO_PROFILE_RELEASE_DEBUG", "0")
            .env("CARGO_PROFILE_RELEASE_DEBUG_ASSERTIONS", "false")
            .env("__CARGO_DEFAULT_LIB_METADATA", "hankel");
        self.compile(cargo, "std", "building the standard library", None)?;
        self.complete("std", &inputs)
    }

    /// Puts everything where rustc, cargo and spirv-builder look for it.
    fn sysroot(&mut self, root: &Path) -> Result<()> {
        self.progress.step("sysroot", STEPS, STEPS);
        let programs = root.join("bin");
        let libraries = root.join("lib/rustlib").join(pinned::host()).join("lib");
        for folder in [&programs, &libraries] {
            fs::create_dir_all(folder).during("create", folder)?;
        }
        let rustc = programs.join("rustc");
        copy_file(&self.compiler_file(), &rustc)?;
        let mut strip = Command::new("strip");
        process::run(
            strip.arg(&rustc),
            "stripping the compiler",
            &self.log("strip"),
            |_| {},
        )?;
        copy_file(&self.bootstrap.cargo, &programs.join("cargo"))?;
        let placeholder = root.join("lib").join(pinned::BACKEND_FILE);
        let text = "rust-gpu's backend is linked into bin/rustc; this file only has to exist.\n";
        fs::write(&placeholder, text).during("write", &placeholder)?;
        // For -Zbuild-std. The vendored crates stay, the setting that would make every
        // build below this folder use them does not.
        let library = root.join("lib/rustlib/src/rust/library");
        copy_tree(&self.tree_folder().join("library"), &library, &[".cargo"])?;
        let built = self.std_folder();
        for entry in fs::read_dir(&built).during("read", &built)? {
            let path = entry.during("read", &built)?.path();
            if path.extension().is_some_and(|end| end == "rlib")
                && let Some(name) = path.file_name()
            {
                copy_file(&path, &libraries.join(name))?;
            }
        }
        Ok(())
    }
}

/// Where `cargo metadata` says that the backend's source is.
fn backend_folder(metadata: &str) -> Option<PathBuf> {
    let metadata: serde_json::Value = serde_json::from_str(metadata).ok()?;
    let mut packages = metadata["packages"].as_array()?.iter();
    let backend = packages.find(|package| package["name"] == "rustc_codegen_spirv")?;
    Path::new(backend["manifest_path"].as_str()?)
        .parent()
        .map(Path::to_owned)
}

fn copy_file(from: &Path, to: &Path) -> Result<()> {
    fs::copy(from, to).during("copy", from).map(drop)
}

/// Copies a folder, but not the entries of that name in it.
fn copy_tree(from: &Path, to: &Path, except: &[&str]) -> Result<()> {
    fs::create_dir_all(to).during("create", to)?;
    for entry in fs::read_dir(from).during("read", from)? {
        let entry = entry.during("read", from)?;
        let name = entry.file_name();
        if except.iter().any(|except| name == *except) {
            continue;
        }
        let (path, target) = (entry.path(), to.join(&name));
        if path.is_dir() {
            copy_tree(&path, &target, &[])?;
        } else {
            copy_file(&path, &target)?;
        }
    }
    Ok(())
}

#[cfg(unix)]
fn make_executable(file: &Path) -> Result<()> {
    use std::os::unix::fs::PermissionsExt;
    fs::set_permissions(file, fs::Permissions::from_mode(0o755)).during("make executable", file)
}

#[cfg(not(unix))]
fn make_executable(_: &Path) -> Result<()> {
    Ok(())
}
