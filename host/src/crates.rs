//! Kernel crates: the built-in ones, and anybody's, which is built as a plug-in: with the native
//! code of those entry points that will run, or without any, to learn what its kernels are.

use std::ffi::{OsStr, OsString};
use std::fmt;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::time::SystemTime;

use hankel_dsl::native::describe::Kernel;
use hankel_dsl::native::inputs::{Given, Request};
use hankel_dsl::native::plugin;
use hankel_dsl::native::{Call, CallError, Entry};
use hankel_system::input;
use hankel_system::overlooked::{LastBuild, RecordError};
use hankel_system::process::{Said, follow};
use serde::Deserialize;

use crate::device::{Program, Shader};
use crate::worker::{Worker, Workers};

/// Size of the largest list of sources, in bytes.
const MOST_BYTES_OF_RULES: u64 = 64 << 20;

/// A kernel crate with its native code.
#[derive(Clone, Debug)]
pub struct KernelCrate {
    /// The package's name.
    pub name: String,
    /// Its entry points, in the order of its `kernels![…]`.
    pub entries: Vec<KernelEntry>,
}

/// The entry points whose native code a plug-in is built with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Native<'a> {
    /// None: the plug-in only describes. No kernel's body is compiled, so this takes about a second.
    Descriptions,
    /// Those with these names.
    Of(&'a [String]),
    /// Those with these names; an integer of the crate that overflows, and a shift by too many bits,
    /// ends the call.
    Checked(&'a [String]),
    /// All.
    All,
}

impl Native<'_> {
    /// How cargo is to optimise the crate and what it depends on.
    const fn profile(self) -> &'static [&'static str] {
        match self {
            // Descriptions are made once: there is nothing to optimise, least of all in the mathematics that
            // an edit compiles again. A profile of its own: settings of `release` for single packages would stay.
            Self::Descriptions => &[
                "--profile=describe",
                "--config=profile.describe.inherits='dev'",
                "--config=profile.describe.debug=0",
            ],
            Self::Of(_) | Self::Checked(_) | Self::All => &["--release"],
        }
    }

    /// rustc's flags for the crate itself.
    fn flags(self) -> Vec<OsString> {
        let mut flags = vec![OsString::from("--cfg"), "hankel_plugin".into()];
        let names = match self {
            Native::All => return flags,
            Native::Descriptions => &[],
            Native::Of(names) => names,
            Native::Checked(names) => {
                flags.push("-Coverflow-checks=on".into());
                // For the author's line of what fails within another crate.
                flags.push("-Cdebuginfo=line-tables-only".into());
                flags.push("-Cstrip=none".into());
                names
            }
        };
        flags.extend(["--cfg".into(), "hankel_select".into()]);
        for name in names {
            flags.extend(["--cfg".into(), format!("hankel_kernel={name:?}").into()]);
        }
        flags
    }
}

/// Makes an entry point's own inputs, if it has any.
type Inputs = dyn Fn(&Request) -> Result<Option<Vec<Given>>, String> + Send + Sync;

type Run = dyn Fn(&mut Call<'_>) -> Result<(), CallError> + Send + Sync;

/// An entry point of a crate, wherever its native code comes from.
#[derive(Clone)]
pub struct KernelEntry {
    /// What it is.
    pub kernel: Kernel,
    run: Arc<Run>,
    inputs: Option<Arc<Inputs>>,
}

impl fmt::Debug for KernelEntry {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("KernelEntry")
            .field(&self.kernel.name)
            .finish()
    }
}

impl From<Entry> for KernelEntry {
    fn from(entry: Entry) -> Self {
        let inputs = entry.inputs.map(|make| -> Arc<Inputs> {
            Arc::new(move |request: &Request| plugin::made(make, request).map(Some))
        });
        Self {
            kernel: entry.kernel,
            run: Arc::new(entry.run),
            inputs,
        }
    }
}

impl KernelEntry {
    /// An entry point with the given native code.
    pub fn new(
        kernel: Kernel,
        run: impl Fn(&mut Call<'_>) -> Result<(), CallError> + Send + Sync + 'static,
    ) -> Self {
        Self {
            kernel,
            run: Arc::new(run),
            inputs: None,
        }
    }

    /// The same with inputs of its own for parity.
    #[must_use]
    pub fn with_inputs(
        mut self,
        make: impl Fn(&Request) -> Result<Option<Vec<Given>>, String> + Send + Sync + 'static,
    ) -> Self {
        self.inputs = Some(Arc::new(make));
        self
    }

    /// The inputs that the author makes; none where the kernel names no function that does.
    ///
    /// # Errors
    /// The function panicked, or its process ended.
    pub fn own_inputs(&self, request: &Request) -> Result<Option<Vec<Given>>, String> {
        self.inputs.as_ref().map_or(Ok(None), |make| make(request))
    }

    /// Runs the native code.
    ///
    /// # Errors
    /// Arguments that do not fit, or a panic of the kernel.
    pub fn run(&self, call: &mut Call<'_>) -> Result<(), CallError> {
        (self.run)(call)
    }

    /// The entry point as a device runs it, with `shader` on Vulkan.
    #[must_use]
    pub fn program<'a>(&'a self, shader: Option<Shader<'a>>, constants: &'a [u32]) -> Program<'a> {
        Program {
            kernel: &self.kernel,
            constants,
            native: Some(&*self.run),
            shader,
        }
    }
}

