//! The host's half of the DSL: descriptions, untyped calls, the native executors. Not compiled
//! for SPIR-V.

pub mod call;
pub mod channel;
pub mod describe;
#[doc(hidden)]
pub mod exec;
#[doc(hidden)]
pub mod fragment;
pub mod function;
pub mod inputs;
#[doc(hidden)]
pub mod lanes;
pub mod layout;
pub mod plugin;
pub(crate) mod sampling;
pub mod sanitize;
#[doc(hidden)]
pub mod subgroup;
pub mod texel;
#[doc(hidden)]
pub mod workgroup;

pub use call::{
    Address, Arg, Call, CallError, Compare, Deviation, Filter, Levels, Mode, Run, SUBGROUP_SIZE,
    SUBGROUP_SIZES, Sampler, TextureMut, TextureRef, level_size, texture_bytes,
};

/// An entry point: what it is, and its native code.
#[derive(Clone, Debug)]
pub struct Entry {
    /// What it is.
    pub kernel: describe::Kernel,
    /// Its native code.
    pub run: Run,
    /// The author's own inputs for parity.
    pub inputs: Option<inputs::Make>,
}

/// Bytes of push constants that every device with Vulkan has.
pub const PUSH_CONSTANT_BYTES: usize = 128;

#[doc(hidden)]
pub use std::vec::Vec;

/// The entry points of a crate.
pub type Entries = Vec<Entry>;
