//! Which kernels a command works on, and where their SPIR-V comes from.
//!
//! The built-in kernels are linked into this program, and their SPIR-V is embedded in it. Inside
//! a checkout whose kernels were edited since, or for anybody's crate, the crate is built as a
//! plug-in that describes its kernels, and its SPIR-V is made with rust-gpu's compiler and kept
//! under cargo's target folder for as long as nothing that it was made from changes. SPIR-V of
//! other sources is never used. Native code is compiled only for the kernels that a command runs.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::time::Duration;

use hankel_codegen::build::{Generated, Modules, Request, generate, generate_kept};
use hankel_codegen::bundle::Bundle;
use hankel_codegen::compile::{Compiled, Compiler, Wanted, compile};
use hankel_codegen::diff;
use hankel_codegen::finished::{self, finish_all};
use hankel_codegen::inputs::Inputs;
use hankel_codegen::manifest::WriteOptions;
use hankel_codegen::placement::Placement;
use hankel_codegen::spirv::words;
use hankel_codegen::translate::Options;
use hankel_codegen::{Error, Language, translated};
use hankel_dsl::native::describe::{ConstantValue, Kernel};
use hankel_dsl::native::lanes;
use hankel_host::crates::{KernelCrate, KernelEntry, Native, Package};
use hankel_host::inputs::{self, Case};
use hankel_host::worker::Worker;
use hankel_toolchain::Toolchain;
use hankel_toolchain::pinned::RUST_GPU_VERSION;

use crate::ahead::Ahead;
use crate::args::{Generate, Placed};
use crate::failure::{Failure, Result};
use crate::print;
use crate::progress::Progress;

/// The built-in kernel crate within a checkout.
const BUILT_IN: &str = "kernels/shadows/Cargo.toml";

/// The committed SPIR-V within a checkout.
const COMMITTED: &str = "snapshots/spirv";

/// The file beside kept SPIR-V that tells the compiler that made it from others of its version.
const STAMP: &str = "compiler.stamp";

/// The hidden command that runs kernels of another crate, see [`hankel_host::worker`].
pub const WORKER: &str = "kernel-worker";

/// How long a crate may take to describe its kernels.
const DESCRIBING: Duration = Duration::from_secs(60);

/// SPIR-V by the names of entry points.
#[cfg(any(feature = "frames", feature = "measure"))]
pub type Words = BTreeMap<String, Vec<u32>>;

/// What an output follows from.
#[derive(Clone, Debug, Default)]
pub struct Followed {
    /// Files and folders, as absolute paths.
    pub paths: Vec<PathBuf>,
    /// Names of environment variables.
    pub environment: Vec<String>,
}

/// A kernel crate.
pub struct Session {
    /// What its kernels are. Only a crate that is linked into this program has native code here;
    /// see [`Session::native`].
    pub krate: KernelCrate,
    /// Whether it is.
    linked: bool,
    /// Its Cargo.toml; `None` for the built-in kernels outside of a checkout.
    manifest: Option<PathBuf>,
    /// Its SPIR-V, if that is being compiled.
    ahead: RefCell<Option<Ahead>>,
    quiet: bool,
}

impl Session {
    /// The built-in crate as it was linked into this program, whatever has become of its sources.
    /// Nothing is ever built for it.
    pub fn linked(quiet: bool) -> Self {
        Self {
            krate: built_in(),
            linked: true,
            manifest: None,
            ahead: RefCell::new(None),
            quiet,
        }
    }

    /// Opens the crate at `manifest`, or else the built-in one.
    pub fn open(manifest: Option<&Path>, quiet: bool) -> Result<Self> {
        Self::begin(manifest, None, quiet)
    }

    /// The same, to generate all kernels, or those that fit one of `filter`. They are compiled to SPIR-V while the crate
    /// is asked what they are, where it is known that both must be done.
    pub fn to_generate(manifest: Option<&Path>, filter: &[String], quiet: bool) -> Result<Self> {
        Self::begin(manifest, Some(filter), quiet)
    }

