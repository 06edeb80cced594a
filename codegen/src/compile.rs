//! From a kernel crate to raw SPIR-V, a module for each entry point: `link.rs`.
//!
//! This runs cargo as `spirv-builder` does, with the same flags, and takes rust-gpu's types for
//! the target's description and for the result from the crate that spirv-builder takes them from.
//! Not by way of spirv-builder itself: that finds the compiler through this process's `PATH`,
//! prints, and reports a failure without what the compiler said.

use std::collections::BTreeMap;
use std::ffi::{OsStr, OsString};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, SystemTime};

use hankel_system::overlooked::LastBuild;
use hankel_system::process::follow;
use rspirv::spirv::Capability;
use rustc_codegen_spirv_types::{SpirvTarget, TargetSpec, TargetSpecVersion};
use semver::Version;

use crate::diagnostics::source::Arrays;
use crate::diagnostics::{self, rust_gpu};
use crate::error::{During, Error, Result};
use crate::gather::{Build, gather};
use crate::inputs::Inputs;
use crate::library;
use crate::link::{self, LIST, Separately, Unlinked};
use crate::messages::{Artifact, Messages};
use crate::spirv::trim;

/// What the modules are compiled for.
pub(crate) const TARGET: &str = "spirv-unknown-vulkan1.2";

/// What rustc makes of the crate itself: a library for which rust-gpu links its modules.
pub(crate) const CRATE_TYPE: &str = "dylib";

/// The folder for rust-gpu's artefacts, within cargo's target folder.
pub const TARGET_SUBFOLDER: &str = "hankel/spirv";

/// The folder for linked modules that are kept from one build to the next, within cargo's target folder.
pub const LINKED_SUBFOLDER: &str = "hankel/spirv/linked";

/// The file that notes which compiler cannot link what it has not compiled just now, within cargo's target folder.
pub const LINKS_AT_ONCE: &str = "hankel/spirv/links-at-once";

/// A rust-gpu compiler; `hankel_toolchain::Toolchain` has the same fields.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Compiler {
    /// `librustc_codegen_spirv.so`.
    pub backend: PathBuf,
    /// Folder with `cargo` and `rustc`; `None`: rustup's proxies in `PATH`.
    pub bin: Option<PathBuf>,
    /// rustup's name of the toolchain, where rustup has it.
    pub channel: Option<String>,
}

impl Compiler {
    /// A command of this toolchain, with nothing of an outer cargo's or rustup's environment.
    pub(crate) fn command(&self, program: &str) -> Command {
        let mut command = match &self.bin {
            Some(bin) => {
                Command::new(bin.join(format!("{program}{}", std::env::consts::EXE_SUFFIX)))
            }
            None => Command::new(program),
        };
        for (name, _) in std::env::vars_os() {
            if name.to_str().is_some_and(leaks) {
                command.env_remove(&name);
            }
        }
        if let Some(bin) = &self.bin {
            let path = std::env::var_os("PATH").unwrap_or_default();
            let folders = std::iter::once(bin.clone()).chain(std::env::split_paths(&path));
            // A folder with a colon in its name cannot be in PATH; cargo then asks for rustc's.
            match std::env::join_paths(folders) {
                Ok(path) => command.env("PATH", path),
                Err(_) => command.env("RUSTC", bin.join("rustc")),
            };
        }
        if let Some(channel) = &self.channel {
            command.arg(format!("+{channel}"));
        }
        command.stdin(Stdio::null());
        command
    }

    /// The files that it consists of, as far as they are known.
    pub(crate) fn files(&self) -> impl Iterator<Item = PathBuf> {
        let rustc = self.bin.as_ref().map(|bin| bin.join("rustc"));
        let rustc = rustc.map(|it| it.with_extension(std::env::consts::EXE_EXTENSION));
        rustc.into_iter().chain([self.backend.clone()])
    }

    /// What tells it from others of the same version: sizes and times of its files, as far as they are known.
    #[must_use]
    pub fn stamp(&self) -> String {
        let files = self.files().map(|file| {
            let data = std::fs::metadata(&file).ok();
            let of = |data: std::fs::Metadata| format!("{} {:?}", data.len(), data.modified().ok());
            format!("{} {}", file.display(), data.map(of).unwrap_or_default())
        });
        files.collect::<Vec<_>>().join("\n")
    }

    /// What `rustc --version` prints.
    ///
    /// # Errors
    ///
    /// rustc does not run.
    pub fn version(&self) -> Result<String> {
        self.ask("rustc", &["--version"])
    }

