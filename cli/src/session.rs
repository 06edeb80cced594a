//! Which kernels a command works on, and where their SPIR-V comes from.
//!
//! The built-in kernels are linked into this program, and their SPIR-V is embedded in it. Inside
//! a checkout whose kernels were edited since, or for anybody's crate, the crate is built as a
//! plug-in that describes its kernels, and its SPIR-V is made with rust-gpu's compiler and kept
//! under cargo's target folder for as long as the sources' hash holds. SPIR-V of other sources is
//! never used. Native code is compiled only for the kernels that a command runs.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::str::FromStr;
use std::time::Duration;

use hankel_codegen::build::{Modules, Request, finish_all};
use hankel_codegen::bundle::Bundle;
use hankel_codegen::compile::{Compiler, compile};
use hankel_codegen::source_hash::{Sources, hash};
use hankel_codegen::spirv::words;
use hankel_codegen::translate::Options;
use hankel_codegen::{Error, Language};
use hankel_dsl::native::describe::Kernel;
use hankel_dsl::native::lanes;
use hankel_host::crates::{KernelCrate, Native};
use hankel_host::worker::Worker;
use hankel_toolchain::pinned::RUST_GPU_VERSION;

use crate::args::Generate;
use crate::failure::{Failure, Result};
use crate::progress::Progress;

/// The built-in kernel crate within a checkout.
const BUILT_IN: &str = "kernels/shadows/Cargo.toml";

/// The committed SPIR-V within a checkout.
const COMMITTED: &str = "snapshots/spirv";

/// The hidden command that runs kernels of another crate, see [`hankel_host::worker`].
pub const WORKER: &str = "kernel-worker";

/// How long a crate may take to describe its kernels.
const DESCRIBING: Duration = Duration::from_secs(60);

/// A kernel crate.
pub struct Session {
    /// What its kernels are. Only a crate that is linked into this program has native code here;
    /// see [`Session::native`].
    pub krate: KernelCrate,
    /// Whether it is.
    linked: bool,
    /// Hash of the sources.
    source_sha256: String,
    /// The sources on disk; `None` for the built-in kernels outside of a checkout.
    sources: Option<(PathBuf, Sources)>,
    quiet: bool,
}

impl Session {
    /// The built-in crate as it was linked into this program, whatever has become of its sources.
    /// Nothing is ever built for it.
    pub fn linked(quiet: bool) -> Self {
        Self {
            krate: built_in(),
            linked: true,
            source_sha256: hankel_embedded::SOURCE_SHA256.into(),
            sources: None,
            quiet,
        }
    }

    /// Opens the crate at `manifest`, or else the built-in one.
    pub fn open(manifest: Option<&Path>, quiet: bool) -> Result<Self> {
        let manifest = match manifest {
            Some(path) if path.is_dir() => Some(path.join("Cargo.toml")),
            Some(path) => Some(path.to_owned()),
            None => checkout().map(|root| root.join(BUILT_IN)),
        };
        let Some(manifest) = manifest else {
            return Ok(Self::linked(quiet));
        };
        if !manifest.is_file() {
            return Err(Failure::input(
                format!("{}: there is no such file", manifest.display()),
                "Give the path of a kernel crate's Cargo.toml.",
            ));
        }
        let mut sources = hash(&manifest).map_err(Error::from)?;
        let same = sources.sha256 == hankel_embedded::SOURCE_SHA256
            && sources.name == hankel_embedded::CRATE_NAME;
        let krate = if same {
            built_in()
        } else {
            let progress = Progress::new(quiet);
            progress.begin(&format!("Reading the kernels of {}", sources.name));
            let krate = KernelCrate::load(
                &manifest,
                Native::Descriptions,
                &worker(DESCRIBING)?,
                &mut |line| progress.detail(line),
            )?;
            // cargo may have written the lock file just now, which is part of the sources.
            sources = hash(&manifest).map_err(Error::from)?;
            krate
        };
        Ok(Self {
            krate,
            linked: same,
            source_sha256: sources.sha256.clone(),
            sources: Some((manifest, sources)),
            quiet,
        })
    }

