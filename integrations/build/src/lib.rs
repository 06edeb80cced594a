//! Shaders of a kernel crate for a build script.
//!
//! ```no_run
//! // build.rs
//! hankel_build::Build::of("../kernels/Cargo.toml").run_or_exit();
//! ```
//!
//! ```ignore
//! // main.rs
//! mod shaders {
//!     include!(concat!(env!("HANKEL_SHADERS"), "/include/hankel.rs"));
//!     include!(concat!(env!("HANKEL_SHADERS"), "/include/hankel_wgpu.rs")); // for users of wgpu
//! }
//! ```
//!
//! The module has a module for each kernel, with its texts, entry points, workgroup size and
//! bindings, and the structures of its buffers. The build script runs again when a file changes that
//! the shaders are made from.
//!
//! [`Build::functions_of`] makes libraries of functions instead, to include and call; in Rust:
//!
//! ```ignore
//! mod shadows {
//!     include!(concat!(env!("HANKEL_FUNCTIONS"), "/rust/hankel_shadows.rs"));
//! }
//! ```
//!
//! The work is done by the program `hankel`: the one that the environment variable `HANKEL` names, or
//! else the one in `PATH`. This crate only starts it, so that a build script compiles in seconds.

use std::collections::{BTreeMap, BTreeSet};
use std::ffi::OsString;
use std::fmt;
use std::io;
use std::path::{Component, Path, PathBuf};
use std::process::Command;
use std::sync::{Mutex, PoisonError};

use sha2::{Digest, Sha256};

/// The environment variable that names the program.
const PROGRAM: &str = "HANKEL";

/// What is built.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Form {
    Kernels,
    Functions,
}

impl Form {
    /// What the including crate finds the folder by.
    fn variable(self) -> &'static str {
        match self {
            Self::Kernels => "HANKEL_SHADERS",
            Self::Functions => "HANKEL_FUNCTIONS",
        }
    }

    /// The file that says what a folder holds.
    fn record(self) -> &'static str {
        match self {
            Self::Kernels => "manifest.json",
            Self::Functions => "functions.json",
        }
    }
}

/// Which shaders are wanted.
#[derive(Clone, Debug)]
pub struct Build {
    form: Form,
    manifest: Option<PathBuf>,
    committed: Option<PathBuf>,
    arguments: Vec<OsString>,
    /// What a manifest records of the arguments that have a method here.
    recorded: Recorded,
    /// Whether there are no other arguments.
    is_recorded: bool,
    bindings: Option<PathBuf>,
    program: Option<PathBuf>,
    name: Option<String>,
}

/// Options of a build as `manifest.json` and `functions.json` have them.
#[derive(Clone, Debug, Default, PartialEq, Eq, serde::Deserialize)]
struct Recorded {
    #[serde(default)]
    kernels: Vec<String>,
    #[serde(default)]
    targets: Vec<String>,
    #[serde(default)]
    placement: BTreeMap<String, serde_json::Value>,
    #[serde(default)]
    prefix: Option<String>,
    #[serde(default)]
    functions: Vec<String>,
}

