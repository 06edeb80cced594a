//! From a function's syntax tree to statements of scalars: the function is run, as far as that goes
//! without knowing its arguments. Constants, structures, arrays, closures, generic parameters and
//! `unroll!` are settled here, as the Rust compiler settles them; what is left are operations on
//! numbers that are not known, in the source's order. What has no form is refused with its place.

use std::collections::{BTreeSet, HashMap, HashSet};
use std::rc::Rc;

use proc_macro2::{Span, TokenStream, TokenTree};
use syn::spanned::Spanned;

use super::fold::{self, binary, builtin, float, literal, local, member, unary};
use super::ir::{
    Binary, Builtin, COLUMNS, Constant, Expr, Function, Id, Kind, Literal, Local, Param, Rank,
    Scalar, Signature, Stmt, Struct, Type, Unary,
};
use super::linear::{matrix_constant, matrix_name, vector_name};
use super::refusal::Refusal;
use super::source::{Item, Method, ModuleId, Tree, docs, segments};
use super::value::{Closure, Generic, Place, Step, Value};

/// Why an expression has no value.
pub(super) enum Stop {
    Refused(Refusal),
    Return(Value),
}

/// `Elementary::guard` takes the larger one of a number and of this, which nothing is below: -2^126. A compiler
/// does not know that, and neither contracts nor reorders what is before.
const LEAST_GUARDED: f32 = -85_070_591_730_234_615_865_843_651_857_942_052_864.0;

impl From<Refusal> for Stop {
    fn from(refusal: Refusal) -> Self {
        Self::Refused(refusal)
    }
}

pub(super) type Done<T> = Result<T, Stop>;

/// Turns of a loop whose body is run here at most.
const MOST_TURNS: usize = 4096;

/// Calls within each other at most: Rust would have said something, shaders cannot recurse.
const DEEPEST: usize = 96;

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
struct Slot {
    name: String,
    value: Value,
    /// How many loops and branches it was declared in.
    depth: usize,
}