    /// What a program of the toolchain prints.
    fn ask(&self, program: &str, arguments: &[&str]) -> Result<String> {
        let mut command = self.command(program);
        let program = PathBuf::from(command.get_program());
        let fail = |source| Error::Run {
            program: program.clone(),
            source,
        };
        let output = command.args(arguments).output().map_err(fail)?;
        if !output.status.success() {
            let said = String::from_utf8_lossy(&output.stderr).trim().to_owned();
            return Err(fail(std::io::Error::other(said)));
        }
        Ok(String::from_utf8_lossy(&output.stdout).trim().to_owned())
    }
}

/// Variables by which an outer cargo, rustup or build script would change what is compiled.
fn leaks(name: &str) -> bool {
    const NAMES: [&str; 13] = [
        "CARGO",
        "CARGO_BUILD_TARGET",
        "CARGO_BUILD_TARGET_DIR",
        "CARGO_ENCODED_RUSTFLAGS",
        "CARGO_INCREMENTAL",
        "CARGO_TARGET_DIR",
        "CARGO_BUILD_RUSTFLAGS",
        "RUSTC",
        "RUSTC_WORKSPACE_WRAPPER",
        "RUSTC_WRAPPER",
        "RUSTDOC",
        "RUSTFLAGS",
        "RUSTUP_TOOLCHAIN",
    ];
    const PREFIXES: [&str; 6] = [
        "CARGO_CFG_",
        "CARGO_FEATURE_",
        "CARGO_PKG_",
        "CARGO_PROFILE_",
        "CARGO_MANIFEST_",
        "CARGO_UNSTABLE_",
    ];
    NAMES.contains(&name) || PREFIXES.iter().any(|prefix| name.starts_with(prefix))
}

/// What came of a kernel crate.
#[derive(Clone, Debug, PartialEq)]
pub struct Compiled {
    /// Raw SPIR-V by entry point.
    pub modules: BTreeMap<String, Vec<u8>>,
    /// What it was made from.
    pub inputs: Inputs,
    /// What the compiler's `rustc --version` prints.
    pub compiler: String,
}

/// How often a crate is compiled whose files change meanwhile.
const MOST_ATTEMPTS: u32 = 5;

/// File systems tell the time of a change in steps; the kernel's clock for it lags a little.
const CLOCK_STEP: Duration = Duration::from_millis(50);

/// What is compiled of a crate.
#[derive(Clone, Copy, Debug)]
pub enum Wanted<'a> {
    /// All of its entry points; these must come out.
    All(&'a [&'a str]),
    /// These entry points alone. rust-gpu's linker takes most of the time of a build, in proportion to
    /// what it links.
    Only(&'a [&'a str]),
}

impl<'a> Wanted<'a> {
    /// The entry points that must come out.
    fn names(self) -> &'a [&'a str] {
        let (Self::All(names) | Self::Only(names)) = self;
        names
    }

    /// rustc's flags for the crate itself: `#[kernel]` knows them.
    fn flags(self) -> Vec<String> {
        let Self::Only(names) = self else {
            return Vec::new();
        };
        let mut flags = vec!["--cfg".to_owned(), "hankel_select".into()];
        for name in names {
            flags.extend(["--cfg".into(), format!("hankel_kernel={name:?}")]);
        }
        flags
    }
}

