//! glam's vectors and matrices: their functions and methods as operations on components, in the order in which glam
//! computes them, so that texts round as the source does.

use proc_macro2::Span;

use super::evaluate::{Done, Evaluator, Frame};
use super::fold::{builtin, float};
use super::ir::{Binary, Builtin, Scalar};
use super::value::Value;

/// glam's vectors.
pub fn vector_name(name: &str) -> Option<(Scalar, usize)> {
    let (scalar, rest) = match name.strip_prefix('U') {
        Some(rest) => (Scalar::U32, rest),
        None => match name.strip_prefix('I') {
            Some(rest) => (Scalar::I32, rest),
            None => (Scalar::F32, name),
        },
    };
    let size = match rest {
        "Vec2" => 2,
        "Vec3" => 3,
        "Vec4" => 4,
        _ => return None,
    };
    Some((scalar, size))
}

/// How many columns one of glam's matrices has.
pub fn matrix_name(name: &str) -> Option<usize> {
    Some(match name {
        "Mat2" => 2,
        "Mat3" => 3,
        "Mat4" => 4,
        _ => return None,
    })
}

/// A constant of a matrix type.
pub fn matrix_constant(size: usize, name: &str) -> Option<Value> {
    let diagonal = match name {
        "IDENTITY" => 1.0,
        "ZERO" => 0.0,
        _ => return None,
    };
    let column = |i| {
        let number = |j| Value::Scalar(float(if i == j { diagonal } else { 0.0 }));
        Value::Vector(Scalar::F32, (0..size).map(number).collect())
    };
    Some(Value::Matrix((0..size).map(column).collect()))
}

/// The components of a vector; of anything else nothing.
fn components(vector: &Value) -> Vec<Value> {
    match vector {
        Value::Vector(_, all) => all.clone(),
        _ => Vec::new(),
    }
}

