//! All five ways to a compiler, looked at without using any.

use std::fmt;
use std::path::{Path, PathBuf};

use serde::Serialize;

use crate::archive;
use crate::cache::Cache;
use crate::find::{self, Check};
use crate::manifest::MadeFrom;
use crate::options::{ENV_ARCHIVE, ENV_PATH, Options};
use crate::pinned;
use crate::rustup::Rustup;
use crate::source;
use crate::toolchain::{Origin, Toolchain};

/// How far a way is from a usable compiler.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum State {
    /// It can be used now.
    Usable,
    /// `hankel toolchain install` can make it usable.
    Installable,
    /// It was not asked for, or there is nothing yet.
    Absent,
    /// Something is missing or wrong.
    Unusable,
}

/// One way to a compiler.
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct Way {
    /// Which one.
    pub origin: Origin,
    /// How far it is.
    pub state: State,
    /// Why, in one sentence or several lines.
    pub why: String,
    /// What it would take, one item each.
    pub missing: Vec<String>,
    /// The compiler, if it is usable.
    pub toolchain: Option<Toolchain>,
}

/// What [`status()`] found out. Prints as text for people; serialises for programs.
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct Status {
    /// This machine's target triple.
    pub host: String,
    /// Version of rust-gpu that is needed.
    pub rust_gpu_version: String,
    /// Folder of installed toolchains.
    pub cache: Option<PathBuf>,
    /// The way whose compiler [`crate::ensure`] would use; `None`: there is none, or the
    /// first one that there is cannot be used.
    pub used: Option<Origin>,
    /// What [`crate::install()`] would start with if it were not told a way.
    pub install_would_use: Option<Origin>,
    /// Every way, in the order in which they are tried.
    pub ways: Vec<Way>,
}

fn way(origin: Origin, state: State, why: impl Into<String>) -> Way {
    Way {
        origin,
        state,
        why: why.into(),
        missing: Vec::new(),
        toolchain: None,
    }
}

fn usable(toolchain: Toolchain, why: impl Into<String>) -> Way {
    let origin = toolchain.origin;
    Way {
        toolchain: Some(toolchain),
        ..way(origin, State::Usable, why)
    }
}

fn explicit(options: &Options) -> Way {
    match find::explicit(options) {
        Ok(Some(found)) => usable(found, format!("{ENV_PATH} names it")),
        Ok(None) => way(
            Origin::ExplicitPath,
            State::Absent,
            format!("{ENV_PATH} is not set"),
        ),
        Err(error) => way(Origin::ExplicitPath, State::Unusable, error.to_string()),
    }
}

fn cache(options: &Options) -> Way {
    match find::cached(options, Check::Full) {
        Ok(Some((found, manifest))) => {
            let made = match manifest.made_from {
                MadeFrom::Archive => "unpacked from an archive with SHA-256",
                MadeFrom::Source => "built from source, recipe",
            };
            let sum = manifest.sha256.get(..12).unwrap_or_default();
            usable(found, format!("installed and complete; {made} {sum}..."))
        }
        Ok(None) => way(Origin::Cache, State::Absent, "nothing is installed"),
        Err(error) => way(Origin::Cache, State::Unusable, error.to_string()),
    }
}

fn archive(options: &Options) -> Way {
    let Some(path) = &options.archive else {
        return way(
            Origin::Archive,
            State::Absent,
            format!("{ENV_ARCHIVE} is not set"),
        );
    };
    match std::fs::metadata(path) {
        Ok(data) if data.is_file() => match archive::expected_sha256(options, path) {
            Ok(sum) => way(
                Origin::Archive,
                State::Installable,
                format!(
                    "{} ({} MB), checksum {}... to be verified",
                    path.display(),
                    data.len() / 1_000_000,
                    sum.get(..12).unwrap_or_default()
                ),
            ),
            Err(error) => way(Origin::Archive, State::Unusable, error.to_string()),
        },
        Ok(_) => way(
            Origin::Archive,
            State::Unusable,
            format!("{} is not a file", path.display()),
        ),
        Err(error) => way(
            Origin::Archive,
            State::Unusable,
            format!("{}: {error}", path.display()),
        ),
    }
}

fn rustup() -> Way {
    let Some(rustup) = Rustup::usual() else {
        return way(
            Origin::Rustup,
            State::Unusable,
            "the user has no home folder",
        );
    };
    if let Some(found) = rustup.find() {
        return usable(found, "rustup and cargo-gpu-install have it");
    }
    let missing = rustup.missing();
    let state = if hankel_system::process::which(Path::new("rustup")).is_some() {
        State::Installable
    } else {
        State::Unusable
    };
    Way {
        missing,
        ..way(Origin::Rustup, state, "needs a network and rustup's server")
    }
}

