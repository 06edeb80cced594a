//! What can go wrong on the way to a picture.

use hankel_system::output::OutputError;

use crate::device::DeviceError;
use crate::scene::SceneError;

/// Why there is no picture.
#[derive(Debug, thiserror::Error)]
pub enum FrameError {
    /// The scene's geometry.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// The device.
    #[error("{during}: {source}")]
    Device {
        /// The pass or what came before it.
        during: String,
        /// What went wrong.
        source: DeviceError,
    },
    /// A kernel that a pass needs is not there, or is not what the pass takes it for.
    #[error("kernel `{kernel}`: {problem}")]
    Kernel {
        /// Its name.
        kernel: String,
        /// What is wrong, and what to do.
        problem: String,
    },
    /// A picture that cannot be written.
    #[error(transparent)]
    Write(#[from] OutputError),
    /// Pictures of different sizes.
    #[error("pictures of {left:?} and {right:?} pixels cannot be compared: render both alike")]
    Sizes {
        /// One's width and height.
        left: [u32; 2],
        /// The other's.
        right: [u32; 2],
    },
}

/// [`Result`](std::result::Result) of this module.
pub type Result<T> = std::result::Result<T, FrameError>;
