//! Toolchains as one file: `.tar.zst`, entries relative to the sysroot.

use std::fs::{self, File};
use std::io::{self, BufReader, Read, Write};
use std::path::{Component, Path, PathBuf};

use hankel_system::input;
use hankel_system::output::Output;
use sha2::Digest;

use crate::cache::{Staging, check_space};
use crate::error::{During, Error, Result};
use crate::manifest;
use crate::options::Options;
use crate::pinned;
use crate::progress::Progress;
use crate::sha256::{Hashing, hex};
use crate::toolchain::Toolchain;

/// An unpacked toolchain is about five times as large as its archive.
const EXPANSION: u64 = 6;

/// zstd's level for packing: it is done once and read often.
const LEVEL: i32 = 19;

/// Most bytes of a `SHA256SUMS` file.
const MAX_SUMS: u64 = 16 << 20;

/// Bytes between two reports of progress.
const REPORT_EVERY: u64 = 1 << 20;

/// A file that `pack` wrote.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Packed {
    /// The archive. A `SHA256SUMS` file beside it names it.
    pub path: PathBuf,
    /// Its SHA-256 in hexadecimal.
    pub sha256: String,
    /// Its size.
    pub bytes: u64,
}

/// The checksum that `archive` must have: the one that was given, else the one built in for an
/// archive of that name, else the one in a `SHA256SUMS` file beside it. Who replaces an archive can
/// replace the file beside it, too.
pub(crate) fn expected_sha256(options: &Options, archive: &Path) -> Result<String> {
    if let Some(given) = &options.sha256 {
        return checked_syntax(given);
    }
    let name = archive.file_name().unwrap_or_default().to_string_lossy();
    if let Some((_, sum)) = pinned::ARCHIVES.iter().find(|(known, _)| *known == name) {
        return Ok((*sum).to_owned());
    }
    let sums = archive.with_file_name("SHA256SUMS");
    match input::read_text(&sums, MAX_SUMS) {
        Ok(text) => match in_sums(&text, &name) {
            Some(sum) => checked_syntax(sum),
            None => Err(Error::ChecksumUnknown {
                path: archive.to_owned(),
            }),
        },
        Err(error) if error.is_missing() => Err(Error::ChecksumUnknown {
            path: archive.to_owned(),
        }),
        Err(error) => Err(error.into()),
    }
}

/// The checksum of `name` in the text of a `SHA256SUMS` file.
fn in_sums<'a>(text: &'a str, name: &str) -> Option<&'a str> {
    text.lines().find_map(|line| {
        let (sum, file) = line.split_once(char::is_whitespace)?;
        // Two spaces, or a space and `*` for binary files; `./` where find was used.
        let file = file.trim().trim_start_matches('*').trim_start_matches("./");
        (file == name).then_some(sum)
    })
}

fn checked_syntax(text: &str) -> Result<String> {
    let sum = text.trim().to_ascii_lowercase();
    if sum.len() == 64 && sum.bytes().all(|byte| byte.is_ascii_hexdigit()) {
        return Ok(sum);
    }
    Err(Error::ChecksumSyntax {
        text: text.to_owned(),
    })
}

/// Reports what passes through it.
struct Reporting<'a, R> {
    inner: R,
    progress: &'a mut dyn Progress,
    done: u64,
    reported: u64,
    total: u64,
}

impl<R: Read> Read for Reporting<'_, R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let count = self.inner.read(buffer)?;
        self.done += count as u64;
        if self.done >= self.reported + REPORT_EVERY || (count == 0 && self.done != self.reported) {
            self.reported = self.done;
            self.progress.advance(self.done, Some(self.total));
        }
        Ok(count)
    }
}

/// Unpacks `archive` into `staging` and checks on the way that its checksum is
/// `expected`. If it fails, `staging` holds rubbish, which goes with it.
pub(crate) fn unpack(
    options: &Options,
    archive: &Path,
    expected: &str,
    staging: &Staging<'_>,
    progress: &mut dyn Progress,
) -> Result<()> {
    let file = input::open(archive)?;
    let total = file.metadata().during("read", archive)?.len();
    let needed = total.saturating_mul(EXPANSION);
    check_space(options, staging.path(), needed)?;
    let reporting = Reporting {
        inner: file,
        progress,
        done: 0,
        reported: 0,
        total,
    };
    let mut hashing = Hashing::new(reporting);
    let unpacked = unpack_entries(archive, &mut hashing, staging.path());
    // Whatever stopped the unpacking: the checksum tells whether the file is to blame.
    io::copy(&mut hashing, &mut io::sink()).during("read", archive)?;
    let actual = hex(hashing.hash);
    if actual != expected {
        let path = archive.to_owned();
        return Err(Error::Checksum {
            path,
            expected: expected.to_owned(),
            actual,
        });
    }
    unpacked.map_err(|error| match error {
        Error::Archive { source, .. } if source.kind() == io::ErrorKind::StorageFull => {
            let available = (options.free_space)(staging.path()).unwrap_or(0);
            Error::NoSpace {
                folder: staging.path().to_owned(),
                needed,
                available,
            }
        }
        other => other,
    })
}