/// Why a crate's kernels could not be had.
#[derive(Debug, thiserror::Error)]
pub enum CrateError {
    /// There is no such manifest.
    #[error("{}: no such file; give the path of a kernel crate's Cargo.toml", path.display())]
    NoManifest {
        /// What was given.
        path: PathBuf,
    },
    /// cargo does not start.
    #[error("cannot run `cargo` ({detail}): install Rust with rustup or from your distribution")]
    NoCargo {
        /// What the system said.
        detail: String,
    },
    /// The manifest is wrong, or is not that of one library.
    #[error("{}: {problem}", path.display())]
    Manifest {
        /// The manifest.
        path: PathBuf,
        /// What cargo said, or what is missing.
        problem: String,
    },
    /// The crate does not compile.
    #[error("`{package}` does not compile for this machine:\n{diagnostics}")]
    Build {
        /// The package.
        package: String,
        /// The compiler's words.
        diagnostics: String,
    },
    /// What cargo has read cannot be recorded.
    #[error("{0}")]
    Record(#[from] RecordError),
    /// What was built has no kernels, or cannot be asked for them.
    #[error("`{package}`: {problem}")]
    Plugin {
        /// The package.
        package: String,
        /// What is wrong.
        problem: String,
    },
    /// No kernel of that name.
    #[error("`{crate_name}` has no kernel `{name}`; it has: {known}")]
    NoKernel {
        /// The crate.
        crate_name: String,
        /// What was asked for.
        name: String,
        /// What there is.
        known: String,
    },
}

impl KernelCrate {
    /// A crate that this program was built with.
    pub fn from_entries(name: impl Into<String>, entries: Vec<Entry>) -> Self {
        Self {
            name: name.into(),
            entries: entries.into_iter().map(KernelEntry::from).collect(),
        }
    }

    /// Builds the crate at `manifest` (its `Cargo.toml`) for this machine with cargo, into
    /// `hankel/native` under cargo's own target folder, and loads it; entry points that `native`
    /// leaves out cannot be run ([`CallError::NotBuilt`]). The crate's code runs in processes of
    /// `worker`, never in this one. `progress` gets cargo's lines as they come.
    ///
    /// # Errors
    /// See [`CrateError`].
    pub fn load(
        manifest: &Path,
        native: Native<'_>,
        worker: &Worker,
        progress: &mut dyn FnMut(&str),
    ) -> Result<Self, CrateError> {
        let package = Package::find(manifest)?;
        let library = package.build(native, progress)?;
        let (workers, kernels) =
            Workers::load(worker, &library).map_err(|problem| CrateError::Plugin {
                package: package.name.clone(),
                problem,
            })?;
        let workers = Arc::new(workers);
        let entries = kernels
            .into_iter()
            .enumerate()
            .map(|(i, kernel)| {
                let (runs, makes) = (Arc::clone(&workers), Arc::clone(&workers));
                let described = kernel.clone();
                let entry = KernelEntry::new(kernel, move |call| runs.run(i, &described, call));
                entry.with_inputs(move |request| makes.inputs(i, request))
            })
            .collect();
        Ok(Self {
            name: package.name,
            entries,
        })
    }

