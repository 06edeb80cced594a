//! Looks through a kernel crate's own source for what Rust accepts and shaders do not have, before
//! anything is compiled.
//!
//! It reads syntax, not types, and speaks up only where syntax is enough:
//!
//! - a kernel that `kernels![…]` does not list, which nobody would get;
//! - in kernels and what they call: recursion, statics, trait objects, function pointers, numbers of
//!   8, 16 and 128 bits.
//!
//! It also says how the crate is to be compiled: whether it iterates over arrays, and has functions of
//! slices.
//!
//! What it does not see, rust-gpu refuses later. Calls are followed by name within the crate; a name
//! that several functions have is not followed.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use proc_macro2::{Delimiter, Span, TokenStream, TokenTree};
use syn::punctuated::Punctuated;
use syn::visit::Visit;

use super::{Diagnostic, Level, Place, shown};

/// What was found in a kernel crate.
#[derive(Debug, Default, PartialEq, Eq)]
pub struct Found {
    /// What has to be written otherwise.
    pub diagnostics: Vec<Diagnostic>,
    /// What its kernels do with arrays.
    pub arrays: Arrays,
}

/// What kernels do with arrays that goes by way of `core`'s slices.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Arrays {
    /// They iterate, or call methods of slices.
    pub iterated: bool,
    /// There are functions that take a slice.
    pub passed_as_slices: bool,
}

/// A function of the crate.
struct Function {
    file: usize,
    name: Span,
    is_kernel: bool,
    /// Names of functions that it calls by a path, each with the place of the first call.
    calls: BTreeMap<String, Span>,
    /// Everything that it names.
    names: BTreeSet<String>,
    /// What no shader has: where, what, and what to do.
    refused: Vec<(Span, String, &'static str)>,
    arrays: Arrays,
}

#[derive(Default)]
struct Crate {
    files: Vec<PathBuf>,
    functions: BTreeMap<String, Vec<Function>>,
    statics: BTreeMap<String, (usize, Span)>,
    /// Names that `kernels![…]` lists; none if it was not found.
    listed: Option<BTreeSet<String>>,
    /// Items that a macro makes iterate, as far as their tokens tell.
    iterated_in_macros: bool,
}

/// Looks through the crate whose Cargo.toml lies in `folder`. A file that cannot be read or parsed is
/// left to rustc.
#[must_use]
pub fn check(folder: &Path) -> Found {
    let mut all = Crate::default();
    let mut parsed = Vec::new();
    for path in rust_files(&folder.join("src")) {
        let text = std::fs::read_to_string(&path).ok();
        if let Some(file) = text.and_then(|text| syn::parse_file(&text).ok()) {
            parsed.push((path, file));
        }
    }
    let elsewhere: BTreeSet<PathBuf> = parsed
        .iter()
        .flat_map(|(path, file)| files_of(path, &file.items, &|it| is_elsewhere(&it.attrs)))
        .collect();
    let modules = modules(&folder.join("src/lib.rs"), &parsed);
    for (path, parsed) in &parsed {
        if path.ancestors().any(|part| elsewhere.contains(part)) {
            continue;
        }
        all.files.push(path.clone());
        let file = all.files.len() - 1;
        Items {
            all: &mut all,
            file,
            // Another one may be declared by a macro, and iterate.
            is_declared: modules.contains(path),
        }
        .visit_file(parsed);
    }
    Found {
        diagnostics: all.diagnostics(),
        arrays: all.arrays(),
    }
}

/// Rust sources below a folder, in order; not those of programs.
fn rust_files(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(next) = folders.pop() {
        for entry in std::fs::read_dir(&next).into_iter().flatten().flatten() {
            let path = entry.path();
            if path.is_dir() {
                if path != folder.join("bin") {
                    folders.push(path);
                }
            } else if path.extension().is_some_and(|it| it == "rs") {
                found.push(path);
            }
        }
    }
    found.sort();
    found
}

/// The files of a crate's modules, as far as files declare them; all where there is no root.
fn modules(root: &Path, parsed: &[(PathBuf, syn::File)]) -> BTreeSet<PathBuf> {
    let by_path: BTreeMap<&Path, &syn::File> = parsed
        .iter()
        .map(|(path, file)| (path.as_path(), file))
        .collect();
    if !by_path.contains_key(root) {
        return by_path.into_keys().map(Path::to_owned).collect();
    }
    let mut found = BTreeSet::new();
    let mut open = vec![root.to_owned()];
    while let Some(path) = open.pop() {
        if let Some(file) = by_path.get(path.as_path())
            && found.insert(path.clone())
        {
            let declared = files_of(&path, &file.items, &|_| true);
            open.extend(declared.iter().map(|it| it.join("mod.rs")));
            open.extend(declared);
        }
    }
    found
}

/// Files and folders of those modules that a file declares and that are wanted.
fn files_of(
    path: &Path,
    items: &[syn::Item],
    is_wanted: &dyn Fn(&syn::ItemMod) -> bool,
) -> Vec<PathBuf> {
    let is_root = ["lib.rs", "mod.rs"].iter().any(|name| path.ends_with(name));
    let folder = match is_root {
        true => path.parent().unwrap_or(path).to_owned(),
        false => path.with_extension(""),
    };
    files_in(&folder, path.parent().unwrap_or(path), items, is_wanted)
}

/// The same, of modules whose files lie in `folder`; `beside` is where a `path` attribute begins.
fn files_in(
    folder: &Path,
    beside: &Path,
    items: &[syn::Item],
    is_wanted: &dyn Fn(&syn::ItemMod) -> bool,
) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for item in items {
        let syn::Item::Mod(module) = item else {
            continue;
        };
        let name = syn::ext::IdentExt::unraw(&module.ident).to_string();
        match &module.content {
            Some((_, within)) => {
                let folder = folder.join(name);
                found.extend(files_in(&folder, &folder, within, is_wanted));
            }
            None if is_wanted(module) => match path_attribute(&module.attrs) {
                Some(path) => found.push(beside.join(path)),
                None => {
                    found.extend([folder.join(format!("{name}.rs")), folder.join(name)]);
                }
            },
            None => {}
        }
    }
    found
}

