//! Makes expressions, and computes what is known: exactly as `f32` does it, so that a folded
//! constant has the bits that the native code computes. What is dropped besides is `x + 0`, `x * 1`
//! and `x * 0`, for finite numbers the same but for the sign of a zero.

use std::rc::Rc;

use super::ir::{Binary, Builtin, Expr, Id, Kind, Literal, Node, Scalar, Type, Unary};

/// An expression.
pub fn node(ty: Type, kind: Kind) -> Expr {
    Rc::new(Node { ty, kind })
}

/// A number.
pub fn literal(value: Literal) -> Expr {
    node(Type::Scalar(value.scalar()), Kind::Literal(value))
}

/// A float.
pub fn float(value: f32) -> Expr {
    literal(Literal::F32(value))
}

/// A local.
pub fn local(id: Id, ty: Type) -> Expr {
    node(ty, Kind::Local(id))
}

/// The number, if it is one.
pub fn known(e: &Expr) -> Option<Literal> {
    match e.kind {
        Kind::Literal(l) => Some(l),
        _ => None,
    }
}

fn is(e: &Expr, value: f32) -> bool {
    matches!(known(e), Some(Literal::F32(x)) if x == value)
}

/// A component or member.
pub fn member(of: &Expr, name: &str, ty: Type) -> Expr {
    node(ty, Kind::Member(of.clone(), name.into()))
}

/// `-x`, `!x`
pub fn unary(op: Unary, x: &Expr) -> Expr {
    match (op, known(x)) {
        (Unary::Negate, Some(Literal::F32(v))) => return float(-v),
        (Unary::Negate, Some(Literal::I32(v))) => return literal(Literal::I32(v.wrapping_neg())),
        (Unary::Not, Some(Literal::Bool(v))) => return literal(Literal::Bool(!v)),
        (Unary::Invert, Some(Literal::U32(v))) => return literal(Literal::U32(!v)),
        (Unary::Invert, Some(Literal::I32(v))) => return literal(Literal::I32(!v)),
        _ => {}
    }
    if let Kind::Unary(inner, y) = &x.kind
        && *inner == op
    {
        return y.clone();
    }
    node(x.ty.clone(), Kind::Unary(op, x.clone()))
}

/// `a op b`, both of one type.
pub fn binary(op: Binary, a: &Expr, b: &Expr) -> Expr {
    let ty = match op {
        Binary::Less
        | Binary::LessEqual
        | Binary::Greater
        | Binary::GreaterEqual
        | Binary::Equal
        | Binary::NotEqual => Type::BOOL,
        _ => a.ty.clone(),
    };
    if let (Some(x), Some(y)) = (known(a), known(b))
        && let Some(value) = computed(op, x, y)
    {
        return literal(value);
    }
    match op {
        Binary::Add if is(a, 0.0) => return b.clone(),
        Binary::Add | Binary::Subtract if is(b, 0.0) => return a.clone(),
        Binary::Subtract if is(a, 0.0) => return unary(Unary::Negate, b),
        Binary::Multiply if is(a, 1.0) => return b.clone(),
        Binary::Multiply | Binary::Divide if is(b, 1.0) => return a.clone(),
        Binary::Multiply if is(a, -1.0) => return unary(Unary::Negate, b),
        Binary::Multiply | Binary::Divide if is(b, -1.0) => return unary(Unary::Negate, a),
        Binary::Multiply if is(a, 0.0) || is(b, 0.0) => return float(0.0),
        Binary::And | Binary::Or => {
            let neutral = op == Binary::And;
            match (known(a), known(b)) {
                (Some(Literal::Bool(v)), _) => {
                    return if v == neutral { b.clone() } else { a.clone() };
                }
                (_, Some(Literal::Bool(v))) => {
                    return if v == neutral { a.clone() } else { b.clone() };
                }
                _ => {}
            }
        }
        _ => {}
    }
    // What a person writes: `a - b` for `a + -b`. The bits are the same.
    if let (Binary::Add | Binary::Subtract, Some(Literal::F32(v))) = (op, known(b))
        && v < 0.0
    {
        let op = if op == Binary::Add {
            Binary::Subtract
        } else {
            Binary::Add
        };
        return node(ty, Kind::Binary(op, a.clone(), float(-v)));
    }
    if let (Binary::Add | Binary::Subtract, Kind::Unary(Unary::Negate, y)) = (op, &b.kind)
        && a.ty == Type::F32
    {
        let op = if op == Binary::Add {
            Binary::Subtract
        } else {
            Binary::Add
        };
        return binary(op, a, y);
    }
    node(ty, Kind::Binary(op, a.clone(), b.clone()))
}