    fn begin(manifest: Option<&Path>, filter: Option<&[String]>, quiet: bool) -> Result<Self> {
        let manifest = match manifest {
            Some(path) if path.is_dir() => Some(path.join("Cargo.toml")),
            Some(path) => Some(path.to_owned()),
            None => checkout().map(|root| root.join(BUILT_IN)),
        };
        let Some(manifest) = manifest else {
            return Ok(Self::linked(quiet));
        };
        check_manifest(&manifest)?;
        let linked = is_linked(&manifest);
        let mut ahead = None;
        let krate = if linked {
            built_in()
        } else {
            let progress = Progress::new(quiet);
            progress.begin(&format!("Reading the kernels of {}", manifest.display()));
            if let Some(filter) = filter {
                let committed = checkout().map(|root| root.join(COMMITTED));
                ahead = Ahead::start(&manifest, filter, committed);
            }
            KernelCrate::load(
                &manifest,
                Native::Descriptions,
                &worker(DESCRIBING)?,
                &mut |line| progress.detail(line),
            )?
        };
        Ok(Self {
            krate,
            linked,
            manifest: Some(manifest),
            ahead: RefCell::new(ahead),
            quiet,
        })
    }

    /// The folder of the crate at `manifest`, or else of the built-in one; `None` for the built-in
    /// one outside of a checkout.
    pub fn sources(manifest: Option<&Path>) -> Option<PathBuf> {
        match manifest {
            Some(path) if path.is_dir() => Some(path.to_owned()),
            Some(path) => Some(folder_of(path).to_owned()),
            None => checkout().map(|root| folder_of(&root.join(BUILT_IN)).to_owned()),
        }
    }

    /// What the SPIR-V of a request was made from: files and folders as absolute paths, and names of environment
    /// variables; nothing for the built-in kernels outside of a checkout.
    pub fn inputs(&self, request: &Request) -> Result<Followed> {
        let Some(manifest) = &self.manifest else {
            return Ok(Followed::default());
        };
        let inputs = self.bundle(&chosen(request)?)?.origin.inputs;
        let paths = inputs.paths(folder_of(manifest));
        Ok(Followed {
            paths: paths.map_err(Error::from)?.into_iter().collect(),
            environment: inputs.environment.into_keys().collect(),
        })
    }