/// The file that `#[path = "…"]` names.
fn path_attribute(attributes: &[syn::Attribute]) -> Option<String> {
    attributes.iter().find_map(|it| match &it.meta {
        syn::Meta::NameValue(it) if it.path.is_ident("path") => match &it.value {
            syn::Expr::Lit(syn::ExprLit {
                lit: syn::Lit::Str(path),
                ..
            }) => Some(path.value()),
            _ => None,
        },
        _ => None,
    })
}

impl Crate {
    fn place(&self, file: usize, span: Span) -> Place {
        let (start, end) = (span.start(), span.end());
        Place {
            file: shown(&self.files[file]),
            line: start.line as u32,
            column: start.column as u32 + 1,
            length: match end.line == start.line {
                true => (end.column - start.column).max(1) as u32,
                false => 1,
            },
        }
    }

    fn diagnostics(&self) -> Vec<Diagnostic> {
        let mut found = self.unlisted();
        for name in self.reached(false) {
            let [function] = self.functions[&name].as_slice() else {
                continue;
            };
            let mut tell = |file, span, message: String, help: &str| {
                found.push(Diagnostic {
                    place: Some(self.place(file, span)),
                    level: Level::Error,
                    message,
                    help: vec![help.into()],
                });
            };
            for (span, message, help) in &function.refused {
                tell(function.file, *span, message.clone(), help);
            }
            if let Some(span) = self.way_back(&name) {
                tell(
                    function.file,
                    span,
                    format!("`{name}` calls itself, and a shader has no stack to do so"),
                    "write a loop; where it branches, with an array of what is left to do",
                );
            }
            for (other, (file, span)) in &self.statics {
                if function.names.contains(other) {
                    tell(
                        *file,
                        *span,
                        format!("`{other}` is a static, and a shader has none"),
                        "write `const`",
                    );
                }
            }
        }
        found.sort();
        found.dedup();
        found
    }

