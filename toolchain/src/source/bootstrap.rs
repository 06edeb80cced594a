//! The compiler that builds the compiler, and the other programs that takes.

use std::path::{Path, PathBuf};
use std::process::Command;

use hankel_system::process::which;

use crate::error::{Error, Result};
use crate::options::{ENV_BOOTSTRAP, Options};
use crate::pinned;
use crate::process;

/// Rust 1.97 with its cargo.
#[derive(Clone, Debug)]
pub(super) struct Bootstrap {
    pub(super) rustc: PathBuf,
    pub(super) cargo: PathBuf,
    /// First line of `rustc --version`.
    pub(super) version: String,
}

/// Program and the Debian package that holds it.
const TOOLS: [(&str, &str); 6] = [
    ("g++", "g++"),
    ("cc", "gcc"),
    ("ld", "binutils"),
    ("as", "binutils"),
    ("strip", "binutils"),
    ("dpkg-deb", "dpkg"),
];

/// The `1.x` in `rustc 1.x.y (...)`.
fn minor(version: &str) -> Option<u32> {
    version
        .strip_prefix("rustc 1.")?
        .split('.')
        .next()?
        .parse()
        .ok()
}

fn sysroot(asked: &str) -> Option<PathBuf> {
    let folder = Path::new(asked);
    if folder.join("bin").is_dir() {
        return Some(folder.to_owned());
    }
    let mut rustup = Command::new("rustup");
    // A missing toolchain is reported, not downloaded.
    rustup.env("RUSTUP_AUTO_INSTALL", "0");
    let text = process::ask(rustup.args(["run", asked, "rustc", "--print=sysroot"]))?;
    Some(PathBuf::from(text.trim()))
}

impl Bootstrap {
    /// Finds it, or says in one line what is wrong.
    fn find(options: &Options) -> Result<Self, String> {
        let asked = options.bootstrap.as_deref().unwrap_or("nightly");
        let wanted = format!("Rust 1.{}", pinned::BOOTSTRAP_MINORS.start());
        let Some(root) = sysroot(asked) else {
            return Err(format!(
                "{wanted} (rustup has no `{asked}`; or set {ENV_BOOTSTRAP})"
            ));
        };
        let exe = std::env::consts::EXE_SUFFIX;
        let rustc = root.join(format!("bin/rustc{exe}"));
        let cargo = root.join(format!("bin/cargo{exe}"));
        let Some(version) = process::ask(Command::new(&rustc).arg("--version")) else {
            return Err(format!("{wanted} (`{asked}` has no working bin/rustc)"));
        };
        if !cargo.is_file() {
            return Err(format!("{wanted} (`{asked}` has no bin/cargo)"));
        }
        let version = version.trim().to_owned();
        if !minor(&version).is_some_and(|minor| pinned::BOOTSTRAP_MINORS.contains(&minor)) {
            return Err(format!(
                "{wanted} (`{asked}` is {version}; set {ENV_BOOTSTRAP})"
            ));
        }
        Ok(Self {
            rustc,
            cargo,
            version,
        })
    }
}

/// Checks platform and programs; one error names everything that is missing.
pub(super) fn check(options: &Options) -> Result<Bootstrap> {
    check_on(pinned::host(), options, |tool| {
        which(Path::new(tool)).is_some()
    })
}

fn check_on(host: &str, options: &Options, there: impl Fn(&str) -> bool) -> Result<Bootstrap> {
    if !pinned::SOURCE_HOSTS.contains(&host) {
        return Err(Error::UnknownPlatform {
            method: "the build from source",
            host: host.to_owned(),
            help: format!(
                "it is known to work on {}; use rustup here",
                pinned::SOURCE_HOSTS.join(", ")
            ),
        });
    }
    let mut tools = Vec::new();
    let mut packages = Vec::new();
    let apt = ("apt-get", "apt");
    let apt = options.rust_src.is_none().then_some(apt);
    for (tool, package) in TOOLS.into_iter().chain(apt) {
        if !there(tool) {
            tools.push(tool.to_owned());
            if !packages.contains(&package) {
                packages.push(package);
            }
        }
    }
    let bootstrap = Bootstrap::find(options);
    let mut help = Vec::new();
    if !packages.is_empty() {
        help.push(format!("apt-get install {}", packages.join(" ")));
    }
    match bootstrap {
        Ok(bootstrap) if tools.is_empty() => return Ok(bootstrap),
        Ok(_) => {}
        Err(why) => {
            tools.push(why);
            help.push(format!(
                "point {ENV_BOOTSTRAP} at a rustup toolchain or folder with Rust 1.{}",
                pinned::BOOTSTRAP_MINORS.start()
            ));
        }
    }
    Err(Error::MissingTools {
        tools,
        help: help.join("; "),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn versions() {
        assert_eq!(
            minor("rustc 1.97.0-nightly (4d1f98451 2026-05-15)"),
            Some(97)
        );
        assert_eq!(minor("clang 17"), None);
    }

    #[test]
    fn one_error_names_everything() {
        let options = Options {
            bootstrap: Some("no-such".into()),
            ..Options::default()
        };
        let error = check_on(pinned::SOURCE_HOSTS[0], &options, |tool| tool == "cc").unwrap_err();
        let text = error.to_string();
        for part in [
            "g++",
            "ld, as, strip",
            "dpkg-deb",
            "apt-get",
            "no-such",
            "1.97",
        ] {
            assert!(text.contains(part), "{part}: {text}");
        }
        assert!(
            text.contains("apt-get install g++ binutils dpkg apt"),
            "{text}"
        );
    }

    #[test]
    fn other_platforms_are_refused() {
        let error = check_on("riscv64-unknown-none", &Options::default(), |_| true).unwrap_err();
        assert!(
            error.to_string().contains("riscv64-unknown-none"),
            "{error}"
        );
        assert!(error.to_string().contains("use rustup"), "{error}");
    }
}
