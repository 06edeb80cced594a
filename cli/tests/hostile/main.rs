//! The command line in the hands of somebody hostile, or unlucky: every way that was found to lose
//! a file, to hang, to crash, to eat all memory or to run somebody else's code, each tried again.
#![cfg(unix)]

#[path = "../desk/mod.rs"]
mod desk;

mod folders;
mod inputs;
mod kernels;
mod names;
mod outputs;
mod planted;
mod signals;
mod streams;
