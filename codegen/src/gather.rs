//! What cargo and rustc say that they read for a build: the names for a record of its inputs.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use crate::error::{During, Error, Result};
use crate::inputs::{Names, normal, relative, workspace_of};
use crate::messages::{Artifact, Messages, Script};

/// Where a build took place.
pub(crate) struct Build<'a> {
    /// The crate's folder.
    pub folder: &'a Path,
    /// Folders whose files are made by the build, or belong to the compiler.
    pub own: &'a [PathBuf],
    /// What cargo said.
    pub messages: &'a Messages,
    /// The file of the crate itself. cargo does not name it where rustc has not written it.
    pub made: &'a Path,
}

/// Everything that a build read.
///
/// # Errors
///
/// cargo or rustc did not say it, or in a form that is not known.
pub(crate) fn gather(build: &Build<'_>) -> Result<Names> {
    let Messages { artifacts, scripts } = build.messages;
    // The compiler's own crates belong to its version.
    let artifacts: Vec<&Artifact> = artifacts
        .iter()
        .filter(|it| !build.is_own(&it.manifest_path))
        .collect();
    let workspace = workspace_of(build.folder)?;
    let mut names = Names::default();
    let mut folders = BTreeMap::new();
    for artifact in artifacts {
        let folder = artifact.manifest_path.parent().unwrap_or(build.folder);
        folders.insert(artifact.package_id.as_str(), folder);
        names.packages.insert(package(&artifact.package_id));
        let info = DepInfo::of(artifact, build.made)?;
        let set: BTreeSet<&str> = scripts
            .iter()
            .filter(|script| script.package_id == artifact.package_id)
            .flat_map(|script| script.env.iter().map(|(name, _)| name.as_str()))
            .collect();
        let asked = info.environment.into_iter();
        names
            .environment
            .extend(asked.filter(|name| !set.contains(name.as_str()) && !is_given_to_rustc(name)));
        if !is_local(&artifact.package_id) {
            continue;
        }
        names
            .files
            .insert(relative(build.folder, &artifact.manifest_path));
        names
            .files
            .insert(relative(build.folder, &folder.join("build.rs")));
        for file in info.files {
            // rustc runs in the workspace, or in the crate's folder if it is outside of that.
            let path = [workspace.as_path(), folder]
                .map(|base| normal(&base.join(&file)))
                .into_iter()
                .find(|path| path.exists())
                .ok_or_else(|| Error::Inputs {
                    path: file.clone(),
                    problem: "rustc read it, but there is no such file".into(),
                })?;
            if !build.is_own(&path) {
                names.files.insert(relative(build.folder, &path));
            }
        }
    }
    for script in scripts {
        let Some(folder) = folders.get(script.package_id.as_str()) else {
            continue;
        };
        let watched = Watched::of(script)?;
        let asked = watched.environment.into_iter();
        names
            .environment
            .extend(asked.filter(|name| !is_given_to_scripts(name)));
        if !is_local(&script.package_id) {
            continue;
        }
        for path in watched.paths {
            let path = normal(&folder.join(path));
            if !build.is_own(&path) {
                let name = relative(build.folder, &path);
                if path.is_dir() {
                    names.folders.insert(name);
                } else {
                    names.files.insert(name);
                }
            }
        }
    }
    Ok(names)
}

impl Build<'_> {
    fn is_own(&self, path: &Path) -> bool {
        let made = path
            .extension()
            .is_some_and(|it| it == "rlib" || it == "rmeta");
        made || self.own.iter().any(|folder| path.starts_with(folder))
    }
}

/// Whether a package lies in a folder of the user's: what a registry or git gives is fixed by
/// `Cargo.lock`.
fn is_local(package_id: &str) -> bool {
    package_id.starts_with("path+")
}