fn computed(op: Binary, a: Literal, b: Literal) -> Option<Literal> {
    Some(match (a, b) {
        (Literal::F32(a), Literal::F32(b)) => {
            let number = match op {
                Binary::Add => a + b,
                Binary::Subtract => a - b,
                Binary::Multiply => a * b,
                Binary::Divide => a / b,
                _ => {
                    return Some(Literal::Bool(match op {
                        Binary::Less => a < b,
                        Binary::LessEqual => a <= b,
                        Binary::Greater => a > b,
                        Binary::GreaterEqual => a >= b,
                        Binary::Equal => a == b,
                        Binary::NotEqual => a != b,
                        _ => return None,
                    }));
                }
            };
            if !number.is_finite() {
                return None;
            }
            Literal::F32(number)
        }
        (Literal::U32(a), Literal::U32(b)) => match op {
            Binary::Add => Literal::U32(a.wrapping_add(b)),
            Binary::Subtract => Literal::U32(a.wrapping_sub(b)),
            Binary::Multiply => Literal::U32(a.wrapping_mul(b)),
            Binary::Divide => Literal::U32(a.checked_div(b)?),
            Binary::BitAnd => Literal::U32(a & b),
            Binary::BitOr => Literal::U32(a | b),
            Binary::BitXor => Literal::U32(a ^ b),
            Binary::ShiftLeft => Literal::U32(a.checked_shl(b)?),
            Binary::ShiftRight => Literal::U32(a.checked_shr(b)?),
            Binary::Less => Literal::Bool(a < b),
            Binary::LessEqual => Literal::Bool(a <= b),
            Binary::Greater => Literal::Bool(a > b),
            Binary::GreaterEqual => Literal::Bool(a >= b),
            Binary::Equal => Literal::Bool(a == b),
            Binary::NotEqual => Literal::Bool(a != b),
            Binary::And | Binary::Or => return None,
        },
        (Literal::I32(a), Literal::I32(b)) => match op {
            Binary::Add => Literal::I32(a.wrapping_add(b)),
            Binary::Subtract => Literal::I32(a.wrapping_sub(b)),
            Binary::Multiply => Literal::I32(a.wrapping_mul(b)),
            Binary::Divide => Literal::I32(a.checked_div(b)?),
            Binary::Less => Literal::Bool(a < b),
            Binary::LessEqual => Literal::Bool(a <= b),
            Binary::Greater => Literal::Bool(a > b),
            Binary::GreaterEqual => Literal::Bool(a >= b),
            Binary::Equal => Literal::Bool(a == b),
            Binary::NotEqual => Literal::Bool(a != b),
            _ => return None,
        },
        (Literal::Bool(a), Literal::Bool(b)) => Literal::Bool(match op {
            Binary::And => a && b,
            Binary::Or => a || b,
            Binary::Equal => a == b,
            Binary::NotEqual | Binary::BitXor => a != b,
            _ => return None,
        }),
        _ => return None,
    })
}

/// Something that every language has.
pub fn builtin(which: Builtin, args: Vec<Expr>) -> Expr {
    let floats: Option<Vec<f32>> = args
        .iter()
        .map(|a| match known(a) {
            Some(Literal::F32(v)) => Some(v),
            _ => None,
        })
        .collect();
    if let Some(v) = floats {
        let number = match (which, v.as_slice()) {
            (Builtin::Min, [a, b]) => Some(if a < b { *a } else { *b }),
            (Builtin::Max, [a, b]) => Some(if a > b { *a } else { *b }),
            (Builtin::Abs, [a]) => Some(a.abs()),
            (Builtin::Sqrt, [a]) if *a >= 0.0 => Some(a.sqrt()),
            (Builtin::Floor, [a]) => Some(a.floor()),
            _ => None,
        };
        if let Some(number) = number {
            return float(number);
        }
        match (which, v.as_slice()) {
            (Builtin::ToI32, [a]) => return literal(Literal::I32(*a as i32)),
            (Builtin::ToU32, [a]) => return literal(Literal::U32(*a as u32)),
            (Builtin::BitsOf, [a]) => return literal(Literal::U32(a.to_bits())),
            (Builtin::ToF32, [a]) => return float(*a),
            _ => {}
        }
    }
    match (which, args.as_slice()) {
        (Builtin::Select, [condition, a, b]) => {
            if let Some(Literal::Bool(holds)) = known(condition) {
                return if holds { a.clone() } else { b.clone() };
            }
            if a == b {
                return a.clone();
            }
        }
        (Builtin::ToF32, [a]) => match known(a) {
            Some(Literal::U32(v)) => return float(v as f32),
            Some(Literal::I32(v)) => return float(v as f32),
            _ if a.ty == Type::F32 => return a.clone(),
            _ => {}
        },
        (Builtin::ToU32, [a]) => match known(a) {
            Some(Literal::I32(v)) => return literal(Literal::U32(v as u32)),
            _ if a.ty == Type::U32 => return a.clone(),
            _ => {}
        },
        (Builtin::ToI32, [a]) => match known(a) {
            Some(Literal::U32(v)) => return literal(Literal::I32(v as i32)),
            _ if a.ty == Type::I32 => return a.clone(),
            _ => {}
        },
        (Builtin::FromBits, [a]) => {
            if let Some(Literal::U32(v)) = known(a)
                && f32::from_bits(v).is_finite()
            {
                return float(f32::from_bits(v));
            }
        }
        _ => {}
    }
    let ty = match which {
        Builtin::ToF32 | Builtin::FromBits => Type::F32,
        Builtin::ToU32 | Builtin::BitsOf => Type::U32,
        Builtin::ToI32 => Type::I32,
        Builtin::Select => args[1].ty.clone(),
        _ => args[0].ty.clone(),
    };
    node(ty, Kind::Builtin(which, args))
}

/// Whether it is a local, or a member of one.
fn is_place(e: &Expr) -> bool {
    match &e.kind {
        Kind::Local(_) => true,
        Kind::Member(of, _) => is_place(of),
        _ => false,
    }
}

/// A vector from its components: as it is if these are all of one vector, in order.
pub fn vector(scalar: Scalar, parts: Vec<Expr>) -> Expr {
    let ty = Type::Vector(scalar, parts.len());
    let whole = parts
        .iter()
        .zip(["x", "y", "z", "w"])
        .map(|(p, name)| match &p.kind {
            Kind::Member(of, member) if member == name && of.ty == ty => Some(of),
            _ => None,
        });
    let whole: Option<Vec<_>> = whole.collect();
    if let Some(all) = whole
        && all.windows(2).all(|w| w[0] == w[1])
        && let Some(first) = all.first()
        && is_place(first)
    {
        return (*first).clone();
    }
    node(ty, Kind::Construct(parts))
}
