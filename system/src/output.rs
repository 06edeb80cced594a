//! Files that a user asks for.
//!
//! [`Output::create`] finds out before the work whether the file can be written, and refuses one
//! that is also read. A regular file gets its new content at once, by [`Output::commit`]: until
//! then, and after an error, the old content stays. Its mode stays too, and where the name is a
//! symbolic link, what it points to is written. What is not a regular file, a device or a pipe, is
//! written to as it is.

use std::fs::{File, Metadata};
use std::io::{self, BufWriter, Seek, Write};
use std::path::{Path, PathBuf};

use tempfile::{NamedTempFile, TempPath};

use crate::{input, signals};

/// Why an output is not there.
#[derive(Debug, thiserror::Error)]
pub enum OutputError {
    /// The place cannot be written: what the user gave is wrong.
    #[error("cannot write {}: {problem}", path.display())]
    Place {
        /// The file.
        path: PathBuf,
        /// Why.
        problem: String,
        /// Whether it is for want of permission.
        forbidden: bool,
    },
    /// It is one of the files that are read.
    #[error("{} is read and would be overwritten: give another name for the output", path.display())]
    IsInput {
        /// The file.
        path: PathBuf,
    },
    /// Two outputs have the same place.
    #[error("{} is given for two outputs: give each a name of its own", path.display())]
    Twice {
        /// The file.
        path: PathBuf,
    },
    /// The system ran out of something, or lost the file, while it was written.
    #[error("cannot write {}: {source}", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
}

impl OutputError {
    /// The place is not one for a file, in words.
    fn place(path: &Path, error: &io::Error) -> Self {
        use io::ErrorKind as Kind;
        Self::Place {
            path: path.into(),
            problem: match error.kind() {
                Kind::NotFound => "there is no such folder".into(),
                Kind::IsADirectory => "it is a folder".into(),
                Kind::NotADirectory | Kind::AlreadyExists => {
                    "there is a file where a folder is expected".into()
                }
                // Without the name of a temporary file, which the user never gave.
                Kind::PermissionDenied => "this user may not write there".into(),
                Kind::ReadOnlyFilesystem => "the file system is read-only".into(),
                _ => error.to_string(),
            },
            forbidden: matches!(
                error.kind(),
                Kind::PermissionDenied | Kind::ReadOnlyFilesystem | Kind::StorageFull
            ),
        }
    }

    /// Writing failed.
    pub fn write(path: &Path, source: impl Into<io::Error>) -> Self {
        Self::Write {
            path: path.into(),
            source: source.into(),
        }
    }

    /// Whether the machine is to blame, and not what the user gave.
    #[must_use]
    pub const fn is_machine(&self) -> bool {
        matches!(
            self,
            Self::Write { .. }
                | Self::Place {
                    forbidden: true,
                    ..
                }
        )
    }
}

/// A file that is being written.
#[derive(Debug)]
pub struct Output {
    /// As the user gave it.
    path: PathBuf,
    way: Way,
}

#[derive(Debug)]
enum Way {
    /// A new file beside the target, whose place it takes.
    Replace {
        new: BufWriter<File>,
        /// Where the new file is.
        at: Temporary,
        /// The file behind all links.
        target: PathBuf,
    },
    /// A new file elsewhere, which is copied over the target: what cannot be replaced.
    Copy { new: BufWriter<File>, into: File },
    /// Straight into what is not a regular file.
    InPlace(BufWriter<File>),
}

/// The path of a temporary file, which goes with this or with the command.
#[derive(Debug)]
struct Temporary(Option<TempPath>);

impl Temporary {
    fn new(path: TempPath) -> Self {
        signals::remember(&path);
        Self(Some(path))
    }

    /// Puts the file in the target's place.
    fn persist(mut self, target: &Path) -> io::Result<()> {
        let Some(path) = self.0.take() else {
            return Ok(());
        };
        let remembered = path.to_path_buf();
        let result = path.persist(target).map_err(|error| error.error);
        signals::forget(&remembered);
        result
    }
}

impl Drop for Temporary {
    fn drop(&mut self) {
        if let Some(path) = self.0.take() {
            let remembered = path.to_path_buf();
            drop(path);
            signals::forget(&remembered);
        }
    }
}

