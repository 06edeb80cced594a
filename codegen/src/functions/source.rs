//! A crate's sources, parsed: modules, imports, items and implementations, by their paths.

use std::collections::{BTreeMap, HashMap};
use std::rc::Rc;

use proc_macro2::TokenStream;
use syn::spanned::Spanned;

use super::expand::Rules;
use super::refusal::Refusal;

/// The text of a crate.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct CrateText {
    /// Its name, as `use` has it.
    pub name: String,
    /// Its version.
    pub version: String,
    /// Its licence, as SPDX writes it; empty if its Cargo.toml says none.
    pub licence: String,
    /// Its `.rs` files by their path from the crate's folder, with `/`.
    pub files: BTreeMap<String, String>,
}

/// A module, by its place among [`Tree::modules`].
pub type ModuleId = usize;

/// A module.
pub struct Module {
    /// The crate's name, then the modules'.
    pub path: Vec<String>,
    /// Its file, from the crate's folder.
    pub file: String,
    /// The file's lines.
    pub lines: Rc<Vec<String>>,
    /// Its items but modules, which have a name space of their own.
    items: HashMap<String, Item>,
    /// Its modules.
    children: HashMap<String, ModuleId>,
    /// Names that `use` makes, and what they stand for.
    uses: HashMap<String, Vec<String>>,
    /// Paths of `use …::*`.
    globs: Vec<Vec<String>>,
}

/// What a name stands for.
#[derive(Clone)]
pub enum Item {
    /// A function.
    Function(Rc<syn::ItemFn>),
    /// A structure.
    Struct(Rc<syn::ItemStruct>),
    /// A constant.
    Const(Rc<syn::ItemConst>),
    /// A module.
    Module(ModuleId),
    /// Anything else.
    Other,
}

/// An implementation's function, with where it stands.
#[derive(Clone)]
pub struct Method {
    /// The module of the implementation.
    pub module: ModuleId,
    /// The implementation's generic parameters.
    pub generics: syn::Generics,
    /// The function.
    pub function: Rc<syn::ImplItemFn>,
}

/// A `library!`.
pub struct Invocation {
    /// The module that it stands in.
    pub module: ModuleId,
    /// Its tokens.
    pub tokens: TokenStream,
}

/// All modules of a crate and of those that it depends on.
#[derive(Default)]
pub struct Tree {
    /// The modules.
    pub modules: Vec<Module>,
    /// Each crate's root.
    pub crates: HashMap<String, ModuleId>,
    /// Functions of implementations, by the structure's identity (`crate::module::Name`) and name.
    pub methods: HashMap<(String, String), Method>,
    /// Constants of implementations, likewise.
    pub constants: HashMap<(String, String), (ModuleId, Rc<syn::ImplItemConst>)>,
    /// The libraries of all crates.
    pub libraries: Vec<Invocation>,
    /// What keys in documentation stand for: items `- \[KEY\] …` in the documentation of the crates' roots.
    pub references: BTreeMap<String, String>,
    /// `macro_rules!` by crate and name.
    rules: HashMap<(String, String), Rc<Rules>>,
    impls: Vec<(ModuleId, syn::ItemImpl)>,
}

/// The items `- \[KEY\] …` of a file's own documentation, without marks of emphasis.
fn references(text: &str) -> BTreeMap<String, String> {
    let mut found: BTreeMap<String, String> = BTreeMap::new();
    let mut last = None;
    for line in text.lines().map_while(|line| line.strip_prefix("//!")) {
        let line = line.trim_end();
        if let Some((key, rest)) = line
            .strip_prefix(" - \\[")
            .and_then(|rest| rest.split_once("\\] "))
        {
            found.insert(key.into(), rest.replace('*', ""));
            last = Some(key.to_owned());
        } else if let (Some(key), Some(more)) = (&last, line.strip_prefix("   ")) {
            if let Some(text) = found.get_mut(key) {
                text.push(' ');
                text.push_str(&more.trim_start().replace('*', ""));
            }
        } else {
            last = None;
        }
    }
    found
}