/// Compiles the kernel crate whose Cargo.toml is `manifest`.
///
/// `target_dir` is cargo's target folder (the artefacts go into [`TARGET_SUBFOLDER`] of it);
/// `progress` gets every line that cargo prints. The first build takes half a minute, later ones about a
/// second.
///
/// # Errors
///
/// The crate does not compile, lacks one of the entry points, or does not stop changing.
pub fn compile(
    manifest: &Path,
    compiler: &Compiler,
    target_dir: &Path,
    wanted: Wanted<'_>,
    progress: &mut (dyn FnMut(&str) + Send),
) -> Result<Compiled> {
    let manifest = std::path::absolute(manifest).during("resolve", manifest)?;
    let folder = manifest
        .parent()
        .filter(|_| manifest.is_file())
        .ok_or_else(|| Error::Manifest {
            path: manifest.clone(),
            problem: "there is no such file".into(),
        })?;
    let found = diagnostics::source::check(folder);
    if !found.diagnostics.is_empty() {
        return Err(Error::Source(found.diagnostics));
    }
    let target_dir = std::path::absolute(target_dir).during("resolve", target_dir)?;
    let linked_dir = target_dir.join(LINKED_SUBFOLDER);
    let links_at_once = target_dir.join(LINKS_AT_ONCE);
    let target_dir = target_dir.join(TARGET_SUBFOLDER);
    let mut flags = wanted.flags();
    flags.extend(of_arrays(found.arrays).map(Into::into));
    let build = std::iter::once(manifest.as_os_str()).chain(flags.iter().map(OsStr::new));
    let last = LastBuild::of(&target_dir, build)?;
    last.forget_if_overlooked()?;
    let version = compiler.version()?;
    let sysroot = compiler.ask("rustc", &["--print", "sysroot"])?;
    let sysroot = PathBuf::from(sysroot);
    let library = library::patched(&sysroot, &target_dir)?;
    let own = [target_dir.clone(), sysroot, compiler.backend.clone()];
    let spec = target_spec(&version, &target_dir)?;
    let flags_of_all = flags_of_all(compiler);
    let how_to_link = || Separately::of(links_at_once.clone(), &version);
    let mut separately = how_to_link();
    let mut before = None;
    for _ in 0..MOST_ATTEMPTS {
        let start = SystemTime::now() - CLOCK_STEP;
        let mut cargo = cargo(compiler, &spec, &flags_of_all, &manifest, &target_dir);
        // cargo has no other word for where the library's sources are.
        cargo.env("__CARGO_TESTS_ONLY_SRC_ROOT", &library);
        cargo.arg("--").args(&flags).args(separately.flag());
        let said = match run(cargo, &manifest, wanted.names(), progress) {
            Err(error) if joins_arms(&error) && !flags.contains(&UNTHREADED.into()) => {
                flags.push(UNTHREADED.into());
                // That linking failed before says nothing of the compiler.
                separately = how_to_link();
                continue;
            }
            other => other?,
        };
        let messages = Messages::read(&said).map_err(|error| Error::Inputs {
            path: folder.to_owned(),
            problem: format!("a message of cargo cannot be read: {error}"),
        })?;
        let artefact = last_artefact(&messages, &target_dir).ok_or_else(|| Error::Manifest {
            path: manifest.clone(),
            problem: "cargo made no SPIR-V of it: its [lib] needs crate-type = [\"lib\", \"dylib\"] and a kernel".into(),
        })?;
        if !artefact.belongs_to(&manifest, separately.is_on())? {
            continue;
        }
        let modules = if separately.is_on() {
            let unlinked = Unlinked {
                compiler,
                version: &version,
                flags: &rustc_flags(&spec, &flags_of_all),
                target_dir: &target_dir,
                linked_dir: &linked_dir,
                messages: &messages,
                list: &artefact.file,
                is_part: matches!(wanted, Wanted::Only(_)),
            };
            let Some(modules) = unlinked.link() else {
                separately.fails();
                continue;
            };
            modules
        } else {
            separately.at_once_works();
            link::read_list(&artefact.file)?
        };
        let missing = wanted.names().iter();
        if let Some(missing) = missing.copied().find(|it| !modules.contains_key(*it)) {
            return Err(Error::NoEntryPoint {
                manifest,
                kernel: missing.into(),
                found: modules.into_keys().collect(),
            });
        }
        let names = gather(&Build {
            folder,
            own: &own,
            messages: &messages,
            made: &artefact.file,
        })?;
        let inputs = Inputs::take(folder, &names)?;
        // A file that changed while cargo ran may have been read before or after that. If nothing
        // changes while cargo runs again, this is what it read.
        let settled = inputs.newest(folder).is_none_or(|newest| newest < start);
        if settled || before.as_ref() == Some(&inputs) {
            let read = inputs.files.keys().chain(inputs.folders.keys());
            last.record(read.map(|name| folder.join(name)), &said, &own, start)?;
            return Ok(Compiled {
                modules,
                inputs,
                compiler: version,
            });
        }
        before = Some(inputs);
    }
    Err(Error::Inputs {
        path: folder.to_owned(),
        problem: "its files change while they are compiled".into(),
    })
}

/// Where both arms of a branch come to one block, rust-gpu 0.10 writes SPIR-V that it does not read itself
/// (tests/upstream/rust-gpu-equal-branches). This pass of rustc makes such arms of a `match` of two values with a guard.
const UNTHREADED: &str = "-Zmir-enable-passes=-JumpThreading";