/// Why there are no shaders.
#[derive(Debug)]
pub enum BuildError {
    /// A variable that cargo sets for build scripts is not there.
    NoBuildScript(&'static str),
    /// An earlier build of this build script has the name.
    SameName(String),
    /// No name of a folder and a variable.
    Name(String),
    /// The program is not there, or does not start.
    NoProgram {
        /// Its name or path.
        program: PathBuf,
        /// Why it does not start.
        source: io::Error,
    },
    /// The program failed.
    Failed {
        /// What it said.
        said: String,
        /// Its exit code: 1, a kernel; 2, an argument; 3, the machine.
        code: Option<i32>,
    },
    /// A file that was read or written.
    File {
        /// Which.
        path: PathBuf,
        /// What is wrong with it.
        problem: String,
    },
}

impl fmt::Display for BuildError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoBuildScript(name) => write!(
                f,
                "{name} is not set: call hankel_build in a build script, which cargo runs"
            ),
            Self::SameName(name) => write!(
                f,
                "two builds of this build script are named `{name}`, and the second would replace what the first made: \
                 give each a name with Build::named"
            ),
            Self::Name(name) => write!(
                f,
                "a build cannot be named `{name}`: names are of small letters, digits and `_`, and begin with a letter"
            ),
            Self::NoProgram { program, source } => write!(
                f,
                "cannot run `{}`: {source}; install it (cargo install --path cli, in Hankel's \
                 repository), or name it in the environment variable {PROGRAM}",
                program.display()
            ),
            Self::Failed { said, code } => {
                let code = code.map_or("a signal".into(), |code| format!("exit code {code}"));
                write!(f, "hankel build failed ({code}):\n{}", said.trim_end())
            }
            Self::File { path, problem } => write!(f, "{}: {problem}", path.display()),
        }
    }
}

impl std::error::Error for BuildError {}

impl Build {
    /// All kernels of the crate whose Cargo.toml is at `manifest`, in every language.
    pub fn of(manifest: impl Into<PathBuf>) -> Self {
        Self {
            manifest: Some(manifest.into()),
            ..Self::built_in()
        }
    }

    /// The kernels that the program brings: moment shadow maps. Nothing is compiled for them.
    pub fn built_in() -> Self {
        Self {
            form: Form::Kernels,
            manifest: None,
            committed: None,
            arguments: Vec::new(),
            recorded: Recorded::default(),
            is_recorded: true,
            bindings: None,
            program: None,
            name: None,
        }
    }

    /// A name for a build script with several builds: of the folder in `OUT_DIR`, instead of `shaders` or `functions`, and
    /// in the variable that it is found by: `HANKEL_SKY` for `sky`. Small letters, digits and `_`.
    #[must_use]
    pub fn named(mut self, name: &str) -> Self {
        self.name = Some(name.to_owned());
        self
    }

    /// The libraries of functions of the crate whose Cargo.toml is at `manifest`, in every form. The
    /// folder is in `HANKEL_FUNCTIONS`. No kernel is compiled for them.
    pub fn functions_of(manifest: impl Into<PathBuf>) -> Self {
        Self {
            form: Form::Functions,
            ..Self::of(manifest)
        }
    }

    /// The libraries of functions that the program brings: moment shadow maps.
    pub fn built_in_functions() -> Self {
        Self {
            form: Form::Functions,
            ..Self::built_in()
        }
    }

    /// Libraries: what the names of functions begin with, instead of `hankel`.
    #[must_use]
    pub fn prefix(mut self, prefix: &str) -> Self {
        self.recorded.prefix = Some(prefix.to_owned());
        self.pass("--prefix").pass(prefix)
    }

    /// Libraries: only functions of this name, where `*` stands for any letters, and what they call. May be called
    /// again.
    #[must_use]
    pub fn function(mut self, pattern: &str) -> Self {
        self.recorded.functions.push(pattern.to_owned());
        self.pass("--function").pass(pattern)
    }

    /// Only kernels of this name, where `*` stands for any letters. May be called again.
    #[must_use]
    pub fn kernel(mut self, pattern: &str) -> Self {
        self.recorded.kernels.push(pattern.to_owned());
        self.pass("--kernel").pass(pattern)
    }

    /// Only this language, by its name on the command line: `wgsl`, `spirv`, … May be called again.
    #[must_use]
    pub fn target(mut self, language: &str) -> Self {
        self.recorded.targets.push(language.to_owned());
        self.pass("--target").pass(language)
    }

    /// HLSL: the register space of every binding.
    #[must_use]
    pub fn hlsl_space(self, space: u8) -> Self {
        self.placed("hlsl_space", space.into())
    }

    /// HLSL: the first register of every class (t, u, b, s).
    #[must_use]
    pub fn register_base(self, register: u16) -> Self {
        self.placed("register_base", register)
    }