impl Tree {
    /// Reads crates.
    ///
    /// # Errors
    /// A file that is missing or is not Rust.
    pub fn read(crates: &[CrateText]) -> Result<Self, Refusal> {
        let mut tree = Self::default();
        for krate in crates {
            // A crate without `src/lib.rs` (procedural macros, programs) has nothing to translate.
            if !krate.files.contains_key("src/lib.rs") {
                continue;
            }
            tree.references
                .extend(references(&krate.files["src/lib.rs"]));
            let name = krate.name.replace('-', "_");
            let id = tree.file(krate, vec![name.clone()], "src/lib.rs", "src")?;
            tree.crates.insert(name, id);
        }
        for (module, block) in std::mem::take(&mut tree.impls) {
            tree.implementation(module, &block);
        }
        Ok(tree)
    }

    fn file(
        &mut self,
        krate: &CrateText,
        path: Vec<String>,
        file: &str,
        folder: &str,
    ) -> Result<ModuleId, Refusal> {
        let text = &krate.files[file];
        let parsed = syn::parse_file(text)
            .map_err(|e| Refusal::at(file, e.span(), format!("this is not Rust: {e}")))?;
        let lines = Rc::new(text.lines().map(str::to_owned).collect());
        self.module(krate, path, file, folder, lines, parsed.items)
    }

    fn module(
        &mut self,
        krate: &CrateText,
        path: Vec<String>,
        file: &str,
        folder: &str,
        lines: Rc<Vec<String>>,
        items: Vec<syn::Item>,
    ) -> Result<ModuleId, Refusal> {
        let id = self.modules.len();
        self.modules.push(Module {
            path,
            file: file.into(),
            lines,
            items: HashMap::new(),
            children: HashMap::new(),
            uses: HashMap::new(),
            globs: Vec::new(),
        });
        self.items(krate, id, folder, items)?;
        Ok(id)
    }

    fn items(
        &mut self,
        krate: &CrateText,
        id: ModuleId,
        folder: &str,
        items: Vec<syn::Item>,
    ) -> Result<(), Refusal> {
        // A macro may be used before the module that follows in the text, never before itself.
        for item in items {
            let (name, item) = match item {
                syn::Item::Fn(f) => (f.sig.ident.to_string(), Item::Function(Rc::new(f))),
                syn::Item::Struct(s) => (s.ident.to_string(), Item::Struct(Rc::new(s))),
                syn::Item::Const(c) => (c.ident.to_string(), Item::Const(Rc::new(c))),
                syn::Item::Enum(e) => (e.ident.to_string(), Item::Other),
                syn::Item::Trait(t) => (t.ident.to_string(), Item::Other),
                syn::Item::Type(t) => (t.ident.to_string(), Item::Other),
                syn::Item::Use(u) => {
                    let module = &mut self.modules[id];
                    imports(&u.tree, &mut Vec::new(), module);
                    continue;
                }
                syn::Item::Impl(block) => {
                    self.impls.push((id, block));
                    continue;
                }
                syn::Item::Mod(m) => {
                    if for_tests(&m.attrs) {
                        continue;
                    }
                    let name = m.ident.to_string();
                    let mut path = self.modules[id].path.clone();
                    path.push(name.clone());
                    let inner = format!("{folder}/{name}");
                    let child = match m.content {
                        Some((_, items)) => {
                            let (file, lines) = {
                                let here = &self.modules[id];
                                (here.file.clone(), here.lines.clone())
                            };
                            self.module(krate, path, &file, &inner, lines, items)?
                        }
                        None => {
                            let candidates = [format!("{inner}.rs"), format!("{inner}/mod.rs")];
                            // One that is not there is compiled under some `cfg` only.
                            let Some(file) =
                                candidates.iter().find(|c| krate.files.contains_key(*c))
                            else {
                                continue;
                            };
                            self.file(krate, path, file, &inner)?
                        }
                    };
                    self.modules[id].children.insert(name, child);
                    continue;
                }
                syn::Item::Macro(m) => {
                    let name = m.mac.path.segments.last().map(|s| s.ident.to_string());
                    let name = name.unwrap_or_default();
                    let crate_name = self.modules[id].path[0].clone();
                    if let (Some(ident), "macro_rules") = (&m.ident, name.as_str()) {
                        // One that cannot be read may never be needed.
                        if let Ok(rules) = Rules::parse(m.mac.tokens.clone()) {
                            self.rules
                                .insert((crate_name, ident.to_string()), Rc::new(rules));
                        }
                    } else if name == "library" {
                        self.libraries.push(Invocation {
                            module: id,
                            tokens: m.mac.tokens.clone(),
                        });
                    } else if let Some(rules) = self.rules.get(&(crate_name, name.clone())).cloned()
                    {
                        let file = self.modules[id].file.clone();
                        let refuse = |reason: String| {
                            Refusal::at(&file, m.mac.path.span(), format!("`{name}!`: {reason}"))
                        };
                        let tokens = rules.expand(&m.mac.tokens).map_err(refuse)?;
                        // What is no list of items is for the compiler only.
                        if let Ok(file) = syn::parse2::<syn::File>(tokens) {
                            self.items(krate, id, folder, file.items)?;
                        }
                    }
                    continue;
                }
                _ => continue,
            };
            self.modules[id].items.insert(name, item);
        }
        Ok(())
    }

