//! Calls: of functions, methods and closures, whose bodies are run in place, and of a library's functions and
//! what the host looks up, which stay calls.

use std::collections::HashMap;
use std::rc::Rc;

use proc_macro2::Span;
use syn::spanned::Spanned;

use super::returns::with_one_end;
use super::types::last_name;
use super::variables::element;
use super::{Done, Evaluator, Frame, Stop, is_function, return_type};
use crate::functions::fold::{self, binary, builtin, local};
use crate::functions::ir::{Binary, Builtin, Id, Kind, Native, Rank, Stmt, Type};
use crate::functions::linear::{matrix_name, vector_name};
use crate::functions::source::{Item, Method, ModuleId, segments};
use crate::functions::value::{Closure, Generic, Value};

/// Calls within each other at most: Rust would have said something, shaders cannot recurse.
const DEEPEST: usize = 96;

impl Evaluator<'_> {
    fn arguments(
        &mut self,
        frame: &mut Frame,
        args: &syn::punctuated::Punctuated<syn::Expr, syn::Token![,]>,
    ) -> Done<Vec<Value>> {
        args.iter().map(|a| self.expr(frame, a)).collect()
    }

    pub(super) fn call(&mut self, frame: &mut Frame, c: &syn::ExprCall) -> Done<Value> {
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
        match closure.source.body.as_ref() {
            syn::Expr::Block(b) => self.body(&mut inner, &b.block),
            other => self.expr(&mut inner, other),
        }
    }

    /// Runs the body of a function or closure.
    pub(super) fn body(&mut self, frame: &mut Frame, body: &syn::Block) -> Done<Value> {
        match self.block(frame, &with_one_end(body)) {
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
                if in_dsl
                    && self.tree.modules[home]
                        .path
                        .ends_with(&["math".into(), "native".into()])
                {
                    return self.native(frame, &name, args, span);
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

    /// A function of `math::native`.
    fn native(&self, frame: &Frame, name: &str, args: Vec<Value>, span: Span) -> Done<Value> {
        let mut all = Vec::with_capacity(args.len());
        for value in &args {
            all.push(self.put_together(frame, value, &Type::F32, span)?);
        }
        match (Native::named(name), all.as_slice()) {
            (Some(native), _) => Ok(Value::Scalar(builtin(Builtin::Native(native), all))),
            (None, [a, b, c]) if name == "fma" => {
                let product = binary(Binary::Multiply, a, b);
                Ok(Value::Scalar(binary(Binary::Add, &product, c)))
            }
            _ => {
                let reason =
                    format!("not every language has `native::{name}`: take `math::{name}`");
                Err(self.refuse(frame, span, reason))
            }
        }
    }

    /// Whether a function is one of the DSL's elementary functions, which are long: each is written once, whoever
    /// calls it.
    fn is_elementary(&self, home: ModuleId, source: &syn::ItemFn) -> bool {
        let path = &self.tree.modules[home].path;
        path.len() == 3
            && path[..2] == ["hankel_dsl", "math"]
            && matches!(source.vis, syn::Visibility::Public(_))
            && source.attrs.iter().any(|a| a.path().is_ident("must_use"))
            && is_over_elementary(&source.sig.generics)
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
    pub(super) fn run(
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
        let done = self.body(inner, body).and_then(|value| {
            let value = self.read(value);
            self.typed(inner, value, return_type(sig), span)
        });
        // Of another crate's function, whoever calls it knows the place of the call.
        let crate_of = |frame: &Frame| &self.tree.modules[frame.module].path[0];
        match done {
            Err(Stop::Refused(refusal)) if crate_of(inner) != crate_of(outer) => {
                let (name, home) = (&sig.ident, crate_of(inner));
                let reason = format!("`{name}` of {home}: {} ({})", refusal.reason, refusal.place);
                Err(self.refuse(outer, span, reason))
            }
            done => done,
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

    pub(super) fn method(&mut self, frame: &mut Frame, m: &syn::ExprMethodCall) -> Done<Value> {
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
}

/// Whether a function has a number type with bits: `<R: Elementary>`.
fn is_over_elementary(generics: &syn::Generics) -> bool {
    let is_elementary = |bound: &syn::TypeParamBound| matches!(bound, syn::TypeParamBound::Trait(t) if t.path.is_ident("Elementary"));
    generics
        .type_params()
        .any(|p| p.bounds.iter().any(is_elementary))
}

fn parameter_name(param: &syn::GenericParam) -> String {
    match param {
        syn::GenericParam::Type(t) => t.ident.to_string(),
        syn::GenericParam::Const(c) => c.ident.to_string(),
        syn::GenericParam::Lifetime(l) => l.lifetime.to_string(),
    }
}
