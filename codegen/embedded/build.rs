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
    code.push_str(&texts(root));
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
    for folder in crates(root) {
        let name = folder.file_name().unwrap_or_default().to_string_lossy();
        names.files.insert(format!("kernels/{name}/Cargo.toml"));
        names.files.insert(format!("kernels/{name}/build.rs"));
        names.folders.insert(format!("kernels/{name}/src"));
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

/// The sources themselves: what libraries of functions are translated from.
fn texts(root: &Path) -> String {
    let mut code = String::from(
        "/// The sources of the built-in kernel crate, and of the other crates of kernels.\n\
         pub static TEXTS: &[Source] = &[\n",
    );
    for folder in crates(root) {
        let [name, version, licence] =
            ["name", "version", "license"].map(|key| field(&folder, key));
        let _ = writeln!(
            code,
            "    Source {{ name: {name:?}, version: {version:?}, licence: {licence:?}, files: &["
        );
        let mut files = Vec::new();
        list(&folder.join("src"), &mut files);
        files.sort();
        for file in files {
            let relative = file.strip_prefix(&folder).expect("it lies in the folder");
            let (name, path) = (relative.display().to_string(), file.display().to_string());
            let _ = writeln!(
                code,
                "        ({:?}, include_str!({path:?})),",
                name.replace('\\', "/")
            );
        }
        code.push_str("    ] },\n");
    }
    code.push_str("];\n");
    code
}

/// Every `.rs` file below a folder.
fn list(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).expect("sources can be read") {
        let path = entry.expect("sources can be read").path();
        if path.is_dir() {
            list(&path, found);
        } else if path.extension().is_some_and(|e| e == "rs") {
            found.push(path);
        }
    }
}

/// The crates in `kernels/`.
fn crates(root: &Path) -> Vec<PathBuf> {
    let mut all: Vec<PathBuf> = std::fs::read_dir(root.join("kernels"))
        .expect("kernels/ can be read")
        .map(|entry| entry.expect("kernels/ can be read").path())
        .filter(|folder| folder.join("Cargo.toml").is_file())
        .collect();
    all.sort();
    all
}

/// A field of a Cargo.toml, or of its workspace's.
fn field(folder: &Path, key: &str) -> String {
    let table = |folder: &Path| -> Option<toml::Table> {
        std::fs::read_to_string(folder.join("Cargo.toml"))
            .ok()?
            .parse()
            .ok()
    };
    let own = table(folder).and_then(|t| Some(t.get("package")?.get(key)?.as_str()?.to_owned()));
    own.or_else(|| {
        folder.ancestors().skip(1).find_map(|above| {
            let workspace = table(above)?.get("workspace")?.clone();
            Some(workspace.get("package")?.get(key)?.as_str()?.to_owned())
        })
    })
    .unwrap_or_default()
}