    fn implementation(&mut self, module: ModuleId, block: &syn::ItemImpl) {
        let syn::Type::Path(path) = block.self_ty.as_ref() else {
            return;
        };
        let names = segments(&path.path);
        // Of the number types only `f32` has a form, and of its traits' functions the DSL's own.
        let elementary = block
            .trait_
            .as_ref()
            .is_some_and(|(_, of, _)| of.segments.last().is_some_and(|s| s.ident == "Elementary"));
        let identity = if elementary && names == ["f32"] {
            Some("f32".to_owned())
        } else {
            self.structure(module, &names)
        };
        let Some(identity) = identity else {
            return;
        };
        for item in &block.items {
            match item {
                syn::ImplItem::Fn(f) => {
                    let method = Method {
                        module,
                        generics: block.generics.clone(),
                        function: Rc::new(f.clone()),
                    };
                    self.methods
                        .insert((identity.clone(), f.sig.ident.to_string()), method);
                }
                syn::ImplItem::Const(c) => {
                    self.constants.insert(
                        (identity.clone(), c.ident.to_string()),
                        (module, Rc::new(c.clone())),
                    );
                }
                _ => {}
            }
        }
    }

    /// A macro of the crate that a module belongs to.
    pub fn rules(&self, module: ModuleId, name: &str) -> Option<Rc<Rules>> {
        let krate = self.modules[module].path[0].clone();
        self.rules.get(&(krate, name.to_owned())).cloned()
    }

    /// What a path stands for, and the module that it is in.
    pub fn resolve(&self, module: ModuleId, path: &[String]) -> Option<(ModuleId, Item)> {
        self.resolve_within(module, path, 0)
    }

    fn resolve_within(
        &self,
        module: ModuleId,
        path: &[String],
        depth: u32,
    ) -> Option<(ModuleId, Item)> {
        // Imports may go around in circles.
        if depth > 16 {
            return None;
        }
        let (first, rest) = path.split_first()?;
        let here = &self.modules[module];
        let own = |id: ModuleId| Some((id, Item::Module(id)));
        // What is followed by more is a module.
        if !rest.is_empty() {
            let next = match first.as_str() {
                "crate" => *self.crates.get(&here.path[0])?,
                "self" => module,
                "super" => self.parent(module)?,
                name => match here.children.get(name) {
                    Some(&id) => id,
                    None => match self.imported(module, name, depth, true) {
                        Some((_, Item::Module(id))) => id,
                        _ => *self.crates.get(name)?,
                    },
                },
            };
            return self.resolve_within(next, rest, depth + 1);
        }
        match first.as_str() {
            "crate" => own(*self.crates.get(&here.path[0])?),
            "self" => own(module),
            "super" => own(self.parent(module)?),
            name => match here.items.get(name) {
                Some(item) => Some((module, item.clone())),
                None => self
                    .imported(module, name, depth, false)
                    .or_else(|| own(*here.children.get(name)?)),
            },
        }
    }