/// `name version` from `registry+https://…#name@version`, `path+file:///…/name#version`.
fn package(id: &str) -> String {
    let (source, fragment) = id.rsplit_once('#').unwrap_or(("", id));
    match fragment.split_once('@') {
        Some((name, version)) => format!("{name} {version}"),
        None => {
            let path = source.split('?').next().unwrap_or_default();
            let name = path.trim_end_matches('/').rsplit('/').next();
            format!("{} {fragment}", name.unwrap_or_default())
        }
    }
}

/// Variables that cargo sets for rustc, from what is recorded anyway. Not those that it sets for build scripts alone:
/// `option_env!("PROFILE")` is the user's variable.
fn is_given_to_rustc(name: &str) -> bool {
    const NAMES: [&str; 8] = [
        "CARGO",
        "CARGO_BIN_NAME",
        "CARGO_CRATE_NAME",
        "CARGO_MANIFEST_DIR",
        "CARGO_MANIFEST_PATH",
        "CARGO_PRIMARY_PACKAGE",
        "CARGO_TARGET_TMPDIR",
        "OUT_DIR",
    ];
    const PREFIXES: [&str; 2] = ["CARGO_BIN_EXE_", "CARGO_PKG_"];
    NAMES.contains(&name) || PREFIXES.iter().any(|prefix| name.starts_with(prefix))
}

/// Variables that cargo sets for build scripts, from what is recorded anyway.
fn is_given_to_scripts(name: &str) -> bool {
    const NAMES: [&str; 9] = [
        "DEBUG",
        "HOST",
        "NUM_JOBS",
        "OPT_LEVEL",
        "OUT_DIR",
        "PROFILE",
        "RUSTC",
        "RUSTDOC",
        "TARGET",
    ];
    const PREFIXES: [&str; 3] = ["CARGO_", "DEP_", "RUSTC_"];
    NAMES.contains(&name) || PREFIXES.iter().any(|prefix| name.starts_with(prefix))
}

/// What rustc read for a unit.
#[derive(Default)]
struct DepInfo {
    files: Vec<PathBuf>,
    environment: BTreeSet<String>,
}

impl DepInfo {
    /// Finds it beside the unit's files, or where it has none, beside `made`.
    fn of(artifact: &Artifact, made: &Path) -> Result<Self> {
        let none = artifact.filenames.is_empty().then_some(made);
        let files = artifact.filenames.iter().map(PathBuf::as_path);
        let file = files
            .chain(none)
            .find_map(dep_info)
            .ok_or_else(|| Error::Inputs {
                path: artifact.manifest_path.clone(),
                problem: "rustc left no list of what it read".into(),
            })?;
        let text = std::fs::read_to_string(&file).during("read", &file)?;
        Ok(Self::parse(&text))
    }

    /// Reads make's form: `target: file file`, with `\ ` for a space, and `# env-dep:NAME=VALUE`.
    fn parse(text: &str) -> Self {
        let mut info = Self::default();
        for line in text.lines() {
            if let Some(variable) = line.strip_prefix("# env-dep:") {
                let name = variable.split('=').next().unwrap_or_default();
                info.environment.insert(name.into());
            } else if let Some((_, files)) = line.split_once(": ") {
                let mut name = String::new();
                for word in files.split(' ') {
                    name.push_str(word);
                    if name.ends_with('\\') {
                        name.pop();
                        name.push(' ');
                    } else if !name.is_empty() {
                        info.files.push(std::mem::take(&mut name).into());
                    }
                }
            }
        }
        info
    }
}

/// rustc's list for an artefact: `deps/name-hash.d` for `deps/libname-hash.rlib`,
/// `build_script_build-hash.d` beside `build-script-build`.
fn dep_info(file: &Path) -> Option<PathBuf> {
    let folder = file.parent()?;
    let name = file.file_name()?.to_str()?;
    let stem = name.split('.').next()?;
    let plain = stem.strip_prefix("lib").unwrap_or(stem);
    for name in [plain, stem] {
        // What cargo copies to the folder above keeps its list in `deps`, and one of cargo's own,
        // without variables, beside the copy.
        for place in [folder.join("deps"), folder.to_owned()] {
            let found = place.join(format!("{name}.d"));
            if found.is_file() {
                return Some(found);
            }
        }
    }
    let script = |path: &PathBuf| {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        name.ends_with(".d") && name.replace('-', "_").starts_with(&stem.replace('-', "_"))
    };
    let mut found: Vec<PathBuf> = std::fs::read_dir(folder)
        .ok()?
        .filter_map(|entry| entry.ok().map(|entry| entry.path()))
        .filter(script)
        .collect();
    found.sort();
    found.into_iter().next()
}

