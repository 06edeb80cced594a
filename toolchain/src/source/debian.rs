//! Debian's `rust-src` package: rustc's source, with what its build needs vendored.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::error::{During, Error, Result};
use crate::options::{ENV_RUST_SRC, Options};
use crate::pinned::{DEBIAN_SUITE, DEBIAN_VERSION, RUST_SRC_SHA256};
use crate::process;
use crate::progress::Progress;
use crate::sha256;

/// Where Debian's packages keep the keys that its archive is signed with.
const KEYRING: &str = "/usr/share/keyrings/debian-archive-keyring.gpg";

fn advice() -> String {
    format!("get rust-src_{DEBIAN_VERSION}_all.deb elsewhere and set {ENV_RUST_SRC} to it")
}

/// The package's file: the one that was given, the one that an earlier run fetched, or
/// a download.
pub(super) fn package(
    options: &Options,
    work: &Path,
    progress: &mut dyn Progress,
) -> Result<PathBuf> {
    if let Some(given) = &options.rust_src {
        sha256::check_file(given, RUST_SRC_SHA256)?;
        return Ok(given.clone());
    }
    let kept = work.join("rust-src.deb");
    if kept.is_file() {
        if sha256::check_file(&kept, RUST_SRC_SHA256).is_ok() {
            return Ok(kept);
        }
        fs::remove_file(&kept).during("remove", &kept)?;
    }
    let fetched = download(work, progress)?;
    sha256::check_file(&fetched, RUST_SRC_SHA256)?;
    fs::rename(&fetched, &kept).during("create", &kept)?;
    Ok(kept)
}

/// The mirror of Debian that this machine's package manager uses.
fn mirror() -> Option<String> {
    let mut list = Command::new("apt-get");
    list.args([
        "indextargets",
        "--format",
        "$(REPO_URI)",
        "Created-By: Packages",
    ]);
    pick_mirror(&process::output(&mut list)?)
}

/// The first repository that is Debian itself: not its security updates, nobody else's.
fn pick_mirror(repositories: &str) -> Option<String> {
    repositories
        .lines()
        .find(|line| line.trim_end_matches('/').ends_with("/debian"))
        .map(Into::into)
}

/// Asks apt for a suite that the machine need not be configured for, with package lists
/// of our own, so that the machine's stay as they are and no privileges are needed.
fn download(work: &Path, progress: &mut dyn Progress) -> Result<PathBuf> {
    let what = format!("rust-src {DEBIAN_VERSION} from Debian {DEBIAN_SUITE}");
    let network = |tail: String| Error::Network {
        what: what.clone(),
        help: advice(),
        tail,
    };
    let Some(mirror) = mirror() else {
        return Err(network(
            "apt is not configured for any mirror of Debian".into(),
        ));
    };
    let apt = work.join("apt");
    if apt.exists() {
        fs::remove_dir_all(&apt).during("remove", &apt)?;
    }
    for folder in ["state/lists/partial", "cache/archives/partial"] {
        let folder = apt.join(folder);
        fs::create_dir_all(&folder).during("create", &folder)?;
    }
    let sources = apt.join("suite.sources");
    let signed = match Path::new(KEYRING).is_file() {
        true => format!(
            "Signed-By: {KEYRING}
"
        ),
        // Then apt looks among its trusted keys; our checksum is what counts.
        false => String::new(),
    };
    let text =
        format!("Types: deb\nURIs: {mirror}\nSuites: {DEBIAN_SUITE}\nComponents: main\n{signed}");
    fs::write(&sources, text).during("write", &sources)?;
    let settings = [
        format!("Dir::Etc::sourcelist={}", sources.display()),
        "Dir::Etc::sourceparts=/dev/null".to_owned(),
        format!("Dir::State={}", apt.join("state").display()),
        format!("Dir::Cache={}", apt.join("cache").display()),
        "APT::Sandbox::User=root".to_owned(),
        // A suite that cannot be reached is an error, not a warning.
        "APT::Update::Error-Mode=any".to_owned(),
        "Acquire::Languages=none".to_owned(),
        "Acquire::Retries=2".to_owned(),
        "Acquire::http::Timeout=30".to_owned(),
        "Acquire::https::Timeout=30".to_owned(),
    ];
    let wanted = format!("rust-src={DEBIAN_VERSION}");
    for arguments in [&["update"][..], &["download", &wanted]] {
        let mut command = Command::new("apt-get");
        command.current_dir(&apt).arg("--quiet");
        for setting in &settings {
            command.args(["-o", setting]);
        }
        command.args(arguments).env("LC_ALL", "C");
        let log = work.join("apt.log");
        process::run(&mut command, &what, &log, |line| {
            if line.starts_with("Get:") {
                progress.line(line);
            }
        })
        .map_err(|error| match error {
            Error::Command { tail, .. } => network(tail),
            other => other,
        })?;
    }
    let found = fs::read_dir(&apt)
        .during("read", &apt)?
        .filter_map(|entry| Some(entry.ok()?.path()));
    let mut packages = found.filter(|path| path.extension().is_some_and(|end| end == "deb"));
    packages
        .next()
        .ok_or_else(|| network("apt-get reported success but left no file".into()))
}

/// Unpacks the package into `tree`, which must not exist.
pub(super) fn unpack(package: &Path, work: &Path, tree: &Path) -> Result<()> {
    let unpacked = work.join("unpacked");
    for leftover in [tree, &unpacked] {
        if leftover.exists() {
            fs::remove_dir_all(leftover).during("remove", leftover)?;
        }
    }
    let mut command = Command::new("dpkg-deb");
    command.arg("-x").arg(package).arg(&unpacked);
    process::run(
        &mut command,
        "unpacking rust-src",
        &work.join("dpkg-deb.log"),
        |_| {},
    )?;
    let source = unpacked
        .join("usr/src")
        .join(format!("rustc-{}", crate::pinned::RUST_VERSION));
    fs::rename(&source, tree).during("create", tree)?;
    fs::remove_dir_all(&unpacked).during("remove", &unpacked)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::progress::Silent;
    use crate::tests::scratch;

    #[test]
    fn the_mirror_is_debian_itself() {
        let list = "https://other.example/debian-security/\nhttps://packages.example apt\n\
                    http://mirror.example/debian/\nhttp://second.example/debian\n";
        assert_eq!(
            pick_mirror(list).as_deref(),
            Some("http://mirror.example/debian/")
        );
        assert_eq!(pick_mirror("https://mirror.example/ubuntu/\n"), None);
    }

    #[test]
    fn a_given_package_must_be_the_right_one() {
        let folder = scratch("debian");
        let file = folder.join("rust-src.deb");
        fs::write(&file, "another").unwrap();
        let options = Options {
            rust_src: Some(file.clone()),
            ..Options::default()
        };
        let error = package(&options, &folder, &mut Silent)
            .unwrap_err()
            .to_string();
        assert!(
            error.contains(RUST_SRC_SHA256) && error.contains("rust-src.deb"),
            "{error}"
        );
        fs::remove_dir_all(folder).unwrap();
    }

    #[test]
    #[ignore = "downloads 46 MB from a mirror of Debian"]
    fn the_package_can_be_downloaded() {
        let folder = scratch("debian");
        let file = package(&Options::default(), &folder, &mut Silent).unwrap();
        assert_eq!(file, folder.join("rust-src.deb"));
        // The second time it is there already.
        package(&Options::default(), &folder, &mut Silent).unwrap();
        fs::remove_dir_all(folder).unwrap();
    }
}