    /// Names that several functions have count here, too: what is compiled otherwise computes the same.
    fn arrays(&self) -> Arrays {
        let mut arrays = Arrays {
            iterated: self.iterated_in_macros,
            passed_as_slices: false,
        };
        for function in self
            .reached(true)
            .iter()
            .flat_map(|name| &self.functions[name])
        {
            arrays.iterated |= function.arrays.iterated;
            arrays.passed_as_slices |= function.arrays.passed_as_slices;
        }
        arrays
    }

    fn unlisted(&self) -> Vec<Diagnostic> {
        let Some(listed) = &self.listed else {
            return Vec::new();
        };
        let kernels = self.functions.iter().flat_map(|(name, all)| {
            all.iter()
                .filter(|function| function.is_kernel)
                .map(move |function| (name, function))
        });
        kernels
            .filter(|(name, _)| !listed.contains(*name))
            .map(|(name, function)| Diagnostic {
                place: Some(self.place(function.file, function.name)),
                level: Level::Error,
                message: format!("the kernel `{name}` is not listed, so that nobody gets it"),
                help: vec![format!("add `{name}` to the crate's `kernels![…]`")],
            })
            .collect()
    }

    /// Kernels that are listed, and the crate's functions that they call, by name; by way of names that
    /// several functions have only if that is wanted.
    fn reached(&self, through_all: bool) -> BTreeSet<String> {
        let is_kernel = |name: &str| self.functions[name].iter().any(|it| it.is_kernel);
        let mut open: Vec<&String> = self.functions.keys().filter(|it| is_kernel(it)).collect();
        let mut reached = BTreeSet::new();
        while let Some(name) = open.pop() {
            if !reached.insert(name.clone()) {
                continue;
            }
            let functions = self.functions[name].as_slice();
            if functions.len() > 1 && !through_all {
                continue;
            }
            open.extend(
                functions
                    .iter()
                    .flat_map(|function| &function.names)
                    .filter(|other| self.functions.contains_key(*other)),
            );
        }
        reached
    }

    /// The call of `name` by which it comes back to itself.
    fn way_back(&self, name: &str) -> Option<Span> {
        let calls = |of: &str| match self.functions.get(of).map(Vec::as_slice) {
            Some([function]) => Some(&function.calls),
            _ => None,
        };
        for (first, span) in calls(name)? {
            let mut open = vec![first.as_str()];
            let mut seen = BTreeSet::new();
            while let Some(next) = open.pop() {
                if next == name {
                    return Some(*span);
                }
                if seen.insert(next) {
                    open.extend(
                        calls(next)
                            .into_iter()
                            .flatten()
                            .map(|(name, _)| name.as_str()),
                    );
                }
            }
        }
        None
    }
}

/// Whether an item is not part of the shaders: tests, or what is kept from them.
fn is_elsewhere(attributes: &[syn::Attribute]) -> bool {
    attributes.iter().any(|attribute| {
        let is_cfg = attribute.path().is_ident("cfg");
        let text = quote::ToTokens::to_token_stream(&attribute.meta).to_string();
        is_cfg && (text.contains("test") || text.contains("not"))
    })
}

struct Items<'a> {
    all: &'a mut Crate,
    file: usize,
    /// Whether it is a module's.
    is_declared: bool,
}

