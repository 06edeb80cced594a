//! Lists the committed SPIR-V, and records the sources that this build is compiled with.

#[path = "../src/inputs.rs"]
#[allow(dead_code, reason = "codegen uses the rest")]
mod inputs;

use std::fmt::Write;
use std::path::{Path, PathBuf};

use inputs::{Inputs, Names};

/// What is read of the committed SPIR-V's `source.json`.
#[derive(serde::Deserialize)]
struct Origin {
    inputs: Inputs,
}

fn main() {
    let here = PathBuf::from(std::env::var_os("CARGO_MANIFEST_DIR").expect("cargo sets it"));
    let root = here.ancestors().nth(2).expect("the crate lies in codegen/");
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rerun-if-changed=../src/inputs.rs");
    let sources = Inputs::take(root, &sources(root)).unwrap_or_else(|error| panic!("{error}"));
    watch(&sources, root);
    let bundle = root.join("snapshots/spirv");
    // A folder that is not there would count as changed each time: watch the one above it.
    let watched = if bundle.is_dir() {
        bundle.clone()
    } else {
        root.join("snapshots")
    };
    println!("cargo::rerun-if-changed={}", watched.display());
    let stale = match std::fs::read(bundle.join("source.json")) {
        Ok(json) => match serde_json::from_slice::<Origin>(&json) {
            Ok(origin) => {
                let folder = root.join("kernels/shadows");
                watch(&origin.inputs, &folder);
                origin.inputs.changes(&folder).join("; ")
            }
            Err(error) => format!("source.json cannot be read: {error}"),
        },
        Err(_) => "there is none".into(),
    };
    let mut files: Vec<PathBuf> = std::fs::read_dir(&bundle)
        .into_iter()
        .flatten()
        .filter_map(|entry| entry.ok().map(|entry| entry.path()))
        .filter(|path| path.is_file())
        .collect();
    files.sort();
    let json = serde_json::to_string(&sources).expect("it has a JSON form");
    let mut code = format!(
        "/// The sources that this program was compiled with, as JSON of `Inputs`, from the\n\
         /// repository's folder.\n\
         pub const SOURCES: &str = {json:?};\n\
         /// Why the committed SPIR-V is not made from these sources; empty if it is.\n\
         pub const STALE: &str = {stale:?};\n\
         /// The built-in kernel crate.\n\
         pub const CRATE_NAME: &str = \"hankel-shadows\";\n\
         /// The committed SPIR-V: file names and contents, as `Bundle::from_files` reads them.\n\
         /// Empty if there was none.\n\
         pub static FILES: &[(&str, &[u8])] = &[\n",
    );
    for file in &files {
        let name = file
            .file_name()
            .unwrap_or_default()
            .to_string_lossy()
            .into_owned();
        let _ = writeln!(
            code,
            "    ({name:?}, include_bytes!({:?})),",
            file.display().to_string()
        );
    }
    code.push_str("];\n");
    let out = PathBuf::from(std::env::var_os("OUT_DIR").expect("cargo sets it"));
    std::fs::write(out.join("files.rs"), code).expect("OUT_DIR can be written");
}

/// Everything that the crates in `kernels/` are compiled from, natively as for SPIR-V: a test
/// compares it with what the compiler says that it read.
fn sources(root: &Path) -> Names {
    let mut names = Names::default();
    names
        .files
        .extend(["Cargo.toml".into(), "Cargo.lock".into()]);
    let kernels = root.join("kernels");
    for entry in std::fs::read_dir(&kernels).expect("kernels/ can be read") {
        let entry = entry.expect("kernels/ can be read");
        if entry.path().join("Cargo.toml").is_file() {
            let name = format!("kernels/{}", entry.file_name().to_string_lossy());
            names.files.insert(format!("{name}/Cargo.toml"));
            names.files.insert(format!("{name}/build.rs"));
            names.folders.insert(format!("{name}/src"));
        }
    }
    names
}

/// Runs this again when something of it changes.
fn watch(inputs: &Inputs, folder: &Path) {
    for (name, hash) in inputs.files.iter().chain(&inputs.folders) {
        if hash.is_some() {
            println!("cargo::rerun-if-changed={}", folder.join(name).display());
        }
    }
    for name in inputs.environment.keys() {
        println!("cargo::rerun-if-env-changed={name}");
    }
}
