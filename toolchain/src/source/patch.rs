//! The edits that turn Debian's rustc source plus rust-gpu's backend into a workspace
//! that builds one static `rustc`.
//!
//! Each edit names the text that it replaces, and fails where that text is not there
//! exactly as often as expected: a silent miss would show up 15 minutes into the build,
//! or as a compiler that misbehaves.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

use crate::error::{During, Error, Result};

const CRANELIFT: &str = "compiler/rustc_codegen_cranelift";
const SPIRV: &str = "compiler/rustc_codegen_spirv";
const SSA: &str = "compiler/rustc_codegen_ssa";

/// A source file under edit.
struct Edited {
    path: PathBuf,
    text: String,
}

impl Edited {
    fn open(tree: &Path, file: &str) -> Result<Self> {
        let path = tree.join(file);
        let text = fs::read_to_string(&path).during("read", &path)?;
        Ok(Self { path, text })
    }

    fn fail<T>(&self, why: String) -> Result<T> {
        Err(Error::Patch {
            path: self.path.clone(),
            why,
        })
    }

    /// Replaces the one place where `old` stands.
    fn replace(&mut self, old: &str, new: &str) -> Result<&mut Self> {
        match self.text.matches(old).count() {
            1 => self.text = self.text.replacen(old, new, 1),
            count => {
                let line = old.trim().lines().next().unwrap_or_default();
                return self.fail(format!("`{line}` is there {count} times, not once"));
            }
        }
        Ok(self)
    }

    /// Puts `new` before the one place where `mark` stands.
    fn before(&mut self, mark: &str, new: &str) -> Result<&mut Self> {
        self.replace(mark, &format!("{new}{mark}"))
    }

    /// Replaces everything from `start` (its first place) through the next `end`.
    fn replace_span(&mut self, start: &str, end: &str, new: &str) -> Result<&mut Self> {
        let Some(from) = self.text.find(start) else {
            return self.fail(format!("`{}` is not there", start.trim()));
        };
        let Some(length) = self.text[from..].find(end) else {
            return self.fail(format!("`{}` has no end", start.trim()));
        };
        self.text
            .replace_range(from..from + length + end.len(), new);
        Ok(self)
    }

    fn save(&self) -> Result<()> {
        fs::write(&self.path, &self.text).during("write", &self.path)
    }
}

/// rustc's own crates that a crate root links with `extern crate`.
fn linked_rustc_crates(root: &str) -> BTreeSet<String> {
    root.lines()
        .filter_map(|line| line.strip_prefix("extern crate ")?.strip_suffix(';'))
        .filter(|name| name.starts_with("rustc_"))
        .map(str::to_owned)
        .collect()
}

/// Feature gates that a crate root switches on without conditions.
fn features(root: &str) -> Vec<&str> {
    root.lines()
        .filter_map(|line| line.strip_prefix("#![feature(")?.strip_suffix(")]"))
        .collect()
}

/// `[dependencies.name]` tables for crates beside the one whose manifest this goes into.
fn path_dependencies(names: &BTreeSet<String>) -> String {
    let mut text = String::new();
    for name in names {
        // The library is called `rustc_driver` by those that link to it. Upstream that
        // is a dynamic library around `rustc_driver_impl`; here it is that crate itself.
        let (folder, package) = match name.as_str() {
            "rustc_driver" => ("rustc_driver_impl", "package = \"rustc_driver_impl\"\n"),
            name => (name, ""),
        };
        let _ = writeln!(
            text,
            "[dependencies.{name}]\npath = \"../{folder}\"\n{package}"
        );
    }
    text
}

/// `name = "version"` lines of a manifest's `[dependencies]`.
fn registry_dependencies(manifest: &str) -> BTreeMap<&str, &str> {
    let mut dependencies = false;
    let mut found = BTreeMap::new();
    for line in manifest.lines() {
        if line.starts_with('[') {
            dependencies = line == "[dependencies]";
        } else if dependencies && let Some((name, value)) = line.split_once(" = ") {
            if let Some(version) = value.strip_prefix('"').and_then(|v| v.strip_suffix('"')) {
                found.insert(name, version);
            } else if let Some(rest) = value.split_once("version = \"").map(|(_, rest)| rest)
                && let Some((version, _)) = rest.split_once('"')
            {
                found.insert(name, version);
            }
        }
    }
    found
}