    /// The crate with the native code of the entry points called `names`. What is not linked into
    /// this program runs in processes of its own, a call no longer than `limit`.
    pub fn native<'a>(
        &self,
        names: impl IntoIterator<Item = &'a String>,
        limit: Duration,
    ) -> Result<KernelCrate> {
        let Some(manifest) = self.manifest.as_ref().filter(|_| !self.linked) else {
            return Ok(self.krate.clone());
        };
        let names: Vec<String> = names.into_iter().cloned().collect();
        let native = if names.len() == self.krate.entries.len() {
            Native::All
        } else {
            Native::Of(&names)
        };
        self.build(manifest, native, names.len(), limit)
    }

    /// The crate at `manifest` with the native code of the entry points called `names`, of whose
    /// integers none may overflow; the built-in kernels as they are linked into this program where
    /// no manifest is given.
    pub fn checked(
        &self,
        manifest: Option<&Path>,
        names: &[String],
        limit: Duration,
    ) -> Result<KernelCrate> {
        match &self.manifest {
            Some(found) if manifest.is_some() || !self.linked => {
                self.build(found, Native::Checked(names), names.len(), limit)
            }
            _ => Ok(self.krate.clone()),
        }
    }

    /// Builds native code of `count` kernels.
    fn build(
        &self,
        manifest: &Path,
        native: Native<'_>,
        count: usize,
        limit: Duration,
    ) -> Result<KernelCrate> {
        let progress = Progress::new(self.quiet);
        progress.begin(&format!(
            "Building {} kernels of {} for this machine",
            count, self.krate.name
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
            bounds_checks: parsed(args.bounds_checks.as_deref())?,
            shader_model: parsed(args.shader_model.as_deref())?,
            msl_version: parsed(args.msl_version.as_deref())?,
            constants: constants("--set ", &args.set)?,
            open_constants: args.open_constants,
            variants: variants(&args.variants)?,
            placement: placement(&args.placement)?,
        };
        Ok(self.request_for(args.kernels.clone(), targets, options))
    }

    /// A request for what `folder` should hold. Without options in `args`, those hold that it was built with.
    pub fn request_again(&self, args: &Generate, folder: &Path) -> Result<Request> {
        match diff::options(folder) {
            Ok(built) if args.first_option().is_none() => {
                let options = built.options()?;
                let WriteOptions {
                    kernels, targets, ..
                } = built;
                Ok(self.request_for(kernels, targets, options))
            }
            // A manifest that cannot be read is a file that differs.
            Err(problem) if args.first_option().is_none() => {
                print::note(format_args!(
                    "{problem}\nIt says what the folder was built with, so this compares with a build without options."
                ));
                self.request(args)
            }
            _ => self.request(args),
        }
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
            rust_gpu: RUST_GPU_VERSION.into(),
        }
    }

    /// Every file of a request, in memory. Where the crate has a target folder, what earlier builds made of kernels that
    /// are the same is taken from there.
    pub fn generate(&self, request: &Request) -> Result<Generated> {
        let modules = self.modules(request)?;
        // The built-in kernels need no cargo: where there is none, nothing is kept.
        let manifest = self.manifest.as_ref();
        Ok(match manifest.and_then(|it| Package::find(it).ok()) {
            Some(package) => {
                let kept = translated::folder(&package.target_dir, &package.name);
                generate_kept(request, &modules, &kept)?
            }
            None => generate(request, &modules)?,
        })
    }

    /// Final SPIR-V of the entry points that a request is for, at least.
    pub fn modules(&self, request: &Request) -> Result<Modules> {
        Ok(Modules::Final(self.bundle(&chosen(request)?)?.modules))
    }

    /// SPIR-V of one entry point.
    pub fn words(&self, kernel: &str) -> Result<Vec<u32>> {
        let bundle = self.bundle(&[kernel])?;
        let bytes = bundle
            .modules
            .get(kernel)
            .ok_or_else(|| Failure::machine(format!("`{kernel}` has no SPIR-V"), None))?;
        Ok(words(bytes, kernel).map_err(Error::from)?)
    }

    /// SPIR-V of every entry point.
    #[cfg(any(feature = "frames", feature = "measure"))]
    pub fn all_words(&self) -> Result<Words> {
        let bundle = self.bundle(&self.names())?;
        let all: std::result::Result<_, _> = bundle
            .modules
            .iter()
            .map(|(name, bytes)| Ok((name.clone(), words(bytes, name)?)))
            .collect();
        Ok(all.map_err(|failure: hankel_codegen::Failure| Error::from(failure))?)
    }

    /// The names of all entry points.
    fn names(&self) -> Vec<&str> {
        let entries = self.krate.entries.iter();
        entries.map(|e| e.kernel.name.as_str()).collect()
    }

    /// SPIR-V of the entry points called `names`, and of others where it is there anyway.
    fn bundle(&self, names: &[&str]) -> Result<Bundle> {
        let kernels = self.kernels();
        let is_all = names.len() == kernels.len();
        // What is wrong with the SPIR-V that was looked at last.
        let reason = RefCell::new(None);
        let fits = |bundle: &Bundle| {
            if bundle.origin.crate_name != self.krate.name {
                return false;
            }
            let made = bundle.check_made(&kernels, RUST_GPU_VERSION);
            let checked = made.and_then(|()| match &self.manifest {
                Some(manifest) => bundle.check_inputs(folder_of(manifest)),
                None => stale_when_built(),
            });
            let fits = checked.is_ok();
            *reason.borrow_mut() = checked.err().map(|error| error.to_string());
            fits
        };
        if self.krate.name == hankel_embedded::CRATE_NAME
            && let Ok(embedded) = Bundle::from_files(hankel_embedded::FILES)
            && fits(&embedded)
        {
            return Ok(embedded);
        }
        let Some(manifest) = &self.manifest else {
            let reason = reason.take().unwrap_or_else(|| "there is none".into());
            return Err(Failure::machine(
                format!("this program was built without the SPIR-V of its own kernels: {reason}"),
                Some(
                    "Run `cargo xtask spirv` in its repository, and build the program again."
                        .into(),
                ),
            ));
        };
        let committed = checkout().map(|root| root.join(COMMITTED));
        if let Some(folder) = committed
            && let Ok(bundle) = Bundle::read(&folder)
            && fits(&bundle)
        {
            return Ok(bundle);
        }
        let target = Package::find(manifest)?.target_dir;
        let kept = final_folder(&target, &self.krate.name);
        let some = some_folder(&target, &self.krate.name);
        let toolchain = hankel_toolchain::find(&hankel_toolchain::Options::from_env());
        // Another compiler may make something else of the same sources.
        let is_made_by_this = |bundle: &Bundle, folder: &Path| match &toolchain {
            Ok(Some(found)) => {
                found.rustc_version == bundle.origin.made_by.compiler
                    && std::fs::read_to_string(folder.join(STAMP))
                        .is_ok_and(|stamp| stamp == compiler(found.clone()).stamp())
            }
            Ok(None) => true,
            Err(_) => false,
        };
        for folder in [&kept, &some] {
            if let Ok(bundle) = Bundle::read(folder)
                && fits(&bundle)
                && names.iter().all(|name| bundle.modules.contains_key(*name))
                && is_made_by_this(&bundle, folder)
            {
                return Ok(bundle);
            }
        }
        let (compiled, stamp) = self.compile(manifest, &target, names, reason.take())?;
        let (modules, kept) = if is_all {
            let finished = finished::folder(&target, &self.krate.name);
            (
                finish_all(&compiled.modules, &kernels, Some(&finished))?,
                kept,
            )
        } else {
            let is_wanted = |kernel: &&Kernel| names.contains(&kernel.name.as_str());
            let wanted: Vec<Kernel> = kernels.iter().filter(is_wanted).cloned().collect();
            (finish_all(&compiled.modules, &wanted, None)?, some)
        };
        let bundle = Bundle::new(
            &self.krate.name,
            &kernels,
            RUST_GPU_VERSION,
            &compiled,
            modules,
        );
        let file = kept.join(STAMP);
        // The stamp of another compiler must not stay beside what this one has made; without one, it is made again.
        let _ = std::fs::remove_file(&file);
        bundle.write(&kept)?;
        let _ = std::fs::write(&file, stamp);
        Ok(bundle)
    }

    /// Raw SPIR-V of the entry points called `names` from rust-gpu, and the compiler's [stamp](Compiler::stamp).
    fn compile(
        &self,
        manifest: &Path,
        target: &Path,
        names: &[&str],
        reason: Option<String>,
    ) -> Result<(Compiled, String)> {
        let mut progress = Progress::new(self.quiet);
        let options = hankel_toolchain::Options::from_env();
        let toolchain = hankel_toolchain::ensure(&options, &mut progress).map_err(|error| {
            let why = match error {
                hankel_toolchain::Error::NotInstalled { .. } => String::new(),
                other => format!(": {other}"),
            };
            let reason = reason.map(|it| format!(" ({it})")).unwrap_or_default();
            Failure::machine(
                format!(
                    "{} has no SPIR-V that belongs to its present sources{reason}, and there is no rust-gpu compiler to make it{why}",
                    self.krate.name
                ),
                Some("`hankel toolchain install` installs one; `hankel toolchain status` says what it takes.".into()),
            )
        })?;
        let compiler = compiler(toolchain);
        let stamp = compiler.stamp();
        let is_all = names.len() == self.krate.entries.len();
        let (what, wanted) = if is_all {
            (self.krate.name.clone(), Wanted::All(names))
        } else {
            let what = format!("{} of {}", names.join(", "), self.krate.name);
            (what, Wanted::Only(names))
        };
        progress.begin(&format!(
            "Compiling {what} to SPIR-V (a minute or two the first time, then seconds)"
        ));
        if let Some(ahead) = self.ahead.take()
            && let Some(compiled) = ahead.finish(&compiler, wanted)
        {
            return Ok((compiled, stamp));
        }
        // Called from another thread: only the text is handed over.
        let line = |line: &str| progress.detail(line);
        let compiled = compile(manifest, &compiler, target, wanted, &mut { line })?;
        Ok((compiled, stamp))
    }
}

