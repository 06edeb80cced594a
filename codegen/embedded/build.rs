//! Lists the committed SPIR-V, and hashes the kernels that this build is compiled with.

#[path = "../src/source_hash.rs"]
#[allow(dead_code, reason = "codegen uses the rest")]
mod source_hash;

use std::fmt::Write;
use std::path::PathBuf;

fn main() {
    let here = PathBuf::from(std::env::var_os("CARGO_MANIFEST_DIR").expect("cargo sets it"));
    let root = here.ancestors().nth(2).expect("the crate lies in codegen/");
    let kernels = root.join("kernels/shadows/Cargo.toml");
    let sources = source_hash::hash(&kernels).unwrap_or_else(|error| panic!("{error}"));
    for file in &sources.files {
        println!("cargo::rerun-if-changed={}", file.display());
    }
    // New files change the folders.
    for folder in &sources.folders {
        println!("cargo::rerun-if-changed={}", folder.join("src").display());
    }
    let bundle = root.join("snapshots/spirv");
    // A folder that is not there would count as changed each time: watch the one above it.
    let watched = if bundle.is_dir() {
        bundle.clone()
    } else {
        root.join("snapshots")
    };
    println!("cargo::rerun-if-changed={}", watched.display());
    println!("cargo::rerun-if-changed=build.rs");
    let mut files: Vec<PathBuf> = std::fs::read_dir(&bundle)
        .into_iter()
        .flatten()
        .filter_map(|entry| entry.ok().map(|entry| entry.path()))
        .filter(|path| path.is_file())
        .collect();
    files.sort();
    let mut code = format!(
        "/// Hash of the kernels' sources that this program was compiled with.\n\
         pub const SOURCE_SHA256: &str = {:?};\n\
         /// The built-in kernel crate.\n\
         pub const CRATE_NAME: &str = {:?};\n\
         /// The committed SPIR-V: file names and contents, as `Bundle::from_files` reads them.\n\
         /// Empty if there was none.\n\
         pub static FILES: &[(&str, &[u8])] = &[\n",
        sources.sha256, sources.name
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
    code.push_str(&texts(&sources));
    let out = PathBuf::from(std::env::var_os("OUT_DIR").expect("cargo sets it"));
    std::fs::write(out.join("files.rs"), code).expect("OUT_DIR can be written");
}

/// The sources themselves: what libraries of functions are translated from.
fn texts(sources: &source_hash::Sources) -> String {
    let mut code = String::from(
        "/// The sources of the built-in kernel crate, and of what it depends on by path.\n\
         pub static SOURCES: &[Source] = &[\n",
    );
    for folder in &sources.folders {
        let [name, version, licence] = ["name", "version", "license"].map(|key| field(folder, key));
        let _ = writeln!(
            code,
            "    Source {{ name: {name:?}, version: {version:?}, licence: {licence:?}, files: &["
        );
        let own = sources.files.iter().filter_map(|file| {
            let relative = file.strip_prefix(folder).ok()?;
            let is_source = relative.extension()? == "rs" && relative.starts_with("src");
            is_source.then(|| (relative.display().to_string().replace('\\', "/"), file))
        });
        for (relative, file) in own {
            let path = file.display().to_string();
            let _ = writeln!(code, "        ({relative:?}, include_str!({path:?})),");
        }
        code.push_str("    ] },\n");
    }
    code.push_str("];\n");
    code
}

/// A field of a Cargo.toml, or of its workspace's.
fn field(folder: &std::path::Path, key: &str) -> String {
    let table = |folder: &std::path::Path| -> Option<toml::Table> {
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
