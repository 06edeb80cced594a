//! How a command ends, and its exit code.

use std::fmt;
use std::io::ErrorKind;
use std::path::Path;

use hankel_codegen as codegen;
#[cfg(feature = "frames")]
use hankel_frames::graph::GraphError;
#[cfg(feature = "frames")]
use hankel_frames::{FrameError, measure::StoreError, scene::SceneError};
use hankel_host::crates::CrateError;
use hankel_host::device::DeviceError;
use hankel_host::eval::EvalError;
use hankel_system::input::InputError;
use hankel_system::output::OutputError;
use hankel_system::signals;
use hankel_system::text::{shortened, visible};
use miette::Diagnostic;

/// How a command that ran to its end ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// Exit code 0.
    Fine,
    /// Exit code 1: what was checked is not as it should be.
    CheckFailed,
}

impl Outcome {
    pub const fn of(fine: bool) -> Self {
        if fine { Self::Fine } else { Self::CheckFailed }
    }
}

/// Whose turn it is, which is the exit code.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Blame {
    /// 1: a kernel does not compile, or does not pass through the tools.
    Kernel,
    /// 2: the command's arguments or the files that they name.
    Input,
    /// 3: something that the machine lacks.
    Machine,
}

/// Why a command did not run to its end.
#[derive(Debug)]
pub struct Failure {
    blame: Blame,
    message: String,
    help: Option<String>,
}

pub type Result<T> = std::result::Result<T, Failure>;

impl Failure {
    pub fn new(blame: Blame, error: &dyn std::error::Error, help: Option<String>) -> Self {
        let mut message = error.to_string();
        let mut source = error.source();
        while let Some(cause) = source {
            let text = cause.to_string();
            // Some errors print their source themselves.
            if !message.contains(&text) {
                message.push_str(": ");
                message.push_str(&text);
            }
            source = cause.source();
        }
        Self::say(blame, &message, help.as_deref())
    }

    /// Words of others are among them: they are shown without effect on the terminal.
    fn say(blame: Blame, message: &str, help: Option<&str>) -> Self {
        Self {
            blame,
            message: shortened(&visible(message)).into_owned(),
            help: help.map(|help| visible(help).into_owned()),
        }
    }

    /// What the arguments, or files that they name, got wrong.
    pub fn input(message: impl AsRef<str>, help: impl AsRef<str>) -> Self {
        Self::say(Blame::Input, message.as_ref(), Some(help.as_ref()))
    }

    /// What the machine lacks.
    pub fn machine(message: impl AsRef<str>, help: Option<String>) -> Self {
        Self::say(Blame::Machine, message.as_ref(), help.as_deref())
    }

    pub const fn code(&self) -> u8 {
        match self.blame {
            Blame::Kernel => 1,
            Blame::Input => 2,
            Blame::Machine => 3,
        }
    }
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.message)
    }
}

impl std::error::Error for Failure {}

impl Diagnostic for Failure {
    fn help<'a>(&'a self) -> Option<Box<dyn fmt::Display + 'a>> {
        self.help.as_ref().map(|help| Box::new(help) as _)
    }
}

impl From<codegen::Error> for Failure {
    fn from(error: codegen::Error) -> Self {
        use codegen::Error as E;
        let blame = match &error {
            E::Kernel(failure) if failure.step == codegen::Step::Place => Blame::Input,
            E::Kernels(all) if all.iter().all(|it| it.step == codegen::Step::Place) => Blame::Input,
            E::Compile { .. }
            | E::Source(_)
            | E::NoEntryPoint { .. }
            | E::Kernel(_)
            | E::Kernels(_) => Blame::Kernel,
            E::DuplicateKernel { .. }
            | E::DuplicateLayout { .. }
            | E::Function(_)
            | E::Api { .. } => Blame::Kernel,
            // A file where a folder is wanted, or the other way round.
            E::Io { source, .. } if is_misplaced(source.kind()) => Blame::Input,
            E::Io { .. } | E::Run { .. } | E::Stale { .. } | E::Bundle { .. } | E::Busy { .. } => {
                Blame::Machine
            }
            _ => Blame::Input,
        };
        Self::new(blame, &error, error.advice())
    }
}

impl From<CrateError> for Failure {
    fn from(error: CrateError) -> Self {
        let blame = match &error {
            CrateError::Build { .. } => Blame::Kernel,
            CrateError::NoCargo { .. } | CrateError::Record(_) => Blame::Machine,
            _ => Blame::Input,
        };
        Self::new(blame, &error, None)
    }
}

/// Whether a path leads to something of another kind, or nowhere.
fn is_misplaced(kind: ErrorKind) -> bool {
    matches!(
        kind,
        ErrorKind::AlreadyExists
            | ErrorKind::NotADirectory
            | ErrorKind::IsADirectory
            | ErrorKind::InvalidFilename
    )
}

pub fn blame_of_input(error: &InputError) -> Blame {
    match error.is_machine() {
        true => Blame::Machine,
        false => Blame::Input,
    }
}

pub fn blame_of_output(error: &OutputError) -> Blame {
    // Whoever read it has closed the pipe, and does not want to be told.
    if matches!(error, OutputError::Write { source, .. } if source.kind() == ErrorKind::BrokenPipe)
    {
        signals::end_of_pipe();
    }
    match error.is_machine() {
        true => Blame::Machine,
        false => Blame::Input,
    }
}

impl From<OutputError> for Failure {
    fn from(error: OutputError) -> Self {
        Self::new(blame_of_output(&error), &error, None)
    }
}

