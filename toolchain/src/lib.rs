//! Finds, installs or builds rust-gpu's compiler.
//!
//! rust-gpu is a plug-in of one exact nightly rustc. There are five ways to such a
//! compiler; the first one that leads somewhere is used:
//!
//! 1. a folder that the user names (`HANKEL_TOOLCHAIN`),
//! 2. what was installed in the user's cache folder before (`HANKEL_CACHE`),
//! 3. an archive (`HANKEL_TOOLCHAIN_ARCHIVE`), unpacked into the cache,
//! 4. rustup's nightly, with the plug-in compiled by `cargo-gpu-install`,
//! 5. a build from source, from Debian's `rust-src` package and crates.io, into the
//!    cache: see `source/mod.rs`.
//!
//! [`find()`] says in milliseconds what can be used now. [`ensure`] also unpacks an archive
//! that was given. [`install()`] goes all the way, and [`status()`] explains every way to
//! people. [`pack`] makes an archive of an installed toolchain, for others or for CI.
//!
//! ```no_run
//! use hankel_toolchain::{Options, Silent, ensure};
//!
//! let toolchain = ensure(&Options::from_env(), &mut Silent)?;
//! println!("{} in {}", toolchain.rustc_version, toolchain.root.display());
//! # Ok::<(), hankel_toolchain::Error>(())
//! ```
//!
//! An installed toolchain is a folder that appeared whole, by a rename, and holds a
//! manifest to prove it; whatever interrupted runs leave behind is named so that it
//! cannot be mistaken for one, and the next run removes it or goes on from it. The folder
//! is never changed afterwards, so readers need no lock.

mod archive;
mod cache;
mod error;
mod find;
mod install;
mod manifest;
mod options;
pub mod pinned;
mod process;
mod progress;
mod rustup;
mod sha256;
mod source;
mod status;
mod toolchain;

pub use archive::{Packed, pack};
pub use error::{Error, Result};
pub use find::find;
pub use install::{Method, ensure, install};
pub use options::{
    ENV_ARCHIVE, ENV_BOOTSTRAP, ENV_CACHE, ENV_PATH, ENV_RUST_SRC, ENV_SHA256, Options,
};
pub use progress::{Progress, Silent};
pub use status::{State, Status, Way, status};
pub use toolchain::{Origin, Toolchain};

#[cfg(test)]
mod tests {
    use std::path::PathBuf;
    use std::sync::atomic::{AtomicU32, Ordering};

    /// An empty folder for one test.
    pub(crate) fn scratch(name: &str) -> PathBuf {
        static COUNT: AtomicU32 = AtomicU32::new(0);
        let count = COUNT.fetch_add(1, Ordering::Relaxed);
        let folder = format!("hankel-toolchain-{name}-{}-{count}", std::process::id());
        let folder = std::env::temp_dir().join(folder);
        std::fs::create_dir_all(&folder).unwrap();
        folder
    }
}