/// What [`hankel_toolchain`] found, as [`compile`] takes it.
pub fn compiler(toolchain: Toolchain) -> Compiler {
    Compiler {
        backend: toolchain.backend,
        bin: toolchain.bin,
        channel: toolchain.channel,
    }
}

/// Where the final SPIR-V of all kernels of a crate is kept, within cargo's target folder.
pub fn final_folder(target: &Path, crate_name: &str) -> PathBuf {
    target.join("hankel/final").join(crate_name)
}

/// Where the final SPIR-V of the kernels is kept that were asked for last, within cargo's target folder.
pub fn some_folder(target: &Path, crate_name: &str) -> PathBuf {
    target.join("hankel/some").join(crate_name)
}

/// The names of the entry points that a request is for.
fn chosen(request: &Request) -> Result<Vec<&str>> {
    Ok(request.chosen()?.iter().map(|k| k.name.as_str()).collect())
}

/// Where this program lies.
pub fn this_program() -> Result<PathBuf> {
    std::env::current_exe().map_err(|e| {
        Failure::machine(
            format!("cannot find the path of the running program: {e}"),
            None,
        )
    })
}

/// This program, to be started again for the kernels of other crates.
fn worker(limit: Duration) -> Result<Worker> {
    Ok(Worker {
        program: this_program()?,
        arguments: vec![WORKER.into()],
        limit,
    })
}

