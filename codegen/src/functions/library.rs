//! From a crate's `library!` to its functions and constants, translated.

use std::collections::BTreeSet;

use syn::parse::{Parse, ParseStream};
use syn::punctuated::Punctuated;
use syn::spanned::Spanned;
use syn::{Token, braced, bracketed};

use super::PRELUDE;
use super::evaluate::{Evaluator, is_function};
use super::ir::{Constant, Function, Library};
use super::refusal::Refusal;
use super::source::{CrateText, Item, ModuleId, Tree, segments};
use super::tidy::tidy;
use crate::build::matches;
use crate::error::Error;

/// `name { api: 1, functions: […], constants: […] }`
struct List {
    docs: Vec<String>,
    name: syn::Ident,
    api: u32,
    functions: Vec<syn::Path>,
    constants: Vec<syn::Path>,
}

impl Parse for List {
    fn parse(input: ParseStream<'_>) -> syn::Result<Self> {
        let attributes = input.call(syn::Attribute::parse_outer)?;
        let mut list = Self {
            docs: super::source::docs(&attributes),
            name: input.parse()?,
            api: 0,
            functions: Vec::new(),
            constants: Vec::new(),
        };
        let body;
        braced!(body in input);
        while !body.is_empty() {
            let key: syn::Ident = body.parse()?;
            body.parse::<Token![:]>()?;
            if key == "api" {
                list.api = body.parse::<syn::LitInt>()?.base10_parse()?;
            } else {
                let inner;
                bracketed!(inner in body);
                let paths = Punctuated::<syn::Path, Token![,]>::parse_terminated(&inner)?;
                match key.to_string().as_str() {
                    "functions" => list.functions.extend(paths),
                    "constants" => list.constants.extend(paths),
                    _ => {
                        let expected = "there are `api`, `functions` and `constants`";
                        return Err(syn::Error::new(key.span(), expected));
                    }
                }
            }
            if !body.is_empty() {
                body.parse::<Token![,]>()?;
            }
        }
        if list.api == 0 {
            return Err(syn::Error::new(
                list.name.span(),
                "say `api: 1`: it rises when a signature changes",
            ));
        }
        Ok(list)
    }
}

/// The libraries of the first crate, translated; the others are what it depends on.
///
/// # Errors
/// What has no form, with file and line.
pub fn read(crates: &[CrateText]) -> Result<Vec<Library>, Refusal> {
    read_where(crates, &mut |_| true)
}

/// As [`read`], with those functions alone that fit one of the patterns (`*` stands for any letters; none: all),
/// and what they call. Constants are all there; a library without a fitting function is left out.
///
/// # Errors
/// What has no form, with file and line; a pattern that no function fits.
pub fn read_chosen(crates: &[CrateText], patterns: &[String]) -> Result<Vec<Library>, Error> {
    let mut known = Vec::new();
    let libraries = read_where(crates, &mut |name| {
        known.push(name.to_owned());
        patterns.is_empty() || patterns.iter().any(|pattern| matches(pattern, name))
    })?;
    let fits = |pattern: &String| known.iter().any(|name| matches(pattern, name));
    match patterns.iter().find(|pattern| !fits(pattern)) {
        Some(pattern) => Err(Error::UnknownFunction {
            name: pattern.clone(),
            known,
        }),
        None => Ok(libraries),
    }
}

/// The libraries with those of their functions that are wanted, by their names.
fn read_where(
    crates: &[CrateText],
    wanted: &mut dyn FnMut(&str) -> bool,
) -> Result<Vec<Library>, Refusal> {
    let prelude = CrateText {
        name: PRELUDE.into(),
        files: [(
            "src/lib.rs".to_owned(),
            include_str!("prelude.txt").to_owned(),
        )]
        .into(),
        ..CrateText::default()
    };
    let mut all = crates.to_vec();
    all.push(prelude);
    let tree = Tree::read(&all)?;
    let Some(first) = crates.first() else {
        return Ok(Vec::new());
    };
    let root = first.name.replace('-', "_");
    let mut libraries = Vec::new();
    for invocation in &tree.libraries {
        if tree.modules[invocation.module].path[0] != root {
            continue;
        }
        let file = &tree.modules[invocation.module].file;
        let mut list: List = syn::parse2(invocation.tokens.clone())
            .map_err(|e| Refusal::at(file, e.span(), format!("`library!`: {e}")))?;
        let had_functions = !list.functions.is_empty();
        list.functions.retain(|path| {
            let name = segments(path).pop().unwrap_or_default();
            wanted(&name)
        });
        if had_functions && list.functions.is_empty() {
            continue;
        }
        libraries.push(translated(&tree, first, invocation.module, list)?);
    }
    Ok(libraries)
}

fn translated(
    tree: &Tree,
    krate: &CrateText,
    module: ModuleId,
    list: List,
) -> Result<Library, Refusal> {
    let file = &tree.modules[module].file;
    let mut evaluator = Evaluator::new(tree);
    let mut functions: Vec<Function> = Vec::new();
    let mut done: BTreeSet<String> = BTreeSet::new();
    for path in &list.functions {
        let (home, source) = match tree.resolve(module, &segments(path)) {
            Some((home, Item::Function(f))) if is_function(&f.attrs) => (home, f),
            Some((_, Item::Function(_))) => {
                let reason = "it lacks `#[function]`";
                return Err(Refusal::at(file, path.span(), reason));
            }
            _ => return Err(Refusal::at(file, path.span(), "there is no such function")),
        };
        with_called(
            tree,
            &mut evaluator,
            home,
            &source,
            &mut done,
            &mut functions,
        )?;
    }
    let mut constants = Vec::new();
    for path in &list.constants {
        let Some((home, Item::Const(source))) = tree.resolve(module, &segments(path)) else {
            return Err(Refusal::at(file, path.span(), "there is no such constant"));
        };
        constants.push(evaluator.constant(home, &source)?);
    }
    let docs = list
        .docs
        .iter()
        .chain(functions.iter().flat_map(|it| &it.docs));
    let docs = docs.chain(constants.iter().flat_map(|it: &Constant| &it.docs));
    let said = docs
        .cloned()
        .collect::<Vec<_>>()
        .join("\n")
        .replace('\\', "");
    let references = tree
        .references
        .iter()
        .filter(|(key, _)| said.contains(&format!("[{key}]")));
    Ok(Library {
        references: references
            .map(|(key, text)| format!("[{key}] {text}"))
            .collect(),
        name: list.name.to_string(),
        krate: krate.name.clone(),
        version: krate.version.clone(),
        api: list.api,
        docs: list.docs,
        licence: krate.licence.clone(),
        structs: evaluator.structs,
        constants,
        functions,
    })
}

/// Translates a function, after those that it calls.
fn with_called(
    tree: &Tree,
    evaluator: &mut Evaluator<'_>,
    home: ModuleId,
    source: &syn::ItemFn,
    done: &mut BTreeSet<String>,
    functions: &mut Vec<Function>,
) -> Result<(), Refusal> {
    let name = source.sig.ident.to_string();
    if !done.insert(name.clone()) {
        return Ok(());
    }
    let mut function = evaluator.function(home, source)?;
    for (called, at) in std::mem::take(&mut evaluator.calls) {
        if called == name {
            let file = &tree.modules[home].file;
            return Err(Refusal::at(
                file,
                source.sig.span(),
                "it calls itself, which no shader can",
            ));
        }
        if let Some((at, Item::Function(f))) = tree.resolve(at, &[called]) {
            with_called(tree, evaluator, at, &f, done, functions)?;
        }
    }
    tidy(&mut function);
    functions.push(function);
    Ok(())
}
