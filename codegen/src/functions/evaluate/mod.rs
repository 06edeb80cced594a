//! From a function's syntax tree to statements of scalars: the function is run, as far as that goes
//! without knowing its arguments. Constants, structures, arrays, closures, generic parameters and
//! `unroll!` are settled here, as the Rust compiler settles them; what is left are operations on
//! numbers that are not known, in the source's order. What has no form is refused with its place.
//!
//! All of it is one [`Evaluator`], which this file defines and starts: [`Evaluator::function`] declares
//! the parameters, runs the body as a block, and emits a `return`. Its methods are in files of their own:
//!
//! - `statements`: blocks, `let` and patterns, and the source's own macros, which become blocks;
//! - `control`: `if` and `match`;
//! - `loops`: `for`, `while` and `unroll!`;
//! - `returns`: an early `return`, written as the value of a branch;
//! - `expressions`: every other expression; those of some length are passed on to
//!   - `operators`: unary and binary operators,
//!   - `calls`: functions, methods and closures, run in place or kept as calls,
//!   - `builtins`: functions, methods and casts of the number types;
//! - `variables`: the source's names, the locals that hold their numbers, and what is assigned to;
//! - `types`: generic parameters, the types of interfaces, and values put together for them.

mod builtins;
mod calls;
mod control;
mod expressions;
mod loops;
mod operators;
mod returns;
mod statements;
mod types;
mod variables;

use std::collections::{BTreeSet, HashMap, HashSet};
use std::rc::Rc;

use proc_macro2::Span;
use syn::spanned::Spanned;

use super::fold::{self, local};
use super::ir::{Constant, Function, Id, Leave, Literal, Local, Param, Rank, Stmt, Struct, Type};
use super::refusal::Refusal;
use super::source::{ModuleId, Tree, docs};
use super::value::{Generic, Value};

/// Why an expression has no value.
pub(super) enum Stop {
    Refused(Refusal),
    Return(Value),
    Leave(Leave),
}

impl From<Refusal> for Stop {
    fn from(refusal: Refusal) -> Self {
        Self::Refused(refusal)
    }
}

pub(super) type Done<T> = Result<T, Stop>;

/// What is known where an expression stands.
#[derive(Clone)]
pub(super) struct Frame {
    /// Variables by name, innermost last.
    scopes: Vec<HashMap<String, usize>>,
    generics: HashMap<String, Generic>,
    module: ModuleId,
    /// `Self`
    own: Option<Rc<str>>,
    /// How many calls this one is within.
    depth: usize,
}

impl Frame {
    fn find(&self, name: &str) -> Option<usize> {
        self.scopes.iter().rev().find_map(|s| s.get(name).copied())
    }
}

/// A variable of the source.
#[derive(Clone)]
struct Slot {
    name: String,
    value: Value,
    /// How many loops and branches it was declared in.
    depth: usize,
}

/// Translates functions of a tree, one at a time.
#[derive(Clone)]
pub struct Evaluator<'a> {
    tree: &'a Tree,
    slots: Vec<Slot>,
    locals: Vec<Local>,
    /// Locals that change.
    changing: HashSet<Id>,
    /// The statements of the loops and branches around, innermost last.
    blocks: Vec<Vec<Stmt>>,
    /// Functions that are called.
    pub calls: BTreeSet<(String, ModuleId)>,
    /// Structures at interfaces.
    pub structs: Vec<Struct>,
}

impl<'a> Evaluator<'a> {
    /// For a tree.
    pub fn new(tree: &'a Tree) -> Self {
        Self {
            tree,
            slots: Vec::new(),
            locals: Vec::new(),
            changing: HashSet::new(),
            blocks: Vec::new(),
            calls: BTreeSet::new(),
            structs: Vec::new(),
        }
    }

    pub(super) fn refuse(&self, frame: &Frame, span: Span, reason: impl Into<String>) -> Stop {
        let file = &self.tree.modules[frame.module].file;
        Stop::Refused(Refusal::at(file, span, reason))
    }

    fn frame_for(&self, frame: &Frame, module: ModuleId, own: Option<Rc<str>>) -> Frame {
        Frame {
            scopes: vec![HashMap::new()],
            generics: HashMap::new(),
            module,
            own,
            depth: frame.depth + 1,
        }
    }

    /// Translates a function.
    ///
    /// # Errors
    /// What has no form.
    pub fn function(
        &mut self,
        module: ModuleId,
        source: &syn::ItemFn,
    ) -> Result<Function, Refusal> {
        self.slots.clear();
        self.locals.clear();
        self.changing.clear();
        self.blocks = vec![Vec::new()];
        let mut frame = Frame {
            scopes: vec![HashMap::new()],
            generics: HashMap::new(),
            module,
            own: None,
            depth: 0,
        };
        match self.whole(&mut frame, source) {
            Ok(function) => Ok(function),
            Err(Stop::Refused(refusal)) => Err(refusal),
            Err(Stop::Return(_) | Stop::Leave(_)) => Err(Refusal::at(
                &self.tree.modules[module].file,
                source.sig.span(),
                "`break` and `continue` stand in a loop",
            )),
        }
    }

