//! What would be used right now, without installing anything.

use std::path::Path;

use crate::Error;
use crate::cache::Cache;
use crate::error::Result;
use crate::manifest::Manifest;
use crate::options::Options;
use crate::pinned;
use crate::rustup::Rustup;
use crate::toolchain::{Origin, Toolchain};

/// The toolchain in the folder that the user named, if one was.
pub(crate) fn explicit(options: &Options) -> Result<Option<Toolchain>> {
    let Some(path) = &options.path else {
        return Ok(None);
    };
    let path = std::path::absolute(path).unwrap_or_else(|_| path.clone());
    match Toolchain::at(&path, Origin::ExplicitPath) {
        Ok(toolchain) => Ok(Some(toolchain)),
        Err(why) => Err(Toolchain::not_at(&path, why)),
    }
}

/// How thoroughly an installed toolchain is looked at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Check {
    /// Programs and libraries.
    Quick,
    /// Every file.
    Full,
}

/// The toolchain installed in the cache, if there is one, and its manifest.
pub(crate) fn cached(options: &Options, check: Check) -> Result<Option<(Toolchain, Manifest)>> {
    let root = Cache::of(options)?.installed();
    if !root.exists() {
        return Ok(None);
    }
    whole(&root, check).map(Some)
}

/// An installed toolchain without anything missing.
fn whole(root: &Path, check: Check) -> Result<(Toolchain, Manifest)> {
    let damaged = |why: String| Error::Damaged {
        path: root.to_owned(),
        why,
    };
    let Some(manifest) = Manifest::read(root)? else {
        return Err(damaged(format!("{} is missing", crate::manifest::FILE)));
    };
    match check {
        Check::Quick => manifest.check_key_files(root)?,
        Check::Full => manifest.check_all(root)?,
    }
    let toolchain = Toolchain {
        origin: Origin::Cache,
        root: root.to_owned(),
        backend: root.join("lib").join(pinned::BACKEND_FILE),
        bin: Some(root.join("bin")),
        channel: None,
        // Written when it ran for the first time: no need to run it again.
        rustc_version: manifest.rustc.clone(),
        rust_gpu_version: manifest.rust_gpu.clone(),
    };
    Ok((toolchain, manifest))
}

/// The toolchain that would be used right now: the folder that was named, else the one
/// in the cache, else rustup's. `None` if there is none of these; an error if the first
/// one that there is cannot be used.
///
/// Takes a few milliseconds: reads a manifest and asks for the sizes of some dozens of
/// files. An archive that was given is not looked at; see [`crate::ensure`].
pub fn find(options: &Options) -> Result<Option<Toolchain>> {
    if let Some(found) = explicit(options)? {
        return Ok(Some(found));
    }
    if let Some((found, _)) = cached(options, Check::Quick)? {
        return Ok(Some(found));
    }
    Ok(Rustup::usual().and_then(|rustup| rustup.find()))
}
