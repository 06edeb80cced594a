//! Tells the crate what it is made of, for whoever must know whether files were made by the same
//! Hankel: the versions of naga and SPIRV-Tools, and hashes of this crate's own code.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use sha2::{Digest, Sha256};

/// The modules that make final SPIR-V; what they use belongs to them.
const PIPELINE: [&str; 2] = ["compile", "finish"];

/// Crates whose version decides what final SPIR-V is.
const TOOLS: [&str; 4] = [
    "rspirv",
    "rustc_codegen_spirv-types",
    "spirv-tools",
    "spirv-tools-sys",
];

/// The ends of the names of what becomes a part of the program.
const COMPILED: [&str; 4] = [".rs", ".hlsl", ".patch", ".txt"];

fn main() {
    let here = PathBuf::from(std::env::var_os("CARGO_MANIFEST_DIR").expect("cargo sets it"));
    let lock = here
        .ancestors()
        .map(|folder| folder.join("Cargo.lock"))
        .find(|file| file.is_file());
    let text = lock
        .as_ref()
        .map(|file| std::fs::read_to_string(file).expect("Cargo.lock can be read"))
        .unwrap_or_default();
    let version = |name| locked(&text, name).unwrap_or("unknown");
    println!("cargo::rustc-env=HANKEL_NAGA_VERSION={}", version("naga"));
    println!(
        "cargo::rustc-env=HANKEL_SPIRV_TOOLS_VERSION={}",
        version("spirv-tools")
    );
    let files = sources(&here.join("src"));
    let tools: Vec<String> = TOOLS
        .iter()
        .map(|name| format!("{name} {}", version(name)))
        .collect();
    println!(
        "cargo::rustc-env=HANKEL_CODEGEN_SHA256={}",
        hash(files.values(), &tools)
    );
    let modules = used(&files);
    let pipeline = files
        .iter()
        .filter(|(path, _)| modules.contains(module(path)))
        .map(|(_, text)| text);
    println!(
        "cargo::rustc-env=HANKEL_PIPELINE_SHA256={}",
        hash(pipeline, &tools)
    );
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rerun-if-changed=src");
    if let Some(lock) = lock {
        println!("cargo::rerun-if-changed={}", lock.display());
    }
}

/// Every file that is compiled below a folder, by its path with `/`, with `\n` at the ends of lines.
fn sources(root: &Path) -> BTreeMap<String, String> {
    fn walk(folder: &Path, prefix: &str, found: &mut BTreeMap<String, String>) {
        for entry in std::fs::read_dir(folder).expect("src can be read") {
            let entry = entry.expect("src can be read");
            let name = entry.file_name().to_string_lossy().into_owned();
            let path = entry.path();
            if path.is_dir() {
                walk(&path, &format!("{prefix}{name}/"), found);
            } else if COMPILED.iter().any(|end| name.ends_with(end)) && !name.starts_with('.') {
                let text = std::fs::read_to_string(&path).expect("sources can be read");
                found.insert(format!("{prefix}{name}"), text.replace("\r\n", "\n"));
            }
        }
    }
    let mut found = BTreeMap::new();
    walk(root, "", &mut found);
    found
}

/// `spirv` for `spirv/trim.rs`, `finish` for `finish.rs`.
fn module(path: &str) -> &str {
    let end = path.find(['/', '.']).unwrap_or(path.len());
    &path[..end]
}

/// The modules that [`PIPELINE`] uses, and those that they use. `error` and `lib` say what went
/// wrong and what there is: no SPIR-V follows from them.
fn used(files: &BTreeMap<String, String>) -> BTreeSet<&str> {
    let mut used = BTreeSet::new();
    let mut todo: Vec<&str> = PIPELINE.into();
    while let Some(name) = todo.pop() {
        if !used.insert(name) {
            continue;
        }
        for (path, text) in files.iter().filter(|(path, _)| module(path) == name) {
            assert!(!text.is_empty(), "{path} is empty");
            // A patch names crates of its own.
            let text = if path.ends_with(".rs") {
                text.as_str()
            } else {
                ""
            };
            for (place, _) in text.match_indices("crate::") {
                let rest = &text[place + "crate::".len()..];
                let names: Vec<&str> = match rest.strip_prefix('{') {
                    Some(list) => list
                        .split('}')
                        .next()
                        .unwrap_or_default()
                        .split(',')
                        .collect(),
                    None => vec![rest],
                };
                for name in names {
                    let name = name.trim_start();
                    let end = name
                        .find(|c: char| c != '_' && !c.is_ascii_alphanumeric())
                        .unwrap_or(name.len());
                    let other = files
                        .keys()
                        .map(|path| module(path))
                        .find(|it| *it == &name[..end]);
                    todo.extend(other.filter(|other| !["error", "lib"].contains(other)));
                }
            }
        }
    }
    used
}

fn hash<'a>(texts: impl Iterator<Item = &'a String>, tools: &'a [String]) -> String {
    let mut digest = Sha256::new();
    for text in texts.chain(tools) {
        digest.update((text.len() as u64).to_le_bytes());
        digest.update(text);
    }
    digest
        .finalize()
        .iter()
        .map(|byte| format!("{byte:02x}"))
        .collect()
}

fn locked<'a>(lock: &'a str, name: &str) -> Option<&'a str> {
    let rest = &lock[lock.find(&format!("name = \"{name}\"\n"))?..];
    rest.lines()
        .nth(1)?
        .strip_prefix("version = \"")?
        .strip_suffix('"')
}
