//! The committed SPIR-V of the built-in kernels.
//!
//! ```text
//! Bundle::from_files(hankel_embedded::FILES)?.check_current(hankel_embedded::SOURCE_SHA256)?
//! ```
//!
//! tells whether it belongs to the kernels that this program was compiled with: their hash is
//! taken when the program is built. A crate of its own, so that an edited kernel does not compile
//! the code generator anew.

include!(concat!(env!("OUT_DIR"), "/files.rs"));