impl Output {
    /// Begins a file. `inputs` are the files that the command reads.
    ///
    /// # Errors
    /// [`OutputError`]: nothing was changed then.
    pub fn create(path: &Path, inputs: &[&Path]) -> Result<Self, OutputError> {
        let fail = |error: io::Error| OutputError::place(path, &error);
        let target = behind_links(path).map_err(fail)?;
        let there = match target.metadata() {
            Ok(metadata) => Some(metadata),
            Err(error) if error.kind() == io::ErrorKind::NotFound => None,
            Err(error) => return Err(fail(error)),
        };
        if inputs.iter().any(|input| is_same(input, there.as_ref())) {
            return Err(OutputError::IsInput { path: path.into() });
        }
        if let Some(open) = standard_stream(&target) {
            let file = File::from(open.map_err(fail)?);
            return Ok(Self {
                path: path.into(),
                way: Way::InPlace(BufWriter::new(file)),
            });
        }
        let way = match &there {
            Some(metadata) if metadata.is_dir() => {
                return Err(fail(io::ErrorKind::IsADirectory.into()));
            }
            Some(metadata)
                if input::kind(&metadata.file_type()).is_some() || is_stream(&target) =>
            {
                // Neither made nor cut: what it is stays. A pipe waits for its reader.
                let file = File::options().append(true).open(&target);
                Way::InPlace(BufWriter::new(file.map_err(fail)?))
            }
            Some(metadata) => {
                // Also tells whether a file may be written in a folder that may.
                let old = File::options().write(true).open(&target).map_err(fail)?;
                match replace(&target, Some(metadata)) {
                    // Another name of the file is to see the new content, too.
                    Ok((new, at)) if !is_linked(metadata) => Way::Replace { new, at, target },
                    _ => copy(old, path)?,
                }
            }
            None => {
                let (new, at) = replace(&target, None).map_err(fail)?;
                Way::Replace { new, at, target }
            }
        };
        Ok(Self {
            path: path.into(),
            way,
        })
    }

    /// Puts what was written in its place.
    ///
    /// # Errors
    /// [`OutputError::Write`].
    pub fn commit(self) -> Result<(), OutputError> {
        let path = self.path;
        let done = match self.way {
            Way::InPlace(mut file) => file.flush(),
            Way::Copy { new, into } => finish(new).and_then(|new| overwrite(new, into)),
            Way::Replace { new, at, target } => finish(new).and_then(|new| {
                match at.persist(&target) {
                    // A file that is a mount of its own can be written, but not replaced.
                    Err(error) if error.kind() == io::ErrorKind::ResourceBusy => {
                        overwrite(new, File::options().write(true).open(&target)?)
                    }
                    other => other,
                }
            }),
        };
        done.map_err(|source| OutputError::Write { path, source })
    }

    /// Writes all at once and commits.
    ///
    /// # Errors
    /// [`OutputError::Write`].
    pub fn finish(mut self, bytes: &[u8]) -> Result<(), OutputError> {
        match self.write_all(bytes) {
            Ok(()) => self.commit(),
            Err(source) => Err(OutputError::Write {
                path: self.path,
                source,
            }),
        }
    }

    /// The file, as it was given.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    fn writer(&mut self) -> &mut BufWriter<File> {
        match &mut self.way {
            Way::Replace { new, .. } | Way::Copy { new, .. } | Way::InPlace(new) => new,
        }
    }
}

impl Write for Output {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.writer().write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.writer().flush()
    }
}

/// Begins a file for each path, all or none. `inputs` are the files that the command reads.
///
/// # Errors
/// [`OutputError`]: nothing was changed then.
pub fn create_all(paths: &[&Path], inputs: &[&Path]) -> Result<Vec<Output>, OutputError> {
    let mut targets: Vec<PathBuf> = Vec::new();
    for path in paths {
        let target = behind_links(path).unwrap_or_else(|_| path.to_path_buf());
        let target = std::path::absolute(&target).unwrap_or(target);
        let there = target.metadata().ok();
        let regular = there.as_ref().is_none_or(Metadata::is_file);
        // One file may have several names.
        let given = targets
            .iter()
            .any(|other| *other == target || is_same(other, there.as_ref()));
        if regular && given {
            return Err(OutputError::Twice {
                path: path.to_path_buf(),
            });
        }
        targets.push(target);
    }
    paths.iter().map(|p| Output::create(p, inputs)).collect()
}

