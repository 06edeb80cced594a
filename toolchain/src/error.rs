//! What can go wrong. Every message names the input and says what to do about it.

use std::path::{Path, PathBuf};

/// A toolchain could not be found, installed, built or packed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// Reading or writing failed.
    #[error("cannot {action} {}: {source}", path.display())]
    Io {
        /// What was attempted, as a verb: `read`, `create`, ...
        action: &'static str,
        /// The file or folder.
        path: PathBuf,
        /// Why not.
        source: std::io::Error,
    },

    /// A file that was given cannot be read.
    #[error(transparent)]
    Input(#[from] hankel_system::input::InputError),

    /// A file that was asked for cannot be written.
    #[error(transparent)]
    Output(#[from] hankel_system::output::OutputError),

    /// Nothing usable is there, and nothing was given to install it from.
    #[error(
        "no rust-gpu compiler is installed in {} and none was given\n\
         help: run `hankel toolchain install`, or set HANKEL_TOOLCHAIN_ARCHIVE to an archive \
         of one, or HANKEL_TOOLCHAIN to the folder of one",
        cache.display()
    )]
    NotInstalled {
        /// The cache folder that was searched.
        cache: PathBuf,
    },

    /// The folder that was given holds no compiler.
    #[error(
        "{} is not a rust-gpu toolchain: {why}\n\
         help: HANKEL_TOOLCHAIN must be the folder that holds `bin/rustc` and `lib/{}`; \
         unset it to use the installed one",
        path.display(), crate::pinned::BACKEND_FILE
    )]
    NotAToolchain {
        /// The folder.
        path: PathBuf,
        /// What is missing or wrong.
        why: String,
    },

    /// An installed toolchain is not what was installed.
    #[error(
        "the toolchain installed in {} is damaged: {why}\n\
         help: run `hankel toolchain install` to replace it",
        path.display()
    )]
    Damaged {
        /// Its folder.
        path: PathBuf,
        /// The first thing found wrong.
        why: String,
    },

    /// A file's SHA-256 is not the one it must have.
    #[error(
        "wrong checksum of {}\n  expected {expected}\n  actual   {actual}\n\
         help: the file is damaged, or it is another file: download it again; for an archive that you \
         packed yourself, give the checksum with --sha256 ({})",
        path.display(),
        crate::options::ENV_SHA256,
    )]
    Checksum {
        /// The file.
        path: PathBuf,
        /// SHA-256 that it must have, in hexadecimal.
        expected: String,
        /// SHA-256 that it has.
        actual: String,
    },

    /// Nothing says which SHA-256 an archive must have.
    #[error(
        "no checksum is known for {}\n\
         help: put a SHA256SUMS file that names it beside it, or give its SHA-256 \
         with --sha256 ({})",
        path.display(),
        crate::options::ENV_SHA256,
    )]
    ChecksumUnknown {
        /// The archive.
        path: PathBuf,
    },

    /// A checksum that was given is not 64 hexadecimal digits.
    #[error("`{text}` is not a SHA-256: 64 hexadecimal digits are expected")]
    ChecksumSyntax {
        /// What was given.
        text: String,
    },

    /// An archive cannot be decompressed or its entries not be read.
    #[error(
        "{} cannot be unpacked: {source}\n\
         help: it may be truncated, or not a .tar.zst archive: download it again, or pack it again with `hankel toolchain pack`",
        path.display()
    )]
    Archive {
        /// The archive.
        path: PathBuf,
        /// Why not.
        source: std::io::Error,
    },

    /// An archive wants to write outside the folder that it is unpacked into.
    #[error(
        "refused to unpack {}: its entry `{entry}` is outside of the target folder",
        path.display()
    )]
    UnsafeEntry {
        /// The archive.
        path: PathBuf,
        /// The entry's name.
        entry: String,
    },

    /// An archive has the right checksum but holds no toolchain.
    #[error("{} does not contain a rust-gpu toolchain: {why}", path.display())]
    NotAToolchainArchive {
        /// The archive.
        path: PathBuf,
        /// What is missing or wrong.
        why: String,
    },

    /// The disk is too full.
    #[error(
        "not enough space in {}: {} MB needed, {} MB available\n\
         help: free some space, or set HANKEL_CACHE to a folder on another disk",
        folder.display(), needed.div_ceil(1_000_000), available / 1_000_000
    )]
    NoSpace {
        /// Where it would have been written.
        folder: PathBuf,
        /// Bytes needed.
        needed: u64,
        /// Bytes available.
        available: u64,
    },

    /// A way to a toolchain does not exist for this machine.
    #[error("{method} does not support {host}\nhelp: {help}")]
    UnknownPlatform {
        /// The way.
        method: &'static str,
        /// This machine's target triple.
        host: String,
        /// What to do instead.
        help: String,
    },

    /// Programs that a build needs are not installed.
    #[error("missing: {}\nhelp: {help}", tools.join(", "))]
    MissingTools {
        /// The programs, and what is wrong with each where it is not plain absence.
        tools: Vec<String>,
        /// The command that installs them.
        help: String,
    },

    /// A program failed.
    #[error("{what} failed ({status}); its output is in {}{}", log.display(), indent(tail))]
    Command {
        /// What was being done.
        what: String,
        /// How the program ended.
        status: String,
        /// File with everything that it printed.
        log: PathBuf,
        /// The end of that.
        tail: String,
    },

    /// A download failed.
    #[error("{what} could not be downloaded\nhelp: {help}{}", indent(tail))]
    Network {
        /// What was to be downloaded.
        what: String,
        /// What to do instead.
        help: String,
        /// The end of the downloading program's output.
        tail: String,
    },

    /// A source file is not as the edit that it needs expects it.
    #[error(
        "cannot patch {}: {why}\n\
         help: the edits fit rust-src {} and rust-gpu {} only",
        path.display(), crate::pinned::RUST_VERSION, crate::pinned::RUST_GPU_VERSION
    )]
    Patch {
        /// The file.
        path: PathBuf,
        /// What was not found.
        why: String,
    },

    /// rustup or cargo-gpu-install failed.
    #[error("rustup's toolchain could not be installed: {why}\nhelp: {help}")]
    Rustup {
        /// Why not.
        why: String,
        /// What to do instead.
        help: String,
    },

    /// The user has no cache folder.
    #[error("no cache folder: neither HANKEL_CACHE nor HOME is set\nhelp: set HANKEL_CACHE")]
    NoCacheFolder,

    /// None of the ways leads to a toolchain here.
    #[error("no way to install a rust-gpu compiler here:{}", indent(&reasons.join("\n")))]
    NoMethod {
        /// Why each of them does not.
        reasons: Vec<String>,
    },

    /// Only a self-contained toolchain can be packed.
    #[error(
        "{} cannot be packed: it is a toolchain of rustup, not a self-contained folder",
        path.display()
    )]
    NotPackable {
        /// Where it is.
        path: PathBuf,
    },
}

/// Shorthand for this crate's results.
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// `text` on lines of its own, set in.
fn indent(text: &str) -> String {
    text.lines().flat_map(|line| ["\n    ", line]).collect()
}

/// Adds to an I/O error what was attempted on which path.
pub(crate) trait During<T> {
    /// `action` is a verb that reads well after "cannot".
    fn during(self, action: &'static str, path: &Path) -> Result<T>;
}

impl<T> During<T> for std::io::Result<T> {
    fn during(self, action: &'static str, path: &Path) -> Result<T> {
        self.map_err(|source| Error::Io {
            action,
            path: path.to_owned(),
            source,
        })
    }
}
