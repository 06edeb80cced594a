//! The one combination of versions that works, and the checksums that go with it.
//!
//! rust-gpu's compiler is a plug-in of one exact rustc. Moving to another rust-gpu
//! means changing this file, `driver/Cargo.lock`, and whatever edit in
//! `source/patch.rs` no longer applies.

/// Version of `rustc_codegen_spirv`, `spirv-builder` and `spirv-std`.
pub const RUST_GPU_VERSION: &str = "0.10.0";

/// rustup's name of the compiler that this rust-gpu is written for.
pub const NIGHTLY: &str = "nightly-2026-07-03";

/// rustup components that rust-gpu needs besides the default ones.
pub const COMPONENTS: [&str; 3] = ["rust-src", "rustc-dev", "llvm-tools"];

/// Version of rustc that is built from source: 1.98 branched on the day of
/// [`NIGHTLY`], so the plug-in fits it.
pub const RUST_VERSION: &str = "1.98.1";

/// Version of Debian's `rust-src` package with that source.
pub const DEBIAN_VERSION: &str = "1.98.1+dfsg1-1~exp1";

/// Debian suite that carries it. Suites move on: keep the file.
pub const DEBIAN_SUITE: &str = "experimental";

/// SHA-256 of that package's file.
pub const RUST_SRC_SHA256: &str =
    "73b65151ac65db66a4dedc0c38dc88aa9e22056013b90c9593eefb203949c425";

/// Minor versions of Rust (1.x) whose compiler can build [`RUST_VERSION`].
pub const BOOTSTRAP_MINORS: std::ops::RangeInclusive<u32> = 97..=97;

/// Crates in the driver's build, for the progress display.
pub const DRIVER_CRATES: u64 = 353;

/// Archives whose SHA-256 needs no SHA256SUMS file: name, checksum.
pub const ARCHIVES: &[(&str, &str)] = &[(
    "rust-gpu-0.10.0-rust-1.98.1-x86_64-unknown-linux-gnu.tar.zst",
    "a8c6119c2dcfeebca4e3b26ff60449a901edb40c7799b93d74c24b4bf1c88aa9",
)];

/// Targets that the build from source is known to work on.
pub const SOURCE_HOSTS: &[&str] = &["x86_64-unknown-linux-gnu"];

/// The plug-in's file in a toolchain's `lib` folder. In a self-contained toolchain it
/// is a placeholder, which spirv-builder wants to exist: the plug-in is linked in.
pub const BACKEND_FILE: &str = "librustc_codegen_spirv.so";

/// This machine's target triple, in Rust's spelling, for the machines that anybody
/// runs this on; otherwise architecture and system.
pub fn host() -> &'static str {
    use std::env::consts::{ARCH, OS};
    match (ARCH, OS) {
        ("x86_64", "linux") if cfg!(target_env = "gnu") => "x86_64-unknown-linux-gnu",
        ("x86_64", "linux") => "x86_64-unknown-linux-musl",
        ("aarch64", "linux") if cfg!(target_env = "gnu") => "aarch64-unknown-linux-gnu",
        ("aarch64", "linux") => "aarch64-unknown-linux-musl",
        ("x86_64", "macos") => "x86_64-apple-darwin",
        ("aarch64", "macos") => "aarch64-apple-darwin",
        ("x86_64", "windows") => "x86_64-pc-windows-msvc",
        ("aarch64", "windows") => "aarch64-pc-windows-msvc",
        _ => other_host(),
    }
}

/// A triple for machines that [`host`] has no name for.
fn other_host() -> &'static str {
    static NAME: std::sync::OnceLock<String> = std::sync::OnceLock::new();
    NAME.get_or_init(|| {
        format!(
            "{}-unknown-{}",
            std::env::consts::ARCH,
            std::env::consts::OS
        )
    })
}

/// Name of the toolchain's folder in the cache, and of its archive.
pub fn name() -> String {
    format!("rust-gpu-{RUST_GPU_VERSION}-rust-{RUST_VERSION}-{}", host())
}