/// Refuses outputs that are files which the command reads.
///
/// # Errors
/// [`OutputError::IsInput`].
pub fn refuse_inputs(
    outputs: impl IntoIterator<Item = PathBuf>,
    inputs: &[PathBuf],
) -> Result<(), OutputError> {
    for path in outputs {
        let there = path.metadata().ok();
        if there.is_some() && inputs.iter().any(|input| is_same(input, there.as_ref())) {
            return Err(OutputError::IsInput { path });
        }
    }
    Ok(())
}

/// Makes a folder for outputs, if it is not there, and finds out whether it can be written.
///
/// # Errors
/// [`OutputError::Place`].
pub fn folder(path: &Path) -> Result<(), OutputError> {
    let fail = |error: io::Error| OutputError::place(path, &error);
    std::fs::create_dir_all(path).map_err(fail)?;
    tempfile::tempfile_in(path).map(drop).map_err(fail)
}

/// The file that a name means, whether it is there or not.
fn behind_links(path: &Path) -> io::Result<PathBuf> {
    match path.metadata() {
        // What stands behind a link of `/proc`, as `/dev/stdout` is one, may have no name.
        Ok(there) if !there.is_file() || is_stream(path) => return Ok(path.to_owned()),
        Ok(_) => return path.canonicalize(),
        Err(error) if error.kind() == io::ErrorKind::NotFound => {}
        Err(error) => return Err(error),
    }
    let mut path = path.to_owned();
    // As many as Linux follows.
    for _ in 0..40 {
        let Ok(next) = std::fs::read_link(&path) else {
            return Ok(path);
        };
        path = match path.parent() {
            Some(folder) => folder.join(next),
            None => next,
        };
    }
    Err(io::Error::other("too many symbolic links in a row"))
}

/// Whether a name means what is open already, such as `/dev/stdout`. Files of `/dev/shm` are files.
fn is_stream(path: &Path) -> bool {
    let open = [
        "/dev/fd",
        "/dev/stdin",
        "/dev/stdout",
        "/dev/stderr",
        "/proc",
    ];
    cfg!(unix) && open.iter().any(|name| path.starts_with(name))
}

/// What is open already where a name means standard output or standard error. Opened once more, a file there would have a
/// position of its own, and what others write would go over what is written here.
#[cfg(unix)]
fn standard_stream(path: &Path) -> Option<io::Result<std::os::fd::OwnedFd>> {
    use std::os::fd::AsFd;
    let names = |word: &str, number: u8| {
        [
            format!("/dev/{word}"),
            format!("/dev/fd/{number}"),
            format!("/proc/self/fd/{number}"),
        ]
        .iter()
        .any(|name| path == Path::new(name))
    };
    if names("stdout", 1) {
        Some(io::stdout().as_fd().try_clone_to_owned())
    } else if names("stderr", 2) {
        Some(io::stderr().as_fd().try_clone_to_owned())
    } else {
        None
    }
}

#[cfg(not(unix))]
fn standard_stream(_: &Path) -> Option<io::Result<File>> {
    None
}

#[cfg(unix)]
fn is_same(input: &Path, output: Option<&Metadata>) -> bool {
    use std::os::unix::fs::MetadataExt;
    // Of a device or a pipe one may read and write.
    let Some(output) = output.filter(|m| m.is_file()) else {
        return false;
    };
    input
        .metadata()
        .is_ok_and(|m| (m.dev(), m.ino()) == (output.dev(), output.ino()))
}

#[cfg(not(unix))]
fn is_same(_: &Path, _: Option<&Metadata>) -> bool {
    false
}

/// Whether the file has another name.
#[cfg(unix)]
fn is_linked(metadata: &Metadata) -> bool {
    std::os::unix::fs::MetadataExt::nlink(metadata) > 1
}

