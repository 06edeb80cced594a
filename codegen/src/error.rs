//! What can go wrong, with the kernel and the construct where they are known, and what to do.

use std::fmt;
use std::io;
use std::path::{Path, PathBuf};

use hankel_dsl::native::describe::{ConstantValue, Scalar};
use hankel_system::overlooked::RecordError;

use crate::diagnostics::Diagnostic;

/// Result with this crate's [`Error`].
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// A step from source to text.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Step {
    /// rust-gpu: Rust to SPIR-V.
    Compile,
    /// Reading the binary.
    Read,
    /// Looking for what rust-gpu makes something else of.
    Meaning,
    /// spirv-val.
    Validate,
    /// spirv-opt.
    Optimise,
    /// Comparing the module with the kernel's description.
    Describe,
    /// naga's SPIR-V reader.
    Parse,
    /// naga's validator.
    Check,
    /// Giving bindings their places in a language.
    Place,
    /// naga's writer for a language.
    Write(crate::Language),
    /// Reading back what was written.
    Reread(crate::Language),
}

impl fmt::Display for Step {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Compile => f.write_str("rust-gpu"),
            Self::Read => f.write_str("reading SPIR-V"),
            Self::Meaning => f.write_str("what rust-gpu makes of it"),
            Self::Validate => f.write_str("spirv-val"),
            Self::Optimise => f.write_str("spirv-opt"),
            Self::Describe => f.write_str("comparing SPIR-V with the kernel's description"),
            Self::Parse => f.write_str("naga's SPIR-V reader"),
            Self::Check => f.write_str("naga's validator"),
            Self::Place => f.write_str("placing the bindings"),
            Self::Write(language) => write!(f, "naga's {language} writer"),
            Self::Reread(language) => write!(f, "reading the generated {language}"),
        }
    }
}

/// A step that failed on one kernel.
#[derive(Clone, Debug, PartialEq)]
pub struct Failure {
    /// The entry point's name.
    pub kernel: String,
    /// Which step.
    pub step: Step,
    /// The instruction, expression or variable that it stumbled over, where it says so.
    pub construct: Option<String>,
    /// What the tool said.
    pub message: String,
    /// The tool panicked.
    pub panicked: bool,
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if matches!(self.step, Step::Meaning | Step::Place) {
            if let Some(place) = &self.construct {
                write!(f, "{place}: ")?;
            }
            return write!(f, "kernel `{}`: {}", self.kernel, self.message);
        }
        let how = if self.panicked { "panicked" } else { "failed" };
        write!(f, "kernel `{}`: {} {how}", self.kernel, self.step)?;
        if let Some(construct) = &self.construct {
            write!(f, " at {construct}")?;
        }
        write!(f, ": {}", self.message)
    }
}

impl std::error::Error for Failure {}