impl Items<'_> {
    fn function(
        &mut self,
        attributes: &[syn::Attribute],
        signature: &syn::Signature,
        block: &syn::Block,
    ) {
        let mut body = Body::default();
        body.visit_signature(signature);
        body.visit_block(block);
        let last = |attribute: &syn::Attribute| {
            attribute
                .path()
                .segments
                .last()
                .map(|it| it.ident.to_string())
        };
        let function = Function {
            file: self.file,
            name: signature.ident.span(),
            is_kernel: self.is_declared
                && attributes
                    .iter()
                    .any(|attribute| last(attribute).as_deref() == Some("kernel")),
            calls: body.calls,
            names: body.names,
            refused: body.refused,
            arrays: body.arrays,
        };
        let name = signature.ident.to_string();
        self.all.functions.entry(name).or_default().push(function);
    }
}

impl<'ast> Visit<'ast> for Items<'_> {
    fn visit_item_mod(&mut self, item: &'ast syn::ItemMod) {
        if !is_elsewhere(&item.attrs) {
            syn::visit::visit_item_mod(self, item);
        }
    }

    fn visit_item_fn(&mut self, item: &'ast syn::ItemFn) {
        if !is_elsewhere(&item.attrs) {
            self.function(&item.attrs, &item.sig, &item.block);
        }
    }

    fn visit_impl_item_fn(&mut self, item: &'ast syn::ImplItemFn) {
        if !is_elsewhere(&item.attrs) {
            self.function(&item.attrs, &item.sig, &item.block);
        }
    }

    fn visit_item_static(&mut self, item: &'ast syn::ItemStatic) {
        if !is_elsewhere(&item.attrs) {
            let place = (self.file, item.ident.span());
            self.all.statics.insert(item.ident.to_string(), place);
        }
    }

    fn visit_macro(&mut self, item: &'ast syn::Macro) {
        let is_list = item
            .path
            .segments
            .last()
            .is_some_and(|it| it.ident == "kernels");
        if !is_list {
            self.all.iterated_in_macros |= iterates(&item.tokens);
            return;
        }
        let paths = item.parse_body_with(Punctuated::<syn::Path, syn::Token![,]>::parse_terminated);
        let listed = self.all.listed.get_or_insert_default();
        for path in paths.into_iter().flatten() {
            listed.extend(path.segments.last().map(|it| it.ident.to_string()));
        }
    }
}

/// What is in a function.
#[derive(Default)]
struct Body {
    calls: BTreeMap<String, Span>,
    names: BTreeSet<String>,
    refused: Vec<(Span, String, &'static str)>,
    arrays: Arrays,
}

/// Methods of arrays and slices. Those that other types have, too, are left out: nobody needs them who
/// needs none of these.
const METHODS: [&str; 14] = [
    "iter",
    "iter_mut",
    "into_iter",
    "as_slice",
    "as_mut_slice",
    "swap",
    "fill",
    "reverse",
    "first",
    "first_mut",
    "last",
    "last_mut",
    "contains",
    "copy_from_slice",
];

/// Whether the tokens of a macro iterate: they call one of [`METHODS`], or loop over what is no range.
fn iterates(tokens: &TokenStream) -> bool {
    let tokens: Vec<TokenTree> = tokens.clone().into_iter().collect();
    let is_group = |at: usize, delimiter| match tokens.get(at) {
        Some(TokenTree::Group(it)) => it.delimiter() == delimiter,
        _ => false,
    };
    let follows_point = |at: usize| match tokens[..at].last() {
        Some(TokenTree::Punct(it)) => it.as_char() == '.',
        _ => false,
    };
    tokens.iter().enumerate().any(|(i, token)| match token {
        TokenTree::Group(group) => iterates(&group.stream()),
        TokenTree::Ident(name) if name == "in" => {
            let body = (i..tokens.len()).find(|at| is_group(*at, Delimiter::Brace));
            let over =
                body.map(|body| tokens[i + 1..body].iter().cloned().collect::<TokenStream>());
            over.is_some_and(|over| !over.to_string().contains(".."))
        }
        TokenTree::Ident(name) => {
            let is_method = METHODS.iter().any(|it| name == it);
            is_method && follows_point(i) && is_group(i + 1, Delimiter::Parenthesis)
        }
        _ => false,
    })
}

/// Whether an expression is a range, perhaps from its end or in steps: loops over these need nothing.
fn is_range(expression: &syn::Expr) -> bool {
    match expression {
        syn::Expr::Range(_) => true,
        syn::Expr::Paren(inner) => is_range(&inner.expr),
        syn::Expr::Group(inner) => is_range(&inner.expr),
        syn::Expr::MethodCall(call) => {
            ["rev", "step_by"].iter().any(|it| call.method == it) && is_range(&call.receiver)
        }
        _ => false,
    }
}

/// Whether a path may mean a function of this crate. One through another crate's name, or a type's,
/// may end in the name of a function here and mean something else.
fn is_own(path: &syn::Path) -> bool {
    path.segments.len() == 1
        || path.segments.first().is_some_and(|first| {
            ["crate", "self", "super"]
                .iter()
                .any(|own| first.ident == own)
        })
}

const WIDTHS: [&str; 2] = ["u128", "i128"];

impl<'ast> Visit<'ast> for Body {
    fn visit_expr_call(&mut self, call: &'ast syn::ExprCall) {
        if let syn::Expr::Path(path) = &*call.func
            && path.qself.is_none()
            && let Some(last) = path.path.segments.last()
            && is_own(&path.path)
        {
            let name = last.ident.to_string();
            self.calls.entry(name).or_insert_with(|| last.ident.span());
        }
        syn::visit::visit_expr_call(self, call);
    }