    /// The crate with the native code of the entry points called `names`. What is not linked into
    /// this program runs in processes of its own, a call no longer than `limit`.
    pub fn native<'a>(
        &self,
        names: impl IntoIterator<Item = &'a String>,
        limit: Duration,
    ) -> Result<KernelCrate> {
        let Some((manifest, _)) = self.sources.as_ref().filter(|_| !self.linked) else {
            return Ok(self.krate.clone());
        };
        let names: Vec<String> = names.into_iter().cloned().collect();
        let native = if names.len() == self.krate.entries.len() {
            Native::All
        } else {
            Native::Of(&names)
        };
        let progress = Progress::new(self.quiet);
        progress.begin(&format!(
            "Building {} kernels of {} for this machine",
            names.len(),
            self.krate.name
        ));
        let worker = worker(limit)?;
        let mut said = |line: &str| progress.detail(line);
        Ok(KernelCrate::load(manifest, native, &worker, &mut said)?)
    }

    /// Descriptions of all entry points.
    pub fn kernels(&self) -> Vec<Kernel> {
        self.krate
            .entries
            .iter()
            .map(|e| e.kernel.clone())
            .collect()
    }

    /// A request for what `args` ask for.
    pub fn request(&self, args: &Generate) -> Result<Request> {
        let targets = args
            .targets
            .iter()
            .map(|t| Language::from_str(t))
            .collect::<std::result::Result<_, _>>()?;
        let options = Options {
            bounds_checks: args.bounds_checks.parse()?,
            shader_model: args.shader_model.parse()?,
            msl_version: args.msl_version.parse()?,
            constants: constants(&args.set)?,
        };
        Ok(self.request_for(args.kernels.clone(), targets, options))
    }

    /// A request for some kernels (none: all) in some languages (none: all).
    pub fn request_for(
        &self,
        filter: Vec<String>,
        targets: Vec<Language>,
        options: Options,
    ) -> Request {
        Request {
            crate_name: self.krate.name.clone(),
            kernels: self.kernels(),
            filter,
            targets,
            options,
            source_sha256: self.source_sha256.clone(),
            rust_gpu: RUST_GPU_VERSION.into(),
        }
    }

    /// Final SPIR-V of all entry points.
    pub fn modules(&self) -> std::result::Result<Modules, Failure> {
        Ok(Modules::Final(self.bundle()?.modules))
    }

    /// SPIR-V of one entry point.
    pub fn words(&self, kernel: &str) -> Result<Vec<u32>> {
        let bundle = self.bundle()?;
        let bytes = bundle
            .modules
            .get(kernel)
            .ok_or_else(|| Failure::machine(format!("`{kernel}` has no SPIR-V"), None))?;
        Ok(words(bytes, kernel).map_err(Error::from)?)
    }

    /// SPIR-V of every entry point.
    pub fn all_words(&self) -> Result<BTreeMap<String, Vec<u32>>> {
        let bundle = self.bundle()?;
        let all: std::result::Result<_, _> = bundle
            .modules
            .iter()
            .map(|(name, bytes)| Ok((name.clone(), words(bytes, name)?)))
            .collect();
        Ok(all.map_err(|failure: hankel_codegen::Failure| Error::from(failure))?)
    }

    fn bundle(&self) -> Result<Bundle> {
        let wanted = self.source_sha256.as_str();
        if wanted == hankel_embedded::SOURCE_SHA256 && !hankel_embedded::FILES.is_empty() {
            let embedded = Bundle::from_files(hankel_embedded::FILES)?;
            if embedded.check_current(wanted).is_ok() {
                return Ok(embedded);
            }
        }
        let Some((manifest, sources)) = &self.sources else {
            return Err(Failure::machine(
                "this program was built without the SPIR-V of its own kernels",
                Some(
                    "Run `cargo xtask spirv` in its repository, and build the program again."
                        .into(),
                ),
            ));
        };
        let target = target_folder(manifest)?;
        let kept = target.join("hankel/final").join(&sources.name);
        let committed = checkout().map(|root| root.join(COMMITTED));
        for folder in committed.iter().chain([&kept]) {
            if let Ok(bundle) = Bundle::read(folder)
                && bundle.origin.crate_name == sources.name
                && bundle.check_current(wanted).is_ok()
            {
                return Ok(bundle);
            }
        }
        let raw = self.compile(manifest, &target)?;
        let kernels = self.kernels();
        let bundle = Bundle::new(sources, RUST_GPU_VERSION, finish_all(&raw, &kernels)?);
        bundle.write(&kept)?;
        Ok(bundle)
    }

    /// Raw SPIR-V from rust-gpu.
    fn compile(&self, manifest: &Path, target: &Path) -> Result<BTreeMap<String, Vec<u8>>> {
        let mut progress = Progress::new(self.quiet);
        let options = hankel_toolchain::Options::from_env();
        let toolchain = hankel_toolchain::ensure(&options, &mut progress).map_err(|error| {
            let why = match error {
                hankel_toolchain::Error::NotInstalled { .. } => String::new(),
                other => format!(": {other}"),
            };
            Failure::machine(
                format!(
                    "{} has no SPIR-V that belongs to its present sources, and there is no rust-gpu compiler to make it{why}",
                    self.krate.name
                ),
                Some("`hankel toolchain install` installs one; `hankel toolchain status` says what it takes.".into()),
            )
        })?;
        let compiler = Compiler {
            backend: toolchain.backend,
            bin: toolchain.bin,
            channel: toolchain.channel,
        };
        progress.begin(&format!(
            "Compiling {} to SPIR-V (half a minute the first time, then about a second)",
            self.krate.name
        ));
        let names: Vec<&str> = self
            .krate
            .entries
            .iter()
            .map(|e| e.kernel.name.as_str())
            .collect();
        // Called from another thread: only the text is handed over.
        let line = |line: &str| progress.detail(line);
        Ok(compile(manifest, &compiler, target, &names, &mut { line })?)
    }
}