/// A backend is a dynamic library that rustc finds in its sysroot by the exported name
/// of its constructor. As an ordinary crate in one program with another backend, neither
/// the crate type nor the exported name can stay.
fn unexport(root: &mut Edited) -> Result<()> {
    root.replace(
        "#[unsafe(no_mangle)]\npub fn __rustc_codegen_backend",
        "pub fn __rustc_codegen_backend",
    )?;
    Ok(())
}

/// Cranelift's backend becomes an ordinary crate with named dependencies.
fn cranelift(tree: &Path) -> Result<()> {
    let mut root = Edited::open(tree, &format!("{CRANELIFT}/src/lib.rs"))?;
    let crates = linked_rustc_crates(&root.text);
    unexport(&mut root)?;
    root.save()?;

    let mut manifest = Edited::open(tree, &format!("{CRANELIFT}/Cargo.toml"))?;
    manifest
        .replace("[lib]\ncrate-type = [\"dylib\"]\n", "")?
        // This compiler makes host code for its own machine only.
        .replace("\"all-native-arch\"", "\"host-arch\"")?
        .before("[features]\n", &path_dependencies(&crates))?
        .save()?;

    // Inline assembly is normally handed to LLVM's assembler, which is not here.
    let mut assembler = Edited::open(tree, &format!("{CRANELIFT}/src/global_asm.rs"))?;
    assembler
        .replace("option_env!(\"CG_CLIF_FORCE_GNU_AS\").is_some()", "true")?
        .save()
}

/// rust-gpu's backend becomes an ordinary crate too. Its build script copies and edits
/// `rustc_codegen_ssa`; it has to take that from this tree, not from a sysroot.
fn spirv(tree: &Path) -> Result<()> {
    let ssa_manifest = Edited::open(tree, &format!("{SSA}/Cargo.toml"))?.text;
    let ssa_root = Edited::open(tree, &format!("{SSA}/src/lib.rs"))?.text;
    let middle = Edited::open(tree, "compiler/rustc_middle/Cargo.toml")?;

    let mut root = Edited::open(tree, &format!("{SPIRV}/src/lib.rs"))?;
    // Whatever the copy of `rustc_codegen_ssa` uses, the crate around it depends on.
    let mut rustc_crates = linked_rustc_crates(&root.text);
    rustc_crates.extend(
        ssa_manifest
            .lines()
            .filter_map(|line| line.split_once(" = { path = "))
            .map(|(name, _)| name.to_owned()),
    );
    let missing: Vec<&str> = features(&ssa_root)
        .into_iter()
        .filter(|feature| !features(&root.text).contains(feature))
        .collect();
    // Gates that 1.98.1 uses and the nightly that rust-gpu was written for did not.
    let gates: String = missing
        .iter()
        .map(|gate| format!("#![feature({gate})]\n"))
        .collect();
    unexport(&mut root)?;
    root.before("#![recursion_limit", &gates)?
        // One program has one `tracing`, and `RUSTC_LOG` may have claimed it already.
        .replace(
            "tracing::subscriber::set_global_default(subscriber).unwrap();",
            "let _ = tracing::subscriber::set_global_default(subscriber);",
        )?
        .save()?;

    let mut manifest = Edited::open(tree, &format!("{SPIRV}/Cargo.toml"))?;
    // `rustc_apfloat` is the one crate of that name that lives on crates.io.
    rustc_crates.remove("rustc_apfloat");
    let Some(apfloat) = registry_dependencies(&middle.text)
        .get("rustc_apfloat")
        .copied()
    else {
        return middle.fail("`rustc_apfloat` is not there".to_owned());
    };
    let mut registry = registry_dependencies(&ssa_manifest);
    registry.insert("rustc_apfloat", apfloat);
    let mut dependencies = path_dependencies(&rustc_crates);
    for (name, version) in registry {
        if !manifest.text.contains(&format!("[dependencies.{name}]")) {
            let _ = writeln!(
                dependencies,
                "[dependencies.{name}]\nversion = \"{version}\"\n"
            );
        }
    }
    manifest
        .replace("crate-type = [\"dylib\"]\n", "")?
        .before("[dev-dependencies.pretty_assertions]", &dependencies)?
        .save()?;

    let mut build = Edited::open(tree, &format!("{SPIRV}/build.rs"))?;
    build
        .replace(
            "    let sysroot = rustc_output(\"--print=sysroot\")?;\n    \
             let sysroot = Path::new(sysroot.trim());\n",
            "",
        )?
        .replace(
            "sysroot.join(\"lib/rustlib/rustc-src/rust/compiler/rustc_codegen_ssa\")",
            "Path::new(env!(\"CARGO_MANIFEST_DIR\")).join(\"../rustc_codegen_ssa\")",
        )?
        .replace(
            "            sysroot.display(),\n",
            "            cg_ssa_dir.display(),\n",
        )?
        .save()
}

