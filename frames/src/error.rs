//! What can go wrong on the way to a picture.

use hankel_host::device::DeviceError;
use hankel_system::output::OutputError;

use crate::graph::GraphError;
use crate::measure::StoreError;
use crate::scene::SceneError;

/// Why there is no picture.
#[derive(Debug, thiserror::Error)]
pub enum FrameError {
    /// The scene's geometry.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// A pass that does not fit its kernels.
    #[error(transparent)]
    Graph(#[from] GraphError),
    /// The device.
    #[error("{during}: {source}")]
    Device {
        /// The pass, or what else was being done.
        during: String,
        /// What went wrong.
        source: DeviceError,
    },
    /// A shader that is not there.
    #[error("pass `{pass}`: there is no shader of kernel `{kernel}`: build the shaders first")]
    NoShader {
        /// The pass that needs it.
        pass: String,
        /// The kernel.
        kernel: String,
    },
    /// What a run was asked for does not fit the graph.
    #[error("`{value}`: {problem}")]
    Value {
        /// The value's label.
        value: String,
        /// What does not fit, and what to do.
        problem: String,
    },
    /// A picture that cannot be written.
    #[error(transparent)]
    Write(#[from] OutputError),
    /// A file of measurements.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// Pictures of different sizes.
    #[error("pictures of {left:?} and {right:?} pixels cannot be compared: render both alike")]
    Sizes {
        /// One's width and height.
        left: [u32; 2],
        /// The other's.
        right: [u32; 2],
    },
}

/// [`Result`](std::result::Result) of this crate.
pub type Result<T, E = FrameError> = std::result::Result<T, E>;

/// A device's error with what was being done.
pub(crate) fn during(what: &str) -> impl FnOnce(DeviceError) -> FrameError + '_ {
    move |source| FrameError::Device {
        during: what.into(),
        source,
    }
}
