//! A kernel with all its code: native, SPIR-V, and the text in every language.

use std::collections::BTreeMap;

use hankel_codegen::Language;
use hankel_codegen::build::Generated;
use hankel_codegen::translate::Place;
use hankel_host::crates::KernelEntry;

/// A kernel's text in one language, or its SPIR-V.
#[derive(Clone, Debug, PartialEq)]
pub struct Code {
    /// The text, or SPIR-V's bytes.
    pub bytes: Vec<u8>,
    /// The entry point's name in it.
    pub entry_point: String,
    /// Where each binding is.
    pub places: BTreeMap<u32, Place>,
    /// MSL: slot of the buffer with the sizes of others.
    pub sizes_slot: Option<u32>,
    /// MSL: bindings whose sizes that buffer holds.
    pub sized: Vec<u32>,
}

/// A kernel with all its code.
#[derive(Clone, Debug)]
pub struct Subject {
    /// Description and native code.
    pub entry: KernelEntry,
    /// The code in each language, or why there is none.
    pub codes: BTreeMap<Language, Result<Code, String>>,
}

impl Subject {
    /// Every kernel of a build that has native code in `entries`.
    #[must_use]
    pub fn all(generated: &Generated, entries: &[KernelEntry]) -> Vec<Self> {
        let manifest = &generated.manifest;
        entries
            .iter()
            .filter_map(|entry| {
                let there = manifest.kernels.get(&entry.kernel.name)?;
                let codes = Language::ALL.map(|language| {
                    let code = match there.languages.get(&language) {
                        Some(l) => generated
                            .files
                            .get(&l.file)
                            .map(|bytes| Code {
                                bytes: bytes.clone(),
                                entry_point: l.entry_point.clone(),
                                places: there
                                    .bindings
                                    .iter()
                                    .filter_map(|b| {
                                        Some((b.binding, b.places.get(&language)?.clone()))
                                    })
                                    .collect(),
                                sizes_slot: l.sizes_buffer,
                                sized: l.sized_bindings.clone(),
                            })
                            .ok_or_else(|| format!("{} was not written", l.file)),
                        None => Err(there
                            .unsupported
                            .get(&language)
                            .cloned()
                            .unwrap_or_else(|| format!("{language} was not asked for"))),
                    };
                    (language, code)
                });
                Some(Self {
                    entry: entry.clone(),
                    codes: codes.into(),
                })
            })
            .collect()
    }
}
