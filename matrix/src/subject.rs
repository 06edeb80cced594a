//! A kernel with all its code: native, SPIR-V, and the text in every language.

use std::collections::BTreeMap;

use hankel_codegen::Language;
use hankel_codegen::build::{Generated, Modules, Request, generate};
use hankel_codegen::translate::{Options, Place};
use hankel_host::crates::KernelEntry;
use hankel_host::inputs;

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

/// A kernel with all its code, and with one value for each of its specialisation constants.
#[derive(Clone, Debug)]
pub struct Subject {
    /// The kernel's name; with the constants' values where these are not the defaults:
    /// `shade_hamburger[encoding=0]`.
    pub name: String,
    /// Description and native code. The constants' defaults in it are their values here.
    pub entry: KernelEntry,
    /// The code in each language, or why there is none.
    pub codes: BTreeMap<Language, Result<Code, String>>,
}

impl Subject {
    /// Every kernel of `generated` that has native code in `entries`, with all values of its
    /// specialisation constants that [`inputs::constants`] names: SPIR-V gets them as a driver's
    /// user gives them, texts are generated anew with them. `request` and `modules` are what
    /// `generated` was made from.
    ///
    /// # Errors
    /// Those of [`generate`].
    pub fn with_constants(
        generated: &Generated,
        request: &Request,
        modules: &Modules,
        entries: &[KernelEntry],
    ) -> hankel_codegen::Result<Vec<Self>> {
        let mut all = Vec::new();
        for default in Self::all(generated, entries) {
            let kernel = &default.entry.kernel;
            let mut more = Vec::new();
            for values in inputs::constants(kernel).into_iter().skip(1) {
                more.push(default.frozen(request, modules, &values)?);
            }
            all.push(default);
            all.extend(more);
        }
        Ok(all)
    }

    /// The same with other values of the constants.
    fn frozen(
        &self,
        request: &Request,
        modules: &Modules,
        values: &[u32],
    ) -> hankel_codegen::Result<Self> {
        let mut entry = self.entry.clone();
        let given = inputs::set_constants(&mut entry.kernel, values);
        let said: Vec<String> = given.iter().map(|(n, v)| format!("{n}={v}")).collect();
        let request = Request {
            filter: vec![entry.kernel.name.clone()],
            options: Options {
                constants: given,
                ..request.options.clone()
            },
            ..request.clone()
        };
        let generated = generate(&request, modules)?;
        let one = std::slice::from_ref(&entry);
        let mut codes = Self::all(&generated, one)
            .pop()
            .map(|subject| subject.codes)
            .unwrap_or_default();
        // The module that everybody gets, specialised by whoever loads it.
        if let Some(spirv) = self.codes.get(&Language::Spirv) {
            codes.insert(Language::Spirv, spirv.clone());
        }
        Ok(Self {
            name: format!("{}[{}]", entry.kernel.name, said.join(",")),
            entry,
            codes,
        })
    }

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
                    name: entry.kernel.name.clone(),
                    entry: entry.clone(),
                    codes: codes.into(),
                })
            })
            .collect()
    }
}