/// The kernels that are linked into this program. They are its own code, and every loop of them
/// ends: they need no process of their own.
fn built_in() -> KernelCrate {
    KernelCrate::from_entries(hankel_embedded::CRATE_NAME, hankel_shadows::entries())
}

/// Whether the SPIR-V in this program was made from the sources that it was compiled from.
fn stale_when_built() -> hankel_codegen::Result<()> {
    if hankel_embedded::STALE.is_empty() {
        Ok(())
    } else {
        Err(Error::Stale {
            reason: hankel_embedded::STALE.into(),
        })
    }
}

/// Whether the kernels in this program are those of the crate at `manifest`: nothing that they were
/// compiled from has changed since.
fn is_linked(manifest: &Path) -> bool {
    let Ok(manifest) = std::path::absolute(manifest) else {
        return false;
    };
    manifest.ends_with(BUILT_IN)
        && manifest.ancestors().nth(3).is_some_and(|root| {
            serde_json::from_str::<Inputs>(hankel_embedded::SOURCES)
                .is_ok_and(|sources| sources.changes(root).is_empty())
        })
}

/// Whether a file can be a crate's Cargo.toml.
pub fn check_manifest(path: &Path) -> Result<()> {
    let problem = if !path.is_file() {
        "there is no such file"
    } else if path.file_name().is_none_or(|name| name != "Cargo.toml") {
        "it is no Cargo.toml"
    } else {
        return Ok(());
    };
    Err(Failure::input(
        format!("{}: {problem}", path.display()),
        "Give the path of a kernel crate's Cargo.toml, or of its folder.",
    ))
}