/// rustc finds its sysroot from the path of the library that it is in. In a static
/// program that lookup answers with `argv[0]`, which is no path if `PATH` was searched.
fn own_path(tree: &Path) -> Result<()> {
    let mut search = Edited::open(tree, "compiler/rustc_session/src/filesearch.rs")?;
    search
        .replace_span(
            "#[cfg(unix)]\nfn current_dll_path()",
            "\n}\n",
            "#[cfg(unix)]\n\
             fn current_dll_path() -> Result<PathBuf, String> {\n    \
                 let program = env::current_exe().map_err(|error| error.to_string())?;\n    \
                 try_canonicalize(&program).map_err(|error| error.to_string())\n\
             }\n",
        )?
        .save()
}

/// Applies every edit and adds the driver. `tree` is the unpacked rustc source with
/// rust-gpu's backend in `compiler/rustc_codegen_spirv`.
pub(super) fn apply(tree: &Path) -> Result<()> {
    cranelift(tree)?;
    spirv(tree)?;
    own_path(tree)?;
    let driver = tree.join("compiler/rustc_spirv_driver");
    let source = driver.join("src");
    fs::create_dir_all(&source).during("create", &source)?;
    for (path, text) in [
        (source.join("main.rs"), super::DRIVER_MAIN),
        (driver.join("Cargo.toml"), super::DRIVER_MANIFEST),
        (tree.join("Cargo.toml"), super::WORKSPACE_MANIFEST),
        (tree.join("Cargo.lock"), super::LOCK_FILE),
    ] {
        fs::write(&path, text).during("write", &path)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn edited(text: &str) -> Edited {
        Edited {
            path: "some/file.rs".into(),
            text: text.to_owned(),
        }
    }

    #[test]
    fn an_edit_applies_exactly_once_or_fails() {
        let mut file = edited("one two two");
        file.replace("one", "1").unwrap();
        assert_eq!(file.text, "1 two two");
        for (old, count) in [("two", "2 times"), ("three", "0 times")] {
            let error = file.replace(old, "x").err().unwrap().to_string();
            assert!(
                error.contains("some/file.rs") && error.contains(count),
                "{error}"
            );
        }
        assert_eq!(file.text, "1 two two");
    }

    #[test]
    fn a_span_is_replaced_with_both_its_ends() {
        let mut file = edited("a {\n  b\n}\nc {\n}\n");
        file.replace_span("a {", "\n}\n", "A\n").unwrap();
        assert_eq!(file.text, "A\nc {\n}\n");
        assert!(file.replace_span("d", "}", "").is_err());
        assert!(file.replace_span("c", "end", "").is_err());
    }

    #[test]
    fn crate_roots_and_manifests_are_read() {
        let root = "#![feature(rustc_private)]\n#![cfg_attr(x, feature(y))]\nextern crate \
                    rustc_abi;\nextern crate tracing;\nextern crate rustc_driver;\n";
        assert_eq!(features(root), ["rustc_private"]);
        let crates = linked_rustc_crates(root);
        assert_eq!(
            path_dependencies(&crates),
            "[dependencies.rustc_abi]\npath = \"../rustc_abi\"\n\n\
             [dependencies.rustc_driver]\npath = \"../rustc_driver_impl\"\n\
             package = \"rustc_driver_impl\"\n\n"
        );
        let manifest = "[package]\nversion = \"1\"\n[dependencies]\n# comment\nlog = \"0.4\"\n\
                        smallvec = { version = \"1.8\", features = [\"union\"] }\n\
                        rustc_abi = { path = \"../rustc_abi\" }\n[features]\nx = \"y\"\n";
        let found: Vec<_> = registry_dependencies(manifest).into_iter().collect();
        assert_eq!(found, [("log", "0.4"), ("smallvec", "1.8")]);
    }
}
