//! Finished modules, kept from one build to the next (`kept.rs`). An edit changes few of a crate's modules, and
//! optimising all of them again would take longer than everything else.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use hankel_dsl::native::describe::Kernel;
use rayon::prelude::*;

use crate::build::{collect, missing};
use crate::error::Result;
use crate::files::sha256;
use crate::finish::{self, PIPELINE};
use crate::kept::Kept;
use crate::spirv::{self, canonical, trim};

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
    let kept = kept.map(Kept::within);
    let results: Vec<_> = kernels
        .par_iter()
        .map(|kernel| {
            let module = raw.get(&kernel.name).ok_or_else(|| missing(kernel))?;
            let Some(kept) = &kept else {
                let made = finish::finish(module, kernel)?;
                return Ok((kernel.name.clone(), (None, made.spirv)));
            };
            let name = name_of(module, kernel);
            let bytes = match kept.read(&name) {
                Some(bytes) => bytes,
                None => {
                    let made = finish::finish(module, kernel)?;
                    kept.write(&name, &made.spirv);
                    made.spirv
                }
            };
            Ok((kernel.name.clone(), (Some(name), bytes)))
        })
        .collect();
    let all: BTreeMap<String, (Option<String>, Vec<u8>)> = collect(results)?;
    if let Some(kept) = kept {
        let names = all.values().filter_map(|(name, _)| name.as_deref());
        kept.sweep(&names.collect());
    }
    Ok(all
        .into_iter()
        .map(|(kernel, (_, bytes))| (kernel, bytes))
        .collect())
}

/// A name that says what a finished module follows from: the raw module, the kernel's description, SPIRV-Tools and the
/// code of this crate.
fn name_of(module: &[u8], kernel: &Kernel) -> String {
    // Errors name the line, and what is kept has none.
    let description = Kernel {
        line: 0,
        licence: String::new(),
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
    sha256(parts.join("\n").as_bytes())
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

/// Where the modules of a crate are kept, within cargo's target folder.
#[must_use]
pub fn folder(target: &Path, crate_name: &str) -> PathBuf {
    target.join("hankel/finished").join(crate_name)
}