/// Whether rust-gpu has failed for that.
fn joins_arms(error: &Error) -> bool {
    matches!(error, Error::Compile { output, .. }
        if output.contains("OpBranchConditional") && output.contains("is duplicated"))
}

/// rustc's flags for a crate whose kernels do such things with arrays.
///
/// An iterator and a slice are pointers, which rust-gpu can only follow within a function. So rustc
/// inlines everything in these crates before rust-gpu sees it; in others it does not, since that reads
/// vectors part by part, and says less of what stands in the source.
fn of_arrays(arrays: Arrays) -> impl Iterator<Item = &'static str> {
    const ITERATED: [&str; 4] = [
        "-Zmir-enable-passes=+Inline",
        // rustc looks an eighth of it deep for calls that end in themselves, and takes those beyond for such: a closure that
        // calls `math::exp` has more within each other than an eighth of the usual 128.
        "-Zcrate-attr=recursion_limit=\"4096\"",
        "-Zinline-mir-threshold=100000",
        "-Zinline-mir-hint-threshold=100000",
    ];
    // Else only what is generic or `#[inline]` can be inlined.
    const PASSED_AS_SLICES: &str = "-Zcross-crate-inline-threshold=always";
    let iterated = arrays.iterated.then_some(ITERATED).into_iter().flatten();
    iterated.chain(arrays.passed_as_slices.then_some(PASSED_AS_SLICES))
}

/// Runs cargo; gives its messages.
fn run(
    mut cargo: Command,
    manifest: &Path,
    names: &[&str],
    progress: &mut (dyn FnMut(&str) + Send),
) -> Result<String> {
    let program = PathBuf::from(cargo.get_program());
    let said = follow(&mut cargo, progress).map_err(|source| Error::Run { program, source })?;
    if !said.status.success() {
        return Err(failure(manifest, names, &said.stderr, &said.stdout));
    }
    Ok(said.stdout)
}

fn target_spec(version: &str, target_dir: &Path) -> Result<TargetSpec> {
    let number = parse_version(version).ok_or_else(|| Error::Run {
        program: "rustc".into(),
        source: std::io::Error::other(format!("its version is not a version: {version}")),
    })?;
    let target = SpirvTarget::parse(TARGET).map_err(|error| Error::Option {
        option: "SPIR-V target",
        value: format!("{TARGET}: {error}"),
        expected: "one that rust-gpu knows",
    })?;
    let specs = target_dir.join("target-specs");
    TargetSpecVersion::target_arg(number, &target, &specs).during("write", &specs)
}

/// rustc's flags for all crates.
fn flags_of_all(compiler: &Compiler) -> Vec<String> {
    let capabilities: Vec<String> = trim::ENABLED
        .iter()
        .map(|capability: &Capability| format!("+{capability:?}"))
        .collect();
    vec![
        format!("-Zcodegen-backend={}", compiler.backend.display()),
        // A new backend compiles everything anew.
        "-Zbinary-dep-depinfo".into(),
        "-Csymbol-mangling-version=v0".into(),
        "-Zcrate-attr=feature(register_tool)".into(),
        "-Zcrate-attr=register_tool(rust_gpu)".into(),
        "-Coverflow-checks=off".into(),
        "-Cdebug-assertions=off".into(),
        // rust-gpu matches patterns in MIR that these optimisations would destroy.
        "-Zinline-mir=off".into(),
        "-Zmir-enable-passes=-GVN".into(),
        "-Zshare-generics=off".into(),
        // No shader tells the line of a panic. With lines, all below an edited one would be linked again.
        "-Zlocation-detail=none".into(),
        // Its optimiser makes one constant of two in a row, which rounds otherwise than the source
        // (tests/upstream/rust-gpu-merged-constants). `finish` runs it, with arithmetic held, and validates: references
        // that are chosen have yet to be made valid.
        "-Cllvm-args=--module-output=single --spirv-metadata=name-variables --no-spirv-opt --no-spirv-val".into(),
        format!("-Ctarget-feature={}", capabilities.join(",")),
    ]
}

/// The flags of rustc where no cargo adds the target's.
fn rustc_flags(spec: &TargetSpec, flags_of_all: &[String]) -> Vec<OsString> {
    let target = [OsString::from("--target"), spec.target.clone()];
    let flags = flags_of_all.iter().map(OsString::from);
    target.into_iter().chain(flags).collect()
}

