//! `rustc` with two code generators and no LLVM, in one static program.
//!
//! The front end is rustc's own. Code for `spirv-*` targets comes from rust-gpu's
//! backend, code for every other target (the host: proc macros and build scripts)
//! from Cranelift's.
#![feature(rustc_private)]

use std::process::ExitCode;

use rustc_codegen_ssa::traits::CodegenBackend;
use rustc_driver_impl as driver;
use rustc_interface::interface::Config;
use rustc_session::config::ErrorOutputType;
use rustc_session::{EarlyDiagCtxt, Session};

type Backend = Box<dyn CodegenBackend>;

/// Does this session make SPIR-V? Either the target says so, or the caller names
/// the backend with `-Zcodegen-backend`, which spirv-builder always does.
fn makes_spirv(session: &Session) -> bool {
    let named = session.opts.unstable_opts.codegen_backend.as_deref();
    named.is_some_and(|name| name.contains("spirv"))
        || session.opts.target_triple.tuple().starts_with("spirv-")
}

fn choose(session: &Session) -> Backend {
    if !makes_spirv(session) {
        return rustc_codegen_cranelift::__rustc_codegen_backend();
    }
    let backend = rustc_codegen_spirv::__rustc_codegen_backend();
    // SAFETY: rust-gpu implements `CodegenBackend` of a patched copy of
    // `rustc_codegen_ssa` that its build script makes, so the two trait objects have
    // different types here. The copy's trait is the same source text, compiled by the
    // same compiler with the same flags: the vtables agree. Loading the backend as a
    // dynamic library, as stock rustc does, makes the same conversion unseen.
    unsafe { std::mem::transmute::<_, Backend>(backend) }
}

/// Hands [`choose`] to rustc before it looks for a backend by itself.
struct TwoBackends;

impl driver::Callbacks for TwoBackends {
    fn config(&mut self, config: &mut Config) {
        config.opts.trimmed_def_paths = true;
        config.make_codegen_backend = Some(Box::new(choose));
    }
}

fn main() -> ExitCode {
    let early = EarlyDiagCtxt::new(ErrorOutputType::default());
    let arguments = driver::args::raw_args(&early);
    // Linked statically there is one `tracing` for both logs. rust-gpu's backend sets
    // its subscriber when it starts; rustc's goes first only where it is asked for.
    if std::env::var_os("RUSTC_LOG").is_some() {
        driver::init_rustc_env_logger(&early);
    }
    driver::install_ice_hook(driver::DEFAULT_BUG_REPORT_URL, |_| ());
    driver::install_ctrlc_handler();
    driver::catch_with_exit_code(|| driver::run_compiler(&arguments, &mut TwoBackends))
}
