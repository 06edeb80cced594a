//! `core` as a shader can have it: a copy of the compiler's library sources with `core.patch` applied.
//!
//! Iterators of arrays and slices are pointers in `core`, and comparing, filling and copying arrays is
//! done byte by byte; SPIR-V has neither. In the patched `core` an iterator is a slice and two indices,
//! and the others are loops over an index. Only kernels that iterate come by any of it.
//!
//! `core.patch` is what `diff -ru` prints. It is applied by its text, wherever in the file that stands.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use hankel_system::temporary::Folder;

use crate::error::{During, Error, Result};
use crate::files::sha256;

const PATCH: &str = include_str!("core.patch");

/// Where rustc keeps the sources of its library, within its sysroot.
const SOURCES: &str = "lib/rustlib/src/rust/library";

/// The folder of the patched library of the compiler in `sysroot`, below `target_dir`. It is made when
/// there is none.
///
/// cargo does not look whether the library has changed: another patch, or another library, lies in
/// another folder.
///
/// # Errors
///
/// The sysroot has no library, or one that the patch does not fit.
pub(crate) fn patched(sysroot: &Path, target_dir: &Path) -> Result<PathBuf> {
    let sources = sysroot.join(SOURCES);
    let mut originals = BTreeMap::new();
    let mut key = format!("{}\n{PATCH}\n", sources.display());
    let changes = parse(PATCH);
    for name in changes.keys() {
        let path = sources.join(name);
        let text = std::fs::read_to_string(&path).during("read", &path)?;
        key.push_str(&sha256(text.as_bytes()));
        originals.insert(*name, text);
    }
    let above = target_dir.join("sources");
    let place = above.join(&sha256(key.as_bytes())[..16]);
    if place.is_dir() {
        return Ok(place.join("library"));
    }
    std::fs::create_dir_all(&above).during("create", &above)?;
    let work = Folder::within(&above).during("write to", &above)?;
    let made = work.join("made");
    copy(&sources, &made.join("library"), &|path| {
        let name = path.strip_prefix(&sources).unwrap_or(path);
        changes.keys().any(|changed| name == Path::new(changed))
    })?;
    for (name, hunks) in &changes {
        let text = apply(&originals[name], hunks).ok_or_else(|| Error::Library {
            path: sources.join(name),
        })?;
        let path = made.join("library").join(name);
        std::fs::write(&path, text).during("write", &path)?;
    }
    match std::fs::rename(&made, &place) {
        // Another process was faster.
        Err(_) if place.is_dir() => {}
        other => other.during("create", &place)?,
    }
    Ok(place.join("library"))
}

/// Fills the folder `to` with the files of `from`: as further names of the same files where the file
/// system can. What is `left_out` is not copied.
fn copy(from: &Path, to: &Path, left_out: &dyn Fn(&Path) -> bool) -> Result<()> {
    std::fs::create_dir_all(to).during("create", to)?;
    for entry in std::fs::read_dir(from).during("read", from)? {
        let entry = entry.during("read", from)?;
        let (path, target) = (entry.path(), to.join(entry.file_name()));
        if path.is_dir() {
            copy(&path, &target, left_out)?;
        } else if !left_out(&path) && std::fs::hard_link(&path, &target).is_err() {
            std::fs::copy(&path, &target).during("copy", &path)?;
        }
    }
    Ok(())
}

/// A place of a file that changes: the lines as they are, and as they shall be.
struct Hunk {
    old: String,
    new: String,
}

/// The hunks of a unified diff, by the name of the file, from the folder that was compared.
fn parse(patch: &str) -> BTreeMap<&str, Vec<Hunk>> {
    let mut files: BTreeMap<&str, Vec<Hunk>> = BTreeMap::new();
    let mut hunks = None;
    for line in patch.split_inclusive('\n') {
        if line.starts_with("diff ") {
            hunks = None;
        }
        if let Some(name) = line.strip_prefix("+++ b/library/") {
            hunks = Some(files.entry(name.trim_end()).or_default());
            continue;
        }
        let Some(hunks) = &mut hunks else { continue };
        let line = line.trim_end_matches(['\r', '\n']);
        if line.starts_with("@@") {
            hunks.push(Hunk {
                old: String::new(),
                new: String::new(),
            });
            continue;
        }
        let Some(hunk) = hunks.last_mut() else {
            continue;
        };
        let (mark, text) = line.split_at(line.len().min(1));
        if mark != "+" {
            hunk.old.push_str(text);
            hunk.old.push('\n');
        }
        if mark != "-" {
            hunk.new.push_str(text);
            hunk.new.push('\n');
        }
    }
    files
}

/// The text with the hunks applied; `None` if one's lines are not there exactly once.
fn apply(text: &str, hunks: &[Hunk]) -> Option<String> {
    let mut text = text.replace("\r\n", "\n");
    for hunk in hunks {
        if text.matches(&hunk.old).count() != 1 {
            return None;
        }
        text = text.replacen(&hunk.old, &hunk.new, 1);
    }
    Some(text)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hunks_are_applied_where_their_lines_stand() {
        let patch = "diff -ru a/library/x.rs b/library/x.rs\n--- a/library/x.rs\n+++ b/library/x.rs\n\
                     @@ -9,3 +9,3 @@ here\n one\n-two\n+2\n three\n@@ -30,2 +30,3 @@\n last\n+new\n end\n";
        let changes = parse(patch);
        let hunks = &changes["x.rs"];
        assert_eq!(hunks.len(), 2);
        let text = apply("zero\none\ntwo\nthree\r\nlast\nend\n", hunks);
        assert_eq!(text.unwrap(), "zero\none\n2\nthree\nlast\nnew\nend\n");
        // Twice is not once.
        assert_eq!(
            apply("one\ntwo\nthree\none\ntwo\nthree\nlast\nend\n", hunks),
            None
        );
        assert_eq!(apply("one\nthree\nlast\nend\n", hunks), None);
    }

    #[test]
    fn a_library_is_copied_and_patched_once() {
        let folder = tempfile::tempdir().unwrap();
        let sysroot = folder.path().join("sysroot");
        let sources = sysroot.join(SOURCES);
        for (name, hunks) in parse(PATCH) {
            let path = sources.join(name);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            let old: String = hunks.iter().map(|hunk| hunk.old.as_str()).collect();
            std::fs::write(path, old).unwrap();
        }
        std::fs::create_dir_all(sources.join("vendor/one")).unwrap();
        std::fs::write(sources.join("vendor/one/lib.rs"), "one").unwrap();
        let target = folder.path().join("target");
        let made = patched(&sysroot, &target).unwrap();
        assert!(made.ends_with("library"), "{}", made.display());
        assert_eq!(
            std::fs::read(made.join("vendor/one/lib.rs")).unwrap(),
            b"one"
        );
        let iter = std::fs::read_to_string(made.join("core/src/slice/iter.rs")).unwrap();
        assert!(iter.contains("front: usize"), "{iter}");
        let before = std::fs::read_to_string(sources.join("core/src/slice/iter.rs")).unwrap();
        assert!(
            !before.contains("front: usize"),
            "the compiler's own was changed"
        );
        assert_eq!(patched(&sysroot, &target).unwrap(), made);
        // Another library, another folder.
        let file = sources.join("core/src/slice/iter.rs");
        std::fs::write(&file, before.clone() + "// more\n").unwrap();
        assert_ne!(patched(&sysroot, &target).unwrap(), made);
        std::fs::write(&file, "").unwrap();
        let error = patched(&sysroot, &target).unwrap_err().to_string();
        assert!(error.contains("iter.rs"), "{error}");
    }
}