fn cargo(
    compiler: &Compiler,
    spec: &TargetSpec,
    flags_of_all: &[String],
    manifest: &Path,
    target_dir: &Path,
) -> Command {
    let mut cargo = compiler.command("cargo");
    cargo.current_dir(manifest.parent().unwrap_or(Path::new(".")));
    cargo.args([
        "rustc",
        "--lib",
        "--crate-type",
        CRATE_TYPE,
        "--profile=release",
        "--message-format=json",
        "-Zbuild-std=core",
        "-Zbuild-std-features=compiler-builtins-mem",
        "--manifest-path",
    ]);
    cargo.arg(manifest).arg("--target-dir").arg(target_dir);
    spec.append_to_cmd(&mut cargo);
    cargo
        .env("CARGO_ENCODED_RUSTFLAGS", flags_of_all.join("\x1f"))
        // cargo remembers what rustc says about itself, but the backend has a say too.
        .env("CARGO_CACHE_RUSTC_INFO", "0")
        // Whatever the crate's own workspace says: one profile, the same bytes everywhere.
        .env("CARGO_PROFILE_RELEASE_CODEGEN_UNITS", "1")
        .env("CARGO_PROFILE_RELEASE_DEBUG", "0")
        // After an edit only what follows from it is compiled. With one codegen unit the modules
        // are those of a build from nothing, byte for byte.
        .env("CARGO_PROFILE_RELEASE_INCREMENTAL", "true")
        .env("CARGO_PROFILE_RELEASE_LTO", "off")
        .env("CARGO_PROFILE_RELEASE_OPT_LEVEL", "3")
        .env("CARGO_INCREMENTAL", "1")
        .env("CARGO_TERM_COLOR", "never")
        .env("CARGO_TERM_PROGRESS_WHEN", "never");
    cargo
}

/// The number in `rustc 1.98.0-nightly (…)`.
fn parse_version(said: &str) -> Option<Version> {
    let number = said.strip_prefix("rustc ")?;
    let end = number.find(|letter: char| letter != '.' && !letter.is_ascii_digit());
    Version::parse(&number[..end.unwrap_or(number.len())]).ok()
}

fn failure(manifest: &Path, kernels: &[&str], said: &str, messages: &str) -> Error {
    let is_chatter = |line: &&str| {
        let line = line.trim_start();
        [
            "Compiling ",
            "Finished ",
            "Updating ",
            "Downloading ",
            "Downloaded ",
            "Locking ",
            "Fresh ",
            "Blocking ",
        ]
        .iter()
        .any(|word| line.starts_with(word))
    };
    let folder = manifest.parent().unwrap_or(manifest);
    let mut output: String = rust_gpu::read(messages, folder)
        .iter()
        .flat_map(|it| [it.to_string(), "\n".into()])
        .collect();
    let told: String = said
        .lines()
        .filter(|line| !is_chatter(line))
        .flat_map(|line| [line, "\n"])
        .collect();
    output.push_str(&told);
    // What is no JSON on the standard output was printed by the compiler itself.
    output.extend(
        messages
            .lines()
            .filter(|line| !line.starts_with('{'))
            .flat_map(|line| [line, "\n"]),
    );
    let kernel = kernels
        .iter()
        .find(|name| has_name(&output, name))
        .map(ToString::to_string);
    let panicked = output.contains("panicked at") || output.contains("internal compiler error");
    Error::Compile {
        manifest: manifest.to_owned(),
        kernel,
        panicked,
        output: output.trim().to_owned(),
    }
}

/// Whether a name stands in the text as a word of its own.
fn has_name(text: &str, name: &str) -> bool {
    let is_part = |letter: char| letter == '_' || letter.is_alphanumeric();
    text.match_indices(name).any(|(place, _)| {
        !text[..place].ends_with(is_part) && !text[place + name.len()..].starts_with(is_part)
    })
}

/// rust-gpu's list of what it made.
#[derive(Debug, PartialEq)]
struct Artefact {
    file: PathBuf,
    /// cargo thinks that it was made before.
    fresh: bool,
}