impl Evaluator<'_> {
    /// A function of a vector type: `Vec2::new(x, y)`.
    pub(super) fn vector_function(
        &mut self,
        frame: &Frame,
        scalar: Scalar,
        size: usize,
        name: &str,
        args: Vec<Value>,
        span: Span,
    ) -> Done<Value> {
        match name {
            "new" if args.len() == size => {
                let all = args
                    .into_iter()
                    .map(|v| self.scalar(frame, v, scalar, span));
                Ok(Value::Vector(scalar, all.collect::<Done<_>>()?))
            }
            "splat" if args.len() == 1 => {
                let value = args.into_iter().next().unwrap_or(Value::Unit);
                let value = self.scalar(frame, value, scalar, span)?;
                let value = self.part(value, "component");
                Ok(Value::Vector(scalar, vec![value; size]))
            }
            _ => {
                let mut args = args.into_iter().map(|v| self.read(v)).collect::<Vec<_>>();
                if let Some(Value::Vector(s, all)) = args.first().cloned() {
                    args.remove(0);
                    return self.vector_method(frame, s, all, name, args, span);
                }
                Err(self.refuse(frame, span, format!("a vector's `{name}` has no form here")))
            }
        }
    }

    pub(super) fn vector_method(
        &mut self,
        frame: &Frame,
        scalar: Scalar,
        all: Vec<Value>,
        name: &str,
        args: Vec<Value>,
        span: Span,
    ) -> Done<Value> {
        let args: Vec<Value> = args.into_iter().map(|v| self.read(v)).collect();
        let is_float = scalar == Scalar::F32;
        let own = Value::Vector(scalar, all.clone());
        match (name, args.as_slice()) {
            ("dot", [Value::Vector(_, other)]) if is_float => {
                self.sum_of_products(frame, &all, other, span)
            }
            ("length_squared", []) if is_float => self.square(frame, own, span),
            ("length", []) if is_float => self.length(frame, own, span),
            ("distance", [other]) if is_float => {
                let between = self.operation(frame, Binary::Subtract, own, other.clone(), span)?;
                self.length(frame, between, span)
            }
            ("normalize", []) if is_float => {
                let own = self.part(own, "side");
                let length = self.length(frame, own.clone(), span)?;
                let one = Value::Scalar(float(1.0));
                let reciprocal = self.operation(frame, Binary::Divide, one, length, span)?;
                self.operation(frame, Binary::Multiply, own, reciprocal, span)
            }
            ("cross", [other @ Value::Vector(..)]) if is_float && all.len() == 3 => {
                let own = components(&self.part(own, "first"));
                let other = components(&self.part(other.clone(), "second"));
                let mut crossed = Vec::new();
                for (i, j) in [(1, 2), (2, 0), (0, 1)] {
                    let first = self.product(frame, &own[i], &other[j], span)?;
                    let second = self.product(frame, &other[i], &own[j], span)?;
                    crossed.push(self.operation(frame, Binary::Subtract, first, second, span)?);
                }
                Ok(Value::Vector(scalar, crossed))
            }
            ("lerp", [other @ Value::Vector(..), share]) if is_float => {
                let share = self.part(share.clone(), "share");
                let one = Value::Scalar(float(1.0));
                let rest = self.operation(frame, Binary::Subtract, one, share.clone(), span)?;
                let first = self.operation(frame, Binary::Multiply, own, rest, span)?;
                let second = self.operation(frame, Binary::Multiply, other.clone(), share, span)?;
                self.operation(frame, Binary::Add, first, second, span)
            }
            ("clamp", [least, most]) => {
                let least = vec![least.clone()];
                let above = self.vector_method(frame, scalar, all, "max", least, span)?;
                let most = vec![most.clone()];
                self.vector_method(frame, scalar, components(&above), "min", most, span)
            }
            ("min" | "max", [Value::Vector(_, other)]) => {
                let each = all.iter().zip(other);
                let each = each.map(|(a, b)| {
                    self.number_method(frame, name, vec![a.clone(), b.clone()], span)
                });
                Ok(Value::Vector(scalar, each.collect::<Done<_>>()?))
            }
            ("abs" | "floor", []) if is_float => {
                let each = all
                    .iter()
                    .map(|a| self.number_method(frame, name, vec![a.clone()], span));
                Ok(Value::Vector(scalar, each.collect::<Done<_>>()?))
            }
            ("truncate", []) => Ok(Value::Vector(scalar, all[..all.len() - 1].to_vec())),
            ("extend", [last]) => {
                let mut all = all;
                let last = self.scalar(frame, last.clone(), scalar, span)?;
                all.push(last);
                Ok(Value::Vector(scalar, all))
            }
            ("as_ivec2" | "as_uvec2" | "as_vec2" | "as_ivec3" | "as_uvec3" | "as_vec3", []) => {
                let (to, which) = match &name[3..4] {
                    "i" => (Scalar::I32, Builtin::ToI32),
                    "u" => (Scalar::U32, Builtin::ToU32),
                    _ => (Scalar::F32, Builtin::ToF32),
                };
                let mut converted = Vec::with_capacity(all.len());
                for value in all {
                    converted.push(match value {
                        Value::Scalar(e) if is_float && to != Scalar::F32 => {
                            Value::Scalar(self.saturated(e, to))
                        }
                        Value::Scalar(e) => Value::Scalar(builtin(which, vec![e])),
                        other => other,
                    });
                }
                Ok(Value::Vector(to, converted))
            }
            _ => match places(name, all.len()).filter(|_| args.is_empty()) {
                Some(places) => {
                    let own = components(&self.part(own, "component"));
                    let all = places.into_iter().map(|i| own[i].clone());
                    Ok(Value::Vector(scalar, all.collect()))
                }
                None => {
                    let reason = format!("a vector's `{name}` has no form here");
                    Err(self.refuse(frame, span, reason))
                }
            },
        }
    }

    fn product(&mut self, frame: &Frame, a: &Value, b: &Value, span: Span) -> Done<Value> {
        self.operation(frame, Binary::Multiply, a.clone(), b.clone(), span)
    }

    /// Of numbers, or of a matrix's columns and the numbers that they are multiplied by, from the first to the last.
    fn sum_of_products(
        &mut self,
        frame: &Frame,
        all: &[Value],
        by: &[Value],
        span: Span,
    ) -> Done<Value> {
        let mut sum: Option<Value> = None;
        for (one, number) in all.iter().zip(by) {
            let product = self.product(frame, one, number, span)?;
            sum = Some(match sum {
                None => product,
                Some(before) => self.operation(frame, Binary::Add, before, product, span)?,
            });
        }
        Ok(sum.unwrap_or(Value::Unit))
    }

    /// The square of a vector's length.
    fn square(&mut self, frame: &Frame, vector: Value, span: Span) -> Done<Value> {
        let sides = components(&self.part(vector, "side"));
        self.sum_of_products(frame, &sides, &sides, span)
    }

    fn length(&mut self, frame: &Frame, vector: Value, span: Span) -> Done<Value> {
        let square = self.square(frame, vector, span)?;
        self.number_method(frame, "sqrt", vec![square], span)
    }

    /// A function of a matrix type: `Mat4::from_cols(x, y, z, w)`.
    pub(super) fn matrix_function(
        &mut self,
        frame: &Frame,
        size: usize,
        name: &str,
        args: Vec<Value>,
        span: Span,
    ) -> Done<Value> {
        let args: Vec<Value> = args.into_iter().map(|v| self.read(v)).collect();
        match (name, args.as_slice()) {
            ("from_cols", columns) if columns.len() == size => Ok(Value::Matrix(args)),
            (_, [Value::Matrix(columns), rest @ ..]) => {
                self.matrix_method(frame, columns.clone(), name, rest.to_vec(), span)
            }
            _ => Err(self.refuse(frame, span, format!("a matrix's `{name}` has no form here"))),
        }
    }

    pub(super) fn matrix_method(
        &mut self,
        frame: &Frame,
        columns: Vec<Value>,
        name: &str,
        args: Vec<Value>,
        span: Span,
    ) -> Done<Value> {
        let args: Vec<Value> = args.into_iter().map(|v| self.read(v)).collect();
        let size = columns.len();
        let is = |value: &Value, size: usize| match value {
            Value::Vector(Scalar::F32, all) => all.len() == size,
            _ => false,
        };
        match (name, args.as_slice()) {
            ("transpose", []) => {
                let rows = |i: usize| {
                    let row = columns.iter().map(|c| components(c).swap_remove(i));
                    Value::Vector(Scalar::F32, row.collect())
                };
                Ok(Value::Matrix((0..size).map(rows).collect()))
            }
            ("mul_vec2" | "mul_vec3" | "mul_vec4", [v]) if is(v, size) => {
                self.sum_of_products(frame, &columns, &components(v), span)
            }
            ("mul_mat2" | "mul_mat3" | "mul_mat4", [m @ Value::Matrix(_)]) => {
                let own = Value::Matrix(columns);
                self.matrix_operation(frame, Binary::Multiply, own, m.clone(), span)
            }
            // The last component is 1 or 0.
            ("transform_point3" | "project_point3", [v]) if size == 4 && is(v, 3) => {
                let moved = self.sum_of_products(frame, &columns[..3], &components(v), span)?;
                let last = columns[3].clone();
                let moved = self.operation(frame, Binary::Add, last, moved, span)?;
                let moved = self.part(moved, "clip");
                let (place, w) = (components(&moved)[..3].to_vec(), &components(&moved)[3]);
                let place = Value::Vector(Scalar::F32, place);
                if name == "transform_point3" {
                    return Ok(place);
                }
                self.operation(frame, Binary::Divide, place, w.clone(), span)
            }
            ("transform_vector3", [v]) if size == 4 && is(v, 3) => {
                let moved = self.sum_of_products(frame, &columns[..3], &components(v), span)?;
                Ok(Value::Vector(Scalar::F32, components(&moved)[..3].to_vec()))
            }
            _ => Err(self.refuse(frame, span, format!("a matrix's `{name}` has no form here"))),
        }
    }

    /// An operator one of whose operands is a matrix.
    pub(super) fn matrix_operation(
        &mut self,
        frame: &Frame,
        op: Binary,
        a: Value,
        b: Value,
        span: Span,
    ) -> Done<Value> {
        match (op, &a, &b) {
            (Binary::Multiply, Value::Matrix(columns), Value::Vector(Scalar::F32, by))
                if columns.len() == by.len() =>
            {
                self.sum_of_products(frame, columns, by, span)
            }
            (Binary::Multiply, Value::Matrix(first), Value::Matrix(second))
                if first.len() == second.len() =>
            {
                let each = |this: &mut Self, v: &Value| this.part(v.clone(), "column");
                let first: Vec<Value> = first.iter().map(|v| each(self, v)).collect();
                let columns = second
                    .iter()
                    .map(|by| self.sum_of_products(frame, &first, &components(by), span));
                Ok(Value::Matrix(columns.collect::<Done<_>>()?))
            }
            (Binary::Add | Binary::Subtract, Value::Matrix(first), Value::Matrix(second))
                if first.len() == second.len() =>
            {
                let columns = first.iter().zip(second);
                let columns =
                    columns.map(|(a, b)| self.operation(frame, op, a.clone(), b.clone(), span));
                Ok(Value::Matrix(columns.collect::<Done<_>>()?))
            }
            (
                Binary::Multiply | Binary::Divide,
                Value::Matrix(columns),
                Value::Scalar(_) | Value::Fraction(..),
            ) => {
                let by = self.part(b.clone(), "factor");
                let columns = columns
                    .iter()
                    .map(|column| self.operation(frame, op, column.clone(), by.clone(), span));
                Ok(Value::Matrix(columns.collect::<Done<_>>()?))
            }
            _ => {
                let reason = format!(
                    "this operator of {} and {} has no form here",
                    a.what(),
                    b.what()
                );
                Err(self.refuse(frame, span, reason))
            }
        }
    }
}

/// The components that a swizzle takes of a vector of so many: of `zx`, 2 and 0.
fn places(swizzle: &str, size: usize) -> Option<Vec<usize>> {
    if !(2..=4).contains(&swizzle.len()) {
        return None;
    }
    swizzle.chars().map(|c| "xyzw"[..size].find(c)).collect()
}
