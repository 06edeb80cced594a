//! What an expression of the source is while it is translated. Only numbers are left to the shader;
//! everything made of them is taken apart here.

use std::collections::HashMap;
use std::rc::Rc;

use super::fold;
use super::ir::{COLUMNS, Expr, Id, Kind, Literal, Scalar, Type};
use super::source::ModuleId;

/// A value.
#[derive(Clone)]
pub enum Value {
    /// `()`
    Unit,
    /// A scalar of the shader, known or not.
    Scalar(Expr),
    /// A whole number that is known and that the shader never sees: `usize`, or a literal whose type
    /// is not said.
    Int(i128),
    /// A fraction that is known and whose type is not said: as `f64` and as `f32`.
    Fraction(f64, f32),
    /// A known `f64`.
    Double(f64),
    /// A glam vector.
    Vector(Scalar, Vec<Value>),
    /// A glam matrix: its columns.
    Matrix(Vec<Value>),
    /// A structure: its identity and its fields. Those of a tuple structure are named by number.
    Struct(Rc<str>, Vec<(String, Value)>),
    /// A tuple.
    Tuple(Vec<Value>),
    /// An array.
    Array(Vec<Value>),
    /// A closure.
    Closure(Rc<Closure>),
    /// A function by its path, seen from a module.
    Path(ModuleId, Rc<syn::ExprPath>),
    /// A variant of an enumeration, by its path.
    Variant(String),
    /// What the host looks up.
    Lookup(Id),
    /// A reference to something that can be changed.
    Ref(Place),
    /// A text.
    Text,
}

/// A closure and what it sees.
pub struct Closure {
    /// Its source.
    pub source: syn::ExprClosure,
    /// The names around it.
    pub names: HashMap<String, usize>,
    /// The generic parameters around it.
    pub generics: HashMap<String, Generic>,
    /// The module around it.
    pub module: ModuleId,
    /// The type around it.
    pub own: Option<Rc<str>>,
}

/// What a generic parameter stands for.
#[derive(Clone, Debug, PartialEq)]
pub enum Generic {
    /// A number type: `f32`.
    Real,
    /// A structure, by its identity.
    Struct(Rc<str>),
    /// A constant number.
    Const(i128),
    /// A constant that is true or false.
    Bool(bool),
}

/// A variable, or a part of one.
#[derive(Clone, Debug, PartialEq)]
pub struct Place {
    /// The variable.
    pub slot: usize,
    /// The way to the part.
    pub path: Vec<Step>,
}

/// A step to a part.
#[derive(Clone, Debug, PartialEq)]
pub enum Step {
    /// A field.
    Field(String),
    /// An element.
    Index(usize),
}

impl Value {
    /// A truth value that is known.
    pub fn bool(value: bool) -> Self {
        Self::Scalar(fold::literal(Literal::Bool(value)))
    }

    /// A known truth value's.
    pub fn as_bool(&self) -> Option<bool> {
        match self {
            Self::Scalar(e) => match e.kind {
                Kind::Literal(Literal::Bool(b)) => Some(b),
                _ => None,
            },
            _ => None,
        }
    }

    /// A known whole number's.
    pub fn as_int(&self) -> Option<i128> {
        match self {
            Self::Int(i) => Some(*i),
            Self::Scalar(e) => match e.kind {
                Kind::Literal(Literal::U32(v)) => Some(v.into()),
                Kind::Literal(Literal::I32(v)) => Some(v.into()),
                _ => None,
            },
            _ => None,
        }
    }

    /// A known fraction's, as `f64`.
    pub fn as_double(&self) -> Option<f64> {
        match self {
            Self::Double(v) | Self::Fraction(v, _) => Some(*v),
            Self::Scalar(e) => match e.kind {
                Kind::Literal(Literal::F32(v)) => Some(v.into()),
                _ => None,
            },
            _ => None,
        }
    }

