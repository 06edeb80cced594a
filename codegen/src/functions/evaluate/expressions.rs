//! Expressions: every kind has its arm here, and those of a few lines are evaluated here, too: literals, paths,
//! fields, arrays, tuples and structures.

use std::rc::Rc;

use proc_macro2::Span;
use syn::spanned::Spanned;

use super::{Done, Evaluator, Frame, Stop, loops};
use crate::functions::fold::{float, literal};
use crate::functions::ir::{Leave, Literal, Scalar};
use crate::functions::linear::{matrix_constant, matrix_name, vector_name};
use crate::functions::source::{Item, segments};
use crate::functions::value::{Closure, Generic, Step, Value};

impl Evaluator<'_> {
    pub(super) fn value(&mut self, frame: &mut Frame, e: &syn::Expr) -> Done<Value> {
        let value = self.expr(frame, e)?;
        Ok(self.read(value))
    }

    pub(super) fn expr(&mut self, frame: &mut Frame, e: &syn::Expr) -> Done<Value> {
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
            syn::Expr::ForLoop(f) => self.counted(frame, f),
            syn::Expr::Break(b) => match (&b.label, &b.expr) {
                (None, None) => Err(Stop::Leave(Leave::Loop)),
                _ => Err(self.refuse(
                    frame,
                    b.span(),
                    "only the innermost loop is left, without a value",
                )),
            },
            syn::Expr::Continue(c) => match &c.label {
                None => Err(Stop::Leave(Leave::Turn)),
                Some(_) => {
                    Err(self.refuse(frame, c.span(), "only the innermost loop is continued"))
                }
            },
            syn::Expr::Range(r) => Err(self.refuse(
                frame,
                r.span(),
                "a range is what `for` goes over, by itself or with `rev`, `step_by`, `enumerate` and `zip`",
            )),
            syn::Expr::Loop(l) => Err(self.refuse(frame, l.span(), loops::ENDLESS)),
            other => Err(self.refuse(frame, other.span(), "this expression has no form here")),
        }
    }

    pub(super) fn literal(&mut self, frame: &Frame, lit: &syn::Lit) -> Done<Value> {
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

    pub(super) fn path(&mut self, frame: &mut Frame, p: &syn::ExprPath) -> Done<Value> {
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
            let is_own = first == "Self" && frame.own.as_deref() == Some("f32");
            let is_real = is_own || frame.generics.get(first) == Some(&Generic::Real);
            let ty = if is_real { "f32" } else { first };
            match (ty, second.as_str()) {
                ("f32", "IS_WIDE") => return Ok(Value::bool(false)),
                (ty, name) => {
                    if let Some(number) = limit_of(ty, name) {
                        return Ok(number);
                    }
                }
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
            _ => {
                let path = names.join("::");
                match constant_of(&path) {
                    Some(constant) => Ok(constant),
                    // A variant of an enumeration, or a function that the call knows.
                    None if names.len() > 1 => Ok(Value::Variant(path)),
                    None => Err(self.refuse(frame, p.span(), format!("`{path}` is not found"))),
                }
            }
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
}

/// A number type's limit, by its name.
fn limit_of(ty: &str, name: &str) -> Option<Value> {
    Some(match (ty, name) {
        ("f32", "EPSILON") => Value::Scalar(float(f32::EPSILON)),
        ("f32", "MAX") => Value::Scalar(float(f32::MAX)),
        ("f32", "MIN") => Value::Scalar(float(f32::MIN)),
        ("f32", "MIN_POSITIVE") => Value::Scalar(float(f32::MIN_POSITIVE)),
        ("f64", "EPSILON") => Value::Double(f64::EPSILON),
        ("f64", "MAX") => Value::Double(f64::MAX),
        ("f64", "MIN_POSITIVE") => Value::Double(f64::MIN_POSITIVE),
        ("u32", "MAX") => Value::Scalar(literal(Literal::U32(u32::MAX))),
        ("u32", "MIN") => Value::Scalar(literal(Literal::U32(0))),
        ("i32", "MAX") => Value::Scalar(literal(Literal::I32(i32::MAX))),
        ("i32", "MIN") => Value::Scalar(literal(Literal::I32(i32::MIN))),
        _ => return None,
    })
}

/// A constant of the standard library, by its path.
fn constant_of(path: &str) -> Option<Value> {
    macro_rules! constants {
        ($($name:ident)*) => {
            match path.strip_prefix("core::").or(path.strip_prefix("std::"))? {
                $(
                    concat!("f32::consts::", stringify!($name)) => {
                        Value::Scalar(float(std::f32::consts::$name))
                    }
                    concat!("f64::consts::", stringify!($name)) => {
                        Value::Double(std::f64::consts::$name)
                    }
                )*
                _ => return None,
            }
        };
    }
    Some(constants!(
        PI TAU E SQRT_2 FRAC_1_SQRT_2 FRAC_1_PI FRAC_2_PI FRAC_2_SQRT_PI FRAC_PI_2 FRAC_PI_3 FRAC_PI_4
        FRAC_PI_6 FRAC_PI_8 LN_2 LN_10 LOG2_E LOG2_10 LOG10_E LOG10_2
    ))
}
