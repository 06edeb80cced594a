//! A crate's SPIR-V, compiled while the crate is asked what its kernels are: both take cargo seconds after an edit, and
//! neither needs the other.

use std::path::{Path, PathBuf};
use std::thread::{self, JoinHandle};

use hankel_codegen::build::matches;
use hankel_codegen::bundle::Bundle;
use hankel_codegen::compile::{Compiled, Compiler, Wanted, compile};
use hankel_host::crates::Package;

use crate::session::{compiler, final_folder, folder_of, some_folder};

/// What is being compiled. It ends before this is gone.
pub struct Ahead {
    compiler: Compiler,
    /// Whether it is all of the crate.
    is_all: bool,
    thread: Option<JoinHandle<Option<Compiled>>>,
}

impl Ahead {
    /// Begins, if the crate at `manifest` was compiled before and has been edited since: all entry points, or those that
    /// fit one of `filter`. They are taken to be those of that time. `committed` is a folder with SPIR-V that may be the
    /// crate's.
    pub fn start(manifest: &Path, filter: &[String], committed: Option<PathBuf>) -> Option<Self> {
        let package = Package::find(manifest).ok()?;
        let all = final_folder(&package.target_dir, &package.name);
        let some = some_folder(&package.target_dir, &package.name);
        let made: Vec<Bundle> = [Some(all), committed, Some(some)]
            .into_iter()
            .flatten()
            .filter_map(|folder| Bundle::read(&folder).ok())
            .filter(|bundle| bundle.origin.crate_name == package.name)
            .collect();
        let folder = folder_of(manifest);
        if made.iter().any(|it| it.check_inputs(folder).is_ok()) {
            return None;
        }
        let is_all = filter.is_empty();
        let is_wanted = |name: &&String| is_all || filter.iter().any(|it| matches(it, name));
        let names = made.first()?.modules.keys().filter(is_wanted);
        let names: Vec<String> = names.cloned().collect();
        if names.is_empty() {
            return None;
        }
        // One that is not installed yet is installed when it is known to be needed.
        let found = hankel_toolchain::find(&hankel_toolchain::Options::from_env());
        let compiler = compiler(found.ok()??);
        let (manifest, by) = (manifest.to_owned(), compiler.clone());
        let thread = thread::Builder::new().spawn(move || {
            let names: Vec<&str> = names.iter().map(String::as_str).collect();
            // What fails is compiled again, to tell why.
            let wanted = match is_all {
                true => Wanted::All(&names),
                false => Wanted::Only(&names),
            };
            compile(&manifest, &by, &package.target_dir, wanted, &mut |_| {}).ok()
        });
        Some(Self {
            compiler,
            is_all,
            thread: Some(thread.ok()?),
        })
    }

    /// What came of it, if it is what `compiler` makes of `wanted`.
    pub fn finish(mut self, compiler: &Compiler, wanted: Wanted<'_>) -> Option<Compiled> {
        let compiled = self.thread.take()?.join().ok()??;
        let (is_all, names) = match wanted {
            Wanted::All(names) => (true, names),
            Wanted::Only(names) => (false, names),
        };
        let has_each = names.iter().all(|it| compiled.modules.contains_key(*it));
        let is_it = self.is_all == is_all && has_each && self.compiler == *compiler;
        is_it.then_some(compiled)
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