    /// The entry point called `name`.
    ///
    /// # Errors
    /// [`CrateError::NoKernel`], with the names there are.
    pub fn entry(&self, name: &str) -> Result<&KernelEntry, CrateError> {
        self.entries
            .iter()
            .find(|e| e.kernel.name == name)
            .ok_or_else(|| CrateError::NoKernel {
                crate_name: self.name.clone(),
                name: name.into(),
                known: self
                    .entries
                    .iter()
                    .map(|e| e.kernel.name.as_str())
                    .collect::<Vec<_>>()
                    .join(", "),
            })
    }
}

/// A package with a library, as cargo describes it.
pub struct Package {
    /// Its name.
    pub name: String,
    manifest: PathBuf,
    /// cargo's target folder for it.
    pub target_dir: PathBuf,
}

/// What is read of `cargo metadata`.
#[derive(Deserialize)]
struct Metadata {
    packages: Vec<MetadataPackage>,
    target_directory: PathBuf,
}

#[derive(Deserialize)]
struct MetadataPackage {
    name: String,
    manifest_path: PathBuf,
    targets: Vec<Target>,
}

#[derive(Deserialize)]
struct Target {
    kind: Vec<String>,
}

/// What is read of cargo's messages.
#[derive(Deserialize)]
#[serde(tag = "reason", rename_all = "kebab-case")]
enum Message {
    #[serde(rename = "compiler-message")]
    Compiler { message: Diagnostic },
    #[serde(rename = "compiler-artifact")]
    Artifact {
        manifest_path: PathBuf,
        target: ArtifactTarget,
        filenames: Vec<PathBuf>,
    },
    #[serde(other)]
    Other,
}

#[derive(Deserialize)]
struct Diagnostic {
    level: String,
    rendered: Option<String>,
}

#[derive(Deserialize)]
struct ArtifactTarget {
    crate_types: Vec<String>,
}

/// Environment variables that an outer `cargo run` or build script sets for its own package, and
/// which mean something else to an inner cargo.
fn is_outer_cargo(name: &str) -> bool {
    const EXACT: [&str; 11] = [
        "CARGO",
        "CARGO_CRATE_NAME",
        "CARGO_ENCODED_RUSTFLAGS",
        "CARGO_MAKEFLAGS",
        "CARGO_PRIMARY_PACKAGE",
        "CARGO_TARGET_TMPDIR",
        "DEBUG",
        "NUM_JOBS",
        "OPT_LEVEL",
        "OUT_DIR",
        "RUSTUP_TOOLCHAIN",
    ];
    const PREFIXES: [&str; 6] = [
        "CARGO_BIN_",
        "CARGO_CFG_",
        "CARGO_FEATURE_",
        "CARGO_MANIFEST_",
        "CARGO_PKG_",
        "DEP_",
    ];
    EXACT.contains(&name) || PREFIXES.iter().any(|p| name.starts_with(p))
}

/// cargo, as if a user had typed it.
fn cargo() -> Command {
    let mut command = Command::new("cargo");
    // A user's own CARGO_TARGET_DIR or RUSTUP_TOOLCHAIN stays; an outer cargo's goes.
    let nested = std::env::var_os("CARGO_PKG_NAME").is_some();
    for (name, _) in std::env::vars_os().filter(|_| nested) {
        let Some(text) = name.to_str() else { continue };
        if is_outer_cargo(text) {
            command.env_remove(&name);
        }
    }
    command.stdin(Stdio::null());
    command
}

fn no_cargo(e: &std::io::Error) -> CrateError {
    CrateError::NoCargo {
        detail: e.to_string(),
    }
}

/// cargo's words without the `error:` at their start.
fn without_prefix(stderr: &str) -> String {
    stderr
        .trim()
        .trim_start_matches("error:")
        .trim()
        .to_string()
}

impl Package {
    /// The package of a Cargo.toml, or of the folder that has it.
    ///
    /// # Errors
    /// There is no such file, cargo does not run or refuses it, or it has no library.
    pub fn find(manifest: &Path) -> Result<Self, CrateError> {
        let path = if manifest.is_dir() {
            manifest.join("Cargo.toml")
        } else {
            manifest.into()
        };
        let manifest = path
            .canonicalize()
            .map_err(|_| CrateError::NoManifest { path: path.clone() })?;
        let bad = |problem: String| CrateError::Manifest {
            path: path.clone(),
            problem,
        };
        let output = cargo()
            .args([
                "metadata",
                "--no-deps",
                "--format-version",
                "1",
                "--manifest-path",
            ])
            .arg(&manifest)
            .output()
            .map_err(|e| no_cargo(&e))?;
        if !output.status.success() {
            return Err(bad(without_prefix(&String::from_utf8_lossy(
                &output.stderr,
            ))));
        }
        let metadata: Metadata = serde_json::from_slice(&output.stdout)
            .map_err(|e| bad(format!("cargo metadata cannot be read: {e}")))?;
        let package = metadata
            .packages
            .into_iter()
            .find(|p| p.manifest_path.canonicalize().is_ok_and(|m| m == manifest))
            .ok_or_else(|| {
                bad("it is a workspace without a package; give one crate's Cargo.toml".into())
            })?;
        let is_library = |t: &Target| {
            t.kind
                .iter()
                .any(|k| matches!(k.as_str(), "lib" | "rlib" | "dylib" | "cdylib"))
        };
        if !package.targets.iter().any(is_library) {
            return Err(bad(format!(
                "`{}` has no library; kernels live in src/lib.rs",
                package.name
            )));
        }
        Ok(Self {
            name: package.name,
            manifest,
            target_dir: metadata.target_directory,
        })
    }