    /// WGSL: the group of every binding.
    #[must_use]
    pub fn wgsl_group(self, group: u8) -> Self {
        self.placed("wgsl_group", group.into())
    }

    /// MSL: the first slot of buffers, of textures and of samplers.
    #[must_use]
    pub fn msl_slot_base(self, slot: u8) -> Self {
        self.placed("msl_slot_base", slot.into())
    }

    /// GLSL 4.50 and GLSL ES 3.10: what is added to every binding.
    #[must_use]
    pub fn glsl_binding_base(self, binding: u8) -> Self {
        self.placed("glsl_binding_base", binding.into())
    }

    /// An option of placement, by its name in the manifest.
    fn placed(mut self, option: &str, number: u16) -> Self {
        self.recorded.placement.insert(option.into(), number.into());
        self.pass(format!("--{}={number}", option.replace('_', "-")))
    }

    /// A TOML file with places of single bindings, from the including crate's folder.
    #[must_use]
    pub fn bindings(mut self, file: impl Into<PathBuf>) -> Self {
        self.bindings = Some(file.into());
        self
    }

    /// Any other argument of `hankel build`; `hankel build --help` has them.
    #[must_use]
    pub fn argument(mut self, argument: impl Into<OsString>) -> Self {
        self.is_recorded = false;
        self.pass(argument)
    }

    fn pass(mut self, argument: impl Into<OsString>) -> Self {
        self.arguments.push(argument.into());
        self
    }

    /// A folder that `hankel build` wrote and that is under version control. It is used where there
    /// is no program `hankel`: as it stands, if every file is as its manifest says and it was built with the options
    /// given here, and with a warning, since only `hankel check` can tell whether it follows from the present
    /// sources. Options are not compared where there are others, by [`Build::argument`], and the file of
    /// [`Build::bindings`] never is.
    #[must_use]
    pub fn committed(mut self, folder: impl Into<PathBuf>) -> Self {
        self.committed = Some(folder.into());
        self
    }

    /// The program, instead of what `HANKEL` or `PATH` says.
    #[must_use]
    pub fn program(mut self, program: impl Into<PathBuf>) -> Self {
        self.program = Some(program.into());
        self
    }

    /// Builds, and tells cargo: what to watch, and in `HANKEL_SHADERS` where the shaders are, or in
    /// `HANKEL_FUNCTIONS` where the libraries are. Gives that folder.
    ///
    /// # Errors
    ///
    /// [`BuildError`].
    pub fn run(&self) -> Result<PathBuf, BuildError> {
        let variable = |name| std::env::var_os(name).ok_or(BuildError::NoBuildScript(name));
        let here = PathBuf::from(variable("CARGO_MANIFEST_DIR")?);
        let out = PathBuf::from(variable("OUT_DIR")?);
        self.claim(&out)?;
        let (folder, lines) = self.make(&here, &out)?;
        println!("cargo::rerun-if-env-changed={PROGRAM}");
        for line in lines {
            println!("cargo::{line}");
        }
        println!("cargo::rustc-env={}={}", self.variable(), folder.display());
        Ok(folder)
    }

    /// Builds, and ends the build script with the error's text if there are no shaders.
    pub fn run_or_exit(&self) {
        if let Err(error) = self.run() {
            for line in error.to_string().lines() {
                println!("cargo::error={line}");
            }
            std::process::exit(1);
        }
    }

    /// The name of the folder.
    fn folder(&self) -> &str {
        let default = match self.form {
            Form::Kernels => "shaders",
            Form::Functions => "functions",
        };
        self.name.as_deref().unwrap_or(default)
    }

    /// What the including crate finds the folder by.
    fn variable(&self) -> String {
        match &self.name {
            Some(name) => format!("HANKEL_{}", name.to_uppercase()),
            None => self.form.variable().to_owned(),
        }
    }

