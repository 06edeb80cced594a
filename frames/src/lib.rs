//! Frames as graphs of kernels.
//!
//! A [`Scene`](scene::Scene) says what there is and how its shadows are made. Its
//! [technique](techniques) adds passes to a [`Graph`](graph::Graph), in which everything is checked
//! before anything runs. An [`Executor`] runs the graph on a device, and each time only the passes
//! whose inputs have changed.
//!
//! The same kernels run on this machine's processor and on Vulkan. Only [`visibility`] differs:
//! Vulkan rasterises with four samples in a pixel; natively a ray is cast through each sample, and
//! the fragment kernel runs over the array of what the rays found. Nothing is approximated on one
//! side only, so pictures differ where a sample lies so near an edge that rounding decides what it
//! sees, and where a sampler rounds.

mod error;
mod executor;
mod export;
mod frame;
pub mod graph;
mod lights;
pub mod measure;
pub mod passes;
mod picture;
pub mod plan;
pub mod scattering;
pub mod scene;
pub mod techniques;
pub mod truth;
pub mod visibility;
mod volume;

pub use error::{FrameError, Result};
pub use executor::{Clock, Executor, Memory, NoShaders, Progress, Quiet, Run, Shaders, Timing};
pub use export::{export, recorded, recorded_medium};
pub use frame::{
    AMPLIFICATION, Comparison, Frame, Rendering, Show, compare, graph as graph_of, render,
    render_on,
};
pub use picture::{Difference, Linear, Picture};

/// The page about frames: its code is compiled and run.
#[cfg(doctest)]
#[doc = include_str!("../../docs/frames.md")]
struct Page;
