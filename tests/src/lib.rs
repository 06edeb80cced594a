//! What the tests of this folder share: kernel crates whose SPIR-V is committed.

pub mod lean;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use hankel_codegen::build::{Generated, Modules, Request, generate};
use hankel_codegen::bundle::Bundle;
use hankel_codegen::spirv::words;
use hankel_codegen::translate::Options;
use hankel_dsl::native::Entry;
use hankel_dsl::native::describe::Kernel;
use hankel_toolchain::pinned::RUST_GPU_VERSION;

/// As in `hankel` itself.
#[cfg(target_os = "linux")]
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

/// The repository.
#[must_use]
pub fn root() -> PathBuf {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    here.parent()
        .expect("tests/ lies in the repository")
        .to_owned()
}

/// A kernel crate of the repository.
#[derive(Debug)]
pub struct Crate {
    /// Its entry points.
    pub entries: Vec<Entry>,
    /// Its committed SPIR-V.
    pub bundle: Bundle,
    /// Its Cargo.toml.
    pub manifest: PathBuf,
}

impl Crate {
    /// The built-in kernels.
    #[must_use]
    pub fn shadows() -> Self {
        Self::new(
            hankel_shadows::entries(),
            "kernels/shadows",
            "snapshots/spirv",
        )
    }

    /// One kernel for each thing that a kernel can do.
    #[must_use]
    pub fn conformance() -> Self {
        Self::new(
            hankel_conformance::entries(),
            "tests/conformance",
            "snapshots/conformance",
        )
    }

    /// Kernels that iterate over arrays, and enums that hold data.
    #[must_use]
    pub fn iteration() -> Self {
        Self::new(
            hankel_iteration::entries(),
            "tests/iteration",
            "snapshots/iteration",
        )
    }

    /// The published form of four moment shadow mapping.
    #[must_use]
    pub fn listing() -> Self {
        Self::new(
            hankel_listing::entries(),
            "numerics/listing",
            "snapshots/listing",
        )
    }

    /// Shaders that engines have.
    #[must_use]
    pub fn ports() -> Self {
        Self::new(
            hankel_example_ports::entries(),
            "examples/ports",
            "snapshots/ports",
        )
    }

    /// Reads the committed SPIR-V, which must belong to the sources.
    fn new(entries: Vec<Entry>, folder: &str, snapshots: &str) -> Self {
        let manifest = root().join(folder).join("Cargo.toml");
        let bundle = Bundle::read(&root().join(snapshots)).unwrap_or_else(|e| panic!("{e}"));
        let kernels: Vec<Kernel> = entries.iter().map(|e| e.kernel.clone()).collect();
        bundle
            .check_made(&kernels, RUST_GPU_VERSION)
            .and_then(|()| bundle.check_inputs(&root().join(folder)))
            .unwrap_or_else(|e| {
                panic!("{e}\nrun `cargo xtask spirv`, with rust-gpu's compiler installed")
            });
        Self {
            entries,
            bundle,
            manifest,
        }
    }

    /// Everything that is generated from it.
    #[must_use]
    pub fn generate(&self) -> Generated {
        generate(&self.request(), &self.modules()).unwrap_or_else(|e| panic!("{e}"))
    }

    /// The committed modules, for a build.
    #[must_use]
    pub fn modules(&self) -> Modules {
        Modules::Final(self.bundle.modules.clone())
    }

    /// A build of all kernels in all languages.
    #[must_use]
    pub fn request(&self) -> Request {
        Request {
            crate_name: self.bundle.origin.crate_name.clone(),
            kernels: self.entries.iter().map(|e| e.kernel.clone()).collect(),
            filter: Vec::new(),
            targets: Vec::new(),
            options: Options::default(),
            rust_gpu: self.bundle.origin.made_by.rust_gpu.clone(),
        }
    }

    /// The modules as words.
    #[must_use]
    pub fn words(&self) -> BTreeMap<String, Vec<u32>> {
        self.bundle
            .modules
            .iter()
            .map(|(name, bytes)| {
                let words = words(bytes, name).unwrap_or_else(|e| panic!("{e}"));
                (name.clone(), words)
            })
            .collect()
    }
}