/// A failure of this crate.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A file or folder could not be read or written.
    #[error("cannot {action} {}", path.display())]
    Io {
        /// What was being done.
        action: &'static str,
        /// To what.
        path: PathBuf,
        /// Why not.
        source: io::Error,
    },
    /// A program did not start.
    #[error("cannot run `{}`", program.display())]
    Run {
        /// The program.
        program: PathBuf,
        /// Why not.
        source: io::Error,
    },
    /// A Cargo.toml that is no kernel crate's.
    #[error("{}: {problem}", path.display())]
    Manifest {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        problem: String,
    },
    /// The compiler's `core` is none that the patch for shaders fits.
    #[error("{}: the compiler has another `core` than the one that is patched for shaders", path.display())]
    Library {
        /// The file that differs.
        path: PathBuf,
    },
    /// What a kernel crate is made from cannot be told.
    #[error("{}: {problem}", path.display())]
    Inputs {
        /// The file or folder.
        path: PathBuf,
        /// What is wrong with it.
        problem: String,
    },
    /// rust-gpu or rustc rejected the kernel crate.
    #[error("{} does not compile to SPIR-V{}{}\n{output}", manifest.display(),
        kernel.as_ref().map(|name| format!(" (kernel `{name}`)")).unwrap_or_default(),
        if *panicked { ": rust-gpu panicked" } else { "" })]
    Compile {
        /// The crate's Cargo.toml.
        manifest: PathBuf,
        /// The entry point that the diagnostics name.
        kernel: Option<String>,
        /// rust-gpu panicked, as opposed to reporting an error.
        panicked: bool,
        /// What rustc printed.
        output: String,
    },
    /// The kernel crate's own source has what no shader can have.
    #[error("{}", .0.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n"))]
    Source(Vec<Diagnostic>),
    /// The compiler made no module for a kernel of the description.
    #[error("{} has no SPIR-V entry point `{kernel}`; it has: {}", manifest.display(), list(found))]
    NoEntryPoint {
        /// The crate's Cargo.toml.
        manifest: PathBuf,
        /// The kernel.
        kernel: String,
        /// The entry points that there are.
        found: Vec<String>,
    },
    /// A step failed on one kernel.
    #[error(transparent)]
    Kernel(#[from] Failure),
    /// Several kernels failed.
    #[error("{} kernels failed\n{}", .0.len(),
        .0.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n"))]
    Kernels(Vec<Failure>),
    /// SPIR-V that was not made from the present sources.
    #[error("the SPIR-V at hand is not made from the present sources: {reason}")]
    Stale {
        /// What does not match.
        reason: String,
    },
    /// The committed SPIR-V cannot be read.
    #[error("{}: {problem}", path.display())]
    Bundle {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        problem: String,
    },
    /// No kernel matches.
    #[error("no kernel is named `{name}`; there are: {}", list(known))]
    UnknownKernel {
        /// What was asked for.
        name: String,
        /// What there is.
        known: Vec<String>,
    },
    /// No function of a library matches.
    #[error("no function is named `{name}`; there are: {}", list(known))]
    UnknownFunction {
        /// What was asked for.
        name: String,
        /// What there is.
        known: Vec<String>,
    },
    /// No such language.
    #[error("no target is named `{name}`; there are: {}", list(known))]
    UnknownTarget {
        /// What was asked for.
        name: String,
        /// What there is.
        known: Vec<String>,
    },
    /// No such specialisation constant.
    #[error(
        "no kernel that is built has a constant `{name}`; there are: {}",
        list(known)
    )]
    UnknownConstant {
        /// What was asked for.
        name: String,
        /// What there is.
        known: Vec<String>,
    },
    /// A specialisation constant's value is not of its type.
    #[error("constant `{name}` is {}, which `{value}` is not", ConstantValue::kind(*scalar))]
    ConstantType {
        /// The constant.
        name: String,
        /// What was given.
        value: ConstantValue,
        /// Its type.
        scalar: Scalar,
    },
    /// A variant that cannot be made.
    #[error("variant `{suffix}`: {problem}")]
    Variant {
        /// The end of its kernels' names.
        suffix: String,
        /// Why not.
        problem: String,
    },
    /// A value of an option that does not exist.
    #[error("{option} `{value}` cannot be used: {expected}")]
    Option {
        /// The option.
        option: &'static str,
        /// What was given.
        value: String,
        /// What may be given.
        expected: &'static str,
    },
    /// What hankel did not write is where a file must go.
    #[error("{} is in the way: {}", path.display(), match kind {
        Some(kind) => format!("it is {kind}"),
        None => "hankel did not write it, or it was edited since".to_owned(),
    })]
    InTheWay {
        /// The file.
        path: PathBuf,
        /// What it is, where it is no regular file.
        kind: Option<&'static str>,
    },
    /// A folder holds what another kind of build wrote.
    #[error("{} has {record}: it holds {holds}", path.display())]
    OtherKind {
        /// The folder.
        path: PathBuf,
        /// The file that says so.
        record: &'static str,
        /// What it holds.
        holds: &'static str,
    },
    /// The record of a folder of libraries is missing or damaged.
    #[error("{}: {problem}", path.display())]
    Record {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        problem: String,
    },
    /// What should be a folder is none.
    #[error("{} is {kind}, and a folder is expected: generated files are in one", path.display())]
    NotAFolder {
        /// What was given.
        path: PathBuf,
        /// What it is.
        kind: &'static str,
    },
    /// Another process does not stop changing a folder.
    #[error("{} has been locked by another hankel for {seconds} s", path.display())]
    Busy {
        /// The folder.
        path: PathBuf,
        /// How long it was waited for.
        seconds: u64,
    },
    /// A file that is no regular file, no text, or larger than it can be.
    #[error("cannot read {}: {problem}", path.display())]
    NotAFile {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        problem: String,
    },
    /// Two kernels with one name.
    #[error("two kernels are named `{name}`")]
    DuplicateKernel {
        /// The name.
        name: String,
    },
    /// Structures of one name and different layouts in one header.
    #[error("kernels use two structures named `{name}` with different layouts")]
    DuplicateLayout {
        /// The name.
        name: String,
    },
    /// The file with places of bindings is wrong.
    #[error("{place}: {problem}")]
    Bindings {
        /// The file, and the line if it is known.
        place: String,
        /// What is wrong.
        problem: String,
    },
    /// A frame that cannot be written.
    #[error("{what}: {problem}")]
    Frame {
        /// The pass, shader or buffer.
        what: String,
        /// Why not, and what to do.
        problem: String,
    },
    /// hankel.toml is wrong.
    #[error("{}: {problem}", path.display())]
    Budget {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        problem: String,
    },
    /// A folder that another one cannot be compared with.
    #[error("{}: {problem}", path.display())]
    Compared {
        /// The folder.
        path: PathBuf,
        /// What is wrong with it.
        problem: String,
    },
    /// A function of a library has no form in other languages.
    #[error("{0}")]
    Function(#[from] crate::functions::Refusal),
    /// A library's signatures changed, and its number did not.
    #[error("library `{library}` has API {api} as before, but its signatures changed: {}", changes.join("; "))]
    Api {
        /// The library.
        library: String,
        /// Its number.
        api: u32,
        /// What changed.
        changes: Vec<String>,
    },
    /// A crate without libraries.
    #[error("`{name}` has no library of functions")]
    NoLibrary {
        /// The crate.
        name: String,
    },
    /// A crate cannot be made there.
    #[error("cannot make a kernel crate in {}: {problem}", path.display())]
    Scaffold {
        /// The folder.
        path: PathBuf,
        /// Why not.
        problem: String,
    },
}

