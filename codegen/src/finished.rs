//! Finished modules, kept from one build to the next. An edit changes few of a crate's modules, and
//! optimising all of them again would take longer than everything else.
//!
//! A file is named by the hash of all that its content follows from: the raw module, the kernel's
//! description, SPIRV-Tools and the code of this crate. So a kept file is never stale, and one that
//! is missing or damaged is made again.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use hankel_dsl::native::describe::Kernel;
use rayon::prelude::*;

use crate::build::{collect, missing};
use crate::error::{Failure, Result};
use crate::files::{self, sha256, write_whole};
use crate::finish::{self, PIPELINE};
use crate::folder::MOST_BYTES;
use crate::spirv::{self, canonical, trim};

/// Length of the hash that stands before a kept module.
const HASH: usize = 64;

/// Finishes raw modules: what a bundle is made of. In parallel. With a folder, modules that are
/// kept there are taken from it, new ones are put there, and others go.
///
/// # Errors
///
/// Each kernel that fails, or has no module.
pub fn finish_all(
    raw: &BTreeMap<String, Vec<u8>>,
    kernels: &[Kernel],
    kept: Option<&Path>,
) -> Result<BTreeMap<String, Vec<u8>>> {
    let results: Vec<_> = kernels
        .par_iter()
        .map(|kernel| {
            let module = raw.get(&kernel.name).ok_or_else(|| missing(kernel))?;
            let name = kept.map(|_| file_name(module, kernel));
            let path = kept
                .zip(name.as_ref())
                .map(|(folder, name)| folder.join(name));
            let bytes = match path.as_deref().and_then(read) {
                Some(bytes) => bytes,
                None => finish_one(module, kernel, path.as_deref())?,
            };
            Ok((kernel.name.clone(), (name, bytes)))
        })
        .collect();
    let all: BTreeMap<String, (Option<String>, Vec<u8>)> = collect(results)?;
    if let Some(folder) = kept {
        sweep(
            folder,
            &all.values()
                .filter_map(|(name, _)| name.as_deref())
                .collect(),
        );
    }
    Ok(all
        .into_iter()
        .map(|(kernel, (_, bytes))| (kernel, bytes))
        .collect())
}

fn finish_one(
    module: &[u8],
    kernel: &Kernel,
    path: Option<&Path>,
) -> std::result::Result<Vec<u8>, Failure> {
    let bytes = finish::finish(module, kernel)?.spirv;
    if let Some(path) = path {
        let mut file = sha256(&bytes).into_bytes();
        file.extend_from_slice(&bytes);
        // What cannot be kept is made again next time.
        let _ = write_whole(path, &file);
    }
    Ok(bytes)
}

fn file_name(module: &[u8], kernel: &Kernel) -> String {
    // Errors name the line, and what is kept has none.
    let description = Kernel {
        line: 0,
        ..kernel.clone()
    };
    // Nothing in a description can fail to become JSON.
    let description = serde_json::to_string(&description).unwrap_or_default();
    let parts = [
        sha256(&without_lines(module, &kernel.name)),
        description,
        PIPELINE.into(),
        env!("HANKEL_SPIRV_TOOLS_VERSION").into(),
    ];
    format!("{}.spv", sha256(parts.join("\n").as_bytes()))
}

/// A raw module without the lines of its source, in the order of [`canonical`]: an edit above a function, or of
/// another entry point, changes neither.
fn without_lines(module: &[u8], name: &str) -> Vec<u8> {
    let read = spirv::words(module, name).and_then(|words| spirv::load(&words, name));
    let Ok(mut read) = read else {
        // `finish` says what is wrong with it.
        return module.to_vec();
    };
    trim::lines(&mut read);
    canonical::order(&mut read);
    spirv::bytes(&spirv::store(&read))
}

/// A kept module, if it is the one that was written.
fn read(path: &Path) -> Option<Vec<u8>> {
    let mut file = files::read(path, MOST_BYTES).ok()?;
    let bytes = file.split_off(HASH.min(file.len()));
    (file == sha256(&bytes).as_bytes()).then_some(bytes)
}

/// Removes modules that nothing asked for. A failure leaves a file that the next build removes.
fn sweep(folder: &Path, used: &BTreeSet<&str>) {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    for path in entries.map(|entry| entry.path()) {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        if name.ends_with(".spv") && !used.contains(&*name) {
            let _ = std::fs::remove_file(&path);
        }
    }
}

/// Where the modules of a crate are kept, within cargo's target folder.
#[must_use]
pub fn folder(target: &Path, crate_name: &str) -> PathBuf {
    target.join("hankel/finished").join(crate_name)
}
