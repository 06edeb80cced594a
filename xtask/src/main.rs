//! Chores of this repository. `cargo xtask spirv` writes the committed SPIR-V anew, of the built-in
//! kernels and of the crates that tests use. (That it follows from its sources is a test.)

use std::error::Error;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use hankel_codegen::bundle::Bundle;
use hankel_codegen::compile::{Compiler, Wanted, compile};
use hankel_codegen::finished::finish_all;
use hankel_dsl::native::Entry;
use hankel_dsl::native::describe::Kernel;
use hankel_toolchain::pinned::RUST_GPU_VERSION;

const USAGE: &str = "usage: cargo xtask spirv";

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let result = match arguments[..] {
        ["spirv"] => write(),
        _ => {
            eprintln!("{USAGE}");
            return ExitCode::from(2);
        }
    };
    match result {
        Ok(text) => {
            println!("{text}");
            ExitCode::SUCCESS
        }
        Err(error) => {
            eprintln!("{error}");
            ExitCode::FAILURE
        }
    }
}

fn root() -> PathBuf {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    here.parent().unwrap_or(here).to_owned()
}

/// A crate whose SPIR-V is committed.
struct Committed {
    crate_name: &'static str,
    manifest: &'static str,
    folder: &'static str,
    kernels: Vec<Kernel>,
}

fn committed() -> [Committed; 5] {
    let kernels = |entries: Vec<Entry>| entries.into_iter().map(|e| e.kernel).collect();
    [
        Committed {
            crate_name: "hankel-shadows",
            manifest: "kernels/shadows/Cargo.toml",
            folder: "snapshots/spirv",
            kernels: kernels(hankel_shadows::entries()),
        },
        Committed {
            crate_name: "hankel-conformance",
            manifest: "tests/conformance/Cargo.toml",
            folder: "snapshots/conformance",
            kernels: kernels(hankel_conformance::entries()),
        },
        Committed {
            crate_name: "hankel-iteration",
            manifest: "tests/iteration/Cargo.toml",
            folder: "snapshots/iteration",
            kernels: kernels(hankel_iteration::entries()),
        },
        Committed {
            crate_name: "hankel-listing",
            manifest: "numerics/listing/Cargo.toml",
            folder: "snapshots/listing",
            kernels: kernels(hankel_listing::entries()),
        },
        Committed {
            crate_name: "hankel-example-ports",
            manifest: "examples/ports/Cargo.toml",
            folder: "snapshots/ports",
            kernels: kernels(hankel_example_ports::entries()),
        },
    ]
}

impl Committed {
    /// A bundle from the sources as they are.
    fn fresh(&self) -> Result<Bundle, Box<dyn Error>> {
        let options = hankel_toolchain::Options::from_env();
        let toolchain = hankel_toolchain::ensure(&options, &mut hankel_toolchain::Silent)?;
        let compiler = Compiler {
            backend: toolchain.backend,
            bin: toolchain.bin,
            channel: toolchain.channel,
        };
        let manifest = root().join(self.manifest);
        let names: Vec<&str> = self.kernels.iter().map(|k| k.name.as_str()).collect();
        let compiled = compile(
            &manifest,
            &compiler,
            &root().join("target"),
            Wanted::All(&names),
            &mut |_| {},
        )?;
        Ok(Bundle::new(
            self.crate_name,
            &self.kernels,
            RUST_GPU_VERSION,
            &compiled,
            finish_all(&compiled.modules, &self.kernels, None)?,
        ))
    }
}

fn write() -> Result<String, Box<dyn Error>> {
    let mut lines = Vec::new();
    for one in committed() {
        let bundle = one.fresh()?;
        bundle.write(&root().join(one.folder))?;
        lines.push(format!("{}: {} modules", one.folder, bundle.modules.len()));
    }
    Ok(lines.join("\n"))
}