/// A device's own troubles are the machine's; calls that it refuses are a kernel's.
fn blame_of(error: &DeviceError) -> Blame {
    match error {
        DeviceError::NoDriver { .. }
        | DeviceError::NoDevice { .. }
        | DeviceError::Missing { .. }
        | DeviceError::Lost { .. }
        | DeviceError::OutOfMemory { .. }
        | DeviceError::Limit { .. } => Blame::Machine,
        _ => Blame::Kernel,
    }
}

impl From<DeviceError> for Failure {
    fn from(error: DeviceError) -> Self {
        Self::new(blame_of(&error), &error, None)
    }
}

impl From<EvalError> for Failure {
    fn from(error: EvalError) -> Self {
        let blame = match &error {
            EvalError::Device(error) => blame_of(error),
            EvalError::Row { .. } => Blame::Kernel,
            EvalError::Input(error) => blame_of_input(error),
            EvalError::Output(error) => blame_of_output(error),
            _ => Blame::Input,
        };
        Self::new(blame, &error, None)
    }
}

#[cfg(feature = "frames")]
impl From<SceneError> for Failure {
    fn from(error: SceneError) -> Self {
        let blame = match &error {
            SceneError::Read(error) => blame_of_input(error),
            _ => Blame::Input,
        };
        Self::new(blame, &error, None)
    }
}

#[cfg(feature = "frames")]
impl From<FrameError> for Failure {
    fn from(error: FrameError) -> Self {
        let blame = match &error {
            FrameError::Scene(_) | FrameError::Sizes { .. } | FrameError::Value { .. } => {
                Blame::Input
            }
            FrameError::Graph(GraphError::Light { .. }) => Blame::Input,
            FrameError::Device { source, .. } => blame_of(source),
            FrameError::Graph(_) | FrameError::NoShader { .. } => Blame::Kernel,
            FrameError::Write(error) => blame_of_output(error),
            FrameError::Store(StoreError::Input(error)) => blame_of_input(error),
            FrameError::Store(StoreError::Io { source, .. }) if !is_misplaced(source.kind()) => {
                Blame::Machine
            }
            FrameError::Store(_) => Blame::Input,
        };
        Self::new(blame, &error, None)
    }
}

impl From<hankel_toolchain::Error> for Failure {
    fn from(error: hankel_toolchain::Error) -> Self {
        use hankel_toolchain::Error as E;
        let blame = match &error {
            E::Input(error) => blame_of_input(error),
            E::Output(error) => blame_of_output(error),
            E::ChecksumSyntax { .. }
            | E::ChecksumUnknown { .. }
            | E::NotAToolchain { .. }
            | E::NotAToolchainArchive { .. }
            | E::UnsafeEntry { .. } => Blame::Input,
            // What was given, and not what was downloaded.
            E::Checksum { path, .. } if !is_kept(path) => Blame::Input,
            // The bytes are no archive, or not all of one; other kinds are the disk's.
            E::Archive { source, .. } if is_of_content(source.kind()) => Blame::Input,
            // Only what was given is opened without being looked for first.
            E::Io {
                action: "open",
                source,
                ..
            } if source.kind() == ErrorKind::NotFound => Blame::Input,
            E::Io { source, .. } if is_misplaced(source.kind()) => Blame::Input,
            _ => Blame::Machine,
        };
        Self::new(blame, &error, None)
    }
}

/// Whether a file lies among those that are kept between runs.
fn is_kept(path: &Path) -> bool {
    let folder = hankel_toolchain::Options::from_env().cache_folder();
    folder.is_ok_and(|folder| path.starts_with(folder))
}

/// Whether it is what was read that is wrong, and not how it was read.
fn is_of_content(kind: ErrorKind) -> bool {
    matches!(
        kind,
        ErrorKind::InvalidData
            | ErrorKind::InvalidInput
            | ErrorKind::UnexpectedEof
            | ErrorKind::Other
    )
}

#[cfg(test)]
mod tests {
    use std::io;

    use hankel_toolchain::Error;

    use super::*;

    #[test]
    fn what_was_given_is_misuse_and_the_rest_is_the_machine() {
        let given = Path::new("given");
        let of_io = |action, kind: ErrorKind| Error::Io {
            action,
            path: given.into(),
            source: io::Error::from(kind),
        };
        let archive = |kind: ErrorKind| Error::Archive {
            path: given.into(),
            source: io::Error::from(kind),
        };
        let checksum = |path: &Path| Error::Checksum {
            path: path.into(),
            expected: String::new(),
            actual: String::new(),
        };
        let cache = hankel_toolchain::Options::from_env().cache_folder();
        let download = cache.unwrap().join("download");
        for (code, error) in [
            (2, of_io("open", ErrorKind::NotFound)),
            (2, of_io("create", ErrorKind::AlreadyExists)),
            (3, of_io("read", ErrorKind::NotFound)),
            (3, of_io("create", ErrorKind::PermissionDenied)),
            (3, of_io("write", ErrorKind::StorageFull)),
            (2, archive(ErrorKind::UnexpectedEof)),
            (3, archive(ErrorKind::PermissionDenied)),
            (2, checksum(given)),
            (3, checksum(&download)),
            (2, Error::ChecksumSyntax { text: "zz".into() }),
            (3, Error::NoCacheFolder),
        ] {
            let failure = Failure::from(error);
            assert_eq!(failure.code(), code, "{failure}");
        }
    }
}