    fn visit_ident(&mut self, ident: &'ast proc_macro2::Ident) {
        self.names.insert(ident.to_string());
    }

    fn visit_type_path(&mut self, ty: &'ast syn::TypePath) {
        if let Some(ident) = ty.path.get_ident()
            && WIDTHS.iter().any(|width| ident == width)
        {
            self.refused.push((
                ident.span(),
                format!("shaders have no `{ident}`: they compute with 32 bits, and some with 64"),
                "write `u32` or `i32`, with a mask or shifts where the width matters",
            ));
        }
        syn::visit::visit_type_path(self, ty);
    }

    fn visit_macro(&mut self, item: &'ast syn::Macro) {
        self.arrays.iterated |= iterates(&item.tokens);
    }

    fn visit_expr_for_loop(&mut self, repeat: &'ast syn::ExprForLoop) {
        self.arrays.iterated |= !is_range(&repeat.expr);
        syn::visit::visit_expr_for_loop(self, repeat);
    }

    fn visit_expr_method_call(&mut self, call: &'ast syn::ExprMethodCall) {
        let is_adapted =
            is_range(&call.receiver) && !["rev", "step_by"].iter().any(|it| call.method == it);
        self.arrays.iterated |= is_adapted || METHODS.iter().any(|it| call.method == it);
        syn::visit::visit_expr_method_call(self, call);
    }

    fn visit_expr_index(&mut self, index: &'ast syn::ExprIndex) {
        self.arrays.iterated |= is_range(&index.index);
        syn::visit::visit_expr_index(self, index);
    }

    fn visit_type_reference(&mut self, ty: &'ast syn::TypeReference) {
        if let syn::Type::Slice(_) = &*ty.elem {
            self.arrays.iterated = true;
            self.arrays.passed_as_slices = true;
        }
        syn::visit::visit_type_reference(self, ty);
    }

    fn visit_type_trait_object(&mut self, ty: &'ast syn::TypeTraitObject) {
        self.refused.push((
            ty.dyn_token.map_or_else(Span::call_site, |it| it.span),
            "a shader has no trait objects: which function is called must be known".into(),
            "take `impl Trait` or a type parameter, or match on an enum",
        ));
        syn::visit::visit_type_trait_object(self, ty);
    }