/// The folder that a Cargo.toml lies in.
pub fn folder_of(manifest: &Path) -> &Path {
    match manifest.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    }
}

/// The built-in crate's Cargo.toml, inside a checkout.
pub fn built_in_manifest() -> Option<PathBuf> {
    checkout().map(|root| root.join(BUILT_IN))
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

/// An option's value, or what it is by default.
fn parsed<T: FromStr<Err = Error> + Default>(value: Option<&str>) -> Result<T> {
    Ok(value.map(str::parse).transpose()?.unwrap_or_default())
}

/// Where bindings are.
fn placement(args: &Placed) -> Result<Placement> {
    let mut placement = Placement::default();
    placement.hlsl_space = args.hlsl_space.unwrap_or_default();
    placement.register_base = args.register_base.unwrap_or_default();
    placement.wgsl_group = args.wgsl_group.unwrap_or_default();
    placement.msl_slot_base = args.msl_slot_base.unwrap_or_default();
    placement.glsl_binding_base = args.glsl_binding_base.unwrap_or_default();
    if let Some(file) = &args.bindings {
        placement.read(file)?;
    }
    Ok(placement)
}

/// `SUFFIX:CONSTANT=VALUE,…`, by the suffix.
fn variants(texts: &[String]) -> Result<BTreeMap<String, BTreeMap<String, ConstantValue>>> {
    const HELP: &str = "Write --variant _NAME:CONSTANT=VALUE, with a comma between constants; the suffix \
                        has lower-case letters, digits and `_`.";
    /// A name of a file may have 255 bytes.
    const MOST_LETTERS: usize = 64;
    let mut variants = BTreeMap::new();
    for text in texts {
        let wrong = |problem: &str| Failure::input(format!("--variant {text}: {problem}"), HELP);
        let (suffix, pairs) = text
            .split_once(':')
            .ok_or_else(|| wrong("there is no `:`"))?;
        let is_part_of_name =
            |letter: char| letter.is_ascii_lowercase() || letter.is_ascii_digit() || letter == '_';
        if suffix.is_empty() || !suffix.chars().all(is_part_of_name) {
            return Err(wrong("the suffix cannot end a kernel's name"));
        }
        if suffix.len() > MOST_LETTERS {
            return Err(wrong("the suffix has more than 64 letters"));
        }
        let pairs: Vec<String> = pairs.split(',').map(str::to_owned).collect();
        let values = constants(&format!("--variant {suffix}:"), &pairs)?;
        if variants.insert(suffix.to_owned(), values).is_some() {
            return Err(wrong("this suffix was given already"));
        }
    }
    Ok(variants)
}

/// `CONSTANT=VALUE` pairs; `option` is what stands before them.
fn constants(option: &str, pairs: &[String]) -> Result<BTreeMap<String, ConstantValue>> {
    const HELP: &str = "Write NAME=VALUE, once for each constant.";
    let mut values = BTreeMap::new();
    for pair in pairs {
        let wrong = |problem: String| Failure::input(format!("{option}{pair}: {problem}"), HELP);
        let (name, text) = pair
            .split_once('=')
            .ok_or_else(|| wrong("there is no `=`".into()))?;
        let (name, text) = (name.trim(), text.trim());
        let value: ConstantValue = text.parse().map_err(wrong)?;
        if let Some(before) = values.insert(name.to_owned(), value) {
            return Err(wrong(format!("`{name}` was set to {before} already")));
        }
    }
    Ok(values)
}

/// The inputs that parity makes for an entry point.
pub fn cases(entry: &KernelEntry, seed: u64) -> Result<Vec<Case>> {
    inputs::of_entry(entry, seed).map_err(|e| {
        Failure::input(
            format!("kernel `{}`: there are no inputs: {e}", entry.kernel.name),
            "Fix the function that makes them, or the attributes of its parameters.",
        )
    })
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
