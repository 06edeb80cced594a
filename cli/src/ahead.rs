//! A crate's SPIR-V, compiled while the crate is asked what its kernels are: both take cargo seconds after an edit, and
//! neither needs the other.

use std::path::{Path, PathBuf};
use std::thread::{self, JoinHandle};

use hankel_codegen::bundle::Bundle;
use hankel_codegen::compile::{Compiled, Compiler, Wanted, compile};

use crate::session::{Package, compiler, final_folder, folder_of};

/// What is being compiled. It ends before this is gone.
pub struct Ahead {
    compiler: Compiler,
    thread: Option<JoinHandle<Option<Compiled>>>,
}

impl Ahead {
    /// Begins, if the crate at `manifest` was compiled before and has been edited since. The entry points are taken to be
    /// those of that time. `committed` is a folder with SPIR-V that may be the crate's.
    pub fn start(manifest: &Path, committed: Option<PathBuf>) -> Option<Self> {
        let package = Package::of(manifest).ok()?;
        let kept = final_folder(&package.target, &package.name);
        let made: Vec<Bundle> = [Some(kept), committed]
            .into_iter()
            .flatten()
            .filter_map(|folder| Bundle::read(&folder).ok())
            .filter(|bundle| bundle.origin.crate_name == package.name)
            .collect();
        let folder = folder_of(manifest);
        if made.iter().any(|it| it.check_inputs(folder).is_ok()) {
            return None;
        }
        let names: Vec<String> = made.first()?.modules.keys().cloned().collect();
        // One that is not installed yet is installed when it is known to be needed.
        let found = hankel_toolchain::find(&hankel_toolchain::Options::from_env());
        let compiler = compiler(found.ok()??);
        let (manifest, by) = (manifest.to_owned(), compiler.clone());
        let thread = thread::Builder::new().spawn(move || {
            let names: Vec<&str> = names.iter().map(String::as_str).collect();
            // What fails is compiled again, to tell why.
            let all = Wanted::All(&names);
            compile(&manifest, &by, &package.target, all, &mut |_| {}).ok()
        });
        Some(Self {
            compiler,
            thread: Some(thread.ok()?),
        })
    }

    /// What came of it, if it is what `compiler` makes of these entry points.
    pub fn finish(mut self, compiler: &Compiler, names: &[&str]) -> Option<Compiled> {
        let compiled = self.thread.take()?.join().ok()??;
        let has_all = names.iter().all(|it| compiled.modules.contains_key(*it));
        (has_all && self.compiler == *compiler).then_some(compiled)
    }
}

impl Drop for Ahead {
    fn drop(&mut self) {
        if let Some(thread) = self.thread.take() {
            // Nobody asks for its result.
            let _ = thread.join();
        }
    }
}