    fn visit_type_bare_fn(&mut self, ty: &'ast syn::TypeBareFn) {
        self.refused.push((
            ty.fn_token.span,
            "a shader has no function pointers: which function is called must be known".into(),
            "take `impl Fn(…) -> …`, or match on an enum",
        ));
        syn::visit::visit_type_bare_fn(self, ty);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(source: &str) -> Found {
        let folder = tempfile::tempdir().unwrap();
        std::fs::create_dir(folder.path().join("src")).unwrap();
        std::fs::write(folder.path().join("src/lib.rs"), source).unwrap();
        check(folder.path())
    }

    fn told(source: &str) -> Vec<String> {
        found(source)
            .diagnostics
            .into_iter()
            .map(|it| {
                let place = it.place.unwrap();
                format!("{}:{} {}", place.line, place.column, it.message)
            })
            .collect()
    }

    #[test]
    fn a_kernel_that_is_not_listed_is_named() {
        let found = told(
            "#[kernel(compute, threads(64))]\npub fn one(x: f32) -> f32 { x }\n\
             #[hankel_dsl::kernel(compute, threads(64))]\npub fn two(x: f32) -> f32 { x }\n\
             #[cfg(test)] mod tests { #[kernel] fn three() {} }\nhankel_dsl::kernels![one];\n",
        );
        assert_eq!(
            found,
            ["4:8 the kernel `two` is not listed, so that nobody gets it"]
        );
        let none = told("#[kernel]\npub fn one(x: f32) -> f32 { x }\n");
        assert!(none.is_empty(), "{none:?}");
        // Another crate's function of the same name.
        let none = told(
            "#[kernel]\npub fn one(x: f32) -> f32 { other::one(x) }\nhankel_dsl::kernels![one];\n",
        );
        assert!(none.is_empty(), "{none:?}");
    }

    #[test]
    fn a_file_that_is_no_module_is_not_of_the_crate() {
        let folder = tempfile::tempdir().unwrap();
        let source = folder.path().join("src");
        let kernel = "#[kernel(compute, threads(64))]\npub fn one(x: f32) -> f32 { x }\n";
        std::fs::create_dir_all(source.join("deeper")).unwrap();
        for file in ["left.rs", "beside.rs", "deeper/mod.rs", "deeper/inner.rs"] {
            std::fs::write(
                source.join(file),
                kernel.replace("one", &file[..file.len() - 3].replace('/', "_")),
            )
            .unwrap();
        }
        let lib = "#[path = \"beside.rs\"]\nmod other;\nmod deeper;\nhankel_dsl::kernels![];\n";
        std::fs::write(source.join("lib.rs"), lib).unwrap();
        std::fs::write(source.join("deeper/mod.rs"), "mod inner;\n").unwrap();
        let told: Vec<String> = check(folder.path())
            .diagnostics
            .into_iter()
            .map(|it| it.message)
            .collect();
        assert_eq!(told.len(), 2, "{told:?}");
        assert!(
            told[0].contains("`beside`") && told[1].contains("`deeper_inner`"),
            "{told:?}"
        );
    }

    #[test]
    fn who_iterates_over_arrays_is_known() {
        let arrays = |body: &str| {
            let source = format!(
                "fn other(x: &[f32]) {{}}\n#[kernel] fn k(a: [f32; 4]) {{ {body} }}\nkernels![k];"
            );
            let arrays = found(&source).arrays;
            (arrays.iterated, arrays.passed_as_slices)
        };
        let none = [
            "for i in 0..4 { b += a[i]; }",
            "for i in (0..4).rev().step_by(2) { b += a[i]; }",
            "for i in 0..=n { b += a[i].min(c).max(d); }",
            "let b = o.map(|x| x + 1).unwrap_or(table.get(i)); a == b",
            "unroll!(k in 0..2, { for i in 0..4 { b += a[i]; } });",
        ];
        for body in none {
            assert_eq!(arrays(body), (false, false), "{body}");
        }
        let iterated = [
            "for x in a { b += x; }",
            "for x in &a { b += x; }",
            "for (i, x) in a.iter().enumerate() {}",
            "let b: f32 = (0..4).map(|i| a[i]).sum();",
            "for i in (0..16).filter(|i| n >> i & 1 == 1) {}",
            "a.swap(0, 1);",
            "if (3..=9).contains(&n) {}",
            "for x in &a[1..] {}",
            "unroll!(k in 0..2, { b += a.iter().sum::<f32>(); });",
            "unroll!(k in 0..2, { for x in a { b += x; } });",
        ];
        for body in iterated {
            assert_eq!(arrays(body), (true, false), "{body}");
        }
        assert_eq!(arrays("other(&a)"), (true, true));
        assert_eq!(arrays("let b: &[f32] = &a;"), (true, true));
        let through_a_method = found(
            "impl A { fn at(self) -> f32 { sum(self.a) } }\nimpl B { fn at(self) -> f32 { self.b } }\n\
             fn sum(a: [f32; 4]) -> f32 { a.iter().sum() }\n\
             #[kernel] fn k(a: A) -> f32 { a.at() }\nkernels![k];",
        );
        assert!(through_a_method.arrays.iterated);
        let of_a_macro = "macro_rules! sums { ($($name:ident)*) => {$(\n\
             #[kernel] fn $name(a: [f32; 4]) -> f32 { a.iter().sum() } kernels![$name];)*} }\nsums!(k);";
        assert!(found(of_a_macro).arrays.iterated);
    }

    #[test]
    fn the_kernels_of_this_repository_are_compiled_as_they_were() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
        for folder in [
            "kernels/moments",
            "kernels/shadows",
            "tests/conformance",
            "numerics/listing",
            "examples/ports",
        ] {
            let found = check(&root.join(folder));
            assert_eq!(found, Found::default(), "{folder}");
        }
        let all = Arrays {
            iterated: true,
            passed_as_slices: true,
        };
        assert_eq!(check(&root.join("tests/iteration")).arrays, all);
    }