fn unpack_entries(archive: &Path, reader: &mut impl Read, target: &Path) -> Result<()> {
    let broken = |source| Error::Archive {
        path: archive.to_owned(),
        source,
    };
    let decoder = zstd::Decoder::new(reader).map_err(broken)?;
    let mut tar = tar::Archive::new(BufReader::with_capacity(1 << 16, decoder));
    for entry in tar.entries().map_err(broken)? {
        let mut entry = entry.map_err(broken)?;
        let name = entry.path().map_err(broken)?.into_owned();
        let inside = stays_inside(&name) && link_stays_inside(&entry).map_err(broken)?;
        if !inside || !entry.unpack_in(target).map_err(broken)? {
            let (path, entry) = (archive.to_owned(), name.to_string_lossy().into_owned());
            return Err(Error::UnsafeEntry { path, entry });
        }
    }
    Ok(())
}

fn stays_inside(path: &Path) -> bool {
    path.components()
        .all(|part| matches!(part, Component::CurDir | Component::Normal(_)))
}

/// Links may point to a name without `..` only; other kinds than files, folders and
/// links have no place in a toolchain.
fn link_stays_inside<R: Read>(entry: &tar::Entry<'_, R>) -> io::Result<bool> {
    let kind = entry.header().entry_type();
    if kind.is_symlink() || kind.is_hard_link() {
        return Ok(entry
            .link_name()?
            .is_some_and(|target| stays_inside(&target)));
    }
    Ok(kind.is_file() || kind.is_dir())
}

/// Files and folders below `root`, sorted, without the manifest.
fn entries(root: &Path) -> Result<Vec<PathBuf>> {
    let mut found = Vec::new();
    let mut folders = vec![root.to_owned()];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(&folder).during("read", &folder)? {
            let entry = entry.during("read", &folder)?;
            let path = entry.path();
            if entry.file_type().during("read", &path)?.is_dir() {
                folders.push(path.clone());
            }
            if path != root.join(manifest::FILE) {
                found.push(path);
            }
        }
    }
    found.sort();
    Ok(found)
}

#[cfg(unix)]
fn is_executable(data: &fs::Metadata) -> bool {
    use std::os::unix::fs::PermissionsExt;
    data.permissions().mode() & 0o100 != 0
}

#[cfg(not(unix))]
fn is_executable(_: &fs::Metadata) -> bool {
    true
}

fn append<W: Write>(tar: &mut tar::Builder<W>, root: &Path, path: &Path) -> Result<u64> {
    let data = fs::symlink_metadata(path).during("read", path)?;
    let name = path.strip_prefix(root).unwrap_or(path);
    // Owner, time and the finer permissions differ from machine to machine.
    let mut header = tar::Header::new_gnu();
    header.set_mtime(0);
    header.set_uid(0);
    header.set_gid(0);
    header.set_size(0);
    header.set_mode(if data.is_dir() || is_executable(&data) {
        0o755
    } else {
        0o644
    });
    let written = if data.is_symlink() {
        let target = fs::read_link(path).during("read", path)?;
        header.set_entry_type(tar::EntryType::Symlink);
        tar.append_link(&mut header, name, target)
    } else if data.is_dir() {
        header.set_entry_type(tar::EntryType::Directory);
        tar.append_data(&mut header, name, io::empty())
    } else {
        header.set_size(data.len());
        let file = File::open(path).during("open", path)?;
        tar.append_data(&mut header, name, file.take(data.len()))
    };
    written.during("pack", path)?;
    Ok(data.len())
}

