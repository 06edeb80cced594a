//! What the user asked for.

use std::io;
use std::path::{Path, PathBuf};

use crate::error::{Error, Result};

/// Environment variable: folder of the toolchain to use.
pub const ENV_PATH: &str = "HANKEL_TOOLCHAIN";
/// Environment variable: archive to install the toolchain from.
pub const ENV_ARCHIVE: &str = "HANKEL_TOOLCHAIN_ARCHIVE";
/// Environment variable: SHA-256 that the archive must have.
pub const ENV_SHA256: &str = "HANKEL_TOOLCHAIN_SHA256";
/// Environment variable: folder for everything that Hankel keeps between runs.
pub const ENV_CACHE: &str = "HANKEL_CACHE";
/// Environment variable: Debian's `rust-src` package file, for the build from source.
pub const ENV_RUST_SRC: &str = "HANKEL_RUST_SRC_DEB";
/// Environment variable: compiler that builds the compiler, as a rustup toolchain's name
/// or as a folder that holds `bin/cargo` and `bin/rustc`.
pub const ENV_BOOTSTRAP: &str = "HANKEL_BOOTSTRAP";

/// Where to look for a toolchain and what to make one from.
#[derive(Clone, Debug)]
pub struct Options {
    /// Folder of the toolchain to use before all others.
    pub path: Option<PathBuf>,
    /// Archive (.tar.zst) to install from.
    pub archive: Option<PathBuf>,
    /// SHA-256 of `archive` in hexadecimal. Not needed for the archives in
    /// [`crate::pinned::ARCHIVES`], nor where a `SHA256SUMS` file lies beside it.
    pub sha256: Option<String>,
    /// Folder for what is kept between runs; `None`: `hankel` in the user's cache folder.
    pub cache: Option<PathBuf>,
    /// Debian's `rust-src` package; `None`: it is downloaded with `apt-get`.
    pub rust_src: Option<PathBuf>,
    /// Compiler for the build from source: a rustup toolchain's name, or a folder;
    /// `None`: rustup's `nightly`.
    pub bootstrap: Option<String>,
    /// Tells how many bytes are free on a folder's disk.
    pub free_space: fn(&Path) -> io::Result<u64>,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            path: None,
            archive: None,
            sha256: None,
            cache: None,
            rust_src: None,
            bootstrap: None,
            free_space: |folder| fs4::available_space(folder),
        }
    }
}

impl Options {
    /// What the environment asks for. A variable that is empty counts as unset.
    pub fn from_env() -> Self {
        Self::from_lookup(|name| std::env::var_os(name).filter(|value| !value.is_empty()))
    }

    fn from_lookup(lookup: impl Fn(&str) -> Option<std::ffi::OsString>) -> Self {
        let path = |name| lookup(name).map(PathBuf::from);
        let text = |name| lookup(name).map(|value| value.to_string_lossy().into_owned());
        Self {
            path: path(ENV_PATH),
            archive: path(ENV_ARCHIVE),
            sha256: text(ENV_SHA256),
            cache: path(ENV_CACHE),
            rust_src: path(ENV_RUST_SRC),
            bootstrap: text(ENV_BOOTSTRAP),
            ..Self::default()
        }
    }

    /// Folder for what is kept between runs. It need not exist.
    pub fn cache_folder(&self) -> Result<PathBuf> {
        match &self.cache {
            Some(folder) => std::path::absolute(folder).map_err(|source| Error::Io {
                action: "resolve",
                path: folder.clone(),
                source,
            }),
            None => directories::ProjectDirs::from("", "", "hankel")
                .map(|dirs| dirs.cache_dir().to_owned())
                .ok_or(Error::NoCacheFolder),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_variable_lands_in_its_field() {
        let options = Options::from_lookup(|name| Some(name.into()));
        assert_eq!(options.path, Some(ENV_PATH.into()));
        assert_eq!(options.archive, Some(ENV_ARCHIVE.into()));
        assert_eq!(options.sha256.as_deref(), Some(ENV_SHA256));
        assert_eq!(options.cache, Some(ENV_CACHE.into()));
        assert_eq!(options.rust_src, Some(ENV_RUST_SRC.into()));
        assert_eq!(options.bootstrap.as_deref(), Some(ENV_BOOTSTRAP));
    }

    #[test]
    fn a_relative_cache_becomes_absolute() {
        let options = Options {
            cache: Some("here".into()),
            ..Options::default()
        };
        assert!(options.cache_folder().unwrap().is_absolute());
    }
}