/// What a build script says that it depends on.
#[derive(Default)]
struct Watched {
    /// From the package's folder.
    paths: Vec<PathBuf>,
    environment: BTreeSet<String>,
}

impl Watched {
    fn of(script: &Script) -> Result<Self> {
        let file = script.out_dir.with_file_name("output");
        let text = std::fs::read_to_string(&file).during("read", &file)?;
        Ok(Self::parse(&text))
    }

    fn parse(text: &str) -> Self {
        let mut watched = Self::default();
        for line in text.lines() {
            let Some(line) = line.strip_prefix("cargo:") else {
                continue;
            };
            let line = line.strip_prefix(':').unwrap_or(line);
            if let Some(path) = line.strip_prefix("rerun-if-changed=") {
                watched.paths.push(path.into());
            } else if let Some(name) = line.strip_prefix("rerun-if-env-changed=") {
                watched.environment.insert(name.into());
            }
        }
        if watched.paths.is_empty() && watched.environment.is_empty() {
            // cargo then runs it again when any file of the package changes.
            watched.paths.push(".".into());
        }
        watched
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn packages_are_named() {
        for (id, name) in [
            (
                "registry+https://github.com/rust-lang/crates.io-index#glam@0.30.1",
                "glam 0.30.1",
            ),
            (
                "path+file:///a/kernels/dsl#hankel-dsl@0.1.0",
                "hankel-dsl 0.1.0",
            ),
            ("path+file:///a/my-kernels#0.1.0", "my-kernels 0.1.0"),
            ("git+https://example.org/a/b.git?rev=12#b@1.0.0", "b 1.0.0"),
        ] {
            assert_eq!(package(id), name);
        }
    }

    #[test]
    fn lists_of_rustc_are_read() {
        let text = "/t/deps/a-1.d: src/lib.rs src/a\\ b.rs ../coef.txt\n\nsrc/lib.rs:\n\n\
                    # env-dep:WEIGHT=1\n# env-dep:CARGO_PKG_NAME=a\n# env-dep:NOT_SET\n";
        let info = DepInfo::parse(text);
        let files: Vec<_> = info.files.iter().map(|file| file.to_str()).collect();
        assert_eq!(
            files,
            [Some("src/lib.rs"), Some("src/a b.rs"), Some("../coef.txt")]
        );
        let names: Vec<_> = info.environment.iter().map(String::as_str).collect();
        assert_eq!(names, ["CARGO_PKG_NAME", "NOT_SET", "WEIGHT"]);
        assert!(is_given_to_rustc("CARGO_PKG_NAME") && !is_given_to_rustc("WEIGHT"));
        // cargo sets it for build scripts alone.
        assert!(is_given_to_scripts("PROFILE") && !is_given_to_rustc("PROFILE"));
    }

    #[test]
    fn what_build_scripts_watch_is_read() {
        let text = "noise\ncargo:rerun-if-changed=a.txt\ncargo::rerun-if-changed=data\n\
                    cargo::rerun-if-env-changed=X\ncargo::rustc-env=Y=1\n";
        let watched = Watched::parse(text);
        assert_eq!(watched.paths, [Path::new("a.txt"), Path::new("data")]);
        assert_eq!(watched.environment, BTreeSet::from(["X".to_owned()]));
        assert_eq!(
            Watched::parse("cargo::rustc-env=Y=1\n").paths,
            [Path::new(".")]
        );
    }
}