/// This program, to be started again for the kernels of other crates.
fn worker(limit: Duration) -> Result<Worker> {
    let program = std::env::current_exe()
        .map_err(|e| Failure::machine(format!("this program does not find itself: {e}"), None))?;
    Ok(Worker {
        program,
        arguments: vec![WORKER.into()],
        limit,
    })
}

/// The kernels that are linked into this program. They are its own code, and every loop of them
/// ends: they need no process of their own.
fn built_in() -> KernelCrate {
    KernelCrate::from_entries(hankel_embedded::CRATE_NAME, hankel_shadows::entries())
}

/// The checkout whose kernels are built without being named: the one that this program was built
/// from, if the present folder lies in it. Code of any other folder is somebody else's, and runs
/// only by `--manifest-path`.
fn checkout() -> Option<PathBuf> {
    let here = std::env::current_dir().ok()?.canonicalize().ok()?;
    own_checkout().filter(|root| here.starts_with(root))
}

/// The checkout that this program was built from, if it is still there and belongs to this user.
pub fn own_checkout() -> Option<PathBuf> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent()?;
    let root = root.canonicalize().ok()?;
    let kernels = root.join(BUILT_IN);
    let ours = is_ours(&root) && is_ours(kernels.parent()?) && is_ours(&kernels);
    ours.then_some(root)
}

/// Whether a file or folder belongs to this user or the administrator, and not everybody may
/// write it.
#[cfg(unix)]
fn is_ours(path: &Path) -> bool {
    use std::os::unix::fs::MetadataExt;
    let owners = [rustix::process::geteuid().as_raw(), 0];
    std::fs::metadata(path).is_ok_and(|m| owners.contains(&m.uid()) && m.mode() & 0o002 == 0)
}

#[cfg(not(unix))]
fn is_ours(path: &Path) -> bool {
    path.exists()
}

/// cargo's target folder for a crate.
fn target_folder(manifest: &Path) -> Result<PathBuf> {
    let fail = |problem: String| Failure::machine(problem, None);
    let output = Command::new("cargo")
        .args([
            "metadata",
            "--no-deps",
            "--format-version",
            "1",
            "--manifest-path",
        ])
        .arg(manifest)
        .output()
        .map_err(|e| fail(format!("cannot run `cargo`: {e}")))?;
    if !output.status.success() {
        let text = String::from_utf8_lossy(&output.stderr);
        return Err(fail(format!("{}: {}", manifest.display(), text.trim())));
    }
    serde_json::from_slice::<serde_json::Value>(&output.stdout)
        .ok()
        .and_then(|v| v.get("target_directory")?.as_str().map(PathBuf::from))
        .ok_or_else(|| fail("`cargo metadata` names no target folder".into()))
}

/// `CONSTANT=VALUE` pairs.
fn constants(pairs: &[String]) -> Result<BTreeMap<String, u32>> {
    let mut constants = BTreeMap::new();
    for pair in pairs {
        let bad = |problem: String| {
            Failure::input(
                format!("--set {pair}: {problem}"),
                "Write --set NAME=NUMBER.",
            )
        };
        let Some((name, value)) = pair.split_once('=') else {
            return Err(bad("there is no `=`".into()));
        };
        let (name, value) = (name.trim(), value.trim());
        let number = value.parse::<u32>().map_err(|error| {
            use std::num::IntErrorKind as Kind;
            bad(match error.kind() {
                Kind::PosOverflow => format!("{value} is larger than {}", u32::MAX),
                _ => "a specialisation constant is set to a whole number, 0 or more".into(),
            })
        })?;
        if constants.insert(name.to_owned(), number).is_some() {
            return Err(bad(format!("`{name}` is set twice")));
        }
    }
    Ok(constants)
}

/// Refuses a name of an instruction set that the lanes would pass over.
pub fn check_lanes() -> Result<()> {
    const VARIABLE: &str = "HANKEL_SIMD";
    let Some(name) = std::env::var_os(VARIABLE).filter(|name| !name.is_empty()) else {
        return Ok(());
    };
    let levels = lanes::levels();
    let mut known: Vec<&str> = levels.iter().map(|(name, _)| *name).collect();
    known.push(lanes::SCALAR);
    if known.iter().any(|known| name == **known) {
        return Ok(());
    }
    Err(Failure::input(
        format!(
            "{VARIABLE}={}: this processor has no such instruction set",
            name.to_string_lossy()
        ),
        format!(
            "Set it to one of these, or not at all: {}.",
            known.join(", ")
        ),
    ))
}
