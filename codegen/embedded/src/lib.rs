//! The committed SPIR-V of the built-in kernels.
//!
//! ```text
//! Bundle::from_files(hankel_embedded::FILES)?.check_current(hankel_embedded::SOURCE_SHA256)?
//! ```
//!
//! tells whether it belongs to the kernels that this program was compiled with: their hash is
//! taken when the program is built. A crate of its own, so that an edited kernel does not compile
//! the code generator anew.

/// The sources of a crate.
#[derive(Clone, Copy, Debug)]
pub struct Source {
    /// Its name.
    pub name: &'static str,
    /// Its version.
    pub version: &'static str,
    /// Its licence.
    pub licence: &'static str,
    /// Its `.rs` files by their path from the crate's folder, and their texts.
    pub files: &'static [(&'static str, &'static str)],
}

include!(concat!(env!("OUT_DIR"), "/files.rs"));
