//! Making a toolchain usable.

use std::fs;
use std::path::{Path, PathBuf};

use crate::archive;
use crate::cache::{Cache, Staging};
use crate::error::{During, Error, Result};
use crate::find::{self, Check};
use crate::manifest::{MadeFrom, Manifest};
use crate::options::Options;
use crate::progress::Progress;
use crate::rustup::Rustup;
use crate::source;
use crate::toolchain::{Origin, Toolchain};

/// A way to install a toolchain.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Method {
    /// Unpack this archive into the cache.
    Archive(PathBuf),
    /// rustup, through cargo-gpu-install.
    Rustup,
    /// Build it from source into the cache.
    Source,
}

/// The toolchain to use: what [`crate::find()`] finds, but an archive that was given is
/// unpacked into the cache before rustup is looked at. Nothing else is installed.
pub fn ensure(options: &Options, progress: &mut dyn Progress) -> Result<Toolchain> {
    if let Some(found) = find::explicit(options)? {
        return Ok(found);
    }
    let cached = match find::cached(options, Check::Quick) {
        // The archive can replace it.
        Err(error @ Error::Damaged { .. }) if options.archive.is_some() => {
            progress.line(&error.to_string());
            None
        }
        other => other?,
    };
    if let Some((found, _)) = cached {
        return Ok(found);
    }
    if let Some(path) = &options.archive {
        return from_archive(options, path, Some(Check::Quick), progress);
    }
    match find::find(options)? {
        Some(found) => Ok(found),
        None => Err(Error::NotInstalled {
            cache: Cache::of(options)?.folder().to_owned(),
        }),
    }
}

/// Installs a toolchain in the way that was asked for. Without one: keeps what is usable
/// already, else takes the archive that was given, else rustup, else builds from source.
///
/// It can be interrupted at any time and run again. Afterwards the toolchain is there as
/// a whole or not at all; the build from source goes on where it stopped.
pub fn install(
    options: &Options,
    method: Option<Method>,
    progress: &mut dyn Progress,
) -> Result<Toolchain> {
    match method {
        Some(Method::Archive(path)) => from_archive(options, &path, None, progress),
        Some(Method::Rustup) => from_rustup(options, progress),
        Some(Method::Source) => from_source(options, progress),
        None => first_possible(options, progress),
    }
}

fn first_possible(options: &Options, progress: &mut dyn Progress) -> Result<Toolchain> {
    let usable = match find::explicit(options)? {
        Some(found) => Some(found),
        None => match find::cached(options, Check::Full) {
            Err(error @ Error::Damaged { .. }) => {
                progress.line(&error.to_string());
                None
            }
            Ok(Some((found, _))) => Some(found),
            Ok(None) if options.archive.is_none() => find::find(options)?,
            Ok(None) => None,
            Err(other) => return Err(other),
        },
    };
    if let Some(found) = usable {
        progress.line("there is a usable toolchain already");
        return Ok(found);
    }
    if let Some(path) = &options.archive {
        return from_archive(options, path, None, progress);
    }
    let mut reasons = Vec::new();
    match from_rustup(options, progress) {
        Err(error @ Error::Rustup { .. }) => {
            progress.line(&error.to_string());
            progress.line("trying to build from source instead");
            reasons.push(error.to_string());
        }
        other => return other,
    }
    match from_source(options, progress) {
        Err(
            error @ (Error::UnknownPlatform { .. }
            | Error::MissingTools { .. }
            | Error::Network { .. }),
        ) => {
            reasons.push(error.to_string());
            Err(Error::NoMethod { reasons })
        }
        other => other,
    }
}

/// Writes the manifest and gives the folder its final name.
fn publish(
    staging: Staging<'_>,
    made_from: MadeFrom,
    sha256: &str,
    origin: Origin,
) -> Result<Toolchain, Either> {
    let found = Toolchain::at(staging.path(), origin).map_err(Either::Unusable)?;
    let finish = || {
        Manifest::of(staging.path(), made_from, sha256, &found.rustc_version)?.write(staging.path())
    };
    finish().map_err(Either::Failed)?;
    let root = staging.publish().map_err(Either::Failed)?;
    Ok(Toolchain {
        backend: root.join("lib").join(crate::pinned::BACKEND_FILE),
        bin: Some(root.join("bin")),
        root,
        ..found
    })
}

/// Why a staged toolchain was not published.
enum Either {
    /// It does not work here.
    Unusable(String),
    /// Something went wrong on the way.
    Failed(Error),
}

/// Whether the installed toolchain is whole and of this make already.
fn is_installed(options: &Options, made_from: MadeFrom, sha256: &str) -> Option<Toolchain> {
    let (found, manifest) = find::cached(options, Check::Full).ok()??;
    (manifest.made_from == made_from && manifest.sha256 == sha256).then_some(found)
}

fn from_archive(
    options: &Options,
    path: &Path,
    keep: Option<Check>,
    progress: &mut dyn Progress,
) -> Result<Toolchain> {
    // An archive that is not there is named before anything is made or waited for.
    fs::metadata(path).during("open", path)?;
    let expected = archive::expected_sha256(options, path)?;
    let lock = Cache::of(options)?.lock(progress)?;
    // Somebody else may have installed it while this process waited for the lock.
    if let Some(check) = keep
        && let Ok(Some((found, _))) = find::cached(options, check)
    {
        return Ok(found);
    }
    if let Some(found) = is_installed(options, MadeFrom::Archive, &expected) {
        progress.line("this archive is installed already");
        return Ok(found);
    }
    progress.step("unpack", 1, 1);
    let staging = lock.staging()?;
    archive::unpack(options, path, &expected, &staging, progress)?;
    publish(staging, MadeFrom::Archive, &expected, Origin::Archive).map_err(|error| match error {
        Either::Failed(error) => error,
        Either::Unusable(why) => Error::NotAToolchainArchive {
            path: path.to_owned(),
            why,
        },
    })
}

fn from_rustup(options: &Options, progress: &mut dyn Progress) -> Result<Toolchain> {
    let rustup = Rustup::usual().ok_or(Error::NoCacheFolder)?;
    if let Some(found) = rustup.find() {
        progress.line("rustup has it already");
        return Ok(found);
    }
    let lock = Cache::of(options)?.lock(progress)?;
    // A log and a throw-away crate go there; nothing of it stays.
    let work = lock.staging()?;
    rustup.install(work.path(), progress)
}

fn from_source(options: &Options, progress: &mut dyn Progress) -> Result<Toolchain> {
    source::check(options)?;
    let lock = Cache::of(options)?.lock(progress)?;
    let recipe = source::recipe();
    if let Some(found) = is_installed(options, MadeFrom::Source, &recipe) {
        progress.line("it is built and installed already");
        return Ok(found);
    }
    let work = lock.cache().build();
    fs::create_dir_all(&work).during("create", &work)?;
    let staging = lock.staging()?;
    source::build(options, &work, &staging, progress)?;
    let unusable = |why: String| Error::Damaged {
        path: lock.cache().installed(),
        why,
    };
    let built = Toolchain::at(staging.path(), Origin::Source).map_err(unusable)?;
    built.self_test(&work)?;
    let done = publish(staging, MadeFrom::Source, &recipe, Origin::Source);
    let done = done.map_err(|error| match error {
        Either::Failed(error) => error,
        Either::Unusable(why) => unusable(why),
    })?;
    // The stages have served; they would take ten times the toolchain's space.
    fs::remove_dir_all(&work).during("remove", &work)?;
    Ok(done)
}
