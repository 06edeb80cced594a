//! From a kernel crate to raw SPIR-V, one module for each entry point.
//!
//! This runs cargo as `spirv-builder` does, with the same flags, and takes rust-gpu's types for
//! the target's description and for the result from the crate that spirv-builder takes them from.
//! Not by way of spirv-builder itself: that finds the compiler through this process's `PATH`,
//! prints, and reports a failure without what the compiler said.

use std::collections::BTreeMap;
use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use hankel_system::process::Program;
use rspirv::spirv::Capability;
use rustc_codegen_spirv_types::{CompileResult, ModuleResult, SpirvTarget, TargetSpecVersion};
use semver::Version;
use serde::Deserialize;

use crate::diagnostics::{self, rust_gpu};
use crate::error::{During, Error, Result};
use crate::spirv::trim;
use crate::translate::text;

/// What the modules are compiled for.
const TARGET: &str = "spirv-unknown-vulkan1.2";

/// The folder for rust-gpu's artefacts, within cargo's target folder.
pub const TARGET_SUBFOLDER: &str = "hankel/spirv";

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
    fn command(&self, program: &str) -> Command {
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

    /// What `rustc --version` prints.
    ///
    /// # Errors
    ///
    /// rustc does not run.
    pub fn version(&self) -> Result<String> {
        let mut rustc = self.command("rustc");
        let program = PathBuf::from(rustc.get_program());
        let output = rustc
            .arg("--version")
            .output()
            .map_err(|source| Error::Run {
                program: program.clone(),
                source,
            })?;
        if !output.status.success() {
            let said = String::from_utf8_lossy(&output.stderr).trim().to_owned();
            let source = std::io::Error::other(said);
            return Err(Error::Run { program, source });
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

/// Compiles the kernel crate whose Cargo.toml is `manifest`.
///
/// `target_dir` is cargo's target folder (the artefacts go into [`TARGET_SUBFOLDER`] of it);
/// `kernels` are the entry points that must come out; `progress` gets every line that cargo
/// prints. The first build takes half a minute, later ones about a second.
///
/// # Errors
///
/// The crate does not compile, or lacks one of the entry points.
pub fn compile(
    manifest: &Path,
    compiler: &Compiler,
    target_dir: &Path,
    kernels: &[&str],
    progress: &mut (dyn FnMut(&str) + Send),
) -> Result<BTreeMap<String, Vec<u8>>> {
    let manifest = std::path::absolute(manifest).during("resolve", manifest)?;
    let folder = manifest
        .parent()
        .filter(|_| manifest.is_file())
        .ok_or_else(|| Error::Manifest {
            path: manifest.clone(),
            problem: "there is no such file".into(),
        })?;
    let found = diagnostics::source::check(folder);
    if !found.is_empty() {
        return Err(Error::Source(found));
    }
    let target_dir = std::path::absolute(target_dir)
        .during("resolve", target_dir)?
        .join(TARGET_SUBFOLDER);
    let mut cargo = cargo(compiler, &manifest, folder, &target_dir)?;
    let program = PathBuf::from(cargo.get_program());
    cargo.stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut running = Program::start(&mut cargo).map_err(|source| Error::Run {
        program: program.clone(),
        source,
    })?;
    let (stdout, stderr) = (running.child.stdout.take(), running.child.stderr.take());
    let (messages, said) = std::thread::scope(|scope| {
        let said = scope.spawn(move || {
            let mut said = String::new();
            for line in stderr
                .into_iter()
                .flat_map(|pipe| BufReader::new(pipe).split(b'\n'))
            {
                let Ok(line) = line else { break };
                let line = String::from_utf8_lossy(&line);
                progress(&line);
                said.push_str(line.trim_end());
                said.push('\n');
            }
            said
        });
        let mut messages = Vec::new();
        if let Some(mut pipe) = stdout {
            // A broken pipe shows in the exit status.
            let _ = pipe.read_to_end(&mut messages);
        }
        (
            String::from_utf8_lossy(&messages).into_owned(),
            said.join().unwrap_or_default(),
        )
    });
    let status = running
        .wait()
        .map_err(|source| Error::Run { program, source })?;
    if !status.success() {
        return Err(failure(&manifest, kernels, &said, &messages));
    }
    let artefact = last_artefact(&messages).ok_or_else(|| Error::Manifest {
        path: manifest.clone(),
        problem: "cargo made no SPIR-V of it: its [lib] needs crate-type = [\"lib\", \"dylib\"] and a kernel".into(),
    })?;
    read_modules(&manifest, &artefact, kernels)
}

fn cargo(
    compiler: &Compiler,
    manifest: &Path,
    folder: &Path,
    target_dir: &Path,
) -> Result<Command> {
    let said = compiler.version()?;
    let version = parse_version(&said).ok_or_else(|| Error::Run {
        program: "rustc".into(),
        source: std::io::Error::other(format!("its version is no version: {said}")),
    })?;
    let target = SpirvTarget::parse(TARGET).map_err(|error| Error::Option {
        option: "SPIR-V target",
        value: format!("{TARGET}: {error}"),
        expected: "one that rust-gpu knows",
    })?;
    let specs = target_dir.join("target-specs");
    let spec = TargetSpecVersion::target_arg(version, &target, &specs).during("write", &specs)?;
    let mut cargo = compiler.command("cargo");
    cargo.current_dir(folder);
    cargo.args([
        "rustc",
        "--lib",
        "--crate-type=dylib",
        "--profile=release",
        "--message-format=json",
        "-Zbuild-std=core",
        "-Zbuild-std-features=compiler-builtins-mem",
        "--manifest-path",
    ]);
    cargo.arg(manifest).arg("--target-dir").arg(target_dir);
    spec.append_to_cmd(&mut cargo);
    let capabilities: Vec<String> = trim::ENABLED
        .iter()
        .map(|capability: &Capability| format!("+{capability:?}"))
        .collect();
    let flags = [
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
        // Its optimiser makes one constant of two in a row, which rounds otherwise than the source
        // (tests/upstream/rust-gpu-merged-constants).
        // `finish` runs it, with arithmetic held.
        "-Cllvm-args=--module-output=multiple --spirv-metadata=name-variables --no-spirv-opt"
            .into(),
        format!("-Ctarget-feature={}", capabilities.join(",")),
    ];
    cargo
        .env("CARGO_ENCODED_RUSTFLAGS", flags.join("\x1f"))
        // cargo remembers what rustc says about itself, but the backend has a say too.
        .env("CARGO_CACHE_RUSTC_INFO", "0")
        // Whatever the crate's own workspace says: one profile, the same bytes everywhere.
        .env("CARGO_PROFILE_RELEASE_CODEGEN_UNITS", "1")
        .env("CARGO_PROFILE_RELEASE_DEBUG", "0")
        .env("CARGO_PROFILE_RELEASE_INCREMENTAL", "false")
        .env("CARGO_PROFILE_RELEASE_LTO", "off")
        .env("CARGO_PROFILE_RELEASE_OPT_LEVEL", "3")
        .env("CARGO_INCREMENTAL", "0")
        .env("CARGO_TERM_COLOR", "never")
        .env("CARGO_TERM_PROGRESS_WHEN", "never");
    Ok(cargo)
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
        .find(|name| text::has_name(&output, name))
        .map(ToString::to_string);
    let panicked = output.contains("panicked at") || output.contains("internal compiler error");
    Error::Compile {
        manifest: manifest.to_owned(),
        kernel,
        panicked,
        output: output.trim().to_owned(),
    }
}

/// rust-gpu's list of what it made.
fn last_artefact(messages: &str) -> Option<PathBuf> {
    #[derive(Deserialize)]
    struct Message {
        reason: String,
        #[serde(default)]
        filenames: Vec<String>,
    }
    messages
        .lines()
        .filter_map(|line| serde_json::from_str::<Message>(line).ok())
        .filter(|message| message.reason == "compiler-artifact")
        .flat_map(|message| message.filenames)
        .rfind(|file| file.ends_with(".spv.json"))
        .map(PathBuf::from)
}

fn read_modules(
    manifest: &Path,
    artefact: &Path,
    kernels: &[&str],
) -> Result<BTreeMap<String, Vec<u8>>> {
    let json = std::fs::read(artefact).during("read", artefact)?;
    let result: CompileResult = serde_json::from_slice(&json).map_err(|error| Error::Bundle {
        path: artefact.to_owned(),
        problem: format!("rust-gpu wrote no list of modules: {error}"),
    })?;
    let ModuleResult::MultiModule(files) = result.module else {
        return Err(Error::Bundle {
            path: artefact.to_owned(),
            problem: "rust-gpu wrote one module for all entry points".into(),
        });
    };
    if let Some(missing) = kernels.iter().find(|name| !files.contains_key(**name)) {
        return Err(Error::NoEntryPoint {
            manifest: manifest.to_owned(),
            kernel: (*missing).into(),
            found: files.keys().cloned().collect(),
        });
    }
    files
        .into_iter()
        .map(|(name, file)| {
            let bytes = std::fs::read(&file).during("read", &file)?;
            Ok((name, bytes))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

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
        let messages = "{\"reason\":\"compiler-artifact\",\"filenames\":[\"a.rlib\"]}\nnoise\n\
            {\"reason\":\"compiler-artifact\",\"filenames\":[\"b.spv.json\"]}\n{\"reason\":\"build-finished\"}";
        assert_eq!(last_artefact(messages), Some("b.spv.json".into()));
        assert_eq!(last_artefact("{}"), None);
    }
}