impl Artefact {
    /// Whether it was made of the crate at `manifest`. Two crates of one name that share a target
    /// folder have one place for it, and cargo calls it fresh for both. What was made of the other
    /// one is removed, so that cargo makes it again.
    fn belongs_to(&self, manifest: &Path, is_unlinked: bool) -> Result<bool> {
        let owner = self.file.with_extension("hankel-owner");
        let name = self.file.file_name().unwrap_or_default();
        let folder = self.file.parent().unwrap_or(Path::new("."));
        let artefact = folder.join("deps").join(name);
        if is_unlinked && !self.fresh {
            // rustc has not written it, and cargo compiles again what is not there.
            std::fs::write(&artefact, "").during("write", &artefact)?;
        }
        // What rustc itself wrote tells whose it is, if a build was ended before it came to this.
        let proof = if is_unlinked {
            link::rlink_of(&self.file).unwrap_or_default()
        } else {
            artefact.clone()
        };
        let made = std::fs::metadata(&proof).and_then(|data| data.modified());
        let ours = |made: &SystemTime| format!("{}\n{made:?}\n", manifest.display());
        let is_ours = |made| std::fs::read_to_string(&owner).is_ok_and(|it| it == ours(made));
        if made.as_ref().is_ok_and(is_ours) {
            return Ok(true);
        }
        if self.fresh {
            for file in [self.file.clone(), artefact] {
                match std::fs::remove_file(&file) {
                    Err(error) if error.kind() != std::io::ErrorKind::NotFound => {
                        return Err(error).during("remove", &file);
                    }
                    _ => {}
                }
            }
            return Ok(false);
        }
        let ours = ours(&made.during("read", &proof)?);
        std::fs::write(&owner, &ours).during("write", &owner)?;
        Ok(true)
    }
}

/// The artefact of the crate itself. cargo does not name the file where rustc has not written it.
fn last_artefact(messages: &Messages, target_dir: &Path) -> Option<Artefact> {
    let is_ours = |it: &&Artifact| it.target.crate_types.iter().any(|of| of == CRATE_TYPE);
    let unit = messages.artifacts.iter().rfind(is_ours)?;
    let name = unit.target.name.replace('-', "_");
    let folder = target_dir.join(TARGET).join("release");
    Some(Artefact {
        file: folder.join(format!("{name}{LIST}")),
        fresh: unit.fresh,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::messages::tests::artifact;

    #[test]
    fn versions_are_read() {
        assert_eq!(
            parse_version("rustc 1.98.1 (abc 2026-01-01)").unwrap(),
            Version::new(1, 98, 1)
        );
        assert_eq!(
            parse_version("rustc 1.98.0-nightly (x)").unwrap(),
            Version::new(1, 98, 0)
        );
        assert_eq!(parse_version("gcc 12"), None);
    }

    #[test]
    fn the_outer_cargo_does_not_leak() {
        for name in [
            "RUSTUP_TOOLCHAIN",
            "CARGO",
            "RUSTC",
            "CARGO_TARGET_DIR",
            "CARGO_PKG_NAME",
        ] {
            assert!(leaks(name), "{name}");
        }
        for name in [
            "PATH",
            "HOME",
            "CARGO_HOME",
            "RUSTUP_HOME",
            "CARGO_NET_OFFLINE",
        ] {
            assert!(!leaks(name), "{name}");
        }
    }

    #[test]
    fn a_failure_names_the_kernel_and_keeps_the_diagnostics() {
        let said = "   Compiling shadows v0.1.0\nerror: cannot use `i128`\n --> src/lib.rs:3:1\n  = note: used by shader::blur_rgba16unorm\n";
        let error = failure(
            Path::new("Cargo.toml"),
            &["blur", "blur_rgba16unorm"],
            said,
            "",
        );
        let Error::Compile {
            kernel,
            panicked,
            output,
            ..
        } = &error
        else {
            panic!("{error}")
        };
        assert_eq!(kernel.as_deref(), Some("blur_rgba16unorm"));
        assert!(
            !panicked && output.starts_with("error: cannot use `i128`"),
            "{output}"
        );
        let ice = failure(
            Path::new("Cargo.toml"),
            &[],
            "thread 'rustc' panicked at x.rs:1:1:\nboom",
            "",
        );
        assert!(ice.to_string().contains("rust-gpu panicked"), "{ice}");
        assert!(ice.advice().is_some());
    }

    #[test]
    fn the_last_artefact_counts() {
        let messages = [
            artifact("glam", "lib", true),
            artifact("a-b", "dylib", true),
            artifact("c", "proc-macro", false),
        ];
        let messages = Messages::read(&messages.concat()).unwrap();
        let folder = Path::new("/target");
        let found = last_artefact(&messages, folder).unwrap();
        let file = folder.join(TARGET).join("release/a_b.spv.json");
        assert_eq!((found.file, found.fresh), (file, true));
        assert_eq!(last_artefact(&Messages::default(), folder), None);
    }
}
