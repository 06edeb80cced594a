//! The committed SPIR-V of the built-in kernels, and what this program was compiled from.
//!
//! ```text
//! Bundle::from_files(hankel_embedded::FILES)?.check_made(&kernels, rust_gpu)?
//! ```
//!
//! and [`STALE`] tell whether it belongs to the kernels that this program was compiled with. A
//! crate of its own, so that an edited kernel does not compile the code generator anew.

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
