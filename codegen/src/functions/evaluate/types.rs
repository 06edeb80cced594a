//! Types: generic parameters and arguments, the types of an interface, values that are put together for one
//! and taken apart behind it, and literals, which get the type that is said.

use std::collections::HashMap;
use std::rc::Rc;

use proc_macro2::Span;
use syn::spanned::Spanned;

use super::{Done, Evaluator, Frame};
use crate::functions::fold::{self, float, literal, member};
use crate::functions::ir::{COLUMNS, Expr, Kind, Literal, Scalar, Signature, Struct, Type};
use crate::functions::linear::{matrix_name, vector_name};
use crate::functions::source::{docs, segments};
use crate::functions::value::{Generic, Value};

impl Evaluator<'_> {
    /// Binds generic parameters that are not bound yet: what is bounded by `Real` is `f32`.
    pub(super) fn generics(
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

    /// The generic arguments of a path's segment.
    pub(super) fn turbofish(
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

    /// Lengths of arrays tell generic constants.
    pub(super) fn infer(&self, frame: &mut Frame, ty: &syn::Type, value: &Value) {
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

    /// A type of a function's interface.
    pub(super) fn interface(&mut self, frame: &Frame, ty: &syn::Type) -> Done<Type> {
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
    pub(super) fn identity(&self, frame: &Frame, path: &syn::Path) -> Option<Rc<str>> {
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
                let reason = format!(
                    "`{name}` cannot be passed or returned: its members have no names. Take \
                     `f32`, `u32`, `i32`, `bool`, a vector or a matrix of them, or a structure \
                     with named members; compute in `f32` instead of `Half`"
                );
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
    pub(super) fn taken_apart(&self, e: &Expr) -> Value {
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
    pub(super) fn put_together(
        &self,
        frame: &Frame,
        value: &Value,
        ty: &Type,
        span: Span,
    ) -> Done<Expr> {
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
    pub(super) fn typed(
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
}

pub(super) fn last_name(identity: &str) -> String {
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

pub(super) fn int_literal(value: i128, scalar: Scalar) -> Option<Literal> {
    match scalar {
        Scalar::U32 => u32::try_from(value).ok().map(Literal::U32),
        Scalar::I32 => i32::try_from(value).ok().map(Literal::I32),
        Scalar::F32 | Scalar::Bool => None,
    }
}
