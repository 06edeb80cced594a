//! Makes a new kernel crate: one kernel, a test that its lanes agree with its scalar run, a
//! README.

use std::path::{Path, PathBuf};

use hankel_system::temporary::Folder;

use crate::VERSION;
use crate::error::{During, Error, Result};
use crate::files::write_whole;

/// Where the new crate gets the DSL from.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Dsl {
    /// From a folder: within a checkout.
    Path(PathBuf),
    /// From the registry.
    Version(String),
}

impl Dsl {
    /// From the registry, in this version.
    #[must_use]
    pub fn published() -> Self {
        Self::Version(VERSION.into())
    }
}

/// Makes a kernel crate in `folder`, which must not be there or be empty. Its name is the
/// folder's. Gives the files that were written.
///
/// # Errors
///
/// The folder's name is no crate's name, there is something in it, or it cannot be written.
pub fn scaffold(folder: &Path, dsl: &Dsl) -> Result<Vec<PathBuf>> {
    let fail = |problem: String| Error::Scaffold {
        path: folder.to_owned(),
        problem,
    };
    let folder_path = std::path::absolute(folder).during("resolve", folder)?;
    let name = folder_path
        .file_name()
        .map(|name| name.to_string_lossy().into_owned())
        .unwrap_or_default();
    let fits = name.starts_with(|letter: char| letter.is_ascii_lowercase())
        && name.chars().all(|letter| {
            letter.is_ascii_lowercase() || letter.is_ascii_digit() || matches!(letter, '_' | '-')
        });
    if !fits {
        return Err(fail(format!(
            "`{name}` is not a name for a crate: use small letters, digits, - and _, a letter first"
        )));
    }
    if OTHER_CRATES.contains(&name.as_str())
        || name == "hankel"
        || name.starts_with("hankel-")
        || name.starts_with("hankel_")
    {
        return Err(fail(format!("`{name}` is another crate's name")));
    }
    if KEYWORDS.contains(&name.as_str()) {
        return Err(fail(format!("`{name}` is a word of Rust's own")));
    }
    let is_there = match std::fs::read_dir(&folder_path) {
        Ok(entries) => {
            if entries.into_iter().next().is_some() {
                return Err(fail("it is not empty".into()));
            }
            true
        }
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => {
            if folder_path.is_symlink() {
                return Err(fail(
                    "it is a link, and what it points to is not there".into(),
                ));
            }
            false
        }
        Err(error) => return Err(fail(error.to_string())),
    };
    let dependency = match dsl {
        Dsl::Path(path) => {
            let path = std::path::absolute(path).during("resolve", path)?;
            format!(
                "{{ path = {:?} }}",
                relative(&folder_path, &path)
                    .display()
                    .to_string()
                    .replace('\\', "/")
            )
        }
        Dsl::Version(version) => format!("{version:?}"),
    };
    let library = name.replace('-', "_");
    let fill = |text: &str| {
        text.replace("@NAME@", &name)
            .replace("@LIBRARY@", &library)
            .replace("@DSL@", &dependency)
    };
    // The crate appears whole or, on a full disk, not at all. An empty folder stays the one that it is: somebody may be
    // in it, or it may be a link.
    let around = match folder_path.parent() {
        Some(above) if !is_there => above,
        _ => &folder_path,
    };
    std::fs::create_dir_all(around).during("create", around)?;
    let work = Folder::within(around).during("write to", around)?;
    let made = work.join(&name);
    for (file, text) in FILES {
        write_whole(&made.join(file), fill(text).as_bytes())?;
    }
    if is_there {
        for name in PARTS {
            let part = folder_path.join(name);
            std::fs::rename(made.join(name), &part).during("create", &part)?;
        }
    } else {
        std::fs::rename(&made, &folder_path).during("create", &folder_path)?;
    }
    Ok(FILES.map(|(file, _)| folder_path.join(file)).to_vec())
}

/// Names that cargo refuses or warns of.
const OTHER_CRATES: &[&str] = &[
    "test",
    "core",
    "std",
    "alloc",
    "proc_macro",
    "proc-macro",
    "deps",
    "build",
    "examples",
];

/// Keywords of Rust, which no library can be called.
const KEYWORDS: &[&str] = &[
    "abstract", "as", "async", "await", "become", "box", "break", "const", "continue", "crate",
    "do", "dyn", "else", "enum", "extern", "false", "final", "fn", "for", "gen", "if", "impl",
    "in", "let", "loop", "macro", "match", "mod", "move", "mut", "override", "priv", "pub", "ref",
    "return", "self", "static", "struct", "super", "trait", "true", "try", "type", "typeof",
    "unsafe", "unsized", "use", "virtual", "where", "while", "yield",
];

/// The way from one folder to another; the other itself where they share nothing.
fn relative(from: &Path, to: &Path) -> PathBuf {
    let shared = from
        .components()
        .zip(to.components())
        .take_while(|(a, b)| a == b)
        .count();
    // Only the root in common: the way by name is the clearer one.
    if shared < 2 {
        return to.to_owned();
    }
    let up = from.components().skip(shared).map(|_| "..");
    up.map(PathBuf::from)
        .chain(
            to.components()
                .skip(shared)
                .map(|part| part.as_os_str().into()),
        )
        .collect()
}

const FILES: [(&str, &str); 5] = [
    ("Cargo.toml", include_str!("scaffold/Cargo.toml.txt")),
    (".gitignore", "/target\n/shaders\n"),
    ("README.md", include_str!("scaffold/README.md")),
    ("src/lib.rs", include_str!("scaffold/lib.rs.txt")),
    ("tests/parity.rs", include_str!("scaffold/parity.rs.txt")),
];

/// What lies in the crate's folder itself; what makes a crate of it comes last.
const PARTS: [&str; 5] = [".gitignore", "README.md", "tests", "src", "Cargo.toml"];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_hold_all_files() {
        for (file, _) in FILES {
            assert!(
                PARTS
                    .iter()
                    .any(|part| file.split('/').next() == Some(part))
            );
        }
    }

    #[test]
    fn relative_paths() {
        assert_eq!(
            relative(Path::new("/a/b/c"), Path::new("/a/b/d/e")),
            Path::new("../d/e")
        );
        assert_eq!(
            relative(Path::new("/x/c"), Path::new("/y/e")),
            Path::new("/y/e")
        );
    }
}