    /// Refuses a name that another build of this build script has, or that cannot be one.
    fn claim(&self, out: &Path) -> Result<(), BuildError> {
        static CLAIMED: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());
        let name = self.folder();
        let is_name = name.starts_with(|it: char| it.is_ascii_lowercase())
            && name
                .chars()
                .all(|it| it.is_ascii_lowercase() || it.is_ascii_digit() || it == '_');
        if !is_name || name == "target" {
            return Err(BuildError::Name(name.to_owned()));
        }
        let mut claimed = CLAIMED.lock().unwrap_or_else(PoisonError::into_inner);
        match claimed.insert(out.join(name)) {
            true => Ok(()),
            false => Err(BuildError::SameName(name.to_owned())),
        }
    }

    /// The folder of the shaders, and what cargo is told.
    fn make(&self, here: &Path, out: &Path) -> Result<(PathBuf, Vec<String>), BuildError> {
        let named = self
            .program
            .clone()
            .or_else(|| std::env::var_os(PROGRAM).map(Into::into));
        let program = named.clone().unwrap_or_else(|| "hankel".into());
        let name = self.folder();
        let folder = out.join(name);
        let dependencies = out.join(format!("{name}.d"));
        let environment = out.join(format!("{name}.env"));
        let mut command = Command::new(&program);
        // What cargo sets for this build script is not meant for the cargo that hankel runs; and the
        // target folder in use is locked until this script ends.
        for (name, _) in std::env::vars_os() {
            if name.to_str().is_some_and(is_of_this_build) {
                command.env_remove(name);
            }
        }
        command
            .env("CARGO_TARGET_DIR", out.join("target"))
            .args(["--quiet", "build"]);
        if self.form == Form::Functions {
            command.args(["--form", "functions"]);
        }
        if let Some(manifest) = &self.manifest {
            command.arg("--manifest-path").arg(here.join(manifest));
        }
        command
            .arg("--out")
            .arg(&folder)
            .arg("--depfile")
            .arg(&dependencies)
            .arg("--environment")
            .arg(&environment)
            .args(&self.arguments);
        if let Some(file) = &self.bindings {
            command.arg("--bindings").arg(here.join(file));
        }
        let output = match command.output() {
            Ok(output) => output,
            Err(source) => {
                let missing = named.is_none() && source.kind() == io::ErrorKind::NotFound;
                return match &self.committed {
                    Some(folder) if missing => {
                        let wanted = self.is_recorded.then_some(&self.recorded);
                        as_committed(&here.join(folder), self.form, wanted)
                    }
                    _ => Err(BuildError::NoProgram { program, source }),
                };
            }
        };
        if !output.status.success() {
            return Err(BuildError::Failed {
                said: String::from_utf8_lossy(&output.stderr).into_owned(),
                code: output.status.code(),
            });
        }
        let text = std::fs::read_to_string(&dependencies).map_err(|e| at(&dependencies, e))?;
        let mut lines: Vec<_> = prerequisites(&text)
            .map(|path| format!("rerun-if-changed={path}"))
            .collect();
        if let Some(program) = found(&program) {
            lines.push(format!("rerun-if-changed={}", program.display()));
        }
        let names = std::fs::read_to_string(&environment).map_err(|e| at(&environment, e))?;
        lines.extend(
            names
                .lines()
                .map(|name| format!("rerun-if-env-changed={name}")),
        );
        Ok((folder, lines))
    }
}

/// Where a program lies: where its path says, or else in `PATH`.
fn found(program: &Path) -> Option<PathBuf> {
    if program.components().count() > 1 {
        return Some(program.to_owned());
    }
    let folders = std::env::var_os("PATH")?;
    std::env::split_paths(&folders)
        .map(|folder| folder.join(program))
        .find(|path| path.is_file())
}