    fn imported(
        &self,
        module: ModuleId,
        name: &str,
        depth: u32,
        as_module: bool,
    ) -> Option<(ModuleId, Item)> {
        let here = &self.modules[module];
        if let Some(path) = here.uses.get(name) {
            let (first, rest) = path.split_first()?;
            // `use a::a;`: the first `a` is a module here or a crate, not the import itself.
            if first == name {
                let id = match here.children.get(name) {
                    Some(&id) => id,
                    None => *self.crates.get(name)?,
                };
                if rest.is_empty() {
                    return Some((id, Item::Module(id)));
                }
                return self.resolve_within(id, rest, depth + 1);
            }
            let found = self.resolve_within(module, path, depth + 1);
            return match found {
                Some((_, Item::Module(_))) | None => found,
                Some(_) if as_module => None,
                some => some,
            };
        }
        here.globs.iter().find_map(|glob| {
            let mut path = glob.clone();
            path.push(name.into());
            self.resolve_within(module, &path, depth + 1)
        })
    }

    fn parent(&self, module: ModuleId) -> Option<ModuleId> {
        let path = &self.modules[module].path;
        let up = &path[..path.len() - 1];
        self.modules.iter().position(|m| m.path == up)
    }

    /// The identity of the structure that a path names.
    pub fn structure(&self, module: ModuleId, path: &[String]) -> Option<String> {
        let (home, item) = self.resolve(module, path)?;
        match item {
            Item::Struct(s) => Some(format!(
                "{}::{}",
                self.modules[home].path.join("::"),
                s.ident
            )),
            _ => None,
        }
    }

    /// The structure with an identity, and its module.
    pub fn structure_of(&self, identity: &str) -> Option<(ModuleId, Rc<syn::ItemStruct>)> {
        let path: Vec<String> = identity.split("::").map(str::to_owned).collect();
        let (name, modules) = path.split_last()?;
        let module = self.modules.iter().position(|m| m.path == modules)?;
        match self.modules[module].items.get(name)? {
            Item::Struct(s) => Some((module, s.clone())),
            _ => None,
        }
    }
}

/// The names of a path.
pub fn segments(path: &syn::Path) -> Vec<String> {
    path.segments.iter().map(|s| s.ident.to_string()).collect()
}

/// The lines of a documentation.
pub fn docs(attributes: &[syn::Attribute]) -> Vec<String> {
    let mut lines = Vec::new();
    for attribute in attributes {
        if let syn::Meta::NameValue(pair) = &attribute.meta
            && pair.path.is_ident("doc")
            && let syn::Expr::Lit(syn::ExprLit {
                lit: syn::Lit::Str(text),
                ..
            }) = &pair.value
        {
            lines.extend(
                text.value()
                    .lines()
                    .map(|line| line.strip_prefix(' ').unwrap_or(line).trim_end().to_owned()),
            );
            if text.value().is_empty() {
                lines.push(String::new());
            }
        }
    }
    lines
}

fn for_tests(attributes: &[syn::Attribute]) -> bool {
    attributes.iter().any(|a| {
        a.path().is_ident("cfg")
            && matches!(&a.meta, syn::Meta::List(l) if l.tokens.to_string() == "test")
    })
}

fn imports(tree: &syn::UseTree, before: &mut Vec<String>, module: &mut Module) {
    match tree {
        syn::UseTree::Path(p) => {
            before.push(p.ident.to_string());
            imports(&p.tree, before, module);
            before.pop();
        }
        syn::UseTree::Name(n) => {
            let name = n.ident.to_string();
            let mut path = before.clone();
            if name == "self" {
                if let Some(last) = path.last().cloned() {
                    module.uses.insert(last, path);
                }
                return;
            }
            path.push(name.clone());
            module.uses.insert(name, path);
        }
        syn::UseTree::Rename(r) => {
            let mut path = before.clone();
            path.push(r.ident.to_string());
            module.uses.insert(r.rename.to_string(), path);
        }
        syn::UseTree::Glob(_) => module.globs.push(before.clone()),
        syn::UseTree::Group(g) => {
            for tree in &g.items {
                imports(tree, before, module);
            }
        }
    }
}
