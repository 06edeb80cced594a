//! Runs Hankel's kernels: on this machine's processor and on Vulkan, with one interface.

pub mod device;