    #[test]
    fn what_a_shader_lacks_is_named_where_a_kernel_comes_to_it() {
        let found = told(
            "static TABLE: [f32; 2] = [1.0, 2.0];\n\
             fn even(n: u32) -> bool { n == 0 || odd(n - 1) }\n\
             fn odd(n: u32) -> bool { n != 0 && even(n - 1) }\n\
             fn shape(s: &dyn Shape) -> f32 { s.at(1.0) }\n\
             fn bytes(x: u32) -> u32 { x as u128 as u32 }\n\
             fn call(f: fn(f32) -> f32) -> f32 { f(1.0) }\n\
             fn never(x: u128) -> u128 { never(x) }\n\
             #[kernel(compute)]\n\
             fn k(n: u32) -> f32 { if even(n) { TABLE[0] } else { shape(&S) + call(g) + bytes(n) as f32 } }\n\
             kernels![k];",
        );
        assert_eq!(
            found,
            [
                "1:8 `TABLE` is a static, and a shader has none",
                "2:37 `even` calls itself, and a shader has no stack to do so",
                "3:36 `odd` calls itself, and a shader has no stack to do so",
                "4:14 a shader has no trait objects: which function is called must be known",
                "5:32 shaders have no `u128`: they compute with 32 bits, and some with 64",
                "6:12 a shader has no function pointers: which function is called must be known",
            ]
        );
    }

    #[test]
    fn plain_kernels_are_left_alone() {
        let found = told(
            "struct S; impl S { fn new() -> Self { S } }\nstruct T; impl T { fn new(s: S) -> Self { T } }\n\
             fn twice(f: impl Fn(f32) -> f32) -> f32 { f(f(1.0)) }\n\
             #[kernel(compute)]\nfn k(x: f32) -> f32 { let t = T::new(S::new()); twice(|y| y * x) }\nkernels![k];",
        );
        assert!(found.is_empty(), "{found:?}");
    }
}