#[cfg(not(unix))]
fn is_linked(_: &Metadata) -> bool {
    false
}

/// A new file beside `target`, with the mode and the owner of what is there, or else those of any
/// new file.
fn replace(target: &Path, there: Option<&Metadata>) -> io::Result<(BufWriter<File>, Temporary)> {
    let folder = match target.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    };
    let mut builder = tempfile::Builder::new();
    builder.prefix(".hankel-").suffix(".part");
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        // What the umask leaves of it.
        builder.permissions(std::fs::Permissions::from_mode(0o666));
    }
    let (file, path) = builder.tempfile_in(folder).map(NamedTempFile::into_parts)?;
    let path = Temporary::new(path);
    if let Some(there) = there {
        #[cfg(unix)]
        {
            use std::os::unix::fs::MetadataExt;
            let new = file.metadata()?;
            if (new.uid(), new.gid()) != (there.uid(), there.gid()) {
                std::os::unix::fs::fchown(&file, Some(there.uid()), Some(there.gid()))?;
            }
        }
        file.set_permissions(there.permissions())?;
    }
    Ok((BufWriter::new(file), path))
}

/// What cannot be replaced is copied into.
fn copy(into: File, path: &Path) -> Result<Way, OutputError> {
    let new = tempfile::tempfile().map_err(|source| OutputError::Write {
        path: path.into(),
        source,
    })?;
    Ok(Way::Copy {
        new: BufWriter::new(new),
        into,
    })
}

fn finish(new: BufWriter<File>) -> io::Result<File> {
    new.into_inner().map_err(io::IntoInnerError::into_error)
}

/// Without room for the new content, the old one stays.
fn overwrite(mut new: File, mut into: File) -> io::Result<()> {
    let length = new.seek(io::SeekFrom::End(0))?;
    new.rewind()?;
    reserve(&into, length)?;
    into.rewind()?;
    io::copy(&mut new, &mut into)?;
    into.set_len(length)?;
    into.flush()
}

/// Takes the room of a file of so many bytes, where the file system can tell whether there is.
#[cfg(target_os = "linux")]
fn reserve(file: &File, length: u64) -> io::Result<()> {
    use rustix::fs::{FallocateFlags, fallocate};
    use rustix::io::Errno;
    if length == 0 {
        return Ok(());
    }
    match fallocate(file, FallocateFlags::KEEP_SIZE, 0, length) {
        Err(Errno::NOSPC | Errno::DQUOT) => Err(Errno::NOSPC.into()),
        _ => Ok(()),
    }
}