fn source(options: &Options) -> Way {
    match source::check(options) {
        Ok(version) => {
            let why = format!(
                "with {version}; about 20 minutes on two cores, 3 GB of disk, crates.io{}",
                if options.rust_src.is_some() {
                    ""
                } else {
                    ", a Debian mirror"
                }
            );
            way(Origin::Source, State::Installable, why)
        }
        Err(crate::Error::MissingTools { tools, help }) => Way {
            missing: tools,
            ..way(Origin::Source, State::Unusable, help)
        },
        Err(error) => way(Origin::Source, State::Unusable, error.to_string()),
    }
}

/// Looks at every way to a compiler. Never fails: what is wrong is in the answer. Checks
/// every file of an installed toolchain, asks programs for their versions, and uses no
/// network.
pub fn status(options: &Options) -> Status {
    // At the same time: a program that hangs delays none of the others.
    let ways = std::thread::scope(|scope| {
        let ways = [
            scope.spawn(|| explicit(options)),
            scope.spawn(|| cache(options)),
            scope.spawn(|| archive(options)),
            scope.spawn(rustup),
            scope.spawn(|| source(options)),
        ];
        ways.into_iter()
            .map(|way| {
                way.join()
                    .unwrap_or_else(|panic| std::panic::resume_unwind(panic))
            })
            .collect::<Vec<_>>()
    });
    let state = |origin| {
        ways.iter()
            .find(|way| way.origin == origin)
            .map(|way| way.state)
    };
    // The first that is not merely absent decides, as in `ensure`.
    let order = [Origin::ExplicitPath, Origin::Cache, Origin::Archive];
    let first = order
        .into_iter()
        .find(|origin| state(*origin) != Some(State::Absent));
    let used = Some(first.unwrap_or(Origin::Rustup)).filter(|origin| match state(*origin) {
        Some(State::Usable) => true,
        Some(State::Installable) => *origin == Origin::Archive,
        _ => false,
    });
    let installable = ways.iter().find(|way| way.state == State::Installable);
    Status {
        host: pinned::host().to_owned(),
        rust_gpu_version: pinned::RUST_GPU_VERSION.to_owned(),
        cache: Cache::of(options)
            .ok()
            .map(|cache| cache.folder().to_owned()),
        used,
        install_would_use: installable.map(|way| way.origin).filter(|_| used.is_none()),
        ways,
    }
}

impl fmt::Display for Status {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "rust-gpu {} on {}", self.rust_gpu_version, self.host)?;
        for way in &self.ways {
            let mark = if self.used == Some(way.origin) {
                '>'
            } else {
                ' '
            };
            let state = match way.state {
                State::Usable => "usable",
                State::Installable => "installable",
                State::Absent => "-",
                State::Unusable => "unusable",
            };
            let mut lines = way.why.lines();
            let first = lines.next().unwrap_or_default();
            writeln!(f, "{mark} {:<14} {state:<12} {first}", way.origin.name())?;
            let rest = lines.map(|line| line.trim().to_owned());
            let missing = way.missing.iter().map(|item| format!("missing: {item}"));
            let found = way.toolchain.iter().flat_map(|found| {
                [
                    found.rustc_version.clone(),
                    format!("in {}", found.root.display()),
                ]
            });
            for line in rest.chain(missing).chain(found) {
                writeln!(f, "{:30}{line}", "")?;
            }
        }
        match (self.used, self.install_would_use) {
            (Some(Origin::Archive), _) => {
                write!(
                    f,
                    "used: archive, which is unpacked when it is first needed"
                )
            }
            (Some(origin), _) => write!(f, "used: {}", origin.name()),
            (None, Some(origin)) => write!(
                f,
                "used: none; `hankel toolchain install` would start with: {}",
                origin.name()
            ),
            (None, None) => write!(f, "used: none, and none can be installed"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn as_text() {
        let missing = vec!["g++".to_owned(), "ld".to_owned()];
        let status = Status {
            host: "some-host".into(),
            rust_gpu_version: "0.10.0".into(),
            cache: None,
            used: None,
            install_would_use: Some(Origin::Rustup),
            ways: vec![
                way(Origin::Cache, State::Unusable, "damaged\nhelp: do it again"),
                way(Origin::Rustup, State::Installable, "needs a network"),
                Way {
                    missing,
                    ..way(Origin::Source, State::Unusable, "apt-get install g++")
                },
            ],
        };
        let expected = "\
rust-gpu 0.10.0 on some-host
  cache          unusable     damaged
                              help: do it again
  rustup         installable  needs a network
  source         unusable     apt-get install g++
                              missing: g++
                              missing: ld
used: none; `hankel toolchain install` would start with: rustup";
        assert_eq!(status.to_string(), expected);
    }
}
