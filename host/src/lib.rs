//! Runs Hankel's kernels: on this machine's processor and on Vulkan, with one interface.

pub mod crates;
pub mod device;
pub mod eval;
pub mod flat;
pub mod flush;
pub mod inputs;
pub mod parity;
pub mod worker;