/// Whether cargo set a variable for this build script alone.
fn is_of_this_build(name: &str) -> bool {
    const OTHERS: [&str; 12] = [
        "DEBUG",
        "HOST",
        "MAKEFLAGS",
        "NUM_JOBS",
        "OPT_LEVEL",
        "OUT_DIR",
        "PROFILE",
        "RUSTC",
        "RUSTC_LINKER",
        "RUSTDOC",
        "RUSTFLAGS",
        "TARGET",
    ];
    // What says where cargo keeps and gets things stays.
    const KEPT: [&str; 6] = [
        "CARGO_ALIAS_",
        "CARGO_HOME",
        "CARGO_HTTP_",
        "CARGO_NET_",
        "CARGO_REGISTR",
        "CARGO_SOURCE_",
    ];
    let of_cargo = name.starts_with("CARGO") && !KEPT.iter().any(|kept| name.starts_with(kept));
    of_cargo || OTHERS.contains(&name)
}

fn at(path: &Path, problem: impl fmt::Display) -> BuildError {
    BuildError::File {
        path: path.to_owned(),
        problem: problem.to_string(),
    }
}

/// What the first rule of a file in Make's syntax depends on.
fn prerequisites(text: &str) -> impl Iterator<Item = String> {
    let joined = text.replace("\\\n", " ");
    // `$` is doubled and spaces are escaped in Make's syntax; a colon with a space ends the targets.
    let rule = joined.lines().next().unwrap_or_default();
    let all = rule.split_once(": ").map_or("", |(_, all)| all);
    let mut paths = vec![String::new()];
    let mut letters = all.chars().peekable();
    while let Some(letter) = letters.next() {
        let last = paths.len() - 1;
        match letter {
            '\\' if letters
                .peek()
                .is_some_and(|next| matches!(next, ' ' | '#' | '\\')) =>
            {
                paths[last].extend(letters.next());
            }
            '$' if letters.peek() == Some(&'$') => paths[last].extend(letters.next()),
            ' ' => paths.push(String::new()),
            other => paths[last].push(other),
        }
    }
    paths.into_iter().filter(|path| !path.is_empty())
}

/// The folder that `cargo install` puts programs into, if it is there.
fn cargo_programs() -> Option<PathBuf> {
    let home = std::env::var_os("CARGO_HOME").map(PathBuf::from);
    let home = home.or_else(|| Some(std::env::home_dir()?.join(".cargo")))?;
    Some(home.join("bin")).filter(|folder| folder.is_dir())
}

/// The first option that is not as it should be.
fn difference(wanted: &Recorded, recorded: &Recorded) -> Option<String> {
    let lists = [
        ("kernels", &wanted.kernels, &recorded.kernels),
        ("targets", &wanted.targets, &recorded.targets),
        ("functions", &wanted.functions, &recorded.functions),
    ];
    for (what, wanted, recorded) in lists {
        if wanted != recorded {
            let all = |list: &[String]| match list {
                [] => "all".to_owned(),
                some => some.join(", "),
            };
            return Some(format!(
                "{what} are {} there, and {} here",
                all(recorded),
                all(wanted)
            ));
        }
    }
    let names = wanted.placement.keys().chain(recorded.placement.keys());
    for name in names.filter(|name| *name != "bindings") {
        // 0 is where everything is by itself.
        let number = |of: &Recorded| of.placement.get(name).filter(|it| **it != 0).cloned();
        let [wanted, recorded] = [wanted, recorded].map(number);
        if wanted != recorded {
            let number = |it: Option<serde_json::Value>| it.map_or("0".into(), |it| it.to_string());
            return Some(format!(
                "{name} is {} there, and {} here",
                number(recorded),
                number(wanted)
            ));
        }
    }
    let prefix = |of: &Recorded| of.prefix.clone().filter(|it| it != "hankel");
    (prefix(wanted) != prefix(recorded)).then(|| {
        let word = |of| prefix(of).unwrap_or_else(|| "hankel".into());
        format!(
            "the prefix is {} there, and {} here",
            word(recorded),
            word(wanted)
        )
    })
}

