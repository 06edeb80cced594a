//! Built-in functions: those of the number types, as functions and as methods, and conversions between them.

use std::rc::Rc;

use proc_macro2::Span;

use super::{Done, Evaluator, Frame};
use crate::functions::PRELUDE;
use crate::functions::fold::{self, binary, builtin, float, literal, local, member};
use crate::functions::ir::{Binary, Builtin, Expr, Kind, Literal, Rank, Scalar, Stmt, Type};
use crate::functions::value::{Generic, Value};

/// `Elementary::guard` takes the larger one of a number and of this, which nothing is below: -2^126. A compiler
/// does not know that, and neither contracts nor reorders what is before.
const LEAST_GUARDED: f32 = -85_070_591_730_234_615_865_843_651_857_942_052_864.0;

impl Evaluator<'_> {
    pub(super) fn cast(
        &mut self,
        frame: &Frame,
        value: Value,
        ty: &syn::Type,
        span: Span,
    ) -> Done<Value> {
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
                let whole = if to == "u32" {
                    Scalar::U32
                } else {
                    Scalar::I32
                };
                Value::Scalar(self.saturated(e, whole))
            }
            ("u32" | "i32", Value::Scalar(e)) if e.ty == Type::BOOL => {
                let number = |v: i32| match to {
                    "u32" => literal(Literal::U32(v.cast_unsigned())),
                    _ => literal(Literal::I32(v)),
                };
                Value::Scalar(builtin(Builtin::Select, vec![e, number(1), number(0)]))
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

    /// A float as an integer, as Rust defines it: what is out of range is the nearest integer, and NaN is 0. Languages
    /// differ there.
    pub(in crate::functions) fn saturated(&mut self, x: Expr, to: Scalar) -> Expr {
        let x = self.kept("number", x, Rank::Part);
        let (which, most, limit) = match to {
            Scalar::U32 => (Builtin::ToU32, Literal::U32(u32::MAX), 4_294_967_296.0),
            _ => (Builtin::ToI32, Literal::I32(i32::MAX), 2_147_483_648.0),
        };
        let least = match to {
            Scalar::U32 => float(0.0),
            _ => float(-limit),
        };
        // Neither a number nor in range.
        let none = match to {
            Scalar::U32 => literal(Literal::U32(0)),
            _ => {
                let is_below = binary(Binary::Less, &x, &float(0.0));
                let [least, none] = [i32::MIN, 0].map(|v| literal(Literal::I32(v)));
                builtin(Builtin::Select, vec![is_below, least, none])
            }
        };
        let is_above = binary(Binary::GreaterEqual, &x, &float(limit));
        let is_inside = binary(Binary::Greater, &x, &least);
        let whole = builtin(which, vec![x]);
        let inside = builtin(Builtin::Select, vec![is_inside, whole, none]);
        builtin(Builtin::Select, vec![is_above, literal(most), inside])
    }

    pub(super) fn whole_number(
        &mut self,
        frame: &Frame,
        args: Vec<Value>,
        span: Span,
    ) -> Done<Value> {
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

    /// Functions of number types: `R::select`, `f64::from_bits`, `Real::max`, `usize::saturating_sub`.
    pub(super) fn number_function(
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
            ("u32" | "i32", "from", [value @ Value::Scalar(e)]) if e.ty == Type::BOOL => {
                let ty = syn::Ident::new(head, span);
                self.cast(frame, value.clone(), &syn::parse_quote!(#ty), span)
            }
            _ => self.number_method(frame, name, args, span),
        }
    }

    pub(in crate::functions) fn number_method(
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
        if let [Value::Int(a), rest @ ..] = args.as_slice() {
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
        let Some(&home) = self.tree.crates.get(PRELUDE) else {
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

    pub(in crate::functions) fn scalar(
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