    /// Whether nothing of it is left to the shader.
    pub fn is_known(&self) -> bool {
        match self {
            Self::Scalar(e) => matches!(e.kind, Kind::Literal(_)),
            Self::Vector(_, all) | Self::Matrix(all) | Self::Tuple(all) | Self::Array(all) => {
                all.iter().all(Self::is_known)
            }
            Self::Struct(_, fields) => fields.iter().all(|(_, v)| v.is_known()),
            _ => true,
        }
    }

    /// Its scalars, each with what it is called: `name` for the value itself.
    pub fn each_scalar(&mut self, name: &str, with: &mut dyn FnMut(&str, &mut Expr)) {
        match self {
            Self::Scalar(e) => with(name, e),
            Self::Vector(_, all) => {
                for (v, part) in all.iter_mut().zip(["x", "y", "z", "w"]) {
                    v.each_scalar(&format!("{name}_{part}"), with);
                }
            }
            Self::Matrix(all) => {
                for (v, part) in all.iter_mut().zip(["x", "y", "z", "w"]) {
                    v.each_scalar(&format!("{name}_{part}"), with);
                }
            }
            Self::Tuple(all) => {
                for (v, i) in all.iter_mut().zip(["a", "b", "c", "d", "e", "f"]) {
                    v.each_scalar(&format!("{name}_{i}"), with);
                }
            }
            Self::Array(all) => {
                for (i, v) in all.iter_mut().enumerate() {
                    v.each_scalar(&format!("{name}{i}"), with);
                }
            }
            Self::Struct(_, fields) => {
                let single = fields.len() == 1;
                for (field, v) in fields {
                    // The one field of a wrapper says nothing.
                    if single || field.starts_with(|c: char| c.is_ascii_digit()) {
                        v.each_scalar(name, with);
                    } else {
                        v.each_scalar(field, with);
                    }
                }
            }
            _ => {}
        }
    }

    /// The part at the end of a way.
    pub fn part(&mut self, path: &[Step]) -> Option<&mut Self> {
        let Some((first, rest)) = path.split_first() else {
            return Some(self);
        };
        let next = match (self, first) {
            (Self::Struct(_, fields), Step::Field(name)) => {
                fields.iter_mut().find(|(n, _)| n == name).map(|(_, v)| v)
            }
            (Self::Vector(_, all), Step::Field(name)) => {
                let i = ["x", "y", "z", "w"].iter().position(|n| n == name)?;
                all.get_mut(i)
            }
            (Self::Matrix(all), Step::Field(name)) => {
                let i = COLUMNS.iter().position(|n| n == name)?;
                all.get_mut(i)
            }
            (Self::Tuple(all), Step::Field(name)) => all.get_mut(name.parse::<usize>().ok()?),
            (Self::Array(all), Step::Index(i)) => all.get_mut(*i),
            _ => None,
        };
        next?.part(rest)
    }

    /// What it is, for messages.
    pub fn what(&self) -> String {
        match self {
            Self::Unit => "`()`".into(),
            Self::Scalar(e) => match e.ty {
                Type::Scalar(Scalar::F32) => "a float".into(),
                Type::Scalar(Scalar::Bool) => "a truth value".into(),
                _ => "an integer".into(),
            },
            Self::Int(_) => "a whole number that is known".into(),
            Self::Fraction(..) | Self::Double(_) => "a fraction that is known".into(),
            Self::Vector(..) => "a vector".into(),
            Self::Matrix(_) => "a matrix".into(),
            Self::Struct(name, _) => format!("a `{}`", name.rsplit("::").next().unwrap_or(name)),
            Self::Tuple(_) => "a tuple".into(),
            Self::Array(_) => "an array".into(),
            Self::Closure(_) | Self::Path(..) => "a function".into(),
            Self::Variant(name) => format!("`{name}`"),
            Self::Lookup(_) => "a lookup".into(),
            Self::Ref(_) => "a reference".into(),
            Self::Text => "a text".into(),
        }
    }
}
