//! What can go wrong on a device.

use hankel_dsl::native::CallError;

/// Why a device did not do what it was asked. The device stays usable unless it is
/// [`DeviceError::Lost`].
#[derive(Debug, thiserror::Error)]
pub enum DeviceError {
    /// There is no Vulkan driver on this machine, or none that works.
    #[error(
        "no Vulkan device was found ({detail}). Install a driver: on Debian and Ubuntu \
         `apt-get install mesa-vulkan-drivers libvulkan1` gives lavapipe, which needs no GPU; \
         VK_DRIVER_FILES chooses among several drivers"
    )]
    NoDriver {
        /// What the Vulkan loader or wgpu said.
        detail: String,
    },
    /// The adapter is there, but gave no device.
    #[error("{adapter} gave no device: {detail}")]
    NoDevice {
        /// The adapter's name.
        adapter: String,
        /// What wgpu said.
        detail: String,
    },
    /// The device cannot do what the kernel needs.
    #[error("{device} lacks {feature}, which {what} needs")]
    Missing {
        /// The device's name.
        device: String,
        /// What it lacks.
        feature: String,
        /// Who needs it: a kernel or a texture.
        what: String,
    },
    /// The device is gone: the driver crashed, was reset, or the GPU was taken away.
    #[error("{device} was lost while {during}: {detail}")]
    Lost {
        /// The device's name.
        device: String,
        /// What it was doing.
        during: String,
        /// What the driver said.
        detail: String,
    },
    /// Not enough memory.
    #[error("out of memory while {during}; use smaller buffers or textures, or free some first")]
    OutOfMemory {
        /// What was being done.
        during: String,
    },
    /// Something is larger than the device allows.
    #[error("{what} is {wanted}, but {device} allows at most {limit}")]
    Limit {
        /// What is too large.
        what: String,
        /// How large it is.
        wanted: u64,
        /// The most the device allows.
        limit: u64,
        /// The device's name.
        device: String,
    },
    /// wgpu, naga or the driver refused something.
    #[error("refused while {during}: {detail}")]
    Refused {
        /// What was being done, with the kernel's name.
        during: String,
        /// What was said.
        detail: String,
    },
    /// Too few or too many arguments.
    #[error("kernel `{kernel}` takes {expected} arguments ({names}), {got} were given")]
    Count {
        /// The kernel's name.
        kernel: String,
        /// How many it takes.
        expected: usize,
        /// Their names, in order.
        names: String,
        /// How many were given.
        got: usize,
    },
    /// An argument that does not fit the description.
    #[error("kernel `{kernel}`, {argument}: {problem}")]
    Argument {
        /// The kernel's name.
        kernel: String,
        /// The argument's name and binding.
        argument: String,
        /// What does not fit, and what would.
        problem: String,
    },
    /// Values for specialisation constants that the kernel or its code does not take.
    #[error("kernel `{kernel}`: {problem}")]
    Constants {
        /// The kernel's name.
        kernel: String,
        /// What does not fit.
        problem: String,
    },
    /// The program holds no code that this device runs.
    #[error("kernel `{kernel}` was given without {wanted}, which {device} runs")]
    NoCode {
        /// The kernel's name.
        kernel: String,
        /// The kind of code that is missing.
        wanted: &'static str,
        /// The device's name.
        device: String,
    },
    /// A kernel of a stage that cannot be run this way.
    #[error("kernel `{kernel}` is a {stage} kernel: {problem}")]
    Stage {
        /// The kernel's name.
        kernel: String,
        /// Its stage.
        stage: &'static str,
        /// What to do instead.
        problem: String,
    },
    /// A render pass whose targets, depth buffer or buffers do not fit together.
    #[error("render pass `{pass}`: {problem}")]
    Pass {
        /// The pass's label.
        pass: String,
        /// What does not fit.
        problem: String,
    },
    /// A buffer or texture that this device did not make, or that was freed.
    #[error("{what} does not belong to {device}, or was freed")]
    Handle {
        /// Which.
        what: String,
        /// The device's name.
        device: String,
    },
    /// A transfer of the wrong size, or of something that cannot be transferred.
    #[error("{what}: {problem}")]
    Transfer {
        /// The buffer or texture.
        what: String,
        /// What does not fit.
        problem: String,
    },
    /// The native executor refused or failed.
    #[error("kernel `{kernel}`: {source}")]
    Native {
        /// The kernel's name.
        kernel: String,
        /// Why.
        #[source]
        source: CallError,
    },
}

/// [`Result`] of a device.
pub type Result<T> = std::result::Result<T, DeviceError>;
