//! From a kernel crate to shaders in every language, and a manifest that describes them.
//!
//! ```text
//! kernel crate --compile--> SPIR-V --finish--> final SPIR-V --translate--> WGSL HLSL MSL GLSL
//!                             bundle (committed)     |                         |
//!                                                    +------> build <----------+--> manifest, headers
//! ```
//!
//! Kernels are known by their descriptions ([`hankel_dsl::native::describe`]) and their SPIR-V
//! alone; which kernels there are, the caller says.

pub mod cost;
mod error;
pub mod finish;
mod language;
pub mod spirv;
pub mod translate;

pub use error::{Error, Failure, Result, Step};
pub use language::Language;

/// This crate's version, which the generated files name.
pub const VERSION: &str = env!("CARGO_PKG_VERSION");