/// A committed folder, if nothing in it was changed or lost.
fn as_committed(
    folder: &Path,
    form: Form,
    wanted: Option<&Recorded>,
) -> Result<(PathBuf, Vec<String>), BuildError> {
    #[derive(serde::Deserialize)]
    struct Record {
        files: BTreeMap<String, File>,
        /// Of shaders; those of libraries stand beside.
        #[serde(default)]
        options: Option<Recorded>,
        #[serde(flatten)]
        of_libraries: OfLibraries,
    }
    #[derive(serde::Deserialize)]
    struct OfLibraries {
        #[serde(default)]
        prefix: Option<String>,
        #[serde(default)]
        functions: Vec<String>,
    }
    /// Of shaders, and of libraries.
    #[derive(serde::Deserialize)]
    #[serde(untagged)]
    enum File {
        Entry { sha256: String },
        Hash(String),
    }
    let path = folder.join(form.record());
    let text = std::fs::read(&path).map_err(|e| at(&path, e))?;
    let record: Record = serde_json::from_slice(&text).map_err(|e| at(&path, e))?;
    let recorded = record.options.unwrap_or_else(|| Recorded {
        prefix: record.of_libraries.prefix,
        functions: record.of_libraries.functions,
        ..Recorded::default()
    });
    if let Some(difference) = wanted.and_then(|wanted| difference(wanted, &recorded)) {
        return Err(at(
            &path,
            format!(
                "it was built with other options than those of the build script: {difference}; build the folder anew \
                 with hankel"
            ),
        ));
    }
    let mut lines = vec![
        format!("rerun-if-changed={}", path.display()),
        // Where the program may come to be.
        "rerun-if-env-changed=PATH".to_owned(),
    ];
    lines.extend(cargo_programs().map(|folder| format!("rerun-if-changed={}", folder.display())));
    for (name, file) in &record.files {
        let (File::Entry { sha256 } | File::Hash(sha256)) = file;
        let inside = Path::new(name)
            .components()
            .all(|part| matches!(part, Component::Normal(_)));
        if !inside {
            return Err(at(
                &path,
                format!("`{name}` is not a path inside of the folder"),
            ));
        }
        let path = folder.join(name);
        let bytes = std::fs::read(&path).map_err(|e| at(&path, e))?;
        let hash: String = Sha256::digest(&bytes)
            .iter()
            .map(|byte| format!("{byte:02x}"))
            .collect();
        if hash != *sha256 {
            return Err(at(
                &path,
                "it is not as hankel wrote it; restore it, or build the folder anew with hankel",
            ));
        }
        lines.push(format!("rerun-if-changed={}", path.display()));
    }
    lines.push(format!(
        "warning=there is no program `hankel`: the files of {} are used as they are; `hankel check` \
         tells whether they follow from their sources",
        folder.display()
    ));
    Ok((folder.to_owned(), lines))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_are_read_as_make_reads_them() {
        let text = "/out/a.json: /src/lib.rs \\\n  /a\\ b/$$c.rs /d\\#e.rs\n\n/src/lib.rs:\n";
        let paths: Vec<String> = prerequisites(text).collect();
        assert_eq!(paths, ["/src/lib.rs", "/a b/$c.rs", "/d#e.rs"]);
    }

    #[test]
    fn a_missing_program_is_named() {
        let folder = tempfile::tempdir().expect("a folder");
        let build = Build::of("Cargo.toml").program("/nonexistent/hankel");
        let error = build
            .make(folder.path(), folder.path())
            .unwrap_err()
            .to_string();
        assert!(
            error.contains("/nonexistent/hankel") && error.contains(PROGRAM),
            "{error}"
        );
    }

    /// A program that writes down its arguments stands for hankel.
    #[cfg(unix)]
    #[test]
    fn places_of_bindings_are_arguments() {
        use std::os::unix::fs::PermissionsExt;
        let folder = tempfile::tempdir().expect("a folder");
        let program = folder.path().join("hankel");
        let said = "#!/bin/sh\nfor argument in \"$@\"; do echo \"$argument\" >&2; done\nexit 2\n";
        std::fs::write(&program, said).expect("the folder can be written");
        let mode = std::fs::Permissions::from_mode(0o755);
        std::fs::set_permissions(&program, mode).expect("it can be made a program");
        let build = Build::of("Cargo.toml")
            .program(&program)
            .hlsl_space(1)
            .register_base(2)
            .wgsl_group(3)
            .msl_slot_base(4)
            .glsl_binding_base(5)
            .bindings("places.toml");
        let Err(BuildError::Failed {
            said,
            code: Some(2),
        }) = build.make(folder.path(), folder.path())
        else {
            panic!("the program fails")
        };
        let file = folder.path().join("places.toml");
        let last: Vec<&str> = said.lines().rev().take(7).collect();
        assert_eq!(
            last,
            [
                file.to_str().expect("a name in UTF-8"),
                "--bindings",
                "--glsl-binding-base=5",
                "--msl-slot-base=4",
                "--wgsl-group=3",
                "--register-base=2",
                "--hlsl-space=1",
            ]
        );
    }

    /// The program that a script stands for: writes its arguments to `said`, an empty rule and a variable.
    #[cfg(unix)]
    #[test]
    fn built_in_kernels_need_no_crate_and_follow_the_program() {
        use std::os::unix::fs::PermissionsExt;
        let folder = tempfile::tempdir().expect("a folder");
        let program = folder.path().join("hankel");
        let script = "#!/bin/sh\ncd \"$(dirname \"$0\")\" && echo \"$@\" > said && echo 'a:' > shaders.d && echo SEED > shaders.env\n";
        std::fs::write(&program, script).expect("a script");
        std::fs::set_permissions(&program, std::fs::Permissions::from_mode(0o755))
            .expect("it runs");
        let build = Build::built_in().kernel("vsm").program(&program);
        let (shaders, lines) = build
            .make(folder.path(), folder.path())
            .unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(shaders, folder.path().join("shaders"));
        let watched = format!("rerun-if-changed={}", program.display());
        assert_eq!(lines, [watched, "rerun-if-env-changed=SEED".to_owned()]);
        let said = std::fs::read_to_string(folder.path().join("said")).expect("it ran");
        assert!(
            said.contains("build --out") && said.contains("--kernel vsm"),
            "{said}"
        );
        assert!(!said.contains("--manifest-path"), "{said}");
    }

    #[cfg(unix)]
    #[test]
    fn libraries_are_asked_for_by_their_form() {
        use std::os::unix::fs::PermissionsExt;
        let folder = tempfile::tempdir().expect("a folder");
        let program = folder.path().join("hankel");
        let script = "#!/bin/sh\ncd \"$(dirname \"$0\")\" && echo \"$@\" > said && echo 'a: /b.rs' > functions.d && : > functions.env\n";
        std::fs::write(&program, script).expect("a script");
        std::fs::set_permissions(&program, std::fs::Permissions::from_mode(0o755))
            .expect("it runs");
        let build = Build::built_in_functions()
            .prefix("own")
            .function("mix_*")
            .program(&program);
        let (functions, lines) = build
            .make(folder.path(), folder.path())
            .unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(functions, folder.path().join("functions"));
        assert!(lines.contains(&"rerun-if-changed=/b.rs".to_owned()));
        let said = std::fs::read_to_string(folder.path().join("said")).expect("it ran");
        assert!(said.contains("build --form functions --out"), "{said}");
        assert!(said.contains("--prefix own --function mix_*"), "{said}");
    }

    #[test]
    fn committed_shaders_are_used_whole_or_not_at_all() {
        let folder = tempfile::tempdir().expect("a folder");
        let write = |name: &str, text: &str| {
            std::fs::write(folder.path().join(name), text).expect("the folder can be written");
        };
        let hash: String = Sha256::digest(b"text")
            .iter()
            .map(|b| format!("{b:02x}"))
            .collect();
        let any = None;
        write("a.wgsl", "text");
        write(
            "manifest.json",
            &format!("{{\"files\":{{\"a.wgsl\":{{\"sha256\":\"{hash}\"}}}}}}"),
        );
        let (_, lines) = as_committed(folder.path(), Form::Kernels, any).expect("it is whole");
        assert!(
            lines
                .iter()
                .any(|l| l.starts_with("warning=") && l.contains("hankel check"))
        );
        assert!(
            lines
                .iter()
                .any(|l| l.starts_with("rerun-if-changed=") && l.ends_with("a.wgsl"))
        );

        // The record of libraries has bare hashes.
        let record = format!("{{\"files\":{{\"a.wgsl\":\"{hash}\"}}}}");
        write("functions.json", &record);
        as_committed(folder.path(), Form::Functions, any).expect("it is whole");

        write("a.wgsl", "other");
        as_committed(folder.path(), Form::Functions, any).unwrap_err();
        let error = as_committed(folder.path(), Form::Kernels, any)
            .unwrap_err()
            .to_string();
        assert!(error.contains("a.wgsl"), "{error}");
        let outside = "{\"files\":{\"../b\":{\"sha256\":\"\"}}}";
        write("manifest.json", outside);
        let error = as_committed(folder.path(), Form::Kernels, any)
            .unwrap_err()
            .to_string();
        assert!(error.contains("../b"), "{error}");
    }

    /// As `hankel build --kernel vsm --target wgsl --wgsl-group 2` and `--form functions --prefix own` record them.
    #[test]
    fn committed_shaders_have_the_options_of_the_build() {
        let folder = tempfile::tempdir().expect("a folder");
        let write = |name: &str, text: &str| {
            std::fs::write(folder.path().join(name), text).expect("the folder can be written");
        };
        write(
            "manifest.json",
            r#"{"files": {}, "options": {"kernels": ["vsm"], "targets": ["wgsl"], "bounds_checks": "unchecked",
                "placement": {"wgsl_group": 2}}}"#,
        );
        write(
            "functions.json",
            r#"{"files": {}, "hankel": "0.1.0", "prefix": "own", "functions": ["mix_*"], "libraries": {}}"#,
        );
        let of = |build: &Build| as_committed(folder.path(), build.form, Some(&build.recorded));
        let same = || Build::built_in().kernel("vsm").target("wgsl").wgsl_group(2);
        of(&same()).expect("the options are the same");
        of(&same().register_base(0)).expect("0 is the default");
        let same_library = || Build::built_in_functions().function("mix_*");
        of(&same_library().prefix("own")).expect("the options are the same");
        for (other, said) in [
            (same().wgsl_group(0), "wgsl_group is 2 there, and 0 here"),
            (same().hlsl_space(1), "hlsl_space is 0 there, and 1 here"),
            (
                same().kernel("blur"),
                "kernels are vsm there, and vsm, blur here",
            ),
            (
                Build::built_in().kernel("vsm"),
                "targets are wgsl there, and all here",
            ),
            (same_library(), "the prefix is own there, and hankel here"),
        ] {
            let error = of(&other).unwrap_err().to_string();
            assert!(error.contains(said), "{error}");
        }
    }

    #[test]
    fn each_build_of_a_script_has_its_own_name() {
        let folder = tempfile::tempdir().expect("a folder");
        let claim = |build: Build| build.claim(folder.path()).map_err(|e| e.to_string());
        assert_eq!(claim(Build::built_in()), Ok(()));
        assert_eq!(claim(Build::built_in_functions()), Ok(()));
        let error = claim(Build::built_in()).unwrap_err();
        assert!(error.contains("Build::named"), "{error}");
        let sky = || Build::of("sky/Cargo.toml").named("sky");
        assert_eq!(sky().variable(), "HANKEL_SKY");
        assert_eq!(claim(sky()), Ok(()));
        for name in ["", "Sky", "../sky", "target", "sky shaders"] {
            assert!(claim(Build::built_in().named(name)).is_err(), "{name}");
        }
    }
}
