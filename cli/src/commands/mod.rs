//! One module for each command: it calls the library that does the work, and prints.

pub mod build;
pub mod check;
pub mod completions;
pub mod diff;
pub mod doctor;
pub mod eval;
#[cfg(feature = "frames")]
pub mod frame;
pub mod functions;
pub mod list;
pub mod new;
pub mod parity;
#[cfg(feature = "frames")]
pub mod plan;
#[cfg(feature = "frames")]
pub mod render;
pub mod sanitize;
#[cfg(feature = "frames")]
pub mod scene;
pub mod toolchain;