#[cfg(not(target_os = "linux"))]
fn reserve(_: &File, _: u64) -> io::Result<()> {
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    fn write(path: &Path, text: &str) -> Result<(), OutputError> {
        Output::create(path, &[])?.finish(text.as_bytes())
    }

    fn names(folder: &Path) -> Vec<String> {
        let mut names: Vec<String> = fs::read_dir(folder)
            .unwrap()
            .map(|e| e.unwrap().file_name().into_string().unwrap())
            .collect();
        names.sort();
        names
    }

    #[test]
    fn a_file_is_there_whole_or_not_at_all() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("file");
        write(&path, "one").unwrap();
        let mut output = Output::create(&path, &[]).unwrap();
        output.write_all(b"two").unwrap();
        assert_eq!(fs::read_to_string(&path).unwrap(), "one");
        drop(output);
        assert_eq!(fs::read_to_string(&path).unwrap(), "one");
        write(&path, "three").unwrap();
        assert_eq!(fs::read_to_string(&path).unwrap(), "three");
        assert_eq!(names(folder.path()), ["file"]);
    }

    #[test]
    fn places_that_cannot_be_written_are_found_at_once() {
        let folder = tempfile::tempdir().unwrap();
        for (name, words) in [(".", "a folder"), ("nowhere/file", "no such folder")] {
            let error = Output::create(&folder.path().join(name), &[]).unwrap_err();
            assert!(error.to_string().contains(words), "{error}");
            assert!(!error.is_machine());
        }
        let file = folder.path().join("file");
        fs::write(&file, "x").unwrap();
        let error = super::folder(&file).unwrap_err().to_string();
        assert!(error.contains("a folder is expected"), "{error}");
        assert!(Output::create(&file.join("below"), &[]).is_err());
    }

    #[test]
    fn an_input_is_not_overwritten() {
        let folder = tempfile::tempdir().unwrap();
        let (input, link) = (folder.path().join("input"), folder.path().join("link"));
        fs::write(&input, "x").unwrap();
        fs::hard_link(&input, &link).unwrap();
        for output in [&input, &link] {
            let error = Output::create(output, &[&input]).unwrap_err();
            assert!(matches!(error, OutputError::IsInput { .. }), "{error}");
        }
        let (a, b) = (folder.path().join("new"), folder.path().join("./new"));
        for two in [[&a, &b], [&input, &link]] {
            let error = create_all(&two.map(PathBuf::as_path), &[]).unwrap_err();
            assert!(matches!(error, OutputError::Twice { .. }), "{error}");
        }
        assert_eq!(names(folder.path()), ["input", "link"]);
    }

    #[cfg(unix)]
    #[test]
    fn what_a_file_is_stays() {
        use std::os::unix::fs::{FileTypeExt, MetadataExt, PermissionsExt, symlink};
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        // Its mode.
        fs::write(at("private"), "old").unwrap();
        fs::set_permissions(at("private"), fs::Permissions::from_mode(0o600)).unwrap();
        write(&at("private"), "new").unwrap();
        assert_eq!(fs::metadata(at("private")).unwrap().mode() & 0o777, 0o600);
        // A link, also one whose file is not there yet.
        symlink("private", at("link")).unwrap();
        write(&at("link"), "through").unwrap();
        assert!(at("link").is_symlink());
        assert_eq!(fs::read_to_string(at("private")).unwrap(), "through");
        symlink("later", at("dangling")).unwrap();
        write(&at("dangling"), "text").unwrap();
        assert!(at("dangling").is_symlink());
        assert_eq!(fs::read_to_string(at("later")).unwrap(), "text");
        symlink("loop", at("loop")).unwrap();
        assert!(
            write(&at("loop"), "x")
                .unwrap_err()
                .to_string()
                .contains("links")
        );
        // Another name of the same file.
        fs::write(at("a"), "a longer text").unwrap();
        fs::hard_link(at("a"), at("b")).unwrap();
        write(&at("a"), "both").unwrap();
        assert_eq!(fs::read_to_string(at("b")).unwrap(), "both");
        // A pipe and a device.
        let made = std::process::Command::new("mkfifo")
            .arg(at("fifo"))
            .status();
        assert!(made.unwrap().success());
        let fifo = at("fifo");
        let reader = std::thread::spawn(move || fs::read_to_string(fifo).unwrap());
        write(&at("fifo"), "piped").unwrap();
        assert_eq!(reader.join().unwrap(), "piped");
        assert!(fs::metadata(at("fifo")).unwrap().file_type().is_fifo());
        symlink("/dev/null", at("null")).unwrap();
        write(&at("null"), "nothing").unwrap();
        assert!(at("null").is_symlink());
        assert!(
            fs::metadata("/dev/null")
                .unwrap()
                .file_type()
                .is_char_device()
        );
        // What is open already.
        let open = File::options()
            .create_new(true)
            .write(true)
            .read(true)
            .open(at("open"));
        let mut open = open.unwrap();
        open.write_all(b"one ").unwrap();
        use std::os::fd::AsRawFd;
        let name = format!("/proc/self/fd/{}", open.as_raw_fd());
        if Path::new(&name).exists() {
            write(Path::new(&name), "two").unwrap();
            assert_eq!(fs::read_to_string(at("open")).unwrap(), "one two");
        }
        // A file in memory is a file.
        if Path::new("/dev/shm").is_dir() {
            let shared = NamedTempFile::new_in("/dev/shm").unwrap();
            for text in ["a longer text", "short"] {
                write(shared.path(), text).unwrap();
                assert_eq!(fs::read_to_string(shared.path()).unwrap(), text);
            }
        }
        let error = write(Path::new("/dev/full"), "x").unwrap_err();
        assert!(error.is_machine(), "{error}");
    }
}
