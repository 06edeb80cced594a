//! From a kernel crate to shaders in every language, and a manifest that describes them.
//!
//! ```text
//! kernel crate --compile--> SPIR-V --finish--> final SPIR-V --translate--> WGSL HLSL MSL GLSL
//!                                                |      |                      |
//!                                             bundle    +-------> build <------+--> manifest, headers
//!                                           (committed)             |
//!                                                                 check
//! ```
//!
//! Kernels are known by their descriptions ([`hankel_dsl::native::describe`]) and their SPIR-V
//! alone; which kernels there are, the caller says.
//!
//! [`build::build`] is the way in for whoever wants files, [`build::generate`] for whoever wants
//! them in memory; the modules before those are usable by themselves.

pub mod build;
pub mod bundle;
pub mod check;
mod comment;
pub mod compile;
pub mod cost;
pub mod diagnostics;
pub mod diff;
mod error;
pub mod files;
pub mod finish;
pub mod finished;
mod folder;
pub mod frame;
pub mod functions;
mod gather;
pub mod headers;
pub mod inputs;
mod kept;
mod language;
mod library;
mod link;
pub mod lint;
pub mod manifest;
mod messages;
pub mod placement;
mod registers;
pub mod scaffold;
pub mod spirv;
pub mod translate;
pub mod translated;

pub use error::{Error, Failure, Result, Step};
pub use language::Language;

/// This crate's version, which the generated files name.
pub const VERSION: &str = env!("CARGO_PKG_VERSION");

impl From<inputs::InputError> for Error {
    fn from(error: inputs::InputError) -> Self {
        Self::Inputs {
            path: error.path,
            problem: error.problem,
        }
    }
}