/// Translates functions of a tree, one at a time.
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
            Err(Stop::Return(_)) => Err(Refusal::at(
                &self.tree.modules[module].file,
                source.sig.span(),
                "a `return` that only happens sometimes has no form here: give a value at the end",
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
            if name.ends_with(|c: char| c.is_ascii_digit()) {
                let reason = format!(
                    "parameter `{name}` ends in a digit, which naga_oil refuses: rename it"
                );
                return Err(self.refuse(frame, pat.span(), reason));
            }
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
        let value = match self.block(frame, &source.block) {
            Err(Stop::Return(value)) | Ok(value) => value,
            Err(stop) => return Err(stop),
        };
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
            Err(Stop::Return(_)) => return Err(refuse("a constant returns nothing")),
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

    // ---- locals and statements -----------------------------------------------------------------

    fn new_local(&mut self, name: &str, ty: Type, rank: Rank) -> Id {
        let name = name.trim_start_matches("r#").trim_start_matches('_');
        let name = if name.is_empty() { "value" } else { name };
        self.locals.push(Local {
            name: name.into(),
            ty,
            rank,
        });
        self.locals.len() - 1
    }

    fn emit(&mut self, stmt: Stmt) {
        if let Some(block) = self.blocks.last_mut() {
            block.push(stmt);
        }
    }

    fn declare(&mut self, frame: &mut Frame, name: &str, value: Value) {
        self.slots.push(Slot {
            name: name.into(),
            value,
            depth: self.blocks.len(),
        });
        if let Some(scope) = frame.scopes.last_mut() {
            scope.insert(name.into(), self.slots.len() - 1);
        }
    }

    /// The value with each scalar that is an operation, or that may change, kept in a local.
    /// A value whose parts have no variable of their own in the source, each computed once.
    pub(super) fn part(&mut self, value: Value, name: &str) -> Value {
        self.settled(value, name, Rank::Part)
    }

    fn settled(&mut self, mut value: Value, name: &str, rank: Rank) -> Value {
        let own = match &value {
            Value::Scalar(_) => rank,
            _ => rank.min(Rank::Part),
        };
        let mut all = Vec::new();
        value.each_scalar(name, &mut |part, e| all.push((part.to_owned(), e.clone())));
        let mut kept = Vec::with_capacity(all.len());
        for (part, e) in all {
            kept.push(self.kept(&part, e, own));
        }
        let mut kept = kept.into_iter();
        value.each_scalar(name, &mut |_, e| {
            if let Some(other) = kept.next() {
                *e = other;
            }
        });
        value
    }

    /// Whether it is a local that does not change, or a member of one.
    fn stays(&self, e: &Expr) -> bool {
        match &e.kind {
            Kind::Local(id) => !self.changing.contains(id),
            Kind::Member(of, _) => self.stays(of),
            _ => false,
        }
    }

    fn kept(&mut self, name: &str, e: Expr, rank: Rank) -> Expr {
        match &e.kind {
            Kind::Literal(_) => e,
            Kind::Local(id) if !self.changing.contains(id) => {
                let id = *id;
                // A variable's own name says more than the place that its value came from.
                if self.locals[id].rank < rank {
                    self.locals[id].rank = rank;
                    self.locals[id].name = name.trim_start_matches('_').to_owned();
                }
                e
            }
            Kind::Member(of, _) if self.stays(of) => e,
            _ => {
                let ty = e.ty.clone();
                let id = self.new_local(name, ty.clone(), rank);
                self.emit(Stmt::Let(id, e));
                local(id, ty)
            }
        }
    }

    /// Gives a place another value.
    fn assign(&mut self, frame: &Frame, place: &Place, value: Value, span: Span) -> Done<()> {
        let name = self.slots[place.slot].name.clone();
        let name = match place.path.last() {
            Some(Step::Field(f)) if !f.starts_with(|c: char| c.is_ascii_digit()) => f.clone(),
            Some(Step::Index(i)) => format!("{name}{i}"),
            _ => name,
        };
        let depth = self.slots[place.slot].depth;
        let inner = self.blocks.len() > depth;
        let mut olds = Vec::new();
        match self.slots[place.slot].value.part(&place.path) {
            Some(old) => old.each_scalar(&name, &mut |_, e| olds.push(e.clone())),
            None => return Err(self.refuse(frame, span, "this cannot be assigned to")),
        }
        let changing = |e: &Expr| match e.kind {
            Kind::Local(id) if self.changing.contains(&id) => Some(id),
            _ => None,
        };
        let targets: Vec<Option<Id>> = olds.iter().map(changing).collect();
        if targets.iter().any(Option::is_some) {
            let mut news = Vec::new();
            let mut value = value;
            value.each_scalar(&name, &mut |_, e| news.push(e.clone()));
            if news.len() != targets.len() || targets.iter().any(Option::is_none) {
                let reason = "what is assigned in a loop or branch must be numbers before it, too: \
                              give it a value that is not a mere literal's type";
                return Err(self.refuse(frame, span, reason));
            }
            // Several numbers change at once: what reads one of them is computed before.
            if news.len() > 1 {
                for new in &mut news {
                    let e = new.clone();
                    *new = if matches!(e.kind, Kind::Literal(_)) {
                        e
                    } else {
                        let ty = e.ty.clone();
                        let id = self.new_local(&name, ty.clone(), Rank::Part);
                        self.emit(Stmt::Let(id, e));
                        local(id, ty)
                    };
                }
            }
            for (target, new) in targets.into_iter().zip(news) {
                if let Some(id) = target
                    && !matches!(new.kind, Kind::Local(other) if other == id)
                {
                    self.emit(Stmt::Assign(id, new));
                }
            }
            return Ok(());
        }
        if inner {
            let reason = format!(
                "`{name}` is changed inside of a loop or branch in a way that is not seen before it"
            );
            return Err(self.refuse(frame, span, reason));
        }
        let rank = if matches!(value, Value::Scalar(_)) {
            Rank::Variable
        } else {
            Rank::Part
        };
        let value = self.settled(value, &name, rank);
        if let Some(old) = self.slots[place.slot].value.part(&place.path) {
            *old = value;
        }
        Ok(())
    }

    /// Lets the variables that `names` are change from here on: they are assigned in a loop or branch.
    fn let_change(&mut self, frame: &Frame, names: &BTreeSet<String>) {
        let mut slots: Vec<usize> = names.iter().filter_map(|n| frame.find(n)).collect();
        // A variable may be a reference to another one.
        for i in 0..slots.len() {
            if let Value::Ref(place) = &self.slots[slots[i]].value {
                slots.push(place.slot);
            }
        }
        slots.sort_unstable();
        slots.dedup();
        for slot in slots {
            let name = self.slots[slot].name.clone();
            let mut value = self.slots[slot].value.clone();
            if let Value::Fraction(_, single) = value {
                value = Value::Scalar(float(single));
            }
            let mut all = Vec::new();
            value.each_scalar(&name, &mut |part, e| all.push((part.to_owned(), e.clone())));
            let mut fresh = Vec::new();
            for (part, e) in all {
                if matches!(e.kind, Kind::Local(id) if self.changing.contains(&id)) {
                    fresh.push(e);
                    continue;
                }
                let ty = e.ty.clone();
                let id = self.new_local(&part, ty.clone(), Rank::Variable);
                self.emit(Stmt::Var(id, e));
                self.changing.insert(id);
                fresh.push(local(id, ty));
            }
            let mut fresh = fresh.into_iter();
            value.each_scalar(&name, &mut |_, e| {
                if let Some(other) = fresh.next() {
                    *e = other;
                }
            });
            self.slots[slot].value = value;
        }
    }

    // ---- types ---------------------------------------------------------------------------------

    /// Binds generic parameters that are not bound yet: what is bounded by `Real` is `f32`.
    fn generics(
        &self,
        frame: &mut Frame,
        generics: &syn::Generics,
        given: Option<&[Generic]>,
        span: Span,
    ) -> Done<()> {
        let mut given = given.unwrap_or_default().iter();
        for param in &generics.params {
            match param {
                syn::GenericParam::Lifetime(_) => {}
                syn::GenericParam::Type(t) => {
                    let name = t.ident.to_string();
                    if let Some(g) = given.next() {
                        frame.generics.insert(name, g.clone());
                    } else if t.bounds.iter().any(is_number) {
                        frame.generics.insert(name, Generic::Real);
                    } else if frame.depth == 0 {
                        let reason = format!(
                            "`{name}` has no bound `Real`: a library's function is generic over number types only"
                        );
                        return Err(self.refuse(frame, span, reason));
                    }
                }
                syn::GenericParam::Const(c) => {
                    let name = c.ident.to_string();
                    if let Some(g) = given.next() {
                        frame.generics.insert(name, g.clone());
                    } else if frame.depth == 0 {
                        let reason = format!(
                            "`{name}` has no value: write a function for each number that is wanted"
                        );
                        return Err(self.refuse(frame, span, reason));
                    }
                }
            }
        }
        Ok(())
    }

    /// A type of a function's interface.
    fn interface(&mut self, frame: &Frame, ty: &syn::Type) -> Done<Type> {
        match ty {
            syn::Type::Reference(r) if r.mutability.is_none() => self.interface(frame, &r.elem),
            syn::Type::Paren(p) => self.interface(frame, &p.elem),
            syn::Type::Group(g) => self.interface(frame, &g.elem),
            syn::Type::ImplTrait(it) => {
                let signature = it.bounds.iter().find_map(fn_bound);
                let Some((inputs, output)) = signature else {
                    let reason = "of traits only `impl Fn(…) -> …` is a parameter's type";
                    return Err(self.refuse(frame, ty.span(), reason));
                };
                let params = inputs
                    .iter()
                    .map(|t| self.interface(frame, t))
                    .collect::<Done<_>>()?;
                let result = self.interface(frame, &output)?;
                Ok(Type::Lookup(Box::new(Signature { params, result })))
            }
            syn::Type::Path(p) => {
                if let Some(ty) = self.plain(frame, p) {
                    return Ok(ty);
                }
                let Some(identity) = self.identity(frame, &p.path) else {
                    let reason = format!(
                        "`{}` has no form at a library's interface: there are f32, u32, i32, bool, \
                         glam's vectors of these, its matrices Mat2, Mat3 and Mat4, and structures",
                        quote::quote!(#ty)
                    );
                    return Err(self.refuse(frame, ty.span(), reason));
                };
                self.structure(frame, &identity, ty.span())?;
                Ok(Type::Struct(last_name(&identity)))
            }
            _ => {
                let reason = format!(
                    "`{}` has no form at a library's interface",
                    quote::quote!(#ty)
                );
                Err(self.refuse(frame, ty.span(), reason))
            }
        }
    }

    /// A scalar, vector or matrix type.
    fn plain(&self, frame: &Frame, p: &syn::TypePath) -> Option<Type> {
        let last = p.path.segments.last()?;
        let name = last.ident.to_string();
        if p.path.segments.len() == 1 && frame.generics.get(&name) == Some(&Generic::Real) {
            return Some(Type::F32);
        }
        Some(match name.as_str() {
            "f32" => Type::F32,
            "u32" => Type::U32,
            "i32" => Type::I32,
            "bool" => Type::BOOL,
            _ => {
                if let Some(size) = matrix_name(&name) {
                    return Some(Type::Matrix(size));
                }
                let (scalar, size) = vector_name(&name)?;
                Type::Vector(scalar, size)
            }
        })
    }

    /// The structure that a path names.
    fn identity(&self, frame: &Frame, path: &syn::Path) -> Option<Rc<str>> {
        let names = segments(path);
        if names.len() == 1 {
            if names[0] == "Self" {
                return frame.own.clone();
            }
            if let Some(Generic::Struct(identity)) = frame.generics.get(&names[0]) {
                return Some(identity.clone());
            }
        }
        self.tree.structure(frame.module, &names).map(Into::into)
    }

    /// Notes a structure of an interface, after those that it holds.
    fn structure(&mut self, frame: &Frame, identity: &str, span: Span) -> Done<()> {
        let name = last_name(identity);
        if self.structs.iter().any(|s| s.name == name) {
            return Ok(());
        }
        let Some((module, source)) = self.tree.structure_of(identity) else {
            return Err(self.refuse(frame, span, format!("`{name}` is not found")));
        };
        let mut inner = Frame {
            scopes: vec![HashMap::new()],
            generics: HashMap::new(),
            module,
            own: Some(identity.into()),
            depth: 0,
        };
        self.generics(&mut inner, &source.generics, None, source.span())?;
        let mut members = Vec::new();
        for field in &source.fields {
            let Some(ident) = &field.ident else {
                let reason = format!("`{name}` has no names for its members");
                return Err(self.refuse(frame, span, reason));
            };
            let member_name = ident.to_string();
            if member_name.ends_with(|c: char| c.is_ascii_digit()) {
                let reason = format!(
                    "member `{member_name}` of `{name}` ends in a digit, which naga_oil refuses: \
                     rename it, or take a vector"
                );
                return Err(self.refuse(&inner, ident.span(), reason));
            }
            let ty = self.interface(&inner, &field.ty)?;
            members.push((member_name, ty, docs(&field.attrs)));
        }
        self.structs.push(Struct {
            name,
            docs: docs(&source.attrs),
            members,
        });
        Ok(())
    }

    /// An expression of an interface's type as a value of the source.
    fn taken_apart(&self, e: &Expr) -> Value {
        match &e.ty {
            Type::Scalar(_) | Type::Lookup(_) => Value::Scalar(e.clone()),
            Type::Vector(scalar, size) => Value::Vector(
                *scalar,
                ["x", "y", "z", "w"][..*size]
                    .iter()
                    .map(|n| Value::Scalar(member(e, n, Type::Scalar(*scalar))))
                    .collect(),
            ),
            Type::Matrix(size) => {
                let column = |name: &&str| {
                    self.taken_apart(&member(e, name, Type::Vector(Scalar::F32, *size)))
                };
                Value::Matrix(COLUMNS[..*size].iter().map(column).collect())
            }
            Type::Struct(name) => {
                let members = self.structs.iter().find(|s| s.name == *name);
                let fields = members.map_or(Vec::new(), |s| {
                    s.members
                        .iter()
                        .map(|(n, ty, _)| (n.clone(), self.taken_apart(&member(e, n, ty.clone()))))
                        .collect()
                });
                Value::Struct(self.identity_of(name), fields)
            }
        }
    }

    /// The identity of an interface's structure.
    fn identity_of(&self, name: &str) -> Rc<str> {
        let found = self.tree.modules.iter().enumerate().find_map(|(i, m)| {
            let identity = format!("{}::{name}", m.path.join("::"));
            let here = self.tree.structure(i, &[name.to_owned()])?;
            (here == identity).then_some(identity)
        });
        found.unwrap_or_else(|| name.to_owned()).into()
    }

    /// A value of the source as an expression of an interface's type.
    fn put_together(&self, frame: &Frame, value: &Value, ty: &Type, span: Span) -> Done<Expr> {
        let whole = |value: &Value, e: &Expr| -> bool {
            let mut own = Vec::new();
            value
                .clone()
                .each_scalar("", &mut |_, x| own.push(x.clone()));
            let mut theirs = Vec::new();
            self.taken_apart(e)
                .each_scalar("", &mut |_, x| theirs.push(x.clone()));
            own == theirs
        };
        Ok(match (value, ty) {
            (Value::Scalar(e), Type::Scalar(_)) if e.ty == *ty => e.clone(),
            (Value::Fraction(_, single), Type::Scalar(Scalar::F32)) => float(*single),
            (Value::Int(i), Type::Scalar(s)) => match int_literal(*i, *s) {
                Some(l) => literal(l),
                None => return Err(self.refuse(frame, span, format!("{i} is out of range"))),
            },
            (Value::Vector(scalar, all), Type::Vector(s, n)) if scalar == s && all.len() == *n => {
                let parts = all
                    .iter()
                    .map(|v| self.put_together(frame, v, &Type::Scalar(*s), span))
                    .collect::<Done<Vec<_>>>()?;
                fold::vector(*scalar, parts)
            }
            (Value::Matrix(columns), Type::Matrix(n)) if columns.len() == *n => {
                let column = Type::Vector(Scalar::F32, *n);
                let parts = columns
                    .iter()
                    .map(|v| self.put_together(frame, v, &column, span))
                    .collect::<Done<Vec<_>>>()?;
                if let Some(Kind::Member(of, _)) = parts.first().map(|p| &p.kind)
                    && of.ty == *ty
                    && whole(value, of)
                {
                    return Ok(of.clone());
                }
                fold::node(ty.clone(), Kind::Construct(parts))
            }
            (Value::Struct(_, fields), Type::Struct(name)) => {
                let Some(structure) = self.structs.iter().find(|s| s.name == *name) else {
                    return Err(self.refuse(frame, span, format!("`{name}` is not found")));
                };
                let mut parts = Vec::new();
                for (n, ty, _) in &structure.members {
                    let Some((_, v)) = fields.iter().find(|(f, _)| f == n) else {
                        return Err(self.refuse(frame, span, format!("`{n}` has no value")));
                    };
                    parts.push(self.put_together(frame, v, ty, span)?);
                }
                if let Some(Kind::Member(of, _)) = parts.first().map(|p| &p.kind)
                    && of.ty == *ty
                    && whole(value, of)
                {
                    return Ok(of.clone());
                }
                fold::node(ty.clone(), Kind::Construct(parts))
            }
            _ => {
                let reason = format!(
                    "{} is given where the interface has another type",
                    value.what()
                );
                return Err(self.refuse(frame, span, reason));
            }
        })
    }

    /// A value where a type is said: literals without type get it.
    fn typed(
        &self,
        frame: &Frame,
        value: Value,
        ty: Option<&syn::Type>,
        span: Span,
    ) -> Done<Value> {
        let Some(ty) = ty else {
            return Ok(value);
        };
        let inner = |v: Value, t: &syn::Type| self.typed(frame, v, Some(t), span);
        Ok(match (value, ty) {
            (value, syn::Type::Reference(r)) => inner(value, &r.elem)?,
            (value, syn::Type::Paren(p)) => inner(value, &p.elem)?,
            (value, syn::Type::Group(g)) => inner(value, &g.elem)?,
            (Value::Array(all), syn::Type::Array(a)) => Value::Array(
                all.into_iter()
                    .map(|v| inner(v, &a.elem))
                    .collect::<Done<_>>()?,
            ),
            (Value::Tuple(all), syn::Type::Tuple(t)) => Value::Tuple(
                all.into_iter()
                    .zip(&t.elems)
                    .map(|(v, t)| inner(v, t))
                    .collect::<Done<_>>()?,
            ),
            (value @ (Value::Int(_) | Value::Fraction(..)), syn::Type::Path(p)) => {
                let name = p.path.segments.last().map(|s| s.ident.to_string());
                let name = name.unwrap_or_default();
                let scalar = match self.plain(frame, p) {
                    Some(Type::Scalar(s)) => Some(s),
                    _ => None,
                };
                match (value, scalar) {
                    (Value::Int(i), Some(s)) if s != Scalar::F32 => match int_literal(i, s) {
                        Some(l) => Value::Scalar(literal(l)),
                        None => {
                            return Err(self.refuse(frame, span, format!("{i} is out of range")));
                        }
                    },
                    (Value::Fraction(_, single), Some(Scalar::F32)) => Value::Scalar(float(single)),
                    (Value::Fraction(double, _), None) if name == "f64" => Value::Double(double),
                    (value, _) => value,
                }
            }
            (value, _) => value,
        })
    }

    // ---- blocks and patterns -------------------------------------------------------------------

    fn block(&mut self, frame: &mut Frame, block: &syn::Block) -> Done<Value> {
        frame.scopes.push(HashMap::new());
        let done = self.statements(frame, &block.stmts);
        frame.scopes.pop();
        done
    }

    fn statements(&mut self, frame: &mut Frame, stmts: &[syn::Stmt]) -> Done<Value> {
        let mut last = Value::Unit;
        for stmt in stmts {
            let before = self.blocks.last().map_or(0, Vec::len);
            last = self.statement(frame, stmt)?;
            // A comment belongs to what the statement made; without that it is dropped.
            let comment = self.comment(frame, stmt.span());
            if let Some(block) = self.blocks.last_mut()
                && block.len() > before
            {
                for (i, line) in comment.into_iter().enumerate() {
                    block.insert(before + i, Stmt::Comment(line));
                }
            }
        }
        Ok(last)
    }

    /// The comment above a statement.
    fn comment(&self, frame: &Frame, span: Span) -> Vec<String> {
        let lines = &self.tree.modules[frame.module].lines;
        let mut at = span.start().line.saturating_sub(1);
        let mut found = Vec::new();
        while at > 0 {
            let Some(text) = lines.get(at - 1).map(|l| l.trim()) else {
                break;
            };
            match text.strip_prefix("//") {
                Some(rest) if !rest.starts_with(['/', '!']) => found.push(rest.trim().to_owned()),
                _ => break,
            }
            at -= 1;
        }
        found.reverse();
        found
    }

    fn statement(&mut self, frame: &mut Frame, stmt: &syn::Stmt) -> Done<Value> {
        match stmt {
            syn::Stmt::Local(l) => {
                let Some(init) = &l.init else {
                    return Err(self.refuse(
                        frame,
                        l.span(),
                        "a variable gets a value where it is declared",
                    ));
                };
                if let Some((_, other)) = &init.diverge {
                    return Err(self.refuse(frame, other.span(), "`let … else` has no form here"));
                }
                let (pat, ty) = match &l.pat {
                    syn::Pat::Type(t) => (t.pat.as_ref(), Some(t.ty.as_ref())),
                    other => (other, None),
                };
                let value = self.expr(frame, &init.expr)?;
                let value = self.typed(frame, value, ty, l.span())?;
                self.bind(frame, pat, value, Rank::Variable)?;
                Ok(Value::Unit)
            }
            syn::Stmt::Item(syn::Item::Const(c)) => {
                let value = self.expr(frame, &c.expr)?;
                let value = self.typed(frame, value, Some(&c.ty), c.span())?;
                self.declare(frame, &c.ident.to_string(), value);
                Ok(Value::Unit)
            }
            syn::Stmt::Item(item) => Err(self.refuse(
                frame,
                item.span(),
                "an item inside of a function has no form here",
            )),
            syn::Stmt::Expr(e, semicolon) => {
                let value = self.expr(frame, e)?;
                Ok(if semicolon.is_some() {
                    Value::Unit
                } else {
                    value
                })
            }
            syn::Stmt::Macro(m) => {
                let value = self.invocation(frame, &m.mac)?;
                Ok(if m.semi_token.is_some() {
                    Value::Unit
                } else {
                    value
                })
            }
        }
    }

    fn bind(&mut self, frame: &mut Frame, pat: &syn::Pat, value: Value, rank: Rank) -> Done<()> {
        match pat {
            syn::Pat::Ident(p) if p.subpat.is_none() => {
                let name = p.ident.to_string();
                let value = self.settled(value, &name, rank);
                self.declare(frame, &name, value);
                Ok(())
            }
            syn::Pat::Wild(_) => Ok(()),
            syn::Pat::Paren(p) => self.bind(frame, &p.pat, value, rank),
            syn::Pat::Reference(p) => self.bind(frame, &p.pat, value, rank),
            syn::Pat::Type(p) => {
                let value = self.typed(frame, value, Some(&p.ty), p.span())?;
                self.bind(frame, &p.pat, value, rank)
            }
            syn::Pat::Tuple(p) => {
                let Value::Tuple(all) = self.read(value) else {
                    return Err(self.refuse(
                        frame,
                        p.span(),
                        "only a tuple is taken apart like this",
                    ));
                };
                // All are computed before any of them gets its name.
                let mut news = Vec::new();
                for (pat, v) in p.elems.iter().zip(all) {
                    let name = match pat {
                        syn::Pat::Ident(i) => i.ident.to_string(),
                        _ => "part".into(),
                    };
                    news.push(self.settled(v, &name, rank));
                }
                for (pat, v) in p.elems.iter().zip(news) {
                    self.bind(frame, pat, v, rank)?;
                }
                Ok(())
            }
            syn::Pat::Struct(p) => {
                let Value::Struct(_, fields) = self.read(value) else {
                    return Err(self.refuse(
                        frame,
                        p.span(),
                        "only a structure is taken apart like this",
                    ));
                };
                for field in &p.fields {
                    let syn::Member::Named(name) = &field.member else {
                        return Err(self.refuse(
                            frame,
                            field.span(),
                            "a field by number has no form here",
                        ));
                    };
                    let name = name.to_string();
                    let Some((_, v)) = fields.iter().find(|(n, _)| *n == name) else {
                        return Err(self.refuse(
                            frame,
                            field.span(),
                            format!("there is no field `{name}`"),
                        ));
                    };
                    self.bind(frame, &field.pat, v.clone(), rank)?;
                }
                Ok(())
            }
            syn::Pat::Slice(p) => {
                let Value::Array(all) = self.read(value) else {
                    return Err(self.refuse(
                        frame,
                        p.span(),
                        "only an array is taken apart like this",
                    ));
                };
                let mut all = all.into_iter();
                for pat in &p.elems {
                    if matches!(pat, syn::Pat::Rest(_)) {
                        break;
                    }
                    let Some(v) = all.next() else {
                        return Err(self.refuse(frame, pat.span(), "the array is not that long"));
                    };
                    self.bind(frame, pat, v, rank)?;
                }
                Ok(())
            }
            other => Err(self.refuse(frame, other.span(), "this pattern has no form here")),
        }
    }

    // ---- expressions ---------------------------------------------------------------------------

    /// What a reference refers to; anything else as it is.
    pub(super) fn read(&mut self, value: Value) -> Value {
        match value {
            Value::Ref(place) => {
                let found = self.slots[place.slot].value.part(&place.path).cloned();
                match found {
                    Some(inner) => self.read(inner),
                    None => Value::Unit,
                }
            }
            other => other,
        }
    }

    fn value(&mut self, frame: &mut Frame, e: &syn::Expr) -> Done<Value> {
        let value = self.expr(frame, e)?;
        Ok(self.read(value))
    }

    fn expr(&mut self, frame: &mut Frame, e: &syn::Expr) -> Done<Value> {
        match e {
            syn::Expr::Paren(p) => self.expr(frame, &p.expr),
            syn::Expr::Group(g) => self.expr(frame, &g.expr),
            syn::Expr::Block(b) => self.block(frame, &b.block),
            syn::Expr::Const(c) => self.block(frame, &c.block),
            syn::Expr::Lit(l) => self.literal(frame, &l.lit),
            syn::Expr::Path(p) => self.path(frame, p),
            syn::Expr::Unary(u) => self.unary(frame, u),
            syn::Expr::Binary(b) => self.binary(frame, b),
            syn::Expr::Assign(a) => self.assignment(frame, a),
            syn::Expr::Field(f) => {
                let base = self.value(frame, &f.base)?;
                self.field(frame, base, &f.member, f.span())
            }
            syn::Expr::Index(i) => {
                let base = self.value(frame, &i.expr)?;
                let index = self.value(frame, &i.index)?;
                match (base, index.as_int()) {
                    (Value::Array(all), Some(at)) => {
                        let found = usize::try_from(at).ok().and_then(|at| all.get(at).cloned());
                        found.ok_or_else(|| {
                            let reason = format!("element {at} of an array of {}", all.len());
                            self.refuse(frame, i.span(), reason)
                        })
                    }
                    (Value::Array(_), None) => {
                        let reason = "an array is indexed by what is known when the text is written: \
                                      use `unroll!`";
                        Err(self.refuse(frame, i.span(), reason))
                    }
                    (other, _) => {
                        let reason = format!("{} is not indexed", other.what());
                        Err(self.refuse(frame, i.span(), reason))
                    }
                }
            }
            syn::Expr::Tuple(t) => {
                if t.elems.is_empty() {
                    return Ok(Value::Unit);
                }
                let all = t.elems.iter().map(|e| self.value(frame, e));
                Ok(Value::Tuple(all.collect::<Done<_>>()?))
            }
            syn::Expr::Array(a) => {
                let all = a.elems.iter().map(|e| self.value(frame, e));
                Ok(Value::Array(all.collect::<Done<_>>()?))
            }
            syn::Expr::Repeat(r) => {
                let value = self.value(frame, &r.expr)?;
                let value = self.part(value, "element");
                let length = self.value(frame, &r.len)?;
                let Some(length) = length.as_int().and_then(|n| usize::try_from(n).ok()) else {
                    return Err(self.refuse(frame, r.len.span(), "the length is not known"));
                };
                Ok(Value::Array(vec![value; length]))
            }
            syn::Expr::Struct(s) => self.construct(frame, s),
            syn::Expr::Closure(c) => Ok(Value::Closure(Rc::new(Closure {
                source: c.clone(),
                names: frame
                    .scopes
                    .iter()
                    .flatten()
                    .map(|(n, s)| (n.clone(), *s))
                    .collect(),
                generics: frame.generics.clone(),
                module: frame.module,
                own: frame.own.clone(),
            }))),
            syn::Expr::Reference(r) => {
                if r.mutability.is_some() {
                    let place = self.place(frame, &r.expr)?;
                    return Ok(Value::Ref(place));
                }
                self.expr(frame, &r.expr)
            }
            syn::Expr::Call(c) => self.call(frame, c),
            syn::Expr::MethodCall(m) => self.method(frame, m),
            syn::Expr::Cast(c) => {
                let value = self.value(frame, &c.expr)?;
                self.cast(frame, value, &c.ty, c.span())
            }
            syn::Expr::If(i) => self.branch(frame, i),
            syn::Expr::Match(m) => self.matched(frame, m),
            syn::Expr::While(w) => self.repeated(frame, w),
            syn::Expr::Macro(m) => self.invocation(frame, &m.mac),
            syn::Expr::Return(r) => {
                let value = match &r.expr {
                    Some(e) => self.value(frame, e)?,
                    None => Value::Unit,
                };
                Err(Stop::Return(value))
            }
            syn::Expr::Unsafe(u) => Err(self.refuse(frame, u.span(), "`unsafe` has no form here")),
            syn::Expr::ForLoop(f) => Err(self.refuse(
                frame,
                f.span(),
                "`for` has no form here: count with `while`, or use `unroll!`",
            )),
            other => Err(self.refuse(frame, other.span(), "this expression has no form here")),
        }
    }

    fn literal(&mut self, frame: &Frame, lit: &syn::Lit) -> Done<Value> {
        Ok(match lit {
            syn::Lit::Bool(b) => Value::bool(b.value),
            syn::Lit::Int(i) => {
                let value: i128 = i
                    .base10_parse()
                    .map_err(|e| self.refuse(frame, i.span(), e.to_string()))?;
                match i.suffix() {
                    "u32" => Value::Scalar(literal(Literal::U32(value as u32))),
                    "i32" => Value::Scalar(literal(Literal::I32(value as i32))),
                    "f32" => Value::Scalar(float(value as f32)),
                    "f64" => Value::Double(value as f64),
                    _ => Value::Int(value),
                }
            }
            syn::Lit::Float(f) => {
                let wrong = |e: std::num::ParseFloatError| e.to_string();
                let digits = f.base10_digits();
                let double: f64 = digits
                    .parse()
                    .map_err(wrong)
                    .map_err(|e| self.refuse(frame, f.span(), e))?;
                let single: f32 = digits
                    .parse()
                    .map_err(wrong)
                    .map_err(|e| self.refuse(frame, f.span(), e))?;
                match f.suffix() {
                    "f32" => Value::Scalar(float(single)),
                    "f64" => Value::Double(double),
                    _ => Value::Fraction(double, single),
                }
            }
            syn::Lit::Str(_) => Value::Text,
            other => return Err(self.refuse(frame, other.span(), "this literal has no form here")),
        })
    }

    fn path(&mut self, frame: &mut Frame, p: &syn::ExprPath) -> Done<Value> {
        let names = segments(&p.path);
        if let [name] = names.as_slice() {
            if let Some(slot) = frame.find(name) {
                return Ok(self.slots[slot].value.clone());
            }
            match frame.generics.get(name) {
                Some(Generic::Const(value)) => return Ok(Value::Int(*value)),
                Some(Generic::Bool(value)) => return Ok(Value::bool(*value)),
                Some(_) => return Ok(Value::Path(frame.module, Rc::new(p.clone()))),
                None => {}
            }
        }
        if let [first, second] = names.as_slice() {
            if frame.generics.get(first) == Some(&Generic::Real) || first == "f32" {
                match second.as_str() {
                    "IS_WIDE" => return Ok(Value::bool(false)),
                    "EPSILON" => return Ok(Value::Scalar(float(f32::EPSILON))),
                    _ => {}
                }
            }
            if first == "f64" && second == "EPSILON" {
                return Ok(Value::Double(f64::EPSILON));
            }
            if first == "u32" && second == "MAX" {
                return Ok(Value::Scalar(literal(Literal::U32(u32::MAX))));
            }
            if let Some((scalar, size)) = vector_name(first) {
                let each = |v: f32| match scalar {
                    Scalar::F32 => Value::Scalar(float(v)),
                    Scalar::U32 => Value::Scalar(literal(Literal::U32(v as u32))),
                    Scalar::I32 => Value::Scalar(literal(Literal::I32(v as i32))),
                    Scalar::Bool => Value::bool(v != 0.0),
                };
                match second.as_str() {
                    "ZERO" => return Ok(Value::Vector(scalar, vec![each(0.0); size])),
                    "ONE" => return Ok(Value::Vector(scalar, vec![each(1.0); size])),
                    _ => return Ok(Value::Path(frame.module, Rc::new(p.clone()))),
                }
            }
            if let Some(size) = matrix_name(first) {
                return Ok(matrix_constant(size, second)
                    .unwrap_or_else(|| Value::Path(frame.module, Rc::new(p.clone()))));
            }
            let head = syn::Path::from(p.path.segments[0].clone());
            if let Some(identity) = self.identity(frame, &head) {
                let key = (identity.to_string(), second.clone());
                if let Some((module, source)) = self.tree.constants.get(&key) {
                    let mut inner = self.frame_for(frame, *module, Some(identity));
                    let value = self.expr(&mut inner, &source.expr)?;
                    return self.typed(&inner, value, Some(&source.ty), source.span());
                }
                return Ok(Value::Path(frame.module, Rc::new(p.clone())));
            }
        }
        match self.tree.resolve(frame.module, &names) {
            Some((home, Item::Const(source))) => {
                let mut inner = self.frame_for(frame, home, None);
                let value = self.expr(&mut inner, &source.expr)?;
                self.typed(&inner, value, Some(&source.ty), source.span())
            }
            Some((_, Item::Function(_) | Item::Struct(_))) => {
                Ok(Value::Path(frame.module, Rc::new(p.clone())))
            }
            _ => match names.join("::").as_str() {
                "core::f64::consts::PI" => Ok(Value::Double(std::f64::consts::PI)),
                "core::f64::consts::LOG2_E" => Ok(Value::Double(std::f64::consts::LOG2_E)),
                "core::f32::consts::PI" => Ok(Value::Scalar(float(std::f32::consts::PI))),
                // A variant of an enumeration, or a function that the call knows.
                _ if names.len() > 1 => Ok(Value::Variant(names.join("::"))),
                name => Err(self.refuse(frame, p.span(), format!("`{name}` is not found"))),
            },
        }
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

    fn field(&mut self, frame: &Frame, base: Value, name: &syn::Member, span: Span) -> Done<Value> {
        let key = match name {
            syn::Member::Named(n) => n.to_string(),
            syn::Member::Unnamed(i) => i.index.to_string(),
        };
        let mut base = base;
        let what = base.what();
        match base.part(&[Step::Field(key.clone())]) {
            Some(v) => {
                let v = v.clone();
                Ok(self.read(v))
            }
            None => Err(self.refuse(frame, span, format!("{what} has no field `{key}`"))),
        }
    }

    fn place(&mut self, frame: &mut Frame, e: &syn::Expr) -> Done<Place> {
        match e {
            syn::Expr::Paren(p) => self.place(frame, &p.expr),
            syn::Expr::Group(g) => self.place(frame, &g.expr),
            syn::Expr::Unary(u) if matches!(u.op, syn::UnOp::Deref(_)) => {
                self.place(frame, &u.expr)
            }
            syn::Expr::Path(p) => {
                let names = segments(&p.path);
                let slot = match names.as_slice() {
                    [name] => frame.find(name),
                    _ => None,
                };
                let Some(slot) = slot else {
                    return Err(self.refuse(frame, p.span(), "only a variable can be changed"));
                };
                match &self.slots[slot].value {
                    Value::Ref(place) => Ok(place.clone()),
                    _ => Ok(Place {
                        slot,
                        path: Vec::new(),
                    }),
                }
            }
            syn::Expr::Field(f) => {
                let mut place = self.place(frame, &f.base)?;
                place.path.push(Step::Field(match &f.member {
                    syn::Member::Named(n) => n.to_string(),
                    syn::Member::Unnamed(i) => i.index.to_string(),
                }));
                Ok(place)
            }
            syn::Expr::Index(i) => {
                let mut place = self.place(frame, &i.expr)?;
                let index = self.value(frame, &i.index)?;
                let Some(at) = index.as_int().and_then(|at| usize::try_from(at).ok()) else {
                    let reason = "an array is indexed by what is known when the text is written";
                    return Err(self.refuse(frame, i.span(), reason));
                };
                place.path.push(Step::Index(at));
                Ok(place)
            }
            syn::Expr::Call(c) => match element(c) {
                Some((element, true)) => self.place(frame, &element),
                _ => Err(self.refuse(frame, c.span(), "this cannot be changed")),
            },
            other => Err(self.refuse(frame, other.span(), "this cannot be changed")),
        }
    }

    fn assignment(&mut self, frame: &mut Frame, a: &syn::ExprAssign) -> Done<Value> {
        let value = self.value(frame, &a.right)?;
        if let syn::Expr::Tuple(t) = a.left.as_ref() {
            let Value::Tuple(all) = value else {
                return Err(self.refuse(frame, a.span(), "a tuple is assigned to a tuple"));
            };
            let mut news = Vec::new();
            for v in all {
                news.push(self.part(v, "next"));
            }
            for (e, v) in t.elems.iter().zip(news) {
                let place = self.place(frame, e)?;
                self.assign(frame, &place, v, a.span())?;
            }
            return Ok(Value::Unit);
        }
        let place = self.place(frame, &a.left)?;
        let value = self.like(&place, value);
        self.assign(frame, &place, value, a.span())?;
        Ok(Value::Unit)
    }

    /// A literal without type gets that of what it replaces.
    fn like(&mut self, place: &Place, value: Value) -> Value {
        let old = self.slots[place.slot].value.part(&place.path).cloned();
        match (old, &value) {
            (Some(Value::Scalar(e)), Value::Fraction(_, single)) if e.ty == Type::F32 => {
                Value::Scalar(float(*single))
            }
            (Some(Value::Double(_)), Value::Fraction(double, _)) => Value::Double(*double),
            (Some(Value::Scalar(e)), Value::Int(i)) => {
                e.ty.scalar()
                    .and_then(|s| int_literal(*i, s))
                    .map_or(value, |l| Value::Scalar(literal(l)))
            }
            _ => value,
        }
    }

    fn unary(&mut self, frame: &mut Frame, u: &syn::ExprUnary) -> Done<Value> {
        let value = self.value(frame, &u.expr)?;
        Ok(match (u.op, value) {
            (syn::UnOp::Deref(_), value) => value,
            (syn::UnOp::Neg(_), Value::Int(i)) => Value::Int(-i),
            (syn::UnOp::Neg(_), Value::Double(d)) => Value::Double(-d),
            (syn::UnOp::Neg(_), Value::Fraction(d, s)) => Value::Fraction(-d, -s),
            (syn::UnOp::Neg(_), Value::Scalar(e)) => Value::Scalar(unary(Unary::Negate, &e)),
            (syn::UnOp::Neg(_), Value::Vector(s, all)) => Value::Vector(
                s,
                all.into_iter()
                    .map(|v| match v {
                        Value::Scalar(e) => Value::Scalar(unary(Unary::Negate, &e)),
                        other => other,
                    })
                    .collect(),
            ),
            (syn::UnOp::Not(_), Value::Scalar(e)) if e.ty == Type::BOOL => {
                Value::Scalar(unary(Unary::Not, &e))
            }
            (syn::UnOp::Not(_), Value::Scalar(e)) if e.ty != Type::F32 => {
                Value::Scalar(unary(Unary::Invert, &e))
            }
            (_, value) => {
                let reason = format!("this operator of {} has no form here", value.what());
                return Err(self.refuse(frame, u.span(), reason));
            }
        })
    }

    fn binary(&mut self, frame: &mut Frame, b: &syn::ExprBinary) -> Done<Value> {
        use syn::BinOp as B;
        let (op, assigns) = match b.op {
            B::Add(_) => (Binary::Add, false),
            B::Sub(_) => (Binary::Subtract, false),
            B::Mul(_) => (Binary::Multiply, false),
            B::Div(_) => (Binary::Divide, false),
            B::AddAssign(_) => (Binary::Add, true),
            B::SubAssign(_) => (Binary::Subtract, true),
            B::MulAssign(_) => (Binary::Multiply, true),
            B::DivAssign(_) => (Binary::Divide, true),
            B::And(_) => (Binary::And, false),
            B::Or(_) => (Binary::Or, false),
            B::BitAnd(_) => (Binary::BitAnd, false),
            B::BitOr(_) => (Binary::BitOr, false),
            B::BitXor(_) => (Binary::BitXor, false),
            B::BitAndAssign(_) => (Binary::BitAnd, true),
            B::BitOrAssign(_) => (Binary::BitOr, true),
            B::BitXorAssign(_) => (Binary::BitXor, true),
            B::Shl(_) => (Binary::ShiftLeft, false),
            B::Shr(_) => (Binary::ShiftRight, false),
            B::ShlAssign(_) => (Binary::ShiftLeft, true),
            B::ShrAssign(_) => (Binary::ShiftRight, true),
            B::Lt(_) => (Binary::Less, false),
            B::Le(_) => (Binary::LessEqual, false),
            B::Gt(_) => (Binary::Greater, false),
            B::Ge(_) => (Binary::GreaterEqual, false),
            B::Eq(_) => (Binary::Equal, false),
            B::Ne(_) => (Binary::NotEqual, false),
            _ if matches!(b.op, B::Rem(_) | B::RemAssign(_)) => {
                let left = self.value(frame, &b.left)?;
                let right = self.value(frame, &b.right)?;
                return match (left, right) {
                    (Value::Int(x), Value::Int(y)) if y != 0 => Ok(Value::Int(x % y)),
                    _ => {
                        let reason = "`%` differs between languages: use `floor`";
                        Err(self.refuse(frame, b.span(), reason))
                    }
                };
            }
            _ => return Err(self.refuse(frame, b.span(), "this operator has no form here")),
        };
        let left = self.value(frame, &b.left)?;
        // `false && …` and the like settle what is known.
        if let (Binary::And | Binary::Or, Some(known)) = (op, left.as_bool())
            && known != (op == Binary::And)
        {
            return Ok(left);
        }
        let right = self.value(frame, &b.right)?;
        let value = self.operation(frame, op, left, right, b.span())?;
        if !assigns {
            return Ok(value);
        }
        let place = self.place(frame, &b.left)?;
        self.assign(frame, &place, value, b.span())?;
        Ok(Value::Unit)
    }

    pub(super) fn operation(
        &mut self,
        frame: &Frame,
        op: Binary,
        left: Value,
        right: Value,
        span: Span,
    ) -> Done<Value> {
        let op = match (op, &left) {
            (Binary::BitAnd, Value::Scalar(e)) if e.ty == Type::BOOL => Binary::And,
            (Binary::BitOr, Value::Scalar(e)) if e.ty == Type::BOOL => Binary::Or,
            (Binary::BitXor, Value::Scalar(e)) if e.ty == Type::BOOL => Binary::NotEqual,
            _ => op,
        };
        let shift = matches!(op, Binary::ShiftLeft | Binary::ShiftRight);
        Ok(match (left, right) {
            (Value::Int(a), Value::Int(b)) => {
                let overflow = || self.refuse(frame, span, "this overflows");
                match op {
                    Binary::Add => Value::Int(a.checked_add(b).ok_or_else(overflow)?),
                    Binary::Subtract => Value::Int(a.checked_sub(b).ok_or_else(overflow)?),
                    Binary::Multiply => Value::Int(a.checked_mul(b).ok_or_else(overflow)?),
                    Binary::Divide => Value::Int(a.checked_div(b).ok_or_else(overflow)?),
                    Binary::BitAnd => Value::Int(a & b),
                    Binary::BitOr => Value::Int(a | b),
                    Binary::BitXor => Value::Int(a ^ b),
                    Binary::ShiftLeft => {
                        let by = u32::try_from(b).map_err(|_| overflow())?;
                        Value::Int(a.checked_shl(by).ok_or_else(overflow)?)
                    }
                    Binary::ShiftRight => {
                        let by = u32::try_from(b).map_err(|_| overflow())?;
                        Value::Int(a.checked_shr(by).ok_or_else(overflow)?)
                    }
                    Binary::Less => Value::bool(a < b),
                    Binary::LessEqual => Value::bool(a <= b),
                    Binary::Greater => Value::bool(a > b),
                    Binary::GreaterEqual => Value::bool(a >= b),
                    Binary::Equal => Value::bool(a == b),
                    Binary::NotEqual => Value::bool(a != b),
                    Binary::And | Binary::Or => {
                        return Err(self.refuse(frame, span, "a number is not a truth value"));
                    }
                }
            }
            (
                a @ (Value::Double(_) | Value::Fraction(..)),
                b @ (Value::Double(_) | Value::Fraction(..)),
            ) => self.fractions(frame, op, &a, &b, span)?,
            (Value::Scalar(a), Value::Scalar(b)) => {
                if a.ty != b.ty && !shift {
                    return Err(self.refuse(frame, span, "operands of two types"));
                }
                let b = if shift {
                    builtin(Builtin::ToU32, vec![b])
                } else {
                    b
                };
                if op == Binary::Divide && a.ty != Type::F32 {
                    let reason = "a quotient of integers has no form here";
                    if fold::known(&a).is_none() || fold::known(&b).is_none() {
                        return Err(self.refuse(frame, span, reason));
                    }
                }
                Value::Scalar(binary(op, &a, &b))
            }
            (Value::Scalar(a), b @ (Value::Int(_) | Value::Fraction(..))) => {
                let to = if shift { Type::U32 } else { a.ty.clone() };
                let b = self.put_together(frame, &b, &to, span)?;
                return self.operation(frame, op, Value::Scalar(a), Value::Scalar(b), span);
            }
            (a @ (Value::Int(_) | Value::Fraction(..)), Value::Scalar(b)) if !shift => {
                let a = self.put_together(frame, &a, &b.ty, span)?;
                Value::Scalar(binary(op, &a, &b))
            }
            (a @ Value::Matrix(_), b) | (a, b @ Value::Matrix(_)) => {
                return self.matrix_operation(frame, op, a, b, span);
            }
            (Value::Vector(s, a), Value::Vector(_, b)) => {
                let all = a
                    .into_iter()
                    .zip(b)
                    .map(|(a, b)| self.operation(frame, op, a, b, span));
                Value::Vector(s, all.collect::<Done<_>>()?)
            }
            (Value::Vector(s, a), b @ (Value::Scalar(_) | Value::Fraction(..) | Value::Int(_))) => {
                let b = self.part(b, "factor");
                let all = a
                    .into_iter()
                    .map(|a| self.operation(frame, op, a, b.clone(), span));
                Value::Vector(s, all.collect::<Done<_>>()?)
            }
            (a @ (Value::Scalar(_) | Value::Fraction(..) | Value::Int(_)), Value::Vector(s, b)) => {
                let a = self.part(a, "factor");
                let all = b
                    .into_iter()
                    .map(|b| self.operation(frame, op, a.clone(), b, span));
                Value::Vector(s, all.collect::<Done<_>>()?)
            }
            (a, b) => {
                let reason = format!(
                    "an operator of {} and {} has no form here",
                    a.what(),
                    b.what()
                );
                return Err(self.refuse(frame, span, reason));
            }
        })
    }

    fn fractions(
        &self,
        frame: &Frame,
        op: Binary,
        a: &Value,
        b: &Value,
        span: Span,
    ) -> Done<Value> {
        let (x, y) = (a.as_double().unwrap_or(0.0), b.as_double().unwrap_or(0.0));
        let double = match op {
            Binary::Add => x + y,
            Binary::Subtract => x - y,
            Binary::Multiply => x * y,
            Binary::Divide => x / y,
            Binary::Less => return Ok(Value::bool(x < y)),
            Binary::LessEqual => return Ok(Value::bool(x <= y)),
            Binary::Greater => return Ok(Value::bool(x > y)),
            Binary::GreaterEqual => return Ok(Value::bool(x >= y)),
            Binary::Equal => return Ok(Value::bool(x == y)),
            Binary::NotEqual => return Ok(Value::bool(x != y)),
            _ => return Err(self.refuse(frame, span, "fractions have no such operator")),
        };
        // Without a type said, both kinds of number are carried on, each rounded as its own.
        if let (Value::Fraction(_, p), Value::Fraction(_, q)) = (a, b) {
            let single = match op {
                Binary::Add => p + q,
                Binary::Subtract => p - q,
                Binary::Multiply => p * q,
                _ => p / q,
            };
            return Ok(Value::Fraction(double, single));
        }
        Ok(Value::Double(double))
    }

    fn construct(&mut self, frame: &mut Frame, s: &syn::ExprStruct) -> Done<Value> {
        let Some(identity) = self.identity(frame, &s.path) else {
            return Err(self.refuse(frame, s.path.span(), "this structure is not found"));
        };
        let Some((home, source)) = self.tree.structure_of(&identity) else {
            return Err(self.refuse(frame, s.path.span(), "this structure is not found"));
        };
        let mut inner = self.frame_for(frame, home, Some(identity.clone()));
        self.generics(&mut inner, &source.generics, None, s.span())?;
        let mut given = Vec::new();
        for field in &s.fields {
            let syn::Member::Named(name) = &field.member else {
                return Err(self.refuse(frame, field.span(), "a field by number has no form here"));
            };
            let value = self.value(frame, &field.expr)?;
            given.push((name.to_string(), value));
        }
        let rest = match &s.rest {
            Some(e) => match self.value(frame, e)? {
                Value::Struct(_, fields) => fields,
                other => {
                    let reason = format!("{} is not a structure", other.what());
                    return Err(self.refuse(frame, e.span(), reason));
                }
            },
            None => Vec::new(),
        };
        let mut fields = Vec::new();
        for field in &source.fields {
            let name = field
                .ident
                .as_ref()
                .map(ToString::to_string)
                .unwrap_or_default();
            let found = given.iter().chain(&rest).find(|(n, _)| *n == name);
            let Some((_, value)) = found else {
                return Err(self.refuse(frame, s.span(), format!("`{name}` has no value")));
            };
            let value = self.typed(&inner, value.clone(), Some(&field.ty), s.span())?;
            fields.push((name, value));
        }
        Ok(Value::Struct(identity, fields))
    }

    fn cast(&mut self, frame: &Frame, value: Value, ty: &syn::Type, span: Span) -> Done<Value> {
        let name = quote::quote!(#ty).to_string();
        let real = frame.generics.get(&name) == Some(&Generic::Real)
            || name == "Self" && frame.own.as_deref() == Some("f32");
        let to = if real { "f32" } else { name.as_str() };
        let known_int = value.as_int();
        Ok(match (to, value) {
            ("f32", Value::Int(i)) => Value::Scalar(float(i as f32)),
            ("f32", Value::Double(d)) => Value::Scalar(float(d as f32)),
            ("f32", Value::Fraction(_, single)) => Value::Scalar(float(single)),
            ("f32", Value::Scalar(e)) => Value::Scalar(builtin(Builtin::ToF32, vec![e])),
            ("f64", Value::Int(i)) => Value::Double(i as f64),
            ("f64", Value::Fraction(d, _) | Value::Double(d)) => Value::Double(d),
            ("f64", v @ Value::Scalar(_)) if v.as_double().is_some() => {
                Value::Double(v.as_double().unwrap_or(0.0))
            }
            ("u32", Value::Int(i)) => Value::Scalar(literal(Literal::U32(i as u32))),
            ("i32", Value::Int(i)) => Value::Scalar(literal(Literal::I32(i as i32))),
            ("u32", Value::Scalar(e)) if e.ty == Type::I32 || e.ty == Type::U32 => {
                Value::Scalar(builtin(Builtin::ToU32, vec![e]))
            }
            ("i32", Value::Scalar(e)) if e.ty == Type::I32 || e.ty == Type::U32 => {
                Value::Scalar(builtin(Builtin::ToI32, vec![e]))
            }
            ("u32" | "i32", Value::Scalar(e)) if e.ty == Type::F32 => {
                let reason = "`as` from a float differs between languages out of range: clamp, and \
                              use `to_i32`";
                return Err(self.refuse(frame, span, reason));
            }
            ("usize" | "u64" | "i64" | "u128" | "i128" | "isize", _) if known_int.is_some() => {
                Value::Int(known_int.unwrap_or(0))
            }
            (_, value) => {
                let reason = format!("{} as `{to}` has no form here", value.what());
                return Err(self.refuse(frame, span, reason));
            }
        })
    }

    // ---- control -------------------------------------------------------------------------------

    fn branch(&mut self, frame: &mut Frame, i: &syn::ExprIf) -> Done<Value> {
        if matches!(i.cond.as_ref(), syn::Expr::Let(_)) {
            return Err(self.refuse(frame, i.cond.span(), "`if let` has no form here"));
        }
        let condition = self.value(frame, &i.cond)?;
        if let Some(holds) = condition.as_bool() {
            return if holds {
                self.block(frame, &i.then_branch)
            } else if let Some((_, other)) = &i.else_branch {
                self.expr(frame, other)
            } else {
                Ok(Value::Unit)
            };
        }
        let Value::Scalar(condition) = condition else {
            return Err(self.refuse(frame, i.cond.span(), "this is not a condition"));
        };
        let mut names = BTreeSet::new();
        assigned(quote::quote!(#i), &mut names);
        let condition = self.kept("condition", condition, Rank::Part);
        self.let_change(frame, &names);

        self.blocks.push(Vec::new());
        let then = self.block(frame, &i.then_branch);
        let then_block = self.blocks.pop().unwrap_or_default();
        let then = self.no_return(frame, then, i.span())?;
        self.blocks.push(Vec::new());
        let other = match &i.else_branch {
            Some((_, e)) => self.expr(frame, e),
            None => Ok(Value::Unit),
        };
        let other_block = self.blocks.pop().unwrap_or_default();
        let other = self.no_return(frame, other, i.span())?;

        let (mut then, other) = self.alike(frame, then, other, i.span())?;
        let mut a = Vec::new();
        then.each_scalar("chosen", &mut |name, e| {
            a.push((name.to_owned(), e.clone()))
        });
        let mut b = Vec::new();
        other
            .clone()
            .each_scalar("chosen", &mut |_, e| b.push(e.clone()));
        if a.len() != b.len() {
            return Err(self.refuse(
                frame,
                i.span(),
                "both sides of a branch give values of one shape",
            ));
        }
        let mut chosen = Vec::new();
        if then_block.is_empty() && other_block.is_empty() {
            for ((_, x), y) in a.iter().zip(&b) {
                let args = vec![condition.clone(), x.clone(), y.clone()];
                chosen.push(builtin(Builtin::Select, args));
            }
        } else {
            let mut then_block = then_block;
            let mut other_block = other_block;
            for ((name, x), y) in a.iter().zip(&b) {
                if x == y && matches!(x.kind, Kind::Literal(_)) {
                    chosen.push(x.clone());
                    continue;
                }
                let id = self.new_local(name, x.ty.clone(), Rank::Part);
                self.changing.insert(id);
                then_block.push(Stmt::Assign(id, x.clone()));
                // A literal is the initial value, and the other side has nothing to assign.
                let first = if matches!(y.kind, Kind::Literal(_)) {
                    y.clone()
                } else {
                    other_block.push(Stmt::Assign(id, y.clone()));
                    match x.ty {
                        Type::Scalar(Scalar::F32) => float(0.0),
                        Type::Scalar(Scalar::U32) => literal(Literal::U32(0)),
                        Type::Scalar(Scalar::I32) => literal(Literal::I32(0)),
                        _ => literal(Literal::Bool(false)),
                    }
                };
                self.emit(Stmt::Var(id, first));
                chosen.push(local(id, x.ty.clone()));
            }
            self.emit(Stmt::If(condition, then_block, other_block));
        }
        let mut chosen = chosen.into_iter();
        then.each_scalar("chosen", &mut |_, e| {
            if let Some(other) = chosen.next() {
                *e = other;
            }
        });
        Ok(then)
    }

    /// Both sides of a branch, with literals typed as the other side has them.
    fn alike(&self, frame: &Frame, a: Value, b: Value, span: Span) -> Done<(Value, Value)> {
        let single = |v: Value| match v {
            Value::Fraction(_, s) => Value::Scalar(float(s)),
            other => other,
        };
        Ok(match (single(a), single(b)) {
            (Value::Int(x), Value::Int(y)) if x == y => (Value::Int(x), Value::Int(y)),
            (Value::Int(x), Value::Scalar(e)) => {
                let x = self.put_together(frame, &Value::Int(x), &e.ty, span)?;
                (Value::Scalar(x), Value::Scalar(e))
            }
            (Value::Scalar(e), Value::Int(y)) => {
                let y = self.put_together(frame, &Value::Int(y), &e.ty, span)?;
                (Value::Scalar(e), Value::Scalar(y))
            }
            (Value::Int(_), Value::Int(_)) => {
                let reason = "say the type of one of these numbers: `0_u32`, `0_i32`";
                return Err(self.refuse(frame, span, reason));
            }
            other => other,
        })
    }

    fn no_return(&self, frame: &Frame, done: Done<Value>, span: Span) -> Done<Value> {
        match done {
            Err(Stop::Return(_)) => {
                let reason = "a `return` that only happens sometimes has no form here: give a value \
                              from both branches";
                Err(self.refuse(frame, span, reason))
            }
            other => other,
        }
    }

    fn matched(&mut self, frame: &mut Frame, m: &syn::ExprMatch) -> Done<Value> {
        let value = self.value(frame, &m.expr)?;
        let known = match &value {
            Value::Variant(name) => Err(name.clone()),
            other => match other.as_int() {
                Some(i) => Ok(i),
                None => {
                    let reason = "`match` is for what is known when the text is written";
                    return Err(self.refuse(frame, m.expr.span(), reason));
                }
            },
        };
        for arm in &m.arms {
            if arm.guard.is_some() {
                return Err(self.refuse(frame, arm.span(), "a guard has no form here"));
            }
            let fits = match (&arm.pat, &known) {
                (syn::Pat::Wild(_), _) => true,
                (syn::Pat::Lit(l), Ok(i)) => {
                    let v = self.literal(frame, &l.lit)?;
                    v.as_int() == Some(*i)
                }
                (syn::Pat::Path(p), Err(name)) => {
                    let own = segments(&p.path).join("::");
                    own == *name || own.rsplit("::").next() == name.rsplit("::").next()
                }
                (syn::Pat::Path(p), Ok(i)) => self.path(frame, p)?.as_int() == Some(*i),
                _ => {
                    return Err(self.refuse(
                        frame,
                        arm.pat.span(),
                        "this pattern has no form here",
                    ));
                }
            };
            if fits {
                return self.expr(frame, &arm.body);
            }
        }
        Err(self.refuse(frame, m.span(), "no arm fits"))
    }

    fn repeated(&mut self, frame: &mut Frame, w: &syn::ExprWhile) -> Done<Value> {
        let mut names = BTreeSet::new();
        let body = &w.body;
        assigned(quote::quote!(#body), &mut names);
        let condition = self.value(frame, &w.cond)?;
        let counter = counter(w);
        // A loop over what is known is run here; one over what is not stays a loop.
        let others_known = names
            .iter()
            .filter(|n| Some(n.as_str()) != counter.as_ref().map(|c| c.name.as_str()))
            .filter_map(|n| frame.find(n))
            .all(|slot| self.slots[slot].value.is_known());
        let is_known = condition.as_bool().is_some();
        let used = counter.as_ref().is_some_and(|c| c.used);
        if is_known && (others_known || used || counter.is_none()) {
            for _ in 0..MOST_TURNS {
                let condition = self.value(frame, &w.cond)?;
                match condition.as_bool() {
                    Some(false) => return Ok(Value::Unit),
                    Some(true) => {
                        self.block(frame, &w.body)?;
                    }
                    None => break,
                }
            }
            return Err(self.refuse(frame, w.span(), "this loop does not end while it is known"));
        }
        let Some(counter) = counter else {
            let reason = "a loop counts: `let mut i = 0; while i < end { …; i += 1; }`";
            return Err(self.refuse(frame, w.span(), reason));
        };
        names.remove(&counter.name);
        let Some(slot) = frame.find(&counter.name) else {
            return Err(self.refuse(frame, w.span(), "the counter is not found"));
        };
        let end = self.value(frame, &counter.end)?;
        let from = self.slots[slot].value.clone();
        let (from, end) = match (from, end) {
            (Value::Scalar(a), Value::Scalar(b)) => (a, b),
            (Value::Scalar(a), b @ Value::Int(_)) => {
                let b = self.put_together(frame, &b, &a.ty, w.span())?;
                (a, b)
            }
            (a @ Value::Int(_), Value::Scalar(b)) => {
                let a = self.put_together(frame, &a, &b.ty, w.span())?;
                (a, b)
            }
            (Value::Int(a), Value::Int(b)) => {
                let number = |i: i128| {
                    int_literal(i, Scalar::U32)
                        .map(literal)
                        .ok_or_else(|| self.refuse(frame, w.span(), "the counter is out of range"))
                };
                (number(a)?, number(b)?)
            }
            _ => return Err(self.refuse(frame, w.span(), "a counter is a whole number")),
        };
        if !matches!(from.ty, Type::Scalar(Scalar::U32 | Scalar::I32)) || from.ty != end.ty {
            return Err(self.refuse(frame, w.span(), "a counter is a `u32` or `i32`"));
        }
        let end = self.kept("end", end, Rank::Part);
        let from = self.kept("start", from, Rank::Part);
        self.let_change(frame, &names);
        let id = self.new_local(&counter.name, from.ty.clone(), Rank::Variable);
        self.changing.insert(id);
        self.slots[slot].value = Value::Scalar(local(id, from.ty.clone()));
        self.blocks.push(Vec::new());
        frame.scopes.push(HashMap::new());
        let stmts = &w.body.stmts[..w.body.stmts.len() - 1];
        let done = self.statements(frame, stmts);
        frame.scopes.pop();
        let block = self.blocks.pop().unwrap_or_default();
        self.no_return(frame, done, w.span())?;
        // After the loop nobody reads a counter; if somebody does, it is found out.
        self.slots[slot].value = Value::Text;
        self.emit(Stmt::For(id, from, end, block));
        Ok(Value::Unit)
    }

    // ---- macros --------------------------------------------------------------------------------

    fn invocation(&mut self, frame: &mut Frame, mac: &syn::Macro) -> Done<Value> {
        let name = mac.path.segments.last().map(|s| s.ident.to_string());
        let name = name.unwrap_or_default();
        let span = mac.path.span();
        match name.as_str() {
            "lit" => {
                let e: syn::Expr = self.parsed(frame, mac.tokens.clone(), span)?;
                let value = self.value(frame, &e)?;
                match value.as_double().or(value.as_int().map(|i| i as f64)) {
                    Some(v) => Ok(Value::Scalar(float(v as f32))),
                    None => Err(self.refuse(frame, span, "`lit!` takes a number that is known")),
                }
            }
            "unroll" => self.unroll(frame, mac),
            "assert" | "debug_assert" => Ok(Value::Unit),
            _ => {
                let Some(rules) = self.tree.rules(frame.module, &name) else {
                    return Err(self.refuse(frame, span, format!("`{name}!` has no form here")));
                };
                let tokens = rules
                    .expand(&mac.tokens)
                    .map_err(|e| self.refuse(frame, span, format!("`{name}!`: {e}")))?;
                let braced = quote::quote!({ #tokens });
                let block: syn::Block = self.parsed(frame, braced, span)?;
                self.block(frame, &block)
            }
        }
    }

    fn parsed<T: syn::parse::Parse>(
        &self,
        frame: &Frame,
        tokens: TokenStream,
        span: Span,
    ) -> Done<T> {
        syn::parse2(tokens).map_err(|e| self.refuse(frame, span, e.to_string()))
    }

    fn unroll(&mut self, frame: &mut Frame, mac: &syn::Macro) -> Done<Value> {
        let span = mac.path.span();
        let turns: Turns = self.parsed(frame, mac.tokens.clone(), span)?;
        let from = self.value(frame, &turns.from)?.as_int();
        let to = self.value(frame, &turns.to)?.as_int();
        let (Some(from), Some(to)) = (from, to) else {
            return Err(self.refuse(frame, span, "the range of `unroll!` is not known"));
        };
        let name = turns.index.to_string();
        // Without an index nothing tells one turn from another: it stays a loop.
        if name.starts_with('_') && to - from > 2 {
            let mut names = BTreeSet::new();
            let block = &turns.body;
            assigned(quote::quote!(#block), &mut names);
            let known = names
                .iter()
                .filter_map(|n| frame.find(n))
                .all(|slot| self.slots[slot].value.is_known());
            if !known {
                self.let_change(frame, &names);
                let id = self.new_local("turn", Type::U32, Rank::Variable);
                self.changing.insert(id);
                self.blocks.push(Vec::new());
                let done = self.block(frame, &turns.body);
                let block = self.blocks.pop().unwrap_or_default();
                self.no_return(frame, done, span)?;
                let number = |i: i128| literal(Literal::U32(i as u32));
                self.emit(Stmt::For(id, number(from), number(to), block));
                return Ok(Value::Unit);
            }
        }
        for i in from..to {
            frame.scopes.push(HashMap::new());
            self.declare(frame, &name, Value::Int(i));
            let done = self.block(frame, &turns.body);
            frame.scopes.pop();
            done?;
        }
        Ok(Value::Unit)
    }

    // ---- calls ---------------------------------------------------------------------------------

    fn arguments(
        &mut self,
        frame: &mut Frame,
        args: &syn::punctuated::Punctuated<syn::Expr, syn::Token![,]>,
    ) -> Done<Vec<Value>> {
        args.iter().map(|a| self.expr(frame, a)).collect()
    }

    fn call(&mut self, frame: &mut Frame, c: &syn::ExprCall) -> Done<Value> {
        if let Some((element, is_changed)) = element(c) {
            return if is_changed {
                self.place(frame, &element).map(Value::Ref)
            } else {
                self.value(frame, &element)
            };
        }
        let callee = match c.func.as_ref() {
            syn::Expr::Path(p) => {
                let names = segments(&p.path);
                let own = names.len() == 1 && frame.find(&names[0]).is_some();
                if own {
                    self.value(frame, &c.func)?
                } else {
                    Value::Path(frame.module, Rc::new(p.clone()))
                }
            }
            other => self.value(frame, other)?,
        };
        let args = self.arguments(frame, &c.args)?;
        self.apply(frame, &callee, args, c.span())
    }

    fn apply(
        &mut self,
        frame: &mut Frame,
        callee: &Value,
        args: Vec<Value>,
        span: Span,
    ) -> Done<Value> {
        match callee {
            Value::Closure(closure) => self.closure(frame, closure, args, span),
            Value::Lookup(id) => self.lookup(frame, *id, args, span),
            Value::Path(module, path) => {
                let mut at = frame.clone();
                at.module = *module;
                self.named(&mut at, path, args, span)
            }
            other => {
                let reason = format!("{} cannot be called", other.what());
                Err(self.refuse(frame, span, reason))
            }
        }
    }

    fn closure(
        &mut self,
        frame: &Frame,
        closure: &Closure,
        args: Vec<Value>,
        span: Span,
    ) -> Done<Value> {
        if frame.depth >= DEEPEST {
            return Err(self.refuse(frame, span, "calls go round in circles"));
        }
        let mut inner = Frame {
            scopes: vec![closure.names.clone(), HashMap::new()],
            generics: closure.generics.clone(),
            module: closure.module,
            own: closure.own.clone(),
            depth: frame.depth + 1,
        };
        for (pat, value) in closure.source.inputs.iter().zip(args) {
            self.bind(&mut inner, pat, value, Rank::Argument)?;
        }
        match self.expr(&mut inner, &closure.source.body) {
            Err(Stop::Return(value)) => Ok(value),
            other => other,
        }
    }

    fn lookup(&mut self, frame: &Frame, id: Id, args: Vec<Value>, span: Span) -> Done<Value> {
        let Type::Lookup(signature) = self.locals[id].ty.clone() else {
            return Err(self.refuse(frame, span, "this cannot be called"));
        };
        let mut all = Vec::new();
        for (value, ty) in args.into_iter().zip(&signature.params) {
            let value = self.read(value);
            all.push(self.put_together(frame, &value, ty, span)?);
        }
        let e = fold::node(signature.result.clone(), Kind::Lookup(id, all));
        let name = self.locals[id].name.clone();
        let found = self.new_local(
            &format!("{name}_result"),
            signature.result.clone(),
            Rank::Part,
        );
        self.emit(Stmt::Let(found, e));
        Ok(self.taken_apart(&local(found, signature.result.clone())))
    }

    /// The generic arguments of a path's segment.
    fn turbofish(
        &mut self,
        frame: &mut Frame,
        segment: &syn::PathSegment,
    ) -> Done<Option<Vec<Generic>>> {
        let syn::PathArguments::AngleBracketed(list) = &segment.arguments else {
            return Ok(None);
        };
        let mut all = Vec::new();
        for arg in &list.args {
            all.push(match arg {
                syn::GenericArgument::Lifetime(_) => continue,
                syn::GenericArgument::Type(syn::Type::Path(p)) => self.generic_of(frame, p)?,
                syn::GenericArgument::Const(e) => {
                    let value = self.value(frame, e)?;
                    if let Some(known) = value.as_bool() {
                        Generic::Bool(known)
                    } else if let Some(known) = value.as_int() {
                        Generic::Const(known)
                    } else {
                        return Err(self.refuse(frame, e.span(), "this is not known"));
                    }
                }
                other => {
                    return Err(self.refuse(frame, other.span(), "this argument has no form here"));
                }
            });
        }
        Ok(Some(all))
    }

    fn generic_of(&mut self, frame: &mut Frame, p: &syn::TypePath) -> Done<Generic> {
        if let Some(ident) = p.path.get_ident() {
            let name = ident.to_string();
            if let Some(g) = frame.generics.get(&name) {
                return Ok(g.clone());
            }
            if name == "f32" {
                return Ok(Generic::Real);
            }
            // A constant, which looks like a type.
            if let Some(slot) = frame.find(&name)
                && let Some(i) = self.slots[slot].value.as_int()
            {
                return Ok(Generic::Const(i));
            }
            let as_path = syn::ExprPath {
                attrs: Vec::new(),
                qself: None,
                path: p.path.clone(),
            };
            if self.identity(frame, &p.path).is_none()
                && let Ok(value) = self.path(frame, &as_path)
                && let Some(i) = value.as_int()
            {
                return Ok(Generic::Const(i));
            }
        }
        match self.identity(frame, &p.path) {
            Some(identity) => Ok(Generic::Struct(identity)),
            None => Err(self.refuse(
                frame,
                p.span(),
                "this type has no form here: only `f32` and structures",
            )),
        }
    }

    /// Calls what a path names.
    fn named(
        &mut self,
        frame: &mut Frame,
        p: &syn::ExprPath,
        args: Vec<Value>,
        span: Span,
    ) -> Done<Value> {
        let names = segments(&p.path);
        let last = &p.path.segments[p.path.segments.len() - 1];
        let name = names[names.len() - 1].clone();
        let given = self.turbofish(frame, last)?;
        if names.len() >= 2 {
            let head = &p.path.segments[names.len() - 2];
            let head_name = names[names.len() - 2].as_str();
            let is_number = frame.generics.get(head_name) == Some(&Generic::Real)
                || matches!(
                    head_name,
                    "f32" | "Real" | "f64" | "Mask" | "i32" | "u32" | "usize"
                )
                || head_name == "Self" && frame.own.as_deref() == Some("f32");
            if is_number && names.len() == 2 {
                return self.number_function(frame, head_name, &name, given.as_deref(), args, span);
            }
            if let Some((scalar, size)) = vector_name(head_name) {
                return self.vector_function(frame, scalar, size, &name, args, span);
            }
            if let Some(size) = matrix_name(head_name) {
                return self.matrix_function(frame, size, &name, args, span);
            }
            let mut type_path = syn::Path {
                leading_colon: None,
                segments: syn::punctuated::Punctuated::new(),
            };
            for s in p.path.segments.iter().take(names.len() - 1) {
                type_path.segments.push(s.clone());
            }
            if let Some(identity) = self.identity(frame, &type_path) {
                let key = (identity.to_string(), name.clone());
                let Some(method) = self.tree.methods.get(&key).cloned() else {
                    let reason = format!("`{}` has no function `{name}`", last_name(&identity));
                    return Err(self.refuse(frame, span, reason));
                };
                let outer = self.turbofish(frame, head)?;
                return self.run_method(frame, &method, identity, outer, given, args, span);
            }
        }
        // `Self(…)` and structures without names.
        if let Some(identity) = self.identity(frame, &p.path) {
            let fields = args
                .into_iter()
                .enumerate()
                .map(|(i, v)| (i.to_string(), self.read(v)))
                .collect();
            return Ok(Value::Struct(identity, fields));
        }
        match self.tree.resolve(frame.module, &names) {
            Some((home, Item::Function(source))) => {
                let in_dsl = self.tree.modules[home].path[0] == "hankel_dsl";
                if in_dsl && name == "to_i32" {
                    return self.whole_number(frame, args, span);
                }
                if is_function(&source.attrs) || self.is_elementary(home, &source) {
                    return self.kept_call(frame, home, &source, args, span);
                }
                let mut inner = self.frame_for(frame, home, None);
                self.run(
                    frame,
                    &mut inner,
                    &source.sig,
                    &source.block,
                    given,
                    args,
                    span,
                )
            }
            // The DSL's own sources may not be at hand.
            None if name == "to_i32" => self.whole_number(frame, args, span),
            _ => Err(self.refuse(frame, span, format!("`{}` is not found", names.join("::")))),
        }
    }

    fn whole_number(&mut self, frame: &Frame, args: Vec<Value>, span: Span) -> Done<Value> {
        let mut args = args.into_iter();
        let x = args.next().map(|v| self.read(v));
        match x {
            Some(Value::Scalar(e)) => Ok(Value::Scalar(builtin(Builtin::ToI32, vec![e]))),
            Some(Value::Fraction(_, single)) => {
                Ok(Value::Scalar(builtin(Builtin::ToI32, vec![float(single)])))
            }
            _ => Err(self.refuse(frame, span, "`to_i32` takes a float")),
        }
    }

    /// Whether a function is one of the DSL's elementary functions of one number, which are long: each is
    /// written once, whoever calls it.
    fn is_elementary(&self, home: ModuleId, source: &syn::ItemFn) -> bool {
        let path = &self.tree.modules[home].path;
        path.len() == 3
            && path[..2] == ["hankel_dsl", "math"]
            && matches!(source.vis, syn::Visibility::Public(_))
            && source.attrs.iter().any(|a| a.path().is_ident("must_use"))
            && source.sig.inputs.len() == 1
            && matches!(&source.sig.output, syn::ReturnType::Type(_, ty) if matches!(**ty, syn::Type::Path(_)))
    }

    /// Calls another function of a library, which stays a call.
    fn kept_call(
        &mut self,
        frame: &Frame,
        home: ModuleId,
        source: &syn::ItemFn,
        args: Vec<Value>,
        span: Span,
    ) -> Done<Value> {
        let mut inner = self.frame_for(frame, home, None);
        inner.depth = 0;
        self.generics(&mut inner, &source.sig.generics, None, span)?;
        let mut all = Vec::new();
        for (value, input) in args.into_iter().zip(&source.sig.inputs) {
            let syn::FnArg::Typed(typed) = input else {
                continue;
            };
            let ty = self.interface(&inner, &typed.ty)?;
            let value = self.read(value);
            if let Type::Lookup(_) = ty {
                let Value::Lookup(id) = value else {
                    let reason = "what is looked up is passed on as it is, no closure of one's own";
                    return Err(self.refuse(frame, span, reason));
                };
                all.push(local(id, ty));
                continue;
            }
            all.push(self.put_together(frame, &value, &ty, span)?);
        }
        let syn::ReturnType::Type(_, ty) = &source.sig.output else {
            return Err(self.refuse(frame, span, "a function of a library gives something"));
        };
        let ty = self.interface(&inner, ty)?;
        let name = source.sig.ident.to_string();
        self.calls.insert((name.clone(), home));
        let e = fold::node(ty.clone(), Kind::Call(name.clone(), all));
        if matches!(ty, Type::Scalar(_)) {
            return Ok(Value::Scalar(e));
        }
        let short = name.rsplit('_').next().unwrap_or(&name).to_owned();
        let id = self.new_local(&short, ty.clone(), Rank::Part);
        self.emit(Stmt::Let(id, e));
        Ok(self.taken_apart(&local(id, ty)))
    }

    /// Runs a function's body in place.
    #[allow(clippy::too_many_arguments, reason = "what a call is made of")]
    fn run(
        &mut self,
        outer: &Frame,
        inner: &mut Frame,
        sig: &syn::Signature,
        body: &syn::Block,
        given: Option<Vec<Generic>>,
        args: Vec<Value>,
        span: Span,
    ) -> Done<Value> {
        if inner.depth >= DEEPEST {
            return Err(self.refuse(outer, span, "calls go round in circles"));
        }
        // Lifetimes are not written at calls.
        self.generics(inner, &sig.generics, given.as_deref(), span)?;
        if args.len() != sig.inputs.len() {
            return Err(self.refuse(
                outer,
                span,
                "the arguments are not as many as the parameters",
            ));
        }
        for (input, value) in sig.inputs.iter().zip(args) {
            match input {
                syn::FnArg::Receiver(r) => {
                    let by_place = r.reference.is_some() && r.mutability.is_some();
                    let value = if by_place { value } else { self.read(value) };
                    let value = self.part(value, "own");
                    self.declare(inner, "self", value);
                }
                syn::FnArg::Typed(typed) => {
                    let by_place = matches!(typed.ty.as_ref(), syn::Type::Reference(r) if r.mutability.is_some());
                    let value = if by_place { value } else { self.read(value) };
                    self.infer(inner, &typed.ty, &value);
                    let value = self.typed(inner, value, Some(&typed.ty), span)?;
                    self.bind(inner, &typed.pat, value, Rank::Argument)?;
                }
            }
        }
        let value = match self.block(inner, body) {
            Err(Stop::Return(value)) | Ok(value) => value,
            Err(stop) => return Err(stop),
        };
        let value = self.read(value);
        self.typed(inner, value, return_type(sig), span)
    }

    /// Lengths of arrays tell generic constants.
    fn infer(&self, frame: &mut Frame, ty: &syn::Type, value: &Value) {
        match (ty, value) {
            (syn::Type::Reference(r), _) => self.infer(frame, &r.elem, value),
            (syn::Type::Array(a), Value::Array(all)) => {
                if let syn::Expr::Path(p) = &a.len
                    && let Some(name) = p.path.get_ident()
                    && !frame.generics.contains_key(&name.to_string())
                    && self
                        .tree
                        .resolve(frame.module, &[name.to_string()])
                        .is_none()
                {
                    let length = all.len() as i128;
                    frame
                        .generics
                        .insert(name.to_string(), Generic::Const(length));
                }
            }
            _ => {}
        }
    }

    #[allow(clippy::too_many_arguments, reason = "what a call is made of")]
    fn run_method(
        &mut self,
        frame: &mut Frame,
        method: &Method,
        identity: Rc<str>,
        outer: Option<Vec<Generic>>,
        given: Option<Vec<Generic>>,
        args: Vec<Value>,
        span: Span,
    ) -> Done<Value> {
        let mut inner = self.frame_for(frame, method.module, Some(identity));
        if outer.is_none() && inner.own == frame.own {
            // `Self::function` or `self.method()`: the same type, with the same parameters.
            for name in method.generics.params.iter().map(parameter_name) {
                if let Some(known) = frame.generics.get(&name) {
                    inner.generics.insert(name, known.clone());
                }
            }
        }
        self.generics(&mut inner, &method.generics, outer.as_deref(), span)?;
        let function = method.function.clone();
        self.run(
            frame,
            &mut inner,
            &function.sig,
            &function.block,
            given,
            args,
            span,
        )
    }

    fn method(&mut self, frame: &mut Frame, m: &syn::ExprMethodCall) -> Done<Value> {
        let name = m.method.to_string();
        let span = m.span();
        let receiver = self.expr(frame, &m.receiver)?;
        let given = match &m.turbofish {
            Some(list) => {
                let segment = syn::PathSegment {
                    ident: m.method.clone(),
                    arguments: syn::PathArguments::AngleBracketed(list.clone()),
                };
                self.turbofish(frame, &segment)?
            }
            None => None,
        };
        let args = self.arguments(frame, &m.args)?;
        let value = self.read(receiver.clone());
        match value {
            Value::Struct(identity, _) => {
                let key = (identity.to_string(), name.clone());
                let Some(method) = self.tree.methods.get(&key).cloned() else {
                    if name == "clone" {
                        return Ok(self.read(receiver));
                    }
                    let reason = format!("`{}` has no method `{name}`", last_name(&identity));
                    return Err(self.refuse(frame, span, reason));
                };
                let mut all = vec![receiver];
                all.extend(args);
                self.run_method(frame, &method, identity, None, given, all, span)
            }
            Value::Vector(scalar, all) => self.vector_method(frame, scalar, all, &name, args, span),
            Value::Matrix(all) => self.matrix_method(frame, all, &name, args, span),
            Value::Array(all) if name == "map" => {
                let [f] = args.as_slice() else {
                    return Err(self.refuse(frame, span, "`map` takes a function"));
                };
                let done = all.into_iter().map(|v| self.apply(frame, f, vec![v], span));
                Ok(Value::Array(done.collect::<Done<_>>()?))
            }
            Value::Array(all) if name == "len" => Ok(Value::Int(all.len() as i128)),
            own => {
                let mut all = vec![own];
                all.extend(args);
                self.number_method(frame, &name, all, span)
            }
        }
    }

    /// Functions of number types: `R::select`, `f64::from_bits`, `Real::max`, `usize::saturating_sub`.
    fn number_function(
        &mut self,
        frame: &Frame,
        head: &str,
        name: &str,
        given: Option<&[Generic]>,
        args: Vec<Value>,
        span: Span,
    ) -> Done<Value> {
        let args: Vec<Value> = args.into_iter().map(|v| self.read(v)).collect();
        match (head, name, args.as_slice()) {
            (_, "epsilon", []) => Ok(Value::Scalar(float(f32::EPSILON))),
            (_, "literal", []) => match given {
                Some([Generic::Const(bits)]) => {
                    let bits = u64::try_from(*bits).unwrap_or(0);
                    Ok(Value::Scalar(float(f64::from_bits(bits) as f32)))
                }
                _ => Err(self.refuse(frame, span, "`literal` takes its bits in brackets")),
            },
            ("f64", "from_bits", [bits]) => match bits.as_int().and_then(|b| u64::try_from(b).ok())
            {
                Some(bits) => Ok(Value::Double(f64::from_bits(bits))),
                None => Err(self.refuse(frame, span, "these bits are not known")),
            },
            (_, "from_bits", [Value::Scalar(e)]) if e.ty == Type::U32 => {
                Ok(Value::Scalar(builtin(Builtin::FromBits, vec![e.clone()])))
            }
            ("f64", ..) => Err(self.refuse(frame, span, "`f64` is for constants only")),
            _ => self.number_method(frame, name, args, span),
        }
    }

    pub(super) fn number_method(
        &mut self,
        frame: &Frame,
        name: &str,
        args: Vec<Value>,
        span: Span,
    ) -> Done<Value> {
        // Known numbers that the shader does not see.
        if let ("to_bits", [Value::Double(x)]) = (name, args.as_slice()) {
            return Ok(Value::Int(i128::from(x.to_bits())));
        }
        if let (Some(Value::Int(a)), rest) = (args.first(), &args[1..]) {
            let b = rest.first().and_then(Value::as_int);
            match (name, b) {
                ("saturating_sub", Some(b)) => return Ok(Value::Int((a - b).max(0))),
                ("is_multiple_of", Some(b)) => {
                    return Ok(Value::bool(a.checked_rem(b).unwrap_or(*a) == 0));
                }
                ("min", Some(b)) => return Ok(Value::Int(*a.min(&b))),
                ("max", Some(b)) => return Ok(Value::Int(*a.max(&b))),
                ("pow", Some(b)) => {
                    let power = u32::try_from(b).ok().and_then(|b| a.checked_pow(b));
                    return power
                        .map(Value::Int)
                        .ok_or_else(|| self.refuse(frame, span, "this overflows"));
                }
                _ => {}
            }
        }
        // All others are of one type.
        let ty = args.iter().find_map(|v| match v {
            Value::Scalar(e) if e.ty != Type::BOOL || args.len() == 1 => Some(e.ty.clone()),
            _ => None,
        });
        let ty = ty.unwrap_or(Type::F32);
        let mut all = Vec::new();
        for (i, value) in args.iter().enumerate() {
            let condition = name == "select" && i == 0;
            let to = if condition { &Type::BOOL } else { &ty };
            all.push(match value {
                Value::Scalar(e) if condition || e.ty == ty => e.clone(),
                Value::Fraction(..) | Value::Int(_) => self.put_together(frame, value, to, span)?,
                other => {
                    let reason = format!("`{name}` of {} has no form here", other.what());
                    return Err(self.refuse(frame, span, reason));
                }
            });
        }
        let is_float = ty == Type::F32;
        let is_bool = ty == Type::BOOL;
        let e = match (name, all.as_slice()) {
            ("sqrt", [x]) if is_float => builtin(Builtin::Sqrt, vec![x.clone()]),
            ("abs", [x]) if is_float => builtin(Builtin::Abs, vec![x.clone()]),
            ("floor", [x]) if is_float => builtin(Builtin::Floor, vec![x.clone()]),
            ("min", [a, b]) if !is_bool => builtin(Builtin::Min, vec![a.clone(), b.clone()]),
            ("max", [a, b]) if !is_bool => builtin(Builtin::Max, vec![a.clone(), b.clone()]),
            ("lt", [a, b]) => binary(Binary::Less, a, b),
            ("le", [a, b]) => binary(Binary::LessEqual, a, b),
            ("gt", [a, b]) => binary(Binary::Greater, a, b),
            ("ge", [a, b]) => binary(Binary::GreaterEqual, a, b),
            ("eq", [a, b]) => binary(Binary::Equal, a, b),
            ("select", [c, a, b]) => {
                builtin(Builtin::Select, vec![c.clone(), a.clone(), b.clone()])
            }
            ("mul_add", [x, a, b]) if is_float => {
                let product = binary(Binary::Multiply, x, a);
                binary(Binary::Add, &product, b)
            }
            ("clamp", [x, low, high]) => {
                let low = builtin(Builtin::Max, vec![x.clone(), low.clone()]);
                builtin(Builtin::Min, vec![low, high.clone()])
            }
            ("saturate", [x]) if is_float => {
                let low = builtin(Builtin::Max, vec![x.clone(), float(0.0)]);
                builtin(Builtin::Min, vec![low, float(1.0)])
            }
            ("lerp", [a, b, t]) if is_float => {
                let a = self.kept("from", a.clone(), Rank::Argument);
                let difference = binary(Binary::Subtract, b, &a);
                let product = binary(Binary::Multiply, t, &difference);
                binary(Binary::Add, &product, &a)
            }
            ("any" | "all", [x]) if is_bool => x.clone(),
            ("wrapping_add", [a, b]) if !is_float => binary(Binary::Add, a, b),
            ("wrapping_sub", [a, b]) if !is_float => binary(Binary::Subtract, a, b),
            ("wrapping_mul", [a, b]) if !is_float => binary(Binary::Multiply, a, b),
            ("to_bits", [x]) if is_float => builtin(Builtin::BitsOf, vec![x.clone()]),
            ("clone", [x]) => x.clone(),
            ("two_sum" | "two_product", [a, b]) if is_float => {
                return self.error_free(frame, name, a, b, span);
            }
            ("guard", [x]) if is_float => {
                builtin(Builtin::Max, vec![x.clone(), float(LEAST_GUARDED)])
            }
            _ => {
                let key = ("f32".to_owned(), name.to_owned());
                let method = self.tree.methods.get(&key).filter(|_| is_float).cloned();
                let Some(method) = method else {
                    let reason = format!("`{name}` has no form here");
                    return Err(self.refuse(frame, span, reason));
                };
                // A function of the DSL's elementary functions, for `f32`.
                let mut inner = self.frame_for(frame, method.module, Some(Rc::from("f32")));
                let (sig, block) = (&method.function.sig, &method.function.block);
                let args = all.into_iter().map(Value::Scalar).collect();
                return self.run(frame, &mut inner, sig, block, None, args, span);
            }
        };
        Ok(Value::Scalar(e))
    }

    /// A sum or product with its error: a function of the prelude.
    fn error_free(
        &mut self,
        frame: &Frame,
        name: &str,
        a: &Expr,
        b: &Expr,
        span: Span,
    ) -> Done<Value> {
        let Some(&home) = self.tree.crates.get(super::PRELUDE) else {
            return Err(self.refuse(frame, span, format!("`{name}` has no form here")));
        };
        self.calls.insert((name.into(), home));
        let ty = Type::Vector(Scalar::F32, 2);
        let call = fold::node(
            ty.clone(),
            Kind::Call(name.into(), vec![a.clone(), b.clone()]),
        );
        let short = if name == "two_sum" { "sum" } else { "product" };
        let id = self.new_local(short, ty.clone(), Rank::Part);
        self.emit(Stmt::Let(id, call));
        let both = local(id, ty);
        Ok(Value::Tuple(vec![
            Value::Scalar(member(&both, "x", Type::F32)),
            Value::Scalar(member(&both, "y", Type::F32)),
        ]))
    }

    pub(super) fn scalar(
        &mut self,
        frame: &Frame,
        value: Value,
        scalar: Scalar,
        span: Span,
    ) -> Done<Value> {
        let value = self.read(value);
        let e = self.put_together(frame, &value, &Type::Scalar(scalar), span)?;
        Ok(Value::Scalar(e))
    }
}

// ---- small things ------------------------------------------------------------------------------

fn parameter_name(param: &syn::GenericParam) -> String {
    match param {
        syn::GenericParam::Type(t) => t.ident.to_string(),
        syn::GenericParam::Const(c) => c.ident.to_string(),
        syn::GenericParam::Lifetime(l) => l.lifetime.to_string(),
    }
}

/// Of `array_element(&array, i)` and `array_element_mut(&mut array, i)`, `array[i]`, and whether it may be changed.
fn element(call: &syn::ExprCall) -> Option<(syn::Expr, bool)> {
    let syn::Expr::Path(p) = call.func.as_ref() else {
        return None;
    };
    let is_changed = match p.path.segments.last()?.ident.to_string().as_str() {
        "array_element" => false,
        "array_element_mut" => true,
        _ => return None,
    };
    let mut args = call.args.iter();
    let (array, index) = (args.next()?, args.next()?);
    let array = match array {
        syn::Expr::Reference(r) => r.expr.as_ref(),
        other => other,
    };
    let indexed = syn::ExprIndex {
        attrs: Vec::new(),
        expr: Box::new(array.clone()),
        bracket_token: syn::token::Bracket(call.span()),
        index: Box::new(index.clone()),
    };
    Some((indexed.into(), is_changed))
}

/// The range and body of an `unroll!`.
struct Turns {
    index: proc_macro2::Ident,
    from: syn::Expr,
    to: syn::Expr,
    body: syn::Block,
}

impl syn::parse::Parse for Turns {
    fn parse(input: syn::parse::ParseStream<'_>) -> syn::Result<Self> {
        let index = input.parse()?;
        input.parse::<syn::Token![in]>()?;
        let range: syn::Expr = input.call(syn::Expr::parse_without_eager_brace)?;
        let syn::Expr::Range(syn::ExprRange {
            start: Some(from),
            end: Some(to),
            ..
        }) = range
        else {
            return Err(syn::Error::new(range.span(), "`unroll!` takes a range"));
        };
        input.parse::<syn::Token![,]>()?;
        if input.peek(syn::Ident) {
            input.parse::<syn::Ident>()?;
            input.parse::<syn::LitInt>()?;
            input.parse::<syn::Token![,]>()?;
        }
        // A loop in a shader: functions have no arrays, so that here it is none.
        if input.peek(syn::Token![loop]) {
            input.parse::<syn::Token![loop]>()?;
            input.parse::<syn::Token![if]>()?;
            input.parse::<syn::Expr>()?;
            input.parse::<syn::Token![,]>()?;
        }
        Ok(Self {
            index,
            from: *from,
            to: *to,
            body: input.parse()?,
        })
    }
}

/// What counts in a loop.
struct Counter {
    name: String,
    end: syn::Expr,
    /// The body reads it, but for counting.
    used: bool,
}

/// `while i < end { …; i += 1; }`
fn counter(w: &syn::ExprWhile) -> Option<Counter> {
    let syn::Expr::Binary(condition) = w.cond.as_ref() else {
        return None;
    };
    let (syn::BinOp::Lt(_), syn::Expr::Path(p)) = (condition.op, condition.left.as_ref()) else {
        return None;
    };
    let name = p.path.get_ident()?.to_string();
    let (last, before) = w.body.stmts.split_last()?;
    let syn::Stmt::Expr(syn::Expr::Binary(step), _) = last else {
        return None;
    };
    let (syn::BinOp::AddAssign(_), syn::Expr::Path(q), syn::Expr::Lit(one)) =
        (step.op, step.left.as_ref(), step.right.as_ref())
    else {
        return None;
    };
    if q.path.get_ident()? != &name || quote::quote!(#one).to_string() != "1" {
        return None;
    }
    let used = before.iter().any(|s| mentions(quote::quote!(#s), &name));
    Some(Counter {
        name,
        end: (*condition.right).clone(),
        used,
    })
}

fn mentions(tokens: TokenStream, name: &str) -> bool {
    tokens.into_iter().any(|t| match t {
        TokenTree::Ident(i) => i == name,
        TokenTree::Group(g) => mentions(g.stream(), name),
        _ => false,
    })
}

/// The names that are assigned somewhere in the tokens, or lent out to be changed.
fn assigned(tokens: TokenStream, names: &mut BTreeSet<String>) {
    let all: Vec<TokenTree> = tokens.into_iter().collect();
    let punct = |i: usize| match all.get(i) {
        Some(TokenTree::Punct(p)) => Some(p.as_char()),
        _ => None,
    };
    for (i, token) in all.iter().enumerate() {
        match token {
            TokenTree::Group(g) => assigned(g.stream(), names),
            TokenTree::Ident(ident) if *ident == "mut" && i > 0 && punct(i - 1) == Some('&') => {
                if let Some(TokenTree::Ident(name)) = all.get(i + 1) {
                    names.insert(name.to_string());
                }
            }
            TokenTree::Punct(p) if p.as_char() == '=' => {
                let next = punct(i + 1);
                let before = if i > 0 { punct(i - 1) } else { None };
                let joined =
                    p.spacing() == proc_macro2::Spacing::Joint && matches!(next, Some('=' | '>'));
                let compares = matches!(before, Some('=' | '!' | '<' | '>'))
                    && matches!(&all[i - 1], TokenTree::Punct(q) if q.spacing() == proc_macro2::Spacing::Joint)
                    // `<<=` and `>>=` assign.
                    && !(i > 1 && matches!(before, Some('<' | '>')) && punct(i - 2) == before);
                if joined || compares {
                    continue;
                }
                let mut start = i;
                while start > 0 && punct(start - 1) != Some(';') {
                    if matches!(&all[start - 1], TokenTree::Group(g) if g.delimiter() == proc_macro2::Delimiter::Brace)
                    {
                        break;
                    }
                    start -= 1;
                }
                let run = &all[start..i];
                if matches!(run.first(), Some(TokenTree::Ident(first)) if *first == "let" || *first == "const")
                {
                    continue;
                }
                match run.iter().find(|t| !matches!(t, TokenTree::Punct(_))) {
                    Some(TokenTree::Ident(name)) => {
                        names.insert(name.to_string());
                    }
                    Some(TokenTree::Group(g)) => {
                        for t in g.stream() {
                            if let TokenTree::Ident(name) = t {
                                names.insert(name.to_string());
                            }
                        }
                    }
                    _ => {}
                }
            }
            _ => {}
        }
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

fn last_name(identity: &str) -> String {
    identity.rsplit("::").next().unwrap_or(identity).to_owned()
}

/// Whether a bound makes a number of a type.
fn is_number(bound: &syn::TypeParamBound) -> bool {
    matches!(bound, syn::TypeParamBound::Trait(t)
        if t.path.segments.last().is_some_and(|s| s.ident == "Real" || s.ident == "Elementary"))
}

/// Parameters and result of `Fn(…) -> …`.
fn fn_bound(bound: &syn::TypeParamBound) -> Option<(Vec<syn::Type>, syn::Type)> {
    let syn::TypeParamBound::Trait(t) = bound else {
        return None;
    };
    let last = t.path.segments.last().filter(|s| s.ident == "Fn")?;
    let syn::PathArguments::Parenthesized(p) = &last.arguments else {
        return None;
    };
    let syn::ReturnType::Type(_, result) = &p.output else {
        return None;
    };
    Some((p.inputs.iter().cloned().collect(), (**result).clone()))
}

fn int_literal(value: i128, scalar: Scalar) -> Option<Literal> {
    match scalar {
        Scalar::U32 => u32::try_from(value).ok().map(Literal::U32),
        Scalar::I32 => i32::try_from(value).ok().map(Literal::I32),
        Scalar::F32 | Scalar::Bool => None,
    }
}