impl Error {
    /// What the user can do about it, as a sentence or two.
    pub fn advice(&self) -> Option<String> {
        Some(match self {
            Self::Kernel(failure) => failure.advice(),
            Self::Kernels(failures) => failures.first()?.advice(),
            Self::Compile { panicked: true, .. } => {
                "rust-gpu met something it has no rule for: undo the last edit, or write the \
                 construct in plainer terms (no trait objects, no slices of arrays, no i128)."
                    .into()
            }
            Self::Compile { .. } => "Correct the kernel where the compiler points.".into(),
            Self::Source(_) => return None,
            Self::NoEntryPoint { .. } => {
                "List the function in the crate's `hankel_dsl::kernels!` and give it `#[kernel]`."
                    .into()
            }
            Self::Stale { .. } => {
                "Install rust-gpu's compiler (`hankel toolchain install`): then the SPIR-V is made \
                 from the sources. Or undo the edit of the kernels."
                    .into()
            }
            Self::Bundle { .. } => {
                "Take the folder from version control again, or write it anew with rust-gpu's \
                 compiler installed."
                    .into()
            }
            Self::UnknownKernel { .. } => {
                "Name one of these, or part of a name with `*`; `hankel list` shows them.".into()
            }
            Self::UnknownFunction { .. } => "Name one of these, or part of a name with `*`.".into(),
            Self::InTheWay {
                kind: None | Some("a FIFO" | "a socket" | "a device"),
                ..
            } => "Move it away or choose another output folder; with `--force` it is overwritten."
                .into(),
            Self::InTheWay { .. } => {
                "Move it away or choose another output folder: hankel follows no links below it."
                    .into()
            }
            Self::NotAFolder { .. } => "Give the path of a folder, or move what is there away.".into(),
            Self::OtherKind { .. } => {
                "Shaders and libraries of functions are built into folders of their own: give another one."
                    .into()
            }
            Self::Record { .. } => {
                "Restore the file, or build the libraries again with `hankel build --form functions`."
                    .into()
            }
            Self::Busy { .. } => "Wait for it, or end it, and try again.".into(),
            Self::DuplicateKernel { .. } | Self::DuplicateLayout { .. } => {
                "Rename one of them.".into()
            }
            Self::Inputs { .. } => {
                "Everything that a kernel is made from must be a file that can be read again."
                    .into()
            }
            Self::Manifest { .. } => "Give the path of a kernel crate's Cargo.toml.".into(),
            Self::Library { .. } => {
                "Use the compiler that this Hankel is for: `hankel toolchain status` says which, and \
                 `hankel toolchain install` installs it."
                    .into()
            }
            Self::Run { .. } => {
                "`hankel toolchain status` says which compiler is used and what is missing.".into()
            }
            Self::Bindings { .. } => {
                "Write `[KERNEL.PARAMETER]`, named as in manifest.json, and below it places in hlsl \
                 (register, space), wgsl (group, binding), msl (slot), glsl or essl310 (binding)."
                    .into()
            }
            Self::Compared { .. } => "Give two folders that `hankel build --out` made, both with \
                 the same `--form`, by this version or one with the same format."
                .into(),
            Self::Variant { .. } => "Choose another suffix, or constants of one kernel: \
                 `hankel list --bindings` shows them."
                .into(),
            Self::ConstantType { .. } => "Give a value of its type.".into(),
            Self::UnknownConstant { .. } => "Give the constant's name in the kernel.".into(),
            Self::Function(_) => {
                "Write it in the part of Rust that `#[function]`'s documentation names.".into()
            }
            Self::Api { api, .. } => {
                format!(
                    "Say `api: {}` in its `library!`, so that its users see it.",
                    api + 1
                )
            }
            Self::NoLibrary { .. } => "Name its functions in a `hankel_dsl::library!`.".into(),
            Self::Io { .. }
            | Self::NotAFile { .. }
            | Self::UnknownTarget { .. }
            | Self::Option { .. }
            | Self::Frame { .. }
            | Self::Budget { .. }
            | Self::Scaffold { .. } => return None,
        })
    }
}