    fn whole(&mut self, frame: &mut Frame, source: &syn::ItemFn) -> Done<Function> {
        let sig = &source.sig;
        self.generics(frame, &sig.generics, None, sig.span())?;
        let mut params = Vec::new();
        for input in &sig.inputs {
            let syn::FnArg::Typed(typed) = input else {
                return Err(self.refuse(
                    frame,
                    input.span(),
                    "`self` is not a parameter of a function",
                ));
            };
            let syn::Pat::Ident(pat) = typed.pat.as_ref() else {
                let reason = "a parameter of a library's function has a name: take it apart inside";
                return Err(self.refuse(frame, typed.pat.span(), reason));
            };
            let ty = self.interface(frame, &typed.ty)?;
            let name = pat.ident.to_string();
            let id = self.new_local(&name, ty.clone(), Rank::Variable);
            let value = match &ty {
                Type::Lookup(_) => Value::Lookup(id),
                _ => self.taken_apart(&local(id, ty.clone())),
            };
            self.declare(frame, &name, value);
            params.push(Param { id, ty });
        }
        let result = match &sig.output {
            syn::ReturnType::Default => {
                return Err(self.refuse(
                    frame,
                    sig.span(),
                    "a function of a library gives something",
                ));
            }
            syn::ReturnType::Type(_, ty) => self.interface(frame, ty)?,
        };
        let value = self.body(frame, &source.block)?;
        let value = self.typed(frame, value, return_type(sig), source.block.span())?;
        let value = self.put_together(frame, &value, &result, source.block.span())?;
        self.emit(Stmt::Return(value));
        let here = &self.tree.modules[frame.module];
        Ok(Function {
            name: sig.ident.to_string(),
            docs: docs(&source.attrs),
            place: format!("{}:{}", here.file, sig.ident.span().start().line),
            params,
            result,
            locals: std::mem::take(&mut self.locals),
            body: self.blocks.pop().unwrap_or_default(),
        })
    }

    /// Evaluates a constant.
    ///
    /// # Errors
    /// What has no form.
    pub fn constant(
        &mut self,
        module: ModuleId,
        source: &syn::ItemConst,
    ) -> Result<Constant, Refusal> {
        self.blocks = vec![Vec::new()];
        let frame = Frame {
            scopes: vec![HashMap::new()],
            generics: HashMap::new(),
            module,
            own: None,
            depth: 0,
        };
        let file = self.tree.modules[module].file.clone();
        let refuse = |reason: &str| Refusal::at(&file, source.span(), reason);
        let value = self
            .expr(&mut frame.clone(), &source.expr)
            .and_then(|v| self.typed(&frame, v, Some(&source.ty), source.span()));
        let value = match value {
            Ok(value) => value,
            Err(Stop::Refused(refusal)) => return Err(refusal),
            Err(Stop::Return(_) | Stop::Leave(_)) => {
                return Err(refuse("a constant returns nothing"));
            }
        };
        let of_scalar = |v: &Value| match v {
            Value::Scalar(e) => fold::known(e),
            Value::Double(d) => Some(Literal::F32(*d as f32)),
            _ => None,
        };
        let values: Option<Vec<Literal>> = match &value {
            Value::Vector(_, all) => all.iter().map(of_scalar).collect(),
            other => of_scalar(other).map(|l| vec![l]),
        };
        let values = values.filter(|v| !v.is_empty()).ok_or_else(|| {
            refuse("a constant of a library is a scalar or a glam vector of known numbers")
        })?;
        let scalar = values[0].scalar();
        Ok(Constant {
            name: source.ident.to_string(),
            docs: docs(&source.attrs),
            ty: if matches!(value, Value::Vector(..)) {
                Type::Vector(scalar, values.len())
            } else {
                Type::Scalar(scalar)
            },
            values,
        })
    }
}

fn return_type(sig: &syn::Signature) -> Option<&syn::Type> {
    match &sig.output {
        syn::ReturnType::Type(_, ty) => Some(ty),
        syn::ReturnType::Default => None,
    }
}

/// Whether a function has `#[function]`.
pub fn is_function(attributes: &[syn::Attribute]) -> bool {
    attributes.iter().any(|a| {
        a.path()
            .segments
            .last()
            .is_some_and(|s| s.ident == "function")
    })
}