/// Packs a self-contained toolchain into `folder`, under the name that says what it is,
/// and notes its checksum in the `SHA256SUMS` file there. The same toolchain gives the
/// same bytes on every machine.
pub fn pack(toolchain: &Toolchain, folder: &Path, progress: &mut dyn Progress) -> Result<Packed> {
    if toolchain.bin.is_none() {
        return Err(Error::NotPackable {
            path: toolchain.root.clone(),
        });
    }
    fs::create_dir_all(folder).during("create", folder)?;
    let name = format!("{}.tar.zst", pinned::name());
    let path = folder.join(&name);
    let output = Output::create(&path, &[])?;
    let sums = folder.join("SHA256SUMS");
    let text = match input::read_text(&sums, MAX_SUMS) {
        Ok(text) => text,
        Err(error) if error.is_missing() => String::new(),
        Err(error) => return Err(error.into()),
    };
    let (sha256, bytes) = write_archive(&toolchain.root, output, progress)?;
    let mut lines: Vec<String> = text
        .lines()
        .filter(|line| in_sums(line, &name).is_none())
        .map(str::to_owned)
        .chain([format!("{sha256}  {name}")])
        .collect();
    lines.sort_by(|a, b| a.get(64..).cmp(&b.get(64..)));
    Output::create(&sums, &[])?.finish((lines.join("\n") + "\n").as_bytes())?;
    Ok(Packed {
        path,
        sha256,
        bytes,
    })
}

/// Counts and hashes what is written through it.
struct HashingWriter<W> {
    inner: W,
    hash: sha2::Sha256,
    bytes: u64,
}

impl<W: Write> Write for HashingWriter<W> {
    fn write(&mut self, buffer: &[u8]) -> io::Result<usize> {
        let count = self.inner.write(buffer)?;
        self.hash.update(&buffer[..count]);
        self.bytes += count as u64;
        Ok(count)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.inner.flush()
    }
}

fn write_archive(
    root: &Path,
    output: Output,
    progress: &mut dyn Progress,
) -> Result<(String, u64)> {
    progress.step("pack", 1, 1);
    let files = entries(root)?;
    let mut total = 0;
    for file in &files {
        total += fs::symlink_metadata(file).during("read", file)?.len();
    }
    let path = &output.path().to_owned();
    let writer = HashingWriter {
        inner: output,
        hash: sha2::Sha256::new(),
        bytes: 0,
    };
    let mut encoder = zstd::Encoder::new(writer, LEVEL).during("compress", path)?;
    // zstd's output depends on whether it uses threads, but not on how many.
    let cores = std::thread::available_parallelism().map_or(1, |count| count.get() as u32);
    encoder.multithread(cores).during("compress", path)?;
    encoder.include_checksum(true).during("compress", path)?;
    let mut tar = tar::Builder::new(encoder);
    let mut done = 0;
    for file in &files {
        done += append(&mut tar, root, file)?;
        progress.advance(done, Some(total));
    }
    let encoder = tar.into_inner().during("write", path)?;
    let writer = encoder.finish().during("write", path)?;
    writer.inner.commit()?;
    Ok((hex(writer.hash), writer.bytes))
}

#[cfg(test)]
mod tests {
    use super::*;

    const SUM: &str = "00000000000000000000000000000000000000000000000000000000000000ff";

    #[test]
    fn lines_of_sha256sums() {
        let text = format!("{SUM}  a.tar.zst\n{SUM} *b\n{SUM}  ./c\nrubbish\n");
        for name in ["a.tar.zst", "b", "c"] {
            assert_eq!(in_sums(&text, name), Some(SUM));
        }
        assert_eq!(in_sums(&text, "rubbish"), None);
        assert_eq!(in_sums(&text, "tar.zst"), None);
    }

    #[test]
    fn a_given_checksum_comes_first_and_must_be_one() {
        let archive = Path::new("nowhere").join(pinned::ARCHIVES[0].0);
        let mut options = Options::default();
        assert_eq!(
            expected_sha256(&options, &archive).unwrap(),
            pinned::ARCHIVES[0].1
        );
        options.sha256 = Some(SUM.to_uppercase());
        assert_eq!(expected_sha256(&options, &archive).unwrap(), SUM);
        options.sha256 = Some("abc".into());
        let error = expected_sha256(&options, &archive).unwrap_err();
        assert!(error.to_string().contains("`abc`"), "{error}");
        options.sha256 = None;
        let error = expected_sha256(&options, Path::new("nowhere/x.tar.zst")).unwrap_err();
        assert!(error.to_string().contains("x.tar.zst"), "{error}");
    }

    #[test]
    fn names_that_lead_out() {
        assert!(stays_inside(Path::new("./bin/rustc")));
        assert!(!stays_inside(Path::new("bin/../../x")));
        assert!(!stays_inside(Path::new("/x")));
    }
}