impl Failure {
    /// What the user can do about it.
    pub fn advice(&self) -> String {
        match self.step {
            Step::Compile => "Correct the kernel where the compiler points.",
            Step::Meaning => {
                "Write it as the message says: what would be written means something else."
            }
            Step::Place => {
                "Give one of them another place in the file of `--bindings`, take its line out, or \
                 change the place of all (`--hlsl-space`, `--register-base`, `--wgsl-group`, \
                 `--msl-slot-base`, `--glsl-binding-base`)."
            }
            Step::Read => "The file is damaged or no SPIR-V: make it again.",
            Step::Validate if is_of_textures(self) => {
                "A texture or sampler cannot be chosen while the kernel runs, nor kept in an array or a variable: \
                 read from each, and choose between what was read."
            }
            Step::Validate if self.message.contains("capability") => {
                "The module uses something whose capability rust-gpu was not told of; keep to what \
                 the DSL offers."
            }
            Step::Validate | Step::Optimise => {
                "rust-gpu made SPIR-V that breaks the rules: write the construct in plainer terms, \
                 and report it to rust-gpu."
            }
            Step::Describe => {
                "Description and SPIR-V come from different sources, or a field's type has another \
                 layout on the GPU: rebuild, or use f32, u32, i32 and glam vectors."
            }
            // No language but SPIR-V has a word for them.
            Step::Check
                if self.message.contains("literal is NaN")
                    || self.message.contains("literal is infinite") =>
            {
                "The kernel has a number that is infinite or NaN, which WGSL has no literal for: write `f32::MAX` \
                 for `f32::INFINITY`, and an `Option` or a number of your own for NaN. Comparisons with infinity, \
                 `is_finite` and `is_nan` have a form in every language. Or build only `--target spirv`."
            }
            Step::Parse | Step::Check => {
                "naga does not read this construct: NaN and infinity literals, 64-bit atomics and \
                 `switch` fall-through are the usual ones. Write it differently, or build only \
                 `--target spirv`."
            }
            Step::Write(_) | Step::Reread(_) => {
                "Leave this language out with `--target`, or avoid the construct."
            }
        }
        .into()
    }
}

