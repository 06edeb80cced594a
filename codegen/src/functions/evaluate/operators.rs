//! Operators: unary and binary ones, of numbers, vectors, and fractions that have no type yet.

use proc_macro2::Span;
use syn::spanned::Spanned;

use super::{Done, Evaluator, Frame};
use crate::functions::fold::{self, binary, builtin, unary};
use crate::functions::ir::{Binary, Builtin, Type, Unary};
use crate::functions::value::Value;

impl Evaluator<'_> {
    pub(super) fn unary(&mut self, frame: &mut Frame, u: &syn::ExprUnary) -> Done<Value> {
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

    pub(super) fn binary(&mut self, frame: &mut Frame, b: &syn::ExprBinary) -> Done<Value> {
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

    pub(in crate::functions) fn operation(
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
}
