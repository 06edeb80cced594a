//! Tells the crate which naga and SPIRV-Tools it is built with; the manifest names them.

use std::path::Path;

fn main() {
    let manifest = std::env::var("CARGO_MANIFEST_DIR").expect("cargo sets it");
    let lock = Path::new(&manifest)
        .ancestors()
        .map(|folder| folder.join("Cargo.lock"))
        .find(|file| file.is_file());
    let text = lock
        .as_ref()
        .map(|file| std::fs::read_to_string(file).expect("Cargo.lock can be read"))
        .unwrap_or_default();
    for (name, variable) in [
        ("naga", "HANKEL_NAGA_VERSION"),
        ("spirv-tools", "HANKEL_SPIRV_TOOLS_VERSION"),
    ] {
        let version = locked(&text, name).unwrap_or("unknown");
        println!("cargo::rustc-env={variable}={version}");
    }
    println!("cargo::rerun-if-changed=build.rs");
    if let Some(lock) = lock {
        println!("cargo::rerun-if-changed={}", lock.display());
    }
}

fn locked<'a>(lock: &'a str, name: &str) -> Option<&'a str> {
    let rest = &lock[lock.find(&format!("name = \"{name}\"\n"))?..];
    rest.lines()
        .nth(1)?
        .strip_prefix("version = \"")?
        .strip_suffix('"')
}