/// Whether spirv-val's words are about textures or samplers that are values.
fn is_of_textures(failure: &Failure) -> bool {
    let construct = failure.construct.as_deref().unwrap_or_default();
    construct.contains("_ptr_UniformConstant") || failure.message.contains("OpTypeImage-06924")
}

fn list(names: &[String]) -> String {
    if names.is_empty() {
        "none".into()
    } else {
        names.join(", ")
    }
}

/// Adds what was being done, and to which file, to an I/O error.
pub(crate) trait During<T> {
    fn during(self, action: &'static str, path: &Path) -> Result<T>;
}

impl From<RecordError> for Error {
    fn from(error: RecordError) -> Self {
        Self::Io {
            action: error.action,
            path: error.path,
            source: error.source,
        }
    }
}

impl<T> During<T> for io::Result<T> {
    fn during(self, action: &'static str, path: &Path) -> Result<T> {
        self.map_err(|source| Error::Io {
            action,
            path: path.to_owned(),
            source,
        })
    }
}

/// Bytes of stack of a tool: naga calls itself for every level of an expression.
pub(crate) const STACK: usize = 64 << 20;

/// Runs a tool that may panic; a panic's message becomes the error. Nothing is printed.
pub(crate) fn guarded<T>(
    tool: impl FnOnce() -> Result<T, Failure>,
    kernel: &str,
    step: Step,
) -> Result<T, Failure> {
    quiet_panics();
    QUIET.with(|quiet| quiet.set(quiet.get() + 1));
    let tool = std::panic::AssertUnwindSafe(|| stacker::grow(STACK, tool));
    let result = std::panic::catch_unwind(tool);
    QUIET.with(|quiet| quiet.set(quiet.get() - 1));
    result.unwrap_or_else(|payload| {
        let message = payload
            .downcast_ref::<String>()
            .cloned()
            .or_else(|| payload.downcast_ref::<&str>().map(ToString::to_string))
            .unwrap_or_else(|| "no message".into());
        let at = PANICKED_AT.with(|at| at.take());
        Err(Failure {
            kernel: kernel.into(),
            step,
            construct: at,
            message,
            panicked: true,
        })
    })
}

thread_local! {
    static QUIET: std::cell::Cell<u32> = const { std::cell::Cell::new(0) };
    static PANICKED_AT: std::cell::Cell<Option<String>> = const { std::cell::Cell::new(None) };
}

/// Panics inside [`guarded`] are reported as errors, so the hook keeps silent about them.
fn quiet_panics() {
    static ONCE: std::sync::Once = std::sync::Once::new();
    ONCE.call_once(|| {
        let before = std::panic::take_hook();
        std::panic::set_hook(Box::new(move |info| {
            if QUIET.with(|quiet| quiet.get()) == 0 {
                return before(info);
            }
            // The file's name without the folders: those are the build machine's.
            let at = info.location().map(|place| {
                let file = place.file().rsplit(['/', '\\']).next().unwrap_or_default();
                format!("{file}:{}", place.line())
            });
            PANICKED_AT.with(|slot| slot.set(at));
        }));
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_becomes_an_error_that_names_kernel_and_step() {
        let error =
            guarded::<()>(|| panic!("index out of range"), "shade", Step::Parse).unwrap_err();
        assert!(error.panicked);
        let text = error.to_string();
        assert!(
            text.contains("kernel `shade`: naga's SPIR-V reader panicked at error.rs:"),
            "{text}"
        );
        assert!(text.ends_with("index out of range"), "{text}");
    }

    #[test]
    fn every_step_gives_advice() {
        for step in [
            Step::Compile,
            Step::Read,
            Step::Validate,
            Step::Describe,
            Step::Parse,
        ] {
            let failure = Failure {
                kernel: "k".into(),
                step,
                construct: None,
                message: "m".into(),
                panicked: false,
            };
            assert!(failure.advice().ends_with(['.', '`']), "{step}");
        }
    }
}