    /// Builds the plug-in; gives its path.
    fn build(
        &self,
        native: Native<'_>,
        progress: &mut dyn FnMut(&str),
    ) -> Result<PathBuf, CrateError> {
        let target_dir = self.target_dir.join("hankel").join("native");
        let flags = native.flags();
        let build = std::iter::once(self.manifest.as_os_str())
            .chain(native.profile().iter().map(OsStr::new))
            .chain(flags.iter().map(OsString::as_os_str));
        let last = LastBuild::of(&target_dir, build)?;
        last.forget_if_overlooked()?;
        let began = SystemTime::now();
        let mut command = cargo();
        command
            .args(["rustc", "--lib", "--crate-type", "cdylib"])
            .args(native.profile())
            .args(["--message-format", "json", "--manifest-path"])
            .arg(&self.manifest)
            .arg("--target-dir")
            .arg(&target_dir)
            .arg("--")
            .args(flags);
        let Said {
            status,
            stdout: messages,
            stderr: words,
        } = follow(&mut command, progress).map_err(|e| no_cargo(&e))?;
        let mut diagnostics = String::new();
        let mut library = None;
        for line in messages.lines().filter(|l| !l.is_empty()) {
            match serde_json::from_str(line) {
                Ok(Message::Compiler { message }) if message.level == "error" => {
                    diagnostics.push_str(&message.rendered.unwrap_or_default());
                }
                Ok(Message::Artifact {
                    manifest_path,
                    target,
                    filenames,
                }) if manifest_path
                    .canonicalize()
                    .is_ok_and(|m| m == self.manifest)
                    && target.crate_types.iter().any(|t| t == "cdylib") =>
                {
                    let dynamic = |p: &PathBuf| {
                        p.extension()
                            .is_some_and(|e| e == std::env::consts::DLL_EXTENSION)
                    };
                    library = filenames.into_iter().find(dynamic);
                }
                _ => {}
            }
        }
        match library {
            Some(library) if status.success() => {
                let sources = read_for(&library).into_iter();
                let sources = sources.filter(|path| !path.starts_with(&target_dir));
                last.record(sources, &messages, &[], began)?;
                Ok(library)
            }
            _ => Err(CrateError::Build {
                package: self.name.clone(),
                diagnostics: if diagnostics.is_empty() {
                    without_prefix(&words)
                } else {
                    diagnostics
                },
            }),
        }
    }
}

/// What cargo read to build `library`, apart from packages of registries: the rule that it writes beside it for
/// `make`. A space in a path follows a backslash.
fn read_for(library: &Path) -> Vec<PathBuf> {
    let Ok(rules) = input::read_text(&library.with_extension("d"), MOST_BYTES_OF_RULES) else {
        return Vec::new();
    };
    let mut paths = Vec::new();
    for (_, sources) in rules.lines().filter_map(|rule| rule.split_once(": ")) {
        let mut path = String::new();
        for word in sources.split(' ') {
            path.push_str(word);
            if path.ends_with('\\') {
                path.pop();
                path.push(' ');
            } else {
                paths.push(PathBuf::from(std::mem::take(&mut path)));
            }
        }
    }
    paths
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_cargo_has_read_is_known() {
        let folder = tempfile::tempdir().unwrap();
        let library = folder.path().join("libmine.so");
        let rule = format!("{}: /a/src/lib.rs /b\\ c/deep.rs /d\n", library.display());
        std::fs::write(folder.path().join("libmine.d"), rule).unwrap();
        let paths = ["/a/src/lib.rs", "/b c/deep.rs", "/d"].map(PathBuf::from);
        assert_eq!(read_for(&library), paths);
        assert!(read_for(&folder.path().join("libother.so")).is_empty());
    }

    #[test]
    fn what_an_outer_cargo_sets_is_known() {
        for name in [
            "CARGO_PKG_NAME",
            "CARGO_MANIFEST_DIR",
            "RUSTUP_TOOLCHAIN",
            "DEP_Z_ROOT",
        ] {
            assert!(is_outer_cargo(name), "{name}");
        }
        for name in [
            "CARGO_HOME",
            // It is the caller's: cargo sets none.
            "CARGO_TARGET_DIR",
            "CARGO_NET_OFFLINE",
            "PATH",
            "RUSTFLAGS",
            "CARGO_BUILD_JOBS",
        ] {
            assert!(!is_outer_cargo(name), "{name}");
        }
    }
}
